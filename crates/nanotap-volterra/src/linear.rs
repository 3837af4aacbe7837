//! The small dense linear algebra of a step: column-major, in place, no allocation.
//!
//! Each loop is compiled once for any machine and once for machines with 256-bit registers.
//! Neither fuses multiplications with additions, so that both give the same bits.

// Only what is inlined into a function for wide registers gets their instructions.
#![allow(clippy::inline_always)]

/// Declares a function with two bodies, one for wide registers, chosen at run time.
macro_rules! widened {
    ($(#[$doc:meta])* fn $name:ident($($arg:ident: $ty:ty),*) $(-> $out:ty)? = $body:ident) => {
        $(#[$doc])*
        pub(crate) fn $name($($arg: $ty),*) $(-> $out)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn wide($($arg: $ty),*) $(-> $out)? {
                    $body($($arg),*)
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: the feature has just been found.
                    return unsafe { wide($($arg),*) };
                }
            }
            $body($($arg),*)
        }
    };
}

widened! {
    /// `out += M x` of a column-major matrix of which the first `out.len()` of `rows` rows are
    /// taken.
    fn add_rows(matrix: &[f64], rows: usize, x: &[f64], out: &mut [f64]) = add_rows_body
}

widened! {
    /// Factors a column-major `n × n` matrix with row pivoting, the pivots in `pivots`; false
    /// where it is singular. The diagonal is left inverted.
    fn factor(matrix: &mut [f64], n: usize, pivots: &mut [usize]) -> bool = factor_body
}

widened! {
    /// Solves with the factors of [`factor`], in place.
    fn solve(factors: &[f64], n: usize, pivots: &[usize], x: &mut [f64]) = solve_body
}

/// `out += M x` of a column-major matrix with `out.len()` rows.
pub(crate) fn add_product(matrix: &[f64], x: &[f64], out: &mut [f64]) {
    add_rows(matrix, out.len(), x, out);
}

#[inline(always)]
fn add_rows_body(matrix: &[f64], rows: usize, x: &[f64], out: &mut [f64]) {
    let taken = out.len();
    let mut quads = x.chunks_exact(4);
    let mut columns = matrix.chunks_exact(4 * rows);
    for (x, quad) in (&mut quads).zip(&mut columns) {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| &quad[k * rows..k * rows + taken]);
        for i in 0..taken {
            out[i] += (a[i] * x[0] + b[i] * x[1]) + (c[i] * x[2] + d[i] * x[3]);
        }
    }
    let done = x.len() - quads.remainder().len();
    for (k, x) in quads.remainder().iter().enumerate() {
        let start = (done + k) * rows;
        for (out, m) in out.iter_mut().zip(&matrix[start..start + taken]) {
            *out += m * x;
        }
    }
}

#[inline(always)]
fn factor_body(matrix: &mut [f64], n: usize, pivots: &mut [usize]) -> bool {
    for k in 0..n {
        let column = &matrix[k * n..(k + 1) * n];
        let mut pivot = k;
        for i in k + 1..n {
            if column[i].abs() > column[pivot].abs() {
                pivot = i;
            }
        }
        let value = column[pivot];
        if value == 0.0 || !value.is_finite() {
            return false;
        }
        pivots[k] = pivot;
        if pivot != k {
            for j in 0..n {
                matrix.swap(j * n + k, j * n + pivot);
            }
        }
        let scale = 1.0 / value;
        let (before, after) = matrix.split_at_mut((k + 1) * n);
        before[k * n + k] = scale;
        let column = &mut before[k * n + k + 1..];
        for v in column.iter_mut() {
            *v *= scale;
        }
        for other in after.chunks_exact_mut(n) {
            let factor = other[k];
            for (o, c) in other[k + 1..].iter_mut().zip(column.iter()) {
                *o -= factor * c;
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
