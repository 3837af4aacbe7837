//! `nanotap simulate`, `orbit` and `convergence`.

use serde_json::Value;

use crate::util::Folder;

fn number(json: &Value, key: &str) -> f64 {
    json[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key} in {json}"))
}

pub(crate) fn vector(json: &Value) -> Vec<f64> {
    json.as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

/// Every key occurs once in a document: a reader may keep the first or the last of two.
fn assert_no_key_twice(text: &str) {
    let top: Vec<&str> = text
        .lines()
        .filter(|line| line.starts_with("  \""))
        .map(|line| line.trim().split('"').nth(1).unwrap())
        .collect();
    let mut unique = top.clone();
    unique.sort_unstable();
    unique.dedup();
    assert_eq!(unique.len(), top.len(), "{top:?}");
}

const IMPACT: &str = "[model]\nkind = \"impact\"\nstiffness = 1\ndamping = 0\nforcing = 1\nomega = 2.5\n\
                      gap = 0\nrestitution = 0.8\n";

/// The state of the paper's case at Ω = 3: shooting on the flow with 50-digit arithmetic.
const STATE_AT_3: [f64; 6] = [
    0.048_674_496_26,
    -4.170_932_009e-4,
    3.895_611e-5,
    -0.026_935_536_97,
    3.208_938_387e-3,
    3.311_213_241e-3,
];

#[test]
fn simulate_reports_all_fields_and_ends_on_the_orbit() {
    let folder = Folder::with_paper_case();
    let outcome = folder.run(&[
        "simulate",
        "case.toml",
        "--set",
        "omega=3",
        "--strobe",
        "4",
        "--json",
    ]);
    assert_no_key_twice(&outcome.stdout);
    let json = outcome.json();
    assert_eq!(
        (json["classification"].as_str(), json["period"].as_u64()),
        (Some("periodic"), Some(1))
    );
    let strobe = json["strobe"].as_array().unwrap();
    assert_eq!(strobe.len(), 4);
    for state in strobe {
        for (value, expected) in vector(state).iter().zip(STATE_AT_3) {
            assert!((value - expected).abs() < 2e-11, "{value} {expected}");
        }
    }
    let events = json["events"].as_array().unwrap();
    assert_eq!(events[0]["kind"], "contact_start");
    assert_eq!(events[1]["kind"], "contact_end");
    assert!((number(&events[0], "tau") - 1.355_679_157_6).abs() < 1e-9);
    assert!((number(&events[1], "tau") - 1.830_041_520_3).abs() < 1e-9);
    assert!(number(&json["energy_balance"], "residual").abs() < 1e-11);
    assert!(number(&json, "tip_max") > number(&json, "tip_min"));
    for key in [
        "amplitude",
        "contact_fraction",
        "beam_clearance",
        "periods_per_second",
    ] {
        assert!(number(&json, key) > 0.0, "{key}");
    }
}

/// Only the named observables are measured, with the same values as all together. Experimenters'
/// names are accepted, and the terminal shows one row for each.
#[test]
fn only_named_observables_are_measured() {
    let folder = Folder::with_paper_case();
    for study in ["simulate", "orbit"] {
        let run = |more: &[&str]| {
            let arguments = [&[study, "case.toml", "--set", "omega=3"], more].concat();
            folder.run(&arguments)
        };
        let all = run(&["--json"]).json();
        let some = run(&["--observables", "A,gap_range", "--json"]).json();
        assert!((number(&some, "first_harmonic") - number(&all, "first_harmonic")).abs() < 1e-14);
        assert_eq!(vector(&some["gap_range"]), vector(&all["gap_range"]));
        for absent in ["tip_max", "beam_clearance", "energy_balance", "dissipation"] {
            assert!(some.get(absent).is_none(), "{study}: {absent}");
            assert!(all.get(absent).is_some(), "{study}: {absent}");
        }
        assert!(
            run(&["--observables=", "--json"])
                .json()
                .get("gap_range")
                .is_none()
        );
        let text = run(&["--observables", "A,energy_balance"]).stdout;
        assert!(text.contains("first_harmonic") && text.contains("drive work"));
        assert!(!text.contains("gap_range"), "{text}");
    }
}

/// Keys in a list are the same as several options.
#[test]
fn derivatives_are_listed() {
    let folder = Folder::with_paper_case();
    let derivatives = |more: &[&str]| {
        let arguments = [&["orbit", "case.toml", "--set", "omega=3", "--json"], more].concat();
        folder.run(&arguments).json()["derivatives"].clone()
    };
    let listed = derivatives(&["--derivatives", "alpha1, alpha3"]);
    assert_eq!(listed.as_object().map(serde_json::Map::len), Some(2));
    let each = derivatives(&["--derivatives", "alpha1", "--derivatives", "alpha3"]);
    assert_eq!(listed, each);
}

#[test]
fn simulate_from_the_start_takes_states_and_periods_as_given() {
    let folder = Folder::with_paper_case();
    let run = |state: &str| {
        folder
            .run(&[
                "simulate",
                "case.toml",
                "--transient",
                "0",
                "--periods",
                "3",
                "--strobe",
                "3",
                "--state",
                state,
                "--json",
            ])
            .json()
    };
    let once = run("0.1,-0.02,0,-0.3,0,1e-3");
    assert_eq!(
        (once["transient"].as_u64(), once["periods"].as_u64()),
        (Some(0), Some(3))
    );
    // The second period of one run is the first of the next.
    let strobe: Vec<Vec<f64>> = once["strobe"]
        .as_array()
        .unwrap()
        .iter()
        .map(vector)
        .collect();
    let typed: Vec<String> = strobe[0].iter().map(f64::to_string).collect();
    let again = run(&typed.join(","));
    for (value, expected) in vector(&again["strobe"][1]).iter().zip(&strobe[2]) {
        assert!((value - expected).abs() < 1e-13);
    }
}

#[test]
fn chaos_is_reported_with_its_evidence() {
    let folder = Folder::with_paper_case();
    let outcome = folder.run(&["simulate", "case.toml"]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    for words in [
        "chaotic",
        "largest exponent 0.2",
        "no escape",
        "energy a drive period",
        "beam clearance",
    ] {
        assert!(
            outcome.stdout.contains(words),
            "{words}:\n{}",
            outcome.stdout
        );
    }
}

#[test]
fn time_series_have_all_columns_and_close() {
    let folder = Folder::with_paper_case();
    let outcome = folder.run(&[
        "orbit",
        "case.toml",
        "--set",
        "omega=3",
        "--out",
        "orbit.csv",
        "--harmonics-out",
        "harmonics.csv",
        "--resolution",
        "50",
        "--plot",
        "orbit.svg",
    ]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    let csv = folder.read("orbit.csv");
    let mut lines = csv.lines();
    assert_eq!(
        lines.next(),
        Some("tau,tip,tip_rate,gap,force,contact,a1,a2,a3,v1,v2,v3")
    );
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), 51);
    for (first, last) in rows[0].iter().zip(&rows[50]).skip(1) {
        assert!((first - last).abs() < 1e-12);
    }
    for row in &rows {
        // W = Σ a_j φ_j(1), φ_j(1) = ±2; V_T = W + α2 sin Ωτ + α5; f only in contact.
        let w = 2.0 * (row[6] - row[7] + row[8]);
        assert!((row[1] - w).abs() < 1e-12);
        assert!((row[3] - w - 0.1 * (3.0 * row[0]).sin()).abs() < 1e-12);
        assert_eq!(row[5] == 1.0, row[3] <= 0.0);
        assert!(row[5] == 1.0 || row[4] == 0.0);
    }
    let harmonics = folder.read("harmonics.csv");
    assert!(harmonics.starts_with("order,tip,tip_lag_degrees,force,force_lag_degrees,slope\n1,"));
    assert_eq!(harmonics.lines().count(), 21);
    assert!(folder.read("orbit.svg").contains("Re "));
    // A whole run, longer than the part that is recorded for figures.
    let long = folder.run(&[
        "simulate",
        "case.toml",
        "--transient",
        "0",
        "--periods",
        "600",
        "--resolution",
        "2",
        "--out",
        "run.csv",
    ]);
    assert_eq!(long.code, 0, "{}", long.stderr);
    assert_eq!(folder.read("run.csv").lines().count(), 1 + 600 * 2 + 1);
}

#[test]
fn orbit_finds_the_unstable_orbit_in_chaos() {
    let folder = Folder::with_paper_case();
    let json = folder
        .run(&["orbit", "case.toml", "--period", "1", "--json"])
        .json();
    assert_eq!(
        (json["period"].as_u64(), json["stable"].as_bool()),
        (Some(1), Some(false))
    );
    // Reference: the period-1 orbit exists at Ω = 2.6 and is unstable, μ = −1.392.
    let first = vector(&json["multipliers"][0]);
    assert!(
        (first[0] + 1.392).abs() < 1e-3 && first[1] == 0.0,
        "{first:?}"
    );
    assert!(number(&json, "determinant_defect") < 1e-10);
    assert!(json["harmonics"].as_array().unwrap().len() == 20);
    for key in ["thd", "phase", "residual", "contact_fraction"] {
        assert!(json[key].is_f64(), "{key}");
    }
    assert_eq!(vector(&json["state"]).len(), 6);
}

#[test]
fn an_impact_oscillator_is_studied_by_the_same_commands() {
    let folder = Folder::new();
    folder.write("impact.toml", IMPACT);
    let json = folder
        .run(&["orbit", "impact.toml", "--period", "1", "--json"])
        .json();
    // Shaw & Holmes' oscillator: the one-impact orbit at ω = 2.5 hits at 0.6453521784.
    assert!((number(&json, "impact_speed") - 0.645_352_178_4).abs() < 1e-9);
    assert_eq!(json["events"][0]["kind"], "impact");
    assert!(json.get("beam_clearance").is_none());
    let text = folder.run(&["simulate", "impact.toml", "--plot", "impact.svg"]);
    assert_eq!(text.code, 0, "{}", text.stderr);
    assert!(text.stdout.contains("rigid stop"));
    folder
        .run(&["convergence", "impact.toml"])
        .refused(&["impact.toml", "needs a cantilever"]);
    folder
        .run(&["simulate", "impact.toml", "--method", "rk4"])
        .refused(&["neither rigid impacts", "--method"]);
}

#[test]
fn a_physical_case_is_reported_in_si() {
    let folder = Folder::new();
    folder.write(
        "lever.toml",
        "[cantilever]\nk = \"2.8 N/m\"\nf0 = \"75 kHz\"\nQ = 200\n[sample]\nstiffness = \"20 N/m\"\n\
         [drive]\nfrequency = \"75 kHz\"\nfree_amplitude = \"20 nm\"\n[gap]\ntip = \"10 nm\"\nbeam = \"10 um\"\n",
    );
    let outcome = folder.run(&[
        "simulate",
        "lever.toml",
        "--json",
        "--out",
        "run.csv",
        "--plot",
        "run.svg",
    ]);
    let json = outcome.json();
    let physical = &json["physical"];
    // Driven to 20 nm, limited by the sample at 10 nm.
    let amplitude = number(physical, "amplitude");
    assert!(amplitude > 8e-9 && amplitude < 20e-9, "{amplitude}");
    assert!((number(physical, "frequency") / 75e3 - 1.0).abs() < 1e-9);
    for key in ["F_max", "E_dis", "contact_time"] {
        assert!(number(physical, key) >= 0.0, "{key}");
    }
    assert!(
        folder
            .read("run.csv")
            .lines()
            .next()
            .unwrap()
            .starts_with("time (s),tip (m),tip_rate (m/s),gap (m),force (N)")
    );
    assert!(folder.read("run.svg").contains("(nm)"));
}

#[test]
fn convergence_reports_how_many_modes_are_enough() {
    let folder = Folder::with_paper_case();
    let arguments = [
        "convergence",
        "case.toml",
        "--set",
        "omega=4.1",
        "--largest",
        "5",
        "--tolerance",
        "0.02",
    ];
    let json = folder.run(&[&arguments[..], &["--json"]].concat()).json();
    assert_eq!(json["modes"], serde_json::json!([1, 2, 3, 4, 5]));
    let difference = vector(&json["difference"]);
    assert!(difference.windows(2).all(|w| w[1] < w[0]), "{difference:?}");
    assert_eq!(difference[4], 0.0);
    assert_eq!(json["enough"], 3);
    // The paper's case with N = 3 at Ω = 4.1 has its tip within [−0.3183, 1.0945].
    assert!((number(&json["motions"][2], "tip_max") - 1.094_46).abs() < 1e-5);
    let text = folder.run(
        &[
            &arguments[..],
            &["--plot", "modes.svg", "--out", "modes.csv"],
        ]
        .concat(),
    );
    assert_eq!(text.code, 0, "{}", text.stderr);
    assert!(text.stdout.contains("3 modes are enough"));
    assert_eq!(folder.read("modes.csv").lines().count(), 6);
}

#[test]
fn results_of_fixed_steps_are_labelled() {
    let folder = Folder::with_paper_case();
    let arguments = [
        "simulate",
        "case.toml",
        "--set",
        "omega=4.1",
        "--method",
        "rk4",
        "--steps",
        "400,800",
        "--periods",
        "20",
    ];
    let outcome = folder.run(&[&arguments[..], &["--json"]].concat());
    assert!(
        outcome.stderr.contains("the paper's method"),
        "{}",
        outcome.stderr
    );
    let json = outcome.json();
    assert_eq!(
        (json["method"].as_str(), json["steps"][1].as_u64()),
        (Some("rk4"), Some(800))
    );
    assert!(json.get("period").is_none() && json.get("classification").is_none());
    assert_eq!(json["exact"]["period"], 1);
    // First order in the step: near the exact W of the period-1 orbit, but not equal to it.
    let error = (number(&json, "tip_max") - 1.094_46).abs();
    assert!(error < 0.02, "{error}");
}

#[test]
fn invalid_requests_are_refused_with_a_remedy() {
    let folder = Folder::with_paper_case();
    let refused = |arguments: &[&str], words: &[&str]| {
        folder
            .run(&[&[arguments[0], "case.toml"], &arguments[1..]].concat())
            .refused(words);
    };
    refused(
        &["simulate", "--state", "1,2"],
        &["2 numbers", "6 are needed", "modal amplitudes"],
    );
    refused(
        &["simulate", "--state", "1,2,x,4,5,6"],
        &["--state `x`", "0.1,-0.02,0.3"],
    );
    refused(&["simulate", "--state", "NaN,0,0,0,0,0"], &["`NaN`"]);
    refused(&["simulate", "--periods", "0"], &["--periods 0"]);
    refused(&["simulate", "--out", "run.xlsx"], &["run.xlsx", ".csv"]);
    refused(&["simulate", "--plot", "run.gif"], &["run.gif", ".svg"]);
    refused(&["simulate", "--resolution", "0"], &["--resolution 0"]);
    refused(
        &["simulate", "--method", "rk4", "--steps", "0"],
        &["--steps 0"],
    );
    refused(
        &["simulate", "--method", "rk4", "--steps", "1,2,3"],
        &["no steps a drive period"],
    );
    refused(&["simulate", "--methd", "rk4"], &["--methd", "--method"]);
    refused(&["orbit", "--period", "0"], &["from 1 to"]);
    refused(
        &["convergence", "--largest", "1"],
        &["--largest 1", "2 to 50"],
    );
    refused(&["convergence", "--tolerance", "-1"], &["--tolerance"]);
    refused(
        &[
            "simulate",
            "--set",
            "alpha3=0",
            "--set",
            "alpha1=0",
            "--set",
            "modes=1",
            "--set",
            "omega=3.5160152685",
        ],
        &["undamped mode", "add damping"],
    );
}

/// Extreme values give a result in a short time: the smallest possible drive, whose motion is lost
/// in rounding, and a beam so damped that its fast eigenvalues coincide at −10⁹ (a bound that did
/// not decay with them took 10⁹ steps per period).
#[test]
fn extreme_cases_finish() {
    let folder = Folder::with_paper_case();
    for extreme in ["alpha2=5e-324", "alpha3=1e9"] {
        let outcome = folder.run(&[
            "simulate",
            "case.toml",
            "--set",
            extreme,
            "--periods",
            "2",
            "--transient",
            "0",
            "--json",
        ]);
        let json = outcome.json();
        assert!(json["classification"].is_string(), "{extreme}: {json}");
    }
}

#[test]
fn states_of_a_physical_case_are_in_si_too() {
    let folder = Folder::new();
    let case = &crate::util::shipped_case("stiff-lever.toml");
    let set = ["--set", "drive.setpoint=", "--set", "gap.tip=15 nm"];
    let run = |words: &[&str]| folder.run(&[words, &set].concat());
    // The units of the model: the beam's distance, and that by the unit of time.
    let si = |document: &Value, state: &Value| -> Vec<f64> {
        let physical = &document["case"]["physical"];
        let length = number(physical, "length_unit");
        let velocity = length / number(physical, "time_unit");
        let units = [length, length, velocity, velocity];
        let entries = vector(state).into_iter().zip(units);
        entries.map(|(value, unit)| unit * value).collect()
    };
    let same = |found: &Value, expected: &[f64]| {
        let found = vector(found);
        assert_eq!(found.len(), 4);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() <= 1e-14 * expected.abs());
        }
    };
    let orbit = run(&["orbit", case, "--json"]).json();
    same(&orbit["physical"]["state"], &si(&orbit, &orbit["state"]));
    let run_on = run(&["simulate", case, "--strobe", "2", "--json"]).json();
    for k in 0..2 {
        let expected = si(&run_on, &run_on["strobe"][k]);
        same(&run_on["physical"]["strobe"][k], &expected);
    }
    let census = run(&["attractors", case, "--starts", "2", "--json"]).json();
    let found = &census["attractors"][0];
    same(&found["physical"]["state"], &si(&census, &found["state"]));
    let range = [
        "--parameter",
        "gap.tip",
        "--from",
        "15 nm",
        "--to",
        "14.9 nm",
    ];
    let branch = run(&[&["branch", case, "--json"], &range[..]].concat()).json();
    let point = &branch["points"][0];
    same(&point["physical"]["state"], &si(&branch, &point["state"]));
    let text = run(&["orbit", case]).stdout;
    let row = |name: &str| {
        let is_row = |line: &&str| line.trim_start().starts_with(name);
        text.lines().find(is_row).unwrap_or_default().to_owned()
    };
    assert!(
        row("a1 ").ends_with(" nm") && row("v1 ").ends_with("m/s"),
        "{text}"
    );
    assert!(!text.contains("g0"), "{text}");
}

#[test]
fn a_state_behind_a_pole_of_the_law_is_refused() {
    let folder = Folder::new();
    folder.write(
        "case.toml",
        "[model]\nmodes = 1\n[cantilever]\nk = \"40 N/m\"\nf0 = \"100 kHz\"\nQ = 100\n\
         [tip]\nradius = \"10 nm\"\n\
         [sample]\nlaw = \"lennard-jones\"\nhamaker = \"1e-19 J\"\nrepulsion = \"1e-76 J m^6\"\n\
         [drive]\nfrequency = \"100 kHz\"\nfree_amplitude = \"2 nm\"\n[gap]\ntip = \"10 nm\"\n",
    );
    for study in ["orbit", "simulate", "lyapunov"] {
        let outcome = folder.run(&[study, "case.toml", "--state", "tip=-12 nm"]);
        outcome.refused(&["lies in the surface", "--state in front of the surface"]);
    }
}

/// Between two sticks neighbouring motions part, so that a run leaves the orbit by its rounding errors.
#[test]
fn a_run_from_a_sticking_orbit_is_no_transient() {
    let folder = Folder::new();
    folder.write("case.toml", IMPACT.replace("2.5", "2.9"));
    let run = |more: &[&str]| folder.run(&[&["simulate", "case.toml"], more].concat());
    let text = run(&["--periods", "200"]).stdout;
    assert!(text.contains("rounding errors grow") && !text.contains("the transient, not"));
    let set = ["--set", "omega=2.5", "--transient", "3", "--periods", "5"];
    let text = run(&set).stdout;
    assert!(text.contains("the transient, not"), "{text}");
}

#[test]
fn derivatives_of_an_oscillator_have_no_unit_of_a_beam() {
    let folder = Folder::new();
    folder.write("case.toml", IMPACT.replace("gap = 0", "gap = -0.2"));
    let text = folder
        .run(&["orbit", "case.toml", "--derivatives", "forcing"])
        .stdout;
    assert!(text.contains("derivatives by forcing"), "{text}");
    assert!(!text.contains("g0") && text.contains("degree"), "{text}");
}
