//! The residuals of measured curves and their exact derivatives.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use nanotap_dynamics::PeriodicOrbit;
use rayon::prelude::*;

use crate::case::Case;
use crate::model::Model;
use crate::model::strobe::Strobe;
use crate::observe::{Derivative, Dimension, Observables, Set, measure};

use super::branches::{Along, Candidate, Rows, continued, path};
use super::data::{Data, Row};
use super::parameters::{Parameter, Target};
use super::solve::LeastSquares;

/// Measured curves, a case and what of it is free.
pub(super) struct Problem<'a> {
    pub(super) case: &'a Case,
    pub(super) data: &'a Data,
    pub(super) parameters: &'a [Parameter],
    pub(super) max_period: usize,
    /// Standard errors of a column's values, where the rows give none.
    pub(super) noise: Vec<f64>,
    /// Residuals beyond this many standard errors count by their logarithm only (Cauchy's
    /// loss), so that rows on a branch that is not theirs yet do not lead astray.
    pub(super) robust: Option<f64>,
}

/// The model at one row.
#[derive(Clone, Debug)]
pub(super) struct RowPoint {
    /// The orbit; where it is lost, the last one that was known.
    pub(super) orbit: Option<PeriodicOrbit>,
    /// Whether the orbit has no continuation here: what it says is that of before.
    pub(super) lost: bool,
    /// Its branch.
    pub(super) branch: usize,
    /// What the model says was measured, a place a column, without scales and offsets.
    pub(super) values: Vec<f64>,
    /// All that is observed of it.
    observables: Option<Box<Observables>>,
    /// Derivative of the state by every parameter; empty until it was asked for.
    states: Vec<Vec<f64>>,
    /// The case and its model; none where the orbit is lost.
    at: Option<Arc<(Case, Model)>>,
}

/// The model at all rows, curve after curve.
pub(super) type Point = Vec<RowPoint>;

impl Problem<'_> {
    /// What is observed.
    fn set(&self) -> Set {
        let columns = self.data.columns.iter();
        columns.fold(Set::NONE, |set, column| set.with(column.observable))
    }

    /// The curves' cases at some parameters.
    pub(super) fn cases(&self, x: &[f64]) -> Vec<Case> {
        let of = |curve: usize| {
            let mut case = self.case.clone();
            for (parameter, value) in self.parameters.iter().zip(x) {
                if let (Target::Key(key), true) = (parameter.target, parameter.is_of(curve)) {
                    case = case.with(key, *value);
                }
            }
            case
        };
        (0..self.data.curves.len()).map(of).collect()
    }

    /// Where a row of a curve stands, offsets included.
    pub(super) fn place(&self, x: &[f64], curve: usize, row: &Row) -> Vec<f64> {
        let mut at = row.at.clone();
        for (parameter, value) in self.parameters.iter().zip(x) {
            if let (Target::Place(k), true) = (parameter.target, parameter.is_of(curve)) {
                at[k] += value;
            }
        }
        at
    }

    /// The case at a place.
    fn case_at(&self, base: &Case, at: &[f64]) -> Case {
        let swept = self.data.swept.iter().zip(at);
        swept.fold(base.clone(), |case, (swept, value)| {
            case.with(swept.key, *value)
        })
    }

    /// All rows with their curves.
    pub(super) fn rows(&self) -> Vec<(usize, &Row)> {
        let curves = self.data.curves.iter().enumerate();
        curves
            .flat_map(|(curve, of)| of.rows.iter().map(move |row| (curve, row)))
            .collect()
    }

    /// What an orbit at a row comes to.
    fn seen(
        &self,
        at: Arc<(Case, Model)>,
        branch: usize,
        orbit: PeriodicOrbit,
    ) -> Option<RowPoint> {
        let (case, model) = &*at;
        let start = orbit.states.first()?;
        let observables = measure(model, start, orbit.period, self.set()).ok()?;
        let si = match case.physical() {
            Some(view) => observables.in_si(&view.scales),
            None => observables,
        };
        let values = self.data.columns.iter();
        let values = values.map(|column| (column.observable.of)(&si).number());
        Some(RowPoint {
            values: values.collect::<Option<_>>()?,
            orbit: Some(orbit),
            lost: false,
            branch,
            observables: Some(Box::new(observables)),
            states: Vec::new(),
            at: Some(at),
        })
    }

    /// What the model says of an orbit at a place, a number a column.
    pub(super) fn values(
        &self,
        x: &[f64],
        curve: usize,
        at: &[f64],
        candidate: &Candidate,
    ) -> Option<Vec<f64>> {
        let case = self.case_at(&self.cases(x)[curve], at);
        let model = case.model().ok()?;
        let seen = self.seen(
            Arc::new((case, model)),
            candidate.branch,
            candidate.orbit.clone(),
        )?;
        Some(seen.values)
    }

    /// What the instrument would read in a column where the model says `value`.
    pub(super) fn read(&self, x: &[f64], curve: usize, column: usize, value: f64) -> f64 {
        let (mut scale, mut offset) = (1.0, 0.0);
        for (parameter, value) in self.parameters.iter().zip(x) {
            match parameter.target {
                Target::Scale(of) if of == column && parameter.is_of(curve) => scale = *value,
                Target::Offset(of) if of == column && parameter.is_of(curve) => offset = *value,
                _ => {}
            }
        }
        scale * value + offset
    }

    /// The standard error of a measured value.
    pub(super) fn error(&self, row: &Row, column: usize) -> f64 {
        row.errors[column].unwrap_or(self.noise[column])
    }

    /// Model less measured value; `None` where nothing was measured.
    pub(super) fn difference(
        &self,
        x: &[f64],
        curve: usize,
        row: &Row,
        column: usize,
        value: f64,
    ) -> Option<f64> {
        let difference = self.read(x, curve, column, value) - row.values[column]?;
        let angle = self.data.columns[column].observable.dimension == Dimension::Angle;
        Some(if angle {
            difference - 360.0 * (difference / 360.0).round()
        } else {
            difference
        })
    }

    /// The residual that counts, and its derivative by the plain one.
    fn counted(&self, residual: f64) -> (f64, f64) {
        let Some(c) = self.robust else {
            return (residual, 1.0);
        };
        let t = residual / c;
        let root = t.powi(2).ln_1p().sqrt();
        if root < 1e-8 {
            return (residual, 1.0);
        }
        (c * root.copysign(t), t.abs() / ((1.0 + t * t) * root))
    }

    /// The orbits at all rows, and of these the ones that the data are on; `None` where the
    /// parameters make no sense.
    pub(super) fn discover(&self, x: &[f64]) -> (Point, Vec<Rows>) {
        let bases = self.cases(x);
        let curves: Vec<(Point, Rows)> = self
            .data
            .curves
            .par_iter()
            .enumerate()
            .map(|(curve, of)| {
                let rows = of.rows.iter();
                let places: Vec<_> = rows.map(|row| self.place(x, curve, row)).collect();
                let at = |at: &[f64]| Some(self.case_at(&bases[curve], at));
                let along = Along {
                    at: &at,
                    places: &places,
                    max_period: self.max_period,
                };
                let rows = along.discover();
                (self.choose(x, curve, &bases[curve], &places, &rows), rows)
            })
            .collect();
        let (points, rows): (Vec<Point>, Vec<Rows>) = curves.into_iter().unzip();
        (points.concat(), rows)
    }

    /// Of each row the orbit that its data are on.
    fn choose(
        &self,
        x: &[f64],
        curve: usize,
        base: &Case,
        places: &[Vec<f64>],
        rows: &Rows,
    ) -> Point {
        const PRICE: f64 = 20.0;
        let measured = &self.data.curves[curve].rows;
        let seen: Vec<Vec<Option<RowPoint>>> = (0..rows.len())
            .into_par_iter()
            .map(|row| {
                let case = self.case_at(base, &places[row]);
                let at = case.model().ok().map(|model| Arc::new((case, model)));
                let one = |candidate: &Candidate| {
                    let at = Arc::clone(at.as_ref()?);
                    self.seen(at, candidate.branch, candidate.orbit.clone())
                };
                rows[row].iter().map(one).collect()
            })
            .collect();
        let cost = |row: usize, point: &Option<RowPoint>| {
            let Some(point) = point else { return 1e6 };
            let residuals = (0..self.data.columns.len()).filter_map(|column| {
                let value = point.values[column];
                let difference = self.difference(x, curve, &measured[row], column, value)?;
                let t = difference / self.error(&measured[row], column) / 3.0;
                Some(9.0 * (t * t).ln_1p())
            });
            residuals.sum()
        };
        let costs: Vec<Vec<f64>> = seen
            .iter()
            .enumerate()
            .map(|(row, points)| points.iter().map(|point| cost(row, point)).collect())
            .collect();
        let chosen = path(rows, &costs, PRICE);
        let pick = |(row, chosen): (usize, Option<usize>)| {
            let found = chosen.and_then(|k| seen[row][k].clone());
            found.unwrap_or_else(|| RowPoint {
                orbit: None,
                lost: true,
                branch: usize::MAX,
                values: vec![f64::NAN; self.data.columns.len()],
                observables: None,
                states: Vec::new(),
                at: None,
            })
        };
        chosen.into_iter().enumerate().map(pick).collect()
    }

    /// The derivatives of the state and of what was measured by one parameter.
    fn derivative(
        &self,
        x: &[f64],
        (curve, point): (usize, &RowPoint),
        parameter: usize,
    ) -> Option<(Vec<f64>, Vec<f64>)> {
        let (at, orbit) = (point.at.as_ref()?, point.orbit.as_ref()?);
        let (case, model) = &**at;
        let start = orbit.states.first()?;
        let columns = &self.data.columns;
        let still = || vec![0.0; start.len()];
        let of = &self.parameters[parameter];
        if !of.is_of(curve) {
            return Some((still(), vec![0.0; columns.len()]));
        }
        let key = match of.target {
            Target::Key(key) => key,
            Target::Place(at) => self.data.swept[at].key,
            Target::Offset(column) | Target::Scale(column) => {
                let mut by = vec![0.0; columns.len()];
                by[column] = match of.target {
                    Target::Scale(_) => point.values[column],
                    _ => 1.0,
                };
                return Some((still(), by));
            }
        };
        let observables = point.observables.as_ref()?;
        let at = (start.as_slice(), orbit.period);
        let derivative = Derivative::of(case, model, key, at, observables, self.set()).ok()?;
        let by = columns.iter().enumerate().map(|(column, of)| {
            let number = if case.is_physical() {
                derivative.number_in_si(of.observable)
            } else {
                derivative.number(of.observable)
            };
            let scale = self.read(x, curve, column, 1.0) - self.read(x, curve, column, 0.0);
            number.map(|number| scale * number)
        });
        let by = by.collect::<Option<Vec<f64>>>()?;
        Some((derivative.state, by))
    }
}

impl LeastSquares for Problem<'_> {
    type Point = Point;

    fn point(&self, x: &[f64], (before, from): (&[f64], &Point)) -> Option<Point> {
        let bases = self.cases(x);
        if bases
            .iter()
            .any(|case| case.is_physical() && case.physical().is_none())
        {
            return None;
        }
        let one = |((curve, row), before_point): (&(usize, &Row), &RowPoint)| {
            let lost = || RowPoint {
                lost: true,
                observables: None,
                at: None,
                states: Vec::new(),
                ..before_point.clone()
            };
            let case = self.case_at(&bases[*curve], &self.place(x, *curve, row));
            let follow = move || {
                let mut guess = before_point.orbit.clone()?;
                // To first order where the orbit goes.
                if let ([only], false) = (guess.states.as_mut_slice(), before_point.lost) {
                    for (k, by) in before_point.states.iter().enumerate() {
                        let change = x[k] - before[k];
                        only.iter_mut()
                            .zip(by)
                            .for_each(|(s, by)| *s += change * by);
                    }
                }
                let model = case.model().ok()?;
                let orbit = continued(&mut Strobe::new(&model), &guess)?;
                self.seen(Arc::new((case, model)), before_point.branch, orbit)
            };
            follow().unwrap_or_else(lost)
        };
        let rows = self.rows();
        Some(rows.par_iter().zip(from.par_iter()).map(one).collect())
    }

    fn residuals(&self, x: &[f64], point: &Point) -> DVector<f64> {
        let columns = 0..self.data.columns.len();
        let rows = self.rows();
        let all = rows.iter().zip(point).flat_map(|((curve, row), point)| {
            columns.clone().map(move |column| {
                let value = point.values[column];
                if !value.is_finite() {
                    return 0.0;
                }
                let difference = self.difference(x, *curve, row, column, value);
                difference.map_or(0.0, |d| self.counted(d / self.error(row, column)).0)
            })
        });
        DVector::from_iterator(rows.len() * columns.len(), all)
    }

    fn jacobian(&self, x: &[f64], point: &mut Point) -> Option<DMatrix<f64>> {
        let (columns, count) = (self.data.columns.len(), self.parameters.len());
        let rows = self.rows();
        let blocks: Vec<DMatrix<f64>> = rows
            .par_iter()
            .zip(point.par_iter_mut())
            .map(|((curve, row), point)| {
                let mut block = DMatrix::zeros(columns, count);
                if point.lost {
                    return block;
                }
                let by: Option<Vec<_>> = (0..count)
                    .map(|parameter| self.derivative(x, (*curve, point), parameter))
                    .collect();
                let Some(by) = by else {
                    return block;
                };
                for (k, (_, values)) in by.iter().enumerate() {
                    for column in 0..columns {
                        let value = point.values[column];
                        let difference = self.difference(x, *curve, row, column, value);
                        let Some(difference) = difference else {
                            continue;
                        };
                        let error = self.error(row, column);
                        let slope = self.counted(difference / error).1;
                        block[(column, k)] = slope * values[column] / error;
                    }
                }
                point.states = by.into_iter().map(|(state, _)| state).collect();
                block
            })
            .collect();
        let mut jacobian = DMatrix::zeros(rows.len() * columns, count);
        for (row, block) in blocks.iter().enumerate() {
            jacobian.rows_mut(row * columns, columns).copy_from(block);
        }
        jacobian.iter().all(|v| v.is_finite()).then_some(jacobian)
    }
}
