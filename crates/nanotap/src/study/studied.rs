//! What an experiment studies: a case resolved to a cantilever or an oscillator, with the
//! units in which to show it. The doors share it.

use std::sync::Arc;

use nanotap_dynamics::Control;
use serde::Serialize;

use crate::case::file::{CaseFile, CaseFileError};
use crate::case::physical::{Catalogue, Kind, QuantityError, Resolved};
use crate::case::physical_subject::{PhysicalSource, PhysicalSubject, VaryError};
use crate::case::subject::{Key, Subject, UnknownKey};
use crate::case::units::Units;
use crate::model::parameter::Parameter;
use crate::model::{Model, ModelError};
use crate::study::approach::ApproachError;
use crate::study::setpoint::{SetpointError, SetpointReport, solve_setpoint};

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
    /// The physical case as it was written, whose quantities can vary.
    pub source: Option<PhysicalSource>,
    /// How the setpoint was solved for, if it was.
    pub setpoint: Option<SetpointReport>,
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
        let (subject, resolved, source) = match file {
            CaseFile::Dimensionless(case) => (Subject::Cantilever(case), None, None),
            CaseFile::Oscillator(oscillator) => (Subject::Oscillator(oscillator), None, None),
            CaseFile::Physical(tables) => {
                let source = PhysicalSource {
                    tables,
                    catalogue: Arc::new(catalogue.clone()),
                };
                let resolved = source.resolve()?;
                let subject = Subject::Cantilever(resolved.case.clone());
                (subject, Some(resolved), Some(source))
            }
        };
        Ok(Self {
            title,
            subject,
            resolved,
            source,
            setpoint: None,
        })
    }

    /// Whether the case leaves the distance to a setpoint: `drive.setpoint` without `gap.tip`.
    pub fn leaves_distance_to_setpoint(&self) -> bool {
        let given = self
            .source
            .as_ref()
            .is_some_and(|source| source.tables.get("gap", "tip").is_some());
        !given && self.resolved.as_ref().is_some_and(|r| r.setpoint.is_some())
    }

    /// The same at the distance where the approach reaches the setpoint, if the case leaves the
    /// distance to one; else unchanged.
    ///
    /// # Errors
    /// [`SetpointError`] when no distance can be chosen.
    pub fn at_setpoint(self, control: &Control<'_>) -> Result<Self, SetpointError> {
        let (Some(source), true) = (&self.source, self.leaves_distance_to_setpoint()) else {
            return Ok(self);
        };
        let report = solve_setpoint(&self, control)?;
        let Some(resolved) = &self.resolved else {
            return Ok(self);
        };
        let mut source = source.clone();
        let set = |source: &mut PhysicalSource, key, value| {
            let text = Kind::Length.format_exact(value);
            source.tables.set("gap", key, &text);
        };
        set(&mut source, "tip", report.zc());
        // The unit of length stays that of the solutions; the beam, which moves with the tip,
        // is out of place by less than the free amplitude.
        set(&mut source, "beam", resolved.scales.length);
        let mut resolved = source
            .resolve()
            .map_err(|error| ApproachError::Model(ModelError::Physical(Box::new(error))))?;
        resolved.remarks.push(report.remark());
        Ok(Self {
            subject: Subject::Cantilever(resolved.case.clone()),
            resolved: Some(resolved),
            source: Some(source),
            setpoint: Some(report),
            ..self
        })
    }

    /// The same with the parameters called `names` free to vary: where one of them is a
    /// quantity of the physical case (`drive.frequency`), all must be, and are then mapped to
    /// the model anew at every value.
    ///
    /// # Errors
    /// [`VaryError`] for a quantity that there is not, or that cannot vary.
    pub fn varying(&self, names: &[&str]) -> Result<Self, VaryError> {
        let (Some(source), Some(resolved)) = (&self.source, &self.resolved) else {
            return Ok(self.clone());
        };
        let physical = |name: &str| name.contains('.') && !name.starts_with("model.");
        if !names.iter().any(|name| physical(name)) {
            return Ok(self.clone());
        }
        // The number of modes varies beside any.
        let quantities: Vec<&str> = names
            .iter()
            .copied()
            .filter(|name| !matches!(*name, "modes" | "model.modes"))
            .collect();
        let subject = PhysicalSubject::new(source, resolved, &quantities)?;
        Ok(Self {
            subject: Subject::Physical(Box::new(subject)),
            ..self.clone()
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
        let parameter = match key {
            Key::Cantilever(parameter) => parameter,
            Key::Oscillator(_) => return None,
            // Its values are in SI already.
            Key::Physical(key) => {
                return Some(ParameterUnit {
                    quantity: key.path(),
                    unit: key.kind().si_unit(),
                    si: 1.0,
                    kind: key.kind(),
                });
            }
        };
        let resolved = self.resolved.as_ref()?;
        let row = resolved
            .mapping()
            .into_iter()
            .find(|row| row.parameter == parameter)?;
        Some(ParameterUnit {
            quantity: row.quantity,
            unit: row.kind.si_unit(),
            si: resolved.scales.of(parameter, resolved.case.actuation),
            kind: row.kind,
        })
    }

    /// A parameter and a value of it; of a quantity of a physical case also what the value
    /// measures.
    ///
    /// # Errors
    /// As [`value`](Self::value).
    pub fn key_and_value(&self, key: Key, text: &str) -> Result<(Key, f64), ParameterValueError> {
        let Key::Physical(physical) = key else {
            return Ok((key, self.value(key, text)?));
        };
        physical
            .read(text)
            .map(|(key, value)| (Key::Physical(key), value))
            .map_err(|error| ParameterValueError::Quantity {
                text: text.to_owned(),
                error,
            })
    }

    /// A value of a parameter: a number of the dimensionless model, or of a physical case
    /// a quantity with its unit.
    ///
    /// # Errors
    /// When `text` is neither.
    pub fn value(&self, key: Key, text: &str) -> Result<f64, ParameterValueError> {
        if let Key::Physical(_) = key {
            return Ok(self.key_and_value(key, text)?.1);
        }
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
            Subject::Physical(_) => self
                .resolved
                .as_ref()
                .map_or(f64::NAN, |resolved| resolved.case.omega),
        }
    }
}

impl From<ParameterValueError> for crate::Error {
    fn from(error: ParameterValueError) -> Self {
        Self::input(
            error.to_string(),
            "give a number, or of a physical case a quantity with its unit",
        )
    }
}
