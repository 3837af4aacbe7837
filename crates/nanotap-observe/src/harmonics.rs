//! Harmonics of tip deflection, slope and force.

use std::collections::BTreeMap;

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::Complex;
use schemars::JsonSchema;
use serde::Serialize;

use nanotap_model::Model;
use nanotap_model::recording::{Curve, Recording};

/// One component of a periodic motion, in the model's units.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Harmonic {
    /// Frequency as a multiple of the drive frequency, dimensionless; fractional for a subharmonic
    /// motion.
    pub order: f64,
    /// With several tones, the numbers a, b, … of the lowest product a f₁ + b f₂ + … at this
    /// frequency.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub product: Option<Vec<i32>>,
    /// Amplitude of the tip deflection, in the model's unit of length (g₀ for a beam).
    #[schemars(extend("x-unit" = crate::Dimension::Length.model_unit()))]
    pub tip: f64,
    /// Phase lag of the tip deflection behind sin(order · Ωτ), degrees in (−180, 180].
    #[schemars(extend("x-unit" = "degree"))]
    pub tip_phase: f64,
    /// Amplitude of the force of the sample on the tip, in the model's unit of force (EI g₀/L³ for
    /// a beam).
    #[schemars(extend("x-unit" = crate::Dimension::Force.model_unit()))]
    pub force: f64,
    /// Phase lag of the contact force, degrees in (−180, 180].
    #[schemars(extend("x-unit" = "degree"))]
    pub force_phase: f64,
    /// Amplitude of the slope dW/dξ at the tip, in the model's unit g₀/L, for a beam.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = crate::Dimension::Slope.model_unit()))]
    pub slope: Option<f64>,
}

/// The spectrum of a periodic motion.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Spectrum {
    /// Components at `j Ω/n`, `j = 1, 2, …`, for a motion of period `n`. Under several tones that repeat
    /// after more than 64 periods of the first, those where products of the tones lie; of a long
    /// motion, the products of the lowest orders.
    pub harmonics: Vec<Harmonic>,
    /// Fraction of the tip deflection's power (variance) outside the drive frequency, 0 … 1: the
    /// paper's total harmonic distortion, from the exact variance and not from a truncated sum.
    pub thd: f64,
    /// Phase lag of the tip deflection behind the drive, degrees in (−180, 180]; 90 at the free
    /// resonance of a lever with high Q. It is serialised with the
    /// [`Observables`](super::Observables).
    #[serde(skip)]
    pub phase: f64,
    /// Amplitude of the tip deflection at the drive frequency, in the model's unit of length;
    /// serialised with the observables.
    #[serde(skip)]
    pub first_harmonic: f64,
}

/// Periods of the first tone, up to which every multiple of the fundamental frequency is listed.
const DENSE: usize = 64;
/// Largest order |a| + |b| + … of a listed product a ω₁ + b ω₂ + … of several tones.
const MIXING: i32 = 40;
/// Largest number of components that are listed.
const MAX_LINES: usize = 40_000;
/// Largest number of listed products, times the periods of the first tone in the motion: the work grows
/// with both, and some seconds are enough.
const MAX_PRODUCT_PERIODS: usize = 1_000_000;

/// A multiple of a motion's fundamental frequency, and the product of several tones that lies there.
type Line = (usize, Option<Vec<i32>>);

/// Calls `found` with all whole numbers, as many as `product` has from `at` on, whose sizes add up to
/// `order`.
fn products(product: &mut [i32], at: usize, order: i32, found: &mut impl FnMut(&[i32])) {
    if at + 1 < product.len() {
        for a in -order..=order {
            product[at] = a;
            products(product, at + 1, order - a.abs(), found);
        }
    } else {
        for last in [-order, order] {
            product[at] = last;
            found(product);
        }
    }
}

/// The multiples of a motion's fundamental frequency up to `orders` times the drive frequency that
/// its spectrum lists.
fn lines(model: &Model, period: usize, orders: usize) -> Vec<Line> {
    let count = orders * model.repetition() * period;
    let tones = model.system.drive().harmonics();
    if tones.len() < 2 {
        return (1..=count).map(|multiple| (multiple, None)).collect();
    }
    // Those of low order first, so that they name what lies at the same frequency as others.
    let mut named = BTreeMap::new();
    for order in 1..=MIXING {
        products(&mut vec![0; tones.len()], 0, order, &mut |product| {
            let terms = product.iter().zip(tones);
            let multiple: i64 = terms
                .map(|(a, tone)| i64::from(*a) * i64::from(*tone))
                .sum();
            if let Ok(multiple) = usize::try_from(multiple * period as i64)
                && (1..=count).contains(&multiple)
            {
                named.entry(multiple).or_insert_with(|| product.to_vec());
            }
        });
    }
    if model.repetition() > DENSE {
        let mut products: Vec<(usize, Vec<i32>)> = named.into_iter().collect();
        let order = |product: &[i32]| product.iter().map(|a| a.unsigned_abs()).sum::<u32>();
        products.sort_by_key(|(multiple, product)| (order(product), *multiple));
        products.truncate(MAX_PRODUCT_PERIODS / (model.repetition() * period));
        products.sort_unstable();
        return products.into_iter().map(|(j, of)| (j, Some(of))).collect();
    }
    (1..=count.min(MAX_LINES))
        .map(|multiple| (multiple, named.get(&multiple).cloned()))
        .collect()
}

impl Spectrum {
    /// Computes the spectrum up to `orders` times the drive frequency from a recording of exactly
    /// one repetition: `period` drive periods.
    pub fn of(model: &Model, recording: &Recording, period: usize, orders: usize) -> Self {
        let tip = recording.curve(&model.tip);
        let force = recording.force(model);
        let slope = model.beam.as_ref().map(|beam| recording.curve(&beam.slope));
        // All tones are multiples of the motion's fundamental frequency.
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
                    product: product.clone(),
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

    /// The usual total harmonic distortion: the amplitude outside the drive's frequency over that at it, both
    /// as root mean squares; infinite for a motion without the drive's frequency.
    pub fn distortion(&self) -> f64 {
        (self.thd / (1.0 - self.thd)).sqrt()
    }
}

/// The lag φ of `Re(c e^{iθ}) = |c| sin(θ − φ)`, degrees in (−180, 180].
pub fn lag(c: Complex) -> f64 {
    let degrees = -(c * Complex::new(0.0, 1.0)).argument().to_degrees();
    if degrees <= -180.0 {
        degrees + 360.0
    } else {
        degrees
    }
}
