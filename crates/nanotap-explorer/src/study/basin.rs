//! Basins of attraction.

use nanotap::figure::basin::figure as basin_figure;
use nanotap::observe::time_series::state_names;
use nanotap_figures::{Axis as Axes, Panel};
use serde_json::{Value, json};

use super::{Stage, Studied, object, progress};
use crate::api_error::ApiError;
use crate::clicks;
use crate::motion_request::Start;

/// Numbers of points along each axis in the stages of a basin.
const BASIN: [usize; 4] = [12, 40, 120, 300];

impl Studied<'_> {
    pub(super) fn basin(&self) -> Result<(), ApiError> {
        let (case, model) = self.case()?;
        let names = state_names(&model);
        let origin = Start::parse(&self.request.start)?.state;
        let side = |which: &str, count| -> Result<(String, String), ApiError> {
            let [entry, from, to] =
                ["entry", "from", "to"].map(|part| self.field(&format!("{part}{which}")));
            let entry = entry?.to_owned();
            let range = format!("{entry}={}:{}:{count}", from?, to?);
            Ok((entry, range))
        };
        self.stages(&BASIN, |count, finest| {
            let ((x, x_range), (y, y_range)) = (side("x", count)?, side("y", count)?);
            let mut options = object(json!({ "x": x_range, "y": y_range }));
            if let Some(state) = &origin {
                options.insert("state".into(), json!(state));
            }
            // A click starts a run there: the state of the slice with two entries replaced.
            let start: Vec<Value> = names
                .iter()
                .enumerate()
                .map(|(k, name)| match name {
                    name if *name == x => json!({ "axis": "x" }),
                    name if *name == y => json!({ "axis": "y" }),
                    _ => json!(origin.as_ref().and_then(|s| s.get(k)).unwrap_or(&0.0)),
                })
                .collect();
            let figure = self.staged(&case, "basin", &options, |store| {
                basin_figure(store).map_err(ApiError::of)
            })?;
            let panel = figure.panels.first();
            let factor = |name: &str, axis: fn(&Panel) -> &Axes| {
                panel.map_or(1.0, |panel| {
                    clicks::of_entry(&case.units(), name, axis(panel))
                })
            };
            let factors = json!({ "x": factor(&x, |p| &p.x), "y": factor(&y, |p| &p.y) });
            self.hand(Stage {
                figure: Some(figure),
                clicks: json!({ "start": start, "factors": factors }),
                words: progress(count, finest, "points each way"),
                studies: &[("basin", &options)],
                ..Stage::default()
            })
        })
    }
}
