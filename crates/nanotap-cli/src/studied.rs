//! What a command studies, at the terminal: remarks are said, wrong names and values become
//! failures with advice.

use std::ops::Deref;

use nanotap::case::physical::Severity;
use nanotap::case::subject::{Key, Subject};
use nanotap::model::Model;
pub(crate) use nanotap::study::studied::ParameterUnit;

use crate::arguments::CaseArguments;
use crate::failure::Failure;
use crate::output::Output;
use crate::{command, number, progress};

/// What a command studies.
pub(crate) struct Studied(nanotap::study::studied::Studied);

impl Deref for Studied {
    type Target = nanotap::study::studied::Studied;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

/// The case at its setpoint, if it leaves the distance to one.
pub(crate) fn at_setpoint(
    studied: nanotap::study::studied::Studied,
    output: &Output,
) -> Result<nanotap::study::studied::Studied, Failure> {
    if !studied.leaves_distance_to_setpoint() {
        return Ok(studied);
    }
    Ok(progress::watched(output, "distances", |control| {
        studied.at_setpoint(control)
    })??)
}

impl Studied {
    /// The case of the arguments. What puts a physical case in doubt is said; its notes
    /// are `nanotap case`'s.
    pub(crate) fn of(arguments: &CaseArguments, output: &Output) -> Result<Self, Failure> {
        let studied = at_setpoint(command::studied(arguments)?, output)?;
        if let Some(setpoint) = &studied.setpoint {
            output.note(&setpoint.remark().text);
        }
        Ok(Self::warned(studied, output))
    }

    /// The same, but a setpoint is not solved for: for experiments that vary the distance.
    pub(crate) fn with_any_distance(
        arguments: &CaseArguments,
        output: &Output,
    ) -> Result<Self, Failure> {
        Ok(Self::warned(command::studied(arguments)?, output))
    }

    fn warned(studied: nanotap::study::studied::Studied, output: &Output) -> Self {
        for remark in studied.resolved.iter().flat_map(|r| &r.remarks) {
            if remark.severity == Severity::Warning {
                output.warning(&remark.text);
            }
        }
        Self(studied)
    }

    /// The same with these parameters free to vary, quantities of a physical case
    /// (`drive.frequency`) among them.
    pub(crate) fn varying(self, names: &[&str]) -> Result<Self, Failure> {
        Ok(Self(self.0.varying(names)?))
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
            Subject::Physical(_) => "a lever of which physical quantities vary".to_owned(),
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
        Ok(self.0.key(name)?)
    }

    /// The parameter that is called `name`, and values of it given after their options.
    pub(crate) fn key_and_values<const N: usize>(
        &self,
        name: &str,
        given: [(&str, &str); N],
    ) -> Result<(Key, [f64; N]), Failure> {
        let plain = self.key(name)?;
        let mut key = None;
        let mut values = [0.0; N];
        for (value, (option, text)) in values.iter_mut().zip(given) {
            let (read, number) = self.0.key_and_value(plain, text).map_err(|error| {
                Failure::input(
                    format!("{option} {error}"),
                    "give a number or a quantity with its unit",
                )
            })?;
            *value = number;
            if *key.get_or_insert(read) != read {
                return Err(Failure::input(
                    format!("{option} {text}: the ends of the range measure different things"),
                    "give both in units of the same quantity",
                ));
            }
        }
        Ok((key.unwrap_or(plain), values))
    }

    /// A value of a parameter, given after `option`: a number of the dimensionless model,
    /// or of a physical case a quantity with its unit.
    pub(crate) fn value(&self, key: Key, option: &str, text: &str) -> Result<f64, Failure> {
        self.0.value(key, text).map_err(|error| {
            let help = match self.parameter_unit(key) {
                Some(_) => "give a number or a quantity".to_owned(),
                None => format!("give a value of {} as a number", key.name()),
            };
            Failure::input(format!("{option} {error}"), help)
        })
    }
}
