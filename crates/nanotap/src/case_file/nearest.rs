//! The key that was probably meant.

/// The name among `candidates` nearest to what was `written`, if any is near.
///
/// Case, hyphens and the Greek letters themselves are forgiven altogether.
pub(super) fn nearest<'a>(
    written: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let plain = plainly(written);
    candidates
        .into_iter()
        .map(|candidate| {
            let distance = strsim::damerau_levenshtein(&plain, &plainly(candidate));
            (distance, candidate)
        })
        .filter(|(distance, candidate)| {
            // One slip in three letters still points at the right key, more does not.
            *distance <= candidate.chars().count().div_ceil(3)
                && *distance < candidate.chars().count()
        })
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

fn plainly(name: &str) -> String {
    // Longer than any key by far: nothing to compare, and no time to lose on it.
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
            ("gaps", "gap"),
        ] {
            assert_eq!(nearest(written, KEYS), Some(meant), "{written}");
        }
    }

    #[test]
    fn what_is_far_from_everything_suggests_nothing() {
        for written in ["", "x", "temperature", "🦀", &"a".repeat(100_000)] {
            assert_eq!(nearest(written, KEYS), None, "{written:.20}");
        }
    }
}
