//! Approach curves.

use nanotap::case::quantity::Kind;
use nanotap::case::{Case, Key};
use nanotap::figure::approach::approach_figure;
use nanotap::study::Study as _;
use nanotap::study::approach::{ApproachReport, ApproachStudy};
use nanotap_figures::Figure;
use serde_json::json;

use super::{Stage, Studied, object, progress};
use crate::api_error::ApiError;
use crate::clicks::{self, Axis, Height};
use crate::report;

/// Numbers of distances in each direction in the stages of an approach curve.
pub(super) const APPROACH: [usize; 2] = [40, 150];
/// Observables in the panels of an approach curve.
pub(super) const APPROACH_SHOWS: [&str; 4] =
    ["first_harmonic", "phase", "dissipation", "peak_force"];

impl Studied<'_> {
    pub(super) fn approach(&self) -> Result<(), ApiError> {
        let case = self.request.case.any_distance(self.app)?;
        self.stages(&APPROACH, |points, finest| {
            let branches = points == finest;
            let mut options = object(json!({ "points": points, "branches": branches }));
            for end in ["from", "to"] {
                if let Ok(text) = self.field(end) {
                    options.insert(end.into(), text.into());
                }
            }
            let found = self.report::<ApproachStudy>(&case, &options)?;
            let units = case.units();
            let drawn = Approached::of(&case, &found);
            let near = clicks::of_approach(&found, drawn.factor, &drawn.heights, &units);
            self.hand(Stage {
                clicks: json!({
                    "set": { "x": drawn.axis.json() },
                    "near": near,
                    "heights": clicks::of_heights(&drawn.heights, &units),
                    "fixed": clicks::fixed(&case, &[drawn.axis.key]),
                }),
                figure: Some(drawn.figure),
                words: progress(points, finest, "distances each way"),
                remarks: ApproachStudy::remarks(&case, &found),
                studies: &[("approach", &options)],
                tables: vec![report::of_frame(
                    "motions on the curve",
                    &found.motion_table(units),
                )],
                ..Stage::default()
            })
        })
    }
}

/// An approach curve as drawn.
pub(super) struct Approached {
    pub(super) figure: Figure,
    pub(super) axis: Axis,
    /// From distances in the model's unit to drawn ones.
    factor: f64,
    heights: Vec<Height>,
}

impl Approached {
    pub(super) fn of(case: &Case, report: &ApproachReport) -> Self {
        let units = case.units();
        let (factor, unit) = units.axis(Kind::Length, report.from.abs().max(report.to.abs()));
        let axis = match units.si(Kind::Length) {
            Some(metres) => Axis {
                key: Key::GapTip,
                factor: factor / metres,
                unit,
            },
            None => Axis {
                key: case.gap_key(),
                factor,
                unit: String::new(),
            },
        };
        let figure = approach_figure(report, &units);
        let heights = Height::of(&figure, &APPROACH_SHOWS);
        Self {
            figure,
            axis,
            factor,
            heights,
        }
    }
}
