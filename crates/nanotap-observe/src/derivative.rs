//! Derivatives of the observables of a periodic orbit with respect to a key of the case.
//!
//! An orbit x of period n is a zero of Pⁿ(x; θ) − x, so that dx/dθ = (1 − DPⁿ)⁻¹ ∂Pⁿ/∂θ by the
//! implicit function theorem. With this initial value the sensitivity of the flow is that of the
//! orbit, and a [`Variation`] gives every integral, Fourier coefficient and extremum with its
//! derivative. Observables are then computed from numbers with derivatives. If the period varies,
//! derivatives are at constant drive phase.
//!
//! Under a nonlinear force the same values come from the dense output of the variation
//! ([`gather`](super::varied_motion)). The exception are keys that change the modes of the lever by
//! mass or damping: there map and observables are differenced.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::DMatrix;
use nanotap_arithmetic::Dual;
use nanotap_flow::variation::{Speeds, Variation, VariedOutput};
use nanotap_flow::{Flow, FlowError, Output, accumulate};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::{Map, Value as Json, json};

use super::clearance::Clearance;
use super::functional::{Requirements, Signal, Tone, in_contact};
use super::measure::beginnings;
use super::measured::{Beginnings, Impacts, Measured, MeasuredValues};
use super::number::Phasor;
use super::record::measure;
use super::table::{OBSERVABLES, Observable, ObservableSet, Observables};
use super::value::Value;
use super::varied_motion::{Change, Varied, Wanted, gather};
use nanotap_case::{Case, CaseError, Held, Key};
use nanotap_model::model_map::ModelMap;
use nanotap_model::nonlinear::{self, Nonlinear};
use nanotap_model::{Model, ModelTangent, MotionError, Tangent, TangentKind};

/// Why an orbit has no derivative.
#[derive(Clone, Debug, thiserror::Error)]
pub enum DerivativeError {
    /// The case is invalid near this value of the key.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The motion could not be followed over the orbit's periods.
    #[error(transparent)]
    Flow(#[from] MotionError),
    /// A multiplier is 1: at a fold the orbit has no derivative.
    #[error("the orbit has no derivative: a multiplier is 1 within rounding")]
    NotIsolated,
}

/// Derivatives of observables, each next to its entry of the table.
type Changes = Vec<(&'static Observable, Value)>;

/// The derivative of a periodic orbit and of its observables.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivative {
    /// SI unit of the key; `None` for a number of the equations.
    pub unit: Option<&'static str>,
    /// Derivative of the state at drive phase 0, length n, in model units per unit of the key.
    pub state: Vec<f64>,
    /// Derivatives of observables in the model's units, without discontinuous ones.
    pub observables: Vec<(&'static Observable, Value)>,
    /// Quantities that are constant while the key changes although the case does not state them, in
    /// SI.
    pub held: Held,
    /// Derivatives of observables in SI, for a physical case.
    pub physical: Option<Vec<(&'static Observable, Value)>>,
}

impl Derivative {
    /// Derivatives of the orbit of `period` drive periods from `state`, and of its observables
    /// `set`, with respect to `key`. `observed` contains the observables in `set`, and the
    /// clearance of the beam if its derivative is requested.
    ///
    /// # Errors
    /// If the case is invalid near the value, or the orbit is not isolated.
    pub fn of(
        case: &Case,
        model: &Model,
        key: Key,
        (state, period): (&[f64], usize),
        observed: &Observables,
        set: ObservableSet,
    ) -> Result<Self, DerivativeError> {
        let all = Self::of_keys(case, model, &[key], (state, period), observed, set)?;
        all.into_iter().next().ok_or(DerivativeError::NotIsolated)
    }

    /// The same with respect to each of several keys, in their order, at less cost than one by one.
    ///
    /// # Errors
    /// If the case is invalid near the value of one of the keys, or the orbit is not isolated.
    pub fn of_keys(
        case: &Case,
        model: &Model,
        keys: &[Key],
        (state, period): (&[f64], usize),
        observed: &Observables,
        set: ObservableSet,
    ) -> Result<Vec<Self>, DerivativeError> {
        let tangents = keys.iter().map(|key| case.tangent(model, *key));
        let tangents = tangents.collect::<Result<Vec<Tangent>, _>>()?;
        let starts = orbit_derivatives(model, tangents.clone(), state, period)?;
        let of_models = keys.iter().map(|key| case.model_tangent(model, *key));
        let of_models = of_models.collect::<Result<Vec<ModelTangent>, _>>()?;
        let followed: Vec<Followed<'_>> = of_models
            .iter()
            .map(|tangent| Followed::new(model, tangent, set, observed.beam_clearance_xi))
            .collect();
        let all = keys.iter().zip(starts);
        let Some(nonlinear) = &model.nonlinear else {
            let one = |((key, start), followed): ((&Key, Vec<f64>), &Followed<'_>)| {
                let changes = followed.run(state, &start, period);
                let changes = changes.map_err(MotionError::from)?;
                Self::with_units(case, *key, start, observed, changes)
            };
            return all.zip(&followed).map(one).collect();
        };
        let by: Vec<Option<Along<'_>>> = tangents.iter().map(linearised).collect();
        let (mut together, mut changes) = (Vec::new(), Vec::new());
        for (((_, start), by), followed) in all.clone().zip(&by).zip(&followed) {
            if let Some(by) = by {
                together.push(followed);
                changes.push(by(&start));
            }
        }
        let found = Followed::run_under(&together, nonlinear, state, &changes, period)?;
        let mut found = found.into_iter();
        let one = |((key, start), by): ((&Key, Vec<f64>), &Option<Along<'_>>)| match by
            .as_ref()
            .and_then(|_| found.next())
        {
            Some(changes) => Self::with_units(case, *key, start, observed, changes),
            None => Self::by_differences(case, *key, (state, period), start, set),
        };
        all.zip(&by).map(one).collect()
    }

    /// The derivative whose values in the model's units are `observables`.
    fn with_units(
        case: &Case,
        key: Key,
        start: Vec<f64>,
        observed: &Observables,
        observables: Changes,
    ) -> Result<Self, DerivativeError> {
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
            held: case.held(&[key]),
            physical,
        })
    }

    /// Derivatives under a nonlinear force with respect to a key that changes the modes: central
    /// differences along the change `start` of the orbit.
    fn by_differences(
        case: &Case,
        key: Key,
        (state, period): (&[f64], usize),
        start: Vec<f64>,
        set: ObservableSet,
    ) -> Result<Self, DerivativeError> {
        let size = |values: &[f64]| values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let value = case.get(key);
        // Balances the error of the engine with the third derivative: a relative change of the
        // orbit, or of the key if the orbit does not depend on it.
        let by_orbit = STEP * size(state) / size(&start);
        let by_key = STEP * if value == 0.0 { 1.0 } else { value.abs() };
        let step = if by_orbit.is_finite() {
            by_orbit.min(by_key)
        } else {
            by_key
        };
        let observed = |side: f64| -> Result<(Observables, Option<Observables>), DerivativeError> {
            let varied = case.with(key, value + side * step);
            let change = state.iter().zip(&start);
            let from: Vec<f64> = change.map(|(x, by)| x + side * step * by).collect();
            let seen = measure(&varied.model()?, &from, period, set)?;
            let si = varied.physical().map(|view| seen.in_si(&view.scales));
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
            held: case.held(&[key]),
            state: start,
            observables: difference(&low.0, &high.0),
            physical: low.1.zip(high.1).map(|(low, high)| difference(&low, &high)),
        })
    }

    /// Derivative of a scalar observable in the model's units.
    pub fn number(&self, observable: &Observable) -> Option<f64> {
        let known = self.observables.iter().find(|(o, _)| *o == observable);
        known.and_then(|(_, change)| change.number())
    }

    /// Derivative of a scalar observable in SI.
    pub fn number_in_si(&self, observable: &Observable) -> Option<f64> {
        let all = self.physical.as_ref()?;
        let known = all.iter().find(|(o, _)| *o == observable);
        known.and_then(|(_, change)| change.number())
    }
}

impl Serialize for Derivative {
    /// A map: `unit`, `state`, the observables by name, and `physical` by SI names.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        if let Some(unit) = self.unit {
            map.serialize_entry("unit", unit)?;
        }
        if !self.held.is_empty() {
            map.serialize_entry("held", &self.held)?;
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
        let held = json!({
            "type": "object",
            "additionalProperties": {"type": "number"},
            "description": "What stays although it was not stated, in SI",
        });
        let others = [
            ("unit", unit),
            ("held", held),
            ("state", state),
            ("physical", physical),
        ];
        for (name, schema) in others {
            properties.insert(name.to_owned(), schema);
        }
        json_schema!({
            "type": "object",
            "description": "Derivatives of a periodic orbit and of what is observed of it",
            "properties": properties,
        })
    }
}

/// Derivatives of amplitude and phase (degrees) of the tip's first harmonic over one drive period
/// from `state`, closed or not: one column per entry of the state, then one per key,
/// `2 × (n + k)`. `sizes` are the scales of the entries of the state, and `by` (`n × k`) contains
/// the derivatives of the end of the period by the keys.
///
/// # Errors
/// If the flow fails, or the case is invalid near the value of a key.
pub fn first_harmonic_changes(
    case: &Case,
    model: &Model,
    keys: &[Key],
    state: &[f64],
    sizes: &[f64],
    by: &DMatrix<f64>,
) -> Result<DMatrix<f64>, DerivativeError> {
    let n = state.len();
    let set = ObservableSet::FIRST_HARMONIC;
    let mut rows = DMatrix::zeros(2, n + keys.len());
    let Some(nonlinear) = &model.nonlinear else {
        let mut of = |column: usize, tangent: &ModelTangent, start: &[f64]| {
            let followed = Followed::new(model, tangent, set, None);
            let changes = followed.run(state, start, 1).map_err(MotionError::from)?;
            for (row, (_, change)) in changes.iter().enumerate().take(2) {
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
    // Columns of the derivatives; those with a parameter come last.
    let mut columns = Vec::new();
    for k in 0..n - nonlinear.discrete_entries() {
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
        // The same change of the motion, if the key allows it.
        let change = (0..n).fold(0.0, |m: f64, i| m.max(by[(i, k)].abs() / sizes[i]));
        let value = case.get(*key);
        let farthest = if value == 0.0 {
            1.0
        } else {
            3e-3 * value.abs()
        };
        let step = (HARMONIC_STEP / change).min(farthest);
        let observables_at = |side: f64| -> Result<Observables, DerivativeError> {
            let there = case.with(*key, value + side * step).model()?;
            Ok(measure(&there, state, 1, set)?)
        };
        let (low, high) = (observables_at(-1.0)?, observables_at(1.0)?);
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

/// Derivatives of amplitude and phase of the tip's first harmonic over one drive period.
fn tip_changes(
    model: &Model,
    nonlinear: &Arc<Nonlinear>,
    state: &[f64],
    changes: &[Change],
) -> Result<Vec<[f64; 2]>, MotionError> {
    let tip = nanotap_volterra::VariedOutput::fixed(nonlinear.output(&model.tip, 0.0));
    let first = accumulate::Functional::Fourier(0, Tone::First.frequency(model));
    let wanted = Wanted {
        outputs: &[tip],
        of_contact: &[false],
        functionals: &[first],
    };
    let gathered = gather(nonlinear, state, 1, changes, wanted, None)?;
    let of = |varied: &Varied| {
        let integral = Phasor::from(varied.values[0]);
        let component = integral.times(Dual::constant(2.0) / varied.duration);
        [component.norm().derivative(), component.lag().derivative()]
    };
    Ok(gathered.iter().map(of).collect())
}

/// Relative change of the amplitude in differences of the first harmonic by keys that change the
/// modes.
const HARMONIC_STEP: f64 = 1e-4;

/// Relative change of an orbit in differences of its observables.
const STEP: f64 = 2e-4;

/// The change of a motion for a change of its initial state, if the engine computes it.
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

/// dx/dθ = (1 − DPⁿ)⁻¹ ∂Pⁿ/∂θ, one per tangent.
fn orbit_derivatives(
    model: &Model,
    tangents: Vec<Tangent>,
    state: &[f64],
    period: usize,
) -> Result<Vec<Vec<f64>>, DerivativeError> {
    let (n, count) = (state.len(), tangents.len());
    let mut map = ModelMap::with_tangents(model, tangents);
    let mut x = state.to_vec();
    let (mut one, mut by) = (DMatrix::zeros(n, n), DMatrix::zeros(n, count));
    let (mut all, mut change) = (DMatrix::identity(n, n), DMatrix::zeros(n, count));
    for _ in 0..period {
        map.advance_with_derivatives(&mut x, &mut one, &mut by)?;
        change = &one * change + &by;
        all = &one * all;
    }
    let solved = (DMatrix::identity(n, n) - all).lu().solve(&change);
    let solved = solved.filter(|s| s.iter().all(|v| v.is_finite()));
    let solved = solved.ok_or(DerivativeError::NotIsolated)?;
    let columns = solved.column_iter();
    Ok(columns
        .map(|column| column.iter().copied().collect())
        .collect())
}

/// An orbit and its derivative, followed together.
struct Followed<'a> {
    model: &'a Model,
    tangent: &'a ModelTangent,
    set: ObservableSet,
    required: Requirements,
    /// Position of the lowest point of the beam, if the derivative of its clearance is requested.
    clearance: Option<f64>,
}

impl<'a> Followed<'a> {
    fn new(
        model: &'a Model,
        tangent: &'a ModelTangent,
        set: ObservableSet,
        clearance: Option<f64>,
    ) -> Self {
        let mut measured = Measured::<Dual>::of(model, None);
        Observables::changes(set, &mut measured);
        Self {
            model,
            tangent,
            set,
            required: measured.required,
            clearance,
        }
    }

    /// The outputs: the required signals, and the height of the lowest point of the beam.
    fn outputs(&self) -> Vec<VariedOutput> {
        let signals = self.required.signals.iter();
        let own = signals.map(|signal| varied(*signal, self.model, self.tangent));
        own.chain(self.lowest()).collect()
    }

    /// The functionals of these outputs; the least height of the beam is last.
    fn functionals(&self) -> Vec<accumulate::Functional> {
        let lowest = self.lowest().map(|_| self.required.signals.len());
        let mut all = self.required.numbered(self.model);
        all.extend(lowest.map(accumulate::Functional::Least));
        all
    }

    /// The height of the lowest point of the beam.
    fn lowest(&self) -> Option<VariedOutput> {
        let (xi, beam) = self.clearance.zip(self.model.beam.as_ref())?;
        // The base contributes as to the tip's height, apart from the beam's shape.
        let zero = self.model.tip.scaled(0.0);
        let change = zero.plus(1.0, &tones_of(&self.tangent.base));
        let system = &self.model.system;
        Some(VariedOutput::same(system, &beam.height(xi), &change))
    }

    /// Follows the orbit of a piecewise-linear model with the derivative `start` of its initial
    /// state.
    fn run(&self, state: &[f64], start: &[f64], period: usize) -> Result<Changes, FlowError> {
        let model = self.model;
        let (mut outputs, mut functionals) = (self.outputs(), self.functionals());
        // Additionally the contact time.
        let zero = model.tip.scaled(0.0);
        let touching = |contact: &bool| zero.clone().with_constant(f64::from(u8::from(*contact)));
        outputs.push(VariedOutput {
            value: model.contact.iter().map(touching).collect(),
            change: vec![zero.clone(); model.contact.len()],
        });
        functionals.push(accumulate::Functional::Integral(outputs.len() - 1));
        let mut flow = Flow::new(Arc::clone(&model.system));
        flow.start(state, 0.0)?;
        let mut variation = Variation::new(
            &model.system,
            &self.tangent.system,
            flow.regime(),
            start,
            outputs,
            functionals,
            beginnings(model),
        );
        for _ in 0..period {
            flow.run_period(&mut variation)?;
        }
        variation.finish();
        let contact_time = variation
            .values
            .pop()
            .filter(|_| model.contact.contains(&true));
        let mut greatest_speed = Dual::default();
        for (_, speeds) in &variation.speeds {
            if speeds.greatest.value > greatest_speed.value {
                greatest_speed = speeds.greatest;
            }
        }
        let impacts = self.impacts(&variation.speeds);
        let gathered = Varied {
            values: variation.values,
            greatest_speed,
            contact_time: contact_time.map_or_else(Dual::default, |time| time.re),
            duration: variation.duration,
        };
        Ok(self.changes(gathered, impacts, period))
    }

    /// Impacts on a rigid stop.
    fn impacts(&self, speeds: &[((usize, usize), Speeds)]) -> Impacts<Dual> {
        let Some(stop) = self.model.rigid_stop else {
            return Impacts::default();
        };
        let by = self.tangent.rigid_stop;
        let (mut bounced, mut stuck) = ([Dual::default(); 2], [Dual::default(); 2]);
        for ((from, to), speeds) in speeds {
            let sums = if from == to { &mut bounced } else { &mut stuck };
            sums[0] = sums[0] + speeds.sum;
            sums[1] = sums[1] + speeds.squares;
        }
        let stop = [
            Dual::new(stop.mass, by.mass),
            Dual::new(stop.restitution, by.restitution),
            Dual::new(stop.tip, by.tip),
        ];
        Impacts::new(stop, bounced, stuck)
    }

    /// Follows the orbit of a model under a nonlinear force with several derivatives at once.
    fn run_under(
        all: &[&Self],
        nonlinear: &Arc<Nonlinear>,
        state: &[f64],
        changes: &[Change],
        period: usize,
    ) -> Result<Vec<Changes>, MotionError> {
        let Some(first) = all.first() else {
            return Ok(Vec::new());
        };
        let under = |each: Vec<&VariedOutput>, force: f64| nanotap_volterra::VariedOutput {
            value: nonlinear.output(&each[0].value[0], force),
            changes: each
                .iter()
                .map(|output| nonlinear.output(&output.change[0], 0.0))
                .collect(),
        };
        let forces = first
            .required
            .signals
            .iter()
            .map(|s| s.force_part(nonlinear));
        let each: Vec<Vec<VariedOutput>> = all.iter().map(|of| of.outputs()).collect();
        let outputs: Vec<_> = forces
            .chain([0.0])
            .enumerate()
            .take(each[0].len())
            .map(|(k, force)| under(each.iter().map(|outputs| &outputs[k]).collect(), force))
            .collect();
        let rates: Vec<VariedOutput> = all
            .iter()
            .map(|of| varied(Signal::HeightRate, of.model, of.tangent))
            .collect();
        let rate = under(rates.iter().collect(), 0.0);
        let signals = first.required.signals.iter();
        let of_contact: Vec<bool> = signals
            .map(|signal| signal.is_of_contact())
            .chain([false])
            .collect();
        let wanted = Wanted {
            outputs: &outputs,
            of_contact: &of_contact,
            functionals: &first.functionals(),
        };
        let gathered = gather(nonlinear, state, period, changes, wanted, Some(&rate))?;
        let of = all.iter().zip(gathered);
        Ok(of
            .map(|(of, gathered)| of.changes(gathered, Impacts::default(), period))
            .collect())
    }

    fn changes(&self, gathered: Varied, impacts: Impacts<Dual>, period: usize) -> Changes {
        let required = &self.required.functionals;
        let lowest = gathered.values.get(required.len()).map(|value| value.re);
        let values = gathered.values.into_iter().map(Phasor::from);
        let found = MeasuredValues {
            values: required.iter().copied().zip(values).collect(),
            duration: gathered.duration,
            periods: period as u64,
            contact_time: gathered.contact_time,
            contacts: Beginnings {
                greatest_speed: gathered.greatest_speed,
                ..Beginnings::default()
            },
            stored: Dual::default(),
            stored_by_sample: Dual::default(),
            clearance: self.clearance.zip(lowest).map(|(xi, height)| Clearance {
                height,
                xi,
                period: 0.0,
            }),
            impacts,
            tone_phases: self
                .model
                .tone_phases
                .iter()
                .zip(&self.tangent.tone_phases)
                .map(|(phase, change)| Dual::new(*phase, *change))
                .collect(),
        };
        Observables::changes(self.set, &mut Measured::of(self.model, Some(found)))
    }
}

/// The tones of an output without its other parts.
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
        Signal::ContactForce => VariedOutput {
            value: in_contact(model, &model.force),
            change: in_contact(model, &tangent.force),
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

impl From<DerivativeError> for nanotap_error::Error {
    fn from(error: DerivativeError) -> Self {
        match error {
            DerivativeError::Case(error) => error.into(),
            other => Self::numerics(other.to_string()),
        }
    }
}
