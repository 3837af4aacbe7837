//! Curves through rows: straight lines, or a cubic spline that is written with few polynomials.
//!
//! The natural cubic spline has two continuous derivatives. The monotone one is the same with its
//! slopes limited (J. M. Hyman, SIAM J. Sci. Stat. Comput. 4, 645 (1983)): between two rows it never
//! leaves their range, and it has one continuous derivative. Runs of cubics are then replaced by one
//! polynomial of degree `DEGREE` with the same values and slopes at both ends, as long as it is
//! within `ACCURACY` of the spline: a thousand rows of a smooth curve become some tens of pieces.

// Only what is inlined into a function for wide registers gets their instructions.
#![allow(clippy::inline_always)]

use nanotap_arithmetic::sin_cos;
use std::f64::consts::PI;

/// The curve between the rows of a table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Straight lines between the rows.
    #[default]
    Linear,
    /// Cubic spline that stays between the rows.
    Monotone,
    /// Natural cubic spline, with two continuous derivatives.
    Natural,
}

impl Interpolation {
    /// All interpolations, in this order.
    pub const ALL: [Self; 3] = [Self::Linear, Self::Monotone, Self::Natural];

    /// Returns the name in case files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Monotone => "monotone",
            Self::Natural => "natural",
        }
    }
}

/// Largest degree of a piece.
const DEGREE: usize = FREE + 3;
/// Number of nodes of a piece in addition to the values and slopes at its ends.
const FREE: usize = 7;
/// Largest difference of a piece from its spline, relative to the largest value of its rows.
const ACCURACY: f64 = 1e-6;
/// The same limit relative to the largest value of all rows, for pieces with small values.
const FLOOR: f64 = 1e-9;
/// Fractions of each interval at which a piece is compared with its spline.
const CHECKS: [f64; 4] = [0.15, 0.4, 0.65, 0.9];

/// Polynomials over one interval, each as the coefficients of `T_k(u)`, `u` from −1 to 1.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Piece {
    /// Numbers of its first and last row.
    pub(crate) rows: [usize; 2],
    /// Chebyshev coefficients, one polynomial per curve.
    pub(crate) curves: Vec<Vec<f64>>,
}

/// Returns the value of a Chebyshev series at `u`, and its slope by `u` (Clenshaw).
#[inline]
pub(crate) fn series(coefficients: &[f64], u: f64) -> [f64; 2] {
    let Some((first, rest)) = coefficients.split_first() else {
        return [0.0; 2];
    };
    let (mut b, mut b_next, mut d, mut d_next) = (0.0, 0.0, 0.0, 0.0);
    for c in rest.iter().rev() {
        (d, d_next) = (2.0 * (b + u * d) - d_next, d);
        (b, b_next) = (c + 2.0 * u * b - b_next, b);
    }
    [first + u * b - b_next, b + u * d - d_next]
}

/// Number of places that [`series_at`] evaluates at a time.
pub(crate) const LANES: usize = 8;

/// Evaluates [`series`] at several places: values, then slopes.
#[inline(always)]
pub(crate) fn series_at(coefficients: &[f64], u: &[f64; LANES]) -> [[f64; LANES]; 2] {
    let zero = [0.0; LANES];
    let Some((first, rest)) = coefficients.split_first() else {
        return [zero; 2];
    };
    let (mut b, mut b_next, mut d, mut d_next) = (zero, zero, zero, zero);
    for c in rest.iter().rev() {
        for i in 0..LANES {
            let new = 2.0 * (b[i] + u[i] * d[i]) - d_next[i];
            d_next[i] = std::mem::replace(&mut d[i], new);
            let new = c + 2.0 * u[i] * b[i] - b_next[i];
            b_next[i] = std::mem::replace(&mut b[i], new);
        }
    }
    let mut out = [zero; 2];
    for i in 0..LANES {
        out[0][i] = first + u[i] * b[i] - b_next[i];
        out[1][i] = b[i] + u[i] * d[i] - d_next[i];
    }
    out
}

/// Returns the integral of a Chebyshev series by `u`, zero at `u = 1`.
pub(crate) fn integral(coefficients: &[f64]) -> Vec<f64> {
    let at = |k: usize| coefficients.get(k).copied().unwrap_or(0.0);
    let mut sum: Vec<f64> = (0..=coefficients.len())
        .map(|k| match k {
            0 => 0.0,
            1 => at(0) - 0.5 * at(2),
            _ => (at(k - 1) - at(k + 1)) / (2 * k) as f64,
        })
        .collect();
    sum[0] = -sum.iter().sum::<f64>();
    sum
}

/// Computes the pieces of the curves through rows: each of `columns` has one value for each of
/// `gaps`.
pub(crate) fn pieces(gaps: &[f64], columns: &[(&[f64], Interpolation)]) -> Vec<Piece> {
    let smooth = columns.iter().any(|(_, by)| *by != Interpolation::Linear);
    let splines: Vec<Spline> = columns
        .iter()
        .map(|(values, by)| Spline::new(gaps, values, *by))
        .collect();
    let nodes = Nodes::new();
    let mut pieces = Vec::new();
    let (mut first, end) = (0, gaps.len() - 1);
    while first < end {
        let fit = |last: usize| -> Option<Vec<Vec<f64>>> {
            let fits = splines.iter().map(|spline| spline.fit(&nodes, first, last));
            fits.collect()
        };
        // The shortest that fits and the shortest seen that does not.
        let (mut last, mut beyond) = (first + 1, end + 1);
        let mut best = splines.iter().map(|s| s.exact(first)).collect();
        let mut step = 1;
        while smooth && last + 1 < beyond {
            let longer = (last + step).min(beyond - 1);
            match fit(longer) {
                Some(found) => {
                    (best, last) = (found, longer);
                    step *= 2;
                }
                None => beyond = longer,
            }
            if beyond <= end {
                step = (beyond - last).div_ceil(2);
            }
        }
        pieces.push(Piece {
            rows: [first, last],
            curves: best,
        });
        first = last;
    }
    pieces
}

/// Chebyshev nodes and the polynomials at them.
struct Nodes {
    inner: Vec<f64>,
    all: Vec<f64>,
}

impl Nodes {
    fn new() -> Self {
        let nodes = |n: usize| {
            let angle = |k: usize| PI * (2 * k + 1) as f64 / (2 * n) as f64;
            (0..n).map(|k| sin_cos(angle(k)).1).collect()
        };
        Self {
            inner: nodes(FREE),
            all: nodes(DEGREE + 1),
        }
    }
}

/// Computes the series through values at as many Chebyshev nodes.
fn through(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let coefficient = |j: usize| {
        let terms = values.iter().enumerate();
        let sum: f64 = terms
            .map(|(k, value)| {
                // cos(jθ_k) with whole multiples of the circle left out.
                let turn = (j * (2 * k + 1)) % (4 * n);
                value * sin_cos(PI * turn as f64 / (2 * n) as f64).1
            })
            .sum();
        sum * if j == 0 { 1.0 } else { 2.0 } / n as f64
    };
    (0..n).map(coefficient).collect()
}

/// A spline with a cubic between each two rows, given by values and slopes.
struct Spline<'a> {
    gaps: &'a [f64],
    values: &'a [f64],
    /// Slopes at the rows; empty for straight lines.
    slopes: Vec<f64>,
    /// Largest absolute value of the rows.
    size: f64,
}

impl<'a> Spline<'a> {
    fn new(gaps: &'a [f64], values: &'a [f64], by: Interpolation) -> Self {
        let mut slopes = match by {
            Interpolation::Linear => Vec::new(),
            Interpolation::Monotone | Interpolation::Natural => natural_slopes(gaps, values),
        };
        if by == Interpolation::Monotone {
            limit(gaps, values, &mut slopes);
        }
        Self {
            gaps,
            values,
            slopes,
            size: largest(values),
        }
    }

    /// Returns the cubic after row `k` as a series, exactly.
    fn exact(&self, k: usize) -> Vec<f64> {
        let [a, b] = [self.values[k], self.values[k + 1]];
        if self.slopes.is_empty() {
            return vec![0.5 * (a + b), 0.5 * (b - a)];
        }
        let half = 0.5 * (self.gaps[k + 1] - self.gaps[k]);
        ends([a, b], [half * self.slopes[k], half * self.slopes[k + 1]])
    }

    /// Fits one polynomial from row `first` to row `last`; `None` if it is not accurate.
    fn fit(&self, nodes: &Nodes, first: usize, last: usize) -> Option<Vec<f64>> {
        let (low, high) = (self.gaps[first], self.gaps[last]);
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let run = &self.values[first..=last];
        let level = self.slopes.get(first..=last).unwrap_or(&[]);
        if run.iter().all(|v| *v == run[0]) && level.iter().all(|slope| *slope == 0.0) {
            return Some(vec![run[0]]);
        }
        if self.slopes.is_empty() {
            return None;
        }
        let slopes = [half * self.slopes[first], half * self.slopes[last]];
        let cubic = ends([run[0], run[run.len() - 1]], slopes);
        let place = |u: f64| {
            let gap = middle + half * u;
            let inside = self.gaps[first..last].partition_point(|g| *g <= gap).max(1);
            (first + inside - 1, gap)
        };
        let rest: Vec<f64> = nodes
            .inner
            .iter()
            .map(|&u| {
                let (k, gap) = place(u);
                let bump = (1.0 - u * u) * (1.0 - u * u);
                (self.at(k, gap) - series(&cubic, u)[0]) / bump
            })
            .collect();
        let rest = through(&rest);
        let whole: Vec<f64> = nodes
            .all
            .iter()
            .map(|&u| {
                let bump = (1.0 - u * u) * (1.0 - u * u);
                series(&cubic, u)[0] + bump * series(&rest, u)[0]
            })
            .collect();
        let whole = through(&whole);
        let allowed = (ACCURACY * largest(run)).max(FLOOR * self.size);
        let close = (first..last).all(|k| {
            CHECKS.iter().all(|part| {
                let gap = self.gaps[k] + part * (self.gaps[k + 1] - self.gaps[k]);
                let found = series(&whole, (gap - middle) / half)[0];
                (found - self.at(k, gap)).abs() <= allowed
            })
        });
        close.then_some(whole)
    }

    /// Returns the value of the cubic after row `k`.
    fn at(&self, k: usize, gap: f64) -> f64 {
        let width = self.gaps[k + 1] - self.gaps[k];
        let t = (gap - self.gaps[k]) / width;
        let [a, b] = [self.values[k], self.values[k + 1]];
        let [p, q] = [width * self.slopes[k], width * self.slopes[k + 1]];
        let back = 1.0 - t;
        a * back + b * t + t * back * ((p - (b - a)) * back - (q - (b - a)) * t)
    }
}

/// Returns the cubic with these values and slopes by `u` at `u = −1` and 1.
fn ends([a, b]: [f64; 2], [p, q]: [f64; 2]) -> Vec<f64> {
    // f = m + d u + (1 − u²)(e + g u), with f(±1) and f'(±1).
    let (m, d) = (0.5 * (a + b), 0.5 * (b - a));
    let e = 0.25 * (p - q);
    let g = 0.25 * (2.0 * d - p - q);
    // u² = (1 + T₂)/2, u³ = (3u + T₃)/4.
    vec![m + 0.5 * e, d + 0.25 * g, -0.5 * e, -0.25 * g]
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m: f64, v| m.max(v.abs()))
}

/// Computes the slopes at the rows of the cubic spline without curvature at both ends.
fn natural_slopes(gaps: &[f64], values: &[f64]) -> Vec<f64> {
    let n = gaps.len();
    let width = |k: usize| gaps[k + 1] - gaps[k];
    let chord = |k: usize| (values[k + 1] - values[k]) / width(k);
    // Thomas' elimination for the curvatures; the matrix is diagonally dominant.
    let mut curvature = vec![0.0; n];
    let mut upper = vec![0.0; n];
    for k in 1..n - 1 {
        let pivot = 2.0 * (width(k - 1) + width(k)) - width(k - 1) * upper[k - 1];
        upper[k] = width(k) / pivot;
        let right = 6.0 * (chord(k) - chord(k - 1));
        curvature[k] = (right - width(k - 1) * curvature[k - 1]) / pivot;
    }
    for k in (1..n - 1).rev() {
        curvature[k] -= upper[k] * curvature[k + 1];
    }
    (0..n)
        .map(|k| {
            if k + 1 < n {
                chord(k) - width(k) * (2.0 * curvature[k] + curvature[k + 1]) / 6.0
            } else {
                chord(k - 1) + width(k - 1) * (curvature[k - 1] + 2.0 * curvature[k]) / 6.0
            }
        })
        .collect()
}

/// Limits slopes to three times those of the chords on either side, and to zero where these differ
/// in sign: then every cubic is monotone (F. N. Fritsch and R. E. Carlson, SIAM J. Numer. Anal. 17,
/// 238 (1980)).
fn limit(gaps: &[f64], values: &[f64], slopes: &mut [f64]) {
    let chord = |k: usize| (values[k + 1] - values[k]) / (gaps[k + 1] - gaps[k]);
    let last = slopes.len() - 1;
    for (k, slope) in slopes.iter_mut().enumerate() {
        let [before, after] = [chord(k.saturating_sub(1)), chord(k.min(last - 1))];
        *slope = if before * after > 0.0 {
            let most = 3.0 * before.abs().min(after.abs());
            let along = (*slope * before.signum()).clamp(0.0, most);
            along * before.signum()
        } else {
            0.0
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The natural spline through 0, 1, 0 at 0, 1, 2 is `3t/2 − t³/2` on the first interval.
    #[test]
    fn the_natural_spline_of_three_rows() {
        let (gaps, values) = ([0.0, 1.0, 2.0], [0.0, 1.0, 0.0]);
        let spline = Spline::new(&gaps, &values, Interpolation::Natural);
        for t in [0.1_f64, 0.5, 0.8] {
            let expected = 1.5 * t - 0.5 * t * t * t;
            assert!((spline.at(0, t) - expected).abs() < 1e-15);
            assert!((series(&spline.exact(0), 2.0 * t - 1.0)[0] - expected).abs() < 1e-15);
        }
    }

    /// Rows of a step: the natural spline overshoots, the monotone one does not.
    #[test]
    fn the_monotone_spline_stays_between_its_rows() {
        let gaps: Vec<f64> = (0..9).map(f64::from).collect();
        let values = [0.0, 0.0, 0.0, 0.1, 2.0, 2.0, 2.1, 2.0, 2.0];
        let overshoots = |by| {
            let spline = Spline::new(&gaps, &values, by);
            (0..8).any(|k| {
                let [a, b] = [values[k], values[k + 1]];
                (1..20).any(|t| {
                    let found = spline.at(k, gaps[k] + 0.05 * f64::from(t));
                    found < a.min(b) - 1e-15 || found > a.max(b) + 1e-15
                })
            })
        };
        assert!(overshoots(Interpolation::Natural));
        assert!(!overshoots(Interpolation::Monotone));
    }

    /// A thousand rows of an attraction and a wall become few pieces that keep to the spline, with
    /// values and slopes that are continuous.
    #[test]
    fn a_smooth_curve_has_few_pieces() {
        let gaps: Vec<f64> = (0..1000).map(|k| 0.3 + 0.02 * f64::from(k)).collect();
        let values: Vec<f64> = gaps
            .iter()
            .map(|d| 0.001 / d.powi(8) - 0.03 / (d * d))
            .collect();
        let spline = Spline::new(&gaps, &values, Interpolation::Natural);
        let found = pieces(&gaps, &[(&values, Interpolation::Natural)]);
        assert!(found.len() < 30, "{}", found.len());
        let mut end: Option<[f64; 2]> = None;
        for piece in &found {
            let [low, high] = piece.rows.map(|row| gaps[row]);
            let at = |u: f64| series(&piece.curves[0], u);
            let half = 0.5 * (high - low);
            let [value, slope] = at(-1.0);
            if let Some([before, rose]) = end {
                assert!((value - before).abs() < 1e-12 * (1.0 + value.abs()));
                assert!((slope / half - rose).abs() < 1e-9 * (1.0 + rose.abs()));
            }
            let [value, slope] = at(1.0);
            end = Some([value, slope / half]);
            let run = largest(&values[piece.rows[0]..=piece.rows[1]]);
            for k in piece.rows[0]..piece.rows[1] {
                for part in [0.05, 0.3, 0.5, 0.77] {
                    let gap = gaps[k] + 0.02 * part;
                    let off = at((gap - 0.5 * (low + high)) / half)[0] - spline.at(k, gap);
                    assert!(
                        off.abs() < 2e-6 * run + 2e-9 * spline.size,
                        "{gap}: {off:e}"
                    );
                }
            }
        }
        assert_eq!(found.last().unwrap().rows[1], 999);
    }

    /// `∫ T_k` by the values at both ends of `u²(1 + u)`.
    #[test]
    fn integrals_of_series() {
        let coefficients = through(
            &(0..5)
                .map(|k| sin_cos(PI * (2 * k + 1) as f64 / 10.0).1)
                .map(|u| u * u * (1.0 + u))
                .collect::<Vec<f64>>(),
        );
        let sum = integral(&coefficients);
        let [low, high] = [-1.0, 1.0].map(|u| series(&sum, u)[0]);
        assert!(high.abs() < 1e-15 && (low + 2.0 / 3.0).abs() < 1e-15);
    }
}
