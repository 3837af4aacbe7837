//! Reconstructed forces against the laws that made the curves.

use nanotap::case::Case;
use nanotap::case::file::Source;
use nanotap::case::force_table::ForceTable;
use nanotap::control::{CancelFlag, Control};
use nanotap::study::approach::{ApproachOptions, Way, approach};
use nanotap::study::fit::{Entry, Table};
use nanotap::study::frequency_modulation::Modulated;
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap::study::reconstruct::{ReconstructOptions, ReconstructReport, reconstruct};
use serde_json::Value;

use crate::fit::{curve, measured};
use nanotap_dynamics::random::Random;

/// Curves that another program made, with the laws' own forces.
fn references() -> Vec<Value> {
    serde_json::from_str(include_str!("../reference/inverse.json")).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap().iter();
    list.map(|number| number.as_f64().unwrap()).collect()
}

/// The lever of a reference; its sample does not matter.
fn lever(reference: &Value) -> Case {
    let lever = &reference["lever"];
    let of = |name: &str| lever[name].as_f64().unwrap();
    let text = format!(
        "[model]\nmodes = 1\n[cantilever]\nk = \"{} N/m\"\nf0 = \"{} Hz\"\nQ = {}\n[sample]\n\
         stiffness = \"1 N/m\"\n[drive]\nactuation = \"{}\"\nfrequency_ratio = {}\n\
         free_amplitude = \"{} m\"\n[gap]\ntip = \"10 nm\"\n",
        of("k_static_N_per_m"),
        of("f0_Hz"),
        of("Q"),
        lever["actuation"].as_str().unwrap(),
        of("frequency_ratio"),
        of("free_amplitude_m"),
    );
    let source = Source {
        name: "lever.toml".into(),
        text,
    };
    Case::parse(Some(source), &[]).unwrap()
}

/// Every `step`th row of a reference, with noise in nm and degrees.
fn rows(reference: &Value, step: usize, noise: [f64; 2], seed: u64) -> Table {
    let rows = &reference["rows"];
    let mut random = Random::new(seed);
    let mut column = |name: &str, factor: f64, noise: f64| -> Vec<Entry> {
        let values = numbers(&rows[name]).into_iter();
        let noisy = values.map(|value| factor * value + noise * random.normal());
        noisy.map(Entry::Number).collect()
    };
    let words = rows["direction"].as_array().unwrap().iter();
    let words = words.map(|word| Entry::Text(word.as_str().unwrap().to_owned()));
    let columns = [
        ("direction", words.collect()),
        ("distance (nm)", column("distance_m", 1e9, 0.0)),
        ("amplitude (nm)", column("amplitude_m", 1e9, noise[0])),
        ("phase (deg)", column("phase_deg", 1.0, noise[1])),
    ];
    let thinned = |values: Vec<Entry>| values.into_iter().step_by(step).collect();
    Table {
        name: "curve.csv".into(),
        columns: columns
            .into_iter()
            .map(|(name, values): (&str, Vec<Entry>)| (name.to_owned(), thinned(values)))
            .collect(),
        ..Table::default()
    }
}

fn value_at(report: &ReconstructReport, x: f64) -> f64 {
    let (at, force) = (&report.table.distance, &report.table.force);
    let k = at.partition_point(|node| *node <= x).clamp(1, at.len() - 1);
    let weight = (x - at[k - 1]) / (at[k] - at[k - 1]);
    force[k - 1] + weight * (force[k] - force[k - 1])
}

/// Root mean square error relative to the law's largest force, relative error of the minimum, and
/// error of the closest approach in m.
fn deviations(reference: &Value, report: &ReconstructReport) -> [f64; 3] {
    let truth = &reference["truth"];
    let (at, force) = (numbers(&truth["distance_m"]), numbers(&truth["force_N"]));
    let squares = at
        .iter()
        .zip(&force)
        .map(|(x, f)| (value_at(report, *x) - f).powi(2));
    let rms = (squares.sum::<f64>() / at.len() as f64).sqrt();
    let of = |name: &str| truth[name].as_f64().unwrap();
    let least = report.minimum.map_or(0.0, |minimum| minimum.force);
    [
        rms / of("force_scale_N"),
        least / of("force_min_N") - 1.0,
        report.closest - of("closest_approach_m"),
    ]
}

fn reconstructed(case: &Case, data: Table, options: ReconstructOptions) -> ReconstructReport {
    let options = ReconstructOptions {
        data: vec![data],
        ..options
    };
    reconstruct(case, &options, &Control::default()).unwrap()
}

#[test]
fn references_are_met_within_their_tolerance() {
    for reference in references() {
        let (lever_of, noise) = (&reference["lever"], &reference["noise"]);
        let number = |value: &Value| value.as_f64().unwrap();
        let given = |value: f64| (value > 0.0).then_some(value);
        let options = ReconstructOptions {
            free_amplitude: Some(
                format!("{} m", lever_of["free_amplitude_m"])
                    .as_str()
                    .into(),
            ),
            free_phase: Some(number(&lever_of["free_phase_deg"])),
            amplitude_error: given(number(&noise["A_m"]))
                .map(|error| format!("{error} m").as_str().into()),
            phase_error: given(number(&noise["phase_deg"])),
            ..ReconstructOptions::default()
        };
        let report = reconstructed(
            &lever(&reference),
            rows(&reference, 1, [0.0; 2], 0),
            options,
        );
        let [rms, least, closest] = deviations(&reference, &report);
        let dissipated = report
            .rows
            .iter()
            .filter_map(|row| row.dissipation)
            .fold(0.0, f64::max);
        let truth = number(&reference["truth"]["max_dissipation_J"]);
        let tolerance = |name: &str| reference["tolerance"][name].as_f64();
        assert!(rms < tolerance("rms_over_scale").unwrap());
        assert!(closest.abs() < tolerance("closest_approach_m").unwrap());
        if let Some(limit) = tolerance("force_min_relative") {
            assert!(least.abs() < limit);
        }
        if let Some(limit) = tolerance("max_dissipation_relative") {
            assert!((dissipated / truth - 1.0).abs() < limit);
        }
    }
}

#[test]
fn noise_leaves_the_force_within_a_few_percent() {
    let reference = &references()[0];
    let case = lever(reference);
    for (step, rms_limit, least_limit) in [(1, 0.02, 0.06), (4, 0.05, 0.09)] {
        let mut all = Vec::new();
        for seed in 1..=8 {
            let table = rows(reference, step, [0.02, 0.1], seed);
            let report = reconstructed(&case, table, ReconstructOptions::default());
            all.push(deviations(reference, &report));
        }
        let square = |index: usize| {
            let squares = all.iter().map(|one| one[index] * one[index]);
            (squares.sum::<f64>() / all.len() as f64).sqrt()
        };
        let deviation = [0, 1, 2].map(square);
        assert!(deviation[0] < rms_limit, "{step}: {deviation:?}");
        assert!(deviation[1] < least_limit, "{step}: {deviation:?}");
        assert!(all.iter().all(|one| one[2].abs() < 1e-10));
    }
}

/// A table of numbers, without lines.
fn table(columns: &[(&str, Vec<f64>)]) -> Table {
    let entries = |values: &[f64]| values.iter().copied().map(Entry::Number).collect();
    Table {
        name: "curve.csv".into(),
        columns: columns
            .iter()
            .map(|(name, values)| ((*name).to_owned(), entries(values)))
            .collect(),
        ..Table::default()
    }
}

#[test]
fn frequency_shifts_give_the_force_of_the_law() {
    let words = [
        "modes=1",
        "cantilever.k=0.87 N/m",
        "cantilever.f0=100 kHz",
        "cantilever.Q=200",
        "tip.radius=5 nm",
        "tip.modulus=160 GPa",
        "tip.poisson=0.3",
        "sample.law=dmt",
        "sample.modulus=1 GPa",
        "sample.poisson=0.3",
        "sample.hamaker=3e-20 J",
        "sample.intermolecular_distance=0.169 nm",
        "drive.actuation=tip",
        "drive.frequency=100 kHz",
        "drive.free_amplitude=10 nm",
        "gap.tip=12 nm",
    ];
    let case = Case::parse(None, &words.map(str::to_owned)).unwrap();
    let scales = case.physical().unwrap().scales;
    let options = ApproachOptions {
        from: Some((16e-9).into()),
        to: Some((9e-9).into()),
        points: 80,
        fm: true,
        branches: false,
        ..ApproachOptions::default()
    };
    let curve = approach(&case, &options, &Control::default()).unwrap();
    let points = curve.table.iter().filter(|p| p.way == Way::Approach);
    let points: Vec<_> = points
        .map(|p| (p.zc.unwrap(), p.modulation.unwrap()))
        .collect();
    let column = |of: &dyn Fn(&(f64, Modulated)) -> f64| points.iter().map(of).collect();
    let data = table(&[
        ("distance (nm)", column(&|p| 1e9 * p.0)),
        ("relative_shift", column(&|p| p.1.relative_shift)),
        ("drive_ratio", column(&|p| p.1.drive_ratio)),
    ]);
    let report = reconstructed(&case, data, ReconstructOptions::default());
    let (mut squares, mut largest) = (0.0, 0.0_f64);
    for (_, found) in &points {
        let truth = found.static_force.unwrap() * scales.force;
        squares += (value_at(&report, found.closest * scales.length) - truth).powi(2);
        largest = largest.max(truth.abs());
    }
    let rms = (squares / points.len() as f64).sqrt();
    assert!(rms < 0.03 * largest, "{rms:e} of {largest:e}");
    assert_eq!(report.sader_jarvis.unwrap().force.len(), points.len());
    assert!(report.inflections.is_empty());
}

/// Frequency shifts of a qPlus sensor without noise, from 3 to 0.7 nm. The force has its minimum,
/// −4.6105 nN, at 278.5 pm: (2/15 repulsion / H)^⅙.
fn qplus_curve(points: usize, measured: &[&str]) -> (Case, Table) {
    let words = [
        "modes=1",
        "cantilever.k1=1800 N/m",
        "cantilever.f0=19796.5 Hz",
        "cantilever.Q=20000",
        "tip.radius=10 nm",
        "sample.law=lennard-jones",
        "sample.hamaker=2.86e-19 J",
        "sample.repulsion=1e-75 J m^6",
        "drive.actuation=tip",
        "drive.frequency_ratio=1",
        "drive.free_amplitude=0.5 nm",
        "gap.tip=5 nm",
    ];
    let case = Case::parse(None, &words.map(str::to_owned)).unwrap();
    let options = ApproachOptions {
        from: Some((3e-9).into()),
        to: Some((0.7e-9).into()),
        points,
        fm: true,
        branches: false,
        ..ApproachOptions::default()
    };
    let curve = approach(&case, &options, &Control::default()).unwrap();
    let rows = curve.table.iter().filter(|p| p.way == Way::Approach);
    let rows: Vec<_> = rows
        .map(|p| (p.zc.unwrap(), p.modulation.unwrap()))
        .collect();
    let column = |of: &dyn Fn(&(f64, Modulated)) -> f64| rows.iter().map(of).collect();
    let columns = [
        ("distance (nm)", column(&|p| 1e9 * p.0)),
        ("relative_shift", column(&|p| p.1.relative_shift)),
        ("drive_ratio", column(&|p| p.1.drive_ratio)),
    ];
    let is_measured = |name: &str| measured.contains(&name);
    let columns: Vec<_> = columns
        .into_iter()
        .filter(|(name, _)| is_measured(name))
        .collect();
    (case, table(&columns))
}

/// Force of this sample, N.
fn lennard_jones(d: f64) -> f64 {
    10e-9 * (1e-75 / (180.0 * d.powi(8)) - 2.86e-19 / (6.0 * d * d))
}

#[test]
fn a_curve_without_noise_is_as_exact_as_its_discretisation() {
    for points in [120, 240] {
        let names = ["distance (nm)", "relative_shift", "drive_ratio"];
        let (case, data) = qplus_curve(points, &names);
        let report = reconstructed(&case, data, ReconstructOptions::default());
        let minimum = report.minimum.unwrap();
        let [truth, place] = [-4.6105e-9, 278.5e-12];
        assert!((minimum.force - truth).abs() < 2.0 * minimum.force_error);
        assert!(minimum.force_error < 0.03 * truth.abs(), "{minimum:?}");
        assert!((minimum.distance - place).abs() < 5e-12, "{minimum:?}");
        // Every value, but at the wall and in the tail, where the force is assumed.
        let table = &report.table;
        let resolved = (0..table.distance.len()).filter(|k| table.distance[*k] < 1.5e-9);
        let deviations: Vec<f64> = resolved
            .map(|k| {
                (table.force[k] - lennard_jones(table.distance[k])).abs() / table.force_error[k]
            })
            .collect();
        let covered = deviations.iter().filter(|one| **one < 2.0).count();
        assert!(
            covered as f64 > 0.95 * deviations.len() as f64,
            "{deviations:?}"
        );
    }
}

#[test]
fn a_dissipation_that_was_not_measured_is_empty() {
    let (case, data) = qplus_curve(120, &["distance (nm)", "relative_shift"]);
    let report = reconstructed(&case, data, ReconstructOptions::default());
    assert!(!report.has_damping);
    assert!(report.table.dissipation.iter().all(Option::is_none));
    assert!(report.rows.iter().all(|row| row.dissipation.is_none()));
    let csv = report.force_table().csv();
    assert!(csv.lines().skip(1).all(|line| line.ends_with(",,,,")));
    let document = serde_json::to_value(&report).unwrap();
    assert!(document["table"]["damping"][0].is_null());
    // The file is still a law, without damping.
    let law = ForceTable::of(&Table::parse("force.csv", &csv).unwrap()).unwrap();
    assert!(!law.text().contains("damping"));
    let figure = nanotap::figure::reconstruct::reconstruct_figure(&report);
    assert!(!figure.to_svg().unwrap().contains("dissipation"));
}

#[test]
fn the_table_is_a_law_that_gives_the_curve_back() {
    let reference = &references()[2];
    let case = lever(reference);
    let report = reconstructed(
        &case,
        rows(reference, 1, [0.0; 2], 0),
        ReconstructOptions::default(),
    );
    let lever = &reference["lever"];
    let of = |name: &str| lever[name].as_f64().unwrap();
    let words = [
        "modes=1".to_owned(),
        format!("cantilever.k={} N/m", of("k_static_N_per_m")),
        format!("cantilever.f0={} Hz", of("f0_Hz")),
        format!("cantilever.Q={}", of("Q")),
        "drive.actuation=base".to_owned(),
        "drive.frequency_ratio=1".to_owned(),
        format!("drive.free_amplitude={} m", of("free_amplitude_m")),
        "sample.law=table".to_owned(),
        format!("sample.table={}", report.force_table().csv()),
        "gap.tip=6 nm".to_owned(),
    ];
    let again = Case::parse(None, &words).unwrap();
    let found = orbit(&again.model().unwrap(), &OrbitOptions::default()).unwrap();
    assert!(found.stable && found.observables.peak_force > 0.0);
}

/// A lever of 42 N/m with Q = 400 over a DMT sample of 2 GPa, or another law.
fn stiff_lever(sample: &str) -> Case {
    let text = format!(
        "[cantilever]\nk = \"42 N/m\"\nf0 = \"330 kHz\"\nQ = 400\n[model]\nmodes = 1\n[tip]\n\
         radius = \"10 nm\"\n[sample]\n{sample}\n[drive]\nfrequency_ratio = 0.999\n\
         free_amplitude = \"12 nm\"\n[gap]\ntip = \"10 nm\"\n"
    );
    let source = Source {
        name: "lever.toml".into(),
        text,
    };
    Case::parse(Some(source), &[]).unwrap()
}

const DMT: &str = "law = \"dmt\"\nmodulus = \"2 GPa\"\npoisson = 0.35\nhamaker = \"8e-20 J\"\n\
                   intermolecular_distance = \"0.165 nm\"";
const HERTZ: &str = "law = \"hertz\"\nmodulus = \"1 GPa\"\npoisson = 0.4";

/// The DMT law, N.
fn dmt(d: f64) -> f64 {
    let (radius, hamaker, contact) = (10e-9_f64, 8e-20, 0.165e-9);
    let attraction = -hamaker * radius / 6.0 / d.max(contact).powi(2);
    let depth = (contact - d).max(0.0);
    attraction + 4.0 / 3.0 * 2e9 / (1.0 - 0.35 * 0.35) * radius.sqrt() * depth.powf(1.5)
}

fn hertz(d: f64) -> f64 {
    let depth = (-d).max(0.0);
    4.0 / 3.0 * 1e9 / (1.0 - 0.4 * 0.4) * 10e-9_f64.sqrt() * depth.powf(1.5)
}

/// A sample that dissipates in contact alone, on whose curve the lever leaps from attraction to repulsion:
/// between the rows before and after the leap 43 ± 2 eV were reported where nothing is dissipated.
#[test]
fn errors_of_the_dissipation_cover_what_no_row_measured() {
    let words = [
        "modes=3",
        "cantilever.k=7.4 N/m",
        "cantilever.f0=160 kHz",
        "cantilever.Q=310",
        "tip.radius=13 nm",
        "sample.law=voigt-sphere + van-der-waals",
        "sample.viscosity=35 Pa s",
        "sample.modulus=2.2 GPa",
        "sample.poisson=0.36",
        "sample.hamaker=6.5e-20 J",
        "sample.intermolecular_distance=0.19 nm",
        "drive.frequency=159.9 kHz",
        "drive.free_amplitude=27 nm",
        "gap.tip=28.6 nm",
    ];
    let case = Case::parse(None, &words.map(str::to_owned)).unwrap();
    let options = ApproachOptions {
        points: 60,
        from: Some("33 nm".into()),
        to: Some("5 nm".into()),
        ..ApproachOptions::default()
    };
    let curve = approach(&case, &options, &Control::default()).unwrap();
    let of = |read: &dyn Fn(&nanotap::observe::PhysicalMotion) -> f64| -> Vec<f64> {
        let points = curve
            .table
            .iter()
            .filter_map(|point| point.physical.as_ref());
        points.map(read).collect()
    };
    let data = table(&[
        (
            "distance (m)",
            curve.table.iter().filter_map(|p| p.zc).collect(),
        ),
        ("amplitude (m)", of(&|p| p.observables.first_harmonic)),
        ("phase (deg)", of(&|p| p.observables.phase)),
    ]);
    let report = reconstructed(&case, data, ReconstructOptions::default());
    let found = &report.table;
    let both = found.dissipation.iter().zip(&found.dissipation_error);
    let mut beyond = 0;
    for (x, (value, error)) in found.distance.iter().zip(both) {
        let (value, error) = (value.unwrap(), error.unwrap());
        // Contact begins at the intermolecular distance.
        if *x > 0.25e-9 {
            assert!(value.abs() <= 4.0 * error, "{x:e}: {value:e} {error:e}");
            beyond += 1;
        }
    }
    assert!(beyond > 5);
    // What the nearest rows measured is resolved.
    let (value, error) = (
        found.dissipation[0].unwrap(),
        found.dissipation_error[0].unwrap(),
    );
    assert!(value > 10.0 * error, "{value:e} {error:e}");
}

/// Standard deviations of amplitude (nm) and phase (deg).
const LOW_NOISE: [f64; 2] = [0.01, 0.05];

/// A low-noise curve over a conservative sample, whose force was once found at tens of nN beyond the
/// closest approach: the iteration did not converge, and errors followed an oscillating force.
#[test]
fn standard_errors_hold_and_no_force_is_beyond_the_closest_approach() {
    for (sample, law) in [(DMT, dmt as fn(f64) -> f64), (HERTZ, hertz)] {
        let case = stiff_lever(sample);
        let rows = curve(&case, 16.0, 3.0, 100);
        let (mut held, mut all) = (0, 0);
        for seed in 1..=5 {
            let data = measured(&rows, &mut Random::new(seed), LOW_NOISE, false);
            let report = reconstructed(&case, data, ReconstructOptions::default());
            let found = &report.table;
            assert!(found.distance[0] >= report.closest);
            assert!(report.ways.is_empty() && report.chi2 < 2.0);
            let near = found.distance.iter().enumerate();
            for (k, d) in near.filter(|(_, d)| **d < 1.5e-9) {
                let deviation = (found.force[k] - law(*d)).abs() / found.force_error[k];
                assert!(deviation < 5.0, "{seed}: {deviation} at {d:e}");
                held += i32::from(deviation < 2.0);
                all += 1;
            }
            match report.minimum {
                Some(minimum) => {
                    assert!((minimum.force + 4.9e-9).abs() < 3.0 * minimum.force_error);
                    let mut remarks = report.remarks.iter();
                    assert!(remarks.any(|remark| remark.contains("no row has")));
                }
                None => assert_eq!(sample, HERTZ),
            }
        }
        assert!(f64::from(held) > 0.9 * f64::from(all), "{held} of {all}");
    }
}

#[test]
fn a_curve_that_begins_in_contact_does_not_determine_the_force() {
    let case = stiff_lever(DMT);
    let rows = curve(&case, 12.8, 3.0, 100);
    let options = ReconstructOptions {
        data: vec![measured(&rows, &mut Random::new(1), LOW_NOISE, false)],
        free_amplitude: Some("12 nm".into()),
        free_phase: Some(51.47),
        ..ReconstructOptions::default()
    };
    let error = reconstruct(&case, &options, &Control::default()).unwrap_err();
    assert!(error.to_string().contains("undecided"), "{error}");
}

/// Noise of 0.05 nm over a stiff sample: some curves gave minima of hundreds of nN.
#[test]
fn noise_over_a_stiff_sample_gives_no_large_force() {
    let case = stiff_lever(&DMT.replace("2 GPa", "10 GPa"));
    let rows = curve(&case, 14.0, 4.0, 100);
    for seed in [1, 2, 48, 84] {
        let options = ReconstructOptions {
            data: vec![measured(&rows, &mut Random::new(seed), [0.05, 0.25], false)],
            ..ReconstructOptions::default()
        };
        match reconstruct(&case, &options, &Control::default()) {
            Ok(report) => {
                let least = report.minimum.map_or(0.0, |minimum| minimum.force);
                assert!(least > -15e-9, "{seed}: {least:e}");
            }
            Err(error) => assert!(error.to_string().contains("undecided"), "{error}"),
        }
    }
}

#[test]
fn a_sample_that_moves_between_approach_and_retract_is_reported() {
    let case = stiff_lever(DMT);
    let mut rows = curve(&case, 16.0, 3.0, 100);
    for row in rows.iter_mut().filter(|row| row.3 == Way::Retract) {
        row.0 += 0.15;
    }
    let data = measured(&rows, &mut Random::new(1), LOW_NOISE, false);
    let report = reconstructed(&case, data, ReconstructOptions::default());
    assert_eq!(report.ways.len(), 2, "{:?}", report.remarks);
}

#[test]
fn an_instruments_columns_are_understood() {
    let reference = &references()[0];
    let raw = &reference["rows"];
    let of = |name: &str, offset: f64, factor: f64| -> Vec<f64> {
        let values = numbers(&raw[name]).into_iter();
        values.map(|value| offset + factor * value).collect()
    };
    let data = table(&[
        ("Zsnsr (nm)", of("distance_m", 1500.0, -1e9)),
        ("Amp (V)", of("amplitude_m", 0.0, 1e9 / 58.0)),
        ("Phase (deg)", of("phase_deg", 93.7, -1.0)),
    ]);
    let options = ReconstructOptions {
        convert: vec!["Amp=58 nm/V".into()],
        ..ReconstructOptions::default()
    };
    let report = reconstructed(&lever(reference), data, options);
    let least = report.minimum.unwrap().force;
    let truth = reference["truth"]["force_min_N"].as_f64().unwrap();
    assert!((least / truth - 1.0).abs() < 0.05, "{least:e}");
    assert!(report.closest.abs() < 4e-9, "{:e}", report.closest);
    let retract = report
        .rows
        .iter()
        .filter(|row| row.way == Some(Way::Retract));
    assert!(retract.count().abs_diff(report.rows.len() / 2) <= 2);
    for words in ["other way", "backwards", "retract part", "was added"] {
        assert!(
            report.remarks.iter().any(|remark| remark.contains(words)),
            "{words}"
        );
    }
}

#[test]
fn what_cannot_be_reconstructed_is_refused() {
    let reference = &references()[0];
    let case = lever(reference);
    let good = rows(reference, 1, [0.0; 2], 0);
    let refused = |data: Vec<Table>, options: ReconstructOptions, words: &str| {
        let options = ReconstructOptions { data, ..options };
        let error = reconstruct(&case, &options, &Control::default()).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
    };
    let plain = ReconstructOptions::default;
    refused(Vec::new(), plain(), "no data");
    refused(
        vec![rows(reference, 30, [0.0; 2], 0)],
        plain(),
        "feel the sample",
    );
    let mut none = good.clone();
    none.columns.truncate(3);
    refused(vec![none], plain(), "phase");
    let mut negative = good.clone();
    negative.columns[2].1[4] = Entry::Number(-1.0);
    refused(vec![negative], plain(), "line 5");
    let mut text = good.clone();
    text.columns[2].1[6] = Entry::Text("off".into());
    refused(vec![text], plain(), "row 7");
    let convert = |rule: &str| ReconstructOptions {
        convert: vec![rule.into()],
        ..plain()
    };
    refused(
        vec![good.clone()],
        convert("Amp=58 nm/V"),
        "no column is called `Amp`",
    );
    refused(vec![good.clone()], convert("amplitude=58 nm/V"), "is in nm");
    refused(vec![good.clone()], convert("phase=x^2"), "not a conversion");
    let few = ReconstructOptions { rows: 3, ..plain() };
    refused(vec![good.clone()], few, "out of range");
    let stop = CancelFlag::new();
    stop.cancel();
    let control = Control {
        cancel: Some(&stop),
        progress: None,
    };
    let options = ReconstructOptions {
        data: vec![good],
        ..plain()
    };
    assert!(reconstruct(&case, &options, &control).is_err());
}
