//! What upsets a state of the lever: a knock, and a drive of another frequency or amplitude.

use nanotap::case::physical::Held;
use nanotap::case::quantity::Kind;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::observe::ObservableSet;
use nanotap::study::branch::{BranchOptions, BranchStudy};
use nanotap::study::orbit::{OrbitOptions, OrbitStudy};
use nanotap::study::registry::Study as _;
use nanotap::study::setpoint::{NearOrbit, end_at_setpoint};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::Explorer;
use crate::api_error::ApiError;
use crate::forms::quality_factor;
use crate::motion_request::Start;
use crate::preset::CaseSpec;

/// A request for what upsets a state.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StateRequest {
    /// The case at the distance of the state.
    case: CaseSpec,
    start: String,
    /// The case with its setpoint, if the feedback holds one.
    #[serde(default)]
    held: Option<CaseSpec>,
}

/// The smallest knock found, as a speed and as a share of the tip's own speed; the largest one tried, if
/// none upsets the state.
pub(crate) fn knock(
    app: &Explorer,
    request: &StateRequest,
    control: &Control<'_>,
) -> Result<Value, ApiError> {
    let case = request.case.case(app, control)?;
    let start = Start::parse(&request.start)?;
    let options = OrbitOptions {
        period: start.period,
        state: start.state.map(Into::into),
        upset: true,
        ..OrbitOptions::default()
    };
    let found = OrbitStudy::run(&case, &options, control)?.motion;
    let own = case.omega() * found.observables.amplitude;
    let units = case.units();
    let shown = |speed: f64| match units.si(Kind::Velocity) {
        Some(unit) => Kind::Velocity.format_digits(unit * speed, 3),
        None => Kind::Number.format_digits(speed, 3),
    };
    let Some(knocks) = &found.upset else {
        return Ok(json!({}));
    };
    Ok(match &knocks.smallest {
        Some(smallest) => json!({
            "speed": shown(smallest.tip_speed.abs()),
            "share": smallest.tip_speed.abs() / own,
        }),
        None => json!({ "none": shown(knocks.largest_tried) }),
    })
}

/// Range of the free amplitude in which a state is followed, over its value.
const AMPLITUDES: [f64; 2] = [0.1, 3.0];
/// Largest change of the frequency, over its value; less in a narrow resonance.
const DETUNED: f64 = 0.25;
/// The same in widths of the resonance.
const WIDTHS: f64 = 4.0;
/// Orbits up to which a state is followed.
const MARGIN_POINTS: usize = 400;

/// How far frequency and free amplitude may change before the state ends: by key the values at which it
/// does, or null where it goes on to the end of what is followed. A setpoint is held by the distance, its
/// amplitude in m; `held` says so. Without one, or with one of a frequency shift, the distance is held.
pub(crate) fn margins(
    app: &Explorer,
    request: &StateRequest,
    control: &Control<'_>,
) -> Result<Value, ApiError> {
    let case = request.case.case(app, control)?;
    let start = Start::parse(&request.start)?;
    let Some(view) = case.physical() else {
        return Ok(json!({}));
    };
    let held = request.held.as_ref().map(|held| held.any_distance(app));
    let held = held.transpose()?.map(|held| held.cancelled_by(control));
    let setpoint = |held: &Case| held.physical().and_then(|view| view.held);
    let held = held.filter(|held| !matches!(setpoint(held), None | Some(Held::Shift(_))));
    let detuned = (WIDTHS / quality_factor(view)).min(DETUNED);
    let ranges = [
        (Key::DriveFrequency, [1.0 - detuned, 1.0 + detuned]),
        (Key::DriveFreeAmplitude, AMPLITUDES),
    ];
    let mut margins = serde_json::Map::new();
    for (key, range) in ranges {
        let value = case.get(key);
        if case.stated(key).is_none() || value <= 0.0 {
            continue;
        }
        let end = |factor: f64| match &held {
            Some(held) => end_of_held(held, &case, key, factor * value, &start, control),
            None => end_of_state(&case, key, factor * value, &start, control),
        };
        let ends = range.map(end).into_iter().collect::<Result<Vec<_>, _>>()?;
        let digits = if held.is_some() { 5 } else { 4 };
        let shown = |end: &Option<f64>| end.map(|end| key.kind().format_digits(end, digits));
        let ends: Vec<_> = ends.iter().map(shown).collect();
        margins.insert(key.path().into(), json!(ends));
    }
    if held.is_some() {
        margins.insert("held".into(), json!("setpoint"));
    }
    Ok(margins.into())
}

/// The value of a key at which a state ends on the way to another value, while the setpoint of `held` is
/// held; `case` is at the distance of the state.
fn end_of_held(
    held: &Case,
    case: &Case,
    key: Key,
    to: f64,
    start: &Start,
    control: &Control<'_>,
) -> Result<Option<f64>, ApiError> {
    let Some(state) = &start.state else {
        return Err(ApiError::input("the state is missing", "choose a state"));
    };
    let unit = |case: &Case| case.units().si(Kind::Length).unwrap_or(1.0);
    let ratio = unit(case) / unit(held);
    let near = NearOrbit {
        gap: case.get(case.gap_key()) * ratio,
        period: start.period.unwrap_or(1),
        state: state.iter().map(|entry| entry * ratio).collect(),
        stable: true,
    };
    let end = end_at_setpoint(held, &near, key, to, control).map_err(ApiError::of)?;
    Ok(end.map(|[last, _]| last))
}

/// The value of a key at which a state ends on the way to another value.
fn end_of_state(
    case: &Case,
    key: Key,
    to: f64,
    start: &Start,
    control: &Control<'_>,
) -> Result<Option<f64>, ApiError> {
    let options = BranchOptions {
        period: start.period,
        state: start.state.clone().map(Into::into),
        grazings: false,
        max_points: MARGIN_POINTS,
        observables: ObservableSet::NONE,
        ..BranchOptions::over(key, case.get(key), to)
    };
    let report = BranchStudy::run(case, &options, control)?;
    let mut own = report.points.iter().filter(|point| point.branch == 0);
    let mut last = own.next().map_or(f64::NAN, |point| point.parameter);
    for point in own {
        if !point.stable {
            let between = |at: &f64| {
                let slack = (point.parameter - last).abs();
                (at - last).abs() <= 2.0 * slack + f64::EPSILON * last.abs()
            };
            let located = report.bifurcations.iter().filter(|one| one.branch == 0);
            let end = located.map(|one| one.parameter).find(between);
            return Ok(Some(end.unwrap_or(last)));
        }
        last = point.parameter;
    }
    Ok(None)
}
