//! A zip archive of other files, such as several `.jpk-force` or AFM Workshop curves: each is read by
//! itself.

use crate::document::{Curve, CurveSource, Document};
use crate::limits::Budget;
use crate::zip::Archive;
use crate::{Error, Format, Limits, read_within, recognise};

/// Curves of several files, in sequence.
#[derive(Debug)]
struct Files(Vec<(String, Document)>);

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
    document.curves = Box::new(Files(files));
    Ok(document)
}

impl CurveSource for Files {
    fn count(&self) -> usize {
        self.0.iter().map(|(_, inner)| inner.curve_count()).sum()
    }

    fn curve(&self, number: usize, limits: Limits) -> Result<Curve, Error> {
        let mut left = number;
        for (name, inner) in &self.0 {
            if left < inner.curve_count() {
                let mut curve = inner.curves.curve(left, limits)?;
                curve.file.clone_from(name);
                return Ok(curve);
            }
            left -= inner.curve_count();
        }
        Err(Error::NoCurve {
            number,
            count: self.count(),
        })
    }
}
