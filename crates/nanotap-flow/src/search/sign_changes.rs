//! Every sign change of a signal, each found and certified like a switch.

use super::{Start, Statistics, first_crossing};
use crate::signal::Signal;

/// Zeros nearer to each other than this part of the length …
const CROWDED: f64 = 1e-13;
/// … and more than this many in a row are rounding: a signal that is zero but for it.
const MAX_CROWDED: u32 = 32;

/// Every zero in `(0, length)` at which the signal changes sign, in order. A signal that
/// drowns in its own rounding has none from there on.
pub fn sign_changes(signal: &Signal, length: f64) -> Vec<f64> {
    let mut zeros = Vec::new();
    if signal.noise() < f64::MIN_POSITIVE {
        // Below the numbers that have all their digits there is nothing but rounding.
        return zeros;
    }
    let mut statistics = Statistics::default();
    let (mut offset, mut crowded) = (0.0, 0);
    let value = signal.at(0.0);
    let on_surface = value.abs() <= signal.noise();
    let mut sign = if on_surface {
        first_sign(signal)
    } else {
        value.signum()
    };
    let mut start = if on_surface {
        Start::Surface { rate: None }
    } else {
        Start::Inside
    };
    while sign != 0.0 && offset < length {
        let left = length - offset;
        let part = signal.shifted(offset, sign, left);
        let Some(crossing) = first_crossing(&part, left, start, &mut statistics) else {
            break;
        };
        offset += crossing.at;
        if offset >= length {
            break;
        }
        crowded = if crossing.at <= CROWDED * length {
            crowded + 1
        } else {
            0
        };
        if crowded > MAX_CROWDED {
            break;
        }
        if crossing.at > 0.0 {
            zeros.push(offset);
        }
        sign = -sign;
        start = Start::Surface {
            rate: (crossing.rate < 0.0).then_some(-crossing.rate),
        };
    }
    zeros
}

/// The sign just after the start of a signal that starts at zero.
fn first_sign(signal: &Signal) -> f64 {
    (1..6)
        .map(|order| signal.derivative_at_start(order))
        .find(|d| *d != 0.0)
        .map_or(0.0, f64::signum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Complex;
    use std::f64::consts::PI;

    /// A signal of the smallest numbers there are changes sign wherever rounding has it.
    #[test]
    fn a_signal_that_is_all_rounding_has_no_zeros() {
        let tiny = f64::from_bits(1);
        let terms = [
            (Complex::new(-0.05, 3.0), Complex::new(tiny, tiny)),
            (Complex::new(0.0, 2.6), Complex::new(0.0, -tiny)),
        ];
        let signal = Signal::from_terms(0.0, &terms, Vec::new(), 2.4);
        assert!(sign_changes(&signal, 2.4).is_empty());
    }

    /// sin s has its zeros at multiples of π, sin² s − ½ at odd multiples of π/4.
    #[test]
    fn zeros_of_known_functions() {
        let sine = Signal::from_terms(
            0.0,
            &[(Complex::new(0.0, 1.0), Complex::new(0.0, -1.0))],
            Vec::new(),
            10.0,
        );
        let zeros = sign_changes(&sine, 10.0);
        assert_eq!(zeros.len(), 3);
        for (k, z) in zeros.iter().enumerate() {
            assert!((z - PI * (k + 1) as f64).abs() < 1e-14);
        }
        let cosine = Signal::from_terms(
            0.0,
            &[(Complex::new(0.0, 2.0), Complex::new(-0.5, 0.0))],
            Vec::new(),
            10.0,
        );
        let zeros = sign_changes(&cosine, 10.0);
        assert_eq!(zeros.len(), 6);
        for (k, z) in zeros.iter().enumerate() {
            assert!((z - PI / 4.0 * (2 * k + 1) as f64).abs() < 1e-14);
        }
    }
}
