//! A zip archive of other files, such as several `.jpk-force` or AFM Workshop curves: each is read by
//! itself.

use crate::document::{Curve, CurveSource, Document, Grid, grid_of};
use crate::limits::Budget;
use crate::zip::Archive;
use crate::{Error, Format, Limits, read_within, recognise};

/// Curves of several files, in sequence.
#[derive(Debug)]
struct Curves {
    documents: Vec<(String, Document)>,
    /// How many curves there are up to and with each file.
    ends: Vec<usize>,
    /// If together they are a map.
    grid: Option<Grid>,
}

pub(crate) fn read(archive: &Archive, limits: Limits) -> Result<Document, Error> {
    let budget = &mut Budget::new(limits);
    let mut document = Document::new(Format::Zip, limits);
    let mut files = Vec::new();
    for file in 0..archive.count() {
        let name = archive.name(file);
        let bytes = archive.unpack(file, budget)?;
        match recognise(&bytes) {
            None => document
                .notes
                .push(format!("`{name}` is of no known format")),
            Some(Format::Zip) => document.notes.push(format!(
                "`{name}` is an archive in the archive and is left out"
            )),
            Some(_) => match read_within(bytes, limits) {
                Ok(mut inner) => {
                    for image in &inner.images {
                        budget.numbers(image.values.len())?;
                    }
                    document.images.append(&mut inner.images);
                    document.spectra.append(&mut inner.spectra);
                    files.push((name, inner));
                }
                Err(error) => document
                    .notes
                    .push(format!("`{name}` is not read: {error}")),
            },
        }
    }
    if files.is_empty() {
        let content = format!("a zip archive of {} files", archive.count());
        return Err(Format::Zip.unsupported(content, "none of them is a file of an AFM"));
    }
    // The curves of an AFM Workshop map are separate files that say their number.
    files.sort_by_cached_key(|(_, inner)| {
        let is_numbered = inner.format == Format::Workshop;
        is_numbered.then(|| inner.curve(0).ok().map(|of| of.index))
    });
    document.grid = map_grid(&files);
    let ends = files.iter().scan(0, |end, (_, inner)| {
        *end += inner.curve_count();
        Some(*end)
    });
    document.curves = Box::new(Curves {
        ends: ends.collect(),
        documents: files,
        grid: document.grid,
    });
    Ok(document)
}

/// The grid of an AFM Workshop map, from the positions of its curves.
fn map_grid(files: &[(String, Document)]) -> Option<Grid> {
    let with_curves = files.iter().filter(|(_, inner)| inner.curve_count() > 0);
    let positions = with_curves.map(|(_, inner)| {
        let is_of_map = inner.format == Format::Workshop;
        is_of_map.then(|| inner.curve(0).ok()?.position)?
    });
    grid_of(&positions.collect::<Option<Vec<_>>>()?)
}

impl CurveSource for Curves {
    fn count(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    fn curve(&self, number: usize, limits: Limits) -> Result<Curve, Error> {
        let file = self.ends.partition_point(|end| *end <= number);
        let (name, inner) = &self.documents[file];
        let own = number + inner.curve_count() - self.ends[file];
        let mut curve = inner.curves.curve(own, limits)?;
        name.clone_into(&mut curve.file);
        if let (Some(grid), Some(position)) = (self.grid, curve.position) {
            curve.pixel = grid.cell_at(position).and_then(|of| grid.pixel(of));
        }
        Ok(curve)
    }

    fn pixel(&self, number: usize, limits: Limits) -> Option<usize> {
        self.curve(number, limits).ok()?.pixel
    }
}
