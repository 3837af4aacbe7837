//! A Kelvin–Voigt surface: a spring α4 beside a damper α6, with a position u of its own.
//!
//! In contact u = V_T, and the sample pushes with −(α4 V_T + α6 V̇_T), as the paper's does.
//! But it cannot pull: contact ends when that force is zero, at a tip still below the
//! undeformed surface. From there the surface recovers freely, α6 u̇ + α4 u = 0, until the
//! tip meets it again, V_T = u.
//!
//! The memory is `s = u` in flight. In contact, where u is known, `s` goes on recovering as
//! if nothing touched, and is set to V_T when contact ends: so both regimes have the same
//! simple eigenvalue −α4/α6, the gap V_T − s is one smooth function that is negative
//! throughout contact, and every state lies in one regime. With f the force, in either
//! regime
//!
//! `α6 ġ + α4 g = −(α4 V_T + α6 V̇_T)`, `g = V_T − s`,
//!
//! which is all that is needed to see that a contact begins with the force −α6 ġ, and ends
//! with gap and rate both zero and the gap's curvature −ḟ/α6 > 0. The force is continuous
//! where contact ends and begins in proportion to the speed: the map from period to period
//! is once continuously differentiable, through grazing too.
//!
//! Without damper the surface recovers at once and the law is the paper's.

use nanotap_flow::Onset;

use super::dual::Dual;
use super::law::{Answer, Combination, Law, Square};
use super::spring_damper;

/// A damper below this part of the spring holds the surface for less than any time that
/// counts.
const NO_DAMPER: f64 = 1e-30;

/// The law.
pub(super) fn law(stiffness: Dual, damping: Dual) -> Law {
    if damping.value <= NO_DAMPER * stiffness.value {
        return spring_damper::without_memory(stiffness, damping);
    }
    let one = Dual::constant(1.0);
    let recovery = stiffness / damping;
    let recovers = Combination::memory(-recovery);
    let force = spring_damper::force(stiffness, damping);
    let plain = spring_damper::law(stiffness, damping).contact;
    Law {
        has_memory: true,
        gap: Combination::height(one).plus(Combination::memory(-one)),
        hold: force,
        left: Some(Combination::height(one)),
        onsets: Some([
            Onset::Proportional {
                transition: 0,
                factor: -damping.value,
            },
            Onset::AtRest(0),
        ]),
        flight: Answer {
            force: Combination::default(),
            memory_rate: recovers,
            dissipated: vec![Square {
                weight: damping.value,
                of: recovers,
            }],
            stored: vec![
                Square {
                    weight: 0.5 * stiffness.value,
                    of: Combination::memory(one),
                }
                .into(),
            ],
        },
        contact: Answer {
            memory_rate: recovers,
            ..plain
        },
        plain_contact: true,
    }
}
