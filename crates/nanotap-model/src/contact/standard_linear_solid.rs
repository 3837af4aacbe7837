//! The standard linear solid: a spring α4 parallel to an arm of a spring k_m and a damper k_m τ_m
//! in series (Zener's model in Maxwell's form), as a surface that recovers by itself.
//!
//! With δ the indentation of the surface and w the elongation of the damper, the arm pushes
//! with q = k_m (δ − w) and ẇ = (δ − w)/τ_m, the whole with f = α4 δ + q. In contact
//! δ = −V_T. The free surface, f = 0, has δ = k_m w/(α4 + k_m) and recovers as
//! ẇ = −α4 w/((α4 + k_m) τ_m): slower than the force relaxes.
//!
//! The internal variable is `s = w`, which never jumps. The tip's height over the free surface is
//! g = V_T + k_m w/(α4 + k_m), and in contact f = −(α4 + k_m) g: force and gap vanish
//! together, and the field is continuous at the switch.
//!
//! Limits: τ_m → 0 leaves the spring α4 (relaxed), τ_m → ∞ the spring α4 + k_m
//! (instantaneous); k_m → ∞ at constant k_m τ_m is the Kelvin–Voigt surface of damper k_m τ_m.

use super::entry::{Damper, Entry, any};
use super::generalised_maxwell;
use crate::parameter::{ParameterEntry, SampleKey, Unit};

pub(super) static ENTRY: Entry = Entry {
    name: "standard-linear-solid",
    meaning: "spring in parallel with a relaxing arm, as a surface that recovers",
    formula: "−K1 h + Fm, Fm + τm dFm/dt = −km τm dh/dt, while this pushes, then none",
    damper: Damper::InArm {
        not_alpha6: "must be 0 with contact = \"standard-linear-solid\", whose damper is its \
                     arm's: relaxation_stiffness times relaxation_time",
        not_damping: "a standard linear solid has its damper in the relaxing arm: give \
                      sample.relaxation_stiffness and sample.relaxation_time",
        arm: Some(|own| [own[0], own[0] * own[1]]),
    },
    numbers: &[
        ParameterEntry::new("relaxation_stiffness", "kₘ", "stiffness of the relaxing arm over bending stiffness, km·L³/(EI)")
            .such_as(20.0).always_written()
            .of(Unit::Stiffness, "stiffness of the relaxing arm km", "km L^3/(EI) = 3 km/k")
            .stated_by(SampleKey::Own { meaning: "stiffness of a standard linear solid's relaxing arm", zero: true, example: 1.0 }),
        ParameterEntry::new("relaxation_time", "τₘ", "time in which the arm's force decays, over √(mL⁴/(EI))")
            .such_as(0.1).always_written()
            .of(Unit::Time, "relaxation time of the arm", "time/T")
            .stated_by(SampleKey::Own { meaning: "time in which the arm's force decays", zero: true, example: 1e-6 }),
    ],
    needs: "a standard linear solid has a relaxing arm of this stiffness, as in \
            relaxation_stiffness = \"50 N/m\", and time, as in relaxation_time = \"0.5 us\"",
    arms: false,
    attracts: false,
    objection: any,
    like: Some(|arm, damper| vec![arm, damper / arm]),
    law: |numbers| generalised_maxwell::law(numbers.stiffness, &[[numbers.own[0], numbers.own[1]]]),
};
