//! What a command studies: the case resolved to a cantilever or an oscillator, with the
//! units in which to show it.

use nanotap::case_file::CaseFile;
use nanotap::model::Model;
use nanotap::parameter::Parameter;
use nanotap::physical::{Kind, Resolved, Severity};
use nanotap::subject::{Key, Subject};
use nanotap::units::Units;
use serde::Serialize;

use crate::arguments::CaseArguments;
use crate::failure::Failure;
use crate::output::Output;
use crate::{command, number};

/// What a dimensionless parameter is in SI.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct ParameterUnit {
    /// The quantity: "drive frequency f".
    pub(crate) quantity: &'static str,
    /// Its SI unit.
    pub(crate) unit: &'static str,
    /// The SI value of 1.
    pub(crate) si: f64,
    /// What it measures.
    #[serde(skip)]
    pub(crate) kind: Kind,
}

/// What a command studies.
pub(crate) struct Studied {
    /// What the case is called in a heading.
    pub(crate) title: String,
    /// The cantilever or oscillator.
    pub(crate) subject: Subject,
    /// What is known of it in SI, if it is a physical case.
    pub(crate) resolved: Option<Resolved>,
}

impl Studied {
    /// The case of the arguments. What puts a physical case in doubt is said; its notes
    /// are `nanotap case`'s.
    pub(crate) fn of(arguments: &CaseArguments, output: &Output) -> Result<Self, Failure> {
        let title = command::title(arguments);
        let (subject, resolved) = match command::case_file(arguments)? {
            CaseFile::Dimensionless(case) => (Subject::Cantilever(case), None),
            CaseFile::Oscillator(oscillator) => (Subject::Oscillator(oscillator), None),
            CaseFile::Physical(tables) => {
                let resolved = command::resolve(&tables, arguments)?;
                for remark in &resolved.remarks {
                    if remark.severity == Severity::Warning {
                        output.warning(&remark.text);
                    }
                }
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
    pub(crate) fn model(&self) -> Result<Model, Failure> {
        Ok(self.subject.model()?)
    }

    /// The units in which to show it.
    pub(crate) fn units(&self) -> Units {
        Units::of(self.resolved.as_ref().map(|resolved| &resolved.scales))
    }

    /// What is studied, in a few words: `3 modes at Ω = 2.6`.
    pub(crate) fn summary(&self) -> String {
        match &self.subject {
            Subject::Cantilever(case) => format!(
                "{} at Ω = {}",
                number::counted(case.modes, "mode", "modes"),
                // A physical case's Ω was computed, not chosen.
                if self.resolved.is_some() {
                    number::significant(case.omega, 6)
                } else {
                    number::chosen(case.omega)
                }
            ),
            Subject::Oscillator(oscillator) => {
                let stop = if self.subject.has_rigid_stop() {
                    "rigid"
                } else {
                    "soft"
                };
                format!(
                    "an oscillator with a {stop} stop at ω = {}",
                    number::chosen(oscillator.omega)
                )
            }
        }
    }

    /// The parameter that is called `name`.
    pub(crate) fn key(&self, name: &str) -> Result<Key, Failure> {
        let given = name.strip_prefix("model.").unwrap_or(name);
        self.subject.key(given).map_err(|error| {
            Failure::request(
                error.to_string(),
                "name a parameter of the dimensionless model",
            )
        })
    }

    /// What a parameter is in SI, if the case is physical.
    pub(crate) fn parameter_unit(&self, key: Key) -> Option<ParameterUnit> {
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

    /// A value of a parameter, given after `option`: a number of the dimensionless model,
    /// or of a physical case a quantity with its unit.
    pub(crate) fn value(&self, key: Key, option: &str, text: &str) -> Result<f64, Failure> {
        if let Ok(value) = text.trim().parse::<f64>() {
            return Ok(value);
        }
        match self.parameter_unit(key) {
            Some(unit) => unit
                .kind
                .parse(text)
                .map(|si| si / unit.si)
                .map_err(|error| {
                    Failure::request(
                        format!("{option} {text}: {error}"),
                        "give a number or a quantity",
                    )
                }),
            None => Err(Failure::request(
                format!("{option} {text}: not a number"),
                format!("give a value of {} as a number", key.name()),
            )),
        }
    }

    /// Drive frequency, the model's unit of Ω.
    pub(crate) fn omega(&self) -> f64 {
        match &self.subject {
            Subject::Cantilever(case) => case.get(Parameter::Omega),
            Subject::Oscillator(oscillator) => oscillator.omega,
        }
    }
}
