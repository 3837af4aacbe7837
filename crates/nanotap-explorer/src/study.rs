//! The terminal's studies, in stages of increasing resolution until they are cancelled.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::response::Response;
use nanotap::case::quantity::Kind;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::dataset::{Share, Store, Work};
use nanotap::figure::approach::approach_figure;
use nanotap::figure::basin::figure as basin_figure;
use nanotap::figure::branch::{Shown, case_figure};
use nanotap::figure::scan::scan_figure;
use nanotap::figure::sweep::{figure as sweep_figure, response as response_figure};
use nanotap::figure::window::figure as window_figure;
use nanotap::model::Model;
use nanotap::observe::time_series::state_names;
use nanotap::study::approach::ApproachStudy;
use nanotap::study::branch::{BranchReport, BranchStudy};
use nanotap::study::registry::{Study, study as study_named};
use nanotap::study::request::read;
use nanotap::study::scan::ScanStudy;
use nanotap::study::sweep::Over;
use nanotap::study::window::Window;
use nanotap_figures::{Axis as Axes, Figure, Panel};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::App;
use crate::api_error::ApiError;
use crate::clicks::{self, Axis, Height};
use crate::commands::{CASE_FILE, case_path, quoted, study_command, study_python};
use crate::figures::{drawn, over_pinned};
use crate::forms;
use crate::maps::{self, Shows};
use crate::motion_request::{Start, model_of};
use crate::preset::CaseSpec;
use crate::scratch::Scratch;

/// Numbers of values of the parameter in the stages of a diagram.
const DIAGRAM: [usize; 3] = [30, 120, 400];
/// Numbers of values along each axis in the stages of a map.
const MAP: [usize; 3] = [8, 20, 48];
/// Numbers of points along each axis in the stages of a basin.
const BASIN: [usize; 4] = [12, 40, 120, 300];
/// Numbers of distances in each direction in the stages of an approach curve.
const APPROACH: [usize; 2] = [40, 150];
/// Numbers of values with a census in the stages of a diagram of branches.
const BRANCHES: [usize; 2] = [5, 15];
/// Number of values with a census for branches that are drawn over another figure.
const OVERLAID: usize = 7;
/// Numbers of values along each axis in the stages of a plan.
const PLAN: [usize; 3] = [4, 8, 16];
/// Initial states at each point of a plan.
const PLAN_STARTS: usize = 4;
/// Observables in the panels of an approach curve.
const APPROACH_SHOWS: [&str; 4] = ["first_harmonic", "phase", "dissipation", "peak_force"];
/// Initial states at each value of a diagram, and of a map.
const STARTS: (usize, usize) = (6, 3);
/// Drive periods recorded at each value.
const RECORDED: usize = 32;

/// A study as requested by the page: its fields by name.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StudyRequest {
    case: CaseSpec,
    #[serde(default)]
    start: String,
    tab: Tab,
    options: Map<String, Value>,
    /// Number of a figure whose curves are drawn behind; 0: none.
    #[serde(default)]
    pinned: u64,
}

/// The kind of study.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Tab {
    Diagram,
    Branches,
    Resonance,
    Approach,
    Basin,
    Map,
    Plan,
    Image,
}

pub(crate) async fn study(
    State(app): State<Arc<App>>,
    Json(request): Json<StudyRequest>,
) -> Response {
    let shared = Arc::clone(&app);
    app.workers.stream(move |control, hand_over| {
        Studied {
            app: &shared,
            request: &request,
            control,
            hand_over,
        }
        .run()
    })
}

/// A running study.
struct Studied<'a> {
    app: &'a App,
    request: &'a StudyRequest,
    control: &'a Control<'a>,
    hand_over: &'a dyn Fn(Value),
}

/// A finished stage.
struct Stage<'a> {
    figure: Figure,
    clicks: &'a Value,
    words: String,
    /// Names and requests of the studies in its figure.
    studies: &'a [Computed<'a>],
    /// Lines of the case file in addition.
    table: Option<String>,
}

/// The name of a study, and its options.
type Computed<'a> = (&'a str, &'a Map<String, Value>);

impl Studied<'_> {
    fn run(&self) -> Result<(), ApiError> {
        match self.request.tab {
            Tab::Diagram => self.sweep(&DIAGRAM, STARTS.0, false),
            Tab::Resonance => self.sweep(&DIAGRAM[..2], 0, true),
            Tab::Map => self.map(),
            Tab::Plan => self.plan(),
            Tab::Image => self.image(),
            Tab::Branches => self.branches(),
            Tab::Approach => self.approach(),
            Tab::Basin => self.basin(),
        }
    }

    fn field(&self, name: &str) -> Result<&str, ApiError> {
        let given = self.request.options.get(name).and_then(Value::as_str);
        let given = given.map(str::trim).filter(|text| !text.is_empty());
        given.ok_or_else(|| {
            ApiError::input(format!("the field `{name}` is empty"), "give it a value")
        })
    }

    /// `key=from:to:count` in the terminal's form, and the parsed range.
    fn over(&self, case: &Case, which: &str, count: usize) -> Result<(String, Over), ApiError> {
        let [key, from, to] =
            ["key", "from", "to"].map(|part| self.field(&format!("{part}{which}")));
        let text = format!("{}={}:{}:{count}", key?, from?, to?).replace(' ', "");
        let over = Over::parse(&text, case).map_err(ApiError::of)?;
        Ok((text, over))
    }

    fn hand(&self, stage: &Stage<'_>) -> Result<(), ApiError> {
        let case = &self.request.case;
        let command = |(name, request): &Computed<'_>| study_command(self.app, case, name, request);
        let commands = stage.studies.iter().map(command);
        let commands: Vec<String> = commands.collect::<Result<_, _>>()?;
        let (figure, words) = match self.request.pinned {
            0 => (stage.figure.clone(), stage.words.clone()),
            pinned => {
                let pinned = self.app.figures.get(pinned)?;
                let (figure, any) = over_pinned(stage.figure.clone(), &pinned);
                let other = if any {
                    ""
                } else {
                    "; the pinned figure has other axes"
                };
                (figure, stage.words.clone() + other)
            }
        };
        (self.hand_over)(json!({
            "figure": drawn(&figure)?,
            "number": self.app.figures.put(figure),
            "clicks": stage.clicks,
            "words": words,
            "command": match &stage.table {
                Some(table) => {
                    // The saved case has no other `[scan]`.
                    let path = quoted(&case_path(self.app, case)?);
                    appended(table, &commands.join("\n").replacen(&path, CASE_FILE, 1))
                }
                None => commands.join("\n"),
            },
            "python": study_python(self.app, case, stage.studies)?,
        }));
        Ok(())
    }

    /// A dataset of a study, in a folder that is removed once the figure is drawn.
    fn dataset<T>(
        &self,
        case: &Case,
        name: &str,
        request: &Map<String, Value>,
        use_it: impl FnOnce(&Store) -> Result<T, ApiError>,
    ) -> Result<T, ApiError> {
        let entry =
            study_named(name).ok_or_else(|| ApiError::failed(format!("unknown study `{name}`")))?;
        let plan = entry.plan(case, Value::Object(request.clone()), self.control)?;
        let scratch = Scratch::within(&self.app.scratch)?;
        let store =
            Store::create_or_resume(&scratch.path().join("data.zarr"), plan.schema().clone())
                .map_err(ApiError::of)?;
        let work = Work {
            share: Share::WHOLE,
            threads: 0,
            control: Control {
                cancel: self.control.cancel,
                progress: None,
            },
        };
        plan.compute(&store, &work).map_err(ApiError::of)?;
        use_it(&store)
    }

    /// Computes the stages one by one until the work is cancelled; `stage` gets its count and the
    /// finest one.
    fn stages(
        &self,
        counts: &[usize],
        mut stage: impl FnMut(usize, usize) -> Result<(), ApiError>,
    ) -> Result<(), ApiError> {
        let finest = counts.last().copied().unwrap_or_default();
        for &count in counts {
            stage(count, finest)?;
            if self.control.is_cancelled() {
                break;
            }
        }
        Ok(())
    }

    /// The case at its setpoint, if it is small enough for the explorer, and its model.
    fn case(&self) -> Result<(Case, Model), ApiError> {
        let case = self.request.case.case(self.app, self.control)?;
        let model = model_of(&case)?;
        Ok((case, model))
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
            let (mut figure, mut near) = self.dataset(&case, "sweep", &options, |store| {
                let figure = draw(store).map_err(ApiError::of)?;
                let heights = Height::of(&figure, names);
                let near = clicks::in_sweep(store, x, &heights, response).map_err(ApiError::of)?;
                Ok((figure, near))
            })?;
            let heights = clicks::of_heights(&Height::of(&figure, names), &case.units());
            let fixed = clicks::fixed(&case, &[over.key]);
            let hand = |figure: &Figure, near: &[Value], words, studies: &[Computed<'_>]| {
                self.hand(&Stage {
                    figure: figure.clone(),
                    clicks: &json!({ "set": { "x": x.json() }, "near": near, "fixed": fixed, "heights": heights }),
                    words,
                    studies,
table: None,
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
            clicks::drawn_over(&mut figure, &report, x, &followed_heights, &case.units());
            near.extend(clicks::on_branches(&report, x, &followed_heights, &case.units()));
            let orbits = report.points.len();
            let words = format!("{count} values and {orbits} orbits on branches");
            hand(&figure, &near, words, &[swept, ("branch", &followed)])
        })
    }

    /// The motions over two parameters.
    fn map(&self) -> Result<(), ApiError> {
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
            let figure = self.dataset(&case, "sweep", &options, |store| {
                maps::figure(store, shows.unwrap_or_default()).map_err(ApiError::of)
            })?;
            self.hand(&Stage {
                figure,
                clicks: &json!({ "set": { "x": x, "y": y }, "fixed": fixed }),
                words: progress(count.pow(2), finest.pow(2), "values"),
                studies: &[("sweep", &options)],
                table: None,
            })
        })
    }

    /// Where, over two parameters, every motion meets the conditions of the form.
    fn plan(&self) -> Result<(), ApiError> {
        let case = self.request.case.any_distance(self.app)?;
        let mut wanted = Vec::new();
        if let Ok(force) = self.field("force") {
            wanted.push(format!("F_max < {force}"));
        }
        match self.field("regime")? {
            forms::ANY => {}
            regime => wanted.push(format!("regime = {regime}")),
        }
        if self.field("states")? == forms::ONE_STATE {
            wanted.push("states = 1".to_owned());
        }
        self.stages(&PLAN, |count, finest| {
            let over = [self.over(&case, "1", count)?, self.over(&case, "2", count)?];
            let texts: Vec<&String> = over.iter().map(|(text, _)| text).collect();
            let options = object(json!({ "over": texts, "starts": PLAN_STARTS, "where": wanted }));
            let [x, y] = [&over[0].1, &over[1].1].map(|over| Axis::of(over).json());
            let fixed = clicks::fixed(&case, &[over[0].1.key, over[1].1.key]);
            let (figure, safe) = self.dataset(&case, "window", &options, |store| {
                let window = Window::of(store).map_err(ApiError::of)?;
                Ok((window_figure(store).map_err(ApiError::of)?, window.targets))
            })?;
            let safe = safe.map_or_else(String::new, |targets| {
                format!("; all conditions hold at {:.0} %", 100.0 * targets.share)
            });
            self.hand(&Stage {
                figure,
                clicks: &json!({ "set": { "x": x, "y": y }, "fixed": fixed }),
                words: progress(count.pow(2), finest.pow(2), "points") + &safe,
                studies: &[("window", &options)],
                table: None,
            })
        })
    }

    /// A line over the surface of the form, under feedback.
    fn image(&self) -> Result<(), ApiError> {
        let case = self.request.case.any_distance(self.app)?;
        let mut options = object(json!({ "lines": 1 }));
        for (field, option) in [
            ("size", "size"),
            ("rate", "line_rate"),
            ("setpoint", "setpoint"),
            ("gain", "integral_gain"),
        ] {
            if let Ok(text) = self.field(field) {
                options.insert(option.to_owned(), text.into());
            }
        }
        let mut computed = options.clone();
        let surface = self.surface()?;
        if let Some(surface) = &surface {
            computed.insert("surface".to_owned(), json!([surface]));
        }
        let report = self.report::<ScanStudy>(&case, &computed)?;
        let gain = report.feedback.as_ref();
        let gain = gain.and_then(|feedback| feedback.largest_stable_gain);
        let gain = gain.map_or_else(String::new, |gain| {
            let gain = Kind::Number.format_digits(gain, 3);
            format!(" The feedback is stable up to a gain of {gain}/s.")
        });
        self.hand(&Stage {
            figure: scan_figure(&report),
            clicks: &json!({}),
            words: format!("{}{gain}", report.verdict),
            studies: &[("scan", &options)],
            table: self.scan_table(&case, surface)?,
        })
    }

    /// The table `[scan]` that the saved case needs for the surface; `None` if its file has it.
    fn scan_table(&self, case: &Case, surface: Option<Value>) -> Result<Option<String>, ApiError> {
        let spec = &self.request.case;
        if surface.is_none() && spec.is_a_file(self.app)? {
            return Ok(None);
        }
        let mut table = case.scan().cloned().unwrap_or_default();
        if let Some(surface) = surface {
            table.retain(|name, _| !["profile", "image"].contains(&name.as_str()));
            table.insert("surface".to_owned(), json!([surface]));
        }
        let lines = table
            .iter()
            .map(|(name, value)| format!("{name} = {}", inline(value)));
        let lines: Vec<String> = lines.collect();
        Ok(Some(format!("[scan]\n{}", lines.join("\n"))))
    }

    /// The surface of the form; `None`: that of the case.
    fn surface(&self) -> Result<Option<Value>, ApiError> {
        let [own, step, grating, particle] = forms::SURFACES;
        let chosen = self.field("surface")?;
        if chosen == own {
            return Ok(None);
        }
        let height = self.field("height")?;
        let line = self.field("size")?;
        let length = |text: &str, field: &str| {
            Kind::Length
                .parse(text)
                .map_err(|error| ApiError::input(error.to_string(), "as in \"10 nm\"").about(field))
        };
        let part = |part: f64| -> Result<String, ApiError> {
            Ok(Kind::Length.format_exact(part * length(line, "size")?))
        };
        Ok(Some(if chosen == step {
            json!({ "step": { "from": part(0.25)?, "to": part(0.65)?, "height": height } })
        } else if chosen == grating {
            json!({ "grating": { "height": height, "period": part(0.25)? } })
        } else if chosen == particle {
            let radius = Kind::Length.format_exact(0.5 * length(height, "height")?);
            json!({ "particle": { "at": part(0.5)?, "radius": radius } })
        } else {
            let known = forms::SURFACES.join(", ");
            return Err(ApiError::input(
                format!("expected a surface, got `{chosen}`"),
                format!("there are {known}"),
            ));
        }))
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

    /// The report of a study.
    fn report<S: Study>(
        &self,
        case: &Case,
        options: &Map<String, Value>,
    ) -> Result<S::Report, ApiError> {
        let options: S::Options = read(Value::Object(options.clone()))?;
        Ok(S::run(case, &options, self.control)?)
    }

    fn branches(&self) -> Result<(), ApiError> {
        let (case, _) = self.case()?;
        let (_, over) = self.over(&case, "", 2)?;
        self.stages(&BRANCHES, |values, finest| {
            let (report, options) = self.followed(&case, &over, values)?;
            let axis = Axis::of(&over);
            let figure = case_figure(&case, &report, None);
            let shown = Shown::usual(&case).observable().map_or("", |o| o.name);
            let heights = Height::of(&figure, &[shown]);
            let near = clicks::on_branches(&report, axis, &heights, &case.units());
            self.hand(&Stage {
                figure,
                clicks: &json!({
                    "set": { "x": axis.json() },
                    "near": near,
                    "heights": clicks::of_heights(&heights, &case.units()),
                    "fixed": clicks::fixed(&case, &[over.key]),
                }),
                words: progress(values, finest, "censuses"),
                studies: &[("branch", &options)],
                table: None,
            })
        })
    }

    fn approach(&self) -> Result<(), ApiError> {
        let case = self.request.case.any_distance(self.app)?;
        self.stages(&APPROACH, |points, finest| {
            let branches = points == finest;
            let mut options = object(json!({ "points": points, "branches": branches }));
            for end in ["from", "to"] {
                if let Ok(text) = self.field(end) {
                    options.insert(end.into(), text.into());
                }
            }
            let report = self.report::<ApproachStudy>(&case, &options)?;
            let units = case.units();
            let (factor, _) = units.axis(Kind::Length, report.from.abs().max(report.to.abs()));
            let axis = match units.si(Kind::Length) {
                Some(metres) => Axis {
                    key: Key::GapTip,
                    kind: Kind::Length,
                    factor: factor / metres,
                },
                None => Axis {
                    key: case.gap_key(),
                    kind: Kind::Number,
                    factor,
                },
            };
            let figure = approach_figure(&report, &units);
            let heights = Height::of(&figure, &APPROACH_SHOWS);
            let near = clicks::of_approach(&report, factor, &heights, &units);
            self.hand(&Stage {
                figure,
                clicks: &json!({
                    "set": { "x": axis.json() },
                    "near": near,
                    "heights": clicks::of_heights(&heights, &case.units()),
                    "fixed": clicks::fixed(&case, &[axis.key]),
                }),
                words: progress(points, finest, "distances each way"),
                studies: &[("approach", &options)],
                table: None,
            })
        })
    }

    fn basin(&self) -> Result<(), ApiError> {
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
            let figure = self.dataset(&case, "basin", &options, |store| {
                basin_figure(store).map_err(ApiError::of)
            })?;
            let panel = figure.panels.first();
            let factor = |name: &str, axis: fn(&Panel) -> &Axes| {
                panel.map_or(1.0, |panel| {
                    clicks::of_entry(&case.units(), name, axis(panel))
                })
            };
            let factors = json!({ "x": factor(&x, |p| &p.x), "y": factor(&y, |p| &p.y) });
            self.hand(&Stage {
                figure,
                clicks: &json!({ "start": start, "factors": factors }),
                words: progress(count, finest, "points each way"),
                studies: &[("basin", &options)],
                table: None,
            })
        })
    }
}

/// A command after lines that it needs in the case file.
fn appended(table: &str, command: &str) -> String {
    format!("cat >> {CASE_FILE} <<'END'\n{table}\nEND\n{command}")
}

/// A value as in a case file.
fn inline(value: &Value) -> String {
    match value {
        Value::Object(map) => {
            let entries: Vec<String> = map
                .iter()
                .map(|(name, value)| format!("{name} = {}", inline(value)))
                .collect();
            format!("{{ {} }}", entries.join(", "))
        }
        Value::Array(values) => {
            let values: Vec<String> = values.iter().map(inline).collect();
            format!("[{}]", values.join(", "))
        }
        other => other.to_string(),
    }
}

fn progress(done: usize, finest: usize, counted: &str) -> String {
    let more = if done < finest { " so far" } else { "" };
    format!("{done} {counted}{more}")
}

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}
