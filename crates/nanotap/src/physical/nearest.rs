//! Which known names look like a mistyped one.

/// Names within a third of the typed name's length (at least one edit, two swapped letters
/// counting as one), nearest first; ties keep the given order.
pub(crate) fn nearest<'a>(typed: &str, names: impl Iterator<Item = &'a str>) -> Vec<String> {
    // Longer than any name: not worth the quadratic time.
    let folded: String = typed.to_lowercase().chars().take(64).collect();
    let limit = (folded.chars().count() / 3).max(1);
    let mut found: Vec<(usize, &str)> = names
        .map(|name| {
            let distance = strsim::damerau_levenshtein(&folded, &name.to_lowercase());
            (distance, name)
        })
        .filter(|(distance, _)| *distance <= limit)
        .collect();
    found.sort_by_key(|(distance, _)| *distance);
    found.into_iter().map(|(_, name)| name.to_owned()).collect()
}

/// "did you mean \"x\"?" for the nearest of `names`, or the list of them all if none is near.
pub(crate) fn suggestion(typed: &str, names: &[&str]) -> String {
    match nearest(typed, names.iter().copied()).first() {
        Some(name) => format!("did you mean \"{name}\"?"),
        None => format!("known are {}", names.join(", ")),
    }
}
