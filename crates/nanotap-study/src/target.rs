//! Targets: conditions that the motions at a point must meet, `F_max < 1 nN`,
//! `regime = attractive`, `states = 1`.
//!
//! A condition on a motion must hold for every motion that was found at a point, because the
//! lever may be in any of them. Where a run was not classified, or the setpoint is not reached, no
//! condition holds. A motion that does not repeat meets no condition on an observable, since
//! its extrema are not known.

use std::fmt;

use nanotap_dynamics::SameMotion;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize};

use nanotap_case::near_name::near_name;
use nanotap_case::quantity::Kind;
use nanotap_error::Error;
use nanotap_observe::table::shown_phase;
use nanotap_observe::{Observable, ObservableSet};

/// Conditions as they are written; all must hold.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Targets(pub Vec<String>);

impl<'de> Deserialize<'de> for Targets {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Given {
            One(String),
            Several(Vec<String>),
        }
        Ok(Self(match Given::deserialize(deserializer)? {
            Given::One(condition) => vec![condition],
            Given::Several(conditions) => conditions,
        }))
    }
}

impl JsonSchema for Targets {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Targets".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"type": ["array", "string"], "items": {"type": "string"}})
    }
}

impl Targets {
    /// The conditions; values in SI if `si`, otherwise in the model's units.
    ///
    /// # Errors
    /// When a quantity, a comparison or a value is not valid.
    pub fn parse(&self, si: bool) -> Result<Vec<Target>, Error> {
        self.0.iter().map(|text| Target::parse(text, si)).collect()
    }
}

/// Which force governs a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Regime {
    /// The mean force on the tip is zero.
    Free,
    /// The mean force on the tip is attractive: negative.
    Attractive,
    /// The mean force on the tip is repulsive: positive.
    Repulsive,
    /// The motion does not repeat.
    Irregular,
}

impl Regime {
    const ALL: [Self; 4] = [
        Self::Free,
        Self::Attractive,
        Self::Repulsive,
        Self::Irregular,
    ];

    /// The regime of a periodic motion with this mean force.
    pub const fn of(mean_force: f64) -> Self {
        if mean_force < 0.0 {
            Self::Attractive
        } else if mean_force > 0.0 {
            Self::Repulsive
        } else {
            Self::Free
        }
    }

    /// Returns the name in conditions and documents, such as `attractive`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Attractive => "attractive",
            Self::Repulsive => "repulsive",
            Self::Irregular => "irregular",
        }
    }
}

/// A motion at a point.
#[derive(Clone, Debug)]
pub struct TargetMotion {
    /// Period in drive periods; 0 of a motion that does not repeat.
    pub period: usize,
    /// Values of the observables of [`ObservableSet::COMMON`], in its order; NaN where unknown.
    pub values: Vec<f64>,
}

impl TargetMotion {
    /// Value of an observable of [`ObservableSet::COMMON`], in the unit of its dataset; NaN where
    /// unknown.
    pub fn value(&self, observable: &Observable) -> f64 {
        let index = ObservableSet::COMMON.iter().position(|o| o == observable);
        index
            .and_then(|k| self.values.get(k).copied())
            .unwrap_or(f64::NAN)
    }

    /// Value of the observable with this name, as [`value`](Self::value).
    pub fn named(&self, name: &str) -> f64 {
        Observable::named(name).map_or(f64::NAN, |observable| self.value(observable))
    }

    /// Its regime; `None` if its mean force is unknown.
    pub fn regime(&self) -> Option<Regime> {
        if self.period == 0 {
            return Some(Regime::Irregular);
        }
        let force = self.named("mean_force");
        force.is_finite().then(|| Regime::of(force))
    }

    fn is_same(&self, other: &Self) -> bool {
        let same = |name| SameMotion::numbers(self.named(name), other.named(name));
        // A motion that does not repeat has no number that two runs share.
        self.period == other.period
            && (self.period == 0 || (same("first_harmonic") && same("tip_max")))
    }
}

/// The motions at a point.
#[derive(Clone, Debug, Default)]
pub struct TargetPoint {
    /// The motions, one or more times each.
    pub motions: Vec<TargetMotion>,
    /// Whether a motion there is not known: a run without a classification, or no distance.
    pub unknown: bool,
}

impl TargetPoint {
    /// Returns the different motions found at the point, each once.
    pub fn different(&self) -> Vec<&TargetMotion> {
        let mut different: Vec<&TargetMotion> = Vec::new();
        for motion in &self.motions {
            if !different.iter().any(|other| other.is_same(motion)) {
                different.push(motion);
            }
        }
        different
    }

    /// Returns whether all conditions hold; false where no motion or an unclassified one was found.
    pub fn meets(&self, targets: &[Target]) -> bool {
        !self.unknown && !self.motions.is_empty() && targets.iter().all(|target| target.holds(self))
    }
}

/// A condition on the motions at a point, such as `F_max < 1 nN`.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    text: String,
    condition: Condition,
}

/// Quantity that a condition compares, with the comparison and the value.
#[derive(Clone, Debug, PartialEq)]
enum Condition {
    States(Comparison, f64),
    Period(Comparison, f64),
    Regime(Comparison, Regime),
    Observable(&'static Observable, Comparison, f64),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Comparison {
    Less,
    AtMost,
    Greater,
    AtLeast,
    Equal,
    Unequal,
}

impl Comparison {
    /// Signs of the comparisons, longer ones before those that are their beginning.
    const SIGNS: [(&'static str, Self); 9] = [
        ("<=", Self::AtMost),
        (">=", Self::AtLeast),
        ("!=", Self::Unequal),
        ("==", Self::Equal),
        ("≤", Self::AtMost),
        ("≥", Self::AtLeast),
        ("<", Self::Less),
        (">", Self::Greater),
        ("=", Self::Equal),
    ];

    fn holds(self, a: f64, b: f64) -> bool {
        match self {
            Self::Less => a < b,
            Self::AtMost => a <= b,
            Self::Greater => a > b,
            Self::AtLeast => a >= b,
            Self::Equal => a == b,
            Self::Unequal => a != b && a.is_finite(),
        }
    }

    const fn is_order(self) -> bool {
        !matches!(self, Self::Equal | Self::Unequal)
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Target {
    /// Reads a condition such as `F_max < 1 nN`; values in SI if `si`, otherwise in the model's units.
    ///
    /// # Errors
    /// When a quantity, a comparison or a value is not valid.
    pub fn parse(text: &str, si: bool) -> Result<Self, Error> {
        let wrong = |what: String| {
            Error::option(
                "where",
                format!("`{text}`: {what}"),
                "write a quantity, a comparison and a value, as in \"F_max < 1 nN\", \
                 \"regime = attractive\" or \"states = 1\"",
            )
        };
        let first = text.find(['<', '>', '=', '!', '≤', '≥']);
        let split = first.and_then(|at| {
            let (name, rest) = text.split_at(at);
            let signs = Comparison::SIGNS.iter();
            let mut found = signs.filter_map(|(sign, of)| Some((*of, rest.strip_prefix(sign)?)));
            let (comparison, value) = found.next()?;
            Some((name.trim(), comparison, value.trim()))
        });
        let (name, comparison, value) = split
            .ok_or_else(|| wrong("expected one of <, <=, >, >=, = and !=, got none".to_owned()))?;
        let count = || {
            let number = value.parse::<u32>().map(f64::from);
            number.map_err(|_| wrong(format!("expected a whole number, got `{value}`")))
        };
        let condition = match name {
            "states" => Condition::States(comparison, count()?),
            "period" => Condition::Period(comparison, count()?),
            "regime" => {
                let regime = Regime::ALL.into_iter().find(|r| r.name() == value);
                let regime = regime.ok_or_else(|| {
                    let names = Regime::ALL.map(Regime::name).join(", ");
                    wrong(format!("expected one of {names}, got `{value}`"))
                })?;
                if comparison.is_order() {
                    return Err(wrong("expected = or != after `regime`".to_owned()));
                }
                Condition::Regime(comparison, regime)
            }
            _ => {
                let named = |o: &&Observable| o.name == name || o.si_name == name;
                let observable = ObservableSet::COMMON.iter().find(named);
                let observable = observable.ok_or_else(|| wrong(unknown(name, &OWN)))?;
                if !comparison.is_order() {
                    return Err(wrong(format!(
                        "expected <, <=, > or >= after `{name}`, which is a real number"
                    )));
                }
                let value = limit(observable, value, si).map_err(wrong)?;
                Condition::Observable(observable, comparison, value)
            }
        };
        Ok(Self {
            text: text.trim().to_owned(),
            condition,
        })
    }

    /// Returns whether the condition is on the number of motions.
    pub const fn counts_states(&self) -> bool {
        matches!(self.condition, Condition::States(..))
    }

    /// Whether it holds for the motions of a point.
    fn holds(&self, point: &TargetPoint) -> bool {
        let each = |holds: &dyn Fn(&TargetMotion) -> bool| point.motions.iter().all(holds);
        match &self.condition {
            Condition::States(comparison, count) => {
                comparison.holds(point.different().len() as f64, *count)
            }
            Condition::Period(comparison, period) => {
                each(&|m| m.period > 0 && comparison.holds(m.period as f64, *period))
            }
            Condition::Regime(comparison, regime) => each(&|m| {
                m.regime()
                    .is_some_and(|own| (own == *regime) == (*comparison == Comparison::Equal))
            }),
            Condition::Observable(observable, comparison, limit) => each(&|m| {
                let value = m.value(observable);
                let value = if observable.name == "phase" {
                    shown_phase(value)
                } else {
                    value
                };
                m.period > 0 && comparison.holds(value, *limit)
            }),
        }
    }
}

/// Names that can be compared in addition to observables.
const OWN: [&str; 3] = ["states", "regime", "period"];

/// Describes the error of a name that is neither an observable nor one of these.
pub fn unknown(name: &str, own: &[&'static str]) -> String {
    let observables = ObservableSet::COMMON.iter().map(|o| o.si_name);
    let names: Vec<&str> = own.iter().copied().chain(observables).collect();
    let hint = near_name(name, names.iter().copied())
        .map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
    format!("expected one of {}, got `{name}`{hint}", names.join(", "))
}

/// A limit of an observable, in SI or in the model's units.
///
/// # Errors
/// A message about a text that is no value of the observable.
pub fn limit(observable: &Observable, text: &str, si: bool) -> Result<f64, String> {
    let kind = observable.dimension.kind();
    let name = observable.si_name;
    let bare = text.replace('\u{2212}', "-").parse::<f64>().ok();
    let value = match kind {
        Some(kind) if si => {
            if bare.is_some_and(|number| number != 0.0) {
                return Err(format!(
                    "expected {} with its unit, such as \"{}\", after `{name}`, got `{text}`",
                    kind.noun(),
                    kind.example()
                ));
            }
            kind.parse(text).map_err(|error| error.to_string())?
        }
        Some(_) => bare.ok_or_else(|| {
            format!("expected a number in the model's units after `{name}`, got `{text}`")
        })?,
        None if observable.dimension == nanotap_observe::Dimension::Angle => match bare {
            Some(degrees) => degrees,
            None => Kind::Angle
                .parse(text)
                .map_err(|error| error.to_string())?
                .to_degrees(),
        },
        None => Kind::Number
            .parse(text)
            .map_err(|error| error.to_string())?,
    };
    if value.is_finite() {
        Ok(value)
    } else {
        Err(format!("expected a finite value, got `{text}`"))
    }
}

/// Where the conditions hold, over one parameter or two.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct TargetReport {
    /// The conditions, which must all hold for every motion that was found at a point.
    #[serde(rename = "where")]
    pub conditions: Vec<String>,
    /// Whether the conditions hold at each point, row by row, one row for each value of the second
    /// parameter.
    pub holds: Vec<Vec<bool>>,
    /// Fraction of all points at which the conditions hold, 0 to 1.
    pub share: f64,
    /// The largest rectangle of points at all of which they hold, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub region: Option<TargetRegion>,
}

/// A rectangle of points at all of which the conditions hold.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct TargetRegion {
    /// Lowest and highest value of each parameter, in the unit of its key.
    pub ranges: Vec<[f64; 2]>,
    /// Value of each parameter at the point farthest from the edges, the lower one of an even number, in
    /// the unit of its key.
    pub centre: Vec<f64>,
    /// Number of points in the rectangle.
    pub points: usize,
}

impl TargetReport {
    /// Evaluates the conditions at points, row by row, over the values of one parameter or two.
    pub fn of(targets: &[Target], points: &[TargetPoint], axes: &[&[f64]]) -> Self {
        let columns = axes.first().map_or(1, |x| x.len()).max(1);
        let holds: Vec<Vec<bool>> = points
            .chunks(columns)
            .map(|row| row.iter().map(|point| point.meets(targets)).collect())
            .collect();
        let count = holds.iter().flatten().filter(|holds| **holds).count();
        let region = largest_rectangle(&holds).map(|sides| {
            let sides = sides.iter().zip(axes);
            TargetRegion {
                ranges: sides
                    .clone()
                    .map(|([low, high], values)| [values[*low], values[*high]])
                    .collect(),
                centre: sides
                    .clone()
                    .map(|([low, high], values)| values[usize::midpoint(*low, *high)])
                    .collect(),
                points: sides.map(|([low, high], _)| high - low + 1).product(),
            }
        });
        Self {
            conditions: targets.iter().map(Target::to_string).collect(),
            share: count as f64 / points.len().max(1) as f64,
            holds,
            region,
        }
    }
}

/// First and last column and row of the rectangle with the most points that all hold; of equal ones
/// the first, by row and column.
fn largest_rectangle(holds: &[Vec<bool>]) -> Option<[[usize; 2]; 2]> {
    let columns = holds.first().map_or(0, Vec::len);
    // Length of the run of points that hold, downwards from each point of the row.
    let mut best: Option<(usize, [[usize; 2]; 2])> = None;
    let mut depth = vec![0; columns];
    for (row, line) in holds.iter().enumerate() {
        for (depth, holds) in depth.iter_mut().zip(line) {
            *depth = if *holds { *depth + 1 } else { 0 };
        }
        // Columns whose runs rise, each with where a rectangle of that run begins.
        let mut open: Vec<(usize, usize)> = Vec::new();
        for column in 0..=columns {
            let here = depth.get(column).copied().unwrap_or(0);
            let mut begin = column;
            while let Some((from, height)) = open.last().copied()
                && height >= here
            {
                open.pop();
                begin = from;
                let points = height * (column - from);
                if points > best.map_or(0, |(points, _)| points) {
                    let sides = [[from, column - 1], [row + 1 - height, row]];
                    best = Some((points, sides));
                }
            }
            if here > 0 {
                open.push((begin, here));
            }
        }
    }
    best.map(|(_, sides)| sides)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motion of period 1 with these values of named observables, the others 0.
    fn motion(values: &[(&str, f64)]) -> TargetMotion {
        TargetMotion {
            period: 1,
            values: ObservableSet::COMMON
                .iter()
                .map(|o| {
                    let value = values.iter().find(|(name, _)| *name == o.name);
                    value.map_or(0.0, |(_, value)| *value)
                })
                .collect(),
        }
    }

    fn holds(text: &str, motions: &[TargetMotion]) -> bool {
        let point = TargetPoint {
            motions: motions.to_vec(),
            unknown: false,
        };
        point.meets(&[Target::parse(text, true).unwrap()])
    }

    #[test]
    fn conditions_hold_for_every_motion() {
        let soft = motion(&[
            ("peak_force", 0.5e-9),
            ("mean_force", -1e-11),
            ("phase", 120.0),
        ]);
        let hard = motion(&[
            ("peak_force", 2e-9),
            ("mean_force", 1e-10),
            ("phase", 60.0),
            ("first_harmonic", 1e-8),
        ]);
        let both = [soft.clone(), hard.clone()];
        for (text, of_soft, of_both) in [
            ("F_max < 1 nN", true, false),
            ("peak_force<=500 pN", true, false),
            ("F_max < 3 nN", true, true),
            ("regime = attractive", true, false),
            ("regime != free", true, true),
            ("states = 1", true, false),
            ("states <= 2", true, true),
            ("phase > 90", true, false),
            ("phase > 90 deg", true, false),
            ("mean_force < 0", true, false),
            ("period = 1", true, true),
        ] {
            let found = (holds(text, std::slice::from_ref(&soft)), holds(text, &both));
            assert_eq!(found, (of_soft, of_both), "{text}");
        }
        let chaotic = TargetMotion { period: 0, ..hard };
        assert!(!holds("F_max < 3 nN", std::slice::from_ref(&chaotic)));
        assert!(holds("regime = irregular", std::slice::from_ref(&chaotic)));
        // Two runs on a chaotic motion are one state.
        assert!(holds("states = 1", &[chaotic.clone(), chaotic]));
        let unknown = TargetPoint {
            motions: vec![soft],
            unknown: true,
        };
        assert!(!unknown.meets(&[Target::parse("states = 1", true).unwrap()]));
        assert!(!TargetPoint::default().meets(&[]));
    }

    #[test]
    fn wrong_conditions_are_refused_with_what_would_be_right() {
        for (text, words) in [
            ("F_max", "expected one of <, <="),
            ("F_mx < 1 nN", "did you mean `F_max`"),
            ("F_max < 1 nm", "a force"),
            ("F_max < 1", "a force with its unit"),
            ("F_max = 1 nN", "expected <, <=, > or >="),
            ("F_max < inf", "expected"),
            ("regime = sticky", "free, attractive, repulsive, irregular"),
            ("regime < free", "expected = or !="),
            ("states = many", "a whole number"),
            ("states = 1.5", "a whole number"),
            ("second_harmonic < 1 nm", "expected one of states"),
            ("", "expected one of <, <="),
        ] {
            let message = Target::parse(text, true).unwrap_err().to_string();
            assert!(message.contains(words), "{text}: {message}");
        }
        // A dimensionless case has no units.
        assert!(Target::parse("F_max < 1", false).is_ok());
        let message = Target::parse("F_max < 1 nN", false)
            .unwrap_err()
            .to_string();
        assert!(message.contains("model's units"), "{message}");
    }

    /// The rectangle found by trying all of them has as many points.
    #[test]
    fn the_largest_rectangle_is_found() {
        let mut seed = 1_u64;
        for _ in 0..200 {
            let mut bit = || {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                seed >> 62 != 0
            };
            let holds: Vec<Vec<bool>> = (0..5).map(|_| (0..6).map(|_| bit()).collect()).collect();
            let full = |[[a, b], [c, d]]: [[usize; 2]; 2]| {
                holds[c..=d].iter().all(|row| row[a..=b].iter().all(|h| *h))
            };
            let mut most = 0;
            for a in 0..6 {
                for b in a..6 {
                    for c in 0..5 {
                        for d in c..5 {
                            if full([[a, b], [c, d]]) {
                                most = most.max((b - a + 1) * (d - c + 1));
                            }
                        }
                    }
                }
            }
            let found = largest_rectangle(&holds);
            let points = found.map_or(0, |[[a, b], [c, d]]| (b - a + 1) * (d - c + 1));
            assert_eq!(points, most);
            assert!(found.is_none_or(full));
        }
    }
}
