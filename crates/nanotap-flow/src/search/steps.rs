//! Certified steps towards the first zero, and the finish.

use std::marker::PhantomData;

use super::{Crossing, Start, Statistics};
use crate::signal::{Enclosure, Jet, Signal};
use crate::simd::{Simd, Work};

/// A search by certified steps alone.
pub(crate) struct BySteps<'a> {
    pub(crate) signal: &'a Signal,
    /// How long the stretch can be: what times are measured against.
    pub(crate) length: f64,
    /// From where it is searched; if beyond zero, the signal is positive there.
    pub(crate) from: f64,
    /// Up to where it is searched.
    pub(crate) limit: f64,
    /// How it starts at zero.
    pub(crate) start: Start,
    pub(crate) statistics: &'a mut Statistics,
}

impl Work for BySteps<'_> {
    type Output = Option<Crossing>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Option<Crossing> {
        let mut search = Search {
            signal: self.signal,
            length: self.length,
            limit: self.limit,
            noise: self.signal.noise(),
            statistics: self.statistics,
            arithmetic: PhantomData::<S>,
        };
        if self.from > 0.0 {
            let jet = search.jet(self.from);
            search.run(self.from, jet)
        } else {
            search.from(self.start)
        }
    }
}

enum Departure {
    Crossing(Crossing),
    Inside(f64, Jet),
}

struct Search<'a, S> {
    signal: &'a Signal,
    /// How long the segment can be: what times are measured against.
    length: f64,
    /// Up to where it is searched.
    limit: f64,
    noise: f64,
    statistics: &'a mut Statistics,
    arithmetic: PhantomData<S>,
}

/// Dips shallower than this many rounding errors are measured in twice double precision.
const SHALLOW: f64 = 1e5;

/// Steps in a row that may be below rounding before they grow.
const PATIENCE: u32 = 64;

/// Orders of the Taylor series used right after a switch.
const TAYLOR_ORDER: usize = 10;
/// Its reach, as an angle of the fastest term.
const TAYLOR_REACH: f64 = 0.25;

impl<S: Simd> Search<'_, S> {
    #[inline(always)]
    fn jet(&mut self, s: f64) -> Jet {
        self.statistics.evaluations += 1;
        self.signal.jet_with::<S>(s)
    }

    #[inline(always)]
    fn enclosure(&mut self, s: f64) -> Enclosure {
        self.statistics.evaluations += 1;
        self.signal.enclosure::<S>(s)
    }

    #[inline(always)]
    fn from(&mut self, start: Start) -> Option<Crossing> {
        let departure = match start {
            Start::Inside => {
                self.statistics.evaluations += 1;
                Departure::Inside(0.0, self.signal.first_jet())
            }
            Start::Surface { rate } => self.leave_surface(1, rate),
            Start::Release => self.leave_surface(3, None),
            Start::Flat {
                vanishing,
                derivative,
            } => {
                self.statistics.evaluations += 1;
                self.taylor_departure(vanishing, Some(derivative))
            }
        };
        match departure {
            Departure::Crossing(crossing) => Some(crossing),
            Departure::Inside(s, jet) => self.run(s, jet),
        }
    }

    #[inline(always)]
    fn run(&mut self, mut s: f64, mut jet: Jet) -> Option<Crossing> {
        let mut relaxed = [Jet::default(); 2];
        let mut stuck = 0_u32;
        loop {
            let left = self.limit - s;
            if left.is_nan() || left < 0.0 {
                return None;
            }
            if jet.value <= 0.0
                && let Some(crossing) = self.at_or_below_zero(s, &mut jet)
            {
                return Some(crossing);
            }
            let zero = parabola_zero(jet.value, jet.rate, jet.curvature);
            if let Some(reach) = certain_crossing(&jet, zero, self.noise) {
                return self.polish(s, jet, s + reach);
            }
            if let Some(distance) = self.unresolved_tangency(&jet) {
                match self.tangency(s + distance) {
                    Departure::Crossing(crossing) => {
                        return (crossing.at <= self.limit).then_some(crossing);
                    }
                    Departure::Inside(at, after) if at > s => {
                        s = at;
                        jet = after;
                        relaxed = [Jet::default(); 2];
                    }
                    // All rounding: the steps go on.
                    Departure::Inside(..) => {}
                }
            }
            let mut step = certified_step(&jet, zero);
            for lower in &relaxed {
                if lower.value > 0.0 {
                    let zero = parabola_zero(lower.value, lower.rate, lower.curvature);
                    step = step.max(certified_step(lower, zero));
                }
            }
            self.statistics.steps += 1;
            if step >= self.limit - s {
                return None;
            }
            // Steps below rounding would never end. The value there is decided in twice double
            // precision; where it stays within rounding of zero for long, they grow.
            let least = 4.0 * f64::EPSILON * self.length;
            if step >= least {
                stuck = 0;
                s += step;
            } else {
                stuck += 1;
                s += least
                    * nanotap_arithmetic::exp2(f64::from(stuck.saturating_sub(PATIENCE).min(40)));
            }
            Enclosure { jet, relaxed } = self.enclosure(s);
        }
    }

    /// The value came out as zero or less although no crossing was certain:
    /// rounding, or a crossing within it.
    #[cold]
    fn at_or_below_zero(&mut self, s: f64, jet: &mut Jet) -> Option<Crossing> {
        let value = self.signal.accurate_at(s);
        self.statistics.tangencies += 1;
        if value > 0.0 {
            jet.value = value;
            return None;
        }
        // A dip that began and was not seen as a tangency, or the start itself.
        Some(Crossing {
            at: s,
            rate: jet.rate.min(0.0),
            grazing: jet.rate.abs() < self.noise.sqrt(),
            refined: false,
        })
    }

    /// The distance to a minimum whose depth is close to the rounding of plain sums.
    fn unresolved_tangency(&self, jet: &Jet) -> Option<f64> {
        if jet.rate >= 0.0 || jet.curvature <= 0.0 {
            return None;
        }
        let distance = -jet.rate / jet.curvature;
        let minimum = jet.value + 0.5 * jet.rate * distance;
        let quadratic = jet.third * distance < 0.2 * jet.curvature;
        let known = jet.third * distance.powi(3) < self.noise.max(0.125 * minimum.abs());
        (quadratic && known && minimum.abs() <= SHALLOW * self.noise).then_some(distance)
    }

    /// Decides a tangency near `s`: a miss continues from the minimum with its
    /// true value, a touch crosses where the parabola through the minimum does.
    #[cold]
    fn tangency(&mut self, mut s: f64) -> Departure {
        let mut jet = self.jet(s);
        for _ in 0..8 {
            let step = -jet.rate / jet.curvature;
            if step.is_nan() || step.abs() <= f64::EPSILON * self.length {
                break;
            }
            s += step;
            jet = self.jet(s);
        }
        self.statistics.tangencies += 1;
        jet.value = self.signal.accurate_at(s);
        jet.rate = 0.0;
        if jet.value >= 0.0 {
            return Departure::Inside(s, jet);
        }
        // Zero of the parabola through the minimum, then the cubic's correction to it.
        let curvature = jet.curvature;
        let half_width = (-2.0 * jet.value / curvature).sqrt();
        let third = self.signal.shifted(s, 1.0, 0.0).derivative_at_start(3);
        let h = -half_width * (1.0 + third * half_width / (6.0 * curvature));
        let rate = (h * (curvature + 0.5 * third * h)).min(0.0);
        let grazing = jet.value.abs() <= 4.0 * self.noise;
        Departure::Crossing(Crossing {
            at: s + h,
            rate,
            grazing,
            refined: true,
        })
    }

    /// The unique zero in `(s, high]`, by Newton–Halley steps kept inside the bracket.
    #[inline(always)]
    fn polish(&mut self, s: f64, jet: Jet, high: f64) -> Option<Crossing> {
        let tolerance = RESOLUTION * self.length;
        let (mut low, mut high) = (s, high);
        let (mut at, mut jet) = (s, jet);
        for _ in 0..200 {
            let mut step = quadratic_root(&jet);
            if !(at + step >= low && at + step <= high) {
                step = 0.5 * (low + high) - at;
            } else if let Some(crossing) = last_step(&jet, at, self.length, self.noise) {
                return (crossing.at <= self.limit).then_some(crossing);
            }
            at += step;
            if high - low <= tolerance {
                return (at <= self.limit).then_some(Crossing {
                    at,
                    rate: (jet.rate + jet.curvature * step).min(0.0),
                    grazing: false,
                    refined: false,
                });
            }
            if low > self.limit {
                return None;
            }
            jet = self.jet(at);
            if jet.value > 0.0 { low = at } else { high = at }
        }
        (at <= self.limit).then_some(Crossing {
            at,
            rate: jet.rate.min(0.0),
            grazing: false,
            refined: false,
        })
    }

    /// Leaves the surface on which the signal's first `vanishing` derivatives
    /// (counting the value) are zero by definition.
    #[inline(always)]
    fn leave_surface(&mut self, vanishing: usize, rate: Option<f64>) -> Departure {
        self.statistics.evaluations += 1;
        let mut first = self.signal.first_jet();
        first.value = 0.0;
        first.rate = rate.unwrap_or(first.rate);
        if vanishing == 1 && first.rate > 0.0 {
            // The common case: fast departure, the next zero far away. The cubic's
            // first zero is a certified step, divided by h since g(0) = 0.
            let step = step_from_surface(&first);
            if step * self.signal.fastest() >= TAYLOR_REACH {
                self.statistics.steps += 1;
                let step = step.min(self.limit);
                return Departure::Inside(step, self.jet(step));
            }
        }
        self.taylor_departure(vanishing, rate)
    }

    #[cold]
    fn taylor_departure(&mut self, vanishing: usize, first: Option<f64>) -> Departure {
        let reach = (TAYLOR_REACH / self.signal.fastest()).min(self.length);
        let mut derivatives = [0.0; TAYLOR_ORDER + 1];
        for (order, d) in derivatives.iter_mut().enumerate().skip(vanishing) {
            *d = self.signal.derivative_at_start(order as u32);
        }
        if let Some(first) = first {
            derivatives[vanishing] = first;
        }
        let mut vanishing = vanishing;
        while vanishing < TAYLOR_ORDER && derivatives[vanishing] == 0.0 {
            vanishing += 1;
        }
        if derivatives[vanishing] < 0.0 {
            // It does not leave at all: it falls back at once.
            let rate = if vanishing == 1 { derivatives[1] } else { 0.0 };
            return Departure::Crossing(Crossing {
                at: 0.0,
                rate,
                grazing: vanishing > 1,
                refined: false,
            });
        }
        // p(h) = g(h) / h^v · …, positive at 0; its coefficients.
        let mut coefficients = [0.0; TAYLOR_ORDER + 1];
        let mut factorial = 1.0;
        for order in 1..=TAYLOR_ORDER {
            factorial *= order as f64;
            if order >= vanishing {
                coefficients[order - vanishing] = derivatives[order] / factorial;
            }
        }
        let p = &coefficients[..=TAYLOR_ORDER - vanishing];
        let remainder_order = TAYLOR_ORDER as u32 + 1;
        let remainder = self.signal.derivative_bound(remainder_order, self.length)
            / (factorial * f64::from(remainder_order))
            * reach.powi(remainder_order as i32 - vanishing as i32);
        if let Some(h) = first_polynomial_zero(p, reach, remainder) {
            // g = h^v p(h), so ġ = h^v p'(h) at the zero of p.
            let (_, slope, _) = polynomial_jet(p, h);
            let rate = (h.powi(vanishing as i32) * slope).min(0.0);
            return Departure::Crossing(Crossing {
                at: h,
                rate,
                grazing: false,
                refined: false,
            });
        }
        let mut jet = self.jet(reach);
        // The Taylor value keeps its relative accuracy where plain sums drown.
        let value = polynomial_jet(p, reach).0 * reach.powi(vanishing as i32);
        if value > 0.0 {
            jet.value = value;
        }
        Departure::Inside(reach, jet)
    }
}

/// Length up to which the lower cubic `g + vh + ½ch² − ⅙bh³` stays positive, for certain.
///
/// Up to any reach `H` the cubic lies above the parabola with curvature `c − bH/3`, so
/// a step is certified when it is within `H` and before that parabola's first zero.
/// A few good choices of `H` cost a square root each and need no iteration.
/// `free` is the zero of the parabola `g + vh + ½ch²`.
#[inline]
fn certified_step(jet: &Jet, free: f64) -> f64 {
    let (g, v, c, b) = (jet.value, jet.rate, jet.curvature, jet.third);
    if b <= 0.0 {
        return free * SAFE;
    }
    let within = |reach: f64| reach.min(parabola_zero(g, v, c - b * reach / 3.0));
    let mut step = 0.0_f64;
    if free.is_finite() {
        step = within(free);
    }
    if v >= 0.0 {
        // With g > 0 left out: v + ½ch − ⅙bh² ≥ 0.
        let root = (0.25 * c * c + 2.0 / 3.0 * b * v).sqrt();
        let rising = if c > 0.0 {
            3.0 * (0.5 * c + root) / b
        } else {
            2.0 * v / (root - 0.5 * c)
        };
        step = step.max(rising).max(within(1.4 * rising));
    } else if c > 0.0 {
        // The parabola with the curvature v²/2g just touches zero.
        let touching = 3.0 * (c - v * v / (2.0 * g)) / b;
        step = step
            .max(touching)
            .max(within(1.3 * touching))
            .max(within(-v / c));
    }
    step * SAFE
}

/// What rounding could take from a certified step.
const SAFE: f64 = 1.0 - 1e-9;

/// The first positive zero of `g + vh + ½ch²` with `g > 0`; infinite if there is none.
fn parabola_zero(g: f64, v: f64, c: f64) -> f64 {
    let discriminant = v * v - 2.0 * g * c;
    if discriminant < 0.0 || (v >= 0.0 && c >= 0.0) {
        return f64::INFINITY;
    }
    let root = discriminant.sqrt();
    if v < 0.0 {
        2.0 * g / (root - v)
    } else {
        (v + root) / -c
    }
}

/// The first zero of the lower cubic divided by `h`, from the surface with rate `v > 0`.
fn step_from_surface(jet: &Jet) -> f64 {
    let (v, c, b) = (jet.rate, jet.curvature, jet.third);
    let root = (0.25 * c * c + 2.0 / 3.0 * b * v).sqrt();
    // v + ½ c h − ⅙ b h² = 0, in the form without cancellation.
    let h = if c < 0.0 {
        2.0 * v / (root - 0.5 * c)
    } else {
        3.0 * (0.5 * c + root) / b.max(f64::MIN_POSITIVE)
    };
    h * (1.0 - 1e-9)
}

/// A reach within which the signal falls through zero exactly once, for certain and
/// by more than rounding; `root` is the zero of the parabola `g + vh + ½ch²`.
#[inline]
fn certain_crossing(jet: &Jet, root: f64, noise: f64) -> Option<f64> {
    let (g, v, c, b) = (jet.value, jet.rate, jet.curvature, jet.third);
    if v >= 0.0 || !root.is_finite() {
        return None;
    }
    // A shallow dip is left to the tangency's finer measure.
    if c > 0.0 && v * v - 2.0 * g * c < 2.0 * c * SHALLOW * noise {
        return None;
    }
    // A little beyond the parabola's zero, so that the upper cubic is below zero.
    let excess = b * root.powi(3) / 6.0;
    let slope = v + c * root;
    if slope >= 0.0 {
        return None;
    }
    let reach = (root - 2.0 * (excess + 4.0 * noise) / slope) * (1.0 + 1e-12);
    let upper = g + reach * (v + reach * (0.5 * c + b * reach / 6.0));
    let steepest = v + reach * (c + 0.5 * b * reach);
    (upper < -4.0 * noise && steepest < 0.0).then_some(reach)
}

/// Times are known to this part of the segment's length.
pub(super) const RESOLUTION: f64 = 0.25 * f64::EPSILON;

/// The crossing one Halley step from `at`, if that step is certain to be the last one.
#[inline(always)]
fn last_step(jet: &Jet, at: f64, length: f64, noise: f64) -> Option<Crossing> {
    let step = quadratic_root(jet);
    let rate = jet.rate + jet.curvature * step;
    // |g(at + step)| ≤ ⅙ B |step|³ when the step solves the parabola.
    let error = jet.third * step.abs().powi(3) / 6.0;
    let solved = (jet.value + step * (jet.rate + 0.5 * jet.curvature * step)).abs() <= noise;
    (solved && error <= RESOLUTION * length * rate.abs()).then_some(Crossing {
        at: at + step,
        rate: rate.min(0.0),
        grazing: false,
        refined: false,
    })
}

/// The zero of `g + vh + ½ch²` nearest to `h = 0` (a Newton step where there is none).
fn quadratic_root(jet: &Jet) -> f64 {
    let (g, v, c) = (jet.value, jet.rate, jet.curvature);
    let discriminant = v * v - 2.0 * g * c;
    if discriminant >= 0.0 {
        2.0 * g / (-v + discriminant.sqrt())
    } else {
        -g / v
    }
}

/// Value, slope and curvature of `Σ p_j h^j`.
fn polynomial_jet(p: &[f64], h: f64) -> (f64, f64, f64) {
    let (mut value, mut slope, mut curvature) = (0.0, 0.0, 0.0);
    for &coefficient in p.iter().rev() {
        curvature = curvature * h + 2.0 * slope;
        slope = slope * h + value;
        value = value * h + coefficient;
    }
    (value, slope, curvature)
}

/// The first zero of `p` in `(0, reach]`, stepping by a bound on its curvature.
/// `remainder` bounds what the series leaves out: within it the sign is not
/// known, and the zero of `p` itself is taken.
fn first_polynomial_zero(p: &[f64], reach: f64, remainder: f64) -> Option<f64> {
    let curvature_bound: f64 = p
        .iter()
        .enumerate()
        .skip(2)
        .map(|(j, c)| c.abs() * (j * (j - 1)) as f64 * reach.powi(j as i32 - 2))
        .sum::<f64>()
        .max(f64::MIN_POSITIVE);
    let mut h = 0.0;
    let resolution = f64::EPSILON * reach;
    while h < reach {
        let (value, slope, _) = polynomial_jet(p, h);
        if value <= remainder.min(1e-16 * p[0].abs()) {
            return Some(h);
        }
        let root = (slope * slope + 2.0 * curvature_bound * value).sqrt();
        let step = if slope < 0.0 {
            2.0 * value / (root - slope)
        } else {
            (slope + root) / curvature_bound
        };
        if step < resolution.min(1e-15 * h) {
            return Some(h);
        }
        h += step;
    }
    None
}
