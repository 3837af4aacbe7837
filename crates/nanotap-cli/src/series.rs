//! Time series as CSV.

use std::path::Path;

use nanotap::case::units::Units;
use nanotap::model::Model;
use nanotap::observe::time_series;

use crate::failure::Failure;
use crate::{file, number};

/// Writes the rows that `sample` passes to its argument, with the columns of
/// [`time_series::sample`].
pub(crate) fn write<E: Into<Failure>>(
    path: &Path,
    model: &Model,
    units: &Units,
    sample: impl FnOnce(&mut dyn FnMut(&[f64])) -> Result<(), E>,
) -> Result<(), Failure> {
    let header = time_series::heads(model, units);
    file::write_rows(path, |rows| {
        rows.push(&(header.join(",") + "\n"))?;
        let mut failed = None;
        sample(&mut |row| {
            let line = number::row(time_series::scaled(row, units)) + "\n";
            if failed.is_none() {
                failed = rows.push(&line).err();
            }
        })
        .map_err(Into::into)?;
        failed.map_or(Ok(()), Err)
    })
}
