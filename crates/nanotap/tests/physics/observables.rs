//! Observables of a motion, compared with closed forms.

use nanotap_arithmetic::ComplexFunctions as _;
use std::f64::consts::TAU;

use nanotap::case::physical::free_response::free_response;
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap::observe::{ObservableSet, Spectrum, measure};
use nanotap::study::orbit::{OrbitOptions, OrbitReport, orbit};
use nanotap_dynamics::Complex;

/// The period-1 orbit of a case, and its model.
fn period_1(case: &Cantilever) -> (Model, OrbitReport) {
    let model = Model::cantilever(case).unwrap();
    let options = OrbitOptions {
        period: Some(1),
        ..OrbitOptions::default()
    };
    let found = orbit(&model, &options).unwrap();
    (model, found)
}

fn near(found: f64, expected: f64, relative: f64) {
    assert!(
        (found - expected).abs() <= relative * expected.abs(),
        "{found} instead of {expected}"
    );
}

/// Far from the sample, amplitude and phase are those of the closed form, below, at and above
/// resonance, with and without a tip mass.
#[test]
fn free_amplitude_and_phase_are_the_closed_form() {
    for alpha1 in [0.0, 0.1] {
        for omega in [1.0, 2.9, 3.0, 3.516, 4.0, 20.0, 23.0] {
            let case = Cantilever {
                alpha1,
                alpha3: 0.02,
                alpha5: 100.0,
                omega,
                ..Cantilever::paper()
            };
            let z = free_response(&case).unwrap();
            let (_, found) = period_1(&case);
            let o = &found.observables;
            near(o.first_harmonic, z.modulus() * case.alpha2, 1e-10);
            near(o.amplitude, o.first_harmonic, 1e-10);
            near(o.phase, -z.argument().to_degrees(), 1e-9);
            assert_eq!(
                (o.dissipation, o.virial, o.indentation, o.contact_time),
                (0.0, 0.0, 0.0, 0.0)
            );
        }
    }
}

/// A lever of high Q lags by 90° at its resonance. Driven through the base, the tip's mode is also
/// affected by the motion of the base, so that the lag differs from 90° by terms of order 1/Q.
#[test]
fn the_phase_is_90_degrees_at_the_free_resonance() {
    for q in [50.0, 200.0, 1000.0] {
        // β₁² of the bare beam.
        let omega = 3.516_015_268_5;
        let case = Cantilever {
            alpha1: 0.0,
            alpha3: omega / q,
            alpha5: 1000.0,
            omega,
            ..Cantilever::paper()
        };
        let (_, found) = period_1(&case);
        assert!(
            (found.observables.phase - 90.0).abs() < 60.0 / q,
            "{}",
            found.observables.phase
        );
    }
}

/// A tip in permanent contact moves linearly: force, virial and dissipation follow from the
/// amplitudes, F = −(α4 V + α6 V̇) with V = W + α2 sin Ωτ + α5.
#[test]
fn virial_and_dissipation_of_a_permanent_contact() {
    let case = Cantilever {
        alpha2: 0.01,
        alpha5: -1.0,
        omega: 5.0,
        ..Cantilever::paper()
    };
    let (model, found) = period_1(&case);
    let o = &found.observables;
    assert_eq!(o.contact_fraction, 1.0);
    near(o.contact_time, TAU / case.omega, 1e-12);
    let tip = found.trajectory.curve(&model.tip).fourier(case.omega);
    // α2 sin Ωτ = Re(−iα2 e^{iΩτ})
    let gap = tip + Complex::new(0.0, -case.alpha2);
    let force = -gap * Complex::new(case.alpha4, case.alpha6 * case.omega);
    let mean_force = -case.alpha4 * (o.mean_deflection + case.alpha5);
    near(o.mean_force, mean_force, 1e-12);
    near(o.contact_force.unwrap(), mean_force, 1e-12);
    near(
        o.virial,
        mean_force * o.mean_deflection + 0.5 * (force * tip.conj()).re,
        1e-11,
    );
    let power = 0.5 * case.alpha6 * (case.omega * gap.modulus()).powi(2);
    near(o.sample_power, power, 1e-11);
    near(o.dissipation, power * TAU / case.omega, 1e-11);
    near(
        o.indentation,
        gap.modulus() - case.alpha5 - o.mean_deflection,
        1e-11,
    );
    near(
        o.drive_power * TAU / case.omega,
        o.energy_balance.drive_work,
        1e-12,
    );
}

/// A beam on a moving base, at the Q of a lever in water, follows its differential equation: v''''
/// = β⁴ v with β⁴ = Ω² − iα3Ω, v = 1 and v' = 0 at the clamp, v'' = v''' = 0 at the tip, which
/// moves by (cos β + cosh β)/(1 + cos β cosh β) times the base. The deflection is that less the
/// base.
#[test]
fn the_tip_on_a_moving_base_moves_like_the_beam() {
    let resonance = 3.516_015_268_5;
    for (quality, omega) in [(3.35, resonance), (3.35, 1.0), (2.0, 9.0), (50.0, 2.6)] {
        let case = Cantilever {
            modes: 20,
            alpha1: 0.0,
            alpha3: resonance / quality,
            alpha5: 100.0,
            omega,
            ..Cantilever::paper()
        };
        let (_, found) = period_1(&case);
        let o = &found.observables;
        let squared = Complex::new(omega * omega, -case.alpha3 * omega).square_root();
        let beta = squared.square_root();
        let i = Complex::new(0.0, 1.0);
        let cosh = |z: Complex<f64>| (z.exponential() + (-z).exponential()) * 0.5;
        let (cos, cosh) = (cosh(i * beta), cosh(beta));
        let tip = (cos + cosh) / (1.0 + cos * cosh);
        near(o.tip_motion.unwrap(), tip.modulus() * case.alpha2, 1e-6);
        let lag = -tip.argument().to_degrees();
        assert!((o.tip_motion_phase.unwrap() - lag).abs() < 1e-4);
        let deflection = tip - 1.0;
        near(o.first_harmonic, deflection.modulus() * case.alpha2, 1e-6);
        assert!((o.phase + deflection.argument().to_degrees()).abs() < 1e-4);
    }
}

/// With the base at rest the tip's motion equals its deflection.
#[test]
fn tip_motion_equals_deflection_without_base_motion() {
    let case = Cantilever {
        actuation: nanotap::model::drive_form::Actuation::Tip,
        alpha5: 100.0,
        ..Cantilever::paper()
    };
    assert_eq!(period_1(&case).1.observables.tip_motion, None);
}

/// Dissipation in a damped contact with one mode on a moving base, from the deflection alone. At ω₀
/// the equation m z̈ + (mω₀/Q) ż + kz = F − γ(m ÿ + (mω₀/Q) ẏ), γ = φ(1)∫φ, times ż + ẏ gives E =
/// (πk/Q)(A₀A₁ sin φ' − Σn²Aₙ² − Y Re(z₁ − z₀)), with z₀ the free deflection, φ' the lag behind z₀
/// plus 90°, and Y the base's amplitude.
#[test]
fn dissipation_on_a_moving_base_from_the_deflection() {
    let resonance = 1.875_104_068_711_961_f64.powi(2);
    for quality in [2.0, 10.0] {
        let case = Cantilever {
            modes: 1,
            alpha1: 0.0,
            alpha2: 0.3,
            alpha3: resonance / quality,
            alpha4: 60.0,
            alpha5: 0.4,
            alpha6: 0.3,
            omega: resonance,
            ..Cantilever::paper()
        };
        let (model, found) = period_1(&case);
        let o = &found.observables;
        assert!(o.contact_fraction > 0.1, "{}", o.contact_fraction);
        let free = free_response(&case).unwrap();
        // The deflection is Im(z e^{iΩτ}), the base sin Ωτ.
        let lag = Complex::new(0.0, -o.phase.to_radians());
        let tip = lag.exponential() * o.first_harmonic;
        let free = Complex::new(free.re, free.im) * case.alpha2;
        let spectrum = Spectrum::of(&model, &found.trajectory, 1, 400);
        let squares = spectrum.harmonics.iter().map(|h| (h.order * h.tip).powi(2));
        let swing = (tip * free.conj()).re;
        let work = swing - squares.sum::<f64>() - case.alpha2 * (tip - free).re;
        let stiffness = 0.25 * resonance * resonance;
        let unit = std::f64::consts::PI * stiffness / quality;
        near(o.dissipation, unit * work, 1e-6);
        let energies = &o.energy_balance;
        let taken = energies.beam_damping + o.dissipation;
        near(energies.drive_work, taken, 1e-10);
    }
}

/// An optical lever is calibrated by a static force at the tip: for a beam bent in this way it
/// reads the deflection. Here the base moves so slowly that only the sample's force bends the beam.
#[test]
fn an_optical_lever_reads_a_static_deflection_correctly() {
    let case = Cantilever {
        modes: 40,
        alpha1: 0.0,
        alpha2: 0.01,
        alpha3: 0.001,
        alpha5: -1.0,
        omega: 0.01,
        ..Cantilever::paper()
    };
    let (_, found) = period_1(&case);
    let o = &found.observables;
    // The series of slopes ends with its 40th mode: Σ_{j>40} φφ'/β⁴ ≈ 4/(2π³·40²).
    near(o.optical_amplitude.unwrap(), o.first_harmonic, 1e-4);
    let phase = o.optical_phase.unwrap();
    let turn = (phase - o.phase).rem_euclid(360.0);
    assert!(turn.min(360.0 - turn) < 0.01, "{phase} {}", o.phase);
}

/// The work on the sample of a motion that does not close, less what the contact stores, is the loss
/// in its damping; without damping it is zero.
#[test]
fn a_recording_dissipates_what_the_damping_takes() {
    const PERIODS: usize = 3;
    let elastic = Cantilever {
        alpha6: 0.0,
        ..Cantilever::paper()
    };
    let laws = [
        elastic.clone(),
        Cantilever::paper(),
        elastic
            .clone()
            .on(ContactLaw::StandardLinearSolid, &[8.0, 0.05]),
        Cantilever::paper().on(ContactLaw::MovingSurface, &[60.0, 8.0, 0.4]),
    ];
    for case in laws {
        let model = Model::cantilever(&case).unwrap();
        let mut stores = false;
        for depth in [0.5, 0.2, -0.3] {
            let mut state = vec![0.0; model.dimension()];
            state[0] = -depth;
            let o = measure(&model, &state, PERIODS, ObservableSet::ALL).unwrap();
            let lost = o.dissipation * PERIODS as f64;
            let damping = o.energy_balance.sample_damping;
            assert!((lost - damping).abs() < 1e-10, "{lost} {damping}");
            assert!(case != elastic || o.dissipation == 0.0, "{}", o.dissipation);
            stores |= o.energy_balance.stored.abs() > 1e-3;
        }
        assert!(stores);
    }
}

/// The observables of a run over many blocks are those of one orbit.
#[test]
fn a_long_run_has_the_observables_of_its_orbit() {
    use nanotap::study::simulate::{SimulateOptions, simulate};
    let case = Cantilever {
        omega: 20.0,
        alpha1: 0.0,
        ..Cantilever::paper()
    };
    let model = Model::cantilever(&case).unwrap();
    let run = simulate(
        &model,
        &SimulateOptions {
            // More than one block of 512, a whole number of any period up to 4.
            periods: 1200,
            ..SimulateOptions::default()
        },
    )
    .unwrap();
    let orbit = orbit(&model, &OrbitOptions::default()).unwrap();
    let (a, b) = (&run.observables, &orbit.observables);
    near(a.first_harmonic, b.first_harmonic, 1e-9);
    near(a.phase, b.phase, 1e-9);
    near(a.virial, b.virial, 1e-9);
    near(a.dissipation, b.dissipation, 1e-9);
    near(a.contact_time, b.contact_time, 1e-9);
    near(
        a.optical_amplitude.unwrap(),
        b.optical_amplitude.unwrap(),
        1e-9,
    );
}
