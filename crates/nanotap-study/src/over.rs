//! A parameter and the values that it takes: `omega=2:4:400`, `omega=2,2.5,4`.

use std::fmt;

use serde::Serialize;

use crate::value::Axes;
use nanotap_case::physical::Kind;
use nanotap_case::{Case, Key, Value, ValueOfKeyError};
use nanotap_error::Error;
use nanotap_model::beam::MAX_MODES;

/// Most values of one parameter.
const MOST: usize = 1_000_000;

/// Spacing of the values of a parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Spacing {
    /// Equal differences between neighbouring values.
    #[default]
    Linear,
    /// Equal ratios of neighbouring values.
    Log,
    /// Values that are listed one by one.
    Listed,
}

/// A parameter and the values that it takes, both ends included.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Over {
    /// Key of the parameter that varies.
    pub key: Key,
    /// Kind of its values: of the key, or of a setpoint that is an amplitude, a force, a phase or a shift.
    #[serde(skip)]
    pub kind: Kind,
    /// First and least value, in the unit of the key.
    pub from: f64,
    /// Last and greatest value, in the unit of the key.
    pub to: f64,
    /// Number of values, both ends included.
    pub count: usize,
    /// Spacing of the values between the ends.
    pub spacing: Spacing,
    /// Values in the unit of the key, ascending; empty unless they are listed one by one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub listed: Vec<f64>,
}

impl Axes {
    /// The parameters with their values.
    ///
    /// # Errors
    /// When a parameter or a value is not valid for the case.
    pub fn parse(&self, case: &Case) -> Result<Vec<Over>, Error> {
        self.0.iter().map(|axis| Over::parse(axis, case)).collect()
    }
}

impl Over {
    /// Reads `key=from:to:count`, `key=from:to:count:log` or the values themselves,
    /// `key=a,b,c`, for `case`; `model.` before the key may be left away.
    ///
    /// # Errors
    /// When it has another form, or parameter or values are not valid for the case.
    pub fn parse(given: &str, case: &Case) -> Result<Self, Error> {
        let wrong = |what: &dyn fmt::Display| wrong(given, case, what);
        let form = |what: &str| {
            let [range, ratios, values] = examples(case);
            wrong(&format_args!(
                "{what}; write it as in {range}, {ratios}, or {values}"
            ))
        };
        let (name, range) = given.split_once('=').ok_or_else(|| form("missing `=`"))?;
        let key = key(given, name.trim(), case)?;
        let setpoint = |text: &str| match Key::DriveSetpoint.read(text) {
            Ok(Value::Number(value, kind)) => Ok((value, kind)),
            Ok(_) => Err(wrong(&format_args!("expected a setpoint, got `{text}`"))),
            Err(error) => Err(wrong(&error)),
        };
        let mut kind = key.kind();
        if key == Key::DriveSetpoint {
            let first = range.split([':', ',']).next().unwrap_or_default();
            kind = setpoint(first.trim())?.1;
        }
        let number = |which, text: &str| {
            if key == Key::DriveSetpoint {
                return match setpoint(text)? {
                    (value, other) if other == kind => Ok(value),
                    _ => Err(wrong(&format_args!(
                        "expected setpoints of one kind, got {which} `{text}`"
                    ))),
                };
            }
            let no_number =
                |value: &str| wrong(&format_args!("{which} `{value}` is not a finite number"));
            match case.value(key, text) {
                Ok(value) if value.is_finite() => Ok(value),
                Ok(_) => Err(no_number(text)),
                Err(ValueOfKeyError::NotANumber { text }) => Err(no_number(&text)),
                Err(ValueOfKeyError::Quantity { error, .. }) => {
                    Err(wrong(&format_args!("{which}: {error}")))
                }
                Err(error @ ValueOfKeyError::Implausible { .. }) => {
                    Err(wrong(&format_args!("{which}: {error}")))
                }
            }
        };
        let over = if range.contains(',') && !range.contains(':') {
            let listed = range
                .split(',')
                .map(|text| number("the value", text.trim()));
            Self::listed(key, kind, listed.collect::<Result<_, _>>()?)
        } else {
            let (from, to, count, spacing) = split(range).map_err(form)?;
            Self {
                key,
                kind,
                from: number("the first value", from)?,
                to: number("the last value", to)?,
                count: count.parse().map_err(|_| {
                    wrong(&format_args!("the count `{count}` is not a whole number"))
                })?,
                spacing,
                listed: Vec::new(),
            }
        };
        over.check().map_err(|what| wrong(&what))?;
        Ok(over)
    }

    /// Makes the axis of `key` with these values.
    fn listed(key: Key, kind: Kind, listed: Vec<f64>) -> Self {
        Self {
            key,
            kind,
            from: listed.first().copied().unwrap_or(f64::NAN),
            to: listed.last().copied().unwrap_or(f64::NAN),
            count: listed.len(),
            spacing: Spacing::Listed,
            listed,
        }
    }

    /// Whether the numbers make a range; the reason if not.
    fn check(&self) -> Result<(), String> {
        let Self {
            from, to, count, ..
        } = *self;
        let shown = |value: f64| self.kind.format_exact(value);
        if !(1..=MOST).contains(&count) {
            return Err(format!("{count} values; from 1 to {MOST} can be had"));
        }
        if count == 1 && from != to {
            return Err("one value makes no range; give 2 or more, or first = last".into());
        }
        if count > 1 && from >= to {
            return Err(format!(
                "from {} to {}; the last value must be greater than the first ({{follow}} down goes down)",
                shown(from),
                shown(to)
            ));
        }
        let mut pairs = self.listed.windows(2);
        if let Some([before, after]) = pairs.find(|pair| pair[0] >= pair[1]) {
            return Err(format!(
                "{} before {}; every value must be greater than the one before",
                shown(*before),
                shown(*after)
            ));
        }
        if self.spacing == Spacing::Log && from <= 0.0 {
            return Err(format!(
                "from {} in equal ratios; both ends must be above 0",
                shown(from)
            ));
        }
        if self.key == Key::DriveSetpoint {
            let is_fraction = self.kind == Kind::Number;
            let is_shift = self.kind == Kind::Frequency;
            if !is_shift && from <= 0.0 || is_fraction && to >= 1.0 {
                return Err(format!(
                    "from {} to {}; expected setpoints that are fractions of the free amplitude above 0 and \
                     below 1, amplitudes, peak forces or phases, all above 0, or frequency shifts",
                    shown(from),
                    shown(to)
                ));
            }
        }
        if self.key == Key::Modes {
            let whole = |v: f64| v.fract() == 0.0 && (1.0..=MAX_MODES as f64).contains(&v);
            if !(0..count).all(|k| whole(self.value(k))) {
                return Err(format!(
                    "every number of modes must be whole, from 1 to {MAX_MODES}, as in modes=1:5:5"
                ));
            }
        }
        Ok(())
    }

    /// The `index`-th value, from 0.
    pub fn value(&self, index: usize) -> f64 {
        if index == 0 || self.count <= 1 {
            return self.from;
        }
        if index + 1 >= self.count {
            return self.to;
        }
        let share = index as f64 / (self.count - 1) as f64;
        match self.spacing {
            Spacing::Listed => self.listed.get(index).copied().unwrap_or(self.to),
            Spacing::Linear => self.from + (self.to - self.from) * share,
            Spacing::Log => self.from * nanotap_arithmetic::powf(self.to / self.from, share),
        }
    }

    /// Returns all values, in ascending order and in the unit of the key.
    pub fn values(&self) -> Vec<f64> {
        (0..self.count).map(|k| self.value(k)).collect()
    }

    /// The parameter with its `index`-th value, in words.
    pub fn named(&self, case: &Case, index: usize) -> String {
        let value = self.value(index);
        if self.key == Key::DriveSetpoint {
            return format!("{} = {}", self.key, self.kind.format(value));
        }
        case.named(self.key, value)
    }

    /// `case` with the `index`-th value.
    pub fn apply(&self, case: &Case, index: usize) -> Case {
        let value = self.value(index);
        if self.key == Key::DriveSetpoint {
            return case.with_setpoint(value, self.kind);
        }
        case.with(self.key, value)
    }

    /// Returns the label of the parameter's axis in figures.
    pub fn label(&self) -> String {
        match self.kind {
            Kind::Length if self.key == Key::DriveSetpoint => "setpoint $A$".to_owned(),
            Kind::Force if self.key == Key::DriveSetpoint => {
                "setpoint of the peak force".to_owned()
            }
            Kind::Frequency if self.key == Key::DriveSetpoint => {
                "setpoint of the frequency shift".to_owned()
            }
            Kind::Angle if self.key == Key::DriveSetpoint => "setpoint of the phase".to_owned(),
            _ => self.key.label(),
        }
    }
}

/// First value, last value, count and spacing.
fn split(range: &str) -> Result<(&str, &str, &str, Spacing), &'static str> {
    let parts: Vec<&str> = range.split(':').map(str::trim).collect();
    let (from, to, count, spacing) = match parts.as_slice() {
        [from, to, count] => (*from, *to, *count, "linear"),
        [from, to, count, spacing] => (*from, *to, *count, *spacing),
        [..] if parts.len() < 3 => return Err("first value, last value and count are needed"),
        [..] => return Err("there are too many `:`"),
    };
    let spacing = match spacing {
        "linear" | "lin" => Spacing::Linear,
        "log" => Spacing::Log,
        _ => return Err("the spacing is `linear` or `log`"),
    };
    Ok((from, to, count, spacing))
}

fn key(given: &str, name: &str, case: &Case) -> Result<Key, Error> {
    let modes = Key::Modes.name();
    if name.strip_prefix("model.").unwrap_or(name) == modes && case.cantilever().is_some() {
        return Ok(Key::Modes);
    }
    if case.is_physical() && name == Key::DriveSetpoint.path() {
        return Ok(Key::DriveSetpoint);
    }
    case.key(name).map_err(|error| wrong(given, case, &error))
}

/// An axis as a range, in equal ratios and as values, in quantities of the case.
fn examples(case: &Case) -> [&'static str; 3] {
    if case.is_physical() {
        [
            "gap.tip=10nm:20nm:400",
            "drive.frequency=300kHz:330kHz:50:log",
            "gap.tip=10nm,12nm,15nm",
        ]
    } else {
        ["omega=2:4:400", "omega=2:200:50:log", "omega=2,2.5,4"]
    }
}

/// The error of an axis that is not valid.
fn wrong(given: &str, case: &Case, what: &dyn fmt::Display) -> Error {
    let [range, _, values] = examples(case);
    Error::option(
        "over",
        format!("`{given}`: {what}"),
        format!(
            "write {range}: parameter, first value, last value, how many; or the values, {values}"
        ),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap_model::cantilever::Cantilever;
    use nanotap_model::parameter::Parameter;

    fn paper() -> Case {
        Case::from(Cantilever::paper())
    }

    #[test]
    fn values_reach_both_ends() {
        let over = Over::parse("omega=2:4:400", &paper()).unwrap();
        let values = over.values();
        assert_eq!((values.len(), values[0], values[399]), (400, 2.0, 4.0));
        assert!((values[1] - values[0] - 2.0 / 399.0).abs() < 1e-15);
        let over = Over::parse("model.contact_stiffness = 1:100:3:log", &paper()).unwrap();
        let values = over.values();
        assert!(values[0] == 1.0 && (values[1] - 10.0).abs() < 1e-14 && values[2] == 100.0);
        let case = over.apply(&paper(), 2);
        let case = case.cantilever().unwrap();
        assert_eq!(case.get(Parameter::Alpha4), 100.0);
        let over = Over::parse("omega = 2, 2.5, 4", &paper()).unwrap();
        assert_eq!(over.values(), [2.0, 2.5, 4.0]);
        let over = Over::parse("modes=1:5:5", &paper()).unwrap();
        let case = over.apply(&paper(), 3);
        let case = case.cantilever().unwrap();
        assert_eq!(case.modes, 4);
    }

    #[test]
    fn what_is_no_range_is_refused_with_what_would_be_right() {
        for (given, words) in [
            ("omega", "missing `=`"),
            ("omega=", "are needed"),
            ("omega=2", "are needed"),
            ("omega=2:4", "are needed"),
            ("omega=2:4:400:log:5", "too many"),
            ("omega=2:4:400:cubic", "`linear` or `log`"),
            ("omga=2:4:400", "did you mean `omega`"),
            ("=2:4:400", "no parameter"),
            ("omega=x:4:400", "first value `x`"),
            ("omega=2:nan:400", "last value `nan`"),
            ("omega=2:inf:400", "finite"),
            ("omega=2:4:0", "from 1 to"),
            ("omega=2:4:-3", "whole number"),
            ("omega=2:4:2.5", "whole number"),
            ("omega=2:4:99999999", "from 1 to"),
            ("omega=4:2:400", "follow down"),
            ("omega=2:2:400", "greater"),
            ("omega=2:4:1", "one value"),
            ("alpha5=-1:1:50:log", "above 0"),
            ("omega=2,3,3", "3 before 3"),
            ("omega=2,1,3", "2 before 1"),
            ("omega=2,,3", "the value ``"),
            ("omega=2,x,3", "the value `x`"),
            ("modes=1:5:4", "whole"),
            ("modes=0:5:6", "whole"),
            ("modes=1:99:99", "50"),
        ] {
            let message = Over::parse(given, &paper()).unwrap_err().to_string();
            assert!(message.contains(words), "{given}: {message}");
            assert!(message.contains(given), "{given}: {message}");
        }
    }
}
