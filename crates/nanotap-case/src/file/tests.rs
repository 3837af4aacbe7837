use proptest::prelude::*;

use super::*;
use crate::Case;
use nanotap_model::cantilever::{Cantilever, CosineTerm};
use nanotap_model::contact::ContactLaw;
use nanotap_model::drive_form::Actuation;
use nanotap_model::oscillator::{Oscillator, Stop};
use nanotap_model::parameter::Parameter;

const PAPER: &str = "[model]\nmodes = 3\nalpha1 = 0.1\nalpha2 = 0.1\nalpha3 = 0.1\n\
                     alpha4 = 20.0\nalpha5 = 0.0\nalpha6 = 0.2\nomega = 2.6\n";

#[test]
fn a_key_that_was_taken_away_makes_room_for_another() {
    let lever = "[model]\nmodes = 1\n[cantilever]\nk = \"40 N/m\"\nf0 = \"300 kHz\"\nQ = 400\n\
                 [tip]\nradius = \"10 nm\"\n[drive]\nfrequency_ratio = 1\nfree_amplitude = \"20 nm\"\n\
                 [gap]\ntip = \"15 nm\"\n[sample]\nlaw = \"hertz\"\n";
    let rubber = format!("{lever}modulus = \"2 GPa\"\npoisson = 0.45\n");
    let usual = format!("{lever}modulus = \"2 GPa\"\n");
    let model = |text: &str, overrides: &[&str]| {
        parse(text, overrides)
            .unwrap()
            .cantilever()
            .unwrap()
            .clone()
    };
    assert_ne!(model(&rubber, &[]), model(&usual, &[]));
    assert_eq!(model(&rubber, &["sample.poisson="]), model(&usual, &[]));
    // Set again it is there again, and of a case without it nothing changes.
    assert_eq!(
        model(&usual, &["sample.poisson=", "sample.poisson=0.45"]),
        model(&rubber, &[])
    );
    assert!(parse("[model]\nomega = 2\n", &["sample.modulus="]).is_err());
    assert!(!parse(PAPER, &["sample.modulus="]).unwrap().is_physical());
}

fn parse(text: &str, overrides: &[&str]) -> Result<Case, CaseFileError> {
    let source = Source {
        name: "c.toml".into(),
        text: text.into(),
    };
    let overrides: Vec<String> = overrides.iter().map(|&word| word.into()).collect();
    Case::parse(Some(source), &overrides).map(|case| case.called("case"))
}

fn dimensionless(text: &str, overrides: &[&str]) -> Cantilever {
    let case = parse(text, overrides).unwrap();
    assert!(!case.is_physical());
    case.cantilever().unwrap().clone()
}

/// The error message for `text` with `overrides`.
fn refusal(text: &str, overrides: &[&str]) -> String {
    parse(text, overrides).unwrap_err().to_string()
}

#[test]
fn the_papers_case_by_either_name_of_each_key() {
    assert_eq!(dimensionless(PAPER, &[]), Cantilever::paper());
    let mut readable = PAPER.to_owned();
    for parameter in Parameter::ALL {
        readable = readable.replace(parameter.name(), Key::of(parameter).alias().unwrap());
    }
    assert!(readable.contains("contact_stiffness = 20.0"));
    assert_eq!(dimensionless(&readable, &[]), Cantilever::paper());
}

#[test]
fn modes_and_gap_have_defaults_and_nothing_else_has() {
    let short = PAPER
        .replace("modes = 3\n", "")
        .replace("alpha5 = 0.0\n", "");
    assert_eq!(dimensionless(&short, &[]), Cantilever::paper());
    for parameter in Parameter::ALL
        .into_iter()
        .filter(|p| *p != Parameter::Alpha5)
    {
        let lines: Vec<&str> = PAPER
            .lines()
            .filter(|line| !line.starts_with(parameter.name()))
            .collect();
        let words = refusal(&lines.join("\n"), &[]);
        assert!(
            words.contains(&format!("lacks {}", parameter.name())),
            "{words}"
        );
    }
}

#[test]
fn overrides_win_over_the_file_by_any_name() {
    let expected = Cantilever {
        modes: 4,
        ..Cantilever::paper().with(Parameter::Omega, 20.0)
    };
    assert_eq!(dimensionless(PAPER, &["omega=20", "modes=4"]), expected);
    assert_eq!(
        dimensionless(PAPER, &["drive_frequency=20", "model.modes = 4"]),
        expected
    );
    assert_eq!(
        dimensionless(PAPER, &["omega=3", "omega=20", "modes=4"]),
        expected
    );
    let printed = dimensionless(PAPER, &["cosine_term=printed"]);
    assert_eq!(printed.cosine_term, CosineTerm::Printed);
}

#[test]
fn without_a_file_all_that_is_missing_is_told_at_once() {
    let error = Case::parse(None, &["alpha1=0.1".into(), "omega=2".into()]).unwrap_err();
    assert_eq!(error.problems.len(), 1);
    let words = error.to_string();
    assert!(
        words.contains("missing: alpha2, alpha3, alpha4, alpha6;"),
        "{words}"
    );
    let nothing = Case::parse(None, &[]).unwrap_err().to_string();
    assert!(
        nothing.starts_with("no case was given; name a case file, or"),
        "{nothing}"
    );
    let all = [
        "alpha1=0.1",
        "alpha2=0.1",
        "alpha3=0.1",
        "alpha4=20",
        "alpha6=0.2",
        "omega=2.6",
    ];
    let all: Vec<String> = all.iter().map(|&word| word.into()).collect();
    assert_eq!(Case::parse(None, &all), Ok(Case::from(Cantilever::paper())));
}

#[test]
fn every_refusal_says_place_key_value_and_remedy() {
    for (change, to, words) in [
        (
            "omega = 2.6",
            "omgea = 2.6",
            "c.toml:9:1: `omgea` (= 2.6) is not a key of [model]; did you mean `omega`?",
        ),
        (
            "omega = 2.6",
            "omega = \"2.6\"",
            "c.toml:9:9: `omega` = \"2.6\" is text, not a number; write it without quotes: omega = 2.6",
        ),
        (
            "omega = 2.6",
            "omega = \"65 kHz\"",
            "quantities with units belong in a physical case",
        ),
        (
            "omega = 2.6",
            "omega = nan",
            "c.toml:9:9: `omega` = nan: must be a finite number",
        ),
        (
            "omega = 2.6",
            "omega = -inf",
            "`omega` = -inf: must be a finite number",
        ),
        (
            "omega = 2.6",
            "omega = 1e999",
            "`omega` = 1e999: must be a finite number",
        ),
        (
            "omega = 2.6",
            "omega = 0",
            "`omega` = 0: must be more than 0",
        ),
        (
            "omega = 2.6",
            "omega = true",
            "`omega` = true is a boolean, not a number",
        ),
        (
            "omega = 2.6",
            "omega = [1]",
            "`omega` = [1] is an array, not a number",
        ),
        (
            "omega = 2.6",
            "omega = 2.6\ndrive_frequency = 2",
            "c.toml:10:1: `omega` and `drive_frequency` are the same key",
        ),
        (
            "omega = 2.6",
            "omega = 2.6\nomega = 2",
            "c.toml:10:1: duplicate key",
        ),
        ("omega = 2.6", "omega = ", "c.toml:9:"),
        (
            "alpha1 = 0.1",
            "alpha1 = -0.1",
            "c.toml:3:10: `alpha1` = -0.1: must be 0 or more",
        ),
        (
            "modes = 3",
            "modes = 0",
            "c.toml:2:9: `modes` = 0 is outside 1 … 50; write a whole number",
        ),
        ("modes = 3", "modes = -1", "`modes` = -1 is outside 1 … 50"),
        (
            "modes = 3",
            "modes = 1000000000",
            "`modes` = 1000000000 is outside 1 … 50",
        ),
        (
            "modes = 3",
            "modes = 99999999999999999999",
            "is outside 1 … 50",
        ),
        (
            "modes = 3",
            "modes = 3.5",
            "`modes` = 3.5 is not a whole number",
        ),
        ("modes = 3", "modes = \"3\"", "`modes` = \"3\" is text"),
        (
            "modes = 3",
            "kind = \"cantilver\"",
            "did you mean \"cantilever\"?",
        ),
        (
            "modes = 3",
            "kind = 3",
            "`kind` = 3 is not one of \"cantilever\", \"vibro_impact\", \"impact\"",
        ),
        (
            "modes = 3",
            "cosine_term = \"print\"",
            "did you mean \"printed\"?",
        ),
        (
            "modes = 3",
            "restitution = 0.8",
            "it belongs to kind = \"impact\"",
        ),
        (
            "modes = 3",
            "temperature = 300",
            "the keys are alpha1, alpha2",
        ),
        (
            "[model]",
            "[modle]",
            "c.toml:1:2: `[modle]` is not a table of a case; did you mean [model]?",
        ),
        (
            "[model]\n",
            "",
            "c.toml:1:1: `modes` and 7 more keys are outside any table; put a line [model] before it",
        ),
        (
            "[model]\n",
            "k = \"2 N/m\"\n[model]\n",
            "c.toml:1:1: `k` is outside any table; put a line [cantilever] before it",
        ),
        (
            "[model]",
            "[sample]\ncontact = \"dmt\"\n[model]",
            "`contact` (= \"dmt\") is not a key of [sample]; did you mean `law`?",
        ),
        (
            "[model]",
            "[sample]\nfrequency = \"20 kHz\"\n[model]",
            "`frequency` (= \"20 kHz\") is not a key of [sample]; it is a key of [drive]",
        ),
        (
            "[model]",
            "[sample]\nstiffness = \"20 N/m\"\n[model]",
            "`alpha1` and 6 more keys are dimensionless, but [sample] makes this a physical case",
        ),
    ] {
        let text = PAPER.replace(change, to);
        assert_ne!(text, PAPER, "the change is made");
        let refused = refusal(&text, &[]);
        assert!(refused.contains(words), "{to}: {refused}");
    }
    assert!(refusal("", &[]).contains("c.toml: empty case: missing alpha1"));
}

#[test]
fn a_bad_override_is_named_as_it_was_written() {
    for (word, words) in [
        (
            "omgea=2",
            "omgea=2: `omgea` (= 2) is not a key of [model]; did you mean `omega`?",
        ),
        (
            "omega=nan",
            "omega=nan: `omega` = nan: must be a finite number",
        ),
        ("omega", "omega: no `=` in it; write a key and a value"),
        (
            "modle.omega=2",
            "modle.omega=2: `modle` is not a table of a case; did you mean [model]?",
        ),
        (
            "stiffness=20 N/m",
            "did you mean `sample.stiffness`, of a physical case?",
        ),
        (
            "sample.stiffness=20 N/m",
            "`alpha1` and 6 more keys are dimensionless, but [sample] makes",
        ),
        (
            "gap.tipp=1 nm",
            "`tipp` (= 1 nm) is not a key of [gap]; did you mean `tip`?",
        ),
    ] {
        let refused = refusal(PAPER, &[word]);
        assert!(refused.contains(words), "{word}: {refused}");
    }
}

#[test]
fn all_problems_are_told_in_the_order_of_the_file() {
    let text = PAPER
        .replace("alpha1 = 0.1", "alpha1 = -1")
        .replace("omega = 2.6", "temperature = 300");
    let error = parse(&text, &["alpha2=x"]).unwrap_err();
    let lines: Vec<String> = error.to_string().lines().map(str::to_owned).collect();
    assert_eq!(lines.len(), 4, "{error}");
    for (line, start) in lines.iter().zip([
        "c.toml:1:2: the case lacks omega",
        "c.toml:3:10",
        "c.toml:9:1",
        "alpha2=x",
    ]) {
        assert!(line.starts_with(start), "{line}");
    }
}

#[test]
fn oscillators_are_read_and_checked() {
    let impact = "[model]\nkind = \"impact\"\nstiffness = 1\ndamping = 0\nforcing = 1\n\
                  omega = 2.5\ngap = 0\nrestitution = 0.8\n";
    let expected = Oscillator {
        mass: 1.0,
        stiffness: 1.0,
        damping: 0.0,
        forcing: 1.0,
        omega: 2.5,
        gap: 0.0,
        stop: Stop::Rigid { restitution: 0.8 },
    };
    assert_eq!(parse(impact, &[]), Ok(Case::from(expected)));
    let soft = parse(
        &impact.replace("restitution = 0.8\n", ""),
        &[
            "kind=vibro_impact",
            "contact_stiffness=20",
            "contact_damping=0.2",
        ],
    );
    let stop = Stop::Soft {
        stiffness: 20.0,
        damping: 0.2,
    };
    assert_eq!(soft, Ok(Case::from(Oscillator { stop, ..expected })));
    for (word, words) in [
        (
            "mass=0",
            "`mass` = 0: a positive, finite number of at most 1e12 is needed",
        ),
        ("mass=-1", "positive"),
        ("stiffness=-1", "at least 0"),
        ("restitution=1.1", "a number from 0 to 1"),
        ("omega=inf", "finite"),
        ("modes=2", "it belongs to kind = \"cantilever\""),
        ("sample.damping=1", "an oscillator takes no [sample]"),
    ] {
        let refused = refusal(impact, &[word]);
        assert!(refused.contains(words), "{word}: {refused}");
    }
}

#[test]
fn physical_tables_keep_their_quantities_and_places() {
    let text = "[cantilever]\nk = \"2.8 N/m\"\nf0 = \"75 kHz\"\nQ = 200\n\
                [sample]\nstiffness = \"20 N/m\"\n[model]\nmodes = 2\n";
    let text = &format!(
        "{text}[drive]\nfrequency = \"75 kHz\"\namplitude = \"1 nm\"\n[gap]\ntip = \"5 nm\"\n"
    );
    let case = parse(text, &["sample.stiffness=30 N/m"]).unwrap();
    let written = |key: &str| case.get(Key::find(key).unwrap());
    assert_eq!(written("cantilever.k"), 2.8);
    assert_eq!(written("cantilever.Q"), 200.0);
    assert_eq!(written("sample.stiffness"), 30.0);
    assert_eq!(case.get(Key::Modes), 2.0);
    assert_eq!(case.cantilever().unwrap().alpha6, 0.0);
    let damped = refusal(text, &["sample.damping=-1 N s/m"]);
    assert!(
        damped.starts_with("sample.damping=-1 N s/m: sample.damping = -1 N s/m: it must not"),
        "{damped}"
    );
    assert!(refusal(&text.replace("f0", "fo"), &[]).contains("did you mean `f0`?"));
    assert!(
        refusal(&text.replace("200", "false"), &[]).contains("`cantilever.Q` = false is a boolean")
    );
}

#[test]
fn laws_and_drives_are_read_and_checked() {
    let recovers = dimensionless(PAPER, &["contact=kelvin-voigt"]);
    assert_eq!(recovers.contact, ContactLaw::KelvinVoigt);
    let solid = [
        "contact=standard-linear-solid",
        "alpha6=0",
        "relaxation_stiffness=40",
        "relaxation_time=0.005",
    ];
    let read = dimensionless(PAPER, &solid);
    let numbers = Parameter::of_law(read.contact).map(|own| read.get(own));
    assert!(numbers.eq([40.0, 0.005]));
    // The solid's damper is its arm's, so a file without alpha6 lacks nothing.
    let file = PAPER.replace("alpha6 = 0.2\n", "");
    assert_eq!(dimensionless(&file, &[solid[0], solid[2], solid[3]]), read);
    let driven = dimensionless(
        PAPER,
        &[
            "actuation=tip",
            "tone2_ratio=25/4",
            "tone2_amplitude=0.01",
            "tone2_phase=90",
        ],
    );
    assert_eq!(driven.actuation, Actuation::Tip);
    assert_eq!(driven.further_tones, ["6.25".parse().unwrap()]);
    assert_eq!(
        dimensionless(PAPER, &["tone2_ratio=6.25"]).further_tones,
        driven.further_tones
    );
    for (words, refusal_words) in [
        (
            &["contact=kelvin-voight"][..],
            "did you mean \"kelvin-voigt\"?",
        ),
        (&solid[..1], "`alpha6` = 0.2: must be 0 with contact"),
        (&solid[..2], "lacks relaxation_stiffness, relaxation_time"),
        (
            &["relaxation_time=0.1"],
            "belongs to contact = \"standard-linear-solid\"",
        ),
        (&["tone2_amplitude=0.1"], "no second tone: give tone2_ratio"),
        (&["tone3_amplitude=0.1"], "no third tone: give tone3_ratio"),
        (&["tone3_ratio=3"], "a third tone and no second one"),
        (
            &["tone2_ratio=3/2", "tone3_ratio=1.5"],
            "the same frequency",
        ),
        (
            &["tone2_ratio=601/599", "tone3_ratio=603/601"],
            "after more than 2000 periods",
        ),
        (&["tone2_ratio=two"], "is not a ratio of frequencies"),
        (&["tone2_ratio=1"], "the same frequency"),
        (&["actuation=magnet"], "\"base\", \"tip\", \"distributed\""),
        (
            &["actuation=tip", "cosine_term=printed"],
            "belongs to the drive through the base",
        ),
    ] {
        let refused = refusal(PAPER, words);
        assert!(refused.contains(refusal_words), "{words:?}: {refused}");
    }
    // `bimodal` needs no fraction with a small denominator.
    assert!(parse(PAPER, &["tone2_ratio=3.14159"]).is_ok());
}

#[test]
fn a_case_written_out_is_read_back() {
    let case = Cantilever {
        modes: 7,
        alpha5: -0.125,
        alpha4: 1e-9 / 3.0,
        cosine_term: CosineTerm::Printed,
        ..Cantilever::paper()
    };
    assert_eq!(dimensionless(&to_toml(&case), &[]), case);
    let case = Cantilever {
        alpha6: 0.0,
        actuation: Actuation::Distributed,
        further_tones: vec!["25/4".parse().unwrap(), "17/2".parse().unwrap()],
        ..Cantilever::paper()
    };
    let case = case
        .with(Parameter::Tone3Amplitude, 0.003)
        .on(ContactLaw::StandardLinearSolid, &[40.0, 0.1 / 3.0])
        .with(Parameter::Tone2Amplitude, 0.01)
        .with(Parameter::Tone2Phase, -12.5);
    assert_eq!(dimensionless(&to_toml(&case), &[]), case);
}

/// An override replaces alternatives in the file; two alternatives together, and one key under two
/// names, are refused.
#[test]
fn the_same_said_twice_is_refused_or_replaced() {
    let text = "[cantilever]\nk = \"2.8 N/m\"\nf0 = \"75 kHz\"\nQ = 200\n\
                [sample]\nstiffness = \"20 N/m\"\n[drive]\nfrequency = \"75 kHz\"\n\
                free_amplitude = \"20 nm\"\n[gap]\ntip = \"5 nm\"\n";
    let own = parse(text, &["drive.amplitude=0.1 nm"]).unwrap();
    assert_eq!(own.get(Key::DriveAmplitude), 1e-10);
    let held = parse(text, &["drive.setpoint=0.8"]).unwrap();
    assert!(held.leaves_distance_to_setpoint());
    for (words, refused) in [
        (
            &["drive.amplitude=1 nm", "drive.free_amplitude=2 nm"][..],
            "drive.amplitude and drive.free_amplitude cannot both be given",
        ),
        (
            &["drive.setpoint=0.8", "gap.tip=3 nm"],
            "drive.setpoint and gap.tip cannot both be given",
        ),
    ] {
        let words = refusal(text, words);
        assert!(words.contains(refused), "{words}");
    }
    let both = refusal(&format!("{text}[drive.x]\n"), &[]);
    assert!(both.contains("drive"), "{both}");
    let names = refusal(PAPER, &["omega=3", "drive_frequency=4"]);
    assert!(
        names.contains("`omega` and `drive_frequency` are the same key"),
        "{names}"
    );
    // A quantity that the model does not take is named as it was stated.
    let far = refusal(text, &["cantilever.Q=1e-12"]);
    assert!(far.contains("cantilever.Q = 1e-12 makes `alpha3`"), "{far}");
    let slow = refusal(text, &["drive.frequency_ratio=1e-9"]);
    assert!(
        slow.contains("drive.frequency_ratio = 1e-9 makes `omega`"),
        "{slow}"
    );
}

/// A long file with many problems is refused quickly, with the first of them.
#[test]
fn fifty_thousand_unknown_keys_are_refused_at_once() {
    use std::fmt::Write as _;
    let mut text = String::from("[model]\n");
    for k in 0..50_000 {
        let _ = writeln!(text, "unknown{k} = {k}");
    }
    let begun = std::time::Instant::now();
    let error = parse(&text, &[]).unwrap_err();
    assert_eq!(error.problems.len(), SHOWN);
    assert_eq!(error.problems.len() + error.more, 50_001);
    assert!(
        error.to_string().ends_with("and 49981 more"),
        "{}",
        error.more
    );
    // Minutes when every key was compared with every name; now a tenth of a second.
    assert!(begun.elapsed().as_secs() < 20);
}

proptest! {
    #[test]
    fn no_text_makes_it_panic(text in ".*", word in ".*") {
        let _ = parse(&text, &[&word]).map_err(|error| error.to_string());
    }

    #[test]
    fn nearly_right_texts_do_not_make_it_panic(
        at in 0..PAPER.len(), cut in 0..20_usize, put in "[\\[\\]=.\"'\\\\#a-z0-9\u{80}-\u{2ff}\n-]{0,8}",
    ) {
        let end = (at + cut).min(PAPER.len());
        let text = format!("{}{put}{}", &PAPER[..at], &PAPER[end..]);
        if let Err(error) = parse(&text, &[]) {
            prop_assert!(!error.problems.is_empty());
            for problem in &error.problems {
                if let Place::Span(span) = &problem.place {
                    prop_assert!(text.get(span.clone()).is_some(), "{span:?} of {}", text.len());
                }
            }
        }
    }
}
