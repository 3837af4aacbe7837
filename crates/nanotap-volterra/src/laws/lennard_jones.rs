//! Lennard-Jones interaction of a sphere with a flat half-space.
//!
//! `F = A₁R/(180 d⁸) − A₂R/(6 d²)`: the pair potential summed over sphere and half-space in
//! Derjaguin's approximation (Israelachvili, Intermolecular and Surface Forces; Basso,
//! Giarré, Dahleh, Mezić, ACC 1998).

use crate::laws::adhesion::HAMAKER;
use crate::laws::entry::{Entry, ParameterEntry, Part, RADIUS, Range, own, parameters};
use crate::laws::formula::{Formula, Way};
use nanotap_arithmetic::Scalar;
use nanotap_quantity::Kind;

/// Formula of the Lennard-Jones interaction of a sphere with a half-space; see the module.
#[derive(Clone, Copy, Debug)]
pub struct LennardJones;

parameters! {
    /// Constant of the repulsion, J m⁶.
    pub const REPULSION = own("repulsion", "constant A₁ of the repulsion", Kind::Repulsion, None,
        Range::NotNegative, "constant of the repulsion (lennard-jones)", 1e-78);
}

/// Table entry `lennard-jones`: a sphere above a flat sample.
pub static LENNARD_JONES: Entry = Entry {
    name: "lennard-jones",
    words: "Lennard-Jones interaction of a sphere with a flat sample",
    formula: "A₁R/(180 d⁸) − A₂R/(6 d²)",
    source: "J. N. Israelachvili, Intermolecular and Surface Forces",
    parameters: &[
        REPULSION,
        ParameterEntry {
            name: "attraction",
            words: "constant A₂ of the attraction (Hamaker)",
            range: Range::NotNegative,
            ..HAMAKER
        },
        RADIUS,
    ],
    parts: &[Part::Elasticity, Part::Adhesion],
    attracts: true,
    conservative: true,
};

impl Formula for LennardJones {
    fn entry(&self) -> &'static Entry {
        &LENNARD_JONES
    }

    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        vec![p[0] * p[2] * (1.0 / 180.0), p[1] * p[2] * (1.0 / 6.0)]
    }

    fn branches(&self) -> usize {
        1
    }

    fn branch_at(&self, _c: &[f64], _gap: f64, _rate: f64) -> usize {
        0
    }

    fn force<S: Scalar>(&self, c: &[S], _branch: usize, gap: S, _rate: S) -> S {
        let r2 = gap.square().recip();
        let r4 = r2.square();
        c[0] * r4.square() - c[1] * r2
    }

    fn ways(&self, _branch: usize) -> Vec<Way> {
        Vec::new()
    }

    fn pole(&self, _c: &[f64]) -> Option<f64> {
        Some(0.0)
    }

    fn energy(&self, c: &[f64], _branch: usize, gap: f64) -> Option<f64> {
        Some(c[0] / (7.0 * gap.powi(7)) - c[1] / gap)
    }
}
