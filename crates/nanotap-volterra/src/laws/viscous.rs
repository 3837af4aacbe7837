//! Dissipation added to any elastic law: viscosity that grows with the contact radius, and damping
//! that falls off across the gap.
//!
//! `−η √(Rδ) ḋ` in contact (Garcia, Gómez et al.; used by dForce) and `−γ₀ e^{−d/x} ḋ` at any
//! gap (Gotsmann, Seidel, Anczykowski, Fuchs, Phys. Rev. B 60, 1999).

use crate::law::Approach;
use crate::laws::elastic::contact_ways;
use crate::laws::entry::{CONTACT_DISTANCE, Dimension, Entry, RADIUS, Range, VISCOSITY, own};
use crate::laws::formula::{Formula, Way};
use nanotap_arithmetic::Scalar;

/// `−η √(Rδ) ḋ`.
#[derive(Clone, Copy, Debug)]
pub struct RootViscosity;

/// Its entry.
pub static ROOT_VISCOSITY: Entry = Entry {
    name: "viscous-contact",
    words: "viscous force proportional to the contact radius",
    formula: "−η √(Rδ) ḋ for δ = a0 − d > 0",
    source: "García, Gómez et al., Phys. Rev. Lett. 97, 016103 (2006)",
    parameters: &[VISCOSITY, RADIUS, CONTACT_DISTANCE],
    parts: &[],
    conservative: false,
};

impl Formula for RootViscosity {
    fn entry(&self) -> &'static Entry {
        &ROOT_VISCOSITY
    }

    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        vec![p[2], p[0] * p[1].sqrt()]
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, rate: S) -> S {
        if branch == 0 {
            return S::constant(0.0);
        }
        -c[1] * (c[0] - gap).sqrt() * rate
    }

    fn depends_on_rate(&self) -> bool {
        true
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        contact_ways(branch, Approach::Half)
    }

    fn vanishes(&self, branch: usize) -> bool {
        branch == 0
    }
}

/// `−γ₀ e^{−d/x} ḋ`.
#[derive(Clone, Copy, Debug)]
pub struct ExponentialDamping;

/// Its entry.
pub static EXPONENTIAL_DAMPING: Entry = Entry {
    name: "exponential-damping",
    words: "damping that decays with the gap",
    formula: "−γ₀ e^(−d/x) ḋ",
    source: "Gotsmann, Seidel, Anczykowski, Fuchs, Phys. Rev. B 60, 11051 (1999)",
    parameters: &[
        own(
            "damping",
            "damping γ₀ at zero gap",
            Dimension::DAMPING,
            None,
            Range::NotNegative,
        ),
        own(
            "decay_length",
            "decay length x",
            Dimension::LENGTH,
            None,
            Range::Positive,
        ),
    ],
    parts: &[],
    conservative: false,
};

impl Formula for ExponentialDamping {
    fn entry(&self) -> &'static Entry {
        &EXPONENTIAL_DAMPING
    }

    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        vec![p[0], -p[1].recip()]
    }

    fn branches(&self) -> usize {
        1
    }

    fn branch_at(&self, _c: &[f64], _gap: f64, _rate: f64) -> usize {
        0
    }

    fn force<S: Scalar>(&self, c: &[S], _branch: usize, gap: S, rate: S) -> S {
        -c[0] * (c[1] * gap).exp() * rate
    }

    fn depends_on_rate(&self) -> bool {
        true
    }

    fn ways(&self, _branch: usize) -> Vec<Way> {
        Vec::new()
    }
}
