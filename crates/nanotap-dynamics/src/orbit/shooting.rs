//! Periodic orbits by Newton's method on all strobe points at once (multiple shooting; single
//! shooting for period 1).
//!
//! The unknowns are x_0 … x_{n−1} with P(x_k) = x_{k+1}, x_n = x_0, so errors in a chaotic segment
//! grow over one period only. Steps are damped until the sum of squared residuals decreases. The
//! iteration stops when rounding prevents progress, not at a tolerance.
//!
//! The minimal period is verified: for every proper divisor m of n, either P^m(x) differs from x by
//! much more than the orbit's error estimate, or Newton on P^m from x finds an orbit at the same
//! place, which is then returned.
//!
//! Fails with a typed error if no descent is possible (a minimum of the residual that is not an
//! orbit, or a failing map), and near a multiplier +1 (fold), where the orbit is not isolated to
//! rounding. Newton finds *an* orbit near the guess, not necessarily the one that the motion
//! converges to: [`mod@crate::classify`] checks that.

use nalgebra::DMatrix;
use nanotap_arithmetic::ComplexFunctions as _;

use crate::failure::{MapFailure, advance, advance_with_jacobian};
use crate::map::StroboscopicMap;
use crate::orbit::PeriodicOrbit;
use crate::orbit::block_cyclic::BlockCyclic;
use crate::orbit::multipliers::{MultiplierError, Multipliers};
use crate::orbit::parallel::for_each_period;
use crate::random::mix;
use crate::vector::{distance, norm, sum_of_squares};

/// Options of Newton's method for periodic orbits.
#[derive(Clone, Debug, PartialEq)]
pub struct ShootingOptions {
    /// Largest number of Newton steps.
    pub max_iterations: usize,
    /// Smallest fraction of a Newton step that is tried.
    pub min_damping: f64,
    /// Largest residual of an orbit when the iteration stalls, as a fraction of the orbit's scale
    /// (its largest entry). Set it to the accuracy of the map; the final residual is normally much
    /// smaller.
    pub residual_tolerance: f64,
    /// Newton's method stops if the linearised return at the current points stretches some
    /// direction by more than this factor (dimensionless): the orbits nearby are unstable. Infinite
    /// to find unstable orbits too.
    pub max_growth: f64,
    /// Whether to compute the multipliers after a stall, to report a multiplier near +1 as the
    /// reason.
    pub explains_stalls: bool,
}

impl Default for ShootingOptions {
    fn default() -> Self {
        Self {
            max_iterations: 40,
            min_damping: 1.0 / 256.0,
            residual_tolerance: 1e-10,
            max_growth: f64::INFINITY,
            explains_stalls: true,
        }
    }
}

/// Why no orbit was found.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ShootingError {
    /// The guess does not fit the map.
    #[error("invalid initial guess: {0}")]
    BadGuess(String),
    /// The Jacobians of the orbit would need gigabytes of memory.
    #[error(
        "an orbit of period {period} in {dimension} variables needs too much memory; the largest period is {limit}"
    )]
    TooLarge {
        /// Requested period, in drive periods.
        period: usize,
        /// Number of entries of a state.
        dimension: usize,
        /// Longest period for this dimension.
        limit: usize,
    },
    /// The map failed at the guess.
    #[error("the map failed at the initial guess")]
    Map(#[from] MapFailure),
    /// Newton stalled where there is no orbit.
    #[error(
        "Newton found no period-{period} orbit: residual {residual:.3e} after {iterations} steps ({reason})"
    )]
    Diverged {
        /// Requested period, in drive periods.
        period: usize,
        /// Number of Newton steps until the stall.
        iterations: usize,
        /// Largest entry of the final residual, in units of the state.
        residual: f64,
        /// The reason why Newton's method stalled.
        reason: DivergenceReason,
    },
    /// The orbit is not isolated to rounding: a multiplier is too near +1.
    #[error(
        "the period-{period} orbit is not isolated: the multiplier nearest +1 is {distance:.3e} from it (residual {residual:.3e})"
    )]
    Singular {
        /// Requested period, in drive periods.
        period: usize,
        /// Distance of the nearest multiplier from +1 where Newton stopped.
        distance: f64,
        /// Largest entry of the residual there, in units of the state.
        residual: f64,
    },
    /// The multipliers of a closed orbit could not be computed.
    #[error(transparent)]
    Multipliers(#[from] MultiplierError),
}

/// Why a Newton iteration stalled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DivergenceReason {
    /// No fraction of the step lowers the residual.
    #[error("no step lowers the residual")]
    NoDescent,
    /// The largest number of steps was reached.
    #[error("too many steps")]
    TooManySteps,
    /// Only unstable orbits are nearby, and [`ShootingOptions::max_growth`] excludes them.
    #[error("only unstable orbits are near")]
    Unstable,
}

/// Finds an orbit of period `period` near the trajectory from `guess` (length: dimension of the
/// map). The returned orbit has its minimal period, which may divide `period`.
///
/// # Errors
/// See [`ShootingError`].
pub fn close_orbit<M: StroboscopicMap>(
    map: &mut M,
    guess: &[f64],
    period: usize,
    options: &ShootingOptions,
) -> Result<PeriodicOrbit, ShootingError> {
    check(map, guess, 1, period)?;
    let d = guess.len();
    let mut points = Vec::with_capacity(period * d);
    let mut state = guess.to_vec();
    for k in 0..period {
        points.extend_from_slice(&state);
        if k + 1 < period {
            advance(map, &mut state)?;
        }
    }
    close_orbit_from_points(map, &points, period, options)
}

/// As [`close_orbit`], from guesses for all strobe points, row by row (`period × dimension`
/// values).
///
/// # Errors
/// See [`ShootingError`].
pub fn close_orbit_from_points<M: StroboscopicMap>(
    map: &mut M,
    points: &[f64],
    period: usize,
    options: &ShootingOptions,
) -> Result<PeriodicOrbit, ShootingError> {
    check(map, points, period, period)?;
    let mut newton = Segments::new(map.dimension(), period);
    newton.points.copy_from_slice(points);
    newton.converge(map, options)?;
    newton.into_minimal_orbit(map, options)
}

/// Largest number of entries of the Jacobians of all periods of an orbit: Newton stores several
/// times as many.
const MAX_ENTRIES: usize = 1 << 24;

/// Checks that the Jacobians of an orbit fit into memory.
///
/// # Errors
/// [`ShootingError::TooLarge`].
pub fn check_size(dimension: usize, period: usize) -> Result<(), ShootingError> {
    let limit = MAX_ENTRIES / (dimension * dimension).max(1);
    if period > limit {
        return Err(ShootingError::TooLarge {
            period,
            dimension,
            limit,
        });
    }
    Ok(())
}

fn check<M: StroboscopicMap>(
    map: &M,
    values: &[f64],
    rows: usize,
    period: usize,
) -> Result<(), ShootingError> {
    let d = map.dimension();
    if d == 0 || period == 0 {
        return Err(ShootingError::BadGuess(format!(
            "dimension {d} and period {period} must both be at least 1"
        )));
    }
    check_size(d, period)?;
    if values.len() != rows * d {
        return Err(ShootingError::BadGuess(format!(
            "got {} numbers, expected {} ({rows} states of dimension {d})",
            values.len(),
            rows * d
        )));
    }
    if let Some(bad) = values.iter().find(|v| !v.is_finite()) {
        return Err(ShootingError::BadGuess(format!("{bad} is not finite")));
    }
    Ok(())
}

/// Residual, in units of the orbit's scale, below which a final Newton step is accepted without a
/// check: the remaining error is rounding.
pub(crate) const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// Largest final step in the same units: its square is rounding. A longer step is the noise of a
/// poorly determined orbit.
pub(crate) const MAX_FINAL_STEP: f64 = 1e-8;

/// Largest number of updates of the discrete entries at one place. If they do not settle, the
/// residual shows it.
pub(crate) const MAX_DISCRETE_UPDATES: usize = 3;

/// Sets the discrete entries of points, those after the `continuous` ones of each, to the values
/// that the map gave at the points before; returns false if nothing changed.
pub(crate) fn set_discrete_entries(
    points: &mut [f64],
    residuals: &[f64],
    d: usize,
    continuous: usize,
) -> bool {
    let n = points.len() / d;
    let mut changed = false;
    for k in 0..n {
        for i in continuous..d {
            let off = residuals[k * d + i];
            if off != 0.0 {
                points[(k + 1) % n * d + i] += off;
                changed = true;
            }
        }
    }
    changed
}

/// Replaces the ends of the periods by their differences from the next points.
pub(crate) fn ends_to_residuals(ends: &mut [f64], points: &[f64], d: usize) {
    let next = points[d..].iter().chain(&points[..d]);
    for (end, next) in ends.iter_mut().zip(next) {
        *end -= next;
    }
}

/// The segments of an orbit with their residuals and Jacobians.
pub(crate) struct Segments {
    pub(crate) d: usize,
    pub(crate) n: usize,
    pub(crate) points: Vec<f64>,
    pub(crate) residuals: Vec<f64>,
    pub(crate) jacobians: Vec<DMatrix<f64>>,
    /// Largest entry of any state, including the guess: an orbit at the origin has no scale.
    pub(crate) scale: f64,
    /// Number of trailing entries of a state that are whole numbers set by the map.
    pub(crate) discrete: usize,
}

impl Segments {
    pub(crate) fn new(d: usize, n: usize) -> Self {
        Self {
            d,
            n,
            points: vec![0.0; n * d],
            residuals: vec![0.0; n * d],
            jacobians: vec![DMatrix::zeros(d, d); n],
            scale: 0.0,
            discrete: 0,
        }
    }

    /// Residuals, and Jacobians on request, at the current points. Discrete entries are set to the
    /// values that the map gives.
    fn evaluate<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        jacobians: bool,
    ) -> Result<(), MapFailure> {
        self.discrete = map.discrete_entries();
        self.evaluate_points(map, jacobians)?;
        for _ in 0..MAX_DISCRETE_UPDATES {
            let continuous = self.d - self.discrete;
            if !set_discrete_entries(&mut self.points, &self.residuals, self.d, continuous) {
                break;
            }
            self.evaluate_points(map, jacobians)?;
        }
        Ok(())
    }

    fn evaluate_points<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        jacobians: bool,
    ) -> Result<(), MapFailure> {
        self.residuals.copy_from_slice(&self.points);
        let ends = self.residuals.chunks_exact_mut(self.d);
        let mut periods: Vec<_> = ends.zip(&mut self.jacobians).collect();
        for_each_period(map, &mut periods, &|map, (state, jacobian)| {
            if jacobians {
                advance_with_jacobian(map, state, jacobian)
            } else {
                advance(map, state)
            }
        })?;
        ends_to_residuals(&mut self.residuals, &self.points, self.d);
        Ok(())
    }

    /// Adds `step` to the continuous entries of the points.
    fn take(&mut self, step: &[f64]) {
        let steps = step.chunks_exact(self.d);
        for (point, step) in self.points.chunks_exact_mut(self.d).zip(steps) {
            for (x, s) in point.iter_mut().zip(step).take(self.d - self.discrete) {
                *x += s;
            }
        }
    }

    /// Newton's method until rounding prevents progress.
    fn converge<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        options: &ShootingOptions,
    ) -> Result<(), ShootingError> {
        let mut trial = Self::new(self.d, self.n);
        let mut system = BlockCyclic::new(self.d, self.n);
        let mut step = vec![0.0; self.points.len()];
        self.scale = self.scale.max(norm(&self.points));
        self.evaluate(map, true)?;
        for iteration in 0..options.max_iterations {
            let residual = norm(&self.residuals);
            if residual == 0.0 {
                return Ok(());
            }
            let small = residual <= options.residual_tolerance * self.scale;
            if !small && options.max_growth.is_finite() && self.growth() > options.max_growth {
                return Err(self.diverged(iteration, DivergenceReason::Unstable));
            }
            system.factor(&self.jacobians, &self.residuals, None);
            if system.solve(&mut step).is_none() || step.iter().any(|v| !v.is_finite()) {
                return Err(self.singular(residual));
            }
            if residual <= ROUNDING * self.scale {
                if norm(&step) <= MAX_FINAL_STEP * self.scale {
                    self.take(&step);
                }
                return Ok(());
            }
            let merit = sum_of_squares(&self.residuals);
            let mut damping = 1.0;
            loop {
                for ((t, x), s) in trial.points.iter_mut().zip(&self.points).zip(&step) {
                    *t = x + damping * s;
                }
                // A map that fails at the trial point is a reason to shorten the step. A full step
                // usually succeeds; for a shorter one the Jacobians are computed after it has been
                // accepted.
                let full = damping == 1.0;
                let wanted = 1.0 - 0.5 * damping;
                let lowered = trial.evaluate(map, full).is_ok()
                    && sum_of_squares(&trial.residuals) < wanted * wanted * merit
                    && (full || trial.evaluate(map, true).is_ok());
                if lowered {
                    trial.scale = self.scale.max(norm(&trial.points));
                    std::mem::swap(self, &mut trial);
                    break;
                }
                if small {
                    // At rounding level a full step no longer halves the residual.
                    return Ok(());
                }
                damping *= 0.5;
                if damping < options.min_damping {
                    return Err(self.stalled(iteration, DivergenceReason::NoDescent, options));
                }
            }
        }
        let residual = norm(&self.residuals);
        if residual <= options.residual_tolerance * self.scale {
            Ok(())
        } else {
            Err(self.stalled(
                options.max_iterations,
                DivergenceReason::TooManySteps,
                options,
            ))
        }
    }

    /// Growth of the length of a vector in the second of two linearised returns: close to the
    /// largest modulus of the multipliers, or above it if the monodromy matrix is not normal.
    fn growth(&self) -> f64 {
        let d = self.d;
        let mut v: Vec<f64> = (0..d).map(|i| 1.0 + (mix(i as u64) & 7) as f64).collect();
        let mut image = vec![0.0; d];
        let mut logarithm = 0.0;
        for turn in 0..2 {
            for jacobian in &self.jacobians {
                image.fill(0.0);
                for (column, x) in jacobian.as_slice().chunks_exact(d).zip(&v) {
                    for (o, a) in image.iter_mut().zip(column) {
                        *o += a * x;
                    }
                }
                let length = sum_of_squares(&image).sqrt();
                if length < f64::MIN_POSITIVE {
                    return 0.0;
                }
                if turn == 1 {
                    logarithm += nanotap_arithmetic::ln(length);
                }
                for (x, o) in v.iter_mut().zip(&image) {
                    *x = o / length;
                }
            }
        }
        nanotap_arithmetic::exp(logarithm)
    }

    fn distance_from_one(&self) -> f64 {
        Multipliers::of_product(&self.jacobians).map_or(f64::NAN, |m| {
            m.values
                .iter()
                .fold(f64::INFINITY, |best, v| best.min((v - 1.0).modulus()))
        })
    }

    fn singular(&self, residual: f64) -> ShootingError {
        ShootingError::Singular {
            period: self.n,
            distance: self.distance_from_one(),
            residual,
        }
    }

    fn stalled(
        &self,
        iterations: usize,
        reason: DivergenceReason,
        options: &ShootingOptions,
    ) -> ShootingError {
        if !options.explains_stalls {
            return self.diverged(iterations, reason);
        }
        // A stall near a multiplier +1 is typical of a fold just passed.
        let distance = self.distance_from_one();
        if distance < 1e-6 {
            return ShootingError::Singular {
                period: self.n,
                distance,
                residual: norm(&self.residuals),
            };
        }
        self.diverged(iterations, reason)
    }

    fn diverged(&self, iterations: usize, reason: DivergenceReason) -> ShootingError {
        ShootingError::Diverged {
            period: self.n,
            iterations,
            residual: norm(&self.residuals),
            reason,
        }
    }

    /// Estimated distance of the points from the exact orbit: the Newton corrections for the
    /// residual and for a rounding error in every entry of every period.
    pub(crate) fn error_estimate(&self) -> Option<f64> {
        let noise = self.rounding();
        let mut system = BlockCyclic::new(self.d, self.n);
        let mut step = vec![0.0; self.points.len()];
        let mut error = f64::EPSILON * self.scale;
        for sample in 0..3u64 {
            let right: Vec<f64> = (0..self.points.len())
                .map(|i| {
                    if sample == 0 {
                        self.residuals[i]
                    } else if mix(sample << 32 | i as u64) & 1 == 0 {
                        noise[i]
                    } else {
                        -noise[i]
                    }
                })
                .collect();
            system.factor(&self.jacobians, &right, None);
            system.solve(&mut step)?;
            if step.iter().any(|v| !v.is_finite()) {
                return None;
            }
            error = error.max(norm(&step));
        }
        Some(error)
    }

    /// Rounding error of each entry of each P(x_k): some tens of operations on every entry of x_k,
    /// multiplied by DP, and on the result.
    fn rounding(&self) -> Vec<f64> {
        let (d, n) = (self.d, self.n);
        let mut noise = vec![0.0; n * d];
        for k in 0..n {
            let state = &self.points[k * d..(k + 1) * d];
            let next = (k + 1) % n;
            for i in 0..d {
                let row = self.jacobians[k].row(i);
                let carried: f64 = row.iter().zip(state).map(|(a, x)| (a * x).abs()).sum();
                noise[k * d + i] =
                    32.0 * f64::EPSILON * (carried + self.points[next * d + i].abs());
            }
        }
        noise
    }

    /// The orbit with its minimal period, multipliers and error estimate.
    fn into_minimal_orbit<M: StroboscopicMap>(
        self,
        map: &mut M,
        options: &ShootingOptions,
    ) -> Result<PeriodicOrbit, ShootingError> {
        let (d, n) = (self.d, self.n);
        let residual = norm(&self.residuals);
        let error = self.error_estimate();
        let reach = error.map(|e| 100.0 * e);
        for m in (1..n).filter(|m| n.is_multiple_of(*m)) {
            let apart = (0..n)
                .map(|k| {
                    let later = (k + m) % n;
                    distance(
                        &self.points[k * d..(k + 1) * d],
                        &self.points[later * d..(later + 1) * d],
                    )
                })
                .fold(0.0, f64::max);
            if reach.is_some_and(|reach| apart > reach) {
                continue;
            }
            let mut shorter = Self::new(d, m);
            shorter.points.copy_from_slice(&self.points[..m * d]);
            shorter.scale = self.scale;
            let closed = shorter
                .converge(map, options)
                .and_then(|()| shorter.into_minimal_orbit(map, options));
            if let Ok(orbit) = closed {
                let near = 2.0 * apart + 100.0 * orbit.error + 1e-6 * self.scale;
                if distance(&orbit.states[0], &self.points[..d]) <= near {
                    return Ok(orbit);
                }
            }
            if reach.is_some() {
                // The orbit is neither clearly of shorter period nor clearly not.
                return Err(self.singular(residual));
            }
        }
        let error = error.ok_or_else(|| self.singular(residual))?;
        if error > 1e-3 * self.scale {
            return Err(self.singular(residual));
        }
        self.into_orbit(residual, error)
    }

    pub(crate) fn into_orbit(
        self,
        residual: f64,
        error: f64,
    ) -> Result<PeriodicOrbit, ShootingError> {
        let multipliers = Multipliers::of_product(&self.jacobians)?;
        Ok(PeriodicOrbit {
            period: self.n,
            states: self.points.chunks(self.d).map(<[f64]>::to_vec).collect(),
            residual,
            error,
            stability: multipliers.stability(),
            margin: multipliers.margin,
            multipliers: multipliers.values,
            log_determinant: multipliers.log_determinant,
            discrete: self.discrete,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segments(d: usize, jacobians: &[DMatrix<f64>]) -> Segments {
        let mut segments = Segments::new(d, jacobians.len());
        segments.jacobians = jacobians.to_vec();
        segments
    }

    /// Three points of two numbers and a flag: the flag that the map returns for one point belongs
    /// to the next, and that of the last point to the first.
    #[test]
    fn flags_go_to_the_point_that_follows() {
        let mut points = [1.0, 2.0, 0.0, 3.0, 4.0, 1.0, 5.0, 6.0, 0.0];
        let residuals = [0.5, 0.5, 0.0, 0.5, 0.5, 1.0, 0.5, 0.5, 1.0];
        assert!(set_discrete_entries(&mut points, &residuals, 3, 2));
        assert_eq!(points, [1.0, 2.0, 1.0, 3.0, 4.0, 1.0, 5.0, 6.0, 1.0]);
        let settled = [0.5, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5, 0.5, 0.0];
        assert!(!set_discrete_entries(&mut points, &settled, 3, 2));
    }

    /// A scaled rotation stretches every vector by the same factor. A matrix of rank one maps all
    /// vectors to one direction in the first return and stretches it by its trace in the second.
    #[test]
    fn growth_of_known_products() {
        let turn = |size: f64| DMatrix::from_row_slice(2, 2, &[0.6, -0.8, 0.8, 0.6]) * size;
        let growth = segments(2, &[turn(3.0), turn(0.5), turn(7.0)]).growth();
        assert!((growth - 10.5).abs() < 1e-13, "{growth}");
        let rank_one = DMatrix::from_row_slice(2, 2, &[2.0, 6.0, 1.0, 3.0]);
        let growth = segments(2, &[rank_one]).growth();
        assert!((growth - 5.0).abs() < 1e-13, "{growth}");
        assert_eq!(segments(2, &[turn(0.0), turn(1.0)]).growth(), 0.0);
    }

    #[test]
    fn the_multiplier_nearest_one() {
        let diagonal = DMatrix::from_row_slice(2, 2, &[-1.0, 0.0, 0.0, 0.25]);
        assert_eq!(segments(2, &[diagonal]).distance_from_one(), 0.75);
    }

    /// 32 ε (|DP| |x| + |P(x)|), entry by entry.
    #[test]
    fn rounding_of_every_entry() {
        let first = DMatrix::from_row_slice(2, 2, &[1.0, -2.0, 0.5, 4.0]);
        let second = DMatrix::from_row_slice(2, 2, &[0.0, 8.0, -1.0, 0.25]);
        let mut two = segments(2, &[first, second]);
        two.points = vec![3.0, -5.0, 7.0, 11.0];
        let expected = [13.0 + 7.0, 21.5 + 11.0, 88.0 + 3.0, 9.75 + 5.0];
        assert_eq!(two.rounding(), expected.map(|e| e * 32.0 * f64::EPSILON));
    }

    /// x → a x + c: a residual r or a rounding error r moves the fixed point by r/|1 − a|.
    #[test]
    fn the_error_is_the_answer_to_residual_and_rounding() {
        let mut one = segments(1, &[DMatrix::from_element(1, 1, 0.5)]);
        one.points = vec![2.0];
        one.scale = 2.0;
        let rounding = 2.0 * 32.0 * f64::EPSILON * 3.0;
        assert_eq!(one.error_estimate(), Some(rounding));
        one.residuals = vec![-1e-3];
        assert_eq!(one.error_estimate(), Some(2e-3));
        one.jacobians[0][(0, 0)] = 1.0;
        assert_eq!(one.error_estimate(), None);
    }
}
