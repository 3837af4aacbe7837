//! The flow of linear modes under one scalar nonlinear force.
// (documentation follows)
pub mod dual;
pub mod error;
pub mod flow;
pub mod kernel;
pub mod law;
pub mod laws;
pub mod modes;
pub mod system;
pub mod tangent;
pub mod trajectory;

mod bracket;
mod linear;
mod quadrature;
mod step;

/// The complex numbers used throughout.
pub type Complex = nalgebra::Complex<f64>;

pub use error::{Refusal, VolterraError};
pub use flow::{Flow, Switch};
pub use kernel::Kernel;
pub use law::{Approach, Exit, Force, ForceLaw, Guard, Remark};
pub use modes::Modes;
pub use step::Statistics;
pub use system::{Drive, Options, System, Tone};
pub use tangent::{Parameter, ToneChange};
pub use trajectory::{Output, Sample, Trajectory};
