//! Values of options that are more than a number or a word. Each is read from what is easiest
//! to type at a terminal, `alpha4=5:40`, and from what a program would say,
//! `{"alpha4": [5, 40]}`.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use nanotap_case::quantity::Kind;
use nanotap_case::units::Units;
use nanotap_case::{Case, Key};
use nanotap_error::Error;

/// Most fixed steps a drive period.
const MAX_STEPS: u64 = 10_000_000;

/// Declares the JSON schema of a value, written where it is used.
macro_rules! inline_schema {
    ($type:ident, $($schema:tt)+) => {
        impl JsonSchema for $type {
            fn inline_schema() -> bool {
                true
            }

            fn schema_name() -> Cow<'static, str> {
                stringify!($type).into()
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!($($schema)+)
            }
        }
    };
}

/// A value of a parameter: a number of the model, or a text with its unit, `"70 kHz"`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Amount(String);

impl Amount {
    /// Returns the text as it was written; of a number, the fewest digits that reproduce it.
    pub fn text(&self) -> &str {
        &self.0
    }

    /// A value of `key`, in the unit of the key.
    pub fn of_key(key: Key, value: f64) -> Self {
        match key.kind() {
            Kind::Number => value.into(),
            kind if key.is_physical() => Self(format!("{value} {}", kind.si_unit())),
            _ => value.into(),
        }
    }

    fn of(value: &Value) -> Option<Self> {
        match value {
            Value::Number(number) => Some(Self(number.to_string())),
            Value::String(text) if !text.trim().is_empty() => Some(Self(text.trim().to_owned())),
            _ => None,
        }
    }
}

impl From<f64> for Amount {
    fn from(value: f64) -> Self {
        Self(value.to_string())
    }
}

impl From<&str> for Amount {
    fn from(text: &str) -> Self {
        Self(text.to_owned())
    }
}

impl fmt::Display for Amount {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(formatter)
    }
}

impl<'de> Deserialize<'de> for Amount {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        Self::of(&value).ok_or_else(|| {
            D::Error::custom(format!(
                "{value} is neither a number nor a quantity with its unit"
            ))
        })
    }
}

inline_schema!(Amount, {"type": ["number", "string"]});

/// Values of a key that is given by name, each with the name of the option that gives it.
///
/// # Errors
/// When a value is not valid for the key.
pub fn values<const N: usize>(
    case: &Case,
    key: Key,
    given: [(&str, &Amount); N],
) -> Result<[f64; N], Error> {
    let mut values = [0.0; N];
    for (value, (option, amount)) in values.iter_mut().zip(given) {
        let read = case.value(key, amount.text());
        *value = read.map_err(|error| Error::from(error).at(option))?;
    }
    Ok(values)
}

/// The value of an option, if it is given, which is one of `key`: of a physical case a number
/// without a unit is in SI.
///
/// # Errors
/// When it is not valid for the key.
pub fn implied(
    case: &Case,
    key: Key,
    option: &str,
    amount: Option<&Amount>,
) -> Result<Option<f64>, Error> {
    let read = |amount: &Amount| case.implied_value(key, amount.text());
    let read = amount.map(read).transpose();
    read.map_err(|error| Error::from(error).at(option))
}

/// A name with two ends, `alpha4=5:40`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Interval {
    /// Name of the key or of the coordinate of a state.
    pub name: String,
    /// Lower end of the interval, with a unit or without.
    pub low: Amount,
    /// Upper end of the interval, with a unit or without.
    pub high: Amount,
}

impl Interval {
    /// `key` from `low` to `high`, in the unit of the key.
    pub fn of_key(key: Key, low: f64, high: f64) -> Self {
        Self {
            name: key.path().to_owned(),
            low: Amount::of_key(key, low),
            high: Amount::of_key(key, high),
        }
    }

    fn parse(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!("expected NAME=LOW:HIGH, got `{text}`; write it as in a1=-1:1 or alpha4=5:40")
        };
        let (name, range) = text.split_once('=').ok_or_else(wrong)?;
        let (low, high) = range.split_once(':').ok_or_else(wrong)?;
        let end = |end: &str| Amount::of(&end.into()).ok_or_else(wrong);
        let name = name.trim();
        if name.is_empty() {
            return Err(wrong());
        }
        Ok(Self {
            name: name.to_owned(),
            low: end(low)?,
            high: end(high)?,
        })
    }

    fn pair(name: &str, ends: &Value) -> Result<Self, String> {
        let wrong =
            || format!("{name}: expected LOW:HIGH, got {ends}; write a lower and an upper end");
        match ends.as_array().map(Vec::as_slice) {
            Some([low, high]) => Ok(Self {
                name: name.to_owned(),
                low: Amount::of(low).ok_or_else(wrong)?,
                high: Amount::of(high).ok_or_else(wrong)?,
            }),
            _ => Err(wrong()),
        }
    }
}

/// Names with their ends: `["a1=-1:1"]` or `{"a1": [-1, 1]}`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Intervals(pub Vec<Interval>);

impl<S: Into<String>> FromIterator<(S, f64, f64)> for Intervals {
    fn from_iter<I: IntoIterator<Item = (S, f64, f64)>>(intervals: I) -> Self {
        let interval = |(name, low, high): (S, f64, f64)| Interval {
            name: name.into(),
            low: low.into(),
            high: high.into(),
        };
        Self(intervals.into_iter().map(interval).collect())
    }
}

impl Serialize for Intervals {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(
            self.0
                .iter()
                .map(|side| format!("{}={}:{}", side.name, side.low, side.high)),
        )
    }
}

impl<'de> Deserialize<'de> for Intervals {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        let text = |value: &Value| {
            let wrong = || format!("expected a text such as a1=-1:1, got {value}");
            Interval::parse(value.as_str().ok_or_else(wrong)?)
        };
        let intervals: Result<Vec<Interval>, String> = match &value {
            Value::Array(list) => list.iter().map(text).collect(),
            Value::Object(map) => map
                .iter()
                .map(|(name, ends)| Interval::pair(name, ends))
                .collect(),
            other => text(other).map(|interval| vec![interval]),
        };
        intervals.map(Self).map_err(D::Error::custom)
    }
}

inline_schema!(Intervals, {
    "type": ["array", "object", "string"],
    "items": {"type": "string"},
    "additionalProperties": {"type": "array", "minItems": 2, "maxItems": 2},
});

impl Intervals {
    /// Each with its ends in the model's units, for entries of a state.
    ///
    /// # Errors
    /// When an end is neither a finite number nor a quantity of the entry's kind.
    pub fn of_entries(&self, units: &Units) -> Result<Vec<(String, f64, f64)>, Error> {
        let number = |interval: &Interval, end: &Amount| {
            let read = units.read_entry(&interval.name, end.text());
            read.map_err(|error| {
                Error::input(
                    format!("{}: {error}", interval.name),
                    "write a side as in a1=-1:1",
                )
            })
        };
        self.0
            .iter()
            .map(|side| {
                Ok((
                    side.name.clone(),
                    number(side, &side.low)?,
                    number(side, &side.high)?,
                ))
            })
            .collect()
    }
}

impl Serialize for Interval {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{}={}:{}", self.name, self.low, self.high))
    }
}

impl<'de> Deserialize<'de> for Interval {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Intervals(mut intervals) = Intervals::deserialize(deserializer)?;
        match (intervals.pop(), intervals.is_empty()) {
            (Some(interval), true) => Ok(interval),
            _ => Err(D::Error::custom(
                "one parameter with its range is needed, as in alpha4=5:40",
            )),
        }
    }
}

inline_schema!(Interval, {
    "type": ["string", "object"],
    "minProperties": 1,
    "maxProperties": 1,
    "additionalProperties": {"type": "array", "minItems": 2, "maxItems": 2},
});

/// Parameters with their values, each as in `omega=2:4:400`; or `{"omega": [2, 2.5, 4]}`, which
/// is `omega=2,2.5,4`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Axes(pub Vec<String>);

impl Axes {
    /// The names of the parameters.
    pub fn names(&self) -> Vec<&str> {
        self.0.iter().map(|axis| name_of(axis)).collect()
    }

    /// The first value of each parameter, as `key=value` words: what a case may leave out that does not
    /// state the parameter.
    pub fn first_values(&self) -> Vec<String> {
        let word = |axis: &String| {
            let (name, values) = axis.split_once('=')?;
            let first = values.split([':', ',']).next()?;
            Some(format!("{}={}", name.trim(), first.trim()))
        };
        self.0.iter().filter_map(word).collect()
    }

    /// Whether a setpoint varies, so that its distances are solved for.
    pub fn solves_distance(&self) -> bool {
        self.names().contains(&Key::DriveSetpoint.path())
    }
}

/// Returns the name in front of the values.
fn name_of(axis: &str) -> &str {
    axis.split_once('=').map_or(axis, |(name, _)| name).trim()
}

impl<'de> Deserialize<'de> for Axes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Given {
            One(String),
            Several(Vec<String>),
            Listed(serde_json::Map<String, Value>),
        }
        let listed = |(name, values): (String, Value)| {
            let values = values.as_array().and_then(|values| {
                let texts = values.iter().map(|value| Some(Amount::of(value)?.0));
                texts.collect::<Option<Vec<_>>>()
            });
            let values = values.ok_or_else(|| {
                D::Error::custom(format!("{name}: a list of its values is needed"))
            })?;
            Ok(format!("{name}={}", values.join(",")))
        };
        Ok(Self(match Given::deserialize(deserializer)? {
            Given::One(axis) => vec![axis],
            Given::Several(axes) => axes,
            Given::Listed(axes) => axes.into_iter().map(listed).collect::<Result<_, _>>()?,
        }))
    }
}

inline_schema!(Axes, {
    "type": ["array", "string", "object"],
    "items": {"type": "string"},
    "additionalProperties": {"type": "array", "items": {"type": ["number", "string"]}},
});

/// Fixed steps a drive period in each regime, free flight and contact: `200`, or `[200, 400]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Steps(pub [u32; 2]);

impl Default for Steps {
    fn default() -> Self {
        Self([200, 200])
    }
}

impl<'de> Deserialize<'de> for Steps {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        let wrong = || {
            D::Error::custom(format!(
                "{value} are no steps a drive period: one number from 1 to {MAX_STEPS}, or those in \
                 free flight and in contact, as in 200,400"
            ))
        };
        let step = |value: &Value| {
            let steps = value
                .as_u64()
                .filter(|steps| (1..=MAX_STEPS).contains(steps));
            steps.map(|steps| steps as u32).ok_or_else(wrong)
        };
        match &value {
            Value::Array(both) => match both.as_slice() {
                [both] => Ok(Self([step(both)?; 2])),
                [free, contact] => Ok(Self([step(free)?, step(contact)?])),
                _ => Err(wrong()),
            },
            both => Ok(Self([step(both)?; 2])),
        }
    }
}

inline_schema!(Steps, {
    "type": ["integer", "array"],
    "minimum": 1,
    "maximum": MAX_STEPS,
    "items": {"type": "integer", "minimum": 1, "maximum": MAX_STEPS},
});

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn both_ways_of_writing_mean_the_same() {
        let typed: Intervals = serde_json::from_value(json!(["a1=-1:1", "v2 = -4:4"])).unwrap();
        let said: Intervals =
            serde_json::from_value(json!({"a1": [-1, 1], "v2": [-4, 4]})).unwrap();
        assert_eq!(typed, said);
        let back: Intervals =
            serde_json::from_value(serde_json::to_value(&typed).unwrap()).unwrap();
        assert_eq!(back, typed);
        assert_eq!(
            typed.of_entries(&Units::Model).unwrap(),
            [("a1".to_owned(), -1.0, 1.0), ("v2".to_owned(), -4.0, 4.0)]
        );
    }

    #[test]
    fn values_of_an_axis_may_be_listed() {
        let axes: Axes = serde_json::from_value(json!({"omega": [2, 2.5, 4]})).unwrap();
        assert_eq!(axes.0, ["omega=2,2.5,4"]);
        let texts: Axes = serde_json::from_value(json!(["omega=2:4:400"])).unwrap();
        assert_eq!(texts.names(), ["omega"]);
        for wrong in [json!({"omega": 2}), json!({"omega": [null]}), json!(4)] {
            assert!(serde_json::from_value::<Axes>(wrong).is_err());
        }
    }

    #[test]
    fn what_has_no_two_ends_is_refused() {
        for wrong in [
            json!(["a1"]),
            json!(["=1:2"]),
            json!({"a1": [1]}),
            json!({"a1": 3}),
            json!(4),
        ] {
            assert!(serde_json::from_value::<Intervals>(wrong).is_err());
        }
        let quantities: Intervals =
            serde_json::from_value(json!({"drive.frequency": ["60 kHz", 7e4]})).unwrap();
        assert!(quantities.of_entries(&Units::Model).is_err());
    }
}
