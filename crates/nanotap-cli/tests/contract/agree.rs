//! Compares the present results with the pinned ones.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::facts::Fact;

/// The pinned facts of a command that no longer hold, one per line.
pub(crate) fn differences(line: &str, pinned: &[Fact], actual: &[Fact]) -> String {
    let now: BTreeMap<&str, &str> = actual
        .iter()
        .map(|fact| (fact.name.as_str(), fact.value.as_str()))
        .collect();
    let mut differences = String::new();
    if pinned.is_empty() {
        differences.push_str("  nothing is pinned of it\n");
    }
    for fact in pinned {
        match now.get(fact.name.as_str()) {
            None => {
                let _ = writeln!(differences, "  lost: {fact}");
            }
            Some(value) if !holds(fact, value, near_zero(line, &fact.name)) => {
                let _ = writeln!(differences, "  was: {fact}\n  now: {} = {value}", fact.name);
            }
            Some(_) => {}
        }
    }
    differences
}

/// Threshold below which a number is rounding. In the model's units everything is of order one,
/// except for a lever, whose unit of length is a thousand times its motion; energies in SI are
/// 1e-17.
fn near_zero(line: &str, name: &str) -> f64 {
    match () {
        () if !line.contains("lever") => 1e-11,
        () if name.contains("/physical") => 1e-23,
        () if name.starts_with("csv") => 1e-19,
        () => 1e-17,
    }
}

fn holds(fact: &Fact, value: &str, near_zero: f64) -> bool {
    let separators = |c: char| c.is_whitespace() || matches!(c, ',' | '[' | ']');
    let mut was = fact.value.split(separators);
    let mut now = value.split(separators);
    // Documents, and documents in attributes, begin with their types.
    if fact.name.starts_with("json ") || fact.name.contains('@') && fact.name.contains('/') {
        let (Some(types), Some(now)) = (was.next(), now.next()) else {
            return false;
        };
        if !types_hold(types, now) {
            return false;
        }
        // A value that was missing, or sometimes missing, cannot be compared.
        if types.contains("null") {
            return true;
        }
    }
    loop {
        match (was.next(), now.next()) {
            (None, _) => return true,
            (Some(was), Some(now)) if same(was, now, near_zero) => {}
            _ => return false,
        }
    }
}

/// True if no type is new, unless only `null` was known.
fn types_hold(was: &str, now: &str) -> bool {
    was == "null"
        || now
            .split('|')
            .all(|word| was.split('|').any(|known| known == word))
}

fn same(was: &str, now: &str, near_zero: f64) -> bool {
    if was == now {
        return true;
    }
    match (was.parse::<f64>(), now.parse::<f64>()) {
        (Ok(was), Ok(now)) => (was - now).abs() <= (1e-9 * was.abs().max(now.abs())).max(near_zero),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::{Fact, differences};

    /// Checks that each kind of loss is found: a test that cannot fail would pin nothing.
    #[test]
    fn losses_are_found_and_additions_are_not() {
        let lost = |pinned: &str, actual: &str| {
            let facts = |text: &str| text.lines().map(Fact::read).collect::<Vec<_>>();
            !differences("orbit paper.toml", &facts(pinned), &facts(actual)).is_empty()
        };
        let pinned = "json /a = number 1.5 2.5\ncsv x.csv header = a,b";
        assert!(!lost(pinned, pinned));
        assert!(!lost(pinned, &format!("{pinned}\njson /b = string")));
        for worse in [
            "json /a = number 1.5 2.5",
            "json /a = number 1.5\ncsv x.csv header = a,b",
            "json /a = number|string 1.5 2.5\ncsv x.csv header = a,b",
            "json /a = number 1.5 2.500001\ncsv x.csv header = a,b",
            "json /a = number 1.5 2.5\ncsv x.csv header = b,a",
        ] {
            assert!(lost(pinned, worse), "{worse}");
        }
        assert!(!lost("json /a = null", "json /a = number 3"));
        assert!(!lost(
            "json /a = number 1.5",
            "json /a = number 1.5000000001"
        ));
    }
}
