//! Time series as CSV.

use std::path::Path;

use nanotap::case::units::Units;
use nanotap::model::Model;
use nanotap::observe::time_series;

use crate::failure::Failure;
use crate::{file, number};

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
    let header = time_series::heads(model, units);
    file::write_rows(path, |rows| {
        rows.push(&(header.join(",") + "\n"))?;
        let mut failed = None;
        time_series::sample(model, start, periods, resolution, |row| {
            let line = number::row(time_series::scaled(row, units)) + "\n";
            if failed.is_none() {
                failed = rows.push(&line).err();
            }
        })?;
        failed.map_or(Ok(()), Err)
    })
}
