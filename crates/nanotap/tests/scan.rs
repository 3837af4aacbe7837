//! The study `scan` against an independent program, whose numbers are in `tests/scan/*.json`
//! (80-bit arithmetic; lengths nm, forces nN, energies aJ, angles degrees).

use nanotap::case::Case;
use nanotap::case::file::Source;
use nanotap::control::Control;
use nanotap::study::Study as _;
use nanotap::study::scan::{ScanOptions, ScanReport, ScanStudy};
use serde_json::{Value, json};

const REFERENCE: &str = include_str!("scan/scan_reference.json");

fn reference(name: &str) -> Value {
    let all: Value = serde_json::from_str(REFERENCE).unwrap();
    all["scans"][name].clone()
}

/// The case file of a reference scan, its scan as keys of `[scan]`.
fn case_of(reference: &Value) -> Case {
    let scan = &reference["scan"];
    let nm = |value: &Value| format!("\"{} nm\"", value.as_f64().unwrap());
    let mut text = reference["case_toml"][0].as_str().unwrap().to_owned();
    text += &format!(
        "\n[scan]\nsize = {}\nsettle = {}\nperiods = {}\npixels = 50\nsetpoint = {}\nz0 = {}\n\
         lock_in = {{ time_constant = \"{} s\", order = {} }}\n",
        nm(&scan["length"]),
        scan["settle"],
        scan["n"],
        scan["setpoint"],
        nm(&scan["z0"]),
        scan["tau"],
        scan["order"],
    );
    match scan["Ki"].as_f64() {
        Some(gain) => text += &format!("integral_gain = {gain}\n"),
        None => text += "mode = \"constant-height\"\n",
    }
    let mut features = Vec::new();
    for feature in scan["feature"].as_array().into_iter().flatten() {
        features.push(match feature[0].as_str().unwrap() {
            "step" => format!(
                "{{ step = {{ from = {}, to = {}, height = {} }} }}",
                nm(&feature[1]),
                nm(&feature[2]),
                nm(&feature[3])
            ),
            "gauss" => format!(
                "{{ gauss = {{ at = {}, width = {}, height = {} }} }}",
                nm(&feature[1]),
                nm(&feature[2]),
                nm(&feature[3])
            ),
            other => panic!("{other}"),
        });
    }
    text += &format!("surface = [{}]\n", features.join(", "));
    for segment in scan["segment"].as_array().into_iter().flatten() {
        text += &format!(
            "[[scan.material]]\nfrom = {}\nto = {}\nhamaker = \"1e-20 J\"\n",
            nm(&segment[0]),
            nm(&segment[1])
        );
    }
    let name = "reference.toml".to_owned();
    Case::parse(Some(Source { name, text }), &[]).unwrap()
}

fn run(name: &str) -> (Value, ScanReport) {
    let reference = reference(name);
    let list: Vec<usize> = reference["values"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| row["k"].as_u64().unwrap() as usize)
        .collect();
    let options = ScanOptions {
        list,
        ..ScanOptions::default()
    };
    let report = ScanStudy::run(&case_of(&reference), &options, &Control::default()).unwrap();
    (reference, report)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// Within 1e-8 of the size, or of 1 where the value is smaller.
#[track_caller]
fn near(found: f64, expected: &Value, tolerance: f64, what: &str) {
    let expected = number(expected);
    let apart = (found - expected).abs() / expected.abs().max(1.0);
    assert!(apart < tolerance, "{what}: {found} for {expected}");
}

fn compare(name: &str) {
    let (reference, report) = run(name);
    let rows = reference["values"].as_array().unwrap();
    assert_eq!(rows.len(), report.periods.len());
    for (row, found) in rows.iter().zip(&report.periods) {
        let what = |signal: &str| format!("scan {name}, period {}, {signal}", row["k"]);
        for (value, key, factor) in [
            (found.x, "x", 1e9),
            (found.surface, "h", 1e9),
            (found.z, "z", 1e9),
            (found.amplitude, "A", 1e9),
            (found.phase, "phase", 1.0),
            (found.amplitude_lockin, "A_lockin", 1e9),
            (found.phase_lockin, "phase_lockin", 1.0),
            (found.error, "error", 1e9),
            (found.peak_force, "peak_nN", 1e9),
            (found.mean_deflection, "mean_deflection", 1e9),
            (found.contact_fraction, "contact_fraction", 1.0),
        ] {
            near(value * factor, &row[key], 1e-8, &what(key));
        }
        if row.get("E_dis_aJ").is_some() {
            near(found.dissipation * 1e18, &row["E_dis_aJ"], 1e-8, &what("E"));
        }
    }
    for (line, image, key) in [
        (0, &report.trace, "trace"),
        (1, report.retrace.as_ref().unwrap(), "retrace"),
    ] {
        let (expected, line) = (&reference["lines"][key], &report.lines[line]);
        let what = |signal: &str| format!("scan {name}, {key}, {signal}");
        for (value, key) in [
            (line.height_mean, "z_mean"),
            (line.height_rms, "z_rms"),
            (line.height_max, "z_max"),
            (line.height_min, "z_min"),
            (line.error_rms, "error_rms"),
            (line.error_max, "error_max"),
            (line.error_min, "error_min"),
            (line.peak_force_max, "peak_force_max_nN"),
            (line.peak_force_mean, "peak_force_mean_nN"),
            (line.tracking_rms, "tracking_rms"),
        ] {
            near(value * 1e9, &expected[key], 1e-8, &what(key));
        }
        let at = expected["peak_force_max_at_k"].as_u64().unwrap();
        assert_eq!(line.peak_force_max_period as u64, at);
        if let Some(flights) = expected["parachuting"].as_array() {
            assert_eq!(flights.len(), line.parachuting.len(), "{}", what("flights"));
            for (flight, found) in flights.iter().zip(&line.parachuting) {
                assert_eq!(json!(found.first_period), flight["first_k"]);
                assert_eq!(json!(found.periods), flight["periods"]);
                near(found.length * 1e9, &flight["length_nm"], 1e-9, "length");
            }
        }
        let pixels = &expected["pixels"];
        for (values, key, factor) in [
            (&image.height[0], "height", 1e9),
            (&image.amplitude_error[0], "amplitude_error", 1e9),
            (&image.phase[0], "phase", 1.0),
            (&image.peak_force[0], "peak_force_mean_nN", 1e9),
            (&image.peak_force_max[0], "peak_force_max_nN", 1e9),
        ] {
            let expected = pixels[key].as_array().unwrap();
            assert_eq!(expected.len(), values.len());
            for (pixel, (value, expected)) in values.iter().zip(expected).enumerate() {
                near(
                    value * factor,
                    expected,
                    1e-8,
                    &what(&format!("{key} of pixel {pixel}")),
                );
            }
        }
    }
}

#[test]
fn a_step_on_a_linear_sample_agrees() {
    compare("a");
}

#[test]
fn a_patch_of_another_material_under_dmt_agrees() {
    compare("b");
}

#[test]
fn a_particle_at_constant_height_agrees() {
    compare("e");
}
