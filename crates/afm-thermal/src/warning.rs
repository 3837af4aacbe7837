//! What puts a calibration in doubt.

use std::fmt;

use serde::{Serialize, Serializer};

/// A reason to doubt a number of a calibration.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// A narrow peak that is not thermal noise; the fit leaves it out.
    ForeignPeak {
        /// Frequency of its highest bin, Hz.
        frequency: f64,
        /// Its height relative to the fit.
        height: f64,
    },
    /// More peaks that are not thermal noise than are named.
    MoreForeignPeaks {
        /// How many more.
        count: usize,
    },
    /// The spectrum differs from an oscillator by more than its scatter.
    Misfit {
        /// Root mean square of the relative difference.
        difference: f64,
        /// Relative scatter of neighbouring ordinates.
        scatter: f64,
        /// Relative spread of the mean square over the ranges of the fit.
        spread: f64,
    },
    /// The peak has another shape than the oscillator's.
    Drift {
        /// P/S on the flank below f0.
        below: f64,
        /// P/S at the peak.
        peak: f64,
        /// P/S on the flank above f0.
        above: f64,
    },
    /// The bins are too wide for the peak.
    WideBins {
        /// Width of a bin, Hz.
        bin: f64,
        /// Width f0/Q of the peak, Hz.
        peak: f64,
    },
    /// The scatter contradicts the stated number of averages.
    Averages {
        /// Stated number.
        stated: f64,
        /// Number by the scatter of neighbouring ordinates.
        found: f64,
    },
    /// The scatter is that of averaged amplitudes, not powers.
    LooksLikeAmplitudes {
        /// Stated number.
        stated: f64,
        /// Number by the scatter of neighbouring ordinates.
        found: f64,
    },
    /// Neighbouring bins are correlated although no window is stated.
    Correlated {
        /// The factor by which the variances are enlarged.
        inflation: f64,
    },
    /// The range does not contain the resonance.
    OutOfRange {
        /// The resonance frequency, Hz.
        frequency: f64,
        /// The range, Hz.
        range: [f64; 2],
    },
    /// The oscillator is not resonant.
    Overdamped {
        /// The quality factor.
        quality: f64,
    },
    /// The floor is too low to be measured in this range.
    NoFloor,
    /// Thermal method and Sader's method contradict each other.
    Methods {
        /// k of the thermal method, N/m.
        thermal: f64,
        /// k of Sader's method, N/m.
        sader: f64,
    },
    /// Volts without a sensitivity.
    NoSensitivity,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |x: f64| format!("{:.1} %", 100.0 * x);
        match self {
            Self::ForeignPeak { frequency, height } => write!(
                f,
                "narrow peak at {} kHz, {} times as high as the fit: not thermal noise; left out",
                kilo(*frequency),
                short(*height)
            ),
            Self::MoreForeignPeaks { count } => {
                write!(f, "{count} more narrow peaks left out")
            }
            Self::Misfit {
                difference,
                scatter,
                spread,
            } => write!(
                f,
                "the spectrum differs from an oscillator by {} (rms), its scatter is {}; the intervals contain \
                 the spread over the ranges of the fit, {} for the mean square",
                percent(*difference),
                percent(*scatter),
                percent(*spread)
            ),
            Self::Drift { below, peak, above } => write!(
                f,
                "the spectrum is {below:.2}, {peak:.2} and {above:.2} times the fit below, at and above the \
                 resonance: it probably drifted during the averages, and Q is too low"
            ),
            Self::WideBins { bin, peak } => write!(
                f,
                "bins of {} Hz are wider than a quarter of the peak's width of {} Hz: Q is uncertain; record with \
                 finer bins",
                short(*bin),
                short(*peak)
            ),
            Self::Averages { stated, found } => write!(
                f,
                "neighbouring bins scatter as a mean of {} periodograms, not {}; the intervals use {}",
                short(*found),
                short(*stated),
                short(found.min(*stated))
            ),
            Self::LooksLikeAmplitudes { stated, found } => write!(
                f,
                "neighbouring bins scatter as a mean of {} periodograms, as expected of {} averaged amplitudes; \
                 if the instrument averages amplitudes, say so: k is 21 % lower then",
                short(*found),
                short(*stated)
            ),
            Self::Correlated { inflation } => write!(
                f,
                "neighbouring bins are correlated (a window, or smoothing); variances are enlarged by {inflation:.2}"
            ),
            Self::OutOfRange { frequency, range } => write!(
                f,
                "the resonance, {} kHz, is not inside the range from {} to {} kHz",
                kilo(*frequency),
                kilo(range[0]),
                kilo(range[1])
            ),
            Self::Overdamped { quality } => write!(
                f,
                "Q = {quality:.3}: no resonance; k depends on the model of the damping"
            ),
            Self::NoFloor => write!(
                f,
                "no white floor is measurable in the range; the fit has none"
            ),
            Self::Methods { thermal, sader } => write!(
                f,
                "k is {} N/m by the thermal method and {} N/m by Sader's: check sensitivity, averages and plan \
                 dimensions",
                short(*thermal),
                short(*sader)
            ),
            Self::NoSensitivity => write!(
                f,
                "the spectrum is in V: k needs the sensitivity in m/V, or the plan dimensions of the lever"
            ),
        }
    }
}

/// Four significant digits.
fn short(x: f64) -> String {
    let digits = (3 - nanotap_arithmetic::log10(x.abs()).floor() as i32).clamp(0, 12);
    format!("{x:.0$}", digits as usize)
}

fn kilo(x: f64) -> String {
    short(x / 1e3)
}

impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
