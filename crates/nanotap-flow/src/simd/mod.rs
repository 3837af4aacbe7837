//! Four numbers at a time: the arithmetic of the inner loop, and nothing of it elsewhere.
//!
//! The same source is compiled for any machine ([`Plain`]) and for vector registers with
//! fused multiply-add (`Avx2`; [`dispatch`] picks at run time). Both do the same operations in
//! the same order, each rounded once, and so give the same bits. `NANOTAP_ARITHMETIC=plain` in
//! the environment picks the first: it is how tests run both.
//!
//! [`functions`] has the exponentials, [`layout`] how lists lie in vectors, [`affine`] the
//! change of coordinates at a switch, [`linear`] the same of a whole matrix.

#[cfg(target_arch = "x86_64")]
use std::sync::LazyLock;

pub(crate) mod affine;
#[cfg(target_arch = "x86_64")]
mod avx2;
mod functions;
pub(crate) mod layout;
pub(crate) mod linear;
mod plain;
#[cfg(test)]
mod tests;

pub(crate) use functions::{
    LARGEST_ANGLE, SMALL_ANGLE, complex_mul, exp, exp_complex, exp_small, sin_cos, sum, sums,
};
pub(crate) use plain::{Library, Plain};

/// Numbers in a vector.
pub(crate) const WIDTH: usize = 4;

/// Four numbers in memory.
pub(crate) type Vector = [f64; WIDTH];

/// Four complex numbers in memory: real parts, imaginary parts.
pub(crate) type ComplexVector = [Vector; 2];

/// An arithmetic of four numbers: how they are held and computed with.
pub(crate) trait Simd: Copy {
    /// Whether functions are those of `nanotap-arithmetic`, one lane at a time.
    const LIBRARY: bool = false;
    /// What holds four numbers.
    type Register: Copy;

    /// Does a piece of work in this arithmetic, compiled on its own and never inlined.
    fn apart<W: Work>(work: W) -> W::Output;

    fn load(a: &Vector) -> Self::Register;
    fn store(a: Self::Register) -> Vector;
    fn splat(a: f64) -> Self::Register;
    fn add(a: Self::Register, b: Self::Register) -> Self::Register;
    fn sub(a: Self::Register, b: Self::Register) -> Self::Register;
    fn mul(a: Self::Register, b: Self::Register) -> Self::Register;
    /// `a b + c`.
    fn fma(a: Self::Register, b: Self::Register, c: Self::Register) -> Self::Register;
    /// `c − a b`.
    fn fnma(a: Self::Register, b: Self::Register, c: Self::Register) -> Self::Register;
    fn sqrt(a: Self::Register) -> Self::Register;
    fn min(a: Self::Register, b: Self::Register) -> Self::Register;
    fn max(a: Self::Register, b: Self::Register) -> Self::Register;
    /// A bit a lane, set where not `a ≥ b` (so where one is not a number as well).
    fn below(a: Self::Register, b: Self::Register) -> u32;
    /// `a` with the first lane of `b`.
    fn with_first(a: Self::Register, b: Self::Register) -> Self::Register;
    /// The lanes of `a` moved up by one, `before`'s last one first.
    fn shifted_in(before: Self::Register, a: Self::Register) -> Self::Register;
    /// The lanes, none below `low` or above `high`.
    fn clamp(a: Self::Register, low: f64, high: f64) -> Self::Register;
    /// `2^n` from the sum of [`ROUND`](functions::ROUND) and an integer `n`.
    fn power_of_two(shifted: Self::Register) -> Self::Register;
    /// The sum of each vector's lanes, side by side.
    fn sums(a: [Self::Register; 4]) -> Self::Register;
    /// Sine and cosine of an angle from those of its rest beyond a multiple of π/2; the
    /// multiple is in the low bits of `shifted`.
    fn turn(
        shifted: Self::Register,
        sine: Self::Register,
        cosine: Self::Register,
    ) -> (Self::Register, Self::Register);
}

/// Work that is compiled once for each arithmetic.
pub(crate) trait Work {
    /// What comes of it.
    type Output;
    /// Does it.
    fn run<S: Simd>(self) -> Self::Output;
}

/// Does the work in the arithmetic that this machine is fastest in.
#[inline(always)]
pub(crate) fn dispatch<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if avx2_available() {
        // SAFETY: the machine has these instructions.
        return unsafe { avx2::run(work) };
    }
    work.run::<Plain>()
}

/// Whether this machine has fused multiply-add in vectors of four, and nobody asked for the plain
/// path.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn avx2_available() -> bool {
    static WANTED: LazyLock<bool> = LazyLock::new(|| {
        let plain = std::env::var_os("NANOTAP_ARITHMETIC").is_some_and(|path| path == "plain");
        !plain
            && std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("fma")
    });
    *WANTED
}
