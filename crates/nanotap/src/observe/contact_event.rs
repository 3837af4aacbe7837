//! When contacts begin and end.

use nanotap_flow::flow::{Observer, SwitchView};
use nanotap_flow::regime::ModalOutput;
use schemars::JsonSchema;
use serde::Serialize;

use super::begins_contact;
use crate::model::Model;

/// A switch between flight and contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ContactEvent {
    /// When, counted from the end of the transient.
    pub tau: f64,
    /// Which way.
    pub kind: ContactEventKind,
    /// Rate of the gap just before it. Where contact with a Kelvin–Voigt surface ends, which
    /// has followed the tip, that of the tip's height.
    pub gap_rate: f64,
}

/// Which way a switch goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ContactEventKind {
    /// The tip meets the sample.
    ContactStart,
    /// The tip leaves it.
    ContactEnd,
    /// The tip bounces off a rigid stop.
    Impact,
}

/// Notes the contacts of a motion while it runs.
pub struct Contacts<'a> {
    model: &'a Model,
    /// Rate of the gap, an entry a regime: what ends a contact may be the force and not the
    /// gap.
    rates: Vec<ModalOutput>,
    periods: usize,
    events: Vec<ContactEvent>,
}

impl<'a> Contacts<'a> {
    /// Of a motion of `model` that is still to run.
    pub fn of(model: &'a Model) -> Self {
        let drive = model.system.drive();
        let gap = if model.forgetting.is_some() {
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

    /// The contacts.
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
