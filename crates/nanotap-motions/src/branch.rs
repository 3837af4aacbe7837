//! Branches of periodic orbits in one parameter, stable and unstable, with their
//! bifurcations, and the loci of these in two parameters.

use nanotap_dynamics::{
    AttractorContinuationOptions, AttractorKind, Bifurcation, BifurcationKind, Branch, BranchEnd,
    BranchPoint, CensusOptions, ClassifyOptions, ContinuationError, ContinuationOptions,
    ContinuedAttractor, Control, Criticality, CurveOptions, Diagram, DiagramBranch, DiagramOptions,
    Direction, LyapunovOptions, PeriodicOrbit, ShootingOptions, StartSet, assemble_diagram,
    continue_attractors, continue_orbit, trace_curve,
};
use nanotap_figures::Figure;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::event::{Event, EventReport, Window, along};
use crate::figure::branch::case_figure;
use crate::orbit::{OrbitOptions, orbit, pairs, spectral_radius};
use crate::simulate::Classification;
use nanotap_case::state::WrittenState;
use nanotap_case::{Case, Held, Key, ParameterUnit, PlaneFamily};
use nanotap_error::Error;
use nanotap_error::ErrorKind;
use nanotap_model::Model;
use nanotap_model::model_map::ModelMap;
use nanotap_model::recording::Recording;
use nanotap_observe::frame::Frame;
use nanotap_observe::time_series::entry_names;
use nanotap_observe::{ObservableSet, Observables, PhysicalMotion, measure};
use nanotap_study::Study;
use nanotap_study::limits::{MAX_DOUBLINGS, MAX_PERIOD, MAX_SEED_STARTS};
use nanotap_study::request::options;
use nanotap_study::start_box::default_starts;
use nanotap_study::target::Targets;
use nanotap_study::value::{Amount, Interval, values};

/// A parameter and its range, in the unit of its key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Key of the parameter that varies.
    pub key: Key,
    /// Value at the start of the range, in the unit of the key.
    pub from: f64,
    /// Value at the other end of the range, in the unit of the key; less than `from` or greater.
    pub to: f64,
}

impl Range {
    fn check(self, case: &Case) -> Result<(), Error> {
        let Self { key, from, to } = self;
        if !(from.is_finite() && to.is_finite() && from != to) {
            return Err(Error::input(
                format!(
                    "{} cannot be followed from {} to {}: two different, finite values are needed",
                    key.path(),
                    case.shown(key, from),
                    case.shown(key, to),
                ),
                "change {from} or {to}",
            ));
        }
        [from, to]
            .into_iter()
            .try_for_each(|value| self.model(case, value).map(drop))
    }

    fn model(self, case: &Case, value: f64) -> Result<Model, Error> {
        case.with(self.key, value).model().map_err(|error| {
            Error::input(
                format!("at {}: {error}", case.named(self.key, value)),
                "keep {from}, {to} and {second} where the model makes sense",
            )
        })
    }

    fn continuation(self, options: &BranchOptions) -> ContinuationOptions {
        let over = ContinuationOptions::over(self.from, self.to);
        ContinuationOptions {
            max_step: options.max_step,
            initial_step: over.initial_step.min(options.max_step),
            max_points: options.max_points,
            grazings: options.grazings,
            max_multiplier: options.max_multiplier,
            ..over
        }
    }

    fn diagram(self, options: &BranchOptions) -> DiagramOptions {
        DiagramOptions {
            continuation: self.continuation(options),
            doublings: options.doublings(),
            stable_doublings: options.stable_doublings,
            max_branches: MAX_BRANCHES,
        }
    }
}

/// Points after which a branch is cut.
const MAX_POINTS: usize = 20_000;
/// Branches after which no more are followed.
const MAX_BRANCHES: usize = 64;

/// Branches with their points and bifurcations.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct BranchReport {
    /// Path of the parameter's key in a case file.
    pub parameter: &'static str,
    /// Value of the parameter at the start of the range, in the unit of its key.
    pub from: f64,
    /// Value of the parameter at the other end of the range, in the unit of its key.
    pub to: f64,
    /// Branches of periodic orbits; points and bifurcations state their index in this list.
    pub branches: Vec<BranchSummary>,
    /// Points, branch by branch, in order of arc length.
    pub points: Vec<PointReport>,
    /// Number of omitted points between these.
    pub points_left_out: usize,
    /// Bifurcations and grazings located on the branches.
    pub bifurcations: Vec<BifurcationReport>,
    /// Orbits of the branches at which the requested events happen.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub events: Vec<EventReport>,
    /// With `diagram`: the attractors of the census at each value, in the order of the values.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub attractors: Vec<AttractorShare>,
    /// Bifurcation curves in two parameters, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loci: Option<Loci>,
    /// Orbits, branches and curves that could not be followed, with the reason.
    pub failures: Vec<FailureReport>,
    /// Quantities that stay constant while the parameter varies although the case does not state
    /// them, in SI.
    #[serde(skip_serializing_if = "Held::is_empty")]
    pub held: Held,
    /// Whether the work was stopped before it was done.
    pub cancelled: bool,
    /// Observables that were recorded.
    #[serde(skip)]
    pub observed: ObservableSet,
    /// Key of the parameter, for figures; not in documents.
    #[serde(skip)]
    pub key: Key,
    /// For a physical case, the factor from values of the parameter to SI.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter_unit: Option<ParameterUnit>,
}

impl BranchReport {
    /// Keeps the first and the last point of each branch and every `step`-th from the first.
    pub fn thin(&mut self, step: usize) {
        let all = self.points.len();
        let keeps: Vec<bool> = self
            .points
            .chunk_by(|a, b| a.branch == b.branch)
            .flat_map(|own| (0..own.len()).map(|k| k % step.max(1) == 0 || k + 1 == own.len()))
            .collect();
        let mut keeps = keeps.into_iter();
        self.points.retain(|_| keeps.next().unwrap_or(true));
        self.points_left_out += all - self.points.len();
    }
}

/// Summary of one branch of periodic orbits.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct BranchSummary {
    /// Period of the orbits on the branch, in drive periods.
    pub period: usize,
    /// Index of the branch from which it emerges at a flip.
    pub parent: Option<usize>,
    /// Number of period doublings from a seed.
    pub depth: usize,
    /// Number of points computed on the branch.
    pub points: usize,
    /// Least and greatest value of the parameter on the branch, in the unit of its key.
    pub range: [f64; 2],
    /// Reason why the branch ends, in words.
    pub end: String,
    /// Whether the branch was followed to its end: out of the range, into another branch, or to
    /// where the motion ceases to exist.
    pub complete: bool,
}

/// One orbit of a branch.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PointReport {
    /// Index of the branch on which the orbit lies, from 0.
    pub branch: usize,
    /// Minimal period in drive periods.
    pub period: usize,
    /// Value of the parameter, in the unit of its key.
    pub parameter: f64,
    /// The same in SI, for a number of the equations of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter_si: Option<f64>,
    /// State at drive phase 0, in the model's units. Its entries are a_1 … a_N (or x), their rates,
    /// then any memory of the sample.
    pub state: Vec<f64>,
    /// Floquet multipliers, real and imaginary part, largest modulus first.
    pub multipliers: Vec<[f64; 2]>,
    /// Whether every multiplier is inside the unit circle.
    pub stable: bool,
    /// Observables in the model's units.
    #[serde(flatten)]
    pub observables: Observables,
    /// The same in SI, where the parameter is a quantity of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<PhysicalMotion>,
}

/// A bifurcation or grazing of the orbits of a branch.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct BifurcationReport {
    /// fold, flip, neimark-sacker, grazing or crossing.
    pub kind: &'static str,
    /// Index of the branch on which it was located, from 0.
    pub branch: usize,
    /// Period of the bifurcating orbit, in drive periods.
    pub period: usize,
    /// Value of the parameter at the bifurcation, in the unit of its key.
    pub parameter: f64,
    /// The same in SI, for a number of the equations of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter_si: Option<f64>,
    /// Width of the final bracket of the parameter, in the unit of its key.
    pub uncertainty: f64,
    /// State of the orbit at drive phase 0, in the model's units. Its entries are a_1 … a_N (or x),
    /// their rates, then any memory of the sample.
    pub state: Vec<f64>,
    /// Floquet multipliers of the orbit, real and imaginary part, largest modulus first.
    pub multipliers: Vec<[f64; 2]>,
    /// supercritical where the new motion of a flip or Neimark–Sacker point appears on the unstable
    /// side of the orbit, subcritical where it is unstable; absent for other kinds, and where it is
    /// not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub criticality: Option<&'static str>,
    /// Angle of the multiplier pair at a Neimark–Sacker point, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "degree"))]
    pub angle: Option<f64>,
    /// Time of a grazing, in drive periods from the state.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// Observables in the model's units.
    #[serde(flatten)]
    pub observables: Observables,
    /// The same in SI, where the parameter is a quantity of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<PhysicalMotion>,
}

/// An attractor at one value of the parameter.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AttractorShare {
    /// Number of the attractor. One that Newton's method continues from value to value keeps its
    /// number; a chaotic one and a torus have another at every value.
    pub attractor: usize,
    /// Value of the parameter, in the unit of its key.
    pub parameter: f64,
    /// Class of the motion: `periodic`, `quasi-periodic` or `chaotic`.
    pub classification: &'static str,
    /// Period of the orbit in drive periods; 0 if the motion is not periodic.
    pub period: usize,
    /// Share of the initial states that reach the attractor, 0 to 1.
    pub share: f64,
    /// Lower end of the 95 % confidence interval of the share, 0 to 1.
    pub share_low: f64,
    /// Upper end of the 95 % confidence interval of the share, 0 to 1.
    pub share_high: f64,
    /// Whether no initial state reached it, but a neighbouring value leads to it.
    pub from_neighbour: bool,
}

/// Bifurcation curves in two parameters.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Loci {
    /// Path of the second parameter's key in a case file.
    pub second: &'static str,
    /// Least and greatest value of the second parameter, in the unit of its key.
    pub range: [f64; 2],
    /// Curves of bifurcations, and of events if any are requested.
    pub curves: Vec<CurveReport>,
    /// The second parameter, for figures.
    #[serde(skip)]
    pub key: Key,
}

/// Curve of a bifurcation or of an event in the plane of two parameters.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct CurveReport {
    /// fold, flip, neimark-sacker, grazing, crossing or event.
    pub kind: &'static str,
    /// The event, as it was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub event: Option<String>,
    /// Period of the orbits on the curve, in drive periods.
    pub period: usize,
    /// Values of the first parameter along the curve, point by point, in the unit of its key.
    pub first: Vec<f64>,
    /// Values of the second parameter along the curve, one for each of `first`, in the unit of its
    /// key.
    pub second: Vec<f64>,
    /// Reasons of its ends, at the first and last point.
    pub ends: [String; 2],
    /// What the curve meets at its first and last point: grazing, codimension two, or cut where it
    /// could not be followed; nothing at the edge of the window.
    pub meets: [Option<&'static str>; 2],
}

/// An orbit or branch that could not be followed.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FailureReport {
    /// Value of the parameter where following failed, in the unit of its key.
    pub parameter: f64,
    /// Reason of the failure, in words.
    pub reason: String,
}

/// The word for a kind of bifurcation.
pub const fn kind_name(kind: BifurcationKind) -> &'static str {
    match kind {
        BifurcationKind::Fold => "fold",
        BifurcationKind::Crossing => "crossing",
        BifurcationKind::Flip => "flip",
        BifurcationKind::NeimarkSacker { .. } => "neimark-sacker",
        BifurcationKind::Grazing { .. } => "grazing",
    }
}

/// Branches on which given orbits lie, as these come: see [`branches_through`].
pub(crate) struct BranchesThrough<'a> {
    case: &'a Case,
    range: Range,
    options: &'a BranchOptions,
    diagram: Diagram,
    /// Orbits given so far, each with its value of the parameter.
    given: Vec<(f64, PeriodicOrbit)>,
}

impl<'a> BranchesThrough<'a> {
    /// No branches yet.
    ///
    /// # Errors
    /// As [`branch`].
    pub(crate) fn new(
        case: &'a Case,
        range: Range,
        options: &'a BranchOptions,
    ) -> Result<Self, Error> {
        range.check(case)?;
        options.check_step()?;
        Ok(Self {
            case,
            range,
            options,
            diagram: Diagram::default(),
            given: Vec::new(),
        })
    }

    /// Adds those through orbits, each with its value of the parameter.
    pub(crate) fn follow(
        &mut self,
        orbits: impl IntoIterator<Item = (f64, PeriodicOrbit)>,
        control: &Control<'_>,
    ) {
        let known = self.given.len();
        for (value, orbit) in orbits {
            let same =
                |(at, other): &(f64, PeriodicOrbit)| *at == value && other.is_same_as(&orbit);
            if !self.given.iter().any(same) {
                self.given.push((value, orbit));
            }
        }
        let family = self.case.family(self.range.key);
        let how = self.range.diagram(self.options);
        let new = &self.given[known..];
        self.diagram.extend(&family, new, &how, control);
    }

    /// Whether no orbit was given.
    pub(crate) const fn is_empty(&self) -> bool {
        self.given.is_empty()
    }

    /// Reports the branches with their points and bifurcations.
    pub(crate) fn report(self, control: &Control<'_>) -> BranchReport {
        BranchReport {
            cancelled: control.is_cancelled(),
            ..described(
                self.case,
                self.range,
                self.options.observables,
                &self.diagram,
            )
        }
    }
}

/// Follows the branches on which given orbits lie, each with its value of the parameter, both ways
/// over the whole range. Of the options only the step, the doublings and the largest multiplier
/// matter.
///
/// # Errors
/// As [`branch`].
pub fn branches_through(
    case: &Case,
    range: Range,
    seeds: &[(f64, PeriodicOrbit)],
    options: &BranchOptions,
    control: &Control<'_>,
) -> Result<BranchReport, Error> {
    let mut branches = BranchesThrough::new(case, range, options)?;
    branches.follow(seeds.iter().cloned(), control);
    Ok(branches.report(control))
}

/// Follows branches of `case`.
///
/// ```
/// use nanotap::case::{Case, Key};
/// use nanotap::control::Control;
/// use nanotap::model::cantilever::Cantilever;
/// use nanotap::study::branch::{BranchOptions, branch};
///
/// let case = Case::from(Cantilever { omega: 3.2, ..Cantilever::paper() });
/// let options = BranchOptions { period: Some(1), ..BranchOptions::over(Key::Omega, 3.2, 2.4) };
/// let report = branch(&case, &options, &Control::default())?;
/// let flips = report.bifurcations.iter().filter(|one| one.kind == "flip");
/// let flips: Vec<f64> = flips.map(|one| one.parameter).collect();
/// // The period doubles between these frequencies (docs/tutorials/dynamicist.md).
/// assert!((flips[0] - 2.913722).abs() < 1e-4 && (flips[1] - 2.505041).abs() < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the options are invalid for the case, or no orbit is found.
pub fn branch(
    case: &Case,
    options: &BranchOptions,
    control: &Control<'_>,
) -> Result<BranchReport, Error> {
    let range = options.range(case)?;
    let second = options.second_range(case)?;
    range.check(case)?;
    if let Some(second) = second {
        second.check(case)?;
    }
    options.check_step()?;
    if second.is_some_and(|second| second.key == range.key) {
        return Err(Error::input(
            format!(
                "the second parameter must be another than {}",
                range.key.path()
            ),
            "change {second} or {parameter}",
        ));
    }
    let events: Vec<Event> = (options.event.0.iter())
        .map(|text| Event::parse(text, case))
        .collect::<Result<_, _>>()?;
    let family = case.family(range.key);
    let (seeds, attractors) = if options.diagram {
        census_seeds(case, range, options, control)?
    } else {
        let first = first_orbit(case, range, options)?;
        (vec![(range.from, first)], Vec::new())
    };
    let diagram = if options.doublings() == 0 && !options.diagram {
        let direction = if range.to > range.from {
            Direction::Increasing
        } else {
            Direction::Decreasing
        };
        let (parameter, orbit) = &seeds[0];
        let branch = continue_orbit(
            &family,
            *parameter,
            orbit,
            direction,
            &range.continuation(options),
            control,
        )
        .map_err(|error| no_branch(case, range.key, error))?;
        Diagram {
            branches: vec![DiagramBranch {
                branch,
                parent: None,
                depth: 0,
            }],
            failures: Vec::new(),
        }
    } else {
        assemble_diagram(&family, &seeds, &range.diagram(options), control)
    };
    let mut report = described(case, range, options.observables, &diagram);
    if let Some(second) = second {
        report.loci = Some(loci(
            case,
            range,
            &diagram,
            second,
            &mut report.failures,
            control,
        ));
    }
    report.attractors = attractors;
    for event in &events {
        let found = events_of(case, range.key, &report, event, control);
        if let (Some(second), Some(loci)) = (second, &mut report.loci) {
            let ordered = |range: Range| [range.from.min(range.to), range.from.max(range.to)];
            let window = Window {
                case,
                keys: [range.key, second.key],
                ranges: [ordered(range), loci.range],
            };
            let curves = found.iter().filter_map(|report| {
                let point = &report.point;
                let here = case.with(range.key, point.parameter).get(second.key);
                let start = [point.parameter, here];
                window.curve(start, (&point.state, point.period), event, control)
            });
            for curve in curves {
                if !loci
                    .curves
                    .iter()
                    .any(|known| is_on(known, &curve, &window))
                {
                    loci.curves.push(curve);
                }
            }
        }
        report.events.extend(found);
    }
    report.cancelled = control.is_cancelled();
    report.parameter_unit = case.parameter_unit(range.key);
    Ok(report)
}

fn first_orbit(case: &Case, range: Range, options: &BranchOptions) -> Result<PeriodicOrbit, Error> {
    let model = range.model(case, range.from)?;
    let options = OrbitOptions {
        period: options.period,
        state: case.state_of(options.state.as_ref())?,
        ..OrbitOptions::default()
    };
    let failed = |error: Error| {
        let message = format!(
            "at {}: {}",
            case.named(range.key, range.from),
            error.message()
        );
        match error.kind {
            ErrorKind::BadInput => Error::input(message, "change {state} or {period}"),
            kind => Error::new(kind, message).remedy(ELSEWHERE),
        }
    };
    let found = orbit(&model, &options).map_err(failed)?;
    // Newton again, from where it is, for the orbit itself.
    let closed = nanotap_dynamics::close_orbit_from_points(
        &mut ModelMap::new(&model),
        &found.states.concat(),
        found.period,
        &ShootingOptions::default(),
    )
    .map_err(|error| failed(error.into()))?;
    // Errors grow along a long one that sticks, and Newton's method comes to another orbit.
    let sticks = model.rigid_stop.is_some() && spectral_radius(&found.multipliers) == 0.0;
    let is_it = closed.period == found.period
        && closed.nearest(&found.state).1 <= SAME_STICKING * closed.scale();
    if sticks && !is_it {
        return Err(Error::numerics(format!(
            "at {}: the motion sticks to the rigid stop, and errors grow too fast along its period-{} orbit \
             to follow it",
            case.named(range.key, range.from),
            found.period
        ))
        .remedy("list the motions at several values with `sweep`, or give a {state} near another orbit"));
    }
    Ok(closed)
}

/// Largest distance between an orbit that sticks and the one that Newton's method closes from it, as a
/// part of its size.
const SAME_STICKING: f64 = 1e-6;
/// Remedy where the start has no orbit to follow.
const ELSEWHERE: &str = "begin elsewhere with {from}, or give a {state} near an orbit";

/// Orbits to be followed, each with its value of the parameter.
type Seeds = Vec<(f64, PeriodicOrbit)>;

/// Stable orbits at several values of the parameter: those of a census at each, and those
/// that the ones of the neighbouring values lead to, until no value gains another.
fn census_seeds(
    case: &Case,
    range: Range,
    options: &BranchOptions,
    control: &Control<'_>,
) -> Result<(Seeds, Vec<AttractorShare>), Error> {
    let steps = options.values.max(2) - 1;
    let values: Vec<f64> = (0..=steps)
        .map(|k| k as f64 / steps as f64)
        .map(|t| range.from * (1.0 - t) + range.to * t)
        .collect();
    // Where there is no model there is no map, and no starts are needed.
    let starts = |k: usize, _: &ModelMap| {
        let model = range.model(case, values[k]).ok();
        let drawn = model.and_then(|model| default_starts(&model, options.seed).ok());
        drawn.unwrap_or_else(|| StartSet::given(Vec::new()))
    };
    let classify = ClassifyOptions::default();
    let how = AttractorContinuationOptions {
        census: CensusOptions {
            pilots: options.starts,
            max_starts: options.starts,
            max_periods: SEED_PERIODS * options.starts,
            classify: ClassifyOptions {
                max_period: SEED_MAX_PERIOD,
                lyapunov: LyapunovOptions {
                    max_periods: SEED_PERIODS,
                    ..classify.lyapunov
                },
                ..classify
            },
            ..CensusOptions::default()
        },
    };
    let family = case.family(range.key);
    let known = continue_attractors(&family, &values, starts, &how, control);
    let mut found = Vec::new();
    let mut shares = Vec::new();
    for (value, at) in values.iter().zip(known) {
        for each in at.attractors {
            shares.push(share(*value, &each));
            if let AttractorKind::Periodic(orbit) = each.attractor.kind {
                found.push((*value, orbit));
            }
        }
    }
    if found.is_empty() && !control.is_cancelled() {
        return Err(Error::numerics(format!(
            "no stable orbit was found at any of {} values of {}, so there is nothing to follow",
            values.len(),
            range.key.path()
        ))
        .remedy(ELSEWHERE));
    }
    Ok((found, shares))
}

/// Finds the orbits at which an event happens on the branches of a report.
fn events_of(
    case: &Case,
    key: Key,
    report: &BranchReport,
    event: &Event,
    control: &Control<'_>,
) -> Vec<EventReport> {
    let measured = Measured {
        case,
        range: Range {
            key,
            from: report.from,
            to: report.to,
        },
        observables: ObservableSet::COMMON,
    };
    along(case, key, &report.points, event, control)
        .into_par_iter()
        .filter_map(|(branch, parameter, orbit)| {
            let point = measured.orbit(branch, parameter, &orbit).ok()?;
            let event = event.to_string();
            Some(EventReport { event, point })
        })
        .collect()
}

/// Whether a curve of an event begins on one that is known.
fn is_on(known: &CurveReport, curve: &CurveReport, window: &Window<'_>) -> bool {
    let near = 1e-6 * (window.ranges[0][1] - window.ranges[0][0]);
    let middle = curve.first.len() / 2;
    known.event == curve.event
        && known.period == curve.period
        && crossings(known, curve.second[middle])
            .any(|at| (at - curve.first[middle]).abs() <= 1e3 * near)
}

fn share(parameter: f64, found: &ContinuedAttractor) -> AttractorShare {
    let of = &found.attractor;
    let (classification, period) = match &of.kind {
        AttractorKind::Periodic(orbit) => (Classification::Periodic, orbit.period),
        AttractorKind::QuasiPeriodic(_) => (Classification::QuasiPeriodic, 0),
        AttractorKind::Chaotic { .. } => (Classification::Chaotic, 0),
    };
    AttractorShare {
        attractor: found.branch,
        parameter,
        classification: classification.name(),
        period,
        share: of.fraction.estimate,
        share_low: of.fraction.low,
        share_high: of.fraction.high,
        from_neighbour: found.found_from.is_some(),
    }
}

fn described(
    case: &Case,
    range: Range,
    observables: ObservableSet,
    diagram: &Diagram,
) -> BranchReport {
    // Branches that were followed are measured, also of work that was cancelled.
    let case = &case.with_grace();
    let key = range.key;
    let measured = Measured {
        case,
        range,
        observables,
    };
    let mut report = BranchReport {
        parameter: key.path(),
        from: range.from,
        to: range.to,
        branches: Vec::new(),
        points: Vec::new(),
        points_left_out: 0,
        bifurcations: Vec::new(),
        events: Vec::new(),
        attractors: Vec::new(),
        loci: None,
        failures: diagram
            .failures
            .iter()
            .map(|(parameter, reason)| FailureReport {
                parameter: *parameter,
                reason: reason.clone(),
            })
            .collect(),
        held: case.held(&[key]),
        cancelled: false,
        observed: observables,
        key,
        parameter_unit: None,
    };
    let end = |branch: &Branch| end_of(case, key, branch);
    // A seed at an end of the range has nothing on one side, and a branch that was followed
    // from both of its ends is one.
    let branches = &diagram.branches;
    let kept: Vec<usize> = (0..branches.len())
        .filter(|&k| branches[k].branch.points.len() > 1)
        .filter(|&k| {
            let span = (range.to - range.from).abs();
            !(0..k).any(|earlier| are_one(&branches[earlier].branch, &branches[k].branch, span))
        })
        .collect();
    for (index, &k) in kept.iter().enumerate() {
        let DiagramBranch {
            branch,
            parent,
            depth,
        } = &diagram.branches[k];
        let parent = parent.and_then(|p| kept.iter().position(|&k| k == p));
        report
            .branches
            .push(summary(branch, parent, *depth, end(branch)));
        let failures = &mut report.failures;
        let points = measured.all(&branch.points, failures, |p| {
            (p.parameter, "point", measured.point(index, p))
        });
        report.points.extend(points);
        let bifurcations = measured.all(&branch.bifurcations, failures, |b| {
            let found = measured.bifurcation(index, b);
            (b.parameter, kind_name(b.kind), found)
        });
        report.bifurcations.extend(bifurcations);
        // What the user stopped is no failure of the branch.
        let stopped = matches!(branch.end, BranchEnd::Cancelled);
        if branch.end.is_failure() && !stopped {
            report.failures.push(FailureReport {
                parameter: branch.points.last().map_or(f64::NAN, |p| p.parameter),
                reason: format!(
                    "the period-{} branch was cut: {}",
                    branch.period,
                    end(branch)
                ),
            });
        }
    }
    report
}

/// The error of a branch that could not be started.
fn no_branch(case: &Case, key: Key, error: ContinuationError) -> Error {
    match error {
        ContinuationError::NoStart { parameter, reason } => Error::numerics(format!(
            "the corrector found no orbit at {}: {reason}",
            case.named(key, parameter)
        )),
        other => other.into(),
    }
}

/// Reason of a branch's end, in words.
fn end_of(case: &Case, key: Key, branch: &Branch) -> String {
    let shown = |value| case.shown(key, value);
    match branch.end {
        BranchEnd::StepTooSmall { parameter, .. } if hits_at_phase_0(case, key, branch) => format!(
            "an impact falls on drive phase 0 at {}, where the state at that phase jumps",
            shown(parameter)
        ),
        _ => branch.end.words(shown),
    }
}

/// Whether the last orbit of a branch hits a rigid stop just where a drive period begins.
fn hits_at_phase_0(case: &Case, key: Key, branch: &Branch) -> bool {
    /// Fraction of a drive period within which a hit counts as at its beginning.
    const JUST: f64 = 1e-6;
    let hits = || {
        let point = branch.points.last()?;
        let model = case.with(key, point.parameter).model().ok()?;
        let recording = Recording::of(&model, point.orbit.states.first()?, branch.period).ok()?;
        let mut hits = recording.impulses(&model).into_iter();
        Some(hits.any(|(time, _)| {
            let periods = time / model.period();
            (periods - periods.round()).abs() <= JUST
        }))
    };
    hits().unwrap_or(false)
}

/// Whether two branches pass through the same bifurcations, at least one.
fn are_one(a: &Branch, b: &Branch, span: f64) -> bool {
    let same = |x: &Bifurcation, y: &Bifurcation| {
        kind_name(x.kind) == kind_name(y.kind) && (x.parameter - y.parameter).abs() <= 1e-7 * span
    };
    let among = |x: &Branch, y: &Branch| {
        x.bifurcations
            .iter()
            .all(|p| y.bifurcations.iter().any(|q| same(p, q)))
    };
    a.period == b.period && !a.bifurcations.is_empty() && among(a, b) && among(b, a)
}

fn summary(branch: &Branch, parent: Option<usize>, depth: usize, end: String) -> BranchSummary {
    let parameters = || branch.points.iter().map(|p| p.parameter);
    BranchSummary {
        period: branch.period,
        parent,
        depth,
        points: branch.points.len(),
        range: [
            parameters().fold(f64::INFINITY, f64::min),
            parameters().fold(f64::NEG_INFINITY, f64::max),
        ],
        end,
        complete: !branch.end.is_failure(),
    }
}

/// Observables of the orbits of a branch.
struct Measured<'a> {
    case: &'a Case,
    range: Range,
    observables: ObservableSet,
}

impl Measured<'_> {
    /// The items of a branch that `one` measures, with the failures of the others: an orbit that
    /// grazes may be closed and yet not be measured.
    fn all<T: Sync, R: Send>(
        &self,
        items: &[T],
        failures: &mut Vec<FailureReport>,
        one: impl Fn(&T) -> (f64, &'static str, Result<R, Error>) + Sync,
    ) -> Vec<R> {
        let is_cancelled = || self.case.cancel().is_cancelled();
        let found: Vec<_> = items
            .par_iter()
            .with_max_len(1)
            .filter(|_| !is_cancelled())
            .map(&one)
            .collect();
        let mut all = Vec::with_capacity(found.len());
        for (parameter, what, found) in found {
            match found {
                Ok(found) => all.push(found),
                Err(_) if is_cancelled() => {}
                Err(error) => failures.push(FailureReport {
                    parameter,
                    reason: format!(
                        "the {what} is left out, its motion cannot be measured: {}",
                        error.message()
                    ),
                }),
            }
        }
        all
    }

    /// Observables in the model's units and, of a physical case, in SI.
    fn observables_at(
        &self,
        parameter: f64,
        orbit: &PeriodicOrbit,
    ) -> Result<(Observables, Option<PhysicalMotion>), Error> {
        let here = self.case.with(self.range.key, parameter);
        let model = self.range.model(self.case, parameter)?;
        let start = orbit.states.first().map_or(&[][..], Vec::as_slice);
        let observables = measure(&model, start, orbit.period, self.observables)?;
        let physical = here
            .physical()
            .map(|view| PhysicalMotion::of(&observables, view).with_state(start, view));
        Ok((observables, physical))
    }

    fn in_si(&self, parameter: f64) -> Option<f64> {
        let unit = self.case.parameter_unit(self.range.key)?;
        (!self.range.key.is_physical()).then_some(unit.si * parameter)
    }

    fn point(&self, branch: usize, p: &BranchPoint) -> Result<PointReport, Error> {
        self.orbit(branch, p.parameter, &p.orbit)
    }

    fn orbit(
        &self,
        branch: usize,
        parameter: f64,
        orbit: &PeriodicOrbit,
    ) -> Result<PointReport, Error> {
        let (observables, physical) = self.observables_at(parameter, orbit)?;
        Ok(PointReport {
            branch,
            period: orbit.period,
            parameter,
            parameter_si: self.in_si(parameter),
            state: orbit.states.first().cloned().unwrap_or_default(),
            multipliers: pairs(&orbit.multipliers),
            stable: orbit.is_stable(),
            observables,
            physical,
        })
    }

    fn bifurcation(&self, branch: usize, b: &Bifurcation) -> Result<BifurcationReport, Error> {
        let (observables, physical) = self.observables_at(b.parameter, &b.orbit)?;
        let (angle, time) = match b.kind {
            BifurcationKind::NeimarkSacker { angle } => (Some(angle.to_degrees()), None),
            BifurcationKind::Grazing { time } => (None, Some(time)),
            _ => (None, None),
        };
        Ok(BifurcationReport {
            kind: kind_name(b.kind),
            criticality: b.criticality.map(Criticality::name),
            branch,
            period: b.orbit.period,
            parameter: b.parameter,
            parameter_si: self.in_si(b.parameter),
            uncertainty: b.uncertainty,
            state: b.orbit.states.first().cloned().unwrap_or_default(),
            multipliers: pairs(&b.orbit.multipliers),
            angle,
            time,
            observables,
            physical,
        })
    }
}

/// Periods over which Lyapunov exponents are measured at most where seeds are looked for:
/// only what closes is followed.
const SEED_PERIODS: usize = 1000;
/// Longest period of the orbits from which branches start, in drive periods.
const SEED_MAX_PERIOD: usize = 16;
/// Largest number of points of each half of a bifurcation curve.
const LOCUS_POINTS: usize = 6000;

/// Curves of all bifurcations, each once: one that lies on a curve already traced is left.
fn loci(
    case: &Case,
    range: Range,
    diagram: &Diagram,
    second: Range,
    failures: &mut Vec<FailureReport>,
    control: &Control<'_>,
) -> Loci {
    let family = PlaneFamily {
        case: case.clone(),
        keys: [range.key, second.key],
    };
    // What the second key is where a bifurcation was found: another at each where it follows
    // from the first (the free amplitude from the frequency).
    let at = |b: &Bifurcation| case.with(range.key, b.parameter).get(second.key);
    let bifurcations = || diagram.branches.iter().flat_map(|b| &b.branch.bifurcations);
    let ordered = |range: Range| (range.from.min(range.to), range.from.max(range.to));
    let (first, key) = (ordered(range), second.key);
    // The values at which the bifurcations were found belong to the box.
    let second = bifurcations()
        .map(at)
        .fold(ordered(second), |(low, high), here| {
            (low.min(here), high.max(here))
        });
    let limits = CurveOptions {
        max_points: LOCUS_POINTS,
        ..CurveOptions::over(first, second)
    };
    let mut curves: Vec<CurveReport> = Vec::new();
    for b in bifurcations() {
        if control.is_cancelled() {
            break;
        }
        let here = at(b);
        let near = 1e-6 * (first.1 - first.0);
        let known = |c: &CurveReport| {
            c.kind == kind_name(b.kind)
                && c.period == b.orbit.period
                && crossings(c, here).any(|at| (at - b.parameter).abs() <= near)
        };
        if curves.iter().any(known) {
            continue;
        }
        match trace_curve(&family, b, here, &limits, control) {
            Ok(locus) => curves.push(CurveReport {
                kind: kind_name(locus.kind),
                event: None,
                period: b.orbit.period,
                first: locus.points.iter().map(|p| p.first).collect(),
                second: locus.points.iter().map(|p| p.second).collect(),
                meets: [0, 1].map(|k| locus.ends[k].meets()),
                ends: locus.ends.map(|end| end.to_string()),
            }),
            Err(_) if control.is_cancelled() => break,
            Err(error) => failures.push(FailureReport {
                parameter: b.parameter,
                reason: format!("the locus of its {}: {error}", kind_name(b.kind)),
            }),
        }
    }
    Loci {
        second: key.path(),
        range: [second.0, second.1],
        curves,
        key,
    }
}

/// Where a locus crosses a value of the second parameter.
fn crossings(curve: &CurveReport, second: f64) -> impl Iterator<Item = f64> {
    curve
        .first
        .windows(2)
        .zip(curve.second.windows(2))
        .filter_map(move |(x, y)| {
            if y[0] == second {
                return Some(x[0]);
            }
            let t = (second - y[0]) / (y[1] - y[0]);
            (0.0..=1.0).contains(&t).then(|| x[0] + t * (x[1] - x[0]))
        })
}

options! {
    /// Options of branches.
    pub struct BranchOptions {
        /// Parameter, by its name in the case file (omega, alpha4, gap …); for a physical case also
        /// a quantity (drive.frequency, gap.tip, sample.stiffness …)
        #[schemars(extend("x-value" = "KEY", "x-required" = true))]
        pub parameter: String = String::new(),
        /// Value of the parameter at the start; for a physical case also with a unit, as in "70
        /// kHz"
        #[schemars(extend("x-value" = "VALUE", "x-required" = true))]
        pub from: Amount = Amount::default(),
        /// Value of the parameter at the other end of the range
        #[schemars(extend("x-value" = "VALUE", "x-required" = true))]
        pub to: Amount = Amount::default(),
        /// Period of the orbit at the start; default: that of the motion to which a run converges
        #[schemars(range(min = 1, max = MAX_PERIOD), extend("x-value" = "N"))]
        pub period: Option<usize> = None,
        /// State near the orbit at the start: a1,…,aN,v1,…,vN, or some by name, as in
        /// tip=5nm; of a physical case in m and m/s, or with units
        #[schemars(extend("x-value" = "STATE"))]
        pub state: Option<WrittenState> = None,
        /// Also follow doubled branches at flips, up to this number of doublings
        #[schemars(range(min = 0, max = MAX_DOUBLINGS), extend("x-value" = "DEPTH", "x-bare" = "1"))]
        pub switch: Option<usize> = None,
        /// Find the branches of all attractors: stable orbits from a census at several values,
        /// followed in both directions and through two doublings (or {switch})
        pub diagram: bool = false,
        /// For {diagram}: number of parameter values with a census
        #[schemars(range(min = 2, max = 10_000), extend("x-value" = "K"))]
        pub values: usize = 65,
        /// For {diagram}: initial states at each value
        #[schemars(range(min = 1, max = MAX_SEED_STARTS), extend("x-value" = "S"))]
        pub starts: usize = 16,
        /// For {diagram}: seed of the initial states
        #[schemars(extend("x-value" = "K"))]
        pub seed: u64 = 1,
        /// Second parameter and its range, as in alpha4=5:40, for bifurcation curves in both
        #[schemars(extend("x-value" = "KEY=LOW:HIGH"))]
        pub second: Option<Interval> = None,
        /// An observable and its value, as in "F_max = 1 nN": where the orbits have it, and with
        /// {second} its curve in both parameters; may be repeated
        #[schemars(extend("x-value" = "OBSERVABLE=VALUE"))]
        pub event: Targets = Targets::default(),
        /// Longest step, as a fraction of the range
        #[schemars(range(min = 0.0, max = 1.0), extend("x-value" = "PART"))]
        pub max_step: f64 = 0.01,
        /// Observables of every orbit.
        #[serde(skip)]
        pub observables: ObservableSet = ObservableSet::COMMON,
        /// Whether doubled branches end at their first orbit that is not stable.
        #[serde(skip)]
        pub stable_doublings: bool = false,
        /// A branch is left where a disturbance grows by more than this in the orbit's period.
        #[serde(skip)]
        pub max_multiplier: f64 = ContinuationOptions::over(0.0, 1.0).max_multiplier,
        /// Points after which a branch is cut.
        #[serde(skip)]
        pub max_points: usize = MAX_POINTS,
        /// Whether grazings are located.
        #[serde(skip)]
        pub grazings: bool = true,
    }
}

impl BranchOptions {
    /// Default options for one parameter over a range, in the unit of the parameter.
    pub fn over(key: Key, from: f64, to: f64) -> Self {
        Self {
            parameter: key.path().to_owned(),
            from: Amount::of_key(key, from),
            to: Amount::of_key(key, to),
            ..Self::default()
        }
    }

    /// The parameter and its range.
    ///
    /// # Errors
    /// When the case has no such parameter, or a value is not valid for it.
    pub fn range(&self, case: &Case) -> Result<Range, Error> {
        let key = case.key(self.parameter.trim())?;
        let [from, to] = values(case, key, [("from", &self.from), ("to", &self.to)])?;
        Ok(Range { key, from, to })
    }

    /// The first value of the parameter as a `key=value` word, for a case that lacks the key.
    pub fn first_value(&self) -> String {
        format!("{}={}", self.parameter.trim(), self.from.text())
    }

    fn second_range(&self, case: &Case) -> Result<Option<Range>, Error> {
        let Some(second) = &self.second else {
            return Ok(None);
        };
        let key = case.key(&second.name)?;
        let ends = [("second", &second.low), ("second", &second.high)];
        let [from, to] = values(case, key, ends)?;
        Ok(Some(Range { key, from, to }))
    }

    /// Doublings to follow: 0 for the one branch alone.
    fn doublings(&self) -> usize {
        self.switch.unwrap_or(if self.diagram { 2 } else { 0 })
    }

    fn check_step(&self) -> Result<(), Error> {
        if self.max_step > 0.0 && self.max_step <= 1.0 {
            return Ok(());
        }
        Err(Error::input(
            format!(
                "expected a longest step between 0 and 1 of the range, got {}",
                self.max_step
            ),
            "give a {max_step} of 0.01",
        ))
    }
}

/// Branches of periodic orbits in a parameter.
#[derive(Clone, Copy, Debug)]
pub struct BranchStudy;

impl Study for BranchStudy {
    const NAME: &'static str = "branch";
    const ABOUT: &'static str =
        "Periodic orbits followed in a parameter, stable and unstable, with their bifurcations";
    const COUNTED: &'static str = "points";
    const PARTIAL: bool = true;
    type Options = BranchOptions;
    type Report = BranchReport;

    fn frames<'a>(case: &Case, report: &'a BranchReport) -> Vec<Frame<'a>> {
        let (names, units) = (entry_names(case), case.units());
        let second = report.loci.as_ref();
        let second = second.and_then(|loci| case.parameter_unit(loci.key));
        vec![
            report.point_table(names, units),
            report.branch_table(units),
            report.bifurcation_table(units),
            report.event_table(units),
            report.attractor_table(units),
            report.curve_table(second, units),
        ]
    }

    fn figure(case: &Case, report: &BranchReport) -> Option<Figure> {
        Some(case_figure(case, report, None))
    }

    fn compute(
        case: &Case,
        options: &BranchOptions,
        control: &Control<'_>,
    ) -> Result<BranchReport, Error> {
        branch(case, options, control)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap_model::cantilever::Cantilever;

    #[test]
    fn a_point_that_cannot_be_measured_does_not_take_the_others_with_it() {
        let case = Case::from(Cantilever::paper());
        let options = BranchOptions::over(Key::Omega, 3.0, 3.01);
        let range = options.range(&case).unwrap();
        let family = case.family(range.key);
        let seeds = [(3.0, first_orbit(&case, range, &options).unwrap())];
        let how = range.diagram(&options);
        let mut diagram = assemble_diagram(&family, &seeds, &how, &Control::default());
        let whole = described(&case, range, ObservableSet::COMMON, &diagram);
        assert!(whole.failures.is_empty() && whole.points.len() > 2);
        let branch = &mut diagram.branches[0].branch;
        branch.points[1].orbit.states[0][0] = f64::NAN;
        let parameter = branch.points[1].parameter;
        let rest = described(&case, range, ObservableSet::COMMON, &diagram);
        assert_eq!(rest.points.len(), whole.points.len() - 1);
        assert_eq!(rest.failures.len(), 1);
        assert_eq!(rest.failures[0].parameter.to_bits(), parameter.to_bits());
        assert!(rest.failures[0].reason.contains("point is left out"));
    }
}
