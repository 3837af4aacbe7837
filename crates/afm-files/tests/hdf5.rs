//! HDF5 files that Python's h5py writes while the test runs, against the numbers that it was given.

use std::fs;
use std::path::Path;
use std::process::Command;

use afm_files::{Error, Limits, open};
use serde_json::Value;

/// Writes curves whose rows are stored in every way that is read, and their numbers as JSON; and one
/// file in the newer layout.
const SCRIPT: &str = r#"
import json, sys
import h5py, numpy as np
random = np.random.default_rng(1)
types = ["<f8", ">f8", "<f4", ">f4", "<i2", ">i4", "<u1", "<i8", ">u2"]
ways = [{}, {"chunks": (7,)}, {"chunks": (400,), "compression": "gzip"}, {"chunks": (1000,), "compression": 9},
        {"chunks": (100,), "compression": "gzip", "shuffle": True, "fletcher32": True},
        {"chunks": (64,), "fletcher32": True}, {"chunks": (999,), "shuffle": True}]
rows = {}
with h5py.File(sys.argv[1] + ".h5", "w") as file:
    file.attrs["software"] = "afmformats"
    file.attrs["software version"] = "0.18.7"
    for number in range(30):
        group = file.create_group(str(number))
        group.attrs["imaging mode"] = "force-distance"
        group.attrs["spring constant"] = 0.1 * (number + 1)
        group.attrs["instrument"] = np.bytes_("fixed") if number % 2 else "Nanomètre"
        for k in range(40):
            group.attrs[f"setting {k}"] = "x" * k
        for k in range(5):
            kind = np.dtype(types[(number + k) % len(types)])
            values = (random.normal(size=1000) * 100).astype(kind)
            group.create_dataset(f"row {k}", data=values, **ways[(2 * number + k) % len(ways)]).attrs["unit"] = "m"
            rows[f"{number}/row {k}"] = [float(of) for of in values]
        group.create_dataset("segment", data=np.arange(1000) >= 600, compression="gzip", fletcher32=True)
with open(sys.argv[1] + ".json", "w") as file:
    json.dump(rows, file)
with h5py.File(sys.argv[1] + "-latest.h5", "w", libver="latest") as file:
    file.attrs["software"] = "afmformats"
    for number in range(30):
        file.create_group(str(number))
"#;

#[expect(clippy::disallowed_methods, reason = "the test's own file ends")]
fn numbers(path: &Path) -> Value {
    let text = fs::read_to_string(path).expect("the numbers of the script");
    serde_json::from_str(&text).expect("JSON")
}

#[test]
fn numbers_are_those_of_h5py() {
    let begin = Path::new(env!("CARGO_TARGET_TMPDIR")).join("written by h5py");
    let python = std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into());
    let mut python = Command::new(python);
    let written = python.args(["-c", SCRIPT]).arg(&begin).output();
    if !written.is_ok_and(|of| of.status.success()) {
        println!("skipped: no Python with h5py; PYTHON may name one");
        return;
    }
    let expected = numbers(&begin.with_extension("json"));
    let document = open(begin.with_extension("h5"), Limits::default()).expect("a document");
    assert_eq!(document.curve_count(), 30);
    let setting = document
        .settings
        .iter()
        .find(|(name, _)| name == "0/instrument");
    assert_eq!(setting.map(|of| of.1.as_str()), Some("Nanomètre"));
    for (number, curve) in document.curves().enumerate() {
        let curve = curve.expect("a curve");
        assert_eq!(curve.index, number);
        assert_eq!(curve.spring_constant, Some(0.1 * (number + 1) as f64));
        let points: Vec<usize> = curve
            .segments
            .iter()
            .map(afm_files::Segment::points)
            .collect();
        assert_eq!(points, [600, 400]);
        for k in 0..5 {
            let name = format!("row {k}");
            let parts = curve
                .segments
                .iter()
                .map(|of| of.channel(&name).expect("a row"));
            let found: Vec<f64> = parts.flat_map(|of| of.values.clone()).collect();
            let expected: Vec<f64> =
                serde_json::from_value(expected[format!("{number}/{name}")].clone())
                    .expect("a row");
            assert_eq!(found, expected, "curve {number}, {name}");
        }
    }
    let latest = begin.with_file_name("written by h5py-latest.h5");
    let error = open(&latest, Limits::default()).expect_err("the newer layout");
    assert!(matches!(error, Error::Unsupported { .. }), "{error}");
    assert!(error.to_string().contains("libver='earliest'"), "{error}");
}
