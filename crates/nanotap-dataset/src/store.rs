//! A dataset on disk, or in memory.

use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde_json::{Map, Value, json};

use super::attributes::differences;
use super::error::StoreError;
use super::grid::{Axis, Block, Grid};
use super::pack;
use super::schema::{Attributes, Coordinate, Kind, Schema, Values, Variable};
use super::zarr;
use crate::files::{self, is_temporary};
use nanotap_case::input::{
    self, InputError, InputFault, MAX_DOCUMENT_BYTES, MAX_TABLE_BYTES, Origin,
};

/// The folder of markers, one per finished chunk. Zarr readers look at the metadata only and ignore
/// it.
const MARKERS: &str = ".chunks";
/// The folder of markers of a store whose chunks were joined.
const PACKED_MARKERS: &str = ".joined";
/// The attribute with the chunks of each axis and the names of the computed arrays.
const LAYOUT: &str = "chunk_layout";
/// The attribute from which xarray knows coordinates that do not label a dimension.
const COORDINATES: &str = "coordinates";

/// Files by their paths.
type Files = BTreeMap<PathBuf, Vec<u8>>;

/// A dataset on disk, or in memory, where it ends with the store.
///
/// A chunk is finished if its marker, `.chunks/<index>`, exists and states the length and the
/// CRC-32 of the chunk's file for every variable. Markers are read when the store is opened.
#[derive(Debug)]
pub struct Store {
    path: PathBuf,
    schema: Schema,
    metadata: String,
    /// Whether the chunks of the computation were joined into larger ones.
    packed: bool,
    finished: Vec<AtomicBool>,
    /// The files of a store in memory.
    memory: Option<Mutex<Files>>,
}

impl Store {
    /// Opens the store at `path`, or creates it if it does not exist.
    ///
    /// # Errors
    /// If the path is something else, if the store has other attributes, or if the file system
    /// fails.
    pub fn create_or_resume(path: &Path, schema: Schema) -> Result<Self, StoreError> {
        let documents = documents(&schema, false);
        let metadata = consolidated(&documents);
        if let Some(packed) = pack::packed(&schema) {
            let metadata = consolidated(&self::documents(&packed, true));
            let there = document(&path.join(zarr::CONSOLIDATED));
            if there.is_ok_and(|there| same(&there, &metadata)) {
                refuse_links(path)?;
                let store = Self::with(path, packed, metadata, true);
                return match store.missing() {
                    0 => Ok(store),
                    _ => pack::unpack(&store, schema),
                };
            }
        }
        match fs::metadata(path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => return Err(StoreError::io("look at", path)(error)),
            Ok(found) if !found.is_dir() => {
                return Err(StoreError::Occupied {
                    path: path.into(),
                    what: "a file".into(),
                });
            }
            Ok(_) => {
                refuse_links(path)?;
                refuse_strangers(path, &metadata, &documents)?;
            }
        }
        let store = Self::with(path, schema, metadata, false);
        make_folder(&path.join(MARKERS))?;
        store.write_documents()?;
        Ok(store)
    }

    /// Creates a store in memory: for a figure that is drawn at once, and where there is no disk.
    pub fn in_memory(schema: Schema) -> Self {
        let metadata = consolidated(&documents(&schema, false));
        let mut store = Self::unread(Path::new(""), schema, metadata, false);
        store.memory = Some(Mutex::default());
        store
    }

    /// Creates a store object for `path` without writing anything; `packed` if chunks are joined.
    pub(super) fn beside(path: &Path, schema: Schema, packed: bool) -> Self {
        let metadata = consolidated(&documents(&schema, packed));
        Self::with(path, schema, metadata, packed)
    }

    /// Writes all documents and coordinates, but not the chunks of the variables. From then on the
    /// store has this division into chunks.
    ///
    /// # Errors
    /// If the file system fails.
    pub(super) fn write_documents(&self) -> Result<(), StoreError> {
        for (name, document) in documents(&self.schema, self.packed) {
            write_if_other(&self.path.join(name), document.as_bytes())?;
        }
        for coordinate in &self.schema.coordinates {
            let name = zarr::chunk_name(&[], coordinate.dimensions.len());
            let file = self.path.join(&coordinate.name).join(name);
            write_if_other(&file, &zarr::encode(&coordinate.values))?;
        }
        // Written last, because a folder with this document counts as a store.
        write_if_other(
            &self.path.join(zarr::CONSOLIDATED),
            self.metadata.as_bytes(),
        )
    }

    /// Whether the chunks of the computation were joined into larger ones.
    pub(super) const fn is_packed(&self) -> bool {
        self.packed
    }

    /// Removes the files of this division into chunks.
    ///
    /// # Errors
    /// If the file system fails.
    pub(super) fn remove_chunks(&self) -> Result<(), StoreError> {
        for chunk in 0..self.chunks() {
            let block = self.schema.grid.block(chunk);
            for variable in &self.schema.variables {
                pack::remove(&self.file(variable, &block))?;
            }
        }
        if self.packed {
            // The folders of their first numbers.
            for variable in &self.schema.variables {
                for number in 0..self.schema.grid.axes[0].chunks() {
                    pack::remove(&self.path.join(&variable.name).join(number.to_string()))?;
                }
            }
            pack::remove(&self.path.join(PACKED_MARKERS))
        } else {
            pack::remove(&self.path.join(MARKERS))
        }
    }

    /// Opens an existing store.
    ///
    /// # Errors
    /// If it does not exist or is not a store of nanotap.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let consolidated = path.join(zarr::CONSOLIDATED);
        let refuse = |what: &str| StoreError::NotAStore {
            path: path.into(),
            what: what.into(),
        };
        let metadata = match document(&consolidated) {
            Ok(text) => text,
            Err(error) if error.is_missing() => {
                return Err(refuse(if path.exists() {
                    "it has no .zmetadata"
                } else {
                    "it does not exist"
                }));
            }
            Err(_) if path.is_file() => return Err(refuse("it is a file, not a folder")),
            Err(error) => return Err(error.into()),
        };
        let (parsed, metadata) = if let Ok(parsed) = serde_json::from_str::<Value>(&metadata) {
            (parsed, metadata)
        } else {
            let rebuilt = rebuilt(path).ok_or_else(|| torn(path))?;
            let text = pretty(&rebuilt);
            (rebuilt, text)
        };
        let schema = schema_of(path, &parsed["metadata"])?
            .ok_or_else(|| refuse("its .zmetadata was not written by nanotap"))?;
        let first = schema
            .variables
            .first()
            .map_or("", |variable| &variable.name);
        let array = &parsed["metadata"][format!("{first}/{}", zarr::ARRAY)];
        let packed = array[zarr::SEPARATOR] == "/";
        Ok(Self::with(path, schema, metadata, packed))
    }

    fn unread(path: &Path, schema: Schema, metadata: String, packed: bool) -> Self {
        let chunks = schema.grid.chunks();
        Self {
            path: path.into(),
            schema,
            metadata,
            packed,
            finished: (0..chunks).map(|_| AtomicBool::new(false)).collect(),
            memory: None,
        }
    }

    fn with(path: &Path, schema: Schema, metadata: String, packed: bool) -> Self {
        let store = Self::unread(path, schema, metadata, packed);
        // What the metadata declare costs nothing; only chunks with a marker are looked at.
        for chunk in store.marked() {
            store.finished[chunk].store(store.is_whole(chunk), Ordering::Release);
        }
        store
    }

    /// The chunks that have a marker.
    fn marked(&self) -> Vec<usize> {
        let Ok(listing) = fs::read_dir(self.markers()) else {
            return Vec::new();
        };
        let names = listing.flatten().map(|entry| entry.file_name());
        let chunk = |name: std::ffi::OsString| {
            let name = name.to_str()?;
            let chunk: usize = name.parse().ok()?;
            (chunk < self.chunks() && chunk.to_string() == name).then_some(chunk)
        };
        names.filter_map(chunk).collect()
    }

    /// The files of a store in memory; `None` on disk.
    fn memory(&self) -> Option<MutexGuard<'_, Files>> {
        let files = self.memory.as_ref()?;
        Some(files.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Reads a file of the store of at most `limit` bytes.
    fn read(&self, path: &Path, limit: u64) -> Result<Vec<u8>, InputError> {
        let Some(files) = self.memory() else {
            return input::read(path, limit, Origin::File);
        };
        let missing = || InputError {
            path: path.into(),
            fault: InputFault::Missing,
        };
        files.get(path).cloned().ok_or_else(missing)
    }

    /// Whether the store is in memory.
    pub(super) const fn is_in_memory(&self) -> bool {
        self.memory.is_some()
    }

    /// Returns the path of the folder of the store; empty in memory.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the content of the store: grid, variables, coordinates and attributes.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// The metadata as text, equal for stores whose chunks fit together.
    pub fn metadata(&self) -> &str {
        &self.metadata
    }

    /// Returns the number of chunks, finished or not.
    pub fn chunks(&self) -> usize {
        self.finished.len()
    }

    /// Returns true if the chunk is finished.
    pub fn is_finished(&self, chunk: usize) -> bool {
        self.finished
            .get(chunk)
            .is_some_and(|f| f.load(Ordering::Acquire))
    }

    /// Returns the number of unfinished chunks.
    pub fn missing(&self) -> usize {
        (0..self.chunks()).filter(|c| !self.is_finished(*c)).count()
    }

    /// True if the marker and every file of a chunk exist and agree.
    fn is_whole(&self, chunk: usize) -> bool {
        let Ok(marker) = document(&self.marker(chunk)) else {
            return false;
        };
        let block = self.schema.grid.block(chunk);
        let mut lines = marker.lines();
        self.schema.variables.iter().all(|variable| {
            let file = self.read_file(variable, &block);
            file.is_ok_and(|bytes| lines.next() == Some(&marker_line(&variable.name, &bytes)))
        }) && lines.next().is_none()
    }

    fn markers(&self) -> PathBuf {
        let folder = if self.packed { PACKED_MARKERS } else { MARKERS };
        self.path.join(folder)
    }

    fn marker(&self, chunk: usize) -> PathBuf {
        self.markers().join(chunk.to_string())
    }

    /// Reads the file of a chunk, which is not longer than zlib makes it.
    fn read_file(&self, variable: &Variable, block: &Block) -> Result<Vec<u8>, InputError> {
        let entries = self.schema.grid.chunk_entries() * variable.stride();
        let limit = longest_stream(entries * variable.kind.size());
        self.read(&self.file(variable, block), limit)
    }

    fn file(&self, variable: &Variable, block: &Block) -> PathBuf {
        let name = zarr::chunk_name(&block.place, variable.tail.len());
        let array = self.path.join(&variable.name);
        if self.packed {
            array.join(name.replace('.', "/"))
        } else {
            array.join(name)
        }
    }

    /// Writes a finished chunk. `columns` contains the values of each variable, in order, for the
    /// entries of the block, row-major.
    ///
    /// # Errors
    /// If the file system fails.
    ///
    /// # Panics
    /// If a column has the wrong length or type.
    pub fn write_chunk(&self, block: &Block, columns: &[Values]) -> Result<(), StoreError> {
        self.write_files(block, &chunk_files(&self.schema, block, columns))
    }

    /// Stores a finished chunk that was computed elsewhere, as the files made by [`chunk_files`].
    ///
    /// # Errors
    /// If they are not the files of this chunk, or the file system fails.
    pub fn take_files(&self, chunk: usize, files: &[Vec<u8>]) -> Result<(), StoreError> {
        let damaged = |what: String| StoreError::Damaged {
            path: self.marker(chunk),
            what,
        };
        let variables = &self.schema.variables;
        if chunk >= self.chunks() || files.len() != variables.len() {
            return Err(damaged(format!(
                "got {} files of chunk {chunk}, expected {} files of one of {} chunks",
                files.len(),
                variables.len(),
                self.chunks()
            )));
        }
        let entries = self.schema.grid.chunk_entries();
        for (variable, file) in variables.iter().zip(files) {
            zarr::decode(file, variable.kind, entries * variable.stride())
                .map_err(|what| damaged(format!("{}: {what}", variable.name)))?;
        }
        self.write_files(&self.schema.grid.block(chunk), files)
    }

    pub(super) fn write_files(&self, block: &Block, files: &[Vec<u8>]) -> Result<(), StoreError> {
        let mut marker = String::new();
        for (variable, bytes) in self.schema.variables.iter().zip(files) {
            let path = self.file(variable, block);
            if let Some(mut files) = self.memory() {
                files.insert(path, bytes.clone());
                continue;
            }
            write_whole(&path, bytes)?;
            marker.push_str(&marker_line(&variable.name, bytes));
            marker.push('\n');
        }
        if !self.is_in_memory() {
            write_whole(&self.marker(block.chunk), marker.as_bytes())?;
        }
        self.finished[block.chunk].store(true, Ordering::Release);
        Ok(())
    }

    /// Copies a finished chunk from a store with the same metadata, byte for byte.
    ///
    /// # Errors
    /// If a file cannot be read or written.
    pub(super) fn take_chunk(&self, from: &Self, chunk: usize) -> Result<(), StoreError> {
        let block = self.schema.grid.block(chunk);
        let mut files = Vec::new();
        for variable in &self.schema.variables {
            files.push(from.read_file(variable, &block)?);
        }
        self.write_files(&block, &files)
    }

    /// Reads the values of a variable (by its index in the schema) in a finished chunk, for the
    /// entries of the block, row-major.
    ///
    /// # Errors
    /// If the file cannot be read or is damaged.
    pub fn read_chunk(&self, block: &Block, variable: usize) -> Result<Values, StoreError> {
        let index = variable;
        let variable = &self.schema.variables[variable];
        let path = self.file(variable, block);
        let bytes = match self.read_file(variable, block) {
            Ok(bytes) => bytes,
            Err(error) if self.is_in_memory() => return Err(error.into()),
            Err(error) => {
                // Another process may have joined the chunks.
                let there = Self::open(&self.path)?;
                if error.is_missing() && there.packed && !self.packed {
                    return pack::column(&there, block, index);
                }
                return Err(error.into());
            }
        };
        let (grid, stride) = (&self.schema.grid, variable.stride());
        let full = zarr::decode(&bytes, variable.kind, grid.chunk_entries() * stride)
            .map_err(|what| StoreError::Damaged { path, what })?;
        Ok(match full {
            Values::Real(v) => Values::Real(unpadded(grid, block, &v, stride)),
            Values::Whole(v) => Values::Whole(unpadded(grid, block, &v, stride)),
            Values::Code(v) => Values::Code(unpadded(grid, block, &v, stride)),
            Values::Text(v) => Values::Text(unpadded(grid, block, &v, stride)),
        })
    }

    /// Calls a function for each entry of a finished dataset, with the entry and its numbers of some
    /// variables.
    ///
    /// # Errors
    /// When a variable or a chunk is missing or damaged.
    pub fn each<const N: usize>(
        &self,
        names: [&str; N],
        mut call: impl FnMut(&[usize], [f64; N]),
    ) -> Result<(), StoreError> {
        self.each_row(&names, |entry, row| {
            call(entry, std::array::from_fn(|k| row[k]));
        })
    }

    /// As [`Store::each`], with the names in a slice.
    ///
    /// # Errors
    /// As [`Store::each`].
    pub fn each_row(
        &self,
        names: &[&str],
        mut call: impl FnMut(&[usize], &[f64]),
    ) -> Result<(), StoreError> {
        let mut row = vec![f64::NAN; names.len()];
        for chunk in 0..self.chunks() {
            let block = self.schema.grid.block(chunk);
            let column = |name: &&str| {
                let missing = || StoreError::NotAStore {
                    path: self.path.clone(),
                    what: format!("not a sweep: it has no variable `{name}`"),
                };
                let variable = self.schema.index_of(name).ok_or_else(missing)?;
                Ok(self.read_chunk(&block, variable)?.numbers())
            };
            let columns = names
                .iter()
                .map(column)
                .collect::<Result<Vec<_>, StoreError>>()?;
            let number = |k: usize, flat: usize| columns[k].get(flat).copied();
            for (flat, entry) in block.entries().enumerate() {
                for (k, value) in row.iter_mut().enumerate() {
                    *value = number(k, flat).unwrap_or(f64::NAN);
                }
                call(&entry, &row);
            }
        }
        Ok(())
    }

    /// Returns an error if chunks are missing.
    ///
    /// # Errors
    /// [`StoreError::Unfinished`].
    pub fn require_all(&self) -> Result<(), StoreError> {
        match self.missing() {
            0 => Ok(()),
            missing => Err(StoreError::Unfinished {
                path: self.path.clone(),
                missing,
                total: self.chunks(),
            }),
        }
    }

    /// Writes a document next to the arrays, completely or not at all.
    ///
    /// # Errors
    /// If the file system fails.
    pub fn write_beside(&self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        let path = self.path.join(name);
        if let Some(mut files) = self.memory() {
            files.insert(path, bytes.to_vec());
            return Ok(());
        }
        write_if_other(&path, bytes)
    }

    /// Reads a document next to the arrays; `None` if it does not exist.
    ///
    /// # Errors
    /// If the file system fails.
    pub fn read_beside(&self, name: &str) -> Result<Option<Vec<u8>>, StoreError> {
        match self.read(&self.path.join(name), MAX_TABLE_BYTES) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.is_missing() => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Returns true if every chunk is finished. Then it also removes temporary files that killed
    /// runs left long ago (other processes may be working on the same store).
    ///
    /// # Errors
    /// If the file system fails.
    pub fn tidy(&self) -> Result<bool, StoreError> {
        if self.missing() > 0 {
            return Ok(false);
        }
        if self.is_in_memory() {
            return Ok(true);
        }
        let arrays = self.schema.variables.iter().map(|v| v.name.as_str());
        let coordinates = self.schema.coordinates.iter().map(|c| c.name.as_str());
        let markers = if self.packed { PACKED_MARKERS } else { MARKERS };
        for name in arrays.chain(coordinates).chain([markers, ""]) {
            let folder = self.path.join(name);
            let listing = fs::read_dir(&folder).map_err(StoreError::io("list", &folder))?;
            for file in listing.flatten().map(|entry| entry.path()) {
                files::remove_abandoned(&file);
            }
        }
        Ok(true)
    }
}

/// The files of a chunk, one per variable. `columns` contains the values of each variable, in
/// order, for the entries of the block, row-major.
///
/// # Panics
/// If a column has the wrong length or type.
pub fn chunk_files(schema: &Schema, block: &Block, columns: &[Values]) -> Vec<Vec<u8>> {
    assert_eq!(columns.len(), schema.variables.len());
    let file = |(variable, column)| encoded(schema, block, column, variable);
    columns
        .iter()
        .enumerate()
        .map(|(variable, column)| file((variable, column)))
        .collect()
}

/// The file of a chunk for a variable, by its index in the schema.
pub(super) fn encoded(schema: &Schema, block: &Block, column: &Values, variable: usize) -> Vec<u8> {
    let variable = &schema.variables[variable];
    let stride = variable.stride();
    assert_eq!(
        (column.len(), column.kind()),
        (block.len() * stride, variable.kind)
    );
    zarr::encode(&padded(&schema.grid, block, column, stride))
}

fn marker_line(name: &str, bytes: &[u8]) -> String {
    format!("{name} {} {:08x}", bytes.len(), crc32fast::hash(bytes))
}

/// A column in a full chunk; entries beyond the end of the axes are missing values.
fn padded(grid: &Grid, block: &Block, column: &Values, stride: usize) -> Values {
    let mut full = column.kind().missing(grid.chunk_entries() * stride);
    for index in 0..block.len() {
        full.copy_from(
            grid.slot(block, index) * stride,
            column,
            index * stride,
            stride,
        );
    }
    full
}

fn unpadded<T: Clone>(grid: &Grid, block: &Block, full: &[T], stride: usize) -> Vec<T> {
    (0..block.len())
        .flat_map(|index| {
            let slot = grid.slot(block, index) * stride;
            full[slot..slot + stride].iter().cloned()
        })
        .collect()
}

/// All metadata documents by their names in the store, except `.zmetadata`; `packed` if the chunks
/// of the computation were joined.
fn documents(schema: &Schema, packed: bool) -> Vec<(String, String)> {
    let mut root = schema.attributes.clone();
    let axes: Vec<Value> = schema
        .grid
        .axes
        .iter()
        .map(|a| json!([a.name, a.length, a.chunk]))
        .collect();
    let names: Vec<&str> = schema.variables.iter().map(|v| v.name.as_str()).collect();
    root.insert(
        LAYOUT.into(),
        json!({ "axes": axes, "variables": names })
            .to_string()
            .into(),
    );
    let coordinates: Vec<&str> = schema
        .coordinates
        .iter()
        .filter(|c| c.dimensions.as_slice() != [c.name.clone()])
        .map(|c| c.name.as_str())
        .collect();
    if !coordinates.is_empty() {
        root.insert(COORDINATES.into(), coordinates.join(" ").into());
    }
    let mut all = vec![
        (zarr::GROUP.to_owned(), zarr::group()),
        (zarr::ATTRIBUTES.to_owned(), Value::Object(root)),
    ];
    let grid = &schema.grid.axes;
    for variable in &schema.variables {
        let tail = || variable.tail.iter().map(|(_, length)| *length);
        let shape: Vec<usize> = grid.iter().map(|a| a.length).chain(tail()).collect();
        let chunks: Vec<usize> = grid.iter().map(|a| a.chunk).chain(tail()).collect();
        let dimensions = grid
            .iter()
            .map(|a| &a.name)
            .chain(variable.tail.iter().map(|(name, _)| name));
        let name = &variable.name;
        all.push((
            format!("{name}/{}", zarr::ARRAY),
            zarr::array(&shape, &chunks, variable.kind, packed),
        ));
        all.push((
            format!("{name}/{}", zarr::ATTRIBUTES),
            zarr::attributes(dimensions.map(String::as_str), &variable.attributes),
        ));
    }
    for coordinate in &schema.coordinates {
        let shape: Vec<usize> = coordinate
            .dimensions
            .iter()
            .map(|d| length_of(schema, d))
            .collect();
        let name = &coordinate.name;
        let kind = coordinate.values.kind();
        all.push((
            format!("{name}/{}", zarr::ARRAY),
            zarr::array(&shape, &shape, kind, false),
        ));
        all.push((
            format!("{name}/{}", zarr::ATTRIBUTES),
            zarr::attributes(
                coordinate.dimensions.iter().map(String::as_str),
                &coordinate.attributes,
            ),
        ));
    }
    all.into_iter()
        .map(|(name, document)| (name, pretty(&document)))
        .collect()
}

fn length_of(schema: &Schema, dimension: &str) -> usize {
    let axes = schema.grid.axes.iter().map(|a| (&a.name, a.length));
    let tails = schema
        .variables
        .iter()
        .flat_map(|v| v.tail.iter().map(|(name, length)| (name, *length)));
    axes.chain(tails)
        .find(|(name, _)| *name == dimension)
        .map_or(1, |(_, length)| length)
}

fn consolidated(documents: &[(String, String)]) -> String {
    let parsed: Map<String, Value> = documents
        .iter()
        .map(|(name, text)| (name.clone(), serde_json::from_str(text).unwrap_or_default()))
        .collect();
    pretty(&json!({ "zarr_consolidated_format": 1, "metadata": parsed }))
}

fn pretty(document: &Value) -> String {
    serde_json::to_string_pretty(document).unwrap_or_default() + "\n"
}

/// Refuses a folder that contains symbolic links: files would be written outside the store.
fn refuse_links(path: &Path) -> Result<(), StoreError> {
    let listing = fs::read_dir(path).map_err(StoreError::io("list", path))?;
    for entry in listing.flatten() {
        let kind = entry.file_type().map_err(StoreError::io("look at", path))?;
        if kind.is_symlink() {
            return Err(StoreError::Occupied {
                path: path.into(),
                what: format!(
                    "a folder with the symbolic link {} in it",
                    entry.file_name().display()
                ),
            });
        }
        if kind.is_dir() {
            refuse_links(&entry.path())?;
        }
    }
    Ok(())
}

/// Refuses a folder that is a store with other attributes, or not a store.
fn refuse_strangers(
    path: &Path,
    metadata: &str,
    documents: &[(String, String)],
) -> Result<(), StoreError> {
    match document(&path.join(zarr::CONSOLIDATED)) {
        Ok(there) if same(&there, metadata) => return Ok(()),
        Ok(there) if is_whole(&there) => return Err(mismatch(path, &there, metadata)),
        // Incomplete after a power failure: rewritten if the attributes show that the same command
        // created the dataset.
        Ok(_) => {
            let root = |text: &str| {
                let all: Value = serde_json::from_str(text).unwrap_or_default();
                all["metadata"][zarr::ATTRIBUTES].to_string()
            };
            let there = document(&path.join(zarr::ATTRIBUTES)).unwrap_or_default();
            if same(&there, &root(metadata)) {
                return Ok(());
            }
            return Err(torn(path));
        }
        Err(error) if error.is_missing() => {}
        Err(error) => return Err(error.into()),
    }
    // Without that document the folder may be a store whose creation was interrupted.
    let listing = fs::read_dir(path).map_err(StoreError::io("list", path))?;
    for entry in listing.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let first = |document: &str| document.split('/').next() == Some(&name);
        let ours = [MARKERS, PACKED_MARKERS].contains(&name.as_str())
            || is_temporary(&entry.path())
            || documents.iter().any(|(document, _)| first(document));
        if !ours {
            let what = format!("a folder with `{name}` in it");
            return Err(StoreError::Occupied {
                path: path.into(),
                what,
            });
        }
    }
    Ok(())
}

/// True if two metadata texts have the same content, in any order.
pub(super) fn same(a: &str, b: &str) -> bool {
    let parsed = |text: &str| serde_json::from_str::<Value>(text).ok();
    a == b || parsed(a).is_some_and(|a| parsed(b) == Some(a))
}

/// The error for a store whose content can no longer be determined.
fn torn(path: &Path) -> StoreError {
    StoreError::NotAStore {
        path: path.into(),
        what: "its .zmetadata is empty or torn, and the .zattrs and .zarray that it was made of \
               are not all there; the command that made it mends it if .zattrs is whole, else \
               remove the folder and compute it again"
            .into(),
    }
}

/// True if a metadata text is complete.
fn is_whole(text: &str) -> bool {
    serde_json::from_str::<Value>(text).is_ok()
}

/// The consolidated metadata, rebuilt from their parts; `None` if one of these is damaged too.
fn rebuilt(path: &Path) -> Option<Value> {
    let parsed = |name: &str| -> Option<Value> {
        serde_json::from_str(&document(&path.join(name)).ok()?).ok()
    };
    let mut all = Map::new();
    for name in [zarr::GROUP, zarr::ATTRIBUTES] {
        all.insert(name.into(), parsed(name)?);
    }
    let mut arrays: Vec<String> = fs::read_dir(path)
        .ok()?
        .flatten()
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| path.join(name).join(zarr::ARRAY).is_file())
        .collect();
    arrays.sort();
    for array in arrays {
        for part in [zarr::ARRAY, zarr::ATTRIBUTES] {
            let name = format!("{array}/{part}");
            let document = parsed(&name)?;
            all.insert(name, document);
        }
    }
    Some(json!({ "zarr_consolidated_format": 1, "metadata": all }))
}

/// The error for a store with different metadata.
pub(super) fn mismatch(path: &Path, there: &str, here: &str) -> StoreError {
    StoreError::Mismatch {
        path: path.into(),
        differences: metadata_differences(there, here),
    }
}

/// Differences that an error lists.
const LISTED: usize = 4;

/// What differs between the metadata of two stores, in words.
pub(super) fn metadata_differences(there: &str, here: &str) -> Vec<String> {
    let root = |text: &str| {
        let all: Value = serde_json::from_str(text).unwrap_or_default();
        all["metadata"][zarr::ATTRIBUTES].clone()
    };
    let mut differences = differences(&root(there), &root(here));
    // The division into chunks follows from the other attributes.
    if differences.iter().any(|d| !d.starts_with(LAYOUT)) {
        differences.retain(|d| !d.starts_with(LAYOUT));
    }
    if differences.is_empty() {
        differences.push("its variables are those of another version".into());
    }
    let more = differences.len().saturating_sub(LISTED);
    differences.truncate(LISTED);
    if more > 0 {
        differences.push(format!("and {more} more"));
    }
    differences
}

/// Largest number of entries of an array: larger ones were not written by nanotap.
const MAX_ENTRIES: u64 = 1 << 32;
/// Largest number of bytes of a text.
const LONGEST_WORD: usize = 1 << 16;
/// Largest number of chunks: an open store has a byte for each.
const MAX_CHUNKS: usize = 10_000_000;
/// Largest number of bytes in memory of a chunk of one variable, or of all coordinates.
pub const MAX_CHUNK_BYTES: usize = 1 << 30;
/// Bytes in memory of a text, besides its characters.
const TEXT_BYTES: usize = 32;

/// Bytes in memory of so many entries, if they are not too many.
fn memory(kind: Kind, entries: usize) -> Option<usize> {
    let each = match kind {
        Kind::Text(_) => TEXT_BYTES + kind.size(),
        _ => kind.size(),
    };
    entries
        .checked_mul(each)
        .filter(|bytes| *bytes <= MAX_CHUNK_BYTES)
}

/// Largest length of a zlib stream of so many bytes: those that cannot be compressed take a few bytes
/// more for each block.
fn longest_stream(bytes: usize) -> u64 {
    (bytes + bytes / 64 + 4096) as u64
}

/// The text of one of the store's documents.
fn document(path: &Path) -> Result<String, InputError> {
    input::text(path, MAX_DOCUMENT_BYTES, Origin::File)
}

/// True if `name` is a valid name of an array: a folder inside the store.
fn is_name(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    let plain = matches!(parts.next(), Some(std::path::Component::Normal(_)));
    plain && parts.next().is_none() && !name.starts_with('.') && !name.contains(['/', '\\', ':'])
}

/// The product of sizes, if an array can have them.
fn entries(sizes: impl IntoIterator<Item = usize>) -> Option<usize> {
    let product = sizes
        .into_iter()
        .try_fold(1_u64, |product, size| product.checked_mul(size as u64))?;
    (product <= MAX_ENTRIES).then_some(product as usize)
}

/// The schema that consolidated metadata describe; `None` if nanotap did not write them.
///
/// # Errors
/// If a coordinate cannot be read, or if names or sizes are invalid.
fn schema_of(path: &Path, documents: &Value) -> Result<Option<Schema>, StoreError> {
    let Some(root) = documents[zarr::ATTRIBUTES].as_object() else {
        return Ok(None);
    };
    let Some(layout) = root.get(LAYOUT).and_then(Value::as_str) else {
        return Ok(None);
    };
    let layout: Value = serde_json::from_str(layout).unwrap_or_default();
    let mut axes = Vec::new();
    for axis in layout["axes"].as_array().into_iter().flatten() {
        let (Some(name), Some(length), Some(chunk)) =
            (axis[0].as_str(), axis[1].as_u64(), axis[2].as_u64())
        else {
            return Ok(None);
        };
        axes.push(Axis::new(name, length as usize, chunk as usize));
    }
    let mut attributes = root.clone();
    attributes.remove(LAYOUT);
    attributes.remove(COORDINATES);
    let mut schema = Schema {
        grid: Grid { axes },
        variables: Vec::new(),
        coordinates: Vec::new(),
        attributes,
    };
    let strange = |what: String| StoreError::NotAStore {
        path: path.into(),
        what,
    };
    let too_large = |name: &str| strange(format!("the sizes of `{name}` are invalid"));
    // Names and sizes are checked before files are opened or memory is allocated.
    let arrays = documents.as_object().into_iter().flatten();
    let arrays = arrays.filter_map(|(key, _)| key.strip_suffix("/.zarray"));
    let names: Vec<&str> = layout["variables"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .collect();
    if let Some(name) = arrays.chain(names.iter().copied()).find(|n| !is_name(n)) {
        return Err(strange(format!(
            "`{name}` is not a valid name of a variable"
        )));
    }
    let chunks = entries(schema.grid.axes.iter().map(Axis::chunks));
    if entries(schema.grid.axes.iter().map(|axis| axis.length)).is_none()
        || chunks.is_none_or(|chunks| chunks > MAX_CHUNKS)
    {
        return Err(too_large("chunk_layout"));
    }
    for name in names {
        let Some(array) = ArrayDocument::of(documents, name) else {
            return Ok(None);
        };
        let skip = schema.grid.axes.len();
        let chunk = schema.grid.axes.iter().map(|axis| axis.chunk);
        let in_chunk = entries(chunk.chain(array.shape.iter().copied().skip(skip)));
        if in_chunk.and_then(|n| memory(array.kind, n)).is_none() {
            return Err(too_large(name));
        }
        let tail = array
            .dimensions
            .into_iter()
            .zip(array.shape)
            .skip(skip)
            .collect();
        schema.variables.push(Variable {
            name: name.into(),
            kind: array.kind,
            tail,
            attributes: array.attributes,
        });
    }
    let mut coordinate_bytes = 0;
    for name in documents
        .as_object()
        .into_iter()
        .flatten()
        .filter_map(|(key, _)| key.strip_suffix("/.zarray"))
    {
        if schema.index_of(name).is_some() {
            continue;
        }
        let Some(array) = ArrayDocument::of(documents, name) else {
            return Ok(None);
        };
        let file = path
            .join(name)
            .join(zarr::chunk_name(&[], array.shape.len()));
        let count = entries(array.shape.iter().copied()).ok_or_else(|| too_large(name))?;
        coordinate_bytes += memory(array.kind, count).ok_or_else(|| too_large(name))?;
        if coordinate_bytes > MAX_CHUNK_BYTES {
            return Err(too_large(name));
        }
        let limit = longest_stream(count * array.kind.size());
        let bytes = input::read(&file, limit, Origin::File)?;
        let values = zarr::decode(&bytes, array.kind, count)
            .map_err(|what| StoreError::Damaged { path: file, what })?;
        schema.coordinates.push(Coordinate {
            name: name.into(),
            dimensions: array.dimensions,
            values,
            attributes: array.attributes,
        });
    }
    Ok(Some(schema))
}

/// Content of the two documents of an array.
struct ArrayDocument {
    shape: Vec<usize>,
    kind: Kind,
    dimensions: Vec<String>,
    attributes: Attributes,
}

impl ArrayDocument {
    fn of(documents: &Value, name: &str) -> Option<Self> {
        let array = &documents[format!("{name}/{}", zarr::ARRAY)];
        let numbers = |value: &Value| {
            value
                .as_array()?
                .iter()
                .map(|n| n.as_u64().map(|n| n as usize))
                .collect::<Option<Vec<_>>>()
        };
        let mut attributes = documents[format!("{name}/{}", zarr::ATTRIBUTES)]
            .as_object()?
            .clone();
        let dimensions = attributes.remove("_ARRAY_DIMENSIONS")?;
        let dimensions = dimensions
            .as_array()?
            .iter()
            .map(|d| d.as_str().map(Into::into))
            .collect::<Option<Vec<_>>>()?;
        Some(Self {
            shape: numbers(&array["shape"])?,
            kind: zarr::kind(array["dtype"].as_str()?)
                .filter(|kind| (1..=LONGEST_WORD).contains(&kind.size()))?,
            dimensions,
            attributes,
        })
    }
}

fn make_folder(path: &Path) -> Result<(), StoreError> {
    fs::create_dir_all(path).map_err(StoreError::io("create the folder", path))
}

fn write_if_other(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let there = input::read(path, bytes.len() as u64, Origin::File);
    if there.is_ok_and(|there| there == bytes) {
        Ok(())
    } else {
        in_folder(path, || files::write(path, bytes))
    }
}

/// Writes a file of a chunk; its folder is created if necessary. The marker shows whether the file
/// is complete, so that it need not be synchronised to disk.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    in_folder(path, || files::write_unsynced(path, bytes))
}

/// Calls `write`; if the folder is missing, creates it and tries again.
fn in_folder(path: &Path, write: impl Fn() -> std::io::Result<()>) -> Result<(), StoreError> {
    let mut written = write();
    if written
        .as_ref()
        .is_err_and(|error| error.kind() == ErrorKind::NotFound)
        && let Some(folder) = path.parent()
    {
        make_folder(folder)?;
        written = write();
    }
    written.map_err(StoreError::io("write", path))
}
