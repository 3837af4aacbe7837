//! Sweeps over setpoints, and conditions on the motions at their points.

use std::path::Path;

use nanotap::case::physical::Catalogue;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::dataset::{Share, Store, Work};
use nanotap::figure::window::figure;
use nanotap::study::Computation as _;
use nanotap::study::setpoint::solve_setpoint;
use nanotap::study::sweep::{Summary, Sweep, SweepOptions};
use nanotap::study::target::Targets;
use nanotap::study::value::Axes;
use nanotap::study::window::{Condition, Window, WindowOptions};

use crate::folder::Folder;

/// A lever of one mode over a stiff sample.
fn lever(setpoint: &str) -> Case {
    let text = format!(
        "[model]\nmodes = 1\n[cantilever]\nlever = \"PPP-NCHR\"\nQ = 400\n[tip]\nradius = \"10 nm\"\n\
         [sample]\nmaterial = \"polystyrene\"\nloss_tangent = 0.1\n[drive]\nfrequency_ratio = 1\n\
         free_amplitude = \"20 nm\"\nsetpoint = {setpoint}\n"
    );
    let folder = Folder::new();
    let file = folder.join("case.toml");
    std::fs::write(&file, text).unwrap();
    Case::load(Some(&file), &[], &Catalogue::shared()).unwrap()
}

fn computed(sweep: &Sweep, folder: &Folder) -> Store {
    let store = Store::create_or_resume(&folder.join("s"), sweep.schema().clone()).unwrap();
    let control = Control::default();
    let work = Work {
        share: Share::WHOLE,
        threads: 2,
        control,
    };
    sweep.compute(&store, &work).unwrap();
    store
}

/// Each distance is that of the setpoint alone, the motion there has the setpoint's amplitude, and
/// conditions on it hold where they hold for the orbit of the setpoint.
#[test]
fn a_window_over_setpoints_solves_each_distance() {
    let case = lever("0.8");
    let amplitudes = [10e-9, 20e-9];
    let ratios = [0.6, 0.9];
    let options = |condition: &str| WindowOptions {
        over: Axes(vec![
            "drive.setpoint=0.6,0.9".to_owned(),
            "drive.free_amplitude=10nm,20nm".to_owned(),
        ]),
        starts: 4,
        targets: Targets(vec![condition.to_owned()]),
        ..WindowOptions::default()
    };
    let control = Control::default();
    let folder = Folder::new();
    let sweep = options("F_max < 10 nN").sweep(&case, &control).unwrap();
    let store = computed(&sweep, &folder);
    let window = Window::of(&store).unwrap();
    let targets = window.targets.as_ref().unwrap();
    let mut largest = Vec::new();
    for (row, amplitude) in amplitudes.iter().enumerate() {
        for (column, ratio) in ratios.iter().enumerate() {
            let alone = lever(&ratio.to_string()).with(Key::DriveFreeAmplitude, *amplitude);
            let alone = alone.with(Key::DriveSetpoint, *ratio);
            let solved = solve_setpoint(&alone, &control).unwrap();
            let distance = window.distances[row][column].unwrap();
            // The unit of length follows the distance where it is not held.
            assert!(
                (distance / solved.zc() - 1.0).abs() < 1e-6,
                "{distance} {}",
                solved.zc()
            );
            let force = solved.solutions[solved.chosen]
                .physical
                .observables
                .peak_force;
            largest.push(force);
            // Of two states both must meet the condition.
            let holds = targets.holds[row][column];
            assert!(!holds || force < 10e-9, "{force}");
            if window.conditions[row][column] == Condition::OnePeriod1 {
                assert_eq!(holds, force < 10e-9, "{force}");
            }
        }
    }
    // Larger amplitudes and lower setpoints press harder.
    assert!(
        largest[0] > largest[1] && largest[2] > largest[0],
        "{largest:?}"
    );
    assert!(targets.holds.concat().contains(&true) && targets.holds.concat().contains(&false));
    store
        .each(["first_harmonic", "distance"], |entry, [amplitude, _]| {
            let wanted = amplitudes[entry[0]] * ratios[entry[1]];
            assert!(
                (amplitude / wanted - 1.0).abs() < 1e-6,
                "{amplitude} {wanted}"
            );
        })
        .unwrap();
    // Another condition is evaluated on the same dataset.
    let sweep = options("F_max < 1 N").sweep(&case, &control).unwrap();
    let window = Window::of(&computed(&sweep, &folder)).unwrap();
    let found = window.targets.unwrap();
    assert_eq!(found.share, 1.0);
    let region = found.region.unwrap();
    assert_eq!((region.points, region.ranges[0]), (4, [0.6, 0.9]));
    assert!(figure(&store).unwrap().to_svg().unwrap().contains("F_max"));
}

/// No lever comes to a ten-thousandth of its free amplitude before the sample's own position.
#[test]
fn no_motion_is_reported_where_a_setpoint_is_not_reached() {
    let folder = Folder::new();
    let options = SweepOptions {
        targets: Targets(vec!["regime = repulsive".to_owned()]),
        periods: 2,
        ..SweepOptions::over(["drive.setpoint=1e-4,0.9"])
    };
    let sweep = Sweep::new(&lever("0.8"), options).unwrap();
    let summary = Summary::of(&computed(&sweep, &folder)).unwrap();
    assert_eq!(summary.targets.unwrap().holds, [[false, true]]);
    assert_eq!(summary.unreached.len(), 1);
    assert_eq!(summary.unreached[0].values, [1e-4]);
    assert!(summary.unreached[0].reason.contains("is not reached"));
    assert_eq!(
        (summary.counts["periodic"], summary.counts["undecided"]),
        (1, 1)
    );
}

/// Over silica with a free amplitude of 5 nm an attractive and a repulsive state coexist. Four starts
/// at each setpoint meet the repulsive one at 0.7 and 0.85 only; its branch leads to those between.
#[test]
fn the_branch_of_a_state_leads_to_other_setpoints() {
    let file = std::path::Path::new("../../docs/cases/force-limit-stiff.toml");
    let case = Case::load(Some(file), &[], &Catalogue::shared()).unwrap();
    let options = WindowOptions {
        over: Axes(vec![
            "drive.setpoint=0.7:0.85:4".to_owned(),
            "drive.free_amplitude=5nm:6nm:2".to_owned(),
        ]),
        starts: 4,
        ..WindowOptions::default()
    };
    let folder = Folder::new();
    let sweep = options.sweep(&case, &Control::default()).unwrap();
    let window = Window::of(&computed(&sweep, &folder)).unwrap();
    assert_eq!(window.conditions[0], [Condition::SecondState; 4]);
}

/// Setpoints that are peak forces, phases or amplitudes: the motion has what is held, at the distance
/// of the setpoint alone.
#[test]
fn peak_forces_phases_and_amplitudes_vary() {
    let case = lever("0.8");
    let control = Control::default();
    let reached = |over: &str, observable: &str| {
        let options = SweepOptions {
            periods: 2,
            ..SweepOptions::over([over])
        };
        let folder = Folder::new();
        let store = computed(&Sweep::new(&case, options).unwrap(), &folder);
        let mut found = Vec::new();
        store
            .each([observable, "distance"], |_, [value, distance]| {
                found.push((value, distance));
            })
            .unwrap();
        found
    };
    for (over, observable, setpoints, values) in [
        (
            "drive.setpoint=5nN:15nN:2",
            "peak_force",
            ["\"5 nN\"", "\"15 nN\""],
            [5e-9, 15e-9],
        ),
        (
            "drive.setpoint=60deg,75deg",
            "phase",
            ["\"60 deg\"", "\"75 deg\""],
            [60.0, 75.0],
        ),
        (
            "drive.setpoint=12nm:18nm:2",
            "first_harmonic",
            ["\"12 nm\"", "\"18 nm\""],
            [12e-9, 18e-9],
        ),
    ] {
        let found = reached(over, observable);
        assert_eq!(found.len(), 2);
        for (((value, distance), setpoint), wanted) in found.iter().zip(setpoints).zip(values) {
            assert!((value / wanted - 1.0).abs() < 1e-6, "{over}: {value}");
            let alone = solve_setpoint(&lever(setpoint), &control).unwrap();
            assert!(
                (distance / alone.zc() - 1.0).abs() < 1e-6,
                "{over}: {distance}"
            );
        }
    }
}

/// Frequency shifts that vary have the distance and the drive of each alone: there amplitude and phase
/// are those of the free lever at 90°.
#[test]
fn shifts_that_vary_are_those_of_each_alone() {
    let at = |setpoint: &str| {
        let file = Path::new("../../docs/cases/fm-polystyrene.toml");
        let words = ["gap.tip=", &format!("drive.setpoint={setpoint}")].map(str::to_owned);
        Case::load(Some(file), &words, &Catalogue::shared()).unwrap()
    };
    // The strength of the drive follows from the amplitude: it is not among what is held.
    let held = at("1 kHz").held(&[Key::DriveSetpoint]);
    assert!(!held.contains_key("drive.amplitude"), "{held:?}");
    let options = SweepOptions {
        periods: 2,
        ..SweepOptions::over(["drive.setpoint=1kHz,2kHz"])
    };
    let folder = Folder::new();
    let store = computed(&Sweep::new(&at("1 kHz"), options).unwrap(), &folder);
    let mut found = Vec::new();
    let wanted = ["first_harmonic", "phase", "distance"];
    store.each(wanted, |_, values| found.push(values)).unwrap();
    assert_eq!(found.len(), 2);
    for ([amplitude, phase, distance], setpoint) in found.into_iter().zip(["1 kHz", "2 kHz"]) {
        let case = at(setpoint);
        let alone = solve_setpoint(&case, &Control::default()).unwrap();
        assert!((distance / alone.zc() - 1.0).abs() < 1e-6, "{distance}");
        let free = case.physical().unwrap().free_amplitude;
        assert!((amplitude / free - 1.0).abs() < 1e-6, "{amplitude}");
        assert!((phase - 90.0).abs() < 1e-4, "{phase}");
    }
}

#[test]
fn wrong_setpoints_are_refused() {
    let refused = |over: &[&str], condition: Option<&str>| {
        let options = SweepOptions {
            targets: Targets(condition.map(str::to_owned).into_iter().collect()),
            ..SweepOptions::over(over.iter().copied())
        };
        Sweep::new(&lever("0.8"), options).unwrap_err().to_string()
    };
    for (over, condition, words) in [
        (&["drive.setpoint=0.5:1:3"][..], None, "above 0 and below 1"),
        (&["drive.setpoint=0.5,1nN"], None, "setpoints of one kind"),
        (&["drive.setpoint=10Hz,0.5"], None, "setpoints of one kind"),
        (&["drive.setpoint=-1nN:5nN:3"], None, "all above 0"),
        (
            &["drive.setpoint=15nm:25nm:3"],
            None,
            "below the free amplitude",
        ),
        (
            &["drive.setpoint=0.5:0.9:3", "gap.tip=5nm:9nm:3"],
            None,
            "solved for the distance",
        ),
        (
            &["drive.setpoint=0.5:0.9:3"],
            Some("states = 1"),
            "from one start",
        ),
        (
            &["drive.setpoint=0.5:0.9:3"],
            Some("F_max < 1 nm"),
            "a force",
        ),
    ] {
        let message = refused(over, condition);
        assert!(message.contains(words), "{over:?}: {message}");
    }
}
