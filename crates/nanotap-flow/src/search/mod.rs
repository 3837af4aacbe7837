//! The certified first zero of a signal: no contact can be missed, however brief
//! or grazing.
//!
//! Value, rate and curvature at a point and a bound `B` on the third derivative
//! from there on enclose the signal between two cubics,
//! `g + ġh + ½g̈h² ∓ ⅙Bh³`. The signal is positive for certain up to the first
//! zero of the lower cubic, so a step of that length cannot jump over a zero; it
//! turns into a third-order root finder close to one. When the upper cubic crosses
//! zero and the rate is negative for certain up to there, the zero is bracketed
//! and unique, and a safeguarded Newton–Halley iteration finishes, its own last
//! error bounded by `B`.
//!
//! Far from zero longer steps come from lower bounds of the signal that follow only its
//! slowest terms and replace each faster one by minus its amplitude.
//!
//! Two places need more than double precision's plain sums. Near a tangency the
//! sign of the extremum can drown in rounding: it is then found in twice double
//! precision, so that a dip of 1e-17 is resolved. Right after a switch the
//! signal is zero *by definition* and the next zero may be arbitrarily close: the
//! zero is divided out of the Taylor series, whose remainder is bounded, and the
//! quotient is searched.
//!
//! Limit: a triple zero (value, rate and curvature all zero within rounding) cannot be
//! distinguished from a near miss. The value in twice double precision at the visited points
//! then decides, and the crossing is reported as grazing.
//!
//! Modules call downwards only: a tabulated guard is searched on its table (`on_table`), by a
//! `walk` along the points of a `table`; what that cannot decide is left to certified steps
//! (`steps`). `range` and [`sign_changes()`] look for extrema with the same means.

pub(crate) mod interval;
pub(crate) mod near;
pub(crate) mod on_table;
pub(crate) mod range;
pub(crate) mod side_by_side;
mod sign_changes;
mod steps;
pub(crate) mod tabulated;
#[cfg(test)]
mod tests;
pub(crate) mod walk;

use crate::signal::Signal;
use crate::simd::{self, LARGEST_ANGLE, Library, Work};

pub use sign_changes::sign_changes;
pub(crate) use steps::BySteps;

/// Where the search starts from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// Inside the regime, the signal positive.
    Inside,
    /// On the surface, the signal zero and rising. `rate` overrides its first
    /// derivative where the caller knows it better than the signal does.
    Surface {
        /// The rate of leaving the surface, if known.
        rate: Option<f64>,
    },
    /// On the surface with rate and curvature zero as well: release from sticking.
    Release,
    /// On the surface, with further derivatives zero by what is known of the start.
    Flat {
        /// How many derivatives vanish, the value counted as the first.
        vanishing: usize,
        /// The first that does not.
        derivative: f64,
    },
}

/// A zero of a signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Where.
    pub at: f64,
    /// The signal's rate there, negative or (at a grazing touch) zero.
    pub rate: f64,
    /// Whether value and rate vanish together within rounding.
    pub grazing: bool,
    /// Whether the rate is more accurate than the sum of the signal's terms.
    pub refined: bool,
}

/// What a search cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Evaluations of the signal with its derivatives.
    pub evaluations: u64,
    /// Certified steps.
    pub steps: u64,
    /// Tangencies decided in twice double precision.
    pub tangencies: u64,
    /// Points of tables at which exponentials were looked up, not computed.
    pub points: u64,
}

/// The first `s` in `(0, length]` where the signal falls to zero, or `None` when it
/// stays positive for certain.
pub fn first_crossing(
    signal: &Signal,
    length: f64,
    start: Start,
    statistics: &mut Statistics,
) -> Option<Crossing> {
    let search = BySteps {
        signal,
        length,
        from: 0.0,
        limit: length,
        start,
        statistics,
    };
    if signal.fastest() * length < LARGEST_ANGLE {
        simd::dispatch(search)
    } else {
        search.run::<Library>()
    }
}
