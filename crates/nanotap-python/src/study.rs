//! What exists, and how it changes: census, branches, exponents, modes enough, the paper.

use std::path::PathBuf;

use nanotap::case::ParameterUnit;
use nanotap::study::approach::{ApproachOptions, ApproachReport, approach as approach_curve};
use nanotap::study::attractors::{AttractorsOptions, attractors as census};
use nanotap::study::branch::{BranchOptions, BranchReport, SeedOptions, branch as follow};
use nanotap::study::convergence::convergence as compare;
use nanotap::study::lyapunov::{LyapunovOptions, LyapunovReport, Section, lyapunov as exponents};
use nanotap::study::orbit::OrbitOptions;
use nanotap::study::simulate::SettleOptions;
use nanotap::study::start_box::box_with;
use nanotap_paper::{About, Check, Options as PaperOptions, Verdict, report, section_names};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use serde::Serialize;

use crate::case::CaseCore;
use crate::failure::Failure;
use crate::motion::{numbers, oscillator};
use crate::watch::{on_threads, watched};

/// A census of the motions that coexist: JSON, and whether Ctrl-C stopped it.
#[pyfunction]
#[pyo3(signature = (case, *, starts, seed, sides, max_period, unstable, threads, progress))]
pub(crate) fn attractors(
    py: Python<'_>,
    case: &CaseCore,
    starts: Option<usize>,
    seed: u64,
    sides: Vec<(String, f64, f64)>,
    max_period: usize,
    unstable: usize,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, bool)> {
    let studied = case.studied(py)?;
    let done = watched(py, progress, move |control| {
        let model = studied.model()?;
        // A box that was given is searched with the 256 starts of old, if no number is.
        let starts = starts.or((!sides.is_empty()).then_some(256));
        let options = AttractorsOptions {
            starts,
            seed,
            start_box: Some(box_with(&model, &sides)?),
            settle: SettleOptions {
                max_period,
                ..SettleOptions::default()
            },
            unstable,
            ..AttractorsOptions::default()
        };
        let found = on_threads(threads, || census(&model, &options, control))??;
        let found = match studied.physical() {
            Some(resolved) => found.in_si(resolved),
            None => found,
        };
        Ok(serde_json::to_string(&found)?)
    })?;
    Ok((done.result, done.interrupted))
}

/// The document of branches.
#[derive(Serialize)]
struct Branches<'a> {
    #[serde(flatten)]
    report: &'a BranchReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    parameter_unit: Option<ParameterUnit>,
}

/// Orbits followed in a parameter: JSON, and whether Ctrl-C stopped it.
#[pyfunction]
#[pyo3(signature = (case, *, parameter, from_, to, period, state, doublings, census, second, max_step, threads, progress))]
pub(crate) fn branch(
    py: Python<'_>,
    case: &CaseCore,
    parameter: &str,
    from_: &str,
    to: &str,
    period: Option<usize>,
    state: Option<PyReadonlyArray1<'_, f64>>,
    doublings: usize,
    census: Option<(usize, usize, u64)>,
    second: Option<(String, String, String)>,
    max_step: f64,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, bool)> {
    let studied = case.studied(py)?;
    let ends = |name: &str, from: &str, to: &str| -> Result<_, Failure> {
        let key = studied.key(name)?;
        Ok((key, studied.value(key, from)?, studied.value(key, to)?))
    };
    let (key, from, to) = ends(parameter, from_, to)?;
    let second = second
        .map(|(name, low, high)| ends(&name, &low, &high))
        .transpose()?;
    let options = BranchOptions {
        period,
        state: numbers(state),
        doublings,
        census: census.map(|(values, starts, seed)| SeedOptions {
            values,
            starts,
            seed,
            ..SeedOptions::default()
        }),
        second,
        max_step,
        ..BranchOptions::over(key, from, to)
    };
    let done = watched(py, progress, move |control| {
        let report = on_threads(threads, || follow(&studied, &options, control))??;
        Ok(serde_json::to_string(&Branches {
            report: &report,
            parameter_unit: studied.parameter_unit(key),
        })?)
    })?;
    Ok((done.result, done.interrupted))
}

/// The document of an approach curve.
#[derive(Serialize)]
struct Approach<'a> {
    #[serde(flatten)]
    report: &'a ApproachReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    parameter_unit: Option<ParameterUnit>,
}

/// A motion followed to the sample and back: JSON, and whether Ctrl-C stopped it.
#[pyfunction]
#[pyo3(signature = (case, *, from_, to, points, branches, doublings, max_period, threads, progress))]
pub(crate) fn approach(
    py: Python<'_>,
    case: &CaseCore,
    from_: Option<&str>,
    to: Option<&str>,
    points: usize,
    branches: bool,
    doublings: usize,
    max_period: usize,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, bool)> {
    let studied = case.at_any_distance();
    let key = studied.gap_key();
    let distance = |text: Option<&str>| {
        text.map(|text| studied.value(key, text).map_err(Failure::from))
            .transpose()
    };
    let options = ApproachOptions {
        from: distance(from_)?,
        to: distance(to)?,
        points,
        branches,
        doublings,
        max_period,
        ..ApproachOptions::default()
    };
    let done = watched(py, progress, move |control| {
        let report = on_threads(threads, || approach_curve(&studied, &options, control))??;
        Ok(serde_json::to_string(&Approach {
            report: &report,
            parameter_unit: studied.parameter_unit(key),
        })?)
    })?;
    Ok((done.result, done.interrupted))
}

/// Lyapunov exponents (JSON) and the points of a section: phase in drive periods, tip, its
/// rate, the gap's rate, then the state. `phase` is that of the section in degrees; without
/// it, contacts are the section.
#[pyfunction]
#[pyo3(signature = (case, *, periods, transient, state, phase, points))]
pub(crate) fn lyapunov<'py>(
    py: Python<'py>,
    case: &CaseCore,
    periods: usize,
    transient: usize,
    state: Option<PyReadonlyArray1<'_, f64>>,
    phase: Option<f64>,
    points: usize,
) -> PyResult<(String, Bound<'py, PyArray2<f64>>)> {
    let studied = case.studied(py)?;
    let options = LyapunovOptions {
        transient,
        state: numbers(state),
        periods,
        section: phase.map_or(Section::Contact, |degrees| {
            Section::Phase((degrees / 360.0).rem_euclid(1.0))
        }),
        points,
        ..LyapunovOptions::default()
    };
    let done = watched(py, None, move |_| {
        let report: LyapunovReport = exponents(&studied.model()?, &options)?;
        let rows = report.section.iter().flat_map(|p| {
            [p.phase, p.tip, p.tip_rate, p.gap_rate]
                .into_iter()
                .chain(p.state.iter().copied())
        });
        let width = 4 + report.section.first().map_or(0, |p| p.state.len());
        Ok((
            serde_json::to_string(&report)?,
            rows.collect::<Vec<f64>>(),
            width,
        ))
    })?;
    let (document, values, width) = done.result;
    let shape = [values.len() / width, width];
    Ok((document, PyArray1::from_vec(py, values).reshape(shape)?))
}

/// The same motion with more and more modes: JSON.
#[pyfunction]
#[pyo3(signature = (case, *, largest, tolerance, period))]
pub(crate) fn convergence(
    py: Python<'_>,
    case: &CaseCore,
    largest: usize,
    tolerance: f64,
    period: Option<usize>,
) -> PyResult<String> {
    let studied = case.studied(py)?;
    let done = watched(py, None, move |_| {
        let Some(case) = studied.cantilever() else {
            return Err(oscillator(&studied, "convergence"));
        };
        let options = OrbitOptions {
            period,
            ..OrbitOptions::default()
        };
        let result = compare(case, largest, tolerance, &options)?;
        Ok(serde_json::to_string(&result)?)
    })?;
    Ok(done.result)
}

/// The document of the paper's report.
#[derive(Serialize)]
struct Paper<'a> {
    out: &'a PathBuf,
    html: &'a PathBuf,
    markdown: &'a PathBuf,
    pictures: &'a [PathBuf],
    quick: bool,
    reproduced: usize,
    differs: usize,
    ambiguous: usize,
    differs_in_print: usize,
    differs_in_motion: usize,
    checks: Vec<&'a Check>,
}

/// The paper computed again, its report and pictures in the folder `out`: JSON, and whether
/// Ctrl-C stopped it.
#[pyfunction]
#[pyo3(signature = (*, out, only, quick, threads, progress))]
pub(crate) fn paper(
    py: Python<'_>,
    out: PathBuf,
    only: Vec<String>,
    quick: bool,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, bool)> {
    let done = watched(py, progress, move |control| {
        // Before the work, not after it.
        std::fs::create_dir_all(&out).map_err(|error| {
            nanotap::Error::files(format!("cannot make {}: {error}", out.display()))
        })?;
        let report = on_threads(threads, || report(&PaperOptions { only, quick }, control))??;
        let written = report.write(&out)?;
        Ok(serde_json::to_string(&Paper {
            out: &out,
            html: &written.html,
            markdown: &written.markdown,
            pictures: &written.pictures,
            quick: report.quick,
            reproduced: report.count(Verdict::Reproduced),
            differs: report.count(Verdict::Differs),
            ambiguous: report.count(Verdict::Ambiguous),
            differs_in_print: report.differing(About::Print),
            differs_in_motion: report.differing(About::Motion),
            checks: report.checks().collect(),
        })?)
    })?;
    Ok((done.result, done.interrupted))
}

/// The names of the report's sections.
#[pyfunction]
pub(crate) fn paper_sections() -> Vec<&'static str> {
    section_names().collect()
}
