//! HDF5 files of the Python package afmformats: a group for each curve with its settings as attributes,
//! and a row of numbers for each channel. Images of JPK.

mod container;
mod images;

use crate::distance::{Names, finish};
use crate::document::{Channel, Curve, CurveSource, Document, Grid, Segment, Style};
use crate::limits::{Budget, MAX_CHANNELS, MAX_SEGMENTS, at_most};
use crate::source::Source;
use crate::{Error, Format, Limits};
use container::{Reader, Value};

const NAMES: Names = Names {
    measured: &["height (measured)"],
    commanded: &["height (piezo)"],
    ramp: &[],
    deflection: &["force"],
    grows_toward_surface: false,
};

/// The row that numbers the segment of each point.
const SEGMENT: &str = "segment";

/// Attributes by their names.
struct Settings(Vec<(String, Value)>);

impl Settings {
    fn number(&self, key: &str) -> Option<f64> {
        let found = self.0.iter().find(|(name, _)| name == key)?;
        match &found.1 {
            Value::Number(number) => Some(*number).filter(|of| of.is_finite()),
            Value::Text(_) => None,
        }
    }

    fn text(&self, key: &str) -> Option<&str> {
        let found = self.0.iter().find(|(name, _)| name == key)?;
        match &found.1 {
            Value::Text(text) => Some(text),
            Value::Number(_) => None,
        }
    }

    /// The numbers of `key x` and `key y`.
    fn both(&self, key: &str) -> Option<[f64; 2]> {
        let [x, y] = ["x", "y"].map(|of| self.number(&format!("{key} {of}")));
        x.zip(y).map(|(x, y)| [x, y])
    }

    fn grid(&self) -> Option<Grid> {
        let shape = self.both("grid shape")?.map(|of| of as usize);
        let (size, centre) = (self.both("grid size")?, self.both("grid center")?);
        shape.iter().all(|of| *of > 0).then_some(Grid {
            shape,
            size,
            centre,
            angle: 0.0,
            back_and_forth: false,
        })
    }

    /// The pixel of a curve, by its column and row or by its position.
    fn pixel(&self, grid: &Grid) -> Option<usize> {
        let cell = self.both("grid index").map(|of| of.map(|k| k as usize));
        let cell = cell.or_else(|| grid.cell_at(self.both("position")?));
        grid.pixel(cell?)
    }

    /// Name and value as texts, for a document.
    fn shown(self, prefix: &str) -> impl Iterator<Item = (String, String)> {
        let shown = |value: Value| match value {
            Value::Text(text) => text,
            Value::Number(number) => number.to_string(),
        };
        let pairs = self.0.into_iter();
        pairs.map(move |(name, value)| (format!("{prefix}{name}"), shown(value)))
    }
}

/// The curves of a file: number and address of the group of each.
#[derive(Debug)]
struct Curves {
    source: Source,
    groups: Vec<(usize, u64)>,
    grid: Option<Grid>,
}

pub(crate) fn read(source: Source, limits: Limits) -> Result<Document, Error> {
    let budget = &mut Budget::new(limits);
    let mut reader = Reader::new(&source, budget);
    let root = reader.root()?;
    let settings = Settings(reader.attributes(&root)?);
    let links = reader.links(&root)?;
    let mut document = Document::new(Format::Hdf5, limits);
    let kind = settings.text("file-format-info");
    if let Some(kind) = kind.filter(|of| of.starts_with("JPK")) {
        kind.clone_into(&mut document.kind);
        images::read(&mut reader, &links, &mut document)?;
        return Ok(document);
    }
    if settings.text("software") != Some("afmformats") {
        return Err(other_program(&settings, &links));
    }
    let mut groups: Vec<(usize, u64)> = Vec::new();
    for (name, at) in links {
        match name.parse() {
            Ok(number) => groups.push((number, at)),
            Err(_) => document.notes.push(format!("`{name}` is not a curve")),
        }
    }
    let Some(&(_, first)) = groups.iter().min() else {
        let content = "an HDF5 file of afmformats without curves";
        return Err(Format::Hdf5.unsupported(content, "only curves are read"));
    };
    groups.sort_unstable();
    let first = reader.object(first)?;
    let of_first = Settings(reader.attributes(&first)?);
    document.grid = of_first.grid();
    of_first
        .text("imaging mode")
        .unwrap_or("")
        .clone_into(&mut document.kind);
    document.settings = settings.shown("").chain(of_first.shown("0/")).collect();
    document.curves = Box::new(Curves {
        source,
        groups,
        grid: document.grid,
    });
    Ok(document)
}

/// Says what an HDF5 file of another program is.
fn other_program(settings: &Settings, links: &[(String, u64)]) -> Error {
    let names = links.iter().take(4).map(|(of, _)| format!("`{of}`"));
    let names: Vec<String> = names.collect();
    let content = match (settings.text("software"), names.as_slice()) {
        (Some(software), _) => format!("an HDF5 file of `{software}`"),
        (None, []) => "an empty HDF5 file".to_owned(),
        (None, names) => format!("an HDF5 file that holds {}", names.join(", ")),
    };
    let reason = "of HDF5, curves of afmformats and images of JPK are read";
    Format::Hdf5.unsupported(content, reason)
}

impl CurveSource for Curves {
    fn count(&self) -> usize {
        self.groups.len()
    }

    fn curve(&self, number: usize, limits: Limits) -> Result<Curve, Error> {
        let (index, at) = self.groups[number];
        let budget = &mut Budget::new(limits);
        let mut reader = Reader::new(&self.source, budget);
        let group = reader.object(at)?;
        let settings = Settings(reader.attributes(&group)?);
        let mut curve = Curve::empty(index);
        curve.spring_constant = settings.number("spring constant").filter(|of| *of > 0.0);
        curve.sensitivity = settings.number("sensitivity").filter(|of| *of > 0.0);
        curve.position = settings.both("position");
        curve.pixel = self.grid.and_then(|grid| settings.pixel(&grid));
        let links = reader.links(&group)?;
        at_most(links.len(), MAX_CHANNELS, "channels in a curve")?;
        let mut channels = Vec::new();
        let mut marks = None;
        for (name, at) in links {
            let dataset = reader.object(at)?;
            let values = reader.numbers(&dataset)?;
            if name == SEGMENT {
                marks = Some(values);
                continue;
            }
            let unit = Settings(reader.attributes(&dataset)?);
            let unit = unit.text("unit").unwrap_or("");
            channels.push(Channel::new(name, unit, values));
        }
        let points = channels.first().map_or(0, |of| of.values.len());
        if let Some(other) = channels.iter().find(|of| of.values.len() != points) {
            let problem = format!("{} points in `{}`", other.values.len(), other.name);
            return Err(Format::Hdf5.at_key(index.to_string(), problem, format!("{points}")));
        }
        split(&mut curve, &channels, marks.as_deref(), &settings)?;
        finish(&mut curve, &NAMES);
        Ok(curve)
    }

    fn pixel(&self, number: usize, limits: Limits) -> Option<usize> {
        let budget = &mut Budget::new(limits);
        let mut reader = Reader::new(&self.source, budget);
        let group = reader.object(self.groups[number].1).ok()?;
        Settings(reader.attributes(&group).ok()?).pixel(&self.grid?)
    }
}

/// Cuts channels where the number of the segment changes.
fn split(
    curve: &mut Curve,
    channels: &[Channel],
    marks: Option<&[f64]>,
    settings: &Settings,
) -> Result<(), Error> {
    let points = channels.first().map_or(0, |of| of.values.len());
    let mut first = 0;
    while first < points {
        let mark = marks.and_then(|of| of.get(first)).copied();
        let same = marks.map_or(points, |marks| {
            let rest = marks.get(first..).unwrap_or_default();
            let end = rest.iter().position(|of| Some(*of) != mark);
            end.map_or(points, |of| first + of.max(1))
        });
        let end = same.min(points);
        let style = style(mark, settings);
        let part = |of: &Channel| Channel {
            name: of.name.clone(),
            unit: of.unit.clone(),
            values: of.values[first..end].to_vec(),
        };
        curve.segments.push(Segment {
            style,
            label: String::new(),
            duration: duration(style, end - first, settings),
            channels: channels.iter().map(part).collect(),
        });
        at_most(curve.segments.len(), MAX_SEGMENTS, "segments in a curve")?;
        first = end;
    }
    Ok(())
}

/// What the instrument does in a segment, by its number in each mode of afmformats.
fn style(mark: Option<f64>, settings: &Settings) -> Style {
    let styles: &[Style] = match settings.text("imaging mode") {
        Some("creep-compliance") => &[Style::Approach, Style::Pause, Style::Retract],
        Some("stress-relaxation") => &[Style::Pause, Style::Approach, Style::Pause, Style::Retract],
        _ => &[Style::Approach, Style::Retract],
    };
    let known = mark.and_then(|of| styles.get(of as usize));
    known.copied().unwrap_or(Style::Unsplit)
}

/// Duration of a segment (s): as stated, or by the rate of its points.
fn duration(style: Style, points: usize, settings: &Settings) -> Option<f64> {
    let name = match style {
        Style::Approach => "approach",
        Style::Retract => "retract",
        Style::Pause => "intermediate",
        Style::Modulation | Style::Unsplit => return None,
    };
    let rate = settings.number(&format!("rate {name}"));
    let stated = settings.number(&format!("duration {name}"));
    let duration = stated.or(rate.map(|of| points as f64 / of));
    duration.filter(|of| of.is_finite() && *of > 0.0)
}
