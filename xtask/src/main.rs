//! The project's tasks, each by name; `cargo xtask test` runs all checks.
//!
//! Every task runs the tool that a person would run by hand, shows its output as it comes, and
//! counts what passed. A failed step does not stop the next one, so that one run reports everything
//! that is wrong.

mod benches;
mod book;
mod package;
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
        Ok(Selection::Help) => {
            print!("{}", usage());
            ExitCode::SUCCESS
        }
        Ok(Selection::Run(steps)) => run(&steps),
        Ok(Selection::Bench) => finished(benches::run(&Workspace::find())),
        Ok(Selection::Book(options)) => finished(book::run(&Workspace::find(), &options)),
        Ok(Selection::Peers(options)) => finished(peers::run(&Workspace::find(), &options)),
        Err(message) => {
            eprintln!("error: {message}\n");
            eprint!("{}", usage());
            ExitCode::from(2)
        }
    }
}

/// Exit code of a task that is not a check.
fn finished(outcome: Result<(), String>) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("error: {reason}");
            ExitCode::FAILURE
        }
    }
}

/// The tasks requested on the command line.
enum Selection {
    Help,
    Run(Vec<&'static Step>),
    /// The benches.
    Bench,
    /// The site of the documents, with its options.
    Book(Vec<String>),
    /// The comparison with other solvers, with its options.
    Peers(Vec<String>),
}

fn select(arguments: &[String]) -> Result<Selection, String> {
    if arguments.is_empty() {
        return Err("name at least one task".into());
    }
    match (arguments[0].as_str(), &arguments[1..]) {
        ("bench", []) => return Ok(Selection::Bench),
        ("book", options) => return Ok(Selection::Book(options.to_vec())),
        ("peers", options) => return Ok(Selection::Peers(options.to_vec())),
        _ => {}
    }
    let mut selected = Vec::new();
    for argument in arguments {
        match argument.as_str() {
            "help" | "-h" | "--help" => return Ok(Selection::Help),
            "test" => selected.extend(STEPS),
            name => selected.push(
                STEPS
                    .iter()
                    .chain(OTHER_TASKS)
                    .find(|step| step.name == name)
                    .ok_or_else(|| format!("no task is called `{name}`"))?,
            ),
        }
    }
    Ok(Selection::Run(selected))
}

fn usage() -> String {
    use std::fmt::Write as _;
    let mut text =
        String::from("usage: cargo xtask <task>...\n\n  test         all of these checks:\n");
    for step in STEPS {
        let _ = writeln!(text, "  {:<11}  {}", step.name, step.about);
    }
    text.push_str("\n  other tasks:\n");
    for step in OTHER_TASKS {
        let _ = writeln!(text, "  {:<11}  {}", step.name, step.about);
    }
    text += "  bench        run every bench and write docs/benches.md\n";
    text += "  book         build the documents as a site in target/book/site (--quick: a quick report on the paper)\n";
    text += "  peers        compare nanotap with general solvers and write docs/peers.md (--quick, --help)\n";
    text
}

/// One step's outcome, for the summary.
struct Line {
    name: &'static str,
    tally: Tally,
    /// The reason, if the step could not be run.
    trouble: Option<String>,
    time: Duration,
}

fn run(steps: &[&'static Step]) -> ExitCode {
    let workspace = Workspace::find();
    let lines: Vec<Line> = steps
        .iter()
        .map(|step| {
            println!("\n── {} · {}", step.name, step.about);
            let start = Instant::now();
            let (tally, trouble) = match (step.run)(&workspace) {
                Ok(tally) => (tally, None),
                Err(reason) => {
                    eprintln!("error: {reason}");
                    (Tally::failed_check(), Some(reason))
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
