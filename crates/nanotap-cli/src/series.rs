//! Time series as CSV.

use std::fmt::Write as _;
use std::path::Path;

use nanotap::case::physical::Kind;
use nanotap::case::units::Units;
use nanotap::model::Model;
use nanotap::observe::time_series;

use crate::failure::Failure;
use crate::{file, number};

/// Writes `periods` drive periods from `start`, `resolution` rows each and the very end.
/// Of a physical case, columns in SI follow the model's own.
pub(crate) fn write(
    path: &Path,
    model: &Model,
    start: &[f64],
    periods: usize,
    resolution: usize,
    units: &Units,
) -> Result<(), Failure> {
    let mut csv = time_series::columns(model).join(",");
    // The columns that also exist in the model's units, by index.
    let si: Vec<(usize, f64)> = [
        ("time_s", 0, Kind::Time),
        ("tip_m", 1, Kind::Length),
        ("tip_rate_m_per_s", 2, Kind::Velocity),
        ("gap_m", 3, Kind::Length),
        ("force_N", 4, Kind::Force),
    ]
    .into_iter()
    .filter_map(|(name, column, kind)| {
        let unit = units.si(kind)?;
        let _ = write!(csv, ",{name}");
        Some((column, unit))
    })
    .collect();
    csv.push('\n');
    file::write_rows(path, |rows| {
        rows.push(&csv)?;
        let mut failed = None;
        time_series::sample(model, start, periods, resolution, |row| {
            let si = si.iter().map(|(column, unit)| row[*column] * unit);
            let line = number::row(row.iter().copied().chain(si)) + "\n";
            if failed.is_none() {
                failed = rows.push(&line).err();
            }
        })?;
        failed.map_or(Ok(()), Err)
    })
}
