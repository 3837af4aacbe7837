//! A line of an image over a surface, under feedback.

use nanotap::case::Case;
use nanotap::case::file::scan_table;
use nanotap::case::quantity::Kind;
use nanotap::figure::scan::scan_figure;
use nanotap::study::Study as _;
use nanotap::study::scan::{ScanReport, ScanStudy};
use serde_json::{Map, Value, json};

use super::{Stage, Studied, object};
use crate::api_error::ApiError;
use crate::{forms, report};

/// Largest number of heights of a drawn surface.
const MAX_DRAWN: usize = 1000;

impl Studied<'_> {
    /// A line over the surface of the form, under feedback.
    pub(super) fn image(&self) -> Result<(), ApiError> {
        let case = self.request.case.any_distance(self.app)?;
        let options = self.scan_options();
        let mut computed = options.clone();
        let surface = self.surface()?;
        computed.extend(surface.clone().unwrap_or_default());
        let scanned = self.report::<ScanStudy>(&case, &computed)?;
        self.hand(Stage {
            figure: Some(scan_figure(&scanned)),
            clicks: json!({}),
            words: verdict(&scanned),
            remarks: ScanStudy::remarks(&case, &scanned),
            studies: &[("scan", &options)],
            scan: Self::scan_table(&case, surface),
            tables: vec![report::of_frame("lines", &scanned.line_table())],
            ..Stage::default()
        })
    }

    /// The options that the form's fields set.
    pub(super) fn scan_options(&self) -> Map<String, Value> {
        let mut options = object(json!({ "lines": 1 }));
        for (field, option) in [
            ("size", "size"),
            ("rate", "line_rate"),
            ("setpoint", "setpoint"),
            ("gain", "integral_gain"),
        ] {
            if let Ok(text) = self.field(field) {
                options.insert(option.to_owned(), text.into());
            }
        }
        options
    }

    /// The table `[scan]` that the saved case needs for another surface than its own.
    pub(super) fn scan_table(case: &Case, surface: Option<Map<String, Value>>) -> Option<String> {
        let surface = surface?;
        let mut table = case.scan().cloned().unwrap_or_default();
        table.retain(|name, _| !["profile", "image"].contains(&name.as_str()));
        table.extend(surface);
        Some(scan_table(&table))
    }

    /// The surface of the form, as keys of `[scan]`; `None`: that of the case.
    pub(super) fn surface(&self) -> Result<Option<Map<String, Value>>, ApiError> {
        let [own, step, grating, particle, drawn] = forms::SURFACES;
        let chosen = self.field("surface")?;
        if chosen == own {
            return Ok(None);
        }
        let length = |field: &str| {
            let value = Kind::Length.parse(self.field(field)?);
            value
                .map_err(|error| ApiError::input(error.to_string(), "as in \"10 nm\"").about(field))
        };
        let (height, line) = (length("height")?, length("size")?);
        let text = |value: f64| Kind::Length.format_exact(value);
        let flat = json!({ "step": { "from": "0 m", "to": text(line), "height": "0 m" } });
        let feature = if chosen == forms::FLAT {
            flat
        } else if chosen == step {
            json!({ "step": { "from": text(0.25 * line), "to": text(0.65 * line), "height": text(height) } })
        } else if chosen == grating {
            json!({ "grating": { "height": text(height), "period": text(0.25 * line) } })
        } else if chosen == particle {
            json!({ "particle": { "at": text(0.5 * line), "radius": text(0.5 * height) } })
        } else if chosen == drawn {
            let numbers = self.field("profile")?.split(',').map(str::parse::<f64>);
            let parts = numbers.collect::<Result<Vec<f64>, _>>().ok();
            let parts = parts.filter(|parts| (2..=MAX_DRAWN).contains(&parts.len()));
            let parts = parts.ok_or_else(|| {
                let message = format!("expected 2 to {MAX_DRAWN} heights between 0 and 1");
                ApiError::input(message, "draw the surface").about("profile")
            })?;
            let heights: Vec<f64> = parts.iter().map(|part| part * height).collect();
            // A drawn surface has no features in addition.
            return Ok(Some(object(
                json!({ "profile": heights, "surface": [flat] }),
            )));
        } else {
            let known = forms::SURFACES.join(", ");
            return Err(ApiError::input(
                format!("expected a surface, got `{chosen}`"),
                format!("there are {known}"),
            ));
        };
        Ok(Some(object(json!({ "surface": [feature] }))))
    }
}

/// What a line shows, and the largest stable gain, in words.
pub(super) fn verdict(scanned: &ScanReport) -> String {
    let gain = scanned.feedback.as_ref();
    let gain = gain.and_then(|feedback| feedback.largest_stable_gain);
    let gain = gain.map_or_else(String::new, |gain| {
        let gain = Kind::Number.format_digits(gain, 3);
        format!(" The feedback is stable up to a gain of {gain}/s.")
    });
    format!("{}{gain}", scanned.verdict)
}
