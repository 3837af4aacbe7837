//! The case file: from TOML and `key=value` words to a checked case.
//!
//! A file is one of three things, never a mix. A **dimensionless cantilever** has
//! `[model]` with `modes`, `alpha1` … `alpha6` and `omega` (or their readable names,
//! see [`Parameter`]); a one-degree-of-freedom **oscillator** has `[model]` with
//! `kind = "vibro_impact"` (soft stop) or `kind = "impact"` (rigid stop); a
//! **physical cantilever** has `[cantilever]`, `[tip]`, `[sample]`, `[drive]` and
//! `[gap]` with quantities in units, and in `[model]` at most `modes` and `cosine_term`.
//!
//! Nothing is guessed: unknown keys, values of the wrong kind or out of range, missing
//! and repeated keys are all reported at once, each with its place and a remedy.

mod document;
mod physical_tables;
mod problem;

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::Path;

pub use document::{Document, Entry, Header, Value};
pub use physical_tables::{PHYSICAL_KEYS, PhysicalTables};
pub use problem::{CaseFileError, Place, Problem, Source};

use crate::case::near_name::near_name;
use crate::model::cantilever::{Cantilever, CosineTerm};
use crate::model::contact::ContactLaw;
use crate::model::drive_form::{Actuation, FrequencyRatio};
use crate::model::oscillator::{Oscillator, OscillatorParameter, Stop};
use crate::model::parameter::Parameter;

/// How many modes a case has that does not say.
pub const DEFAULT_MODES: usize = 3;
/// No case file comes near; a larger file is something else.
const LARGEST_FILE: u64 = 1 << 20;

/// What a case file holds.
#[derive(Clone, Debug, PartialEq)]
pub enum CaseFile {
    /// A dimensionless cantilever, every field checked.
    Dimensionless(Cantilever),
    /// A one-degree-of-freedom oscillator with a stop, every field checked.
    Oscillator(Oscillator),
    /// A cantilever in physical units: its keys are checked, its quantities not yet.
    Physical(PhysicalTables),
}

impl CaseFile {
    /// Reads the file at `path`, if one is given, and puts the `key=value` words of
    /// `overrides` in place of what it says.
    ///
    /// # Errors
    /// Everything that is wrong with the file and the words, each with its place.
    pub fn load(path: Option<&Path>, overrides: &[String]) -> Result<Self, CaseFileError> {
        Self::parse(path.map(read).transpose()?, overrides)
    }

    /// The same for a text already in memory.
    ///
    /// # Errors
    /// As [`load`](Self::load), less what can go wrong in reading.
    pub fn parse(source: Option<Source>, overrides: &[String]) -> Result<Self, CaseFileError> {
        let mut document = source.map_or_else(|| Ok(Document::default()), Document::parse)?;
        let mut problems = Vec::new();
        for written in overrides {
            problems.extend(document.set(written).err());
        }
        let resolved = resolve(&document, &mut problems);
        match resolved {
            Some(case) if problems.is_empty() => Ok(case),
            _ => Err(CaseFileError::all(document.source, problems)),
        }
    }
}

/// A dimensionless case as a case file, every key written out.
pub fn to_toml(case: &Cantilever) -> String {
    use std::fmt::Write as _;
    let mut text = format!("[model]\nmodes = {}\n", case.modes);
    for parameter in case.parameters() {
        let (name, value) = (parameter.name(), case.get(parameter));
        let _ = writeln!(text, "{name} = {value:?}  # {}", parameter.meaning());
    }
    if case.cosine_term == CosineTerm::Printed {
        text.push_str("cosine_term = \"printed\"\n");
    }
    if case.actuation != Actuation::default() {
        let (name, meaning) = (case.actuation.name(), case.actuation.meaning());
        let _ = writeln!(text, "actuation = \"{name}\"  # {meaning}");
    }
    if let Some(ratio) = case.tone2_ratio {
        let _ = writeln!(
            text,
            "tone2_ratio = \"{ratio}\"  # frequency of the second tone over omega"
        );
    }
    if case.contact != ContactLaw::default() {
        let _ = writeln!(
            text,
            "contact = \"{}\"  # {}",
            case.contact,
            case.contact.meaning()
        );
    }
    text
}

/// Reads the text of a case file.
///
/// # Errors
/// When there is none, it cannot be read or is no text.
pub fn read(path: &Path) -> Result<Source, CaseFileError> {
    let name = path.display().to_string();
    let refuse = |why: String, help: &str| {
        CaseFileError::one(
            None,
            Problem::new(Place::Whole, format!("{name}: {why}")).help(help.to_owned()),
        )
    };
    let what = "name a TOML file with a case in it";
    if path.is_dir() {
        return Err(refuse("this is a folder".into(), what));
    }
    let mut bytes = Vec::new();
    let read = std::fs::File::open(path)
        .and_then(|file| file.take(LARGEST_FILE + 1).read_to_end(&mut bytes));
    match read {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Err(refuse("there is no such file".into(), what));
        }
        Err(error) => return Err(refuse(format!("cannot be read: {error}"), what)),
        Ok(_) if bytes.len() as u64 > LARGEST_FILE => {
            return Err(refuse("longer than 1 MiB, so not a case file".into(), what));
        }
        Ok(_) => {}
    }
    match String::from_utf8(bytes) {
        Ok(text) => Ok(Source { name, text }),
        Err(error) => {
            let offset = error.utf8_error().valid_up_to();
            Err(refuse(
                format!("not text: byte {offset} is not UTF-8"),
                what,
            ))
        }
    }
}

/// The kinds that `[model]` can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Cantilever,
    VibroImpact,
    Impact,
}

impl Kind {
    const ALL: [(&'static str, Self); 3] = [
        ("cantilever", Self::Cantilever),
        ("vibro_impact", Self::VibroImpact),
        ("impact", Self::Impact),
    ];

    /// The names of the numbers that this kind takes, `modes` not among them.
    fn numbers(self) -> Vec<&'static str> {
        match self {
            Self::Cantilever => Parameter::every().map(Parameter::name).collect(),
            Self::VibroImpact | Self::Impact => OscillatorParameter::ALL
                .iter()
                .filter(|parameter| match parameter {
                    OscillatorParameter::Restitution => self == Self::Impact,
                    OscillatorParameter::ContactStiffness | OscillatorParameter::ContactDamping => {
                        self == Self::VibroImpact
                    }
                    _ => true,
                })
                .map(|parameter| parameter.name())
                .collect(),
        }
    }

    /// Every key, aliases too, for finding the one that was meant.
    fn keys(self) -> Vec<&'static str> {
        let mut keys = self.numbers();
        keys.push("kind");
        if self == Self::Cantilever {
            keys.extend([
                "modes",
                "cosine_term",
                "contact",
                "actuation",
                "tone2_ratio",
            ]);
            let aliases = Parameter::every().map(Parameter::alias);
            keys.extend(aliases.filter(|alias| !Parameter::every().any(|p| p.name() == *alias)));
        }
        keys
    }

    /// The one name of a key, whichever of its names was written.
    fn canonical(self, key: &str) -> Option<&'static str> {
        if self == Self::Cantilever
            && let Ok(parameter) = key.parse::<Parameter>()
        {
            return Some(parameter.name());
        }
        self.keys().into_iter().find(|known| *known == key)
    }
}

/// The value of a key that need not be written, with a sample of this law.
fn default_of(kind: Kind, law: ContactLaw, key: &str) -> Option<f64> {
    let solid = law == ContactLaw::StandardLinearSolid;
    match (kind, key) {
        (Kind::Cantilever, "alpha5" | "tone2_amplitude" | "tone2_phase") => Some(0.0),
        (Kind::Cantilever, "alpha6") if solid => Some(0.0),
        (Kind::Cantilever, "relaxation_stiffness" | "relaxation_time") if !solid => Some(0.0),
        (Kind::VibroImpact | Kind::Impact, "mass") => Some(1.0),
        _ => None,
    }
}

/// The case that `document` describes, as far as its problems let it be built.
fn resolve(document: &Document, problems: &mut Vec<Problem>) -> Option<CaseFile> {
    let before = problems.len();
    misplaced(document, problems);
    let all_placed = problems.len() == before;
    let mut model: Vec<&Entry> = document
        .entries
        .iter()
        .filter(|entry| entry.table == "model")
        .collect();
    let kind = kind_of(&mut model, problems);
    let physical = physical_entries(document, problems);
    let is_physical = document
        .headers
        .iter()
        .any(|header| keys_of(&header.name).is_some())
        || document
            .entries
            .iter()
            .any(|entry| keys_of(&entry.table).is_some());
    if is_physical {
        let known = model_entries(Kind::Cantilever, &model, problems);
        refuse_mix(document, kind, &known, problems);
        let (modes, cosine_term) = (modes(&known, problems), cosine_term(&known, problems));
        return Some(CaseFile::Physical(PhysicalTables {
            source: document.source.clone(),
            headers: document.headers.clone(),
            modes: modes?,
            cosine_term: cosine_term?,
            entries: physical,
        }));
    }
    let known = model_entries(kind, &model, problems);
    // A key that was misspelt or stands in the wrong place is not missing.
    let meant: Vec<&str> = model
        .iter()
        .filter_map(|entry| near_name(&entry.key, kind.keys()))
        .collect();
    let found = |name: &str| {
        known.contains_key(name) || meant.iter().any(|key| kind.canonical(key) == Some(name))
    };
    let law = contact(&known, &mut Vec::new()).unwrap_or_default();
    let missing = all_placed
        .then(|| missing(document, kind, law, found))
        .flatten();
    match kind {
        Kind::Cantilever => {
            let case = cantilever(&known, problems);
            problems.extend(missing);
            case.map(CaseFile::Dimensionless)
        }
        Kind::VibroImpact | Kind::Impact => {
            let fields = oscillator(kind, &known, problems);
            problems.extend(missing);
            fields.map(CaseFile::Oscillator)
        }
    }
}

fn keys_of(table: &str) -> Option<&'static [&'static str]> {
    PHYSICAL_KEYS
        .iter()
        .find(|(name, _)| *name == table)
        .map(|(_, keys)| *keys)
}

/// Refuses keys outside any table, and tables that there are not.
fn misplaced(document: &Document, problems: &mut Vec<Problem>) {
    let tables = || PHYSICAL_KEYS.iter().map(|(name, _)| *name).chain(["model"]);
    let unknown_table = |name: &str, place: &Place, shown: &str| {
        let problem = Problem::new(place.clone(), format!("`{shown}` is not a table of a case"));
        match near_name(name, tables()) {
            Some(meant) => problem
                .label(format!("did you mean [{meant}]?"))
                .help(format!("did you mean [{meant}]?")),
            None => problem.help(
                "the tables are [model], or [cantilever], [tip], [sample], [drive] and [gap]",
            ),
        }
    };
    for header in &document.headers {
        if !tables().any(|known| known == header.name) {
            let shown = format!("[{}]", header.name);
            problems.push(unknown_table(&header.name, &header.place, &shown));
        }
    }
    let homeless: Vec<&Entry> = document
        .entries
        .iter()
        .filter(|entry| entry.table.is_empty())
        .collect();
    if let Some(first) = homeless.first() {
        let others = match homeless.len() - 1 {
            0 => String::from("stands"),
            1 => String::from("and one more key stand"),
            more => format!("and {more} more keys stand"),
        };
        let problem = Problem::new(
            first.key_place.clone(),
            format!("`{}` {others} outside any table", first.key),
        );
        problems.push(if tables().any(|table| table == first.key) {
            problem.help(format!("write it as a header: [{}]", first.key))
        } else {
            problem.help("put a line [model] before it")
        });
    }
    for entry in &document.entries {
        if entry.is_override() && !tables().any(|known| known == entry.table) {
            problems.push(unknown_table(&entry.table, &entry.key_place, &entry.table));
        }
    }
}

/// Which kind `[model]` is; takes the entries about it out of `model`.
fn kind_of(model: &mut Vec<&Entry>, problems: &mut Vec<Problem>) -> Kind {
    let said = model
        .iter()
        .rev()
        .find(|entry| entry.key == "kind")
        .copied();
    model.retain(|entry| entry.key != "kind");
    let Some(entry) = said else {
        return Kind::Cantilever;
    };
    let names = || Kind::ALL.iter().map(|(name, _)| *name);
    if let Value::Text(text) = &entry.value {
        if let Some((_, kind)) = Kind::ALL.iter().find(|(name, _)| name == text) {
            return *kind;
        }
        problems.push(not_among(entry, text, names()));
    } else {
        problems.push(not_among(entry, "", names()));
    }
    Kind::Cantilever
}

/// A word that is none of the `allowed` ones.
fn not_among(
    entry: &Entry,
    text: &str,
    allowed: impl Iterator<Item = &'static str> + Clone,
) -> Problem {
    let list: Vec<String> = allowed.clone().map(|word| format!("\"{word}\"")).collect();
    let problem = Problem::new(
        entry.value_place.clone(),
        format!(
            "`{}` = {} is not one of {}",
            entry.key,
            entry.written,
            list.join(", ")
        ),
    );
    match near_name(text, allowed) {
        Some(meant) => problem.help(format!("did you mean \"{meant}\"?")),
        None => problem.help(format!("write one of {}", list.join(", "))),
    }
}

/// The entries of `[model]` by their canonical names. What is set beside the file
/// replaces what the file says; a key twice in the file, by its two names, is refused.
fn model_entries<'a>(
    kind: Kind,
    model: &[&'a Entry],
    problems: &mut Vec<Problem>,
) -> BTreeMap<&'static str, &'a Entry> {
    let mut known: BTreeMap<&'static str, &Entry> = BTreeMap::new();
    for entry in model {
        let Some(name) = kind.canonical(&entry.key) else {
            problems.push(unknown_model_key(kind, entry));
            continue;
        };
        if let Some(before) = known.insert(name, entry)
            && !entry.is_override()
        {
            problems.push(
                Problem::new(
                    entry.key_place.clone(),
                    format!("`{}` and `{}` are the same key", before.key, entry.key),
                )
                .label(format!("the same as `{}`", before.key))
                .help("keep one of the two"),
            );
        }
    }
    known
}

fn unknown_model_key(kind: Kind, entry: &Entry) -> Problem {
    let key = &entry.key;
    let problem = Problem::new(
        entry.key_place.clone(),
        format!("`{key}` (= {}) is not a key of [model]", entry.written),
    );
    if let Some(meant) = near_name(key, kind.keys()) {
        let hint = format!("did you mean `{meant}`?");
        return problem.label(hint.clone()).help(hint);
    }
    // Known elsewhere: in a physical table, or in another kind of model.
    for (table, keys) in PHYSICAL_KEYS {
        if keys.contains(&key.as_str()) && kind == Kind::Cantilever {
            return problem.help(format!("did you mean `{table}.{key}`, of a physical case?"));
        }
    }
    for (name, other) in Kind::ALL {
        if other != kind && other.canonical(key).is_some() {
            return problem.help(format!("it belongs to kind = \"{name}\""));
        }
    }
    problem.help(format!("the keys are {}", kind.keys().join(", ")))
}

fn physical_entries(
    document: &Document,
    problems: &mut Vec<Problem>,
) -> BTreeMap<(&'static str, &'static str), Entry> {
    let mut known = BTreeMap::new();
    for entry in &document.entries {
        let Some((table, keys)) = PHYSICAL_KEYS.iter().find(|(name, _)| *name == entry.table)
        else {
            continue;
        };
        match keys.iter().find(|key| **key == entry.key) {
            Some(key) => {
                if let Value::Other(what) = entry.value {
                    problems.push(
                        Problem::new(
                            entry.value_place.clone(),
                            format!("`{table}.{key}` = {} is {what}", entry.written),
                        )
                        .help("write a quantity with its unit, in quotes, or a plain number"),
                    );
                }
                known.insert((*table, *key), entry.clone());
            }
            None => problems.push(unknown_physical_key(table, keys, entry)),
        }
    }
    known
}

fn unknown_physical_key(table: &str, keys: &[&'static str], entry: &Entry) -> Problem {
    let problem = Problem::new(
        entry.key_place.clone(),
        format!(
            "`{}` (= {}) is not a key of [{table}]",
            entry.key, entry.written
        ),
    );
    match near_name(&entry.key, keys.iter().copied()) {
        Some(meant) => {
            let hint = format!("did you mean `{meant}`?");
            problem.label(hint.clone()).help(hint)
        }
        None => problem.help(format!("the keys of [{table}] are {}", keys.join(", "))),
    }
}

/// A physical case may say how it is modelled, not what the dimensionless numbers are.
fn refuse_mix(
    document: &Document,
    kind: Kind,
    known: &BTreeMap<&'static str, &Entry>,
    problems: &mut Vec<Problem>,
) {
    let table = document
        .headers
        .iter()
        .map(|header| header.name.as_str())
        .chain(document.entries.iter().map(|entry| entry.table.as_str()))
        .find(|name| keys_of(name).is_some())
        .unwrap_or("cantilever");
    if kind != Kind::Cantilever {
        problems.push(
            Problem::new(Place::Whole, format!("an oscillator takes no [{table}]"))
                .help("write its numbers under [model]"),
        );
    }
    // In the order of writing, which is that of the reader.
    let mut foreign: Vec<&Entry> = known
        .iter()
        .filter(|(name, _)| !["modes", "cosine_term"].contains(name))
        .map(|(_, entry)| *entry)
        .collect();
    foreign.sort_by_key(|entry| match &entry.key_place {
        Place::Span(span) => span.start,
        Place::Override(_) | Place::Whole => usize::MAX,
    });
    if let Some(first) = foreign.first() {
        let others = match foreign.len() - 1 {
            0 => String::from("is"),
            1 => String::from("and one more key are"),
            more => format!("and {more} more keys are"),
        };
        problems.push(
            Problem::new(
                first.key_place.clone(),
                format!(
                    "`{}` {others} dimensionless, but [{table}] makes this a physical case",
                    first.key
                ),
            )
            .label("dimensionless")
            .help(
                "a case is one or the other: with physical tables, [model] holds at most \
                 modes and cosine_term",
            ),
        );
    }
}

/// The problem of keys that are not there, all in one.
fn missing(
    document: &Document,
    kind: Kind,
    law: ContactLaw,
    found: impl Fn(&str) -> bool,
) -> Option<Problem> {
    let missing: Vec<&str> = kind
        .numbers()
        .into_iter()
        .filter(|name| !found(name) && default_of(kind, law, name).is_none())
        .collect();
    if missing.is_empty() {
        return None;
    }
    let place = document
        .headers
        .iter()
        .find(|header| header.name == "model")
        .map_or(Place::Whole, |header| header.place.clone());
    let list = missing.join(", ");
    let message = if document.source.is_some() && document.entries.is_empty() {
        format!("an empty case: it lacks {list}")
    } else if document.source.is_some() {
        format!("the case lacks {list}")
    } else if document.entries.is_empty() {
        "no case was given".to_owned()
    } else {
        format!("without a case file --set must say all that has no default; it lacks {list}")
    };
    let example: Vec<String> = missing
        .iter()
        .map(|name| format!("{name}={}", example_of(kind, name)))
        .collect();
    let help = if document.source.is_some() {
        format!(
            "write them under [model], for example {}",
            example.join(", ")
        )
    } else {
        format!(
            "name a case file, or add for example --set {}",
            example.join(" --set ")
        )
    };
    Some(Problem::new(place, message).label("incomplete").help(help))
}

/// A sensible value to show: the paper's, or the impact oscillator of the tests.
fn example_of(kind: Kind, name: &str) -> String {
    let number = match (kind, name.parse::<Parameter>()) {
        (Kind::Cantilever, Ok(Parameter::RelaxationStiffness)) => 20.0,
        (Kind::Cantilever, Ok(Parameter::RelaxationTime)) => 0.1,
        (Kind::Cantilever, Ok(parameter)) => Cantilever::paper().get(parameter),
        _ => match name {
            "damping" | "gap" => 0.0,
            "contact_damping" => 0.2,
            "contact_stiffness" => 20.0,
            "omega" => 2.5,
            "restitution" => 0.8,
            _ => 1.0,
        },
    };
    number.to_string()
}

/// The number of an entry, or the problem that it is none.
fn number(entry: &Entry) -> Result<f64, Problem> {
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
        Value::Other(what) => Err(
            refuse(format!("`{key}` = {written} is {what}, not a number"))
                .help(format!("write a number, as in {key} = 0.1")),
        ),
    }
}

fn modes(known: &BTreeMap<&'static str, &Entry>, problems: &mut Vec<Problem>) -> Option<usize> {
    let Some(entry) = known.get("modes") else {
        return Some(DEFAULT_MODES);
    };
    let right = "write a whole number from 1 to 50, as in modes = 3";
    let refuse = |why: &str| {
        let message = format!("`modes` = {} {why}", entry.written);
        Problem::new(entry.value_place.clone(), message)
            .label("how many beam modes")
            .help(right)
    };
    let problem = match &entry.value {
        Value::Integer(integer) => match usize::try_from(*integer) {
            Ok(modes) if Cantilever::paper().with_modes(modes).validate().is_ok() => {
                return Some(modes);
            }
            _ => refuse("is outside 1 … 50"),
        },
        Value::Number(number) if number.is_finite() && number.fract() == 0.0 && *number > 50.0 => {
            refuse("is outside 1 … 50")
        }
        Value::Number(_) => refuse("is not a whole number"),
        Value::Text(_) => refuse("is text, not a number"),
        Value::Other(what) => refuse(&format!("is {what}, not a number")),
    };
    problems.push(problem);
    None
}

fn cosine_term(
    known: &BTreeMap<&'static str, &Entry>,
    problems: &mut Vec<Problem>,
) -> Option<CosineTerm> {
    let Some(entry) = known.get("cosine_term") else {
        return Some(CosineTerm::default());
    };
    let text = if let Value::Text(text) = &entry.value {
        text.as_str()
    } else {
        ""
    };
    match text {
        "corrected" => Some(CosineTerm::Corrected),
        "printed" => Some(CosineTerm::Printed),
        _ => {
            problems.push(not_among(entry, text, ["corrected", "printed"].into_iter()));
            None
        }
    }
}

fn contact(
    known: &BTreeMap<&'static str, &Entry>,
    problems: &mut Vec<Problem>,
) -> Option<ContactLaw> {
    let names = ContactLaw::ALL.map(ContactLaw::name);
    word(known, "contact", names.into_iter(), problems)
}

/// A word of a key, its default if it is not written.
fn word<T: Default + std::str::FromStr>(
    known: &BTreeMap<&'static str, &Entry>,
    key: &str,
    allowed: impl Iterator<Item = &'static str> + Clone,
    problems: &mut Vec<Problem>,
) -> Option<T> {
    let Some(entry) = known.get(key) else {
        return Some(T::default());
    };
    let text = if let Value::Text(text) = &entry.value {
        text.as_str()
    } else {
        ""
    };
    let read = text.parse().ok();
    if read.is_none() {
        problems.push(not_among(entry, text, allowed));
    }
    read
}

/// How the case is driven: where, and the ratio of a second tone.
fn drive_form(
    known: &BTreeMap<&'static str, &Entry>,
    problems: &mut Vec<Problem>,
) -> Option<(Actuation, Option<FrequencyRatio>)> {
    let names = Actuation::ALL.map(Actuation::name);
    let actuation: Option<Actuation> = word(known, "actuation", names.into_iter(), problems);
    let printed = known
        .get("cosine_term")
        .filter(|entry| entry.written.contains("printed"));
    if let (Some(entry), Some(Actuation::Tip | Actuation::Distributed)) = (printed, actuation) {
        problems.push(
            Problem::new(
                entry.value_place.clone(),
                "the printed cosine term belongs to the drive through the base",
            )
            .help("leave cosine_term out, or write actuation = \"base\""),
        );
        return None;
    }
    let Some(entry) = known.get("tone2_ratio") else {
        return Some((actuation?, None));
    };
    let read = match &entry.value {
        Value::Text(text) => text.parse::<FrequencyRatio>(),
        Value::Integer(_) | Value::Number(_) | Value::Other(_) => entry.written.parse(),
    };
    match read {
        Ok(ratio) => Some((actuation?, Some(ratio))),
        Err(error) => {
            problems.push(out_of_range(entry, &error.to_string()));
            None
        }
    }
}

fn cantilever(
    known: &BTreeMap<&'static str, &Entry>,
    problems: &mut Vec<Problem>,
) -> Option<Cantilever> {
    let (modes, cosine_term) = (modes(known, problems), cosine_term(known, problems));
    let mut case = Cantilever {
        alpha5: 0.0,
        ..Cantilever::paper()
    };
    let mut complete = true;
    let law = contact(known, problems);
    case.contact = law.unwrap_or_default();
    let form = drive_form(known, problems);
    (case.actuation, case.tone2_ratio) = form.unwrap_or_default();
    for parameter in Parameter::every() {
        let Some(entry) = known.get(parameter.name()) else {
            let default = default_of(Kind::Cantilever, case.contact, parameter.name());
            complete &= default.is_some();
            case = case.with(parameter, default.unwrap_or(0.0));
            continue;
        };
        let checked = number(entry).and_then(|value| {
            let checked = crate::model::cantilever::check(parameter, value);
            checked
                .map(|()| value)
                .map_err(|error| out_of_range(entry, &error.reason.to_string()))
        });
        match checked {
            Ok(value) => case = case.with(parameter, value),
            Err(problem) => {
                complete = false;
                problems.push(problem);
                continue;
            }
        }
        if let Some(reason) = case.misplaced(parameter) {
            problems.push(out_of_range(entry, &reason.to_string()));
        }
    }
    complete.then_some(())?;
    form?;
    Some(Cantilever {
        modes: modes?,
        cosine_term: cosine_term?,
        contact: law?,
        ..case
    })
}

fn out_of_range(entry: &Entry, reason: &str) -> Problem {
    let message = format!("`{}` = {}: {reason}", entry.key, entry.written);
    Problem::new(entry.value_place.clone(), message).label("out of range")
}

fn oscillator(
    kind: Kind,
    known: &BTreeMap<&'static str, &Entry>,
    problems: &mut Vec<Problem>,
) -> Option<Oscillator> {
    let stop = if kind == Kind::VibroImpact {
        Stop::Soft {
            stiffness: 1.0,
            damping: 0.0,
        }
    } else {
        Stop::Rigid { restitution: 1.0 }
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
        let name = parameter.name();
        let checked = match (
            known.get(name),
            default_of(kind, ContactLaw::default(), name),
        ) {
            (Some(entry), _) => number(entry).and_then(|value| {
                let alone = plain.with(parameter, value).validate();
                alone
                    .map(|()| value)
                    .map_err(|error| out_of_range(entry, error.expected))
            }),
            (None, Some(value)) => Ok(value),
            (None, None) => {
                complete = false;
                continue;
            }
        };
        match checked {
            Ok(value) => oscillator = oscillator.with(parameter, value),
            Err(problem) => {
                complete = false;
                problems.push(problem);
            }
        }
    }
    complete.then_some(oscillator)
}

#[cfg(test)]
mod tests;
