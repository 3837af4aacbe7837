//! Free parameters of a fit: keys of the case, and corrections of the instrument.
//!
//! `X.offset` is added to the values of a column X: to the positions of its rows, or to the model's
//! values of an observable. `X.scale` multiplies the model's values. `gap.offset` is the offset of
//! the distance.

use crate::Error;
use crate::case::{Case, Key};
use crate::study::value::{Amount, Interval, Intervals};

use super::data::{self, Data, is_distance};
use super::laws::between;
use super::quantity::Quantity;

/// What a parameter changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// A key of the case.
    Key(Key),
    /// Offset of a swept key, by its index.
    Place(usize),
    /// Offset of an observable, by its column.
    Offset(usize),
    /// Factor of an observable, by its column.
    Scale(usize),
}

/// A free parameter.
#[derive(Clone, Debug)]
pub(super) struct Parameter {
    /// Name: `sample.stiffness`, `gap.offset`.
    pub(super) name: String,
    /// What it changes.
    pub(super) target: Target,
    /// Index of its curve; `None`: all curves.
    pub(super) curve: Option<usize>,
    /// Initial value.
    pub(super) start: f64,
    /// Its bounds.
    pub(super) bounds: (f64, f64),
    /// Scale of the range of initial values.
    pub(super) size: f64,
}

impl Parameter {
    /// Its unit in SI, `1` for none.
    pub(super) fn unit(&self, data: &Data, case: &Case) -> &'static str {
        match self.target {
            Target::Key(key) => unit_of(key),
            Target::Place(at) => unit_of(data.swept[at].key),
            Target::Scale(_) => "1",
            Target::Offset(column) => {
                let quantity = data.columns[column].quantity;
                match quantity.kind() {
                    Some(_) if !case.is_physical() => "1",
                    _ => quantity.unit(true),
                }
            }
        }
    }

    /// Whether it counts for a curve.
    pub(super) fn is_of(&self, curve: usize) -> bool {
        self.curve.is_none_or(|own| own == curve)
    }

    /// Derivatives of a row's values by an offset or a scale of a column; zero for other
    /// parameters.
    pub(super) fn direct(&self, values: &[f64]) -> Vec<f64> {
        let mut by = vec![0.0; values.len()];
        match self.target {
            Target::Offset(column) => by[column] = 1.0,
            Target::Scale(column) => by[column] = values[column],
            Target::Key(_) | Target::Place(_) => {}
        }
        by
    }
}

/// Unit of a key in SI, `1` if there is none.
pub(super) fn unit_of(key: Key) -> &'static str {
    if key.is_physical() {
        key.kind().si_unit()
    } else {
        "1"
    }
}

/// Creates the parameters called `free` and, one per curve, `per_curve`.
pub(super) fn parameters(
    case: &Case,
    data: &Data,
    free: &[String],
    per_curve: &[String],
    bounds: &Intervals,
) -> Result<Vec<Parameter>, Error> {
    if free.is_empty() && per_curve.is_empty() {
        return Err(Error::option(
            "free",
            "no parameter is free",
            "name keys of the case, as in sample.stiffness,gap.offset",
        ));
    }
    let mut parameters = Vec::new();
    for (names, option) in [(free, "free"), (per_curve, "per_curve")] {
        for name in names {
            let given = bounds.0.iter().find(|b| b.name == *name);
            let mut parameter =
                parameter(case, data, name.trim(), given).map_err(|error| error.at(option))?;
            if parameters
                .iter()
                .any(|p: &Parameter| p.target == parameter.target)
            {
                return Err(Error::option(
                    option,
                    format!("{name} is listed twice"),
                    "name each parameter once",
                ));
            }
            if let Some(given) = given {
                bound(case, data, &mut parameter, [&given.low, &given.high])
                    .map_err(|error| error.at("bounds"))?;
            }
            if option == "free" {
                parameters.push(parameter);
            } else {
                let curves = 0..data.curves.len();
                parameters.extend(curves.map(|curve| Parameter {
                    curve: Some(curve),
                    ..parameter.clone()
                }));
            }
        }
    }
    let is_free = |name: &str| free.iter().chain(per_curve).any(|known| known == name);
    if let Some(unknown) = bounds.0.iter().find(|bound| !is_free(&bound.name)) {
        return Err(Error::option(
            "bounds",
            format!("{} is not free", unknown.name),
            "bounds need a parameter in {free} or {per_curve}",
        ));
    }
    let count = data.count();
    if count <= parameters.len() {
        return Err(Error::option(
            "free",
            format!(
                "{count} measured values cannot determine {} parameters",
                parameters.len()
            ),
            "free fewer, or measure more",
        ));
    }
    Ok(parameters)
}

fn parameter(
    case: &Case,
    data: &Data,
    name: &str,
    bound: Option<&Interval>,
) -> Result<Parameter, Error> {
    if let Some((of, what)) = name.rsplit_once('.')
        && matches!(what, "offset" | "scale")
    {
        return nuisance(case, data, name, of, what);
    }
    let key = case.key(name)?;
    let same = |swept: &&data::SweptKey| {
        swept.key == key || key.alternatives().any(|(other, _)| other == swept.key)
    };
    if let Some(swept) = data.swept.iter().find(same) {
        return Err(Error::input(
            format!("{name} is set by the column `{}`", swept.name),
            format!("free {}.offset to allow for an error", swept.name),
        ));
    }
    let mut start = case.get(key);
    if let (false, Some(bound)) = (start.is_finite(), bound) {
        start = between(
            case.value(key, bound.low.text())?,
            case.value(key, bound.high.text())?,
        );
    }
    if !start.is_finite() {
        return Err(Error::input(
            format!("{name} has no initial value in the case"),
            "give it a value in the case, or {bounds}",
        ));
    }
    let range = key.range();
    // The ends of the valid range may be excluded.
    let inside = |end: f64, excluded: bool, to: f64| {
        if excluded && end.is_finite() {
            end + to * f64::EPSILON.max(1e-9 * start.abs())
        } else {
            end
        }
    };
    Ok(Parameter {
        name: key.path().to_owned(),
        target: Target::Key(key),
        curve: None,
        start,
        bounds: (
            inside(range.low, range.above, 1.0),
            inside(range.high, range.below, -1.0),
        ),
        size: start.abs(),
    })
}

fn nuisance(
    case: &Case,
    data: &Data,
    name: &str,
    of: &str,
    what: &str,
) -> Result<Parameter, Error> {
    let any = (f64::NEG_INFINITY, f64::INFINITY);
    let own = data
        .columns
        .iter()
        .any(|c| c.name == "A" || c.name == "first_harmonic");
    let column = Quantity::named(of, own)
        .and_then(|quantity| data.columns.iter().position(|c| c.quantity == quantity));
    let swept = || {
        let key = data::set(of, case).ok()?;
        let same =
            |swept: &data::SweptKey| swept.key == key || is_distance(swept.key) && is_distance(key);
        data.swept.iter().position(same)
    };
    let (target, start, size, bounds) = match (column, what) {
        (Some(column), "offset") => (
            Target::Offset(column),
            0.0,
            0.1 * data.columns[column].spread,
            any,
        ),
        (Some(column), _) => (Target::Scale(column), 1.0, 0.1, (1e-9, f64::INFINITY)),
        (None, _) => match swept() {
            Some(at) if what == "offset" => {
                let rows = data.curves.iter().flat_map(|curve| &curve.rows);
                let values = rows.map(|row| row.at[at]);
                let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
                    (l.min(v), h.max(v))
                });
                (Target::Place(at), 0.0, 0.05 * (high - low), any)
            }
            _ => {
                let columns = data.columns.iter().map(|c| c.name.as_str());
                let names: Vec<&str> = columns
                    .chain(data.swept.iter().map(|s| s.name.as_str()))
                    .collect();
                return Err(Error::input(
                    format!("{name}: `{of}` is not a column with this correction"),
                    format!("there are {}", names.join(", ")),
                ));
            }
        },
    };
    Ok(Parameter {
        name: name.to_owned(),
        target,
        curve: None,
        start,
        bounds,
        size,
    })
}

/// Sets the bounds of a parameter and moves its initial value between them.
fn bound(
    case: &Case,
    data: &Data,
    parameter: &mut Parameter,
    ends: [&Amount; 2],
) -> Result<(), Error> {
    let read = |amount: &Amount| match parameter.target {
        Target::Key(key) => Ok(case.value(key, amount.text())?),
        Target::Place(at) => Ok(case.value(data.swept[at].key, amount.text())?),
        Target::Offset(column) => {
            let kind = data.columns[column].quantity.kind();
            let kind = kind.filter(|_| case.is_physical());
            let number = amount.text().parse::<f64>().ok();
            match (kind, number) {
                (Some(kind), _) => kind
                    .parse(amount.text())
                    .map_err(|error| Error::input(error.to_string(), "give it with its unit")),
                (None, Some(number)) => Ok(number),
                (None, None) => Err(no_number(amount)),
            }
        }
        Target::Scale(_) => amount.text().parse::<f64>().map_err(|_| no_number(amount)),
    };
    let (low, high) = (read(ends[0])?, read(ends[1])?);
    let (least, most) = parameter.bounds;
    if !(low < high && low <= most && high >= least) {
        return Err(Error::input(
            format!(
                "{}: the bounds {} and {} are not in ascending order",
                parameter.name, ends[0], ends[1]
            ),
            "give the lower bound first",
        ));
    }
    parameter.bounds = (low.max(least), high.min(most));
    parameter.start = parameter
        .start
        .clamp(parameter.bounds.0, parameter.bounds.1);
    parameter.size = parameter.size.min(parameter.bounds.1 - parameter.bounds.0);
    Ok(())
}

fn no_number(amount: &Amount) -> Error {
    Error::input(format!("`{amount}` is not a number"), "give a number")
}
