//! The flags of a study, from the declaration of its options.

use std::marker::PhantomData;

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use nanotap::study::request::{self, Property};
use schemars::{JsonSchema, Schema};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::failure::{Failure, flag};

/// The flags that were given for a request, not yet checked.
#[derive(Clone, Debug)]
pub(crate) struct Request<R> {
    given: Map<String, Value>,
    of: PhantomData<R>,
}

impl<R: JsonSchema + DeserializeOwned> Request<R> {
    /// Parses and checks the request.
    pub(crate) fn read(&self) -> Result<R, Failure> {
        request::read(Value::Object(self.given.clone()))
    }
}

impl<R: JsonSchema> Args for Request<R> {
    fn augment_args(command: Command) -> Command {
        command.args(arguments(&request::schema::<R>()))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<R: JsonSchema> FromArgMatches for Request<R> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        Ok(Self {
            given: given(&request::schema::<R>(), matches),
            of: PhantomData,
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The flags of a request, by its schema.
pub(crate) fn arguments(schema: &Schema) -> Vec<Arg> {
    flags(schema).map(argument).collect()
}

/// The options that were given as flags, as JSON by name.
pub(crate) fn given(schema: &Schema, matches: &ArgMatches) -> Map<String, Value> {
    flags(schema)
        .filter_map(|property| Some((property.name.to_owned(), typed(property, matches)?)))
        .collect()
}

/// The options that become flags; for some the command line has separate ones.
fn flags(schema: &Schema) -> impl Iterator<Item = Property<'_>> {
    request::properties(schema).filter(|property| property.schema["x-own"].is_null())
}

/// Whether the option may be given several times, a text or a list of texts each.
fn is_repeated(property: Property<'_>) -> bool {
    property.allows("array") && property.schema["items"]["type"] == "string"
}

/// Whether the option is on unless it is switched off.
fn is_on(property: Property<'_>) -> bool {
    property.default() == Some(&Value::Bool(true))
}

fn argument(property: Property<'_>) -> Arg {
    let long = property.name.replace('_', "-");
    let argument = Arg::new(property.name.to_owned());
    if property.allows("boolean") {
        let (long, help) = if is_on(property) {
            let off = property.schema["x-no"].as_str().unwrap_or_default();
            (format!("no-{long}"), off.to_owned())
        } else {
            (long, help(property))
        };
        return argument.long(long).help(help).action(ArgAction::SetTrue);
    }
    let numeric = property.allows("number") || property.allows("integer");
    let named = property.schema["x-value"].as_str();
    let name = named.map_or_else(|| property.name.to_uppercase(), str::to_owned);
    let mut argument = argument
        .long(long)
        .help(help(property))
        .value_name(name)
        .required(property.is_required());
    argument = if numeric && !property.allows("string") && !property.allows("array") {
        argument.allow_negative_numbers(true)
    } else {
        argument.allow_hyphen_values(true)
    };
    if is_repeated(property) {
        argument = argument.action(ArgAction::Append);
    }
    if let Some(bare) = property.schema["x-bare"].as_str() {
        argument = argument
            .num_args(0..=1)
            .default_missing_value(bare.to_owned());
    }
    let words = property.words();
    if !words.is_empty() {
        let values = words.into_iter().map(|(word, about)| {
            let value = PossibleValue::new(word.to_owned());
            if about.is_empty() {
                value
            } else {
                value.help(about.to_owned())
            }
        });
        argument = argument.value_parser(PossibleValuesParser::new(values));
    }
    argument
}

/// The documentation of an option with the others written as flags, its bare value and default.
fn help(property: Property<'_>) -> String {
    let about = nanotap::Error::new(nanotap::ErrorKind::BadInput, property.description())
        .written(flag)
        .problems
        .remove(0)
        .message;
    let bare = property.schema["x-bare"].as_str();
    let bare = bare.map_or_else(String::new, |bare| {
        format!(" ({bare} if no number is given)")
    });
    let default = match property.default() {
        Some(Value::Bool(_)) | None => String::new(),
        // Off by default.
        Some(Value::Number(zero)) if !bare.is_empty() && zero.as_f64() == Some(0.0) => {
            String::new()
        }
        Some(Value::String(word)) if word.is_empty() => String::new(),
        Some(Value::String(word)) => format!(" [default: {word}]"),
        Some(Value::Array(list)) => {
            let list: Vec<String> = list.iter().map(ToString::to_string).collect();
            format!(" [default: {}]", list.join(","))
        }
        Some(number) => format!(" [default: {}]", plain(number)),
    };
    format!("{about}{bare}{default}")
}

/// Formats a number, without the fraction if it is whole.
fn plain(number: &Value) -> String {
    match number.as_f64() {
        Some(value) if value.fract() == 0.0 => format!("{value}"),
        _ => number.to_string(),
    }
}

/// The option as JSON, if it was given.
fn typed(property: Property<'_>, matches: &ArgMatches) -> Option<Value> {
    if property.allows("boolean") {
        let set = matches.get_flag(property.name);
        return set.then(|| Value::Bool(!is_on(property)));
    }
    let mut texts = matches.get_many::<String>(property.name)?;
    if is_repeated(property) {
        let listed = property.schema["x-value"].as_str();
        let listed = listed.is_some_and(|name| name.ends_with(",…"));
        let each = texts.flat_map(|text| {
            let parts: Vec<&str> = if listed {
                let parts = text.split(',').map(str::trim);
                parts.filter(|part| !part.is_empty()).collect()
            } else {
                vec![text]
            };
            parts
        });
        return Some(each.map(Value::from).collect());
    }
    texts.next_back().map(|text| property.parsed(text))
}
