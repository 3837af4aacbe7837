//! Where one start settles.
//!
//! The run is looked at after 16, 32, 64, … periods. Each time the best candidate
//! periods go to Newton; a closed orbit counts only if its multipliers are stable
//! *and* the run is seen to approach it at the rate those multipliers say, in the
//! norm in which every linear motion near the orbit contracts at each return. So the
//! transient is as long as the motion needs, a slow decay towards a weakly stable
//! orbit is recognised for what it is (Newton jumps to its end), and no tolerance on
//! how nearly the run repeats ever decides.
//!
//! What does not close is measured on: Lyapunov spectrum with error bars, still
//! looking for an escape, then weighted Birkhoff averages. The verdicts:
//!
//! - periodic: closed, stable, approached;
//! - transient chaos: the exponents were positive by more than five standard errors,
//!   and then the run escaped to a periodic orbit;
//! - chaotic: positive by more than five standard errors to the end. One run of T
//!   periods without escape says that the mean lifetime is above T/3 at 95 %
//!   (exponential lifetimes: e⁻³ ≈ 0.05) and no more; [`mod@crate::census`] pools runs;
//! - quasi-periodic: the largest exponent is zero within its error, no orbit up to
//!   the longest period tried closes, and Birkhoff averages converge as on a torus;
//! - undecided: anything else, with the numbers.
//!
//! Fails: a chaotic saddle whose lifetime is far above the budget is called chaotic
//! (with the bound); a torus with a nearly rational rotation number, or a drift too
//! slow for the budget, is left undecided.

use nalgebra::DMatrix;

use crate::adapted_norm::AdaptedNorm;
use crate::birkhoff::birkhoff_digits;
use crate::failure::{MapFailure, advance, advance_with_jacobian};
use crate::lyapunov::{LyapunovOptions, LyapunovRun, LyapunovSpectrum};
use crate::map::StroboscopicMap;
use crate::neighbourhood::Neighbourhood;
use crate::orbit::PeriodicOrbit;
use crate::period::candidate_periods;
use crate::shooting::{ShootingOptions, close_orbit_from_points};
use crate::vector::{distance, norm};

/// Standard errors by which a positive exponent must clear zero.
const CLEAR: f64 = 5.0;
/// Longest of the four stretches of returns over which the approach to a weakly
/// stable orbit is watched.
const LONGEST_WINDOW: f64 = 512.0;

/// Budgets of [`settle`].
#[derive(Clone, Debug, PartialEq)]
pub struct SettleOptions {
    /// Longest period tried.
    pub max_period: usize,
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
}

impl Default for SettleOptions {
    fn default() -> Self {
        Self {
            max_period: 64,
            max_transient: 1024,
            bound: 1e8,
            shooting: ShootingOptions {
                max_iterations: 20,
                ..ShootingOptions::default()
            },
            lyapunov: LyapunovOptions::default(),
            birkhoff_periods: 8192,
            torus_digits: 7.0,
        }
    }
}

/// Where a start settled.
#[derive(Clone, Debug)]
pub struct Settled {
    /// What the motion is.
    pub verdict: Verdict,
    /// Periods run up to the verdict.
    pub periods: usize,
    /// The state there.
    pub state: Vec<f64>,
}

/// What a motion is.
#[derive(Clone, Debug)]
pub enum Verdict {
    /// It goes to this stable orbit.
    Periodic(PeriodicOrbit),
    /// It was chaotic for a while and then went to this stable orbit.
    TransientChaos {
        /// Where it went.
        orbit: PeriodicOrbit,
        /// The exponents before it escaped.
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
}

/// Why a motion was left undecided.
#[derive(Clone, Debug, thiserror::Error)]
pub enum UndecidedReason {
    /// The start does not fit the map.
    #[error("bad start: {0}")]
    BadStart(String),
    /// The map could not be followed.
    #[error("after {periods} periods: {failure}")]
    Map {
        /// Periods run.
        periods: usize,
        /// What failed.
        failure: MapFailure,
    },
    /// The run sits on an orbit that does not attract.
    #[error(
        "the run sits on a period-{} orbit that does not attract (largest |multiplier| {:.9})",
        .0.period, .0.spectral_radius()
    )]
    OnOrbitThatDoesNotAttract(Box<PeriodicOrbit>),
    /// It repeats, but the orbit is not isolated.
    #[error(
        "the motion repeats after {period} periods (to {closure:.1e}), but the orbit is not isolated"
    )]
    NotIsolated {
        /// Period.
        period: usize,
        /// How nearly it repeats.
        closure: f64,
    },
    /// Largest exponent negative, but nothing closed.
    #[error(
        "the largest exponent is negative ({exponent:.3e} ± {error:.1e} per period), but no orbit of period up to {max_period} closed"
    )]
    NothingCloses {
        /// Largest exponent.
        exponent: f64,
        /// Its standard error.
        error: f64,
        /// Longest period tried.
        max_period: usize,
    },
    /// The exponent is zero within errors, but averages do not converge as on a torus.
    #[error(
        "the largest exponent is zero within errors ({exponent:.3e} ± {error:.1e} per period), but Birkhoff averages agree to {digits:.1} digits only"
    )]
    NeitherTorusNorChaos {
        /// Largest exponent.
        exponent: f64,
        /// Its standard error.
        error: f64,
        /// Digits of agreement.
        digits: f64,
    },
    /// The work was stopped before this start was done.
    #[error("stopped before it was done")]
    Cancelled,
}

/// Follows the motion from `start` until it can be named, within the budgets.
pub fn settle<M: StroboscopicMap>(map: &mut M, start: &[f64], options: &SettleOptions) -> Settled {
    match arrive(map, start, &[], options) {
        Arrival::Settled(settled) => *settled,
        // No neighbourhood was given, so none can have been entered.
        Arrival::Entered { periods, .. } => Settled {
            verdict: Verdict::Undecided {
                reason: UndecidedReason::Cancelled,
                spectrum: None,
            },
            periods,
            state: start.to_vec(),
        },
    }
}

/// Where a start arrives when some attractors are known already.
#[derive(Clone, Debug)]
pub(crate) enum Arrival {
    /// In the neighbourhood of a known attractor, after so many periods.
    Entered {
        index: usize,
        periods: usize,
    },
    Settled(Box<Settled>),
}

pub(crate) fn arrive<M: StroboscopicMap>(
    map: &mut M,
    start: &[f64],
    known: &[Neighbourhood],
    options: &SettleOptions,
) -> Arrival {
    let d = map.dimension();
    let bad = if start.len() != d || d == 0 {
        Some(format!("{} numbers given, {d} needed", start.len()))
    } else {
        start
            .iter()
            .find(|v| !v.is_finite())
            .map(|v| format!("{v} is not finite"))
    };
    if let Some(reason) = bad {
        return Arrival::Settled(Box::new(Settled {
            verdict: undecided(UndecidedReason::BadStart(reason), None),
            periods: 0,
            state: start.to_vec(),
        }));
    }
    let mut run = Run::new(start, known, options);
    let verdict = match run.follow(map) {
        Ok(verdict) => verdict,
        Err(Stop::Entered(index)) => {
            return Arrival::Entered {
                index,
                periods: run.periods,
            };
        }
        Err(Stop::Unbounded) => Verdict::Unbounded,
        Err(Stop::Failed(failure)) => undecided(
            UndecidedReason::Map {
                periods: run.periods,
                failure,
            },
            None,
        ),
    };
    Arrival::Settled(Box::new(Settled {
        verdict,
        periods: run.periods,
        state: run.state,
    }))
}

fn undecided(reason: UndecidedReason, spectrum: Option<LyapunovSpectrum>) -> Verdict {
    Verdict::Undecided { reason, spectrum }
}

/// Why following a start ended early.
enum Stop {
    Entered(usize),
    Unbounded,
    Failed(MapFailure),
}

impl From<MapFailure> for Stop {
    fn from(failure: MapFailure) -> Self {
        Self::Failed(failure)
    }
}

/// One start on its way.
struct Run<'a> {
    d: usize,
    state: Vec<f64>,
    scratch: Vec<f64>,
    periods: usize,
    /// The latest strobe states, oldest first, at least the last `2 max_period`.
    recent: Vec<f64>,
    keep: usize,
    known: &'a [Neighbourhood],
    options: &'a SettleOptions,
}

impl<'a> Run<'a> {
    fn new(start: &[f64], known: &'a [Neighbourhood], options: &'a SettleOptions) -> Self {
        let keep = (2 * options.max_period).max(16) * start.len();
        let mut recent = Vec::with_capacity(4 * keep + start.len());
        recent.extend_from_slice(start);
        Self {
            d: start.len(),
            state: start.to_vec(),
            scratch: start.to_vec(),
            periods: 0,
            recent,
            keep,
            known,
            options,
        }
    }

    fn follow<M: StroboscopicMap>(&mut self, map: &mut M) -> Result<Verdict, Stop> {
        let mut target = 16;
        loop {
            let target_now = target.min(self.options.max_transient);
            while self.periods < target_now {
                self.step(map)?;
            }
            if let Some(verdict) = self.look(map)? {
                return Ok(verdict);
            }
            if target >= self.options.max_transient {
                break;
            }
            target *= 2;
        }
        self.measure(map)
    }

    fn step<M: StroboscopicMap>(&mut self, map: &mut M) -> Result<(), Stop> {
        // A motion that runs off ends in an overflow; that is its verdict.
        match advance(map, &mut self.state) {
            Err(MapFailure::NotFinite) => return Err(Stop::Unbounded),
            other => other?,
        }
        self.arrived(map)
    }

    /// Bookkeeping after every period: history, bounds, known neighbourhoods.
    #[inline]
    fn arrived<M: StroboscopicMap>(&mut self, map: &mut M) -> Result<(), Stop> {
        self.periods += 1;
        if self.recent.len() >= 4 * self.keep {
            let cut = self.recent.len() - self.keep;
            self.recent.copy_within(cut.., 0);
            self.recent.truncate(self.keep);
        }
        self.recent.extend_from_slice(&self.state);
        if norm(&self.state) > self.options.bound {
            return Err(Stop::Unbounded);
        }
        for (index, neighbourhood) in self.known.iter().enumerate() {
            if neighbourhood.contains(&self.state)
                && neighbourhood.holds(map, &self.state, &mut self.scratch)?
            {
                return Err(Stop::Entered(index));
            }
        }
        Ok(())
    }

    /// Tries to close the motion; a verdict if it goes to a stable orbit or sits on
    /// another.
    fn look<M: StroboscopicMap>(&self, map: &mut M) -> Result<Option<Verdict>, Stop> {
        Ok(self.close(map)?.map(|orbit| {
            if orbit.is_stable() {
                Verdict::Periodic(orbit)
            } else {
                undecided(
                    UndecidedReason::OnOrbitThatDoesNotAttract(Box::new(orbit)),
                    None,
                )
            }
        }))
    }

    fn close<M: StroboscopicMap>(&self, map: &mut M) -> Result<Option<PeriodicOrbit>, Stop> {
        let d = self.d;
        let candidates = candidate_periods(&self.recent, d, self.options.max_period);
        let mut periods: Vec<usize> = candidates.iter().take(3).map(|c| c.period).collect();
        if !periods.contains(&1) {
            periods.push(1);
        }
        let mut guesses: Vec<(usize, Vec<f64>)> = periods
            .into_iter()
            .filter(|n| n * d <= self.recent.len())
            .map(|n| (n, self.recent[self.recent.len() - n * d..].to_vec()))
            .collect();
        // A slow spiral around a fixed point has its centre at the mean.
        guesses.push((1, self.recent_mean()));
        let mut tried: Vec<PeriodicOrbit> = Vec::new();
        for (period, points) in guesses {
            let Ok(orbit) = close_orbit_from_points(map, &points, period, &self.options.shooting)
            else {
                continue;
            };
            if tried.iter().any(|t| t.is_same_as(&orbit)) {
                continue;
            }
            let accepted = if orbit.is_stable() {
                approaches(map, &self.state, &orbit)?
            } else {
                orbit
                    .states
                    .iter()
                    .any(|x| distance(x, &self.state) <= 10.0 * orbit.error)
            };
            if accepted {
                return Ok(Some(orbit));
            }
            tried.push(orbit);
        }
        Ok(None)
    }

    fn recent_mean(&self) -> Vec<f64> {
        let rows = self.recent.chunks_exact(self.d);
        let window = rows.len().min(2 * self.options.max_period).max(1);
        let mut mean = vec![0.0; self.d];
        for row in rows.rev().take(window) {
            for (m, v) in mean.iter_mut().zip(row) {
                *m += v / window as f64;
            }
        }
        mean
    }

    /// Exponents of what does not close, looking for an escape after every doubling.
    fn measure<M: StroboscopicMap>(&mut self, map: &mut M) -> Result<Verdict, Stop> {
        let budget = &self.options.lyapunov;
        let mut exponents = LyapunovRun::new(self.d);
        for _ in 0..budget.alignment {
            self.step_with(map, &mut exponents)?;
        }
        let mut before: Option<LyapunovSpectrum> = None;
        let mut target = budget.min_periods.max(64);
        let spectrum = loop {
            while exponents.periods() < target {
                self.step_with(map, &mut exponents)?;
                exponents.record(&self.state);
            }
            if let Some(verdict) = self.look(map)? {
                return Ok(match (verdict, before.filter(is_chaotic)) {
                    (Verdict::Periodic(orbit), Some(spectrum)) => Verdict::TransientChaos {
                        orbit,
                        spectrum,
                        lasted: self.periods,
                    },
                    (verdict, _) => verdict,
                });
            }
            let spectrum = exponents.spectrum();
            if target >= budget.max_periods
                || (is_chaotic(&spectrum) && budget.is_met_by(&spectrum))
            {
                break spectrum;
            }
            before = Some(spectrum);
            target = (2 * target).min(budget.max_periods);
        };
        if is_chaotic(&spectrum) {
            return Ok(Verdict::Chaotic(Chaos {
                spectrum,
                observed: self.periods,
                lifetime_above: self.periods as f64 / 3.0,
            }));
        }
        self.torus(map, spectrum)
    }

    fn step_with<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        exponents: &mut LyapunovRun,
    ) -> Result<(), Stop> {
        match exponents.step(map, &mut self.state) {
            Err(MapFailure::NotFinite) => return Err(Stop::Unbounded),
            other => other?,
        }
        self.arrived(map)
    }

    /// A motion without a clearly positive exponent that did not close.
    fn torus<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        spectrum: LyapunovSpectrum,
    ) -> Result<Verdict, Stop> {
        let (exponent, error) = spectrum.largest();
        // The average of a bounded logarithm is off by its bound over the length.
        let zero = (3.0 * error).max(10.0 / spectrum.periods as f64);
        if exponent < -zero {
            return Ok(undecided(
                UndecidedReason::NothingCloses {
                    exponent,
                    error,
                    max_period: self.options.max_period,
                },
                Some(spectrum),
            ));
        }
        let nearest = candidate_periods(&self.recent, self.d, self.options.max_period)
            .first()
            .copied();
        let spread = self.recent_spread();
        if let Some(c) = nearest.filter(|c| c.closure <= 1e-9 * spread) {
            return Ok(undecided(
                UndecidedReason::NotIsolated {
                    period: c.period,
                    closure: c.closure,
                },
                Some(spectrum),
            ));
        }
        let digits = birkhoff_digits(map, &mut self.state, self.options.birkhoff_periods.max(16))?;
        self.periods += 2 * self.options.birkhoff_periods.max(16);
        if digits >= self.options.torus_digits && exponent <= zero {
            return Ok(Verdict::QuasiPeriodic(Torus {
                spectrum,
                birkhoff_digits: digits,
                nearest_return: nearest.map_or(f64::INFINITY, |c| c.closure),
            }));
        }
        Ok(undecided(
            UndecidedReason::NeitherTorusNorChaos {
                exponent,
                error,
                digits,
            },
            Some(spectrum),
        ))
    }

    fn recent_spread(&self) -> f64 {
        let origin = self.recent[..self.d].to_vec();
        self.recent
            .chunks_exact(self.d)
            .fold(0.0, |m: f64, row| m.max(distance(row, &origin)))
    }
}

/// A largest exponent positive beyond doubt: by more than five standard errors, and
/// with a total growth that no start of the frame explains.
fn is_chaotic(spectrum: &LyapunovSpectrum) -> bool {
    let (exponent, error) = spectrum.largest();
    exponent > CLEAR * error && exponent * spectrum.periods as f64 > 20.0
}

/// True if the run from `state` approaches the stable `orbit` as its multipliers
/// say: nearer by a factor 100 in the adapted norm or, for weak stability, with the
/// peaks of four stretches falling one after the other, at half the linear rate at
/// least. Peaks, because beside a flip or a Neimark–Sacker point the distance falls
/// only on average over the turns. Four stretches together are one decay time long,
/// or 2048 returns; a torus around the orbit that beats more slowly than that, and
/// happens to shrink meanwhile, would be mistaken.
pub(crate) fn approaches<M: StroboscopicMap>(
    map: &mut M,
    state: &[f64],
    orbit: &PeriodicOrbit,
) -> Result<bool, MapFailure> {
    let (d, n) = (state.len(), orbit.period);
    let mut monodromy = DMatrix::identity(d, d);
    let mut factor = DMatrix::zeros(d, d);
    let mut point = orbit.states[0].clone();
    for _ in 0..n {
        advance_with_jacobian(map, &mut point, &mut factor)?;
        monodromy = &factor * monodromy;
    }
    let Some(adapted) = AdaptedNorm::new(&monodromy, orbit.spectral_radius()) else {
        return Ok(false);
    };
    let center = &orbit.states[0];
    let nearest = (0..n)
        .min_by(|&a, &b| {
            distance(&orbit.states[a], state).total_cmp(&distance(&orbit.states[b], state))
        })
        .unwrap_or(0);
    let mut x = state.to_vec();
    for _ in 0..(n - nearest) % n {
        advance(map, &mut x)?;
    }
    let floor = adapted.floor(center, &point);
    let first = adapted.distance(&x, center);
    if first <= floor {
        return Ok(true);
    }
    let radius = orbit.spectral_radius();
    let window = (0.25 / -radius.ln()).ceil().clamp(16.0, LONGEST_WINDOW) as usize;
    let mut highest = [0.0f64; 4];
    for peak in &mut highest {
        for _ in 0..window {
            for _ in 0..n {
                advance(map, &mut x)?;
            }
            let now = adapted.distance(&x, center);
            if now <= floor || now <= 0.01 * first {
                return Ok(true);
            }
            if now > 4.0 * first {
                return Ok(false);
            }
            *peak = peak.max(now);
        }
    }
    let wanted = 1.5 * window as f64 * radius.ln();
    Ok(highest.windows(2).all(|w| w[1] < w[0]) && (highest[3] / highest[0]).ln() <= wanted)
}
