//! Vector operations on slices.

/// Largest modulus of an entry, 0 for an empty slice.
pub(crate) fn norm(a: &[f64]) -> f64 {
    a.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Largest modulus of an entry of `a − b`.
pub(crate) fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()))
}

/// Difference `a − b`, entry by entry.
pub(crate) fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x - y).collect()
}

/// Sum of the squared entries.
pub(crate) fn sum_of_squares(a: &[f64]) -> f64 {
    a.iter().map(|v| v * v).sum()
}

/// Scalar product of `a` and `b`.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
