//! A zip archive of other files, such as several `.jpk-force` or AFM Workshop curves: each is read by
//! itself. Files with one curve are read again when it is requested, so that many of them take little
//! memory.

use crate::document::{Curve, CurveSource, Document, Grid, grid_of};
use crate::limits::{Budget, MAX_CURVES, at_most};
use crate::zip::Archive;
use crate::{Error, Format, Limits, read_within, recognise};

/// How many times more than the limit of one step the files of an archive may have together. They are
/// unpacked one after another.
const MAX_TOTAL: u64 = 4;

/// The curves of several files, in sequence.
#[derive(Debug)]
struct Curves {
    archive: Archive,
    parts: Vec<Part>,
    /// How many curves there are up to and with each part.
    ends: Vec<usize>,
    /// If together they are a map.
    grid: Option<Grid>,
}

/// The curves of a file in the archive.
#[derive(Debug)]
struct Part {
    /// Its number in the archive.
    file: usize,
    count: usize,
    /// The file itself, if it has more than one curve.
    document: Option<Document>,
    /// Number and position of its curve, if it is one of AFM Workshop.
    of_map: Option<(usize, Option<[f64; 2]>)>,
}

pub(crate) fn read(archive: Archive, limits: Limits) -> Result<Document, Error> {
    let total = limits.decoded_bytes.saturating_mul(MAX_TOTAL);
    let total = &mut Budget::new(Limits::with_decoded_bytes(total));
    let kept = &mut Budget::new(limits);
    let mut document = Document::new(Format::Zip, limits);
    let mut parts = Vec::new();
    let mut known = 0;
    for file in 0..archive.count() {
        let name = archive.name(file);
        let bytes = archive.unpack(file, &mut Budget::new(limits))?;
        total.take(bytes.len() as u64)?;
        let length = bytes.len() as u64;
        let mut inner = match recognise(&bytes) {
            None => {
                document
                    .notes
                    .push(format!("`{name}` is of no known format"));
                continue;
            }
            Some(Format::Zip) => {
                document.notes.push(format!(
                    "`{name}` is an archive in the archive and is left out"
                ));
                continue;
            }
            Some(_) => match read_within(bytes, limits) {
                Ok(inner) => inner,
                Err(error) => {
                    document
                        .notes
                        .push(format!("`{name}` is not read: {error}"));
                    continue;
                }
            },
        };
        known += 1;
        let notes = inner.notes.iter().map(|of| format!("`{name}`: {of}"));
        document.notes.extend(notes);
        for image in &inner.images {
            kept.numbers(image.values.len())?;
        }
        for spectrum in &inner.spectra {
            kept.numbers(spectrum.values.len().saturating_mul(2))?;
        }
        document.images.append(&mut inner.images);
        document.spectra.append(&mut inner.spectra);
        let count = inner.curve_count();
        if count == 0 {
            continue;
        }
        let of_map = match inner.format {
            Format::Workshop => inner.curve(0).ok().map(|of| (of.index, of.position)),
            _ => None,
        };
        if count > 1 {
            kept.take(length)?;
        }
        parts.push(Part {
            file,
            count,
            document: (count > 1).then_some(inner),
            of_map,
        });
    }
    if known == 0 {
        let content = format!("a zip archive of {} files", archive.count());
        return Err(Format::Zip.unsupported(content, "none of them is a file of an AFM"));
    }
    // The curves of an AFM Workshop map are separate files that say their number.
    parts.sort_by_key(|part| part.of_map.map(|(index, _)| index));
    let positions = parts.iter().map(|part| part.of_map?.1);
    let positions: Option<Vec<[f64; 2]>> = positions.collect();
    document.grid = positions.and_then(|of| grid_of(&of));
    let ends = parts.iter().scan(0_usize, |end, part| {
        *end = end.saturating_add(part.count);
        Some(*end)
    });
    let ends: Vec<usize> = ends.collect();
    at_most(
        ends.last().copied().unwrap_or(0),
        MAX_CURVES,
        "curves in a file",
    )?;
    document.curves = Box::new(Curves {
        archive,
        parts,
        ends,
        grid: document.grid,
    });
    Ok(document)
}

impl CurveSource for Curves {
    fn count(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    fn curve(&self, number: usize, limits: Limits) -> Result<Curve, Error> {
        let at = self.ends.partition_point(|end| *end <= number);
        let part = &self.parts[at];
        let own = number + part.count - self.ends[at];
        let mut curve = if let Some(document) = &part.document {
            document.curves.curve(own, limits)?
        } else {
            let bytes = self.archive.unpack(part.file, &mut Budget::new(limits))?;
            read_within(bytes, limits)?.curve(own)?
        };
        curve.file = self.archive.name(part.file);
        if let (Some(grid), Some(position)) = (self.grid, curve.position) {
            curve.pixel = grid.cell_at(position).and_then(|of| grid.pixel(of));
        }
        Ok(curve)
    }

    fn pixel(&self, number: usize, limits: Limits) -> Option<usize> {
        let at = self.ends.partition_point(|end| *end <= number);
        match (self.grid, self.parts[at].of_map) {
            (Some(grid), Some((_, position))) => grid.pixel(grid.cell_at(position?)?),
            _ => self.curve(number, limits).ok()?.pixel,
        }
    }
}
