//! What a command studies: the case resolved to a cantilever or an oscillator, with the
//! units in which to show it.

use nanotap::case_file::CaseFile;
use nanotap::model::Model;
use nanotap::parameter::Parameter;
use nanotap::physical::{Resolved, Severity};
use nanotap::subject::{Key, Subject};
use nanotap::units::Units;

use crate::arguments::CaseArguments;
use crate::failure::Failure;
use crate::output::Output;
use crate::{command, number};

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
    #[allow(dead_code)]
    pub(crate) fn key(&self, name: &str) -> Result<Key, Failure> {
        let given = name.strip_prefix("model.").unwrap_or(name);
        self.subject.key(given).map_err(|error| {
            Failure::request(
                error.to_string(),
                "name a parameter of the dimensionless model",
            )
        })
    }

    /// Drive frequency, the model's unit of Ω.
    pub(crate) fn omega(&self) -> f64 {
        match &self.subject {
            Subject::Cantilever(case) => case.get(Parameter::Omega),
            Subject::Oscillator(oscillator) => oscillator.omega,
        }
    }
}
