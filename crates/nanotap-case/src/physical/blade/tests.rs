use std::f64::consts::PI;

use super::*;
use crate::physical::fluid::hydrodynamic_function;

fn gamma(wavenumber: f64, reynolds: f64, gap: Option<f64>) -> Complex<f64> {
    let blade = Blade {
        wavenumber,
        reynolds,
        gap,
    };
    blade.hydrodynamic_function().unwrap()
}

#[track_caller]
fn assert_close(found: Complex<f64>, expected: Complex<f64>, tolerance: f64) {
    let error = (found - expected).modulus() / expected.modulus();
    assert!(error < tolerance, "{found} {expected}: {error:e}");
}

/// By mpmath in real space, where the kernel is a sum of K₀ and K₁ of √(k² + iRe) y and k y: collocation
/// with 40 digits and 20 or 32 Chebyshev points, the logarithm integrated exactly. κ, Re and Γ.
const IN_REAL_SPACE: [(f64, f64, f64, f64); 7] = [
    (0.0, 1e-4, 1_268.153_244_545_7, 7_936.922_899_127_7),
    (0.0, 1.0, 3.733_874_490_816_8, 4.074_672_659_997_5),
    (0.0, 30.0, 1.558_594_161_229_5, 0.542_410_174_465_56),
    (0.05, 1e-3, 170.690_851_260_01, 970.566_847_984_15),
    (0.7, 30.0, 1.416_476_235_586_1, 0.470_665_795_841_79),
    (2.0, 0.01, 1.930_347_324_494_3, 381.029_696_196_37),
    (3.0, 40.0, 0.823_595_675_347_82, 0.287_580_493_934_95),
];

#[test]
fn the_blade_agrees_with_a_solution_in_real_space() {
    for (wavenumber, reynolds, real, imaginary) in IN_REAL_SPACE {
        let expected = Complex::new(real, imaginary);
        assert_close(gamma(wavenumber, reynolds, None), expected, 1e-9);
    }
}

/// More polynomials and nodes, 44 of the former, of the same equations: the error that the module states.
#[test]
fn fast_flows_have_the_stated_error() {
    let with_more = [
        (
            0.0,
            1e4,
            1.042_065_184_823_428,
            0.035_738_851_723_444_4,
            1e-7,
        ),
        (
            8.0,
            1e4,
            0.291_413_412_253_891,
            0.012_447_363_337_445_7,
            1e-7,
        ),
        (
            0.3,
            1e6,
            0.985_960_997_165_954,
            0.004_384_714_319_271_7,
            5e-6,
        ),
        (
            40.0,
            1e6,
            0.063_058_034_726_049,
            0.000_992_801_659_182_8,
            5e-6,
        ),
    ];
    for (wavenumber, reynolds, real, imaginary, error) in with_more {
        let expected = Complex::new(real, imaginary);
        assert_close(gamma(wavenumber, reynolds, None), expected, error);
    }
}

/// Sader's fit for long waves is within 0.1 %, as he states. (Its imaginary part alone is 0.5 % low at
/// Re = 10⁴, where it is a thirtieth of the real one.)
#[test]
fn long_waves_give_saders_function() {
    for power in -6..=4 {
        let reynolds = 10.0_f64.powi(power);
        assert_close(
            hydrodynamic_function(reynolds),
            gamma(0.0, reynolds, None),
            1e-3,
        );
    }
}

/// The fit of Van Eysden and Sader for an inviscid fluid (J. Appl. Phys. 100, 114916 (2006)), which is
/// within 0.6 %. The boundary layer's part, proportional to (1 + i)/√Re, is taken off.
#[test]
fn an_inviscid_fluid_gives_the_fit_of_2006() {
    for kappa in [0.0, 0.25, 1.0, 2.0, 4.0, 8.0, 20.0] {
        let found = gamma(kappa, 1e6, None);
        let upper = 1.0 + kappa * (0.742_73 + kappa * 0.148_62);
        let lower = 1.0 + kappa * (0.742_73 + kappa * (0.350_04 + kappa * 0.058_364));
        let error = (found.re - found.im) / (upper / lower) - 1.0;
        assert!(error.abs() < 6e-3, "{kappa}: {error}");
    }
}

/// A slow flow around a strip, of long waves: 4πμ/(ln(4/k) − γ), from K₀(ky) ≈ −ln(ky/2) − γ; the error is
/// of order k² ln k.
#[test]
fn a_slow_flow_gives_the_drag_of_a_ribbon() {
    const EULER: f64 = 0.577_215_664_901_532_9;
    for kappa in [1e-2, 1e-3] {
        let reynolds = 1e-6_f64.min(kappa * kappa * 1e-3);
        let blade = Blade {
            wavenumber: kappa,
            reynolds,
            gap: None,
        };
        let drag = PI * reynolds * blade.solve().im;
        let expected = 4.0 * PI / (nanotap_arithmetic::ln(8.0 / kappa) - EULER);
        assert!(
            (drag / expected - 1.0).abs() < 1e-4,
            "{kappa}: {drag} {expected}"
        );
    }
}

/// The slow flow over a wall by the images of Blake's tensor in two dimensions (Pozrikidis, Boundary
/// Integral and Singularity Methods, 1992), collocation in real space with mpmath: force over μ times the
/// velocity, for a wall at half and twice the width.
#[test]
fn a_slow_flow_over_a_wall_has_the_force_of_its_images() {
    for (gap, force) in [
        (0.25, 160.554_434_391_9),
        (0.5, 43.967_570_822_91),
        (2.0, 9.591_869_237_24),
    ] {
        let found = PI * 1e-6 * gamma(0.0, 1e-6, Some(gap)).im;
        assert!((found / force - 1.0).abs() < 1e-9, "{gap}: {found}");
    }
}

/// Near the wall the fluid is squeezed out: the force of a film with inertia is that of the mean of
/// 1 − cosh(λz)/cosh(λh/2) across it, λ² = iρω/μ, without the flow around the edges, which adds a part of
/// order h.
#[test]
fn a_wall_nearby_squeezes_a_film() {
    for reynolds in [1e-3, 1.0, 1e3, 1e5] {
        let mut errors = [0.2, 0.1, 0.05].map(|h: f64| {
            let root = Complex::new(0.0, reynolds).square_root();
            let x = 0.5 * root * h;
            let film = if x.modulus() < 0.05 {
                h * x * x / 3.0 * (1.0 - 0.4 * x * x)
            } else {
                let decay = (-2.0 * x).exponential();
                h - 2.0 / root * (1.0 - decay) / (1.0 + decay)
            };
            let expected = (2.0 / (3.0 * PI) / film).conj();
            let found = gamma(0.0, reynolds, Some(0.5 * h));
            ((found - expected) / expected).modulus() / h
        });
        errors.reverse();
        assert!(
            errors.iter().all(|error| (0.5..6.0).contains(error)),
            "{reynolds}: {errors:?}"
        );
    }
}

/// Waves over a wall: long ones are the flow without waves, and far from the wall there is none.
#[test]
fn waves_over_a_wall_have_their_limits() {
    for reynolds in [1e-2, 30.0, 1e4] {
        let flat = gamma(0.0, reynolds, Some(0.2));
        assert_close(gamma(1e-5, reynolds, Some(0.2)), flat, 1e-6);
        assert_close(
            gamma(1.5, reynolds, Some(40.0)),
            gamma(1.5, reynolds, None),
            1e-8,
        );
    }
    // By 44 polynomials and other nodes.
    let expected = Complex::new(4.288_146_600_488_166, 99.914_993_140_838_36);
    assert_close(gamma(0.5, 30.0, Some(0.05)), expected, 1e-8);
}

#[test]
fn what_is_out_of_range_has_no_value() {
    let blade = |wavenumber, reynolds, gap| Blade {
        wavenumber,
        reynolds,
        gap,
    };
    for out in [
        blade(0.0, 1e-7, None),
        blade(0.0, 2e6, None),
        blade(50.0, 1.0, None),
        blade(0.5, 1.0, Some(0.01)),
        blade(f64::NAN, 1.0, None),
        blade(0.5, 1.0, Some(f64::NAN)),
    ] {
        assert_eq!(out.hydrodynamic_function(), None);
    }
}

#[test]
fn bessel_functions() {
    // Abramowitz and Stegun, table 9.1.
    let [zeroth, first, ..] = bessel(1.0);
    assert!((zeroth - 0.765_197_686_557_966_6).abs() < 1e-15);
    assert!((first - 0.440_050_585_744_933_5).abs() < 1e-15);
    for x in [JOIN, 60.0] {
        // The Wronskian J_{n+1} Y_n − J_n Y_{n+1} = 2/(πx).
        let values = hankel(Complex::new(x, 0.0));
        for pair in values.windows(2) {
            let cross = (pair[1] * pair[0].conj()).im;
            assert!((-cross * PI * x / 2.0 - 1.0).abs() < 1e-12, "{x}: {cross}");
        }
    }
    let at_join = hankel(Complex::new(JOIN, 0.0)).map(|value| (value * from_polar(1.0, JOIN)).re);
    for (n, (below, above)) in bessel(JOIN).into_iter().zip(at_join).enumerate() {
        assert!((below - above).abs() < 1e-13, "{n}: {below} {above}");
    }
}
