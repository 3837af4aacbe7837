//! Real-linear maps of many complex vectors at once: matrix products.

use nalgebra::DMatrix;

use super::{ComplexVector, Simd, WIDTH, Work, complex_mul, dispatch, layout};

/// `z ↦ Σ_k (a_k Re z_k + b_k Im z_k)` with complex vectors `a_k`, `b_k`, of lists of `z` that lie
/// in sequence.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LinearMap {
    /// Row by row of vectors: all `a_k`, then all `b_k`.
    rows: Vec<ComplexVector>,
    /// Number of complex numbers in a `z`.
    from: usize,
    /// Number of complex numbers in an image.
    to: usize,
}

impl LinearMap {
    /// Creates the map of `matrix`, whose columns belong to all `Re z_k`, then all `Im z_k`. The
    /// first half of its rows gives real parts of the image, the rest imaginary parts; if their
    /// number is odd, the last imaginary part is zero.
    pub(crate) fn of(matrix: &DMatrix<f64>) -> Self {
        let (from, to) = (matrix.ncols() / 2, matrix.nrows().div_ceil(2));
        let mut rows = vec![ComplexVector::default(); layout::vectors_for(to) * 2 * from];
        let columns = matrix.as_slice().chunks_exact(matrix.nrows().max(1));
        for (k, column) in columns.enumerate() {
            let (real, imaginary) = column.split_at(to);
            for (part, half) in [real, imaginary].into_iter().enumerate() {
                for (vector, values) in half.chunks(WIDTH).enumerate() {
                    rows[vector * 2 * from + k][part][..values.len()].copy_from_slice(values);
                }
            }
        }
        Self { rows, from, to }
    }

    /// Returns the number of vectors in an image.
    pub(crate) fn vectors(&self) -> usize {
        layout::vectors_for(self.to)
    }

    /// Writes the images of all `z` in `list` to `images`.
    pub(crate) fn apply(&self, list: &[ComplexVector], images: &mut Vec<ComplexVector>) {
        dispatch(Apply {
            map: self,
            list,
            images,
        });
    }

    /// Computes the images of `COUNT` lists, with enough independent sums to hide the latency of
    /// one.
    #[inline(always)]
    fn images<S: Simd, const COUNT: usize>(
        &self,
        list: &[ComplexVector],
        images: &mut [ComplexVector],
    ) {
        let (length, vectors) = (list.len() / COUNT, self.vectors());
        let inputs: [&[ComplexVector]; COUNT] =
            std::array::from_fn(|c| &list[c * length..(c + 1) * length]);
        for (i, row) in self.rows.chunks_exact(2 * self.from).enumerate() {
            let mut sums = [[S::splat(0.0); 2]; COUNT];
            for (part, row) in row.chunks_exact(self.from).enumerate() {
                for (v, row) in row.chunks(WIDTH).enumerate() {
                    let inputs = inputs.map(|list| &list[v][part]);
                    for (lane, [re, im]) in row.iter().enumerate() {
                        let (re, im) = (S::load(re), S::load(im));
                        for (sum, input) in sums.iter_mut().zip(&inputs) {
                            let x = S::splat(input[lane]);
                            *sum = [S::fma(re, x, sum[0]), S::fma(im, x, sum[1])];
                        }
                    }
                }
            }
            for (c, [re, im]) in sums.into_iter().enumerate() {
                images[c * vectors + i] = [S::store(re), S::store(im)];
            }
        }
    }
}

/// The arguments of [`LinearMap::apply`], for the dispatch to vector instructions.
struct Apply<'a> {
    map: &'a LinearMap,
    list: &'a [ComplexVector],
    images: &'a mut Vec<ComplexVector>,
}

impl Work for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        /// Number of lists whose images are computed at once.
        const SEVERAL: usize = 4;
        let (length, vectors) = (layout::vectors_for(self.map.from), self.map.vectors());
        let count = self.list.len() / length;
        self.images
            .resize(count * vectors, ComplexVector::default());
        let split = count / SEVERAL * SEVERAL;
        let (several, rest) = self.list.split_at(split * length);
        let (several_images, rest_images) = self.images.split_at_mut(split * vectors);
        for (list, images) in several
            .chunks_exact(SEVERAL * length)
            .zip(several_images.chunks_exact_mut(SEVERAL * vectors))
        {
            self.map.images::<S, SEVERAL>(list, images);
        }
        match count - split {
            3 => self.map.images::<S, 3>(rest, rest_images),
            2 => self.map.images::<S, 2>(rest, rest_images),
            1 => self.map.images::<S, 1>(rest, rest_images),
            _ => {}
        }
    }
}

/// Multiplies each of the lists in `lists` (in sequence) by `factors`, number by number.
pub(crate) fn scale(lists: &mut [ComplexVector], factors: &[ComplexVector]) {
    dispatch(Scale { lists, factors });
}

struct Scale<'a> {
    lists: &'a mut [ComplexVector],
    factors: &'a [ComplexVector],
}

impl Work for Scale<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let loaded = |[re, im]: &ComplexVector| [S::load(re), S::load(im)];
        for list in self.lists.chunks_exact_mut(self.factors.len()) {
            for (z, factor) in list.iter_mut().zip(self.factors) {
                *z = complex_mul::<S>(loaded(z), loaded(factor)).map(S::store);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Plain;
    #[cfg(target_arch = "x86_64")]
    use super::super::avx2;
    #[cfg(target_arch = "x86_64")]
    use super::super::avx2_available;
    use super::*;
    use nalgebra::{Complex, ComplexField as _};
    use proptest::prelude::*;

    /// A matrix of numbers between −1 and 1 that no symmetry relates.
    fn matrix(rows: usize, columns: usize, seed: f64) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |i, k| {
            (seed + 1.7 * i as f64 + 0.3 * (i * k) as f64 - 2.9 * k as f64).sin()
        })
    }

    /// The columns of `[Re z; Im z]` as packed lists.
    fn packed(stacked: &DMatrix<f64>) -> Vec<ComplexVector> {
        let half = stacked.nrows() / 2;
        let list = |column: nalgebra::DVectorView<'_, f64>| {
            let numbers = (0..half).map(|k| Complex::new(column[k], column[half + k]));
            layout::list(&numbers.collect::<Vec<_>>())
        };
        stacked.column_iter().flat_map(list).collect()
    }

    fn images<S: Simd>(map: &LinearMap, list: &[ComplexVector]) -> Vec<ComplexVector> {
        let mut found = Vec::new();
        let images = &mut found;
        Apply { map, list, images }.run::<S>();
        found
    }

    proptest! {
        /// Against the product of nalgebra, in every shape and for any number of lists, odd
        /// numbers of rows with a zero after the last.
        #[test]
        fn images_are_the_matrix_product(
            from in 1_usize..10,
            rows in 1_usize..20,
            count in 1_usize..10,
            seed in -10.0..10.0_f64,
        ) {
            let (a, z) = (matrix(rows, 2 * from, seed), matrix(2 * from, count, seed + 5.0));
            let map = LinearMap::of(&a);
            let mut product = (&a * &z).insert_row(rows, 0.0);
            if rows % 2 == 0 {
                product = product.remove_row(rows);
            }
            let expected = packed(&product);
            let plain = images::<Plain>(&map, &packed(&z));
            prop_assert_eq!(plain.len(), expected.len());
            prop_assert_eq!(map.vectors() * count, plain.len());
            // A sum of 20 terms of at most 1.
            let close = 40.0 * f64::EPSILON;
            for (found, expected) in plain.iter().flatten().flatten().zip(expected.iter().flatten().flatten()) {
                prop_assert!((found - expected).abs() < close, "{found} {expected}");
            }
            #[cfg(target_arch = "x86_64")]
            if avx2_available() {
                // SAFETY: the machine has these instructions.
                prop_assert_eq!(unsafe { avx2::run(Compare(&map, &packed(&z))) }, plain);
            }
        }
    }

    /// [`images`] compiled for an arithmetic.
    struct Compare<'a>(&'a LinearMap, &'a [ComplexVector]);

    impl Work for Compare<'_> {
        type Output = Vec<ComplexVector>;

        #[inline(always)]
        fn run<S: Simd>(self) -> Self::Output {
            images::<S>(self.0, self.1)
        }
    }

    #[test]
    fn lists_are_scaled_number_by_number() {
        let numbers = |seed: f64| -> Vec<Complex<f64>> {
            (0..5)
                .map(|k| Complex::new((seed + k as f64).sin(), seed * k as f64))
                .collect()
        };
        let (first, second, factors) = (numbers(0.3), numbers(1.1), numbers(2.0));
        let mut lists = [layout::list(&first), layout::list(&second)].concat();
        scale(&mut lists, &layout::list(&factors));
        for (list, numbers) in lists.chunks(2).zip([first, second]) {
            for (k, (z, factor)) in numbers.iter().zip(&factors).enumerate() {
                let error = (layout::get(list, k) - z * factor).modulus();
                assert!(
                    error < 4.0 * f64::EPSILON * (z * factor).modulus(),
                    "{k}: {error}"
                );
            }
        }
    }
}
