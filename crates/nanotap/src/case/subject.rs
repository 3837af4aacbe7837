//! What is studied: a cantilever or a one-degree-of-freedom oscillator, under one
//! interface of named parameters.

use serde::Serialize;

use nanotap_dynamics::{MapFamily, StroboscopicMap, TwoParameterFamily};
use nanotap_flow::FlowError;
use nanotap_flow::sensitivity::SystemTangent;

use crate::case::near_name::near_name;
use crate::case::physical::Resolved;
use crate::case::physical_subject::{PhysicalKey, PhysicalSubject};
use crate::model::cantilever::Cantilever;
use crate::model::oscillator::{Oscillator, OscillatorParameter, Stop};
use crate::model::parameter::Parameter;
use crate::model::strobe::Strobe;
use crate::model::{Model, ModelError, cantilever_tangent};
use nalgebra::DMatrix;

/// A case of any kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Subject {
    /// The cantilever.
    Cantilever(Cantilever),
    /// An oscillator with a stop.
    Oscillator(Oscillator),
    /// A cantilever of which physical quantities vary.
    Physical(Box<PhysicalSubject>),
}

/// A parameter of a [`Subject`] that can be varied continuously.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Key {
    /// Of the cantilever.
    Cantilever(Parameter),
    /// Of an oscillator.
    Oscillator(OscillatorParameter),
    /// Of a physical case: a quantity in SI.
    Physical(PhysicalKey),
}

impl Key {
    /// Its key in a case file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cantilever(parameter) => parameter.name(),
            Self::Oscillator(parameter) => parameter.name(),
            Self::Physical(key) => key.path(),
        }
    }

    /// What its values measure: of a physical quantity its kind, else a number.
    pub const fn kind(self) -> crate::case::physical::Kind {
        match self {
            Self::Physical(key) => key.kind(),
            _ => crate::case::physical::Kind::Number,
        }
    }

    /// How a figure's axis writes it.
    pub fn symbol(self) -> &'static str {
        use OscillatorParameter as P;
        match self {
            Self::Cantilever(parameter) => parameter.symbol(),
            Self::Physical(key) => key.path(),
            Self::Oscillator(parameter) => match parameter {
                P::Mass => "m",
                P::Stiffness => "k",
                P::Damping => "c",
                P::Forcing => "F",
                P::Omega => "ω",
                P::Gap => "gap",
                P::ContactStiffness => "k₁",
                P::ContactDamping => "c₁",
                P::Restitution => "r",
            },
        }
    }
}

/// A name that is no parameter of the subject.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no parameter `{given}` here; there are {known}{hint}")]
pub struct UnknownKey {
    /// What was asked for.
    pub given: String,
    /// What there is.
    pub known: String,
    /// The nearest one, as a question.
    pub hint: String,
}

impl Subject {
    /// Its parameters.
    pub fn keys(&self) -> Vec<Key> {
        match self {
            Self::Cantilever(case) => {
                let parameters = case.parameters().into_iter();
                parameters.map(Key::Cantilever).collect()
            }
            Self::Oscillator(oscillator) => OscillatorParameter::ALL
                .into_iter()
                .filter(|p| oscillator.get(*p).is_some())
                .map(Key::Oscillator)
                .collect(),
            Self::Physical(_) => PhysicalKey::all().map(Key::Physical).collect(),
        }
    }

    /// The parameter called `name` (readable aliases included).
    ///
    /// # Errors
    /// [`UnknownKey`] with what there is and the nearest name.
    pub fn key(&self, name: &str) -> Result<Key, UnknownKey> {
        if let Self::Cantilever(case) = self
            && let Ok(parameter) = name.parse::<Parameter>()
            && case.parameters().contains(&parameter)
        {
            return Ok(Key::Cantilever(parameter));
        }
        let keys = self.keys();
        if let Some(key) = keys.iter().find(|k| k.name() == name) {
            return Ok(*key);
        }
        let known: Vec<&str> = keys.iter().map(|k| k.name()).collect();
        let hint = near_name(name, known.iter().copied())
            .map_or_else(String::new, |k| format!(" (did you mean `{k}`?)"));
        Err(UnknownKey {
            given: name.to_owned(),
            known: known.join(", "),
            hint,
        })
    }

    /// The value of a parameter; NaN where the subject does not have it.
    pub fn get(&self, key: Key) -> f64 {
        match (self, key) {
            (Self::Cantilever(case), Key::Cantilever(p)) => case.get(p),
            (Self::Oscillator(oscillator), Key::Oscillator(p)) => {
                oscillator.get(p).unwrap_or(f64::NAN)
            }
            (Self::Physical(subject), Key::Physical(key)) => subject.get(key),
            _ => f64::NAN,
        }
    }

    /// The same subject with one parameter changed.
    #[must_use]
    pub fn with(&self, key: Key, value: f64) -> Self {
        match (self, key) {
            (Self::Cantilever(case), Key::Cantilever(p)) => {
                Self::Cantilever(case.clone().with(p, value))
            }
            (Self::Oscillator(oscillator), Key::Oscillator(p)) => {
                Self::Oscillator(oscillator.with(p, value))
            }
            (Self::Physical(subject), Key::Physical(key)) => {
                Self::Physical(Box::new(subject.with(key, value)))
            }
            _ => self.clone(),
        }
    }

    /// Its model.
    ///
    /// # Errors
    /// When it makes no sense or cannot be solved in closed form.
    pub fn model(&self) -> Result<Model, ModelError> {
        match self {
            Self::Cantilever(case) => Model::cantilever(case),
            Self::Oscillator(oscillator) => oscillator.model(),
            Self::Physical(subject) => {
                Model::cantilever(&subject.resolved().map_err(Box::new)?.case)
            }
        }
    }

    /// The derivative of its system with respect to one parameter.
    ///
    /// # Errors
    /// As [`Subject::model`].
    pub fn tangent(&self, model: &Model, key: Key) -> Result<SystemTangent, ModelError> {
        match (self, key) {
            (Self::Cantilever(case), Key::Cantilever(p)) => cantilever_tangent(case, model, p),
            (Self::Oscillator(oscillator), Key::Oscillator(p)) => oscillator.tangent(model, p),
            (Self::Physical(subject), Key::Physical(key)) => {
                let case = &subject.resolved().map_err(Box::new)?.case;
                let mut sum = SystemTangent::zeros(&model.system);
                for (parameter, slope) in subject.derivatives(key).map_err(Box::new)? {
                    sum.add(slope, &cantilever_tangent(case, model, parameter)?);
                }
                Ok(sum)
            }
            _ => Ok(SystemTangent::zeros(&model.system)),
        }
    }

    /// The dimensionless cantilever that it is; `None` of an oscillator, and where physical
    /// quantities have no meaning.
    pub fn case(&self) -> Option<Cantilever> {
        match self {
            Self::Cantilever(case) => Some(case.clone()),
            Self::Oscillator(_) => None,
            Self::Physical(_) => self.resolved().map(|resolved| resolved.case.clone()),
        }
    }

    /// What is known of it in SI, if physical quantities vary.
    pub fn resolved(&self) -> Option<&Resolved> {
        match self {
            Self::Physical(subject) => subject.resolved().ok(),
            _ => None,
        }
    }

    /// Whether its stop is rigid: contact is an instant there.
    pub fn has_rigid_stop(&self) -> bool {
        matches!(
            self,
            Self::Oscillator(Oscillator {
                stop: Stop::Rigid { .. },
                ..
            })
        )
    }
}

/// A subject with one free parameter.
#[derive(Clone, Debug)]
pub struct Family {
    /// The subject; the value of its free parameter does not matter.
    pub subject: Subject,
    /// The free parameter.
    pub key: Key,
}

impl MapFamily for Family {
    type Map = Strobe;
    type Error = ModelError;

    fn at(&self, parameter: f64) -> Result<Strobe, ModelError> {
        strobe_at(&self.subject, &[(self.key, parameter)])
    }

    fn advance_with_derivatives(
        &self,
        _parameter: f64,
        map: &mut Strobe,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivative: &mut [f64],
    ) -> Result<(), <Strobe as StroboscopicMap>::Error> {
        let mut derivatives = DMatrix::zeros(state.len(), 1);
        map.advance_with_derivatives(state, jacobian, &mut derivatives)?;
        derivative.copy_from_slice(derivatives.as_slice());
        Ok(())
    }
}

/// A subject with two free parameters.
#[derive(Clone, Debug)]
pub struct PlaneFamily {
    /// The subject; the values of its free parameters do not matter.
    pub subject: Subject,
    /// The free parameters.
    pub keys: [Key; 2],
}

impl TwoParameterFamily for PlaneFamily {
    type Map = Strobe;
    type Error = ModelError;

    fn at(&self, first: f64, second: f64) -> Result<Strobe, ModelError> {
        strobe_at(
            &self.subject,
            &[(self.keys[0], first), (self.keys[1], second)],
        )
    }

    fn advance_with_derivatives(
        &self,
        _parameters: [f64; 2],
        map: &mut Strobe,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivatives: [&mut [f64]; 2],
    ) -> Result<(), FlowError> {
        let mut columns = DMatrix::zeros(state.len(), 2);
        map.advance_with_derivatives(state, jacobian, &mut columns)?;
        for (derivative, column) in derivatives.into_iter().zip(columns.column_iter()) {
            derivative.copy_from_slice(column.as_slice());
        }
        Ok(())
    }
}

/// The map at these values of the free parameters, with its derivatives to them.
fn strobe_at(subject: &Subject, values: &[(Key, f64)]) -> Result<Strobe, ModelError> {
    let subject = values
        .iter()
        .fold(subject.clone(), |s, &(key, value)| s.with(key, value));
    let model = subject.model()?;
    let tangents = values
        .iter()
        .map(|&(key, _)| subject.tangent(&model, key))
        .collect::<Result<_, _>>()?;
    Ok(Strobe::with_tangents(&model, tangents))
}

impl From<UnknownKey> for crate::Error {
    fn from(error: UnknownKey) -> Self {
        Self::input(
            error.to_string(),
            "name a parameter of the dimensionless model",
        )
    }
}
