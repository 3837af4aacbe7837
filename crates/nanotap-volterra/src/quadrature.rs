//! Gauss–Legendre quadrature and Chebyshev interpolation on `[0, 1]`.

// Only what is inlined into a function for wide registers gets their instructions.
#![allow(clippy::inline_always)]

use std::f64::consts::PI;
use std::sync::OnceLock;

/// Largest number of points of a Gauss–Legendre rule.
const MAX_POINTS: usize = 32;
/// The rules that were used, by their numbers of points.
static RULES: [OnceLock<(Vec<f64>, Vec<f64>)>; MAX_POINTS + 1] =
    [const { OnceLock::new() }; MAX_POINTS + 1];

/// Nodes on `[0, 1]` and weights of the Gauss–Legendre rule with `count` points, at most 32.
///
/// # Panics
/// For more points.
pub fn gauss_legendre(count: usize) -> &'static (Vec<f64>, Vec<f64>) {
    RULES[count].get_or_init(|| computed_gauss_legendre(count))
}

/// The same, by Newton on the Legendre polynomial.
fn computed_gauss_legendre(count: usize) -> (Vec<f64>, Vec<f64>) {
    let mut nodes = vec![0.0; count];
    let mut weights = vec![0.0; count];
    for i in 0..count.div_ceil(2) {
        let mut x = nanotap_arithmetic::cos(PI * (i as f64 + 0.75) / (count as f64 + 0.5));
        let mut slope = 1.0;
        for _ in 0..100 {
            let (value, derivative) = legendre(count, x);
            slope = derivative;
            let step = value / derivative;
            x -= step;
            if step.abs() < 1e-16 {
                slope = legendre(count, x).1;
                break;
            }
        }
        let weight = 1.0 / ((1.0 - x * x) * slope * slope);
        nodes[i] = 0.5 * (1.0 - x);
        nodes[count - 1 - i] = 0.5 * (1.0 + x);
        weights[i] = weight;
        weights[count - 1 - i] = weight;
    }
    (nodes, weights)
}

fn legendre(count: usize, x: f64) -> (f64, f64) {
    let (mut previous, mut value) = (1.0, x);
    for k in 2..=count {
        let k = k as f64;
        let next = ((2.0 * k - 1.0) * x * value - (k - 1.0) * previous) / k;
        previous = value;
        value = next;
    }
    let n = count as f64;
    (value, n * (x * value - previous) / (x * x - 1.0))
}

/// The Chebyshev–Lobatto nodes on `[0, 1]`, ends included.
pub(crate) fn chebyshev_nodes(count: usize) -> Vec<f64> {
    // 2 sin² keeps the distance from 0 accurate, which square-root time needs.
    (0..count)
        .map(|i| nanotap_arithmetic::sin(PI * i as f64 / (2.0 * (count - 1) as f64)).powi(2))
        .collect()
}

/// The matrix (`count × count`, column-major) from values at the nodes to coefficients of
/// `T_j(2u − 1)`.
pub(crate) fn chebyshev_coefficients(count: usize) -> Vec<f64> {
    let last = count - 1;
    let half = |k: usize| if k == 0 || k == last { 0.5 } else { 1.0 };
    let mut matrix = vec![0.0; count * count];
    for i in 0..count {
        for j in 0..count {
            let sign = if j % 2 == 0 { 1.0 } else { -1.0 };
            let angle = PI * ((i * j) % (2 * last)) as f64 / last as f64;
            matrix[i * count + j] =
                sign * nanotap_arithmetic::cos(angle) * 2.0 * half(i) * half(j) / last as f64;
        }
    }
    matrix
}

/// Writes `T_j(2u − 1)` for all `j` to `out`.
pub(crate) fn chebyshev_basis(u: f64, out: &mut [f64]) {
    let x = 2.0 * u - 1.0;
    let (mut previous, mut value) = (1.0, x);
    for (j, out) in out.iter_mut().enumerate() {
        match j {
            0 => *out = 1.0,
            1 => *out = x,
            _ => {
                let next = 2.0 * x * value - previous;
                previous = value;
                value = next;
                *out = value;
            }
        }
    }
}

/// `Σ c_j T_j(2u − 1)` (Clenshaw).
pub(crate) fn series(coefficients: &[f64], u: f64) -> f64 {
    let x = 2.0 * u - 1.0;
    let (mut b1, mut b2) = (0.0, 0.0);
    for &c in coefficients[1..].iter().rev() {
        let b = 2.0 * x * b1 - b2 + c;
        b2 = b1;
        b1 = b;
    }
    coefficients[0] + x * b1 - b2
}

/// [`series`] at many points at once.
#[inline(always)]
pub(crate) fn series_at<const N: usize>(coefficients: &[f64], u: &[f64; N]) -> [f64; N] {
    let x = u.map(|u| 2.0 * u - 1.0);
    let (mut b1, mut b2) = ([0.0; N], [0.0; N]);
    for &c in coefficients[1..].iter().rev() {
        for i in 0..N {
            let b = 2.0 * x[i] * b1[i] - b2[i] + c;
            b2[i] = b1[i];
            b1[i] = b;
        }
    }
    std::array::from_fn(|i| coefficients[0] + x[i] * b1[i] - b2[i])
}

/// Coefficients of the derivative by `u` of a series in `T_j(2u − 1)`, written to `out`.
pub(crate) fn derivative(coefficients: &[f64], out: &mut [f64]) {
    let n = coefficients.len();
    out.fill(0.0);
    // c'_{j−1} = c'_{j+1} + 2 j c_j on [−1, 1], twice that on [0, 1].
    for j in (1..n).rev() {
        let above = if j + 1 < n { out[j + 1] } else { 0.0 };
        out[j - 1] = above + 4.0 * j as f64 * coefficients[j];
    }
    out[0] *= 0.5;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_legendre_integrates_polynomials_of_twice_its_degree() {
        for count in [1, 2, 7, 24] {
            let (nodes, weights) = gauss_legendre(count);
            for power in 0..(2 * count) as i32 {
                let sum: f64 = nodes
                    .iter()
                    .zip(weights)
                    .map(|(x, w)| w * x.powi(power))
                    .sum();
                assert!((sum - 1.0 / f64::from(power + 1)).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn a_series_and_its_derivative_are_the_function_s() {
        let n = 24;
        let nodes = chebyshev_nodes(n);
        let matrix = chebyshev_coefficients(n);
        let mut c = vec![0.0; n];
        for (i, &u) in nodes.iter().enumerate() {
            for j in 0..n {
                c[j] += matrix[i * n + j] * (3.0 * u).sin();
            }
        }
        let mut d = vec![0.0; n];
        derivative(&c, &mut d);
        let mut basis = vec![0.0; n];
        for k in 0..50 {
            let u = f64::from(k) / 49.0;
            assert!((series(&c, u) - (3.0 * u).sin()).abs() < 1e-14);
            assert!((series(&d, u) - 3.0 * (3.0 * u).cos()).abs() < 1e-11);
            chebyshev_basis(u, &mut basis);
            let sum: f64 = basis.iter().zip(&c).map(|(b, c)| b * c).sum();
            assert!((sum - series(&c, u)).abs() < 1e-14);
        }
    }
}
