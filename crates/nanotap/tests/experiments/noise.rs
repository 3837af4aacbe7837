//! Thermal noise against closed forms of the free lever, another engine, and a long stochastic
//! simulation.

use std::f64::consts::TAU;

use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::model::galerkin::Galerkin;
use nanotap::study::Study as _;
use nanotap::study::attractors::{AttractorsOptions, AttractorsStudy};
use nanotap::study::noise::{BOLTZMANN, NoiseOptions, NoiseReport, NoiseStudy};
use nanotap::study::setpoint::at_setpoint;
use nanotap_dynamics::random::Random;
use nanotap_flow::Flow;

/// A lever of 2 N/m at 70 kHz, driven by a force at its tip, with further words.
fn lever(words: &[&str]) -> Case {
    let mut all = vec![
        "cantilever.k=2 N/m",
        "cantilever.f0=70 kHz",
        "drive.actuation=tip",
        "drive.frequency_ratio=1",
        "drive.free_amplitude=10 nm",
    ];
    all.extend(words);
    let words: Vec<String> = all.iter().map(|word| (*word).to_owned()).collect();
    Case::parse(None, &words).unwrap()
}

fn noise(case: &Case, time_constant: &str) -> NoiseReport {
    let options = NoiseOptions {
        time_constant: Some(time_constant.into()),
        ..NoiseOptions::default()
    };
    NoiseStudy::run(case, &options, &Control::default()).unwrap()
}

/// √(k_B T Σ 1/kᵢ), where the modes together are stiffer than the beam by a known part: their
/// static compliance is Σ 1/kᵢ.
#[test]
fn the_undriven_tip_moves_by_equipartition() {
    for (modes, together) in [(1, 1.030_197), (3, 1.001_446)] {
        let case = lever(&[
            &format!("modes={modes}"),
            "cantilever.Q=100",
            "sample.stiffness=1 N/m",
            "gap.tip=1 um",
        ]);
        let rms = noise(&case, "1 ms").thermal_rms;
        let expected = (BOLTZMANN * 295.0 / (2.0 * together)).sqrt();
        assert!(
            (rms / expected - 1.0).abs() < 2e-4,
            "{modes}: {rms} {expected}"
        );
    }
}

/// At resonance, behind a first-order filter of time constant τ, the amplitude of one mode has the
/// rms √(k_B T/k₁ · t_c/(t_c + τ)) with t_c = 2Q/ω, and so has the phase times the amplitude; both
/// up to 1/Q.
#[test]
fn the_free_lever_has_the_noise_of_its_resonance() {
    for (quality, time) in [(100.0, 2e-4), (400.0, 1e-3), (2000.0, 1e-2)] {
        let case = lever(&[
            "modes=1",
            &format!("cantilever.Q={quality}"),
            "sample.stiffness=1 N/m",
            "gap.tip=1 um",
        ]);
        let found = noise(&case, &format!("{time} s"));
        let correlation = 2.0 * quality / (TAU * 70e3);
        let stiffness = 2.0 * 1.030_197;
        let expected = (BOLTZMANN * 295.0 / stiffness * correlation / (correlation + time)).sqrt();
        let off = found.amplitude_rms / expected - 1.0;
        assert!(off.abs() < 2.0 / quality + 1e-4, "{quality}, {time}: {off}");
        let turned = found.phase_rms.to_radians() * found.amplitude;
        assert!(
            (turned / expected - 1.0).abs() < 2.0 / quality + 1e-4,
            "{turned} {expected}"
        );
        // Far from the sample the orbit is the free motion.
        assert!((found.free_amplitude_rms / found.amplitude_rms - 1.0).abs() < 1e-6);
        // Albrecht et al., J. Appl. Phys. 69, 668 (1991).
        let square = BOLTZMANN * 295.0 * 70e3 * found.bandwidth
            / (std::f64::consts::PI * stiffness * quality);
        let frequency = square.sqrt() / 10e-9;
        let off = found.free_frequency_rms / frequency - 1.0;
        assert!(off.abs() < 2.0 / quality + 1e-3, "{quality}: {off}");
        // Loops that hold the amplitude too change nothing of a linear lever.
        let held = found.frequency_rms / found.free_frequency_rms - 1.0;
        assert!(held.abs() < 1e-3, "{quality}: {held}");
        // A gradient κ turns the phase at resonance by Q κ/k₁.
        let gradient = stiffness / quality * found.free_phase_rms.to_radians();
        assert!((found.force_gradient_min / gradient - 1.0).abs() < 1e-3);
    }
}

/// The phase of a lever that is held at 90° and at its amplitude turns with the noise force across
/// its motion whatever the sample does: Albrecht's noise at this amplitude. The slow thermal
/// deflection, of density 4 k_B T/(k ω Q), adds its square times that of the shift's slope, which over
/// the punch is (1.5 · 200 Hz/0.247 nm)²: 3 % of the noise. At a drive that is not held, a lock-in
/// amplifier reads six times the phase noise of the free lever there.
#[test]
fn frequency_modulation_has_the_noise_of_its_amplitude_over_any_sample() {
    let linear = [
        "sample.stiffness=5 N/m",
        "sample.loss_tangent=0.1",
        "drive.setpoint=200 Hz",
    ];
    let dmt = [
        "sample.law=dmt",
        "sample.modulus=1 GPa",
        "sample.hamaker=2e-19 J",
        "tip.radius=20 nm",
        "drive.setpoint=-60 Hz",
    ];
    let quality = 200.0;
    for sample in [linear.as_slice(), &dmt] {
        let quality_factor = format!("cantilever.Q={quality}");
        let case = lever(&[&["modes=1", &quality_factor], sample].concat());
        let (case, _) = at_setpoint(case, &Control::default()).unwrap();
        let found = noise(&case, "1 ms");
        assert!((found.phase - 90.0).abs() < 0.1, "{}", found.phase);
        let square = BOLTZMANN * 295.0 * found.frequency * found.bandwidth
            / (std::f64::consts::PI * 2.0 * 1.030_197 * quality);
        let expected = square.sqrt() / found.amplitude;
        let off = found.frequency_rms / expected - 1.0;
        assert!((-2.0 / quality..0.05).contains(&off), "{off}");
    }
}

/// A flat punch on an elastic half-space is a spring: the engine of nonlinear laws agrees with the
/// exact one, tapping included.
#[test]
fn both_engines_have_the_same_noise() {
    let shared = ["modes=2", "cantilever.Q=50"];
    let spring = lever(
        &[
            &shared[..],
            &[
                "sample.stiffness=8 N/m",
                "sample.damping=0 N s/m",
                "gap.tip=8 nm",
            ],
        ]
        .concat(),
    );
    // F = 2 R E/(1 − ν²) δ with R = 4 nm and E/(1 − ν²) = 1 GPa.
    let punch = lever(
        &[
            &shared[..],
            &[
                "sample.law=punch",
                "tip.radius=4 nm",
                "sample.modulus=1 GPa",
                "sample.poisson=0",
                // Contact begins at this gap.
                "sample.contact_distance=0.1 nm",
                "gap.tip=8.1 nm",
            ],
        ]
        .concat(),
    );
    let (a, b) = (noise(&spring, "0.1 ms"), noise(&punch, "0.1 ms"));
    assert!(
        (a.amplitude / b.amplitude - 1.0).abs() < 1e-9,
        "{a:?} {b:?}"
    );
    assert!(a.amplitude < 9.5e-9, "it taps");
    for (one, other) in [
        (a.amplitude_rms, b.amplitude_rms),
        (a.phase_rms, b.phase_rms),
    ] {
        assert!((one / other - 1.0).abs() < 1e-5, "{one} {other}");
    }
}

/// The integral of a spectrum is the square of the noise, and the free lever's has its Lorentzian
/// behind the filter: 4 σ² t_c/((1 + (2π f t_c)²)(1 + (2π f τ)²)) with σ² = k_B T/k₁.
#[test]
fn spectra_of_the_reading_are_those_of_its_noise() {
    let tapping = lever(&[
        "modes=1",
        "cantilever.Q=30",
        "sample.stiffness=5 N/m",
        "sample.loss_tangent=0.1",
        "gap.tip=8 nm",
    ]);
    let free = lever(&[
        "modes=1",
        "cantilever.Q=1000",
        "sample.stiffness=1 N/m",
        "gap.tip=1 um",
    ]);
    for case in [&tapping, &free] {
        let found = noise(case, "0.2 ms");
        let spectrum = &found.reading_spectrum;
        let integral = |density: &[f64]| -> f64 {
            let f = &spectrum.frequency;
            let parts =
                (1..f.len()).map(|k| 0.5 * (f[k] - f[k - 1]) * (density[k] + density[k - 1]));
            parts.sum::<f64>() + f[0] * density[0]
        };
        for (density, rms) in [
            (&spectrum.amplitude, found.amplitude_rms),
            (&spectrum.phase, found.phase_rms),
        ] {
            let off = integral(density) / (rms * rms) - 1.0;
            assert!(off.abs() < 5e-3, "{off}");
        }
    }
    let found = noise(&free, "0.2 ms");
    let correlation = 2.0 * 1000.0 / (TAU * 70e3);
    let square = BOLTZMANN * 295.0 / (2.0 * 1.030_197);
    let spectrum = &found.reading_spectrum;
    for (f, density) in spectrum.frequency.iter().zip(&spectrum.amplitude) {
        let (a, b) = (TAU * f * correlation, TAU * f * 2e-4);
        let expected = 4.0 * square * correlation / ((1.0 + a * a) * (1.0 + b * b));
        // Further out the readings, once a period, alias.
        if *f < 7e3 {
            assert!(
                (density / expected - 1.0).abs() < 0.03,
                "{f}: {density} {expected}"
            );
        }
    }
}

/// At a distance d from a fold the saddle is √d away, and disturbances decay and grow at a rate √d, so
/// that the standard deviation of the noise goes as d^(−1/4): the boundary is d^(3/4) standard
/// deviations away (Dykman and Krivoglaz, Physica A 104, 480, 1980). At any distance it is in proportion to
/// 1/√T.
#[test]
fn the_saddle_comes_nearer_as_towards_a_fold() {
    // The tapping state of this lever ends at 14.073965664877789 nm (fold of `nanotap approach`).
    let words = |gap: f64| {
        let gap = format!("gap.tip={gap} nm");
        lever(&[
            "modes=1",
            "cantilever.Q=100",
            "sample.stiffness=8 N/m",
            "sample.damping=0 N s/m",
            "drive.frequency_ratio=1.01",
            "drive.free_amplitude=6.6 nm",
            &gap,
        ])
    };
    let fold = 14.073_965_664_877_79;
    let of = |gap: f64, temperature: f64| {
        let case = words(gap);
        let census = AttractorsOptions::default();
        let found = AttractorsStudy::run(&case, &census, &Control::default()).unwrap();
        let orbits = found
            .attractors
            .iter()
            .filter_map(|found| found.orbit.as_ref());
        let tapping = orbits.max_by(|a, b| {
            let [a, b] = [a, b].map(|orbit| orbit.observables.first_harmonic);
            a.total_cmp(&b)
        });
        let options = NoiseOptions {
            temperature,
            state: Some(tapping.unwrap().state.clone().into()),
            ..NoiseOptions::default()
        };
        let found = NoiseStudy::run(&case, &options, &Control::default()).unwrap();
        assert!(found.amplitude > 1.4e-8);
        found.saddle.unwrap().deviations
    };
    let [near, middle, far] = [1e-6, 4e-6, 1.6e-5].map(|d| of(fold - d, 295.0));
    let order = |a: f64, b: f64| (b / a).ln() / 4f64.ln();
    assert!((order(near, middle) - 0.75).abs() < 0.01, "{near} {middle}");
    assert!((order(middle, far) - 0.75).abs() < 0.02, "{middle} {far}");
    let cold = of(fold - 4e-6, 73.75);
    assert!((cold / middle - 2.0).abs() < 1e-9, "{cold} {middle}");
}

/// The lever is followed with random kicks on its velocities, and its lock-in amplifier with it.
#[test]
fn a_stochastic_simulation_agrees_within_its_error_bars() {
    const PERIODS: usize = 1_000_000;
    const KICKS: usize = 32;
    let case = lever(&[
        "modes=1",
        "cantilever.Q=30",
        "sample.stiffness=5 N/m",
        "sample.loss_tangent=0.1",
        "gap.tip=8 nm",
    ]);
    let time_constant = 2e-4;
    let expected = noise(&case, "0.2 ms");
    let scales = case.physical().unwrap().scales;
    let model = case.model().unwrap();
    let equations = Galerkin::new(case.cantilever().unwrap()).unwrap();
    let (period, omega) = (model.period(), model.frequency());
    let h = period / KICKS as f64;
    let tau = time_constant / scales.time;
    let energy = BOLTZMANN * 295.0 / scales.energy;
    let kick = (2.0 * energy * equations.damping[0][(0, 0)] * h).sqrt() / equations.mass[(0, 0)];
    let mut random = Random::new(7);
    let mut flow = Flow::new(model.system.clone());
    let mut state =
        nanotap::study::orbit::orbit(&model, &nanotap::study::orbit::OrbitOptions::default())
            .unwrap()
            .state;
    let (mut re, mut im) = (0.0_f64, 0.0_f64);
    let fade = (-h / tau).exp();
    let mut read = Vec::with_capacity(PERIODS);
    let tip = model.tip.row[0];
    for _ in 0..PERIODS {
        for k in 0..KICKS {
            flow.start(&state, k as f64 * h).unwrap();
            if k + 1 < KICKS {
                flow.run_until((k + 1) as f64 * h, &mut ()).unwrap();
            } else {
                flow.run_period(&mut ()).unwrap();
            }
            flow.state(&mut state);
            state[1] += kick * random.normal();
            let (sin, cos) = (omega * (k + 1) as f64 * h).sin_cos();
            let signal = 2.0 * h / tau * tip * state[0];
            re = re * fade + signal * cos;
            im = im * fade - signal * sin;
        }
        read.push((re.hypot(im), im.atan2(re)));
    }
    // The beginning, before the filter has settled, does not count.
    let settled = &read[(20.0 * tau / period) as usize..];
    let deviation = |of: &dyn Fn(&(f64, f64)) -> f64| {
        let n = settled.len() as f64;
        let mean = settled.iter().map(of).sum::<f64>() / n;
        (settled.iter().map(|x| (of(x) - mean).powi(2)).sum::<f64>() / n).sqrt()
    };
    let amplitude = deviation(&|x| x.0) * scales.length;
    let phase = deviation(&|x| x.1).to_degrees();
    // Independent readings are a few correlation times of filter and lever apart.
    let correlation = 2.0 * (tau + 60.0 / omega) / period;
    let error = (0.5 * correlation / settled.len() as f64).sqrt();
    for (found, expected) in [
        (amplitude, expected.amplitude_rms),
        (phase, expected.phase_rms),
    ] {
        let off = (found / expected - 1.0) / error;
        assert!(
            off.abs() < 4.0,
            "{found} {expected}: {off} standard errors of {error}"
        );
    }
}

#[test]
fn what_has_no_noise_is_refused_by_name() {
    let refused = |case: &Case, options: NoiseOptions, words: &str| {
        let error = NoiseStudy::run(case, &options, &Control::default()).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
    };
    let plain = Case::from(nanotap::model::cantilever::Cantilever::paper());
    refused(&plain, NoiseOptions::default(), "no unit of energy");
    let case = lever(&[
        "modes=1",
        "cantilever.Q=100",
        "sample.stiffness=1 N/m",
        "gap.tip=1 um",
    ]);
    for (time, bandwidth, words) in [
        (Some("1 ms"), Some("1 kHz"), "both given"),
        (Some("0 s"), None, "above zero"),
        (Some("1 kHz"), None, "expected a time"),
        (None, Some("-1 Hz"), "above zero"),
    ] {
        let options = NoiseOptions {
            time_constant: time.map(Into::into),
            bandwidth: bandwidth.map(Into::into),
            ..NoiseOptions::default()
        };
        refused(&case, options, words);
    }
    let hot = NoiseOptions {
        temperature: f64::NAN,
        ..NoiseOptions::default()
    };
    refused(&case, hot, "temperature");
}

/// The thermal spectrum of the free lever adds up to the mean square of equipartition.
#[test]
fn the_spectrum_adds_up_to_the_thermal_motion() {
    let case = lever(&[
        "modes=2",
        "cantilever.Q=50",
        "sample.stiffness=1 N/m",
        "gap.tip=1 um",
    ]);
    let found = noise(&case, "1 ms");
    let points = found.spectrum.frequency.iter().zip(&found.spectrum.density);
    let points: Vec<(f64, f64)> = points.map(|(f, d)| (*f, *d)).collect();
    let sum: f64 = points
        .windows(2)
        .map(|pair| 0.5 * (pair[1].0 - pair[0].0) * (pair[0].1 + pair[1].1))
        .sum();
    let ratio = sum / found.thermal_rms.powi(2);
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
}

/// The thermal method with the factor 0.817 (Butt and Jaschke 1995) gives the spring constant back;
/// so does Sader's method for a lever whose f0 and Q are those that its own theory gives in air.
#[test]
fn calibrations_give_the_spring_constant_back() {
    let dimensions = [
        "cantilever.length=225 um",
        "cantilever.width=30 um",
        "cantilever.thickness=3 um",
    ];
    let air = [
        "cantilever.fluid_density=1.18 kg/m3",
        "cantilever.fluid_viscosity=1.86e-5 Pa s",
    ];
    let mut words = vec![
        "modes=1",
        "cantilever.k=2 N/m",
        "cantilever.f0=70 kHz",
        "drive.actuation=tip",
        "drive.frequency_ratio=1",
        "drive.free_amplitude=10 nm",
        "sample.stiffness=1 N/m",
        "gap.tip=1 um",
    ];
    words.extend(dimensions);
    let all: Vec<String> = words
        .iter()
        .chain(&air)
        .map(|word| (*word).to_owned())
        .collect();
    let in_air = Case::parse(None, &all).unwrap();
    let theory = in_air.physical().unwrap().lever;
    words.retain(|word| !word.starts_with("cantilever.f0"));
    let (f0, quality) = (
        format!("cantilever.f0={} Hz", theory.f0),
        format!("cantilever.Q={}", theory.quality_factor),
    );
    words.extend([f0.as_str(), quality.as_str()]);
    let all: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
    let case = Case::parse(None, &all).unwrap();
    let found = noise(&case, "1 ms").calibrations.unwrap();
    assert!((found.thermal / 2.0 - 1.0).abs() < 3e-3, "{found:?}");
    let sader = found.sader.unwrap();
    assert!((sader / 2.0 - 1.0).abs() < 5e-3, "{found:?}");
}
