//! Limits of what is read from an instrument's file. A small file may state any size, and a
//! compressed one may hold a thousand times its length: whatever a file says, reading it takes some
//! hundred megabytes and a second at most.

use super::RecordingError;

/// Most files in an archive; a force curve has about ten for each segment.
pub(super) const MAX_FILES: usize = 10_000;
/// Longest name of a file in an archive, in bytes.
pub(super) const MAX_NAME: usize = 1024;
/// Most bytes of all files in an archive, unpacked.
pub(super) const MAX_UNPACKED: usize = 64 << 20;
/// Most bytes of a header or a note.
pub(super) const MAX_TEXT: usize = 4 << 20;
/// Most bytes of all properties (names, values, and the memory of each entry), with those that
/// references repeat; segments of real files have some hundred kilobytes.
const MAX_PROPERTIES: usize = 64 << 20;
/// Memory of an entry of a map, added to the lengths of its name and value.
const ENTRY: usize = 100;
/// Most rows of a recording.
pub(super) const MAX_ROWS: usize = 1_000_000;
/// Most numbers of a recording, in all columns.
const MAX_NUMBERS: usize = 8_000_000;
/// Most channels of a recording or of a segment.
pub(super) const MAX_CHANNELS: usize = 1000;
/// Most segments of a force curve, or groups of channels.
pub(super) const MAX_SEGMENTS: usize = 1000;
/// Most conversions of a channel in sequence.
pub(super) const MAX_CONVERSIONS: usize = 8;

/// What of these limits a file has used up, and the reason if it exceeds one. A method that returns
/// `None` has noted the reason.
#[derive(Debug, Default)]
pub(super) struct Budget {
    properties: usize,
    numbers: usize,
    refusal: Option<RecordingError>,
}

impl Budget {
    /// Notes why the file is refused; the first reason counts.
    pub(super) fn refuse<T>(&mut self, reason: RecordingError) -> Option<T> {
        self.refusal.get_or_insert(reason);
        None
    }

    /// Refuses more than `most` items.
    pub(super) fn at_most(&mut self, count: usize, most: usize, items: &'static str) -> Option<()> {
        if count <= most {
            return Some(());
        }
        self.refuse(RecordingError::TooMany { most, items })
    }

    /// Counts a property of these lengths.
    pub(super) fn property(&mut self, name: usize, value: usize) -> Option<()> {
        self.properties = self.properties.saturating_add(name + value + ENTRY);
        self.at_most(self.properties, MAX_PROPERTIES, "bytes of properties")
    }

    /// Counts the numbers of a column with so many rows.
    pub(super) fn column(&mut self, rows: usize) -> Option<()> {
        self.at_most(rows, MAX_ROWS, "rows")?;
        self.numbers = self.numbers.saturating_add(rows);
        self.at_most(self.numbers, MAX_NUMBERS, "numbers")
    }

    /// Why the file is refused.
    pub(super) fn refusal(self) -> Option<RecordingError> {
        self.refusal
    }
}
