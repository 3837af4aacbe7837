//! How many runs of a sweep came to what.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::dataset::{CLASSES, DISTANCE, HELD, START, UNREACHED, class_of};
use super::{FromNeighbour, from_neighbours};
use crate::setpoint_map;
use nanotap_case::Key;
use nanotap_dataset::{Store, StoreError};
use nanotap_motions::simulate::Classification;
use nanotap_observe::ObservableSet;
use nanotap_observe::frame::{Frame, Rows, frame};
use nanotap_study::target::{Target, TargetMotion, TargetPoint, TargetReport, Targets};

/// Counts of the runs by class and by period, with what else a finished dataset shows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Summary {
    /// Number of runs in the dataset.
    pub runs: usize,
    /// Number of runs by classification; every class is listed, also with 0.
    pub counts: BTreeMap<&'static str, usize>,
    /// Number of periodic runs by their period in drive periods.
    pub periods: BTreeMap<i32, usize>,
    /// Motions that no run reached, but that motions at neighbouring values lead to.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub from_neighbours: Vec<FromNeighbour>,
    /// Quantities that stay constant while the parameters vary although the case does not state
    /// them, in SI.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub held: BTreeMap<String, f64>,
    /// Where the conditions of `where` hold.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub targets: Option<TargetReport>,
    /// Values at which a setpoint is not reached, with the reason.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unreached: Vec<Unreached>,
    /// Which initial state the runs started from, if all started from one, and how to list the motions
    /// that others lead to.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// Periods of which the runs are counted one by one.
const COUNTED_PERIODS: usize = 12;

impl Summary {
    /// The runs by their result; the periodic ones by their period, too.
    pub fn count_table(&self) -> Frame<'_> {
        let mut all: Vec<(String, usize)> = Vec::new();
        for (name, count) in &self.counts {
            if *count > 0 {
                all.push(((*name).to_owned(), *count));
            }
            if *name == "periodic" {
                let periods = self.periods.iter().take(COUNTED_PERIODS);
                all.extend(periods.map(|(period, count)| (format!("  period {period}"), *count)));
                if self.periods.len() > COUNTED_PERIODS {
                    let longer = self.periods.values().skip(COUNTED_PERIODS).sum();
                    all.push(("  longer".to_owned(), longer));
                }
            }
        }
        let part = |count: usize| 100.0 * count as f64 / self.runs.max(1) as f64;
        frame! { Rows::new("counts", all, None);
            "motion", "motion", Plain => |(name, _)| name;
            "runs", "runs", Plain => |(_, count)| count;
            "percent", "%", Digits(3) => move |(_, count)| part(count);
        }
    }
}

/// Values of the parameters at which the setpoint is not reached.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Unreached {
    /// Value of each parameter, in the unit of its key and in the order in which they were given.
    pub values: Vec<f64>,
    /// Why it is not reached.
    pub reason: String,
}

/// Where the setpoint of a dataset is not reached; empty of a sweep without setpoints.
pub(crate) fn unreached(store: &Store) -> Vec<Unreached> {
    let text = store.schema().attributes.get(UNREACHED);
    let reasons: Vec<Option<String>> = text
        .and_then(|text| serde_json::from_str(text.as_str()?).ok())
        .unwrap_or_default();
    let axes = parameters(store);
    let columns = axes.first().map_or(1, Vec::len).max(1);
    let at = |k: usize| {
        let places = axes.iter().zip([k % columns, k / columns]);
        places.map(|(values, index)| values[index]).collect()
    };
    let reasons = reasons.into_iter().enumerate();
    reasons
        .filter_map(|(k, reason)| {
            Some(Unreached {
                values: at(k),
                reason: reason?,
            })
        })
        .collect()
}

/// The values of each parameter, in the order in which they were given.
fn parameters(store: &Store) -> Vec<Vec<f64>> {
    let schema = store.schema();
    let axes = schema.grid.axes.iter().enumerate().rev();
    axes.filter(|(_, axis)| axis.name != START)
        .map(|(axis, _)| schema.axis_values(axis))
        .collect()
}

/// The file of a dataset with the conditions of `where`.
const TARGETS: &str = "where.json";

/// Stores the conditions with a dataset. They do not belong to what it was computed from, so that
/// other conditions can be evaluated on the same dataset.
pub(crate) fn write_targets(store: &Store, targets: &[Target]) -> Result<(), StoreError> {
    if targets.is_empty() && store.read_beside(TARGETS)?.is_none() {
        return Ok(());
    }
    let texts = targets.iter().map(Target::to_string).collect();
    let text = serde_json::to_string(&Targets(texts)).unwrap_or_default();
    store.write_beside(TARGETS, text.as_bytes())
}

/// Where the conditions that are stored with a finished dataset hold; `None` if there are none.
///
/// # Errors
/// When a chunk or the conditions are missing or damaged.
pub(crate) fn target_report(store: &Store) -> Result<Option<TargetReport>, StoreError> {
    let Some(bytes) = store.read_beside(TARGETS)? else {
        return Ok(None);
    };
    let damaged = |what: String| StoreError::NotAStore {
        path: store.path().into(),
        what: format!("its {TARGETS} is damaged: {what}"),
    };
    let texts: Targets =
        serde_json::from_slice(&bytes).map_err(|error| damaged(error.to_string()))?;
    let units = store.schema().index_of("first_harmonic");
    let units = units.and_then(|k| store.schema().variables[k].attributes.get("units"));
    let si = units.and_then(|units| units.as_str()) == Some("m");
    let targets = texts.parse(si).map_err(|error| damaged(error.message()))?;
    if targets.is_empty() {
        return Ok(None);
    }
    let axes = parameters(store);
    let axes: Vec<&[f64]> = axes.iter().map(Vec::as_slice).collect();
    let points = if setpoint_map::is_map(store) {
        setpoint_map::motions(store)?
    } else {
        points(store)?
    };
    Ok(Some(TargetReport::of(&targets, &points, &axes)))
}

/// The motions at the values of the parameters, the first parameter fastest.
pub(crate) fn points(store: &Store) -> Result<Vec<TargetPoint>, StoreError> {
    let schema = store.schema();
    let parameters = schema.grid.axes.len() - 1;
    let lengths = schema.grid.axes.iter().take(parameters);
    let count = lengths.map(|axis| axis.length).product();
    let columns = schema.grid.axes[parameters - 1].length;
    let mut points = vec![TargetPoint::default(); count];
    let mut names = vec!["classification", "period"];
    names.extend(ObservableSet::COMMON.iter().map(|o| o.name));
    let observed = names.len();
    if schema.index_of(DISTANCE).is_some() {
        names.push(DISTANCE);
    }
    store.each_row(&names, |entry, row| {
        let second = if parameters > 1 { entry[0] } else { 0 };
        let point = &mut points[second * columns + entry[parameters - 1]];
        let unreached = row[observed..].iter().any(|distance| distance.is_nan());
        let period = match class_of(row[0] as u8) {
            Some(Classification::Periodic) if !unreached => row[1] as usize,
            Some(Classification::Chaotic | Classification::QuasiPeriodic) if !unreached => 0,
            _ => {
                point.unknown = true;
                return;
            }
        };
        point.motions.push(TargetMotion {
            period,
            values: row[2..observed].to_vec(),
        });
    })?;
    for motion in from_neighbours(store)? {
        let second = motion.at.get(1).copied().unwrap_or(0);
        let Some(point) = points.get_mut(second * columns + motion.at[0]) else {
            continue;
        };
        let value = |name| motion.observables.get(name).copied();
        point.motions.push(TargetMotion {
            period: motion.period,
            values: ObservableSet::COMMON
                .iter()
                .map(|o| value(o.name).unwrap_or(f64::NAN))
                .collect(),
        });
    }
    Ok(points)
}

/// Returns the quantities that stay constant while the parameters of a sweep vary, as its dataset
/// states them.
pub(crate) fn held(store: &Store) -> BTreeMap<String, f64> {
    let text = store.schema().attributes.get(HELD);
    text.and_then(|text| serde_json::from_str(text.as_str()?).ok())
        .unwrap_or_default()
}

/// States from which initial state the runs of a sweep started, unless they started from several.
fn initial_state_note(store: &Store) -> Option<String> {
    let attribute = |name: &str| {
        let text = store.schema().attributes.get(name)?.as_str()?;
        serde_json::from_str::<Value>(text).ok()
    };
    let starts = &attribute("sweep")?["starts"];
    let at_setpoint = || {
        let case = attribute("case").unwrap_or_default();
        let start = &case[Key::DriveStart.path()];
        store.schema().index_of(DISTANCE).is_some() || !start.is_null()
    };
    let start = match starts {
        Value::Object(given) if given.contains_key("state") => "the given state",
        Value::String(_) if at_setpoint() => "the motion at the setpoint",
        Value::String(_) => "rest",
        _ => return None,
    };
    Some(format!(
        "the runs start from {start}; other initial states may lead to other motions: with a number of \
         starts a sweep follows several at each value, and `attractors` lists the motions at one"
    ))
}

impl Summary {
    /// Counts the runs of a finished dataset.
    ///
    /// # Errors
    /// When a chunk is missing or damaged.
    pub fn of(store: &Store) -> Result<Self, StoreError> {
        store.require_all()?;
        let mut summary = Self {
            from_neighbours: from_neighbours(store)?,
            held: held(store),
            targets: target_report(store)?,
            unreached: unreached(store),
            notes: initial_state_note(store).into_iter().collect(),
            ..Self::default()
        };
        summary.counts.extend(CLASSES.iter().map(|c| (c.name(), 0)));
        store.each(["classification", "period"], |_, [code, period]| {
            summary.runs += 1;
            if let Some(class) = class_of(code as u8) {
                *summary.counts.entry(class.name()).or_default() += 1;
            }
            if period > 0.0 {
                *summary.periods.entry(period as i32).or_default() += 1;
            }
        })?;
        Ok(summary)
    }
}
