//! Levers of the catalogue on the sample of the case.

use nanotap::case::Key;
use nanotap::case::quantity::Kind;
use nanotap::study::lever::{LeverOptions, LeverStudy, case_with_lever};
use nanotap::study::registry::Study as _;
use nanotap::study::request::read;
use serde_json::{Value, json};

use super::{Stage, Studied, object};
use crate::api_error::ApiError;
use crate::forms;
use crate::report;

/// Columns that the page shows.
const SHOWN: [&str; 10] = [
    "lever",
    "k",
    "f0",
    "Q",
    "tip_radius",
    "F_max",
    "regime",
    "states",
    "line_time",
    "holds",
];

impl Studied<'_> {
    /// Levers of the catalogue on the sample of the case.
    pub(super) fn levers(&self) -> Result<(), ApiError> {
        let mut spec = self.request.case.clone();
        let setpoint = self.field("setpoint")?;
        spec.put(Key::DriveSetpoint, setpoint);
        let own = self.request.case.any_distance(self.app)?;
        let case = spec.any_distance(self.app)?;
        let conditions = self.conditions()?;
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
        let frame = report.lever_table();
        let (mut table, rows) = report::of_columns(&frame, &SHOWN);
        let rows = report.levers.iter().zip(rows).map(|(lever, cells)| {
            let taken = case_with_lever(&case, &lever.lever, &read).ok();
            let set = taken.map(|taken| report::changes(&own, &taken));
            report::row(&cells, set.as_ref().filter(|_| lever.motion.is_some()))
        });
        table["rows"] = rows.collect();
        self.hand(Stage {
            words: format!(
                "{} levers at A₀ = {} and setpoint {setpoint}. A click on a row chooses that lever. {}",
                report.levers.len(),
                Kind::Length.format_digits(report.free_amplitude, 3),
                report.sentences(str::to_owned).join(". "),
            ),
            studies: &[("lever", &options)],
            tables: vec![table],
            ..Stage::default()
        })
    }
}
