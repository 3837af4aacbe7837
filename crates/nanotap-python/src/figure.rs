//! Descriptions of figures, as JSON that matplotlib draws.

use std::collections::HashMap;

use nanotap::figure::approach::ApproachCurves;
use nanotap::figure::basin::BasinTable;
use nanotap::figure::branch::BranchCurves;
use nanotap::figure::convergence::difference_panel;
use nanotap::figure::fit::fit_figure;
use nanotap::figure::modes::shapes_figure;
use nanotap::figure::panels::{AttractorCurves, MotionCurves, OrbitCurves, SectionCurves};
use nanotap::figure::reconstruct::reconstruct_figure;
use nanotap::figure::sweep::SweepTable;
use nanotap::model::beam::Modes;
use nanotap::study::fit::FitReport;
use nanotap::study::reconstruct::ReconstructReport;
use nanotap_figures::Figure;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::failure::Failure;

/// A label as matplotlib's mathtext writes it.
#[pyfunction]
pub(crate) fn mathtext(label: &str) -> String {
    nanotap_figures::mathtext(label)
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

#[derive(Deserialize)]
struct Differences {
    modes: Vec<usize>,
    difference: Vec<Option<f64>>,
    tolerance: f64,
    enough: Option<usize>,
}

#[derive(Deserialize)]
struct Shapes {
    modes: usize,
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
            "fit" => Some(fit_figure(&read::<FitReport>(facts)?)),
            "reconstruct" => Some(reconstruct_figure(&read::<ReconstructReport>(facts)?)),
            "motion" => Some(read::<MotionCurves>(facts)?.figure()),
            "orbit" => Some(read::<OrbitCurves>(facts)?.figure()),
            "attractors" => Some(read::<AttractorCurves>(facts)?.figure()),
            "section" => Some(read::<SectionCurves>(facts)?.figure()),
            "convergence" => {
                let Differences {
                    modes,
                    difference,
                    tolerance,
                    enough,
                } = read(facts)?;
                let panel = difference_panel(&modes, &difference, tolerance, enough);
                Some(Figure::single(panel))
            }
            "modes" => {
                let Shapes { modes } = read(facts)?;
                let beam = Modes::new(modes).map_err(|error| Failure::input(error.to_string()))?;
                Some(shapes_figure(&beam))
            }
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
