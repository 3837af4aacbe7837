//! Sums, products, exponentials, sines and cosines.

use super::{Lanes, Simd};

/// The sums of four vectors' lanes.
#[inline(always)]
pub(crate) fn sums<S: Simd>(a: [S::Register; 4]) -> [f64; 4] {
    S::store(S::sums(a))
}

/// The sum of four lanes, pairwise.
#[inline(always)]
pub(crate) fn sum<S: Simd>(a: S::Register) -> f64 {
    let a = S::store(a);
    (a[0] + a[2]) + (a[1] + a[3])
}

/// `a b` of complex numbers.
#[inline(always)]
pub(crate) fn complex_mul<S: Lanes>(
    [ar, ai]: [S::Register; 2],
    [br, bi]: [S::Register; 2],
) -> [S::Register; 2] {
    [
        S::fnma(ai, bi, S::mul(ar, br)),
        S::fma(ai, br, S::mul(ar, bi)),
    ]
}

/// Adding and subtracting this rounds to an integer and leaves it in the low bits.
pub(crate) const ROUND: f64 = 6_755_399_441_055_744.0;

/// `e^x`, to about one unit in the last place, for `x ≤ 709`; below −708 it stays near
/// the smallest normal number.
#[inline(always)]
pub(crate) fn exp<S: Lanes>(x: S::Register) -> S::Register {
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    if S::LIBRARY {
        return S::map(x, nanotap_arithmetic::exp);
    }
    let c = S::splat;
    let x = S::clamp(x, -708.0, 709.0);
    let shifted = S::fma(x, c(std::f64::consts::LOG2_E), c(ROUND));
    let n = S::sub(shifted, c(ROUND));
    let r = S::fnma(n, c(LN2_LOW), S::fnma(n, c(LN2_HIGH), x));
    // Taylor to degree 13 on |r| ≤ ln 2 / 2, in Estrin's order.
    let r2 = S::mul(r, r);
    let r4 = S::mul(r2, r2);
    let p01 = S::add(c(1.0), r);
    let p23 = S::fma(r, c(1.0 / 6.0), c(0.5));
    let p45 = S::fma(r, c(1.0 / 120.0), c(1.0 / 24.0));
    let p67 = S::fma(r, c(1.0 / 5_040.0), c(1.0 / 720.0));
    let p89 = S::fma(r, c(1.0 / 362_880.0), c(1.0 / 40_320.0));
    let pab = S::fma(r, c(1.0 / 39_916_800.0), c(1.0 / 3_628_800.0));
    let pcd = S::fma(r, c(1.0 / 6_227_020_800.0), c(1.0 / 479_001_600.0));
    let low = S::fma(p23, r2, p01);
    let middle = S::fma(p67, r2, p45);
    let high = S::fma(pab, r2, p89);
    let p = S::fma(S::fma(pcd, r4, high), r4, middle);
    S::mul(S::fma(p, r4, low), S::power_of_two(shifted))
}

/// Angles up to which [`sin_cos`] is accurate.
pub(crate) const LARGEST_ANGLE: f64 = 1e6;

/// `sin x` and `cos x` to about one unit in the last place for `|x| ≤` [`LARGEST_ANGLE`].
#[inline(always)]
pub(crate) fn sin_cos<S: Lanes>(x: S::Register) -> (S::Register, S::Register) {
    // π/2 in three parts of 33 bits (fdlibm), so that multiples up to 2^20 are exact.
    const PIO2_1: f64 = 1.570_796_326_734_125_6;
    const PIO2_2: f64 = 6.077_100_506_303_966e-11;
    const PIO2_3: f64 = 2.022_266_248_711_166_5e-21;
    if S::LIBRARY {
        return (
            S::map(x, nanotap_arithmetic::sin),
            S::map(x, nanotap_arithmetic::cos),
        );
    }
    let c = S::splat;
    let shifted = S::fma(x, c(std::f64::consts::FRAC_2_PI), c(ROUND));
    let n = S::sub(shifted, c(ROUND));
    let r = S::fnma(
        n,
        c(PIO2_3),
        S::fnma(n, c(PIO2_2), S::fnma(n, c(PIO2_1), x)),
    );
    let z = S::mul(r, r);
    let z2 = S::mul(z, z);
    // fdlibm's minimax polynomials on |r| ≤ π/4.
    let s0 = S::fma(
        z,
        c(8.333_333_333_322_49e-3),
        c(-1.666_666_666_666_663_2e-1),
    );
    let s1 = S::fma(
        z,
        c(2.755_731_370_707_006_8e-6),
        c(-1.984_126_982_985_795e-4),
    );
    let s2 = S::fma(
        z,
        c(1.589_690_995_211_55e-10),
        c(-2.505_076_025_340_686_3e-8),
    );
    let s = S::fma(S::fma(S::fma(s2, z2, s1), z2, s0), S::mul(z, r), r);
    let c0 = S::fma(z, c(-1.388_888_888_887_411e-3), c(4.166_666_666_666_66e-2));
    let c1 = S::fma(
        z,
        c(-2.755_731_435_139_066_3e-7),
        c(2.480_158_728_947_673e-5),
    );
    let c2 = S::fma(
        z,
        c(-1.135_964_755_778_819_5e-11),
        c(2.087_572_321_298_175e-9),
    );
    let p = S::fma(S::fma(c2, z2, c1), z2, c0);
    let cosine = S::fma(p, z2, S::fma(z, c(-0.5), c(1.0)));
    S::turn(shifted, s, cosine)
}

/// `e^{(a + ib) s}`: real and imaginary part.
#[inline(always)]
pub(crate) fn exp_complex<S: Lanes>(
    a: S::Register,
    b: S::Register,
    s: S::Register,
) -> [S::Register; 2] {
    let grown = exp::<S>(S::mul(a, s));
    let (sin, cos) = sin_cos::<S>(S::mul(b, s));
    [S::mul(grown, cos), S::mul(grown, sin)]
}

/// Sizes below which [`exp_small`] is accurate.
pub(crate) const SMALL_ANGLE: f64 = 5e-3;

/// `e^z` for `|z| ≤` [`SMALL_ANGLE`]: the series to the fifth power leaves out 2e-17.
#[inline(always)]
pub(crate) fn exp_small<S: Lanes>(z: [S::Register; 2]) -> [S::Register; 2] {
    let one = S::splat(1.0);
    // 1 + z/1 (1 + z/2 (1 + z/3 (1 + z/4 (1 + z/5)))).
    let mut sum = [
        S::fma(z[0], S::splat(1.0 / 5.0), one),
        S::mul(z[1], S::splat(1.0 / 5.0)),
    ];
    for inverse in [1.0 / 4.0, 1.0 / 3.0, 1.0 / 2.0, 1.0] {
        let part = [
            S::mul(z[0], S::splat(inverse)),
            S::mul(z[1], S::splat(inverse)),
        ];
        let product = complex_mul::<S>(part, sum);
        sum = [S::add(one, product[0]), product[1]];
    }
    sum
}
