//! The report of any study of the registry with its figure.

use nanotap_dynamics::Control;
use nanotap_figures::Figure;
use serde_json::Value;

use crate::Error;
use crate::case::Case;
use crate::dataset::{Store, StoreError};
use crate::figure;
use crate::model::beam::Modes;
use crate::study::fit;
use crate::study::registry::{Document, Study, StudyEntry};
use crate::study::request::read;
use crate::study::setpoint::at_setpoint;
use crate::study::{DatasetStudy as _, basin, scan, sweep, window};
use crate::study::{contact_laws, convergence, force_curve, lyapunov, modes};

/// The document of a study, and its figure if it has one.
///
/// # Errors
/// Those of the study; and when its report is a dataset.
pub fn document_and_figure(
    entry: &StudyEntry,
    case: &Case,
    request: Value,
    control: &Control<'_>,
) -> Result<(Value, Option<Figure>), Error> {
    let given = (case, request, control);
    match entry.name {
        modes::ModesStudy::NAME => drawn::<modes::ModesStudy>(given, |_, report| {
            let beam = Modes::new(report.modes);
            let beam = beam.map_err(|error| Error::numerics(error.to_string()))?;
            Ok(figure::modes::shapes_figure(&beam))
        }),
        lyapunov::LyapunovStudy::NAME => drawn::<lyapunov::LyapunovStudy>(given, |case, report| {
            let model = case.model()?;
            Ok(figure::attractors::section_figure(
                &model,
                report,
                &case.units(),
            ))
        }),
        convergence::ConvergenceStudy::NAME => {
            drawn::<convergence::ConvergenceStudy>(given, |case, report| {
                Ok(figure::motion::convergence_figure(report, &case.units()))
            })
        }
        contact_laws::ContactLawsStudy::NAME => {
            drawn::<contact_laws::ContactLawsStudy>(given, |case, report| {
                Ok(figure::contact_laws::sample_figure(report, &case.units()))
            })
        }
        force_curve::ForceCurveStudy::NAME => {
            drawn::<force_curve::ForceCurveStudy>(given, |_, report| {
                Ok(figure::force_curve::force_curve_figure(report))
            })
        }
        "fm" => drawn::<crate::study::frequency_modulation::FrequencyModulationStudy>(
            given,
            |case, report| Ok(figure::approach::approach_figure(report, &case.units())),
        ),
        "bimodal" => drawn::<crate::study::bimodal::BimodalStudy>(given, |_, report| {
            Ok(figure::bimodal::bimodal_figure(report))
        }),
        _ => {
            let (case, request, control) = given;
            let document = entry.document(case, request, control)?;
            Ok((serde_json::from_str(&document)?, None))
        }
    }
}

/// The figure of a study's finished dataset, if it has one.
///
/// # Errors
/// When a chunk is missing or damaged.
pub fn dataset_figure(study: &str, store: &Store) -> Result<Option<Figure>, StoreError> {
    Ok(Some(match study {
        sweep::SweepStudy::NAME => figure::sweep::figure(store)?,
        window::WindowStudy::NAME => figure::window::figure(store)?,
        basin::BasinStudy::NAME => figure::basin::figure(store)?,
        scan::ScanLines::NAME => figure::scan::scan_figure(&scan::ScanLines::report(store)?),
        fit::FitMap::NAME => figure::fit::fit_map_figure(store)?,
        _ => return Ok(None),
    }))
}

fn drawn<S: Study>(
    (case, request, control): (&Case, Value, &Control<'_>),
    draw: fn(&Case, &S::Report) -> Result<Figure, Error>,
) -> Result<(Value, Option<Figure>), Error> {
    let options = read::<S::Options>(request)?;
    let case = if S::ANY_DISTANCE {
        case.clone()
    } else {
        at_setpoint(case.clone(), control)?.0
    };
    let report = S::run(&case, &options, control)?;
    let document = serde_json::to_value(Document::of::<S>(&report, &case))?;
    Ok((document, Some(draw(&case, &report)?)))
}
