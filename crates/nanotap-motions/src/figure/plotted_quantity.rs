//! The quantity of a motion that a figure shows along an axis.

use crate::orbit::spectral_radius;
use nanotap_case::Case;
use nanotap_case::physical::Kind;
use nanotap_case::physical::quantity::JOULES_PER_ELECTRONVOLT;
use nanotap_case::units::prefixed;
use nanotap_figures::Axis;
use nanotap_observe::table::shown_phase;
use nanotap_observe::{Dimension, Observable, Observables};

/// The quantity of an orbit that is drawn: an observable that is one number, or the largest
/// multiplier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlottedQuantity {
    /// An observable that is one number.
    Observable(&'static Observable),
    /// Largest modulus of a multiplier, dimensionless.
    SpectralRadius,
}

const SPECTRAL_RADIUS: &str = "spectral_radius";

impl PlottedQuantity {
    /// The choice of this name.
    pub fn named(name: &str) -> Option<Self> {
        if name == SPECTRAL_RADIUS {
            return Some(Self::SpectralRadius);
        }
        let observable = Observable::named(name).filter(|o| o.is_number)?;
        Some(Self::Observable(observable))
    }

    /// Returns all choices: name and description.
    pub fn choices() -> impl Iterator<Item = (&'static str, &'static str)> {
        nanotap_observe::OBSERVABLES
            .iter()
            .filter(|o| o.is_number)
            .map(|o| (o.name, o.words))
            .chain([(SPECTRAL_RADIUS, "largest modulus of a multiplier")])
    }

    /// The default observable of a case's branches: the largest displacement; the impact speed with a
    /// rigid stop, at which the largest displacement is constant.
    pub fn usual(case: &Case) -> Self {
        let name = if case.has_rigid_stop() {
            "impact_speed"
        } else {
            "tip_max"
        };
        Self::named(name).unwrap_or(Self::SpectralRadius)
    }

    /// The observable, if it is one.
    pub const fn observable(self) -> Option<&'static Observable> {
        match self {
            Self::Observable(observable) => Some(observable),
            Self::SpectralRadius => None,
        }
    }

    /// Value of the quantity; NaN if the motion has none.
    pub fn of(self, observables: &Observables, multipliers: &[[f64; 2]]) -> f64 {
        match self {
            Self::SpectralRadius => spectral_radius(multipliers),
            Self::Observable(observable) => {
                let value = (observable.of)(observables).number().unwrap_or(f64::NAN);
                if self.is_phase() {
                    shown_phase(value)
                } else {
                    value
                }
            }
        }
    }

    /// Whether the quantity is an angle, which wraps around.
    pub fn is_phase(self) -> bool {
        self.observable()
            .is_some_and(|o| o.dimension == Dimension::Angle)
    }

    /// The axis for values up to `size`, and the factor of the values. `beam` is true for a
    /// cantilever, false for an oscillator. `si` gives the SI value of 1, if known; energies are
    /// then in electronvolts.
    pub fn axis(self, beam: bool, si: impl Fn(Kind) -> Option<f64>, size: f64) -> (Axis, f64) {
        let Self::Observable(observable) = self else {
            return (Axis::linear("largest |$μ$|"), 1.0);
        };
        let axis = Axis::linear(observable.axis_label(beam));
        if self.is_phase() {
            return (axis.unit("°"), 1.0);
        }
        let Some((kind, si)) = observable.dimension.kind().and_then(|k| Some((k, si(k)?))) else {
            return (axis, 1.0);
        };
        let (factor, unit) = match kind {
            // The electronvolt has the prefixes of the joule.
            Kind::Energy => {
                let (factor, unit) = prefixed(kind, si / JOULES_PER_ELECTRONVOLT, size);
                (factor, unit.replace('J', "eV"))
            }
            _ => prefixed(kind, si, size),
        };
        (axis.unit(unit), factor)
    }
}
