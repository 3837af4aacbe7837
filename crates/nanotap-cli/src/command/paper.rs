//! `nanotap paper`: every figure and number of the paper computed again, with verdicts.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use nanotap_paper::{Document, Options, Report, Written, report, section_names};
use serde::Serialize;

use crate::failure::Failure;
use crate::file;
use crate::output::Output;
use crate::threads::ThreadsArgument;
use crate::{progress, style};

/// Reproduce every figure and number of the paper, with verdicts and evidence
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// Folder for the report and its figures; created if missing
    #[arg(long, value_name = "DIR", default_value = "nanotap-paper")]
    out: PathBuf,

    /// Compute only these sections, such as fig4 eq25 time-step
    #[arg(long, value_name = "ID", num_args = 1.., value_delimiter = ',')]
    only: Vec<String>,

    /// Use fewer starts and parameter values: seconds instead of minutes, wider bounds
    #[arg(long)]
    quick: bool,

    #[command(flatten)]
    threads: ThreadsArgument,
}

/// Names of the report's files, and the extensions of all files that it may write.
const REPORT: [&str; 2] = ["report", "checks"];
const ENDINGS: [&str; 5] = ["html", "md", "json", "svg", "png"];

/// The JSON document of the report, with the computing time in s.
#[derive(Serialize)]
struct Timed<'a> {
    #[serde(flatten)]
    document: Document<'a>,
    seconds: f64,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let begun = Instant::now();
    // Before the work, not after it.
    std::fs::create_dir_all(&arguments.out).map_err(|error| {
        Failure::files(format!("cannot make {}: {error}", arguments.out.display()))
    })?;
    let pictures = section_names().collect::<Vec<_>>();
    file::claim_in(&arguments.out, &ENDINGS, |stem| {
        REPORT.contains(&stem) || pictures.iter().any(|section| stem.starts_with(section))
    })?;
    let options = Options {
        only: arguments.only.clone(),
        quick: arguments.quick,
    };
    let report = progress::watched("paper", "percent", false, |control| {
        arguments.threads.install(|| report(&options, control))
    })??;
    let written = report.write(&arguments.out)?;
    let document = Timed {
        document: report.document(&arguments.out, &written),
        seconds: begun.elapsed().as_secs_f64(),
    };
    output.result(&document, |document| text(document, &report, &written))
}

fn text(document: &Timed<'_>, report: &Report, written: &Written) -> String {
    let mut text = style::bold("the paper computed again");
    text.push('\n');
    for section in &report.sections {
        let _ = writeln!(text, "\n  {}", style::bold(section.title));
        for check in &section.checks {
            let verdict = format!("{:<10}", check.verdict.name());
            let _ = writeln!(text, "  {}  {}", style::bold(&verdict), check.paper);
            let _ = writeln!(text, "              {}", style::faint(&check.here));
        }
    }
    let _ = write!(
        text,
        "\n  {}; {} pictures; {:.0} s\n  {}\n",
        report.counts(),
        written.pictures.len() / 2,
        document.seconds,
        written.html.display()
    );
    text
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;
    use nanotap::control::Control;
    use nanotap_paper::{Options, report};

    /// Every command that the report tells to run again can be typed.
    #[test]
    fn commands_to_run_again_are_understood() {
        let only = [
            "eq14", "eq25", "fig2f", "fig4", "fig5", "fig7", "fig9", "impact",
        ];
        let options = Options {
            only: only.map(str::to_owned).to_vec(),
            quick: true,
        };
        let report = report(&options, &Control::default()).unwrap();
        for check in report.checks() {
            let words = check.rerun.split_whitespace();
            let parsed = crate::command::Arguments::try_parse_from(words);
            assert!(
                parsed.is_ok(),
                "{}: {}\n{:?}",
                check.id,
                check.rerun,
                parsed.err()
            );
        }
    }
}
