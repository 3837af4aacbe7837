//! The residuals of measured curves and their exact derivatives.

pub(super) mod held;
mod rest;

use std::ops::Deref;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use nanotap_dynamics::PeriodicOrbit;
use rayon::prelude::*;

use nanotap_case::{Case, Key};
use nanotap_model::Model;
use nanotap_model::model_map::ModelMap;
use nanotap_observe::{Derivative, ObservableSet, Observables, measure};

use crate::fit::branches::{
    Candidate, RowCases, Rows, newton_continuation, path, release_branch_ends,
};
use crate::fit::data::{Column, Data, Row};
use crate::fit::effort::Effort;
use crate::fit::jumps::{Fold, Jump};
use crate::fit::parameters::{Parameter, Target};
use crate::fit::solve::LeastSquares;
use crate::fit::statistics::span;
use crate::fit::terms::Term;
use held::{HeldRow, Loop};
pub(super) use rest::MAX_RINGING;
use rest::Nearby;
pub(super) use rest::Rested;

use nanotap_scan::force_curve::StableRest;

/// Measured curves, a case, and its free parameters.
#[derive(Clone)]
pub(super) struct Problem<'a> {
    pub(super) case: &'a Case,
    pub(super) data: &'a Data,
    pub(super) parameters: &'a [Parameter],
    pub(super) max_period: usize,
    /// Standard errors of the values of each column, for rows that give none.
    pub(super) noise: Vec<f64>,
    /// Residuals beyond this many standard errors count by their logarithm only (Cauchy's loss), so
    /// that rows on the wrong branch do not mislead the fit.
    pub(super) robust: Option<f64>,
    /// Jumps whose folds are data in addition to the rows.
    pub(super) jumps: Vec<Jump>,
    /// Settings of a loop of frequency modulation.
    pub(super) held: Option<Loop>,
    pub(super) effort: &'a Effort,
}

/// Keys of the case, each with its derivative by a parameter.
pub(super) type Effects = Vec<(Key, f64)>;

/// The model at one row.
#[derive(Clone, Debug)]
pub(super) struct RowPoint {
    /// The orbit; if it is lost, the last known one.
    pub(super) orbit: Option<PeriodicOrbit>,
    /// True if the orbit has no continuation here; its values are then the previous ones.
    pub(super) lost: bool,
    /// Index of the branch on which the orbit lies.
    pub(super) branch: usize,
    /// The model's values, one per column, without scales and offsets.
    pub(super) values: Vec<f64>,
    /// All observables of the orbit.
    pub(super) observables: Option<Box<Observables>>,
    /// Derivatives of the state by every parameter; under frequency modulation, of drive and state.
    /// Empty until requested.
    pub(super) states: Vec<Vec<f64>>,
    /// The case and its model; `None` if the orbit is lost.
    pub(super) at: Option<Arc<(Case, Model)>>,
    /// The orbit under frequency modulation; if it is lost, the last known one.
    pub(super) held: Option<Box<HeldRow>>,
    /// The lever at rest, of a force curve.
    pub(super) rest: Option<StableRest>,
}

impl RowPoint {
    /// A row without an orbit.
    pub(super) fn empty(columns: usize) -> Self {
        Self {
            orbit: None,
            lost: true,
            branch: usize::MAX,
            values: vec![f64::NAN; columns],
            observables: None,
            states: Vec::new(),
            at: None,
            held: None,
            rest: None,
        }
    }

    /// Returns the same row, marked as lost: its orbit has no continuation.
    pub(super) fn without_orbit(&self) -> Self {
        Self {
            lost: true,
            observables: None,
            at: None,
            states: Vec::new(),
            ..self.clone()
        }
    }
}

/// The model at all rows, curve by curve, and at the folds of the jumps.
#[derive(Clone, Debug, Default)]
pub(super) struct Point {
    pub(super) rows: Vec<RowPoint>,
    /// One per jump; `None` if there is no fold.
    pub(super) folds: Vec<Option<Fold>>,
}

impl Deref for Point {
    type Target = [RowPoint];

    fn deref(&self) -> &[RowPoint] {
        &self.rows
    }
}

impl Problem<'_> {
    /// Returns the computed rows; `None` once the computation is cancelled, because orbits may be
    /// missing then.
    pub(super) fn finished<T>(&self, computed: T) -> Option<T> {
        (!self.case.cancel().is_cancelled()).then_some(computed)
    }

    /// Returns the set of the observables in the columns.
    fn set(&self) -> ObservableSet {
        let columns = self.data.columns.iter();
        let observed = columns.filter_map(|column| column.quantity.observable());
        observed.fold(ObservableSet::NONE, ObservableSet::with)
    }

    /// The cases of the curves for given parameters.
    pub(super) fn cases(&self, x: &[f64]) -> Vec<Case> {
        let of = |curve: usize| {
            let mut case = self.case.clone();
            for (parameter, value) in self.parameters.iter().zip(x) {
                if let (Target::Key(key), true) = (parameter.target, parameter.is_of(curve)) {
                    case = case.with(key, *value);
                }
            }
            match self.held_strength() {
                // The strength at the frequency of the case, while the rows set other frequencies.
                Some(strength) => {
                    let value = case.get(strength);
                    case.with(strength, value)
                }
                None => case,
            }
        };
        (0..self.data.curves.len()).map(of).collect()
    }

    /// The key of the drive strength, if it follows from a free amplitude that is a parameter and
    /// the rows set the frequency.
    fn held_strength(&self) -> Option<Key> {
        let free = Target::Key(Key::DriveFreeAmplitude);
        let sets_frequency = self.data.swept.iter().any(|s| s.key == Key::DriveFrequency);
        if !sets_frequency || !self.parameters.iter().any(|p| p.target == free) {
            return None;
        }
        let known = |key: &Key| self.case.get(*key).is_finite();
        [Key::DriveAmplitude, Key::DriveForce]
            .into_iter()
            .find(known)
    }

    /// Effects of each parameter in each curve: keys of the case, each with its derivative by the
    /// parameter.
    pub(super) fn effects(&self, x: &[f64]) -> Vec<Vec<Effects>> {
        let plain = |parameter: &Parameter| match parameter.target {
            Target::Key(key) => vec![(key, 1.0)],
            Target::Place(at) => vec![(self.data.swept[at].key, 1.0)],
            // The weight is that of a row: `effects_at`.
            Target::Term(Term::Drag | Term::Drift | Term::Backlash, _) => {
                vec![(self.data.swept[0].key, 1.0)]
            }
            Target::Offset(_) | Target::Scale(_) | Target::Term(..) => Vec::new(),
        };
        let mut all: Vec<Vec<Effects>> = (0..self.data.curves.len())
            .map(|_| self.parameters.iter().map(plain).collect())
            .collect();
        let Some(strength) = self.held_strength() else {
            return all;
        };
        // The mapping is a sequence of closed forms: a central difference is accurate to ten
        // digits.
        for (k, parameter) in self.parameters.iter().enumerate() {
            let Target::Key(key) = parameter.target else {
                continue;
            };
            let step = 1e-5
                * if x[k] == 0.0 {
                    parameter.size
                } else {
                    x[k].abs()
                };
            let at_side = |side: f64| {
                let mut x = x.to_vec();
                x[k] += side * step;
                self.cases(&x)
            };
            let (low, high) = (at_side(-1.0), at_side(1.0));
            for (curve, effects) in all.iter_mut().enumerate() {
                let slope = (high[curve].get(strength) - low[curve].get(strength)) / (2.0 * step);
                if key == Key::DriveFreeAmplitude {
                    effects[k] = vec![(strength, slope)];
                } else if key != strength && slope != 0.0 && slope.is_finite() {
                    effects[k].push((strength, slope));
                }
            }
        }
        all
    }

    /// The effects of each parameter at a row.
    fn effects_at(&self, effects: &[Effects], curve: usize, row: &Row) -> Vec<Effects> {
        let of = |(parameter, effects): (&Parameter, &Effects)| match parameter.target {
            Target::Term(..) => {
                let by = self.shift_by(parameter, curve, row);
                let effects = effects.iter().filter(|_| by != 0.0);
                effects.map(|(key, weight)| (*key, weight * by)).collect()
            }
            _ => effects.clone(),
        };
        self.parameters.iter().zip(effects).map(of).collect()
    }

    /// Position of a row of a curve, with offsets.
    pub(super) fn place(&self, x: &[f64], curve: usize, row: &Row) -> Vec<f64> {
        let mut at = row.at.clone();
        for (parameter, value) in self.parameters.iter().zip(x) {
            if let (Target::Place(k), true) = (parameter.target, parameter.is_of(curve)) {
                at[k] += value;
            }
            let shift = self.shift_by(parameter, curve, row);
            if shift != 0.0 {
                at[0] += value * shift;
            }
        }
        at
    }

    /// The case at a position.
    pub(super) fn case_at(&self, base: &Case, at: &[f64]) -> Case {
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

    /// The result for an orbit at a row.
    fn row_point(
        &self,
        at: Arc<(Case, Model)>,
        branch: usize,
        orbit: PeriodicOrbit,
    ) -> Option<RowPoint> {
        let (case, model) = &*at;
        let start = orbit.states.first()?;
        self.effort.add_orbit();
        let observables = measure(model, start, orbit.period, self.set()).ok()?;
        let si = match case.physical() {
            Some(view) => observables.in_si(&view.scales),
            None => observables,
        };
        let values = self.data.columns.iter();
        let values = values.map(|column| (column.quantity.observable()?.of)(&si).number());
        Some(RowPoint {
            values: values.collect::<Option<_>>()?,
            orbit: Some(orbit),
            lost: false,
            branch,
            observables: Some(Box::new(observables)),
            at: Some(at),
            ..RowPoint::empty(0)
        })
    }

    /// The model's values of an orbit at a position, one per column.
    pub(super) fn values(
        &self,
        x: &[f64],
        curve: usize,
        at: &[f64],
        candidate: &Candidate,
    ) -> Option<Vec<f64>> {
        self.finished(())?;
        let case = self.case_at(&self.cases(x)[curve], at);
        let model = case.model().ok()?;
        let seen = self.row_point(
            Arc::new((case, model)),
            candidate.branch,
            candidate.orbit.clone(),
        )?;
        Some(seen.values)
    }

    /// The reading of the instrument in a column for the model's `value`.
    pub(super) fn read(
        &self,
        x: &[f64],
        curve: usize,
        row: &Row,
        column: usize,
        value: f64,
    ) -> f64 {
        let (mut scale, mut offset) = (1.0, 0.0);
        for (parameter, value) in self.parameters.iter().zip(x) {
            match parameter.target {
                Target::Scale(of) if of == column && parameter.is_of(curve) => scale = *value,
                Target::Offset(of) if of == column && parameter.is_of(curve) => offset = *value,
                _ => {}
            }
        }
        scale * value + offset + self.terms(x, curve, row, column)
    }

    /// The change of a reading with the model's value.
    pub(super) fn scale(&self, x: &[f64], curve: usize, column: usize) -> f64 {
        let of = |(parameter, value): (&Parameter, &f64)| {
            let is_scale = parameter.target == Target::Scale(column) && parameter.is_of(curve);
            is_scale.then_some(*value)
        };
        let mut scales = self.parameters.iter().zip(x).filter_map(of);
        scales.next().unwrap_or(1.0)
    }

    /// A measured value without scale and offset.
    pub(super) fn unread(
        &self,
        x: &[f64],
        curve: usize,
        row: &Row,
        column: usize,
        value: f64,
    ) -> f64 {
        (value - self.read(x, curve, row, column, 0.0)) / self.scale(x, curve, column)
    }

    /// The standard error of a measured value.
    pub(super) fn error(&self, row: &Row, column: usize) -> f64 {
        row.errors[column].unwrap_or(row.relative[column] * self.noise[column])
    }

    /// Model minus measured value; `None` if nothing was measured.
    pub(super) fn difference(
        &self,
        x: &[f64],
        curve: usize,
        row: &Row,
        column: usize,
        value: f64,
    ) -> Option<f64> {
        let difference = self.read(x, curve, row, column, value) - row.values[column]?;
        Some(if self.data.columns[column].quantity.is_angle() {
            difference - 360.0 * (difference / 360.0).round()
        } else {
            difference
        })
    }

    /// The residual with Cauchy's loss, and its derivative by the plain residual.
    fn counted(&self, residual: f64) -> (f64, f64) {
        let Some(c) = self.robust else {
            return (residual, 1.0);
        };
        let t = residual / c;
        let root = nanotap_arithmetic::ln_1p(t.powi(2)).sqrt();
        if root < 1e-8 {
            return (residual, 1.0);
        }
        (c * root.copysign(t), t.abs() / ((1.0 + t * t) * root))
    }

    /// Finds the orbits at all rows, and selects those of the data; `None` if the parameters are
    /// invalid.
    ///
    /// `before` are all orbits at similar parameters: if each of them continues here, no others are
    /// searched for.
    pub(super) fn discover(&self, x: &[f64], before: Option<&[Rows]>) -> (Point, Vec<Rows>) {
        if let Some(held) = self.held {
            return held.discover(self, x);
        }
        if self.data.is_force_curve() {
            return self.discover_rests(x);
        }
        let bases = self.cases(x);
        let curves: Vec<(Point, Rows)> = self
            .data
            .curves
            .par_iter()
            .enumerate()
            .map(|(curve, of)| {
                let rows = of.rows.iter();
                let places: Vec<_> = rows.map(|row| self.place(x, curve, row)).collect();
                let at = |at: &[f64]| {
                    self.finished(())?;
                    Some(self.case_at(&bases[curve], at))
                };
                let measured =
                    |row: usize, model: &Model| self.measured(x, curve, &of.rows[row], model);
                let along = RowCases {
                    at: &at,
                    measured: &measured,
                    places: &places,
                    max_period: self.max_period,
                };
                let known = before.and_then(|rows| along.continued_from(rows.get(curve)?));
                let rows = known.unwrap_or_else(|| along.discover());
                (self.choose(x, curve, &bases[curve], &places, &rows), rows)
            })
            .collect();
        let (points, rows): (Vec<Point>, Vec<Rows>) = curves.into_iter().unzip();
        let point = Point {
            rows: points.into_iter().flat_map(|point| point.rows).collect(),
            folds: Vec::new(),
        };
        (point, rows)
    }

    /// A state at drive phase 0 whose first mode has the measured amplitude and phase of a row,
    /// without scales and offsets: W = A sin(Ωτ − φ).
    fn measured(&self, x: &[f64], curve: usize, row: &Row, model: &Model) -> Option<Vec<f64>> {
        let known = |names: [&str; 2]| {
            let columns = &self.data.columns;
            let named = |c: &Column| names.contains(&c.quantity.name());
            let column = columns.iter().position(named)?;
            Some(self.unread(x, curve, row, column, row.values[column]?))
        };
        let amplitude = known(["first_harmonic", "amplitude"])?;
        let amplitude = match self.case.physical() {
            Some(view) => amplitude / view.scales.length,
            None => amplitude,
        };
        let (sine, cosine) = nanotap_arithmetic::sin_cos(known(["phase", "phase"])?.to_radians());
        let mut state = vec![0.0; model.dimension()];
        let swing = amplitude / model.tip.row[0];
        let modes = (state.len() - model.memory) / 2;
        state[0] = -swing * sine;
        state[modes] = swing * cosine * model.frequency();
        state.iter().all(|v| v.is_finite()).then_some(state)
    }

    /// Finds the jumps of the data: neighbouring rows on different branches, both of which describe
    /// their rows, the first ending in a fold. The folds are added to `point`.
    pub(super) fn find_jumps(&mut self, x: &[f64], point: &mut Point) {
        self.jumps.clear();
        point.folds.clear();
        // Other folds end a branch if a loop controls amplitude and phase, and the jumps of a force
        // curve ring.
        if self.held.is_some() || self.data.is_force_curve() {
            return;
        }
        let rows = self.rows();
        let near = |k: usize| {
            let (curve, row) = rows[k];
            (0..self.data.columns.len()).all(|column| {
                let value = point[k].values[column];
                let difference = self.difference(x, curve, row, column, value);
                difference.is_none_or(|d| d.abs() < MAX_JUMP_RESIDUAL * self.error(row, column))
            })
        };
        let bases = self.cases(x);
        let mut jumps = Vec::new();
        let mut first = 0;
        let with_orbit: Vec<usize> = (0..rows.len()).filter(|k| !point[*k].lost).collect();
        for pair in with_orbit.windows(2) {
            let [before, k] = [pair[0], pair[1]];
            let (same_curve, same_branch) = (
                rows[before].0 == rows[k].0,
                point[before].branch == point[k].branch,
            );
            if same_curve && same_branch {
                continue;
            }
            let run = first;
            first = k;
            let between = [rows[before].1.at[0], rows[k].1.at[0]];
            if !same_curve || between[0] == between[1] || !near(before) || !near(k) {
                continue;
            }
            let all = rows.iter().filter(|row| row.0 == rows[k].0);
            let [low, high] = span(all.map(|row| row.1.at[0]));
            jumps.push(Jump {
                curve: rows[k].0,
                rows: [before, k],
                first: run,
                between,
                reach: FOLD_REACH * (high - low),
            });
        }
        let folds = jumps
            .par_iter()
            .map(|jump| self.fold(x, &bases, &point.rows, jump));
        let found: Vec<Option<Fold>> = folds.collect();
        (self.jumps, point.folds) = jumps
            .into_iter()
            .zip(found)
            .filter(|(_, fold)| fold.is_some())
            .unzip();
    }

    /// The fold at the end of the branch before a jump.
    fn fold(&self, x: &[f64], bases: &[Case], rows: &[RowPoint], jump: &Jump) -> Option<Fold> {
        let of = &self.data.curves[jump.curve].rows;
        let run = (jump.first..=jump.rows[0]).rev();
        let (index, orbit) = run
            .filter(|k| !rows[*k].lost)
            .find_map(|k| Some((k, rows[k].orbit.as_ref()?)))?;
        let row = of.get(index - self.index_of(jump.curve))?;
        let at = self.place(x, jump.curve, row);
        let base = self.case_at(&bases[jump.curve], &at);
        let offset = at[0] - row.at[0];
        Fold::beyond(&base, &self.data.swept[0], (at[0], orbit), (jump, offset))
    }

    /// Index of the first row of a curve among all rows.
    fn index_of(&self, curve: usize) -> usize {
        self.data.curves[..curve].iter().map(|c| c.rows.len()).sum()
    }

    /// Model minus measured location of a jump, in standard errors; 0 if there is no fold.
    pub(super) fn jump_residual(&self, x: &[f64], point: &Point, index: usize) -> f64 {
        let (jump, fold) = (&self.jumps[index], &point.folds[index]);
        let all = self.parameters.iter().zip(x);
        let offset: f64 = all
            .map(|(p, value)| self.shift_of_jump(p, jump) * value)
            .sum();
        fold.as_ref()
            .map_or(0.0, |fold| (fold.at - offset - jump.at()) / jump.error())
    }

    /// Change of the place of a jump by a parameter that changes the distances of rows, per unit of
    /// its value.
    fn shift_of_jump(&self, parameter: &Parameter, jump: &Jump) -> f64 {
        if parameter.target == Target::Place(0) {
            return f64::from(u8::from(parameter.is_of(jump.curve)));
        }
        let Target::Term(..) = parameter.target else {
            return 0.0;
        };
        let rows = &self.data.curves[jump.curve].rows;
        let first = self.index_of(jump.curve);
        let of = jump
            .rows
            .map(|row| self.shift_by(parameter, jump.curve, &rows[row - first]));
        0.5 * (of[0] + of[1])
    }

    /// Derivatives of the residual of a jump.
    fn jump_derivatives(&self, effects: &[Vec<Effects>], point: &Point, index: usize) -> Vec<f64> {
        let (jump, fold) = (&self.jumps[index], &point.folds[index]);
        let offset = |parameter: &Parameter| self.shift_of_jump(parameter, jump);
        // A location that does not change still has its offset.
        let still = || {
            let parameters = self.parameters.iter();
            parameters.map(|p| -offset(p) / jump.error()).collect()
        };
        let Some(fold) = fold.as_ref().filter(|fold| !fold.lost) else {
            return still();
        };
        let swept = self.data.swept[0].key;
        let effects = &effects[jump.curve];
        let mut keys: Vec<Key> = effects.iter().flatten().map(|(key, _)| *key).collect();
        keys.sort_unstable();
        keys.dedup();
        keys.retain(|key| *key != swept);
        let Some(by_key) = fold.derivatives(swept, &keys) else {
            return still();
        };
        let slope = |(k, parameter): (usize, &Parameter)| {
            if !parameter.is_of(jump.curve) {
                return 0.0;
            }
            let sum: f64 = effects[k]
                .iter()
                .filter_map(|(key, by)| {
                    let at = keys.iter().position(|other| other == key)?;
                    Some(by * by_key[at])
                })
                .sum();
            (sum - offset(parameter)) / jump.error()
        };
        self.parameters.iter().enumerate().map(slope).collect()
    }

    /// Selects the orbit of each row that belongs to the data.
    fn choose(
        &self,
        x: &[f64],
        curve: usize,
        base: &Case,
        places: &[Vec<f64>],
        rows: &Rows,
    ) -> Point {
        let measured = &self.data.curves[curve].rows;
        let seen: Vec<Vec<Option<RowPoint>>> = (0..rows.len())
            .into_par_iter()
            .map(|row| {
                let at = self.finished(()).and_then(|()| {
                    let case = self.case_at(base, &places[row]);
                    let model = case.model().ok()?;
                    Some(Arc::new((case, model)))
                });
                let one = |candidate: &Candidate| {
                    let at = Arc::clone(at.as_ref()?);
                    self.row_point(at, candidate.branch, candidate.orbit.clone())
                };
                rows[row].iter().map(one).collect()
            })
            .collect();
        let branches: Vec<Vec<usize>> = rows
            .iter()
            .map(|row| row.iter().map(|candidate| candidate.branch).collect())
            .collect();
        self.chosen(x, (curve, measured), &branches, &seen)
    }

    /// Selects of the points of each row, with their branches, the one that belongs to the data.
    fn chosen(
        &self,
        x: &[f64],
        (curve, measured): (usize, &[Row]),
        branches: &[Vec<usize>],
        seen: &[Vec<Option<RowPoint>>],
    ) -> Point {
        /// Cost of a change of branch from one row to the next, as a sum of squared residuals.
        const BRANCH_CHANGE_COST: f64 = 20.0;
        // One residual of eight standard errors.
        const MAX_NOISE_COST: f64 = 18.0;
        let cost = |row: usize, point: &Option<RowPoint>| {
            let Some(point) = point else { return 1e6 };
            let residuals = (0..self.data.columns.len()).filter_map(|column| {
                let value = point.values[column];
                let difference = self.difference(x, curve, &measured[row], column, value)?;
                let t = difference / self.error(&measured[row], column) / 3.0;
                Some(9.0 * nanotap_arithmetic::ln_1p(t * t))
            });
            residuals.sum()
        };
        let costs: Vec<Vec<f64>> = seen
            .iter()
            .enumerate()
            .map(|(row, points)| points.iter().map(|point| cost(row, point)).collect())
            .collect();
        let mut chosen = path(branches, &costs, BRANCH_CHANGE_COST);
        if !self.data.is_force_curve() {
            release_branch_ends(branches, &costs, MAX_NOISE_COST, &mut chosen);
        } else if self.robust.is_none() {
            self.release_ringing(x, (curve, measured), seen, &mut chosen);
        }
        let pick = |(row, chosen): (usize, Option<usize>)| {
            let found = chosen.and_then(|k| seen[row][k].clone());
            found.unwrap_or_else(|| RowPoint::empty(self.data.columns.len()))
        };
        Point {
            rows: chosen.into_iter().enumerate().map(pick).collect(),
            folds: Vec::new(),
        }
    }

    /// Derivatives of the state and of the measured values by every parameter, with known `effects`
    /// on the case.
    fn derivatives(
        &self,
        x: &[f64],
        (curve, point): (usize, &RowPoint),
        effects: &[Effects],
    ) -> Option<Vec<(Vec<f64>, Vec<f64>)>> {
        let (at, orbit) = (point.at.as_ref()?, point.orbit.as_ref()?);
        let (case, model) = &**at;
        let start = orbit.states.first()?;
        let columns = &self.data.columns;
        let observables = point.observables.as_ref()?;
        let own = || {
            let all = self.parameters.iter().zip(effects);
            all.filter(|(parameter, _)| parameter.is_of(curve))
        };
        let mut keys: Vec<Key> = own().flat_map(|(_, of)| of).map(|(key, _)| *key).collect();
        keys.sort_unstable();
        keys.dedup();
        let place = (start.as_slice(), orbit.period);
        let by_key =
            Derivative::of_keys(case, model, &keys, place, observables, self.set()).ok()?;
        let scales: Vec<f64> = (0..columns.len())
            .map(|column| self.scale(x, curve, column))
            .collect();
        let one = |(parameter, effects): (&Parameter, &Effects)| {
            let mut state = vec![0.0; start.len()];
            if !parameter.is_of(curve) {
                return Some((state, vec![0.0; columns.len()]));
            }
            let mut by = vec![0.0; columns.len()];
            for (key, weight) in effects {
                let derivative = &by_key[keys.binary_search(key).ok()?];
                state
                    .iter_mut()
                    .zip(&derivative.state)
                    .for_each(|(sum, part)| *sum += weight * part);
                for (column, of) in columns.iter().enumerate() {
                    let observable = of.quantity.observable()?;
                    let number = if case.is_physical() {
                        derivative.number_in_si(observable)
                    } else {
                        derivative.number(observable)
                    };
                    by[column] += weight * scales[column] * number?;
                }
            }
            Some((state, by))
        };
        self.parameters.iter().zip(effects).map(one).collect()
    }
}

/// Largest residual, in standard errors, of rows next to a jump that counts.
const MAX_JUMP_RESIDUAL: f64 = 6.0;
/// Largest distance of a fold beyond its jump, as a fraction of the length of the curve.
const FOLD_REACH: f64 = 0.5;

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
        if let Some(held) = self.held {
            let point = held.follow(self, (x, &bases), (before, from));
            return self.finished(point);
        }
        if self.data.is_force_curve() {
            return self.finished(self.follow_rests(x, from));
        }
        let one = |((curve, row), before_point): (&(usize, &Row), &RowPoint)| {
            let lost = || before_point.without_orbit();
            let follow = || {
                self.finished(())?;
                let case = self.case_at(&bases[*curve], &self.place(x, *curve, row));
                let mut guess = before_point.orbit.clone()?;
                // Prediction of the orbit to first order.
                if let ([only], false) = (guess.states.as_mut_slice(), before_point.lost) {
                    for (k, by) in before_point.states.iter().enumerate() {
                        let change = x[k] - before[k];
                        only.iter_mut()
                            .zip(by)
                            .for_each(|(s, by)| *s += change * by);
                    }
                }
                let model = case.model().ok()?;
                let orbit = newton_continuation(&mut ModelMap::new(&model), &guess)?;
                self.row_point(Arc::new((case, model)), before_point.branch, orbit)
            };
            follow().unwrap_or_else(lost)
        };
        let rows = self.rows();
        let rows: Vec<RowPoint> = rows.par_iter().zip(from.par_iter()).map(one).collect();
        let folds = self
            .jumps
            .par_iter()
            .zip(&from.folds)
            .map(|(jump, before)| {
                let found = self.fold(x, &bases, &rows, jump);
                found.or_else(|| Some(before.as_ref()?.of_before()))
            });
        let folds = folds.collect();
        self.finished(Point { rows, folds })
    }

    fn residuals(&self, x: &[f64], point: &Point) -> DVector<f64> {
        let columns = 0..self.data.columns.len();
        let rows = self.rows();
        let jumps = (0..self.jumps.len()).map(|index| self.jump_residual(x, point, index));
        let all = rows
            .iter()
            .zip(point.iter())
            .flat_map(|((curve, row), point)| {
                columns.clone().map(move |column| {
                    let value = point.values[column];
                    if !value.is_finite() {
                        return 0.0;
                    }
                    let difference = self.difference(x, *curve, row, column, value);
                    difference.map_or(0.0, |d| self.counted(d / self.error(row, column)).0)
                })
            });
        let priors = self.prior_residuals(x);
        let count = rows.len() * columns.len() + self.jumps.len() + priors.len();
        DVector::from_iterator(count, all.chain(jumps).chain(priors))
    }

    fn jacobian(&self, x: &[f64], point: &mut Point) -> Option<DMatrix<f64>> {
        let (columns, count) = (self.data.columns.len(), self.parameters.len());
        let rows = self.rows();
        let effects = self.effects(x);
        let nearby = self.data.is_force_curve();
        let nearby = nearby.then(|| Nearby::of(self, x, &effects));
        let jumps = (0..self.jumps.len()).into_par_iter();
        let jumps: Vec<Vec<f64>> = jumps
            .map(|index| self.jump_derivatives(&effects, point, index))
            .collect();
        let blocks: Vec<DMatrix<f64>> = rows
            .par_iter()
            .zip(point.rows.par_iter_mut())
            .map(|((curve, row), point)| {
                let mut block = DMatrix::zeros(columns, count);
                if point.lost || self.finished(()).is_none() {
                    return block;
                }
                let effects = &self.effects_at(&effects[*curve], *curve, row);
                let by: Option<Vec<_>> = match (self.held, &nearby) {
                    (Some(_), _) => Loop::derivatives(self, x, (*curve, point), effects),
                    (_, Some(nearby)) => {
                        let at = self.place(x, *curve, row)[0];
                        nearby.derivatives(self, x, (*curve, point, at), effects)
                    }
                    _ => self.derivatives(x, (*curve, point), effects),
                };
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
                        let direct = self.direct(x, (*curve, row), k, (column, value));
                        block[(column, k)] = slope * (values[column] + direct) / error;
                    }
                }
                point.states = by.into_iter().map(|(state, _)| state).collect();
                block
            })
            .collect();
        let priors: Vec<(usize, f64)> = (self.parameters.iter().enumerate())
            .filter_map(|(k, parameter)| Some((k, parameter.prior?[1])))
            .collect();
        let first = rows.len() * columns + jumps.len();
        let mut jacobian = DMatrix::zeros(first + priors.len(), count);
        for (row, (k, deviation)) in priors.into_iter().enumerate() {
            jacobian[(first + row, k)] = 1.0 / deviation;
        }
        for (row, block) in blocks.iter().enumerate() {
            jacobian.rows_mut(row * columns, columns).copy_from(block);
        }
        for (index, slopes) in jumps.iter().enumerate() {
            for (k, slope) in slopes.iter().enumerate() {
                jacobian[(rows.len() * columns + index, k)] = *slope;
            }
        }
        let jacobian = jacobian.iter().all(|v| v.is_finite()).then_some(jacobian);
        jacobian.and_then(|jacobian| self.finished(jacobian))
    }
}
