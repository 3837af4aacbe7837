//! Free parameters of a fit: keys of the case, and corrections of the instrument.
//!
//! `X.offset` is added to the values of a column X: to the positions of its rows, or to the model's
//! values of an observable. `X.scale` multiplies the model's values. `gap.offset` is the offset of
//! the distance. `terms.rs` has the other corrections.

use nanotap_case::{Case, Key};
use nanotap_error::Error;
use nanotap_study::value::{Amount, Interval, Intervals};

use super::data::{self, Data, is_distance};
use super::laws::between;
use super::quantity::Quantity;
use super::statistics::span;
use super::terms::{self, Term};

/// Quantity that a free parameter changes.
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
    /// Term of the instrument in the readings of a column, or in the distance.
    Term(Term, usize),
}

/// A free parameter of a fit.
#[derive(Clone, Debug)]
pub(super) struct Parameter {
    /// Name of the parameter, as in `sample.stiffness` or `gap.offset`.
    pub(super) name: String,
    pub(super) target: Target,
    /// Index of its curve; `None`: all curves.
    pub(super) curve: Option<usize>,
    /// Initial value, in SI or the model's units.
    pub(super) start: f64,
    /// Lower and upper bound, in SI or the model's units; infinite where there is none.
    pub(super) bounds: (f64, f64),
    /// Scale of the range of initial values.
    pub(super) size: f64,
    /// Whether the initial value was given for this fit.
    pub(super) is_given: bool,
    /// Whether its bounds are the limits of what is physical.
    pub(super) is_limited: bool,
    /// Mean and standard deviation of its normal prior.
    pub(super) prior: Option<[f64; 2]>,
}

impl Parameter {
    /// Returns the unit in SI, `1` if there is none.
    pub(super) fn unit(&self, data: &Data, case: &Case) -> String {
        unit(self.target, data, case)
    }

    /// Returns whether this is the name of the parameter, or another name of its key.
    fn is_called(&self, name: &str) -> bool {
        self.name == name || matches!(self.target, Target::Key(key) if Key::find(name) == Some(key))
    }

    /// Returns whether it is one of these keys, with no initial value given.
    pub(super) fn is_unknown_of(&self, keys: &[Key]) -> bool {
        !self.is_given && keys.iter().any(|key| self.target == Target::Key(*key))
    }

    /// Returns whether the parameter applies to a curve.
    pub(super) fn is_of(&self, curve: usize) -> bool {
        self.curve.is_none_or(|own| own == curve)
    }
}

/// Unit of a target in SI, `1` if there is none.
fn unit(target: Target, data: &Data, case: &Case) -> String {
    let of_column = |column: usize| {
        let quantity = data.columns[column].quantity;
        match quantity.kind() {
            Some(_) if !case.is_physical() => "1",
            _ => quantity.unit(true),
        }
    };
    let unit = match target {
        Target::Key(key) => unit_of(key),
        Target::Place(at) => unit_of(data.swept[at].key),
        Target::Scale(_) => "1",
        Target::Offset(column) => of_column(column),
        Target::Term(term, column) => return term.unit(of_column(column), case.is_physical()),
    };
    unit.to_owned()
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
        && (matches!(what, "offset" | "scale") || Term::named(what).is_some())
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
        is_given: false,
        is_limited: false,
        prior: None,
    })
}

pub(super) fn nuisance(
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
        .any(|c| c.quantity.name() == "amplitude");
    let column = Quantity::named(of, own)
        .and_then(|quantity| data.columns.iter().position(|c| c.quantity == quantity));
    let swept = || {
        let key = data::set(of, case).ok()?;
        let same =
            |swept: &data::SweptKey| swept.key == key || is_distance(swept.key) && is_distance(key);
        data.swept.iter().position(same)
    };
    let term = Term::named(what);
    let has_term = match term {
        Some(term) if term.is_of_distance() => swept() == Some(0),
        _ => column.is_some(),
    };
    if let Some(term) = term.filter(|_| has_term) {
        return terms::parameter(case, data, name, (term, column.unwrap_or(0)));
    }
    let (target, start, size, bounds) = match (column, what) {
        (Some(column), "offset") => (
            Target::Offset(column),
            0.0,
            0.1 * data.columns[column].spread,
            any,
        ),
        (Some(column), "scale") => (Target::Scale(column), 1.0, 0.1, (1e-9, f64::INFINITY)),
        _ => match swept() {
            Some(at) if what == "offset" => {
                let rows = data.curves.iter().flat_map(|curve| &curve.rows);
                let values = rows.map(|row| row.at[at]);
                let [low, high] = span(values);
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
        is_given: false,
        is_limited: false,
        prior: None,
    })
}

/// A value of a parameter in SI or the model's units.
fn read(case: &Case, data: &Data, target: Target, text: &str) -> Result<f64, Error> {
    let number = || {
        text.trim()
            .parse::<f64>()
            .map_err(|_| Error::input(format!("expected a number, got `{text}`"), "give a number"))
    };
    match target {
        Target::Key(key) => Ok(case.value(key, text)?),
        Target::Place(_) | Target::Term(Term::Period | Term::Drift | Term::Backlash, _) => {
            Ok(case.value(data.swept[0].key, text)?)
        }
        Target::Term(Term::Tilt | Term::Curvature, _) => {
            let unit = unit(target, data, case);
            let text = text.trim();
            let bare = text.strip_suffix(unit.as_str()).unwrap_or(text).trim();
            bare.parse::<f64>().or_else(|_| number()).map_err(|_| {
                Error::input(
                    format!("expected a number in {unit}, got `{text}`"),
                    "give it in SI",
                )
            })
        }
        Target::Offset(column) | Target::Term(_, column) => {
            let quantity = data.columns[column].quantity;
            match quantity.kind().filter(|_| case.is_physical()) {
                Some(kind) => kind
                    .parse(text)
                    .map_err(|error| Error::input(error.to_string(), "give it with its unit")),
                None if quantity.is_angle() => {
                    let text = text.trim_end_matches(['°', ' ']).trim_end_matches("deg");
                    text.trim().parse::<f64>().map_err(|_| {
                        Error::input(format!("expected degrees, got `{text}`"), "give a number")
                    })
                }
                None => number(),
            }
        }
        Target::Scale(_) => number(),
    }
}

/// Sets the bounds of a parameter; an initial value beyond them moves to their middle.
fn bound(
    case: &Case,
    data: &Data,
    parameter: &mut Parameter,
    ends: [&Amount; 2],
) -> Result<(), Error> {
    let [low, high] = ends.map(|end| read(case, data, parameter.target, end.text()));
    let (low, high) = (low?, high?);
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
    let (low, high) = parameter.bounds;
    if !(low..=high).contains(&parameter.start) {
        parameter.start = match (low.is_finite(), high.is_finite()) {
            (true, true) => between(low, high),
            _ => parameter.start.clamp(low, high),
        };
    }
    parameter.size = parameter.size.min(high - low);
    Ok(())
}

/// Limits of what is physical, in SI: beyond them a fit has found something else than the sample.
const PHYSICAL: [(Key, f64, f64); 11] = [
    (Key::TipRadius, 1e-10, 1e-3),
    (Key::TipModulus, 1e4, 1e13),
    (Key::SampleModulus, 1.0, 1e13),
    (Key::SampleStiffness, 0.0, 1e7),
    (Key::SampleDamping, 0.0, 1e3),
    (Key::SampleLossTangent, 0.0, 1e3),
    (Key::SampleHamaker, -1e-19, 1e-17),
    (Key::SampleWorkOfAdhesion, 0.0, 1e2),
    (Key::SampleAdhesionForce, 0.0, 1e-3),
    (Key::SampleIntermolecularDistance, 1e-11, 1e-7),
    (Key::SampleViscosity, 0.0, 1e9),
];

/// Limits parameters that have no bounds of their own to physical values, if they start there. An
/// attraction stays one: in addition to the minimum of chi2 with the right attraction there is often
/// a second one with a repulsion.
pub(super) fn keep_physical(parameters: &mut [Parameter], bounds: &Intervals) {
    for parameter in parameters {
        let own = bounds
            .0
            .iter()
            .any(|bound| parameter.is_called(&bound.name));
        let limits = PHYSICAL
            .iter()
            .find(|(key, ..)| parameter.target == Target::Key(*key));
        let Some((_, low, high)) = limits.filter(|_| !own) else {
            continue;
        };
        let attracts = parameter.target == Target::Key(Key::SampleHamaker) && parameter.start > 0.0;
        let low = if attracts { &0.0 } else { low };
        if (*low..=*high).contains(&parameter.start) {
            let (least, most) = parameter.bounds;
            parameter.bounds = (low.max(least), high.min(most));
            parameter.is_limited = true;
        }
    }
}

/// A name and the text of its value.
pub(super) type Start = (String, String);

/// Initial values and fixed corrections, each of the form `NAME=VALUE`.
pub(super) fn starts(given: &[String]) -> Result<Vec<Start>, Error> {
    let parse = |text: &String| match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => {
            Ok((name.trim().to_owned(), value.trim().to_owned()))
        }
        _ => Err(Error::option(
            "start",
            format!("expected NAME=VALUE, got `{text}`"),
            "write it as in gap.offset=\"10.3 nm\"",
        )),
    };
    given.iter().map(parse).collect()
}

/// Sets the initial values of free parameters.
pub(super) fn begin(
    case: &Case,
    data: &Data,
    parameters: &mut [Parameter],
    starts: &[Start],
) -> Result<(), Error> {
    for (name, text) in starts {
        for parameter in parameters.iter_mut().filter(|p| p.is_called(name)) {
            let value = read(case, data, parameter.target, text).map_err(|e| e.at("start"))?;
            let (low, high) = parameter.bounds;
            if !(low..=high).contains(&value) {
                return Err(Error::option(
                    "start",
                    format!("{name} = {text} is not within its bounds"),
                    "give a value between {bounds}",
                ));
            }
            parameter.start = value;
            parameter.is_given = true;
            if let Target::Key(_) = parameter.target {
                parameter.size = value.abs();
            }
        }
    }
    Ok(())
}

/// Corrects the data by the values that are not of a free parameter, and says how.
pub(super) fn correct(
    case: &Case,
    data: &mut Data,
    starts: &[Start],
    is_free: impl Fn(&str) -> bool,
) -> Result<Vec<String>, Error> {
    let mut notes = Vec::new();
    let mut fixed = Vec::new();
    let is_scale = |name: &str| {
        name.rsplit_once('.')
            .is_some_and(|(_, what)| what == "scale")
    };
    let given = || starts.iter().filter(|(name, _)| !is_free(name));
    // A reading is the scaled value with its offset and terms: these are taken off first.
    let first = given().filter(|(name, _)| !is_scale(name));
    for (name, text) in first.chain(given().filter(|(name, _)| is_scale(name))) {
        let target = match name.rsplit_once('.') {
            Some((of, what))
                if matches!(what, "offset" | "scale") || Term::named(what).is_some() =>
            {
                nuisance(case, data, name, of, what)
                    .map_err(|e| e.at("start"))?
                    .target
            }
            _ => {
                return Err(Error::option(
                    "start",
                    format!("{name} is neither free nor a correction of a column"),
                    format!("set it in the case, or name it in {{free}}: {name}"),
                ));
            }
        };
        let value = read(case, data, target, text).map_err(|e| e.at("start"))?;
        if let (Target::Scale(_), true) = (target, value <= 0.0) {
            return Err(Error::option(
                "start",
                format!("expected a factor above zero, got {text}"),
                "give one as in amplitude.scale=1.02",
            ));
        }
        if let Target::Term(term, column) = target {
            fixed.push((term, column, value));
            notes.push(format!("corrected as stated: {name}={text}"));
            continue;
        }
        if let Target::Scale(_) = target {
            data.correct_terms(case, &std::mem::take(&mut fixed));
        }
        for row in data.curves.iter_mut().flat_map(|curve| &mut curve.rows) {
            match target {
                Target::Place(at) => row.at[at] += value,
                Target::Offset(column) => {
                    row.values[column] = row.values[column].map(|of| of - value);
                }
                Target::Scale(column) => {
                    row.values[column] = row.values[column].map(|of| of / value);
                    row.errors[column] = row.errors[column].map(|of| of / value);
                }
                Target::Key(_) | Target::Term(..) => {}
            }
        }
        if let Target::Scale(column) = target {
            data.columns[column].spread /= value;
        }
        notes.push(format!("corrected as stated: {name}={text}"));
    }
    data.correct_terms(case, &fixed);
    Ok(notes)
}
