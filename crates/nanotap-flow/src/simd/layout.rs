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
    let mut list = Vec::new();
    append(&mut list, numbers);
    list
}

/// Appends a list to others.
pub(crate) fn append(lists: &mut Vec<ComplexVector>, numbers: &[Complex<f64>]) {
    lists.extend(numbers.chunks(WIDTH).map(|numbers| {
        let mut vector = ComplexVector::default();
        for (lane, z) in numbers.iter().enumerate() {
            vector[0][lane] = z.re;
            vector[1][lane] = z.im;
        }
        vector
    }));
}
