//! Levers with measured modes: the model has the stated frequencies, stiffnesses and quality factors, and
//! moves as independent programs and closed forms have it.

use std::f64::consts::TAU;

use nalgebra::DMatrix;
use nanotap::case::Case;
use nanotap::case::physical::Physical;
use nanotap::control::Control;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::galerkin::Galerkin;
use nanotap::study::Study as _;
use nanotap::study::bimodal::{BimodalOptions, BimodalReport, BimodalStudy, Loop};
use nanotap::study::convergence::{ConvergenceOptions, ConvergenceStudy};
use nanotap::study::modes::{ModesOptions, ModesStudy};
use nanotap::study::noise::{NoiseOptions, NoiseStudy};
use nanotap::study::orbit::{OrbitOptions, OrbitStudy, orbit};
use nanotap_flow::Complex;
use proptest::prelude::*;

/// Boltzmann's constant, J/K (SI, exact).
const BOLTZMANN: f64 = 1.380_649e-23;

/// A free lever far from its sample, driven at the tip, with further words.
fn case(words: &[String]) -> Result<Case, String> {
    let mut all: Vec<String> = [
        "sample.stiffness=1 N/m",
        "drive.frequency_ratio=1",
        "drive.free_amplitude=10 nm",
        "gap.tip=1 um",
    ]
    .map(str::to_owned)
    .to_vec();
    let own = |word: &String| word.split('=').next().unwrap_or_default().to_owned();
    let replaced: Vec<String> = words.iter().map(own).collect();
    all.retain(|word| !replaced.contains(&own(word)));
    all.extend_from_slice(words);
    Case::parse(None, &all).map_err(|error| error.to_string())
}

fn words(all: &[&str]) -> Vec<String> {
    all.iter().map(|word| (*word).to_owned()).collect()
}

/// Undamped frequency in Hz, stiffness at the tip in N/m and quality factor of each free mode of the
/// model, by ascending frequency. With ω² and v of K v = ω² M v and vᵀMv = 1 they are ω, ω²/(p·v)² and
/// ω/vᵀCv: M, C and K are the equations that are integrated.
fn modes_of(view: &Physical) -> Vec<[f64; 3]> {
    let equations = Galerkin::new(&view.cantilever).unwrap();
    let root = equations.stiffness[0].clone().cholesky().unwrap().l();
    let inverse: DMatrix<f64> = root.try_inverse().unwrap();
    let eigen = (&inverse * &equations.mass * inverse.transpose()).symmetric_eigen();
    let mut found: Vec<[f64; 3]> = (0..eigen.eigenvalues.len())
        .map(|k| {
            let omega = eigen.eigenvalues[k].sqrt().recip();
            let shape = inverse.tr_mul(&eigen.eigenvectors.column(k)) * omega;
            let damping = shape.dot(&(&equations.damping[0] * &shape));
            let stiffness = (omega / equations.gap.tip.dot(&shape)).powi(2);
            [
                omega * view.scales.frequency,
                stiffness * view.scales.stiffness,
                omega / damping,
            ]
        })
        .collect();
    found.sort_by(|a, b| a[0].total_cmp(&b[0]));
    found
}

fn assert_met(found: &[f64; 3], stated: &[f64; 3], tolerance: f64, of: &str) {
    for (found, stated) in found.iter().zip(stated) {
        assert!(
            (found / stated - 1.0).abs() < tolerance,
            "{of}: {found} {stated}"
        );
    }
}

fn table(modes: &[[f64; 3]]) -> String {
    let mode = |[f, k, q]: &[f64; 3]| format!("{{f = \"{f:?} Hz\", k = \"{k:?} N/m\", Q = {q:?}}}");
    let all: Vec<String> = modes.iter().map(mode).collect();
    format!("cantilever.mode=[{}]", all.join(", "))
}

proptest! {
    /// A beam with a tip of any mass, or one that f2 tells, has f0, k1, Q and what was measured of its
    /// second and third mode.
    #[test]
    fn a_beam_has_its_stated_modes(
        count in 3..6_usize,
        tip in prop::option::of(0.0..2.0_f64),
        [first, second, third] in [1e4..1e6_f64, 0.6..1.8_f64, 0.7..1.6_f64],
        stiffness in 0.01..50.0_f64,
        parts in [0.3..3.0_f64, 0.3..3.0_f64],
        quality in [2.0..2e4_f64, 2.0..2e4_f64, 2.0..2e4_f64],
        has_stiffness in any::<bool>(),
    ) {
        // Frequencies of a uniform beam: 1, 6.2669, 17.547; stiffnesses their squares.
        let [f2, f3] = [first * 6.2669 * second, first * 17.547 * third];
        prop_assume!(f3 > 1.2 * f2);
        let [k2, k3] = [stiffness * 39.27 * parts[0], stiffness * 307.9 * parts[1]];
        let mut words = vec![
            format!("modes={count}"),
            format!("cantilever.k1={stiffness:?} N/m"),
            format!("cantilever.f0={first:?} Hz"),
            format!("cantilever.Q={:?}", quality[0]),
            format!("cantilever.f2={f2:?} Hz"),
            format!("cantilever.f3={f3:?} Hz"),
            format!("cantilever.Q2={:?}", quality[1]),
            format!("cantilever.Q3={:?}", quality[2]),
        ];
        words.extend(tip.map(|ratio| format!("tip.mass_ratio={ratio:?}")));
        if has_stiffness {
            words.push(format!("cantilever.k2={k2:?} N/m"));
            words.push(format!("cantilever.k3={k3:?} N/m"));
        }
        // A frequency beyond a factor of two of the beam's is refused, and that is not what is tested.
        let read = case(&words);
        prop_assume!(!read.as_ref().is_err_and(|error| error.contains("factor of two")));
        let read = read.unwrap();
        let found = modes_of(read.physical().unwrap());
        // An unmeasured fourth mode may lie below a high third one.
        let near = |f: f64| {
            let off = |mode: &&[f64; 3]| (mode[0] / f - 1.0).abs();
            *found.iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap()
        };
        let distinct = found.windows(2).all(|pair| pair[1][0] > 1.01 * pair[0][0]);
        prop_assume!(distinct);
        let own = |f: f64, k: f64| if has_stiffness { k } else { near(f)[1] };
        // The terms of rank one cancel entries that a heavy tip makes tens of times as large, and the eigenvalues
        // of this test have the error of the largest one.
        let tolerance = 1e-9;
        assert_met(&near(first), &[first, stiffness, quality[0]], tolerance, "first");
        assert_met(&near(f2), &[f2, own(f2, k2), quality[1]], tolerance, "second");
        assert_met(&near(f3), &[f3, own(f3, k3), quality[2]], tolerance, "third");
    }

    /// A lever of measured modes has just these, and rests on all their springs in series.
    #[test]
    fn a_lever_of_modes_has_its_stated_modes(
        first in 1e3..1e6_f64,
        steps in prop::collection::vec((1.05..8.0_f64, 0.1..100.0_f64, 1.5..1e5_f64), 1..7),
    ) {
        let mut stated: Vec<[f64; 3]> = Vec::new();
        for (step, stiffness, quality) in steps {
            let last = stated.last().map_or(first / step, |mode| mode[0]);
            stated.push([last * step, stiffness, quality]);
        }
        prop_assume!(stated[stated.len() - 1][0] < 1e4 * stated[0][0]);
        let case = case(&[table(&stated)]).unwrap();
        let view = case.physical().unwrap();
        let found = modes_of(view);
        prop_assert_eq!(found.len(), stated.len());
        for (found, stated) in found.iter().zip(&stated) {
            assert_met(found, stated, 1e-12, "mode");
        }
        let give: f64 = stated.iter().map(|mode| 1.0 / mode[1]).sum();
        let equations = Galerkin::new(&view.cantilever).unwrap();
        let tip = &equations.gap.tip;
        let rest = tip.dot(&equations.stiffness[0].clone().cholesky().unwrap().solve(tip));
        let model = rest / view.scales.stiffness;
        prop_assert!((model / give - 1.0).abs() < 1e-12);
        prop_assert!((view.lever.k * give - 1.0).abs() < 1e-14);
        // The damped eigenvalues: |λ| = ω and Re λ = −ω/(2Q), up to the rounding of the general solver, in
        // proportion to the largest entry ω².
        let table = ModesStudy::run(&case, &ModesOptions::default(), &Control::default()).unwrap();
        let frequencies = table.physical.unwrap();
        for (found, stated) in frequencies["free"].iter().zip(&stated) {
            prop_assert!((found / stated[0] - 1.0).abs() < 1e-12);
        }
        prop_assert!(table.exact_free.is_empty());
        let values = table.free_eigenvalues.unwrap();
        let largest = TAU * stated[stated.len() - 1][0] * view.scales.time;
        let rounding = 1e-11 * largest * largest;
        for ([re, im], stated) in values.iter().zip(&stated) {
            let omega = TAU * stated[0] * view.scales.time;
            prop_assert!((re.hypot(*im) - omega).abs() < rounding);
            prop_assert!((re + 0.5 * omega / stated[2]).abs() < rounding);
        }
    }
}

/// f0 = 48.913 kHz, k1 = 0.9 N/m, Q = 255 and 306.194 kHz, 35.2 N/m, 1002 of the second mode: Rodriguez
/// and Garcia, Appl. Phys. Lett. 84, 449 (2004).
const PUBLISHED: [[f64; 3]; 2] = [[48_913.0, 0.9, 255.0], [306_194.0, 35.2, 1002.0]];

fn bimodal(lever: &[String], second: Loop) -> BimodalReport {
    let mut all = words(&[
        "modes=2",
        "tip.radius=20 nm",
        "sample.stiffness=",
        "sample.law=van-der-waals",
        "sample.hamaker=6.4e-20 J",
        "drive.actuation=tip",
        "drive.second_free_amplitude=1 nm",
        "gap.tip=",
        "drive.setpoint=0.9",
    ]);
    all.extend_from_slice(lever);
    let case = case(&all).unwrap();
    let options = BimodalOptions {
        first: Some(Loop::Am),
        second: Some(second),
        points: 3,
        ..BimodalOptions::default()
    };
    let report = BimodalStudy::run(&case, &options, &Control::default()).unwrap();
    assert_eq!(report.ended, None);
    report
}

/// Lag of the tip behind a force on it at the frequency of the second mode: χ = Σ 1/k/(1 − r² + i r/Q).
fn lag_at_second(modes: &[[f64; 3]]) -> f64 {
    let at = modes[1][0];
    let response = |[f, k, q]: &[f64; 3]| {
        let ratio = at / f;
        1.0 / (Complex::new(1.0 - ratio * ratio, ratio / q) * *k)
    };
    let sum: Complex = modes.iter().map(response).sum();
    -sum.im.atan2(sum.re).to_degrees()
}

/// The published lever at its own two frequencies, whose ratio is not one of small whole numbers, both as
/// a beam with measured modes and as modes alone.
#[test]
fn a_published_bimodal_lever_is_met_at_both_frequencies() {
    let beam = words(&[
        "cantilever.k1=0.9 N/m",
        "cantilever.f0=48.913 kHz",
        "cantilever.Q=255",
        "cantilever.f2=306.194 kHz",
        "cantilever.Q2=1002",
        "cantilever.k2=35.2 N/m",
        "drive.second_frequency=306.194 kHz",
    ]);
    let modes = [
        table(&PUBLISHED),
        "drive.second_frequency=306.194 kHz".to_owned(),
    ];
    let higher = [[50e3, 0.9, 255.0], [320e3, 35.2, 1000.0]];
    let above = words(&[
        "cantilever.k1=0.9 N/m",
        "cantilever.f0=50 kHz",
        "cantilever.Q=255",
        "cantilever.f2=320 kHz",
        "cantilever.Q2=1000",
        "cantilever.k2=35.2 N/m",
        "drive.second_frequency=320 kHz",
    ]);
    for (lever, stated) in [
        (&beam[..], &PUBLISHED),
        (&modes[..], &PUBLISHED),
        (&above[..], &higher),
    ] {
        let report = bimodal(lever, Loop::Am);
        let free = report.free[1];
        let expected = lag_at_second(stated);
        assert!((expected - 90.0).abs() < 0.1, "{expected}");
        assert!(
            (free.phase - expected).abs() < 1e-6,
            "{} {expected}",
            free.phase
        );
        let last = report.table[report.table.len() - 1];
        assert!((last.tones[0].amplitude - 9e-9).abs() < 1e-15);
    }
    // A phase-locked loop finds the resonance of the second mode, off by the first mode's tail alone.
    let locked = bimodal(&modes, Loop::Fm);
    assert!((locked.free[1].resonance / 306_194.0 - 1.0).abs() < 1e-6);
    // Other studies need a common period and say so.
    let mut all = modes.to_vec();
    all.push("drive.second_free_amplitude=1 nm".into());
    let error = OrbitStudy::run(
        &case(&all).unwrap(),
        &OrbitOptions::default(),
        &Control::default(),
    );
    let error = error.unwrap_err().to_string();
    assert!(error.contains("8789/1404"), "{error}");
}

/// Above 6.2669, k2 states the mode and no tip mass follows; without k2 one does, and f2 is met too.
#[test]
fn a_tip_mass_follows_from_f2_alone() {
    let lever = words(&[
        "cantilever.k=2 N/m",
        "cantilever.f0=75 kHz",
        "cantilever.Q=200",
        "cantilever.f2=489.139 kHz",
    ]);
    let alone = case(&lever).unwrap();
    let view = alone.physical().unwrap();
    assert!((view.lever.tip_mass_ratio - 0.1).abs() < 1e-5);
    assert!((modes_of(view)[1][0] / 489_139.0 - 1.0).abs() < 1e-12);
    let known = case(&[lever, words(&["cantilever.k2=80 N/m"])].concat()).unwrap();
    let view = known.physical().unwrap();
    assert_eq!(view.lever.tip_mass_ratio, 0.0);
    assert!((modes_of(view)[1][0] / 489_139.0 - 1.0).abs() < 1e-12);
    let said: Vec<String> = known
        .remarks()
        .into_iter()
        .map(|remark| remark.text)
        .collect();
    assert!(
        said.iter().any(|text| text.contains("no tip mass follows")),
        "{said:?}"
    );
}

/// A lever of two modes under a force of 1 nN at its tip on a Hertz contact, against scipy 1.14's DOP853
/// (relative tolerance 1e-12, 120 periods of 200 steps or more, q̈ + ω q̇/Q + ω² q = ω² F/k of each mode):
/// amplitude 16.16790322 nm, lag 47.9464671°, peak force 4.91863915 nN, mean force 0.338268871 nN.
#[test]
fn a_lever_of_two_modes_agrees_with_an_independent_integration() {
    let lever = [[50e3, 0.9, 20.0], [310e3, 30.0, 40.0]];
    let mut all = words(&[
        "sample.stiffness=",
        "sample.law=hertz",
        "sample.modulus=1 GPa",
        "sample.poisson=0.3",
        "sample.contact_distance=0.1 nm",
        "tip.radius=10 nm",
        "drive.actuation=tip",
        "drive.free_amplitude=",
        "drive.force=1 nN",
        "gap.tip=15 nm",
    ]);
    all.push(table(&lever));
    let case = case(&all).unwrap();
    assert_eq!(case.cantilever().unwrap().modes, 2);
    let found = orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap();
    let (seen, scales) = (&found.observables, &case.physical().unwrap().scales);
    let force = scales.force * 1e9;
    for (value, expected, tolerance) in [
        (
            seen.first_harmonic * scales.length * 1e9,
            16.167_903_220_282_34,
            1e-8,
        ),
        (seen.phase, 47.946_467_059_397_364, 1e-7),
        (seen.peak_force * force, 4.918_639_150_508_9, 1e-7),
        (seen.mean_force * force, 0.338_268_871_419_166, 1e-7),
    ] {
        assert!(
            (value / expected - 1.0).abs() < tolerance,
            "{value} {expected}"
        );
    }
}

/// Free amplitude and lag in closed form under every drive: of mode j with r = f/f_j the factor
/// 1/(1 − r² + i r/Q) times 1/k for a force at the tip, λ/k for one spread evenly with λ = ∫φ/φ(1), and
/// Γ (r² − i r/Q) for a base, with Γ as stated or φ(1) ∫φ/∫φ²: 1.5660, −0.8679 (Blevins).
#[test]
fn every_drive_has_its_closed_form() {
    let modes = [[48_913.0, 0.9, 25.0], [306_194.0, 35.2, 100.0]];
    // 2σ/β of the modes, σ = 0.7340955, 1.0184673, β = 1.8751041, 4.6940911, and φ(1) = ±2.
    let integral = [
        2.0 * 0.734_095_513_758_912_8 / 1.875_104_068_711_961_1,
        2.0 * 1.018_467_318_759_219_5 / 4.694_091_132_974_175,
    ];
    let tip = [2.0, -2.0];
    let stated = "cantilever.mode=[{f = \"48.913 kHz\", k = \"0.9 N/m\", Q = 25, participation = 1.7}, \
                  {f = \"306.194 kHz\", k = \"35.2 N/m\", Q = 100}]";
    let at: f64 = 60_123.0;
    let sum = |factor: &dyn Fn(usize, f64) -> Complex| -> Complex {
        (0..2)
            .map(|j| {
                let ratio = at / modes[j][0];
                factor(j, ratio) / Complex::new(1.0 - ratio * ratio, ratio / modes[j][2])
            })
            .sum()
    };
    let base = |gamma: [f64; 2]| {
        sum(&move |j, ratio| Complex::new(ratio * ratio, -ratio / modes[j][2]) * gamma[j])
    };
    let gamma = [0, 1].map(|j| tip[j] * integral[j]);
    let plain = table(&modes);
    for (words_of, response, unit) in [
        (
            ["drive.actuation=tip", "drive.force=1 nN", &plain],
            sum(&|j, _| (1.0 / modes[j][1]).into()),
            1e-9,
        ),
        (
            ["drive.actuation=distributed", "drive.force=1 nN", &plain],
            sum(&|j, _| (integral[j] / tip[j] / modes[j][1]).into()),
            1e-9,
        ),
        (
            ["drive.actuation=base", "drive.amplitude=1 nm", &plain],
            base(gamma),
            1e-9,
        ),
        (
            ["drive.actuation=base", "drive.amplitude=1 nm", stated],
            base([1.7, gamma[1]]),
            1e-9,
        ),
    ] {
        let mut all = words(&words_of);
        all.extend(words(&[
            "drive.free_amplitude=",
            "drive.frequency_ratio=",
            "drive.frequency=60.123 kHz",
        ]));
        let case = case(&all).unwrap();
        let view = case.physical().unwrap();
        let expected = response.re.hypot(response.im) * unit;
        let lag = -response.im.atan2(response.re).to_degrees();
        assert!(
            (view.free_amplitude / expected - 1.0).abs() < 1e-10,
            "{words_of:?}"
        );
        assert!((view.free_phase - lag).abs() < 1e-8, "{words_of:?}");
        // The same of the motion, whose energies balance.
        let found = orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap();
        let amplitude = found.observables.first_harmonic * view.scales.length;
        assert!((amplitude / expected - 1.0).abs() < 1e-9);
        let balance = found.observables.energy_balance;
        assert!(balance.residual.abs() < 1e-10, "{words_of:?}: {balance:?}");
    }
}

/// One mode is the beam of one mode with k1, f0 and Q, in every reading.
#[test]
fn one_measured_mode_is_a_beam_of_one_mode() {
    let sample = words(&[
        "gap.tip=8 nm",
        "sample.stiffness=5 N/m",
        "drive.actuation=tip",
    ]);
    let beam = words(&[
        "modes=1",
        "cantilever.k1=2 N/m",
        "cantilever.f0=70 kHz",
        "cantilever.Q=80",
    ]);
    let [beam, mode] = [beam, vec![table(&[[70e3, 2.0, 80.0]])]].map(|lever| {
        let case = case(&[sample.clone(), lever].concat()).unwrap();
        let seen = orbit(&case.model().unwrap(), &OrbitOptions::default())
            .unwrap()
            .observables;
        let scales = case.physical().unwrap().scales;
        [
            seen.first_harmonic * scales.length,
            seen.peak_force * scales.force,
            seen.phase,
        ]
    });
    for (beam, mode) in beam.iter().zip(&mode) {
        assert!((beam / mode - 1.0).abs() < 1e-9, "{beam} {mode}");
    }
}

/// ⟨W²⟩ = k_B T Σ1/k_j of measured modes, by equipartition.
#[test]
fn measured_modes_have_their_thermal_energy() {
    let mut all = words(&["drive.actuation=tip"]);
    all.push(table(&[
        [48_913.0, 0.9, 25.0],
        [306_194.0, 5.2, 100.0],
        [5e5, 3.0, 60.0],
    ]));
    let case = case(&all).unwrap();
    let options = NoiseOptions {
        time_constant: Some("1 ms".into()),
        ..NoiseOptions::default()
    };
    let rms = NoiseStudy::run(&case, &options, &Control::default())
        .unwrap()
        .thermal_rms;
    let expected = (BOLTZMANN * 295.0 * (1.0 / 0.9 + 1.0 / 5.2 + 1.0 / 3.0)).sqrt();
    assert!((rms / expected - 1.0).abs() < 1e-9, "{rms} {expected}");
    let options = ConvergenceOptions::default();
    let found = ConvergenceStudy::run(&case, &options, &Control::default()).unwrap();
    assert_eq!(found.modes, [1, 2, 3]);
}

/// The case is written and read back as it is, as quantities and as numbers of the equations.
#[test]
fn measured_modes_are_written_and_read_back() {
    let mut all = words(&["drive.actuation=tip"]);
    let mode = "cantilever.mode=[{f = \"48.913 kHz\", k = \"0.9 N/m\", Q = 255}, \
                {f = \"306.194 kHz\", k = \"35.2 N/m\", Q = 1002, participation = -0.8}]";
    all.push(mode.to_owned());
    let before = case(&all).unwrap();
    let text = before.to_toml();
    let again: Case = text.parse().unwrap();
    assert_eq!(again.cantilever(), before.cantilever(), "{text}");
    let dimensionless = nanotap::case::file::to_toml(before.cantilever().unwrap());
    let again: Case = dimensionless.parse().unwrap();
    assert_eq!(again.cantilever(), before.cantilever(), "{dimensionless}");
    // The tables of a file are the array of an override.
    let file = "[[cantilever.mode]]\nf = \"48.913 kHz\"\nk = \"0.9 N/m\"\nQ = 255\n\
                [[cantilever.mode]]\nf = \"306.194 kHz\"\nk = \"35.2 N/m\"\nQ = 1002\nparticipation = -0.8\n\
                [sample]\nstiffness = \"1 N/m\"\n[drive]\nactuation = \"tip\"\nfrequency_ratio = 1\n\
                free_amplitude = \"10 nm\"\n[gap]\ntip = \"1 um\"\n";
    let read: Case = file.parse().unwrap();
    assert_eq!(read.cantilever(), before.cantilever());
}

#[test]
fn a_lever_is_a_beam_or_modes_and_not_both() {
    let modes = table(&PUBLISHED);
    let refused = |more: &[&str]| case(&[vec![modes.clone()], words(more)].concat()).unwrap_err();
    for (more, message) in [
        (&["cantilever.k=2 N/m"][..], "either a beam"),
        (&["tip.mass_ratio=0.1"], "either a beam"),
        (&["cantilever.lever=PPP-NCHR"], "either a beam"),
        (&["cantilever.f2=300 kHz"], "either a beam"),
        (&["modes=3"], "at most 2"),
    ] {
        let error = refused(more);
        assert!(error.contains(message), "{more:?}: {error}");
    }
    let dimensionless = Cantilever {
        lever_modes: case(&[modes])
            .unwrap()
            .cantilever()
            .unwrap()
            .lever_modes
            .clone(),
        modes: 2,
        ..Cantilever::paper()
    };
    // α1 is 0.1 there.
    let error = Galerkin::new(&dimensionless).unwrap_err();
    assert_eq!(error.key, "alpha1");
}
