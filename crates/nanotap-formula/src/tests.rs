//! The language against closed forms and finite differences, and what it refuses.

use nanotap_quantity::{Dimension, Kind};

use crate::{End, Formula, LANES, Lanes, Pieces, Smoothness};

/// The pieces of a formula with contact below 0, and values in the order of its parameters.
fn pieces(text: &str, values: &[f64]) -> Pieces {
    Formula::parse(text)
        .unwrap()
        .pieces(values, 0.0, false)
        .unwrap()
}

fn value(text: &str, values: &[f64], gap: f64, rate: f64) -> f64 {
    let pieces = pieces(text, values);
    pieces.force(pieces.at(gap, rate), gap, rate).value
}

fn refusal(text: &str) -> String {
    let refused = Formula::parse(text);
    let refused = refused
        .and_then(|formula| formula.pieces(&vec![0.5; formula.parameters().len()], 0.0, false));
    refused.unwrap_err().to_string()
}

#[test]
fn arithmetic_follows_the_usual_rules() {
    for (text, expected) in [
        ("1 + 2*3", 7.0),
        ("2^3^2", 512.0),
        ("-2^2", -4.0),
        ("2^-1", 0.5),
        ("8/4/2", 1.0),
        ("4/3*6", 8.0),
        ("1.5e3 - .5e3", 1000.0),
        ("x = 3; y = x^2; x + y", 12.0),
        ("if 1 > 2 then 3 else if 2 > 1 then 4 else 5", 4.0),
        ("if not (1 > 2) and (3 < 4 or 5 < 4) then 6 else 7", 6.0),
        ("if (1 + 1)*2 > 3 then 8 else 9", 8.0),
        (
            "max(1, 4, 2) + min(3, 2, 5) + abs(-7) + step(2) + step(-2)",
            14.0,
        ),
        ("sqrt(9) + cbrt(8) + exp(0) + ln(1) + 2**3", 14.0),
        ("9^1.5 + 4^-0.5 + 2^0.3/2^0.3", 28.5),
        (
            "sin(pi/2) + cos(0) + tan(0) + atan(0) + sinh(0) + cosh(0) + tanh(0)",
            3.0,
        ),
        ("2 − 3 · 4", -10.0),
    ] {
        assert!(
            (value(text, &[], 1.0, 0.0) - expected).abs() < 1e-14,
            "{text}"
        );
    }
}

#[test]
fn derivatives_are_those_of_differences() {
    let text = "delta = max(a - d, 0); k*delta^1.5*exp(-d/a) - c*tanh(v/w)*sqrt(delta)*cosh(d/a) \
                + h*atan(d/a)*abs(v/w)^n/(1 + (d/a)^2)";
    let formula = Formula::parse(text).unwrap();
    assert_eq!(formula.parameters(), ["a", "k", "c", "w", "h", "n"]);
    let values = [0.7, 2.0, 0.3, 1.3, 0.4, 1.7];
    let pieces = formula.pieces(&values, 0.0, false).unwrap();
    let step = 1e-6;
    for (gap, rate) in [(0.3, -0.8), (0.31, 0.9), (1.1, -0.2), (-0.4, 0.5)] {
        let piece = pieces.at(gap, rate);
        let at = |gap, rate| pieces.value(piece, gap, rate);
        let force = pieces.force(piece, gap, rate);
        assert!((force.value - at(gap, rate)).abs() < 1e-15);
        let by_gap = (at(gap + step, rate) - at(gap - step, rate)) / (2.0 * step);
        let by_rate = (at(gap, rate + step) - at(gap, rate - step)) / (2.0 * step);
        assert!((force.slopes[0] - by_gap).abs() < 1e-8, "{gap} {rate}");
        assert!((force.slopes[1] - by_rate).abs() < 1e-8, "{gap} {rate}");
        pieces.forces(piece, &[gap; LANES], &[rate; LANES], |_, all: &Lanes<2>| {
            assert_eq!(all.values, [force.value; LANES]);
            assert_eq!(all.slopes, force.slopes.map(|slope| [slope; LANES]));
        });
        pieces.forces(piece, &[gap; 3], &[rate; 3], |_, all: &Lanes<1>| {
            assert_eq!(all.slopes[0], [force.slopes[0]; LANES]);
        });
        for k in 0..values.len() {
            let moved = |step: f64| {
                let mut values = values;
                values[k] += step;
                formula
                    .pieces(&values, 0.0, false)
                    .unwrap()
                    .value(piece, gap, rate)
            };
            let difference = (moved(step) - moved(-step)) / (2.0 * step);
            assert!(
                (pieces.by_parameter(piece, k, gap, rate) - difference).abs() < 1e-8,
                "{gap} {rate} {k}"
            );
        }
    }
}

#[test]
fn choices_become_pieces_with_their_ends() {
    let dmt = pieces("k*max(a - d, 0)^1.5 - h/max(d, a)^2", &[2.0, 0.5, 0.1]);
    assert_eq!(dmt.levels(), [0.0, 0.5]);
    // Outside, between contact of the case and that of the formula, and below.
    assert_eq!(dmt.len(), 3);
    assert_eq!(dmt.exits(0)[0].end, End::Falls(1));
    assert_eq!(dmt.ends(1)[1], Smoothness::FiniteSlope);
    assert_eq!(dmt.ends(0), [Smoothness::Analytic; 2]);
    assert_eq!(dmt.pole(), None);
    // The level moves with its parameter.
    assert_eq!(dmt.end_by_parameter(End::Falls(1), 1, 0.0, 0.0), Some(-1.0));
    let damped = pieces("-c*sqrt(max(-d, 0))*v", &[1.0]);
    assert_eq!(damped.ends(1)[1], Smoothness::InfiniteSlope);
    assert!(damped.vanishes(0) && !damped.vanishes(1) && damped.touches(1));
    // Roots multiply to a power above 1: the slope stays finite.
    let twice = pieces("x = max(-d, 0); k*x*sqrt(x)", &[1.0]);
    assert_eq!(twice.ends(1)[1], Smoothness::FiniteSlope);
    assert_eq!(
        pieces("k*max(-d, 0)^2", &[1.0]).ends(1)[1],
        Smoothness::Analytic
    );
    // One condition is one end, whichever way round it is written.
    assert_eq!(pieces("max(-d, 0) + min(d, 0) + abs(d)", &[]).len(), 2);
}

/// A contact that cannot pull, as of a Kelvin–Voigt solid: the force itself ends a piece.
#[test]
fn a_condition_on_the_force_is_a_guard() {
    let text = "x = max(-d, 0); max(k*x^1.5 - c*sqrt(x)*v, 0)";
    let pieces = pieces(text, &[1.0, 1.0]);
    assert_eq!(pieces.len(), 3);
    let pressed = pieces.at(-0.5, -1.0);
    let released = pieces.at(-0.5, 4.0);
    assert_ne!(pressed, released);
    assert!(pieces.vanishes(released));
    let exits = pieces.exits(pressed);
    let guard = exits
        .iter()
        .find(|exit| matches!(exit.end, End::Guard(_)))
        .unwrap();
    assert_eq!(guard.target, released);
    let End::Guard(number) = guard.end else {
        unreachable!()
    };
    assert!((pieces.guard(number, -0.5, 0.5).value).abs() < 1e-15);
    // Contact begins with a push.
    let free = pieces.at(1.0, -1.0);
    assert_eq!(pieces.exits(free)[0].target, pressed);
}

#[test]
fn a_turn_is_remembered_until_contact_ends() {
    let pieces = pieces("if turned then -b else -a", &[1.0, 2.0]);
    let (free, falls, rises) = (
        pieces.at(1.0, -1.0),
        pieces.at(-1.0, -1.0),
        pieces.at(-1.0, 1.0),
    );
    let force = |piece| pieces.value(piece, -0.5, 0.0);
    assert_eq!(
        [force(free), force(falls), force(rises)],
        [-2.0, -2.0, -1.0]
    );
    let target = |piece: usize, end: End| {
        pieces
            .exits(piece)
            .iter()
            .find(|exit| exit.end == end)
            .map(|exit| exit.target)
    };
    assert_eq!(target(free, End::Falls(0)), Some(falls));
    assert_eq!(target(falls, End::Turns), Some(rises));
    assert_eq!(target(rises, End::Rises(0)), Some(free));
    assert_eq!(target(rises, End::Turns), None);
}

#[test]
fn poles_repel_or_are_refused() {
    assert_eq!(pieces("h/d^3 - g/d^2", &[1.0, 1.0]).pole(), Some(0.0));
    assert_eq!(pieces("h/(d - s)^3", &[1.0, 0.25]).pole(), Some(0.25));
    let between = pieces("h/(d^2 - s^2)", &[1.0, 0.25]).pole().unwrap();
    assert!((between - 0.25).abs() < 1e-12);
    // Contact keeps the tip away from it.
    assert_eq!(
        pieces("if d > a then -h/d^2 else -h/a^2", &[0.5, 1.0]).pole(),
        None
    );
    let refused = refusal("-h/d^2");
    assert!(
        refused.contains("\"d\" becomes zero") || refused.contains("attracts"),
        "{refused}"
    );
}

#[test]
fn dimensions_are_checked_part_by_part() {
    let length = Kind::Length.dimension();
    let of = |name: &str| match name {
        "E" => Kind::Pressure.dimension(),
        "R" | "a0" => length,
        "H" => Kind::Energy.dimension(),
        "eta" => Kind::Viscosity.dimension(),
        _ => Dimension::NONE,
    };
    let checked = |text: &str| {
        let formula = Formula::parse(text).unwrap();
        let dimensions: Vec<_> = formula.parameters().iter().map(|name| of(name)).collect();
        formula
            .check(&dimensions, Kind::Force.dimension())
            .map_err(|error| error.to_string())
    };
    let right = "4/3*E*sqrt(R)*max(-d,0)^1.5 - H*R/(6*max(d,a0)^2) - eta*sqrt(R)*max(-d,0)^0.5*v";
    assert_eq!(checked(right), Ok(()));
    for (text, column, words) in [
        ("H*R/d", 1, "an energy, where a force is needed"),
        (
            "E*R^2 + H",
            1,
            "\"E*R^2\" is a force, \"H\" is an energy: they cannot be added",
        ),
        (
            "E*R^2*exp(d)",
            7,
            "\"d\" is a length, where this function takes a number",
        ),
        ("E*R^2*d^H", 7, "the exponent \"H\" is an energy"),
        (
            "E*R^2*(d/R)^n*d^n",
            15,
            "\"d\" is a length: to an exponent that may vary",
        ),
        (
            "if d > H then E*R^2 else 0",
            4,
            "cannot be added or compared",
        ),
        (
            "E*sqrt(R)",
            1,
            "it is kg^1 m^-0.5 s^-2, where a force is needed",
        ),
    ] {
        let refused = checked(text).unwrap_err();
        assert!(
            refused.starts_with(&format!("at character {column}")),
            "{refused}"
        );
        assert!(refused.contains(words), "{refused}");
    }
}

#[test]
fn mistakes_are_pointed_at() {
    for (text, column, words) in [
        ("", 1, "missing at the end"),
        ("k*(d", 5, "`)` is missing"),
        ("2 k", 3, "an operator such as `*` is missing"),
        ("k d", 3, "an operator"),
        ("if d < 2 then 1 nN else 0", 17, "a number has no unit"),
        ("k*", 3, "missing at the end"),
        ("k*/d", 3, "needed before `/`"),
        ("d > 1", 3, "a comparison belongs between"),
        ("k = d", 6, "a definition ends with `;`"),
        ("d = 2; d", 1, "meaning of its own"),
        ("x = x + 1; x", 1, "has a value already"),
        ("x = 1; x = 2; x", 8, "has a value already"),
        ("if d > 1 then 2", 16, "`else` is missing"),
        ("if d then 2 else 1", 6, "a condition compares"),
        ("foo(d)", 1, "there is no function of this name"),
        ("sqrt", 1, "needs its argument"),
        ("sqrt(1, 2)", 1, "one argument"),
        ("max(1)", 1, "two or more"),
        ("k & d", 3, "no such sign"),
        ("1e999", 1, "a finite number"),
        ("turned", 1, "it is a condition"),
        ("else", 1, "is needed here"),
    ] {
        let refused = refusal(text);
        assert!(
            refused.starts_with(&format!("at character {column}")),
            "{text}: {refused}"
        );
        assert!(refused.contains(words), "{text}: {refused}");
    }
    assert!(refusal("x = -d;\nk*x +").starts_with("at line 2, character 6: "));
    let deep = format!("{}d{}", "(".repeat(100), ")".repeat(100));
    assert!(refusal(&deep).contains("levels of parentheses"));
    assert!(refusal(&format!("{}d", "-".repeat(4000))).contains("levels"));
    assert!(refusal(&"d+".repeat(3000)).contains("at most 4096 bytes"));
    let long = format!("{}0", "d+1+".repeat(1000));
    assert!(Formula::parse(&long).is_ok());
    let many: Vec<String> = (0..20).map(|k| format!("max(v - {k}.5*d, 0)")).collect();
    assert!(refusal(&many.join(" + ")).contains("more than 64 pieces"));
}

/// Names make an expression of exponentially many terms; reading and parting it take no such time.
#[test]
fn repeated_names_cost_nothing() {
    let mut text = "x0 = d + a;".to_owned();
    for k in 0..60 {
        let next = k + 1;
        text.extend([
            format!("x{next} = x{k} + x{k};"),
            format!("y{next} = x{k}*x{k};"),
        ]);
    }
    text += "max(x60, 0)*y60/(y60 + a)";
    let formula = Formula::parse(&text).unwrap();
    assert_eq!(
        formula.pieces(&[1.0], 0.0, false).unwrap().levels(),
        [-1.0, 0.0]
    );
}

/// Whatever is put together at random is read or refused, and what is read is parted or refused: no panic,
/// no endless work.
#[test]
fn random_texts_are_read_or_refused() {
    const WORDS: [&str; 41] = [
        "d", "v", "s", "a", "k", "2", "0", "1.5", "+", "-", "*", "/", "^", "(", ")", "(", ")", ",",
        ";", "=", "<", ">", "if ", " then ", " else ", " and ", " or ", "not ", "turned", "max(",
        "min(", "abs(", "step(", "sqrt(", "ln(", "exp(", "x", "x=", "0.5", "é", " ",
    ];
    let mut state = 20_261_128_u64;
    let mut next = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as usize % below
    };
    let (mut read, mut parted) = (0, 0);
    for k in 0..40_000 {
        let count = 1 + next(14);
        let mut text: String = (0..count).map(|_| WORDS[next(WORDS.len())]).collect();
        if k % 2 == 0 {
            // Half of them are closed, so that more are formulas.
            text += &")".repeat(
                text.matches('(')
                    .count()
                    .saturating_sub(text.matches(')').count()),
            );
        }
        if k % 5 == 0 {
            text.insert_str(0, "s' = (F/a - s)*k;");
        }
        let Ok(formula) = Formula::parse(&text) else {
            continue;
        };
        read += 1;
        let values = vec![0.7; formula.parameters().len()];
        let dimensions = vec![Dimension::NONE; values.len()];
        let _ = formula.check(&dimensions, Kind::Force.dimension());
        let Ok(pieces) = formula.pieces(&values, 0.1, k % 10 == 0) else {
            continue;
        };
        parted += 1;
        for (gap, rate) in [(1.3, -0.4), (-0.6, 0.2), (0.1, 0.0)] {
            let piece = pieces.at(gap, rate);
            let force = pieces.force(piece, gap, rate);
            let value = pieces.value(piece, gap, rate);
            assert!(
                force.value == value || force.value.is_nan() && value.is_nan(),
                "{text}"
            );
            assert!(
                pieces
                    .exits(piece)
                    .iter()
                    .all(|exit| exit.target < pieces.len()),
                "{text}"
            );
        }
    }
    assert!(read > 1000 && parted > 1000, "{read} {parted}");
}
