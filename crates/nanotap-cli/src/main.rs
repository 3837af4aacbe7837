//! The command-line interface: parsing, formatting, files. No physics and no numerics here.
//!
//! Exit codes: 0 done, 1 failed, 2 bad input, 130 stopped by Ctrl-C or SIGTERM.

mod arguments;
mod command;
mod dataset;
mod failure;
mod file;
mod given_case;
mod motion;
mod number;
mod output;
mod page;
mod progress;
mod request;
mod series;
mod study_arguments;
mod style;
mod table;
mod threads;

use std::process::ExitCode;

use clap::Parser as _;

use command::Arguments;
use output::Output;

/// Faster than the system's at the small blocks that reports and models are made of.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let output = Output::new(arguments.json, arguments.quiet);
    if arguments.force {
        file::force();
    }
    if !output.is_quiet() {
        progress::begin();
    }
    let listening = if arguments.command.listens_itself() {
        Ok(())
    } else {
        progress::listen()
    };
    let result = listening.and_then(|()| command::run(&arguments.command, &output));
    progress::end();
    match result {
        Err(error) => failure::report(error),
        // What was finished has been shown.
        Ok(()) if progress::is_stopped() => ExitCode::from(progress::INTERRUPTED),
        Ok(()) => ExitCode::SUCCESS,
    }
}
