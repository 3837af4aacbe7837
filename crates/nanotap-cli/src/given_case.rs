//! The case of a command at the terminal: remarks are printed, wrong names and values become
//! failures with advice.

use std::ops::Deref;
use std::path::PathBuf;
use std::sync::Arc;

use nanotap::case::file::Source;
use nanotap::case::physical::{Catalogue, Kind, Severity};
use nanotap::case::{Case, Key};
use nanotap::model::Model;
use nanotap::study::fit::{FitOptions, implied_words};
use nanotap::study::setpoint::{self, SetpointReport};

use crate::arguments::CaseArguments;
use crate::failure::Failure;
use crate::output::Output;
use crate::{number, progress};

/// The case of a command.
pub(crate) struct GivenCase(Case);

impl Deref for GivenCase {
    type Target = Case;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

/// The case at its setpoint and the result of the solution, if it derives the distance from one.
pub(crate) fn at_setpoint(case: Case) -> Result<(Case, Option<SetpointReport>), Failure> {
    if !case.leaves_distance_to_setpoint() {
        return Ok((case, None));
    }
    progress::watched("setpoint", "distances", false, |control| {
        setpoint::at_setpoint(case, control)
    })
}

impl GivenCase {
    /// Reads the case of the arguments, for a study that takes a case at any distance or at its
    /// setpoint. Warnings about a physical case are printed, and keys of its file that have no
    /// effect; other notes are left to `nanotap case`.
    pub(crate) fn for_study(
        arguments: &CaseArguments,
        any_distance: bool,
        output: &Output,
    ) -> Result<Self, Failure> {
        // A study that chooses the distance needs none of the case.
        let distance = any_distance.then(|| ANY_DISTANCE.to_owned());
        Self::with_implied(arguments, distance.as_slice(), any_distance, output)
    }

    /// As [`for_study`](Self::for_study), for a study that gives values to the keys of the `implied`
    /// `key=value` words: the case may lack these keys.
    pub(crate) fn with_implied(
        arguments: &CaseArguments,
        implied: &[String],
        any_distance: bool,
        output: &Output,
    ) -> Result<Self, Failure> {
        let case = case_lacking(arguments, implied)?;
        if any_distance {
            return Ok(Self::warned(case, output));
        }
        let (case, setpoint) = at_setpoint(case)?;
        if let Some(setpoint) = &setpoint {
            output.note(&setpoint.remark().text);
        }
        Ok(Self::warned(case, output))
    }

    /// Reads the case of the arguments and solves for its setpoint.
    pub(crate) fn of(arguments: &CaseArguments, output: &Output) -> Result<Self, Failure> {
        Self::for_study(arguments, false, output)
    }

    /// Reads the case of the arguments without printing anything.
    pub(crate) fn silent(arguments: &CaseArguments) -> Result<Self, Failure> {
        case_of(arguments).map(Self)
    }

    /// Reads the case of the arguments for a fit without printing anything, with what it lacks and the
    /// data or the options state; returns what is assumed.
    pub(crate) fn of_data(
        arguments: &CaseArguments,
        request: &FitOptions,
    ) -> Result<(Self, Vec<String>), Failure> {
        let catalogue = catalogue(&arguments.catalogue)?;
        let load = |words: &[String]| {
            let words = [arguments.set.as_slice(), words].concat();
            Case::load(arguments.file.as_deref(), &words, &catalogue)
        };
        let implied = implied_words(request, &arguments.set, load)?;
        let is_implied = arguments.file.is_none() && !implied.words.is_empty();
        let mut arguments = arguments.clone();
        arguments.set.extend(implied.words);
        let Self(case) = Self::silent(&arguments)?;
        let data = request.data.first().filter(|_| is_implied);
        let case = data.map_or_else(|| case.clone(), |data| case.clone().called(&data.name));
        Ok((Self(case), implied.notes))
    }

    fn warned(case: Case, output: &Output) -> Self {
        warn(&case, output);
        let case = Self(case);
        case.note_replaced(output);
        case
    }

    /// Prints the keys of the file that have no effect.
    pub(crate) fn note_replaced(&self, output: &Output) {
        for replaced in self.replaced() {
            output.note(&replaced.text);
        }
    }

    /// Prints the warnings about the case with this text, which a fit of this one found.
    pub(crate) fn warn_of_result(
        &self,
        found: &str,
        arguments: &CaseArguments,
        output: &Output,
    ) -> Result<(), Failure> {
        let catalogue = catalogue(&arguments.catalogue)?;
        let source = Source {
            name: "the best fit".to_owned(),
            text: found.to_owned(),
        };
        let found = Case::parse_with(Some(source), &[], &catalogue).ok();
        warn(found.as_ref().unwrap_or(self), output);
        Ok(())
    }

    /// Prints the keys that stay constant while these keys vary, as the arguments that reproduce a
    /// point.
    pub(crate) fn note_constants(&self, keys: &[Key], output: &Output) {
        let words: Vec<String> = self
            .held(keys)
            .iter()
            .filter_map(|(held, value)| {
                let kind = self.key(held).ok()?.kind();
                Some(format!("--set {held}=\"{}\"", kind.format_exact(*value)))
            })
            .collect();
        if !words.is_empty() {
            output.note(&format!(
                "held while {} {}; with the same value the same point again: {}",
                keys.iter()
                    .map(|key| key.path())
                    .collect::<Vec<_>>()
                    .join(" and "),
                if keys.len() == 1 { "varies" } else { "vary" },
                words.join(" ")
            ));
        }
    }

    /// Builds the model of the case.
    pub(crate) fn model(&self) -> Result<Model, Failure> {
        Ok(self.0.model()?)
    }

    /// Describes the case in a few words: `3 modes at Ω = 2.6`.
    pub(crate) fn summary(&self) -> String {
        if let Some(oscillator) = self.oscillator() {
            let stop = if self.has_rigid_stop() {
                "rigid"
            } else {
                "soft"
            };
            return format!(
                "an oscillator with a {stop} stop at ω = {}",
                number::chosen(oscillator.omega)
            );
        }
        let Some(cantilever) = self.cantilever() else {
            return "a lever".to_owned();
        };
        let at = self.physical().map_or_else(
            || format!("Ω = {}", number::chosen(cantilever.omega)),
            |view| {
                let hertz = view.scales.frequency * cantilever.omega;
                Kind::Frequency.format_digits(hertz, 6)
            },
        );
        let modes = number::counted(cantilever.modes, "mode", "modes");
        format!("{modes} at {at}")
    }
}

/// Prints the warnings about a case.
fn warn(case: &Case, output: &Output) {
    for remark in case.remarks() {
        if remark.severity == Severity::Warning {
            output.warning(&remark.text);
        }
    }
}

/// Name of the case in a heading: its file, or that it was typed.
fn title(arguments: &CaseArguments) -> String {
    arguments.file.as_ref().map_or_else(
        || "case from --set".to_owned(),
        |file| file.display().to_string(),
    )
}

/// The built-in catalogue and what these files add to it.
pub(crate) fn catalogue(files: &[PathBuf]) -> Result<Arc<Catalogue>, Failure> {
    let mut catalogue = Catalogue::shared();
    for path in files {
        Arc::make_mut(&mut catalogue).extend_from_file(path)?;
    }
    Ok(catalogue)
}

/// The case of the arguments, with the built-in catalogue and those that they add.
pub(crate) fn case_of(arguments: &CaseArguments) -> Result<Case, Failure> {
    case_lacking(arguments, &[])
}

/// The distance of a case that states none, for a study that chooses distances itself: the tip at the
/// sample.
const ANY_DISTANCE: &str = "gap.tip=0 m";

/// The case of the arguments, which may lack the keys of the `implied` `key=value` words.
fn case_lacking(arguments: &CaseArguments, implied: &[String]) -> Result<Case, Failure> {
    let catalogue = catalogue(&arguments.catalogue)?;
    let mut set = arguments.set.clone();
    let mut loaded = Case::load(arguments.file.as_deref(), &set, &catalogue);
    for word in implied {
        let Err(error) = &loaded else { break };
        let name = word.split('=').next().unwrap_or_default();
        if error.missing() != Some(name) {
            continue;
        }
        set.push(word.clone());
        loaded = Case::load(arguments.file.as_deref(), &set, &catalogue);
    }
    let case = loaded?;
    let case = case.cancelled_by(&progress::control());
    let case = case.called(&title(arguments));
    Ok(case.in_model_units(arguments.model_units))
}
