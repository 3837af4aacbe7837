//! The studies: one room each, with its options, its run and its report.

pub mod approach;
pub mod attractors;
pub mod averaged_orbits;
pub mod basin;
pub mod branch;
pub mod contact_laws;
pub mod convergence;
pub mod fit;
mod free_motion;
pub mod in_si;
pub mod kind;
pub mod limits;
pub mod lyapunov;
pub mod mode_share;
pub mod modes;
pub mod orbit;
pub mod proof;
pub mod recipe;
pub mod reconstruct;
pub mod registry;
pub mod request;
pub mod setpoint;
pub mod simulate;
pub mod start_box;
pub mod sweep;
pub mod threads;
pub mod value;
pub mod window;

pub use approach::frequency_modulation;
pub use free_motion::FreeMotion;
pub use simulate::fixed_step;
