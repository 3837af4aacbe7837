//! One number alone, for what is written once for one motion and for many side by side.

use super::Lanes;

/// A plain number. Its multiply-add rounds twice, which every machine does without a library.
#[derive(Clone, Copy)]
pub(crate) struct Single;

impl Lanes for Single {
    type Register = f64;

    #[inline(always)]
    fn splat(a: f64) -> f64 {
        a
    }
    #[inline(always)]
    fn add(a: f64, b: f64) -> f64 {
        a + b
    }
    #[inline(always)]
    fn sub(a: f64, b: f64) -> f64 {
        a - b
    }
    #[inline(always)]
    fn mul(a: f64, b: f64) -> f64 {
        a * b
    }
    #[inline(always)]
    fn div(a: f64, b: f64) -> f64 {
        a / b
    }
    #[inline(always)]
    fn fma(a: f64, b: f64, c: f64) -> f64 {
        a * b + c
    }
    #[inline(always)]
    fn fnma(a: f64, b: f64, c: f64) -> f64 {
        c - a * b
    }
    #[inline(always)]
    fn sqrt(a: f64) -> f64 {
        a.sqrt()
    }
    #[inline(always)]
    fn min(a: f64, b: f64) -> f64 {
        if a < b { a } else { b }
    }
    #[inline(always)]
    fn max(a: f64, b: f64) -> f64 {
        if a > b { a } else { b }
    }
    #[inline(always)]
    fn below(a: f64, b: f64) -> u32 {
        let at_least = a >= b;
        u32::from(!at_least)
    }
    #[inline(always)]
    fn power_of_two(shifted: f64) -> f64 {
        f64::from_bits((shifted.to_bits() << 52).wrapping_add(1.0_f64.to_bits()))
    }
    #[inline(always)]
    fn turn(shifted: f64, sine: f64, cosine: f64) -> (f64, f64) {
        let quadrant = shifted.to_bits();
        let (even, odd) = if quadrant & 1 == 0 {
            (sine, cosine)
        } else {
            (cosine, sine)
        };
        let sign = |value: f64, quarter: u64| {
            f64::from_bits(value.to_bits() ^ ((quadrant.wrapping_add(quarter) & 2) << 62))
        };
        (sign(even, 0), sign(odd, 1))
    }
    #[inline(always)]
    fn map(a: f64, function: fn(f64) -> f64) -> f64 {
        function(a)
    }
}
