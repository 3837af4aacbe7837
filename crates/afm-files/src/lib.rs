//! Readers of the files that atomic force microscopes write: bytes in; curves, maps, images and
//! spectra out, in SI units.
//!
//! ```
//! # let bytes = b"Force-Distance Curve\nPoint:\t1\nForce Constant, nN/nm:\t0.5\n\
//! #   Extend Z-Sense(nm),Extend Force(nN)\n100,0.0\n101,0.5\n".to_vec();
//! let document = afm_files::read(bytes)?;
//! for curve in document.curves() {
//!     let curve = curve?;
//!     for segment in &curve.segments {
//!         let (z, d) = (curve.distance_in(segment), curve.deflection_in(segment));
//!         if let (Some(z), Some(d)) = (z, d) {
//!             println!("{}: {} points, {} in {}", segment.style, segment.points(), d.name, d.unit);
//!             assert_eq!(z.unit, "m");
//!         }
//!     }
//!     println!("k = {:?} N/m; {}", curve.spring_constant, curve.notes.join("; "));
//! }
//! # Ok::<(), afm_files::Error>(())
//! ```
//!
//! A file is recognised by its content, never by its name ([`recognise`]). The crate knows nothing of
//! levers, contact laws or fits.
//!
//! # What each format gives
//!
//! | Format | Files | Gives |
//! |---|---|---|
//! | JPK | `.jpk-force`, `.jpk-force-map`, `.jpk-qi-data`, `.jpk-qi-series` | curves with all segments (pauses and modulations too), k, InvOLS, positions, the grid, images inside |
//! | JPK images | `.jpk`, `.jpk-qi-image` | images, trace and retrace |
//! | HDF5 of JPK | `.h5-jpk` | images, each frame of a series |
//! | JPK thermal noise | `.tnd` | spectra, settings |
//! | Bruker Nanoscope | `.spm`, `.000`–`.999`, `.pfc` | curves, force volumes, positions, the grid, images; k, InvOLS |
//! | Nanosurf | `.nid` | curves and maps, positions, the grid, images, thermal spectra; k, InvOLS |
//! | Igor, of Asylum Research | `.ibw` | a curve with its segments, images, or a spectrum; k, InvOLS, the note |
//! | Asylum Research | `.ardf` | curves and images; written without a real file at hand |
//! | Gwyddion | `.gwy`, `.gsf` | images, metadata |
//! | AFM Workshop | `.csv` | a curve with its position; k and InvOLS where they are set |
//! | NT-MDT Nova | text | a curve; deflection in A, no InvOLS |
//! | Optics11 Chiaro | text | a curve, cut where the piezo turns; k |
//! | HDF5 of afmformats | `.h5` | curves and maps, cut into segments; k, InvOLS, positions, the grid |
//! | Universal force format | `.uff` | a curve; k, InvOLS |
//! | WSxM | `.stp`, `.top` | an image |
//! | zip | `.zip` | the content of all files in it; the grid of an AFM Workshop map, by its positions |
//!
//! Files that are recognised and refused with their name: other HDF5 files, high-speed videos (`.asd`),
//! Igor experiments (`.pxp`), and Igor waves of older versions or without named channels.
//!
//! # Distance
//!
//! Each curve has one distance channel that all its segments have: a height that a sensor measured if
//! there is one, else the commanded height, else a ramp computed from the header. A note says which, and
//! how far it differs from the commanded one; moduli from a commanded height are often wrong by a factor
//! of two. [`Distance::grows_toward_surface`] says which way it runs.
//!
//! # Memory and hostile files
//!
//! Curves are decoded one by one, in any order and from several threads at once ([`Document::curve`]
//! takes `&self`). [`open`] leaves maps of JPK, Bruker, Nanosurf and HDF5 on the disk: only a directory of
//! their curves is in memory, so they may be larger than it. [`read`] takes the bytes of a file instead.
//!
//! No file makes a reader panic or take unbounded memory or time: sizes are checked before memory
//! is taken, and [`Limits`] bounds what is decoded.
#![forbid(unsafe_code)]

mod archive;
mod ardf;
mod bruker;
mod bytes;
mod chiaro;
mod distance;
mod document;
mod error;
mod format;
mod gsf;
mod gwyddion;
mod hdf5;
mod igor;
mod jpk;
mod jpk_image;
mod limits;
mod nanosurf;
mod ntmdt;
mod source;
mod text;
mod text_table;
mod thermal;
mod uff;
mod workshop;
mod wsxm;
mod zip;

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

use source::Source;
use zip::Archive;

pub use document::{
    Channel, Curve, Distance, DistanceSource, Document, Grid, Image, Segment, Spectrum, Style,
};
pub use error::{Error, Place};
pub use format::{Format, recognise};
pub use limits::Limits;

/// Reads a file with the default [`Limits`]. Its name does not matter: the content decides.
///
/// # Errors
///
/// If the content is not recognised, not supported, damaged, or exceeds the limits.
pub fn read(bytes: Vec<u8>) -> Result<Document, Error> {
    read_within(bytes, Limits::default())
}

/// Reads a file within these limits.
///
/// # Errors
///
/// As [`read`].
pub fn read_within(bytes: Vec<u8>, limits: Limits) -> Result<Document, Error> {
    read_source(Source::memory(bytes), limits)
}

/// Reads a file from its path. Maps stay on the disk: memory is needed for their directory and for the
/// curves that are decoded, so that a map may be larger than the memory.
///
/// # Errors
///
/// As [`read`], and [`Error::Io`] if the file cannot be opened or read.
///
/// ```no_run
/// let map = afm_files::open("cells.jpk-qi-data", afm_files::Limits::default())?;
/// for number in 0..map.curve_count() {
///     let curve = map.curve(number)?;
///     println!("{:?} {:?}", curve.position, curve.segments.len());
/// }
/// # Ok::<(), afm_files::Error>(())
/// ```
pub fn open(path: impl AsRef<Path>, limits: Limits) -> Result<Document, Error> {
    let path = path.as_ref();
    #[expect(
        clippy::disallowed_methods,
        reason = "its length is known before it is read"
    )]
    let file = File::open(path);
    let file = file.and_then(|file| {
        if file.metadata()?.is_file() {
            return Ok(file);
        }
        Err(std::io::Error::other("it is a folder or a device"))
    });
    let file = file.map_err(|error| Error::Io {
        problem: format!("`{}`: {error}", path.display()),
    })?;
    read_from(file, limits)
}

/// Reads a file that is open, such as a [`File`], as [`open`] does: from its beginning, wherever its
/// position is.
///
/// # Errors
///
/// As [`open`].
pub fn read_from(
    file: impl Read + Seek + Send + 'static,
    limits: Limits,
) -> Result<Document, Error> {
    read_source(Source::device(file)?, limits)
}

fn read_source(source: Source, limits: Limits) -> Result<Document, Error> {
    let head = source.beginning(format::BEGINNING, Format::Zip)?;
    let Some(format) = format::by_beginning(&head) else {
        return Err(Error::Unknown {
            beginning: format::beginning(&head),
        });
    };
    drop(head);
    let whole = |source: Source| source.whole(limits, format);
    match format {
        Format::Zip | Format::Jpk => {
            let archive = Archive::open(source)?;
            if archive.find(jpk::HEADER).is_some() {
                jpk::read(archive, limits)
            } else {
                archive::read(archive, limits)
            }
        }
        Format::JpkImage => jpk_image::read(&whole(source)?, limits),
        Format::JpkThermal => thermal::read(&whole(source)?, limits),
        Format::Nanoscope => bruker::read(source, limits),
        Format::Nanosurf => nanosurf::read(source, limits),
        Format::Igor => igor::read(&whole(source)?, limits),
        Format::Ardf => ardf::read(whole(source)?, limits),
        Format::Gwyddion => gwyddion::read(&whole(source)?, limits),
        Format::Gsf => gsf::read(&whole(source)?, limits),
        Format::Workshop => workshop::read(&whole(source)?, limits),
        Format::NtMdtText => ntmdt::read(&whole(source)?, limits),
        Format::Chiaro => chiaro::read(&whole(source)?, limits),
        Format::Uff => uff::read(&whole(source)?, limits),
        Format::Wsxm => wsxm::read(&whole(source)?, limits),
        Format::Asd => Err(format.unsupported(
            "a high-speed AFM video (.asd)",
            "only curves, images and spectra are read",
        )),
        Format::IgorExperiment => Err(format.unsupported(
            "an Igor experiment (.pxp)",
            "save its waves as .ibw, which are read",
        )),
        Format::Hdf5 => hdf5::read(source, limits),
    }
}
