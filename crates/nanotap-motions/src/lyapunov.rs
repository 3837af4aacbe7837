//! Lyapunov spectrum and Poincaré section of any motion.

use nanotap_case::physical::Remark;
use nanotap_dynamics::{
    ClassifyOptions, LyapunovSpectrum, PeriodicOrbit, StroboscopicMap as _, classify,
    lyapunov_spectrum,
};
use nanotap_figures::Figure;
use nanotap_flow::FlowError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use nanotap_dynamics::LyapunovOptions as SpectrumOptions;

use crate::attractors::orbit_exponents;
use crate::figure::attractors::section_figure;
use crate::initial_state::initial_state_note;
use crate::orbit::log_determinant_by_trace;
use crate::simulate::{Classification, NamedMotion, check_periods, check_states, starting_state};
use nanotap_case::Case;
use nanotap_case::state::WrittenState;
use nanotap_case::units::Units;
use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_model::model_map::ModelMap;
use nanotap_model::{Model, MotionError};
use nanotap_observe::begins_contact;
use nanotap_observe::frame::{Frame, Rows, frame};
use nanotap_observe::time_series::entry_names;
use nanotap_study::Study;
use nanotap_study::limits::MAX_PERIODS;
use nanotap_study::request::options;

/// Instants at which a Poincaré section is taken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Section {
    /// Once a drive period at this phase, 0 … 1.
    Phase(f64),
    /// At the beginning of every contact.
    Contact,
}

/// A point of a section.
#[derive(Clone, Debug, PartialEq)]
pub struct SectionPoint {
    /// Drive phase as a fraction of the period, 0 … 1.
    pub phase: f64,
    /// Tip displacement W, in the model's unit of length.
    pub tip: f64,
    /// Rate of the tip displacement, in the model's unit of length per unit of time.
    pub tip_rate: f64,
    /// Rate of the gap, in the model's unit of length per unit of time; negative: closing.
    pub gap_rate: f64,
    /// State at this instant, in the model's units. Its entries are a_1 … a_N (or x), their rates,
    /// then any memory of the sample.
    pub state: Vec<f64>,
}

/// Lyapunov spectrum and Poincaré section.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct LyapunovReport {
    /// Class of the motion, such as periodic or chaotic.
    pub classification: Classification,
    /// Period in drive periods, if periodic.
    pub period: Option<usize>,
    /// Evidence for the class, in words.
    pub evidence: String,
    /// Drive periods of the discarded transient.
    pub transient: usize,
    /// Drive periods of the average; of a closed orbit its period.
    pub periods: usize,
    /// How the exponents were obtained.
    pub source: ExponentSource,
    /// Exponents, natural logarithm per drive period, largest first. Null where neighbouring motions meet
    /// exactly, as where the motion sticks to a rigid stop: the exponent is −∞.
    #[schemars(with = "Vec<Option<f64>>")]
    pub exponents: Vec<f64>,
    /// Standard error of each exponent, per drive period, in the order of `exponents`; 0 of a closed
    /// orbit, whose exponents are not averages.
    pub errors: Vec<f64>,
    /// Sum of the exponents per drive period: contraction rate of volumes in state space. Null: −∞.
    #[schemars(with = "Option<f64>")]
    pub sum: f64,
    /// The same from the trace of the equations and the time in each regime, with twice the
    /// logarithm of the restitution at every impact, over the same periods: the check. Null: −∞, or not
    /// defined where a memory of the sample is reset.
    #[schemars(with = "Option<f64>")]
    pub sum_by_trace: f64,
    /// Largest difference between the Jacobian's stretches and the trace, natural logarithms: of a closed
    /// orbit over its repetition, else of a drive period. Rounding only, if both are right. `None` where
    /// the trace gives no value, or rounding hides a stretch in every period.
    pub determinant_defect: Option<f64>,
    /// Kaplan–Yorke dimension of the strobe points, dimensionless; for a torus, its dimension.
    pub kaplan_yorke_dimension: f64,
    /// Mean of the states at drive phase 0, in the model's units. Its entries are a_1 … a_N (or x),
    /// their rates, then any memory of the sample.
    pub mean: Vec<f64>,
    /// Which initial state was followed, and how to list the motions that others lead to.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// The section, for files and figures.
    #[serde(skip)]
    pub section: Vec<SectionPoint>,
    /// Where the section was taken.
    pub section_at: Section,
}

/// How Lyapunov exponents were obtained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExponentSource {
    /// ln|μ| of the multipliers μ of the closed orbit to which the motion goes, over its period.
    Multipliers,
    /// Averages of the growth of tangent vectors along the motion.
    Average,
    /// The motion sticks to a rigid stop, where all tangent vectors vanish: every exponent is −∞.
    Sticking,
}

/// Exponents with the evidence for them.
struct Spectrum {
    source: ExponentSource,
    periods: usize,
    exponents: Vec<f64>,
    errors: Vec<f64>,
    sum_by_trace: f64,
    determinant_defect: Option<f64>,
    kaplan_yorke_dimension: f64,
    mean: Vec<f64>,
}

impl Spectrum {
    /// The exponents of a closed orbit.
    fn of_orbit(model: &Model, orbit: &PeriodicOrbit) -> Result<Self, Error> {
        let period = orbit.period as f64;
        let by_trace = log_determinant_by_trace(model, orbit)?;
        let mut defect = by_trace.map(|by_trace| (orbit.log_determinant - by_trace).abs());
        let dimension = orbit.dimension();
        let mut exponents = orbit_exponents(orbit);
        // A multiplier below the rounding of the largest is lost in the Jacobian: its exponent is the
        // remainder of the trace, which then checks nothing.
        let rounding = nanotap_arithmetic::ln(f64::EPSILON) / period;
        if let (Some(by_trace), [first, others @ .., last]) = (by_trace, &mut exponents[..])
            && *last < *first + rounding
            && by_trace.is_finite()
        {
            *last = by_trace / period - *first - others.iter().sum::<f64>();
            defect = None;
        }
        let mean = (0..dimension).map(|k| orbit.states.iter().map(|x| x[k]).sum::<f64>() / period);
        Ok(Self {
            source: ExponentSource::Multipliers,
            periods: orbit.period,
            exponents,
            errors: vec![0.0; dimension],
            sum_by_trace: by_trace.map_or(f64::NAN, |sum| sum / period),
            // Both are −∞ where the orbit sticks.
            determinant_defect: defect.filter(|defect| defect.is_finite()),
            kaplan_yorke_dimension: 0.0,
            mean: mean.collect(),
        })
    }

    /// The averages over a run.
    fn of_run(spectrum: LyapunovSpectrum, classification: Classification, sticks: bool) -> Self {
        let dimension = match classification {
            Classification::QuasiPeriodic => spectrum.neutral_directions() as f64,
            _ => spectrum.kaplan_yorke_dimension(),
        };
        let all = spectrum.exponents.len();
        let averages = Self {
            source: ExponentSource::Average,
            periods: spectrum.periods,
            mean: spectrum.strobe.mean_state().to_vec(),
            exponents: spectrum.exponents,
            errors: spectrum.errors,
            sum_by_trace: spectrum.log_determinant,
            determinant_defect: spectrum.determinant_defect,
            kaplan_yorke_dimension: dimension,
        };
        if !sticks {
            return averages;
        }
        Self {
            source: ExponentSource::Sticking,
            exponents: vec![f64::NEG_INFINITY; all],
            errors: vec![0.0; all],
            sum_by_trace: f64::NEG_INFINITY,
            determinant_defect: None,
            kaplan_yorke_dimension: 0.0,
            ..averages
        }
    }
}

/// Computes the Lyapunov spectrum and a Poincaré section of the motion of `model`.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::control::Control;
/// use nanotap::model::cantilever::Cantilever;
/// use nanotap::study::lyapunov::{LyapunovOptions, lyapunov};
///
/// let model = Case::from(Cantilever::paper()).model()?;
/// let options = LyapunovOptions { periods: 2000, ..LyapunovOptions::default() };
/// let report = lyapunov(&model, &options, &Control::default())?;
/// // Chaos at Ω = 2.6: the largest exponent is about 0.25 per drive period.
/// assert!((report.exponents[0] - 0.25).abs() < 5.0 * report.errors[0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the initial state is invalid, the flow fails, or the work was cancelled.
pub fn lyapunov(
    model: &Model,
    options: &LyapunovOptions,
    control: &Control<'_>,
) -> Result<LyapunovReport, Error> {
    let mut state = starting_state(model, options.state.as_ref())?;
    check_periods(options.periods)?;
    check_states(model, options.points, "points")?;
    let model = &model.clone().cancelled_by(&control.flag());
    let mut map = ModelMap::new(model);
    let defaults = SpectrumOptions::default();
    // The tangent vectors align themselves during the last periods of the transient.
    let alignment = defaults.alignment.min(options.transient);
    map.advance_by(&mut state, options.transient - alignment)?;
    let mut start = state.clone();
    map.advance_by(&mut start, alignment)?;
    let named = NamedMotion::of(&classify(&mut map, &start, &ClassifyOptions::default()).kind);
    if control.is_cancelled() {
        return Err(Error::stopped());
    }
    let found = if let Some(orbit) = &named.orbit {
        Spectrum::of_orbit(model, orbit)?
    } else {
        let fixed = SpectrumOptions {
            alignment,
            min_periods: options.periods,
            max_periods: options.periods,
            ..defaults
        };
        let before = map.resets();
        let spectrum = lyapunov_spectrum(&mut map, &mut state, &fixed).map_err(|_| {
            if control.is_cancelled() {
                return Error::stopped();
            }
            let what = "the tangent vectors of the motion";
            FlowError::NotFinite { what }.into()
        })?;
        Spectrum::of_run(spectrum, named.classification, map.resets() > before)
    };
    let section_at = options.section_at();
    let section = section(model, &start, section_at, options.points)?;
    Ok(LyapunovReport {
        classification: named.classification,
        period: named.orbit.map(|o| o.period),
        evidence: named.evidence,
        transient: options.transient,
        periods: found.periods,
        source: found.source,
        sum: found.exponents.iter().sum(),
        sum_by_trace: found.sum_by_trace,
        determinant_defect: found.determinant_defect,
        kaplan_yorke_dimension: found.kaplan_yorke_dimension,
        exponents: found.exponents,
        errors: found.errors,
        mean: found.mean,
        notes: Vec::new(),
        section,
        section_at,
    })
}

/// `points` points of the section of the motion from `start`, and fewer where contacts
/// are rarer than one in eight periods.
///
/// # Errors
/// When the flow fails.
pub fn section(
    model: &Model,
    start: &[f64],
    at: Section,
    points: usize,
) -> Result<Vec<SectionPoint>, MotionError> {
    /// Periods watched for each point.
    const RAREST: usize = 8;
    let tip_rate = model.tip_rate();
    let drive = model.system.drive();
    let period = model.period();
    let gap_rate = {
        let free = &model.system.regimes()[0];
        model.gap.rate(free.matrix(), free.forcing(), drive)
    };
    let point = |state: Vec<f64>, time: f64| SectionPoint {
        phase: time / period,
        tip: model.tip.at(drive, &state, time),
        tip_rate: tip_rate.at(drive, &state, time),
        gap_rate: gap_rate.at(drive, &state, time),
        state,
    };
    let mut found = Vec::with_capacity(points);
    let mut record = model.recorder(start)?;
    for _ in 0..points.saturating_mul(RAREST) {
        if found.len() >= points {
            break;
        }
        let recorded = record(1)?;
        match at {
            Section::Phase(phase) => {
                let time = phase.rem_euclid(1.0) * period;
                found.extend(recorded.state_at(time).map(|state| point(state, time)));
            }
            Section::Contact => {
                let switches = recorded.switches().into_iter();
                for switch in switches.filter(|e| begins_contact(model, e.from, e.to)) {
                    let state = recorded.state_before(switch.time);
                    found.extend(state.map(|state| point(state, switch.time)));
                }
            }
        }
    }
    found.truncate(points);
    Ok(found)
}

/// Where a section is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SectionKind {
    /// Once a drive period, at one phase
    #[default]
    Phase,
    /// At the beginning of every contact
    Contact,
}

impl LyapunovReport {
    /// The section, with the names of the entries of a state.
    pub fn section_table(&self, names: Vec<String>, units: Units) -> Frame<'_> {
        frame! { Rows::new("section", &self.section, Some(units));
            "phase_degrees", "", (Angle, Digits(5)) => |p| 360.0 * p.phase; .in_files((|number| number, ""));
            "tip", "", (Length, Digits(5)) => |p| p.tip;
            "tip_rate", "", (Velocity, Digits(5)) => |p| p.tip_rate;
            "gap_rate", "", (Velocity, Digits(5)) => |p| p.gap_rate;
            .states(names, |p| &p.state);
        }
    }

    /// The exponents, largest first.
    pub fn exponent_table(&self) -> Frame<'_> {
        let rows = self.exponents.iter().zip(&self.errors).enumerate();
        frame! { Rows::new("exponents", rows, None);
            "number", "", Plain => |(k, _)| k + 1;
            "exponent", "exponent per drive period", Digits(5) => |(_, (exponent, _))| exponent;
            "error", "± standard error", Digits(2) => |(_, (_, error))| error;
        }
    }
}

/// Most points of a section: 300 MB with three modes.
pub const MAX_SECTION_POINTS: usize = 2_000_000;

options! {
    /// Options of the Lyapunov spectrum.
    pub struct LyapunovOptions {
        /// Drive periods of the average
        #[schemars(range(min = 1, max = MAX_PERIODS), extend("x-value" = "P"))]
        pub periods: usize = 20_000,
        /// Drive periods of the discarded transient
        #[schemars(range(min = 0, max = MAX_PERIODS), extend("x-value" = "T"))]
        pub transient: usize = 1000,
        /// Initial state at drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v), or some by name, as in
        /// tip=5nm; of a physical case in m and m/s, or with units; default: rest
        #[schemars(extend("x-value" = "STATE"))]
        pub state: Option<WrittenState> = None,
        /// Poincaré section
        pub section: SectionKind = SectionKind::default(),
        /// Drive phase of the section in degrees
        #[schemars(extend("x-value" = "DEGREES"))]
        pub phase: f64 = 0.0,
        /// Number of points of the section
        #[schemars(range(min = 0, max = MAX_SECTION_POINTS), extend("x-value" = "K"))]
        pub points: usize = 5000,
    }
}

impl LyapunovOptions {
    /// Where the section is taken.
    fn section_at(&self) -> Section {
        match self.section {
            SectionKind::Phase => Section::Phase((self.phase / 360.0).rem_euclid(1.0)),
            SectionKind::Contact => Section::Contact,
        }
    }
}

/// Study of the Lyapunov spectrum and a Poincaré section of any motion.
#[derive(Clone, Copy, Debug)]
pub struct LyapunovStudy;

impl Study for LyapunovStudy {
    const NAME: &'static str = "lyapunov";
    const ABOUT: &'static str =
        "Compute the Lyapunov spectrum with error bars, and a Poincaré section";
    type Options = LyapunovOptions;
    type Report = LyapunovReport;

    fn frames<'a>(case: &Case, report: &'a LyapunovReport) -> Vec<Frame<'a>> {
        let names = entry_names(case);
        vec![
            report.section_table(names, case.units()),
            report.exponent_table(),
        ]
    }

    fn figure(case: &Case, report: &LyapunovReport) -> Option<Figure> {
        Some(section_figure(&case.model().ok()?, report, &case.units()))
    }

    fn remarks(_: &Case, report: &LyapunovReport) -> Vec<Remark> {
        Remark::notes(&report.notes)
    }

    fn compute(
        case: &Case,
        options: &LyapunovOptions,
        control: &Control<'_>,
    ) -> Result<LyapunovReport, Error> {
        let options = LyapunovOptions {
            state: case.state_of(options.state.as_ref())?,
            ..options.clone()
        };
        let model = case.model()?;
        let mut report = lyapunov(&model, &options, control)?;
        let given = options.state.is_some();
        report.notes.push(initial_state_note(&model, given, None));
        Ok(report)
    }
}
