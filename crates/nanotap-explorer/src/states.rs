//! The states of the lever at a setpoint or a distance: the rows of the page.
//!
//! The page keeps the curve on which they lie and asks for the rows near it, so that a moved setpoint
//! needs no approach: each row is closed by Newton from the orbit that the page names, also under other
//! values than those of the curve.

use nanotap::ErrorKind;
use nanotap::case::physical::Held;
use nanotap::case::quantity::Kind;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::model::Model;
use nanotap::observe::table::shown_phase;
use nanotap::study::FreeMotion;
use nanotap::study::orbit::{OrbitOptions, OrbitReport, orbit, spectral_radius};
use nanotap::study::setpoint::{NearOrbit, SetpointSolution, orbit_at_setpoint, solve_setpoint};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::Explorer;
use crate::api_error::ApiError;
use crate::knobs;
use crate::motion_request::model_of;
use crate::preset::CaseSpec;
use crate::row::{RowMotion, length_json, row};

/// Parts in which a case is changed where an orbit is not near at once.
const PARTS: [usize; 3] = [1, 4, 16];

/// A request for the rows.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StatesRequest {
    case: CaseSpec,
    /// Orbits near which the rows are; none: they are searched for.
    #[serde(default)]
    near: Vec<Near>,
    /// The case of these orbits, if it is another one.
    #[serde(default)]
    from: Option<CaseSpec>,
    /// Whether each stable row says if a lever gets there whose drive is switched on.
    #[serde(default)]
    rest: bool,
}

/// An orbit that the page knows.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Near {
    /// In m, or in the model's unit of length.
    distance: f64,
    /// Unit of the entries of the state in m; 1 without units.
    unit: f64,
    period: usize,
    state: Vec<f64>,
    stable: bool,
}

/// The rows of a request: a state, or the reason why there is none near an orbit.
pub(crate) fn states(
    app: &Explorer,
    request: &StatesRequest,
    control: &Control<'_>,
) -> Result<Value, ApiError> {
    let case = request.case.any_distance(app)?.cancelled_by(control);
    let model = model_of(&case)?;
    let from = request.from.as_ref();
    let from = from.map(|from| from.any_distance(app)).transpose()?;
    let held = held(&case);
    let mut rows = if !request.near.is_empty() {
        let near = request.near.iter();
        near.map(|near| followed(from.as_ref().unwrap_or(&case), &case, near).or_else(lost))
            .collect::<Result<Vec<Value>, ApiError>>()?
    } else if held.is_some() {
        let report = solve_setpoint(&case, control)?;
        let solutions = report.solutions.iter();
        solutions
            .map(|solution| of_solution(&case, solution))
            .collect::<Result<_, _>>()?
    } else {
        // A motion without a period is none of these rows; a search finds it.
        match orbit(&model, &OrbitOptions::default()) {
            Ok(found) => vec![of_orbit(&case, &model, &found)?],
            Err(error) if error.kind == ErrorKind::Numerics => Vec::new(),
            Err(error) => return Err(ApiError::of(error)),
        }
    };
    if request.rest {
        for row in rows.iter_mut().filter(|row| row["stable"] == true) {
            row["rest"] = from_rest(&case, row)?.into();
        }
    }
    Ok(json!({ "rows": rows, "held": held, "free": free(&case, &model) }))
}

/// Part of the amplitude by which motions differ that are one.
const SAME: f64 = 1e-6;

/// Whether a run from rest at the distance of a row leads to its orbit.
fn from_rest(case: &Case, row: &Value) -> Result<bool, ApiError> {
    let unit = case.units().si(Kind::Length).unwrap_or(1.0);
    let number = |name: &str| row[name]["value"].as_f64().unwrap_or(f64::NAN);
    let there = case.with(case.gap_key(), number("distance") / unit);
    let found = match orbit(&there.model()?, &OrbitOptions::default()) {
        Ok(found) => found,
        Err(error) if error.kind == ErrorKind::Stopped => return Err(error.into()),
        Err(_) => return Ok(false),
    };
    let [amplitude, force] = [
        (Kind::Length, found.observables.first_harmonic),
        (Kind::Force, found.observables.peak_force),
    ]
    .map(|(kind, value)| case.units().scaled(kind, value));
    let near = |a: f64, b: f64| (a - b).abs() <= SAME * b.abs();
    Ok(near(amplitude, number("first_harmonic")) && near(force, number("peak_force")))
}

/// A row that is missing, unless the work was stopped.
fn lost(error: ApiError) -> Result<Value, ApiError> {
    match error.outcome() {
        crate::Outcome::Stopped => Err(error),
        _ => Ok(json!({ "lost": error.json()["error"] })),
    }
}

/// What the setpoint holds, and its value as a number and as text.
fn held(case: &Case) -> Option<Value> {
    let view = case.physical()?;
    let (kind, value, text) = match view.held? {
        Held::Amplitude(ratio) => {
            let amplitude = Kind::Length.format_digits(ratio * view.free_amplitude, 4);
            ("amplitude", ratio, amplitude)
        }
        Held::PeakForce(force) => ("peak force", force, Kind::Force.format_digits(force, 4)),
        Held::Phase(phase) => ("phase", phase, format!("{phase}°")),
        Held::Shift(shift) => (
            "frequency shift",
            shift,
            Kind::Frequency.format_digits(shift, 4),
        ),
    };
    Some(json!({ "kind": kind, "value": value, "shown": text }))
}

/// The free lever.
pub(crate) fn free(case: &Case, model: &Model) -> Value {
    let free = FreeMotion::of(model);
    let units = case.units();
    json!({
        "amplitude": length_json(case, units.scaled(Kind::Length, free.amplitude)),
        "phase": shown_phase(free.phase),
        "reach": units.scaled(Kind::Length, free.reach),
    })
}

/// The row of the orbit to which a nearby one leads when the values of `from` become those of `case`.
fn followed(from: &Case, case: &Case, near: &Near) -> Result<Value, ApiError> {
    let differs = |key: &Key| {
        let [before, after] = [from, case].map(|case| case.get(*key));
        let varies =
            key.cannot_vary().is_none() && ![Key::GapTip, Key::DriveSetpoint].contains(key);
        varies && before.is_finite() && after.is_finite() && before != after
    };
    let changed: Vec<Key> = knobs::keys(case)
        .filter(|key| !case.is_physical() || case.stated(*key).is_some())
        .filter(differs)
        .collect();
    let mut reason = None;
    for parts in PARTS {
        let mut near = near.clone();
        let mut result = Err(ApiError::failed("no orbit is near"));
        for part in 1..=parts {
            let share = part as f64 / parts as f64;
            let there = changed.iter().fold(case.clone(), |there, &key| {
                let [before, after] = [from, case].map(|case| case.get(key));
                there.with(key, before + share * (after - before))
            });
            let there = if part == parts { case } else { &there };
            result = closed(there, &near);
            match &result {
                Ok(row) => near = next(row)?,
                Err(_) => break,
            }
        }
        match result {
            Ok(row) => return Ok(row),
            Err(error) if error.outcome() == crate::Outcome::Stopped => return Err(error),
            Err(error) => reason = reason.or(Some(error)),
        }
        if changed.is_empty() {
            break;
        }
    }
    Err(reason.unwrap_or_else(|| ApiError::failed("no orbit is near")))
}

/// The orbit of a row, near which the next one is.
fn next(row: &Value) -> Result<Near, ApiError> {
    let fields = json!({
        "distance": row["distance"]["value"],
        "unit": row["unit"],
        "period": row["period"],
        "state": row["state"],
        "stable": row["stable"],
    });
    serde_json::from_value(fields).map_err(|error| ApiError::failed(error.to_string()))
}

/// The row at the setpoint or the distance of a case near an orbit.
fn closed(case: &Case, near: &Near) -> Result<Value, ApiError> {
    let unit = case.units().si(Kind::Length).unwrap_or(1.0);
    let scaled = near.state.iter().map(|entry| entry * near.unit / unit);
    let near = NearOrbit {
        gap: near.distance / unit,
        period: near.period,
        state: scaled.collect(),
        stable: near.stable,
    };
    if case.physical().is_some_and(|view| view.held.is_some()) {
        let solution = orbit_at_setpoint(case, &near)?;
        return of_solution(case, &solution);
    }
    let here = NearOrbit {
        gap: case.get(case.gap_key()),
        ..near
    };
    at_distance(case, &here)
}

fn of_solution(case: &Case, solution: &SetpointSolution) -> Result<Value, ApiError> {
    let there = case.with(case.gap_key(), solution.gap);
    row(&RowMotion {
        case: &there,
        model: &there.model()?,
        state: &solution.state,
        period: Some(solution.period),
        radius: Some(solution.spectral_radius),
        class: "periodic",
        observables: &solution.observables,
    })
}

/// The row of the orbit near one at the distance of a case.
fn at_distance(case: &Case, near: &NearOrbit) -> Result<Value, ApiError> {
    let model = case.model()?;
    let options = OrbitOptions {
        period: Some(near.period),
        state: Some(near.state.clone().into()),
        ..OrbitOptions::default()
    };
    let found = orbit(&model, &options).map_err(ApiError::of)?;
    if found.stable != near.stable {
        return Err(ApiError::failed("no orbit of this stability is near"));
    }
    of_orbit(case, &model, &found)
}

/// The row of an orbit.
pub(crate) fn of_orbit(case: &Case, model: &Model, found: &OrbitReport) -> Result<Value, ApiError> {
    row(&RowMotion {
        case,
        model,
        state: &found.state,
        period: Some(found.period),
        radius: Some(spectral_radius(&found.multipliers)),
        class: "periodic",
        observables: &found.observables,
    })
}
