#[cfg(target_arch = "x86_64")]
use super::avx2::Avx2;
use super::*;
use proptest::prelude::*;

fn all<S: Simd>(x: f64, y: f64) -> (f64, f64, f64) {
    let (s, c) = sin_cos::<S>(S::splat(y));
    (
        S::store(exp::<S>(S::splat(x)))[1],
        S::store(s)[2],
        S::store(c)[3],
    )
}

fn each(x: f64, y: f64) -> Vec<(f64, f64, f64)> {
    let mut results = vec![all::<Plain>(x, y)];
    #[cfg(target_arch = "x86_64")]
    if avx2_available() {
        results.push(all::<Avx2>(x, y));
    }
    results
}

/// What the operations give whose rounding or order could differ.
fn operations<S: Simd>(a: Vector) -> [u64; 6] {
    let x = S::load(&a);
    let y = S::load(&[a[3], a[0], a[1], a[2]]);
    let [re, im] = complex_mul::<S>([x, y], [y, x]);
    [
        sum::<S>(S::fma(x, y, x)),
        sum::<S>(S::fnma(x, y, y)),
        sum::<S>(S::sqrt(S::mul(x, x))),
        sums::<S>([x, y, S::add(x, y), S::sub(x, y)])[2],
        sum::<S>(re),
        sum::<S>(im),
    ]
    .map(f64::to_bits)
}

fn each_operation(a: Vector) -> Vec<[u64; 6]> {
    let mut results = vec![operations::<Plain>(a)];
    #[cfg(target_arch = "x86_64")]
    if avx2_available() {
        results.push(operations::<Avx2>(a));
    }
    results
}

/// What eight lanes give for `x`, `y` and what follows from them, in every operation.
fn in_eight<W: Wide>(x: &Octet, y: &Octet) -> Vec<u64> {
    let (x, y) = (W::load(x), W::load(y));
    let half = W::mul(x, W::splat(1e-3));
    let small = [W::mul(x, W::splat(1e-9)), W::mul(y, W::splat(1e-9))];
    let (sine, cosine) = sin_cos::<W>(y);
    let [re, im] = exp_small::<W>(small);
    let numbers = [
        exp::<W>(half),
        sine,
        cosine,
        re,
        im,
        W::fma(x, y, x),
        W::fnma(x, y, x),
        W::div(x, y),
        W::sqrt(W::abs(x)),
        W::add(W::min(x, y), W::max(x, y)),
        W::sub(W::clamp(x, -2.0, 3.0), y),
        W::select(0b1011_0010, x, y),
    ];
    let mut bits: Vec<u64> = numbers
        .into_iter()
        .flat_map(|register| W::store(register).map(f64::to_bits))
        .collect();
    bits.push(u64::from(W::below(x, y)));
    bits
}

proptest! {
    /// Eight lanes in one register, in two and in plain numbers give the same bits, and
    /// each lane what a number alone would.
    #[test]
    fn eight_lanes_agree_in_every_bit(
        x in proptest::array::uniform8(-1e3..1e3_f64),
        y in proptest::array::uniform8(-1e3..1e3_f64),
    ) {
        let expected = in_eight::<Twice<Plain>>(&x, &y);
        #[cfg(target_arch = "x86_64")]
        if avx2_available() {
            prop_assert_eq!(&expected, &in_eight::<Twice<Avx2>>(&x, &y));
        }
        #[cfg(target_arch = "x86_64")]
        if avx512_available() {
            prop_assert_eq!(&expected, &in_eight::<avx512::Avx512>(&x, &y));
        }
        let (_, rows) = expected.split_last().unwrap();
        for lane in 0..LANES {
            let (sine, cosine) = sin_cos::<Plain>(Plain::splat(y[lane]));
            prop_assert_eq!(rows[LANES + lane], sine[0].to_bits());
            prop_assert_eq!(rows[2 * LANES + lane], cosine[0].to_bits());
            prop_assert_eq!(rows[7 * LANES + lane], (x[lane] / y[lane]).to_bits());
            let chosen = if 0b1011_0010 & (1 << lane) == 0 { y } else { x };
            prop_assert_eq!(rows[11 * LANES + lane], chosen[lane].to_bits());
            prop_assert_eq!(expected[12 * LANES] >> lane & 1, u64::from(x[lane] < y[lane]));
        }
    }

    /// `e^z` of small arguments against the library's, to rounding.
    #[test]
    fn small_exponentials_are_accurate(re in -0.003..0.003_f64, im in -0.003..0.003_f64) {
        let [a, b] = exp_small::<Single>([re, im]);
        prop_assert!((a - re.exp() * im.cos()).abs() < 4e-16, "{a}");
        prop_assert!((b - re.exp() * im.sin()).abs() < 3e-17, "{b}");
    }

    /// A number alone is turned, and its exponential made, as any other.
    #[test]
    fn a_number_alone_has_the_same_functions(x in -700.0..700.0_f64, y in -1e4..1e4_f64) {
        let (sine, cosine) = sin_cos::<Single>(y);
        prop_assert!((sine - y.sin()).abs() < 1e-12 && (cosine - y.cos()).abs() < 1e-12);
        prop_assert!((exp::<Single>(x) / x.exp() - 1.0).abs() < 1e-12);
        prop_assert_eq!(Single::below(x, y), u32::from(x < y));
        prop_assert_eq!(Single::below(f64::NAN, y), 1);
        prop_assert_eq!(Single::map(x, f64::abs), Single::abs(x));
        prop_assert_eq!(Single::clamp(x, -1.0, 2.0), x.clamp(-1.0, 2.0));
    }

    /// Against the standard library's functions, to three units in the last place: one and a
    /// half of ours, one of the library's and the quotient's rounding.
    #[test]
    fn functions_agree_with_the_standard_library(x in -700.0..700.0_f64, y in -1e6..1e6_f64) {
        let close = 3.0 * f64::EPSILON;
        for (e, s, c) in each(x, y) {
            prop_assert!((e / x.exp() - 1.0).abs() < close, "exp {x}: {e}");
            prop_assert!((s - y.sin()).abs() < close, "sin {y}: {s} {}", y.sin());
            prop_assert!((c - y.cos()).abs() < close, "cos {y}: {c} {}", y.cos());
        }
    }

    /// Every path gives the same bits.
    #[test]
    fn paths_agree_in_every_bit(x in -800.0..800.0_f64, y in -1e6..1e6_f64) {
        let bits = |(e, s, c): (f64, f64, f64)| [e, s, c].map(f64::to_bits);
        let all: Vec<[u64; 3]> = each(x, y).into_iter().map(bits).collect();
        prop_assert!(all.iter().all(|bits| *bits == all[0]), "{x} {y}: {all:?}");
        let fused: Vec<[u64; 6]> = each_operation([x, y, x * y, y / (x + 0.1)]);
        prop_assert!(fused.iter().all(|bits| *bits == fused[0]), "{x} {y}: {fused:?}");
    }
}

fn rows<S: Simd>() -> [f64; 4] {
    let a: [Vector; 4] = std::array::from_fn(|i| std::array::from_fn(|j| (10 * i + j * j) as f64));
    sums::<S>(a.map(|a| S::load(&a)))
}

fn moved<S: Simd>() -> (Vector, Vector, Vector, u32) {
    let (a, b) = (
        S::load(&[1.0, 2.0, 3.0, 4.0]),
        S::load(&[5.0, 1.0, f64::NAN, 4.0]),
    );
    (
        S::store(S::min(a, S::splat(2.5))),
        S::store(S::with_first(a, b)),
        S::store(S::shifted_in(b, a)),
        S::below(a, b),
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
    if avx2_available() {
        assert_eq!(moved::<Avx2>(), expected);
    }
}

#[test]
fn sums_of_packs() {
    let expected = [14.0, 54.0, 94.0, 134.0];
    assert_eq!(rows::<Plain>(), expected);
    #[cfg(target_arch = "x86_64")]
    if avx2_available() {
        assert_eq!(rows::<Avx2>(), expected);
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
