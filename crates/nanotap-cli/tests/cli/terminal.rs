//! Behaviour on a terminal.

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
fn unknown_commands_are_refused_with_the_nearest() {
    let folder = Folder::with_paper_case();
    folder.run(&["caes"]).refused(&["'caes'", "'case'"]);
    folder
        .run(&["case", "case.toml", "--jsn"])
        .refused(&["--jsn", "--json"]);
    folder.run(&[]).refused(&["Usage: nanotap"]);
}

#[test]
fn a_closed_pipe_is_not_an_error() {
    let folder = Folder::with_paper_case();
    let mut child = folder
        .command(&["case", "case.toml"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Without a reader.
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

#[test]
fn colour_follows_the_environment() {
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
fn standard_output_contains_json_only_and_notes_can_be_silenced() {
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

/// A motion in which the beam would pass through the sample is not valid in the model.
#[test]
fn warnings_about_the_result_are_printed_even_when_quiet() {
    let folder = Folder::with_paper_case();
    let outcome = folder.run(&["orbit", "case.toml", "--set", "omega=20", "--quiet"]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    assert!(outcome.stderr.starts_with("warning:"), "{}", outcome.stderr);
    assert!(
        outcome.stderr.contains("pass through the sample"),
        "{}",
        outcome.stderr
    );
}

#[test]
fn tables_fit_the_terminal() {
    let folder = Folder::with_paper_case();
    for columns in [60, 80, 100] {
        for arguments in [
            &["case", "case.toml"][..],
            &["modes", "case.toml"],
            &["catalogue"],
        ] {
            let output = folder
                .command(arguments)
                .env("COLUMNS", columns.to_string())
                .output()
                .unwrap();
            let text = String::from_utf8(output.stdout).unwrap();
            assert!(!text.is_empty());
            let long: Vec<&str> = text
                .lines()
                .filter(|line| line.chars().count() > columns)
                .collect();
            assert!(
                long.is_empty(),
                "{arguments:?} in {columns} columns: {long:#?}"
            );
        }
    }
}

#[test]
fn the_catalogue_lists_what_a_case_can_name() {
    let folder = Folder::with_paper_case();
    let listed = folder.run(&["catalogue", "--json"]).json();
    let lever = |listed: &serde_json::Value, name: &str| {
        let levers = listed["levers"].as_array().unwrap().clone();
        levers.into_iter().find(|lever| lever["name"] == name)
    };
    let fm = lever(&listed, "PPP-FM").unwrap();
    // The maker's nominal values, in SI.
    assert_eq!(fm["k"], 2.8);
    assert_eq!(fm["f0"], 75e3);
    assert_eq!(fm["length"], 225e-6);
    assert!(fm["source"].as_str().unwrap().contains("Nanosensors"));
    let materials = listed["materials"].as_array().unwrap();
    assert!(
        materials
            .iter()
            .any(|m| m["name"] == "polystyrene" && m["modulus"] == 4e9)
    );

    let named = folder.run(&["catalogue", "nchr", "PS"]);
    for words in ["PPP-NCHR", "42 N/m", "polystyrene", "4 GPa", "Dokukin"] {
        assert!(named.stdout.contains(words), "{words}:\n{}", named.stdout);
    }
    assert!(!named.stdout.contains("75 kHz"), "{}", named.stdout);
    folder
        .run(&["catalogue", "PPP-NCHX"])
        .refused(&["PPP-NCHX", "PPP-NCHR", "nanotap catalogue"]);

    folder.write(
        "own.toml",
        "[lever.\"mine\"]\nk = \"2.4 N/m\"\nf0 = \"71 kHz\"\nsource = \"thermal noise\"\n",
    );
    let own = folder
        .run(&["catalogue", "--catalogue", "own.toml", "--json"])
        .json();
    assert_eq!(lever(&own, "mine").unwrap()["k"], 2.4);
}

#[test]
fn completions_and_manual_pages_contain_every_command() {
    let folder = Folder::with_paper_case();
    let help = folder.run(&["--help"]).stdout;
    let commands: Vec<&str> = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        // A long description goes on in a line that is indented further.
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|command| *command != "help")
        .collect();
    assert!(
        commands.len() > 15 && commands.contains(&"orbit"),
        "{commands:?}"
    );
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let completions = folder.run(&["generate", shell]);
        assert_eq!((completions.code, completions.stderr.as_str()), (0, ""));
        for command in &commands {
            assert!(completions.stdout.contains(command), "{shell}: {command}");
        }
    }
    let page = folder.run(&["generate", "man"]).stdout;
    assert!(page.contains(".TH nanotap 1"), "{page}");
    let written = folder
        .run(&["generate", "man", "--out", "man/man1", "--json"])
        .json();
    assert_eq!(
        written["files"].as_array().unwrap().len(),
        commands.len() + 1
    );
    for command in commands {
        let page = folder.read(&format!("man/man1/nanotap-{command}.1"));
        assert!(page.contains(".SH OPTIONS"), "{command}");
    }
    folder
        .run(&["generate", "fish", "--out", "there"])
        .refused(&["--out there", "standard output"]);
}

#[test]
fn errors_quote_the_input() {
    let folder = Folder::with_paper_case();
    folder
        .run(&["attractors", "case.toml", "--box", "v2=2:1"])
        .refused(&["v2", "from 2 to 1", "upwards"]);
    folder
        .run(&["basin", "case.toml", "--x", "a1=-1:1:2", "--y", "a1=0:1:2"])
        .refused(&["both axes", "`a1`"]);
    folder
        .run(&["merge", "case.toml", "--out", "whole.zarr"])
        .refused(&["case.toml", "not a folder", "nanotap sweep"]);
}

#[test]
fn singular_and_plural_agree() {
    let folder = Folder::with_paper_case();
    // Values change by less than a factor of a hundred: one mode is enough.
    let convergence = folder.run(&[
        "convergence",
        "case.toml",
        "--set",
        "omega=20",
        "--largest",
        "2",
        "--tolerance",
        "100",
    ]);
    assert!(
        convergence.stdout.contains("1 mode is enough"),
        "{}",
        convergence.stdout
    );
}
