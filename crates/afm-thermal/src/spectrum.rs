//! A one-sided power density with what is known of its averages.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::error::require;

/// Largest number of bins of a spectrum.
pub const MAX_BINS: usize = 1 << 22;

/// Kind of the values of a spectrum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Density {
    /// Power density, such as V²/Hz.
    Power,
    /// Amplitude density, such as V/√Hz, the root of a power density.
    Amplitude,
}

/// Unit of the deflection whose density a spectrum is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// Metre: the sensitivity has been applied.
    Metre,
    /// Volt of the detector.
    Volt,
}

impl Unit {
    /// Symbol of the unit.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Volt => "V",
        }
    }
}

/// What was averaged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Average {
    /// Periodograms: powers.
    #[default]
    Powers,
    /// Roots of periodograms: amplitudes. The square of their mean is low by π/4.
    Amplitudes,
}

/// Window of the periodograms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Window {
    /// No window (rectangle): neighbouring ordinates are independent, but the peak leaks.
    None,
    /// Hann.
    Hann,
    /// Blackman.
    Blackman,
}

impl Window {
    /// Coefficients a₀, a₁, a₂ of a₀ + a₁ cos 2πt + a₂ cos 4πt, −½ ≤ t ≤ ½.
    pub(crate) const fn cosines(self) -> [f64; 3] {
        match self {
            Self::None => [1.0, 0.0, 0.0],
            Self::Hann => [0.5, 0.5, 0.0],
            Self::Blackman => [0.42, 0.5, 0.08],
        }
    }

    /// The amplitude spectrum of the window at `x` bins.
    fn line(self, x: f64) -> f64 {
        let [a0, a1, a2] = self.cosines();
        let pair = |k: f64| 0.5 * (sinc(x - k) + sinc(x + k));
        a0 * sinc(x) + a1 * pair(1.0) + a2 * pair(2.0)
    }

    /// The factor 1 + 2 Σ ρₖ² by which correlated neighbours widen intervals, where ρₖ² is the
    /// correlation of ordinates k bins apart: 35/18 for Hann.
    pub fn inflation(self) -> f64 {
        1.0 + 2.0 * (1..=4).map(|k| self.correlation(k)).sum::<f64>()
    }

    /// Correlation of periodogram ordinates `lag` bins apart: the squared Fourier coefficient of the
    /// squared window, relative to that at 0.
    pub fn correlation(self, lag: u32) -> f64 {
        let [a0, a1, a2] = self.cosines();
        // Coefficients of e^{2πikt} of the window, then of its square.
        let single = [0.5 * a2, 0.5 * a1, a0, 0.5 * a1, 0.5 * a2];
        let of_square = |k: usize| -> f64 {
            let products = (k..single.len()).map(|j| single[j] * single[j - k]);
            products.sum()
        };
        let ratio = |k: usize| of_square(k) / of_square(0);
        let lag = lag as usize;
        if lag < single.len() {
            ratio(lag) * ratio(lag)
        } else {
            0.0
        }
    }

    /// Power response to a line `x` bins away; its integral over all x is 1.
    pub(crate) fn leakage(self, x: f64) -> f64 {
        let [a0, a1, a2] = self.cosines();
        let line = self.line(x);
        line * line / (a0 * a0 + 0.5 * (a1 * a1 + a2 * a2))
    }
}

/// sin(πx)/(πx).
fn sinc(x: f64) -> f64 {
    let angle = std::f64::consts::PI * x;
    if angle.abs() < 1e-8 {
        1.0
    } else {
        nanotap_arithmetic::sin(angle) / angle
    }
}

/// One bin of a spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bin {
    /// Centre, Hz.
    pub(crate) frequency: f64,
    /// One-sided power density, unit²/Hz.
    pub(crate) power: f64,
    /// Width, Hz.
    pub(crate) width: f64,
    /// Number of periodogram ordinates whose mean it is.
    pub(crate) ordinates: f64,
}

/// A one-sided power density of the deflection.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    pub(crate) bins: Vec<Bin>,
    pub(crate) unit: Unit,
    pub(crate) density: Density,
    pub(crate) averages: Option<f64>,
    pub(crate) average: Average,
    pub(crate) window: Option<Window>,
}

impl Spectrum {
    /// Creates a spectrum from ascending frequencies in Hz and one-sided densities.
    ///
    /// Bins of unequal width, as of a logarithmic axis, count as means over their width.
    ///
    /// # Errors
    /// If the lists have different lengths or more than [`MAX_BINS`] entries, the frequencies do not
    /// ascend, or a density is negative or not finite.
    pub fn new(
        frequency: &[f64],
        values: &[f64],
        density: Density,
        unit: Unit,
    ) -> Result<Self, Error> {
        if frequency.len() != values.len() {
            return Err(Error::Lengths {
                frequencies: frequency.len(),
                values: values.len(),
            });
        }
        if values.len() > MAX_BINS {
            return Err(Error::TooMany {
                count: values.len(),
                what: "bins",
                max: MAX_BINS,
            });
        }
        let mut previous = f64::NEG_INFINITY;
        for (index, (&f, &value)) in frequency.iter().zip(values).enumerate() {
            if !(f.is_finite() && f >= 0.0 && f > previous) {
                return Err(Error::Frequencies {
                    index,
                    frequency: f,
                    previous,
                });
            }
            // What a file has at zero frequency is the mean, not noise.
            if f > 0.0 && !(value.is_finite() && value >= 0.0) {
                return Err(Error::Value {
                    frequency: f,
                    value,
                });
            }
            previous = f;
        }
        let gaps: Vec<f64> = frequency.windows(2).map(|pair| pair[1] - pair[0]).collect();
        // The smaller one: a gap in a list of equal bins makes no bin wider.
        let width = |k: usize| {
            let before = if k > 0 { gaps[k - 1] } else { f64::INFINITY };
            let after = gaps.get(k).copied().unwrap_or(f64::INFINITY);
            before.min(after)
        };
        let least = gaps.iter().copied().fold(f64::INFINITY, f64::min);
        let bin = |(k, (&frequency, &value)): (usize, (&f64, &f64))| {
            let ratio = width(k) / least;
            Bin {
                frequency,
                power: match density {
                    Density::Power => value,
                    Density::Amplitude => value * value,
                },
                width: width(k),
                // Frequencies printed with few digits are not exactly equidistant.
                ordinates: if ratio < 1.2 { 1.0 } else { ratio },
            }
        };
        let all = frequency.iter().zip(values).enumerate().map(bin);
        Ok(Self {
            bins: all.filter(|bin| bin.frequency > 0.0).collect(),
            unit,
            density,
            averages: None,
            average: Average::Powers,
            window: None,
        })
    }

    /// States the number of periodograms of which each ordinate is the mean, and what was averaged.
    /// Without it, the scatter of the spectrum determines the number.
    ///
    /// The density of averaged amplitudes is divided by π/4 + (1 − π/4)/n, the square of their mean
    /// relative to the power.
    ///
    /// # Errors
    /// If the number is not finite or below 1.
    pub fn with_averages(mut self, averages: f64, average: Average) -> Result<Self, Error> {
        let is_valid = averages.is_finite() && averages >= 1.0;
        require(
            is_valid,
            "the number of averages",
            averages,
            "a number of at least 1",
        )?;
        self.averages = Some(averages);
        Ok(self.averaged(average, averages))
    }

    /// States what was averaged where the number of averages is unknown but large.
    #[must_use]
    pub fn with_average(self, average: Average) -> Self {
        self.averaged(average, f64::INFINITY)
    }

    fn averaged(mut self, average: Average, averages: f64) -> Self {
        let deficit = |of| match of {
            Average::Powers => 1.0,
            Average::Amplitudes => QUARTER_PI + (1.0 - QUARTER_PI) / averages,
        };
        let factor = deficit(self.average) / deficit(average);
        self.average = average;
        for bin in &mut self.bins {
            bin.power *= factor;
        }
        self
    }

    /// States the window of the periodograms. Without it, the correlation of neighbouring bins is
    /// estimated from the spectrum.
    #[must_use]
    pub fn with_window(mut self, window: Window) -> Self {
        self.window = Some(window);
        self
    }

    /// Converts a two-sided density to a one-sided one, which is twice as high.
    #[must_use]
    pub fn from_two_sided(mut self) -> Self {
        for bin in &mut self.bins {
            bin.power *= 2.0;
        }
        self
    }

    /// Number of bins above zero frequency.
    pub fn len(&self) -> usize {
        self.bins.len()
    }

    /// Whether there is no bin above zero frequency.
    pub fn is_empty(&self) -> bool {
        self.bins.is_empty()
    }

    /// Frequencies in Hz.
    pub fn frequencies(&self) -> impl Iterator<Item = f64> + '_ {
        self.bins.iter().map(|bin| bin.frequency)
    }

    /// One-sided power densities in unit²/Hz, corrected for averages of amplitudes.
    pub fn powers(&self) -> impl Iterator<Item = f64> + '_ {
        self.bins.iter().map(|bin| bin.power)
    }

    /// Unit of the deflection.
    pub fn unit(&self) -> Unit {
        self.unit
    }

    /// Effective number of independent powers in each ordinate: a mean of n amplitudes scatters as
    /// one of n/1.093 powers, 4 (4/π − 1) = 1.093.
    pub(crate) fn effective_averages(&self) -> Option<f64> {
        self.averages.map(|n| match self.average {
            Average::Powers => n,
            Average::Amplitudes => amplitude_equivalent(n),
        })
    }
}

/// π/4, the square of the mean amplitude relative to the mean power.
const QUARTER_PI: f64 = std::f64::consts::FRAC_PI_4;

/// Number of averaged powers that scatters as the square of the mean of `n` amplitudes; one amplitude
/// is the root of one power.
pub(crate) fn amplitude_equivalent(n: f64) -> f64 {
    (n / (4.0 * (1.0 / QUARTER_PI - 1.0))).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_of_windows() {
        // Hann: w² = 3/8 + ½ cos + ⅛ cos 2, coefficients ratio 2/3 and 1/6.
        assert!((Window::Hann.correlation(1) - 4.0 / 9.0).abs() < 1e-14);
        assert!((Window::Hann.correlation(2) - 1.0 / 36.0).abs() < 1e-14);
        assert!((Window::Hann.inflation() - 35.0 / 18.0).abs() < 1e-14);
        assert_eq!(Window::None.inflation(), 1.0);
        // By numpy: the squared transform of the square of the window.
        assert!((Window::Blackman.inflation() - 2.348).abs() < 5e-4);
    }

    #[test]
    fn a_window_spreads_power_and_keeps_its_sum() {
        for window in [Window::Hann, Window::Blackman] {
            let sum: f64 = (-400..=400)
                .map(|k| 0.05 * window.leakage(0.05 * f64::from(k)))
                .sum();
            assert!((sum - 1.0).abs() < 1e-6, "{window:?}: {sum}");
        }
        // The equivalent noise bandwidth of Hann is 1.5 bins (F. J. Harris, Proc. IEEE 66, 51 (1978)).
        assert!((Window::Hann.leakage(0.0) - 1.0 / 1.5).abs() < 1e-14);
        assert!((Window::Blackman.leakage(0.0) - 1.0 / 1.7268).abs() < 1e-4);
    }

    #[test]
    fn a_logarithmic_axis_has_means_and_a_gap_has_none() {
        let of = |frequency: &[f64]| {
            let values = vec![1.0; frequency.len()];
            let spectrum = Spectrum::new(frequency, &values, Density::Power, Unit::Volt);
            let bins = spectrum.unwrap().bins;
            bins.iter().map(|bin| bin.ordinates).collect::<Vec<_>>()
        };
        assert_eq!(of(&[0.0, 1.0, 2.0, 3.0, 9.0, 10.0]), vec![1.0; 5]);
        assert_eq!(of(&[1.0, 2.0, 4.0, 8.0]), vec![1.0, 1.0, 2.0, 4.0]);
    }

    #[test]
    fn faulty_spectra_are_refused() {
        let new = |f: &[f64], p: &[f64]| Spectrum::new(f, p, Density::Power, Unit::Volt);
        assert!(matches!(new(&[1.0], &[]), Err(Error::Lengths { .. })));
        let descending = new(&[1.0, 1.0], &[1.0, 1.0]);
        assert!(matches!(
            descending,
            Err(Error::Frequencies { index: 1, .. })
        ));
        let negative = new(&[1.0, 2.0], &[1.0, -1.0]);
        assert!(matches!(negative, Err(Error::Value { .. })));
        assert!(new(&[0.0, 1.0], &[f64::NAN, 1.0]).is_ok());
    }
}
