//! Real-linear maps, with a constant, of complex numbers in vectors.

use super::{ComplexOctet, ComplexVector, Simd, WIDTH, Wide, layout};

/// `z ↦ Σ_k (a_k Re z_k + b_k Im z_k) + c` with complex vectors `a_k`, `b_k`, `c`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct AffineMap {
    /// The columns in sequence: all `a_k`, all `b_k`, then `c`.
    columns: Vec<ComplexVector>,
    /// Number of vectors in a column.
    vectors: usize,
}

impl AffineMap {
    /// Creates an empty map to `rows` numbers with capacity for `columns` columns.
    pub(crate) fn with_capacity(rows: usize, columns: usize) -> Self {
        let vectors = layout::vectors_for(rows);
        Self {
            columns: Vec::with_capacity(columns * vectors),
            vectors,
        }
    }

    /// Adds a column: real parts, then as many imaginary parts, then zeros, with a one in the real
    /// (0) or imaginary (1) part of one row if requested.
    pub(crate) fn push(&mut self, column: &[f64], one: Option<(usize, usize)>) {
        let start = self.columns.len();
        let end = start + self.vectors;
        self.columns.resize(end, ComplexVector::default());
        let vectors = &mut self.columns[start..];
        let (real, imaginary) = column.split_at(column.len() / 2);
        for (part, values) in [real, imaginary].into_iter().enumerate() {
            for (values, vector) in values.chunks(WIDTH).zip(vectors.iter_mut()) {
                vector[part][..values.len()].copy_from_slice(values);
            }
        }
        if let Some((row, part)) = one {
            let (vector, lane) = layout::place(row);
            vectors[vector][part][lane] = 1.0;
        }
    }

    /// Calls `visit` with every part of the constant `c`.
    pub(crate) fn each_constant(&mut self, visit: &mut dyn FnMut(&mut f64)) {
        let linear = self.columns.len() - self.vectors;
        let parts = self.columns[linear..].iter_mut().flatten().flatten();
        parts.for_each(visit);
    }

    /// Writes the image of `z` to `out`.
    #[inline(always)]
    pub(crate) fn apply<S: Simd>(&self, z: &[ComplexVector], out: &mut Vec<ComplexVector>) {
        let vectors = self.vectors;
        let (linear, constant) = self.columns.split_at(self.columns.len() - vectors);
        let (real, imaginary) = linear.split_at(linear.len() / 2);
        out.resize(vectors, ComplexVector::default());
        for (i, out) in out.iter_mut().enumerate() {
            // A sum for each part of the inputs: two short chains instead of a long one.
            let mut sums = [
                [S::load(&constant[i][0]), S::load(&constant[i][1])],
                [S::splat(0.0); 2],
            ];
            for (part, (columns, sum)) in [real, imaginary].into_iter().zip(&mut sums).enumerate() {
                for (columns, inputs) in columns.chunks(WIDTH * vectors).zip(z) {
                    for (column, &x) in columns.chunks_exact(vectors).zip(&inputs[part]) {
                        let x = S::splat(x);
                        sum[0] = S::fma(S::load(&column[i][0]), x, sum[0]);
                        sum[1] = S::fma(S::load(&column[i][1]), x, sum[1]);
                    }
                }
            }
            let [a, b] = sums;
            *out = [S::store(S::add(a[0], b[0])), S::store(S::add(a[1], b[1]))];
        }
    }

    /// Writes the first `rows` numbers of the images of eight `z` side by side to `out`.
    #[inline(always)]
    pub(crate) fn apply_wide<W: Wide>(
        &self,
        z: &[ComplexOctet],
        rows: usize,
        out: &mut [ComplexOctet],
    ) {
        let vectors = self.vectors;
        let (linear, constant) = self.columns.split_at(self.columns.len() - vectors);
        let (real, imaginary) = linear.split_at(linear.len() / 2);
        for (row, out) in out.iter_mut().enumerate().take(rows) {
            let (vector, lane) = layout::place(row);
            let [re, im] = &constant[vector];
            let mut sums = [W::splat(re[lane]), W::splat(im[lane])];
            let pairs = real
                .chunks_exact(vectors)
                .zip(imaginary.chunks_exact(vectors));
            for ((real, imaginary), z) in pairs.zip(z) {
                let [re, im] = W::load_complex(z);
                for (part, sum) in sums.iter_mut().enumerate() {
                    *sum = W::fma(W::splat(real[vector][part][lane]), re, *sum);
                    *sum = W::fma(W::splat(imaginary[vector][part][lane]), im, *sum);
                }
            }
            *out = W::store_complex(sums);
        }
    }
}
