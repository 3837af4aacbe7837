//! `nanotap case`: output and error messages.

use crate::util::{Folder, PAPER, case};
use proptest::prelude::*;

#[test]
fn json_has_every_field_of_the_contract() {
    let json = case(PAPER, &["--json"]).json();
    assert_eq!(json["kind"], "cantilever");
    assert_eq!(json["modes"], 3);
    let values = [
        "alpha1", "alpha2", "alpha3", "alpha4", "alpha5", "alpha6", "omega",
    ];
    let expected = [0.1, 0.1, 0.1, 20.0, 0.0, 0.2, 2.6];
    for (key, expected) in values.into_iter().zip(expected) {
        assert_eq!(json[key].as_f64(), Some(expected), "{key}");
    }
}

#[test]
fn overrides_and_readable_names_reach_the_result() {
    let json = case(
        PAPER,
        &["--json", "--set", "drive_frequency=20", "--set", "modes=4"],
    )
    .json();
    assert_eq!(
        (json["omega"].as_f64(), json["modes"].as_u64()),
        (Some(20.0), Some(4))
    );
    let json = case(PAPER, &["--json", "--set", "gap=-0.5"]).json();
    assert_eq!(json["alpha5"].as_f64(), Some(-0.5));
}

#[test]
fn no_file_is_needed_if_all_keys_are_set() {
    let folder = Folder::new();
    let set = [
        "alpha1=0",
        "alpha2=0.1",
        "alpha3=0.1",
        "alpha4=20",
        "alpha6=0.2",
        "omega=20",
    ];
    let mut arguments = vec!["case", "--json"];
    arguments.extend(set.iter().flat_map(|word| ["--set", word]));
    let json = folder.run(&arguments).json();
    // The two defaults.
    assert_eq!(
        (json["modes"].as_u64(), json["alpha5"].as_f64()),
        (Some(3), Some(0.0))
    );
    folder
        .run(&arguments[..8])
        .refused(&["it lacks", "alpha4, alpha6, omega", "--set alpha4=20"]);
    folder
        .run(&["case"])
        .refused(&["no case was given", "name a case file"]);
}

#[test]
fn text_names_symbols_meanings_and_values() {
    let outcome = case(PAPER, &[]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (0, ""));
    for words in [
        "case.toml",
        "3 modes",
        "α₄",
        "contact_stiffness",
        "tip mass over beam mass",
    ] {
        assert!(
            outcome.stdout.contains(words),
            "{words}:\n{}",
            outcome.stdout
        );
    }
    // Not a terminal: no colour.
    assert!(!outcome.stdout.contains('\u{1b}'));
    assert!(outcome.stdout.lines().all(|line| line == line.trim_end()));
}

#[test]
fn a_case_written_out_is_the_same_case() {
    let folder = Folder::with_paper_case();
    let written = folder.run(&[
        "case",
        "case.toml",
        "--set",
        "omega=20",
        "--out",
        "other.toml",
    ]);
    assert_eq!(written.code, 0, "{}", written.stderr);
    let again = folder.run(&["case", "other.toml", "--json"]).json();
    assert_eq!(again["omega"].as_f64(), Some(20.0));
    assert_eq!(
        folder.names(),
        ["case.toml", "other.toml"],
        "no temporary file is left"
    );
    folder
        .run(&["case", "case.toml", "--out", "other.xyz"])
        .refused(&["other.xyz", "use .toml"]);
    let nowhere = folder.run(&["case", "case.toml", "--out", "no/such/folder/x.toml"]);
    assert_eq!((nowhere.code, nowhere.stdout.as_str()), (1, ""));
    assert!(
        nowhere
            .stderr
            .contains("cannot write no/such/folder/x.toml"),
        "{}",
        nowhere.stderr
    );
}

#[test]
fn an_error_in_a_case_is_shown_with_its_line() {
    let refused = case(PAPER.replace("omega = 2.6", "omgea = 2.6"), &[]);
    refused.refused(&[
        "case.toml:9:1",
        "omgea = 2.6",
        "^^^^^",
        "did you mean `omega`?",
    ]);
    assert!(
        !refused.stderr.contains("lacks"),
        "printed once: {}",
        refused.stderr
    );
    // Without a line to point at, the nearest key is offered below.
    case(PAPER, &["--set", "omga=3"]).refused(&["--set omga=3", "did you mean `omega`?"]);
    case(PAPER.replace("0.2", "\"0.2\""), &["--json"])
        .refused(&["`alpha6` = \"0.2\" is text", "without quotes: alpha6 = 0.2"]);
    let both = case(
        PAPER
            .replace("modes = 3", "modes = 1000000000")
            .replace("20.0", "nan"),
        &[],
    );
    both.refused(&[
        "`modes` = 1000000000 is outside 1 … 50",
        "`alpha4` = nan: must be a finite",
    ]);
}

#[test]
fn every_invalid_number_is_refused_with_key_and_value() {
    for (word, words) in [
        ("alpha1=-0.1", "`alpha1` = -0.1: must be 0 or more"),
        (
            "tip_mass_ratio=-0.1",
            "`tip_mass_ratio` = -0.1: must be 0 or more",
        ),
        ("alpha4=inf", "`alpha4` = inf: must be a finite number"),
        ("alpha4=1e300", "`alpha4` = 1e300: must be at most"),
        ("omega=nan", "`omega` = nan: must be a finite number"),
        ("omega=-1", "`omega` = -1: must be more than 0"),
        ("omega=0", "`omega` = 0: must be more than 0"),
        ("omega=65700", ""),
        ("omega=1e7", "is it in hertz?"),
        ("modes=0", "`modes` = 0 is outside 1 … 50"),
        ("modes=51", "`modes` = 51 is outside 1 … 50"),
        ("modes=1000000000", "is outside 1 … 50"),
        ("modes=2.5", "`modes` = 2.5 is not a whole number"),
        ("modes=three", "`modes` = three is text"),
        ("omega", "no `=` in it"),
        ("=2", "no key before the `=`"),
        (
            "cosine_term=wrong",
            "is not one of \"corrected\", \"printed\"",
        ),
    ] {
        let outcome = case(PAPER, &["--set", word]);
        if words.is_empty() {
            assert_eq!(outcome.code, 0, "{word}: {}", outcome.stderr);
        } else {
            outcome.refused(&[&format!("--set {word}"), words]);
        }
    }
    case(PAPER, &["--set", "omega="]).refused(&["the case lacks omega"]);
}

#[test]
fn files_other_than_case_files_are_refused() {
    let folder = Folder::with_paper_case();
    folder.write("empty.toml", "");
    folder.write("binary.toml", [0x7f, b'E', b'L', b'F', 0xff, 0xfe, 0, 1]);
    folder.write("zeros.toml", [0; 64]);
    folder.write("long.toml", vec![b'#'; (1 << 20) + 1]);
    folder.write("prose.toml", "It was a dark and stormy night.\n");
    folder
        .run(&["case", "none.toml"])
        .refused(&["none.toml: no such file"]);
    folder.run(&["case", "."]).refused(&[".: is a folder"]);
    folder
        .run(&["case", "empty.toml"])
        .refused(&["empty.toml", "lacks alpha1, alpha2", "omega"]);
    folder
        .run(&["case", "binary.toml"])
        .refused(&["binary.toml: not text: byte 4"]);
    folder
        .run(&["case", "zeros.toml"])
        .refused(&["zeros.toml", "not TOML"]);
    folder
        .run(&["case", "long.toml"])
        .refused(&["long.toml: longer than 1 MiB"]);
    folder
        .run(&["case", "prose.toml"])
        .refused(&["prose.toml:1:", "not TOML", "[model]"]);
    folder
        .run(&["case", "case.toml", "extra.toml"])
        .refused(&["extra.toml"]);
}

#[test]
fn a_key_that_is_stated_twice_is_refused() {
    case(format!("{PAPER}omega = 2\n"), &[]).refused(&["case.toml:10:1", "duplicate key"]);
    case(format!("{PAPER}drive_frequency = 2\n"), &[])
        .refused(&["`omega` and `drive_frequency` are the same key", "keep one"]);
}

#[test]
fn dimensionless_and_physical_do_not_mix() {
    let mixed = format!("[sample]\nstiffness = \"20 N/m\"\n{PAPER}");
    case(mixed, &[]).refused(&[
        "`alpha1` and 6 more keys are dimensionless",
        "[sample] makes this a physical case",
    ]);
    case(PAPER, &["--set", "sample.stiffness=20 N/m"]).refused(&["[sample] makes this a physical"]);
}

#[test]
fn oscillators_are_shown() {
    let text = "[model]\nkind = \"impact\"\nstiffness = 1\ndamping = 0\nforcing = 1\n\
                omega = 2.5\ngap = 0\nrestitution = 0.8\n";
    let json = case(text, &["--json"]).json();
    assert_eq!(json["kind"], "impact");
    assert_eq!(
        (json["mass"].as_f64(), json["restitution"].as_f64()),
        (Some(1.0), Some(0.8))
    );
    assert!(case(text, &[]).stdout.contains("rigid stop"));
    case(text, &["--set", "mass=-1"]).refused(&["`mass` = -1: a positive"]);
}

#[test]
fn control_characters_of_a_file_do_not_reach_the_terminal() {
    let outcome = case("[model]\n\"\\u001b[2J\" = 1\n", &[]);
    outcome.refused(&["is not a key of [model]"]);
    assert!(!outcome.stderr.contains('\u{1b}'), "{:?}", outcome.stderr);
    let outcome = case(PAPER, &["--set", "\u{1b}[2J=1"]);
    outcome.refused(&["is not a key of [model]"]);
    assert!(!outcome.stderr.contains('\u{1b}'), "{:?}", outcome.stderr);
}

/// A key of 100,000 letters is quoted by its beginning and end.
#[test]
fn long_words_are_shortened_in_messages() {
    let outcome = case(PAPER, &["--set", &format!("{}=1", "x".repeat(100_000))]);
    outcome.refused(&["xxx … xxx", "is not a key of [model]"]);
    assert!(outcome.stderr.len() < 3000, "{}", outcome.stderr.len());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn random_bytes_never_cause_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        case(bytes, &[]).refused(&["error"]);
    }

    #[test]
    fn random_changes_never_cause_a_panic(
        at in 0..PAPER.len(),
        bytes in prop::collection::vec(any::<u8>(), 1..6),
    ) {
        let mut text = PAPER.as_bytes().to_vec();
        text.splice(at..(at + bytes.len()).min(text.len()), bytes);
        let outcome = case(text, &[]);
        // A comment or another number may still be a valid case.
        prop_assert!(outcome.code == 0 || outcome.code == 2, "{}", outcome.stderr);
        prop_assert!(!outcome.stderr.contains("panicked"), "{}", outcome.stderr);
    }
}
