//! Studies without a hand-written text: every study of the registry is a command, with the flags of
//! its options, and prints its document.

use clap::{ArgMatches, Args as _, Command, FromArgMatches, Subcommand};
use nanotap::study::registry::{STUDIES, StudyEntry, study};
use serde_json::{Map, Value};

use super::Own;
use crate::arguments::CaseArguments;
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::{progress, request};

/// Longest list that the text shows.
const SHOWN: usize = 8;

/// A study by its entry, and what was typed of it.
#[derive(Debug)]
pub(crate) struct Arguments {
    entry: &'static StudyEntry,
    case: CaseArguments,
    given: Map<String, Value>,
}

impl Subcommand for Arguments {
    fn augment_subcommands(command: Command) -> Command {
        let others = STUDIES
            .iter()
            .filter(|entry| Self::has_subcommand(entry.name));
        command.subcommands(others.map(command_of))
    }

    fn augment_subcommands_for_update(command: Command) -> Command {
        Self::augment_subcommands(command)
    }

    fn has_subcommand(name: &str) -> bool {
        study(name).is_some() && !Own::has_subcommand(name)
    }
}

impl FromArgMatches for Arguments {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let missing = || clap::Error::new(clap::error::ErrorKind::MissingSubcommand);
        let (name, matches) = matches.subcommand().ok_or_else(missing)?;
        let entry = study(name).ok_or_else(missing)?;
        Ok(Self {
            entry,
            case: CaseArguments::from_arg_matches(matches)?,
            given: request::given(&(entry.request)(), matches),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The command of a study.
fn command_of(entry: &StudyEntry) -> Command {
    let command = CaseArguments::augment_args(Command::new(entry.name));
    // What the arguments of the case say of themselves is not what the command is about.
    let command = command.about(entry.about).long_about(None);
    command.args(request::arguments(&(entry.request)()))
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let entry = arguments.entry;
    let request = Value::Object(arguments.given.clone());
    let any_distance = (entry.any_distance)(&request)?;
    let case = GivenCase::for_study(&arguments.case, any_distance, output)?;
    let answer = progress::watched(entry.name, entry.counted, entry.partial, |control| {
        entry.answer(&case, request, control)
    })?;
    let document: Value = serde_json::from_str(&answer.document()?)
        .map_err(|error| Failure::numerics(format!("no JSON of the result: {error}")))?;
    output.stopped(document["cancelled"] == true);
    output.remarks(&answer.remarks());
    output.result(&document, text)
}

/// A line a field, without the case.
fn text(document: &Value) -> String {
    lines(document, "  ")
}

fn lines(document: &Value, indent: &str) -> String {
    let fields = document.as_object().into_iter().flatten();
    let line = |(name, value): (&String, &Value)| match value {
        Value::Object(_) => format!("{indent}{name}:\n{}", lines(value, &format!("{indent}  "))),
        _ => format!("{indent}{name}: {}\n", text_of(value)),
    };
    fields
        .filter(|(name, _)| !["case", "version"].contains(&name.as_str()))
        .map(line)
        .collect()
}

fn text_of(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(list) if list.len() > SHOWN => {
            format!("{} entries, which --json shows", list.len())
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As for a study that was added to the registry and nowhere else.
    #[test]
    fn a_study_of_the_registry_is_a_command() {
        let whole = Command::new("nanotap").subcommands(STUDIES.iter().map(command_of));
        whole.clone().debug_assert();
        let words = "nanotap lyapunov --periods 7 --set omega=3 --set alpha4=20";
        let matches = whole.try_get_matches_from(words.split(' ')).unwrap();
        let typed = Arguments::from_arg_matches(&matches).unwrap();
        assert_eq!(typed.entry.name, "lyapunov");
        assert_eq!(typed.given["periods"], 7);
        assert_eq!(typed.case.set, ["omega=3", "alpha4=20"]);
    }

    /// The page prints `--plot` for studies with a figure.
    #[test]
    fn a_command_has_plot_where_its_study_has_a_figure() {
        let whole = Own::augment_subcommands(Command::new("nanotap"));
        for entry in STUDIES {
            let command = whole.find_subcommand(entry.name);
            let mut flags = command.into_iter().flat_map(Command::get_arguments);
            let has_plot = flags.any(|flag| flag.get_long() == Some("plot"));
            assert_eq!(has_plot, entry.has_figure, "{}", entry.name);
        }
    }

    #[test]
    fn its_text_is_a_line_a_field() {
        let document = serde_json::json!({
            "case": {}, "version": "0", "verdict": "two modes", "modes": [1, 2], "path": vec![0; 9],
            "unit": {"symbol": "m", "si": 1},
        });
        assert_eq!(
            text(&document),
            "  verdict: two modes\n  modes: [1,2]\n  path: 9 entries, which --json shows\n  unit:\n    \
             symbol: m\n    si: 1\n"
        );
    }
}
