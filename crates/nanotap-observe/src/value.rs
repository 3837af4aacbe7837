//! Values of observables.

use serde::Serialize;

use super::EnergyBalance;
use nanotap_model::contact::dual::Dual;

/// The value of an observable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// The motion has no such value, or it was not requested.
    Absent,
    /// A single number, in the unit of the observable.
    Number(f64),
    /// A whole number of events.
    Count(usize),
    /// Minimum and maximum of a signal, in this order.
    Range([f64; 2]),
    /// The energies of an energy balance.
    Energies(EnergyBalance),
}

impl Value {
    /// `factor · self + other · by`: the derivative of an observable in another unit, which itself
    /// varies. Both values are of one kind.
    pub(super) fn in_unit(self, factor: f64, value: Self, by: f64) -> Self {
        match (self, value) {
            (Self::Number(change), Self::Number(value)) => {
                Self::Number(change * factor + value * by)
            }
            (Self::Range(change), Self::Range(value)) => {
                Self::Range([0, 1].map(|k| change[k] * factor + value[k] * by))
            }
            (Self::Energies(change), Self::Energies(value)) => {
                let energies =
                    change.with(value, 0.0, |change, value| change * factor + value * by);
                Self::Energies(energies)
            }
            _ => Self::Absent,
        }
    }
}

impl Value {
    /// The number, if the value is one.
    pub const fn number(self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(number),
            Self::Count(count) => Some(count as f64),
            _ => None,
        }
    }
}

/// A type that the value of an observable has.
pub(super) trait Measurable: Copy {
    /// Whether it is a single number.
    const IS_NUMBER: bool = false;
    /// The value of an observable that was not measured.
    const ABSENT: Self;
    /// Converts to a [`Value`], which is absent if nothing was measured.
    fn value(self) -> Value;
    /// The value in a unit whose size is `unit`; absent if that is unknown.
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
        let in_unit = |unit| self.with(self, self.residual, |energy, _| energy * unit);
        unit.map_or(Self::UNKNOWN, in_unit)
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

/// An observable with a derivative.
pub(super) trait Varying {
    /// Returns the derivative; absent where it does not exist.
    fn change(self) -> Value;
}

impl Varying for Dual {
    fn change(self) -> Value {
        if self.derivative().is_finite() {
            Value::Number(self.derivative())
        } else {
            Value::Absent
        }
    }
}

impl Varying for [Dual; 2] {
    fn change(self) -> Value {
        let ends = self.map(Dual::derivative);
        if ends.iter().all(|end| end.is_finite()) {
            Value::Range(ends)
        } else {
            Value::Absent
        }
    }
}

impl Varying for EnergyBalance<Dual> {
    fn change(self) -> Value {
        let energies = self.with(self, 0.0, |energy, _| energy.derivative());
        if energies.drive_work.is_finite() {
            Value::Energies(energies)
        } else {
            Value::Absent
        }
    }
}

/// Discontinuous numbers, or numbers without a known derivative.
impl Varying for f64 {
    fn change(self) -> Value {
        Value::Absent
    }
}

impl Varying for usize {
    fn change(self) -> Value {
        Value::Absent
    }
}

impl<T: Varying> Varying for Option<T> {
    fn change(self) -> Value {
        self.map_or(Value::Absent, T::change)
    }
}
