//! A spring and a damper in contact, the law that the piecewise-linear engine solves exactly.
//!
//! `F = k δ − c ḋ` for `δ = a0 − d > 0`; contact begins and ends at `d = a0`, where the damper
//! makes the force jump.

use crate::law::Approach;
use crate::laws::elastic::contact_ways;
use crate::laws::entry::{CONTACT_DISTANCE, CaseKey, Entry, Part, Range, stated_by};
use crate::laws::formula::{Formula, Way};
use nanotap_arithmetic::Scalar;
use nanotap_quantity::Kind;

/// Formula of a spring and a damper in contact; see the module.
#[derive(Clone, Copy, Debug)]
pub struct SpringDamper;

/// Table entry `spring-damper`: linear spring and damper in contact.
pub static SPRING_DAMPER: Entry = Entry {
    name: "spring-damper",
    words: "linear spring and damper in contact",
    formula: "k δ − c ḋ for δ = a0 − d > 0",
    source: "the piecewise-linear model",
    parameters: &[
        stated_by(
            "stiffness",
            "contact stiffness k",
            Kind::Stiffness,
            None,
            Range::NotNegative,
            CaseKey::Body("sample.stiffness"),
        ),
        stated_by(
            "damping",
            "contact damping c",
            Kind::Damping,
            Some(0.0),
            Range::NotNegative,
            CaseKey::Body("sample.damping"),
        ),
        CONTACT_DISTANCE,
    ],
    parts: &[Part::Elasticity],
    attracts: false,
    conservative: false,
};

impl Formula for SpringDamper {
    fn entry(&self) -> &'static Entry {
        &SPRING_DAMPER
    }

    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        vec![p[2], p[0], p[1]]
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, rate: S) -> S {
        if branch == 0 {
            return S::constant(0.0);
        }
        c[1] * (c[0] - gap) - c[2] * rate
    }

    fn depends_on_rate(&self) -> bool {
        true
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        contact_ways(branch, Approach::Analytic)
    }

    fn vanishes(&self, branch: usize) -> bool {
        branch == 0
    }
}
