//! Where the bytes of a file are: in memory, or on a disk from which they are read as they are needed.

use std::borrow::Cow;
use std::fmt;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::{Mutex, PoisonError};

use crate::{Error, Format, Limits, Place};

/// Bytes that are read by their place.
pub(crate) trait ReadAt {
    /// How many bytes there are.
    fn length(&self) -> u64;

    /// So many bytes from this place on; an error of the format if the file ends before.
    fn read(&self, at: u64, length: usize, format: Format) -> Result<Cow<'_, [u8]>, Error>;

    /// Refuses bytes beyond the end of the file.
    fn check(&self, at: u64, length: u64, format: Format) -> Result<(), Error> {
        if at
            .checked_add(length)
            .is_some_and(|end| end <= self.length())
        {
            return Ok(());
        }
        let problem = format!("{length} bytes are needed here");
        let expected = format!("a file longer than {} bytes", self.length());
        Err(format.damaged(Place::Byte(at), problem, expected))
    }
}

impl ReadAt for [u8] {
    fn length(&self) -> u64 {
        self.len() as u64
    }

    fn read(&self, at: u64, length: usize, format: Format) -> Result<Cow<'_, [u8]>, Error> {
        self.check(at, length as u64, format)?;
        let at = at as usize;
        Ok(Cow::Borrowed(&self[at..at + length]))
    }
}

/// A file that is open for reading at any place.
trait Device: Read + Seek + Send {}

impl<D: Read + Seek + Send> Device for D {}

enum Kind {
    Memory(Vec<u8>),
    /// Threads take turns: only reading is locked, never unpacking.
    Device(Mutex<Box<dyn Device>>),
}

/// The bytes of a file.
pub(crate) struct Source {
    kind: Kind,
    length: u64,
}

impl fmt::Debug for Source {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            Kind::Memory(_) => "memory",
            Kind::Device(_) => "device",
        };
        write!(out, "{} bytes in {kind}", self.length)
    }
}

fn failed(error: &io::Error) -> Error {
    Error::Io {
        problem: error.to_string(),
    }
}

impl Source {
    pub(crate) fn memory(bytes: Vec<u8>) -> Self {
        Self {
            length: bytes.len() as u64,
            kind: Kind::Memory(bytes),
        }
    }

    pub(crate) fn device(mut file: impl Read + Seek + Send + 'static) -> Result<Self, Error> {
        let length = file.seek(SeekFrom::End(0)).map_err(|of| failed(&of))?;
        Ok(Self {
            kind: Kind::Device(Mutex::new(Box::new(file))),
            length,
        })
    }

    /// The first bytes, as many as there are up to `length`.
    pub(crate) fn beginning(&self, length: usize, format: Format) -> Result<Cow<'_, [u8]>, Error> {
        self.read(0, self.length.min(length as u64) as usize, format)
    }

    /// All bytes, for formats that are read as a whole.
    pub(crate) fn whole(self, limits: Limits, format: Format) -> Result<Vec<u8>, Error> {
        if let Kind::Memory(bytes) = self.kind {
            return Ok(bytes);
        }
        if self.length > limits.decoded_bytes {
            return Err(Error::Limit {
                quantity: "bytes of a file that is read as a whole",
                found: self.length,
                limit: limits.decoded_bytes,
            });
        }
        Ok(self.read(0, self.length as usize, format)?.into_owned())
    }
}

impl ReadAt for Source {
    fn length(&self) -> u64 {
        self.length
    }

    fn read(&self, at: u64, length: usize, format: Format) -> Result<Cow<'_, [u8]>, Error> {
        let device = match &self.kind {
            Kind::Memory(bytes) => return bytes.as_slice().read(at, length, format),
            Kind::Device(device) => device,
        };
        self.check(at, length as u64, format)?;
        let mut bytes = vec![0; length];
        let mut device = device.lock().unwrap_or_else(PoisonError::into_inner);
        let found = device
            .seek(SeekFrom::Start(at))
            .and_then(|_| device.read_exact(&mut bytes));
        found.map_err(|of| failed(&of))?;
        Ok(Cow::Owned(bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_a_device_are_those_in_memory() {
        let bytes: Vec<u8> = (0..100).collect();
        let sources = [
            Source::memory(bytes.clone()),
            Source::device(io::Cursor::new(bytes)).expect("a device"),
        ];
        for source in sources {
            let read = |at, length| source.read(at, length, Format::Zip);
            assert_eq!(*read(98, 2).expect("bytes"), [98, 99]);
            let error = read(98, 3).expect_err("beyond the end").to_string();
            assert!(error.contains("byte 98: 3 bytes are needed"), "{error}");
            assert!(read(u64::MAX, 2).is_err());
        }
    }

    #[test]
    fn a_device_that_fails_is_an_error() {
        struct Broken;
        impl Read for Broken {
            fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
                Err(io::Error::other("the disk is gone"))
            }
        }
        impl Seek for Broken {
            fn seek(&mut self, _: SeekFrom) -> io::Result<u64> {
                Ok(10)
            }
        }
        let source = Source::device(Broken).expect("a device");
        let error = source.read(0, 2, Format::Zip).expect_err("broken");
        assert!(error.to_string().contains("the disk is gone"), "{error}");
    }
}
