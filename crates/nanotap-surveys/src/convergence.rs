//! Convergence of a motion with the number of modes N = 1 … K.

use nanotap_case::physical::Remark;
use nanotap_dynamics::Control;
use nanotap_figures::Figure;
use schemars::JsonSchema;
use serde::Serialize;

use crate::figure::convergence::convergence_figure;
use crate::mode_share::ReadingsReport;
use nanotap_case::Case;
use nanotap_case::physical::Kind;
use nanotap_case::units::{NumbersInSi, Units};
use nanotap_error::Error;
use nanotap_model::beam::MAX_MODES;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::{Model, ModelError};
use nanotap_motions::initial_state::initial_state_note;
use nanotap_motions::orbit::{OrbitOptions, OrbitReport, orbit, spectral_radius};
use nanotap_motions::simulate::Classification;
use nanotap_observe::frame::{Frame, Rows, frame};
use nanotap_observe::time_series::with_modes;
use nanotap_study::Study;
use nanotap_study::cantilever;
use nanotap_study::limits::MAX_PERIOD;
use nanotap_study::request::options;

/// The motion with each number of modes.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Convergence {
    /// Numbers of modes N that are compared, from 1 to the largest.
    pub modes: Vec<usize>,
    /// Greatest difference of the tip deflection W over the orbit to the motion with the most
    /// modes, as a fraction of its amplitude; null where the motions differ in kind (another
    /// period, or none).
    pub difference: Vec<Option<f64>>,
    /// Motion with each number of modes.
    pub motions: Vec<Motion>,
    /// Smallest N from which the difference stays below the tolerance.
    pub enough: Option<usize>,
    /// Tolerance of `difference`, as a fraction of the amplitude.
    pub tolerance: f64,
    /// Verdict on the number of modes that is enough, in words.
    pub verdict: String,
    /// Instrument readings, their errors with each number of modes, and the share of each mode.
    #[serde(flatten)]
    pub readings: ReadingsReport,
    /// Which initial state was followed, and how to list the motions that others lead to.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Orbit with each number of modes, for figures; `None` where none was found.
    #[serde(skip)]
    pub orbits: Vec<Option<OrbitReport>>,
    /// Model with each number of modes, in the order of `modes`.
    #[serde(skip)]
    pub models: Vec<Model>,
}

/// The motion with one number of modes.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Motion {
    /// Number of modes N of the model.
    pub modes: usize,
    /// Class of the motion: periodic, or undecided if no orbit was found.
    pub classification: Classification,
    /// Period in drive periods; `None` if no orbit was found.
    pub period: Option<usize>,
    /// Largest tip deflection W of the orbit, in the model's unit of length; `None` if no orbit was
    /// found.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub tip_max: Option<f64>,
    /// Smallest tip deflection W of the orbit, in the model's unit of length; `None` if no orbit
    /// was found.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub tip_min: Option<f64>,
    /// The extrema of the tip deflection in SI, for a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<NumbersInSi>,
    /// Contact time / period, 0 to 1; `None` if no orbit was found.
    pub contact_fraction: Option<f64>,
    /// Largest modulus of the Floquet multipliers, dimensionless; `None` if no orbit was found.
    pub spectral_radius: Option<f64>,
    /// Reason why no orbit was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl Convergence {
    /// The motion with each number of modes.
    pub fn motion_table(&self, units: Units) -> Frame<'_> {
        let motion = |(m, _): (&'_ Motion, _)| match (m.period, &m.reason) {
            (Some(n), _) => format!("period {n}"),
            (None, Some(_)) => "no orbit".to_owned(),
            (None, None) => m.classification.name().to_owned(),
        };
        let rows = self.motions.iter().zip(&self.difference);
        frame! { Rows::new("motions", rows, Some(units));
            "modes", "modes", Plain => |(m, _)| m.modes;
            "difference", "", Plain => |(_, difference)| difference;
            .only_in_files();
            "", "difference", Digits(3) => |(_, difference)| difference.filter(|d| *d > 0.0);
            "", "motion", Plain => motion;
            "period", "", Plain => |(m, _)| m.period;
            .only_in_files();
            "tip_max", "W max", (Length, Quantity([6, 5])) => |(m, _)| m.tip_max;
            "tip_min", "W min", (Length, Quantity([6, 5])) => |(m, _)| m.tip_min;
            "contact_fraction", "contact", Percent(4) => |(m, _)| m.contact_fraction;
            "spectral_radius", "largest |μ|", Digits(6) => |(m, _)| m.spectral_radius;
            .aligned(Point, Point);
        }
    }

    /// What an experimenter reads with each number of modes, and the share of each mode.
    pub fn reading_table(&self, units: Units) -> Frame<'_> {
        let report = &self.readings;
        let share = |k: usize| report.mode_shares.get(k);
        frame! { Rows::new("readings", 0..report.readings.len(), Some(units));
            "modes", "modes", Plain => |k| k + 1;
            .fields(|k: usize| report.readings[k].as_ref());
            "energy_share", "share of the mode: energy", Percent(3) => move |k| Some(share(k)?.energy);
            "tip_share", "tip", Percent(3) => move |k| Some(share(k)?.tip);
            "force_share", "force", Percent(3) => move |k| share(k)?.force;
        }
    }
}

/// Points of an orbit at which two motions are compared.
const COMPARED_POINTS: usize = 400;

/// Computes the motion of `case` with 1 … `largest` modes: the orbit of the requested period, or
/// the one to which a run from rest converges.
///
/// ```
/// use nanotap::control::Control;
/// use nanotap::model::cantilever::Cantilever;
/// use nanotap::study::convergence::{ConvergenceOptions, convergence};
///
/// let case = Cantilever { omega: 4.1, ..Cantilever::paper() };
/// let found = convergence(&case, &ConvergenceOptions::default(), &Control::default())?;
/// // The paper: a single mode is not enough, even far below the second resonance.
/// assert!(found.difference[0].is_some_and(|difference| difference > 0.1));
/// assert_eq!(found.enough, Some(4));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the case makes no sense.
pub fn convergence(
    case: &Cantilever,
    options: &ConvergenceOptions,
    control: &Control<'_>,
) -> Result<Convergence, ModelError> {
    convergence_from(case, options, None, control)
}

/// As [`convergence`], of the motion that starts from a state of the case with its own modes.
fn convergence_from(
    case: &Cantilever,
    options: &ConvergenceOptions,
    start: Option<&[f64]>,
    control: &Control<'_>,
) -> Result<Convergence, ModelError> {
    let tolerance = options.tolerance;
    // A lever whose modes were measured has no further ones.
    let largest = match case.lever_modes.len() {
        0 => options.largest,
        measured => options.largest.min(measured),
    };
    let mut orbits: Vec<Option<OrbitReport>> = Vec::new();
    let mut motions = Vec::new();
    let models: Vec<Model> = (1..=largest)
        .map(|modes| {
            let mut model = Model::cantilever(&case.clone().with_modes(modes))?;
            model.start = start.map(|state| {
                let memory = state.len() - 2 * case.modes;
                with_modes(state, memory, modes)
            });
            Ok::<_, ModelError>(model.cancelled_by(&control.flag()))
        })
        .collect::<Result<_, _>>()?;
    for (modes, model) in (1..).zip(&models) {
        let near = |state: Option<Vec<f64>>| {
            let guess = OrbitOptions {
                period: options.period,
                state: state.map(Into::into),
                ..OrbitOptions::default()
            };
            orbit(model, &guess)
        };
        // Without a state the model's own start, or rest.
        let mut guesses = [carried(orbits.last(), modes), None];
        if model.start.is_some() {
            guesses.reverse();
        }
        let found = guesses.into_iter().map(near).find(Result::is_ok);
        let found = found.unwrap_or_else(|| near(Some(model.rest())));
        motions.push(motion(modes, found.as_ref().map_err(Error::message)));
        orbits.push(found.ok());
    }
    let difference = differences(&orbits, &models);
    let enough = enough(&difference, tolerance);
    let verdict = verdict(enough, &difference, largest, tolerance);
    let readings = ReadingsReport::of(&orbits, &models, tolerance);
    Ok(Convergence {
        modes: (1..=largest).collect(),
        difference,
        motions,
        enough,
        tolerance,
        verdict,
        readings,
        notes: Vec::new(),
        orbits,
        models,
    })
}

/// The state of the motion with one mode less, the new mode at rest: a guess near which
/// the same motion is looked for. Only where a period was given or found.
fn carried(previous: Option<&Option<OrbitReport>>, modes: usize) -> Option<Vec<f64>> {
    let previous = previous?.as_ref()?;
    let memory = previous.state.len() - 2 * (modes - 1);
    Some(with_modes(&previous.state, memory, modes))
}

fn motion(modes: usize, found: Result<&OrbitReport, String>) -> Motion {
    match found {
        Ok(o) => Motion {
            modes,
            classification: Classification::Periodic,
            period: Some(o.period),
            tip_max: Some(o.observables.tip_max),
            tip_min: Some(o.observables.tip_min),
            physical: None,
            contact_fraction: Some(o.observables.contact_fraction),
            spectral_radius: Some(spectral_radius(&o.multipliers)),
            reason: None,
        },
        Err(reason) => Motion {
            modes,
            classification: Classification::Undecided,
            period: None,
            tip_max: None,
            tip_min: None,
            physical: None,
            contact_fraction: None,
            spectral_radius: None,
            reason: Some(reason),
        },
    }
}

fn tip_series(report: &OrbitReport, model: &Model) -> Option<Vec<f64>> {
    let tip = report.trajectory.curve(&model.tip);
    let length = report.trajectory.end();
    (0..COMPARED_POINTS)
        .map(|i| tip.at(length * i as f64 / COMPARED_POINTS as f64))
        .collect()
}

fn differences(orbits: &[Option<OrbitReport>], models: &[Model]) -> Vec<Option<f64>> {
    let best = orbits.last().and_then(Option::as_ref);
    let reference = best
        .zip(models.last())
        .and_then(|(o, model)| tip_series(o, model));
    orbits
        .iter()
        .zip(models)
        .map(|(o, model)| {
            let (report, best, reference) = (o.as_ref()?, best?, reference.as_ref()?);
            if report.period != best.period {
                return None;
            }
            let series = tip_series(report, model)?;
            // The same motion may have been found a few drive periods on.
            let shift = COMPARED_POINTS / best.period;
            let distance = |k: usize| {
                (0..COMPARED_POINTS)
                    .map(|j| (series[(j + k * shift) % COMPARED_POINTS] - reference[j]).abs())
                    .fold(0.0, f64::max)
            };
            let least = (0..best.period).map(distance).fold(f64::INFINITY, f64::min);
            Some(least / best.observables.amplitude)
        })
        .collect()
}

fn enough(difference: &[Option<f64>], tolerance: f64) -> Option<usize> {
    let within = |d: &Option<f64>| d.is_some_and(|d| d <= tolerance);
    let first = difference
        .iter()
        .rposition(|d| !within(d))
        .map_or(0, |last| last + 1);
    // The last entry is the reference itself and proves nothing.
    (first + 1 < difference.len()).then_some(first + 1)
}

fn verdict(
    enough: Option<usize>,
    difference: &[Option<f64>],
    largest: usize,
    tolerance: f64,
) -> String {
    let percent = 100.0 * tolerance;
    match (enough, difference.last()) {
        (_, None | Some(None)) => {
            format!("no orbit was found with {largest} modes, so nothing can be compared")
        }
        (Some(n), _) => format!(
            "{} enough: from there on the tip moves within {percent} % of {largest} modes",
            if n == 1 {
                "1 mode is".to_owned()
            } else {
                format!("{n} modes are")
            }
        ),
        (None, _) => {
            format!("{largest} modes are not shown to be enough at {percent} %: take more")
        }
    }
}

options! {
    /// Options of a convergence study.
    pub struct ConvergenceOptions {
        /// Largest number of modes
        #[schemars(range(min = 2, max = MAX_MODES), extend("x-value" = "K"))]
        pub largest: usize = 10,
        /// Tolerance of the tip deflection, as a fraction of the amplitude
        #[schemars(range(min = f64::MIN_POSITIVE), extend("x-value" = "D"))]
        pub tolerance: f64 = 0.01,
        /// Period of the orbit to compare; default: the motion to which a run from rest converges
        #[schemars(range(min = 1, max = MAX_PERIOD), extend("x-value" = "N"))]
        pub period: Option<usize> = None,
    }
}

/// Number of modes that is enough.
#[derive(Clone, Copy, Debug)]
pub struct ConvergenceStudy;

impl Study for ConvergenceStudy {
    const NAME: &'static str = "convergence";
    const ABOUT: &'static str = "Compare the motion with 1 to K modes: how many are enough";
    type Options = ConvergenceOptions;
    type Report = Convergence;

    fn frames<'a>(case: &Case, report: &'a Convergence) -> Vec<Frame<'a>> {
        let units = case.units();
        vec![report.motion_table(units), report.reading_table(units)]
    }

    fn figure(case: &Case, report: &Convergence) -> Option<Figure> {
        Some(convergence_figure(report, &case.units()))
    }

    fn remarks(_: &Case, report: &Convergence) -> Vec<Remark> {
        Remark::notes(&report.notes)
    }

    fn compute(
        case: &Case,
        options: &ConvergenceOptions,
        control: &Control<'_>,
    ) -> Result<Convergence, Error> {
        let lever = cantilever(case, Self::NAME)?;
        let start = case.model()?.start;
        let mut found = convergence_from(lever, options, start.as_deref(), control)?;
        if let Some((orbit, model)) = found.orbits.iter().zip(&found.models).next_back() {
            let state = orbit.as_ref().map(|orbit| &*orbit.state);
            let note = initial_state_note(model, false, state);
            found.notes.push(note);
        }
        let units = case.units();
        for motion in &mut found.motions {
            if let (Some(high), Some(low)) = (motion.tip_max, motion.tip_min) {
                let ends = [
                    ("tip_max", Kind::Length, high),
                    ("tip_min", Kind::Length, low),
                ];
                motion.physical = units.in_si(ends);
            }
        }
        for reading in found.readings.readings.iter_mut().flatten() {
            reading.physical = units.in_si([
                ("A", Kind::Length, reading.first_harmonic),
                ("E_dis", Kind::Energy, reading.dissipation),
                ("F_max", Kind::Force, reading.peak_force),
            ]);
        }
        Ok(found)
    }
}
