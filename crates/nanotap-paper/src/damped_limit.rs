//! The periodic response of an undamped case. It has no attractor, so the attractor of the damped
//! case of Eq. (26) is followed by Newton's method while all damping is removed.

use nanotap_dynamics::{ClassifyOptions, MotionKind, ShootingOptions, classify, close_orbit};

use super::PaperError;
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::model_map::ModelMap;
use nanotap::model::parameter::Parameter;
use nanotap::study::orbit::{OrbitReport, report};

/// Halvings of the damping before it is set to zero.
const HALVINGS: i32 = 12;
/// Initial damping of the beam and of the contact, Eq. (26).
const START: (f64, f64) = (0.1, 0.2);

/// The limit of the damped steady state without damping, and its model.
pub(super) fn response(undamped: &Cantilever) -> Result<(Model, OrbitReport), PaperError> {
    let what = format!(
        "the periodic response at Ω = {}, N = {}",
        undamped.omega, undamped.modes
    );
    let damped = |factor: f64| {
        Model::cantilever(
            &undamped
                .clone()
                .with(Parameter::Alpha3, factor * START.0)
                .with(Parameter::Alpha6, factor * START.1),
        )
    };
    let model = damped(1.0)?;
    let rest = vec![0.0; model.dimension()];
    let classified = classify(
        &mut ModelMap::new(&model),
        &rest,
        &ClassifyOptions::default(),
    );
    let (MotionKind::Periodic(mut orbit) | MotionKind::TransientChaos { mut orbit, .. }) =
        classified.kind
    else {
        return Err(PaperError::failed(what)(
            "the damped motion is not periodic",
        ));
    };
    let factors = (1..=HALVINGS).map(|k| 0.5f64.powi(k)).chain([0.0]);
    let mut model = model;
    for factor in factors {
        model = damped(factor)?;
        let start = orbit.states[0].clone();
        orbit = close_orbit(
            &mut ModelMap::new(&model),
            &start,
            orbit.period,
            &ShootingOptions::default(),
        )
        .map_err(PaperError::failed(&what))?;
    }
    let report = report(&model, &orbit, 20).map_err(PaperError::failed(what))?;
    Ok((model, report))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without damping the flow preserves volume: multipliers come in pairs μ, 1/μ, and energy is
    /// neither added nor removed over a period.
    #[test]
    fn the_response_is_on_the_unit_circle_and_does_no_work() {
        let (_, orbit) = response(&Cantilever::paper_eq24()).unwrap();
        assert_eq!(orbit.period, 1);
        for [re, im] in &orbit.multipliers {
            assert!((re.hypot(*im) - 1.0).abs() < 1e-6);
        }
        assert!(orbit.observables.energy_balance.drive_work.abs() < 1e-9);
        assert!(orbit.residual < 1e-12);
    }
}
