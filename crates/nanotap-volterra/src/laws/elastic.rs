//! Elastic contact of a half-space: Hertz's sphere, Sneddon's cone, the flat punch.
//!
//! `F = k δ^p`, `δ = a0 − d`: sphere `k = 4/3 E* √R`, `p = 3/2` (Hertz, J. reine angew. Math.
//! 92, 1881); cone `k = (2/π) E* tan θ`, `p = 2`, and flat punch `k = 2 E* R`, `p = 1`
//! (Sneddon, Int. J. Eng. Sci. 3, 1965). `1/E* = (1 − ν_s²)/E_s + (1 − ν_t²)/E_t`.

use crate::law::{Approach, Remark};
use crate::laws::entry::{
    CONTACT_DISTANCE, Entry, HALF_ANGLE, MODULUS, POISSON, ParameterEntry, Part, RADIUS,
    TIP_MODULUS, TIP_POISSON,
};
use crate::laws::formula::{Edge, Formula, Way};
use nanotap_arithmetic::Scalar;

/// The shape of the tip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A sphere, as a paraboloid of the same radius.
    Sphere,
    /// A cone, given by its half angle.
    Cone,
    /// A flat-ended cylinder, given by its radius.
    Punch,
}

impl Shape {
    /// Returns `δ^p` of this shape's elastic law.
    pub(crate) fn power<S: Scalar>(self, indentation: S) -> S {
        match self {
            Self::Sphere => indentation * indentation.sqrt(),
            Self::Cone => indentation * indentation,
            Self::Punch => indentation,
        }
    }

    /// Returns the exponent `p` of the indentation in `F = k δ^p`.
    pub(crate) const fn exponent(self) -> f64 {
        match self {
            Self::Sphere => 1.5,
            Self::Cone => 2.0,
            Self::Punch => 1.0,
        }
    }

    /// Returns how `δ^p` behaves at the end of the contact.
    pub(crate) const fn approach(self) -> Approach {
        match self {
            Self::Sphere => Approach::ThreeHalves,
            Self::Cone | Self::Punch => Approach::Analytic,
        }
    }

    /// Returns `k/E*` from the radius or the half angle.
    pub(crate) fn factor<S: Scalar>(self, size: S) -> S {
        match self {
            Self::Sphere => size.sqrt() * (4.0 / 3.0),
            Self::Cone => size.tan() * std::f64::consts::FRAC_2_PI,
            Self::Punch => size * 2.0,
        }
    }
}

/// Computes the reduced modulus `1/((1 − ν_s²)/E_s + (1 − ν_t²)/E_t)`.
pub(crate) fn reduced_modulus<S: Scalar>(p: &[S]) -> S {
    let compliance = |modulus: S, poisson: S| (-poisson.square() + 1.0) * modulus.recip();
    (compliance(p[0], p[1]) + compliance(p[2], p[3])).recip()
}

/// Remarks that `δ/R` exceeds 1, if it does at the least gap.
pub(crate) fn deep(radius: f64, contact: f64, least_gap: f64) -> Vec<Remark> {
    let ratio = (contact - least_gap) / radius;
    if ratio > 1.0 {
        vec![Remark {
            ratio: "δ/R",
            value: ratio,
            limit: 1.0,
        }]
    } else {
        Vec::new()
    }
}

/// Formula of elastic contact of a half-space with a tip of this shape; see the module.
#[derive(Clone, Copy, Debug)]
pub struct Elastic(pub Shape);

const ROUND: &[ParameterEntry] = &[
    MODULUS,
    POISSON,
    TIP_MODULUS,
    TIP_POISSON,
    RADIUS,
    CONTACT_DISTANCE,
];

/// Table entry `hertz`: a sphere on an elastic half-space.
pub static HERTZ: Entry = Entry {
    name: "hertz",
    words: "elastic sphere on a flat sample",
    formula: "4/3 E* √R δ^(3/2) for δ = a0 − d > 0",
    source: "H. Hertz, J. reine angew. Math. 92, 156 (1881)",
    parameters: ROUND,
    parts: &[Part::Elasticity],
    attracts: false,
    conservative: true,
};

/// Table entry `cone`: Sneddon's cone on an elastic half-space.
pub static CONE: Entry = Entry {
    name: "cone",
    words: "conical tip on an elastic sample",
    formula: "(2/π) E* tan θ δ² for δ = a0 − d > 0",
    source: "I. N. Sneddon, Int. J. Eng. Sci. 3, 47 (1965)",
    parameters: &[
        MODULUS,
        POISSON,
        TIP_MODULUS,
        TIP_POISSON,
        HALF_ANGLE,
        CONTACT_DISTANCE,
    ],
    parts: &[Part::Elasticity],
    attracts: false,
    conservative: true,
};

/// Table entry `punch`: a flat cylinder on an elastic half-space.
pub static PUNCH: Entry = Entry {
    name: "punch",
    words: "flat cylindrical tip on an elastic sample",
    formula: "2 E* R δ for δ = a0 − d > 0",
    source: "I. N. Sneddon, Int. J. Eng. Sci. 3, 47 (1965)",
    parameters: ROUND,
    parts: &[Part::Elasticity],
    attracts: false,
    conservative: true,
};

impl Formula for Elastic {
    fn entry(&self) -> &'static Entry {
        match self.0 {
            Shape::Sphere => &HERTZ,
            Shape::Cone => &CONE,
            Shape::Punch => &PUNCH,
        }
    }

    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        vec![p[5], reduced_modulus(p) * self.0.factor(p[4])]
    }

    #[inline]
    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, _rate: S) -> S {
        if branch == 0 {
            return S::constant(0.0);
        }
        c[1] * self.0.power(c[0] - gap)
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        contact_ways(branch, self.0.approach())
    }

    fn energy(&self, c: &[f64], branch: usize, gap: f64) -> Option<f64> {
        let delta = c[0] - gap;
        Some(if branch == 0 {
            0.0
        } else {
            c[1] * self.0.power(delta) * delta / (self.0.exponent() + 1.0)
        })
    }

    fn vanishes(&self, branch: usize) -> bool {
        branch == 0
    }

    fn remarks(&self, p: &[f64], least_gap: f64) -> Vec<Remark> {
        if self.0 == Shape::Cone {
            return Vec::new();
        }
        deep(p[4], p[5], least_gap)
    }
}

/// Returns the exits of a law with branch 0 away and branch 1 in contact; contact begins and ends
/// at constant 0.
pub(crate) fn contact_ways(branch: usize, approach: Approach) -> Vec<Way> {
    if branch == 0 {
        vec![Way::new(Edge::Falls(0), 1).after(approach)]
    } else {
        vec![Way::new(Edge::Rises(0), 0).before(approach)]
    }
}
