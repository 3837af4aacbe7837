//! Oscillatory solvation: layers of a liquid's molecules between tip and sample.
//!
//! `F₀ cos(2π(d − a0)/σ) e^{−(d − a0)/λ}` across the gap, `σ` about the diameter of a molecule (J. N.
//! Israelachvili, Intermolecular and Surface Forces, ch. 15). In contact (`d < a0`) the force is that
//! at `a0`.

use crate::law::Approach;
use crate::laws::elastic::contact_ways;
use crate::laws::entry::{CONTACT_DISTANCE, Entry, ParameterEntry, Range, own, parameters};
use crate::laws::formula::{Formula, Way};
use nanotap_arithmetic::Scalar;
use nanotap_quantity::Kind;
use std::f64::consts::TAU;

/// Formula of an oscillating solvation force; see the module.
#[derive(Clone, Copy, Debug)]
pub struct Solvation;

parameters! {
    /// Solvation force at contact, N.
    pub const SOLVATION_FORCE = own("solvation_force", "solvation force F0 at contact", Kind::Force, None,
        Range::Finite, "solvation force at contact (solvation)", 1e-9);
    /// Period of the solvation force, m.
    pub const SOLVATION_PERIOD = own("solvation_period", "period σ of the solvation force", Kind::Length,
        None, Range::Positive, "period of the solvation force (solvation)", 3e-10);
    /// Decay length of the solvation force, m.
    pub const SOLVATION_DECAY = own("solvation_decay", "decay length λ of the solvation force",
        Kind::Length, None, Range::Positive, "decay length of the solvation force (solvation)", 3e-10);
}

/// Table entry `solvation`: molecular layers of a liquid between tip and sample.
pub static SOLVATION: Entry = Entry {
    name: "solvation",
    words: "oscillating force of a liquid's molecular layers",
    formula: "F0 cos(2π(d − a0)/σ) e^(−(d − a0)/λ) for d > a0, F0 in contact",
    source: "J. N. Israelachvili, Intermolecular and Surface Forces, 3rd ed., ch. 15 (2011)",
    parameters: &[
        SOLVATION_FORCE,
        SOLVATION_PERIOD,
        SOLVATION_DECAY,
        CONTACT_DISTANCE,
    ],
    parts: &[],
    attracts: false,
    conservative: true,
};

impl Formula for Solvation {
    fn entry(&self) -> &'static Entry {
        &SOLVATION
    }

    /// Computes `a0`, `F₀`, `2π/σ` and `1/λ`, in this order.
    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        vec![p[3], p[0], p[1].recip() * TAU, p[2].recip()]
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, _rate: S) -> S {
        if branch == 1 {
            return c[1];
        }
        let x = gap - c[0];
        c[1] * (c[2] * x).sin_cos().1 * (-(c[3] * x)).exp()
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        contact_ways(branch, Approach::Analytic)
    }

    fn energy(&self, c: &[f64], branch: usize, gap: f64) -> Option<f64> {
        let x = gap - c[0];
        // ∫ F dx from x on.
        let beyond = |x: f64| {
            let (sin, cos) = nanotap_arithmetic::sin_cos(c[2] * x);
            let size = c[1] * nanotap_arithmetic::exp(-c[3] * x);
            size * (c[3] * cos - c[2] * sin) / (c[2] * c[2] + c[3] * c[3])
        };
        Some(if branch == 0 {
            beyond(x)
        } else {
            beyond(0.0) - c[1] * x
        })
    }
}
