//! The study `force-curve` against an independent integrator, written here: the modes of a uniform
//! cantilever as oscillators, forces from their closed forms, the Runge–Kutta method of fourth order
//! with fixed steps that end where the law changes.

#![allow(
    clippy::disallowed_methods,
    reason = "a test compares numbers, not their last bits"
)]

use std::f64::consts::{PI, TAU};

use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::study::Study as _;
use nanotap::study::approach::Way;
use nanotap::study::force_curve::{
    ContactModel, ForceCurveOptions, ForceCurveReport, ForceCurveStudy,
};
use nanotap::study::orbit::{OrbitOptions, OrbitStudy};
use serde_json::{Value, json};

const K: f64 = 2.0;
const F0: f64 = 70e3;
const Q: f64 = 20.0;
const RADIUS: f64 = 10e-9;
const MODULUS: f64 = 1e9;
const POISSON: f64 = 0.3;
const CONTACT: f64 = 0.165e-9;
const HAMAKER: f64 = 1e-19;
const WORK: f64 = 0.05;

/// Zeros of 1 + cos β cosh β.
const BETA: [f64; 3] = [
    1.875_104_068_711_961,
    4.694_091_132_974_174,
    7.854_757_438_237_613,
];

fn reduced() -> f64 {
    MODULUS / (1.0 - POISSON * POISSON)
}

fn words(law: &str, modes: usize) -> Vec<String> {
    let mut words: Vec<String> = [
        "cantilever.k=2 N/m",
        "cantilever.f0=70 kHz",
        "cantilever.Q=20",
        "tip.radius=10 nm",
        "drive.frequency=70 kHz",
        "drive.free_amplitude=0 nm",
        "gap.tip=8 nm",
    ]
    .map(str::to_owned)
    .to_vec();
    words.push(format!("modes={modes}"));
    let sample: &[&str] = match law {
        "dmt" => &["sample.modulus=1 GPa", "sample.hamaker=1e-19 J"],
        "jkr" => &["sample.modulus=1 GPa", "sample.work_of_adhesion=50 mJ/m^2"],
        "hertz" => &["sample.modulus=1 GPa"],
        "hertz + capillary" => &[
            "sample.modulus=1 GPa",
            "sample.film_thickness=0.3 nm",
            "sample.surface_energy=70 mJ/m^2",
        ],
        _ => &["sample.stiffness=8 N/m", "sample.damping=2e-7 N s/m"],
    };
    if law != "linear" {
        words.push(format!("sample.law={law}"));
    }
    words.extend(sample.iter().map(|word| (*word).to_owned()));
    words
}

fn curve_of(words: &[String], options: Value) -> ForceCurveReport {
    let case = Case::parse(None, words).unwrap();
    let options: ForceCurveOptions = serde_json::from_value(options).unwrap();
    ForceCurveStudy::run(&case, &options, &Control::default()).unwrap()
}

fn curve(law: &str, modes: usize, options: Value) -> ForceCurveReport {
    curve_of(&words(law, modes), options)
}

/// A force law in its closed form: the force on a branch, and the separation at which it is left.
struct Law {
    force: fn(branch: usize, gap: f64, rate: f64) -> f64,
    /// What changes its sign where branch 0 is left, and branch 1.
    ends: fn(branch: usize, gap: f64, rate: f64) -> f64,
}

fn hertz(indentation: f64) -> f64 {
    4.0 / 3.0 * reduced() * RADIUS.sqrt() * indentation.max(0.0).powf(1.5)
}

const DMT: Law = Law {
    force: |branch, gap, _| match branch {
        0 => -HAMAKER * RADIUS / (6.0 * gap * gap),
        _ => hertz(CONTACT - gap) - HAMAKER * RADIUS / (6.0 * CONTACT * CONTACT),
    },
    ends: |branch, gap, _| {
        if branch == 0 {
            gap - CONTACT
        } else {
            CONTACT - gap
        }
    },
};

/// The contact radius by bisection on the stable part, above that at which the neck breaks.
fn jkr_radius(indentation: f64) -> f64 {
    let depth = |a: f64| a * a / RADIUS - (TAU * WORK * a / reduced()).sqrt();
    let (mut low, mut high) = (
        (PI * WORK * RADIUS * RADIUS / (8.0 * reduced())).cbrt(),
        RADIUS,
    );
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if depth(middle) < indentation {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

const JKR: Law = Law {
    force: |branch, gap, _| {
        if branch == 0 {
            return 0.0;
        }
        let a = jkr_radius(CONTACT - gap);
        4.0 * reduced() * a.powi(3) / (3.0 * RADIUS)
            - (8.0 * PI * WORK * reduced() * a.powi(3)).sqrt()
    },
    ends: |branch, gap, _| {
        let least = (PI * WORK * RADIUS * RADIUS / (8.0 * reduced())).cbrt();
        let breaks = CONTACT + 3.0 * least * least / RADIUS;
        if branch == 0 {
            gap - CONTACT
        } else {
            breaks - gap
        }
    },
};

const LINEAR: Law = Law {
    force: |branch, gap, rate| {
        if branch == 0 {
            return 0.0;
        }
        -8.0 * gap - 2e-7 * rate
    },
    ends: |branch, gap, _| if branch == 0 { gap } else { -gap },
};

/// The lever as oscillators whose deflections at the tip add up.
struct Lever {
    modes: usize,
    law: Law,
    /// Distance and its rate at a time.
    path: Box<dyn Fn(f64) -> [f64; 2]>,
    /// Times at which the rate of the distance jumps.
    corner: f64,
}

impl Lever {
    fn rates(&self, time: f64, branch: usize, state: &[f64]) -> Vec<f64> {
        let n = self.modes;
        let [z, speed] = (self.path)(time);
        let gap = z + state[..n].iter().sum::<f64>();
        let rate = speed + state[n..].iter().sum::<f64>();
        let force = (self.law.force)(branch, gap, rate);
        // Modal mass at the tip: a quarter of the beam's, from k = 3 EI/L³.
        let omega = TAU * F0;
        let mass = BETA[0].powi(4) * (K / 3.0) / (omega * omega) / 4.0;
        let mut out = state[n..].to_vec();
        for (i, beta) in BETA.iter().enumerate().take(n) {
            let own = omega * (beta / BETA[0]).powi(2);
            out.push(force / mass - omega / Q * state[n + i] - own * own * state[i]);
        }
        out
    }

    fn step(&self, time: f64, branch: usize, state: &[f64], h: f64) -> Vec<f64> {
        let along = |slope: &[f64], h: f64| -> Vec<f64> {
            state.iter().zip(slope).map(|(x, k)| x + h * k).collect()
        };
        let a = self.rates(time, branch, state);
        let b = self.rates(time + 0.5 * h, branch, &along(&a, 0.5 * h));
        let c = self.rates(time + 0.5 * h, branch, &along(&b, 0.5 * h));
        let d = self.rates(time + h, branch, &along(&c, h));
        (0..state.len())
            .map(|i| state[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
            .collect()
    }

    fn guard(&self, time: f64, branch: usize, state: &[f64]) -> f64 {
        let n = self.modes;
        let [z, speed] = (self.path)(time);
        let gap = z + state[..n].iter().sum::<f64>();
        let rate = speed + state[n..].iter().sum::<f64>();
        (self.law.ends)(branch, gap, rate)
    }

    /// Deflections at the times, from rest without a force.
    fn run(&self, times: &[f64], h: f64) -> Vec<f64> {
        let n = self.modes;
        let (mut time, mut branch) = (0.0, 0);
        let mut state = self.rest();
        let mut deflections = Vec::new();
        for &end in times {
            while time < end {
                let mut length = h.min(end - time);
                if time < self.corner && self.corner < time + length {
                    length = self.corner - time;
                }
                let mut next = self.step(time, branch, &state, length);
                let ends = self.guard(time + length, branch, &next) < 0.0;
                if ends {
                    let (mut low, mut high) = (0.0, length);
                    for _ in 0..80 {
                        let middle = 0.5 * (low + high);
                        let there = self.step(time, branch, &state, middle);
                        if self.guard(time + middle, branch, &there) < 0.0 {
                            high = middle;
                        } else {
                            low = middle;
                        }
                    }
                    length = high;
                    next = self.step(time, branch, &state, length);
                }
                // Ends are met to the bit.
                time = if end - time <= length {
                    end
                } else {
                    time + length
                };
                state = next;
                if ends {
                    branch = 1 - branch;
                }
            }
            deflections.push(state[..n].iter().sum());
        }
        deflections
    }

    /// The lever at rest at the first distance, on branch 0.
    fn rest(&self) -> Vec<f64> {
        let n = self.modes;
        let omega = TAU * F0;
        let mass = BETA[0].powi(4) * (K / 3.0) / (omega * omega) / 4.0;
        let mut deflection = 0.0;
        let mut state = vec![0.0; 2 * n];
        for _ in 0..200 {
            let force = (self.law.force)(0, (self.path)(0.0)[0] + deflection, 0.0);
            for (i, x) in state[..n].iter_mut().enumerate() {
                let own = omega * (BETA[i] / BETA[0]).powi(2);
                *x = force / (mass * own * own);
            }
            deflection = state[..n].iter().sum();
        }
        state
    }
}

/// A triangle from `from` to `to` and back.
fn ramp(from: f64, to: f64, speed: f64) -> Box<dyn Fn(f64) -> [f64; 2]> {
    let turn = (from - to) / speed;
    Box::new(move |time| {
        if time < turn {
            [from - speed * time, -speed]
        } else {
            [to + speed * (time - turn), speed]
        }
    })
}

/// The largest difference of deflections, as a part of the largest deflection.
fn deviation(report: &ForceCurveReport, lever: &Lever, h: f64) -> f64 {
    let times: Vec<f64> = report.points.iter().map(|point| point.time).collect();
    let expected = lever.run(&times, h);
    let largest = expected.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let differences = report.points.iter().zip(&expected);
    let differences = differences.map(|(point, expected)| (point.deflection - expected).abs());
    differences.fold(0.0, f64::max) / largest
}

#[test]
fn ramps_agree_with_an_independent_integration() {
    for (name, law, modes) in [
        ("dmt", DMT, 1),
        ("dmt", DMT, 3),
        ("jkr", JKR, 2),
        ("linear", LINEAR, 3),
    ] {
        let options = json!({"speed": "0.2 mm/s", "to": "-2 nm", "points": 50});
        let report = curve(name, modes, options);
        assert_eq!(report.points.len(), 100);
        assert!(report.points.iter().any(|point| point.contact));
        let lever = Lever {
            modes,
            law,
            path: ramp(8e-9, -2e-9, 2e-4),
            corner: 5e-5,
        };
        let found = deviation(&report, &lever, 1.0 / F0 / 16000.0);
        assert!(found < 1e-7, "{name}, {modes} modes: {found:e}");
    }
}

#[test]
fn a_cosine_agrees_with_an_independent_integration() {
    for (name, law) in [("dmt", DMT), ("linear", LINEAR)] {
        let options = json!({"frequency": "5 kHz", "to": "-2 nm", "points": 60});
        let report = curve(name, 2, options);
        let omega = TAU * 5e3;
        let lever = Lever {
            modes: 2,
            law,
            path: Box::new(move |time| {
                let (sin, cos) = (omega * time).sin_cos();
                [3e-9 + 5e-9 * cos, -5e-9 * omega * sin]
            }),
            corner: f64::INFINITY,
        };
        let found = deviation(&report, &lever, 1.0 / F0 / 16000.0);
        assert!(found < 1e-7, "{name}: {found:e}");
    }
}

/// −∮ F dz from the points: the trapezoidal rule of a curve with many of them.
fn area(report: &ForceCurveReport) -> f64 {
    let pairs = report.points.windows(2);
    -pairs
        .map(|p| 0.5 * (p[0].force + p[1].force) * (p[1].distance - p[0].distance))
        .sum::<f64>()
}

#[test]
fn the_energy_lost_is_the_area_of_the_curve() {
    for motion in [json!({"speed": "0.2 mm/s"}), json!({"frequency": "9 kHz"})] {
        for law in ["dmt", "jkr", "linear"] {
            let mut options = json!({"to": "-2 nm", "points": 15000});
            let own = options.as_object_mut().unwrap();
            own.extend(motion.as_object().unwrap().clone());
            let report = curve(law, 2, options);
            let (lost, area) = (report.summary.energy_lost, area(&report));
            assert!(lost > 0.0);
            // The force jumps where the neck of JKR breaks.
            assert!(
                (lost - area).abs() < 1e-3 * lost,
                "{law}: {lost:e} {area:e}"
            );
            let largest = report.points.iter().map(|p| p.force).fold(0.0, f64::max);
            let lowest = report.points.iter().map(|p| p.force).fold(0.0, f64::min);
            let summary = &report.summary;
            assert!((summary.peak_force / largest - 1.0).abs() < 1e-3);
            let least = summary.adhesion_force.max(summary.attraction);
            assert!(
                (least + lowest).abs() < 2e-3 * largest,
                "{law}: {least:e} {lowest:e}"
            );
        }
    }
}

#[test]
fn pull_off_at_rest_is_that_of_the_closed_forms() {
    let options = json!({"to": "-2 nm", "speed": "0.2 mm/s", "points": 10});
    // w = H / (12 π a0²); 2 π w R = H R / (6 a0²).
    let report = curve("dmt", 2, options.clone());
    let pull_off = report.statics.pull_off.unwrap();
    let expected = HAMAKER * RADIUS / (6.0 * CONTACT * CONTACT);
    assert!((-pull_off.force / expected - 1.0).abs() < 1e-10);
    assert!((pull_off.separation - CONTACT).abs() < 1e-18);
    // The lever leaves where the attraction's gradient is its stiffness, at the end of contact.
    let back = report.statics.jumps.last().unwrap();
    assert_eq!(back.way, Way::Retract);
    assert!((back.before.force + expected).abs() < 1e-10 * expected);
    let report = curve("jkr", 2, options);
    let pull_off = report.statics.pull_off.unwrap();
    let expected = 1.5 * PI * WORK * RADIUS;
    assert!(
        (-pull_off.force / expected - 1.0).abs() < 1e-10,
        "{}",
        pull_off.force / expected
    );
}

/// Static compliance of the first modes at the tip: Σ 1/(m ω²).
fn compliance(modes: usize) -> f64 {
    let omega = TAU * F0;
    let mass = BETA[0].powi(4) * (K / 3.0) / (omega * omega) / 4.0;
    let own = |beta: &f64| omega * (beta / BETA[0]).powi(2);
    BETA.iter()
        .take(modes)
        .map(|beta| 1.0 / (mass * own(beta).powi(2)))
        .sum()
}

#[test]
fn the_snap_in_at_rest_is_the_fold_of_van_der_waals() {
    for modes in [1, 3] {
        let report = curve("dmt", modes, json!({"speed": "0.2 mm/s", "points": 10}));
        let jump = report.statics.jumps[0];
        assert_eq!(jump.way, Way::Approach);
        // c F′ = 1 with F = −H R/(6 d²) and the compliance of the whole lever.
        let c = 1.0 / K;
        let gap = (c * HAMAKER * RADIUS / 3.0).cbrt();
        let force = -HAMAKER * RADIUS / (6.0 * gap * gap);
        // A fold is known to the root of rounding.
        assert!((jump.before.separation / gap - 1.0).abs() < 1e-9);
        assert!((jump.before.distance / (gap - c * force) - 1.0).abs() < 1e-9);
        let after = jump.after.unwrap();
        assert!(after.force < 0.0 || after.separation < CONTACT);
        // Every static point is an equilibrium.
        for branch in &report.statics.branches {
            for point in &branch.points {
                let rest = point.separation - point.distance - c * point.force;
                assert!(rest.abs() < 1e-12 * 8e-9, "{rest:e}");
            }
        }
    }
}

#[test]
fn a_slow_curve_follows_the_branches_at_rest_between_the_jumps() {
    let options = json!({"to": "-2 nm", "speed": "1 um/s", "points": 200});
    let report = curve("jkr", 1, options);
    let c = compliance(1);
    let jumps = report.statics.jumps.iter();
    let off = jumps.clone().find(|jump| jump.way == Way::Retract);
    let off = off.unwrap().before.distance;
    let mut compared = 0;
    // The ringing after the snap-in has decayed.
    let held = report
        .points
        .iter()
        .filter(|p| p.way == Way::Retract && p.distance > -1.5e-9 && p.distance < off - 2e-10);
    for point in held {
        // What is left is the force of the lever's own damping, m γ v of v/(Q ω).
        let rest = point.separation - point.distance - c * point.force;
        let damped = 1e-6 / (Q * TAU * F0);
        assert!(rest.abs() < 2.0 * damped, "{rest:e} {damped:e}");
        compared += 1;
    }
    assert!(compared > 50);
    let expected = 1.5 * PI * WORK * RADIUS;
    assert!((report.summary.adhesion_force / expected - 1.0).abs() < 1e-6);
    // The moving lever has one mode; at the force at which it leaves, those that it lacks would take
    // so much more of the distance.
    let off = off + (1.0 / K - c) * -expected;
    assert!((report.summary.contact_end.unwrap() - off).abs() < 5e-11);
}

/// F = k d against the sample, whatever the number of modes, the tip's mass and the damping.
#[test]
fn the_lever_at_rest_has_its_whole_compliance() {
    for law in ["linear", "hertz", "jkr"] {
        for modes in [1, 2, 3] {
            for own in ["tip.mass_ratio=0", "tip.mass_ratio=0.2"] {
                let mut words = words(law, modes);
                words.push(own.to_owned());
                let options = json!({"to": "-5 nm", "speed": "0.2 mm/s", "points": 10});
                let report = curve_of(&words, options);
                let mut largest: f64 = 0.0;
                let branches = report.statics.branches.iter();
                for point in branches.flat_map(|branch| &branch.points) {
                    let off = K * point.deflection - point.force;
                    assert!(off.abs() < 1e-12 * K * 8e-9, "{law}, {modes}: {off:e}");
                    assert!((point.separation - point.distance - point.deflection).abs() < 1e-20);
                    largest = largest.max(point.force);
                }
                assert!(largest > 2e-9, "{law}: {largest:e}");
            }
        }
    }
}

/// Every figure follows from the motion, not from the points that are listed.
#[test]
fn figures_do_not_depend_on_the_points() {
    let motions = [
        json!({"speed": "0.2 mm/s"}),
        json!({"speed": "20 um/s"}),
        json!({"frequency": "5 kHz"}),
    ];
    for law in ["dmt", "jkr", "hertz", "hertz + capillary", "linear"] {
        for (modes, amplitude) in [(1, 0), (3, 0), (1, 2)] {
            let mut words = words(law, modes);
            words.retain(|word| !word.starts_with("drive.free_amplitude"));
            words.push(format!("drive.free_amplitude={amplitude} nm"));
            for motion in &motions {
                let with_points = |points: usize| {
                    let mut options = json!({"to": "-2 nm", "points": points});
                    let own = options.as_object_mut().unwrap();
                    own.extend(motion.as_object().unwrap().clone());
                    curve_of(&words, options)
                };
                let report = with_points(50);
                assert!(report.summary.contact_begin.is_some());
                assert!(report.summary.energy_lost != 0.0);
                for points in [500, 777] {
                    let other = with_points(points);
                    let place = format!("{law}, {modes} modes, {amplitude} nm, {motion}");
                    assert_eq!(report.summary, other.summary, "{place}");
                    assert_eq!(report.fits, other.fits, "{place}");
                    assert_eq!(report.statics, other.statics, "{place}");
                    assert_eq!([report.from, report.to], [other.from, other.to], "{place}");
                    assert_eq!(report.driven, amplitude > 0);
                }
            }
        }
    }
}

/// A driven lever of one mode, by the same integration as below, its drive at the phase of the
/// case. From 8 nm the curve begins a whole number of drive periods before the turn.
#[test]
fn figures_of_a_driven_lever_are_those_of_an_independent_integration() {
    let mut words = words("dmt", 1);
    words.retain(|word| !word.starts_with("drive.free_amplitude"));
    for word in ["drive.free_amplitude=2 nm", "drive.actuation=tip"] {
        words.push(word.to_owned());
    }
    let options = json!({"to": "-2 nm", "speed": "0.2 mm/s", "settle": 0});
    let report = curve_of(&words, options);
    let found = &report.summary;
    assert!((report.from - 9.428_571_428_571_43e-9).abs() < 1e-22);
    for (name, found, expected) in [
        ("begin", found.contact_begin.unwrap(), 1.297_099_507_92e-9),
        ("end", found.contact_end.unwrap(), 1.667_843_395_65e-9),
        ("indentation", found.indentation, 2.438_833_033_07e-9),
        ("peak", found.peak_force, 1.334_598_317_39e-8),
        ("adhesion", found.adhesion_energy, 7.821_094_344_7e-19),
        ("lost", found.energy_lost, 3.149_201_835_2e-18),
    ] {
        let off = (found / expected - 1.0).abs();
        assert!(off < 1e-9, "{name}: {found:e} {expected:e}");
    }
}

/// The curve of docs/cases/force-curve.md with every event and extremum located by SciPy's DOP853
/// (rtol 1e-13, steps of at most 2 us): two modes of a uniform beam with the damping of the first
/// under DMT's force, its energies integrated as further states. At 0.165 nm contact begins.
#[test]
fn figures_are_those_of_an_independent_integration() {
    let source = nanotap::case::file::Source {
        name: "force-curve.toml".into(),
        text: include_str!("../../../docs/cases/force-curve.toml").into(),
    };
    let case = Case::parse(Some(source), &[]).unwrap();
    let options = json!({"to": "-2 nm", "speed": "10 um/s", "points": 7});
    let options: ForceCurveOptions = serde_json::from_value(options).unwrap();
    let report = ForceCurveStudy::run(&case, &options, &Control::default()).unwrap();
    let found = &report.summary;
    for (name, found, expected) in [
        ("begin", found.contact_begin.unwrap(), 6.609_168_375_91e-10),
        ("end", found.contact_end.unwrap(), 1.901_234_459_203e-9),
        ("indentation", found.indentation, 5.199_449_358_23e-10),
        ("peak", found.peak_force, 6.443_637_202_58e-9),
        ("adhesion", found.adhesion_energy, 4.647_815_027_10e-18),
        ("lost", found.energy_lost, 3.259_318_966_94e-18),
    ] {
        let off = (found / expected - 1.0).abs();
        assert!(off < 1e-9, "{name}: {found:e} {expected:e}");
    }
    assert_eq!(report.snap_in, found.contact_begin);
    assert_eq!(report.pull_off, found.contact_end);
}

#[test]
fn fits_of_the_right_model_give_the_modulus_of_the_case() {
    for (law, model) in [
        ("hertz", ContactModel::Hertz),
        ("dmt", ContactModel::Dmt),
        ("jkr", ContactModel::Jkr),
    ] {
        let options = json!({"to": "-2 nm", "speed": "2 um/s", "points": 1000});
        let report = curve(law, 1, options);
        assert!((report.reduced_modulus.unwrap() / reduced() - 1.0).abs() < 1e-12);
        let fit = report.fits.iter().find(|fit| fit.model == model).unwrap();
        assert!(
            (fit.reduced_modulus / reduced() - 1.0).abs() < 3e-4,
            "{law}: {}",
            fit.reduced_modulus / reduced()
        );
        assert!((fit.modulus.unwrap() / MODULUS - 1.0).abs() < 3e-4);
        // Hertz's contact begins at the surface, the others' at the contact distance.
        let begins = if law == "hertz" { 0.0 } else { CONTACT };
        assert!((fit.contact_point - begins).abs() < 1e-12);
        // Others are wrong where there is adhesion.
        if law != "hertz" {
            let hertz = &report.fits[0];
            assert!((hertz.reduced_modulus / reduced() - 1.0).abs() > 0.05);
        }
    }
}

#[test]
fn the_peak_force_is_that_requested_at_a_low_speed() {
    let options = json!({"peak_force": "3 nN", "speed": "1 um/s", "points": 100});
    // The speed turns by 2 v, which makes the lever ring by up to 2 v/ω.
    let rings = 2.0 * 1e-6 / (TAU * F0) * K;
    for law in ["dmt", "jkr", "hertz", "linear"] {
        let report = curve(law, 2, options.clone());
        let found = report.summary.peak_force;
        assert!((found - 3e-9).abs() < rings, "{law}: {found:e}");
    }
}

#[test]
fn a_driven_lever_keeps_its_amplitude_far_away_and_its_points_end_periods() {
    let mut words = words("dmt", 1);
    words.retain(|word| !word.starts_with("drive.free_amplitude"));
    words.push("drive.free_amplitude=2 nm".to_owned());
    let options = json!({"from": "30 nm", "to": "5 nm", "speed": "200 um/s", "points": 50});
    let report = curve_of(&words, options);
    assert!(report.driven);
    assert!(report.fits.is_empty());
    let first = &report.points[0];
    assert!((first.amplitude.unwrap() / 2e-9 - 1.0).abs() < 1e-2);
    let case = Case::parse(None, &words).unwrap();
    let free = case.physical().unwrap().free_phase;
    assert!((first.phase.unwrap() - free).abs() < 0.5, "{free}");
    let periods = first.time * F0;
    assert!((periods - periods.round()).abs() < 1e-9);
    assert!(report.from >= 30e-9 && report.from < 31e-9);
    assert!((report.to - 5e-9).abs() < 1e-20);
}

/// A ramp so slow that the lever always settles: its points have the means of the orbit at their
/// distance, whatever the drive phase at which a period ends.
#[test]
fn points_of_a_driven_lever_are_means_over_drive_periods() {
    let mut words = words("hertz", 2);
    words.retain(|word| !word.starts_with("drive."));
    for word in ["drive.free_amplitude=2 nm", "drive.frequency=68 kHz"] {
        words.push(word.to_owned());
    }
    let options = json!({"from": "1.6 nm", "to": "1.5 nm", "speed": "50 nm/s", "points": 20});
    let report = curve_of(&words, options);
    for point in report.points.iter().skip(5).step_by(7) {
        let at = point.distance;
        words.push(format!("gap.tip={at:e} m"));
        let case = Case::parse(None, &words).unwrap();
        words.pop();
        let options = OrbitOptions::default();
        let orbit = OrbitStudy::run(&case, &options, &Control::default()).unwrap();
        let seen = orbit.physical.unwrap().observables;
        // The lever settles in 6 periods, in which the distance changes by 4 pm.
        assert!(seen.mean_deflection > 10e-12, "{:e}", seen.mean_deflection);
        assert!(
            (point.deflection / seen.mean_deflection - 1.0).abs() < 0.02,
            "{point:?}"
        );
        assert!(
            (point.force / seen.mean_force - 1.0).abs() < 0.02,
            "{point:?}"
        );
        assert!((point.separation - at - point.deflection).abs() < 1e-20);
        assert!(point.contact);
    }
    let free = curve_of(
        &words,
        json!({"from": "5 nm", "to": "4 nm", "speed": "200 um/s"}),
    );
    for point in &free.points {
        assert!(point.deflection.abs() < 1e-20, "{point:?}");
    }
}

#[test]
fn the_table_has_every_point() {
    let report = curve(
        "dmt",
        1,
        json!({"to": "-1 nm", "speed": "0.2 mm/s", "points": 20}),
    );
    let table = report.point_table().csv();
    assert_eq!(table.lines().count(), 41);
    let last: Vec<&str> = table.lines().last().unwrap().split(',').collect();
    assert_eq!(last[0], "retract");
    assert!((last[2].parse::<f64>().unwrap() - 8e-9).abs() < 1e-20);
}

#[test]
fn impossible_curves_are_refused_with_the_reason() {
    let refused = |options: Value| {
        let case = Case::parse(None, &words("dmt", 1)).unwrap();
        let options: ForceCurveOptions = serde_json::from_value(options).unwrap();
        let error = ForceCurveStudy::run(&case, &options, &Control::default()).unwrap_err();
        error.to_string()
    };
    for (options, reason) in [
        (json!({"to": "9 nm"}), "from far to near"),
        (json!({"to": "1 nm", "peak_force": "1 nN"}), "say the same"),
        (
            json!({"speed": "1 um/s", "frequency": "1 kHz"}),
            "a ramp of a",
        ),
        (json!({"speed": "0 um/s"}), "speed"),
        (json!({"frequency": "-1 kHz"}), "positive"),
        (json!({"speed": "1e-6 um/s"}), "drive periods"),
        (json!({"fit_from": 0.9, "fit_to": 0.1}), "empty range"),
        (json!({"points": 1}), "points"),
    ] {
        let message = refused(options);
        assert!(message.contains(reason), "{message}");
    }
    let oscillator = Case::parse(
        None,
        &[
            "oscillator.omega=2.5".to_owned(),
            "oscillator.gap=0.1".to_owned(),
        ],
    );
    if let Ok(oscillator) = oscillator {
        let options = ForceCurveOptions::default();
        assert!(ForceCurveStudy::run(&oscillator, &options, &Control::default()).is_err());
    }
}
