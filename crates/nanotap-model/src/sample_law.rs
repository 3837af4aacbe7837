//! The nonlinear force laws of a sample: names and numbers of laws of
//! [`nanotap_volterra::laws`], in the model's units.

use std::sync::Arc;

use crate::words::plain;
use nanotap_volterra::laws::entry::{Entry, ParameterEntry};
use nanotap_volterra::laws::prony::Arms;
use nanotap_volterra::laws::table::Rows;
use nanotap_volterra::laws::{TableLaw, all, build_sum, law};
use nanotap_volterra::{ForceLaw, VolterraError};
use serde::ser::SerializeSeq;
use serde::{Serialize, Serializer};

/// A law, or a sum of laws, with its parameters.
#[derive(Clone, Debug)]
pub struct SampleLaw {
    terms: Vec<&'static TableLaw>,
    /// The parameters of all terms, in sequence.
    values: Vec<f64>,
    /// The rows of a table, in the units to which the table's factors refer.
    rows: Option<Arc<Rows>>,
    /// The arms of a sample that relaxes, in the units to which their factors refer.
    arms: Option<Arc<Arms>>,
}

impl PartialEq for SampleLaw {
    fn eq(&self, other: &Self) -> bool {
        self.values == other.values
            && self.rows == other.rows
            && self.arms == other.arms
            && self.terms.len() == other.terms.len()
            && (self.entries().zip(other.entries())).all(|(a, b)| std::ptr::eq(a, b))
    }
}

impl SampleLaw {
    /// The names of all laws.
    pub fn all() -> impl Iterator<Item = &'static str> {
        all().map(|law| law.entry.name)
    }

    /// The laws that `text` names, `hertz` or `hertz + exponential-damping`.
    ///
    /// # Errors
    /// [`VolterraError::UnknownLaw`] for the first unknown name.
    pub fn terms(text: &str) -> Result<Vec<&'static TableLaw>, VolterraError> {
        text.split('+').map(|name| law(&plain(name))).collect()
    }

    /// These laws with `values`, the parameters of all terms in sequence, in the model's units, and
    /// the rows of a table and the arms of a Prony series, if one of them has these.
    ///
    /// # Errors
    /// When a value is not allowed, rows or arms are missing, or two of the laws cannot be added.
    pub fn new(
        terms: Vec<&'static TableLaw>,
        values: Vec<f64>,
        rows: Option<Arc<Rows>>,
        arms: Option<Arc<Arms>>,
    ) -> Result<Self, VolterraError> {
        let law = Self {
            terms,
            values,
            rows,
            arms,
        };
        law.build()?;
        Ok(law)
    }

    fn names(&self) -> impl Iterator<Item = &'static str> {
        self.entries().map(|entry| entry.name)
    }

    /// The table entry of each term.
    pub fn entries(&self) -> impl Iterator<Item = &'static Entry> {
        self.terms.iter().map(|term| term.entry)
    }

    /// Returns the names of the laws, joined by ` + `.
    pub fn name(&self) -> String {
        self.names().collect::<Vec<_>>().join(" + ")
    }

    /// The parameters of all terms with their values, term by term.
    pub fn parameters(&self) -> impl Iterator<Item = (&'static ParameterEntry, f64)> {
        let entries = self.entries().flat_map(|entry| entry.parameters);
        entries.zip(self.values.iter().copied())
    }

    /// Returns the values of all parameters, term by term, in model units.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Returns the law with each value changed by `step` times its entry of `slopes`.
    #[must_use]
    pub(crate) fn moved(&self, slopes: &[f64], step: f64) -> Self {
        let values = self.values.iter().zip(slopes);
        Self {
            values: values.map(|(value, slope)| value + step * slope).collect(),
            ..self.clone()
        }
    }

    /// Whether the force depends on time, as that of an ac voltage does.
    pub fn takes_signal(&self) -> bool {
        self.build().is_ok_and(|law| law.takes_signal())
    }

    /// The force law.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn build(&self) -> Result<Arc<dyn ForceLaw>, VolterraError> {
        let mut rest = self.values.as_slice();
        let mut built = Vec::with_capacity(self.terms.len());
        for term in &self.terms {
            let count = term.entry.parameters.len().min(rest.len());
            let (own, others) = rest.split_at(count);
            let law = match (&self.rows, &self.arms) {
                (Some(rows), _) if term.has_rows() => term.through(rows, own),
                (_, Some(arms)) if term.has_arms() => term.with_arms(arms, own),
                _ => term.with(own),
            };
            built.push((term.entry, law?));
            rest = others;
        }
        build_sum(&built)
    }
}

impl Serialize for SampleLaw {
    /// As the list of its laws, each a map from names to values in the model's units.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Term<'a> {
            law: &'static str,
            #[serde(skip_serializing_if = "Option::is_none")]
            force: Option<&'static str>,
            #[serde(flatten)]
            parameters: std::collections::BTreeMap<&'static str, f64>,
            #[serde(skip_serializing_if = "Option::is_none")]
            rows: Option<&'a [(f64, f64)]>,
            #[serde(skip_serializing_if = "Option::is_none")]
            damping: Option<&'a [f64]>,
            #[serde(skip_serializing_if = "Option::is_none")]
            interpolation: Option<&'static str>,
            #[serde(skip_serializing_if = "Option::is_none")]
            arms: Option<&'a [(f64, f64)]>,
        }
        let mut values = self.values.iter().copied();
        let mut terms = serializer.serialize_seq(Some(self.terms.len()))?;
        for law in &self.terms {
            let entry = law.entry;
            let rows = self.rows.as_deref().filter(|_| law.has_rows());
            let arms = self.arms.as_deref().filter(|_| law.has_arms());
            let parameters = entry.parameters.iter().map(|p| p.name);
            terms.serialize_element(&Term {
                law: entry.name,
                force: law.text(),
                parameters: parameters.zip(values.by_ref()).collect(),
                rows: rows.map(Rows::points),
                damping: rows.map(Rows::damping).filter(|all| !all.is_empty()),
                interpolation: rows.map(|rows| rows.interpolation().name()),
                arms: arms.map(Arms::points),
            })?;
        }
        terms.end()
    }
}
