//! `nanotap reconstruct`: force and dissipation from measured curves, without a contact law.

use std::path::PathBuf;

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::case::quantity::format_electronvolts;
use nanotap::study::reconstruct::{ReconstructMethod, ReconstructReport, ReconstructStudy};

use crate::arguments::measured;
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Rows of the printed force curve.
const SHOWN: usize = 15;

/// Force and dissipation against distance from a measured curve.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// The measured curve (CSV or an instrument's file), its columns named as in `distance (nm)`,
    /// `amplitude (nm)`, `phase (deg)`, or `frequency_shift (Hz)`
    #[arg(value_name = "DATA")]
    data: PathBuf,

    #[command(flatten)]
    study: StudyArguments<ReconstructStudy>,

    /// A further measured curve of the same sample; may be repeated
    #[arg(long, value_name = "DATA")]
    also: Vec<PathBuf>,

    #[command(flatten)]
    threads: ThreadsArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (mut options, case) = arguments.study.read(output)?;
    options.data = measured(&arguments.data, &arguments.also, None, "reconstruct")?;
    let report = progress::study::<ReconstructStudy>(&case, &options, &arguments.threads)?;
    arguments.study.write(&case, &report)?;
    for remark in &report.remarks {
        output.warning(remark);
    }
    output.study(&case, &report, |report| text(&case, report))
}

fn text(case: &GivenCase, report: &ReconstructReport) -> String {
    let shown = |kind: Kind, value: f64, digits: usize| {
        if report.physical {
            kind.format_digits(value, digits)
        } else {
            number::significant(value, digits)
        }
    };
    let energy = |value: Option<f64>| match value {
        None => String::new(),
        Some(value) if report.physical => format_electronvolts(value),
        Some(value) => number::significant(value, 4),
    };
    let method = match report.method {
        ReconstructMethod::AmplitudeModulation => "amplitude and phase",
        ReconstructMethod::FrequencyModulation => "frequency shift",
    };
    let heading = format!(
        "{}: force from {method} of {}",
        case.title(),
        number::counted(report.rows.len(), "row", "rows")
    );
    let end = report.shown_rows();
    let rows = (0..end).step_by(end.div_ceil(SHOWN).max(1));
    let table = Table::of(&report.force_table(), rows);
    let mut text = format!("{}\n\n{}\n", style::bold(&heading), table.render());
    let mut say = |words: String| text.push_str(&motion::paragraph(&words));
    if let Some(minimum) = &report.minimum {
        say(format!(
            "minimum of the force: {} ± {} at {}",
            shown(Kind::Force, minimum.force, 4),
            shown(Kind::Force, minimum.force_error, 2),
            shown(Kind::Length, minimum.distance, 4)
        ));
    }
    say(format!(
        "closest approach: {}; largest dissipation: {}",
        shown(Kind::Length, report.closest, 4),
        if report.has_damping {
            let largest = report.rows.iter().filter_map(|row| row.dissipation);
            energy(Some(largest.fold(0.0, f64::max)))
        } else {
            let measured = report.table.dissipation.iter().any(Option::is_some);
            if measured {
                "not determined"
            } else {
                "not measured"
            }
            .to_owned()
        }
    ));
    let source = match (report.method, report.free_rows) {
        (ReconstructMethod::FrequencyModulation, _) => "held".to_owned(),
        (_, 0) => "given".to_owned(),
        (_, rows) => format!("from {}", number::counted(rows, "row", "rows")),
    };
    say(format!(
        "free amplitude {}, phase {}° ({source})",
        shown(Kind::Length, report.free_amplitude, 5),
        number::significant(report.free_phase, 5)
    ));
    say(format!(
        "mean squared residual {} in standard errors; effective parameters {}",
        number::significant(report.chi2, 3),
        number::significant(report.freedom, 3)
    ));
    text
}
