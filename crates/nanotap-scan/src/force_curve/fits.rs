//! Moduli from fits of contact models to the unloading part.
//!
//! Each model makes the separation a straight line in a known function of the force, so that the
//! fit is a linear regression: with the adhesion force `P` of the curve,
//! - Hertz: `δ = (3 F / (4 E* √R))^{2/3}`;
//! - DMT: the same with `F + P` (Derjaguin, Muller and Toporov, J. Colloid Interface Sci. 53,
//!   314, 1975);
//! - JKR: `δ = a₀²/R (ā² − ⅔ √ā)`, `ā = ((1 + √(1 + F/P))/2)^{2/3}`, `a₀³ = 3 P R/E*` (Johnson,
//!   Kendall and Roberts, Proc. R. Soc. A 324, 301, 1971; Carpick, Ogletree and Salmeron, J.
//!   Colloid Interface Sci. 211, 395, 1999).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Contact model of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ContactModel {
    /// Hertz: no adhesion
    Hertz,
    /// Derjaguin, Muller and Toporov
    Dmt,
    /// Johnson, Kendall and Roberts
    Jkr,
}

impl ContactModel {
    const ALL: [Self; 3] = [Self::Hertz, Self::Dmt, Self::Jkr];

    /// Returns the name of the model for tables and figures, as in `DMT`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hertz => "Hertz",
            Self::Dmt => "DMT",
            Self::Jkr => "JKR",
        }
    }
}

/// A fit of a contact model to the unloading part of a force curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ContactFit {
    /// Contact model that is fitted.
    pub model: ContactModel,
    /// Reduced modulus E* of tip and sample, Pa.
    #[schemars(extend("x-unit" = "Pa"))]
    pub reduced_modulus: f64,
    /// Young's modulus of the sample, Pa, with the case's Poisson ratio and tip; None if these are
    /// unknown.
    #[schemars(extend("x-unit" = "Pa"))]
    pub modulus: Option<f64>,
    /// Separation at which the indentation begins, m.
    #[schemars(extend("x-unit" = "m"))]
    pub contact_point: f64,
    /// Root mean square of the separation minus that of the fit, m.
    #[schemars(extend("x-unit" = "m"))]
    pub residual: f64,
    /// Number of points of the curve that are fitted.
    pub points: usize,
}

/// Fits every model to `(separation, force)` in m and N, with the tip's radius and the adhesion
/// force. A model without a fit is left out.
pub(super) fn fits(
    points: &[(f64, f64)],
    radius: f64,
    adhesion: f64,
    sample_modulus: impl Fn(f64) -> Option<f64>,
) -> Vec<ContactFit> {
    let fit = |model: ContactModel| {
        let function = |force: f64| -> Option<f64> {
            let root = |x: f64| (x > 0.0).then(|| nanotap_arithmetic::powf(x, 2.0 / 3.0));
            match model {
                ContactModel::Hertz => root(force),
                ContactModel::Dmt => root(force + adhesion),
                ContactModel::Jkr => {
                    let part = 1.0 + force / adhesion;
                    if !(adhesion > 0.0 && part >= 0.0) {
                        return None;
                    }
                    let radius = root(0.5 * (1.0 + part.sqrt()))?;
                    Some(radius * radius - 2.0 / 3.0 * radius.sqrt())
                }
            }
        };
        let used: Vec<(f64, f64)> = points
            .iter()
            .filter_map(|(gap, force)| Some((function(*force)?, *gap)))
            .collect();
        let (slope, contact_point, residual) = line(&used)?;
        // The separation falls by `scale` times the function.
        let scale = -slope;
        let reduced_modulus = match model {
            ContactModel::Hertz | ContactModel::Dmt => {
                0.75 / (radius.sqrt() * nanotap_arithmetic::powf(scale, 1.5))
            }
            ContactModel::Jkr => {
                3.0 * adhesion * radius / nanotap_arithmetic::powf(scale * radius, 1.5)
            }
        };
        (scale > 0.0 && reduced_modulus.is_finite()).then(|| ContactFit {
            model,
            reduced_modulus,
            modulus: sample_modulus(reduced_modulus),
            contact_point,
            residual,
            points: used.len(),
        })
    };
    ContactModel::ALL.into_iter().filter_map(fit).collect()
}

/// Fits `y = slope x + offset` by least squares: returns slope, offset and root mean square of the
/// residuals.
fn line(points: &[(f64, f64)]) -> Option<(f64, f64, f64)> {
    let n = points.len() as f64;
    if points.len() < 3 {
        return None;
    }
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let both = mean(&|p| (p.0 - x) * (p.1 - y));
    let square = mean(&|p| (p.0 - x) * (p.0 - x));
    let slope = both / square;
    let offset = y - slope * x;
    let rest = mean(&|p| {
        let rest = p.1 - offset - slope * p.0;
        rest * rest
    });
    slope.is_finite().then(|| (slope, offset, rest.sqrt()))
}
