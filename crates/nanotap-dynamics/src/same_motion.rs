//! Whether two motions are the same.

use crate::orbit::PeriodicOrbit;

/// Decides whether two motions are the same.
///
/// Closed orbits are known far better than [`TOLERANCE`](Self::TOLERANCE), and where they are not, their
/// error estimates say so. Two motions that coexist so near to each other do so only next to a
/// bifurcation, where they differ by the root of the distance to it: within about 1e-12 of the
/// parameter's range.
#[derive(Clone, Copy, Debug)]
pub struct SameMotion;

impl SameMotion {
    /// Relative difference up to which motions are the same.
    pub const TOLERANCE: f64 = 1e-6;

    /// Whether two orbits are one up to a cyclic shift: as near as ten times the sum of their error
    /// estimates and the tolerance times their size.
    pub fn orbits(a: &PeriodicOrbit, b: &PeriodicOrbit) -> bool {
        let rounding = 10.0 * (a.error + b.error);
        a.distance_to(b).1 <= rounding + Self::TOLERANCE * a.scale().min(b.scale())
    }

    /// Whether two motions of which only a number is known, an amplitude for example, are the same.
    pub fn numbers(a: f64, b: f64) -> bool {
        let apart = (a - b).abs() > Self::TOLERANCE * a.abs().max(b.abs());
        !apart
    }
}
