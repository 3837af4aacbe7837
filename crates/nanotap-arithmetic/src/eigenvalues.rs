//! Eigenvalues of a real matrix, including matrices on which the plain QR iteration cycles.

use nalgebra::{Complex, DMatrix, Schur};

/// Largest number of iteration steps per row; two or three are usual.
const MAX_STEPS: usize = 400;

/// The eigenvalues of a finite square matrix; `None` if the iteration does not converge.
///
/// The double shifts of the QR iteration come from the last two rows. For about one random 3 × 3
/// matrix in a million the step reproduces the same matrix, as Francis noted for orthogonal ones;
/// other programs then use an exceptional shift. Here the iteration is repeated with the transposed
/// matrix and with a reflected one, which have the same eigenvalues and a different last row.
#[must_use]
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    if matrix.is_empty() {
        return Some(Vec::new());
    }
    let steps = MAX_STEPS * matrix.nrows();
    let of = |matrix: DMatrix<f64>| {
        let schur = Schur::try_new(matrix, f64::EPSILON, steps)?;
        Some(schur.complex_eigenvalues().as_slice().to_vec())
    };
    of(matrix.clone())
        .or_else(|| of(matrix.transpose()))
        .or_else(|| of(reflected(matrix)))
}

/// `Q A Q` with the reflection `Q = 1 − 2 u uᵀ/|u|²` along an irregular fixed `u`.
fn reflected(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let n = matrix.nrows();
    let u = nalgebra::DVector::from_fn(n, |i, _| 0.3 + (GOLDEN * (i + 1) as f64).fract());
    let q = DMatrix::identity(n, n) - &u * u.transpose() * (2.0 / u.norm_squared());
    &q * matrix * &q
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ComplexFunctions as _;
    use nalgebra::linalg::balancing::balance_parlett_reinsch;

    /// Matrices from random tests on which the iteration cycled after balancing: the product of
    /// three Jacobians, and a contraction. The computed values must be all the roots of the
    /// characteristic polynomial.
    #[test]
    fn matrices_on_which_the_iteration_cycles() {
        let jacobians = [
            [
                -0.36717797319384765,
                -0.17226773689266728,
                0.5078124507868276,
                -0.35233584379154137,
                0.5260327916706755,
                0.48049124672482,
                -0.31097311154625595,
                0.3186777030102276,
                -0.7775703137567904,
            ],
            [
                0.8217275466040687,
                -0.1285952880856714,
                0.0,
                0.0,
                0.5063191234956875,
                0.8123098520359896,
                -0.9303620654675042,
                -0.050499518162448805,
                0.6402371863012177,
            ],
            [
                -0.03717189018194217,
                0.6039800846259965,
                0.8078718432225632,
                -0.6166286062415577,
                0.47377282205742616,
                -0.4360410327045672,
                0.768573155475509,
                0.29243363943756184,
                0.8894870077857656,
            ],
        ]
        .map(|entries| DMatrix::from_column_slice(3, 3, &entries) + DMatrix::identity(3, 3));
        let product = &jacobians[0] * &jacobians[2] * &jacobians[1];
        let contraction = DMatrix::from_column_slice(
            4,
            4,
            &[
                -0.024206748274376504,
                -0.024643820217960237,
                -0.0021015309729056973,
                -0.01740605486211759,
                0.003312094926612348,
                0.01088277937757997,
                -0.007587467956318461,
                0.02437846287491824,
                -0.02276455861807065,
                -0.021339445644669455,
                -0.005419990070402489,
                -0.03238089783764357,
                0.0174302270515219,
                0.0015811777658486113,
                -0.004648810383971384,
                -0.025834584425320606,
            ],
        );
        for mut matrix in [product, contraction] {
            balance_parlett_reinsch(&mut matrix);
            are_the_eigenvalues(&matrix, &eigenvalues(&matrix).unwrap());
            are_the_eigenvalues(&matrix, &eigenvalues(&reflected(&matrix)).unwrap());
        }
    }

    /// Every value makes `A − λ` singular; their sum and product are trace and determinant.
    fn are_the_eigenvalues(matrix: &DMatrix<f64>, values: &[Complex<f64>]) {
        let n = matrix.nrows();
        let size = matrix.norm();
        assert_eq!(values.len(), n);
        let complex = matrix.map(|x| Complex::new(x, 0.0));
        for value in values {
            let shifted = &complex - DMatrix::identity(n, n) * *value;
            let determinant = shifted.determinant().modulus();
            assert!(determinant < 1e-13 * size.powi(n as i32), "{value}");
        }
        let sum: Complex<f64> = values.iter().sum();
        let product: Complex<f64> = values.iter().product();
        assert!((sum - matrix.trace()).modulus() < 1e-14 * size);
        assert!((product - matrix.determinant()).modulus() < 1e-14 * size.powi(n as i32));
    }

    #[test]
    fn closed_forms() {
        assert_eq!(eigenvalues(&DMatrix::zeros(0, 0)), Some(Vec::new()));
        let one = eigenvalues(&DMatrix::from_element(1, 1, -3.0)).unwrap();
        assert_eq!(one, [Complex::new(-3.0, 0.0)]);
        // A rotation by 120°: its eigenvalues are the cube roots of one, and QR steps do not change
        // it.
        let turn = DMatrix::from_row_slice(3, 3, &[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        are_the_eigenvalues(&turn, &eigenvalues(&turn).unwrap());
    }
}
