//! The equivalent command line and lines of Python.

use std::fmt::Write as _;

use nanotap::study::registry;
use serde_json::{Map, Value};

use crate::Explorer;
use crate::api_error::ApiError;
use crate::motion_request::{MotionRequest, Start};
use crate::preset::CaseSpec;

/// File name of the saved case.
pub(crate) const CASE_FILE: &str = "case.toml";

/// The path of the case file in commands: the given file if nothing was changed, otherwise the
/// saved one.
pub(crate) fn case_path(app: &Explorer, case: &CaseSpec) -> Result<String, ApiError> {
    Ok(if case.is_a_file(app)? {
        case.preset(app)?.path.clone()
    } else {
        CASE_FILE.to_owned()
    })
}

/// The command for the same motion.
pub(crate) fn command(
    app: &Explorer,
    request: &MotionRequest,
    study: &str,
) -> Result<String, ApiError> {
    let mut line = format!(
        "nanotap {study} {}",
        quoted(&case_path(app, &request.case)?)
    );
    let start = Start::parse(&request.start)?;
    if let Some(period) = start.period {
        let _ = write!(line, " --period {period}");
    }
    if let Some(state) = &start.state {
        let is_physical = request.case.any_distance(app)?.is_physical();
        let units = if is_physical { "model_units=" } else { "" };
        let _ = write!(line, " --state={units}{}", Start::text(None, state));
    }
    Ok(line)
}

/// The command of a study with its options.
pub(crate) fn study_command(
    app: &Explorer,
    case: &CaseSpec,
    name: &str,
    request: &Map<String, Value>,
) -> Result<String, ApiError> {
    let mut line = format!("nanotap {name}");
    for file in request
        .get("data")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
    {
        let _ = write!(line, " {}", quoted(&text(file)));
    }
    let _ = write!(line, " {}", quoted(&case_path(app, case)?));
    for (option, value) in request.iter().filter(|(option, _)| *option != "data") {
        let flag = option.replace('_', "-");
        match value {
            Value::Bool(true) => {
                let _ = write!(line, " --{flag}");
            }
            Value::Array(values) if ["over", "where", "set"].contains(&option.as_str()) => {
                for value in values {
                    let _ = write!(line, " --{flag} {}", quoted(&text(value)));
                }
            }
            // Only options that are on by default are given as off.
            Value::Bool(false) => {
                let _ = write!(line, " --no-{flag}");
            }
            Value::Null => {}
            Value::Array(values) => {
                let values: Vec<String> = values.iter().map(text).collect();
                let _ = write!(line, " --{flag}={}", quoted(&values.join(",")));
            }
            other => {
                let _ = write!(line, " --{flag}={}", quoted(&text(other)));
            }
        }
    }
    if registry::study(name).is_some_and(|entry| entry.has_figure) {
        let _ = write!(line, " --plot {name}.svg");
    }
    Ok(line)
}

fn text(value: &Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}

/// A word quoted for a shell.
pub(crate) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "=:,._/+-".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// The lines of Python for the same motion.
pub(crate) fn python(
    app: &Explorer,
    request: &MotionRequest,
    study: &str,
) -> Result<String, ApiError> {
    let path = case_path(app, &request.case)?;
    let start = Start::parse(&request.start)?;
    let mut options = String::new();
    if let Some(period) = start.period {
        let _ = write!(options, ", period={period}");
    }
    if let Some(state) = &start.state {
        let numbers = Start::text(None, state).replace(',', ", ");
        let is_physical = request.case.any_distance(app)?.is_physical();
        let _ = if is_physical {
            write!(options, ", state={{\"model_units\": [{numbers}]}}")
        } else {
            write!(options, ", state=[{numbers}]")
        };
    }
    Ok(format!(
        "import nanotap\n\ncase = nanotap.Case.from_file({path:?})\nmotion = nanotap.{study}(case{options})\n"
    ))
}

/// The lines of Python for the same studies.
pub(crate) fn study_python(
    app: &Explorer,
    case: &CaseSpec,
    studies: &[(&str, &Map<String, Value>)],
) -> Result<String, ApiError> {
    let path = case_path(app, case)?;
    let words = studies
        .iter()
        .filter_map(|(_, request)| request.get("set")?.as_array());
    let words = words
        .flatten()
        .filter_map(|word| word.as_str()?.split_once('='));
    let words: Vec<String> = words
        .map(|(key, text)| format!("{key:?}: {text:?}"))
        .collect();
    let set = match words.as_slice() {
        [] => String::new(),
        words => format!(", **{{{}}}", words.join(", ")),
    };
    let mut text = format!("import nanotap\n\ncase = nanotap.Case.from_file({path:?}{set})\n");
    for (name, request) in studies {
        let name = match *name {
            // The fits of a map are another function of Python.
            "fit" if request.contains_key("out") => "fit_map".to_owned(),
            name => name.replace('-', "_"),
        };
        let _ = write!(text, "{name} = nanotap.{name}(case");
        let stated = |(option, _): &(&String, &Value)| !["set", "out"].contains(&option.as_str());
        for (option, value) in request.iter().filter(stated) {
            // `from` is a keyword of Python.
            let option = if option == "from" { "from_" } else { option };
            let value = match value {
                Value::Bool(true) => "True".to_owned(),
                Value::Bool(false) => "False".to_owned(),
                Value::Null => "None".to_owned(),
                other => other.to_string(),
            };
            let _ = write!(text, ", {option}={value}");
        }
        text.push_str(")\n");
    }
    Ok(text)
}
