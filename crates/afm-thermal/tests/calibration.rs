//! Closed forms: spectra without scatter have exact calibrations. Warnings: spectra with known faults.

use std::f64::consts::{FRAC_PI_4, PI};

use afm_thermal::{
    Average, BOLTZMANN, Density, Error, Fluid, ModeFactor, Options, Plan, ReferenceLever,
    Sensitivity, Spectrum, Unit, Warning, calibrate, density,
};

const F0: f64 = 75e3;
const Q: f64 = 80.0;
const TEMPERATURE: f64 = 298.15;
const K: f64 = 2.8;

/// m of a lever of 2.8 N/m, in m².
fn mean_square() -> f64 {
    0.817_434_786_701 * BOLTZMANN * TEMPERATURE / K
}

fn floor() -> f64 {
    1e-3 * density(F0, F0, Q, mean_square(), 0.0)
}

fn frequencies(step: f64) -> Vec<f64> {
    (1..(3.0 * F0 / step) as u32)
        .map(|k| step * f64::from(k))
        .collect()
}

fn exact(f: f64) -> f64 {
    density(f, F0, Q, mean_square(), floor())
}

/// A spectrum without scatter, in m or V.
fn spectrum(unit: Unit, scale: f64) -> Spectrum {
    let frequency = frequencies(50.0);
    let power: Vec<f64> = frequency
        .iter()
        .map(|f| exact(*f) * scale * scale)
        .collect();
    Spectrum::new(&frequency, &power, Density::Power, unit)
        .and_then(|of| of.with_averages(100.0, Average::Powers))
        .unwrap()
}

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found / expected - 1.0).abs() < tolerance,
        "{found}, expected {expected}"
    );
}

/// Pseudorandom exponential variable of mean 1: low-discrepancy numbers would not scatter.
fn exponential(state: &mut u64) -> f64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    -nanotap_arithmetic::ln(((*state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64)
}

fn noisy(averages: u32, step: f64, extra: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
    let mut state = 0x1234_5678_9ABC_DEF1;
    let frequency = frequencies(step);
    let one = |f: &f64| {
        let sum: f64 = (0..averages).map(|_| exponential(&mut state)).sum();
        exact(*f) * sum / f64::from(averages) + extra(*f)
    };
    let power: Vec<f64> = frequency.iter().map(one).collect();
    (frequency, power)
}

#[test]
fn equipartition() {
    let calibration = calibrate(&spectrum(Unit::Metre, 1.0), &Options::default()).unwrap();
    close(calibration.frequency.value, F0, 1e-8);
    close(calibration.quality.value, Q, 1e-7);
    close(calibration.mean_square.value, mean_square(), 1e-7);
    close(calibration.floor.unwrap().value, floor(), 1e-6);
    close(calibration.stiffness.unwrap().value, K, 1e-7);
    close(calibration.density(F0), exact(F0), 1e-7);
    assert!(calibration.sensitivity.is_none() && calibration.sader.is_none());
}

/// The standard error against the scatter of 60 single periodograms.
#[test]
fn the_interval_is_as_wide_as_the_scatter() {
    let mut logs = Vec::new();
    let mut error = 0.0;
    for seed in 1..=60_u64 {
        let mut state = 0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(seed);
        let frequency: Vec<f64> = frequencies(50.0)
            .into_iter()
            .filter(|f| (f / F0 - 1.0).abs() < 0.2)
            .collect();
        let power: Vec<f64> = frequency
            .iter()
            .map(|f| exact(*f) * exponential(&mut state))
            .collect();
        let spectrum = Spectrum::new(&frequency, &power, Density::Power, Unit::Metre)
            .and_then(|of| of.with_averages(1.0, Average::Powers))
            .unwrap();
        let calibration = calibrate(&spectrum, &Options::default()).unwrap();
        logs.push(nanotap_arithmetic::ln(
            calibration.stiffness.unwrap().value / K,
        ));
        error += calibration.stiffness.unwrap().relative_error / 60.0;
    }
    let mean = logs.iter().sum::<f64>() / 60.0;
    let scatter = (logs.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / 59.0).sqrt();
    // The standard deviation of 60 values has a standard error of 9 %.
    assert!((scatter / error - 1.0).abs() < 0.27, "{scatter} {error}");
    assert!(mean.abs() < 3.0 * error / 60_f64.sqrt(), "bias {mean}");
}

#[test]
fn volts_need_a_sensitivity_and_carry_its_error() {
    let volts = spectrum(Unit::Volt, 1.0 / 40e-9);
    let none = calibrate(&volts, &Options::default()).unwrap();
    assert!(none.stiffness.is_none() && none.warnings.contains(&Warning::NoSensitivity));
    let options = Options {
        sensitivity: Some(Sensitivity {
            value: 40e-9,
            relative_error: 0.03,
        }),
        temperature_error: 2.0,
        factor_error: 0.01,
        tilt: 11_f64.to_radians(),
        ..Options::default()
    };
    let known = calibrate(&volts, &options).unwrap();
    let k = known.stiffness.unwrap();
    close(k.value, K, 1e-7);
    let of_fit = known.mean_square.relative_error;
    let all = of_fit.powi(2) + 0.06_f64.powi(2) + (2.0 / TEMPERATURE).powi(2) + 0.01_f64.powi(2);
    close(k.relative_error, all.sqrt(), 1e-12);
    close(
        k.interval[1] / k.value,
        nanotap_arithmetic::exp(1.959_963_984_540_054 * all.sqrt()),
        1e-12,
    );
    // Hutter 2005: k/cos² θ.
    let normal = known.stiffness_along_normal.unwrap();
    close(normal.value, K / 0.963_591_927, 1e-7);
}

/// The sensitivity without contact is the one for which both methods give the same k.
#[test]
fn sensitivity_without_contact() {
    let volts = spectrum(Unit::Volt, 1.0 / 40e-9);
    let plan = Plan {
        length: 225e-6,
        width: 38e-6,
    };
    let options = Options {
        plan: Some(plan),
        plan_error: 0.02,
        ..Options::default()
    };
    let first = calibrate(&volts, &options).unwrap();
    let sensitivity = first.sensitivity.unwrap();
    let sader = first.sader.unwrap();
    let air = Fluid::air(TEMPERATURE).unwrap();
    close(
        sader.stiffness.value,
        plan.stiffness(F0, Q, &air).unwrap(),
        1e-6,
    );
    assert_eq!(first.stiffness, Some(sader.stiffness));
    let with = Options {
        sensitivity: Some(Sensitivity {
            value: sensitivity.value,
            relative_error: 0.0,
        }),
        ..options.clone()
    };
    let second = calibrate(&volts, &with).unwrap();
    close(
        second.stiffness.unwrap().value,
        sader.stiffness.value,
        1e-12,
    );
    // Only the dimensions matter here: k ∝ L b^(2 + d ln Γᵢ/d ln b), by differences.
    let wider = Plan {
        width: plan.width * 1.001,
        ..plan
    };
    let ratio = wider.stiffness(F0, Q, &air).unwrap() / plan.stiffness(F0, Q, &air).unwrap();
    let power = nanotap_arithmetic::ln(ratio) / nanotap_arithmetic::ln(1.001);
    let of_plan = 0.02 * (1.0 + power * power).sqrt();
    let mut without = options;
    without.plan_error = 0.0;
    let of_fit = calibrate(&volts, &without)
        .unwrap()
        .sader
        .unwrap()
        .stiffness
        .relative_error;
    close(
        sader.stiffness.relative_error,
        nanotap_arithmetic::hypot(of_fit, of_plan),
        1e-3,
    );
}

#[test]
fn a_reference_of_the_same_shape() {
    let options = Options {
        reference: Some(ReferenceLever {
            stiffness: 3.0,
            frequency: F0,
            quality: Q,
        }),
        ..Options::default()
    };
    let calibration = calibrate(&spectrum(Unit::Volt, 1e8), &options).unwrap();
    close(calibration.sader.unwrap().stiffness.value, 3.0, 1e-6);
}

#[test]
fn the_methods_contradict_each_other() {
    let plan = Plan {
        length: 225e-6,
        width: 38e-6,
    };
    let sader = plan
        .stiffness(F0, Q, &Fluid::air(TEMPERATURE).unwrap())
        .unwrap();
    let options = Options {
        plan: Some(plan),
        ..Options::default()
    };
    for (ratio, differ) in [(0.5, true), (0.9, false), (1.2, false), (1.6, true)] {
        let of = spectrum(Unit::Metre, (K / (ratio * sader)).sqrt());
        let calibration = calibrate(&of, &options).unwrap();
        close(calibration.stiffness.unwrap().value / sader, ratio, 1e-6);
        let warnings = &calibration.warnings;
        let is_about_methods = |of: &Warning| matches!(of, Warning::Methods { .. });
        assert_eq!(
            warnings.iter().any(is_about_methods),
            differ,
            "{warnings:?}"
        );
    }
}

/// Amplitudes and two-sided densities are the same spectrum, written otherwise.
#[test]
fn ways_to_write_a_density() {
    let frequency = frequencies(50.0);
    let options = Options::default();
    let amplitudes: Vec<f64> = frequency.iter().map(|f| exact(*f).sqrt()).collect();
    let of = Spectrum::new(&frequency, &amplitudes, Density::Amplitude, Unit::Metre).unwrap();
    let of = of.with_averages(100.0, Average::Powers).unwrap();
    close(
        calibrate(&of, &options).unwrap().stiffness.unwrap().value,
        K,
        1e-7,
    );
    let halves: Vec<f64> = frequency.iter().map(|f| 0.5 * exact(*f)).collect();
    let of = Spectrum::new(&frequency, &halves, Density::Power, Unit::Metre).unwrap();
    let of = of
        .from_two_sided()
        .with_averages(100.0, Average::Powers)
        .unwrap();
    close(
        calibrate(&of, &options).unwrap().stiffness.unwrap().value,
        K,
        1e-7,
    );
    // The mean of n amplitudes a of powers with mean S: E[a]² = π/4 S, E[ā²] = (π/4 + (1 − π/4)/n) S.
    let low: Vec<f64> = frequency
        .iter()
        .map(|f| (exact(*f) * (FRAC_PI_4 + (1.0 - FRAC_PI_4) / 50.0)).sqrt())
        .collect();
    let of = Spectrum::new(&frequency, &low, Density::Amplitude, Unit::Metre).unwrap();
    let of = of.with_averages(50.0, Average::Amplitudes).unwrap();
    close(
        calibrate(&of, &options).unwrap().stiffness.unwrap().value,
        K,
        1e-7,
    );
}

/// Means over 1/25 of an octave are as wide as the peak: their density at the centre would give a
/// wrong Q.
#[test]
fn a_logarithmic_axis() {
    let fine = 500;
    let ratio = nanotap_arithmetic::exp2(1.0 / 60.0);
    let frequency: Vec<f64> = (0..250)
        .map(|k| 20e3 * nanotap_arithmetic::powf(ratio, f64::from(k)))
        .collect();
    let mean = |f: &f64| {
        let width = f * (1.0 - 1.0 / ratio);
        let at = |k: i32| f + width * ((f64::from(k) + 0.5) / f64::from(fine) - 0.5);
        (0..fine).map(|k| exact(at(k))).sum::<f64>() / f64::from(fine)
    };
    let power: Vec<f64> = frequency.iter().map(mean).collect();
    let of = Spectrum::new(&frequency, &power, Density::Power, Unit::Metre).unwrap();
    let of = of.with_averages(10.0, Average::Powers).unwrap();
    let calibration = calibrate(&of, &Options::default()).unwrap();
    close(calibration.quality.value, Q, 0.02);
    close(calibration.stiffness.unwrap().value, K, 0.01);
    assert!(
        calibration
            .warnings
            .iter()
            .any(|of| matches!(of, Warning::WideBins { .. }))
    );
}

#[test]
fn lines_are_left_out_and_named() {
    let lines = [60e3, 74.9e3, 90e3];
    let extra = |f: f64| {
        let is_line = lines.iter().any(|line| (f - line).abs() < 1.0);
        if is_line { 60.0 * exact(f) } else { 0.0 }
    };
    let (frequency, power) = noisy(10, 50.0, extra);
    let of = Spectrum::new(&frequency, &power, Density::Power, Unit::Metre).unwrap();
    let of = of.with_averages(10.0, Average::Powers).unwrap();
    let calibration = calibrate(&of, &Options::default()).unwrap();
    let named: Vec<f64> = calibration
        .warnings
        .iter()
        .filter_map(|of| match of {
            Warning::ForeignPeak { frequency, .. } => Some(*frequency),
            _ => None,
        })
        .collect();
    for line in lines {
        assert!(
            named.iter().any(|of| (of - line).abs() < 1.0),
            "{line}: {named:?}"
        );
    }
    assert_eq!(named.len(), 3);
    let [low, high] = calibration.stiffness.unwrap().interval;
    assert!(low < K && K < high && high / low < 1.6, "{low} {high}");
}

/// A resonance that moves by 1.6 of its widths: the mean of the spectra is not an oscillator's.
#[test]
fn a_drifted_resonance() {
    let mut state = 77;
    let frequency = frequencies(50.0);
    let mut power = vec![0.0; frequency.len()];
    for k in 0..200_u32 {
        let f0 = F0 * (1.0 + 0.02 * (f64::from(k) / 200.0 - 0.5));
        for (sum, f) in power.iter_mut().zip(&frequency) {
            let s = density(*f, f0, Q, mean_square(), floor());
            *sum += s * exponential(&mut state) / 200.0;
        }
    }
    let of = Spectrum::new(&frequency, &power, Density::Power, Unit::Metre).unwrap();
    let of = of.with_averages(200.0, Average::Powers).unwrap();
    let calibration = calibrate(&of, &Options::default()).unwrap();
    assert!(calibration.scatter.is_misfit);
    assert!(
        calibration
            .warnings
            .iter()
            .any(|of| matches!(of, Warning::Drift { .. }))
    );
    // The power stays: k is right within its interval, Q is low.
    let [low, high] = calibration.stiffness.unwrap().interval;
    assert!(low < K && K < high, "{low} {high}");
    assert!(
        calibration.quality.value < 0.95 * Q,
        "{:?}",
        calibration.quality
    );
}

/// A number of averages that is too large would make the interval too narrow.
#[test]
fn averages_that_the_scatter_contradicts() {
    let (frequency, power) = noisy(10, 50.0, |_| 0.0);
    let of = Spectrum::new(&frequency, &power, Density::Power, Unit::Metre).unwrap();
    let stated = calibrate(
        &of.clone().with_averages(1000.0, Average::Powers).unwrap(),
        &Options::default(),
    );
    let stated = stated.unwrap();
    assert!(
        stated
            .warnings
            .iter()
            .any(|of| matches!(of, Warning::Averages { .. }))
    );
    let open = calibrate(&of, &Options::default()).unwrap();
    assert!(
        (open.scatter.averages / 10.0 - 1.0).abs() < 0.2,
        "{:?}",
        open.scatter
    );
    close(
        stated.stiffness.unwrap().relative_error,
        open.stiffness.unwrap().relative_error,
        1e-12,
    );
}

#[test]
fn a_floor_that_the_range_does_not_show() {
    let frequency = frequencies(50.0);
    let power: Vec<f64> = frequency
        .iter()
        .map(|f| density(*f, F0, Q, mean_square(), 0.0))
        .collect();
    let of = Spectrum::new(&frequency, &power, Density::Power, Unit::Metre).unwrap();
    let of = of.with_averages(100.0, Average::Powers).unwrap();
    let calibration = calibrate(&of, &Options::default()).unwrap();
    assert!(calibration.floor.is_none() && calibration.warnings.contains(&Warning::NoFloor));
    close(calibration.stiffness.unwrap().value, K, 1e-3);
}

#[test]
fn faulty_input_is_refused() {
    let good = spectrum(Unit::Metre, 1.0);
    let refuse = |change: fn(&mut Options)| {
        let mut options = Options::default();
        change(&mut options);
        calibrate(&good, &options).unwrap_err()
    };
    assert!(matches!(
        refuse(|of| of.temperature = -1.0),
        Error::Option { .. }
    ));
    assert!(matches!(
        refuse(|of| of.range = Some([5e3, 1e3])),
        Error::Option { .. }
    ));
    assert!(matches!(
        refuse(|of| of.range = Some([5e3, 5.3e3])),
        Error::TooFew { .. }
    ));
    assert!(matches!(refuse(|of| of.tilt = PI), Error::Option { .. }));
    let factor = ModeFactor {
        product: f64::NAN,
        ..ModeFactor::default()
    };
    let options = Options {
        factor,
        ..Options::default()
    };
    assert!(calibrate(&good, &options).is_err());
    // Spectra of nothing, of zeros and of extremes give an error or a result, never a panic.
    let of = |power: Vec<f64>| {
        let frequency: Vec<f64> = (1..=power.len()).map(|k| k as f64).collect();
        Spectrum::new(&frequency, &power, Density::Power, Unit::Metre)
    };
    assert!(calibrate(&of(Vec::new()).unwrap(), &Options::default()).is_err());
    assert!(calibrate(&of(vec![0.0; 100]).unwrap(), &Options::default()).is_err());
    for value in [1.0, 1e-300, 1e300] {
        let _ = calibrate(&of(vec![value; 100]).unwrap(), &Options::default());
    }
    let mut spike = vec![0.0; 100];
    spike[50] = 1.0;
    let _ = calibrate(&of(spike).unwrap(), &Options::default());
    assert!(of(vec![f64::INFINITY]).is_err());
}
