//! Terms of the instrument in force curves and in tapping curves.

use nanotap_dynamics::random::Random;

use super::{case, fitted, off, options, parameter, table, tapping};
use nanotap_case::Case;
use nanotap_case::table::Table;
use nanotap_dynamics::Control;
use nanotap_fit::fit::{FitOptions, residuals};
use nanotap_motions::approach::Way;
use nanotap_scan::force_curve::{ForceCurveOptions, ForceCurveStudy};
use nanotap_study::Study as _;

/// A soft lever over a soft sample under Hertz's law.
const LEVER: &str = "[model]\nmodes = 3\n[cantilever]\nk = \"0.5 N/m\"\nf0 = \"25 kHz\"\nQ = 10\n[tip]\n\
     radius = \"20 nm\"\n[sample]\nlaw = \"hertz\"\nmodulus = \"200 MPa\"\n[drive]\n\
     frequency = \"25 kHz\"\nfree_amplitude = \"0 nm\"\n[gap]\ntip = \"1000 nm\"\n";
const MODULUS: f64 = 200e6;
/// Compliance of the modes beyond the third, m/N: 1/k less the sum of 12/(β⁴ k) with β = 1.8751041,
/// 4.6940911 and 7.8547574. A real lever has it, the moving one of the study does not.
const OMITTED: f64 = 1.4437e-3 / 0.5;
/// Standard deviation of the deflection, nm.
const NOISE: f64 = 0.1;

/// Distance and deflection (nm) of a force curve, and its directions.
fn force_curve() -> (Vec<[f64; 2]>, Vec<Way>) {
    let options = ForceCurveOptions {
        to: Some("-200 nm".into()),
        speed: Some("2 um/s".into()),
        points: 400,
        ..ForceCurveOptions::default()
    };
    let curve = ForceCurveStudy::run(&case(LEVER, &[]), &options, &Control::default()).unwrap();
    let rows = curve.points.iter().map(|p| {
        let compliance = OMITTED * p.force;
        [
            1e9 * (p.distance - compliance),
            1e9 * (p.deflection + compliance),
        ]
    });
    (rows.collect(), curve.points.iter().map(|p| p.way).collect())
}

/// Part of the travel up to each distance.
fn elapsed(distance: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut travel = vec![0.0];
    for pair in distance.windows(2) {
        sum += (pair[1] - pair[0]).abs();
        travel.push(sum);
    }
    travel.iter().map(|of| of / sum).collect()
}

/// A term with its truth in SI, and the recorded distance and deflection (nm) with it.
struct Example {
    free: &'static [&'static str],
    truths: &'static [f64],
    /// The key that is suggested.
    suggested: &'static str,
    /// Least error of the modulus without the term, as a part of it.
    bias: f64,
}

const EXAMPLES: [Example; 7] = [
    Example {
        free: &["deflection.tilt"],
        truths: &[2e-3],
        suggested: "deflection.tilt",
        bias: 0.02,
    },
    Example {
        free: &["deflection.curvature"],
        truths: &[1e4],
        suggested: "deflection.curvature",
        bias: 0.02,
    },
    Example {
        free: &["deflection.interference"],
        truths: &[3e-9, -2e-9, 330e-9],
        suggested: "deflection.interference",
        bias: 0.5,
    },
    Example {
        free: &["deflection.drag"],
        truths: &[1e-9],
        suggested: "deflection.drag",
        bias: 0.0,
    },
    Example {
        free: &["gap.drift"],
        truths: &[20e-9],
        suggested: "gap.drift",
        bias: 0.0,
    },
    Example {
        free: &["gap.backlash"],
        truths: &[6e-9],
        suggested: "gap.backlash",
        bias: 0.0,
    },
    Example {
        free: &["deflection.scale"],
        truths: &[1.05],
        suggested: "deflection.scale",
        bias: 0.5,
    },
];

/// The curve as an instrument with a term records it.
fn recorded(example: Option<&Example>, seed: u64) -> Table {
    let (rows, ways) = force_curve();
    let (key, truths) = example.map_or(("", &[][..]), |of| (of.suggested, of.truths));
    let side = |way: &Way| if *way == Way::Approach { 1.0 } else { -1.0 };
    let mut distance: Vec<f64> = rows.iter().map(|row| row[0]).collect();
    // Distances with the term: z + shift is the true one.
    for _ in 0..20 {
        let elapsed = elapsed(&distance);
        for (k, of) in distance.iter_mut().enumerate() {
            let shift = match key {
                "deflection.drag" => 1e9 * truths[0] * side(&ways[k]),
                "gap.drift" => 1e9 * truths[0] * elapsed[k],
                "gap.backlash" if ways[k] == Way::Retract => 1e9 * truths[0],
                _ => 0.0,
            };
            *of = rows[k][0] - shift;
        }
    }
    let far = distance.iter().copied().fold(0.0, f64::max);
    let mut noise = Random::new(seed);
    let deflection = (0..rows.len()).map(|k| {
        let depth = 1e-9 * (distance[k] - far);
        let value = rows[k][1];
        let term = match key {
            "deflection.tilt" => truths[0] * depth,
            "deflection.curvature" => 0.5 * truths[0] * depth * depth,
            "deflection.interference" => {
                let angle = std::f64::consts::TAU * depth / truths[2];
                let (sine, cosine) = nanotap_arithmetic::sin_cos(angle);
                truths[0] * sine + truths[1] * cosine
            }
            "deflection.drag" => truths[0] * side(&ways[k]),
            _ => 0.0,
        };
        let scale = if key == "deflection.scale" {
            truths[0]
        } else {
            1.0
        };
        scale * value + 1e9 * term + 3.0 + NOISE * noise.normal()
    });
    let deflection = deflection.collect();
    table(
        vec![("distance (nm)", distance), ("deflection (nm)", deflection)],
        &ways,
    )
}

const FREE: [&str; 3] = ["sample.modulus", "gap.offset", "deflection.offset"];

fn start() -> Case {
    case(LEVER, &["sample.modulus=50 MPa"])
}

#[test]
fn each_term_is_found_suggested_and_needed() {
    for (seed, example) in EXAMPLES.iter().enumerate() {
        let table = recorded(Some(example), 40 + seed as u64);
        let without = fitted(&start(), &options(table.clone(), &FREE));
        let first = without.suggestions.first();
        assert_eq!(
            first.map(|s| s.key.as_str()),
            Some(example.suggested),
            "{:?}",
            without.suggestions
        );
        // The suggestion names the whole option.
        let names: Vec<String> = first.unwrap().free.clone();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        assert_eq!(&names[..3], &FREE);
        let with = fitted(&start(), &options(table, &names));
        assert!(with.fits, "{:?}", with.reason);
        assert!(with.suggestions.is_empty(), "{:?}", with.suggestions);
        for (p, truth) in with.parameters[3..].iter().zip(example.truths) {
            assert!(off(&with, &p.key, *truth) < 4.0, "{p:?} {truth}");
        }
        assert!(off(&with, "sample.modulus", MODULUS) < 4.0, "{with:?}");
        let bias = (parameter(&without, "sample.modulus").value / MODULUS - 1.0).abs();
        assert!(bias >= example.bias, "{} {bias}", example.suggested);
        assert!(without.misfit, "{}", example.suggested);
    }
}

#[test]
fn clean_curves_suggest_nothing() {
    for seed in 0..8 {
        let report = fitted(&start(), &options(recorded(None, 100 + seed), &FREE));
        assert!(
            report.suggestions.is_empty(),
            "{seed} {:?}",
            report.suggestions
        );
        assert!(off(&report, "sample.modulus", MODULUS) < 4.0);
    }
}

#[test]
fn derivatives_by_terms_are_exact() {
    let table = recorded(None, 1);
    let names = [
        "sample.modulus",
        "deflection.tilt",
        "deflection.curvature",
        "deflection.interference",
        "deflection.drag",
        "gap.drift",
        "gap.backlash",
        "deflection.scale",
    ];
    let request = FitOptions {
        rows: 40,
        ..options(table, &names)
    };
    let x = [200e6, 1e-3, 2e3, 1e-9, -2e-9, 340e-9, 1e-9, 5e-9, 3e-9, 1.1];
    let steps = [
        2e4, 1e-7, 1.0, 1e-13, 1e-13, 1e-12, 1e-13, 1e-13, 1e-13, 1e-6,
    ];
    let at = |x: &[f64]| residuals(&start(), &request, x, &Control::default()).unwrap();
    let exact = at(&x).jacobian;
    for (k, step) in steps.iter().enumerate() {
        let [low, high] = [-1.0, 1.0].map(|side| {
            let mut x = x;
            x[k] += side * step;
            at(&x).residuals
        });
        let largest = exact.column(k).amax();
        for row in 0..exact.nrows() {
            let slope = (high[row] - low[row]) / (2.0 * step);
            let wrong = (slope - exact[(row, k)]).abs();
            assert!(
                wrong < 1e-4 * largest,
                "{k} {row}: {slope} {}",
                exact[(row, k)]
            );
        }
    }
}

/// A stiff lever a little above its resonance over a spring with damping.
const TAPPING: &str = "[model]\nmodes = 2\n[cantilever]\nk = \"42 N/m\"\nf0 = \"330 kHz\"\nQ = 400\n\
     [sample]\nstiffness = \"30 N/m\"\nloss_tangent = 0.1\n[drive]\nfrequency_ratio = 1.001\n\
     free_amplitude = \"20 nm\"\n[gap]\ntip = \"15 nm\"\n";

#[test]
fn a_tilt_of_a_tapping_curve_is_found() {
    let truth = case(TAPPING, &[]);
    let rows: Vec<_> = tapping(&truth, 40.0, 8.0, 40)
        .into_iter()
        .filter(|row| row.3 == Way::Approach)
        .collect();
    let ways: Vec<Way> = rows.iter().map(|row| row.3).collect();
    let record = |tilt: f64, seed: u64| {
        let mut noise = Random::new(seed);
        let amplitude = rows
            .iter()
            .map(|row| row.1 + tilt * (row.0 - 40.0) + 0.03 * noise.normal());
        let amplitude: Vec<f64> = amplitude.collect();
        let phase = rows.iter().map(|row| row.2 + 0.15 * noise.normal());
        table(
            vec![
                ("distance (nm)", rows.iter().map(|row| row.0).collect()),
                ("amplitude (nm)", amplitude),
                ("phase (deg)", phase.collect()),
            ],
            &ways,
        )
    };
    let free = ["sample.stiffness", "sample.loss_tangent", "gap.offset"];
    let without = fitted(&truth, &options(record(0.01, 3), &free));
    let names: Vec<&str> = without.suggestions.iter().map(|s| s.key.as_str()).collect();
    assert_eq!(
        names.first(),
        Some(&"amplitude.tilt"),
        "{:?}",
        without.suggestions
    );
    let free_too = [&free[..], &["amplitude.tilt"]].concat();
    let with = fitted(&truth, &options(record(0.01, 3), &free_too));
    assert!(off(&with, "amplitude.tilt", 0.01) < 4.0, "{with:?}");
    assert!(off(&with, "sample.stiffness", 30.0) < 4.0, "{with:?}");
    assert!(with.suggestions.is_empty(), "{:?}", with.suggestions);
    let clean = fitted(&truth, &options(record(0.0, 4), &free));
    assert!(clean.suggestions.is_empty(), "{:?}", clean.suggestions);
}

#[test]
fn fixed_terms_correct_the_readings() {
    // A fit whose terms are fixed at the values that were found ends at the same modulus.
    let example = &EXAMPLES[2];
    let table = recorded(Some(example), 42);
    let names = [&FREE[..], example.free].concat();
    let free = fitted(&start(), &options(table.clone(), &names));
    let fixed = FitOptions {
        start: free.parameters[3..]
            .iter()
            .map(|p| format!("{}={} {}", p.key, p.value, p.unit))
            .collect(),
        ..options(table, &FREE)
    };
    let fixed = fitted(&start(), &fixed);
    let [a, b] = [&free, &fixed].map(|of| parameter(of, "sample.modulus").value);
    assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
}

#[test]
fn terms_without_an_effect_are_refused() {
    let text = |report: Result<_, nanotap_error::Error>| report.unwrap_err().to_string();
    let try_fit = |table: Table, name: &str| {
        let names = ["sample.modulus", name];
        nanotap_fit::fit::fit(&start(), &options(table, &names), &Control::default())
    };
    let (rows, ways) = force_curve();
    let count = ways.iter().filter(|way| **way == Way::Approach).count();
    let column = |k: usize| rows[..count].iter().map(|row| row[k]).collect();
    let one_way = table(
        vec![("distance (nm)", column(0)), ("deflection (nm)", column(1))],
        &ways[..count],
    );
    for name in ["gap.backlash", "deflection.drag"] {
        let said = text(try_fit(one_way.clone(), name));
        assert!(said.contains("approach and retract"), "{said}");
    }
    let said = text(try_fit(one_way, "deflection.slope"));
    assert!(said.contains("deflection.slope"), "{said}");
    // Short names stand for the term of the only column.
    let report = try_fit(recorded(None, 1), "baseline_tilt").unwrap();
    assert_eq!(report.parameters[1].key, "deflection.tilt");
}
