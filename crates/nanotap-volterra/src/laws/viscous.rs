//! Dissipation added to any elastic law: viscosity that grows with the contact radius, and damping
//! that falls off across the gap.
//!
//! `−η √(Rδ) ḋ` in contact (Garcia, Gómez et al.; used by dForce), `−γ₀ e^{−d/x} ḋ` at any gap
//! (Gotsmann, Seidel, Anczykowski, Fuchs, Phys. Rev. B 60, 1999), and a power of the gap,
//! `−γ (d₀/(d − a0 + d₀))ⁿ ḋ`, in contact `−γ ḋ`: non-contact friction falls like a power 1.3 to 3
//! (Stipe et al., Phys. Rev. Lett. 87, 2001), a squeezed film like the third below a disk and like the
//! first below a sphere.

use crate::law::{Approach, Remark};
use crate::laws::elastic::contact_ways;
use crate::laws::entry::{
    CONTACT_DISTANCE, CaseKey, Entry, ParameterEntry, RADIUS, Range, VISCOSITY, own, parameters,
    stated_by,
};
use crate::laws::formula::{Formula, Way};
use nanotap_arithmetic::Scalar;
use nanotap_quantity::Kind;

/// Formula `−η √(Rδ) ḋ` of a viscosity in contact; see the module.
#[derive(Clone, Copy, Debug)]
pub struct RootViscosity;

/// Table entry `viscous-contact`: a viscous force in proportion to the contact radius.
pub static ROOT_VISCOSITY: Entry = Entry {
    name: "viscous-contact",
    words: "viscous force proportional to the contact radius",
    formula: "−η √(Rδ) ḋ for δ = a0 − d > 0",
    source: "García, Gómez et al., Phys. Rev. Lett. 97, 016103 (2006)",
    parameters: &[VISCOSITY, RADIUS, CONTACT_DISTANCE],
    parts: &[],
    attracts: false,
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

/// Depth below zero gap, in decay lengths, from which exponential damping is out of range: there it
/// is twenty times that at zero gap.
const DEEPEST: f64 = 3.0;

/// Formula `−γ₀ e^{−d/x} ḋ` of a damping that decays with the gap; see the module.
#[derive(Clone, Copy, Debug)]
pub struct ExponentialDamping;

parameters! {
    /// Distance in which the damping decays, m.
    pub const DECAY_LENGTH = own("decay_length", "decay length x", Kind::Length, None, Range::Positive,
        "distance in which exponential damping decays", 5e-10);
}

/// Table entry `exponential-damping`: damping that decays exponentially with the gap.
pub static EXPONENTIAL_DAMPING: Entry = Entry {
    name: "exponential-damping",
    words: "damping that decays with the gap",
    formula: "−γ₀ e^(−d/x) ḋ",
    source: "Gotsmann, Seidel, Anczykowski, Fuchs, Phys. Rev. B 60, 11051 (1999)",
    parameters: &[
        stated_by(
            "damping",
            "damping γ₀ at zero gap",
            Kind::Damping,
            None,
            Range::NotNegative,
            CaseKey::Body("sample.damping"),
        ),
        DECAY_LENGTH,
    ],
    parts: &[],
    attracts: false,
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

    /// Remarks a contact so deep that the damping, which is derived for a gap, has no meaning.
    fn remarks(&self, p: &[f64], least_gap: f64) -> Vec<Remark> {
        let value = -least_gap / p[1];
        let deep = value > DEEPEST;
        let remark = Remark {
            ratio: "−d/decay_length",
            value,
            limit: DEEPEST,
        };
        deep.then_some(remark).into_iter().collect()
    }
}

/// Formula `−γ (d₀/(d − a0 + d₀))ⁿ ḋ` of a damping that falls like a power; see the module.
#[derive(Clone, Copy, Debug)]
pub struct PowerDamping;

parameters! {
    /// Distance over which the damping falls, m.
    pub const DAMPING_DISTANCE = own("damping_distance", "distance d0 over which the damping falls",
        Kind::Length, None, Range::Positive,
        "distance over which damping falls as a power of the gap (power-damping)", 1e-9);
    /// Power by which the damping falls, dimensionless.
    pub const DAMPING_EXPONENT = own("damping_exponent", "power n by which the damping falls", Kind::Number,
        None, Range::NotNegative, "power by which damping falls with the gap (power-damping)", 3.0);
}

/// Table entry `power-damping`: damping that falls like a power of the gap.
pub static POWER_DAMPING: Entry = Entry {
    name: "power-damping",
    words: "damping that falls like a power of the gap",
    formula: "−γ (d0/(d − a0 + d0))^n ḋ for d > a0, −γ ḋ in contact",
    source: "B. C. Stipe et al., Phys. Rev. Lett. 87, 096801 (2001)",
    parameters: &[
        stated_by(
            "damping",
            "damping γ at contact",
            Kind::Damping,
            None,
            Range::NotNegative,
            CaseKey::Body("sample.damping"),
        ),
        DAMPING_DISTANCE,
        DAMPING_EXPONENT,
        CONTACT_DISTANCE,
    ],
    parts: &[],
    attracts: false,
    conservative: false,
};

impl Formula for PowerDamping {
    fn entry(&self) -> &'static Entry {
        &POWER_DAMPING
    }

    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        vec![p[3], p[0], p[1], p[2]]
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, rate: S) -> S {
        if branch == 1 {
            return -c[1] * rate;
        }
        let ratio = c[2] / (gap - c[0] + c[2]);
        let value = ratio.value();
        let log = ratio.chain(nanotap_arithmetic::ln(value), value.recip());
        -c[1] * (c[3] * log).exp() * rate
    }

    fn depends_on_rate(&self) -> bool {
        true
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        contact_ways(branch, Approach::Analytic)
    }

    /// Returns `a0 − d0`, which lies in contact.
    fn pole(&self, c: &[f64]) -> Option<f64> {
        Some(c[0] - c[2])
    }
}
