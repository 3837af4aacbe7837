//! The project's tasks, each by name; `cargo xtask test` runs all checks.
//!
//! Every task runs the tool that a person would run by hand, shows its output as it comes, and
//! counts what passed. A failed step does not stop the next one, so that one run reports everything
//! that is wrong.

#![expect(
    clippy::disallowed_methods,
    reason = "it reads files of this repository"
)]

mod benches;
mod book;
mod constants;
mod dist;
mod figures;
mod package;
mod page;
mod peers;
mod process;
mod steps;
mod tally;
mod tools;
mod wheel;

use std::process::ExitCode;
use std::time::{Duration, Instant};

use steps::{OTHER_TASKS, STEPS, Step};
use tally::Tally;
use tools::Workspace;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match select(&arguments) {
        Ok((steps, options)) => run(&steps, options),
        Err(message) => {
            eprintln!("error: {message}\n\n{}", usage());
            ExitCode::from(2)
        }
    }
}

/// The tasks requested on the command line, none for help, and the options of the last one.
fn select(arguments: &[String]) -> Result<(Vec<&'static Step>, &[String]), String> {
    if arguments.is_empty() {
        return Err("name at least one task".into());
    }
    let mut selected = Vec::new();
    for (index, argument) in arguments.iter().enumerate() {
        match argument.as_str() {
            "help" | "-h" | "--help" => return Ok((Vec::new(), &[])),
            "test" => selected.extend(STEPS),
            name => {
                let mut all = STEPS.iter().chain(OTHER_TASKS);
                let step = all
                    .find(|step| step.name == name)
                    .ok_or_else(|| format!("no task is called `{name}`"))?;
                selected.push(step);
                if step.takes_options {
                    return Ok((selected, &arguments[index + 1..]));
                }
            }
        }
    }
    Ok((selected, &[]))
}

fn usage() -> String {
    let lines = |steps: &[Step]| -> String {
        let line = |step: &Step| format!("  {:<11}  {}\n", step.name, step.about);
        steps.iter().map(line).collect()
    };
    format!(
        "usage: cargo xtask <task>...\n\n  test         all of these checks:\n{}\n  other tasks:\n{}",
        lines(STEPS),
        lines(OTHER_TASKS)
    )
}

/// One step's outcome, for the summary.
struct Line {
    name: &'static str,
    tally: Tally,
    /// The reason, if the step could not be run.
    trouble: Option<String>,
    time: Duration,
}

fn run(steps: &[&'static Step], options: &[String]) -> ExitCode {
    if steps.is_empty() {
        print!("{}", usage());
        return ExitCode::SUCCESS;
    }
    let workspace = Workspace::find();
    let lines: Vec<Line> = steps
        .iter()
        .map(|step| {
            println!("\n── {} · {}", step.name, step.about);
            let start = Instant::now();
            let (tally, trouble) = match (step.run)(&workspace, options) {
                Ok(tally) => (tally, None),
                Err(reason) => {
                    eprintln!("error: {reason}");
                    (Tally::check(false), Some(reason))
                }
            };
            Line {
                name: step.name,
                tally,
                trouble,
                time: start.elapsed(),
            }
        })
        .collect();
    summarise(&lines)
}

fn summarise(lines: &[Line]) -> ExitCode {
    println!("\n── summary (a check counts one, a test run its tests)");
    let mut total = Tally::default();
    for line in lines {
        total += line.tally;
        let mark = match line.tally {
            Tally { failed: 1.., .. } => "✗",
            Tally { passed: 0, .. } => "–",
            _ => "✓",
        };
        let Tally {
            passed,
            failed,
            skipped,
        } = line.tally;
        let skipped = if skipped > 0 {
            format!(", {skipped} skipped")
        } else {
            String::new()
        };
        println!(
            "{mark} {:<11} {passed:>5} passed {failed:>3} failed{skipped}  {:>6.1} s  {}",
            line.name,
            line.time.as_secs_f64(),
            line.trouble.as_deref().unwrap_or_default(),
        );
    }
    println!();
    // The last line, which continuous integration reads.
    println!("{} passed, {} failed", total.passed, total.failed);
    if total.failed == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
