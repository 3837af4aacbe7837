//! Thermal calibration of AFM cantilevers: spring constant, resonance frequency, quality factor and
//! sensitivity of the optical lever from the thermal noise of the deflection.
//!
//! ```
//! use afm_thermal::{Average, Density, Fluid, Options, Plan, Spectrum, Unit, calibrate};
//!
//! // A lever of 1 N/m at 75 kHz with Q = 150 in air, a spectrum without scatter.
//! let frequency: Vec<f64> = (1..1000).map(|k| 150.0 * f64::from(k)).collect();
//! let m = 0.817435 * 1.380649e-23 * 298.15 / 1.0;
//! let density = |f: &f64| {
//!     let r = f / 75e3;
//!     let shape = 1.0 / ((1.0 - r * r).powi(2) + (r / 150.0).powi(2));
//!     2.0 * m / (std::f64::consts::PI * 75e3 * 150.0) * shape + 1e-27
//! };
//! let power: Vec<f64> = frequency.iter().map(density).collect();
//! let spectrum = Spectrum::new(&frequency, &power, Density::Power, Unit::Metre)?
//!     .with_averages(100.0, Average::Powers)?;
//! let calibration = calibrate(&spectrum, &Options::default())?;
//! let k = calibration.stiffness.unwrap();
//! assert!((k.value - 1.0).abs() < 0.01 && k.interval[0] < 1.0 && 1.0 < k.interval[1]);
//! # Ok::<(), afm_thermal::Error>(())
//! ```
//!
//! # Method
//!
//! The first mode is an oscillator, its one-sided power density
//!
//! ```text
//! S(f) = W + m · 2/(π f0 Q) / ((1 − r²)² + (r/Q)²),   r = f/f0,
//! ```
//!
//! with the mean square m and the white noise W of the detector. f0, Q, m and W maximise Whittle's
//! likelihood of averaged periodograms, whose ordinates are S times a variable of mean 1 with the gamma
//! distribution (P. Whittle, Ark. Mat. 2, 423 (1953)). Least squares on the same ordinates has
//! intervals that contain the truth in a tenth of all cases.
//!
//! Equipartition then gives the static spring constant k = β/χ² · `k_B` T/m: β corrects for the shape
//! of the mode (H.-J. Butt and M. Jaschke, Nanotechnology 6, 1 (1995)), χ for the slope that the light
//! measures (R. Proksch et al., Nanotechnology 15, 1344 (2004)); see [`ModeFactor`]. [`Plan`] gives k by
//! the method of J. E. Sader et al., from f0, Q and the dimensions seen from above, and with it the
//! sensitivity without contact.
//!
//! The crate knows nothing of files, tips or samples.
#![forbid(unsafe_code)]

mod calibration;
mod error;
mod estimate;
mod fft;
mod fit;
mod fluid;
mod foreign;
mod mode_factor;
mod oscillator;
mod sader;
mod scatter;
mod spectrum;
mod warning;
mod welch;

pub use calibration::{BOLTZMANN, Calibration, Options, Sader, Scatter, Sensitivity, calibrate};
pub use error::Error;
pub use estimate::Estimate;
pub use fluid::{Fluid, REYNOLDS, hydrodynamic_function};
pub use mode_factor::ModeFactor;
pub use oscillator::density;
pub use sader::{Plan, ReferenceLever};
pub use spectrum::{Average, Density, MAX_BINS, Spectrum, Unit, Window};
pub use warning::Warning;
pub use welch::{MAX_SAMPLES, WelchOptions, welch};
