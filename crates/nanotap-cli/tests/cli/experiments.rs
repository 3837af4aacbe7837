//! Experiments at the terminal.

use crate::util::{Folder, case};

/// An NCHR-class lever of high Q on polystyrene, driven a little above its resonance.
const STIFF: &str = "\
[model]
modes = 2
[cantilever]
lever = \"PPP-NCHR\"
Q = 400
[tip]
radius = \"10 nm\"
[sample]
material = \"polystyrene\"
loss_tangent = 0.1
[drive]
frequency_ratio = 1.001
free_amplitude = \"20 nm\"
[gap]
tip = \"15 nm\"
";

#[test]
fn an_approach_curve_goes_there_and_back() {
    let folder = Folder::new();
    folder.write("lever.toml", STIFF);
    let json = folder
        .run(&[
            "approach",
            "lever.toml",
            "--from",
            "25 nm",
            "--to",
            "5 nm",
            "--points",
            "21",
            "--out",
            "curve.csv",
            "--plot",
            "curve.svg",
            "--json",
        ])
        .json();
    assert_eq!(json["path"].as_str(), Some("curve.csv"));
    let table = json["table"].as_array().unwrap();
    assert_eq!(table.len(), 42);
    let zc = |k: usize| table[k]["zc"].as_f64().unwrap();
    for (k, nm) in [(0, 25.0), (1, 24.0), (20, 5.0), (21, 5.0), (41, 25.0)] {
        assert!((zc(k) / (nm * 1e-9) - 1.0).abs() < 1e-9, "{}", zc(k));
    }
    // 22 nm lies between the reach (20 nm) and the fold (23 nm): free there, tapping back.
    let (there, back) = (&table[3], &table[38]);
    assert_eq!(there["way"], "approach");
    assert_eq!(there["physical"]["F_max"].as_f64(), Some(0.0));
    assert!(back["physical"]["A"].as_f64().unwrap() > 21e-9);
    assert_eq!(json["hysteresis"].as_array().unwrap().len(), 1);
    let folds = json["branches"]["bifurcations"].as_array().unwrap();
    assert!(folds.iter().any(|b| b["kind"] == "fold"));
    let csv = folder.read("curve.csv");
    assert_eq!(csv.lines().count(), 43);
    assert!(csv.starts_with("way,alpha5,") && csv.contains(",E_dis_eV,"));
    assert!(folder.read("curve.svg").contains("<svg"));
    let text = folder
        .run(&["approach", "lever.toml", "--points", "9"])
        .stdout;
    for words in ["hysteresis from", "fold", "retract", "eV"] {
        assert!(text.contains(words), "{words}:\n{text}");
    }
}

#[test]
fn senseless_approaches_are_refused() {
    let folder = Folder::new();
    folder.write("lever.toml", STIFF);
    let run = |arguments: &[&str]| folder.run(&[&["approach", "lever.toml"], arguments].concat());
    run(&["--from", "5 nm", "--to", "20 nm"]).refused(&["from far to near"]);
    run(&["--points", "1"]).refused(&["at least 2"]);
    run(&["--from", "20 kHz"]).refused(&["--from 20 kHz", "length", "frequency"]);
    run(&["--out", "curve.xlsx"]).refused(&["curve.xlsx", ".csv"]);
    case(STIFF, &["--set", "gap.tip=15 kHz"]).refused(&["gap.tip", "length"]);
}
