//! Fits of curves that nanotap's own exact models give, with terms of the instrument and noise.

mod laws;
mod rivals;
mod terms;

use nanotap_case::Case;
use nanotap_case::file::Source;
use nanotap_case::table::{Entry, Table};
use nanotap_dynamics::Control;
use nanotap_fit::fit::{FitOptions, FitReport, FittedParameter, Segment, fit};
use nanotap_motions::approach::{ApproachOptions, Way, approach};

fn case(text: &str, overrides: &[&str]) -> Case {
    let source = Source {
        name: "lever.toml".into(),
        text: text.into(),
    };
    let words: Vec<String> = overrides.iter().map(|word| (*word).to_owned()).collect();
    Case::parse(Some(source), &words).unwrap()
}

/// Distance (nm), amplitude (nm), phase (deg) and direction of an approach curve, without noise.
fn tapping(case: &Case, from: f64, to: f64, points: usize) -> Vec<(f64, f64, f64, Way)> {
    let options = ApproachOptions {
        from: Some((from * 1e-9).into()),
        to: Some((to * 1e-9).into()),
        points,
        branches: false,
        ..ApproachOptions::default()
    };
    let report = approach(case, &options, &Control::default()).unwrap();
    let rows = report.table.iter().map(|p| {
        let seen = &p.physical.as_ref().unwrap().observables;
        (
            p.zc.unwrap() * 1e9,
            seen.first_harmonic * 1e9,
            seen.phase,
            p.way,
        )
    });
    rows.collect()
}

fn table(columns: Vec<(&str, Vec<f64>)>, ways: &[Way]) -> Table {
    let mut all: Vec<(String, Vec<Entry>)> = columns
        .into_iter()
        .map(|(name, values)| {
            (
                name.to_owned(),
                values.into_iter().map(Entry::Number).collect(),
            )
        })
        .collect();
    let ways = ways.iter().map(|way| Entry::Text(way.name().to_owned()));
    all.push(("direction".to_owned(), ways.collect()));
    Table {
        name: "curve".to_owned(),
        columns: all,
        ..Table::default()
    }
}

fn options(table: Table, free: &[&str]) -> FitOptions {
    FitOptions {
        data: vec![table],
        free: free.iter().map(|name| (*name).to_owned()).collect(),
        profile: false,
        rivals: false,
        // Under an elastic law, too, both ways are compared.
        segment: Some(Segment::Both),
        ..FitOptions::default()
    }
}

fn fitted(case: &Case, options: &FitOptions) -> FitReport {
    fit(case, options, &Control::default()).unwrap()
}

fn parameter<'a>(report: &'a FitReport, key: &str) -> &'a FittedParameter {
    let mut all = report.parameters.iter();
    all.find(|p| p.key == key).unwrap()
}

/// How far a parameter is from the truth, in its standard errors.
fn off(report: &FitReport, key: &str, truth: f64) -> f64 {
    let found = parameter(report, key);
    (found.value - truth).abs() / found.standard_error.unwrap()
}
