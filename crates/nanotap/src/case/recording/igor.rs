//! Igor binary waves of version 5, in which Asylum Research writes curves (WaveMetrics, Technical
//! Note 003): a header, one column of numbers per channel, a note, the names of the channels.

use super::limits::{Budget, MAX_CHANNELS, MAX_TEXT};
use super::{Number, Recording, latin, slice};

/// Size of the header without the data.
const HEADER: usize = 384;
/// Length of the name of a channel.
const LABEL: usize = 32;
/// Beginnings of the names of Asylum Research's channels in m.
const LENGTHS: [&str; 5] = ["amp", "defl", "lvdt", "raw", "zsnsr"];

pub(super) fn parse(bytes: &[u8], budget: &mut Budget) -> Option<Recording> {
    let is_big = *bytes.first()? == 0;
    let whole = |at: usize, size: usize| -> Option<usize> {
        let number = Number::Signed(size).all(slice(bytes, at, size)?, is_big);
        let number = *number.first()?;
        (0.0..=f64::from(i32::MAX))
            .contains(&number)
            .then_some(number as usize)
    };
    if whole(0, 2)? != 5 {
        return None;
    }
    let [formula, note, data_units] = [8, 12, 16].map(|at| whole(at, 4));
    let mut units = data_units?;
    for k in 0..4 {
        units = units.checked_add(whole(20 + 4 * k, 4)?)?;
    }
    let labels = [36, 40].map(|at| whole(at, 4));
    let number = match whole(80, 2)? {
        2 => Number::Float(4),
        4 => Number::Float(8),
        8 => Number::Signed(1),
        0x10 => Number::Signed(2),
        0x20 => Number::Signed(4),
        0x48 => Number::Unsigned(1),
        0x50 => Number::Unsigned(2),
        0x60 => Number::Unsigned(4),
        _ => return None,
    };
    let (rows, channels) = (whole(132, 4)?, whole(136, 4)?);
    if rows == 0 || whole(140, 4)? > 1 {
        return None;
    }
    budget.at_most(channels, MAX_CHANNELS, "channels")?;
    for _ in 0..channels {
        budget.column(rows)?;
    }
    budget.at_most(note?, MAX_TEXT, "bytes in its note")?;
    let size = rows.checked_mul(channels)?.checked_mul(number.size())?;
    let values = number.all(slice(bytes, HEADER, size)?, is_big);
    let after = HEADER.checked_add(size)?.checked_add(formula?)?;
    let note_text = latin(slice(bytes, after, note?)?);
    let after = after
        .checked_add(note?)?
        .checked_add(units)?
        .checked_add(labels[0]?)?;
    let labels = slice(bytes, after, labels[1]?)?;
    // The first name is that of all channels together.
    let names: Vec<String> = labels.chunks_exact(LABEL).skip(1).map(text).collect();
    if channels == 0 || names.len() != channels {
        return None;
    }
    let columns = names
        .iter()
        .zip(values.chunks_exact(rows))
        .map(|(name, values)| {
            let lower = name.to_lowercase();
            let (header, factor) = if LENGTHS.iter().any(|of| lower.starts_with(of)) {
                (format!("{name} (nm)"), 1e9)
            } else if lower.starts_with("phas") {
                (format!("{name} (deg)"), 1.0)
            } else {
                (name.clone(), 1.0)
            };
            (header, values.iter().map(|value| value * factor).collect())
        });
    let lines = note_text
        .split(['\r', '\n'])
        .filter_map(|line| line.split_once(':'));
    let lines = lines.map(|(name, value)| (name.trim().to_owned(), value.trim().to_owned()));
    Some(Recording {
        columns: columns.collect(),
        directions: Vec::new(),
        notes: lines.filter(|(name, _)| !name.is_empty()).collect(),
    })
}

/// A text up to its first zero.
fn text(bytes: &[u8]) -> String {
    let end = bytes
        .iter()
        .position(|byte| *byte == 0)
        .unwrap_or(bytes.len());
    latin(&bytes[..end])
}
