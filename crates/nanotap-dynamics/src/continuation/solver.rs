//! One point of a branch: bordered Newton corrector and tangent.
//!
//! The unknowns are all strobe points and the parameter. The border is a plane in (x_0, λ), scaled
//! by a state scale and a parameter scale. The tangent follows from (DP − 1, ∂P/∂λ) with the
//! previous tangent as border, which preserves its orientation.

use nalgebra::{DMatrix, DVector};

use crate::failure::{MapFailure, advance_with_tangencies, finite};
use crate::map::{MapFamily, StroboscopicMap};
use crate::orbit::PeriodicOrbit;
use crate::orbit::block_cyclic::BlockCyclic;
use crate::orbit::multipliers;
use crate::orbit::parallel::for_each_period;
use crate::orbit::shooting::{
    MAX_DISCRETE_UPDATES, MAX_FINAL_STEP, ROUNDING, Segments, ShootingError, ends_to_residuals,
    set_discrete_entries,
};
use crate::vector::{difference, dot, norm};

/// Newton steps after which the corrector fails; the caller then shortens its step.
const MAX_ITERATIONS: usize = 12;

/// A local extremum of a switching function on an orbit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrbitTangency {
    /// Time in drive periods from the first state of the orbit: 0 ≤ time < period.
    pub time: f64,
    /// Value of the switching function at the extremum, in its own unit; zero at a grazing.
    pub value: f64,
}

/// A solution with its tangent.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) parameter: f64,
    pub(crate) points: Vec<f64>,
    pub(crate) jacobians: Vec<DMatrix<f64>>,
    pub(crate) residual: f64,
    /// Derivative of all points with respect to scaled arclength.
    pub(crate) tangent: Vec<f64>,
    /// Derivative of the parameter with respect to scaled arclength.
    pub(crate) slope: f64,
    pub(crate) iterations: usize,
}

impl Node {
    /// All points, and the parameter.
    pub(crate) fn solution(&self) -> (&[f64], f64) {
        (&self.points, self.parameter)
    }

    /// The prediction a step along the tangent.
    pub(crate) fn ahead(&self, step: f64) -> (Vec<f64>, f64) {
        let points = self.points.iter().zip(&self.tangent);
        (
            points.map(|(x, t)| x + step * t).collect(),
            self.parameter + step * self.slope,
        )
    }
}

/// The reason why the corrector found no point.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum CorrectorFailure {
    #[error(transparent)]
    Map(#[from] MapFailure),
    #[error("the corrector did not converge")]
    NoConvergence,
    #[error("the bordered system is singular")]
    Singular,
}

/// Work space and scales for branches of one period.
pub(crate) struct BranchSolver<'a, F: MapFamily> {
    pub(crate) family: &'a F,
    pub(crate) d: usize,
    /// Number of continuous entries of a state. The entries after them are whole numbers that the
    /// map sets.
    pub(crate) continuous: usize,
    pub(crate) n: usize,
    pub(crate) state_scale: f64,
    pub(crate) parameter_scale: f64,
    /// Residual, in units of the orbit's scale, at which a stalled corrector is accepted.
    tolerance: f64,
    points: Vec<f64>,
    residuals: Vec<f64>,
    derivatives: Vec<f64>,
    jacobians: Vec<DMatrix<f64>>,
    step: Vec<f64>,
    system: BlockCyclic,
    /// The map at the last parameter value.
    map: Option<(f64, F::Map)>,
    /// Whether the map passes through rigid stops that are hardly touched.
    pub(crate) passes_touches: bool,
}

impl<'a, F: MapFamily> BranchSolver<'a, F> {
    pub(crate) fn new(
        family: &'a F,
        d: usize,
        continuous: usize,
        n: usize,
        state_scale: f64,
        parameter_scale: f64,
        tolerance: f64,
    ) -> Self {
        Self {
            family,
            d,
            continuous,
            n,
            state_scale,
            parameter_scale,
            tolerance,
            points: vec![0.0; n * d],
            residuals: vec![0.0; n * d],
            derivatives: vec![0.0; n * d],
            jacobians: vec![DMatrix::zeros(d, d); n],
            step: vec![0.0; n * d],
            system: BlockCyclic::new(d, n),
            map: None,
            passes_touches: false,
        }
    }

    /// Another solver with the same scales.
    pub(crate) fn another(&self) -> Self {
        Self::new(
            self.family,
            self.d,
            self.continuous,
            self.n,
            self.state_scale,
            self.parameter_scale,
            self.tolerance,
        )
    }

    /// Largest continuous entry of any state.
    pub(crate) fn size(&self, points: &[f64]) -> f64 {
        let states = points.chunks(self.d);
        states.fold(0.0, |size, state| size.max(norm(&state[..self.continuous])))
    }

    /// The map at `parameter`, created unless it is the last one.
    fn map_at<'b>(
        family: &F,
        known: &'b mut Option<(f64, F::Map)>,
        parameter: f64,
        passes_touches: bool,
    ) -> Result<&'b mut F::Map, MapFailure> {
        let map = match known.take() {
            Some((at, map)) if at == parameter => map,
            _ => {
                let mut map = family.at(parameter).map_err(MapFailure::refused)?;
                if passes_touches {
                    map.pass_touches();
                }
                map
            }
        };
        Ok(&mut known.insert((parameter, map)).1)
    }

    /// Evaluates the map at the present points and returns the largest residual. Discrete entries
    /// are set to the values that the map gives.
    fn evaluate(&mut self, parameter: f64) -> Result<f64, MapFailure> {
        let mut residual = self.evaluate_points(parameter)?;
        for _ in 0..MAX_DISCRETE_UPDATES {
            if !set_discrete_entries(&mut self.points, &self.residuals, self.d, self.continuous) {
                break;
            }
            residual = self.evaluate_points(parameter)?;
        }
        Ok(residual)
    }

    fn evaluate_points(&mut self, parameter: f64) -> Result<f64, MapFailure> {
        let (d, family) = (self.d, self.family);
        let map = Self::map_at(family, &mut self.map, parameter, self.passes_touches)?;
        self.residuals.copy_from_slice(&self.points);
        let ends = self.residuals.chunks_exact_mut(d);
        let derivatives = self.derivatives.chunks_exact_mut(d);
        let mut periods: Vec<_> = ends.zip(derivatives).zip(&mut self.jacobians).collect();
        for_each_period(
            map,
            &mut periods,
            &|map, ((state, derivative), jacobian)| {
                family
                    .advance_with_derivatives(parameter, map, state, jacobian, derivative)
                    .map_err(MapFailure::refused)?;
                finite(state)?;
                finite(jacobian.as_slice())
            },
        )?;
        ends_to_residuals(&mut self.residuals, &self.points, d);
        finite(&self.derivatives)?;
        Ok(norm(&self.residuals))
    }

    /// Scaled scalar product of two directions in (x_0, λ).
    pub(crate) fn product(&self, a: &[f64], slope_a: f64, b: &[f64], slope_b: f64) -> f64 {
        let c = self.continuous;
        dot(&a[..c], &b[..c]) / (self.state_scale * self.state_scale)
            + slope_a * slope_b / (self.parameter_scale * self.parameter_scale)
    }

    /// The bordering row that measures the component along a direction.
    fn row(&self, tangent: &[f64], slope: f64) -> (Vec<f64>, f64) {
        let square = self.state_scale * self.state_scale;
        let mut row: Vec<f64> = tangent[..self.d].iter().map(|t| t / square).collect();
        row[self.continuous..].fill(0.0);
        (row, slope / (self.parameter_scale * self.parameter_scale))
    }

    /// The solution at a given parameter near `points`. Its tangent points towards larger
    /// parameters if `rising`.
    pub(crate) fn at_parameter(
        &mut self,
        points: &[f64],
        parameter: f64,
        rising: bool,
    ) -> Result<Node, CorrectorFailure> {
        let row = vec![0.0; self.d];
        let sign = if rising { 1.0 } else { -1.0 };
        self.correct(points, parameter, &row, 1.0, &row, sign)
    }

    /// The solution at scaled arclength `step` along the tangent of `from`.
    pub(crate) fn along(&mut self, from: &Node, step: f64) -> Result<Node, CorrectorFailure> {
        let (points, parameter) = from.ahead(step);
        let (row, corner) = self.row(&from.tangent, from.slope);
        self.correct(&points, parameter, &row, corner, &row, corner)
    }

    /// As [`Self::along`], started on the cubic through two neighbouring nodes of the branch, or on
    /// the tangent if that fails.
    pub(crate) fn along_cubic(
        &mut self,
        from: &Node,
        step: f64,
        through: [&Node; 2],
    ) -> Result<Node, CorrectorFailure> {
        let begun = self.on_cubic(from, step, through);
        let (row, corner) = self.row(&from.tangent, from.slope);
        begun
            .and_then(|(points, parameter)| {
                self.correct(&points, parameter, &row, corner, &row, corner)
                    .ok()
            })
            .map_or_else(|| self.along(from, step), Ok)
    }

    /// Hermite's cubic through two nodes with their tangents, at scaled arclength `step` along the
    /// tangent of `from`. `None` if a tangent is nearly perpendicular to that of `from`.
    fn on_cubic(&self, from: &Node, step: f64, [a, b]: [&Node; 2]) -> Option<(Vec<f64>, f64)> {
        // Smallest cosine of the angle between the tangents.
        const MIN_COSINE: f64 = 0.5;
        let rate = |node: &Node| self.product(&node.tangent, node.slope, &from.tangent, from.slope);
        let (rate_a, rate_b) = (rate(a), rate(b));
        if !(rate_a >= MIN_COSINE && rate_b >= MIN_COSINE) {
            return None;
        }
        let (at_a, at_b) = (self.projection(from, a), self.projection(from, b));
        let length = at_b - at_a;
        let t = (step - at_a) / length;
        if !t.is_finite() {
            return None;
        }
        let (left, right) = ((1.0 - t) * (1.0 - t), t * t);
        let weights = [
            (1.0 + 2.0 * t) * left,
            t * left * length / rate_a,
            (3.0 - 2.0 * t) * right,
            (t - 1.0) * right * length / rate_b,
        ];
        let cubic = |terms: [f64; 4]| dot(&weights, &terms);
        let points = (0..a.points.len()).map(|i| {
            if i % self.d < self.continuous {
                cubic([a.points[i], a.tangent[i], b.points[i], b.tangent[i]])
            } else {
                from.points[i]
            }
        });
        Some((
            points.collect(),
            cubic([a.parameter, a.slope, b.parameter, b.slope]),
        ))
    }

    /// Scaled arclength from one node to the next, along the tangent of the first.
    pub(crate) fn projection(&self, from: &Node, to: &Node) -> f64 {
        self.product(
            &difference(&to.points, &from.points),
            to.parameter - from.parameter,
            &from.tangent,
            from.slope,
        )
    }

    /// As [`Self::along`], but in the plane of this parameter value, oriented as `from`.
    pub(crate) fn onto_parameter(
        &mut self,
        from: &Node,
        parameter: f64,
    ) -> Result<Node, CorrectorFailure> {
        let step = (parameter - from.parameter) / from.slope;
        let (points, _) = from.ahead(step);
        let plane = vec![0.0; self.d];
        let (row, corner) = self.row(&from.tangent, from.slope);
        self.correct(&points, parameter, &plane, 1.0, &row, corner)
    }

    /// Measures the arc in units of this orbit's size from now on, with `least` as the smallest
    /// unit: otherwise no number of steps would reach an orbit that shrinks to a point.
    pub(crate) fn rescale(&mut self, node: &mut Node, least: f64) {
        let scale = self.size(&node.points).max(least);
        if scale > 0.0 {
            self.state_scale = scale;
            let length = self
                .product(&node.tangent, node.slope, &node.tangent, node.slope)
                .sqrt();
            for t in &mut node.tangent {
                *t /= length;
            }
            node.slope /= length;
        }
    }

    /// Newton in the plane where `row`·(x_0, λ) keeps its value at the prediction. The tangent has
    /// a positive component along the orientation.
    fn correct(
        &mut self,
        points: &[f64],
        parameter: f64,
        row: &[f64],
        corner: f64,
        orientation: &[f64],
        orientation_corner: f64,
    ) -> Result<Node, CorrectorFailure> {
        self.points.copy_from_slice(points);
        // In a plane of constant parameter, rounding must not change the parameter.
        let fixed = row.iter().all(|r| *r == 0.0);
        let mut parameter = parameter;
        let mut residual = self.evaluate(parameter)?;
        let scale = self.state_scale.max(self.size(points));
        let mut iterations = 0;
        loop {
            self.system
                .factor(&self.jacobians, &self.residuals, Some(&self.derivatives));
            let change = self
                .system
                .solve_bordered(row, corner, 0.0, true, &mut self.step);
            let closed = residual <= ROUNDING * scale;
            if closed && (change.is_none() || norm(&self.step) > MAX_FINAL_STEP * scale) {
                break;
            }
            let change = change.ok_or(CorrectorFailure::Singular)?;
            let steps = self.step.chunks_exact(self.d);
            for (point, step) in self.points.chunks_exact_mut(self.d).zip(steps) {
                for (x, s) in point.iter_mut().zip(step).take(self.continuous) {
                    *x += s;
                }
            }
            if !fixed {
                parameter += change;
            }
            if !parameter.is_finite() || self.points.iter().any(|v| !v.is_finite()) {
                return Err(CorrectorFailure::Singular);
            }
            if closed {
                break;
            }
            if iterations == MAX_ITERATIONS {
                return Err(CorrectorFailure::NoConvergence);
            }
            iterations += 1;
            let before = residual;
            residual = self.evaluate(parameter)?;
            let stalled = residual > 0.5 * before;
            // A step across a jump of the map does not stall because of rounding.
            let small = before.max(residual) <= self.tolerance * scale;
            if stalled && small {
                self.system
                    .factor(&self.jacobians, &self.residuals, Some(&self.derivatives));
                break;
            }
            if residual > before {
                return Err(CorrectorFailure::NoConvergence);
            }
        }
        let mut tangent = vec![0.0; self.n * self.d];
        let slope = self
            .system
            .solve_bordered(orientation, orientation_corner, 1.0, false, &mut tangent)
            .ok_or(CorrectorFailure::Singular)?;
        let length = self.product(&tangent, slope, &tangent, slope).sqrt();
        if !(length.is_finite() && length > 0.0) {
            return Err(CorrectorFailure::Singular);
        }
        for t in &mut tangent {
            *t /= length;
        }
        Ok(Node {
            parameter,
            points: self.points.clone(),
            jacobians: self.jacobians.clone(),
            residual,
            tangent,
            slope: slope / length,
            iterations,
        })
    }

    /// Jacobian of all periods together, of the continuous entries, from the first state of a node or
    /// from a state displaced from it.
    pub(crate) fn monodromy(
        &mut self,
        node: &Node,
        displacement: Option<&DVector<f64>>,
    ) -> Option<DMatrix<f64>> {
        let touches = self.passes_touches;
        let map = Self::map_at(self.family, &mut self.map, node.parameter, touches).ok()?;
        let mut state = node.points[..self.d].to_vec();
        // Discrete entries stay.
        for (x, by) in state.iter_mut().zip(displacement.into_iter().flatten()) {
            *x += by;
        }
        multipliers::monodromy(map, &state, self.n)
    }

    /// All tangencies of an orbit, in order of time.
    pub(crate) fn tangencies(&mut self, node: &Node) -> Result<Vec<OrbitTangency>, MapFailure> {
        self.tangencies_at(node.parameter, &node.points)
    }

    /// Every tangency of the orbit through these points, in order of time.
    pub(crate) fn tangencies_at(
        &mut self,
        parameter: f64,
        points: &[f64],
    ) -> Result<Vec<OrbitTangency>, MapFailure> {
        let (family, touches) = (self.family, self.passes_touches);
        let map = Self::map_at(family, &mut self.map, parameter, touches)?;
        let points = points.chunks_exact(self.d);
        let mut periods: Vec<_> = points.map(|point| (point.to_vec(), Vec::new())).collect();
        for_each_period(map, &mut periods, &|map, (state, found)| {
            advance_with_tangencies(map, state, found)
        })?;
        let found = periods.iter().enumerate().flat_map(|(k, (_, found))| {
            found.iter().map(move |t| OrbitTangency {
                time: k as f64 + t.phase,
                value: t.value,
            })
        });
        Ok(found.collect())
    }

    /// The orbit of a node, with multipliers and error estimate.
    pub(crate) fn orbit(&self, node: &Node) -> Result<PeriodicOrbit, ShootingError> {
        let mut segments = Segments::new(self.d, self.n);
        segments.discrete = self.d - self.continuous;
        segments.points.copy_from_slice(&node.points);
        segments.jacobians.clone_from_slice(&node.jacobians);
        segments.scale = self.state_scale.max(self.size(&node.points));
        // At a fold the parameter does not determine the orbit: the error estimate must show it.
        let error = segments
            .error_estimate()
            .unwrap_or(f64::INFINITY)
            .max(node.residual);
        segments.into_orbit(node.residual, error)
    }

    /// Difference of the states `m` periods apart, without discrete entries.
    pub(crate) fn gap(&self, node: &Node, m: usize) -> Vec<f64> {
        let state = |k: usize| &node.points[k * self.d..][..self.continuous];
        difference(state(0), state(m))
    }

    /// Scaled distance of two solutions in (all points, λ).
    pub(crate) fn separation(&self, a: (&[f64], f64), b: (&[f64], f64)) -> f64 {
        let points = self.size(&difference(a.0, b.0));
        (points / self.state_scale).max((a.1 - b.1).abs() / self.parameter_scale)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::convert::Infallible;

    use super::*;

    /// x → r x (1 − x), for the tests of this module.
    #[derive(Clone)]
    pub(crate) struct Logistic(pub(crate) f64);

    impl crate::Scheduling for Logistic {}

    impl StroboscopicMap for Logistic {
        type Error = Infallible;

        fn dimension(&self) -> usize {
            1
        }

        fn period(&self) -> f64 {
            1.0
        }

        fn advance(&mut self, state: &mut [f64]) -> Result<(), Infallible> {
            state[0] *= self.0 * (1.0 - state[0]);
            Ok(())
        }

        fn advance_with_jacobian(
            &mut self,
            state: &mut [f64],
            jacobian: &mut DMatrix<f64>,
        ) -> Result<(), Infallible> {
            jacobian[(0, 0)] = self.0 * (1.0 - 2.0 * state[0]);
            self.advance(state)
        }
    }

    pub(crate) struct LogisticFamily;

    impl MapFamily for LogisticFamily {
        type Map = Logistic;
        type Error = Infallible;

        fn at(&self, parameter: f64) -> Result<Logistic, Infallible> {
            Ok(Logistic(parameter))
        }

        fn advance_with_derivatives(
            &self,
            _parameter: f64,
            map: &mut Logistic,
            state: &mut [f64],
            jacobian: &mut DMatrix<f64>,
            derivative: &mut [f64],
        ) -> Result<(), Infallible> {
            derivative[0] = state[0] * (1.0 - state[0]);
            map.advance_with_jacobian(state, jacobian)
        }
    }

    /// A solver for orbits of period `n` with unit scales of states and parameter.
    pub(crate) fn solver(n: usize) -> BranchSolver<'static, LogisticFamily> {
        BranchSolver::new(&LogisticFamily, 1, 1, n, 1.0, 1.0, 1e-10)
    }

    /// A node without derivatives.
    pub(crate) fn bare(parameter: f64, points: &[f64]) -> Node {
        Node {
            parameter,
            points: points.to_vec(),
            jacobians: Vec::new(),
            residual: 0.0,
            tangent: vec![0.0; points.len()],
            slope: 0.0,
            iterations: 0,
        }
    }

    /// The largest difference in points or parameter, each in its unit.
    #[test]
    fn separations_are_measured_in_their_units() {
        let solver = BranchSolver::new(&LogisticFamily, 1, 1, 2, 4.0, 0.25, 1e-10);
        let (a, b) = ([1.0, 2.0], [3.0, 1.0]);
        assert_eq!(solver.separation((&a, 0.0), (&b, 0.0)), 0.5);
        assert_eq!(solver.separation((&a, 0.5), (&b, 0.25)), 1.0);
    }
}
