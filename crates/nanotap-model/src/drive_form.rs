//! How the lever is driven: where, and with how many tones.
//!
//! A tone is A sin(wτ + θ). Driven through the base (the paper's piezo), the clamped end
//! moves by A in units of g₀. Driven directly, a force of amplitude A in units of EI g₀/L³ (a
//! third of k g₀) acts on the tip (a magnet) or is spread evenly over the beam (light, heat),
//! the clamped end is at rest, and the gap is not modulated. A static force A at the tip would bend it
//! by A/3.
//!
//! A second tone, and a third, has p/q of the first one's frequency. All repeat after as many
//! periods of the first as the least common multiple of the q, and the stroboscopic map is of that
//! period. Two tones of any other ratio never repeat together: their motion is a torus, and only
//! `bimodal` computes it.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::words::words;
use nanotap_quantity::number::shortest;

words! {
    /// Where the drive acts: at the clamped end, at the tip, or along the beam.
    Actuation {
        /// The clamped end is moved, as in the paper.
        Base = "base",
        /// A force at the tip (magnetic).
        Tip = "tip",
        /// A force spread evenly over the beam (photothermal, electrostatic).
        Distributed = "distributed",
    }
}

words! {
    /// The quantity of the drive that stays constant while another key varies.
    Hold {
        /// The amplitude or force of the drive, as of a piezo at constant voltage.
        Drive = "drive",
        /// The free amplitude of the tip: the drive follows the key that varies.
        FreeAmplitude = "free_amplitude",
    }
}

impl Actuation {
    /// Returns a description in a few words.
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::Base => "the clamped end is moved",
            Self::Tip => "a force at the tip",
            Self::Distributed => "a force spread evenly over the beam",
        }
    }
}

/// A ratio of two frequencies, not 1: of whole numbers in lowest terms, or another number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrequencyRatio {
    numerator: u32,
    denominator: u32,
    value: f64,
}

/// Largest number of tones of a drive, the first included.
pub const MAX_TONES: usize = 3;

/// Largest denominator and largest numerator of a ratio. The first is also the largest number of
/// periods of the first tone after which all repeat.
pub(crate) const LARGEST: (u32, u32) = (2_000, 20_000);
/// Relative distance within which a number counts as a ratio of whole numbers.
const NEAR: f64 = 1e-9;

/// Why a ratio of two frequencies is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RatioError {
    /// The text is not a ratio of positive numbers.
    #[error(
        "\"{given}\" is not a ratio of frequencies; write it as in \"25/4\", with whole numbers"
    )]
    Form {
        /// Text that was given as the ratio.
        given: String,
    },
    /// The numerator or the denominator is zero or too large.
    #[error(
        "{numerator}/{denominator} is out of range: the numerator goes from 1 to {}, the denominator, in \
         lowest terms, from 1 to {}", LARGEST.1, LARGEST.0
    )]
    Range {
        /// Numerator as given, not reduced to lowest terms.
        numerator: u64,
        /// Denominator as given, not reduced to lowest terms.
        denominator: u64,
    },
    /// The ratio is 1: both tones have the same frequency.
    #[error("the two tones have the same frequency: add their amplitudes to one tone")]
    One,
    /// Not a ratio of small whole numbers.
    #[error(
        "the ratio {ratio} of the two frequencies is not a fraction with a denominator up to {}, so the drive \
         would not repeat; the nearest is {nearest}", LARGEST.0
    )]
    Irrational {
        /// Ratio of the frequencies as given, dimensionless.
        ratio: f64,
        /// Nearest ratio that is allowed.
        nearest: FrequencyRatio,
    },
}

impl FrequencyRatio {
    /// `numerator / denominator` in lowest terms.
    ///
    /// # Errors
    /// [`RatioError`] when a term is zero or too large, or the ratio is 1.
    pub fn new(numerator: u64, denominator: u64) -> Result<Self, RatioError> {
        let range = RatioError::Range {
            numerator,
            denominator,
        };
        if numerator == 0 || denominator == 0 {
            return Err(range);
        }
        let divisor = greatest_divisor(numerator, denominator);
        let terms = [numerator, denominator].map(|term| u32::try_from(term / divisor));
        let [Ok(numerator), Ok(denominator)] = terms else {
            return Err(range);
        };
        if numerator > LARGEST.1 || denominator > LARGEST.0 {
            return Err(range);
        }
        if numerator == denominator {
            return Err(RatioError::One);
        }
        Ok(Self {
            numerator,
            denominator,
            value: f64::from(numerator) / f64::from(denominator),
        })
    }

    /// Returns the ratio of two tones that need not repeat together. The map of such a drive covers
    /// one period of the first tone, and the phase of the second tone differs from one period to
    /// the next.
    pub const fn unlocked(value: f64) -> Self {
        Self {
            numerator: 0,
            denominator: 1,
            value,
        }
    }

    /// Returns a ratio of whole numbers where `ratio` equals one within a relative 10⁻⁹, and otherwise
    /// the ratio of two tones that never repeat together.
    ///
    /// # Errors
    /// [`RatioError`] where `ratio` is not within the range of the ratios of whole numbers.
    pub fn any(ratio: f64) -> Result<Self, RatioError> {
        let range = 1.0 / f64::from(LARGEST.0)..=f64::from(LARGEST.1);
        match Self::of(ratio) {
            Err(RatioError::Irrational { .. }) if range.contains(&ratio) => {
                Ok(Self::unlocked(ratio))
            }
            read => read,
        }
    }

    /// Whether both tones repeat after [`denominator`](Self::denominator) periods of the first.
    pub const fn repeats(self) -> bool {
        self.numerator > 0
    }

    /// Finds the ratio of whole numbers that `ratio` equals within a relative 10⁻⁹.
    ///
    /// # Errors
    /// [`RatioError::Irrational`] with the nearest allowed ratio, if there is no such ratio.
    pub fn of(ratio: f64) -> Result<Self, RatioError> {
        let mut nearest: Option<(f64, Self)> = None;
        for denominator in 1..=u64::from(LARGEST.0) {
            let numerator = (ratio * denominator as f64).round().clamp(0.0, 1e9) as u64;
            let distance = (numerator as f64 / denominator as f64 - ratio).abs();
            if distance <= NEAR * ratio.abs() {
                return Self::new(numerator, denominator);
            }
            if let Ok(near) = Self::new(numerator, denominator)
                && nearest.is_none_or(|(d, _)| distance < d)
            {
                nearest = Some((distance, near));
            }
        }
        Err(match nearest {
            Some((_, nearest)) => RatioError::Irrational { ratio, nearest },
            None => RatioError::Form {
                given: ratio.to_string(),
            },
        })
    }

    /// Returns p, the number of periods of the tone in one repetition of it and the first; 0 if the
    /// two never repeat together.
    pub const fn numerator(self) -> u32 {
        self.numerator
    }

    /// Returns q, the number of periods of the first tone in one repetition of both.
    pub const fn denominator(self) -> u32 {
        self.denominator
    }

    /// Returns the frequency of the tone over that of the first, p/q, dimensionless.
    pub const fn value(self) -> f64 {
        self.value
    }
}

/// Periods of the first tone after which all tones repeat, for the ratios of the others: the least
/// common multiple of their denominators.
pub(crate) fn repetition(further: &[FrequencyRatio]) -> u64 {
    let multiple = |a: u64, b: u64| a / greatest_divisor(a, b) * b;
    let denominators = further.iter().map(|ratio| u64::from(ratio.denominator()));
    denominators.fold(1, multiple)
}

const fn greatest_divisor(mut a: u64, mut b: u64) -> u64 {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a
}

impl fmt::Display for FrequencyRatio {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.repeats() {
            write!(formatter, "{}/{}", self.numerator, self.denominator)
        } else {
            formatter.write_str(&shortest(self.value))
        }
    }
}

impl Serialize for FrequencyRatio {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl FromStr for FrequencyRatio {
    type Err = RatioError;

    /// Reads `25/4`, `6`, `6.25`, or a number that is not a ratio of whole numbers: `6.2599718`.
    fn from_str(given: &str) -> Result<Self, RatioError> {
        let form = || RatioError::Form {
            given: given.to_owned(),
        };
        if let Some((numerator, denominator)) = given.split_once('/') {
            let whole = |text: &str| text.trim().parse::<u64>().map_err(|_| form());
            return Self::new(whole(numerator)?, whole(denominator)?);
        }
        match given.trim().parse::<f64>() {
            Ok(ratio) if ratio.is_finite() && ratio > 0.0 => Self::any(ratio),
            _ => Err(form()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_read_and_reduced() {
        for (given, shown) in [
            ("25/4", "25/4"),
            ("50 / 8", "25/4"),
            ("6.25", "25/4"),
            ("3", "3/1"),
        ] {
            let ratio: FrequencyRatio = given.parse().unwrap();
            assert_eq!(ratio.to_string(), shown);
        }
        assert_eq!("25/4".parse::<FrequencyRatio>().unwrap().value(), 6.25);
        for way in Actuation::ALL {
            assert_eq!(way.name().parse(), Ok(way));
        }
        assert!("magnet".parse::<Actuation>().is_err());
    }

    /// π is 22/7 to a denominator of 64 at the most: 201/64 is 3.140625, 22/7 3.142857,
    /// 179/57 3.140351; the nearest of all is 201/64 … 22/7; found by looking at each.
    #[test]
    fn what_is_no_ratio_is_refused_with_the_nearest() {
        let pi = std::f64::consts::PI;
        let refused = FrequencyRatio::of(pi).unwrap_err();
        let best = (1..=LARGEST.0)
            .map(|q| ((std::f64::consts::PI * f64::from(q)).round(), q))
            .min_by(|a, b| {
                let off = |(p, q): &(f64, u32)| (p / f64::from(*q) - std::f64::consts::PI).abs();
                off(a).total_cmp(&off(b))
            })
            .unwrap();
        assert!(
            refused
                .to_string()
                .ends_with(&format!("{}/{}", best.0, best.1))
        );
        let unlocked: FrequencyRatio = "3.141592653589793".parse().unwrap();
        assert!(!unlocked.repeats() && unlocked.value() == pi);
        assert_eq!(unlocked.to_string().parse(), Ok(unlocked));
        for given in [
            "0.000123",
            "31415.9265",
            "",
            "x",
            "1/0",
            "0/3",
            "-2",
            "2/2",
            "1",
            "1/2001",
            "nan",
            "1e300",
            "20001/2",
        ] {
            assert!(given.parse::<FrequencyRatio>().is_err(), "{given}");
        }
    }
}
