//! Facts about the result of a command.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

use serde_json::Value;

/// One pinned line: `name`, or `name = value`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fact {
    pub(crate) name: String,
    pub(crate) value: String,
}

impl Fact {
    fn new(name: impl Into<String>, value: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            value: value.into(),
        }
    }

    /// Parses the fact in a line of a snapshot.
    pub(crate) fn read(line: &str) -> Self {
        let (name, value) = line.split_once(" = ").unwrap_or((line, ""));
        Self::new(name, value)
    }
}

impl fmt::Display for Fact {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.value.as_str() {
            "" => formatter.write_str(&self.name),
            value => write!(formatter, "{} = {value}", self.name),
        }
    }
}

/// Facts about the printed output.
pub(crate) fn printed(line: &str, code: i32, stdout: &str, stderr: &str) -> Vec<Fact> {
    let mut facts = vec![Fact::new("exit", code.to_string())];
    if code != 0 {
        assert_eq!(stdout, "", "nanotap {line}");
        facts.extend(
            names(stderr)
                .into_iter()
                .map(|word| Fact::new(format!("says {word}"), "")),
        );
    } else if line.contains("--help") {
        facts.extend(offered(stdout).into_iter().map(|name| Fact::new(name, "")));
    } else if line.contains("--json") {
        let document = serde_json::from_str(stdout)
            .unwrap_or_else(|error| panic!("nanotap {line}: {error} in {stdout}"));
        facts.extend(flat("json ", &document));
    }
    facts
}

/// Words of a message that name something: keys, options, numbers, places.
fn names(message: &str) -> BTreeSet<String> {
    let edges = |c: char| {
        matches!(
            c,
            '`' | '\'' | '"' | ',' | '.' | ';' | ':' | '(' | ')' | '?' | '‘' | '’'
        )
    };
    message
        .lines()
        // Of a line of the case file, its content, not its number.
        .map(|line| line.split_once(" |").map_or(line, |(_, quoted)| quoted))
        .flat_map(str::split_whitespace)
        .filter(|word| {
            let core = word.trim_matches(edges);
            word.starts_with(['`', '\''])
                || core.contains(|c: char| "_=./:-".contains(c) || c.is_ascii_digit())
                || core.chars().skip(1).any(char::is_uppercase)
        })
        .map(|word| word.trim_matches(edges).to_owned())
        .filter(|word| word.contains(char::is_alphanumeric))
        .filter(|word| !word.starts_with("nanotap") && word != "--help")
        .collect()
}

/// Options in a help text, and the values of choices.
fn offered(help: &str) -> BTreeSet<String> {
    help.lines()
        .flat_map(|line| {
            let line = line.trim_start();
            let choice = line
                .strip_prefix("- ")
                .and_then(|rest| rest.split([':', ' ']).next())
                .map(|word| format!("choice {word}"));
            let option = line
                .starts_with('-')
                .then(|| line.split_whitespace().find(|word| word.starts_with("--")))
                .flatten()
                .map(|word| format!("option {}", word.trim_end_matches(',')));
            choice.into_iter().chain(option)
        })
        .collect()
}

/// Entries whose numbers depend on time, rounding, step control or random numbers.
const FLEETING: [&str; 17] = [
    "seconds",
    "periods_per_second",
    "residual",
    "distance_to_orbit",
    "error",
    "errors",
    "determinant_defect",
    "stored",
    "transient",
    "nanotap_version",
    "evaluations",
    "evaluations_per_period",
    // Of chaos; that of an orbit follows from its multipliers.
    "lyapunov",
    "steps",
    "start",
    // Of a proof: widths of enclosures and the reach of the uniqueness test.
    "radius",
    "unique_within",
];

/// Arrays whose entries after the first depend on step control.
const STEPPED: [&str; 1] = ["points"];

/// A document as facts, one for each path: the types and the values of the first entries.
fn flat(prefix: &str, document: &Value) -> Vec<Fact> {
    let mut entries = Entries::default();
    entries.take("", document, true);
    entries
        .0
        .into_iter()
        .map(|(path, (types, values))| {
            let types: Vec<&str> = types.into_iter().collect();
            let value = std::iter::once(types.join("|"))
                .chain(values)
                .collect::<Vec<_>>();
            let path = if path.is_empty() { "/" } else { &path };
            Fact::new(format!("{prefix}{path}"), value.join(" "))
        })
        .collect()
}

/// Types and first values by path.
#[derive(Default)]
struct Entries(BTreeMap<String, (BTreeSet<&'static str>, Vec<String>)>);

impl Entries {
    /// Adds `value` at `path`, with its values if they are `kept`.
    fn take(&mut self, path: &str, value: &Value, kept: bool) {
        let name = path
            .trim_end_matches("/*")
            .rsplit('/')
            .next()
            .unwrap_or_default();
        let kept = kept && !FLEETING.contains(&name) && !path.ends_with("/branches/*/points");
        let (types, values) = self.0.entry(path.to_owned()).or_default();
        let word = match value {
            Value::Null => "null",
            Value::Bool(_) => "bool",
            Value::Number(_) => "number",
            Value::String(_) => "string",
            Value::Array(_) => "array",
            Value::Object(_) => "object",
        };
        types.insert(word);
        match value {
            Value::Array(entries) => {
                let first = if STEPPED.contains(&name) { 1 } else { 2 };
                for (index, entry) in entries.iter().enumerate() {
                    self.take(&format!("{path}/*"), entry, kept && index < first);
                }
            }
            Value::Object(entries) => {
                for (key, entry) in entries {
                    self.take(&format!("{path}/{key}"), entry, kept);
                }
            }
            // Sentences may be improved.
            Value::String(text) if text.contains(' ') => {}
            Value::Null => {}
            other if kept => values.push(other.to_string()),
            _ => {}
        }
    }
}

/// Every file below `root` that can be pinned, datasets as one file, sorted.
pub(crate) fn files(root: &Path) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && path.extension().is_none_or(|ending| ending != "zarr") {
                folders.push(path);
            } else {
                found.insert(path);
            }
        }
    }
    found
}

/// Facts about a file that a command wrote.
pub(crate) fn file(root: &Path, path: &Path) -> Vec<Fact> {
    let name = path.strip_prefix(root).unwrap().display().to_string();
    let read = || std::fs::read_to_string(path).unwrap();
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("csv") => csv(&name, &read()),
        Some("svg") => svg(&name, &read()),
        Some("toml") => toml(&name, &read()),
        Some("zarr") => {
            let metadata = std::fs::read_to_string(path.join(".zmetadata")).unwrap();
            zarr(&name, &serde_json::from_str(&metadata).unwrap())
        }
        _ => vec![Fact::new(format!("file {name}"), "")],
    }
}

/// The header and the first row, without changing entries.
fn csv(name: &str, text: &str) -> Vec<Fact> {
    let mut lines = text.lines();
    let header = lines.next().unwrap_or_default();
    let mut facts = vec![Fact::new(format!("csv {name} header"), header)];
    facts.extend(lines.next().map(|row| {
        let kept: Vec<&str> = header
            .split(',')
            .zip(row.split(','))
            .map(|(column, value)| {
                if FLEETING.contains(&column) {
                    "*"
                } else {
                    value
                }
            })
            .collect();
        Fact::new(format!("csv {name} row"), kept.join(","))
    }));
    facts
}

/// The words in a figure, without the numbers at ticks.
fn svg(name: &str, text: &str) -> Vec<Fact> {
    let mut words = BTreeSet::new();
    for piece in text.split("<text").skip(1) {
        let Some((_, inside)) = piece.split_once('>') else {
            continue;
        };
        let inside = inside.split("</text>").next().unwrap_or_default();
        // Subscripts and the like are nested spans.
        let mut plain = String::new();
        for (index, span) in inside.split('<').enumerate() {
            plain.push_str(if index == 0 {
                span
            } else {
                span.split_once('>').map_or("", |s| s.1)
            });
        }
        let plain = plain.split_whitespace().collect::<Vec<_>>().join(" ");
        if plain.contains(char::is_alphabetic) {
            words.insert(plain);
        }
    }
    words
        .into_iter()
        .map(|words| Fact::new(format!("svg {name} {words}"), ""))
        .collect()
}

fn toml(name: &str, text: &str) -> Vec<Fact> {
    text.lines()
        .filter_map(|line| line.split('#').next()?.split_once('='))
        .map(|(key, value)| Fact::new(format!("toml {name} {}", key.trim()), value.trim()))
        .collect()
}

/// Variables with their types and dimensions, and every attribute.
fn zarr(name: &str, metadata: &Value) -> Vec<Fact> {
    let mut facts = Vec::new();
    for (key, entry) in metadata["metadata"].as_object().unwrap() {
        if let Some(variable) = key.strip_suffix("/.zarray") {
            let dims = &metadata["metadata"][&format!("{variable}/.zattrs")]["_ARRAY_DIMENSIONS"];
            let dtype = entry["dtype"].as_str().unwrap();
            facts.push(Fact::new(
                format!("zarr {name} {variable}"),
                format!("{dtype} {dims}"),
            ));
        } else if let Some(variable) = key.strip_suffix(".zattrs") {
            let variable = variable.trim_end_matches('/');
            for (attribute, value) in entry.as_object().unwrap() {
                facts.extend(self::attribute(
                    &format!("zarr {name} {variable}@{attribute}"),
                    attribute,
                    value,
                ));
            }
        }
    }
    facts
}

fn attribute(prefix: &str, name: &str, value: &Value) -> Vec<Fact> {
    match value.as_str().map(serde_json::from_str::<Value>) {
        _ if name == "_ARRAY_DIMENSIONS" => Vec::new(),
        _ if FLEETING.contains(&name) => vec![Fact::new(prefix, "")],
        // A nested document.
        Some(Ok(document)) if document.is_object() || document.is_array() => {
            flat(prefix, &document)
        }
        _ => vec![Fact::new(prefix, value.to_string())],
    }
}
