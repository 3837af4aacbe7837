//! A Kelvin–Voigt surface: a spring α4 parallel to a damper α6, with its own position u.
//!
//! In contact u = V_T, and the sample pushes with −(α4 V_T + α6 V̇_T), as the paper's does.
//! But it cannot pull: contact ends when that force is zero, at a tip still below the
//! undeformed surface. From there the surface recovers freely, α6 u̇ + α4 u = 0, until the
//! tip meets it again, V_T = u.
//!
//! The internal variable is `s = u` in flight. In contact, where u is known, `s` continues to
//! recover as if nothing touched, and is set to V_T when contact ends. Both regimes then have the
//! same simple eigenvalue −α4/α6, the gap V_T − s is one smooth function that is negative
//! throughout contact, and every state lies in one regime. With f the force, in either regime
//!
//! `α6 ġ + α4 g = −(α4 V_T + α6 V̇_T)`, `g = V_T − s`,
//!
//! so that a contact begins with the force −α6 ġ, and ends with gap and rate both zero and the
//! gap's curvature −ḟ/α6 > 0. The force is continuous where contact ends and begins in
//! proportion to the speed: the map from period to period is once continuously differentiable,
//! through grazing too.
//!
//! Without damper the surface recovers at once and the law is the paper's.

use nanotap_flow::Onset;

use super::dual::Dual;
use super::entry::{Damper, Entry, any};
use super::law::{Bilinear, Law, LinearForm, SampleResponse};
use super::spring_damper;

pub(super) static ENTRY: Entry = Entry {
    name: "kelvin-voigt",
    meaning: "spring and damper as a surface that recovers by itself",
    formula: "−(K1 h + C1 dh/dt) while this pushes, then none",
    damper: Damper::Contact {
        none: "sample.damping is not given: the contact dissipates nothing",
    },
    numbers: &[],
    needs: "",
    arms: false,
    attracts: false,
    objection: any,
    like: Some(|_, _| Vec::new()),
    law: |numbers| law(numbers.stiffness, numbers.damping),
};

/// Relaxation time α6/α4, in model units, up to which the surface recovers at once: the law is then
/// the one without a damper.
const NO_DAMPER: f64 = 1e-30;

/// Builds the equations of a surface with spring α4 and damper α6.
fn law(stiffness: Dual, damping: Dual) -> Law {
    if damping.value <= NO_DAMPER * stiffness.value {
        return spring_damper::with_idle_variables(stiffness, damping, &[1.0]);
    }
    let one = Dual::constant(1.0);
    let recovers = LinearForm::internal(0, -(stiffness / damping));
    let plain = spring_damper::law(stiffness, damping).contact;
    Law {
        internal: 1,
        gap: LinearForm::height(one).plus(&LinearForm::internal(0, -one)),
        release_guard: spring_damper::force(stiffness, damping),
        release_reset: Some(vec![LinearForm::height(one)]),
        onsets: Some([
            Onset::Proportional {
                transition: 0,
                factor: -damping.value,
            },
            Onset::AtRest(0),
        ]),
        flight: SampleResponse {
            force: LinearForm::default(),
            dissipated: vec![Bilinear::square(damping.value, &recovers)],
            stored: vec![Bilinear::square(
                0.5 * stiffness.value,
                &LinearForm::internal(0, one),
            )],
            rates: vec![recovers.clone()],
        },
        contact: SampleResponse {
            rates: vec![recovers],
            ..plain
        },
        plain_contact: true,
    }
}
