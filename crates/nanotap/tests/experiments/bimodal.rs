//! Two tones under loops against a simulation of the loops in time, against orbits of tones with a
//! common period, and against the limits in which the usual formulas hold.

use std::f64::consts::TAU;

use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::model::galerkin::Galerkin;
use nanotap::study::Study as _;
use nanotap::study::bimodal::{BimodalOptions, BimodalPoint, BimodalReport, BimodalStudy, Loop};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap_flow::Complex;

/// A lever of two modes on a sphere-like contact, with further words.
fn lever(words: &[&str]) -> Case {
    let mut all = vec![
        "modes=2",
        "cantilever.k=2 N/m",
        "cantilever.f0=70 kHz",
        "cantilever.Q=50",
        "tip.radius=10 nm",
        "sample.law=hertz",
        "sample.modulus=1 GPa",
        "sample.poisson=0.3",
        "sample.contact_distance=0.1 nm",
        "drive.actuation=tip",
        "drive.frequency_ratio=1",
        "drive.free_amplitude=20 nm",
        "drive.second_ratio=6.27",
    ];
    all.extend(words);
    let words: Vec<String> = all.iter().map(|word| (*word).to_owned()).collect();
    Case::parse(None, &words).unwrap()
}

fn report(case: &Case, first: Loop, second: Loop) -> BimodalReport {
    let options = BimodalOptions {
        first: Some(first),
        second: Some(second),
        points: 5,
        ..BimodalOptions::default()
    };
    let report = BimodalStudy::run(case, &options, &Control::default()).unwrap();
    assert_eq!(report.ended, None);
    report
}

fn last(report: &BimodalReport) -> BimodalPoint {
    *report.table.last().unwrap()
}

/// A lever with the controllers of an instrument, by the classical Runge–Kutta method.
struct Instrument {
    inverse_mass: nalgebra::Matrix2<f64>,
    damping: nalgebra::Matrix2<f64>,
    stiffness: nalgebra::Matrix2<f64>,
    tip: nalgebra::Vector2<f64>,
    gap: f64,
    /// Height at which the contact begins.
    begins: f64,
    /// Force of an indentation δ is this times δ^1.5.
    contact: f64,
    omega: [f64; 2],
    strength: [f64; 2],
    phase: [f64; 2],
    state: [nalgebra::Vector2<f64>; 2],
}

impl Instrument {
    fn rate(
        &self,
        [a, v]: &[nalgebra::Vector2<f64>; 2],
        ahead: f64,
    ) -> [nalgebra::Vector2<f64>; 2] {
        let height = self.gap + self.tip.dot(a);
        let mut force = self.contact * (self.begins - height).max(0.0).powf(1.5);
        for tone in 0..2 {
            force += self.strength[tone] * (self.phase[tone] + self.omega[tone] * ahead).sin();
        }
        let acceleration =
            self.inverse_mass * (self.tip * force - self.damping * v - self.stiffness * a);
        [*v, acceleration]
    }

    /// What lock-in amplifiers on both tones read over so many periods of the first, with a window
    /// that suppresses the other lines: amplitude, and lag in radians.
    fn read(&mut self, periods: usize, steps: usize) -> [(f64, f64); 2] {
        let h = TAU / self.omega[0] / steps as f64;
        let count = periods * steps;
        let mut sums = [Complex::new(0.0, 0.0); 2];
        for step in 0..count {
            let window = (std::f64::consts::PI * step as f64 / count as f64)
                .sin()
                .powi(4);
            for tone in 0..2 {
                let (sin, cos) = self.phase[tone].sin_cos();
                sums[tone] += Complex::new(cos, -sin) * (window * self.tip.dot(&self.state[0]));
            }
            let moved =
                |state: &[nalgebra::Vector2<f64>; 2], by: &[nalgebra::Vector2<f64>; 2], h: f64| {
                    [state[0] + by[0] * h, state[1] + by[1] * h]
                };
            let start = self.state;
            let first = self.rate(&start, 0.0);
            let second = self.rate(&moved(&start, &first, 0.5 * h), 0.5 * h);
            let third = self.rate(&moved(&start, &second, 0.5 * h), 0.5 * h);
            let fourth = self.rate(&moved(&start, &third, h), h);
            for k in 0..2 {
                self.state[k] += (first[k] + (second[k] + third[k]) * 2.0 + fourth[k]) * (h / 6.0);
            }
            for tone in 0..2 {
                self.phase[tone] = (self.phase[tone] + self.omega[tone] * h) % TAU;
            }
        }
        // The mean of the window is 3/8; the mean of W e^(−iφ) is A e^(−i lag)/(2i).
        let scale = Complex::new(0.0, 2.0) / (0.375 * count as f64);
        sums.map(|sum| {
            let read = sum * scale;
            (read.re.hypot(read.im), -read.im.atan2(read.re))
        })
    }
}

/// Controllers that integrate, each turn after the lock-in amplifiers have read.
fn simulated(
    case: &Case,
    kinds: [Loop; 2],
    start: &BimodalReport,
) -> ([f64; 2], [f64; 2], [(f64, f64); 2]) {
    let view = case.physical().unwrap();
    let (lever, scales) = (&view.cantilever, &view.scales);
    let equations = Galerkin::new(lever).unwrap();
    let square = |m: &nalgebra::DMatrix<f64>| nalgebra::Matrix2::from_fn(|i, j| m[(i, j)]);
    let reduced = start.reduced_modulus.unwrap();
    let contact = 4.0 / 3.0 * reduced * 10e-9_f64.sqrt() * scales.length.powf(1.5) / scales.force;
    let quality = [
        50.0,
        50.0 * start.free[1].resonance / start.free[0].resonance,
    ];
    let mut instrument = Instrument {
        inverse_mass: square(&equations.mass).try_inverse().unwrap(),
        damping: square(&equations.damping[0]),
        stiffness: square(&equations.stiffness[0]),
        tip: nalgebra::Vector2::new(equations.modes.tip[0], equations.modes.tip[1]),
        gap: lever.alpha5,
        begins: 0.1e-9 / scales.length,
        contact,
        omega: [0, 1].map(|k| start.free[k].frequency / scales.frequency),
        strength: [0, 1].map(|k| start.free[k].drive_strength / scales.force),
        phase: [0.0; 2],
        state: [nalgebra::Vector2::zeros(); 2],
    };
    let mut read = [(0.0, 0.0); 2];
    for turn in 0..60 {
        // Coarse steps until the loops are near.
        let steps = if turn < 40 { 600 } else { 2400 };
        instrument.read(150, steps);
        // Lines of the two tones lie close to each other, and a long window tells them apart.
        read = instrument.read(if turn < 56 { 300 } else { 2400 }, steps);
        for tone in 0..2 {
            let (amplitude, lag) = read[tone];
            if kinds[tone].holds_phase() {
                let away = lag - std::f64::consts::FRAC_PI_2;
                instrument.omega[tone] *= 1.0 - 0.4 * away / (2.0 * quality[tone]);
            }
            if kinds[tone].holds_amplitude() {
                let wanted = start.free[tone].amplitude / scales.length;
                instrument.strength[tone] *= (wanted / amplitude).powf(0.4);
            }
        }
    }
    (
        instrument.omega.map(|omega| omega * scales.frequency),
        instrument.strength.map(|strength| strength * scales.force),
        read.map(|(amplitude, lag)| (amplitude * scales.length, lag.to_degrees())),
    )
}

#[test]
fn am_fm_holds_what_its_simulation_holds() {
    compared([Loop::Am, Loop::Fm], "17 nm");
}

#[test]
fn fm_fm_holds_what_its_simulation_holds() {
    compared([Loop::Fm, Loop::Fm], "19.8 nm");
}

/// The loops against their simulation at a distance.
fn compared(kinds: [Loop; 2], gap: &str) {
    let gap = format!("gap.tip={gap}");
    let case = lever(&["drive.second_free_amplitude=1 nm", &gap]);
    let report = report(&case, kinds[0], kinds[1]);
    let found = last(&report);
    let (frequency, strength, read) = simulated(&case, kinds, &report);
    for tone in 0..2 {
        let exact = found.tones[tone];
        let shift = frequency[tone] - report.free[tone].frequency;
        let close = |a: f64, b: f64, limit: f64| {
            assert!((a - b).abs() <= limit, "{kinds:?} tone {tone}: {a} {b}");
        };
        close(read[tone].0, exact.amplitude, 1e-6 * exact.amplitude);
        close(read[tone].1, exact.phase, 1e-4);
        close(
            strength[tone],
            exact.drive_strength,
            1e-6 * exact.drive_strength,
        );
        // Frequencies to 1e-8 of themselves.
        close(shift, exact.frequency_shift, 1e-8 * exact.frequency);
    }
    assert!(found.tones[1].frequency_shift > 100.0, "{found:?}");
}

/// Without loops, at a ratio of whole numbers, both tones are those of the orbit after which they
/// repeat; it is one of a family that hardly depends on the phase between the tones.
#[test]
fn constant_tones_are_those_of_their_common_orbit() {
    let tones = ["drive.second_free_amplitude=0.5 nm", "gap.tip=17 nm"];
    let laws: [&[&str]; 3] = [
        &[],
        // Memory that relaxes, and whether there is contact.
        &[
            "sample.contact_distance=",
            "sample.law=prony-sphere",
            "sample.modulus=33.38 MPa",
            "sample.poisson=0.5",
            "sample.arms=[[\"time (us)\", \"modulus (MPa)\"], [0.3832, 460], [1.671, 135.7]]",
        ],
        // Whether a neck is there.
        &[
            "sample.contact_distance=",
            "sample.law=jkr",
            "sample.work_of_adhesion=10 mJ/m^2",
        ],
    ];
    for law in laws {
        let case = lever(&[&tones, law].concat());
        let found = last(&report(&case, Loop::Am, Loop::Am));
        let common = orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap();
        let length = case.physical().unwrap().scales.length;
        let seen = common.observables;
        let of_orbit = [
            (seen.first_harmonic * length, seen.phase),
            (
                seen.tone2_response.unwrap() * length,
                seen.tone2_lag.unwrap(),
            ),
        ];
        for (tone, (amplitude, phase)) in found.tones.iter().zip(of_orbit) {
            let off = (tone.amplitude / amplitude - 1.0).abs();
            println!("{law:?} {off:.1e} {:.1e}", tone.phase - phase);
            assert!(off < 1e-8, "{law:?}: {tone:?} {amplitude}");
            assert!((tone.phase - phase).abs() < 1e-6, "{tone:?} {phase}");
        }
        let [re, im] = common.multipliers[0];
        let growth = re.hypot(im).powf(0.01);
        let off = (found.growth - growth).abs();
        assert!(off < 1e-4, "{} {growth}", found.growth);
    }
}

/// The modulus formula holds for a second amplitude well below the indentation, and is half the
/// modulus where it is as large.
#[test]
fn the_modulus_formula_holds_for_a_small_second_amplitude() {
    let off = |second: &str| {
        let words = [
            second,
            "cantilever.Q=150",
            "drive.free_amplitude=40 nm",
            "drive.setpoint=0.8",
        ];
        let report = report(&lever(&words), Loop::Am, Loop::Fm);
        let found = last(&report);
        let setpoint = 0.8 * 40e-9;
        assert!((found.tones[0].amplitude / setpoint - 1.0).abs() < 1e-9);
        assert!((report.setpoint.unwrap() / setpoint - 1.0).abs() < 1e-12);
        // Virials by formula: the mean force and a single harmonic.
        for tone in found.tones {
            assert!(
                (tone.estimates.virial / tone.virial - 1.0).abs() < 5e-3,
                "{tone:?}"
            );
        }
        found.estimates.reduced_modulus.unwrap() / report.reduced_modulus.unwrap() - 1.0
    };
    let small = off("drive.second_free_amplitude=0.1 nm");
    let large = off("drive.second_free_amplitude=1 nm");
    assert!(small.abs() < 0.03, "{small}");
    assert!(large < -0.4, "{large}");
}

#[test]
fn contradictions_are_refused_by_name() {
    let run = |words: &[&str], first| {
        let options = BimodalOptions {
            first: Some(first),
            ..BimodalOptions::default()
        };
        let refused = BimodalStudy::run(&lever(words), &options, &Control::default());
        refused.unwrap_err().to_string()
    };
    let both = run(
        &["drive.second_free_amplitude=1 nm", "drive.setpoint=0.8"],
        Loop::Fm,
    );
    assert!(both.contains("both hold its amplitude"), "{both}");
    let nothing = run(
        &["drive.second_free_amplitude=0 nm", "gap.tip=17 nm"],
        Loop::Am,
    );
    assert!(nothing.contains("second tone"), "{nothing}");
    // One mode has no resonance near the second tone.
    let one = run(
        &[
            "drive.second_free_amplitude=1 nm",
            "gap.tip=17 nm",
            "modes=1",
        ],
        Loop::Am,
    );
    assert!(one.contains("no mode of the lever resonates"), "{one}");
    // Its second mode answers a driven base with the other sign.
    let based = run(
        &[
            "drive.second_free_amplitude=1 nm",
            "gap.tip=17 nm",
            "drive.actuation=base",
        ],
        Loop::Am,
    );
    assert!(
        based.contains("second tone: near the drive's frequency")
            && based.contains("give second_phase -90"),
        "{based}"
    );
    let far = run(
        &["drive.second_free_amplitude=1 nm", "gap.tip=1 um"],
        Loop::Am,
    );
    assert!(far.contains("cannot end at"), "{far}");
}
