//! The curve over the distance on which the states of the lever lie: approach, retract and branches.

use nanotap::case::quantity::Kind;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::model::Model;
use nanotap::observe::Observables;
use nanotap::observe::table::shown_phase;
use nanotap::study::approach::{ApproachPoint, ApproachReport, ApproachStudy, Way};
use nanotap::study::registry::Study as _;
use nanotap::study::request::read;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::Explorer;
use crate::api_error::ApiError;
use crate::motion_request::model_of;
use crate::preset::CaseSpec;
use crate::states::free;

/// Numbers of distances each way on the curve, before its branches and with them.
const POINTS: [usize; 2] = [40, 60];

/// A request for the curve.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CurveRequest {
    case: CaseSpec,
}

/// The curve in two stages: approach and retract, then all branches.
pub(crate) fn curve(
    app: &Explorer,
    request: &CurveRequest,
    control: &Control<'_>,
    line: &(dyn Fn(Value) + Sync),
) -> Result<(), ApiError> {
    let case = request.case.any_distance(app)?;
    let model = model_of(&case)?;
    for (points, branches) in POINTS.into_iter().zip([false, true]) {
        let options = read(json!({ "points": points, "branches": branches }))?;
        let report = ApproachStudy::run(&case, &options, control)?;
        line(stage(&case, &model, &report));
        if control.is_cancelled() {
            break;
        }
    }
    Ok(())
}

/// What the page keeps of an approach curve. A point is distance, amplitude, phase, peak force,
/// indentation, energy and mean force, in SI or in the model's units, then whether the orbit is stable,
/// and its state.
fn stage(case: &Case, model: &Model, report: &ApproachReport) -> Value {
    let units = case.units();
    let numbers = |gap: f64, seen: &Observables| {
        [
            units.scaled(Kind::Length, gap),
            units.scaled(Kind::Length, seen.first_harmonic),
            shown_phase(seen.phase),
            units.scaled(Kind::Force, seen.peak_force),
            units.scaled(Kind::Length, seen.indentation),
            units.scaled(Kind::Energy, seen.dissipation),
            units.scaled(Kind::Force, seen.mean_force),
        ]
    };
    let leg = |way: Way| {
        let own = report.table.iter().filter(move |point| point.way == way);
        let numbers = |point: &ApproachPoint| Some(numbers(point.gap, point.observables.as_ref()?));
        own.filter_map(numbers).collect::<Vec<_>>()
    };
    let mut branches: Vec<Value> = Vec::new();
    if let Some(found) = &report.branches {
        for (index, branch) in found.branches.iter().enumerate() {
            let own = found.points.iter().filter(|point| point.branch == index);
            let points: Vec<Value> = own
                .map(|point| {
                    let numbers = numbers(point.parameter, &point.observables);
                    json!({ "at": numbers, "stable": point.stable, "state": point.state })
                })
                .collect();
            let own = found.bifurcations.iter().filter(|one| one.branch == index);
            let bifurcations: Vec<Value> = own
                .map(|one| {
                    json!({ "kind": one.kind, "at": numbers(one.parameter, &one.observables) })
                })
                .collect();
            branches.push(json!({
                "period": branch.period,
                "points": points,
                "bifurcations": bifurcations,
            }));
        }
    }
    let key = if case.is_physical() {
        Key::GapTip
    } else {
        case.gap_key()
    };
    json!({
        "key": key.path(),
        "unit": units.si(Kind::Length).unwrap_or(1.0),
        "free": free(case, model),
        "approach": leg(Way::Approach),
        "retract": leg(Way::Retract),
        "branches": report.branches.as_ref().map(|_| branches),
    })
}
