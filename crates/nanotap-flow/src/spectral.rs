//! The spectral basis of a regime: complex modal coordinates in which the
//! homogeneous flow is diagonal, or block-diagonal where eigenvalues (nearly)
//! coincide.
//!
//! Critical damping makes a matrix defective: two eigenvalues meet and their
//! eigenvectors become parallel. Close eigenvalues are therefore grouped into a
//! cluster that keeps an orthonormal basis of its whole invariant subspace
//! (after Bavely and Stewart, SIAM J. Numer. Anal. 16, 1979); the flow of a
//! cluster is `e^{μs} e^{Ns}` with a small (or nilpotent) `N`, a polynomial in `s`
//! to double precision.

use crate::{Complex, FlowError};
use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{DMatrix, DVector};
use nanotap_arithmetic::ComplexFunctions as _;

/// A group of close eigenvalues: coordinates `start..start + size` obey
/// `q̇ = (μ + N) q`.
#[derive(Clone, Debug, PartialEq)]
pub struct Cluster {
    /// Index of its first coordinate.
    pub start: usize,
    /// Coupling `N` of the coordinates in addition to the common eigenvalue `μ`, `size × size`.
    pub coupling: DMatrix<Complex>,
    /// `N^p / p!` for `p = 1, 2, …`, as many as double precision can see over the horizon.
    powers: Vec<DMatrix<Complex>>,
}

impl Cluster {
    /// Returns `N^p / p!` for `p = 1, 2, …`.
    pub fn powers(&self) -> &[DMatrix<Complex>] {
        &self.powers
    }

    /// Returns the number of coordinates in the cluster.
    pub fn size(&self) -> usize {
        self.coupling.nrows()
    }
}

/// Modal coordinates `q = L x`, `x = Re(R q)` with `q̇_k = λ_k q_k` (apart from the coupling within
/// clusters). One complex coordinate represents each conjugate pair, one (with zero imaginary part)
/// each real eigenvalue.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralBasis {
    /// Eigenvalues `λ_k`, of length `m`, per unit of time; within a cluster, their common value
    /// `μ`.
    pub eigenvalues: Vec<Complex>,
    /// Matrix `R` from modal coordinates to the state, `n × m`: columns of pairs contain the factor
    /// 2 of `2 Re`.
    pub right: DMatrix<Complex>,
    /// Matrix `L` from the state to modal coordinates, `m × n`.
    pub left: DMatrix<Complex>,
    /// The groups of close eigenvalues; empty when every eigenvalue is simple.
    pub clusters: Vec<Cluster>,
}

/// Eigenvalues are grouped if their distance times the horizon is below this, at the first attempt.
const FIRST_GROUPING: f64 = 0.02;
/// Largest such limit: beyond it the polynomial of a cluster would lose too many digits.
const LAST_GROUPING: f64 = 4.0;
/// Largest relative residual with which a basis that rebuilds the matrix is accepted.
const ACCEPTED_RESIDUAL: f64 = 1e-12;

impl SpectralBasis {
    /// Computes the basis of a general real matrix. `horizon` is the longest time over which the
    /// flow will be evaluated in one piece (the drive period).
    ///
    /// # Errors
    /// [`FlowError::IllConditioned`] when no grouping of the eigenvalues gives a
    /// basis that rebuilds the matrix.
    pub fn of(matrix: &DMatrix<f64>, horizon: f64, regime: usize) -> Result<Self, FlowError> {
        let n = matrix.nrows();
        let mut balanced = matrix.clone();
        let scale = balance_parlett_reinsch(&mut balanced);
        let eigenvalues = nanotap_arithmetic::eigenvalues(&balanced)
            .ok_or(FlowError::IllConditioned { regime, digits: 16 })?;
        let mut grouping = FIRST_GROUPING;
        let mut best: Option<(f64, Self)> = None;
        while grouping <= LAST_GROUPING {
            if let Some(mut basis) = grouped_basis(&balanced, &eigenvalues, grouping / horizon) {
                let residual = basis.residual(&balanced);
                if best.as_ref().is_none_or(|(r, _)| residual < *r) {
                    basis.finish(horizon);
                    best = Some((residual, basis));
                }
                if residual < ACCEPTED_RESIDUAL {
                    break;
                }
            }
            grouping *= 3.0;
        }
        let (residual, mut basis) = best.ok_or(FlowError::IllConditioned { regime, digits: 16 })?;
        if residual > 1e-9 || !residual.is_finite() {
            let digits = nanotap_arithmetic::log10(residual / f64::EPSILON).clamp(0.0, 16.0) as u32;
            return Err(FlowError::IllConditioned { regime, digits });
        }
        for i in 0..n {
            for k in 0..basis.eigenvalues.len() {
                basis.right[(i, k)] *= scale[i];
                basis.left[(k, i)] /= scale[i];
            }
        }
        Ok(basis)
    }

    /// Creates a basis from simple eigenvalues and vectors that the caller knows more accurately
    /// than a general algorithm computes them. `right` is `n × m`, `left` `m × n`.
    ///
    /// # Errors
    /// [`FlowError::Shape`] if the sizes do not fit.
    pub fn from_simple_eigenpairs(
        eigenvalues: Vec<Complex>,
        right: DMatrix<Complex>,
        left: DMatrix<Complex>,
    ) -> Result<Self, FlowError> {
        let m = eigenvalues.len();
        for (what, found) in [
            ("the right eigenvectors", right.ncols()),
            ("the left eigenvectors", left.nrows()),
        ] {
            if found != m {
                return Err(FlowError::Shape {
                    what,
                    found,
                    expected: m,
                });
            }
        }
        Ok(Self {
            eigenvalues,
            right,
            left,
            clusters: Vec::new(),
        })
    }

    /// Returns the number `m` of complex coordinates.
    pub fn len(&self) -> usize {
        self.eigenvalues.len()
    }

    /// Reports whether there is no coordinate at all.
    pub fn is_empty(&self) -> bool {
        self.eigenvalues.is_empty()
    }

    /// Advances `q` by a time `s`, and leaves `e^{λ_k s}` in `factors`.
    pub(crate) fn advance(&self, q: &mut [Complex], s: f64, factors: &mut [Complex]) {
        for (factor, lambda) in factors.iter_mut().zip(&self.eigenvalues) {
            *factor = (lambda * s).exponential();
        }
        self.apply(q, s, factors);
    }

    /// Advances `q` by a time `s` whose `e^{λ_k s}` are already in `factors`.
    pub(crate) fn apply(&self, q: &mut [Complex], s: f64, factors: &[Complex]) {
        for cluster in &self.clusters {
            let range = cluster.start..cluster.start + cluster.size();
            let start = DVector::from_column_slice(&q[range.clone()]);
            let mut power = 1.0;
            for matrix in &cluster.powers {
                power *= s;
                let change = matrix * &start * Complex::new(power, 0.0);
                for (q, change) in q[range.clone()].iter_mut().zip(change.iter()) {
                    *q += change;
                }
            }
        }
        for (q, factor) in q.iter_mut().zip(factors) {
            *q *= factor;
        }
    }

    /// The forced response's modal part: solves `(z − Λ) y = b` in modal
    /// coordinates, `Err` with the offending eigenvalue where `z` is one.
    pub(crate) fn resolvent(
        &self,
        z: Complex,
        b: &DVector<Complex>,
    ) -> Result<DVector<Complex>, Complex> {
        let size = b.iter().map(|v| v.modulus()).fold(0.0, f64::max);
        let mut y = DVector::zeros(b.len());
        for k in 0..self.len() {
            if b[k].modulus() <= 1e-15 * size {
                continue;
            }
            let denominator = z - self.eigenvalues[k];
            let scale = z.modulus().max(self.eigenvalues[k].modulus());
            if denominator.modulus() <= 1e-13 * scale || scale == 0.0 {
                return Err(self.eigenvalues[k]);
            }
            y[k] = b[k] / denominator;
        }
        for cluster in &self.clusters {
            let (start, size) = (cluster.start, cluster.size());
            let rhs = b.rows(start, size).into_owned();
            if rhs.iter().all(|v| v.modulus() == 0.0) {
                continue;
            }
            let shifted = DMatrix::from_diagonal_element(size, size, z - self.eigenvalues[start])
                - &cluster.coupling;
            let solved = shifted.lu().solve(&rhs).ok_or(self.eigenvalues[start])?;
            y.rows_mut(start, size).copy_from(&solved);
        }
        Ok(y)
    }

    /// Returns the relative error with which the basis rebuilds `matrix` and the identity.
    fn residual(&self, matrix: &DMatrix<f64>) -> f64 {
        let n = matrix.nrows();
        let mut generator = DMatrix::from_diagonal(&DVector::from_column_slice(&self.eigenvalues));
        for cluster in &self.clusters {
            let (start, size) = (cluster.start, cluster.size());
            let mut block = generator.view_mut((start, start), (size, size));
            block += &cluster.coupling;
        }
        let identity = (&self.right * &self.left).map(|z| z.re) - DMatrix::identity(n, n);
        let rebuilt = (&self.right * generator * &self.left).map(|z| z.re) - matrix;
        let scale = matrix.amax().max(f64::MIN_POSITIVE);
        identity.amax().max(rebuilt.amax() / scale)
    }

    fn finish(&mut self, horizon: f64) {
        for cluster in &mut self.clusters {
            let size = cluster.size();
            let mut power = DMatrix::identity(size, size);
            let mut weight = 1.0;
            for p in 1..200 {
                power = &power * &cluster.coupling / Complex::new(p as f64, 0.0);
                weight *= horizon;
                let size = power.iter().map(|z| z.modulus()).fold(0.0, f64::max) * weight;
                if size == 0.0 {
                    break;
                }
                cluster.powers.push(power.clone());
                if size < 1e-19 && p as usize > cluster.size() {
                    break;
                }
            }
        }
    }
}

/// Returns the eigenvalues (with both members of every pair) in groups closer than `distance`; of
/// two conjugate groups only the one with positive imaginary parts.
fn groups(eigenvalues: &[Complex], distance: f64) -> Vec<Vec<Complex>> {
    let n = eigenvalues.len();
    let mut label: Vec<usize> = (0..n).collect();
    for i in 0..n {
        for j in 0..i {
            if (eigenvalues[i] - eigenvalues[j]).modulus() < distance && label[i] != label[j] {
                let (from, to) = (label[i], label[j]);
                label
                    .iter_mut()
                    .filter(|l| **l == from)
                    .for_each(|l| *l = to);
            }
        }
    }
    let mut out = Vec::new();
    for k in 0..n {
        let group: Vec<Complex> = (0..n)
            .filter(|&i| label[i] == k)
            .map(|i| eigenvalues[i])
            .collect();
        if group.is_empty() {
            continue;
        }
        let mean: f64 = group.iter().map(|z| z.im).sum::<f64>() / group.len() as f64;
        let crosses_axis = group.iter().any(|z| z.im <= 0.0) && group.iter().any(|z| z.im >= 0.0);
        if crosses_axis || mean > 0.0 {
            out.push(group);
        }
    }
    out
}

fn grouped_basis(
    matrix: &DMatrix<f64>,
    eigenvalues: &[Complex],
    distance: f64,
) -> Option<SpectralBasis> {
    let n = matrix.nrows();
    let complex = matrix.map(|v| Complex::new(v, 0.0));
    let transposed = complex.transpose();
    let (mut lambdas, mut rights, mut lefts, mut clusters) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for group in groups(eigenvalues, distance) {
        let real = group.iter().any(|z| z.im <= 0.0) && group.iter().any(|z| z.im >= 0.0);
        let right = invariant_subspace(&complex, eigenvalues, &group, real)?;
        let left = invariant_subspace(&transposed, eigenvalues, &group, real)?;
        // Biorthogonal left vectors: L R = 1.
        let left = (left.transpose() * &right).try_inverse()? * left.transpose();
        let block = &left * &complex * &right;
        let size = group.len();
        let mut mean = block.trace() / Complex::new(size as f64, 0.0);
        if real {
            mean.im = 0.0;
        }
        if size > 1 {
            let mut coupling = block;
            for i in 0..size {
                coupling[(i, i)] -= mean;
            }
            if real {
                coupling.apply(|z| z.im = 0.0);
            }
            clusters.push(Cluster {
                start: lambdas.len(),
                coupling,
                powers: Vec::new(),
            });
        }
        let weight = Complex::new(if real { 1.0 } else { 2.0 }, 0.0);
        for k in 0..size {
            lambdas.push(mean);
            rights.push(right.column(k) * weight);
            lefts.push(left.row(k).into_owned());
        }
    }
    if lambdas.is_empty() {
        return None;
    }
    let basis = SpectralBasis {
        right: DMatrix::from_columns(&rights),
        left: DMatrix::from_rows(&lefts),
        eigenvalues: lambdas,
        clusters,
    };
    debug_assert_eq!(basis.right.nrows(), n);
    Some(basis)
}

/// An orthonormal basis of the invariant subspace of a group of eigenvalues, by
/// orthogonal inverse iteration.
///
/// A single eigenvalue is its own shift. A group is shifted off its mean by a part
/// of the distance to the next eigenvalue: a shift on a defective eigenvalue would
/// turn every vector into the one eigenvector that is left.
fn invariant_subspace(
    matrix: &DMatrix<Complex>,
    eigenvalues: &[Complex],
    group: &[Complex],
    real: bool,
) -> Option<DMatrix<Complex>> {
    let n = matrix.nrows();
    if group.len() == n {
        return Some(DMatrix::identity(n, n));
    }
    let size = Complex::new(group.len() as f64, 0.0);
    let mut mean = group.iter().sum::<Complex>() / size;
    if real {
        mean.im = 0.0;
    }
    let radius = group
        .iter()
        .map(|z| (z - mean).modulus())
        .fold(0.0, f64::max);
    let others = eigenvalues
        .iter()
        .filter(|z| !group.contains(z) && (real || z.im > 0.0 || group.len() > 1));
    let gap = others
        .map(|z| (z - mean).modulus())
        .fold(f64::INFINITY, f64::min);
    let scale = matrix
        .iter()
        .map(|z| z.modulus())
        .fold(f64::MIN_POSITIVE, f64::max);
    let (offset, rounds) = if group.len() == 1 {
        (2.0 * f64::EPSILON * scale, 3)
    } else {
        (radius.max(0.02 * gap.min(scale)), 60)
    };
    // A pivot may come out as exactly zero; a shift a little further off does not.
    let factor = (0..4)
        .map(|k| offset * 8.0_f64.powi(k))
        .find_map(|offset| {
            let mut shifted = matrix.clone();
            for i in 0..n {
                shifted[(i, i)] -= mean + Complex::new(offset, 0.0);
            }
            let factor = shifted.lu();
            factor.is_invertible().then_some(factor)
        })?;
    // Any start that is not orthogonal to the subspace will do; these numbers are
    // irregular and fixed, so that equal input gives equal bits.
    let mut basis = DMatrix::from_fn(n, group.len(), |i, j| {
        let seed = (i * 7919 + j * 104_729 + 1) as f64;
        Complex::new((seed * 0.618_033_988_749).fract() - 0.31, 0.0)
    });
    for _ in 0..rounds {
        basis = factor.solve(&basis)?;
        if basis
            .iter()
            .any(|z| !(z.re.is_finite() && z.im.is_finite()))
        {
            return None;
        }
        if real {
            make_real(&mut basis);
        }
        basis = basis.qr().q();
    }
    Some(basis)
}

/// Turns each column of a (numerically) real subspace into a real vector.
fn make_real(basis: &mut DMatrix<Complex>) {
    for mut column in basis.column_iter_mut() {
        let largest = column
            .iter()
            .copied()
            .max_by(|a, b| a.modulus().total_cmp(&b.modulus()));
        let turn = largest.map_or(Complex::new(1.0, 0.0), |z| z.conj() / z.modulus());
        for z in column.iter_mut() {
            *z = Complex::new((*z * turn).re, 0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn propagate(matrix: &DMatrix<f64>, x: &DVector<f64>, s: f64) -> DVector<f64> {
        let basis = SpectralBasis::of(matrix, s, 0).unwrap();
        let mut q: Vec<Complex> = (&basis.left * x.map(|v| Complex::new(v, 0.0)))
            .iter()
            .copied()
            .collect();
        let mut factors = vec![Complex::new(0.0, 0.0); q.len()];
        basis.advance(&mut q, s, &mut factors);
        (&basis.right * DVector::from_vec(q)).map(|z| z.re)
    }

    /// ẍ + 2ζẋ + x = 0: under-, critically, nearly critically and overdamped
    /// against nalgebra's matrix exponential.
    #[test]
    fn oscillator_of_any_damping_matches_the_matrix_exponential() {
        for zeta in [0.0, 0.3, 0.999, 1.0 - 1e-9, 1.0, 1.0 + 1e-13, 1.001, 3.0] {
            let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -1.0, -2.0 * zeta]);
            let x = DVector::from_vec(vec![0.3, -1.2]);
            let expected = nanotap_arithmetic::matrix_exp(&(&a * 2.5)) * &x;
            let got = propagate(&a, &x, 2.5);
            assert!(
                (&got - &expected).amax() < 2e-14,
                "zeta {zeta}: {got} {expected}"
            );
        }
    }

    /// Two identical critically damped oscillators coupled one way: a Jordan
    /// block of size four.
    #[test]
    fn jordan_block_of_size_four_matches_the_matrix_exponential() {
        let a = DMatrix::from_row_slice(
            4,
            4,
            &[
                0.0, 1.0, 0.0, 0.0, -1.0, -2.0, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, -2.0,
            ],
        );
        let x = DVector::from_vec(vec![0.3, -1.2, 0.7, 0.4]);
        let expected = nanotap_arithmetic::matrix_exp(&(&a * 2.0)) * &x;
        let got = propagate(&a, &x, 2.0);
        assert!((&got - &expected).amax() < 1e-11, "{got} {expected}");
    }

    /// A pair of complex pairs that coincide and couple (defective, complex).
    #[test]
    fn defective_complex_pair_matches_the_matrix_exponential() {
        let a = DMatrix::from_row_slice(
            4,
            4,
            &[
                0.0, 1.0, 0.0, 0.0, -4.0, -0.2, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -4.0, -0.2,
            ],
        );
        let x = DVector::from_vec(vec![0.3, -1.2, 0.7, 0.4]);
        let expected = nanotap_arithmetic::matrix_exp(&(&a * 3.0)) * &x;
        let got = propagate(&a, &x, 3.0);
        assert!((&got - &expected).amax() < 1e-12, "{got} {expected}");
    }
}
