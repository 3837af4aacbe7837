//! Harmonics of tip deflection, slope and force.

use std::collections::BTreeMap;

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
    /// Of two tones: the numbers a and b of the lowest product a f₁ + b f₂ at this frequency.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub product: Option<[i32; 2]>,
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
    /// Components at `j Ω/n`, `j = 1, 2, …`, for a motion of period `n`. Under two tones that repeat
    /// after more than 64 periods of the first, those where products of the tones lie.
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

/// Periods of the first tone, up to which every multiple of the fundamental frequency is listed.
const DENSE: usize = 64;
/// Largest order |a| + |b| of a listed product a ω₁ + b ω₂ of two tones.
const MIXING: i64 = 40;
/// Most components that are listed.
const MAX_LINES: usize = 40_000;

/// A multiple of a motion's fundamental frequency, and the product of two tones that lies there.
type Line = (usize, Option<[i32; 2]>);

/// The multiples of a motion's fundamental frequency up to `orders` times the drive frequency that
/// its spectrum lists.
fn lines(model: &Model, period: usize, orders: usize) -> Vec<Line> {
    let count = orders * model.repetition() * period;
    let &[q, p] = model.system.drive().harmonics() else {
        return (1..=count).map(|multiple| (multiple, None)).collect();
    };
    let period = period as i64;
    let [q, p] = [q, p].map(|tone| i64::from(tone) * period);
    // Those of low order first, so that they name what lies at the same frequency as others.
    let mut products = BTreeMap::new();
    for order in 1..=MIXING {
        for a in -order..=order {
            let b = order - a.abs();
            for b in [-b, b] {
                if let Ok(multiple) = usize::try_from(a * q + b * p)
                    && (1..=count).contains(&multiple)
                {
                    products.entry(multiple).or_insert([a, b].map(|n| n as i32));
                }
            }
        }
    }
    if model.repetition() > DENSE && period == 1 {
        return products.into_iter().map(|(j, ab)| (j, Some(ab))).collect();
    }
    (1..=count.min(MAX_LINES))
        .map(|multiple| (multiple, products.get(&multiple).copied()))
        .collect()
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
        let lines = lines(model, period, orders);
        let multiples: Vec<usize> = lines.iter().map(|(multiple, _)| *multiple).collect();
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
        let harmonics = Curve::fouriers(&curves, base, &multiples)
            .into_iter()
            .zip(&lines)
            .map(|(of, (multiple, product))| {
                let force = of[1] + by_impulses(base * *multiple as f64);
                Harmonic {
                    order: *multiple as f64 / repetition as f64,
                    product: *product,
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
