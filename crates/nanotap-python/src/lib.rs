//! The Python module: conversion between Python and the library, without physics or numerics.
//!
//! Results are passed as the JSON documents of the command line and as numpy arrays; the package
//! `nanotap` turns them into typed objects, xarray Datasets and pandas tables. Work runs on a
//! separate thread while the caller waits outside the interpreter lock ([`watch`]), so that Ctrl-C
//! works and a panic becomes an exception.

#![allow(
    clippy::needless_pass_by_value,
    reason = "arguments come out of Python as values"
)]

mod case;
mod columns;
mod dataset;
mod document;
mod failure;
mod figure;
mod file;
mod map;
mod motion;
mod study;
mod watch;

use pyo3::prelude::*;

/// Faster than the system's at the small blocks that reports and models are made of.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// The compiled part of nanotap.
#[pymodule]
fn _nanotap(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<case::CaseCore>()?;
    module.add_class::<file::FileCore>()?;
    module.add_class::<map::MapCore>()?;
    module.add_class::<map::MotionCore>()?;
    module.add_class::<study::ReportCore>()?;
    module.add_class::<dataset::Recipe>()?;
    module.add_class::<dataset::Receiver>()?;
    for function in [
        wrap_pyfunction!(run_command_line, module)?,
        wrap_pyfunction!(case::case_keys, module)?,
        wrap_pyfunction!(case::catalogue, module)?,
        wrap_pyfunction!(case::catalogue_text, module)?,
        wrap_pyfunction!(case::in_si, module)?,
        wrap_pyfunction!(case::si_unit_of, module)?,
        wrap_pyfunction!(case::link, module)?,
        wrap_pyfunction!(case::label, module)?,
        wrap_pyfunction!(motion::modes, module)?,
        wrap_pyfunction!(motion::simulate, module)?,
        wrap_pyfunction!(motion::orbit, module)?,
        wrap_pyfunction!(motion::series, module)?,
        wrap_pyfunction!(motion::observe, module)?,
        wrap_pyfunction!(motion::glossary, module)?,
        wrap_pyfunction!(motion::labels, module)?,
        wrap_pyfunction!(study::study, module)?,
        wrap_pyfunction!(study::studies, module)?,
        wrap_pyfunction!(study::report_schema, module)?,
        wrap_pyfunction!(study::table, module)?,
        wrap_pyfunction!(study::calibrate, module)?,
        wrap_pyfunction!(study::implied_case, module)?,
        wrap_pyfunction!(study::lyapunov, module)?,
        wrap_pyfunction!(study::paper, module)?,
        wrap_pyfunction!(study::paper_sections, module)?,
        wrap_pyfunction!(dataset::merge, module)?,
        wrap_pyfunction!(dataset::load, module)?,
        wrap_pyfunction!(dataset::summary, module)?,
        wrap_pyfunction!(dataset::window, module)?,
        wrap_pyfunction!(dataset::figure, module)?,
        wrap_pyfunction!(figure::mathtext, module)?,
        wrap_pyfunction!(figure::axis, module)?,
        wrap_pyfunction!(figure::colours, module)?,
        wrap_pyfunction!(figure::describe, module)?,
        wrap_pyfunction!(dataset::gsf, module)?,
        wrap_pyfunction!(dataset::csv, module)?,
        wrap_pyfunction!(dataset::write_table, module)?,
    ] {
        module.add_function(function)?;
    }
    Ok(())
}

/// Runs the command line with `arguments`, whose first item is the program's name; returns the exit
/// code.
#[pyfunction]
fn run_command_line(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> u8 {
    py.detach(|| nanotap_cli::run(arguments, nanotap_version::version!()))
}
