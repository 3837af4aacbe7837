//! A physical case: stated quantities, their mapping, and its derivatives.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Serialize;

use super::Key;
use super::file::{self, CaseFileError};
use super::key::Section;
use super::physical::{Catalogue, Kind, Physical, PhysicalError, Reader, Remark};
use super::state::WrittenState;
use super::stated::{Stated, Value};
use super::units::Units;
use nanotap_model::Model;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::parameter::Parameter;

/// Physical quantities and their mapping.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Quantities {
    pub(super) stated: Stated,
    catalogue: Arc<Catalogue>,
    /// Dimensionless numbers that vary, in place of the mapped ones.
    numbers: Vec<(Parameter, f64)>,
    /// Whether constant quantities are stated by their own numbers.
    pub(super) held: bool,
    pub(super) view: Result<Box<Physical>, Box<CaseFileError>>,
    /// Notes of a study about the case.
    pub(super) notes: Vec<Remark>,
}

impl Quantities {
    pub(super) fn new(stated: Stated, catalogue: Arc<Catalogue>) -> Self {
        let empty = CaseFileError::one(None, file::Problem::new(file::Place::Whole, ""));
        let quantities = Self {
            stated,
            catalogue,
            numbers: Vec::new(),
            held: false,
            view: Err(Box::new(empty)),
            notes: Vec::new(),
        };
        quantities.mapped(false)
    }

    pub(super) fn catalogue(&self) -> Arc<Catalogue> {
        Arc::clone(&self.catalogue)
    }

    pub(super) fn reader(&self) -> Reader<'_> {
        Reader {
            stated: &self.stated,
            catalogue: &self.catalogue,
        }
    }

    /// Maps the quantities; the lever is kept if lever, tip and modes are unchanged.
    pub(super) fn mapped(mut self, same_lever: bool) -> Self {
        let lever = self.view.as_ref().ok().map(|view| view.lever);
        let lever = lever.filter(|_| same_lever);
        let view = Physical::map(self.reader(), lever)
            .and_then(|view| match self.numbers.as_slice() {
                [] => Ok(view),
                numbers => view.with_numbers(numbers),
            })
            .map(Box::new)
            .map_err(|error| {
                let mut refused = self.stated.refused(error.key(), error.to_string());
                if let (PhysicalError::Missing { .. }, [problem]) = (&error, &mut *refused.problems)
                {
                    problem.is_missing = true;
                }
                Box::new(refused)
            });
        self.view = view;
        self
    }

    /// Returns it if it is valid.
    pub(super) fn validated(self) -> Result<Self, CaseFileError> {
        match &self.view {
            Ok(_) => Ok(self),
            Err(error) => Err((**error).clone()),
        }
    }

    pub(super) fn view(&self) -> Result<&Physical, Box<CaseFileError>> {
        self.view.as_deref().map_err(Clone::clone)
    }

    /// A stated or derived value.
    pub(super) fn get(&self, key: Key) -> Option<f64> {
        let inferred = || self.view.as_ref().ok()?.value(key);
        self.stated.number(key).or_else(inferred)
    }

    /// The stated state from which motions start, in the model's units; `None` if there is none, or
    /// while the distance is left to a setpoint.
    ///
    /// # Errors
    /// If it does not fit the model.
    pub(super) fn start(
        &self,
        model: &Model,
        units: &Units,
    ) -> Result<Option<Vec<f64>>, Box<CaseFileError>> {
        let Some(Value::State(written)) = self.stated.get(Key::DriveStart) else {
            return Ok(None);
        };
        if !self.stated.has(Key::GapTip) {
            return Ok(None);
        }
        let refused =
            |message: String| Box::new(self.stated.refused(Some(Key::DriveStart), message));
        let state = written.read(model, units);
        let mut state = state.map_err(|error| refused(format!("drive.start: {error}")))?;
        if state.len() + model.memory == model.dimension() {
            state.resize(model.dimension(), 0.0);
        }
        let moving = state.len().saturating_sub(model.memory);
        if state.len() < model.memory || moving == 0 || moving % 2 == 1 {
            return Err(refused(format!(
                "drive.start has {} entries; the model has {}: {}",
                state.len(),
                model.dimension(),
                model.state_names().join(", "),
            )));
        }
        Ok(Some(with_modes(&state, model)))
    }

    /// States the state from which motions start, given in the model's units.
    pub(super) fn put_start(&mut self, state: &[f64]) {
        if let Ok(view) = &self.view {
            let written = WrittenState::in_si(state, view.cantilever.modes, &view.scales);
            self.stated.put(Key::DriveStart, Value::State(written));
        }
    }

    pub(super) fn with(&self, key: Key, value: f64) -> Self {
        self.with_of_kind(key, value, key.kind())
    }

    pub(super) fn with_of_kind(&self, key: Key, value: f64, kind: Kind) -> Self {
        let mut varied = self.clone();
        if let Some(parameter) = key.parameter() {
            varied.numbers.retain(|(other, _)| *other != parameter);
            varied.numbers.push((parameter, value));
            return varied.mapped(true);
        }
        if key == Key::Modes {
            varied.stated.put(key, Value::Number(value, Kind::Number));
            return varied.mapped(false);
        }
        if let (false, Ok(view)) = (self.held, &self.view) {
            varied.stated = view.implied_constants(&self.stated);
            varied.held = true;
        }
        varied.stated.set_of_kind(key, value, kind);
        varied.mapped(!matches!(key.section(), Section::Cantilever | Section::Tip))
    }

    /// Derivatives with respect to a quantity of the numbers of the equations that depend on it,
    /// and of the parameters of a nonlinear law, by central differences of the mapping, which is a
    /// sequence of closed forms.
    pub(super) fn derivatives(&self, key: Key) -> Result<Slopes, Box<CaseFileError>> {
        let (low, high, width) = self.bracket(key)?;
        let slope = |p| (high.cantilever.get(p) - low.cantilever.get(p)) / width;
        let numbers = Parameter::every()
            .map(|parameter| (parameter, slope(parameter)))
            .filter(|(_, slope)| *slope != 0.0)
            .collect();
        let values = |view: &Physical| {
            let law = view.cantilever.law.as_ref();
            law.map_or_else(Vec::new, |law| law.values().to_vec())
        };
        let law = values(&high)
            .iter()
            .zip(values(&low))
            // A rigid tip stays rigid.
            .map(|(high, low)| {
                if *high == low {
                    0.0
                } else {
                    (high - low) / width
                }
            })
            .collect();
        Ok((numbers, law))
    }

    /// The mapping slightly below and above the value of a key, and the distance of these values.
    pub(super) fn bracket(
        &self,
        key: Key,
    ) -> Result<(Physical, Physical, f64), Box<CaseFileError>> {
        let here = self.view()?;
        let value = self.get(key).unwrap_or(f64::NAN);
        // Where the mapping is smooth its third derivative is of order 1/value³, so that
        // this step balances truncation and rounding.
        let size = if value == 0.0 {
            scale_of(here, key.kind())
        } else {
            value.abs()
        };
        let step = 1e-5 * size;
        let (low, high) = (self.with(key, value - step), self.with(key, value + step));
        match (low.view, high.view) {
            (Ok(low), Ok(high)) => Ok((*low, *high, 2.0 * step)),
            // At the edge of the valid range: one-sided.
            (Err(_), Ok(high)) => Ok((here.clone(), *high, step)),
            (Ok(low), Err(_)) => Ok((*low, here.clone(), step)),
            (Err(error), Err(_)) => Err(error),
        }
    }

    /// The mapped numbers, unless quantities vary, and the stated values.
    pub(super) fn document<'a>(
        &self,
        cantilever: Option<&'a Cantilever>,
    ) -> QuantitiesDocument<'a> {
        let stated = self.stated.iter();
        QuantitiesDocument {
            cantilever: cantilever.filter(|_| !self.held),
            modes: self.held.then(|| file::modes(&self.stated)),
            quantities: stated
                .filter(|(key, _)| key.is_physical())
                .map(|(key, value)| (key.path(), value.text()))
                .collect(),
        }
    }
}

/// A state with the number of modes of a model: additional modes are at rest, others are left out.
fn with_modes(state: &[f64], model: &Model) -> Vec<f64> {
    let dimension = model.dimension();
    let [own, wanted] = [state.len(), dimension].map(|n| n.saturating_sub(model.memory) / 2);
    let mut resized = vec![0.0; dimension];
    let shared = own.min(wanted);
    resized[..shared].copy_from_slice(&state[..shared]);
    resized[wanted..wanted + shared].copy_from_slice(&state[own..own + shared]);
    for (to, from) in resized[2 * wanted..].iter_mut().zip(&state[2 * own..]) {
        *to = *from;
    }
    resized
}

/// Derivatives of the numbers that change, and of a nonlinear law's parameters in order.
pub(super) type Slopes = (Vec<(Parameter, f64)>, Vec<f64>);

/// A size of a quantity that is zero.
fn scale_of(view: &Physical, kind: Kind) -> f64 {
    let scales = &view.scales;
    match kind {
        Kind::Length => view.free_amplitude.max(1e-3 * scales.length),
        Kind::Mass => scales.mass,
        Kind::Stiffness => scales.stiffness,
        Kind::Damping => scales.damping,
        Kind::Frequency => scales.frequency,
        Kind::Force => scales.force,
        Kind::Time => scales.time,
        _ => 1.0,
    }
}

/// A physical case as a document: the mapped numbers, unless quantities vary, and the stated
/// values.
#[derive(Serialize)]
pub(super) struct QuantitiesDocument<'a> {
    #[serde(flatten)]
    cantilever: Option<&'a Cantilever>,
    #[serde(skip_serializing_if = "Option::is_none")]
    modes: Option<usize>,
    #[serde(flatten)]
    quantities: BTreeMap<&'static str, String>,
}
