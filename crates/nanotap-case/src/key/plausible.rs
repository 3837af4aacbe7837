//! Values that no lever, tip, sample or drive has: most likely numbers without their unit, or with
//! another prefix.

use super::{Key, Section};
use crate::quantity::Kind;

/// Quantities by section, their values in SI on real instruments, and the unit in which they are
/// usually given.
const PLAUSIBLE: [(Section, Kind, [f64; 2], &str); 12] = [
    (Section::Cantilever, Kind::Stiffness, [0.0, 1e4], "N/m"),
    (Section::Cantilever, Kind::Frequency, [500.0, 1e8], "kHz"),
    (Section::Cantilever, Kind::Length, [0.0, 0.05], "um"),
    (Section::Tip, Kind::Length, [0.0, 1e-3], "nm"),
    (Section::Tip, Kind::Pressure, [1e3, 2e12], "GPa"),
    (Section::Sample, Kind::Pressure, [10.0, 2e12], "GPa"),
    (Section::Sample, Kind::Length, [0.0, 0.1], "nm"),
    (Section::Sample, Kind::SurfaceEnergy, [0.0, 10.0], "mJ/m^2"),
    (Section::Sample, Kind::Energy, [0.0, 1e-15], "zJ"),
    (Section::Drive, Kind::Frequency, [200.0, 1e9], "kHz"),
    (Section::Drive, Kind::Length, [0.0, 1e-3], "nm"),
    (Section::Gap, Kind::Length, [0.0, 1e-3], "nm"),
];

/// What was meant by a value in SI of a key that no instrument has, such as `11 nm`; `None` if one may have
/// it. A setpoint may be a shift of a fraction of a hertz.
pub(crate) fn meant(key: Key, section: Section, kind: Kind, value: f64) -> Option<String> {
    if key == Key::DriveSetpoint {
        return None;
    }
    let mut rows = PLAUSIBLE.iter();
    let (.., [low, high], unit) =
        rows.find(|(of, quantity, ..)| *of == section && *quantity == kind)?;
    if value == 0.0 || !value.is_finite() || (*low..=*high).contains(&value.abs()) {
        return None;
    }
    let shown = kind.format(value);
    let number = shown.split(' ').next().unwrap_or_default();
    Some(format!("{number} {unit}"))
}
