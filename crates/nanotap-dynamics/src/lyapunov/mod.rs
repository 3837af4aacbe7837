//! Lyapunov spectrum by QR decomposition of the exact Jacobians, with error bars.
//!
//! A frame of d tangent vectors is advanced and orthonormalised after every period (Benettin et al.
//! 1980). The averages of the logarithmic stretch factors are the exponents, as natural logarithms
//! per period. Error bars come from block averages (`block_average.rs`), which account for
//! correlations.
//!
//! Fails: the exponents of a finite run do not predict the later motion. Positive exponents over
//! thousands of periods may belong to a transient ([`mod@crate::classify`] and
//! [`mod@crate::census`] look for the escape). Near zero the exponents converge like 1/T without
//! random scatter, so an error bar may be too small by about log(stretch)/T. A singular Jacobian
//! counts as a stretch by the smallest positive number.

mod block_average;
mod strobe_means;

use nalgebra::DMatrix;

use block_average::BlockAverage;

use crate::failure::{MapFailure, advance_with_jacobian_and_determinant};
use crate::map::StroboscopicMap;

pub use strobe_means::StrobeMeans;
use strobe_means::{agree, write_sample};

/// Largest standard error of an exponent, per period, at which motions may be compared.
const MAX_COMPARISON_ERROR: f64 = 0.01;
/// Smallest stretch that is not rounding, as a fraction of the largest entry of a Jacobian.
const ROUNDING: f64 = 1e-10;

/// Length and accuracy of the averages.
#[derive(Clone, Debug, PartialEq)]
pub struct LyapunovOptions {
    /// Periods before averaging starts, for the alignment of the frame. The state advances too.
    pub alignment: usize,
    /// Smallest number of periods in the averages.
    pub min_periods: usize,
    /// Largest number of periods in the averages. Set it equal to `min_periods` for a fixed length.
    pub max_periods: usize,
    /// The run stops between the two once every error bar is below this (per period) plus
    /// `relative_error` times its exponent.
    pub absolute_error: f64,
    /// Allowed error bar as a fraction of the exponent (dimensionless), added to `absolute_error`.
    pub relative_error: f64,
}

impl Default for LyapunovOptions {
    fn default() -> Self {
        Self {
            alignment: 100,
            min_periods: 1000,
            max_periods: 20_000,
            absolute_error: 1e-3,
            relative_error: 0.02,
        }
    }
}

impl LyapunovOptions {
    /// True if every error bar is within the requested tolerances.
    pub(crate) fn is_met_by(&self, spectrum: &LyapunovSpectrum) -> bool {
        spectrum
            .exponents
            .iter()
            .zip(&spectrum.errors)
            .all(|(l, e)| *e <= self.absolute_error + self.relative_error * l.abs())
    }
}

/// Lyapunov exponents per period, and averages over the same run.
#[derive(Clone, Debug, PartialEq)]
pub struct LyapunovSpectrum {
    /// Exponents, natural logarithm per drive period, in descending order.
    pub exponents: Vec<f64>,
    /// Standard error of each exponent, per period.
    pub errors: Vec<f64>,
    /// Number of drive periods in the averages.
    pub periods: usize,
    /// Means of the strobe states.
    pub strobe: StrobeMeans,
    /// Mean of log|det DP| over the same periods, which equals the sum of the exponents. It is
    /// computed independently of the Jacobian if the map can
    /// ([`StroboscopicMap::advance_with_jacobian_and_determinant`]), otherwise from LU factors.
    pub log_determinant: f64,
    /// Largest difference in a period of the logarithms of the stretches, summed, from the independent
    /// log|det DP|: the check of both. Only periods count in which no stretch is lost in the rounding of
    /// the Jacobian; `None` without one, or without an independent value.
    pub determinant_defect: Option<f64>,
}

impl LyapunovSpectrum {
    /// The largest exponent and its standard error, per period.
    pub fn largest(&self) -> (f64, f64) {
        (
            self.exponents.first().copied().unwrap_or(f64::NAN),
            self.errors.first().copied().unwrap_or(f64::NAN),
        )
    }

    /// True if exponents and means are accurate enough to compare motions.
    pub(crate) fn is_comparable(&self) -> bool {
        self.errors.iter().all(|e| *e <= MAX_COMPARISON_ERROR) && self.strobe.is_comparable()
    }

    /// True if two motions have the same exponents and the same means of the strobe states and
    /// their squares, within six standard errors of the difference and a term that converges like
    /// 1/T.
    pub(crate) fn agrees_with(&self, other: &Self) -> bool {
        let length = self.periods.min(other.periods).max(1) as f64;
        let ours = self.exponents.iter().zip(&self.errors);
        let theirs = other.exponents.iter().zip(&other.errors);
        ours.zip(theirs).all(|((x, ex), (y, ey))| {
            agree(x - y, nanotap_arithmetic::hypot(*ex, *ey), 1.0, length)
        }) && self.strobe.agree_with(&other.strobe)
    }

    /// Largest modulus of an exponent that counts as zero: three standard errors of the largest
    /// exponent, plus the mean of a bounded logarithm over the run.
    pub(crate) fn zero(&self) -> f64 {
        (3.0 * self.largest().1).max(10.0 / self.periods as f64)
    }

    /// Number of leading exponents that are zero within their errors: the dimension of a torus.
    pub fn neutral_directions(&self) -> usize {
        let zero = self.zero();
        self.exponents
            .iter()
            .take_while(|l| l.abs() <= zero)
            .count()
    }

    /// Kaplan–Yorke dimension of the strobe points: j + Σ_{i≤j}λ_i/|λ_{j+1}| for the last j with a
    /// non-negative sum; the dimension of the state if no sum is negative, 0 if λ₁ is negative. On
    /// a torus the leading exponents are zero and their errors have either sign: use
    /// [`Self::neutral_directions`] there.
    pub fn kaplan_yorke_dimension(&self) -> f64 {
        let mut sum = 0.0;
        for (j, &exponent) in self.exponents.iter().enumerate() {
            if sum + exponent < 0.0 {
                return j as f64 + sum / exponent.abs();
            }
            sum += exponent;
        }
        self.exponents.len() as f64
    }
}

/// Computes the Lyapunov spectrum of the motion from `state`, which is replaced by the final state.
///
/// # Errors
/// If the map fails.
pub fn lyapunov_spectrum<M: StroboscopicMap>(
    map: &mut M,
    state: &mut [f64],
    options: &LyapunovOptions,
) -> Result<LyapunovSpectrum, MapFailure> {
    let mut run = LyapunovRun::new(map.dimension());
    run.align(map, state, options.alignment)?;
    run.advance(map, state, options.min_periods)?;
    while run.periods() < options.max_periods && !options.is_met_by(&run.spectrum()) {
        let more = run
            .periods()
            .max(64)
            .min(options.max_periods - run.periods());
        run.advance(map, state, more)?;
    }
    Ok(run.spectrum())
}

/// A run that accumulates a spectrum and can be continued.
#[derive(Clone, Debug)]
pub(crate) struct LyapunovRun {
    d: usize,
    /// Orthonormal tangent vectors, column major.
    frame: Vec<f64>,
    image: Vec<f64>,
    jacobian: DMatrix<f64>,
    /// Logarithms of the stretches, the state and its squares, and log|det DP|.
    sample: Vec<f64>,
    average: BlockAverage,
    /// Averages since the last call of [`Self::begin_last_stretch`].
    last: BlockAverage,
    /// See [`LyapunovSpectrum::determinant_defect`].
    determinant_defect: Option<f64>,
}

impl LyapunovRun {
    pub(crate) fn new(d: usize) -> Self {
        let mut frame = vec![0.0; d * d];
        for i in 0..d {
            frame[i * d + i] = 1.0;
        }
        Self {
            d,
            image: frame.clone(),
            frame,
            jacobian: DMatrix::zeros(d, d),
            sample: vec![0.0; 3 * d + 1],
            average: BlockAverage::new(3 * d + 1),
            last: BlockAverage::new(3 * d + 1),
            determinant_defect: None,
        }
    }

    pub(crate) fn periods(&self) -> usize {
        self.average.count()
    }

    pub(crate) fn align<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        state: &mut [f64],
        periods: usize,
    ) -> Result<(), MapFailure> {
        for _ in 0..periods {
            self.step(map, state)?;
        }
        Ok(())
    }

    pub(crate) fn advance<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        state: &mut [f64],
        periods: usize,
    ) -> Result<(), MapFailure> {
        for _ in 0..periods {
            self.step(map, state)?;
            self.record(state);
        }
        Ok(())
    }

    /// Records the period just computed, which ended at `state`.
    #[inline]
    pub(crate) fn record(&mut self, state: &[f64]) {
        write_sample(state, &mut self.sample[self.d..3 * self.d]);
        self.average.push(&self.sample);
        self.last.push(&self.sample);
    }

    /// Starts the separate averages of the last part of the run.
    pub(crate) fn begin_last_stretch(&mut self) {
        self.last = BlockAverage::new(3 * self.d + 1);
    }

    /// Discards everything before the last part.
    pub(crate) fn keep_last_stretch(&mut self) {
        self.average = self.last.clone();
    }

    /// Advances the state and the frame by one period without recording it.
    pub(crate) fn step<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        state: &mut [f64],
    ) -> Result<(), MapFailure> {
        let d = self.d;
        let exact = advance_with_jacobian_and_determinant(map, state, &mut self.jacobian)?;
        let jacobian = self.jacobian.as_slice();
        self.image.fill(0.0);
        for (image, frame) in self
            .image
            .chunks_exact_mut(d)
            .zip(self.frame.chunks_exact(d))
        {
            for (column, &f) in jacobian.chunks_exact(d).zip(frame) {
                for (o, a) in image.iter_mut().zip(column) {
                    *o += a * f;
                }
            }
        }
        self.orthonormalise();
        std::mem::swap(&mut self.frame, &mut self.image);
        self.sample[3 * d] = exact.unwrap_or_else(|| log_determinant(&self.jacobian));
        if let Some(exact) = exact
            && d > 1
        {
            // The length of a direction shrunk below the rounding of the Jacobian is lost: the last
            // direction takes the remainder of the determinant.
            let others: f64 = self.sample[..d - 1].iter().sum();
            let hidden = self.jacobian.amax() * ROUNDING;
            if exact - others < nanotap_arithmetic::ln(hidden) {
                self.sample[d - 1] = exact - others;
                return Ok(());
            }
        }
        if let Some(exact) = exact {
            let sum: f64 = self.sample[..d].iter().sum();
            let largest = self.determinant_defect.unwrap_or(0.0);
            self.determinant_defect = Some(largest.max((sum - exact).abs()));
        }
        Ok(())
    }

    /// Gram–Schmidt with one repetition; the logarithms of the lengths go into the sample. A vector
    /// that vanishes is replaced by a unit vector.
    fn orthonormalise(&mut self) {
        let d = self.d;
        for k in 0..d {
            let (done, rest) = self.image.split_at_mut(k * d);
            let v = &mut rest[..d];
            let mut length = remove(done, v, d);
            self.sample[k] = nanotap_arithmetic::ln(length.max(f64::MIN_POSITIVE));
            let mut substitute = 0;
            while length <= f64::MIN_POSITIVE && substitute < d {
                v.fill(0.0);
                v[substitute] = 1.0;
                length = remove(done, v, d);
                if length < 1e-3 / d as f64 {
                    length = 0.0;
                }
                substitute += 1;
            }
            for x in v {
                *x /= length;
            }
        }
    }

    pub(crate) fn spectrum(&self) -> LyapunovSpectrum {
        self.spectrum_of(&self.average)
    }

    /// The spectrum of the last part of the run.
    pub(crate) fn last_spectrum(&self) -> LyapunovSpectrum {
        self.spectrum_of(&self.last)
    }

    fn spectrum_of(&self, average: &BlockAverage) -> LyapunovSpectrum {
        let d = self.d;
        let mean = average.mean();
        let errors = average.standard_error();
        let mut order: Vec<usize> = (0..d).collect();
        order.sort_by(|&a, &b| mean[b].total_cmp(&mean[a]));
        LyapunovSpectrum {
            exponents: order.iter().map(|&i| mean[i]).collect(),
            errors: order.iter().map(|&i| errors[i]).collect(),
            periods: average.count(),
            strobe: StrobeMeans {
                means: mean[d..3 * d].to_vec(),
                errors: errors[d..3 * d].to_vec(),
                periods: average.count(),
            },
            log_determinant: mean[3 * d],
            determinant_defect: self.determinant_defect,
        }
    }
}

/// log|det A| by LU; a determinant of zero counts as the smallest positive number.
fn log_determinant(matrix: &DMatrix<f64>) -> f64 {
    let lu = matrix.clone().lu();
    let pivots = lu.u().diagonal();
    pivots
        .iter()
        .map(|v| nanotap_arithmetic::ln(v.abs().max(f64::MIN_POSITIVE)))
        .sum()
}

/// Removes the components of `v` along the orthonormal rows of `done`, twice, and returns the
/// remaining length.
#[inline]
fn remove(done: &[f64], v: &mut [f64], d: usize) -> f64 {
    for _ in 0..2 {
        for u in done.chunks_exact(d) {
            let part: f64 = u.iter().zip(v.iter()).map(|(a, b)| a * b).sum();
            for (x, a) in v.iter_mut().zip(u) {
                *x -= part * a;
            }
        }
    }
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}
