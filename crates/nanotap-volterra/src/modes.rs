//! The linear modes: real blocks of one or two coordinates in which the linear flow
//! `ẋ = A x` is block-diagonal.
//!
//! A pair of eigenvalues, complex, real or coinciding (critical damping), is one real
//! 2 × 2 block whose exponential is written with `cos`, `cosh` and their quotients, smooth
//! through the defective case. Three or more coinciding eigenvalues are refused.

// Only what is inlined into a function for wide registers gets their instructions.
#![allow(clippy::inline_always)]

use crate::{Complex, VolterraError};
use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{DMatrix, DVector};
use nanotap_arithmetic::ComplexFunctions as _;

/// Largest dimension of the state.
pub const MAX_DIMENSION: usize = 200;
/// Distance of two eigenvalues, as a fraction of their size, below which they share a block found
/// as a plane.
const CLOSE: f64 = 0.05;
/// Largest relative residual with which a basis that rebuilds its matrix is accepted.
const ACCEPTED_RESIDUAL: f64 = 1e-9;
/// Largest number of halvings of the times in [`Block::short_exps`].
const MAX_DOUBLINGS: usize = 40;

/// One or two coordinates that the linear flow does not couple to others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Index of its first coordinate.
    pub start: usize,
    /// Number of its coordinates, 1 or 2.
    pub size: usize,
    /// Matrix `B` of `ẏ = B y`, in rows; the second row and column of a single coordinate are zero.
    pub matrix: [[f64; 2]; 2],
}

impl Block {
    /// Returns the exponential `e^{Bt}` for a time `t`, in rows.
    #[inline]
    pub fn exp(&self, t: f64) -> [[f64; 2]; 2] {
        let [[a, b], [c, d]] = self.matrix;
        if self.size == 1 {
            return [[nanotap_arithmetic::exp(a * t), 0.0], [0.0, 0.0]];
        }
        // B = μ + N with N² = D: e^{Bt} = e^{μt} (C + S N).
        let mean = 0.5 * (a + d);
        let half = 0.5 * (a - d);
        let discriminant = half * half + b * c;
        let decay = nanotap_arithmetic::exp(mean * t);
        let (even, odd) = even_and_odd(discriminant, t, mean, decay);
        [[even + odd * half, odd * b], [odd * c, even - odd * half]]
    }

    /// `e^{Bt} = C + S N` with `N` as in [`Self::turn`], as `(C, S)` at many times over which the
    /// block turns or decays little: the series of a part of each time, doubled up again. No
    /// function is called, so that all times are worked on together.
    #[inline(always)]
    pub(crate) fn short_exps<const P: usize>(&self, times: &[f64; P]) -> ([f64; P], [f64; P]) {
        let [[a, b], [c, d]] = self.matrix;
        let (mean, discriminant) = if self.size == 1 {
            (a, 0.0)
        } else {
            let half = 0.5 * (a - d);
            (0.5 * (a + d), half * half + b * c)
        };
        let longest = times.iter().fold(0.0, |m, t| f64::max(m, t.abs()));
        let mut reach = longest * self.rate();
        let (mut doublings, mut part) = (0, 1.0);
        while reach > 1.0 && doublings < MAX_DOUBLINGS {
            reach *= 0.5;
            part *= 0.5;
            doublings += 1;
        }
        let gentle = mean.abs() * longest * part < 1.0 / 16.0;
        let (mut even, mut odd) = ([0.0; P], [0.0; P]);
        for i in 0..P {
            let t = part * times[i];
            let z = discriminant * t * t;
            let w = mean * t;
            // The terms left out are below 1/18!.
            let (mut cosine, mut sine, mut decay) = (1.0, 1.0, 1.0);
            for k in (1..9).rev() {
                let k = 2.0 * k as f64;
                cosine = 1.0 + cosine * z * (1.0 / ((k - 1.0) * k));
                sine = 1.0 + sine * z * (1.0 / (k * (k + 1.0)));
            }
            if gentle {
                // Below (1/16)⁹/9!.
                for k in (1..9).rev() {
                    decay = 1.0 + decay * w * (1.0 / k as f64);
                }
            } else {
                for k in (1..18).rev() {
                    decay = 1.0 + decay * w * (1.0 / k as f64);
                }
            }
            even[i] = decay * cosine;
            odd[i] = decay * (t * sine);
        }
        for _ in 0..doublings {
            for i in 0..P {
                let (c, s) = (even[i], odd[i]);
                even[i] = c * c + discriminant * (s * s);
                odd[i] = 2.0 * (c * s);
            }
        }
        (even, odd)
    }

    /// Returns `(C + S N) b`, where `B = μ + N` with the mean `μ` of its diagonal.
    #[inline]
    pub(crate) fn turn(&self, even: f64, odd: f64, [x, y]: [f64; 2]) -> [f64; 2] {
        let [[a, b], [c, d]] = self.matrix;
        if self.size == 1 {
            return [even * x, 0.0];
        }
        let half = 0.5 * (a - d);
        [
            even * x + odd * (half * x + b * y),
            even * y + odd * (c * x - half * y),
        ]
    }

    /// Returns a bound of the absolute eigenvalues, per unit of time.
    pub fn rate(&self) -> f64 {
        let [[a, b], [c, d]] = self.matrix;
        if self.size == 1 {
            return a.abs();
        }
        let mean = 0.5 * (a + d);
        let discriminant = 0.25 * (a - d) * (a - d) + b * c;
        if discriminant < 0.0 {
            (mean * mean - discriminant).sqrt()
        } else {
            mean.abs() + discriminant.sqrt()
        }
    }
}

/// Computes `e^{μt} cosh(√D t)` and `e^{μt} sinh(√D t)/√D`, for any sign of `D`.
#[inline]
fn even_and_odd(discriminant: f64, t: f64, mean: f64, decay: f64) -> (f64, f64) {
    let size = discriminant.abs() * t * t;
    if size < 1e-3 {
        let z = discriminant * t * t;
        let even = 1.0 + z / 2.0 * (1.0 + z / 12.0 * (1.0 + z / 30.0 * (1.0 + z / 56.0)));
        let odd = t * (1.0 + z / 6.0 * (1.0 + z / 20.0 * (1.0 + z / 42.0 * (1.0 + z / 72.0))));
        (decay * even, decay * odd)
    } else if discriminant < 0.0 {
        let w = (-discriminant).sqrt();
        let (sin, cos) = nanotap_arithmetic::sin_cos(w * t);
        (decay * cos, decay * sin / w)
    } else {
        let r = discriminant.sqrt();
        let (fast, slow) = (
            nanotap_arithmetic::exp((mean + r) * t),
            nanotap_arithmetic::exp((mean - r) * t),
        );
        (0.5 * (fast + slow), 0.5 * (fast - slow) / r)
    }
}

/// The modes of a linear system: `x = R y`, `ẏ = B y` with `B` block-diagonal.
#[derive(Clone, Debug, PartialEq)]
pub struct Modes {
    blocks: Vec<Block>,
    right: DMatrix<f64>,
    left: DMatrix<f64>,
}

impl Modes {
    /// Computes the modes of a general real matrix `A` (`n × n`).
    ///
    /// # Errors
    /// [`VolterraError::IllConditioned`] where three or more eigenvalues coincide;
    /// [`VolterraError::Shape`], [`VolterraError::TooLarge`] and [`VolterraError::Value`] for
    /// a matrix that is not square, too large or not finite.
    pub fn from_matrix(matrix: &DMatrix<f64>) -> Result<Self, VolterraError> {
        let n = check_square(matrix)?;
        let mut balanced = matrix.clone();
        let scale = balance_parlett_reinsch(&mut balanced);
        let eigenvalues =
            nanotap_arithmetic::eigenvalues(&balanced).ok_or(VolterraError::IllConditioned {
                residual: f64::INFINITY,
            })?;
        let mut right = DMatrix::zeros(n, n);
        let mut sizes = Vec::new();
        let mut column = 0;
        for group in groups(&eigenvalues) {
            let basis = group.basis(&balanced)?;
            if column + basis.ncols() > n {
                return Err(VolterraError::IllConditioned {
                    residual: f64::INFINITY,
                });
            }
            right.columns_mut(column, basis.ncols()).copy_from(&basis);
            column += basis.ncols();
            sizes.push(basis.ncols());
        }
        let unusable = VolterraError::IllConditioned {
            residual: f64::INFINITY,
        };
        if column != n {
            return Err(unusable);
        }
        let left = right.clone().try_inverse().ok_or(unusable)?;
        let rebuilt = &left * &balanced * &right;
        let mut blocks = Vec::with_capacity(sizes.len());
        let mut rest = rebuilt.clone();
        let mut start = 0;
        for size in sizes {
            let mut block = [[0.0; 2]; 2];
            for i in 0..size {
                for j in 0..size {
                    block[i][j] = rebuilt[(start + i, start + j)];
                    rest[(start + i, start + j)] = 0.0;
                }
            }
            blocks.push(Block {
                start,
                size,
                matrix: block,
            });
            start += size;
        }
        let residual = rest.amax() / balanced.amax().max(f64::MIN_POSITIVE);
        if residual > ACCEPTED_RESIDUAL || residual.is_nan() {
            return Err(VolterraError::IllConditioned { residual });
        }
        let mut modes = Self {
            blocks,
            right,
            left,
        };
        for i in 0..n {
            for k in 0..n {
                modes.right[(i, k)] *= scale[i];
                modes.left[(k, i)] /= scale[i];
            }
        }
        Ok(modes)
    }

    /// Modes whose eigenvalues and vectors the caller knows better than a general algorithm
    /// could find them: `q = L x`, `x = Re(R q)`, `q̇_k = λ_k q_k`, one complex coordinate a
    /// conjugate pair (its column of `right`, `n × m`, with the factor 2 of `2 Re`), one with
    /// zero imaginary part a real eigenvalue; `left` is `m × n`.
    ///
    /// # Errors
    /// [`VolterraError::Shape`] when the sizes do not fit.
    pub fn from_eigenpairs(
        eigenvalues: &[Complex],
        right: &DMatrix<Complex>,
        left: &DMatrix<Complex>,
    ) -> Result<Self, VolterraError> {
        let (n, m) = right.shape();
        check_size(n)?;
        let dimension: usize = eigenvalues
            .iter()
            .map(|l| if l.im == 0.0 { 1 } else { 2 })
            .sum();
        for (what, found, expected) in [
            ("the list of eigenvalues", eigenvalues.len(), m),
            ("the left eigenvectors", left.nrows(), m),
            ("a left eigenvector", left.ncols(), n),
            ("the real basis of the eigenvectors", dimension, n),
        ] {
            if found != expected {
                return Err(VolterraError::Shape {
                    what,
                    found,
                    expected,
                });
            }
        }
        let mut modes = Self {
            blocks: Vec::with_capacity(m),
            right: DMatrix::zeros(n, n),
            left: DMatrix::zeros(n, n),
        };
        let mut start = 0;
        for (k, lambda) in eigenvalues.iter().enumerate() {
            let size = if lambda.im == 0.0 { 1 } else { 2 };
            for i in 0..n {
                modes.right[(i, start)] = right[(i, k)].re;
                modes.left[(start, i)] = left[(k, i)].re;
                if size == 2 {
                    modes.right[(i, start + 1)] = -right[(i, k)].im;
                    modes.left[(start + 1, i)] = left[(k, i)].im;
                }
            }
            let matrix = if size == 2 {
                [[lambda.re, -lambda.im], [lambda.im, lambda.re]]
            } else {
                [[lambda.re, 0.0], [0.0, 0.0]]
            };
            modes.blocks.push(Block {
                start,
                size,
                matrix,
            });
            start += size;
        }
        Ok(modes)
    }

    /// Creates uncoupled oscillators `z̈_k + c_k ż_k + κ_k z_k = …`, given as `(κ_k, c_k)`; the
    /// state is `(z_1 … z_N, ż_1 … ż_N)`.
    ///
    /// # Errors
    /// [`VolterraError::TooLarge`] or [`VolterraError::Value`] (a negative or infinite `κ`).
    pub fn from_oscillators(oscillators: &[(f64, f64)]) -> Result<Self, VolterraError> {
        let modes = oscillators.len();
        let n = 2 * modes;
        check_size(n)?;
        let mut blocks = Vec::with_capacity(modes);
        let mut right = DMatrix::zeros(n, n);
        let mut left = DMatrix::zeros(n, n);
        for (k, &(stiffness, damping)) in oscillators.iter().enumerate() {
            for (what, found) in [("stiffness", stiffness), ("damping", damping)] {
                if !found.is_finite() || (what == "stiffness" && found < 0.0) {
                    return Err(VolterraError::Value {
                        what: format!("the {what} of mode {}", k + 1),
                        found,
                        needed: "finite and, of a stiffness, not negative",
                    });
                }
            }
            // y = (ω z, ż): both coordinates have the size of a velocity.
            let omega = stiffness.sqrt();
            let scale = if omega > 0.0 { omega } else { 1.0 };
            right[(k, 2 * k)] = 1.0 / scale;
            right[(modes + k, 2 * k + 1)] = 1.0;
            left[(2 * k, k)] = scale;
            left[(2 * k + 1, modes + k)] = 1.0;
            blocks.push(Block {
                start: 2 * k,
                size: 2,
                matrix: [[0.0, scale], [-stiffness / scale, -damping]],
            });
        }
        Ok(Self {
            blocks,
            right,
            left,
        })
    }

    /// Returns the modes with additional coordinates `ẏ = −rate y` at the end of the state, which
    /// are not coupled to others.
    ///
    /// # Errors
    /// [`VolterraError::TooLarge`].
    pub fn with_decays(&self, rates: &[f64]) -> Result<Self, VolterraError> {
        let n = self.dimension();
        let whole = n + rates.len();
        check_size(whole)?;
        let mut modes = Self {
            blocks: self.blocks.clone(),
            right: self.right.clone().resize(whole, whole, 0.0),
            left: self.left.clone().resize(whole, whole, 0.0),
        };
        for (start, rate) in (n..).zip(rates) {
            modes.right[(start, start)] = 1.0;
            modes.left[(start, start)] = 1.0;
            modes.blocks.push(Block {
                start,
                size: 1,
                matrix: [[-rate, 0.0], [0.0, 0.0]],
            });
        }
        Ok(modes)
    }

    /// Returns the dimension `n` of the state.
    pub fn dimension(&self) -> usize {
        self.right.nrows()
    }

    /// Returns the blocks, in the order of their coordinates.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Returns the matrix `R` (`n × n`) of `x = R y`.
    pub fn right(&self) -> &DMatrix<f64> {
        &self.right
    }

    /// Returns the matrix `L = R⁻¹` (`n × n`) of `y = L x`.
    pub fn left(&self) -> &DMatrix<f64> {
        &self.left
    }

    /// Writes `B y` to `out`.
    pub fn apply(&self, y: &[f64], out: &mut [f64]) {
        for block in &self.blocks {
            let s = block.start;
            if block.size == 1 {
                out[s] = block.matrix[0][0] * y[s];
            } else {
                let (u, v) = (y[s], y[s + 1]);
                out[s] = block.matrix[0][0] * u + block.matrix[0][1] * v;
                out[s + 1] = block.matrix[1][0] * u + block.matrix[1][1] * v;
            }
        }
    }

    /// Solves `(iω − B) Y = b`, the response of the modal coordinates to a tone.
    ///
    /// # Errors
    /// [`VolterraError::Resonance`] where `iω` is an eigenvalue and `b` excites it.
    pub(crate) fn response(
        &self,
        omega: f64,
        b: &DVector<Complex>,
    ) -> Result<DVector<Complex>, VolterraError> {
        let size = b.iter().map(|v| v.modulus()).fold(0.0, f64::max);
        let mut out = DVector::zeros(b.len());
        let z = Complex::new(0.0, omega);
        for block in &self.blocks {
            let s = block.start;
            let part = (0..block.size)
                .map(|i| b[s + i].modulus())
                .fold(0.0, f64::max);
            if part <= 1e-15 * size {
                continue;
            }
            let [[m00, m01], [m10, m11]] = block.matrix;
            let scale = omega.abs().max(block.rate());
            let resonance = VolterraError::Resonance { frequency: omega };
            if block.size == 1 {
                let denominator = z - m00;
                if denominator.modulus() <= 1e-13 * scale {
                    return Err(resonance);
                }
                out[s] = b[s] / denominator;
            } else {
                let determinant = (z - m00) * (z - m11) - m01 * m10;
                if determinant.modulus() <= 1e-13 * scale * scale {
                    return Err(resonance);
                }
                out[s] = ((z - m11) * b[s] + b[s + 1] * m01) / determinant;
                out[s + 1] = ((z - m00) * b[s + 1] + b[s] * m10) / determinant;
            }
        }
        Ok(out)
    }
}

fn check_size(n: usize) -> Result<(), VolterraError> {
    if n == 0 {
        return Err(VolterraError::Shape {
            what: "the state",
            found: 0,
            expected: 1,
        });
    }
    if n > MAX_DIMENSION {
        return Err(VolterraError::TooLarge {
            what: "the dimension of the state",
            found: n,
            limit: MAX_DIMENSION,
        });
    }
    Ok(())
}

fn check_square(matrix: &DMatrix<f64>) -> Result<usize, VolterraError> {
    let n = matrix.nrows();
    check_size(n)?;
    if matrix.ncols() != n {
        return Err(VolterraError::Shape {
            what: "a row of the modes' matrix",
            found: matrix.ncols(),
            expected: n,
        });
    }
    if let Some(&found) = matrix.iter().find(|v| !v.is_finite()) {
        return Err(VolterraError::Value {
            what: "an entry of the modes' matrix".into(),
            found,
            needed: "finite",
        });
    }
    Ok(n)
}

/// A group of eigenvalues whose invariant subspace becomes one block.
#[derive(Clone, Copy, Debug)]
enum Group {
    /// A conjugate pair, `Im λ > 0`.
    Pair(Complex),
    /// Two eigenvalues near this real number.
    Plane(f64),
    /// A real eigenvalue without a close neighbour.
    Line(f64),
}

fn groups(eigenvalues: &[Complex]) -> Vec<Group> {
    let mut groups = Vec::new();
    let mut reals = Vec::new();
    for l in eigenvalues {
        if l.im.abs() <= CLOSE * l.modulus() {
            reals.push(l.re);
        } else if l.im > 0.0 {
            groups.push(Group::Pair(*l));
        }
    }
    reals.sort_by(f64::total_cmp);
    let mut k = 0;
    while k < reals.len() {
        let size = reals[k].abs();
        if k + 1 < reals.len() && (reals[k + 1] - reals[k]).abs() <= CLOSE * size {
            groups.push(Group::Plane(0.5 * (reals[k] + reals[k + 1])));
            k += 2;
        } else {
            groups.push(Group::Line(reals[k]));
            k += 1;
        }
    }
    groups
}

impl Group {
    /// Computes a basis of the invariant subspace by inverse iteration.
    fn basis(self, a: &DMatrix<f64>) -> Result<DMatrix<f64>, VolterraError> {
        let n = a.nrows();
        let unusable = VolterraError::IllConditioned {
            residual: f64::INFINITY,
        };
        // The shift is moved off the eigenvalue by a few roundings so that the solve exists.
        let nudge = 1e-14 * a.amax().max(f64::MIN_POSITIVE);
        let start = |i: usize| 1.0 + ((i * 7919 + 13) % 101) as f64 / 101.0;
        match self {
            Self::Pair(lambda) => {
                let shift = lambda + Complex::new(nudge, nudge);
                let lu = (a.map(|v| Complex::new(v, 0.0))
                    - DMatrix::from_diagonal_element(n, n, shift))
                .lu();
                let mut v = DVector::from_fn(n, |i, _| Complex::new(start(i), start(i + n)));
                for _ in 0..4 {
                    v = lu.solve(&v).ok_or(unusable.clone())?;
                    v.unscale_mut(v.norm());
                }
                Ok(DMatrix::from_fn(n, 2, |i, j| {
                    if j == 0 { v[i].re } else { -v[i].im }
                }))
            }
            Self::Plane(mean) | Self::Line(mean) => {
                let (width, rounds, nudge) = if matches!(self, Self::Plane(_)) {
                    // Two eigenvalues at once: the shift may keep a distance.
                    (2, 30, 1e-6 * a.amax())
                } else {
                    (1, 6, nudge)
                };
                let lu = (a - DMatrix::from_diagonal_element(n, n, mean + nudge)).lu();
                let mut v = DMatrix::from_fn(n, width, |i, j| start(i + j * n));
                for _ in 0..rounds {
                    v = lu.solve(&v).ok_or(unusable.clone())?;
                    v = v.qr().q();
                }
                Ok(v)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exponential(modes: &Modes, t: f64) -> DMatrix<f64> {
        let n = modes.dimension();
        let mut e = DMatrix::zeros(n, n);
        for block in modes.blocks() {
            let part = block.exp(t);
            for i in 0..block.size {
                for j in 0..block.size {
                    e[(block.start + i, block.start + j)] = part[i][j];
                }
            }
        }
        modes.right() * e * modes.left()
    }

    fn companion(oscillators: &[(f64, f64)]) -> DMatrix<f64> {
        let n = oscillators.len();
        let mut a = DMatrix::zeros(2 * n, 2 * n);
        for (k, &(stiffness, damping)) in oscillators.iter().enumerate() {
            a[(k, n + k)] = 1.0;
            a[(n + k, k)] = -stiffness;
            a[(n + k, n + k)] = -damping;
        }
        // Coupled, so that nothing is diagonal by luck.
        for i in 0..n {
            for j in 0..n {
                a[(n + i, n + j)] -= 0.01 * ((i + 1) as f64) / ((j + 1) as f64);
            }
        }
        a
    }

    #[test]
    fn the_blocks_give_the_matrix_exponential() {
        for oscillators in [
            vec![(1.0, 0.1)],
            vec![(1.0, 0.1), (40.0, 0.2), (300.0, 0.3)],
            // Overdamped and lightly damped.
            vec![(1.0, 9.0), (40.0, 0.2)],
            vec![(1.0, 1.99), (40.0, 0.2)],
        ] {
            let a = companion(&oscillators);
            let modes = Modes::from_matrix(&a).unwrap();
            for t in [0.0, 1e-3, 0.4, 2.5] {
                let reference = nanotap_arithmetic::matrix_exp(&(&a * t));
                let error = (exponential(&modes, t) - &reference).amax();
                assert!(error < 1e-11 * (1.0 + reference.amax()), "{error}");
            }
        }
    }

    #[test]
    fn short_exponentials_are_the_exponentials() {
        for (stiffness, damping) in [(1.0, 0.1), (400.0, 0.0), (1.0, 9.0), (1.0, 2.0)] {
            let block = Modes::from_oscillators(&[(stiffness, damping)])
                .unwrap()
                .blocks()[0];
            for reach in [1e-3, 0.7, 8.0] {
                let end = reach / block.rate();
                let times = [0.0, 0.1, 0.5, 1.0].map(|x| x * end);
                let (even, odd) = block.short_exps(&times);
                for (k, t) in times.into_iter().enumerate() {
                    let e = block.exp(t);
                    for (j, unit) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
                        let found = block.turn(even[k], odd[k], unit);
                        let size = 1.0 + e[0][j].abs() + e[1][j].abs();
                        assert!((found[0] - e[0][j]).abs() < 2e-14 * size);
                        assert!((found[1] - e[1][j]).abs() < 2e-14 * size);
                    }
                }
            }
        }
    }

    #[test]
    fn critical_damping_is_one_smooth_block() {
        for (stiffness, damping) in [(1.0, 2.0), (1.0, 2.0 + 1e-9), (1.0, 2.0 - 1e-9)] {
            let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -stiffness, -damping]);
            for modes in [
                Modes::from_matrix(&a).unwrap(),
                Modes::from_oscillators(&[(stiffness, damping)]).unwrap(),
            ] {
                let t = 1.7;
                let e = exponential(&modes, t);
                // z(t) of z(0) = 1, ż(0) = 0 at critical damping is (1 + t) e^{−t}.
                assert!((e[(0, 0)] - (1.0 + t) * (-t).exp()).abs() < 3e-9);
                assert!((e - nanotap_arithmetic::matrix_exp(&(&a * t))).amax() < 1e-12);
            }
        }
    }

    #[test]
    fn three_coinciding_eigenvalues_are_refused() {
        let a = DMatrix::from_row_slice(3, 3, &[-1.0, 1.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0, -1.0]);
        assert!(matches!(
            Modes::from_matrix(&a),
            Err(VolterraError::IllConditioned { .. })
        ));
    }
}
