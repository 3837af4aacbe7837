//! The studies of the command line, in stages of increasing resolution until they are cancelled.

mod approach;
mod basin;
mod calibrate;
mod diagram;
mod estimate;
mod image;
mod image_states;
mod levers;
mod line;
mod measured;
mod plan;
mod registered;
mod wishes;

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use nanotap::case::Case;
use nanotap::case::physical::Remark;
use nanotap::control::Control;
use nanotap::dataset::{Share, Store, Work};
use nanotap::model::Model;
use nanotap::study::registry::{DatasetPlan, Study, StudyEntry, study as study_named};
use nanotap::study::request::{Property, properties, read};
use nanotap::study::sweep::Over;
use nanotap_arithmetic::clock::Instant;
use nanotap_figures::Figure;
use schemars::Schema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::Explorer;
use crate::api_error::ApiError;
use crate::commands::{CASE_FILE, case_path, quoted, study_command, study_python};
use crate::content::Content;
use crate::figures::{drawn, over_pinned};
use crate::forms;
use crate::motion_request::model_of;
use crate::preset::CaseSpec;
use estimate::Trial;

/// Time between messages on the progress.
const BETWEEN: Duration = Duration::from_millis(300);
/// Most bytes of a dataset, before they are compressed.
const LARGEST_DATASET: usize = 1 << 30;

/// A study as requested by the page: its fields by name.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StudyRequest {
    case: CaseSpec,
    #[serde(default)]
    start: String,
    /// Name of a tab of the page, or of a study of the registry.
    tab: String,
    /// Measured data: name and content of the file.
    #[serde(default)]
    data: Option<(String, Content)>,
    options: Map<String, Value>,
    /// A figure whose curves are drawn behind this one.
    #[serde(default)]
    pinned: Option<Box<Figure>>,
    /// Whether the first stage is enough.
    #[serde(default)]
    quick: bool,
    /// Whether the answer is how long the study takes, from a short trial.
    #[serde(default)]
    estimate: bool,
}

/// Computes a study, and sends its stages to the page as they come.
pub(crate) fn study(
    app: &Explorer,
    request: &StudyRequest,
    control: &Control<'_>,
    hand_over: HandOver<'_>,
) -> Result<(), ApiError> {
    let studied = Studied {
        app,
        request,
        control,
        hand_over,
        trial: None,
    };
    if request.estimate {
        studied.estimated();
        return Ok(());
    }
    studied.run()
}

/// Sends a message to the page.
type HandOver<'a> = &'a (dyn Fn(Value) + Sync);

/// A study that is running, with its request and its connection to the page.
struct Studied<'a> {
    app: &'a Explorer,
    request: &'a StudyRequest,
    control: &'a Control<'a>,
    hand_over: HandOver<'a>,
    /// What a trial records; none for the study itself.
    trial: Option<&'a Trial>,
}

/// A finished stage of a study: what the page shows then.
#[derive(Default)]
struct Stage<'a> {
    figure: Option<Figure>,
    clicks: Value,
    words: String,
    /// What follows these words.
    remarks: Vec<Remark>,
    /// Names and requests of the studies in its figure.
    studies: &'a [Computed<'a>],
    /// The equivalent command and lines of Python, if they take no case.
    commands: Option<[String; 2]>,
    /// The form that the page shows from now on, if it is another one.
    form: Option<&'static str>,
    /// Additional lines of the case file: its table `[scan]`.
    scan: Option<String>,
    /// Tables that the page shows below the figure.
    tables: Vec<Value>,
    /// The channels of a line, as numbers.
    line: Option<Value>,
    /// The states of a measured image.
    image: Option<Value>,
    /// Whether the measured file has images, too.
    has_images: bool,
    found: Option<NextStep>,
}

/// A result of a study from which the user can go on.
#[derive(Serialize)]
struct NextStep {
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
            "diagram" => self.diagram(),
            "resonance" => self.resonance(),
            "map" => self.map(),
            "plan" => self.plan(),
            "wishes" => self.wishes(),
            "image" => self.image(),
            "line" => self.line(),
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
        if self.trial.is_some() {
            return work(self.control);
        }
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
        self.options_of(&(entry.request)())
    }

    /// The options with this schema that the form sets to another value than the default.
    fn options_of(&self, schema: &Schema) -> Map<String, Value> {
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
        properties(schema).filter_map(given).collect()
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
        if self.trial.is_some() {
            return Ok(());
        }
        let case = &self.request.case;
        let command = |(name, request): &Computed<'_>| study_command(self.app, case, name, request);
        let commands = stage.studies.iter().map(command);
        let commands: Vec<String> = commands.collect::<Result<_, _>>()?;
        let mut words = stage.words;
        for remark in &stage.remarks {
            words.push_str("; ");
            words.push_str(&remark.text);
        }
        let mut figure = stage.figure;
        if let (Some(own), Some(pinned)) = (&mut figure, &self.request.pinned)
            && !over_pinned(own, pinned)
        {
            words.push_str("; the pinned figure has other axes");
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
        if let Some([command, python]) = stage.commands {
            message["command"] = command.into();
            message["python"] = python.into();
        }
        if let Some(form) = stage.form {
            message["form"] = form.into();
        }
        if let Some(figure) = figure {
            message["figure"] = drawn(&figure)?;
        }
        if let Some(line) = stage.line {
            message["line"] = line;
        }
        if let Some(image) = stage.image {
            message["image"] = image;
        }
        if stage.has_images {
            message["has_images"] = true.into();
        }
        if let Some(found) = stage.found {
            message["found"] = json!(found);
        }
        (self.hand_over)(message);
        Ok(())
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
        self.begins(name, request);
        let request = Value::Object(request.clone());
        let plan = entry.plan(case, request, self.control)?;
        dataset(&plan, self.control, use_it)
    }

    /// Computes the stages one by one until the work is cancelled; `stage` gets its count and the
    /// finest one.
    fn stages(
        &self,
        counts: &[usize],
        mut stage: impl FnMut(usize, usize) -> Result<(), ApiError>,
    ) -> Result<(), ApiError> {
        let finest = counts.last().copied().unwrap_or_default();
        if let Some(trial) = self.trial {
            for count in [counts.first().copied().unwrap_or_default(), finest] {
                trial.stage(count);
                // An interrupted stage is an error.
                trial.ended(stage(count, finest).is_ok() && !self.control.is_cancelled());
            }
            return Ok(());
        }
        for &count in counts {
            stage(count, finest)?;
            if self.request.quick || self.control.is_cancelled() {
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

    /// The report of a study.
    fn report<S: Study>(
        &self,
        case: &Case,
        options: &Map<String, Value>,
    ) -> Result<S::Report, ApiError> {
        self.begins(S::NAME, options);
        let options: S::Options = read(Value::Object(options.clone()))?;
        Ok(S::run(case, &options, self.control)?)
    }
}

/// A dataset of a study, in memory.
fn dataset<T>(
    plan: &DatasetPlan,
    control: &Control<'_>,
    use_it: impl FnOnce(&Store) -> Result<T, ApiError>,
) -> Result<T, ApiError> {
    let schema = plan.schema();
    if schema.bytes().is_none_or(|bytes| bytes > LARGEST_DATASET) {
        return Err(ApiError::input(
            "the results would fill the memory",
            "fewer values, or compute them at the terminal with --out",
        ));
    }
    let store = Store::in_memory(schema.clone());
    let work = Work {
        share: Share::WHOLE,
        threads: 0,
        control: *control,
    };
    plan.compute(&store, &work).map_err(ApiError::of)?;
    use_it(&store)
}

/// A command after lines that replace `[scan]`, the last table of a saved case.
fn with_scan(table: &str, command: &str) -> String {
    format!(
        "sed -i.bak '/^\\[scan\\]/,$d' {CASE_FILE}\ncat >> {CASE_FILE} <<'END'\n{table}END\n{command}"
    )
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
