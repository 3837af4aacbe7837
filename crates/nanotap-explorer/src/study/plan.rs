//! Where every motion meets the conditions of an experiment.

use nanotap::figure::window::figure as window_figure;
use nanotap::study::window::Window;
use serde_json::json;

use super::{Stage, Studied, object, progress};
use crate::api_error::ApiError;
use crate::clicks::{self, Axis};
use crate::forms;

/// Numbers of values along each axis in the stages of a plan.
const PLAN: [usize; 3] = [4, 8, 16];
/// Initial states at each point of a plan.
pub(super) const PLAN_STARTS: usize = 4;

impl Studied<'_> {
    /// Finds where, over two parameters, every motion meets the conditions of the form.
    pub(super) fn plan(&self) -> Result<(), ApiError> {
        let case = self.request.case.any_distance(self.app)?;
        let wanted = self.conditions()?;
        self.stages(&PLAN, |count, finest| {
            let over = [self.over(&case, "1", count)?, self.over(&case, "2", count)?];
            let texts: Vec<&String> = over.iter().map(|(text, _)| text).collect();
            let options = object(json!({ "over": texts, "starts": PLAN_STARTS, "where": wanted }));
            let [x, y] = [&over[0].1, &over[1].1].map(|over| Axis::of(over).json());
            let fixed = clicks::fixed(&case, &[over[0].1.key, over[1].1.key]);
            let (figure, safe) = self.staged(&case, "window", &options, |store| {
                let window = Window::of(store).map_err(ApiError::of)?;
                Ok((window_figure(store).map_err(ApiError::of)?, window.targets))
            })?;
            let safe = safe.map_or_else(String::new, |targets| {
                format!("; all conditions hold at {:.0} %", 100.0 * targets.share)
            });
            self.hand(Stage {
                figure: Some(figure),
                clicks: json!({ "set": { "x": x, "y": y }, "fixed": fixed }),
                words: progress(count.pow(2), finest.pow(2), "points") + &safe,
                studies: &[("window", &options)],
                ..Stage::default()
            })
        })
    }

    /// The conditions of the form.
    pub(super) fn conditions(&self) -> Result<Vec<String>, ApiError> {
        let mut wanted = Vec::new();
        if let Ok(force) = self.field("force") {
            let sign = if self.field("want").is_ok() {
                "<="
            } else {
                "<"
            };
            wanted.push(format!("F_max {sign} {force}"));
        }
        // The view Plan asks in other words than the form.
        if let Ok(want) = self.field("want") {
            wanted.extend(forms::wish(want)?.map(str::to_owned));
            return Ok(wanted);
        }
        match self.field("regime")? {
            forms::ANY => {}
            regime => wanted.push(format!("regime = {regime}")),
        }
        if self.field("states")? == forms::ONE_STATE {
            wanted.push("states = 1".to_owned());
        }
        Ok(wanted)
    }
}
