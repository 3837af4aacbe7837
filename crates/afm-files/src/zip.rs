//! The files in a zip archive, stored or deflated, with zip64 (PKWARE, APPNOTE 6.3.10).
//!
//! An archive is refused before anything is unpacked if two files have one name or share bytes. The
//! archive itself stays where it is: only its directory is kept in memory.

use std::borrow::Cow;

use crate::bytes::Bytes;
use crate::error::Place;
use crate::limits::{Budget, MAX_ENTRIES, at_most};
use crate::source::{ReadAt, Source};
use crate::text::utf8_or_windows;
use crate::{Error, Format};

/// Longest comment of an archive, and its last record.
const LONGEST_END: u64 = 65_535 + 22;
/// Longest name of a file, in bytes.
const MAX_NAME: usize = 1024;
/// Longest record of the directory: name, extra field and comment have 16 bits each.
const MAX_RECORD: u64 = 46 + 3 * 65_535;
/// Bytes of the directory that are read together.
const PART: u64 = 1 << 20;
/// A local header without its name.
const LOCAL: usize = 30;
/// Bytes of the extra field that are read with the local header; longer ones are read again.
const USUAL_EXTRA: usize = 32;
/// Methods of compression.
const STORED: u16 = 0;
const DEFLATED: u16 = 8;
/// A number of 32 bits that stands for one in the zip64 field.
const IN_ZIP64: u64 = 0xFFFF_FFFF;

/// An archive: its bytes, and where its files are in them.
#[derive(Debug)]
pub(crate) struct Archive {
    source: Source,
    directory: Directory,
}

/// The files of an archive in the order of their names, without its folders.
#[derive(Debug, Default)]
pub(crate) struct Directory {
    /// All names, one after another.
    names: Vec<u8>,
    files: Vec<File>,
}

/// A file in an archive.
#[derive(Clone, Copy, Debug)]
struct File {
    name: u32,
    name_length: u16,
    method: u16,
    checksum: u32,
    /// Where its local header begins.
    header: u64,
    /// Where the next file's header, or the directory, begins.
    end: u64,
    packed: u64,
    size: u64,
}

fn damaged(at: u64, problem: &str, expected: &str) -> Error {
    Format::Zip.damaged(Place::Byte(at), problem, expected)
}

impl Directory {
    /// Reads the directory of an archive.
    pub(crate) fn read(source: &(impl ReadAt + ?Sized)) -> Result<Self, Error> {
        let end = end_record(source)?;
        let mut directory = Self::default();
        let (mut part, mut part_at) = (Vec::new(), 0);
        let mut count = 0;
        let mut at = end.first;
        let last = end.first.saturating_add(end.size);
        while at < last {
            count += 1;
            at_most(count, MAX_ENTRIES, "files in an archive")?;
            // A part holds at least one whole record.
            let part_end = part_at + part.len() as u64;
            if at.saturating_add(MAX_RECORD) > part_end && part_end < source.length() {
                let length = source.length().saturating_sub(at).min(PART);
                part = source.read(at, length as usize, Format::Zip)?.into_owned();
                part_at = at;
            }
            at += directory.record(&Bytes::new(&part, Format::Zip), part_at, at)?;
        }
        // Programs without zip64 write the last 16 bits of the count.
        if count as u64 & end.count_mask != end.count {
            let problem = format!("{count} files where the archive states {}", end.count);
            return Err(damaged(end.first, &problem, "the stated count"));
        }
        directory.check(end.first)?;
        Ok(directory)
    }

    /// Reads a record of the directory at a place; `part` are the archive's bytes from `part_at` on.
    /// Returns the record's length.
    fn record(&mut self, part: &Bytes, part_at: u64, at: u64) -> Result<u64, Error> {
        let here = (at - part_at) as usize;
        if part.slice(here, 4)? != b"PK\x01\x02" {
            return Err(damaged(at, "no record of a file", "one for each file"));
        }
        let number = |of: usize, size: usize| part.whole(here + of, size, false);
        let [name, extra, comment] = [
            part.u16_le(here + 28)?,
            part.u16_le(here + 30)?,
            part.u16_le(here + 32)?,
        ];
        at_most(name, MAX_NAME, "bytes in the name of an archive's file")?;
        let written = part.slice(here + 46, name)?;
        let mut places = [number(24, 4)?, number(20, 4)?, number(42, 4)?];
        widen(part, here + 46 + name, extra, &mut places)?;
        let [size, packed, header] = places;
        if !written.ends_with(b"/") {
            let begin = u32::try_from(self.names.len());
            let begin = begin.map_err(|_| damaged(at, "4 GiB of names", "shorter names"))?;
            self.names.extend_from_slice(written);
            self.files.push(File {
                name: begin,
                name_length: name as u16,
                method: number(10, 2)? as u16,
                checksum: number(16, 4)? as u32,
                header,
                end: 0,
                packed,
                size,
            });
        }
        Ok((46 + name + extra + comment) as u64)
    }

    /// Sorts the files; refuses two with one name, and files that share bytes.
    fn check(&mut self, directory: u64) -> Result<(), Error> {
        let Self { names, files } = self;
        files.sort_unstable_by_key(|of| of.header);
        let mut end = directory;
        for k in (0..files.len()).rev() {
            let file = files[k];
            // Its data follow its header, and what else is there is not another file's.
            let data = file
                .header
                .checked_add((LOCAL + usize::from(file.name_length)) as u64);
            let least = data.and_then(|of| of.checked_add(file.packed));
            if least.is_none_or(|of| of > end) {
                let name = utf8_or_windows(raw_name(names, &file));
                let problem = if k + 1 < files.len() {
                    "its bytes are also another file's"
                } else {
                    "its bytes reach into the directory"
                };
                return Err(Format::Zip.damaged(Place::Entry(name), problem, "its own"));
            }
            files[k].end = end;
            end = file.header;
        }
        files.sort_unstable_by(|a, b| raw_name(names, a).cmp(raw_name(names, b)));
        let same = (1..files.len())
            .find(|k| raw_name(names, &files[k - 1]) == raw_name(names, &files[*k]));
        match same {
            Some(k) => Err(self.damaged(k, "a second file of this name", "one")),
            None => Ok(()),
        }
    }

    fn raw_name(&self, file: usize) -> &[u8] {
        raw_name(&self.names, &self.files[file])
    }

    fn damaged(&self, file: usize, problem: &str, expected: &str) -> Error {
        let name = utf8_or_windows(self.raw_name(file));
        Format::Zip.damaged(Place::Entry(name), problem, expected)
    }

    /// The file of this name.
    pub(crate) fn find(&self, name: &str) -> Option<usize> {
        let of_file = |file: &File| raw_name(&self.names, file).cmp(name.as_bytes());
        self.files.binary_search_by(of_file).ok()
    }
}

fn raw_name<'a>(names: &'a [u8], file: &File) -> &'a [u8] {
    let begin = file.name as usize;
    &names[begin..begin + usize::from(file.name_length)]
}

impl Archive {
    pub(crate) fn open(source: Source) -> Result<Self, Error> {
        let directory = Directory::read(&source)?;
        Ok(Self { source, directory })
    }

    /// How many files there are, by which they are counted in the order of their names.
    pub(crate) fn count(&self) -> usize {
        self.directory.files.len()
    }

    /// The name of a file.
    pub(crate) fn name(&self, file: usize) -> String {
        utf8_or_windows(self.directory.raw_name(file))
    }

    /// The file of this name.
    pub(crate) fn find(&self, name: &str) -> Option<usize> {
        self.directory.find(name)
    }

    /// The bytes of a file, as many as it states.
    pub(crate) fn unpack(&self, file: usize, budget: &mut Budget) -> Result<Vec<u8>, Error> {
        let File {
            packed,
            size,
            method,
            checksum,
            ..
        } = self.directory.files[file];
        let damaged =
            |problem: &str, expected: &str| Err(self.directory.damaged(file, problem, expected));
        budget.take(size)?;
        // Blocks that are not compressed have 5 bytes more each.
        if packed > size.saturating_add(size / 16 + 65_536) {
            return damaged("more bytes packed than unpacked", "fewer");
        }
        let (record, data) = self.packed(file)?;
        let bytes = &record[data..data + packed as usize];
        let unpacked = match method {
            STORED if packed == size => bytes.to_vec(),
            STORED => return damaged("another length than stated", "the stated length"),
            DEFLATED => {
                let found =
                    miniz_oxide::inflate::decompress_to_vec_with_limit(bytes, size as usize);
                let whole = found.ok().filter(|bytes| bytes.len() as u64 == size);
                let Some(whole) = whole else {
                    let expected = format!("{size} bytes when unpacked");
                    return damaged("its compressed bytes are damaged", &expected);
                };
                whole
            }
            _ => {
                let problem = format!("compressed by method {method}");
                return damaged(&problem, "stored (0) or deflated (8)");
            }
        };
        if crc32fast::hash(&unpacked) == checksum {
            return Ok(unpacked);
        }
        damaged("its bytes have another checksum", "the stated one")
    }

    /// The compressed bytes of a file, and where they begin in these. They follow its local header,
    /// which names the same file.
    fn packed(&self, file: usize) -> Result<(Cow<'_, [u8]>, usize), Error> {
        let File {
            header,
            end,
            packed,
            ..
        } = self.directory.files[file];
        let name = self.directory.raw_name(file);
        let packed = packed as usize;
        let wanted = LOCAL + name.len() + USUAL_EXTRA + packed;
        let wanted = (wanted as u64).min(end - header) as usize;
        let record = self.source.read(header, wanted, Format::Zip)?;
        let length = |at: usize| usize::from(u16::from_le_bytes([record[at], record[at + 1]]));
        let (named, extra) = (length(26), length(28));
        if !record.starts_with(b"PK\x03\x04") || record.get(LOCAL..LOCAL + named) != Some(name) {
            let expected = "the header of the file that the directory names";
            return Err(damaged(header, "another record", expected));
        }
        let data = LOCAL + named + extra;
        if record.len() >= data + packed {
            return Ok((record, data));
        }
        if (data + packed) as u64 > end - header {
            let problem = "its bytes are also another file's";
            return Err(self.directory.damaged(file, problem, "its own"));
        }
        let found = self
            .source
            .read(header + data as u64, packed, Format::Zip)?;
        Ok((found, 0))
    }
}

/// What the end of an archive says of its directory.
struct End {
    /// How many files there are, in the bits of the mask.
    count: u64,
    count_mask: u64,
    /// Where the directory begins, and its length.
    first: u64,
    size: u64,
}

/// Finds the end of an archive, with zip64 where it has one.
fn end_record(source: &(impl ReadAt + ?Sized)) -> Result<End, Error> {
    let length = source.length();
    // The zip64 locator has 20 bytes before the last record.
    let first = length.saturating_sub(LONGEST_END + 20);
    let tail = source.read(first, (length - first) as usize, Format::Zip)?;
    let bytes = Bytes::new(&tail, Format::Zip);
    let mut ends = (0..tail.len().saturating_sub(21)).rev();
    let end = ends
        .find(|at| tail[*at..].starts_with(b"PK\x05\x06"))
        .ok_or_else(|| {
            let problem = "the archive ends without its directory";
            damaged(length, problem, "a whole file")
        })?;
    let locator = end.saturating_sub(20);
    if !tail[locator..].starts_with(b"PK\x06\x07") {
        return Ok(End {
            count: bytes.whole(end + 10, 2, false)?,
            count_mask: 0xFFFF,
            size: bytes.whole(end + 12, 4, false)?,
            first: bytes.whole(end + 16, 4, false)?,
        });
    }
    let wide = bytes.whole(locator + 8, 8, false)?;
    let record = source.read(wide, 56, Format::Zip)?;
    if !record.starts_with(b"PK\x06\x06") {
        return Err(damaged(wide, "no zip64 record", "the end of the directory"));
    }
    let record = Bytes::new(&record, Format::Zip);
    Ok(End {
        count: record.whole(32, 8, false)?,
        count_mask: u64::MAX,
        size: record.whole(40, 8, false)?,
        first: record.whole(48, 8, false)?,
    })
}

/// Replaces numbers that do not fit in 32 bits by those of the zip64 field, in its order.
fn widen(bytes: &Bytes, at: usize, length: usize, places: &mut [u64]) -> Result<(), Error> {
    let end = at + length;
    let mut field = at;
    while places.contains(&IN_ZIP64) && field + 4 <= end {
        let (kind, size) = (bytes.u16_le(field)?, bytes.u16_le(field + 2)?);
        if kind == 1 {
            let mut from = field + 4;
            for place in places.iter_mut().filter(|of| **of == IN_ZIP64) {
                *place = bytes.whole(from, 8, false)?;
                from += 8;
            }
            return Ok(());
        }
        field += 4 + size;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Limits;

    /// An archive of one stored file whose numbers are in the zip64 records.
    fn wide(content: &[u8]) -> Vec<u8> {
        let checksum = crc32fast::hash(content).to_le_bytes();
        let unknown = [0xFF; 4];
        let length = (content.len() as u64).to_le_bytes();
        let local = [
            &b"PK\x03\x04\x2d\0\0\0\0\0\0\0\0\0"[..],
            &checksum,
            &unknown,
            &unknown,
            b"\x01\0\0\0a",
        ];
        let mut file = [&local.concat()[..], content].concat();
        let directory = file.len() as u64;
        // Length, packed length, place of the local header.
        let extra = [&b"\x01\0\x18\0"[..], &length, &length, &[0; 8]].concat();
        let record = [
            &b"PK\x01\x02\x2d\0\x2d\0\0\0\0\0\0\0\0\0"[..],
            &checksum,
            &unknown,
            &unknown,
            b"\x01\0\x1c\0\0\0\0\0\0\0\0\0\0\0",
            &unknown,
            b"a",
        ];
        file.extend(record.concat());
        file.extend(extra);
        let end = file.len() as u64;
        file.extend(b"PK\x06\x06");
        file.extend([0; 28]);
        file.extend(1_u64.to_le_bytes());
        file.extend((end - directory).to_le_bytes());
        file.extend(directory.to_le_bytes());
        file.extend(b"PK\x06\x07\0\0\0\0");
        file.extend(end.to_le_bytes());
        file.extend([0; 4]);
        file.extend(b"PK\x05\x06\0\0\0\0\xFF\xFF\xFF\xFF");
        file.extend([0xFF; 8]);
        file.extend([0; 2]);
        file
    }

    #[test]
    fn numbers_of_64_bits_are_read() {
        let archive = Archive::open(Source::memory(wide(b"content"))).expect("an archive");
        let file = archive.find("a").expect("the file");
        let budget = &mut Budget::new(Limits::default());
        assert_eq!(archive.unpack(file, budget), Ok(b"content".to_vec()));
    }

    #[test]
    fn a_file_with_another_checksum_is_refused() {
        let mut bytes = wide(b"content");
        let at = bytes
            .windows(7)
            .position(|of| of == b"content")
            .expect("the content");
        bytes[at] = b'C';
        let archive = Archive::open(Source::memory(bytes)).expect("an archive");
        let refused = archive.unpack(0, &mut Budget::new(Limits::default()));
        let error = refused.expect_err("another checksum").to_string();
        assert!(
            error.contains("entry `a`") && error.contains("checksum"),
            "{error}"
        );
    }
}
