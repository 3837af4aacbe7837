//! The standard linear solid: a spring α4 beside an arm of a spring k_m and a damper k_m τ_m
//! in series (Zener's model in Maxwell's form), as a surface that recovers by itself.
//!
//! With δ the indentation of the surface and w the elongation of the damper, the arm pushes
//! with q = k_m (δ − w) and ẇ = (δ − w)/τ_m, the whole with f = α4 δ + q. In contact
//! δ = −V_T. The free surface, f = 0, has δ = k_m w/(α4 + k_m) and recovers as
//! ẇ = −α4 w/((α4 + k_m) τ_m): slower than the force relaxes.
//!
//! The memory is `s = w`, which never jumps. The tip's height over the free surface is
//! g = V_T + k_m w/(α4 + k_m), and in contact f = −(α4 + k_m) g: force and gap vanish
//! together, and the field is continuous at the switch.
//!
//! Limits: τ_m → 0 leaves the spring α4 (relaxed), τ_m → ∞ the spring α4 + k_m
//! (instantaneous); k_m → ∞ at constant k_m τ_m is the Kelvin–Voigt surface of damper k_m τ_m.

use super::dual::Dual;
use super::law::{Answer, Combination, Law, Square};
use super::spring_damper;

/// The law.
pub(super) fn law(stiffness: Dual, arm: Dual, time: Dual) -> Law {
    let instantaneous = stiffness + arm;
    // An arm that relaxes at once is a damper of no size; with no spring at all there is
    // no surface to recover.
    if time.value <= 0.0 || instantaneous.value <= 0.0 {
        return spring_damper::without_memory(stiffness, arm * time);
    }
    let one = Dual::constant(1.0);
    let gap = Combination::height(one).plus(Combination::memory(arm / instantaneous));
    // The elongation of the arm's spring, δ − w.
    let free = Combination::memory(-stiffness / instantaneous);
    let held = Combination::height(-one).plus(Combination::memory(-one));
    let answer = |force, elongation: Combination, indentation| Answer {
        force,
        memory_rate: elongation.times(one / time),
        dissipated: vec![Square {
            weight: arm.value / time.value,
            of: elongation,
        }],
        stored: vec![
            Square {
                weight: 0.5 * stiffness.value,
                of: indentation,
            }
            .into(),
            Square {
                weight: 0.5 * arm.value,
                of: elongation,
            }
            .into(),
        ],
    };
    let recovered = Combination::memory(arm / instantaneous);
    Law {
        has_memory: true,
        gap,
        hold: gap.times(-one),
        left: None,
        onsets: None,
        flight: answer(Combination::default(), free, recovered),
        contact: answer(gap.times(-instantaneous), held, Combination::height(-one)),
        plain_contact: false,
    }
}
