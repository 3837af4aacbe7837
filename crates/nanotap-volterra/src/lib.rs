//! The flow of linear modes under one scalar nonlinear force.
//!
//! A [`System`] is `ẋ = A x + f(t) + p F(d, ḋ, s)` with a forcing of given tones, a gap
//! `d = row · x + offset + tones` and a [`ForceLaw`] `F` with branches and switches `s`
//! between them. The linear part is solved in closed form; unknown is one scalar, the force
//! in time. The gap obeys a Volterra equation with the modes' Green's function `G`,
//! `d(t) = d_free(t) + ∫ G(t − u) F(u) du`, and on a step `F` is a polynomial through
//! Chebyshev nodes: Newton solves for the forces at the nodes, whose number does not depend on the
//! modes. Where a contact begins or ends like a power of the root of time, the polynomial is
//! one in the root of time, and a step that ends a contact moves its start until it ends
//! exactly there. Jacobian and parameter derivatives come from one factorisation a step.
//!
//! - [`modes`]: the linear modes in real blocks; [`kernel`]: their Green's function
//!   integrated against a step's polynomials, tabulated by step length;
//! - [`law`]: what a law is to the flow; [`laws`]: the table of contact laws;
//! - [`system`]: modes, drive and law together; [`flow`] runs it;
//! - [`coarse`]: a cheap, approximate flow for following transients;
//! - [`averaging`]: guesses of periodic motions by harmonic balance;
//! - [`tangent`]: derivatives by the initial state and by parameters;
//! - [`trajectory`]: dense output, extrema, integrals.
//!
//! # What is guaranteed
//!
//! *Within a step.* A step is accepted when the last two Chebyshev coefficients of the force
//! and its *defect*, the difference between the polynomial and the law at points between the
//! nodes, both change the gap by less than [`Options::tolerance`](system::Options) over the step,
//! or are below rounding (a few `2⁻⁵²` of the force and of its slope times the gap, which no step
//! length can improve). The defect selects the right solution where collocation has several, near
//! snap-in: the exact motion obeys the same Volterra equation without the defect, so by Gronwall's
//! inequality the two differ by at most `cosh √(2κ)` times the change that the defect causes, with `κ = max |∂F/∂d| ∫|G| + |∂F/∂ḋ| ∫|G'|`. A
//! step with `κ > 8` is refused, even with a small residual. The slope of the force is sampled at
//! the nodes; between them it is as resolved as the force is.
//!
//! *Switches.* A guard is expanded in the step's polynomials, from its values at the nodes.
//! It is passed over when its series cannot vanish (the constant exceeds the sum of the sizes
//! of all other coefficients, their tail ten times over and twice the amplitude of modes too
//! fast for the polynomial); otherwise its tail must be below 1e-11 of its size, and the
//! first fall to zero is bracketed by bounds of the series' first two derivatives, so that
//! nothing depends on sampling. A dip that touches zero only within 1e-9 of the step's length
//! is a touch, not a switch. The series represents the guard between the nodes to within its
//! tail; this is not proved.
//!
//! *Otherwise* the run ends with a [`VolterraError`] that states where and why the last step was
//! refused. The same initial state gives the same bits, independent of earlier runs.
//!
//! # Example
//!
//! A lever of 0.9 N/m and Q 200, driven at resonance with a free amplitude of 20 nm, 18 nm
//! above a sample of 1 GPa under DMT contact: one period of its repulsive orbit, in nm, nN and
//! units of `1/ω₀`.
//!
//! ```
//! use nalgebra::{DVector, RowDVector};
//! use nanotap_volterra::*;
//! use std::{f64::consts::TAU, sync::Arc};
//!
//! let modes = Modes::from_oscillators(&[(1.0, 1.0 / 200.0)])?;
//! let gap = RowDVector::from_row_slice(&[1.0, 0.0]);
//! let force = DVector::from_row_slice(&[0.0, 1.0 / 0.9]);
//! let kernel = Kernel::new(modes, gap, force, TAU / 4.0, 20)?;
//! let zero = Complex::new(0.0, 0.0);
//! let drive = Drive {
//!     constant: DVector::zeros(2),
//!     offset: 18.0,
//!     tones: vec![Tone {
//!         frequency: 1.0,
//!         forcing: DVector::from_row_slice(&[zero, Complex::new(20.0 / 200.0, 0.0)]),
//!         gap: zero,
//!     }],
//! };
//! let law = laws::build(
//!     "dmt",
//!     &[
//!         ("modulus", 1.0),
//!         ("tip_modulus", 160.0),
//!         ("radius", 5.0),
//!         ("contact_distance", 0.169),
//!         ("hamaker", 0.03),
//!     ],
//! )?;
//! let system = System::new(kernel, law, drive, Options::new(1e-13))?;
//! let mut flow = Flow::new(Arc::new(system));
//! let start = [7.004819588954, 17.140760486782];
//! flow.start(&start, 0.0)?;
//! let motion = flow.record_until(TAU)?;
//! let mut end = [0.0; 2];
//! flow.state(&mut end);
//! assert!((end[0] - start[0]).abs() < 1e-9 && (end[1] - start[1]).abs() < 1e-9);
//! // It is in contact for 8.7 % of the period, and nothing is dissipated.
//! assert!((motion.fraction(|branch| branch == 1) - 0.0870649270).abs() < 1e-9);
//! assert!(motion.work().abs() < 1e-9);
//! # Ok::<(), VolterraError>(())
//! ```
//!
//! Continuous memory that is linear in the state belongs into the modes, as that of a
//! [`Surface`] that relaxes; a law may remember a branch.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod averaging;
pub mod coarse;
pub mod error;
pub mod flow;
pub mod kernel;
pub mod law;
pub mod laws;
pub mod modes;
pub mod system;
pub mod tangent;
pub mod trajectory;
pub mod variation;

mod bracket;
mod force_sums;
mod gap_table;
mod linear;
mod quadrature;
mod step;

/// The complex numbers used throughout.
pub type Complex = nalgebra::Complex<f64>;

pub use coarse::Coarse;
pub use error::{Refusal, VolterraError};
pub use flow::{Flow, Switch};
pub use force_sums::{ForceSums, SurfaceRun, SurfaceSums};
pub use kernel::Kernel;
pub use law::{Approach, Exit, Force, ForceLaw, Guard, Remark, Surface};
pub use modes::Modes;
pub use quadrature::gauss_legendre;
pub use step::Statistics;
pub use system::{Drive, Options, System, Tone};
pub use tangent::{Parameter, ToneChange};
pub use trajectory::{Extremum, Node, Output, Sample, Trajectory};
pub use variation::{Moment, Reading, Variation, VariedOutput};
