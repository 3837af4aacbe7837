//! All coexisting motions, each with a state that starts it.

use nanotap::case::Case;
use nanotap::case::physical::Kind;
use nanotap::case::units::Units;
use nanotap::control::Control;
use nanotap::model::Model;
use nanotap::observe::Observables;
use nanotap::study::attractors::{Attractors, AttractorsOptions, AttractorsStudy};
use nanotap::study::orbit::OrbitReport;
use nanotap::study::registry::Study as _;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::Explorer;
use crate::api_error::ApiError;
use crate::motion_request::{Start, model_of};
use crate::preset::CaseSpec;
use crate::readout::regime;
use crate::row::{RowMotion, row};
use crate::states::of_orbit;

/// Longest period of the unstable orbits that are searched for.
const UNSTABLE: usize = 4;

/// A census as requested by the page.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Census {
    case: CaseSpec,
    #[serde(default)]
    unstable: bool,
}

/// The motions that coexist.
pub(crate) fn listed(
    app: &Explorer,
    census: &Census,
    control: &Control<'_>,
) -> Result<Value, ApiError> {
    let case = census.case.case(app, control)?;
    let model = model_of(&case)?;
    let request = AttractorsOptions {
        unstable: if census.unstable { UNSTABLE } else { 0 },
        ..AttractorsOptions::default()
    };
    let found = AttractorsStudy::run(&case, &request, control)?;
    let mut motions: Vec<Value> = Vec::new();
    for one in &found.attractors {
        let share = format!("{:.2} % of the initial states", 100.0 * one.share.fraction);
        let mut entry = if let Some(orbit) = &one.orbit {
            entry(&case, &model, orbit, None, &share)?
        } else if let Some(recorded) = &one.non_periodic {
            let class = one.classification.name();
            json!({
                "words": format!("{class}, {share}"),
                "start": Start::text(None, &recorded.state),
                "amplitude": recorded.observables.amplitude,
                "shown": shown_observables(&recorded.observables, &case.units()),
                "exponent": one.lyapunov.first(),
                "row": row(&RowMotion {
                    case: &case,
                    model: &model,
                    state: &recorded.state,
                    period: None,
                    radius: None,
                    class,
                    observables: &recorded.observables,
                })?,
            })
        } else {
            continue;
        };
        entry["share"] = one.share.fraction.into();
        motions.push(entry);
    }
    for orbit in found.unstable.iter().flatten() {
        let orbit = &orbit.motion;
        motions.push(entry(&case, &model, orbit, Some(orbit.period), "unstable")?);
    }
    Ok(json!({
        "motions": motions,
        "bound": bound(&found),
        "starts": found.starts,
        "unseen": found.unseen.as_ref().map(|unseen| unseen.fraction),
        "undecided": found.undecided_fraction.count,
        "unbounded": found.unbounded.count,
    }))
}

/// The amplitude and the peak force of a lever, as an instrument reads them; without units half of
/// peak to peak, which differs between motions of other periods too.
fn shown_observables(observables: &Observables, units: &Units) -> String {
    let text = |kind: Kind, value: f64| match units.si(kind) {
        Some(unit) => kind.format_digits(unit * value, 4),
        None => Kind::Number.format_digits(value, 4),
    };
    if units.si(Kind::Force).is_none() {
        let half = text(Kind::Length, observables.amplitude);
        return format!("half of peak to peak {half}");
    }
    let amplitude = text(Kind::Length, observables.first_harmonic);
    let force = text(Kind::Force, observables.peak_force);
    format!("amplitude A {amplitude}, peak force {force}")
}

/// A motion of the list.
fn entry(
    case: &Case,
    model: &Model,
    orbit: &OrbitReport,
    period: Option<usize>,
    remark: &str,
) -> Result<Value, ApiError> {
    Ok(json!({
        "words": format!("period {}, {}, {remark}", orbit.period, regime(&orbit.observables)),
        "start": Start::text(period, &orbit.state),
        "period": orbit.period,
        "stable": orbit.stable,
        "amplitude": orbit.observables.amplitude,
        "shown": shown_observables(&orbit.observables, &case.units()),
        "row": of_orbit(case, model, orbit)?,
    }))
}

/// Text on how many motions may be missing.
fn bound(found: &Attractors) -> String {
    let unseen = found.unseen.as_ref().map(|unseen| {
        format!(
            "with 95 % confidence at most {:.2} % of them lead elsewhere",
            100.0 * unseen.fraction
        )
    });
    let counted = |count: usize, what: &str| (count > 0).then(|| format!("{count} {what}"));
    let parts = [
        Some(format!("{} initial states", found.starts)),
        unseen,
        counted(found.undecided_fraction.count, "undecided"),
        counted(found.unbounded.count, "unbounded"),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
}
