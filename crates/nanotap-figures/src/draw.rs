//! Panels drawn onto the page.

use crate::axis::Axis;
use crate::cloud::Cloud;
use crate::colour::Colour;
use crate::layer::{CategoryMap, Heatmap, Layer, Line, Markers, Points};
use crate::layout::{self, Spot};
use crate::legend;
use crate::marks::Marks;
use crate::note;
use crate::polyline;
use crate::prepared::{ColourBar, Frame, Prepared};
use crate::raster::Raster;
use crate::scene::{Item, Scene};
use crate::shape::{Point, Rect, Stroke};
use crate::style::{EDGE, INK, Style};
use crate::symbol::{disc, marker, strokes};
use crate::text::{Across, MM_PER_POINT, Upright, Words};

/// Steps of a colour scale: as many as a palette holds.
const STEPS: usize = 255;
/// Distance to which lines are followed beyond the box, so that their joints are not visible, mm.
const BEYOND: f64 = 1.0;

pub(crate) fn panel(scene: &mut Scene, prepared: &Prepared, spot: &Spot, style: &Style) {
    let frame = prepared.frame(spot.rect);
    scene.group("panel", prepared.letter, |scene| {
        let mut order: Vec<usize> = (0..prepared.panel.layers.len()).collect();
        order.sort_by_key(|i| prepared.panel.layers[*i].depth());
        if prepared.empty {
            no_data(scene, spot.rect, style);
        }
        let mut bars = prepared.bars.iter();
        for index in order {
            let own = &prepared.panel.layers[index];
            let bar = matches!(own, Layer::Heatmap(_))
                .then(|| bars.next())
                .flatten();
            layer(scene, prepared, &frame, own, bar, style);
        }
        axes(scene, prepared, spot, style);
        let mut edge = spot.rect.right;
        for bar in &prepared.bars {
            edge = colour_bar(scene, bar, spot.rect, edge, style);
        }
        headings(scene, prepared, spot, edge, style);
    });
}

fn no_data(scene: &mut Scene, rect: Rect, style: &Style) {
    let centre = Point::new(
        f64::midpoint(rect.left, rect.right),
        f64::midpoint(rect.top, rect.bottom),
    );
    let words = Words::set("no data", style.label, false);
    scene.words(words.place(centre, Across::Centre, Upright::Middle, Colour::GREY));
}

fn layer(
    scene: &mut Scene,
    prepared: &Prepared,
    frame: &Frame,
    layer: &Layer,
    bar: Option<&ColourBar>,
    style: &Style,
) {
    let colour = layer.look().map_or(Colour::BLACK, |look| look.0);
    match layer {
        Layer::Line(line) => scene.group("line", &line.label, |s| {
            draw_line(s, frame, line, colour);
        }),
        Layer::Points(points) => {
            scene.group("points", &points.label, |s| {
                draw_points(s, frame, points, colour);
            });
        }
        Layer::Markers(markers) => {
            scene.group("markers", &markers.label, |s| {
                draw_markers(s, frame, markers, colour);
            });
        }
        Layer::Rule(rule) => scene.group("rule", &rule.label, |scene| {
            let width = rule.width * MM_PER_POINT;
            let stroke = Stroke {
                dash: rule.dash.lengths(width),
                ..Stroke::solid(width, colour)
            };
            if let Some((from, to)) = frame.rule(rule)
                && frame.rect.contains(from)
            {
                scene.line(from, to, stroke);
            }
        }),
        Layer::Band(band) => scene.group("band", &band.label, |scene| {
            let mut outline = Vec::new();
            for &(from, to) in &band.intervals {
                outline.extend(
                    band_area(frame, from, to, band.along_x)
                        .into_iter()
                        .flat_map(Rect::outline),
                );
            }
            scene.fill(outline, colour, Some(frame.rect));
        }),
        Layer::Heatmap(map) => {
            if let Some(bar) = bar {
                scene.group("heatmap", &map.scale.label, |s| {
                    draw_heatmap(s, frame, map, bar);
                });
            }
        }
        Layer::CategoryMap(map) => {
            scene.group("categories", "", |s| draw_categories(s, frame, map));
        }
        Layer::Stems(stems) => scene.group("stems", &stems.label, |scene| {
            let foot = frame
                .upright(prepared.foot(layer))
                .unwrap_or(frame.rect.bottom);
            let tops: Vec<Point> = layer
                .points()
                .iter()
                .filter_map(|p| frame.place(*p))
                .collect();
            let lines: Vec<(Point, Point)> =
                tops.iter().map(|p| (Point::new(p.x, foot), *p)).collect();
            let stroke = Stroke::solid(0.8 * MM_PER_POINT, colour);
            scene.stroke(strokes(&lines), stroke, Some(frame.rect));
            for top in tops.into_iter().filter(|p| frame.rect.contains(*p)) {
                scene.fill(disc(top, 0.65), colour, None);
            }
        }),
        Layer::Bars(bars) => scene.group("bars", &bars.label, |scene| {
            let foot = frame
                .upright(prepared.foot(layer))
                .unwrap_or(frame.rect.bottom);
            for &(x, y) in &bars.points {
                let (Some(top), Some(left), Some(right)) = (
                    frame.upright(y),
                    frame.across(x - bars.width / 2.0),
                    frame.across(x + bars.width / 2.0),
                ) else {
                    continue;
                };
                let area = Rect {
                    left: left.min(right),
                    right: left.max(right),
                    top: top.min(foot),
                    bottom: top.max(foot),
                };
                scene.fill(area.outline(), colour, Some(frame.rect));
            }
        }),
        Layer::Note(note) => scene.group("note", "", |s| note::draw(s, frame, note, style)),
    }
}

fn draw_line(scene: &mut Scene, frame: &Frame, line: &Line, colour: Colour) {
    let width = line.width * MM_PER_POINT;
    let points = line.points.iter().map(|p| frame.place(*p));
    let parts = polyline::visible(points, frame.rect.grown(BEYOND));
    let dash = line.dash.lengths(width);
    let stroke = Stroke {
        // Round ends make points between gaps visible; dashes need cut ends to keep their lengths.
        round: dash.is_empty(),
        dash,
        ..Stroke::solid(width, colour)
    };
    scene.stroke(polyline::segments(&parts), stroke, Some(frame.rect));
}

fn draw_points(scene: &mut Scene, frame: &Frame, points: &Points, colour: Colour) {
    let radius = points.diameter / 2.0;
    let bounds = frame.rect.grown(radius);
    let visible: Vec<Point> = points
        .points
        .iter()
        .filter_map(|p| frame.place(*p))
        .filter(|p| bounds.contains(*p))
        .collect();
    if !visible.is_empty() {
        scene.items.push(Item::Cloud(Cloud {
            points: visible,
            radius,
            colour,
            clip: frame.rect,
        }));
    }
}

fn draw_markers(scene: &mut Scene, frame: &Frame, markers: &Markers, colour: Colour) {
    // A marker on the edge of the range must not be lost to rounding.
    let bounds = frame.rect.grown(0.01);
    for at in markers.points.iter().filter_map(|p| frame.place(*p)) {
        if bounds.contains(at) {
            marker(
                scene,
                at,
                markers.shape,
                markers.size,
                colour,
                markers.open,
                markers.edge,
            );
        }
    }
}

fn band_area(frame: &Frame, from: f64, to: f64, along_x: bool) -> Option<Rect> {
    if from.is_nan() || to.is_nan() {
        return None;
    }
    let rect = frame.rect;
    let (view, start, end) = if along_x {
        (frame.x, rect.left, rect.right)
    } else {
        (frame.y, rect.bottom, rect.top)
    };
    // An end that cannot be shown (infinite, or not positive on a logarithmic axis) is the panel's
    // edge.
    let share = |value: f64| {
        view.share(value).unwrap_or_else(|| {
            let low = value == f64::NEG_INFINITY || value <= 0.0;
            if low == (view.from < view.to) {
                0.0
            } else {
                1.0
            }
        })
    };
    let at = |value: f64| start + share(value).clamp(0.0, 1.0) * (end - start);
    let (a, b) = (at(from).min(at(to)), at(from).max(at(to)));
    (b > a).then_some(if along_x {
        Rect {
            left: a,
            right: b,
            ..rect
        }
    } else {
        Rect {
            top: a,
            bottom: b,
            ..rect
        }
    })
}

fn draw_heatmap(scene: &mut Scene, frame: &Frame, map: &Heatmap, bar: &ColourBar) {
    let palette: Vec<Colour> = (0..=STEPS)
        .map(|i| map.map.at(i as f64 / STEPS as f64))
        .collect();
    let colour = |value: f64| {
        if !bar.axis.holds(value) {
            return Colour::WHITE.alpha(0.0);
        }
        let share = bar.view.share(value).unwrap_or(0.0).clamp(0.0, 1.0);
        palette[(share * STEPS as f64).round() as usize]
    };
    let cells: Vec<Colour> = map.values.iter().map(|v| colour(*v)).collect();
    grid(scene, frame, map.columns, &cells, map.x, map.y);
}

fn draw_categories(scene: &mut Scene, frame: &Frame, map: &CategoryMap) {
    let colour = |cell: usize| map.categories.get(cell)?.colour;
    let cells: Vec<Colour> = map
        .cells
        .iter()
        .map(|cell| cell.and_then(colour).unwrap_or(Colour::WHITE.alpha(0.0)))
        .collect();
    grid(scene, frame, map.columns, &cells, map.x, map.y);
}

/// Draws cells given in order of increasing x and y.
fn grid(
    scene: &mut Scene,
    frame: &Frame,
    columns: usize,
    cells: &[Colour],
    x: (f64, f64),
    y: (f64, f64),
) {
    let (Some(a), Some(b)) = (frame.place((x.0, y.0)), frame.place((x.1, y.1))) else {
        return;
    };
    let mut rows: Vec<Vec<Colour>> = cells.chunks(columns).map(<[Colour]>::to_vec).collect();
    // Pixels start at the top left, cells with the smallest y, which is mostly at the bottom.
    if a.y > b.y {
        rows.reverse();
    }
    if a.x > b.x {
        for row in &mut rows {
            row.reverse();
        }
    }
    scene.items.push(Item::Raster(Raster {
        rect: Rect {
            left: a.x.min(b.x),
            right: a.x.max(b.x),
            top: a.y.min(b.y),
            bottom: a.y.max(b.y),
        },
        clip: frame.rect,
        columns,
        rows: rows.len(),
        pixels: rows.concat(),
    }));
}

/// The box, its ticks with their labels, and the axis labels.
fn axes(scene: &mut Scene, prepared: &Prepared, spot: &Spot, style: &Style) {
    let rect = spot.rect;
    scene.stroke(rect.outline(), Stroke::solid(style.axis, INK), None);
    scene.group("axis-x", &prepared.panel.x.label, |scene| {
        horizontal_axis(scene, prepared, spot, style);
    });
    scene.group("axis-y", &prepared.panel.y.label, |scene| {
        let axis = &prepared.panel.y;
        let marks = axis
            .marked()
            .then(|| Marks::new(axis, prepared.y, rect.height(), true, style));
        let outer = rect.left - spot.sides.left_marks - style.pad;
        vertical_axis(scene, (axis, marks), rect, (false, outer), style);
    });
}

/// The ticks below a panel, their labels and the axis label.
fn horizontal_axis(scene: &mut Scene, prepared: &Prepared, spot: &Spot, style: &Style) {
    let rect = spot.rect;
    let mut note_width = 0.0;
    if prepared.panel.x.marked() {
        let marks = Marks::new(&prepared.panel.x, prepared.x, rect.width(), false, style);
        let at = |share: f64| rect.left + share * rect.width();
        ticks(scene, &marks, style, |share, length| {
            let x = at(share);
            (
                Point::new(x, rect.bottom),
                Point::new(x, rect.bottom + length),
            )
        });
        if prepared.words_below {
            let top = rect.bottom + style.mark + style.pad;
            for (share, words) in marks.major {
                // Powers of ten are taller than plain numbers; their baselines agree all the same.
                let base = Point::new(at(share), top + 1.1 * words.cap_height());
                scene.words(words.place(base, Across::Centre, Upright::Baseline, INK));
            }
            if let Some(note) = marks.note {
                note_width = note.width + style.gap;
                let base = rect.bottom + spot.sides.bottom_marks + style.pad + note.cap_height();
                let end = Point::new(rect.right, base);
                scene.words(note.place(end, Across::Right, Upright::Baseline, INK));
            }
        }
    }
    if prepared.words_below {
        let words = Words::set(&prepared.panel.x.words(), style.label, false);
        let base =
            rect.bottom + spot.sides.bottom_marks + spot.sides.bottom_label - words.descent();
        let end = if layout::shares_row(prepared, rect.width(), style) {
            rect.right - note_width
        } else {
            rect.right
        };
        let centre = f64::midpoint(rect.left, rect.right).min(end - words.width / 2.0);
        let at = Point::new(centre, base);
        scene.words(words.place(at, Across::Centre, Upright::Baseline, INK));
    }
}

/// The ticks at the left or (`right`) the right edge of `rect`, their labels and the axis label,
/// whose descenders end at `outer`.
fn vertical_axis(
    scene: &mut Scene,
    (axis, marks): (&Axis, Option<Marks>),
    rect: Rect,
    (right, outer): (bool, f64),
    style: &Style,
) {
    if let Some(marks) = marks {
        let (edge, outwards, across) = if right {
            (rect.right, 1.0, Across::Left)
        } else {
            (rect.left, -1.0, Across::Right)
        };
        let at = |share: f64, length: f64| {
            Point::new(
                edge + outwards * length,
                rect.bottom - share * rect.height(),
            )
        };
        ticks(scene, &marks, style, |share, length| {
            (at(share, 0.0), at(share, length))
        });
        for (share, words) in marks.major {
            let end = at(share, style.mark + style.pad);
            scene.words(words.place(end, across, Upright::Middle, INK));
        }
        if let Some(note) = marks.note {
            let corner = Point::new(rect.left, rect.top - style.pad);
            scene.words(note.place(corner, Across::Left, Upright::Baseline, INK));
        }
    }
    let words = Words::set(&axis.words(), style.label, false);
    let base = Point::new(
        outer - words.descent(),
        f64::midpoint(rect.top, rect.bottom),
    );
    scene.words(words.place_upwards(base, Across::Centre, Upright::Baseline, INK));
}

/// The tick lines of an axis; `line` gives their ends for a position on the axis and a length.
fn ticks(
    scene: &mut Scene,
    marks: &Marks,
    style: &Style,
    line: impl Fn(f64, f64) -> (Point, Point),
) {
    let major = marks.major.iter().map(|(share, _)| (share, style.mark));
    let minor = marks.minor.iter().map(|share| (share, style.minor_mark));
    let lines: Vec<(Point, Point)> = major
        .chain(minor)
        .map(|(share, length)| line(*share, length))
        .collect();
    scene.stroke(strokes(&lines), Stroke::solid(style.axis, INK), None);
}

/// Draws a colour bar right of `edge`; returns the new edge.
fn colour_bar(scene: &mut Scene, bar: &ColourBar, panel: Rect, edge: f64, style: &Style) -> f64 {
    let (gap, width) = layout::bar_shape(style);
    let rect = Rect {
        left: edge + gap,
        right: edge + gap + width,
        ..panel
    };
    let marks = Marks::new(bar.axis, bar.view, rect.height(), true, style);
    let whole = layout::bar_width(&marks, &bar.axis.words(), style);
    scene.group("colour-bar", &bar.axis.label, |scene| {
        let pixels = (0..=STEPS)
            .rev()
            .map(|i| bar.map.at(i as f64 / STEPS as f64))
            .collect();
        scene.items.push(Item::Raster(Raster {
            rect,
            clip: rect,
            columns: 1,
            rows: STEPS + 1,
            pixels,
        }));
        scene.stroke(rect.outline(), Stroke::solid(style.axis, INK), None);
        let outer = (true, edge + whole);
        vertical_axis(scene, (bar.axis, Some(marks)), rect, outer, style);
    });
    edge + whole
}

/// Legend, title and letter. `edge` is the right end of the colour bars.
fn headings(scene: &mut Scene, prepared: &Prepared, spot: &Spot, edge: f64, style: &Style) {
    let rect = spot.rect;
    let marks = Marks::new(&prepared.panel.y, prepared.y, rect.height(), true, style);
    let mut above = rect.top - style.pad;
    if prepared.panel.y.marked()
        && let Some(note) = marks.note
    {
        above -= note.cap_height() + note.descent() + style.pad;
    }
    legend::draw(
        scene,
        prepared,
        spot.stand,
        rect,
        above,
        edge + 2.0 * style.pad,
        style,
    );
    // Letters and titles of a row share a baseline, whatever lies between them and their box.
    let cap = Words::set("H", style.title, true).cap_height();
    let base = rect.top - spot.sides.top + EDGE / 2.0 + cap;
    if !prepared.panel.title.is_empty() {
        let words = Words::set(&prepared.panel.title, style.title, false);
        scene.words(words.place(
            Point::new(rect.left, base),
            Across::Left,
            Upright::Baseline,
            INK,
        ));
    }
    if !prepared.letter.is_empty() {
        let words = Words::set(prepared.letter, style.title, true);
        let outer = rect.left - spot.sides.left_marks - spot.sides.left_label + EDGE / 2.0;
        // Left of the box, clear of the title, but on the page.
        let left = outer
            .min(rect.left - words.width - style.pad)
            .max(EDGE / 2.0);
        scene.words(words.place(Point::new(left, base), Across::Left, Upright::Baseline, INK));
    }
}
