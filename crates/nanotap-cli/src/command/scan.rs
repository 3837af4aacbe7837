//! `nanotap scan`: a line or an image under feedback.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use nanotap::dataset::Share;
use nanotap::figure::scan::scan_figure;
use nanotap::study::DatasetStudy as _;
use nanotap::study::Study as _;
use nanotap::study::scan::report::LoopReport;
use nanotap::study::scan::{CHANNELS, Method, ScanLines, ScanOptions, ScanReport, ScanStudy};

use crate::arguments::{CaseArguments, PlotArgument};
use crate::dataset::DatasetArguments;
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::request::Request;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{file, motion, number, progress, style};

/// A scan of a line or an image under the z feedback of an instrument: what a microscope would show
/// of a sample that is known. The case file says how in its table [scan].
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    #[command(flatten)]
    request: Request<ScanOptions>,

    #[command(flatten)]
    threads: ThreadsArgument,

    /// Write the pixels (.csv), every channel of the trace for Gwyddion (.gsf, NAME-CHANNEL.gsf), or
    /// a dataset (.zarr). With --line-settle the dataset is written line by line; an unfinished one is
    /// continued
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,

    /// Compute only one of n shares of the lines of a dataset, as in 2/8; `nanotap merge` merges them
    #[arg(long, value_name = "I/N", default_value_t = Share::WHOLE, hide_default_value = true)]
    chunk: Share,

    #[command(flatten)]
    plot: PlotArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let request = arguments.request.read()?;
    let ending = match &arguments.out {
        Some(path) if file::ending(path, &["csv", "gsf", "zarr"])? == "zarr" => {
            return dataset(arguments, path, &request, output);
        }
        Some(path) => Some(file::claim(path, &["csv", "gsf"])?),
        None => None,
    };
    if !arguments.chunk.is_whole() {
        return Err(Failure::input(
            "--chunk computes a share of a dataset",
            "give --out NAME.zarr, too",
        ));
    }
    if let (Some(path), Some("gsf")) = (&arguments.out, ending) {
        for channel in CHANNELS {
            file::claim(&of_channel(path, channel.name), &["gsf"])?;
        }
    }
    arguments.plot.check()?;
    let case = GivenCase::for_study(&arguments.case, true, output)?;
    let report = progress::study::<ScanStudy>(&case, &request, &arguments.threads)?;
    output.remarks(&ScanStudy::remarks(&case, &report));
    if let Some(path) = &arguments.out {
        if ending == Some("gsf") {
            for channel in CHANNELS {
                let bytes = report.field(channel).to_gsf();
                let bytes = bytes.map_err(nanotap::Error::from)?;
                file::write(&of_channel(path, channel.name), &bytes)?;
            }
        } else {
            file::write(path, report.pixel_table().csv().as_bytes())?;
        }
    }
    arguments.plot.draw(|| scan_figure(&report))?;
    output.study(&case, &report, |report| text(&case, report))
}

/// The scan as a dataset.
fn dataset(
    arguments: &Arguments,
    path: &Path,
    request: &ScanOptions,
    output: &Output,
) -> Result<(), Failure> {
    let case = GivenCase::for_study(&arguments.case, true, output)?;
    let dataset = DatasetArguments {
        out: Some(path.to_owned()),
        chunk: arguments.chunk,
        threads: arguments.threads.clone(),
    };
    let done = dataset.run::<ScanLines>(
        &case,
        request,
        "",
        ScanLines::COUNTED,
        0,
        &arguments.plot,
        |store| Ok(scan_figure(&ScanLines::report(store)?)),
        output,
    )?;
    if let Some(report) = &done.summary {
        output.remarks(&ScanLines::remarks(report));
    }
    output.study(&case, &done, |done| {
        done.text(case.title(), |report| text(&case, report))
    })
}

/// Path of one channel of the trace: `image-height.gsf` for `image.gsf`.
fn of_channel(path: &Path, channel: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-{channel}.gsf"))
}

fn nm(length: f64, digits: usize) -> String {
    number::significant(1e9 * length, digits)
}

/// Rows of the table of lines.
const SHOWN: usize = 20;

fn text(case: &GivenCase, report: &ScanReport) -> String {
    let method = match report.method {
        Method::Exact | Method::Fast => "every drive period exactly",
        Method::QuasiStatic => "a quasi-static preview",
    };
    let heading = format!(
        "{}: scan of {} of {} nm at {} lines a second, {method}",
        case.title(),
        number::counted(report.trace.height.len(), "line", "lines"),
        nm(report.size[0], 6),
        number::significant(report.line_rate, 4),
    );
    let lines = report.line_table();
    let table = Table::of(&lines, 0..lines.rows.min(SHOWN));
    let mut text = format!(
        "{}\n\n{}\n{}",
        style::bold(&heading),
        motion::paragraph(&report.verdict),
        table.render()
    );
    if report.lines.len() > SHOWN {
        let _ = writeln!(text, "  … {} rows in all", report.lines.len());
    }
    if let Some(feedback) = &report.feedback {
        text.push_str(&motion::paragraph(&loop_text(feedback)));
    }
    text
}

fn loop_text(feedback: &LoopReport) -> String {
    let hertz = |frequency: Option<f64>| {
        frequency.map_or_else(
            || "none".to_owned(),
            |f| format!("{} Hz", number::significant(f, 4)),
        )
    };
    let gain = |gain: Option<f64>| {
        gain.map_or_else(
            || "none".to_owned(),
            |gain| format!("{} 1/s", number::significant(gain, 4)),
        )
    };
    format!(
        "feedback loop at the setpoint: bandwidth {} (45° lag), {} (−3 dB), peaking {}; largest \
         stable integral gain {}; a gain of {} would give {} (rule of thumb for the bandwidth: {} \
         Hz)",
        hertz(feedback.bandwidth_45),
        hertz(feedback.bandwidth_3db),
        number::significant(feedback.peaking, 3),
        gain(feedback.largest_stable_gain),
        gain(feedback.suggested_gain),
        hertz(feedback.suggested_bandwidth),
        number::significant(feedback.rule_of_thumb, 3),
    )
}
