//! Γ of a thin blade that bends in waves along its length, in an unbounded fluid or over a wall.
//!
//! The blade is a strip of width b = 2a that moves by w e^{i(ωt + kx)} across itself, as a mode with the
//! wavenumber k = C/L does: the theory of C. A. Van Eysden and J. E. Sader (J. Appl. Phys. 101, 044908
//! (2007)) with κ = kb, for k = 0 that of J. E. Sader (J. Appl. Phys. 84, 64 (1998)). Over a wall, for
//! k = 0, it is that of C. P. Green and J. E. Sader (J. Appl. Phys. 98, 114913 (2005)). Here the same
//! equations are solved without their tables.
//!
//! The blade acts on the fluid as a sheet of stress: a normal one that is even in y, and over a wall
//! tangential ones, odd along y and even along x. (Without a wall the tangential velocity in the plane of
//! the blade is 0 by symmetry.) Of the sheet's Fourier component (k, q), with lengths in a and stresses in
//! μ/a, the unsteady Stokes equations give the velocity in its plane: the normal one by the normal stress
//!
//! ```text
//! G = s/(2m(m + s)),   s² = k² + q²,   m² = s² + iRe,   Re = ρωa²/μ,
//! ```
//!
//! and over a wall further terms, which take the no-slip condition there into account (`Wave::over`).
//!
//! Each stress is a sum of Chebyshev polynomials over √(1 − y²), whose Fourier transforms are Bessel
//! functions, so that the uniform velocity of the blade leads to a symmetric system of equations with
//! the matrix π ∫₀^∞ J_m(q) J_n(q) G(q) dq (Galerkin's method). The total force is the first unknown.
//!
//! The products of Bessel functions oscillate. Beyond `JOIN` they are sums of products of Hankel
//! functions: H¹H² does not oscillate, and H¹H¹ and H²H² fall exponentially along q = JOIN ± it. The nodes
//! of these integrals and the functions there are the same for every blade.
//!
//! Error: below 1e-7 of |Γ| for Re up to 1e4, 5e-6 at 1e6, as more polynomials and nodes show.

use std::array::from_fn;
use std::cell::RefCell;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, FRAC_PI_4};
use std::sync::LazyLock;

use nalgebra::Complex;
use nanotap_arithmetic::{ComplexFunctions as _, from_polar};
use nanotap_volterra::gauss_legendre;

/// Number of Chebyshev polynomials of each stress.
const ORDERS: usize = 12;
/// Bessel functions: of even and odd order.
const FUNCTIONS: usize = 2 * ORDERS;
/// Where Hankel functions take over: beyond the largest order, and where their asymptotic series have
/// all digits.
const JOIN: f64 = 38.0;
/// Number of Gauss nodes in each panel of the integrals over q.
const PANEL: usize = 12;
/// Largest number of values of Γ that each thread keeps for reuse.
const REMEMBERED: usize = 64;

/// A blade in a fluid, without units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blade {
    /// Wavenumber of the mode times the width of the blade, κ = kb, dimensionless.
    pub wavenumber: f64,
    /// Reynolds number Re = ρωb²/(4η), dimensionless.
    pub reynolds: f64,
    /// Distance to the wall as a fraction of the width, dimensionless; `None` without a wall.
    pub gap: Option<f64>,
}

impl Blade {
    /// Reynolds numbers for which Γ is accurate.
    pub const REYNOLDS: [f64; 2] = [1e-6, 1e6];
    /// Largest κ for which Γ is accurate.
    pub const MAX_WAVENUMBER: f64 = 40.0;
    /// Smallest distance to a wall, as a fraction of the width, for which Γ is accurate.
    pub const MIN_GAP: f64 = 0.025;

    /// Returns true if all numbers are in the ranges for which Γ is accurate.
    pub fn is_in_range(self) -> bool {
        (Self::REYNOLDS[0]..=Self::REYNOLDS[1]).contains(&self.reynolds)
            && (0.0..=Self::MAX_WAVENUMBER).contains(&self.wavenumber)
            && self.gap.is_none_or(|gap| gap >= Self::MIN_GAP)
    }

    /// Γ with time as e^{−iωt}; `None` out of range.
    pub fn hydrodynamic_function(self) -> Option<Complex<f64>> {
        thread_local! {
            /// Values of Γ computed by this thread, the latest last.
            static RECENT: RefCell<Vec<(Blade, Complex<f64>)>> = const { RefCell::new(Vec::new()) };
        }
        if !self.is_in_range() {
            return None;
        }
        let known = RECENT.with_borrow(|recent| {
            let mut recent = recent.iter().rev();
            recent.find(|(blade, _)| *blade == self).map(|of| of.1)
        });
        Some(known.unwrap_or_else(|| {
            let value = self.solve();
            RECENT.with_borrow_mut(|recent| {
                if recent.len() == REMEMBERED {
                    recent.remove(0);
                }
                recent.push((self, value));
            });
            value
        }))
    }

    fn solve(self) -> Complex<f64> {
        let k = 0.5 * self.wavenumber;
        // Along z, y and x; the last two only over a wall, the last only for waves.
        let stresses = match self.gap {
            None => 1,
            Some(_) if k == 0.0 => 2,
            Some(_) => 3,
        };
        let size = stresses * ORDERS;
        let mut matrix = vec![Complex::new(0.0, 0.0); size * size];
        for node in NODES.iter() {
            let wave = Wave::new(node.q, k, self.reynolds);
            let kernel = match self.gap {
                None => [[wave.unbounded(); 3]; 3],
                Some(gap) => wave.over(2.0 * gap),
            };
            let of_stress = |stress: usize| node.functions.iter().skip(stress % 2).step_by(2);
            for row in 0..stresses {
                for (i, left) in of_stress(row).enumerate() {
                    let line = &mut matrix[(row * ORDERS + i) * size..][..(row + 1) * ORDERS];
                    for (column, part) in line.chunks_exact_mut(ORDERS).enumerate() {
                        let scale = node.weight * kernel[row][column] * left;
                        for (entry, right) in part.iter_mut().zip(of_stress(column)) {
                            *entry += scale * right;
                        }
                    }
                }
            }
        }
        // The total force over μ times the velocity is π over this; it is iπ Re Γ in e^{+iωt}.
        let total = first_pivot(&mut matrix, size);
        (Complex::new(0.0, self.reynolds) * total).inv().conj()
    }
}

/// Computes 1/(M⁻¹)₀₀ of a symmetric matrix from its lower half, by elimination of all other rows.
/// Pivoting is not needed: the blade dissipates, so that no pivot vanishes.
fn first_pivot(matrix: &mut [Complex<f64>], size: usize) -> Complex<f64> {
    for pivot in (1..size).rev() {
        let (above, below) = matrix.split_at_mut(pivot * size);
        let line = &below[..pivot];
        let inverse = below[pivot].inv();
        for i in 0..pivot {
            let factor = line[i] * inverse;
            for j in 0..=i {
                above[i * size + j] -= factor * line[j];
            }
        }
    }
    matrix[0]
}

/// A Fourier component of the stresses.
struct Wave {
    q: Complex<f64>,
    k: f64,
    s: Complex<f64>,
    m: Complex<f64>,
    sum: Complex<f64>,
    reynolds: f64,
}

impl Wave {
    fn new(q: Complex<f64>, k: f64, reynolds: f64) -> Self {
        let square = q * q + k * k;
        let s = square.square_root();
        let m = (square + Complex::new(0.0, reynolds)).square_root();
        let sum = (m + s).inv();
        Self {
            q,
            k,
            s,
            m,
            sum,
            reynolds,
        }
    }

    /// The normal velocity of a normal stress 1.
    fn unbounded(&self) -> Complex<f64> {
        0.5 * self.s * self.sum / self.m
    }

    /// Velocities along z, y, x (rows) by stresses along z, y, x at the height `h` over a wall. Those along
    /// y and x are a quarter of a wave ahead of that along z, so that the matrix is real and symmetric for
    /// a slow flow.
    ///
    /// With the direction l along the wave and t across it, the flow of a stress along z or l in an
    /// unbounded fluid is (w₀, u₀) at the wall, and c₁e^{−sz} + c₂e^{−mz} with c₂ = s(w₀ − iu₀)/(m − s) and
    /// c₁ = −w₀ − c₂ cancels it there. A stress along t has a mirror image.
    fn over(&self, h: f64) -> [[Complex<f64>; 3]; 3] {
        let Self {
            q, k, s, m, sum, ..
        } = *self;
        let decay = (-s * h).exponential();
        let viscous_decay = (-m * h).exponential();
        // (1 − e^{−x})/(m − s) of x = (m − s)h.
        let slip = h * mean_decay(Complex::new(0.0, self.reynolds) * sum * h);
        let both = 0.5 * s * decay * sum * slip;
        let normal = 0.5 * s * sum * viscous_decay / m;
        let along = 0.5 * sum * viscous_decay;
        let carried = s * slip * decay;
        // w₀ and w₀ − iu₀ of the normal stress, and the latter over i of the tangential one.
        let at_wall = both + normal;
        let strength = both + at_wall;
        let tangential = 2.0 * both - along;
        let zz = self.unbounded() - at_wall * decay - strength * carried;
        let zl = -both * decay - tangential * carried;
        let ll = 0.5 * sum - both * decay - tangential * (carried - viscous_decay);
        let tt = 0.5 * (1.0 - viscous_decay * viscous_decay) / m;
        let (y, x) = (q / s, k / s);
        let yx = x * y * (ll - tt);
        let (zy, zx) = (zl * y, zl * x);
        [
            [zz, zy, zx],
            [zy, y * y * ll + x * x * tt, yx],
            [zx, yx, x * x * ll + y * y * tt],
        ]
    }
}

/// Computes (1 − e^{−x})/x, the mean of e^{−t} for t from 0 to x.
fn mean_decay(x: Complex<f64>) -> Complex<f64> {
    if x.modulus() > 0.3 {
        return (1.0 - (-x).exponential()) / x;
    }
    let one = Complex::new(1.0, 0.0);
    (2..18)
        .rev()
        .fold(one, |sum, k| one - sum * x / f64::from(k))
}

/// A node of the integrals over q.
struct Node {
    q: Complex<f64>,
    weight: Complex<f64>,
    /// J_n, or a part of it, with the signs + + − − + + … of Fourier transforms.
    functions: [Complex<f64>; FUNCTIONS],
}

static NODES: LazyLock<Vec<Node>> = LazyLock::new(|| {
    let signed = |values: [Complex<f64>; FUNCTIONS]| {
        from_fn(|n| if n % 4 < 2 { values[n] } else { -values[n] })
    };
    let complex = |value: f64| Complex::new(value, 0.0);
    let mut nodes = Vec::new();
    let mut add = |q, weight, values| {
        nodes.push(Node {
            q,
            weight,
            functions: signed(values),
        });
    };
    // From 0 on: 3^−12, 3^−11, …, 1, 2, 4 and in equal panels.
    let mut edges: Vec<f64> = (-13..=0).map(|j| 3.0_f64.powi(j)).collect();
    edges[0] = 0.0;
    edges.push(2.0);
    edges.extend((0..=8).map(|j| 4.0 + f64::from(j) * (JOIN - 4.0) / 8.0));
    for (q, weight) in panels(&edges) {
        add(complex(q), complex(weight), bessel(q).map(complex));
    }
    // H¹H² = J² + Y², to 4^5 JOIN and from there to infinity by 1/q.
    let mut edges: Vec<f64> = (0..=5).map(|j| JOIN * 4.0_f64.powi(j)).collect();
    let mut smooth = panels(&edges);
    let last = edges.pop().unwrap_or(JOIN);
    smooth.extend(
        panels(&[0.0, 1.0])
            .iter()
            .map(|(t, weight)| (last / t, weight * last / (t * t))),
    );
    for (q, weight) in smooth {
        let values = hankel(complex(q));
        let half = complex(0.5 * weight);
        add(complex(q), half, values.map(|value| complex(value.re)));
        add(complex(q), half, values.map(|value| complex(value.im)));
    }
    // H¹H¹ and H²H²; e^{iq} is not in the functions.
    for (t, weight) in panels(&[0.0, 1.0, 3.0, 8.0, 18.0]) {
        let q = Complex::new(JOIN, t);
        let values = hankel(q);
        let turned = Complex::new(0.0, 0.25 * weight)
            * from_polar(nanotap_arithmetic::exp(-2.0 * t), 2.0 * JOIN);
        add(q, turned, values);
        add(q.conj(), turned.conj(), values.map(|value| value.conj()));
    }
    nodes
});

/// Nodes and weights of Gauss's rule between each two edges.
fn panels(edges: &[f64]) -> Vec<(f64, f64)> {
    let (places, weights) = gauss_legendre(PANEL);
    let of_panel = |ends: &[f64]| {
        let (start, width) = (ends[0], ends[1] - ends[0]);
        let scaled = move |(place, weight): (&f64, &f64)| (start + width * place, width * weight);
        places.iter().zip(weights).map(scaled)
    };
    edges.windows(2).flat_map(of_panel).collect()
}

/// J_0, J_1, … at q > 0, by the recurrence downwards from an order far beyond q, normalized by
/// 1 = J_0 + 2J_2 + 2J_4 + ….
fn bessel(q: f64) -> [f64; FUNCTIONS] {
    /// Even, and far beyond the largest q and order.
    const START: usize = 110;
    let mut found = [0.0; FUNCTIONS];
    let (mut above, mut value, mut sum) = (0.0, 1e-250, 0.0);
    for n in (1..=START).rev() {
        if n < FUNCTIONS {
            found[n] = value;
        }
        if n % 2 == 0 {
            sum += 2.0 * value;
        }
        (above, value) = (value, 2.0 * n as f64 / q * value - above);
        if f64::abs(value) > 1e200 {
            for number in found.iter_mut().chain([&mut above, &mut value, &mut sum]) {
                *number *= 1e-250;
            }
        }
    }
    found[0] = value;
    sum += value;
    found.map(|value| value / sum)
}

/// H¹_0, H¹_1, … times e^{−iq} for |q| ≥ [`JOIN`], by the recurrence upwards from Hankel's asymptotic
/// series.
fn hankel(q: Complex<f64>) -> [Complex<f64>; FUNCTIONS] {
    let size = (FRAC_2_PI / q).square_root();
    let first = |order: f64| {
        let (mut term, mut sum) = (Complex::new(1.0, 0.0), Complex::new(1.0, 0.0));
        for k in 1..=30 {
            let k = f64::from(k);
            let odd = 2.0 * k - 1.0;
            term *= Complex::new(0.0, (4.0 * order * order - odd * odd) / (8.0 * k)) / q;
            sum += term;
        }
        size * from_polar(1.0, -order * FRAC_PI_2 - FRAC_PI_4) * sum
    };
    let mut found = [Complex::new(0.0, 0.0); FUNCTIONS];
    (found[0], found[1]) = (first(0.0), first(1.0));
    for n in 1..FUNCTIONS - 1 {
        found[n + 1] = 2.0 * n as f64 / q * found[n] - found[n - 1];
    }
    found
}

#[cfg(test)]
mod tests;
