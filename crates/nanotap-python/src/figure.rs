//! Descriptions of figures, as JSON that matplotlib draws.

use std::collections::HashMap;

use nanotap::case::physical::Kind;
use nanotap::figure::approach::ApproachCurves;
use nanotap::figure::basin::BasinTable;
use nanotap::figure::branch::BranchCurves;
use nanotap::figure::fit::FitMaps;
use nanotap::figure::panels::{MotionCurves, si_axis};
use nanotap::figure::scan::scan_figure;
use nanotap::figure::sweep::SweepTable;
use nanotap::study::scan::ScanReport;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use serde::de::DeserializeOwned;

use crate::failure::Failure;

/// A label as matplotlib's mathtext writes it.
#[pyfunction]
pub(crate) fn mathtext(label: &str) -> String {
    nanotap_figures::mathtext(label)
}

/// What multiplies numbers up to `size` in an SI unit where they are shown, and the unit with the prefix
/// that fits; 1 and nothing for another unit.
#[pyfunction]
pub(crate) fn axis(unit: &str, size: f64) -> (f64, String) {
    let kind = Kind::of_si_unit(unit).unwrap_or(Kind::Number);
    let (axis, factor) = si_axis("", kind, size);
    (factor, axis.unit)
}

/// Colours: of lines in their order, of the periods 1 to 16, and of the other classes of motions.
#[pyfunction]
pub(crate) fn colours() -> (Vec<String>, Vec<String>, HashMap<String, String>) {
    use nanotap_figures::{LINES, Motion};
    let classes = [
        Motion::QuasiPeriodic,
        Motion::Chaotic,
        Motion::Unbounded,
        Motion::Undecided,
    ];
    (
        LINES.iter().map(ToString::to_string).collect(),
        (1..=16)
            .map(|period| Motion::Periodic(period).colour().to_string())
            .collect(),
        classes
            .iter()
            .map(|class| (class.to_string(), class.colour().to_string()))
            .collect(),
    )
}

/// The description of the figure of a study, as JSON with its large columns apart.
#[pyfunction]
pub(crate) fn describe(
    study: &str,
    facts: &str,
    columns: HashMap<String, PyReadonlyArray1<'_, f64>>,
) -> PyResult<String> {
    let column = |name: &str| -> Vec<f64> {
        columns
            .get(name)
            .map(|values| values.as_array().to_vec())
            .unwrap_or_default()
    };
    let described = || -> Result<String, Failure> {
        let figure = match study {
            "sweep" => {
                let mut table: SweepTable = read(facts)?;
                for (k, axis) in table.axes.iter_mut().enumerate() {
                    axis.values = column(&format!("axis{k}"));
                }
                // Codes, periods and labels are whole numbers that a float holds exactly.
                table.classification = column("classification").iter().map(|c| *c as u8).collect();
                table.period = column("period").iter().map(|p| *p as i32).collect();
                table.period_max = column("period_max");
                table.figure()
            }
            "basin" => {
                let mut table: BasinTable = read(facts)?;
                table.x_values = column("x");
                table.y_values = column("y");
                table.labels = column("labels").iter().map(|l| *l as i32).collect();
                table.figure()
            }
            "branch" => Some(read::<BranchCurves>(facts)?.figure()),
            "approach" => Some(read::<ApproachCurves>(facts)?.figure()),
            "motion" => Some(read::<MotionCurves>(facts)?.figure()),
            "fit-map" => Some(read::<FitMaps>(facts)?.figure()),
            "scan" => Some(scan_figure(&read::<ScanReport>(facts)?)),
            _ => None,
        };
        let figure = figure
            .ok_or_else(|| Failure::input(format!("cannot draw {study}: columns are missing")))?;
        Ok(figure.to_json()?)
    };
    Ok(described()?)
}

fn read<T: DeserializeOwned>(facts: &str) -> Result<T, Failure> {
    serde_json::from_str(facts).map_err(|error| Failure::input(error.to_string()))
}
