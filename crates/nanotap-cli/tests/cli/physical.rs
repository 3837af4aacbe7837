//! Physical cases at the terminal.

use crate::util::{Folder, case};

/// An FM-class lever on a stiff spring.
const LEVER: &str = "\
[cantilever]
k = \"2.8 N/m\"
f0 = \"75 kHz\"
Q = 200

[sample]
stiffness = \"20 N/m\"
damping = \"1e-6 N s/m\"

[drive]
frequency = \"65.7 kHz\"
amplitude = \"1 nm\"

[gap]
tip = \"0 nm\"
beam = \"10 um\"
";

#[test]
fn physical_and_dimensionless_values_are_shown() {
    let json = case(LEVER, &["--json"]).json();
    // α4 = 3 K1/k, α2 = f/g0 and α5 = g1/g0 for every lever.
    let near = |key: &str, expected: f64| {
        let value = json[key].as_f64().unwrap();
        assert!(
            (value - expected).abs() <= 1e-12 * expected.abs().max(1.0),
            "{key} = {value}"
        );
    };
    near("alpha4", 3.0 * 20.0 / 2.8);
    near("alpha2", 1e-9 / 10e-6);
    near("alpha5", 0.0);
    // The bare beam's first mode is at Ω = 3.5160 (β₁ = 1.8751), here at 75 kHz.
    let omega = json["omega"].as_f64().unwrap();
    assert!((omega - 65.7 / 75.0 * 3.516015).abs() < 1e-5, "{omega}");
    let physical = &json["physical"];
    assert_eq!(physical["contact_stiffness"].as_f64(), Some(20.0));
    assert!((physical["drive_frequency"].as_f64().unwrap() / 65.7e3 - 1.0).abs() < 1e-12);

    let text = case(LEVER, &[]).stdout;
    for words in [
        "a physical cantilever",
        "2.8 N/m",
        "75 kHz",
        "alpha4",
        "20 N/m",
    ] {
        assert!(text.contains(words), "{words}:\n{text}");
    }
}

/// Errors name the quantities of the case and give values in its units.
#[test]
fn refusals_are_in_the_units_of_the_case() {
    let folder = Folder::new();
    folder.write("lever.toml", LEVER);
    for (arguments, words) in [
        (
            "sweep lever.toml --over gap.tip=10nm:10nm:3",
            "from 10 nm to 10 nm; the last value must be greater",
        ),
        (
            "sweep lever.toml --over gap.tip=10nm,10nm",
            "write gap.tip=10nm:20nm:400",
        ),
        (
            "basin lever.toml --x a1=5nm:1nm:9 --y v1=-1:1:9",
            "from 5 nm to 1 nm; the last value must be greater",
        ),
        (
            "orbit lever.toml --state=tip=5",
            "`5` as tip of the state: expected a length below",
        ),
        (
            "approach lever.toml --from 30N",
            "30N: gap.tip: expected a length such as",
        ),
    ] {
        let arguments: Vec<&str> = arguments.split(' ').collect();
        folder.run(&arguments).refused(&[words]);
    }
}

#[test]
fn a_physical_case_written_out_is_its_dimensionless_self() {
    let folder = Folder::new();
    folder.write("lever.toml", LEVER);
    let arguments = ["case", "lever.toml", "--out", "plain.toml", "--json"];
    let written = folder
        .run(&[&arguments[..], &["--model-units"]].concat())
        .json();
    assert!(folder.read("plain.toml").contains("alpha4 = "));
    let again = folder.run(&["case", "plain.toml", "--json"]).json();
    for key in [
        "alpha1", "alpha2", "alpha3", "alpha4", "alpha5", "alpha6", "omega", "modes",
    ] {
        assert_eq!(written[key], again[key], "{key}");
    }
}

#[test]
fn errors_in_quantities_show_their_place() {
    case(LEVER.replace("20 N/m", "20 kHz"), &[]).refused(&["case.toml:7:13", "20 kHz", "N/m"]);
    case(LEVER.replace("Q = 200", ""), &[]).refused(&["case.toml:1:", "cantilever.Q"]);
    case(LEVER, &["--set", "sample.stiffness=-3 N/m"])
        .refused(&["--set sample.stiffness=-3 N/m", "sample.stiffness"]);
    case(LEVER.replace("f0 =", "fo ="), &[]).refused(&["`fo`", "did you mean `f0`?"]);
    case(LEVER, &["--set", "omega=2"]).refused(&["`omega` is dimensionless"]);
    case(LEVER, &["--catalogue", "none.toml"]).refused(&["none.toml"]);
}

#[test]
fn modes_of_a_lever() {
    let folder = Folder::new();
    folder.write("lever.toml", LEVER);
    let json = folder
        .run(&["modes", "lever.toml", "--json", "--set", "modes=4"])
        .json();
    assert_eq!(json["free"].as_array().unwrap().len(), 4);
}

/// Each value under `physical` is the dimensionless one in SI: lengths times g0 = 10 µm, energies
/// times g0² k/3 and in electronvolts, times by √(mL⁴/(EI)).
#[test]
fn motions_of_a_lever_are_reported_in_si() {
    let folder = Folder::new();
    folder.write("lever.toml", LEVER);
    let orbit = folder
        .run(&[
            "orbit",
            "lever.toml",
            "--json",
            "--set",
            "drive.frequency=75 kHz",
            "--set",
            "cantilever.length=225 um",
            "--set",
            "cantilever.width=28 um",
            "--set",
            "cantilever.thickness=3 um",
        ])
        .json();
    let physical = &orbit["physical"];
    let pair = |key: &str, si: &str, unit: f64| {
        let (value, si) = (orbit[key].as_f64().unwrap(), physical[si].as_f64().unwrap());
        assert!(
            (si - value * unit).abs() <= 1e-9 * si.abs(),
            "{key}: {value} is not {si}"
        );
    };
    let energy = 10e-6 * 10e-6 * 2.8 / 3.0;
    // Ω₁ = 3.516015 of the bare beam is 75 kHz.
    let time = 3.516_015_268_5 / (std::f64::consts::TAU * 75e3);
    for (key, si, unit) in [
        ("first_harmonic", "A", 10e-6),
        ("indentation", "indentation", 10e-6),
        ("optical_amplitude", "optical_amplitude", 10e-6),
        ("phase", "phase", 1.0),
        ("contact_time", "contact_time", time),
        ("dissipation", "E_dis", energy),
        ("dissipation", "E_dis_eV", energy / 1.602_176_634e-19),
        ("virial", "virial_eV", energy / 1.602_176_634e-19),
        ("sample_power", "sample_power", energy / time),
    ] {
        pair(key, si, unit);
    }
    let second = &physical["harmonics"][1];
    assert_eq!(second["order"].as_f64(), Some(2.0));
    assert!((second["frequency"].as_f64().unwrap() - 150e3).abs() < 1e-6);
    let slope = orbit["harmonics"][1]["slope"].as_f64().unwrap() * 10e-6 / 225e-6;
    assert!((second["slope"].as_f64().unwrap() / slope - 1.0).abs() < 1e-9);
}

/// On a very soft sample the indentation exceeds the radius of the tip, beyond the range of Hertz's
/// law: the terminal prints by how much.
#[test]
fn a_motion_beyond_the_range_of_its_law_has_a_warning() {
    let folder = Folder::new();
    folder.write("case.toml", SOFT);
    let said = folder.run(&["orbit", "case.toml", "--period", "1"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    for words in ["warning: δ/R reaches ", "derived for values up to 1"] {
        assert!(said.stderr.contains(words), "{}", said.stderr);
    }
    let stiff = folder.run(&["orbit", "case.toml", "--set", "sample.modulus=1 GPa"]);
    assert!(!stiff.stderr.contains("δ/R"), "{}", stiff.stderr);
}

const SOFT: &str = "\
[model]
modes = 1
[cantilever]
k = \"0.3 N/m\"
f0 = \"350 kHz\"
Q = 2
[tip]
radius = \"5 nm\"
[sample]
law = \"hertz\"
modulus = \"1 MPa\"
poisson = 0.5
[drive]
actuation = \"tip\"
frequency_ratio = 1
free_amplitude = \"20 nm\"
[gap]
tip = \"10 nm\"
";
