//! One number alone, for what is written once for one motion and for many side by side.

use super::Lanes;

/// A plain number. Its multiply-add rounds twice, which every machine does without a library.
#[derive(Clone, Copy)]
pub(crate) struct Single;

/// Operations, each an expression of plain numbers.
macro_rules! expressions {
    ($($operation:ident($($operand:ident),+) = $value:expr;)+) => {
        $(
            #[inline(always)]
            fn $operation($($operand: f64),+) -> f64 {
                $value
            }
        )+
    };
}

impl Lanes for Single {
    type Register = f64;

    expressions! {
        splat(a) = a;
        add(a, b) = a + b;
        sub(a, b) = a - b;
        mul(a, b) = a * b;
        div(a, b) = a / b;
        fma(a, b, c) = a * b + c;
        fnma(a, b, c) = c - a * b;
        sqrt(a) = a.sqrt();
        min(a, b) = if a < b { a } else { b };
        max(a, b) = if a > b { a } else { b };
        power_of_two(shifted) =
            f64::from_bits((shifted.to_bits() << 52).wrapping_add(1.0_f64.to_bits()));
    }
    #[inline(always)]
    fn below(a: f64, b: f64) -> u32 {
        let at_least = a >= b;
        u32::from(!at_least)
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
