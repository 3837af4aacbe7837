//! `nanotap calibrate`: a lever from its thermal noise.

use std::f64::consts::PI;
use std::fmt::Write as _;

use serde_json::Value;

use crate::instrument_files::samples;
use crate::util::Folder;

const F0: f64 = 75e3;
const Q: f64 = 60.0;
/// Mean square in m² of a lever of 2.8 N/m at 25 °C: 0.817435 kB T/k.
const MEAN_SQUARE: f64 = 0.817_434_8 * 1.380_649e-23 * 298.15 / 2.8;

/// One-sided power density in m²/Hz, without scatter.
fn density(f: f64) -> f64 {
    let r = f / F0;
    let shape = 1.0 / ((1.0 - r * r).powi(2) + (r / Q).powi(2));
    let peak = 2.0 * MEAN_SQUARE / (PI * F0 * Q);
    peak * (shape + 1e-3 * Q * Q)
}

/// A table of frequency and density with these heads.
fn table(head: &str, value: impl Fn(f64) -> f64) -> String {
    let mut text = format!("{head}\n");
    for k in 1..2000 {
        let f = 100.0 * f64::from(k);
        writeln!(text, "{},{:e}", f / 1e3, value(f)).unwrap();
    }
    text
}

fn close(found: &Value, expected: f64, tolerance: f64) {
    let found = found.as_f64().unwrap();
    assert!(
        (found / expected - 1.0).abs() < tolerance,
        "{found} {expected}"
    );
}

#[test]
fn a_table_of_a_power_density() {
    let folder = Folder::new();
    folder.write(
        "psd.csv",
        table("frequency (kHz),PSD (pm^2/Hz)", |f| 1e24 * density(f)),
    );
    let words = [
        "calibrate",
        "psd.csv",
        "--averages",
        "100",
        "--temperature",
        "25",
    ];
    let found = folder.run(&[&words[..], &["--json"]].concat()).json();
    close(&found["stiffness"]["value"], 2.8, 1e-5);
    close(&found["frequency"]["value"], F0, 1e-7);
    close(&found["quality"]["value"], Q, 1e-5);
    let ends = [0, 1].map(|k| found["stiffness"]["interval"][k].as_f64().unwrap());
    assert!(ends[0] < 2.8 && 2.8 < ends[1], "{ends:?}");

    let shown = folder.run(&[&words[..], &["--plot", "psd.svg", "--out", "fit.csv"]].concat());
    for words in [
        "spring constant k",
        "2.8 N/m",
        "β = 0.9707",
        "χ = 1.090",
        "[cantilever]",
    ] {
        assert!(shown.stdout.contains(words), "{}", shown.stdout);
    }
    assert!(folder.read("psd.svg").contains("density / fit"));
    let csv = folder.read("fit.csv");
    assert!(
        csv.starts_with("frequency (Hz),density (m^2/Hz),fit (m^2/Hz),ratio\n"),
        "{csv}"
    );
    assert_eq!(csv.lines().count(), 2000);
}

/// The block is part of a valid case, k_error included.
#[test]
fn the_block_can_be_pasted() {
    let folder = Folder::new();
    folder.write("psd.csv", table("frequency (kHz),PSD (m^2/Hz)", density));
    let found = folder
        .run(&["calibrate", "psd.csv", "--averages", "9", "--json"])
        .json();
    let block = found["cantilever"].as_str().unwrap();
    let rest = "[sample]\nstiffness = \"5 N/m\"\n[drive]\nactuation = \"tip\"\nfrequency_ratio = 1\n\
                free_amplitude = \"10 nm\"\n[gap]\ntip = \"8 nm\"\n";
    folder.write("case.toml", format!("{block}{rest}"));
    let case = folder.run(&["case", "case.toml", "--out", "resolved.toml"]);
    assert_eq!(case.code, 0, "{}", case.stderr);
    let text = folder.read("resolved.toml");
    assert!(text.contains("k_error = 0.0"), "{text}");
    folder
        .run(&["case", "case.toml", "--set", "cantilever.k_error=2"])
        .refused(&["k_error", "below 1"]);
}

/// The same lever as an amplitude density in V, from averages of amplitudes, two-sided.
#[test]
fn other_ways_to_write_the_spectrum() {
    let folder = Folder::new();
    let stiffness = |words: &[&str]| {
        let words = [&["calibrate", "psd.csv", "--json"], words].concat();
        folder.run(&words).json()["stiffness"]["value"].clone()
    };
    // 40 nm/V.
    let volts = |f: f64| density(f).sqrt() / 40e-9;
    folder.write(
        "psd.csv",
        table("frequency (kHz),ASD (uV/sqrt(Hz))", |f| 1e6 * volts(f)),
    );
    assert!(stiffness(&[]).is_null());
    let sensitivity = ["--sensitivity", "40 nm/V", "--averages", "100"];
    close(&stiffness(&sensitivity), 2.8, 1e-5);
    // Amplitudes: π/4 + (1 − π/4)/100 of the power.
    let low = 0.25 * PI + (1.0 - 0.25 * PI) / 100.0;
    let amplitudes = [&sensitivity[..], &["--average", "amplitudes"]].concat();
    close(&stiffness(&amplitudes), 2.8 * low, 1e-5);
    folder.write(
        "psd.csv",
        table("frequency (kHz),PSD (m^2/Hz)", |f| 0.5 * density(f)),
    );
    close(&stiffness(&["--two-sided", "--averages", "9"]), 2.8, 1e-5);
    // A column without a unit.
    folder.write(
        "psd.csv",
        table("frequency (kHz),noise", |f| 1e24 * density(f)),
    );
    close(
        &stiffness(&["--unit", "pm^2/Hz", "--averages", "9"]),
        2.8,
        1e-5,
    );
}

/// A lever without a known sensitivity: k and sensitivity by Sader's method.
#[test]
fn sensitivity_without_contact() {
    let folder = Folder::new();
    let volts = |f: f64| density(f) / 40e-9 / 40e-9;
    folder.write("psd.csv", table("frequency (kHz),PSD (V^2/Hz)", volts));
    let words = [
        "calibrate",
        "psd.csv",
        "--averages",
        "9",
        "--length",
        "225 um",
        "--width",
        "38 um",
    ];
    let found = folder.run(&[&words[..], &["--json"]].concat()).json();
    let (k, s) = (
        found["stiffness"]["value"].as_f64(),
        found["sensitivity"]["value"].as_f64(),
    );
    // k s² of equipartition does not depend on either.
    let product = k.unwrap() * s.unwrap() * s.unwrap();
    assert!(
        (product / (2.8 * 40e-9 * 40e-9) - 1.0).abs() < 1e-5,
        "{product}"
    );
    let text = folder.run(&words).stdout;
    assert!(
        text.contains("by Sader's method, because no sensitivity is known"),
        "{text}"
    );
}

/// All power of a record is that of its mode: k = 0.8174 kB T/⟨x²⟩ with the variance of the record.
#[test]
fn a_record_of_the_deflection() {
    let folder = Folder::new();
    // An oscillator at 50 kHz with Q = 20, sampled at 1 MHz, driven by uniform noise.
    let (omega, decay) = (2.0 * PI * 0.05, PI * 0.05 / 20.0);
    let (a, b) = (2.0 * (-decay).exp() * omega.cos(), (-2.0 * decay).exp());
    let mut state = 0x2545_F491_4F6C_DD1D_u64;
    let (mut x, mut before) = (0.0, 0.0);
    let mut record = Vec::new();
    for _ in 0..200_000 {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        let noise = (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
        (x, before) = (a * x - b * before + noise, x);
        record.push(x);
    }
    let record = &record[100_000..];
    let variance = record.iter().map(|x| x * x).sum::<f64>() / record.len() as f64;
    // In nm, 0.2 nm rms.
    let scale = 0.2 / variance.sqrt();
    let mut text = "deflection (nm)\n".to_owned();
    for x in record {
        writeln!(text, "{:e}", scale * x).unwrap();
    }
    folder.write("record.csv", text);
    let words = [
        "calibrate",
        "record.csv",
        "--rate",
        "1 MHz",
        "--temperature",
        "25",
        "--json",
    ];
    let found = folder.run(&words).json();
    let k = 0.817_434_8 * 1.380_649e-23 * 298.15 / 0.2e-9_f64.powi(2);
    close(&found["stiffness"]["value"], k, 0.04);
    close(&found["frequency"]["value"], 50e3, 2e-3);
    close(&found["quality"]["value"], 20.0, 0.08);
    folder
        .run(&words[..2])
        .refused(&["neither a time nor a frequency", "--rate"]);
}

#[test]
fn what_a_file_states_is_used() {
    let folder = Folder::new();
    folder.write("noise.tnd", samples::thermal());
    // The sample has a few bins only: it is refused for that, not for its units.
    let run = folder.run(&["calibrate", "noise.tnd"]);
    run.refused(&["bins from", "at least 16"]);
    folder
        .run(&["calibrate", "noise.tnd", "--spectrum", "none"])
        .refused(&["no spectrum `none`", "there are"]);
}

#[test]
fn faulty_requests_are_refused_with_the_remedy() {
    let folder = Folder::new();
    folder.write("psd.csv", table("frequency (kHz),PSD (m^2/Hz)", density));
    let refused = |words: &[&str], says: &[&str]| {
        folder
            .run(&[&["calibrate", "psd.csv"], words].concat())
            .refused(says);
    };
    refused(&["--sensitivity", "40 nm/V"], &["the spectrum is in m"]);
    refused(
        &["--sensitivity", "40 nm"],
        &["a length per voltage", "40 nm/V"],
    );
    refused(
        &["--unit", "N"],
        &["not that of a spectral density", "pm^2/Hz"],
    );
    refused(&["--exclude", "50 kHz"], &["LOW:HIGH"]);
    refused(
        &["--width", "30 um"],
        &["--length", "Sader's method needs both"],
    );
    refused(&["--reference", "2 N/m"], &["K,F0,Q"]);
    refused(&["--from", "70 kHz", "--to", "70.5 kHz"], &["at least 16"]);
    refused(
        &["--column", "noise"],
        &["no column `noise`", "PSD (m^2/Hz)"],
    );
    folder.write("psd.csv", "distance (nm),force (nN)\n1,2\n");
    refused(&[], &["neither a time nor a frequency"]);
    folder
        .run(&["calibrate", "none.tnd"])
        .refused(&["none.tnd: no such file"]);
}

#[test]
fn the_document_has_the_entries_of_its_schema() {
    let folder = Folder::new();
    folder.write("psd.csv", table("frequency (kHz),PSD (m^2/Hz)", density));
    let document = folder.run(&["calibrate", "psd.csv", "--json"]).json();
    let schema = folder.run(&["schema", "calibrate"]).json();
    for name in document.as_object().unwrap().keys() {
        assert!(schema["report"]["properties"][name].is_object(), "{name}");
    }
    for name in schema["report"]["required"].as_array().unwrap() {
        assert!(document.get(name.as_str().unwrap()).is_some(), "{name}");
    }
}

/// An option that has no effect on what is read is refused, and another unit than the stated one is noted.
#[test]
fn options_without_effect_are_refused() {
    let folder = Folder::new();
    folder.write(
        "psd.csv",
        table("frequency (kHz),PSD (pm^2/Hz)", |f| 1e24 * density(f)),
    );
    for (option, value, words) in [
        ("--segment", "256", "is for a record of the deflection"),
        (
            "--spectrum",
            "1",
            "names a spectrum of an instrument's file",
        ),
    ] {
        folder
            .run(&["calibrate", "psd.csv", option, value])
            .refused(&[option, "has no effect on `PSD`", words]);
    }
    let found = folder.run(&["calibrate", "psd.csv", "--unit", "fm^2/Hz", "--json"]);
    let notes = found.json()["notes"].to_string();
    assert!(notes.contains("its own unit is"), "{notes}");
    close(&found.json()["stiffness"]["value"], 2.8e6, 1e-5);
}
