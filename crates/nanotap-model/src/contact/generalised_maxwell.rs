//! The generalised Maxwell model: a spring α4 parallel to n arms, each a spring k_i and a damper
//! k_i τ_i in series, as a surface that recovers by itself. With one arm it is the standard linear
//! solid.
//!
//! With δ the indentation of the surface and w_i the elongation of a damper, an arm pushes with
//! q_i = k_i (δ − w_i) and ẇ_i = (δ − w_i)/τ_i, the whole with f = α4 δ + Σ q_i. In contact
//! δ = −V_T. The free surface, f = 0, has δ = Σ k_i w_i/K, K = α4 + Σ k_i.
//!
//! The internal variables are the w_i, which never jump. The tip's height over the free surface is
//! g = V_T + Σ k_i w_i/K, and in contact f = −K g: force and gap vanish together, and the field is
//! continuous at the switch. The same sample under a flat punch is `prony-punch`.

use super::dual::Dual;
use super::entry::{Damper, Entry, any};
use super::law::{Bilinear, Law, LinearForm, SampleResponse};
use super::spring_damper;
use crate::parameter::{ParameterEntry, SampleKey, Unit};

/// Largest number of arms: sums of so many numbers keep within the rounding that proofs allow.
pub(crate) const MAX_ARMS: usize = 12;

pub(super) static ENTRY: Entry = Entry {
    name: "generalised-maxwell",
    meaning: "spring in parallel with any number of relaxing arms, as a surface that recovers",
    formula: "−K1 h + Σ Fi, Fi + τi dFi/dt = −ki τi dh/dt, while this pushes, then none",
    damper: Damper::InArm {
        not_alpha6: "must be 0 with contact = \"generalised-maxwell\", whose dampers are in its \
                     arms: relaxation_arms",
        not_damping: "a generalised Maxwell sample has its dampers in its arms: give \
                      sample.relaxation_arms",
        arm: None,
    },
    numbers: &[
        ParameterEntry::new("relaxation_stiffness_factor", "cₖ", "factor of the stiffness of all relaxing arms")
            .or(1.0)
            .of(Unit::Number, "factor of the stiffness of all arms", "as given")
            .stated_by(SampleKey::Own { meaning: "factor of the stiffness of all relaxation_arms", zero: true, example: 1.0 }),
        ParameterEntry::new("relaxation_time_factor", "cₜ", "factor of the times of all relaxing arms")
            .or(1.0)
            .of(Unit::Number, "factor of the times of all arms", "as given")
            .stated_by(SampleKey::Own { meaning: "factor of the times of all relaxation_arms", zero: false, example: 1.0 }),
    ],
    needs: "",
    arms: true,
    attracts: false,
    objection: any,
    like: None,
    law: |numbers| {
        let [by_stiffness, by_time] = [numbers.own[0], numbers.own[1]];
        let arms = numbers.arms.iter();
        let arms: Vec<[Dual; 2]> = arms
            .map(|[time, stiffness]| {
                [Dual::constant(*stiffness) * by_stiffness, Dual::constant(*time) * by_time]
            })
            .collect();
        law(numbers.stiffness, &arms)
    },
};

/// The law of a spring and arms, each a stiffness and a time.
pub(super) fn law(stiffness: Dual, arms: &[[Dual; 2]]) -> Law {
    let sum = |left_out: Option<usize>| {
        let others = arms.iter().enumerate().filter(|(i, _)| Some(*i) != left_out);
        others.fold(stiffness, |sum, (_, [k, _])| sum + *k)
    };
    let instantaneous = sum(None);
    // Arms that relax at once are a damper of no size; with no spring at all there is no surface to
    // recover.
    if arms.iter().any(|[_, time]| time.value <= 0.0) || instantaneous.value <= 0.0 {
        let damper = arms.iter().fold(Dual::default(), |sum, [k, time]| sum + *k * *time);
        return spring_damper::with_idle_variables(stiffness, damper, &vec![1.0; arms.len()]);
    }
    let one = Dual::constant(1.0);
    let parts = arms.iter().map(|[k, _]| *k / instantaneous);
    let recovered = LinearForm {
        internal: parts.collect(),
        ..LinearForm::default()
    };
    let gap = LinearForm::height(one).plus(&recovered);
    // The elongations of the arms' springs are δ − w_i.
    let free = |i: usize| {
        let mut spring = recovered.clone();
        spring.internal[i] = -(sum(Some(i)) / instantaneous);
        spring
    };
    let held = |i: usize| LinearForm::height(-one).plus(&LinearForm::internal(i, -one));
    let response = |force, spring: &dyn Fn(usize) -> LinearForm, indentation: &LinearForm| {
        let mut response = SampleResponse {
            force,
            stored: vec![Bilinear::square(0.5 * stiffness.value, indentation)],
            ..SampleResponse::default()
        };
        for (i, [k, time]) in arms.iter().enumerate() {
            let spring = spring(i);
            response.rates.push(spring.times(one / *time));
            let loss = Bilinear::square(k.value / time.value, &spring);
            response.dissipated.push(loss);
            response.stored.push(Bilinear::square(0.5 * k.value, &spring));
        }
        response
    };
    Law {
        internal: arms.len(),
        release_guard: gap.times(-one),
        release_reset: None,
        onsets: None,
        flight: response(LinearForm::default(), &free, &recovered),
        contact: response(
            gap.times(-instantaneous),
            &held,
            &LinearForm::height(-one),
        ),
        gap,
        plain_contact: false,
    }
}
