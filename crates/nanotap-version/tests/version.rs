//! The macro in this checkout.

use std::process::Command;

#[test]
fn the_version_states_the_commit_of_the_checkout() {
    let version = nanotap_version::version!();
    let (number, commit) = version.split_once(' ').unwrap_or((version, ""));
    assert_eq!(number, env!("CARGO_PKG_VERSION"));
    let git = Command::new("git")
        .args(["show", "-s", "--format=%H %cs"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output();
    let Some(line) = git.ok().filter(|output| output.status.success()) else {
        eprintln!("skipped: no checkout");
        return;
    };
    let line = String::from_utf8(line.stdout).unwrap();
    let (hash, date) = line.trim().split_once(' ').unwrap();
    let expected = format!("({}, {date})", &hash[..8]);
    assert_eq!(commit.replace("-modified", ""), expected);
}
