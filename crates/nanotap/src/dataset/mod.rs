//! Datasets of long work: chunked stores on disk that open with `xarray.open_zarr`.
//!
//! A store is a folder in the Zarr format, version 2, with consolidated metadata: every
//! Zarr reader opens it (Python, Julia, MATLAB, C++, Rust). Arrays have named dimensions,
//! coordinates and units; the root's attributes hold the case and everything else that
//! decides the numbers, so that one set of attributes has one set of bytes.
//!
//! All computed variables share one grid of chunks. A chunk is a pure function of the
//! attributes and its index, and the unit of parallel work, of resuming and of work on
//! another machine:
//!
//! - its files are written under temporary names and renamed;
//! - then its [marker](store::Store) is, which holds a checksum of each of them. A chunk
//!   counts as finished if its marker is there and its files are what the marker says,
//!   so that nothing can come between (a kill between two variables, a lost page after a
//!   power failure) without being noticed: the chunk is computed again;
//! - stores made of the same attributes on several machines are put together by
//!   [`merge()`], to the same bytes as one machine makes;
//! - several processes may even work on one store on a shared disk, each on its
//!   [`Share`].
//!
//! Zarr's own files are few and plain (JSON, and a zlib stream of little-endian numbers
//! a chunk), so they are written here: the zarrs crate costs a minute and a half of
//! building and has no rename-when-complete.

pub mod attributes;
mod deflate;
pub mod error;
pub mod files;
pub mod grid;
pub mod gsf;
pub mod merge;
pub mod schema;
pub mod share;
pub mod store;
pub mod table;
pub mod work;
mod zarr;

pub use error::StoreError;
pub use grid::{Axis, Block, Grid};
pub use merge::{Merged, merge};
pub use schema::{Coordinate, Schema, Values, Variable};
pub use share::{Share, ShareError};
pub use store::{Store, chunk_files};
pub use work::{Work, WorkError, work};
