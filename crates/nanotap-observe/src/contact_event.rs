//! Beginnings and ends of contacts.

use nanotap_flow::flow::{Observer, SwitchView};
use nanotap_flow::regime::ModalOutput;
use schemars::JsonSchema;
use serde::Serialize;

use crate::begins_contact;
use crate::frame::{Frame, Rows, frame};
use nanotap_case::units::Units;
use nanotap_model::Model;

/// A switch between flight and contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ContactEvent {
    /// Time from the end of the transient, in the model's unit.
    #[schemars(extend("x-unit" = crate::Dimension::Time.model_unit()))]
    pub tau: f64,
    /// Whether contact begins or ends, or the tip hits a rigid stop.
    pub kind: ContactEventKind,
    /// Rate of the gap just before the switch, in the model's unit. At the end of contact with a
    /// Kelvin–Voigt surface, which followed the tip, it is the rate of the tip's height.
    #[schemars(extend("x-unit" = crate::Dimension::Velocity.model_unit()))]
    pub gap_rate: f64,
}

/// Kind of a switch between flight and contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ContactEventKind {
    /// Contact begins: the tip reaches the surface.
    ContactStart,
    /// Contact ends: the tip leaves the surface.
    ContactEnd,
    /// Impact on a rigid stop.
    Impact,
}

impl ContactEventKind {
    /// Its name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ContactStart => "contact_start",
            Self::ContactEnd => "contact_end",
            Self::Impact => "impact",
        }
    }
}

/// The contacts of a motion as a table.
pub fn contact_table(events: &[ContactEvent], units: Units) -> Frame<'_> {
    frame! { Rows::new("contacts", events, Some(units));
        "kind", "switch", Plain => |e| e.kind.name();
        "tau", "time", (Time, Quantity([5, 5])) => |e| e.tau;
        .si_name("time");
        "gap_rate", "rate of the gap", (Velocity, Quantity([4, 4])) => |e| e.gap_rate;
    }
}

/// Records the contacts of a motion during a run.
pub struct Contacts<'a> {
    model: &'a Model,
    /// Rate of the gap in each regime, because a contact may end by its force and not by the gap.
    rates: Vec<ModalOutput>,
    periods: usize,
    events: Vec<ContactEvent>,
}

impl<'a> Contacts<'a> {
    /// Prepares the record of a motion of `model` that is about to run.
    pub fn of(model: &'a Model) -> Self {
        let drive = model.system.drive();
        let gap = if model.memory_reset.is_some() {
            &model.height
        } else {
            &model.gap
        };
        let rate = |r: &nanotap_flow::Regime| r.project(&gap.rate(r.matrix(), r.forcing(), drive));
        Self {
            model,
            rates: model.system.regimes().iter().map(rate).collect(),
            periods: 0,
            events: Vec::new(),
        }
    }

    /// Returns the recorded contact events, in order of time.
    pub fn events(self) -> Vec<ContactEvent> {
        self.events
    }
}

impl Observer for Contacts<'_> {
    fn switch(&mut self, view: &SwitchView<'_>) {
        let (from, to) = (view.switch.from, view.switch.to);
        let contact = &self.model.contact;
        let (kind, gap_rate) = if begins_contact(self.model, from, to) {
            let kind = if from == to {
                ContactEventKind::Impact
            } else {
                ContactEventKind::ContactStart
            };
            (kind, view.rate)
        } else if contact[from] && !contact[to] {
            let drive = view.system.drive();
            let rate = self.rates[from].at(drive, view.modal, view.phase);
            (ContactEventKind::ContactEnd, rate)
        } else {
            return;
        };
        self.events.push(ContactEvent {
            tau: self.periods as f64 * self.model.period() + view.phase,
            kind,
            gap_rate,
        });
    }

    fn period_end(&mut self) {
        self.periods += 1;
    }
}
