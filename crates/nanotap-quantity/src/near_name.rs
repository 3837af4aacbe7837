//! Suggestions for misspelt names ("did you mean …?"): one rule for keys, parameters, units and the
//! catalogue.

/// Names similar to `written`, nearest first; ties keep the given order.
///
/// Case, hyphens and spaces in place of underscores, and Greek letters are ignored. One error in
/// three letters is then accepted (two swapped letters are one error), but not more, and not an
/// error for every letter.
pub fn near_names<'a>(written: &str, names: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    let plain = plainly(written);
    let mut found: Vec<(usize, &str)> = names
        .into_iter()
        .map(|name| (strsim::damerau_levenshtein(&plain, &plainly(name)), name))
        .filter(|(distance, name)| {
            let length = name.chars().count();
            *distance <= length.div_ceil(3) && *distance < length
        })
        .collect();
    found.sort_by_key(|(distance, _)| *distance);
    found.into_iter().map(|(_, name)| name).collect()
}

/// The nearest of `names`, if one is similar; otherwise the only one that begins with `written`,
/// which must have at least three letters.
pub fn near_name<'a>(
    written: &str,
    names: impl IntoIterator<Item = &'a str> + Clone,
) -> Option<&'a str> {
    if let Some(name) = near_names(written, names.clone()).first() {
        return Some(name);
    }
    let plain = plainly(written);
    let mut longer = names
        .into_iter()
        .filter(|name| plain.chars().count() > 2 && plainly(name).starts_with(&plain));
    let first = longer.next()?;
    // A name may occur twice in the list.
    longer.all(|other| other == first).then_some(first)
}

/// "did you mean \"x\"?" for the nearest of `names`, or the list of them all if none is near.
pub fn suggestion(written: &str, names: &[&str]) -> String {
    near_name(written, names.iter().copied()).map_or_else(
        || format!("known are {}", names.join(", ")),
        |name| format!("did you mean \"{name}\"?"),
    )
}

fn plainly(name: &str) -> String {
    // Longer than any name by far: nothing to compare, and no time to lose on it.
    name.chars()
        .take(64)
        .flat_map(char::to_lowercase)
        .map(|character| match character {
            'α' => "alpha".to_owned(),
            'ω' => "omega".to_owned(),
            '-' | ' ' => "_".to_owned(),
            other => other.to_string(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEYS: [&str; 6] = [
        "modes",
        "alpha1",
        "alpha2",
        "omega",
        "contact_stiffness",
        "gap",
    ];

    #[test]
    fn slips_are_seen_through() {
        for (written, meant) in [
            ("omgea", "omega"),
            ("Omega", "omega"),
            ("Ω", "omega"),
            ("α2", "alpha2"),
            ("mode", "modes"),
            ("contact-stiffness", "contact_stiffness"),
            ("contact_stifness", "contact_stiffness"),
            ("contact", "contact_stiffness"),
            ("gaps", "gap"),
        ] {
            assert_eq!(near_name(written, KEYS), Some(meant), "{written}");
        }
    }

    #[test]
    fn what_is_far_from_everything_suggests_nothing() {
        for written in ["", "x", "temperature", "🦀", &"a".repeat(100_000)] {
            assert_eq!(near_name(written, KEYS), None, "{written:.20}");
        }
    }

    #[test]
    fn an_ambiguous_beginning_points_nowhere() {
        assert_eq!(
            near_name("contact", ["contact_stiffness", "contact_damping"]),
            None
        );
    }

    #[test]
    fn the_nearest_comes_first() {
        assert_eq!(
            near_names("alpha2", ["alpha1", "alpha2"]),
            ["alpha2", "alpha1"]
        );
    }
}
