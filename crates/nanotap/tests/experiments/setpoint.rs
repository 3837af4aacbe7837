//! Setpoints solved for the distance.

use std::path::Path;

use nanotap::case::Case;
use nanotap::case::file::Source;
use nanotap::case::physical::Catalogue;
use nanotap::control::Control;
use nanotap::model::parameter::Parameter;
use nanotap::study::Study as _;
use nanotap::study::contact_laws::{ContactLawsOptions, ContactLawsStudy};
use nanotap::study::convergence::{ConvergenceOptions, ConvergenceStudy};
use nanotap::study::frequency_modulation::{FrequencyModulationOptions, frequency_modulation};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap::study::setpoint::{
    NearOrbit, SetpointSolution, at_setpoint, orbit_at_setpoint, solve_setpoint,
};
use nanotap::study::simulate::{SimulateOptions, simulate};

use crate::approach::{MICA, STIFF, budgets, limited, studied};

/// Without `gap.tip`, the setpoint determines the distance.
fn case_with(set: &[&str]) -> nanotap::case::Case {
    studied(&STIFF.replace("[gap]\ntip = \"15 nm\"\n", ""), set)
}

/// At the chosen distance the tapping orbit has the setpoint amplitude, and so has every other
/// solution at its distance: each is run again from its state.
#[test]
fn every_solution_has_the_amplitude_of_the_setpoint() {
    let lever = case_with(&["drive.setpoint=0.8"]);
    assert!(lever.leaves_distance_to_setpoint());
    let report = solve_setpoint(&lever, &Control::default()).unwrap();
    assert!((report.amplitude / 16e-9 - 1.0).abs() < 1e-12);
    for solution in &report.solutions {
        let model = lever.with(lever.gap_key(), solution.gap).model().unwrap();
        let options = OrbitOptions {
            period: Some(solution.period),
            state: Some(solution.state.clone().into()),
            ..OrbitOptions::default()
        };
        let found = orbit(&model, &options).unwrap();
        let amplitude = found.observables.first_harmonic * lever.physical().unwrap().scales.length;
        assert!((amplitude / 16e-9 - 1.0).abs() < 1e-9, "{amplitude}");
        assert_eq!(found.stable, solution.stable);
    }
    let zc = report.zc();
    // The tip taps the surface: the distance is slightly less than the amplitude.
    assert!(zc > 14e-9 && zc < 16e-9, "{zc}");
    let (at, _) = at_setpoint(lever, &Control::default()).unwrap();
    let resolved = at.physical().unwrap();
    assert!((resolved.parameters.get(Parameter::Alpha5) / zc - 1.0).abs() < 1e-12);
    let found = orbit(&at.model().unwrap(), &OrbitOptions::default()).unwrap();
    let ratio = found.observables.first_harmonic * resolved.scales.length / 20e-9;
    assert!((ratio - 0.8).abs() < 1e-9, "{ratio}");
}

/// On approach the motion jumps from A0 to 1.06 A0, so that the feedback cannot reach an amplitude
/// of 1.02 A0 from above; an amplitude below all is not reached.
#[test]
fn a_setpoint_that_is_not_reached_is_refused() {
    let soft = case_with(&["drive.setpoint=1e-4"]);
    let error = solve_setpoint(&soft, &Control::default()).unwrap_err();
    assert!(error.message().contains("is not reached"), "{error}");
    let error = solve_setpoint(&studied(STIFF, &[]), &Control::default()).unwrap_err();
    assert!(error.message().contains("has no setpoint"), "{error}");
}

/// A given distance is not overruled, and a setpoint given with `--set` replaces it; a case with
/// both is refused.
#[test]
fn a_distance_and_a_setpoint_exclude_each_other() {
    let lever = studied(STIFF, &[]);
    let (same, report) = at_setpoint(lever.clone(), &Control::default()).unwrap();
    assert!(report.is_none());
    assert_eq!(same, lever);
    assert!(studied(STIFF, &["drive.setpoint=0.8"]).leaves_distance_to_setpoint());
    let both = STIFF.replace("[drive]", "[drive]\nsetpoint = 0.8");
    assert_ne!(both, STIFF);
    let source = Source {
        name: "case.toml".into(),
        text: both,
    };
    let refused = Case::parse(Some(source), &[]).unwrap_err().to_string();
    assert!(
        refused.contains("drive.setpoint and gap.tip cannot both be given"),
        "{refused}"
    );
}

/// A sweep in steps of 5 pm and two ramps reach the setpoint at 8.177 nm, in the attractive state.
/// The repulsive state has the same amplitude at 8.003 nm, and another one at 8.177 nm.
#[test]
fn the_setpoint_is_reached_in_the_state_from_far() {
    let lever = studied(MICA, &["drive.setpoint=0.8"]);
    let report = solve_setpoint(&lever, &Control::default()).unwrap();
    assert!(
        (report.zc() / 8.177e-9 - 1.0).abs() < 1e-4,
        "{}",
        report.zc()
    );
    let chosen = &report.solutions[report.chosen];
    assert!(chosen.stable && chosen.observables.phase > 90.0);
    assert_eq!(chosen.observables.contact_fraction, 0.0);
    let repulsive = |s: &&nanotap::study::setpoint::SetpointSolution| s.stable && !s.reached;
    let other = report.solutions.iter().find(repulsive).unwrap();
    assert!((other.zc / 8.003e-9 - 1.0).abs() < 1e-4, "{}", other.zc);
    let table = report.solution_table();
    let shown = table.shown(0..table.rows);
    let heads: Vec<&str> = shown.heads.iter().map(|(head, ..)| head.as_str()).collect();
    assert_eq!(
        heads,
        ["gap.tip", "period", "phase (°)", "E_dis", "F_max", ""]
    );
    assert_eq!(shown.rows[report.chosen][5], "stable, reached on approach");
    let csv = table.csv();
    let heads = "gap.tip (m),period,phase (deg),E_dis (J),F_max (N),stable,reached";
    assert_eq!(csv.lines().next(), Some(heads));
    let [also] = &report.other_states[..] else {
        panic!("{} other states", report.other_states.len())
    };
    assert!(also.observables.phase < 90.0);
    assert!(
        report
            .remark()
            .text
            .contains("bistable: the lever may also be at A = ")
    );
}

/// The orbit at the setpoint's distance is that of the setpoint, not the repulsive one with A/A0 =
/// 0.944 and 70.8°, to which a run from rest converges.
#[test]
fn motions_start_from_the_orbit_at_the_setpoint() {
    let text = "\
[model]
modes=1
[cantilever]
k=\"2.8 N/m\"
f0=\"75 kHz\"
Q=200
[tip]
radius=\"10 nm\"
modulus=\"160 GPa\"
poisson=0.3
[sample]
law=\"dmt\"
modulus=\"1 GPa\"
poisson=0.3
hamaker=\"3e-20 J\"
intermolecular_distance=\"0.169 nm\"
[drive]
actuation=\"tip\"
frequency=\"75 kHz\"
free_amplitude=\"20 nm\"
setpoint=0.9
";
    let (at, solved) = at_setpoint(studied(text, &[]), &Control::default()).unwrap();
    let model = at.model().unwrap();
    let found = orbit(&model, &OrbitOptions::default()).unwrap();
    let scales = &at.physical().unwrap().scales;
    let ratio = found.observables.first_harmonic * scales.length / 20e-9;
    assert!((ratio - 0.9).abs() < 1e-6, "{ratio}");
    assert!(
        (found.observables.phase - 115.8).abs() < 0.1,
        "{}",
        found.observables.phase
    );
    let run = simulate(&model, &SimulateOptions::default()).unwrap();
    assert!((run.observables.phase - 115.8).abs() < 0.1);
    assert!(!solved.unwrap().other_states.is_empty());
    // Studies that compare motions are of this one, too.
    let control = Control::default();
    let options = ConvergenceOptions {
        largest: 2,
        ..ConvergenceOptions::default()
    };
    let compared = ConvergenceStudy::run(&at, &options, &control).unwrap();
    for motion in &compared.motions {
        let ratio = motion.tip_max.unwrap() / found.observables.tip_max;
        assert!((ratio - 1.0).abs() < 0.01, "{}: {ratio}", motion.modes);
    }
    let laws = ContactLawsStudy::run(&at, &ContactLawsOptions::default(), &control).unwrap();
    let own = laws.samples[0].orbit.as_ref().unwrap();
    assert!((own.observables.phase - found.observables.phase).abs() < 1e-6);
}

/// The search ends at its budget of steps and says how far it came; its result does not depend on the
/// number of threads.
#[test]
fn a_search_ends_at_its_budget_of_steps() {
    let case = studied(MICA, &["drive.setpoint=0.9"]);
    let mut ends = Vec::new();
    for steps in budgets().step_by(5) {
        let [alone, together] = limited(steps, |control| {
            solve_setpoint(&case, control).map(|report| (report.zc(), report.budget))
        });
        assert_eq!(alone, together, "{steps}");
        ends.push(alone);
    }
    let refused = ends[0].as_ref().unwrap_err();
    assert!(
        refused
            .message()
            .contains("up to the budget of 0.02 million steps, to gap.tip =")
    );
    let (zc, budget) = ends.last().unwrap().as_ref().unwrap();
    assert_eq!(*budget, None);
    // Whatever ends the search for other states, the distance is the same.
    for (reached, _) in ends.iter().flatten() {
        assert_eq!(reached.to_bits(), zc.to_bits());
    }
}

/// A budget that ends only the search for other states leaves the setpoint as it is, and says that
/// states may be missing.
#[test]
fn a_budget_may_end_only_the_search_for_other_states() {
    let text = include_str!("../../../../docs/cases/bistable-lever.toml");
    let case = studied(text, &["gap.tip=", "drive.setpoint=0.8"]);
    let whole = solve_setpoint(&case, &Control::default()).unwrap();
    assert!(whole.budget.is_none() && !whole.other_states.is_empty());
    // The way to the setpoint takes 1.3 million steps, the others 4.6 million.
    let [alone, together] = limited(2_000_000, |control| {
        let report = solve_setpoint(&case, control).unwrap();
        let remark = report.remark().text;
        (report.zc().to_bits(), report.budget, remark)
    });
    assert_eq!(alone, together);
    let (zc, budget, remark) = alone;
    assert_eq!(zc, whole.zc().to_bits());
    let reason = "the lever was followed up to the budget of 2 million steps";
    assert_eq!(budget.as_deref(), Some(reason));
    let said = format!("other states may be missing: {reason}");
    assert!(remark.ends_with(&said), "{remark}");
}

/// Two tones at 601/599 in which hundreds of taps graze in sequence: the exact flow ends at the
/// budget, too, and says how far it came.
#[test]
fn an_exact_search_ends_at_its_budget_of_steps() {
    let text = include_str!("../../../../docs/cases/moving-surface.toml");
    let two_tones = [
        "model.modes=1",
        "gap.tip=",
        "drive.setpoint=0.8",
        "drive.second_ratio=601/599",
        "drive.second_free_amplitude=30 nm",
    ];
    let case = studied(text, &two_tones);
    let [alone, together] = limited(3_000_000, |control| {
        solve_setpoint(&case, control).map_err(|e| e.message())
    });
    let [alone, together] = [alone, together].map(Result::unwrap_err);
    assert_eq!(alone, together);
    let reason = "up to the budget of 3 million steps, to gap.tip =";
    assert!(alone.contains(reason), "{alone}");
}

/// Near the first taps on a sticky surface that moves, the motion does not close while its amplitude
/// stays near A₀: the lever passes it on the way to 0.8 A₀, as a feedback loop does.
#[test]
fn motions_that_do_not_close_are_passed_above_the_setpoint() {
    let text = include_str!("../../../../docs/cases/moving-surface.toml");
    let case = studied(text, &["gap.tip=", "drive.setpoint=0.8"]);
    let report = solve_setpoint(&case, &Control::default()).unwrap();
    let there = studied(text, &[&format!("gap.tip={}", report.zc())]);
    let found = orbit(&there.model().unwrap(), &OrbitOptions::default()).unwrap();
    let amplitude = found.observables.first_harmonic * there.physical().unwrap().scales.length;
    assert!((amplitude / 24e-9 - 1.0).abs() < 1e-6, "{amplitude}");
    let refused = studied(text, &["gap.tip=", "drive.setpoint=0.998"]);
    let error = solve_setpoint(&refused, &Control::default()).unwrap_err();
    assert!(
        error.message().contains("before the setpoint A/A0 = 0.998"),
        "{}",
        error.message()
    );
}

/// A frequency shift is that of `fm`, reached first from far; the drive there keeps the free lever's
/// amplitude at 90°, and motions start from the orbit.
#[test]
fn a_frequency_shift_is_a_setpoint() {
    let text = include_str!("../../../../docs/cases/fm-polystyrene.toml");
    let case = studied(text, &["gap.tip=", "drive.setpoint=2 kHz"]);
    let (there, solved) = at_setpoint(case.clone(), &Control::default()).unwrap();
    let solved = solved.unwrap();
    let options = FrequencyModulationOptions {
        shift: Some("2 kHz".into()),
        ..FrequencyModulationOptions::default()
    };
    let curve = frequency_modulation(&case, &options, &Control::default()).unwrap();
    let found = curve.modulation.unwrap().setpoints.unwrap();
    // The same but for the damping, which the loss tangent gives at the frequency of the drive.
    assert!((solved.zc() / found[0].zc.unwrap() - 1.0).abs() < 0.01);
    let drive = solved.drive.unwrap();
    let view = there.physical().unwrap();
    let frequency = view.scales.frequency * view.cantilever.omega;
    assert!((frequency / drive.frequency - 1.0).abs() < 1e-12);
    let own = case.physical().unwrap().free_amplitude;
    let closed = orbit(&there.model().unwrap(), &OrbitOptions::default()).unwrap();
    let amplitude = closed.observables.first_harmonic * view.scales.length;
    assert!((amplitude / own - 1.0).abs() < 1e-8, "{amplitude} {own}");
    assert!(
        (closed.observables.phase - 90.0).abs() < 1e-5,
        "{}",
        closed.observables.phase
    );
    let said = solved.remark().text;
    assert!(
        said.starts_with("the frequency shift 2 kHz is reached"),
        "{said}"
    );
    let refused = studied(text, &["gap.tip=", "drive.setpoint=-20 Hz"]);
    let error = solve_setpoint(&refused, &Control::default()).unwrap_err();
    assert!(
        error.message().contains("is not reached on approach"),
        "{}",
        error.message()
    );
}

/// The orbits at a setpoint are those that are followed from another setpoint, stable and unstable.
#[test]
fn a_followed_state_is_the_one_at_the_setpoint() {
    let case = |setpoint: f64| {
        let words = [format!("drive.setpoint={setpoint}")];
        let file = Path::new("../../docs/cases/dforce-dmt.toml");
        Case::load(Some(file), &words, &Catalogue::shared()).unwrap()
    };
    let control = Control::default();
    let mut met = 0;
    for (from, to) in [(0.8, 0.75), (0.5, 0.6), (0.9, 0.93), (0.3, 0.29)] {
        let [before, after] =
            [from, to].map(|setpoint| solve_setpoint(&case(setpoint), &control).unwrap());
        for solution in &before.solutions {
            let near = NearOrbit {
                gap: solution.gap,
                period: solution.period,
                state: solution.state.clone(),
                stable: solution.stable,
            };
            let followed = orbit_at_setpoint(&case(to), &near).unwrap();
            let alike = |other: &&SetpointSolution| {
                other.stable == followed.stable
                    && (other.zc - followed.zc).abs() < 1e-9 * followed.zc
                    && (other.observables.phase - followed.observables.phase).abs() < 1e-6
            };
            let found = after.solutions.iter().filter(alike).count();
            assert_eq!(found, 1, "{from} to {to}: {}", followed.zc);
            assert!((followed.physical.observables.first_harmonic / 20e-9 - to).abs() < 1e-11);
            met += 1;
        }
    }
    // Two stable states and one between them at each setpoint.
    assert_eq!(met, 12);
    // The attractive state is no orbit near the unstable one.
    let first = &solve_setpoint(&case(0.8), &control).unwrap().solutions[0];
    let wrong = NearOrbit {
        gap: first.gap,
        period: first.period,
        state: first.state.clone(),
        stable: !first.stable,
    };
    assert!(orbit_at_setpoint(&case(0.8), &wrong).is_err());
}

/// The lever of the catalogue over polystyrene that attracts (DMT), three modes.
fn over_polystyrene(setpoint: &str) -> Case {
    let words = [
        "cantilever.lever=HQ:NSC14",
        "cantilever.Q=288.67",
        "sample.law=dmt",
        "sample.material=polystyrene",
        "sample.hamaker=7e-20 J",
        "drive.frequency_ratio=1",
        "drive.free_amplitude=10 nm",
        setpoint,
    ];
    let words = words.map(str::to_owned);
    Case::load(None, &words, &Catalogue::shared()).unwrap()
}

/// The approach passes from the free to the attractive state and never meets the repulsive one, which
/// `window` finds from random initial states at each of 28 distances between 8 and 10 nm.
#[test]
fn a_state_that_the_approach_does_not_meet_is_found() {
    let lever = over_polystyrene("drive.setpoint=0.9");
    let report = solve_setpoint(&lever, &Control::default()).unwrap();
    let stable = report.solutions.iter().filter(|s| s.stable);
    let found: Vec<(&str, f64)> = stable.map(|s| (s.branch, 1e9 * s.zc)).collect();
    let [("attractive", far), ("repulsive", near)] = found[..] else {
        panic!("{found:?}");
    };
    // Both to the digits that a window's report shows.
    assert!(
        (far - 9.414).abs() < 1e-3 && (near - 8.62).abs() < 5e-3,
        "{found:?}"
    );
    let repulsive = report
        .solutions
        .iter()
        .find(|s| s.branch == "repulsive" && s.stable);
    let there = lever.with(lever.gap_key(), repulsive.unwrap().gap);
    let options = OrbitOptions {
        state: Some(repulsive.unwrap().state.clone().into()),
        ..OrbitOptions::default()
    };
    let orbit = orbit(&there.model().unwrap(), &options).unwrap();
    let amplitude = orbit.observables.first_harmonic * lever.physical().unwrap().scales.length;
    assert!(
        orbit.stable && (amplitude / 9e-9 - 1.0).abs() < 1e-9,
        "{amplitude}"
    );
}

/// Far from the sample the amplitude hardly depends on the distance, so that rounding moves the distance
/// of a setpoint; an orbit that is found on two branches is one all the same.
#[test]
fn an_orbit_far_from_the_sample_is_listed_once() {
    let lever = over_polystyrene("drive.setpoint=0.999999");
    let report = solve_setpoint(&lever, &Control::default()).unwrap();
    let stable: Vec<f64> = report
        .solutions
        .iter()
        .filter(|s| s.stable)
        .map(|s| s.zc)
        .collect();
    for (k, one) in stable.iter().enumerate() {
        let others = &stable[k + 1..];
        assert!(
            others.iter().all(|other| (other / one - 1.0).abs() > 1e-3),
            "{stable:?}"
        );
    }
}
