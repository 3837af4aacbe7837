//! A contact law with several internal variables, through the table's interface.

use nanotap_dynamics::StroboscopicMap as _;

use super::*;
use crate::model::contact::dual::Dual;
use crate::model::contact::entry::{Damper, Entry, Numbers, any};
use crate::model::contact::law::{Bilinear, LinearForm, SampleResponse};
use crate::model::model_map::ModelMap;
use crate::model::parameter::{ParameterEntry, SampleKey, Unit};

/// A number of a relaxing arm.
const fn arm(name: &'static str, unit: Unit) -> ParameterEntry {
    let key = SampleKey::Own {
        meaning: "number of an arm",
        zero: true,
    };
    ParameterEntry::new(name, name, "number of an arm")
        .of(unit, name, name)
        .stated_by(key)
}

/// A generalised Maxwell sample of two arms, as a file of the table would declare it.
static TWO_ARMS: Entry = Entry {
    name: "two-arms",
    meaning: "spring parallel to two relaxing arms",
    formula: "",
    damper: Damper::InArm {
        not_alpha6: "",
        not_damping: "",
        arm: |own| [own[0], own[0] * own[1]],
    },
    numbers: &[
        arm("stiffness1", Unit::Stiffness),
        arm("time1", Unit::Time),
        arm("stiffness2", Unit::Stiffness),
        arm("time2", Unit::Time),
    ],
    needs: "",
    attracts: false,
    objection: any,
    like: None,
    law: maxwell,
};

/// Spring and arms [stiffness, time]: with w_k the elongation of a damper, in contact
/// ẇ_k = (−V_T − w_k)/τ_k, and the whole pushes with −K (V_T + Σ k_k w_k/K).
fn maxwell(numbers: Numbers<'_>) -> Law {
    let one = Dual::constant(1.0);
    let arms: Vec<[Dual; 2]> = numbers.own.chunks(2).map(|arm| [arm[0], arm[1]]).collect();
    let all = arms.iter().fold(numbers.stiffness, |sum, [k, _]| sum + *k);
    let elongations = arms
        .iter()
        .enumerate()
        .map(|(i, [k, _])| LinearForm::internal(i, *k / all));
    let recovered = elongations.fold(LinearForm::default(), |sum, of| sum.plus(&of));
    let response = |force, indentation: &LinearForm| {
        let springs = arms.iter().enumerate().map(|(i, [k, time])| {
            let spring = indentation.plus(&LinearForm::internal(i, -one));
            (spring, *k, *time)
        });
        let springs: Vec<_> = springs.collect();
        let energy =
            |(spring, k, _): &(LinearForm, Dual, Dual)| Bilinear::square(0.5 * k.value, spring);
        SampleResponse {
            force,
            rates: springs
                .iter()
                .map(|(of, _, time)| of.times(one / *time))
                .collect(),
            dissipated: springs
                .iter()
                .map(|(of, k, time)| Bilinear::square(k.value / time.value, of))
                .collect(),
            stored: springs.iter().map(energy).collect(),
        }
    };
    let gap = LinearForm::height(one).plus(&recovered);
    Law {
        internal: arms.len(),
        release_guard: gap.times(-one),
        release_reset: None,
        onsets: None,
        flight: response(LinearForm::default(), &recovered),
        contact: response(gap.times(-all), &LinearForm::height(-one)),
        gap,
        plain_contact: false,
    }
}

/// Two equal arms are one arm of double stiffness, and an arm without stiffness is none.
#[test]
fn a_law_with_two_internal_variables_is_one_entry() {
    let case = Cantilever {
        alpha6: 0.0,
        omega: 20.0,
        ..Cantilever::paper()
    };
    let model = |own: &[f64]| {
        let own: Vec<Dual> = own.iter().map(|&number| Dual::constant(number)).collect();
        let stiffness = Dual::constant(case.alpha4);
        let law = (TWO_ARMS.law)(Numbers {
            stiffness,
            damping: Dual::constant(0.0),
            own: &own,
        });
        let galerkin = Galerkin::new(&case).unwrap();
        Model::on(&law, galerkin, &drive_of(&case).unwrap(), None).unwrap()
    };
    let solid = crate::model::contact::ContactLaw::StandardLinearSolid;
    let single = Model::cantilever(&case.clone().on(solid, &[40.0, 0.05])).unwrap();
    let mut map = ModelMap::new(&single);
    for (numbers, same) in [
        ([20.0, 0.05, 20.0, 0.05], true),
        ([40.0, 0.05, 0.0, 3.0], false),
    ] {
        let pair = model(&numbers);
        assert_eq!((pair.memory, pair.dimension()), (2, 8));
        let mut both = ModelMap::new(&pair);
        let mut expected = vec![0.05, 0.0, 0.0, -0.5, 0.0, 0.0, 0.02];
        let mut state = [&expected[..], &[expected[6]]].concat();
        for _ in 0..6 {
            map.advance(&mut expected).unwrap();
            both.advance(&mut state).unwrap();
            for (found, expected) in state.iter().zip(&expected) {
                assert!((found - expected).abs() < 1e-11, "{state:?} {expected:?}");
            }
            assert!(!same || (state[7] - expected[6]).abs() < 1e-11);
        }
    }
}
