//! The largest value of an option either works in bounded memory or is refused with the reason.

use std::process::{Command, Stdio};
use std::time::Duration;

use nanotap::study::registry::{STUDIES, StudyEntry};
use nanotap::study::request::properties;

use crate::util::Folder;

/// Address space in KiB: 2 GiB.
const MEMORY: &str = "2097152";

/// Further arguments that a study needs.
fn needed(study: &str) -> &'static [&'static str] {
    match study {
        "branch" => &[
            "--parameter",
            "omega",
            "--from",
            "2.4",
            "--to",
            "3",
            "--diagram",
        ],
        "basin" => &["--x", "a1=-1:1:10", "--y", "v1=-1:1:10"],
        "sweep" => &["--over", "omega=2.5:2.9:5"],
        "window" => &["--over", "omega=2.5:2.9:5", "--over", "alpha4=10:30:5"],
        _ => &[],
    }
}

/// Options that the option `name` needs in order to have an effect.
fn companions(study: &str, name: &str) -> &'static [&'static str] {
    match name {
        "points" if study == "fm" => &[],
        "strobe" | "events" => &["--periods", "2000000"],
        "points" => &["--out", "points.csv"],
        "resolution" => &["--out", "series.csv"],
        "steps" => &["--method", "rk4"],
        _ => &[],
    }
}

/// The options that are whole numbers, with the largest value of each.
fn largest(study: &StudyEntry) -> Vec<(String, u64)> {
    let schema = (study.request)();
    let counts = properties(&schema).filter(|property| property.allows("integer"));
    let largest = counts.filter_map(|property| {
        let most = property.schema["maximum"].as_f64()?;
        Some((property.name.to_owned(), most as u64))
    });
    largest.collect()
}

#[test]
fn the_largest_count_of_every_option_is_refused_or_fits_into_memory() {
    let folder = Folder::with_paper_case();
    let needs_data = ["fit", "reconstruct"];
    for study in STUDIES
        .iter()
        .filter(|study| !needs_data.contains(&study.name))
    {
        for (name, most) in largest(study) {
            let option = format!("--{}", name.replace('_', "-"));
            let most = most.to_string();
            let arguments = [
                &[study.name, "case.toml", option.as_str(), most.as_str()],
                needed(study.name),
                companions(study.name, &name),
            ]
            .concat();
            let limited = format!("ulimit -v {MEMORY}; exec \"$@\"");
            let mut child = Command::new("sh")
                .args(["-c", &limited, "sh", env!("CARGO_BIN_EXE_nanotap")])
                .args(&arguments)
                .current_dir(folder.path())
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()
                .unwrap();
            std::thread::sleep(Duration::from_millis(250));
            if child.try_wait().unwrap().is_none() {
                let sent = Command::new("kill")
                    .args(["-INT", &child.id().to_string()])
                    .status();
                assert!(sent.unwrap().success());
            }
            let output = child.wait_with_output().unwrap();
            let words = String::from_utf8_lossy(&output.stderr);
            let code = output.status.code();
            assert!(
                matches!(code, Some(0 | 1 | 2 | 130)) && !words.contains("panicked"),
                "{arguments:?}: {code:?}, {words}"
            );
            if code == Some(2) {
                assert!(words.contains("help:"), "{arguments:?}: {words}");
            }
        }
    }
}

/// Counts that are too large together are refused before memory is taken.
#[test]
fn counts_that_are_too_large_together_are_refused() {
    let folder = Folder::with_paper_case();
    let many = ["--set", "model.modes=50"];
    let orbit = ["orbit", "case.toml", "--period", "10000"];
    folder.run(&[&orbit[..], &many].concat()).refused(&[
        "10000",
        "100 variables",
        "the largest period is 1677",
    ]);
    let states = [
        "simulate",
        "case.toml",
        "--periods",
        "2000000",
        "--strobe",
        "1000000",
    ];
    folder.run(&[&states[..], &many].concat()).refused(&[
        "1000000 states of 100 numbers",
        "500000 at most",
        "--strobe",
    ]);
    let section = [
        "lyapunov",
        "case.toml",
        "--points",
        "2000000",
        "--out",
        "section.csv",
    ];
    folder
        .run(&[&section[..], &many].concat())
        .refused(&["500000 at most", "--points"]);
    folder
        .run(&["approach", "case.toml", "--points", "1000000"])
        .refused(&["--points", "20000"]);
}
