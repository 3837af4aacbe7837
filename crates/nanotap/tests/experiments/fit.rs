//! Fits of simulated data with noise: the true parameters must be recovered.

use nanotap::case::Case;
use nanotap::case::file::Source;
use nanotap::control::Control;
use nanotap::model::model_map::ModelMap;
use nanotap::observe::{ObservableSet, measure};
use nanotap::study::approach::{ApproachOptions, Way, approach};
use nanotap::study::fit::{
    Data, Entry, FitOptions, FitReport, FittedParameter, Table, fit, residuals,
};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap_dynamics::random::Random;
use nanotap_dynamics::{ClassifyOptions, MotionKind, classify};

/// A stiff lever a little above its resonance: two motions at one distance.
const LEVER: &str = "[model]\nmodes = 2\n[cantilever]\nk = \"42 N/m\"\nf0 = \"330 kHz\"\nQ = 400\n\
     [sample]\nstiffness = \"30 N/m\"\nloss_tangent = 0.1\n[drive]\nfrequency_ratio = 1.001\n\
     free_amplitude = \"20 nm\"\n[gap]\ntip = \"15 nm\"\n";

fn case(text: &str, overrides: &[&str]) -> Case {
    let source = Source {
        name: "lever.toml".into(),
        text: text.into(),
    };
    let words: Vec<String> = overrides.iter().map(|word| (*word).to_owned()).collect();
    Case::parse(Some(source), &words).unwrap()
}

/// Distance (nm), amplitude (nm), phase (deg) and direction of an approach curve, without noise.
pub(crate) fn curve(case: &Case, from: f64, to: f64, points: usize) -> Vec<(f64, f64, f64, Way)> {
    let options = ApproachOptions {
        from: Some((from * 1e-9).into()),
        to: Some((to * 1e-9).into()),
        points,
        branches: false,
        ..ApproachOptions::default()
    };
    let report = approach(case, &options, &Control::default()).unwrap();
    let row = |p: &nanotap::study::approach::ApproachPoint| {
        let seen = &p.physical.as_ref().unwrap().observables;
        let (amplitude, phase) = (seen.first_harmonic * 1e9, seen.phase);
        (p.zc.unwrap() * 1e9, amplitude, phase, p.way)
    };
    report.table.iter().map(row).collect()
}

/// The same as a table, with noise of these sizes, which the table states if `stated`.
pub(crate) fn measured(
    curve: &[(f64, f64, f64, Way)],
    noise: &mut Random,
    [of_amplitude, of_phase]: [f64; 2],
    stated: bool,
) -> Table {
    let mut columns = vec![
        ("distance (nm)".to_owned(), Vec::new()),
        ("amplitude (nm)".to_owned(), Vec::new()),
        ("phase (deg)".to_owned(), Vec::new()),
        ("direction".to_owned(), Vec::new()),
        ("amplitude error (nm)".to_owned(), Vec::new()),
        ("phase error (deg)".to_owned(), Vec::new()),
    ];
    for (distance, amplitude, phase, way) in curve {
        let row = [
            Entry::Number(*distance),
            Entry::Number(amplitude + of_amplitude * noise.normal()),
            Entry::Number(phase + of_phase * noise.normal()),
            Entry::Text(way.name().to_owned()),
            Entry::Number(of_amplitude),
            Entry::Number(of_phase),
        ];
        for ((_, column), entry) in columns.iter_mut().zip(row) {
            column.push(entry);
        }
    }
    if !stated {
        columns.truncate(4);
    }
    Table {
        name: "curve".to_owned(),
        columns,
        ..Table::default()
    }
}

/// A request for values and their standard errors, without the profiles, which take most of the time.
fn request(tables: Vec<Table>, free: &[&str]) -> FitOptions {
    FitOptions {
        data: tables,
        free: free.iter().map(|name| (*name).to_owned()).collect(),
        profile: false,
        ..FitOptions::default()
    }
}

/// A request for intervals from profiles as well.
fn profiled(tables: Vec<Table>, free: &[&str]) -> FitOptions {
    FitOptions {
        profile: true,
        ..request(tables, free)
    }
}

fn fitted(case: &Case, request: &FitOptions) -> FitReport {
    fit(case, request, &Control::default()).unwrap()
}

const FREE: [&str; 3] = ["sample.stiffness", "sample.loss_tangent", "gap.offset"];
const TRUE: [f64; 3] = [30.0, 0.1, 0.0];

/// Number of the 95 % intervals of `repetitions` fits that contain the true values; `table` creates
/// the data of one repetition.
fn covered(
    repetitions: u64,
    start: &Case,
    jumps: bool,
    table: impl Fn(&mut Random) -> Table + Sync,
) -> [usize; 3] {
    let one = |repetition: u64| {
        let table = table(&mut Random::new(1000 + repetition));
        let asked = FitOptions {
            jumps,
            ..profiled(vec![table], &FREE)
        };
        let report = fitted(start, &asked);
        assert!(report.fits, "{repetition}: {:?}", report.reason);
        let holds = |(parameter, truth): (&FittedParameter, f64)| {
            let [low, high] = parameter.interval;
            usize::from(low.is_none_or(|low| low <= truth) && high.is_none_or(|high| truth <= high))
        };
        let mut all = report.parameters.iter().zip(TRUE).map(holds);
        [(); 3].map(|()| all.next().unwrap())
    };
    let all = (0..repetitions).map(one);
    all.fold([0; 3], |sum, one| std::array::from_fn(|k| sum[k] + one[k]))
}

/// With rows on one branch.
fn covered_tapping(repetitions: u64, stated: bool) -> [usize; 3] {
    let truth = case(LEVER, &[]);
    let start = case(
        LEVER,
        &["sample.stiffness=22 N/m", "sample.loss_tangent=0.12"],
    );
    let curve = curve(&truth, 19.0, 2.0, 12);
    covered(repetitions, &start, true, |noise| {
        measured(&curve, noise, [0.05, 0.2], stated)
    })
}

/// Rows on both branches, approach and retract, 0.8 nm apart, from a random offset: the jumps are
/// not in the middle between two rows.
fn both_branches(dense: &[(f64, f64, f64, Way)], noise: &mut Random) -> Table {
    const APART: usize = 40;
    let mut rows = Vec::new();
    for way in [Way::Approach, Way::Retract] {
        let from = (noise.uniform() * APART as f64) as usize;
        let of_way = dense.iter().filter(|row| row.3 == way);
        rows.extend(of_way.skip(from).step_by(APART).copied());
    }
    measured(&rows, noise, [0.1, 0.5], true)
}

/// The curve from which the rows are taken.
fn densely() -> Vec<(f64, f64, f64, Way)> {
    curve(&case(LEVER, &[]), 25.0, 12.0, 651)
}

/// With such rows, at another offset in each repetition.
fn covered_with_jumps(repetitions: u64, jumps: bool) -> [usize; 3] {
    let start = case(LEVER, &["sample.stiffness=24 N/m"]);
    let dense = densely();
    covered(repetitions, &start, jumps, |noise| {
        both_branches(&dense, noise)
    })
}

/// Between a soft sample at the true distance and a nearly rigid one 0.7 nm further away there is a
/// flat valley with two minima. In this repetition the fit ended in the wrong one, with chi2 =
/// 76.5; at the true distance chi2 is 67.07.
#[test]
fn a_fit_continues_from_a_lower_chi2_of_its_profile() {
    let start = case(LEVER, &["sample.stiffness=24 N/m"]);
    let table = both_branches(&densely(), &mut Random::new(1015));
    let report = fitted(&start, &profiled(vec![table], &FREE));
    assert_eq!(report.jumps.len(), 2);
    assert!(report.chi2 < 67.08, "{}", report.chi2);
    for (parameter, truth) in report.parameters.iter().zip(TRUE) {
        let [low, high] = parameter.interval.map(Option::unwrap);
        assert!((low..=high).contains(&truth), "{low} {truth} {high}");
    }
}

#[test]
fn intervals_contain_the_true_values_at_the_stated_rate() {
    // Of 24 intervals at 95 %, fewer than 19 contain it once in 1000 repetitions (binomial).
    for held in covered_tapping(24, true) {
        assert!(held >= 19, "{held} of 24");
    }
}

/// In the narrow, curved valley between stiffness and distance: with the Jacobian of the best
/// values alone, 86 of 100 intervals of the distance contained the true value.
#[test]
fn intervals_contain_the_true_values_in_a_curved_valley() {
    // Of 8 intervals at 95 %, fewer than 5 contain it once in 2700 repetitions (binomial).
    for held in covered_with_jumps(8, false) {
        assert!(held >= 5, "{held} of 8");
    }
}

#[test]
#[ignore = "400 fits, four times: some 20 minutes"]
fn intervals_contain_the_true_values_in_95_of_100_repetitions() {
    for kind in [true, false] {
        let stated = covered_tapping(400, kind);
        println!("one branch, errors stated {kind}: {stated:?} of 400");
        let jumps = covered_with_jumps(400, kind);
        println!("both branches, jumps counted {kind}: {jumps:?} of 400");
        for held in stated.into_iter().chain(jumps) {
            assert!((372..=388).contains(&held), "{held} of 400");
        }
    }
}

#[test]
fn rows_are_assigned_to_the_branch_of_the_data() {
    let truth = case(LEVER, &[]);
    let curve = curve(&truth, 25.0, 10.0, 31);
    let table = measured(&curve, &mut Random::new(7), [0.05, 0.2], true);
    // Initial parameters for which the tapping branch ends elsewhere.
    let start = case(
        LEVER,
        &["sample.stiffness=15 N/m", "sample.loss_tangent=0.15"],
    );
    let report = fitted(&start, &request(vec![table], &FREE));
    assert!(
        report.fits && report.remarks.is_empty(),
        "{:?}",
        report.remarks
    );
    let branch = |way: Way, above: f64| {
        let rows = report.rows.iter().filter(|r| r.way == Some(way));
        let found = rows.filter(|r| r.at > above - 0.3e-9 && r.at < above + 0.3e-9);
        found.map(|r| r.branch.unwrap()).next().unwrap()
    };
    // At 22 nm the lever oscillates freely on approach and taps on retract
    // (docs/cases/approach-curve.md).
    let [free, tapping] = [Way::Approach, Way::Retract].map(|way| branch(way, 22e-9));
    assert_ne!(free, tapping);
    assert_eq!(branch(Way::Approach, 15e-9), tapping);
    assert_eq!(branch(Way::Retract, 25e-9), free);
    for (parameter, truth) in report.parameters.iter().zip(TRUE) {
        let error = parameter.standard_error.unwrap();
        assert!(
            (parameter.value - truth).abs() < 4.0 * error,
            "{parameter:?}"
        );
    }
}

/// The rows at 19.98 and 23.16 nm are 0.01 nm before the ends of the free branch (on approach,
/// between 19.98 and 19.96 nm) and of the tapping one (on retract, between 23.16 and 23.18 nm,
/// according to `approach`). With slightly different parameters a branch ends before its row, which
/// must not be assigned to the other branch then.
#[test]
fn a_row_at_the_end_of_its_branch_does_not_bias_the_fit() {
    let truth = case(LEVER, &[]);
    let curve = curve(&truth, 24.75, 12.03, 25);
    let start = case(LEVER, &["sample.stiffness=24 N/m"]);
    for seed in 100..106 {
        let table = measured(&curve, &mut Random::new(seed), [0.1, 0.5], true);
        let report = fitted(&start, &request(vec![table], &FREE));
        assert!(report.fits, "{seed}: {:?}", report.reason);
        assert_eq!(report.jumps.len(), 2, "{seed}");
        for (parameter, truth) in report.parameters.iter().zip(TRUE) {
            let error = parameter.standard_error.unwrap();
            assert!(
                (parameter.value - truth).abs() < 4.0 * error,
                "{seed}: {parameter:?}"
            );
        }
    }
}

#[test]
fn the_location_of_a_jump_is_a_datum() {
    let truth = case(LEVER, &[]);
    let curve = curve(&truth, 25.0, 12.0, 53);
    let table = measured(&curve, &mut Random::new(17), [0.1, 0.5], true);
    let start = case(LEVER, &["sample.stiffness=24 N/m"]);
    let with = request(vec![table], &FREE);
    let without = FitOptions {
        jumps: false,
        ..with.clone()
    };
    let [with, without] = [with, without].map(|request| fitted(&start, &request));
    assert!(with.fits && without.jumps.is_empty(), "{:?}", with.reason);
    // Into contact on approach, out of it on retract, each between two rows 0.25 nm apart.
    assert_eq!(with.jumps.len(), 2);
    for jump in &with.jumps {
        let [a, b] = jump.between;
        let (low, high) = (a.min(b) - 0.1e-9, a.max(b) + 0.1e-9);
        assert!(low < jump.fold && jump.fold < high, "{jump:?}");
        assert!(jump.residual.abs() < 3.0, "{jump:?}");
    }
    for report in [&with, &without] {
        let rows = report.rows.iter().filter(|row| row.branch.is_some());
        let measured = 2 * rows.count() + report.jumps.len();
        assert_eq!(report.degrees_of_freedom, measured - FREE.len());
    }
    for (k, truth) in TRUE.iter().enumerate() {
        let [a, b] = [&with, &without].map(|report| &report.parameters[k]);
        let error = a.standard_error.unwrap();
        assert!((a.value - truth).abs() < 4.0 * error, "{a:?}");
        assert!(
            error <= b.standard_error.unwrap() * (1.0 + 1e-9),
            "{a:?} {b:?}"
        );
    }
}

#[test]
fn a_free_amplitude_is_fitted_to_resonance_curves() {
    // From below the resonance, where the lever oscillates freely.
    let truth = case(LEVER, &["drive.free_amplitude=22 nm", "cantilever.Q=380"]);
    let rows = [0.990, 0.993, 0.995, 0.996, 0.9965];
    let frequencies: Vec<f64> = rows.iter().map(|ratio| ratio * 330e3).collect();
    let mut noise = Random::new(41);
    let (mut amplitude, mut phase) = (Vec::new(), Vec::new());
    for frequency in &frequencies {
        let key = truth.key("drive.frequency").unwrap();
        let there = truth.with(key, *frequency);
        let options = OrbitOptions::default();
        let seen = orbit(&there.model().unwrap(), &options).unwrap();
        let view = there.physical().unwrap();
        let seen = seen.observables.in_si(&view.scales);
        amplitude.push(Entry::Number(
            1e9 * seen.first_harmonic + 0.01 * noise.normal(),
        ));
        phase.push(Entry::Number(seen.phase + 0.05 * noise.normal()));
    }
    let frequency = frequencies.iter().map(|f| Entry::Number(1e-3 * f));
    let table = Table {
        name: "resonance".to_owned(),
        columns: vec![
            ("frequency (kHz)".to_owned(), frequency.collect()),
            ("amplitude (nm)".to_owned(), amplitude),
            ("phase (deg)".to_owned(), phase),
        ],
        ..Table::default()
    };
    let start = case(LEVER, &[]);
    let request = request(vec![table], &["drive.free_amplitude", "cantilever.Q"]);
    derivatives_are_right(&start, &request, &[21e-9, 390.0], &[1e-12, 0.05], 1e-6);
    let report = fitted(&start, &request);
    assert!(report.fits, "{:?}", report.reason);
    for (parameter, truth) in report.parameters.iter().zip([22e-9, 380.0]) {
        let error = parameter.standard_error.unwrap();
        assert!(
            (parameter.value - truth).abs() < 5.0 * error,
            "{parameter:?}"
        );
    }
}

/// Amplitude and phase against the drive frequency 15 nm above the sample, swept up and down: the
/// lever oscillates freely far from resonance and taps near it; over 1.6 kHz both motions are
/// stable (docs/cases/frequency-sweep.md).
#[test]
fn a_resonance_curve_is_fitted_with_both_branches() {
    let truth = case(LEVER, &[]);
    let key = truth.key("drive.frequency").unwrap();
    let frequencies: Vec<f64> = (0..19).map(|k| 327e3 + 500.0 * f64::from(k)).collect();
    let mut columns: Vec<(String, Vec<Entry>)> = [
        "frequency (kHz)",
        "amplitude (nm)",
        "phase (deg)",
        "direction",
        "amplitude error (nm)",
        "phase error (deg)",
    ]
    .map(|name| (name.to_owned(), Vec::new()))
    .to_vec();
    let mut noise = Random::new(61);
    let mut state = vec![0.0; truth.model().unwrap().dimension()];
    let down = frequencies.iter().rev().map(|f| (*f, "down"));
    for (frequency, direction) in frequencies.iter().map(|f| (*f, "up")).chain(down) {
        let there = truth.with(key, frequency);
        let model = there.model().unwrap();
        // Each motion starts from the one at the previous frequency, as in a slow sweep.
        let end = classify(
            &mut ModelMap::new(&model),
            &state,
            &ClassifyOptions::default(),
        );
        let MotionKind::Periodic(found) = end.kind else {
            panic!("{frequency}: {:?}", end.kind)
        };
        state.clone_from(&found.states[0]);
        let seen = measure(&model, &state, found.period, ObservableSet::ALL).unwrap();
        let seen = seen.in_si(&there.physical().unwrap().scales);
        let row = [
            Entry::Number(1e-3 * frequency),
            Entry::Number(1e9 * seen.first_harmonic + 0.05 * noise.normal()),
            Entry::Number(seen.phase + 0.2 * noise.normal()),
            Entry::Text(direction.to_owned()),
            Entry::Number(0.05),
            Entry::Number(0.2),
        ];
        for ((_, column), entry) in columns.iter_mut().zip(row) {
            column.push(entry);
        }
    }
    let table = Table {
        name: "resonance".to_owned(),
        columns,
        ..Table::default()
    };
    let start = case(
        LEVER,
        &["sample.stiffness=22 N/m", "sample.loss_tangent=0.15"],
    );
    let free = ["sample.stiffness", "sample.loss_tangent", "cantilever.Q"];
    let report = fitted(&start, &request(vec![table], &free));
    assert!(
        report.fits && report.remarks.is_empty(),
        "{:?} {:?}",
        report.reason,
        report.remarks
    );
    // Upwards it leaves the tapping branch, downwards the free one, at different frequencies.
    let [up, down] = [&report.jumps[0], &report.jumps[1]];
    assert_eq!(report.jumps.len(), 2);
    assert_eq!(up.branches[0], down.branches[1]);
    assert!(up.fold > down.fold + 500.0, "{up:?} {down:?}");
    for (parameter, truth) in report.parameters.iter().zip([30.0, 0.1, 400.0]) {
        let error = parameter.standard_error.unwrap();
        assert!(
            (parameter.value - truth).abs() < 4.0 * error,
            "{parameter:?}"
        );
    }
}

#[test]
fn data_on_one_branch_are_not_assigned_to_the_other() {
    // The retract curve alone: from 22 nm on, a run from rest would not touch the sample.
    let truth = case(LEVER, &[]);
    let mut curve = curve(&truth, 22.5, 10.0, 26);
    curve.retain(|row| row.3 == Way::Retract);
    let table = measured(&curve, &mut Random::new(8), [0.05, 0.2], true);
    let report = fitted(&truth, &request(vec![table], &FREE));
    assert!(report.fits, "{:?}", report.reason);
    assert!(
        report
            .rows
            .iter()
            .all(|r| r.branch == report.rows[0].branch)
    );
    // The same distances on the free branch do not fit any sample.
    let free: Vec<_> = curve
        .iter()
        .map(|row| (row.0, 20.0, 128.8, row.3))
        .collect();
    let table = measured(&free, &mut Random::new(9), [0.05, 0.2], true);
    let refused = fitted(&truth, &request(vec![table], &FREE));
    assert!(!refused.fits && refused.reason.is_some());
}

#[test]
fn a_branch_that_the_curve_does_not_reach_is_found_from_the_data() {
    // Beyond the fold of the free branch, on which a run from rest stays at every row.
    let truth = case(LEVER, &[]);
    let mut curve = curve(&truth, 22.5, 10.0, 51);
    curve.retain(|row| row.3 == Way::Retract && row.0 > 20.5);
    let table = measured(&curve, &mut Random::new(13), [0.02, 0.1], true);
    let start = case(LEVER, &["sample.stiffness=25 N/m"]);
    let free = ["sample.stiffness", "gap.offset"];
    let report = fitted(&start, &request(vec![table], &free));
    assert!(report.fits, "{:?}", report.reason);
    for (parameter, truth) in report.parameters.iter().zip([30.0, 0.0]) {
        let error = parameter.standard_error.unwrap();
        assert!(
            (parameter.value - truth).abs() < 4.0 * error,
            "{parameter:?}"
        );
    }
}

#[test]
fn harmonics_are_columns() {
    let truth = case(LEVER, &[]);
    let names = [
        "second_harmonic (pm)",
        "third_harmonic (pm)",
        "third_harmonic_phase (deg)",
    ];
    let mut columns = vec![("distance (nm)".to_owned(), Vec::new())];
    columns.extend(names.map(|name| (name.to_owned(), Vec::new())));
    for k in 0..8 {
        let distance = 4.0 + 2.0 * f64::from(k);
        let at = case(LEVER, &[&format!("gap.tip={distance} nm")]);
        let model = at.model().unwrap();
        let found = orbit(&model, &OrbitOptions::default()).unwrap();
        // The spectrum is computed by another method.
        let length = at.physical().unwrap().scales.length * 1e12;
        let [second, third] = [&found.spectrum.harmonics[1], &found.spectrum.harmonics[2]];
        let row = [
            distance,
            second.tip * length,
            third.tip * length,
            third.tip_phase,
        ];
        for (column, value) in columns.iter_mut().zip(row) {
            column.1.push(Entry::Number(value));
        }
    }
    let table = Table {
        columns,
        ..Table::default()
    };
    let start = case(LEVER, &["sample.stiffness=27 N/m"]);
    let mut request = request(vec![table], &["sample.stiffness", "drive.frequency"]);
    let frequency = truth.get(truth.key("drive.frequency").unwrap());
    derivatives_are_right(&truth, &request, &[29.0, frequency], &[0.03, 2.0], 1e-6);
    request.free.truncate(1);
    let report = fitted(&start, &request);
    assert!((report.parameters[0].value / 30.0 - 1.0).abs() < 1e-6);
}

#[test]
fn sidebands_are_columns() {
    // Two tones around the resonance, which repeat together after 10 periods.
    let text = LEVER
        .replace("Q = 400", "Q = 50")
        .replace(
            "frequency_ratio = 1.001",
            "frequency_ratio = 0.955\nsecond_ratio = \"11/10\"",
        )
        .replace("\"20 nm\"", "\"10 nm\"\nsecond_free_amplitude = \"10 nm\"");
    let truth = case(&text, &[]);
    let names = [
        "amplitude (nm)",
        "first_sideband (nm)",
        "first_sideband_phase (deg)",
        "second_sideband (nm)",
        "second_sideband_phase (deg)",
    ];
    let mut columns = vec![("distance (nm)".to_owned(), Vec::new())];
    columns.extend(names.map(|name| (name.to_owned(), Vec::new())));
    let mut noise = Random::new(5);
    for k in 0..6 {
        let distance = 8.0 + 1.5 * f64::from(k);
        let at = case(&text, &[&format!("gap.tip={distance} nm")]);
        let found = orbit(&at.model().unwrap(), &OrbitOptions::default()).unwrap();
        let seen = found.observables.in_si(&at.physical().unwrap().scales);
        let row = [
            distance,
            1e9 * seen.first_harmonic + 0.005 * noise.normal(),
            1e9 * seen.first_sideband.unwrap() + 0.005 * noise.normal(),
            seen.first_sideband_phase.unwrap() + 0.2 * noise.normal(),
            1e9 * seen.second_sideband.unwrap() + 0.005 * noise.normal(),
            seen.second_sideband_phase.unwrap() + 0.2 * noise.normal(),
        ];
        for (column, value) in columns.iter_mut().zip(row) {
            column.1.push(Entry::Number(value));
        }
    }
    let table = Table {
        columns,
        ..Table::default()
    };
    let free = ["sample.stiffness", "sample.loss_tangent", "gap.offset"];
    let request = request(vec![table], &free);
    derivatives_are_right(
        &truth,
        &request,
        &[30.0, 0.1, 0.0],
        &[0.01, 1e-4, 1e-13],
        1e-4,
    );
    let start = case(
        &text,
        &["sample.stiffness=24 N/m", "sample.loss_tangent=0.15"],
    );
    let report = fitted(&start, &request);
    for (parameter, truth) in report.parameters.iter().zip([30.0, 0.1, 0.0]) {
        let error = parameter.standard_error.unwrap();
        assert!(
            (parameter.value - truth).abs() < 4.0 * error,
            "{parameter:?}"
        );
    }
    let stiffness = &report.parameters[0];
    let error = stiffness.standard_error.unwrap();
    assert!(error < 0.1 * stiffness.value, "{stiffness:?}");
}

#[test]
fn undetermined_combinations_are_named() {
    // Hertz's stiffness at an indentation: K1 = 2 E* √(R δ), so only this combination of E and δ is
    // determined.
    let text = LEVER.replace(
        "stiffness = \"30 N/m\"",
        "modulus = \"4 GPa\"\npoisson = 0.33\nindentation = \"1 nm\"",
    );
    let text = text.replace("[sample]", "[tip]\nradius = \"10 nm\"\n[sample]");
    let truth = case(&text, &[]);
    let curve = curve(&truth, 18.0, 4.0, 15);
    let table = measured(&curve, &mut Random::new(3), [0.05, 0.2], true);
    let free = [
        "sample.modulus",
        "sample.indentation",
        "sample.loss_tangent",
    ];
    let report = fitted(&truth, &request(vec![table], &free));
    assert_eq!(report.undetermined.len(), 1);
    let named = &report.undetermined[0];
    assert_eq!(named.keys.len(), 2);
    assert!(named.words.contains("sample.modulus") && named.words.contains("sample.indentation"));
    // E changes K1 like δ^½.
    let of = |key: &str| {
        let at = named.keys.iter().position(|k| k == key).unwrap();
        named.direction[at]
    };
    let ratio = of("sample.indentation") / of("sample.modulus");
    assert!((ratio + 2.0).abs() < 1e-3, "{ratio}");
    assert!(report.parameters[0].standard_error.is_none());
    assert!(report.parameters[2].standard_error.is_some());
    // What the data leave open is in brackets for readers, and missing in files.
    let table = report.parameter_table();
    let shown = table.shown(0..table.rows);
    let [modulus, _, tangent] = &shown.rows[..] else {
        panic!("{shown:?}")
    };
    assert_eq!(modulus[0], "sample.modulus");
    assert!(modulus[1].starts_with('(') && modulus[1].ends_with("Pa)"));
    assert_eq!(modulus[2], "not determined");
    assert!(!tangent[1].contains('(') && tangent[3].contains(" to "));
    let csv = table.csv();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(
        lines[0],
        "key,curve,value,standard_error,low,high,start,unit"
    );
    assert!(lines[1].starts_with("sample.modulus,,") && lines[1].ends_with(",Pa"));
    assert_eq!(lines[1].split(',').nth(3), Some(""));
}

/// Compares derivatives of the residuals with differences of fourth order.
fn derivatives_are_right(
    case: &Case,
    request: &FitOptions,
    at: &[f64],
    steps: &[f64],
    within: f64,
) {
    let there = |x: &[f64]| residuals(case, request, x, &Control::default()).unwrap();
    let exact = there(at).jacobian;
    for (k, step) in steps.iter().enumerate() {
        let moved = |by: f64| {
            let mut x = at.to_vec();
            x[k] += by * step;
            there(&x).residuals
        };
        let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(moved);
        let size = exact.column(k).amax();
        for row in 0..exact.nrows() {
            let difference = (a[row] - 8.0 * b[row] + 8.0 * c[row] - d[row]) / (12.0 * step);
            let error = (exact[(row, k)] - difference).abs();
            assert!(
                error < within * size,
                "{row}, {k}: {} {difference}",
                exact[(row, k)]
            );
        }
    }
}

#[test]
fn derivatives_of_residuals_are_exact() {
    let truth = case(LEVER, &[]);
    let curve = curve(&truth, 19.0, 2.0, 8);
    let table = measured(&curve, &mut Random::new(5), [0.05, 0.2], false);
    let free = [
        "sample.stiffness",
        "sample.loss_tangent",
        "cantilever.Q",
        "drive.frequency",
        "gap.offset",
        "amplitude.scale",
        "phase.offset",
    ];
    let request = request(vec![table], &free);
    let frequency = truth.get(truth.key("drive.frequency").unwrap());
    let at = [29.0, 0.11, 390.0, frequency, 1e-10, 1.02, 0.3];
    let steps = [0.03, 1e-4, 0.4, 2.0, 1e-12, 1e-3, 1e-3];
    derivatives_are_right(&truth, &request, &at, &steps, 1e-6);
}

#[test]
fn a_nonlinear_law_is_fitted() {
    let text = "[model]\nmodes = 1\n[cantilever]\nk = \"40 N/m\"\nf0 = \"325 kHz\"\nQ = 50\n[tip]\n\
         radius = \"20 nm\"\nmodulus = \"170 GPa\"\npoisson = 0.28\n[sample]\nlaw = \"dmt\"\n\
         modulus = \"5 GPa\"\npoisson = 0.3\nhamaker = \"6.4e-20 J\"\n[drive]\nactuation = \"tip\"\n\
         frequency_ratio = 1\nfree_amplitude = \"20 nm\"\n[gap]\ntip = \"15 nm\"\n";
    let truth = case(text, &[]);
    let mut curve = curve(&truth, 18.0, 8.0, 9);
    curve.retain(|row| row.3 == Way::Approach);
    let table = measured(&curve, &mut Random::new(11), [0.02, 0.1], true);
    let free = ["sample.modulus", "gap.offset"];
    let start = case(text, &["sample.modulus=3 GPa"]);
    let request = request(vec![table], &free);
    derivatives_are_right(&truth, &request, &[4.5e9, 1e-10], &[1e7, 1e-12], 1e-4);
    let report = fitted(&start, &request);
    assert!(report.fits, "{:?}", report.reason);
    for (parameter, truth) in report.parameters.iter().zip([5e9, 0.0]) {
        let error = parameter.standard_error.unwrap();
        assert!(
            (parameter.value - truth).abs() < 4.0 * error,
            "{parameter:?}"
        );
    }
}

#[test]
fn another_law_is_recognised() {
    // Data over a Hertz sample, fitted with a linear contact.
    let text = "[model]\nmodes = 1\n[cantilever]\nk = \"40 N/m\"\nf0 = \"325 kHz\"\nQ = 50\n[tip]\n\
         radius = \"20 nm\"\nmodulus = \"170 GPa\"\npoisson = 0.28\n[sample]\nlaw = \"hertz\"\n\
         modulus = \"0.5 GPa\"\npoisson = 0.3\n[drive]\nactuation = \"tip\"\nfrequency_ratio = 1\n\
         free_amplitude = \"20 nm\"\n[gap]\ntip = \"15 nm\"\n";
    let truth = case(text, &[]);
    let mut curve = curve(&truth, 18.0, 2.0, 25);
    curve.retain(|row| row.3 == Way::Approach);
    let table = measured(&curve, &mut Random::new(12), [0.01, 0.05], true);
    let linear = text.replace(
        "law = \"hertz\"\nmodulus = \"0.5 GPa\"\npoisson = 0.3",
        "stiffness = \"10 N/m\"",
    );
    let linear = linear.replace("modulus = \"170 GPa\"\npoisson = 0.28\n", "");
    let report = fitted(
        &case(&linear, &[]),
        &request(vec![table], &["sample.stiffness", "gap.offset"]),
    );
    assert!(!report.fits, "{report:?}");
    assert!(report.p_value.unwrap() < 1e-6);
}

#[test]
fn curves_share_a_sample_with_separate_distances() {
    let truth = case(LEVER, &[]);
    let [mut near, mut far] = [curve(&truth, 18.0, 5.0, 10), curve(&truth, 17.0, 6.0, 10)];
    for row in &mut near {
        row.0 -= 0.4;
    }
    for row in &mut far {
        row.0 += 0.3;
    }
    let mut noise = Random::new(21);
    let tables = [near, far].into_iter().enumerate().map(|(k, curve)| {
        let mut table = measured(&curve, &mut noise, [0.05, 0.2], true);
        table.name = format!("curve {k}");
        table
    });
    let request = FitOptions {
        per_curve: vec!["gap.offset".to_owned()],
        ..request(tables.collect(), &["sample.stiffness"])
    };
    let report = fitted(&truth, &request);
    assert!(report.fits, "{:?}", report.reason);
    assert_eq!(report.parameters.len(), 3);
    let files: Vec<&str> = report.case_files.iter().map(|f| f.curve.as_str()).collect();
    assert_eq!(files, ["curve 0", "curve 1"]);
    for (parameter, truth) in report.parameters.iter().zip([30.0, 0.4e-9, -0.3e-9]) {
        let error = parameter.standard_error.unwrap();
        assert!(
            (parameter.value - truth).abs() < 4.0 * error,
            "{parameter:?}"
        );
    }
}

#[test]
fn invalid_tables_are_refused_with_their_place() {
    let truth = case(LEVER, &[]);
    let refused = |text: &str| {
        let table = Table::parse("curve.csv", text);
        let report = table.and_then(|table| {
            fit(
                &truth,
                &request(vec![table], &["sample.stiffness"]),
                &Control::default(),
            )
        });
        report.unwrap_err().to_string()
    };
    for (text, words) in [
        (
            "distance (nm),amplitude (nm)\n10,9\n11,abc\n",
            &["line 3", "column 2", "abc"][..],
        ),
        (
            "distance (nm),amplitude (nm)\n10,9\n11\n",
            &["line 3", "1 fields"],
        ),
        (
            "distance (nm),amplitude\n10,9\n",
            &["line 1", "column 2", "unit"],
        ),
        (
            "distance (nm),amplitude (kHz)\n10,9\n",
            &["column 2", "kHz"],
        ),
        (
            "distance (nm),amplitudo (nm)\n10,9\n",
            &["amplitudo", "amplitude"],
        ),
        (
            "distance (nm),zc (nm),phase\n10,9,1\n",
            &["column 2", "column 1"],
        ),
        ("distance (nm),phase\n,9\n", &["curve.csv", "no rows"]),
        ("distance (nm),phase\n", &["curve.csv", "no rows"]),
        ("# only a comment\n", &["curve.csv is empty"]),
        ("10,9\n11,10\n", &["begins with numbers", "first line"]),
        (
            "Abstand [nm];phase\n10;9\n",
            &["`Abstand`", "convert \"Abstand=distance\""],
        ),
        (
            "distance (nm),deflection (mV)\n10,9\n",
            &["in mV", "convert \"deflection=58 nm/mV\""],
        ),
        (
            "ZSnsr (nm),Defl (V)\n10,9\n",
            &["in V", "convert \"Defl=58 nm/V\""],
        ),
        ("Z (V),phase\n10,9\n", &["convert \"Z=58 nm/V\""]),
        (
            "distance (nm),frequency shift (Hz),phase\n1,9,3\n",
            &["phase", "frequency modulation"],
        ),
        (
            "distance (nm),phase,direction\n1,9,sideways\n",
            &["line 2", "sideways"],
        ),
        (
            "distance (nm),phase,phase error (deg)\n1,9,-1\n",
            &["line 2", "column 3"],
        ),
        ("distance (nm)\n1\n", &["measured quantity"]),
        ("phase\n1\n", &["positions"]),
        ("distance (nm),phase\n10,9\n", &["cannot determine"]),
    ] {
        let message = refused(text);
        for word in words {
            assert!(message.contains(word), "{text:?}: {message}");
        }
    }
    // Semicolons, comments, missing values and brackets are accepted.
    let text = "# measured\n distance [nm]; amplitude [nm] ; phase\n10;;12\n11;10;\n";
    let table = Table::parse("curve.csv", text).unwrap();
    assert_eq!(table.columns[1].1, [Entry::Missing, Entry::Number(10.0)]);
}

/// The data in a text, as the model reads them.
fn data_of(text: &str, convert: &[&str]) -> Data {
    let table = Table::parse("curve.csv", text).unwrap();
    let options = FitOptions {
        convert: convert.iter().map(|rule| (*rule).to_owned()).collect(),
        ..request(vec![table], &[])
    };
    nanotap::study::fit::measured(&case(LEVER, &[]), &options).unwrap()
}

fn quantities(data: &Data) -> Vec<&'static str> {
    data.columns.iter().map(|c| c.quantity.name()).collect()
}

#[test]
fn capitals_in_a_column_name_do_not_change_its_meaning() {
    for (name, quantity) in [
        ("amplitude (nm)", "first_harmonic"),
        ("Amplitude (nm)", "first_harmonic"),
        ("AMPLITUDE [nm]", "first_harmonic"),
        ("First Harmonic (nm)", "first_harmonic"),
        ("a (nm)", "first_harmonic"),
        ("Phase (deg)", "phase"),
        ("Mean-Deflection (nm)", "mean_deflection"),
        ("e_dis (eV)", "dissipation"),
        ("F_MAX (nN)", "peak_force"),
        ("Frequency Shift (Hz)", "frequency_shift"),
        ("Deflection (nm)", "deflection"),
        ("FORCE (nN)", "force"),
    ] {
        let text = format!("Distance (nm),{name},Direction\n10,9,Approach\n11,10,approach\n");
        let data = data_of(&text, &[]);
        assert_eq!(quantities(&data), [quantity], "{name}");
        assert!(data.rows().all(|row| row.way.is_some()), "{name}");
    }
    let both = data_of(
        "distance (nm),Amplitude (nm),First harmonic (nm)\n10,9,8\n",
        &[],
    );
    assert_eq!(quantities(&both), ["amplitude", "first_harmonic"]);
    let error = data_of(
        "distance (nm),Amplitude (nm),Amplitude Error (nm)\n10,9,1\n",
        &[],
    );
    assert_eq!(error.rows().next().unwrap().errors, [Some(1e-9)]);
}

#[test]
fn the_last_brackets_of_a_header_contain_the_unit() {
    let text = "Height (measured) (nm)\tvDeflection (nN)\n10\t9\n11\t10\n";
    for convert in [
        &[][..],
        &["Height (measured)=distance"],
        &["vDeflection=force"],
    ] {
        let data = data_of(text, convert);
        assert_eq!(quantities(&data), ["force"], "{convert:?}");
        assert_eq!(data.swept[0].key.path(), "gap.tip");
        let row = data.rows().next().unwrap();
        assert!((row.at[0] - 10e-9).abs() < 1e-20 && row.values == [Some(9.0 * 1e-9)]);
    }
}

#[test]
fn rows_without_a_position_are_left_out_and_counted() {
    let text = "Zsnsr (nm),Amp (nm),Phase (deg)\nNaN,NaN,NaN\n10,9,80\n,8,70\n12,,85\n";
    let table = Table::parse("curve.csv", text).unwrap();
    let data = data_of(text, &[]);
    let lines: Vec<u64> = data.rows().map(|row| row.line).collect();
    assert_eq!(lines, [3, 5]);
    let options = request(vec![table], &["sample.stiffness"]);
    let report = fitted(&case(LEVER, &[]), &options);
    let note = "curve.csv: rows without `distance`, left out: 2";
    assert!(report.preparation.iter().any(|done| done == note));
}

#[test]
fn texts_are_read_as_instruments_write_them() {
    let numbers = |text: &str| -> Vec<Vec<Entry>> {
        let table = Table::parse("curve.csv", text).unwrap();
        let has_comma = table.notes.iter().any(|(name, _)| name == "DecimalCommas");
        let is_converted = text.contains(',') && table.columns[0].1[0] == Entry::Number(1.234);
        assert_eq!(has_comma, is_converted, "{text}");
        table
            .columns
            .into_iter()
            .map(|(_, column)| column)
            .collect()
    };
    let number = |x: f64| Entry::Number(x);
    let word = |text: &str| Entry::Text(text.into());
    for text in [
        "a;b\n1,234;-5e-9\n",
        "a\tb\n1,234\t-5,0E-9\n",
        "a,b\n\"1,234\",\"-5,0e-9\"\n",
    ] {
        assert_eq!(numbers(text), [[number(1.234)], [number(-5e-9)]], "{text}");
    }
    // Commas that may group thousands, or that stand next to decimal points, are not guessed.
    for (text, first) in [
        ("a,b\n\"1,234\",5\n", "1,234"),
        ("a;b\n1,234;1.5\n", "1,234"),
        ("a;b\n1,234;1,234.5\n", "1,234"),
        ("a;b\n1.234,5;1,5\n", "1.234,5"),
    ] {
        assert_eq!(numbers(text)[0], [word(first)], "{text}");
    }
    let headers = |text: &str| -> Vec<String> {
        let table = Table::parse("curve.csv", text).unwrap();
        assert_eq!(table.lines, [3], "{text}");
        table
            .columns
            .into_iter()
            .map(|(header, _)| header)
            .collect()
    };
    assert_eq!(
        headers("z;Amp (nm);Phase;name\nnm;V;[deg];\n1;2;3;x\n"),
        ["z (nm)", "Amp (nm)", "Phase (deg)", "name"]
    );
    // A row of words is not a row of units.
    let words = Table::parse("curve.csv", "direction,z\napproach,\nretract,2\n").unwrap();
    assert_eq!(words.lines, [2, 3]);
    // Line ends of old Macintosh programs, and comments.
    let mac = Table::parse("curve.csv", "#\rz,a\r1,2\r3,4\r").unwrap();
    assert_eq!(mac.lines, [3, 4]);
    let path = std::env::temp_dir().join(format!("nanotap-utf16-{}.csv", std::process::id()));
    for encode in [u16::to_le_bytes, u16::to_be_bytes] {
        let units = "\u{feff}z (µm)\n1\n".encode_utf16();
        let bytes: Vec<u8> = units.flat_map(encode).collect();
        std::fs::write(&path, bytes).unwrap();
        let table = Table::read(&path).unwrap();
        assert_eq!(table.columns, [("z (µm)".to_owned(), vec![number(1.0)])]);
    }
    // Latin-1, where µ is one byte; bytes of other data are no text.
    std::fs::write(&path, b"z (\xb5m)\n1\n").unwrap();
    let table = Table::read(&path).unwrap();
    assert_eq!(table.columns, [("z (µm)".to_owned(), vec![number(1.0)])]);
    std::fs::write(&path, b"z (\xb5m)\n\x00\x01\n").unwrap();
    assert!(Table::read(&path).is_err());
    std::fs::remove_file(&path).unwrap();
}

/// A lever over a sample with attraction and repulsion.
const PULLING: &str = "[model]\nmodes = 1\n[cantilever]\nk = \"40 N/m\"\nf0 = \"325 kHz\"\nQ = 50\n\
     [tip]\nradius = \"20 nm\"\n[sample]\nlaw = \"dmt\"\nmodulus = \"2 GPa\"\npoisson = 0.3\n\
     hamaker = \"1.5e-19 J\"\n[drive]\nactuation = \"tip\"\nfrequency_ratio = 1\n\
     free_amplitude = \"20 nm\"\n[gap]\ntip = \"15 nm\"\n";

#[test]
fn the_law_of_the_data_is_chosen_among_several() {
    let truth = case(PULLING, &[]);
    let mut curve = curve(&truth, 18.0, 6.0, 13);
    curve.retain(|row| row.3 == Way::Approach);
    let table = measured(&curve, &mut Random::new(31), [0.01, 0.05], true);
    // Starting from the law without attraction: parameters of the other laws start between their
    // bounds.
    let start = case(
        &PULLING
            .replace("dmt", "hertz")
            .replace("hamaker = \"1.5e-19 J\"\n", ""),
        &["sample.modulus=3 GPa"],
    );
    let bounds = serde_json::from_str(r#"{"sample.hamaker": ["4e-20 J", "4e-19 J"]}"#).unwrap();
    let request = FitOptions {
        laws: vec!["hertz, dmt".to_owned(), "thin-sphere".to_owned()],
        bounds,
        ..request(vec![table], &["sample.modulus", "sample.hamaker"])
    };
    let report = fitted(&start, &request);
    assert!(report.fits, "{:?}", report.reason);
    assert_eq!(report.law.as_deref(), Some("dmt"));
    let of = |law: &str| report.laws.iter().find(|l| l.law == law).unwrap();
    // Hertz has no attraction, so that one parameter belongs to it alone.
    assert_eq!(of("hertz").parameters.len(), 1);
    assert!(of("hertz").above_best.unwrap() > 100.0 && !of("hertz").fits);
    assert_eq!(of("dmt").above_best, Some(0.0));
    assert!(of("dmt").weight.unwrap() > 0.999);
    // The case does not state the thickness of a layer.
    let missing = of("thin-sphere").reason.as_ref().unwrap();
    assert!(missing.contains("thickness"), "{missing}");
    // −2 ln L is the same in both criteria: they differ in the penalty of a parameter.
    let count = (report.degrees_of_freedom + report.parameters.len()) as f64;
    let prices = (count.ln() - 2.0) * report.parameters.len() as f64;
    assert!((report.bic - report.aic - prices).abs() < 1e-9 * report.aic.abs());
    for (parameter, truth) in report.parameters.iter().zip([2e9, 1.5e-19]) {
        let error = parameter.standard_error.unwrap();
        assert!(
            (parameter.value - truth).abs() < 4.0 * error,
            "{parameter:?}"
        );
    }
    let best = case(&report.case_file, &[]);
    assert_eq!(
        best.get(best.key("sample.modulus").unwrap()),
        report.parameters[0].value
    );
}

#[test]
fn invalid_laws_are_refused() {
    let start = case(PULLING, &[]);
    let table = || Table::parse("a.csv", "distance (nm),phase\n10,90\n12,95\n14,100\n").unwrap();
    for (laws, free, word) in [
        ("hertz,hooke", "sample.modulus", "hooke"),
        ("hertz,hertz", "sample.modulus", "twice"),
        ("hertz,dmt", "sample.viscosity", "sample.viscosity"),
    ] {
        let request = FitOptions {
            laws: vec![laws.to_owned()],
            ..request(vec![table()], &[free])
        };
        let refused = fit(&start, &request, &Control::default()).unwrap_err();
        assert!(refused.to_string().contains(word), "{refused}");
    }
    let plain = Case::parse(None, &["alpha1=0.1".to_owned(), "omega=3".to_owned()]);
    let request = FitOptions {
        laws: vec!["hertz".to_owned()],
        ..request(
            vec![Table::parse("a.csv", "alpha5,phase\n0,90\n0.1,95\n0.2,97\n").unwrap()],
            &["alpha4"],
        )
    };
    if let Ok(plain) = plain {
        let refused = fit(&plain, &request, &Control::default()).unwrap_err();
        assert!(
            refused.to_string().contains("physical quantities"),
            "{refused}"
        );
    }
}

/// A table with the columns that `approach --out` writes: the observables in the model's units and
/// in SI, and rows of motions on neither branch. These are left out and counted, and the stiffness
/// is the same as from the curve itself.
#[test]
fn a_table_of_approach_is_fitted_unchanged() {
    let lever = case(LEVER, &[]);
    let length = lever.physical().unwrap().scales.length;
    let met = curve(&lever, 25.0, 12.0, 14);
    let mut names = vec![
        "way",
        "alpha5",
        "classification",
        "period",
        "spectral_radius",
    ];
    names.extend(["first_harmonic", "phase", "A (m)", "A_ratio", "zc (m)"]);
    let mut columns: Vec<(String, Vec<Entry>)> = names
        .into_iter()
        .map(|name| (name.to_owned(), Vec::new()))
        .collect();
    let mut add = |(distance, amplitude, phase, _): (f64, f64, f64, Way), way: &str| {
        let (distance, amplitude) = (distance * 1e-9, amplitude * 1e-9);
        let row = [
            Entry::Text(way.to_owned()),
            Entry::Number(distance / length),
            Entry::Text("periodic".to_owned()),
            Entry::Number(1.0),
            Entry::Number(0.99),
            Entry::Number(amplitude / length),
            Entry::Number(phase),
            Entry::Number(amplitude),
            Entry::Number(amplitude / 20e-9),
            Entry::Number(distance),
        ];
        for ((_, column), entry) in columns.iter_mut().zip(row) {
            column.push(entry);
        }
    };
    for point in &met {
        add(*point, point.3.name());
    }
    // An orbit of one direction, at a distance of the other one.
    for point in &met[3..6] {
        add(*point, "neither");
    }
    let table = Table {
        name: "curve".to_owned(),
        columns,
        ..Table::default()
    };
    let start = case(LEVER, &["sample.stiffness=25 N/m"]);
    let report = fitted(&start, &request(vec![table], &["sample.stiffness"]));
    let found = report.parameters[0].value;
    assert!((found / 30.0 - 1.0).abs() < 1e-6, "{found}");
    let names: Vec<&str> = report.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["phase", "A"]);
    let counted = report
        .remarks
        .iter()
        .any(|r| r.starts_with("3 rows of neither direction"));
    assert!(counted, "{:?}", report.remarks);
}

/// A lever under frequency modulation, over a sample with attraction and repulsion.
const FOLLOWED: &str = "[model]\nmodes = 1\n[cantilever]\nk = \"40 N/m\"\nf0 = \"100 kHz\"\n\
     Q = 2000\n[tip]\nradius = \"10 nm\"\n[sample]\nlaw = \"dmt+exponential-damping\"\n\
     modulus = \"3 GPa\"\npoisson = 0.3\nhamaker = \"2e-19 J\"\ndamping = \"1e-7 N s/m\"\n\
     decay_length = \"0.2 nm\"\n[drive]\n\
     actuation = \"tip\"\nfrequency = \"100 kHz\"\nfree_amplitude = \"10 nm\"\n[gap]\n\
     tip = \"11 nm\"\n";

/// The approach curve of `approach` under frequency modulation, with noise of the shift (Hz) and of
/// the drive ratio.
fn modulated(case: &Case, range: [f64; 2], points: usize, noise: Option<u64>) -> Table {
    let options = ApproachOptions {
        from: Some((range[0] * 1e-9).into()),
        to: Some((range[1] * 1e-9).into()),
        points,
        branches: false,
        fm: true,
        phase: 90.0,
        ..ApproachOptions::default()
    };
    let report = approach(case, &options, &Control::default()).unwrap();
    let names = [
        "way",
        "alpha5",
        "classification",
        "period",
        "spectral_radius",
    ];
    let names = names
        .into_iter()
        .chain(["phase", "A (m)", "zc (m)", "frequency_shift (Hz)"]);
    let names = names.chain(["relative_shift", "drive_ratio", "drive_dissipation (J)"]);
    let mut columns: Vec<(String, Vec<Entry>)> =
        names.map(|name| (name.to_owned(), Vec::new())).collect();
    let mut noise = noise.map(Random::new);
    let mut normal = || noise.as_mut().map_or(0.0, Random::normal);
    for point in report.table.iter().filter(|p| p.way == Way::Approach) {
        let (of, si) = (point.modulation.unwrap(), point.modulation_si.unwrap());
        let row = [
            Entry::Text(point.way.name().to_owned()),
            Entry::Number(point.gap),
            Entry::Text("periodic".to_owned()),
            Entry::Number(1.0),
            Entry::Number(0.99),
            Entry::Number(90.0),
            Entry::Number(10e-9),
            Entry::Number(point.zc.unwrap()),
            Entry::Number(si.frequency_shift + 0.5 * normal()),
            Entry::Number(of.relative_shift),
            Entry::Number(of.drive_ratio + 2e-3 * normal()),
            Entry::Number(si.drive_dissipation),
        ];
        for ((_, column), entry) in columns.iter_mut().zip(row) {
            column.push(entry);
        }
    }
    Table {
        name: "fm.csv".to_owned(),
        columns,
        ..Table::default()
    }
}

#[test]
fn a_curve_under_frequency_modulation_is_fitted_unchanged() {
    let truth = case(FOLLOWED, &[]);
    let table = modulated(&truth, [12.0, 9.9], 12, Some(51));
    let start = case(
        FOLLOWED,
        &["sample.modulus=2.4 GPa", "sample.hamaker=1.5e-19 J"],
    );
    let free = [
        "sample.modulus",
        "sample.hamaker",
        "sample.damping",
        "gap.offset",
    ];
    let report = fitted(&start, &request(vec![table], &free));
    assert!(report.fits && report.remarks.is_empty(), "{report:?}");
    let names: Vec<&str> = report.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["frequency_shift", "drive_ratio"]);
    assert!(report.rows.iter().all(|row| row.branch == Some(0)));
    // The noise that was added, determined from 12 values to a relative error of 1/√24.
    for (column, noise) in report.columns.iter().zip([0.5, 2e-3]) {
        let error = column.standard_error;
        assert!(
            (error / noise - 1.0).abs() < 3.0 / 24f64.sqrt(),
            "{error} {noise}"
        );
    }
    for (parameter, truth) in report.parameters.iter().zip([3e9, 2e-19, 1e-7, 0.0]) {
        let error = parameter.standard_error.unwrap();
        let [low, high] = parameter.interval.map(Option::unwrap);
        assert!(
            low < high && (parameter.value - truth).abs() < 4.0 * error,
            "{parameter:?}"
        );
    }
}

#[test]
fn derivatives_of_a_curve_under_frequency_modulation_are_exact() {
    let columns = [
        "frequency_shift",
        "relative_shift",
        "drive_ratio",
        "drive_dissipation",
    ];
    let with_columns = |request: FitOptions| FitOptions {
        columns: columns.map(str::to_owned).to_vec(),
        ..request
    };
    // A linear contact, for which all derivatives are in closed form.
    let linear = case(
        &LEVER.replace("free_amplitude = \"20 nm\"", "free_amplitude = \"10 nm\""),
        &[],
    );
    let table = modulated(&linear, [12.0, 8.0], 3, None);
    let free = [
        "sample.stiffness",
        "sample.loss_tangent",
        "cantilever.k",
        "cantilever.f0",
        "cantilever.Q",
        "drive.free_amplitude",
        "gap.offset",
        "frequency_shift.offset",
        "drive_ratio.scale",
    ];
    let asked = with_columns(request(vec![table], &free));
    let at = [29.0, 0.11, 41.0, 331e3, 390.0, 10.3e-9, 1e-10, 2.0, 1.1];
    let steps = [0.03, 1e-4, 0.04, 30.0, 0.4, 1e-12, 1e-12, 0.1, 1e-3];
    derivatives_are_right(&linear, &asked, &at, &steps, 1e-5);
    // Under a nonlinear law; for keys that change the modes, observables other than the orbit are
    // differenced.
    let pulling = case(FOLLOWED, &[]);
    let table = modulated(&pulling, [12.0, 9.9], 3, None);
    let free = ["sample.modulus", "sample.hamaker", "sample.damping"];
    let asked = with_columns(request(vec![table.clone()], &free));
    let at = [2.9e9, 2.1e-19, 1.1e-7];
    derivatives_are_right(&pulling, &asked, &at, &[3e6, 2e-22, 1e-10], 1e-5);
    let asked = with_columns(request(vec![table], &["sample.modulus", "cantilever.Q"]));
    derivatives_are_right(&pulling, &asked, &[2.9e9, 2100.0], &[3e6, 2.0], 1e-4);
}

#[test]
fn curves_of_amplitude_and_of_frequency_shifts_do_not_mix() {
    let truth = case(FOLLOWED, &[]);
    let shifts = modulated(&truth, [12.0, 9.9], 3, None);
    let shifts = Table {
        columns: shifts
            .columns
            .into_iter()
            .filter(|(name, _)| name.starts_with("zc") || name.starts_with("frequency_shift"))
            .collect(),
        ..shifts
    };
    let numbers = |values: [f64; 3]| values.map(Entry::Number).to_vec();
    let amplitudes = Table {
        name: "am.csv".to_owned(),
        columns: vec![
            ("distance (nm)".to_owned(), numbers([12.0, 11.0, 10.0])),
            ("amplitude (nm)".to_owned(), numbers([10.0, 9.9, 9.5])),
        ],
        ..Table::default()
    };
    let mut mixed = shifts.clone();
    mixed
        .columns
        .push(("mean_deflection (pm)".to_owned(), numbers([0.1, 0.2, 0.3])));
    for (tables, named) in [
        (vec![shifts, amplitudes], "amplitude"),
        (vec![mixed], "mean_deflection"),
    ] {
        let asked = request(tables, &["sample.modulus"]);
        let refused = fit(&truth, &asked, &Control::default()).unwrap_err();
        let said = refused.to_string();
        assert!(
            said.contains(named) && said.contains("frequency modulation"),
            "{said}"
        );
    }
}

/// A stiff lever over a sample of 3 GPa that attracts, at resonance.
const ATTRACTING: &str = "[model]\nmodes = 1\n[cantilever]\nk = \"40 N/m\"\nf0 = \"325 kHz\"\n\
     Q = 150\n[tip]\nradius = \"10 nm\"\nmodulus = \"170 GPa\"\npoisson = 0.28\n[sample]\n\
     law = \"dmt\"\nmodulus = \"3 GPa\"\npoisson = 0.3\nhamaker = \"5e-20 J\"\n[drive]\n\
     actuation = \"tip\"\nfrequency_ratio = 1\nfree_amplitude = \"15 nm\"\n[gap]\ntip = \"10 nm\"\n";

/// An approach over that sample with noise, `points` rows from 22 to 8 nm. Each row is computed: near
/// the knee the phase bends too much to be interpolated.
fn attracting(text: &str, points: usize, noise: u64) -> Vec<(f64, f64, f64)> {
    let rows = curve(&case(text, &[]), 22.0, 8.0, points);
    let mut noise = Random::new(noise);
    let mut noisy = |row: &(f64, f64, f64, Way)| {
        let amplitude = row.1 + 0.03 * noise.normal();
        (row.0, amplitude, row.2 + 0.15 * noise.normal())
    };
    let approach = rows.iter().filter(|row| row.3 == Way::Approach);
    approach.map(&mut noisy).collect()
}

fn columns(name: &str, columns: [(&str, Vec<f64>); 3]) -> Table {
    let column = |(name, values): (&str, Vec<f64>)| {
        let entries = values.into_iter().map(Entry::Number).collect();
        (name.to_owned(), entries)
    };
    Table {
        name: name.to_owned(),
        columns: columns.into_iter().map(column).collect(),
        ..Table::default()
    }
}

#[test]
fn an_instruments_export_is_fitted_as_it_is() {
    // In volts over a piezo that rises to the sample, with a phase that falls from 5° where the lever
    // lags by 90°.
    let rows = attracting(ATTRACTING, 60, 21);
    let of = |f: &dyn Fn(&(f64, f64, f64)) -> f64| -> Vec<f64> { rows.iter().map(f).collect() };
    let mut table = columns(
        "export.csv",
        [
            ("ZSnsr (nm)", of(&|row| 1520.0 - row.0)),
            ("Amp (V)", of(&|row| row.1 / 58.0)),
            ("Phase (deg)", of(&|row| 95.0 - row.2)),
        ],
    );
    table
        .columns
        .push(("Defl (V)".into(), vec![Entry::Number(0.1); 60]));
    let start = case(ATTRACTING, &["sample.modulus=1 GPa"]);
    let guessed = FitOptions {
        convert: vec!["Amp=58 nm/V".into()],
        // Intervals are followed to their ends.
        evaluations: Some(1000),
        ..profiled(vec![table.clone()], &["sample.modulus", "gap.offset"])
    };
    let stated = FitOptions {
        convert: ["Amp=58 nm/V", "ZSnsr=1520-x", "Phase=95-x"]
            .map(String::from)
            .to_vec(),
        start: vec!["gap.offset=0.4 nm".into()],
        profile: false,
        ..guessed.clone()
    };
    for options in [guessed, stated] {
        let report = fitted(&start, &options);
        assert!(
            report.fits && report.remarks.is_empty(),
            "{:?}",
            report.remarks
        );
        let [low, high] = report.parameters[0].interval.map(Option::unwrap);
        assert!(low < 3e9 && 3e9 < high && high < 1.2 * low, "{low} {high}");
        for done in ["Amp=58 nm/V", "`Defl`"] {
            assert!(
                report.preparation.iter().any(|note| note.contains(done)),
                "{done}"
            );
        }
        assert!(report.case_file.starts_with("# start: gap.offset="));
    }
    let mut unstated = request(vec![table], &["sample.modulus", "gap.offset"]);
    let slope = fitted(&start, &unstated);
    assert!(
        slope
            .preparation
            .iter()
            .any(|note| note.contains("slope in contact"))
    );
    // Of rows that end above 0.65 of the free amplitude the slope is not that in contact.
    for (_, column) in &mut unstated.data[0].columns {
        column.truncate(50);
    }
    let error = fit(&start, &unstated, &Control::default()).unwrap_err();
    assert!(
        error.to_string().contains("tell its sensitivity"),
        "{error}"
    );
}

#[test]
fn corrections_may_be_fixed_and_starts_given() {
    let rows = attracting(ATTRACTING, 30, 27);
    let of = |f: &dyn Fn(&(f64, f64, f64)) -> f64| -> Vec<f64> { rows.iter().map(f).collect() };
    let table = columns(
        "curve.csv",
        [
            ("distance (nm)", of(&|row| row.0 - 0.7)),
            ("amplitude (nm)", of(&|row| 1.1 * row.1)),
            ("phase (deg)", of(&|row| row.2 + 4.0)),
        ],
    );
    let start = [
        "gap.offset=0.7 nm",
        "amplitude.scale=1.1",
        "phase.offset=4",
        "sample.modulus=2 GPa",
    ];
    let options = FitOptions {
        start: start.map(String::from).to_vec(),
        ..request(vec![table], &["sample.modulus"])
    };
    let report = fitted(&case(ATTRACTING, &[]), &options);
    assert!(
        report.fits && report.remarks.is_empty(),
        "{:?}",
        report.remarks
    );
    assert_eq!(report.parameters[0].start, 2e9);
    let [low, high] = report.parameters[0].interval.map(Option::unwrap);
    assert!(low < 3e9 && 3e9 < high, "{low} {high}");
    let refused = |text: &str, why: &str| {
        let options = FitOptions {
            start: vec![text.into()],
            ..options.clone()
        };
        let error = fit(&case(ATTRACTING, &[]), &options, &Control::default()).unwrap_err();
        assert!(error.to_string().contains(why), "{error}");
    };
    refused("gap.offset", "expected NAME=VALUE");
    refused("sample.hamaker=1e-20 J", "neither free nor a correction");
    refused("amplitude.scale=0", "above zero");
}

#[test]
fn long_curves_are_averaged_with_the_errors_of_their_scatter() {
    let rows = attracting(ATTRACTING, 700, 23);
    let of = |f: &dyn Fn(&(f64, f64, f64)) -> f64| -> Vec<f64> { rows.iter().map(f).collect() };
    let table = columns(
        "long.csv",
        [
            ("distance (nm)", of(&|row| row.0 + 0.5)),
            ("amplitude (nm)", of(&|row| row.1)),
            ("phase (deg)", of(&|row| row.2)),
        ],
    );
    let free = ["sample.modulus", "sample.hamaker", "gap.offset"];
    let start = case(ATTRACTING, &["sample.modulus=2 GPa"]);
    let report = fitted(&start, &request(vec![table], &free));
    assert!(
        report.fits && report.remarks.is_empty(),
        "{:?}",
        report.remarks
    );
    assert!(
        (60..=130).contains(&report.rows.len()),
        "{}",
        report.rows.len()
    );
    // The noise of one row.
    for (column, noise) in report.columns.iter().zip([0.03e-9, 0.15]) {
        assert!(
            (column.standard_error / noise - 1.0).abs() < 0.3,
            "{column:?}"
        );
    }
    for (parameter, truth) in report.parameters.iter().zip([3e9, 5e-20, -0.5e-9]) {
        let error = parameter.standard_error.unwrap();
        assert!(
            (parameter.value - truth).abs() < 4.0 * error,
            "{parameter:?}"
        );
        assert!(error < 0.02 * truth.abs(), "{parameter:?}");
    }
}

#[test]
fn a_wrong_law_is_warned_of_from_few_rows() {
    // Without attraction the data cannot be described; 30 rows, of which a third are free.
    let hertz = ATTRACTING.replace("law = \"dmt\"", "law = \"hertz\"");
    let hertz = hertz.replace("hamaker = \"5e-20 J\"\n", "");
    let rows = attracting(ATTRACTING, 30, 24);
    let of = |f: &dyn Fn(&(f64, f64, f64)) -> f64| -> Vec<f64> { rows.iter().map(f).collect() };
    let table = columns(
        "curve.csv",
        [
            ("distance (nm)", of(&|row| row.0)),
            ("amplitude (nm)", of(&|row| row.1)),
            ("phase (deg)", of(&|row| row.2)),
        ],
    );
    let options = request(vec![table], &["sample.modulus", "gap.offset"]);
    let warned = |text: &str| {
        let report = fitted(&case(text, &[]), &options);
        report
            .remarks
            .iter()
            .any(|remark| remark.contains("not to be trusted"))
    };
    assert!(!warned(ATTRACTING));
    assert!(warned(&hertz));
}

/// A force volume whose stiffness and distances differ from pixel to pixel: each is found, whatever the
/// share or the number of threads; a pixel without data is missing, an
/// impossible one is not described.
#[test]
fn a_force_volume_is_fitted_pixel_by_pixel() {
    use nanotap::dataset::{Store, Work};
    use nanotap::study::DatasetStudy as _;
    use nanotap::study::fit::FitMap;
    let stiffness = |x: usize, y: usize| 20.0 + 4.0 * x as f64 + 7.0 * y as f64;
    let mut columns: Vec<(String, Vec<Entry>)> = [
        "x (um)",
        "y (um)",
        "distance (nm)",
        "amplitude (nm)",
        "phase (deg)",
    ]
    .map(|name| (name.to_owned(), Vec::new()))
    .to_vec();
    for y in 0..3 {
        for x in 0..4 {
            if (x, y) == (3, 1) {
                continue;
            }
            let set = format!("sample.stiffness={} N/m", stiffness(x, y));
            let lever = case(LEVER, &[&set]);
            for (distance, amplitude, phase, _) in curve(&lever, 22.0, 14.0, 9) {
                // Three times steeper than under any stiffness.
                let wrong = (x, y) == (2, 2);
                let amplitude = if wrong {
                    3.0 * distance - 40.0
                } else {
                    amplitude
                };
                let row = [
                    0.5 * x as f64,
                    0.5 * y as f64,
                    distance + 0.1 * x as f64,
                    amplitude,
                    phase,
                ];
                for ((_, column), value) in columns.iter_mut().zip(row) {
                    column.push(Entry::Number(value));
                }
            }
        }
    }
    let table = Table {
        name: "volume".to_owned(),
        columns,
        ..Table::default()
    };
    let options = FitOptions {
        pixels: vec!["x,y".to_owned()],
        ..request(vec![table], &["sample.stiffness", "gap.offset"])
    };
    let lever = case(LEVER, &[]);
    let plan = FitMap::plan(&lever, &options, &Control::default()).unwrap();
    let folder = std::env::temp_dir().join(format!("nanotap-map-{}", std::process::id()));
    let read = |name: &str, shares: &[&str], threads: usize| {
        let store = Store::create_or_resume(&folder.join(name), plan.schema().clone()).unwrap();
        for share in shares {
            let work = Work {
                share: share.parse().unwrap(),
                threads,
                control: Control::default(),
            };
            plan.compute(&store, &work).unwrap();
        }
        let report = FitMap::report(&store).unwrap();
        let value = |name: &str, x: usize, y: usize| {
            let k = store.schema().index_of(name).unwrap();
            let row = store.read_chunk(&store.schema().grid.block(y), k);
            row.unwrap().numbers()[x]
        };
        let all: Vec<[f64; 3]> = (0..12)
            .map(|k| ["sample.stiffness", "gap.offset", "result"].map(|n| value(n, k % 4, k / 4)))
            .collect();
        (report, all)
    };
    let (report, found) = read("whole", &["1/1"], 1);
    let (_, shared) = read("shared", &["2/2", "1/2"], 2);
    assert_eq!(format!("{found:?}"), format!("{shared:?}"));
    assert_eq!(
        (report.pixels, report.fits, report.misfits + report.failed),
        (11, 10, 1)
    );
    for (k, [value, offset, result]) in found.into_iter().enumerate() {
        let (x, y) = (k % 4, k / 4);
        match (x, y) {
            (3, 1) => assert!(value.is_nan() && result == 0.0),
            (2, 2) => assert!(result > 1.0),
            _ => {
                let off = value / stiffness(x, y) - 1.0;
                assert!(off.abs() < 1e-4, "{x} {y}: {value}");
                assert!(
                    (offset + 0.1e-9 * x as f64).abs() < 1e-13,
                    "{x} {y}: {offset}"
                );
                assert!(result == 1.0);
            }
        }
    }
    let median = report.parameters[0].median.unwrap();
    assert!((28.0..39.0).contains(&median), "{median}");
    std::fs::remove_dir_all(&folder).unwrap();
    let refused = |pixels: &str, word: &str| {
        let options = FitOptions {
            pixels: vec![pixels.to_owned()],
            ..options.clone()
        };
        let error = FitMap::plan(&lever, &options, &Control::default()).unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
    };
    refused("x,z", "no column `z`");
    refused("x,y,phase", "one or two columns");
}

/// A curve that was sorted by distance says nothing of its direction: where the lever jumps on approach
/// and not on retraction, the order in which the model describes it is found, and said.
#[test]
fn a_curve_in_the_wrong_order_is_turned() {
    let lever = case(LEVER, &[]);
    let there = curve(&lever, 24.0, 10.0, 40);
    let approach: Vec<_> = there
        .into_iter()
        .filter(|row| row.3 == Way::Approach)
        .collect();
    let mut sorted = measured(&approach, &mut Random::new(3), [0.02, 0.1], false);
    for (_, column) in &mut sorted.columns {
        column.reverse();
    }
    sorted.columns.truncate(3);
    let start = case(LEVER, &["sample.stiffness=24 N/m"]);
    let found = fitted(
        &start,
        &profiled(vec![sorted], &["sample.stiffness", "gap.offset"]),
    );
    assert!(found.fits && !found.misfit, "{:?}", found.remarks);
    let said = found
        .preparation
        .iter()
        .any(|note| note.contains("other order"));
    assert!(said, "{:?}", found.preparation);
    let [low, high] = found.parameters[0].interval.map(Option::unwrap);
    assert!(low < 30.0 && 30.0 < high, "{low} {high}");
}
