//! Samples that relax, from the case file to orbits, branches, censuses and derivatives.
//!
//! Reference orbits: an independent program in extended precision, closed to 4e-15.

use nanotap::case::file::Source;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::study::attractors::{AttractorsOptions, attractors};
use nanotap::study::averaged_orbits::averaged_orbits;
use nanotap::study::orbit::{OrbitReport, report};

use crate::common::found;
use crate::derivatives::worst;

const PIB: &str = "sample.arms=[[\"time (us)\", \"modulus (MPa)\"], [0.3832, 460], [1.671, 135.7], \
                   [7.196, 66.9]]";

/// The lever of the references over polyisobutylene, with other words in addition.
fn case(words: &[&str]) -> Case {
    let all = [
        "modes=1",
        "cantilever.k=2 N/m",
        "cantilever.f0=75 kHz",
        "cantilever.Q=150",
        "tip.radius=10 nm",
        "sample.law=prony-sphere",
        "sample.modulus=33.38 MPa",
        "sample.poisson=0.5",
        PIB,
        "drive.actuation=tip",
        "drive.frequency=75 kHz",
        "drive.free_amplitude=30 nm",
        "gap.tip=24 nm",
    ];
    let all = all.iter().chain(words).map(|&word| word.to_owned());
    Case::parse(None, &all.collect::<Vec<_>>()).unwrap()
}

/// Amplitude in nm and phase in degrees.
fn amplitude_and_phase(case: &Case, orbit: &OrbitReport) -> [f64; 2] {
    let length = case.physical().unwrap().scales.length;
    let observables = &orbit.observables;
    [observables.first_harmonic * length * 1e9, observables.phase]
}

#[test]
fn reference_orbits() {
    let cone = [
        "sample.law=prony-cone",
        "tip.radius=",
        "tip.half_angle=20 deg",
    ];
    for (words, expected) in [
        (&[][..], [25.230_138_664_145_2, 59.810_046_860_867]),
        (&["modes=3"], [25.258_243_949_673, 59.891_360_748_698_9]),
        (&cone, [27.715_271_809_870_1, 71.526_697_696_242_3]),
    ] {
        let case = case(words);
        let found = found(&case);
        let values = amplitude_and_phase(&case, &found);
        // Of three modes the reference drives the first mode to 30 nm, nanotap all.
        let tolerance = if words == ["modes=3"] { 1e-6 } else { 1e-9 };
        for (value, expected) in values.iter().zip(expected) {
            assert!(
                (value / expected - 1.0).abs() < tolerance,
                "{words:?}: {value} {expected}"
            );
        }
        assert_eq!(found.stability, "stable");
        assert!(
            found.determinant_defect < 1e-9,
            "{}",
            found.determinant_defect
        );
        assert!(found.observables.energy_balance.residual.abs() < 1e-9);
    }
}

/// Under a flat punch with one arm this is the standard linear solid of the piecewise-linear engine.
#[test]
fn a_punch_on_one_arm_is_the_standard_linear_solid() {
    // 2R/(1 − ν²) = 1 nm.
    let nonlinear = case(&[
        "sample.law=prony-punch",
        "tip.radius=0.5 nm",
        "sample.poisson=0",
        "sample.modulus=5 GPa",
        "sample.arms=[[\"4 GPa\", \"2 us\"]]",
    ]);
    let exact = case(&[
        "sample.law=standard-linear-solid",
        "sample.poisson=",
        "sample.modulus=",
        "sample.arms=",
        "sample.stiffness=5 N/m",
        "sample.relaxation_stiffness=4 N/m",
        "sample.relaxation_time=2 us",
    ]);
    let [a, b] = [&nonlinear, &exact].map(found);
    let values = amplitude_and_phase(&nonlinear, &a);
    for (value, expected) in values.iter().zip(amplitude_and_phase(&exact, &b)) {
        assert!((value / expected - 1.0).abs() < 1e-11, "{value} {expected}");
    }
    // The same multipliers too.
    for (a, b) in a.multipliers.iter().zip(&b.multipliers) {
        assert!(
            (a[0] - b[0]).abs() < 1e-9 && (a[1].abs() - b[1].abs()).abs() < 1e-9,
            "{a:?} {b:?}"
        );
    }
    assert!((values[0] / 24.371_528_606_334 - 1.0).abs() < 1e-9);
}

/// Under a flat punch any number of arms is the generalised Maxwell sample of the piecewise-linear
/// engine.
#[test]
fn a_punch_on_many_arms_is_the_generalised_maxwell_sample() {
    // 2R/(1 − ν²) = 1 nm.
    let nonlinear = case(&[
        "sample.law=prony-punch",
        "tip.radius=0.5 nm",
        "sample.poisson=0",
        "sample.modulus=5 GPa",
        "sample.arms=[[\"4 GPa\", \"2 us\"], [\"3 GPa\", \"0.3 us\"], [\"1 GPa\", \"15 us\"]]",
        "sample.arm_time_factor=0.9",
    ]);
    let exact = case(&[
        "sample.law=generalised-maxwell",
        "sample.poisson=",
        "sample.modulus=",
        "sample.arms=",
        "sample.stiffness=5 N/m",
        "sample.relaxation_arms=[[\"time (us)\", \"stiffness (N/m)\"], [2, 4], [0.3, 3], [15, 1]]",
        "sample.relaxation_time_factor=0.9",
    ]);
    let [a, b] = [&nonlinear, &exact].map(found);
    let values = amplitude_and_phase(&nonlinear, &a);
    for (value, expected) in values.iter().zip(amplitude_and_phase(&exact, &b)) {
        assert!((value / expected - 1.0).abs() < 1e-11, "{value} {expected}");
    }
    let (a, b) = (&a.observables, &b.observables);
    for (value, expected) in [
        (a.dissipation, b.dissipation),
        (a.peak_force, b.peak_force),
        (a.contact_fraction, b.contact_fraction),
        (a.indentation, b.indentation),
    ] {
        assert!((value / expected - 1.0).abs() < 1e-10, "{value} {expected}");
    }
}

/// Relaxing arms are written as they are read, under both sections, and refused elsewhere.
#[test]
fn relaxing_arms_are_read_and_written() {
    let words = [
        "sample.law=generalised-maxwell",
        "sample.poisson=",
        "sample.modulus=",
        "sample.arms=",
        "sample.stiffness=5 N/m",
        "sample.relaxation_arms=[[\"4 N/m\", \"2 us\"], [\"3000 mN/m\", \"300 ns\"]]",
    ];
    let physical = case(&words);
    let lever = physical.cantilever().unwrap();
    assert_eq!(lever.arms.len(), 2);
    let again = |text: String| {
        let name = "again.toml".into();
        Case::parse(Some(nanotap::case::file::Source { name, text }), &[]).unwrap()
    };
    let same = again(physical.to_toml());
    assert_eq!(same.cantilever().unwrap(), lever);
    let model = Case::from(lever.clone());
    assert_eq!(again(model.to_toml()).cantilever().unwrap(), lever);
    let refused = |words: &[&str]| {
        let words: Vec<String> = words.iter().map(|&w| w.to_owned()).collect();
        Case::parse(None, &words).unwrap_err().to_string()
    };
    let paper = ["alpha1=0", "alpha2=1", "alpha3=1", "alpha4=1", "omega=2"];
    let maxwell = "contact=generalised-maxwell";
    let of = |more: &[&str]| refused(&[&paper[..], more].concat());
    assert!(
        of(&[maxwell]).contains("1 to 12 relaxing arms"),
        "{}",
        of(&[maxwell])
    );
    let arms = "relaxation_arms=[[\"time\", \"stiffness\"], [0.1, 2]]";
    let other = of(&["contact=kelvin-voigt", "alpha6=1", arms]);
    assert!(other.contains("generalised-maxwell"), "{other}");
    let negative = of(&[
        maxwell,
        "relaxation_arms=[[\"time\", \"stiffness\"], [-1, 2]]",
    ]);
    assert!(negative.contains("time must be positive"), "{negative}");
}

/// Derivatives by the state's entries, the surface's among them, and by quantities of the case.
#[test]
fn derivatives() {
    let case = case(&[
        "sample.law=prony-sphere + van-der-waals",
        "sample.hamaker=1e-19 J",
        "sample.intermolecular_distance=0.2 nm",
    ]);
    let found = found(&case);
    let keys = [
        Key::GapTip,
        Key::DriveFrequency,
        Key::SampleModulus,
        Key::SampleHamaker,
        Key::SampleArmTimeFactor,
        Key::SampleArmModulusFactor,
        Key::LeverQ,
    ];
    let error = worst(&case, &keys, &found.state);
    assert!(error < 1e-6, "{error}");
}

/// A census finds the same orbit from initial states of lever and surface.
#[test]
fn a_census_finds_the_orbit() {
    let case = case(&[]);
    let options = AttractorsOptions {
        starts: Some(16),
        ..AttractorsOptions::default()
    };
    let census = attractors(&case.model().unwrap(), &options, &Control::default()).unwrap();
    let same = found(&case);
    let mut orbits = census.attractors.iter().filter_map(|a| a.orbit.as_ref());
    let near = |a: &f64, b: &f64| (a - b).abs() < 1e-9 * same.state[0].abs();
    let is_same = |state: &[f64]| state.iter().zip(&same.state).all(|(a, b)| near(a, b));
    assert!(orbits.any(|orbit| orbit.period == 1 && is_same(&orbit.states[0])));
}

/// Arms over twelve decades: the orbit is what months of tapping lead to, or, within a horizon, what
/// a second does.
#[test]
fn arms_over_many_decades() {
    // Epoxy of Simon, McKenna and Sindt, J. Appl. Polym. Sci. 76, 495 (2000).
    const MODULI: [f64; 24] = [
        0.05715345, 0.05715345, 0.05715345, 0.05715345, 0.07097661, 0.07097661, 0.09968625,
        0.10766115, 0.1674729, 0.1674729, 0.28018482, 0.3083628, 0.3083628, 0.43941699, 0.14913063,
        0.14913063, 0.05290017, 0.03163377, 0.01462065, 0.00744324, 0.00212664, 0.00053166,
        0.00079749, 0.00079749,
    ];
    let rows = MODULI.iter().enumerate().map(|(k, modulus)| {
        // The last arm has twice the step.
        let decade = if k == 23 { 5.0 } else { 0.5 * k as f64 - 7.0 };
        format!("[{:e}, {modulus}]", 10_f64.powf(decade))
    });
    let rows: Vec<String> = rows.collect();
    let arms = format!(
        "sample.arms=[[\"time (s)\", \"modulus (GPa)\"], {}]",
        rows.join(", ")
    );
    let epoxy = |words: &[&str]| {
        let own = [
            "cantilever.k=6.5 N/m",
            "cantilever.f0=46 kHz",
            "drive.frequency=46 kHz",
            "drive.free_amplitude=60 nm",
            "gap.tip=45 nm",
            "sample.law=prony-sphere + van-der-waals",
            "sample.modulus=14.7 MPa",
            "sample.hamaker=2e-19 J",
            "sample.intermolecular_distance=0.2 nm",
            &arms,
        ];
        case(&own.iter().chain(words).copied().collect::<Vec<_>>())
    };
    for (words, expected, tolerance) in [
        (
            &["sample.horizon=1.5 s"][..],
            [46.888_601_977_409, 51.627_473_715_823_7],
            1e-7,
        ),
        (&[], [51.215_750_654_701_7, 58.765_439_910_936_5], 1e-7),
    ] {
        let case = epoxy(words);
        let model = case.model().unwrap();
        let orbits = averaged_orbits(&model);
        let found: Vec<[f64; 2]> = orbits
            .iter()
            .map(|orbit| amplitude_and_phase(&case, &report(&model, orbit, 1).unwrap()))
            .collect();
        let is_there = |found: &[f64; 2]| {
            let pairs = found.iter().zip(expected);
            pairs
                .map(|(value, expected)| (value / expected - 1.0).abs())
                .all(|error| error < tolerance)
        };
        assert!(found.iter().any(is_there), "{words:?}: {found:?}");
    }
}

/// Arms of up to 1e5 s at 46 kHz decay over 1e5 s · 46 kHz = 4.6e9 drive periods, a little more slowly
/// where the tip touches. The motion is stable all the same and is listed; no start is seen to arrive.
#[test]
fn a_motion_that_slow_arms_approach_is_listed_as_stable() {
    let source = Source {
        name: "epoxy.toml".into(),
        text: include_str!("../../../../docs/cases/epoxy.toml").into(),
    };
    let case = Case::parse(Some(source), &[]).unwrap();
    let model = case.model().unwrap();
    let options = AttractorsOptions {
        starts: Some(1),
        ..AttractorsOptions::default()
    };
    let found = attractors(&model, &options, &Control::default()).unwrap();
    let [only] = &found.attractors[..] else {
        panic!("{} attractors", found.attractors.len())
    };
    let motion = only.orbit.as_ref().unwrap();
    assert_eq!((motion.stability, only.share.count), ("stable", 0));
    let decay = motion.decay_periods.unwrap();
    assert!((4.6e9..5.2e9).contains(&decay), "{decay:e}");
    assert!(found.notes[0].contains("attractor 1"), "{:?}", found.notes);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let refused = |words: &[&str]| {
        let all = [
            "cantilever.k=2 N/m",
            "cantilever.f0=75 kHz",
            "cantilever.Q=150",
            "tip.radius=10 nm",
            "drive.frequency=75 kHz",
            "drive.free_amplitude=30 nm",
            "gap.tip=24 nm",
            "sample.law=prony-sphere",
        ];
        let words: Vec<String> = all.iter().chain(words).map(|&w| w.to_owned()).collect();
        Case::parse(None, &words).unwrap_err().to_string()
    };
    let error = refused(&["sample.modulus=1 MPa"]);
    assert!(error.contains("relaxing arms"), "{error}");
    let error = refused(&[PIB]);
    assert!(error.contains("relaxes to nothing"), "{error}");
    let error = refused(&[
        "sample.modulus=1 MPa",
        "sample.arms=[[\"time (us)\", \"modulus (MPa)\"], [-1, 2]]",
    ]);
    assert!(error.contains("must be positive"), "{error}");
    let error = refused(&[
        "sample.modulus=1 MPa",
        "sample.arms=[[\"time (us)\", \"force (nN)\"], [1, 2]]",
    ]);
    assert!(error.contains("no column `modulus`"), "{error}");
    let error = refused(&[
        "sample.law=prony-sphere + hertz",
        "sample.modulus=1 MPa",
        PIB,
    ]);
    assert!(error.contains("counted twice"), "{error}");
    // With a horizon the slow arms are elastic.
    let words = ["sample.horizon=1 us", "sample.modulus="];
    assert!(case(&words).model().is_ok());
    // Shear moduli count as 2(1 + ν) G.
    let shear = case(&[
        "sample.arms=[[\"time (us)\", \"G (MPa)\"], [0.3832, 153.333333333333333], [1.671, \
         45.2333333333333333], [7.196, 22.3]]",
    ]);
    let moduli = |case: &Case| {
        let force = case.physical().unwrap().sample.force.as_ref();
        force.unwrap().dynamic_modulus(75e3).unwrap()
    };
    for (a, b) in moduli(&shear).iter().zip(moduli(&case(&[]))) {
        assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
    }
}
