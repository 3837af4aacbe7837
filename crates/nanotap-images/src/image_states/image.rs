//! The channels of an image: from a file of an instrument, a dataset of a scan, or a program.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use super::{Direction, ImageStatesOptions};
use nanotap_case::physical::Kind;
use nanotap_dataset::Store;
use nanotap_error::Error;
use nanotap_fit::files;
use nanotap_fit::fit::instrument::Conversion;
use nanotap_scan::scan::{CHANNELS, Channels, ScanLines};
use nanotap_study::DatasetStudy as _;

/// Most pixels of an image.
const MAX_PIXELS: usize = 4_194_304;
/// Name by which an option leaves a channel out.
const NONE: &str = "none";
/// Words in the names of channels of the retrace.
const BACKWARD: [&str; 3] = ["retrace", "backward", "bwd"];
/// Words in the names of channels of heights.
const HEIGHTS: [&str; 4] = ["height", "z-axis", "topography", "zsensor"];

/// Images of one area, as a file or a program gives them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageData {
    /// Name for messages, such as the path of the file
    #[serde(default)]
    pub name: String,
    /// The channels, in the order of the file
    pub channels: Vec<ImageChannel>,
    /// Whether a scan computed them, so that phases are lags without an offset
    #[serde(default)]
    pub computed: bool,
}

/// A channel of an image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageChannel {
    /// Name of the channel
    pub name: String,
    /// Unit of the values; may be empty
    #[serde(default)]
    pub unit: String,
    /// Width and height of the image, m
    #[serde(default)]
    pub size: Option<[f64; 2]>,
    /// Values: a row a line of the fast axis, an entry a pixel, `null` where there is none
    #[serde(deserialize_with = "rows")]
    #[schemars(with = "Vec<Vec<Option<f64>>>")]
    pub rows: Vec<Vec<f64>>,
}

/// Rows of numbers, NaN where they are null.
fn rows<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Vec<f64>>, D::Error> {
    let rows: Vec<Vec<Option<f64>>> = Vec::deserialize(from)?;
    let row = |row: Vec<Option<f64>>| row.into_iter().map(|of| of.unwrap_or(f64::NAN)).collect();
    Ok(rows.into_iter().map(row).collect())
}

impl ImageData {
    /// Reads the images of instruments' files, or of a dataset (.zarr) that a scan wrote.
    ///
    /// # Errors
    /// When a file cannot be read, or has no images.
    pub fn read(paths: &[&Path]) -> Result<Self, Error> {
        let names: Vec<String> = paths.iter().map(|of| of.display().to_string()).collect();
        let mut all = Self {
            name: names.join(", "),
            ..Self::default()
        };
        for path in paths {
            if path.is_dir() {
                let store = Store::open(path).map_err(Error::from)?;
                let scan = ScanLines::report(&store).map_err(Error::from)?;
                all.computed = true;
                all.add_scan("", &scan.trace, scan.size);
                if let Some(retrace) = &scan.retrace {
                    all.add_scan("retrace ", retrace, scan.size);
                }
            } else {
                all.add_images(files::open(path)?.images);
            }
        }
        all.with_images()
    }

    /// As [`read`](Self::read), of the content of an instrument's file.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn of_bytes(name: &str, bytes: Vec<u8>) -> Result<Self, Error> {
        let mut all = Self {
            name: name.to_owned(),
            ..Self::default()
        };
        all.add_images(files::read(name, bytes)?.images);
        all.with_images()
    }

    fn with_images(self) -> Result<Self, Error> {
        if self.channels.is_empty() {
            return Err(Error::input(
                format!("{}: it has no images", self.name),
                "`nanotap files` lists what a file holds",
            ));
        }
        Ok(self)
    }

    fn add_images(&mut self, images: Vec<files::Image>) {
        self.channels.extend(images.into_iter().map(|image| {
            let width = image.shape[0].max(1);
            ImageChannel {
                rows: image.values.chunks(width).map(<[f64]>::to_vec).collect(),
                name: image.name,
                unit: image.unit,
                size: image.size,
            }
        }));
    }

    /// Adds the channels of one direction of a scan. Its first line is at the bottom, that of an
    /// instrument at the top.
    fn add_scan(&mut self, prefix: &str, image: &Channels, size: [f64; 2]) {
        for channel in CHANNELS {
            self.channels.push(ImageChannel {
                name: format!("{prefix}{}", channel.name),
                unit: channel.unit().to_owned(),
                size: Some(size),
                rows: (channel.values)(image).iter().rev().cloned().collect(),
            });
        }
    }

    /// The channel with this name, or the only one whose name contains it.
    fn named(&self, option: &str, name: &str) -> Result<&ImageChannel, Error> {
        let wanted = name.to_lowercase();
        let mut same = self.channels.iter();
        if let Some(channel) = same.find(|of| of.name.to_lowercase() == wanted) {
            return Ok(channel);
        }
        let contains = |of: &&ImageChannel| of.name.to_lowercase().contains(&wanted);
        let mut found = self.channels.iter().filter(contains);
        match (found.next(), found.next()) {
            (Some(channel), None) => Ok(channel),
            (None, _) => Err(Error::option(
                option,
                format!("{}: there is no channel `{name}`", self.name),
                format!("its channels: {}", self.names()),
            )),
            (Some(a), Some(b)) => Err(Error::option(
                option,
                format!("`{name}` may be `{}` or `{}`", a.name, b.name),
                "give the whole name",
            )),
        }
    }

    fn names(&self) -> String {
        let names = self.channels.iter().map(|of| of.name.as_str());
        names.collect::<Vec<_>>().join(", ")
    }

    /// The first channel of this direction whose name has one of the words.
    fn guessed(&self, direction: Direction, words: &[&str]) -> Option<&ImageChannel> {
        self.channels.iter().find(|channel| {
            let name = channel.name.to_lowercase();
            let backward = BACKWARD.iter().any(|word| name.contains(word));
            backward == (direction == Direction::Retrace)
                && words.iter().any(|word| name.contains(word))
        })
    }
}

/// A channel in SI: m or degrees.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chosen {
    pub(super) name: String,
    pub(super) values: Vec<f64>,
}

/// The channels that count, in SI, line after line from the top one.
#[derive(Clone, Debug, Default)]
pub(super) struct Image {
    /// Points in a line, and lines.
    pub(super) shape: [usize; 2],
    pub(super) size: Option<[f64; 2]>,
    pub(super) height: Option<Chosen>,
    pub(super) amplitude: Option<Chosen>,
    pub(super) phase: Option<Chosen>,
    /// Whether the amplitude is given as its difference from the setpoint.
    pub(super) is_error: bool,
}

impl Image {
    /// Selects the channels of the options, or those whose names tell what they are.
    ///
    /// # Errors
    /// When a channel does not exist, has another size or another unit, or is empty.
    pub(super) fn of(data: &ImageData, options: &ImageStatesOptions) -> Result<Self, Error> {
        if data.channels.is_empty() {
            return Err(Error::option("data", "there is no image", "give a file"));
        }
        let conversions: Vec<Conversion> = options
            .convert
            .iter()
            .map(|text| Conversion::parse(text))
            .collect::<Result<_, _>>()?;
        for conversion in &conversions {
            if conversion.renamed.is_some() {
                return Err(Error::option(
                    "convert",
                    format!("`{}` is renamed: an image has no columns", conversion.name),
                    "choose a channel with {height}, {amplitude} or {phase}",
                ));
            }
            data.named("convert", &conversion.name)?;
        }
        let channel = |option: &str, given: &Option<String>, words: &[&str]| match given.as_deref()
        {
            Some(NONE) => Ok(None),
            Some(name) => data.named(option, name).map(Some),
            None => Ok(data.guessed(options.direction, words)),
        };
        let height = channel("height", &options.height, &HEIGHTS)?;
        let amplitude = match channel("amplitude", &options.amplitude, &["amplitude"])? {
            None => {
                channel("amplitude", &options.amplitude, &["error"])?.filter(|of| of.unit == "m")
            }
            found => found,
        };
        let phase = channel("phase", &options.phase, &["phase"])?;
        let chosen = [height, amplitude, phase];
        let mut image = Self::default();
        let mut first: Option<&ImageChannel> = None;
        for channel in chosen.into_iter().flatten() {
            let shape = shape_of(channel, &data.name)?;
            if let Some(first) = first.filter(|_| shape != image.shape) {
                let [a, b] = [image.shape, shape].map(|of| format!("{} by {}", of[0], of[1]));
                return Err(Error::option(
                    "data",
                    format!("`{}` has {a} pixels, `{}` {b}", first.name, channel.name),
                    "give channels of one image",
                ));
            }
            first.get_or_insert(channel);
            image.shape = shape;
            image.size = image.size.or(channel.size);
        }
        let converted = |channel: &ImageChannel, kind: Kind| -> Result<Chosen, Error> {
            let mut values: Vec<f64> = channel.rows.iter().flatten().copied().collect();
            let mut unit = channel.unit.clone();
            for conversion in &conversions {
                if std::ptr::eq(data.named("convert", &conversion.name)?, channel) {
                    unit = conversion.unit(&unit, || format!("`{}`", channel.name))?;
                    for value in &mut values {
                        *value = conversion.offset + conversion.factor * *value;
                    }
                }
            }
            let factor = factor_of(channel, &unit, kind)?;
            for value in &mut values {
                *value *= factor;
            }
            if values.iter().all(|value| !value.is_finite()) {
                return Err(Error::option(
                    "data",
                    format!("`{}` has no numbers", channel.name),
                    "choose another channel",
                ));
            }
            Ok(Chosen {
                name: channel.name.clone(),
                values,
            })
        };
        let of = |channel: Option<&ImageChannel>, kind| {
            channel.map(|of| converted(of, kind)).transpose()
        };
        image.height = of(height, Kind::Length)?;
        image.amplitude = of(amplitude, Kind::Length)?;
        image.phase = of(phase, Kind::Degrees)?;
        image.is_error = amplitude.is_some_and(|of| of.name.to_lowercase().contains("error"));
        if let Some(phase) = &image.phase {
            let mut known = phase.values.iter().filter(|value| value.is_finite());
            let first = known.next();
            if known.all(|value| Some(value) == first) {
                return Err(Error::option(
                    "data",
                    format!(
                        "`{}` is the same in all pixels: it was not measured",
                        phase.name
                    ),
                    "choose another channel",
                ));
            }
        }
        if first.is_none() {
            return Err(Error::option(
                "data",
                format!(
                    "{}: no height, amplitude or phase among its channels",
                    data.name
                ),
                format!(
                    "choose with {{height}}, {{amplitude}} and {{phase}}: {}",
                    data.names()
                ),
            ));
        }
        Ok(image)
    }
}

/// Points in a line, and lines.
fn shape_of(channel: &ImageChannel, file: &str) -> Result<[usize; 2], Error> {
    let lines = channel.rows.len();
    let points = channel.rows.first().map_or(0, Vec::len);
    let refuse = |what: String, remedy: &str| {
        Err(Error::option(
            "data",
            format!("{file}: `{}` {what}", channel.name),
            remedy,
        ))
    };
    if points == 0 {
        return refuse("has no pixels".to_owned(), "choose another channel");
    }
    if channel.rows.iter().any(|row| row.len() != points) {
        return refuse(
            "has lines of different lengths".to_owned(),
            "give a number for each pixel",
        );
    }
    if points.saturating_mul(lines) > MAX_PIXELS {
        let what = format!("has {points} by {lines} pixels");
        return refuse(what, &format!("give at most {MAX_PIXELS} pixels"));
    }
    Ok([points, lines])
}

/// The factor from the unit of a channel to m or degrees.
fn factor_of(channel: &ImageChannel, unit: &str, kind: Kind) -> Result<f64, Error> {
    let name = &channel.name;
    if kind == Kind::Degrees {
        return match unit {
            "deg" | "°" | "degree" | "degrees" => Ok(1.0),
            "rad" => Ok(1f64.to_degrees()),
            _ => Err(refused(name, unit, "an angle", &format!("{name}=90 deg/V"))),
        };
    }
    let parsed = (!unit.is_empty()).then(|| kind.parse(&format!("1 {unit}")));
    match parsed {
        Some(Ok(factor)) => Ok(factor),
        _ => Err(refused(name, unit, "a length", &format!("{name}=58 nm/V"))),
    }
}

fn refused(name: &str, unit: &str, kind: &str, example: &str) -> Error {
    let unit = if unit.is_empty() { "no unit" } else { unit };
    Error::option(
        "convert",
        format!("`{name}` is in {unit}, and {kind} is needed"),
        format!("give its factor, as in {{convert}} \"{example}\", or leave it out"),
    )
}
