//! Four numbers at a time: exponentials, sines and cosines of the exact flow.
//!
//! The same source is compiled for any machine ([`Plain`]) and for vector registers with
//! fused multiply-add ([`Fused`]; [`crate::flow`] picks at run time). The two agree to
//! rounding, and each gives the same bits on every run.

/// Lanes in a pack.
pub(crate) const WIDTH: usize = 4;

/// Four lanes in memory.
pub(crate) type Pack = [f64; WIDTH];

/// How four lanes are held and computed with.
pub(crate) trait Math: Copy {
    /// Whether functions come from the standard library, one lane at a time.
    const LIBRARY: bool = false;
    /// Whether it needs AVX2 and FMA.
    const FUSED: bool = false;
    /// Four lanes.
    type Lanes: Copy;

    fn load(a: &Pack) -> Self::Lanes;
    fn store(a: Self::Lanes) -> Pack;
    fn splat(a: f64) -> Self::Lanes;
    fn add(a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;
    fn sub(a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;
    fn mul(a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;
    /// `a b + c`.
    fn fma(a: Self::Lanes, b: Self::Lanes, c: Self::Lanes) -> Self::Lanes;
    /// `c − a b`.
    fn fnma(a: Self::Lanes, b: Self::Lanes, c: Self::Lanes) -> Self::Lanes;
    fn sqrt(a: Self::Lanes) -> Self::Lanes;
    fn min(a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;
    fn max(a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;
    /// A bit a lane, set where not `a ≥ b` (so where one is not a number as well).
    fn below(a: Self::Lanes, b: Self::Lanes) -> u32;
    /// `a` with the first lane of `b`.
    fn with_first(a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;
    /// The lanes of `a` moved up by one, `before`'s last one first.
    fn shifted_in(before: Self::Lanes, a: Self::Lanes) -> Self::Lanes;
    /// The lanes, none below `low` or above `high`.
    fn clamp(a: Self::Lanes, low: f64, high: f64) -> Self::Lanes;
    /// `2^n` from the sum of [`ROUND`] and an integer `n`.
    fn power_of_two(shifted: Self::Lanes) -> Self::Lanes;
    /// The sum of each pack's lanes, side by side.
    fn sums(a: [Self::Lanes; 4]) -> Self::Lanes;
    /// Sine and cosine of an angle from those of its rest beyond a multiple of π/2; the
    /// multiple is in the low bits of `shifted`.
    fn turn(
        shifted: Self::Lanes,
        sine: Self::Lanes,
        cosine: Self::Lanes,
    ) -> (Self::Lanes, Self::Lanes);
}

/// The sums of four packs' lanes.
#[inline(always)]
pub(crate) fn sums<M: Math>(a: [M::Lanes; 4]) -> [f64; 4] {
    M::store(M::sums(a))
}

/// The sum of four lanes, pairwise.
#[inline(always)]
pub(crate) fn sum<M: Math>(a: M::Lanes) -> f64 {
    let a = M::store(a);
    (a[0] + a[2]) + (a[1] + a[3])
}

/// `a b` of complex numbers.
#[inline(always)]
pub(crate) fn complex_mul<M: Math>(
    [ar, ai]: [M::Lanes; 2],
    [br, bi]: [M::Lanes; 2],
) -> [M::Lanes; 2] {
    [
        M::fnma(ai, bi, M::mul(ar, br)),
        M::fma(ai, br, M::mul(ar, bi)),
    ]
}

/// Adding and subtracting this rounds to an integer and leaves it in the low bits.
pub(crate) const ROUND: f64 = 6_755_399_441_055_744.0;

/// `e^x`, to about one unit in the last place, for `x ≤ 709`; below −708 it stays near
/// the smallest normal number.
#[inline(always)]
pub(crate) fn exp<M: Math>(x: M::Lanes) -> M::Lanes {
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    if M::LIBRARY {
        return M::load(&M::store(x).map(f64::exp));
    }
    let c = M::splat;
    let x = M::clamp(x, -708.0, 709.0);
    let shifted = M::fma(x, c(std::f64::consts::LOG2_E), c(ROUND));
    let n = M::sub(shifted, c(ROUND));
    let r = M::fnma(n, c(LN2_LOW), M::fnma(n, c(LN2_HIGH), x));
    // Taylor to degree 13 on |r| ≤ ln 2 / 2, in Estrin's order.
    let r2 = M::mul(r, r);
    let r4 = M::mul(r2, r2);
    let p01 = M::add(c(1.0), r);
    let p23 = M::fma(r, c(1.0 / 6.0), c(0.5));
    let p45 = M::fma(r, c(1.0 / 120.0), c(1.0 / 24.0));
    let p67 = M::fma(r, c(1.0 / 5_040.0), c(1.0 / 720.0));
    let p89 = M::fma(r, c(1.0 / 362_880.0), c(1.0 / 40_320.0));
    let pab = M::fma(r, c(1.0 / 39_916_800.0), c(1.0 / 3_628_800.0));
    let pcd = M::fma(r, c(1.0 / 6_227_020_800.0), c(1.0 / 479_001_600.0));
    let low = M::fma(p23, r2, p01);
    let middle = M::fma(p67, r2, p45);
    let high = M::fma(pab, r2, p89);
    let p = M::fma(M::fma(pcd, r4, high), r4, middle);
    M::mul(M::fma(p, r4, low), M::power_of_two(shifted))
}

/// Angles up to which [`sin_cos`] is accurate.
pub(crate) const LARGEST_ANGLE: f64 = 1e6;

/// `sin x` and `cos x` to about one unit in the last place for `|x| ≤` [`LARGEST_ANGLE`].
#[inline(always)]
pub(crate) fn sin_cos<M: Math>(x: M::Lanes) -> (M::Lanes, M::Lanes) {
    // π/2 in three parts of 33 bits (fdlibm), so that multiples up to 2^20 are exact.
    const PIO2_1: f64 = 1.570_796_326_734_125_6;
    const PIO2_2: f64 = 6.077_100_506_303_966e-11;
    const PIO2_3: f64 = 2.022_266_248_711_166_5e-21;
    if M::LIBRARY {
        let x = M::store(x);
        return (M::load(&x.map(f64::sin)), M::load(&x.map(f64::cos)));
    }
    let c = M::splat;
    let shifted = M::fma(x, c(std::f64::consts::FRAC_2_PI), c(ROUND));
    let n = M::sub(shifted, c(ROUND));
    let r = M::fnma(
        n,
        c(PIO2_3),
        M::fnma(n, c(PIO2_2), M::fnma(n, c(PIO2_1), x)),
    );
    let z = M::mul(r, r);
    let z2 = M::mul(z, z);
    // fdlibm's minimax polynomials on |r| ≤ π/4.
    let s0 = M::fma(
        z,
        c(8.333_333_333_322_49e-3),
        c(-1.666_666_666_666_663_2e-1),
    );
    let s1 = M::fma(
        z,
        c(2.755_731_370_707_006_8e-6),
        c(-1.984_126_982_985_795e-4),
    );
    let s2 = M::fma(
        z,
        c(1.589_690_995_211_55e-10),
        c(-2.505_076_025_340_686_3e-8),
    );
    let s = M::fma(M::fma(M::fma(s2, z2, s1), z2, s0), M::mul(z, r), r);
    let c0 = M::fma(z, c(-1.388_888_888_887_411e-3), c(4.166_666_666_666_66e-2));
    let c1 = M::fma(
        z,
        c(-2.755_731_435_139_066_3e-7),
        c(2.480_158_728_947_673e-5),
    );
    let c2 = M::fma(
        z,
        c(-1.135_964_755_778_819_5e-11),
        c(2.087_572_321_298_175e-9),
    );
    let p = M::fma(M::fma(c2, z2, c1), z2, c0);
    let cosine = M::fma(p, z2, M::fma(z, c(-0.5), c(1.0)));
    M::turn(shifted, s, cosine)
}

/// `e^{(a + ib) s}`: real and imaginary part.
#[inline(always)]
pub(crate) fn exp_complex<M: Math>(a: M::Lanes, b: M::Lanes, s: M::Lanes) -> [M::Lanes; 2] {
    let grown = exp::<M>(M::mul(a, s));
    let (sin, cos) = sin_cos::<M>(M::mul(b, s));
    [M::mul(grown, cos), M::mul(grown, sin)]
}

/// Sizes below which [`exp_small`] is accurate.
pub(crate) const SMALL_ANGLE: f64 = 1e-4;

/// `e^z` for `|z| ≤` [`SMALL_ANGLE`]: `1 + z + z²/2 + z³/6` leaves out 4e-18.
#[inline(always)]
pub(crate) fn exp_small<M: Math>(z: [M::Lanes; 2]) -> [M::Lanes; 2] {
    let one = M::splat(1.0);
    let inner = [
        M::fma(z[0], M::splat(1.0 / 3.0), one),
        M::mul(z[1], M::splat(1.0 / 3.0)),
    ];
    let half = z.map(|z| M::mul(z, M::splat(0.5)));
    let middle = complex_mul::<M>(half, inner);
    let [re, im] = complex_mul::<M>(z, [M::add(one, middle[0]), middle[1]]);
    [M::add(one, re), im]
}

/// On any machine.
#[derive(Clone, Copy)]
pub(crate) struct Plain;

/// Whether this machine has fused multiply-add in vectors of four.
pub(crate) fn fused_available() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}

/// With the standard library's functions, for angles beyond [`LARGEST_ANGLE`].
#[derive(Clone, Copy)]
pub(crate) struct Library;

/// The arithmetic of arrays, shared by [`Plain`] and [`Library`].
macro_rules! arrays {
    () => {
        type Lanes = Pack;

        #[inline(always)]
        fn load(a: &Pack) -> Pack {
            *a
        }
        #[inline(always)]
        fn store(a: Pack) -> Pack {
            a
        }
        #[inline(always)]
        fn splat(a: f64) -> Pack {
            [a; WIDTH]
        }
        #[inline(always)]
        fn add(a: Pack, b: Pack) -> Pack {
            std::array::from_fn(|i| a[i] + b[i])
        }
        #[inline(always)]
        fn sub(a: Pack, b: Pack) -> Pack {
            std::array::from_fn(|i| a[i] - b[i])
        }
        #[inline(always)]
        fn mul(a: Pack, b: Pack) -> Pack {
            std::array::from_fn(|i| a[i] * b[i])
        }
        #[inline(always)]
        fn fma(a: Pack, b: Pack, c: Pack) -> Pack {
            std::array::from_fn(|i| a[i] * b[i] + c[i])
        }
        #[inline(always)]
        fn fnma(a: Pack, b: Pack, c: Pack) -> Pack {
            std::array::from_fn(|i| c[i] - a[i] * b[i])
        }
        #[inline(always)]
        fn sums(a: [Pack; 4]) -> Pack {
            a.map(|a| (a[0] + a[1]) + (a[2] + a[3]))
        }
        #[inline(always)]
        fn sqrt(a: Pack) -> Pack {
            a.map(f64::sqrt)
        }
        #[inline(always)]
        fn min(a: Pack, b: Pack) -> Pack {
            std::array::from_fn(|i| if a[i] < b[i] { a[i] } else { b[i] })
        }
        #[inline(always)]
        fn max(a: Pack, b: Pack) -> Pack {
            std::array::from_fn(|i| if a[i] > b[i] { a[i] } else { b[i] })
        }
        #[inline(always)]
        fn below(a: Pack, b: Pack) -> u32 {
            let at_least = |i: usize| a[i] >= b[i];
            (0..WIDTH).fold(0, |bits, i| bits | (u32::from(!at_least(i)) << i))
        }
        #[inline(always)]
        fn with_first(a: Pack, b: Pack) -> Pack {
            [b[0], a[1], a[2], a[3]]
        }
        #[inline(always)]
        fn shifted_in(before: Pack, a: Pack) -> Pack {
            [before[3], a[0], a[1], a[2]]
        }
        #[inline(always)]
        fn clamp(a: Pack, low: f64, high: f64) -> Pack {
            a.map(|a| a.max(low).min(high))
        }
        #[inline(always)]
        fn power_of_two(shifted: Pack) -> Pack {
            shifted.map(|s| f64::from_bits((s.to_bits() << 52).wrapping_add(1.0_f64.to_bits())))
        }
        #[inline(always)]
        fn turn(shifted: Pack, sine: Pack, cosine: Pack) -> (Pack, Pack) {
            let turned = |i: usize, quarter: u64, even: Pack, odd: Pack| {
                let quadrant = shifted[i].to_bits();
                let value = if quadrant & 1 == 0 { even[i] } else { odd[i] };
                f64::from_bits(value.to_bits() ^ ((quadrant.wrapping_add(quarter) & 2) << 62))
            };
            (
                std::array::from_fn(|i| turned(i, 0, sine, cosine)),
                std::array::from_fn(|i| turned(i, 1, cosine, sine)),
            )
        }
    };
}

impl Math for Plain {
    arrays!();
}

impl Math for Library {
    const LIBRARY: bool = true;
    arrays!();
}

/// In vector registers with fused multiply-add. Only the inner loop uses it, inside a
/// function compiled for machines that have AVX2 and FMA.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(crate) struct Fused;

#[cfg(target_arch = "x86_64")]
mod fused {
    use super::{Fused, Math, Pack};
    use std::arch::x86_64 as x;

    // SAFETY of every block here: these instructions need AVX2 and FMA and nothing else;
    // `Fused` is used only where the machine was found to have them.
    impl Math for Fused {
        const FUSED: bool = true;
        type Lanes = x::__m256d;

        #[inline(always)]
        fn load(a: &Pack) -> Self::Lanes {
            unsafe { x::_mm256_loadu_pd(a.as_ptr()) }
        }
        #[inline(always)]
        fn store(a: Self::Lanes) -> Pack {
            let mut out = [0.0; super::WIDTH];
            unsafe { x::_mm256_storeu_pd(out.as_mut_ptr(), a) };
            out
        }
        #[inline(always)]
        fn splat(a: f64) -> Self::Lanes {
            unsafe { x::_mm256_set1_pd(a) }
        }
        #[inline(always)]
        fn add(a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
            unsafe { x::_mm256_add_pd(a, b) }
        }
        #[inline(always)]
        fn sub(a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
            unsafe { x::_mm256_sub_pd(a, b) }
        }
        #[inline(always)]
        fn mul(a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
            unsafe { x::_mm256_mul_pd(a, b) }
        }
        #[inline(always)]
        fn fma(a: Self::Lanes, b: Self::Lanes, c: Self::Lanes) -> Self::Lanes {
            unsafe { x::_mm256_fmadd_pd(a, b, c) }
        }
        #[inline(always)]
        fn fnma(a: Self::Lanes, b: Self::Lanes, c: Self::Lanes) -> Self::Lanes {
            unsafe { x::_mm256_fnmadd_pd(a, b, c) }
        }
        #[inline(always)]
        fn sums([a, b, c, d]: [Self::Lanes; 4]) -> Self::Lanes {
            unsafe {
                let (ab, cd) = (x::_mm256_hadd_pd(a, b), x::_mm256_hadd_pd(c, d));
                let crossed = x::_mm256_permute2f128_pd::<0x21>(ab, cd);
                x::_mm256_add_pd(crossed, x::_mm256_blend_pd::<0b1100>(ab, cd))
            }
        }
        #[inline(always)]
        fn sqrt(a: Self::Lanes) -> Self::Lanes {
            unsafe { x::_mm256_sqrt_pd(a) }
        }
        #[inline(always)]
        fn min(a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
            unsafe { x::_mm256_min_pd(a, b) }
        }
        #[inline(always)]
        fn max(a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
            unsafe { x::_mm256_max_pd(a, b) }
        }
        #[inline(always)]
        fn below(a: Self::Lanes, b: Self::Lanes) -> u32 {
            unsafe { x::_mm256_movemask_pd(x::_mm256_cmp_pd::<{ x::_CMP_NGE_UQ }>(a, b)) as u32 }
        }
        #[inline(always)]
        fn with_first(a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
            unsafe { x::_mm256_blend_pd::<0b0001>(a, b) }
        }
        #[inline(always)]
        fn shifted_in(before: Self::Lanes, a: Self::Lanes) -> Self::Lanes {
            unsafe {
                let crossed = x::_mm256_permute2f128_pd::<0x21>(before, a);
                x::_mm256_shuffle_pd::<0b0101>(crossed, a)
            }
        }
        #[inline(always)]
        fn clamp(a: Self::Lanes, low: f64, high: f64) -> Self::Lanes {
            unsafe {
                x::_mm256_min_pd(
                    x::_mm256_max_pd(a, x::_mm256_set1_pd(low)),
                    x::_mm256_set1_pd(high),
                )
            }
        }
        #[inline(always)]
        fn power_of_two(shifted: Self::Lanes) -> Self::Lanes {
            unsafe {
                let bits = x::_mm256_slli_epi64::<52>(x::_mm256_castpd_si256(shifted));
                let one = x::_mm256_castpd_si256(x::_mm256_set1_pd(1.0));
                x::_mm256_castsi256_pd(x::_mm256_add_epi64(bits, one))
            }
        }
        #[inline(always)]
        fn turn(
            shifted: Self::Lanes,
            sine: Self::Lanes,
            cosine: Self::Lanes,
        ) -> (Self::Lanes, Self::Lanes) {
            unsafe {
                let quadrant = x::_mm256_castpd_si256(shifted);
                // The blend looks at the sign bit: move the lowest bit there.
                let odd = x::_mm256_castsi256_pd(x::_mm256_slli_epi64::<63>(quadrant));
                let two = x::_mm256_set1_epi64x(2);
                let sign = |q| {
                    x::_mm256_castsi256_pd(x::_mm256_slli_epi64::<62>(x::_mm256_and_si256(q, two)))
                };
                let next = x::_mm256_add_epi64(quadrant, x::_mm256_set1_epi64x(1));
                (
                    x::_mm256_xor_pd(x::_mm256_blendv_pd(sine, cosine, odd), sign(quadrant)),
                    x::_mm256_xor_pd(x::_mm256_blendv_pd(cosine, sine, odd), sign(next)),
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn all<M: Math>(x: f64, y: f64) -> (f64, f64, f64) {
        let (s, c) = sin_cos::<M>(M::splat(y));
        (
            M::store(exp::<M>(M::splat(x)))[1],
            M::store(s)[2],
            M::store(c)[3],
        )
    }

    fn each(x: f64, y: f64) -> Vec<(f64, f64, f64)> {
        let mut results = vec![all::<Plain>(x, y)];
        #[cfg(target_arch = "x86_64")]
        if fused_available() {
            results.push(all::<Fused>(x, y));
        }
        results
    }

    proptest! {
        /// Against the standard library's functions, to a few units in the last place.
        #[test]
        fn functions_agree_with_the_standard_library(x in -700.0..700.0_f64, y in -1e6..1e6_f64) {
            for (e, s, c) in each(x, y) {
                prop_assert!((e / x.exp() - 1.0).abs() < 4e-16, "exp {x}: {e}");
                prop_assert!((s - y.sin()).abs() < 3e-16, "sin {y}: {s} {}", y.sin());
                prop_assert!((c - y.cos()).abs() < 3e-16, "cos {y}: {c} {}", y.cos());
            }
        }
    }

    fn rows<M: Math>() -> [f64; 4] {
        let a: [Pack; 4] =
            std::array::from_fn(|i| std::array::from_fn(|j| (10 * i + j * j) as f64));
        sums::<M>(a.map(|a| M::load(&a)))
    }

    fn moved<M: Math>() -> (Pack, Pack, Pack, u32) {
        let (a, b) = (
            M::load(&[1.0, 2.0, 3.0, 4.0]),
            M::load(&[5.0, 1.0, f64::NAN, 4.0]),
        );
        (
            M::store(M::min(a, M::splat(2.5))),
            M::store(M::with_first(a, b)),
            M::store(M::shifted_in(b, a)),
            M::below(a, b),
        )
    }

    #[test]
    fn lanes_are_moved_and_compared() {
        let expected = (
            [1.0, 2.0, 2.5, 2.5],
            [5.0, 2.0, 3.0, 4.0],
            [4.0, 1.0, 2.0, 3.0],
            0b0101,
        );
        assert_eq!(moved::<Plain>(), expected);
        #[cfg(target_arch = "x86_64")]
        if fused_available() {
            assert_eq!(moved::<Fused>(), expected);
        }
    }

    #[test]
    fn sums_of_packs() {
        let expected = [14.0, 54.0, 94.0, 134.0];
        assert_eq!(rows::<Plain>(), expected);
        #[cfg(target_arch = "x86_64")]
        if fused_available() {
            assert_eq!(rows::<Fused>(), expected);
        }
    }

    #[test]
    fn small_arguments_keep_their_relative_accuracy() {
        for x in [0.0, 1e-300, 1e-17, 1e-9, 0.3] {
            for (e, s, c) in each(x, x) {
                assert!((s - x.sin()).abs() <= 2e-16 * x, "{x}");
                assert!((c - x.cos()).abs() <= 2e-16);
                assert!((e - x.exp()).abs() <= 3e-16 * x.exp());
            }
        }
        assert!(each(-1e4, 0.0).iter().all(|(e, _, _)| *e < 1e-300));
    }
}
