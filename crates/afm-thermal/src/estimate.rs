//! An estimate with its 95 % interval.

use schemars::JsonSchema;
use serde::Serialize;

/// The 97.5 % quantile of the normal distribution.
const TWO_SIDED_95: f64 = 1.959_963_984_540_054;

/// A positive quantity with its uncertainty, whose logarithm is normally distributed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Relative standard error.
    pub relative_error: f64,
    /// Ends of the 95 % interval.
    pub interval: [f64; 2],
}

impl Estimate {
    /// Creates the estimate from the value and the standard error of its logarithm.
    pub fn new(value: f64, relative_error: f64) -> Self {
        let factor = nanotap_arithmetic::exp(TWO_SIDED_95 * relative_error);
        Self {
            value,
            relative_error,
            interval: [value / factor, value * factor],
        }
    }
}
