//! The studies of the command line, in stages of increasing resolution until they are cancelled.

use std::fmt::Write as _;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::Json;
use axum::extract::State;
use axum::response::Response;
use nanotap::case::file::{Source, scan_table};
use nanotap::case::quantity::{Kind, format_electronvolts};
use nanotap::case::units::prefixed;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::dataset::{Share, Store, Work};
use nanotap::figure::approach::approach_figure;
use nanotap::figure::basin::figure as basin_figure;
use nanotap::figure::branch::{Shown, case_figure};
use nanotap::figure::fit::fit_figure;
use nanotap::figure::reconstruct::reconstruct_figure;
use nanotap::figure::scan::scan_figure;
use nanotap::figure::study::{dataset_figure, document_and_figure};
use nanotap::figure::sweep::{figure as sweep_figure, response as response_figure};
use nanotap::figure::window::figure as window_figure;
use nanotap::model::Model;
use nanotap::observe::time_series::state_names;
use nanotap::study::approach::{ApproachReport, ApproachStudy};
use nanotap::study::branch::{BranchReport, BranchStudy};
use nanotap::study::fit::{FitOptions, FitReport, FitStudy, FittedParameter, Table, measured};
use nanotap::study::lever::{LeverOptions, LeverStudy, QualityFactorSource, case_with_lever};
use nanotap::study::reconstruct::{
    ReconstructMethod, ReconstructOptions, ReconstructReport, ReconstructStudy,
};
use nanotap::study::registry::{Study, StudyEntry, study as study_named};
use nanotap::study::request::{Property, properties, read};
use nanotap::study::scan::ScanStudy;
use nanotap::study::sweep::Over;
use nanotap::study::window::Window;
use nanotap_figures::{Axis as Axes, Colour, Figure, Markers, Panel};
use serde::{Deserialize, Serialize};
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
use crate::report;
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
/// Pixels of a line of an image, there and back.
const LINE_PIXELS: f64 = 512.0;
/// Largest number of heights of a drawn surface.
const MAX_DRAWN: usize = 1000;
/// Time between messages on the progress.
const BETWEEN: Duration = Duration::from_millis(300);

/// A study as requested by the page: its fields by name.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StudyRequest {
    case: CaseSpec,
    #[serde(default)]
    start: String,
    /// Name of a tab of the page, or of a study of the registry.
    tab: String,
    /// Measured data: name and text of the file.
    #[serde(default)]
    data: Option<(String, String)>,
    options: Map<String, Value>,
    /// Number of a figure whose curves are drawn behind this one; 0: none.
    #[serde(default)]
    pinned: u64,
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

/// Sends a message to the page.
type HandOver<'a> = &'a (dyn Fn(Value) + Sync);

/// A study that is running, with its request and its connection to the page.
struct Studied<'a> {
    app: &'a App,
    request: &'a StudyRequest,
    control: &'a Control<'a>,
    hand_over: HandOver<'a>,
}

/// A finished stage of a study: what the page shows then.
#[derive(Default)]
struct Stage<'a> {
    figure: Option<Figure>,
    clicks: Value,
    words: String,
    /// Names and requests of the studies in its figure.
    studies: &'a [Computed<'a>],
    /// Additional lines of the case file: its table `[scan]`.
    scan: Option<String>,
    /// Tables that the page shows below the figure.
    tables: Vec<Value>,
    found: Option<Found>,
}

/// A result of a study from which the user can go on.
#[derive(Serialize)]
struct Found {
    /// The changes to the case that lead to this result, and the words of the button that applies
    /// them.
    set: Option<Map<String, Value>>,
    take: &'static str,
    /// A file with the result, the words of the button that saves it, and its name.
    file: String,
    save: &'static str,
    name: &'static str,
}

/// The name of a study, and its options.
type Computed<'a> = (&'a str, &'a Map<String, Value>);

impl Studied<'_> {
    fn run(&self) -> Result<(), ApiError> {
        match self.request.tab.as_str() {
            "diagram" => self.sweep(&DIAGRAM, STARTS.0, false),
            "resonance" => self.sweep(&DIAGRAM[..2], 0, true),
            "map" => self.map(),
            "plan" => self.plan(),
            "image" => self.image(),
            "branches" => self.branches(),
            "approach" => self.approach(),
            "basin" => self.basin(),
            "levers" => self.levers(),
            "data" => self.measured(),
            name => self.any(name),
        }
    }

    /// Runs work whose progress the page shows.
    fn counting<T>(&self, counted: &str, work: impl FnOnce(&Control<'_>) -> T) -> T {
        let last = Mutex::new(Instant::now());
        let progress = |done: usize, total: usize| {
            let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
            if last.elapsed() > BETWEEN {
                *last = Instant::now();
                (self.hand_over)(json!({ "progress": format!("{done} of {total} {counted}") }));
            }
        };
        work(&Control {
            cancel: self.control.cancel,
            progress: Some(&progress),
        })
    }

    /// The options of a study that the form sets to another value than the default.
    fn options(&self, entry: &StudyEntry) -> Map<String, Value> {
        let schema = (entry.request)();
        let given = |property: Property<'_>| {
            let text = self.field(property.name).ok()?;
            let pairs = property.schema["x-value"].as_str();
            let value = if property.allows("boolean") && !property.allows("string") {
                (text == forms::YES).into()
            } else if property.allows("array") && pairs.is_some_and(|form| form.contains('=')) {
                pairs_of(text).into()
            } else {
                property.parsed(text)
            };
            (property.default() != Some(&value)).then(|| (property.name.to_owned(), value))
        };
        properties(&schema).filter_map(given).collect()
    }

    /// A study of the registry that has no tab with more than its options and its report.
    fn any(&self, name: &str) -> Result<(), ApiError> {
        let entry = study_named(name).filter(|entry| forms::is_plain(entry));
        let entry = entry.ok_or_else(|| {
            let known: Vec<&str> = forms::plain_studies().map(|entry| entry.name).collect();
            ApiError::input(
                format!("expected a study, got `{name}`"),
                format!("there are {}", known.join(", ")),
            )
        })?;
        let case = self.request.case.any_distance(self.app)?;
        model_of(&case)?;
        let options = self.options(entry);
        let request = Value::Object(options.clone());
        let (document, figure) = if entry.document.is_some() {
            self.counting(entry.counted, |control| {
                document_and_figure(entry, &case, request, control)
            })?
        } else {
            self.whole_dataset(entry, &case, request)?
        };
        let schema = (entry.report)();
        self.hand(Stage {
            figure,
            words: entry.about.to_owned(),
            studies: &[(name, &options)],
            tables: report::tables(&document, schema.as_value()),
            ..Stage::default()
        })
    }

    /// The summary and the figure of a study's dataset.
    fn whole_dataset(
        &self,
        entry: &StudyEntry,
        case: &Case,
        request: Value,
    ) -> Result<(Value, Option<Figure>), ApiError> {
        self.counting(entry.counted, |control| {
            self.dataset(case, entry, request, control, |store| {
                let summary = entry.summary.map(|of| of(store)).transpose()?;
                let figure = dataset_figure(entry.name, store).map_err(ApiError::of)?;
                Ok((summary.unwrap_or_default(), figure))
            })
        })
    }

    /// Levers of the catalogue on the sample of the case.
    fn levers(&self) -> Result<(), ApiError> {
        let mut spec = self.request.case.clone();
        let setpoint = self.field("setpoint")?;
        spec.put(Key::DriveSetpoint, setpoint);
        let own = self.request.case.any_distance(self.app)?;
        let case = spec.any_distance(self.app)?;
        let conditions = self.conditions()?;
        let unconditional = conditions.is_empty();
        let mut options = object(json!({ "where": conditions }));
        if self.field("tip")? == forms::OWN_TIP {
            options.insert("keep_tip".into(), true.into());
        }
        let read: LeverOptions = read(Value::Object(options.clone()))?;
        if case.stated(Key::DriveSetpoint) != own.stated(Key::DriveSetpoint) {
            let word = format!("{}={setpoint}", Key::DriveSetpoint);
            options.insert("set".into(), json!([word]));
        }
        let report = self.counting(LeverStudy::COUNTED, |control| {
            LeverStudy::run(&case, &read, control)
        })?;
        let shown = |kind: Kind, value: f64| {
            if value.is_finite() {
                kind.format_digits(value, 3)
            } else {
                String::new()
            }
        };
        let rows = report.levers.iter().map(|lever| {
            let motion = lever.motion.as_ref();
            let cells = [
                lever.lever.clone(),
                shown(Kind::Stiffness, lever.k),
                shown(Kind::Frequency, lever.f0),
                shown(Kind::Number, lever.quality_factor),
                shown(Kind::Length, lever.tip_radius.unwrap_or(f64::NAN)),
                match (motion, &lever.reason) {
                    (Some(motion), _) => shown(Kind::Force, motion.physical.observables.peak_force),
                    (None, Some(reason)) => reason.clone(),
                    (None, None) => String::new(),
                },
                motion.map_or_else(String::new, |motion| motion.regime.to_owned()),
                motion.map_or_else(String::new, |motion| motion.states.to_string()),
                shown(Kind::Time, lever.time_constant * LINE_PIXELS),
                lever
                    .holds
                    .map_or("", |holds| if holds { "yes" } else { "no" })
                    .to_owned(),
            ];
            let taken = case_with_lever(&case, &lever.lever, &read).ok();
            let set = taken.map(|taken| report::changes(&own, &taken));
            let shown = &cells[..cells.len() - usize::from(unconditional)];
            report::row(shown, set.as_ref().filter(|_| motion.is_some()))
        });
        let line = format!(
            "{LINE_PIXELS} pixels there and back, with one time constant Q/(π f0) of the amplitude each"
        );
        let heads = [
            ("lever", "Name in the catalogue"),
            ("k", "Spring constant"),
            ("f₀", "Free resonance"),
            ("Q", "Quality factor"),
            ("tip", "Radius of the tip"),
            ("peak force", "At the setpoint"),
            ("regime", "Whether the mean force attracts or repels"),
            ("states", "Stable motions found at this distance"),
            ("line time", line.as_str()),
            ("conditions", "Whether all conditions hold"),
        ];
        let heads = &heads[..heads.len() - usize::from(unconditional)];
        self.hand(Stage {
            words: format!(
                "{} levers at A₀ = {} and setpoint {setpoint}, with {}. A click on a row chooses that lever.",
                report.levers.len(),
                shown(Kind::Length, report.free_amplitude),
                match report.quality_factor_source {
                    QualityFactorSource::Case => "the quality factor of the case",
                    QualityFactorSource::Fluid => "quality factors in the fluid of the case",
                    QualityFactorSource::Air => "quality factors in air",
                }
            ),
            studies: &[("lever", &options)],
            tables: vec![report::table("", heads, &rows.collect::<Vec<_>>())],
            ..Stage::default()
        })
    }

    /// The conditions of the form.
    fn conditions(&self) -> Result<Vec<String>, ApiError> {
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
        Ok(wanted)
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

    fn hand(&self, stage: Stage<'_>) -> Result<(), ApiError> {
        let case = &self.request.case;
        let command = |(name, request): &Computed<'_>| study_command(self.app, case, name, request);
        let commands = stage.studies.iter().map(command);
        let commands: Vec<String> = commands.collect::<Result<_, _>>()?;
        let mut words = stage.words;
        let mut figure = stage.figure;
        if let (Some(own), 1..) = (&figure, self.request.pinned) {
            let pinned = self.app.figures.get(self.request.pinned)?;
            let (both, any) = over_pinned(own.clone(), &pinned);
            if !any {
                words.push_str("; the pinned figure has other axes");
            }
            figure = Some(both);
        }
        let mut message = json!({
            "clicks": stage.clicks,
            "words": words,
            "tables": stage.tables,
            "command": match &stage.scan {
                Some(scan) => {
                    let path = quoted(&case_path(self.app, case)?);
                    with_scan(scan, &commands.join("\n").replacen(&path, CASE_FILE, 1))
                }
                None => commands.join("\n"),
            },
            "python": study_python(self.app, case, stage.studies)?,
        });
        if let Some(figure) = figure {
            message["figure"] = drawn(&figure)?;
            message["number"] = self.app.figures.put(figure).into();
        }
        if let Some(found) = stage.found {
            message["found"] = json!(found);
        }
        (self.hand_over)(message);
        Ok(())
    }

    /// A dataset of a study, in a folder that is removed once the figure is drawn.
    fn dataset<T>(
        &self,
        case: &Case,
        entry: &StudyEntry,
        request: Value,
        control: &Control<'_>,
        use_it: impl FnOnce(&Store) -> Result<T, ApiError>,
    ) -> Result<T, ApiError> {
        let plan = entry.plan(case, request, control)?;
        let scratch = Scratch::within(&self.app.scratch)?;
        let store =
            Store::create_or_resume(&scratch.path().join("data.zarr"), plan.schema().clone())
                .map_err(ApiError::of)?;
        let work = Work {
            share: Share::WHOLE,
            threads: 0,
            control: *control,
        };
        plan.compute(&store, &work).map_err(ApiError::of)?;
        use_it(&store)
    }

    /// The dataset of a stage.
    fn staged<T>(
        &self,
        case: &Case,
        name: &str,
        request: &Map<String, Value>,
        use_it: impl FnOnce(&Store) -> Result<T, ApiError>,
    ) -> Result<T, ApiError> {
        let entry =
            study_named(name).ok_or_else(|| ApiError::failed(format!("unknown study `{name}`")))?;
        let request = Value::Object(request.clone());
        self.dataset(case, entry, request, self.control, use_it)
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

    /// Finds where, over two parameters, every motion meets the conditions of the form.
    fn plan(&self) -> Result<(), ApiError> {
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
        computed.extend(surface.clone().unwrap_or_default());
        let report = self.report::<ScanStudy>(&case, &computed)?;
        let gain = report.feedback.as_ref();
        let gain = gain.and_then(|feedback| feedback.largest_stable_gain);
        let gain = gain.map_or_else(String::new, |gain| {
            let gain = Kind::Number.format_digits(gain, 3);
            format!(" The feedback is stable up to a gain of {gain}/s.")
        });
        self.hand(Stage {
            figure: Some(scan_figure(&report)),
            clicks: json!({}),
            words: format!("{}{gain}", report.verdict),
            studies: &[("scan", &options)],
            scan: Self::scan_table(&case, surface),
            ..Stage::default()
        })
    }

    /// The table `[scan]` that the saved case needs for another surface than its own.
    fn scan_table(case: &Case, surface: Option<Map<String, Value>>) -> Option<String> {
        let surface = surface?;
        let mut table = case.scan().cloned().unwrap_or_default();
        table.retain(|name, _| !["profile", "image"].contains(&name.as_str()));
        table.extend(surface);
        Some(scan_table(&table))
    }

    /// The surface of the form, as keys of `[scan]`; `None`: that of the case.
    fn surface(&self) -> Result<Option<Map<String, Value>>, ApiError> {
        let [own, step, grating, particle, drawn] = forms::SURFACES;
        let chosen = self.field("surface")?;
        if chosen == own {
            return Ok(None);
        }
        let length = |field: &str| {
            let value = Kind::Length.parse(self.field(field)?);
            value
                .map_err(|error| ApiError::input(error.to_string(), "as in \"10 nm\"").about(field))
        };
        let (height, line) = (length("height")?, length("size")?);
        let text = |value: f64| Kind::Length.format_exact(value);
        let feature = if chosen == step {
            json!({ "step": { "from": text(0.25 * line), "to": text(0.65 * line), "height": text(height) } })
        } else if chosen == grating {
            json!({ "grating": { "height": text(height), "period": text(0.25 * line) } })
        } else if chosen == particle {
            json!({ "particle": { "at": text(0.5 * line), "radius": text(0.5 * height) } })
        } else if chosen == drawn {
            let numbers = self.field("profile")?.split(',').map(str::parse::<f64>);
            let parts = numbers.collect::<Result<Vec<f64>, _>>().ok();
            let parts = parts.filter(|parts| (2..=MAX_DRAWN).contains(&parts.len()));
            let parts = parts.ok_or_else(|| {
                let message = format!("expected 2 to {MAX_DRAWN} heights between 0 and 1");
                ApiError::input(message, "draw the surface").about("profile")
            })?;
            let heights: Vec<f64> = parts.iter().map(|part| part * height).collect();
            // A drawn surface has no features in addition.
            let flat = json!({ "step": { "from": "0 m", "to": text(line), "height": "0 m" } });
            return Ok(Some(object(
                json!({ "profile": heights, "surface": [flat] }),
            )));
        } else {
            let known = forms::SURFACES.join(", ");
            return Err(ApiError::input(
                format!("expected a surface, got `{chosen}`"),
                format!("there are {known}"),
            ));
        };
        Ok(Some(object(json!({ "surface": [feature] }))))
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
            let drawn = Approached::of(&case, &report);
            let near = clicks::of_approach(&report, drawn.factor, &drawn.heights, &units);
            self.hand(Stage {
                clicks: json!({
                    "set": { "x": drawn.axis.json() },
                    "near": near,
                    "heights": clicks::of_heights(&drawn.heights, &units),
                    "fixed": clicks::fixed(&case, &[drawn.axis.key]),
                }),
                figure: Some(drawn.figure),
                words: progress(points, finest, "distances each way"),
                studies: &[("approach", &options)],
                ..Stage::default()
            })
        })
    }

    /// Measured data: over the model's curve, or with the fit of the model to them.
    fn measured(&self) -> Result<(), ApiError> {
        let case = self.request.case.any_distance(self.app)?;
        model_of(&case)?;
        let Some((name, text)) = &self.request.data else {
            return Err(ApiError::input("no data", "drop a file on the page"));
        };
        let table = Table::parse(name, text).map_err(ApiError::of)?;
        let options = |study| study_named(study).map_or_else(Map::new, |entry| self.options(entry));
        let of_fit = options(FitStudy::NAME);
        let mut named = object(json!({ "data": [name] }));
        if self.field("reconstruct").is_ok() {
            let mut of_curve = options(ReconstructStudy::NAME);
            // The form has the fit's default where both studies have an option.
            let given = |name: &String| of_fit.contains_key(name);
            let fitted = serde_json::to_value(FitOptions::default()).unwrap_or_default();
            of_curve.retain(|name, _| fitted.get(name).is_none() || given(name));
            let mut request: ReconstructOptions = read(Value::Object(of_curve.clone()))?;
            request.data = vec![table];
            named.extend(of_curve);
            return self.reconstructed(&case, &request, &named);
        }
        let mut request: FitOptions = read(Value::Object(of_fit.clone()))?;
        request.data = vec![table];
        named.extend(of_fit);
        if self.field("fit").is_err() {
            return self.over_model(&case, &request, &named);
        }
        if !request.pixels.is_empty() {
            return self.fitted_pixels(&case, &request, named);
        }
        let report = self.counting(FitStudy::COUNTED, |control| {
            FitStudy::run(&case, &request, control)
        })?;
        let found = Source {
            name: CASE_FILE.to_owned(),
            text: report.case_file.clone(),
        };
        let set = Case::parse(Some(found), &[]).map(|found| report::changes(&case, &found));
        let found = Found {
            set: set.ok(),
            take: "Use these values",
            file: report.case_file.clone(),
            save: "Case file of the fit",
            name: "best.toml",
        };
        let notes = report.reason.iter().chain(&report.remarks);
        let notes: Vec<&str> = notes.map(String::as_str).collect();
        let fits = if report.fits {
            "The model describes the data."
        } else {
            "The model does not describe the data."
        };
        self.hand(Stage {
            figure: Some(fit_figure(&report)),
            words: format!("{fits} {}", notes.join(". ")).trim_end().to_owned(),
            studies: &[("fit", &named)],
            tables: vec![parameters(&report)],
            found: Some(found),
            ..Stage::default()
        })
    }

    /// The fits of a force volume, one a pixel.
    fn fitted_pixels(
        &self,
        case: &Case,
        request: &FitOptions,
        mut named: Map<String, Value>,
    ) -> Result<(), ApiError> {
        let entry = study_named(FitStudy::NAME)
            .ok_or_else(|| ApiError::failed("this program has no fit"))?;
        let options = serde_json::to_value(request).map_err(nanotap::Error::from)?;
        let (summary, figure) = self.whole_dataset(entry, case, options)?;
        named.insert("out".into(), "fit.zarr".into());
        self.hand(Stage {
            figure,
            words: "One fit a pixel.".to_owned(),
            studies: &[(FitStudy::NAME, &named)],
            tables: report::tables(&summary, &Value::Null),
            ..Stage::default()
        })
    }

    /// Force and dissipation of measured data, without a contact law.
    fn reconstructed(
        &self,
        case: &Case,
        request: &ReconstructOptions,
        named: &Map<String, Value>,
    ) -> Result<(), ApiError> {
        let report = self.counting(ReconstructStudy::COUNTED, |control| {
            ReconstructStudy::run(case, request, control)
        })?;
        let method = match report.method {
            ReconstructMethod::AmplitudeModulation => "amplitude and phase",
            ReconstructMethod::FrequencyModulation => "frequency shift",
        };
        let set = self.table_law(case, &report);
        let negative = report.table.damping.iter().any(|damping| *damping < 0.0);
        let none = "as a law the force has no damping where it is negative";
        let notes = report.remarks.iter().map(String::as_str);
        let notes = notes.chain((set.is_some() && negative).then_some(none));
        let mut words = format!("Force from {method} of {} rows", report.rows.len());
        for note in notes {
            let _ = write!(words, "; {note}");
        }
        self.hand(Stage {
            figure: Some(reconstruct_figure(&report)),
            words,
            studies: &[(ReconstructStudy::NAME, named)],
            tables: vec![force_values(&report)],
            found: Some(Found {
                set,
                take: "Use as the sample's force table",
                file: report.csv(),
                save: "Force curve (CSV)",
                name: "force.csv",
            }),
            ..Stage::default()
        })
    }

    /// The changes to the case that take a reconstructed force as its contact law, where it can.
    fn table_law(&self, case: &Case, report: &ReconstructReport) -> Option<Map<String, Value>> {
        let change = case.law_change("table", case).ok()?;
        let mut set = object(json!({ Key::SampleLaw.path(): change.law }));
        for key in &change.dropped {
            set.insert(key.path().into(), "".into());
        }
        set.insert(Key::SampleTable.path().into(), force_rows(report).into());
        let mut spec = self.request.case.clone();
        for (key, text) in &set {
            spec.put(Key::find(key)?, text.as_str()?);
        }
        let taken = spec.any_distance(self.app).ok()?;
        taken.model().is_ok().then_some(set)
    }

    /// Measured data over the model's curve, where they are of the distance; otherwise alone.
    fn over_model(
        &self,
        case: &Case,
        request: &FitOptions,
        named: &Map<String, Value>,
    ) -> Result<(), ApiError> {
        let data = measured(case, request)?;
        let swept = data.swept.first().map(|swept| swept.key);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for row in data.rows() {
            let at = row.at.first().copied().unwrap_or(f64::NAN);
            (low, high) = (low.min(at), high.max(at));
        }
        let length = |value: f64| Kind::Length.format_exact(value);
        let distance = swept == Some(Key::GapTip) && case.is_physical() && low < high;
        let (mut figure, factor) = if distance {
            let options =
                object(json!({ "points": APPROACH[0], "from": length(high), "to": length(low) }));
            let report = self.report::<ApproachStudy>(case, &options)?;
            let Approached { figure, axis, .. } = Approached::of(case, &report);
            (figure, axis.factor)
        } else {
            let kind = swept.map_or(Kind::Number, Key::kind);
            let (factor, unit) = match kind {
                Kind::Number => (1.0, String::new()),
                kind => prefixed(kind, 1.0, low.abs().max(high.abs())),
            };
            let label = swept.map_or("", Key::path);
            let mut figure = Figure::new(1, data.columns.len());
            for column in &data.columns {
                let x = Axes::linear(label).unit(unit.clone());
                figure = figure.with(Panel::new(x, Axes::linear(column.name.clone())));
            }
            (figure, factor)
        };
        let heights = Height::of(&figure, &APPROACH_SHOWS);
        let mut left = Vec::new();
        for (k, column) in data.columns.iter().enumerate() {
            let place = if distance {
                heights
                    .iter()
                    .position(|height| height.is(column.quantity.name()))
            } else {
                Some(k)
            };
            let Some(panel) = place.and_then(|place| figure.panels.get_mut(place)) else {
                left.push(column.name.as_str());
                continue;
            };
            let drawn = |value: f64| match place.and_then(|place| heights.get(place)) {
                Some(height) if distance => height.of_measured(value),
                _ => value,
            };
            let points = data.rows().filter_map(|row| {
                let value = (*row.values.get(k)?)?;
                Some((factor * row.at.first()?, drawn(value)))
            });
            let markers = Markers::new(points)
                .open()
                .colour(Colour::BLACK)
                .label("measured");
            panel.layers.push(markers.into());
        }
        let mut words = format!(
            "{} rows. “Fit” finds the free parameters, “Force without a law” the force and the dissipation.",
            data.rows().count()
        );
        if !left.is_empty() {
            words.push_str(" Not drawn: ");
            words.push_str(&left.join(", "));
        }
        self.hand(Stage {
            figure: Some(figure),
            words,
            studies: &[("fit", named)],
            ..Stage::default()
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

/// The parts of a list of `NAME=VALUE`, whose values may contain commas.
fn pairs_of(text: &str) -> Vec<String> {
    let mut pairs: Vec<String> = Vec::new();
    for part in text.split(',').map(str::trim) {
        match pairs.last_mut() {
            Some(pair) if !part.contains('=') => *pair = format!("{pair},{part}"),
            _ => pairs.push(part.to_owned()),
        }
    }
    pairs
}

/// A command after lines that replace `[scan]`, the last table of a saved case.
fn with_scan(table: &str, command: &str) -> String {
    format!(
        "sed -i.bak '/^\\[scan\\]/,$d' {CASE_FILE}\ncat >> {CASE_FILE} <<'END'\n{table}END\n{command}"
    )
}

/// An approach curve as drawn.
struct Approached {
    figure: Figure,
    axis: Axis,
    /// From distances in the model's unit to drawn ones.
    factor: f64,
    heights: Vec<Height>,
}

impl Approached {
    fn of(case: &Case, report: &ApproachReport) -> Self {
        let units = case.units();
        let (factor, unit) = units.axis(Kind::Length, report.from.abs().max(report.to.abs()));
        let axis = match units.si(Kind::Length) {
            Some(metres) => Axis {
                key: Key::GapTip,
                factor: factor / metres,
                unit: unit.trim_matches([' ', '(', ')']).to_owned(),
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

/// The fitted parameters with their intervals.
fn parameters(report: &FitReport) -> Value {
    let text = |parameter: &FittedParameter, value: Option<f64>| match value {
        None => "not determined".to_owned(),
        Some(value) => {
            let of_unit = |kind: &Kind| kind.si_unit() == parameter.unit;
            let kind = Key::find(&parameter.key).map(Key::kind);
            let kind = kind.or_else(|| Kind::ALL.into_iter().find(of_unit));
            kind.unwrap_or(Kind::Number).format_digits(value, 4)
        }
    };
    let rows = report.parameters.iter().map(|one| {
        let name = match &one.curve {
            Some(curve) => format!("{} of {curve}", one.key),
            None => one.key.clone(),
        };
        let [low, high] = one.interval.map(|end| text(one, end));
        let cells = [
            name,
            text(one, Some(one.value)),
            text(one, one.standard_error),
            match one.interval {
                [None, None] => "not determined".to_owned(),
                _ => format!("{low} to {high}"),
            },
            text(one, Some(one.start)),
        ];
        report::row(&cells, None)
    });
    let heads = [
        ("parameter", "Key of the case, or correction of a column"),
        ("value", "Of the best fit"),
        ("standard error", ""),
        ("95 % interval", ""),
        ("began at", "Initial value"),
    ];
    report::table("", &heads, &rows.collect::<Vec<_>>())
}

/// The force of a reconstruction as rows of `sample.table`.
fn force_rows(report: &ReconstructReport) -> String {
    let table = &report.table;
    let damped = report.has_damping;
    let mut text = String::from("[[\"gap (nm)\", \"force (nN)\"");
    text.push_str(if damped {
        ", \"damping (N s/m)\"]"
    } else {
        "]"
    });
    let rows = table.distance.iter().zip(&table.force).zip(&table.damping);
    for ((distance, force), damping) in rows {
        let _ = write!(text, ", [{:.6e}, {:.6e}", 1e9 * distance, 1e9 * force);
        if damped {
            // A law has no negative damping.
            let _ = write!(text, ", {:.6e}", damping.max(0.0));
        }
        text.push(']');
    }
    text.push(']');
    text
}

/// The values of a reconstruction.
fn force_values(report: &ReconstructReport) -> Value {
    let shown = |kind: Kind, value: f64, digits: usize| {
        let kind = if report.physical { kind } else { Kind::Number };
        kind.format_digits(value, digits)
    };
    let energy = |value: f64| {
        if report.physical {
            format_electronvolts(value)
        } else {
            Kind::Number.format_digits(value, 4)
        }
    };
    let mut values = Vec::new();
    if let Some(minimum) = &report.minimum {
        let [force, error] = [(minimum.force, 4), (minimum.force_error, 2)]
            .map(|(value, digits)| shown(Kind::Force, value, digits));
        let at = shown(Kind::Length, minimum.distance, 4);
        values.push([
            "minimum of the force".to_owned(),
            format!("{force} ± {error} at {at}"),
        ]);
    }
    let dissipated = report.rows.iter().map(|row| row.dissipation);
    let dissipated = dissipated.fold(0.0, f64::max);
    values.extend([
        [
            "closest approach".to_owned(),
            shown(Kind::Length, report.closest, 4),
        ],
        [
            "largest dissipation".to_owned(),
            if report.has_damping {
                energy(dissipated)
            } else {
                "not determined".to_owned()
            },
        ],
        [
            "free amplitude and phase".to_owned(),
            format!(
                "{}, {}°",
                shown(Kind::Length, report.free_amplitude, 5),
                Kind::Number.format_digits(report.free_phase, 5)
            ),
        ],
        [
            "mean squared residual, in standard errors".to_owned(),
            Kind::Number.format_digits(report.chi2, 3),
        ],
    ]);
    let rows: Vec<Value> = values
        .iter()
        .map(|cells| report::row(cells, None))
        .collect();
    report::table("", &[("", ""), ("", "")], &rows)
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
