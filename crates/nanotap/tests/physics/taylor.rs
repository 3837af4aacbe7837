//! An independent integration of a piecewise-linear system: Taylor series of high order from step
//! to step, switches as first roots of the guards' polynomials, isolated in Bernstein form. It uses
//! no eigenvalues, exponentials or tables.

use nalgebra::DVector;
use nanotap_flow::{Complex, HarmonicVector, Output, System};

/// Order of the series: with steps of at most [`MAX_STEP`] over the fastest rate the remainder is
/// 2³¹/31! = 3e-25 of the state.
const ORDER: usize = 30;
const MAX_STEP: f64 = 2.0;

/// Final state of a run.
pub(crate) struct End {
    pub(crate) state: DVector<f64>,
    /// Times of its switches.
    pub(crate) switches: Vec<f64>,
}

/// Runs `system` from the state `x` in `regime` at time 0 to `end`; `fastest` is a bound on the
/// rates of its modes. `None` if rounding decides about a very light contact.
pub(crate) fn run(
    system: &System,
    x: &[f64],
    mut regime: usize,
    fastest: f64,
    end: f64,
) -> Option<End> {
    let mut state = DVector::from_column_slice(x);
    let (mut time, mut switches, mut switched) = (0.0, Vec::new(), false);
    while time < end {
        let step = (MAX_STEP / fastest).min(end - time);
        let series = series(system, regime, &state, time, step);
        let mut first: Option<(f64, usize)> = None;
        for (k, transition) in system.transitions()[regime].iter().enumerate() {
            let guard = guard(system, &transition.guard, &series, time, step);
            // Effect of the rounding of the state on the guard.
            let row = transition.guard.row.transpose();
            let noise = 1e-13 * (row.abs().dot(&state.abs()) + transition.guard.constant.abs());
            let root = first_root(&guard, noise, switched)?;
            if root < first.map_or(f64::INFINITY, |(s, _)| s) {
                first = Some((root, k));
            }
        }
        switched = false;
        let Some((root, k)) = first.filter(|(root, _)| *root <= 1.0) else {
            state = at(&series, 1.0);
            time += step;
            continue;
        };
        state = at(&series, root);
        time += root * step;
        let transition = &system.transitions()[regime][k];
        if let Some(reset) = &transition.reset {
            state = &reset.matrix * state + reset.offset.at(system.drive(), time);
        }
        regime = transition.target;
        switches.push(time);
        switched = true;
    }
    Some(End { state, switches })
}

/// Coefficients of x(time + s·step) in powers of s: (n + 1) c_{n+1} = step (A c_n + f_n).
fn series(
    system: &System,
    regime: usize,
    state: &DVector<f64>,
    time: f64,
    step: f64,
) -> Vec<DVector<f64>> {
    let regime = &system.regimes()[regime];
    let forcing: &HarmonicVector = regime.forcing();
    let mut tones = turned(system, time);
    let mut all = vec![state.clone()];
    for n in 0..ORDER {
        let mut rate = regime.matrix() * &all[n];
        if n == 0 {
            rate += &forcing.constant;
        }
        for (amplitude, tone) in forcing.tones.iter().zip(&tones) {
            rate += amplitude.map(|z| (z * tone).re);
        }
        all.push(rate * (step / (n + 1) as f64));
        next_power(system, &mut tones, n, step);
    }
    all
}

/// e^{iωt} of every tone.
fn turned(system: &System, time: f64) -> Vec<Complex> {
    let frequencies = system.drive().frequencies().iter();
    frequencies
        .map(|omega| Complex::new((omega * time).cos(), (omega * time).sin()))
        .collect()
}

/// From the coefficient of sⁿ of e^{iω(t + s step)} to the next one.
fn next_power(system: &System, tones: &mut [Complex], n: usize, step: f64) {
    for (tone, omega) in tones.iter_mut().zip(system.drive().frequencies()) {
        *tone *= Complex::new(0.0, omega * step / (n + 1) as f64);
    }
}

fn guard(
    system: &System,
    output: &Output,
    series: &[DVector<f64>],
    time: f64,
    step: f64,
) -> Vec<f64> {
    let mut tones = turned(system, time);
    let mut all = Vec::with_capacity(series.len());
    for (n, c) in series.iter().enumerate() {
        let constant = if n == 0 { output.constant } else { 0.0 };
        let driven = output
            .tones
            .iter()
            .zip(&tones)
            .map(|(z, tone)| (z * tone).re);
        all.push((&output.row * c)[0] + constant + driven.sum::<f64>());
        next_power(system, &mut tones, n, step);
    }
    all
}

/// The sum of a series at `s`.
pub(crate) fn at(series: &[DVector<f64>], s: f64) -> DVector<f64> {
    let zero = DVector::zeros(series[0].len());
    series.iter().rev().fold(zero, |sum, c| sum * s + c)
}

fn horner(coefficients: &[f64], s: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * s + c)
}

/// The first s in [0, 1] at which the polynomial falls below zero; infinity if there is none;
/// `None` if it cannot be distinguished from a touch. Just after a switch, powers that consist of
/// rounding only are ignored.
pub(crate) fn first_root(coefficients: &[f64], noise: f64, switched: bool) -> Option<f64> {
    let size = coefficients.iter().map(|c| c.abs()).sum::<f64>();
    if size == 0.0 {
        return Some(f64::INFINITY);
    }
    let tiny = noise.max(1e-11 * size);
    let skipped = if switched {
        coefficients.iter().take_while(|c| c.abs() <= tiny).count()
    } else {
        0
    };
    let rest = &coefficients[skipped..];
    if rest.first().is_none_or(|c| *c < 0.0) {
        return (!switched && !rest.is_empty()).then_some(0.0);
    }
    let degree = rest.len() - 1;
    let mut binomials = vec![1.0; degree + 1];
    for k in 1..=degree {
        binomials[k] = binomials[k - 1] * (degree + 1 - k) as f64 / k as f64;
    }
    let mut below = vec![0.0; degree + 1];
    for (j, b) in below.iter_mut().enumerate() {
        let mut ratio = 1.0;
        for (i, c) in rest.iter().enumerate().take(j + 1) {
            // C(j, i)/C(n, i).
            *b += c * ratio;
            ratio *= (j - i) as f64 / (degree - i).max(1) as f64;
        }
    }
    isolated(&below, 0.0, 1.0, noise.max(1e-15 * size)).map(|found| {
        found.map_or(f64::INFINITY, |(mut low, mut high)| {
            while high - low > f64::EPSILON * high {
                let middle = 0.5 * (low + high);
                if middle <= low || middle >= high {
                    break;
                }
                if horner(rest, middle) > 0.0 {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            high
        })
    })
}

/// An interval that contains the first root only, of a polynomial given by its Bernstein
/// coefficients over `low … high` that is positive at `low`.
#[allow(clippy::option_option, reason = "no root, and no answer")]
fn isolated(bernstein: &[f64], low: f64, high: f64, noise: f64) -> Option<Option<(f64, f64)>> {
    if bernstein.iter().all(|b| *b > 0.0) {
        return Some(None);
    }
    let changes = bernstein
        .windows(2)
        .filter(|w| (w[0] > 0.0) != (w[1] > 0.0));
    if changes.count() == 1 && bernstein[bernstein.len() - 1] < -noise {
        return Some(Some((low, high)));
    }
    if high - low < 1e-8 {
        return None;
    }
    // The two halves by de Casteljau's algorithm.
    let (mut left, mut right) = (Vec::new(), Vec::new());
    let mut row = bernstein.to_vec();
    while let (Some(first), Some(last)) = (row.first().copied(), row.last().copied()) {
        left.push(first);
        right.push(last);
        row = row.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
    }
    right.reverse();
    let middle = 0.5 * (low + high);
    match isolated(&left, low, middle, noise)? {
        Some(found) => Some(Some(found)),
        // A root at the middle belongs to the right half.
        None => isolated(&right, middle, high, noise),
    }
}
