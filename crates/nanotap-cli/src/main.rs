//! The `nanotap` command-line program.

use std::process::ExitCode;

/// Faster than the system's at the small blocks that reports and models are made of.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    ExitCode::from(nanotap_cli::run(
        std::env::args_os(),
        nanotap_version::version!(),
    ))
}
