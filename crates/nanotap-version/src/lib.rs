//! The version of a program with the commit that it was built from.
//!
//! A macro and not a build script: a build script's result belongs to a whole package, which would be
//! compiled again after every commit. The macro costs only the crate that uses it, and is expanded
//! again whenever one of its dependencies was changed.

#![expect(
    clippy::disallowed_methods,
    reason = "it reads files of the package that is compiled"
)]

use std::path::Path;
use std::process::Command;

use proc_macro::TokenStream;

/// The commit of a source archive that `git archive` wrote.
const ARCHIVE: &str = include_str!("../COMMIT");

/// The version of the package that is compiled, as a string, with commit and date if they are known:
/// `0.2.0 (1e575bcf, 2026-11-28)`.
///
/// The commit is that of the checkout, marked `-modified` if tracked sources differ from it, or else
/// the one that is recorded in the source archive.
#[proc_macro]
pub fn version(_: TokenStream) -> TokenStream {
    let variable = |name| std::env::var(name).unwrap_or_default();
    let folder = variable("CARGO_MANIFEST_DIR");
    let folder = Path::new(&folder);
    let commit = of_checkout(folder)
        .or_else(|| of_archive(ARCHIVE))
        .or_else(|| {
            of_package(&std::fs::read_to_string(folder.join(".cargo_vcs_info.json")).ok()?)
        });
    let version = variable("CARGO_PKG_VERSION");
    let text = match commit {
        Some(commit) => format!("{version} ({commit})"),
        None => version,
    };
    // Git appends to this file at every change of commit, and the compiler notes that it was read.
    let log = git(folder, &["rev-parse", "--git-path", "logs/HEAD"])
        .map(|path| folder.join(path))
        .filter(|path| path.exists());
    let log = log.as_deref().and_then(Path::to_str);
    let log = log.map(|path| format!("const _: &[u8] = include_bytes!({path:?});"));
    format!("{{ {} {text:?} }}", log.unwrap_or_default())
        .parse()
        .unwrap_or_default()
}

/// The commit of the checkout in which the package at `folder` is tracked.
fn of_checkout(folder: &Path) -> Option<String> {
    // A package may be unpacked inside an unrelated checkout.
    git(folder, &["ls-files", "--error-unmatch", "Cargo.toml"])?;
    let line = git(folder, &["show", "-s", "--format=%H %cs"])?;
    let (hash, date) = of_log(&line)?;
    let sources = [":/crates", ":/Cargo.toml", ":/Cargo.lock"];
    let unchanged = git(
        folder,
        &[&["diff", "--quiet", "HEAD", "--"][..], &sources].concat(),
    );
    let mark = if unchanged.is_some() { "" } else { "-modified" };
    Some(format!("{hash}{mark}, {date}"))
}

/// The commit in the file that `git archive` fills in; `None` if it did not.
fn of_archive(content: &str) -> Option<String> {
    let (hash, date) = of_log(content)?;
    Some(format!("{hash}, {date}"))
}

/// The commit in the file that `cargo package` adds.
fn of_package(content: &str) -> Option<String> {
    let (_, rest) = content.split_once("\"sha1\":")?;
    let hash = short(rest.split('"').nth(1)?)?;
    let modified = content.contains("\"dirty\": true");
    Some(format!("{hash}{}", if modified { "-modified" } else { "" }))
}

/// The short hash and the date in a line of `git log`.
fn of_log(line: &str) -> Option<(&str, &str)> {
    let (hash, date) = line.trim().split_once(' ')?;
    Some((short(hash)?, date))
}

/// The first 8 digits of a hash: git's own short hashes are longer in a larger copy of the repository.
fn short(hash: &str) -> Option<&str> {
    hash.get(..8)
        .filter(|short| short.bytes().all(|byte| byte.is_ascii_hexdigit()))
}

/// What `git` prints in `folder`; `None` if it fails or is not installed.
fn git(folder: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .arg("-C")
        .arg(folder)
        .args(arguments)
        .output()
        .ok()
        .filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HASH: &str = "1e575bcf0ef99691db1ab9a7f6b2ef0d2c3fb810";

    #[test]
    fn an_archive_has_the_commit_only_if_git_wrote_it() {
        let filled = format!("{HASH} 2026-11-28\n");
        assert_eq!(of_archive(&filled).as_deref(), Some("1e575bcf, 2026-11-28"));
        assert_eq!(of_archive("$Format:%H %cs$\n"), None);
    }

    #[test]
    fn a_package_has_the_commit_without_a_date() {
        let clean = format!(
            "{{\n  \"git\": {{\n    \"sha1\": \"{HASH}\"\n  }},\n  \"path_in_vcs\": \"crates/nanotap-cli\"\n}}"
        );
        assert_eq!(of_package(&clean).as_deref(), Some("1e575bcf"));
        let dirty = clean.replace("\"\n  },", "\",\n    \"dirty\": true\n  },");
        assert_eq!(of_package(&dirty).as_deref(), Some("1e575bcf-modified"));
        assert_eq!(of_package("{\"path_in_vcs\": \"\"}"), None);
    }

    #[test]
    fn a_package_that_is_not_tracked_has_no_commit_of_the_checkout_around_it() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        assert_eq!(of_checkout(&root.join("src")), None);
    }
}
