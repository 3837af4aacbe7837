//! The small dense linear algebra of a step: column-major, in place, no allocation.
//!
//! Each loop is compiled once for any machine and once for machines with 256-bit registers.
//! Neither fuses multiplications with additions, so that both give the same bits.

// Only what is inlined into a function for wide registers gets their instructions.
#![allow(clippy::inline_always)]

/// Largest number of nodes of a step.
pub const MAX_NODES: usize = 32;

/// Calls the version of a function (after its generic parameters, in brackets) compiled for wide
/// registers, on machines that have them.
macro_rules! wide_registers {
    ([$($generics:tt)*] $body:ident(
        $($arg:ident: $ty:ty = $value:expr),* $(,)?
    ) $(-> $out:ty)?) => {{
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2")]
            fn wide<$($generics)*>($($arg: $ty),*) $(-> $out)? {
                $body($($arg),*)
            }
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: the feature has just been found.
                return unsafe { wide($($value),*) };
            }
        }
        $body($($value),*)
    }};
}
pub(crate) use wide_registers;

/// Declares a function with two bodies, one for wide registers, chosen at run time.
macro_rules! widened {
    ($(#[$doc:meta])* fn $name:ident($($arg:ident: $ty:ty),*) $(-> $out:ty)? = $body:ident) => {
        $(#[$doc])*
        pub(crate) fn $name($($arg: $ty),*) $(-> $out)? {
            wide_registers!([] $body($($arg: $ty = $arg),*) $(-> $out)?)
        }
    };
}

widened! {
    /// Computes `out += M x` with the first `out.len()` of the `rows` rows of a column-major
    /// matrix.
    fn add_rows(matrix: &[f64], rows: usize, x: &[f64], out: &mut [f64]) = add_rows_body
}

widened! {
    /// Factors a column-major `n × n` matrix with row pivoting, with the pivots in `pivots`;
    /// returns false if it is singular. The diagonal is left inverted.
    fn factor(matrix: &mut [f64], n: usize, pivots: &mut [usize]) -> bool = factor_body
}

widened! {
    /// Returns the largest absolute value; not finite if a value is not.
    fn largest(values: &[f64]) -> f64 = largest_body
}

widened! {
    /// Returns the largest `|a_i| p_i + |b_i| q_i`.
    fn largest_sum(a: &[f64], p: &[f64], b: &[f64], q: &[f64]) -> f64 = largest_sum_body
}

widened! {
    /// Returns the largest `|v_i| + |a_i| p + |b_i| q`.
    fn largest_terms(values: &[f64], ab: [&[f64]; 2], pq: [f64; 2]) -> f64 = largest_terms_body
}

widened! {
    /// Adds images to sums and writes their sum, each times its slopes, to `out`.
    fn next_term(
        slopes: [&[f64]; 2],
        images: [&[f64]; 2],
        sums: &mut [Vec<f64>; 2],
        out: &mut [f64]
    ) = next_term_body
}

widened! {
    /// Returns the scalar product.
    fn dot(a: &[f64], b: &[f64]) -> f64 = dot_body
}

widened! {
    /// Solves with the factors of [`factor`], in place.
    fn solve(factors: &[f64], n: usize, pivots: &[usize], x: &mut [f64]) = solve_body
}

/// Computes `out += M x` of a column-major matrix with `out.len()` rows.
pub(crate) fn add_product(matrix: &[f64], x: &[f64], out: &mut [f64]) {
    add_rows(matrix, out.len(), x, out);
}

#[inline(always)]
fn add_rows_body(matrix: &[f64], rows: usize, x: &[f64], out: &mut [f64]) {
    let taken = out.len();
    let mut first = 0;
    // As many rows at once as there are registers for their sums.
    while first < taken {
        let out = &mut out[first..];
        first += match taken - first {
            24.. => add_block::<24>(&matrix[first..], rows, x, out),
            20.. => add_block::<20>(&matrix[first..], rows, x, out),
            8.. => add_block::<8>(&matrix[first..], rows, x, out),
            4.. => add_block::<4>(&matrix[first..], rows, x, out),
            _ => add_block::<1>(&matrix[first..], rows, x, out),
        };
    }
}

/// Computes [`add_rows`] for the first `R` rows. Returns `R`.
#[inline(always)]
fn add_block<const R: usize>(matrix: &[f64], rows: usize, x: &[f64], out: &mut [f64]) -> usize {
    let Some((out, _)) = out.split_first_chunk_mut::<R>() else {
        return R;
    };
    let mut sums = *out;
    let column = |k: usize| matrix[k * rows..].first_chunk::<R>();
    let mut pairs = x.chunks_exact(2);
    for (k, pair) in (&mut pairs).enumerate() {
        let (Some(a), Some(b)) = (column(2 * k), column(2 * k + 1)) else {
            return R;
        };
        for i in 0..R {
            sums[i] += a[i] * pair[0] + b[i] * pair[1];
        }
    }
    if let ([last], Some(a)) = (pairs.remainder(), column(x.len() - 1)) {
        for i in 0..R {
            sums[i] += a[i] * last;
        }
    }
    *out = sums;
    R
}

/// Number of values that are processed together.
const LANES: usize = 4;

#[inline(always)]
fn largest_body(values: &[f64]) -> f64 {
    // Of the values times zero, which is no number where a value is not finite.
    let mut rest = [0.0; LANES];
    let largest = largest_of(values.len(), |lane, i| {
        rest[lane] += 0.0 * values[i];
        values[i].abs()
    });
    largest + rest.iter().sum::<f64>()
}

#[inline(always)]
fn largest_sum_body(a: &[f64], p: &[f64], b: &[f64], q: &[f64]) -> f64 {
    let n = a.len();
    let (p, b, q) = (&p[..n], &b[..n], &q[..n]);
    largest_of(n, |_, i| a[i].abs() * p[i] + b[i].abs() * q[i])
}

#[inline(always)]
fn largest_terms_body(values: &[f64], [a, b]: [&[f64]; 2], [p, q]: [f64; 2]) -> f64 {
    let n = values.len();
    let (a, b) = (&a[..n], &b[..n]);
    largest_of(n, |_, i| values[i].abs() + a[i].abs() * p + b[i].abs() * q)
}

/// Returns the largest of `count` values, zero if all are less.
#[inline(always)]
fn largest_of(count: usize, mut value: impl FnMut(usize, usize) -> f64) -> f64 {
    let mut most = [0.0; LANES];
    let mut take = |lane: usize, i: usize| {
        let v = value(lane, i);
        most[lane] = if v > most[lane] { v } else { most[lane] };
    };
    let whole = count - count % LANES;
    for first in (0..whole).step_by(LANES) {
        for lane in 0..LANES {
            take(lane, first + lane);
        }
    }
    for i in whole..count {
        take(0, i);
    }
    most.into_iter().fold(0.0, f64::max)
}

#[inline(always)]
fn next_term_body(
    [a, b]: [&[f64]; 2],
    [x, y]: [&[f64]; 2],
    [p, q]: &mut [Vec<f64>; 2],
    out: &mut [f64],
) {
    let n = out.len();
    let (a, b, x, y) = (&a[..n], &b[..n], &x[..n], &y[..n]);
    let (p, q) = (&mut p[..n], &mut q[..n]);
    for i in 0..n {
        p[i] += x[i];
        q[i] += y[i];
        out[i] = a[i] * x[i] + b[i] * y[i];
    }
}

#[inline(always)]
pub(crate) fn dot_body(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let whole = a.len() - a.len() % LANES;
    for (a, b) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    for (a, b) in a[whole..].iter().zip(&b[whole..]) {
        sums[0] += a * b;
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

#[inline(always)]
fn factor_body(matrix: &mut [f64], n: usize, pivots: &mut [usize]) -> bool {
    let mut multipliers = [0.0; MAX_NODES];
    for k in 0..n {
        let column = &matrix[k * n..(k + 1) * n];
        let mut pivot = k;
        let mut size = column[k].abs();
        for (i, v) in column.iter().enumerate().skip(k + 1) {
            if v.abs() > size {
                (pivot, size) = (i, v.abs());
            }
        }
        let value = column[pivot];
        if value == 0.0 || !value.is_finite() {
            return false;
        }
        pivots[k] = pivot;
        if pivot != k {
            for column in matrix.chunks_exact_mut(n) {
                column.swap(k, pivot);
            }
        }
        let scale = 1.0 / value;
        let (before, after) = matrix.split_at_mut((k + 1) * n);
        before[k * n + k] = scale;
        let column = &mut before[k * n + k + 1..];
        // From a whole number of registers on, with zeros up to the diagonal.
        let first = (k + 1) - (k + 1) % LANES;
        multipliers[first..=k].fill(0.0);
        for (v, m) in column.iter_mut().zip(&mut multipliers[k + 1..]) {
            *v *= scale;
            *m = *v;
        }
        let multipliers = &multipliers[first..n];
        for other in after.chunks_exact_mut(n) {
            let factor = other[k];
            for (o, m) in other[first..].iter_mut().zip(multipliers) {
                *o -= factor * m;
            }
        }
    }
    true
}

#[inline(always)]
fn solve_body(factors: &[f64], n: usize, pivots: &[usize], x: &mut [f64]) {
    for k in 0..n {
        x.swap(k, pivots[k]);
    }
    for k in 0..n {
        let value = x[k];
        for (x, c) in x[k + 1..]
            .iter_mut()
            .zip(&factors[k * n + k + 1..(k + 1) * n])
        {
            *x -= value * c;
        }
    }
    for k in (0..n).rev() {
        let value = x[k] * factors[k * n + k];
        x[k] = value;
        for (x, c) in x[..k].iter_mut().zip(&factors[k * n..k * n + k]) {
            *x -= value * c;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solving_undoes_a_product() {
        let n = 7;
        let matrix: Vec<f64> = (0..n * n)
            .map(|k| ((k * k * 37 + 11) % 23) as f64 - 11.0)
            .collect();
        let x: Vec<f64> = (0..n).map(|k| k as f64 - 2.5).collect();
        let mut b = vec![0.0; n];
        add_product(&matrix, &x, &mut b);
        let mut factors = matrix;
        let mut pivots = vec![0; n];
        assert!(factor(&mut factors, n, &mut pivots));
        solve(&factors, n, &pivots, &mut b);
        for (a, b) in x.iter().zip(&b) {
            assert!((a - b).abs() < 1e-12);
        }
        assert!(!factor(&mut vec![0.0; n * n], n, &mut pivots));
    }
}
