//! The linear system of multiple shooting, solved by structured orthogonal
//! elimination (S. J. Wright, SIAM J. Sci. Stat. Comput. 13, 742, 1992).
//!
//! For segments k = 0 … n−1 with δ_n = δ_0,
//!
//! ```text
//! A_k δ_k − δ_{k+1} + b_k δ_λ = −f_k
//! ```
//!
//! If the parameter λ is free, one bordering row on (δ_0, δ_λ) is added. A product of the A_k would
//! lose the contracting directions of a chaotic segment among the growing ones; Householder
//! elimination keeps both. The cost is O(n d³).
//!
//! Fails (returns `None`) where the closing block is exactly singular. Near that point the solution
//! is large, which the caller measures.

use nalgebra::{DMatrix, DVector};

/// The eliminated system; its storage is reused by the next factorisation.
#[derive(Debug)]
pub(crate) struct BlockCyclic {
    d: usize,
    n: usize,
    /// n − 1 panels of 2d rows × (3d + 2) columns, row by row:
    /// δ_k | δ_0 | δ_{k+1} | δ_λ | right side.
    panels: Vec<f64>,
    /// The current reflector, and the factor with which it is subtracted from each column.
    reflector: Vec<f64>,
    factors: Vec<f64>,
    /// Closing d × d block, parameter column and right-hand side.
    closing: DMatrix<f64>,
    column: DVector<f64>,
    right: DVector<f64>,
}

impl BlockCyclic {
    pub(crate) fn new(d: usize, n: usize) -> Self {
        Self {
            d,
            n,
            panels: Vec::with_capacity(n.saturating_sub(1) * 2 * d * (3 * d + 2)),
            reflector: vec![0.0; 2 * d],
            factors: vec![0.0; 3 * d + 2],
            closing: DMatrix::zeros(d, d),
            column: DVector::zeros(d),
            right: DVector::zeros(d),
        }
    }

    /// Eliminates δ_1 … δ_{n−1}. `f` and `b` hold n rows of d values.
    pub(crate) fn factor(&mut self, jacobians: &[DMatrix<f64>], f: &[f64], b: Option<&[f64]>) {
        let (d, n) = (self.d, self.n);
        let columns = 3 * d + 2;
        let size = 2 * d * columns;
        let parameter = |k: usize, i: usize| b.map_or(0.0, |b| b[k * d + i]);
        // The running relation U δ_0 + V δ_k + w δ_λ = r.
        let mut u = jacobians[0].clone();
        let mut v = -DMatrix::<f64>::identity(d, d);
        for i in 0..d {
            self.column[i] = parameter(0, i);
            self.right[i] = -f[i];
        }
        self.panels.clear();
        for k in 1..n {
            self.panels.resize(k * size, 0.0);
            let panel = &mut self.panels[(k - 1) * size..];
            let (relation, segment) = panel.split_at_mut(d * columns);
            for (i, row) in relation.chunks_exact_mut(columns).enumerate() {
                for j in 0..d {
                    row[j] = v[(i, j)];
                    row[d + j] = u[(i, j)];
                }
                row[3 * d] = self.column[i];
                row[3 * d + 1] = self.right[i];
            }
            for (i, row) in segment.chunks_exact_mut(columns).enumerate() {
                for j in 0..d {
                    row[j] = jacobians[k][(i, j)];
                }
                row[2 * d + i] = -1.0;
                row[3 * d] = parameter(k, i);
                row[3 * d + 1] = -f[k * d + i];
            }
            triangularise(panel, d, &mut self.reflector, &mut self.factors);
            let relation = panel[d * columns..].chunks_exact(columns);
            for (i, row) in relation.enumerate() {
                for j in 0..d {
                    u[(i, j)] = row[d + j];
                    v[(i, j)] = row[2 * d + j];
                }
                self.column[i] = row[3 * d];
                self.right[i] = row[3 * d + 1];
            }
        }
        self.closing = u + v;
    }

    /// Newton correction at a fixed parameter, written to `out` (n rows of d values).
    pub(crate) fn solve(&self, out: &mut [f64]) -> Option<()> {
        let first = self.closing.clone().lu().solve(&self.right)?;
        self.back_substitute(first.as_slice(), 0.0, true, out);
        Some(())
    }

    /// Solution with the bordering row `row·δ_0 + corner δ_λ = value`. The right-hand sides of the
    /// segments are included only if `with_residual`. Returns δ_λ.
    pub(crate) fn solve_bordered(
        &self,
        row: &[f64],
        corner: f64,
        value: f64,
        with_residual: bool,
        out: &mut [f64],
    ) -> Option<f64> {
        let d = self.d;
        let mut matrix = DMatrix::zeros(d + 1, d + 1);
        matrix.view_mut((0, 0), (d, d)).copy_from(&self.closing);
        let mut right = DVector::zeros(d + 1);
        for i in 0..d {
            matrix[(i, d)] = self.column[i];
            matrix[(d, i)] = row[i];
            if with_residual {
                right[i] = self.right[i];
            }
        }
        matrix[(d, d)] = corner;
        right[d] = value;
        let solution = matrix.lu().solve(&right)?;
        self.back_substitute(&solution.as_slice()[..d], solution[d], with_residual, out);
        Some(solution[d])
    }

    fn back_substitute(&self, first: &[f64], parameter: f64, with_residual: bool, out: &mut [f64]) {
        let (d, n) = (self.d, self.n);
        let columns = 3 * d + 2;
        let size = 2 * d * columns;
        out[..d].copy_from_slice(first);
        for k in (1..n).rev() {
            let panel = &self.panels[(k - 1) * size..k * size];
            let next = if k + 1 == n { 0 } else { k + 1 };
            for (i, row) in panel.chunks_exact(columns).take(d).enumerate().rev() {
                let mut sum = -row[3 * d] * parameter;
                if with_residual {
                    sum += row[3 * d + 1];
                }
                for j in 0..d {
                    sum -= row[d + j] * first[j];
                    sum -= row[2 * d + j] * out[next * d + j];
                }
                for j in i + 1..d {
                    sum -= row[j] * out[k * d + j];
                }
                out[k * d + i] = sum / row[i];
            }
        }
    }
}

/// Householder triangularisation of the first `d` columns of a panel of 2d rows, applied to all
/// columns. `reflector` holds one column, `factors` one row.
fn triangularise(panel: &mut [f64], d: usize, reflector: &mut [f64], factors: &mut [f64]) {
    let columns = factors.len();
    for j in 0..d {
        let rows = panel.chunks_exact(columns).skip(j);
        let reflector = &mut reflector[j..];
        for (v, row) in reflector.iter_mut().zip(rows) {
            *v = row[j];
        }
        let length = reflector.iter().map(|v| v * v).sum::<f64>().sqrt();
        if length == 0.0 {
            continue;
        }
        let alpha = if reflector[0] > 0.0 { -length } else { length };
        // The reflector I − v vᵀ/(v₀ length'), v = column − alpha e_0.
        reflector[0] -= alpha;
        let half = -alpha * reflector[0];
        let factors = &mut factors[j + 1..];
        factors.fill(0.0);
        for (v, row) in reflector.iter().zip(panel.chunks_exact(columns).skip(j)) {
            for (factor, x) in factors.iter_mut().zip(&row[j + 1..]) {
                *factor += v * x;
            }
        }
        for factor in factors.iter_mut() {
            *factor /= half;
        }
        let rows = panel.chunks_exact_mut(columns).skip(j);
        for (v, row) in reflector.iter().zip(rows) {
            row[j] = 0.0;
            for (x, factor) in row[j + 1..].iter_mut().zip(factors.iter()) {
                *x -= factor * v;
            }
        }
        panel[j * columns + j] = alpha;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::unit;

    fn random(seed: &mut u64) -> f64 {
        *seed += 1;
        2.0 * unit(*seed) - 1.0
    }

    /// The structured solution agrees with a dense LU of the whole system. Some periods contract
    /// strongly: columns that differ little from a multiple of e_0, of either sign.
    #[test]
    fn agrees_with_the_dense_system() {
        let mut seed = 7;
        let cases = [(1, 1), (1, 4), (2, 3), (3, 5), (4, 1)].map(|(d, n)| (d, n, 2.0));
        let forgetful = [(1, 3), (2, 4), (2, 6), (3, 6)].map(|(d, n)| (d, n, 1e-10));
        for (d, n, every_other) in cases.into_iter().chain(forgetful) {
            let jacobians: Vec<_> = (0..n)
                .map(|k| {
                    let size = if k % 2 == 0 { every_other } else { 2.0 };
                    DMatrix::from_fn(d, d, |_, _| size * random(&mut seed))
                })
                .collect();
            let f: Vec<f64> = (0..n * d).map(|_| random(&mut seed)).collect();
            let b: Vec<f64> = (0..n * d).map(|_| random(&mut seed)).collect();
            let row: Vec<f64> = (0..d).map(|_| random(&mut seed)).collect();
            let (corner, value) = (0.3, 0.7);
            let size = n * d + 1;
            let mut dense = DMatrix::zeros(size, size);
            let mut right = DVector::zeros(size);
            for k in 0..n {
                for i in 0..d {
                    for j in 0..d {
                        dense[(k * d + i, k * d + j)] += jacobians[k][(i, j)];
                    }
                    dense[(k * d + i, (k + 1) % n * d + i)] -= 1.0;
                    dense[(k * d + i, n * d)] = b[k * d + i];
                    right[k * d + i] = -f[k * d + i];
                }
            }
            for i in 0..d {
                dense[(n * d, i)] = row[i];
            }
            dense[(n * d, n * d)] = corner;
            right[n * d] = value;
            let expected = dense.clone().lu().solve(&right).unwrap();
            let mut system = BlockCyclic::new(d, n);
            system.factor(&jacobians, &f, Some(&b));
            let mut out = vec![0.0; n * d];
            let parameter = system
                .solve_bordered(&row, corner, value, true, &mut out)
                .unwrap();
            let scale = expected.amax();
            assert!((parameter - expected[n * d]).abs() < 1e-11 * scale);
            for i in 0..n * d {
                assert!((out[i] - expected[i]).abs() < 1e-11 * scale);
            }
            let plain = dense.view((0, 0), (n * d, n * d)).into_owned();
            let expected = plain
                .lu()
                .solve(&right.rows(0, n * d).into_owned())
                .unwrap();
            system.solve(&mut out).unwrap();
            for i in 0..n * d {
                assert!((out[i] - expected[i]).abs() < 1e-10 * expected.amax());
            }
        }
    }
}
