//! The figures of these studies.

pub mod basin;
pub mod bimodal;
pub mod contact_laws;
pub mod convergence;
pub mod modes;
pub mod noise;
pub mod setpoint_map;
pub mod sweep;
pub mod window;
