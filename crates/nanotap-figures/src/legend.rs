//! The legend: its size, its position, its drawing.

use crate::colour::Colour;
use crate::layer::Layer;
use crate::note;
use crate::panel::Legend;
use crate::prepared::{Entry, Frame, Prepared, Sample};
use crate::scene::Scene;
use crate::shape::{Point, Rect, Stroke};
use crate::style::{INK, Style};
use crate::symbol::{disc, marker};
use crate::text::{Across, Upright, Words};

/// Position of the legend once the panel's size is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Stand {
    Nowhere,
    /// Inside; fractions of the free space to the left and above.
    Inside(f64, f64),
    Above,
    Right,
}

/// Positions inside the panel that are tried, the preferred one first: fractions of the free width
/// and height from the top left.
const INSIDE: [(f64, f64); 8] = [
    (1.0, 0.0),
    (0.0, 0.0),
    (1.0, 1.0),
    (0.0, 1.0),
    (0.5, 0.0),
    (0.5, 1.0),
    (1.0, 0.5),
    (0.0, 0.5),
];

fn sample_width(style: &Style) -> f64 {
    4.5 * style.legend / 7.0
}

fn entry_width(entry: &Entry, style: &Style) -> f64 {
    swatch_width(entry, style) + style.pad + Words::set(&entry.label, style.legend, false).width
}

/// Width of the sample: long for lines, short for the rest.
fn swatch_width(entry: &Entry, style: &Style) -> f64 {
    match entry.sample {
        Sample::Line { .. } => sample_width(style),
        _ => 0.55 * sample_width(style),
    }
}

fn widest_swatch(entries: &[Entry], style: &Style) -> f64 {
    let widths = entries.iter().map(|e| swatch_width(e, style));
    widths.fold(0.0, f64::max)
}

/// Width and height of the legend as a column, with its margins, mm.
pub(crate) fn column_size(entries: &[Entry], style: &Style) -> (f64, f64) {
    let words = entries
        .iter()
        .map(|e| Words::set(&e.label, style.legend, false).width)
        .fold(0.0, f64::max);
    (
        widest_swatch(entries, style) + words + 3.0 * style.pad,
        entries.len() as f64 * style.line() + style.pad,
    )
}

/// The entries broken into rows of at most `width` mm.
pub(crate) fn rows<'e>(entries: &'e [Entry], width: f64, style: &Style) -> Vec<Vec<&'e Entry>> {
    let mut rows: Vec<Vec<&Entry>> = Vec::new();
    let mut room = 0.0;
    for entry in entries {
        let needed = entry_width(entry, style);
        match rows.last_mut() {
            Some(row) if needed <= room => row.push(entry),
            _ => {
                rows.push(vec![entry]);
                room = width;
            }
        }
        room -= needed + style.gap;
    }
    rows
}

/// Height of the legend in rows above a panel of the given width, mm.
pub(crate) fn height_above(entries: &[Entry], width: f64, style: &Style) -> f64 {
    rows(entries, width, style).len() as f64 * style.line()
}

/// Chooses the position for a panel in `rect`.
pub(crate) fn stand(prepared: &Prepared, rect: Rect, style: &Style) -> Stand {
    if prepared.entries.is_empty() {
        return Stand::Nowhere;
    }
    match prepared.panel.legend {
        Legend::Hidden => Stand::Nowhere,
        Legend::Above => Stand::Above,
        Legend::Right => Stand::Right,
        Legend::TopLeft => Stand::Inside(0.0, 0.0),
        Legend::TopRight => Stand::Inside(1.0, 0.0),
        Legend::BottomLeft => Stand::Inside(0.0, 1.0),
        Legend::BottomRight => Stand::Inside(1.0, 1.0),
        Legend::Auto => {
            let size = column_size(&prepared.entries, style);
            if size.0 > 0.65 * rect.width() || size.1 > 0.6 * rect.height() {
                return Stand::Above;
            }
            let seen = Occupancy::new(prepared, &prepared.frame(rect), style);
            INSIDE
                .into_iter()
                .find(|&(a, b)| !seen.any(inside(rect, size, a, b, style)))
                .map_or(Stand::Above, |(a, b)| Stand::Inside(a, b))
        }
    }
}

/// The legend's box inside a panel.
fn inside(rect: Rect, size: (f64, f64), across: f64, down: f64, style: &Style) -> Rect {
    let free = rect.grown(-style.pad);
    let left = free.left + across * (free.width() - size.0);
    let top = free.top + down * (free.height() - size.1);
    Rect {
        left,
        top,
        right: left + size.0,
        bottom: top + size.1,
    }
}

/// Which cells of a panel hold data.
struct Occupancy {
    rect: Rect,
    cells: Vec<bool>,
}

impl Occupancy {
    const COLUMNS: usize = 96;
    const ROWS: usize = 72;

    fn new(prepared: &Prepared, frame: &Frame, style: &Style) -> Occupancy {
        let mut seen = Occupancy {
            rect: frame.rect,
            cells: vec![false; Self::COLUMNS * Self::ROWS],
        };
        for layer in &prepared.panel.layers {
            match layer {
                Layer::Heatmap(_) | Layer::CategoryMap(_) => seen.cells.fill(true),
                Layer::Line(line) => {
                    let mut before = None;
                    for &point in &line.points {
                        let at = frame.place(point);
                        if let Some(to) = at {
                            seen.mark_line(before.unwrap_or(to), to);
                        }
                        before = at;
                    }
                }
                Layer::Stems(_) | Layer::Bars(_) => {
                    let foot = frame.upright(prepared.foot(layer));
                    for at in layer.points().iter().filter_map(|p| frame.place(*p)) {
                        let foot = Point::new(at.x, foot.unwrap_or(at.y));
                        seen.mark_line(foot, at);
                        if let Layer::Bars(bars) = layer
                            && let (Some(a), Some(b)) =
                                (frame.across(0.0), frame.across(bars.width / 2.0))
                        {
                            let half = (b - a).abs();
                            seen.mark_line(
                                Point::new(at.x - half, at.y),
                                Point::new(at.x + half, at.y),
                            );
                        }
                    }
                }
                Layer::Rule(rule) => {
                    if let Some((a, b)) = frame.rule(rule) {
                        seen.mark_line(a, b);
                    }
                }
                Layer::Note(note) => {
                    for place in [Some(note.at), note.tip].into_iter().flatten() {
                        if let Some(at) = note::point(frame, place) {
                            seen.mark(at);
                        }
                    }
                    if let Some(area) = note::area(frame, note, style) {
                        let mut y = area.top;
                        while y <= area.bottom {
                            seen.mark_line(Point::new(area.left, y), Point::new(area.right, y));
                            y += 0.4;
                        }
                    }
                }
                Layer::Points(_) | Layer::Markers(_) => {
                    for at in layer.points().iter().filter_map(|p| frame.place(*p)) {
                        seen.mark(at);
                    }
                }
                Layer::Band(_) => {}
            }
        }
        seen
    }

    fn cell(&self, p: Point) -> (f64, f64) {
        (
            (p.x - self.rect.left) / self.rect.width() * Self::COLUMNS as f64,
            (p.y - self.rect.top) / self.rect.height() * Self::ROWS as f64,
        )
    }

    fn mark(&mut self, p: Point) {
        let (column, row) = self.cell(p);
        if column >= 0.0 && row >= 0.0 && column < Self::COLUMNS as f64 && row < Self::ROWS as f64 {
            self.cells[row as usize * Self::COLUMNS + column as usize] = true;
        }
    }

    fn mark_line(&mut self, from: Point, to: Point) {
        let (a, b) = (self.cell(from), self.cell(to));
        let steps = ((b.0 - a.0).abs().max((b.1 - a.1).abs()).ceil()).clamp(1.0, 2000.0) as usize;
        for step in 0..=steps {
            let t = step as f64 / steps as f64;
            self.mark(Point::new(
                from.x + t * (to.x - from.x),
                from.y + t * (to.y - from.y),
            ));
        }
    }

    fn any(&self, area: Rect) -> bool {
        let (left, top) = self.cell(Point::new(area.left, area.top));
        let (right, bottom) = self.cell(Point::new(area.right, area.bottom));
        let clamp = |v: f64, count: usize| (v.max(0.0) as usize).min(count - 1);
        (clamp(top, Self::ROWS)..=clamp(bottom, Self::ROWS)).any(|row| {
            (clamp(left, Self::COLUMNS)..=clamp(right, Self::COLUMNS))
                .any(|column| self.cells[row * Self::COLUMNS + column])
        })
    }
}

/// Draws the legend of a panel in `rect`; `above` is the bottom of the rows above the panel, and
/// `right` the left edge of the column to the right of it.
pub(crate) fn draw(
    scene: &mut Scene,
    prepared: &Prepared,
    stand: Stand,
    rect: Rect,
    above: f64,
    right: f64,
    style: &Style,
) {
    let entries = &prepared.entries;
    match stand {
        Stand::Nowhere => {}
        Stand::Inside(across, down) => {
            let area = inside(rect, column_size(entries, style), across, down, style);
            scene.group("legend", "", |scene| {
                scene.fill(area.outline(), Colour::WHITE.alpha(0.85), None);
                draw_column(scene, entries, area.left + style.pad, area.top, style);
            });
        }
        Stand::Right => scene.group("legend", "", |scene| {
            draw_column(scene, entries, right, rect.top, style);
        }),
        Stand::Above => scene.group("legend", "", |scene| {
            let rows = rows(entries, rect.width(), style);
            let count = rows.len();
            for (number, row) in rows.into_iter().enumerate() {
                let middle = above - (count - number) as f64 * style.line() + style.line() / 2.0;
                let mut left = rect.left;
                for entry in row {
                    let sample = swatch_width(entry, style);
                    draw_entry(scene, entry, left, sample, middle, style);
                    left += entry_width(entry, style) + style.gap;
                }
            }
        }),
    }
}

fn draw_column(scene: &mut Scene, entries: &[Entry], left: f64, top: f64, style: &Style) {
    let sample = widest_swatch(entries, style);
    for (number, entry) in entries.iter().enumerate() {
        let middle = top + style.pad / 2.0 + (number as f64 + 0.5) * style.line();
        draw_entry(scene, entry, left, sample, middle, style);
    }
}

fn draw_entry(
    scene: &mut Scene,
    entry: &Entry,
    left: f64,
    sample: f64,
    middle: f64,
    style: &Style,
) {
    let centre = Point::new(left + sample / 2.0, middle);
    match &entry.sample {
        Sample::Line { width, dash } => {
            let (from, to) = (Point::new(left, middle), Point::new(left + sample, middle));
            let stroke = Stroke {
                dash: dash.lengths(*width),
                ..Stroke::solid(*width, entry.colour)
            };
            scene.line(from, to, stroke);
        }
        Sample::Dot { diameter } => {
            scene.fill(disc(centre, diameter / 2.0), entry.colour, None);
        }
        Sample::Marker { shape, size, open } => {
            marker(scene, centre, *shape, *size, entry.colour, *open, false);
        }
        Sample::Stem => {
            scene.line(
                Point::new(centre.x, middle + 1.0),
                Point::new(centre.x, middle - 0.5),
                Stroke::solid(0.25, entry.colour),
            );
            scene.fill(
                disc(Point::new(centre.x, middle - 0.5), 0.5),
                entry.colour,
                None,
            );
        }
        Sample::Area => {
            let half = (sample / 2.0).min(1.25);
            let height = 0.36 * style.line();
            let area = Rect {
                left: centre.x - half,
                right: centre.x + half,
                top: middle - height,
                bottom: middle + height,
            };
            scene.fill(area.outline(), entry.colour, None);
            scene.stroke(
                area.outline(),
                Stroke::solid(0.07, Colour::rgb(120, 120, 120)),
                None,
            );
        }
    }
    let words = Words::set(&entry.label, style.legend, false);
    let at = Point::new(left + sample + style.pad, middle);
    scene.words(words.place(at, Across::Left, Upright::Middle, INK));
}
