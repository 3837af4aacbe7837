//! Interpretation of a document, key by key.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::document::{Document, Entry, Value as Written};
use super::problem::{CaseFileError, Place, Problem, Problems, Source};
use super::refusal;
use crate::key::{Key, ModelKind, Section, Takes};
use crate::quantity::{Kind, Quantity};
use crate::stated::{Origin, Replaced, Said, Stated, Value};
use nanotap_model::cantilever::{self, Cantilever, CosineTerm};
use nanotap_model::contact::ContactLaw;
use nanotap_model::drive_form::Actuation;
use nanotap_model::lever_mode::LeverMode;
use nanotap_model::oscillator::{Oscillator, OscillatorParameter, Stop};
use nanotap_model::parameter::Parameter;

/// The content of a case file and its overrides.
#[expect(clippy::large_enum_variant, reason = "cases are few")]
#[derive(Debug)]
pub(crate) enum Described {
    /// A dimensionless cantilever, every number checked.
    Cantilever(Cantilever),
    /// An oscillator, every number checked.
    Oscillator(Oscillator),
    /// A physical cantilever, each value checked separately.
    Physical(Stated),
}

/// The effective entries by key.
type Known<'a> = BTreeMap<Key, &'a Entry>;

/// A case and its table `[scan]`, if it has one.
pub(crate) type DescribedWithScan = (
    Described,
    Option<serde_json::Map<String, serde_json::Value>>,
);

/// Reads a text, if there is one, with the `key=value` words of `overrides`.
///
/// # Errors
/// All problems of the text and the words, each with its place.
pub(crate) fn parse_with_scan(
    source: Option<Source>,
    overrides: &[String],
) -> Result<DescribedWithScan, CaseFileError> {
    let mut document = source.map_or_else(|| Ok(Document::default()), Document::parse)?;
    let mut problems = Problems::default();
    for written in overrides {
        if let Err(problem) = document.set(written) {
            problems.add(|| problem);
        }
    }
    match described(&document, &mut problems) {
        Some(described) if problems.is_empty() => Ok((described, document.scan)),
        _ => Err(CaseFileError::of(document.source, problems)),
    }
}

/// The content of `document`, if its problems allow.
fn described(document: &Document, problems: &mut Problems) -> Option<Described> {
    refusal::misplaced(document, problems);
    let all_placed = problems.is_empty();
    let kind = kind_of(document, problems);
    let said = (document.entries.iter()).filter(|entry| !entry.is_nothing());
    let tables = || document.headers.iter().map(|header| &header.name);
    let physical = tables()
        .chain(said.map(|entry| &entry.table))
        .filter_map(|name| Section::find(name))
        .find(|section| section.is_physical());
    if let Some(section) = physical {
        let known = known(document, ModelKind::Cantilever, problems);
        refusal::mixed(section, kind, &known, problems);
        let stated = stated(document, &known, problems);
        refusal::twice(&known, problems);
        return Some(Described::Physical(stated));
    }
    let known = known(document, kind, problems);
    let stated = stated(document, &known, problems);
    let law = word(&stated, Key::Contact).unwrap_or_default();
    let missing = all_placed
        .then(|| refusal::missing(document, kind, law, &known))
        .flatten();
    let read = match kind {
        ModelKind::Cantilever => {
            cantilever(&known, &stated, law, problems).map(Described::Cantilever)
        }
        _ => oscillator(kind, &known, &stated, problems).map(Described::Oscillator),
    };
    if let Some(missing) = missing {
        problems.add(|| missing);
        return None;
    }
    read
}

/// Kind of model that `[model]` selects; the default if it states none.
fn kind_of(document: &Document, problems: &mut Problems) -> ModelKind {
    let is_kind = |entry: &&Entry| entry.table == "model" && entry.key == Key::Kind.name();
    let Some(entry) = document.entries.iter().rev().find(is_kind) else {
        return ModelKind::default();
    };
    let text = match &entry.value {
        Written::Text(text) => text.as_str(),
        _ => "",
    };
    let named = |kind: &ModelKind| kind.name() == text;
    ModelKind::ALL.into_iter().find(named).unwrap_or_else(|| {
        let words = ModelKind::ALL.map(ModelKind::name);
        problems.add(|| refusal::not_among(entry, text, &words));
        ModelKind::default()
    })
}

/// The entries by key. Overrides replace the entries of the file and alternatives of their keys;
/// one key under two names is refused. A distance that the file solved for its setpoint, and the
/// motion there, are those of the case without overrides: with one they are left to the setpoint.
fn known<'a>(document: &'a Document, kind: ModelKind, problems: &mut Problems) -> Known<'a> {
    let mut known = Known::new();
    let (mut of_file, mut is_changed) = (BTreeSet::new(), false);
    for entry in &document.entries {
        let Some(section) = Section::find(&entry.table) else {
            continue;
        };
        let key = match section {
            Section::Model => kind.key(&entry.key),
            _ => section
                .key(&entry.key)
                .or_else(|| parameter(section, entry, known.keys().copied())),
        };
        let Some(key) = key else {
            problems.add(|| match section {
                Section::Model => refusal::unknown_model_key(kind, entry),
                _ => refusal::unknown_physical_key(section, entry, document),
            });
            continue;
        };
        if entry.is_override() {
            is_changed |= key != Key::DriveStart;
        } else {
            of_file.insert(key);
        }
        if key.is_of_formula() && entry.is_override() {
            // Its value may be of another kind, or none.
            known.retain(|other, _| *other == key || other.path() != key.path());
        }
        if entry.is_nothing() {
            known.remove(&key);
            continue;
        }
        if entry.is_override() {
            for (other, _) in key.alternatives() {
                if known
                    .get(&other)
                    .is_some_and(|entry: &&Entry| !entry.is_override())
                {
                    known.remove(&other);
                }
            }
        }
        let Some(before) = known.insert(key, entry) else {
            continue;
        };
        let overrides = before.is_override() && before.key != entry.key;
        if overrides || !entry.is_override() {
            problems.add(|| refusal::same_key(before, entry));
        }
    }
    let solved = [Key::DriveSetpoint, Key::GapTip, Key::DriveStart];
    if is_changed && solved.iter().all(|key| of_file.contains(key)) {
        known.retain(|key, entry| {
            entry.is_override() || ![Key::GapTip, Key::DriveStart].contains(key)
        });
    }
    known
}

/// The key of a parameter of a formula. Its value tells its kind; a number without a unit is one of the kind
/// that a parameter of this name has already.
fn parameter(section: Section, entry: &Entry, mut known: impl Iterator<Item = Key>) -> Option<Key> {
    if section != Section::Sample {
        return None;
    }
    let text = entry.text().unwrap_or_default();
    let is_bare = text.trim().parse::<f64>().is_ok();
    let same = |key: &Key| key.is_of_formula() && key.name() == entry.key;
    if let Some(key) = known.find(same).filter(|_| is_bare) {
        return Some(key);
    }
    let dimension = text.parse::<Quantity>().map(|read| read.dimension);
    let kind = dimension.ok().and_then(Kind::of).unwrap_or(Kind::Number);
    Key::of_formula(&entry.key, kind)
}

/// Entries of the file that an override of another key replaces, unless they were removed by their
/// own name.
fn replaced(document: &Document, known: &Known<'_>) -> Vec<Replaced> {
    let set = known.iter().filter(|(_, entry)| entry.is_override());
    let others = set.flat_map(|(&by, _)| by.alternatives().map(move |(key, _)| (by, key)));
    let mut found: Vec<Replaced> = Vec::new();
    for (by, key) in others {
        let named = |entry: &&Entry| entry.table == key.section().name() && entry.key == key.name();
        // The last entry of a key counts.
        let entry = document.entries.iter().rev().find(named);
        if let Some(entry) = entry
            && !entry.is_override()
            && !known.contains_key(&key)
            && !found.iter().any(|other| other.key == key)
        {
            let written = entry.written.clone();
            found.push(Replaced { key, written, by });
        }
    }
    found
}

/// The values of `known`, each checked separately, with their places.
fn stated(document: &Document, known: &Known<'_>, problems: &mut Problems) -> Stated {
    let mut stated = Stated::default();
    let mut origin = Origin {
        source: document.source.clone(),
        headers: document.headers.clone(),
        said: Vec::with_capacity(known.len()),
        replaced: replaced(document, known),
    };
    for (&key, &entry) in known {
        match value(key, entry) {
            Ok(value) => stated.put(key, value),
            Err(problem) => problems.add(|| problem.key(Some(key.path()))),
        }
        let said = Said {
            name: entry.key.clone(),
            written: entry.written.clone(),
            key_place: entry.key_place.clone(),
            value_place: entry.value_place.clone(),
        };
        origin.said.push((key, said));
    }
    stated.origin = Arc::new(origin);
    stated
}

/// The value of an entry, or what is wrong with it.
fn value(key: Key, entry: &Entry) -> Result<Value, Problem> {
    if key.is_physical() {
        return physical_value(key, entry);
    }
    let text = match &entry.value {
        Written::Text(text) => text.as_str(),
        _ => "",
    };
    match key.entry().takes {
        Takes::Count(most) => {
            let modes = refusal::count(entry, most)?;
            Ok(Value::Number(modes as f64, Kind::Number))
        }
        Takes::Word(words) => key
            .read(text)
            .map_err(|_| refusal::not_among(entry, text, words)),
        takes @ (Takes::ModelArms | Takes::ModelLeverModes) => {
            let read = match &entry.value {
                Written::Rows(rows) => takes.of_table(rows),
                _ => takes.parse_table(text),
            };
            read.map_err(|error| {
                Problem::new(entry.value_place.clone(), format!("{key}: {error}"))
                    .help(error.remedy)
            })
        }
        Takes::FrequencyRatio => {
            let text = if text.is_empty() {
                &entry.written
            } else {
                text
            };
            key.read(text)
                .map_err(|error| refusal::out_of_range(entry, &error.to_string()))
        }
        _ => Ok(Value::Number(refusal::number(entry)?, Kind::Number)),
    }
}

fn physical_value(key: Key, entry: &Entry) -> Result<Value, Problem> {
    let at = |message: String| Problem::new(entry.value_place.clone(), message);
    let takes = key.entry().takes;
    if let (true, Written::Rows(rows)) = (takes.is_table(), &entry.value) {
        return takes
            .of_table(rows)
            .map_err(|error| at(format!("{key}: {error}")).help(error.remedy));
    }
    let Some(text) = entry.text() else {
        let what = entry.value.noun();
        let help = match takes {
            Takes::LeverModes => crate::lever_modes::SHAPE,
            _ => "write a quantity with its unit, in quotes, or a plain number",
        };
        return Err(at(format!("`{key}` = {} is {what}", entry.written)).help(help));
    };
    let value = key.read(&text).map_err(|error| {
        use crate::stated::ValueError;
        match error {
            ValueError::Quantity(error) => at(format!("{key}: {error}")),
            ValueError::Table(error) => at(format!("{key}: {error}")).help(error.remedy),
            ValueError::Ratio(error) => at(format!("{key} = {text}: {error}")),
            ValueError::State(error) => at(format!("{key}: {error}")),
            ValueError::Law { given } => refusal::not_among(entry, &given, &crate::stated::laws()),
            ValueError::Word { words, .. } => Problem {
                message: format!(
                    "{key} = \"{text}\" is not one of {}",
                    crate::stated::quoted(words)
                ),
                ..refusal::not_among(entry, &text, words)
            },
        }
    })?;
    match key.objection(&value) {
        None => Ok(value),
        Some(reason) => Err(at(format!("{key} = {text}: {reason}"))),
    }
}

impl Key {
    /// The reason why a value of a physical key is invalid, if it is.
    pub(crate) fn objection(self, value: &Value) -> Option<&'static str> {
        let Value::Number(number, kind) = value else {
            return None;
        };
        if self.entry().takes == Takes::Setpoint {
            let right = match *kind {
                Kind::Frequency => *number != 0.0,
                Kind::Number => *number > 0.0 && *number < 1.0,
                _ => *number > 0.0,
            };
            return (!right).then_some(
                "a setpoint is a fraction of the free amplitude between 0 and 1, an amplitude such as \
                 \"8 nm\", a peak force such as \"1 nN\", a phase such as \"120 deg\" or a frequency \
                 shift such as \"-50 Hz\"",
            );
        }
        let range = self.entry().range;
        (!range.contains(*number)).then_some(range.reason)
    }
}

/// The variant that a stated word names; the default if none is stated.
pub(crate) fn word<T: core::default::Default + std::str::FromStr>(
    stated: &Stated,
    key: Key,
) -> Option<T> {
    match stated.get(key) {
        Some(Value::Word(word)) => word.parse().ok(),
        _ => Some(T::default()),
    }
}

/// Number of modes: stated, that of the measured modes, or the default for a beam.
pub(crate) fn modes(stated: &Stated) -> usize {
    let measured = lever_modes(stated).map(<[LeverMode]>::len);
    let default = || measured.unwrap_or(crate::DEFAULT_MODES);
    let number = stated.number(Key::Modes);
    number.map_or_else(default, |modes| modes as usize)
}

/// The measured modes of the lever, if they are stated.
fn lever_modes(stated: &Stated) -> Option<&[LeverMode]> {
    let keys = [Key::LeverModes, Key::ModelLeverModes];
    keys.into_iter().find_map(|key| match stated.get(key)? {
        Value::LeverModes(modes) => Some(modes.modes()),
        _ => None,
    })
}

fn cantilever(
    known: &Known<'_>,
    stated: &Stated,
    law: ContactLaw,
    problems: &mut Problems,
) -> Option<Cantilever> {
    let before = problems.found.len();
    let mut case = Cantilever {
        modes: modes(stated),
        alpha5: 0.0,
        contact: law,
        actuation: word::<Actuation>(stated, Key::Actuation)?,
        cosine_term: word(stated, Key::CosineTerm)?,
        further_tones: Key::TONE_RATIOS
            .into_iter()
            .map_while(|key| match stated.get(key) {
                Some(Value::Ratio(ratio)) => Some(*ratio),
                _ => None,
            })
            .collect(),
        ..Cantilever::paper()
    };
    if let (None, Some(entry)) = (stated.get(Key::Tone2Ratio), known.get(&Key::Tone3Ratio)) {
        problems.add(|| refusal::third_without_second(entry));
    }
    if let (CosineTerm::Printed, Actuation::Tip | Actuation::Distributed, Some(entry)) = (
        case.cosine_term,
        case.actuation,
        known.get(&Key::CosineTerm),
    ) {
        problems.add(|| refusal::printed_term(entry));
    }
    let mut complete = true;
    for parameter in Parameter::every() {
        let key = Key::of(parameter);
        let Some(value) = stated.number(key).or_else(|| key.default_under(law)) else {
            complete = false;
            continue;
        };
        case = case.with(parameter, value);
        let Some(entry) = known.get(&key) else {
            continue;
        };
        let refused = cantilever::check(parameter, value)
            .err()
            .map(|error| error.reason);
        if let Some(reason) = refused.or_else(|| case.misplaced(parameter)) {
            problems
                .add(|| refusal::out_of_range(entry, &reason.to_string()).key(Some(key.path())));
        }
    }
    if let Some(Value::Arms(arms)) = stated.get(Key::RelaxationArms) {
        let points = arms.arms().points().iter();
        case.arms = points.map(|&(time, stiffness)| [time, stiffness]).collect();
    }
    case.lever_modes = lever_modes(stated).unwrap_or_default().to_vec();
    for error in [
        case.check_arms(),
        case.check_tones(),
        case.check_lever_modes(),
    ]
    .into_iter()
    .filter_map(Result::err)
    {
        let key = ModelKind::Cantilever.key(error.key);
        let entry = key.and_then(|key| known.get(&key));
        let place = entry.map_or(Place::Whole, |entry| entry.value_place.clone());
        problems.add(|| Problem::new(place, error.to_string()).key(key.map(Key::path)));
    }
    (complete && problems.found.len() == before).then_some(case)
}

fn oscillator(
    kind: ModelKind,
    known: &Known<'_>,
    stated: &Stated,
    problems: &mut Problems,
) -> Option<Oscillator> {
    let stop = match kind {
        ModelKind::Impact => Stop::Rigid { restitution: 1.0 },
        _ => Stop::Soft {
            stiffness: 1.0,
            damping: 0.0,
        },
    };
    // Valid, so that each value can be checked by itself.
    let plain = Oscillator {
        mass: 1.0,
        stiffness: 1.0,
        damping: 0.0,
        forcing: 1.0,
        omega: 1.0,
        gap: 0.0,
        stop,
    };
    let (mut oscillator, mut complete) = (plain, true);
    for parameter in OscillatorParameter::ALL {
        if plain.get(parameter).is_none() {
            continue;
        }
        let key = Key::of_oscillator(parameter);
        let default = || key.default_under(ContactLaw::default());
        let Some(value) = stated.number(key).or_else(default) else {
            complete = false;
            continue;
        };
        oscillator = oscillator.with(parameter, value);
        if let (Err(error), Some(entry)) =
            (plain.with(parameter, value).validate(), known.get(&key))
        {
            complete = false;
            problems.add(|| refusal::out_of_range(entry, error.expected).key(Some(key.path())));
        }
    }
    complete.then_some(oscillator)
}
