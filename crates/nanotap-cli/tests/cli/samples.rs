//! Contact laws, actuations and second tones at the terminal.

use crate::util::Folder;

const FAST: [&str; 2] = ["--set", "omega=20"];

/// Comparison of the laws as a table, as JSON, as data and as a figure.
#[test]
fn samples_are_compared() {
    let folder = Folder::with_paper_case();
    let json = folder
        .run(
            &[
                &[
                    "samples",
                    "case.toml",
                    "--json",
                    "--out",
                    "loops.csv",
                    "--plot",
                    "s.svg",
                ],
                &FAST[..],
            ]
            .concat(),
        )
        .json();
    let samples = json["samples"].as_array().unwrap();
    let number = |k: usize, key: &str| samples[k][key].as_f64().unwrap();
    assert_eq!(samples.len(), 3);
    // The paper's damper pulls on the receding tip; a viscoelastic surface does not.
    assert!(number(0, "least_force") < -0.1);
    assert!(number(1, "least_force") > -1e-10 && number(2, "least_force") > -1e-10);
    assert!(
        samples
            .iter()
            .all(|s| s["stable"] == true && s["from_rest"] == "periodic")
    );
    assert_eq!(samples[2]["case"]["relaxation_stiffness"], 40.0);
    assert!(
        folder
            .read("loops.csv")
            .starts_with("contact,indentation,force\n")
    );
    assert!(folder.read("s.svg").contains("kelvin-voigt"));
    let text = folder
        .run(&[&["samples", "case.toml"], &FAST[..]].concat())
        .stdout;
    for words in ["standard-linear-solid", "E_dis", "period 1"] {
        assert!(text.contains(words), "{words}:\n{text}");
    }
    folder
        .run(&["samples", "case.toml", "--arm", "0"])
        .refused(&["holds no damper", "--arm"]);
    folder
        .run(&["samples", "case.toml", "--period", "0"])
        .refused(&["--period 0", "from 1 to"]);
}

/// All analyses accept a sample with memory and name its state.
#[test]
fn a_surface_with_memory_is_analysed_like_any_other() {
    let folder = Folder::with_paper_case();
    let kelvin = ["--set", "contact=kelvin-voigt", "--set", "omega=20"];
    let on = |words: &[&str]| folder.run(&[words, &kelvin[..]].concat());
    let run = on(&["simulate", "case.toml", "--periods", "3", "--json"]).json();
    assert_eq!(run["strobe"][0].as_array().unwrap().len(), 7);
    let orbit = on(&["orbit", "case.toml", "--json"]).json();
    assert!(orbit["determinant_defect"].as_f64().unwrap() < 1e-8);
    assert_eq!(orbit["multipliers"].as_array().unwrap().len(), 7);
    let census = on(&["attractors", "case.toml", "--starts", "8", "--json"]).json();
    assert_eq!(census["box"][6]["coordinate"], "s1");
    let branch = on(&[
        "branch",
        "case.toml",
        "--parameter",
        "alpha6",
        "--from",
        "0.2",
        "--to",
        "0.4",
        "--json",
    ]);
    assert!(branch.json()["points"].as_array().unwrap().len() > 3);
    let basin = on(&[
        "basin",
        "case.toml",
        "--x",
        "a1=-1:1:6",
        "--y",
        "s1=-0.2:0:4",
        "--out",
        "b.zarr",
        "--json",
    ]);
    assert_eq!(basin.code, 0, "{}", basin.stderr);
    let sweep = on(&[
        "sweep",
        "case.toml",
        "--over",
        "alpha6=0.1:0.4:4",
        "--out",
        "s.zarr",
        "--json",
    ]);
    assert_eq!(sweep.code, 0, "{}", sweep.stderr);
    let convergence = on(&["convergence", "case.toml", "--largest", "4", "--json"]).json();
    assert_eq!(convergence["modes"].as_array().unwrap().len(), 4);
    let exponents = on(&["lyapunov", "case.toml", "--json"]);
    assert_eq!(exponents.code, 0, "{}", exponents.stderr);
    on(&["simulate", "case.toml", "--state", "1,2"]).refused(&["the sample's memory"]);
}

/// Two tones at the tip: each with its response, and a map over four periods.
#[test]
fn two_tones_are_driven_and_measured() {
    let folder = Folder::with_paper_case();
    let words = [
        "orbit",
        "case.toml",
        "--json",
        "--set",
        "actuation=tip",
        "--set",
        "alpha5=5",
        "--set",
        "tone2_ratio=25/4",
        "--set",
        "tone2_amplitude=0.2",
        "--set",
        "tone2_phase=30",
    ];
    let orbit = folder.run(&words).json();
    assert!(orbit["tone2_response"].as_f64().unwrap() > 0.0);
    assert!(orbit["tone2_lag"].as_f64().is_some());
    let case = folder.run(&[&["case"], &words[1..]].concat()).json();
    assert_eq!(case["tone2_ratio"], "25/4");
    assert_eq!(case["actuation"], "tip");
    // Four periods of 2π/2.6.
    let period = 4.0 * std::f64::consts::TAU / 2.6;
    assert!((case["period"].as_f64().unwrap() / period - 1.0).abs() < 1e-14);
}

/// A hundred times the Hamaker constant of dForce's example: 1 nm above the sample, the attraction
/// is stiffer than the lever of 0.87 N/m up to the contact; 18 nm above it is not.
#[test]
fn snap_in_is_reported() {
    let folder = Folder::new();
    folder.write(
        "lever.toml",
        include_str!("../../../../docs/cases/dforce-dmt.toml"),
    );
    let says = |gap: &str| {
        let run = folder.run(&[
            "case",
            "lever.toml",
            "--set",
            "sample.hamaker=3e-18 J",
            "--set",
            gap,
        ]);
        assert_eq!(run.code, 0, "{}", run.stderr);
        run.stdout.contains("snaps in")
    };
    assert!(says("gap.tip=1 nm"));
    assert!(!says("gap.tip=18 nm"));
}

/// dForce's example pressed into the sample: at a distance of −60 nm the lever rests at d = −5.968
/// nm, where δ = a0 − d = 6.137 nm exceeds the radius of 5 nm.
#[test]
fn a_rest_position_beyond_the_range_of_the_law_has_a_warning() {
    let folder = Folder::new();
    folder.write(
        "lever.toml",
        include_str!("../../../../docs/cases/dforce-dmt.toml"),
    );
    let pressed = ["case", "lever.toml", "--set", "gap.tip=-60 nm"];
    let run = folder.run(&pressed);
    let warned = "warning: where the lever rests, δ/R reaches 1.227";
    assert!(run.stderr.contains(warned), "{}", run.stderr);
    let document = folder.run(&[&pressed[..], &["--json"]].concat()).json();
    let value = document["out_of_range"][0]["value"].as_f64().unwrap();
    assert!((value - (5.968 + 0.169) / 5.0).abs() < 2e-4, "{value}");
    let free = folder.run(&["case", "lever.toml"]);
    assert!(!free.stderr.contains("δ/R"), "{}", free.stderr);
}

/// Adhesion as a force and as a Hamaker constant contradict each other: a file with both is
/// refused; a value given with `--set` replaces the one in the file, and a note says so.
#[test]
fn replaced_keys_are_reported() {
    let folder = Folder::new();
    folder.write(
        "lever.toml",
        include_str!("../../../../docs/cases/dforce-dmt.toml"),
    );
    let set = ["lever.toml", "--set", "sample.adhesion_force=5 nN"];
    let said = "note: sample.adhesion_force, set in addition to the file, replaces its \
                sample.hamaker = \"3e-20 J\"";
    for command in ["case", "modes"] {
        let run = folder.run(&[&[command], &set[..]].concat());
        assert_eq!(run.code, 0, "{}", run.stderr);
        assert!(run.stderr.contains(said), "{}", run.stderr);
        let away = ["--set", "sample.hamaker="];
        let outcome = folder.run(&[&[command], &set[..], &away[..]].concat());
        assert!(!outcome.stderr.contains("place"), "{}", outcome.stderr);
    }
}

/// A missing table is an error with a remedy, in a file and on the command line.
#[test]
fn a_missing_table_is_an_error() {
    let folder = Folder::new();
    let text = include_str!("../../../../docs/cases/dmt-table.toml");
    folder.write("lever.toml", text.replace("dmt-curve.csv", "nowhere.csv"));
    folder.write("dmt-curve.csv", "gap (nm),force (nN)\n0,0\n1,0\n");
    folder.write("whole.toml", text);
    for words in [
        &["case", "lever.toml"][..],
        &["case", "whole.toml", "--set", "sample.table=nowhere.csv"],
    ] {
        let run = folder.run(words);
        assert_eq!(run.code, 2, "{}", run.stderr);
        let advice = "help: name a CSV file with columns of gap and force";
        assert!(run.stderr.contains(advice), "{}", run.stderr);
    }
}
