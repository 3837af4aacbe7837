//! Markers and their strokes.

use crate::colour::Colour;
use crate::layer::Shape;
use crate::scene::Scene;
use crate::shape::{Point, Segment, Stroke};

/// Outline of a circle as four cubic arcs.
pub(crate) fn disc(centre: Point, radius: f64) -> Vec<Segment> {
    // Four cubic arcs with the usual handle length come within 0.03 % of a circle.
    let handle = 0.552_284_75 * radius;
    let at = |x: f64, y: f64| Point::new(centre.x + x, centre.y + y);
    vec![
        Segment::Move(at(radius, 0.0)),
        Segment::Cubic(at(radius, handle), at(handle, radius), at(0.0, radius)),
        Segment::Cubic(at(-handle, radius), at(-radius, handle), at(-radius, 0.0)),
        Segment::Cubic(at(-radius, -handle), at(-handle, -radius), at(0.0, -radius)),
        Segment::Cubic(at(handle, -radius), at(radius, -handle), at(radius, 0.0)),
        Segment::Close,
    ]
}

/// A marker of the given size (mm); the shapes look equally large.
pub(crate) fn marker(
    scene: &mut Scene,
    at: Point,
    shape: Shape,
    size: f64,
    colour: Colour,
    open: bool,
    edge: bool,
) {
    let half = size / 2.0;
    let p = |x: f64, y: f64| Point::new(at.x + x * half, at.y + y * half);
    let polygon = |corners: &[(f64, f64)]| {
        let mut segments: Vec<Segment> = corners
            .iter()
            .enumerate()
            .map(|(i, &(x, y))| {
                if i == 0 {
                    Segment::Move(p(x, y))
                } else {
                    Segment::Line(p(x, y))
                }
            })
            .collect();
        segments.push(Segment::Close);
        segments
    };
    let line = (0.18 * size).clamp(0.1, 0.4);
    let outline = match shape {
        Shape::Circle => disc(at, half),
        Shape::Square => polygon(&[(-0.88, -0.88), (0.88, -0.88), (0.88, 0.88), (-0.88, 0.88)]),
        Shape::Triangle => polygon(&[(0.0, -1.15), (1.05, 0.75), (-1.05, 0.75)]),
        Shape::Diamond => polygon(&[(0.0, -1.25), (1.1, 0.0), (0.0, 1.25), (-1.1, 0.0)]),
        Shape::Cross | Shape::Plus => {
            let arms = if shape == Shape::Cross {
                [(p(-0.8, -0.8), p(0.8, 0.8)), (p(-0.8, 0.8), p(0.8, -0.8))]
            } else {
                [(p(-1.1, 0.0), p(1.1, 0.0)), (p(0.0, -1.1), p(0.0, 1.1))]
            };
            if edge {
                scene.stroke(
                    strokes(&arms),
                    Stroke::solid(2.2 * line, Colour::WHITE),
                    None,
                );
            }
            scene.stroke(strokes(&arms), Stroke::solid(line, colour), None);
            return;
        }
    };
    if edge {
        scene.stroke(
            outline.clone(),
            Stroke::solid(3.0 * line, Colour::WHITE),
            None,
        );
    }
    if open {
        scene.fill(outline.clone(), Colour::WHITE, None);
        scene.stroke(outline, Stroke::solid(line, colour), None);
    } else {
        scene.fill(outline, colour, None);
    }
}

/// Lines from point to point.
pub(crate) fn strokes(lines: &[(Point, Point)]) -> Vec<Segment> {
    lines
        .iter()
        .flat_map(|&(a, b)| [Segment::Move(a), Segment::Line(b)])
        .collect()
}
