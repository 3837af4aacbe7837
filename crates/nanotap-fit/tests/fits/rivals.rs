//! Other minima that describe the data, and what decides.

use nanotap_dynamics::random::Random;

use super::{case, fitted, options, parameter, table, tapping};
use nanotap_case::table::Table;
use nanotap_fit::fit::{FitOptions, FitReport};
use nanotap_motions::approach::Way;

/// A lever over an attracting sample.
const LEVER: &str = "[model]\nmodes = 1\n[cantilever]\nk = \"0.8736193621040327 N/m\"\nf0 = \"100 kHz\"\n\
     Q = 200\n[tip]\nradius = \"5 nm\"\n[sample]\nlaw = \"dmt\"\npoisson = 0.3\nmodulus = \"1 GPa\"\n\
     hamaker = \"3e-20 J\"\nintermolecular_distance = \"0.169 nm\"\n[drive]\nactuation = \"tip\"\n\
     frequency = \"100 kHz\"\nfree_amplitude = \"20 nm\"\n[gap]\ntip = \"18 nm\"\n";

/// 10 rows each way on the attractive branch, with noise of 0.03 nm and, with a phase, 0.1°.
fn record(with_phase: bool) -> Table {
    let rows = tapping(&case(LEVER, &[]), 24.0, 13.0, 10);
    let mut noise = Random::new(5);
    let amplitude: Vec<f64> = rows
        .iter()
        .map(|row| row.1 + 0.03 * noise.normal())
        .collect();
    let phase: Vec<f64> = rows
        .iter()
        .map(|row| row.2 + 0.1 * noise.normal())
        .collect();
    let mut columns = vec![
        ("distance (nm)", rows.iter().map(|row| row.0).collect()),
        ("amplitude (nm)", amplitude),
    ];
    if with_phase {
        columns.push(("phase (deg)", phase));
    }
    let ways: Vec<Way> = rows.iter().map(|row| row.3).collect();
    table(columns, &ways)
}

fn found(with_phase: bool, profile: bool, evaluations: usize) -> FitReport {
    let free = ["sample.modulus", "sample.hamaker", "gap.offset"];
    let request = FitOptions {
        profile,
        rivals: true,
        evaluations: Some(evaluations),
        ..options(record(with_phase), &free)
    };
    let start = case(LEVER, &["sample.modulus=0.5 GPa", "sample.hamaker=1e-20 J"]);
    fitted(&start, &request)
}

#[test]
fn an_amplitude_alone_has_two_minima_and_the_phase_decides() {
    // An attractive motion over 30 zJ, and a repulsive one over a tenth of it, have amplitudes that
    // differ by less than the noise; their phases are on either side of 90°.
    let report = found(false, false, 1000);
    assert!(report.fits, "{:?}", report.reason);
    let rival = report.rivals.first().expect("a rival");
    let other = rival.parameters.iter().find(|p| p.key == "sample.hamaker");
    let mut both = [
        parameter(&report, "sample.hamaker").value,
        other.unwrap().value,
    ];
    both.sort_by(f64::total_cmp);
    assert!(
        both[0] < 6e-21 && (2.2e-20..3.8e-20).contains(&both[1]),
        "{both:?}"
    );
    assert_eq!(rival.decides.as_deref(), Some("phase"), "{}", rival.words);
    let report = found(true, false, 1000);
    assert!(report.rivals.is_empty(), "{:?}", report.rivals);
    let hamaker = parameter(&report, "sample.hamaker");
    let error = hamaker.standard_error.unwrap();
    assert!((hamaker.value - 3e-20).abs() < 4.0 * error, "{hamaker:?}");
}

#[test]
fn a_search_that_ends_early_says_so() {
    let report = found(false, true, 1);
    let said = |text: &str| report.remarks.iter().any(|remark| remark.contains(text));
    assert!(
        said("other minima") && said("intervals") && said("evaluations"),
        "{:?}",
        report.remarks
    );
    // The intervals are those of the standard errors.
    let offset = parameter(&report, "gap.offset");
    let half = 2.2 * offset.standard_error.unwrap();
    let [low, high] = offset.interval.map(|end| end.unwrap());
    assert!(
        high - low < 2.0 * half && low < offset.value && offset.value < high,
        "{offset:?}"
    );
}
