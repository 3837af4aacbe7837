//! Physics and mathematics of nanotap, compared with references, closed forms and independent
//! methods.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod contact_laws;
mod derivatives;
mod differential;
mod drive;
mod facts;
mod impact_oscillator;
mod kelvin_voigt;
mod located_runge_kutta;
mod map;
mod motions;
mod moving_gap;
mod moving_surface;
mod observables;
mod one_shot;
mod orbit_derivatives;
mod q_control;
mod references;
mod short_contacts;
mod standard_linear_solid;
mod sticking;
mod taylor;

use nanotap::case::Case;
use nanotap::case::file::Source;

/// The case that a file with this text states.
fn stated(text: &str) -> Case {
    let source = Source {
        name: "case.toml".into(),
        text: text.into(),
    };
    Case::parse(Some(source), &[]).unwrap()
}
