//! How far the noise of an orbit is from the basin of another state.
//!
//! The boundary of the basin passes through an unstable orbit, the saddle. Near it, at drive phase 0,
//! the boundary is the plane through the saddle on which the left eigenvector ℓ of its unstable
//! multiplier is constant. A disturbance with covariance P has the component ℓᵀx with the variance
//! ℓᵀPℓ, so that the plane is |ℓᵀ(x_s − x)|/√(ℓᵀPℓ) standard deviations away. Noise that small crosses
//! it about once in exp(½ n²) correlation times.
//!
//! Fails: the plane and the linear noise hold near the saddle and the orbit, not between them; far
//! from a fold n is an estimate of the order of magnitude. Saddles of longer periods are not looked
//! for, nor are other states without a saddle of period 1.

use nalgebra::{DMatrix, DVector};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::{PeriodicOrbit, StroboscopicMap};
use schemars::JsonSchema;
use serde::Serialize;

use crate::Error;
use crate::control::Control;
use crate::model::Model;
use crate::model::model_map::ModelMap;
use crate::observe::{ObservableSet, measure};
use crate::study::attractors::saddles;

/// The unstable orbit that the noise reaches first on its way to another state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SaddleDistance {
    /// Distance of the boundary of the basin in standard deviations of the noise.
    pub deviations: f64,
    /// Amplitude of the unstable orbit in m.
    #[serde(rename = "A")]
    pub amplitude: f64,
    /// Phase of the unstable orbit behind the drive, in degrees.
    pub phase: f64,
}

/// The nearest saddle to an orbit with this state at drive phase 0 and the covariance of its
/// continuous entries; amplitudes are multiplied by `length`.
pub(super) fn nearest(
    model: &Model,
    state: &[f64],
    covariance: &DMatrix<f64>,
    length: f64,
    control: &Control<'_>,
) -> Result<Option<SaddleDistance>, Error> {
    let n = covariance.nrows();
    let mut nearest: Option<SaddleDistance> = None;
    for saddle in saddles(model, control)? {
        let Some(normal) = normal(model, &saddle, n) else {
            continue;
        };
        let apart: f64 = (0..n)
            .map(|k| normal[k] * (saddle.states[0][k] - state[k]))
            .sum();
        let deviations = apart.abs() / normal.dot(&(covariance * &normal)).sqrt();
        if deviations.is_finite() && nearest.is_none_or(|known| deviations < known.deviations) {
            let seen = measure(model, &saddle.states[0], 1, ObservableSet::FIRST_HARMONIC)?;
            nearest = Some(SaddleDistance {
                deviations,
                amplitude: length * seen.first_harmonic,
                phase: seen.phase,
            });
        }
    }
    Ok(nearest)
}

/// The left eigenvector of the unstable multiplier of a saddle of period 1, of the first `n` entries.
fn normal(model: &Model, saddle: &PeriodicOrbit, n: usize) -> Option<DVector<f64>> {
    let multiplier = saddle
        .multipliers
        .iter()
        .find(|multiplier| multiplier.modulus() > 1.0)?;
    let mut map = ModelMap::new(model);
    let mut state = saddle.states[0].clone();
    let mut jacobian = DMatrix::zeros(state.len(), state.len());
    map.advance_with_jacobian(&mut state, &mut jacobian).ok()?;
    let block = jacobian.view((0, 0), (n, n)).transpose();
    let matrix = block - DMatrix::from_diagonal_element(n, n, multiplier.re);
    let decomposed = matrix.try_svd(false, true, f64::EPSILON, 10_000)?;
    let (smallest, _) = decomposed.singular_values.argmin();
    Some(decomposed.v_t?.row(smallest).transpose())
}
