//! The whole picture of branches, assembled by itself.
//!
//! Every seed orbit (from a census at one parameter value or several) is followed
//! both ways; at each flip the doubled branch is followed, down to a given depth;
//! where a branch runs into one of shorter period, that one becomes a seed. An orbit
//! that lies on a branch already there is not followed again.
//!
//! Fails by omission: isolated branches that no seed lies on are not found.

use crate::continuation::bifurcation::BifurcationKind;
use crate::continuation::follow::solver_for;
use crate::continuation::passing::lies_between;
use crate::continuation::switching::switch_at_flip;
use crate::continuation::{
    Branch, BranchEnd, ContinuationError, ContinuationOptions, Direction, continue_orbit,
};
use crate::control::Control;
use crate::map::MapFamily;
use crate::orbit::PeriodicOrbit;
use crate::orbit::shooting::{ShootingOptions, close_orbit_from_points};
use rayon::prelude::*;

/// How a diagram is assembled.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagramOptions {
    /// How each branch is followed.
    pub continuation: ContinuationOptions,
    /// Doublings to follow from each seed: 0 for none.
    pub doublings: usize,
    /// Branches after which assembly stops.
    pub max_branches: usize,
}

/// A branch of the diagram, with where it came from.
#[derive(Clone, Debug)]
pub struct DiagramBranch {
    /// The branch, one way.
    pub branch: Branch,
    /// Index of the branch that it left at a flip, if it did.
    pub parent: Option<usize>,
    /// Doublings between it and a seed.
    pub depth: usize,
}

/// All branches, and what could not be followed.
#[derive(Clone, Debug, Default)]
pub struct Diagram {
    /// Each seed gives two, one each way, or a closed one; each flip gives one.
    pub branches: Vec<DiagramBranch>,
    /// Seeds and flips that could not be followed: the parameter and the reason.
    pub failures: Vec<(f64, String)>,
}

/// Assembles the diagram from seeds: orbits with their parameter values.
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

/// A branch followed towards greater and smaller parameters.
type Ways = Box<[Result<Branch, ContinuationError>; 2]>;

/// An orbit whose branch is to be followed, unless it turns out to be known.
struct Waiting {
    parameter: f64,
    orbit: PeriodicOrbit,
    depth: usize,
    /// The branch, where a thread had nothing else to do.
    followed: Option<Ways>,
    /// How many of the diagram's branches it is known not to lie on.
    seen: usize,
}

impl Waiting {
    fn seed((parameter, orbit): &(f64, PeriodicOrbit)) -> Self {
        Self {
            parameter: *parameter,
            orbit: orbit.clone(),
            depth: 0,
            followed: None,
            seen: 0,
        }
    }

    fn start(&self) -> (f64, PeriodicOrbit) {
        (self.parameter, self.orbit.clone())
    }
}

/// Which of those waiting other threads may follow beside `orbit`: those that come next and have
/// other periods than it and each other, so that they are likely to lie on other branches. Where
/// one comes to lie on a branch after all, the work was in vain and the diagram is the same.
fn likely_next(orbit: &Waiting, waiting: &[Waiting]) -> Vec<usize> {
    let wanted = rayon::current_num_threads() - 1;
    let mut periods = vec![orbit.orbit.period];
    let mut chosen = Vec::new();
    for (k, other) in waiting.iter().enumerate().rev() {
        if chosen.len() == wanted {
            break;
        }
        let period = other.orbit.period;
        // One of half the length may be what a branch of doubled period ends at.
        let alike = |p: &usize| *p == period || *p == 2 * period || 2 * *p == period;
        if other.followed.is_none() && !periods.iter().any(alike) {
            periods.push(period);
            chosen.push(k);
        }
    }
    chosen
}

/// Follows an orbit both ways.
fn both_ways<F: MapFamily>(
    family: &F,
    (parameter, orbit): &(f64, PeriodicOrbit),
    options: &DiagramOptions,
    control: &Control<'_>,
) -> Ways {
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
    /// Adds the branches of further seeds, as if they had been the last to be given.
    pub fn extend<F: MapFamily>(
        &mut self,
        family: &F,
        seeds: &[(f64, PeriodicOrbit)],
        options: &DiagramOptions,
        control: &Control<'_>,
    ) {
        let mut waiting: Vec<Waiting> = seeds.iter().rev().map(Waiting::seed).collect();
        loop {
            waiting = waiting
                .into_par_iter()
                .with_max_len(1)
                .filter_map(|orbit| self.lacks(family, orbit, &options.continuation))
                .collect();
            let Some(next) = waiting.pop() else {
                break;
            };
            if control.is_cancelled() || self.branches.len() >= options.max_branches {
                break;
            }
            let others = likely_next(&next, &waiting);
            let starts: Vec<_> = others.iter().map(|k| waiting[*k].start()).collect();
            let ((), ways) = rayon::join(
                || self.add(family, next, options, control, &mut waiting),
                || {
                    let follow = |start: &_| both_ways(family, start, options, control);
                    starts.par_iter().map(follow).collect::<Vec<_>>()
                },
            );
            for (k, ways) in others.into_iter().zip(ways) {
                waiting[k].followed = Some(ways);
            }
        }
    }

    /// An orbit that waits, if it lies on no branch.
    fn lacks<F: MapFamily>(
        &self,
        family: &F,
        mut waiting: Waiting,
        options: &ContinuationOptions,
    ) -> Option<Waiting> {
        let new = &self.branches[waiting.seen..];
        waiting.seen = self.branches.len();
        let held = !new.is_empty() && hold(new, family, waiting.parameter, &waiting.orbit, options);
        (!held).then_some(waiting)
    }

    /// Adds the branch of an orbit, both ways, and what leaves it.
    fn add<F: MapFamily>(
        &mut self,
        family: &F,
        orbit: Waiting,
        options: &DiagramOptions,
        control: &Control<'_>,
        waiting: &mut Vec<Waiting>,
    ) {
        let (parameter, depth) = (orbit.parameter, orbit.depth);
        let start = orbit.start();
        let ways = orbit.followed;
        let [up, down] = *ways.unwrap_or_else(|| both_ways(family, &start, options, control));
        // The way back along a closed branch is the same branch.
        let closed = matches!(&up, Ok(branch) if matches!(branch.end, BranchEnd::Closed));
        for followed in std::iter::once(up).chain((!closed).then_some(down)) {
            self.take(
                family, followed, parameter, None, depth, options, control, waiting,
            );
        }
    }

    /// Adds a branch, then what leaves it.
    fn take<F: MapFamily>(
        &mut self,
        family: &F,
        followed: Result<Branch, ContinuationError>,
        parameter: f64,
        parent: Option<usize>,
        depth: usize,
        options: &DiagramOptions,
        control: &Control<'_>,
        waiting: &mut Vec<Waiting>,
    ) {
        let branch = match followed {
            Ok(branch) => branch,
            Err(error) => {
                self.failures.push((parameter, error.to_string()));
                return;
            }
        };
        if let Some((parameter, orbit)) = met(family, &branch) {
            waiting.push(Waiting {
                depth,
                ..Waiting::seed(&(parameter, orbit))
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
            // A few points tell whether the doubled branch is there already.
            let glimpse = ContinuationOptions {
                max_points: 4,
                ..options.continuation.clone()
            };
            match switch_at_flip(family, &flip, &glimpse, control) {
                Ok(short) => {
                    let known = short.points.last().is_some_and(|p| {
                        self.holds(family, p.parameter, &p.orbit, &options.continuation)
                    });
                    if known {
                        continue;
                    }
                }
                Err(error) => {
                    self.failures.push((flip.parameter, error.to_string()));
                    continue;
                }
            }
            let doubled = switch_at_flip(family, &flip, &options.continuation, control);
            self.take(
                family,
                doubled,
                flip.parameter,
                Some(index),
                depth + 1,
                options,
                control,
                waiting,
            );
        }
    }

    /// True if an orbit lies on a branch of the diagram, at whichever strobe it begins: between
    /// two points of the branch, Newton from their chord closes the same orbit.
    pub fn holds<F: MapFamily>(
        &self,
        family: &F,
        parameter: f64,
        orbit: &PeriodicOrbit,
        options: &ContinuationOptions,
    ) -> bool {
        hold(&self.branches, family, parameter, orbit, options)
    }
}

fn hold<F: MapFamily>(
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

/// The orbit of shorter period that a branch ran into, beside the meeting.
fn met<F: MapFamily>(family: &F, branch: &Branch) -> Option<(f64, PeriodicOrbit)> {
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
