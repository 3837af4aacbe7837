//! Curves of bifurcation points in two parameters.
//!
//! Unknown are the first state x of the orbit and both parameters; the equations are
//! Pⁿ(x) = x and one scalar g = 0, followed by pseudo-arclength:
//!
//! | kind | g |
//! |---|---|
//! | fold, crossing | the bordering scalar of DPⁿ − 1 (Govaerts 2000): zero with its determinant, but well scaled |
//! | flip | the same of DPⁿ + 1 |
//! | Neimark–Sacker | |μ|² − 1 of the complex pair nearest the circle |
//! | grazing | the extremum of the switching function, followed in time |
//!
//! DPⁿ and the derivatives with respect to the parameters are exact; the gradient of
//! g is by central differences, which costs Newton some speed but the solution no
//! digit.
//!
//! Fails: at points where two such events meet (a fold or flip at a grazing, where
//! DPⁿ is not differentiable; a Neimark–Sacker curve at its ends, where the pair
//! becomes real) the curve may end with steps too small; DPⁿ is multiplied out, so an
//! orbit along which errors grow by more than about 1e10 is not resolved.

use nalgebra::{DMatrix, DVector};

use crate::continuation::bifurcation::{Bifurcation, BifurcationKind};
use crate::continuation::solver::OrbitTangency;
use crate::continuation::{BranchEnd, ContinuationError};
use crate::control::Control;
use crate::failure::{MapFailure, advance_with_jacobian, advance_with_tangencies, finite};
use crate::map::StroboscopicMap;
use crate::orbit::PeriodicOrbit;
use crate::orbit::multipliers::Multipliers;
use crate::orbit::shooting::Segments;
use crate::vector::{distance, norm, unit};

/// A two-parameter family of stroboscopic maps.
pub trait TwoParameterFamily: Sync {
    /// The map at one pair of values.
    type Map: StroboscopicMap;
    /// Why there is no map at a pair of values.
    type Error: std::error::Error + Send + Sync + 'static;

    /// The map at a pair of values.
    ///
    /// # Errors
    /// When the values make no sense for the system.
    fn at(&self, first: f64, second: f64) -> Result<Self::Map, Self::Error>;

    /// Replaces `state` by `P(state)`, `jacobian` by `∂P/∂state` and the two
    /// derivatives (length `dimension` each) by `∂P/∂first` and `∂P/∂second`. `map`
    /// is `self.at(parameters[0], parameters[1])`.
    ///
    /// # Errors
    /// When the period cannot be computed from this state.
    fn advance_with_derivatives(
        &self,
        parameters: [f64; 2],
        map: &mut Self::Map,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivatives: [&mut [f64]; 2],
    ) -> Result<(), <Self::Map as StroboscopicMap>::Error>;
}

/// How a locus is followed. Steps are fractions of the box of parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct LocusOptions {
    /// Range of the first parameter, lower end first.
    pub first: (f64, f64),
    /// Range of the second parameter.
    pub second: (f64, f64),
    /// First step.
    pub initial_step: f64,
    /// Shortest step.
    pub min_step: f64,
    /// Longest step.
    pub max_step: f64,
    /// Largest turn of the tangent over one step, in radians.
    pub max_angle: f64,
    /// Points after which each half of the curve is cut.
    pub max_points: usize,
    /// A state with an entry above this has left the domain.
    pub bound: f64,
}

impl LocusOptions {
    /// Defaults for a box of parameters.
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

/// One point of a locus.
#[derive(Clone, Debug)]
pub struct LocusPoint {
    /// First parameter.
    pub first: f64,
    /// Second parameter.
    pub second: f64,
    /// The orbit there. Its error estimate is large where the parameters do not
    /// determine it (folds).
    pub orbit: PeriodicOrbit,
}

/// A curve of bifurcation points.
#[derive(Clone, Debug)]
pub struct Locus {
    /// What happens along it (angle or time: at the starting point).
    pub kind: BifurcationKind,
    /// Points in order, from one end through the starting point to the other.
    pub points: Vec<LocusPoint>,
    /// Why it ends, at the first and at the last point.
    pub ends: [BranchEnd; 2],
}

/// Follows the bifurcation `point`, found at this value of the second parameter,
/// both ways through the box.
///
/// # Errors
/// If the options make no sense or the point cannot be corrected.
pub fn trace_locus<F: TwoParameterFamily>(
    family: &F,
    point: &Bifurcation,
    second: f64,
    options: &LocusOptions,
    control: &Control<'_>,
) -> Result<Locus, ContinuationError> {
    check(options, point.parameter, second)?;
    let mut solver = LocusSolver::new(family, point, options);
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
    Ok(Locus {
        kind: point.kind,
        points,
        ends: [first_end, last_end],
    })
}

fn check(options: &LocusOptions, first: f64, second: f64) -> Result<(), ContinuationError> {
    for (range, value) in [(options.first, first), (options.second, second)] {
        let usable = range.0 < range.1 && (range.1 - range.0).is_finite();
        if !usable || !(range.0..=range.1).contains(&value) {
            return Err(ContinuationError::BadOptions(format!(
                "the start {value} must lie in a finite range that runs upwards, {} … {} given",
                range.0, range.1
            )));
        }
    }
    let steps = [options.min_step, options.initial_step, options.max_step];
    if !(steps[0] > 0.0 && steps[0] <= steps[1] && steps[1] <= steps[2] && steps[2].is_finite()) {
        return Err(ContinuationError::BadOptions(format!(
            "steps must satisfy 0 < min ≤ initial ≤ max, {steps:?} given"
        )));
    }
    Ok(())
}

/// A solution u = (x, first, second) with its tangent, of unit scaled length.
#[derive(Clone, Debug)]
struct LocusNode {
    u: Vec<f64>,
    tangent: Vec<f64>,
    iterations: usize,
}

/// A_{n−1} … A_0.
fn product(factors: &[DMatrix<f64>]) -> DMatrix<f64> {
    let d = factors.first().map_or(0, DMatrix::nrows);
    factors
        .iter()
        .fold(DMatrix::identity(d, d), |product, a| a * product)
}

/// The run of n periods from x.
struct Trajectory {
    segments: Segments,
    /// Pⁿ(x).
    end: Vec<f64>,
    /// ∂Pⁿ/∂first and ∂Pⁿ/∂second.
    by_parameter: [DVector<f64>; 2],
}

/// What one evaluation gives.
struct Evaluation {
    /// Pⁿ(x) − x.
    gap: Vec<f64>,
    /// DPⁿ.
    monodromy: DMatrix<f64>,
    /// ∂Pⁿ/∂first and ∂Pⁿ/∂second.
    by_parameter: [DVector<f64>; 2],
    scalar: f64,
}

struct LocusSolver<'a, F> {
    family: &'a F,
    kind: BifurcationKind,
    d: usize,
    n: usize,
    scales: Vec<f64>,
    /// Column and row that border DPⁿ ∓ 1.
    borders: (DVector<f64>, DVector<f64>),
    /// Time of the grazing extremum.
    time: f64,
}

impl<'a, F: TwoParameterFamily> LocusSolver<'a, F> {
    fn new(family: &'a F, point: &Bifurcation, options: &LocusOptions) -> Self {
        let d = point.orbit.dimension();
        let size = point.orbit.scale();
        let mut scales = vec![if size > 0.0 { size } else { 1.0 }; d];
        scales.push(options.first.1 - options.first.0);
        scales.push(options.second.1 - options.second.0);
        let chance = |offset: u64| DVector::from_fn(d, |i, _| unit(offset + i as u64) + 0.5);
        Self {
            family,
            kind: point.kind,
            d,
            n: point.orbit.period,
            scales,
            borders: (chance(0), chance(500)),
            time: match point.kind {
                BifurcationKind::Grazing { time } => time,
                _ => 0.0,
            },
        }
    }

    /// States and Jacobians along the orbit from x, and the derivatives of its end.
    fn orbit_from(&self, u: &[f64]) -> Result<Trajectory, MapFailure> {
        let (d, n) = (self.d, self.n);
        let parameters = [u[d], u[d + 1]];
        let mut map = self
            .family
            .at(parameters[0], parameters[1])
            .map_err(MapFailure::refused)?;
        let mut segments = Segments::new(d, n);
        let mut state = u[..d].to_vec();
        let mut by_parameter = [DVector::zeros(d), DVector::zeros(d)];
        let (mut first, mut second) = (vec![0.0; d], vec![0.0; d]);
        for k in 0..n {
            segments.points[k * d..(k + 1) * d].copy_from_slice(&state);
            self.family
                .advance_with_derivatives(
                    parameters,
                    &mut map,
                    &mut state,
                    &mut segments.jacobians[k],
                    [&mut first, &mut second],
                )
                .map_err(MapFailure::refused)?;
            finite(&state)?;
            finite(segments.jacobians[k].as_slice())?;
            for (sum, one) in by_parameter.iter_mut().zip([&first, &second]) {
                *sum = &segments.jacobians[k] * &*sum + DVector::from_column_slice(one);
            }
        }
        Ok(Trajectory {
            segments,
            end: state,
            by_parameter,
        })
    }

    /// Everything at u; the borders are brought up to date on the way.
    fn evaluate(&mut self, u: &[f64]) -> Result<Evaluation, MapFailure> {
        let Trajectory {
            segments,
            end,
            by_parameter,
        } = self.orbit_from(u)?;
        let monodromy = product(&segments.jacobians);
        self.refresh_borders(&monodromy);
        let scalar = if let BifurcationKind::Grazing { .. } = self.kind {
            self.scalar_alone(&mut self.map_at(u)?, &u[..self.d])?
        } else {
            self.scalar_of(&segments.jacobians, &monodromy)?
        };
        Ok(Evaluation {
            gap: end.iter().zip(u).map(|(a, b)| a - b).collect(),
            monodromy,
            by_parameter,
            scalar,
        })
    }

    fn map_at(&self, u: &[f64]) -> Result<F::Map, MapFailure> {
        self.family
            .at(u[self.d], u[self.d + 1])
            .map_err(MapFailure::refused)
    }

    /// The function that vanishes on the locus, from the Jacobians of an orbit.
    fn scalar_of(
        &self,
        jacobians: &[DMatrix<f64>],
        monodromy: &DMatrix<f64>,
    ) -> Result<f64, MapFailure> {
        let value = match self.kind {
            BifurcationKind::Fold | BifurcationKind::Crossing => {
                self.bordered(monodromy, -1.0, false).map(|(_, g)| g)
            }
            BifurcationKind::Flip => self.bordered(monodromy, 1.0, false).map(|(_, g)| g),
            BifurcationKind::NeimarkSacker { .. } => {
                Multipliers::of_product(jacobians).ok().and_then(|m| {
                    m.values
                        .iter()
                        .filter(|m| m.im > 0.0)
                        .map(|m| m.norm_sqr() - 1.0)
                        .min_by(|a, b| a.abs().total_cmp(&b.abs()))
                })
            }
            BifurcationKind::Grazing { .. } => None,
        };
        value.filter(|v| v.is_finite()).ok_or(MapFailure::NotFinite)
    }

    /// That function for the run from `x`, without derivatives by parameters.
    fn scalar_alone(&self, map: &mut F::Map, x: &[f64]) -> Result<f64, MapFailure> {
        if let BifurcationKind::Grazing { .. } = self.kind {
            let value = self.tangency(map, x)?.map(|t| t.value);
            return value.filter(|v| v.is_finite()).ok_or(MapFailure::NotFinite);
        }
        let d = self.d;
        let mut jacobians = vec![DMatrix::zeros(d, d); self.n];
        let mut state = x.to_vec();
        for jacobian in &mut jacobians {
            advance_with_jacobian(map, &mut state, jacobian)?;
        }
        self.scalar_of(&jacobians, &product(&jacobians))
    }

    /// Solution of [[M + shift, b], [cᵀ, 0]] (v, g) = (0, 1), transposed if asked.
    fn bordered(
        &self,
        monodromy: &DMatrix<f64>,
        shift: f64,
        transposed: bool,
    ) -> Option<(DVector<f64>, f64)> {
        let d = self.d;
        let mut matrix = DMatrix::zeros(d + 1, d + 1);
        matrix.view_mut((0, 0), (d, d)).copy_from(monodromy);
        for i in 0..d {
            matrix[(i, i)] += shift;
            matrix[(i, d)] = self.borders.0[i];
            matrix[(d, i)] = self.borders.1[i];
        }
        if transposed {
            matrix.transpose_mut();
        }
        let mut right = DVector::zeros(d + 1);
        right[d] = 1.0;
        let solution = matrix.lu().solve(&right)?;
        let v = solution.rows(0, d).into_owned();
        let length = v.norm();
        (length.is_finite() && length > 0.0).then(|| (v / length, solution[d]))
    }

    /// Replaces the borders by the null vectors themselves, for good conditioning.
    fn refresh_borders(&mut self, monodromy: &DMatrix<f64>) {
        let shift = match self.kind {
            BifurcationKind::Fold | BifurcationKind::Crossing => -1.0,
            BifurcationKind::Flip => 1.0,
            _ => return,
        };
        if let (Some((right, _)), Some((left, _))) = (
            self.bordered(monodromy, shift, false),
            self.bordered(monodromy, shift, true),
        ) {
            self.borders = (left, right);
        }
    }

    /// The extremum nearest in time to the one followed.
    fn tangency(&self, map: &mut F::Map, x: &[f64]) -> Result<Option<OrbitTangency>, MapFailure> {
        let mut state = x.to_vec();
        let mut one = Vec::new();
        let mut nearest: Option<(f64, OrbitTangency)> = None;
        let period = self.n as f64;
        for k in 0..self.n {
            one.clear();
            advance_with_tangencies(map, &mut state, &mut one)?;
            for t in &one {
                let time = k as f64 + t.phase;
                let apart = (time - self.time).rem_euclid(period);
                let apart = apart.min(period - apart);
                if nearest.is_none_or(|(best, _)| apart < best) {
                    let value = t.value;
                    nearest = Some((apart, OrbitTangency { time, value }));
                }
            }
        }
        Ok(nearest.map(|(_, t)| t))
    }

    fn gradient(&self, u: &[f64]) -> Result<Vec<f64>, MapFailure> {
        let d = self.d;
        let mut here = self.map_at(u)?;
        let mut shifted = u.to_vec();
        let mut gradient = Vec::with_capacity(u.len());
        for i in 0..u.len() {
            let h = 1e-6 * self.scales[i];
            let (high, low) = (u[i] + h, u[i] - h);
            let mut at = |value: f64| -> Result<f64, MapFailure> {
                shifted[i] = value;
                if i < d {
                    return self.scalar_alone(&mut here, &shifted[..d]);
                }
                self.scalar_alone(&mut self.map_at(&shifted)?, &shifted[..d])
            };
            let difference = at(high)? - at(low)?;
            shifted[i] = u[i];
            gradient.push(difference / (high - low));
        }
        Ok(gradient)
    }

    /// Matrix of the linearised equations, bordered by `row`.
    fn matrix(&self, e: &Evaluation, gradient: &[f64], row: &[f64]) -> DMatrix<f64> {
        let d = self.d;
        let mut matrix = DMatrix::zeros(d + 2, d + 2);
        matrix.view_mut((0, 0), (d, d)).copy_from(&e.monodromy);
        for i in 0..d {
            matrix[(i, i)] -= 1.0;
            matrix[(i, d)] = e.by_parameter[0][i];
            matrix[(i, d + 1)] = e.by_parameter[1][i];
        }
        for j in 0..d + 2 {
            matrix[(d, j)] = gradient[j];
            matrix[(d + 1, j)] = row[j];
        }
        matrix
    }

    /// Newton from `guess` in the plane across `row`; tangent along `orientation`.
    fn correct(
        &mut self,
        guess: &[f64],
        row: &[f64],
        orientation: &[f64],
    ) -> Result<LocusNode, String> {
        let d = self.d;
        let mut u = guess.to_vec();
        let mut last = f64::INFINITY;
        let mut iterations = 0;
        let matrix = loop {
            let e = self.evaluate(&u).map_err(|e| e.to_string())?;
            let gradient = self.gradient(&u).map_err(|e| e.to_string())?;
            let mut right = DVector::zeros(d + 2);
            for i in 0..d {
                right[i] = -e.gap[i];
            }
            right[d] = -e.scalar;
            let step = self
                .matrix(&e, &gradient, row)
                .lu()
                .solve(&right)
                .ok_or("the bordered system is singular")?;
            let size = (0..d + 2).fold(0.0f64, |m, i| m.max((step[i] / self.scales[i]).abs()));
            if !size.is_finite() {
                return Err("the bordered system is singular".into());
            }
            for (v, s) in u.iter_mut().zip(step.iter()) {
                *v += s;
            }
            iterations += 1;
            // The next step would be smaller by the error of the gradient, 1e-8 or so.
            let stalled = size > 0.5 * last;
            if size <= 1e-11 || (stalled && size <= 1e-9) {
                break self.matrix(&e, &gradient, orientation);
            }
            if iterations >= 15 || size > 2.0 * last {
                return Err("the corrector did not converge".into());
            }
            last = size;
        };
        let mut right = DVector::zeros(d + 2);
        right[d + 1] = 1.0;
        let tangent = matrix
            .lu()
            .solve(&right)
            .ok_or("the curve has no direction")?;
        let length = self.product(tangent.as_slice(), tangent.as_slice()).sqrt();
        if !(length.is_finite() && length > 0.0) {
            return Err("the curve has no direction".into());
        }
        if let BifurcationKind::Grazing { .. } = self.kind
            && let Ok(mut map) = self.map_at(&u)
            && let Ok(Some(t)) = self.tangency(&mut map, &u[..d])
        {
            self.time = t.time;
        }
        Ok(LocusNode {
            u,
            tangent: (tangent / length).as_slice().to_vec(),
            iterations,
        })
    }

    fn product(&self, a: &[f64], b: &[f64]) -> f64 {
        a.iter()
            .zip(b)
            .zip(&self.scales)
            .map(|((x, y), s)| x * y / (s * s))
            .sum()
    }

    fn point(&self, node: &LocusNode) -> Result<LocusPoint, ContinuationError> {
        let Trajectory {
            mut segments, end, ..
        } = self.orbit_from(&node.u)?;
        let residual = distance(&end, &node.u[..self.d]);
        segments.scale = norm(&segments.points);
        let error = segments
            .error_estimate()
            .unwrap_or(f64::INFINITY)
            .max(residual);
        Ok(LocusPoint {
            first: node.u[self.d],
            second: node.u[self.d + 1],
            orbit: segments.into_orbit(residual, error)?,
        })
    }

    fn follow(
        &mut self,
        start: &LocusNode,
        options: &LocusOptions,
        control: &Control<'_>,
    ) -> Result<(Vec<LocusPoint>, BranchEnd), ContinuationError> {
        let d = self.d;
        let mut points = vec![self.point(start)?];
        let mut node = start.clone();
        let mut step = options.initial_step;
        while points.len() < options.max_points {
            if control.is_cancelled() {
                return Ok((points, BranchEnd::Cancelled));
            }
            let mut predicted: Vec<f64> = node
                .u
                .iter()
                .zip(&node.tangent)
                .map(|(u, t)| u + step * t)
                .collect();
            // Onto the edge of the box if the step would lead out of it.
            let leaving = [(d, options.first), (d + 1, options.second)]
                .into_iter()
                .filter_map(|(i, (low, high))| {
                    let edge = if predicted[i] > high {
                        high
                    } else if predicted[i] < low {
                        low
                    } else {
                        return None;
                    };
                    Some((i, (edge - node.u[i]) / node.tangent[i]))
                })
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let mut row: Vec<f64> = node
                .tangent
                .iter()
                .zip(&self.scales)
                .map(|(t, s)| t / (s * s))
                .collect();
            let orientation = row.clone();
            if let Some((i, fraction)) = leaving {
                if fraction <= 1e-12 {
                    return Ok((points, BranchEnd::RangeEnd));
                }
                for (p, (u, t)) in predicted.iter_mut().zip(node.u.iter().zip(&node.tangent)) {
                    *p = u + fraction * t;
                }
                row.fill(0.0);
                row[i] = 1.0 / self.scales[i];
            }
            let saved = (self.time, self.borders.clone());
            let next = self
                .correct(&predicted, &row, &orientation)
                .and_then(|next| {
                    let turn = self
                        .product(&node.tangent, &next.tangent)
                        .clamp(-1.0, 1.0)
                        .acos();
                    let shift: Vec<f64> =
                        next.u.iter().zip(&predicted).map(|(a, b)| a - b).collect();
                    let correction = self.product(&shift, &shift).sqrt();
                    if step > 1e3 * options.min_step && turn > options.max_angle {
                        Err("the tangent turns too fast".to_owned())
                    } else if correction > 0.5 * step {
                        Err("the correction is as large as the step".to_owned())
                    } else {
                        Ok((next, turn))
                    }
                });
            match next {
                Err(reason) => {
                    (self.time, self.borders) = saved;
                    step *= 0.5;
                    if step < options.min_step {
                        return Ok((points, BranchEnd::StepTooSmall { reason }));
                    }
                }
                Ok((next, turn)) => {
                    if norm(&next.u[..d]) > options.bound {
                        return Ok((points, BranchEnd::LeftDomain));
                    }
                    points.push(self.point(&next)?);
                    if leaving.is_some() {
                        return Ok((points, BranchEnd::RangeEnd));
                    }
                    let back: Vec<f64> = next.u.iter().zip(&start.u).map(|(a, b)| a - b).collect();
                    let returned = points.len() > 8
                        && self.product(&back, &back).sqrt() <= 0.6 * step
                        && self.product(&next.tangent, &start.tangent) > 0.0;
                    if next.iterations <= 5 && turn < 0.5 * options.max_angle {
                        step = (1.5 * step).min(options.max_step);
                    }
                    node = next;
                    if returned {
                        return Ok((points, BranchEnd::Closed));
                    }
                }
            }
        }
        Ok((points, BranchEnd::PointLimit))
    }
}
