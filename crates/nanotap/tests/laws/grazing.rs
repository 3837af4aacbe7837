//! Branches that end where an orbit grazes a switch of a law that remembers.

use nanotap::case::file::Source;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::map::Map;
use nanotap::study::branch::{BranchOptions, branch};

/// Over a water bridge a period-3 motion forms one in two periods of three. It ends upwards where
/// the tip begins to reach the film on the sample in the third, and downwards where it no longer
/// does in one of the others: either way an orbit turns just where the bridge forms, at twice the
/// film's thickness of 0.3 nm.
#[test]
fn a_branch_over_a_bridge_ends_where_its_orbit_turns_as_the_bridge_forms() {
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
            state: Some(vec![-0.000261168750597, -0.00149948655106, 0.0]),
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
