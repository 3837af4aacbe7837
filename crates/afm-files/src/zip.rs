//! The files in a zip archive, stored or deflated, with zip64 (PKWARE, APPNOTE 6.3.10).
//!
//! An archive is refused before anything is unpacked if two files have one name or share bytes, or if
//! a stored file has another length than it states.

use crate::bytes::Bytes;
use crate::error::Place;
use crate::limits::{Budget, MAX_ENTRIES, at_most};
use crate::text::utf8_or_windows;
use crate::{Error, Format};

/// Longest comment of an archive, and its last record.
const LONGEST_END: usize = 65_535 + 22;
/// Longest name of a file, in bytes.
const MAX_NAME: usize = 1024;
/// Methods of compression.
const STORED: usize = 0;
const DEFLATED: usize = 8;
/// A number of 32 bits that stands for one in the zip64 field.
const IN_ZIP64: usize = 0xFFFF_FFFF;

/// An archive: its bytes, and where its files are in them.
#[derive(Debug)]
pub(crate) struct Archive<B> {
    bytes: B,
    /// In the order of their names.
    files: Vec<File>,
}

/// A file in an archive, as places in the archive's bytes.
#[derive(Clone, Copy, Debug)]
struct File {
    name: (usize, usize),
    packed: (usize, usize),
    size: usize,
    method: usize,
    checksum: u32,
}

fn damaged(at: usize, problem: &str, expected: &str) -> Error {
    Format::Zip.at_byte(at, problem, expected)
}

impl<B: AsRef<[u8]>> Archive<B> {
    /// Reads the directory of an archive.
    pub(crate) fn open(bytes: B) -> Result<Self, Error> {
        let files = directory(&Bytes::new(bytes.as_ref(), Format::Zip))?;
        let archive = Self { bytes, files };
        archive.check()?;
        Ok(archive)
    }

    /// Refuses two files with one name, and files that share bytes.
    fn check(&self) -> Result<(), Error> {
        let same = (1..self.files.len()).find(|k| self.raw_name(k - 1) == self.raw_name(*k));
        if let Some(k) = same {
            return Err(self.damaged(k, "a second file of this name", "one"));
        }
        let mut by_place: Vec<usize> = (0..self.files.len()).collect();
        by_place.sort_unstable_by_key(|k| self.files[*k].packed);
        for two in by_place.windows(2) {
            let [(at, length), (next, _)] = [two[0], two[1]].map(|k| self.files[k].packed);
            if next < at + length {
                return Err(self.damaged(two[1], "its bytes are also another file's", "its own"));
            }
        }
        Ok(())
    }

    fn damaged(&self, file: usize, problem: &str, expected: &str) -> Error {
        Format::Zip.damaged(Place::Entry(self.name(file)), problem, expected)
    }

    fn raw_name(&self, file: usize) -> &[u8] {
        let (at, length) = self.files[file].name;
        &self.bytes.as_ref()[at..at + length]
    }

    /// How many files there are, by which they are counted in the order of their names.
    pub(crate) fn count(&self) -> usize {
        self.files.len()
    }

    /// The name of a file.
    pub(crate) fn name(&self, file: usize) -> String {
        utf8_or_windows(self.raw_name(file))
    }

    /// The file of this name.
    pub(crate) fn find(&self, name: &str) -> Option<usize> {
        let of_file = |file: &File| {
            let (at, length) = file.name;
            self.bytes.as_ref()[at..at + length].cmp(name.as_bytes())
        };
        self.files.binary_search_by(of_file).ok()
    }

    /// The bytes of a file, as many as it states.
    pub(crate) fn unpack(&self, file: usize, budget: &mut Budget) -> Result<Vec<u8>, Error> {
        let File {
            packed: (at, length),
            size,
            method,
            checksum,
            ..
        } = self.files[file];
        let packed = &self.bytes.as_ref()[at..at + length];
        budget.take(size as u64)?;
        let unpacked = match method {
            STORED if length == size => packed.to_vec(),
            STORED => {
                return Err(self.damaged(file, "another length than stated", "the stated length"));
            }
            DEFLATED => {
                let unpacked = miniz_oxide::inflate::decompress_to_vec_with_limit(packed, size);
                let whole = unpacked.ok().filter(|bytes| bytes.len() == size);
                whole.ok_or_else(|| {
                    let expected = format!("{size} bytes when unpacked");
                    self.damaged(file, "its compressed bytes are damaged", &expected)
                })?
            }
            _ => {
                let problem = format!("compressed by method {method}");
                return Err(self.damaged(file, &problem, "stored (0) or deflated (8)"));
            }
        };
        if crc32fast::hash(&unpacked) == checksum {
            Ok(unpacked)
        } else {
            Err(self.damaged(file, "its bytes have another checksum", "the stated one"))
        }
    }
}

/// The files of an archive in the order of their names, without its folders.
fn directory(bytes: &Bytes) -> Result<Vec<File>, Error> {
    let (count, mut at) = end_record(bytes)?;
    at_most(count, MAX_ENTRIES, "files in an archive")?;
    // Each record has 46 bytes: a false count takes no memory.
    let mut files = Vec::with_capacity(count.min(bytes.data.len() / 46));
    for _ in 0..count {
        if bytes.slice(at, 4)? != b"PK\x01\x02" {
            return Err(damaged(at, "no record of a file", "one for each file"));
        }
        let method = bytes.u16_le(at + 10)?;
        let checksum = bytes.whole(at + 16, 4, false)? as u32;
        let [packed, size] = [bytes.u32_le(at + 20)?, bytes.u32_le(at + 24)?];
        let [name, extra, comment] = [
            bytes.u16_le(at + 28)?,
            bytes.u16_le(at + 30)?,
            bytes.u16_le(at + 32)?,
        ];
        at_most(name, MAX_NAME, "bytes in the name of an archive's file")?;
        let written = bytes.slice(at + 46, name)?;
        let mut places = [size, packed, bytes.u32_le(at + 42)?];
        widen(bytes, at + 46 + name, extra, &mut places)?;
        let [size, packed, header] = places;
        if !written.ends_with(b"/") {
            let data = data_of(bytes, header, written)?;
            bytes.slice(data, packed)?;
            files.push(File {
                name: (at + 46, name),
                packed: (data, packed),
                size,
                method,
                checksum,
            });
        }
        at += 46 + name + extra + comment;
    }
    files.sort_unstable_by(|a, b| {
        let [a, b] = [a, b].map(|of| &bytes.data[of.name.0..of.name.0 + of.name.1]);
        a.cmp(b)
    });
    Ok(files)
}

/// How many files the archive states, and where its directory begins.
fn end_record(bytes: &Bytes) -> Result<(usize, usize), Error> {
    let length = bytes.data.len();
    let first = length.saturating_sub(LONGEST_END);
    let mut ends = (first..length.saturating_sub(21)).rev();
    let end = ends
        .find(|at| bytes.data[*at..].starts_with(b"PK\x05\x06"))
        .ok_or_else(|| {
            damaged(
                length,
                "the archive ends without its directory",
                "a whole file",
            )
        })?;
    let (count, at) = (bytes.u16_le(end + 10)?, bytes.u32_le(end + 16)?);
    let locator = end.saturating_sub(20);
    if !bytes.data[locator..].starts_with(b"PK\x06\x07") {
        return Ok((count, at));
    }
    let wide = bytes.u64_le(locator + 8)?;
    if bytes.slice(wide, 4)? != b"PK\x06\x06" {
        return Err(damaged(wide, "no zip64 record", "the end of the directory"));
    }
    bytes.slice(wide, 56)?;
    Ok((bytes.u64_le(wide + 32)?, bytes.u64_le(wide + 48)?))
}

/// Replaces numbers that do not fit in 32 bits by those of the zip64 field, in its order.
fn widen(bytes: &Bytes, at: usize, length: usize, places: &mut [usize]) -> Result<(), Error> {
    let end = at + length;
    let mut field = at;
    while places.contains(&IN_ZIP64) && field + 4 <= end {
        let (kind, size) = (bytes.u16_le(field)?, bytes.u16_le(field + 2)?);
        if kind == 1 {
            let mut from = field + 4;
            for place in places.iter_mut().filter(|of| **of == IN_ZIP64) {
                *place = bytes.u64_le(from)?;
                from += 8;
            }
            return Ok(());
        }
        field += 4 + size;
    }
    Ok(())
}

/// Where the bytes of a file begin: after its local header, which names the same file.
fn data_of(bytes: &Bytes, header: usize, name: &[u8]) -> Result<usize, Error> {
    let fixed = bytes.slice(header, 30)?;
    let length = |at: usize| usize::from(u16::from_le_bytes([fixed[at], fixed[at + 1]]));
    let (named, extra) = (length(26), length(28));
    if !fixed.starts_with(b"PK\x03\x04") || bytes.slice(header + 30, named)? != name {
        let expected = "the header of the file that the directory names";
        return Err(damaged(header, "another record", expected));
    }
    Ok(header + 30 + named + extra)
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
        let archive = Archive::open(wide(b"content")).expect("an archive");
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
        let archive = Archive::open(bytes).expect("an archive");
        let refused = archive.unpack(0, &mut Budget::new(Limits::default()));
        let error = refused.expect_err("another checksum").to_string();
        assert!(
            error.contains("entry `a`") && error.contains("checksum"),
            "{error}"
        );
    }
}
