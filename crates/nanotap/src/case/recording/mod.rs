//! Files that instruments write, as tables: Asylum Research's `.ibw`, JPK's `.jpk-force` and
//! Nanosurf's `.nid`.
//!
//! Lengths become nm, forces nN, phases degrees; a column `direction` says approach or retract where
//! the file does. The notes of the file are kept by name, with the names of Asylum Research for what
//! all of them have: `SpringConstant` in N/m, `InvOLS` in m/V, `ThermalFrequency` in Hz, `ThermalQ`.
//!
//! A file may have any bytes: sizes are checked, and kept within the [limits], before memory is taken.
//! Nothing here depends on cases or models.

mod igor;
mod jpk;
mod limits;
mod nanosurf;
mod zip;

use limits::{Budget, MAX_ROWS};

/// Stiffness of the lever, N/m.
const SPRING_CONSTANT: &str = "SpringConstant";
/// Deflection per volt of the detector, m/V.
const SENSITIVITY: &str = "InvOLS";

/// Why an instrument's file is not read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum RecordingError {
    /// It is of another kind than its name says, or incomplete.
    #[error("it is not {0}, or it is damaged")]
    Damaged(&'static str),
    /// It exceeds one of the limits.
    #[error("it has more than {most} {items}")]
    TooMany {
        /// The limit.
        most: usize,
        /// What there are too many of.
        items: &'static str,
    },
    /// Two files of an archive have this name.
    #[error("its archive has two files called `{0}`")]
    Repeated(String),
    /// A stored file of an archive has another length than it states.
    #[error("the file `{0}` in its archive is not as long as stated")]
    Unequal(String),
    /// Two files of an archive share bytes.
    #[error("two files in its archive share bytes")]
    Overlapping,
}

/// Reads the bytes of a file with a known extension; `None` if it is read as text.
pub(super) fn parse(name: &str, bytes: &[u8]) -> Option<Result<Recording, RecordingError>> {
    let extension = std::path::Path::new(name).extension()?.to_str()?;
    let budget = &mut Budget::default();
    let (parsed, kind) = match extension.to_lowercase().as_str() {
        "ibw" => (
            igor::parse(bytes, budget),
            "a curve of Asylum Research (Igor binary wave 5)",
        ),
        "jpk-force" => (jpk::parse(bytes, budget), "a force curve of JPK"),
        "nid" => (nanosurf::parse(bytes, budget), "a spectroscopy of Nanosurf"),
        _ => return None,
    };
    let whole = parsed.and_then(Recording::finish);
    let refusal = std::mem::take(budget).refusal();
    Some(whole.ok_or_else(|| refusal.unwrap_or(RecordingError::Damaged(kind))))
}

/// Columns of numbers of one length, with the directions of their rows.
#[derive(Debug, Default)]
pub(super) struct Recording {
    /// Header of each column, with its unit, and its numbers.
    pub(super) columns: Vec<(String, Vec<f64>)>,
    /// `approach` or `retract` for each row; empty if the file does not say.
    pub(super) directions: Vec<&'static str>,
    /// Notes of the file: name and text.
    pub(super) notes: Vec<(String, String)>,
}

impl Recording {
    fn rows(&self) -> usize {
        self.columns
            .iter()
            .map(|(_, of)| of.len())
            .min()
            .unwrap_or(0)
    }

    /// The rows that were recorded; `None` if there are none.
    fn finish(mut self) -> Option<Self> {
        let rows = self.rows();
        let is_whole = |row: usize| self.columns.iter().all(|(_, of)| of[row].is_finite());
        // Rows that were not recorded are not numbers.
        let kept: Vec<bool> = (0..rows).map(is_whole).collect();
        if !kept.contains(&true) {
            return None;
        }
        if self.directions.len() != rows {
            self.directions.clear();
        }
        for (_, column) in &mut self.columns {
            let mut row = kept.iter();
            column.retain(|_| row.next() == Some(&true));
        }
        let mut row = kept.iter();
        self.directions.retain(|_| row.next() == Some(&true));
        Some(self)
    }

    /// Adds rows of some channels, by name, in this direction. Channels that the rows before have not
    /// are left out, as are those that these rows have not.
    fn extend(
        &mut self,
        channels: &[(String, Vec<f64>)],
        direction: &'static str,
        budget: &mut Budget,
    ) -> Option<()> {
        let rows = channels.iter().map(|(_, of)| of.len()).min().unwrap_or(0);
        let before = self.directions.len();
        budget.at_most(before + rows, MAX_ROWS, "rows")?;
        if before == 0 {
            self.columns = channels
                .iter()
                .map(|(name, _)| (name.clone(), Vec::new()))
                .collect();
        }
        self.columns.retain_mut(|(name, column)| {
            let found = channels.iter().find(|(other, _)| other == name);
            found.is_some_and(|(_, values)| {
                column.extend(&values[..rows]);
                true
            })
        });
        self.directions.extend(std::iter::repeat_n(direction, rows));
        Some(())
    }
}

/// The header of a column and the factor of its numbers, for a unit of a file.
fn in_usual_unit(name: &str, unit: &str) -> (String, f64) {
    let (unit, factor) = match unit {
        "m" => ("nm", 1e9),
        "N" => ("nN", 1e9),
        "°" | "deg" => ("deg", 1.0),
        "rad" => ("deg", 1f64.to_degrees()),
        other => (other, 1.0),
    };
    let header = if unit.is_empty() {
        name.to_owned()
    } else {
        format!("{name} ({unit})")
    };
    (header, factor)
}

/// Whole numbers and floating-point numbers of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Number {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

impl Number {
    const fn size(self) -> usize {
        match self {
            Self::Signed(size) | Self::Unsigned(size) | Self::Float(size) => size,
        }
    }

    /// The numbers in some bytes; a part of one at the end does not count.
    fn all(self, bytes: &[u8], is_big: bool) -> Vec<f64> {
        let one = |bytes: &[u8]| {
            let mut raw = [0_u8; 8];
            for (k, byte) in bytes.iter().enumerate() {
                raw[if is_big { bytes.len() - 1 - k } else { k }] = *byte;
            }
            let bits = u64::from_le_bytes(raw);
            let unused = 64 - 8 * bytes.len() as u32;
            match self {
                Self::Signed(_) => (((bits << unused) as i64) >> unused) as f64,
                Self::Unsigned(_) => bits as f64,
                Self::Float(4) => f64::from(f32::from_bits(bits as u32)),
                Self::Float(_) => f64::from_bits(bits),
            }
        };
        bytes.chunks_exact(self.size()).map(one).collect()
    }
}

/// Bytes from one place on; `None` beyond the end.
fn slice(bytes: &[u8], at: usize, length: usize) -> Option<&[u8]> {
    bytes.get(at..at.checked_add(length)?)
}

/// A text in Latin-1, in which instruments write.
fn latin(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| char::from(*byte)).collect()
}

#[cfg(test)]
mod samples;
#[cfg(test)]
mod tests;
