//! Experiments as they are done at the instrument: curves against the distance to the
//! sample, with every motion that coexists.

pub mod approach;
mod approach_figure;
mod free_motion;
mod physical_sight;
pub mod setpoint;
pub mod window;

pub use approach_figure::approach_figure;
pub use free_motion::FreeMotion;
pub use physical_sight::PhysicalSight;
