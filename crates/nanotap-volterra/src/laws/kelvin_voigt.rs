//! Kelvin–Voigt: an elastic contact with viscosity in the same geometry.
//!
//! If the elastic law is `E g(δ)`, the force is `E g(δ) + η g'(δ) δ̇` (García, Gómez, Martínez,
//! Patil, Dietz, Magerle, Phys. Rev. Lett. 97, 2006; García, Chem. Soc. Rev. 49, 2020): for the
//! sphere `4/3 √(Rδ)/(1 − ν²) (Eδ + 3/2 ηδ̇)`, on a rigid tip. As `η` stands where `E` does it is the
//! elongational viscosity, `2(1 + ν)` times the shear viscosity; the law `η' √(Rδ) δ̇` has
//! `η' = 2η/(1 − ν²)`. On the way out the sum becomes
//! negative before the contact ends. A surface that cannot pull releases the tip where `F = 0`, and
//! then there is no force until the tip is outside or presses again; a surface that pulls stays
//! until `d = a0`.

use crate::law::{Approach, Remark};
use crate::laws::elastic::{Shape, deep};
use crate::laws::entry::{
    CONTACT_DISTANCE, Entry, HALF_ANGLE, MODULUS, POISSON, ParameterEntry, Part, RADIUS, VISCOSITY,
};
use crate::laws::formula::{Edge, Formula, Way};
use nanotap_arithmetic::Scalar;

/// Formula of Kelvin–Voigt contact; see the module.
#[derive(Clone, Copy, Debug)]
pub struct KelvinVoigt {
    /// Shape of the tip.
    pub shape: Shape,
    /// Whether the surface can pull the tip back.
    pub pulls: bool,
}

/// Viscosity in the place of Young's modulus, and therefore elongational.
const ELONGATIONAL: ParameterEntry = ParameterEntry {
    words: "elongational viscosity of the sample: 2(1 + ν) times the shear viscosity, and (1 − ν²)/2 \
            times García's η in η √(Rδ) dδ/dt under a sphere",
    ..VISCOSITY
};

const ROUND: &[ParameterEntry] = &[MODULUS, POISSON, ELONGATIONAL, RADIUS, CONTACT_DISTANCE];
const POINTED: &[ParameterEntry] = &[MODULUS, POISSON, ELONGATIONAL, HALF_ANGLE, CONTACT_DISTANCE];
const SOURCE: &str = "García et al., Phys. Rev. Lett. 97, 016103 (2006)";

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
        source: SOURCE,
        parameters,
        parts: &[Part::Elasticity],
        attracts: false,
        conservative: false,
    }
}

/// Table entry `voigt-sphere`: a sphere that is released where the force vanishes.
pub static SPHERE: Entry = entry(
    "voigt-sphere",
    "Kelvin–Voigt sample under a sphere; releases where the force vanishes",
    "4/3 √(Rδ)/(1 − ν²) (Eδ + 3/2 ηδ̇), never below zero",
    ROUND,
);
/// Table entry `voigt-sphere-pulling`: a sphere that the sample may pull until `d = a0`.
pub static SPHERE_PULLING: Entry = entry(
    "voigt-sphere-pulling",
    "Kelvin–Voigt sample under a sphere that may pull the tip until d = a0",
    "4/3 √(Rδ)/(1 − ν²) (Eδ + 3/2 ηδ̇)",
    ROUND,
);
/// Table entry `voigt-cone`: a cone that is released where the force vanishes.
pub static CONE: Entry = entry(
    "voigt-cone",
    "Kelvin–Voigt sample under a cone; releases where the force vanishes",
    "(2/π) tan θ/(1 − ν²) (Eδ² + 2ηδδ̇), never below zero",
    POINTED,
);
/// Table entry `voigt-cone-pulling`: a cone that the sample may pull until `d = a0`.
pub static CONE_PULLING: Entry = entry(
    "voigt-cone-pulling",
    "Kelvin–Voigt sample under a cone that may pull the tip until d = a0",
    "(2/π) tan θ/(1 − ν²) (Eδ² + 2ηδδ̇)",
    POINTED,
);
/// Table entry `voigt-punch`: a flat punch that is released where the force vanishes.
pub static PUNCH: Entry = entry(
    "voigt-punch",
    "Kelvin–Voigt sample under a flat cylinder; releases where the force vanishes",
    "2R/(1 − ν²) (Eδ + ηδ̇), never below zero",
    ROUND,
);
/// Table entry `voigt-punch-pulling`: a flat punch that the sample may pull until `d = a0`.
pub static PUNCH_PULLING: Entry = entry(
    "voigt-punch-pulling",
    "Kelvin–Voigt sample under a flat cylinder that may pull the tip until d = a0",
    "2R/(1 − ν²) (Eδ + ηδ̇)",
    ROUND,
);

impl KelvinVoigt {
    /// Returns `δ^{p−1}`, the slope of the elastic power without its factor `p`.
    fn slope<S: Scalar>(self, indentation: S) -> S {
        match self.shape {
            Shape::Sphere => indentation.sqrt(),
            Shape::Cone => indentation,
            Shape::Punch => S::constant(1.0),
        }
    }
}

impl Formula for KelvinVoigt {
    fn entry(&self) -> &'static Entry {
        match (self.shape, self.pulls) {
            (Shape::Sphere, false) => &SPHERE,
            (Shape::Sphere, true) => &SPHERE_PULLING,
            (Shape::Cone, false) => &CONE,
            (Shape::Cone, true) => &CONE_PULLING,
            (Shape::Punch, false) => &PUNCH,
            (Shape::Punch, true) => &PUNCH_PULLING,
        }
    }

    /// Computes `a0`, and the factors of `δ^{p−1} δ` and `δ^{p−1} δ̇`.
    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        let plane = (-p[1].square() + 1.0).recip();
        let factor = self.shape.factor(p[3]) * plane;
        vec![p[4], p[0] * factor, p[2] * factor * self.shape.exponent()]
    }

    fn branches(&self) -> usize {
        if self.pulls { 2 } else { 3 }
    }

    fn branch_at(&self, c: &[f64], gap: f64, rate: f64) -> usize {
        if gap >= c[0] {
            0
        } else if self.pulls || c[1] * (c[0] - gap) > c[2] * rate {
            1
        } else {
            2
        }
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, rate: S) -> S {
        if branch != 1 {
            return S::constant(0.0);
        }
        let delta = c[0] - gap;
        self.slope(delta) * (c[1] * delta - c[2] * rate)
    }

    fn depends_on_rate(&self) -> bool {
        true
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        let approach = match self.shape {
            Shape::Sphere => Approach::Half,
            Shape::Cone | Shape::Punch => Approach::Analytic,
        };
        let outside = Way::new(Edge::Rises(0), 0);
        match (branch, self.pulls) {
            (0, _) => vec![Way::new(Edge::Falls(0), 1).after(approach)],
            (1, true) => vec![outside.before(approach)],
            (1, false) => vec![outside.before(approach), Way::new(Edge::Own(0), 2)],
            _ => vec![outside, Way::new(Edge::Own(1), 1)],
        }
    }

    /// Returns the force without the power of `δ` that vanishes where contact begins.
    fn guard<S: Scalar>(&self, c: &[S], index: usize, gap: S, rate: S) -> S {
        let sum = c[1] * (c[0] - gap) - c[2] * rate;
        if index == 0 { sum } else { -sum }
    }

    /// Reports contact on branch 1 only: a released tip is free.
    fn touches(&self, branch: usize) -> bool {
        branch == 1
    }

    fn vanishes(&self, branch: usize) -> bool {
        branch != 1
    }

    fn remarks(&self, p: &[f64], least_gap: f64) -> Vec<Remark> {
        if self.shape == Shape::Cone {
            return Vec::new();
        }
        deep(p[3], p[4], least_gap)
    }
}
