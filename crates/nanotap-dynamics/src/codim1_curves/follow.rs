//! The continuation loop of a curve in one direction.

use crate::codim1_curves::end::CurveEnd;
use crate::codim1_curves::solver::{CurveNode, CurveSolver};
use crate::codim1_curves::{CurveOptions, CurvePoint};
use crate::continuation::ContinuationError;
use crate::control::Control;
use crate::map::TwoParameterFamily;
use crate::vector::norm;

impl<F: TwoParameterFamily> CurveSolver<'_, F> {
    /// The points from `start` along its tangent, and why the curve ends.
    pub(super) fn follow(
        &mut self,
        start: &CurveNode,
        options: &CurveOptions,
        control: &Control<'_>,
    ) -> Result<(Vec<CurvePoint>, CurveEnd), ContinuationError> {
        let d = self.d;
        let mut points = vec![self.point(start)?];
        let mut node = start.clone();
        self.rescale(&mut node);
        let mut step = options.initial_step;
        while points.len() < options.max_points {
            if control.is_cancelled() {
                return Ok((points, CurveEnd::Cancelled));
            }
            let mut predicted: Vec<f64> = node
                .u
                .iter()
                .zip(&node.tangent)
                .map(|(u, t)| u + step * t)
                .collect();
            // Shorten the step to the edge of the box if it would leave it.
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
                    return Ok((points, CurveEnd::Window));
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
                    let turn = nanotap_arithmetic::acos(
                        self.product(&node.tangent, &next.tangent).clamp(-1.0, 1.0),
                    );
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
                Err(_) if control.is_cancelled() => return Ok((points, CurveEnd::Cancelled)),
                Err(reason) => {
                    (self.time, self.borders) = saved;
                    step *= 0.5;
                    if step < options.min_step {
                        let end = self.end_at(&node, &points, reason);
                        return Ok((points, end));
                    }
                }
                Ok((next, turn)) => {
                    if norm(&next.u[..d]) > options.bound {
                        return Ok((points, CurveEnd::LeftDomain));
                    }
                    points.push(self.point(&next)?);
                    if leaving.is_some() {
                        return Ok((points, CurveEnd::Window));
                    }
                    let back: Vec<f64> = next.u.iter().zip(&start.u).map(|(a, b)| a - b).collect();
                    let returned = points.len() > 8
                        && self.product(&back, &back).sqrt() <= 0.6 * step
                        && self.product(&next.tangent, &start.tangent) > 0.0;
                    if next.iterations <= 5 && turn < 0.5 * options.max_angle {
                        step = (1.5 * step).min(options.max_step);
                    }
                    node = next;
                    self.rescale(&mut node);
                    if returned {
                        return Ok((points, CurveEnd::Closed));
                    }
                }
            }
        }
        Ok((points, CurveEnd::PointLimit))
    }

    fn end_at(&self, node: &CurveNode, points: &[CurvePoint], reason: String) -> CurveEnd {
        let here = (node.u[self.d], node.u[self.d + 1]);
        match points.last() {
            Some(last) => {
                let tangencies = self.tangencies(node);
                CurveEnd::at_last_point(self.kind, here, &last.orbit, &tangencies, reason)
            }
            None => CurveEnd::StepTooSmall {
                first: here.0,
                second: here.1,
                reason,
            },
        }
    }
}
