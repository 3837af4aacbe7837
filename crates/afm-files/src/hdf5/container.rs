//! The part of HDF5 that Python's h5py writes by default (The HDF Group, HDF5 File Format Specification
//! 3.0): groups, attributes, and one-dimensional rows of numbers, compressed or not.
//!
//! Every read counts against the budget, so a hostile file that points to itself comes to an end.

use std::borrow::Cow;

use crate::bytes::{Bytes, Encoding, Number};
use crate::limits::{Budget, MAX_CURVES, MAX_ENTRIES, at_most};
use crate::source::{ReadAt, Source};
use crate::text::{until_zero, utf8_or_windows};
use crate::{Error, Format};

const FORMAT: Format = Format::Hdf5;
/// An address that stands for "nothing".
const NOWHERE: u64 = u64::MAX;
/// What a read costs at least, in bytes of the budget.
const READ_COST: u64 = 1024;
/// Blocks of one object header.
const MAX_BLOCKS: usize = 1000;
/// Filters of a dataset.
const MAX_FILTERS: usize = 16;
/// Types of messages in object headers.
const DATASPACE: u16 = 0x01;
const LINK_INFO: u16 = 0x02;
const DATATYPE: u16 = 0x03;
const LINK: u16 = 0x06;
const LAYOUT: u16 = 0x08;
const FILTERS: u16 = 0x0B;
const ATTRIBUTE: u16 = 0x0C;
const CONTINUATION: u16 = 0x10;
const SYMBOL_TABLE: u16 = 0x11;
const ATTRIBUTE_INFO: u16 = 0x15;

fn damaged(at: u64, problem: impl Into<String>, expected: impl Into<String>) -> Error {
    FORMAT.damaged(crate::Place::Byte(at), problem, expected)
}

fn newer(content: &str) -> Error {
    FORMAT.unsupported(
        format!("an HDF5 file with {content}"),
        "only what h5py writes by default is read: write it again with libver='earliest'",
    )
}

/// Messages of an object: type and content.
pub(super) struct Object(Vec<(u16, Vec<u8>)>);

impl Object {
    fn all(&self, kind: u16) -> impl Iterator<Item = Bytes<'_>> {
        let found = self.0.iter().filter(move |(of, _)| *of == kind);
        found.map(|(_, content)| Bytes::new(content, FORMAT))
    }

    fn first(&self, kind: u16) -> Option<Bytes<'_>> {
        self.all(kind).next()
    }
}

/// The value of an attribute.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Text(String),
    Number(f64),
}

/// A type of stored values.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Number(Encoding),
    /// A text of this many bytes.
    Text(usize),
    /// A text in a global heap.
    HeapText,
    /// Anything else, of this many bytes.
    Other(usize),
}

impl Kind {
    const fn size(self) -> usize {
        match self {
            Self::Number(encoding) => encoding.size(),
            Self::Text(size) | Self::Other(size) => size,
            Self::HeapText => 16,
        }
    }

    fn parse(of: &Bytes) -> Result<Self, Error> {
        let head = of.slice(0, 8)?;
        let size = of.u32_le(4)?;
        let is_big = head[1] & 1 != 0;
        let number = match (head[0] & 15, size) {
            (0, 1 | 2 | 4 | 8) if head[1] & 8 != 0 => Number::Signed(size),
            (0, 1 | 2 | 4 | 8) => Number::Unsigned(size),
            (1, 4 | 8) if head[1] & 0x40 == 0 => Number::Float(size),
            (3, _) => return Ok(Self::Text(size)),
            // Truth values are an enumeration of integers.
            (8, 1 | 2 | 4 | 8) if of.data.len() > 16 => {
                return Self::parse(&Bytes::new(&of.data[8..16], FORMAT));
            }
            (9, 16) if head[1] & 15 == 1 => return Ok(Self::HeapText),
            _ => return Ok(Self::Other(size)),
        };
        Ok(Self::Number(Encoding {
            number,
            big_endian: is_big,
        }))
    }
}

/// Lengths of the dimensions; none for a single value. `None` if there is no value.
fn dimensions(of: &Bytes) -> Result<Option<Vec<u64>>, Error> {
    let head = of.slice(0, 4)?;
    let (rank, first) = (usize::from(head[1]), if head[0] == 1 { 8 } else { 4 });
    if head[0] != 1 && head[3] == 2 {
        return Ok(None);
    }
    let lengths = (0..rank).map(|k| of.whole(first + 8 * k, 8, false));
    lengths.collect::<Result<_, _>>().map(Some)
}

/// Reads objects of a file within a budget.
pub(super) struct Reader<'a> {
    source: &'a Source,
    budget: &'a mut Budget,
}

impl<'a> Reader<'a> {
    pub(super) fn new(source: &'a Source, budget: &'a mut Budget) -> Self {
        Self { source, budget }
    }

    /// Counts decoded numbers before memory is taken for them.
    pub(super) fn take_numbers(&mut self, count: usize) -> Result<(), Error> {
        self.budget.numbers(count)
    }

    fn bytes(&mut self, at: u64, length: u64) -> Result<Cow<'a, [u8]>, Error> {
        self.source.check(at, length, FORMAT)?;
        self.budget.take(length.saturating_add(READ_COST))?;
        self.source.read(at, length as usize, FORMAT)
    }

    /// Bytes that begin with these letters.
    fn named(&mut self, at: u64, letters: &[u8], length: u64) -> Result<Cow<'a, [u8]>, Error> {
        let bytes = self.bytes(at, length)?;
        if bytes.starts_with(letters) {
            return Ok(bytes);
        }
        let expected = format!("the letters {}", utf8_or_windows(letters));
        Err(damaged(at, "another record", expected))
    }

    /// The group of the whole file.
    pub(super) fn root(&mut self) -> Result<Object, Error> {
        let head = self.bytes(0, 96)?;
        let head = Bytes::new(&head, FORMAT);
        let (version, sizes, base, root) = match head.data[8] {
            0 => (0, 13, 24, 64),
            1 => (1, 13, 28, 68),
            version => (version, 9, 12, 36),
        };
        if version > 3 {
            return Err(newer(&format!("a superblock of version {version}")));
        }
        if head.data[sizes..sizes + 2] != [8, 8] || head.whole(base, 8, false)? != 0 {
            let expected = "addresses of 8 bytes from the beginning of the file";
            return Err(damaged(sizes as u64, "other addresses", expected));
        }
        self.object(head.whole(root, 8, false)?)
    }

    /// The messages of the object at an address.
    pub(super) fn object(&mut self, at: u64) -> Result<Object, Error> {
        let head = self.bytes(at, 12)?;
        let head = Bytes::new(&head, FORMAT);
        let is_new = head.data.starts_with(b"OHDR");
        let (mut blocks, flags) = if is_new {
            let flags = head.data[5];
            let mut first = at + 6;
            first += if flags & 0x20 != 0 { 16 } else { 0 };
            first += if flags & 0x10 != 0 { 4 } else { 0 };
            let width = 1 << (flags & 3);
            let size = self.bytes(first, width)?;
            let size = Bytes::new(&size, FORMAT).whole(0, width as usize, false)?;
            (vec![(first + width, size)], flags)
        } else if head.data[0] == 1 {
            (vec![(at + 16, head.u32_le(8)? as u64)], 0)
        } else {
            return Err(damaged(at, "another record", "the header of an object"));
        };
        let mut messages = Vec::new();
        let mut k = 0;
        while let Some(&(block_at, length)) = blocks.get(k) {
            let block = self.bytes(block_at, length)?;
            let block = Bytes::new(&block, FORMAT);
            // Continued blocks of the newer kind have letters before and a checksum after them.
            let (mut from, end) = match (is_new, k) {
                (true, 1..) => (4, block.data.len().saturating_sub(4)),
                _ => (0, block.data.len()),
            };
            let head = match (is_new, flags & 4 != 0) {
                (false, _) => 8,
                (true, false) => 4,
                (true, true) => 6,
            };
            while from + head <= end {
                let (kind, size, shared) = if is_new {
                    let kind = u16::from(block.data[from]);
                    (kind, block.u16_le(from + 1)?, block.data[from + 3])
                } else {
                    let kind = block.u16_le(from)? as u16;
                    (kind, block.u16_le(from + 2)?, block.data[from + 4])
                };
                from += head;
                if from + size > end {
                    break;
                }
                let content = block.slice(from, size)?;
                from += size;
                if shared & 2 != 0 && matches!(kind, DATATYPE | DATASPACE | ATTRIBUTE | FILTERS) {
                    return Err(newer("shared types"));
                }
                if kind == CONTINUATION {
                    let next = Bytes::new(content, FORMAT);
                    blocks.push((next.whole(0, 8, false)?, next.whole(8, 8, false)?));
                    at_most(blocks.len(), MAX_BLOCKS, "blocks of an object's header")?;
                } else if kind != 0 {
                    messages.push((kind, content.to_vec()));
                }
            }
            k += 1;
        }
        Ok(Object(messages))
    }

    /// Names and addresses of the objects in a group.
    pub(super) fn links(&mut self, group: &Object) -> Result<Vec<(String, u64)>, Error> {
        let mut links = Vec::new();
        if let Some(table) = group.first(SYMBOL_TABLE) {
            let (tree, heap) = (table.whole(0, 8, false)?, table.whole(8, 8, false)?);
            let heap = self.named(heap, b"HEAP", 32)?;
            let heap = Bytes::new(&heap, FORMAT);
            let names = self.bytes(heap.whole(24, 8, false)?, heap.whole(8, 8, false)?)?;
            let mut tables = Vec::new();
            self.tree(tree, 0, 8, u8::MAX, &mut |_, child| {
                tables.push(child);
                at_most(tables.len(), MAX_ENTRIES, "objects in a group")
            })?;
            for table in tables {
                self.symbols(table, &names, &mut links)?;
            }
        }
        if let Some(info) = group.first(LINK_INFO) {
            let at = if info.slice(0, 2)?[1] & 1 != 0 { 10 } else { 2 };
            if info.whole(at, 8, false)? != NOWHERE {
                return Err(newer("many objects in one group"));
            }
        }
        for message in group.all(LINK) {
            links.extend(link(&message)?);
        }
        Ok(links)
    }

    /// The entries of a symbol table node.
    fn symbols(
        &mut self,
        at: u64,
        names: &[u8],
        links: &mut Vec<(String, u64)>,
    ) -> Result<(), Error> {
        let head = self.named(at, b"SNOD", 8)?;
        let count = u64::from(u16::from_le_bytes([head[6], head[7]]));
        let entries = self.bytes(at + 8, 40 * count)?;
        for entry in entries.chunks_exact(40) {
            let entry = Bytes::new(entry, FORMAT);
            let name = names.get(entry.u64_le(0)?..);
            let name = name.ok_or_else(|| damaged(at, "a name outside", "names of the group"))?;
            let end = name.iter().position(|of| *of == 0);
            let end = end.ok_or_else(|| damaged(at, "a name without end", "a zero after it"))?;
            self.budget.take(end as u64)?;
            links.push((utf8_or_windows(&name[..end]), entry.whole(8, 8, false)?));
            at_most(links.len(), MAX_CURVES, "objects in a group")?;
        }
        Ok(())
    }

    /// Visits the leaves of a B-tree of this kind: key and address of each.
    fn tree(
        &mut self,
        at: u64,
        kind: u8,
        key: usize,
        above: u8,
        visit: &mut dyn FnMut(&Bytes, u64) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let head = self.named(at, b"TREE", 24)?;
        let level = head[5];
        if head[4] != kind || level >= above {
            return Err(damaged(
                at,
                "another tree",
                "a lower level of the same tree",
            ));
        }
        let count = usize::from(u16::from_le_bytes([head[6], head[7]]));
        let entries = self.bytes(at + 24, (count * (key + 8)) as u64)?;
        for entry in entries.chunks_exact(key + 8) {
            let entry = Bytes::new(entry, FORMAT);
            let child = entry.whole(key, 8, false)?;
            if level == 0 {
                visit(&entry, child)?;
            } else {
                self.tree(child, kind, key, level, visit)?;
            }
        }
        Ok(())
    }

    /// The attributes of an object that are a text or a number.
    pub(super) fn attributes(&mut self, object: &Object) -> Result<Vec<(String, Value)>, Error> {
        if let Some(info) = object.first(ATTRIBUTE_INFO) {
            let at = if info.slice(0, 2)?[1] & 1 != 0 { 4 } else { 2 };
            if info.whole(at, 8, false)? != NOWHERE {
                return Err(newer("many attributes of one object"));
            }
        }
        let mut attributes = Vec::new();
        for message in object.all(ATTRIBUTE) {
            let version = message.slice(0, 8)?[0];
            let lengths = [2, 4, 6].map(|at| message.u16_le(at));
            let [name, kind, space] = lengths;
            let padded = |of: usize| {
                if version == 1 {
                    of.next_multiple_of(8)
                } else {
                    of
                }
            };
            let mut at = if version == 3 { 9 } else { 8 };
            let mut part = |length: usize| {
                let found = message.slice(at, length);
                at += padded(length);
                found
            };
            let (name, kind, space) = (part(name?)?, part(kind?)?, part(space?)?);
            if version > 1 && message.data[1] != 0 {
                continue;
            }
            let kind = Kind::parse(&Bytes::new(kind, FORMAT))?;
            let count = dimensions(&Bytes::new(space, FORMAT))?;
            if count.is_none_or(|of| of.iter().any(|length| *length != 1)) {
                continue;
            }
            let content = message.slice(at, kind.size())?;
            let value = match kind {
                Kind::Number(encoding) => encoding.all(content).next().map(Value::Number),
                Kind::Text(_) => Some(Value::Text(utf8_until_zero(content))),
                Kind::HeapText => Some(Value::Text(self.heap_text(content)?)),
                Kind::Other(_) => None,
            };
            attributes.extend(value.map(|of| (utf8_until_zero(name), of)));
        }
        Ok(attributes)
    }

    /// A text in a global heap, from its length and place.
    fn heap_text(&mut self, place: &[u8]) -> Result<String, Error> {
        let place = Bytes::new(place, FORMAT);
        let (length, at) = (place.u32_le(0)?, place.whole(4, 8, false)?);
        let wanted = place.u32_le(12)?;
        if length == 0 {
            return Ok(String::new());
        }
        let head = self.named(at, b"GCOL", 16)?;
        let size = Bytes::new(&head, FORMAT).whole(8, 8, false)?;
        let heap = self.bytes(at, size)?;
        let heap = Bytes::new(&heap, FORMAT);
        let mut from = 16;
        while let Ok(head) = heap.slice(from, 16) {
            let index = usize::from(u16::from_le_bytes([head[0], head[1]]));
            let size = heap.u64_le(from + 8)?;
            if index == wanted {
                return Ok(utf8_until_zero(heap.slice(from + 16, size.min(length))?));
            }
            // Index 0 is the free rest.
            if index == 0 {
                break;
            }
            let end = from.saturating_add(16).saturating_add(size);
            from = end.checked_next_multiple_of(8).unwrap_or(usize::MAX);
        }
        Err(damaged(
            at,
            format!("no text {wanted}"),
            "a text in this heap",
        ))
    }

    /// The numbers of a dataset of one dimension.
    pub(super) fn numbers(&mut self, dataset: &Object) -> Result<Vec<f64>, Error> {
        match self.table(dataset)? {
            ([_, 1], numbers) => Ok(numbers),
            _ => Err(newer("a table where a row of numbers is expected")),
        }
    }

    /// The lengths and numbers of a dataset of two dimensions, row by row; the second has length 1 if there
    /// is only one.
    pub(super) fn table(&mut self, dataset: &Object) -> Result<([usize; 2], Vec<f64>), Error> {
        let (Some(space), Some(kind), Some(layout)) = (
            dataset.first(DATASPACE),
            dataset.first(DATATYPE),
            dataset.first(LAYOUT),
        ) else {
            return Err(newer("a group where numbers are expected"));
        };
        let Kind::Number(encoding) = Kind::parse(&kind)? else {
            return Err(newer("a dataset of other things than numbers"));
        };
        let lengths = dimensions(&space)?.unwrap_or_else(|| vec![0]);
        let shape = match *lengths {
            [] => [1, 1],
            [points] => [points, 1],
            [rows, columns] => [rows, columns],
            _ => return Err(newer("a dataset of more than two dimensions")),
        };
        let count = shape[0].saturating_mul(shape[1]);
        self.budget.take(count.saturating_mul(8))?;
        let (shape, count) = (shape.map(|of| of as usize), count as usize);
        let size = encoding.size();
        let [version, class] = [layout.slice(0, 2)?[0], layout.data[1]];
        if !matches!(version, 3 | 4) {
            return Err(newer(&format!("a layout of version {version}")));
        }
        let wanted = count.saturating_mul(size);
        let mut numbers = Vec::with_capacity(count);
        match class {
            0 => numbers.extend(encoding.all(layout.slice(4, wanted)?)),
            1 if layout.whole(2, 8, false)? == NOWHERE => {}
            1 => {
                let raw = self.bytes(layout.whole(2, 8, false)?, wanted as u64)?;
                numbers.extend(encoding.all(&raw));
            }
            2 if version == 3 => {
                let filters = dataset.first(FILTERS);
                let filters = filters.map_or(Ok(Vec::new()), |of| filters_of(&of))?;
                numbers.resize(count, 0.0);
                self.chunks(
                    &layout,
                    &filters,
                    encoding,
                    lengths.len(),
                    shape,
                    &mut numbers,
                )?;
            }
            _ => return Err(newer("an index of chunks of a newer kind")),
        }
        // What was never written is 0.
        numbers.resize(count, 0.0);
        Ok((shape, numbers))
    }

    /// Reads the chunks of a dataset into its numbers.
    fn chunks(
        &mut self,
        layout: &Bytes,
        filters: &[Filter],
        encoding: Encoding,
        rank: usize,
        shape: [usize; 2],
        numbers: &mut [f64],
    ) -> Result<(), Error> {
        let tree = layout.whole(3, 8, false)?;
        let mut chunk = [1, 1];
        for (k, length) in chunk.iter_mut().enumerate().take(rank) {
            *length = layout.u32_le(11 + 4 * k)?;
        }
        let is_right = usize::from(layout.slice(2, 1)?[0]) == rank + 1
            && layout.u32_le(11 + 4 * rank)? == encoding.size();
        if !is_right || chunk.contains(&0) {
            let expected = "the dimensions and the size of the numbers";
            return Err(damaged(tree, "other chunks", expected));
        }
        if tree == NOWHERE {
            return Ok(());
        }
        let most = shape[0]
            .div_ceil(chunk[0])
            .saturating_mul(shape[1].div_ceil(chunk[1]));
        let mut places = Vec::new();
        // Size, filters that were left out, first number in each dimension.
        self.tree(tree, 1, 16 + 8 * rank, u8::MAX, &mut |entry, at| {
            let column = if rank == 2 { entry.u64_le(16)? } else { 0 };
            let first = [entry.u64_le(8)?, column];
            places.push((entry.u32_le(0)?, entry.u32_le(4)?, first, at));
            at_most(places.len(), most, "chunks of a dataset")
        })?;
        let length = chunk[0]
            .saturating_mul(chunk[1])
            .saturating_mul(encoding.size());
        for (size, left_out, first, at) in places {
            let raw = self.bytes(at, size as u64)?;
            self.budget.take(length as u64)?;
            let mut raw = raw.into_owned();
            for (k, filter) in filters.iter().enumerate().rev() {
                if left_out >> k & 1 == 0 {
                    raw = filter
                        .undo(raw, length)
                        .map_err(|of| damaged(at, of, "a whole chunk"))?;
                }
            }
            if raw.len() != length || first[0] >= shape[0] || first[1] >= shape[1] {
                let expected = format!("{length} bytes");
                return Err(damaged(at, "a chunk of another length", expected));
            }
            // The last chunks reach beyond the dataset.
            let columns = chunk[1].min(shape[1] - first[1]);
            let rows = numbers.chunks_exact_mut(shape[1]).skip(first[0]);
            let of_chunk = raw.chunks_exact(chunk[1] * encoding.size());
            for (row, of_chunk) in rows.zip(of_chunk) {
                let places = row[first[1]..first[1] + columns].iter_mut();
                places
                    .zip(encoding.all(of_chunk))
                    .for_each(|(number, value)| *number = value);
            }
        }
        Ok(())
    }
}

/// A text in UTF-8, with or without a zero at its end.
fn utf8_until_zero(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|of| *of == 0);
    utf8_or_windows(&bytes[..end.unwrap_or(bytes.len())])
}

/// A link to an object in the same file; `None` for other links.
fn link(of: &Bytes) -> Result<Option<(String, u64)>, Error> {
    let flags = of.slice(0, 2)?[1];
    let mut at = 2;
    let mut kind = 0;
    if flags & 8 != 0 {
        kind = of.slice(at, 1)?[0];
        at += 1;
    }
    at += if flags & 4 != 0 { 8 } else { 0 };
    at += usize::from(flags & 0x10 != 0);
    let width = 1 << (flags & 3);
    let length = of.whole(at, width, false)?;
    at += width;
    let name = of.slice(at, usize::try_from(length).unwrap_or(usize::MAX))?;
    if kind != 0 {
        return Ok(None);
    }
    let object = of.whole(at + name.len(), 8, false)?;
    Ok(Some((utf8_or_windows(name), object)))
}

/// A step by which chunks were packed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Filter {
    Deflate,
    /// Bytes of the same place in numbers of so many bytes together.
    Shuffle(usize),
    Fletcher32,
}

/// The filters of a dataset in the order of writing.
fn filters_of(of: &Bytes) -> Result<Vec<Filter>, Error> {
    let head = of.slice(0, 2)?;
    let (version, count) = (head[0], usize::from(head[1]));
    at_most(count, MAX_FILTERS, "filters of a dataset")?;
    let mut at = if version == 1 { 8 } else { 2 };
    let mut filters = Vec::new();
    for _ in 0..count {
        let id = of.u16_le(at)?;
        let has_name = version == 1 || id >= 256;
        at += 2;
        let mut name = 0;
        if has_name {
            name = of.u16_le(at)?;
            at += 2;
        }
        let values = of.u16_le(at + 2)?;
        at += 4;
        let name_at = at;
        at += if version == 1 {
            name.next_multiple_of(8)
        } else {
            name
        };
        let first = if values > 0 { of.u32_le(at)? } else { 0 };
        at += 4 * values;
        at += if version == 1 && values % 2 == 1 {
            4
        } else {
            0
        };
        filters.push(match id {
            1 => Filter::Deflate,
            2 => Filter::Shuffle(first),
            3 => Filter::Fletcher32,
            _ => {
                let name = until_zero(of.slice(name_at, name)?);
                return Err(FORMAT.unsupported(
                    format!("an HDF5 file packed by the filter {id} {name}"),
                    "only gzip, shuffle and fletcher32 are read",
                ));
            }
        });
    }
    Ok(filters)
}

impl Filter {
    /// Unpacks a chunk of at most so many bytes.
    fn undo(self, mut bytes: Vec<u8>, length: usize) -> Result<Vec<u8>, &'static str> {
        match self {
            Self::Deflate => {
                let inflate = miniz_oxide::inflate::decompress_to_vec_zlib_with_limit;
                // A checksum may be packed with the numbers.
                inflate(&bytes, length.saturating_add(4)).map_err(|_| "damaged compressed bytes")
            }
            Self::Shuffle(size) => {
                let count = bytes.len().checked_div(size).unwrap_or(0);
                let mut numbers = bytes.clone();
                for (k, byte) in bytes[..count * size].iter().enumerate() {
                    numbers[k % count * size + k / count] = *byte;
                }
                Ok(numbers)
            }
            Self::Fletcher32 => {
                let end = bytes
                    .len()
                    .checked_sub(4)
                    .ok_or("a chunk without its checksum")?;
                let stated = [bytes[end], bytes[end + 1], bytes[end + 2], bytes[end + 3]];
                bytes.truncate(end);
                if u32::from_le_bytes(stated) == fletcher32(&bytes) {
                    Ok(bytes)
                } else {
                    Err("a chunk with another checksum")
                }
            }
        }
    }
}

/// Fletcher's checksum of big-endian words of 16 bits.
fn fletcher32(bytes: &[u8]) -> u32 {
    let (mut first, mut second) = (0_u32, 0_u32);
    let fold = |of: u32| (of & 0xFFFF) + (of >> 16);
    // Sums of 360 words fit in 32 bits.
    for part in bytes.chunks(720) {
        for word in part.chunks(2) {
            let low = word.get(1).copied().unwrap_or(0);
            first += u32::from(u16::from_be_bytes([word[0], low]));
            second += first;
        }
        (first, second) = (fold(first), fold(second));
    }
    fold(second) << 16 | fold(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_fletcher() {
        // Fletcher-32 of `abcdef` and `abcdefgh` is usually given for little-endian words: the bytes of
        // each word are exchanged here.
        assert_eq!(fletcher32(b"badcfe"), 0x5650_2D2A);
        assert_eq!(fletcher32(b"badcfehg"), 0xEBE1_9591);
        assert_eq!(fletcher32(&[]), 0);
    }

    #[test]
    fn shuffled_bytes_are_put_back() {
        let shuffled = vec![1, 3, 5, 2, 4, 6, 7];
        let found = Filter::Shuffle(2).undo(shuffled, 7);
        assert_eq!(found, Ok(vec![1, 2, 3, 4, 5, 6, 7]));
        assert_eq!(Filter::Shuffle(0).undo(vec![1, 2], 2), Ok(vec![1, 2]));
    }
}
