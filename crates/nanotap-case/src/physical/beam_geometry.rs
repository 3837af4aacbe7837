//! Dimensions of a beam.

use schemars::JsonSchema;
use serde::Serialize;

/// Dimensions of a beam of rectangular cross-section, in m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct BeamGeometry {
    /// Length L of the beam, m.
    #[schemars(extend("x-unit" = "m"))]
    pub length: f64,
    /// Width b of the beam, m.
    #[schemars(extend("x-unit" = "m"))]
    pub width: f64,
    /// Thickness h in the direction of bending, m.
    #[schemars(extend("x-unit" = "m"))]
    pub thickness: f64,
}

impl BeamGeometry {
    /// k = 3EI/L³ = E b h³/(4 L³) for Young's modulus E in Pa; in N/m.
    pub fn stiffness(self, modulus: f64) -> f64 {
        modulus * self.width * (self.thickness / self.length).powi(3) / 4.0
    }

    /// mL = ϱ L b h for the density ϱ in kg/m³; in kg.
    pub fn mass(self, density: f64) -> f64 {
        density * self.length * self.width * self.thickness
    }
}
