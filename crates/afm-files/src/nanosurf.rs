//! Nanosurf `.nid`: sections of `key=value` lines, the mark `#!`, then the numbers of all channels in
//! the order of the header. A map is one channel with a line for each curve.
//!
//! A number n of b bits stands for `Dim2Min + Dim2Range · (n + 2ᵇ⁻¹)/2ᵇ`. No specification is public;
//! this is what the maker's reader NSFopen does, measured on nine real files.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::bytes::{Encoding, Number};
use crate::distance::{Names, finish};
use crate::document::{
    Channel, Curve, CurveSource, Document, Grid, Image, Lever, Segment, Spectrum, Style,
};
use crate::limits::{
    Budget, MAX_CHANNELS, MAX_CURVES, MAX_HEADER, MAX_LINE, MAX_PROPERTIES, at_most,
};
use crate::source::{ReadAt, Source};
use crate::text::{leading_number, number, utf8_or_windows};
use crate::{Error, Format, Limits};

const AXIS: &str = "commanded Z";
const TIME: &str = "Time";
/// Frames of a curve in the order of time: name, style, and the setting with the duration (s).
const FRAMES: [(&str, Style, &str); 4] = [
    ("spec forward", Style::Approach, "FwModTime"),
    ("spec fwd pause", Style::Pause, "FwPauseTime"),
    ("spec backward", Style::Retract, "BwModTime"),
    ("spec bwd pause", Style::Pause, "BwPauseTime"),
];
const NAMES: Names = Names {
    measured: &["Z-Axis Sensor"],
    commanded: &["Z-Axis", AXIS],
    ramp: &[],
    deflection: &["Deflection"],
    grows_toward_surface: true,
};

type Section = BTreeMap<String, String>;
type Sections = BTreeMap<String, Arc<Section>>;

/// A channel: its header, and the place of its numbers in the file.
#[derive(Debug)]
struct Data {
    group: String,
    section: Arc<Section>,
    points: usize,
    lines: usize,
    encoding: Encoding,
    /// Where its numbers begin.
    first: u64,
    low: f64,
    range: f64,
}

impl Data {
    fn text(&self, key: &str) -> &str {
        self.section.get(key).map_or("", String::as_str)
    }

    fn number(&self, key: &str) -> Option<f64> {
        number(self.text(key))
    }

    /// The first values of a line.
    fn line(&self, file: &Source, line: usize, points: usize) -> Result<Vec<f64>, Error> {
        let size = self.encoding.size();
        let first = self.first + (line * self.points * size) as u64;
        let raw = file.read(first, points.min(self.points) * size, Format::Nanosurf)?;
        let levels = 2f64.powi(8 * size as i32);
        let zero = match self.encoding.number {
            Number::Unsigned(_) => 0.0,
            _ => levels / 2.0,
        };
        let value = |of: f64| (of + zero) * (self.range / levels) + self.low;
        Ok(self.encoding.all(&raw).map(value).collect())
    }

    /// Valid points of a line, and its axis from the first to the last.
    fn axis(&self, line: usize) -> (usize, f64, f64) {
        let of_line = |name: &str| {
            let found = self.number(&format!("LineDim{line}{name}"));
            found
                .or_else(|| self.number(&format!("Dim0{name}")))
                .unwrap_or(0.0)
        };
        let points = self.number(&format!("LineDim{line}Points"));
        let points = points.map_or(self.points, |of| (of as usize).min(self.points));
        (points, of_line("Min"), of_line("Range"))
    }
}

/// The spectroscopy of a file.
#[derive(Debug)]
struct Spectroscopy {
    file: Source,
    /// Channels with the number of their frame, in the order of the frames.
    channels: Vec<(usize, Data)>,
    count: usize,
    grid: Option<Grid>,
    lever: Lever,
    durations: [Option<f64>; FRAMES.len()],
}

pub(crate) fn read(file: Source, limits: Limits) -> Result<Document, Error> {
    let header = file.beginning(MAX_HEADER, Format::Nanosurf)?;
    let mark = header
        .windows(2)
        .position(|two| two == b"#!")
        .ok_or_else(|| {
            Format::Nanosurf.at_byte(
                header.len(),
                "the header does not end",
                "the mark #! after it",
            )
        })?;
    let sections = sections(&header[..mark])?;
    drop(header);
    let mut document = Document::new(Format::Nanosurf, limits);
    let (channels, end) = channels(&sections, mark as u64 + 2, file.length())?;
    if end < file.length() {
        let left = file.length() - end;
        document
            .notes
            .push(format!("{left} bytes after the last channel are not read"));
    }
    let budget = &mut Budget::new(limits);
    let mut spectroscopy = Vec::new();
    for data in channels {
        let frame = match data.text("Frame") {
            "" => data.group.to_lowercase(),
            frame => frame.to_lowercase(),
        };
        // The axis of a pause is the time.
        let is_curve =
            data.text("Dim0Name").starts_with('Z') || ["m", "s"].contains(&data.text("Dim0Unit"));
        let known = FRAMES.iter().position(|(name, ..)| *name == frame);
        if let Some(known) = known.filter(|_| is_curve) {
            at_most(data.lines, MAX_CURVES, "curves in a file")?;
            spectroscopy.push((known, data));
        } else if data.text("Dim0Unit") == "Hz" {
            budget.numbers(2 * data.points)?;
            document.spectra.push(spectrum(&data, &file)?);
        } else {
            budget.numbers(data.points * data.lines)?;
            document.images.push(image(&data, &file)?);
        }
    }
    let section = |name: &str| sections.get(name);
    let grid = section(r"DataSet\SpecInfos\SpecMapTable").and_then(|table| grid(table));
    document.grid = grid;
    document.settings = settings(&sections);
    let modulation = section(r"DataSet\Parameters\Spectroscopy");
    let duration = |key: &str| {
        let quantity = modulation?.get(key)?.strip_prefix("D[")?;
        leading_number(quantity).map(|(value, _)| value)
    };
    // Full scale of the deflection for 10 V of the detector.
    let full_scale = section(r"DataSet\Calibration\Scanhead").and_then(|head| {
        head.iter().find_map(|(key, line)| {
            let cells: Vec<&str> = line.split(',').collect();
            let is_deflection =
                key.starts_with("In") && cells.len() >= 5 && cells[2..4] == ["Deflection", "m"];
            is_deflection.then(|| number(cells[4])).flatten()
        })
    });
    // Written as `D[0.2]*[N/m]`.
    let stiffness = section(r"DataSet\Calibration\Cantilever").and_then(|lever| {
        let quantity = lever.get("Prop0")?.strip_prefix("D[")?;
        let (value, unit) = quantity.split_once("]*[")?;
        (unit.trim_end_matches(']') == "N/m").then(|| number(value))?
    });
    spectroscopy.sort_by_key(|(frame, _)| *frame);
    let count = spectroscopy
        .iter()
        .map(|(_, data)| data.lines)
        .max()
        .unwrap_or(0);
    document.curves = Box::new(Spectroscopy {
        file,
        channels: spectroscopy,
        count,
        grid,
        lever: Lever {
            spring_constant: stiffness.filter(|of| *of > 0.0),
            sensitivity: full_scale.map(|of| of / 10.0).filter(|of| *of > 0.0),
        },
        durations: FRAMES.map(|(_, _, key)| duration(key).filter(|of| *of > 0.0)),
    });
    Ok(document)
}

/// Sections by their names.
fn sections(header: &[u8]) -> Result<Sections, Error> {
    let mut sections: BTreeMap<String, Section> = BTreeMap::new();
    let mut name = String::new();
    let mut count = 0;
    for line in header.split(|of| *of == b'\n') {
        at_most(line.len(), MAX_LINE, "bytes in a line of a header")?;
        let line = utf8_or_windows(line);
        let line = line.trim();
        if let Some(of) = line
            .strip_prefix('[')
            .and_then(|rest| rest.strip_suffix(']'))
        {
            of.clone_into(&mut name);
        } else if let Some((key, value)) = line.split_once('=') {
            count += 1;
            at_most(count, MAX_PROPERTIES, "properties in a header")?;
            let section = sections.entry(name.clone()).or_default();
            let value = value.trim().to_owned();
            section.entry(key.trim().to_owned()).or_insert(value);
        }
    }
    let shared = sections.into_iter().map(|(name, of)| (name, Arc::new(of)));
    Ok(shared.collect())
}

/// All channels that the header lists, and the end of their numbers.
fn channels(sections: &Sections, first: u64, length: u64) -> Result<(Vec<Data>, u64), Error> {
    let missing = |section: &str, key: &str| {
        Format::Nanosurf.at_key(
            format!("[{section}] {key}"),
            "missing or not a number",
            "a number",
        )
    };
    let top = sections
        .get("DataSet")
        .ok_or_else(|| missing("DataSet", "GroupCount"))?;
    let whole =
        |section: &Section, key: &str| section.get(key).and_then(|of| of.parse::<usize>().ok());
    let groups = whole(top, "GroupCount").ok_or_else(|| missing("DataSet", "GroupCount"))?;
    at_most(groups, MAX_CHANNELS, "groups of channels")?;
    let mut channels = Vec::new();
    let mut at = first;
    for group in 0..groups {
        let count = whole(top, &format!("Gr{group}-Count")).unwrap_or(0);
        at_most(count, MAX_CHANNELS, "channels in a group")?;
        for channel in 0..count {
            let found = top
                .get(&format!("Gr{group}-Ch{channel}"))
                .and_then(|name| Some((name, sections.get(name)?)));
            let Some((name, section)) = found else {
                continue;
            };
            at_most(channels.len() + 1, MAX_CHANNELS, "channels in a file")?;
            let count = |key: &str| whole(section, key).ok_or_else(|| missing(name, key));
            let scale = |key: &str| {
                let found = section.get(key).and_then(|of| number(of));
                found.ok_or_else(|| missing(name, key))
            };
            let width = match section.get("SaveBits").map_or("16", String::as_str) {
                "16" => 2,
                "32" => 4,
                bits => {
                    let key = format!("[{name}] SaveBits");
                    return Err(Format::Nanosurf.at_key(key, format!("{bits} bits"), "16 or 32"));
                }
            };
            let says = |key: &str, beginning: &str| {
                section
                    .get(key)
                    .is_some_and(|of| of.to_lowercase().starts_with(beginning))
            };
            let number = if says("SaveSign", "un") {
                Number::Unsigned(width)
            } else {
                Number::Signed(width)
            };
            let (points, lines) = (count("Points")?, count("Lines")?);
            if points == 0 {
                let key = format!("[{name}] Points");
                return Err(Format::Nanosurf.at_key(key, "no points", "at least one"));
            }
            let size = points
                .checked_mul(lines)
                .and_then(|of| of.checked_mul(width));
            let end = size
                .and_then(|of| at.checked_add(of as u64))
                .filter(|end| *end <= length);
            let end = end.ok_or_else(|| {
                let problem = format!("{points} points in {lines} lines from byte {at} on");
                let expected = format!("at most the file's {length} bytes");
                Format::Nanosurf.at_key(format!("[{name}]"), problem, expected)
            })?;
            channels.push(Data {
                group: top
                    .get(&format!("Gr{group}-Name"))
                    .cloned()
                    .unwrap_or_default(),
                section: Arc::clone(section),
                points,
                lines,
                encoding: Encoding {
                    number,
                    big_endian: says("SaveOrder", "") && !says("SaveOrder", "intel"),
                },
                first: at,
                low: scale("Dim2Min")?,
                range: scale("Dim2Range")?,
            });
            at = end;
        }
    }
    Ok((channels, at))
}

/// Settings of all sections but those of the channels.
fn settings(sections: &Sections) -> Vec<(String, String)> {
    let of_file = sections.iter().filter(|(name, _)| !name.contains(':'));
    let named = of_file.flat_map(|(name, section)| {
        let name = name.strip_prefix(r"DataSet\").unwrap_or(name);
        section
            .iter()
            .map(move |(key, value)| (format!(r"{name}\{key}"), value.clone()))
    });
    named.collect()
}

fn spectrum(data: &Data, file: &Source) -> Result<Spectrum, Error> {
    let (_, low, range) = data.axis(usize::MAX);
    let last = data.points.max(2) - 1;
    Ok(Spectrum {
        name: data.group.clone(),
        unit: data.text("Dim2Unit").to_owned(),
        frequency: (0..data.points)
            .map(|k| low + range * k as f64 / last as f64)
            .collect(),
        values: if data.lines == 0 {
            Vec::new()
        } else {
            data.line(file, 0, data.points)?
        },
    })
}

fn image(data: &Data, file: &Source) -> Result<Image, Error> {
    let is_length = ["Dim0Unit", "Dim1Unit"]
        .iter()
        .all(|key| data.text(key) == "m");
    let size = data.number("Dim0Range").zip(data.number("Dim1Range"));
    let mut values = Vec::new();
    // The first line in the file is the lowest.
    for line in (0..data.lines).rev() {
        values.extend(data.line(file, line, data.points)?);
    }
    Ok(Image::new(
        format!("{}: {}", data.group, data.text("Dim2Name")),
        data.text("Dim2Unit"),
        [data.points, data.lines],
        size.filter(|_| is_length).map(|(x, y)| [x, y]),
        values,
    ))
}

/// The grid `x0;x1;y0;y1;nx;ny;…` of a map, row by row; the ends are places of curves.
fn grid(table: &Section) -> Option<Grid> {
    let cells: Vec<f64> = table.get("Map0")?.split(';').map_while(number).collect();
    let [x0, x1, y0, y1, nx, ny] = *cells.get(..6)? else {
        return None;
    };
    let side = |first: f64, last: f64, count: f64| (last - first) * count / (count - 1.0).max(1.0);
    (nx >= 1.0 && ny >= 1.0).then(|| Grid {
        shape: [nx as usize, ny as usize],
        size: [side(x0, x1, nx), side(y0, y1, ny)],
        centre: [0.5 * (x0 + x1), 0.5 * (y0 + y1)],
        angle: 0.0,
        back_and_forth: false,
    })
}

impl CurveSource for Spectroscopy {
    fn count(&self) -> usize {
        self.count
    }

    fn curve(&self, number: usize, limits: Limits) -> Result<Curve, Error> {
        let mut curve = self.lever.curve(number, self.grid.as_ref());
        let budget = &mut Budget::new(limits);
        let mut last_frame = None;
        for (frame, data) in self.channels.iter().filter(|(_, data)| number < data.lines) {
            let (points, low, range) = data.axis(number);
            budget.numbers(3 * points)?;
            let (_, style, _) = FRAMES[*frame];
            let in_time = |mut values: Vec<f64>| {
                // The way back lies along the axis: its first number is the farthest point.
                if style == Style::Retract {
                    values.reverse();
                }
                values
            };
            if last_frame.replace(*frame) != Some(*frame) {
                let last = points.max(2) - 1;
                let axis = (0..points).map(|k| low + range * k as f64 / last as f64);
                let axis = in_time(axis.collect());
                let channels = if data.text("Dim0Unit") == "s" {
                    let before = curve.segments.last().and_then(|of| of.channel(AXIS));
                    let height = before.and_then(|of| of.values.last()).copied();
                    let height = height.map(|of| Channel::new(AXIS, "m", vec![of; points]));
                    let time = Channel::new(TIME, "s", axis);
                    height.into_iter().chain([time]).collect()
                } else {
                    vec![Channel::new(AXIS, data.text("Dim0Unit"), axis)]
                };
                curve.segments.push(Segment {
                    style,
                    label: String::new(),
                    duration: self.durations[*frame],
                    channels,
                });
            }
            let Some(segment) = curve.segments.last_mut() else {
                continue;
            };
            let name = match data.text("Dim2Name") {
                "" => "channel",
                name => name,
            };
            if segment.points() != points || segment.channel(name).is_some() {
                curve.notes.push(format!(
                    "a second or shorter `{name}` ({style}) is left out"
                ));
                continue;
            }
            let values = in_time(data.line(&self.file, number, points)?);
            let unit = data.text("Dim2Unit");
            segment.channels.push(Channel::new(name, unit, values));
        }
        finish(&mut curve, &NAMES);
        Ok(curve)
    }

    fn pixel(&self, number: usize, _: Limits) -> Option<usize> {
        self.grid.map(|_| number)
    }
}
