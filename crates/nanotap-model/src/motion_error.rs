//! Why a motion could not be followed.

use nanotap_flow::FlowError;
use nanotap_volterra::VolterraError;

/// Why a motion could not be followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// The exact flow of a piecewise-linear model failed.
    #[error(transparent)]
    Flow(#[from] FlowError),
    /// The flow under a nonlinear force failed.
    #[error(transparent)]
    Nonlinear(#[from] VolterraError),
    /// A time series has more rows than the maximum.
    #[error("a time series of {rows} rows is too long; {most} at most are made")]
    TooManyRows {
        /// Number of rows that the series would have.
        rows: usize,
        /// Maximum number of rows.
        most: usize,
    },
}

impl MotionError {
    /// Returns true if the motion left every bound.
    pub const fn is_unbounded(&self) -> bool {
        matches!(
            self,
            Self::Flow(FlowError::Diverged { .. } | FlowError::NotFinite { .. })
                | Self::Nonlinear(VolterraError::Diverged { .. })
        )
    }
}

impl From<MotionError> for nanotap_error::Error {
    fn from(error: MotionError) -> Self {
        match error {
            MotionError::Flow(error) => error.into(),
            MotionError::Nonlinear(error) => error.into(),
            MotionError::TooManyRows { .. } => Self::input(
                error.to_string(),
                "take fewer {periods} or a lower {resolution}",
            ),
        }
    }
}
