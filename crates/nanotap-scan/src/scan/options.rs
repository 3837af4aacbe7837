//! Options of a scan: the table `[scan]` of a case file, and the same names in every front end.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use nanotap_case::Case;
use nanotap_case::physical::Kind;
use nanotap_error::Error;

/// Largest number of drive periods of a line in one direction.
pub const MAX_LINE_PERIODS: usize = 10_000_000;
/// Largest number of drive periods of a scan.
pub const MAX_PERIODS: usize = 2_000_000_000;
/// Largest number of pixels of a line.
pub const MAX_PIXELS: usize = 65_536;
/// Largest number of lines of a scan.
pub const MAX_LINES: usize = 65_536;
/// Largest number of pixels of an image.
pub const MAX_IMAGE: usize = 4_194_304;
/// Largest number of drive periods that are listed.
pub const MAX_LISTED: usize = 100_000;
/// Largest number of features of a surface, and of materials.
pub const MAX_FEATURES: usize = 10_000;

/// A number in SI, or a text with a unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Quantity {
    /// In SI.
    Number(f64),
    /// With its unit.
    Text(String),
}

impl Quantity {
    /// Returns the value in SI.
    ///
    /// # Errors
    /// When the text is not a quantity of this kind, or the number is not finite.
    pub(super) fn si(&self, kind: Kind, name: &str) -> Result<f64, Error> {
        let value = match self {
            Self::Number(value) => *value,
            Self::Text(text) => match text.trim().parse::<f64>() {
                Ok(value) => value,
                Err(_) => kind
                    .parse(text)
                    .map_err(|error| Error::option(name, error.to_string(), example(kind)))?,
            },
        };
        if value.is_finite() {
            return Ok(value);
        }
        Err(Error::option(
            name,
            "the value is not finite",
            example(kind),
        ))
    }
}

fn example(kind: Kind) -> &'static str {
    match kind {
        Kind::Length => "give a length, as in \"10 nm\"",
        Kind::Time => "give a time, as in \"20 us\"",
        Kind::Frequency => "give a frequency, as in \"1 Hz\"",
        Kind::Velocity => "give a speed, as in \"2 um/s\"",
        _ => "give a number",
    }
}

/// How the drive periods are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Every period exactly
    #[default]
    Exact,
    /// The same as exact; earlier versions computed nonlinear laws approximately
    Fast,
    /// The lever's steady motion at each distance: a preview
    QuasiStatic,
}

/// What the feedback does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// The feedback holds the amplitude
    #[default]
    ConstantAmplitude,
    /// No feedback: the height stays at z0
    ConstantHeight,
}

/// The lock-in amplifier.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LockInOptions {
    /// Time constant of each stage
    pub time_constant: Option<Quantity>,
    /// Bandwidth at −3 dB, in place of the time constant
    pub bandwidth: Option<Quantity>,
    /// Stages, 1 to 4
    pub order: Option<usize>,
}

/// The resonance of the z scanner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ZScannerOptions {
    /// Resonance frequency
    pub frequency: Quantity,
    /// Quality factor
    #[serde(rename = "Q", alias = "quality_factor")]
    pub quality_factor: f64,
}

/// One feature of the surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Feature {
    /// A plateau: `height` from `from` up to `to`
    Step {
        /// Left end
        from: Quantity,
        /// Right end
        to: Quantity,
        /// Height
        height: Quantity,
    },
    /// A slope: from 0 at `from` to `height` at `to`, and 0 elsewhere
    Ramp {
        /// Left end
        from: Quantity,
        /// Right end
        to: Quantity,
        /// Height at the right end
        height: Quantity,
    },
    /// A grating: `height · sin(2π x / period + phase)`
    Sine {
        /// Amplitude
        height: Quantity,
        /// Length of a period
        period: Quantity,
        /// Phase in rad
        #[serde(default)]
        phase: f64,
    },
    /// A grating of plateaus: `height` on the first `duty` of every period
    Grating {
        /// Height of the plateaus
        height: Quantity,
        /// Length of a period
        period: Quantity,
        /// Part of a period that is high
        #[serde(default = "half")]
        duty: f64,
    },
    /// A smooth hill of standard deviation `width` at `at`, `at_y`
    Gauss {
        /// Position along the line
        at: Quantity,
        /// Position across the lines; without it, a ridge
        at_y: Option<Quantity>,
        /// Standard deviation
        width: Quantity,
        /// Height
        height: Quantity,
    },
    /// A sphere of this radius on the surface, as a tip of the case's radius sees it
    Particle {
        /// Position along the line
        at: Quantity,
        /// Position across the lines; without it, a cylinder
        at_y: Option<Quantity>,
        /// Radius
        radius: Quantity,
    },
}

const fn half() -> f64 {
    0.5
}

/// A stretch of the line with another sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MaterialOptions {
    /// Left end
    pub from: Quantity,
    /// Right end
    pub to: Quantity,
    /// Keys of `[sample]` in place of the case's
    #[serde(flatten)]
    pub keys: BTreeMap<String, Value>,
}

/// Heights of a profile, or the name of a CSV file with them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ProfileOptions {
    /// A CSV file, relative to the case file: one column of heights, or position and height
    File(String),
    /// Heights in m, evenly spaced over the line
    Heights(Vec<f64>),
}

/// Options of a scan: of each the case file's `[scan]`, where it is not given here.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ScanOptions {
    /// How the drive periods are computed
    pub method: Option<Method>,
    /// Drive periods that the JSON document lists, counted from the start of settling
    #[schemars(extend("x-value" = "K1,K2,…"))]
    pub list: Vec<usize>,
    /// Length of a line
    #[schemars(extend("x-value" = "LENGTH"))]
    pub size: Option<Quantity>,
    /// Extent across the lines; without it, as long as a line
    #[schemars(extend("x-value" = "LENGTH"))]
    pub size_y: Option<Quantity>,
    /// Lines
    #[schemars(range(min = 1, max = MAX_LINES), extend("x-value" = "N"))]
    pub lines: Option<usize>,
    /// Pixels of a line
    #[schemars(range(min = 1, max = MAX_PIXELS), extend("x-value" = "N"))]
    pub pixels: Option<usize>,
    /// Drive periods before the first line
    #[schemars(range(min = 0, max = MAX_LINE_PERIODS), extend("x-value" = "N"))]
    pub settle: Option<usize>,
    /// Drive periods of a line in one direction
    #[schemars(range(min = 2, max = MAX_LINE_PERIODS), extend("x-value" = "N"))]
    pub periods: Option<usize>,
    /// Lines a second, trace and retrace together, in place of {periods}
    #[schemars(extend("x-value" = "FREQUENCY"))]
    pub line_rate: Option<Quantity>,
    /// Speed of the tip along the line, in place of {periods}
    #[schemars(extend("x-value" = "SPEED"))]
    pub speed: Option<Quantity>,
    /// Scan every line back, too
    pub retrace: Option<bool>,
    /// Drive periods that each line settles before it: lines are then independent and run at the
    /// same time on all cores
    #[schemars(range(min = 0, max = MAX_LINE_PERIODS), extend("x-value" = "N"))]
    pub line_settle: Option<usize>,
    /// What the feedback does
    pub mode: Option<Mode>,
    /// Amplitude that the feedback holds: a part of the free amplitude, or a length
    #[schemars(extend("x-value" = "A"))]
    pub setpoint: Option<Quantity>,
    /// Integral gain in 1/s: the crossover frequency times 2π where the amplitude falls as the
    /// distance does
    #[schemars(extend("x-value" = "GAIN"))]
    pub integral_gain: Option<Quantity>,
    /// The same as a frequency
    #[schemars(extend("x-value" = "FREQUENCY"))]
    pub integral_bandwidth: Option<Quantity>,
    /// Proportional gain
    #[schemars(extend("x-value" = "GAIN"))]
    pub proportional_gain: Option<f64>,
    /// Height at the start; without it, where the amplitude of a lever that comes from far has
    /// fallen to the setpoint
    #[schemars(extend("x-value" = "LENGTH"))]
    pub z0: Option<Quantity>,
    /// Lock-in amplifier
    #[schemars(extend("x-own" = true))]
    pub lock_in: Option<LockInOptions>,
    /// Resonance of the z scanner
    #[schemars(extend("x-own" = true))]
    pub z_scanner: Option<ZScannerOptions>,
    /// Drive periods by which the controller is late
    #[schemars(range(min = 0, max = 10_000), extend("x-value" = "N"))]
    pub delay: Option<usize>,
    /// Largest speed of the z command
    #[schemars(extend("x-value" = "SPEED"))]
    pub slew_rate: Option<Quantity>,
    /// Lowest and highest z command
    #[schemars(extend("x-own" = true))]
    pub z_range: Option<[Quantity; 2]>,
    /// Amplitude above which the error is amplified, a part of the free amplitude
    pub dynamic_threshold: Option<f64>,
    /// Gain on the amplitude above the threshold
    pub dynamic_gain: Option<f64>,
    /// Features of the surface; their heights add up
    #[schemars(extend("x-own" = true))]
    pub surface: Vec<Feature>,
    /// Measured heights of the line: a CSV file named relative to the case file
    #[schemars(extend("x-own" = true))]
    pub profile: Option<ProfileOptions>,
    /// Greyscale image of the heights, a PNG file named relative to the case file
    #[schemars(extend("x-own" = true))]
    pub image: Option<String>,
    /// Height of white in the image
    #[schemars(extend("x-own" = true))]
    pub image_height: Option<Quantity>,
    /// Widen the sampled heights by a sphere of this radius, the tip
    #[schemars(extend("x-own" = true))]
    pub dilate: Option<Quantity>,
    /// Stretches of the line with another sample
    #[schemars(extend("x-own" = true))]
    pub material: Vec<MaterialOptions>,
}

impl ScanOptions {
    /// The options over those of the case file's `[scan]`.
    ///
    /// # Errors
    /// When `[scan]` has a key that is not an option, or a value of the wrong type.
    pub(super) fn over(&self, case: &Case) -> Result<Self, Error> {
        let Some(table) = case.scan() else {
            return Ok(self.clone());
        };
        let mut merged: Map<String, Value> = table.clone();
        let own = serde_json::to_value(self)?;
        for (name, value) in own.as_object().into_iter().flatten() {
            let is_empty = value.as_array().is_some_and(Vec::is_empty);
            if value.is_null() || is_empty {
                continue;
            }
            // One of the ways to give a number replaces the others.
            for group in ALTERNATIVES {
                if group.contains(&name.as_str()) {
                    merged.retain(|other, _| !group.contains(&other.as_str()));
                }
            }
            merged.insert(name.clone(), value.clone());
        }
        for (name, value) in &merged {
            let single = Map::from_iter([(name.clone(), value.clone())]);
            if let Err(error) = serde_json::from_value::<Self>(Value::Object(single)) {
                return Err(Error::input(
                    format!("{}: [scan] {name}: {error}", case.title()),
                    "`nanotap schema scan` lists the keys of [scan] with their types",
                ));
            }
        }
        serde_json::from_value(Value::Object(merged)).map_err(|error| {
            Error::input(
                format!("{}: [scan]: {error}", case.title()),
                "`nanotap schema scan` lists the keys of [scan] with their types",
            )
        })
    }
}

/// Options that give one number in several ways.
const ALTERNATIVES: [&[&str]; 3] = [
    &["periods", "line_rate", "speed"],
    &["integral_gain", "integral_bandwidth"],
    &["profile", "image"],
];
