//! Fig. 2f: does another part of the beam than its tip touch the sample? The paper assumes that it
//! does not and states that its cases were chosen accordingly.

use super::check::digits;
use super::damped_limit::response;
use super::runs::Runs;
use super::section::{Section, Table};
use super::{PaperError, rerun};
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::parameter::Parameter;
use nanotap::observe::Clearance;

/// Drive periods over which a motion that does not repeat is observed.
const OBSERVED_PERIODS: usize = 400;

struct Row {
    figure: &'static str,
    motion: String,
    case: Cantilever,
    state: Vec<f64>,
    periods: usize,
    clearance: Clearance,
}

/// Computes the section on Fig. 2f: whether other parts of the beam touch the sample.
pub(super) fn section(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let mut rows = Vec::new();
    let undamped = Cantilever::paper_eq24();
    let (model, orbit) = response(&undamped)?;
    rows.extend(row(
        "Fig. 4",
        "periodic response".into(),
        &undamped,
        &model,
        &orbit.state,
        1,
    )?);
    for (figure, omega, alpha1) in [
        ("Figs. 6, 7", 2.6, 0.1),
        ("Figs. 8–14", 20.0, 0.1),
        ("Figs. 15–17", 20.0, 0.0),
        ("Figs. 15–17, text", 2.6, 0.0),
    ] {
        let case = Cantilever::paper()
            .with(Parameter::Omega, omega)
            .with(Parameter::Alpha1, alpha1);
        let counted = runs.count(&case)?;
        for (orbit, _) in counted.all_stable() {
            let motion = format!("period {}", orbit.period);
            rows.extend(row(
                figure,
                motion,
                &case,
                &counted.model,
                &orbit.states[0],
                orbit.period,
            )?);
        }
        for chaos in counted.chaos() {
            let watched = runs.either(OBSERVED_PERIODS, 50);
            rows.extend(row(
                figure,
                "chaos".into(),
                &case,
                &counted.model,
                chaos.state,
                watched,
            )?);
        }
    }
    let mut table = Table::new(
        "Least height V(ξ, τ) of the beam above the sample, in units of g₀, over each motion (N = 3)",
        [
            "figure",
            "Ω",
            "α₁",
            "motion",
            "least height",
            "at ξ",
            "verdict",
        ],
    );
    for r in &rows {
        let verdict = if r.clearance.touches() {
            "the beam would touch"
        } else {
            "only the tip touches"
        };
        table.row([
            r.figure.into(),
            r.case.omega.to_string(),
            r.case.alpha1.to_string(),
            r.motion.clone(),
            digits(r.clearance.height, 4),
            digits(r.clearance.xi, 3),
            verdict.into(),
        ]);
    }
    let touching: Vec<&Row> = rows.iter().filter(|r| r.clearance.touches()).collect();
    let here = if touching.is_empty() {
        format!("true for all {} motions shown here", rows.len())
    } else {
        let list: Vec<String> = touching
            .iter()
            .map(|r| {
                format!(
                    "{} at Ω = {}, α₁ = {} ({} at ξ = {})",
                    r.motion,
                    r.case.omega,
                    r.case.alpha1,
                    digits(r.clearance.height, 3),
                    digits(r.clearance.xi, 2)
                )
            })
            .collect();
        format!("not true for {}", list.join(", "))
    };
    let shown = touching.first().copied().or(rows.first());
    let again = shown.map_or_else(
        || rerun::section("fig2f"),
        |r| {
            rerun::on_case(
                "simulate",
                &r.case,
                &format!(
                    "--transient 0 --periods {} {}",
                    r.periods,
                    rerun::state(&r.state)
                ),
            )
        },
    );
    Ok(section
        .text(
            "Where the beam's height V(ξ, τ) = W(ξ, τ) + α₂ sin Ωτ + 1 becomes zero, a part other than the tip \
             is in contact and the model is not valid. With α₅ = 0 the length of the tip is g₀: if the tip indents \
             the sample by its whole length, the end of the beam touches the sample.",
        )
        .check(
            "fig2f",
            touching.len(),
            here,
            "least height over the whole beam and the whole motion, from the closed form (table)",
            again,
        )
        .table(table))
}

fn row(
    figure: &'static str,
    motion: String,
    case: &Cantilever,
    model: &Model,
    state: &[f64],
    periods: usize,
) -> Result<Option<Row>, PaperError> {
    let clearance =
        Clearance::of(model, state, periods).map_err(PaperError::failed(motion.clone()))?;
    Ok(clearance.map(|clearance| Row {
        figure,
        motion,
        case: case.clone(),
        state: state.to_vec(),
        periods,
        clearance,
    }))
}
