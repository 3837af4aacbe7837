//! Hostile input for every command and every reader: mutated cases, tables, instruments' files,
//! datasets, documents and requests of the page. Each run ends by itself or within a second of
//! Ctrl-C, in 2 GiB of memory, with an exit code that the program documents and a reason if it
//! failed.
//!
//! The inputs are the same each time. `NANOTAP_FUZZ=20` takes twenty times as many, from other seeds.

#![cfg(unix)]
#![allow(clippy::disallowed_methods, reason = "files and folders of a test")]

mod mutation;
mod page;
mod program;
#[path = "../../../afm-files/tests/samples/mod.rs"]
mod samples;
#[allow(dead_code, reason = "shared with other tests")]
#[path = "../cli/util.rs"]
mod util;

use std::path::{Path, PathBuf};
use std::time::Duration;

use mutation::{Random, VALUES};
use program::{none_wrong, run};
use util::Folder;

/// Runs of each test. All together take about a minute of a machine with two cores.
const CASES: usize = 900;
const TABLES: usize = 240;
const RECORDINGS: usize = 200;
const DATASETS: usize = 60;
/// How long a computation goes on before Ctrl-C; most inputs are refused at once.
const PATIENCE: Duration = Duration::from_millis(120);

/// The seeds of a test of so many runs.
pub(crate) fn seeds(runs: usize) -> impl Iterator<Item = u64> {
    let times = std::env::var("NANOTAP_FUZZ").ok();
    match times.and_then(|times| times.parse::<usize>().ok()) {
        Some(times) => 1_000_000..1_000_000 + (runs * times) as u64,
        None => 0..runs as u64,
    }
}

/// The case files of the repository.
fn cases() -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders = [
        "docs/cases",
        "crates/nanotap-explorer/cases",
        "crates/nanotap-cli/tests/contract/cases",
    ];
    let listing = |folder: &&str| std::fs::read_dir(root.join(folder)).unwrap();
    let paths = folders.iter().flat_map(listing);
    let paths = paths.map(|entry| entry.unwrap().path());
    let mut paths: Vec<PathBuf> = paths
        .filter(|path| path.extension().is_some_and(|ending| ending == "toml"))
        .collect();
    paths.sort();
    let texts: Vec<String> = paths
        .iter()
        .map(|path| std::fs::read_to_string(path).unwrap())
        .collect();
    assert!(texts.len() > 30);
    texts
}

/// The commands that the program lists.
fn commands() -> Vec<String> {
    let help = Folder::new().run(&["--help"]).stdout;
    let list = help.split_once("Commands:\n").unwrap().1;
    let list = list.split_once("\n\n").unwrap().0;
    let names = list
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let names = names.filter_map(|line| line.split_whitespace().next().map(str::to_owned));
    let names: Vec<String> = names.filter(|name| name != "help").collect();
    assert!(names.len() > 25, "{help}");
    names
}

/// The arguments of a command for `case.toml`.
fn arguments(command: &str, random: &mut Random) -> Vec<String> {
    let key = random.one(&[
        "omega",
        "gap.tip",
        "drive.frequency",
        "gap",
        "sample.modulus",
    ]);
    let range = random.one(&[
        "2.4:3:3",
        "5 nm:20 nm:3",
        "70 kHz:72 kHz:2",
        "0:nan:2",
        "1:1:0",
    ]);
    let over = format!("{key}={range}");
    let parts: Vec<&str> = match command {
        "catalogue" => vec![],
        "generate" => vec!["bash"],
        "schema" => vec!["orbit"],
        "paper" => vec!["--out", "paper", "--quick"],
        "merge" => vec!["case.toml", "none.zarr", "--out", "merged.zarr"],
        "explore" => vec!["case.toml", "--no-browser"],
        "fit" => vec!["table.csv", "case.toml", "--free", "sample.modulus"],
        "reconstruct" => vec!["table.csv", "case.toml"],
        "branch" => vec![
            "case.toml",
            "--parameter",
            key,
            "--from",
            "2.4",
            "--to",
            "3",
        ],
        "sweep" => vec!["case.toml", "--over", &over],
        "window" => vec!["case.toml", "--over", &over, "--over", "alpha4=10:30:2"],
        "basin" => vec!["case.toml", "--x", "a1=-1:1:4", "--y", "v1=-1:1:4"],
        _ => vec!["case.toml"],
    };
    let mut all = vec![command.to_owned()];
    all.extend(parts.into_iter().map(str::to_owned));
    let plain = |value: &str| value.trim_matches('"').to_owned();
    if random.rarely(3) {
        all.extend([
            "--set".to_owned(),
            format!("{key}={}", plain(random.one(VALUES))),
        ]);
    }
    if random.rarely(3) {
        let options = [
            "--period",
            "--periods",
            "--points",
            "--starts",
            "--state",
            "--seed",
            "--threads",
            "--transient",
            "--from",
            "--to",
            "--speed",
            "--lines",
            "--modes",
            "--law",
            "--out",
        ];
        let value = plain(random.one(VALUES));
        all.push(format!("{}={value}", random.one(&options)));
    }
    if random.rarely(2) {
        all.push("--json".to_owned());
    }
    all
}

/// Every command on mutated cases, with hostile values of options.
#[test]
fn cases_and_options() {
    let mut found = Vec::new();
    let folder = Folder::new();
    folder.write(
        "table.csv",
        "distance (nm),amplitude (nm)\n20,10\n18,9\n16,8\n",
    );
    let (cases, commands) = (cases(), commands());
    for seed in seeds(CASES) {
        let random = &mut Random::new(seed);
        let text = &cases[random.below(cases.len())];
        let mut file = mutation::case(random, text).into_bytes();
        if random.rarely(5) {
            mutation::bytes(random, &mut file);
        }
        folder.write("case.toml", file);
        let command = &commands[seed as usize % commands.len()];
        found.extend(run(&folder, &arguments(command, random), PATIENCE));
    }
    none_wrong(&found);
}

/// Every reader of tables, catalogues and documents.
#[test]
fn tables_catalogues_and_documents() {
    let mut found = Vec::new();
    let folder = Folder::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let read = |name: &str| std::fs::read_to_string(root.join(name)).unwrap();
    folder.write("fit.toml", read("docs/cases/stiff-lever.toml"));
    folder.write("table.toml", read("docs/cases/dmt-table.toml"));
    folder.write("dmt-curve.csv", read("docs/cases/dmt-curve.csv"));
    folder.write("arms.toml", read("docs/cases/polyisobutylene.toml"));
    folder.write("paper.toml", util::PAPER);
    folder.write("scan.toml", read("docs/cases/scan-step.toml"));
    let curve = read("docs/cases/polystyrene-curve.csv");
    let forces = "gap (nm),force (nN)\n-1,8.5\n-0.5,2\n0,-1\n1,-0.3\n9,0\n";
    let arms = "time (us),modulus (MPa)\n0.38,460\n1.7,136\n";
    let catalogue = read("crates/nanotap-cli/tests/contract/cases/catalogue.toml");
    let attractors = serde_json::json!({"attractors": [{"state": [0.1, 0, 0, 0, 0, 0]}]});
    let image = image();
    for seed in seeds(TABLES) {
        let random = &mut Random::new(seed);
        let words: &[&str] = match seed % 7 {
            0 => {
                folder.write("table.csv", mutation::table(random, &curve));
                &["fit", "table.csv", "fit.toml", "--free", "sample.modulus"]
            }
            1 => {
                folder.write("table.csv", mutation::table(random, &curve));
                &["reconstruct", "table.csv", "fit.toml"]
            }
            2 => {
                folder.write("table.csv", mutation::table(random, forces));
                &["case", "table.toml", "--set", "sample.table=table.csv"]
            }
            3 => {
                folder.write("table.csv", mutation::table(random, arms));
                &["case", "arms.toml", "--set", "sample.arms=table.csv"]
            }
            4 => {
                folder.write("levers.toml", mutation::case(random, &catalogue));
                &["catalogue", "--catalogue", "levers.toml"]
            }
            5 => {
                let mut document = attractors.clone();
                mutation::json(random, &mut document);
                folder.write("found.json", document.to_string());
                &[
                    "basin",
                    "paper.toml",
                    "--x",
                    "a1=-1:1:2",
                    "--y",
                    "v1=-1:1:2",
                    "--attractors",
                    "found.json",
                ]
            }
            _ => {
                let mut file = image.clone();
                mutation::bytes(random, &mut file);
                folder.write("image.png", file);
                let scan = read("docs/cases/scan-step.toml");
                folder.write(
                    "scan.toml",
                    format!("{scan}\nimage = \"image.png\"\nimage_height = \"5 nm\"\n"),
                );
                &["scan", "scan.toml"]
            }
        };
        let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        found.extend(run(&folder, &words, PATIENCE));
    }
    none_wrong(&found);
}

/// A grey image of four pixels: PNG of stored rows (W3C, PNG 2nd edition), checksums included.
fn image() -> Vec<u8> {
    let chunk = |kind: &[u8; 4], data: &[u8]| {
        let mut crc = u32::MAX;
        for byte in kind.iter().chain(data) {
            crc ^= u32::from(*byte);
            for _ in 0..8 {
                crc = (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg());
            }
        }
        let length = (data.len() as u32).to_be_bytes();
        [&length[..], kind, data, &(!crc).to_be_bytes()].concat()
    };
    let header = [0, 0, 0, 2, 0, 0, 0, 2, 8, 0, 0, 0, 0];
    let rows = miniz_oxide::deflate::compress_to_vec_zlib(&[0, 10, 200, 0, 30, 40], 6);
    let parts = [
        b"\x89PNG\r\n\x1a\n".to_vec(),
        chunk(b"IHDR", &header),
        chunk(b"IDAT", &rows),
        chunk(b"IEND", &[]),
    ];
    parts.concat()
}

/// Files of instruments, damaged and hostile.
#[test]
fn recordings() {
    let mut found = Vec::new();
    let folder = Folder::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let case = std::fs::read_to_string(root.join("docs/cases/stiff-lever.toml")).unwrap();
    folder.write("case.toml", case);
    let fit = |name: &str| -> Vec<String> {
        ["fit", name, "case.toml", "--free", "sample.modulus"]
            .map(str::to_owned)
            .to_vec()
    };
    let files = [
        ("a.ibw", samples::igor_curve()),
        ("a.jpk-force", samples::zip(&samples::jpk_force())),
        ("a.nid", samples::nanosurf()),
        ("a.spm", samples::bruker_curve()),
        ("a.csv", samples::workshop(1)),
    ];
    for seed in seeds(RECORDINGS) {
        let random = &mut Random::new(seed);
        let (name, whole) = &files[random.below(files.len())];
        let mut file = whole.clone();
        mutation::bytes(random, &mut file);
        folder.write(name, file);
        found.extend(run(&folder, &fit(name), PATIENCE));
    }
    none_wrong(&found);
}

/// Datasets with damaged documents, markers and chunks.
#[test]
fn datasets() {
    let mut found = Vec::new();
    let folder = Folder::with_paper_case();
    let sweep = [
        "sweep",
        "case.toml",
        "--set",
        "modes=1",
        "--over",
        "omega=18:20:2",
        "--out",
        "a.zarr",
    ];
    assert_eq!(folder.run(&sweep).code, 0);
    let mut files = Vec::new();
    collect(&folder.path().join("a.zarr"), &mut files);
    files.sort();
    let whole: Vec<Vec<u8>> = files
        .iter()
        .map(|path| std::fs::read(path).unwrap())
        .collect();
    let merge = ["merge", "a.zarr", "--out", "b.zarr"].map(str::to_owned);
    for seed in seeds(DATASETS) {
        let random = &mut Random::new(seed);
        let at = random.below(files.len());
        let metadata = files.iter().position(|path| path.ends_with(".zmetadata"));
        let at = if random.rarely(2) {
            metadata.unwrap()
        } else {
            at
        };
        let mut file = whole[at].clone();
        match serde_json::from_slice::<serde_json::Value>(&file) {
            Ok(mut document) if !random.rarely(4) => {
                mutation::json(random, &mut document);
                file = document.to_string().into_bytes();
            }
            _ => mutation::bytes(random, &mut file),
        }
        std::fs::write(&files[at], file).unwrap();
        found.extend(run(&folder, &merge, PATIENCE));
        std::fs::write(&files[at], &whole[at]).unwrap();
        let _ = std::fs::remove_dir_all(folder.path().join("b.zarr"));
    }
    none_wrong(&found);
}

/// All files in a folder.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, files);
        } else {
            files.push(path);
        }
    }
}
