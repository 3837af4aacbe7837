//! A contact law with several internal variables, through the table's interface.

use nanotap_dynamics::StroboscopicMap as _;

use super::*;
use crate::contact::ContactLaw;
use crate::model_map::ModelMap;

/// Two equal arms are one arm of double stiffness, and an arm without stiffness is none.
#[test]
fn two_arms_are_a_law_with_two_internal_variables() {
    let case = Cantilever {
        alpha6: 0.0,
        omega: 20.0,
        ..Cantilever::paper()
    };
    let model = |arms: &[[f64; 2]]| {
        let arms = arms.to_vec();
        let pair = case.clone().on(ContactLaw::GeneralisedMaxwell, &[1.0, 1.0]);
        Model::cantilever(&Cantilever { arms, ..pair }).unwrap()
    };
    let solid = ContactLaw::StandardLinearSolid;
    let single = Model::cantilever(&case.clone().on(solid, &[40.0, 0.05])).unwrap();
    let mut map = ModelMap::new(&single);
    for (arms, same) in [
        ([[0.05, 20.0], [0.05, 20.0]], true),
        ([[0.05, 40.0], [3.0, 0.0]], false),
    ] {
        let pair = model(&arms);
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
