//! What the files of instruments hold, without a case: formats, curves, maps, images and spectra.

use std::path::{Path, PathBuf};

pub use afm_files::{Curve, Document, Image, Spectrum};
use afm_files::{Limits, Style};
use schemars::JsonSchema;
use serde::Serialize;

use nanotap_case::input::{self, MAX_TABLE_BYTES, Origin};
use nanotap_error::Error;

/// Most files of a folder, with those of its folders.
const MAX_FILES: usize = 10_000;
/// Most folders within each other.
const MAX_DEPTH: usize = 16;

/// The document of the command `files`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct FileList {
    /// Every instrument's file, and every file that was named.
    pub files: Vec<FileContents>,
    /// How many files of the folders are of no known format.
    pub others: usize,
}

/// What a file holds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct FileContents {
    /// Path of the file.
    pub path: String,
    /// Its format, such as `jpk` or `nanoscope`; none if it is not recognised.
    pub format: Option<String>,
    /// What the instrument calls it; may be empty.
    pub kind: String,
    /// Why it is not read.
    pub error: Option<String>,
    /// How many curves it has.
    pub curve_count: usize,
    /// Columns and rows of the grid of its map.
    pub grid: Option<[usize; 2]>,
    /// Width and height of that grid, m.
    #[schemars(extend("x-unit" = "m"))]
    pub grid_size: Option<[f64; 2]>,
    /// Spring constant of the first curve, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub spring_constant: Option<f64>,
    /// Sensitivity (InvOLS) of the first curve, m/V.
    #[schemars(extend("x-unit" = "m/V"))]
    pub sensitivity: Option<f64>,
    /// Name of the channel that is the distance.
    pub distance: Option<String>,
    /// Where the distance comes from: `measured`, `commanded` or `ramp`.
    pub distance_source: Option<String>,
    /// Name of the channel that is the deflection.
    pub deflection: Option<String>,
    /// Segments of the first curve.
    pub segments: Vec<SegmentContents>,
    /// Its images.
    pub images: Vec<ImageContents>,
    /// Its spectra.
    pub spectra: Vec<SpectrumContents>,
    /// What a reader of the numbers should know.
    pub notes: Vec<String>,
}

/// A segment of a curve.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SegmentContents {
    /// `approach`, `pause`, `retract`, `modulation` or `unsplit`.
    pub style: String,
    /// How many points each channel has.
    pub points: usize,
    /// Duration, s.
    #[schemars(extend("x-unit" = "s"))]
    pub duration: Option<f64>,
    /// Channels, each with its unit as in `height (m)`.
    pub channels: Vec<String>,
}

/// An image.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ImageContents {
    /// Name with the direction of the scan.
    pub name: String,
    /// Unit of its values.
    pub unit: String,
    /// Points in a line, and lines.
    pub shape: [usize; 2],
    /// Width and height, m.
    #[schemars(extend("x-unit" = "m"))]
    pub size: Option<[f64; 2]>,
}

/// A spectrum.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SpectrumContents {
    /// Name in the file.
    pub name: String,
    /// Unit of its values.
    pub unit: String,
    /// How many frequencies it has.
    pub points: usize,
    /// Largest frequency, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub largest_frequency: Option<f64>,
}

/// A curve, an image or a spectrum of a file.
#[derive(Clone, Debug)]
pub enum Item {
    /// A curve.
    Curve(Curve),
    /// An image.
    Image(Image),
    /// A spectrum.
    Spectrum(Spectrum),
}

/// Which item of a file is meant, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// The first curve; without curves the first image, then the first spectrum.
    First,
    /// A curve.
    Curve(usize),
    /// An image.
    Image(usize),
    /// A spectrum.
    Spectrum(usize),
}

/// Lists what files and folders hold; a folder with all its folders.
///
/// # Errors
/// If a path does not exist, cannot be read, or a folder has too many files.
pub fn list(paths: &[PathBuf]) -> Result<FileList, Error> {
    let mut listed = FileList::default();
    for path in paths {
        if !path.is_dir() {
            let document = opened(path, Origin::User)?;
            listed.files.push(FileContents::of(path, document));
            continue;
        }
        let mut files = Vec::new();
        walk(path, 0, &mut files)?;
        files.sort();
        for path in files {
            match opened(&path, Origin::File) {
                Err(_) | Ok(Err(afm_files::Error::Unknown { .. })) => listed.others += 1,
                Ok(document) => listed.files.push(FileContents::of(&path, document)),
            }
        }
    }
    Ok(listed)
}

/// All files of a folder and of its folders; links to folders are not followed.
fn walk(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<(), Error> {
    let failed = |error: std::io::Error| {
        let message = format!("{}: {error}", folder.display());
        Error::input(message, "name a folder that can be read")
    };
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let kind = entry.file_type().map_err(failed)?;
        if kind.is_dir() && depth < MAX_DEPTH {
            walk(&entry.path(), depth + 1, files)?;
        } else if kind.is_file() {
            files.push(entry.path());
        }
        if files.len() > MAX_FILES {
            return Err(Error::input(
                format!("{} has more than {MAX_FILES} files", folder.display()),
                "name a folder with fewer",
            ));
        }
    }
    Ok(())
}

/// A curve, an image or a spectrum of a file.
///
/// # Errors
/// If the file cannot be read or has no such item.
pub fn item(path: &Path, which: Which) -> Result<Item, Error> {
    let document = open(path)?;
    let refuse = |message: String| refused(path, &message);
    let counts = [
        document.curve_count(),
        document.images.len(),
        document.spectra.len(),
    ];
    let which = match which {
        Which::First if counts[0] > 0 => Which::Curve(0),
        Which::First if counts[1] > 0 => Which::Image(0),
        Which::First => Which::Spectrum(0),
        which => which,
    };
    let missing = |what: &str, k: usize, count: usize| {
        refuse(format!("no {what} {k}: it has {count}, counted from 0"))
    };
    match which {
        Which::Image(k) => {
            let found = document.images.into_iter().nth(k).map(Item::Image);
            found.ok_or_else(|| missing("image", k, counts[1]))
        }
        Which::Spectrum(k) => {
            let found = document.spectra.into_iter().nth(k).map(Item::Spectrum);
            found.ok_or_else(|| missing("spectrum", k, counts[2]))
        }
        Which::Curve(k) => {
            let curve = document.curve(k);
            curve
                .map(Item::Curve)
                .map_err(|error| refuse(error.to_string()))
        }
        Which::First => Err(missing("curve", 0, 0)),
    }
}

/// Opens a file, to read its curves one by one.
///
/// # Errors
/// If the file cannot be read, or is none of an instrument that is known here.
pub fn open(path: &Path) -> Result<Document, Error> {
    opened(path, Origin::User)?.map_err(|error| refused(path, &error.to_string()))
}

/// As [`open`], of a file's content.
///
/// # Errors
/// If it is none of an instrument that is known here.
pub fn read(name: &str, bytes: Vec<u8>) -> Result<Document, Error> {
    afm_files::read(bytes).map_err(|error| refused(Path::new(name), &error.to_string()))
}

/// The error of a file in which something is not found.
fn refused(path: &Path, message: &str) -> Error {
    Error::input(
        format!("{}: {message}", path.display()),
        "`nanotap files` lists what a file holds",
    )
}

/// The document of a file that can be read.
fn opened(path: &Path, origin: Origin) -> Result<Result<Document, afm_files::Error>, Error> {
    let file = input::open(path, MAX_TABLE_BYTES, origin)?;
    Ok(afm_files::read_from(file, Limits::default()))
}

impl FileContents {
    fn of(path: &Path, document: Result<Document, afm_files::Error>) -> Self {
        use afm_files::Error::{Damaged, Unsupported};
        let mut contents = Self {
            path: path.display().to_string(),
            ..Self::default()
        };
        let document = match document {
            Ok(document) => document,
            Err(error) => {
                if let Unsupported { format, .. } | Damaged { format, .. } = &error {
                    contents.format = Some(name(format));
                }
                contents.error = Some(error.to_string());
                return contents;
            }
        };
        contents.format = Some(name(&document.format));
        contents.kind.clone_from(&document.kind);
        contents.curve_count = document.curve_count();
        contents.grid = document.grid.map(|of| of.shape);
        contents.grid_size = document.grid.map(|of| of.size);
        contents.images = document.images.iter().map(ImageContents::of).collect();
        contents.spectra = document.spectra.iter().map(SpectrumContents::of).collect();
        contents.notes.clone_from(&document.notes);
        if contents.curve_count > 0 {
            match document.curve(0) {
                Ok(curve) => contents.add(&curve),
                Err(error) => contents.error = Some(error.to_string()),
            }
        }
        contents
    }

    /// Adds what the first curve says.
    fn add(&mut self, curve: &Curve) {
        self.spring_constant = curve.spring_constant;
        self.sensitivity = curve.sensitivity;
        self.distance = curve.distance.as_ref().map(|of| of.channel.clone());
        self.distance_source = curve.distance.as_ref().map(|of| name(&of.source));
        self.deflection.clone_from(&curve.deflection);
        self.notes.extend(curve.notes.iter().cloned());
        self.segments.extend(curve.segments.iter().map(|segment| {
            let channels = segment.channels.iter().map(|channel| {
                if channel.unit.is_empty() {
                    channel.name.clone()
                } else {
                    format!("{} ({})", channel.name, channel.unit)
                }
            });
            SegmentContents {
                style: style_name(segment.style).to_owned(),
                points: segment.points(),
                duration: segment.duration,
                channels: channels.collect(),
            }
        }));
    }
}

impl ImageContents {
    fn of(image: &Image) -> Self {
        Self {
            name: image.name.clone(),
            unit: image.unit.clone(),
            shape: image.shape,
            size: image.size,
        }
    }
}

impl SpectrumContents {
    fn of(spectrum: &Spectrum) -> Self {
        Self {
            name: spectrum.name.clone(),
            unit: spectrum.unit.clone(),
            points: spectrum.values.len(),
            largest_frequency: spectrum.frequency.last().copied(),
        }
    }
}

/// The word of a style in documents and figures.
pub(crate) fn style_name(style: Style) -> &'static str {
    match style {
        Style::Approach => "approach",
        Style::Pause => "pause",
        Style::Retract => "retract",
        Style::Modulation => "modulation",
        Style::Unsplit => "unsplit",
    }
}

/// The word for a value in documents.
fn name(of: &impl Serialize) -> String {
    let value = serde_json::to_value(of).unwrap_or_default();
    value.as_str().unwrap_or_default().to_owned()
}
