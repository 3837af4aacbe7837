//! The periodic drive: a period and the tones (integer multiples of its
//! frequency) that the forcing and the guards may contain.

use crate::{Complex, FlowError};
use std::f64::consts::TAU;

/// A periodic drive with tones `ω_k = h_k · 2π/T`.
///
/// Several tones (two-tone, bimodal drive) share the period `T`, after which the
/// system is the same again; this is the period of the stroboscopic map.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    period: f64,
    harmonics: Vec<u32>,
    frequencies: Vec<f64>,
    repeats: bool,
}

impl Drive {
    /// Creates a drive of period `period` whose tones are the given harmonics of `2π/period`.
    ///
    /// # Errors
    /// If the period is not positive and finite, or a harmonic is zero.
    pub fn new(period: f64, harmonics: &[u32]) -> Result<Self, FlowError> {
        if !(period.is_finite() && period > 0.0) {
            return Err(FlowError::Drive {
                what: format!("a period of {period}"),
            });
        }
        if harmonics.contains(&0) {
            return Err(FlowError::Drive {
                what: "a harmonic of 0".into(),
            });
        }
        let frequencies = harmonics
            .iter()
            .map(|&h| f64::from(h) * TAU / period)
            .collect();
        Ok(Self {
            period,
            harmonics: harmonics.to_vec(),
            frequencies,
            repeats: true,
        })
    }

    /// Creates a drive with a single tone of angular frequency `omega`.
    ///
    /// # Errors
    /// If `omega` is not positive and finite.
    pub fn single(omega: f64) -> Result<Self, FlowError> {
        if !(omega.is_finite() && omega > 0.0) {
            return Err(FlowError::Drive {
                what: format!("an angular frequency of {omega}"),
            });
        }
        let mut drive = Self::new(TAU / omega, &[1])?;
        drive.frequencies[0] = omega;
        Ok(drive)
    }

    /// Creates a drive with tones of these angular frequencies that do not repeat after `period`. A
    /// flow runs no further than to its end, and starts again from the state there under tones with
    /// other phases.
    ///
    /// # Errors
    /// If the period or a frequency is not positive and finite.
    pub fn unlocked(period: f64, frequencies: &[f64]) -> Result<Self, FlowError> {
        let tones = frequencies.iter().map(|omega| Self::single(*omega));
        let tones = tones.collect::<Result<Vec<Self>, FlowError>>()?;
        let mut drive = Self::new(period, &vec![1; tones.len()])?;
        drive.frequencies = tones.iter().map(|tone| tone.frequencies[0]).collect();
        drive.repeats = false;
        Ok(drive)
    }

    /// Returns the drive period `T`, in the system's unit of time.
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Whether all tones are the same again after the period.
    pub const fn repeats(&self) -> bool {
        self.repeats
    }

    /// Returns the harmonics `h_k`, one per tone; 1 for each tone of [`Drive::unlocked`].
    pub fn harmonics(&self) -> &[u32] {
        &self.harmonics
    }

    /// Returns the angular frequencies `ω_k` of the tones, in radians per unit of time.
    pub fn frequencies(&self) -> &[f64] {
        &self.frequencies
    }

    /// Returns `e^{iω_k t}` of tone `k` at time `t`.
    pub fn phasor(&self, k: usize, t: f64) -> Complex {
        if t == 0.0 {
            return Complex::new(1.0, 0.0);
        }
        let (sin, cos) = nanotap_arithmetic::sin_cos(self.frequencies[k] * t);
        Complex::new(cos, sin)
    }
}
