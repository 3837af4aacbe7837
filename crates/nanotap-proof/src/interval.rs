//! Intervals of real numbers: the result of an operation contains the results for all exact numbers
//! in its operands.
//!
//! IEEE arithmetic rounds to nearest, so the exact result lies between the neighbours of the
//! computed one. After each operation the bounds are moved to these neighbours, unless a zero makes
//! the result exact. The rounding mode is never changed and no platform function is used, so the
//! bounds have the same bits on every machine.

use std::f64::consts::FRAC_2_PI;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A closed interval `[lo, hi]`, `lo ≤ hi`; bounds may be infinite, never NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    lo: f64,
    hi: f64,
}

/// The largest number of quarter turns for which the reduction of an angle is exact.
const MAX_QUARTER_TURNS: f64 = 1_048_576.0;
/// π/2 in parts of 33 bits, whose products with numbers up to [`MAX_QUARTER_TURNS`] are exact, and a
/// remainder (fdlibm, `e_rem_pio2.c`).
const HALF_PI: [f64; 3] = [
    1.5707963267341256,
    6.077100506303966e-11,
    2.0222662487959506e-21,
];
/// ln 2 as a part with 21 zero bits at its end and a remainder (fdlibm, `e_exp.c`).
const LN_2: [f64; 2] = [0.6931471803691238, 1.9082149292705877e-10];
/// Bound of the remainder of the Taylor series below: for the cosine to the 20th power and the sine
/// to the 21st, with arguments up to 0.8, at most 0.8²²/22! = 6.6e-24; for the exponential function
/// to the 18th, with arguments up to 0.36, e^0.36·0.36¹⁹/19! = 4.4e-26.
const REMAINDER_BOUND: f64 = 1e-23;

impl Interval {
    /// The interval that contains 0 only.
    pub const ZERO: Self = Self::point(0.0);
    /// The interval that contains 1 only.
    pub const ONE: Self = Self::point(1.0);
    /// The interval of all real numbers, from −∞ to ∞.
    pub const ENTIRE: Self = Self {
        lo: f64::NEG_INFINITY,
        hi: f64::INFINITY,
    };

    /// The interval of `x` only; all numbers if `x` is NaN.
    pub const fn point(x: f64) -> Self {
        if x.is_nan() {
            Self::ENTIRE
        } else {
            Self { lo: x, hi: x }
        }
    }

    /// The interval `[lo, hi]`; all numbers if that is not an interval.
    pub fn new(lo: f64, hi: f64) -> Self {
        if lo <= hi {
            Self { lo, hi }
        } else {
            Self::ENTIRE
        }
    }

    /// All decimal numbers whose nearest double is `x`: they lie between its neighbours. Zero is
    /// exactly zero.
    pub fn decimal(x: f64) -> Self {
        if x == 0.0 {
            return Self::ZERO;
        }
        Self::new(x.next_down(), x.next_up())
    }

    /// Returns the interval `[−r, r]`; all numbers if `r` is negative or NaN.
    pub fn around_zero(r: f64) -> Self {
        Self::new(-r, r)
    }

    /// Returns an enclosure of `[x − r, x + r]`; all numbers if `r` is negative or NaN.
    pub fn around(x: f64, r: f64) -> Self {
        Self::point(x) + Self::around_zero(r)
    }

    /// Returns the lower bound, −∞ if there is none.
    pub const fn lo(self) -> f64 {
        self.lo
    }

    /// Returns the upper bound, ∞ if there is none.
    pub const fn hi(self) -> f64 {
        self.hi
    }

    /// Returns a double in the interval near its centre.
    pub fn middle(self) -> f64 {
        let middle = 0.5 * self.lo + 0.5 * self.hi;
        if middle.is_finite() {
            middle.clamp(self.lo, self.hi)
        } else {
            0.0_f64.clamp(self.lo, self.hi)
        }
    }

    /// Returns a bound of the distance of all its numbers from [`middle`](Self::middle).
    pub fn radius(self) -> f64 {
        let middle = self.middle();
        (self.hi - middle).max(middle - self.lo).next_up()
    }

    /// Returns the largest absolute value of its numbers.
    pub fn magnitude(self) -> f64 {
        self.lo.abs().max(self.hi.abs())
    }

    /// Returns the smallest absolute value of its numbers, 0 if it contains 0.
    pub fn mignitude(self) -> f64 {
        if self.contains(0.0) {
            0.0
        } else {
            self.lo.abs().min(self.hi.abs())
        }
    }

    /// Whether the interval contains `x`.
    pub fn contains(self, x: f64) -> bool {
        self.lo <= x && x <= self.hi
    }

    /// Whether the interval contains `other`.
    pub fn encloses(self, other: Self) -> bool {
        self.lo <= other.lo && other.hi <= self.hi
    }

    /// Whether all numbers are above zero.
    pub fn is_positive(self) -> bool {
        self.lo > 0.0
    }

    /// Whether both bounds are finite.
    pub fn is_finite(self) -> bool {
        self.lo.is_finite() && self.hi.is_finite()
    }

    /// Whether the intervals have no number in common.
    pub fn is_disjoint(self, other: Self) -> bool {
        self.hi < other.lo || other.hi < self.lo
    }

    /// The smallest interval that contains both.
    #[must_use]
    pub fn hull(self, other: Self) -> Self {
        Self::new(self.lo.min(other.lo), self.hi.max(other.hi))
    }

    /// The intersection; `self` if it is empty, which cannot happen for valid enclosures of one
    /// number.
    #[must_use]
    pub fn intersection(self, other: Self) -> Self {
        let (lo, hi) = (self.lo.max(other.lo), self.hi.min(other.hi));
        if lo <= hi { Self { lo, hi } } else { self }
    }

    /// Returns an enclosure of the squares; its lower bound is never negative.
    #[must_use]
    pub fn square(self) -> Self {
        let (small, large) = (self.mignitude(), self.magnitude());
        let lo = if small == 0.0 {
            0.0
        } else {
            down(small * small).max(0.0)
        };
        let hi = if large == 0.0 { 0.0 } else { up(large * large) };
        Self::new(lo, hi)
    }

    /// Returns an enclosure of the square roots; negative numbers are ignored.
    #[must_use]
    pub fn sqrt(self) -> Self {
        let lo = if self.lo <= 0.0 {
            0.0
        } else {
            down(self.lo.sqrt())
        };
        let hi = if self.hi <= 0.0 {
            0.0
        } else {
            up(self.hi.sqrt())
        };
        Self::new(lo, hi)
    }

    /// Returns an enclosure of π.
    pub fn pi() -> Self {
        quarter_turn() * Self::point(2.0)
    }

    /// Returns an enclosure of the exponential function, e^x.
    #[must_use]
    pub fn exp(self) -> Self {
        Self::new(exp_of(self.lo).lo, exp_of(self.hi).hi)
    }

    /// Returns enclosures of sine and cosine of angles in rad: their values at the centre with the
    /// bound of Taylor's second term, |f(m + d) − f(m) − f′(m) d| ≤ d²/2.
    pub fn sin_cos(self) -> (Self, Self) {
        let all = Self::new(-1.0, 1.0);
        let (sin, cos) = sin_cos_of(self.middle());
        let radius = if self.lo == self.hi {
            0.0
        } else {
            self.radius()
        };
        if !(radius < 2.0) {
            return (all, all);
        }
        let d = Self::around_zero(radius);
        let rest = Self::around_zero((Self::point(radius).square() * Self::point(0.5)).hi);
        (
            (sin + cos * d + rest).intersection(all),
            (cos - sin * d + rest).intersection(all),
        )
    }

    /// Returns enclosures of hyperbolic sine and cosine, in this order.
    pub fn sinh_cosh(self) -> (Self, Self) {
        let (rising, falling) = (self.exp(), (-self).exp());
        let half = Self::point(0.5);
        ((rising - falling) * half, (rising + falling) * half)
    }
}

/// A lower bound of an exact result that rounds to `x`.
fn down(x: f64) -> f64 {
    x.next_down()
}

/// An upper bound of an exact result that rounds to `x`.
fn up(x: f64) -> f64 {
    x.next_up()
}

/// An enclosure of a quarter turn, π/2.
fn quarter_turn() -> Interval {
    Interval::point(HALF_PI[0]) + Interval::point(HALF_PI[1]) + Interval::decimal(HALF_PI[2])
}

/// Sine and cosine of one number: the remainder after whole quarter turns is put into their Taylor
/// series.
fn sin_cos_of(x: f64) -> (Interval, Interval) {
    let all = Interval::new(-1.0, 1.0);
    let quarters = (x * FRAC_2_PI).round();
    if !(quarters.abs() < MAX_QUARTER_TURNS) {
        return (all, all);
    }
    if x == 0.0 {
        return (Interval::ZERO, Interval::ONE);
    }
    let count = Interval::point(quarters);
    let exact = |part: f64| Interval::point(quarters * part);
    let rest = Interval::point(x)
        - exact(HALF_PI[0])
        - exact(HALF_PI[1])
        - count * Interval::decimal(HALF_PI[2]);
    if rest.magnitude() > 0.8 {
        return (all, all);
    }
    let square = rest.square();
    let series = |first: u32| {
        let mut sum = Interval::ONE;
        let mut power = first + 20;
        while power > first {
            let below = f64::from(power * (power - 1));
            sum = Interval::ONE - square * sum / Interval::point(below);
            power -= 2;
        }
        sum
    };
    let left_out = Interval::around_zero(REMAINDER_BOUND);
    let cos = (series(0) + left_out).intersection(all);
    // The sine keeps its relative accuracy: the remainder has the factor x too.
    let sin = (rest * (series(1) + left_out)).intersection(all);
    match quarters.rem_euclid(4.0) as u8 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// The exponential function of one number: x = k ln 2 + r, and the Taylor series of eʳ.
fn exp_of(x: f64) -> Interval {
    /// Largest argument whose exponential is computed; beyond it only bounds are given.
    const MAX_ARGUMENT: f64 = 700.0;
    if x == 0.0 {
        return Interval::ONE;
    }
    if x > MAX_ARGUMENT {
        return Interval::new(exp_of(MAX_ARGUMENT).lo, f64::INFINITY);
    }
    if x < -MAX_ARGUMENT {
        return Interval::new(0.0, exp_of(-MAX_ARGUMENT).hi);
    }
    let twos = (x * std::f64::consts::LOG2_E).round();
    let rest = Interval::point(x)
        - Interval::point(twos * LN_2[0])
        - Interval::point(twos) * Interval::decimal(LN_2[1]);
    if rest.magnitude() > 0.36 {
        return Interval::new(0.0, f64::INFINITY);
    }
    let mut sum = Interval::ONE;
    for power in (1..=18).rev() {
        sum = Interval::ONE + rest * sum / Interval::point(f64::from(power));
    }
    let value = sum + Interval::around_zero(REMAINDER_BOUND);
    // 2^k has its exponent's bits; |k| ≤ 1010 keeps it normal.
    let power = f64::from_bits(((twos as i64 + 1023) as u64) << 52);
    value * Interval::point(power)
}

impl From<f64> for Interval {
    fn from(x: f64) -> Self {
        Self::point(x)
    }
}

impl Add for Interval {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let bound = |a: f64, b: f64, outward: fn(f64) -> f64| {
            if a == 0.0 {
                b
            } else if b == 0.0 {
                a
            } else {
                outward(a + b)
            }
        };
        Self::new(bound(self.lo, other.lo, down), bound(self.hi, other.hi, up))
    }
}

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            lo: -self.hi,
            hi: -self.lo,
        }
    }
}

impl Sub for Interval {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

/// Bounds of products or quotients from all four pairs of bounds.
fn hull_of(all: [f64; 4]) -> Interval {
    if all.iter().any(|x| x.is_nan()) {
        return Interval::ENTIRE;
    }
    let [a, b, c, d] = all;
    let (lo, hi) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
    Interval::new(down(lo), up(hi))
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let zero = |x: Self| x.lo == 0.0 && x.hi == 0.0;
        if (zero(self) && other.is_finite()) || (zero(other) && self.is_finite()) {
            return Self::ZERO;
        }
        hull_of([
            self.lo * other.lo,
            self.lo * other.hi,
            self.hi * other.lo,
            self.hi * other.hi,
        ])
    }
}

impl Div for Interval {
    type Output = Self;
    /// The quotient; all numbers if the divisor may be zero.
    fn div(self, other: Self) -> Self {
        if other.contains(0.0) {
            return Self::ENTIRE;
        }
        if self.lo == 0.0 && self.hi == 0.0 && other.is_finite() {
            return Self::ZERO;
        }
        hull_of([
            self.lo / other.lo,
            self.lo / other.hi,
            self.hi / other.lo,
            self.hi / other.hi,
        ])
    }
}

impl AddAssign for Interval {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Interval {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl std::iter::Sum for Interval {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::ZERO, |sum, x| sum + x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fractional digits of π, and digits of ln 2, in hexadecimal, 32 bits each (π as in the tables
    /// of the cipher Blowfish; both are Machin-like sums to 400 bits).
    const PI: [u32; 6] = [
        0x243f_6a88,
        0x85a3_08d3,
        0x1319_8a2e,
        0x0370_7344,
        0xa409_3822,
        0x299f_31d0,
    ];
    const LOGARITHM: [u32; 6] = [
        0xb172_17f7,
        0xd1cf_79ab,
        0xc9e3_b398,
        0x03f2_f6af,
        0x40f3_4326,
        0x7298_b62d,
    ];

    /// The number with the binary digits from `from` up to `to`, the first of which has the value
    /// 2^`top`, rounded to nearest once.
    fn part(digits: &[bool], from: usize, to: usize, top: i32) -> f64 {
        let bits = digits[from..to]
            .iter()
            .fold(0_u128, |n, &bit| 2 * n + u128::from(bit));
        bits as f64 * 2.0_f64.powi(top + 1 - to as i32)
    }

    fn digits(words: &[u32]) -> impl Iterator<Item = bool> {
        words
            .iter()
            .flat_map(|word| (0..32).rev().map(move |k| word >> k & 1 == 1))
    }

    /// Two parts of π/2 have 33 of its binary digits each, the third is the rounded remainder; the
    /// first part of ln 2 has its first 32, the second is the rounded remainder.
    #[test]
    fn the_parts_of_a_quarter_turn_and_of_the_logarithm_of_two_are_their_digits() {
        // 3 = 11 in binary, and π/2 begins with 1.
        let quarter: Vec<bool> = [true, true].into_iter().chain(digits(&PI)).collect();
        assert_eq!(HALF_PI[0], part(&quarter, 0, 33, 0));
        assert_eq!(HALF_PI[1], part(&quarter, 33, 66, 0));
        assert_eq!(HALF_PI[2], part(&quarter, 66, 190, 0));
        let two: Vec<bool> = digits(&LOGARITHM).collect();
        assert_eq!(LN_2[0], part(&two, 0, 32, -1));
        assert_eq!(LN_2[1], part(&two, 32, 160, -1));
    }
}
