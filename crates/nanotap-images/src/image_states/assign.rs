//! The state of each pixel, by amplitude and phase, with the offset of the measured phase.
//!
//! A measured phase is φ = φ₀ + s·lag with the offset φ₀ and s = 1, or s = −1 for a phase that leads. In
//! state k at the amplitude A the lag is φ_k(A), and the residual has the variance
//! σ² = σ_φ² + τ² + (dφ_k/dA σ_A)², with the noise of phase and amplitude and the error τ of the
//! case's own phases. Amplitudes of a state are uniform up to A₀; those of free flight are normal about A₀.
//! The image is a mixture of the states and of pixels of any phase, whose weights and offset follow
//! by expectation maximisation; the posterior of a pixel follows from the weights.
//!
//! Without a given offset every maximum of the likelihood over the offset is an assignment of the
//! whole image. Noise and the errors of a case do not decide between two that explain about the
//! same number of pixels: then the image is undecided.

use std::f64::consts::TAU;

use nanotap_arithmetic::{exp, ln};
use nanotap_dynamics::Control;

use super::curves::StateCurve;
use nanotap_fit::fit::instrument::wrapped;

/// Largest distance of a phase from that of its state, in standard errors.
const LARGEST_RESIDUAL: f64 = 3.5;
/// Largest probability of any phase with which a pixel fits a state.
const LARGEST_ANY: f64 = 0.1;
/// Standard error of the free amplitude of the case, over it.
const FREE_ERROR: f64 = 0.01;
/// Margin of the amplitudes at which a state exists, in standard errors of an amplitude.
const MARGIN: f64 = 3.0;
/// Initial share of pixels of any phase.
const ANY_PHASE: f64 = 0.02;
/// Least share of a state, so that few pixels can have it.
const LEAST_SHARE: f64 = 1e-6;
/// Most pixels among which offsets are looked for.
const SCANNED: usize = 8192;
/// Number of offsets that are tried in a turn.
const OFFSETS: usize = 720;
/// Least standard error with which they are tried, degrees: that of their spacing.
const SCAN_ERROR: f64 = 0.5;
/// Most maxima over the offset that are examined for each sense of the phase.
const MAX_MAXIMA: usize = 12;
/// Most steps of expectation maximisation.
const STEPS: usize = 60;
/// Change of offset (degrees) and weights below which they end.
const CONVERGED: f64 = 1e-5;
/// Share of the pixels that an assignment may leave unexplained beyond the best one and still be possible.
const POSSIBLE: f64 = 0.05;
/// Two materials cannot be told apart where the phases of their states differ by less than this, in errors
/// of the case's phases.
const INDISTINCT: f64 = 2.0;
/// Share of the pixels with another state from which on two assignments differ.
const DIFFERENT: f64 = 0.02;

/// What is known of a pixel: amplitude in m, and phase as measured in degrees.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pixel {
    /// Number of the pixel in the image.
    pub(super) place: usize,
    pub(super) amplitude: f64,
    pub(super) phase: f64,
}

/// States and noise.
#[derive(Debug)]
pub(super) struct Levels<'a> {
    pub(super) control: &'a Control<'a>,
    pub(super) curves: &'a [StateCurve],
    /// Amplitude (m) and phase lag (degrees) of the free lever, if free flight can be recognised.
    pub(super) free: Option<[f64; 2]>,
    pub(super) free_amplitude: f64,
    /// Standard errors of amplitude (m) and phase (degrees), and of the case's phases (degrees).
    pub(super) noise: [f64; 2],
    pub(super) tolerance: f64,
}

/// The instrument's phase: φ = offset + sense · lag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Convention {
    pub(super) offset: f64,
    /// 1, or −1 for a phase that leads.
    pub(super) sense: f64,
}

/// An assignment of the whole image.
#[derive(Clone, Debug)]
pub(super) struct Assignment {
    pub(super) convention: Convention,
    /// Standard error of the offset, degrees.
    pub(super) offset_error: f64,
    /// Weights of the states, free flight and any phase.
    weights: Vec<f64>,
    /// Logarithm of the likelihood of all pixels.
    likelihood: f64,
    /// Share of the pixels that fit a state within their noise.
    pub(super) explained: f64,
}

/// A pixel with its most probable state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Decision {
    /// Number of the state; free flight follows after the states.
    pub(super) state: usize,
    /// Its probability among the states.
    pub(super) probability: f64,
    /// Probability of any phase.
    any: f64,
    /// Residual of the phase, in standard errors.
    residual: f64,
    /// Whether a state above another material has the same phase within the errors of the case.
    pub(super) is_ambiguous: bool,
}

impl Decision {
    /// Whether amplitude and phase are those of the state within their noise.
    pub(super) fn fits(&self) -> bool {
        self.residual.abs() <= LARGEST_RESIDUAL && self.any <= LARGEST_ANY
    }
}

/// Expected phase lag and its variance in a state, and the density of the amplitude.
#[derive(Clone, Copy, Debug)]
struct Expected {
    phase: f64,
    variance: f64,
    density: f64,
}

impl Levels<'_> {
    /// Number of states, with free flight.
    pub(super) fn count(&self) -> usize {
        self.curves.len() + usize::from(self.free.is_some())
    }

    fn expected(&self, state: usize, amplitude: f64) -> Option<Expected> {
        let own = self.noise[1].powi(2) + self.tolerance.powi(2);
        if let Some(curve) = self.curves.get(state) {
            let at = curve.at(amplitude, MARGIN * self.noise[0])?;
            return Some(Expected {
                phase: at.phase,
                variance: own + (at.slope * self.noise[0]).powi(2),
                density: 1.0 / self.free_amplitude,
            });
        }
        let [level, phase] = self.free?;
        let variance = self.noise[0].powi(2) + (FREE_ERROR * level).powi(2);
        Some(Expected {
            phase,
            variance: own,
            density: normal(amplitude - level, variance),
        })
    }

    /// Density of pixels of any phase and amplitude.
    fn any(&self) -> f64 {
        1.0 / (360.0 * self.free_amplitude)
    }

    /// Calls `each` with the number of the state, the residual of the phase (degrees), its variance
    /// and the density.
    fn densities(
        &self,
        pixel: Pixel,
        convention: Convention,
        mut each: impl FnMut(usize, f64, f64, f64),
    ) {
        for state in 0..self.count() {
            if let Some(expected) = self.expected(state, pixel.amplitude) {
                let level = convention.offset + convention.sense * expected.phase;
                let residual = wrapped(pixel.phase - level);
                let density = expected.density * normal(residual, expected.variance);
                each(state, residual, expected.variance, density);
            }
        }
    }

    /// Offsets at which the likelihood of some of the pixels has a maximum.
    fn maxima(&self, pixels: &[Pixel], sense: f64) -> Vec<f64> {
        let every = pixels.len().div_ceil(SCANNED).max(1);
        let share = (1.0 - ANY_PHASE) / self.count() as f64;
        let any = ANY_PHASE * self.any();
        let spacing = 360.0 / OFFSETS as f64;
        let mut score = vec![0.0; OFFSETS];
        let mut density = vec![0.0; OFFSETS];
        for pixel in pixels.iter().step_by(every) {
            density.fill(any);
            for state in 0..self.count() {
                let Some(expected) = self.expected(state, pixel.amplitude) else {
                    continue;
                };
                let variance = expected.variance.max(SCAN_ERROR.powi(2));
                let level = pixel.phase - sense * expected.phase;
                // Farther off the density is that of any phase.
                let reach = (8.0 * variance.sqrt() / spacing)
                    .ceil()
                    .min(OFFSETS as f64 / 2.0) as i64;
                let nearest = (level / spacing).round() as i64;
                for at in nearest - reach..nearest + reach {
                    let residual = at as f64 * spacing - level;
                    let place = at.rem_euclid(OFFSETS as i64) as usize;
                    density[place] += share * expected.density * normal(residual, variance);
                }
            }
            for (score, density) in score.iter_mut().zip(&density) {
                *score += ln(*density);
            }
        }
        let is_maximum = |k: &usize| {
            let [before, after] = [k + OFFSETS - 1, k + 1].map(|at| score[at % OFFSETS]);
            score[*k] > before && score[*k] >= after
        };
        let mut maxima: Vec<usize> = (0..OFFSETS).filter(is_maximum).collect();
        maxima.sort_by(|a, b| score[*b].total_cmp(&score[*a]));
        maxima.truncate(MAX_MAXIMA);
        maxima.into_iter().map(|k| k as f64 * spacing).collect()
    }

    /// The assignment near a convention, whose offset is fitted unless it is given.
    pub(super) fn assignment(
        &self,
        pixels: &[Pixel],
        start: Convention,
        is_given: bool,
    ) -> Assignment {
        let states = self.count();
        let mut convention = start;
        let mut weights = vec![(1.0 - ANY_PHASE) / states as f64; states];
        weights.push(ANY_PHASE);
        let mut parts: Vec<(usize, f64, f64, f64)> = Vec::with_capacity(states);
        let mut likelihood = 0.0;
        let mut offset_error = 0.0;
        for _ in 0..STEPS {
            let mut sums = vec![0.0; states + 1];
            let (mut shift, mut information) = (0.0, 0.0);
            likelihood = 0.0;
            for pixel in pixels {
                parts.clear();
                let any = weights[states] * self.any();
                let mut total = any;
                self.densities(*pixel, convention, |state, residual, variance, density| {
                    let weighted = weights[state] * density;
                    total += weighted;
                    parts.push((state, residual, variance, weighted));
                });
                likelihood += ln(total);
                for (state, residual, variance, weighted) in &parts {
                    let probability = weighted / total;
                    sums[*state] += probability;
                    shift += probability * residual / variance;
                    information += probability / variance;
                }
                sums[states] += any / total;
            }
            let shares = sums.iter().map(|sum| sum / pixels.len().max(1) as f64);
            let shares: Vec<f64> = shares.map(|share| share.max(LEAST_SHARE)).collect();
            let all: f64 = shares.iter().sum();
            let mut change = 0.0_f64;
            for (weight, share) in weights.iter_mut().zip(&shares) {
                change = change.max((share / all - *weight).abs());
                *weight = share / all;
            }
            if !is_given && information > 0.0 {
                let step = shift / information;
                convention.offset = wrapped(convention.offset + step);
                change = change.max(step.abs());
                // The errors of the case's phases are those of its states, not of its pixels.
                let seen = sums[..states].iter().filter(|sum| **sum >= 1.0).count();
                let of_states = self.tolerance.powi(2) / seen.max(1) as f64;
                offset_error = (1.0 / information + of_states).sqrt();
            }
            if change < CONVERGED || self.control.is_cancelled() {
                break;
            }
        }
        let mut found = Assignment {
            convention,
            offset_error,
            weights,
            likelihood,
            explained: 0.0,
        };
        let fits = |pixel: &&Pixel| self.label(&found, **pixel).is_some();
        found.explained = pixels.iter().filter(fits).count() as f64 / pixels.len().max(1) as f64;
        found
    }

    /// The most probable state of a pixel, if it fits.
    fn label(&self, assignment: &Assignment, pixel: Pixel) -> Option<usize> {
        let decision = self.decision(assignment, pixel)?;
        decision.fits().then_some(decision.state)
    }

    /// The most probable state of a pixel.
    pub(super) fn decision(&self, assignment: &Assignment, pixel: Pixel) -> Option<Decision> {
        let states = self.count();
        let any = assignment.weights[states] * self.any();
        let mut total = any;
        let mut best: Option<(f64, Decision)> = None;
        self.densities(
            pixel,
            assignment.convention,
            |state, residual, variance, density| {
                let weighted = assignment.weights[state] * density;
                total += weighted;
                if best.is_none_or(|(most, _)| weighted > most) {
                    let residual = residual / variance.sqrt();
                    let decision = Decision {
                        state,
                        probability: 0.0,
                        any: 0.0,
                        residual,
                        is_ambiguous: false,
                    };
                    best = Some((weighted, decision));
                }
            },
        );
        best.map(|(weighted, decision)| Decision {
            probability: weighted / (total - any).max(f64::MIN_POSITIVE),
            any: any / total,
            is_ambiguous: self.is_ambiguous(decision.state, pixel.amplitude),
            ..decision
        })
    }

    /// Whether a state above another material has the phase of a state within the errors of both, which
    /// are the same in all pixels.
    fn is_ambiguous(&self, state: usize, amplitude: f64) -> bool {
        let Some(own) = self.curves.get(state) else {
            return false;
        };
        let phase = |state| self.expected(state, amplitude).map(|of| of.phase);
        let others = self.curves.iter().enumerate();
        let mut others = others.filter(|(_, other)| other.material != own.material);
        others.any(|(other, _)| {
            let phases = phase(state).zip(phase(other));
            phases.is_some_and(|(a, b)| wrapped(a - b).abs() <= INDISTINCT * self.tolerance)
        })
    }

    /// The most likely assignment, and the others that are possible.
    pub(super) fn assignments(
        &self,
        pixels: &[Pixel],
        offset: Option<f64>,
        senses: &[f64],
    ) -> Vec<Assignment> {
        let every = pixels.len().div_ceil(SCANNED).max(1);
        let some: Vec<Pixel> = pixels.iter().step_by(every).copied().collect();
        let mut found: Vec<Assignment> = Vec::new();
        for sense in senses {
            let starts = offset.map_or_else(|| self.maxima(&some, *sense), |offset| vec![offset]);
            found.extend(starts.into_iter().map(|offset_of_start| {
                let start = Convention {
                    offset: offset_of_start,
                    sense: *sense,
                };
                self.assignment(&some, start, offset.is_some())
            }));
        }
        found.sort_by(|a, b| b.likelihood.total_cmp(&a.likelihood));
        let most = found.iter().map(|of| of.explained).fold(0.0, f64::max);
        found.retain(|of| of.explained >= most - POSSIBLE);
        let mut distinct: Vec<Assignment> = Vec::new();
        for assignment in found {
            if distinct
                .iter()
                .all(|other| self.differ(&some, other, &assignment))
            {
                distinct.push(assignment);
            }
        }
        let all = distinct.into_iter();
        all.map(|of| self.assignment(pixels, of.convention, offset.is_some()))
            .collect()
    }

    /// Whether two assignments give more than a few pixels another state.
    fn differ(&self, pixels: &[Pixel], a: &Assignment, b: &Assignment) -> bool {
        let other = |pixel: &&Pixel| self.label(a, **pixel) != self.label(b, **pixel);
        let count = pixels.iter().filter(other).count();
        count as f64 > DIFFERENT * pixels.len() as f64
    }
}

/// Density of a normal distribution.
fn normal(residual: f64, variance: f64) -> f64 {
    exp(-0.5 * residual * residual / variance) / (TAU * variance).sqrt()
}

/// Noise of a channel, from the second differences of neighbouring pixels of a line, in which no slope is
/// left: 1.4826 times the median of their absolute values, over √6.
pub(super) fn noise_of(values: &[f64], points: usize, difference: fn(f64) -> f64) -> f64 {
    let mut changes: Vec<f64> = values
        .chunks(points.max(1))
        .flat_map(|line| line.windows(3))
        .map(|of| (difference(of[2] - of[1]) - difference(of[1] - of[0])).abs())
        .filter(|change| change.is_finite())
        .collect();
    if changes.is_empty() {
        return 0.0;
    }
    let middle = changes.len() / 2;
    let (_, median, _) = changes.select_nth_unstable_by(middle, f64::total_cmp);
    1.4826 * *median / 6f64.sqrt()
}
