//! Motions over one or two parameters, and the branches through them.

use nanotap::case::Case;
use nanotap::dataset::Store;
use nanotap::figure::branch::{PlottedQuantity, case_figure};
use nanotap::figure::sweep::{figure as sweep_figure, response as response_figure};
use nanotap::study::branch::{BranchReport, BranchStudy};
use nanotap::study::sweep::Over;
use nanotap_figures::Figure;
use serde_json::{Map, Value, json};

use super::{Computed, Stage, Studied, object, progress};
use crate::api_error::ApiError;
use crate::clicks::{self, Axis, Height};
use crate::maps::{self, Shows};

/// Numbers of values of the parameter in the stages of a diagram.
const DIAGRAM: [usize; 3] = [30, 120, 400];
/// Numbers of values along each axis in the stages of a map.
const MAP: [usize; 3] = [8, 20, 48];
/// Numbers of values with a census in the stages of a diagram of branches.
const BRANCHES: [usize; 2] = [5, 15];
/// Number of values with a census for branches that are drawn over another figure.
const OVERLAID: usize = 7;
/// Initial states at each value of a diagram, and of a map.
const STARTS: (usize, usize) = (6, 3);
/// Drive periods recorded at each value.
const RECORDED: usize = 32;

impl Studied<'_> {
    pub(super) fn diagram(&self) -> Result<(), ApiError> {
        self.sweep(&DIAGRAM, STARTS.0, false)
    }

    pub(super) fn resonance(&self) -> Result<(), ApiError> {
        self.sweep(&DIAGRAM[..2], 0, true)
    }

    /// A diagram or a resonance curve, then the branches over it.
    fn sweep(&self, counts: &[usize], starts: usize, response: bool) -> Result<(), ApiError> {
        let (case, _) = self.case()?;
        let (draw, names): (fn(&Store) -> _, &[&str]) = if response {
            (response_figure, &["first_harmonic", "phase"])
        } else {
            (sweep_figure, &["tip_max"])
        };
        self.stages(counts, |count, finest| {
            let (text, over) = self.over(&case, "", count)?;
            let mut options = object(json!({ "over": [text], "periods": RECORDED, "strobe": 1 }));
            if response {
                options.insert("follow".into(), "both".into());
            } else {
                options.insert("starts".into(), starts.into());
            }
            let x = Axis::of(&over);
            let (mut figure, mut near) = self.staged(&case, "sweep", &options, |store| {
                let figure = draw(store).map_err(ApiError::of)?;
                let heights = Height::of(&figure, names);
                let near = clicks::in_sweep(store, &x, &heights, response).map_err(ApiError::of)?;
                Ok((figure, near))
            })?;
            let heights = clicks::of_heights(&Height::of(&figure, names), &case.units());
            let fixed = clicks::fixed(&case, &[over.key]);
            let hand = |figure: &Figure, near: &[Value], words, studies: &[Computed<'_>]| {
                self.hand(Stage {
                    figure: Some(figure.clone()),
                    clicks: json!({ "set": { "x": x.json() }, "near": near, "fixed": fixed, "heights": heights }),
                    words,
                    studies,
..Stage::default()
                })
            };
            let swept = ("sweep", &options);
            if count < finest {
                return hand(&figure, &near, progress(count, finest, "values"), &[swept]);
            }
            let words = format!("{count} values; following branches …");
            hand(&figure, &near, words, &[swept])?;
            if self.control.is_cancelled() {
                return Ok(());
            }
            let (report, followed) = self.followed(&case, &over, OVERLAID)?;
            let followed_heights = Height::of(&figure, names);
            clicks::drawn_over(&mut figure, &report, &x, &followed_heights, &case.units());
            near.extend(clicks::on_branches(&report, &x, &followed_heights, &case.units()));
            let orbits = report.points.len();
            let words = format!("{count} values and {orbits} orbits on branches");
            hand(&figure, &near, words, &[swept, ("branch", &followed)])
        })
    }

    /// The motions over two parameters.
    pub(super) fn map(&self) -> Result<(), ApiError> {
        let (case, _) = self.case()?;
        let shows = self.field("show").ok().and_then(Shows::named);
        self.stages(&MAP, |count, finest| {
            let over = [self.over(&case, "1", count)?, self.over(&case, "2", count)?];
            let texts: Vec<&String> = over.iter().map(|(text, _)| text).collect();
            let options = object(
                json!({ "over": texts, "periods": RECORDED, "strobe": 1, "starts": STARTS.1 }),
            );
            let [x, y] = [&over[0].1, &over[1].1].map(|over| Axis::of(over).json());
            let fixed = clicks::fixed(&case, &[over[0].1.key, over[1].1.key]);
            let figure = self.staged(&case, "sweep", &options, |store| {
                maps::figure(store, shows.unwrap_or_default()).map_err(ApiError::of)
            })?;
            self.hand(Stage {
                figure: Some(figure),
                clicks: json!({ "set": { "x": x, "y": y }, "fixed": fixed }),
                words: progress(count.pow(2), finest.pow(2), "values"),
                studies: &[("sweep", &options)],
                ..Stage::default()
            })
        })
    }

    pub(super) fn branches(&self) -> Result<(), ApiError> {
        let (case, _) = self.case()?;
        let (_, over) = self.over(&case, "", 2)?;
        self.stages(&BRANCHES, |values, finest| {
            let (report, options) = self.followed(&case, &over, values)?;
            let axis = Axis::of(&over);
            let figure = case_figure(&case, &report, None);
            let shown = PlottedQuantity::usual(&case)
                .observable()
                .map_or("", |o| o.name);
            let heights = Height::of(&figure, &[shown]);
            let near = clicks::on_branches(&report, &axis, &heights, &case.units());
            self.hand(Stage {
                figure: Some(figure),
                clicks: json!({
                    "set": { "x": axis.json() },
                    "near": near,
                    "heights": clicks::of_heights(&heights, &case.units()),
                    "fixed": clicks::fixed(&case, &[over.key]),
                }),
                words: progress(values, finest, "censuses"),
                studies: &[("branch", &options)],
                ..Stage::default()
            })
        })
    }

    /// The branches over a parameter through the attractors of censuses at `values` of its values.
    fn followed(
        &self,
        case: &Case,
        over: &Over,
        values: usize,
    ) -> Result<(BranchReport, Map<String, Value>), ApiError> {
        let options = object(json!({
            "parameter": over.key.path(),
            "from": self.field("from")?,
            "to": self.field("to")?,
            "diagram": true,
            "values": values,
        }));
        Ok((self.report::<BranchStudy>(case, &options)?, options))
    }
}
