//! Observables as columns of a table of curves: the model's numbers under the observables' own
//! names and, of a physical case, those that have a unit in SI under their names in SI with
//! the unit in brackets.

use super::table::{Observable, ObservableSet, Observables};
use super::{Dimension, PhysicalMotion};
use crate::case::physical::quantity::JOULES_PER_ELECTRONVOLT;

/// The observables that SI says more of than the model.
fn with_units(set: ObservableSet) -> impl Iterator<Item = &'static Observable> {
    set.iter()
        .filter(|o| o.is_number && o.dimension.kind().is_some())
}

/// Names of the columns of `set`, of a physical case too.
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

/// The numbers of these columns: empty where a motion has none or is not known, and without
/// those in SI where `physical` is `None`.
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
