//! Classification of the motion from one start.
//!
//! The run is examined after 16, 32, 64, … periods ([`ClassifyOptions::first_look`]). Each time
//! Newton's method tries the best candidate periods. A closed orbit counts only if its multipliers
//! are stable *and* the run is seen to arrive at it, or to approach it at the rate of those
//! multipliers with a free way ahead, in the norm in which every linear motion near the orbit
//! contracts at each return. So the transient is as long as the motion needs, a slow decay towards
//! a weakly stable orbit is recognised (Newton's method jumps to its end), and no tolerance on how
//! nearly the run repeats ever decides.
//!
//! For a motion that does not close, the Lyapunov spectrum is measured with error bars, while
//! escapes are still searched for, and then weighted Birkhoff averages. A motion is called
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
pub(crate) use run::{
    KnownMotions, RECOGNISABLE, ResetRun, RunEnd, classify_reset, first_entry, follow_start, watch,
};
pub use undecided::UndecidedReason;

/// Limits and tolerances of [`classify`].
#[derive(Clone, Debug, PartialEq)]
pub struct ClassifyOptions {
    /// Longest period that is tried each time the run is examined, in drive periods.
    pub max_period: usize,
    /// Longest period, in drive periods, that is tried before a motion on which none of the shorter
    /// ones closed is called anything but periodic.
    pub long_period: usize,
    /// Drive periods after which the run is examined for the first time. Fewer suffice if it starts
    /// near its attractor, as on a neighbour's orbit.
    pub first_look: usize,
    /// Drive periods after which exponents start to be measured; the search for periodic orbits
    /// goes on.
    pub max_transient: usize,
    /// Largest entry of a bounded state, in units of the state; above it the motion is called
    /// unbounded.
    pub bound: f64,
    /// Options of Newton's method for closing candidates.
    pub shooting: ShootingOptions,
    /// Lengths and accuracy of the measurement of exponents; `max_periods` is the budget of a
    /// motion that never closes.
    pub lyapunov: LyapunovOptions,
    /// Length of one stretch of weighted Birkhoff averages, in drive periods; two are run.
    pub birkhoff_periods: usize,
    /// Number of decimal digits to which the averages of the two stretches must agree for a torus.
    pub torus_digits: f64,
    /// Steps of time integration after which a run is left undecided, as the map counts them
    /// ([`Scheduling::cost`](crate::Scheduling::cost)).
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

/// Residual, as a fraction of the orbit's scale, of Newton's method on a coarse map, whose number
/// of steps changes from state to state.
const COARSE_RESIDUAL: f64 = 1e-5;

impl ClassifyOptions {
    /// Returns the same options for a coarse map, with a residual that it can reach.
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

/// Result of the classification of the motion from one start.
#[derive(Clone, Debug)]
pub struct Classified {
    /// Kind of the motion, with the evidence for it.
    pub kind: MotionKind,
    /// Drive periods run until that was known.
    pub periods: usize,
    /// State after these periods, at drive phase 0, in units of the state.
    pub state: Vec<f64>,
    /// Stable orbits that Newton's method closed on the way and to which this motion does not go:
    /// they attract other starts.
    pub met: Vec<PeriodicOrbit>,
}

/// Kind of a motion, with the evidence for it.
#[derive(Clone, Debug)]
pub enum MotionKind {
    /// It goes to a stable periodic orbit.
    Periodic(PeriodicOrbit),
    /// It was chaotic for a while and then went to a stable periodic orbit.
    TransientChaos {
        /// The stable orbit to which it escaped.
        orbit: PeriodicOrbit,
        /// Lyapunov exponents before it escaped, on the map that was followed.
        spectrum: LyapunovSpectrum,
        /// Drive periods after which the escape was noticed; the checks are a factor 2 apart.
        lasted: usize,
    },
    /// It is quasi-periodic: it fills a torus.
    QuasiPeriodic(Torus),
    /// It is chaotic for as long as it was observed.
    Chaotic(Chaos),
    /// A state exceeded the bound or overflowed.
    Unbounded,
    /// None of these could be shown.
    Undecided {
        /// The reason why none could be shown.
        reason: UndecidedReason,
        /// Lyapunov exponents, if they were measured.
        spectrum: Option<LyapunovSpectrum>,
    },
}

/// Evidence for a quasi-periodic motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Torus {
    /// Lyapunov exponents; the largest is zero within its error.
    pub spectrum: LyapunovSpectrum,
    /// Number of decimal digits to which weighted Birkhoff averages of two stretches agree.
    pub birkhoff_digits: f64,
    /// Smallest closure over all periods tried, in units of the state: the largest distance between
    /// two recent states one period apart.
    pub nearest_return: f64,
    /// Drive periods run, the transient included.
    pub observed: usize,
    /// No orbit of a period up to this one (in drive periods) closed.
    pub longest_period: usize,
}

/// Evidence for a chaotic motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Chaos {
    /// Lyapunov exponents; the largest is positive by more than five standard errors.
    pub spectrum: LyapunovSpectrum,
    /// Drive periods without escape, the transient included.
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
/// [coarse](crate::Scheduling::coarse) one, the transient is followed on that, and the map itself
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

/// As [`classify`], on the map itself from the start on: where it matters to which of several
/// motions a start close to a basin's boundary leads.
pub fn classify_exactly<M: StroboscopicMap>(
    map: &mut M,
    start: &[f64],
    options: &ClassifyOptions,
) -> Classified {
    classify_on(map, start, KnownMotions::default(), options)
}

/// As [`classify_beside`], on the given map alone. No neighbourhood is `known`.
pub(crate) fn classify_on<M: StroboscopicMap>(
    map: &mut M,
    start: &[f64],
    known: KnownMotions<'_>,
    options: &ClassifyOptions,
) -> Classified {
    let mut end = match ended(follow_start(map, start, known, options), start) {
        Ok(end) => end,
        Err(reset) => return after_reset(map, *reset, known, options),
    };
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
                let mut other = match ended(other, start) {
                    Ok(other) => other,
                    Err(mut reset) => {
                        reset.chaos.get_or_insert_with(|| found.spectrum.clone());
                        after_reset(map, *reset, known, options)
                    }
                };
                other.periods += end.periods;
                if let MotionKind::TransientChaos { lasted, .. } = &mut other.kind {
                    *lasted += end.periods;
                }
                return other;
            }
        }
    }
    end
}

/// Classifies a motion that was reset: it comes to what follows every reset.
pub(crate) fn after_reset<M: StroboscopicMap>(
    map: &mut M,
    reset: ResetRun,
    known: KnownMotions<'_>,
    options: &ClassifyOptions,
) -> Classified {
    let mut end = classify_reset(map, known, options);
    end.periods += reset.periods;
    end.met.extend(reset.met);
    if let (MotionKind::Periodic(orbit), Some(spectrum)) = (&end.kind, reset.chaos) {
        end.kind = MotionKind::TransientChaos {
            orbit: orbit.clone(),
            spectrum,
            lasted: reset.periods,
        };
    }
    end
}

/// What a run that knows no neighbourhood of an orbit ended with; `Err` if it was reset.
fn ended(end: RunEnd, start: &[f64]) -> Result<Classified, Box<ResetRun>> {
    Ok(match end {
        RunEnd::Classified(end) => *end,
        RunEnd::Reset(reset) => return Err(reset),
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
    })
}
