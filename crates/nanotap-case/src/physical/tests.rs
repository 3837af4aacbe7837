//! Physics of the mapping against closed forms and independent computations, and worked cases.

use nanotap_arithmetic::ComplexFunctions as _;
use std::f64::consts::TAU;

use proptest::prelude::*;

use super::free_response::free_response;
use super::sample::{Elastic, Hertz, reduced_modulus};
use super::tip::{TipMass, TipShape};
use super::*;
use crate::Case;
use crate::file::{CaseFileError, Place};
use crate::key::{Key, Section};
use nanotap_model::beam::Modes;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::exact_beam;
use nanotap_model::galerkin::Galerkin;
use nanotap_model::parameter::{Numbers, Parameter};

/// A case that was read, with what was remarked.
#[derive(Debug)]
struct Read {
    view: Physical,
    remarks: Vec<Remark>,
}

impl std::ops::Deref for Read {
    type Target = Physical;

    fn deref(&self) -> &Physical {
        &self.view
    }
}

/// The case of these entries, with so many modes.
fn with_modes(modes: usize, entries: &[(&str, &str, &str)]) -> Result<Read, CaseFileError> {
    let entry = |(section, key, value): &(&str, &str, &str)| format!("{section}.{key}={value}");
    let mut words: Vec<String> = entries.iter().map(entry).collect();
    words.push(format!("modes={modes}"));
    let case = Case::parse(None, &words)?;
    Ok(Read {
        view: case.physical().unwrap().clone(),
        remarks: case.remarks(),
    })
}

fn resolve(entries: &[(&str, &str, &str)]) -> Result<Read, CaseFileError> {
    with_modes(5, entries)
}

/// The key that a refusal is about; of an unknown one, as it was set.
fn key_of(error: &CaseFileError) -> Option<&str> {
    let problem = &error.problems[0];
    let set = || match &problem.place {
        Place::Override(written) => Some(written.split_once('=')?.0),
        _ => None,
    };
    problem.key.or_else(set)
}

/// A complete case with a few entries replaced or added; an empty value removes a key.
fn changed(changes: &[(&'static str, &'static str, &'static str)]) -> Vec<Entry> {
    let mut entries = vec![
        ("cantilever", "k", "2.8 N/m"),
        ("cantilever", "f0", "75 kHz"),
        ("cantilever", "Q", "200"),
        ("tip", "mass", "3 ng"),
        ("sample", "stiffness", "20 N/m"),
        ("sample", "damping", "1e-7 N s/m"),
        ("drive", "frequency", "65.7 kHz"),
        ("drive", "amplitude", "10 nm"),
        ("gap", "tip", "0 nm"),
        ("gap", "beam", "12 um"),
    ];
    for &(section, key, value) in changes {
        entries.retain(|entry| (entry.0, entry.1) != (section, key));
        if !value.is_empty() {
            entries.push((section, key, value));
        }
    }
    entries
}

type Entry = (&'static str, &'static str, &'static str);

const SILICON_BEAM: BeamGeometry = BeamGeometry {
    length: 225e-6,
    width: 28e-6,
    thickness: 3e-6,
};

fn data(tip_mass: TipMass) -> LeverData {
    LeverData {
        k1: None,
        k: Some(2.8),
        f0: Some(75e3),
        quality_factor: Some(200.0),
        fluid: None,
        geometry: None,
        modulus: None,
        density: None,
        tip_mass,
        length: None,
        modes: 3,
    }
}

fn lever(data: &LeverData) -> Lever {
    Lever::resolve(data).unwrap()
}

fn close(value: f64, expected: f64, tolerance: f64) {
    assert!(
        (value / expected - 1.0).abs() <= tolerance,
        "{value} instead of {expected}"
    );
}

#[test]
fn a_bare_beam_from_its_dimensions_has_euler_bernoullis_frequency() {
    let (modulus, density) = (169e9, 2330.0);
    let lever = lever(&LeverData {
        k: None,
        f0: None,
        geometry: Some(SILICON_BEAM),
        modulus: Some(modulus),
        density: Some(density),
        ..data(TipMass::Absolute(0.0))
    });
    let BeamGeometry {
        length,
        width,
        thickness,
    } = SILICON_BEAM;
    let inertia = width * thickness.powi(3) / 12.0;
    close(lever.k, 3.0 * modulus * inertia / length.powi(3), 1e-14);
    // f = β₁²/(2π) √(EI/(mL⁴)) with β₁ = 1.875104068711961.
    let per_length = density * width * thickness;
    let root = (modulus * inertia / (per_length * length.powi(4))).sqrt();
    close(
        lever.f0,
        1.875_104_068_711_961_f64.powi(2) / TAU * root,
        1e-14,
    );
    close(lever.time_unit(), root.recip(), 1e-14);
    // α3 = ω01/Q for the bare beam.
    close(
        lever.damping(),
        1.875_104_068_711_961_f64.powi(2) / 200.0,
        1e-13,
    );
}

#[test]
fn every_two_of_stiffness_resonance_and_mass_give_the_same_lever() {
    for tip in [TipMass::Absolute(3e-12), TipMass::Ratio(0.2)] {
        let from_box = lever(&data(tip));
        // A density that makes the same beam mass.
        let density = from_box.beam_mass / SILICON_BEAM.mass(1.0);
        let modulus = from_box.k / SILICON_BEAM.stiffness(1.0);
        let geometry = Some(SILICON_BEAM);
        for (k, f0, modulus) in [
            (Some(2.8), None, None),
            (None, Some(75e3), None),
            (None, None, Some(modulus)),
            (None, Some(75e3), Some(modulus)),
        ] {
            let other = lever(&LeverData {
                k,
                f0,
                modulus,
                geometry,
                density: Some(density),
                ..data(tip)
            });
            close(other.k, 2.8, 1e-12);
            close(other.f0, 75e3, 1e-12);
            close(other.beam_mass, from_box.beam_mass, 1e-12);
            close(other.tip_mass_ratio, from_box.tip_mass_ratio, 1e-11);
        }
    }
}

#[test]
fn tip_mass_comes_back_from_the_second_mode_and_from_the_mass() {
    for ratio in [0.0, 1e-4, 0.01, 0.1, 0.5, 3.0, 100.0] {
        let by_ratio = lever(&data(TipMass::Ratio(ratio)));
        let spectrum = exact_beam::frequencies(ratio, 0.0, 2).unwrap();
        let by_spectrum = lever(&data(TipMass::SecondMode(
            75e3 * spectrum[1] / spectrum[0] * (1.0 + 4.0 * f64::EPSILON),
        )));
        // f₂/f₁ starts as 6.2669(1 + 7α1²): rounding by ε there costs ε/(14α1).
        let tolerance = (1e-14 / ratio.max(1e-7)).max(1e-12 * (1.0 + ratio * ratio));
        assert!(
            (by_spectrum.tip_mass_ratio - ratio).abs() <= tolerance,
            "{} instead of {ratio}",
            by_spectrum.tip_mass_ratio
        );
        let by_mass = lever(&data(TipMass::Absolute(by_ratio.tip_mass())));
        assert!((by_mass.tip_mass_ratio - ratio).abs() <= 1e-13 * (1.0 + ratio * ratio));
        // Of the exact beam, but for three modes that stand for it: from above (Rayleigh and Ritz).
        let excess = by_mass.first_frequency() / spectrum[0] - 1.0;
        assert!((-1e-14..4e-3).contains(&excess), "{ratio}: {excess}");
    }
}

#[test]
fn impossible_levers_are_refused_with_the_possible_range() {
    let refusal = |data: &LeverData| Lever::resolve(data).unwrap_err().to_string();
    // Below the bare beam's 22.0345/3.51602 = 6.2669.
    let low = refusal(&data(TipMass::SecondMode(6.2 * 75e3)));
    assert!(low.starts_with("cantilever.f2 = 465 kHz (f2/f1 = 6.2): ") && low.contains("6.2669"));
    assert!(refusal(&data(TipMass::SecondMode(1e12))).contains("6.2669"));
    // k/ω₀² = 2.8/(2π 75e3)² kg = 12.61 ng carried by a massless beam, which three modes of the
    // bare one, with Σ4/ω_j² = 0.99984/3, make 1.0002 times as stiff.
    let heavy = refusal(&data(TipMass::Absolute(13e-12)));
    assert!(
        heavy.starts_with("tip.mass = 13 ng") && heavy.contains("12.61 ng"),
        "{heavy}"
    );
    assert!(Lever::resolve(&data(TipMass::Absolute(12e-12))).is_ok());
    for bad in [
        LeverData {
            k: Some(-2.8),
            ..data(TipMass::Ratio(0.0))
        },
        LeverData {
            k: Some(f64::NAN),
            ..data(TipMass::Ratio(0.0))
        },
        LeverData {
            k: None,
            ..data(TipMass::Ratio(0.0))
        },
        LeverData {
            f0: Some(0.0),
            ..data(TipMass::Ratio(0.0))
        },
        LeverData {
            f0: None,
            ..data(TipMass::Ratio(0.0))
        },
        LeverData {
            quality_factor: Some(0.0),
            ..data(TipMass::Ratio(0.0))
        },
        LeverData {
            quality_factor: Some(f64::INFINITY),
            ..data(TipMass::Ratio(0.0))
        },
        data(TipMass::Ratio(-0.1)),
        data(TipMass::Ratio(f64::NAN)),
        data(TipMass::Absolute(-1e-12)),
    ] {
        assert!(Lever::resolve(&bad).is_err(), "{bad:?}");
    }
}

/// Frequency and Q as an experimenter reads them off the free resonance near `guess`: the peak, and
/// its frequency over its width at 1/√2 of the height, of the simulated response.
fn resonance(case: &Cantilever, guess: f64) -> (f64, f64) {
    let gain = |omega: f64| {
        free_response(&Cantilever {
            omega,
            ..case.clone()
        })
        .unwrap()
        .modulus()
    };
    let (mut low, mut high) = (0.97 * guess, 1.03 * guess);
    while high - low > 1e-9 * guess {
        let third = (high - low) / 3.0;
        if gain(low + third) < gain(high - third) {
            low += third;
        } else {
            high -= third;
        }
    }
    let peak = low;
    let level = gain(peak) / 2.0_f64.sqrt();
    let edge = |mut inside: f64, mut outside: f64| {
        for _ in 0..60 {
            let middle = 0.5 * (inside + outside);
            if gain(middle) > level {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    };
    let width = edge(peak, 1.2 * peak) - edge(peak, 0.8 * peak);
    (peak, peak / width)
}

#[test]
fn the_model_resonates_at_f0_with_the_quality_factor_asked_for() {
    for modes in [1, 2, 3, 20] {
        for ratio in [0.0, 0.1, 1.0] {
            let quality_factor = 300.0;
            let lever = lever(&LeverData {
                quality_factor: Some(quality_factor),
                modes,
                ..data(TipMass::Ratio(ratio))
            });
            let case = Cantilever {
                modes,
                alpha1: ratio,
                alpha3: lever.damping(),
                alpha4: 0.0,
                ..Cantilever::paper()
            };
            let (peak, quality) = resonance(&case, lever.first_frequency());
            // The peak's height lies 1/(4Q²) below f0 or, driven at the base, above it.
            close(peak / (TAU * lever.time_unit()), 75e3, 1e-5);
            close(quality, quality_factor, 2e-3);
        }
    }
}

/// At f0 the lever lags by 90°, whatever the number of modes: what the higher modes add to a motion
/// of Q = 400 is below 0.1°. The case is that of a heavy tip found detuned, 45° at one mode.
#[test]
fn a_lever_with_a_tip_lags_by_a_quarter_at_its_resonance() {
    for modes in [1, 2, 3, 5, 10, 20] {
        for ratio in [0.0, 0.01, 0.1, 1.0] {
            let ratio = ratio.to_string();
            let view = with_modes(
                modes,
                &[
                    ("cantilever", "k", "40 N/m"),
                    ("cantilever", "f0", "300 kHz"),
                    ("cantilever", "Q", "400"),
                    ("tip", "mass_ratio", &ratio),
                    ("tip", "radius", "10 nm"),
                    ("sample", "law", "hertz"),
                    ("sample", "modulus", "1 GPa"),
                    ("drive", "actuation", "tip"),
                    ("drive", "frequency_ratio", "1"),
                    ("drive", "free_amplitude", "20 nm"),
                    ("gap", "tip", "40 nm"),
                ],
            );
            let view = view.unwrap();
            assert!(
                (view.free_phase - 90.0).abs() < 0.1,
                "{modes}, {ratio}: {}",
                view.free_phase
            );
            assert_eq!(view.free_amplitude, 20e-9);
        }
    }
}

#[test]
fn damping_with_a_tip_agrees_with_the_mode_shape_integrated() {
    for ratio in [0.01, 0.1, 1.0, 50.0] {
        let lever = lever(&LeverData {
            modes: 50,
            ..data(TipMass::Ratio(ratio))
        });
        let omega = exact_beam::frequencies(ratio, 0.0, 1).unwrap()[0];
        let beta = omega.sqrt();
        let sigma = (beta.cosh() + beta.cos()) / (beta.sinh() + beta.sin());
        let shape = |x: f64| {
            let z = beta * x;
            z.cosh() - z.cos() - sigma * (z.sinh() - z.sin())
        };
        // Simpson's rule, 400 intervals.
        let h = 1.0 / 400.0;
        let square: f64 = (0..=400)
            .map(|i| {
                let weight = match i {
                    0 | 400 => 1.0,
                    i if i % 2 == 1 => 4.0,
                    _ => 2.0,
                };
                weight * h / 3.0 * shape(f64::from(i) * h).powi(2)
            })
            .sum();
        let factor = 1.0 + ratio * shape(1.0).powi(2) / square;
        // Fifty modes leave 2e-6 of the exact beam's.
        close(lever.damping(), omega * factor / 200.0, 1e-5);
    }
    // A heavy tip bends the beam statically, ∫φ² = (33/140) φ(1)².
    let heavy = lever(&LeverData {
        modes: 50,
        ..data(TipMass::Ratio(1e5))
    });
    let factor = heavy.damping() * 200.0 / heavy.first_frequency();
    close(factor, 1.0 + 1e5 * 140.0 / 33.0, 1e-4);
}

#[test]
fn units_are_those_of_the_beam_equation() {
    let (modulus, density) = (169e9, 2330.0);
    let lever = lever(&LeverData {
        k: None,
        f0: None,
        geometry: Some(SILICON_BEAM),
        modulus: Some(modulus),
        density: Some(density),
        ..data(TipMass::Absolute(3e-12))
    });
    let gap = 12e-6;
    let scales = Scales::new(&lever, gap);
    let length = SILICON_BEAM.length;
    let m = density * SILICON_BEAM.width * SILICON_BEAM.thickness;
    let ei = modulus * SILICON_BEAM.width * SILICON_BEAM.thickness.powi(3) / 12.0;
    let values = [3e-12, 5e-9, 2e-8, 17.0, 20e-9, 3e-7, 65.7e3];
    let all = Parameter::ALL.into_iter().zip(values);
    let physical = all.fold(Numbers::ZERO, |all, (of, value)| all.with(of, value));
    let case = scales.case(&physical, &Cantilever::paper());
    // Eqs. (5) and (7) of the paper, with the mass per length put back under the root.
    let time = (m * length.powi(4) / ei).sqrt();
    let root = (length.powi(4) / (m * ei)).sqrt();
    close(case.alpha1, 3e-12 / (m * length), 1e-14);
    close(case.alpha2, 5e-9 / gap, 1e-14);
    close(case.alpha3, 2e-8 / length * root, 1e-14);
    close(case.alpha4, 17.0 * length.powi(3) / ei, 1e-14);
    close(case.alpha4, 3.0 * 17.0 / lever.k, 1e-14);
    close(case.alpha5, 20e-9 / gap, 1e-14);
    close(case.alpha6, 3e-7 / length * root, 1e-14);
    close(case.omega, TAU * 65.7e3 * time, 1e-14);
    // Mass times acceleration, force times length, energy per time, force over stiffness.
    close(scales.force, m * length * gap / (time * time), 1e-14);
    close(scales.energy, scales.force * gap, 1e-14);
    close(scales.power, scales.energy / time, 1e-14);
    close(scales.velocity * scales.damping, scales.force, 1e-14);
    close(scales.length * scales.stiffness, scales.force, 1e-14);
    close(scales.slope.unwrap(), gap / length, 1e-14);
}

#[test]
fn a_unit_force_bends_the_galerkin_beam_by_one_over_k() {
    // w(L) = F/k is W(1) = 1/3 for a unit of force: Σ φ_j(1)²/β_j⁴ = 1/3.
    let modes = Modes::new(50).unwrap();
    let deflection: f64 = modes
        .iter()
        .map(|mode| mode.tip().powi(2) / mode.stiffness())
        .sum();
    close(deflection, 1.0 / 3.0, 1e-6);
}

proptest! {
    #[test]
    fn the_mapping_goes_both_ways(
        k in 0.01_f64..100.0,
        f0 in 1e3_f64..2e6,
        ratio in 0.0_f64..2.0,
        gap in 1e-8_f64..1e-4,
        alphas in prop::array::uniform6(1e-6_f64..1e3),
        omega in 0.1_f64..100.0,
    ) {
        let lever = Lever::resolve(&LeverData {
            k: Some(k),
            f0: Some(f0),
            ..data(TipMass::Ratio(ratio))
        }).unwrap();
        let scales = Scales::new(&lever, gap);
        let case = Cantilever {
            modes: 3,
            alpha1: alphas[0],
            alpha2: alphas[1],
            alpha3: alphas[2],
            alpha4: alphas[3],
            alpha5: -alphas[4],
            alpha6: alphas[5],
            omega,
            ..Cantilever::paper()
        };
        let back = scales.case(&scales.quantities(&case), &Cantilever::paper());
        for parameter in Parameter::ALL {
            prop_assert!((back.get(parameter) / case.get(parameter) - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn nonsense_is_refused_without_a_panic(
        section in prop::sample::select(Section::ALL[1..].to_vec()),
        key in "[a-zA-Z_0-9]{0,12}",
        value in "\\PC{0,12}",
    ) {
        let mut entries: Vec<(&str, &str, &str)> = changed(&[]);
        entries.push((section.name(), &key, &value));
        let _ = resolve(&entries);
    }

    #[test]
    fn extreme_values_are_refused_without_a_panic(
        at in 0..9_usize,
        exponent in -320_i32..310,
    ) {
        let base = changed(&[]);
        let (section, key, text) = base[at];
        let unit = text.split_once(' ').map_or("", |(_, unit)| unit);
        let value = format!("1e{exponent} {unit}");
        let mut entries: Vec<(&str, &str, &str)> = base.clone();
        entries[at] = (section, key, &value);
        if let Ok(resolved) = resolve(&entries) {
            prop_assert!(resolved.cantilever.validate().is_ok());
        }
    }
}

#[test]
fn free_response_is_the_exact_beams_without_damping_and_tip() {
    // MODEL: tip over base amplitude (cos β + cosh β)/(1 + cos β cosh β), β = √Ω; 2.878087 at
    // Ω = 2.6. The deflection is the tip's motion less the base's.
    let case = Cantilever {
        modes: 50,
        alpha1: 0.0,
        alpha3: 0.0,
        ..Cantilever::paper()
    };
    let exact = exact_beam::base_excitation_gain(2.6).unwrap() - 1.0;
    close(exact, 1.878_087, 1e-6);
    close(free_response(&case).unwrap().re, exact, 1e-8);
    assert_eq!(free_response(&case).unwrap().im, 0.0);
}

#[test]
fn free_response_solves_the_galerkin_equations() {
    // The matrices of the model solved for the harmonic response as they stand.
    use nalgebra::{Complex, DMatrix, DVector};
    let case = Cantilever {
        modes: 4,
        omega: 3.1,
        ..Cantilever::paper()
    };
    let galerkin = nanotap_model::galerkin::Galerkin::new(&case).unwrap();
    let complex = |matrix: &DMatrix<f64>| matrix.map(|entry| Complex::new(entry, 0.0));
    let dynamic = complex(&galerkin.stiffness[0])
        + complex(&galerkin.damping[0]) * Complex::new(0.0, case.omega)
        - complex(&galerkin.mass) * Complex::new(case.omega * case.omega, 0.0);
    // sin is the imaginary part of e^{iΩτ}, cos that of i e^{iΩτ}.
    let load = DVector::from_fn(4, |j, _| {
        Complex::new(galerkin.forcing[0].sine[j], galerkin.forcing[0].cosine[j])
    });
    let amplitudes = dynamic.lu().solve(&load).unwrap();
    let tip: Complex<f64> = amplitudes
        .iter()
        .zip(galerkin.modes.tip.iter())
        .map(|(amplitude, tip)| amplitude * *tip)
        .sum();
    let expected = free_response(&case).unwrap() * case.alpha2;
    assert!((tip - expected).modulus() < 1e-13, "{tip} {expected}");
}

#[test]
fn at_resonance_the_free_amplitude_lags_by_a_quarter_turn() {
    let resolved = resolve(&changed(&[
        ("cantilever", "Q", "1000"),
        ("tip", "mass", ""),
        ("drive", "frequency", ""),
        ("drive", "frequency_ratio", "1"),
        ("drive", "amplitude", ""),
        ("drive", "free_amplitude", "20 nm"),
    ]))
    .unwrap();
    assert!(
        (resolved.free_phase - 90.0).abs() < 0.5,
        "{}",
        resolved.free_phase
    );
    close(resolved.free_amplitude, 20e-9, 1e-14);
    // A mode participation of φ₁(1)∫φ₁ = 1.5660 (bare beam): A₀ = 1.566 Q f.
    close(
        resolved.parameters.get(Parameter::Alpha2),
        20e-9 / (1.566 * 1000.0),
        1e-3,
    );
    // The base amplitude that was found gives back the free amplitude.
    let base = format!("{:e} m", resolved.parameters.get(Parameter::Alpha2));
    let mut entries: Vec<(&str, &str, &str)> = changed(&[
        ("cantilever", "Q", "1000"),
        ("tip", "mass", ""),
        ("drive", "amplitude", ""),
        ("drive", "frequency", "75 kHz"),
    ]);
    entries.push(("drive", "amplitude", &base));
    close(resolve(&entries).unwrap().free_amplitude, 20e-9, 1e-9);
}

#[test]
fn hertz_stiffness_is_the_slope_of_the_hertz_force() {
    let contact = Hertz {
        reduced_modulus: 4.3e9,
        radius: 8e-9,
        indentation: 0.9e-9,
    };
    let step = 1e-14;
    let force = |indentation| {
        Hertz {
            indentation,
            ..contact
        }
        .force()
    };
    let slope = (force(0.9e-9 + step) - force(0.9e-9 - step)) / (2.0 * step);
    close(contact.stiffness(), slope, 1e-8);
    let solid = Elastic {
        modulus: 130e9,
        poisson: 0.27,
    };
    // Two equal solids are half as stiff as one on a rigid one.
    close(
        reduced_modulus(solid, Some(solid)),
        0.5 * reduced_modulus(solid, None),
        1e-15,
    );
}

/// A pressed number and the half unit of its last printed digit.
const PAPER_SAMPLES: [(f64, f64, f64); 4] = [
    // Paper, section 4: modulus, α4 as printed, half a unit of its last digit.
    (1e6, 4.7e-3, 0.05e-3),
    (4e9, 18.7, 0.05),
    (5e9, 23.4, 0.05),
    (50e9, 233.5, 0.05),
];

#[test]
fn the_papers_samples_need_a_rigid_tip_and_one_poisson_ratio() {
    // With Δ = R/9, α4 = 3K₁/k = 2 E* R/k. For a rigid tip and one ν₂, α4 = s E₂ with a single
    // s = 2R/(k(1 − ν₂²)): is there one within the printed digits of all four?
    let slope_range = |reduced: &dyn Fn(f64) -> f64| {
        PAPER_SAMPLES.iter().fold(
            (0.0_f64, f64::INFINITY),
            |(low, high), &(e, alpha4, half)| {
                let e = reduced(e);
                (low.max((alpha4 - half) / e), high.min((alpha4 + half) / e))
            },
        )
    };
    let (low, high) = slope_range(&|modulus| modulus);
    assert!(low <= high);
    close(low, 4.67e-9, 3e-4);
    close(high, 4.67e-9, 3e-4);
    // With the tip's own compliance (E₁ = 130 GPa, ν₁ = 0.27, as the paper states) there is
    // none, whatever ν₂, R and k: 50 GPa would be a quarter off the line.
    for poisson in [0.0, 0.2, 0.3, 0.4, 0.5] {
        let tip = Elastic {
            modulus: 130e9,
            poisson: 0.27,
        };
        let (low, high) =
            slope_range(&|modulus| reduced_modulus(Elastic { modulus, poisson }, Some(tip)));
        assert!(low > 1.2 * high, "{poisson}: {low} {high}");
    }
}

#[test]
fn an_fm_class_lever_on_polystyrene_has_alpha4_of_about_25_and_65_7_khz_for_2_6() {
    let case = |material: &'static str, tip: &'static str| {
        resolve(&[
            ("cantilever", "lever", "FM"),
            ("cantilever", "Q", "200"),
            ("tip", "mass_ratio", "0.1"),
            (
                "tip",
                if tip.is_empty() { "height" } else { "material" },
                if tip.is_empty() { "12.5 um" } else { tip },
            ),
            ("sample", "material", material),
            ("drive", "frequency", "65.7 kHz"),
            ("drive", "free_amplitude", "20 nm"),
            ("gap", "tip", "0 nm"),
        ])
        .unwrap()
    };
    let rigid = case("polystyrene", "");
    assert!(
        (24.0..26.0).contains(&rigid.cantilever.alpha4),
        "{}",
        rigid.cantilever.alpha4
    );
    let compliant = case("polystyrene", "silicon");
    assert!(
        (24.0..26.0).contains(&compliant.cantilever.alpha4),
        "{}",
        compliant.cantilever.alpha4
    );
    assert!(compliant.cantilever.alpha4 < rigid.cantilever.alpha4);
    // α1 = 0.1 is the paper's; f0 is measured with the tip.
    close(rigid.cantilever.omega, 2.6, 5e-4);
    assert_eq!(
        Kind::Frequency.format_digits(2.6 * rigid.scales.frequency, 3),
        "65.7 kHz"
    );
    assert!(rigid.cantilever.alpha1 - 0.1 < 1e-15);
}

#[test]
fn an_nchr_class_lever_is_far_from_the_papers_twenty() {
    let alpha4 = |material| {
        resolve(&[
            ("cantilever", "lever", "NCHR"),
            ("cantilever", "Q", "400"),
            ("sample", "material", material),
            ("drive", "frequency_ratio", "1"),
            ("drive", "free_amplitude", "20 nm"),
            ("drive", "setpoint", "0.8"),
        ])
        .unwrap()
        .cantilever
        .alpha4
    };
    assert_eq!(format!("{:.1}", alpha4("polystyrene")), "2.1");
    assert_eq!(format!("{:.1}", alpha4("HOPG")), "2.6");
}

#[test]
fn tip_shapes_have_their_textbook_volumes() {
    let right = std::f64::consts::FRAC_PI_4;
    // tan 45° = 1: a cone of radius h, a pyramid of base (2h)².
    close(
        TipShape::Cone {
            height: 3.0,
            half_angle: right,
        }
        .volume(),
        9.0 * std::f64::consts::PI,
        1e-15,
    );
    close(
        TipShape::Pyramid {
            height: 3.0,
            half_angle: right,
        }
        .volume(),
        36.0 * 3.0 / 3.0,
        1e-15,
    );
    close(
        TipShape::Sphere { radius: 3.0 }.volume(),
        36.0 * std::f64::consts::PI,
        1e-15,
    );
    let resolved = resolve(&changed(&[
        ("tip", "mass", ""),
        ("tip", "shape", "pyramid"),
        ("tip", "height", "10 um"),
        ("tip", "half_angle", "25 deg"),
        ("tip", "density", "2330 kg/m^3"),
    ]))
    .unwrap();
    let expected = 2330.0 * 4.0 / 3.0 * 1e-15 * 25.0_f64.to_radians().tan().powi(2);
    close(resolved.parameters.get(Parameter::Alpha1), expected, 1e-12);
}

#[test]
fn the_example_of_the_documentation_resolves() {
    let resolved = resolve(&changed(&[("gap", "beam", "")])).unwrap();
    close(resolved.cantilever.alpha4, 60.0 / 2.8, 1e-14);
    close(resolved.parameters.get(Parameter::Alpha1), 3e-12, 1e-12);
    close(resolved.cantilever.alpha2, 10e-9 / 10e-6, 1e-14);
    assert!(
        resolved
            .remarks
            .iter()
            .any(|r| r.text.contains("tip.height"))
    );
    assert_eq!(resolved.mapping().len(), 7);
}

#[test]
fn loss_tangent_is_the_dampers_at_the_drive_frequency() {
    let resolved = resolve(&changed(&[
        ("sample", "damping", ""),
        ("sample", "loss_tangent", "0.1"),
    ]))
    .unwrap();
    // tan δ = C₁ω/K₁ = α6Ω/α4.
    let case = &resolved.cantilever;
    close(case.alpha6 * case.omega / case.alpha4, 0.1, 1e-13);
}

#[test]
fn setpoint_is_a_ratio_or_an_amplitude() {
    let drive = [
        ("drive", "amplitude", ""),
        ("drive", "free_amplitude", "20 nm"),
        ("gap", "tip", ""),
    ];
    for (text, expected) in [("0.8", 0.8), ("80 %", 0.8), ("16 nm", 0.8)] {
        let mut changes = drive.to_vec();
        changes.push(("drive", "setpoint", text));
        let resolved = resolve(&changed(&changes)).unwrap();
        close(resolved.setpoint.unwrap(), expected, 1e-14);
        close(resolved.parameters.get(Parameter::Alpha5), 16e-9, 1e-13);
    }
    for text in ["0", "1", "-0.5", "20 nm", "30 nm", "-3 nm", "0 Hz"] {
        let mut changes = drive.to_vec();
        changes.push(("drive", "setpoint", text));
        let error = resolve(&changed(&changes)).unwrap_err();
        assert_eq!(key_of(&error), Some("drive.setpoint"), "{text}");
    }
}

#[test]
fn errors_name_the_key_and_what_would_be_right() {
    let cases: &[(&[Entry], &str, &str)] = &[
        (
            &[("cantilever", "k", "75 kHz")],
            "cantilever.k",
            "a force per length",
        ),
        (
            &[("cantilever", "k", "-2 N/m")],
            "cantilever.k",
            "above zero",
        ),
        (&[("cantilever", "Q", "")], "cantilever.Q", "air"),
        (&[("cantilever", "Q", "0")], "cantilever.Q", "above zero"),
        (&[("cantilever", "K", "2 N/m")], "cantilever.K", "`k`"),
        (&[("cantilever", "f0", "")], "cantilever.f0", "density"),
        (
            &[("cantilever", "f2", "200 kHz")],
            "cantilever.f2",
            "factor of two",
        ),
        (
            &[("cantilever", "lever", "PPP-NCHX")],
            "cantilever.lever",
            "PPP-NCH",
        ),
        (
            &[("cantilever", "length", "225 um")],
            "cantilever.width",
            "together",
        ),
        (
            &[("tip", "mass_ratio", "0.1")],
            "tip.mass",
            "tip.mass_ratio",
        ),
        (&[("tip", "mass", "-3 ng")], "tip.mass", "negative"),
        (
            &[("tip", "mass", ""), ("tip", "shape", "kone")],
            "tip.shape",
            "cone",
        ),
        (
            &[("tip", "mass", ""), ("tip", "shape", "cone")],
            "tip.height",
            "density",
        ),
        (&[("tip", "half_angle", "95 deg")], "tip.half_angle", "90"),
        (&[("tip", "poisson", "0.3")], "tip.modulus", "alone"),
        (
            &[("sample", "stiffness", "")],
            "sample.stiffness",
            "material",
        ),
        (
            &[("sample", "stiffness", ""), ("sample", "material", "PS")],
            "tip.radius",
            "Hertz",
        ),
        (
            &[("sample", "modulus", "4 GPa")],
            "sample.stiffness",
            "Hertz",
        ),
        (
            &[("sample", "loss_tangent", "0.1")],
            "sample.damping",
            "loss_tangent",
        ),
        (
            &[("sample", "poisson", "0.6"), ("sample", "stiffness", "")],
            "sample.poisson",
            "0.5",
        ),
        (
            &[
                ("sample", "material", "polystirene"),
                ("sample", "stiffness", ""),
            ],
            "sample.material",
            "polystyrene",
        ),
        (
            &[("drive", "frequency", "65.7 kHx")],
            "drive.frequency",
            "kHz",
        ),
        (
            &[("drive", "free_amplitude", "5 nm")],
            "drive.amplitude",
            "free",
        ),
        (
            &[("drive", "amplitude", "")],
            "drive.amplitude",
            "free_amplitude",
        ),
        (
            &[("drive", "frequency", "")],
            "drive.frequency",
            "frequency_ratio",
        ),
        (&[("gap", "tip", "")], "gap.tip", "setpoint"),
        (&[("gap", "tip", "13 um")], "gap.beam", "touch"),
        (&[("gap", "beem", "13 um")], "gap.beem", "`beam`"),
    ];
    for (changes, key, word) in cases {
        let error = resolve(&changed(changes)).unwrap_err();
        assert_eq!(key_of(&error), Some(*key), "{changes:?}: {error}");
        let message = error.to_string();
        assert!(message.contains(word), "{changes:?}: {message}");
    }
    let stray = resolve(&changed(&[("cantilevr", "k", "1 N/m")])).unwrap_err();
    assert!(stray.to_string().contains("did you mean [cantilever]"));
    let huge = resolve(&changed(&[("sample", "stiffness", "1e12 N/m")])).unwrap_err();
    assert!(huge.to_string().contains("alpha4"), "{huge}");
}

/// Tabor's parameter of a tip of 10 nm, and whether the law is warned of.
fn tabor(law: &str, sample: &[&str]) -> (f64, bool) {
    let lever = [
        "cantilever.k=2 N/m",
        "cantilever.f0=70 kHz",
        "cantilever.Q=200",
        "tip.radius=10 nm",
        "drive.frequency=70 kHz",
        "drive.free_amplitude=10 nm",
        "gap.tip=8 nm",
    ];
    let words = lever.iter().chain(sample).map(|word| (*word).to_owned());
    let words: Vec<String> = words.chain([format!("sample.law={law}")]).collect();
    let case = Case::parse(None, &words).unwrap();
    let force = case.physical().unwrap().sample.force.as_ref().unwrap();
    let remarks = case.remarks().into_iter();
    let warned = remarks
        .filter(|r| r.severity == Severity::Warning)
        .any(|r| r.text.contains("Tabor"));
    (force.tabor_parameter().unwrap(), warned)
}

#[test]
fn tabors_parameter_tells_where_dmt_and_jkr_hold() {
    // (R w² / (E*² a0³))^(1/3) with a0 = 0.165 nm: w = 50 mJ/m² on E* = 2 MPa / (1 − 1/4), and
    // on 4 GPa / (1 − 0.33²).
    let strain = |reduced: f64| 0.05 / (reduced * 0.165e-9);
    let expected = |reduced: f64| nanotap_arithmetic::cbrt(10.0 / 0.165 * strain(reduced).powi(2));
    let soft = ["sample.material=PDMS", "sample.work_of_adhesion=50 mJ/m^2"];
    let stiff = [
        "sample.material=polystyrene",
        "sample.work_of_adhesion=50 mJ/m^2",
    ];
    for (law, sample, reduced, is_wrong) in [
        ("dmt", &soft, 2e6 / 0.75, true),
        ("jkr", &soft, 2e6 / 0.75, false),
        ("dmt", &stiff, 4e9 / (1.0 - 0.33 * 0.33), false),
        ("jkr", &stiff, 4e9 / (1.0 - 0.33 * 0.33), true),
    ] {
        let (found, warned) = tabor(law, sample);
        assert!((found / expected(reduced) - 1.0).abs() < 1e-12, "{found}");
        assert_eq!(warned, is_wrong, "{law}, {found}");
    }
    // 92 of silicone rubber: far on the side of JKR.
    assert!((tabor("dmt", &soft).0 - 92.0).abs() < 1.0);
}

#[test]
fn a_beam_that_would_touch_is_warned_of() {
    let warned = |changes: &[Entry], word: &str| {
        let resolved = resolve(&changed(changes)).unwrap();
        resolved
            .remarks
            .iter()
            .any(|r| r.severity == Severity::Warning && r.text.contains(word))
    };
    assert!(!warned(&[], "touch"));
    // A tip of 100 nm swinging by micrometres onto something ten thousand times softer than
    // the lever.
    let soft = [
        ("sample", "stiffness", "0.3 mN/m"),
        ("gap", "beam", "100 nm"),
        ("drive", "amplitude", "90 nm"),
    ];
    assert!(warned(&soft, "so soft a sample"));
    // The same swing onto a hard sample does not sink.
    let hard = [
        ("sample", "stiffness", "1e5 N/m"),
        ("gap", "beam", "100 nm"),
        ("drive", "amplitude", "10 nm"),
    ];
    assert!(!warned(&hard, "touch"));
    assert!(warned(&[("drive", "amplitude", "13 um")], "clamped end"));
}

#[test]
fn catalogued_levers_hang_together() {
    // k and f0 of a uniform silicon beam of the stated dimensions, within what nominal
    // thicknesses are worth: data sheets allow half the k to twice the k.
    let catalogue = Catalogue::builtin().unwrap();
    for lever in catalogue.levers() {
        assert!(!lever.source.is_empty());
        if let Some(geometry) = lever.geometry {
            let k = geometry.stiffness(169e9);
            assert!((0.5..2.0).contains(&(k / lever.k)), "{}: {k}", lever.name);
            let bare = Lever::resolve(&LeverData {
                k: Some(k),
                f0: None,
                geometry: Some(geometry),
                density: Some(2330.0),
                ..data(TipMass::Absolute(0.0))
            })
            .unwrap();
            let ratio = bare.f0 / lever.f0;
            assert!((0.8..1.25).contains(&ratio), "{}: {ratio}", lever.name);
        }
        for alias in &lever.aliases {
            assert_eq!(
                catalogue
                    .lever(Key::LeverName, &alias.to_lowercase())
                    .unwrap(),
                lever
            );
        }
    }
    for material in catalogue.materials() {
        assert!(!material.source.is_empty());
        for alias in &material.aliases {
            assert_eq!(
                catalogue.material(Key::TipMaterial, alias).unwrap(),
                material
            );
        }
    }
}

#[test]
fn a_users_file_adds_and_replaces() {
    let mut catalogue = Catalogue::builtin().unwrap();
    catalogue
        .extend(
            "[lever.\"my lever\"]\nk = \"2.4 N/m\"\nf0 = \"71 kHz\"\nsource = \"thermal noise\"\n\
             [material.Polystyrene]\nmodulus = \"3 GPa\"\npoisson = 0.33\nsource = \"mine\"\n",
            "mine.toml",
        )
        .unwrap();
    assert_eq!(catalogue.lever(Key::LeverName, "My-Lever").unwrap().k, 2.4);
    let replaced = catalogue.material(Key::TipMaterial, "polystyrene").unwrap();
    assert_eq!(replaced.elastic.modulus, 3e9);
    for (faulty, word) in [
        (
            "[lever.a]\nk = \"75 kHz\"\nf0 = \"7 kHz\"\nsource = \"\"",
            "a force per length",
        ),
        (
            "[lever.a]\nk = \"-1 N/m\"\nf0 = \"7 kHz\"\nsource = \"\"",
            "above zero",
        ),
        (
            "[lever.a]\nk = \"1 N/m\"\nf0 = \"7 kHz\"\nlength = \"1 um\"\nsource = \"\"",
            "together",
        ),
        ("[lever.a]\nkk = \"1 N/m\"", "kk"),
        (
            "[material.a]\nmodulus = \"1 GPa\"\npoisson = 0.7\nsource = \"\"",
            "0.5",
        ),
        ("lever = 3", "line 1"),
    ] {
        let before = catalogue.clone();
        let error = catalogue
            .extend(faulty, "mine.toml")
            .unwrap_err()
            .to_string();
        assert!(
            error.contains(word) && error.contains("mine.toml"),
            "{error}"
        );
        assert_eq!(catalogue, before);
    }
    let missing = std::path::Path::new("no such file.toml");
    assert!(catalogue.extend_from_file(missing).is_err());
}

/// A magnetic drive at the resonance of a bare lever of high Q: A₀ = (3φ₁(1)²/β₁⁴) F Q/k with
/// φ₁(1)² = 4 and β₁⁴ = 12.3624; the spread force acts by φ₁(1)∫φ₁ = 1.5660 instead of 4.
#[test]
fn a_force_on_the_lever_gives_its_free_amplitude() {
    for (actuation, weight, name) in [("tip", 4.0, "tip"), ("distributed", 1.566, "lever")] {
        let resolved = resolve(&changed(&[
            ("cantilever", "Q", "1000"),
            ("tip", "mass", ""),
            ("drive", "actuation", actuation),
            ("drive", "frequency", ""),
            ("drive", "frequency_ratio", "1"),
            ("drive", "amplitude", ""),
            ("drive", "free_amplitude", "20 nm"),
        ]))
        .unwrap();
        let force = resolved.parameters.get(Parameter::Alpha2);
        close(3.0 * weight / 12.3624 * force * 1000.0 / 2.8, 20e-9, 1e-3);
        assert!((resolved.free_phase - 90.0).abs() < 0.5);
        assert!(resolved.phase_reference().contains(name));
        let row = &resolved.mapping()[1];
        assert_eq!((row.kind, row.si), (Kind::Force, force));
        // The unit of force is k g₀/3.
        close(row.value, force / (2.8 * 12e-6 / 3.0), 1e-12);
        // And back from the force.
        let given = format!("{force:e} N");
        let mut entries: Vec<(&str, &str, &str)> = changed(&[
            ("cantilever", "Q", "1000"),
            ("tip", "mass", ""),
            ("drive", "actuation", actuation),
            ("drive", "amplitude", ""),
        ]);
        entries.retain(|entry| entry.1 != "frequency");
        entries.extend([("drive", "frequency", "75 kHz"), ("drive", "force", &given)]);
        close(resolve(&entries).unwrap().free_amplitude, 20e-9, 1e-9);
    }
}

/// All tones have the requested free amplitudes, by the closed form of each.
#[test]
fn further_tones_have_their_own_free_amplitudes() {
    let resolved = resolve(&changed(&[
        ("drive", "amplitude", ""),
        ("drive", "free_amplitude", "20 nm"),
        ("drive", "second_frequency", "410.625 kHz"),
        ("drive", "second_free_amplitude", "0.5 nm"),
        ("drive", "second_phase", "30 deg"),
        ("drive", "third_ratio", "17.5"),
        ("drive", "third_free_amplitude", "0.1 nm"),
        ("drive", "third_phase", "-20 deg"),
    ]))
    .unwrap();
    let case = &resolved.cantilever;
    let ratio = case.further_tones[0];
    assert_eq!(ratio.to_string(), "25/4");
    assert_eq!(case.further_tones[1].to_string(), "35/2");
    close(case.get(Parameter::Tone2Phase), 30.0, 1e-12);
    close(case.get(Parameter::Tone3Phase), -20.0, 1e-12);
    for (amplitude, frequency, expected) in [
        (case.alpha2, case.omega, 20e-9),
        (
            case.get(Parameter::Tone2Amplitude),
            6.25 * case.omega,
            0.5e-9,
        ),
        (
            case.get(Parameter::Tone3Amplitude),
            17.5 * case.omega,
            0.1e-9,
        ),
    ] {
        let z = super::free_response::response_at(case, frequency).unwrap();
        close(
            amplitude * z.modulus() * resolved.scales.length,
            expected,
            1e-9,
        );
    }
    assert_eq!(resolved.further_free_amplitudes, [0.5e-9, 0.1e-9]);
}

/// The laws of a sample with what each needs: 3 km/k and the time over the model's unit.
#[test]
fn samples_have_their_laws() {
    let solid = resolve(&changed(&[
        ("sample", "law", "standard-linear-solid"),
        ("sample", "damping", ""),
        ("sample", "relaxation_stiffness", "50 N/m"),
        ("sample", "relaxation_time", "0.5 us"),
    ]))
    .unwrap();
    let numbers = solid.cantilever.own_numbers();
    close(numbers[0], 3.0 * 50.0 / 2.8, 1e-13);
    close(numbers[1], 0.5e-6 / solid.scales.time, 1e-13);
    assert_eq!(solid.cantilever.alpha6, 0.0);
    assert!(
        !solid
            .remarks
            .iter()
            .any(|r| r.text.contains("dissipates nothing"))
    );
    let recovers = resolve(&changed(&[("sample", "law", "kelvin-voigt")])).unwrap();
    assert!(recovers.cantilever.alpha6 > 0.0);
    assert_eq!(recovers.cantilever.contact.name(), "kelvin-voigt");
}

#[test]
fn laws_and_drives_are_refused_with_what_would_be_right() {
    let cases: [(&[Entry], &str); 17] = [
        (
            &[("sample", "law", "hertz")],
            "it is not a parameter of sample.law",
        ),
        (
            &[("sample", "thickness", "50 nm")],
            "it belongs to a nonlinear force law (laws with it: thin-sphere, thin-cone, \
             thin-punch, layer-sphere, layer-cone, layer-punch)",
        ),
        (
            &[
                ("sample", "law", "hertz"),
                ("sample", "stiffness", ""),
                ("sample", "damping", ""),
                ("sample", "viscosity", "1 Pa s"),
            ],
            "(laws with it: voigt-sphere, ",
        ),
        (&[("sample", "law", "hooke")], "kelvin-voigt"),
        (
            &[("sample", "law", "standard-linear-solid")],
            "relaxing arm",
        ),
        (
            &[
                ("sample", "law", "standard-linear-solid"),
                ("sample", "damping", ""),
            ],
            "sample.relaxation_stiffness is missing",
        ),
        (
            &[("sample", "relaxation_time", "1 us")],
            "standard-linear-solid",
        ),
        (&[("drive", "actuation", "magnet")], "distributed"),
        (&[("drive", "actuation", "tip")], "has a force"),
        (&[("drive", "force", "1 nN")], "drive.actuation"),
        (
            &[
                ("drive", "second_frequency", "411.5237 kHz"),
                ("drive", "second_amplitude", "1 nm"),
                ("drive", "third_ratio", "3"),
                ("drive", "third_amplitude", "1 nm"),
            ],
            "ratios of whole numbers for all of three",
        ),
        (
            &[("drive", "second_ratio", "25/4")],
            "second_free_amplitude",
        ),
        (&[("drive", "third_ratio", "3")], "third_free_amplitude"),
        (
            &[
                ("drive", "third_ratio", "3"),
                ("drive", "third_amplitude", "1 nm"),
            ],
            "no second one",
        ),
        (
            &[
                ("drive", "second_ratio", "3"),
                ("drive", "second_amplitude", "1 nm"),
                ("drive", "third_phase", "1 rad"),
            ],
            "the third tone needs a frequency",
        ),
        (
            &[
                ("drive", "second_ratio", "3"),
                ("drive", "second_amplitude", "1 nm"),
                ("drive", "third_frequency", "197.1 kHz"),
                ("drive", "third_amplitude", "1 nm"),
            ],
            "drive.third_frequency",
        ),
        (
            &[
                ("drive", "third_ratio", "3"),
                ("drive", "third_frequency", "197.1 kHz"),
            ],
            "each gives the frequency",
        ),
    ];
    for (changes, words) in cases {
        let error = resolve(&changed(changes)).unwrap_err().to_string();
        assert!(error.contains(words), "{changes:?}: {error}");
    }
}

/// A silicon lever of 200 µm × 30 µm × 2 µm in water: ω = ω_vac (1 + πρb/(4ρ_c h) Γ_r)^(−1/2) and
/// Q = (4ρ_c h/(πρb) + Γ_r)/Γ_i, Sader's Eqs. (30) and (31), solved separately with SciPy's Bessel
/// functions; with damping the resonance curve peaks a little off.
#[test]
fn a_fluid_slows_and_damps_a_lever() {
    let words = |more: &[&str]| -> Vec<String> {
        let lever = [
            "cantilever.length=200 um",
            "cantilever.width=30 um",
            "cantilever.thickness=2 um",
            "cantilever.modulus=169 GPa",
            "cantilever.density=2330 kg/m^3",
            "sample.stiffness=1 N/m",
            "drive.frequency_ratio=1",
            "drive.free_amplitude=5 nm",
            "gap.tip=4 nm",
        ];
        lever
            .iter()
            .chain(more)
            .map(|&word| word.to_owned())
            .collect()
    };
    let water = [
        "cantilever.fluid_density=998 kg/m^3",
        "cantilever.fluid_viscosity=1 mPa s",
    ];
    let case = Case::parse(None, &words(&water)).unwrap();
    let lever = case.physical().unwrap().lever;
    assert!(
        (lever.f0 / 23_249.505_895_107_25 - 1.0).abs() < 1e-9,
        "{}",
        lever.f0
    );
    assert!((lever.quality_factor / 3.349_750_762_880_2 - 1.0).abs() < 1e-9);
    // The stiffness is that of the beam.
    assert!((lever.k / 1.2675 - 1.0).abs() < 1e-12);
    // The higher modes by the same equations, with Γ at their own frequency and wavelength, solved
    // separately with 16 polynomials; a mode bends with the beam's own stiffness, β⁴EI/(4L³) at the tip.
    let modes = case.physical().unwrap().parameters;
    let expected = [
        167_080.463_232_712_44,
        501_575.210_607_861_9,
        7.678_219_169_572_986,
        12.625_926_513_329_704,
        51.282_925_205_474_81,
        402.066_449_387_596_9,
    ];
    for (parameter, expected) in Parameter::MEASURED.into_iter().zip(expected) {
        let found = modes.get(parameter);
        assert!((found / expected - 1.0).abs() < 1e-8, "{found} {expected}");
    }
    // Over a surface, by the equations of a blade over a wall solved separately with 16 polynomials.
    let near = [water[0], water[1], "cantilever.height=10 um"];
    let case = Case::parse(None, &words(&near)).unwrap();
    let view = case.physical().unwrap();
    let of_mode = |parameter| view.parameters.get(parameter);
    let found = [
        view.lever.f0,
        view.lever.quality_factor,
        of_mode(Parameter::Mode2Frequency),
        of_mode(Parameter::Mode2Quality),
        of_mode(Parameter::Mode3Frequency),
        of_mode(Parameter::Mode3Quality),
    ];
    let expected = [
        21_229.996_985_455_615,
        1.630_590_092_767_524_8,
        150_788.322_806_813_9,
        5.052_399_304_821_583,
        460_559.329_037_638_26,
        8.878_165_251_257_29,
    ];
    for (found, expected) in found.into_iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-8, "{found} {expected}");
    }
    let too_near = [water[0], water[1], "cantilever.height=500 nm"];
    let refused = Case::parse(None, &words(&too_near))
        .unwrap_err()
        .to_string();
    assert!(refused.contains("at least 750 nm"), "{refused}");
    let without = ["cantilever.Q=5", "cantilever.height=10 um"];
    let refused = Case::parse(None, &words(&without)).unwrap_err().to_string();
    assert!(refused.contains("fluid_density"), "{refused}");
    // What was measured in the fluid stands.
    let measured = [
        water[0],
        water[1],
        "cantilever.Q2=5",
        "cantilever.k3=300 N/m",
    ];
    let case = Case::parse(None, &words(&measured)).unwrap();
    let found = case.physical().unwrap().parameters;
    assert!((found.get(Parameter::Mode2Quality) - 5.0).abs() < 1e-12);
    assert!((found.get(Parameter::Mode3Stiffness) - 300.0).abs() < 1e-9);
    let third = |of: &Numbers| of.get(Parameter::Mode3Quality).to_bits();
    assert_eq!(third(&found), third(&modes));
    let said: Vec<String> = case.remarks().into_iter().map(|r| r.text).collect();
    assert!(
        said.iter()
            .any(|text| text.contains("23.25 kHz") && text.contains("3.35")),
        "{said:?}"
    );
    // With a tip: the fluid's mass is the beam's alone.
    let mut tipped = water.to_vec();
    tipped.push("tip.mass=5 ng");
    let heavy = Case::parse(None, &words(&tipped))
        .unwrap()
        .physical()
        .unwrap()
        .lever;
    assert!(heavy.f0 < lever.f0 && (heavy.tip_mass() / 5e-12 - 1.0).abs() < 1e-9);
    // A gas that weighs nothing leaves the modes of a lever with a tip as they are, but for what
    // forty modes of a bare beam do not know of them.
    let vacuum = [
        "modes=40",
        "tip.mass_ratio=0.05",
        "cantilever.fluid_density=1e-3 kg/m^3",
        "cantilever.fluid_viscosity=1e-9 Pa s",
    ];
    let case = Case::parse(None, &words(&vacuum)).unwrap();
    let with = case.cantilever().unwrap();
    let without = Cantilever {
        further: Numbers::ZERO,
        ..with.clone()
    };
    let [with, without] = [with, &without].map(|case| Galerkin::new(case).unwrap());
    let change = (&with.mass - &without.mass).amax();
    assert!(change < 0.01, "{change}");
    let change = (&with.stiffness[0] - &without.stiffness[0]).amax();
    assert!(
        change > 0.0 && change < 0.01 * without.stiffness[0][(2, 2)],
        "{change}"
    );

    let refused = |more: &[&str]| Case::parse(None, &words(more)).unwrap_err().to_string();
    assert!(refused(&[]).contains("cantilever.Q"));
    assert!(refused(&[water[0]]).contains("fluid_viscosity is missing"));
    assert!(refused(&[water[0], water[1], "cantilever.Q=2"]).contains("cannot both be given"));
    let honey = [
        "cantilever.fluid_density=998 kg/m^3",
        "cantilever.fluid_viscosity=1e9 Pa s",
    ];
    assert!(refused(&honey).contains("Reynolds"));
}

/// Without a tip's mass the stiffness of the first mode is β₁⁴/12 = 1.0302 of the static one; both state
/// the same lever. A heavy tip moves like the end of a static lever.
#[test]
fn a_modal_stiffness_states_the_same_lever() {
    let case = |words: &[&str]| {
        let all = [
            "cantilever.f0=75 kHz",
            "cantilever.Q=200",
            "sample.stiffness=1 N/m",
            "drive.frequency=75 kHz",
            "drive.free_amplitude=10 nm",
            "gap.tip=8 nm",
        ];
        let words: Vec<String> = all.iter().chain(words).map(|&w| w.to_owned()).collect();
        Case::parse(None, &words)
    };
    let k = |words: &[&str]| case(words).unwrap().get(Key::LeverK);
    close(
        k(&["cantilever.k1=2 N/m"]),
        2.0 * 12.0 / 12.362_363_368_400_15,
        1e-10,
    );
    let heavy = case(&["cantilever.k1=2 N/m", "tip.mass_ratio=1000"]).unwrap();
    // A heavy tip bends the lever as a static force does: k1 is the stiffness of the three modes,
    // 1 / Σ 4/βᵢ⁴, where the beam has 3.
    let three =
        4.0 / 12.362_363_368_400_15 + 4.0 / 485.518_818_513_370_7 + 4.0 / 3_806.546_266_352_4;
    close(heavy.get(Key::LeverK), 2.0 * 3.0 * three, 1e-4);
    close(heavy.get(Key::LeverK1), 2.0, 1e-10);
    let error = case(&["cantilever.k1=2 N/m", "tip.mass=1 ng"])
        .unwrap_err()
        .to_string();
    assert!(error.contains("mass_ratio"), "{error}");
    assert!(case(&["cantilever.k1=2 N/m", "cantilever.k=2 N/m"]).is_err());
}

/// k = E b h³/(4L³) and f0 = 1.8751²/(2π) √(k/(3m)) of a uniform silicon beam with E = 169 GPa along
/// <110> (Hopcroft, Nix and Kenny, J. Microelectromech. Syst. 19, 229 (2010)) and 2329 kg/m³: the tip
/// lowers f0, and data sheets round the thickness.
#[test]
fn catalogue_levers_are_like_silicon_beams() {
    let catalogue = Catalogue::builtin().unwrap();
    let mut rectangular = 0;
    for lever in catalogue.levers() {
        let Some(beam) = lever.geometry else { continue };
        rectangular += 1;
        let stiffness = beam.stiffness(169e9);
        let frequency = 1.875_104_f64.powi(2) / std::f64::consts::TAU
            * (stiffness / (3.0 * beam.mass(2329.0))).sqrt();
        let [k, f0] = [lever.k / stiffness, lever.f0 / frequency];
        assert!((0.9..1.2).contains(&k), "{}: k {k}", lever.name);
        assert!((0.8..1.02).contains(&f0), "{}: f0 {f0}", lever.name);
    }
    assert!(rectangular >= 25, "{rectangular}");
}
