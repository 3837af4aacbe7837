//! Harmonics of tip deflection, slope and force.

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::Complex;
use schemars::JsonSchema;
use serde::Serialize;

use crate::model::Model;
use crate::model::recording::{Curve, Recording};

/// One component of a periodic motion, in the model's units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Harmonic {
    /// Frequency as a multiple of the drive frequency; fractional for a subharmonic motion.
    pub order: f64,
    /// Amplitude of the tip deflection.
    pub tip: f64,
    /// Phase lag of the tip deflection behind sin(order · Ωτ), degrees in (−180, 180].
    pub tip_phase: f64,
    /// Amplitude of the contact force.
    pub force: f64,
    /// Phase lag of the contact force, degrees in (−180, 180].
    pub force_phase: f64,
    /// Amplitude of the slope at the tip, for a beam.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope: Option<f64>,
}

/// The spectrum of a periodic motion.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Spectrum {
    /// Components at `j Ω/n`, `j = 1, 2, …`, for a motion of period `n`.
    pub harmonics: Vec<Harmonic>,
    /// Fraction of the tip deflection's power (variance) outside the drive frequency, 0 … 1: the
    /// paper's total harmonic distortion, from the exact variance and not from a truncated sum.
    pub thd: f64,
    /// Phase lag of the tip deflection behind the drive, degrees in (−180, 180]; 90 at the free
    /// resonance of a lever with high Q. It is serialised with the
    /// [`Observables`](super::Observables).
    #[serde(skip)]
    pub phase: f64,
    /// Amplitude of the tip deflection at the drive frequency; serialised with the observables.
    #[serde(skip)]
    pub first_harmonic: f64,
}

impl Spectrum {
    /// Computes the spectrum up to `orders` times the drive frequency from a recording of exactly
    /// one repetition: `period` drive periods.
    pub fn of(model: &Model, recording: &Recording, period: usize, orders: usize) -> Self {
        let tip = recording.curve(&model.tip);
        let force = recording.force(model);
        let slope = model.beam.as_ref().map(|beam| recording.curve(&beam.slope));
        // Both tones are multiples of the motion's fundamental frequency.
        let repetition = model.repetition() * period;
        let base = model.frequency() / repetition as f64;
        let count = orders * repetition;
        let frequencies: Vec<f64> = (1..=count).map(|j| base * j as f64).collect();
        let curves: Vec<&Curve> = [Some(&tip), Some(&force), slope.as_ref()]
            .into_iter()
            .flatten()
            .collect();
        let impulses = recording.impulses(model);
        let by_impulses = |omega: f64| -> Complex {
            let turned = impulses.iter().map(|(time, impulse)| {
                let (sin, cos) = nanotap_arithmetic::sin_cos(omega * time);
                Complex::new(cos, -sin) * *impulse
            });
            turned.sum::<Complex>() * (2.0 / force.duration())
        };
        let harmonics = Curve::fouriers(&curves, &frequencies)
            .into_iter()
            .enumerate()
            .map(|(k, of)| {
                let force = of[1] + by_impulses(frequencies[k]);
                Harmonic {
                    order: (k + 1) as f64 / repetition as f64,
                    tip: of[0].modulus(),
                    tip_phase: lag(of[0]),
                    force: force.modulus(),
                    force_phase: lag(force),
                    slope: of.get(2).map(|slope| slope.modulus()),
                }
            })
            .collect();
        let first = tip.fourier(model.frequency());
        let mean = tip.mean();
        let variance = tip.product_integral(&tip) / tip.duration() - mean * mean;
        let thd = if variance > 0.0 {
            (1.0 - 0.5 * first.norm_sqr() / variance).clamp(0.0, 1.0)
        } else {
            0.0
        };
        Self {
            harmonics,
            thd,
            phase: lag(first),
            first_harmonic: first.modulus(),
        }
    }
}

/// The lag φ of `Re(c e^{iθ}) = |c| sin(θ − φ)`, degrees in (−180, 180].
pub(crate) fn lag(c: Complex) -> f64 {
    let degrees = -(c * Complex::new(0.0, 1.0)).argument().to_degrees();
    if degrees <= -180.0 {
        degrees + 360.0
    } else {
        degrees
    }
}
