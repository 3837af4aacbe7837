//! Finished datasets in few files.
//!
//! While a dataset is computed, a chunk is the unit of work, so there are hundreds, each with a file
//! for every variable. A finished dataset is written once more with chunks as large as memory allows:
//! file systems and archives take few large files better than many small ones.

use std::fs;
use std::path::{Path, PathBuf};

use super::error::StoreError;
use super::grid::Block;
use super::schema::{Schema, Values};
use super::store::{Store, encoded};

/// Files of chunks that are not worth joining.
const FEW_FILES: usize = 100;
/// Bytes that a chunk of one variable should not exceed.
const CHUNK_BYTES: usize = 256 << 20;

/// The same content with larger chunks; `None` if there are few files.
pub(super) fn packed(schema: &Schema) -> Option<Schema> {
    if schema.grid.chunks() * schema.variables.len() <= FEW_FILES {
        return None;
    }
    let mut packed = schema.clone();
    let variables = schema.variables.iter();
    let widest = variables.map(|v| v.stride() * v.kind.size()).max();
    let (first, others) = packed.grid.axes.split_first_mut()?;
    let row = widest? * others.iter().map(|axis| axis.length).product::<usize>();
    for axis in others {
        axis.chunk = axis.length;
    }
    first.chunk = (CHUNK_BYTES / row.max(1)).clamp(1, first.length);
    (packed.grid.chunks() < schema.grid.chunks()).then_some(packed)
}

/// Joins the chunks of a finished dataset in place. An unfinished one stays as it is.
///
/// # Errors
/// If the file system fails, or a chunk is damaged; the dataset is then as it was.
pub fn finish(store: Store) -> Result<Store, StoreError> {
    let Some(schema) = packed(store.schema()).filter(|_| store.missing() == 0) else {
        return Ok(store);
    };
    let path = store.path().to_owned();
    let [new, old] = beside(&path);
    remove(&new)?;
    let target = Store::create_or_resume(&new, schema)?;
    for chunk in 0..target.chunks() {
        let block = target.schema().grid.block(chunk);
        let file = |variable| {
            let column = column(&store, &block, variable)?;
            Ok(encoded(target.schema(), &block, &column, variable))
        };
        let files = (0..target.schema().variables.len()).map(file);
        target.write_files(&block, &files.collect::<Result<Vec<_>, StoreError>>()?)?;
    }
    copy_documents(&path, &new)?;
    drop((store, target));
    remove(&old)?;
    fs::rename(&path, &old).map_err(StoreError::io("rename", &path))?;
    fs::rename(&new, &path).map_err(StoreError::io("rename", &new))?;
    remove(&old)?;
    Store::open(&path)
}

/// Puts a dataset back whose chunks were being joined when the program was killed.
///
/// # Errors
/// If the file system fails.
pub(super) fn recover(path: &Path) -> Result<(), StoreError> {
    let [_, old] = beside(path);
    if !path.exists() && old.exists() {
        fs::rename(&old, path).map_err(StoreError::io("rename", &old))?;
    }
    Ok(())
}

/// Names beside a dataset: of the one that is being written, and of the one that it replaces.
fn beside(path: &Path) -> [PathBuf; 2] {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    ["new", "old"].map(|which| path.with_file_name(format!(".{name}.{which}.tmp")))
}

fn remove(folder: &Path) -> Result<(), StoreError> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(StoreError::io("remove", folder)(error))
        }
        _ => Ok(()),
    }
}

/// Copies the files next to the arrays that `to` does not have.
fn copy_documents(from: &Path, to: &Path) -> Result<(), StoreError> {
    let listing = fs::read_dir(from).map_err(StoreError::io("list", from))?;
    for entry in listing.flatten().filter(|entry| entry.path().is_file()) {
        let copy = to.join(entry.file_name());
        if !copy.exists() {
            fs::copy(entry.path(), &copy).map_err(StoreError::io("write", &copy))?;
        }
    }
    Ok(())
}

/// The values of a variable for the entries of a block of another division into chunks.
fn column(store: &Store, block: &Block, variable: usize) -> Result<Values, StoreError> {
    let schema = store.schema();
    let stride = schema.variables[variable].stride();
    let mut column = schema.variables[variable]
        .kind
        .missing(block.len() * stride);
    for chunk in 0..store.chunks() {
        let part = schema.grid.block(chunk);
        let apart = |(a, b): (&std::ops::Range<usize>, &std::ops::Range<usize>)| {
            a.end <= b.start || b.end <= a.start
        };
        if part.ranges.iter().zip(&block.ranges).any(apart) {
            continue;
        }
        let values = store.read_chunk(&part, variable)?;
        let (Some(own), Some(other)) = (part.ranges.last(), block.ranges.last()) else {
            continue;
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
                column.copy_from(at * stride, &values, from * stride, run * stride);
            }
        }
    }
    Ok(column)
}
