use proptest::prelude::*;

use super::units::DEGREE;
use super::*;

#[test]
fn reads_what_stands_on_boxes_and_labels() {
    // Right-hand sides are the nearest doubles to the decimal value: compared bit by bit.
    let cases = [
        ("2.8 N/m", Kind::Stiffness, 2.8),
        ("2.8N/m", Kind::Stiffness, 2.8),
        ("2.8 nN/nm", Kind::Stiffness, 2.8),
        ("75 kHz", Kind::Frequency, 75e3),
        ("75e3 s^-1", Kind::Frequency, 75e3),
        ("75e3 1/s", Kind::Frequency, 75e3),
        ("75e3 /s", Kind::Frequency, 75e3),
        ("30 um", Kind::Length, 30e-6),
        ("30 \u{b5}m", Kind::Length, 30e-6),
        ("30 \u{3bc}m", Kind::Length, 30e-6),
        ("30 micron", Kind::Length, 30e-6),
        ("3.35 Å", Kind::Length, 3.35e-10),
        ("4 GPa", Kind::Pressure, 4e9),
        ("4 nN/nm^2", Kind::Pressure, 4e9),
        ("4 mPa", Kind::Pressure, 4e-3),
        ("4 MPa", Kind::Pressure, 4e6),
        ("8 nm", Kind::Length, 8e-9),
        ("\u{2212}8 nm", Kind::Length, -8e-9),
        ("3 ng", Kind::Mass, 3e-12),
        ("1e-3 N s/m", Kind::Damping, 1e-3),
        ("1e-3 N·s·m^-1", Kind::Damping, 1e-3),
        ("1e-3 kg/s", Kind::Damping, 1e-3),
        ("1e-3 N/(m/s)", Kind::Damping, 1e-3),
        ("2330 kg/m^3", Kind::Density, 2330.0),
        ("2330 kg/m³", Kind::Density, 2330.0),
        ("2330 kg m⁻³", Kind::Density, 2330.0),
        ("2330 kg/m3", Kind::Density, 2330.0),
        ("2330 kg m-3", Kind::Density, 2330.0),
        ("2.33 g/cm^3", Kind::Density, 2330.0),
        ("200", Kind::Number, 200.0),
        (" .5 ", Kind::Number, 0.5),
        ("80 %", Kind::Number, 0.8),
        ("3 eV", Kind::Energy, 3.0 * JOULES_PER_ELECTRONVOLT),
        ("3eV", Kind::Energy, 3.0 * JOULES_PER_ELECTRONVOLT),
        ("180 deg", Kind::Angle, 180.0 * DEGREE),
        ("0", Kind::Length, 0.0),
        ("3e-8", Kind::Length, 3e-8),
        ("75e3", Kind::Frequency, 75e3),
        ("0 nm", Kind::Length, 0.0),
    ];
    for (text, kind, expected) in cases {
        assert_eq!(kind.parse(text), Ok(expected), "{text}");
    }
}

#[test]
fn says_what_was_expected_and_what_was_given() {
    let message = |kind: Kind, text: &str| kind.parse(text).unwrap_err().to_string();
    assert_eq!(
        message(Kind::Stiffness, "75 kHz"),
        "expected a force per length such as \"2.8 N/m\", got \"75 kHz\" (a frequency)"
    );
    assert_eq!(
        message(Kind::Length, "30 %"),
        "expected a length such as \"30 um\", got \"30 %\" (a number without a unit)"
    );
    assert_eq!(
        message(Kind::Frequency, "4.7e5 rad/s"),
        "expected a frequency such as \"75 kHz\", got \"4.7e5 rad/s\" (an angular frequency)"
    );
    assert_eq!(
        message(Kind::Number, "3 m^2"),
        "expected a number without a unit such as \"200\", got \"3 m^2\" (m^2)"
    );
}

#[test]
fn offers_the_nearest_unit_and_never_guesses_a_prefix() {
    let nearest = |kind: Kind, text: &str| match kind.parse(text) {
        Err(QuantityError { nearest, .. }) => nearest,
        other => panic!("{text}: {other:?}"),
    };
    assert_eq!(nearest(Kind::Frequency, "75 Khz"), ["kHz"]);
    assert_eq!(nearest(Kind::Pressure, "4 gpa"), ["GPa"]);
    // Nine orders apart: both are offered.
    assert_eq!(nearest(Kind::Pressure, "4 mpa"), ["mPa", "MPa"]);
    assert_eq!(nearest(Kind::Force, "5 pn"), ["pN", "PN"]);
    assert!(nearest(Kind::Length, "3 nmm").contains(&"nm".to_owned()));
    assert!(nearest(Kind::Mass, "3 parsec").is_empty());
}

#[test]
fn refuses_what_has_no_single_meaning() {
    for text in [
        "",
        " ",
        "nm",
        "NaN",
        "inf m",
        "-inf",
        "1,5 nm",
        "1_000 nm",
        "1.2.3 nm",
        "3 J/m s",
        "3 m^",
        "3 m^^2",
        "3 m^10",
        "3 m^99999999999",
        "3 (m",
        "3 m)",
        "3 ()",
        "3 m/",
        "3 /",
        "3 m 4",
        "3 4 m",
        "3 * m",
        "1e999 m",
        "1e-999 m",
        "1e308 Gm",
        "3 m^1.5",
        "3 $",
        "e3 m",
        "3 ((((((((m))))))))",
    ] {
        assert!(text.parse::<Quantity>().is_err(), "{text}");
    }
    let many = format!("3 {}", "m ".repeat(1000));
    assert!(many.parse::<Quantity>().is_err());
}

#[test]
fn writes_with_engineering_prefixes() {
    let cases = [
        (Kind::Frequency, 65_697.0, "65.7 kHz"),
        (Kind::Force, 4.2e-9, "4.2 nN"),
        (Kind::Length, 30e-6, "30 µm"),
        (Kind::Length, 999.96e-9, "1 µm"),
        (Kind::Length, -8e-9, "-8 nm"),
        (Kind::Mass, 4.4e-12, "4.4 ng"),
        (Kind::Mass, 1.0, "1 kg"),
        (Kind::Stiffness, 0.2, "200 mN/m"),
        (Kind::Pressure, 4e9, "4 GPa"),
        (Kind::Density, 2330.0, "2330 kg/m^3"),
        (Kind::Damping, 1e-6, "1 µN s/m"),
        (Kind::Number, 0.000_047, "4.7e-5"),
        (Kind::Number, 200.0, "200"),
        (Kind::Length, 0.0, "0 m"),
        (Kind::Force, 1e-30, "1e-30 N"),
        (Kind::Angle, 25.0 * DEGREE, "25 deg"),
    ];
    for (kind, value, expected) in cases {
        assert_eq!(kind.format(value), expected);
    }
    assert_eq!(
        format_electronvolts(12.3 * JOULES_PER_ELECTRONVOLT),
        "12.3 eV"
    );
}

fn any_kind() -> impl Strategy<Value = Kind> {
    prop::sample::select(Kind::ALL.to_vec())
}

proptest! {
    #[test]
    fn exact_text_gives_back_the_same_bits(kind in any_kind(), value in prop::num::f64::NORMAL) {
        // Away from overflow of the prefix arithmetic's ends.
        prop_assume!(value.abs() > 1e-290 && value.abs() < 1e290);
        prop_assert_eq!(kind.parse(&kind.format_exact(value)), Ok(value));
    }

    #[test]
    fn shown_text_is_right_to_four_digits(kind in any_kind(), value in 1e-28_f64..1e20) {
        let read = kind.parse(&kind.format(value)).unwrap();
        prop_assert!((read / value - 1.0).abs() <= 5.1e-4, "{} {}", value, kind.format(value));
    }

    #[test]
    fn no_text_makes_it_panic(text in "\\PC{0,40}", kind in any_kind()) {
        let _ = kind.parse(&text);
    }

    #[test]
    fn no_unit_like_text_makes_it_panic(text in "-?[0-9.e+-]{0,6} ?[a-zA-Zµ°%^/()·*0-9⁻² -]{0,20}") {
        let _ = text.parse::<Quantity>();
    }
}
