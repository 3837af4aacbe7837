//! Files that appear whole or not at all.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::failure::Failure;

/// Writes `bytes` to `path` under a temporary name beside it, then renames: a reader
/// never meets half a file, and a failure leaves what was there before.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let refuse = |why: String| Failure::files(format!("cannot write {}: {why}", path.display()));
    let Some(name) = path.file_name() else {
        return Err(refuse("it has no file name".into()));
    };
    if path.is_dir() {
        return Err(refuse("it is a folder".into()));
    }
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}.tmp", std::process::id()));
    let temporary: PathBuf = path.with_file_name(hidden);
    let written = fs::File::create(&temporary)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| fs::rename(&temporary, path));
    written.map_err(|error| {
        let _ = fs::remove_file(&temporary);
        refuse(error.to_string())
    })
}

/// "a, b or c".
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
                format!(
                    "{}: the ending says no format that is written here",
                    path.display()
                ),
                format!("end the name in {}", alternatives(&list)),
            )
        })
}
