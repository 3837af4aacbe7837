//! What fits of force curves say of sample and contact, as a table.

use nanotap_observe::frame::{Frame, Rows, columns};
use nanotap_quantity::Kind;
use nanotap_quantity::number::{counted, significant};

use super::{Estimate, FittedForceCurve};
use crate::calibrate::SENSITIVITY;

/// Curves with the results of their fits: readers see a line a quantity, files have a row a curve.
/// What no curve has is left out.
pub fn force_curve_table(curves: &[FittedForceCurve]) -> Frame<'_> {
    let some = |has: fn(&FittedForceCurve) -> bool| curves.iter().any(has);
    let mut rows = columns! { Rows::new("force_curves", curves, None);
        "curve", "", Plain => |of| &of.curve;
    };
    if some(|of| of.modulus.is_some()) {
        let modulus = |of: &FittedForceCurve| of.modulus;
        rows = columns! { rows;
            "", "Young's modulus", Plain => |of| of.modulus.map(|found| {
                plus_minus(Kind::Pressure, &found) + &interval(Kind::Pressure, &found)
            });
            "modulus", "Young's modulus", (Si(Kind::Pressure), Digits(5)) =>
                move |of| Some(modulus(of)?.value);
            .only_in_files();
            "modulus_error", "standard error of the modulus", (Si(Kind::Pressure), Digits(5)) =>
                move |of| modulus(of)?.standard_error;
            .only_in_files();
            "modulus_low", "lower end of its 95 % interval", (Si(Kind::Pressure), Digits(5)) =>
                move |of| modulus(of)?.interval[0];
            .only_in_files();
            "modulus_high", "upper end of its 95 % interval", (Si(Kind::Pressure), Digits(5)) =>
                move |of| modulus(of)?.interval[1];
            .only_in_files();
        };
    }
    if some(|of| of.contact_point.is_some()) {
        let contact = |of: &FittedForceCurve| of.contact_point;
        rows = columns! { rows;
            "", "contact point", Plain => |of| of.contact_point.map(|found| {
                format!("{} on `{}`", plus_minus(Kind::Length, &found), of.distance)
            });
            "contact_point", "contact point", (Si(Kind::Length), Digits(5)) =>
                move |of| Some(contact(of)?.value);
            .only_in_files();
            "contact_point_error", "standard error of the contact point", (Si(Kind::Length), Digits(5)) =>
                move |of| contact(of)?.standard_error;
            .only_in_files();
        };
    }
    if some(|of| of.baseline.is_some()) {
        rows = columns! { rows;
            "", "baseline", Plain => |of| of.baseline.map(|found| {
                let kind = Kind::of_si_unit(&of.baseline_unit).unwrap_or(Kind::Number);
                format!("{} of `{}`", plus_minus(kind, &found), of.deflection)
            });
        };
    }
    if some(|of| of.adhesion_force.is_some()) {
        rows = columns! { rows;
            "", "adhesion", Plain => |of| of.adhesion_force.map(|force| {
                format!("{}, the pull-off force", Kind::Force.format_digits(-force, 4))
            });
            "adhesion_force", "lowest force on the way back", (Si(Kind::Force), Digits(5)) =>
                |of| of.adhesion_force;
            .only_in_files();
        };
    }
    let rows = columns! { rows;
        "", "law", Plain => law;
        "", "fitted", Plain => |of| format!(
            "{}, {}: `{}` against `{}`",
            of.segment.as_deref().unwrap_or("all"),
            counted(of.rows, "row", "rows"),
            of.deflection,
            of.distance
        );
        "", "lever", Plain => lever;
        "spring_constant", "stiffness of the lever", (Si(Kind::Stiffness), Digits(5)) => |of| of.spring_constant;
        .only_in_files();
        "", "up to", Plain => |of| format!(
            "{} at an indentation of {}",
            Kind::Force.format_digits(of.largest_force, 4),
            Kind::Length.format_digits(of.largest_indentation, 4)
        );
        "largest_force", "largest force", (Si(Kind::Force), Digits(5)) => |of| of.largest_force;
        .only_in_files();
        "largest_indentation", "largest indentation", (Si(Kind::Length), Digits(5)) => |of| of.largest_indentation;
        .only_in_files();
        "", "misfit", Plain => |of| format!(
            "{} (root mean square), {} % of the largest force",
            Kind::Force.format_digits(of.residual_force, 3),
            significant(100.0 * of.residual_force / of.largest_force, 2)
        );
        "residual_force", "root mean square of the residuals as a force", (Si(Kind::Force), Digits(5)) =>
            |of| of.residual_force;
        .only_in_files();
        .turned();
    };
    rows.frame()
}

/// The law with the sizes of the tip.
fn law(of: &FittedForceCurve) -> String {
    let sizes = [
        ("tip radius", Kind::Length, of.tip_radius),
        ("half angle", Kind::Angle, of.half_angle),
        ("Poisson's ratio", Kind::Number, of.poisson),
    ];
    let sizes = sizes.into_iter().filter_map(|(name, kind, value)| {
        Some(format!("{name} {}", kind.format_digits(value?, 5)))
    });
    let law = of.law.as_deref().unwrap_or("linear contact").to_owned();
    let model: Vec<String> = std::iter::once(law).chain(sizes).collect();
    model.join(", ")
}

/// The stiffness of the lever, and where it comes from.
fn lever(of: &FittedForceCurve) -> String {
    let from = match of.spring_constant_from.as_str() {
        "header" => "from the file's header",
        _ => "stated",
    };
    let k = Kind::Stiffness.format_digits(of.spring_constant, 5);
    let sensitivity = of.sensitivity_in_header.map_or_else(String::new, |of| {
        format!(
            "; InvOLS {} in the header",
            SENSITIVITY.format_digits(of, 4)
        )
    });
    format!("k = {k} {from}{sensitivity}")
}

/// A value with its standard error, in so many digits that the error has two.
fn plus_minus(kind: Kind, found: &Estimate) -> String {
    let Some(error) = found.standard_error.filter(|error| *error > 0.0) else {
        return kind.format_digits(found.value, 5);
    };
    let digits = nanotap_arithmetic::log10(found.value.abs() / error).ceil() + 2.0;
    let value = kind.format_digits(found.value, digits.clamp(3.0, 12.0) as usize);
    format!("{value} ± {}", kind.format_digits(error, 2))
}

fn interval(kind: Kind, found: &Estimate) -> String {
    let ends = found
        .interval
        .map(|end| end.map(|end| kind.format_digits(end, 4)));
    match ends {
        [Some(low), Some(high)] => format!(" (95 %: {low} to {high})"),
        _ => String::new(),
    }
}
