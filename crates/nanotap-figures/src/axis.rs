//! Axes: labels, scales and ranges.

use serde::{Deserialize, Serialize};

use crate::error::FigureError;
use crate::ticks::{self, Ticks};

/// Numbers beyond this magnitude count as infinite, so that differences and logarithms do not
/// overflow.
const LARGEST: f64 = 1e300;
/// Fraction of the range left free on either side of the data.
const PADDING: f64 = 0.04;

/// Data smaller than this fraction of an axis's natural size are rounding errors.
pub const ROUNDING: f64 = 1e-9;

/// How values are spaced along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Values are evenly spaced.
    #[default]
    Linear,
    /// Logarithms of the values are evenly spaced; only positive values are shown.
    Log,
}

/// Which part of an axis is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Range {
    /// All data, with a margin.
    #[default]
    Auto,
    /// All data, without a margin.
    Tight,
    /// From the first to the second value, whatever the data; reversed if the first is larger.
    Fixed(f64, f64),
}

/// One axis: its label with the unit, its scale and its range.
///
/// Labels are plain text ("Ω", "τ / T", "a₁") with a little markup: `_{…}` lowers and `^{…}` raises;
/// between dollar signs letters are italic as variables are, and `_x` and `^x` need no braces
/// (`"$a_1$ (nm)"`); a backslash takes the next character as it is.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
#[must_use]
pub struct Axis {
    /// Quantity on the axis, without the unit; may contain markup.
    pub label: String,
    /// Unit, shown in brackets after the label; empty if there is none.
    pub unit: String,
    /// Spacing of values along the axis, linear or logarithmic.
    pub scale: Scale,
    /// Which part of the axis is drawn.
    pub range: Range,
    /// Ticks: values with their labels; `None`: round numbers.
    pub marks: Option<Vec<(f64, String)>>,
    /// Magnitude of a value that matters, in the unit of the axis: see [`Axis::natural`].
    pub natural: Option<f64>,
}

impl Axis {
    /// A linear axis that contains all data, with a margin.
    pub fn linear(label: impl Into<String>) -> Axis {
        Axis {
            label: label.into(),
            ..Axis::default()
        }
    }

    /// A logarithmic axis that contains all positive data; other values are gaps.
    pub fn log(label: impl Into<String>) -> Axis {
        Axis {
            scale: Scale::Log,
            ..Axis::linear(label)
        }
    }

    /// Runs from `from` to `to` whatever the data; reversed if `from > to`. Both must be finite,
    /// distinct, and positive on a logarithmic axis; otherwise drawing the figure fails.
    pub fn range(mut self, from: f64, to: f64) -> Axis {
        self.range = Range::Fixed(from, to);
        self
    }

    /// Ends exactly where the data end.
    pub fn tight(mut self) -> Axis {
        self.range = Range::Tight;
        self
    }

    /// Sets ticks at the given values with the given labels, instead of round numbers.
    pub fn marks<S: Into<String>>(mut self, marks: impl IntoIterator<Item = (f64, S)>) -> Axis {
        self.marks = Some(marks.into_iter().map(|(v, s)| (v, s.into())).collect());
        self
    }

    /// Sets the unit, which is shown in brackets after the label.
    pub fn unit(mut self, unit: impl Into<String>) -> Axis {
        self.unit = unit.into();
        self
    }

    /// Sets the magnitude of a value that matters: data that are all smaller than 10⁻⁹ of it, or
    /// differ by less, are rounding errors, and the axis shows them as constant.
    pub fn natural(mut self, size: impl Into<Option<f64>>) -> Axis {
        self.natural = size.into();
        self
    }

    /// The label with the unit.
    pub fn words(&self) -> String {
        match (self.label.as_str(), self.unit.as_str()) {
            (label, "") => label.to_owned(),
            ("", unit) => unit.to_owned(),
            (label, unit) => format!("{label} ({unit})"),
        }
    }

    /// Whether the axis has ticks: not if there are no data and no range was given.
    pub(crate) fn marked(&self) -> bool {
        matches!(self.range, Range::Fixed(..)) || self.marks.is_some()
    }

    /// Whether a value can be shown on the axis.
    pub(crate) fn holds(&self, value: f64) -> bool {
        value.is_finite()
            && value.abs() <= LARGEST
            && (self.scale == Scale::Linear || value >= 1.0 / LARGEST)
    }

    pub(crate) fn check(&self) -> Result<(), FigureError> {
        let Range::Fixed(from, to) = self.range else {
            return Ok(());
        };
        let refuse = |reason| {
            Err(FigureError::Invalid(format!(
                "the axis \"{}\" cannot run from {from} to {to}: {reason}",
                self.label
            )))
        };
        if !(from.is_finite() && to.is_finite() && from.abs() <= LARGEST && to.abs() <= LARGEST) {
            refuse("both ends must be finite and below 1e300 in size")
        } else if self.scale == Scale::Log && from.min(to) < 1.0 / LARGEST {
            refuse("a logarithmic axis needs ends above zero")
        } else if indistinct(from.min(to), from.max(to)) {
            refuse("its ends must differ by more than rounding")
        } else {
            Ok(())
        }
    }

    /// The range to draw for data of the given extent.
    pub(crate) fn view(&self, extent: Extent) -> View {
        let log = self.scale == Scale::Log;
        let natural = self.natural.filter(|n| n.is_finite()).unwrap_or(0.0).abs();
        let (from, to) = match self.range {
            Range::Fixed(from, to) => (from, to),
            Range::Auto => extent.range(log, PADDING, natural),
            Range::Tight => extent.range(log, 0.0, natural),
        };
        View { from, to, log }
    }
}

/// Whether two ends are too close for a scale of floating-point numbers between them.
fn indistinct(low: f64, high: f64) -> bool {
    high - low <= 1e-11 * low.abs().max(high.abs()) || high - low < 1e-290
}

/// The smallest interval with all values that were added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hull {
    low: f64,
    high: f64,
}

impl Hull {
    const EMPTY: Hull = Hull {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
    };

    pub(crate) fn add(&mut self, value: f64) {
        self.join(Hull {
            low: value,
            high: value,
        });
    }

    fn join(&mut self, other: Hull) {
        self.low = self.low.min(other.low);
        self.high = self.high.max(other.high);
    }
}

/// Extent of the data along an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    /// Data that need a margin.
    pub(crate) data: Hull,
    /// Items that may touch the end of the axis: the feet of bars.
    pub(crate) feet: Hull,
    /// Maps: they fill the panel, and nothing beyond them is shown.
    pub(crate) maps: Hull,
}

impl Extent {
    pub(crate) const EMPTY: Extent = Extent {
        data: Hull::EMPTY,
        feet: Hull::EMPTY,
        maps: Hull::EMPTY,
    };

    pub(crate) fn join(&mut self, other: Extent) {
        self.data.join(other.data);
        self.feet.join(other.feet);
        self.maps.join(other.maps);
    }

    fn range(self, log: bool, padding: f64, natural: f64) -> (f64, f64) {
        if self.maps.low < self.maps.high {
            return (self.maps.low, self.maps.high);
        }
        let mut all = self.data;
        all.join(self.feet);
        let Hull { low, high } = all;
        if low > high {
            return if log { (1.0, 10.0) } else { (0.0, 1.0) };
        }
        let size = low.abs().max(high.abs());
        if !log && natural > 0.0 && size <= ROUNDING * natural {
            return (-natural, natural);
        }
        if indistinct(low, high) || high - low <= ROUNDING * size.max(natural) {
            return match (log, size < 1e-289) {
                (true, _) => (low / 2.0, high * 2.0),
                (false, true) => (-1.0, 1.0),
                (false, false) => (low - 0.05 * size, high + 0.05 * size),
            };
        }
        let below = if low < self.feet.low { padding } else { 0.0 };
        let above = if high > self.feet.high { padding } else { 0.0 };
        if log {
            let ratio = (libm::log10(high) - libm::log10(low)).max(0.0);
            (
                low * libm::pow(10f64, -ratio * below),
                high * libm::pow(10f64, ratio * above),
            )
        } else {
            (low - below * (high - low), high + above * (high - low))
        }
    }
}

/// The part of an axis that is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct View {
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) log: bool,
}

impl View {
    /// Position of a value: 0 at the start of the axis, 1 at its end; `None` if it cannot be shown.
    pub(crate) fn share(self, value: f64) -> Option<f64> {
        if !value.is_finite() || (self.log && value <= 0.0) {
            return None;
        }
        let share = if self.log {
            (libm::log(value) - libm::log(self.from)) / (libm::log(self.to) - libm::log(self.from))
        } else {
            (value - self.from) / (self.to - self.from)
        };
        // The exact position outside does not matter, but drawing needs finite coordinates.
        share.is_finite().then(|| share.clamp(-1e6, 1e6))
    }

    pub(crate) fn ticks(self, max_count: usize) -> Ticks {
        let (low, high) = (self.from.min(self.to), self.from.max(self.to));
        if self.log {
            ticks::logarithmic(low, high, max_count)
        } else {
            ticks::linear(low, high, max_count)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(axis: &Axis, values: &[f64]) -> View {
        let mut extent = Extent::EMPTY;
        values
            .iter()
            .filter(|v| axis.holds(**v))
            .for_each(|v| extent.data.add(*v));
        axis.view(extent)
    }

    #[test]
    fn ranges_without_width_are_widened() {
        for values in [
            &[3.0][..],
            &[0.0, 0.0],
            &[-1e-12],
            &[1.0, 1.0 + 1e-13],
            &[1e300],
            &[],
        ] {
            for axis in [Axis::linear("x"), Axis::log("x"), Axis::linear("x").tight()] {
                let v = view(&axis, values);
                assert!(
                    v.to > v.from && v.from.is_finite() && v.to.is_finite(),
                    "{values:?} {v:?}"
                );
                assert!(!v.ticks(5).positions.is_empty(), "{values:?} {v:?}");
            }
        }
    }

    #[test]
    fn room_is_left_around_data_but_not_around_areas() {
        assert_eq!(
            view(&Axis::linear("x"), &[0.0, 1.0]),
            View {
                from: -0.04,
                to: 1.04,
                log: false
            }
        );
        assert_eq!(
            view(&Axis::linear("x").tight(), &[0.0, 1.0]),
            View {
                from: 0.0,
                to: 1.0,
                log: false
            }
        );
        let mut extent = Extent::EMPTY;
        extent.feet.add(0.0);
        extent.feet.add(2.0);
        extent.data.add(1.0);
        assert_eq!(
            Axis::linear("x").view(extent),
            View {
                from: 0.0,
                to: 2.0,
                log: false
            }
        );
        extent.maps.add(5.0);
        extent.maps.add(6.0);
        assert_eq!(
            Axis::linear("x").view(extent),
            View {
                from: 5.0,
                to: 6.0,
                log: false
            }
        );
    }

    #[test]
    fn impossible_ranges_are_refused_with_a_reason() {
        for (axis, words) in [
            (Axis::linear("x").range(1.0, 1.0), "differ"),
            (Axis::linear("x").range(f64::NAN, 1.0), "finite"),
            (Axis::log("x").range(0.0, 1.0), "above zero"),
        ] {
            assert!(axis.check().unwrap_err().to_string().contains(words));
        }
        assert!(Axis::linear("x").range(2.0, -1.0).check().is_ok());
    }

    #[test]
    fn shares() {
        let log = Axis::log("x").range(1.0, 100.0).view(Extent::EMPTY);
        assert!((log.share(10.0).unwrap() - 0.5).abs() < 1e-15);
        assert_eq!(log.share(-1.0), None);
        let backwards = Axis::linear("x").range(4.0, 0.0).view(Extent::EMPTY);
        assert_eq!(backwards.share(3.0), Some(0.25));
        assert_eq!(backwards.share(f64::NAN), None);
    }
}
