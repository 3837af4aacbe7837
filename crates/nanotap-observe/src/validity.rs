//! Motions outside the range in which the sample's force law is valid.

use std::fmt;

use schemars::JsonSchema;
use serde::Serialize;

use super::table::{ObservableSet, Observables};
use nanotap_model::Model;

/// A ratio that a force law assumes to be small, and that a motion makes large.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct OutOfRange {
    /// The ratio, as a formula: `δ/R`.
    pub ratio: &'static str,
    /// Largest value of the ratio over the motion, dimensionless.
    pub value: f64,
    /// Largest value of the ratio for which the law is valid, dimensionless.
    pub limit: f64,
}

impl OutOfRange {
    /// Adds the observables that [`OutOfRange::of`] needs to `set`.
    pub fn observed_with(model: &Model, set: ObservableSet) -> ObservableSet {
        match model.nonlinear {
            Some(_) => set.union(ObservableSet::GAP),
            None => set,
        }
    }

    /// The limits that a motion with these observables violates; its gap must be measured.
    pub fn of(model: &Model, seen: &Observables) -> Vec<Self> {
        Self::within(model, seen.gap_range[0])
    }

    /// The limits violated at any rest position of the undriven lever.
    pub fn at_rest(model: &Model) -> Vec<Self> {
        let rests = model.equilibria().into_iter().filter(|e| e.stable);
        Self::within(model, rests.map(|e| e.gap).fold(f64::INFINITY, f64::min))
    }

    /// The limits violated at this least distance from the sample.
    pub fn within(model: &Model, least_gap: f64) -> Vec<Self> {
        let Some(nonlinear) = &model.nonlinear else {
            return Vec::new();
        };
        let remarks = nonlinear.remarks(least_gap).into_iter();
        let report = |remark: nanotap_volterra::Remark| Self {
            ratio: remark.ratio,
            value: remark.value,
            limit: remark.limit,
        };
        remarks.map(report).collect()
    }
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "{} reaches {:.3}, and the force law was derived for values up to {}",
            self.ratio, self.value, self.limit
        )
    }
}
