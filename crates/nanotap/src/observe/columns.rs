//! Observables as columns of a table of curves: in the model's units under the observables' names
//! and, for a physical case, those with a unit also in SI, under their SI names with the unit in
//! brackets.

use super::table::{Observable, ObservableSet, Observables};
use super::{Dimension, PhysicalMotion};
use crate::case::physical::quantity::JOULES_PER_ELECTRONVOLT;

/// The observables whose values differ between the model and SI.
fn with_units(set: ObservableSet) -> impl Iterator<Item = &'static Observable> {
    set.iter()
        .filter(|o| o.is_number && o.dimension.kind().is_some())
}

/// Names of the columns of `set`, including those of a physical case.
pub fn columns(set: ObservableSet, physical: bool) -> Vec<String> {
    let numbers = set.iter().filter(|o| o.is_number);
    let mut names: Vec<String> = numbers.map(|o| o.name.to_owned()).collect();
    if physical {
        for o in with_units(set) {
            names.push(format!("{} ({})", o.si_name, o.dimension.si_unit()));
            if o.dimension == Dimension::Energy {
                names.push(format!("{} (eV)", o.si_name));
            }
        }
        names.push("A_ratio".to_owned());
    }
    names
}

/// The values of these columns: empty if a motion has none or is unknown, and without those in SI
/// if `physical` is `None`.
pub fn cells(
    set: ObservableSet,
    observables: Option<&Observables>,
    physical: Option<Option<&PhysicalMotion>>,
) -> Vec<Option<f64>> {
    let number = |of: Option<&Observables>, o: &Observable| of.and_then(|of| (o.of)(of).number());
    let numbers = set.iter().filter(|o| o.is_number);
    let mut cells: Vec<Option<f64>> = numbers.map(|o| number(observables, o)).collect();
    if let Some(motion) = physical {
        for o in with_units(set) {
            let value = number(motion.map(|m| &m.observables), o);
            cells.push(value);
            if o.dimension == Dimension::Energy {
                cells.push(value.map(|joules| joules / JOULES_PER_ELECTRONVOLT));
            }
        }
        cells.push(motion.map(|m| m.amplitude_ratio));
    }
    cells
}
