//! The paper's sample: a spring α4 and a damper α6 that act where V_T ≤ 0.
//!
//! The force is −(α4 V_T + α6 V̇_T) until V_T = 0, so that the damper pulls on a tip that
//! leaves: an adhesion that nobody put in.

use super::dual::Dual;
use super::law::{Answer, Combination, Law, Square};

/// The law.
pub(super) fn law(stiffness: Dual, damping: Dual) -> Law {
    let one = Dual::constant(1.0);
    Law {
        has_memory: false,
        gap: Combination::height(one),
        hold: Combination::height(-one),
        left: None,
        onsets: None,
        flight: Answer::default(),
        contact: Answer {
            force: force(stiffness, damping),
            memory_rate: Combination::default(),
            dissipated: vec![Square {
                weight: damping.value,
                of: Combination::rate(one),
            }],
            stored: vec![
                Square {
                    weight: 0.5 * stiffness.value,
                    of: Combination::height(one),
                }
                .into(),
            ],
        },
        plain_contact: true,
    }
}

/// −(α4 V_T + α6 V̇_T).
pub(super) fn force(stiffness: Dual, damping: Dual) -> Combination {
    Combination::height(-stiffness).plus(Combination::rate(-damping))
}

/// The same sample with a memory that nothing depends on and that fades: what a surface
/// becomes that recovers at once.
pub(super) fn without_memory(stiffness: Dual, damping: Dual) -> Law {
    let fades = Combination::memory(Dual::constant(-1.0));
    let mut law = law(stiffness, damping);
    law.has_memory = true;
    law.flight.memory_rate = fades;
    law.contact.memory_rate = fades;
    law
}
