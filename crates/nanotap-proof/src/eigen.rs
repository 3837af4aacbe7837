//! Eigenvalues and eigenvectors of a real matrix, enclosed.
//!
//! For an approximate pair (λ, v), the unknowns are the d entries of δv, with δλ in place of δv_p,
//! and the equations are (A − λ − δλ)(v + δv) = 0, δv_p = 0 where |v_p| is largest. Krawczyk's
//! operator has a fixed point in a box that it maps into its interior (Rump, Acta Numerica 19,
//! 2010, Sec. 13.4). Pairwise disjoint boxes contain all eigenvalues, one each.

use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{Complex, DMatrix, DVector};

use crate::complex::Rectangle;
use crate::interval::Interval;
use crate::matrix::Matrix;

/// Diagonalisation of a real matrix A: A = V diag(λ) V⁻¹. Of each pair of conjugate eigenvalues
/// only the one with positive imaginary part is stored, and its vectors have the factor 2, so that
/// real vectors are x = Re(R L x).
#[derive(Clone, Debug)]
pub struct Eigenbasis {
    /// Enclosures of the eigenvalues λ_k, one of each conjugate pair.
    pub values: Vec<Rectangle>,
    /// R, whose columns are right eigenvectors.
    pub right: Matrix<Rectangle>,
    /// L, whose rows are left eigenvectors.
    pub left: Matrix<Rectangle>,
}

impl Eigenbasis {
    /// The eigenbases of all matrices in `matrix`; `None` if eigenvalues are too close to be
    /// separated.
    pub fn of(matrix: &Matrix<Interval>) -> Option<Self> {
        let n = matrix.rows();
        // Balanced by powers of two, exact except for the last place.
        let mut balanced = matrix.middle();
        let scale = balance_parlett_reinsch(&mut balanced);
        let scaled = Matrix::from_fn(n, n, |i, j| {
            matrix[(i, j)] * Interval::point(scale[j]) / Interval::point(scale[i])
        });
        let mut values = Vec::new();
        let mut vectors = Vec::new();
        for (value, vector) in approximate_pairs(&balanced)? {
            if value.im < 0.0 {
                continue;
            }
            let (value, vector) = enclosed_pair(&scaled, value, &vector)?;
            values.push(value);
            vectors.push(vector);
        }
        let paired = |k: usize| values[k].im != Interval::ZERO;
        let all: Vec<(usize, bool)> = (0..values.len())
            .flat_map(|k| {
                let other = paired(k).then_some((k, true));
                std::iter::once((k, false)).chain(other)
            })
            .collect();
        if all.len() != n {
            return None;
        }
        let turned = |z: Rectangle, conjugate: bool| if conjugate { z.conj() } else { z };
        for (place, &(k, a)) in all.iter().enumerate() {
            for &(l, b) in &all[..place] {
                if !turned(values[k], a).is_disjoint(turned(values[l], b)) {
                    return None;
                }
            }
        }
        let whole = Matrix::from_fn(n, n, |i, j| {
            let (k, conjugate) = all[j];
            turned(vectors[k][i], conjugate)
        });
        let inverse = whole.inverse()?;
        let kept: Vec<usize> = (0..n).filter(|&j| !all[j].1).collect();
        let factor = |k: usize| Interval::point(if paired(k) { 2.0 } else { 1.0 });
        let right = Matrix::from_fn(n, kept.len(), |i, k| {
            vectors[k][i].scale(factor(k) * Interval::point(scale[i]))
        });
        let left = Matrix::from_fn(kept.len(), n, |k, i| {
            let z = inverse[(kept[k], i)];
            let by = Interval::ONE / Interval::point(scale[i]);
            // The row of a real eigenvalue is real.
            if paired(k) {
                z.scale(by)
            } else {
                Rectangle::real(z.re * by)
            }
        });
        Some(Self {
            values,
            right,
            left,
        })
    }
}

/// An approximate eigenvalue and its eigenvector.
pub(crate) type Pair = (Complex<f64>, DVector<Complex<f64>>);

/// Approximate eigenvalues and eigenvectors, by Schur's form and inverse iteration.
pub(crate) fn approximate_pairs(matrix: &DMatrix<f64>) -> Option<Vec<Pair>> {
    let n = matrix.nrows();
    if matrix.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let values = nanotap_arithmetic::eigenvalues(matrix)?;
    let complex = matrix.map(|x| Complex::new(x, 0.0));
    let size = matrix.amax().max(f64::MIN_POSITIVE);
    let mut pairs = Vec::with_capacity(n);
    for value in values {
        let factor = (0..6).find_map(|k| {
            let off = f64::EPSILON * size * 8.0_f64.powi(k);
            let mut shifted = complex.clone();
            for i in 0..n {
                shifted[(i, i)] -= value + Complex::new(off, 0.0);
            }
            let factor = shifted.lu();
            factor.is_invertible().then_some(factor)
        })?;
        // Irregular and fixed, so that equal input gives equal bits.
        let mut vector = DVector::from_fn(n, |i, _| {
            Complex::new(((i + 1) as f64 * 0.618_033_988_749).fract() + 0.31, 0.0)
        });
        for _ in 0..4 {
            vector = factor.solve(&vector)?;
            let largest = *vector
                .iter()
                .max_by(|a, b| a.norm_sqr().total_cmp(&b.norm_sqr()))?;
            if !(largest.norm_sqr() > 0.0 && largest.norm_sqr().is_finite()) {
                return None;
            }
            vector /= largest;
        }
        // The Rayleigh quotient at the largest entry.
        let at = (0..n).find(|&i| vector[i] == Complex::new(1.0, 0.0))?;
        let better = (complex.row(at) * &vector)[0];
        let value = if value.im == 0.0 {
            vector.apply(|z| z.im = 0.0);
            Complex::new(better.re, 0.0)
        } else {
            better
        };
        pairs.push((value, vector));
    }
    Some(pairs)
}

/// Boxes around an approximate eigenvalue and its vector that contain an exact pair of every
/// matrix.
fn enclosed_pair(
    matrix: &Matrix<Interval>,
    value: Complex<f64>,
    vector: &DVector<Complex<f64>>,
) -> Option<(Rectangle, Vec<Rectangle>)> {
    /// Largest number of enclosures that are tried, each wider than the one before.
    const MAX_ROUNDS: usize = 12;
    let n = matrix.rows();
    let fixed = (0..n).max_by(|&a, &b| vector[a].norm_sqr().total_cmp(&vector[b].norm_sqr()))?;
    let lambda = Rectangle::point(value);
    let v: Vec<Rectangle> = vector.iter().map(|&z| Rectangle::point(z)).collect();
    let shifted = Matrix::from_fn(n, n, |i, j| {
        let entry = Rectangle::real(matrix[(i, j)]);
        if i == j { entry - lambda } else { entry }
    });
    let jacobian = Matrix::from_fn(
        n,
        n,
        |i, j| if j == fixed { -v[i] } else { shifted[(i, j)] },
    );
    let inverse = Matrix::points(&jacobian.middle().try_inverse()?);
    let residual = inverse.apply(&shifted.apply(&v));
    let left = &Matrix::identity(n) - &(&inverse * &jacobian);
    let real = value.im == 0.0;
    let mut unknown: Vec<Rectangle> = residual.iter().map(|&z| -z).collect();
    for _ in 0..MAX_ROUNDS {
        let wider: Vec<Rectangle> = unknown
            .iter()
            .map(|z| {
                let wide = |x: Interval| {
                    x + Interval::around_zero(0.1 * x.magnitude() + f64::EPSILON * f64::EPSILON)
                };
                let im = if real { Interval::ZERO } else { wide(z.im) };
                Rectangle::new(wide(z.re), im)
            })
            .collect();
        let change = wider[fixed];
        let products: Vec<Rectangle> = (0..n)
            .map(|i| {
                if i == fixed {
                    Rectangle::ZERO
                } else {
                    change * wider[i]
                }
            })
            .collect();
        let (linear, quadratic) = (left.apply(&wider), inverse.apply(&products));
        let next: Vec<Rectangle> = (0..n)
            .map(|i| linear[i] + quadratic[i] - residual[i])
            .collect();
        let inside = |a: Interval, b: Interval| b.lo() < a.lo() && a.hi() < b.hi();
        if next.iter().zip(&wider).all(|(a, b)| {
            inside(a.re, b.re) && (real && a.im == Interval::ZERO || inside(a.im, b.im))
        }) {
            let vector = (0..n)
                .map(|i| if i == fixed { v[i] } else { v[i] + next[i] })
                .collect();
            return Some((lambda + next[fixed], vector));
        }
        unknown = next;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An eigenvalue and its vector, the largest entry 1, of a matrix for which they have a closed
    /// form.
    struct ClosedForm {
        matrix: [[f64; 3]; 3],
        value: Complex<f64>,
        vector: [Complex<f64>; 3],
    }

    fn known() -> Vec<ClosedForm> {
        let real = |x: f64| Complex::new(x, 0.0);
        // Triangular: eigenvalues on the diagonal, vectors by back substitution.
        let triangular = [[2.0, 1.0, 3.0], [0.0, 5.0, -1.0], [0.0, 0.0, -4.0]];
        // The companion of (x − 3)(x² + 2x + 5): vectors (1, λ, λ²)/λ².
        let companion = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [15.0, 1.0, 1.0]];
        let of = |matrix, value, vector| ClosedForm {
            matrix,
            value,
            vector,
        };
        vec![
            of(triangular, real(2.0), [1.0, 0.0, 0.0].map(real)),
            of(triangular, real(5.0), [1.0 / 3.0, 1.0, 0.0].map(real)),
            of(
                triangular,
                real(-4.0),
                [-14.0 / 27.0, 1.0 / 9.0, 1.0].map(real),
            ),
            of(companion, real(3.0), [1.0 / 9.0, 1.0 / 3.0, 1.0].map(real)),
            of(
                companion,
                Complex::new(-1.0, 2.0),
                [
                    Complex::new(-3.0, 4.0) / 25.0,
                    Complex::new(-1.0, -2.0) / 5.0,
                    real(1.0),
                ],
            ),
        ]
    }

    /// From a pair with an error whose square is not negligible, the true pair is enclosed or none.
    #[test]
    fn a_coarse_pair_is_enclosed_or_refused() {
        let (mut enclosed, mut refused) = (0, 0);
        for ClosedForm {
            matrix,
            value,
            vector,
        } in known()
        {
            let intervals = Matrix::from_fn(3, 3, |i, j| Interval::point(matrix[i][j]));
            let fixed = (0..3)
                .find(|&i| vector[i] == Complex::new(1.0, 0.0))
                .unwrap();
            for k in 0..240_usize {
                let size = nanotap_arithmetic::powf(10.0, -0.025 * k as f64);
                // Irregular directions; those of a real pair are real.
                let mut turn = 0.37 * k as f64;
                let mut off = || {
                    turn += 2.4;
                    let im = if value.im == 0.0 {
                        0.0
                    } else {
                        nanotap_arithmetic::cos(turn)
                    };
                    Complex::new(nanotap_arithmetic::sin(turn), im) * size
                };
                let coarse = value + off();
                let mut neighbour = DVector::from_fn(3, |i, _| vector[i] + off());
                neighbour[fixed] = Complex::new(1.0, 0.0);
                if (0..3).any(|i| i != fixed && neighbour[i].norm_sqr() >= 1.0) {
                    continue;
                }
                let Some((found, around)) = enclosed_pair(&intervals, coarse, &neighbour) else {
                    refused += 1;
                    continue;
                };
                enclosed += 1;
                let holds = |z: Rectangle, x: Complex<f64>| {
                    let reach = 1e-15 * (1.0 + x.norm_sqr());
                    let near = |z: Interval, x: f64| !z.is_disjoint(Interval::around(x, reach));
                    near(z.re, x.re) && near(z.im, x.im)
                };
                assert!(holds(found, value), "{value}, off by {size}: {found:?}");
                for (z, x) in around.iter().zip(vector) {
                    assert!(holds(*z, x), "{value}, off by {size}: {around:?}");
                }
            }
        }
        assert!(enclosed > 400 && refused > 20, "{enclosed} {refused}");
    }
}
