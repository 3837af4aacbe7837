//! Branches that end where an orbit grazes a switch of a law with memory.

use nanotap::case::file::Source;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::map::Map;
use nanotap::study::branch::{BranchOptions, branch};
use nanotap::study::value::Interval;

/// Over a water bridge a period-3 motion forms a bridge in two of three periods. The branch ends
/// upwards where the tip begins to reach the film on the sample in the third period, and downwards
/// where it no longer reaches it in one of the others. At either end a minimum of the gap equals
/// the distance at which the bridge forms, twice the film's thickness of 0.3 nm.
#[test]
fn a_branch_over_a_bridge_ends_where_its_orbit_grazes_the_bridge() {
    let text = include_str!("../../../../docs/cases/capillary-bridge.toml");
    let source = Source {
        name: "capillary-bridge.toml".into(),
        text: text.into(),
    };
    let case = Case::parse(Some(source), &[]).unwrap();
    let key = Key::find("gap.tip").unwrap();
    for (to, expected) in [(11e-9, 10.54257761e-9), (7e-9, 7.645193507e-9)] {
        let options = BranchOptions {
            period: Some(3),
            // Found by a census.
            state: Some(vec![-0.000261168750597, -0.00149948655106, 0.0].into()),
            ..BranchOptions::over(key, 10.5e-9, to)
        };
        let report = branch(&case, &options, &Control::default()).unwrap();
        assert!(report.failures.is_empty(), "{:?}", report.failures);
        assert!(report.branches[0].complete);
        let end = report.bifurcations.last().unwrap();
        assert_eq!(end.kind, "grazing");
        assert!(
            (end.parameter - expected).abs() < 1e-15,
            "{:e}",
            end.parameter
        );
        let here = case.with(key, end.parameter);
        let map = Map::new(&here).unwrap();
        let at = end.time.unwrap() * map.period();
        let turning = map
            .flow(&end.state, 0.0, 3.0 * map.period())
            .unwrap()
            .at(at);
        let length = here.physical().unwrap().scales.length;
        let [gap, rate] = [turning.gap * length, turning.tip_rate];
        assert!((gap - 0.6e-9).abs() < 1e-13, "{gap:e}");
        assert!(rate.abs() < 1e-5, "{rate:e}");
    }
}

/// On a soft sample under JKR, the tip snaps in exactly at drive phase 0 somewhere on the branch
/// between the two folds of the bistable region: neither an end nor a bifurcation. Seeds on both
/// stable parts are on one branch.
#[test]
fn a_branch_continues_where_a_neck_forms_at_drive_phase_0() {
    let words = [
        "modes=1",
        "cantilever.k=2.8 N/m",
        "cantilever.f0=75 kHz",
        "cantilever.Q=200",
        "tip.radius=10 nm",
        "sample.law=jkr",
        "sample.modulus=1 GPa",
        "sample.poisson=0.3",
        "sample.work_of_adhesion=30 mJ/m^2",
        "drive.actuation=tip",
        "drive.frequency=75 kHz",
        "drive.free_amplitude=20 nm",
        "gap.tip=18.5 nm",
    ];
    let words: Vec<String> = words.map(str::to_owned).into();
    let case = Case::parse(None, &words).unwrap();
    let key = Key::find("gap.tip").unwrap();
    let frequency = Key::find("drive.frequency").unwrap();
    let options = BranchOptions {
        second: Some(Interval::of_key(frequency, 74.8e3, 75.2e3)),
        ..BranchOptions::over(key, 18.5e-9, 22e-9)
    };
    let up = branch(&case, &options, &Control::default()).unwrap();
    assert!(up.failures.is_empty(), "{:?}", up.failures);
    let kinds: Vec<&str> = up.bifurcations.iter().map(|b| b.kind).collect();
    // Up to the fold, back along the saddles, whose neck vanishes at that phase, and out of the
    // range at its lower end.
    assert_eq!(kinds, ["fold"]);
    assert!((up.bifurcations[0].parameter - 19.1140744e-9).abs() < 1e-16);
    let memory = |k: usize| up.points[k].state[2];
    assert_eq!([memory(0), memory(up.points.len() - 1)], [1.0, 0.0]);
    assert_eq!(up.branches[0].range[0], 18.5e-9);
    // The curve of folds crosses that point, too.
    let curves = up.loci.unwrap().curves;
    assert_eq!(curves.len(), 1);
    assert_eq!(curves[0].ends, ["leaves the window"; 2]);
}
