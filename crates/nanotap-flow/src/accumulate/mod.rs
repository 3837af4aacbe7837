//! Exact observables of a motion, accumulated while it runs.
//!
//! A [`Request`] names outputs (scalars affine in the state, which may differ from regime to
//! regime) and the functionals of each: its least or greatest value, its integral, its
//! Fourier coefficient at a frequency, the integral of its product with another. Nothing else
//! is computed. A [`Plan`] is the request made ready for one [`System`](crate::System); it is immutable and
//! may be shared. An [`Accumulator`] is an [`Observer`](crate::flow::Observer) that carries
//! the sums along:
//!
//! ```
//! use nanotap_flow::accumulate::{Accumulator, Functional, Request};
//! # use nalgebra::{DMatrix, DVector, RowDVector};
//! # use nanotap_flow::{Drive, Flow, HarmonicVector, Output, Regime, System};
//! # let drive = Drive::single(1.0)?;
//! # let matrix = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -4.0, -0.5]);
//! # let push = DVector::from_vec(vec![0.0, 1.0]);
//! # let forcing = HarmonicVector::zeros(2, 1).with_tone(0, &push, &DVector::zeros(2));
//! # let regime = Regime::new(0, matrix, forcing, &drive)?;
//! # let system = std::sync::Arc::new(System::new(drive, vec![regime], vec![vec![]])?);
//! let x = Output::linear(RowDVector::from_row_slice(&[1.0, 0.0]), 1);
//! let mut request = Request::new();
//! let position = request.output(&x);
//! let highest = request.add(Functional::Greatest(position));
//! let mean = request.add(Functional::Integral(position));
//! let first = request.add(Functional::Fourier(position, 1.0));
//!
//! let mut accumulator = Accumulator::new(&request.plan(&system)?);
//! let mut flow = Flow::new(system);
//! flow.start(&[0.3, 0.0], 0.0)?;
//! for _ in 0..10 {
//!     flow.run_period(&mut accumulator)?;
//! }
//! let duration = accumulator.duration();
//! let values = accumulator.values();
//! println!("{} {}", values[highest].re, values[mean].re / duration);
//! println!("{}", values[first].norm_sqr().sqrt() * 2.0 / duration);
//! # Ok::<(), nanotap_flow::FlowError>(())
//! ```
//!
//! Always accumulated, at no cost: the time in each regime and, for each pair of regimes, the
//! number of switches from one to the other, the number of grazings, and the greatest speed and
//! the sum of the squared speeds at these switches.
//!
//! # Contract
//! - Integrals are closed forms of the modal amplitudes, one term for each mode (or pair of
//!   modes), over every stretch between switches; there is no quadrature.
//! - Extrema are those of the continuous motion, ends and switches included, to rounding:
//!   every stretch of time is either proved not to exceed the earlier extremum, or contains a
//!   located zero of the rate. None is taken from samples.
//! - An output that differs between regimes jumps at switches; both one-sided values count.
//!   Where an output is identically zero in a regime, that zero counts as a value of it.
//! - A request for the same thing twice returns the same number and costs nothing.
//! - [`Accumulator::clear`] begins anew, [`Accumulator::take`] begins anew for one
//!   extremum alone (extrema of every period, say). Time is counted, for Fourier
//!   coefficients, from the start of the drive period in which the accumulator was last
//!   cleared.
//! - A stretch costs no allocation, unless eigenvalues coincide (critical damping).

mod accumulator;
mod request;
mod stretch;

pub use crate::functional::Functional;
pub use accumulator::{Accumulator, Switches};
pub use request::{Plan, Request};
