//! Force and damping from the first harmonics of many oscillations.
//!
//! Both are piecewise linear in the distance. A first pass takes the motion as sinusoidal, where
//! the averages of a linear piece have a closed form. Further passes take the tip's motion in
//! the force and damping of the pass before, with its higher harmonics, and solve for both in
//! turn. An error of the amplitude moves the distance too, so the error of a row depends on the slope
//! of the force: averaged over neighbouring rows, because a force that oscillates would enlarge the
//! errors and thereby justify itself. Once the force is stable, each row's measured values are moved
//! towards it, by their share of the residual (orthogonal distance regression).
//!
//! A force that is linear between nodes is an approximation. Its error is part of each row's standard
//! error; where it would exceed the measurement's, the nodes are closer together.
//!
//! Where the force is much steeper than the lever is stiff, the fixed point of the motion does not
//! converge. A force that still changes in the last pass is refused.

use nalgebra::{DMatrix, DVector};
use nanotap_arithmetic::{exp, ln};
use nanotap_flow::Complex;
use rayon::prelude::*;

use super::bias;
use super::lever_response::{FirstHarmonic, Method};
use super::motion::{Harmonics, KnownForces, Motion, Weights};
use super::nodes::{Kernel, Nodes};
use super::smooth::Smooth;
use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_fit::fit::instrument::median;

/// Number of passes; the first one takes the motion as sinusoidal.
pub(super) const PASSES: usize = 12;
/// Pass from which on the nodes stay and the penalty is adapted.
const ADAPTED: usize = 2;
/// Pass from which on motions are averaged with those before.
const AVERAGED: usize = 3;
/// Nodes on either side over which the squared curvature is averaged.
const WINDOW: usize = 6;
/// Part of the mean squared curvature that is added to the local one.
const BACKGROUND: f64 = 0.1;
/// Fraction of its change by which a row's values move in a pass.
const MOVE: f64 = 0.3;
/// Pass from which on they move, in which the force is stable.
const MOVED: usize = 4;
/// Largest residual that counts for this, in standard errors.
const MAX_MOVED_RESIDUAL: f64 = 3.0;
/// Distance over which slopes are averaged for the errors: in spacings of the nodes plus in standard
/// errors of the amplitude.
const AVERAGED_SLOPES: [f64; 2] = [2.0, 3.0];
/// Upper limit of the number by which the spacing of the nodes is divided for exact data.
const MAX_REFINEMENT: f64 = 8.0;
/// Change of the force in the last pass, in standard errors, above which it has not converged.
const CONVERGED: f64 = 2.0;
/// Mean squared residual, in standard errors, above which no force describes the rows.
const MAX_CHI2: f64 = 25.0;
/// Largest force, in its standard errors, below which the force is not determined.
const DETERMINED: f64 = 2.0;
/// Force beyond the closest approach of the farthest row, as a fraction of the largest, above which
/// the curve does not begin far enough from the sample.
const MAX_BEYOND: f64 = 0.2;

/// Measured values of a row, in SI or model units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    /// Distance of the tip at rest from the sample, m or model units.
    pub(super) distance: f64,
    /// Measured values: amplitude (m) and phase (degrees), or relative frequency shift and
    /// dissipated energy (J).
    pub(super) values: [f64; 2],
    /// Standard errors of `values`, in the same units.
    pub(super) errors: [f64; 2],
    /// Whether the sample is felt, so that the force there is to be resolved.
    pub(super) informative: bool,
}

/// Measured rows with the method of measurement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inversion<'a> {
    pub(super) rows: &'a [Measured],
    pub(super) method: &'a Method,
    /// Displacements of the tip by a unit of force, m/N or model units, for the harmonics 0, 1, ….
    pub(super) gains: &'a [Complex],
    /// Whether the second value was measured.
    pub(super) has_damping: bool,
    /// Upper limit of the spacing of the nodes, m or model units.
    pub(super) widest: f64,
}

/// Force and damping, with the values that follow from them for each row.
#[derive(Clone, Debug)]
pub(super) struct Inverted {
    pub(super) nodes: Nodes,
    pub(super) force: Smooth,
    pub(super) damping: Smooth,
    pub(super) rows: Vec<InvertedRow>,
    /// Least distance at which the force is resolved, m or model units.
    pub(super) low: f64,
    /// Part of the standard errors of the force that follows from the noise, N or model units.
    pub(super) noise: Vec<f64>,
}

impl Inverted {
    /// # Errors
    /// When the residuals are too large for one force.
    pub(super) fn check_residuals(&self) -> Result<(), Error> {
        if self.force.chi2 <= MAX_CHI2 {
            return Ok(());
        }
        let factor = self.force.chi2.sqrt();
        Err(undetermined(&format!(
            "the residuals of the smooth force that fits best are {factor:.1} times the standard errors"
        )))
    }
}

/// Values of a row that follow from force and damping.
#[derive(Clone, Copy, Debug)]
pub(super) struct InvertedRow {
    /// Closest approach of the tip to the sample, m or model units; negative inside the sample.
    pub(super) closest: f64,
    /// Amplitude of the tip's first harmonic, m or model units.
    pub(super) amplitude: f64,
    /// Energy dissipated in a period and its standard error, J or model units.
    pub(super) dissipated: [f64; 2],
    /// Residual of the conservative part in standard errors.
    pub(super) residual: f64,
}

/// Estimated values of a row, with what follows from them.
#[derive(Clone, Copy, Debug)]
struct Estimate {
    values: [f64; 2],
    at: FirstHarmonic,
    /// Derivatives of conservative part, work and amplitude by both values.
    conservative_by: [f64; 2],
    work_by: [f64; 2],
    amplitude_by: [f64; 2],
    /// Mean deflection of the tip, m or model units.
    mean: f64,
    /// Derivative of the conservative part by the distance, in the known force.
    slope: f64,
    /// Derivatives of the residual by both values, averaged over neighbouring rows; None before the
    /// slope is known.
    local_by: Option<[f64; 2]>,
    closest: f64,
}

impl Estimate {
    fn of(method: &Method, row: &Measured) -> Self {
        let mut estimate = Self {
            values: row.values,
            at: method.first_harmonic(row.values),
            conservative_by: [0.0; 2],
            work_by: [0.0; 2],
            amplitude_by: [0.0; 2],
            mean: 0.0,
            slope: 0.0,
            local_by: None,
            closest: 0.0,
        };
        estimate.update(method, row);
        estimate
    }

    fn update(&mut self, method: &Method, row: &Measured) {
        self.at = method.first_harmonic(self.values);
        for index in 0..2 {
            let step = 1e-2 * row.errors[index];
            let shifted = |side: f64| {
                let mut values = self.values;
                values[index] += side * step;
                method.first_harmonic(values)
            };
            let (low, high) = (shifted(-1.0), shifted(1.0));
            let slope = |of: fn(&FirstHarmonic) -> f64| (of(&high) - of(&low)) / (2.0 * step);
            self.conservative_by[index] = slope(|h| h.conservative);
            self.work_by[index] = slope(|h| h.work);
            self.amplitude_by[index] = slope(|h| h.amplitude);
        }
    }

    /// Derivatives of the residual by both values: they change the distance too.
    fn own_by(&self) -> [f64; 2] {
        [0, 1].map(|k| self.conservative_by[k] + self.slope * self.amplitude_by[k])
    }

    fn by(&self) -> [f64; 2] {
        self.local_by.unwrap_or_else(|| self.own_by())
    }
}

fn spread(by: [f64; 2], errors: [f64; 2]) -> f64 {
    let squares = by
        .iter()
        .zip(errors)
        .map(|(by, error)| (by * error).powi(2));
    squares.sum::<f64>().sqrt()
}

impl Inversion<'_> {
    /// Solves for force and damping.
    ///
    /// # Errors
    /// When no smooth force describes the rows, or the work is cancelled.
    pub(super) fn run(&self, control: &Control<'_>) -> Result<Inverted, Error> {
        let harmonics = Harmonics::new();
        let mut rows: Vec<Estimate> = self
            .rows
            .iter()
            .map(|row| Estimate::of(self.method, row))
            .collect();
        let mut nodes = Nodes(Vec::new());
        let (mut force, mut damping) = (Smooth::zero(0), Smooth::zero(0));
        let mut motions: Vec<Motion> = Vec::new();
        let mut weights: Vec<Weights> = Vec::new();
        let mut residuals = Vec::new();
        let mut before = Vec::new();
        let mut widest = self.widest;
        // Checked for each row: with thousands of rows one pass takes seconds.
        let going_on = || {
            if control.is_cancelled() {
                Err(Error::stopped())
            } else {
                Ok(())
            }
        };
        for pass in 0..PASSES {
            going_on()?;
            for (estimate, row) in rows.iter_mut().zip(self.rows) {
                estimate.update(self.method, row);
            }
            let harmonic = pass == 0;
            if harmonic {
                for (estimate, row) in rows.iter_mut().zip(self.rows) {
                    estimate.closest = row.distance - estimate.at.amplitude;
                }
            } else {
                let known = KnownForces {
                    nodes: &nodes,
                    force: &force.coefficients,
                    damping: &damping.coefficients,
                    gains: self.gains,
                };
                let moved = rows.par_iter().zip(self.rows).map(|(estimate, row)| {
                    going_on()?;
                    let centre = row.distance + estimate.mean;
                    Ok(known.motion(&harmonics, centre, estimate.at.amplitude))
                });
                let mut moved = moved.collect::<Result<Vec<Motion>, Error>>()?;
                if pass >= AVERAGED {
                    for (motion, before) in moved.iter_mut().zip(&motions) {
                        motion.half_way(before);
                    }
                }
                motions = moved;
                for (estimate, motion) in rows.iter_mut().zip(&motions) {
                    estimate.closest = motion.closest();
                }
            }
            if pass < ADAPTED {
                nodes = self.nodes(&rows, widest);
            }
            weights = if harmonic {
                let of = |estimate: &Estimate| sinusoidal(&nodes, estimate);
                rows.iter().map(of).collect()
            } else {
                let both = rows.par_iter().zip(&motions);
                let of = |(estimate, motion): (&Estimate, &Motion)| {
                    going_on()?;
                    Ok(motion.weights(&harmonics, &nodes, estimate.at.amplitude))
                };
                both.map(of).collect::<Result<_, Error>>()?
            };
            going_on()?;
            if damping.coefficients.len() != nodes.unknowns() {
                damping = Smooth::zero(nodes.unknowns());
            }
            let discretised = nodes.interpolation_errors(&force.coefficients);
            let observed = self.observed(&rows, &weights, &discretised);
            let mut roughness = nodes.roughness();
            if pass >= ADAPTED {
                adapt(&mut roughness, &force.coefficients);
            }
            before = std::mem::take(&mut force.coefficients);
            force = solve_force(&observed, &weights, &roughness, &damping)?;
            going_on()?;
            if self.has_damping {
                damping = self.solve_damping(&rows, &weights, &nodes, &force)?;
            }
            if harmonic {
                let discretised = nodes.interpolation_errors(&force.coefficients);
                widest /= self.refinement(&observed, &weights, &discretised);
            }
            let unexplained = |(row, weights): (&[f64; 2], &Weights)| {
                let conservative = dot(&weights.cosine, &force.coefficients);
                let damped = dot(&weights.cosine_damping, &damping.coefficients);
                [row[0] - conservative - damped, row[1]]
            };
            residuals = observed.iter().zip(&weights).map(unexplained).collect();
            going_on()?;
            self.advance(pass, &mut rows, &weights, &residuals, &force, |k, row| {
                if harmonic {
                    let half = 0.5 * nodes.spacing();
                    let at = |x: f64| {
                        let average = nodes.average(Kernel::Cosine, x, row.at.amplitude);
                        dot(&average, &force.coefficients)
                    };
                    (at(row.closest + half) - at(row.closest - half)) / (2.0 * half)
                } else {
                    motions[k].shift_slope(&harmonics, &nodes, &force.coefficients)
                }
            });
            self.average_slopes(pass, &mut rows, nodes.spacing());
            if let Some(progress) = control.progress {
                progress(pass + 1, PASSES);
            }
        }
        let mut closest: Vec<f64> = rows.iter().map(|row| row.closest).collect();
        closest.sort_by(f64::total_cmp);
        let low = self.resolved(&rows);
        let noise = (0..before.len()).map(|k| force.error(k)).collect();
        let level = bias::level(&force, &nodes, closest[closest.len() - 1]);
        bias::widen(&mut force, &nodes, &closest);
        force.covariance.add_scalar_mut(level * level);
        let inside = (0..before.len()).filter(|k| nodes.0[*k] >= low);
        let changes = inside.map(|k| {
            (force.coefficients[k] - before[k]).abs() / force.error(k).max(f64::MIN_POSITIVE)
        });
        let change = changes.fold(0.0, f64::max);
        if let Some(reason) = undecided(&force, &nodes, change, [low, closest[closest.len() - 1]]) {
            return Err(undetermined(&reason));
        }
        let rows = rows.iter().zip(&weights).zip(&residuals);
        let rows = rows.map(|((estimate, weights), [residual, error])| InvertedRow {
            closest: estimate.closest,
            amplitude: estimate.at.amplitude,
            dissipated: damping.sum(&weights.dissipated),
            residual: residual / error,
        });
        Ok(Inverted {
            rows: rows.collect(),
            nodes,
            force,
            damping,
            low,
            noise,
        })
    }

    /// Returns the least distance at which the force is resolved: that of the row with the closest
    /// approach, but without those few that may be nearest because of their noise.
    fn resolved(&self, rows: &[Estimate]) -> f64 {
        let both = rows.iter().zip(self.rows);
        let felt = both.filter(|(_, row)| row.informative);
        let mut closest: Vec<f64> = felt.map(|(estimate, _)| estimate.closest).collect();
        closest.sort_by(f64::total_cmp);
        closest[closest.len() / 30] + self.amplitude_error(rows)
    }

    /// Median standard error of the amplitude of the tip, m or model units.
    fn amplitude_error(&self, rows: &[Estimate]) -> f64 {
        let both = rows.iter().zip(self.rows);
        median(
            both.map(|(e, row)| spread(e.amplitude_by, row.errors))
                .collect(),
        )
    }

    /// Averages the derivatives of the residuals over rows with nearly the same closest approach:
    /// first with their signs, so that an oscillation cancels, then their squares, so that no row
    /// at an extremum weighs too much.
    fn average_slopes(&self, pass: usize, rows: &mut [Estimate], spacing: f64) {
        let [spacings, errors] = AVERAGED_SLOPES;
        let reach = spacings * spacing + errors * self.amplitude_error(rows);
        let closest: Vec<f64> = rows.iter().map(|row| row.closest).collect();
        let average = |values: &[[f64; 2]], at: f64| {
            let (mut sum, mut total) = ([0.0; 2], 0.0);
            for (x, value) in closest.iter().zip(values) {
                let part = (x - at) / reach;
                let weight = exp(-0.5 * part * part);
                total += weight;
                for (sum, value) in sum.iter_mut().zip(value) {
                    *sum += weight * value;
                }
            }
            sum.map(|sum| sum / total)
        };
        let by: Vec<[f64; 2]> = rows.iter().map(Estimate::own_by).collect();
        let means: Vec<[f64; 2]> = closest.iter().map(|at| average(&by, *at)).collect();
        let squares: Vec<[f64; 2]> = means.iter().map(|mean| mean.map(|m| m * m)).collect();
        for ((row, at), mean) in rows.iter_mut().zip(&closest).zip(&means) {
            let square = average(&squares, *at);
            let known = row.local_by.filter(|_| pass >= ADAPTED);
            row.local_by = Some([0, 1].map(|k| {
                let before = known.map_or(square[k], |by| by[k] * by[k]);
                (0.5 * (square[k] + before)).sqrt().copysign(mean[k])
            }));
        }
    }

    /// Nodes for the range of the closest approaches, at most `widest` apart where the sample is felt.
    fn nodes(&self, rows: &[Estimate], widest: f64) -> Nodes {
        let closest = || rows.iter().map(|row| row.closest);
        let low = closest().fold(f64::INFINITY, f64::min);
        let felt = rows
            .iter()
            .zip(self.rows)
            .filter(|(_, row)| row.informative);
        let fine = felt.map(|(row, _)| row.closest).fold(low, f64::max);
        let far = rows.iter().zip(self.rows).map(|(estimate, row)| {
            let reach = match self.method {
                Method::Amplitude { .. } => row.distance - estimate.at.amplitude,
                // A small oscillation also feels the force at its far end.
                Method::Frequency { .. } => row.distance + estimate.at.amplitude,
            };
            reach.max(estimate.closest)
        });
        Nodes::new(low, fine, far.fold(fine, f64::max), widest)
    }

    /// Returns the conservative part of each row at its measured values, with its standard error: that
    /// of the measurement, and that of a force which is linear between the nodes.
    fn observed(
        &self,
        rows: &[Estimate],
        weights: &[Weights],
        discretised: &[f64],
    ) -> Vec<[f64; 2]> {
        let all = rows.iter().zip(self.rows).zip(weights);
        all.map(|((estimate, row), weights)| {
            let by = estimate.by();
            let back = [0, 1].map(|k| by[k] * (row.values[k] - estimate.values[k]));
            let conservative = estimate.at.conservative + back[0] + back[1];
            let discretisation = interpolation_error(&weights.cosine, discretised);
            let measured = spread(by, row.errors);
            [
                conservative,
                (measured * measured + discretisation * discretisation).sqrt(),
            ]
        })
        .collect()
    }

    /// Returns the number by which the spacing of the nodes is to be divided, so that the interpolation
    /// errs by no more than the measurement in half of the rows that feel the sample. The error goes
    /// as the square of the spacing.
    fn refinement(&self, observed: &[[f64; 2]], weights: &[Weights], discretised: &[f64]) -> f64 {
        let all = observed.iter().zip(weights).zip(self.rows);
        let felt = all.filter(|(_, row)| row.informative);
        let ratios = felt.map(|(([_, error], weights), _)| {
            interpolation_error(&weights.cosine, discretised) / error
        });
        median(ratios.collect()).sqrt().clamp(1.0, MAX_REFINEMENT)
    }

    /// Solves for the damping, with the force known.
    fn solve_damping(
        &self,
        rows: &[Estimate],
        weights: &[Weights],
        nodes: &Nodes,
        force: &Smooth,
    ) -> Result<Smooth, Error> {
        let errors: Vec<f64> = rows
            .iter()
            .zip(self.rows)
            .map(|(estimate, row)| spread(estimate.work_by, row.errors))
            .collect();
        let values: Vec<f64> = rows
            .iter()
            .zip(weights)
            .map(|(estimate, weights)| estimate.at.work - dot(&weights.work, &force.coefficients))
            .collect();
        let matrix = matrix(weights, |weights| &weights.work_damping);
        Smooth::of(&matrix, &values, &errors, &nodes.roughness())
    }

    /// Updates mean deflections, slopes and values of the rows for the next pass.
    fn advance(
        &self,
        pass: usize,
        rows: &mut [Estimate],
        weights: &[Weights],
        residuals: &[[f64; 2]],
        force: &Smooth,
        slope: impl Fn(usize, &Estimate) -> f64,
    ) {
        let compliance = self.gains[0].re;
        for (k, (estimate, row)) in rows.iter_mut().zip(self.rows).enumerate() {
            let [residual, error] = residuals[k];
            if (MOVED..PASSES - 1).contains(&pass) {
                let by = estimate.by();
                let most = MAX_MOVED_RESIDUAL * error;
                // Of a row without an error bound nothing is cut.
                let residual = residual.max(-most).min(most);
                for index in 0..2 {
                    let share = row.errors[index].powi(2) * by[index] / error.powi(2);
                    let there = row.values[index] - share * residual;
                    estimate.values[index] += MOVE * (there - estimate.values[index]);
                }
            }
            estimate.slope = slope(k, estimate);
            let mean = compliance * dot(&weights[k].mean, &force.coefficients);
            let part = if pass < 2 { 1.0 } else { 0.5 };
            estimate.mean += part * (mean - estimate.mean);
        }
    }
}

/// Error for data that do not determine the force.
fn undetermined(reason: &str) -> Error {
    Error::input(
        format!("undecided: the data do not determine the force: {reason}"),
        "start the curve farther from the sample; check the free level, the lever and the standard \
         errors; leave out rows of another motion",
    )
}

/// Returns why the data do not determine the force, if they do not: `change` is the largest one in the
/// last pass, in standard errors, and `range` goes from the least distance that is resolved to the
/// closest approach of the farthest row.
fn undecided(force: &Smooth, nodes: &Nodes, change: f64, range: [f64; 2]) -> Option<String> {
    if change.is_nan() || change > CONVERGED {
        return Some(format!(
            "it still changes by {change:.2} standard errors after {PASSES} passes"
        ));
    }
    let largest = |within: &dyn Fn(f64) -> bool| {
        let values = force.coefficients.iter().enumerate();
        let within = values.filter(|(k, _)| within(nodes.0[*k]));
        let sizes = within.map(|(k, value)| [value.abs(), force.error(k)]);
        sizes
            .max_by(|a, b| a[0].total_cmp(&b[0]))
            .unwrap_or_default()
    };
    let [low, high] = range;
    let ([size, error], [beyond, _]) = (
        largest(&|x| (low..=high).contains(&x)),
        largest(&|x| x > high),
    );
    if size < DETERMINED * error {
        return Some(format!(
            "its largest value is only {:.1} times its standard error",
            size / error
        ));
    }
    (size == 0.0 || beyond > MAX_BEYOND * size).then(|| {
        format!(
            "beyond the closest approach of the farthest row it is {:.0} % of its largest value",
            100.0 * beyond / size
        )
    })
}

/// Returns the weights of force and damping in what a row measures of a sinusoidal motion.
fn sinusoidal(nodes: &Nodes, row: &Estimate) -> Weights {
    let (closest, amplitude) = (row.closest, row.at.amplitude);
    let zeros = vec![0.0; nodes.unknowns()];
    let scaled = |kernel, factor: f64| -> Vec<f64> {
        let weights = nodes.average(kernel, closest, amplitude);
        weights.iter().map(|weight| factor * weight).collect()
    };
    let damped = scaled(
        Kernel::Damping,
        std::f64::consts::PI * amplitude * amplitude,
    );
    Weights {
        cosine: scaled(Kernel::Cosine, 1.0),
        cosine_damping: zeros.clone(),
        work: zeros,
        dissipated: damped.clone(),
        work_damping: damped,
        mean: scaled(Kernel::Mean, 0.5),
    }
}

/// Weighs the rows of a roughness by the local curvature of a known force, so that its well is
/// not smoothed as much as its tail. This halves the error at 45 rows.
fn adapt(roughness: &mut DMatrix<f64>, force: &[f64]) {
    let curvatures = &*roughness * DVector::from_column_slice(force);
    let squares: Vec<f64> = curvatures.iter().map(|c| c * c).collect();
    let count = squares.len();
    let mean = squares.iter().sum::<f64>() / count as f64;
    if mean.is_nan() || mean <= 0.0 {
        return;
    }
    let logarithms: Vec<f64> = (0..count)
        .map(|k| {
            let near = &squares[k.saturating_sub(WINDOW)..(k + WINDOW + 1).min(count)];
            let local = near.iter().sum::<f64>() / near.len() as f64;
            -0.5 * ln(local / mean + BACKGROUND)
        })
        .collect();
    let middle = logarithms.iter().sum::<f64>() / count as f64;
    for (mut row, logarithm) in roughness.row_iter_mut().zip(logarithms) {
        row *= exp(logarithm - middle);
    }
}

/// Error of a row's average that the interpolation between nodes causes: its leading order, and at the
/// turning point, where the weights vary within a spacing, that of a single node.
fn interpolation_error(weights: &[f64], errors: &[f64]) -> f64 {
    let terms = || weights.iter().zip(errors).map(|(w, e)| w * e);
    terms().sum::<f64>().abs() + terms().fold(0.0, |largest: f64, term| largest.max(term.abs()))
}

/// Solves for the force, from the conservative parts less the share of the known damping.
fn solve_force(
    observed: &[[f64; 2]],
    weights: &[Weights],
    roughness: &DMatrix<f64>,
    damping: &Smooth,
) -> Result<Smooth, Error> {
    let rows = observed.iter().zip(weights);
    let left = |([value, _], weights): (&[f64; 2], &Weights)| {
        value - dot(&weights.cosine_damping, &damping.coefficients)
    };
    let values: Vec<f64> = rows.map(left).collect();
    let errors: Vec<f64> = observed.iter().map(|row| row[1]).collect();
    let matrix = matrix(weights, |weights| &weights.cosine);
    Smooth::of(&matrix, &values, &errors, roughness)
}

fn dot(weights: &[f64], coefficients: &[f64]) -> f64 {
    weights.iter().zip(coefficients).map(|(w, c)| w * c).sum()
}

fn matrix(weights: &[Weights], of: impl Fn(&Weights) -> &[f64]) -> DMatrix<f64> {
    let width = weights.first().map_or(0, |row| of(row).len());
    DMatrix::from_fn(weights.len(), width, |i, j| of(&weights[i])[j])
}
