//! What an experiment studies: a case resolved to a cantilever or an oscillator, with the
//! units in which to show it. The doors share it.

use serde::Serialize;

use crate::case_file::{CaseFile, CaseFileError};
use crate::model::{Model, ModelError};
use crate::parameter::Parameter;
use crate::physical::{Catalogue, Kind, QuantityError, Resolved};
use crate::subject::{Key, Subject, UnknownKey};
use crate::units::Units;

/// What a dimensionless parameter is in SI.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ParameterUnit {
    /// The quantity: "drive frequency f".
    pub quantity: &'static str,
    /// Its SI unit.
    pub unit: &'static str,
    /// The SI value of 1.
    pub si: f64,
    /// What it measures.
    #[serde(skip)]
    pub kind: Kind,
}

/// What an experiment studies.
#[derive(Clone, Debug)]
pub struct Studied {
    /// What the case is called in a heading.
    pub title: String,
    /// The cantilever or oscillator.
    pub subject: Subject,
    /// What is known of it in SI, if it is a physical case.
    pub resolved: Option<Resolved>,
}

/// A value of a parameter that cannot be read.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ParameterValueError {
    /// Of a dimensionless case only numbers are taken.
    #[error("{text}: not a number")]
    NotANumber {
        /// What was given.
        text: String,
    },
    /// The quantity makes no sense.
    #[error("{text}: {error}")]
    Quantity {
        /// What was given.
        text: String,
        /// Why.
        error: QuantityError,
    },
}

impl Studied {
    /// What `file` describes, its levers and materials taken from `catalogue`.
    ///
    /// # Errors
    /// What is wrong with the quantities of a physical case.
    pub fn resolve(
        title: String,
        file: CaseFile,
        catalogue: &Catalogue,
    ) -> Result<Self, CaseFileError> {
        let (subject, resolved) = match file {
            CaseFile::Dimensionless(case) => (Subject::Cantilever(case), None),
            CaseFile::Oscillator(oscillator) => (Subject::Oscillator(oscillator), None),
            CaseFile::Physical(tables) => {
                let resolved = tables.resolve(catalogue)?;
                (Subject::Cantilever(resolved.case.clone()), Some(resolved))
            }
        };
        Ok(Self {
            title,
            subject,
            resolved,
        })
    }

    /// Its model.
    ///
    /// # Errors
    /// As [`Subject::model`].
    pub fn model(&self) -> Result<Model, ModelError> {
        self.subject.model()
    }

    /// The units in which to show it.
    pub fn units(&self) -> Units {
        Units::of(self.resolved.as_ref().map(|resolved| &resolved.scales))
    }

    /// The parameter that is called `name`, with or without `model.` before it.
    ///
    /// # Errors
    /// [`UnknownKey`] with what there is and the nearest name.
    pub fn key(&self, name: &str) -> Result<Key, UnknownKey> {
        self.subject
            .key(name.strip_prefix("model.").unwrap_or(name))
    }

    /// What a parameter is in SI, if the case is physical.
    pub fn parameter_unit(&self, key: Key) -> Option<ParameterUnit> {
        let Key::Cantilever(parameter) = key else {
            return None;
        };
        let resolved = self.resolved.as_ref()?;
        let row = resolved
            .mapping()
            .into_iter()
            .find(|row| row.parameter == parameter)?;
        Some(ParameterUnit {
            quantity: row.quantity,
            unit: row.kind.si_unit(),
            si: resolved.scales.of(parameter),
            kind: row.kind,
        })
    }

    /// A value of a parameter: a number of the dimensionless model, or of a physical case
    /// a quantity with its unit.
    ///
    /// # Errors
    /// When `text` is neither.
    pub fn value(&self, key: Key, text: &str) -> Result<f64, ParameterValueError> {
        if let Ok(value) = text.trim().parse::<f64>() {
            return Ok(value);
        }
        let text = text.to_owned();
        match self.parameter_unit(key) {
            Some(unit) => unit
                .kind
                .parse(&text)
                .map(|si| si / unit.si)
                .map_err(|error| ParameterValueError::Quantity { text, error }),
            None => Err(ParameterValueError::NotANumber { text }),
        }
    }

    /// Drive frequency, the model's unit of Ω.
    pub fn omega(&self) -> f64 {
        match &self.subject {
            Subject::Cantilever(case) => case.get(Parameter::Omega),
            Subject::Oscillator(oscillator) => oscillator.omega,
        }
    }
}
