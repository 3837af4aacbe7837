//! Units of spectral densities, as files write them.

use afm_thermal::{Density, Unit};
use nanotap_quantity::{Kind, Quantity};

/// What a density measures, and the factor of its base unit: pm²/Hz is (1e-12 m)²/Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DensityUnit {
    pub(super) density: Density,
    pub(super) unit: Unit,
    /// Value of the base unit in m or V.
    base: f64,
}

impl DensityUnit {
    /// Reads `V²/Hz`, `pm^2/Hz`, `m/sqrt(Hz)`, `nm/√Hz`, `V/Hz^0.5`. `None` if it is not such a unit.
    pub(super) fn read(text: &str) -> Option<Self> {
        let text: String = text.chars().filter(|c| !c.is_whitespace()).collect();
        let text = text.replace('²', "^2");
        let power = ["^2/Hz", "2/Hz"];
        let amplitude = [
            "/sqrt(Hz)",
            "/sqrtHz",
            "/√Hz",
            "/√(Hz)",
            "/rtHz",
            "/Hz^0.5",
            "/Hz^(1/2)",
            "/Hz^{1/2}",
        ];
        let strip = |ends: &[&str]| {
            let found = ends.iter().find_map(|end| text.strip_suffix(end))?;
            Some(found.trim_matches(['(', ')']).to_owned())
        };
        let (base, density) = match strip(&power) {
            Some(base) => (base, Density::Power),
            None => (strip(&amplitude)?, Density::Amplitude),
        };
        let (unit, base) = signal(&base)?;
        Some(Self {
            density,
            unit,
            base,
        })
    }

    /// A value of the density in m or V.
    pub(super) fn in_si(self, value: f64) -> f64 {
        match self.density {
            Density::Power => value * self.base * self.base,
            Density::Amplitude => value * self.base,
        }
    }
}

/// The unit of a deflection, and its value in m or V.
pub(super) fn signal(text: &str) -> Option<(Unit, f64)> {
    let quantity: Quantity = format!("1 {text}").parse().ok()?;
    let is = |kind: Kind| quantity.dimension == kind.dimension();
    let unit = if is(Kind::Length) {
        Unit::Metre
    } else if is(Kind::Voltage) {
        Unit::Volt
    } else {
        return None;
    };
    Some((unit, quantity.value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_files() {
        for (text, density, unit, of_two) in [
            ("V²/Hz", Density::Power, Unit::Volt, 2.0),
            ("m/sqrt(Hz)", Density::Amplitude, Unit::Metre, 2.0),
            ("pm^2/Hz", Density::Power, Unit::Metre, 2e-24),
            ("(nm)²/Hz", Density::Power, Unit::Metre, 2e-18),
            ("fm/√Hz", Density::Amplitude, Unit::Metre, 2e-15),
            ("µV / Hz^0.5", Density::Amplitude, Unit::Volt, 2e-6),
        ] {
            let found = DensityUnit::read(text).unwrap_or_else(|| panic!("{text}"));
            assert_eq!((found.density, found.unit), (density, unit), "{text}");
            assert!((found.in_si(2.0) / of_two - 1.0).abs() < 1e-12, "{text}");
        }
        for text in ["", "V", "1/Hz", "N²/Hz", "V/Hz", "dB", "Hz"] {
            assert_eq!(DensityUnit::read(text), None, "{text}");
        }
    }
}
