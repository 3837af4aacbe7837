//! The forms of the studies: their fields and initial values.

use nanotap::case::physical::Physical;
use nanotap::case::quantity::Kind;
use nanotap::case::{Case, Key, Value as Stated};
use nanotap::model::Model;
use nanotap::observe::time_series::state_names;
use nanotap::study::calibrate::CalibrateOptions;
use nanotap::study::image_states::ImageStatesOptions;
use nanotap::study::lever::{time_constant, usual_gain};
use nanotap::study::modes::ModeTable;
use nanotap::study::registry::{STUDIES, StudyEntry, study};
use nanotap::study::request::{Property, properties, schema};
use nanotap::study::simulate::SimulateStudy;
use nanotap::study::{Study as _, start_box::default_box};
use schemars::Schema;
use serde_json::{Value, json};

use crate::api_error::ApiError;
use crate::knobs;
use crate::maps::Shows;

/// The choice of a field that sets no condition.
pub(crate) const ANY: &str = "any";
/// The choice of a field that excludes a second motion.
pub(crate) const ONE_STATE: &str = "only one";
/// The choices of an option that is on or off.
pub(crate) const YES: &str = "yes";
const NO: &str = "no";
/// The choice of the tip of the case for other levers.
pub(crate) const OWN_TIP: &str = "of the case";
/// Studies with a tab, or a place on the page, made for them.
const PLACED: [&str; 10] = [
    "orbit",
    "attractors",
    "branch",
    "approach",
    "basin",
    "scan",
    "fit",
    "reconstruct",
    "image-states",
    "lever",
];
/// Values of a sweep, and along each axis of a window, to begin with.
const POINTS: [usize; 2] = [41, 8];

/// Whether the page makes the form of a study from its options, and shows its report.
pub(crate) fn is_plain(entry: &StudyEntry) -> bool {
    !PLACED.contains(&entry.name)
}

/// The studies whose tabs are made from the registry.
pub(crate) fn plain_studies() -> impl Iterator<Item = &'static StudyEntry> {
    STUDIES.iter().filter(|entry| is_plain(entry))
}

/// A study of the registry: its name, what it is about, and its form.
pub(crate) fn plain(entry: &StudyEntry) -> Value {
    json!({ "name": entry.name, "about": entry.about, "form": of_options(entry) })
}

/// The form of a study's options.
fn of_options(entry: &StudyEntry) -> Vec<Value> {
    let mut fields = of_schema(&(entry.request)());
    if entry.name == SimulateStudy::NAME {
        fields.retain(|field| OF_ONE_SHOT.iter().any(|name| field["name"] == *name));
        sort_first(&mut fields, &OF_ONE_SHOT);
    }
    fields
}

/// The field without which a simulation is no study of the page: its motions are there already.
pub(crate) const SIGNAL: &str = "drive_signal";
/// Options of a simulation under a signal of one shot.
const OF_ONE_SHOT: [&str; 3] = [SIGNAL, "periods", "state"];

/// Quality factor with which the free lever rings down: that of the closed loop under Q control.
pub(crate) fn quality_factor(view: &Physical) -> f64 {
    let case = &view.cantilever;
    let of_loop = || ModeTable::new(case).ok()?.quality?.first().copied();
    let of_loop = case.has_q_control().then(of_loop).flatten();
    of_loop.unwrap_or(view.lever.quality_factor)
}

/// A pulse that reaches the sample: it moves the tip by about twice the free amplitude, and towards the
/// sample first, since a lever with a low quality factor does not swing back as far.
fn pulse(case: &Case) -> String {
    let Some(view) = case.physical() else {
        return "pulse 0.3 times -10".to_owned();
    };
    let width = Kind::Time.format_digits(0.3 / case.get(Key::DriveFrequency), 1);
    let times = Kind::Number.format_digits(quality_factor(view).max(1.0), 2);
    format!("pulse {width} times -{times}")
}

/// The form of options with this schema.
fn of_schema(schema: &Schema) -> Vec<Value> {
    let own = |property: &Property<'_>| property.schema["x-own"] == true;
    let field = |property: Property<'_>| {
        let words = property.words();
        let mut field = json!({
            "name": property.name,
            "words": short(&property),
            "about": property.description(),
            "value": property.default().map_or_else(String::new, shown),
        });
        if property.allows("boolean") {
            field["choices"] = json!([NO, YES]);
        } else if !words.is_empty() {
            let empty = property.default().is_none().then_some("");
            let words = words.into_iter().map(|(word, _)| word);
            field["choices"] = empty.into_iter().chain(words).collect();
        } else {
            field["hint"] = property.schema["x-value"].clone();
        }
        field
    };
    properties(schema)
        .filter(|property| !own(property))
        .map(field)
        .collect()
}

/// Options of a calibration that are shown first.
const CALIBRATED_BY: [&str; 5] = ["sensitivity", "temperature", "averages", "length", "width"];

/// The fields of a thermal calibration.
fn calibration() -> Vec<Value> {
    let mut fields = of_schema(&schema::<CalibrateOptions>());
    sort_first(&mut fields, &CALIBRATED_BY);
    fields
}

/// Options of the states of an image that are shown first.
const OF_IMAGES: [&str; 5] = ["setpoint", "phase_offset", "sense", "direction", "convert"];

/// The fields of the states of an image.
fn image_states() -> Vec<Value> {
    let mut fields = of_schema(&schema::<ImageStatesOptions>());
    sort_first(&mut fields, &OF_IMAGES);
    fields
}

/// Puts fields with these names first.
fn sort_first(fields: &mut [Value], first: &[&str]) {
    fields.sort_by_key(|field| {
        let found = first.iter().position(|name| field["name"] == *name);
        found.unwrap_or(first.len())
    });
}

/// Longest words beside a field.
const SHORT: usize = 44;

/// What an option is, in few words: the beginning of its description, or its name.
fn short(property: &Property<'_>) -> String {
    let text = property.description();
    let first = text.split([':', ';', ',', '(', '.']).next();
    let first = first.unwrap_or_default().trim();
    if first.is_empty() || first.len() > SHORT {
        return property.name.replace('_', " ");
    }
    // A name such as "Poisson's ratio" or "A0" keeps its capital.
    let mut letters = first.chars();
    let head = letters.next().map(|head| head.to_lowercase().to_string());
    let is_name = first.starts_with("Poisson") || first.starts_with("Young");
    match head {
        Some(head) if !is_name => head + letters.as_str(),
        _ => first.to_owned(),
    }
}

/// A default as a form has it.
fn shown(value: &Value) -> String {
    match value {
        Value::Bool(true) => YES.to_owned(),
        Value::Bool(false) => NO.to_owned(),
        Value::String(text) => text.clone(),
        Value::Array(all) => all.iter().map(shown).collect::<Vec<_>>().join(","),
        other => other.to_string(),
    }
}

/// The condition that stands for a wish of the view Plan; none for any state.
pub(crate) fn wish(name: &str) -> Result<Option<&'static str>, ApiError> {
    let wishes = [
        ("one", Some("states = 1")),
        ("any", None),
        ("tap", Some("contact_fraction > 0")),
        ("away", Some("contact_fraction <= 0")),
    ];
    let found = wishes.into_iter().find(|(wish, _)| *wish == name);
    let names = wishes.map(|(wish, _)| wish).join(", ");
    let unknown = || {
        ApiError::input(
            format!("expected one of {names}, got `{name}`"),
            "choose one",
        )
    };
    found.map(|(_, condition)| condition).ok_or_else(unknown)
}

/// Peak force that an ordinary polymer survives.
const GENTLE: &str = "1 nN";

/// The fields of the forms with their initial values.
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
    let units = case.units();
    let entry = |which: &str, k: usize| {
        let side = sides
            .as_ref()
            .and_then(|sides| Some((*sides.lower().get(k)?, *sides.upper().get(k)?)))
            .unwrap_or((-1.0, 1.0));
        let name = names.get(k).map_or("", String::as_str);
        let short = |v: f64| units.shown_entry(name, v, 3);
        vec![
            json!({ "name": format!("entry{which}"), "words": "coordinate", "choices": names, "value": names.get(k) }),
            json!({ "name": format!("from{which}"), "words": "from", "value": short(side.0) }),
            json!({ "name": format!("to{which}"), "words": "to", "value": short(side.1) }),
        ]
    };
    let velocity = (names.len() - model.memory) / 2;
    // A lever with high Q responds in a narrow band.
    let band = case
        .physical()
        .map_or(0.25, |view| (4.0 / quality_factor(view)).clamp(1e-3, 0.25));
    let shows: Vec<&str> = Shows::ALL.iter().map(|shows| shows.words()).collect();
    let shown = json!({ "name": "show", "words": "show", "choices": shows, "value": shows[0] });
    let plane = [
        parameter("1", second, 0.5),
        parameter("2", frequency, band),
        vec![shown],
    ]
    .concat();
    // A lever is planned over its free amplitude and setpoint, an equation over its numbers.
    let (across, up) = if case.is_physical() {
        let mut up = parameter("2", Some(Key::DriveSetpoint), 0.0);
        up[0]["choices"] = json!([Key::DriveSetpoint.path()]);
        for (field, value) in [(1, "0.5"), (2, "0.95")] {
            up[field]["value"] = json!(value);
        }
        let mut across = parameter("1", named(&[Key::DriveFreeAmplitude]), 0.5);
        across[0]["choices"] = json!([Key::DriveFreeAmplitude.path()]);
        (across, up)
    } else {
        (parameter("1", second, 0.5), parameter("2", frequency, band))
    };
    let force = if case.is_physical() { GENTLE } else { "" };
    let conditions = vec![
        json!({ "name": "force", "words": "peak force below", "value": force, "hint": ANY }),
        json!({ "name": "regime", "words": "regime", "value": ANY,
            "choices": [ANY, "attractive", "repulsive"] }),
        json!({ "name": "states", "words": "motions", "value": ONE_STATE,
            "choices": [ONE_STATE, ANY] }),
    ];
    let plan = [across, up, conditions.clone()].concat();
    let levers = match case.physical() {
        Some(view) => levers(view.held.and(case.stated(Key::DriveSetpoint)), conditions),
        None => Vec::new(),
    };
    // What the studies of the registry that leave a dataset need.
    let text = |field: &Value| field["value"].as_str().unwrap_or_default().replace(' ', "");
    let range = |fields: &[Value], count: usize| {
        let parts: Vec<String> = fields.iter().map(text).collect();
        match parts.as_slice() {
            [key, from, to] if !key.is_empty() => format!("{key}={from}:{to}:{count}"),
            _ => String::new(),
        }
    };
    let (one, other) = (parameter("", frequency, band), parameter("", second, 0.5));
    let across_both = [&other, &one].map(|axis| range(axis, POINTS[1])).join(",");
    let usual = json!({
        "sweep": { "over": range(&one, POINTS[0]) },
        "window": { "over": across_both },
        (SimulateStudy::NAME): { (SIGNAL): pulse(case) },
    });
    let data = data(case);
    let image = image(case, base);
    let slice = [entry("x", 0), entry("y", velocity)].concat();
    let mut forms = json!({
        "usual": usual,
        "diagram": parameter("", frequency, band),
        "branches": parameter("", frequency, band),
        "resonance": parameter("", frequency, band),
        "approach": [
            json!({ "name": "from", "words": "from", "value": "", "hint": "clear of the sample" }),
            json!({ "name": "to", "words": "to", "value": "", "hint": "0" }),
        ],
        "map": plane,
        "plan": plan,
        "levers": levers,
        "data": data,
        "calibrate": calibration(),
        "image-states": image_states(),
        "image": image,
        "basin": slice,
    });
    if case.cantilever().is_none() {
        // An oscillator has no drive of one shot.
        forms[SimulateStudy::NAME] = json!([]);
    }
    forms
}

/// The fields of the comparison of levers.
fn levers(setpoint: Option<&Stated>, conditions: Vec<Value>) -> Vec<Value> {
    let setpoint = setpoint.map_or_else(|| "0.8".to_owned(), Stated::text);
    let own = vec![
        json!({ "name": "setpoint", "words": "setpoint", "value": setpoint }),
        json!({ "name": "tip", "words": "tip", "value": "of the lever",
            "choices": ["of the lever", OWN_TIP] }),
    ];
    [own, conditions].concat()
}

/// The field of the curve of a map, and what it says for all curves.
pub(crate) const CURVE: &str = "curve";
pub(crate) const WHOLE_MAP: &str = "all";

/// The fields of measured data: which curve of a map, the options of a fit, and those that a
/// reconstruction has in addition.
fn data(case: &Case) -> Vec<Value> {
    let mut fields: Vec<Value> = vec![json!({
        "name": CURVE,
        "words": "curve of a map",
        "value": "",
        "hint": format!("the first; a number from 0, or `{WHOLE_MAP}` to fit each"),
    })];
    for entry in ["fit", "reconstruct"].into_iter().filter_map(study) {
        let new = |field: &Value| fields.iter().all(|other| other["name"] != field["name"]);
        let more: Vec<Value> = of_options(entry).into_iter().filter(new).collect();
        fields.extend(more);
    }
    let moduli = [Key::SampleModulus, Key::SampleStiffness];
    let modulus = moduli.into_iter().find(|key| case.get(*key).is_finite());
    if let (Some(modulus), Some(free)) = (modulus, fields.iter_mut().find(|f| f["name"] == "free"))
    {
        free["value"] = format!("{modulus},gap.offset").into();
    }
    fields
}

/// Surfaces that the form of an image offers; that of the case's `[scan]` comes first, if it has one.
pub(crate) const SURFACES: [&str; 5] = [OWN_SURFACE, "step", "grating", "particle", DRAWN];
/// The surface that is drawn by hand.
pub(crate) const DRAWN: &str = "drawn";
/// A surface without features, which the view of a line offers, too.
pub(crate) const FLAT: &str = "flat";
const OWN_SURFACE: &str = "of the case";
/// Drive periods of a line in one direction.
const LINE_PERIODS: f64 = 5000.0;

/// The fields of an image: what the case's `[scan]` does not say has usual values.
fn image(case: &Case, base: &Case) -> Vec<Value> {
    let Some(view) = base.physical() else {
        return Vec::new();
    };
    let own = case.scan().is_some();
    let frequency = base.get(Key::DriveFrequency);
    // Half the rate at which the lever's amplitude follows.
    let gain = usual_gain(time_constant(quality_factor(view), frequency));
    let surfaces = &SURFACES[usize::from(!own)..];
    let field = |name: &str, words: &str, value: String| {
        let value = if own { String::new() } else { value };
        json!({ "name": name, "words": words, "value": value, "hint": OWN_SURFACE })
    };
    let rate = frequency / (2.0 * LINE_PERIODS);
    let shown = |kind: Kind, value: f64| kind.format_digits(value, 3);
    let slid = |mut field: Value, around: f64, unit: &str| {
        let (from, to) = (around / SLIDES, around * SLIDES);
        field["slider"] = json!({ "from": from, "to": to, "usual": around, "unit": unit });
        field
    };
    vec![
        json!({ "name": "surface", "words": "surface", "value": surfaces[0], "choices": surfaces }),
        json!({ "name": "height", "words": "height", "value": "10 nm" }),
        json!({ "name": "profile", "words": "", "value": "", "drawn": DRAWN }),
        field("size", "line length", "500 nm".to_owned()),
        field("setpoint", "setpoint", "0.8".to_owned()),
        slid(
            field("rate", "line rate", shown(Kind::Frequency, rate)),
            rate,
            "Hz",
        ),
        slid(
            field("gain", "integral gain (1/s)", shown(Kind::Number, gain)),
            gain,
            "",
        ),
    ]
}

/// The fields of a line: those of an image, and a flat surface; none for a case that is not a lever.
pub(crate) fn line(case: &Case) -> Vec<Value> {
    let mut fields = image(case, case);
    let size = case.scan().and_then(|scan| scan.get("size"));
    for field in &mut fields {
        match field["name"].as_str() {
            Some("surface") => {
                if let Some(choices) = field["choices"].as_array_mut() {
                    choices.push(json!(FLAT));
                }
            }
            // A feature is placed along a line of this length.
            Some("size") => match size {
                Some(Value::String(text)) => field["value"] = json!(text),
                Some(Value::Number(number)) => field["value"] = json!(format!("{number} m")),
                _ => {}
            },
            _ => {}
        }
    }
    fields
}

/// The ends of a slider are the usual value divided by and multiplied by this factor.
const SLIDES: f64 = 30.0;

/// A range around the value of a key, as text.
fn ends(base: &Case, key: Key, reach: f64) -> [String; 2] {
    let value = base.get(key);
    let value = if value.is_finite() {
        value
    } else {
        key.entry().example
    };
    let reach = match (key.kind(), base.physical()) {
        _ if value != 0.0 => reach * value.abs(),
        (Kind::Length, Some(view)) => view.free_amplitude,
        (_, Some(_)) => key.entry().example.abs(),
        (_, None) => 1.0,
    };
    [value - reach, value + reach].map(|value| key.kind().format_digits(value, 5))
}

#[cfg(test)]
mod tests {
    use nanotap::control::Control;
    use nanotap::study::drive_signal::StatedSignal;
    use nanotap::study::one_shot::one_shot;
    use nanotap::study::setpoint::at_setpoint;
    use nanotap::study::simulate::SimulateOptions;

    use super::*;
    use crate::preset;

    #[test]
    fn the_pulse_of_every_lever_reaches_the_sample() {
        let mut levers = 0;
        for preset in preset::all(None).unwrap() {
            let case = Case::parse(Some(preset.source()), &preset.set).unwrap();
            if case.cantilever().is_none() {
                continue;
            }
            let (case, _) = at_setpoint(case, &Control::default()).unwrap();
            let options = SimulateOptions {
                drive_signal: Some(StatedSignal::Text(pulse(&case))),
                ..SimulateOptions::default()
            };
            let read = options.signal(&case).unwrap().unwrap();
            let run = one_shot(&case, &read, &options, &Control::default()).unwrap();
            assert!(run.contacts > 0, "{}", preset.name);
            levers += 1;
        }
        assert_eq!(levers, 13);
    }
}
