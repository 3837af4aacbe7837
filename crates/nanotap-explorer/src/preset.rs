//! The cases that the page offers: the given one, the paper's, the worked ones.

use std::sync::{Arc, OnceLock, PoisonError};

use nanotap::case::file::Source;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::study::setpoint::at_setpoint;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::Explorer;
use crate::api_error::{ApiError, key_of};
use crate::commands::CASE_FILE;
use crate::forms;

/// A case to start from.
#[derive(Clone, Debug)]
pub(crate) struct Preset {
    pub(crate) name: String,
    pub(crate) words: String,
    pub(crate) text: String,
    /// Changes to the text, `key=value`.
    pub(crate) set: Vec<String>,
    /// The path for commands; empty for a built-in case.
    pub(crate) path: String,
    /// The case at its setpoint, once it was requested.
    pub(crate) solved: OnceLock<Case>,
}

/// Name of a case that is given.
const FILE: &str = "file";

impl Preset {
    fn of(name: &str, source: Source, set: Vec<String>) -> Self {
        Self {
            name: name.into(),
            words: source.name,
            text: source.text,
            set,
            path: String::new(),
            solved: OnceLock::new(),
        }
    }

    pub(crate) fn source(&self) -> Source {
        Source {
            name: self.words.clone(),
            text: self.text.clone(),
        }
    }
}

/// The built-in cases: name, description, text, changes.
const BUILT_IN: [(&str, &str, &str, &[&str]); 14] = [
    (
        "dmt",
        "DMT forces, in air",
        include_str!("../cases/dforce-dmt.toml"),
        &[],
    ),
    (
        "bistable",
        "Two states in attraction and repulsion",
        include_str!("../cases/bistable-lever.toml"),
        &[],
    ),
    (
        "stiff-lever",
        "NCHR-class lever: two branches",
        include_str!("../cases/stiff-lever.toml"),
        &[],
    ),
    (
        "fm-lever",
        "FM-class lever on polystyrene",
        include_str!("../cases/fm-polystyrene.toml"),
        &[],
    ),
    (
        "two-modes",
        "Two modes of a lever",
        include_str!("../cases/two-modes.toml"),
        &[],
    ),
    (
        "hertz",
        "Hertz contact, in air",
        include_str!("../cases/dforce-hertz.toml"),
        &[],
    ),
    (
        "soft-sample",
        "Lever on a soft sample",
        include_str!("../cases/soft-sample.toml"),
        &[],
    ),
    (
        "capillary",
        "A capillary bridge",
        include_str!("../cases/capillary-bridge.toml"),
        &[],
    ),
    (
        "liquid",
        "Kelvin–Voigt sample in a liquid",
        include_str!("../cases/liquid-kelvin-voigt.toml"),
        &[],
    ),
    (
        "patch",
        "Flat sample with a patch: a false step",
        include_str!("../cases/scan-patch.toml"),
        &[],
    ),
    (
        "paper",
        "The paper's case at Ω = 3",
        include_str!("../cases/paper.toml"),
        &["omega=3"],
    ),
    (
        "paper-chaos",
        "The paper's case at Ω = 2.6: chaos",
        include_str!("../cases/paper.toml"),
        &["omega=2.6"],
    ),
    (
        "paper-fast",
        "No tip mass at Ω = 20: periods 1 and 4",
        include_str!("../cases/paper.toml"),
        &["omega=20", "alpha1=0"],
    ),
    (
        "impact",
        "Impact oscillator with a rigid stop",
        "[model]\nkind = \"impact\"\nstiffness = 1.0\ndamping = 0.1\nforcing = 1.0\nomega = 2.8\ngap = 0.0\nrestitution = 0.8\n",
        &[],
    ),
];

/// Every preset; the given case, with its changes, comes first.
pub(crate) fn all(
    given: Option<(Source, Vec<String>)>,
) -> Result<Vec<Arc<Preset>>, nanotap::Error> {
    let mut presets = Vec::new();
    if let Some((source, set)) = given {
        Case::parse(Some(source.clone()), &set)?;
        presets.push(Arc::new(Preset {
            path: source.name.clone(),
            ..Preset::of(FILE, source, set)
        }));
    }
    presets.extend(BUILT_IN.iter().map(|(name, words, text, set)| {
        let source = Source {
            name: (*words).into(),
            text: (*text).into(),
        };
        let set = set.iter().map(|word| (*word).to_owned()).collect();
        Arc::new(Preset::of(name, source, set))
    }));
    Ok(presets)
}

/// A case as requested by the page.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CaseSpec {
    #[serde(default)]
    preset: String,
    /// The text of a case file, in place of a preset.
    #[serde(default)]
    text: Option<String>,
    #[serde(default)]
    set: Vec<String>,
}

impl CaseSpec {
    pub(crate) fn preset(&self, app: &Explorer) -> Result<Arc<Preset>, ApiError> {
        if let Some(text) = &self.text {
            // The most recent one is kept: its setpoint may have been solved for.
            let mut given = app.given.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(preset) = given.as_ref().filter(|preset| preset.text == *text) {
                return Ok(Arc::clone(preset));
            }
            let source = Source {
                name: CASE_FILE.into(),
                text: text.clone(),
            };
            Case::parse(Some(source.clone()), &[])?;
            let preset = Arc::new(Preset::of(FILE, source, Vec::new()));
            *given = Some(Arc::clone(&preset));
            return Ok(preset);
        }
        app.presets
            .iter()
            .find(|preset| preset.name == self.preset)
            .cloned()
            .ok_or_else(|| {
                let known: Vec<&str> = app.presets.iter().map(|p| p.name.as_str()).collect();
                ApiError::input(
                    format!("no case called `{}`", self.preset),
                    format!("there are {}", known.join(", ")),
                )
            })
    }

    /// Whether it is the given file, without changes.
    pub(crate) fn is_a_file(&self, app: &Explorer) -> Result<bool, ApiError> {
        let preset = self.preset(app)?;
        Ok(!preset.path.is_empty() && self.words(&preset).is_empty())
    }

    /// The changes to the preset's text, each key once.
    pub(crate) fn words(&self, preset: &Preset) -> Vec<String> {
        // A word replaces those of the preset about its key and about what says the same.
        let replaces = |later: &String, word: &String| {
            let same = Key::find(key_of(later)).is_some_and(|key| {
                let mut others = key.alternatives();
                others.any(|(other, _)| other.path() == key_of(word))
            });
            same && !later.trim_end().ends_with('=') || key_of(later) == key_of(word)
        };
        let kept = |word: &&String| !self.set.iter().any(|later| replaces(later, word));
        let mut words: Vec<String> = preset.set.iter().filter(kept).cloned().collect();
        words.extend(self.set.iter().cloned());
        words
    }

    /// The case, checked as at the terminal, without solving for the distance of a setpoint.
    pub(crate) fn any_distance(&self, app: &Explorer) -> Result<Case, ApiError> {
        let preset = self.preset(app)?;
        let case = Case::parse(Some(preset.source()), &self.words(&preset))?;
        let changes: Vec<String> = self.set.iter().map(|word| changed(word)).collect();
        Ok(if changes.is_empty() {
            case.called(&preset.words)
        } else {
            case.called(&format!("{}, with {}", preset.words, changes.join(", ")))
        })
    }

    /// The case at its setpoint; its motions end once `control` cancels the work.
    pub(crate) fn case(&self, app: &Explorer, control: &Control<'_>) -> Result<Case, ApiError> {
        Ok(self.at_setpoint(app, control)?.cancelled_by(control))
    }

    fn at_setpoint(&self, app: &Explorer, control: &Control<'_>) -> Result<Case, ApiError> {
        let solved = at_setpoint(self.any_distance(app)?, control);
        let about = |error: nanotap::Error| ApiError::of(error).about(Key::DriveSetpoint.path());
        Ok(solved.map_err(about)?.0)
    }

    /// The same preset with other changes.
    pub(crate) fn with_set(&self, set: Vec<String>) -> Self {
        Self {
            set,
            ..self.clone()
        }
    }

    /// States a value in place of all that says the same.
    pub(crate) fn put(&mut self, key: Key, text: &str) {
        let same: Vec<&str> = key.alternatives().map(|(other, _)| other.path()).collect();
        let says = |word: &String| key_of(word) == key.path() || same.contains(&key_of(word));
        self.set.retain(|word| !says(word));
        self.set.push(format!("{}={text}", key.path()));
    }

    /// States a text for a key in place of what was stated for it; an empty one removes the key.
    pub(crate) fn replace(&mut self, key: &str, text: &str) {
        self.set.retain(|word| key_of(word) != key);
        self.set.push(format!("{key}={text}"));
    }

    /// The case with one more change, if it has a model.
    pub(crate) fn with_word(&self, app: &Explorer, word: String) -> Option<Case> {
        let preset = self.preset(app).ok()?;
        let mut changed = self.clone();
        changed.set.retain(|other| key_of(other) != key_of(&word));
        changed.set.push(word);
        let case = Case::parse(Some(preset.source()), &changed.words(&preset)).ok()?;
        case.model().is_ok().then_some(case)
    }

    /// The case of the preset, without changes; its motions end once `control` cancels the work.
    pub(crate) fn base(&self, app: &Explorer, control: &Control<'_>) -> Result<Case, ApiError> {
        let preset = self.preset(app)?;
        let solved = &preset.solved;
        if let Some(case) = solved.get() {
            return Ok(case.cancelled_by(control));
        }
        let unchanged = self.with_set(Vec::new());
        // Other requests share it: it does not carry what cancels this one.
        let case = unchanged.at_setpoint(app, control)?;
        Ok(solved.get_or_init(|| case).cancelled_by(control))
    }
}

/// `omega = 3` for `omega=3`.
fn changed(word: &str) -> String {
    match word.split_once('=') {
        Some((key, value)) if value.trim().is_empty() => format!("no {}", key.trim()),
        // Rows are not words of a title.
        Some((key, value)) if value.trim().starts_with('[') => format!("{} = …", key.trim()),
        Some((key, value)) => format!("{} = {}", key.trim(), value.trim()),
        None => word.to_owned(),
    }
}

/// The data with which the page starts.
pub(crate) fn about(app: &Explorer) -> Value {
    let presets: Vec<Value> = app
        .presets
        .iter()
        .map(|preset| {
            let physical = preset.text.contains("[cantilever]");
            let group = match preset.name.as_str() {
                FILE => "Your case",
                _ if physical => "Levers",
                _ => "Numbers of the equations",
            };
            json!({ "name": preset.name, "words": preset.words, "group": group })
        })
        .collect();
    let studies: Vec<Value> = forms::plain_studies().map(forms::plain).collect();
    json!({ "version": env!("CARGO_PKG_VERSION"), "presets": presets, "studies": studies })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_read_and_its_case_file_is_the_same_case() {
        let presets = all(None).unwrap();
        assert_eq!(presets.len(), BUILT_IN.len());
        for preset in presets {
            let case = Case::parse(Some(preset.source()), &preset.set).unwrap();
            let saved = Source {
                name: "case.toml".into(),
                text: case.to_toml(),
            };
            let again = Case::parse(Some(saved), &[]).unwrap();
            let json = |case: &Case| serde_json::to_value(case).unwrap();
            assert_eq!(json(&again), json(&case), "{}", preset.name);
        }
    }
}
