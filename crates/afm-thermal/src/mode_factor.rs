//! Factors between the mean square of the first mode, as the optical lever shows it, and the static
//! spring constant.

use schemars::JsonSchema;
use serde::Serialize;

use crate::Error;
use crate::error::{positive, require};

/// First root α₁ of cos α cosh α = −1.
const ALPHA: f64 = 1.875_104_068_711_961;

/// k = β/χ² · `k_B` T/m with the mean square m of the first mode in terms of the static sensitivity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ModeFactor {
    /// Static spring constant relative to that of the first mode: 12/α₁⁴ = 0.971 for a uniform beam
    /// (H.-J. Butt and M. Jaschke, Nanotechnology 6, 1 (1995)).
    pub beta: f64,
    /// Slope at the light spot per deflection of the tip, for a static end load relative to the first
    /// mode: 1.090 for a small spot at the end (R. Proksch et al., Nanotechnology 15, 1344 (2004)).
    pub chi: f64,
    /// β/χ².
    pub product: f64,
}

impl Default for ModeFactor {
    fn default() -> Self {
        Self::new(static_ratio(), slope_ratio(1.0))
    }
}

impl ModeFactor {
    fn new(beta: f64, chi: f64) -> Self {
        Self {
            beta,
            chi,
            product: beta / (chi * chi),
        }
    }

    /// A uniform beam without a tip mass and a small light spot at `spot`, as a fraction of its length
    /// from the clamp.
    ///
    /// # Errors
    /// If `spot` is not above 0 and at most 1.
    pub fn at_spot(spot: f64) -> Result<Self, Error> {
        let is_valid = spot > 0.0 && spot <= 1.0;
        require(
            is_valid,
            "the position of the light spot",
            spot,
            "a fraction above 0, at most 1",
        )?;
        Ok(Self::new(static_ratio(), slope_ratio(spot)))
    }

    /// A known factor β/χ², which replaces that of the beam; χ is taken as 1.
    ///
    /// # Errors
    /// If the factor is not finite and above 0.
    pub fn of_product(factor: f64) -> Result<Self, Error> {
        positive("the correction factor β/χ²", factor)?;
        Ok(Self::new(factor, 1.0))
    }
}

fn static_ratio() -> f64 {
    12.0 / (ALPHA * ALPHA * ALPHA * ALPHA)
}

/// χ of a small spot at ξ: the slope (3ξ − 3ξ²/2) d/L of an end load, over φ′(ξ)/φ(1) d/L of the mode.
fn slope_ratio(spot: f64) -> f64 {
    use nanotap_arithmetic::{cos, cosh, sin, sinh};
    let sigma = (sin(ALPHA) - sinh(ALPHA)) / (cos(ALPHA) + cosh(ALPHA));
    let value = |x: f64| cos(x) - cosh(x) + sigma * (sin(x) - sinh(x));
    let slope = |x: f64| ALPHA * (-sin(x) - sinh(x) + sigma * (cos(x) - cosh(x)));
    (3.0 * spot - 1.5 * spot * spot) / (slope(ALPHA * spot) / value(ALPHA))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factors_of_a_bare_beam() {
        let factor = ModeFactor::default();
        // Butt and Jaschke 1995: 0.971; the slope of the first mode at the end is 1.3765/L.
        assert!((factor.beta - 0.970_688).abs() < 1e-6);
        assert!((factor.chi - 1.5 / 1.376_506).abs() < 1e-6);
        assert!((factor.product - 0.817_435).abs() < 1e-6);
        assert!(
            (nanotap_arithmetic::cos(ALPHA) * nanotap_arithmetic::cosh(ALPHA) + 1.0).abs() < 1e-14
        );
    }

    #[test]
    fn a_factor_replaces_both() {
        let factor = ModeFactor::of_product(0.9).unwrap();
        assert_eq!((factor.product, factor.chi), (0.9, 1.0));
        assert!(ModeFactor::of_product(f64::NAN).is_err());
        assert!(ModeFactor::at_spot(1.1).is_err());
        assert_eq!(ModeFactor::at_spot(1.0).unwrap(), ModeFactor::default());
    }
}
