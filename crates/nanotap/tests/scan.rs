//! The study `scan` against an independent program, whose numbers are in `tests/scan/*.json`
//! (80-bit arithmetic; lengths nm, forces nN, energies aJ, angles degrees).

#![allow(clippy::disallowed_methods, reason = "files and folders of a test")]
#![allow(
    clippy::format_push_string,
    reason = "case files are written piece by piece"
)]

use nanotap::case::Case;
use nanotap::case::file::Source;
use nanotap::control::Control;
use nanotap::study::Study as _;
use nanotap::study::scan::{
    Cause, ImageCause, Interaction, Method, ScanOptions, ScanReport, ScanStudy,
};
use nanotap::study::setpoint::solve_setpoint;
use serde_json::{Value, json};

const REFERENCE: &str = include_str!("scan/scan_reference.json");

fn reference(name: &str) -> Value {
    let all: Value = serde_json::from_str(REFERENCE).unwrap();
    all["scans"][name].clone()
}

/// The case file of a reference scan, its scan as keys of `[scan]`.
fn case_of(reference: &Value) -> Case {
    let scan = &reference["scan"];
    let nm = |value: &Value| format!("\"{} nm\"", value.as_f64().unwrap());
    let mut text = reference["case_toml"][0].as_str().unwrap().to_owned();
    text += &format!(
        "\n[scan]\nsize = {}\nsettle = {}\nperiods = {}\npixels = 50\nsetpoint = {}\nz0 = {}\n\
         lock_in = {{ time_constant = \"{} s\", order = {} }}\n",
        nm(&scan["length"]),
        scan["settle"],
        scan["n"],
        scan["setpoint"],
        nm(&scan["z0"]),
        scan["tau"],
        scan["order"],
    );
    match scan["Ki"].as_f64() {
        Some(gain) => text += &format!("integral_gain = {gain}\n"),
        None => text += "mode = \"constant-height\"\n",
    }
    let mut features = Vec::new();
    for feature in scan["feature"].as_array().into_iter().flatten() {
        features.push(match feature[0].as_str().unwrap() {
            "step" => format!(
                "{{ step = {{ from = {}, to = {}, height = {} }} }}",
                nm(&feature[1]),
                nm(&feature[2]),
                nm(&feature[3])
            ),
            "gauss" => format!(
                "{{ gauss = {{ at = {}, width = {}, height = {} }} }}",
                nm(&feature[1]),
                nm(&feature[2]),
                nm(&feature[3])
            ),
            other => panic!("{other}"),
        });
    }
    text += &format!("surface = [{}]\n", features.join(", "));
    for segment in scan["segment"].as_array().into_iter().flatten() {
        text += &format!(
            "[[scan.material]]\nfrom = {}\nto = {}\nhamaker = \"1e-20 J\"\n",
            nm(&segment[0]),
            nm(&segment[1])
        );
    }
    let name = "reference.toml".to_owned();
    Case::parse(Some(Source { name, text }), &[]).unwrap()
}

fn run(name: &str) -> (Value, ScanReport) {
    let reference = reference(name);
    let list: Vec<usize> = reference["values"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| row["k"].as_u64().unwrap() as usize)
        .collect();
    let options = ScanOptions {
        list,
        ..ScanOptions::default()
    };
    let report = ScanStudy::run(&case_of(&reference), &options, &Control::default()).unwrap();
    (reference, report)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// Within 1e-8 of the size, or of 1 where the value is smaller.
#[track_caller]
fn near(found: f64, expected: &Value, tolerance: f64, what: &str) {
    let expected = number(expected);
    let apart = (found - expected).abs() / expected.abs().max(1.0);
    assert!(apart < tolerance, "{what}: {found} for {expected}");
}

fn compare(name: &str) {
    let (reference, report) = run(name);
    let rows = reference["values"].as_array().unwrap();
    assert_eq!(rows.len(), report.periods.len());
    for (row, found) in rows.iter().zip(&report.periods) {
        let what = |signal: &str| format!("scan {name}, period {}, {signal}", row["k"]);
        for (value, key, factor) in [
            (found.x, "x", 1e9),
            (found.surface, "h", 1e9),
            (found.z, "z", 1e9),
            (found.amplitude, "A", 1e9),
            (found.phase, "phase", 1.0),
            (found.amplitude_lockin, "A_lockin", 1e9),
            (found.phase_lockin, "phase_lockin", 1.0),
            (found.error, "error", 1e9),
            (found.peak_force, "peak_nN", 1e9),
            (found.mean_deflection, "mean_deflection", 1e9),
            (found.contact_fraction, "contact_fraction", 1.0),
        ] {
            near(value * factor, &row[key], 1e-8, &what(key));
        }
        if row.get("E_dis_aJ").is_some() {
            near(found.dissipation * 1e18, &row["E_dis_aJ"], 1e-8, &what("E"));
        }
    }
    for (line, image, key) in [
        (0, &report.trace, "trace"),
        (1, report.retrace.as_ref().unwrap(), "retrace"),
    ] {
        let (expected, line) = (&reference["lines"][key], &report.lines[line]);
        let what = |signal: &str| format!("scan {name}, {key}, {signal}");
        for (value, key) in [
            (line.height_mean, "z_mean"),
            (line.height_rms, "z_rms"),
            (line.height_max, "z_max"),
            (line.height_min, "z_min"),
            (line.error_rms, "error_rms"),
            (line.error_max, "error_max"),
            (line.error_min, "error_min"),
            (line.peak_force_max, "peak_force_max_nN"),
            (line.peak_force_mean, "peak_force_mean_nN"),
            (line.tracking_rms, "tracking_rms"),
        ] {
            near(value * 1e9, &expected[key], 1e-8, &what(key));
        }
        let at = expected["peak_force_max_at_k"].as_u64().unwrap();
        assert_eq!(line.peak_force_max_period as u64, at);
        if let Some(flights) = expected["parachuting"].as_array() {
            assert_eq!(flights.len(), line.parachuting.len(), "{}", what("flights"));
            for (flight, found) in flights.iter().zip(&line.parachuting) {
                assert_eq!(json!(found.first_period), flight["first_k"]);
                assert_eq!(json!(found.periods), flight["periods"]);
                near(found.length * 1e9, &flight["length_nm"], 1e-9, "length");
            }
        }
        let pixels = &expected["pixels"];
        for (values, key, factor) in [
            (&image.height[0], "height", 1e9),
            (&image.amplitude_error[0], "amplitude_error", 1e9),
            (&image.phase[0], "phase", 1.0),
            (&image.peak_force[0], "peak_force_mean_nN", 1e9),
            (&image.peak_force_max[0], "peak_force_max_nN", 1e9),
        ] {
            let expected = pixels[key].as_array().unwrap();
            assert_eq!(expected.len(), values.len());
            for (pixel, (value, expected)) in values.iter().zip(expected).enumerate() {
                near(
                    value * factor,
                    expected,
                    1e-8,
                    &what(&format!("{key} of pixel {pixel}")),
                );
            }
        }
    }
}

#[test]
fn a_step_on_a_linear_sample_agrees() {
    compare("a");
}

#[test]
fn a_patch_of_another_material_under_dmt_agrees() {
    compare("b");
}

#[test]
fn a_particle_at_constant_height_agrees() {
    compare("e");
}

fn parsed(text: &str, words: &[&str]) -> Case {
    let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
    let name = "scan.toml".to_owned();
    let text = text.to_owned();
    Case::parse(Some(Source { name, text }), &words).unwrap()
}

fn scan(case: &Case, options: &ScanOptions) -> Result<ScanReport, String> {
    ScanStudy::run(case, options, &Control::default()).map_err(|error| error.to_string())
}

const STEP: &str = include_str!("../../../docs/cases/scan-step.toml");
const PATCH: &str = include_str!("../../../docs/cases/scan-patch.toml");
const PARTICLE: &str = include_str!("../../../docs/cases/scan-particle.toml");

/// Slope, memory and bandwidths of the independent program (SCAN.md), to the digits given there.
#[test]
fn the_loop_at_the_setpoint_agrees() {
    let short = ["scan.periods=100", "scan.pixels=50"];
    let of = |gain: f64| {
        let report = scan(
            &parsed(
                STEP,
                &[&short[..], &[&format!("scan.integral_gain={gain}")]].concat(),
            ),
            &ScanOptions::default(),
        );
        report.unwrap().feedback.unwrap()
    };
    let slow = of(1500.0);
    assert!((slow.slope - 0.9928).abs() < 1e-4, "{}", slow.slope);
    assert!(
        (slow.lever_memory - 30.4).abs() < 0.1,
        "{}",
        slow.lever_memory
    );
    let bandwidth = slow.bandwidth_45.unwrap();
    assert!((bandwidth - 229.8).abs() < 0.2, "{bandwidth}");
    assert!((slow.rule_of_thumb - 346.0).abs() < 1.0);
    let largest = slow.largest_stable_gain.unwrap();
    assert!((largest / 2.98e4 - 1.0).abs() < 0.01, "{largest}");
    let fast = of(8000.0);
    let bandwidth = fast.bandwidth_45.unwrap();
    assert!((bandwidth / 1108.0 - 1.0).abs() < 2e-3, "{bandwidth}");
    assert!(fast.peaking < 1.01, "{}", fast.peaking);
}

/// At a constant height over a flat sample the lever comes to its orbit, whose observables are
/// computed otherwise.
#[test]
fn a_flat_sample_gives_the_orbit_of_every_law() {
    const LEVER: &str = "[cantilever]\nk = \"2 N/m\"\nf0 = \"70 kHz\"\nQ = 20\n\
        [tip]\nradius = \"10 nm\"\n[gap]\nbeam = \"10 um\"\ntip = \"17 nm\"\n\
        [drive]\nfrequency = \"70 kHz\"\nfree_amplitude = \"20 nm\"\n";
    let linear = "stiffness = \"20 N/m\"\ndamping = \"1e-6 N s/m\"\n";
    let soft = "modulus = \"50 MPa\"\npoisson = 0.3\n";
    for (law, sample) in [
        ("spring-damper", linear.to_owned()),
        ("kelvin-voigt", format!("law = \"kelvin-voigt\"\n{linear}")),
        (
            "standard-linear-solid",
            "law = \"standard-linear-solid\"\nstiffness = \"10 N/m\"\n\
             relaxation_stiffness = \"20 N/m\"\nrelaxation_time = \"1 us\"\n"
                .to_owned(),
        ),
        (
            "generalised-maxwell",
            "law = \"generalised-maxwell\"\nstiffness = \"10 N/m\"\n\
             relaxation_arms = [[\"time (us)\", \"stiffness (N/m)\"], [1, 20], [0.3, 8]]\n"
                .to_owned(),
        ),
        (
            "moving-surface",
            format!(
                "law = \"moving-surface\"\n{linear}surface_stiffness = \"5 N/m\"\n\
                 surface_damping = \"1e-6 N s/m\"\n"
            ),
        ),
        ("hertz", format!("law = \"hertz\"\n{soft}")),
        (
            "jkr",
            format!("law = \"jkr\"\n{soft}work_of_adhesion = \"0.005 J/m^2\"\n"),
        ),
    ] {
        for modes in [1, 3] {
            let text = format!("[model]\nmodes = {modes}\n{LEVER}[sample]\n{sample}");
            let case = parsed(&text, &[]);
            let simulate = nanotap::study::registry::study("simulate").unwrap();
            let request = json!({"periods": 1, "transient": 2000});
            let document = simulate.document(&case, request, &Control::default());
            let document: Value = serde_json::from_str(&document.unwrap()).unwrap();
            let motion = &document["physical"];
            let flat = json!({
                "size": "1 um", "periods": 2000, "settle": 2000, "pixels": 1, "retrace": false,
                "setpoint": 0.8, "z0": "17 nm", "mode": "constant-height", "list": [3999],
            });
            let report = scan(&case, &serde_json::from_value(flat).unwrap()).unwrap();
            let last = &report.periods[0];
            let what = format!("{law}, {modes} modes: {last:?}, {motion}");
            let agree = |found: f64, name: &str| {
                let expected = number(&motion[name]);
                let size = expected.abs().max(1e-3 * number(&motion["E_dis"]).abs());
                assert!((found - expected).abs() < 2e-6 * size, "{name}: {what}");
            };
            agree(last.amplitude, "A");
            agree(last.peak_force, "F_max");
            if number(&motion["E_dis"]).abs() > 1e-21 {
                agree(last.dissipation, "E_dis");
            }
            let contact = number(&document["contact_fraction"]);
            assert!((last.contact_fraction - contact).abs() < 1e-7, "{what}");
            let phase = number(&motion["phase"]);
            assert!((last.phase - phase).abs() < 1e-4, "{what}");
        }
    }
}

/// Without a height the scan starts in the motion in which the lever comes from far: here in attraction,
/// at the setpoint, from the first period on. In its free motion at the same height the lever would be
/// thrown into the repulsive state, which exists there, too.
#[test]
fn the_lever_starts_in_the_state_in_which_it_comes() {
    let text = "\
cantilever.lever = \"PPP-NCHR\"
cantilever.Q = 400
sample = { material = \"polystyrene\", law = \"dmt\", hamaker = \"7e-20 J\" }
drive.frequency_ratio = 1
drive.free_amplitude = \"10 nm\"
drive.setpoint = 0.9
[scan]
size = \"100 nm\"
settle = 0
periods = 2000
pixels = 10
integral_bandwidth = \"50 Hz\"
";
    let case = parsed(text, &[]);
    let solved = solve_setpoint(&case, &Control::default()).unwrap();
    let chosen = &solved.solutions[solved.chosen];
    assert!(chosen.observables.phase > 100.0);
    // The quasi-static method is linear between motions at distances of 20 pm.
    for (method, error, angle) in [
        (Method::Exact, 1e-14, 1e-3),
        (Method::QuasiStatic, 1e-12, 0.1),
    ] {
        let options = ScanOptions {
            method: Some(method),
            ..ScanOptions::default()
        };
        let report = scan(&case, &options).unwrap();
        assert!((report.z0 / solved.zc() - 1.0).abs() < 1e-12);
        let [line, ..] = &report.lines[..] else {
            panic!("no line")
        };
        assert!(line.error_rms < error, "{method:?}: {}", line.error_rms);
        for phase in &report.trace.phase[0] {
            let off = (phase - chosen.observables.phase).abs();
            assert!(off < angle, "{method:?}: {phase}");
        }
    }
    let given = parsed(text, &[&format!("scan.z0={:e} m", solved.zc())]);
    let thrown = scan(&given, &ScanOptions::default()).unwrap();
    assert!(thrown.lines[0].peak_force_max > 1e-9);
}

#[test]
fn independent_lines_are_the_same_on_any_number_of_threads() {
    let case = parsed(
        PARTICLE,
        &["scan.lines=4", "scan.periods=300", "scan.pixels=20"],
    );
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let run = || scan(&case, &ScanOptions::default()).unwrap();
        pool.build().unwrap().install(run)
    };
    let one = on(1);
    assert_eq!(one, on(3));
    assert_eq!(one.trace.height.len(), 4);
}

/// The method `fast` of earlier versions is an alias. Near the limit of stability, where an approximate
/// flow invented a change of the state (a jump of −0.2 nm), every number is that of the exact method.
#[test]
fn the_fast_method_is_the_exact_one() {
    let words = [
        "scan.settle=500",
        "scan.periods=1500",
        "scan.integral_gain=12500",
    ];
    let case = parsed(PATCH, &words);
    let exact = scan(&case, &ScanOptions::default()).unwrap();
    let fast = ScanOptions {
        method: Some(Method::Fast),
        ..ScanOptions::default()
    };
    let mut fast = scan(&case, &fast).unwrap();
    assert_eq!((fast.method, fast.exact_share), (Method::Exact, 1.0));
    fast.warnings
        .retain(|warning| !warning.contains("`fast` no longer exists"));
    assert_eq!(fast.warnings.len(), exact.warnings.len());
    assert_eq!(fast, exact);
}

#[test]
fn a_preview_is_near_where_the_scan_is_slow() {
    let case = parsed(STEP, &["scan.integral_gain=300"]);
    let exact = scan(&case, &ScanOptions::default()).unwrap();
    let preview = ScanOptions {
        method: Some(Method::QuasiStatic),
        ..ScanOptions::default()
    };
    let preview = scan(&case, &preview).unwrap();
    assert_eq!(preview.exact_share, 0.0);
    let apart = exact.lines[0].height_mean - preview.lines[0].height_mean;
    assert!(apart.abs() < 0.5e-9, "{apart}");
}

/// The lever keeps the state into which a patch of another material threw it. Distances at the
/// setpoint: SCAN.md, scan b, reads 9.22 nm before the patch and 8.92 nm behind it.
#[test]
fn a_false_step_is_called_one() {
    let report = scan(&parsed(PATCH, &[]), &ScanOptions::default()).unwrap();
    let change = &report.branch_changes[0];
    assert_eq!(report.branch_changes.len(), 1);
    assert!((150e-9..165e-9).contains(&change.x), "{change:?}");
    assert!((change.distance_from - 9.22e-9).abs() < 5e-12, "{change:?}");
    assert!((change.distance_to - 8.92e-9).abs() < 5e-12, "{change:?}");
    assert_eq!(
        change.height_change,
        change.distance_to - change.distance_from
    );
    assert_eq!(
        (change.until_k, change.until_x, change.material),
        (None, None, Some(0))
    );
    let cause = cause_of(&report, Cause::StateChange).unwrap();
    assert_eq!((cause.k, cause.x), (Some(change.k), Some(change.x)));
    assert_eq!(cause.height, Some(change.height_change));
    assert!(
        report.verdict.contains("attractive to the repulsive state"),
        "{}",
        report.verdict
    );
    assert!(
        report.verdict.contains("to the end of the scan"),
        "{}",
        report.verdict
    );
    assert!(
        report.verdict.contains("8.92 nm in the repulsive"),
        "{}",
        report.verdict
    );
    assert!(report.verdict.contains(&cause.sentence));
    let states = &report.trace.state[0];
    assert_eq!(states[2], Some(Interaction::Attractive));
    assert_eq!(states[40], Some(Interaction::Repulsive));
}

fn cause_of(report: &ScanReport, cause: Cause) -> Option<&ImageCause> {
    report.causes.iter().find(|found| found.cause == cause)
}

fn causes_of(report: &ScanReport) -> Vec<Cause> {
    let mut causes: Vec<Cause> = report.causes.iter().map(|cause| cause.cause).collect();
    causes.dedup();
    causes
}

/// A soft lever under DMT contact on a plateau of 10 nm (FINDINGS A5): behind the falling edge it flies,
/// governed by attraction, and comes back to the state in which it was. From its free motion at this height
/// it is thrown into repulsion; where it comes from far it begins in attraction, and the edge throws it.
const EDGE: &str = "[cantilever]\nk = \"0.8736193621040327 N/m\"\nf0 = \"100 kHz\"\nQ = 200\n\
    [tip]\nradius = \"5 nm\"\nmodulus = \"160 GPa\"\npoisson = 0.3\n\
    [sample]\nlaw = \"dmt\"\nmodulus = \"1 GPa\"\npoisson = 0.3\nhamaker = \"30 zJ\"\n\
    intermolecular_distance = \"169 pm\"\n\
    [drive]\nfrequency = \"100 kHz\"\nfree_amplitude = \"20 nm\"\nactuation = \"tip\"\n\
    [gap]\ntip = \"18 nm\"\n[model]\nmodes = 1\n\
    [scan]\nsize = \"500 nm\"\nsetpoint = 0.8\nz0 = \"16.18 nm\"\nintegral_gain = 785\nretrace = false\n\
    periods = 12500\npixels = 50\nsettle = 1500\n\
    surface = [{ step = { from = \"125 nm\", to = \"325 nm\", height = \"10 nm\" } }]\n";

/// The causes are those of the surface and the loop, whatever the pixels, the lines and the last digits
/// of the lock-in amplifier's output.
#[test]
fn behind_a_falling_edge_the_feedback_lags() {
    let of = |words: &[&str]| scan(&parsed(EDGE, words), &ScanOptions::default()).unwrap();
    let report = of(&[]);
    assert!(
        report.branch_changes.is_empty(),
        "{:?}",
        report.branch_changes
    );
    assert_eq!(causes_of(&report), [Cause::FeedbackLags]);
    // First the flight behind the falling edge, then the rising edge that presses.
    let [flies, presses] = &report.causes[..] else {
        panic!("{:?}", report.causes)
    };
    for (cause, from, height, words) in [
        (flies, 325e-9, 10e-9, "parachuting"),
        (presses, 125e-9, -10e-9, "presses"),
    ] {
        let (x, until) = (cause.x.unwrap(), cause.until_x.unwrap());
        assert!((from..from + 5e-9).contains(&x) && until > x, "{cause:?}");
        // The height is late by the whole step, less what the loop follows within the lever's memory.
        let share = cause.height.unwrap() / height;
        assert!((0.9..1.01).contains(&share), "{cause:?}");
        assert!(cause.sentence.contains(words), "{cause:?}");
    }
    for words in [
        &["scan.pixels=7"][..],
        &["scan.retrace=true"],
        &["scan.lines=2"],
        &["scan.lines=2", "scan.line_settle=1500"],
        &["scan.lock_in={ time_constant = \"60.0000001 us\" }"],
    ] {
        let other = of(words);
        assert_eq!(causes_of(&other), causes_of(&report), "{words:?}");
        assert!(other.branch_changes.is_empty(), "{words:?}");
        for (a, b) in other.causes.iter().zip(&report.causes) {
            let apart = |a: Option<f64>, b: Option<f64>| (a.unwrap() - b.unwrap()).abs();
            assert!(apart(a.height, b.height) < 5e-12, "{words:?}: {a:?} {b:?}");
            assert_eq!(a.x, b.x, "{words:?}");
        }
    }
}

#[test]
fn each_surface_has_its_cause() {
    let of =
        |text: &str, words: &[&str]| scan(&parsed(text, words), &ScanOptions::default()).unwrap();
    let edge = |surface: &str, more: &[&str]| {
        let surface = format!("scan.surface=[{surface}]");
        of(EDGE, &[&[surface.as_str()], more].concat())
    };
    // A rising edge only: the tip presses, and comes back to its state.
    let rising = edge(
        "{ step = { from = \"250 nm\", to = \"1 um\", height = \"10 nm\" } }",
        &[],
    );
    assert_eq!(causes_of(&rising), [Cause::FeedbackLags]);
    assert!(
        rising.causes.len() == 1 && rising.verdict.contains("presses"),
        "{}",
        rising.verdict
    );
    assert!(rising.branch_changes.is_empty());
    // A steep ramp lags by speed over loop rate, and flies where it ends; a gentle one is followed.
    let ramp = |height: &str, from: &str| {
        format!("{{ ramp = {{ from = \"{from}\", to = \"400 nm\", height = \"{height}\" }} }}")
    };
    let steep = edge(&ramp("150 nm", "100 nm"), &[]);
    assert_eq!(causes_of(&steep), [Cause::FeedbackLags]);
    assert!(steep.branch_changes.is_empty());
    let gentle = edge(&ramp("-10 nm", "0 nm"), &["scan.size=\"390 nm\""]);
    assert!(gentle.causes.is_empty(), "{}", gentle.verdict);
    // A sine: fast, the tip presses and flies in turn; slow, it is followed; fast and so low that the
    // amplitude stays near the setpoint, the height does not follow all the same.
    let sine = |height: &str, period: &str| {
        format!("{{ sine = {{ height = \"{height}\", period = \"{period}\" }} }}")
    };
    let fast = edge(&sine("5 nm", "10 nm"), &[]);
    assert_eq!(causes_of(&fast), [Cause::FeedbackLags]);
    // The tip flies from crest to crest: above the troughs the height is that of the crests.
    let flight = &fast.causes[0];
    assert!(
        (flight.height.unwrap() / 10e-9 - 1.0).abs() < 0.05,
        "{}",
        fast.verdict
    );
    assert!(flight.sentence.contains("parachuting"));
    assert!(fast.branch_changes.is_empty());
    let low = edge(&sine("0.5 nm", "10 nm"), &[]);
    assert_eq!(causes_of(&low), [Cause::FeedbackLags], "{}", low.verdict);
    assert!(
        low.verdict.contains("the surface itself varies by 354 pm"),
        "{}",
        low.verdict
    );
    let slow = edge(&sine("1 nm", "250 nm"), &[]);
    assert!(slow.causes.is_empty(), "{}", slow.verdict);
    assert!(
        slow.verdict
            .starts_with("The height follows the surface to ")
    );
    // A loop that oscillates: its errors are no lag, and no change of the state is claimed.
    let rings = of(STEP, &["scan.integral_gain=40000"]);
    assert_eq!(causes_of(&rings), [Cause::LoopRings]);
    assert!(rings.branch_changes.is_empty());
    let ring = &rings.causes[0];
    assert!(ring.multiplier.unwrap() > 1.0, "{ring:?}");
    // SCAN.md: the small-signal limit of this loop is 2.98e4 1/s.
    assert!(
        ring.sentence
            .contains("the largest stable integral gain is 29800 1/s"),
        "{ring:?}"
    );
    // SCAN.md: on a flat sample this loop hunts at 2.5e4 1/s. Nothing moves, so nothing lags.
    let hunts = of(STEP, &["scan.integral_gain=25000", "scan.surface=[]"]);
    assert_eq!(causes_of(&hunts), [Cause::LoopRings], "{}", hunts.verdict);
    assert!(hunts.causes[0].multiplier.unwrap() < 1.0);
    let over = of(STEP, &["scan.integral_gain=25000"]);
    assert_eq!(
        causes_of(&over),
        [Cause::LoopRings, Cause::FeedbackLags],
        "{}",
        over.verdict
    );
    // Low Q in liquid: the edge lags, the flat surface behind it is followed.
    let liquid = edge(
        "{ step = { from = \"250 nm\", to = \"1 um\", height = \"10 nm\" } }",
        &["cantilever.Q=2", "scan.settle=400"],
    );
    assert!(
        liquid.branch_changes.is_empty(),
        "{:?}",
        liquid.branch_changes
    );
    assert_eq!(
        causes_of(&liquid),
        [Cause::FeedbackLags],
        "{}",
        liquid.verdict
    );
}

/// A base that attracts the tip so strongly that only the attractive state has the setpoint amplitude,
/// and a patch above which only the repulsive one has it: the state ends with the patch.
#[test]
fn a_state_that_ends_says_where() {
    let words = [
        "scan.setpoint=0.95",
        "scan.z0=",
        "scan.retrace=false",
        "sample.hamaker=3e-19 J",
    ];
    let report = scan(&parsed(PATCH, &words), &ScanOptions::default()).unwrap();
    let [there, back] = &report.branch_changes[..] else {
        panic!("{:?}", report.branch_changes)
    };
    assert_eq!((there.until_k, there.until_x), (Some(back.k), Some(back.x)));
    assert_eq!((there.to, there.material), (Interaction::Repulsive, None));
    assert_eq!((back.to, back.until_k), (Interaction::Attractive, None));
    // The patch ends at 300.03 nm.
    assert!((back.x - 300e-9).abs() < 1e-10, "{back:?}");
    assert!((there.height_change + back.height_change).abs() < 1e-15);
    let cause = cause_of(&report, Cause::StateChange).unwrap();
    assert_eq!((cause.k, cause.until_x), (Some(there.k), Some(back.x)));
    let said = &cause.sentence;
    assert!(
        said.contains("until x = 300 nm") && said.contains("each above its own sample"),
        "{said}"
    );
}

#[test]
fn a_loop_that_oscillates_or_leaves_its_range_says_so() {
    let warned = |words: &[&str], text: &str| {
        let report = scan(&parsed(STEP, words), &ScanOptions::default()).unwrap();
        let said = report
            .warnings
            .iter()
            .any(|w| w.contains(text) && w.contains("the largest stable integral gain is"));
        assert!(said, "{:?}", report.warnings);
    };
    warned(&["scan.integral_gain=40000"], "oscillates at the setpoint");
    warned(
        &["scan.z_range=[\"15 nm\", \"20 nm\"]"],
        "at an end of its range",
    );
}

#[test]
fn wrong_scans_are_refused() {
    for (words, text) in [
        (&["scan.size=3 s"][..], "size"),
        (&["scan.siz=3"], "siz"),
        (&["scan.size=0"], "not positive"),
        (&["scan.size=nan"], "size"),
        (&["scan.setpoint=1.5"], "between 0 and 1"),
        (&["scan.periods="], "line_rate"),
        (&["scan.line_rate=1 Hz"], "say the same"),
        (&["scan.periods=1000000000"], "out of range"),
        (&["scan.lines=60000", "scan.pixels=60000"], "too many"),
        (&["scan.list=[100000]"], "numbered from 0"),
        (&["scan.profile=x.csv"], "cannot name other files"),
        (&["scan.profile=[0, 1e-9, nan]"], "scan"),
        (&["scan.integral_gain="], "integral_gain"),
        (&["scan.z_range=[2e-8, 1e-8]"], "empty"),
        (&["scan.dynamic_gain=2"], "go together"),
        (&["scan.lock_in.order=9"], "out of range"),
        (&["scan.dilate=1e-8"], "sampled"),
        (
            &["scan.material=[{ from = 0, to = 1e-7, hamakr = \"1e-20 J\" }]"],
            "hamakr",
        ),
    ] {
        let error = scan(&parsed(STEP, words), &ScanOptions::default());
        let error = error.map(|report| report.verdict).unwrap_err();
        assert!(error.contains(text), "{words:?}: {error}");
    }
}

#[test]
fn cancelled_work_ends_at_once() {
    use nanotap::control::CancelFlag;
    let flag = CancelFlag::new();
    let stop = |_: usize, _: usize| flag.cancel();
    let control = Control {
        cancel: Some(&flag),
        progress: Some(&stop),
    };
    let case = parsed(STEP, &["scan.periods=5000000"]);
    let error = ScanStudy::run(&case, &ScanOptions::default(), &control).unwrap_err();
    assert_eq!(error.kind, nanotap::ErrorKind::Stopped);
}

/// Lines that are finished stay when the work is stopped; the others are missing, and a warning counts them.
#[test]
fn stopped_work_keeps_its_lines() {
    use nanotap::control::CancelFlag;
    for independent in [false, true] {
        let flag = CancelFlag::new();
        // The count rises every 256 periods; the scan has 10 lines of 5000.
        let stop = |done: usize, _: usize| {
            if done > 20_000 {
                flag.cancel();
            }
        };
        let control = Control {
            cancel: Some(&flag),
            progress: Some(&stop),
        };
        let mut words = vec!["scan.lines=10", "scan.periods=2500", "scan.pixels=50"];
        if independent {
            words.push("scan.line_settle=1000");
        }
        let case = parsed(STEP, &words);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2);
        let run = || ScanStudy::run(&case, &ScanOptions::default(), &control).unwrap();
        let report = pool.build().unwrap().install(run);
        let whole = scan(&case, &ScanOptions::default()).unwrap();
        assert_eq!(report.trace.height.len(), 10);
        let scanned: Vec<usize> = report.lines.iter().step_by(2).map(|l| l.line).collect();
        assert!((1..10).contains(&scanned.len()), "{scanned:?}");
        for line in 0..10 {
            let row = &report.trace.height[line];
            if scanned.contains(&line) {
                assert_eq!(row, &whole.trace.height[line]);
            } else {
                assert!(row.iter().all(|z| z.is_nan()));
            }
        }
        let said = format!("{} of 10 lines are scanned", scanned.len());
        assert_eq!(report.warnings[0], said);
    }
}

/// A dataset of lines holds the whole report, whether it was computed at once, in shares that are
/// merged, or stopped and continued.
#[test]
fn a_dataset_of_lines_is_the_scan() {
    use nanotap::dataset::{Share, Store, Work, finish, merge};
    use nanotap::study::DatasetStudy as _;
    use nanotap::study::scan::ScanLines;
    let case = parsed(
        PATCH,
        &[
            "scan.lines=8",
            "scan.periods=1200",
            "scan.pixels=20",
            "scan.line_settle=200",
            "scan.surface=[{ step = { from = \"460 nm\", to = \"490 nm\", height = \"4 nm\" } }]",
        ],
    );
    let options = ScanOptions::default();
    let direct = scan(&case, &options).unwrap();
    assert!(direct.lines.iter().all(|line| line.parachuting.len() <= 8));
    assert!(!direct.branch_changes.is_empty());
    assert!(
        direct
            .lines
            .iter()
            .any(|line| !line.off_setpoint.is_empty())
    );
    let folder = std::env::temp_dir().join(format!("nanotap-scan-{}", std::process::id()));
    let plan = ScanLines::plan(&case, &options, &Control::default()).unwrap();
    let shares: Vec<std::path::PathBuf> = ["1/2", "2/2"]
        .iter()
        .map(|share| {
            let path = folder.join(share.replace('/', "-"));
            let store = Store::create_or_resume(&path, plan.schema().clone()).unwrap();
            let work = Work {
                share: share.parse().unwrap(),
                threads: 2,
                control: Control::default(),
            };
            plan.compute(&store, &work).unwrap();
            assert_eq!(store.missing(), 4);
            path
        })
        .collect();
    let merged = folder.join("merged");
    merge(&shares, &merged).unwrap();
    // One that holds a share goes on with the rest.
    let store = Store::create_or_resume(&shares[0], plan.schema().clone()).unwrap();
    let all = Work {
        share: Share::WHOLE,
        threads: 1,
        control: Control::default(),
    };
    plan.compute(&store, &all).unwrap();
    for store in [finish(store).unwrap(), Store::open(&merged).unwrap()] {
        let report = ScanLines::report(&store).unwrap();
        assert_eq!(report.lines, direct.lines);
        assert_eq!(report.feedback, direct.feedback);
        assert_eq!(report.causes, direct.causes);
        let [found, expected] = [&report, &direct].map(|r| serde_json::to_string(r).unwrap());
        assert!(found == expected);
    }
    // Lines that follow on each other are no dataset.
    let error = ScanLines::plan(&parsed(STEP, &[]), &options, &Control::default()).unwrap_err();
    assert!(error.to_string().contains("line_settle"), "{error}");
    std::fs::remove_dir_all(folder).unwrap();
}
