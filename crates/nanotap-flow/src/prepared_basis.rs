//! A spectral basis laid out for the inner loop.
//!
//! It follows from a regime's matrix alone. Systems that differ in their drive, or in where their
//! guards lie, share the bases of their regimes.

use nalgebra::DMatrix;

use crate::SpectralBasis;
use crate::simd::linear::LinearMap;
use crate::simd::{ComplexVector, layout};

/// A [`SpectralBasis`] with its matrices in the layout of the inner loop.
#[derive(Clone, Debug, PartialEq)]
pub struct PreparedBasis {
    basis: SpectralBasis,
    stacked_left: DMatrix<f64>,
    stacked_right: DMatrix<f64>,
    packed_left: Vec<ComplexVector>,
    packed_right: LinearMap,
}

impl From<SpectralBasis> for PreparedBasis {
    fn from(basis: SpectralBasis) -> Self {
        let (m, n) = basis.left.shape();
        let mut packed_left = Vec::with_capacity(n * layout::vectors_for(m));
        for left in basis.left.as_slice().chunks_exact(m.max(1)) {
            layout::append(&mut packed_left, left);
        }
        let stacked_right = stacked_right(&basis);
        Self {
            packed_left,
            packed_right: LinearMap::of(&stacked_right),
            stacked_left: stacked_left(&basis),
            stacked_right,
            basis,
        }
    }
}

impl PreparedBasis {
    /// Returns the spectral basis without the packed layout.
    pub fn basis(&self) -> &SpectralBasis {
        &self.basis
    }

    /// `[Re L; Im L]` (`2m × n`): the matrix from the state to `[Re q; Im q]`.
    pub(crate) fn stacked_left(&self) -> &DMatrix<f64> {
        &self.stacked_left
    }

    /// `[Re R, −Im R]` (`n × 2m`): the matrix from `[Re q; Im q]` to the state, since
    /// `x = Re(R q)`.
    pub(crate) fn stacked_right(&self) -> &DMatrix<f64> {
        &self.stacked_right
    }

    /// The columns of `L`, in sequence.
    pub(crate) fn packed_left(&self) -> &[ComplexVector] {
        &self.packed_left
    }

    /// `[Re R, −Im R]` as a packed map: the state of packed `q`.
    pub(crate) fn packed_right(&self) -> &LinearMap {
        &self.packed_right
    }
}

fn stacked_right(basis: &SpectralBasis) -> DMatrix<f64> {
    let (n, m) = basis.right.shape();
    let mut stacked = DMatrix::zeros(n, 2 * m);
    let (real, imaginary) = stacked.as_mut_slice().split_at_mut(n * m);
    for ((re, im), z) in real.iter_mut().zip(imaginary).zip(basis.right.as_slice()) {
        *re = z.re;
        *im = -z.im;
    }
    stacked
}

fn stacked_left(basis: &SpectralBasis) -> DMatrix<f64> {
    let (m, n) = basis.left.shape();
    let mut stacked = DMatrix::zeros(2 * m, n);
    let columns = stacked.as_mut_slice().chunks_exact_mut((2 * m).max(1));
    for (column, left) in columns.zip(basis.left.as_slice().chunks_exact(m.max(1))) {
        let (real, imaginary) = column.split_at_mut(m);
        for ((re, im), z) in real.iter_mut().zip(imaginary).zip(left) {
            *re = z.re;
            *im = z.im;
        }
    }
    stacked
}
