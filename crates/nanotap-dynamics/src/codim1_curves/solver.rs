//! One point of a curve of bifurcations: equations, Newton corrector and tangent.

use nalgebra::{DMatrix, DVector};

use crate::codim1_curves::{CurveOptions, CurvePoint};
use crate::continuation::{Bifurcation, BifurcationKind, ContinuationError, OrbitTangency};
use crate::failure::{MapFailure, advance_with_jacobian, advance_with_tangencies, finite};
use crate::map::{StroboscopicMap, TwoParameterFamily};
use crate::orbit::Multipliers;
use crate::orbit::shooting::{MAX_DISCRETE_UPDATES, Segments, set_discrete_entries};
use crate::random::unit;
use crate::vector::{distance, norm};

/// Largest orbit without a size, as a fraction of the state scale of its branch.
const MIN_ORBIT_SIZE: f64 = 1e-6;

/// Largest step of the central differences, as a fraction of the scales.
const MAX_DIFFERENCE_STEP: f64 = 1e-6;
/// Smallest step of the central differences, as a fraction of the scales.
const MIN_DIFFERENCE_STEP: f64 = 1e-8;

/// A solution u = (x, first, second) with its tangent, of unit scaled length.
#[derive(Clone, Debug)]
pub(super) struct CurveNode {
    pub(super) u: Vec<f64>,
    pub(super) tangent: Vec<f64>,
    pub(super) iterations: usize,
}

/// The product A_{n−1} … A_0.
fn product(factors: &[DMatrix<f64>]) -> DMatrix<f64> {
    let d = factors.first().map_or(0, DMatrix::nrows);
    factors
        .iter()
        .fold(DMatrix::identity(d, d), |product, a| a * product)
}

/// The trajectory of n periods from x.
struct Trajectory {
    segments: Segments,
    /// The state after n periods, Pⁿ(x).
    end: Vec<f64>,
    /// Derivatives of Pⁿ(x) with respect to the first and the second parameter, d entries each.
    by_parameter: [DVector<f64>; 2],
}

/// Values and derivatives of the equations at one point.
struct Evaluation {
    /// The closing error Pⁿ(x) − x, d entries.
    gap: Vec<f64>,
    /// The Jacobian DPⁿ(x), d × d.
    monodromy: DMatrix<f64>,
    /// Derivatives of Pⁿ(x) with respect to the first and the second parameter, d entries each.
    by_parameter: [DVector<f64>; 2],
    scalar: f64,
}

pub(super) struct CurveSolver<'a, F> {
    family: &'a F,
    pub(super) kind: BifurcationKind,
    pub(super) d: usize,
    /// Number of continuous entries of a state. The others are whole numbers that the map sets.
    pub(super) continuous: usize,
    pub(super) n: usize,
    pub(super) scales: Vec<f64>,
    /// Column and row that border DPⁿ ∓ 1.
    pub(super) borders: (DVector<f64>, DVector<f64>),
    /// Size of the first orbit.
    least: f64,
    /// Time of the grazing extremum in drive periods.
    pub(super) time: f64,
}

impl<'a, F: TwoParameterFamily> CurveSolver<'a, F> {
    pub(super) fn new(family: &'a F, point: &Bifurcation, options: &CurveOptions) -> Self {
        let d = point.orbit.dimension();
        let mut size = point.orbit.scale();
        // An orbit at the origin has no size; its unit is the distance by which it moves along its
        // branch.
        let moved = norm(&point.node.tangent);
        if size <= MIN_ORBIT_SIZE * moved {
            size = moved;
        }
        let mut scales = vec![if size > 0.0 { size } else { 1.0 }; d];
        scales.push(options.first.1 - options.first.0);
        scales.push(options.second.1 - options.second.0);
        let chance = |offset: u64| DVector::from_fn(d, |i, _| unit(offset + i as u64) + 0.5);
        Self {
            family,
            kind: point.kind,
            d,
            continuous: d - point.orbit.discrete,
            n: point.orbit.period,
            scales,
            least: size,
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
        let mut map = self.map_at(u)?;
        let mut segments = Segments::new(d, n);
        segments.discrete = d - self.continuous;
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

    /// Evaluates the equations at u and updates the borders.
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

    pub(super) fn map_at(&self, u: &[f64]) -> Result<F::Map, MapFailure> {
        let mut map = self
            .family
            .at(u[self.d], u[self.d + 1])
            .map_err(MapFailure::refused)?;
        if matches!(self.kind, BifurcationKind::Grazing { .. }) {
            map.pass_touches();
        }
        Ok(map)
    }

    /// The scalar g, which vanishes on the curve, from the Jacobians of an orbit.
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

    /// The scalar g for the trajectory from `x`, without derivatives with respect to parameters.
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

    /// Solution of [[M + shift, b], [cᵀ, 0]] (v, g) = (0, 1), transposed on request.
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

    /// Replaces the borders by the null vectors, for good conditioning.
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

    /// The extremum nearest in time to the one followed, of the switching function nearest to zero.
    fn tangency(&self, map: &mut F::Map, x: &[f64]) -> Result<Option<OrbitTangency>, MapFailure> {
        let mut state = x.to_vec();
        let mut one = Vec::new();
        let mut nearest: Option<((f64, f64), OrbitTangency)> = None;
        let period = self.n as f64;
        for k in 0..self.n {
            one.clear();
            advance_with_tangencies(map, &mut state, &mut one)?;
            for t in &one {
                let time = k as f64 + t.phase;
                let apart = (time - self.time).rem_euclid(period);
                let apart = apart.min(period - apart);
                let value = t.value;
                let apart = (apart, value.abs());
                if nearest.is_none_or(|(best, _)| apart < best) {
                    nearest = Some((apart, OrbitTangency { time, value }));
                }
            }
        }
        Ok(nearest.map(|(_, t)| t))
    }

    /// Step of the differences in units of the scales: short compared with the distance to the next
    /// grazing, near which the derivatives of the map change fast.
    fn difference_step(&self, map: &mut F::Map, x: &[f64]) -> f64 {
        if let BifurcationKind::Grazing { .. } = self.kind {
            return MAX_DIFFERENCE_STEP;
        }
        let all = self.all_tangencies(map, x).into_iter();
        let closest = all.fold(f64::INFINITY, |m, t| m.min(t.value.abs())) / self.scales[0];
        (0.01 * closest).clamp(MIN_DIFFERENCE_STEP, MAX_DIFFERENCE_STEP)
    }

    fn gradient(&self, u: &[f64]) -> Result<Vec<f64>, MapFailure> {
        let d = self.d;
        let mut here = self.map_at(u)?;
        let step = self.difference_step(&mut here, &u[..d]);
        let mut shifted = u.to_vec();
        let mut gradient = Vec::with_capacity(u.len());
        for i in 0..u.len() {
            let h = step * self.scales[i];
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

    /// Newton from `guess` in the plane perpendicular to `row`; tangent along `orientation`.
    pub(super) fn correct(
        &mut self,
        guess: &[f64],
        row: &[f64],
        orientation: &[f64],
    ) -> Result<CurveNode, String> {
        let d = self.d;
        let mut u = guess.to_vec();
        let mut last = f64::INFINITY;
        let mut iterations = 0;
        let matrix = loop {
            let mut e = self.evaluate(&u).map_err(|e| e.to_string())?;
            for _ in 0..MAX_DISCRETE_UPDATES {
                if !set_discrete_entries(&mut u[..d], &e.gap, d, self.continuous) {
                    break;
                }
                e = self.evaluate(&u).map_err(|e| e.to_string())?;
            }
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
            // Further steps are limited by the error of the gradient, about 1e-8.
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
        Ok(CurveNode {
            u,
            tangent: (tangent / length).as_slice().to_vec(),
            iterations,
        })
    }

    pub(super) fn product(&self, a: &[f64], b: &[f64]) -> f64 {
        let terms = a.iter().zip(b).zip(&self.scales);
        let measured = terms
            .enumerate()
            .filter(|(i, _)| !(self.continuous..self.d).contains(i));
        measured.map(|(_, ((x, y), s))| x * y / (s * s)).sum()
    }

    pub(super) fn point(&self, node: &CurveNode) -> Result<CurvePoint, ContinuationError> {
        let Trajectory {
            mut segments, end, ..
        } = self.orbit_from(&node.u)?;
        let residual = distance(&end, &node.u[..self.d]);
        segments.scale = norm(&segments.points);
        let error = segments
            .error_estimate()
            .unwrap_or(f64::INFINITY)
            .max(residual);
        Ok(CurvePoint {
            first: node.u[self.d],
            second: node.u[self.d + 1],
            orbit: segments.into_orbit(residual, error)?,
        })
    }

    /// Measures the state in units of the orbit at `node` from now on, but at least in units of the
    /// first orbit.
    pub(super) fn rescale(&mut self, node: &mut CurveNode) {
        let scale = norm(&node.u[..self.continuous]).max(self.least);
        if scale > 0.0 {
            self.scales[..self.d].fill(scale);
            let length = self.product(&node.tangent, &node.tangent).sqrt();
            for t in &mut node.tangent {
                *t /= length;
            }
        }
    }

    /// All extrema of the switching functions along the orbit.
    pub(super) fn tangencies(&self, node: &CurveNode) -> Vec<OrbitTangency> {
        match self.map_at(&node.u) {
            Ok(mut map) => self.all_tangencies(&mut map, &node.u[..self.d]),
            Err(_) => Vec::new(),
        }
    }

    /// All extrema along the trajectory from `x`, up to the first failure of the map.
    fn all_tangencies(&self, map: &mut F::Map, x: &[f64]) -> Vec<OrbitTangency> {
        let mut found = Vec::new();
        let mut state = x.to_vec();
        let mut one = Vec::new();
        for k in 0..self.n {
            one.clear();
            if advance_with_tangencies(map, &mut state, &mut one).is_err() {
                break;
            }
            found.extend(one.iter().map(|t| OrbitTangency {
                time: k as f64 + t.phase,
                value: t.value,
            }));
        }
        found
    }
}
