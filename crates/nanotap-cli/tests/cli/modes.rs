//! `nanotap modes`.

use crate::util::Folder;

fn numbers(value: &serde_json::Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|number| number.as_f64().unwrap())
        .collect()
}

#[test]
fn json_has_the_frequencies_of_the_paper_and_of_the_exact_beam() {
    let folder = Folder::with_paper_case();
    let json = folder
        .run(&["modes", "case.toml", "--json", "--set", "modes=5"])
        .json();
    for key in ["free", "contact", "exact_free", "exact_contact"] {
        let list = numbers(&json[key]);
        assert_eq!(list.len(), 5, "{key}");
        assert!(list.is_sorted(), "{key}");
    }
    // Eq. (25) of the paper at α1 = 0.1, α4 = 20; its digits are those of five modes.
    for (computed, printed) in numbers(&json["contact"])
        .into_iter()
        .zip([7.79, 20.33, 55.81])
    {
        assert!((computed - printed).abs() <= 0.005, "{computed} {printed}");
    }
    // Roots of the transcendental equation of the beam with that tip.
    let exact = [7.790952, 20.324970, 55.718523];
    for (computed, exact) in numbers(&json["exact_contact"]).into_iter().zip(exact) {
        assert!((computed - exact).abs() < 1e-6, "{computed} {exact}");
    }
}

#[test]
fn text_compares_galerkin_with_the_exact_beam() {
    let folder = Folder::with_paper_case();
    let outcome = folder.run(&["modes", "case.toml"]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (0, ""));
    for words in [
        "free flight",
        "in contact, stiffness α₄ = 20",
        "Ω exact",
        "damping ζ",
        "7.790952",
        "7.8047",
    ] {
        assert!(
            outcome.stdout.contains(words),
            "{words}:\n{}",
            outcome.stdout
        );
    }
    let overdamped = folder.run(&["modes", "case.toml", "--set", "beam_damping=100"]);
    assert!(
        overdamped.stdout.contains("overdamped"),
        "{}",
        overdamped.stdout
    );
    assert!(
        !overdamped.stdout.contains("undefined"),
        "{}",
        overdamped.stdout
    );
}

#[test]
fn shapes_are_written_and_drawn() {
    let folder = Folder::with_paper_case();
    let outcome = folder.run(&[
        "modes",
        "case.toml",
        "--out",
        "shapes.csv",
        "--plot",
        "shapes.svg",
    ]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    let csv = folder.read("shapes.csv");
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("xi,phi1,phi2,phi3"));
    let last: Vec<f64> = lines
        .next_back()
        .unwrap()
        .split(',')
        .map(|cell| cell.parse().unwrap())
        .collect();
    // φ_j(1) = 2(−1)^(j+1).
    for (value, expected) in last.into_iter().zip([1.0, 2.0, -2.0, 2.0]) {
        assert!((value - expected).abs() < 1e-12);
    }
    let svg = folder.read("shapes.svg");
    assert!(svg.starts_with("<svg") || svg.starts_with("<?xml"));
    assert!(svg.contains("mode 3"));
    assert_eq!(folder.names(), ["case.toml", "shapes.csv", "shapes.svg"]);
    folder
        .run(&["modes", "case.toml", "--plot", "shapes.jpeg"])
        .refused(&["shapes.jpeg", "use .svg, .png or .pdf"]);
    folder
        .run(&["modes", "case.toml", "--out", "shapes"])
        .refused(&["shapes: unsupported file extension", ".csv"]);
}

#[test]
fn an_oscillator_has_no_modes() {
    let folder = Folder::new();
    folder.write(
        "impact.toml",
        "[model]\nkind = \"impact\"\nstiffness = 1\ndamping = 0\nforcing = 1\nomega = 2.5\n\
         gap = 0\nrestitution = 0.8\n",
    );
    folder
        .run(&["modes", "impact.toml"])
        .refused(&["impact.toml", "needs a cantilever"]);
    folder.run(&["modes"]).refused(&["no case was given"]);
}

/// The frequencies do not depend on the distance, so that it is not solved for.
#[test]
fn a_distance_that_is_left_to_a_setpoint_is_not_in_the_document() {
    let folder = Folder::new();
    let case = &crate::util::shipped_case("stiff-lever.toml");
    let json = folder.run(&["modes", case, "--json"]).json();
    let physical = &json["case"]["physical"];
    for key in ["tip_gap", "beam_gap", "length_unit", "force_unit"] {
        assert!(physical[key].is_null(), "{key}: {}", physical[key]);
    }
    assert!(
        json["case"]["alpha5"].is_null() && json["case"]["gap"].is_null(),
        "{}",
        json["case"]
    );
    assert_eq!(json["case"]["modes"], 2);
    let given = ["--set", "gap.tip=15 nm"];
    let json = folder
        .run(&[&["modes", case, "--json"], &given[..]].concat())
        .json();
    assert_eq!(json["case"]["physical"]["tip_gap"], 15e-9);
}
