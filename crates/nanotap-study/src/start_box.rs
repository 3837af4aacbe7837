//! The default box of initial states of a census or a basin.
//!
//! It is derived from the linear response, so that it fits motions of any size, from the
//! paper's (of order 1) to an experiment's (1e-6 of the beam's height). With
//! r_j the linear response of displacement j to the drive, the half width is, the larger
//! of free flight and contact,
//!
//! `a_j: g r_j`, `v_j: max(Ω, ω_j) g r_j`, `g = 2 √R` within 4 … 40,
//!
//! where ω_j is the frequency at which displacement j would swing by itself and R how much
//! larger its response would be at resonance than at Ω. Every motion that
//! the drive can keep up lies below the resonant amplitude (g = R); the
//! response off resonance is the least (g = 1). The mean of the two holds the
//! subharmonic motions known of this model, and its larger starts decay through all sizes
//! below. Constant parts of the response add to it, and the tip must be able to start
//! twice as far off as the sample is.
//!
//! Of a rigid stop the part behind the stop is cut off, and so is the part behind the wall of a
//! nonlinear law, its pole or the first row of a table. A sample with a memory starts relaxed: it
//! would forget within a contact or two.

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::{StartBox, StartBoxError, StartSet};
use nanotap_flow::Regime;

use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_observe::time_series::state_names;

/// Least and greatest widening of the linear response.
const WIDENING: (f64, f64) = (4.0, 40.0);

/// The default box of `model`.
///
/// # Errors
/// [`StartBoxError`] if the response is beyond the range of floats.
pub fn default_box(model: &Model) -> Result<StartBox, StartBoxError> {
    let n = (model.dimension() - model.memory) / 2;
    let omega = model
        .system
        .drive()
        .frequencies()
        .first()
        .copied()
        .unwrap_or(1.0);
    let moving = || {
        model
            .system
            .regimes()
            .iter()
            .filter(|r| r.matrix().amax() > 0.0)
    };
    let mut lower = vec![0.0; model.dimension()];
    let mut upper = lower.clone();
    for j in 0..n {
        let swing = |r: &Regime| (-r.matrix()[(n + j, j)]).max(0.0).sqrt();
        let half = moving()
            .map(|r| {
                let response: f64 = r
                    .response()
                    .tones
                    .iter()
                    .map(|tone| tone[j].modulus())
                    .sum();
                let damping = -r.matrix()[(n + j, n + j)];
                widening(swing(r), damping, omega) * response + r.response().constant[j].abs()
            })
            .fold(reach(model, j), f64::max);
        let speed = half * moving().map(swing).fold(omega, f64::max);
        (lower[j], upper[j]) = (-half, half);
        (lower[n + j], upper[n + j]) = (-speed, speed);
    }
    if let Some(stop) = model.rigid_stop.map(|stop| stop.tip) {
        let width = upper[0] - lower[0];
        upper[0] = upper[0].min(stop);
        if lower[0] >= upper[0] {
            lower[0] = upper[0] - width.max(f64::MIN_POSITIVE);
        }
    }
    before_wall(model, StartBox::new(lower, upper)?)
}

/// The part of a box in front of the wall of the law, if it has one.
///
/// # Errors
/// When nothing of the box is in front of the wall.
pub fn before_wall(model: &Model, sides: StartBox) -> Result<StartBox, StartBoxError> {
    match model.wall() {
        Some(wall) => sides.before(wall),
        None => Ok(sides),
    }
}

/// Sizes of the default set of starts, as parts of the default box: from the resonant
/// response down to well below the gap.
const SIZES: [f64; 7] = [1.0, 0.316, 0.1, 0.0316, 0.01, 0.00316, 0.001];

/// The default starts of a census of `model`: rest and the linear response of every regime
/// that moves, then draws from [`default_box`] at seven sizes, each a root of ten below the
/// last, around rest (or what of the box is nearest to it).
///
/// # Errors
/// [`StartBoxError`] if the response is beyond the range of floats.
pub fn default_starts(model: &Model, seed: u64) -> Result<StartSet, StartBoxError> {
    let sides = default_box(model)?;
    let mut centre: Vec<f64> = sides
        .lower()
        .iter()
        .zip(sides.upper())
        .map(|(&low, &high)| 0.0f64.clamp(low, high))
        .collect();
    let wall = sides.wall();
    if let Some(wall) = wall.filter(|wall| !wall.is_before(&centre)) {
        // As far in front of it as rest is behind it, as far as the box reaches.
        let behind = wall.distance(&centre).abs();
        let square: f64 = wall.row.iter().map(|a| a * a).sum();
        let ends = sides.lower().iter().zip(sides.upper());
        for ((x, slope), (&low, &high)) in centre.iter_mut().zip(&wall.row).zip(ends) {
            *x = (*x + 2.0 * behind * slope / square).clamp(low, high);
        }
    }
    let drive = model.system.drive();
    let responses = model
        .system
        .regimes()
        .iter()
        .filter(|r| r.matrix().amax() > 0.0)
        .map(|r| r.response().at(drive, 0.0).as_slice().to_vec())
        .filter(|x| x.iter().all(|v| v.is_finite()))
        .map(|mut state| {
            model.stop_at_wall(&mut state);
            state
        })
        .filter(|state| wall.is_none_or(|wall| wall.is_before(state)));
    let given = std::iter::once(centre.clone()).chain(responses);
    Ok(StartSet::spread(&sides, &centre, &SIZES, seed)?.with_given(given))
}

/// Twice the displacement `j` that brings the tip to the sample by itself; of the first
/// mode of a beam, which bends most.
fn reach(model: &Model, j: usize) -> f64 {
    let slope = model.height.row[j].abs();
    if j == 0 && slope > 0.0 {
        let to_wall = model.wall().map_or(0.0, |wall| wall.least.abs());
        2.0 * model.height.constant.abs().max(to_wall) / slope
    } else {
        0.0
    }
}

/// Twice the root of what resonance would gain on a degree of freedom that swings at
/// `swing` and loses speed at the rate `damping`, over what a drive at `omega` gives it.
fn widening(swing: f64, damping: f64, omega: f64) -> f64 {
    let here = nanotap_arithmetic::hypot(swing * swing - omega * omega, damping * omega);
    let resonant = damping * swing;
    let gain = if resonant > 0.0 {
        here / resonant
    } else {
        f64::INFINITY
    };
    (2.0 * gain.sqrt()).clamp(WIDENING.0, WIDENING.1)
}

/// The default box with some sides replaced: coordinate (`a1`, `v2`, `x` …), lower and
/// upper end. A side of no length holds its coordinate fixed.
///
/// # Errors
/// For an unknown coordinate or an interval that runs downwards.
pub fn box_with(model: &Model, sides: &[(String, f64, f64)]) -> Result<StartBox, Error> {
    let wrong = |message: String| Error::option("box", message, "name coordinates, as in a1=-1:1");
    let default = default_box(model).map_err(|error| wrong(error.to_string()))?;
    let (mut lower, mut upper) = (default.lower().to_vec(), default.upper().to_vec());
    let names = state_names(model);
    for (name, low, high) in sides {
        let Some(index) = names.iter().position(|n| n == name) else {
            return Err(wrong(format!(
                "no coordinate `{name}` here; there are {}",
                names.join(", ")
            )));
        };
        if !(low <= high && (high - low).is_finite()) {
            return Err(wrong(format!(
                "{name} runs from {low} to {high}; it must run upwards, between finite numbers"
            )));
        }
        (lower[index], upper[index]) = (*low, *high);
    }
    let sides = StartBox::new(lower, upper).and_then(|sides| before_wall(model, sides));
    sides.map_err(|error| match error {
        StartBoxError::BehindWall => Error::option(
            "box",
            "the whole box lies behind the surface, where the contact law does not hold",
            "move it to larger gaps",
        ),
        error => wrong(error.to_string()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap_model::cantilever::Cantilever;
    use nanotap_model::oscillator::{Oscillator, Stop};
    use nanotap_model::parameter::Parameter;

    /// With α5 = 0 the model is homogeneous of degree one, and so must the box be.
    #[test]
    fn it_scales_with_the_drive() {
        let of = |alpha2| {
            default_box(
                &Model::cantilever(&Cantilever::paper().with(Parameter::Alpha2, alpha2)).unwrap(),
            )
            .unwrap()
        };
        let (large, small) = (of(0.1), of(1e-7));
        for (a, b) in large.upper().iter().zip(small.upper()) {
            assert!((b / a / 1e-6 - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn starts_of_a_rigid_stop_lie_before_it() {
        let mut oscillator = Oscillator {
            mass: 1.0,
            stiffness: 1.0,
            damping: 0.0,
            forcing: 1.0,
            omega: 2.5,
            gap: 0.0,
            stop: Stop::Rigid { restitution: 0.8 },
        };
        for gap in [0.0, 0.3, -50.0, 50.0] {
            oscillator.gap = gap;
            let sides = default_box(&oscillator.model().unwrap()).unwrap();
            assert!(sides.upper()[0] <= gap && sides.lower()[0] < sides.upper()[0]);
        }
    }

    #[test]
    fn sides_are_replaced_by_name() {
        let model = Model::cantilever(&Cantilever::paper()).unwrap();
        let sides = box_with(
            &model,
            &[("v2".into(), -0.5, 0.25), ("a1".into(), 0.1, 0.1)],
        )
        .unwrap();
        assert_eq!((sides.lower()[4], sides.upper()[4]), (-0.5, 0.25));
        assert_eq!((sides.lower()[0], sides.upper()[0]), (0.1, 0.1));
        for (side, words) in [
            (("a4".into(), 0.0, 1.0), "no coordinate `a4`"),
            (("a1".into(), 1.0, 0.0), "must run upwards"),
        ] {
            let error = box_with(&model, &[side]).unwrap_err();
            assert!(error.message().contains(words), "{error}");
        }
    }
}
