//! The units in which motions are shown: the model's own, or SI where the case has them.

use std::collections::BTreeMap;

use crate::physical::{Kind, Scales};
use crate::quantity::{QuantityError, prefix_of};

/// Largest deflection of a physical case that is believed, in metres.
const MOST_DEFLECTION: f64 = 1e-3;

/// Numbers in SI by name, where a report holds them in the model's units too.
pub type NumbersInSi = BTreeMap<&'static str, f64>;

/// What multiplies the model's numbers before they are shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Units {
    /// The model's own, without a name.
    Model,
    /// SI, with the prefix that fits.
    Si(Scales),
}

impl Units {
    /// SI where `scales` are known.
    pub fn of(scales: Option<&Scales>) -> Self {
        scales.map_or(Self::Model, |scales| Self::Si(*scales))
    }

    /// The SI value of the model's unit of `kind`; `None` in the model's own units, and
    /// for kinds that motions do not have.
    pub fn si(&self, kind: Kind) -> Option<f64> {
        let Self::Si(scales) = self else { return None };
        kind.model_unit().and(kind.dimensional())?;
        scales.si(kind)
    }

    /// A number of the model in these units.
    pub fn scaled(&self, kind: Kind, value: f64) -> f64 {
        self.si(kind).map_or(value, |unit| unit * value)
    }

    /// Named numbers of the model in SI; `None` in the model's own units.
    pub fn in_si<const N: usize>(
        &self,
        numbers: [(&'static str, Kind, f64); N],
    ) -> Option<NumbersInSi> {
        let one = |(name, kind, value)| Some((name, self.si(kind)? * value));
        numbers.into_iter().map(one).collect()
    }

    /// The head of a column with numbers of `kind`: the name, in SI with the unit in brackets.
    pub fn column(&self, name: &str, kind: Kind) -> String {
        match self.si(kind) {
            Some(_) => format!("{name} ({})", kind.si_unit()),
            None => name.to_owned(),
        }
    }

    /// The head of a column with entries of states, which stay in the model's units: in SI these
    /// are given in brackets, with the unit of length g₀ and that of time T.
    pub fn state_column(&self, name: &str) -> String {
        match self.of_entry(name) {
            Some((Kind::Length, _)) => format!("{name} (g0)"),
            Some(_) => format!("{name} (g0/T)"),
            None => name.to_owned(),
        }
    }

    /// The kind of an entry of a state and the SI value of its unit: an amplitude `a1` of a mode is a
    /// length, its rate `v1` a velocity. `None` in the model's own units, and for the sample's
    /// entries.
    pub fn of_entry(&self, name: &str) -> Option<(Kind, f64)> {
        let kind = match name.chars().next()? {
            'a' => Kind::Length,
            'v' => Kind::Velocity,
            _ => return None,
        };
        Some((kind, self.si(kind)?))
    }

    /// Reads a value of an entry of a state, in the model's units; one without a unit is in SI where
    /// the entry has an SI unit.
    ///
    /// # Errors
    /// With what was expected.
    pub fn read_entry(&self, name: &str, text: &str) -> Result<f64, String> {
        let words = |error: QuantityError| error.to_string();
        let Some((kind, si)) = self.of_entry(name) else {
            return Kind::Number.parse(text).map_err(words);
        };
        let value = kind.parse(text).map_err(words)?;
        // A tip that is deflected by more than the beam's gap is a number in the model's units.
        let is_bare = text.trim().parse::<f64>().is_ok();
        let most = if is_bare { si } else { MOST_DEFLECTION };
        if kind == Kind::Length && value.abs() > most {
            return Err(format!(
                "expected a length below {}, got {}; write the unit, as in \"10 nm\"",
                kind.format(most),
                kind.format(value)
            ));
        }
        Ok(value / si)
    }

    /// A value of an entry of a state as text, with so many digits.
    pub fn shown_entry(&self, name: &str, value: f64, digits: usize) -> String {
        let (kind, si) = self.of_entry(name).unwrap_or((Kind::Number, 1.0));
        kind.format_digits(si * value, digits)
    }

    /// For an axis that holds numbers of the model up to `size`: what they are to be
    /// multiplied with, and the unit with the prefix that fits (empty in the model's own units).
    pub fn axis(&self, kind: Kind, size: f64) -> (f64, String) {
        self.si(kind)
            .map_or((1.0, String::new()), |si| prefixed(kind, si, size))
    }
}

/// For numbers up to `size` of which 1 is `si` in SI: what they are to be multiplied with,
/// and the unit with the prefix that fits.
pub fn prefixed(kind: Kind, si: f64, size: f64) -> (f64, String) {
    // A kilogram has a prefix already.
    let (unit, si) = if kind == Kind::Mass {
        ("g", 1e3 * si)
    } else {
        (kind.si_unit(), si)
    };
    let shown = (size * si).abs();
    let takes_prefix = kind != Kind::AngularFrequency;
    let power = if takes_prefix && shown > 0.0 && shown.is_finite() {
        (3 * (nanotap_arithmetic::log10(shown) / 3.0).floor() as i32).clamp(-18, 12)
    } else {
        0
    };
    let prefix = prefix_of(power).unwrap_or_default();
    (si / 10f64.powi(power), format!("{prefix}{unit}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Case;

    /// A lever of k = 3 N/m with its beam 1 µm above the sample: EI/L³ = 1 N/m, so the
    /// model's unit of force is 1 µN (see the mapping's own tests for the rest).
    fn lever() -> Case {
        let text = "[cantilever]\nk = \"3 N/m\"\nf0 = \"75 kHz\"\nQ = 200\n[sample]\nstiffness = \"20 N/m\"\n\
                    [drive]\nfrequency = \"75 kHz\"\namplitude = \"1 nm\"\n[gap]\ntip = \"1 nm\"\nbeam = \"1 um\"\n";
        let source = crate::file::Source {
            name: "case.toml".into(),
            text: text.into(),
        };
        Case::parse(Some(source), &[]).unwrap()
    }

    #[test]
    fn axes_take_the_prefix_that_fits() {
        let units = lever().units();
        let (factor, unit) = units.axis(Kind::Length, 0.02);
        assert_eq!(unit, "nm");
        // 0.02 of 1 µm is 20 nm.
        assert!((factor * 0.02 - 20.0).abs() < 1e-9);
        let (factor, unit) = units.axis(Kind::Force, 0.005);
        assert_eq!(unit, "nN");
        assert!((factor * 0.005 - 5.0).abs() < 1e-9);
        assert_eq!(units.axis(Kind::Length, 0.0).1, "m");
        // 3 of 1 ng.
        let (factor, unit) = prefixed(Kind::Mass, 1e-12, 3.0);
        assert_eq!(unit, "ng");
        assert!((factor * 3.0 - 3.0).abs() < 1e-12);
    }

    #[test]
    fn the_models_own_units_have_no_name() {
        assert_eq!(Units::of(None).axis(Kind::Force, 3.0), (1.0, String::new()));
        assert_eq!(Units::Model.si(Kind::Energy), None);
    }
}
