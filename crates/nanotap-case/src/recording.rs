//! Files that instruments write, as tables: the first curve of a file, read by `afm-files`.
//!
//! Lengths become nm, forces nN, phases degrees; a column `direction` says approach or retract where
//! the file does. Notes have the names of Asylum Research for what all formats have: `SpringConstant`
//! in N/m, `InvOLS` in m/V.

use std::path::Path;

use afm_files::{Curve, Document, Format, Segment, Style, recognise};

/// Stiffness of the lever, N/m.
const SPRING_CONSTANT: &str = "SpringConstant";
/// Deflection per volt of the detector, m/V.
const SENSITIVITY: &str = "InvOLS";
/// Most numbers of a curve, in all channels: 24 bytes of memory each in a table.
const MAX_NUMBERS: usize = 8_000_000;
/// Extensions of files that are not texts, and what such a file is.
const KINDS: [(&str, &str); 5] = [
    ("ibw", "a curve of Asylum Research (Igor binary wave 5)"),
    ("jpk-force", "a force curve of JPK"),
    ("jpk-force-map", "a force map of JPK"),
    ("nid", "a spectroscopy of Nanosurf"),
    ("spm", "a file of Bruker"),
];

/// Why an instrument's file is not read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum RecordingError {
    /// Its content is not what its name says.
    #[error("it is not {0}, or it is damaged")]
    Other(&'static str),
    /// It is damaged, not supported, or exceeds a limit.
    #[error(transparent)]
    File(#[from] afm_files::Error),
    /// It has images or spectra only.
    #[error("it has {images} images and {spectra} spectra ({format}), but no curve")]
    NoCurve {
        format: Format,
        images: usize,
        spectra: usize,
    },
    /// Its curve is too long for a table.
    #[error("its curve has {0} numbers; {MAX_NUMBERS} at most are read")]
    TooLong(usize),
    /// Its curve has neither an approach nor a retract with numbers.
    #[error("its curve has no complete row in approach and retract")]
    NoRows,
}

/// The first curve of an instrument's file: columns of numbers of one length.
#[derive(Debug, Default)]
pub(super) struct Recording {
    /// Header of each column, with its unit, and its numbers.
    pub(super) columns: Vec<(String, Vec<f64>)>,
    /// `approach` or `retract` for each row; empty if the file does not say.
    pub(super) directions: Vec<&'static str>,
    /// Notes of the file: name and text.
    pub(super) notes: Vec<(String, String)>,
    /// What the reader says of the curve, such as which height is the distance.
    pub(super) remarks: Vec<String>,
}

/// Whether a file is an instrument's, by its content or, if that is unknown, by its name.
pub(super) fn is_recording(name: &str, bytes: &[u8]) -> bool {
    recognise(bytes).is_some() || kind(name).is_some()
}

fn kind(name: &str) -> Option<&'static str> {
    let extension = Path::new(name).extension()?.to_str()?.to_lowercase();
    let known = KINDS.iter().find(|(of, _)| *of == extension);
    known.map(|(_, kind)| *kind)
}

/// Reads a curve of a file, by its number from 0; without one the first.
pub(super) fn parse(
    name: &str,
    bytes: Vec<u8>,
    number: Option<usize>,
) -> Result<Recording, RecordingError> {
    if let (None, Some(kind)) = (recognise(&bytes), kind(name)) {
        return Err(RecordingError::Other(kind));
    }
    let document = afm_files::read(bytes)?;
    let mut recording = of_document(&document, number.unwrap_or(0))?;
    let count = document.curve_count();
    if count > 1 {
        let which = number.map_or_else(
            || "the first of its".to_owned(),
            |number| format!("curve {number} (from 0) of its"),
        );
        recording.remarks.push(format!(
            "{which} {count} curves is read; the option `curve` selects one"
        ));
    }
    Ok(recording)
}

/// A curve of a file that is open, by its number from 0.
pub(super) fn of_document(document: &Document, number: usize) -> Result<Recording, RecordingError> {
    if document.curve_count() == 0 {
        return Err(RecordingError::NoCurve {
            format: document.format,
            images: document.images.len(),
            spectra: document.spectra.len(),
        });
    }
    let curve = document.curve(number)?;
    let segments = curve.segments.iter();
    let numbers = segments.map(|of| of.points() * of.channels.len()).sum();
    if numbers > MAX_NUMBERS {
        return Err(RecordingError::TooLong(numbers));
    }
    let mut recording = Recording::of(&curve);
    recording.keep_whole_rows();
    if recording.columns.iter().all(|(_, of)| of.is_empty()) {
        return Err(RecordingError::NoRows);
    }
    recording.notes = notes(document, &curve);
    recording.remarks.extend(curve.notes);
    Ok(recording)
}

impl Recording {
    /// Rows of approach and retract, or of a curve that is not cut into segments; channels that all of
    /// these have.
    fn of(curve: &Curve) -> Self {
        let direction = |of: &Segment| match of.style {
            Style::Approach => Some("approach"),
            Style::Retract => Some("retract"),
            _ => None,
        };
        let moves = |of: &&Segment| of.points() > 0 && direction(of).is_some();
        let mut segments: Vec<&Segment> = curve.segments.iter().filter(moves).collect();
        let mut recording = Self::default();
        if segments.is_empty() {
            let unsplit = curve
                .segments
                .iter()
                .filter(|of| of.style == Style::Unsplit);
            segments.extend(unsplit.take(1));
        } else if segments.len() < curve.segments.len() {
            let left = curve.segments.len() - segments.len();
            let remark =
                format!("segments that are neither approach nor retract, left out: {left}");
            recording.remarks.push(remark);
        }
        for segment in &segments {
            let words = direction(segment).into_iter();
            recording
                .directions
                .extend(words.cycle().take(segment.points()));
        }
        let Some((first, rest)) = segments.split_first() else {
            return recording;
        };
        for channel in &first.channels {
            let others = rest.iter().map(|of| of.channel(&channel.name));
            let Some(others) = others.collect::<Option<Vec<_>>>() else {
                continue;
            };
            let (header, factor) = in_usual_unit(&channel.name, &channel.unit);
            let values = std::iter::once(channel)
                .chain(others)
                .flat_map(|of| &of.values);
            recording
                .columns
                .push((header, values.map(|of| of * factor).collect()));
        }
        recording
    }

    /// Leaves out rows that were not recorded: their numbers are not finite.
    fn keep_whole_rows(&mut self) {
        let rows = self.columns.first().map_or(0, |(_, of)| of.len());
        let is_whole = |row: usize| self.columns.iter().all(|(_, of)| of[row].is_finite());
        let kept: Vec<bool> = (0..rows).map(is_whole).collect();
        for (_, column) in &mut self.columns {
            let mut row = kept.iter();
            column.retain(|_| row.next() == Some(&true));
        }
        let mut row = kept.iter();
        self.directions.retain(|_| row.next() == Some(&true));
    }
}

/// The note of an Igor wave as it is; of other files sensitivity and stiffness.
fn notes(document: &Document, curve: &Curve) -> Vec<(String, String)> {
    if document.format == Format::Igor {
        return document.settings.clone();
    }
    let known = [
        (SENSITIVITY, curve.sensitivity),
        (SPRING_CONSTANT, curve.spring_constant),
    ];
    let known = known
        .into_iter()
        .filter_map(|(name, of)| Some((name.to_owned(), of?.to_string())));
    known.collect()
}

/// The header of a column and the factor of its numbers, for a unit of a file.
fn in_usual_unit(name: &str, unit: &str) -> (String, f64) {
    let (unit, factor) = match unit {
        "m" => ("nm", 1e9),
        "N" => ("nN", 1e9),
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

#[cfg(test)]
#[path = "../../afm-files/tests/samples/mod.rs"]
mod samples;

#[cfg(test)]
mod tests {
    use super::*;

    fn column(recording: &Recording, header: &str) -> Vec<i64> {
        let found = recording.columns.iter().find(|(name, _)| name == header);
        let (_, values) = found.unwrap_or_else(|| panic!("{header} in {recording:?}"));
        values
            .iter()
            .map(|of| (of * 100.0).round() as i64)
            .collect()
    }

    fn read(name: &str, bytes: Vec<u8>) -> Recording {
        parse(name, bytes, None).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn approach_and_retract_of_a_jpk_curve_become_rows() {
        // The content counts, not the name.
        let found = read("curve.dat", samples::zip(&samples::jpk_force()));
        assert_eq!(
            column(&found, "vDeflection (nm)"),
            [2500, 2550, 2600, 7500, 2500, 2550, 2600, 7500]
        );
        assert_eq!(
            column(&found, "measuredHeight (nm)")[3..5],
            [200_000, 200_000]
        );
        assert_eq!(found.directions[3..5], ["approach", "retract"]);
        let notes: Vec<&str> = found.notes.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(notes, ["InvOLS", "SpringConstant"]);
        let says = |part: &str| found.remarks.iter().any(|of| of.contains(part));
        assert!(
            says("left out: 1") && says("the measured height `measuredHeight`"),
            "{:?}",
            found.remarks
        );
    }

    #[test]
    fn the_note_of_a_wave_is_kept() {
        let found = read("curve.IBW", samples::igor_curve());
        assert!(
            found
                .notes
                .contains(&("InvOLS".to_owned(), "5e-08".to_owned()))
        );
        assert_eq!(
            found.directions,
            ["approach", "approach", "approach", "retract", "retract"]
        );
    }

    #[test]
    fn the_first_curve_of_a_map_is_read() {
        let found = read("map.nid", samples::nanosurf());
        assert_eq!(
            column(&found, "Deflection (nm)"),
            [0, 50, 100, 50, 100, 150]
        );
        assert!(
            found
                .remarks
                .iter()
                .any(|of| of.contains("first of its 2 curves")),
            "{:?}",
            found.remarks
        );
    }

    #[test]
    fn files_without_curves_are_named() {
        let refused =
            |name: &str, bytes: Vec<u8>| parse(name, bytes, None).expect_err("refused").to_string();
        assert_eq!(
            refused("a.jpk-force", b"PK".to_vec()),
            "it is not a force curve of JPK, or it is damaged"
        );
        assert_eq!(
            refused("a.gsf", samples::gsf()),
            "it has 1 images and 0 spectra (Gwyddion simple field), but no curve"
        );
        assert!(!is_recording("a.csv", b"distance (nm),amplitude (nm)\n"));
        assert!(is_recording("a.nid", b""));
    }
}
