//! Signals of one shot, as the option `drive_signal` states them: a pulse, a chirp, a sinc, or a
//! table of time and drive.
//!
//! Times are in drive periods and frequencies in multiples of the drive's, or with their units. Every
//! signal multiplies the amplitude of the drive: its peak of 1 is the drive of the case, unless it is
//! stated `times` a number.

use std::borrow::Cow;
use std::f64::consts::TAU;
use std::path::Path;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, de::Error as _};
use serde_json::{Value, json};

use crate::Case;
use crate::quantity::Kind;
use crate::table::{Entry, Header, Table};
use nanotap_error::Error;
use nanotap_model::drive_signal::{DriveSignal, MAX_PIECES, MAX_TURNS, Pieces};

/// Standard deviations from the centre of a pulse to its beginning, where it has 2·10⁻¹⁶ of its peak.
const REACH: f64 = 8.5;
/// Exponent of the envelope exp(−40 x¹⁶) of a chirp and a sinc at their ends, x = ±1.
const FLANK: f64 = 40.0;
/// Full width at half maximum of a Gaussian over its standard deviation, 2√(2 ln 2).
const FULL_WIDTH: f64 = 2.354_820_045_030_949_3;
/// Largest value at the ends of a table, over its peak.
const AT_REST: f64 = 1e-3;
/// Longest signal, in drive periods.
const LONGEST: f64 = 1e5;

/// A signal as it is stated: a text, or a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum StatedSignal {
    /// `pulse`, `chirp` or `sinc` with their numbers, or the name of a file.
    Text(String),
    /// Columns of time and drive.
    Table(Table),
}

impl<'de> Deserialize<'de> for StatedSignal {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match Value::deserialize(deserializer)? {
            Value::String(text) => Ok(Self::Text(text)),
            table @ Value::Object(_) => {
                let stated = table.get("columns").is_some_and(Value::is_object);
                let table = if stated {
                    table
                } else {
                    json!({"columns": table})
                };
                let table = serde_json::from_value(table).map_err(D::Error::custom)?;
                Ok(Self::Table(table))
            }
            other => Err(D::Error::custom(format!(
                "expected a text or a table of time and drive, got {other}"
            ))),
        }
    }
}

impl JsonSchema for StatedSignal {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "DriveSignal".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"type": ["string", "object"]})
    }
}

/// A shape with its numbers, times in drive periods, frequencies in multiples of the drive's.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    /// A Gaussian of this full width at half maximum.
    Pulse { width: f64 },
    /// A sine whose frequency rises or falls in proportion to time.
    Chirp { from: f64, to: f64, length: f64 },
    /// sin(2πft)/(2πft): all frequencies up to f.
    Sinc { highest: f64, length: f64 },
}

impl Shape {
    fn length(self) -> f64 {
        match self {
            Self::Pulse { width } => 2.0 * REACH * width / FULL_WIDTH,
            Self::Chirp { length, .. } | Self::Sinc { length, .. } => length,
        }
    }

    /// Its oscillations, where there can be many.
    fn turns(self) -> f64 {
        match self {
            Self::Pulse { .. } => 0.0,
            Self::Chirp { from, to, length } => 0.5 * (from + to) * length,
            Self::Sinc { highest, length } => highest * length,
        }
    }

    /// The signal at a time from its beginning; 0 after its end.
    fn at(self, time: f64) -> f64 {
        let (length, middle) = (self.length(), 0.5 * self.length());
        if time > length {
            return 0.0;
        }
        let envelope = || nanotap_arithmetic::exp(-FLANK * ((time - middle) / middle).powi(16));
        match self {
            Self::Pulse { width } => {
                let x = FULL_WIDTH * (time - middle) / width;
                nanotap_arithmetic::exp(-0.5 * x * x)
            }
            Self::Chirp { from, to, length } => {
                let turns = time * (from + 0.5 * (to - from) * time / length);
                envelope() * nanotap_arithmetic::sin(TAU * turns)
            }
            Self::Sinc { highest, .. } => {
                let angle = TAU * highest * (time - middle);
                let sinc = if angle == 0.0 {
                    1.0
                } else {
                    nanotap_arithmetic::sin(angle) / angle
                };
                envelope() * sinc
            }
        }
    }
}

/// A signal that is ready to drive a case.
#[derive(Clone, Debug)]
pub struct ReadSignal {
    /// The signal in the words of the request, or the name of its table.
    pub words: String,
    /// Length of the signal itself, in drive periods.
    pub length: f64,
    /// Its pieces, then the silence after it.
    pub pieces: Vec<DriveSignal>,
}

impl ReadSignal {
    fn new(
        words: &str,
        at: &dyn Fn(f64) -> f64,
        knots: &[f64],
        peak: f64,
        after: usize,
    ) -> Result<Self, Error> {
        let pieces = Pieces::new().of(at, knots, peak);
        let mut pieces = pieces.ok_or_else(too_many_pieces)?;
        pieces.extend((0..after).map(|_| DriveSignal::silence(1.0)));
        Ok(Self {
            words: words.to_owned(),
            length: knots.last().copied().unwrap_or(0.0),
            pieces,
        })
    }

    /// Length of the signal with the silence after it, in drive periods.
    pub fn window(&self) -> f64 {
        self.pieces.iter().map(|piece| piece.length).sum()
    }
}

const HINT: &str = "write {drive_signal} as in \"pulse 0.5\", \"chirp 0.8 1.2 200\" or \"sinc 2 100\" \
                    (times in drive periods, frequencies in multiples of the drive's, or with units: \
                    \"pulse 5 us times 40\"), or name a file with the columns time and drive";

fn wrong(message: impl Into<String>) -> Error {
    Error::option("drive_signal", message, HINT)
}

fn too_many_pieces() -> Error {
    wrong(format!(
        "the signal needs more than {MAX_PIECES} pieces; give a slower one"
    ))
}

impl StatedSignal {
    /// Reads the file that a text names which is no shape. Front ends with files of the user call it;
    /// a signal that names a file is refused otherwise.
    ///
    /// # Errors
    /// When there is no such file, or it is not a table.
    pub fn read_file(&mut self) -> Result<(), Error> {
        if let Self::Text(text) = self
            && shape_word(text).is_none()
        {
            let path = Path::new(text.trim());
            if !path.exists() {
                return Err(wrong(format!("`{text}` is neither a signal nor a file")));
            }
            *self = Self::Table(Table::read(path)?);
        }
        Ok(())
    }

    /// The signal for `case`, with `after` drive periods after its end.
    ///
    /// # Errors
    /// When it is not valid, or has units that the case does not know.
    pub fn read(&self, case: &Case, after: usize) -> Result<ReadSignal, Error> {
        match self {
            Self::Text(text) => {
                let (words, peak) = peak_of(text)?;
                let shape = shape(words, case)?;
                let length = shape.length();
                if length > LONGEST {
                    return Err(wrong(format!("{length:.0} drive periods are too long")));
                }
                // Known before the signal is cut, which takes a while.
                if shape.turns() > MAX_TURNS {
                    return Err(too_many_pieces());
                }
                let steps = length.ceil().max(1.0);
                let knot = |k: usize| length * k as f64 / steps;
                let knots: Vec<f64> = (0..=steps as usize).map(knot).collect();
                let at = |time| peak * shape.at(time);
                ReadSignal::new(text.trim(), &at, &knots, peak.abs(), after)
            }
            Self::Table(table) => of_table(table, case, after),
        }
    }
}

/// The word of the shape with which a text begins.
fn shape_word(text: &str) -> Option<&str> {
    let word = text.split_whitespace().next()?;
    ["pulse", "chirp", "sinc"]
        .into_iter()
        .find(|of| *of == word)
}

/// A text without its factor, and the factor: `pulse 5 us times 40`.
fn peak_of(text: &str) -> Result<(&str, f64), Error> {
    let Some((words, factor)) = text.split_once(" times ") else {
        return Ok((text, 1.0));
    };
    match factor.trim().parse::<f64>() {
        Ok(peak) if peak.is_finite() && peak != 0.0 => Ok((words, peak)),
        _ => Err(wrong(format!(
            "a number follows `times`, not `{}`",
            factor.trim()
        ))),
    }
}

fn shape(text: &str, case: &Case) -> Result<Shape, Error> {
    let word = shape_word(text);
    let word = word.ok_or_else(|| wrong(format!("`{text}` is neither a signal nor a table")))?;
    let numbers = quantities(&text.trim_start()[word.len()..]);
    let time = |k: usize| in_periods(&numbers[k], case);
    let frequency = |k: usize| in_frequencies(&numbers[k], case);
    match (word, numbers.len()) {
        ("pulse", 1) => Ok(Shape::Pulse { width: time(0)? }),
        ("chirp", 3) => Ok(Shape::Chirp {
            from: frequency(0)?,
            to: frequency(1)?,
            length: time(2)?,
        }),
        ("sinc", 2) => Ok(Shape::Sinc {
            highest: frequency(0)?,
            length: time(1)?,
        }),
        _ => {
            let needed = match word {
                "pulse" => "one number, its full width at half maximum",
                "chirp" => "three numbers: the first and the last frequency, and its length",
                _ => "two numbers: its highest frequency, and its length",
            };
            Err(wrong(format!("a {word} has {needed}; got `{text}`")))
        }
    }
}

/// Numbers with their units, which may stand apart: `60 kHz 5ms`.
fn quantities(text: &str) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    let words = text.split([' ', ',', '\t']).filter(|word| !word.is_empty());
    for word in words {
        let begins = word.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
        match all.last_mut() {
            Some(last) if !begins => {
                last.push(' ');
                last.push_str(word);
            }
            _ => all.push(word.to_owned()),
        }
    }
    all
}

/// The drive frequency in Hz.
fn hertz(case: &Case, text: &str) -> Result<f64, Error> {
    let view = case.physical();
    let view = view.ok_or_else(|| {
        wrong(format!(
            "the case is dimensionless: `{text}` cannot have a unit"
        ))
    })?;
    Ok(view.cantilever.omega * view.scales.frequency)
}

/// A positive number, or a quantity of `kind` times `factor` of the drive frequency.
fn amount(text: &str, case: &Case, kind: Kind, factor: impl Fn(f64) -> f64) -> Result<f64, Error> {
    let value = if let Ok(value) = text.parse::<f64>() {
        value
    } else {
        let si = kind.parse(text).map_err(|error| wrong(error.to_string()))?;
        si * factor(hertz(case, text)?)
    };
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(wrong(format!(
        "{} above 0 is needed, got {text}",
        kind.noun()
    )))
}

fn in_periods(text: &str, case: &Case) -> Result<f64, Error> {
    amount(text, case, Kind::Time, |frequency| frequency)
}

fn in_frequencies(text: &str, case: &Case) -> Result<f64, Error> {
    amount(text, case, Kind::Frequency, f64::recip)
}

/// A cubic spline through rows of time and drive.
fn of_table(table: &Table, case: &Case, after: usize) -> Result<ReadSignal, Error> {
    let column = |name: &str, other: usize| -> Result<(Header, Vec<f64>), Error> {
        let called = |(header, _): &(String, _)| Header::is_called(header, name);
        let at = table.columns.iter().position(called).unwrap_or(other);
        let found = table.columns.get(at);
        let (header, entries) =
            found.ok_or_else(|| wrong(format!("{} has no column `{name}`", table.name)))?;
        let numbers = entries.iter().enumerate().map(|(row, entry)| match entry {
            Entry::Number(value) if value.is_finite() => Ok(*value),
            _ => Err(wrong(format!(
                "{}: a number is needed",
                table.place(Some(row), at)
            ))),
        });
        Ok((Header::of(header), numbers.collect::<Result<_, _>>()?))
    };
    let ((header, times), (_, drive)) = (column("time", 0)?, column("drive", 1)?);
    let name = &table.name;
    let count = times.len();
    if count < 4 || drive.len() != count {
        return Err(wrong(format!(
            "{name} has {count} rows; at least 4 are needed"
        )));
    }
    if count > MAX_PIECES {
        return Err(wrong(format!(
            "{name} has {count} rows; {MAX_PIECES} at most"
        )));
    }
    let unit = if header.unit.is_empty() {
        1.0
    } else {
        in_periods(&format!("1 {}", header.unit), case)?
    };
    let knots: Vec<f64> = times.iter().map(|time| unit * (time - times[0])).collect();
    if let Some(k) = knots.windows(2).position(|two| two[1] <= two[0]) {
        return Err(wrong(format!(
            "the times of {name} do not increase: {} follows {}",
            times[k + 1],
            times[k]
        )));
    }
    if knots[count - 1] > LONGEST {
        return Err(wrong(format!(
            "{:.0} drive periods are too long",
            knots[count - 1]
        )));
    }
    let peak = drive.iter().fold(0.0, |most: f64, of| most.max(of.abs()));
    if peak == 0.0 {
        return Err(wrong(format!("the drive of {name} is 0 everywhere")));
    }
    for (ends, value) in [("begins", drive[0]), ("ends", drive[count - 1])] {
        if value.abs() > AT_REST * peak {
            return Err(wrong(format!(
                "the drive of {name} {ends} at {value}; let it begin and end at 0"
            )));
        }
    }
    let spline = Spline::through(&knots, &drive);
    ReadSignal::new(name, &|time| spline.at(time), &knots, peak, after)
}

/// A cubic spline that is level at both ends, as a drive at rest is.
struct Spline<'a> {
    knots: &'a [f64],
    values: &'a [f64],
    slopes: Vec<f64>,
}

impl<'a> Spline<'a> {
    /// The slopes make the second derivative continuous: the tridiagonal equations
    /// `s_{k−1}/h_k + 2 (1/h_k + 1/h_{k+1}) s_k + s_{k+1}/h_{k+1} = 3 (d_k/h_k + d_{k+1}/h_{k+1})` with the
    /// slopes d of the chords, by elimination.
    fn through(knots: &'a [f64], values: &'a [f64]) -> Self {
        let last = knots.len() - 1;
        let step = |k: usize| knots[k] - knots[k - 1];
        let chord = |k: usize| (values[k] - values[k - 1]) / step(k);
        let (mut upper, mut slopes) = (vec![0.0; last + 1], vec![0.0; last + 1]);
        for k in 1..last {
            let (before, after) = (1.0 / step(k), 1.0 / step(k + 1));
            let pivot = 2.0 * (before + after) - before * upper[k - 1];
            upper[k] = after / pivot;
            let right = 3.0 * (chord(k) * before + chord(k + 1) * after);
            slopes[k] = (right - before * slopes[k - 1]) / pivot;
        }
        for k in (1..last).rev() {
            slopes[k] -= upper[k] * slopes[k + 1];
        }
        Self {
            knots,
            values,
            slopes,
        }
    }

    fn at(&self, time: f64) -> f64 {
        let after = self.knots.partition_point(|knot| *knot <= time);
        let k = after.clamp(1, self.knots.len() - 1);
        let h = self.knots[k] - self.knots[k - 1];
        let x = (time - self.knots[k - 1]) / h;
        let ([u, v], [p, q]) = (
            [self.values[k - 1], self.values[k]],
            [h * self.slopes[k - 1], h * self.slopes[k]],
        );
        u + x * (p + x * (3.0 * (v - u) - 2.0 * p - q + x * (2.0 * (u - v) + p + q)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cubic that is level at 0 and 2, t²(3 − t), is its own spline.
    #[test]
    fn a_level_cubic_is_its_own_spline() {
        let cubic = |t: f64| t * t * (3.0 - t);
        let knots = [0.0, 0.3, 0.9, 1.2, 2.0];
        let values = knots.map(cubic);
        let spline = Spline::through(&knots, &values);
        for k in 0..=200 {
            let t = 0.01 * f64::from(k);
            assert!((spline.at(t) - cubic(t)).abs() < 1e-13, "{t}");
        }
    }

    #[test]
    fn numbers_keep_their_units() {
        assert_eq!(
            quantities(" 60kHz, 90 kHz 5 ms"),
            ["60kHz", "90 kHz", "5 ms"]
        );
        assert_eq!(quantities(" 0.8 1.2 200"), ["0.8", "1.2", "200"]);
    }
}
