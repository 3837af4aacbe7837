//! Curves of codimension-one bifurcations in two parameters.
//!
//! The unknowns are the first state x of the orbit and both parameters. The equations are Pⁿ(x) = x
//! and one scalar equation g = 0, solved by pseudo-arclength continuation:
//!
//! | kind | g |
//! |---|---|
//! | fold, crossing | the bordering scalar of DPⁿ − 1 (Govaerts 2000): zero with its determinant, but well scaled |
//! | flip | the same of DPⁿ + 1 |
//! | Neimark–Sacker | |μ|² − 1 of the complex pair nearest the circle |
//! | grazing | the extremum of the switching function, followed in time |
//!
//! DPⁿ and the derivatives with respect to the parameters are exact. The gradient of g is computed
//! by central differences, which slows Newton down but does not affect the accuracy of the
//! solution.
//!
//! Fails: where two such events meet (a fold or flip at a grazing, where DPⁿ is not differentiable;
//! the ends of a Neimark–Sacker curve, where the pair becomes real) the curve may end because steps
//! become too small. DPⁿ is multiplied out, so an orbit along which errors grow by more than about
//! 1e10 is not resolved.

mod end;
mod follow;
mod solver;

use crate::continuation::{Bifurcation, BifurcationKind, ContinuationError};
use crate::control::Control;
use crate::map::TwoParameterFamily;
use crate::orbit::PeriodicOrbit;
use solver::CurveSolver;

pub use end::CurveEnd;

/// Options of the continuation of a curve. Steps are fractions of the parameter box.
#[derive(Clone, Debug, PartialEq)]
pub struct CurveOptions {
    /// Range of the first parameter, lower end first, in its unit.
    pub first: (f64, f64),
    /// Range of the second parameter, lower end first, in its unit.
    pub second: (f64, f64),
    /// First step in scaled arclength.
    pub initial_step: f64,
    /// Shortest step in scaled arclength.
    pub min_step: f64,
    /// Longest step in scaled arclength.
    pub max_step: f64,
    /// Largest turn of the tangent over one step, in radians.
    pub max_angle: f64,
    /// Number of points at which each half of the curve is cut.
    pub max_points: usize,
    /// Largest entry of a state inside the domain, in units of the state.
    pub bound: f64,
}

impl CurveOptions {
    /// Default options for a box of parameters.
    pub fn over(first: (f64, f64), second: (f64, f64)) -> Self {
        Self {
            first,
            second,
            initial_step: 2e-3,
            min_step: 1e-7,
            max_step: 1e-2,
            max_angle: 0.2,
            max_points: 2000,
            bound: 1e8,
        }
    }
}

/// One point of a curve of bifurcations.
#[derive(Clone, Debug)]
pub struct CurvePoint {
    /// Value of the first parameter, in its unit.
    pub first: f64,
    /// Value of the second parameter, in its unit.
    pub second: f64,
    /// The orbit. At folds its error estimate is large, because the parameters do not determine it.
    pub orbit: PeriodicOrbit,
}

/// A curve of bifurcation points.
#[derive(Clone, Debug)]
pub struct BifurcationCurve {
    /// Kind of the bifurcation. Angle or time is that of the starting point.
    pub kind: BifurcationKind,
    /// Points in order, from one end through the starting point to the other end.
    pub points: Vec<CurvePoint>,
    /// Reasons why it ends at the first and at the last point.
    pub ends: [CurveEnd; 2],
}

/// Follows the bifurcation `point`, found at this value of the second parameter, in both directions
/// through the box.
///
/// # Errors
/// If the options are invalid or the corrector fails at the point.
pub fn trace_curve<F: TwoParameterFamily>(
    family: &F,
    point: &Bifurcation,
    second: f64,
    options: &CurveOptions,
    control: &Control<'_>,
) -> Result<BifurcationCurve, ContinuationError> {
    check(options, point.parameter, second)?;
    let mut solver = CurveSolver::new(family, point, options);
    let mut u = point.orbit.states[0].clone();
    u.extend([point.parameter, second]);
    // The curve may run along either parameter here.
    let d = solver.d;
    let start = [d + 1, d]
        .into_iter()
        .find_map(|coordinate| {
            let mut plane = vec![0.0; d + 2];
            plane[coordinate] = 1.0 / solver.scales[coordinate];
            solver.correct(&u, &plane, &plane).ok()
        })
        .ok_or_else(|| ContinuationError::NoStart {
            parameter: point.parameter,
            reason: "the bifurcation could not be corrected in two parameters".into(),
        })?;
    let mut backwards = start.clone();
    for t in &mut backwards.tangent {
        *t = -*t;
    }
    let (time, borders) = (solver.time, solver.borders.clone());
    let (mut points, first_end) = solver.follow(&backwards, options, control)?;
    solver.time = time;
    solver.borders = borders;
    let (forward, last_end) = solver.follow(&start, options, control)?;
    points.reverse();
    points.extend(forward.into_iter().skip(1));
    Ok(BifurcationCurve {
        kind: point.kind,
        points,
        ends: [first_end, last_end],
    })
}

fn check(options: &CurveOptions, first: f64, second: f64) -> Result<(), ContinuationError> {
    for (range, value) in [(options.first, first), (options.second, second)] {
        let usable = range.0 < range.1 && (range.1 - range.0).is_finite();
        if !usable || !(range.0..=range.1).contains(&value) {
            return Err(ContinuationError::BadOptions(format!(
                "the starting value {value} must lie in a finite range with ascending ends, got {} … {}",
                range.0, range.1
            )));
        }
    }
    let steps = [options.min_step, options.initial_step, options.max_step];
    if !(steps[0] > 0.0 && steps[0] <= steps[1] && steps[1] <= steps[2] && steps[2].is_finite()) {
        return Err(ContinuationError::BadOptions(format!(
            "steps must satisfy 0 < min ≤ initial ≤ max, got {steps:?}"
        )));
    }
    Ok(())
}
