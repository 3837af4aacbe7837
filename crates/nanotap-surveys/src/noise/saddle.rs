//! How far the noise of an orbit is from the basin of another state.
//!
//! The boundary of the basin passes through an unstable orbit, the saddle. Near it, at drive phase 0,
//! the boundary is the plane through the saddle on which the left eigenvector ℓ of its unstable
//! multiplier is constant. A disturbance with covariance P has the component ℓᵀx with the variance
//! ℓᵀPℓ, so that the plane is |ℓᵀ(x_s − x)|/√(ℓᵀPℓ) standard deviations away. Noise that small crosses
//! it about once in exp(½ n²) correlation times.
//!
//! Fails: the plane and the linear noise hold near the saddle and the orbit, not between them; far
//! from a fold n is an estimate of the order of magnitude. Saddles of other periods are found on the
//! branch of the orbit only.

use nalgebra::{DMatrix, DVector};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::orbit::multipliers::{eigenvector, monodromy};
use nanotap_dynamics::{
    ContinuationOptions, Direction, PeriodicOrbit, ShootingOptions, close_orbit, continue_orbit,
};
use schemars::JsonSchema;
use serde::Serialize;

use nanotap_case::Case;
use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_model::model_map::ModelMap;
use nanotap_motions::attractors::{is_saddle, saddles};
use nanotap_observe::{ObservableSet, measure};
use nanotap_study::FreeMotion;

/// Distances over which a branch is followed, in units of the free motion's reach.
const BEYOND: f64 = 2.0;

/// The unstable orbit that the noise reaches first on its way to another state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SaddleDistance {
    /// Distance of the boundary of the basin in standard deviations of the noise, dimensionless.
    pub deviations: f64,
    /// Amplitude of the unstable orbit in m.
    #[serde(rename = "A")]
    #[schemars(extend("x-unit" = "m"))]
    pub amplitude: f64,
    /// Phase of the unstable orbit behind the drive, in degrees.
    #[schemars(extend("x-unit" = "degree"))]
    pub phase: f64,
}

/// Finds the nearest saddle to an orbit with this state at drive phase 0 and the covariance of its
/// continuous entries; amplitudes are multiplied by `length`.
pub(super) fn nearest(
    case: &Case,
    (state, period): (&[f64], usize),
    covariance: &DMatrix<f64>,
    length: f64,
    control: &Control<'_>,
) -> Result<Option<SaddleDistance>, Error> {
    let model = &case.model()?;
    let mut candidates = saddles(model, control)?;
    candidates.extend(beyond_folds(case, model, (state, period), control));
    // A search that was cut short knows of no nearest one.
    if control.is_cancelled() {
        return Err(Error::stopped());
    }
    let mut nearest: Option<SaddleDistance> = None;
    for saddle in candidates {
        let Some(normal) = normal(model, &saddle) else {
            continue;
        };
        let n = normal.len();
        let covariance = covariance.view((0, 0), (n, n));
        let apart: f64 = (0..n)
            .map(|k| normal[k] * (saddle.states[0][k] - state[k]))
            .sum();
        let deviations = apart.abs() / normal.dot(&(covariance * &normal)).sqrt();
        if deviations.is_finite() && nearest.is_none_or(|known| deviations < known.deviations) {
            let seen = measure(
                model,
                &saddle.states[0],
                saddle.period,
                ObservableSet::FIRST_HARMONIC,
            )?;
            nearest = Some(SaddleDistance {
                deviations,
                amplitude: length * seen.first_harmonic,
                phase: seen.phase,
            });
        }
    }
    Ok(nearest)
}

/// Finds the saddles at the case's own distance on the branch of an orbit, which turns back at its
/// folds.
fn beyond_folds(
    case: &Case,
    model: &Model,
    (state, period): (&[f64], usize),
    control: &Control<'_>,
) -> Vec<PeriodicOrbit> {
    let mut map = ModelMap::new(model);
    let shooting = ShootingOptions::default();
    let Ok(orbit) = close_orbit(&mut map, state, period, &shooting) else {
        return Vec::new();
    };
    let key = case.gap_key();
    let gap = case.get(key);
    let reach = BEYOND * FreeMotion::of(model).reach;
    let options = ContinuationOptions {
        grazings: false,
        ..ContinuationOptions::over(gap - reach, gap + reach)
    };
    let family = case.family(key);
    let mut found = Vec::new();
    for direction in [Direction::Increasing, Direction::Decreasing] {
        let Ok(branch) = continue_orbit(&family, gap, &orbit, direction, &options, control) else {
            continue;
        };
        // The first point is the orbit itself.
        for pair in branch.points.get(1..).unwrap_or_default().windows(2) {
            let [a, b] = [&pair[0], &pair[1]];
            let part = (gap - a.parameter) / (b.parameter - a.parameter);
            if !(0.0..=1.0).contains(&part) {
                continue;
            }
            let guess: Vec<f64> = (a.orbit.states[0].iter().zip(&b.orbit.states[0]))
                .map(|(x, y)| x + part * (y - x))
                .collect();
            let saddle = close_orbit(&mut map, &guess, period, &shooting);
            found.extend(saddle.ok().filter(is_saddle));
        }
    }
    found
}

/// Returns the left eigenvector of the unstable multiplier of a saddle, for the continuous entries.
fn normal(model: &Model, saddle: &PeriodicOrbit) -> Option<DVector<f64>> {
    let multiplier = saddle
        .multipliers
        .iter()
        .find(|multiplier| multiplier.modulus() > 1.0)?;
    let mut map = ModelMap::new(model);
    let product = monodromy(&mut map, &saddle.states[0], saddle.period)?;
    let vector = eigenvector(&product.transpose(), *multiplier)?;
    // Up to a complex factor it is real.
    let largest = *vector
        .iter()
        .max_by(|a, b| a.norm_sqr().total_cmp(&b.norm_sqr()))?;
    Some(vector.map(|entry| (entry / largest).re))
}
