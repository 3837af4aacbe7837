//! What a command studies, at the terminal: remarks are said, wrong names and values become
//! failures with advice.

use std::ops::Deref;

use nanotap::model::Model;
use nanotap::physical::Severity;
pub(crate) use nanotap::studied::ParameterUnit;
use nanotap::subject::{Key, Subject};

use crate::arguments::CaseArguments;
use crate::failure::Failure;
use crate::output::Output;
use crate::{command, number};

/// What a command studies.
pub(crate) struct Studied(nanotap::studied::Studied);

impl Deref for Studied {
    type Target = nanotap::studied::Studied;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl Studied {
    /// The case of the arguments. What puts a physical case in doubt is said; its notes
    /// are `nanotap case`'s.
    pub(crate) fn of(arguments: &CaseArguments, output: &Output) -> Result<Self, Failure> {
        let studied = command::studied(arguments)?;
        for remark in studied.resolved.iter().flat_map(|r| &r.remarks) {
            if remark.severity == Severity::Warning {
                output.warning(&remark.text);
            }
        }
        Ok(Self(studied))
    }

    /// Its model.
    pub(crate) fn model(&self) -> Result<Model, Failure> {
        Ok(self.0.model()?)
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
        self.0.key(name).map_err(|error| {
            Failure::request(
                error.to_string(),
                "name a parameter of the dimensionless model",
            )
        })
    }

    /// A value of a parameter, given after `option`: a number of the dimensionless model,
    /// or of a physical case a quantity with its unit.
    pub(crate) fn value(&self, key: Key, option: &str, text: &str) -> Result<f64, Failure> {
        self.0.value(key, text).map_err(|error| {
            let help = match self.parameter_unit(key) {
                Some(_) => "give a number or a quantity".to_owned(),
                None => format!("give a value of {} as a number", key.name()),
            };
            Failure::request(format!("{option} {error}"), help)
        })
    }
}
