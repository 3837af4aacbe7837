//! Small disturbances of an orbit and of the lock-in amplifier that reads it, under a random force.
//!
//! Disturbances of the state are carried from one instant of the orbit to the next by central
//! differences of the flow, contacts and their ends included. The lock-in amplifier forms
//! `τ ż = 2 W e^{−iΩt} − z`; its real and imaginary part are two more states. Over the period the
//! disturbance is multiplied by a matrix and gains a covariance; its stationary covariance P obeys
//! `P = A P Aᵀ + Q`.

use nalgebra::{Complex, DMatrix, DVector, Matrix2};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::StroboscopicMap as _;
use schemars::JsonSchema;
use serde::Serialize;

use super::Thermal;
use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_model::model_map::ModelMap;
use nanotap_model::{Model, MotionError};
use nanotap_motions::orbit::OrbitReport;

/// Smallest number of instants in a drive period.
const STEPS: usize = 128;
/// Instants in a period of the fastest mode.
const STEPS_OF_FASTEST: f64 = 32.0;
/// Largest number of instants in a drive period.
const MOST_STEPS: usize = 20_000;
/// Size of a disturbance for finite differences, relative to that of the motion.
const DISTURBANCE: f64 = 1e-5;
/// Doublings of the time over which covariance is gathered: 2⁶⁰ periods.
const DOUBLINGS: usize = 60;

/// Number of frequencies of a spectrum.
const FREQUENCIES: usize = 120;
/// Lowest frequency of a spectrum over the slowest rate of the orbit or of the filter.
const LOWEST: f64 = 0.02;

/// One-sided spectral densities of the amplitude and the phase that the lock-in amplifier reads, up to
/// half the frequency of the orbit. Their integrals are the squares of the noise.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ReadingSpectrum {
    /// Distances from the drive's frequency, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub frequency: Vec<f64>,
    /// Density of the amplitude at these frequencies, m²/Hz.
    #[schemars(extend("x-unit" = "m^2/Hz"))]
    pub amplitude: Vec<f64>,
    /// Density of the phase at these frequencies, degrees²/Hz.
    #[schemars(extend("x-unit" = "degree^2/Hz"))]
    pub phase: Vec<f64>,
}

impl ReadingSpectrum {
    /// Converts the spectrum to SI, with these units of length and time.
    pub(super) fn in_si(&self, length: f64, time: f64) -> Self {
        let scaled = |values: &[f64], by: f64| values.iter().map(|value| by * value).collect();
        Self {
            frequency: scaled(&self.frequency, 1.0 / time),
            amplitude: scaled(&self.amplitude, length * length * time),
            phase: scaled(&self.phase, time),
        }
    }
}

/// A lock-in amplifier with a first-order filter.
#[derive(Clone, Copy, Debug)]
pub(super) struct LockIn {
    /// Time constant in the model's unit of time.
    pub(super) time_constant: f64,
}

impl LockIn {
    /// Returns the noise bandwidth of the filter, in the model's unit of frequency (1/time).
    pub(super) fn bandwidth(self) -> f64 {
        0.25 / self.time_constant
    }
}

/// One period of an orbit, linearised.
pub(super) struct Linearised {
    /// Matrix that multiplies a disturbance of the state and of the lock-in amplifier's two
    /// components.
    factor: DMatrix<f64>,
    /// Covariance that the period adds.
    added: DMatrix<f64>,
    /// Reading of the lock-in amplifier without noise, as a complex amplitude in model units.
    pub(super) read: Complex<f64>,
    /// Length of the orbit in the model's unit of time.
    duration: f64,
}

impl Linearised {
    /// Linearises the flow along an orbit.
    pub(super) fn along(
        model: &Model,
        orbit: &OrbitReport,
        thermal: &Thermal,
        lock_in: LockIn,
        control: &Control<'_>,
    ) -> Result<Self, Error> {
        let period = model.period();
        let omega = model.frequency();
        let diffusion = thermal.diffusion();
        let modes = diffusion.nrows();
        let mut map = ModelMap::new(model);
        let mut state = orbit.state.clone();
        // Entries that vary continuously.
        let n = state.len() - map.discrete_entries();
        let steps = steps_of(thermal.fastest() / omega);
        let h = period / steps as f64;
        let tau = lock_in.time_constant;
        let fade = nanotap_arithmetic::exp(-h / tau);
        let tip = DVector::from_iterator(n, model.tip.row.iter().copied().take(n));
        let deflection =
            |state: &[f64]| -> f64 { state.iter().zip(&tip).map(|(x, row)| x * row).sum() };
        let turn = |t: f64| {
            Complex::new(
                nanotap_arithmetic::cos(omega * t),
                -nanotap_arithmetic::sin(omega * t),
            )
        };
        let mut force = DMatrix::zeros(n, n);
        force
            .view_mut((modes, modes), (modes, modes))
            .copy_from(&diffusion);
        let sizes = sizes(orbit, omega, n, modes);
        let mut factor = DMatrix::identity(n + 2, n + 2);
        let mut added = DMatrix::zeros(n + 2, n + 2);
        let mut read = Complex::new(0.0, 0.0);
        for _ in 0..orbit.period {
            for step in 0..steps {
                if control.is_cancelled() {
                    return Err(Error::stopped());
                }
                let times = [step as f64 * h, (step + 1) as f64 * h];
                let mut after = state.clone();
                map.advance_between(&mut after, times)?;
                let mut carried = DMatrix::zeros(n, n);
                for column in 0..n {
                    let mut side = |sign: f64| {
                        let mut moved = state.clone();
                        moved[column] += sign * sizes[column];
                        map.advance_between(&mut moved, times)?;
                        Ok::<_, MotionError>(moved)
                    };
                    let (high, low) = (side(1.0)?, side(-1.0)?);
                    for row in 0..n {
                        carried[(row, column)] = 0.5 * (high[row] - low[row]) / sizes[column];
                    }
                }
                // The filter gathers the deflection by the trapezoidal rule, which is accurate beyond
                // all orders over whole periods.
                let (before, behind) = (
                    turn(times[0]) * (h * fade / tau),
                    turn(times[1]) * (h / tau),
                );
                read = read * fade + before * deflection(&state) + behind * deflection(&after);
                let mut one = DMatrix::zeros(n + 2, n + 2);
                one.view_mut((0, 0), (n, n)).copy_from(&carried);
                let seen = carried.tr_mul(&tip);
                for column in 0..n {
                    let through = before * tip[column] + behind * seen[column];
                    one[(n, column)] = through.re;
                    one[(n + 1, column)] = through.im;
                }
                one[(n, n)] = fade;
                one[(n + 1, n + 1)] = fade;
                let noise = 0.5 * h * (&carried * &force * carried.transpose() + &force);
                let mut enters = DMatrix::zeros(n + 2, n);
                enters.view_mut((0, 0), (n, n)).fill_with_identity();
                for column in 0..n {
                    let through = behind * tip[column];
                    enters[(n, column)] = through.re;
                    enters[(n + 1, column)] = through.im;
                }
                factor = &one * factor;
                added = &one * added * one.transpose() + &enters * noise * enters.transpose();
                state = after;
            }
        }
        let left = nanotap_arithmetic::exp(-period * orbit.period as f64 / tau);
        Ok(Self {
            factor,
            added,
            read: read / (1.0 - left),
            duration: period * orbit.period as f64,
        })
    }

    /// The covariance in the long run.
    pub(super) fn stationary(&self) -> Result<DMatrix<f64>, Error> {
        let (mut covariance, mut factor) = (self.added.clone(), self.factor.clone());
        for _ in 0..DOUBLINGS {
            let more = &factor * &covariance * factor.transpose();
            covariance += &more;
            if more.norm() <= f64::EPSILON * covariance.norm() {
                return Ok(covariance);
            }
            factor = &factor * &factor;
        }
        Err(Error::numerics(
            "disturbances of this orbit do not die out: its noise grows without bound",
        ))
    }
}

impl Linearised {
    /// One-sided spectral densities of the amplitude and the phase (in radians), and between these, far
    /// below the slowest rate: `2T G Q Gᵀ` with `G = (1 − A)⁻¹` on both; see [`spectrum`](Self::spectrum).
    pub(super) fn slow_densities(
        &self,
        [along, across]: [&DVector<f64>; 2],
        amplitude: f64,
    ) -> Option<Matrix2<f64>> {
        let n = self.factor.nrows();
        let matrix = (DMatrix::identity(n, n) - &self.factor).transpose().lu();
        let through = |way: &DVector<f64>, unit: f64| {
            let mut part = DVector::zeros(n);
            part.rows_mut(n - 2, 2).copy_from(&(way * unit));
            matrix.solve(&part)
        };
        let ways = [through(along, 1.0)?, through(across, 1.0 / amplitude)?];
        let density =
            |k: usize, l: usize| 2.0 * self.duration * ways[k].dot(&(&self.added * &ways[l]));
        Some(Matrix2::from_fn(density))
    }

    /// Spectra of the amplitude and the phase, which are the lock-in amplifier's two parts along and
    /// across its mean reading. With A and Q of an orbit of length T they are
    /// `2T uᵀ (e^{iωT} − A)⁻¹ Q (e^{iωT} − A)⁻ᴴ u`.
    pub(super) fn spectrum(
        &self,
        [along, across]: [&DVector<f64>; 2],
        amplitude: f64,
        lock_in: LockIn,
    ) -> Result<ReadingSpectrum, Error> {
        let n = self.factor.nrows();
        let complex = |matrix: &DMatrix<f64>| matrix.map(|entry| Complex::new(entry, 0.0));
        let (factor, added) = (complex(&self.factor), complex(&self.added));
        let slowest = (self.factor.complex_eigenvalues().iter())
            .map(|value| -nanotap_arithmetic::ln(value.modulus()) / self.duration)
            .fold(1.0 / lock_in.time_constant, f64::min);
        let highest = 0.5 / self.duration;
        let lowest = (LOWEST * slowest / std::f64::consts::TAU).min(0.1 * highest);
        let ratio = nanotap_arithmetic::ln(highest / lowest) / (FREQUENCIES - 1) as f64;
        let mut spectrum = ReadingSpectrum {
            frequency: Vec::new(),
            amplitude: Vec::new(),
            phase: Vec::new(),
        };
        for k in 0..FREQUENCIES {
            let frequency = lowest * nanotap_arithmetic::exp(k as f64 * ratio);
            let angle = std::f64::consts::TAU * frequency * self.duration;
            let turn = Complex::new(
                nanotap_arithmetic::cos(angle),
                nanotap_arithmetic::sin(angle),
            );
            // (e^{iωT} − A)ᵀ y = u.
            let matrix = (DMatrix::from_diagonal_element(n, n, turn) - &factor).transpose();
            let decomposed = matrix.lu();
            let density = |way: &DVector<f64>| -> Option<f64> {
                let mut part = DVector::zeros(n);
                part[n - 2] = Complex::new(way[0], 0.0);
                part[n - 1] = Complex::new(way[1], 0.0);
                let through: DVector<Complex<f64>> = decomposed.solve(&part)?;
                let through = through.map(|entry| entry.conj());
                Some(2.0 * self.duration * through.dotc(&(&added * &through)).re)
            };
            let (Some(a), Some(b)) = (density(along), density(across)) else {
                return Err(Error::numerics("the spectrum of the noise is not finite"));
            };
            spectrum.frequency.push(frequency);
            spectrum.amplitude.push(a.max(0.0));
            let degrees = (1.0 / amplitude).to_degrees();
            spectrum.phase.push(b.max(0.0) * degrees * degrees);
        }
        Ok(spectrum)
    }
}

/// Instants in a drive period: enough for the fastest free mode, whose frequency over that of the
/// drive is given.
fn steps_of(fastest: f64) -> usize {
    let wanted = STEPS_OF_FASTEST * fastest;
    (wanted.ceil() as usize).clamp(STEPS, MOST_STEPS)
}

/// How far each entry of the state is displaced.
fn sizes(orbit: &OrbitReport, omega: f64, n: usize, modes: usize) -> Vec<f64> {
    let amplitude = orbit
        .observables
        .first_harmonic
        .abs()
        .max(f64::MIN_POSITIVE);
    let size = |k: usize| {
        let is_velocity = k >= modes && k < 2 * modes;
        let unit = if is_velocity { omega } else { 1.0 };
        DISTURBANCE * amplitude * unit
    };
    (0..n).map(size).collect()
}
