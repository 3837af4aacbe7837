//! Dimensions of observables and of columns: kinds of quantities, with the unit in which a result
//! holds them.

use nanotap_case::physical::{Kind, Scales};

/// The dimension of an observable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// Deflection, gap or depth.
    Length,
    /// Time.
    Time,
    /// Velocity.
    Velocity,
    /// Force.
    Force,
    /// Energy.
    Energy,
    /// Frequency; the model's unit is that of an angular frequency.
    Frequency,
    /// Power.
    Power,
    /// Slope; dW/dξ in the model, the pure number dw/dx in SI.
    Slope,
    /// Angle in degrees, in the model and in SI.
    Angle,
    /// A pure number: a fraction or a ratio.
    Number,
    /// A whole number of events, without a unit.
    Count,
    /// A count per drive period.
    PerPeriod,
    /// Time in drive periods, in the model and in SI.
    Periods,
    /// A position along the beam as a fraction of its length, 0 (clamp) to 1 (tip).
    Place,
    /// A quantity of this kind, in SI everywhere.
    Si(Kind),
    /// A quantity with this unit everywhere, which takes no prefixes.
    Unit(&'static str),
}

impl Dimension {
    /// The entry in the table of kinds.
    pub const fn entry(self) -> Kind {
        match self {
            Self::Length => Kind::Length,
            Self::Time => Kind::Time,
            Self::Velocity => Kind::Velocity,
            Self::Force => Kind::Force,
            Self::Energy => Kind::Energy,
            Self::Frequency => Kind::Frequency,
            Self::Power => Kind::Power,
            Self::Slope => Kind::Slope,
            Self::Angle => Kind::Degrees,
            Self::Count => Kind::Count,
            Self::PerPeriod => Kind::PerPeriod,
            Self::Periods => Kind::Periods,
            Self::Place => Kind::Place,
            Self::Si(kind) => kind,
            Self::Number | Self::Unit(_) => Kind::Number,
        }
    }

    /// Returns the name of the model's unit.
    pub const fn model_unit(self) -> &'static str {
        match self {
            Self::Unit(unit) => unit,
            Self::Si(kind) => kind.si_unit(),
            _ => self.entry().result_unit(),
        }
    }

    /// Returns the name of the SI unit.
    pub const fn si_unit(self) -> &'static str {
        match self {
            Self::Unit(unit) => unit,
            _ => self.entry().si_unit(),
        }
    }

    /// The SI unit in the heads of files; empty for a pure number and for counts.
    pub const fn file_unit(self) -> &'static str {
        match (self, self.kind()) {
            (Self::Unit(unit), _) => unit,
            (Self::Angle, _) => "deg",
            (_, Some(kind)) => kind.si_unit(),
            _ => "",
        }
    }

    /// The kind of quantity, for SI prefixes; `None` if the value is the same in the model and in
    /// SI.
    pub const fn kind(self) -> Option<Kind> {
        match self {
            Self::Si(kind) => Some(kind),
            _ => self.entry().dimensional(),
        }
    }

    /// SI value of the model's unit; `None` for a slope if the lever's length is unknown.
    pub fn si(self, scales: &Scales) -> Option<f64> {
        match self {
            Self::Si(_) => Some(1.0),
            _ => scales.si(self.entry()),
        }
    }
}
