//! Derivatives of what is observed of a periodic orbit with respect to a key of the case.
//!
//! An orbit x of period n is a zero of Pⁿ(x; θ) − x, so that by the implicit function theorem
//! dx/dθ = (1 − DPⁿ)⁻¹ ∂Pⁿ/∂θ. With this start the sensitivity of the flow is the orbit's own,
//! and a [`Variation`] has of every integral, Fourier coefficient and extremum that observables
//! are read from its derivative; the observables are then read once more, each number with its
//! derivative beside it. Where the period varies, derivatives are at constant drive phase.
//!
//! Under a nonlinear force the same is read off the variation's dense output
//! ([`gather`](super::varied_motion)). Keys that change the lever's modes, by mass or damping, are the
//! exception: there the engine's map is differenced, and what is observed with it.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use nanotap_flow::variation::{Variation, Varied, VariedOutput, Wanted};
use nanotap_flow::{Flow, FlowError, Output};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::{Map, Value as Json, json};

use super::clearance::Clearance;
use super::measure::{beginnings, contact_regimes, frequency};
use super::measured::{Beginnings, Found, Impacts, Measured, Need, Signal, Tone};
use super::number::Phasor;
use super::table::{OBSERVABLES, Observable, Observables, Set};
use super::value::Value;
use super::varied_motion::{Change, Gathered, gather};
use super::watch::measure;
use crate::case::{Case, CaseError, Key};
use crate::model::contact::dual::Dual;
use crate::model::nonlinear::{self, Nonlinear};
use crate::model::strobe::Strobe;
use crate::model::{Model, ModelTangent, MotionError, Tangent, TangentKind};

/// Why an orbit has no derivative.
#[derive(Clone, Debug, thiserror::Error)]
pub enum DerivativeError {
    /// The case makes no sense beside this value of the key.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The flow failed.
    #[error(transparent)]
    Flow(#[from] MotionError),
    /// A multiplier is 1: at a fold the orbit has no derivative.
    #[error("the orbit has no derivative: a multiplier is 1 within rounding")]
    NotIsolated,
}

/// The derivative of a periodic orbit and of what is observed of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivative {
    /// The unit of the key in SI; none of a number of the equations.
    pub unit: Option<&'static str>,
    /// Of the state at drive phase 0, of length n.
    pub state: Vec<f64>,
    /// Of observables in the model's units; those that jump are left out.
    pub observables: Vec<(&'static Observable, Value)>,
    /// The same in SI, of a physical case.
    pub physical: Option<Vec<(&'static Observable, Value)>>,
}

impl Derivative {
    /// Of the orbit of `period` drive periods from `state`, of the observables `set`, with
    /// respect to `key`; `observed` is what is observed of it, all of `set` and the beam's
    /// clearance if its derivative is wanted.
    ///
    /// # Errors
    /// When the case makes no sense beside the value, or the orbit is not isolated.
    pub fn of(
        case: &Case,
        model: &Model,
        key: Key,
        (state, period): (&[f64], usize),
        observed: &Observables,
        set: Set,
    ) -> Result<Self, DerivativeError> {
        let of_map = case.tangent(model, key)?;
        let start = orbit_derivative(model, of_map.clone(), state, period)?;
        let under = match (&model.nonlinear, linearised(&of_map)) {
            (Some(_), None) => {
                return Self::by_differences(case, key, (state, period), start, set);
            }
            (nonlinear, by) => nonlinear.as_ref().zip(by),
        };
        let tangent = case.model_tangent(model, key)?;
        let mut followed = Followed::new(model, &tangent, set, observed.beam_clearance_xi);
        match under {
            None => followed
                .run(state, &start, period)
                .map_err(MotionError::from)?,
            Some((nonlinear, by)) => followed.run_under(nonlinear, state, by(&start), period)?,
        }
        let observables = followed.changes(set);
        let physical = case
            .physical()
            .map(|view| {
                let scales = case.scales_beside(key)?;
                let in_si = |(observable, change): &(&'static Observable, Value)| {
                    let unit = |scales| observable.dimension.si(scales);
                    let by = match &scales {
                        None => 0.0,
                        Some((low, high, width)) => (unit(high)? - unit(low)?) / width,
                    };
                    let value = (observable.of)(observed);
                    let change = change.in_unit(unit(&view.scales)?, value, by);
                    Some((*observable, change))
                };
                Ok::<_, CaseError>(observables.iter().filter_map(in_si).collect())
            })
            .transpose()?;
        Ok(Self {
            unit: key.is_physical().then(|| key.kind().si_unit()),
            state: start,
            observables,
            physical,
        })
    }

    /// The same under a nonlinear force by a key that changes the modes: what is observed of the
    /// orbit, which changes by `start`, is differenced along it, centrally.
    fn by_differences(
        case: &Case,
        key: Key,
        (state, period): (&[f64], usize),
        start: Vec<f64>,
        set: Set,
    ) -> Result<Self, DerivativeError> {
        let size = |values: &[f64]| values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let value = case.get(key);
        // What balances the engine's error with the third derivative: the orbit changes by this
        // part of itself, or the key does where the orbit does not follow it.
        let by_orbit = STEP * size(state) / size(&start);
        let by_key = STEP * if value == 0.0 { 1.0 } else { value.abs() };
        let step = if by_orbit.is_finite() {
            by_orbit.min(by_key)
        } else {
            by_key
        };
        let observed = |side: f64| -> Result<(Observables, Option<Observables>), DerivativeError> {
            let beside = case.with(key, value + side * step);
            let change = state.iter().zip(&start);
            let from: Vec<f64> = change.map(|(x, by)| x + side * step * by).collect();
            let seen = measure(&beside.model()?, &from, period, set)?;
            let si = beside.physical().map(|view| seen.in_si(&view.scales));
            Ok((seen, si))
        };
        let (low, high) = (observed(-1.0)?, observed(1.0)?);
        let slope = 0.5 / step;
        let difference = |low: &Observables, high: &Observables| {
            let one = |o: &'static Observable| {
                let change = (o.of)(high).in_unit(slope, (o.of)(low), -slope);
                (change != Value::Absent).then_some((o, change))
            };
            set.iter().filter_map(one).collect::<Vec<_>>()
        };
        Ok(Self {
            unit: key.is_physical().then(|| key.kind().si_unit()),
            state: start,
            observables: difference(&low.0, &high.0),
            physical: low.1.zip(high.1).map(|(low, high)| difference(&low, &high)),
        })
    }

    /// The derivative of an observable that is one number, in the model's units.
    pub fn number(&self, observable: &Observable) -> Option<f64> {
        let known = self.observables.iter().find(|(o, _)| *o == observable);
        known.and_then(|(_, change)| change.number())
    }

    /// The same in SI.
    pub fn number_in_si(&self, observable: &Observable) -> Option<f64> {
        let all = self.physical.as_ref()?;
        let known = all.iter().find(|(o, _)| *o == observable);
        known.and_then(|(_, change)| change.number())
    }
}

impl Serialize for Derivative {
    /// A map: `unit`, `state`, the observables by name, and `physical` by their names in SI.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        if let Some(unit) = self.unit {
            map.serialize_entry("unit", unit)?;
        }
        map.serialize_entry("state", &self.state)?;
        for (observable, change) in &self.observables {
            map.serialize_entry(observable.name, change)?;
        }
        if let Some(physical) = &self.physical {
            let by_name = physical.iter().map(|(o, change)| (o.si_name, change));
            let by_name: std::collections::BTreeMap<_, _> = by_name.collect();
            map.serialize_entry("physical", &by_name)?;
        }
        map.end()
    }
}

impl JsonSchema for Derivative {
    fn schema_name() -> Cow<'static, str> {
        "Derivative".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut named = |name: fn(&Observable) -> &'static str| -> Map<String, Json> {
            let entry = |o: &Observable| {
                let schema = (o.schema)(generator).to_value();
                (name(o).to_owned(), schema)
            };
            OBSERVABLES.iter().map(entry).collect()
        };
        let (mut properties, physical) = (named(|o| o.name), named(|o| o.si_name));
        let unit = json!({"type": "string", "description": "The key's unit in SI"});
        let state = json!({
            "type": "array",
            "items": {"type": "number"},
            "description": "Of the state at drive phase 0",
        });
        let physical = json!({
            "type": "object",
            "description": "Of the observables in SI",
            "properties": physical,
        });
        for (name, schema) in [("unit", unit), ("state", state), ("physical", physical)] {
            properties.insert(name.to_owned(), schema);
        }
        json_schema!({
            "type": "object",
            "description": "Derivatives of a periodic orbit and of what is observed of it",
            "properties": properties,
        })
    }
}

/// How amplitude and phase (degrees) of the tip's first harmonic change over one drive period that
/// starts in `state`, closed or not: a column a number of the state, then one a key, `2 × (n + k)`.
/// `sizes` are those of the numbers of the state, `by` (`n × k`) how the end of the period changes
/// with the keys.
///
/// # Errors
/// When the flow fails, or the case makes no sense beside the value of a key.
pub(crate) fn first_harmonic_changes(
    case: &Case,
    model: &Model,
    keys: &[Key],
    state: &[f64],
    sizes: &[f64],
    by: &DMatrix<f64>,
) -> Result<DMatrix<f64>, DerivativeError> {
    let n = state.len();
    let set = Set::FIRST_HARMONIC;
    let mut rows = DMatrix::zeros(2, n + keys.len());
    let Some(nonlinear) = &model.nonlinear else {
        let mut of = |column: usize, tangent: &ModelTangent, start: &[f64]| {
            let mut followed = Followed::new(model, tangent, set, None);
            followed.run(state, start, 1).map_err(MotionError::from)?;
            for (row, (_, change)) in followed.changes(set).iter().enumerate().take(2) {
                rows[(row, column)] = change.number().unwrap_or(f64::NAN);
            }
            Ok::<_, DerivativeError>(())
        };
        let still = ModelTangent::zeros(model);
        for k in 0..n {
            let mut start = vec![0.0; n];
            start[k] = 1.0;
            of(k, &still, &start)?;
        }
        for (k, key) in keys.iter().enumerate() {
            of(n + k, &case.model_tangent(model, *key)?, &vec![0.0; n])?;
        }
        return Ok(rows);
    };
    let mut changes = Vec::new();
    // Columns of the changes; those with a parameter stand last.
    let mut columns = Vec::new();
    for k in 0..n - model.memory {
        let mut start = vec![0.0; n];
        start[k] = 1.0;
        columns.push(k);
        changes.push(Change {
            start,
            parameter: None,
            log_period: 0.0,
        });
    }
    for (k, key) in keys.iter().enumerate() {
        let tangent = case.tangent(model, *key)?;
        if let Some(by) = linearised(&tangent) {
            columns.push(n + k);
            changes.push(by(&vec![0.0; n]));
            continue;
        }
        // The same change of the motion, if the key may change so far.
        let change = (0..n).fold(0.0, |m: f64, i| m.max(by[(i, k)].abs() / sizes[i]));
        let value = case.get(*key);
        let farthest = if value == 0.0 {
            1.0
        } else {
            3e-3 * value.abs()
        };
        let step = (BESIDE / change).min(farthest);
        let beside = |side: f64| -> Result<Observables, DerivativeError> {
            let there = case.with(*key, value + side * step).model()?;
            Ok(measure(&there, state, 1, set)?)
        };
        let (low, high) = (beside(-1.0)?, beside(1.0)?);
        let turn = (high.phase - low.phase + 180.0).rem_euclid(360.0) - 180.0;
        rows[(0, n + k)] = (high.first_harmonic - low.first_harmonic) / (2.0 * step);
        rows[(1, n + k)] = turn / (2.0 * step);
    }
    let of_changes = tip_changes(model, nonlinear, state, &changes)?;
    for (column, [amplitude, phase]) in columns.into_iter().zip(of_changes) {
        rows[(0, column)] = amplitude;
        rows[(1, column)] = phase;
    }
    Ok(rows)
}

/// How amplitude and phase of the tip's first harmonic over one drive period change.
fn tip_changes(
    model: &Model,
    nonlinear: &Arc<Nonlinear>,
    state: &[f64],
    changes: &[Change],
) -> Result<Vec<[f64; 2]>, MotionError> {
    let tip = nanotap_volterra::VariedOutput::fixed(nonlinear.output(&model.tip, 0.0));
    let wanted = Wanted {
        fouriers: vec![(0, frequency(model, Tone::First))],
        ..Wanted::default()
    };
    let gathered = gather(nonlinear, state, 1, changes, (&[tip], &wanted), None)?;
    let of = |gathered: &Gathered| {
        let integral = phasor(gathered.fouriers[0]);
        let component = integral.times(Dual::constant(2.0) / dual(gathered.duration));
        [component.norm().derivative(), component.lag().derivative()]
    };
    Ok(gathered.iter().map(of).collect())
}

/// Part of the amplitude by which a motion changes where its first harmonic is differenced, by keys
/// that change the modes.
const BESIDE: f64 = 1e-4;

/// Part of an orbit by which it changes where what is observed is differenced.
const STEP: f64 = 2e-4;

/// A change of the motion that begins with a change of the state, where the engine knows it.
type Along<'a> = Box<dyn Fn(&[f64]) -> Change + 'a>;

fn linearised(tangent: &Tangent) -> Option<Along<'_>> {
    let TangentKind::Nonlinear(nonlinear::Variation::Linearised { change, log_period }) =
        &tangent.0
    else {
        return None;
    };
    Some(Box::new(move |start| Change {
        start: start.to_vec(),
        parameter: Some(change.clone()),
        log_period: *log_period,
    }))
}

/// dx/dθ = (1 − DPⁿ)⁻¹ ∂Pⁿ/∂θ.
fn orbit_derivative(
    model: &Model,
    tangent: Tangent,
    state: &[f64],
    period: usize,
) -> Result<Vec<f64>, DerivativeError> {
    let n = state.len();
    let mut map = Strobe::with_tangents(model, vec![tangent]);
    let mut x = state.to_vec();
    let (mut one, mut by) = (DMatrix::zeros(n, n), DMatrix::zeros(n, 1));
    let (mut all, mut change) = (DMatrix::identity(n, n), DMatrix::zeros(n, 1));
    for _ in 0..period {
        map.advance_with_derivatives(&mut x, &mut one, &mut by)?;
        change = &one * change + &by;
        all = &one * all;
    }
    let solved = (DMatrix::identity(n, n) - all).lu().solve(&change);
    let solved: Option<DVector<f64>> = solved.map(|s| s.column(0).into_owned());
    solved
        .filter(|s| s.iter().all(|v| v.is_finite()))
        .map(|s| s.as_slice().to_vec())
        .ok_or(DerivativeError::NotIsolated)
}

/// An orbit on its way, and what is gathered of it.
struct Followed<'a> {
    model: &'a Model,
    tangent: &'a ModelTangent,
    needs: Vec<(Need, Place)>,
    /// Each with its output.
    signals: Vec<Signal>,
    outputs: Vec<VariedOutput>,
    wanted: Wanted,
    clearance: Option<f64>,
    /// What was found, once it ran.
    found: Option<Found<Dual>>,
}

/// Where a need stands among what is wanted.
#[derive(Clone, Copy)]
enum Place {
    Extremum(usize),
    Integral(usize),
    Product(usize),
    Fourier(usize),
}

impl<'a> Followed<'a> {
    fn new(model: &'a Model, tangent: &'a ModelTangent, set: Set, clearance: Option<f64>) -> Self {
        let mut asked = Measured::<Dual>::nothing(model);
        Observables::changes(set, &mut asked);
        let mut followed = Self {
            model,
            tangent,
            needs: Vec::new(),
            signals: Vec::new(),
            outputs: Vec::new(),
            wanted: Wanted::default(),
            clearance,
            found: None,
        };
        for need in asked.asked {
            let place = followed.want(need);
            followed.needs.push((need, place));
        }
        followed
    }

    fn want(&mut self, need: Need) -> Place {
        let channel = |of: &mut Self, signal: Signal| {
            if let Some(known) = of.signals.iter().position(|known| *known == signal) {
                return known;
            }
            of.signals.push(signal);
            of.outputs.push(varied(signal, of.model, of.tangent));
            of.signals.len() - 1
        };
        match need {
            Need::Least(signal) | Need::Greatest(signal) => {
                let sign = if matches!(need, Need::Least(_)) {
                    -1.0
                } else {
                    1.0
                };
                let output = channel(self, signal);
                self.wanted.extrema.push((output, sign));
                Place::Extremum(self.wanted.extrema.len() - 1)
            }
            Need::Integral(signal) => {
                let output = channel(self, signal);
                self.wanted.integrals.push(output);
                Place::Integral(self.wanted.integrals.len() - 1)
            }
            Need::Product(a, b) => {
                let (a, b) = (channel(self, a), channel(self, b));
                self.wanted.products.push((a, b));
                Place::Product(self.wanted.products.len() - 1)
            }
            Need::Fourier(signal, tone) => {
                let output = channel(self, signal);
                self.wanted
                    .fouriers
                    .push((output, frequency(self.model, tone)));
                Place::Fourier(self.wanted.fouriers.len() - 1)
            }
        }
    }

    /// Follows the orbit, which changes by `start` at its beginning.
    fn run(&mut self, state: &[f64], start: &[f64], period: usize) -> Result<(), FlowError> {
        let model = self.model;
        let (mut outputs, mut wanted) = (self.outputs.clone(), self.wanted.clone());
        // Beside what observables read: time in contact, speeds, the beam's least height.
        let zero = model.tip.scaled(0.0);
        let regimes = 0..model.contact.len();
        let touching = |r| {
            zero.clone()
                .with_constant(f64::from(u8::from(model.contact[r])))
        };
        outputs.push(VariedOutput {
            value: regimes.map(touching).collect(),
            change: vec![zero.clone(); model.contact.len()],
        });
        wanted.integrals.push(outputs.len() - 1);
        wanted.speeds = beginnings(model).collect();
        if let Some(height) = self.lowest() {
            outputs.push(height);
            wanted.extrema.push((outputs.len() - 1, -1.0));
        }
        let mut flow = Flow::new(std::sync::Arc::clone(&model.system));
        flow.start(state, 0.0)?;
        let mut variation = Variation::new(
            &model.system,
            &self.tangent.system,
            flow.regime(),
            start,
            outputs,
            wanted,
        );
        for _ in 0..period {
            flow.run_period(&mut variation)?;
        }
        variation.finish();
        let mut gathered = Gathered {
            duration: variation.duration,
            contact_time: contact_regimes(model)
                .next()
                .map_or_else(Varied::default, |_| {
                    variation.integrals[self.wanted.integrals.len()]
                }),
            ..Gathered::default()
        };
        for speed in &variation.speeds {
            if speed.value > gathered.greatest_speed.value {
                gathered.greatest_speed = *speed;
            }
        }
        let impacts = self.impacts(&variation);
        gathered.integrals = variation.integrals;
        gathered.products = variation.products;
        gathered.fouriers = variation.fouriers;
        gathered.extrema = variation.extrema;
        let mut found = self.read(&gathered, period);
        found.impacts = impacts;
        self.found = Some(found);
        Ok(())
    }

    /// What impacts on a rigid stop did.
    fn impacts(&self, variation: &Variation<'_>) -> Impacts<Dual> {
        let Some(stop) = self.model.rigid_stop else {
            return Impacts::default();
        };
        let by = self.tangent.rigid_stop;
        let (mut bounced, mut stuck) = ([Dual::default(); 2], [Dual::default(); 2]);
        for (k, (from, to)) in beginnings(self.model).enumerate() {
            let sums = if from == to { &mut bounced } else { &mut stuck };
            sums[0] = sums[0] + dual(variation.summed_speeds[k]);
            sums[1] = sums[1] + dual(variation.squared_speeds[k]);
        }
        let stop = [
            Dual::new(stop.mass, by.mass),
            Dual::new(stop.restitution, by.restitution),
            Dual::new(stop.tip, by.tip),
        ];
        Impacts::new(stop, bounced, stuck)
    }

    /// The same under a nonlinear force.
    fn run_under(
        &mut self,
        nonlinear: &Arc<Nonlinear>,
        state: &[f64],
        change: Change,
        period: usize,
    ) -> Result<(), MotionError> {
        let under = |output: &VariedOutput, force: f64| nanotap_volterra::VariedOutput {
            value: nonlinear.output(&output.value[0], force),
            changes: vec![nonlinear.output(&output.change[0], 0.0)],
        };
        let signals = self.signals.iter().zip(&self.outputs);
        let mut outputs: Vec<_> = signals
            .map(|(signal, output)| under(output, signal.force_part(nonlinear)))
            .collect();
        let mut wanted = self.wanted.clone();
        if let Some(height) = self.lowest() {
            outputs.push(under(&height, 0.0));
            wanted.extrema.push((outputs.len() - 1, -1.0));
        }
        let rate = under(&varied(Signal::HeightRate, self.model, self.tangent), 0.0);
        let asked = (outputs.as_slice(), &wanted);
        let gathered = gather(nonlinear, state, period, &[change], asked, Some(&rate))?;
        self.found = gathered.first().map(|gathered| self.read(gathered, period));
        Ok(())
    }

    /// The height of the point of the beam that comes nearest to the sample.
    fn lowest(&self) -> Option<VariedOutput> {
        let (xi, beam) = self.clearance.zip(self.model.beam.as_ref())?;
        // The base moves as the tip's height does beside the beam's shape.
        let zero = self.model.tip.scaled(0.0);
        let change = zero.plus(1.0, &tones_of(&self.tangent.base));
        let system = &self.model.system;
        Some(VariedOutput::same(system, &beam.height(xi), &change))
    }

    fn read(&self, gathered: &Gathered, period: usize) -> Found<Dual> {
        let real = |number: Varied<f64>| Phasor {
            re: dual(number),
            im: Dual::default(),
        };
        let value = |place| match place {
            Place::Extremum(at) => real(gathered.extrema[at]),
            Place::Integral(at) => real(gathered.integrals[at]),
            Place::Product(at) => real(gathered.products[at]),
            Place::Fourier(at) => phasor(gathered.fouriers[at]),
        };
        let heights = gathered.extrema.get(self.wanted.extrema.len());
        let values = self.needs.iter();
        Found {
            values: values.map(|&(need, place)| (need, value(place))).collect(),
            duration: dual(gathered.duration),
            periods: period as u64,
            contact_time: dual(gathered.contact_time),
            contacts: Beginnings {
                greatest_speed: dual(gathered.greatest_speed),
                ..Beginnings::default()
            },
            stored: Dual::default(),
            stored_by_sample: Dual::default(),
            clearance: self.clearance.zip(heights).map(|(xi, height)| Clearance {
                height: dual(*height),
                xi,
                period: 0.0,
            }),
            impacts: Impacts::default(),
            second_phase: Dual::new(self.model.second_phase, self.tangent.second_phase),
        }
    }

    fn changes(&mut self, set: Set) -> Vec<(&'static Observable, Value)> {
        let mut measured = Measured::nothing(self.model);
        measured.found = self.found.take();
        Observables::changes(set, &mut measured)
    }
}

const fn dual(number: Varied<f64>) -> Dual {
    Dual::new(number.value, number.change)
}

fn phasor(number: Varied<nanotap_flow::Complex>) -> Phasor<Dual> {
    Phasor {
        re: Dual::new(number.value.re, number.change.re),
        im: Dual::new(number.value.im, number.change.im),
    }
}

/// The tones of an output alone.
fn tones_of(output: &Output) -> Output {
    let mut tones = output.scaled(0.0);
    tones.tones.clone_from(&output.tones);
    tones
}

/// A signal with its derivative.
fn varied(signal: Signal, model: &Model, tangent: &ModelTangent) -> VariedOutput {
    let system = &*model.system;
    let zero = model.tip.scaled(0.0);
    let height = || VariedOutput::same(system, &model.height, &tangent.height);
    match signal {
        Signal::Height => height(),
        Signal::HeightRate => height().rate(system, &tangent.system),
        Signal::Force => VariedOutput {
            value: model.force.clone(),
            change: tangent.force.clone(),
        },
        Signal::Power(term) => VariedOutput {
            value: term.outputs(model),
            change: term.changes(model, tangent),
        },
        Signal::Tip | Signal::Slope => VariedOutput {
            value: signal.outputs(model),
            change: vec![zero; system.regimes().len()],
        },
    }
}

impl From<DerivativeError> for crate::Error {
    fn from(error: DerivativeError) -> Self {
        match error {
            DerivativeError::Case(error) => error.into(),
            other => Self::numerics(other.to_string()),
        }
    }
}
