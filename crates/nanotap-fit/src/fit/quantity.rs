//! The quantity in a column of measured values: an observable of the motion, a reading of a
//! frequency modulation loop, or a reading of a force curve.

use nanotap_case::physical::Kind;
use nanotap_motions::frequency_modulation::Modulated;
use nanotap_observe::frame::{Declared, Row as _};
use nanotap_observe::{Dimension, OBSERVABLES, Observable};

/// A quantity in a column of measured values.
#[derive(Clone, Copy, Debug)]
pub enum Quantity {
    /// An observable of a periodic orbit.
    Observed(&'static Observable),
    /// A reading of frequency modulation.
    Modulated(&'static Declared<Modulated>),
    /// A reading of a force curve.
    Rest(RestQuantity),
}

/// Reading of a lever at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RestQuantity {
    /// Deflection of the tip away from the sample.
    Deflection,
    /// Force of the sample on the tip, positive if it repels.
    Force,
}

/// Quantities that an instrument under frequency modulation records; the other columns of the study
/// are derived from them.
const RECORDED: [&str; 4] = [
    "frequency_shift",
    "relative_shift",
    "drive_ratio",
    "drive_dissipation",
];

impl Quantity {
    /// Parses a name, with capitals or without; `own_amplitude` if another column is the reading of
    /// a lock-in amplifier.
    pub(super) fn named(name: &str, own_amplitude: bool) -> Option<Self> {
        let plain = name.to_lowercase().replace([' ', '-'], "_");
        let name = match plain.as_str() {
            "amplitude" if !own_amplitude => "first_harmonic",
            other => other,
        };
        let modulated = Modulated::COLUMNS
            .iter()
            .find(|c| c.name == name && RECORDED.contains(&c.name));
        let rest = match name {
            "deflection" => Some(RestQuantity::Deflection),
            "force" => Some(RestQuantity::Force),
            _ => None,
        };
        let is_called = |o: &&Observable| o.name == name || o.si_name.eq_ignore_ascii_case(name);
        let mut numbers = OBSERVABLES.iter().filter(|o| o.is_number);
        modulated
            .map(Self::Modulated)
            .or_else(|| rest.map(Self::Rest))
            .or_else(|| numbers.find(is_called).map(Self::Observed))
    }

    /// Returns the name of the quantity, as in a report or a header.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Observed(observable) => observable.name,
            Self::Modulated(column) => column.name,
            Self::Rest(RestQuantity::Deflection) => "deflection",
            Self::Rest(RestQuantity::Force) => "force",
        }
    }

    /// Returns the name of the quantity in SI, which differs for some observables.
    pub(super) const fn si_name(self) -> &'static str {
        match self {
            Self::Observed(observable) => observable.si_name,
            Self::Modulated(_) | Self::Rest(_) => self.name(),
        }
    }

    /// The observable, if it is one.
    pub const fn observable(self) -> Option<&'static Observable> {
        match self {
            Self::Observed(observable) => Some(observable),
            Self::Modulated(_) | Self::Rest(_) => None,
        }
    }

    /// The reading of frequency modulation, if it is one.
    pub const fn modulated(self) -> Option<&'static Declared<Modulated>> {
        match self {
            Self::Modulated(column) => Some(column),
            Self::Observed(_) | Self::Rest(_) => None,
        }
    }

    /// The reading of a force curve, if it is one.
    pub const fn rest(self) -> Option<RestQuantity> {
        match self {
            Self::Rest(quantity) => Some(quantity),
            Self::Observed(_) | Self::Modulated(_) => None,
        }
    }

    /// Whether it is an angle.
    pub fn is_angle(self) -> bool {
        let observable = self.observable();
        observable.is_some_and(|o| o.dimension == Dimension::Angle)
    }

    /// Kind of quantity, if it has a unit; `None` if it is the same in the model and in SI.
    pub const fn kind(self) -> Option<Kind> {
        match self {
            Self::Observed(observable) => observable.dimension.kind(),
            Self::Modulated(column) => column.dimension.kind(),
            Self::Rest(RestQuantity::Deflection) => Some(Kind::Length),
            Self::Rest(RestQuantity::Force) => Some(Kind::Force),
        }
    }

    /// Unit in SI, or in the units of a dimensionless case.
    pub const fn unit(self, physical: bool) -> &'static str {
        match (self, self.kind()) {
            (Self::Observed(o), Some(_)) if !physical => o.dimension.model_unit(),
            (Self::Observed(o), _) => o.dimension.si_unit(),
            (_, Some(kind)) if physical => kind.si_unit(),
            _ => "1",
        }
    }
}

impl PartialEq for Quantity {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}
