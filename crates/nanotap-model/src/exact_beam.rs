//! The beam itself, without a Galerkin truncation: its frequencies with a tip mass
//! and a tip spring, and its response to a moving base.
//!
//! With tip mass α1 and tip spring α4 the wave numbers solve
//! β³(1 + cos β cosh β) = (α1β⁴ − α4)(sin β cosh β − cos β sinh β), ω = β².

use std::f64::consts::PI;

use crate::beam::{Mode, ModeCountError};
use crate::cantilever::{CantileverError, check};
use crate::parameter::Parameter;

/// The first `count` natural frequencies ω of the undamped beam with tip mass ratio
/// `alpha1` and tip spring `alpha4`, ascending. `alpha4` = 0 is free flight.
///
/// # Errors
/// [`CantileverError`] unless 1 ≤ `count` ≤ 50 and both parameters are finite and ≥ 0.
pub fn frequencies(alpha1: f64, alpha4: f64, count: usize) -> Result<Vec<f64>, CantileverError> {
    check(Parameter::Alpha1, alpha1)?;
    check(Parameter::Alpha4, alpha4)?;
    if count == 0 {
        return Err(ModeCountError { given: count }.into());
    }
    (1..=count)
        .map(|number| Ok(wave_number(&Mode::new(number)?, alpha1, alpha4).powi(2)))
        .collect()
}

/// The wave number that grows out of `mode` as mass and spring are added.
///
/// Divided by the right-hand factor the equation reads 1 + (α4 − α1ω²)H(ω) = 0, where
/// the tip's receptance H = Σ φ_i(1)²/(ω_i² − ω²) rises from −∞ to +∞ between two
/// free frequencies and is zero once, at the frequency with the tip pinned. So the
/// spring (where it outweighs the mass, ω² < α4/α1) lifts a frequency, the mass
/// lowers it, neither past the pinned one nor past ω² = α4/α1: each bracket below
/// holds exactly one root, and there are no others.
fn wave_number(mode: &Mode, alpha1: f64, alpha4: f64) -> f64 {
    let spring_over_mass = alpha4 - alpha1 * mode.stiffness();
    let balance = nanotap_arithmetic::powf(alpha4 / alpha1, 0.25);
    let (low, high) = if spring_over_mass > 0.0 {
        (mode.beta, pinned_wave_number(mode.number).min(balance))
    } else if spring_over_mass < 0.0 {
        let below = match mode.number {
            1 => 0.0,
            number => pinned_wave_number(number - 1),
        };
        (below.max(balance), mode.beta)
    } else {
        return mode.beta;
    };
    let sign = if mode.number % 2 == 1 { 1.0 } else { -1.0 };
    bisect(
        |beta| sign * characteristic(beta, alpha1, alpha4) > 0.0,
        low,
        high,
    )
}

/// The characteristic function divided by β³ cosh β.
fn characteristic(beta: f64, alpha1: f64, alpha4: f64) -> f64 {
    nanotap_arithmetic::cos(beta)
        + nanotap_arithmetic::cosh(beta).recip()
        + (alpha4 / beta.powi(3) - alpha1 * beta) * pinned_characteristic(beta)
}

/// sin β − cos β tanh β, whose roots are the clamped-pinned wave numbers.
fn pinned_characteristic(beta: f64) -> f64 {
    if beta >= 1.0 {
        return nanotap_arithmetic::sin(beta)
            - nanotap_arithmetic::cos(beta) * nanotap_arithmetic::tanh(beta);
    }
    // The leading terms cancel: Σ (−1)^k 2^{2k+2} β^{4k+3}/(4k+3)!, over cosh β.
    let x = 4.0 * beta.powi(4);
    let series = 1.0 - x / 840.0 * (1.0 - x / 7920.0 * (1.0 - x / 32760.0 * (1.0 - x / 93024.0)));
    2.0 / 3.0 * beta.powi(3) * series / nanotap_arithmetic::cosh(beta)
}

/// The root of tan β = tanh β in ((j, j + ¼)π), where tan(¼π − e) = tanh β means
/// tan e = e^{−2β}.
fn pinned_wave_number(number: usize) -> f64 {
    let centre = (number as f64 + 0.25) * PI;
    let mut beta = centre;
    // Contracts by 2e^{−2β} < 10⁻³ a step.
    for _ in 0..6 {
        beta = centre - nanotap_arithmetic::atan(nanotap_arithmetic::exp(-2.0 * beta));
    }
    beta
}

/// The point where `before` turns from true to false, to the last bit.
fn bisect(before: impl Fn(f64) -> bool, mut low: f64, mut high: f64) -> f64 {
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return middle;
        }
        if before(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
}

/// Tip over base amplitude of the undamped free beam without tip mass, driven at its
/// base with frequency `omega`: (cos β + cosh β)/(1 + cos β cosh β), β = √Ω. Negative
/// where the tip moves against the base.
///
/// # Errors
/// [`CantileverError`] if `omega` is no valid drive frequency.
pub fn base_excitation_gain(omega: f64) -> Result<f64, CantileverError> {
    check(Parameter::Omega, omega)?;
    let beta = omega.sqrt();
    let sech = nanotap_arithmetic::cosh(beta).recip();
    Ok((nanotap_arithmetic::cos(beta) * sech + 1.0) / (sech + nanotap_arithmetic::cos(beta)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beam::{MAX_MODES, Modes};
    use proptest::prelude::*;

    #[test]
    fn contact_frequencies_of_eq_25() {
        // mpmath 1.3, 50 digits: findroot on the characteristic equation with
        // α1 = 0.1, α4 = 20.
        let reference = [7.790952118648853, 20.324969972098394, 55.71852290200654];
        let ours = frequencies(0.1, 20.0, 3).unwrap();
        for (ours, reference) in ours.iter().zip(reference) {
            assert!((ours - reference).abs() < 1e-13 * reference, "{ours}");
        }
    }

    #[test]
    fn limits_are_the_free_and_the_pinned_beam() {
        let beta = Modes::new(MAX_MODES).unwrap().beta;
        let free = frequencies(0.0, 0.0, MAX_MODES).unwrap();
        let rigid = frequencies(0.0, 1e9, MAX_MODES).unwrap();
        for (index, (free, rigid)) in free.iter().zip(&rigid).enumerate() {
            assert_eq!(*free, beta[index].powi(2));
            // A spring of 10⁹ pins the tip up to β³/10⁹.
            let pinned = pinned_wave_number(index + 1).powi(2);
            assert!((0.0..=pinned.powi(3).max(1.0) * 1e-9).contains(&(pinned - rigid)));
        }
        // Clamped-pinned beam: 3.92660231² (Blevins, Formulas for Natural Frequency).
        assert!((pinned_wave_number(1) - 3.92660231).abs() < 1e-8);
    }

    #[test]
    fn a_heavy_tip_swings_on_the_massless_beam() {
        // Stiffness of a cantilever's tip 3, moving beam mass 33/140 (Rayleigh): for a
        // heavy tip ω² = 3/(α1 + 33/140) + O(α1⁻³).
        for (alpha1, tolerance) in [(1e2, 1e-6), (1e4, 1e-10), (1e8, 1e-15)] {
            let omega = frequencies(alpha1, 0.0, 1).unwrap()[0];
            let rayleigh = (3.0 / (alpha1 + 33.0 / 140.0)).sqrt();
            assert!(
                (omega / rayleigh - 1.0).abs() < tolerance,
                "{omega} {rayleigh}"
            );
        }
    }

    /// Counts sign changes on a fine grid, which knows nothing of the brackets.
    fn roots_by_scanning(alpha1: f64, alpha4: f64, up_to: f64) -> usize {
        let value = |i: usize| characteristic(up_to * i as f64 / 40_000.0, alpha1, alpha4);
        (1..40_000)
            .filter(|&i| (value(i) > 0.0) != (value(i + 1) > 0.0))
            .count()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn none_is_missed(alpha1 in 0.0..2.0_f64, alpha4 in 0.0..3e5_f64, count in 1..=30_usize) {
            let omega = frequencies(alpha1, alpha4, count + 1).unwrap();
            prop_assert!(omega.windows(2).all(|pair| pair[0] < pair[1]));
            let between = 0.5 * (omega[count - 1].sqrt() + omega[count].sqrt());
            prop_assert_eq!(roots_by_scanning(alpha1, alpha4, between), count);
        }

        #[test]
        fn roots_solve_the_equation(alpha1 in 0.0..2.0_f64, alpha4 in 0.0..1e4_f64) {
            for omega in frequencies(alpha1, alpha4, MAX_MODES).unwrap() {
                let beta = omega.sqrt();
                let sides = |beta: f64| characteristic(beta, alpha1, alpha4);
                prop_assert!(sides(beta * (1.0 - 2e-15)) * sides(beta * (1.0 + 2e-15)) <= 0.0);
            }
        }
    }

    #[test]
    fn base_excitation_gain_of_a_free_beam() {
        // mpmath 1.3, 50 digits: (cos b + cosh b)/(1 + cos b cosh b) at b = √2.6.
        assert!((base_excitation_gain(2.6).unwrap() - 2.8780865918937786).abs() < 1e-14);
        // A slow base: the beam bends under its own inertia as under a uniform load,
        // whose tip deflection is ω²/8.
        for omega in [1e-3, 1e-2, 0.1_f64] {
            let bending = base_excitation_gain(omega).unwrap() - 1.0 - omega.powi(2) / 8.0;
            assert!(bending.abs() < 0.02 * omega.powi(4) + 1e-15, "{bending:e}");
        }
        // Resonance at the first free frequency: the sign changes.
        let first = frequencies(0.0, 0.0, 1).unwrap()[0];
        assert!(base_excitation_gain(first * (1.0 - 1e-9)).unwrap() > 1e8);
        assert!(base_excitation_gain(first * (1.0 + 1e-9)).unwrap() < -1e8);
    }

    /// The modal sum α2Ω² Σ p_i I_i/(ω_i² − Ω²) plus the base's own motion converges to
    /// the closed form.
    #[test]
    fn base_excitation_gain_is_the_limit_of_the_modal_sum() {
        let modes = Modes::new(MAX_MODES).unwrap();
        for omega in [0.5, 2.6, 20.0, 100.0] {
            let sum: f64 = modes
                .iter()
                .map(|mode| mode.tip() * mode.integral() / (mode.stiffness() - omega * omega))
                .sum();
            let gain = base_excitation_gain(omega).unwrap();
            assert!((1.0 + omega * omega * sum - gain).abs() < 1e-9 * omega * omega);
        }
    }

    #[test]
    fn nonsense_is_refused() {
        assert_eq!(frequencies(0.1, 20.0, 0).unwrap_err().key, "modes");
        assert_eq!(frequencies(0.1, 20.0, 51).unwrap_err().key, "modes");
        assert_eq!(frequencies(-0.1, 20.0, 3).unwrap_err().key, "alpha1");
        assert_eq!(frequencies(0.1, f64::NAN, 3).unwrap_err().key, "alpha4");
        for omega in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(base_excitation_gain(omega).unwrap_err().key, "omega");
        }
    }
}
