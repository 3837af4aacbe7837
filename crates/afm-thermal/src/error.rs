//! What is wrong with a spectrum, a record or an option.

/// The reason why there is no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The lists of frequencies and values have different lengths.
    #[error(
        "{frequencies} frequencies and {values} values; a spectrum needs one value per frequency"
    )]
    Lengths {
        /// Number of frequencies.
        frequencies: usize,
        /// Number of values.
        values: usize,
    },
    /// The frequencies do not ascend.
    #[error(
        "frequency {index} is {frequency} Hz and the one before it {previous} Hz; frequencies must be finite, \
         not negative, and ascend"
    )]
    Frequencies {
        /// Index of the frequency, counted from 0.
        index: usize,
        /// The frequency, Hz.
        frequency: f64,
        /// The frequency before it, Hz.
        previous: f64,
    },
    /// A density is negative or not a number.
    #[error("the density at {frequency} Hz is {value}; it must be finite and not negative")]
    Value {
        /// The frequency, Hz.
        frequency: f64,
        /// The value.
        value: f64,
    },
    /// More bins or samples than are computed.
    #[error("{count} {what}; at most {max} are computed")]
    TooMany {
        /// The number.
        count: usize,
        /// What is counted.
        what: &'static str,
        /// The largest number.
        max: usize,
    },
    /// Fewer bins than the fit needs.
    #[error(
        "{count} bins from {} to {} Hz; the fit needs at least {min}: widen the range, or record a \
         spectrum with finer bins", range[0], range[1]
    )]
    TooFew {
        /// Number of bins in the range.
        count: usize,
        /// Smallest number.
        min: usize,
        /// The range, Hz.
        range: [f64; 2],
    },
    /// A record is too short.
    #[error("{samples} samples; a spectrum needs at least {min}")]
    ShortRecord {
        /// Number of samples.
        samples: usize,
        /// Smallest number.
        min: usize,
    },
    /// A sample of a record is not a number.
    #[error("sample {index} of the record is {value}; samples must be finite")]
    Sample {
        /// Index, counted from 0.
        index: usize,
        /// The value.
        value: f64,
    },
    /// An option has an impossible value.
    #[error("{name} is {value}; expected {expected}")]
    Option {
        /// Name with its unit.
        name: &'static str,
        /// The value.
        value: f64,
        /// Valid values.
        expected: &'static str,
    },
    /// The spectrum has no resonance.
    #[error(
        "no resonance found between {} and {} Hz; name the range of the first mode, or its approximate frequency",
        range[0], range[1]
    )]
    NoResonance {
        /// The range, Hz.
        range: [f64; 2],
    },
    /// The Reynolds number is outside the fit of the hydrodynamic function.
    #[error(
        "the Reynolds number ρωb²/(4η) is {reynolds:.3e}, and the hydrodynamic function is known from 1e-6 to \
         1e4; check width, density and viscosity"
    )]
    Reynolds {
        /// The Reynolds number.
        reynolds: f64,
    },
}

/// Checks an option.
pub(crate) fn require(
    holds: bool,
    name: &'static str,
    value: f64,
    expected: &'static str,
) -> Result<(), Error> {
    if holds {
        Ok(())
    } else {
        Err(Error::Option {
            name,
            value,
            expected,
        })
    }
}

/// Checks that an option is finite and above zero.
pub(crate) fn positive(name: &'static str, value: f64) -> Result<(), Error> {
    let is_positive = value.is_finite() && value > 0.0;
    require(is_positive, name, value, "a finite number above 0")
}
