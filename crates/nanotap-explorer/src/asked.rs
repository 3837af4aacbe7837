//! A motion as the page asks for it, and the model that it needs.

use nanotap::case::Case;
use nanotap::model::Model;
use serde::Deserialize;

use crate::answer::Refusal;
use crate::figures::Views;
use crate::preset::Wanted;

/// Most modes of a motion that follows a dragged knob.
const MOST_MODES: usize = 20;

/// A motion as the page asks for it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Asked {
    pub(crate) case: Wanted,
    /// Empty: from rest; else a state, or `n:state` for an orbit of period n near it.
    #[serde(default)]
    pub(crate) start: String,
    /// Runge–Kutta steps a period of the motion beside it; 0: none.
    #[serde(default)]
    pub(crate) steps: u32,
    /// Which parts of the figures are to be seen.
    #[serde(default)]
    pub(crate) views: Views,
}

/// Where a motion is looked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Start {
    pub(crate) period: Option<usize>,
    pub(crate) state: Option<Vec<f64>>,
}

impl Start {
    pub(crate) fn parse(text: &str) -> Result<Self, Refusal> {
        if text.is_empty() {
            return Ok(Self::default());
        }
        let (period, state) = match text.split_once(':') {
            Some((period, state)) => (Some(period), state),
            None => (None, text),
        };
        let wrong = || {
            Refusal::input(
                format!("`{text}` is no state"),
                "numbers are needed, as in 0.1,-0.02,0.3",
            )
        };
        Ok(Self {
            period: period.map(|p| p.parse().map_err(|_| wrong())).transpose()?,
            state: Some(
                state
                    .split(',')
                    .map(|number| number.trim().parse().map_err(|_| wrong()))
                    .collect::<Result<_, _>>()?,
            ),
        })
    }

    /// The text that [`parse`](Self::parse) reads.
    pub(crate) fn text(period: Option<usize>, state: &[f64]) -> String {
        let numbers: Vec<String> = state.iter().map(ToString::to_string).collect();
        let prefix = period.map_or_else(String::new, |n| format!("{n}:"));
        prefix + &numbers.join(",")
    }
}

/// The model of a case that is small enough to follow a dragged knob.
pub(crate) fn model_of(case: &Case) -> Result<Model, Refusal> {
    if let Some(cantilever) = case.cantilever()
        && cantilever.modes > MOST_MODES
    {
        return Err(Refusal::input(
            format!("modes = {} are too many for the explorer", cantilever.modes),
            format!("{MOST_MODES} at most; the terminal takes more"),
        ));
    }
    case.model().map_err(Refusal::of)
}
