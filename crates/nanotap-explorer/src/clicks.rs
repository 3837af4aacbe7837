//! The result of a click on the figure of a study: the value of a key at that place, and the state
//! of the motion drawn there; and the branches that are drawn over the figure.

use nanotap::case::quantity::Kind;
use nanotap::case::units::{Units, prefixed};
use nanotap::case::{Case, Key};
use nanotap::dataset::{Store, StoreError, Values};
use nanotap::observe::table::shown_phase;
use nanotap::observe::{Dimension, Observable, Observables};
use nanotap::study::approach::ApproachReport;
use nanotap::study::branch::{BranchReport, PointReport};
use nanotap::study::sweep::Over;
use nanotap_figures::{Colour, Dash, Figure, Line};
use serde_json::{Map, Value, json};

use crate::motion_request::Start;

/// An axis of a figure on which a click sets a key.
#[derive(Clone)]
pub(crate) struct Axis {
    pub(crate) key: Key,
    /// Factor from values of the key in SI to drawn values.
    pub(crate) factor: f64,
    /// Unit of the drawn values; empty for numbers.
    pub(crate) unit: String,
}

impl Axis {
    pub(crate) fn of(over: &Over) -> Self {
        let size = over.from.abs().max(over.to.abs());
        let (factor, unit) = if over.key.is_physical() && over.kind != Kind::Number {
            prefixed(over.kind, 1.0, size)
        } else {
            (1.0, String::new())
        };
        Self {
            key: over.key,
            factor,
            unit,
        }
    }

    pub(crate) fn json(&self) -> Value {
        json!({ "name": self.key.path(), "factor": self.factor, "unit": self.unit })
    }
}

/// An observable as shown in a panel.
pub(crate) struct Height {
    observable: &'static Observable,
    unit: String,
}

impl Height {
    /// The observables of these names, each in the unit of its panel.
    pub(crate) fn of(figure: &Figure, names: &[&str]) -> Vec<Self> {
        let named = names.iter().zip(&figure.panels);
        named
            .filter_map(|(name, panel)| {
                Some(Self {
                    observable: Observable::named(name)?,
                    unit: panel.y.unit.clone(),
                })
            })
            .collect()
    }

    /// The observable, and the factor from its value in the model's units to the drawn one; null for an
    /// angle, which is drawn in degrees.
    pub(crate) fn json(&self, units: &Units) -> Value {
        let dimension = self.observable.dimension;
        let si = dimension
            .kind()
            .and_then(|kind| Some((kind, units.si(kind)?)));
        let factor = match (dimension, si) {
            (Dimension::Angle, _) => None,
            (_, Some((kind, si))) => Some(factor(kind, si, &self.unit)),
            _ => Some(1.0),
        };
        json!({ "name": self.observable.name, "factor": factor })
    }

    /// Whether it shows the observable with this name.
    pub(crate) fn is(&self, name: &str) -> bool {
        self.observable.name == name
    }

    /// The drawn value of a measured one, which is in SI or in degrees.
    pub(crate) fn of_measured(&self, value: f64) -> f64 {
        match self.observable.dimension {
            Dimension::Angle => value,
            _ => self.drawn(value, Some(1.0)),
        }
    }

    /// The drawn value of a value in SI (`si` is 1) or in a unit of `si` in SI.
    fn drawn(&self, value: f64, si: Option<f64>) -> f64 {
        let dimension = self.observable.dimension;
        if dimension == Dimension::Angle {
            return shown_phase(value);
        }
        match (dimension.kind(), si) {
            (Some(kind), Some(si)) => value * factor(kind, si, &self.unit),
            _ => value,
        }
    }

    fn of_motion(&self, observables: &Observables, units: &Units) -> f64 {
        let value = (self.observable.of)(observables);
        let kind = self.observable.dimension.kind();
        let si = kind.and_then(|kind| units.si(kind));
        value
            .number()
            .map_or(f64::NAN, |value| self.drawn(value, si))
    }

    fn of_point(&self, point: &PointReport, units: &Units) -> f64 {
        match &point.physical {
            Some(motion) => {
                let value = (self.observable.of)(&motion.observables).number();
                value.map_or(f64::NAN, |value| self.drawn(value, Some(1.0)))
            }
            None => self.of_motion(&point.observables, units),
        }
    }
}

/// Factor from an entry of a state to its drawn values.
pub(crate) fn of_entry(units: &Units, name: &str, axis: &nanotap_figures::Axis) -> f64 {
    let si = units.of_entry(name);
    si.map_or(1.0, |(kind, si)| factor(kind, si, &axis.unit))
}

/// What else a click must set, `key: value`, so that the case is the one that was drawn: what stays
/// constant while `keys` vary, and at a setpoint the distance that was solved for.
pub(crate) fn fixed(case: &Case, keys: &[Key]) -> Map<String, Value> {
    let word = |(path, value): (&str, f64)| {
        let key = Key::find(path)?;
        let text = Value::from(key.kind().format_exact(value));
        Some((path.to_owned(), text))
    };
    // The free amplitude, and the force that gives it, are the same at every distance.
    let distance = keys == [Key::GapTip];
    let held = case.held(keys).into_iter();
    held.filter(|(path, _)| !distance || *path == Key::GapBeam.path())
        .filter_map(word)
        .collect()
}

/// Factor from values in a unit of `si` in SI to values in `unit`.
fn factor(kind: Kind, si: f64, unit: &str) -> f64 {
    let own = kind.parse(&format!("1 {unit}"));
    own.map_or(1.0, |own| si / own)
}

/// What values in one unit are to be multiplied with to be in another; `None` if they measure
/// different things.
pub(crate) fn conversion(from: &str, to: &str) -> Option<f64> {
    if from == to {
        return Some(1.0);
    }
    Kind::ALL.into_iter().find_map(|kind| {
        let [from, to] = [from, to].map(|unit| kind.parse(&format!("1 {unit}")).ok());
        Some(from? / to?)
    })
}

/// The observables in the panels of a figure.
pub(crate) fn of_heights(heights: &[Height], units: &Units) -> Vec<Value> {
    heights.iter().map(|height| height.json(units)).collect()
}

/// A drawn motion: its x, its heights in each panel, and the state that starts it.
fn place(x: f64, heights: &[Vec<f64>], start: &str) -> Value {
    json!([x, heights, start])
}

/// The orbits of branches, as drawn.
pub(crate) fn on_branches(
    report: &BranchReport,
    x: &Axis,
    heights: &[Height],
    units: &Units,
) -> Vec<Value> {
    let of = |point: &PointReport| {
        let drawn: Vec<Vec<f64>> = heights
            .iter()
            .map(|height| vec![height.of_point(point, units)])
            .collect();
        let start = Start::text(Some(point.period), &point.state);
        place(x.factor * point.parameter, &drawn, &start)
    };
    report.points.iter().map(of).collect()
}

/// The motions of an approach curve, and the orbits of its branches. `factor` is that of distances
/// in the model's unit.
pub(crate) fn of_approach(
    report: &ApproachReport,
    factor: f64,
    heights: &[Height],
    units: &Units,
) -> Vec<Value> {
    let met = report.table.iter().filter_map(|point| {
        let state = point.orbit.as_ref()?.states.first()?;
        let observables = point.observables.as_ref()?;
        Some((factor * point.gap, observables, Start::text(None, state)))
    });
    let followed = report.branches.iter().flat_map(|branches| &branches.points);
    let followed = followed.map(|point| {
        let start = Start::text(Some(point.period), &point.state);
        (factor * point.parameter, &point.observables, start)
    });
    met.chain(followed)
        .map(|(x, observables, start)| {
            let drawn: Vec<Vec<f64>> = heights
                .iter()
                .map(|height| vec![height.of_motion(observables, units)])
                .collect();
            place(x, &drawn, &start)
        })
        .collect()
}

/// The motions of a sweep over one parameter, with the last state of each. A diagram shows the
/// maxima of the drive periods (`heights` has one that represents them), a resonance curve the
/// observables.
pub(crate) fn in_sweep(
    store: &Store,
    x: &Axis,
    heights: &[Height],
    response: bool,
) -> Result<Vec<Value>, StoreError> {
    let schema = store.schema();
    let Some(Values::Real(along)) = schema
        .coordinate(&schema.grid.axes[0].name)
        .map(|c| &c.values)
    else {
        return Ok(Vec::new());
    };
    let names: Vec<&str> = if response {
        heights
            .iter()
            .map(|height| height.observable.name)
            .collect()
    } else {
        vec!["period_max"]
    };
    let Some(strobe) = schema.index_of("strobe") else {
        return Ok(Vec::new());
    };
    let columns: Vec<usize> = names.iter().filter_map(|n| schema.index_of(n)).collect();
    let mut places = Vec::new();
    for chunk in 0..store.chunks() {
        let block = schema.grid.block(chunk);
        let real = |variable: usize| -> Result<Vec<f64>, StoreError> {
            Ok(match store.read_chunk(&block, variable)? {
                Values::Real(values) => values,
                _ => Vec::new(),
            })
        };
        let states = real(strobe)?;
        let values: Vec<Vec<f64>> = columns.iter().map(|c| real(*c)).collect::<Result<_, _>>()?;
        let width = schema.variables[strobe].stride();
        for (cell, entry) in block.entries().enumerate() {
            let Some(state) = states.get(cell * width..(cell + 1) * width) else {
                continue;
            };
            if state.iter().any(|number| !number.is_finite()) {
                continue;
            }
            let drawn: Vec<Vec<f64>> = heights
                .iter()
                .zip(columns.iter().zip(&values))
                .map(|(height, (&column, values))| {
                    let variable = &schema.variables[column];
                    let units = variable.attributes.get("units").and_then(Value::as_str);
                    let kind = height.observable.dimension.kind();
                    let si = kind
                        .filter(|kind| units == Some(kind.si_unit()))
                        .map(|_| 1.0);
                    let own = cell * variable.stride()..(cell + 1) * variable.stride();
                    let row = values.get(own).unwrap_or_default().iter();
                    row.map(|value| height.drawn(*value, si)).collect()
                })
                .collect();
            let start = Start::text(None, state);
            places.push(place(x.factor * along[entry[0]], &drawn, &start));
        }
    }
    Ok(places)
}

/// Draws the branches of a case over the figure of a sweep: stable ones as lines, unstable ones
/// dashed.
pub(crate) fn drawn_over(
    figure: &mut Figure,
    report: &BranchReport,
    x: &Axis,
    heights: &[Height],
    units: &Units,
) {
    for (height, panel) in heights.iter().zip(&mut figure.panels) {
        let mut lines: Vec<(bool, Vec<(f64, f64)>)> = Vec::new();
        let mut before: Option<&PointReport> = None;
        for point in &report.points {
            let at = (x.factor * point.parameter, height.of_point(point, units));
            match (before, lines.last_mut()) {
                (Some(last), Some((stable, line)))
                    if last.branch == point.branch && *stable == point.stable =>
                {
                    line.push(at);
                }
                (Some(last), Some((_, line))) if last.branch == point.branch => {
                    let joint = line.last().copied();
                    lines.push((point.stable, joint.into_iter().chain([at]).collect()));
                }
                _ => lines.push((point.stable, vec![at])),
            }
            before = Some(point);
        }
        let mut named = [false; 2];
        for (stable, points) in lines {
            let (words, dash) = if stable {
                ("stable", Dash::Solid)
            } else {
                ("unstable", Dash::Dashed)
            };
            let first = !std::mem::replace(&mut named[usize::from(stable)], true);
            let line = Line::new(points)
                .colour(Colour::BLACK)
                .dash(dash)
                .width(0.5)
                .label(if first { words } else { "" });
            panel.layers.push(line.into());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap::case::quantity::JOULES_PER_ELECTRONVOLT;

    #[test]
    fn a_unit_says_its_factor() {
        assert!((factor(Kind::Length, 1.0, "nm") - 1e9).abs() < 1.0);
        // 2 model units of 5 nm each are 10 nm.
        assert!((2.0 * factor(Kind::Length, 5e-9, "nm") - 10.0).abs() < 1e-12);
        assert!((conversion("nm", "um").unwrap() - 1e-3).abs() < 1e-12);
        assert_eq!(conversion("nm", "nN"), None);
        let [joules, volts] = ["aJ", "eV"].map(|unit| factor(Kind::Energy, 1.0, unit));
        assert!((joules / volts - 1e18 * JOULES_PER_ELECTRONVOLT).abs() < 1e-12);
    }
}
