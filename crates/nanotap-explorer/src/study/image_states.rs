//! The states of a measured image.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use nanotap::case::Case;
use nanotap::case::quantity::Kind;
use nanotap::dataset::gsf::Field;
use nanotap::figure::image_states::image_states_figure;
use nanotap::observe::table::shown_phase;
use nanotap::study::image_states::{
    ImageData, ImageStatesOptions, ImageStatesReport, ImageStatesStudy, Sense,
};
use nanotap::study::registry::Study as _;
use nanotap::study::request::{read, schema};
use serde_json::{Map, Value, json};

use super::{Stage, Studied};
use crate::api_error::ApiError;
use crate::forms;

/// The option of measured data that requests the states of an image, and its form.
pub(super) const IMAGE: &str = ImageStatesStudy::NAME;
/// Most pixels of which a table is sent.
const MAX_ROWS: usize = 1 << 18;
/// Most steps that are shown.
const MAX_STEPS: usize = 20;

impl Studied<'_> {
    /// The form of images, with the reason why their states are not known yet.
    pub(super) fn waiting_image(&self, reason: ApiError) -> Result<(), ApiError> {
        if reason.outcome() == crate::Outcome::Stopped {
            return Err(reason);
        }
        self.hand(Stage {
            words: reason.message(),
            form: Some(IMAGE),
            ..Stage::default()
        })
    }

    /// The state of each pixel of the images in a file, and their heights without what the lever adds.
    pub(super) fn states_of_image(
        &self,
        case: &Case,
        name: &str,
        data: ImageData,
    ) -> Result<(), ApiError> {
        // The form is another one until the page knows that the file has images.
        let named = match self.field(IMAGE) {
            Ok(forms::YES) => self.options_of(&schema::<ImageStatesOptions>()),
            _ => Map::new(),
        };
        let options = ImageStatesOptions {
            data,
            ..read(Value::Object(named.clone()))?
        };
        let found = self.counting(ImageStatesStudy::COUNTED, |control| {
            ImageStatesStudy::run(case, &options, control)
        })?;
        let mut on_command = named;
        on_command.insert("data".into(), json!([name]));
        self.hand(Stage {
            figure: Some(image_states_figure(&found)),
            words: String::new(),
            studies: &[(IMAGE, &on_command)],
            form: Some(IMAGE),
            image: Some(image(name, &found)),
            ..Stage::default()
        })
    }
}

/// A number with its text.
fn shown(kind: Kind, value: Option<f64>) -> Value {
    value.map_or(
        Value::Null,
        |value| json!({ "value": value, "shown": kind.format_digits(value, 4) }),
    )
}

/// What the page shows of an image, and its files.
fn image(name: &str, found: &ImageStatesReport) -> Value {
    let degrees = |phase: f64| json!({ "value": phase, "shown": format!("{phase:.1}°") });
    let states: Vec<Value> = (found.states.iter())
        .map(|state| {
            json!({
                "name": state.name,
                "phase": degrees(shown_phase(state.phase)),
                "measured_phase": state.measured_phase.map(degrees),
                "distance": shown(Kind::Length, state.distance),
                "height": shown(Kind::Length, state.height),
                "force": shown(Kind::Force, state.peak_force),
                "share": state.share,
            })
        })
        .collect();
    let steps: Vec<Value> = (found.steps.iter().take(MAX_STEPS))
        .map(|step| {
            json!({
                "line": step.line,
                "pixel": step.pixel,
                "x": shown(Kind::Length, step.x),
                "from": step.from,
                "to": step.to,
                "height": shown(Kind::Length, Some(step.height)),
                "measured": shown(Kind::Length, step.measured),
            })
        })
        .collect();
    let pixels = (found.shape[0] * found.shape[1]).max(1);
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let mut files = Vec::new();
    if pixels <= MAX_ROWS {
        let table = found.pixel_table().csv();
        files
            .push(json!({ "name": format!("{stem}-states.csv"), "kind": "pixels", "text": table }));
    }
    if let Some(bytes) = corrected(found) {
        let name = format!("{stem}-corrected.gsf");
        files.push(json!({ "name": name, "kind": "corrected", "base64": STANDARD.encode(bytes) }));
    }
    json!({
        "decided": found.decided,
        "reason": found.reason,
        "warnings": found.warnings,
        "channels": [found.height_channel, found.amplitude_channel, found.phase_channel],
        "setpoint": shown(Kind::Length, Some(found.setpoint_amplitude)),
        "free": shown(Kind::Length, Some(found.free_amplitude)),
        "phase_offset": found.phase_offset.map(degrees),
        "sense": found.sense.map(Sense::name),
        "reference": found.reference,
        "states": states,
        "undecided": found.undecided as f64 / pixels as f64,
        "step_count": found.step_count,
        "steps": steps,
        "files": files,
    })
}

/// The corrected heights as a Gwyddion Simple Field, where the size of the image is known.
fn corrected(found: &ImageStatesReport) -> Option<Vec<u8>> {
    let rows = found.images.corrected.as_ref()?;
    let middles = |side: usize| -> Option<Vec<f64>> {
        let step = found.size?[side] / found.shape[side] as f64;
        Some(
            (0..found.shape[side])
                .map(|k| (k as f64 + 0.5) * step)
                .collect(),
        )
    };
    let field = Field {
        title: "corrected height".to_owned(),
        x: middles(0)?,
        y: middles(1)?,
        // The line of the smallest y comes first.
        values: rows.iter().rev().flatten().copied().collect(),
        axis_unit: "m".to_owned(),
        value_unit: "m".to_owned(),
    };
    field.to_gsf().ok()
}
