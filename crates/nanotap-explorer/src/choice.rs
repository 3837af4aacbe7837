//! A lever or a material of the catalogue: its values take the place of those of the case.

use nanotap::case::quantity::Kind;
use nanotap::case::{Case, Key};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::Explorer;
use crate::api_error::ApiError;
use crate::preset::CaseSpec;

/// A choice as requested by the page; an empty name keeps the present values as the case's own.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Choice {
    case: CaseSpec,
    key: String,
    name: String,
}

/// The keys whose values come from the catalogue, where it has them, in the order in which a change is
/// said. They are stated as numbers where the catalogue has a name.
const LEVER: [Key; 11] = [
    Key::LeverK,
    Key::LeverK1,
    Key::LeverF0,
    Key::TipRadius,
    Key::TipHeight,
    Key::LeverLength,
    Key::LeverWidth,
    Key::LeverThickness,
    Key::LeverModulus,
    Key::LeverDensity,
    Key::LeverF2,
];
const SAMPLE: [Key; 3] = [Key::SampleModulus, Key::SamplePoisson, Key::SampleStiffness];
const TIP: [Key; 3] = [Key::TipModulus, Key::TipPoisson, Key::TipDensity];
/// Relative distance from the resonance within which the drive follows it.
const AT_RESONANCE: f64 = 1e-3;

/// The keys to set, empty where they are no longer stated, and a sentence that says what changed.
pub(crate) fn changes(app: &Explorer, choice: &Choice) -> Result<Value, ApiError> {
    let case = choice.case.any_distance(app)?;
    let key = Key::find(&choice.key);
    let (key, governed): (Key, &[Key]) = match key {
        Some(key @ Key::LeverName) => (key, &LEVER),
        Some(key @ Key::SampleMaterial) => (key, &SAMPLE),
        Some(key @ Key::TipMaterial) => (key, &TIP),
        _ => {
            return Err(ApiError::input(
                format!("`{}` is not chosen from the catalogue", choice.key),
                "there are cantilever.lever, sample.material and tip.material",
            ));
        }
    };
    let mut set = Map::new();
    set.insert(key.path().into(), choice.name.clone().into());
    if choice.name.is_empty() {
        // Two ways to say one thing are not both stated.
        for own in governed.iter().filter(|own| case.get(**own).is_finite()) {
            let mut others = own.alternatives();
            if !others.any(|(other, _)| set.contains_key(other.path())) {
                set.insert(own.path().into(), text(&case, *own).into());
            }
        }
        return Ok(json!({ "set": set, "words": "" }));
    }
    for own in governed.iter().filter(|own| case.stated(**own).is_some()) {
        set.insert(own.path().into(), "".into());
    }
    let after = changed(app, choice, &set)?;
    let follows = key == Key::LeverName && is_at_resonance(&case);
    if follows {
        let there = text(&after, Key::LeverF0);
        set.insert(Key::DriveFrequency.path().into(), there.into());
    }
    // What the catalogue does not say stays as it was.
    for own in governed {
        let (had, has) = (case.get(*own), after.get(*own));
        if case.stated(*own).is_some() && had.is_finite() && !has.is_finite() {
            set.insert(own.path().into(), text(&case, *own).into());
        }
    }
    let after = changed(app, choice, &set)?;
    let words = governed.iter().filter_map(|own| said(&case, &after, *own));
    let words: Vec<String> = words.collect();
    let mut sentence = format!("{}: {}.", choice.name, words.join(", "));
    if words.is_empty() {
        sentence = format!("{}: the values are those of the case.", choice.name);
    }
    match key {
        Key::LeverName => {
            let quality = Kind::Number.format_digits(case.get(Key::LeverQ), 4);
            sentence += " Q stays ";
            sentence += &quality;
            sentence += ": makers do not state it, measure yours.";
            if follows {
                sentence += " The drive follows the resonance.";
            }
        }
        Key::SampleMaterial => sentence += " Attraction and adhesion stay as they were.",
        _ => {}
    }
    Ok(json!({ "set": set, "words": sentence }))
}

/// Whether the drive is at the resonance, and follows it.
pub(crate) fn is_at_resonance(case: &Case) -> bool {
    let [drive, resonance] = [Key::DriveFrequency, Key::LeverF0].map(|key| case.get(key));
    case.stated(Key::DriveFrequency).is_some() && (drive / resonance - 1.0).abs() < AT_RESONANCE
}

/// The case with these changes.
fn changed(app: &Explorer, choice: &Choice, set: &Map<String, Value>) -> Result<Case, ApiError> {
    let mut spec = choice.case.clone();
    for (key, value) in set {
        spec.replace(key, value.as_str().unwrap_or_default());
    }
    spec.any_distance(app)
        .map_err(|error| error.about(&choice.key))
}

/// The value of a key as it is written.
fn text(case: &Case, key: Key) -> String {
    key.kind().format_exact(case.get(key))
}

/// A change of a value in words; `None` if it is the same, was not known, or follows from others.
fn said(before: &Case, after: &Case, key: Key) -> Option<String> {
    let [had, has] = [before, after].map(|case| case.get(key));
    let differs = (had - has).abs() > 1e-9 * has.abs();
    let follows = key == Key::LeverK1 && before.stated(key).is_none();
    let is_said = had.is_finite() && has.is_finite() && differs && !follows;
    let shown = |value: f64| key.kind().format_digits(value, 4);
    let words = match key.entry().label {
        "" => key.meaning().split([',', ':']).next().unwrap_or_default(),
        label => label.split(" $").next().unwrap_or(label),
    };
    is_said.then(|| format!("{words} {} → {}", shown(had), shown(has)))
}
