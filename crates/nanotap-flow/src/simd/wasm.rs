//! Four lanes in two registers of WebAssembly.
//!
//! WebAssembly has no fused multiply-add whose result is certain: `relaxed_madd` is fused where the
//! processor has one. The page tests that once. For other machines the same module is written again
//! with calls of [`nanotap_fused`] in place of that instruction (`cargo xtask page`), so that the code is
//! compiled once and both give the same bits.

use std::arch::wasm32 as x;

use super::{Lanes, Simd, Vector, Work};

/// 128-bit registers, with fused multiply-add.
#[derive(Clone, Copy)]
pub(crate) struct Wasm;

type Half = x::v128;

/// `a b + c` of numbers, rounded once.
#[inline(always)]
pub(crate) fn fused_numbers(a: f64, b: f64, c: f64) -> f64 {
    let [a, b, c] = [a, b, c].map(|number| x::f64x2_splat(number));
    x::f64x2_extract_lane::<0>(x::f64x2_relaxed_madd(a, b, c))
}

/// Operations on both halves.
macro_rules! halves {
    ($($operation:ident($($operand:ident),+) = $value:expr;)+) => {
        $(
            #[inline(always)]
            fn $operation($($operand: [Half; 2]),+) -> [Half; 2] {
                let one = |$($operand: Half),+| $value;
                [one($($operand[0]),+), one($($operand[1]),+)]
            }
        )+
    };
}

/// The rounded sum and its error.
#[inline(always)]
fn two_sum(a: Half, b: Half) -> (Half, Half) {
    let sum = x::f64x2_add(a, b);
    let of_b = x::f64x2_sub(sum, a);
    let of_a = x::f64x2_sub(sum, of_b);
    (
        sum,
        x::f64x2_add(x::f64x2_sub(a, of_a), x::f64x2_sub(b, of_b)),
    )
}

/// The upper half of the digits, and the rest.
#[inline(always)]
fn split(a: Half) -> (Half, Half) {
    let scaled = x::f64x2_mul(a, x::f64x2_splat(134_217_729.0));
    let high = x::f64x2_sub(scaled, x::f64x2_sub(scaled, a));
    (high, x::f64x2_sub(a, high))
}

/// `a b + c`, rounded once: the exact product and sum, whose small part is rounded to odd (Boldo and
/// Melquiond, 2008). Outside the range where that is exact, lane by lane.
#[unsafe(no_mangle)]
pub extern "C" fn nanotap_fused(a: Half, b: Half, c: Half) -> Half {
    let product = x::f64x2_mul(a, b);
    // The range.
    let (least, most) = (
        x::f64x2_splat(f64::from_bits((1023 - 900) << 52)),
        x::f64x2_splat(f64::from_bits((1023 + 900) << 52)),
    );
    let zero = x::f64x2_splat(0.0);
    let (size, other) = (x::f64x2_abs(product), x::f64x2_abs(c));
    let nothing = x::v128_or(x::f64x2_eq(a, zero), x::f64x2_eq(b, zero));
    let large = x::f64x2_pmax(
        x::f64x2_pmax(size, other),
        x::f64x2_pmax(x::f64x2_abs(a), x::f64x2_abs(b)),
    );
    let fine = x::v128_and(
        x::v128_and(
            x::v128_or(x::f64x2_ge(size, least), nothing),
            x::v128_or(x::f64x2_ge(other, least), x::f64x2_eq(c, zero)),
        ),
        x::f64x2_le(large, most),
    );
    if !x::i64x2_all_true(fine) {
        return lane_by_lane(a, b, c);
    }
    let ((ah, al), (bh, bl)) = (split(a), split(b));
    let error = x::f64x2_sub(x::f64x2_mul(ah, bh), product);
    let error = x::f64x2_add(error, x::f64x2_mul(ah, bl));
    let error = x::f64x2_add(error, x::f64x2_mul(al, bh));
    let error = x::f64x2_add(error, x::f64x2_mul(al, bl));
    let (th, tl) = two_sum(c, error);
    let (vh, vl) = two_sum(product, th);
    let (sum, rest) = two_sum(tl, vl);
    // Rounded to odd: towards the rest, if the last bit is even and there is a rest.
    let one = x::i64x2_splat(1);
    let even = x::i64x2_eq(x::v128_and(sum, one), x::i64x2_splat(0));
    let inexact = x::f64x2_ne(rest, zero);
    // 1 away from zero where both have the same sign, −1 otherwise.
    let apart = x::i64x2_shr(x::v128_xor(sum, rest), 63);
    let step = x::v128_or(apart, one);
    let odd = x::i64x2_add(sum, x::v128_and(step, x::v128_and(even, inexact)));
    let value = x::f64x2_add(vh, odd);
    x::v128_bitselect(x::f64x2_add(product, c), value, nothing)
}

/// `c − a b`, rounded once.
#[unsafe(no_mangle)]
pub extern "C" fn nanotap_fused_negative(a: Half, b: Half, c: Half) -> Half {
    nanotap_fused(x::f64x2_neg(a), b, c)
}

#[cold]
#[inline(never)]
fn lane_by_lane(a: Half, b: Half, c: Half) -> Half {
    let lanes = |a| [x::f64x2_extract_lane::<0>(a), x::f64x2_extract_lane::<1>(a)];
    let (a, b, c) = (lanes(a), lanes(b), lanes(c));
    x::f64x2(a[0].mul_add(b[0], c[0]), a[1].mul_add(b[1], c[1]))
}

impl Lanes for Wasm {
    type Register = [Half; 2];

    halves! {
        add(a, b) = x::f64x2_add(a, b);
        sub(a, b) = x::f64x2_sub(a, b);
        mul(a, b) = x::f64x2_mul(a, b);
        div(a, b) = x::f64x2_div(a, b);
        fma(a, b, c) = x::f64x2_relaxed_madd(a, b, c);
        fnma(a, b, c) = x::f64x2_relaxed_nmadd(a, b, c);
        sqrt(a) = x::f64x2_sqrt(a);
        min(a, b) = x::f64x2_pmin(b, a);
        max(a, b) = x::f64x2_pmax(b, a);
        power_of_two(shifted) = x::i64x2_add(x::i64x2_shl(shifted, 52), x::f64x2_splat(1.0));
    }
    #[inline(always)]
    fn splat(a: f64) -> Self::Register {
        [x::f64x2_splat(a); 2]
    }
    #[inline(always)]
    fn map(a: Self::Register, function: fn(f64) -> f64) -> Self::Register {
        Self::load(&Self::store(a).map(function))
    }
    #[inline(always)]
    fn below(a: Self::Register, b: Self::Register) -> u32 {
        let one = |k: usize| u32::from(x::i64x2_bitmask(x::v128_not(x::f64x2_ge(a[k], b[k]))));
        one(0) | (one(1) << 2)
    }
    #[inline(always)]
    fn turn(
        shifted: Self::Register,
        sine: Self::Register,
        cosine: Self::Register,
    ) -> (Self::Register, Self::Register) {
        let one = |k: usize| {
            let (quadrant, sine, cosine) = (shifted[k], sine[k], cosine[k]);
            let odd = x::i64x2_shr(x::i64x2_shl(quadrant, 63), 63);
            let two = x::i64x2_splat(2);
            let sign = |q| x::i64x2_shl(x::v128_and(q, two), 62);
            let next = x::i64x2_add(quadrant, x::i64x2_splat(1));
            (
                x::v128_xor(x::v128_bitselect(cosine, sine, odd), sign(quadrant)),
                x::v128_xor(x::v128_bitselect(sine, cosine, odd), sign(next)),
            )
        };
        let (a, b) = (one(0), one(1));
        ([a.0, b.0], [a.1, b.1])
    }
}

impl Simd for Wasm {
    #[inline(always)]
    fn apart<W: Work>(work: W) -> W::Output {
        run_apart(work)
    }
    #[inline(always)]
    fn load(a: &Vector) -> Self::Register {
        [x::f64x2(a[0], a[1]), x::f64x2(a[2], a[3])]
    }
    #[inline(always)]
    fn store(a: Self::Register) -> Vector {
        let lanes = |a| [x::f64x2_extract_lane::<0>(a), x::f64x2_extract_lane::<1>(a)];
        let (low, high) = (lanes(a[0]), lanes(a[1]));
        [low[0], low[1], high[0], high[1]]
    }
    #[inline(always)]
    fn sums([a, b, c, d]: [Self::Register; 4]) -> Self::Register {
        let pairs = |a: Half, b: Half| {
            x::f64x2_add(
                x::i64x2_shuffle::<0, 2>(a, b),
                x::i64x2_shuffle::<1, 3>(a, b),
            )
        };
        let two = |a: [Half; 2], b: [Half; 2]| x::f64x2_add(pairs(a[0], b[0]), pairs(a[1], b[1]));
        [two(a, b), two(c, d)]
    }
    #[inline(always)]
    fn with_first(a: Self::Register, b: Self::Register) -> Self::Register {
        [x::i64x2_shuffle::<2, 1>(a[0], b[0]), a[1]]
    }
    #[inline(always)]
    fn shifted_in(before: Self::Register, a: Self::Register) -> Self::Register {
        [
            x::i64x2_shuffle::<1, 2>(before[1], a[0]),
            x::i64x2_shuffle::<1, 2>(a[0], a[1]),
        ]
    }
    #[inline(always)]
    fn select(mask: u32, a: Self::Register, b: Self::Register) -> Self::Register {
        let one = |k: usize| {
            let bit = |n: usize| -i64::from((mask >> (2 * k + n)) & 1);
            x::v128_bitselect(a[k], b[k], x::i64x2(bit(0), bit(1)))
        };
        [one(0), one(1)]
    }
}

/// Runs the work without inlining it into the caller.
#[inline(never)]
fn run_apart<W: Work>(work: W) -> W::Output {
    work.run::<Wasm>()
}
