//! Branches with bifurcations known from an independent program, and diagrams with motions that a
//! census at one value misses.

use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::study::branch::{BranchOptions, BranchReport, branch};

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
fn paper(omega: f64, modes: usize) -> String {
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
    for one in third {
        assert_eq!(one.attractor, third_number(&report));
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

fn third_number(report: &BranchReport) -> usize {
    let mut orbits = report.attractors.iter().filter(|a| a.period == 3);
    orbits.next().unwrap().attractor
}
