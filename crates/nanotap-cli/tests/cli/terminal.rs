//! The program as a citizen of the terminal.

use std::process::Stdio;

use crate::util::Folder;

#[test]
fn help_and_version_go_to_standard_output() {
    let folder = Folder::new();
    for arguments in [
        &["--help"][..],
        &["--version"],
        &["case", "--help"],
        &["help", "case"],
    ] {
        let outcome = folder.run(arguments);
        assert_eq!(
            (outcome.code, outcome.stderr.as_str()),
            (0, ""),
            "{arguments:?}"
        );
        assert!(outcome.stdout.contains("nanotap"), "{arguments:?}");
    }
}

#[test]
fn what_is_not_there_is_refused_with_the_nearest() {
    let folder = Folder::with_paper_case();
    folder.run(&["caes"]).refused(&["'caes'", "'case'"]);
    folder
        .run(&["case", "case.toml", "--jsn"])
        .refused(&["--jsn", "--json"]);
    folder.run(&[]).refused(&["Usage: nanotap"]);
}

#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let folder = Folder::with_paper_case();
    let mut child = folder
        .command(&["case", "case.toml"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Nobody will read.
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

#[test]
fn colour_is_there_when_forced_and_never_with_no_color() {
    let folder = Folder::with_paper_case();
    let coloured = folder
        .command(&["case", "case.toml"])
        .env("CLICOLOR_FORCE", "1")
        .output()
        .unwrap();
    assert!(coloured.stdout.contains(&0x1b));
    let plain = folder
        .command(&["case", "none.toml"])
        .env("NO_COLOR", "1")
        .output()
        .unwrap();
    assert!(!plain.stderr.contains(&0x1b));
}

#[test]
fn json_is_alone_on_standard_output_and_remarks_can_be_silenced() {
    let folder = Folder::with_paper_case();
    let arguments = [
        "case",
        "case.toml",
        "--json",
        "--set",
        "cosine_term=printed",
    ];
    let outcome = folder.run(&arguments);
    assert_eq!(outcome.json()["cosine_term"], "printed");
    assert!(outcome.stderr.starts_with("note:"), "{}", outcome.stderr);
    let quiet = folder.run(&[&arguments[..], &["--quiet"]].concat());
    assert_eq!(quiet.stderr, "");
    assert_eq!(quiet.stdout, outcome.stdout);
}
