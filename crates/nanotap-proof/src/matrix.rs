//! Small matrices of intervals or of rectangles of complex numbers.

use std::ops::{Add, Index, IndexMut, Mul, Sub};

use nalgebra::{Complex, DMatrix};

use crate::complex::Rectangle;
use crate::interval::Interval;

/// A matrix, stored row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrix<T> {
    rows: usize,
    columns: usize,
    entries: Vec<T>,
}

/// An entry of a matrix.
pub trait Entry: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// The neutral element of addition.
    const ZERO: Self;
    /// The neutral element of multiplication.
    const ONE: Self;
}

impl Entry for Interval {
    const ZERO: Self = Self::ZERO;
    const ONE: Self = Self::ONE;
}

impl Entry for Rectangle {
    const ZERO: Self = Self::ZERO;
    const ONE: Self = Self::ONE;
}

impl<T: Entry> Matrix<T> {
    /// The matrix with the entries `entry(row, column)`.
    pub fn from_fn(rows: usize, columns: usize, mut entry: impl FnMut(usize, usize) -> T) -> Self {
        let entries = (0..rows * columns)
            .map(|k| entry(k / columns, k % columns))
            .collect();
        Self {
            rows,
            columns,
            entries,
        }
    }

    /// Creates a matrix of zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self::from_fn(rows, columns, |_, _| T::ZERO)
    }

    /// Creates the identity matrix of this size.
    pub fn identity(size: usize) -> Self {
        Self::from_fn(size, size, |i, j| if i == j { T::ONE } else { T::ZERO })
    }

    /// Returns the number of rows.
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Returns the number of columns.
    pub const fn columns(&self) -> usize {
        self.columns
    }

    /// Returns row `i`, counted from 0.
    pub fn row(&self, i: usize) -> &[T] {
        &self.entries[i * self.columns..(i + 1) * self.columns]
    }

    /// Returns a copy of column `j`, counted from 0.
    pub fn column(&self, j: usize) -> Vec<T> {
        (0..self.rows).map(|i| self[(i, j)]).collect()
    }

    /// The product with a vector.
    pub fn apply(&self, vector: &[T]) -> Vec<T> {
        (0..self.rows).map(|i| dot(self.row(i), vector)).collect()
    }

    /// The matrix with `of` applied to each entry.
    pub fn map<U: Entry>(&self, mut of: impl FnMut(T) -> U) -> Matrix<U> {
        Matrix {
            rows: self.rows,
            columns: self.columns,
            entries: self.entries.iter().map(|&x| of(x)).collect(),
        }
    }

    /// All entries, row by row.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.entries.iter()
    }
}

/// Returns the scalar product Σ a_k b_k.
pub fn dot<T: Entry>(a: &[T], b: &[T]) -> T {
    a.iter().zip(b).fold(T::ZERO, |sum, (&a, &b)| sum + a * b)
}

impl<T> Index<(usize, usize)> for Matrix<T> {
    type Output = T;
    fn index(&self, (i, j): (usize, usize)) -> &T {
        &self.entries[i * self.columns + j]
    }
}

impl<T> IndexMut<(usize, usize)> for Matrix<T> {
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut T {
        &mut self.entries[i * self.columns + j]
    }
}

impl<T: Entry> Mul for &Matrix<T> {
    type Output = Matrix<T>;
    fn mul(self, other: Self) -> Matrix<T> {
        let mut product = Matrix::zeros(self.rows, other.columns);
        for i in 0..self.rows {
            for k in 0..self.columns {
                let factor = self[(i, k)];
                for j in 0..other.columns {
                    product[(i, j)] = product[(i, j)] + factor * other[(k, j)];
                }
            }
        }
        product
    }
}

impl<T: Entry> Sub for &Matrix<T> {
    type Output = Matrix<T>;
    fn sub(self, other: Self) -> Matrix<T> {
        Matrix::from_fn(self.rows, self.columns, |i, j| self[(i, j)] - other[(i, j)])
    }
}

impl Matrix<Interval> {
    /// The centres of the entries.
    pub fn middle(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.rows, self.columns, |i, j| self[(i, j)].middle())
    }
}

impl Matrix<Rectangle> {
    /// The centres of the entries.
    pub fn middle(&self) -> DMatrix<Complex<f64>> {
        DMatrix::from_fn(self.rows, self.columns, |i, j| self[(i, j)].middle())
    }

    /// An approximate matrix as one of rectangles.
    pub fn points(of: &DMatrix<Complex<f64>>) -> Self {
        Self::from_fn(of.nrows(), of.ncols(), |i, j| Rectangle::point(of[(i, j)]))
    }

    /// The largest sum of absolute values along a row.
    fn norm(&self) -> f64 {
        (0..self.rows)
            .map(|i| {
                self.row(i)
                    .iter()
                    .map(|z| Interval::point(z.magnitude()))
                    .sum::<Interval>()
                    .hi()
            })
            .fold(0.0, f64::max)
    }

    /// The inverses of all matrices in it; `None` if some may be singular.
    ///
    /// With an approximate inverse W and E = 1 − W V, ‖E‖ < 1, the inverse is
    /// (1 − E)⁻¹ W = W + E W + …, and the terms after W are at most ‖E‖ ‖W‖_j / (1 − ‖E‖), where
    /// ‖W‖_j is the largest entry of column j.
    pub fn inverse(&self) -> Option<Self> {
        let approximate = Self::points(&self.middle().try_inverse()?);
        if !approximate.iter().all(|z| z.is_finite()) {
            return None;
        }
        let error = &Self::identity(self.rows) - &(&approximate * self);
        let norm = error.norm();
        if !(norm < 0.5) {
            return None;
        }
        let factor = Interval::point(norm) / (Interval::ONE - Interval::point(norm));
        let far: Vec<Rectangle> = (0..self.columns)
            .map(|j| {
                let largest = (0..self.rows)
                    .map(|i| approximate[(i, j)].magnitude())
                    .fold(0.0, f64::max);
                let rest = Interval::around_zero((factor * Interval::point(largest)).hi());
                Rectangle::new(rest, rest)
            })
            .collect();
        Some(Self::from_fn(self.rows, self.columns, |i, j| {
            approximate[(i, j)] + far[j]
        }))
    }
}
