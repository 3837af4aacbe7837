//! Elastic contact of a thin incompressible sample bonded to a rigid support.
//!
//! Sphere `(16/9) E √R δ^{3/2} (1 + 1.133χ + 1.497χ² + 1.469χ³ + 0.755χ⁴)`, `χ = √(Rδ)/h`;
//! cone `(8/(3π)) E tan θ δ² (1 + 0.721χ + 0.650χ² + 0.491χ³ + 0.225χ⁴)`, `χ = δ tan θ/h`; flat
//! punch `(8/3) E a δ (1 + 1.133χ + 1.283χ² + 0.598χ³ − 0.291χ⁴)`, `χ = a/h` (García and García,
//! Biophys. J. 114, 2018; ν = ½). Under a sphere the series is too stiff by 0.3 % at `χ = 0.42`, 1 % at
//! 0.55, 5 % at 0.75 and 16 % at 1.02, against the exact [layer](super::layer): a motion that goes
//! farther than an error of 0.5 % is reported.

use crate::law::Remark;
use crate::laws::elastic::{Shape, contact_ways};
use crate::laws::entry::{
    CONTACT_DISTANCE, Entry, HALF_ANGLE, MODULUS, ParameterEntry, Part, RADIUS, THICKNESS,
};
use crate::laws::formula::{Formula, Way};
use nanotap_arithmetic::Scalar;
use std::f64::consts::PI;

/// Formula of a thin bonded sample under a tip of this shape; see the module.
#[derive(Clone, Copy, Debug)]
pub struct Thin(pub Shape);

const fn entry(
    name: &'static str,
    words: &'static str,
    formula: &'static str,
    parameters: &'static [ParameterEntry],
) -> Entry {
    Entry {
        name,
        words,
        formula,
        source: "P. D. García and R. García, Biophys. J. 114, 2923 (2018)",
        parameters,
        parts: &[Part::Elasticity],
        attracts: false,
        conservative: true,
    }
}

/// Table entry `thin-sphere`: a sphere on a thin incompressible sample.
pub static SPHERE: Entry = entry(
    "thin-sphere",
    "sphere on a thin incompressible sample",
    "(16/9) E √R δ^(3/2) (1 + 1.133χ + 1.497χ² + 1.469χ³ + 0.755χ⁴), χ = √(Rδ)/h",
    &[MODULUS, RADIUS, THICKNESS, CONTACT_DISTANCE],
);
/// Table entry `thin-cone`: a cone on a thin incompressible sample.
pub static CONE: Entry = entry(
    "thin-cone",
    "cone on a thin incompressible sample",
    "(8/(3π)) E tan θ δ² (1 + 0.721χ + 0.650χ² + 0.491χ³ + 0.225χ⁴), χ = δ tan θ/h",
    &[MODULUS, HALF_ANGLE, THICKNESS, CONTACT_DISTANCE],
);
/// Table entry `thin-punch`: a flat punch on a thin incompressible sample.
pub static PUNCH: Entry = entry(
    "thin-punch",
    "flat cylinder on a thin incompressible sample",
    "(8/3) E a δ (1 + 1.133χ + 1.283χ² + 0.598χ³ − 0.291χ⁴), χ = a/h",
    &[MODULUS, RADIUS, THICKNESS, CONTACT_DISTANCE],
);

const SPHERE_SERIES: [f64; 5] = [1.0, 1.133, 1.497, 1.469, 0.755];
const CONE_SERIES: [f64; 5] = [1.0, 0.721, 0.650, 0.491, 0.225];
const PUNCH_SERIES: [f64; 5] = [1.0, 1.133, 1.283, 0.598, -0.291];

fn series<S: Scalar>(coefficients: &[f64; 5], x: S) -> S {
    let mut sum = S::constant(coefficients[4]);
    for &c in coefficients[..4].iter().rev() {
        sum = sum * x + c;
    }
    sum
}

impl Thin {
    /// Returns the `χ` at which the error of the series is 0.5 %.
    const fn limit(self) -> f64 {
        match self.0 {
            Shape::Sphere => 0.463,
            Shape::Cone => 0.903,
            Shape::Punch => 0.476,
        }
    }

    /// Returns the force divided by that of a half-space.
    pub(crate) fn correction<S: Scalar>(self, ratio: S) -> S {
        let coefficients = match self.0 {
            Shape::Sphere => &SPHERE_SERIES,
            Shape::Cone => &CONE_SERIES,
            Shape::Punch => &PUNCH_SERIES,
        };
        series(coefficients, ratio)
    }

    /// Computes `a0`, the factor of `δ^p` on a half-space, and the scale of `χ`.
    pub(crate) fn half_space<S: Scalar>(self, p: &[S]) -> [S; 3] {
        let (modulus, size, thickness, contact) = (p[0], p[1], p[2], p[3]);
        let (stiffness, scale) = match self.0 {
            Shape::Sphere => (modulus * size.sqrt() * (16.0 / 9.0), size.sqrt()),
            Shape::Cone => (modulus * size.tan() * (8.0 / (3.0 * PI)), size.tan()),
            Shape::Punch => (modulus * size * (8.0 / 3.0), size),
        };
        [contact, stiffness, scale / thickness]
    }

    /// Returns the ratio `χ` at an indentation, dimensionless.
    pub(crate) fn ratio<S: Scalar>(self, scale: S, indentation: S) -> S {
        match self.0 {
            Shape::Sphere => indentation.sqrt() * scale,
            Shape::Cone => indentation * scale,
            Shape::Punch => scale,
        }
    }
}

impl Formula for Thin {
    fn entry(&self) -> &'static Entry {
        match self.0 {
            Shape::Sphere => &SPHERE,
            Shape::Cone => &CONE,
            Shape::Punch => &PUNCH,
        }
    }

    /// Computes `a0`, the factor of `δ^p`, and the scale of `χ`.
    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        let [contact, stiffness, scale] = self.half_space(p);
        let stiffness = match self.0 {
            Shape::Sphere | Shape::Cone => stiffness,
            Shape::Punch => stiffness * self.correction(scale),
        };
        vec![contact, stiffness, scale]
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, _rate: S) -> S {
        if branch == 0 {
            return S::constant(0.0);
        }
        let delta = c[0] - gap;
        let elastic = c[1] * self.0.power(delta);
        match self.0 {
            Shape::Sphere | Shape::Cone => elastic * self.correction(self.ratio(c[2], delta)),
            Shape::Punch => elastic,
        }
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        contact_ways(branch, self.0.approach())
    }

    fn energy(&self, c: &[f64], branch: usize, gap: f64) -> Option<f64> {
        if branch == 0 {
            return Some(0.0);
        }
        let delta = c[0] - gap;
        let (coefficients, step) = match self.0 {
            Shape::Sphere => (&SPHERE_SERIES, 0.5),
            Shape::Cone => (&CONE_SERIES, 1.0),
            Shape::Punch => return Some(0.5 * c[1] * delta * delta),
        };
        let ratio = self.ratio(c[2], delta);
        // ∫ δ^p χ^k with χ^k ∝ δ^{k step}.
        let sum: f64 = coefficients
            .iter()
            .enumerate()
            .map(|(k, a)| a * ratio.powi(k as i32) / (self.0.exponent() + 1.0 + step * k as f64))
            .sum();
        Some(c[1] * self.0.power(delta) * delta * sum)
    }

    fn vanishes(&self, branch: usize) -> bool {
        branch == 0
    }

    fn remarks(&self, p: &[f64], least_gap: f64) -> Vec<Remark> {
        let delta = p[3] - least_gap;
        if delta <= 0.0 {
            return Vec::new();
        }
        let c = self.constants(p);
        let value = self.ratio(c[2], delta);
        let limit = self.limit();
        if value > limit {
            vec![Remark {
                ratio: "χ",
                value,
                limit,
            }]
        } else {
            Vec::new()
        }
    }
}
