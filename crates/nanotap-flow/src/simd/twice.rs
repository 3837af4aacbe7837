//! Eight numbers in two registers of four.

use super::{Lanes, Octet, Simd, WIDTH, Wide};
use std::marker::PhantomData;

/// Two registers of `S`.
#[derive(Clone, Copy)]
pub(crate) struct Twice<S>(PhantomData<S>);

impl<S: Simd> Lanes for Twice<S> {
    const LIBRARY: bool = S::LIBRARY;
    type Register = [S::Register; 2];

    #[inline(always)]
    fn splat(a: f64) -> Self::Register {
        [S::splat(a); 2]
    }
    #[inline(always)]
    fn add(a: Self::Register, b: Self::Register) -> Self::Register {
        [S::add(a[0], b[0]), S::add(a[1], b[1])]
    }
    #[inline(always)]
    fn sub(a: Self::Register, b: Self::Register) -> Self::Register {
        [S::sub(a[0], b[0]), S::sub(a[1], b[1])]
    }
    #[inline(always)]
    fn mul(a: Self::Register, b: Self::Register) -> Self::Register {
        [S::mul(a[0], b[0]), S::mul(a[1], b[1])]
    }
    #[inline(always)]
    fn div(a: Self::Register, b: Self::Register) -> Self::Register {
        [S::div(a[0], b[0]), S::div(a[1], b[1])]
    }
    #[inline(always)]
    fn fma(a: Self::Register, b: Self::Register, c: Self::Register) -> Self::Register {
        [S::fma(a[0], b[0], c[0]), S::fma(a[1], b[1], c[1])]
    }
    #[inline(always)]
    fn fnma(a: Self::Register, b: Self::Register, c: Self::Register) -> Self::Register {
        [S::fnma(a[0], b[0], c[0]), S::fnma(a[1], b[1], c[1])]
    }
    #[inline(always)]
    fn sqrt(a: Self::Register) -> Self::Register {
        [S::sqrt(a[0]), S::sqrt(a[1])]
    }
    #[inline(always)]
    fn min(a: Self::Register, b: Self::Register) -> Self::Register {
        [S::min(a[0], b[0]), S::min(a[1], b[1])]
    }
    #[inline(always)]
    fn max(a: Self::Register, b: Self::Register) -> Self::Register {
        [S::max(a[0], b[0]), S::max(a[1], b[1])]
    }
    #[inline(always)]
    fn below(a: Self::Register, b: Self::Register) -> u32 {
        S::below(a[0], b[0]) | (S::below(a[1], b[1]) << WIDTH)
    }
    #[inline(always)]
    fn power_of_two(shifted: Self::Register) -> Self::Register {
        [S::power_of_two(shifted[0]), S::power_of_two(shifted[1])]
    }
    #[inline(always)]
    fn turn(
        shifted: Self::Register,
        sine: Self::Register,
        cosine: Self::Register,
    ) -> (Self::Register, Self::Register) {
        let a = S::turn(shifted[0], sine[0], cosine[0]);
        let b = S::turn(shifted[1], sine[1], cosine[1]);
        ([a.0, b.0], [a.1, b.1])
    }
    #[inline(always)]
    fn map(a: Self::Register, function: fn(f64) -> f64) -> Self::Register {
        [S::map(a[0], function), S::map(a[1], function)]
    }
}

impl<S: Simd> Wide for Twice<S> {
    type One = S;

    #[inline(always)]
    fn load(a: &Octet) -> Self::Register {
        let (halves, _) = a.as_chunks::<WIDTH>();
        [S::load(&halves[0]), S::load(&halves[1])]
    }
    #[inline(always)]
    fn store(a: Self::Register) -> Octet {
        let mut out = Octet::default();
        out[..WIDTH].copy_from_slice(&S::store(a[0]));
        out[WIDTH..].copy_from_slice(&S::store(a[1]));
        out
    }
    #[inline(always)]
    fn select(mask: u32, a: Self::Register, b: Self::Register) -> Self::Register {
        [
            S::select(mask, a[0], b[0]),
            S::select(mask >> WIDTH, a[1], b[1]),
        ]
    }
}
