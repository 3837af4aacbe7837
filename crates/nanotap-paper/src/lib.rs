//! Reproduction of the paper: every figure 2e–17 and every number in its text, with the paper's
//! statement, the result of this program, a verdict, the evidence, and a command that reproduces
//! it.
//!
//! "Multi-modal analysis on the intermittent contact dynamics of atomic force microscope", J. Sound
//! Vib. (2011). No parameter is adjusted to improve the agreement: each case is the printed one,
//! and where the paper contradicts itself every reading is computed.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

mod attractors;
mod bare_tip;
mod bifurcation_diagram;
mod check;
mod clearance;
mod convergence_study;
mod damped_limit;
mod equations;
mod expected;
mod fast_drive;
mod followed_branch;
mod frequencies;
mod frequency_sweep;
mod html;
mod impact;
mod markdown;
mod motion_view;
mod rerun;
mod runs;
mod section;
mod slow_drive;
mod statements;
mod time_step;
mod write;

use nanotap_dynamics::Control;

use nanotap::case::CaseError;
use nanotap::case::near_name::near_name;

pub use check::{About, Check, Verdict};
use runs::Runs;
pub use section::{Picture, Section, Table};
use statements::{TOPICS, Topic};
pub use write::{Document, Written};

/// Options of the report: its sections and the effort.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Names of the requested sections; empty: all.
    pub only: Vec<String>,
    /// Fewer initial states and parameter values: seconds instead of minutes, with wider bounds.
    pub quick: bool,
}

/// The reason why the report could not be computed.
#[derive(Debug, thiserror::Error)]
pub enum PaperError {
    /// An unknown section was requested.
    #[error("no section `{given}`{hint}; the sections are {known}")]
    UnknownSection {
        /// Name of the section as requested.
        given: String,
        /// The most similar name, as a question.
        hint: String,
        /// Names of all sections, as text.
        known: String,
    },
    /// The computation was cancelled before the report was finished.
    #[error("stopped before the report was finished")]
    Cancelled,
    /// A case of the paper is invalid.
    #[error(transparent)]
    Model(#[from] CaseError),
    /// A computation that should succeed failed, or a picture could not be drawn.
    #[error("{what}: {why}")]
    Failed {
        /// Name of the computation or picture that failed.
        what: String,
        /// Error of the computation, as text.
        why: String,
    },
    /// A file could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// Path of the file that could not be written.
        path: std::path::PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
}

impl PaperError {
    /// The conversion of an error of the computation or picture that `what` names.
    fn failed<E: ToString>(what: impl Into<String>) -> impl Fn(E) -> PaperError {
        let what = what.into();
        move |error| PaperError::Failed {
            what: what.clone(),
            why: error.to_string(),
        }
    }
}

impl From<nanotap::model::ModelError> for PaperError {
    fn from(error: nanotap::model::ModelError) -> Self {
        Self::Model(error.into())
    }
}

/// The report: the computed sections with their checks.
#[derive(Clone, Debug)]
pub struct Report {
    /// Its sections, in the order of the paper.
    pub sections: Vec<Section>,
    /// Whether it was computed with [`Options::quick`].
    pub quick: bool,
}

impl Report {
    /// Returns every check of every section.
    pub fn checks(&self) -> impl Iterator<Item = &Check> {
        self.sections.iter().flat_map(|section| &section.checks)
    }

    /// Number of statements about `about` that differ.
    pub fn differing(&self, about: About) -> usize {
        self.checks()
            .filter(|c| c.verdict == Verdict::Differs && c.about == about)
            .count()
    }

    /// The counts as text; misprints and differences in the motion are counted separately.
    pub fn counts(&self) -> String {
        format!(
            "{} reproduced, {} ambiguous, {} differ ({} in print, {} in the motion)",
            self.count(Verdict::Reproduced),
            self.count(Verdict::Ambiguous),
            self.count(Verdict::Differs),
            self.differing(About::Print),
            self.differing(About::Motion),
        )
    }

    /// Number of checks with the verdict `verdict`.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.checks().filter(|c| c.verdict == verdict).count()
    }
}

/// Computes the report. Progress is reported in percent of the whole.
///
/// # Errors
/// If an unknown section is requested, the computation is cancelled, or a computation fails that
/// should not.
pub fn report(options: &Options, control: &Control<'_>) -> Result<Report, PaperError> {
    match report_so_far(options, control)? {
        (report, true) => Ok(report),
        (_, false) => Err(PaperError::Cancelled),
    }
}

/// The report of the sections that were finished before the computation was cancelled, and whether
/// they are all.
///
/// # Errors
/// As [`report`], except for the cancellation.
pub fn report_so_far(
    options: &Options,
    control: &Control<'_>,
) -> Result<(Report, bool), PaperError> {
    let topics = chosen(&options.only)?;
    let whole: u32 = topics.iter().map(|topic| topic.weight).sum();
    let runs = Runs::new(options.quick, control);
    let mut sections = Vec::with_capacity(topics.len());
    let mut begun = 0;
    let mut all = true;
    for topic in topics {
        let share = |weight: u32| f64::from(weight) / f64::from(whole);
        runs.begin(share(begun), share(topic.weight));
        let made = (topic.make)(&runs, Section::new(topic.id, topic.title));
        // A section that was cancelled is incomplete.
        if control.is_cancelled() {
            all = false;
            break;
        }
        sections.push(made?.with_checks(topic.statements)?);
        begun += topic.weight;
    }
    let quick = options.quick;
    Ok((Report { sections, quick }, all))
}

/// Returns the names of all sections, in the order of the paper.
pub fn section_names() -> impl Iterator<Item = &'static str> {
    TOPICS.iter().map(|topic| topic.id)
}

/// Whether `given` names this topic or one of its checks (`fig8-amplitude` belongs to `fig8`).
fn names(given: &str, topic: &Topic) -> bool {
    let given = given.to_lowercase();
    given
        .strip_prefix(topic.id)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
}

/// The topics named in `only`, in the order of the paper; all if it is empty.
fn chosen(only: &[String]) -> Result<Vec<&'static Topic>, PaperError> {
    if only.is_empty() {
        return Ok(TOPICS.iter().collect());
    }
    for given in only {
        if TOPICS.iter().any(|topic| names(given, topic)) {
            continue;
        }
        let known: Vec<&str> = section_names().collect();
        let hint = near_name(given, known.iter().copied())
            .map_or_else(String::new, |id| format!(" (did you mean `{id}`?)"));
        return Err(PaperError::UnknownSection {
            given: given.clone(),
            hint,
            known: section_names().collect::<Vec<_>>().join(", "),
        });
    }
    let wanted = |topic: &&Topic| only.iter().any(|given| names(given, topic));
    Ok(TOPICS.iter().filter(wanted).collect())
}

impl From<PaperError> for nanotap::Error {
    fn from(error: PaperError) -> Self {
        match error {
            PaperError::UnknownSection { .. } => {
                Self::new(nanotap::ErrorKind::BadInput, error.to_string()).at("only")
            }
            PaperError::Cancelled => Self::new(nanotap::ErrorKind::Stopped, error.to_string()),
            PaperError::Model(error) => error.into(),
            other => Self::numerics(other.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_have_names_of_their_own() {
        let names: std::collections::BTreeSet<_> = section_names().collect();
        assert_eq!(names.len(), TOPICS.len());
    }

    #[test]
    fn statements_have_names_of_their_own_that_begin_with_the_section() {
        let mut ids = std::collections::BTreeSet::new();
        for topic in TOPICS {
            for statement in topic.statements {
                assert!(names(statement.id, topic), "{}", statement.id);
                assert!(ids.insert(statement.id), "{}", statement.id);
            }
        }
    }

    #[test]
    fn unknown_sections_are_refused_with_the_nearest() {
        let error = chosen(&["fgi4".to_owned()]).err().unwrap().to_string();
        assert!(
            error.contains("`fgi4`") && error.contains("did you mean `fig4`?"),
            "{error}"
        );
        let some = chosen(&["FIG17".to_owned(), "eq7".to_owned()]).unwrap();
        assert_eq!(
            some.iter().map(|t| t.id).collect::<Vec<_>>(),
            ["eq7", "fig17"]
        );
        let of_check = chosen(&["fig8-amplitude".to_owned()]).unwrap();
        assert_eq!(of_check.iter().map(|t| t.id).collect::<Vec<_>>(), ["fig8"]);
    }

    /// Results for the paper that follow from the equations themselves.
    #[test]
    fn quick_sections_say_what_is_known() {
        let only = ["eq7", "eq23", "eq25", "alpha4", "fig2e", "fig3", "fig17"];
        let options = Options {
            only: only.map(str::to_owned).to_vec(),
            quick: true,
        };
        let report = report(&options, &Control::default()).unwrap();
        assert_eq!(report.sections.len(), only.len());
        let verdict = |id: &str| report.checks().find(|c| c.id == id).unwrap().verdict;
        assert_eq!(verdict("eq7"), Verdict::Differs);
        assert_eq!(verdict("eq23"), Verdict::Reproduced);
        // 7.79, 20.33, 55.81 are the values for five modes.
        assert_eq!(verdict("eq25"), Verdict::Reproduced);
        assert_eq!(verdict("alpha4-samples"), Verdict::Differs);
        // One period-4 orbit is stable at Ω = 20, α1 = 0; its saddle partner is not.
        assert_eq!(verdict("fig17"), Verdict::Ambiguous);
        for check in report.checks() {
            assert!(!check.evidence.is_empty(), "{}", check.id);
            assert!(check.rerun.starts_with("nanotap "), "{}", check.id);
        }
    }

    #[test]
    fn work_that_was_stopped_gives_no_report() {
        let stop = nanotap::control::CancelFlag::new();
        stop.cancel();
        let control = Control {
            cancel: Some(&stop),
            progress: None,
        };
        assert!(matches!(
            report(
                &Options {
                    quick: true,
                    ..Options::default()
                },
                &control
            ),
            Err(PaperError::Cancelled)
        ));
    }
}
