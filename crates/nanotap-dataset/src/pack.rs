//! Finished datasets in few files.
//!
//! While a dataset is computed, a chunk is the unit of work, so there are hundreds, each with a file
//! for every variable. The chunks of a finished dataset are joined to chunks as large as memory
//! allows: file systems and archives take few large files better than many small ones.
//!
//! Joined chunks have names of their own (Zarr's separator `/`), so that both divisions can stand side
//! by side. The consolidated metadata, replaced by one rename, say which one counts; whatever is
//! killed before or after, the dataset is whole. The files of the other division are removed last. A
//! process that still works on the old division finds what it reads in the new one.

use std::fs;
use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::error::StoreError;
use super::grid::{Axis, Block};
use super::schema::{Schema, Values};
use super::store::{Store, encoded};

/// Files of chunks that are not worth joining.
const FEW_FILES: usize = 100;
/// Most bytes of a joined chunk of one variable.
const CHUNK_BYTES: usize = 256 << 20;

/// The same content in larger chunks; `None` if there are few files.
pub(super) fn packed(schema: &Schema) -> Option<Schema> {
    if schema.grid.chunks() * schema.variables.len() <= FEW_FILES {
        return None;
    }
    let mut packed = schema.clone();
    let variables = schema.variables.iter();
    let widest = variables.map(|v| v.stride() * v.kind.size()).max();
    let (first, others) = packed.grid.axes.split_first_mut()?;
    let lengths = others.iter().map(|axis| axis.length);
    let row = lengths.fold(widest?, usize::saturating_mul);
    if row > CHUNK_BYTES {
        return None;
    }
    for axis in others {
        axis.chunk = axis.length;
    }
    first.chunk = (CHUNK_BYTES / row.max(1)).clamp(1, first.length);
    (packed.grid.chunks() < schema.grid.chunks()).then_some(packed)
}

/// Joins the chunks of a finished dataset. An unfinished one stays as it is.
///
/// # Errors
/// If the file system fails, or a chunk is damaged; the dataset is then as it was.
pub fn finish(store: Store) -> Result<Store, StoreError> {
    let Some(schema) =
        packed(store.schema()).filter(|_| store.missing() == 0 && !store.is_in_memory())
    else {
        return Ok(store);
    };
    let there = Store::open(store.path())?;
    if there.is_packed() {
        // Another process was faster.
        store.remove_chunks()?;
        return Ok(there);
    }
    replaced(&store, schema, true)
}

/// The division into chunks of work of a dataset with damaged joined chunks, which are then missing.
///
/// # Errors
/// If the file system fails.
pub(super) fn unpack(store: &Store, schema: Schema) -> Result<Store, StoreError> {
    replaced(store, schema, false)
}

/// Writes what a store holds in another division into chunks, which counts from then on.
fn replaced(store: &Store, schema: Schema, packed: bool) -> Result<Store, StoreError> {
    let target = Store::beside(store.path(), schema, packed);
    for chunk in 0..target.chunks() {
        let block = target.schema().grid.block(chunk);
        if !parts(store, &block).all(|part| store.is_finished(part.chunk)) {
            continue;
        }
        let file = |variable| {
            let column = column(store, &block, variable)?;
            Ok(encoded(target.schema(), &block, &column, variable))
        };
        let files = (0..target.schema().variables.len()).map(file);
        target.write_files(&block, &files.collect::<Result<Vec<_>, StoreError>>()?)?;
    }
    target.write_documents()?;
    store.remove_chunks()?;
    Ok(target)
}

/// The chunks of a store that share entries with a block of another division.
fn parts<'a>(store: &'a Store, block: &'a Block) -> impl Iterator<Item = Block> + 'a {
    let grid = &store.schema().grid;
    let touched = |(axis, range): (&Axis, &Range<usize>)| {
        range.start / axis.chunk..range.end.div_ceil(axis.chunk)
    };
    let places: Vec<Range<usize>> = grid.axes.iter().zip(&block.ranges).map(touched).collect();
    let count: usize = places.iter().map(ExactSizeIterator::len).product();
    (0..count).map(move |mut flat| {
        let (mut chunk, mut stride) = (0, 1);
        for (axis, place) in grid.axes.iter().zip(&places).rev() {
            chunk += stride * (place.start + flat % place.len());
            flat /= place.len();
            stride *= axis.chunks();
        }
        grid.block(chunk)
    })
}

/// The smallest block that contains all finished chunks of a dataset, numbered as the first of them;
/// `None` if no chunk is finished.
pub fn finished_block(store: &Store) -> Option<Block> {
    let grid = &store.schema().grid;
    let finished = (0..store.chunks()).filter(|chunk| store.is_finished(*chunk));
    let hull = |mut hull: Block, block: Block| {
        for (range, other) in hull.ranges.iter_mut().zip(block.ranges) {
            *range = range.start.min(other.start)..range.end.max(other.end);
        }
        hull
    };
    finished.map(|chunk| grid.block(chunk)).reduce(hull)
}

/// The values of a variable, by its index in the schema, for the entries of any block, row-major;
/// those of unfinished chunks are missing values.
///
/// # Errors
/// If a chunk cannot be read or is damaged.
pub fn column(store: &Store, block: &Block, variable: usize) -> Result<Values, StoreError> {
    let schema = store.schema();
    let stride = schema.variables[variable].stride();
    let mut column = schema.variables[variable]
        .kind
        .missing(block.len() * stride);
    let finished: Vec<Block> = parts(store, block)
        .filter(|part| store.is_finished(part.chunk))
        .collect();
    // As many chunks as threads are in memory.
    for parts in finished.chunks(rayon::current_num_threads()) {
        let read = |part: &Block| store.read_chunk(part, variable);
        let values: Result<Vec<Values>, StoreError> = parts.par_iter().map(read).collect();
        for (part, values) in parts.iter().zip(values?) {
            copy_part(&mut column, block, part, &values, stride);
        }
    }
    Ok(column)
}

/// Copies the values of a chunk to those of a block of another division into chunks.
fn copy_part(column: &mut Values, block: &Block, part: &Block, values: &Values, stride: usize) {
    let (Some(own), Some(other)) = (part.ranges.last(), block.ranges.last()) else {
        return;
    };
    // Entries along the last axis are neighbours in both.
    let start = own.start.max(other.start);
    let run = own.end.min(other.end).saturating_sub(start);
    for row in (0..part.len()).step_by(own.len()) {
        let mut entry = part.entry(row);
        if let Some(last) = entry.last_mut() {
            *last = start;
        }
        if let Some(at) = block.position(&entry) {
            let from = row + (start - own.start);
            column.copy_from(at * stride, values, from * stride, run * stride);
        }
    }
}

/// Removes a file or a folder that may not exist.
///
/// # Errors
/// If the file system refuses.
pub(super) fn remove(path: &Path) -> Result<(), StoreError> {
    let removed = if path.is_dir() {
        fs::remove_dir_all(path)
    } else {
        fs::remove_file(path)
    };
    match removed {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(StoreError::io("remove", path)(error))
        }
        _ => Ok(()),
    }
}
