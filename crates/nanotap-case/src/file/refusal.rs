//! Error messages of case files, with remedies.

use std::collections::BTreeMap;

use super::document::{Document, Entry, Value};
use super::problem::{Place, Problem, Problems};
use crate::key::{Key, ModelKind, Section};
use crate::near_name::near_name;
use crate::stated::quoted;
use nanotap_formula::Formula;
use nanotap_model::contact::ContactLaw;

/// Refuses keys outside tables, and unknown tables.
pub(super) fn misplaced(document: &Document, problems: &mut Problems) {
    let names = Section::ALL.map(Section::name);
    let unknown_table = |name: &str, place: &Place, shown: &str| {
        let problem = Problem::new(place.clone(), format!("`{shown}` is not a table of a case"));
        match near_name(name, names) {
            Some(meant) => problem
                .label(format!("did you mean [{meant}]?"))
                .help(format!("did you mean [{meant}]?")),
            None => problem.help(
                "the tables are [model], or [cantilever], [tip], [sample], [drive] and [gap]",
            ),
        }
    };
    for header in &document.headers {
        if Section::find(&header.name).is_none() {
            let shown = format!("[{}]", header.name);
            problems.add(|| unknown_table(&header.name, &header.place, &shown));
        }
    }
    let homeless: Vec<&Entry> = document
        .entries
        .iter()
        .filter(|entry| entry.table.is_empty())
        .collect();
    if let Some(first) = homeless.first() {
        let others = match homeless.len() - 1 {
            0 => String::from("is"),
            1 => String::from("and one more key are"),
            more => format!("and {more} more keys are"),
        };
        let problem = Problem::new(
            first.key_place.clone(),
            format!("`{}` {others} outside any table", first.key),
        );
        problems.add(|| {
            if Section::find(&first.key).is_some() {
                problem.help(format!("write it as a header: [{}]", first.key))
            } else {
                let table = tables_of(&first.key).next().unwrap_or(Section::Model);
                problem.help(format!("put a line [{}] before it", table.name()))
            }
        });
    }
    for entry in &document.entries {
        if entry.is_override() && Section::find(&entry.table).is_none() {
            problems.add(|| unknown_table(&entry.table, &entry.key_place, &entry.table));
        }
    }
}

/// The tables with a key of this name: those of dimensionless cases first.
fn tables_of(name: &str) -> impl Iterator<Item = Section> {
    let named = move |key: &Key| key.name() == name || key.alias() == Some(name);
    let all = Key::all().filter(named).map(Key::section);
    let (of_model, physical): (Vec<_>, Vec<_>) = all.partition(|table| *table == Section::Model);
    of_model.into_iter().chain(physical)
}

/// A word that is not one of the `allowed` ones.
pub(super) fn not_among(entry: &Entry, text: &str, allowed: &[&'static str]) -> Problem {
    let list = quoted(allowed);
    let problem = Problem::new(
        entry.value_place.clone(),
        format!("`{}` = {} is not one of {list}", entry.key, entry.written),
    );
    match near_name(text, allowed.iter().copied()) {
        Some(meant) => problem.help(format!("did you mean \"{meant}\"?")),
        None => problem.help(format!("write one of {list}")),
    }
}

/// One key by two of its names, or twice.
pub(super) fn same_key(before: &Entry, entry: &Entry) -> Problem {
    Problem::new(
        entry.key_place.clone(),
        format!("`{}` and `{}` are the same key", before.key, entry.key),
    )
    .label(format!("the same as `{}`", before.key))
    .help("keep one of the two")
}

pub(super) fn unknown_model_key(kind: ModelKind, entry: &Entry) -> Problem {
    let key = &entry.key;
    let problem = Problem::new(
        entry.key_place.clone(),
        format!("`{key}` (= {}) is not a key of [model]", entry.written),
    );
    if let Some(meant) = kind.near(key) {
        let hint = format!("did you mean `{meant}`?");
        return problem.label(hint.clone()).help(hint);
    }
    // Known elsewhere: in a physical table, or in another kind of model.
    let elsewhere = |known: &Key| known.is_physical() && known.name() == key;
    if let Some(meant) = Key::all().find(elsewhere)
        && kind == ModelKind::Cantilever
    {
        return problem.help(format!("did you mean `{meant}`, of a physical case?"));
    }
    let other = |other: &ModelKind| *other != kind && other.key(key).is_some();
    if let Some(other) = ModelKind::ALL.into_iter().find(other) {
        return problem.help(format!("it belongs to kind = \"{}\"", other.name()));
    }
    let names: Vec<&str> = kind.names().collect();
    problem.help(format!("the keys are {}", names.join(", ")))
}

/// Whether the formula of the sample's force has a parameter of this name.
fn is_in_formula(name: &str, document: &Document) -> bool {
    let force = document.entries.iter().rev().find(|entry| {
        entry.table == Section::Sample.name() && entry.key == Key::SampleForce.name()
    });
    let formula = force.and_then(|entry| Formula::parse(&entry.text()?).ok());
    formula.is_some_and(|formula| formula.parameters().iter().any(|own| own == name))
}

pub(super) fn unknown_physical_key(
    section: Section,
    entry: &Entry,
    document: &Document,
) -> Problem {
    let (table, key) = (section.name(), &entry.key);
    let problem = Problem::new(
        entry.key_place.clone(),
        format!("`{key}` (= {}) is not a key of [{table}]", entry.written),
    );
    let names: Vec<&str> = section.keys().map(Key::name).collect();
    if section == Section::Sample && is_in_formula(key, document) {
        return problem
            .help("write it below [sample.parameters]: it is a parameter of the formula");
    }
    if let Some(table) = tables_of(key).find(|table| *table != Section::Model) {
        return problem.help(format!("it is a key of [{}]", table.name()));
    }
    let is_law = section == Section::Sample && key == Key::Contact.name();
    let near = || near_name(key, names.iter().copied());
    match is_law.then(|| Key::SampleLaw.name()).or_else(near) {
        Some(meant) => {
            let hint = format!("did you mean `{meant}`?");
            problem.label(hint.clone()).help(hint)
        }
        None => problem.help(format!("the keys of [{table}] are {}", names.join(", "))),
    }
}

/// A physical case may state modelling options, but not dimensionless numbers.
pub(super) fn mixed(
    section: Section,
    kind: ModelKind,
    known: &BTreeMap<Key, &Entry>,
    problems: &mut Problems,
) {
    let table = section.name();
    if kind != ModelKind::Cantilever {
        problems.add(|| {
            Problem::new(Place::Whole, format!("an oscillator takes no [{table}]"))
                .help("write its numbers under [model]")
        });
    }
    // In the order of writing, which is that of the reader.
    let allowed = [Key::Modes, Key::CosineTerm, Key::Kind];
    let mut foreign: Vec<&Entry> = known
        .iter()
        .filter(|(key, _)| !key.is_physical() && !allowed.contains(key))
        .map(|(_, entry)| *entry)
        .collect();
    foreign.sort_by_key(|entry| entry.key_place.offset());
    let Some(first) = foreign.first() else { return };
    let others = match foreign.len() - 1 {
        0 => String::from("is"),
        1 => String::from("and one more key are"),
        more => format!("and {more} more keys are"),
    };
    problems.add(|| {
        Problem::new(
            first.key_place.clone(),
            format!(
                "`{}` {others} dimensionless, but [{table}] makes this a physical case",
                first.key
            ),
        )
        .label("dimensionless")
        .help(if first.key == Key::Contact.name() {
            "the law of a physical case is `law` in [sample]"
        } else {
            "a case is one or the other: with physical tables, [model] holds at most \
             modes and cosine_term"
        })
    });
}

/// Refuses alternatives that are stated together.
pub(super) fn twice(known: &BTreeMap<Key, &Entry>, problems: &mut Problems) {
    // A setpoint that was solved for has its distance and its motion.
    let solved = |key: Key| {
        [Key::GapTip, Key::DriveSetpoint].contains(&key) && known.contains_key(&Key::DriveStart)
    };
    for (&key, entry) in known {
        for (other, reason) in key.alternatives() {
            if other > key && known.contains_key(&other) && !(solved(key) && solved(other)) {
                problems.add(|| {
                    let message = format!("{key} and {other} cannot both be given: {reason}");
                    Problem::new(entry.value_place.clone(), message).key(Some(key.path()))
                });
            }
        }
    }
}

/// One problem for all missing keys.
pub(super) fn missing(
    document: &Document,
    kind: ModelKind,
    law: ContactLaw,
    known: &BTreeMap<Key, &Entry>,
) -> Option<Problem> {
    // A misspelt key is not missing.
    let meant: Vec<Key> = document
        .entries
        .iter()
        .filter(|entry| entry.table == "model" && kind.key(&entry.key).is_none())
        .take(super::SHOWN)
        .filter_map(|entry| kind.key(kind.near(&entry.key)?))
        .collect();
    let needed = |key: &Key| key.entry().means != crate::key::Means::Nothing;
    let missing: Vec<Key> = kind
        .keys()
        .filter(needed)
        .filter(|key| !known.contains_key(key) && !meant.contains(key))
        .filter(|key| key.default_under(law).is_none())
        .collect();
    if missing.is_empty() {
        return None;
    }
    let place = document
        .headers
        .iter()
        .find(|header| header.name == Section::Model.name())
        .map_or(Place::Whole, |header| header.place.clone());
    let names: Vec<&str> = missing.iter().map(|key| key.name()).collect();
    let list = names.join(", ");
    let message = if document.source.is_some() && document.entries.is_empty() {
        format!("empty case: missing {list}")
    } else if document.source.is_some() {
        format!("the case lacks {list}")
    } else if document.entries.is_empty() {
        "no case was given".to_owned()
    } else {
        format!("no case file: set every required key; missing: {list}")
    };
    let help = if document.source.is_some() {
        "write them under [model], for example"
    } else {
        "name a case file, or add for example"
    };
    let examples = missing.iter();
    let examples = examples.map(|key| format!("{key}={}", key.entry().example));
    let problem = Problem::new(place, message)
        .label("incomplete")
        .help(help)
        .words(examples.collect());
    Some(problem)
}

/// The number of an entry of `[model]`, or the problem that it is not a number.
pub(super) fn number(entry: &Entry) -> Result<f64, Problem> {
    let refuse = |what: String| Problem::new(entry.value_place.clone(), what).label("not a number");
    let Entry { key, written, .. } = entry;
    match &entry.value {
        Value::Integer(integer) => Ok(*integer as f64),
        Value::Number(number) => Ok(*number),
        Value::Text(text) => {
            let problem = refuse(format!("`{key}` = {written} is text, not a number"));
            Err(match text.trim().parse::<f64>() {
                Ok(number) => problem.help(format!("write it without quotes: {key} = {number}")),
                Err(_) => problem.help(format!(
                    "[model] takes plain numbers, as in {key} = 0.1; quantities with units \
                     belong in a physical case, under [cantilever] and its fellows"
                )),
            })
        }
        Value::Rows(_) | Value::Other(_) => {
            let what = entry.value.noun();
            Err(
                refuse(format!("`{key}` = {written} is {what}, not a number"))
                    .help(format!("write a number, as in {key} = 0.1")),
            )
        }
    }
}

/// The whole number from 1 to `most` of an entry.
pub(super) fn count(entry: &Entry, most: usize) -> Result<usize, Problem> {
    let key = &entry.key;
    let refuse = |why: &str| {
        let message = format!("`{key}` = {} {why}", entry.written);
        Problem::new(entry.value_place.clone(), message)
            .label("how many beam modes")
            .help(format!(
                "write a whole number from 1 to {most}, as in {key} = 3"
            ))
    };
    let outside = format!("is outside 1 … {most}");
    Err(match &entry.value {
        Value::Integer(integer) => match usize::try_from(*integer) {
            Ok(count) if (1..=most).contains(&count) => return Ok(count),
            _ => refuse(&outside),
        },
        Value::Number(number) if number.is_finite() && number.fract() == 0.0 => {
            let count = *number as usize;
            if *number >= 1.0 && count <= most {
                return Ok(count);
            }
            refuse(&outside)
        }
        Value::Number(_) => refuse("is not a whole number"),
        other => refuse(&format!("is {}, not a number", other.noun())),
    })
}

/// A value outside the range of its key.
pub(super) fn out_of_range(entry: &Entry, reason: &str) -> Problem {
    let message = format!("`{}` = {}: {reason}", entry.key, entry.written);
    Problem::new(entry.value_place.clone(), message).label("out of range")
}

/// The printed cosine term without base actuation.
pub(super) fn third_without_second(entry: &Entry) -> Problem {
    Problem::new(
        entry.value_place.clone(),
        "the drive has a third tone and no second one",
    )
    .help("call it the second, tone2_ratio")
}

pub(super) fn printed_term(entry: &Entry) -> Problem {
    Problem::new(
        entry.value_place.clone(),
        "the printed cosine term belongs to the drive through the base",
    )
    .help("leave cosine_term out, or write actuation = \"base\"")
}
