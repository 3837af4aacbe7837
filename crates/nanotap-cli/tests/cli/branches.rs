//! `nanotap branch`.

use serde_json::Value;

use crate::util::{Folder, shipped_case};

fn number(json: &Value, key: &str) -> f64 {
    json[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key} in {json}"))
}

fn of_kind(json: &Value, kind: &str) -> Vec<f64> {
    json["bifurcations"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|b| b["kind"] == kind)
        .map(|b| number(b, "parameter"))
        .collect()
}

const IMPACT: &str = "[model]\nkind = \"impact\"\nstiffness = 1\ndamping = 0\nforcing = 1\nomega = 2\n\
                      gap = 0\nrestitution = 0.8\n";

/// With short steps there are some 10⁴ points of 1.3 kB: every other one is listed, with both ends,
/// and the CSV file contains all of them.
#[test]
fn a_long_document_lists_points_evenly_and_counts_the_omitted_ones() {
    let folder = Folder::new();
    folder.write("case.toml", IMPACT);
    let arguments = [
        "branch",
        "case.toml",
        "--parameter",
        "omega",
        "--from",
        "2",
        "--to",
        "3",
        "--period",
        "1",
        "--max-step",
        "2e-4",
        "--json",
    ];
    let short = folder.run(&[&arguments[..], &["--out", "all.csv"]].concat());
    let json = short.json();
    assert!(short.stdout.len() < 1_000_000);
    let left_out = json["points_left_out"].as_u64().unwrap() as usize;
    let listed = json["points"].as_array().unwrap();
    assert!(left_out > 0 && listed.len() > 200);
    let rows = folder.read("all.csv").lines().count() - 1;
    let bifurcations = json["bifurcations"].as_array().unwrap().len();
    assert_eq!(listed.len() + left_out + bifurcations, rows);
    let all = folder
        .run(&[&arguments[..], &["--all-points"]].concat())
        .json();
    let every = all["points"].as_array().unwrap();
    assert_eq!(all["points_left_out"], 0);
    assert_eq!(every.len(), listed.len() + left_out);
    assert_eq!(
        (listed.first(), listed.last()),
        (every.first(), every.last())
    );
}

#[test]
fn the_period_1_orbit_doubles_at_the_reference_points() {
    let folder = Folder::with_paper_case();
    let arguments = [
        "branch",
        "case.toml",
        "--parameter",
        "omega",
        "--from",
        "3.2",
        "--to",
        "2.4",
        "--period",
        "1",
        "--max-step",
        "0.03",
    ];
    let json = folder
        .run(
            &[
                &arguments[..],
                &["--json", "--out", "branch.csv", "--plot", "branch.svg"],
            ]
            .concat(),
        )
        .json();
    // Reference: Ω = 2.9137224181 and 2.5050406984, to 1e-9.
    let flips = of_kind(&json, "flip");
    assert_eq!(flips.len(), 2, "{flips:?}");
    assert!((flips[0] - 2.913_722_418_1).abs() < 1e-9, "{flips:?}");
    assert!((flips[1] - 2.505_040_698_4).abs() < 1e-9, "{flips:?}");
    assert_eq!(
        json["bifurcations"][0]["state"].as_array().unwrap().len(),
        6
    );
    let points = json["points"].as_array().unwrap();
    assert_eq!(
        (
            number(&points[0], "parameter"),
            number(points.last().unwrap(), "parameter")
        ),
        (3.2, 2.4)
    );
    for p in points {
        let inside = number(p, "parameter");
        // It is unstable between the flips only.
        let unstable = inside < flips[0] && inside > flips[1];
        assert_eq!(p["stable"], !unstable, "{inside}");
        assert!(number(p, "tip_max") > number(p, "tip_min"));
    }
    let csv = folder.read("branch.csv");
    assert!(csv.starts_with("branch,kind,period,omega,stable,spectral_radius,tip_max,"));
    assert_eq!(csv.lines().count(), 1 + points.len() + 2);
    assert!(folder.read("branch.svg").contains("period doubling"));
    let text = folder.run(&arguments);
    assert!(text.stdout.contains("2.913722418"), "{}", text.stdout);
}

#[test]
fn the_doubled_branch_joins_both_flips() {
    let folder = Folder::with_paper_case();
    let json = folder
        .run(&[
            "branch",
            "case.toml",
            "--parameter",
            "omega",
            "--from",
            "3.0",
            "--to",
            "2.4",
            "--period",
            "1",
            "--switch",
            "--max-step",
            "0.05",
            "--json",
        ])
        .json();
    let branches = json["branches"].as_array().unwrap();
    assert_eq!(branches.len(), 2);
    assert_eq!(
        (
            branches[1]["period"].as_u64(),
            branches[1]["parent"].as_u64()
        ),
        (Some(2), Some(0))
    );
    // It begins at one flip of its parent and ends at the other.
    let end = branches[1]["end"].as_str().unwrap();
    assert!(
        end.contains("meets a branch of period 1 at 2.505040698"),
        "{end}"
    );
    let doubled: Vec<&Value> = json["points"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|p| p["branch"] == 1)
        .collect();
    assert!((number(doubled[0], "parameter") - 2.913_722_418_1).abs() < 0.01);
    assert!(doubled.iter().all(|p| p["period"] == 2));
}

#[test]
fn the_restitution_model_flips_at_the_reference_points() {
    let folder = Folder::new();
    folder.write("impact.toml", IMPACT);
    // Reference: gap 0, r = 0.8 flips at ω = 1.2606766 and 2.6533477.
    for (to, expected) in [("1.1", 1.260_676_6), ("3", 2.653_347_7)] {
        let json = folder
            .run(&[
                "branch",
                "impact.toml",
                "--parameter",
                "omega",
                "--from",
                "2",
                "--to",
                to,
                "--period",
                "1",
                "--json",
            ])
            .json();
        let flips = of_kind(&json, "flip");
        assert_eq!(flips.len(), 1);
        assert!((flips[0] - expected).abs() < 1e-7, "{flips:?}");
    }
}

/// COCO's hard-impact example: k = 1, c = 0.1, distance 1, r = 0.8. At ω = 1 the orbit without
/// impact has the amplitude F/(c ω) and grazes at F = 0.1; at ω = 0.8 it grazes at F = √((1 − ω²)²
/// + (c ω)²) = 0.368782.
#[test]
fn the_linear_response_grazes_a_rigid_stop() {
    let folder = Folder::new();
    for (omega, expected) in [("1", 0.1), ("0.8", 0.368_781_778_291_715_5)] {
        folder.write(
            "coco.toml",
            format!(
                "[model]\nkind = \"impact\"\nstiffness = 1\ndamping = 0.1\nforcing = 0.05\nomega = {omega}\n\
                 gap = 1\nrestitution = 0.8\n"
            ),
        );
        let json = folder
            .run(&[
                "branch",
                "coco.toml",
                "--parameter",
                "forcing",
                "--from",
                "0.05",
                "--to",
                "0.5",
                "--period",
                "1",
                "--json",
            ])
            .json();
        let grazings = of_kind(&json, "grazing");
        assert_eq!(grazings.len(), 1, "{}", json["branches"]);
        assert!((grazings[0] - expected).abs() < 1e-9, "{grazings:?}");
    }
}

#[test]
fn loci_and_diagrams_are_assembled() {
    let folder = Folder::with_paper_case();
    let json = folder
        .run(&[
            "branch",
            "case.toml",
            "--parameter",
            "omega",
            "--from",
            "3",
            "--to",
            "2.85",
            "--period",
            "1",
            "--second",
            "alpha4=19:21",
            "--json",
            "--plot",
            "loci.svg",
            "--max-step",
            "0.05",
        ])
        .json();
    let curve = &json["loci"]["curves"][0];
    assert_eq!(
        (curve["kind"].as_str(), json["loci"]["second"].as_str()),
        (Some("flip"), Some("alpha4"))
    );
    let list = |key: &str| -> Vec<f64> {
        curve[key]
            .as_array()
            .unwrap()
            .iter()
            .map(|v| v.as_f64().unwrap())
            .collect()
    };
    let second = list("second");
    assert!(second.iter().any(|a| *a <= 19.0) && second.iter().any(|a| *a >= 21.0));
    // A point of the curve is a flip of the branch at its second value.
    let (first, second) = (list("first")[0], second[0]);
    let set = format!("alpha4={second}");
    let again = folder
        .run(&[
            "branch",
            "case.toml",
            "--set",
            &set,
            "--parameter",
            "omega",
            "--from",
            "3",
            "--to",
            "2.85",
            "--period",
            "1",
            "--max-step",
            "0.05",
            "--json",
        ])
        .json();
    let flips = of_kind(&again, "flip");
    assert!(
        flips.iter().any(|f| (f - first).abs() < 1e-7),
        "{first} {flips:?}"
    );
    let diagram = folder
        .run(&[
            "branch",
            "case.toml",
            "--parameter",
            "omega",
            "--from",
            "3",
            "--to",
            "2.85",
            "--diagram",
            "--values",
            "2",
            "--starts",
            "8",
            "--switch",
            "0",
            "--json",
            "--max-step",
            "0.05",
        ])
        .json();
    // A period-1 orbit at Ω = 3; at 2.85 a period-2 orbit is stable.
    let periods: Vec<u64> = diagram["branches"]
        .as_array()
        .unwrap()
        .iter()
        .map(|b| b["period"].as_u64().unwrap())
        .collect();
    assert!(periods.contains(&1) && periods.contains(&2), "{periods:?}");
}

#[test]
fn physical_cases_take_values_with_units() {
    let folder = Folder::new();
    folder.write(
        "lever.toml",
        "[cantilever]\nk = \"2.8 N/m\"\nf0 = \"75 kHz\"\nQ = 200\n[sample]\nstiffness = \"20 N/m\"\n\
         [drive]\nfrequency = \"74 kHz\"\nfree_amplitude = \"20 nm\"\n[gap]\ntip = \"15 nm\"\nbeam = \"10 um\"\n",
    );
    let json = folder
        .run(&[
            "branch",
            "lever.toml",
            "--parameter",
            "omega",
            "--from",
            "73.5 kHz",
            "--to",
            "74.5 kHz",
            "--json",
            "--plot",
            "resonance.svg",
            "--show",
            "phase",
            "--max-step",
            "0.1",
        ])
        .json();
    let unit = &json["parameter_unit"];
    assert_eq!(unit["unit"], "Hz");
    let hertz = number(unit, "si") * number(&json["points"][0], "parameter");
    assert!((hertz - 73.5e3).abs() < 1e-6, "{hertz}");
    assert!(folder.read("resonance.svg").contains("phase"));
    folder
        .run(&[
            "branch",
            "lever.toml",
            "--parameter",
            "omega",
            "--from",
            "73.5 nm",
            "--to",
            "75 kHz",
        ])
        .refused(&["--from 73.5 nm", "a frequency"]);
}

#[test]
fn invalid_requests_are_refused() {
    let folder = Folder::with_paper_case();
    let refused = |arguments: &[&str], words: &[&str]| {
        let start = ["branch", "case.toml", "--set", "omega=3"];
        folder.run(&[&start[..], arguments].concat()).refused(words);
    };
    let over = |from, to| ["--parameter", "omega", "--from", from, "--to", to];
    refused(
        &["--parameter", "omga", "--from", "3", "--to", "2"],
        &["no parameter `omga`", "did you mean `omega`?"],
    );
    refused(&over("3", "3"), &["from 3 to 3", "two different"]);
    refused(&over("3", "nan"), &["finite"]);
    refused(&over("3", "-1"), &["omega = -1"]);
    refused(&over("x", "2"), &["--from: x", "number"]);
    refused(
        &[&over("3", "2")[..], &["--max-step", "0"]].concat(),
        &["longest step", "--max-step"],
    );
    refused(
        &[&over("3", "2")[..], &["--second", "omega=2:3"]].concat(),
        &["another than omega"],
    );
    refused(
        &[&over("3", "2")[..], &["--second", "alpha4"]].concat(),
        &["--second", "`alpha4`", "alpha4=5:40"],
    );
    refused(
        &[&over("3", "2")[..], &["--period", "0"]].concat(),
        &["--period", "from 1 to"],
    );
    refused(
        &[&over("3", "2")[..], &["--state", "1"]].concat(),
        &["1 numbers", "6 are needed"],
    );
    refused(
        &[&over("3", "2")[..], &["--diagram", "--values", "1"]].concat(),
        &["--values", "from 2 to"],
    );
    refused(&["--parameter", "omega", "--from", "3"], &["--to"]);
}

#[test]
fn the_varied_key_may_be_missing() {
    let folder = Folder::new();
    let text = std::fs::read_to_string(shipped_case("stiff-lever.toml")).unwrap();
    folder.write("case.toml", text.replace("setpoint = 0.8", ""));
    let range = [
        "--parameter",
        "gap.tip",
        "--from",
        "15 nm",
        "--to",
        "14.5 nm",
    ];
    let run = |case: &str, set: &[&str]| {
        let words = [&["branch", case, "--json"], &range[..], set].concat();
        folder.run(&words).json()
    };
    let found = run("case.toml", &[]);
    let given = run("case.toml", &["--set", "gap.tip=15 nm"]);
    assert_eq!(found["points"], given["points"]);
    // With a setpoint, from the distance that is solved for it.
    let found = run(&shipped_case("stiff-lever.toml"), &[]);
    assert_eq!(found["branches"][0]["complete"], true, "{found}");
}

#[test]
fn an_orbit_that_sticks_is_not_exchanged_for_another() {
    let folder = Folder::new();
    folder.write(
        "case.toml",
        "[model]\nkind = \"impact\"\nstiffness = 1\ndamping = 0\nforcing = 1\nomega = 2.9\n\
         gap = 0\nrestitution = 0.8\n",
    );
    let range = ["--parameter", "omega", "--from", "2.9", "--to", "2.95"];
    let outcome = folder.run(&[&["branch", "case.toml"], &range[..]].concat());
    assert_eq!(outcome.code, 1, "{}", outcome.stdout);
    assert!(
        outcome.stderr.contains("sticks to the rigid stop"),
        "{}",
        outcome.stderr
    );
}
