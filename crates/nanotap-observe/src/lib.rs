//! Observables of a motion: extrema, contact, forces, energy, harmonics, beam clearance. They are
//! exact for the piecewise closed form: extrema are roots of rates, integrals are in closed form;
//! nothing comes from samples.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

mod choice;
mod clearance;
mod contact_event;
mod derivative;
mod dimension;
mod energy;
pub mod frame;
mod functional;
pub mod glossary;
mod harmonics;
mod measure;
mod measured;
pub mod model_limits;
mod nonlinear;
mod number;
mod physical_motion;
mod record;
pub mod table;
pub mod time_series;
mod validity;
mod value;
mod varied_motion;

pub use clearance::Clearance;
pub use contact_event::{ContactEvent, ContactEventKind, Contacts, contact_table};
pub use derivative::first_harmonic_changes;
pub use derivative::{Derivative, DerivativeError};
pub use dimension::Dimension;
pub use energy::EnergyBalance;
pub use harmonics::lag;
pub use harmonics::{Harmonic, Spectrum};
pub use physical_motion::{PhysicalHarmonic, PhysicalMotion, Setting};
pub use record::{RecordOptions, Recorded, Recorder, measure, record};
pub use table::{OBSERVABLES, Observable, ObservableSet, Observables};
pub use validity::OutOfRange;
pub use value::Value;

use nanotap_model::Model;

/// True if a switch begins a contact: from flight into contact, or an impact.
pub fn begins_contact(model: &Model, from: usize, to: usize) -> bool {
    !model.touches(from) && (model.touches(to) || from == to)
}
