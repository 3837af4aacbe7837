//! Criteria of compared laws.

use nanotap_dynamics::random::Random;

use super::{case, fitted, options, table, tapping};
use nanotap_fit::fit::FitOptions;
use nanotap_motions::approach::Way;

/// A lever over an attracting sample, at whose jump one law has an orbit and the other has none.
const LEVER: &str = "[model]\nmodes = 1\n[cantilever]\nk = \"40 N/m\"\nf0 = \"325 kHz\"\nQ = 50\n[tip]\n\
     radius = \"20 nm\"\nmodulus = \"170 GPa\"\npoisson = 0.28\n[sample]\nlaw = \"dmt\"\n\
     modulus = \"2 GPa\"\npoisson = 0.3\nhamaker = \"1.5e-19 J\"\n[drive]\nactuation = \"tip\"\n\
     frequency_ratio = 1\nfree_amplitude = \"20 nm\"\n[gap]\ntip = \"15 nm\"\n";

#[test]
fn rows_without_an_orbit_do_not_decide_between_laws() {
    let truth = case(LEVER, &[]);
    let rows = tapping(&truth, 18.0, 6.0, 13);
    let rows: Vec<_> = rows
        .into_iter()
        .filter(|row| row.3 == Way::Approach)
        .collect();
    let mut noise = Random::new(31);
    let mut amplitude: Vec<f64> = rows
        .iter()
        .map(|row| row.1 + 0.01 * noise.normal())
        .collect();
    let mut distance: Vec<f64> = rows.iter().map(|row| row.0).collect();
    let mut phase: Vec<f64> = rows
        .iter()
        .map(|row| row.2 + 0.05 * noise.normal())
        .collect();
    let mut ways: Vec<Way> = rows.iter().map(|row| row.3).collect();
    // A position at which no law has an orbit: the lever is deep in the sample.
    distance.push(-4000.0);
    amplitude.push(1.0);
    phase.push(170.0);
    ways.push(Way::Approach);
    let columns = vec![
        ("distance (nm)", distance),
        ("amplitude (nm)", amplitude),
        ("phase (deg)", phase),
    ];
    let request = FitOptions {
        laws: vec!["hertz, dmt".to_owned()],
        ..options(table(columns, &ways), &["sample.modulus", "sample.hamaker"])
    };
    let report = fitted(&truth, &request);
    assert_eq!(report.law.as_deref(), Some("dmt"));
    for law in &report.laws {
        let lost = law.rows_without_orbit.unwrap();
        // The criterion is that of some twenty values with small residuals: not of a lost row.
        assert!(lost >= 1 && law.aic.unwrap().abs() < 5e3, "{law:?}");
    }
    let said = |text: &str| report.remarks.iter().any(|remark| remark.contains(text));
    assert!(said("rows without an orbit"), "{:?}", report.remarks);
}
