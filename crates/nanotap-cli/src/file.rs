//! The files that a command writes: checked before anything is computed, whole or not at all.
//!
//! A file that another program or a person wrote is not replaced without `--force`. A file of
//! nanotap's is recognised by its contents: a picture by the program that it names, a case file by
//! the checksum in its first line (a file that was edited since belongs to a person), a table by
//! its first columns.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use nanotap::dataset::files;
use nanotap::input;
use nanotap_figures::{Figure, MADE_BY};

use crate::failure::Failure;

/// True if `--force` was given: existing files of any origin are replaced.
static FORCE: AtomicBool = AtomicBool::new(false);
/// Paths that this command will write; each may be claimed once.
static CLAIMED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Beginnings of the tables that commands write, and columns of those of datasets.
const TABLES: [&str; 13] = [
    "line,direction,",
    "tau,tip,tip_rate",
    "order,tip,tip_lag_degrees",
    "attractor,classification,",
    "way,",
    "branch,kind,",
    "modes,difference,",
    "contact,indentation,",
    "phase_degrees,tip,",
    "xi,phi1",
    "curve,line,",
    "law,",
    "index,",
];
const DATASETS: [&str; 3] = [",classification,", ",attractor", ",start,"];

/// Bytes from which a file of nanotap's is recognised: a picture names its program within them, and a
/// case file is shorter.
const RECOGNISED_BYTES: u64 = 256 << 20;

/// Allows all existing files to be replaced from now on.
pub(crate) fn force() {
    FORCE.store(true, Ordering::Relaxed);
}

/// The ending of `path`, in lower case, among those that can be written there, if the file may
/// be written: a file of nanotap or none, and requested once.
pub(crate) fn claim<'a>(path: &Path, endings: &[&'a str]) -> Result<&'a str, Failure> {
    let ending = ending(path, endings)?;
    let place = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let mut claimed = CLAIMED.lock().unwrap_or_else(PoisonError::into_inner);
    if !claimed.insert(place) {
        return Err(Failure::input(
            format!("{}: two outputs cannot go to one file", path.display()),
            "give each output a different name",
        ));
    }
    if path.is_dir() {
        return Err(refused(path, "it is a folder"));
    }
    if path.exists() && !path.is_file() {
        return Err(refused(path, "it is not a regular file"));
    }
    if !FORCE.load(Ordering::Relaxed) && path.is_file() {
        let there =
            input::start(path, RECOGNISED_BYTES).map_err(|error| refused(path, error.fault))?;
        if !is_ours(ending, &there) {
            return Err(Failure::input(
                format!("{} was not written by nanotap", path.display()),
                "name another file, or add --force to replace it",
            ));
        }
    }
    Ok(ending)
}

/// The same for every file in `folder` with one of the `endings` whose name before it is one that
/// a command `writes`, where that is known only afterwards.
pub(crate) fn claim_in(
    folder: &Path,
    endings: &[&str],
    writes: impl Fn(&str) -> bool,
) -> Result<(), Failure> {
    let entries = fs::read_dir(folder).map_err(|error| refused(folder, error))?;
    for entry in entries.flatten() {
        let path = entry.path();
        let stem = path.file_stem().map(|stem| stem.to_string_lossy());
        if stem.is_some_and(|stem| writes(&stem)) && ending(&path, endings).is_ok() {
            claim(&path, endings)?;
        }
    }
    Ok(())
}

/// Whether nanotap wrote a file of that ending which holds these bytes.
fn is_ours(ending: &str, bytes: &[u8]) -> bool {
    let first = bytes
        .split(|byte| *byte == b'\n')
        .next()
        .unwrap_or_default();
    let first = String::from_utf8_lossy(first);
    match ending {
        _ if bytes.is_empty() => true,
        "csv" => {
            TABLES.iter().any(|table| first.starts_with(table))
                || DATASETS.iter().any(|column| first.contains(column))
        }
        "toml" => {
            let rest = bytes.get(first.len() + 1..).unwrap_or_default();
            first == signature(rest)
        }
        _ => bytes
            .windows(MADE_BY.len())
            .any(|window| window == MADE_BY.as_bytes()),
    }
}

/// The first line of a case file that holds `rest`.
fn signature(rest: &[u8]) -> String {
    format!(
        "# Written by nanotap, {:08x}: as long as it is not edited, nanotap may replace it",
        files::checksum(rest)
    )
}

/// Writes `bytes` to `path`, whole or not at all.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    files::write(path, bytes).map_err(|error| refused(path, error))
}

/// Writes a case file, signed.
pub(crate) fn write_case(path: &Path, toml: &str) -> Result<(), Failure> {
    let text = format!("{}\n{toml}", signature(toml.as_bytes()));
    write(path, text.as_bytes())
}

/// Writes a picture in the format of the path's ending.
pub(crate) fn draw(path: &Path, figure: &Figure) -> Result<(), Failure> {
    write(path, &figure.file(path)?)
}

/// A long table that is written piece by piece.
pub(crate) struct Rows<'a> {
    path: &'a Path,
    file: &'a mut BufWriter<File>,
}

impl Rows<'_> {
    /// Appends one piece of text to the file.
    pub(crate) fn push(&mut self, text: &str) -> Result<(), Failure> {
        let written = self.file.write_all(text.as_bytes());
        written.map_err(|error| refused(self.path, error))
    }
}

/// Writes the table that `fill` produces piece by piece.
pub(crate) fn write_rows(
    path: &Path,
    fill: impl FnOnce(&mut Rows<'_>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    /// An error of either kind.
    enum Stopped {
        System(std::io::Error),
        Said(Failure),
    }
    impl From<std::io::Error> for Stopped {
        fn from(error: std::io::Error) -> Self {
            Self::System(error)
        }
    }
    files::write_with(path, |file| {
        fill(&mut Rows { path, file }).map_err(Stopped::Said)
    })
    .map_err(|stopped| match stopped {
        Stopped::System(error) => refused(path, error),
        Stopped::Said(failure) => failure,
    })
}

fn refused(path: &Path, why: impl std::fmt::Display) -> Failure {
    Failure::files(format!("cannot write {}: {why}", path.display()))
}

/// Joins the items as alternatives: "a, b or c".
fn alternatives(list: &[String]) -> String {
    match list {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}

/// The ending of `path`, in lower case, among those that can be written.
pub(crate) fn ending<'a>(path: &Path, endings: &[&'a str]) -> Result<&'a str, Failure> {
    let given = path
        .extension()
        .map(|ending| ending.to_string_lossy().to_lowercase());
    endings
        .iter()
        .copied()
        .find(|ending| Some(*ending) == given.as_deref())
        .ok_or_else(|| {
            let list: Vec<String> = endings.iter().map(|ending| format!(".{ending}")).collect();
            Failure::input(
                format!("{}: unsupported file extension", path.display()),
                format!("use {}", alternatives(&list)),
            )
        })
}
