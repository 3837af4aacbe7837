//! How lists of numbers lie in vectors: number `k` in lane `k mod WIDTH` of vector `⌊k/WIDTH⌋`,
//! and zero in the lanes that are left over.

use nalgebra::Complex;

use super::{ComplexVector, WIDTH};

/// The vector and the lane of number `k`.
#[inline(always)]
pub(crate) const fn place(k: usize) -> (usize, usize) {
    (k / WIDTH, k % WIDTH)
}

/// How many vectors hold `count` numbers.
#[inline(always)]
pub(crate) const fn vectors_for(count: usize) -> usize {
    count.div_ceil(WIDTH)
}

/// Complex number `k` of a list.
#[inline(always)]
pub(crate) fn get(list: &[ComplexVector], k: usize) -> Complex<f64> {
    let (vector, lane) = place(k);
    let [re, im] = &list[vector];
    Complex::new(re[lane], im[lane])
}

/// Sets complex number `k` of a list.
#[inline(always)]
pub(crate) fn set(list: &mut [ComplexVector], k: usize, z: Complex<f64>) {
    let (vector, lane) = place(k);
    let [re, im] = &mut list[vector];
    re[lane] = z.re;
    im[lane] = z.im;
}

/// A list of complex numbers in vectors.
pub(crate) fn list(numbers: &[Complex<f64>]) -> Vec<ComplexVector> {
    let mut list = vec![[[0.0; WIDTH]; 2]; vectors_for(numbers.len())];
    for (k, &z) in numbers.iter().enumerate() {
        set(&mut list, k, z);
    }
    list
}
