//! The state of the lever in each pixel of an image, by its amplitude and phase.
//!
//! At one setpoint the lever may oscillate in several states, which have different phases and different
//! distances from the sample. Where it changes from one to another, the image has a step that is not the
//! surface's: the difference of the two distances. The states of the case are followed over the
//! amplitudes of the image (module `curves`), each pixel is assigned to one of them within its noise
//! (module `assign`), and what the lever adds is taken from the heights.

mod assign;
mod curves;
mod image;
mod report;
mod steps;

use nanotap_case::physical::Remark;
use nanotap_dynamics::Control;
use nanotap_figures::Figure;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use image::{ImageChannel, ImageData};
pub use report::{
    HeightCheck, ImageState, ImageStatesReport, ImageStep, PossibleAssignment, StateImages,
};

use crate::figure::image_states_figure;
use assign::{Assignment, Levels, Pixel, noise_of};
use curves::{StateCurve, state_curves};
use image::Image;
use nanotap_case::Case;
use nanotap_case::physical::{Held, Kind};
use nanotap_error::Error;
use nanotap_fit::fit::instrument::wrapped;
use nanotap_observe::frame::Frame;
use nanotap_scan::scan::material_cases;
use nanotap_study::request::options;
use nanotap_study::value::Amount;
use nanotap_study::{FreeMotion, Study};
use steps::{Correction, Steps};

/// Share of the pixels with the least and with the largest amplitudes for which states are not followed.
const OUTSIDE: f64 = 1e-3;
/// Share of the pixels that the states must explain, with a fitted offset, for the image to be of the case.
const LEAST_EXPLAINED: f64 = 0.5;
/// Deviation of the median amplitude from the setpoint above which a warning is given, over the setpoint.
const OFF_SETPOINT: f64 = 0.05;
/// Share of unexplained pixels above which a warning is given.
const UNEXPLAINED: f64 = 0.2;

/// Direction of the fast axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// Lines of the trace, forward
    #[default]
    Trace,
    /// Lines of the retrace, backward
    Retrace,
}

/// Sense of a measured phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Sense {
    /// It grows with the phase lag of the lever behind the drive
    Lag,
    /// It falls with the phase lag
    Lead,
}

impl Sense {
    const fn factor(self) -> f64 {
        match self {
            Self::Lag => 1.0,
            Self::Lead => -1.0,
        }
    }

    const fn of(factor: f64) -> Self {
        if factor < 0.0 { Self::Lead } else { Self::Lag }
    }

    /// Name in documents.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lag => "lag",
            Self::Lead => "lead",
        }
    }
}

options! {
    /// Options of the states of an image.
    pub struct ImageStatesOptions {
        /// Images of one area: channels of height, amplitude and phase
        #[schemars(extend("x-own" = true))]
        pub data: ImageData = ImageData::default(),
        /// Amplitude at which the image was taken, as a fraction of A0 or as in "8 nm"; default: drive.setpoint
        /// of the case, or the setpoint of its [scan]
        #[schemars(extend("x-value" = "SETPOINT"))]
        pub setpoint: Option<Amount> = None,
        /// Direction of the lines, where a file has both
        pub direction: Direction = Direction::Trace,
        /// Channel of the height, by its name or a part of it, or none; default: by the name
        #[schemars(extend("x-value" = "CHANNEL"))]
        pub height: Option<String> = None,
        /// Channel of the amplitude, or of its error from the setpoint, or none; default: by the name
        #[schemars(extend("x-value" = "CHANNEL"))]
        pub amplitude: Option<String> = None,
        /// Channel of the phase, or none; default: by the name
        #[schemars(extend("x-value" = "CHANNEL"))]
        pub phase: Option<String> = None,
        /// Conversions of channels, as in Amplitude="58 nm/V" or Phase=90-x
        #[schemars(extend("x-value" = "NAME=RULE"))]
        pub convert: Vec<String> = Vec::new(),
        /// Measured phase where the lag is zero, degrees; default: from the image
        #[schemars(range(min = -360, max = 360), extend("x-value" = "DEGREES"))]
        pub phase_offset: Option<f64> = None,
        /// Whether the measured phase is a lag or a lead; default: what the image allows
        pub sense: Option<Sense> = None,
        /// Noise of the amplitude in a pixel, as in "20 pm"; default: from neighbouring pixels
        #[schemars(extend("x-value" = "AMPLITUDE"))]
        pub amplitude_noise: Option<Amount> = None,
        /// Noise of the phase in a pixel, degrees; default: from neighbouring pixels
        #[schemars(range(min = 0, max = 90), extend("x-value" = "DEGREES"))]
        pub phase_noise: Option<f64> = None,
        /// Error of the phases of the case, degrees
        #[schemars(range(min = 0.1, max = 45), extend("x-value" = "DEGREES"))]
        pub phase_tolerance: f64 = 1.0,
        /// Take the deviation of the amplitude from the setpoint from the heights, too: it is the part of the
        /// surface, and of a false step, that the feedback has not followed yet
        #[schemars(extend("x-no" = "Correct heights for the state alone, not for the error of the amplitude"))]
        pub amplitude_error: bool = true,
        /// Look for the states above each material of the case's [scan], too: a pixel then has a state and a
        /// material, and is undecided if two have its phase
        pub materials: bool = false,
        /// Probability above which a pixel is assigned to a state
        #[schemars(range(min = 0.5, max = 0.999999), extend("x-value" = "PROBABILITY"))]
        pub confidence: f64 = 0.99,
    }
}

/// The states of an image.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::case::physical::Catalogue;
/// use nanotap::control::Control;
/// use nanotap::study::Study as _;
/// use nanotap::study::image_states::{
///     ImageChannel, ImageData, ImageStatesOptions, ImageStatesStudy,
/// };
/// use std::path::Path;
///
/// let file = Path::new("../../docs/cases/scan-patch.toml");
/// let case = Case::load(Some(file), &[], &Catalogue::shared())?;
/// // The phase changes from that of the attractive state to that of the repulsive one.
/// let channel = |name: &str, unit: &str, row: [f64; 8]| ImageChannel {
///     name: name.into(),
///     unit: unit.into(),
///     size: None,
///     rows: vec![row.to_vec()],
/// };
/// let data = ImageData {
///     name: "a line".into(),
///     channels: vec![
///         channel("height", "nm", [9.22, 9.22, 9.22, 9.22, 8.92, 8.92, 8.92, 8.92]),
///         channel("phase", "deg", [115.9, 115.7, 115.8, 115.9, 64.2, 64.1, 64.3, 64.1]),
///     ],
///     computed: true,
/// };
/// let options = ImageStatesOptions { data, ..ImageStatesOptions::default() };
/// let found = ImageStatesStudy::run(&case, &options, &Control::default())?;
/// assert_eq!((found.steps[0].from.as_str(), found.steps[0].to.as_str()), ("attractive", "repulsive"));
/// // The difference of the two distances: docs/cases/scan.md.
/// assert!((found.steps[0].height + 0.305e-9).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ImageStatesStudy;

impl Study for ImageStatesStudy {
    const NAME: &'static str = "image-states";
    const ABOUT: &'static str =
        "The lever's state in each pixel of an image, and the false steps of its height";
    const COUNTED: &'static str = "states";
    const ANY_DISTANCE: bool = true;
    type Options = ImageStatesOptions;
    type Report = ImageStatesReport;

    fn frames<'a>(_: &Case, report: &'a ImageStatesReport) -> Vec<Frame<'a>> {
        vec![
            report.pixel_table(),
            report.state_table(),
            report.step_table(),
        ]
    }

    fn figure(_: &Case, report: &ImageStatesReport) -> Option<Figure> {
        Some(image_states_figure(report))
    }

    fn remarks(_: &Case, report: &ImageStatesReport) -> Vec<Remark> {
        Remark::warnings(&report.warnings)
    }

    fn compute(
        case: &Case,
        options: &ImageStatesOptions,
        control: &Control<'_>,
    ) -> Result<ImageStatesReport, Error> {
        let image = Image::of(&options.data, options)?;
        let case = at_setpoint(case, options)?;
        let measured = Measured::of(&case, image, options)?;
        let range = measured.range();
        let materials = if options.materials {
            material_cases(&case)?
        } else {
            vec![case]
        };
        let (curves, missing) = state_curves(&materials, measured.free[0], range, control)?;
        let mut report = measured.report(&curves, options, control);
        report.warnings.extend(missing);
        Ok(report)
    }
}

/// The case at the setpoint of the image.
fn at_setpoint(case: &Case, options: &ImageStatesOptions) -> Result<Case, Error> {
    let view = case.physical().ok_or_else(|| {
        Error::input(
            "an image has lengths, and this case has none",
            "give the case in physical quantities",
        )
    })?;
    let of_scan = || match case.scan()?.get("setpoint")? {
        Value::String(text) => Some(text.clone()),
        value => value.as_f64().map(|value| format!("{value:?}")),
    };
    let given = options.setpoint.as_ref().map(|of| of.text().to_owned());
    let case = match given {
        None if view.held.is_some() => case.clone(),
        given => {
            let setpoint = given.or_else(of_scan).ok_or_else(|| {
                Error::option(
                    "setpoint",
                    "the setpoint of the image is not known",
                    "give it, as in {setpoint} 0.8, or drive.setpoint in the case",
                )
            })?;
            let words = [format!("drive.setpoint={setpoint}"), "gap.tip=".to_owned()];
            case.restated(&words)
                .map_err(|error| Error::from(error).at("setpoint"))?
        }
    };
    match case.physical().and_then(|view| view.held) {
        Some(Held::Amplitude(_)) => Ok(case),
        _ => Err(Error::option(
            "setpoint",
            "the setpoint is not an amplitude",
            "give the amplitude at which the image was taken, as in {setpoint} 0.8",
        )),
    }
}

/// The image with what is known of the lever.
struct Measured {
    image: Image,
    /// Amplitude (m) and phase lag (degrees) of the free lever.
    free: [f64; 2],
    setpoint: f64,
    /// Amplitude of each pixel, m.
    amplitude: Vec<f64>,
    /// Noise of amplitude (m) and phase (degrees).
    noise: [f64; 2],
    warnings: Vec<String>,
}

impl Measured {
    fn of(case: &Case, image: Image, options: &ImageStatesOptions) -> Result<Self, Error> {
        let view = case.physical();
        let length = view.map_or(1.0, |view| view.scales.length);
        let ratio = match view.and_then(|view| view.held) {
            Some(Held::Amplitude(ratio)) => ratio,
            _ => f64::NAN,
        };
        let free = FreeMotion::of(&case.model()?);
        let free = [free.amplitude * length, free.phase];
        let setpoint = ratio * free[0];
        let mut warnings = Vec::new();
        let pixels = image.shape[0] * image.shape[1];
        let amplitude: Vec<f64> = match &image.amplitude {
            Some(channel) if image.is_error => channel
                .values
                .iter()
                .map(|error| setpoint + error)
                .collect(),
            Some(channel) => channel.values.clone(),
            None => {
                warnings.push(
                    "without an amplitude every pixel counts as at the setpoint, and free flight \
                     cannot be told"
                        .to_owned(),
                );
                vec![setpoint; pixels]
            }
        };
        let median = quantile(&amplitude, 0.5);
        if (median - setpoint).abs() > OFF_SETPOINT * setpoint {
            warnings.push(format!(
                "the amplitudes of the image lie around {}, and the setpoint is {}",
                Kind::Length.format(median),
                Kind::Length.format(setpoint)
            ));
        }
        let given = options.amplitude_noise.as_ref();
        let given = given.map(|amount| Kind::Length.parse(amount.text()));
        let given = given.transpose().map_err(|error| {
            Error::option("amplitude_noise", error.to_string(), "write it as in 20 pm")
        })?;
        if given.is_some_and(|noise| !(noise >= 0.0 && noise.is_finite())) {
            return Err(Error::option(
                "amplitude_noise",
                "a noise below zero",
                "write it as in 20 pm",
            ));
        }
        let points = image.shape[0];
        let phase = image.phase.as_ref();
        let noise = [
            given.unwrap_or_else(|| noise_of(&amplitude, points, |change| change)),
            options.phase_noise.unwrap_or_else(|| {
                phase.map_or(0.0, |phase| noise_of(&phase.values, points, wrapped))
            }),
        ];
        Ok(Self {
            image,
            free,
            setpoint,
            amplitude,
            noise,
            warnings,
        })
    }

    /// The amplitudes of the image but for a few pixels.
    fn range(&self) -> [f64; 2] {
        [OUTSIDE, 1.0 - OUTSIDE].map(|share| quantile(&self.amplitude, share))
    }

    /// Pixels with amplitude and phase.
    fn pixels(&self) -> Vec<Pixel> {
        let phases = self.image.phase.iter().flat_map(|phase| &phase.values);
        let all = self.amplitude.iter().zip(phases).enumerate();
        let all = all.map(|(place, (amplitude, phase))| Pixel {
            place,
            amplitude: *amplitude,
            phase: *phase,
        });
        all.filter(|of| of.amplitude.is_finite() && of.phase.is_finite())
            .collect()
    }

    fn report(
        self,
        curves: &[StateCurve],
        options: &ImageStatesOptions,
        control: &Control<'_>,
    ) -> ImageStatesReport {
        let levels = Levels {
            control,
            curves,
            free: self.image.amplitude.is_some().then_some(self.free),
            free_amplitude: self.free[0],
            noise: self.noise,
            tolerance: options.phase_tolerance,
        };
        let pixels = self.pixels();
        let computed = options.data.computed;
        let offset = options.phase_offset.or(computed.then_some(0.0));
        let senses = match options.sense {
            Some(sense) => vec![sense.factor()],
            None if computed => vec![1.0],
            None => vec![1.0, -1.0],
        };
        let mut assignments = if pixels.is_empty() {
            Vec::new()
        } else {
            levels.assignments(&pixels, offset, &senses)
        };
        let reason = self.reason(&assignments, offset.is_some());
        let count = self.amplitude.len();
        let measured = |assignment: &Assignment| self.steps(&levels, &pixels, assignment, options);
        let possible: Vec<PossibleAssignment> = match reason {
            None => Vec::new(),
            Some(_) => assignments
                .iter()
                .map(|assignment| {
                    let steps = measured(assignment);
                    PossibleAssignment {
                        phase_offset: assignment.convention.offset,
                        sense: Sense::of(assignment.convention.sense),
                        explained: assignment.explained,
                        shares: steps
                            .counts(levels.count())
                            .iter()
                            .map(|of| *of as f64 / count as f64)
                            .collect(),
                        check: steps.check(),
                    }
                })
                .collect(),
        };
        let best = match &reason {
            None => (!assignments.is_empty()).then(|| assignments.swap_remove(0)),
            Some(_) => None,
        };
        let steps = best
            .as_ref()
            .map_or_else(|| Steps::undecided(count, &self.image), measured);
        let counts = steps.counts(levels.count());
        let convention = best.as_ref().map(|best| best.convention);
        let measured_phase = |lag: f64| convention.map(|of| wrapped(of.offset + of.sense * lag));
        let share = |pixels: usize| pixels as f64 / count as f64;
        let reference = steps.reference.and_then(|k| curves.get(k));
        let mut states: Vec<ImageState> = curves
            .iter()
            .zip(&counts)
            .map(|(curve, pixels)| ImageState {
                name: curve.name.clone(),
                material: Some(curve.material + 1),
                phase: curve.phase,
                measured_phase: measured_phase(curve.phase),
                distance: Some(curve.distance),
                height: reference.map(|reference| curve.distance - reference.distance),
                peak_force: Some(curve.peak_force),
                amplitude_low: curve.range()[0],
                amplitude_high: curve.range()[1],
                pixels: *pixels,
                share: share(*pixels),
            })
            .collect();
        if levels.free.is_some() {
            let pixels = counts[curves.len()];
            states.push(ImageState {
                name: "free".to_owned(),
                material: None,
                phase: self.free[1],
                measured_phase: measured_phase(self.free[1]),
                distance: None,
                height: None,
                peak_force: None,
                amplitude_low: self.free[0],
                amplitude_high: self.free[0],
                pixels,
                share: share(pixels),
            });
        }
        let undecided = count - counts.iter().sum::<usize>();
        let explained = best.as_ref().map_or(0.0, |best| best.explained);
        let mut warnings = self.warnings.clone();
        if best.is_some() && explained < 1.0 - UNEXPLAINED {
            warnings.push(format!(
                "{:.0} % of the pixels fit no state of the case within their noise: the case may differ from \
                 the sample or the lever, or the sample is not the same everywhere",
                100.0 * (1.0 - explained)
            ));
        }
        if reason.is_none() && self.image.height.is_none() {
            warnings.push("without a height there is nothing to correct".to_owned());
        }
        let name = |channel: &Option<image::Chosen>| channel.as_ref().map(|of| of.name.clone());
        let points = self.image.shape[0].max(1);
        let rows = |values: &[f64]| -> Vec<Vec<f64>> {
            values.chunks(points).map(<[f64]>::to_vec).collect()
        };
        let values = |channel: &Option<image::Chosen>| channel.as_ref().map(|of| rows(&of.values));
        let images = StateImages {
            state: steps.states.chunks(points).map(<[_]>::to_vec).collect(),
            probability: rows(&steps.probability),
            height: values(&self.image.height),
            corrected: steps.corrected.as_deref().map(rows),
            amplitude: self
                .image
                .amplitude
                .is_some()
                .then(|| rows(&self.amplitude)),
            phase: values(&self.image.phase),
        };
        let mut report = ImageStatesReport {
            verdict: String::new(),
            decided: reason.is_none(),
            reason,
            height_channel: name(&self.image.height),
            amplitude_channel: name(&self.image.amplitude),
            phase_channel: name(&self.image.phase),
            shape: self.image.shape,
            size: self.image.size,
            free_amplitude: self.free[0],
            setpoint_amplitude: self.setpoint,
            amplitude_noise: self.noise[0],
            phase_noise: self.noise[1],
            phase_offset: convention.map(|of| of.offset),
            phase_offset_error: best.as_ref().map(|best| best.offset_error),
            sense: convention.map(|of| Sense::of(of.sense)),
            confidence: options.confidence,
            explained,
            undecided,
            reference: reference.map(|of| of.name.clone()),
            states,
            step_count: steps.changes.len(),
            check: steps.check(),
            steps: steps.largest(),
            possible,
            warnings,
            images,
        };
        report.verdict = verdict(&report);
        report
    }

    fn steps(
        &self,
        levels: &Levels<'_>,
        pixels: &[Pixel],
        assignment: &Assignment,
        options: &ImageStatesOptions,
    ) -> Steps {
        let correction = Correction {
            confidence: options.confidence,
            amplitude_error: options.amplitude_error,
        };
        let decisions = pixels.iter().map(|pixel| {
            let decision = levels.decision(assignment, *pixel);
            (pixel.place, decision)
        });
        Steps::of(
            levels.curves,
            &self.image,
            &self.amplitude,
            correction,
            decisions,
        )
    }

    /// Why the image is undecided, if it is.
    fn reason(&self, assignments: &[Assignment], is_given: bool) -> Option<String> {
        if self.image.phase.is_none() {
            return Some(
                "the image has no phase: at the setpoint all states have the same amplitude"
                    .to_owned(),
            );
        }
        let [best, others @ ..] = assignments else {
            return Some("no pixel has both an amplitude and a phase".to_owned());
        };
        if !is_given && best.explained < LEAST_EXPLAINED {
            return Some(format!(
                "the states of the case explain only {:.0} % of the pixels, whatever the phase offset: \
                 it is not the case of this image",
                100.0 * best.explained
            ));
        }
        if others.is_empty() {
            return None;
        }
        let own = best.convention.sense;
        let is_sense_open = others.iter().any(|of| of.convention.sense != own);
        let remedy = match (is_given, is_sense_open) {
            (true, _) => "state whether the phase is a lag or a lead",
            (false, true) => {
                "give the phase offset, from the phase of the free lever, and whether the phase is a \
                 lag or a lead"
            }
            (false, false) => "give the phase offset, from the phase of the free lever",
        };
        Some(format!(
            "{} assignments explain the image equally well; {remedy}",
            assignments.len()
        ))
    }
}

/// What is found, in sentences.
fn verdict(report: &ImageStatesReport) -> String {
    let percent = |share: f64| match 100.0 * share {
        percent if percent > 0.0 && percent < 0.1 => "less than 0.1 %".to_owned(),
        percent => format!("{percent:.1} %"),
    };
    if let Some(reason) = &report.reason {
        let possible = report.possible.iter().take(4).map(|assignment| {
            let seen = report.states.iter().zip(&assignment.shares);
            let seen = seen.filter(|(_, share)| **share > 0.0005);
            let seen: Vec<String> = seen
                .map(|(state, share)| format!("{} {}", percent(*share), state.name))
                .collect();
            let seen = if seen.is_empty() {
                "no pixel assigned".to_owned()
            } else {
                seen.join(", ")
            };
            format!(
                "{seen} with a {} and an offset of {:.1}°",
                assignment.sense.name(),
                assignment.phase_offset
            )
        });
        let possible: Vec<String> = possible.collect();
        let possible = match possible.len() {
            0 | 1 => String::new(),
            _ => format!(" Possible: {}.", possible.join("; or ")),
        };
        return format!("Undecided, because {reason}.{possible}");
    }
    let seen = report.states.iter().filter(|state| state.pixels > 0);
    let seen = seen.map(|state| format!("{} {}", percent(state.share), state.name));
    let undecided = report.undecided as f64 / (report.shape[0] * report.shape[1]).max(1) as f64;
    let mut parts: Vec<String> = seen.collect();
    if report.undecided > 0 {
        parts.push(format!("{} undecided", percent(undecided)));
    }
    let largest = report.steps.iter().map(|step| step.height.abs());
    let is_material = |state: &ImageState| state.material.is_some_and(|number| number > 1);
    let subject = if report.states.iter().any(is_material) {
        "The lever changes its state or the tip its material"
    } else {
        "The lever changes its state"
    };
    let changes = match report.step_count {
        0 => format!("{subject} in no line."),
        count => format!(
            "{subject} in {count} place{}, where it adds up to {} to the height that the \
             surface does not have.",
            if count == 1 { "" } else { "s" },
            Kind::Length.format_digits(largest.fold(0.0, f64::max), 3)
        ),
    };
    format!("Pixels: {}. {changes}", parts.join(", "))
}

/// The value below which a share of the finite values lies.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut known: Vec<f64> = values.iter().copied().filter(|of| of.is_finite()).collect();
    if known.is_empty() {
        return f64::NAN;
    }
    let place = (share * (known.len() - 1) as f64).round() as usize;
    *known.select_nth_unstable_by(place, f64::total_cmp).1
}
