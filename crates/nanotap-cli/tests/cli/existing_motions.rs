//! `nanotap attractors` and `lyapunov`.

use crate::util::Folder;

fn number(json: &serde_json::Value, key: &str) -> f64 {
    json[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key} in {json}"))
}

#[test]
fn all_coexisting_motions_are_found() {
    let folder = Folder::with_paper_case();
    let arguments = [
        "attractors",
        "case.toml",
        "--set",
        "omega=20",
        "--set",
        "alpha1=0",
        "--starts",
        "96",
    ];
    let json = folder.run(&[&arguments[..], &["--json"]].concat()).json();
    let list = json["attractors"].as_array().unwrap();
    let periods: Vec<u64> = list.iter().map(|a| a["period"].as_u64().unwrap()).collect();
    // Reference: at Ω = 20, α1 = 0 a period-1 (W up to 0.7357) and a period-4 (W up to 3.0047).
    // Plain runs of 3000 periods from 1000 starts in this box: 67 % go to the period-4 orbit.
    assert_eq!(periods, [4, 1]);
    assert!((number(&list[0], "tip_max") - 3.0047).abs() < 5e-5);
    assert!((number(&list[1], "tip_max") - 0.7357).abs() < 5e-5);
    let total: f64 = list.iter().map(|a| number(a, "fraction")).sum();
    assert!((total - 1.0).abs() < 1e-12, "{total}");
    for attractor in list {
        assert_eq!(attractor["classification"], "periodic");
        assert_eq!(attractor["stable"], true);
        // The exponents of an orbit are those of its multipliers.
        let mu = attractor["multipliers"][0].as_array().unwrap();
        let modulus = mu[0].as_f64().unwrap().hypot(mu[1].as_f64().unwrap());
        let exponent = attractor["lyapunov"][0].as_f64().unwrap();
        assert!((exponent - modulus.ln() / number(attractor, "period")).abs() < 1e-12);
        let interval = attractor["fraction_interval"].as_array().unwrap();
        assert!(interval[0].as_f64().unwrap() <= number(attractor, "fraction"));
    }
    assert_eq!(json["undecided"].as_array().unwrap().len(), 0);
    assert_eq!(json["box"].as_array().unwrap().len(), 6);
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let folder = Folder::with_paper_case();
    let run = |threads: &str| {
        let arguments = [
            "attractors",
            "case.toml",
            "--set",
            "omega=20",
            "--set",
            "alpha1=0",
            "--starts",
            "48",
            "--json",
            "--threads",
            threads,
        ];
        folder.run(&arguments).stdout
    };
    let one = run("1");
    assert!(one.contains("\"attractors\""));
    assert_eq!(one, run("3"));
}

#[test]
fn chaos_is_reported_with_evidence_and_unstable_orbits() {
    let folder = Folder::with_paper_case();
    let outcome = folder.run(&[
        "attractors",
        "case.toml",
        "--starts",
        "16",
        "--unstable",
        "1",
        "--json",
        "--plot",
        "all.svg",
        "--out",
        "all.csv",
    ]);
    let json = outcome.json();
    let list = json["attractors"].as_array().unwrap();
    assert_eq!(list.len(), 1);
    assert_eq!(list[0]["classification"], "chaotic");
    assert!(list[0]["period"].is_null());
    assert!(
        list[0]["evidence"]
            .as_str()
            .unwrap()
            .contains("none of 16 starts escaped")
    );
    // Reference: about 0.253 ± 0.01 per period at Ω = 2.6.
    let largest = list[0]["lyapunov"][0].as_f64().unwrap();
    let error = list[0]["lyapunov_errors"][0].as_f64().unwrap();
    assert!(
        (largest - 0.253).abs() < 0.01 + 3.0 * error,
        "{largest} {error}"
    );
    let unstable = json["unstable"].as_array().unwrap();
    assert_eq!(unstable.len(), 1);
    assert!((unstable[0]["multipliers"][0][0].as_f64().unwrap() + 1.392).abs() < 1e-3);
    assert!(folder.read("all.svg").contains("chaotic"));
    assert!(
        folder
            .read("all.csv")
            .starts_with("attractor,classification,period,fraction,point,a1,")
    );
    let text = folder.run(&["attractors", "case.toml", "--starts", "8"]);
    assert!(
        text.stdout.contains("chaotic") && text.stdout.contains("95 %"),
        "{}",
        text.stdout
    );
}

/// A motion of nanometres with a beam at ten micrometres: the results do not depend on the size.
#[test]
fn small_motions_are_distinguished_like_large_ones() {
    let folder = Folder::with_paper_case();
    let census = |alpha2: &str| {
        let arguments = [
            "attractors",
            "case.toml",
            "--set",
            "omega=20",
            "--set",
            "alpha1=0",
            "--starts",
            "48",
            "--json",
            "--set",
            alpha2,
        ];
        folder.run(&arguments).json()
    };
    // With α5 = 0 the model is homogeneous of degree one.
    let (large, small) = (census("alpha2=0.1"), census("alpha2=1e-7"));
    let of = |json: &serde_json::Value, key: &str| -> Vec<f64> {
        json["attractors"]
            .as_array()
            .unwrap()
            .iter()
            .map(|a| number(a, key))
            .collect()
    };
    assert_eq!(of(&large, "period"), of(&small, "period"));
    assert_eq!(of(&large, "count"), of(&small, "count"));
    for (a, b) in of(&large, "tip_max").iter().zip(of(&small, "tip_max")) {
        assert!((b / a / 1e-6 - 1.0).abs() < 1e-9, "{a} {b}");
    }
}

#[test]
fn an_oscillator_with_a_rigid_stop_is_counted_too() {
    let folder = Folder::new();
    folder.write(
        "impact.toml",
        "[model]\nkind = \"impact\"\nstiffness = 1\ndamping = 0\nforcing = 1\nomega = 2\ngap = 0\nrestitution = 0.8\n",
    );
    let json = folder
        .run(&["attractors", "impact.toml", "--starts", "32", "--json"])
        .json();
    let list = json["attractors"].as_array().unwrap();
    // Between its flips at 1.2606766 and 2.6533477 the one-impact orbit is stable.
    let orbit = list
        .iter()
        .find(|a| a["period"] == 1)
        .expect("a period-1 attractor");
    assert_eq!(number(orbit, "contacts_per_period"), 1.0);
    let side = &json["box"][0];
    assert!(
        side["coordinate"] == "x" && number(side, "upper") <= 0.0,
        "{side}"
    );
}

#[test]
fn the_spectrum_is_correct_and_sums_to_the_trace() {
    let folder = Folder::with_paper_case();
    let outcome = folder.run(&[
        "lyapunov",
        "case.toml",
        "--periods",
        "8000",
        "--json",
        "--out",
        "section.csv",
        "--plot",
        "section.svg",
        "--points",
        "300",
    ]);
    let json = outcome.json();
    let list = |key: &str| -> Vec<f64> {
        json[key]
            .as_array()
            .unwrap()
            .iter()
            .map(|v| v.as_f64().unwrap())
            .collect()
    };
    let expected = [0.253, -0.172, -0.175, -0.243, -0.251, -0.722];
    for ((value, error), expected) in list("exponents").iter().zip(list("errors")).zip(expected) {
        assert!(
            (value - expected).abs() < 0.01 + 2.0 * error,
            "{value} {expected}"
        );
    }
    // The trace is computed along a different trajectory of the same chaos.
    assert!((number(&json, "sum") - number(&json, "sum_by_trace")).abs() < 0.01);
    assert_eq!(json["classification"], "chaotic");
    let section = folder.read("section.csv");
    assert!(section.starts_with("phase_degrees,tip,tip_rate,gap_rate,a1,a2,a3,v1,v2,v3\n0,"));
    assert_eq!(section.lines().count(), 301);
    assert!(folder.read("section.svg").contains("exponent"));
    // Every point at which a contact begins lies on the surface, closing.
    let outcome = folder.run(&[
        "lyapunov",
        "case.toml",
        "--periods",
        "100",
        "--section",
        "contact",
        "--points",
        "50",
        "--out",
        "c.csv",
    ]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    for line in folder.read("c.csv").lines().skip(1) {
        let row: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        assert!(row[3] < 0.0);
        assert!(
            (row[1] + 0.1 * row[0].to_radians().sin()).abs() < 1e-12,
            "{row:?}"
        );
    }
}

#[test]
fn invalid_requests_are_refused() {
    let folder = Folder::with_paper_case();
    let refused = |arguments: &[&str], words: &[&str]| {
        folder
            .run(&[&[arguments[0], "case.toml"], &arguments[1..]].concat())
            .refused(words);
    };
    refused(
        &["attractors", "--starts", "0"],
        &["--starts 0", "from 1 to"],
    );
    refused(
        &["attractors", "--box", "a7=-1:1"],
        &["`a7`", "a1, a2, a3, v1, v2, v3"],
    );
    refused(&["attractors", "--box", "a1=1:-1"], &["upwards"]);
    refused(&["attractors", "--box", "a1"], &["a1=-1:1"]);
    refused(&["attractors", "--threads", "0"], &["--threads 0"]);
    refused(&["attractors", "--out", "all.json"], &["all.json", ".csv"]);
    refused(&["attractors", "--max-period", "0"], &["--max-period 0"]);
    refused(&["lyapunov", "--periods", "0"], &["--periods 0"]);
    refused(&["lyapunov", "--phase", "inf"], &["--phase"]);
    refused(
        &["lyapunov", "--state", "1"],
        &["1 numbers", "6 are needed"],
    );
}

/// Unstable orbits of a physical case are reported in SI too, with all observables.
#[test]
fn unstable_orbits_are_reported_in_si() {
    let folder = Folder::new();
    let soft = include_str!("../../../../docs/cases/soft-sample.toml");
    folder.write("soft.toml", soft);
    let arguments = [
        "attractors",
        "soft.toml",
        "--starts",
        "8",
        "--unstable",
        "1",
        "--json",
    ];
    let json = folder.run(&arguments).json();
    let orbit = &json["unstable"][0];
    assert_eq!(orbit["stable"], false);
    let physical = &orbit["physical"];
    let attracting = &json["attractors"][0]["physical"];
    for name in attracting.as_object().unwrap().keys() {
        assert!(!physical[name].is_null(), "{name}");
    }
    let alone = ["orbit", "soft.toml", "--period", "1", "--json", "--state"];
    let state = orbit["state"].as_array().unwrap().iter();
    let state: Vec<String> = state.map(ToString::to_string).collect();
    let alone = folder
        .run(&[&alone[..], &[&format!("model_units={}", state.join(","))]].concat())
        .json();
    assert_eq!(
        alone["physical"]["harmonics"][0]["frequency"],
        physical["harmonics"][0]["frequency"]
    );
    assert_eq!(alone["stable"], false);
}

/// Two tones with frequencies 1 and 25/4 mix in a contact: f1 + f2 is shown, although it is far
/// above the first orders, which are quarters.
#[test]
fn the_sidebands_of_two_tones_are_shown() {
    let folder = Folder::new();
    let case = include_str!("../../../../docs/cases/dforce-dmt.toml");
    folder.write("lever.toml", case);
    let second = [
        "drive.second_ratio=25/4",
        "drive.second_free_amplitude=1 nm",
    ];
    let mut arguments = vec!["orbit", "lever.toml", "--set", "modes=2"];
    arguments.extend(second.iter().flat_map(|word| ["--set", word]));
    let outcome = folder.run(&arguments);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    for (product, order) in [("f1", "1"), ("f2", "6.25"), ("f1 + f2", "7.25")] {
        let listed = outcome.stdout.lines().any(|line| {
            line.trim_start()
                .strip_prefix(product)
                .is_some_and(|rest| rest.split_whitespace().next() == Some(order))
        });
        assert!(listed, "{product}: {}", outcome.stdout);
    }
}
