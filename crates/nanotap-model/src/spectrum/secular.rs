//! The characteristic equation of a beam whose tip carries a mass, a damper and a
//! spring:
//!
//! 1 + g(λ) Σ p_j²/D_j(λ) = 0, D_j = λ² + α3 λ + κ_j, g = α1 λ² + α6 λ + α4.
//!
//! Its 2N roots are sought as N real quadratic factors, each written as a *change* of
//! its free mode's own factor: q_k = D_k + b_k λ + c_k. The differences on which
//! everything depends, λ from a pole and Re λ from zero, then keep full relative
//! accuracy, and a pair may turn from complex to real without any special case.

use nalgebra::{Complex, DMatrix, DVector};
use nanotap_arithmetic::ComplexFunctions as _;

type C = Complex<f64>;

/// Load at the tip: the factors of p pᵀ in M, C and K.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipLoad {
    /// Factor in the mass matrix, α1.
    pub mass: f64,
    /// Factor in the damping matrix: α6 in contact, 0 in free flight.
    pub damping: f64,
    /// Factor in the stiffness matrix: α4 in contact, 0 in free flight.
    pub stiffness: f64,
}

/// The factor λ² + (α3 + b)λ + (κ_k + c) of the characteristic polynomial.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Factor {
    pub(super) b: f64,
    pub(super) c: f64,
}

/// The two roots of a [`Factor`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Roots {
    /// λ and its conjugate; here the one with a positive imaginary part.
    Conjugate(C),
    /// Two real roots, the smaller one in size first.
    Real([f64; 2]),
}

/// One beam with its load.
#[derive(Clone, Copy, Debug)]
pub(super) struct Secular<'a> {
    /// Modal stiffnesses κ_j of the bare beam, ascending, dimensionless.
    pub(super) stiffness: &'a [f64],
    /// Tip deflections p_j = φ_j(1) of the modes, dimensionless.
    pub(super) tip: &'a [f64],
    /// Damping α3 of the beam, dimensionless.
    pub(super) beam_damping: f64,
    /// Mass, damper and spring at the tip.
    pub(super) load: TipLoad,
}

/// Sweeps of the simultaneous iteration before it is given up.
const SWEEPS: usize = 12;
/// Relative change of a root below which the next, quadratically convergent sweep
/// ends at rounding level.
const NEARLY: f64 = 1e-7;
/// Relative change that rounding alone may cause in the last sweep.
const SETTLED: f64 = 1e-10;

impl Secular<'_> {
    fn count(&self) -> usize {
        self.stiffness.len()
    }

    /// Returns Σ p_j² over all modes.
    fn tip_squared(&self) -> f64 {
        self.tip.iter().map(|p| p * p).sum()
    }

    /// Returns α6 − α1 α3, the part of the tip's damping that is not proportional to M, for which g
    /// = α1 D + (α4 − α1 κ) + (α6 − α1 α3) λ.
    fn excess_damping(&self) -> f64 {
        self.load.damping - self.load.mass * self.beam_damping
    }

    /// Returns the two roots of factor `k`.
    pub(super) fn roots(&self, k: usize, factor: Factor) -> Roots {
        roots_of(self.beam_damping + factor.b, self.stiffness[k] + factor.c)
    }

    /// Writes the eigenvector u_j = p_j/D_j(λ) of a root λ of factor `k`, scaled to 1 at
    /// its largest entry, and returns p·u.
    pub(super) fn vector(&self, k: usize, factor: Factor, root: C, shape: &mut [C]) -> C {
        // D_j = −b λ − c + κ_j − κ_k at a root of the factor.
        let own = C::new(-factor.c, 0.0) - root * factor.b;
        let mut nearest = k;
        for (j, u) in shape.iter_mut().enumerate() {
            *u = own + (self.stiffness[j] - self.stiffness[k]);
        }
        let size = |j: usize, u: &C| u.norm_sqr() / (self.tip[j] * self.tip[j]);
        for (j, u) in shape.iter().enumerate() {
            if size(j, u) < size(nearest, &shape[nearest]) {
                nearest = j;
            }
        }
        let scale = shape[nearest] / self.tip[nearest];
        let (mut tip, mut tip_size) = (C::new(0.0, 0.0), 0.0);
        for (j, u) in shape.iter_mut().enumerate() {
            let p = self.tip[j];
            *u = if j == nearest {
                C::new(1.0, 0.0)
            } else {
                scale * p / *u
            };
            tip += *u * p;
            tip_size += u.modulus() * p.abs();
        }
        // A strong load holds the tip and the sum cancels; then 1 + g Σ p²/D = 0 gives it.
        let load = self.load_at(k, own, root);
        if load.modulus() * tip_size > 2.0 * scale.modulus() {
            -scale / load
        } else {
            tip
        }
    }

    /// uᵀ(2λM + C)u for the eigenvector that [`vector`](Self::vector) wrote, by
    /// (1 + α1 Σp²) q_k′(λ) Π q_j/D_j: where λ nearly meets the other root of its factor
    /// the sum of its parts cancels, and this product does not.
    pub(super) fn normaliser(&self, k: usize, factors: &[Factor], root: C, u: C, tip: C) -> C {
        let factor = factors[k];
        let own = C::new(-factor.c, 0.0) - root * factor.b;
        let slope = match self.roots(k, factor) {
            Roots::Conjugate(above) => C::new(0.0, 2.0 * above.im),
            Roots::Real([near, far]) if root.re == near => C::from(near - far),
            Roots::Real([near, far]) => C::from(far - near),
        };
        let leading = 1.0 + self.load.mass * self.tip_squared();
        let mut product = slope * tip * u * (leading / self.tip[k]);
        for (j, other) in factors.iter().enumerate() {
            if j != k {
                let distance = own + (self.stiffness[j] - self.stiffness[k]);
                product *= (distance + root * other.b + other.c) / distance;
            }
        }
        product
    }

    /// g(λ), for D_k(λ) = `own`.
    fn load_at(&self, k: usize, own: C, root: C) -> C {
        own * self.load.mass
            + (self.load.stiffness - self.load.mass * self.stiffness[k])
            + root * self.excess_damping()
    }

    /// All N factors, in the order of the free modes they grow out of; `None` where
    /// the iteration does not settle because roots (nearly) coincide.
    pub(super) fn factors(&self) -> Option<Vec<Factor>> {
        let starts = self.starts();
        if self.excess_damping() == 0.0 {
            // Then only D appears in the equation: the undamped roots are exact.
            return Some(starts);
        }
        self.iterate(starts)
            .or_else(|| self.iterate(self.dense_starts()?))
    }

    /// The factors to which `factors` converge, if they do.
    fn iterate(&self, mut factors: Vec<Factor>) -> Option<Vec<Factor>> {
        let mut nearly = false;
        for _ in 0..SWEEPS {
            let change = self.sweep(&mut factors);
            if nearly && change < SETTLED {
                return self.complete(&factors).then_some(factors);
            }
            if !change.is_finite() {
                return None;
            }
            nearly = change < NEARLY;
        }
        None
    }

    /// The undamped factors, shifted by the damping that a mode feels on its own.
    fn starts(&self) -> Vec<Factor> {
        let excess = self.excess_damping();
        (0..self.count())
            .map(|k| {
                let c = self.undamped_shift(k);
                let (mut compliance, mut norm) = (0.0, 0.0);
                for (j, p) in self.tip.iter().enumerate() {
                    // Relative to the own mode's part, which alone is there at c = 0.
                    let part = if j == k {
                        -1.0
                    } else {
                        c / (self.stiffness[j] - self.stiffness[k] - c)
                    };
                    compliance += p * p * part;
                    norm += p * p * part * part;
                }
                let b = excess * compliance * compliance
                    / (norm + self.load.mass * compliance * compliance);
                Factor { b, c }
            })
            .collect()
    }

    /// Factors made of the eigenvalues of the equations as a matrix: slower than
    /// [`starts`](Self::starts) and good for the large ones only, but near the roots
    /// however strong the damping. `None` where the eigenvalue iteration fails.
    fn dense_starts(&self) -> Option<Vec<Factor>> {
        let count = self.count();
        let tip = DVector::from_column_slice(self.tip);
        let load = &tip * tip.transpose();
        let identity = DMatrix::<f64>::identity(count, count);
        let mass = (&identity + &load * self.load.mass).cholesky()?.unpack();
        let bending = DMatrix::from_diagonal(&DVector::from_column_slice(self.stiffness));
        let root = (bending + &load * self.load.stiffness).cholesky()?.unpack();
        let damping = identity * self.beam_damping + load * self.load.damping;
        // Coordinates in which the energy is the sum of squares: skew but for damping.
        let coupling = mass.solve_lower_triangular(&root)?;
        let half = mass.solve_lower_triangular(&damping)?;
        let damping = mass.solve_lower_triangular(&half.transpose())?;
        let mut matrix = DMatrix::zeros(2 * count, 2 * count);
        matrix
            .view_mut((0, count), (count, count))
            .copy_from(&coupling.transpose());
        matrix
            .view_mut((count, 0), (count, count))
            .copy_from(&-coupling);
        matrix
            .view_mut((count, count), (count, count))
            .copy_from(&-damping);
        self.factors_with_roots(&nanotap_arithmetic::eigenvalues(&matrix)?)
    }

    /// Factors with the given roots.
    fn factors_with_roots(&self, roots: &[C]) -> Option<Vec<Factor>> {
        let mut products: Vec<(f64, f64)> = roots
            .iter()
            .filter(|root| root.im > 0.0)
            .map(|root| (-2.0 * root.re, root.norm_sqr()))
            .collect();
        let mut real: Vec<f64> = roots.iter().filter(|r| r.im == 0.0).map(|r| r.re).collect();
        real.sort_by(|x, y| x.abs().total_cmp(&y.abs()));
        // Roots that nearly meet belong into one factor, where they may become complex.
        let mut i = 0;
        while i + 1 < real.len() {
            if (real[i] - real[i + 1]).abs() < 1e-2 * real[i].abs() {
                products.push((-(real[i] + real[i + 1]), real[i] * real[i + 1]));
                real.drain(i..i + 2);
            } else {
                i += 1;
            }
        }
        // The others as in an overdamped mode: the slowest with the fastest.
        for i in 0..real.len() / 2 {
            let (slow, fast) = (real[i], real[real.len() - 1 - i]);
            products.push((-(slow + fast), slow * fast));
        }
        products.sort_by(|x, y| x.1.total_cmp(&y.1));
        (products.len() == self.count()).then(|| {
            products
                .iter()
                .zip(self.stiffness)
                .map(|((b, c), kappa)| Factor {
                    b: b - self.beam_damping,
                    c: c - kappa,
                })
                .collect()
        })
    }

    /// c_k such that μ = κ_k + c_k is the squared frequency without damping, a root of
    /// 1 + (α4 − α1μ) Σ p_j²/(κ_j − μ) = 0.
    ///
    /// Where the spring outweighs the mass, α4 > α1κ_k, the root lies above κ_k, else
    /// below; it passes neither the neighbouring pole nor α4/α1, nor moves farther
    /// than the norm of the load. Each such interval holds exactly one root.
    pub(super) fn undamped_shift(&self, k: usize) -> f64 {
        let TipLoad {
            mass, stiffness, ..
        } = self.load;
        let own = self.stiffness[k];
        let gamma = stiffness - mass * own;
        if gamma == 0.0 {
            return 0.0;
        }
        let up = gamma > 0.0;
        let neighbour = if up {
            self.stiffness.get(k + 1).copied()
        } else {
            k.checked_sub(1).map(|below| self.stiffness[below])
        };
        let balance = if mass > 0.0 {
            gamma / mass
        } else {
            f64::INFINITY
        };
        let end = if up {
            let pole = neighbour.map_or(f64::INFINITY, |pole| pole - own);
            pole.min(balance).min(gamma * self.tip_squared())
        } else {
            let pole = neighbour.map_or(-own, |pole| pole - own);
            pole.max(balance)
        };
        // The equation times D_k, and times the neighbour's pole distance, is smooth
        // in the bracket; in the direction of the root it falls from positive values.
        let value = |c: f64| {
            let (mut sum, mut slope) = (0.0, 0.0);
            for (j, p) in self.tip.iter().enumerate() {
                if j != k {
                    let inverse = (self.stiffness[j] - own - c).recip();
                    let part = p * p * inverse;
                    sum += part;
                    slope += part * inverse;
                }
            }
            let p2 = self.tip[k] * self.tip[k];
            let g = gamma - mass * c;
            let f = -c + g * (p2 - c * sum);
            let f_slope = -1.0 - mass * (p2 - c * sum) - g * (sum + c * slope);
            match neighbour {
                Some(pole) => {
                    let distance = pole - own - c;
                    (f * distance, f_slope * distance - f)
                }
                None => (f, f_slope),
            }
        };
        let sign = neighbour.map_or(1.0, |pole| (pole - own).signum()) * gamma.signum();
        newton_in_bracket(
            |c| {
                let (f, slope) = value(c);
                (sign * f, sign * slope)
            },
            end,
        )
    }

    /// One sweep over all factors, each corrected with the newest values of the others
    /// (Weierstrass's simultaneous iteration, on quadratic factors). Returns the largest
    /// relative change of a root.
    fn sweep(&self, factors: &mut [Factor]) -> f64 {
        let leading = 1.0 + self.load.mass * self.tip_squared();
        let mut largest: f64 = 0.0;
        for k in 0..factors.len() {
            let (b, c) = (
                self.beam_damping + factors[k].b,
                self.stiffness[k] + factors[k].c,
            );
            let nodes = Nodes::of(b, c);
            // What the true factor is at the nodes, less the present one: A λ + B.
            let (slope, constant) = match nodes {
                Nodes::Conjugate { node, offset } => {
                    let rest = self.deflated(k, node, offset, factors) / leading - offset;
                    let slope = rest.im / node.im;
                    (slope, rest.re - slope * node.re)
                }
                Nodes::Real([near, far]) => {
                    let at = |x: f64| self.deflated(k, C::new(x, 0.0), 0.0, factors).re / leading;
                    let (at_near, at_far) = (at(near), at(far));
                    let slope = (at_far - at_near) / (far - near);
                    (slope, at_near - slope * near)
                }
            };
            factors[k].b += slope;
            factors[k].c += constant;
            largest = largest.max(nodes.relative_change(slope, constant));
            if !largest.is_finite() {
                return f64::NAN;
            }
        }
        largest
    }

    /// The characteristic polynomial over all factors but the k-th, at `node`, where the
    /// k-th factor has the value `offset`.
    fn deflated(&self, k: usize, node: C, offset: f64, factors: &[Factor]) -> C {
        let own = C::new(offset - factors[k].c, 0.0) - node * factors[k].b;
        let mut sum = C::new(0.0, 0.0);
        let mut product = C::new(1.0, 0.0);
        for (j, (p, factor)) in self.tip.iter().zip(factors).enumerate() {
            if j == k {
                continue;
            }
            let distance = apart(
                own + (self.stiffness[j] - self.stiffness[k]),
                self.stiffness[j],
            );
            let other = apart(distance + node * factor.b + factor.c, self.stiffness[j]);
            sum += distance.inv() * (p * p);
            product *= distance / other;
        }
        let p2 = self.tip[k] * self.tip[k];
        let g = self.load_at(k, own, node);
        (own + g * (own * sum + p2)) * product
    }

    /// Whether the factors have the polynomial's sum and product of roots. Had two
    /// factors met on one root and left another out, neither would agree.
    fn complete(&self, factors: &[Factor]) -> bool {
        let leading = 1.0 + self.load.mass * self.tip_squared();
        let trace = self.excess_damping() * self.tip_squared() / leading;
        let trace_size: f64 = factors.iter().map(|f| f.b.abs()).sum();
        let found: f64 = factors.iter().map(|f| f.b).sum();

        let compliance: f64 = self
            .tip
            .iter()
            .zip(self.stiffness)
            .map(|(p, kappa)| p * p / kappa)
            .sum();
        let determinant = nanotap_arithmetic::ln_1p(self.load.stiffness * compliance)
            - nanotap_arithmetic::ln(leading);
        let product: f64 = factors
            .iter()
            .zip(self.stiffness)
            .map(|(factor, kappa)| nanotap_arithmetic::ln_1p(factor.c / kappa))
            .sum();
        (found - trace).abs() <= 1e-8 * trace_size
            && (product - determinant).abs() <= 1e-8 * (1.0 + determinant.abs())
    }
}

/// Keeps a denominator, the difference of two numbers of size `scale`, at least ε²·`scale` away
/// from zero, which is far below their rounding error.
fn apart(distance: C, scale: f64) -> C {
    let least = f64::EPSILON * f64::EPSILON * scale;
    if distance.re.abs() + distance.im.abs() < least {
        C::new(least, 0.0)
    } else {
        distance
    }
}

/// The roots of λ² + bλ + c.
fn roots_of(b: f64, c: f64) -> Roots {
    let half = 0.5 * b;
    let discriminant = half.mul_add(half, -c);
    if discriminant < 0.0 {
        Roots::Conjugate(C::new(-half, (-discriminant).sqrt()))
    } else {
        let far = -(half + discriminant.sqrt().copysign(half));
        Roots::Real([if far == 0.0 { 0.0 } else { c / far }, far])
    }
}

/// Where a factor's correction is interpolated.
#[derive(Clone, Copy, Debug)]
enum Nodes {
    /// A conjugate pair of nodes, at which the factor has the real value `offset`.
    Conjugate { node: C, offset: f64 },
    /// The factor's two real roots.
    Real([f64; 2]),
}

/// Roots closer than this, relative to their size, are replaced by nodes this far apart:
/// any two nodes do near the roots, and interpolation needs them apart.
const CLOSEST_NODES: f64 = 1e-3;

impl Nodes {
    fn of(b: f64, c: f64) -> Self {
        let centre = -0.5 * b;
        let least = CLOSEST_NODES * centre;
        let squared = c - centre * centre;
        if squared.abs() < least * least {
            return Self::Conjugate {
                node: C::new(centre, least.abs()),
                offset: squared - least * least,
            };
        }
        match roots_of(b, c) {
            Roots::Conjugate(node) => Self::Conjugate { node, offset: 0.0 },
            Roots::Real(roots) => Self::Real(roots),
        }
    }

    /// How far the correction Aλ + B moves the roots, relative to them.
    fn relative_change(&self, slope: f64, constant: f64) -> f64 {
        match self {
            Self::Conjugate { node, .. } => {
                let moved = (node * slope + constant).norm_sqr() / node.norm_sqr();
                moved.sqrt() / (2.0 * node.im)
            }
            Self::Real([near, far]) => {
                let gap = (far - near).abs();
                let moved = |x: f64| (x * slope + constant).abs() / (x.abs() * gap);
                moved(*near).max(moved(*far))
            }
        }
    }
}

/// The root between 0 and `end` of a function that is positive at 0 and falls below zero
/// before `end`: Newton from 0, bisection where a step leaves the bracket. The function
/// returns value and slope.
fn newton_in_bracket(function: impl Fn(f64) -> (f64, f64), end: f64) -> f64 {
    let (mut before, mut after) = (0.0, end);
    let mut x = 0.0;
    for _ in 0..200 {
        let (value, slope) = function(x);
        if value == 0.0 {
            return x;
        }
        if value > 0.0 {
            before = x;
        } else {
            after = x;
        }
        let newton = x - value / slope;
        let inside = (newton - before) * (newton - after) < 0.0;
        let next = if inside {
            newton
        } else {
            0.5 * (before + after)
        };
        if (next - x).abs() <= f64::EPSILON * next.abs() || next == before || next == after {
            return next;
        }
        x = next;
    }
    x
}
