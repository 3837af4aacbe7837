//! Four numbers in an array, on any machine.

use super::{Lanes, Simd, Vector, WIDTH, Work};

/// Arithmetic in arrays of four numbers, with fused multiply-add; it runs on any machine.
#[derive(Clone, Copy)]
pub(crate) struct Plain;

/// Arithmetic in arrays with library functions that reduce any angle, for angles beyond
/// [`LARGEST_ANGLE`](super::LARGEST_ANGLE). It is the same on every machine and needs no fused
/// multiply-add.
#[derive(Clone, Copy)]
pub(crate) struct Library;

/// Operations, each an expression of the numbers of one lane.
macro_rules! lane_by_lane {
    ($($operation:ident($($operand:ident),+) = $value:expr;)+) => {
        $(
            #[inline(always)]
            fn $operation($($operand: Vector),+) -> Vector {
                std::array::from_fn(|i| {
                    $(let $operand = $operand[i];)+
                    $value
                })
            }
        )+
    };
}

/// The arithmetic of arrays, shared by [`Plain`] and [`Library`], with its `a b + c`.
macro_rules! arrays {
    ($fma:expr) => {
        type Register = Vector;

        lane_by_lane! {
            add(a, b) = a + b;
            sub(a, b) = a - b;
            mul(a, b) = a * b;
            div(a, b) = a / b;
            fma(a, b, c) = $fma(a, b, c);
            fnma(a, b, c) = $fma(-a, b, c);
            sqrt(a) = a.sqrt();
            min(a, b) = if a < b { a } else { b };
            max(a, b) = if a > b { a } else { b };
            power_of_two(shifted) =
                f64::from_bits((shifted.to_bits() << 52).wrapping_add(1.0_f64.to_bits()));
        }
        #[inline(always)]
        fn splat(a: f64) -> Vector {
            [a; WIDTH]
        }
        #[inline(always)]
        fn map(a: Vector, function: fn(f64) -> f64) -> Vector {
            a.map(function)
        }
        #[inline(always)]
        fn below(a: Vector, b: Vector) -> u32 {
            let at_least = |i: usize| a[i] >= b[i];
            (0..WIDTH).fold(0, |bits, i| bits | (u32::from(!at_least(i)) << i))
        }
        #[inline(always)]
        fn turn(shifted: Vector, sine: Vector, cosine: Vector) -> (Vector, Vector) {
            let turned = |i: usize, quarter: u64, even: Vector, odd: Vector| {
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

/// Operations that only registers of four numbers have.
macro_rules! four {
    () => {
        #[inline(always)]
        fn apart<W: Work>(work: W) -> W::Output {
            run_apart::<Self, W>(work)
        }
        #[inline(always)]
        fn load(a: &Vector) -> Vector {
            *a
        }
        #[inline(always)]
        fn store(a: Vector) -> Vector {
            a
        }
        #[inline(always)]
        fn sums(a: [Vector; 4]) -> Vector {
            a.map(|a| (a[0] + a[1]) + (a[2] + a[3]))
        }
        #[inline(always)]
        fn select(mask: u32, a: Vector, b: Vector) -> Vector {
            std::array::from_fn(|i| if mask & (1 << i) == 0 { b[i] } else { a[i] })
        }
        #[inline(always)]
        fn with_first(a: Vector, b: Vector) -> Vector {
            [b[0], a[1], a[2], a[3]]
        }
        #[inline(always)]
        fn shifted_in(before: Vector, a: Vector) -> Vector {
            [before[3], a[0], a[1], a[2]]
        }
    };
}

#[inline(never)]
fn run_apart<S: Simd, W: Work>(work: W) -> W::Output {
    work.run::<S>()
}

impl Lanes for Plain {
    // Rounded once, as vector registers do it: by the processor, or in software.
    arrays!(super::fused);
}

impl Simd for Plain {
    four!();
}

impl Lanes for Library {
    const LIBRARY: bool = true;
    arrays!(|a: f64, b: f64, c: f64| a * b + c);
}

impl Simd for Library {
    four!();
}
