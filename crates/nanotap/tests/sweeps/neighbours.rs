//! Continuation of orbits between neighbouring values of a sweep.

use nanotap::case::Case;
use nanotap::case::file::Source;
use nanotap::dataset::{Share, Store, Work};
use nanotap::study::Computation as _;
use nanotap::study::FreeMotion;
use nanotap::study::sweep::{Sweep, SweepOptions, from_neighbours};
use nanotap::study::value::Axes;
use nanotap::study::window::{Condition, Window, WindowOptions};
use nanotap_dynamics::Control;

use crate::folder::Folder;

fn case(text: &str) -> Case {
    let source = Source {
        name: "case.toml".into(),
        text: text.into(),
    };
    Case::parse(Some(source), &[]).unwrap()
}

fn how() -> Work<'static> {
    Work {
        share: Share::WHOLE,
        threads: 2,
        control: Control::default(),
    }
}

/// A lever of 42 N/m, 330 kHz and Q = 400 on polystyrene, 325 … 335 kHz, gaps of 2 … 25 nm. Where
/// the free motion does not reach the sample it exists and is stable, so no such point may be
/// reported as one tapping motion.
#[test]
fn no_window_reports_a_bistable_point_as_safe() {
    let lever = case(
        "[model]\nmodes = 2\n[cantilever]\nlever = \"PPP-NCHR\"\nQ = 400\n\
         [tip]\nradius = \"10 nm\"\n\
         [sample]\nmaterial = \"polystyrene\"\nloss_tangent = 0.1\n\
         [drive]\nfrequency_ratio = 1.001\nfree_amplitude = \"20 nm\"\n[gap]\ntip = \"15 nm\"\n",
    );
    let options = WindowOptions {
        over: Axes(vec![
            "drive.frequency=325kHz:335kHz:7".to_owned(),
            "gap.tip=2nm:25nm:12".to_owned(),
        ]),
        ..WindowOptions::default()
    };
    let sweep = options.sweep(&lever, &Control::default()).unwrap();
    let folder = Folder::new();
    let store = Store::create_or_resume(&folder.join("window"), sweep.schema().clone()).unwrap();
    sweep.compute(&store, &how()).unwrap();
    let window = Window::of(&store).unwrap();
    let [frequency, gap] = [0, 1].map(|k| sweep.over()[k].key);
    let mut safe = 0;
    for (row, &y) in window.conditions.iter().zip(&window.y) {
        for (condition, &x) in row.iter().zip(&window.x) {
            let here = lever.with(frequency, x).with(gap, y);
            let free = FreeMotion::of(&here.model().unwrap());
            let distance = y / here.physical().unwrap().scales.length;
            if *condition == Condition::OnePeriod1 {
                safe += 1;
                assert!(free.reach >= distance, "{x} Hz, {y} m");
            }
        }
    }
    assert!(safe > 10, "{safe} points are safe");
}

/// Stable orbits of period 3 exist between Ω = 3.109 and 3.180 in addition to chaos and period 1.
/// With two starts per value few reach them, and yet every value in between has one.
#[test]
fn a_sweep_continues_orbits_to_neighbouring_values() {
    let paper = case(
        "[model]\nmodes = 3\nalpha1 = 0.1\nalpha2 = 0.1\nalpha3 = 0.1\nalpha4 = 20.0\n\
         alpha5 = 0.0\nalpha6 = 0.2\nomega = 3.0\n",
    );
    let options = SweepOptions {
        starts: Some(12),
        periods: 3,
        ..SweepOptions::over(["omega=3.115:3.175:13"])
    };
    let sweep = Sweep::new(&paper, options).unwrap();
    let folder = Folder::new();
    let store = Store::create_or_resume(&folder.join("sweep"), sweep.schema().clone()).unwrap();
    sweep.compute(&store, &how()).unwrap();
    let table = nanotap::figure::sweep::SweepTable::of(&store).unwrap();
    let met: Vec<bool> = table
        .period
        .chunks(12)
        .map(|runs| runs.contains(&3))
        .collect();
    let more = from_neighbours(&store).unwrap();
    let known = |k: usize| met[k] || more.iter().any(|m| m.at == [k] && m.period == 3);
    assert!(met.contains(&true) && met.contains(&false), "{met:?}");
    assert!((0..13).all(known), "{met:?}");
    // A motion that a start reached is not listed again.
    assert!(more.iter().all(|m| m.period != 3 || !met[m.at[0]]));
}

/// At 10 nm the repulsive state exists in addition to the attractive one, which a start from rest reaches.
/// Values of the amplitude below 2 nm, at which the tip hardly feels the sample, do not lead to it: the
/// approach at 10 nm does, however many other values there are.
#[test]
fn the_number_of_values_does_not_change_what_is_found_at_one() {
    let lever = case(include_str!("../../../../docs/cases/bistable-lever.toml"));
    let last = |amplitudes: &str| {
        let options = WindowOptions {
            over: Axes(vec![
                "gap.tip=9.2nm:9.8nm:3".to_owned(),
                format!("drive.free_amplitude={amplitudes},10nm"),
            ]),
            starts: 1,
            ..WindowOptions::default()
        };
        let sweep = options.sweep(&lever, &Control::default()).unwrap();
        let folder = Folder::new();
        let store = Store::create_or_resume(&folder.join("w"), sweep.schema().clone()).unwrap();
        sweep.compute(&store, &how()).unwrap();
        Window::of(&store).unwrap().conditions.pop().unwrap()
    };
    let many: Vec<String> = (0..17)
        .map(|k| format!("{:.2}nm", 1.0 + 0.05 * f64::from(k)))
        .collect();
    assert_eq!(last("1.8nm"), [Condition::SecondState; 3]);
    assert_eq!(last(&many.join(",")), [Condition::SecondState; 3]);
}
