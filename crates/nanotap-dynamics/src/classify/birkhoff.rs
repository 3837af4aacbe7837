//! Weighted Birkhoff averages: does the motion fill a torus smoothly?
//!
//! Averages of the state with the weight exp(−1/(t(1−t))) along a stretch of T
//! periods converge faster than any power of 1/T on a quasi-periodic motion, and
//! like a random walk on a chaotic one (Das, Sander and Yorke, "Super convergence of
//! ergodic averages for quasiperiodic orbits", Nonlinearity 30, 4111, 2017). The
//! number of digits to which two consecutive stretches agree tells them apart.
//!
//! Fails: near a rotation number that is almost rational, convergence sets in late
//! (few digits: nothing follows); a motion still drifting has few digits too. A
//! periodic motion has all digits, so this says "torus" only of what Newton could
//! not close.

use crate::failure::{MapFailure, advance};
use crate::map::StroboscopicMap;

/// Digits to which the weighted averages over two consecutive stretches of
/// `periods` periods agree, relative to the spread of the motion: the worst
/// coordinate or square of a coordinate, at most 16. The squares are there for motions
/// whose amplitude still drifts: a slow spiral has the averages of a torus, but not
/// its mean squares. `state` is replaced by where the run ends.
///
/// # Errors
/// When the map cannot be followed.
pub fn birkhoff_digits<M: StroboscopicMap>(
    map: &mut M,
    state: &mut [f64],
    periods: usize,
) -> Result<f64, MapFailure> {
    let d = state.len();
    // Small deviations from one state of the motion, so that a mean far from zero
    // costs no digits. Sums: weighted over each stretch, and the range.
    let origin = state.to_vec();
    let mut sums = [vec![0.0; 2 * d], vec![0.0; 2 * d]];
    let mut weights = [0.0, 0.0];
    let mut low = vec![0.0f64; d];
    let mut high = vec![0.0f64; d];
    for (sum, total) in sums.iter_mut().zip(&mut weights) {
        for k in 1..=periods {
            let t = k as f64 / (periods + 1) as f64;
            let weight = nanotap_arithmetic::exp(-1.0 / (t * (1.0 - t)));
            *total += weight;
            for i in 0..d {
                let deviation = state[i] - origin[i];
                sum[i] += weight * deviation;
                sum[d + i] += weight * deviation * deviation;
                low[i] = low[i].min(deviation);
                high[i] = high[i].max(deviation);
            }
            advance(map, state)?;
        }
    }
    let mut digits: f64 = 16.0;
    let widest = low.iter().zip(&high).fold(0.0f64, |m, (l, h)| m.max(h - l));
    for i in 0..d {
        let spread = high[i] - low[i];
        // A coordinate that hardly moves carries rounding, not information.
        if spread <= 1e-9 * widest {
            continue;
        }
        for (k, unit) in [(i, spread), (d + i, spread * spread)] {
            let difference = (sums[0][k] / weights[0] - sums[1][k] / weights[1]).abs();
            digits = digits.min(-nanotap_arithmetic::log10((difference / unit).max(1e-16)));
        }
    }
    Ok(digits)
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    /// A turn by the golden mean about (1, 1).
    #[derive(Clone)]
    struct Turn;

    impl crate::Scheduling for Turn {}

    impl StroboscopicMap for Turn {
        type Error = std::convert::Infallible;

        fn dimension(&self) -> usize {
            2
        }

        fn period(&self) -> f64 {
            1.0
        }

        fn advance(&mut self, state: &mut [f64]) -> Result<(), Self::Error> {
            let (sin, cos) = (std::f64::consts::TAU * 0.618_033_988_749_895).sin_cos();
            let [x, y] = [state[0] - 1.0, state[1] - 1.0];
            state[0] = 1.0 + cos * x - sin * y;
            state[1] = 1.0 + sin * x + cos * y;
            Ok(())
        }

        fn advance_with_jacobian(
            &mut self,
            state: &mut [f64],
            _jacobian: &mut DMatrix<f64>,
        ) -> Result<(), Self::Error> {
            self.advance(state)
        }
    }

    /// Digits are relative to the motion: of a circle of radius 10⁻⁶ about (1, 1) rounding leaves
    /// ten of sixteen.
    #[test]
    fn digits_are_those_of_the_motion() {
        let digits =
            |radius: f64| birkhoff_digits(&mut Turn, &mut [1.0 + radius, 1.0], 4096).unwrap();
        assert!(digits(1.0) > 12.0, "{}", digits(1.0));
        let small = digits(1e-6);
        assert!((7.0..11.0).contains(&small), "{small}");
    }
}
