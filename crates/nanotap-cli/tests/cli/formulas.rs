//! Laws that a case writes as formulas.

use crate::util::Folder;

/// A case whose law is a formula with these lines of `[sample]` and `[sample.parameters]`.
fn case(force: &str, parameters: &str) -> String {
    format!(
        "[model]\nmodes = 1\n[cantilever]\nk = \"2.8 N/m\"\nf0 = \"75 kHz\"\nQ = 200\n[tip]\nradius = \"8 nm\"\n\
         [sample]\nlaw = \"formula\"\nforce = '{force}'\n[sample.parameters]\n{parameters}\n\
         [drive]\nfrequency = \"75 kHz\"\nfree_amplitude = \"20 nm\"\n[gap]\ntip = \"16 nm\"\n"
    )
}

const SPRING: &str = "k*max(-d, 0)";

/// Each mistake is one sentence with its place, from a file and from `--set`.
#[test]
fn mistakes_are_refused_with_their_place() {
    let folder = Folder::new();
    for (force, parameters, words) in [
        (
            "k*max(-d, 0",
            "k = \"5 N/m\"",
            "at character 12: a parenthesis is open",
        ),
        (
            "k*max(-d, 0)",
            "",
            "at character 1 (\"k\"): it has no value: state it under [sample.parameters], as in k = \"2.8 N/m\"",
        ),
        (
            "k*max(-d, 0) - c*v",
            "",
            "state it under [sample.parameters] with its unit",
        ),
        ("k*d^2", "k = \"5 N/m\"", "where a force is needed"),
        (
            "k*d + c*v",
            "k = \"5 N/m\"\nc = \"2 N\"",
            "they cannot be added",
        ),
        ("-k*R/d", "k = \"5 N\"", "attracts there without limit"),
        ("x = x*k; x", "k = 2", "defined once, before it is used"),
        ("k*(d", "k = \"5 N/q\"", "unknown unit"),
        (
            "k*foo(d)",
            "k = \"5 N/m\"",
            "there is no function of this name",
        ),
    ] {
        folder.write("bad.toml", case(force, parameters));
        let refused = folder.run(&["orbit", "bad.toml"]);
        refused.refused(&[words]);
        assert!(refused.stderr.contains("bad.toml"), "{}", refused.stderr);
    }
    folder.write("infinite.toml", case("k*d/0", "k = \"5 N/m\""));
    for command in ["case", "orbit"] {
        let refused = folder.run(&[command, "infinite.toml"]);
        refused.refused(&["the force on the tip farthest from the sample must be finite"]);
    }
    let misplaced = case(SPRING, "").replace("[sample.parameters]", "k = \"5 N/m\"");
    folder.write("misplaced.toml", misplaced);
    folder
        .run(&["case", "misplaced.toml"])
        .refused(&["`k` (= \"5 N/m\")", "write it below [sample.parameters]"]);
    folder.write("good.toml", case(SPRING, "k = \"5 N/m\""));
    folder
        .run(&["case", "good.toml", "--set", "sample.law="])
        .refused(&["it belongs to sample.law = \"formula\""]);
    folder
        .run(&["orbit", "good.toml", "--set", "sample.force="])
        .refused(&["sample.force is missing", "needs its formula"]);
    folder
        .run(&[
            "orbit",
            "good.toml",
            "--set",
            "sample.law=formula + formula",
        ])
        .refused(&["write the sum of two formulas as one"]);
    folder
        .run(&["orbit", "good.toml", "--set", "sample.law=hertz"])
        .refused(&["it is not a parameter of sample.law = \"hertz\""]);
    folder
        .run(&["sweep", "good.toml", "--over", "sample.parameters.q=1:2:3"])
        .refused(&["sample.parameters.q"]);
}

/// A repulsion without limit has a pole at which its sign changes; no lever rests there.
#[test]
fn no_lever_rests_at_a_pole() {
    let folder = Folder::new();
    folder.write("pole.toml", case("F0*a/d", "F0 = \"1 nN\"\na = \"1 nm\""));
    let rests = folder.run(&["case", "pole.toml", "--json"]).json()["equilibria"].clone();
    let rests = rests.as_array().unwrap();
    assert_eq!(rests.len(), 1, "{rests:?}");
    // k (d − 16 nm) = F0 a/d, of the modal static stiffness; in front of the sample.
    assert_eq!(rests[0]["contact"], false);
    assert_eq!(rests[0]["stable"], true);
}

/// What was written is read back as the same case, and parameters vary like any quantity.
#[test]
fn a_formula_is_a_case_like_any_other() {
    let folder = Folder::new();
    let text = "x = max(-d, 0);\nif turned then k*x - F0 else k*x";
    let text = case(text, "k = \"20 N/m\"\nF0 = \"0.2 nN\"").replace('\'', "\"\"\"");
    folder.write("case.toml", text);
    let saved = folder.run(&["case", "case.toml", "--out", "again.toml"]);
    assert_eq!(saved.code, 0, "{}", saved.stderr);
    let orbit = |name: &str, more: &[&str]| {
        let words = [&["orbit", name, "--json"], more].concat();
        folder.run(&words).json()["physical"]["A"].as_f64().unwrap()
    };
    assert_eq!(orbit("case.toml", &[]), orbit("again.toml", &[]));
    // A number without a unit is in SI; another unit of the same kind is the same value.
    let stiffer = orbit("case.toml", &["--set", "sample.parameters.k=30"]);
    let same = orbit("case.toml", &["--set", "sample.parameters.k=30 nN/nm"]);
    assert_eq!(stiffer, same);
    assert!(stiffer < orbit("case.toml", &[]));
    // The slope along a branch is that of two motions.
    let branch = [
        "branch",
        "case.toml",
        "--parameter",
        "sample.parameters.k",
        "--from",
        "20 N/m",
        "--to",
        "20.01 N/m",
        "--json",
    ];
    let branch = folder.run(&branch).json();
    assert_eq!(branch["parameter"], "sample.parameters.k");
    // Left-over parameters are said, not refused.
    let other = folder.run(&["case", "case.toml", "--set", "sample.force=k*max(-d, 0)"]);
    assert_eq!(other.code, 0, "{}", other.stderr);
    let note = "sample.parameters.F0 is stated, and the formula does not use it";
    assert!(other.stderr.contains(note), "{}", other.stderr);
}
