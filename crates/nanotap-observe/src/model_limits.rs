//! Where the model does not hold for a motion, in sentences.

use nanotap_case::physical::{Kind, Remark};
use nanotap_quantity::number::significant;

use crate::{Observables, OutOfRange, PhysicalMotion};

/// Warnings of a motion for which the model does not hold: the law is not valid as far as it goes, Hertz's
/// stiffness is that of another depth, or another part of the beam than the tip would touch.
pub fn limits_of(
    observables: &Observables,
    physical: Option<&PhysicalMotion>,
    out_of_range: &[OutOfRange],
) -> Vec<Remark> {
    let mut warnings: Vec<Remark> = out_of_range
        .iter()
        .map(|beyond| Remark::warning(beyond.to_string()))
        .collect();
    warnings.extend(physical.and_then(other_depth));
    warnings.extend(another_part(observables));
    warnings
}

/// Hertz's stiffness was taken at another depth than the motion has.
fn other_depth(motion: &PhysicalMotion) -> Option<Remark> {
    let mismatch = motion.setting.as_ref()?.hertz_mismatch.as_ref()?;
    let depth = motion.observables.indentation;
    Some(Remark::warning(format!(
        "Hertz's stiffness of {} was taken at an indentation of {}, but the tip sinks in by {}, where it is {}: \
         give sample.indentation = \"{}\", or sample.law = \"hertz\" for the force itself",
        Kind::Stiffness.format_digits(mismatch.assumed_stiffness, 4),
        Kind::Length.format_digits(mismatch.assumed_indentation, 4),
        Kind::Length.format_digits(depth, 4),
        Kind::Stiffness.format_digits(mismatch.stiffness, 4),
        Kind::Length.format_digits(depth, 3),
    )))
}

/// Another part of the beam than the tip would pass through the sample.
fn another_part(observables: &Observables) -> Option<Remark> {
    let height = observables.beam_clearance.filter(|height| *height <= 0.0)?;
    let xi = observables.beam_clearance_xi?;
    let place = if xi > 0.999 {
        "the end of the beam itself".to_owned()
    } else {
        format!("the beam at ξ = {} of its length", significant(xi, 3))
    };
    Some(Remark::warning(format!(
        "{place} would pass through the sample (height {} g₀): the model, in which only the tip touches, does not \
         hold for this motion (the paper's Fig. 2f)",
        significant(height, 4)
    )))
}
