//! `nanotap sweep`, `nanotap basin` and `nanotap merge`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::util::Folder;

/// The files of a folder, except those that a killed program was writing.
pub(crate) fn bytes(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_none_or(|ending| ending != "tmp") {
                let name = path.strip_prefix(root).unwrap().to_path_buf();
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

const SMALL: [&str; 6] = [
    "sweep",
    "case.toml",
    "--over",
    "omega=2.9:3.1:40",
    "--periods",
    "8",
];

fn small<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&SMALL, more].concat()
}

#[test]
fn a_sweep_reports_its_motions_and_their_values() {
    let folder = Folder::with_paper_case();
    let json = folder.run(&small(&["--json", "--starts", "2"])).json();
    assert_eq!(json["path"], "case-sweep-omega.zarr");
    assert_eq!(json["runs"], 80);
    assert_eq!(json["counts"]["periodic"], 80);
    assert_eq!(json["counts"]["chaotic"], 0);
    // Period 1 doubles downwards at 2.91372 (reference list): values 0 … 2 are below.
    assert_eq!(
        (&json["periods"]["1"], &json["periods"]["2"]),
        (&74.into(), &6.into())
    );
    assert!(json["seconds"].as_f64().unwrap() > 0.0);
    assert!(
        folder
            .path()
            .join("case-sweep-omega.zarr/.zmetadata")
            .is_file()
    );

    // The same command has nothing left to compute and says so.
    let again = folder.run(&small(&["--starts", "2", "--plot", "s.svg"]));
    assert_eq!(again.code, 0, "{}", again.stderr);
    assert!(again.stderr.contains("there already"), "{}", again.stderr);
    for words in [
        "omega from 2.9 to 3.1 in 40 values",
        "80 runs",
        "period 2",
        "case-sweep-omega.zarr",
    ] {
        assert!(again.stdout.contains(words), "{words}: {}", again.stdout);
    }
    assert!(folder.read("s.svg").contains("max W in a drive period"));
}

#[test]
fn a_table_is_written_next_to_its_dataset() {
    let folder = Folder::with_paper_case();
    let outcome = folder.run(&small(&["--follow", "both", "--out", "runs.csv"]));
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    let table = folder.read("runs.csv");
    assert_eq!(table.lines().count(), 1 + 80);
    let header: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    assert_eq!(
        header[..5],
        ["omega", "start", "direction", "classification", "period"]
    );
    let down = table
        .lines()
        .filter(|l| l.contains(",down,periodic,"))
        .count();
    assert_eq!(down, 40);
    assert_eq!(folder.names(), ["case.toml", "runs.csv", "runs.zarr"]);
}

/// Killed at any moment, the same command continues to the same bytes.
#[cfg(unix)]
#[test]
fn a_killed_sweep_resumes_to_the_same_bytes() {
    let folder = Folder::with_paper_case();
    let chaotic = |out| {
        [
            "sweep",
            "case.toml",
            "--over",
            "omega=2.5:2.9:48",
            "--starts",
            "2",
            "--periods",
            "8",
            "--out",
            out,
        ]
    };
    assert_eq!(
        folder
            .run(&[&chaotic("whole.zarr")[..], &["--threads", "1"]].concat())
            .code,
        0
    );
    // Each time after some more chunks are finished, while the next ones are being computed.
    let finished = || {
        let markers = folder.path().join("killed.zarr/.chunks");
        std::fs::read_dir(markers).map_or(0, Iterator::count)
    };
    for more in [0, 1, 2, 4, 8] {
        let enough = finished() + more;
        let mut child = folder
            .command(&chaotic("killed.zarr"))
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        while finished() < enough && child.try_wait().unwrap().is_none() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        // SIGKILL.
        child.kill().unwrap();
        child.wait().unwrap();
    }
    assert_eq!(folder.run(&chaotic("killed.zarr")).code, 0);
    let (whole, killed) = (
        folder.path().join("whole.zarr"),
        folder.path().join("killed.zarr"),
    );
    assert!(bytes(&whole) == bytes(&killed));
}

/// Ctrl-C keeps what is finished, prints how to resume, and exits with 130; so does SIGTERM, with
/// which clusters end jobs that exceed their time.
#[cfg(unix)]
#[test]
fn an_interrupted_sweep_prints_how_to_resume() {
    for signal in ["-INT", "-TERM"] {
        interrupted_by(signal);
    }
}

#[cfg(unix)]
fn interrupted_by(signal: &str) {
    let folder = Folder::with_paper_case();
    let arguments = [
        "sweep",
        "case.toml",
        "--over",
        "omega=3.2:3.6:40000",
        "--periods",
        "8",
        "--out",
        "long.zarr",
    ];
    let child = folder
        .command(&arguments)
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let marker = folder.path().join("long.zarr/.chunks/0");
    for _ in 0..12_000 {
        if marker.exists() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    assert!(marker.exists(), "no chunk in two minutes");
    let interrupt = std::process::Command::new("kill")
        .args([signal, &child.id().to_string()])
        .status()
        .unwrap();
    assert!(interrupt.success());
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(130), "{stderr}");
    for words in [
        "stopped",
        "chunks are finished",
        "long.zarr",
        "run the same command again",
    ] {
        assert!(stderr.contains(words), "{words}: {stderr}");
    }
    assert!(output.stdout.is_empty());
}

#[test]
fn shares_merge_to_the_bytes_of_one_machine() {
    let folder = Folder::with_paper_case();
    assert_eq!(folder.run(&small(&["--out", "whole.zarr"])).code, 0);
    for (share, out) in [("1/2", "a.zarr"), ("2/2", "b.zarr")] {
        let json = folder
            .run(&small(&["--chunk", share, "--out", out, "--json"]))
            .json();
        assert_eq!(
            (&json["finished"], &json["chunks"]),
            (&20.into(), &40.into())
        );
    }
    let half = folder.run(&["merge", "a.zarr", "--out", "merged.zarr"]);
    assert_eq!(half.code, 1);
    assert!(
        half.stderr.contains("20 chunks are missing"),
        "{}",
        half.stderr
    );
    let all = folder
        .run(&[
            "merge",
            "a.zarr",
            "b.zarr",
            "--out",
            "merged.zarr",
            "--json",
        ])
        .json();
    assert_eq!((&all["chunks"], &all["copied"]), (&40.into(), &20.into()));
    // Only the continuation to neighbouring values is left to compute.
    assert_eq!(folder.run(&small(&["--out", "merged.zarr"])).code, 0);
    let of = |name: &str| bytes(&folder.path().join(name));
    assert!(of("whole.zarr") == of("merged.zarr"));
    folder
        .run(&small(&[
            "--chunk", "1/2", "--out", "c.zarr", "--plot", "c.svg",
        ]))
        .refused(&["--chunk 1/2", "merge the shares"]);
    folder
        .run(&["merge", "nowhere.zarr", "--out", "m.zarr"])
        .refused(&["nowhere.zarr", "does not exist"]);
    folder
        .run(&["merge", "a.zarr", "--out", "m.csv"])
        .refused(&["use .zarr"]);
    folder
        .run(&["merge", "--out", "m.zarr"])
        .refused(&["DATASET"]);
}

#[test]
fn a_dataset_of_another_case_is_not_touched() {
    let folder = Folder::with_paper_case();
    assert_eq!(folder.run(&small(&["--out", "s.zarr"])).code, 0);
    let before = bytes(&folder.path().join("s.zarr"));
    folder
        .run(&small(&[
            "--out",
            "s.zarr",
            "--set",
            "contact_stiffness=25",
        ]))
        .refused(&[
            "s.zarr belongs to another case",
            "case.alpha4: 20.0 there, 25.0 here",
            "--out",
        ]);
    folder
        .run(&small(&["--out", "s.zarr", "--transient", "50"]))
        .refused(&["sweep.transient: nothing there, 50 here"]);
    assert!(before == bytes(&folder.path().join("s.zarr")));
    folder.write("thesis.zarr", "mine");
    folder
        .run(&small(&["--out", "thesis.zarr"]))
        .refused(&["thesis.zarr", "not a dataset"]);
    assert_eq!(folder.read("thesis.zarr"), "mine");
}

#[test]
fn invalid_sweep_requests_are_refused() {
    let folder = Folder::with_paper_case();
    let refused = |more: &[&str], words: &[&str]| {
        folder
            .run(&[&["sweep", "case.toml"], more].concat())
            .refused(words);
    };
    refused(&[], &["--over"]);
    for (over, word) in [
        ("omega", "missing `=`"),
        ("omega=2:4", "are needed"),
        ("omega=2:4:400:log:5", "too many"),
        ("omega=2:4:400:cubic", "`log`"),
        ("omga=2:4:400", "did you mean `omega`"),
        ("omega=two:4:400", "first value `two`"),
        ("omega=2:4:0", "from 1 to"),
        ("omega=2:4:-3", "whole number"),
        ("omega=2:4:2.5", "whole number"),
        ("omega=4:2:400", "--follow down"),
        ("omega=2:nan:4", "finite"),
        ("omega=0:4:5", "`omega` = 0"),
        ("alpha4=-5:5:5", "`alpha4` = -5"),
        ("alpha5=-1:1:9:log", "above 0"),
        ("modes=1:5:4", "whole"),
        ("modes=0:5:6", "whole"),
        ("omega=2,3,3", "3 before 3"),
        ("omega=2,x", "the value `x`"),
        ("temperature=1:2:3", "no parameter"),
    ] {
        refused(&["--over", over], &[word]);
    }
    let omega = ["--over", "omega=2:4:5"];
    let with = |more: &[&str], words: &[&str]| refused(&[&omega, more].concat(), words);
    with(&omega, &["`omega` is varied twice"]);
    with(
        &["--over", "alpha1=0:1:2", "--over", "alpha2=0:1:2"],
        &["one or two"],
    );
    with(&["--starts", "0"], &["--starts 0"]);
    with(&["--starts", "x"], &["--starts"]);
    with(&["--starts", "2", "--state", "0,0,0,0,0,0"], &["--state"]);
    with(&["--state", "0,0"], &["2 numbers where 6"]);
    with(&["--state", "0,0,0,0,0,nan"], &["`nan`"]);
    with(&["--starts", "2", "--box", "a9=0:1"], &["a9", "a1, a2, a3"]);
    with(&["--starts", "2", "--box", "a1=1:0"], &["upwards"]);
    with(&["--box", "a1=0:1"], &["--starts"]);
    with(&["--follow", "sideways"], &["up, down, both"]);
    with(&["--periods", "0"], &["--periods 0"]);
    with(&["--max-period", "0"], &["--max-period 0"]);
    with(&["--threads", "0"], &["--threads 0"]);
    with(&["--chunk", "3/2"], &["3/2"]);
    with(&["--chunk", "half"], &["half"]);
    with(&["--out", "s.hdf5"], &[".zarr or .csv"]);
    with(&["--plot", "s.jpeg"], &["s.jpeg"]);
    with(&["--periods", "90000000"], &["GiB"]);
    assert_eq!(folder.names(), ["case.toml"]);
}

#[test]
fn basins_report_their_attractors() {
    let folder = Folder::with_paper_case();
    let arguments = [
        "basin",
        "case.toml",
        "--set",
        "omega=20",
        "--set",
        "alpha1=0",
        "--x",
        "a1=-1:1:16",
        "--y",
        "v1=-4:4:14",
        "--starts",
        "24",
    ];
    let json = folder
        .run(&[&arguments[..], &["--json", "--plot", "b.png"]].concat())
        .json();
    assert_eq!(json["path"], "case-basin-a1-v1.zarr");
    assert_eq!(json["points"], 224);
    // At Ω = 20, α1 = 0 a period-1 and a period-4 motion coexist (reference list).
    let attractors = json["attractors"].as_array().unwrap();
    let mut periods: Vec<u64> = attractors
        .iter()
        .map(|a| a["period"].as_u64().unwrap())
        .collect();
    periods.sort_unstable();
    assert_eq!(periods, [1, 4]);
    let sum: f64 = attractors
        .iter()
        .map(|a| a["fraction"].as_f64().unwrap())
        .sum();
    assert!((sum + json["unsettled"].as_f64().unwrap() - 1.0).abs() < 1e-12);
    assert!(json["seconds"].as_f64().unwrap() > 0.0);

    let text = folder.run(&[&arguments[..], &["--out", "case-basin-a1-v1.csv"]].concat());
    assert_eq!(text.code, 0, "{}", text.stderr);
    assert!(text.stdout.contains("period 4") && text.stdout.contains("16 by 14 starts"));
    let table = folder.read("case-basin-a1-v1.csv");
    assert_eq!(table.lines().next(), Some("v1,a1,attractor"));
    assert_eq!(table.lines().count(), 225);

    // Attractors from a file.
    let census = folder.run(&[
        "attractors",
        "case.toml",
        "--set",
        "omega=20",
        "--set",
        "alpha1=0",
        "--starts",
        "64",
        "--json",
    ]);
    folder.write("attractors.json", &census.stdout);
    let given = [
        &arguments[..10],
        &[
            "--attractors",
            "attractors.json",
            "--out",
            "g.zarr",
            "--json",
        ],
    ]
    .concat();
    let given = folder.run(&given).json();
    assert_eq!(given["attractors"].as_array().unwrap().len(), 2);
}

#[test]
fn invalid_basin_requests_are_refused() {
    let folder = Folder::with_paper_case();
    let refused = |x: &str, y: &str, more: &[&str], words: &[&str]| {
        let arguments = [&["basin", "case.toml", "--x", x, "--y", y], more].concat();
        folder.run(&arguments).refused(words);
    };
    let (x, y) = ("a1=-1:1:5", "v1=-4:4:5");
    for bad in [
        "a1",
        "a1=0:1",
        "a1=0:1:2:3",
        "a1=x:1:5",
        "a1=0:inf:5",
        "a1=0:1:1",
        "a1=1:0:5",
        "a1=0:1:-2",
    ] {
        refused(bad, y, &[], &["--x", bad]);
        refused(x, bad, &[], &["--y", bad]);
    }
    refused("a4=0:1:5", y, &[], &["a4", "a1, a2, a3, v1, v2, v3"]);
    refused(x, "a1=0:1:5", &[], &["both axes"]);
    refused(x, y, &["--state", "0,0"], &["2 numbers where 6"]);
    refused(x, y, &["--starts", "0"], &["--starts 0"]);
    refused(x, y, &["--periods", "0"], &["--periods 0"]);
    refused(x, y, &["--threads", "0"], &["--threads 0"]);
    refused(x, y, &["--attractors", "none.json"], &["none.json"]);
    folder.write("strange.json", "{\"attractors\": [{\"state\": [\"x\"]}]}");
    refused(
        x,
        y,
        &["--attractors", "strange.json"],
        &["strange.json", "no `state`"],
    );
    folder
        .run(&["basin", "case.toml", "--x", x])
        .refused(&["--y"]);
    assert_eq!(folder.names(), ["case.toml", "strange.json"]);
}

/// Runs from one state say which it is, and how to list what others lead to.
#[test]
fn a_sweep_says_from_which_state_its_runs_start() {
    let folder = Folder::with_paper_case();
    let sweep = [
        "-q",
        "sweep",
        "case.toml",
        "--over",
        "omega=3,3.1",
        "--periods",
        "2",
        "--json",
    ];
    let notes = |more: &[&str], out: &str| {
        let words = [&sweep[..], more, &["--out", out]].concat();
        folder.run(&words).json()["notes"].clone()
    };
    let from = |notes: serde_json::Value, start: &str| {
        let note = notes[0].as_str().unwrap();
        let expected = format!("the runs start from {start}; other initial states may lead to");
        assert!(
            note.starts_with(&expected) && note.contains("`attractors`"),
            "{note}"
        );
    };
    from(notes(&[], "rest.zarr"), "rest");
    let state = ["--state", "0.1,0,0,0,0,0"];
    from(notes(&state, "state.zarr"), "the given state");
    assert!(notes(&["--starts", "2"], "starts.zarr").is_null());
    let lever = crate::util::shipped_case("stiff-lever.toml");
    let over = [
        "--over",
        "sample.loss_tangent=0.1,0.11",
        "--json",
        "--out",
        "lever.zarr",
    ];
    let lever = folder
        .run(&[&["-q", "sweep", &lever], &over[..]].concat())
        .json();
    from(lever["notes"].clone(), "the motion at the setpoint");
}
