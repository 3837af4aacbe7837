//! Coexisting attractors and their observables, found by a census: a sampling of initial states.

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_case::physical::Remark;
use nanotap_dynamics::{
    AttractorKind, Census, CensusEnd, CensusOptions, CheckedStart, ClassifyOptions, Control,
    ExactOutcome, Fraction, OrbitSearch, PeriodicOrbit, Stability, StartBox, StartOutcome,
    StartSet, census_of, check_starts, find_orbits,
};
use nanotap_figures::Figure;
use nanotap_volterra::coarse;
use schemars::JsonSchema;
use serde::Serialize;

use crate::approach::states_near;
use crate::figure::attractors::attractors_figure;
use crate::orbit::{OrbitReport, report, spectral_radius};
use crate::proof::Prover;
use crate::simulate::{Classification, largest_exponent, orbit_evidence, torus_evidence};
use nanotap_case::Case;
use nanotap_case::physical::Physical;
use nanotap_case::units::Units;
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_model::model_map::ModelMap;
use nanotap_observe::frame::{Form, Frame, Rows, frame};
use nanotap_observe::model_limits::limits_of;
use nanotap_observe::time_series::entry_names;
use nanotap_observe::time_series::state_names;
use nanotap_observe::{Dimension, ObservableSet, Observables, PhysicalMotion, measure};
use nanotap_quantity::number::significant;
use nanotap_study::Study;
use nanotap_study::averaged_orbits::averaged_orbits;
use nanotap_study::in_si::InSi;
use nanotap_study::limits::MAX_PERIOD;
use nanotap_study::request::options;
use nanotap_study::start_box::{box_with, default_starts};
use nanotap_study::value::Intervals;

/// Results of a census: the attractors found by sampling initial states, with their shares.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Attractors {
    /// Number of initial states that were followed.
    pub starts: usize,
    /// Seed of the initial states.
    pub seed: u64,
    /// Box of the initial states: name of the coordinate, lower and upper end.
    #[serde(rename = "box")]
    pub sides: Vec<Side>,
    /// Attractors, most frequent first.
    pub attractors: Vec<AttractorReport>,
    /// Shares of the attractors by size of the initial states, where these were drawn at several
    /// sizes.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sizes: Vec<SizeReport>,
    /// Bound on undiscovered motions, where sampling went on until it was small.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unseen: Option<UnseenReport>,
    /// Reason why the census ended.
    pub end: EndReport,
    /// Relative tolerance of the approximate flow, dimensionless. `None` if all initial states were
    /// followed on the exact flow; otherwise shares, lifetimes and the bound on undiscovered
    /// motions are those of the approximate flow. Orbits, multipliers and exponents are always
    /// those of the exact flow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub followed_at: Option<f64>,
    /// Initial states whose motion stayed undecided, with the reason.
    pub undecided: Vec<UndecidedStart>,
    /// Fraction of the initial states that is undecided.
    pub undecided_fraction: Share,
    /// Fraction of the initial states whose motion is unbounded.
    pub unbounded: Share,
    /// Transient chaos, if some initial states escaped from it and others have not yet.
    pub transient_chaos: Option<TransientChaosReport>,
    /// Unstable periodic orbits, if they were requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unstable: Option<Vec<InSi<OrbitReport>>>,
    /// Initial states that were followed again on the exact flow, if that was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub check: Option<CheckReport>,
    /// What limits these results, in sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Whether the work was stopped before all starts were done.
    pub cancelled: bool,
}

/// Comparison of initial states of a census with the exact flow.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct CheckReport {
    /// Number of initial states that were followed again.
    pub starts: usize,
    /// Number of them that go to the same motion.
    pub agreed: usize,
    /// Number of them that are undecided in the census or on the exact flow.
    pub undecided: usize,
    /// Those that go to another motion.
    pub disagreements: Vec<Disagreement>,
}

/// An initial state that goes to another motion on the exact flow than in the census.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Disagreement {
    /// Index of the initial state in the order of sampling, from 0.
    pub start: usize,
    /// Initial state at drive phase 0, in the model's units. Its entries are a_1 … a_N (or x),
    /// their rates, then any memory of the sample.
    pub state: Vec<f64>,
    /// Motion that the census reports, in words; attractors are numbered from 1.
    pub census: String,
    /// Motion on the exact flow, in words.
    pub exact: String,
    /// Whether the exact flow takes an initial state that differs by a few hundred-thousandths to
    /// another motion than this one: it lies near a boundary of basins, or on transient chaos.
    pub sensitive: bool,
}

impl CheckReport {
    fn new(checked: &[CheckedStart], set: &StartSet) -> Self {
        let count = |agrees| checked.iter().filter(|one| one.agrees == agrees).count();
        let other = checked.iter().filter(|one| one.agrees == Some(false));
        Self {
            starts: checked.len(),
            agreed: count(Some(true)),
            undecided: count(None),
            disagreements: other
                .map(|one| Disagreement {
                    start: one.start,
                    state: set.start(one.start).unwrap_or_default(),
                    census: match one.outcome {
                        StartOutcome::Attractor { index, .. } => attractor_number(index),
                        StartOutcome::TransientChaos { .. } => "transient chaos".into(),
                        StartOutcome::Unbounded => "left every bound".into(),
                        StartOutcome::Undecided => "undecided".into(),
                    },
                    exact: match &one.exact {
                        ExactOutcome::Attractor(index) => attractor_number(*index),
                        ExactOutcome::OtherOrbit(period) => {
                            format!("an orbit of period {period} that is not listed")
                        }
                        ExactOutcome::QuasiPeriodic => "quasi-periodic".into(),
                        ExactOutcome::Chaotic => "chaotic".into(),
                        ExactOutcome::Unbounded => "left every bound".into(),
                        ExactOutcome::Undecided(reason) => format!("undecided: {reason}"),
                    },
                    sensitive: one.is_sensitive,
                })
                .collect(),
        }
    }
}

fn attractor_number(index: usize) -> String {
    format!("attractor {}", index + 1)
}

/// Results of the initial states of one size.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SizeReport {
    /// Size of the box of these initial states, as a fraction of the largest box.
    pub scale: f64,
    /// Number of initial states of this size that were followed.
    pub starts: usize,
    /// Fraction of these initial states that goes to each attractor, 0 to 1, in the order of the
    /// attractors.
    pub fractions: Vec<f64>,
}

/// Fraction of the initial states that may lead to undiscovered motions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct UnseenReport {
    /// Number of different motions that were discovered.
    pub motions: usize,
    /// Initial states since the last discovery.
    pub starts: usize,
    /// Upper bound, with 95 % confidence, of the fraction that leads to undiscovered motions.
    pub fraction: f64,
    /// Value of `fraction`, 0 to 1, below which sampling ends.
    pub target: f64,
}

/// Reason why a census ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum EndReport {
    /// All requested initial states were followed.
    AllStarts,
    /// The undiscovered fraction is as small as requested.
    BoundMet,
    /// The limit of initial states was reached.
    MaxStarts {
        /// Largest number of initial states that could be followed.
        limit: usize,
    },
    /// The limit of drive periods was reached.
    MaxPeriods {
        /// Largest number of drive periods, of all initial states together.
        limit: usize,
    },
    /// The limit of steps of the approximate flow was reached.
    MaxSteps {
        /// Largest number of steps, of all initial states together; two evaluations of the force in
        /// the exact flow count as one step.
        limit: u64,
    },
    /// The work was cancelled before the census was complete.
    Cancelled,
}

/// A side of the box of initial states.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Side {
    /// Name of the coordinate, an entry of the state such as `a1` or `v1`.
    pub coordinate: String,
    /// Lower end of the coordinate's range, in the model's units.
    pub lower: f64,
    /// Upper end of the coordinate's range, in the model's units.
    pub upper: f64,
    /// The ends in SI, of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<SideInSi>,
}

/// A side of the box of initial states in SI.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SideInSi {
    /// Lower end of the coordinate's range, in the SI unit that `unit` states.
    pub lower: f64,
    /// Upper end of the coordinate's range, in the SI unit that `unit` states.
    pub upper: f64,
    /// The unit, `m` or `m/s`.
    pub unit: &'static str,
}

/// A fraction of the initial states.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Share {
    /// Number of initial states in this share.
    pub count: usize,
    /// Fraction of all initial states that were followed, 0 to 1.
    pub fraction: f64,
    /// 95 % confidence interval of the fraction (Wilson).
    pub fraction_interval: [f64; 2],
}

impl From<Fraction> for Share {
    fn from(f: Fraction) -> Self {
        Self {
            count: f.count,
            fraction: f.estimate,
            fraction_interval: [f.low, f.high],
        }
    }
}

/// An attractor with its share, its exponents, and its orbit or a recording.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct AttractorReport {
    /// Class of the motion: periodic, quasi-periodic or chaotic.
    pub classification: Classification,
    /// Share of the initial states that reach the attractor.
    #[serde(flatten)]
    pub share: Share,
    /// Lyapunov exponents per drive period, largest first; of an orbit from its multipliers. Null for a
    /// multiplier of 0: the exponent is −∞.
    #[schemars(with = "Vec<Option<f64>>")]
    pub lyapunov: Vec<f64>,
    /// Standard error of each exponent, per drive period; `None` where they were not measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lyapunov_errors: Option<Vec<f64>>,
    /// Evidence for the class, in words.
    pub evidence: String,
    /// The orbit, if it is periodic.
    #[serde(flatten)]
    pub orbit: Option<OrbitReport>,
    /// A recording of the motion, if it is not periodic.
    #[serde(flatten)]
    pub non_periodic: Option<NonPeriodic>,
    /// The same in SI, of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<PhysicalMotion>,
}

impl AttractorReport {
    /// Observables of the orbit, or of the recording.
    fn observables(&self) -> Option<&Observables> {
        let orbit = self.orbit.as_ref().map(|orbit| &orbit.observables);
        orbit.or_else(|| Some(&self.non_periodic.as_ref()?.observables))
    }

    /// States at drive phase 0: all of an orbit, one of another motion.
    fn states(&self) -> &[Vec<f64>] {
        match (&self.orbit, &self.non_periodic) {
            (Some(orbit), _) => &orbit.states,
            (None, Some(recording)) => std::slice::from_ref(&recording.state),
            (None, None) => &[],
        }
    }
}

/// An orbit in the SI units of `view`.
fn orbit_in_si(orbit: &OrbitReport, view: &Physical) -> PhysicalMotion {
    PhysicalMotion::alone(&orbit.observables, Some(&orbit.spectrum), view)
        .with_state(&orbit.state, view)
}

impl Attractors {
    /// The states of each attractor at drive phase 0, with the names of their entries.
    pub fn state_table(&self, names: Vec<String>, units: Units) -> Frame<'_> {
        let states = self.attractors.iter().enumerate().flat_map(|(k, one)| {
            let states = one.states().iter().enumerate();
            states.map(move |(point, state)| (k, one, point, state))
        });
        frame! { Rows::new("states", states, Some(units));
            "attractor", "", Plain => |(k, ..)| k + 1;
            "classification", "", Plain => |(_, one, ..)| one.classification.name();
            "period", "", Plain => |(_, one, ..)| Some(one.orbit.as_ref()?.period);
            "fraction", "", Digits(5) => |(_, one, ..)| one.share.fraction;
            "point", "", Plain => |(_, _, point, _)| point;
            .states(names, |(.., state)| state);
        }
    }

    /// The attractors with their shares of the initial states.
    pub fn attractor_table(&self, units: Units) -> Frame<'_> {
        let motion = |a: &'_ AttractorReport| match &a.orbit {
            Some(orbit) => format!("period {}", orbit.period),
            None => a.classification.name().to_owned(),
        };
        let interval = |a: &'_ AttractorReport| {
            let [low, high] = a
                .share
                .fraction_interval
                .map(|end| significant(100.0 * end, 3));
            format!("{low} … {high}")
        };
        // What an instrument shows, where there is one.
        let shown = match units {
            Units::Si(_) => {
                "attractor,motion,fraction,interval,exponent,A,phase,E_dis,F_max,contact"
            }
            Units::Model => {
                "attractor,motion,fraction,interval,exponent,tip,contact_fraction,contacts_per_period"
            }
        };
        frame! { Rows::new("attractors", self.attractors.iter().enumerate(), Some(units));
            "attractor", "", Plain => |(k, _)| k + 1;
            "motion", "motion", Plain => move |(_, a)| motion(a);
            "fraction", "starts", Percent(3) => |(_, a)| a.share.fraction;
            "interval", "95 %", Plain => move |(_, a)| interval(a);
            "exponent", "λ₁", Digits(3) => |(_, a)| a.lyapunov.first().copied();
            "tip", "tip", Plain => move |(_, a)| Some(tip_range(a.observables()?, units, 4));
            "contact_fraction", "contact", Percent(3) =>
                |(_, a)| Some(a.observables()?.contact_fraction);
            "contacts_per_period", "contacts/period", Digits(3) =>
                |(_, a)| Some(a.observables()?.contacts_per_period);
            .observed(ObservableSet::COMMON, |(_, a)| a.observables());
            .shown(shown);
        }
    }

    /// The unstable orbits.
    pub fn unstable_table(&self, units: Units) -> Frame<'_> {
        let orbits = self.unstable.iter().flatten().map(|orbit| &orbit.motion);
        let modulus = |[re, im]: &[f64; 2]| nanotap_arithmetic::hypot(*re, *im);
        let directions = move |o: &'_ OrbitReport| {
            let moduli = o.multipliers.iter().map(modulus);
            moduli.filter(|m| *m > 1.0).count()
        };
        frame! { Rows::new("unstable", orbits, Some(units));
            "period", "period", Plain => |o| o.period;
            "spectral_radius", "|μ|", Digits(6) => |o| spectral_radius(&o.multipliers);
            "directions", "unstable directions", Plain => directions;
            "tip", "tip", Plain => move |o| tip_range(&o.observables, units, 4);
            "contact_fraction", "contact", Percent(4) => |o| o.observables.contact_fraction;
        }
    }

    /// Proves the reported orbits by interval arithmetic where possible.
    fn prove(&mut self, case: &Case) {
        let prover = Prover::new(case);
        let stable = self.attractors.iter_mut().filter_map(|a| a.orbit.as_mut());
        let unstable = self.unstable.iter_mut().flatten();
        for orbit in stable.chain(unstable.map(|orbit| &mut orbit.motion)) {
            orbit.prove(&prover);
        }
    }

    /// The same, with every motion in SI too, in the units of `view`.
    #[must_use]
    pub fn in_si(mut self, view: &Physical) -> Self {
        for attractor in &mut self.attractors {
            attractor.physical = match (&attractor.orbit, &attractor.non_periodic) {
                (Some(orbit), _) => Some(orbit_in_si(orbit, view)),
                (None, Some(seen)) => Some(
                    PhysicalMotion::alone(&seen.observables, None, view)
                        .with_state(&seen.state, view),
                ),
                (None, None) => None,
            };
        }
        let units = Units::Si(view.scales);
        for side in &mut self.sides {
            side.physical = units.of_entry(&side.coordinate).map(|(kind, si)| SideInSi {
                lower: si * side.lower,
                upper: si * side.upper,
                unit: kind.si_unit(),
            });
        }
        for orbit in self.unstable.iter_mut().flatten() {
            orbit.physical = Some(orbit_in_si(&orbit.motion, view));
        }
        self
    }
}

/// A motion that is not periodic.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct NonPeriodic {
    /// Always `None`: null in documents, where a periodic motion has its period.
    pub period: Option<usize>,
    /// State on the motion at drive phase 0, in the model's units. Its entries are a_1 … a_N (or
    /// x), their rates, then any memory of the sample.
    pub state: Vec<f64>,
    /// Observables over [`OBSERVED_PERIODS`] drive periods, in the model's units.
    #[serde(flatten)]
    pub observables: Observables,
}

/// The range of the tip deflection in words, in SI with so many digits.
pub(crate) fn tip_range(observables: &Observables, units: Units, digits: usize) -> String {
    let ends = [observables.tip_min, observables.tip_max];
    let [low, high] = ends.map(|w| Form::Quantity([5, digits]).shown(Dimension::Length, units, w));
    format!("{low} … {high}")
}

/// An initial state whose motion was left undecided.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct UndecidedStart {
    /// Index of the initial state in the order of sampling, from 0.
    pub start: usize,
    /// Initial state at drive phase 0, in the model's units. Its entries are a_1 … a_N (or x),
    /// their rates, then any memory of the sample.
    pub state: Vec<f64>,
    /// Reason why the motion was left undecided.
    pub reason: String,
}

/// Transient chaos: chaotic motion that ends after a finite lifetime on an attractor.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct TransientChaosReport {
    /// Lyapunov exponents per drive period while it lasts; empty where the exact flow was not followed
    /// on it.
    pub lyapunov: Vec<f64>,
    /// Standard error of each Lyapunov exponent, per drive period, in the order of `lyapunov`.
    pub lyapunov_errors: Vec<f64>,
    /// Mean lifetime in drive periods.
    pub lifetime: f64,
    /// 95 % confidence interval of the mean lifetime, in drive periods.
    pub lifetime_interval: [f64; 2],
    /// Number of escapes behind the estimate.
    pub escapes: usize,
    /// Fraction of the initial states that is still on transient chaos at the end.
    #[serde(rename = "wandering")]
    pub unescaped: Share,
    /// Attractors that the escapes reached: index of the attractor and number of escapes.
    pub destinations: Vec<(usize, usize)>,
}

/// Most starts of a census: 480 MB of states at N = 3.
pub const MAX_STARTS: usize = 1_000_000;
/// Number of initial states in a given box, unless the options state another.
const STARTS_IN_A_BOX: usize = 256;
/// Upper bound of the fraction of initial states that may lead to undiscovered motions at which
/// sampling ends under a nonlinear law.
pub const NONLINEAR_UNSEEN: f64 = 0.01;
/// Drive periods of all initial states together after which sampling ends under a nonlinear law.
const NONLINEAR_PERIODS: usize = 600_000;
/// Harmonics reported of each orbit.
const HARMONICS: usize = 20;
/// Drive periods over which a motion that does not repeat is observed.
pub const OBSERVED_PERIODS: usize = 512;
/// Steps of the approximate flow after which a start is left undecided.
const MAX_START_STEPS: u64 = 4_000_000;
/// Steps of the approximate flow of all initial states together after which sampling ends under a
/// nonlinear law: some four seconds.
const NONLINEAR_STEPS: u64 = 30_000_000;
/// Drive periods of decay above which no start is followed until it has arrived.
const SLOW_PERIODS: f64 = 1e6;
/// Factor over the largest coordinate of the box above which a state counts as unbounded.
const OUT_OF_BOUNDS: f64 = 1e6;

/// Finds coexisting attractors by sampling initial states.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::control::Control;
/// use nanotap::model::cantilever::Cantilever;
/// use nanotap::study::attractors::{AttractorsOptions, attractors};
///
/// let paper = Cantilever { alpha1: 0.0, omega: 20.0, ..Cantilever::paper() };
/// let options = AttractorsOptions { starts: Some(64), ..AttractorsOptions::default() };
/// let found = attractors(&Case::from(paper).model()?, &options, &Control::default())?;
/// let mut periods: Vec<_> = found.attractors.iter().filter_map(|one| one.orbit.as_ref()).collect();
/// periods.sort_by_key(|orbit| orbit.period);
/// // Two orbits coexist, of periods 1 and 4.
/// assert_eq!(periods.iter().map(|orbit| orbit.period).collect::<Vec<_>>(), [1, 4]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the options are invalid for the model, or an attractor cannot be measured.
pub fn attractors(
    model: &Model,
    options: &AttractorsOptions,
    control: &Control<'_>,
) -> Result<Attractors, Error> {
    let in_box = !options.sides.0.is_empty();
    let starts = options.starts.or(in_box.then_some(STARTS_IN_A_BOX));
    match starts {
        Some(0) => {
            return Err(Error::input(
                "expected at least one start, got 0",
                "give 1 or more {starts}",
            ));
        }
        Some(starts) if starts > MAX_STARTS => {
            return Err(Error::input(
                format!("{starts} starts are too many; {MAX_STARTS} at most"),
                "give fewer {starts}",
            ));
        }
        _ => {}
    }
    let start_box = box_with(model, &options.sides.of_entries(&Units::Model)?)?;
    let set = match starts {
        Some(count) => StartSet::given(start_box.starts_until(options.seed, count, control)),
        None => default_starts(model, options.seed)?,
    };
    let averaged = averaged_orbits(model).into_iter();
    let averaged = averaged.map(|orbit| (orbit.period, orbit.states[0].clone()));
    let set = set.with_seeds(averaged.chain(options.seeds.iter().cloned()));
    let map = ModelMap::new(model);
    // Motions that were found are measured, also of work that was cancelled.
    let model = &model.with_grace();
    let budgets = budgets(model, options, &start_box);
    let found = census_of(&map, &set, &budgets, control);
    let unstable = if options.unstable > 0 {
        let searched = found.outcomes_by_start.len().min(SEARCHED_STARTS);
        let seeds = set.seeds().iter().map(|(_, state)| state.clone());
        let starts = (0..searched).map_while(|k| set.start(k));
        let searched: Vec<_> = seeds.chain(starts).collect();
        Some(unstable_orbits(model, &map, &searched, options, control)?)
    } else {
        None
    };
    let check = (options.check > 0).then(|| {
        let chosen = (options.check, options.seed);
        let checked = check_starts(&map, &set, &found, chosen, &budgets.classify, control);
        CheckReport::new(&checked, &set)
    });
    let sides = state_names(model)
        .into_iter()
        .zip(start_box.lower().iter().zip(start_box.upper()))
        .map(|(coordinate, (&lower, &upper))| Side {
            coordinate,
            lower,
            upper,
            physical: None,
        })
        .collect();
    Ok(Attractors {
        check,
        ..described(model, &found, &set, (options, &budgets), sides, unstable)?
    })
}

/// Returns the options of the census; a smaller bound than the default has larger budgets.
fn budgets(model: &Model, options: &AttractorsOptions, start_box: &StartBox) -> CensusOptions {
    let default = CensusOptions::default();
    let (usual, periods, steps) = if model.nonlinear.is_some() {
        (NONLINEAR_UNSEEN, NONLINEAR_PERIODS, NONLINEAR_STEPS)
    } else {
        (default.unseen, default.max_periods, default.max_steps)
    };
    let unseen = options.unseen.unwrap_or(usual);
    let times = (usual / unseen).max(1.0);
    CensusOptions {
        classify: bounded(options, start_box),
        unseen,
        max_starts: ((times * default.max_starts as f64) as usize).min(MAX_STARTS),
        max_periods: (times * periods as f64) as usize,
        max_steps: (times * steps as f64) as u64,
        ..default
    }
}

/// The budgets of each start with a bound on the states that fits the box.
fn bounded(options: &AttractorsOptions, start_box: &StartBox) -> ClassifyOptions {
    let classify = ClassifyOptions::default();
    let widest = start_box
        .lower()
        .iter()
        .chain(start_box.upper())
        .fold(0.0, |m: f64, v| m.max(v.abs()));
    let bound = if widest > 0.0 {
        OUT_OF_BOUNDS * widest
    } else {
        classify.bound
    };
    ClassifyOptions {
        bound,
        max_steps: MAX_START_STEPS,
        max_period: options.max_period,
        ..classify
    }
}

fn described(
    model: &Model,
    found: &Census,
    set: &StartSet,
    (options, budgets): (&AttractorsOptions, &CensusOptions),
    sides: Vec<Side>,
    unstable: Option<Vec<InSi<OrbitReport>>>,
) -> Result<Attractors, Error> {
    let starts = found.outcomes_by_start.len();
    let attractors: Vec<_> = found
        .attractors
        .iter()
        .map(|a| one(model, &a.kind, &a.state, a.fraction))
        .collect::<Result<_, _>>()?;
    let notes = attractors.iter().enumerate().filter_map(slow_note);
    let notes = notes.collect();
    let transient_chaos = found
        .transient_chaos
        .as_ref()
        .map(|t| TransientChaosReport {
            lyapunov: t
                .spectrum
                .iter()
                .flat_map(|s| s.exponents.clone())
                .collect(),
            lyapunov_errors: t.spectrum.iter().flat_map(|s| s.errors.clone()).collect(),
            lifetime: t.lifetime.mean,
            lifetime_interval: [t.lifetime.low, t.lifetime.high],
            escapes: t.lifetime.escapes,
            unescaped: t.unescaped.into(),
            destinations: t.destinations.clone(),
        });
    Ok(Attractors {
        starts,
        seed: options.seed,
        sides,
        attractors,
        sizes: found
            .by_size
            .iter()
            .map(|size| SizeReport {
                scale: size.scale,
                starts: size.starts,
                fractions: size.attractors.iter().map(|f| f.estimate).collect(),
            })
            .collect(),
        unseen: found.unseen.map(|unseen| UnseenReport {
            motions: unseen.motions,
            starts: unseen.starts,
            fraction: unseen.share,
            target: budgets.unseen,
        }),
        end: match found.end {
            _ if found.cancelled => EndReport::Cancelled,
            CensusEnd::AllStarts => EndReport::AllStarts,
            CensusEnd::BoundMet => EndReport::BoundMet,
            CensusEnd::MaxStarts => EndReport::MaxStarts {
                limit: budgets.max_starts,
            },
            CensusEnd::MaxPeriods => EndReport::MaxPeriods {
                limit: budgets.max_periods,
            },
            CensusEnd::MaxSteps => EndReport::MaxSteps {
                limit: budgets.max_steps,
            },
        },
        followed_at: found.followed_coarsely.then_some(coarse::TOLERANCE),
        undecided: found
            .undecided
            .iter()
            .map(|(k, reason)| UndecidedStart {
                start: *k,
                state: set.start(*k).unwrap_or_default(),
                reason: reason.to_string(),
            })
            .collect(),
        undecided_fraction: Fraction::new(found.undecided.len(), starts).into(),
        unbounded: found.unbounded.into(),
        transient_chaos,
        unstable,
        check: None,
        notes,
        cancelled: found.cancelled,
    })
}

/// A note about an attractor that no start can be seen to reach.
fn slow_note((index, attractor): (usize, &AttractorReport)) -> Option<String> {
    let orbit = attractor.orbit.as_ref()?;
    let decay = orbit.decay_periods.filter(|decay| *decay > SLOW_PERIODS)?;
    Some(format!(
        "neighbouring motions approach attractor {} over {decay:.1e} drive periods, longer than starts \
         are followed: the fraction that goes to it is not known",
        index + 1
    ))
}

fn one(
    model: &Model,
    kind: &AttractorKind,
    state: &[f64],
    fraction: Fraction,
) -> Result<AttractorReport, Error> {
    let non_periodic = || -> Result<Option<NonPeriodic>, Error> {
        let observables = measure(model, state, OBSERVED_PERIODS, ObservableSet::ALL)?;
        Ok(Some(NonPeriodic {
            period: None,
            state: state.to_vec(),
            observables,
        }))
    };
    let (classification, spectrum, evidence, orbit, non_periodic) = match kind {
        AttractorKind::Periodic(orbit) => {
            let evidence = orbit_evidence(orbit);
            (Classification::Periodic, None, evidence, Some(orbit), None)
        }
        AttractorKind::QuasiPeriodic(torus) => (
            Classification::QuasiPeriodic,
            Some(&torus.spectrum),
            torus_evidence(torus),
            None,
            non_periodic()?,
        ),
        AttractorKind::Chaotic { spectrum, lifetime } => {
            let evidence = format!(
                "{}; none of {} starts escaped in {:.0} periods together (mean lifetime above {:.0} at 95 %)",
                largest_exponent(spectrum),
                fraction.count,
                lifetime.exposure,
                lifetime.low
            );
            (
                Classification::Chaotic,
                Some(spectrum),
                evidence,
                None,
                non_periodic()?,
            )
        }
    };
    Ok(AttractorReport {
        classification,
        share: fraction.into(),
        lyapunov: spectrum.map_or_else(
            || orbit.map_or_else(Vec::new, orbit_exponents),
            |s| s.exponents.clone(),
        ),
        lyapunov_errors: spectrum.map(|s| s.errors.clone()),
        evidence,
        orbit: orbit.map(|o| report(model, o, HARMONICS)).transpose()?,
        non_periodic,
        physical: None,
    })
}

/// Lyapunov exponents of an orbit: log|μ| a drive period.
pub fn orbit_exponents(orbit: &PeriodicOrbit) -> Vec<f64> {
    orbit
        .multipliers
        .iter()
        .map(|m| nanotap_arithmetic::ln(m.modulus()) / orbit.period as f64)
        .collect()
}

/// Starts from which unstable orbits are looked for.
const SEARCHED_STARTS: usize = 64;

/// The orbits of period 1 with one unstable multiplier that Newton's method finds from averaging and
/// from some initial states: the boundaries between basins pass through them.
///
/// # Errors
/// When the initial states make no sense for the model.
pub fn saddles(model: &Model, control: &Control<'_>) -> Result<Vec<PeriodicOrbit>, Error> {
    let set = default_starts(model, AttractorsOptions::default().seed)?;
    let mut searched: Vec<Vec<f64>> = averaged_orbits(model)
        .into_iter()
        .flat_map(|orbit| orbit.states)
        .collect();
    searched.extend((0..SEARCHED_STARTS).map_while(|k| set.start(k)));
    let search = OrbitSearch {
        max_period: 1,
        ..OrbitSearch::default()
    };
    let mut found = find_orbits(&ModelMap::new(model), &searched, &search, control);
    found.retain(is_saddle);
    Ok(found)
}

/// True of an orbit with one unstable multiplier.
pub fn is_saddle(orbit: &PeriodicOrbit) -> bool {
    let unstable_dimension = 1;
    orbit.stability == Stability::Unstable { unstable_dimension }
}

fn unstable_orbits(
    model: &Model,
    map: &ModelMap,
    searched: &[Vec<f64>],
    options: &AttractorsOptions,
    control: &Control<'_>,
) -> Result<Vec<InSi<OrbitReport>>, Error> {
    let search = OrbitSearch {
        max_period: options.unstable,
        ..OrbitSearch::default()
    };
    find_orbits(map, searched, &search, control)
        .iter()
        .filter(|orbit| !orbit.is_stable())
        .map(|orbit| {
            Ok(InSi {
                motion: report(model, orbit, HARMONICS)?,
                physical: None,
            })
        })
        .collect()
}

options! {
    /// Options of a census.
    pub struct AttractorsOptions {
        /// Number of initial states, spread evenly over one box. Default: initial states at all
        /// amplitudes, from the resonant response down to below the gap, until the share that may
        /// lead to undiscovered motions is below {unseen}, or 5000 initial states or 2,000,000
        /// drive periods (600,000 under a nonlinear law) are reached. Under a nonlinear law an initial
        /// state is followed for at most 4 million steps of the approximate flow, and all together
        /// for 30 million, or 60 where chaos is watched; two evaluations of the force in the exact
        /// flow count as a step
        #[schemars(range(min = 1, max = MAX_STARTS), extend("x-value" = "S"))]
        pub starts: Option<usize> = None,
        /// Share of initial states that may lead to undiscovered motions, with 95 % confidence, at
        /// which sampling ends. Default: 0.01 under a nonlinear law and 0.002 under a
        /// piecewise-linear one; a smaller value raises the limits of {starts}, drive periods and
        /// steps in proportion
        #[schemars(range(min = 1e-5, max = 0.5), extend("x-value" = "PART"))]
        pub unseen: Option<f64> = None,
        /// Seed of the initial states; results do not depend on the number of threads
        #[schemars(extend("x-value" = "K"))]
        pub seed: u64 = 1,
        /// Sides of one box of initial states, as in a1=-1:1 or v2=-4:4; other sides follow from
        /// the linear response to the drive. 256 initial states unless {starts} is given
        #[serde(rename = "box")]
        #[schemars(extend("x-value" = "COORDINATE=LOW:HIGH"))]
        pub sides: Intervals = Intervals::default(),
        /// Longest period of orbits, in drive periods
        #[schemars(range(min = 1, max = MAX_PERIOD), extend("x-value" = "N"))]
        pub max_period: usize = ClassifyOptions::default().max_period,
        /// Also list unstable orbits up to this period
        #[schemars(range(min = 0, max = MAX_PERIOD), extend("x-value" = "N", "x-bare" = "4"))]
        pub unstable: usize = 0,
        /// Follow this many of the initial states, chosen at random, again on the exact flow, and
        /// report those that go to another motion
        #[schemars(range(min = 0, max = MAX_STARTS), extend("x-value" = "K", "x-bare" = "32"))]
        pub check: usize = 0,
        /// Prove existence, local uniqueness and stability of each orbit by interval arithmetic
        pub prove: bool = false,
        /// Periods in drive periods and states at drive phase 0 of orbits that are known near the model, in
        /// addition to those from averaging: Newton closes them before any start is drawn.
        #[serde(skip)]
        pub seeds: Vec<(usize, Vec<f64>)> = Vec::new(),
    }
}

/// A census of the attractors.
#[derive(Clone, Copy, Debug)]
pub struct AttractorsStudy;

impl Study for AttractorsStudy {
    const NAME: &'static str = "attractors";
    const ABOUT: &'static str = "Find coexisting attractors by sampling initial states";
    const COUNTED: &'static str = "starts";
    const PARTIAL: bool = true;
    type Options = AttractorsOptions;
    type Report = Attractors;

    fn frames<'a>(case: &Case, report: &'a Attractors) -> Vec<Frame<'a>> {
        let (names, units) = (entry_names(case), case.units());
        vec![
            report.state_table(names, units),
            report.attractor_table(units),
            report.unstable_table(units),
        ]
    }

    fn figure(case: &Case, report: &Attractors) -> Option<Figure> {
        Some(attractors_figure(
            &case.model().ok()?,
            report,
            &case.units(),
        ))
    }

    fn remarks(_: &Case, report: &Attractors) -> Vec<Remark> {
        let mut remarks = Vec::new();
        for (k, attractor) in report.attractors.iter().enumerate() {
            let physical = attractor.physical.as_ref();
            let orbit = attractor.orbit.iter();
            let orbit = orbit.map(|orbit| (&orbit.observables, &*orbit.out_of_range));
            let other = attractor.non_periodic.iter();
            let other = other.map(|motion| (&motion.observables, &[][..]));
            let limits = orbit
                .chain(other)
                .flat_map(|(observables, beyond)| limits_of(observables, physical, beyond));
            remarks.extend(limits.map(|remark| Remark {
                text: format!("attractor {}: {}", k + 1, remark.text),
                ..remark
            }));
        }
        remarks.extend(Remark::notes(&report.notes));
        remarks
    }

    fn compute(
        case: &Case,
        options: &AttractorsOptions,
        control: &Control<'_>,
    ) -> Result<Attractors, Error> {
        let model = case.model()?;
        // A piecewise-linear census takes less time than the approach.
        let known = match model.nonlinear {
            Some(_) => states_near(case, options.max_period, control)?,
            None => Vec::new(),
        };
        let seeds = known.into_iter().filter_map(|orbit| {
            let state = orbit.states.into_iter().next()?;
            Some((orbit.period, state))
        });
        let options = AttractorsOptions {
            seeds: seeds.collect(),
            sides: Intervals::from_iter(options.sides.of_entries(&case.units())?),
            ..options.clone()
        };
        let mut found = attractors(&model, &options, control)?;
        if options.prove {
            found.prove(case);
        }
        Ok(match case.physical() {
            Some(resolved) => found.in_si(resolved),
            None => found,
        })
    }
}
