//! Averaged periodograms of a record of the deflection (P. D. Welch, IEEE Trans. Audio Electroacoust.
//! 15, 70 (1967)).

use nalgebra::Complex;
use nanotap_arithmetic::cos;

use crate::Error;
use crate::error::{positive, require};
use crate::fft::transform;
use crate::spectrum::{Average, Density, MAX_BINS, Spectrum, Unit, Window};

/// Most samples of a record.
pub const MAX_SAMPLES: usize = 1 << 26;
/// Fewest samples of a segment.
const MIN_SEGMENT: usize = 64;
/// Longest segment that is chosen without being requested.
const MAX_CHOSEN_SEGMENT: usize = 1 << 15;

/// How a record is cut into segments.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WelchOptions {
    /// Samples in a segment, rounded down to a power of two; default: an eighth of the record, at most
    /// 32,768.
    pub segment: Option<usize>,
    /// Window; default: Hann. Windowed segments overlap by half, others do not overlap.
    pub window: Option<Window>,
}

/// The one-sided power density of a record with `rate` samples a second, in `unit`²/Hz. The trend of
/// each segment is subtracted. The number of averages is the effective one: overlapping segments are
/// correlated.
///
/// # Errors
/// If the record is too short, too long, or has a sample that is not finite.
pub fn welch(
    record: &[f64],
    rate: f64,
    unit: Unit,
    options: &WelchOptions,
) -> Result<Spectrum, Error> {
    positive("the sampling rate in Hz", rate)?;
    if record.len() < MIN_SEGMENT {
        return Err(Error::ShortRecord {
            samples: record.len(),
            min: MIN_SEGMENT,
        });
    }
    if record.len() > MAX_SAMPLES {
        return Err(Error::TooMany {
            count: record.len(),
            what: "samples",
            max: MAX_SAMPLES,
        });
    }
    if let Some((index, &value)) = record.iter().enumerate().find(|(_, x)| !x.is_finite()) {
        return Err(Error::Sample { index, value });
    }
    let window = options.window.unwrap_or(Window::Hann);
    let length = segment_length(record.len(), options.segment)?;
    let step = match window {
        Window::None => length,
        Window::Hann | Window::Blackman => length / 2,
    };
    let weights = weights(window, length);
    let mut powers = vec![0.0; length / 2 - 1];
    let mut buffer = vec![Complex::new(0.0, 0.0); length];
    let mut count = 0.0;
    for start in (0..=record.len() - length).step_by(step) {
        let segment = &record[start..start + length];
        let [level, slope] = trend(segment);
        let middle = 0.5 * (length as f64 - 1.0);
        for (k, ((value, x), weight)) in buffer.iter_mut().zip(segment).zip(&weights).enumerate() {
            *value = Complex::new((x - level - slope * (k as f64 - middle)) * weight, 0.0);
        }
        transform(&mut buffer);
        // Neither the mean nor half of the sampling rate: they have one degree of freedom, not two.
        for (power, value) in powers.iter_mut().zip(&buffer[1..]) {
            *power += value.norm_sqr();
        }
        count += 1.0;
    }
    let energy: f64 = weights.iter().map(|of| of * of).sum();
    for power in &mut powers {
        *power *= 2.0 / (rate * energy * count);
    }
    // ρ of neighbouring segments; those farther apart do not overlap.
    let overlap = weights[step.min(length)..].iter().zip(&weights);
    let product: f64 = overlap.map(|(a, b)| a * b).sum();
    let correlation = (product / energy) * (product / energy);
    let effective = count / (1.0 + 2.0 * correlation * (1.0 - 1.0 / count));
    let frequency = (1..length / 2).map(|k| rate * k as f64 / length as f64);
    let frequency: Vec<f64> = frequency.collect();
    Ok(Spectrum::new(&frequency, &powers, Density::Power, unit)?
        .with_averages(effective.max(1.0), Average::Powers)?
        .with_window(window))
}

fn segment_length(samples: usize, requested: Option<usize>) -> Result<usize, Error> {
    let wanted = match requested {
        Some(length) => {
            let is_valid = (MIN_SEGMENT..=samples.min(2 * MAX_BINS)).contains(&length);
            let name = "the number of samples in a segment";
            require(
                is_valid,
                name,
                length as f64,
                "64 to the length of the record",
            )?;
            length
        }
        None => (samples / 8).clamp(MIN_SEGMENT, MAX_CHOSEN_SEGMENT),
    };
    Ok(1 << wanted.ilog2())
}

/// The window, periodic.
fn weights(window: Window, length: usize) -> Vec<f64> {
    let [a0, a1, a2] = window.cosines();
    let weight = |k| {
        let angle = std::f64::consts::TAU * (k as f64 / length as f64 - 0.5);
        a0 + a1 * cos(angle) + a2 * cos(2.0 * angle)
    };
    (0..length).map(weight).collect()
}

/// Mean and slope per sample of a segment, by least squares.
fn trend(segment: &[f64]) -> [f64; 2] {
    let n = segment.len() as f64;
    let mean = segment.iter().sum::<f64>() / n;
    let middle = 0.5 * (n - 1.0);
    let moment = |(k, x): (usize, &f64)| (k as f64 - middle) * (x - mean);
    let moment: f64 = segment.iter().enumerate().map(moment).sum();
    [mean, moment / (n * (n * n - 1.0) / 12.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parseval: the integral of the density of a sine is half of its squared amplitude, whatever the
    /// window; a trend does not show.
    #[test]
    fn the_integral_is_the_mean_square() {
        let record: Vec<f64> = (0..4096)
            .map(|k| {
                let t = f64::from(k);
                3.0 * nanotap_arithmetic::sin(0.7 * t) + 5.0 + 1e-3 * t
            })
            .collect();
        for window in [Window::None, Window::Hann, Window::Blackman] {
            let options = WelchOptions {
                segment: Some(1024),
                window: Some(window),
            };
            let spectrum = welch(&record, 2e5, Unit::Volt, &options).unwrap();
            let width = 2e5 / 1024.0;
            let sum: f64 = spectrum.powers().map(|power| width * power).sum();
            assert!((sum / 4.5 - 1.0).abs() < 5e-3, "{window:?}: {sum}");
        }
    }

    /// n_eff = K/(1 + 2ρ(1 − 1/K)) with ρ = 1/36 for Hann and half overlap.
    #[test]
    fn overlap_lowers_the_number_of_averages() {
        let record: Vec<f64> = (0..4096).map(|k| f64::from(k * 7919 % 1009)).collect();
        let options = WelchOptions {
            segment: Some(256),
            window: None,
        };
        let spectrum = welch(&record, 1e6, Unit::Volt, &options).unwrap();
        let exact = 31.0 / (1.0 + 2.0 / 36.0 * (1.0 - 1.0 / 31.0));
        assert!((spectrum.averages.unwrap() - exact).abs() < 1e-9);
    }

    #[test]
    fn faulty_records_are_refused() {
        let of = |record: &[f64], rate| welch(record, rate, Unit::Volt, &WelchOptions::default());
        assert!(matches!(
            of(&[0.0; 10], 1e3),
            Err(Error::ShortRecord { .. })
        ));
        assert!(matches!(
            of(&[f64::NAN; 100], 1e3),
            Err(Error::Sample { index: 0, .. })
        ));
        assert!(matches!(of(&[0.0; 100], 0.0), Err(Error::Option { .. })));
    }
}
