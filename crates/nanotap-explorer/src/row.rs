//! A motion as a row of the page's list of states: a few numbers, how stable it is, and its film.

use nanotap::case::quantity::Kind;
use nanotap::case::{Case, Key};
use nanotap::model::Model;
use nanotap::observe::table::shown_phase;
use nanotap::observe::{
    Observable, ObservableSet, Observables, OutOfRange, PhysicalMotion, measure, time_series,
};
use nanotap::study::model_limits::limits_of;
use serde_json::{Map, Value, json};

use crate::api_error::ApiError;
use crate::clicks;
use crate::motion::shown_digits;
use crate::motion_request::Start;
use crate::readout::regime;

/// Instants of the film per drive period.
const INSTANTS: usize = 180;
/// Longest film, in drive periods.
const LONGEST: usize = 16;
/// Digits of the numbers in a row.
const DIGITS: usize = 4;
/// The observables of a row.
const READ: [&str; 6] = [
    "first_harmonic",
    "phase",
    "peak_force",
    "indentation",
    "dissipation",
    "contact_fraction",
];

/// A motion that a row shows.
pub(crate) struct RowMotion<'a> {
    /// The case at the distance of the motion.
    pub(crate) case: &'a Case,
    pub(crate) model: &'a Model,
    /// State at drive phase 0.
    pub(crate) state: &'a [f64],
    /// Period in drive periods, if the motion is an orbit.
    pub(crate) period: Option<usize>,
    /// Largest modulus of the multipliers of an orbit.
    pub(crate) radius: Option<f64>,
    /// Class of the motion, such as `periodic` or `chaotic`.
    pub(crate) class: &'static str,
    pub(crate) observables: &'a Observables,
}

/// The row of a motion. Numbers are in SI, or in the model's units of a case without units; texts have
/// four digits and a unit.
pub(crate) fn row(shown: &RowMotion<'_>) -> Result<Value, ApiError> {
    let RowMotion {
        case,
        model,
        state,
        period,
        radius,
        class,
        observables,
    } = *shown;
    let mut row = Map::new();
    for observable in READ.iter().filter_map(|name| Observable::named(name)) {
        let dimension = observable.dimension.kind();
        let unit = dimension.and_then(|kind| case.units().si(kind));
        let value = (observable.of)(observables).number();
        let value = value.map(|value| match observable.name {
            "phase" => shown_phase(value),
            _ => unit.unwrap_or(1.0) * value,
        });
        let text = shown_digits(case, observable, observables, DIGITS);
        row.insert(
            observable.name.to_owned(),
            json!({ "value": value, "shown": text }),
        );
    }
    let length = case.units().si(Kind::Length).unwrap_or(1.0);
    let distance = length * case.get(case.gap_key());
    row.insert("distance".into(), length_json(case, distance));
    let free = case.physical().map(|view| view.free_amplitude);
    let ratio = free
        .filter(|free| *free > 0.0)
        .map(|free| observables.first_harmonic * length / free);
    row.insert("ratio".into(), json!(ratio));
    row.insert("regime".into(), regime(observables).into());
    row.insert("class".into(), class.into());
    row.insert("period".into(), json!(period));
    row.insert(
        "stable".into(),
        json!(radius.is_none_or(|radius| radius < 1.0)),
    );
    row.insert("multiplier".into(), json!(radius));
    row.insert("start".into(), Start::text(period, state).into());
    row.insert("state".into(), json!(state));
    row.insert("unit".into(), length.into());
    if case.is_physical() {
        let mut set = clicks::fixed(case, &[Key::GapTip]);
        set.insert(
            Key::GapTip.path().into(),
            Kind::Length.format_exact(distance).into(),
        );
        row.insert("set".into(), set.into());
    }
    let limits = limits(case, observables, &beyond(shown));
    row.insert("limits".into(), limits.into());
    row.insert("film".into(), film(case, model, state, period)?);
    Ok(row.into())
}

/// Where the model does not hold for a motion, in sentences.
pub(crate) fn limits(case: &Case, observables: &Observables, beyond: &[OutOfRange]) -> Vec<String> {
    let physical = case
        .physical()
        .map(|of| PhysicalMotion::alone(observables, None, of));
    let limits = limits_of(observables, physical.as_ref(), beyond).into_iter();
    limits.map(|remark| remark.text).collect()
}

/// The limits of the law that an orbit violates: how far it goes is not among the observables of every row.
fn beyond(shown: &RowMotion<'_>) -> Vec<OutOfRange> {
    let Some(period) = shown.period.filter(|_| shown.model.nonlinear.is_some()) else {
        return Vec::new();
    };
    let set = OutOfRange::observed_with(shown.model, ObservableSet::NONE);
    let seen = measure(shown.model, shown.state, period, set);
    seen.map_or_else(|_| Vec::new(), |seen| OutOfRange::of(shown.model, &seen))
}

/// A length as a number and as text.
pub(crate) fn length_json(case: &Case, value: f64) -> Value {
    let text = match case.units().si(Kind::Length) {
        Some(_) => Kind::Length.format_digits(value, DIGITS),
        None => Kind::Number.format_digits(value, DIGITS),
    };
    json!({ "value": value, "shown": text })
}

/// Height of the tip above the undeformed sample, height of the surface below it, and force on the tip,
/// instant by instant.
fn film(
    case: &Case,
    model: &Model,
    state: &[f64],
    period: Option<usize>,
) -> Result<Value, ApiError> {
    let periods = period.unwrap_or(LONGEST).min(LONGEST);
    let units = case.units();
    let [length, newton] = [Kind::Length, Kind::Force].map(|kind| units.si(kind).unwrap_or(1.0));
    let modes = model.beam.as_ref().map_or(0, |beam| beam.modes.count());
    let (mut tip, mut surface, mut force) = (vec![], vec![], vec![]);
    time_series::sample(model, state, periods, INSTANTS, |row| {
        let [_, _, _, height, push, touching, state @ ..] = row else {
            return;
        };
        let memory = state.get(2 * modes).filter(|_| model.memory > 0);
        let dent = if *touching > 0.0 {
            height.min(0.0)
        } else {
            memory.map_or(0.0, |s| s.min(0.0))
        };
        tip.push(short(length * height));
        surface.push(short(length * dent));
        force.push(short(newton * push));
    })
    .map_err(ApiError::of)?;
    Ok(json!({ "periods": periods, "tip": tip, "surface": surface, "force": force }))
}

/// A number for a drawing: as many digits as a screen shows.
fn short(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}
