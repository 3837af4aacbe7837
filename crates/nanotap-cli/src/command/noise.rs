//! `nanotap noise`: thermal noise at a working point.

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::figure::noise::noise_figure;
use nanotap::study::Study as _;
use nanotap::study::noise::{NoiseOptions, NoiseReport, NoiseStudy};

use crate::arguments::{CaseArguments, OutArgument, PlotArgument};
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::request::Request;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Thermal noise of amplitude and phase at a working point, in a lock-in amplifier with a
/// first-order filter.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    #[command(flatten)]
    request: Request<NoiseOptions>,

    /// Writes the free lever's thermal spectrum
    #[command(flatten)]
    out: OutArgument,
    #[command(flatten)]
    plot: PlotArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let request = arguments.request.read()?;
    arguments.out.check()?;
    arguments.plot.check()?;
    let case = GivenCase::of(&arguments.case, output)?;
    let report = progress::study::<NoiseStudy>(&case, &request, &ThreadsArgument::default())?;
    arguments.out.write(|| report.spectrum.table().csv())?;
    arguments.plot.draw(|| noise_figure(&report))?;
    output.remarks(&NoiseStudy::remarks(&case, &report));
    output.study(&case, &report, |report| text(&case, report))
}

/// Standard deviations to the boundary of a basin below which noise crosses it within seconds: at 5,
/// about once in 300,000 correlation times.
const OFTEN: f64 = 5.0;

fn text(case: &GivenCase, report: &NoiseReport) -> String {
    let length = |value| Kind::Length.format_digits(value, 4);
    let degrees = |value| format!("{}°", number::significant(value, 4));
    let heading = format!(
        "{}: {}, thermal noise at {} K",
        case.title(),
        case.summary(),
        number::chosen(report.temperature)
    );
    let filter = format!(
        "In a lock-in amplifier with a first-order filter of {} (noise bandwidth {}). Without a drive the tip \
         moves by {} rms. The noise of the free lever's phase is that of a force gradient of {}. Frequency \
         modulation holds amplitude and phase, and reads the frequency. Noise of detector and sample is not included.",
        Kind::Time.format_digits(report.time_constant, 4),
        Kind::Frequency.format_digits(report.bandwidth, 4),
        length(report.thermal_rms),
        Kind::Stiffness.format_digits(report.force_gradient_min, 4),
    );
    let saddle = report.saddle.map_or_else(String::new, |saddle| {
        let rare = if saddle.deviations < OFTEN {
            ": thermal noise takes the lever across it often"
        } else {
            ""
        };
        format!(
            "The boundary of the basin, near the unstable orbit with A = {} and a phase of {}, is about {} standard \
             deviations away{rare}.",
            length(saddle.amplitude),
            degrees(saddle.phase),
            number::significant(saddle.deviations, 2)
        )
    });
    let stiffness = |value| Kind::Stiffness.format_digits(value, 4);
    let calibrations = report.calibrations.map_or_else(String::new, |found| {
        let sader = found.sader.map_or_else(String::new, |value| {
            format!("; Sader's method gives {} in air", stiffness(value))
        });
        format!(
            "From this motion, read by an optical lever that was calibrated on a hard surface, the thermal method \
             gives a spring constant of {} ({} without its factor 0.817){sader}. That of the case is {}.",
            stiffness(found.thermal),
            stiffness(found.thermal_without_factor),
            stiffness(found.k)
        )
    });
    format!(
        "{}\n\n{}\n{}",
        style::bold(&heading),
        Table::all(&report.summary_table()).render(),
        [filter, saddle, calibrations]
            .iter()
            .filter(|words| !words.is_empty())
            .map(|words| motion::paragraph(words))
            .collect::<String>()
    )
}
