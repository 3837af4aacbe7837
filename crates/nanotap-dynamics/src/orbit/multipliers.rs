//! Floquet multipliers: the eigenvalues of the monodromy matrix
//! DPⁿ = A_{n−1} … A_0.
//!
//! When the product spans many orders of magnitude, its small eigenvalues are lost to rounding.
//! Then QR sweeps over the factors (treppen iteration, the simultaneous iteration of a cyclic
//! product) separate the invariant subspaces of different moduli, and each diagonal block is
//! multiplied separately. The determinant, summed over the factors, checks the result.
//!
//! Fails: the eigenvalues of a nearly defective product are accurate only to the square root of
//! rounding, as in any method. A QR iteration that does not converge is an error.

use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{Complex, DMatrix, DVector, Schur};
use nanotap_arithmetic::ComplexFunctions as _;

use crate::map::StroboscopicMap;
use crate::random::unit;

/// A multiplier whose modulus is within this of 1 counts as marginal where bifurcations are looked
/// for. A double multiplier on the unit circle (an undamped system) is known to about this accuracy;
/// others may be known better ([`Multipliers::margin`]).
pub const MARGIN: f64 = 1e-7;
/// Error of the entries of a balanced product, relative to the largest: the accuracy of Jacobians.
const ENTRY_ERROR: f64 = 1e-12;

/// Largest span (natural logarithm) of the factors' diagonal for which the plain product is used: a
/// factor of 1e5, which leaves ten digits to small multipliers.
const PLAIN_SPAN: f64 = 11.5;
/// Coupling below which two blocks count as separated.
const SEPARATED: f64 = 1e-13;
/// Largest number of sweeps of QR factorisations through the factors.
const MAX_SWEEPS: usize = 80;

/// Stability of an orbit according to its multipliers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stability {
    /// Every multiplier is inside the unit circle by more than a margin.
    Stable,
    /// Some multipliers are outside the unit circle by more than [`MARGIN`].
    Unstable {
        /// Number of unstable multipliers; a pair counts twice.
        unstable_dimension: usize,
    },
    /// No multiplier is outside, but some are on the unit circle within the margin: an undamped
    /// system, or a bifurcation.
    Marginal,
}

impl Stability {
    /// Name of the stability: stable, unstable or marginal.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stable => "stable",
            Self::Unstable { .. } => "unstable",
            Self::Marginal => "marginal",
        }
    }
}

/// Eigenvalues of a product of matrices.
#[derive(Clone, Debug, PartialEq)]
pub struct Multipliers {
    /// In descending order of modulus; of a pair, the one with positive imaginary part comes first.
    pub values: Vec<Complex<f64>>,
    /// Natural logarithm of the modulus of the determinant, summed over the factors.
    pub log_determinant: f64,
    /// |Σ log|μ| − log|det||: the difference between the two computations; 0 for a singular product.
    pub determinant_defect: f64,
    /// Distance from the unit circle within which the side of a multiplier is not known: [`MARGIN`],
    /// or less where the condition of those in it is better.
    pub margin: f64,
}

/// Why the multipliers could not be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MultiplierError {
    /// There is no factor, or the factors are not square matrices of one size.
    #[error("multipliers need at least one square factor, all of one size")]
    Shape,
    /// An entry is infinite or NaN, or the product overflows.
    #[error("the monodromy matrix is not finite")]
    NotFinite,
    /// The QR iteration did not converge.
    #[error("the eigenvalue iteration did not converge")]
    NoConvergence,
}

impl Multipliers {
    /// Eigenvalues of `factors[n−1] … factors[0]`.
    ///
    /// # Errors
    /// See [`MultiplierError`].
    pub fn of_product(factors: &[DMatrix<f64>]) -> Result<Self, MultiplierError> {
        let d = factors.first().map_or(0, DMatrix::nrows);
        if d == 0 || factors.iter().any(|a| a.nrows() != d || a.ncols() != d) {
            return Err(MultiplierError::Shape);
        }
        if factors.iter().any(|a| a.iter().any(|v| !v.is_finite())) {
            return Err(MultiplierError::NotFinite);
        }
        let log_determinant = factors.iter().map(log_determinant).sum::<f64>();
        let product = Scaled::product(factors.iter());
        let mut values = if factors.len() == 1 || span(factors) < PLAIN_SPAN {
            product.eigenvalues()?
        } else {
            by_qr_sweeps(factors, &product)?
        };
        if values
            .iter()
            .any(|v| !v.re.is_finite() || !v.im.is_finite())
        {
            return Err(MultiplierError::NotFinite);
        }
        values.sort_by(|a, b| {
            b.modulus()
                .total_cmp(&a.modulus())
                .then(b.re.total_cmp(&a.re))
                .then(b.im.total_cmp(&a.im))
        });
        sort_pairs(&mut values);
        let sum: f64 = values
            .iter()
            .map(|v| nanotap_arithmetic::ln(v.modulus()))
            .sum();
        let defect = (sum - log_determinant).abs();
        Ok(Self {
            margin: margin_of(&product, &values),
            values,
            log_determinant,
            determinant_defect: if defect.is_finite() { defect } else { 0.0 },
        })
    }

    /// Stability according to the moduli, with the margin [`MARGIN`].
    pub fn stability(&self) -> Stability {
        stability_of(&self.values, MARGIN)
    }
}

/// The largest error of the eigenvalues within [`MARGIN`] of the unit circle, that bound at most.
/// The error of a simple one is that of the matrix times its condition 1/|yᴴx|, with its right and
/// left eigenvectors x and y of unit length, in the scales that balance the matrix.
fn margin_of(product: &Scaled, values: &[Complex<f64>]) -> f64 {
    let near = |value: &&Complex<f64>| (value.modulus() - 1.0).abs() <= MARGIN;
    let mut near = values.iter().filter(near).peekable();
    if near.peek().is_none() {
        return MARGIN;
    }
    let mut balanced = &product.matrix * 2f64.powi(product.exponent.clamp(-1000, 1000) as i32);
    balance_parlett_reinsch(&mut balanced);
    let transposed = balanced.transpose();
    let error = ENTRY_ERROR * balanced.norm();
    near.map(|&value| {
        let right = eigenvector(&balanced, value)?;
        let left = eigenvector(&transposed, value)?;
        // Of the transposed matrix, so that no conjugate is taken.
        let overlap = right.iter().zip(&left).map(|(x, y)| x * y);
        Some(error / overlap.sum::<Complex<f64>>().modulus())
    })
    .map(|error| error.filter(|error| *error < MARGIN).unwrap_or(MARGIN))
    .fold(0.0, f64::max)
}

/// Jacobian of the continuous entries over `periods` of a map from `state`; `None` where the map fails
/// or the product is not finite.
pub fn monodromy<M: StroboscopicMap>(
    map: &mut M,
    state: &[f64],
    periods: usize,
) -> Option<DMatrix<f64>> {
    let d = map.dimension();
    let c = d - map.discrete_entries();
    let mut state = state.to_vec();
    let mut product = DMatrix::identity(c, c);
    let mut jacobian = DMatrix::zeros(d, d);
    for _ in 0..periods {
        map.advance_with_jacobian(&mut state, &mut jacobian).ok()?;
        product = jacobian.view((0, 0), (c, c)) * product;
    }
    let is_finite = product.iter().all(|value| value.is_finite());
    is_finite.then_some(product)
}

/// Inverse iterations for an eigenvector: each gains as many digits as the multiplier has.
const INVERSE_ITERATIONS: usize = 4;

/// The eigenvector of unit length of a real matrix with one of its eigenvalues, by inverse iteration;
/// `None` if it is not finite.
pub fn eigenvector(
    matrix: &DMatrix<f64>,
    eigenvalue: Complex<f64>,
) -> Option<DVector<Complex<f64>>> {
    let n = matrix.nrows();
    // Off the eigenvalue by a little, so that the matrix can be inverted.
    let shift = eigenvalue + Complex::new(1e-10, 1e-10);
    let shifted =
        matrix.map(|value| Complex::new(value, 0.0)) - DMatrix::from_diagonal_element(n, n, shift);
    let decomposed = shifted.lu();
    let mut vector = DVector::from_fn(n, |k, _| Complex::new(unit(k as u64) + 0.5, 0.0));
    for _ in 0..INVERSE_ITERATIONS {
        vector = decomposed.solve(&vector)?;
        vector /= Complex::new(vector.norm(), 0.0);
    }
    vector
        .iter()
        .all(|z| z.re.is_finite() && z.im.is_finite())
        .then_some(vector)
}

/// Stability of an orbit with these multipliers, whose moduli are known to `margin`.
pub fn stability_of(multipliers: &[Complex<f64>], margin: f64) -> Stability {
    let outside = multipliers
        .iter()
        .filter(|m| m.modulus() > 1.0 + margin)
        .count();
    if outside > 0 {
        Stability::Unstable {
            unstable_dimension: outside,
        }
    } else if multipliers.iter().all(|m| m.modulus() < 1.0 - margin) {
        Stability::Stable
    } else {
        Stability::Marginal
    }
}

/// Makes conjugate pairs adjacent, positive imaginary part first: rounding may separate pairs of
/// equal modulus.
fn sort_pairs(values: &mut [Complex<f64>]) {
    let mut k = 0;
    while k + 1 < values.len() {
        if values[k].im == 0.0 {
            k += 1;
            continue;
        }
        let partner = values[k].conj();
        let nearest = (k + 1..values.len()).min_by(|&a, &b| {
            (values[a] - partner)
                .modulus()
                .total_cmp(&(values[b] - partner).modulus())
        });
        if let Some(j) = nearest {
            values[k + 1..=j].rotate_right(1);
        }
        if values[k].im < 0.0 {
            values.swap(k, k + 1);
        }
        k += 2;
    }
}

/// log|det A|; −∞ for a singular matrix.
fn log_determinant(matrix: &DMatrix<f64>) -> f64 {
    let lu = matrix.clone().lu();
    lu.u()
        .diagonal()
        .iter()
        .map(|v| nanotap_arithmetic::ln(v.abs()))
        .sum()
}

/// Spread of log|R_ii| summed over one QR sweep: the grading of the product.
fn span(factors: &[DMatrix<f64>]) -> f64 {
    let d = factors[0].nrows();
    let mut q = DMatrix::identity(d, d);
    let mut logs = vec![0.0; d];
    for a in factors {
        let (next, r) = (a * &q).qr().unpack();
        for (log, v) in logs.iter_mut().zip(r.diagonal().iter()) {
            *log += nanotap_arithmetic::ln(v.abs().max(f64::MIN_POSITIVE));
        }
        q = next;
    }
    let high = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = logs.iter().copied().fold(f64::INFINITY, f64::min);
    high - low
}

/// A matrix times a power of two, which avoids overflow and underflow of long products.
struct Scaled {
    matrix: DMatrix<f64>,
    exponent: i64,
}

impl Scaled {
    fn product<'a>(factors: impl Iterator<Item = &'a DMatrix<f64>>) -> Self {
        let mut product: Option<Self> = None;
        for factor in factors {
            let next = match product {
                None => Self {
                    matrix: factor.clone(),
                    exponent: 0,
                },
                Some(p) => Self {
                    matrix: factor * p.matrix,
                    exponent: p.exponent,
                },
            };
            product = Some(next.normalised());
        }
        product.unwrap_or_else(|| Self {
            matrix: DMatrix::zeros(0, 0),
            exponent: 0,
        })
    }

    fn normalised(mut self) -> Self {
        let size = self.matrix.amax();
        if size > 0.0 && size.is_finite() {
            let exponent = nanotap_arithmetic::log2(size).floor() as i32;
            self.matrix *= 2f64.powi(-exponent);
            self.exponent += i64::from(exponent);
        }
        self
    }

    fn eigenvalues(&self) -> Result<Vec<Complex<f64>>, MultiplierError> {
        let mut values = eigenvalues(&self.matrix)?;
        let exponent = self.exponent.clamp(-4000, 4000) as i32;
        for v in &mut values {
            // In two steps, so that the product of a large power and a small value does not
            // overflow.
            let half = exponent / 2;
            *v = *v * 2f64.powi(half) * 2f64.powi(exponent - half);
        }
        Ok(values)
    }
}

/// Eigenvalues of one balanced matrix by Schur decomposition.
fn eigenvalues(matrix: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, MultiplierError> {
    if matrix.iter().any(|v| !v.is_finite()) {
        return Err(MultiplierError::NotFinite);
    }
    if matrix.nrows() == 1 {
        return Ok(vec![Complex::new(matrix[(0, 0)], 0.0)]);
    }
    let mut balanced = matrix.clone();
    balance_parlett_reinsch(&mut balanced);
    nanotap_arithmetic::eigenvalues(&balanced).ok_or(MultiplierError::NoConvergence)
}

/// Eigenvalues of a graded product by QR sweeps over the factors.
fn by_qr_sweeps(
    factors: &[DMatrix<f64>],
    product: &Scaled,
) -> Result<Vec<Complex<f64>>, MultiplierError> {
    let d = factors[0].nrows();
    let mut start = Schur::try_new(product.matrix.clone(), f64::EPSILON, 400 * d)
        .map_or_else(|| DMatrix::identity(d, d), |s| s.unpack().0);
    let mut triangles = Vec::with_capacity(factors.len());
    let mut turn = DMatrix::identity(d, d);
    let mut previous = f64::INFINITY;
    for sweep in 0..MAX_SWEEPS {
        triangles.clear();
        let mut q = start.clone();
        for a in factors {
            let (next, r) = (a * &q).qr().unpack();
            triangles.push(r);
            q = next;
        }
        turn = start.transpose() * &q;
        start = q;
        // Stop when no coupling that still decreases is above the threshold.
        let remaining: f64 = (1..d)
            .map(|j| coupling(&turn, j))
            .filter(|&c| c > SEPARATED)
            .sum();
        if remaining == 0.0 || (sweep > 10 && remaining > 0.999 * previous) {
            break;
        }
        previous = remaining;
    }
    let mut values = Vec::with_capacity(d);
    let mut first = 0;
    for end in 1..=d {
        if end < d && coupling(&turn, end) > SEPARATED {
            continue;
        }
        let size = end - first;
        let blocks: Vec<DMatrix<f64>> = triangles
            .iter()
            .map(|r| r.view((first, first), (size, size)).into_owned())
            .collect();
        let corner = turn.view((first, first), (size, size)).into_owned();
        let block = Scaled::product(blocks.iter().chain(std::iter::once(&corner)));
        values.extend(block.eigenvalues()?);
        first = end;
    }
    Ok(values)
}

/// Largest entry of the lower-left block, which is zero if the first `j` directions are invariant.
fn coupling(turn: &DMatrix<f64>, j: usize) -> f64 {
    turn.view((j, 0), (turn.nrows() - j, j)).amax()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn one_factor_gives_its_eigenvalues() {
        let a = DMatrix::from_row_slice(2, 2, &[0.0, -1.0, 1.0, 0.0]) * 0.5;
        let m = Multipliers::of_product(&[a]).unwrap();
        assert!((m.values[0] - Complex::new(0.0, 0.5)).modulus() < 1e-15);
        assert!((m.values[1] - Complex::new(0.0, -0.5)).modulus() < 1e-15);
        assert_eq!(m.stability(), Stability::Stable);
        assert!(m.determinant_defect < 1e-14);
    }

    /// The eigenvalues of (B A)ᵏ are powers of those of B A, over 60 orders of magnitude: the plain
    /// product would lose the small one.
    #[test]
    fn small_multipliers_of_a_long_product_keep_their_digits() {
        let a = DMatrix::from_row_slice(3, 3, &[2.0, 1.0, 0.3, 0.5, 0.4, -0.2, 0.1, 0.7, 0.05]);
        let b = DMatrix::from_row_slice(3, 3, &[1.0, -0.3, 0.0, 0.2, 1.1, 0.4, -0.6, 0.0, 0.9]);
        let base = Multipliers::of_product(&[&b * &a]).unwrap();
        let k = 40;
        let factors: Vec<_> = (0..k).flat_map(|_| [a.clone(), b.clone()]).collect();
        let long = Multipliers::of_product(&factors).unwrap();
        for (short, long) in base.values.iter().zip(&long.values) {
            let expected = f64::from(k) * short.modulus().ln();
            assert!(
                (long.modulus().ln() - expected).abs() < 1e-9,
                "{long} {expected}"
            );
        }
        assert!(long.determinant_defect < 1e-9);
    }

    #[test]
    fn a_product_with_a_complex_pair_and_a_tiny_real_one() {
        let turn = DMatrix::from_row_slice(3, 3, &[0.6, -0.8, 0.1, 0.8, 0.6, 0.2, 0.0, 0.0, 1e-3]);
        let shear = DMatrix::from_row_slice(3, 3, &[1.0, 0.4, 0.0, 0.0, 1.0, 0.3, 0.2, 0.0, 1.0]);
        let inverse = shear.clone().try_inverse().unwrap();
        let factors = vec![inverse * turn * shear; 10];
        let m = Multipliers::of_product(&factors).unwrap();
        let angle = 10.0 * 0.8f64.atan2(0.6);
        assert!((m.values[0] - Complex::new(angle.cos(), angle.sin().abs())).modulus() < 1e-10);
        assert!(
            (m.values[2].re / 1e-30 - 1.0).abs() < 1e-9,
            "{}",
            m.values[2]
        );
    }

    #[test]
    fn a_singular_product_has_a_zero_multiplier() {
        let a = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.0]);
        let m = Multipliers::of_product(&[a.clone(), a]).unwrap();
        assert_eq!(m.values[1], Complex::new(0.0, 0.0));
        assert_eq!(m.log_determinant, f64::NEG_INFINITY);
        assert_eq!(m.determinant_defect, 0.0);
    }

    /// Products that overflow or underflow on the way, with factors that compensate; and one that
    /// is itself beyond the range or at its lower end.
    #[test]
    fn a_long_product_neither_overflows_nor_vanishes() {
        let scaled = |power: i32| DMatrix::from_element(1, 1, 2f64.powi(power));
        for power in [10, -10] {
            let mut factors = vec![scaled(power); 400];
            factors.extend(vec![scaled(-power); 400]);
            let m = Multipliers::of_product(&factors).unwrap();
            assert_eq!(m.values, [Complex::new(1.0, 0.0)]);
        }
        let small = Multipliers::of_product(&[scaled(-530), scaled(-530)]).unwrap();
        assert_eq!(small.values[0].re, 2f64.powi(-530) * 2f64.powi(-530));
        let large = Multipliers::of_product(&[scaled(700), scaled(700)]);
        assert_eq!(large, Err(MultiplierError::NotFinite));
    }

    /// Factors S_{k+1} D_k S_k⁻¹ with S_n = S_0: the multipliers are the products of the diagonals,
    /// from 4²⁰ to 0.003²⁰. A plain product keeps the first two only.
    #[test]
    fn known_multipliers_of_factors_that_share_no_directions() {
        let (n, diagonal) = (20, [4.0, 1.5, -0.1, 0.003]);
        let frame = |k: usize| {
            DMatrix::from_fn(4, 4, |i, j| {
                let chance = crate::random::unit((16 * k + 4 * i + j) as u64) - 0.5;
                chance + if i == j { 2.0 } else { 0.0 }
            })
        };
        let factors: Vec<_> = (0..n)
            .map(|k| {
                let inverse = frame(k).try_inverse().unwrap();
                let d = DMatrix::from_diagonal(&nalgebra::DVector::from_row_slice(&diagonal));
                frame((k + 1) % n) * d * inverse
            })
            .collect();
        let m = Multipliers::of_product(&factors).unwrap();
        for (value, d) in m.values.iter().zip(diagonal) {
            assert!((value.re / f64::powi(d, 20) - 1.0).abs() < 1e-10, "{value}");
            assert!(value.im.abs() < 1e-10 * value.re);
        }
    }

    /// Rounding may separate pairs of equal modulus; real multipliers before and after keep their
    /// places.
    #[test]
    fn pairs_are_adjacent() {
        let p = Complex::new(0.6, 0.8);
        let q = Complex::new(0.8, 0.6);
        let real = |x: f64| Complex::new(x, 0.0);
        let paired = |values: &[Complex<f64>]| {
            let mut values = values.to_vec();
            sort_pairs(&mut values);
            values
        };
        let both = [p, p.conj(), q, q.conj()];
        assert_eq!(paired(&[p, q, p.conj(), q.conj()]), both);
        assert_eq!(paired(&[p.conj(), q.conj(), q, p]), both);
        let among = [real(2.0), p, p.conj(), q, q.conj(), real(0.1), real(0.05)];
        let parted = [real(2.0), p.conj(), q, p, q.conj(), real(0.1), real(0.05)];
        assert_eq!(paired(&parted), among);
    }

    /// A modulus exactly at the margin is marginal, on either side.
    #[test]
    fn the_margin_itself_is_marginal() {
        for modulus in [1.0 + MARGIN, 1.0, 1.0 - MARGIN] {
            let found = stability_of(&[Complex::new(modulus, 0.0)], MARGIN);
            assert_eq!(found, Stability::Marginal, "{modulus}");
        }
    }

    /// Slow arms of a polymer, weakly coupled to a fast mode and in units far apart, are known to be
    /// stable; a double multiplier on the unit circle, with one eigenvector, is not.
    #[test]
    fn the_condition_of_a_multiplier_decides_near_the_circle() {
        let slow = DMatrix::from_row_slice(
            3,
            3,
            &[
                0.5,
                1e-3,
                1e-3,
                1e-9,
                1.0 - 2e-10,
                0.0,
                1e-9,
                0.0,
                1.0 - 2e-9,
            ],
        );
        let found = Multipliers::of_product(std::slice::from_ref(&slow)).unwrap();
        assert!(found.margin < 1e-11, "{}", found.margin);
        let known = |found: &Multipliers| stability_of(&found.values, found.margin);
        assert_eq!(known(&found), Stability::Stable);
        assert_eq!(found.stability(), Stability::Marginal);
        let grows = Multipliers::of_product(&[slow * (1.0 + 1e-9)]).unwrap();
        let unstable = Stability::Unstable {
            unstable_dimension: 1,
        };
        assert_eq!(known(&grows), unstable);
        let undamped = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, 1.0]);
        let found = Multipliers::of_product(&[undamped]).unwrap();
        assert_eq!((found.margin, known(&found)), (MARGIN, Stability::Marginal));
    }

    #[test]
    fn bad_factors_are_refused() {
        assert_eq!(Multipliers::of_product(&[]), Err(MultiplierError::Shape));
        let nan = DMatrix::from_element(2, 2, f64::NAN);
        assert_eq!(
            Multipliers::of_product(&[nan]),
            Err(MultiplierError::NotFinite)
        );
        let wide = DMatrix::zeros(2, 3);
        assert_eq!(
            Multipliers::of_product(&[wide]),
            Err(MultiplierError::Shape)
        );
    }

    proptest! {
        /// A cyclic permutation of the factors does not change the multipliers.
        #[test]
        fn multipliers_do_not_depend_on_the_phase(
            entries in prop::collection::vec(-1.0f64..1.0, 3 * 9),
        ) {
            let factors: Vec<_> = entries
                .chunks(9)
                .map(|c| DMatrix::from_column_slice(3, 3, c) + DMatrix::identity(3, 3))
                .collect();
            let mut turned = factors.clone();
            turned.rotate_left(1);
            let a = Multipliers::of_product(&factors).unwrap();
            let b = Multipliers::of_product(&turned).unwrap();
            // Nearly double eigenvalues change by the square root of rounding.
            let gap = a.values[0].modulus().max(1.0) * 1e-6;
            for x in &a.values {
                prop_assert!(b.values.iter().any(|y| (x - y).modulus() < gap));
            }
        }
    }
}
