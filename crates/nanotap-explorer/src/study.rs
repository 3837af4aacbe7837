//! How the motion changes: the terminal's own studies, coarse first and finer as long as nobody
//! stops them.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use axum::Json;
use axum::extract::State;
use axum::response::Response;
use nanotap::case::quantity::Kind;
use nanotap::case::units::prefixed;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::dataset::{Share, Store, Work};
use nanotap::figure::approach::approach_figure;
use nanotap::figure::branch::case_figure;
use nanotap::model::Model;
use nanotap::observe::time_series::state_names;
use nanotap::study::approach::{ApproachRequest, ApproachStudy};
use nanotap::study::branch::{BranchRequest, BranchStudy, PointReport};
use nanotap::study::registry::{Study as _, study as study_named};
use nanotap::study::request::read;
use nanotap::study::start_box::default_box;
use nanotap::study::sweep::{figure as sweep_figure, response_figure};
use nanotap::study::{basin, sweep::Over};
use nanotap_figures::Figure;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::App;
use crate::answer::Refusal;
use crate::export::study_command;
use crate::knobs;
use crate::motion::{Start, drawn, model_of};
use crate::preset::Wanted;
use crate::scratch::Scratch;

/// Values of the parameter in the stages of a diagram.
const DIAGRAM: [usize; 3] = [30, 120, 400];
/// Values each way in the stages of a map.
const MAP: [usize; 3] = [8, 20, 48];
/// Points each way in the stages of a basin.
const BASIN: [usize; 3] = [40, 120, 300];
/// Distances each way in the stages of an approach.
const APPROACH: [usize; 2] = [40, 150];
/// Values at which a census is taken in the stages of a diagram of branches.
const BRANCHES: [usize; 2] = [5, 15];
/// Starts at each value of a diagram, and of a map.
const STARTS: (usize, usize) = (6, 3);
/// Drive periods recorded at each value.
const RECORDED: usize = 32;

/// A study as the page asks for it: its fields by name.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Asked {
    case: Wanted,
    #[serde(default)]
    start: String,
    tab: Tab,
    options: Map<String, Value>,
}

/// What is studied.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Tab {
    Diagram,
    Branches,
    Resonance,
    Approach,
    Basin,
    Map,
}

pub(crate) async fn study(State(app): State<Arc<App>>, Json(asked): Json<Asked>) -> Response {
    let shared = Arc::clone(&app);
    app.workers.stream(move |control, hand_over| {
        Studied {
            app: &shared,
            asked: &asked,
            control,
            hand_over,
        }
        .run()
    })
}

/// A study under way.
struct Studied<'a> {
    app: &'a App,
    asked: &'a Asked,
    control: &'a Control<'a>,
    hand_over: &'a dyn Fn(Value),
}

/// A finished stage.
struct Stage<'a> {
    figure: Figure,
    clicks: &'a Value,
    words: String,
    /// Name and request of the study.
    study: (&'a str, &'a Map<String, Value>),
}

impl Studied<'_> {
    fn run(&self) -> Result<(), Refusal> {
        match self.asked.tab {
            Tab::Diagram => self.sweep(&DIAGRAM, &[""], STARTS.0, false),
            Tab::Resonance => self.sweep(&DIAGRAM[..2], &[""], 0, true),
            Tab::Map => self.sweep(&MAP, &["1", "2"], STARTS.1, false),
            Tab::Branches => self.branches(),
            Tab::Approach => self.approach(),
            Tab::Basin => self.basin(),
        }
    }

    fn field(&self, name: &str) -> Result<&str, Refusal> {
        let given = self.asked.options.get(name).and_then(Value::as_str);
        let given = given.map(str::trim).filter(|text| !text.is_empty());
        given.ok_or_else(|| {
            Refusal::input(format!("the field `{name}` is empty"), "give it a value")
        })
    }

    /// `key=from:to:count` as the terminal takes it, and what was read.
    fn over(&self, case: &Case, which: &str, count: usize) -> Result<(String, Over), Refusal> {
        let [key, from, to] =
            ["key", "from", "to"].map(|part| self.field(&format!("{part}{which}")));
        let text = format!("{}={}:{}:{count}", key?, from?, to?).replace(' ', "");
        let over = Over::parse(&text, case).map_err(Refusal::of)?;
        Ok((text, over))
    }

    fn hand(&self, stage: &Stage<'_>) -> Result<(), Refusal> {
        let (name, request) = stage.study;
        (self.hand_over)(json!({
            "figure": drawn(&stage.figure)?,
            "clicks": stage.clicks,
            "words": stage.words,
            "command": study_command(self.app, &self.asked.case, name, request)?,
        }));
        Ok(())
    }

    /// A dataset of a study, in a folder that is removed when the figure is drawn.
    fn dataset<T>(
        &self,
        case: &Case,
        name: &str,
        request: &Map<String, Value>,
        use_it: impl FnOnce(&Store) -> Result<T, Refusal>,
    ) -> Result<T, Refusal> {
        let entry = study_named(name)
            .ok_or_else(|| Refusal::failed(format!("there is no study `{name}`")))?;
        let recipe = entry.recipe(case, Value::Object(request.clone()), self.control)?;
        let scratch = Scratch::within(&self.app.scratch)?;
        let store =
            Store::create_or_resume(&scratch.path().join("data.zarr"), recipe.schema().clone())
                .map_err(Refusal::of)?;
        let work = Work {
            share: Share::WHOLE,
            threads: 0,
            control: Control {
                cancel: self.control.cancel,
                progress: None,
            },
        };
        recipe.compute(&store, &work).map_err(Refusal::of)?;
        use_it(&store)
    }

    fn sweep(
        &self,
        stages: &[usize],
        parameters: &[&str],
        starts: usize,
        response: bool,
    ) -> Result<(), Refusal> {
        let case = self.asked.case.case(self.app, self.control)?;
        model_of(&case)?;
        for (stage, &count) in stages.iter().enumerate() {
            let over: Vec<(String, Over)> = parameters
                .iter()
                .map(|which| self.over(&case, which, count))
                .collect::<Result<_, _>>()?;
            let texts: Vec<&String> = over.iter().map(|(text, _)| text).collect();
            let mut request = object(json!({ "over": texts, "periods": RECORDED, "strobe": 1 }));
            if response {
                request.insert("follow".into(), "both".into());
            } else {
                request.insert("starts".into(), starts.into());
            }
            let axes: Vec<Axis> = over.iter().map(|(_, over)| Axis::of(over)).collect();
            // Of two parameters, the first is a line of the map: its vertical axis.
            let clicks = match axes.as_slice() {
                [x] => json!({ "set": { "x": x.json() } }),
                [y, x] => json!({ "set": { "x": x.json(), "y": y.json() } }),
                _ => Value::Null,
            };
            let draw = if response {
                response_figure
            } else {
                sweep_figure
            };
            let figure = self.dataset(&case, "sweep", &request, |store| {
                draw(store).map_err(Refusal::of)
            })?;
            let finest = stages[stages.len() - 1];
            let power = parameters.len() as u32;
            self.hand(&Stage {
                figure,
                clicks: &clicks,
                words: progress(count.pow(power), finest.pow(power), "values"),
                study: ("sweep", &request),
            })?;
            if self.stopped(stage, stages.len()) {
                break;
            }
        }
        Ok(())
    }

    fn stopped(&self, stage: usize, stages: usize) -> bool {
        let cancelled = self
            .control
            .cancel
            .is_some_and(|c| c.load(Ordering::Relaxed));
        cancelled || stage + 1 == stages
    }

    fn branches(&self) -> Result<(), Refusal> {
        let case = self.asked.case.case(self.app, self.control)?;
        model_of(&case)?;
        let (_, over) = self.over(&case, "", 2)?;
        for (stage, &values) in BRANCHES.iter().enumerate() {
            let request = object(json!({
                "parameter": over.key.path(),
                "from": self.field("from")?,
                "to": self.field("to")?,
                "diagram": true,
                "values": values,
            }));
            let asked: BranchRequest = read(Value::Object(request.clone()))?;
            let report = BranchStudy::run(&case, &asked, self.control)?;
            let axis = Axis::of(&over);
            let clicks = json!({
                "set": { "x": axis.json() },
                "near": near(&report.points, axis.factor),
            });
            self.hand(&Stage {
                figure: case_figure(&case, &report, None),
                clicks: &clicks,
                words: progress(values, BRANCHES[BRANCHES.len() - 1], "censuses"),
                study: ("branch", &request),
            })?;
            if self.stopped(stage, BRANCHES.len()) {
                break;
            }
        }
        Ok(())
    }

    fn approach(&self) -> Result<(), Refusal> {
        let case = self.asked.case.any_distance(self.app)?;
        for (stage, &points) in APPROACH.iter().enumerate() {
            let mut request = object(json!({ "points": points, "branches": stage > 0 }));
            for end in ["from", "to"] {
                if let Ok(text) = self.field(end) {
                    request.insert(end.into(), text.into());
                }
            }
            let asked: ApproachRequest = read(Value::Object(request.clone()))?;
            let report = ApproachStudy::run(&case, &asked, self.control)?;
            let units = case.units();
            let (factor, _) = units.axis(Kind::Length, report.from.abs().max(report.to.abs()));
            let axis = match units.si(Kind::Length) {
                Some(metres) => Axis {
                    key: Key::GapTip,
                    factor: factor / metres,
                },
                None => Axis {
                    key: case.gap_key(),
                    factor,
                },
            };
            self.hand(&Stage {
                figure: approach_figure(&report, &units),
                clicks: &json!({ "set": { "x": axis.json() } }),
                words: progress(points, APPROACH[APPROACH.len() - 1], "distances each way"),
                study: ("approach", &request),
            })?;
            if self.stopped(stage, APPROACH.len()) {
                break;
            }
        }
        Ok(())
    }

    fn basin(&self) -> Result<(), Refusal> {
        let case = self.asked.case.case(self.app, self.control)?;
        let model = model_of(&case)?;
        let names = state_names(&model);
        let origin = Start::parse(&self.asked.start)?.state;
        for (stage, &count) in BASIN.iter().enumerate() {
            let side = |which: &str| -> Result<(String, String), Refusal> {
                let [entry, from, to] =
                    ["entry", "from", "to"].map(|part| self.field(&format!("{part}{which}")));
                let entry = entry?;
                Ok((
                    entry.to_owned(),
                    format!("{entry}={}:{}:{count}", from?, to?),
                ))
            };
            let ((x, x_range), (y, y_range)) = (side("x")?, side("y")?);
            let mut request = object(json!({ "x": x_range, "y": y_range }));
            if let Some(state) = &origin {
                request.insert("state".into(), json!(state));
            }
            // A click starts a run there: the slice's own state with two entries replaced.
            let start: Vec<Value> = names
                .iter()
                .enumerate()
                .map(|(k, name)| match name {
                    name if *name == x => json!("x"),
                    name if *name == y => json!("y"),
                    _ => json!(origin.as_ref().and_then(|s| s.get(k)).unwrap_or(&0.0)),
                })
                .collect();
            let figure = self.dataset(&case, "basin", &request, |store| {
                basin::figure(store).map_err(Refusal::of)
            })?;
            self.hand(&Stage {
                figure,
                clicks: &json!({ "start": start }),
                words: progress(count, BASIN[BASIN.len() - 1], "points each way"),
                study: ("basin", &request),
            })?;
            if self.stopped(stage, BASIN.len()) {
                break;
            }
        }
        Ok(())
    }
}

fn progress(done: usize, finest: usize, counted: &str) -> String {
    let more = if done < finest { ", going on …" } else { "" };
    format!("{done} {counted}{more}")
}

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

/// An axis of a figure on which a click sets a key.
struct Axis {
    key: Key,
    /// What values of the key, in SI, are multiplied with to be drawn.
    factor: f64,
}

impl Axis {
    fn of(over: &Over) -> Self {
        let kind = over.key.kind();
        let (from, to) = (over.from, over.to);
        let factor = if over.key.is_physical() && kind != Kind::Number {
            prefixed(kind, 1.0, from.abs().max(to.abs())).0
        } else {
            1.0
        };
        Self {
            key: over.key,
            factor,
        }
    }

    fn json(&self) -> Value {
        let physical = self.key.is_physical() && self.key.kind() != Kind::Number;
        let unit = if physical {
            self.key.kind().si_unit()
        } else {
            ""
        };
        json!({ "name": self.key.path(), "factor": self.factor, "unit": unit })
    }
}

/// Where the orbits of a diagram are, as drawn, with what starts them.
fn near(points: &[PointReport], factor: f64) -> Vec<Value> {
    points
        .iter()
        .map(|point| {
            json!([
                factor * point.parameter,
                point.observables.tip_max,
                Start::text(Some(point.period), &point.state)
            ])
        })
        .collect()
}

/// The fields of the forms with their first values.
pub(crate) fn forms(case: &Case, base: &Case, model: &Model) -> Value {
    let keys: Vec<Key> = knobs::keys(case)
        .filter(|key| key.cannot_vary().is_none() && case.get(*key).is_finite())
        .filter(|key| !case.is_physical() || key.is_physical())
        .collect();
    let choices: Vec<Value> = keys.iter().map(|key| json!(key.path())).collect();
    let named = |names: &[Key]| {
        let of_names = names.iter().copied().find(|key| keys.contains(key));
        of_names.or_else(|| keys.first().copied())
    };
    let frequency = named(&[
        Key::Omega,
        Key::OscillatorOmega,
        Key::DriveFrequency,
        Key::DriveFrequencyRatio,
    ]);
    let second = named(&[
        Key::Alpha4,
        Key::GapTip,
        Key::DriveFreeAmplitude,
        Key::Restitution,
        Key::StopStiffness,
    ]);
    let parameter = |which: &str, key: Option<Key>, reach: f64| {
        let [from, to] = key.map_or_else(Default::default, |key| ends(base, key, reach));
        vec![
            json!({ "name": format!("key{which}"), "words": "parameter", "choices": choices, "value": key.map_or("", Key::path) }),
            json!({ "name": format!("from{which}"), "words": "from", "value": from }),
            json!({ "name": format!("to{which}"), "words": "to", "value": to }),
        ]
    };
    let names = state_names(model);
    let sides = default_box(model).ok();
    let entry = |which: &str, k: usize| {
        let side = sides
            .as_ref()
            .and_then(|sides| Some((*sides.lower().get(k)?, *sides.upper().get(k)?)))
            .unwrap_or((-1.0, 1.0));
        let short = |v: f64| Kind::Number.format_digits(v, 3);
        vec![
            json!({ "name": format!("entry{which}"), "words": "coordinate", "choices": names, "value": names.get(k) }),
            json!({ "name": format!("from{which}"), "words": "from", "value": short(side.0) }),
            json!({ "name": format!("to{which}"), "words": "to", "value": short(side.1) }),
        ]
    };
    let velocity = (names.len() - model.memory) / 2;
    // A lever of high Q answers in a narrow band.
    let band = case.physical().map_or(0.25, |view| {
        (4.0 / view.lever.quality_factor).clamp(1e-3, 0.25)
    });
    let plane = [parameter("1", second, 0.5), parameter("2", frequency, 0.25)].concat();
    let slice = [entry("x", 0), entry("y", velocity)].concat();
    json!({
        "diagram": parameter("", frequency, 0.25),
        "branches": parameter("", frequency, 0.25),
        "resonance": parameter("", frequency, band),
        "approach": [
            json!({ "name": "from", "words": "from", "value": "", "hint": "clear of the sample" }),
            json!({ "name": "to", "words": "to", "value": "", "hint": "0" }),
        ],
        "map": plane,
        "basin": slice,
    })
}

/// A range around the value of a key, as it is typed.
fn ends(base: &Case, key: Key, reach: f64) -> [String; 2] {
    let value = base.get(key);
    let value = if value.is_finite() {
        value
    } else {
        key.entry().example
    };
    let reach = if value == 0.0 {
        1.0
    } else {
        reach * value.abs()
    };
    [value - reach, value + reach].map(|value| key.kind().format_digits(value, 5))
}
