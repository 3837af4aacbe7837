//! The small dense linear algebra of a step: column-major, in place, no allocation.

/// `out += M x` of a column-major matrix with `out.len()` rows.
#[inline]
pub(crate) fn add_product(matrix: &[f64], x: &[f64], out: &mut [f64]) {
    for (column, &x) in matrix.chunks_exact(out.len()).zip(x) {
        for (out, m) in out.iter_mut().zip(column) {
            *out += m * x;
        }
    }
}

/// Factors a column-major `n × n` matrix with row pivoting, the pivots in `pivots`; false
/// where it is singular.
pub(crate) fn factor(matrix: &mut [f64], n: usize, pivots: &mut [usize]) -> bool {
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
        let column = &mut before[k * n + k + 1..];
        for v in column.iter_mut() {
            *v *= scale;
        }
        for other in after.chunks_exact_mut(n) {
            let factor = other[k];
            if factor != 0.0 {
                for (o, c) in other[k + 1..].iter_mut().zip(column.iter()) {
                    *o -= factor * c;
                }
            }
        }
    }
    true
}

/// Solves with the factors of [`factor`], in place.
pub(crate) fn solve(factors: &[f64], n: usize, pivots: &[usize], x: &mut [f64]) {
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
        let value = x[k] / factors[k * n + k];
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
