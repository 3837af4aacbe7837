//! What the exact flow and what is built upon it cost: `cargo bench -p nanotap`.
//!
//! A name after `--` picks benches (`cargo bench -p nanotap -- setup`). `cargo test` runs
//! each once. `docs/performance.md` says what was found.

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

/// The one that the programs have.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    divan::main();
}
