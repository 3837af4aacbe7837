//! The command-line interface: parsing, formatting, files. No physics and no numerics here.
//!
//! A library, because two programs start it: the one of this crate, and the command `nanotap` of the
//! Python package, which has no second copy of the engines.

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
mod targets;
mod text_table;
mod threads;

use std::ffi::OsString;

use output::Output;

/// Runs the command line `arguments`, whose first item is the program's name, and returns the exit
/// code: 0 done, 1 failed, 2 bad input, 130 stopped by Ctrl-C or SIGTERM. `version` is what
/// `--version` prints: the program's, with its commit.
pub fn run(
    arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>,
    version: &'static str,
) -> u8 {
    let arguments = match command::parse(arguments, version) {
        Ok(arguments) => arguments,
        Err(error) => {
            // A closed pipe has no reader.
            let _ = error.print();
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
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
        Err(error) => {
            if !progress::is_stopped() {
                output.failed(&error);
            }
            failure::report(error)
        }
        // What was finished has been shown.
        Ok(()) if progress::is_stopped() => progress::INTERRUPTED,
        Ok(()) => 0,
    }
}
