//! The program as a process: exit codes, messages, JSON and files.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod branches;
mod calibrate;
mod case;
mod existing_motions;
mod experiments;
mod files;
mod formulas;
mod front_page;
mod instrument_files;
mod instrument_fits;
#[cfg(unix)]
mod interruptions;
#[cfg(unix)]
mod limits;
mod modes;
mod motions;
mod paper;
mod physical;
mod samples;
mod saving;
mod schema;
mod sweeps;
mod terminal;
mod util;
mod worked_cases;
