//! Thermal calibration: a lever from its noise.

use std::fmt::Write as _;

use nanotap::case::quantity::Kind;
use nanotap::case::{Case, Key};
use nanotap::study::calibrate::{CalibrateOptions, calibrate_bytes};
use nanotap::study::request::{read, schema};
use serde_json::{Map, Value};

use super::{NextStep, Stage, Studied, object};
use crate::api_error::ApiError;
use crate::choice::is_at_resonance;
use crate::commands::quoted;
use crate::forms;
use crate::report;

/// The option of measured data that requests a calibration, and its form.
pub(super) const CALIBRATE: &str = "calibrate";

impl Studied<'_> {
    /// Spring constant, resonance, quality factor and sensitivity from thermal noise.
    pub(super) fn calibrated(
        &self,
        case: &Case,
        name: &str,
        bytes: Vec<u8>,
    ) -> Result<(), ApiError> {
        // The form is another one until the page knows that the file is of thermal noise.
        let named = match self.field(CALIBRATE) {
            Ok(forms::YES) => self.options_of(&schema::<CalibrateOptions>()),
            _ => Map::new(),
        };
        let options: CalibrateOptions = read(Value::Object(named.clone()))?;
        let found = calibrate_bytes(name, bytes, &options)?;
        let calibration = &found.calibration;
        let words = format!(
            "Fit of {} bins from {} to {}",
            calibration.bins,
            Kind::Frequency.format_digits(calibration.range[0], 4),
            Kind::Frequency.format_digits(calibration.range[1], 4)
        );
        self.hand(Stage {
            figure: Some(found.figure()),
            words,
            remarks: found.remarks(),
            tables: vec![report::of_frame("", &found.estimate_table())],
            commands: Some(commands(name, &named)),
            form: Some(CALIBRATE),
            found: Some(NextStep {
                set: self.of_block(case, &found.cantilever),
                take: "Use these values",
                file: found.cantilever,
                save: "Lines for the case file",
                name: "cantilever.toml",
            }),
            ..Stage::default()
        })
    }

    /// The changes to the case that take the values of a block `[cantilever]`, if the case is a lever.
    fn of_block(&self, case: &Case, block: &str) -> Option<Map<String, Value>> {
        let block: Map<String, Value> = toml::from_str(block).ok()?;
        let mut set = Map::new();
        for (name, value) in object(block.get("cantilever")?.clone()) {
            let key = Key::find(&format!("cantilever.{name}"))?;
            let text = value
                .as_str()
                .map_or_else(|| value.to_string(), str::to_owned);
            for (other, _) in key.alternatives() {
                if case.stated(other).is_some() {
                    set.insert(other.path().into(), "".into());
                }
            }
            set.insert(key.path().into(), text.into());
        }
        if is_at_resonance(case) {
            let resonance = set.get(Key::LeverF0.path())?.clone();
            set.insert(Key::DriveFrequency.path().into(), resonance);
        }
        let mut spec = self.request.case.clone();
        for (key, text) in &set {
            spec.put(Key::find(key)?, text.as_str()?);
        }
        let taken = spec.any_distance(self.app).ok()?;
        taken.model().is_ok().then_some(set)
    }
}

/// The command and the lines of Python of a calibration.
fn commands(name: &str, options: &Map<String, Value>) -> [String; 2] {
    let mut command = format!("nanotap calibrate {}", quoted(name));
    let mut python = format!("import nanotap\n\nfound = nanotap.calibrate({name:?}");
    for (option, value) in options {
        let text = |value: &Value| {
            value
                .as_str()
                .map_or_else(|| value.to_string(), str::to_owned)
        };
        let flag = option.replace('_', "-");
        let _ = match value {
            Value::Bool(true) => write!(command, " --{flag}"),
            Value::Array(all) => all
                .iter()
                .try_for_each(|value| write!(command, " --{flag} {}", quoted(&text(value)))),
            other => write!(command, " --{flag}={}", quoted(&text(other))),
        };
        // `from` is a keyword of Python.
        let option = if option == "from" { "from_" } else { option };
        let _ = match value {
            Value::Bool(true) => write!(python, ", {option}=True"),
            other => write!(python, ", {option}={other}"),
        };
    }
    [command + " --plot calibrate.svg", python + ")\n"]
}
