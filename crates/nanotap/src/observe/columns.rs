//! Observables as columns of a table of curves: of a dimensionless case under their own names; of a
//! physical case in SI, under the names of the field, with the unit in brackets.

use super::table::{Observable, ObservableSet, Observables};
use super::{Dimension, PhysicalMotion};
use crate::case::physical::quantity::JOULES_PER_ELECTRONVOLT;

/// Heads of the columns of `set`, in SI or in the model's units.
pub fn columns(set: ObservableSet, si: bool) -> Vec<String> {
    let numbers = set.iter().filter(|o| o.is_number);
    if !si {
        return numbers.map(|o| o.name.to_owned()).collect();
    }
    let mut names = Vec::new();
    for o in numbers {
        names.push(match o.dimension {
            Dimension::Angle => format!("{} (deg)", o.si_name),
            dimension if dimension.kind().is_some() => {
                format!("{} ({})", o.si_name, dimension.si_unit())
            }
            _ => o.si_name.to_owned(),
        });
        if o.dimension == Dimension::Energy {
            names.push(format!("{} (eV)", o.si_name));
        }
    }
    names.push("A_ratio".to_owned());
    names
}

/// The values of these columns in the model's units; empty if the motion is unknown.
pub fn cells(set: ObservableSet, observables: Option<&Observables>) -> Vec<Option<f64>> {
    let numbers = set.iter().filter(|o| o.is_number);
    numbers.map(|o| number(o, observables)).collect()
}

/// The values of these columns in SI; empty if the motion is unknown.
pub fn cells_in_si(set: ObservableSet, motion: Option<&PhysicalMotion>) -> Vec<Option<f64>> {
    let mut cells = Vec::new();
    for o in set.iter().filter(|o| o.is_number) {
        let value = number(o, motion.map(|motion| &motion.observables));
        cells.push(value);
        if o.dimension == Dimension::Energy {
            cells.push(value.map(|joules| joules / JOULES_PER_ELECTRONVOLT));
        }
    }
    cells.push(motion.map(|motion| motion.amplitude_ratio));
    cells
}

fn number(observable: &Observable, of: Option<&Observables>) -> Option<f64> {
    of.and_then(|of| (observable.of)(of).number())
}
