//! Cost of the exact flow and of what uses it: `cargo bench -p nanotap`.
//!
//! A name after `--` selects benches (`cargo bench -p nanotap -- setup`). `cargo test` runs each
//! once. Results are in `docs/performance.md`.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod approach;
mod basin;
mod cases;
mod census;
mod folder;
mod jacobian;
mod orbit;
mod period;
mod setup;
mod simulate;
mod sweep;
mod switch;

/// The allocator of the programs.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    divan::main();
}
