//! Pixels and lines of a scan as tables.

use super::instrument::Interaction;
use super::report::{CHANNELS, Channel, Channels, Direction, LineStatistics, ScanReport};
use nanotap_dataset::gsf::Field;
use nanotap_observe::frame::{AsCell, Cell, Form, Frame, Rows, columns, finite, frame};

impl Channel {
    /// SI unit in files; empty for a number without unit.
    pub const fn unit(&self) -> &'static str {
        self.dimension.file_unit()
    }
}

impl AsCell for Interaction {
    fn cell(&self) -> Cell {
        let name = match self {
            Self::Free => "free",
            Self::Attractive => "attractive",
            Self::Repulsive => "repulsive",
            Self::Irregular => "irregular",
        };
        name.cell()
    }
}

impl Direction {
    /// Name in documents.
    const fn name(self) -> &'static str {
        match self {
            Self::Trace => "trace",
            Self::Retrace => "retrace",
        }
    }
}

/// Returns the centres of `count` pixels over a length, along or across the lines.
pub(super) fn centres(count: usize, size: f64) -> Vec<f64> {
    let step = size / count.max(1) as f64;
    (0..count).map(|k| (k as f64 + 0.5) * step).collect()
}

/// A pixel: line, direction and image, its number in the line, and its position, m.
type Pixel<'a> = ((usize, &'static str, &'a Channels), usize, f64);

impl ScanReport {
    /// Returns the positions of the pixels along a line, m.
    pub fn pixel_positions(&self) -> Vec<f64> {
        centres(self.trace.height.first().map_or(0, Vec::len), self.size[0])
    }

    /// Returns the image of each direction that was scanned, with its name.
    pub fn directions(&self) -> impl Iterator<Item = (&'static str, &Channels)> {
        let retrace = self.retrace.iter().map(|image| ("retrace", image));
        std::iter::once(("trace", &self.trace)).chain(retrace)
    }

    /// Returns a channel of the trace as a field for programs for AFM data.
    pub fn field(&self, channel: &Channel) -> Field {
        let rows = (channel.values)(&self.trace);
        Field {
            title: channel.title.into(),
            x: self.pixel_positions(),
            y: centres(rows.len(), self.size[1]),
            values: rows.iter().flatten().copied().collect(),
            axis_unit: "m".into(),
            value_unit: channel.unit().into(),
        }
    }

    /// The pixels: line, direction, position and every channel.
    pub fn pixel_table<'a>(&'a self) -> Frame<'a> {
        let positions = self.pixel_positions();
        let lines = 0..self.trace.height.len();
        let images = lines.flat_map(|line| {
            self.directions()
                .map(move |(name, image)| (line, name, image))
        });
        let pixels = images.flat_map(|image| {
            let numbered = positions.iter().enumerate();
            numbered.map(move |(k, x)| (image, k, *x))
        });
        let rows = columns! { Rows::new("pixels", pixels, None);
            "line", "line", Plain => |((line, ..), ..)| line;
            "direction", "direction", Plain => |((_, direction, _), ..)| direction;
            "x", "x", (Length, Prefixed(5)) => |(.., x)| x;
        };
        let with = |rows: Rows<'a, Pixel<'a>>, channel: &'static Channel| {
            let shown = (channel.dimension, Form::Scaled(channel.power, 4));
            let value = |((line, _, image), k, _): Pixel<'a>| (channel.values)(image)[line][k];
            let rows = rows.column(channel.name, channel.title, shown, move |at| {
                finite(value(at))
            });
            rows.label(channel.label)
        };
        frame! { CHANNELS.iter().fold(rows, with);
            "state", "state", Plain => |((line, _, image), k, _)| image.state[line][k];
        }
    }

    /// The statistics of the lines.
    pub fn line_table(&self) -> Frame<'_> {
        let longest = |line: &'_ LineStatistics| {
            let lengths = line.parachuting.iter().map(|flight| flight.length);
            lengths.fold(0.0, f64::max)
        };
        frame! { Rows::new("lines", &self.lines, None);
            "direction", "", Plain => |line| line.direction.name();
            .fields(Some);
            "", "parachuting", (Length, Scaled(-9, 3)) => longest;
            .shown(LINES);
        }
    }
}

/// Columns of the lines that are shown.
const LINES: &str =
    "line,direction,height_rms,error_rms,tracking_rms,peak_force_max,parachuting,overshoot";
