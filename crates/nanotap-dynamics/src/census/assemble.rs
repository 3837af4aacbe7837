//! Groups the outcomes of all starts into attractors with their counts.

use crate::census::escapes::Escapes;
use crate::census::{
    Attractor, AttractorKind, Census, CensusEnd, Fraction, Lifetime, Outcome, SizeCount,
    StartOrigin, StartOutcome, StartSet, TransientChaos, UndiscoveredFraction,
};
use crate::lyapunov::LyapunovSpectrum;
use crate::orbit::PeriodicOrbit;

/// A group of starts on the same motion.
struct Group {
    kind: AttractorKind,
    members: Vec<usize>,
    state: Vec<f64>,
}

pub(crate) fn assemble(
    outcomes: &[Outcome],
    starts: &StartSet,
    orbits: Vec<PeriodicOrbit>,
    after: f64,
    (mut has_transient_chaos, mut transient_spectrum): (bool, Option<LyapunovSpectrum>),
    starts_since_discovery: usize,
) -> Census {
    let total = outcomes.len();
    let mut groups: Vec<Group> = orbits
        .into_iter()
        .map(|orbit| Group {
            state: orbit.states[0].clone(),
            kind: AttractorKind::Periodic(orbit),
            members: Vec::new(),
        })
        .collect();
    let escapes = Escapes::count(outcomes, after);
    let chaos_lasts = escapes.chaos_lasts();
    let mut undecided = Vec::new();
    let mut unbounded = Vec::new();
    let mut unescaped = Vec::new();
    for (k, outcome) in outcomes.iter().enumerate() {
        match outcome {
            Outcome::Orbit { index, .. } => groups[*index].members.push(k),
            Outcome::Torus(torus, state) => {
                let found = groups.iter_mut().find(|g| {
                    matches!(&g.kind, AttractorKind::QuasiPeriodic(t)
                        if t.spectrum.agrees_with(&torus.spectrum))
                });
                if let Some((members, state)) = join(found, k, state) {
                    groups.push(Group {
                        kind: AttractorKind::QuasiPeriodic(torus.clone()),
                        members,
                        state,
                    });
                }
            }
            Outcome::Chaos(chaos, _) if !chaos_lasts => {
                unescaped.push(k);
                if unescaped.len() == 1 {
                    has_transient_chaos = true;
                    transient_spectrum = Some(chaos.spectrum.clone());
                }
            }
            Outcome::Chaos(chaos, state) => {
                let found = groups.iter_mut().find(|g| {
                    matches!(&g.kind, AttractorKind::Chaotic { spectrum, .. }
                        if spectrum.agrees_with(&chaos.spectrum))
                });
                if let Some((members, state)) = join(found, k, state) {
                    groups.push(Group {
                        kind: AttractorKind::Chaotic {
                            spectrum: chaos.spectrum.clone(),
                            lifetime: Lifetime::new(0, 0.0),
                        },
                        members,
                        state,
                    });
                }
            }
            Outcome::Unbounded => unbounded.push(k),
            Outcome::Undecided(reason) | Outcome::Reset { reason, .. } => {
                undecided.push((k, reason.clone()));
            }
        }
    }
    for group in &mut groups {
        if let AttractorKind::Chaotic { lifetime, .. } = &mut group.kind {
            let exposure = group
                .members
                .iter()
                .map(|&k| match &outcomes[k] {
                    Outcome::Chaos(chaos, _) => escapes.exposure_without_escape(chaos.observed),
                    _ => 0.0,
                })
                .sum();
            *lifetime = Lifetime::new(0, exposure);
        }
    }
    let counts = Counts::new(starts, total);
    let members = |g: &Group| counts.of(&g.members);
    // Most frequent first; the first member breaks ties.
    let mut order: Vec<usize> = (0..groups.len()).collect();
    order.sort_by_key(|&g| {
        let first = groups[g].members.first().copied().unwrap_or(usize::MAX);
        (usize::MAX - members(&groups[g]).count, first)
    });
    let mut outcomes_by_start = vec![StartOutcome::Undecided; total];
    for (index, &g) in order.iter().enumerate() {
        for &k in &groups[g].members {
            outcomes_by_start[k] = StartOutcome::Attractor {
                index,
                periods: periods_of(&outcomes[k]),
            };
        }
    }
    for &k in &unescaped {
        outcomes_by_start[k] = StartOutcome::TransientChaos {
            periods: periods_of(&outcomes[k]),
        };
    }
    for (outcome_of_start, outcome) in outcomes_by_start.iter_mut().zip(outcomes) {
        if matches!(outcome, Outcome::Unbounded) {
            *outcome_of_start = StartOutcome::Unbounded;
        }
    }
    let transient_chaos = (has_transient_chaos && escapes.escaped.len() + unescaped.len() > 0)
        .then(|| TransientChaos {
            spectrum: transient_spectrum,
            lifetime: escapes.lifetime(),
            unescaped: counts.of(&unescaped),
            destinations: destinations(&escapes.escaped, &outcomes_by_start, order.len()),
        });
    let by_size = counts.by_size(&outcomes_by_start, order.len());
    let unseen = (!by_size.is_empty())
        .then(|| UndiscoveredFraction::new(order.len(), starts_since_discovery));
    let mut slots: Vec<Option<Group>> = groups.into_iter().map(Some).collect();
    let attractors = order
        .iter()
        .filter_map(|&g| slots[g].take())
        .map(|g| Attractor {
            fraction: counts.of(&g.members),
            first_start: g.members.first().copied(),
            kind: g.kind,
            state: g.state,
        })
        .collect();
    Census {
        attractors,
        transient_chaos,
        unbounded: counts.of(&unbounded),
        undecided,
        outcomes_by_start,
        counted: counts.counted,
        by_size,
        unseen,
        unstable: Vec::new(),
        followed_coarsely: false,
        end: CensusEnd::AllStarts,
        cancelled: false,
    }
}

/// Adds start `k` to an existing group, or returns the members and the state of a new one.
fn join(found: Option<&mut Group>, k: usize, state: &[f64]) -> Option<(Vec<usize>, Vec<f64>)> {
    if let Some(group) = found {
        group.members.push(k);
        None
    } else {
        Some((vec![k], state.to_vec()))
    }
}

pub(crate) fn periods_of(outcome: &Outcome) -> usize {
    match outcome {
        Outcome::Orbit { periods, .. } | Outcome::Reset { periods, .. } => *periods,
        Outcome::Chaos(chaos, _) => chaos.observed,
        Outcome::Torus(torus, _) => torus.spectrum.periods,
        Outcome::Unbounded | Outcome::Undecided(_) => 0,
    }
}

fn destinations(
    escaped: &[(usize, usize)],
    outcomes_by_start: &[StartOutcome],
    attractors: usize,
) -> Vec<(usize, usize)> {
    let mut counts = vec![0; attractors];
    for &(k, _) in escaped {
        if let StartOutcome::Attractor { index, .. } = outcomes_by_start[k] {
            counts[index] += 1;
        }
    }
    counts
        .into_iter()
        .enumerate()
        .filter(|(_, count)| *count > 0)
        .collect()
}

/// The starts that the fractions of a census refer to.
struct Counts<'a> {
    starts: &'a StartSet,
    total: usize,
    counted: usize,
}

impl<'a> Counts<'a> {
    fn new(starts: &'a StartSet, total: usize) -> Self {
        let counted = match starts.len() {
            Some(_) => total,
            None => total.saturating_sub(starts.given_count()),
        };
        Self {
            starts,
            total,
            counted,
        }
    }

    /// Returns the fraction of the counted starts that are in `members`.
    fn of(&self, members: &[usize]) -> Fraction {
        let uncounted = self.total - self.counted;
        let count = members.iter().filter(|&&k| k >= uncounted).count();
        Fraction::new(count, self.counted)
    }

    fn by_size(&self, outcomes_by_start: &[StartOutcome], attractors: usize) -> Vec<SizeCount> {
        let scales = self.starts.scales();
        (0..scales.len())
            .map(|size| {
                let of_this_size: Vec<StartOutcome> = (0..outcomes_by_start.len())
                    .filter(|&k| self.starts.origin(k) == Some(StartOrigin::Drawn(size)))
                    .map(|k| outcomes_by_start[k])
                    .collect();
                let part = |is: &dyn Fn(&StartOutcome) -> bool| {
                    let count = of_this_size.iter().filter(|f| is(f)).count();
                    Fraction::new(count, of_this_size.len())
                };
                SizeCount {
                    scale: scales[size],
                    starts: of_this_size.len(),
                    attractors: (0..attractors)
                        .map(|a| {
                            part(&|f| matches!(f, StartOutcome::Attractor { index, .. } if *index == a))
                        })
                        .collect(),
                    unbounded: part(&|f| matches!(f, StartOutcome::Unbounded)),
                    undecided: part(&|f| matches!(f, StartOutcome::Undecided | StartOutcome::TransientChaos { .. })),
                }
            })
            .collect()
    }
}
