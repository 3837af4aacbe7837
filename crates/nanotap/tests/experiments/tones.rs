//! Levers under three tones: many lines of a spectrum, and several motions under one drive.

use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::study::Study as _;
use nanotap::study::lyapunov::{LyapunovOptions, LyapunovStudy};
use nanotap::study::orbit::{OrbitOptions, OrbitReport, OrbitStudy};
use nanotap::study::simulate::{SimulateOptions, SimulateReport, SimulateStudy};

/// A lever over a stiff sample under tones of these ratios to the first.
fn tones(ratios: [&str; 2], gap: &str) -> Case {
    let words = [
        "modes=1",
        "cantilever.k=2 N/m",
        "cantilever.f0=70 kHz",
        "cantilever.Q=150",
        "tip.radius=10 nm",
        "sample.law=dmt",
        "sample.modulus=2 GPa",
        "sample.poisson=0.3",
        "sample.hamaker=7e-20 J",
        "sample.intermolecular_distance=0.165 nm",
        "drive.actuation=tip",
        "drive.frequency=70 kHz",
        "drive.free_amplitude=10 nm",
        &format!("drive.second_ratio={}", ratios[0]),
        "drive.second_free_amplitude=8 nm",
        &format!("drive.third_ratio={}", ratios[1]),
        "drive.third_free_amplitude=3 nm",
        &format!("gap.tip={gap}"),
    ]
    .map(str::to_owned);
    Case::parse(None, &words).unwrap()
}

fn orbit(case: &Case) -> OrbitReport {
    let found = OrbitStudy::run(case, &OrbitOptions::default(), &Control::default());
    found.unwrap().motion
}

/// A comb repeats after 100 periods of the first tone, and the motion after four times as many: 8000
/// lines up to the 20th harmonic, of which those are listed that are products of the tones.
#[test]
fn the_lines_of_close_tones_are_products_of_the_tones() {
    let found = orbit(&tones(["101/100", "103/100"], "8 nm"));
    assert!(found.stable && found.period == 4, "{}", found.period);
    let lines = &found.spectrum.harmonics;
    // A million lines times periods of the first tone at most.
    assert!(lines.len() > 100 && lines.len() * 400 <= 1_000_000);
    assert!(lines.iter().all(|line| line.product.is_some()));
    assert!(lines.is_sorted_by(|a, b| a.order < b.order));
    let named = |order: f64| lines.iter().find(|line| line.order == order).unwrap();
    assert_eq!(named(1.0).product.as_deref(), Some(&[1, 0, 0][..]));
    assert_eq!(named(1.03).product.as_deref(), Some(&[0, 0, 1][..]));
    // 2 f2 − f3, where 2 f1 − f2 is, too.
    assert_eq!(named(0.99).product.as_deref(), Some(&[0, 2, -1][..]));
    assert!((named(1.0).tip / found.spectrum.first_harmonic - 1.0).abs() < 1e-9);
}

/// Five stable orbits exist under 1 : 1.1 : 1.3, by a census.
#[test]
fn the_initial_state_of_one_of_several_motions_is_stated() {
    let case = tones(["11/10", "13/10"], "16 nm");
    let found = orbit(&case);
    let [note] = &found.notes[..] else {
        panic!("{:?}", found.notes)
    };
    let others = "other initial states lead to other motions, one of period";
    assert!(
        note.contains("from rest") && note.contains(others),
        "{note}"
    );
    assert!(note.contains("`attractors`"), "{note}");
    let options = SimulateOptions {
        state: Some(found.state.into()),
        ..SimulateOptions::default()
    };
    let run = SimulateStudy::run(&case, &options, &Control::default()).unwrap();
    let SimulateReport::Exact(run) = run else {
        panic!("the exact flow")
    };
    let note = &run.motion.notes[0];
    assert!(
        note.contains("from the given state") && note.contains(others),
        "{note}"
    );
    let options = LyapunovOptions {
        periods: 10,
        transient: 10,
        points: 0,
        ..LyapunovOptions::default()
    };
    let report = LyapunovStudy::run(&case, &options, &Control::default()).unwrap();
    assert!(report.notes[0].contains("from rest"));
}

/// A lever far away from the sample has one motion: no other is claimed.
#[test]
fn where_no_other_motion_is_known_none_is_claimed() {
    let found = orbit(&tones(["11/10", "13/10"], "1 um"));
    assert!(found.notes[0].contains("may lead"), "{:?}", found.notes);
}
