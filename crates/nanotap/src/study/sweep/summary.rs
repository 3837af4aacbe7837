//! How many runs of a sweep came to what.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use super::dataset::{CLASSES, HELD, class_of};
use super::{FromNeighbour, from_neighbours};
use crate::dataset::{Store, StoreError};

/// How many runs came to what.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Summary {
    /// All of them.
    pub runs: usize,
    /// By classification; every one is there, also with 0.
    pub counts: BTreeMap<&'static str, usize>,
    /// Periodic ones by period.
    pub periods: BTreeMap<i32, usize>,
    /// Motions that no run met, but that those of neighbouring values lead to.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub from_neighbours: Vec<FromNeighbour>,
    /// What stays while the parameters vary although it was not stated, in SI.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub held: BTreeMap<String, f64>,
}

/// What stays while the parameters of a sweep vary, as its dataset states it.
pub(crate) fn held(store: &Store) -> BTreeMap<String, f64> {
    let text = store.schema().attributes.get(HELD);
    text.and_then(|text| serde_json::from_str(text.as_str()?).ok())
        .unwrap_or_default()
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
