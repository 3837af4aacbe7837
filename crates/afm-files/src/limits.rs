//! Upper limits. A small file may state any size, and a compressed one may hold a thousand times its
//! length: whatever a file states, reading it stays within these.

use crate::Error;

/// What a file may hold at most. Everything else is limited by constants, far above real files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Bytes that one step decodes: opening a file (headers, images, spectra, the files in an archive)
    /// or decoding one of its curves. Default: 256 MiB. A file that [`open`](crate::open) cannot leave on
    /// the disk may have as many bytes; maps may have more.
    pub decoded_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            decoded_bytes: 256 << 20,
        }
    }
}

impl Limits {
    /// Limits with so many decoded bytes a step.
    pub fn with_decoded_bytes(decoded_bytes: u64) -> Self {
        Self { decoded_bytes }
    }
}

/// Entries of an archive, or records of a file: 256 × 256 curves of two segments with eight channels
/// each are 1.2 million.
pub(crate) const MAX_ENTRIES: usize = 1 << 21;
/// Segments of a curve.
pub(crate) const MAX_SEGMENTS: usize = 1000;
/// Curves of a file.
pub(crate) const MAX_CURVES: usize = 1 << 18;
/// Channels of a segment, images of a file.
pub(crate) const MAX_CHANNELS: usize = 256;
/// Frames of a series of images.
pub(crate) const MAX_IMAGES: usize = 1 << 16;
/// Bytes of a header.
pub(crate) const MAX_HEADER: usize = 16 << 20;
/// Bytes of a line of a header.
pub(crate) const MAX_LINE: usize = 64 << 10;
/// Properties of one header.
pub(crate) const MAX_PROPERTIES: usize = 1 << 18;

/// Refuses more than `limit`.
pub(crate) fn at_most(found: usize, limit: usize, quantity: &'static str) -> Result<(), Error> {
    if found <= limit {
        return Ok(());
    }
    Err(Error::Limit {
        quantity,
        found: found as u64,
        limit: limit as u64,
    })
}

/// Bytes that a step may still decode.
#[derive(Debug)]
pub(crate) struct Budget {
    used: u64,
    limit: u64,
}

impl Budget {
    pub(crate) fn new(limits: Limits) -> Self {
        Self {
            used: 0,
            limit: limits.decoded_bytes,
        }
    }

    /// Counts bytes before memory is taken for them.
    pub(crate) fn take(&mut self, bytes: u64) -> Result<(), Error> {
        self.used = self.used.saturating_add(bytes);
        if self.used <= self.limit {
            return Ok(());
        }
        Err(Error::Limit {
            quantity: "decoded bytes",
            found: self.used,
            limit: self.limit,
        })
    }

    /// Counts so many decoded numbers (8 bytes each).
    pub(crate) fn numbers(&mut self, count: usize) -> Result<(), Error> {
        self.take((count as u64).saturating_mul(8))
    }
}
