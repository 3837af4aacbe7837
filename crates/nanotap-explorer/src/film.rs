//! The film of a motion: heights of the beam, of the tip's apex and of the sample's surface.

use nanotap::case::Case;
use nanotap::case::quantity::Kind;
use nanotap::model::Model;
use nanotap::observe::time_series;
use serde::Serialize;

use crate::api_error::ApiError;

/// Number of instants per drive period at which the film has a picture.
const INSTANTS: usize = 90;
/// Number of points along the beam.
const ALONG: usize = 33;
/// Length of the drawn tip, relative to the range of heights.
const TIP: f64 = 0.18;
/// Steps in the range of heights, more than a screen has pixels.
const STEPS: f64 = 5000.0;

/// The data that the page draws, instant by instant. Heights are above the undeformed sample, in
/// the model's unit of length; the beam is lifted by the length of the drawn tip.
#[derive(Debug, Serialize)]
pub(crate) struct Film {
    /// Number of drive periods before the film repeats.
    periods: usize,
    /// Step of the whole numbers below, in the model's unit of length.
    step: f64,
    /// Heights along the beam, clamp to free end; for an oscillator its mass, a constant.
    beam: Vec<Vec<i32>>,
    apex: Vec<i32>,
    surface: Vec<i32>,
    contact: Vec<u8>,
    /// Smallest and largest height, in the model's unit of length.
    range: [f64; 2],
    /// Height of the undeflected beam, in the model's unit of length.
    rest: f64,
    /// Text on the scale of heights.
    scale: String,
    /// Whether there is a beam.
    is_beam: bool,
}

/// The film of `periods` drive periods from `start` at drive phase 0.
pub(crate) fn film(
    case: &Case,
    model: &Model,
    start: &[f64],
    periods: usize,
) -> Result<Film, ApiError> {
    let is_beam = model.beam.is_some();
    let modes = model.beam.as_ref().map_or(0, |beam| beam.modes.count());
    let shapes = shapes(model);
    let (mut beam, mut apex, mut surface, mut contact) = (vec![], vec![], vec![], vec![]);
    let (mut low, mut high) = (0.0_f64, f64::NEG_INFINITY);
    let mut base = (0.0, 0.0);
    time_series::sample(model, start, periods, INSTANTS, |row| {
        let [_, tip, _, height, _, touching, state @ ..] = row else {
            return;
        };
        // Height of the base, from the tip's height above the sample.
        let clamp = if is_beam { height - tip } else { *height };
        let heights: Vec<f64> = shapes
            .iter()
            .map(|shape| clamp + shape.iter().zip(state).map(|(s, a)| s * a).sum::<f64>())
            .collect();
        let touching = *touching > 0.0;
        let memory = state.get(2 * modes).filter(|_| model.memory > 0);
        let dent = if touching {
            height.min(0.0)
        } else {
            memory.map_or(0.0, |s| s.min(0.0))
        };
        for value in heights.iter().chain([height, &dent]) {
            low = low.min(*value);
            high = high.max(*value);
        }
        base = (base.0 + clamp, base.1 + 1.0);
        beam.push(heights);
        apex.push(*height);
        surface.push(dent);
        contact.push(u8::from(touching));
    })
    .map_err(ApiError::of)?;
    // The last instant equals the first one.
    beam.truncate(periods * INSTANTS);
    let tip = TIP * (high - low).max(f64::MIN_POSITIVE);
    let height = high - low;
    let step = (height + tip) / STEPS;
    let whole = |height: f64| (height / step).round() as i32;
    let scale = match case.units().si(Kind::Length) {
        Some(metres) => Kind::Length.format_digits(metres * height, 3),
        None => format!("{} g0", Kind::Number.format_digits(height, 3)),
    };
    Ok(Film {
        periods,
        beam: beam
            .into_iter()
            .map(|heights| heights.into_iter().map(|h| whole(h + tip)).collect())
            .collect(),
        apex: apex.into_iter().map(whole).collect(),
        surface: surface.into_iter().map(whole).collect(),
        step,
        contact,
        range: [low, high + tip],
        rest: base.0 / f64::max(base.1, 1.0) + tip,
        scale,
        is_beam,
    })
}

/// φ_1 … φ_N at points along the beam; empty for an oscillator.
fn shapes(model: &Model) -> Vec<Vec<f64>> {
    let at = |k: usize| match &model.beam {
        None => Vec::new(),
        Some(beam) => {
            let shapes = beam.modes.shapes(k as f64 / (ALONG - 1) as f64);
            shapes.as_slice().to_vec()
        }
    };
    (0..ALONG).map(at).collect()
}
