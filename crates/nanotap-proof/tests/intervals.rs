//! Intervals contain the exact results, and are not wider than necessary.

use nalgebra::Complex;
use nanotap_proof::{Interval, Rectangle};
use proptest::prelude::*;

/// A number to twice double precision: the nearest double and the remainder.
type Long = (f64, f64);

/// Argument; sine, cosine and exponential function of it (none beyond the range). mpmath 1.3, 80
/// digits.
#[allow(clippy::approx_constant)]
const FUNCTIONS: [(f64, Long, Long, Long); 24] = [
    (
        1e-300,
        (1e-300, 0.000e+00),
        (1.0, 0.000e+00),
        (1.0, 0.000e+00),
    ),
    (
        -1e-08,
        (-1e-08, 1.667e-25),
        (1.0, -5.000e-17),
        (0.9999999900000001, -1.077e-17),
    ),
    (
        0.5,
        (0.479425538604203, -5.104e-18),
        (0.8775825618903728, -4.262e-17),
        (1.6487212707001282, -4.732e-17),
    ),
    (
        0.7853981633974483,
        (0.7071067811865475, 4.104e-17),
        (0.7071067811865476, -2.669e-17),
        (2.1932800507380152, 1.484e-16),
    ),
    (
        1.5707963267948966,
        (1.0, -1.875e-33),
        (6.123233995736766e-17, -1.497e-33),
        (4.810477380965351, -1.850e-17),
    ),
    (
        3.141592653589793,
        (1.2246467991473532e-16, -2.995e-33),
        (-1.0, 7.499e-33),
        (23.140692632779267, -6.301e-16),
    ),
    (
        -2.718281828459045,
        (-0.41078129050290885, 1.955e-17),
        (-0.9117339147869651, 4.432e-17),
        (0.06598803584531254, 3.990e-18),
    ),
    (
        22.0,
        (-0.008851309290403876, 2.849e-19),
        (-0.9999608263946371, -8.516e-19),
        (3584912846.131592, -2.352e-07),
    ),
    (
        355.0,
        (-3.014435335948845e-05, 1.301e-21),
        (-0.999999999545659, 1.057e-17),
        (1.4946554004725342e+154, -1.448e+138),
    ),
    (
        -9999.7,
        (0.010583426105890019, 2.254e-19),
        (-0.9999439939775933, -5.037e-17),
        (f64::NAN, 0.0),
    ),
    (
        123456.789,
        (-0.9986640823432246, 4.307e-17),
        (0.05167253271870138, -6.512e-19),
        (f64::NAN, 0.0),
    ),
    (
        628318.5307179586,
        (-6.792130799260439e-11, 1.367e-29),
        (1.0, -2.307e-21),
        (f64::NAN, 0.0),
    ),
    (
        0.34657359027997264,
        (0.3396771251026685, 2.408e-17),
        (0.9405421046832438, 2.977e-17),
        (1.414213562373095, 1.090e-16),
    ),
    (
        -0.34657359027997264,
        (-0.3396771251026685, -2.408e-17),
        (0.9405421046832438, 2.977e-17),
        (0.7071067811865476, -4.014e-17),
    ),
    (
        172.062373,
        (0.6633023022101439, 2.892e-17),
        (-0.7483515590166984, 1.722e-17),
        (5.317887395838259e+74, -4.968e+58),
    ),
    (
        338.501785,
        (-0.7105092184397875, -4.853e-17),
        (0.7036878928275534, -4.731e-17),
        (1.0220151646443253e+147, -8.365e+130),
    ),
    (
        413.270992,
        (-0.9885370453732953, 1.992e-18),
        (0.15097850815475503, 2.360e-19),
        (3.0290842740730345e+179, -7.954e+162),
    ),
    (
        619.430397,
        (-0.5112548401140559, 1.475e-17),
        (-0.8594291643061406, -4.378e-18),
        (1.0356269422160443e+269, 2.400e+252),
    ),
    (
        335.858005,
        (0.2882597395429226, -2.314e-17),
        (-0.9575522557848456, -3.414e-17),
        (7.265713594924404e+145, 4.381e+129),
    ),
    (
        591.254995,
        (0.5936412379132086, -1.717e-17),
        (0.8047298184166368, 4.301e-17),
        (6.008716671348469e+256, 5.050e+240),
    ),
    (
        -659.39268,
        (0.3351620789425993, -1.266e-17),
        (0.9421604857129569, 3.519e-17),
        (4.259882975189111e-287, -8.657e-304),
    ),
    (
        -48.128284,
        (0.8438370475296741, 3.670e-17),
        (-0.5365995128738027, -4.624e-17),
        (1.253579366935843e-21, -5.257e-38),
    ),
    (
        620.699404,
        (-0.9725481128851536, 1.097e-17),
        (0.2327018868069756, -6.269e-18),
        (3.684054767519608e+269, -9.508e+252),
    ),
    (
        208.564374,
        (0.9388444098741127, 1.862e-17),
        (0.34434165308328457, 1.352e-17),
        (3.787535828784682e+90, 1.565e+74),
    ),
];

/// mpmath 1.3, 80 digits.
#[allow(clippy::approx_constant)]
const PI: Long = (3.141592653589793, 1.225e-16);

fn holds(interval: Interval, (near, rest): Long) -> bool {
    let above = interval.lo() < near || interval.lo() == near && rest >= 0.0;
    let below = near < interval.hi() || interval.hi() == near && rest <= 0.0;
    above && below
}

fn width(interval: Interval) -> f64 {
    interval.hi() - interval.lo()
}

#[test]
fn enclosures_of_functions_contain_their_values_and_are_narrow() {
    for (x, sin, cos, exp) in FUNCTIONS {
        let (s, c) = Interval::point(x).sin_cos();
        assert!(holds(s, sin) && holds(c, cos), "sine or cosine of {x}");
        // A few rounding errors of the largest term, 1.
        assert!(width(s) < 4e-15 && width(c) < 4e-15, "{x}: {s:?} {c:?}");
        if !exp.0.is_nan() {
            let e = Interval::point(x).exp();
            assert!(holds(e, exp), "exponential function of {x}");
            assert!(width(e) < 4e-15 * exp.0, "{x}: {e:?}");
        }
    }
    assert!(holds(Interval::pi(), PI) && width(Interval::pi()) < 4e-15);
}

/// The bounds are not computed values with a margin: if they are moved inwards by one place, a
/// value is lost.
#[test]
fn a_bound_moved_inwards_by_its_width_loses_values() {
    let lost = FUNCTIONS.iter().any(|&(x, sin, ..)| {
        let (s, _) = Interval::point(x).sin_cos();
        let middle = Interval::point(s.middle());
        !holds(middle, sin)
    });
    assert!(lost);
    // 1/3 is not a double, so neither of its neighbours alone is an enclosure.
    let third = Interval::ONE / Interval::point(3.0);
    assert!(third.lo() < third.hi());
    assert_eq!(third.lo().next_up().next_up(), third.hi());
}

/// Infinite bounds, zeros and NaN give intervals that make no false statement.
#[test]
fn overflowing_results_have_infinite_bounds() {
    let huge = Interval::point(f64::MAX);
    assert_eq!((huge + huge).hi(), f64::INFINITY);
    assert!((huge + huge).lo() <= f64::MAX);
    assert_eq!(Interval::ONE / Interval::new(-1.0, 1.0), Interval::ENTIRE);
    assert_eq!(Interval::ENTIRE * Interval::ZERO, Interval::ENTIRE);
    assert_eq!(Interval::point(f64::NAN), Interval::ENTIRE);
    assert_eq!(Interval::new(2.0, 1.0), Interval::ENTIRE);
    let (s, c) = Interval::ENTIRE.sin_cos();
    assert!(s.encloses(Interval::new(-1.0, 1.0)) && c.encloses(Interval::new(-1.0, 1.0)));
    assert_eq!(Interval::ENTIRE.exp().hi(), f64::INFINITY);
    assert!(Interval::ENTIRE.exp().lo() <= 0.0);
    let (s, _) = Interval::point(1e300).sin_cos();
    assert!(width(s) >= 2.0);
}

/// A decimal number is read as the nearest double: the exact number lies between its neighbours.
#[test]
fn decimal_numbers_are_enclosed() {
    // 0.1 = 0.1000000000000000055… − 5.55e-18.
    assert!(holds(
        Interval::decimal(0.1),
        (0.1, -5.551_115_123_125_783e-18)
    ));
    assert_eq!(Interval::decimal(0.0), Interval::ZERO);
    assert!(Interval::decimal(20.0).contains(20.0));
}

/// The sum as a rounded sum and its error, exactly (Knuth).
fn two_sum(a: f64, b: f64) -> Long {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// The product and its error, exactly.
fn two_product(a: f64, b: f64) -> Long {
    let product = a * b;
    (product, a.mul_add(b, -product))
}

/// Whether a ≤ b times c, exactly.
fn at_most_product(a: f64, b: f64, c: f64) -> bool {
    let (product, error) = two_product(b, c);
    a < product || a == product && error >= 0.0
}

/// A number whose exponent neither overflows nor underflows in a product.
fn number() -> impl Strategy<Value = f64> {
    (-1.0..1.0_f64, -300..300_i32).prop_map(|(m, e)| m * 2.0_f64.powi(e))
}

/// An interval and one of its numbers.
fn with_number() -> impl Strategy<Value = (Interval, f64)> {
    (number(), 0.0..1.0_f64, 0.0..1.0_f64, -60..2_i32).prop_map(|(x, a, b, e)| {
        let r = x.abs() * 2.0_f64.powi(e);
        (Interval::new(x - a * r, x + b * r), x)
    })
}

proptest! {
    #[test]
    fn sums_and_products_contain_the_exact_ones((a, x) in with_number(), (b, y) in with_number()) {
        prop_assert!(holds(a + b, two_sum(x, y)));
        prop_assert!(holds(a - b, two_sum(x, -y)));
        prop_assert!(holds(a * b, two_product(x, y)));
        prop_assert!(holds(a.square(), two_product(x, x)));
        // Also the sums and products of the bounds.
        prop_assert!(holds(a + b, two_sum(a.lo(), b.lo())) && holds(a + b, two_sum(a.hi(), b.hi())));
        for (p, q) in [(a.lo(), b.lo()), (a.lo(), b.hi()), (a.hi(), b.lo()), (a.hi(), b.hi())] {
            prop_assert!(holds(a * b, two_product(p, q)));
        }
    }

    /// q ≤ x/y if and only if q y ≤ x, for y > 0.
    #[test]
    fn quotients_contain_the_exact_ones(x in number(), y in number()) {
        prop_assume!(y != 0.0);
        let (x, y) = (x * y.signum(), y.abs());
        let quotient = Interval::point(x) / Interval::point(y);
        prop_assert!(at_most_product(-x, -quotient.lo(), y));
        prop_assert!(at_most_product(x, quotient.hi(), y));
        prop_assert_eq!(quotient.lo().next_up().next_up(), quotient.hi());
    }

    #[test]
    fn roots_contain_the_exact_ones(x in number()) {
        let x = x.abs();
        let root = Interval::point(x).sqrt();
        prop_assert!(at_most_product(-x, -root.lo(), root.lo()));
        prop_assert!(at_most_product(x, root.hi(), root.hi()));
    }

    /// Wide intervals: the function of any number in an interval lies in the image (functions of
    /// single numbers are tested above).
    #[test]
    fn functions_of_wide_intervals_contain_those_of_their_numbers(
        x in -40.0..40.0_f64, r in 0.0..3.0_f64, part in -1.0..1.0_f64,
    ) {
        let wide = Interval::new(x - r, x + r);
        let one = Interval::point((x + part * r).clamp(wide.lo(), wide.hi()));
        let ((s, c), (s1, c1)) = (wide.sin_cos(), one.sin_cos());
        prop_assert!(!s.is_disjoint(s1) && !c.is_disjoint(c1));
        prop_assert!(s.lo() <= s1.lo() && s1.hi() <= s.hi() || s.encloses(Interval::point(s1.middle())));
        prop_assert!(wide.exp().encloses(Interval::point(one.exp().middle())));
        let unit = s1.square() + c1.square();
        prop_assert!(unit.contains(1.0));
    }

    /// z/w · w contains z, and |z w| = |z| |w|.
    #[test]
    fn complex_operations_undo_each_other(
        a in -9.0..9.0_f64, b in -9.0..9.0_f64, c in 0.1..9.0_f64, d in -9.0..9.0_f64,
    ) {
        let (z, w) = (Rectangle::point(Complex::new(a, b)), Rectangle::point(Complex::new(c, d)));
        let back = z / w * w;
        prop_assert!(back.re.contains(a) && back.im.contains(b));
        let (left, right) = ((z * w).modulus(), z.modulus() * w.modulus());
        prop_assert!(!left.is_disjoint(right));
        let (turned, there) = ((z + w).exp(), z.exp() * w.exp());
        prop_assert!(!turned.is_disjoint(there));
    }
}
