//! Branches with bifurcations known from an independent program, and diagrams with motions that a
//! census at one value misses.

use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::study::branch::{BranchOptions, BranchReport, branch};
use nanotap::study::target::Targets;
use nanotap::study::value::Interval;

use crate::approach::{STIFF, studied};

fn followed(case: &Case, key: &str, from: f64, to: f64) -> BranchReport {
    let options = BranchOptions::over(case.key(key).unwrap(), from, to);
    branch(case, &options, &Control::default()).unwrap()
}

fn of_kind(report: &BranchReport, kind: &str) -> Vec<f64> {
    let found = report.bifurcations.iter().filter(|b| b.kind == kind);
    found.map(|b| b.parameter).collect()
}

/// The orbit grows by a factor of a hundred through the resonance; the folds are those of a Taylor
/// integrator of order 22 with its own continuation, to 1 Hz.
#[test]
fn a_branch_through_a_resonance_finds_both_of_its_folds() {
    let lever = studied(STIFF, &[]);
    let report = followed(&lever, "drive.frequency", 250e3, 340e3);
    assert!(report.failures.is_empty(), "{:?}", report.failures);
    assert!(report.points.len() < 3000, "{}", report.points.len());
    let folds = of_kind(&report, "fold");
    for expected in [330_570.0, 332_208.0] {
        assert!(
            folds.iter().any(|f| (f - expected).abs() < 1.0),
            "{folds:?}"
        );
    }
}

/// Flip at Ω = 5.1385, from the same independent program.
#[test]
fn a_smooth_branch_is_followed_to_its_end() {
    let case = studied(
        "[model]\nmodes = 1\nalpha1 = 0.3368\nalpha2 = 0.42\nalpha3 = 0.1511\n\
         alpha4 = 6.136\nalpha5 = -0.0584\nalpha6 = 0.0326\nomega = 3.0\n",
        &[],
    );
    let report = followed(&case, "omega", 2.1, 6.0);
    assert!(report.failures.is_empty(), "{:?}", report.failures);
    assert_eq!(report.branches[0].range, [2.1, 6.0]);
    let flips = of_kind(&report, "flip");
    assert!(flips.iter().any(|f| (f - 5.1385).abs() < 5e-5), "{flips:?}");
}

/// The orbit shrinks in proportion to the drive amplitude α2, down to a point.
#[test]
fn a_branch_ends_at_zero_drive() {
    for gap in [0.0, 0.01] {
        let set = format!("alpha5={gap}");
        let case = studied(&paper(3.0, 1), &[set.as_str()]);
        let report = followed(&case, "alpha2", 0.1, 1e-9);
        assert!(report.failures.is_empty(), "{:?}", report.failures);
        let last = report.points.last().unwrap();
        assert!(last.parameter <= 1e-9 * (1.0 + 1e-9), "{}", last.parameter);
        assert!(last.observables.tip_max.abs() < 1e-7);
    }
}

/// Equation 26 of the paper, contact damping 0.2.
pub(crate) fn paper(omega: f64, modes: usize) -> String {
    format!(
        "[model]\nmodes = {modes}\nalpha1 = 0.1\nalpha2 = 0.1\nalpha3 = 0.1\nalpha4 = 20.0\n\
         alpha5 = 0.0\nalpha6 = 0.2\nomega = {omega}\n"
    )
}

/// A stable period 3 exists in a window of Ω with width 0.07, 3.109 … 3.180 (known from a sweep
/// with many starts): the diagram contains it, with the fold and the flip that bound it.
#[test]
fn a_diagram_contains_a_period_3_with_a_small_basin() {
    let case = studied(&paper(3.0, 3), &[]);
    let options = BranchOptions {
        switch: Some(1),
        diagram: true,
        ..BranchOptions::over(case.key("omega").unwrap(), 2.4, 3.2)
    };
    let report = branch(&case, &options, &Control::default()).unwrap();
    let stable: Vec<f64> = report
        .points
        .iter()
        .filter(|p| p.period == 3 && p.stable)
        .map(|p| p.parameter)
        .collect();
    let low = stable.iter().copied().fold(f64::INFINITY, f64::min);
    let high = stable.iter().copied().fold(0.0, f64::max);
    assert!((3.105..3.115).contains(&low), "{low}");
    assert!((3.175..3.185).contains(&high), "{high}");
    // Joined from value to value it has one number there, and the shares at a value are parts of one.
    let third: Vec<_> = report.attractors.iter().filter(|a| a.period == 3).collect();
    assert!(third.len() > 1);
    for one in &third {
        assert_eq!(one.attractor, third[0].attractor);
        assert!((low..=high).contains(&one.parameter), "{one:?}");
    }
    for at in report
        .attractors
        .chunk_by(|a, b| a.parameter == b.parameter)
    {
        let sum: f64 = at.iter().map(|one| one.share).sum();
        assert!(sum > 0.5 && sum <= 1.0 + 1e-12, "{at:?}");
        for one in at {
            assert!(
                one.share_low <= one.share && one.share <= one.share_high,
                "{one:?}"
            );
        }
    }
}

/// An oscillator that touches nothing: its amplitude F/√((1 − Ω²)² + (d Ω)²), for the damping d, is 2
/// on a closed form of Ω and d.
#[test]
fn events_lie_on_their_closed_form() {
    let text = "[model]\nkind = \"impact\"\nstiffness = 1\ndamping = 0.2\nforcing = 1\n\
                omega = 0.6\ngap = 100\nrestitution = 0.8\n";
    let case = studied(text, &[]);
    let options = BranchOptions {
        event: Targets(vec![
            "first_harmonic = 2".to_owned(),
            "phase = 45".to_owned(),
        ]),
        second: Some(Interval::of_key(case.key("damping").unwrap(), 0.1, 0.45)),
        ..BranchOptions::over(case.key("omega").unwrap(), 0.6, 1.4)
    };
    let report = branch(&case, &options, &Control::default()).unwrap();
    let amplitude = |omega: f64, d: f64| 1.0 / (1.0 - omega * omega).hypot(d * omega);
    // The drive is counted along the force at phase 0, against the stop: 180° less the lag.
    let phase = |omega: f64, d: f64| (d * omega).atan2(omega * omega - 1.0).to_degrees();
    let [low, high] = [0, 1].map(|k| &report.events[k]);
    assert!(low.point.parameter < 0.8 && high.point.parameter > 1.1);
    for found in [low, high] {
        let off = amplitude(found.point.parameter, 0.2) - 2.0;
        assert!(off.abs() < 1e-9, "{off}");
    }
    assert!((phase(report.events[2].point.parameter, 0.2) - 45.0).abs() < 1e-7);
    let curves = report.loci.unwrap().curves;
    let of = |event: &str| {
        let found = curves.iter().filter(|c| c.event.as_deref() == Some(event));
        found.collect::<Vec<_>>()
    };
    // On either side of the resonance; above d = 0.5 both would meet.
    assert_eq!(of("first_harmonic = 2").len(), 2);
    for curve in &curves {
        assert!(curve.first.len() > 20 && curve.ends.iter().all(|end| end.contains("edge")));
        for (omega, d) in curve.first.iter().zip(&curve.second) {
            let off = if curve.event.as_deref() == Some("phase = 45") {
                (phase(*omega, *d) - 45.0) / 45.0
            } else {
                amplitude(*omega, *d) / 2.0 - 1.0
            };
            assert!(off.abs() < 1e-7, "{omega} {d}: {off}");
        }
    }
}
