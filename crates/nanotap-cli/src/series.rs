//! Time series as CSV.

use std::path::Path;

use nanotap::case::physical::Kind;
use nanotap::case::units::Units;
use nanotap::model::Model;
use nanotap::observe::time_series;

use crate::failure::Failure;
use crate::{file, number};

/// Columns of a physical case in SI: their heads without the unit, by index.
const IN_SI: [(&str, Kind); 5] = [
    ("time", Kind::Time),
    ("tip", Kind::Length),
    ("tip_rate", Kind::Velocity),
    ("gap", Kind::Length),
    ("force", Kind::Force),
];

/// Writes `periods` drive periods from `start`, `resolution` rows each and the very end. States are
/// in the model's units.
pub(crate) fn write(
    path: &Path,
    model: &Model,
    start: &[f64],
    periods: usize,
    resolution: usize,
    units: &Units,
) -> Result<(), Failure> {
    let names = time_series::columns(model).into_iter().enumerate();
    let header = names.map(|(k, name)| match (units, IN_SI.get(k)) {
        (Units::Si(_), Some((name, kind))) => units.column(name, *kind),
        _ => units.state_column(&name),
    });
    let header: Vec<String> = header.collect();
    file::write_rows(path, |rows| {
        rows.push(&(header.join(",") + "\n"))?;
        let mut failed = None;
        time_series::sample(model, start, periods, resolution, |row| {
            let scaled = row.iter().enumerate().map(|(k, value)| match IN_SI.get(k) {
                Some((_, kind)) => units.scaled(*kind, *value),
                None => *value,
            });
            let line = number::row(scaled) + "\n";
            if failed.is_none() {
                failed = rows.push(&line).err();
            }
        })?;
        failed.map_or(Ok(()), Err)
    })
}
