//! The paper's sample: a spring α4 and a damper α6 that act where V_T ≤ 0.
//!
//! The force is −(α4 V_T + α6 V̇_T) until V_T = 0, so that the damper pulls on a tip that
//! leaves: an adhesion that is an artefact of the law.

use super::dual::Dual;
use super::entry::{Damper, Entry, any};
use super::law::{Bilinear, Law, LinearForm, SampleResponse};

pub(super) static ENTRY: Entry = Entry {
    name: "spring-damper",
    meaning: "spring and damper where the tip is below the surface",
    formula: "−(K1 h + C1 dh/dt) at heights h < 0, none above",
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

/// Builds the equations of a spring α4 and a damper α6 that act where V_T ≤ 0.
pub(super) fn law(stiffness: Dual, damping: Dual) -> Law {
    let one = Dual::constant(1.0);
    Law {
        internal: 0,
        gap: LinearForm::height(one),
        release_guard: LinearForm::height(-one),
        release_reset: None,
        onsets: None,
        flight: SampleResponse::default(),
        contact: SampleResponse {
            force: force(stiffness, damping),
            rates: Vec::new(),
            dissipated: vec![Bilinear::square(damping.value, &LinearForm::rate(one))],
            stored: vec![Bilinear::square(
                0.5 * stiffness.value,
                &LinearForm::height(one),
            )],
        },
        plain_contact: true,
    }
}

/// −(α4 V_T + α6 V̇_T).
pub(super) fn force(stiffness: Dual, damping: Dual) -> LinearForm {
    LinearForm::height(-stiffness).plus(&LinearForm::rate(-damping))
}

/// The same sample with internal variables that decay at these rates and affect nothing: the limit
/// of a surface that recovers at once.
pub(super) fn with_idle_variables(stiffness: Dual, damping: Dual, rates: &[f64]) -> Law {
    let decays = rates.iter().enumerate();
    let rates: Vec<LinearForm> = decays
        .map(|(k, rate)| LinearForm::internal(k, Dual::constant(-rate)))
        .collect();
    let mut law = law(stiffness, damping);
    law.internal = rates.len();
    law.flight.rates.clone_from(&rates);
    law.contact.rates = rates;
    law
}
