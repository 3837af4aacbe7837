//! What a file holds: curves, images and spectra, in SI units.

use std::fmt;
use std::sync::OnceLock;

use serde::Serialize;

use crate::{Error, Format, Limits};

/// The content of a file. Images and spectra are decoded when the file is opened, curves one by one on
/// request: a map of any number of curves needs little memory.
#[derive(Debug)]
pub struct Document {
    /// The file's format.
    pub format: Format,
    /// What the instrument calls the file, such as `quantitative-imaging-map`; empty if nothing.
    pub kind: String,
    /// The grid of a map's curves.
    pub grid: Option<Grid>,
    /// Images, in the order of the file.
    pub images: Vec<Image>,
    /// Spectra, in the order of the file.
    pub spectra: Vec<Spectrum>,
    /// What a reader of the numbers should know.
    pub notes: Vec<String>,
    /// The instrument's settings: name and value as in the file.
    pub settings: Vec<(String, String)>,
    pub(crate) curves: Box<dyn CurveSource>,
    /// Pixel and number of each curve, in the order of the pixels; made when it is needed.
    pub(crate) by_pixel: OnceLock<Vec<(usize, usize)>>,
    pub(crate) limits: Limits,
}

/// Where the curves of a document come from.
pub(crate) trait CurveSource: fmt::Debug + Send + Sync {
    /// How many curves there are.
    fn count(&self) -> usize;
    /// Decodes one of them.
    fn curve(&self, number: usize, limits: Limits) -> Result<Curve, Error>;
    /// The pixel of one of them, which costs less than the curve; `None` if it has none or is damaged.
    fn pixel(&self, number: usize, limits: Limits) -> Option<usize>;
}

impl CurveSource for Vec<Curve> {
    fn count(&self) -> usize {
        self.len()
    }

    fn curve(&self, number: usize, _: Limits) -> Result<Curve, Error> {
        Ok(self[number].clone())
    }

    fn pixel(&self, number: usize, _: Limits) -> Option<usize> {
        self[number].pixel
    }
}

impl Document {
    /// A document without content.
    pub(crate) fn new(format: Format, limits: Limits) -> Self {
        Self {
            format,
            kind: String::new(),
            grid: None,
            images: Vec::new(),
            spectra: Vec::new(),
            notes: Vec::new(),
            settings: Vec::new(),
            curves: Box::new(Vec::new()),
            by_pixel: OnceLock::new(),
            limits,
        }
    }

    /// Keeps a line `name` separator `value` as a setting.
    pub(crate) fn keep_setting(&mut self, line: &str, separator: &str) {
        if let Some((name, value)) = line.split_once(separator) {
            let setting = (name.trim().to_owned(), value.trim().to_owned());
            self.settings.push(setting);
        }
    }

    /// The value of a setting.
    pub(crate) fn setting(&self, name: &str) -> Option<&str> {
        let found = self.settings.iter().find(|(own, _)| own == name);
        found.map(|(_, value)| value.as_str())
    }

    /// How many curves the file has.
    pub fn curve_count(&self) -> usize {
        self.curves.count()
    }

    /// Decodes a curve, counted from 0.
    ///
    /// # Errors
    ///
    /// If the curve does not exist, is damaged or exceeds the limits.
    pub fn curve(&self, number: usize) -> Result<Curve, Error> {
        let count = self.curve_count();
        if number >= count {
            return Err(Error::NoCurve { number, count });
        }
        self.curves.curve(number, self.limits)
    }

    /// The number of the curve at a column and a row of the grid, for [`curve`](Self::curve); `None` if
    /// the map has no curve there.
    ///
    /// In a map with gaps the first call reads the headers of all curves.
    pub fn number_at(&self, cell: [usize; 2]) -> Option<usize> {
        let pixel = self.grid?.pixel(cell)?;
        let pixel_of = |number: usize| self.curves.pixel(number, self.limits);
        // In a map without gaps the curves have the numbers of their pixels.
        if pixel < self.curve_count() && pixel_of(pixel) == Some(pixel) {
            return Some(pixel);
        }
        let by_pixel = self.by_pixel.get_or_init(|| {
            let all = 0..self.curve_count();
            let mut pairs: Vec<_> = all.filter_map(|of| Some((pixel_of(of)?, of))).collect();
            pairs.sort_unstable();
            pairs
        });
        let at = by_pixel.partition_point(|(of, _)| *of < pixel);
        let found = by_pixel.get(at).filter(|(of, _)| *of == pixel);
        found.map(|(_, number)| *number)
    }

    /// Decodes all curves in sequence.
    pub fn curves(&self) -> impl Iterator<Item = Result<Curve, Error>> + '_ {
        (0..self.curve_count()).map(|number| self.curve(number))
    }
}

/// A force curve: segments in the order of time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Curve {
    /// The curve's number in the file as the instrument counts.
    pub index: usize,
    /// The file in an archive that it comes from; empty if the file is no archive of files.
    pub file: String,
    /// Lateral position x, y (m).
    pub position: Option<[f64; 2]>,
    /// Number of its place in the grid of the map.
    pub pixel: Option<usize>,
    /// Spring constant k of the lever (N/m).
    pub spring_constant: Option<f64>,
    /// Inverse optical lever sensitivity InvOLS (m/V).
    pub sensitivity: Option<f64>,
    /// Segments in the order of time.
    pub segments: Vec<Segment>,
    /// The channel that is the distance, one for the whole curve.
    pub distance: Option<Distance>,
    /// Name of the channel that is the deflection; its unit says whether the sensitivity is applied.
    pub deflection: Option<String>,
    /// What a reader of the numbers should know.
    pub notes: Vec<String>,
}

/// The grid of a file's curves, by their positions: places of equal distances in rows and columns, at
/// least two of them; `None` if they do not form one.
pub(crate) fn grid_of(positions: &[[f64; 2]]) -> Option<Grid> {
    // Shares of a step that a position may be away from its place.
    const TOLERANCE: f64 = 0.05;
    let mut grid = Grid {
        shape: [1; 2],
        size: [0.0; 2],
        centre: [0.0; 2],
        angle: 0.0,
        back_and_forth: false,
    };
    for k in 0..2 {
        let all = || positions.iter().map(|of| of[k]);
        let (low, high) = (
            all().fold(f64::INFINITY, f64::min),
            all().fold(f64::NEG_INFINITY, f64::max),
        );
        let above = |of: &f64| *of > low + (high - low) * 1e-6;
        let step = all().filter(above).fold(f64::INFINITY, f64::min) - low;
        grid.centre[k] = 0.5 * (low + high);
        if step.is_finite() && step > 0.0 {
            let steps = ((high - low) / step).round();
            grid.shape[k] = steps as usize + 1;
            grid.size[k] = (high - low) * (steps + 1.0) / steps;
        }
    }
    let is_near = |position: &[f64; 2]| {
        let pixel = grid.cell_at(*position).and_then(|of| grid.pixel(of));
        pixel.and_then(|of| grid.position(of)).is_some_and(|place| {
            (0..2).all(|k| {
                let share = grid.size[k] / grid.shape[k] as f64;
                (place[k] - position[k]).abs() <= TOLERANCE * share
            })
        })
    };
    let is_grid = grid.places() == positions.len() && positions.len() > 1;
    (is_grid && positions.iter().all(is_near)).then_some(grid)
}

/// What a file says of the lever of all its curves.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lever {
    /// N/m.
    pub(crate) spring_constant: Option<f64>,
    /// m/V.
    pub(crate) sensitivity: Option<f64>,
}

impl Lever {
    /// A curve without segments, whose number is that of its pixel if there is a grid.
    pub(crate) fn curve(&self, number: usize, grid: Option<&Grid>) -> Curve {
        Curve {
            spring_constant: self.spring_constant,
            sensitivity: self.sensitivity,
            pixel: grid.map(|_| number),
            position: grid.and_then(|of| of.position(number)),
            ..Curve::empty(number)
        }
    }
}

/// A part of a curve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Segment {
    /// What the instrument does.
    pub style: Style,
    /// The instrument's word for the kind of segment, such as `constant-height-pause`; may be empty.
    pub label: String,
    /// Duration (s).
    pub duration: Option<f64>,
    /// Channels, all of one length.
    pub channels: Vec<Channel>,
}

/// What the instrument does in a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Style {
    /// The tip moves towards the sample.
    Approach,
    /// The tip waits, at constant height or force.
    Pause,
    /// The tip moves away from the sample.
    Retract,
    /// The height or the force oscillates.
    Modulation,
    /// The file does not say where segments begin and end.
    Unsplit,
}

impl fmt::Display for Style {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Approach => "approach",
            Self::Pause => "pause",
            Self::Retract => "retract",
            Self::Modulation => "modulation",
            Self::Unsplit => "unsplit",
        })
    }
}

/// Numbers that were recorded together under one name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Channel {
    /// Name in the file.
    pub name: String,
    /// SI unit; the file's own unit if it is not known; may be empty.
    pub unit: String,
    /// Values in that unit.
    pub values: Vec<f64>,
}

impl Channel {
    /// A channel of values in a unit of a file, converted to SI.
    pub(crate) fn new(name: impl Into<String>, unit: &str, mut values: Vec<f64>) -> Self {
        let (factor, unit) = crate::text::si(unit);
        if factor != 1.0 {
            for value in &mut values {
                *value *= factor;
            }
        }
        Self {
            name: name.into(),
            unit: unit.to_owned(),
            values,
        }
    }
}

impl Segment {
    /// How many points each channel has.
    pub fn points(&self) -> usize {
        self.channels.first().map_or(0, |of| of.values.len())
    }

    /// The channel of this name.
    pub fn channel(&self, name: &str) -> Option<&Channel> {
        self.channels.iter().find(|of| of.name == name)
    }
}

/// The channel that is a curve's distance.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Distance {
    /// Name of the channel.
    pub channel: String,
    /// How the distance is known.
    pub source: DistanceSource,
    /// The commanded or computed height of the same curve, if the distance is another channel.
    pub commanded: Option<String>,
    /// Whether it grows when the tip moves towards the sample.
    pub grows_toward_surface: bool,
}

/// How a distance is known; a measured one is preferred, then a commanded one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DistanceSource {
    /// A sensor measured the height.
    Measured,
    /// The height that the instrument commanded: creep and hysteresis of the scanner are in it.
    Commanded,
    /// Equal steps computed from the header.
    Ramp,
}

impl fmt::Display for DistanceSource {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Measured => "measured",
            Self::Commanded => "commanded",
            Self::Ramp => "computed ramp",
        })
    }
}

impl Curve {
    /// A curve without segments.
    pub(crate) fn empty(index: usize) -> Self {
        Self {
            index,
            file: String::new(),
            position: None,
            pixel: None,
            spring_constant: None,
            sensitivity: None,
            segments: Vec::new(),
            distance: None,
            deflection: None,
            notes: Vec::new(),
        }
    }

    /// The distance in a segment (m).
    pub fn distance_in<'a>(&self, segment: &'a Segment) -> Option<&'a Channel> {
        segment.channel(&self.distance.as_ref()?.channel)
    }

    /// The deflection in a segment (m, or V, A or N if the file has no sensitivity).
    pub fn deflection_in<'a>(&self, segment: &'a Segment) -> Option<&'a Channel> {
        segment.channel(self.deflection.as_ref()?)
    }
}

/// The grid of a map: `nx` × `ny` places, row after row from the lower left.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Grid {
    /// Places in a row, and rows.
    pub shape: [usize; 2],
    /// Width and height (m); each place is the middle of its share.
    pub size: [f64; 2],
    /// Position of the centre (m).
    pub centre: [f64; 2],
    /// Angle by which the grid is turned about its centre (rad).
    pub angle: f64,
    /// Whether every second row runs backwards.
    pub back_and_forth: bool,
}

impl Grid {
    /// Column and row of a place, by its number in the order of recording.
    pub fn cell(&self, pixel: usize) -> Option<[usize; 2]> {
        let (row, column) = (
            pixel.checked_div(self.shape[0])?,
            pixel.checked_rem(self.shape[0])?,
        );
        let is_reversed = self.back_and_forth && row % 2 == 1;
        let column = if is_reversed {
            self.shape[0] - 1 - column
        } else {
            column
        };
        (row < self.shape[1]).then_some([column, row])
    }

    /// Number of a place in the order of recording, by its column and row.
    pub fn pixel(&self, [column, row]: [usize; 2]) -> Option<usize> {
        if column >= self.shape[0] || row >= self.shape[1] {
            return None;
        }
        let is_reversed = self.back_and_forth && row % 2 == 1;
        let column = if is_reversed {
            self.shape[0] - 1 - column
        } else {
            column
        };
        row.checked_mul(self.shape[0])?.checked_add(column)
    }

    /// How many places there are.
    pub fn places(&self) -> usize {
        self.shape[0].saturating_mul(self.shape[1])
    }

    /// Column and row of the place in whose share a position (m) is.
    pub fn cell_at(&self, position: [f64; 2]) -> Option<[usize; 2]> {
        let [dx, dy] = [0, 1].map(|k| position[k] - self.centre[k]);
        let (sin, cos) = libm::sincos(self.angle);
        let along = |k: usize, of: f64| {
            // A single row may have no height.
            let share = if self.size[k] == 0.0 {
                0.0
            } else {
                of / self.size[k]
            };
            let index = ((share + 0.5) * self.shape[k] as f64).floor();
            (index >= 0.0 && index < self.shape[k] as f64).then_some(index as usize)
        };
        let column = along(0, dx * cos + dy * sin)?;
        Some([column, along(1, dy * cos - dx * sin)?])
    }

    /// Position of a place (m), by its number in the order of recording.
    pub fn position(&self, pixel: usize) -> Option<[f64; 2]> {
        let cell = self.cell(pixel)?;
        let along = |k: usize| ((cell[k] as f64 + 0.5) / self.shape[k] as f64 - 0.5) * self.size[k];
        let (u, v) = (along(0), along(1));
        let (sin, cos) = libm::sincos(self.angle);
        Some([
            self.centre[0] + u * cos - v * sin,
            self.centre[1] + u * sin + v * cos,
        ])
    }
}

/// An image: a number for each point of a raster.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Image {
    /// Name in the file, with the direction of the scan where it says it.
    pub name: String,
    /// SI unit; the file's own unit if it is not known; may be empty.
    pub unit: String,
    /// Points in a line, and lines.
    pub shape: [usize; 2],
    /// Width and height (m).
    pub size: Option<[f64; 2]>,
    /// Values, line after line from the top one as the instrument shows it, each from the left.
    pub values: Vec<f64>,
}

impl Image {
    /// Values in a unit of a file, converted to SI; `values` are lines from the top one on.
    pub(crate) fn new(
        name: impl Into<String>,
        unit: &str,
        shape: [usize; 2],
        size: Option<[f64; 2]>,
        values: Vec<f64>,
    ) -> Self {
        let Channel { name, unit, values } = Channel::new(name, unit, values);
        Self {
            name,
            unit,
            shape,
            size: size.filter(|of| of.iter().all(|side| side.is_finite() && *side > 0.0)),
            values,
        }
    }

    /// Exchanges top and bottom.
    pub(crate) fn flipped(mut self) -> Self {
        let lines = self.values.chunks(self.shape[0].max(1)).rev();
        self.values = lines.flatten().copied().collect();
        self
    }
}

/// A spectrum: an amplitude or power density over frequency.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spectrum {
    /// Name in the file.
    pub name: String,
    /// Unit of the values, such as `V²/Hz` or `m/sqrt(Hz)`.
    pub unit: String,
    /// Frequencies (Hz).
    pub frequency: Vec<f64>,
    /// A value for each frequency.
    pub values: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_of_a_turned_grid_run_back_and_forth() {
        let grid = Grid {
            shape: [2, 2],
            size: [2.0, 4.0],
            centre: [10.0, 0.0],
            angle: std::f64::consts::FRAC_PI_2,
            back_and_forth: true,
        };
        assert_eq!(grid.cell(2), Some([1, 1]));
        assert_eq!(grid.cell(4), None);
        for pixel in 0..grid.places() {
            let cell = grid.cell(pixel).expect("a place of the grid");
            assert_eq!(grid.pixel(cell), Some(pixel));
            let position = grid.position(pixel).expect("a place of the grid");
            assert_eq!(grid.cell_at(position), Some(cell));
        }
        assert_eq!(grid.pixel([2, 0]), None);
        assert_eq!(grid.cell_at([13.0, 0.0]), None);
        let [x, y] = grid.position(0).expect("a place of the grid");
        assert!(
            (x - 11.0).abs() < 1e-12 && (y + 0.5).abs() < 1e-12,
            "{x} {y}"
        );
    }

    #[test]
    fn positions_tell_their_grid() {
        let at = |k: usize| [1e-6 * (k % 3) as f64, 2e-6 * (k / 3) as f64];
        let positions: Vec<[f64; 2]> = (0..6).map(at).collect();
        let grid = grid_of(&positions).expect("a grid");
        assert_eq!(grid.shape, [3, 2]);
        for (k, position) in positions.iter().enumerate() {
            let found = grid.position(k).expect("a place of the grid");
            assert!((0..2).all(|of| (found[of] - position[of]).abs() < 1e-15));
        }
        assert_eq!(grid_of(&positions[..5]), None);
        assert_eq!(grid_of(&[[0.0; 2]]), None);
        assert_eq!(grid_of(&[[0.0; 2], [0.0; 2]]), None);
        assert_eq!(grid_of(&[[f64::NAN; 2], [0.0; 2]]), None);
    }

    #[test]
    fn flipping_an_image_exchanges_its_lines() {
        let image = Image::new("h", "mm", [2, 2], None, vec![1.0, 2.0, 3.0, 4.0]).flipped();
        assert_eq!(image.unit, "m");
        assert_eq!(image.values, [3e-3, 4e-3, 1e-3, 2e-3]);
    }
}
