//! The first fall of a resolved guard to zero.

use crate::quadrature::{derivative, series};

/// How a guard behaves on a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fall {
    /// It stays above zero by more than its series can be wrong, or touches zero to rounding.
    None,
    /// It falls through zero at this `u`, the first time.
    At(f64),
}

/// A bracket narrower than this in `u` in which a guard neither certainly falls nor certainly
/// stays above zero is a touch.
const TOUCH: f64 = 1e-9;

/// The first `u` in `[0, 1]` at which the series `c` (positive at 0) falls through zero.
///
/// An interval is discarded when the chord less the bound `w²/8 max|g''|` stays above zero,
/// and a sign change is taken for the first one when the slope is certainly negative over
/// its bracket. The bounds of the derivatives are the sums of the sizes of their
/// coefficients, so that between them nothing is left to sampling.
pub(crate) fn first_fall(c: &[f64], scratch: &mut Vec<f64>) -> Fall {
    let n = c.len();
    let rest: f64 = c[1..].iter().map(|c| c.abs()).sum();
    if c[0] > rest {
        return Fall::None;
    }
    scratch.clear();
    scratch.resize(2 * n, 0.0);
    let (slope, curvature) = scratch.split_at_mut(n);
    derivative(c, slope);
    derivative(slope, curvature);
    let bound: f64 = curvature.iter().map(|c| c.abs()).sum();
    let value = |u: f64| series(c, u);
    let first = value(0.0);
    if first < 0.0 {
        return Fall::At(0.0);
    }
    let mut stack = vec![(0.0, 1.0, first, value(1.0))];
    while let Some((a, b, at_a, at_b)) = stack.pop() {
        let width: f64 = b - a;
        let sag = 0.125 * width * width * bound;
        if at_a.min(at_b) > sag {
            continue;
        }
        let middle = 0.5 * (a + b);
        if at_b <= 0.0 {
            let steepest_up = series(slope, middle) + 0.5 * width * bound;
            if steepest_up < 0.0 || width < TOUCH {
                return Fall::At(root(c, slope, a, b));
            }
        } else if width < TOUCH {
            continue;
        }
        let at_middle = value(middle);
        stack.push((middle, b, at_middle, at_b));
        if at_middle <= 0.0 {
            // The first fall is in the left half.
            stack.clear();
        }
        stack.push((a, middle, at_a, at_middle));
    }
    Fall::None
}

/// The zero in a bracket, by Newton kept inside it.
fn root(c: &[f64], slope: &[f64], mut a: f64, mut b: f64) -> f64 {
    let mut u = 0.5 * (a + b);
    for _ in 0..80 {
        let g = series(c, u);
        if g > 0.0 {
            a = u;
        } else {
            b = u;
        }
        let next = u - g / series(slope, u);
        let next = if next > a && next < b {
            next
        } else {
            0.5 * (a + b)
        };
        if (next - u).abs() <= 1e-16 {
            break;
        }
        u = next;
    }
    u
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quadrature::{chebyshev_coefficients, chebyshev_nodes};

    fn coefficients(f: impl Fn(f64) -> f64) -> Vec<f64> {
        let n = 24;
        let matrix = chebyshev_coefficients(n);
        let mut c = vec![0.0; n];
        for (i, u) in chebyshev_nodes(n).into_iter().enumerate() {
            for j in 0..n {
                c[j] += matrix[i * n + j] * f(u);
            }
        }
        c
    }

    #[test]
    fn the_first_of_many_falls_is_found() {
        let mut scratch = Vec::new();
        let c = coefficients(|u| (9.0 * u).cos() + 0.2);
        let Fall::At(u) = first_fall(&c, &mut scratch) else {
            panic!("no fall found")
        };
        assert!((u - (-0.2_f64).acos() / 9.0).abs() < 1e-12);
    }

    #[test]
    fn a_dip_is_seen_and_a_near_miss_is_none() {
        let mut scratch = Vec::new();
        for depth in [1e-3, 1e-6, 1e-9] {
            let dip = coefficients(|u| (u - 0.37).powi(2) - depth);
            let Fall::At(u) = first_fall(&dip, &mut scratch) else {
                panic!("the dip of {depth} was missed")
            };
            assert!((u - (0.37 - f64::sqrt(depth))).abs() < 1e-9);
            let miss = coefficients(|u| (u - 0.37).powi(2) + depth);
            assert_eq!(first_fall(&miss, &mut scratch), Fall::None);
        }
    }
}
