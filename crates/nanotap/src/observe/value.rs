//! What an observable's value may be.

use serde::Serialize;

use super::EnergyBalance;

/// The value of an observable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// The motion has none, or nobody asked for it.
    Absent,
    /// A number.
    Number(f64),
    /// A number of things.
    Count(usize),
    /// The least and the greatest.
    Range([f64; 2]),
    /// Energies.
    Energies(EnergyBalance),
}

impl Value {
    /// The number, if it is one.
    pub const fn number(self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(number),
            Self::Count(count) => Some(count as f64),
            _ => None,
        }
    }
}

/// A type that an observable may have.
pub(super) trait Measurable: Copy {
    /// Whether it is one number.
    const IS_NUMBER: bool = false;
    /// Not measured.
    const ABSENT: Self;
    /// The value.
    fn value(self) -> Value;
    /// The value in a unit of which `1` is `unit`; absent where that is not known.
    fn scaled(self, unit: Option<f64>) -> Self;
}

impl Measurable for f64 {
    const IS_NUMBER: bool = true;
    const ABSENT: Self = Self::NAN;

    fn value(self) -> Value {
        if self.is_nan() {
            Value::Absent
        } else {
            Value::Number(self)
        }
    }

    fn scaled(self, unit: Option<f64>) -> Self {
        unit.map_or(Self::NAN, |unit| self * unit)
    }
}

impl Measurable for [f64; 2] {
    const ABSENT: Self = [f64::NAN; 2];

    fn value(self) -> Value {
        if self[0].is_nan() {
            Value::Absent
        } else {
            Value::Range(self)
        }
    }

    fn scaled(self, unit: Option<f64>) -> Self {
        self.map(|end| end.scaled(unit))
    }
}

impl Measurable for usize {
    const IS_NUMBER: bool = true;
    const ABSENT: Self = 0;

    fn value(self) -> Value {
        Value::Count(self)
    }

    fn scaled(self, _: Option<f64>) -> Self {
        self
    }
}

impl Measurable for EnergyBalance {
    const ABSENT: Self = Self::UNKNOWN;

    fn value(self) -> Value {
        if self.residual.is_nan() {
            Value::Absent
        } else {
            Value::Energies(self)
        }
    }

    fn scaled(self, unit: Option<f64>) -> Self {
        unit.map_or(Self::UNKNOWN, |unit| self.in_units(unit))
    }
}

impl<T: Measurable> Measurable for Option<T> {
    const IS_NUMBER: bool = T::IS_NUMBER;
    const ABSENT: Self = None;

    fn value(self) -> Value {
        self.map_or(Value::Absent, T::value)
    }

    fn scaled(self, unit: Option<f64>) -> Self {
        self.map(|value| value.scaled(unit))
    }
}
