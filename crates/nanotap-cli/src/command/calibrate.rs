//! `nanotap calibrate`: a lever from its thermal noise.

use std::path::PathBuf;

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::study::calibrate::{CalibrateOptions, CalibrateReport, Calibration, calibrate_file};

use crate::arguments::{OutArgument, PlotArgument};
use crate::failure::Failure;
use crate::output::Output;
use crate::request::Request;
use crate::text_table::Table;
use crate::{motion, number, style};

/// Calibrate a lever from its thermal noise: k, Q, f0, sensitivity.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// A spectrum or a record of the deflection: an instrument's file (JPK .tnd, Nanosurf thermal .nid, a
    /// curve with a pause), or a table as text with columns such as `frequency (kHz)` and `PSD (pm^2/Hz)`, or
    /// `time (s)` and `deflection (V)`
    #[arg(value_name = "FILE")]
    file: PathBuf,

    #[command(flatten)]
    request: Request<CalibrateOptions>,

    #[command(flatten)]
    out: OutArgument,
    #[command(flatten)]
    plot: PlotArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let options = arguments.request.read()?;
    arguments.out.check()?;
    arguments.plot.check()?;
    let report = calibrate_file(&arguments.file, &options)?;
    arguments.out.write(|| report.spectrum_table().csv())?;
    arguments.plot.draw(|| report.figure())?;
    output.remarks(&report.remarks());
    output.result(&report, text)
}

fn text(report: &CalibrateReport) -> String {
    let calibration = &report.calibration;
    let heading = format!(
        "{}: thermal calibration of `{}`",
        report.source, report.name
    );
    let estimates = Table::all(&report.estimate_table()).render();
    let mut text = format!("{}\n\n{estimates}\n", style::bold(&heading));
    let mut say = |words: String| text.push_str(&motion::paragraph(&words));
    say(factors(calibration));
    say(format!(
        "fit of {} from {} to {}; scatter of {} averages{}",
        number::counted(calibration.bins, "bin", "bins"),
        Kind::Frequency.format(calibration.range[0]),
        Kind::Frequency.format(calibration.range[1]),
        number::significant(calibration.scatter.averages, 3),
        if calibration.scatter.inflation > 1.0 {
            format!(
                ", variances enlarged by {} for correlated bins",
                number::significant(calibration.scatter.inflation, 3)
            )
        } else {
            String::new()
        }
    ));
    text.push('\n');
    text + &report.cantilever
}

/// How k follows from the mean square.
fn factors(calibration: &Calibration) -> String {
    let factor = &calibration.factor;
    let significant = |value: f64| number::significant(value, 4);
    let celsius = number::significant(calibration.temperature - 273.15, 3);
    let parts = if factor.chi == 1.0 {
        String::new()
    } else {
        format!(
            " (β = {}, χ = {})",
            significant(factor.beta),
            significant(factor.chi)
        )
    };
    let mut text = format!(
        "k = {} kB T/m{parts}, static, at the end of the lever and normal to it; m the mean square by the static \
         sensitivity; T = {celsius} °C",
        significant(factor.product)
    );
    if let Some(sader) = calibration.sader {
        if calibration.sensitivity.is_some() && calibration.stiffness == Some(sader.stiffness) {
            text = format!(
                "k by Sader's method, because no sensitivity is known; the sensitivity follows from {} kB T = k m{parts}, \
                 T = {celsius} °C",
                significant(factor.product)
            );
        }
        if let Some(reynolds) = sader.reynolds {
            text.push_str("; Reynolds number ");
            text.push_str(&number::significant(reynolds, 3));
        }
    }
    text
}
