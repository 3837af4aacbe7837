//! The maps of a case along one or two of its keys.

use nalgebra::DMatrix;
use nanotap_dynamics::{MapFamily, StroboscopicMap, TwoParameterFamily};

use super::error::CaseError;
use super::{Case, Key};
use nanotap_model::MotionError;
use nanotap_model::model_map::ModelMap;

/// A case with one free parameter.
#[derive(Clone, Debug)]
pub struct Family {
    /// The case; the value of its free parameter does not matter.
    pub case: Case,
    /// Key of the free parameter.
    pub key: Key,
}

impl MapFamily for Family {
    type Map = ModelMap;
    type Error = CaseError;

    fn at(&self, parameter: f64) -> Result<ModelMap, CaseError> {
        strobe_at(&self.case, &[(self.key, parameter)])
    }

    fn advance_with_derivatives(
        &self,
        _parameter: f64,
        map: &mut ModelMap,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivative: &mut [f64],
    ) -> Result<(), <ModelMap as StroboscopicMap>::Error> {
        let mut derivatives = DMatrix::zeros(state.len(), 1);
        map.advance_with_derivatives(state, jacobian, &mut derivatives)?;
        derivative.copy_from_slice(derivatives.as_slice());
        Ok(())
    }
}

/// A case with two free parameters.
#[derive(Clone, Debug)]
pub struct PlaneFamily {
    /// The case; the values of its free parameters do not matter.
    pub case: Case,
    /// Keys of the two free parameters.
    pub keys: [Key; 2],
}

impl TwoParameterFamily for PlaneFamily {
    type Map = ModelMap;
    type Error = CaseError;

    fn at(&self, first: f64, second: f64) -> Result<ModelMap, CaseError> {
        strobe_at(&self.case, &[(self.keys[0], first), (self.keys[1], second)])
    }

    fn advance_with_derivatives(
        &self,
        _parameters: [f64; 2],
        map: &mut ModelMap,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivatives: [&mut [f64]; 2],
    ) -> Result<(), MotionError> {
        let mut columns = DMatrix::zeros(state.len(), 2);
        map.advance_with_derivatives(state, jacobian, &mut columns)?;
        for (derivative, column) in derivatives.into_iter().zip(columns.column_iter()) {
            derivative.copy_from_slice(column.as_slice());
        }
        Ok(())
    }
}

/// The map at these values of the free parameters, with its derivatives.
fn strobe_at(case: &Case, values: &[(Key, f64)]) -> Result<ModelMap, CaseError> {
    let case = values
        .iter()
        .fold(case.clone(), |case, &(key, value)| case.with(key, value));
    let model = case.model()?;
    let tangents = values
        .iter()
        .map(|&(key, _)| case.tangent(&model, key))
        .collect::<Result<_, _>>()?;
    Ok(ModelMap::with_tangents(&model, tangents))
}
