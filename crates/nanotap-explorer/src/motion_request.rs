//! A motion as requested by the page, and its model.

use nanotap::case::Case;
use nanotap::model::Model;
use nanotap::study::orbit::OrbitOptions;
use nanotap::study::request::read;
use serde::Deserialize;
use serde_json::json;

use crate::api_error::ApiError;
use crate::figures::Views;
use crate::preset::CaseSpec;

/// Largest number of characters of a state in a message.
const SHOWN: usize = 100;
/// Largest number of modes of a motion that follows a slider.
const MAX_MODES: usize = 20;

/// A motion as requested by the page.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MotionRequest {
    pub(crate) case: CaseSpec,
    /// Initial state in the model's units; empty: rest; `n:state`: an orbit of period n near the state.
    #[serde(default)]
    pub(crate) start: String,
    /// The case of the motion that starts at `start`, which is followed from there to `case`.
    #[serde(default)]
    pub(crate) from: Option<CaseSpec>,
    /// Whether the ranges of the sliders are requested.
    #[serde(default)]
    pub(crate) ranges: bool,
    /// Runge–Kutta steps per period of the motion for comparison; 0: none.
    #[serde(default)]
    pub(crate) steps: u32,
    /// Visible ranges of the figures.
    #[serde(default)]
    pub(crate) views: Views,
}

/// Initial state of a motion, or guess for an orbit.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Start {
    pub(crate) period: Option<usize>,
    pub(crate) state: Option<Vec<f64>>,
}

impl Start {
    pub(crate) fn parse(text: &str) -> Result<Self, ApiError> {
        if text.is_empty() {
            return Ok(Self::default());
        }
        let (period, state) = match text.split_once(':') {
            Some((period, state)) => (Some(period), state),
            None => (None, text),
        };
        let wrong = || {
            let words: String = text.chars().take(SHOWN).collect();
            let message = format!("`{words}` is not a state");
            ApiError::input(message, "numbers are needed, as in 0.1,-0.02,0.3").about("start")
        };
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
        let numbers = state.split(',').map(number).collect::<Option<Vec<f64>>>();
        let period = period.map(|period| period.trim().parse::<u64>().map_err(|_| wrong()));
        // The terminal's option, with its limits.
        let options = json!({ "period": period.transpose()? });
        let options: OrbitOptions = read(options).map_err(|e| ApiError::of(e).about("start"))?;
        Ok(Self {
            period: options.period,
            state: Some(numbers.ok_or_else(wrong)?),
        })
    }

    /// The text that [`parse`](Self::parse) reads.
    pub(crate) fn text(period: Option<usize>, state: &[f64]) -> String {
        let numbers: Vec<String> = state.iter().map(ToString::to_string).collect();
        let prefix = period.map_or_else(String::new, |n| format!("{n}:"));
        prefix + &numbers.join(",")
    }
}

/// The model of a case that is small enough to follow a slider.
pub(crate) fn model_of(case: &Case) -> Result<Model, ApiError> {
    if let Some(cantilever) = case.cantilever()
        && cantilever.modes > MAX_MODES
    {
        return Err(ApiError::input(
            format!(
                "expected at most {MAX_MODES} modes, got {}",
                cantilever.modes
            ),
            "the terminal computes more",
        )
        .about("modes"));
    }
    Ok(case.model()?)
}
