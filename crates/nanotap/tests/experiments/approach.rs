//! Approach curves.

use nanotap::case::Case;
use nanotap::case::file::Source;
use nanotap::control::{CancelFlag, Control};
use nanotap::figure::approach::approach_figure;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::model_map::ModelMap;
use nanotap::study::approach::{
    ApproachOptions, ApproachPoint, ApproachReport, Way, approach, states_near,
};
use nanotap::study::simulate::{Classification, SimulateOptions, simulate};
use nanotap::study::threads::install;
use nanotap_dynamics::StroboscopicMap as _;
use nanotap_figures::Layer;

use super::branches::paper;

/// An NCHR-class lever of high Q on polystyrene, driven a little above its resonance.
pub(crate) const STIFF: &str = "\
[model]
modes = 2
[cantilever]
lever = \"PPP-NCHR\"
Q = 400
[tip]
radius = \"10 nm\"
[sample]
material = \"polystyrene\"
loss_tangent = 0.1
[drive]
frequency_ratio = 1.001
free_amplitude = \"20 nm\"
[gap]
tip = \"15 nm\"
";

pub(crate) fn studied(text: &str, set: &[&str]) -> Case {
    let source = Source {
        name: "case.toml".into(),
        text: text.into(),
    };
    let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
    Case::parse(Some(source), &set).unwrap()
}

fn curve(studied: &Case, options: &ApproachOptions) -> ApproachReport {
    approach(studied, options, &Control::default()).unwrap()
}

/// The free motion persists until the tip reaches the surface; on retract the tapping motion
/// persists until its fold, at a larger distance. Between the two both are stable, and their
/// difference is the hysteresis.
#[test]
fn a_stiff_lever_of_high_q_jumps_at_the_ends_of_its_branches() {
    let lever = studied(STIFF, &[]);
    let report = curve(&lever, &ApproachOptions::default());
    assert!(report.returned);
    let branches = report.branches.as_ref().unwrap();
    let fold = branches
        .bifurcations
        .iter()
        .filter(|b| b.kind == "fold")
        .map(|b| b.parameter)
        .fold(0.0, f64::max);
    assert!(fold > 1.1 * report.free_reach, "{fold}");
    for p in &report.table {
        let sight = p.observables.as_ref().unwrap();
        let taps = sight.contact_fraction > 0.0;
        let expected = match p.way {
            Way::Approach => p.gap < report.free_reach,
            Way::Retract | Way::Neither => p.gap < fold,
        };
        assert_eq!(taps, expected, "{:?} at {}", p.way, p.gap);
        if !taps {
            assert!((sight.first_harmonic / report.free_amplitude - 1.0).abs() < 1e-9);
        }
    }
    let [interval] = &report.hysteresis[..] else {
        panic!("{:?}", report.hysteresis);
    };
    assert!((interval.near / report.free_reach - 1.0).abs() < 1e-4);
    assert!((interval.far / fold - 1.0).abs() < 1e-9);
    let jumps: Vec<_> = report.jumps.iter().map(|j| (j.way, j.gap)).collect();
    assert_eq!(
        jumps,
        [(Way::Approach, interval.near), (Way::Retract, interval.far)]
    );
    // Every motion lies on a followed branch, between two of its points.
    let stable = |gap: f64, amplitude: f64| {
        branches.points.windows(2).any(|pair| {
            let (a, b) = (&pair[0], &pair[1]);
            let t = (gap - a.parameter) / (b.parameter - a.parameter);
            let between = a.observables.first_harmonic
                + t * (b.observables.first_harmonic - a.observables.first_harmonic);
            (0.0..=1.0).contains(&t) && (between / amplitude - 1.0).abs() < 1e-2
        })
    };
    for p in &report.table {
        let amplitude = p.observables.as_ref().unwrap().first_harmonic;
        assert!(stable(p.gap, amplitude), "{:?} {}", p.way, p.gap);
    }
}

/// Also where no orbit is found, as at Ω = 6.
#[test]
fn a_curve_does_not_depend_on_the_number_of_threads() {
    let unclosed = Case::from(Cantilever {
        omega: 6.0,
        ..Cantilever::paper()
    });
    let same = |case: &Case, points: usize| {
        let options = ApproachOptions {
            points,
            ..ApproachOptions::default()
        };
        let on = |threads: usize| install(Some(threads), || curve(case, &options)).unwrap();
        let alone = on(1);
        let written = serde_json::to_string(&alone).unwrap();
        for threads in [2, 3] {
            let together = serde_json::to_string(&on(threads)).unwrap();
            assert!(together == written, "{threads} threads, {points} points");
        }
        alone
    };
    let report = same(&studied(STIFF, &[]), 30);
    assert!(report.hysteresis.iter().any(|h| h.near < h.far));
    let report = same(&unclosed, 12);
    let count = report.table.iter().filter(|p| p.period.is_none()).count();
    assert!((2..24).contains(&count), "{count}");
}

/// Budgets of steps that end work in its first part, then in a later one, and then not at all.
pub(crate) fn budgets() -> impl Iterator<Item = u64> {
    (0..11).map(|k| 20_000 << k)
}

/// Results of work on one thread and on two that ends at a budget of steps.
pub(crate) fn limited<R: Send>(steps: u64, work: impl Fn(&Control<'_>) -> R + Sync) -> [R; 2] {
    [1, 2].map(|threads| {
        let flag = CancelFlag::default().with_budget(steps);
        let control = Control {
            cancel: Some(&flag),
            progress: None,
        };
        install(Some(threads), || work(&control)).unwrap()
    })
}

/// A curve under a nonlinear law ends at its budget of steps: while the lever is followed, or while
/// rows are measured. The report names the budget, and so does every row that is missing.
#[test]
fn a_curve_ends_at_its_budget_of_steps() {
    let case = studied(MICA, &["gap.tip=7.127 nm"]);
    let nm = 1e-9;
    let options = ApproachOptions {
        from: Some((12.0 * nm).into()),
        to: Some((4.0 * nm).into()),
        points: 300,
        branches: false,
        ..ApproachOptions::default()
    };
    let mut limits = Vec::new();
    for steps in budgets() {
        let [alone, together] =
            limited(steps, |control| approach(&case, &options, control).unwrap());
        let [a, b] = [&alone, &together].map(|report| serde_json::to_string(report).unwrap());
        assert!(a == b, "{steps}");
        assert!(!alone.cancelled && alone.table.len() == 600);
        let missing = alone.table.iter().filter_map(|row| row.reason.as_ref());
        let mut missing = missing.peekable();
        assert_eq!(missing.peek().is_some(), !alone.limits.is_empty());
        assert!(
            missing.all(|reason| alone.limits.contains(reason)),
            "{steps}"
        );
        limits.push(alone.limits);
    }
    assert_eq!(
        limits[0][0],
        "the lever was followed up to the budget of 0.02 million steps"
    );
    let rows = |limits: &&Vec<String>| limits.len() == 1 && limits[0].starts_with("the rows were");
    assert!(limits.iter().find(rows).is_some(), "{limits:?}");
    assert!(limits.last().unwrap().is_empty());
}

/// A few rows of a slow curve agree with runs whose distance changes by a thousandth of the free
/// amplitude every two decay times.
#[test]
fn a_coarse_curve_agrees_with_a_slow_run() {
    let case = studied(STIFF, &["cantilever.Q=200"]);
    let options = ApproachOptions {
        points: 9,
        branches: false,
        ..ApproachOptions::default()
    };
    let report = curve(&case, &options);
    assert!(!report.jumps.is_empty());
    let step = 1e-3 * report.free_amplitude;
    let mut state: Option<Vec<f64>> = None;
    let mut at = report.from;
    for p in &report.table {
        let steps = ((p.gap - at).abs() / step).ceil().max(1.0);
        let mut model = case.with(case.gap_key(), at).model().unwrap();
        let mut here = state.unwrap_or_else(|| vec![0.0; model.dimension()]);
        for k in 1..=steps as usize {
            let share = k as f64 / steps;
            let gap = at * (1.0 - share) + p.gap * share;
            model = case.with(case.gap_key(), gap).model().unwrap();
            ModelMap::new(&model).advance_by(&mut here, 120).unwrap();
        }
        let mut map = ModelMap::new(&model);
        map.advance_by(&mut here, 4000).unwrap();
        let run = SimulateOptions {
            state: Some(here.clone().into()),
            transient: Some(0),
            periods: 1,
            ..SimulateOptions::default()
        };
        let comes_to = simulate(&model, &run).unwrap().observables;
        let said = p.observables.as_ref().unwrap();
        let same = |a: f64, b: f64| (a - b).abs() < 1e-4 * b.abs() + 1e-9;
        assert!(
            same(said.first_harmonic, comes_to.first_harmonic)
                && same(said.contact_fraction, comes_to.contact_fraction),
            "{:?} at {}: {} and {}",
            p.way,
            p.gap,
            said.first_harmonic,
            comes_to.first_harmonic
        );
        (state, at) = (Some(here), p.gap);
    }
}

/// A lever on mica in air, in the attractive state from far.
pub(crate) const MICA: &str = "\
[model]
modes = 1
[cantilever]
lever = \"AC160TS\"
Q = 450
[sample]
material = \"mica\"
law = \"dmt\"
hamaker = \"1e-19 J\"
[drive]
frequency = \"300 kHz\"
free_amplitude = \"10 nm\"
";

/// A slow lever stays in the attractive state down to 4 nm and back, for any spacing of the rows: a
/// sweep in steps of 5 pm and two ramps agree. From 0 it returns in the repulsive state, up to the
/// fold at 10.03 nm.
#[test]
fn hysteresis_does_not_depend_on_the_spacing_of_rows() {
    let case = studied(MICA, &["gap.tip=7.127 nm"]);
    let nm = 1e-9;
    for points in [40, 80, 160] {
        let options = ApproachOptions {
            from: Some((12.0 * nm).into()),
            to: Some((4.0 * nm).into()),
            points,
            branches: false,
            ..ApproachOptions::default()
        };
        let report = curve(&case, &options);
        assert!(report.hysteresis.is_empty() && report.jumps.is_empty());
        let attractive = |p: &ApproachPoint| p.observables.unwrap().contact_fraction == 0.0;
        assert!(report.table.iter().all(attractive));
    }
    let ends = [5, 12].map(|points| {
        let options = ApproachOptions {
            points,
            branches: false,
            ..ApproachOptions::default()
        };
        let report = curve(&case, &options);
        (
            report.hysteresis.clone(),
            report.jumps.iter().map(|j| j.gap).collect::<Vec<_>>(),
        )
    });
    assert_eq!(ends[0], ends[1]);
    let farthest = &ends[0].0[0];
    let far = farthest.physical.as_ref().unwrap()["far"];
    assert!((far / nm - 10.0286).abs() < 1e-3, "{farthest:?}");
    let near = case.with(case.key("gap.tip").unwrap(), 6.0 * nm);
    let states = states_near(&near, 8, &Control::default()).unwrap();
    assert_eq!(states.len(), 2);
}

/// Under Lennard-Jones a step of the distance may lead into the repulsive wall; branches do not.
#[test]
fn a_curve_under_lennard_jones_is_never_undecided() {
    let text = MICA
        .replace(
            "material = \"mica\"\nlaw = \"dmt\"",
            "law = \"lennard-jones\"",
        )
        .replace("[drive]", "repulsion = \"1.9e-76 J m^6\"\n[drive]");
    let case = studied(&text, &["gap.tip=8 nm"]);
    let options = ApproachOptions {
        points: 25,
        branches: false,
        ..ApproachOptions::default()
    };
    let report = curve(&case, &options);
    assert_eq!(report.table.len(), 50);
    for p in &report.table {
        assert_eq!(
            p.classification,
            Classification::Periodic,
            "{} {:?}",
            p.gap,
            p.reason
        );
    }
}

/// The slower a lever of low quality factor is moved, the closer it is to the quasi-static curve:
/// the error is proportional to the speed.
#[test]
fn a_slow_ramp_is_the_quasi_static_curve() {
    let case = studied(STIFF, &["cantilever.Q=20"]);
    let period = case.model().unwrap().system.drive().period();
    let options = ApproachOptions {
        points: 6,
        branches: false,
        ..ApproachOptions::default()
    };
    let settled = curve(&case, &options);
    let velocity = case.physical().unwrap().scales.velocity;
    assert!(settled.jumps.is_empty() && settled.hysteresis.is_empty());
    let errors = [2000.0, 8000.0].map(|periods| {
        let speed = (settled.from - settled.to) / (periods * period);
        let ramp = curve(
            &case,
            &ApproachOptions {
                speed: Some((speed * velocity).into()),
                ..options.clone()
            },
        );
        let amplitude = |p: &ApproachPoint| p.observables.unwrap().first_harmonic;
        let rows = ramp.table.iter().zip(&settled.table).skip(1);
        rows.map(|(a, b)| {
            assert_eq!(
                (a.way, a.gap, a.classification),
                (b.way, b.gap, Classification::Transient)
            );
            (amplitude(a) - amplitude(b)).abs() / settled.free_amplitude
        })
        .fold(0.0, f64::max)
    });
    assert!(
        errors[1] < 2e-3 && errors[1] < 0.5 * errors[0],
        "{errors:?}"
    );
    let fast = ApproachOptions {
        speed: Some((velocity * settled.from / period).into()),
        ..options.clone()
    };
    let error = approach(&case, &fast, &Control::default()).unwrap_err();
    assert!(
        error.to_string().contains("less than a drive period"),
        "{error}"
    );
}

/// Steps of the distance bring the lever to a coexisting period 3. Moved slowly it stays with
/// period 1 in both directions, since no orbit of that branch loses stability.
#[test]
fn a_lever_stays_on_its_branch_while_that_is_stable() {
    let case = Cantilever {
        modes: 1,
        alpha1: 0.018,
        alpha3: 0.0236,
        alpha4: 53.55,
        alpha5: 0.2,
        alpha6: 0.0969,
        omega: 6.03,
        ..Cantilever::paper()
    };
    let options = ApproachOptions {
        points: 40,
        ..ApproachOptions::default()
    };
    let report = curve(&Case::from(case), &options);
    assert!(report.table.iter().all(|p| p.period == Some(1)));
    assert!(report.jumps.is_empty() && report.hysteresis.is_empty());
    let branches = report.branches.unwrap();
    assert!(branches.points.iter().all(|p| p.stable));
}

/// SI columns are the model's columns multiplied by the units of the case.
#[test]
fn a_physical_curve_is_reported_in_si() {
    let lever = studied(STIFF, &[]);
    let options = ApproachOptions {
        points: 12,
        branches: false,
        ..ApproachOptions::default()
    };
    let report = curve(&lever, &options);
    let resolved = lever.physical().unwrap();
    assert!((report.free_amplitude * resolved.scales.length / 20e-9 - 1.0).abs() < 1e-9);
    for p in &report.table {
        let (sight, si) = (
            p.observables.as_ref().unwrap(),
            p.physical.as_ref().unwrap(),
        );
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * b.abs();
        assert!(near(p.zc.unwrap(), p.gap * resolved.scales.length));
        assert!(near(
            si.observables.first_harmonic,
            sight.first_harmonic * resolved.scales.length
        ));
        assert!(near(
            si.amplitude_ratio,
            si.observables.first_harmonic / 20e-9
        ));
        assert!(near(
            si.observables.peak_force,
            sight.peak_force * resolved.scales.length * 42.0 / 3.0
        ));
    }
}

/// In the paper's case at Ω = 2.6 the motion is one chaotic band for a range of distances that
/// includes 0 (see the report of `nanotap paper`): it is reported as chaotic and described by a
/// recording.
#[test]
fn chaotic_motions_are_reported_as_chaotic() {
    let paper = Case::from(Cantilever::paper());
    let options = ApproachOptions {
        points: 4,
        branches: false,
        ..ApproachOptions::default()
    };
    let report = curve(&paper, &options);
    let at_zero = report.table.iter().filter(|p| p.gap == 0.0);
    for p in at_zero {
        assert_eq!(p.classification, Classification::Chaotic);
        assert!(p.period.is_none() && p.observables.unwrap().contact_fraction > 0.0);
    }
    assert_eq!(report.table.len(), 8);
}

/// On the way back the lever leaves a motion of period 5, which no branch follows, for the repulsive
/// branch: rows at 2 and 2.45 nm show phases of 177° and 6.6°. A long table does not take the steps
/// of the comparison.
#[test]
fn ways_that_differ_are_never_said_to_be_the_same() {
    let lever = studied(
        "[model]\nmodes = 2\n[cantilever]\nlever = \"PPP-FM\"\nQ = 180\n[sample]\nlaw = \"dmt\"\n\
         modulus = \"2 GPa\"\npoisson = 0.35\nhamaker = \"8e-20 J\"\n\
         intermolecular_distance = \"0.165 nm\"\n[drive]\nfrequency_ratio = 1\n\
         free_amplitude = \"30 nm\"\n[gap]\ntip = \"10 nm\"\n",
        &[],
    );
    let options = ApproachOptions {
        from: Some("11 nm".into()),
        to: Some("2 nm".into()),
        points: 21,
        branches: false,
        ..ApproachOptions::default()
    };
    let report = curve(&lever, &options);
    // Both ways are on no branch from 2 nm to the jump, and were not compared there.
    assert!(!report.compared);
    let nanometres = report.parameter_unit.as_ref().unwrap().si * 1e9;
    let [interval] = report.hysteresis.as_slice() else {
        panic!("{:?}", report.hysteresis);
    };
    let (near, far) = (nanometres * interval.near, nanometres * interval.far);
    assert!(
        (near - 2.04).abs() < 0.01 && (far - 11.0).abs() < 1e-9,
        "{near} {far}"
    );
    let back: Vec<_> = report
        .jumps
        .iter()
        .filter(|jump| jump.way == Way::Retract)
        .collect();
    let [jump] = back.as_slice() else {
        panic!("{:?}", report.jumps);
    };
    assert_eq!((jump.before.period, jump.after.period), (Some(5), Some(1)));
    let at = nanometres * jump.gap;
    assert!(at > 2.0 && at <= near + 1e-9, "{at}");
    let phase = |point: &ApproachPoint| point.observables.as_ref().unwrap().phase;
    assert!(phase(&jump.before) > 170.0 && phase(&jump.after) < 10.0);
}

/// Invalid requests are refused.
#[test]
fn invalid_curves_are_refused() {
    let lever = studied(STIFF, &[]);
    let refused = |options: ApproachOptions, words: &str| {
        let error = approach(&lever, &options, &Control::default()).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
    };
    let plain = ApproachOptions::default;
    refused(
        ApproachOptions {
            points: 1,
            ..plain()
        },
        "at least 2",
    );
    refused(
        ApproachOptions {
            max_period: 0,
            ..plain()
        },
        "at least 1",
    );
    for (from, to, words) in [
        (0.0, 1e-9, "from far to near"),
        (1e-9, 1e-9, "from far to near"),
        (f64::NAN, 0.0, "expected a length"),
        (f64::INFINITY, 0.0, "expected a length"),
    ] {
        let options = ApproachOptions {
            from: Some(from.into()),
            to: Some(to.into()),
            ..plain()
        };
        refused(options, words);
    }
    let still = studied(STIFF, &["drive.free_amplitude=0 nm"]);
    let error = approach(&still, &plain(), &Control::default()).unwrap_err();
    assert!(error.to_string().contains("does not move"), "{error}");
}

/// A tip 12 nm high on a very soft sample: the beam would touch the sample.
#[test]
fn contact_of_the_beam_is_detected() {
    let high = curve(
        &studied(STIFF, &[]),
        &ApproachOptions {
            points: 5,
            branches: false,
            ..ApproachOptions::default()
        },
    );
    // A tip of 12.5 µm, as in the catalogue for this lever.
    assert!(high.beam_clearance.unwrap() > 0.9);
    let soft = STIFF.replace(
        "material = \"polystyrene\"\nloss_tangent = 0.1",
        "stiffness = \"0.01 N/m\"",
    );
    let low = studied(&soft, &["tip.height=12 nm"]);
    let report = curve(
        &low,
        &ApproachOptions {
            points: 5,
            branches: false,
            ..ApproachOptions::default()
        },
    );
    assert!(
        report.beam_clearance.unwrap() < 0.0,
        "{:?}",
        report.beam_clearance
    );
}

/// The peak force of the paper's case at Ω = 20 is zero up to the grazing and rises like a root from
/// there: a branch drawn without this point would lie above zero in front of it.
#[test]
fn a_grazing_is_a_vertex_of_its_branch() {
    let case = studied(&paper(20.0, 3), &["alpha1=0"]);
    let report = curve(&case, &ApproachOptions::default());
    let grazing = &report.branches.as_ref().unwrap().bifurcations[0];
    assert_eq!(grazing.kind, "grazing");
    let figure = approach_figure(&report, &case.units());
    let forces = figure.panels.last().unwrap();
    let is_vertex = |layer: &Layer| match layer {
        Layer::Line(line) => line.points.contains(&(grazing.parameter, 0.0)),
        _ => false,
    };
    assert!(forces.layers.iter().any(is_vertex));
}
