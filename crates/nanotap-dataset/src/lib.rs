//! Datasets of many runs: chunked stores, on disk or in memory, that open with `xarray.open_zarr`.
//!
//! A store is a folder in the Zarr format, version 2, with consolidated metadata, which every Zarr
//! reader can open (Python, Julia, MATLAB, C++, Rust). Arrays have named dimensions, coordinates
//! and units. The attributes of the root contain the case and everything else that determines the
//! numbers, so that the same attributes mean the same bytes.
//!
//! All computed variables share one grid of chunks. A chunk is a pure function of the attributes
//! and its index. It is the unit of parallel work, of resuming, and of work on other machines:
//!
//! - its files are written under temporary names and renamed;
//! - then its [marker](store::Store) is written, which contains a checksum of each file. A chunk is
//!   finished if its marker exists and its files agree with it. Damage in between (a kill between
//!   two variables, a page lost in a power failure) is detected, and the chunk is computed again;
//! - stores with the same attributes from several machines are merged by [`merge()`], to the same
//!   bytes as from one machine;
//! - several processes may work on one store on a shared disk, each on its [`Share`].
//!
//! Zarr's files are few and simple (JSON, and one zlib stream of little-endian numbers per chunk),
//! so they are written here: the zarrs crate takes a minute and a half to build and does not rename
//! complete files.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod attributes;
mod deflate;
pub mod error;
pub mod files;
pub mod grid;
pub mod gsf;
pub mod merge;
mod pack;
pub mod schema;
pub mod share;
pub mod store;
pub mod table;
pub mod work;
mod zarr;

pub use error::StoreError;
pub use grid::{Axis, Block, Grid};
pub use merge::{Merged, merge};
pub use pack::{column, finish, finished_block};
pub use schema::{Coordinate, Schema, Values, Variable};
pub use share::{Share, ShareError};
pub use store::{Store, chunk_files};
pub use work::{Work, WorkError, work};
