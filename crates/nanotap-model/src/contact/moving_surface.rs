//! A moving surface with adhesion (Thorén, Haviland and others: the sample of intermodulation
//! AFM): the surface has its own height s, spring k_s and damper η_s, and the tip
//! touches it through the spring α4, the damper α6 and a constant adhesion F.
//!
//! With g = V_T − s the tip's height over the surface, in contact (g < 0)
//!
//! `f = −F − α4 g − α6 ġ`, `η_s ṡ + k_s s = −f`, so that
//! `(η_s + α6) ṡ = F + α4 V_T + α6 V̇_T − (α4 + k_s) s`,
//!
//! and in flight f = 0 and η_s ṡ + k_s s = 0. Contact begins and ends where g = 0; s is the
//! internal variable, which never jumps. The force does, and with it ṡ and the gap's rate: of ġ⁻
//! in flight and ġ⁺ in contact at the same state
//!
//! `(η_s + α6) ġ⁺ = η_s ġ⁻ − F`.
//!
//! So a tip that meets the surface is pulled in (ġ⁻ ≤ 0 makes ġ⁺ < 0), and one that is released is
//! left behind at once (ġ⁺ ≥ 0 makes ġ⁻ > 0, at least F/η_s): no motion slides along g = 0, and no
//! switch is followed at once by the next. States with g = 0 and 0 < ġ⁻ < F/η_s could go on
//! either way; no motion arrives at one, and a start there is in flight, since contact is g < 0.
//! A touch that only grazes is pulled in by a force that does not begin at zero: the map has a
//! square root there, and an orbit does not survive its grazing.
//!
//! The energy stored in contact is ½ α4 g² + F g in addition to the surface's ½ k_s s². The
//! adhesion takes on the way out the energy that it gives on the way in, and all energy is lost in
//! the two dampers.

use super::dual::Dual;
use super::entry::{Damper, Entry};
use super::law::{Bilinear, Law, LinearForm, SampleResponse};
use crate::parameter::{ParameterEntry, SampleKey, Unit};

pub(super) static ENTRY: Entry = Entry {
    name: "moving-surface",
    meaning: "spring, damper and adhesion to a surface that moves by itself",
    formula: "−Fad − K1 (h − s) − C1 d(h − s)/dt at heights h < s, none above; ηs ds/dt + ks s = −F",
    damper: Damper::Contact {
        none: "sample.damping is not given: only the surface's own motion dissipates",
    },
    numbers: &[
        ParameterEntry::new("surface_stiffness", "kₛ", "a moving surface's own stiffness over bending stiffness, ks·L³/(EI)")
            .such_as(10.0)
            .of(Unit::Stiffness, "the surface's own stiffness ks", "ks L^3/(EI) = 3 ks/k")
            .stated_by(SampleKey::Own { meaning: "a moving surface's own stiffness", zero: false, example: 1.0 }),
        ParameterEntry::new("surface_damping", "ηₛ", "a moving surface's own damping, (ηs/L)·√(L⁴/(m·EI))")
            .of(Unit::Damping, "the surface's own damping etas", "(etas/L) sqrt(L^4/(m EI)) = etas T/(m L)")
            .stated_by(SampleKey::Own { meaning: "a moving surface's own damping", zero: false, example: 1e-7 }),
        ParameterEntry::new("adhesion_force", "F", "force that pulls a touching tip to a moving surface, F·L³/(EI·g0)")
            .or(0.0)
            .of(Unit::Force, "adhesion force F", "F L^3/(EI g0) = 3 F/(k g0)")
            .stated_by(SampleKey::Shared),
    ],
    needs: "a moving surface needs its own spring and damper, as in \
            surface_stiffness = \"2 N/m\" and surface_damping = \"1e-6 N s/m\"",
    arms: false,
    attracts: true,
    objection,
    like: None,
    law: |numbers| {
        let own = numbers.own;
        law([numbers.stiffness, numbers.damping], [own[0], own[1], own[2]])
    },
};

/// Least damping η_s, and least ratio η_s/k_s, in model units: below it the surface recovers at
/// once.
const LEAST_DAMPING: f64 = 1e-15;

/// Stiffness and damping of the surface are needed, and it must not recover at once.
fn objection(own: &[f64], k: usize) -> Option<&'static str> {
    if k < 2 && own[k] == 0.0 {
        return Some(
            "must be above 0 with contact = \"moving-surface\": the surface has its own \
             spring and damper; without one of them, use \"kelvin-voigt\" or \"spring-damper\"",
        );
    }
    let too_fast = k == 1 && own[1] < LEAST_DAMPING * own[0].max(1.0);
    too_fast.then_some(
        "must be at least 1e-15, and that part of surface_stiffness: such a surface recovers at \
         once",
    )
}

/// Builds the equations from `[α4, α6]` and the surface's own `[k_s, η_s, F]`.
fn law(
    [stiffness, damping]: [Dual; 2],
    [own_stiffness, own_damping, adhesion]: [Dual; 3],
) -> Law {
    let one = Dual::constant(1.0);
    let position = |factor| LinearForm::internal(0, factor);
    let gap = LinearForm::height(one).plus(&position(-one));
    let recovers = position(-(own_stiffness / own_damping));
    let moves = LinearForm::constant(adhesion)
        .plus(&LinearForm::height(stiffness))
        .plus(&LinearForm::rate(damping))
        .plus(&position(-(stiffness + own_stiffness)))
        .times(one / (own_damping + damping));
    let gap_rate = LinearForm::rate(one).plus(&moves.times(-one));
    let of_surface = Bilinear::square(0.5 * own_stiffness.value, &position(one));
    Law {
        internal: 1,
        release_guard: gap.times(-one),
        release_reset: None,
        onsets: None,
        flight: SampleResponse {
            force: LinearForm::default(),
            dissipated: vec![Bilinear::square(own_damping.value, &recovers)],
            rates: vec![recovers],
            stored: vec![of_surface.clone()],
        },
        contact: SampleResponse {
            force: moves.times(-own_damping).plus(&position(-own_stiffness)),
            dissipated: vec![
                Bilinear::square(own_damping.value, &moves),
                Bilinear::square(damping.value, &gap_rate),
            ],
            rates: vec![moves],
            stored: vec![
                of_surface,
                Bilinear {
                    weight: 1.0,
                    other: gap
                        .times(0.5 * stiffness)
                        .plus(&LinearForm::constant(adhesion)),
                    one: gap.clone(),
                },
            ],
        },
        gap,
        plain_contact: false,
    }
}
