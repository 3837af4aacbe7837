//! Snapshot files: reading, comparison with the present results, renewal.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::agree;
use crate::facts::{self, Fact};

/// A command with its pinned facts.
struct Pinned {
    line: String,
    facts: Vec<Fact>,
}

/// Runs every command of the snapshot called `name` and compares, or renews it.
pub(crate) fn check(name: &str) {
    let path = folder("snapshots").join(format!("{name}.txt"));
    let text = std::fs::read_to_string(&path).unwrap();
    let (preface, pinned) = read(&text);
    let work = Work::new(name);
    let renewing = std::env::var_os("NANOTAP_RENEW").is_some();
    let mut renewed = preface;
    let mut lost = String::new();
    for Pinned { line, facts } in pinned {
        let actual = work.run(&line);
        if renewing {
            let _ = write!(renewed, "\n$ {line}\n");
            for fact in actual {
                let _ = writeln!(renewed, "{fact}");
            }
            continue;
        }
        let differences = agree::differences(&line, &facts, &actual);
        if !differences.is_empty() {
            let _ = write!(lost, "\n$ nanotap {line}\n{differences}");
        }
    }
    if renewing {
        std::fs::write(&path, renewed).unwrap();
    }
    assert!(
        lost.is_empty(),
        "what scripts rely on has changed:\n{lost}\nIf that is meant: tests/contract/main.rs says how to renew {name}.txt"
    );
}

/// The names of the snapshots, sorted.
pub(crate) fn names() -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder("snapshots"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/contract")
        .join(name)
}

/// The text before the first command, and the commands.
fn read(text: &str) -> (String, Vec<Pinned>) {
    let mut preface = String::new();
    let mut pinned: Vec<Pinned> = Vec::new();
    for line in text.lines() {
        if let Some(line) = line.strip_prefix("$ ") {
            let line = line.to_owned();
            pinned.push(Pinned {
                line,
                facts: Vec::new(),
            });
        } else if let Some(last) = pinned.last_mut() {
            last.facts
                .extend((!line.is_empty()).then(|| Fact::read(line)));
        } else if !line.is_empty() {
            let _ = writeln!(preface, "{line}");
        }
    }
    (preface, pinned)
}

/// The folder in which the commands of one snapshot run; removed at the end.
struct Work(PathBuf);

impl Work {
    fn new(name: &str) -> Self {
        let folder_name = format!("nanotap-contract-{}-{name}", std::process::id());
        let work = Self(std::env::temp_dir().join(folder_name));
        std::fs::create_dir_all(&work.0).unwrap();
        for entry in std::fs::read_dir(folder("cases")).unwrap() {
            let from = entry.unwrap().path();
            std::fs::copy(&from, work.0.join(from.file_name().unwrap())).unwrap();
        }
        work
    }

    /// Runs a command line in the folder; returns the facts about its results.
    fn run(&self, line: &str) -> Vec<Fact> {
        let before = facts::files(&self.0);
        // Another program with the same contract can be tested.
        let program = std::env::var_os("NANOTAP_PROGRAM")
            .unwrap_or_else(|| env!("CARGO_BIN_EXE_nanotap").into());
        let output = Command::new(program)
            .args(words(line))
            .current_dir(&self.0)
            .env_remove("CLICOLOR_FORCE")
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let code = output.status.code().expect("ended by itself");
        let stdout = String::from_utf8(output.stdout).unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        let mut facts = facts::printed(line, code, &stdout, &stderr);
        for path in facts::files(&self.0) {
            if !before.contains(&path) {
                facts.extend(facts::file(&self.0, &path));
            }
        }
        facts
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Splits a command line into words; double quotes group words.
fn words(line: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    for (index, piece) in line.split('"').enumerate() {
        if index % 2 == 1 {
            // Directly after `--set key=`, or a separate word.
            match words.last_mut() {
                Some(last) if str::ends_with(last, '=') => last.push_str(piece),
                _ => words.push(piece.to_owned()),
            }
        } else {
            words.extend(piece.split_whitespace().map(str::to_owned));
        }
    }
    words
}
