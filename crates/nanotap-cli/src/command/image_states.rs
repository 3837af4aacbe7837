//! `nanotap image-states`: the lever's state in each pixel of an image.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::study::Study as _;
use nanotap::study::image_states::{ImageData, ImageStatesReport, ImageStatesStudy};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Rows of the table of steps.
const SHOWN: usize = 12;

/// The state of the lever in each pixel of an image, by its amplitude and phase: attractive, repulsive,
/// free or undecided; and the steps of the height that are the lever's and not the surface's.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// The image: an instrument's file, or a dataset (.zarr) that `nanotap scan` wrote
    #[arg(value_name = "IMAGE")]
    image: PathBuf,

    #[command(flatten)]
    study: StudyArguments<ImageStatesStudy>,

    /// A further file with channels of the same image; may be repeated
    #[arg(long, value_name = "IMAGE")]
    also: Vec<PathBuf>,

    #[command(flatten)]
    threads: ThreadsArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (mut options, case) = arguments.study.read(output)?;
    let files = std::iter::once(&arguments.image).chain(&arguments.also);
    let files: Vec<&Path> = files.map(PathBuf::as_path).collect();
    if files
        .iter()
        .any(|of| of.extension().is_some_and(|ending| ending == "toml"))
    {
        return Err(Failure::input(
            "expected an image, got a case file",
            "name the image first, then the case: nanotap image-states IMAGE CASE",
        ));
    }
    options.data = ImageData::read(&files)?;
    let report = progress::study::<ImageStatesStudy>(&case, &options, &arguments.threads)?;
    arguments.study.write(&case, &report)?;
    output.remarks(&ImageStatesStudy::remarks(&case, &report));
    output.study(&case, &report, |report| text(&case, report))
}

fn text(case: &GivenCase, report: &ImageStatesReport) -> String {
    let [points, lines] = report.shape;
    let heading = format!(
        "{}: states of an image of {points} by {lines} pixels",
        case.title()
    );
    let mut text = format!(
        "{}\n\n{}\n{}",
        style::bold(&heading),
        motion::paragraph(&report.verdict),
        Table::all(&report.state_table()).render()
    );
    if !report.steps.is_empty() {
        let steps = report.step_table();
        let _ = write!(
            text,
            "\n{}",
            Table::of(&steps, 0..steps.rows.min(SHOWN)).render()
        );
        if report.step_count > SHOWN {
            let _ = writeln!(text, "  … {} changes in all", report.step_count);
        }
    }
    let channels = [
        ("height", &report.height_channel),
        ("amplitude", &report.amplitude_channel),
        ("phase", &report.phase_channel),
    ];
    let channels = channels.map(|(what, name)| {
        let name = name
            .as_ref()
            .map_or("none".to_owned(), |name| format!("`{name}`"));
        format!("{what} {name}")
    });
    let noise = format!(
        "noise of a pixel: amplitude {}, phase {}°",
        Kind::Length.format_digits(report.amplitude_noise, 3),
        number::significant(report.phase_noise, 3)
    );
    text.push('\n');
    text.push_str(&motion::paragraph(&format!(
        "channels: {}; {noise}",
        channels.join(", ")
    )));
    if let (Some(offset), Some(error), Some(sense)) =
        (report.phase_offset, report.phase_offset_error, report.sense)
    {
        let error = if error > 0.0 {
            format!(
                "{} ± {}°",
                number::significant(offset, 4),
                number::significant(error, 2)
            )
        } else {
            format!("{}° (given)", number::significant(offset, 4))
        };
        text.push_str(&motion::paragraph(&format!(
            "phase offset {error}, counted as a {}; {} of the pixels fit a state within their noise",
            sense.name(),
            format_args!("{:.1} %", 100.0 * report.explained)
        )));
    }
    text
}
