//! Reconstructed forces against the laws that made the curves.

use nanotap::case::Case;
use nanotap::case::file::Source;
use nanotap::control::Control;
use nanotap::study::fit::{Entry, Table};
use nanotap::study::reconstruct::{ReconstructOptions, ReconstructReport, reconstruct};
use serde_json::Value;

use crate::fit::Noise;

/// Curves of `../shared`'s prototype, with the laws' own forces.
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
    let mut random = Noise(seed);
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
        lines: Vec::new(),
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
    let squares = at.iter().zip(&force).map(|(x, f)| (value_at(report, *x) - f).powi(2));
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
            free_amplitude: Some(format!("{} m", lever_of["free_amplitude_m"]).as_str().into()),
            free_phase: Some(number(&lever_of["free_phase_deg"])),
            amplitude_error: given(number(&noise["A_m"]))
                .map(|error| format!("{error} m").as_str().into()),
            phase_error: given(number(&noise["phase_deg"])),
            ..ReconstructOptions::default()
        };
        let report = reconstructed(&lever(&reference), rows(&reference, 1, [0.0; 2], 0), options);
        let [rms, least, closest] = deviations(&reference, &report);
        let dissipated = report.rows.iter().map(|row| row.dissipation).fold(0.0, f64::max);
        let truth = number(&reference["truth"]["max_dissipation_J"]);
        println!(
            "{}: rms {rms:.4}, minimum {least:.4}, closest {closest:.2e} m, E_dis {dissipated:.3e} of {truth:.3e} J, \
             chi2 {:.2}, freedom {:.1}, nodes {}",
            reference["name"], report.chi2, report.freedom, report.table.distance.len()
        );
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
            println!("{step} {seed}: {:?} errors {:?} free {} {} {} chi2 {} df {}", deviations(reference, &report), report.errors, report.free_amplitude, report.free_phase, report.free_rows, report.chi2, report.freedom);
            all.push(deviations(reference, &report));
        }
        let square = |index: usize| {
            let squares = all.iter().map(|one| one[index] * one[index]);
            (squares.sum::<f64>() / all.len() as f64).sqrt()
        };
        println!("{step}: {:?}", [0, 1, 2].map(square));
        assert!(square(0) < rms_limit);
        assert!(square(1) < least_limit);
        assert!(all.iter().all(|one| one[2].abs() < 1e-10));
    }
}

#[test]
#[ignore = "experiment"]
fn experiment() {
    let reference = &references()[0];
    let case = lever(reference);
    for step in [1, 4] {
        for variant in 0..3 {
            let mut all = Vec::new();
            let mut covered = [0; 2];
            for seed in 1..=24 {
                let table = rows(reference, step, [0.02, 0.1], seed);
                let mut options = ReconstructOptions::default();
                if variant > 0 {
                    options.free_amplitude = Some("20 nm".into());
                    options.free_phase = Some(90.0);
                }
                if variant > 1 {
                    options.amplitude_error = Some("0.02 nm".into());
                    options.phase_error = Some(0.1);
                }
                let report = reconstructed(&case, table, options);
                let truth = &reference["truth"];
                for (x, f) in numbers(&truth["distance_m"]).iter().zip(numbers(&truth["force_N"])) {
                    let k = report.table.distance.partition_point(|node| node <= x).clamp(1, report.table.distance.len() - 1);
                    let error = report.table.force_error[k];
                    covered[1] += 1;
                    covered[0] += usize::from((value_at(&report, *x) - f).abs() < 2.0 * error);
                }
                all.push(deviations(reference, &report));
            }
            let square = |index: usize| {
                let squares = all.iter().map(|one| one[index] * one[index]);
                (squares.sum::<f64>() / all.len() as f64).sqrt()
            };
            let mean = all.iter().map(|one| one[1]).sum::<f64>() / all.len() as f64;
            println!("step {step} variant {variant}: {:?} mean of minimum {mean} covered {covered:?}", [0, 1, 2].map(square));
        }
    }
}
