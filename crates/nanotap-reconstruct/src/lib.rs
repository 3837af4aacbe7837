//! Forces and energies from measured curves of amplitude and phase, or of frequency shift and
//! excitation, without a contact law.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod figure;
pub mod reconstruct;
