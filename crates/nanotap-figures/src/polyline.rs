//! Reduces lines with very many corners without a visible change.

use crate::shape::{Point, Rect, Segment};

/// Corners closer than this to a straight line are removed, mm: a third of a dot at 1200 dpi.
const TOLERANCE: f64 = 0.007;
/// Corners within a column of this width are replaced by its first, lowest, highest and last, mm:
/// a dot at 1200 dpi.
const COLUMN: f64 = 0.02;

/// The visible parts of a line through `points` (`None`: a gap), cut at `bounds` and thinned.
///
/// A part with a single point is a point between gaps.
pub(crate) fn visible(
    points: impl IntoIterator<Item = Option<Point>>,
    bounds: Rect,
) -> Vec<Vec<Point>> {
    let mut parts = Vec::new();
    let mut part: Vec<Point> = Vec::new();
    let mut before: Option<Point> = None;
    let mut end = |part: &mut Vec<Point>| {
        if !part.is_empty() {
            parts.push(thinned(part));
            part.clear();
        }
    };
    for point in points {
        match (before, point) {
            (None, Some(p)) => {
                if bounds.contains(p) {
                    part.push(p);
                }
            }
            (Some(from), Some(to)) => match cut(from, to, bounds) {
                Some((a, b)) => {
                    if part.last() != Some(&a) {
                        end(&mut part);
                        part.push(a);
                    }
                    part.push(b);
                    if b != to {
                        end(&mut part);
                    }
                }
                None => end(&mut part),
            },
            (_, None) => end(&mut part),
        }
        before = point;
    }
    end(&mut part);
    parts
}

/// The part of a segment within a box (Liang and Barsky's method).
fn cut(from: Point, to: Point, bounds: Rect) -> Option<(Point, Point)> {
    if bounds.contains(from) && bounds.contains(to) {
        return Some((from, to));
    }
    let (dx, dy) = (to.x - from.x, to.y - from.y);
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for (speed, room) in [
        (-dx, from.x - bounds.left),
        (dx, bounds.right - from.x),
        (-dy, from.y - bounds.top),
        (dy, bounds.bottom - from.y),
    ] {
        if speed == 0.0 {
            if room < 0.0 {
                return None;
            }
        } else if speed < 0.0 {
            enter = enter.max(room / speed);
        } else {
            leave = leave.min(room / speed);
        }
    }
    if enter > leave {
        return None;
    }
    let at = |t: f64| Point::new(from.x + t * dx, from.y + t * dy);
    let start = if enter > 0.0 { at(enter) } else { from };
    let stop = if leave < 1.0 { at(leave) } else { to };
    Some((start, stop))
}

fn thinned(points: &[Point]) -> Vec<Point> {
    straightened(&column_extremes(points))
}

/// Replaces runs of points within one narrow column by their visible extremes.
fn column_extremes(points: &[Point]) -> Vec<Point> {
    let column = |p: &Point| (p.x / COLUMN).floor() as i64;
    let mut kept = Vec::new();
    for run in points.chunk_by(|a, b| column(a) == column(b)) {
        if run.len() <= 4 {
            kept.extend_from_slice(run);
            continue;
        }
        let place = |better: fn(f64, f64) -> bool| {
            (0..run.len()).fold(0, |best, i| {
                if better(run[i].y, run[best].y) {
                    i
                } else {
                    best
                }
            })
        };
        let mut places = [0, place(|a, b| a < b), place(|a, b| a > b), run.len() - 1];
        places.sort_unstable();
        let mut last = None;
        for i in places {
            if last != Some(i) {
                kept.push(run[i]);
                last = Some(i);
            }
        }
    }
    kept
}

/// Removes corners that lie on a straight line. From each kept corner a cone of directions is
/// propagated that passes every later corner within the tolerance. Where the next corner leaves the
/// cone, or turns back, the previous one is kept.
fn straightened(points: &[Point]) -> Vec<Point> {
    let Some(&first) = points.first() else {
        return Vec::new();
    };
    let mut kept = vec![first];
    let mut anchor = first;
    let mut last = first;
    // Direction of the cone's axis, and its lower and upper bound relative to the axis.
    let mut cone: Option<(f64, f64, f64)> = None;
    let mut farthest = 0.0;
    for &p in &points[1..] {
        let mut distance = anchor.distance(p);
        let mut direction = libm::atan2(p.y - anchor.y, p.x - anchor.x);
        let stays = distance >= farthest
            && cone.is_none_or(|(axis, low, high)| (low..=high).contains(&turn(direction - axis)));
        if !stays {
            kept.push(last);
            anchor = last;
            cone = None;
            farthest = 0.0;
            distance = anchor.distance(p);
            direction = libm::atan2(p.y - anchor.y, p.x - anchor.x);
        }
        if distance > TOLERANCE {
            let half = libm::asin(TOLERANCE / distance);
            cone = Some(match cone {
                None => (direction, -half, half),
                Some((axis, low, high)) => {
                    let middle = turn(direction - axis);
                    (axis, low.max(middle - half), high.min(middle + half))
                }
            });
            farthest = distance;
        }
        last = p;
    }
    if points.len() > 1 {
        kept.push(last);
    }
    kept
}

/// The angle between −π and π.
fn turn(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    if angle > PI {
        angle - TAU
    } else if angle < -PI {
        angle + TAU
    } else {
        angle
    }
}

/// A path through the parts; a single point becomes the shortest visible line.
pub(crate) fn segments(parts: &[Vec<Point>]) -> Vec<Segment> {
    let mut all = Vec::new();
    for part in parts {
        if let [only] = part[..] {
            all.push(Segment::Move(only));
            all.push(Segment::Line(Point::new(only.x + 0.001, only.y)));
            continue;
        }
        for (i, &p) in part.iter().enumerate() {
            all.push(if i == 0 {
                Segment::Move(p)
            } else {
                Segment::Line(p)
            });
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PAGE: Rect = Rect {
        left: 0.0,
        top: 0.0,
        right: 80.0,
        bottom: 60.0,
    };

    fn to_segment(p: Point, a: Point, b: Point) -> f64 {
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let length = dx * dx + dy * dy;
        let t = if length == 0.0 {
            0.0
        } else {
            (((p.x - a.x) * dx + (p.y - a.y) * dy) / length).clamp(0.0, 1.0)
        };
        p.distance(Point::new(a.x + t * dx, a.y + t * dy))
    }

    #[test]
    fn a_gap_splits_and_a_straight_line_needs_two_corners() {
        let line = (0..1000).map(|i| Some(Point::new(f64::from(i) * 0.05, 10.0)));
        assert_eq!(visible(line.clone(), PAGE)[0].len(), 2);
        let gapped = line
            .enumerate()
            .map(|(i, p)| if i == 500 { None } else { p });
        assert_eq!(visible(gapped, PAGE).len(), 2);
    }

    #[test]
    fn a_point_between_gaps_survives() {
        let lone = [None, Some(Point::new(5.0, 5.0)), None];
        assert_eq!(visible(lone, PAGE), vec![vec![Point::new(5.0, 5.0)]]);
    }

    #[test]
    fn what_crosses_the_page_from_outside_to_outside_is_kept() {
        let through = [Some(Point::new(-10.0, 30.0)), Some(Point::new(1e9, 30.0))];
        let parts = visible(through, PAGE);
        assert_eq!(parts.len(), 1);
        assert!(parts[0][0].distance(Point::new(0.0, 30.0)) < 1e-9);
        assert!(parts[0][1].distance(Point::new(80.0, 30.0)) < 1e-6);
    }

    #[test]
    fn turning_back_on_the_same_line_keeps_the_tip() {
        let path = [10.0, 20.0, 30.0, 20.0, 12.0].map(|x| Some(Point::new(x, 5.0)));
        assert!(visible(path, PAGE)[0].contains(&Point::new(30.0, 5.0)));
    }

    #[test]
    fn a_million_fast_oscillations_become_a_few_thousand_corners() {
        let points = (0..1_000_000).map(|i| {
            let t = f64::from(i) / 1e6;
            Some(Point::new(80.0 * t, 30.0 + 25.0 * (1e4 * t).sin()))
        });
        let corners: usize = visible(points, PAGE).iter().map(Vec::len).sum();
        assert!(corners < 20_000, "{corners}");
    }

    proptest! {
        #[test]
        fn thinning_moves_nothing_visibly(
            steps in prop::collection::vec((-0.2..0.2f64, -0.2..0.2f64), 2..400)
        ) {
            let mut at = Point::new(40.0, 30.0);
            let points: Vec<Point> = steps.iter().map(|(dx, dy)| {
                at = Point::new(at.x + dx, at.y + dy);
                at
            }).collect();
            let page = PAGE.grown(200.0);
            let parts = visible(points.iter().copied().map(Some), page);
            prop_assert_eq!(parts.len(), 1);
            prop_assert_eq!(parts[0][0], points[0]);
            prop_assert_eq!(parts[0].last(), points.last());
            for &p in &points {
                let off = parts[0].windows(2).map(|w| to_segment(p, w[0], w[1])).fold(f64::MAX, f64::min);
                prop_assert!(off <= 2.0 * TOLERANCE + COLUMN, "{off}");
            }
        }
    }
}
