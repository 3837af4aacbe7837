//! Elastic constants.

use schemars::JsonSchema;
use serde::Serialize;

/// Elastic constants of an isotropic solid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Elastic {
    /// Young's modulus in Pa, above zero.
    pub modulus: f64,
    /// Poisson's ratio, from -1 to 0.5, ends left out on the lower side.
    pub poisson: f64,
}

impl Elastic {
    /// E/(1 − ν²): the modulus for a rigid indenter, in Pa.
    pub fn plane_strain_modulus(self) -> f64 {
        self.modulus / (1.0 - self.poisson * self.poisson)
    }
}
