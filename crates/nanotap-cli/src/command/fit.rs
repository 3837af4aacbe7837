//! `nanotap fit`: parameters of lever and sample from measured curves.

use std::path::{Path, PathBuf};

use clap::Args;
use nanotap::dataset::Share;
use nanotap::figure::fit::{FitMaps, fit_figure};
use nanotap::files;
use nanotap::study::DatasetStudy as _;
use nanotap::study::Study as _;
use nanotap::study::fit::{
    FitMap, FitMapReport, FitOptions, FitReport, FitStudy, FittedForceCurve, RivalParameter,
    force_curve_table,
};
use serde::Serialize;

use crate::arguments::{CaseArguments, PlotArgument, measured};
use crate::dataset::DatasetArguments;
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::request::Request;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{file, motion, number, progress, style};

/// Fit parameters of lever and sample to measured curves.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// The measured curve (CSV or an instrument's file), its columns named as in `distance (nm)`,
    /// `amplitude (nm)`, `phase (deg)`
    #[arg(value_name = "DATA")]
    data: PathBuf,

    #[command(flatten)]
    case: CaseArguments,

    /// Another measured curve, fitted together with the first; may be repeated
    #[arg(long, value_name = "DATA")]
    also: Vec<PathBuf>,

    /// Number of the curve of an instrument's file with several, from 0 [default: the first]
    #[arg(long, value_name = "K")]
    curve: Option<usize>,

    #[command(flatten)]
    request: Request<FitOptions>,

    #[command(flatten)]
    threads: ThreadsArgument,

    /// Write the case of the best fit (.toml), with --per-curve one per curve
    /// (NAME-CURVE.toml), or the rows with model and residuals (.csv); of a map, an instrument's or
    /// one with --pixels, the dataset of the fits of all its curves (.zarr), of which an unfinished
    /// one is continued
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,

    /// Of a map, fit only one of n shares of the pixels, as in 2/8; `nanotap merge` merges them
    #[arg(long, value_name = "I/N", default_value_t = Share::WHOLE, hide_default_value = true)]
    chunk: Share,

    #[command(flatten)]
    plot: PlotArgument,
}

/// The report, and where it went.
#[derive(Serialize)]
struct Written<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    path: Option<&'a PathBuf>,
    #[serde(flatten)]
    report: &'a FitReport,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let mut request = arguments.request.read()?;
    let is_zarr = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "zarr");
    let leaves_dataset = arguments.out.as_ref().is_some_and(is_zarr);
    if !request.pixels.is_empty() || leaves_dataset && arguments.curve.is_none() {
        return map(arguments, &mut request, output);
    }
    if !arguments.chunk.is_whole() {
        return Err(Failure::input(
            "--chunk fits a share of the pixels of a map",
            "give --out NAME.zarr, too, and of a table --pixels",
        ));
    }
    let ending = match &arguments.out {
        Some(path) => Some(file::claim(path, &["toml", "csv"])?),
        None => None,
    };
    arguments.plot.check()?;
    request.data = measured(&arguments.data, &arguments.also, arguments.curve, "fit")?;
    let (case, assumed) = GivenCase::of_data(&arguments.case, &request)?;
    case.note_replaced(output);
    let mut report = progress::study::<FitStudy>(&case, &request, &arguments.threads)?;
    report.preparation.splice(0..0, assumed);
    // Values that a fit starts from are not those of the sample.
    case.warn_of_result(&report.case_file, &arguments.case, output)?;
    if let (Some(path), Some(ending)) = (&arguments.out, ending) {
        match ending {
            "toml" if !report.case_files.is_empty() => {
                for (index, of) in report.case_files.iter().enumerate() {
                    file::write_case(&of_curve(path, &of.curve, index), &of.case_file)?;
                }
            }
            "toml" => file::write_case(path, &report.case_file)?,
            _ => file::write(path, report.row_table().csv().as_bytes())?,
        }
    }
    if let Some(path) = &arguments.plot.plot {
        file::draw(path, &fit_figure(&report))?;
    }
    output.stopped(report.cancelled);
    output.remarks(&FitStudy::remarks(&case, &report));
    let written = Written {
        path: arguments.out.as_ref(),
        report: &report,
    };
    output.study(&case, &written, |_| text(&case, &report))?;
    match &report.reason {
        None => Ok(()),
        Some(reason) => Err(Failure::numerics(format!("nothing fits: {reason}"))),
    }
}

/// The fits of a force volume, a pixel each, as a dataset.
fn map(arguments: &Arguments, request: &mut FitOptions, output: &Output) -> Result<(), Failure> {
    let Some(path) = &arguments.out else {
        return Err(Failure::input(
            "the fits of a force volume are a dataset",
            "give --out NAME.zarr",
        ));
    };
    file::ending(path, &["zarr", "csv"])?;
    if request.pixels.is_empty() {
        let document = files::open(&arguments.data)?;
        let name = arguments.data.display().to_string();
        *request = std::mem::take(request).of_map(&name, document)?;
    } else {
        request.data = measured(&arguments.data, &arguments.also, arguments.curve, "fit")?;
    }
    let (case, assumed) = GivenCase::of_data(&arguments.case, request)?;
    case.note_replaced(output);
    for note in assumed {
        output.note(&note);
    }
    let dataset = DatasetArguments {
        out: Some(path.clone()),
        chunk: arguments.chunk,
        threads: arguments.threads.clone(),
    };
    let done = dataset.run::<FitMap>(
        &case,
        request,
        "",
        FitMap::COUNTED,
        request.seed,
        &arguments.plot,
        |store| Ok(FitMaps::of(store)?.figure()),
        output,
    )?;
    output.study(&case, &done, |done| done.text(case.title(), map_text))
}

/// A map of fits in short.
fn map_text(report: &FitMapReport) -> String {
    format!(
        "{}\n{}",
        motion::paragraph(&format!(
            "{} fitted: {} described, {} not described, {} without a result; the table is of {}",
            number::counted(report.pixels, "pixel", "pixels"),
            report.fits,
            report.misfits,
            report.failed,
            if report.over_misfits {
                "all with a result: where most curves are not described to their noise, the law is an \
                 approximation everywhere"
            } else {
                "those described"
            }
        )),
        Table::all(&report.parameter_table()).render()
    )
}

/// Where the case of one curve is written: `best-CURVE.toml` next to `best.toml`.
fn of_curve(path: &Path, curve: &str, index: usize) -> PathBuf {
    let name = Path::new(curve)
        .file_stem()
        .map(|stem| stem.to_string_lossy());
    let kept = |c: char| {
        if c.is_alphanumeric() || "-_.".contains(c) {
            c
        } else {
            '-'
        }
    };
    let name: String = name.unwrap_or_default().chars().map(kept).collect();
    let name = if name.is_empty() {
        (index + 1).to_string()
    } else {
        name
    };
    let stem = path.file_stem().map(|stem| stem.to_string_lossy());
    path.with_file_name(format!("{}-{name}.toml", stem.unwrap_or_default()))
}

/// The laws that were compared, and what is to be kept in mind.
fn laws(report: &FitReport) -> String {
    let mut text = Table::all(&report.law_table()).render();
    text.push('\n');
    for law in report.laws.iter().filter(|law| !law.fits) {
        let reason = law.reason.as_deref().unwrap_or_default();
        text.push_str(&motion::paragraph(&format!("{}: {reason}", law.law)));
    }
    let best = report.law.as_deref().unwrap_or_default();
    text.push_str(&motion::paragraph(&format!(
        "What follows is of {best}. The criteria say which of these laws describes these data best \
         for its parameters, not that it is right: a law that is missing here, a tip of another \
         shape or noise that is not normal can favour a wrong one."
    )));
    text.push('\n');
    text
}

/// What a fit of a force curve says of sample and contact.
fn force_curve(of: &FittedForceCurve) -> String {
    let mut text = Table::all(&force_curve_table(std::slice::from_ref(of))).render();
    text.push('\n');
    for caution in &of.cautions {
        text.push_str(&motion::paragraph(&format!("be careful: {caution}")));
    }
    text.push_str(&motion::paragraph(
        "The errors are those of this curve alone. The modulus is proportional to the stiffness of the \
         lever, which is rarely known better than 10 %, and depends on its sensitivity and on the tip.",
    ));
    text.push('\n');
    text
}

fn text(case: &GivenCase, report: &FitReport) -> String {
    let curves: std::collections::BTreeSet<&str> =
        report.rows.iter().map(|row| row.curve.as_str()).collect();
    let heading = format!(
        "{}: {} of {} fitted to {}",
        case.title(),
        number::counted(report.parameters.len(), "parameter", "parameters"),
        number::counted(report.rows.len(), "row", "rows"),
        number::counted(curves.len(), "curve", "curves"),
    );
    let mut text = format!("{}\n\n", style::bold(&heading));
    if report.laws.len() > 1 {
        text.push_str(&laws(report));
    }
    for of in &report.force_curves {
        text.push_str(&force_curve(of));
    }
    text.push_str(&Table::all(&report.parameter_table()).render());
    text.push('\n');
    if report.parameters.iter().any(|p| p.standard_error.is_none()) {
        text.push_str(&motion::paragraph(
            "A value in brackets is no result: the data do not determine it, and others describe \
             them as well.",
        ));
    }
    let has_error = report
        .parameters
        .iter()
        .any(|p| p.stiffness_error.is_some());
    if let Some(error) = case.stiffness_error().filter(|_| has_error) {
        text.push_str(&motion::paragraph(&format!(
            "Standard errors and intervals contain the error of k, {} %.",
            number::significant(100.0 * error, 2)
        )));
    }
    let chance = report.p_value.map_or_else(String::new, |p| {
        format!(
            ", exceeded by chance with probability {}",
            number::significant(p, 2)
        )
    });
    text.push_str(&motion::paragraph(&format!(
        "chi2 = {} with {} degrees of freedom{chance}",
        number::significant(report.chi2, 5),
        report.degrees_of_freedom
    )));
    for column in &report.columns {
        let error = if column.estimated {
            "standard error, estimated from them"
        } else {
            "root mean square"
        };
        let unit = if column.unit == "1" { "" } else { &column.unit };
        text.push_str(&motion::paragraph(&format!(
            "residuals of {}: {error} {} {unit}",
            column.name,
            number::significant(column.residual, 3)
        )));
    }
    let strong: Vec<String> = (0..report.parameters.len())
        .flat_map(|i| (0..i).map(move |j| (j, i)))
        .filter(|&(j, i)| report.correlations[j][i].abs() > 0.9)
        .map(|(j, i)| {
            let [a, b] = [j, i].map(|k| &report.parameters[k].key);
            format!("{a} and {b} ({:+.3})", report.correlations[j][i])
        })
        .collect();
    if !strong.is_empty() {
        let words = format!("strongly correlated: {}", strong.join(", "));
        text.push_str(&motion::paragraph(&words));
    }
    for undetermined in &report.undetermined {
        text.push_str(&motion::paragraph(&undetermined.words));
    }
    text.push_str(&rivals(report));
    for suggestion in &report.suggestions {
        text.push_str(&motion::paragraph(&format!(
            "{}. Try --free {}",
            suggestion.words,
            suggestion.free.join(",")
        )));
    }
    if !report.suggestions.is_empty() {
        text.push_str(&motion::paragraph(
            "A wrong law leaves such residuals, too: compare with others (--laws).",
        ));
    }
    text
}

/// Other minima that describe the data about as well.
fn rivals(report: &FitReport) -> String {
    let mut text = String::new();
    for rival in &report.rivals {
        let values: Vec<String> = rival.parameters.iter().map(RivalParameter::words).collect();
        text.push_str(&motion::paragraph(&format!(
            "Another minimum describes the data about as well (Akaike's criterion {:+.1}): {}. {}.",
            rival.above_best,
            values.join(", "),
            rival.words
        )));
    }
    text
}
