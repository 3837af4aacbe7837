//! Branches of periodic orbits in one parameter, stable and unstable, with their
//! bifurcations, and the loci of these in two parameters.

use nanotap_dynamics::{
    AttractorKind, Bifurcation, BifurcationKind, Branch, BranchEnd, BranchPoint, CensusOptions,
    ClassifyOptions, ContinuationError, ContinuationOptions, Control, CurveOptions, Diagram,
    DiagramBranch, DiagramOptions, Direction, GlobalOptions, LyapunovOptions, PeriodicOrbit,
    StartBoxError, StartSet, assemble_diagram, attractors_along, continue_orbit, trace_curve,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::case::{Case, CaseError, Key, ParameterUnit, PlaneFamily};
use crate::model::recording::Recording;
use crate::model::strobe::Strobe;
use crate::model::{Model, MotionError};
use crate::observe::{Observables, PhysicalMotion, Set, measure};
use crate::study::kind::Study;
use crate::study::limits::{MOST_DOUBLINGS, MOST_PERIOD, MOST_SEED_STARTS};
use crate::study::orbit::{OrbitError, OrbitOptions, orbit, pairs};
use crate::study::start_box::default_starts;
use crate::study::value::{Amount, Interval, key_and_ends};

/// How to follow.
#[derive(Clone, Debug, PartialEq)]
pub struct BranchOptions {
    /// The parameter.
    pub key: Key,
    /// Its value at the start.
    pub from: f64,
    /// The other end of its range.
    pub to: f64,
    /// Period of the orbit at the start; `None`: that of the motion where a run settles.
    pub period: Option<usize>,
    /// State near which the orbit at the start is looked for; `None`: where a run settles.
    pub state: Option<Vec<f64>>,
    /// Doublings to follow: 0 for the one branch alone.
    pub doublings: usize,
    /// Whether doubled branches end at their first orbit that is not stable.
    pub stable_doublings: bool,
    /// Seeds from a census instead of the one orbit at the start.
    pub census: Option<SeedOptions>,
    /// A second parameter and its range: loci of the bifurcations are traced in both.
    pub second: Option<(Key, f64, f64)>,
    /// Longest step, as a part of the range.
    pub max_step: f64,
    /// Points after which a branch is cut.
    pub max_points: usize,
    /// Whether grazings are located.
    pub grazings: bool,
    /// Branches after which no more are followed.
    pub max_branches: usize,
    /// A branch is left where a disturbance grows by more than this in the orbit's period.
    pub max_multiplier: f64,
    /// What is measured of every orbit.
    pub observables: Set,
}

/// A census at several parameter values.
#[derive(Clone, Debug, PartialEq)]
pub struct SeedOptions {
    /// Parameter values, evenly spaced over the range, its ends included.
    pub values: usize,
    /// Starts drawn at each, besides rest and the linear responses.
    pub starts: usize,
    /// Seed of the starts.
    pub seed: u64,
    /// Longest period.
    pub max_period: usize,
}

impl Default for SeedOptions {
    fn default() -> Self {
        Self {
            values: 65,
            starts: 16,
            seed: 1,
            max_period: 16,
        }
    }
}

impl BranchOptions {
    /// Defaults for one parameter over a range.
    pub fn over(key: Key, from: f64, to: f64) -> Self {
        let continuation = ContinuationOptions::over(from, to);
        Self {
            key,
            from,
            to,
            period: None,
            state: None,
            doublings: 0,
            stable_doublings: false,
            census: None,
            second: None,
            max_step: continuation.max_step,
            max_points: 20_000,
            grazings: true,
            max_branches: 64,
            max_multiplier: continuation.max_multiplier,
            observables: Set::COMMON,
        }
    }

    fn continuation(&self) -> ContinuationOptions {
        let over = ContinuationOptions::over(self.from, self.to);
        ContinuationOptions {
            max_step: self.max_step,
            initial_step: over.initial_step.min(self.max_step),
            max_points: self.max_points,
            grazings: self.grazings,
            max_multiplier: self.max_multiplier,
            ..over
        }
    }

    fn diagram(&self) -> DiagramOptions {
        DiagramOptions {
            continuation: self.continuation(),
            doublings: self.doublings,
            stable_doublings: self.stable_doublings,
            max_branches: self.max_branches,
        }
    }
}

/// Why there is no branch.
#[derive(Clone, Debug, thiserror::Error)]
pub enum BranchError {
    /// A range that is none.
    #[error(
        "{name} cannot be followed from {from} to {to}: two different, finite values are needed"
    )]
    Range {
        /// The parameter.
        name: &'static str,
        /// Its start.
        from: f64,
        /// Its end.
        to: f64,
    },
    /// A step that is none.
    #[error("a longest step of {given} is no part of the range: between 0 and 1 is needed")]
    Step {
        /// What was given.
        given: f64,
    },
    /// The case at a parameter value makes no sense.
    #[error("at {name} = {value}: {error}")]
    Model {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Why not.
        error: CaseError,
    },
    /// No orbit at the start.
    #[error("at {name} = {value}: {error}")]
    Start {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Why not.
        error: OrbitError,
    },
    /// A census found no periodic motion anywhere.
    #[error(
        "no stable orbit was found at any of {values} values of {name}, so there is nothing to follow"
    )]
    NoSeeds {
        /// The parameter.
        name: &'static str,
        /// Values tried.
        values: usize,
    },
    /// The second parameter is the first.
    #[error("the second parameter must be another than {name}")]
    SameParameter {
        /// The parameter.
        name: &'static str,
    },
    /// The default box makes no sense.
    #[error(transparent)]
    Box(#[from] StartBoxError),
    /// The branch could not be begun.
    #[error(transparent)]
    Continuation(#[from] ContinuationError),
    /// A point could not be followed once more.
    #[error(transparent)]
    Flow(#[from] MotionError),
}

/// Branches with their points and bifurcations.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct BranchReport {
    /// The parameter's key.
    pub parameter: &'static str,
    /// Its value at the start.
    pub from: f64,
    /// The other end of its range.
    pub to: f64,
    /// The branches.
    pub branches: Vec<BranchSummary>,
    /// Their points, branch by branch, in order along the arc.
    pub points: Vec<PointReport>,
    /// How many points between these are not listed.
    pub points_left_out: usize,
    /// Their bifurcations.
    pub bifurcations: Vec<BifurcationReport>,
    /// Loci in two parameters, if a second one was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loci: Option<Loci>,
    /// What could not be followed.
    pub failures: Vec<FailureReport>,
    /// Whether the work was stopped before it was done.
    pub cancelled: bool,
    /// The parameter, for figures.
    #[serde(skip)]
    pub key: Key,
    /// Of a physical case: what a value of the parameter is to be multiplied with for SI.
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

/// One branch.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct BranchSummary {
    /// Period of its orbits.
    pub period: usize,
    /// Index of the branch that it left at a flip.
    pub parent: Option<usize>,
    /// Doublings between it and a seed.
    pub depth: usize,
    /// Points.
    pub points: usize,
    /// Least and greatest parameter reached.
    pub range: [f64; 2],
    /// Why it ends.
    pub end: String,
    /// Whether it was followed to its end: out of the range, into another branch, or to
    /// where the motion ceases to be.
    pub complete: bool,
}

/// One orbit of a branch.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PointReport {
    /// Index of its branch.
    pub branch: usize,
    /// Period.
    pub period: usize,
    /// The parameter.
    pub parameter: f64,
    /// State at drive phase 0.
    pub state: Vec<f64>,
    /// Floquet multipliers, largest modulus first.
    pub multipliers: Vec<[f64; 2]>,
    /// Whether every multiplier is inside the unit circle.
    pub stable: bool,
    /// What it looks like.
    #[serde(flatten)]
    pub observables: Observables,
    /// The same in SI, where the parameter is a quantity of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<PhysicalMotion>,
}

/// A bifurcation.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct BifurcationReport {
    /// fold, flip, neimark-sacker, grazing or crossing.
    pub kind: &'static str,
    /// Index of its branch.
    pub branch: usize,
    /// Period of the orbit.
    pub period: usize,
    /// The parameter.
    pub parameter: f64,
    /// Width of the last bracket of the parameter.
    pub uncertainty: f64,
    /// State at drive phase 0.
    pub state: Vec<f64>,
    /// Floquet multipliers.
    pub multipliers: Vec<[f64; 2]>,
    /// Of a Neimark–Sacker point: angle of the pair in degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angle: Option<f64>,
    /// Of a grazing: when, in drive periods from the state.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// What it looks like.
    #[serde(flatten)]
    pub observables: Observables,
    /// The same in SI, where the parameter is a quantity of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<PhysicalMotion>,
}

/// Loci of bifurcations in two parameters.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Loci {
    /// The second parameter's key.
    pub second: &'static str,
    /// Its range.
    pub range: [f64; 2],
    /// The curves.
    pub curves: Vec<CurveReport>,
    /// The second parameter, for figures.
    #[serde(skip)]
    pub key: Key,
}

/// One locus.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct CurveReport {
    /// fold, flip, neimark-sacker, grazing or crossing.
    pub kind: &'static str,
    /// Period of the orbits on it.
    pub period: usize,
    /// The first parameter along it.
    pub first: Vec<f64>,
    /// The second parameter along it.
    pub second: Vec<f64>,
    /// Why it ends, at its first and last point.
    pub ends: [String; 2],
    /// What it meets at its first and last point: grazing, codimension two, or cut where it could
    /// not be followed; nothing at the edge of the window.
    pub meets: [Option<&'static str>; 2],
}

/// Something that could not be followed.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FailureReport {
    /// Where.
    pub parameter: f64,
    /// Why.
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
pub(in crate::study) struct BranchesThrough<'a> {
    case: &'a Case,
    options: &'a BranchOptions,
    diagram: Diagram,
    /// Those asked for so far.
    given: Vec<(f64, PeriodicOrbit)>,
}

impl<'a> BranchesThrough<'a> {
    /// No branches yet.
    ///
    /// # Errors
    /// As [`branch`].
    pub(in crate::study) fn new(
        case: &'a Case,
        options: &'a BranchOptions,
    ) -> Result<Self, BranchError> {
        check(case, options)?;
        Ok(Self {
            case,
            options,
            diagram: Diagram::default(),
            given: Vec::new(),
        })
    }

    /// Adds those through orbits, each with its value of the parameter.
    pub(in crate::study) fn follow(
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
        let family = self.case.family(self.options.key);
        let how = self.options.diagram();
        let new = &self.given[known..];
        self.diagram.extend(&family, new, &how, control);
    }

    /// Whether no orbit was given.
    pub(in crate::study) const fn is_empty(&self) -> bool {
        self.given.is_empty()
    }

    /// What was found.
    pub(in crate::study) fn report(self, control: &Control<'_>) -> BranchReport {
        BranchReport {
            cancelled: control.is_cancelled(),
            ..described(self.case, self.options, &self.diagram)
        }
    }
}

/// Follows the branches on which given orbits lie, each with its value of the parameter,
/// both ways over the whole range; `period`, `state` and `census` of the options do not
/// matter.
///
/// # Errors
/// As [`branch`].
pub fn branches_through(
    case: &Case,
    seeds: &[(f64, PeriodicOrbit)],
    options: &BranchOptions,
    control: &Control<'_>,
) -> Result<BranchReport, BranchError> {
    let mut branches = BranchesThrough::new(case, options)?;
    branches.follow(seeds.iter().cloned(), control);
    Ok(branches.report(control))
}

/// Follows branches of `case`.
///
/// # Errors
/// [`BranchError`] when the options make no sense or there is nothing to follow.
pub fn branch(
    case: &Case,
    options: &BranchOptions,
    control: &Control<'_>,
) -> Result<BranchReport, BranchError> {
    check(case, options)?;
    let family = case.family(options.key);
    let continuation = options.continuation();
    let seeds = match &options.census {
        Some(census) => census_seeds(case, options, census, control)?,
        None => vec![(options.from, first_orbit(case, options)?)],
    };
    let diagram = if options.doublings == 0 && options.census.is_none() {
        let direction = if options.to > options.from {
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
            &continuation,
            control,
        )?;
        Diagram {
            branches: vec![DiagramBranch {
                branch,
                parent: None,
                depth: 0,
            }],
            failures: Vec::new(),
        }
    } else {
        assemble_diagram(&family, &seeds, &options.diagram(), control)
    };
    let mut report = described(case, options, &diagram);
    if let Some((key, low, high)) = options.second {
        report.loci = Some(loci(
            case,
            options,
            &diagram,
            (key, low, high),
            &mut report.failures,
            control,
        ));
    }
    report.cancelled = control.is_cancelled();
    Ok(report)
}

fn check(case: &Case, options: &BranchOptions) -> Result<(), BranchError> {
    let ranges = [(options.key, options.from, options.to)];
    for (key, from, to) in ranges.into_iter().chain(options.second) {
        let name = key.path();
        if !(from.is_finite() && to.is_finite() && from != to) {
            return Err(BranchError::Range { name, from, to });
        }
        for value in [from, to] {
            case.with(key, value)
                .model()
                .map_err(|error| BranchError::Model { name, value, error })?;
        }
    }
    if !(options.max_step > 0.0 && options.max_step <= 1.0) {
        return Err(BranchError::Step {
            given: options.max_step,
        });
    }
    match options.second {
        Some((key, ..)) if key == options.key => {
            Err(BranchError::SameParameter { name: key.path() })
        }
        _ => Ok(()),
    }
}

fn model_at(case: &Case, key: Key, value: f64) -> Result<Model, BranchError> {
    let name = key.path();
    case.with(key, value)
        .model()
        .map_err(|error| BranchError::Model { name, value, error })
}

fn first_orbit(case: &Case, options: &BranchOptions) -> Result<PeriodicOrbit, BranchError> {
    let model = model_at(case, options.key, options.from)?;
    let wanted = OrbitOptions {
        period: options.period,
        state: options.state.clone(),
        ..OrbitOptions::default()
    };
    let failed = |error| BranchError::Start {
        name: options.key.path(),
        value: options.from,
        error,
    };
    let found = orbit(&model, &wanted).map_err(failed)?;
    // Newton again, from where it is, for the orbit itself.
    nanotap_dynamics::close_orbit_from_points(
        &mut Strobe::new(&model),
        &found.states.concat(),
        found.period,
        &wanted.shooting,
    )
    .map_err(|error| failed(error.into()))
}

/// Stable orbits at several values of the parameter: those of a census at each, and those
/// that the ones of the neighbouring values lead to, until no value gains another.
fn census_seeds(
    case: &Case,
    options: &BranchOptions,
    seeds: &SeedOptions,
    control: &Control<'_>,
) -> Result<Vec<(f64, PeriodicOrbit)>, BranchError> {
    let steps = seeds.values.max(2) - 1;
    let values: Vec<f64> = (0..=steps)
        .map(|k| k as f64 / steps as f64)
        .map(|t| options.from * (1.0 - t) + options.to * t)
        .collect();
    // Where there is no model there is no map, and nobody asks for starts.
    let starts = |k: usize, _: &Strobe| {
        let model = model_at(case, options.key, values[k]).ok();
        let drawn = model.and_then(|model| default_starts(&model, seeds.seed).ok());
        drawn.unwrap_or_else(|| StartSet::given(Vec::new()))
    };
    let classify = ClassifyOptions::default();
    let how = GlobalOptions {
        census: CensusOptions {
            pilots: seeds.starts,
            max_starts: seeds.starts,
            max_periods: SEED_PERIODS * seeds.starts,
            classify: ClassifyOptions {
                max_period: seeds.max_period,
                lyapunov: LyapunovOptions {
                    max_periods: SEED_PERIODS,
                    ..classify.lyapunov
                },
                ..classify
            },
            ..CensusOptions::default()
        },
    };
    let family = case.family(options.key);
    let known = attractors_along(&family, &values, starts, &how, control);
    let mut found = Vec::new();
    for (value, at) in values.iter().zip(known) {
        for each in at.attractors {
            if let AttractorKind::Periodic(orbit) = each.attractor.kind {
                found.push((*value, orbit));
            }
        }
    }
    if found.is_empty() && !control.is_cancelled() {
        return Err(BranchError::NoSeeds {
            name: options.key.path(),
            values: values.len(),
        });
    }
    Ok(found)
}

fn described(case: &Case, options: &BranchOptions, diagram: &Diagram) -> BranchReport {
    // Branches that were followed are measured, also of work that was cancelled.
    let case = &case.with_grace();
    let key = options.key;
    let mut report = BranchReport {
        parameter: key.path(),
        from: options.from,
        to: options.to,
        branches: Vec::new(),
        points: Vec::new(),
        points_left_out: 0,
        bifurcations: Vec::new(),
        loci: None,
        failures: diagram
            .failures
            .iter()
            .map(|(parameter, reason)| FailureReport {
                parameter: *parameter,
                reason: reason.clone(),
            })
            .collect(),
        cancelled: false,
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
            let span = (options.to - options.from).abs();
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
        // An orbit that grazes may be closed and yet not be measured: the rest stands.
        let unmeasured = |parameter, what: &str, error: &BranchError| FailureReport {
            parameter,
            reason: format!("the {what} is left out, its motion cannot be measured: {error}"),
        };
        let points: Vec<_> = (branch.points.par_iter())
            .with_max_len(1)
            .filter(|_| !case.cancel().is_cancelled())
            .map(|p| {
                point(case, options, index, p)
                    .map_err(|error| unmeasured(p.parameter, "point", &error))
            })
            .collect();
        for point in points {
            match point {
                Ok(point) => report.points.push(point),
                Err(_) if case.cancel().is_cancelled() => {}
                Err(failure) => report.failures.push(failure),
            }
        }
        let bifurcations: Vec<_> = (branch.bifurcations.par_iter())
            .with_max_len(1)
            .filter(|_| !case.cancel().is_cancelled())
            .map(|b| {
                bifurcation(case, options, index, b)
                    .map_err(|error| unmeasured(b.parameter, kind_name(b.kind), &error))
            })
            .collect();
        for bifurcation in bifurcations {
            match bifurcation {
                Ok(found) => report.bifurcations.push(found),
                Err(_) if case.cancel().is_cancelled() => {}
                Err(failure) => report.failures.push(failure),
            }
        }
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

/// Why a branch ends, in words.
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
    /// Part of a drive period.
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

/// Whether two branches pass through just the same bifurcations, of which there are some.
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

/// What an orbit looks like, in the model's units and, where physical quantities vary, in SI.
fn seen(
    case: &Case,
    options: &BranchOptions,
    parameter: f64,
    orbit: &PeriodicOrbit,
) -> Result<(Observables, Option<PhysicalMotion>), BranchError> {
    let here = case.with(options.key, parameter);
    let model = here.model().map_err(|error| BranchError::Model {
        name: options.key.path(),
        value: parameter,
        error,
    })?;
    let start = orbit.states.first().map_or(&[][..], Vec::as_slice);
    let observables = measure(&model, start, orbit.period, options.observables)?;
    let physical = here
        .physical()
        .map(|view| PhysicalMotion::of(&observables, view));
    Ok((observables, physical))
}

fn point(
    case: &Case,
    options: &BranchOptions,
    branch: usize,
    p: &BranchPoint,
) -> Result<PointReport, BranchError> {
    let (observables, physical) = seen(case, options, p.parameter, &p.orbit)?;
    Ok(PointReport {
        branch,
        period: p.orbit.period,
        parameter: p.parameter,
        state: p.orbit.states.first().cloned().unwrap_or_default(),
        multipliers: pairs(&p.orbit.multipliers),
        stable: p.orbit.is_stable(),
        observables,
        physical,
    })
}

fn bifurcation(
    case: &Case,
    options: &BranchOptions,
    branch: usize,
    b: &Bifurcation,
) -> Result<BifurcationReport, BranchError> {
    let (observables, physical) = seen(case, options, b.parameter, &b.orbit)?;
    let (angle, time) = match b.kind {
        BifurcationKind::NeimarkSacker { angle } => (Some(angle.to_degrees()), None),
        BifurcationKind::Grazing { time } => (None, Some(time)),
        _ => (None, None),
    };
    Ok(BifurcationReport {
        kind: kind_name(b.kind),
        branch,
        period: b.orbit.period,
        parameter: b.parameter,
        uncertainty: b.uncertainty,
        state: b.orbit.states.first().cloned().unwrap_or_default(),
        multipliers: pairs(&b.orbit.multipliers),
        angle,
        time,
        observables,
        physical,
    })
}

/// Periods over which Lyapunov exponents are measured at most where seeds are looked for:
/// only what closes is followed.
const SEED_PERIODS: usize = 1000;
/// Points of each half of a locus at most.
const LOCUS_POINTS: usize = 6000;

/// Curves of all bifurcations, each once: one that lies on a curve already traced is left.
fn loci(
    case: &Case,
    options: &BranchOptions,
    diagram: &Diagram,
    (key, low, high): (Key, f64, f64),
    failures: &mut Vec<FailureReport>,
    control: &Control<'_>,
) -> Loci {
    let family = PlaneFamily {
        case: case.clone(),
        keys: [options.key, key],
    };
    // What the second key is where a bifurcation was found: another at each where it follows
    // from the first (the free amplitude from the frequency).
    let at = |b: &Bifurcation| case.with(options.key, b.parameter).get(key);
    let bifurcations = || diagram.branches.iter().flat_map(|b| &b.branch.bifurcations);
    let first = (options.from.min(options.to), options.from.max(options.to));
    // The values at which the bifurcations were found belong to the box.
    let second = bifurcations()
        .map(at)
        .fold((low.min(high), low.max(high)), |(low, high), here| {
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

/// What the study of branches is asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BranchRequest {
    /// The parameter, as the case file calls it (omega, alpha4, gap …); of a physical case also
    /// a quantity of it (drive.frequency, gap.tip, sample.stiffness …)
    #[schemars(extend("x-value" = "KEY", "x-required" = true))]
    pub parameter: String,
    /// Its value at the start; of a physical case also with a unit, as in "70 kHz"
    #[schemars(extend("x-value" = "VALUE", "x-required" = true))]
    pub from: Amount,
    /// The other end of its range
    #[schemars(extend("x-value" = "VALUE", "x-required" = true))]
    pub to: Amount,
    /// Period of the orbit at the start; without it, that of the motion to which a run converges
    #[schemars(range(min = 1, max = MOST_PERIOD), extend("x-value" = "N"))]
    pub period: Option<usize>,
    /// State near which the orbit at the start is looked for: a1,…,aN,v1,…,vN
    #[schemars(extend("x-value" = "A1,…"))]
    pub state: Option<Vec<f64>>,
    /// Also follow the doubled branches at flips, so many doublings deep
    #[schemars(range(min = 0, max = MOST_DOUBLINGS), extend("x-value" = "DEPTH", "x-bare" = "1"))]
    pub switch: Option<usize>,
    /// Assemble the whole picture: every stable orbit of a census at several values, followed
    /// both ways and through two doublings (or as {switch} says)
    pub diagram: bool,
    /// Of the {diagram}: values of the parameter at which a census is taken
    #[schemars(range(min = 2, max = 10_000), extend("x-value" = "K"))]
    pub values: usize,
    /// Of the {diagram}: starts at each
    #[schemars(range(min = 1, max = MOST_SEED_STARTS), extend("x-value" = "S"))]
    pub starts: usize,
    /// Of the {diagram}: seed of the starts
    #[schemars(extend("x-value" = "K"))]
    pub seed: u64,
    /// A second parameter and its range, as in alpha4=5:40: the bifurcation curves are traced in
    /// both
    #[schemars(extend("x-value" = "KEY=LOW:HIGH"))]
    pub second: Option<Interval>,
    /// Longest step, as a part of the range
    #[schemars(range(min = 0.0, max = 1.0), extend("x-value" = "PART"))]
    pub max_step: f64,
}

impl Default for BranchRequest {
    fn default() -> Self {
        let seeds = SeedOptions::default();
        Self {
            parameter: String::new(),
            from: Amount::default(),
            to: Amount::default(),
            period: None,
            state: None,
            switch: None,
            diagram: false,
            values: seeds.values,
            starts: seeds.starts,
            seed: seeds.seed,
            second: None,
            max_step: 0.01,
        }
    }
}

impl BranchRequest {
    /// How to follow.
    ///
    /// # Errors
    /// When a parameter or a value of it is none.
    pub fn options(&self, case: &Case) -> Result<BranchOptions, Error> {
        let (key, [from, to]) = key_and_ends(
            case,
            self.parameter.trim(),
            [("from", &self.from), ("to", &self.to)],
        )?;
        let second = self.second.as_ref().map(|second| {
            let ends = [("second", &second.low), ("second", &second.high)];
            key_and_ends(case, &second.name, ends)
        });
        let census = self.diagram.then(|| SeedOptions {
            values: self.values,
            starts: self.starts,
            seed: self.seed,
            ..SeedOptions::default()
        });
        Ok(BranchOptions {
            period: self.period,
            state: self.state.clone(),
            doublings: self.switch.unwrap_or(if self.diagram { 2 } else { 0 }),
            census,
            second: second
                .transpose()?
                .map(|(key, [low, high])| (key, low, high)),
            max_step: self.max_step,
            ..BranchOptions::over(key, from, to)
        })
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
    type Request = BranchRequest;
    type Report = BranchReport;

    fn compute(
        case: &Case,
        request: &BranchRequest,
        control: &Control<'_>,
    ) -> Result<BranchReport, Error> {
        followed(case, &request.options(case)?, control)
    }
}

/// The branches of a case, with what their parameter is in SI.
///
/// # Errors
/// As [`branch`].
pub fn followed(
    case: &Case,
    options: &BranchOptions,
    control: &Control<'_>,
) -> Result<BranchReport, Error> {
    let report = branch(case, options, control)?;
    Ok(BranchReport {
        parameter_unit: case.parameter_unit(report.key),
        ..report
    })
}

impl From<BranchError> for crate::Error {
    fn from(error: BranchError) -> Self {
        match error {
            BranchError::Range { .. } => Self::input(error.to_string(), "change {from} or {to}"),
            BranchError::Step { .. } => Self::input(error.to_string(), "give a {max_step} of 0.01"),
            BranchError::SameParameter { .. } => {
                Self::input(error.to_string(), "change {second} or {parameter}")
            }
            BranchError::Model { .. } => Self::input(
                error.to_string(),
                "keep {from}, {to} and {second} where the model makes sense",
            ),
            BranchError::Start {
                error: OrbitError::Start(_) | OrbitError::NoPeriod,
                ..
            } => Self::input(error.to_string(), "change {state} or {period}"),
            BranchError::Start { .. } | BranchError::NoSeeds { .. } => {
                Self::numerics(error.to_string())
                    .remedy("begin elsewhere with {from}, or give a {state} near an orbit")
            }
            other => Self::numerics(other.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::cantilever::Cantilever;

    #[test]
    fn a_point_that_cannot_be_measured_does_not_take_the_others_with_it() {
        let case = Case::from(Cantilever::paper());
        let options = BranchOptions::over(Key::Omega, 3.0, 3.01);
        let family = case.family(options.key);
        let seeds = [(3.0, first_orbit(&case, &options).unwrap())];
        let mut diagram =
            assemble_diagram(&family, &seeds, &options.diagram(), &Control::default());
        let whole = described(&case, &options, &diagram);
        assert!(whole.failures.is_empty() && whole.points.len() > 2);
        let branch = &mut diagram.branches[0].branch;
        branch.points[1].orbit.states[0][0] = f64::NAN;
        let parameter = branch.points[1].parameter;
        let rest = described(&case, &options, &diagram);
        assert_eq!(rest.points.len(), whole.points.len() - 1);
        assert_eq!(rest.failures.len(), 1);
        assert_eq!(rest.failures[0].parameter.to_bits(), parameter.to_bits());
        assert!(rest.failures[0].reason.contains("point is left out"));
    }
}
