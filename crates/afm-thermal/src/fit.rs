//! Maximum likelihood of an oscillator over a white floor, by Fisher scoring.

use nalgebra::{Matrix4, Vector4};
use nanotap_arithmetic::{exp, ln};

use crate::oscillator::{Kernel, Oscillator};
use crate::spectrum::{Bin, Window};

/// Most iterations of one fit.
const MAX_ITERATIONS: usize = 200;
/// Iterations that compare starts.
const START_ITERATIONS: usize = 6;
/// Relative change of all parameters at which the fit has converged.
const TOLERANCE: f64 = 1e-7;
/// Largest change of a logarithm in an iteration.
const MAX_STEP: f64 = 1.0;
/// Quality factors to start from.
const START_QUALITIES: [f64; 8] = [0.8, 1.5, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0];
/// Starts from which the likelihood is climbed.
const MAX_STARTS: usize = 5;
/// A floor below this fraction of the smallest density in the range is not measured.
const MIN_FLOOR: f64 = 1e-3;

/// A fit of the oscillator.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub(crate) oscillator: Oscillator,
    /// Covariance of ln f0, ln Q, ln m and ln W for one independent periodogram; divide by their
    /// number. The last row and column are zero without a floor.
    pub(crate) covariance: Matrix4<f64>,
    /// P/S of each bin.
    pub(crate) ratios: Vec<f64>,
    /// Mean of (P/S − 1)² weighted by the information of each bin.
    pub(crate) weighted_scatter: f64,
    /// Whether the white floor is above zero.
    pub(crate) has_floor: bool,
}

/// Fits the oscillator to these bins. `None` if the covariance is singular or the fit diverges.
///
/// The kernel follows from Q, so the fit is repeated when the peak is found to be narrow.
pub(crate) fn fit(bins: &[Bin], start: Oscillator, window: Option<Window>) -> Option<Fit> {
    let mut kernel = Kernel::point();
    let mut oscillator = start;
    for _ in 0..4 {
        oscillator = climb(bins, oscillator, &kernel, MAX_ITERATIONS, true).0;
        let refined = kernel_of(bins, &oscillator, window);
        if refined == kernel {
            break;
        }
        kernel = refined;
    }
    // A floor far below every bin has no information, and would make the covariance singular.
    let least = bins
        .iter()
        .map(|bin| oscillator.in_bin(bin, &kernel).0)
        .fold(f64::INFINITY, f64::min);
    let has_floor = oscillator.w > MIN_FLOOR * least;
    if !has_floor {
        oscillator.w = 0.0;
        oscillator = climb(bins, oscillator, &kernel, MAX_ITERATIONS, false).0;
    }
    let Scores {
        mut information, ..
    } = scores(bins, &oscillator, &kernel);
    if !has_floor {
        information[(3, 3)] = 1.0;
    }
    let mut covariance = information.cholesky()?.inverse();
    if !has_floor {
        covariance[(3, 3)] = 0.0;
    }
    let is_valid = [oscillator.f0, oscillator.q, oscillator.m]
        .iter()
        .all(|value| value.is_finite() && *value > 0.0);
    let (mut squares, mut weights) = (0.0, 0.0);
    let ratio = |bin: &Bin| {
        let (s, derivatives) = oscillator.in_bin(bin, &kernel);
        let ratio = bin.power / s;
        let derivatives = Vector4::from(derivatives) / s;
        let weight = derivatives.dot(&(covariance * derivatives));
        squares += weight * bin.ordinates * (ratio - 1.0) * (ratio - 1.0);
        weights += weight;
        ratio
    };
    let ratios = bins.iter().map(ratio).collect();
    is_valid.then_some(Fit {
        oscillator,
        covariance,
        ratios,
        weighted_scatter: squares / weights,
        has_floor,
    })
}

/// The kernel of these bins near this peak.
fn kernel_of(bins: &[Bin], oscillator: &Oscillator, window: Option<Window>) -> Kernel {
    let near = |bin: &&Bin| (bin.frequency / oscillator.f0 - 1.0).abs() < 2.0 / oscillator.q + 0.1;
    let widths = bins.iter().filter(near).map(|bin| bin.width);
    let is_mean = bins.iter().any(|bin| bin.ordinates > 1.0);
    Kernel::new(
        widths.fold(0.0, f64::max),
        oscillator.width(),
        window,
        is_mean,
    )
}

/// Gradient of the log-likelihood, and Fisher's information.
struct Scores {
    gradient: Vector4<f64>,
    information: Matrix4<f64>,
}

fn log_likelihood(bins: &[Bin], oscillator: &Oscillator, kernel: &Kernel) -> f64 {
    let term = |bin: &Bin| {
        let s = oscillator.in_bin(bin, kernel).0;
        -bin.ordinates * (ln(s) + bin.power / s)
    };
    bins.iter().map(term).sum()
}

fn scores(bins: &[Bin], oscillator: &Oscillator, kernel: &Kernel) -> Scores {
    let mut scores = Scores {
        gradient: Vector4::zeros(),
        information: Matrix4::zeros(),
    };
    for bin in bins {
        let (s, derivatives) = oscillator.in_bin(bin, kernel);
        let j = Vector4::from(derivatives) / s;
        scores.gradient += j * (bin.ordinates * (bin.power / s - 1.0));
        scores.information += j * j.transpose() * bin.ordinates;
    }
    scores
}

/// Climbs to the maximum of the likelihood by Fisher scoring with Levenberg's damping. Returns it with
/// its log-likelihood.
fn climb(
    bins: &[Bin],
    start: Oscillator,
    kernel: &Kernel,
    iterations: usize,
    with_floor: bool,
) -> (Oscillator, f64) {
    let mut oscillator = start;
    let mut height = log_likelihood(bins, &oscillator, kernel);
    let mut damping = 1e-3;
    let mut current = scores(bins, &oscillator, kernel);
    for _ in 0..iterations {
        let mut matrix = current.information;
        for k in 0..4 {
            matrix[(k, k)] += damping * matrix[(k, k)];
        }
        if !with_floor || matrix[(3, 3)] < 1e-300 {
            matrix[(3, 3)] = 1.0;
        }
        let Some(factors) = matrix.cholesky() else {
            damping *= 10.0;
            if damping > 1e12 {
                break;
            }
            continue;
        };
        let step = factors
            .solve(&current.gradient)
            .map(|of| of.clamp(-MAX_STEP, MAX_STEP));
        let moved = Oscillator {
            f0: oscillator.f0 * exp(step[0]),
            q: oscillator.q * exp(step[1]),
            m: oscillator.m * exp(step[2]),
            w: oscillator.w * exp(step[3]),
        };
        let reached = log_likelihood(bins, &moved, kernel);
        if reached >= height {
            let is_done = step.amax() < TOLERANCE
                || (step.amax() < 1e-5 && reached - height < 1e-14 * height.abs());
            (oscillator, height) = (moved, reached);
            damping = (damping / 10.0).max(1e-12);
            if is_done {
                break;
            }
            current = scores(bins, &oscillator, kernel);
        } else {
            damping *= 10.0;
            if damping > 1e12 {
                break;
            }
        }
    }
    (oscillator, height)
}

/// Finds a start for the fit: the oscillator with the largest likelihood after a few iterations from
/// the highest peaks of the spectrum, smoothed over several widths, and from several quality factors.
pub(crate) fn start(bins: &[Bin], guess: Option<f64>) -> Option<Oscillator> {
    let powers: Vec<f64> = bins.iter().map(|bin| bin.power).collect();
    let floor = smoothed(&powers, (bins.len() / 50).max(4))
        .into_iter()
        .fold(f64::INFINITY, f64::min);
    let mut candidates: Vec<f64> = guess.into_iter().collect();
    if guess.is_none() {
        let mut half = 0;
        while half < bins.len() / 4 {
            // Power per octave: noise that falls like 1/f does not hide the resonance.
            let smooth = smoothed(&powers, half);
            let height = |k: usize| (smooth[k] - floor) * bins[k].frequency;
            let highest = (0..bins.len()).max_by(|a, b| height(*a).total_cmp(&height(*b)));
            candidates.extend(highest.map(|k| bins[k].frequency));
            half = 3 * half + 2;
        }
    }
    let kernel = Kernel::point();
    let started = candidates
        .iter()
        .flat_map(|f0| START_QUALITIES.map(|q| (*f0, q)));
    let started = started.filter_map(|(f0, q)| {
        let low = bins.partition_point(|bin| bin.frequency < f0 * (1.0 - 0.5 / q));
        let high = bins.partition_point(|bin| bin.frequency < f0 * (1.0 + 0.5 / q));
        // Of a peak between two bins there is no height.
        let near = bins.get(low..high).filter(|near| !near.is_empty())?;
        let mean = near.iter().map(|bin| bin.power).sum::<f64>() / near.len() as f64;
        let oscillator = Oscillator {
            f0,
            q,
            m: (mean - floor).max(0.1 * mean) * std::f64::consts::FRAC_PI_2 * f0 / q,
            w: floor.max(1e-6 * mean),
        };
        Some((oscillator, log_likelihood(bins, &oscillator, &kernel)))
    });
    let mut started: Vec<_> = started.filter(|(_, height)| height.is_finite()).collect();
    started.sort_by(|a, b| b.1.total_cmp(&a.1));
    let climbed = started
        .into_iter()
        .take(MAX_STARTS)
        .map(|(oscillator, _)| climb(bins, oscillator, &kernel, START_ITERATIONS, true));
    climbed
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(oscillator, _)| oscillator)
}

/// Running means over `2 half + 1` values, fewer at the ends.
pub(crate) fn smoothed(values: &[f64], half: usize) -> Vec<f64> {
    let mut sums = vec![0.0];
    let mut sum = 0.0;
    for value in values {
        sum += value;
        sums.push(sum);
    }
    let mean = |k: usize| {
        let (low, high) = (k.saturating_sub(half), (k + half + 1).min(values.len()));
        (sums[high] - sums[low]) / (high - low) as f64
    };
    (0..values.len()).map(mean).collect()
}
