//! A state at drive phase 0 as it is written: in a request, or as `drive.start` of a case.
//!
//! It is a row of all entries, `"0.1,-0.02,0.3,0,0,0"`, or names some of them, `"tip=5nm"`,
//! `"a1=2.5 nm, v1=0.1 mm/s"`; the others are then 0. The names are those of the entries, and for a
//! cantilever `tip` and `tip_rate`: deflection and rate of the tip in the first mode. In a physical
//! case an entry without a unit is in SI, otherwise in the model's unit. What a result states in the
//! model's units is `"model_units=…"`, with all entries.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::ser::SerializeMap as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use super::Case;
use super::physical::Scales;
use super::quantity::Kind;
use super::units::Units;
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_quantity::number::shortest;

/// Name of the entries in the model's units.
const MODEL_UNITS: &str = "model_units";
/// How a state is written, for remedies.
const SHAPE: &str = "write all entries, as in 0.1,-0.02,0.3, or some by name, as in tip=5nm";
/// Names of deflection and rate of the tip, with the entries of the first mode that they state.
const OF_TIP: [(&str, &str); 2] = [("tip", "a1"), ("tip_rate", "v1")];

/// A state at drive phase 0 as it is written.
#[derive(Clone, Debug, PartialEq)]
pub enum WrittenState {
    /// All entries in order.
    Row(Vec<WrittenEntry>),
    /// Some entries by name; the others are 0.
    Named(Vec<(String, WrittenEntry)>),
    /// All entries in order, in the model's units.
    Model(Vec<f64>),
}

/// An entry of a state as it is written.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum WrittenEntry {
    /// A plain number: in SI of a physical case, otherwise in the model's unit.
    Number(f64),
    /// A text: a quantity with its unit.
    Text(String),
}

impl WrittenEntry {
    fn of(text: &str) -> Self {
        let text = text.trim();
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Self::Number(number),
            _ => Self::Text(text.to_owned()),
        }
    }

    fn of_json(value: &Value) -> Option<Self> {
        match value {
            Value::Number(number) => number.as_f64().map(Self::Number),
            Value::String(text) => Some(Self::of(text)),
            _ => None,
        }
    }

    /// The entry called `name` in the model's units; `written` is the name by which it is stated.
    fn read(&self, name: &str, written: &str, units: &Units) -> Result<f64, Error> {
        units.read_entry(name, &self.to_string()).map_err(|error| {
            let stated = match self {
                Self::Number(number) => shortest(*number),
                Self::Text(text) => text.clone(),
            };
            Error::input(
                format!("`{stated}` as {written} of the state: {error}"),
                SHAPE,
            )
        })
    }
}

impl fmt::Display for WrittenEntry {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(formatter, "{number:?}"),
            Self::Text(text) => formatter.write_str(text),
        }
    }
}

impl WrittenState {
    /// Reads the text of a state.
    ///
    /// # Errors
    /// With what was expected.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let refused = |what: String| Error::input(format!("`{}`: {what}", shortened(text)), SHAPE);
        if let Some((name, row)) = text.split_once('=')
            && name.trim() == MODEL_UNITS
        {
            let number = |text: &str| text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
            let numbers = row.split(',').map(number).collect::<Option<_>>();
            let numbers = numbers.ok_or_else(|| refused("expected plain numbers".into()))?;
            return Ok(Self::Model(numbers));
        }
        let parts = || text.split(',');
        if !text.contains('=') {
            return Ok(Self::Row(parts().map(WrittenEntry::of).collect()));
        }
        let named = |part: &str| {
            let (name, value) = part.split_once('=')?;
            Some((name.trim().to_owned(), WrittenEntry::of(value)))
        };
        let named = parts().map(named).collect::<Option<_>>();
        Ok(Self::Named(named.ok_or_else(|| {
            refused("expected a name before each value".into())
        })?))
    }

    /// The text that [`parse`](Self::parse) reads.
    pub fn text(&self) -> String {
        let joined = |parts: Vec<String>| parts.join(", ");
        match self {
            Self::Row(row) => joined(row.iter().map(ToString::to_string).collect()),
            Self::Named(named) => joined(
                named
                    .iter()
                    .map(|(of, value)| format!("{of}={value}"))
                    .collect(),
            ),
            Self::Model(row) => {
                let row = row.iter().map(|number| format!("{number:?}")).collect();
                format!("{MODEL_UNITS}={}", joined(row))
            }
        }
    }

    /// A state of a cantilever with `modes` modes in SI, given in the model's units. The sample's
    /// memory stays in the model's units.
    pub(crate) fn in_si(state: &[f64], modes: usize, scales: &Scales) -> Self {
        let entry = |(k, value): (usize, &f64)| match k / modes.max(1) {
            0 => WrittenEntry::Text(Kind::Length.format_exact(value * scales.length)),
            1 => WrittenEntry::Text(Kind::Velocity.format_exact(value * scales.velocity)),
            _ => WrittenEntry::Number(*value),
        };
        Self::Row(state.iter().enumerate().map(entry).collect())
    }

    /// This state in the model's units, of a model of `case`; as it is if it is in them already.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn of_case(&self, case: &Case) -> Result<Self, Error> {
        if let Self::Model(_) = self {
            return Ok(self.clone());
        }
        let read = self.read(&case.model()?, &case.units());
        read.map(Self::Model).map_err(|error| error.at("state"))
    }

    /// The state in the model's units, as far as it is written: of a row, the sample's memory may be
    /// missing. `names` are those of the model's entries.
    ///
    /// # Errors
    /// When an entry is not a quantity of its kind, is named twice, or the model does not have it.
    pub fn read(&self, model: &Model, units: &Units) -> Result<Vec<f64>, Error> {
        let names = model.state_names();
        match self {
            Self::Model(row) => Ok(row.clone()),
            Self::Row(row) => {
                let fits = [row.len(), row.len() + model.memory].contains(&names.len());
                // The state of another number of modes.
                let own = row.len().saturating_sub(model.memory) / 2;
                let name = |k: usize| match k / own.max(1) {
                    _ if fits || model.beam.is_none() => names.get(k).cloned().unwrap_or_default(),
                    0 => format!("a{}", k + 1),
                    1 => format!("v{}", k + 1 - own),
                    _ => format!("s{}", k + 1 - 2 * own),
                };
                let entries = row.iter().enumerate();
                entries
                    .map(|(k, value)| value.read(&name(k), &name(k), units))
                    .collect()
            }
            Self::Named(named) => {
                let mut state = vec![0.0; names.len()];
                let mut known: Vec<&str> = Vec::new();
                for (name, value) in named {
                    let tip = model.beam.as_ref().and_then(|beam| {
                        let (_, entry) = OF_TIP.iter().find(|(of, _)| of == name)?;
                        Some((*entry, beam.modes.shapes(1.0)[0]))
                    });
                    let (entry, shape) = tip.unwrap_or((name, 1.0));
                    let Some(place) = names.iter().position(|of| of == entry) else {
                        let tip = model.beam.as_ref().map(|_| ", tip, tip_rate");
                        return Err(Error::input(
                            format!("a state has no entry `{name}`"),
                            format!("there are {}{}", names.join(", "), tip.unwrap_or("")),
                        ));
                    };
                    if known.contains(&entry) {
                        return Err(Error::input(
                            format!("`{name}` states {entry} of the state again"),
                            "keep one of the two",
                        ));
                    }
                    known.push(entry);
                    state[place] = value.read(entry, name, units)? / shape;
                }
                Ok(state)
            }
        }
    }
}

/// The beginning of a text, for messages.
fn shortened(text: &str) -> String {
    /// Most characters of a text that a message repeats.
    const LONGEST: usize = 60;
    if text.chars().count() <= LONGEST {
        return text.to_owned();
    }
    let start: String = text.chars().take(LONGEST).collect();
    format!("{start}…")
}

impl From<Vec<f64>> for WrittenState {
    /// A state in the model's units.
    fn from(state: Vec<f64>) -> Self {
        Self::Model(state)
    }
}

impl Serialize for WrittenState {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Row(row) => row.serialize(serializer),
            Self::Named(named) => {
                serializer.collect_map(named.iter().map(|(name, value)| (name, value)))
            }
            Self::Model(row) => {
                let mut map = serializer.serialize_map(Some(1))?;
                map.serialize_entry(MODEL_UNITS, row)?;
                map.end()
            }
        }
    }
}

impl<'de> Deserialize<'de> for WrittenState {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let wrong = |value: &Value| D::Error::custom(format!("{value} is not a state; {SHAPE}"));
        let entry = |value: &Value| WrittenEntry::of_json(value).ok_or_else(|| wrong(value));
        match Value::deserialize(deserializer)? {
            Value::String(text) => Self::parse(&text).map_err(D::Error::custom),
            Value::Array(row) => row
                .iter()
                .map(entry)
                .collect::<Result<_, _>>()
                .map(Self::Row),
            Value::Object(named) => {
                if let (1, Some(row)) = (named.len(), named.get(MODEL_UNITS)) {
                    let row = row.as_array().ok_or_else(|| wrong(row))?;
                    let number = |value: &Value| value.as_f64().ok_or_else(|| wrong(value));
                    return row
                        .iter()
                        .map(number)
                        .collect::<Result<_, _>>()
                        .map(Self::Model);
                }
                let named = named
                    .iter()
                    .map(|(name, value)| Ok((name.clone(), entry(value)?)));
                named.collect::<Result<_, _>>().map(Self::Named)
            }
            other => Err(wrong(&other)),
        }
    }
}

impl JsonSchema for WrittenState {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "State".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": ["array", "string", "object"],
            "items": {"type": ["number", "string"]},
            "additionalProperties": {"type": ["number", "string", "array"]},
        })
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::Case;

    /// g₀ = 1 µm, so that an entry of 1 nm is 0.001.
    fn lever() -> Case {
        let words = [
            "cantilever.k=3 N/m",
            "cantilever.f0=75 kHz",
            "cantilever.Q=200",
            "sample.stiffness=20 N/m",
            "drive.frequency=75 kHz",
            "drive.amplitude=1 nm",
            "gap.tip=1 nm",
            "gap.beam=1 um",
            "modes=2",
        ];
        Case::parse(None, &words.map(str::to_owned)).unwrap()
    }

    fn read(case: &Case, text: &str) -> Result<Vec<f64>, String> {
        let state = WrittenState::parse(text).map_err(|error| error.to_string())?;
        let model = case.model().unwrap();
        state
            .read(&model, &case.units())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn a_physical_case_reads_si_units_and_the_tip() {
        let case = lever();
        let velocity = case.physical().unwrap().scales.velocity;
        let close = |text: &str, expected: [f64; 4]| {
            let state = read(&case, text).unwrap();
            for (value, expected) in state.iter().zip(expected) {
                assert!(
                    (value - expected).abs() <= 1e-15 + 1e-12 * expected.abs(),
                    "{text}: {state:?}"
                );
            }
        };
        let slow = 1e-3 / velocity;
        close("1e-9, 2 nm, 1e-3, 0", [1e-3, 2e-3, slow, 0.0]);
        close("v1 = 1 mm/s, a2=-3nm", [0.0, -3e-3, slow, 0.0]);
        // φ₁(1) = 2: the deflection of the tip is twice the amplitude.
        close("tip=5nm", [2.5e-3, 0.0, 0.0, 0.0]);
        close("tip=5e-9, tip_rate=2 mm/s", [2.5e-3, 0.0, slow, 0.0]);
        close("model_units=0.1,0.2,0.3,0.4", [0.1, 0.2, 0.3, 0.4]);
        let plain = case.in_model_units(true);
        assert_eq!(
            read(&plain, "0.1,0.2,0.3,0.4").unwrap(),
            [0.1, 0.2, 0.3, 0.4]
        );
    }

    #[test]
    fn what_is_not_a_state_is_refused_with_the_reason() {
        let case = lever();
        for (text, words) in [
            ("tip=5 kHz", "expected a length"),
            ("tip=5nm, a1=2nm", "`a1` states a1 of the state again"),
            ("a3=1nm", "no entry `a3`"),
            ("a1=1nm, 3", "expected a name before each value"),
            ("a1=x", "`x` as a1"),
            ("model_units=a", "expected plain numbers"),
            // A number of the model's units, 0.1 g₀, is no deflection in metres.
            ("0.1,0,0,0", "write the unit"),
            ("0.0001,0,0,0", "write the unit"),
        ] {
            let refused = read(&case, text).unwrap_err();
            assert!(refused.contains(words), "{text}: {refused}");
        }
    }

    #[test]
    fn every_way_of_writing_comes_back() {
        for text in [
            "0.1, -0.02",
            "tip=5 nm, v1=0.001",
            "model_units=0.1, 1e-300",
            "1 nm, 2 mm/s",
        ] {
            let state = WrittenState::parse(text).unwrap();
            assert_eq!(WrittenState::parse(&state.text()).unwrap(), state, "{text}");
            let json = serde_json::to_value(&state).unwrap();
            assert_eq!(
                serde_json::from_value::<WrittenState>(json).unwrap(),
                state,
                "{text}"
            );
        }
        let row: WrittenState = serde_json::from_value(json!([0.1, "2 nm"])).unwrap();
        assert_eq!(row, WrittenState::parse("0.1, 2 nm").unwrap());
        assert!(serde_json::from_value::<WrittenState>(json!([null])).is_err());
        assert!(serde_json::from_value::<WrittenState>(json!(3)).is_err());
    }

    #[test]
    fn a_state_in_si_comes_back_with_the_same_bits() {
        let case = lever();
        let (model, view) = (case.model().unwrap(), case.physical().unwrap());
        let state = [0.1 / 3.0, -1.0 / 7.0, 2.0 / 3.0, 1e-17];
        let once = WrittenState::in_si(&state, 2, &view.scales);
        let once_read = once.read(&model, &case.units()).unwrap();
        for (a, b) in state.iter().zip(&once_read) {
            assert!((a / b - 1.0).abs() < 1e-15);
        }
        let text = WrittenState::parse(&once.text()).unwrap();
        assert_eq!(text.read(&model, &case.units()).unwrap(), once_read);
    }
}
