//! Levers of the catalogue on the sample of the case.

use nanotap::case::Key;
use nanotap::case::quantity::Kind;
use nanotap::study::lever::{LeverOptions, LeverStudy, QualityFactorSource, case_with_lever};
use nanotap::study::registry::Study as _;
use nanotap::study::request::read;
use serde_json::{Value, json};

use super::{Stage, Studied, object};
use crate::api_error::ApiError;
use crate::forms;
use crate::report;

/// Pixels of a line of an image, there and back.
const LINE_PIXELS: f64 = 512.0;

impl Studied<'_> {
    /// Levers of the catalogue on the sample of the case.
    pub(super) fn levers(&self) -> Result<(), ApiError> {
        let mut spec = self.request.case.clone();
        let setpoint = self.field("setpoint")?;
        spec.put(Key::DriveSetpoint, setpoint);
        let own = self.request.case.any_distance(self.app)?;
        let case = spec.any_distance(self.app)?;
        let conditions = self.conditions()?;
        let unconditional = conditions.is_empty();
        let mut options = object(json!({ "where": conditions }));
        if self.field("tip")? == forms::OWN_TIP {
            options.insert("keep_tip".into(), true.into());
        }
        let read: LeverOptions = read(Value::Object(options.clone()))?;
        if case.stated(Key::DriveSetpoint) != own.stated(Key::DriveSetpoint) {
            let word = format!("{}={setpoint}", Key::DriveSetpoint);
            options.insert("set".into(), json!([word]));
        }
        self.begins(LeverStudy::NAME, &options);
        let report = self.counting(LeverStudy::COUNTED, |control| {
            LeverStudy::run(&case, &read, control)
        })?;
        let shown = |kind: Kind, value: f64| {
            if value.is_finite() {
                kind.format_digits(value, 3)
            } else {
                String::new()
            }
        };
        let rows = report.levers.iter().map(|lever| {
            let motion = lever.motion.as_ref();
            let cells = [
                lever.lever.clone(),
                shown(Kind::Stiffness, lever.k),
                shown(Kind::Frequency, lever.f0),
                shown(Kind::Number, lever.quality_factor),
                shown(Kind::Length, lever.tip_radius.unwrap_or(f64::NAN)),
                match (motion, &lever.reason) {
                    (Some(motion), _) => shown(Kind::Force, motion.physical.observables.peak_force),
                    (None, Some(reason)) => reason.clone(),
                    (None, None) => String::new(),
                },
                motion.map_or_else(String::new, |motion| motion.regime.to_owned()),
                motion.map_or_else(String::new, |motion| motion.states.to_string()),
                shown(Kind::Time, lever.time_constant * LINE_PIXELS),
                lever
                    .holds
                    .map_or("", |holds| if holds { "yes" } else { "no" })
                    .to_owned(),
            ];
            let taken = case_with_lever(&case, &lever.lever, &read).ok();
            let set = taken.map(|taken| report::changes(&own, &taken));
            let shown = &cells[..cells.len() - usize::from(unconditional)];
            report::row(shown, set.as_ref().filter(|_| motion.is_some()))
        });
        let line = format!(
            "{LINE_PIXELS} pixels there and back, with one time constant Q/(π f0) of the amplitude each"
        );
        let heads = [
            ("lever", "Name in the catalogue"),
            ("k", "Spring constant"),
            ("f₀", "Free resonance"),
            ("Q", "Quality factor"),
            ("tip", "Radius of the tip"),
            ("peak force", "At the setpoint"),
            ("regime", "Whether the mean force attracts or repels"),
            ("states", "Stable motions found at this distance"),
            ("line time", line.as_str()),
            ("conditions", "Whether all conditions hold"),
        ];
        let heads = &heads[..heads.len() - usize::from(unconditional)];
        self.hand(Stage {
            words: format!(
                "{} levers at A₀ = {} and setpoint {setpoint}, with {}. A click on a row chooses that lever.",
                report.levers.len(),
                shown(Kind::Length, report.free_amplitude),
                match report.quality_factor_source {
                    QualityFactorSource::Case => "the quality factor of the case",
                    QualityFactorSource::Fluid => "quality factors in the fluid of the case",
                    QualityFactorSource::Air => "quality factors in air",
                }
            ),
            studies: &[("lever", &options)],
            tables: vec![report::table("", heads, &rows.collect::<Vec<_>>())],
            ..Stage::default()
        })
    }
}
