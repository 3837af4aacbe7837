//! Dimensions of observables, with units of the model and of SI.

use crate::case::physical::{Kind, Scales};

/// The dimension of an observable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// Deflection, gap or depth; the model's unit is g₀, the SI unit m.
    Length,
    /// Time; the model's unit is √(mL⁴/(EI)), the SI unit s.
    Time,
    /// Velocity; the model's unit is g₀ √(EI/(mL⁴)), the SI unit m/s.
    Velocity,
    /// Force; the model's unit is EI g₀/L³, the SI unit N.
    Force,
    /// Energy; the model's unit is EI g₀²/L³, the SI unit J.
    Energy,
    /// Frequency; the model's unit √(EI/(mL⁴)) is that of an angular frequency, the SI unit Hz.
    Frequency,
    /// Power; the model's unit is that of energy over that of time, the SI unit W.
    Power,
    /// Slope; dW/dξ in the model with the unit g₀/L, the pure number dw/dx in SI.
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
    /// Returns the name of the model's unit.
    pub const fn model_unit(self) -> &'static str {
        match self {
            Self::Length => "g0",
            Self::Time => "sqrt(m L^4/EI)",
            Self::Velocity => "g0 sqrt(EI/(m L^4))",
            Self::Force => "EI g0/L^3",
            Self::Energy => "EI g0^2/L^3",
            Self::Power => "EI g0^2/L^3 sqrt(EI/(m L^4))",
            Self::Frequency => "sqrt(EI/(m L^4))",
            Self::Slope => "g0/L",
            Self::Place => "L",
            Self::Si(kind) => kind.si_unit(),
            _ => self.fixed_unit(),
        }
    }

    /// Returns the name of the SI unit.
    pub const fn si_unit(self) -> &'static str {
        match self.kind() {
            Some(kind) => kind.si_unit(),
            None => self.fixed_unit(),
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

    /// The unit of quantities that are the same in the model and in SI.
    const fn fixed_unit(self) -> &'static str {
        match self {
            Self::Angle => "degree",
            Self::PerPeriod => "1/drive period",
            Self::Periods => "drive periods",
            Self::Unit(unit) => unit,
            _ => "1",
        }
    }

    /// The kind of quantity, for SI prefixes; `None` if the value is the same in the model and in
    /// SI.
    pub const fn kind(self) -> Option<Kind> {
        Some(match self {
            Self::Length => Kind::Length,
            Self::Time => Kind::Time,
            Self::Velocity => Kind::Velocity,
            Self::Force => Kind::Force,
            Self::Energy => Kind::Energy,
            Self::Power => Kind::Power,
            Self::Frequency => Kind::Frequency,
            Self::Si(kind) => kind,
            _ => return None,
        })
    }

    /// SI value of the model's unit; `None` for a slope if the lever's length is unknown.
    pub const fn si(self, scales: &Scales) -> Option<f64> {
        Some(match self {
            Self::Length => scales.length,
            Self::Time => scales.time,
            Self::Velocity => scales.velocity,
            Self::Force => scales.force,
            Self::Energy => scales.energy,
            Self::Power => scales.power,
            Self::Frequency => scales.frequency,
            Self::Slope => return scales.slope,
            _ => 1.0,
        })
    }
}
