//! Force curves, maps and quantitative images of JPK: a zip archive of Java properties and big-endian
//! numbers, one file for each channel of each segment.
//!
//! No specification is public; this is what the readers afmformats and PyFMReader do, measured on 31
//! real files.

mod channel;
mod properties;

use std::collections::BTreeMap;

use crate::distance::{Names, finish};
use crate::document::{Curve, CurveSource, Document, Grid, Segment, Style};
use crate::limits::{Budget, MAX_CHANNELS, MAX_CURVES, MAX_SEGMENTS, at_most};
use crate::zip::Archive;
use crate::{Error, Format, Limits, jpk_image};
use channel::{COMMANDED, DEFLECTION, MEASURED, scale};
use properties::{Header, Properties, parse};

const NAMES: Names = Names {
    measured: &MEASURED,
    commanded: &COMMANDED,
    ramp: &[],
    deflection: &[DEFLECTION],
    grows_toward_surface: false,
};

/// Images inside an archive.
const IMAGES: [&str; 2] = ["data-image.jpk-qi-image", "data-image.force"];

/// The curves of an archive.
#[derive(Debug)]
struct File {
    archive: Archive,
    shared: Properties,
    curves: Vec<Place>,
}

/// Where the files of a curve are in the archive.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// The number in `index/I/`; 0 for the only curve of a file.
    index: usize,
    /// Length of the names' beginning.
    prefix: usize,
    first: usize,
    end: usize,
}

/// The header of an archive of JPK.
pub(crate) const HEADER: &str = "header.properties";

pub(crate) fn read(archive: Archive, limits: Limits) -> Result<Document, Error> {
    let budget = &mut Budget::new(limits);
    let of_file = |name: &str, budget: &mut Budget| match archive.find(name) {
        Some(file) => parse(&archive.unpack(file, budget)?),
        None => Ok(Properties::new()),
    };
    let top = of_file(HEADER, budget)?;
    let shared = of_file("shared-data/header.properties", budget)?;
    let mut document = Document::new(Format::Jpk, limits);
    let kind = ["type", "jpk-data-file"]
        .iter()
        .find_map(|key| top.get(*key));
    document.kind = kind.cloned().unwrap_or_default();
    document.grid = grid(&top)?;
    let reflected = ".position-pattern.grid.reflect";
    let mut found = top.iter().filter(|(key, _)| key.ends_with(reflected));
    if found.any(|(_, value)| value == "true") {
        document.notes.push(
            "the grid is reflected, which its places do not show: take the positions of the curves"
                .to_owned(),
        );
    }
    for name in IMAGES {
        let Some(file) = archive.find(name) else {
            continue;
        };
        let bytes = archive.unpack(file, budget)?;
        match jpk_image::images(&bytes, budget) {
            Ok(images) => document.images.extend(images),
            Err(error) => document
                .notes
                .push(format!("its image `{name}` is not read: {error}")),
        }
        break;
    }
    document.settings = top.into_iter().collect();
    let curves = places(&archive)?;
    if curves.is_empty() && document.images.is_empty() {
        let content = format!("a JPK archive `{}` without force curves", document.kind);
        return Err(Format::Jpk.unsupported(content, "only curves and images are read"));
    }
    document.curves = Box::new(File {
        archive,
        shared,
        curves,
    });
    Ok(document)
}

/// The curves of an archive in the order of their numbers.
fn places(archive: &Archive) -> Result<Vec<Place>, Error> {
    let mut curves: Vec<Place> = Vec::new();
    let mut current: Option<(String, Place)> = None;
    // The names are sorted, so those of one curve follow each other.
    for file in 0..archive.count() {
        let name = archive.name(file);
        if let Some((prefix, place)) = &mut current
            && name.starts_with(prefix.as_str())
        {
            place.end = file + 1;
            continue;
        }
        let found = match name.strip_prefix("index/") {
            Some(rest) => rest
                .split_once('/')
                .and_then(|(index, _)| Some((format!("index/{index}/"), index.parse().ok()?))),
            None => name
                .starts_with("segments/")
                .then(|| ("segments/".to_owned(), 0)),
        };
        let Some((prefix, index)) = found else {
            continue;
        };
        curves.extend(current.take().map(|(_, place)| place));
        let place = Place {
            index,
            prefix: prefix.len()
                - if prefix == "segments/" {
                    prefix.len()
                } else {
                    0
                },
            first: file,
            end: file + 1,
        };
        current = Some((prefix, place));
    }
    curves.extend(current.map(|(_, place)| place));
    at_most(curves.len(), MAX_CURVES, "curves in a file")?;
    curves.sort_by_key(|of| of.index);
    Ok(curves)
}

impl CurveSource for File {
    fn count(&self) -> usize {
        self.curves.len()
    }

    fn curve(&self, number: usize, limits: Limits) -> Result<Curve, Error> {
        let place = self.curves[number];
        let budget = &mut Budget::new(limits);
        let mut curve = Curve::empty(place.index);
        let mut segments: BTreeMap<usize, SegmentFiles> = BTreeMap::new();
        let mut own = None;
        for file in place.first..place.end {
            let name = self.archive.name(file);
            let name = &name[place.prefix..];
            if name == HEADER {
                own = Some(file);
            } else if let Some((segment, part)) = segment_file(name) {
                let files = segments.entry(segment).or_default();
                match part {
                    Part::Header => files.header = Some(file),
                    Part::Channel(name) => files.channels.push((name.to_owned(), file)),
                }
            }
        }
        at_most(segments.len(), MAX_SEGMENTS, "segments in a curve")?;
        if let Some(header) = self.header(own, budget)? {
            let of_end = |end: &str| {
                let found = header.iter().find(|(key, _)| key.ends_with(end))?;
                crate::text::number(found.1)
            };
            let (x, y) = (
                of_end("series.header.position.x"),
                of_end("series.header.position.y"),
            );
            curve.position = x.zip(y).map(|(x, y)| [x, y]);
            curve.pixel = pixel(&header);
        }
        for (segment, files) in segments {
            self.segment(&mut curve, segment, &files, budget)?;
        }
        finish(&mut curve, &NAMES);
        Ok(curve)
    }

    fn pixel(&self, number: usize, limits: Limits) -> Option<usize> {
        let place = self.curves[number];
        let own = (place.first..place.end)
            .find(|file| self.archive.name(*file).get(place.prefix..) == Some(HEADER));
        let header = self.header(own, &mut Budget::new(limits)).ok()??;
        pixel(&header)
    }
}

/// The pixel of a curve, from its header.
fn pixel(header: &Properties) -> Option<usize> {
    let found = header
        .iter()
        .find(|(key, _)| key.ends_with("header.position-index"));
    let index = crate::text::number(found?.1)?;
    (index >= 0.0).then_some(index as usize)
}

/// Files of a segment in the archive.
#[derive(Debug, Default)]
struct SegmentFiles {
    header: Option<usize>,
    channels: Vec<(String, usize)>,
}

enum Part<'a> {
    Header,
    Channel(&'a str),
}

/// Number of the segment that a file belongs to, and what it is.
fn segment_file(name: &str) -> Option<(usize, Part<'_>)> {
    let (segment, file) = name.strip_prefix("segments/")?.split_once('/')?;
    let part = match file.strip_prefix("channels/") {
        Some(channel) => Part::Channel(channel.strip_suffix(".dat")?),
        None => (file == "segment-header.properties").then_some(Part::Header)?,
    };
    Some((segment.parse().ok()?, part))
}

impl File {
    /// The header of a curve; a single curve has it in that of the file.
    fn header(&self, own: Option<usize>, budget: &mut Budget) -> Result<Option<Properties>, Error> {
        let file = own.or_else(|| self.archive.find(HEADER));
        file.map(|of| parse(&self.archive.unpack(of, budget)?))
            .transpose()
    }

    fn segment(
        &self,
        curve: &mut Curve,
        number: usize,
        files: &SegmentFiles,
        budget: &mut Budget,
    ) -> Result<(), Error> {
        let Some(header) = files.header else {
            curve
                .notes
                .push(format!("segment {number} has no header and is left out"));
            return Ok(());
        };
        let header = Header::new(parse(&self.archive.unpack(header, budget)?)?, &self.shared)?;
        at_most(files.channels.len(), MAX_CHANNELS, "channels in a segment")?;
        let settings = "force-segment-header.settings";
        let get = |key: &str| {
            let inner = header.get(&format!("{settings}.segment-settings.{key}"));
            inner.or_else(|| header.get(&format!("{settings}.{key}")))
        };
        let style = match get("style") {
            Some("extend") => Style::Approach,
            Some("retract") => Style::Retract,
            Some("modulation") => Style::Modulation,
            _ => Style::Pause,
        };
        let mut segment = Segment {
            style,
            label: get("type").unwrap_or("").to_owned(),
            duration: header
                .number("force-segment-header.duration")
                .ok()
                .flatten(),
            channels: Vec::new(),
        };
        for (name, file) in &files.channels {
            let Some(scale) = scale(&header, name)? else {
                curve.notes.push(format!(
                    "segment {number}: the encoder of `{name}` is not known, the channel is left out"
                ));
                continue;
            };
            let bytes = self.archive.unpack(*file, budget)?;
            budget.numbers(bytes.len() / scale.encoding.size())?;
            segment.channels.push(scale.channel(name, &bytes));
            curve.sensitivity = curve.sensitivity.or(scale.sensitivity);
            curve.spring_constant = curve.spring_constant.or(scale.spring_constant);
        }
        keep_one_length(&mut segment, number, &mut curve.notes);
        let asked = get("num-points").and_then(crate::text::number);
        if let Some(asked) = asked.filter(|of| *of > segment.points() as f64) {
            curve.notes.push(format!(
                "segment {number} ({style}) has {} of the {asked} points that were set",
                segment.points()
            ));
        }
        curve.segments.push(segment);
        Ok(())
    }
}

/// Leaves out channels of another length than the deflection.
fn keep_one_length(segment: &mut Segment, number: usize, notes: &mut Vec<String>) {
    let leading = segment.channel(DEFLECTION).or(segment.channels.first());
    let Some(points) = leading.map(|of| of.values.len()) else {
        return;
    };
    segment.channels.retain(|of| {
        let found = of.values.len();
        if found != points {
            notes.push(format!(
                "segment {number}: `{}` has {found} points instead of {points} and is left out",
                of.name
            ));
        }
        found == points
    });
}

/// The grid of a map, from the header of the file.
fn grid(top: &Properties) -> Result<Option<Grid>, Error> {
    let of_end = |end: &str| top.iter().find(|(key, _)| key.ends_with(end));
    let number = |name: &str| -> Result<Option<f64>, Error> {
        let Some((key, value)) = of_end(&format!(".position-pattern.grid.{name}")) else {
            return Ok(None);
        };
        let found = crate::text::number(value);
        found.map(Some).ok_or_else(|| {
            Format::Jpk.at_key(key, format!("the value `{value}`"), "a finite number")
        })
    };
    let [Some(nx), Some(ny)] = [number("ilength")?, number("jlength")?] else {
        return Ok(None);
    };
    let or_zero = |name: &str| Ok::<f64, Error>(number(name)?.unwrap_or(0.0));
    let back = of_end(".position-pattern.back-and-forth");
    Ok(Some(Grid {
        shape: [nx as usize, ny as usize],
        size: [or_zero("ulength")?, or_zero("vlength")?],
        centre: [or_zero("xcenter")?, or_zero("ycenter")?],
        angle: or_zero("theta")?,
        back_and_forth: back.is_some_and(|(_, value)| value == "true"),
    }))
}
