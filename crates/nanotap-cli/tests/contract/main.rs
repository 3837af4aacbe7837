//! Pinned results that scripts rely on: JSON documents, datasets, CSV files, figures, error
//! messages and the names of options. An improvement may add to any of these; a loss or a change is
//! a failure.
//!
//! `snapshots/NAME.txt` contains commands (`$ orbit paper.toml --json`), each followed by its
//! pinned facts, one per line:
//!
//! | fact | compared |
//! |---|---|
//! | `exit = 0` | exactly |
//! | `json /path/*/entry = number 1.5 2.5` | no new types (except beyond `null`); the values of the first entries of each array to 1e-9; no value if one depends on time, rounding or the random numbers of a census |
//! | `csv FILE header = …`, `csv FILE row = …` | the header exactly, the first row to 1e-9 |
//! | `zarr FILE variable = dtype [dims]`, `zarr FILE variable@attribute = …` | exactly, numbers to 1e-9 |
//! | `svg FILE words` | the words are in the figure |
//! | `toml FILE key = value` | numbers to 1e-9 |
//! | `says words` | of an error message: the names, numbers and places in it, not its layout |
//! | `option --name`, `choice word` | of `--help`: still available |
//! | `file FILE` | written |
//!
//! The commands of one snapshot run in sequence in one folder with the files of `cases/`.
//!
//! To pin another command, write its `$` line into a snapshot. Renew the facts after a deliberate
//! change, which then has a line in `CHANGELOG.md` and is committed with it:
//!
//! ```console
//! $ NANOTAP_RENEW=1 cargo nextest run --release -p nanotap-cli --test contract
//! $ git diff crates/nanotap-cli/tests/contract/snapshots
//! ```

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod agree;
mod facts;
mod snapshot;

use snapshot::check;

/// One test per snapshot, and one that checks that every snapshot has a test.
macro_rules! snapshots {
    ($($name:ident)*) => {
        $(
            #[test]
            fn $name() {
                check(stringify!($name));
            }
        )*

        #[test]
        fn every_snapshot_is_checked() {
            let checked = [$(stringify!($name)),*];
            assert_eq!(snapshot::names(), checked);
        }
    };
}

snapshots! {
    approach
    attractors
    basin
    branch
    case
    catalogue
    convergence
    help
    lever
    lyapunov
    merge
    modes
    orbit
    paper
    refusals
    samples
    simulate
    sweep
    window
}
