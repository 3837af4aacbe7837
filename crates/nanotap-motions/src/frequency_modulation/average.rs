//! The frequency shift from a force, and the force from a frequency shift, of a sinusoidal
//! oscillation: formulas to compare with the orbit.
//!
//! To first order in the force (F. J. Giessibl, Phys. Rev. B 56, 16010 (1997), from the
//! Hamilton–Jacobi perturbation theory) the shift of an oscillation of amplitude A about the
//! distance z is the force averaged with the weight of the oscillation,
//!
//! $$\frac{Δf}{f_0} = -\frac{1}{2πkA} \int_0^{2π} F(z + A\cos θ) \cos θ\,dθ,$$
//!
//! and for an amplitude that is large against the force's range (the same, Appl. Phys. Lett. 78,
//! 123 (2001)), with the least distance D = z − A,
//!
//! $$\frac{Δf}{f_0} = \frac{1}{\sqrt2\,πkA^{3/2}} \int_0^\infty \frac{F(D + x)}{\sqrt x}\,dx.$$
//!
//! J. E. Sader and S. P. Jarvis (Appl. Phys. Lett. 84, 1801 (2004)) invert the first one,
//!
//! $$F(D) = 2k \int_D^\infty \left(1 + \frac{\sqrt A}{8\sqrt{π(t - D)}}\right) Ω(t)
//!   - \frac{A^{3/2}}{\sqrt{2(t - D)}} Ω'(t)\,dt, \qquad Ω = \frac{Δf}{f_0},$$
//!
//! with a kernel that is good to 5 % of the force at amplitudes near its range and better at
//! small and large ones.

use std::f64::consts::{PI, TAU};

use nanotap_model::Model;
use nanotap_model::nonlinear::{Nonlinear, SweepPiece};

/// The static force of a model's sample against the distance.
enum StaticForce<'a> {
    Nonlinear(&'a Nonlinear),
    /// A spring that begins at zero.
    Spring(f64),
}

impl StaticForce<'_> {
    /// Returns the smooth pieces of a quasi-static motion between these distances, in this order.
    fn pieces(&self, gaps: &[f64]) -> Vec<SweepPiece> {
        if let Self::Nonlinear(nonlinear) = self {
            return nonlinear.sweep(gaps);
        }
        let mut pieces = Vec::new();
        for pair in gaps.windows(2) {
            let mut from = pair[0];
            if pair[0] * pair[1] < 0.0 {
                pieces.push([from, 0.0]);
                from = 0.0;
            }
            pieces.push([from, pair[1]]);
        }
        let piece = |gaps: [f64; 2]| SweepPiece {
            branch: usize::from(gaps[0].min(gaps[1]) < 0.0),
            gaps,
        };
        pieces.into_iter().map(piece).collect()
    }

    /// Returns the force on a branch at a distance.
    fn value(&self, branch: usize, gap: f64) -> f64 {
        match self {
            Self::Nonlinear(nonlinear) => nonlinear.static_law().value(branch, gap, 0.0),
            Self::Spring(_) if branch == 0 => 0.0,
            Self::Spring(stiffness) => -stiffness * gap,
        }
    }
}

/// Averages of a force over a sinusoidal oscillation.
pub struct Averages<'a> {
    force: StaticForce<'a>,
    amplitude: f64,
    stiffness: f64,
}

/// Approximations of the frequency shift at one distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Averaged {
    /// Relative shift Δf/f₀ to first order in the force, dimensionless.
    pub first_order: f64,
    /// Relative shift Δf/f₀ by Giessibl's formula for a large amplitude, dimensionless.
    pub giessibl: f64,
    /// Static force at the closest approach, on the way to the sample, model units; positive if it
    /// repels.
    pub force: f64,
}

impl<'a> Averages<'a> {
    /// Creates the averages for the sample of `model` and an oscillation of `amplitude` of a lever
    /// with the modal `stiffness`, in model units. `spring` is the stiffness of the sample if its
    /// force is not nonlinear.
    pub fn new(model: &'a Model, spring: f64, amplitude: f64, stiffness: f64) -> Self {
        let force = match &model.nonlinear {
            Some(nonlinear) => StaticForce::Nonlinear(nonlinear),
            None => StaticForce::Spring(spring),
        };
        Self {
            force,
            amplitude,
            stiffness,
        }
    }

    /// Computes the approximations with the tip at rest at the distance `gap`, model units.
    pub fn at(&self, gap: f64) -> Averaged {
        let (a, k) = (self.amplitude, self.stiffness);
        let (farthest, closest) = (gap + a, gap - a);
        // Over the phase θ from the far side to the near one and back, piece by smooth piece.
        let phase = |at: f64| nanotap_arithmetic::acos(((at - gap) / a).clamp(-1.0, 1.0));
        let around = self.force.pieces(&[farthest, closest, farthest]);
        let of_piece = |piece: &SweepPiece| {
            let [one, other] = piece.gaps.map(phase);
            integral([one.min(other), one.max(other)], |angle| {
                let cos = nanotap_arithmetic::cos(angle);
                self.force.value(piece.branch, gap + a * cos) * cos
            })
        };
        let sum: f64 = around.iter().map(of_piece).sum();
        let first_order = -sum / (TAU * k * a);
        // x = A s² with s = u/(1 − u), so that 0 ≤ u < 1 reaches all distances.
        let inwards = self.force.pieces(&[closest + FAR * a, closest]);
        let place = |u: f64| {
            let s = u / (1.0 - u);
            closest + a * s * s
        };
        let share = |at: f64| {
            let s = ((at - closest) / a).max(0.0).sqrt();
            s / (1.0 + s)
        };
        let numbered = inwards.iter().enumerate();
        let of_piece = |(number, piece): (usize, &SweepPiece)| {
            let [far, near] = piece.gaps.map(share);
            let far = if number == 0 { 1.0 } else { far };
            integral([near, far], |u| {
                let rest = 1.0 - u;
                if rest <= f64::EPSILON {
                    return 0.0;
                }
                self.force.value(piece.branch, place(u)) / (rest * rest)
            })
        };
        let sum: f64 = numbered.map(of_piece).sum();
        let large = a * a.sqrt();
        let last = inwards.last();
        Averaged {
            first_order,
            giessibl: 2.0 * a.sqrt() * sum / (PI * 2_f64.sqrt() * k * large),
            force: last.map_or(0.0, |piece| self.force.value(piece.branch, closest)),
        }
    }
}

/// Distance at which the integral outwards begins, in amplitudes: its first piece goes on to
/// infinity.
const FAR: f64 = 1e6;
/// Largest number of halvings of the step of the quadrature.
const HALVINGS: u32 = 9;
/// Relative change by a halving at which the quadrature ends.
const INTEGRATED: f64 = 1e-13;
/// Largest variable of the quadrature: beyond it the weights are below rounding.
const WIDEST: f64 = 3.2;

/// Computes the integral of a function that is smooth between two ends, by the double exponential
/// formula (Takahasi and Mori, Publ. RIMS 9, 721, 1974): roots and steep slopes at the ends do no
/// harm.
fn integral([low, high]: [f64; 2], of: impl Fn(f64) -> f64) -> f64 {
    let half = 0.5 * (high - low);
    if half <= 0.0 {
        return 0.0;
    }
    // x = tanh(π/2 sinh t); 1 − |x| without cancellation.
    let term = |t: f64| {
        let inner = 0.5 * PI * nanotap_arithmetic::sinh(t.abs());
        let away = 1.0 / (nanotap_arithmetic::exp(inner) * nanotap_arithmetic::cosh(inner));
        let at = if t < 0.0 {
            low + half * away
        } else {
            high - half * away
        };
        let cosh = nanotap_arithmetic::cosh(inner);
        let weight = 0.5 * PI * nanotap_arithmetic::cosh(t) / (cosh * cosh);
        weight * of(at)
    };
    let (mut sum, mut size) = (term(0.0), 0.0);
    let mut step = 1.0;
    let mut last = f64::NAN;
    for halving in 0..=HALVINGS {
        // The odd multiples of the step; at first all.
        let stride = if halving == 0 { 1 } else { 2 };
        let mut k = 1;
        while f64::from(k) * step <= WIDEST {
            for t in [-f64::from(k) * step, f64::from(k) * step] {
                let term = term(t);
                sum += term;
                size += term.abs();
            }
            k += stride;
        }
        let value = sum * step;
        if halving > 3 && (value - last).abs() <= INTEGRATED * size * step {
            return half * value;
        }
        last = value;
        step *= 0.5;
    }
    half * last
}

/// The force at each distance of a curve of relative shifts, as Sader and Jarvis find it from
/// what lies beyond it. `curve` has least distances and shifts Δf/f₀, in any order; the
/// forces are in the order of the curve. Between its points the curve is a cubic; beyond the
/// farthest one it goes on by the power law of its end where it decays like one.
pub fn sader_jarvis(curve: &[(f64, f64)], amplitude: f64, stiffness: f64) -> Vec<f64> {
    let mut order: Vec<usize> = (0..curve.len()).collect();
    order.sort_by(|&a, &b| curve[a].0.total_cmp(&curve[b].0));
    order.dedup_by(|a, b| curve[*a].0 == curve[*b].0);
    let points: Vec<(f64, f64)> = order.iter().map(|&k| curve[k]).collect();
    let slopes = slopes(&points);
    let tail = Tail::of(&points, &slopes);
    curve
        .iter()
        .map(|(at, _)| 2.0 * stiffness * beyond(*at, &points, &slopes, tail, amplitude))
        .collect()
}

/// Slopes of a curve at its points: of the parabola through each and its neighbours.
fn slopes(points: &[(f64, f64)]) -> Vec<f64> {
    let secant = |k: usize| {
        let ((x, y), (u, v)) = (points[k], points[k + 1]);
        (v - y) / (u - x)
    };
    let width = |k: usize| points[k + 1].0 - points[k].0;
    let last = points.len().saturating_sub(1);
    (0..points.len())
        .map(|k| match k {
            _ if last == 0 => 0.0,
            0 if last == 1 => secant(0),
            0 => secant(0) - width(0) * (secant(1) - secant(0)) / (width(0) + width(1)),
            k if k == last && last == 1 => secant(0),
            k if k == last => {
                let (a, b) = (last - 2, last - 1);
                secant(b) + width(b) * (secant(b) - secant(a)) / (width(a) + width(b))
            }
            k => {
                let (before, after) = (width(k - 1), width(k));
                (after * secant(k - 1) + before * secant(k)) / (before + after)
            }
        })
        .collect()
}

/// How a curve goes on beyond its last point: as t^(−power).
#[derive(Clone, Copy)]
struct Tail {
    from: f64,
    value: f64,
    power: f64,
}

impl Tail {
    fn of(points: &[(f64, f64)], slopes: &[f64]) -> Option<Self> {
        let (&(from, value), slope) = points.last().zip(slopes.last())?;
        let power = -slope * from / value;
        let decays = from > 0.0 && power > 1.0 && power.is_finite();
        decays.then_some(Self { from, value, power })
    }
}

/// Abscissae and weights of Gauss's rule of eight points on (0, 1).
const GAUSS: [(f64, f64); 8] = [
    (0.019_855_071_751_231_9, 0.050_614_268_145_188_1),
    (0.101_666_761_293_186_6, 0.111_190_517_226_687_2),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_6),
    (0.408_282_678_752_175_1, 0.181_341_891_689_181),
    (0.591_717_321_247_825, 0.181_341_891_689_181),
    (0.762_766_204_958_164_5, 0.156_853_322_938_943_6),
    (0.898_333_238_706_813_4, 0.111_190_517_226_687_2),
    (0.980_144_928_248_768_1, 0.050_614_268_145_188_1),
];

/// Pieces of the integral over the tail.
const PIECES: u32 = 16;

/// The integral of Sader and Jarvis from `at` on. With t = D + s² it has no singularity.
fn beyond(at: f64, points: &[(f64, f64)], slopes: &[f64], tail: Option<Tail>, a: f64) -> f64 {
    let weights = |s: f64, value: f64, slope: f64| {
        (2.0 * s + a.sqrt() / (4.0 * PI.sqrt())) * value - 2_f64.sqrt() * a * a.sqrt() * slope
    };
    let mut sum = 0.0;
    for (k, pair) in points.windows(2).enumerate() {
        let ((x, y), (u, v)) = (pair[0], pair[1]);
        if x < at {
            continue;
        }
        let (low, high) = ((x - at).sqrt(), (u - at).sqrt());
        for (node, weight) in GAUSS {
            let s = low + node * (high - low);
            let h = u - x;
            let t = (at + s * s - x) / h;
            let (p, q) = (slopes[k] * h, slopes[k + 1] * h);
            // Hermite's cubic and its slope.
            let (c, d) = (3.0 * (v - y) - 2.0 * p - q, p + q - 2.0 * (v - y));
            let value = y + t * (p + t * (c + t * d));
            let slope = (p + t * (2.0 * c + 3.0 * t * d)) / h;
            sum += (high - low) * weight * weights(s, value, slope);
        }
    }
    let Some(tail) = tail else { return sum };
    // s from the last point to infinity: s = s₀/(1 − u), in pieces.
    let low = (tail.from - at).max(0.0).sqrt();
    let unit = tail.from.sqrt();
    for piece in 0..PIECES {
        for (node, weight) in GAUSS {
            let u = (f64::from(piece) + node) / f64::from(PIECES);
            let s = low + unit * u / (1.0 - u);
            let t = at + s * s;
            let value = tail.value * nanotap_arithmetic::powf(t / tail.from, -tail.power);
            let slope = -tail.power * value / t;
            let width = unit / ((1.0 - u) * (1.0 - u)) / f64::from(PIECES);
            sum += width * weight * weights(s, value, slope);
        }
    }
    sum
}
