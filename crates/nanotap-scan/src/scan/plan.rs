//! The options of a scan, checked and in SI.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use nanotap_dynamics::Control;
use serde_json::Value;

use super::feedback::{Gains, MAX_ORDER, time_constant};
use super::image::HeightImage;
use super::options::{
    MAX_FEATURES, MAX_IMAGE, MAX_LINE_PERIODS, MAX_LINES, MAX_LISTED, MAX_PERIODS, MAX_PIXELS,
    Method, Mode, Quantity, ScanOptions,
};
use super::profile::{Samples, Surface};
use nanotap_case::Case;
use nanotap_case::input::MAX_IMAGE_BYTES;
use nanotap_case::key::Key;
use nanotap_case::physical::{Kind, Physical};
use nanotap_error::Error;
use nanotap_motions::setpoint::at_setpoint;
use nanotap_observe::{ObservableSet, RecordOptions, record};

/// The checked options of a scan. Lengths in m, times in s.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    /// Exact or quasi-static.
    pub(super) method: Method,
    /// Whether the options name the method `fast`, which is exact.
    pub(super) names_fast: bool,
    pub(super) mode: Mode,
    /// Numbers of the drive periods to list, sorted, counted from the start of settling.
    pub(super) list: Vec<usize>,
    pub(super) size: [f64; 2],
    pub(super) lines: usize,
    pub(super) pixels: usize,
    pub(super) settle: usize,
    /// Number of drive periods of a line in one direction.
    pub(super) periods: usize,
    pub(super) retrace: bool,
    pub(super) line_settle: Option<usize>,
    /// Duration of a drive period, s.
    pub(super) period: f64,
    pub(super) free_amplitude: f64,
    /// Setpoint amplitude as a fraction of the free amplitude, 0 to 1.
    pub(super) setpoint: f64,
    /// Integral gain Ki, 1/s.
    pub(super) integral_gain: f64,
    pub(super) gains: Gains,
    pub(super) z0: f64,
    /// The beam's state at drive phase 180° at the start, in the model's units; None: its free motion.
    pub(super) start: Option<Vec<f64>>,
    /// Time constant of a stage of the lock-in amplifier, s, and the number of stages.
    pub(super) lock_in: (f64, usize),
    /// Resonance frequency, Hz, and quality factor of the z scanner; None if it is rigid.
    pub(super) z_scanner: Option<[f64; 2]>,
    /// Threshold of the amplified error as a fraction of the free amplitude, and its gain.
    pub(super) dynamic: Option<[f64; 2]>,
    pub(super) surface: Surface,
    /// The case of each material, the case's own first.
    pub(super) materials: Vec<Case>,
    /// Stretches of the line with their material.
    pub(super) segments: Vec<(f64, f64, usize)>,
    /// SI values of the model's units of length (m), force (N) and energy (J).
    pub(super) length_unit: f64,
    pub(super) force_unit: f64,
    pub(super) energy_unit: f64,
}

/// Number of time constants of the lever for which it settles, if no number of periods is given.
const SETTLE_CONSTANTS: f64 = 20.0;

impl Plan {
    /// Checks these options for a case.
    ///
    /// # Errors
    /// When an option or the case is not valid.
    pub(super) fn new(
        case: &Case,
        options: &ScanOptions,
        control: &Control<'_>,
    ) -> Result<Self, Error> {
        let options = options.over(case)?;
        let view = case.physical().ok_or_else(|| {
            Error::input(
                format!(
                    "{}: a scan needs a case in physical quantities",
                    case.title()
                ),
                "state the lever in [cantilever], [drive] and [sample], with units",
            )
        })?;
        let frequency = view.scales.frequency * view.cantilever.omega;
        let size = length(options.size.as_ref(), "size")?
            .ok_or_else(|| missing("size", "size = \"1 um\""))?;
        positive(size, "size")?;
        let size_y = length(options.size_y.as_ref(), "size_y")?.unwrap_or(size);
        positive(size_y, "size_y")?;
        let lines = count(options.lines, 1, [1, MAX_LINES], "lines")?;
        let pixels = count(options.pixels, 256, [1, MAX_PIXELS], "pixels")?;
        if lines.saturating_mul(pixels) > MAX_IMAGE {
            return Err(Error::option(
                "pixels",
                format!("{lines} lines of {pixels} pixels are too many"),
                format!("give an image of at most {MAX_IMAGE} pixels"),
            ));
        }
        let periods = periods_of_line(&options, frequency, size)?;
        let settle = options.settle.unwrap_or_else(|| {
            let constant = view.lever.quality_factor / std::f64::consts::PI;
            (SETTLE_CONSTANTS * constant).ceil().min(1e6) as usize
        });
        let settle = count(Some(settle), 0, [0, MAX_LINE_PERIODS], "settle")?;
        let retrace = options.retrace.unwrap_or(true);
        let per_line = periods * (1 + usize::from(retrace))
            + options.line_settle.unwrap_or(0).min(MAX_LINE_PERIODS);
        let total = per_line.saturating_mul(lines).saturating_add(settle);
        if total > MAX_PERIODS {
            return Err(Error::option(
                "periods",
                format!("{total} drive periods in all are too many"),
                format!("scan at most {MAX_PERIODS}: fewer {{lines}} or {{periods}}"),
            ));
        }
        let free_amplitude = view.free_amplitude;
        let setpoint = setpoint(&options, view)?;
        let mode = options.mode.unwrap_or_default();
        let (z0, start) = if let Some(z0) = length(options.z0.as_ref(), "z0")? {
            (z0, None)
        } else {
            let (distance, state) = found_start(case, setpoint, control)?;
            (distance, Some(state))
        };
        let (integral_gain, gains) = gains(&options, frequency)?;
        let surface = surface(&options, case, [size, size_y])?;
        let (materials, segments) = materials(&options, case)?;
        let method = options.method.unwrap_or_default();
        let mut list = options.list.clone();
        list.sort_unstable();
        list.dedup();
        if list.len() > MAX_LISTED || list.last().is_some_and(|k| *k >= total) {
            return Err(Error::option(
                "list",
                format!("the scan has {total} drive periods, numbered from 0"),
                format!("list at most {MAX_LISTED} of them"),
            ));
        }
        Ok(Self {
            method: match method {
                Method::Exact | Method::Fast => Method::Exact,
                Method::QuasiStatic => Method::QuasiStatic,
            },
            names_fast: method == Method::Fast,
            mode,
            list,
            size: [size, size_y],
            lines,
            pixels,
            settle,
            periods,
            retrace,
            line_settle: options.line_settle.filter(|_| lines > 1),
            period: frequency.recip(),
            free_amplitude,
            setpoint,
            integral_gain,
            gains,
            z0,
            start,
            lock_in: lock_in(&options, frequency)?,
            z_scanner: z_scanner(&options)?,
            dynamic: dynamic(&options, setpoint)?,
            surface,
            materials,
            segments,
            length_unit: view.scales.length,
            force_unit: view.scales.force,
            energy_unit: view.scales.energy,
        })
    }

    /// Returns the lines a second, trace and retrace together, Hz.
    pub(super) fn line_rate(&self) -> f64 {
        1.0 / (2.0 * self.periods as f64 * self.period)
    }

    /// Returns the speed of the tip along a line, m/s.
    pub(super) fn speed(&self) -> f64 {
        self.size[0] / (self.periods as f64 * self.period)
    }

    /// Returns the fraction of the difference that a stage of the lock-in amplifier follows in a
    /// period.
    pub(super) fn lock_in_part(&self) -> f64 {
        let (time_constant, _) = self.lock_in;
        if time_constant > 0.0 {
            -nanotap_arithmetic::exp_m1(-self.period / time_constant)
        } else {
            1.0
        }
    }

    /// Returns the error that the controller receives for an error of the amplitude.
    pub(super) fn amplified(&self, amplitude: f64, error: f64) -> f64 {
        match self.dynamic {
            Some([threshold, gain]) => {
                error + gain * (amplitude - threshold * self.free_amplitude).max(0.0)
            }
            None => error,
        }
    }

    /// Returns the number of drive periods that belong to a line.
    pub(super) fn periods_per_line(&self) -> usize {
        self.periods * (1 + usize::from(self.retrace)) + self.line_settle.unwrap_or(0)
    }

    /// Returns the number of drive periods of the scan.
    pub(super) fn total_periods(&self) -> usize {
        self.settle + self.lines * self.periods_per_line()
    }

    /// Returns the position of a period along the line, m.
    pub(super) fn position(&self, index: usize, retrace: bool) -> f64 {
        let part = (index as f64 + 0.5) / self.periods as f64;
        self.size[0] * if retrace { 1.0 - part } else { part }
    }

    /// Returns the position of a line across the lines, m.
    pub(super) fn line_position(&self, line: usize) -> f64 {
        (line as f64 + 0.5) * self.size[1] / self.lines as f64
    }

    /// Returns the amplitude error, m, beyond which the amplitude is off the setpoint: half of the way
    /// from the setpoint to the free amplitude or to 0, whichever is shorter.
    pub(super) fn off_setpoint(&self) -> f64 {
        0.5 * self.setpoint.min(1.0 - self.setpoint) * self.free_amplitude
    }

    /// Returns the index of the pixel to which a period of a line belongs.
    pub(super) fn pixel(&self, index: usize, retrace: bool) -> usize {
        let pixel = (2 * index + 1) * self.pixels / (2 * self.periods);
        if retrace {
            self.pixels - 1 - pixel
        } else {
            pixel
        }
    }

    /// Returns the index of the material at a position along the line.
    pub(super) fn material(&self, x: f64) -> usize {
        let here = |&&(from, to, _): &&(f64, f64, usize)| x >= from && x < to;
        self.segments
            .iter()
            .find(here)
            .map_or(0, |segment| segment.2)
    }
}

fn length(value: Option<&Quantity>, name: &str) -> Result<Option<f64>, Error> {
    value.map(|value| value.si(Kind::Length, name)).transpose()
}

fn missing(name: &str, example: &str) -> Error {
    Error::option(
        name,
        "the scan needs it",
        format!("give it in [scan], as in {example}, or as an option"),
    )
}

fn positive(value: f64, name: &str) -> Result<(), Error> {
    if value > 0.0 {
        return Ok(());
    }
    Err(Error::option(
        name,
        "the value is not positive",
        "give a positive value",
    ))
}

fn count(
    given: Option<usize>,
    default: usize,
    [low, high]: [usize; 2],
    name: &str,
) -> Result<usize, Error> {
    let value = given.unwrap_or(default);
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    Err(Error::option(
        name,
        format!("{value} is out of range"),
        format!("give a whole number from {low} to {high}"),
    ))
}

/// Returns the number of periods of a line in one direction.
fn periods_of_line(options: &ScanOptions, frequency: f64, size: f64) -> Result<usize, Error> {
    let given = [
        options.periods.is_some(),
        options.line_rate.is_some(),
        options.speed.is_some(),
    ];
    if given.iter().filter(|given| **given).count() > 1 {
        return Err(Error::option(
            "periods",
            "{periods}, {line_rate} and {speed} say the same",
            "give one of them",
        ));
    }
    let wanted = match (&options.periods, &options.line_rate, &options.speed) {
        (Some(periods), ..) => *periods as f64,
        (_, Some(rate), _) => {
            let rate = rate.si(Kind::Frequency, "line_rate")?;
            positive(rate, "line_rate")?;
            (frequency / (2.0 * rate)).round()
        }
        (.., Some(speed)) => {
            let speed = speed.si(Kind::Velocity, "speed")?;
            positive(speed, "speed")?;
            (frequency * size / speed).round()
        }
        _ => return Err(missing("line_rate", "line_rate = \"1 Hz\"")),
    };
    if (2.0..=MAX_LINE_PERIODS as f64).contains(&wanted) {
        return Ok(wanted as usize);
    }
    Err(Error::option(
        "periods",
        format!("a line of {wanted} drive periods is out of range"),
        format!("scan so fast that a line has 2 to {MAX_LINE_PERIODS} drive periods"),
    ))
}

/// Returns the setpoint as a fraction of the free amplitude, from a number or a length.
fn setpoint(options: &ScanOptions, view: &Physical) -> Result<f64, Error> {
    let given = match &options.setpoint {
        None => view
            .setpoint
            .ok_or_else(|| missing("setpoint", "setpoint = 0.8"))?,
        Some(Quantity::Number(part)) => *part,
        Some(text @ Quantity::Text(written)) => match Kind::Number.parse(written) {
            Ok(part) => part,
            Err(_) => text.si(Kind::Length, "setpoint")? / view.free_amplitude,
        },
    };
    if given > 0.0 && given < 1.0 {
        return Ok(given);
    }
    Err(Error::option(
        "setpoint",
        format!("{given} of the free amplitude is not between 0 and 1"),
        "give a part of the free amplitude, as in 0.8, or a length",
    ))
}

/// Finds the distance in m at which the amplitude of a lever that approaches from far has fallen to the
/// setpoint, and the beam's state there at drive phase 180°, in the units of the model of `case`.
fn found_start(
    case: &Case,
    setpoint: f64,
    control: &Control<'_>,
) -> Result<(f64, Vec<f64>), Error> {
    let length_of = |case: &Case| case.physical().map_or(1.0, |view| view.scales.length);
    let to = length_of(case);
    let words = [
        format!("drive.setpoint={setpoint:?}"),
        "gap.tip=".to_owned(),
    ];
    let case = case.restated(&words)?;
    let (found, _) = at_setpoint(case.cancelled_by(control), control)
        .map_err(|error| error.context("z0 is not given"))?;
    // It starts where its setpoint was found.
    let model = found.model()?;
    let motion = model.first_state();
    let kept = RecordOptions {
        recorded: 1,
        ..RecordOptions::default()
    };
    let recorded = record(&model, &motion, 1, ObservableSet::NONE, kept)?;
    let state = recorded.recording.state_at(0.5 * model.period());
    let state =
        state.ok_or_else(|| Error::numerics("the motion at the setpoint was not recorded"))?;
    let beam = 2 * nanotap_study::cantilever(&found, "scan")?.modes;
    let scale = length_of(&found) / to;
    let state = state.into_iter().take(beam);
    Ok((
        found.get(Key::GapTip),
        state.map(|entry| scale * entry).collect(),
    ))
}

impl ScanOptions {
    /// Returns the integral gain in 1/s and the slew rate of the z command in m/s, where they are stated.
    ///
    /// # Errors
    /// When one of them is not valid.
    pub fn feedback_limits(&self) -> Result<[Option<f64>; 2], Error> {
        let stated = self.integral_gain.is_some() || self.integral_bandwidth.is_some();
        let gain = stated.then(|| gains(self, 1.0)).transpose()?;
        let slew = self.slew_rate.as_ref();
        let slew = slew.map(|rate| rate.si(Kind::Velocity, "slew_rate"));
        Ok([gain.map(|(integral, _)| integral), slew.transpose()?])
    }
}

fn gains(options: &ScanOptions, frequency: f64) -> Result<(f64, Gains), Error> {
    let integral = match (&options.integral_gain, &options.integral_bandwidth) {
        (Some(_), Some(_)) => {
            return Err(Error::option(
                "integral_gain",
                "{integral_gain} and {integral_bandwidth} say the same",
                "give one of them",
            ));
        }
        (Some(Quantity::Text(text)), None) => per_second(text)?,
        (Some(gain), None) => gain.si(Kind::Number, "integral_gain")?,
        (None, Some(bandwidth)) => TAU * bandwidth.si(Kind::Frequency, "integral_bandwidth")?,
        (None, None) if options.mode == Some(Mode::ConstantHeight) => 0.0,
        (None, None) => return Err(missing("integral_gain", "integral_gain = 1500")),
    };
    let proportional = options.proportional_gain.unwrap_or(0.0);
    for (value, name) in [
        (integral, "integral_gain"),
        (proportional, "proportional_gain"),
    ] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(Error::option(
                name,
                format!("{value} is not a gain"),
                "give a number that is not negative",
            ));
        }
    }
    let slew = match &options.slew_rate {
        None => f64::INFINITY,
        Some(rate) => {
            let rate = rate.si(Kind::Velocity, "slew_rate")?;
            positive(rate, "slew_rate")?;
            rate / frequency
        }
    };
    let range = match &options.z_range {
        None => [f64::NEG_INFINITY, f64::INFINITY],
        Some([low, high]) => {
            let low = low.si(Kind::Length, "z_range")?;
            let high = high.si(Kind::Length, "z_range")?;
            if low >= high {
                return Err(Error::option(
                    "z_range",
                    "the range is empty",
                    "give the lower end first",
                ));
            }
            [low, high]
        }
    };
    let gains = Gains {
        proportional,
        integral: integral / frequency,
        slew,
        range,
        delay: count(options.delay, 0, [0, 10_000], "delay")?,
    };
    Ok((integral, gains))
}

/// Parses a gain in 1/s.
fn per_second(text: &str) -> Result<f64, Error> {
    let text = text.trim();
    let unit = ["1/s", "/s", "s^-1"]
        .iter()
        .find_map(|unit| text.strip_suffix(unit));
    unit.unwrap_or(text).trim().parse().map_err(|_| {
        let remedy = "give a number in 1/s, as in 1500 or \"1500 1/s\"";
        Error::option("integral_gain", format!("`{text}` is not a gain"), remedy)
    })
}

fn lock_in(options: &ScanOptions, frequency: f64) -> Result<(f64, usize), Error> {
    let given = options.lock_in.clone().unwrap_or_default();
    let order = count(given.order, 1, [1, MAX_ORDER], "lock_in.order")?;
    let time = match (&given.time_constant, &given.bandwidth) {
        (Some(_), Some(_)) => {
            return Err(Error::option(
                "lock_in",
                "time_constant and bandwidth say the same",
                "give one of them",
            ));
        }
        (Some(time), None) => time.si(Kind::Time, "lock_in.time_constant")?,
        (None, Some(bandwidth)) => {
            let bandwidth = bandwidth.si(Kind::Frequency, "lock_in.bandwidth")?;
            positive(bandwidth, "lock_in.bandwidth")?;
            time_constant(bandwidth, order)
        }
        (None, None) => 6.0 / frequency,
    };
    if time < 0.0 {
        return Err(Error::option(
            "lock_in.time_constant",
            "the time constant is negative",
            "give a time, or 0 for none",
        ));
    }
    Ok((time, order))
}

fn z_scanner(options: &ScanOptions) -> Result<Option<[f64; 2]>, Error> {
    let Some(given) = &options.z_scanner else {
        return Ok(None);
    };
    let frequency = given.frequency.si(Kind::Frequency, "z_scanner.frequency")?;
    positive(frequency, "z_scanner.frequency")?;
    if !(given.quality_factor > 0.0 && given.quality_factor.is_finite()) {
        return Err(Error::option(
            "z_scanner.Q",
            "the quality factor is not positive",
            "give a positive number",
        ));
    }
    Ok(Some([frequency, given.quality_factor]))
}

fn dynamic(options: &ScanOptions, setpoint: f64) -> Result<Option<[f64; 2]>, Error> {
    match (options.dynamic_threshold, options.dynamic_gain) {
        (None, None) => Ok(None),
        (Some(threshold), Some(gain))
            if threshold > setpoint && threshold < 1.0 && gain >= 0.0 && gain.is_finite() =>
        {
            Ok(Some([threshold, gain]))
        }
        (Some(_), Some(_)) => Err(Error::option(
            "dynamic_threshold",
            "the threshold is not between the setpoint and 1, or the gain is negative",
            "give a part of the free amplitude above the setpoint, and a gain",
        )),
        _ => Err(Error::option(
            "dynamic_threshold",
            "{dynamic_threshold} and {dynamic_gain} go together",
            "give both, or neither",
        )),
    }
}

fn surface(options: &ScanOptions, case: &Case, size: [f64; 2]) -> Result<Surface, Error> {
    let radius = case.get(Key::TipRadius);
    let tip_radius = if radius.is_finite() { radius } else { 0.0 };
    let mut surface = Surface::new(&options.surface, tip_radius)?;
    let dilate = length(options.dilate.as_ref(), "dilate")?;
    if let Some(profile) = &options.profile {
        let mut samples = Samples::of(profile, case, size[0])?;
        if let Some(radius) = dilate {
            positive(radius, "dilate")?;
            samples = samples.dilated(radius);
        }
        surface = surface.with_samples(samples);
    } else if dilate.is_some() {
        return Err(Error::option(
            "dilate",
            "only sampled heights are widened",
            "give a {profile}, or leave it out",
        ));
    }
    if let Some(name) = &options.image {
        let height = length(options.image_height.as_ref(), "image_height")?
            .ok_or_else(|| missing("image_height", "image_height = \"20 nm\""))?;
        let image = HeightImage::read(case.file(name, MAX_IMAGE_BYTES)?, height, size)?;
        surface = surface.with_image(image);
    }
    Ok(surface)
}

/// The cases of the materials of a case's `[scan]`: the case itself, then each of `[[scan.material]]` once.
///
/// # Errors
/// When `[scan]` or a material is not valid.
pub fn material_cases(case: &Case) -> Result<Vec<Case>, Error> {
    let options = ScanOptions::default().over(case)?;
    Ok(materials(&options, case)?.0)
}

/// Cases of the materials and the stretches of the line on which they are.
#[expect(clippy::type_complexity, reason = "both come from one list")]
fn materials(
    options: &ScanOptions,
    case: &Case,
) -> Result<(Vec<Case>, Vec<(f64, f64, usize)>), Error> {
    if options.material.len() > MAX_FEATURES {
        return Err(Error::option(
            "material",
            format!("{} materials are too many", options.material.len()),
            format!("give at most {MAX_FEATURES}"),
        ));
    }
    let mut cases = vec![case.clone()];
    let mut known: Vec<&BTreeMap<String, Value>> = Vec::new();
    let mut segments = Vec::new();
    for material in &options.material {
        let from = material.from.si(Kind::Length, "material.from")?;
        let to = material.to.si(Kind::Length, "material.to")?;
        if from >= to {
            return Err(Error::option(
                "material",
                "a material ends before it begins",
                "give `to` greater than `from`",
            ));
        }
        let same = known.iter().position(|keys| **keys == material.keys);
        let index = if let Some(index) = same {
            index + 1
        } else {
            let words: Vec<String> = material.keys.iter().map(word).collect();
            cases.push(case.restated(&words)?);
            known.push(&material.keys);
            cases.len() - 1
        };
        segments.push((from, to, index));
    }
    Ok((cases, segments))
}

/// A key of `[sample]` with its value, as set in addition to a case file.
fn word((key, value): (&String, &Value)) -> String {
    let text = match value {
        Value::String(text) => format!("{text:?}"),
        other => other.to_string(),
    };
    format!("sample.{key}={text}")
}
