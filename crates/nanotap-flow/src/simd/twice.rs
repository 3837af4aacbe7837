//! Eight numbers in two registers of four.

use super::{Lanes, Octet, Simd, WIDTH, Wide};
use std::marker::PhantomData;

/// Arithmetic on eight numbers in two registers of `S`.
#[derive(Clone, Copy)]
pub(crate) struct Twice<S>(PhantomData<S>);

/// Defines operations that act on both registers in turn.
macro_rules! both {
    ($($operation:ident($($operand:ident),+);)+) => {
        $(
            #[inline(always)]
            fn $operation($($operand: Self::Register),+) -> Self::Register {
                [S::$operation($($operand[0]),+), S::$operation($($operand[1]),+)]
            }
        )+
    };
}

impl<S: Simd> Lanes for Twice<S> {
    const LIBRARY: bool = S::LIBRARY;
    type Register = [S::Register; 2];

    both! {
        add(a, b);
        sub(a, b);
        mul(a, b);
        div(a, b);
        fma(a, b, c);
        fnma(a, b, c);
        sqrt(a);
        min(a, b);
        max(a, b);
        power_of_two(shifted);
    }
    #[inline(always)]
    fn splat(a: f64) -> Self::Register {
        [S::splat(a); 2]
    }
    #[inline(always)]
    fn below(a: Self::Register, b: Self::Register) -> u32 {
        S::below(a[0], b[0]) | (S::below(a[1], b[1]) << WIDTH)
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
