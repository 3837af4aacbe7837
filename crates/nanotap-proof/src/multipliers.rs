//! Floquet multipliers: eigenvalues of the product of the derivatives of all flights.
//!
//! A direct product of interval matrices widens with each factor. In frames V_s that move with the
//! orbit, V_{s+1}⁻¹ B_s V_s is nearly diagonal with positive entries, because the frames are the
//! propagated eigenvectors of the whole product. Products of such matrices widen by their own
//! rounding only. Any frames give valid bounds; good ones give narrow bounds. Gershgorin's discs of
//! the product, in the frame of its eigenvectors, contain the multipliers: each connected part of
//! their union contains as many as it has discs.

use nalgebra::{Complex, DMatrix, DVector};

use crate::complex::Rectangle;
use crate::eigen::approximate_pairs;
use crate::interval::Interval;
use crate::matrix::Matrix;
use crate::system::Regime;

/// Enclosures of the Floquet multipliers of an orbit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Multipliers {
    /// Pairwise disjoint discs that contain all multipliers, the largest multipliers first; empty
    /// if none could be enclosed.
    pub discs: Vec<Disc>,
}

/// A disc of complex numbers that contains `count` multipliers and is disjoint from the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Centre of the disc in the complex plane.
    pub center: Complex<f64>,
    /// Radius of the disc, dimensionless like the multipliers.
    pub radius: f64,
    /// Number of multipliers in the disc.
    pub count: usize,
}

/// Proved stability of an orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stability {
    /// Every multiplier is inside the unit circle.
    Stable,
    /// At least one is outside.
    Unstable,
    /// Neither stability nor instability is proved.
    Undecided,
}

impl Disc {
    fn modulus(&self) -> Interval {
        let size = Rectangle::point(self.center).modulus() + Interval::around_zero(self.radius);
        Interval::new(size.lo().max(0.0), size.hi())
    }

    fn overlaps(&self, other: &Self) -> bool {
        let apart = (Rectangle::point(self.center) - Rectangle::point(other.center)).modulus();
        let sum = Interval::point(self.radius) + Interval::point(other.radius);
        !(apart.lo() > sum.hi())
    }

    /// A disc that contains both.
    fn union(&self, other: &Self) -> Self {
        let center = (self.center + other.center) * 0.5;
        let reach = |disc: &Self| {
            let way = (Rectangle::point(disc.center) - Rectangle::point(center)).modulus();
            (way + Interval::point(disc.radius)).hi()
        };
        Self {
            center,
            radius: reach(self).max(reach(other)),
            count: self.count + other.count,
        }
    }
}

impl Multipliers {
    /// The stability that the discs prove.
    pub fn stability(&self) -> Stability {
        let mut sizes = self.discs.iter().map(Disc::modulus);
        if self.discs.is_empty() {
            Stability::Undecided
        } else if sizes.clone().all(|size| size.hi() < 1.0) {
            Stability::Stable
        } else if sizes.any(|size| size.lo() > 1.0) {
            Stability::Unstable
        } else {
            Stability::Undecided
        }
    }

    /// Creates discs from multipliers that are enclosed individually.
    pub(crate) fn of_each(values: &[Rectangle]) -> Self {
        let disc = |z: &Rectangle| {
            let center = z.middle();
            Disc {
                center,
                radius: (*z - Rectangle::point(center)).magnitude(),
                count: 1,
            }
        };
        Self::merge_overlapping(values.iter().map(disc).collect())
    }

    /// Merges discs until no two overlap.
    fn merge_overlapping(mut discs: Vec<Disc>) -> Self {
        if discs
            .iter()
            .any(|d| !(d.radius.is_finite() && d.center.re.is_finite()))
        {
            return Self::default();
        }
        loop {
            let pair = (0..discs.len())
                .flat_map(|i| (0..i).map(move |j| (j, i)))
                .find(|&(j, i)| discs[j].overlaps(&discs[i]));
            let Some((j, i)) = pair else { break };
            let other = discs.swap_remove(i);
            discs[j] = discs[j].union(&other);
        }
        discs.sort_by(|a, b| {
            let size = |d: &Disc| d.center.norm_sqr();
            size(b)
                .total_cmp(&size(a))
                .then(b.center.im.total_cmp(&a.center.im))
        });
        // Of two that may be conjugates the upper one comes first, however their moduli are
        // rounded.
        for k in 1..discs.len() {
            let (a, b) = (discs[k - 1], discs[k]);
            let mirrored = Disc {
                center: b.center.conj(),
                ..b
            };
            if a.center.im < 0.0 && a.overlaps(&mirrored) {
                discs.swap(k - 1, k);
            }
        }
        Self { discs }
    }
}

/// The multipliers of one period in one regime, e^{λT}.
pub(crate) fn of_flow(regime: &Regime, period: Interval) -> Vec<Rectangle> {
    regime
        .factors(period)
        .into_iter()
        .zip(&regime.basis.values)
        .flat_map(|(factor, rate)| {
            let other = (rate.im != Interval::ZERO).then(|| factor.conj());
            std::iter::once(factor).chain(other)
        })
        .collect()
}

/// A column with less than this fraction of its length outside the span of the previous ones is
/// replaced by an orthogonal one.
const MIN_INDEPENDENT_FRACTION: f64 = 1e-6;

/// The multipliers of the product of `factors`, the last one leftmost; `weights` are the magnitudes
/// of the entries of states.
pub(crate) fn enclosed(factors: &[Matrix<Interval>], weights: &[f64]) -> Multipliers {
    product_in_frames(factors, weights)
        .map(|product| discs(&product).into_iter().map(around_real).collect())
        .map(Multipliers::merge_overlapping)
        .unwrap_or_default()
}

fn product_in_frames(factors: &[Matrix<Interval>], weights: &[f64]) -> Option<Matrix<Rectangle>> {
    let n = weights.len();
    // In units of the weights; these are not powers of two, so the division is enclosed too.
    let factors: Vec<Matrix<Interval>> = factors
        .iter()
        .map(|b| {
            Matrix::from_fn(n, n, |i, j| {
                b[(i, j)] * Interval::point(weights[j]) / Interval::point(weights[i])
            })
        })
        .collect();
    let middles: Vec<DMatrix<Complex<f64>>> = factors
        .iter()
        .map(|b| b.middle().map(|x| Complex::new(x, 0.0)))
        .collect();
    let whole = factors
        .iter()
        .fold(DMatrix::identity(n, n), |product, b| b.middle() * product);
    let mut frame = eigenvectors(&whole)?;
    let first = frame.clone();
    let mut product = Matrix::<Rectangle>::identity(n);
    for (s, factor) in factors.iter().enumerate() {
        let moved = &Matrix::from_fn(n, n, |i, j| Rectangle::real(factor[(i, j)]))
            * &Matrix::points(&frame);
        let next = if s + 1 == factors.len() {
            first.clone()
        } else {
            normalised(&(&middles[s] * &frame))?
        };
        let inverse = Matrix::points(&next).inverse()?;
        product = &(&inverse * &moved) * &product;
        frame = next;
    }
    Some(product)
}

/// Eigenvectors as columns of length 1, the largest eigenvalue's first.
fn eigenvectors(matrix: &DMatrix<f64>) -> Option<DMatrix<Complex<f64>>> {
    let mut pairs = approximate_pairs(matrix)?;
    pairs.sort_by(|a, b| {
        let size = |z: Complex<f64>| z.norm_sqr();
        size(b.0)
            .total_cmp(&size(a.0))
            .then(b.0.im.total_cmp(&a.0.im))
    });
    let columns: Vec<DVector<Complex<f64>>> = pairs.into_iter().map(|(_, v)| v).collect();
    normalised(&DMatrix::from_columns(&columns))
}

/// Columns of length 1 that are clearly independent.
fn normalised(columns: &DMatrix<Complex<f64>>) -> Option<DMatrix<Complex<f64>>> {
    let n = columns.nrows();
    let mut orthogonal: Vec<DVector<Complex<f64>>> = Vec::with_capacity(n);
    let mut all = Vec::with_capacity(n);
    for j in 0..columns.ncols() {
        let column = columns.column(j).into_owned();
        let remainder = |v: &DVector<Complex<f64>>| {
            let mut rest = v.clone();
            for _ in 0..2 {
                for q in &orthogonal {
                    let along = q.dotc(&rest);
                    rest.axpy(-along, q, Complex::new(1.0, 0.0));
                }
            }
            rest
        };
        let length = column.norm();
        let rest = remainder(&column);
        let (column, rest) = if rest.norm() > MIN_INDEPENDENT_FRACTION * length {
            (column / Complex::new(length, 0.0), rest)
        } else {
            // The unit vector farthest from the span of the previous columns.
            let far = (0..n)
                .map(|i| {
                    remainder(&DVector::from_fn(n, |k, _| {
                        Complex::new(f64::from(u8::from(k == i)), 0.0)
                    }))
                })
                .max_by(|a, b| a.norm().total_cmp(&b.norm()))?;
            let length = far.norm();
            (far.clone() / Complex::new(length, 0.0), far)
        };
        let length = rest.norm();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        orthogonal.push(rest / Complex::new(length, 0.0));
        all.push(column);
    }
    Some(DMatrix::from_columns(&all))
}

/// Gershgorin's discs in the frame of approximate eigenvectors.
fn discs(product: &Matrix<Rectangle>) -> Vec<Disc> {
    let n = product.rows();
    let middle = product.middle();
    let better = complex_eigenvectors(&middle)
        .map(|v| Matrix::points(&v))
        .and_then(|v| Some(&(&v.inverse()? * product) * &v));
    let product = better.as_ref().unwrap_or(product);
    (0..n)
        .map(|i| {
            let center = product[(i, i)].middle();
            let off: Interval = (0..n)
                .map(|j| {
                    let z = product[(i, j)];
                    let z = if i == j {
                        z - Rectangle::point(center)
                    } else {
                        z
                    };
                    Interval::point(z.magnitude())
                })
                .sum();
            Disc {
                center,
                radius: off.hi(),
                count: 1,
            }
        })
        .collect()
}

/// Discs that may contain real numbers are centred on the real axis: multipliers come in conjugate
/// pairs, and a single one is real.
fn around_real(disc: Disc) -> Disc {
    if disc.center.im.abs() > disc.radius {
        return disc;
    }
    let radius = Interval::point(disc.radius) + Interval::point(disc.center.im.abs());
    Disc {
        center: Complex::new(disc.center.re, 0.0),
        radius: radius.hi(),
        ..disc
    }
}

/// Eigenvectors of a nearly diagonal matrix, to first order in the off-diagonal entries.
fn complex_eigenvectors(matrix: &DMatrix<Complex<f64>>) -> Option<DMatrix<Complex<f64>>> {
    let n = matrix.nrows();
    let mut vectors = DMatrix::identity(n, n);
    for j in 0..n {
        for i in 0..n {
            let apart = matrix[(j, j)] - matrix[(i, i)];
            if i != j && apart.norm_sqr() > 0.0 {
                let part = matrix[(i, j)] / apart;
                if part.norm_sqr() < 0.01 {
                    vectors[(i, j)] = part;
                }
            }
        }
    }
    vectors
        .iter()
        .all(|z: &Complex<f64>| z.re.is_finite() && z.im.is_finite())
        .then_some(vectors)
}
