//! Which attractors there are, and what part of a box of starts goes to each.
//!
//! 1. Pilot starts are settled one by one ([`mod@crate::settle`]); orbits that are the
//!    same up to a cyclic shift, within their own error estimates, are merged.
//! 2. Around each stable orbit a contracting neighbourhood is found
//!    ([`crate::neighbourhood`]). A neighbourhood that a pilot with another fate
//!    enters is thrown away.
//! 3. All starts are run until they enter one, or settle elsewhere.
//! 4. Motions that do not close are merged when their exponents and mean states
//!    agree within six standard errors.
//! 5. Chaos is claimed as an attractor only if no run escaped from it, with the mean
//!    lifetime that this bounds from below. If runs that outlived every linear
//!    transient escaped while others still wander, the wanderers are transient
//!    chaos, with its lifetime and where the escaped ones went.
//!
//! What happens to a start depends on the map, the pilots and the start alone, so
//! the result is the same for any number of threads and any order of work.
//!
//! Fails: attractors whose basins are smaller than about one part in the number of
//! starts are missed (the interval of a count of zero says how small); two different
//! chaotic attractors with equal exponents and means would be merged; an attractor
//! and a chaotic transient beside it are told apart only by the hazard of escape
//! falling with time, as documented at [`Census::transient_chaos`].

use std::sync::atomic::AtomicUsize;

use rayon::prelude::*;

use crate::confidence::{Fraction, Lifetime};
use crate::control::Control;
use crate::lyapunov::LyapunovSpectrum;
use crate::map::StroboscopicMap;
use crate::neighbourhood::Neighbourhood;
use crate::orbit::PeriodicOrbit;
use crate::settle::{
    Arrival, Chaos, SettleOptions, Settled, Torus, UndecidedReason, Verdict, arrive,
};
use crate::unstable::merge;

/// How a census is taken.
#[derive(Clone, Debug, PartialEq)]
pub struct CensusOptions {
    /// Starts that are settled without knowledge of any attractor.
    pub pilots: usize,
    /// Budgets of each start.
    pub settle: SettleOptions,
}

impl Default for CensusOptions {
    fn default() -> Self {
        Self {
            pilots: 32,
            settle: SettleOptions::default(),
        }
    }
}

/// What a census found.
#[derive(Clone, Debug)]
pub struct Census {
    /// Attractors, most frequent first.
    pub attractors: Vec<Attractor>,
    /// Chaos from which some starts escaped while it was watched.
    ///
    /// Counted are starts that are in no attractor's neighbourhood after three times
    /// the slowest linear decay from the box (64 periods at least). If some of them
    /// escape and others have not yet, the wanderers are transient, unless all
    /// escapes fell in the first quarter of the time watched and that would happen
    /// with probability below 1 % at a constant rate: then there is an attractor,
    /// with a chaotic transient beside it.
    pub transient_chaos: Option<TransientChaos>,
    /// Starts that left every bound.
    pub unbounded: Fraction,
    /// Starts without a verdict, by index.
    pub undecided: Vec<(usize, UndecidedReason)>,
    /// What happened to each start.
    pub fates: Vec<Fate>,
    /// True if the work was stopped before all starts were done.
    pub cancelled: bool,
}

/// One attractor.
#[derive(Clone, Debug)]
pub struct Attractor {
    /// What it is.
    pub kind: AttractorKind,
    /// What part of the starts goes there.
    pub fraction: Fraction,
    /// Index of the first start that does.
    pub first_start: usize,
    /// A state on the attractor.
    pub state: Vec<f64>,
}

/// What an attractor is, with the evidence.
#[derive(Clone, Debug)]
pub enum AttractorKind {
    /// A stable periodic orbit.
    Periodic(PeriodicOrbit),
    /// A torus.
    QuasiPeriodic(Torus),
    /// Chaos, from which none escaped.
    Chaotic {
        /// Exponents, of the first start that found it.
        spectrum: LyapunovSpectrum,
        /// Lower bound on the mean lifetime, over all starts on it.
        lifetime: Lifetime,
    },
}

/// Chaos that ends.
#[derive(Clone, Debug)]
pub struct TransientChaos {
    /// Exponents while it lasts, of the first start seen on it.
    pub spectrum: LyapunovSpectrum,
    /// Mean lifetime in periods, by maximum likelihood with the wanderers censored.
    pub lifetime: Lifetime,
    /// Starts still wandering at the end.
    pub wandering: Fraction,
    /// Attractors (by index) that escaped starts went to, with counts.
    pub destinations: Vec<(usize, usize)>,
}

/// What happened to a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It went to this attractor, and was known to after so many periods.
    Attractor {
        /// Index into [`Census::attractors`].
        index: usize,
        /// Periods run.
        periods: usize,
    },
    /// It was still on the transient chaos after so many periods.
    Wandering {
        /// Periods run.
        periods: usize,
    },
    /// It left every bound.
    Unbounded,
    /// No verdict; the reason is in [`Census::undecided`].
    Undecided,
}

/// What one start came to, before attractors are put together.
enum Outcome {
    Orbit { index: usize, periods: usize },
    Torus(Torus, Vec<f64>),
    Chaos(Chaos, Vec<f64>),
    Unbounded,
    Undecided(UndecidedReason),
}

/// Settles all `starts` (each of the map's dimension) and counts.
pub fn census<M: StroboscopicMap>(
    map: &M,
    starts: &[Vec<f64>],
    options: &CensusOptions,
    control: &Control<'_>,
) -> Census {
    let done = AtomicUsize::new(0);
    let run = |indices: &[usize], known: &[Neighbourhood], count: bool| -> Vec<Option<Arrival>> {
        indices
            .par_iter()
            .map_init(
                || map.clone(),
                |map, &k| {
                    if control.is_cancelled() {
                        return None;
                    }
                    let arrival = arrive(map, &starts[k], known, &options.settle);
                    if count {
                        control.report(&done, starts.len());
                    }
                    Some(arrival)
                },
            )
            .collect()
    };

    let pilots: Vec<usize> = (0..starts.len().min(options.pilots.max(1))).collect();
    let mut orbits: Vec<PeriodicOrbit> = Vec::new();
    let mut outcomes: Vec<Outcome> = Vec::with_capacity(starts.len());
    let mut transient_spectrum = None;
    for arrival in run(&pilots, &[], true) {
        outcomes.push(outcome(arrival, &[], &mut orbits, &mut transient_spectrum));
    }

    let mut known = neighbourhoods(map, &orbits);
    // How long a pilot really took, now that its goal is known; and a check of the
    // neighbourhoods by starts whose fate was found without them.
    let settled: Vec<usize> = pilots
        .iter()
        .copied()
        .filter(|&k| matches!(outcomes[k], Outcome::Orbit { .. }))
        .collect();
    let balls: Vec<Neighbourhood> = known.iter().map(|(_, n)| n.clone()).collect();
    let mut false_balls = Vec::new();
    for (&k, arrival) in settled.iter().zip(run(&settled, &balls, false)) {
        let (
            Outcome::Orbit { index, periods },
            Some(Arrival::Entered {
                index: ball,
                periods: after,
            }),
        ) = (&mut outcomes[k], arrival)
        else {
            continue;
        };
        if known[ball].0 == *index {
            *periods = after;
        } else {
            false_balls.push(ball);
        }
    }
    let mut position = 0;
    known.retain(|_| {
        position += 1;
        !false_balls.contains(&(position - 1))
    });

    let rest: Vec<usize> = (pilots.len()..starts.len()).collect();
    let indices: Vec<usize> = known.iter().map(|(i, _)| *i).collect();
    let balls: Vec<Neighbourhood> = known.into_iter().map(|(_, n)| n).collect();
    for arrival in run(&rest, &balls, true) {
        outcomes.push(outcome(
            arrival,
            &indices,
            &mut orbits,
            &mut transient_spectrum,
        ));
    }
    let sides = sides(starts);
    let relaxation = balls
        .iter()
        .map(|n| n.relaxation(&sides))
        .fold(0.0, f64::max);
    assemble(&outcomes, orbits, relaxation, transient_spectrum, control)
}

/// Sides of the box around the starts.
fn sides(starts: &[Vec<f64>]) -> Vec<f64> {
    let Some(first) = starts.first() else {
        return Vec::new();
    };
    let mut low = first.clone();
    let mut high = first.clone();
    for start in starts {
        for (v, (l, h)) in start.iter().zip(low.iter_mut().zip(&mut high)) {
            *l = l.min(*v);
            *h = h.max(*v);
        }
    }
    low.iter().zip(&high).map(|(l, h)| h - l).collect()
}

/// The contracting neighbourhoods that could be found, with the orbit of each.
fn neighbourhoods<M: StroboscopicMap>(
    map: &M,
    orbits: &[PeriodicOrbit],
) -> Vec<(usize, Neighbourhood)> {
    orbits
        .par_iter()
        .enumerate()
        .map_init(
            || map.clone(),
            |map, (index, orbit)| {
                let found = Neighbourhood::around(map, orbit).ok().flatten()?;
                Some((index, found))
            },
        )
        .collect::<Vec<_>>()
        .into_iter()
        .flatten()
        .collect()
}

fn outcome(
    arrival: Option<Arrival>,
    known: &[usize],
    orbits: &mut Vec<PeriodicOrbit>,
    transient_spectrum: &mut Option<LyapunovSpectrum>,
) -> Outcome {
    let settled = match arrival {
        None => return Outcome::Undecided(UndecidedReason::Cancelled),
        Some(Arrival::Entered { index, periods }) => {
            return Outcome::Orbit {
                index: known[index],
                periods,
            };
        }
        Some(Arrival::Settled(settled)) => *settled,
    };
    let Settled {
        verdict,
        periods,
        state,
    } = settled;
    match verdict {
        Verdict::Periodic(orbit) => Outcome::Orbit {
            index: merge(orbits, orbit),
            periods,
        },
        Verdict::TransientChaos {
            orbit, spectrum, ..
        } => {
            transient_spectrum.get_or_insert(spectrum);
            Outcome::Orbit {
                index: merge(orbits, orbit),
                periods,
            }
        }
        Verdict::QuasiPeriodic(torus) => Outcome::Torus(torus, state),
        Verdict::Chaotic(chaos) => Outcome::Chaos(chaos, state),
        Verdict::Unbounded => Outcome::Unbounded,
        Verdict::Undecided { reason, .. } => Outcome::Undecided(reason),
    }
}

/// A group of starts on the same motion.
struct Group {
    kind: AttractorKind,
    members: Vec<usize>,
    state: Vec<f64>,
}

fn assemble(
    outcomes: &[Outcome],
    orbits: Vec<PeriodicOrbit>,
    relaxation: f64,
    transient_spectrum: Option<LyapunovSpectrum>,
    control: &Control<'_>,
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
    let escapes = Escapes::count(outcomes, relaxation);
    let chaos_lasts = escapes.chaos_lasts();
    let mut undecided = Vec::new();
    let mut unbounded = 0;
    let mut wandering = Vec::new();
    let mut wandering_spectrum = transient_spectrum;
    for (k, outcome) in outcomes.iter().enumerate() {
        match outcome {
            Outcome::Orbit { index, .. } => groups[*index].members.push(k),
            Outcome::Torus(torus, state) => {
                let found = groups.iter_mut().find(|g| {
                    matches!(&g.kind, AttractorKind::QuasiPeriodic(t)
                        if agree(&t.spectrum, &torus.spectrum))
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
                wandering.push(k);
                if wandering.len() == 1 {
                    wandering_spectrum = Some(chaos.spectrum.clone());
                }
            }
            Outcome::Chaos(chaos, state) => {
                let found = groups.iter_mut().find(|g| {
                    matches!(&g.kind, AttractorKind::Chaotic { spectrum, .. }
                        if agree(spectrum, &chaos.spectrum))
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
            Outcome::Unbounded => unbounded += 1,
            Outcome::Undecided(reason) => undecided.push((k, reason.clone())),
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
    // Most frequent first; the first member breaks ties.
    groups.retain(|g| !g.members.is_empty());
    let mut order: Vec<usize> = (0..groups.len()).collect();
    order.sort_by_key(|&g| (usize::MAX - groups[g].members.len(), groups[g].members[0]));
    let mut fates = vec![Fate::Undecided; total];
    for (index, &g) in order.iter().enumerate() {
        for &k in &groups[g].members {
            fates[k] = Fate::Attractor {
                index,
                periods: periods_of(&outcomes[k]),
            };
        }
    }
    for &k in &wandering {
        fates[k] = Fate::Wandering {
            periods: periods_of(&outcomes[k]),
        };
    }
    for (fate, outcome) in fates.iter_mut().zip(outcomes) {
        if matches!(outcome, Outcome::Unbounded) {
            *fate = Fate::Unbounded;
        }
    }
    let transient_chaos = wandering_spectrum
        .filter(|_| escapes.escaped.len() + wandering.len() > 0)
        .map(|spectrum| TransientChaos {
            spectrum,
            lifetime: escapes.lifetime(),
            wandering: Fraction::new(wandering.len(), total),
            destinations: destinations(&escapes.escaped, &fates, order.len()),
        });
    let mut slots: Vec<Option<Group>> = groups.into_iter().map(Some).collect();
    let attractors = order
        .iter()
        .filter_map(|&g| slots[g].take())
        .map(|g| Attractor {
            fraction: Fraction::new(g.members.len(), total),
            first_start: g.members[0],
            kind: g.kind,
            state: g.state,
        })
        .collect();
    Census {
        attractors,
        transient_chaos,
        unbounded: Fraction::new(unbounded, total),
        undecided,
        fates,
        cancelled: control.is_cancelled(),
    }
}

/// Adds start `k` to a group that is there, or hands back what a new one needs.
fn join(found: Option<&mut Group>, k: usize, state: &[f64]) -> Option<(Vec<usize>, Vec<f64>)> {
    if let Some(group) = found {
        group.members.push(k);
        None
    } else {
        Some((vec![k], state.to_vec()))
    }
}

fn periods_of(outcome: &Outcome) -> usize {
    match outcome {
        Outcome::Orbit { periods, .. } => *periods,
        Outcome::Chaos(chaos, _) => chaos.observed,
        Outcome::Torus(torus, _) => torus.spectrum.periods,
        Outcome::Unbounded | Outcome::Undecided(_) => 0,
    }
}

fn destinations(
    escaped: &[(usize, usize)],
    fates: &[Fate],
    attractors: usize,
) -> Vec<(usize, usize)> {
    let mut counts = vec![0; attractors];
    for &(k, _) in escaped {
        if let Fate::Attractor { index, .. } = fates[k] {
            counts[index] += 1;
        }
    }
    counts
        .into_iter()
        .enumerate()
        .filter(|(_, count)| *count > 0)
        .collect()
}

/// True if two motions have the same exponents and mean states within six standard
/// errors of the difference (and what 1/T convergence leaves).
fn agree(a: &LyapunovSpectrum, b: &LyapunovSpectrum) -> bool {
    let length = a.periods.min(b.periods).max(1) as f64;
    let close =
        |x: f64, ex: f64, y: f64, ey: f64, floor: f64| (x - y).abs() <= 6.0 * ex.hypot(ey) + floor;
    let exponents = a
        .exponents
        .iter()
        .zip(&a.errors)
        .zip(b.exponents.iter().zip(&b.errors))
        .all(|((x, ex), (y, ey))| close(*x, *ex, *y, *ey, 20.0 / length));
    let scale = a.mean.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let means = a
        .mean
        .iter()
        .zip(&a.mean_errors)
        .zip(b.mean.iter().zip(&b.mean_errors))
        .all(|((x, ex), (y, ey))| close(*x, *ex, *y, *ey, 20.0 * scale / length));
    exponents && means
}

/// Escapes of starts that outlived every linear transient.
struct Escapes {
    /// Periods up to which nothing is counted.
    after: f64,
    /// Start and periods of each escape.
    escaped: Vec<(usize, usize)>,
    /// Periods watched of each start that is still chaotic.
    wandering: Vec<usize>,
}

impl Escapes {
    fn count(outcomes: &[Outcome], relaxation: f64) -> Self {
        let after = (3.0 * relaxation).max(64.0);
        let mut escaped = Vec::new();
        let mut wandering = Vec::new();
        for (k, outcome) in outcomes.iter().enumerate() {
            match outcome {
                Outcome::Orbit { periods, .. } if *periods as f64 > after => {
                    escaped.push((k, *periods));
                }
                Outcome::Chaos(chaos, _) => wandering.push(chaos.observed),
                _ => {}
            }
        }
        Self {
            after,
            escaped,
            wandering,
        }
    }

    /// End of the first quarter of the time for which all wanderers were watched.
    fn early(&self) -> f64 {
        let end = self.wandering.iter().copied().min().unwrap_or(0) as f64;
        self.after + 0.25 * (end - self.after).max(0.0)
    }

    fn exposure_between(&self, from: f64, to: f64) -> f64 {
        let share = |t: usize| ((t as f64).min(to) - from).max(0.0);
        self.escaped.iter().map(|&(_, t)| share(t)).sum::<f64>()
            + self.wandering.iter().map(|&t| share(t)).sum::<f64>()
    }

    fn lifetime(&self) -> Lifetime {
        Lifetime::new(
            self.escaped.len(),
            self.exposure_between(self.after, f64::INFINITY),
        )
    }

    /// True if the wanderers are on an attractor: none escaped, or escapes stopped
    /// early in a way that a constant rate would show with probability below 1 %.
    fn chaos_lasts(&self) -> bool {
        if self.escaped.is_empty() {
            return true;
        }
        let early = self.early();
        if self.escaped.iter().any(|&(_, t)| t as f64 > early) {
            return false;
        }
        let rate = self.escaped.len() as f64 / self.exposure_between(self.after, early).max(1.0);
        let expected = rate * self.exposure_between(early, f64::INFINITY);
        expected > 100f64.ln()
    }

    /// Part of a wanderer's time that counts towards "none escaped".
    fn exposure_without_escape(&self, observed: usize) -> f64 {
        let from = if self.escaped.is_empty() {
            self.after.min(observed as f64)
        } else {
            self.early()
        };
        (observed as f64 - from).max(0.0)
    }
}
