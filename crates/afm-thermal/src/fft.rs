//! A fast Fourier transform whose bits are the same on every machine; crates that take their twiddle
//! factors from the platform's sine do not have this property.

use nalgebra::Complex;
use nanotap_arithmetic::from_polar;
use std::f64::consts::TAU;

/// Transforms in place, Σⱼ xⱼ e^{−2πijk/n}, by Cooley and Tukey's radix 2; the length must be a
/// power of two.
pub(crate) fn transform(x: &mut [Complex<f64>]) {
    let n = x.len();
    debug_assert!(n.is_power_of_two());
    let bits = n.trailing_zeros();
    if bits == 0 {
        return;
    }
    for k in 0..n {
        let reversed = k.reverse_bits() >> (usize::BITS - bits);
        if k < reversed {
            x.swap(k, reversed);
        }
    }
    let twiddles: Vec<_> = (0..n / 2)
        .map(|k| from_polar(1.0, -TAU * k as f64 / n as f64))
        .collect();
    let mut half = 1;
    while half < n {
        let stride = n / (2 * half);
        for block in x.chunks_exact_mut(2 * half) {
            let (low, high) = block.split_at_mut(half);
            for (k, (a, b)) in low.iter_mut().zip(high).enumerate() {
                let turned = *b * twiddles[k * stride];
                (*a, *b) = (*a + turned, *a - turned);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_is_the_sum_of_its_definition() {
        let x: Vec<_> = (0..32_u32)
            .map(|k| Complex::new(f64::from(k * k % 7), f64::from(k * 3 % 5)))
            .collect();
        let mut transformed = x.clone();
        transform(&mut transformed);
        for (k, found) in transformed.iter().enumerate() {
            let term = |(j, value): (usize, &Complex<f64>)| {
                value * from_polar(1.0, -TAU * (j * k) as f64 / 32.0)
            };
            let sum: Complex<f64> = x.iter().enumerate().map(term).sum();
            assert!((found - sum).norm_sqr() < 1e-24, "{k}: {found} {sum}");
        }
    }
}
