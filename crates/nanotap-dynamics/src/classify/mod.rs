//! What the motion from one start is.
//!
//! The run is looked at after 16, 32, 64, … periods ([`ClassifyOptions::first_look`]).
//! Each time the best candidate periods go to Newton; a closed orbit counts only if its
//! multipliers are stable *and* the run is seen to come to it, or to approach it at the
//! rate those multipliers say with a free way ahead, in the norm in which every linear
//! motion near the orbit contracts at each return. So the
//! transient is as long as the motion needs, a slow decay towards a weakly stable
//! orbit is recognised for what it is (Newton jumps to its end), and no tolerance on
//! how nearly the run repeats ever decides.
//!
//! What does not close is measured on: Lyapunov spectrum with error bars, still
//! looking for an escape, then weighted Birkhoff averages. A motion is called
//!
//! - periodic: closed, stable, approached;
//! - transient chaos: the exponents were positive by more than five standard errors,
//!   and then the run escaped to a periodic orbit;
//! - chaotic: positive by more than five standard errors to the end, over the whole run
//!   after its transient and over its last half. One run of T
//!   periods without escape says that the mean lifetime is above T/3 at 95 %
//!   (exponential lifetimes: e⁻³ ≈ 0.05) and no more; [`mod@crate::census`] pools runs;
//! - quasi-periodic: the largest exponent is zero within its error, no orbit up to
//!   the longest period tried closes, and Birkhoff averages converge as on a torus;
//! - undecided: anything else, with the numbers.
//!
//! Fails: a chaotic saddle whose lifetime is far above the budget is called chaotic
//! (with the bound); a torus with a nearly rational rotation number, or a drift too
//! slow for the budget, is left undecided.

mod approach;
mod batch_classify;
mod birkhoff;
mod candidates;
mod confirm;
mod run;
mod undecided;

use crate::lyapunov::{LyapunovOptions, LyapunovSpectrum};
use crate::map::StroboscopicMap;
use crate::orbit::{PeriodicOrbit, ShootingOptions};

pub(crate) use batch_classify::{Followed, follow_starts};
pub use birkhoff::birkhoff_digits;
pub use candidates::{Candidate, candidate_periods};
pub(crate) use confirm::close_exactly;
use confirm::confirm;
pub(crate) use run::{KnownMotions, RECOGNISABLE, RunEnd, first_entry, follow_start, watch};
pub use undecided::UndecidedReason;

/// Budgets of [`classify`].
#[derive(Clone, Debug, PartialEq)]
pub struct ClassifyOptions {
    /// Longest period tried at every look.
    pub max_period: usize,
    /// Longest period tried where none of these closed the motion, before it is called
    /// anything but periodic.
    pub long_period: usize,
    /// Periods after which it is looked for the first time where the motion goes. Fewer do where
    /// it starts near its end, as on a neighbour's orbit.
    pub first_look: usize,
    /// Periods after which exponents start to be measured (looking for periodic
    /// orbits goes on).
    pub max_transient: usize,
    /// A state with an entry above this is called unbounded.
    pub bound: f64,
    /// Newton's options for closing candidates.
    pub shooting: ShootingOptions,
    /// How long exponents are measured; `max_periods` is the budget of a motion that
    /// never closes.
    pub lyapunov: LyapunovOptions,
    /// Length of one weighted Birkhoff stretch; two are run.
    pub birkhoff_periods: usize,
    /// Digits to which the two stretches must agree for a torus.
    pub torus_digits: f64,
    /// Steps of time integration after which a run is left undecided, as the map counts them
    /// ([`StroboscopicMap::cost`]).
    pub max_steps: u64,
}

impl Default for ClassifyOptions {
    fn default() -> Self {
        Self {
            max_period: 64,
            long_period: 512,
            first_look: 16,
            max_transient: 1024,
            bound: 1e8,
            shooting: ShootingOptions {
                max_iterations: 20,
                ..ShootingOptions::default()
            },
            lyapunov: LyapunovOptions::default(),
            birkhoff_periods: 8192,
            torus_digits: 7.0,
            max_steps: 40_000_000,
        }
    }
}

/// Residual, relative to the orbit, of Newton's method on a coarse map, whose steps change in number
/// from state to state.
const COARSE_RESIDUAL: f64 = 1e-5;

impl ClassifyOptions {
    /// The same budgets on a coarse map.
    #[must_use]
    pub fn on_coarse_map(&self) -> Self {
        let residual = self.shooting.residual_tolerance.max(COARSE_RESIDUAL);
        Self {
            shooting: ShootingOptions {
                residual_tolerance: residual,
                ..self.shooting.clone()
            },
            ..self.clone()
        }
    }
}

/// What the motion from a start was found to be.
#[derive(Clone, Debug)]
pub struct Classified {
    /// What the motion is.
    pub kind: MotionKind,
    /// Periods run until that was known.
    pub periods: usize,
    /// The state there.
    pub state: Vec<f64>,
    /// Stable orbits that Newton closed on the way and that the motion does not go to:
    /// attractors too, of other starts.
    pub met: Vec<PeriodicOrbit>,
}

/// What a motion is.
#[derive(Clone, Debug)]
pub enum MotionKind {
    /// It goes to this stable orbit.
    Periodic(PeriodicOrbit),
    /// It was chaotic for a while and then went to this stable orbit.
    TransientChaos {
        /// Where it went.
        orbit: PeriodicOrbit,
        /// The exponents before it escaped, on the map that was followed.
        spectrum: LyapunovSpectrum,
        /// Periods after which the escape was noticed (looks are a factor 2 apart).
        lasted: usize,
    },
    /// It fills a torus.
    QuasiPeriodic(Torus),
    /// It is chaotic for as long as it was watched.
    Chaotic(Chaos),
    /// It left every bound.
    Unbounded,
    /// None of these could be shown.
    Undecided {
        /// Why not.
        reason: UndecidedReason,
        /// Exponents, if they were measured.
        spectrum: Option<LyapunovSpectrum>,
    },
}

/// Evidence for a quasi-periodic motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Torus {
    /// Exponents; the largest is zero within its error.
    pub spectrum: LyapunovSpectrum,
    /// Digits to which weighted Birkhoff averages of two stretches agree.
    pub birkhoff_digits: f64,
    /// Smallest closure found over all periods tried, in units of the state.
    pub nearest_return: f64,
    /// Periods run.
    pub observed: usize,
    /// No orbit of a period up to this one closed.
    pub longest_period: usize,
}

/// Evidence for a chaotic motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Chaos {
    /// Exponents; the largest is positive by more than five standard errors.
    pub spectrum: LyapunovSpectrum,
    /// Periods without escape, the transient included.
    pub observed: usize,
    /// Mean lifetime in periods that this one run bounds from below at 95 %.
    pub lifetime_above: f64,
    /// No stable orbit of a period up to this one was approached.
    pub longest_period: usize,
}

impl Chaos {
    /// On a motion of this spectrum for so many periods.
    pub(crate) fn of(
        spectrum: LyapunovSpectrum,
        periods: usize,
        options: &ClassifyOptions,
    ) -> Self {
        let mut chaos = Self {
            spectrum,
            observed: 0,
            lifetime_above: 0.0,
            longest_period: options.long_period.max(options.max_period),
        };
        chaos.watched(periods);
        chaos
    }

    /// Seen for so many periods in all: what happens with probability 1/τ a period and did not
    /// happen in T of them has τ > T/3 at 95 %.
    pub(crate) fn watched(&mut self, periods: usize) {
        self.observed = periods;
        self.lifetime_above = periods as f64 / 3.0;
    }
}

/// Follows the motion from `start` until it can be named, within the budgets. Where the map has a
/// [coarse](StroboscopicMap::coarse) one, the transient is followed on that, and the map itself
/// confirms what it comes to.
pub fn classify<M: StroboscopicMap>(
    map: &mut M,
    start: &[f64],
    options: &ClassifyOptions,
) -> Classified {
    classify_beside(map, start, &[], options)
}

/// As [`classify`], where chaotic motions of the map are known: a run from which neighbours part,
/// and whose strobe states have the means of one of them, is taken to be on it and has its
/// exponents. It is watched no less long than one whose exponents are measured.
pub fn classify_beside<M: StroboscopicMap>(
    map: &mut M,
    start: &[f64],
    chaos: &[LyapunovSpectrum],
    options: &ClassifyOptions,
) -> Classified {
    let known = KnownMotions {
        chaos,
        ..KnownMotions::default()
    };
    let Some(mut coarse) = map.coarse() else {
        return classify_on(map, start, known, options);
    };
    let found = classify_on(&mut coarse, start, known, &options.on_coarse_map());
    confirm(map, found, start, known, options)
}

/// As [`classify_beside`], on the given map alone. No neighbourhood is `known`.
pub(crate) fn classify_on<M: StroboscopicMap>(
    map: &mut M,
    start: &[f64],
    known: KnownMotions<'_>,
    options: &ClassifyOptions,
) -> Classified {
    let mut end = ended(follow_start(map, start, known, options), start);
    if let MotionKind::Chaotic(found) = &mut end.kind
        && known.chaos.contains(&found.spectrum)
    {
        let measured = &options.lyapunov;
        let least = options.max_transient + measured.alignment + measured.min_periods;
        let more = least.saturating_sub(end.periods);
        match watch(map, &end.state, known, more, options) {
            Ok(state) => {
                end.state = state;
                end.periods += more;
                found.watched(end.periods);
            }
            Err(other) => {
                let other = ended(other, start);
                return Classified {
                    periods: end.periods + other.periods,
                    ..other
                };
            }
        }
    }
    end
}

/// What a run that knows no neighbourhood of an orbit ended with.
fn ended(end: RunEnd, start: &[f64]) -> Classified {
    match end {
        RunEnd::Classified(end) => *end,
        // No neighbourhood was given, so none can have been entered.
        RunEnd::Entered { periods, .. } => Classified {
            kind: MotionKind::Undecided {
                reason: UndecidedReason::Cancelled,
                spectrum: None,
            },
            periods,
            state: start.to_vec(),
            met: Vec::new(),
        },
    }
}
