//! Adhesion that costs more to undo than it gave: work of adhesion `w_a` on approach,
//! `w_r` on retraction.
//!
//! In contact `−2πR w` (Derjaguin's approximation of a sphere), `w = w_a` until the contact's
//! turning point, `w = w_r` from there until the contact ends. Which of the two holds is a
//! state, not the sign of the velocity: a tip that turns again before it has left stays on
//! `w_r`.

use crate::laws::adhesion::WORK_OF_ADHESION;
use crate::laws::entry::{
    CONTACT_DISTANCE, Entry, ParameterEntry, Part, RADIUS, Range, own, parameters,
};
use crate::laws::formula::{Edge, Formula, Way};
use nanotap_arithmetic::Scalar;
use nanotap_quantity::Kind;
use std::f64::consts::PI;

/// Formula of adhesion with hysteresis; see the module.
#[derive(Clone, Copy, Debug)]
pub struct AdhesionHysteresis;

parameters! {
    /// Work of adhesion on retraction, J/m².
    pub const WORK_OF_RETRACTION = own("work_of_retraction", "work of adhesion on retraction",
        Kind::SurfaceEnergy, None, Range::NotNegative,
        "work of adhesion on retraction (adhesion-hysteresis)", 0.03);
}

/// Table entry `adhesion-hysteresis`: constant adhesion, larger on retraction.
pub static ADHESION_HYSTERESIS: Entry = Entry {
    name: "adhesion-hysteresis",
    words: "constant adhesion in contact, larger on the way out",
    formula: "−2πR w_a until the contact's turning point, −2πR w_r from there to d = a0",
    source: "García, Gómez et al., Phys. Rev. Lett. 97, 016103 (2006)",
    parameters: &[
        ParameterEntry {
            words: "work of adhesion on approach",
            range: Range::NotNegative,
            ..WORK_OF_ADHESION
        },
        WORK_OF_RETRACTION,
        RADIUS,
        CONTACT_DISTANCE,
    ],
    parts: &[Part::Adhesion],
    attracts: true,
    conservative: false,
};

impl Formula for AdhesionHysteresis {
    fn entry(&self) -> &'static Entry {
        &ADHESION_HYSTERESIS
    }

    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        let girth = p[2] * (-2.0 * PI);
        vec![p[3], girth * p[0], girth * p[1]]
    }

    fn branches(&self) -> usize {
        3
    }

    fn branch_at(&self, c: &[f64], gap: f64, rate: f64) -> usize {
        match (gap < c[0], rate < 0.0) {
            (false, _) => 0,
            (true, true) => 1,
            (true, false) => 2,
        }
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, _gap: S, _rate: S) -> S {
        match branch {
            0 => S::constant(0.0),
            1 => c[1],
            _ => c[2],
        }
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        match branch {
            0 => vec![Way::new(Edge::Falls(0), 1)],
            1 => vec![Way::new(Edge::Turns, 2), Way::new(Edge::Rises(0), 0)],
            _ => vec![Way::new(Edge::Rises(0), 0)],
        }
    }

    fn remembers(&self) -> bool {
        true
    }

    fn vanishes(&self, branch: usize) -> bool {
        branch == 0
    }
}
