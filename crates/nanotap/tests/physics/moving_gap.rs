//! A moved gap against the model of the case at that gap.

use nanotap::case::{Case, MovingGap};
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap::model::model_map::ModelMap;
use nanotap::model::oscillator::{Oscillator, Stop};
use nanotap::observe::{ObservableSet, measure};
use nanotap_dynamics::StroboscopicMap as _;

/// Every contact law, a nonlinear law, and both stops.
fn cases() -> Vec<Case> {
    let paper = Cantilever::paper();
    let mut cases: Vec<Case> = ContactLaw::ALL
        .into_iter()
        .map(|law| {
            let numbers: &[f64] = match law.entry().numbers.len() {
                0 => &[],
                2 => &[40.0, 0.05],
                _ => &[60.0, 8.0, 0.4],
            };
            let alpha6 = if law.has_damper() { 0.2 } else { 0.0 };
            let case = Cantilever {
                alpha6,
                ..paper.clone()
            };
            let mut case = case.on(law, numbers);
            if law.entry().arms {
                case.arms = vec![[1.0, 0.5], [8.0, 0.2]];
            }
            Case::from(case)
        })
        .collect();
    for stop in [
        Stop::Soft {
            stiffness: 20.0,
            damping: 0.2,
        },
        Stop::Rigid { restitution: 0.8 },
    ] {
        cases.push(Case::from(Oscillator {
            mass: 1.0,
            stiffness: 1.0,
            damping: 0.1,
            forcing: 1.0,
            omega: 2.5,
            gap: 0.1,
            stop,
        }));
    }
    let words = [
        "cantilever.k=2 N/m",
        "cantilever.f0=70 kHz",
        "cantilever.Q=200",
        "tip.radius=10 nm",
        "sample.law=dmt",
        "sample.modulus=1 GPa",
        "sample.hamaker=1e-19 J",
        "drive.frequency=70 kHz",
        "drive.free_amplitude=10 nm",
        "gap.tip=1 nm",
    ];
    cases.push(Case::parse(None, &words.map(str::to_owned)).unwrap());
    cases
}

/// A moved gap is the model of the case at that gap: motions, outputs and energies.
#[test]
fn a_moved_gap_is_that_of_a_new_model() {
    for case in cases() {
        let start = case.get(case.gap_key());
        let mut moving = MovingGap::new(&case).unwrap();
        let mut state = moving.model().unwrap().rest();
        let other = state.clone();
        let mut contacts = 0.0;
        for k in 0..12 {
            let gap = start * (1.0 - 0.03 * f64::from(k)) + 1e-3 * f64::from(k % 3);
            let fresh = case.with(case.gap_key(), gap).model().unwrap();
            let mut expected = state.clone();
            ModelMap::new(&fresh).advance(&mut expected).unwrap();
            moving.set(gap).unwrap();
            let here = moving.model().unwrap();
            let [seen, known] =
                [here, &fresh].map(|model| measure(model, &state, 1, ObservableSet::ALL).unwrap());
            let size = known.peak_force.abs() + 1e-3;
            assert!((seen.peak_force - known.peak_force).abs() < 1e-10 * size);
            let [sample, other] = [&seen, &known].map(|of| of.energy_balance.sample_damping);
            assert!((sample - other).abs() < 1e-10 * size);
            contacts += known.contacts_per_period;
            moving.advance(&mut state).unwrap();
            for (found, expected) in state.iter().zip(&expected) {
                assert!((found - expected).abs() < 1e-11 * (1.0 + expected.abs()));
            }
        }
        assert!(contacts > 0.0);
        // Back at the first gap all is as before.
        moving.set(start).unwrap();
        let [mut state, mut expected] = [other.clone(), other];
        moving.advance(&mut state).unwrap();
        let first = case.model().unwrap();
        ModelMap::new(&first).advance(&mut expected).unwrap();
        assert_eq!(state, expected);
        assert!(moving.set(f64::NAN).is_err());
    }
}
