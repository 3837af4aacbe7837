//! Periodic orbits of a lever under a nonlinear force, from averaging.
//!
//! Near resonance the averaged equation has a root for every period-1 motion, stable or not,
//! whatever the size of its basin. Each root and the linear response about each rest of the lever
//! start Newton's method, on the approximate map first.
//!
//! Fails by omission: subharmonic motions, and motions with strong harmonics of the gap.

use nanotap_dynamics::{PeriodicOrbit, Scheduling as _, ShootingOptions, close_orbit};

use nanotap_model::Model;
use nanotap_model::model_map::ModelMap;

/// Residual of an orbit of the approximate map, as a part of its scale.
const COARSE_RESIDUAL: f64 = 1e-4;
/// Orbits of the approximate map nearer to each other than this part of their scale are one.
const COARSE_DISTANCE: f64 = 1e-4;

/// The orbits of `model` that Newton's method closes from averaging, each once; none of a model
/// without a nonlinear force.
pub fn averaged_orbits(model: &Model) -> Vec<PeriodicOrbit> {
    let Some(nonlinear) = &model.nonlinear else {
        return Vec::new();
    };
    let mut exact = ModelMap::new(model);
    let states = nonlinear.averaged_states();
    let guesses = match exact.coarse() {
        Some(coarse) => coarse_states(coarse, &states),
        None => states,
    };
    let mut orbits: Vec<PeriodicOrbit> = Vec::new();
    for guess in guesses {
        if let Ok(orbit) = close_orbit(&mut exact, &guess, 1, &ShootingOptions::default())
            && !orbits.iter().any(|known| known.is_same_as(&orbit))
        {
            orbits.push(orbit);
        }
    }
    orbits
}

/// The states of orbits of the approximate map from these guesses.
fn coarse_states(mut coarse: ModelMap, guesses: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let options = ShootingOptions {
        residual_tolerance: COARSE_RESIDUAL,
        explains_stalls: false,
        ..ShootingOptions::default()
    };
    let mut orbits: Vec<PeriodicOrbit> = Vec::new();
    for guess in guesses {
        if let Ok(orbit) = close_orbit(&mut coarse, guess, 1, &options) {
            let near = |known: &PeriodicOrbit| known.is_near(&orbit, COARSE_DISTANCE);
            if !orbits.iter().any(near) {
                orbits.push(orbit);
            }
        }
    }
    let states = orbits.into_iter().flat_map(|orbit| orbit.states);
    states.collect()
}
