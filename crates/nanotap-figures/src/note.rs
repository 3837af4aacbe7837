//! Notes in a panel: their position, their text, their arrow.

use crate::colour::Colour;
use crate::layer::{Note, Place, Side};
use crate::prepared::Frame;
use crate::scene::Scene;
use crate::shape::{Point, Rect, Segment, Stroke};
use crate::style::Style;
use crate::text::{Across, MM_PER_POINT, PlacedWords, Upright, Words};

/// Position of a note on the page.
pub(crate) fn point(frame: &Frame, place: Place) -> Option<Point> {
    match place {
        Place::Data(x, y) => frame.place((x, y)),
        Place::Panel(x, y) if x.is_finite() && y.is_finite() => Some(Point::new(
            frame.rect.left + x * frame.rect.width(),
            frame.rect.bottom - y * frame.rect.height(),
        )),
        Place::Panel(..) => None,
    }
}

/// The text of a note at its position: kept inside the panel if it starts there.
fn words(frame: &Frame, note: &Note, style: &Style) -> Option<PlacedWords> {
    let at = point(frame, note.at)?;
    let words = Words::set(&note.text, style.legend, false);
    let gap = style.pad;
    let (across, upright, dx, dy) = match note.side {
        Side::Right => (Across::Left, Upright::Middle, gap, 0.0),
        Side::Left => (Across::Right, Upright::Middle, -gap, 0.0),
        Side::Above => (Across::Centre, Upright::Bottom, 0.0, -0.5 * gap),
        Side::Below => (Across::Centre, Upright::Top, 0.0, gap),
        Side::Centre => (Across::Centre, Upright::Middle, 0.0, 0.0),
    };
    let mut placed = words.place(
        Point::new(at.x + dx, at.y + dy),
        across,
        upright,
        note.colour.unwrap_or(Colour::BLACK),
    );
    let room = frame.rect.grown(-gap);
    if frame.rect.contains(at) && placed.words.width <= room.width() {
        placed.origin.x = placed
            .origin
            .x
            .clamp(room.left, room.right - placed.words.width);
        placed.origin.y = placed.origin.y.clamp(
            room.top + placed.words.cap_height(),
            room.bottom - placed.words.descent(),
        );
    }
    Some(placed)
}

/// The box of a note's text.
pub(crate) fn area(frame: &Frame, note: &Note, style: &Style) -> Option<Rect> {
    let placed = words(frame, note, style)?;
    (placed.words.width > 0.0).then(|| Rect {
        left: placed.origin.x,
        right: placed.origin.x + placed.words.width,
        top: placed.origin.y - placed.words.cap_height(),
        bottom: placed.origin.y + placed.words.descent(),
    })
}

/// Draws a note, with its arrow.
pub(crate) fn draw(scene: &mut Scene, frame: &Frame, note: &Note, style: &Style) {
    if let (Some(from), Some(to)) = (
        point(frame, note.at),
        note.tip.and_then(|tip| point(frame, tip)),
    ) {
        arrow(scene, from, to, note.colour.unwrap_or(Colour::BLACK));
    }
    if let Some(placed) = words(frame, note, style) {
        if !placed.words.runs.is_empty() {
            // A white edge keeps the text readable over data.
            let halo = Stroke {
                round: true,
                ..Stroke::solid(0.6, Colour::WHITE.alpha(0.8))
            };
            scene.stroke(placed.outline(), halo, None);
        }
        scene.words(placed);
    }
}

fn arrow(scene: &mut Scene, from: Point, to: Point, colour: Colour) {
    let length = from.distance(to);
    if length < 1e-6 {
        return;
    }
    let head = 1.5f64.min(length);
    let (ux, uy) = ((to.x - from.x) / length, (to.y - from.y) / length);
    let back = |along: f64, aside: f64| {
        Point::new(
            to.x - along * ux - aside * uy,
            to.y - along * uy + aside * ux,
        )
    };
    scene.line(
        from,
        back(0.8 * head, 0.0),
        Stroke::solid(0.6 * MM_PER_POINT, colour),
    );
    scene.fill(
        vec![
            Segment::Move(to),
            Segment::Line(back(head, 0.3 * head)),
            Segment::Line(back(0.8 * head, 0.0)),
            Segment::Line(back(head, -0.3 * head)),
            Segment::Close,
        ],
        colour,
        None,
    );
}
