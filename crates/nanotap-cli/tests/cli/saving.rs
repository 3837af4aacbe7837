//! `nanotap case --out`: a saved case gives the same bytes of every result.

use std::path::{Path, PathBuf};

use crate::util::Folder;

/// A folder of the repository.
fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(path)
}

/// The case files in folders of the repository.
fn shipped() -> Vec<PathBuf> {
    let folders = ["docs/cases", "crates/nanotap-explorer/cases"].map(repository);
    let files = folders
        .iter()
        .flat_map(|folder| std::fs::read_dir(folder).unwrap());
    let mut files: Vec<PathBuf> = files.map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|ending| ending == "toml"));
    files.sort();
    assert!(files.len() > 30, "{files:?}");
    files
}

/// Saves the case with these words, and compares documents of the original and the saved case.
fn same_results(folder: &Folder, file: &str, set: &[&str], studies: &[&[&str]]) {
    let set: Vec<&str> = set.iter().flat_map(|word| ["--set", word]).collect();
    let _ = std::fs::remove_file(folder.path().join("saved.toml"));
    let saved = folder.run(&[&["-q", "case", file, "--out", "saved.toml"], &set[..]].concat());
    assert_eq!(saved.code, 0, "{file}: {}", saved.stderr);
    for study in studies {
        let run = |case: &str, set: &[&str]| {
            folder.run(&[&["-q", study[0], case, "--json"], &study[1..], set].concat())
        };
        let (original, read) = (run(file, &set), run("saved.toml", &[]));
        assert_eq!(original.code, read.code, "{file}: {}", read.stderr);
        assert!(
            original.stdout == read.stdout,
            "{file} {study:?}\n{}",
            folder.read("saved.toml")
        );
    }
}

#[test]
fn every_shipped_case_is_the_same_after_saving() {
    let folder = Folder::new();
    for file in shipped() {
        let text = std::fs::read_to_string(&file).unwrap();
        // A setpoint of two tones is not solved for by `case`, and `orbit` takes long.
        if text.contains("second_f") && text.contains("setpoint") {
            continue;
        }
        let is_nonlinear = text.contains("law =") || text.contains("prony");
        let studies: &[&[&str]] = if is_nonlinear && text.contains("setpoint") {
            // `modes` does not solve for the distance, which the saved case has.
            &[&["orbit", "--harmonics", "2"]]
        } else if is_nonlinear {
            &[&["orbit", "--harmonics", "2"], &["modes"]]
        } else {
            &[
                &["orbit", "--harmonics", "2"],
                &["attractors", "--starts", "3"],
            ]
        };
        same_results(&folder, file.to_str().unwrap(), &[], studies);
    }
}

#[test]
fn changes_tables_and_names_of_files_are_saved() {
    let folder = Folder::new();
    let cases = repository("docs/cases");
    let of = |name: &str| cases.join(name).to_str().unwrap().to_owned();
    let orbit: &[&[&str]] = &[&["orbit"]];
    same_results(
        &folder,
        &of("dmt-table.toml"),
        &["gap.tip=12.3456789 nm"],
        orbit,
    );
    same_results(
        &folder,
        &of("stiff-lever.toml"),
        &["drive.setpoint=0.77", "modes=3"],
        orbit,
    );
    same_results(
        &folder,
        &of("stiff-lever.toml"),
        &["drive.start=tip=3 nm", "gap.tip=15 nm"],
        orbit,
    );
    // What `[scan]` names is relative to its own file.
    let text = std::fs::read_to_string(of("stiff-lever.toml")).unwrap();
    std::fs::create_dir(folder.path().join("inner")).unwrap();
    folder.write("inner/line.csv", "height (nm)\n0\n1\n2\n3\n");
    folder.write(
        "inner/lever.toml",
        format!("{text}\n[scan]\nprofile = \"line.csv\"\nsize = \"20 nm\"\n"),
    );
    let run = folder.run(&["-q", "case", "inner/lever.toml", "--out", "saved.toml"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let saved = folder.read("saved.toml");
    let place = folder.path().join("inner/line.csv");
    assert!(
        saved.contains(&format!("profile = \"{}\"", place.display())),
        "{saved}"
    );
    assert!(saved.contains("size = \"20 nm\""), "{saved}");
}

#[test]
fn a_lever_of_another_catalogue_is_saved_with_its_quantities() {
    let folder = Folder::new();
    folder.write(
        "levers.toml",
        "[lever.\"MINE\"]\nk = \"3 N/m\"\nf0 = \"75 kHz\"\ntip_radius = \"8 nm\"\nsource = \"measured\"\n\
         [material.jelly]\nmodulus = \"20 MPa\"\npoisson = 0.5\nsource = \"measured\"\n",
    );
    folder.write(
        "case.toml",
        "[cantilever]\nlever = \"MINE\"\nQ = 200\n[sample]\nmaterial = \"jelly\"\n\
         [drive]\nfrequency = \"65.7 kHz\"\namplitude = \"1 nm\"\n[gap]\ntip = \"1 nm\"\n",
    );
    let with = ["--catalogue", "levers.toml"];
    let saved = folder.run(
        &[
            &["-q", "case", "case.toml", "--out", "saved.toml"],
            &with[..],
        ]
        .concat(),
    );
    assert_eq!(saved.code, 0, "{}", saved.stderr);
    let original = folder.run(&[&["-q", "orbit", "case.toml", "--json"], &with[..]].concat());
    let read = folder.run(&["-q", "orbit", "saved.toml", "--json"]);
    assert_eq!(
        (original.code, read.code),
        (0, 0),
        "{}{}",
        original.stderr,
        read.stderr
    );
    assert_eq!(original.stdout, read.stdout);
}

#[test]
fn an_unreached_setpoint_is_an_error_in_the_json() {
    let folder = Folder::new();
    let file = repository("docs/cases/stiff-lever.toml");
    let file = file.to_str().unwrap();
    for command in ["case", "orbit", "simulate", "lyapunov"] {
        let run = folder.run(&[
            "-q",
            command,
            file,
            "--set",
            "drive.setpoint=1e-4",
            "--json",
        ]);
        assert_eq!(run.code, 1, "{command}: {}", run.stderr);
        let json: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
        let message = json["error"]["message"].as_str().unwrap();
        assert!(message.contains("is not reached"), "{message}");
        assert!(json.get("alpha5").is_none() && json["physical"].get("tip_gap").is_none());
    }
}

#[test]
fn what_needs_no_distance_searches_for_none() {
    let folder = Folder::new();
    let file = repository("docs/cases/bimodal-polymer.toml");
    let file = file.to_str().unwrap();
    let case = folder.run(&["case", file, "--json"]);
    assert!(
        case.stderr.contains("`bimodal` follows them"),
        "{}",
        case.stderr
    );
    let json = case.json();
    assert_eq!(json["physical"]["free_amplitude"].as_f64(), Some(4e-8));
    assert!(json.get("alpha5").is_none() && json["physical"].get("tip_gap").is_none());
    // A setpoint that no distance has: the modes do not need it.
    let stiff = repository("docs/cases/stiff-lever.toml");
    let modes = folder.run(&[
        "modes",
        stiff.to_str().unwrap(),
        "--set",
        "drive.setpoint=1e-4",
    ]);
    assert_eq!(modes.code, 0, "{}", modes.stderr);
}

/// A lever without a distance.
const LEVER: &str = "\
[cantilever]
k = \"2.8 N/m\"
f0 = \"75 kHz\"
Q = 200
[sample]
stiffness = \"20 N/m\"
damping = \"1e-7 N s/m\"
[drive]
frequency = \"75 kHz\"
free_amplitude = \"20 nm\"
";

#[test]
fn a_key_that_varies_may_be_missing_in_the_case() {
    let folder = Folder::new();
    folder.write("lever.toml", LEVER);
    let over = ["--over", "gap.tip=14 nm:16 nm:2"];
    let sweep = folder.run(&[&["-q", "sweep", "lever.toml", "--json"], &over[..]].concat());
    assert_eq!(sweep.json()["runs"], 2, "{}", sweep.stderr);
    let second = [
        "--over",
        "drive.free_amplitude=19 nm:20 nm:2",
        "--starts",
        "2",
    ];
    let window = folder.run(&[&["-q", "window", "lever.toml"], &over[..], &second].concat());
    assert_eq!(window.code, 0, "{}", window.stderr);
    // Another missing key is still needed.
    let other = [
        "sweep",
        "lever.toml",
        "--over",
        "drive.frequency=70 kHz:75 kHz:2",
    ];
    folder.run(&other).refused(&["gap.tip is missing"]);
}

#[test]
fn a_state_of_a_physical_case_is_in_si() {
    let folder = Folder::new();
    folder.write("lever.toml", format!("{LEVER}[gap]\ntip = \"100 nm\"\n"));
    let run = |state: &str| {
        let arguments = ["-q", "simulate", "lever.toml", "--set", "modes=1", "--json"];
        let more = ["--transient", "0", "--periods", "1", "--state", state];
        folder.run(&[&arguments[..], &more].concat())
    };
    // φ₁(1) = 2: a tip deflection of 5 nm is an amplitude a₁ of 2.5 nm.
    // Without the speed of this run, which is never the same.
    let motion = |state: &str| {
        let done = run(state);
        assert_eq!(done.code, 0, "{}", done.stderr);
        let mut document: serde_json::Value = serde_json::from_str(&done.stdout).unwrap();
        let speed = document.as_object_mut().unwrap();
        assert!(speed.remove("periods_per_second").is_some());
        document
    };
    let tip = motion("tip=5nm");
    for same in ["2.5e-9,0", "a1=2.5 nm", "2.5 nm, 0 m/s"] {
        assert_eq!(motion(same), tip, "{same}");
    }
    run("0.1,0").refused(&["--state", "write the unit"]);
    run("tip=5 kHz").refused(&["--state", "expected a length"]);
}

/// The distance and the motion that a saved case has for its setpoint are those of the case as it was.
#[test]
fn a_saved_distance_is_solved_for_again_where_the_case_changes() {
    let folder = Folder::new();
    let file = repository("docs/cases/stiff-lever.toml");
    let file = file.to_str().unwrap();
    let saved = folder.run(&["-q", "case", file, "--out", "saved.toml"]);
    assert_eq!(saved.code, 0, "{}", saved.stderr);
    let run = |study: &str, case: &str, set: &str| {
        folder
            .run(&["-q", study, case, "--json", "--set", set])
            .json()
    };
    for study in ["orbit", "case"] {
        let changed = |case| run(study, case, "sample.modulus=3 GPa");
        let (mut original, mut read) = (changed(file), changed("saved.toml"));
        for document in [&mut original, &mut read] {
            // Distances of the case as it is before its setpoint is solved for.
            document.as_object_mut().unwrap().remove("case");
        }
        assert_eq!(original, read);
    }
    let nearer = run("orbit", "saved.toml", "drive.setpoint=0.7");
    let ratio = nearer["physical"]["A_ratio"].as_f64().unwrap();
    assert!((ratio - 0.7).abs() < 1e-6, "{ratio}");
    // A distance that is given takes the place of the setpoint.
    let there = run("orbit", "saved.toml", "gap.tip=17 nm");
    assert!(there["case"]["physical"]["setpoint"].is_null());
    assert!(
        there["notes"][0].as_str().unwrap().contains("from rest"),
        "{}",
        there["notes"]
    );
}
