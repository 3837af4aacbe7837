//! `nanotap contact-laws`: the same lever and drive on every contact law.

use std::fmt::Write as _;

use clap::Args;
use nanotap::control::Control;
use nanotap::figure::contact_laws::sample_figure;
use nanotap::study::contact_laws::{
    Comparison, ContactLawsRequest, ContactLawsStudy, SampleMotion,
};
use nanotap::study::registry::Study as _;

use crate::arguments::{CaseArguments, OutArgument, PlotArgument};
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::request::Request;
use crate::table::{Align, Table};
use crate::{file, motion, number, style};

/// The same lever and drive on every contact law: what difference the sample makes.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    #[command(flatten)]
    request: Request<ContactLawsRequest>,

    #[command(flatten)]
    out: OutArgument,
    #[command(flatten)]
    plot: PlotArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let request = arguments.request.read()?;
    if let Some(path) = &arguments.out.out {
        file::ending(path, &["csv"])?;
    }
    let studied = GivenCase::of(&arguments.case, output)?;
    let result = ContactLawsStudy::run(&studied, &request, &Control::default())?;
    if let Some(path) = &arguments.out.out {
        file::write(path, csv(&result).as_bytes())?;
    }
    if let Some(path) = &arguments.plot.plot {
        sample_figure(&result, &studied.units()).write(path)?;
    }
    output.study(&studied, &result, |result| text(&studied, result))
}

/// The loops, a row a point.
fn csv(result: &Comparison) -> String {
    let mut csv = String::from("contact,indentation,force\n");
    for sample in &result.samples {
        for point in sample.orbit.iter().flat_map(|o| &o.force_loop) {
            let _ = writeln!(csv, "{},{}", sample.contact, number::row(*point));
        }
    }
    csv
}

fn text(studied: &GivenCase, result: &Comparison) -> String {
    let heading = format!(
        "{}: the period-{} orbit on each sample at Ω = {}",
        studied.title(),
        result.period,
        number::significant(result.omega, 6)
    );
    let mut table = Table::new([
        ("sample", Align::Left),
        ("from rest", Align::Left),
        ("largest |μ|", Align::Point),
        ("amplitude", Align::Point),
        ("E_dis", Align::Point),
        ("F max", Align::Point),
        ("F min", Align::Point),
        ("indentation", Align::Point),
        ("contact (%)", Align::Point),
    ]);
    for sample in &result.samples {
        let mut cells = vec![sample.contact.clone(), from_rest(sample)];
        if let Some(orbit) = &sample.orbit {
            let o = &orbit.observables;
            // What is not above rounding is no force.
            let least = if o.least_force.abs() < 1e-10 * o.peak_force {
                0.0
            } else {
                o.least_force
            };
            let values = [
                orbit.spectral_radius,
                o.first_harmonic,
                o.dissipation,
                o.peak_force,
                least,
                o.indentation,
                100.0 * o.contact_fraction,
            ];
            cells.extend(values.map(|v| number::significant(v, 5)));
        }
        cells.resize(9, String::new());
        table.row(cells);
    }
    let mut text = format!("{}\n\n{}\n", style::bold(&heading), table.render());
    let linear = result.samples.iter().all(|s| s.case.law.is_none());
    if let Some(solid) = result.samples.last().filter(|_| linear) {
        text.push_str(&motion::paragraph(&format!(
            "all have the spring α₄ = {} and the damper of the case; the solid has it in series with an arm of \
             stiffness {}, so that its force relaxes in {}. E_dis is the energy that the sample takes in one \
             drive period, F the force on the tip: negative where the sample pulls",
            number::significant(solid.case.alpha4, 5),
            number::significant(solid.case.relaxation_stiffness, 5),
            number::significant(solid.case.relaxation_time, 5),
        )));
    }
    for sample in &result.samples {
        if let Some(reason) = &sample.reason {
            text.push_str(&motion::paragraph(&format!("{}: {reason}", sample.contact)));
        }
    }
    text
}

fn from_rest(sample: &SampleMotion) -> String {
    match sample.from_rest_period {
        Some(n) => format!("period {n}"),
        None => sample.from_rest.name().to_owned(),
    }
}
