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
//! | JPK thermal noise | `.tnd` | spectra, settings |
//! | Bruker Nanoscope | `.spm`, `.000`–`.999`, `.pfc` | curves, force volumes, images; k, InvOLS |
//! | Nanosurf | `.nid` | curves and maps, images, thermal spectra; k, InvOLS |
//! | Igor, of Asylum Research | `.ibw` | a curve with its segments, or images; k, InvOLS, the note |
//! | Asylum Research | `.ardf` | curves and images; written without a real file at hand |
//! | Gwyddion | `.gwy`, `.gsf` | images, metadata |
//! | AFM Workshop | `.csv` | a curve; k and InvOLS where they are set |
//! | NT-MDT Nova | text | a curve; deflection in A, no InvOLS |
//! | Optics11 Chiaro | text | a curve, cut where the piezo turns; k |
//! | Universal force format | `.uff` | a curve; k, InvOLS |
//! | WSxM | `.stp`, `.top` | an image |
//! | zip | `.zip` | the content of all files in it |
//!
//! HDF5 files and high-speed videos (`.asd`) are recognised and refused with their name.
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
//! Curves are decoded one by one, so a map of 256 × 256 curves needs the memory of its bytes and of one
//! curve. No file makes a reader panic or take unbounded memory or time: sizes are checked before memory
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
mod igor;
mod jpk;
mod jpk_image;
mod limits;
mod nanosurf;
mod ntmdt;
mod table;
mod text;
mod thermal;
mod uff;
mod workshop;
mod wsxm;
mod zip;

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
    let Some(format) = recognise(&bytes) else {
        return Err(Error::Unknown {
            beginning: format::beginning(&bytes),
        });
    };
    match format {
        Format::Jpk => jpk::read(bytes, limits),
        Format::JpkImage => jpk_image::read(&bytes, limits),
        Format::JpkThermal => thermal::read(&bytes, limits),
        Format::Nanoscope => bruker::read(bytes, limits),
        Format::Nanosurf => nanosurf::read(bytes, limits),
        Format::Igor => igor::read(&bytes, limits),
        Format::Ardf => ardf::read(bytes, limits),
        Format::Gwyddion => gwyddion::read(&bytes, limits),
        Format::Gsf => gsf::read(&bytes, limits),
        Format::Workshop => workshop::read(&bytes, limits),
        Format::NtMdtText => ntmdt::read(&bytes, limits),
        Format::Chiaro => chiaro::read(&bytes, limits),
        Format::Uff => uff::read(&bytes, limits),
        Format::Wsxm => wsxm::read(&bytes, limits),
        Format::Zip => archive::read(bytes, limits),
        Format::Asd => Err(format.unsupported(
            "a high-speed AFM video (.asd)",
            "only curves, images and spectra are read",
        )),
        Format::Hdf5 => Err(format.unsupported(hdf5_content(&bytes), "HDF5 is not read")),
    }
}

/// What an HDF5 file is, by names in it.
fn hdf5_content(bytes: &[u8]) -> &'static str {
    let has = |name: &[u8]| bytes.windows(name.len()).any(|of| of == name);
    if has(b"afmformats") {
        "an HDF5 file of afmformats"
    } else if has(b"JPK") {
        "an HDF5 file of JPK"
    } else {
        "an HDF5 file"
    }
}
