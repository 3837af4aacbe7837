//! Permanent contact: the motion is smooth, but perturbations of the fast modes are not.

use nanotap::case::Case;
use nanotap::study::orbit::{OrbitOptions, orbit};

/// Without a tip mass the damping is the same for every mode, and a conservative force gives all
/// multipliers the modulus e^(−α₃T/2).
#[test]
fn all_multipliers_have_one_modulus() {
    for (modes, q) in [(3, 200.0), (5, 2.0), (10, 20.0)] {
        let words = [
            &format!("modes={modes}"),
            &format!("cantilever.Q={q}"),
            "cantilever.k=0.3 N/m",
            "cantilever.f0=30 kHz",
            "tip.radius=20 nm",
            "sample.law=hertz",
            "sample.modulus=1 GPa",
            "sample.poisson=0.5",
            "drive.actuation=tip",
            "drive.frequency_ratio=1",
            "drive.free_amplitude=10 nm",
            "gap.tip=-60 nm",
        ];
        let case = Case::parse(None, &words.map(str::to_owned)).unwrap();
        let numbers = case.cantilever().unwrap();
        let period = std::f64::consts::TAU / numbers.omega;
        let expected = (-0.5 * numbers.alpha3 * period).exp();
        let found = orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap();
        assert_eq!(found.stability, "stable");
        assert!(
            found.determinant_defect < 1e-10,
            "{}",
            found.determinant_defect
        );
        for [re, im] in found.multipliers {
            let modulus = re.hypot(im) / expected;
            assert!(
                (modulus - 1.0).abs() < 1e-10,
                "{modes} modes, Q = {q}: {modulus}"
            );
        }
    }
}

/// Unbounded damping in the contact makes the tip creep ever more slowly into the sample: a period
/// with too many steps is an error with that reason.
#[test]
fn a_period_of_too_many_steps_ends_with_a_reason() {
    let words = [
        "modes=2",
        "cantilever.k=0.1092 N/m",
        "cantilever.f0=39.87 kHz",
        "cantilever.Q=4.654",
        "tip.radius=40.08 nm",
        "sample.law=dmt+exponential-damping",
        "sample.modulus=10 MPa",
        "sample.poisson=0.49",
        "sample.hamaker=1.918e-20 J",
        "sample.damping=1.15e-8 N s/m",
        "sample.decay_length=0.3237 nm",
        "drive.actuation=tip",
        "drive.frequency_ratio=1",
        "drive.free_amplitude=15.46 nm",
        "gap.tip=12.2 nm",
    ];
    let case = Case::parse(None, &words.map(str::to_owned)).unwrap();
    let error = orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap_err();
    assert!(
        error.to_string().contains("limit of 10000 steps"),
        "{error}"
    );
}
