//! Ctrl-C and SIGTERM end a computation within a second, with exit code 130, and keep what is
//! finished.

use std::process::Stdio;
use std::time::{Duration, Instant};

use nanotap::study::registry::STUDIES;

use crate::util::{Folder, Outcome};

/// A lever whose single drive periods take minutes: its contact damping is so strong that steps are
/// 1e-5 of a period.
const STIFF: &str = "\
[model]
modes = 2
[cantilever]
k = \"0.1092 N/m\"
f0 = \"3.987e+04 Hz\"
Q = 4.654
[tip]
radius = \"40.08 nm\"
[sample]
law = \"dmt+exponential-damping\"
modulus = \"1e+07 Pa\"
poisson = 0.49
hamaker = \"1.918e-20 J\"
damping = \"1.15e-08 N s/m\"
decay_length = \"0.3237 nm\"
[drive]
actuation = \"tip\"
frequency_ratio = 1
free_amplitude = \"15.46 nm\"
[gap]
tip = \"12.2 nm\"
";

/// A lever over mica whose distance follows from the setpoint.
const SETPOINT: &str = "\
[model]
modes = 1
[cantilever]
k = \"2 N/m\"
f0 = \"70 kHz\"
Q = 200
[tip]
radius = \"10 nm\"
[sample]
law = \"dmt\"
modulus = \"60 GPa\"
hamaker = \"1e-19 J\"
[drive]
frequency_ratio = 1
free_amplitude = \"10 nm\"
setpoint = 0.9
";

/// Options that make a study take much longer than the test waits; `None` for a study that is
/// always fast.
fn long_work(study: &str) -> Option<Vec<&'static str>> {
    Some(match study {
        "modes" | "noise" | "bimodal" | "image-states" => return None,
        "simulate" => vec!["case.toml", "--transient", "100000000"],
        "attractors" => vec!["case.toml", "--starts", "1000000"],
        "branch" => vec![
            "case.toml",
            "--parameter",
            "omega",
            "--from",
            "2.4",
            "--to",
            "3",
            "--diagram",
            "--values",
            "10000",
        ],
        "approach" | "fm" => vec!["soft.toml", "--points", "20000"],
        "fit" => vec![
            "curve.csv",
            "soft.toml",
            "--free",
            "sample.modulus,cantilever.Q",
        ],
        "reconstruct" => vec!["curve.csv", "soft.toml", "--rows", "2000"],
        "sweep" => vec!["case.toml", "--over", "omega=2.5:2.9:40000"],
        "window" => vec![
            "case.toml",
            "--over",
            "omega=2.5:2.9:200",
            "--over",
            "alpha4=10:30:200",
        ],
        "basin" => vec!["case.toml", "--x", "a1=-1:1:2000", "--y", "v1=-1:1:2000"],
        "lyapunov" => vec!["case.toml", "--periods", "100000000"],
        "orbit" | "convergence" | "contact-laws" => vec!["case.toml", "--period", "10000"],
        "scan" => vec!["scan.toml"],
        "force-curve" => vec!["soft.toml", "--speed", "1 nm/s"],
        "lever" => vec!["setpoint.toml"],
        other => panic!("say how long work of {other} is requested"),
    })
}

fn folder() -> Folder {
    let folder = Folder::with_paper_case();
    folder.write("stiff.toml", STIFF);
    folder.write("setpoint.toml", SETPOINT);
    let scan = include_str!("../../../../docs/cases/scan-step.toml");
    let scan = scan.replace("periods = 5000 ", "periods = 5000000 ");
    folder.write("scan.toml", scan);
    folder.write(
        "soft.toml",
        SETPOINT
            .replace("60 GPa", "50 MPa")
            .replace("setpoint = 0.9\n", "[gap]\ntip = \"8 nm\"\n"),
    );
    // Rows that do not belong to a lever: the search continues from start to start.
    let rows = (0..2000).map(|k| {
        let distance = 12.0 - 0.004 * f64::from(k);
        let wave = 0.2 * f64::from(k % 7);
        format!(
            "{distance},{},{}\n",
            0.9 * distance.min(10.0) + wave,
            100.0 + wave
        )
    });
    let header = "distance (nm),amplitude (nm),phase (deg)\n".to_owned();
    folder.write("curve.csv", rows.fold(header, |table, row| table + &row));
    folder
}

/// Runs the program, sends it `signal` after a while, and returns how long it took to end; `None`
/// if it had ended before.
fn interrupted(folder: &Folder, arguments: &[&str], signal: &str) -> (Outcome, Option<Duration>) {
    let mut child = folder
        .command(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(400));
    let runs = child.try_wait().unwrap().is_none();
    let begun = Instant::now();
    if runs {
        send(signal, child.id());
    }
    let output = child.wait_with_output().unwrap();
    let took = runs.then(|| begun.elapsed());
    let outcome = Outcome {
        code: output.status.code().expect("ended by itself"),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    };
    (outcome, took)
}

fn send(signal: &str, process: u32) {
    let sent = std::process::Command::new("kill")
        .args([signal, &process.to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
}

#[track_caller]
fn assert_stopped(arguments: &[&str], (outcome, took): &(Outcome, Option<Duration>)) {
    let took = took.unwrap_or_else(|| panic!("{arguments:?} is too short: {}", outcome.stderr));
    assert_eq!(outcome.code, 130, "{arguments:?}: {}", outcome.stderr);
    assert!(took < Duration::from_secs(1), "{arguments:?} took {took:?}");
    assert!(
        outcome.stderr.contains("stopped"),
        "{arguments:?}: {}",
        outcome.stderr
    );
}

#[test]
fn every_study_stops_within_a_second() {
    let folder = folder();
    for (index, study) in STUDIES.iter().enumerate() {
        let Some(work) = long_work(study.name) else {
            continue;
        };
        let arguments = [&[study.name], work.as_slice()].concat();
        let signal = ["-INT", "-TERM"][index % 2];
        assert_stopped(&arguments, &interrupted(&folder, &arguments, signal));
    }
}

#[test]
fn setpoints_fixed_steps_and_the_paper_stop_too() {
    let folder = folder();
    for arguments in [
        &["case", "setpoint.toml", "--set", "model.modes=3"][..],
        &["orbit", "setpoint.toml", "--set", "model.modes=3"],
        &[
            "simulate",
            "case.toml",
            "--method",
            "rk4",
            "--steps",
            "10000000",
        ],
        &["paper"],
    ] {
        assert_stopped(arguments, &interrupted(&folder, arguments, "-INT"));
    }
}

/// A single period may take minutes, or be refused because of that after two seconds. (`lyapunov`
/// is refused after 0.3 s, about when the signal arrives: it would race.)
#[test]
fn one_long_period_stops_too() {
    let folder = folder();
    for command in ["simulate", "orbit", "attractors", "approach"] {
        let arguments = [command, "stiff.toml"];
        let found = interrupted(&folder, &arguments, "-INT");
        if found.1.is_some() {
            assert_stopped(&arguments, &found);
        }
    }
}

#[test]
fn a_report_of_cancelled_work_is_marked() {
    let folder = folder();
    for study in ["attractors", "branch"] {
        let work = long_work(study).unwrap();
        let arguments = [&[study, "--json"], work.as_slice()].concat();
        let found = interrupted(&folder, &arguments, "-INT");
        assert_stopped(&arguments, &found);
        let document: serde_json::Value = serde_json::from_str(&found.0.stdout).unwrap();
        assert_eq!(document["cancelled"], true, "{study}");
    }
}

#[test]
fn long_work_reports_progress_to_a_file() {
    let folder = folder();
    let long = ["simulate", "case.toml", "--transient", "100000000"];
    let run = |more: &[&str]| {
        let child = folder
            .command(&[&long, more].concat())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(2600));
        send("-INT", child.id());
        child.wait_with_output().unwrap()
    };
    let said = run(&[]);
    assert!(said.stdout.is_empty());
    let words = String::from_utf8(said.stderr).unwrap();
    assert!(words.starts_with("simulate: 2 s so far\n"), "{words}");
    assert!(!words.contains('\r'), "{words}");
    let quiet = String::from_utf8(run(&["--quiet"]).stderr).unwrap();
    assert_eq!(quiet, "error: stopped before it was done\n");
}
