//! Four numbers at a time, or eight: the arithmetic of the inner loop, and nothing of it elsewhere.
//!
//! The same source is compiled for any machine ([`Plain`]) and for vector registers with
//! fused multiply-add (`Avx2`; [`dispatch`] picks at run time). Both do the same operations in
//! the same order, each rounded once, and so give the same bits. `NANOTAP_ARITHMETIC=plain` in
//! the environment picks the first: it is how tests run both.
//!
//! One motion has its terms in the lanes of a register ([`Simd`]). Eight motions in a batch have
//! a lane each ([`Wide`]): in one register of eight (`Avx512`, unless `NANOTAP_ARITHMETIC=avx2`), or
//! in two of four ([`Twice`]).
//!
//! [`functions`] has the exponentials, [`layout`] how lists lie in vectors, [`affine`] the
//! change of coordinates at a switch, [`linear`] the same of a whole matrix.

#[cfg(target_arch = "x86_64")]
use std::sync::LazyLock;

/// Operations of which each is one instruction of the processor, `x` being its module.
#[cfg(target_arch = "x86_64")]
macro_rules! instructions {
    ($($operation:ident($($operand:ident),+) = $instruction:ident;)+) => {
        $(
            #[inline(always)]
            fn $operation($($operand: Self::Register),+) -> Self::Register {
                unsafe { x::$instruction($($operand),+) }
            }
        )+
    };
}

pub(crate) mod affine;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod functions;
pub(crate) mod layout;
pub(crate) mod linear;
mod plain;
mod single;
#[cfg(test)]
mod tests;
mod twice;
#[cfg(all(target_family = "wasm", target_feature = "relaxed-simd"))]
mod wasm;

pub(crate) use functions::{
    LARGEST_ANGLE, SMALL_ANGLE, complex_mul, exp, exp_complex, exp_small, sin_cos, sum, sums,
};
pub(crate) use plain::{Library, Plain};
pub(crate) use single::Single;
pub(crate) use twice::Twice;

/// The arithmetic where no other is found at run time.
#[cfg(all(target_family = "wasm", target_feature = "relaxed-simd"))]
type Portable = wasm::Wasm;
#[cfg(not(all(target_family = "wasm", target_feature = "relaxed-simd")))]
type Portable = Plain;

/// `a b + c`, rounded once.
#[inline(always)]
pub(crate) fn fused(a: f64, b: f64, c: f64) -> f64 {
    #[cfg(all(target_family = "wasm", target_feature = "relaxed-simd"))]
    return wasm::fused_numbers(a, b, c);
    #[cfg(not(all(target_family = "wasm", target_feature = "relaxed-simd")))]
    a.mul_add(b, c)
}

/// Numbers in a vector.
pub(crate) const WIDTH: usize = 4;

/// Four numbers in memory.
pub(crate) type Vector = [f64; WIDTH];

/// Four complex numbers in memory: real parts, imaginary parts.
pub(crate) type ComplexVector = [Vector; 2];

/// Motions side by side.
pub(crate) const LANES: usize = 2 * WIDTH;

/// Eight numbers in memory: one of each of eight motions.
pub(crate) type Octet = [f64; LANES];

/// Eight complex numbers in memory: real parts, imaginary parts.
pub(crate) type ComplexOctet = [Octet; 2];

/// An arithmetic of numbers side by side, each in its lane and none knowing of the others.
pub(crate) trait Lanes: Copy {
    /// Whether functions are those of `nanotap-arithmetic`, one lane at a time.
    const LIBRARY: bool = false;
    /// What holds a number in each lane.
    type Register: Copy;

    fn splat(a: f64) -> Self::Register;
    fn add(a: Self::Register, b: Self::Register) -> Self::Register;
    fn sub(a: Self::Register, b: Self::Register) -> Self::Register;
    fn mul(a: Self::Register, b: Self::Register) -> Self::Register;
    fn div(a: Self::Register, b: Self::Register) -> Self::Register;
    /// `a b + c`.
    fn fma(a: Self::Register, b: Self::Register, c: Self::Register) -> Self::Register;
    /// `c − a b`.
    fn fnma(a: Self::Register, b: Self::Register, c: Self::Register) -> Self::Register;
    fn sqrt(a: Self::Register) -> Self::Register;
    fn min(a: Self::Register, b: Self::Register) -> Self::Register;
    fn max(a: Self::Register, b: Self::Register) -> Self::Register;
    /// A bit a lane, set where not `a ≥ b` (so where one is not a number as well).
    fn below(a: Self::Register, b: Self::Register) -> u32;
    /// `2^n` from the sum of [`ROUND`](functions::ROUND) and an integer `n`.
    fn power_of_two(shifted: Self::Register) -> Self::Register;
    /// Sine and cosine of an angle from those of its rest beyond a multiple of π/2; the
    /// multiple is in the low bits of `shifted`.
    fn turn(
        shifted: Self::Register,
        sine: Self::Register,
        cosine: Self::Register,
    ) -> (Self::Register, Self::Register);
    /// `function` of each lane.
    fn map(a: Self::Register, function: fn(f64) -> f64) -> Self::Register;

    /// The lanes, none below `low` or above `high`.
    #[inline(always)]
    fn clamp(a: Self::Register, low: f64, high: f64) -> Self::Register {
        Self::min(Self::max(a, Self::splat(low)), Self::splat(high))
    }

    /// The size of each.
    #[inline(always)]
    fn abs(a: Self::Register) -> Self::Register {
        Self::max(a, Self::sub(Self::splat(0.0), a))
    }
}

/// An arithmetic of four numbers: how they are held and computed with.
pub(crate) trait Simd: Lanes {
    /// Does a piece of work in this arithmetic, compiled on its own and never inlined.
    fn apart<W: Work>(work: W) -> W::Output;

    fn load(a: &Vector) -> Self::Register;
    fn store(a: Self::Register) -> Vector;
    /// `a` with the first lane of `b`.
    fn with_first(a: Self::Register, b: Self::Register) -> Self::Register;
    /// The lanes of `a` moved up by one, `before`'s last one first.
    fn shifted_in(before: Self::Register, a: Self::Register) -> Self::Register;
    /// `a` in the lanes of the lowest bits of `mask`, `b` elsewhere.
    fn select(mask: u32, a: Self::Register, b: Self::Register) -> Self::Register;
    /// The sum of each vector's lanes, side by side.
    fn sums(a: [Self::Register; 4]) -> Self::Register;
}

/// An arithmetic of eight numbers, for eight motions side by side.
pub(crate) trait Wide: Lanes {
    /// What serves one of them alone.
    type One: Simd;

    fn load(a: &Octet) -> Self::Register;
    fn store(a: Self::Register) -> Octet;
    /// `a` in the lanes of `mask`, `b` elsewhere.
    fn select(mask: u32, a: Self::Register, b: Self::Register) -> Self::Register;

    /// Complex numbers, as real and imaginary parts. (Spelt out: what is mapped over an array is
    /// compiled apart, without the instructions of a register.)
    #[inline(always)]
    fn load_complex(z: &ComplexOctet) -> [Self::Register; 2] {
        [Self::load(&z[0]), Self::load(&z[1])]
    }
    #[inline(always)]
    fn store_complex(z: [Self::Register; 2]) -> ComplexOctet {
        [Self::store(z[0]), Self::store(z[1])]
    }
}

/// Work that is compiled once for each arithmetic.
pub(crate) trait Work {
    /// The result.
    type Output;
    /// Does it.
    fn run<S: Simd>(self) -> Self::Output;
}

/// The same for eight motions in a batch.
pub(crate) trait WideWork {
    /// The result.
    type Output;
    /// Does it.
    fn run<W: Wide>(self) -> Self::Output;
}

/// Does the work in the arithmetic that this machine is fastest in.
#[inline(always)]
pub(crate) fn dispatch<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if avx2_available() {
        // SAFETY: the machine has these instructions.
        return unsafe { avx2::run(work) };
    }
    work.run::<Portable>()
}

/// The same for eight motions in a batch.
pub(crate) fn dispatch_wide<W: WideWork>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    match (avx512_available(), avx2_available()) {
        // SAFETY: the machine has these instructions.
        (true, true) => return unsafe { avx512::run(work) },
        // SAFETY: the machine has these instructions.
        (false, true) => return unsafe { avx2::run_wide(work) },
        (_, false) => {}
    }
    work.run::<Twice<Portable>>()
}

/// See [`crate::vector_instructions`].
pub(crate) fn vector_instructions() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    match (avx512_available(), avx2_available()) {
        (true, true) => "AVX-512",
        (false, true) => "AVX2",
        (_, false) => "without AVX2: piecewise-linear cases take several times as long",
    }
    #[cfg(target_family = "wasm")]
    return "WebAssembly";
    #[cfg(not(any(target_arch = "x86_64", target_family = "wasm")))]
    "portable"
}

/// True if `NANOTAP_ARITHMETIC` in the environment is one of these, which exclude instructions.
#[cfg(target_arch = "x86_64")]
fn arithmetic_is(names: &[&str]) -> bool {
    std::env::var("NANOTAP_ARITHMETIC").is_ok_and(|name| names.contains(&name.as_str()))
}

/// True if this machine has fused multiply-add in vectors of four, and it is not excluded.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn avx2_available() -> bool {
    static AVAILABLE: LazyLock<bool> = LazyLock::new(|| {
        !arithmetic_is(&["plain"])
            && std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("fma")
    });
    *AVAILABLE
}

/// True if this machine has vectors of eight, and they are not excluded.
#[cfg(target_arch = "x86_64")]
fn avx512_available() -> bool {
    static AVAILABLE: LazyLock<bool> = LazyLock::new(|| {
        !arithmetic_is(&["plain", "avx2"]) && std::arch::is_x86_feature_detected!("avx512f")
    });
    *AVAILABLE
}
