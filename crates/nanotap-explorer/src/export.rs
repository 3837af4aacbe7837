//! Files to save: the case, the time series of the motion, its figures.

use std::sync::PoisonError;

use nanotap::case::Case;
use nanotap::case::units::Units;
use nanotap::control::Control;
use nanotap::model::Model;
use nanotap::number::shortest;
use nanotap::observe::time_series;
use serde::Deserialize;

use crate::Explorer;
use crate::api_error::ApiError;
use crate::figures::{picture, viewed};
use crate::motion::Motion;
use crate::motion_request::{MotionRequest, Start, model_of};

/// Samples per drive period in the time series, as at the terminal.
const RESOLUTION: usize = 200;

/// What is to be saved, and in which format.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wish {
    #[serde(flatten)]
    asked: MotionRequest,
    /// Name of one of the motion's figures.
    #[serde(default)]
    figure: String,
    format: String,
}

/// The case file of what the page shows; empty before the first motion.
pub(crate) fn shown(app: &Explorer) -> Result<String, ApiError> {
    let shown = app.shown.lock().unwrap_or_else(PoisonError::into_inner);
    let case = shown.as_ref().map(|case| case.any_distance(app));
    let case = case.transpose()?;
    Ok(case.as_ref().map(Case::to_toml).unwrap_or_default())
}

/// The file that is to be saved.
pub(crate) fn exported(
    app: &Explorer,
    wish: &Wish,
    control: &Control<'_>,
) -> Result<(&'static str, Vec<u8>), ApiError> {
    let asked = &wish.asked;
    if wish.format == "toml" {
        let case = asked.case.any_distance(app)?;
        return Ok(("application/toml", case.to_toml().into_bytes()));
    }
    let case = asked.case.case(app, control)?;
    let model = model_of(&case)?;
    let motion = Motion::find(&model, &Start::parse(&asked.start)?)?;
    if wish.format == "csv" {
        return Ok((
            "text/csv",
            csv(&model, &motion, &case.units())?.into_bytes(),
        ));
    }
    let figure = match wish.figure.as_str() {
        "contact" => motion.contact_figure(&model, &case),
        _ => motion.figure(&model, &case),
    };
    let place = if wish.figure == "contact" {
        "contact"
    } else {
        "portrait"
    };
    let figure = match asked.views.get(place) {
        Some(views) => viewed(figure, views),
        None => figure,
    };
    picture(&figure, &wish.format)
}

/// The time series of one repetition, as the terminal writes it.
fn csv(model: &Model, motion: &Motion, units: &Units) -> Result<String, ApiError> {
    let mut text = time_series::heads(model, units).join(",");
    text.push('\n');
    time_series::sample(model, motion.state(), motion.periods(), RESOLUTION, |row| {
        let cells: Vec<String> = time_series::scaled(row, units).map(shortest).collect();
        text.push_str(&cells.join(","));
        text.push('\n');
    })
    .map_err(ApiError::of)?;
    Ok(text)
}
