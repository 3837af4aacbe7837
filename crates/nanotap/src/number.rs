//! Numbers as text.

/// The shortest decimal number that reads back as `value`, without zeros to be counted.
pub fn shortest(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-5..1e16).contains(&size) {
        return format!("{value:e}");
    }
    // Zero has no sign.
    (value + 0.0).to_string()
}
