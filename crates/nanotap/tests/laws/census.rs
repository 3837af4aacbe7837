//! Default censuses, compared with motions that independent programs found.

use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::study::attractors::{
    Attractors, AttractorsOptions, AttractorsStudy, Disagreement, EndReport, attractors,
};
use nanotap::study::registry::Study as _;
use nanotap::study::start_box::default_starts;
use serde_json::Value;

use crate::averaging::{cases, numbers};

/// Largest relative distance between equal orbits.
const ORBIT_TOLERANCE: f64 = 1e-6;

fn has_orbit(found: &Attractors, expected: &Value) -> bool {
    let state = numbers(&expected["state"]);
    let scale = state.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let is_there = |other: &Vec<f64>| {
        let apart = state.iter().zip(other).map(|(a, b)| (a - b).abs());
        apart.fold(0.0, f64::max) < ORBIT_TOLERANCE * scale
    };
    let mut orbits = found.attractors.iter().filter_map(|a| a.orbit.as_ref());
    orbits.any(|orbit| expected["period"] == orbit.period && orbit.states.iter().any(is_there))
}

/// Every stable orbit of the reference cases is found, including the attractive state of c08, whose
/// basin contains less than 0.1 % of the starts, and the periods 8 and 18 of c06. Cases whose
/// census takes more than a second are left out; averaging alone finds their orbits.
#[test]
fn nonlinear_censuses_find_the_expected_orbits() {
    for (name, model, expected) in cases() {
        if ["c03", "c04", "c11"]
            .iter()
            .any(|slow| name.starts_with(slow))
        {
            continue;
        }
        let options = AttractorsOptions::default();
        let found = attractors(&model, &options, &Control::default()).unwrap();
        let orbits = expected["orbits"].as_array().unwrap().iter();
        for orbit in orbits.filter(|orbit| orbit["stable"] == true) {
            assert!(
                has_orbit(&found, orbit),
                "{name}: no period {}",
                orbit["period"]
            );
        }
        let unseen = found.unseen.unwrap();
        assert!(unseen.target == 0.01 && unseen.fraction <= 0.01, "{name}");
        assert_eq!(found.end, EndReport::BoundMet, "{name}");
        assert!(found.followed_at.is_some(), "{name}");
    }
}

/// Default censuses of random piecewise-linear cases (`tests/reference/census_linear.json`): every
/// motion was confirmed by an independent program. Cases that take more than half a second are left
/// out.
#[test]
fn piecewise_linear_censuses_find_the_expected_motions() {
    let text = include_str!("../reference/census_linear.json");
    let reference: Value = serde_json::from_str(text).unwrap();
    for (number, case) in reference["cases"].as_array().unwrap().iter().enumerate() {
        if [1, 3, 9, 13].contains(&number) {
            continue;
        }
        let keys = case["set"].as_object().unwrap().iter();
        let keys: Vec<String> = keys.map(|(key, value)| format!("{key}={value}")).collect();
        let case_of_keys = Case::parse(None, &keys).unwrap();
        let options = AttractorsOptions::default();
        let found = AttractorsStudy::run(&case_of_keys, &options, &Control::default()).unwrap();
        assert!(found.followed_at.is_none());
        let motions = case["motions"].as_array().unwrap();
        assert!(found.attractors.len() >= motions.len(), "{number}");
        for motion in motions {
            let tip = motion["tip_max"].as_f64().unwrap();
            let share = motion["share"].as_f64().unwrap();
            let mut attractors = found.attractors.iter();
            let there = attractors.any(|a| {
                a.orbit.as_ref().is_some_and(|orbit| {
                    motion["period"] == orbit.period
                        && (orbit.observables.tip_max / tip - 1.0).abs() < 1e-5
                        && (a.share.fraction - share).abs() < 0.02
                })
            });
            assert!(there, "{number}: no {motion}");
        }
    }
}

/// Lennard-Jones levers: Basso, Giarré, Dahleh and Mezić (ACC 1998) at resonance, and one of Q 100
/// with a free amplitude of 100 nm, 90 nm above the sample (k A₂R/6 = 5.36 nN nm², S = 3 nm).
fn lennard_jones() -> [Case; 2] {
    let common = [
        "modes=1",
        "cantilever.k1=1 N/m",
        "cantilever.f0=10 kHz",
        "tip.radius=100 nm",
        "sample.law=lennard-jones",
        "drive.actuation=tip",
        "drive.frequency_ratio=1",
    ];
    let of = |own: [&str; 5]| {
        let words = common.iter().chain(&own).map(|word| (*word).to_owned());
        Case::parse(None, &words.collect::<Vec<_>>()).unwrap()
    };
    [
        of([
            "cantilever.Q=25",
            "sample.hamaker=8.888888888888889e-18 J",
            "sample.repulsion=6.48e-69 J m^6",
            "drive.force=10 nN",
            "gap.tip=8 nm",
        ]),
        of([
            "cantilever.Q=100",
            "sample.hamaker=3.216e-19 J",
            "sample.repulsion=2.3445e-70 J m^6",
            "drive.free_amplitude=100 nm",
            "gap.tip=90 nm",
        ]),
    ]
}

/// All motions above a Lennard-Jones sample stay bounded: the repulsion is a wall, and an
/// independent program and the exact flow keep every start. 48 of 64 and 122 of 200 starts were
/// once lost behind it.
#[test]
fn no_start_is_lost_behind_a_pole() {
    for (case, starts) in lennard_jones().iter().zip([64, 200]) {
        let model = case.model().unwrap();
        let wall = model.wall().unwrap();
        let options = AttractorsOptions {
            starts: Some(starts),
            check: 12,
            ..AttractorsOptions::default()
        };
        let found = AttractorsStudy::run(case, &options, &Control::default()).unwrap();
        assert_eq!((found.unbounded.count, found.undecided.len()), (0, 0));
        assert!(!found.attractors.is_empty());
        let counts = found.attractors.iter().map(|a| a.share.count);
        assert_eq!(counts.sum::<usize>(), starts);
        let check = found.check.unwrap();
        assert_eq!((check.starts, check.undecided), (12, 0));
        // Where three motions coexist the starts, much wider than their basins, go to one of them
        // after a long transient that no two integrations share.
        if found.attractors.len() == 1 {
            assert_eq!(check.agreed, 12, "{:?}", check.disagreements);
        }
        let lost = |other: &Disagreement| other.exact.contains("bound");
        assert!(!check.disagreements.iter().any(lost));
        // Neighbours part on the exact flow too.
        let explained = check.disagreements.iter().all(|other| other.sensitive);
        assert!(explained, "{:?}", check.disagreements);
        // The box ends at the wall.
        let lower = [found.sides[0].lower, 0.0];
        assert!(wall.distance(&lower).abs() < 1e-12, "{:?}", found.sides[0]);
        let drawn = default_starts(&model, 1).unwrap();
        assert!((0..500).all(|k| wall.is_before(&drawn.start(k).unwrap())));
        let rests = model.equilibria();
        assert!(
            !rests.is_empty() && rests.iter().all(|rest| rest.gap > 0.0),
            "{rests:?}"
        );
    }
}

/// A box behind the surface is refused.
#[test]
fn a_box_behind_the_surface_is_refused() {
    let [case, _] = lennard_jones();
    let model = case.model().unwrap();
    let wall = model.wall().unwrap();
    let at_wall = wall.least / wall.row[0];
    let options = AttractorsOptions {
        sides: [("a1", 3.0 * at_wall, 1.01 * at_wall)]
            .into_iter()
            .collect(),
        ..AttractorsOptions::default()
    };
    let error = attractors(&model, &options, &Control::default()).unwrap_err();
    assert!(error.message().contains("behind the surface"), "{error}");
}

/// Eight starts of a lever of Q 30 under every law; three of them go to the same motion on the exact
/// flow.
#[test]
fn censuses_under_every_law_agree_with_the_exact_flow() {
    let words = [
        "modes=1",
        "cantilever.k=2.8 N/m",
        "cantilever.f0=75 kHz",
        "cantilever.Q=30",
        "sample.stiffness=20 N/m",
        "sample.damping=1e-7 N s/m",
        "drive.frequency=75 kHz",
        "drive.free_amplitude=20 nm",
        "gap.tip=15 nm",
    ];
    let lever = Case::parse(None, &words.map(str::to_owned)).unwrap();
    let mut laws = 0;
    for law in nanotap_volterra::laws::all() {
        let name = law.entry.name;
        let change = lever.law_change(name, &lever).unwrap();
        let key_of = |word: &str| word.split('=').next().unwrap().to_owned();
        let kept = words.into_iter().filter(|word| {
            let mut dropped = change.dropped.iter();
            !dropped.any(|key| key.to_string() == key_of(word))
        });
        let added = change.added.iter();
        let added = added.map(|(key, value)| format!("{key}={}", value.text()));
        let law = std::iter::once(format!("sample.law={name}"));
        let words: Vec<String> = kept.map(str::to_owned).chain(law).chain(added).collect();
        let model = Case::parse(None, &words).unwrap().model().unwrap();
        let options = AttractorsOptions {
            starts: Some(8),
            check: 3,
            ..AttractorsOptions::default()
        };
        let found = attractors(&model, &options, &Control::default()).unwrap();
        let check = found.check.unwrap();
        assert_eq!(check.starts, 3, "{name}");
        assert!(check.disagreements.is_empty(), "{name}: {check:?}");
        laws += 1;
    }
    assert!(laws > 30, "{laws}");
}
