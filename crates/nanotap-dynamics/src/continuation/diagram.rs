//! Assembly of a bifurcation diagram from seed orbits.
//!
//! Every seed orbit (from a census at one or more parameter values) is followed in both directions.
//! At each flip the doubled branch is followed, down to a given depth. Where a branch meets one of
//! shorter period, that one becomes a seed. An orbit on a branch that is already in the diagram is
//! not followed again.
//!
//! Fails by omission: isolated branches without a seed are not found.

use crate::continuation::bifurcation::BifurcationKind;
use crate::continuation::follow::solver_for;
use crate::continuation::orbit_on_branch::lies_between;
use crate::continuation::switching::switch_at_flip;
use crate::continuation::{
    Branch, BranchEnd, ContinuationError, ContinuationOptions, Direction, continue_orbit,
};
use crate::control::Control;
use crate::map::MapFamily;
use crate::orbit::PeriodicOrbit;
use crate::orbit::shooting::{ShootingOptions, close_orbit_from_points};
use rayon::prelude::*;

/// Options of the assembly of a diagram.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagramOptions {
    /// Options of the continuation of each branch.
    pub continuation: ContinuationOptions,
    /// Number of period doublings that are followed from each seed; 0 for none.
    pub doublings: usize,
    /// Whether a doubled branch ends at its first orbit that is not stable.
    pub stable_doublings: bool,
    /// Number of branches at which the assembly stops.
    pub max_branches: usize,
}

/// A branch of the diagram and its origin.
#[derive(Clone, Debug)]
pub struct DiagramBranch {
    /// The branch, in one direction.
    pub branch: Branch,
    /// Index of the branch from which it bifurcates at a flip; `None` for the branch of a seed.
    pub parent: Option<usize>,
    /// Number of period doublings between the seed and this branch.
    pub depth: usize,
}

/// All branches, and the seeds and flips that could not be followed.
#[derive(Clone, Debug, Default)]
pub struct Diagram {
    /// Each seed gives two branches, one in each direction, or one closed branch; each flip gives
    /// one.
    pub branches: Vec<DiagramBranch>,
    /// Seeds and flips that could not be followed: parameter value and reason.
    pub failures: Vec<(f64, String)>,
}

/// Assembles a diagram from seeds: orbits with their parameter values.
pub fn assemble_diagram<F: MapFamily>(
    family: &F,
    seeds: &[(f64, PeriodicOrbit)],
    options: &DiagramOptions,
    control: &Control<'_>,
) -> Diagram {
    let mut diagram = Diagram::default();
    diagram.extend(family, seeds, options, control);
    diagram
}

/// A branch followed towards larger and smaller parameter values.
type BothDirections = Box<[Result<Branch, ContinuationError>; 2]>;

/// An orbit to be followed, unless it lies on a known branch.
struct PendingOrbit {
    parameter: f64,
    orbit: PeriodicOrbit,
    depth: usize,
    /// Its branch, if an idle thread has computed it already.
    followed: Option<BothDirections>,
    /// Number of the diagram's branches on which it is known not to lie.
    checked_branches: usize,
}

impl PendingOrbit {
    fn seed((parameter, orbit): &(f64, PeriodicOrbit)) -> Self {
        Self {
            parameter: *parameter,
            orbit: orbit.clone(),
            depth: 0,
            followed: None,
            checked_branches: 0,
        }
    }

    fn start(&self) -> (f64, PeriodicOrbit) {
        (self.parameter, self.orbit.clone())
    }
}

/// Indices of the pending orbits that other threads may follow in parallel with `orbit`: the next
/// ones whose periods differ from its period and from each other, so that they are likely to lie on
/// other branches. If one turns out to lie on a known branch, its result is discarded; the diagram
/// does not depend on this.
fn likely_on_other_branches(orbit: &PendingOrbit, pending: &[PendingOrbit]) -> Vec<usize> {
    let max_count = rayon::current_num_threads() - 1;
    let mut periods = vec![orbit.orbit.period];
    let mut chosen = Vec::new();
    for (k, other) in pending.iter().enumerate().rev() {
        if chosen.len() == max_count {
            break;
        }
        let period = other.orbit.period;
        // A branch of doubled period may end at an orbit of half the period.
        let is_related = |p: &usize| *p == period || *p == 2 * period || 2 * *p == period;
        if other.followed.is_none() && !periods.iter().any(is_related) {
            periods.push(period);
            chosen.push(k);
        }
    }
    chosen
}

/// Follows an orbit in both directions.
fn follow_both_directions<F: MapFamily>(
    family: &F,
    (parameter, orbit): &(f64, PeriodicOrbit),
    options: &DiagramOptions,
    control: &Control<'_>,
) -> BothDirections {
    let follow = |direction| {
        let continuation = &options.continuation;
        continue_orbit(family, *parameter, orbit, direction, continuation, control)
    };
    let (up, down) = rayon::join(
        || follow(Direction::Increasing),
        || follow(Direction::Decreasing),
    );
    Box::new([up, down])
}

impl Diagram {
    /// Adds the branches of further seeds, as if they were the last of the original list.
    pub fn extend<F: MapFamily>(
        &mut self,
        family: &F,
        seeds: &[(f64, PeriodicOrbit)],
        options: &DiagramOptions,
        control: &Control<'_>,
    ) {
        let mut pending: Vec<PendingOrbit> = seeds.iter().rev().map(PendingOrbit::seed).collect();
        loop {
            pending = pending
                .into_par_iter()
                .with_max_len(1)
                .filter_map(|orbit| self.pending_if_new(family, orbit, &options.continuation))
                .collect();
            let Some(next) = pending.pop() else {
                break;
            };
            if control.is_cancelled() || self.branches.len() >= options.max_branches {
                break;
            }
            let others = likely_on_other_branches(&next, &pending);
            let starts: Vec<_> = others.iter().map(|k| pending[*k].start()).collect();
            let ((), directions) = rayon::join(
                || self.add_orbit(family, next, options, control, &mut pending),
                || {
                    let follow =
                        |start: &_| follow_both_directions(family, start, options, control);
                    starts.par_iter().map(follow).collect::<Vec<_>>()
                },
            );
            for (k, directions) in others.into_iter().zip(directions) {
                pending[k].followed = Some(directions);
            }
        }
    }

    /// Returns the orbit if it lies on no branch of the diagram.
    fn pending_if_new<F: MapFamily>(
        &self,
        family: &F,
        mut pending: PendingOrbit,
        options: &ContinuationOptions,
    ) -> Option<PendingOrbit> {
        let new = &self.branches[pending.checked_branches..];
        pending.checked_branches = self.branches.len();
        let known =
            !new.is_empty() && lies_on_any(new, family, pending.parameter, &pending.orbit, options);
        (!known).then_some(pending)
    }

    /// Adds the branches of an orbit in both directions, and those that bifurcate from them.
    fn add_orbit<F: MapFamily>(
        &mut self,
        family: &F,
        orbit: PendingOrbit,
        options: &DiagramOptions,
        control: &Control<'_>,
        pending: &mut Vec<PendingOrbit>,
    ) {
        let (parameter, depth) = (orbit.parameter, orbit.depth);
        let start = orbit.start();
        let directions = orbit.followed;
        let [up, down] =
            *directions.unwrap_or_else(|| follow_both_directions(family, &start, options, control));
        // Both directions along a closed branch give the same branch.
        let closed = matches!(&up, Ok(branch) if matches!(branch.end, BranchEnd::Closed));
        for followed in std::iter::once(up).chain((!closed).then_some(down)) {
            self.add_branch(
                family, followed, parameter, None, depth, options, control, pending,
            );
        }
    }

    /// Adds a branch, then those that bifurcate from it.
    fn add_branch<F: MapFamily>(
        &mut self,
        family: &F,
        followed: Result<Branch, ContinuationError>,
        parameter: f64,
        parent: Option<usize>,
        depth: usize,
        options: &DiagramOptions,
        control: &Control<'_>,
        pending: &mut Vec<PendingOrbit>,
    ) {
        let branch = match followed {
            Ok(branch) => branch,
            Err(_) if control.is_cancelled() => return,
            Err(error) => {
                self.failures.push((parameter, error.to_string()));
                return;
            }
        };
        if let Some((parameter, orbit)) = orbit_at_collapse(family, &branch) {
            pending.push(PendingOrbit {
                depth,
                ..PendingOrbit::seed(&(parameter, orbit))
            });
        }
        let flips: Vec<_> = branch
            .bifurcations
            .iter()
            .filter(|b| b.kind == BifurcationKind::Flip)
            .cloned()
            .collect();
        let index = self.branches.len();
        self.branches.push(DiagramBranch {
            branch,
            parent,
            depth,
        });
        if depth >= options.doublings {
            return;
        }
        for flip in flips {
            if control.is_cancelled() || self.branches.len() >= options.max_branches {
                return;
            }
            // A few points are enough to recognise a doubled branch that is already in the diagram.
            let probe = ContinuationOptions {
                max_points: 4,
                ..options.continuation.clone()
            };
            match switch_at_flip(family, &flip, &probe, control) {
                Ok(short) => {
                    let known = short.points.last().is_some_and(|p| {
                        self.holds(family, p.parameter, &p.orbit, &options.continuation)
                    });
                    if known {
                        continue;
                    }
                }
                Err(_) if control.is_cancelled() => return,
                Err(error) => {
                    self.failures.push((flip.parameter, error.to_string()));
                    continue;
                }
            }
            let doubled = ContinuationOptions {
                until_unstable: options.stable_doublings,
                ..options.continuation.clone()
            };
            let doubled = switch_at_flip(family, &flip, &doubled, control);
            self.add_branch(
                family,
                doubled,
                flip.parameter,
                Some(index),
                depth + 1,
                options,
                control,
                pending,
            );
        }
    }

    /// True if an orbit lies on a branch of the diagram, whichever strobe it starts from: Newton
    /// from the chord between two points of the branch closes the same orbit.
    pub fn holds<F: MapFamily>(
        &self,
        family: &F,
        parameter: f64,
        orbit: &PeriodicOrbit,
        options: &ContinuationOptions,
    ) -> bool {
        lies_on_any(&self.branches, family, parameter, orbit, options)
    }
}

fn lies_on_any<F: MapFamily>(
    branches: &[DiagramBranch],
    family: &F,
    parameter: f64,
    orbit: &PeriodicOrbit,
    options: &ContinuationOptions,
) -> bool {
    let mut solver = solver_for(family, orbit, options);
    let points = orbit.flat();
    branches
        .iter()
        .filter(|b| b.branch.period == orbit.period)
        .flat_map(|b| b.branch.points.windows(2))
        .any(|pair| lies_between(&mut solver, (&pair[0], &pair[1]), (&points, parameter)))
}

/// The orbit of shorter period that a branch ran into, near the point where they meet.
fn orbit_at_collapse<F: MapFamily>(family: &F, branch: &Branch) -> Option<(f64, PeriodicOrbit)> {
    let BranchEnd::Collapsed { period, .. } = branch.end else {
        return None;
    };
    let last = branch.points.last()?;
    let (n, d) = (branch.period, last.orbit.dimension());
    let copies = n / period;
    let mut points = vec![0.0; period * d];
    for (k, state) in last.orbit.states.iter().enumerate() {
        for (i, v) in state.iter().enumerate() {
            points[k % period * d + i] += v / copies as f64;
        }
    }
    let mut map = family.at(last.parameter).ok()?;
    let orbit =
        close_orbit_from_points(&mut map, &points, period, &ShootingOptions::default()).ok()?;
    (orbit.period == period).then_some((last.parameter, orbit))
}
