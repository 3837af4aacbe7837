//! Very many equal dots, drawn as pixels so that a hundred thousand of them stay small on disk.

use crate::colour::Colour;
use crate::raster::{EMBEDDED_DPI, Raster, shaded};
use crate::shape::{Path, Point, Rect, Segment, Stroke};

/// Equal dots on the page, mm.
#[derive(Debug, Clone)]
pub(crate) struct Cloud {
    pub(crate) points: Vec<Point>,
    pub(crate) radius: f64,
    pub(crate) colour: Colour,
    pub(crate) clip: Rect,
}

/// Up to this number of dots, vector formats contain each one.
const VECTOR_LIMIT: usize = 3000;
/// Dots are placed to this fraction of a pixel. Where pixels are too small to be seen they are
/// placed to whole pixels, because equal dots compress better.
const PARTS: usize = 4;

impl Cloud {
    /// The dots as a path of round line ends, if there are few enough.
    pub(crate) fn path(&self) -> Option<Path> {
        if self.points.len() > VECTOR_LIMIT {
            return None;
        }
        let mut segments = Vec::with_capacity(2 * self.points.len());
        for &p in &self.points {
            // Some viewers omit lines of zero length; a thousandth of a millimetre is drawn.
            segments.push(Segment::Move(p));
            segments.push(Segment::Line(Point::new(p.x + 0.001, p.y)));
        }
        Some(Path {
            segments,
            fill: None,
            stroke: Some(Stroke {
                round: true,
                ..Stroke::solid(2.0 * self.radius, self.colour)
            }),
            clip: Some(self.clip),
        })
    }

    /// The dots as pixels of a grid of `dpi` dots per inch that starts at the page's top left.
    ///
    /// Opaque dots merge; translucent ones add up, so that the density is visible.
    pub(crate) fn raster(&self, dpi: f64) -> Option<Raster> {
        let scale = dpi / 25.4;
        let radius = self.radius * scale;
        let reach = radius.ceil() as isize + 1;
        let bounds = self.bounds()?;
        let left = (bounds.left * scale).floor() as isize - reach;
        let top = (bounds.top * scale).floor() as isize - reach;
        let columns = ((bounds.right * scale).floor() as isize + reach - left + 1) as usize;
        let rows = ((bounds.bottom * scale).floor() as isize + reach - top + 1) as usize;

        let parts = if dpi < EMBEDDED_DPI { PARTS } else { 1 };
        let stamps = Stamps::new(radius, reach, parts);
        let opacity = self.colour.opacity();
        let opaque = self.colour.a == 255;
        let mut coverage = vec![0f32; columns * rows];
        for p in &self.points {
            let (x, y) = (p.x * scale - left as f64, p.y * scale - top as f64);
            let (column, row) = (x.floor(), y.floor());
            let stamp = stamps.at(x - column, y - row);
            let side = stamps.side;
            let first =
                (row as usize - reach as usize) * columns + column as usize - reach as usize;
            for (line, weights) in stamp.chunks(side).enumerate() {
                let start = first + line * columns;
                for (cell, &weight) in coverage[start..start + side].iter_mut().zip(weights) {
                    *cell = if opaque {
                        cell.max(weight)
                    } else {
                        *cell + (1.0 - *cell) * weight * opacity as f32
                    };
                }
            }
        }
        let pixels = coverage
            .iter()
            .map(|&c| shaded(self.colour, f64::from(c)))
            .collect();
        Some(Raster {
            rect: Rect {
                left: left as f64 / scale,
                top: top as f64 / scale,
                right: (left + columns as isize) as f64 / scale,
                bottom: (top + rows as isize) as f64 / scale,
            },
            clip: self.clip,
            columns,
            rows,
            pixels,
        })
    }

    fn bounds(&self) -> Option<Rect> {
        let first = *self.points.first()?;
        let start = Rect {
            left: first.x,
            top: first.y,
            right: first.x,
            bottom: first.y,
        };
        Some(self.points.iter().fold(start, |b, p| Rect {
            left: b.left.min(p.x),
            top: b.top.min(p.y),
            right: b.right.max(p.x),
            bottom: b.bottom.max(p.y),
        }))
    }
}

/// The pixels of a dot, for each sub-pixel position of its centre.
struct Stamps {
    side: usize,
    parts: usize,
    weights: Vec<Vec<f32>>,
}

impl Stamps {
    fn new(radius: f64, reach: isize, parts: usize) -> Stamps {
        let side = (2 * reach + 1) as usize;
        let part = |k: usize| (k as f64 + 0.5) / parts as f64;
        let mut weights = Vec::with_capacity(parts * parts);
        for row in 0..parts {
            for column in 0..parts {
                let centre = Point::new(reach as f64 + part(column), reach as f64 + part(row));
                weights.push(
                    (0..side * side)
                        .map(|i| disc_share(centre, radius, (i % side) as f64, (i / side) as f64))
                        .collect(),
                );
            }
        }
        Stamps {
            side,
            parts,
            weights,
        }
    }

    fn at(&self, x: f64, y: f64) -> &[f32] {
        let part = |v: f64| ((v * self.parts as f64) as usize).min(self.parts - 1);
        &self.weights[part(y) * self.parts + part(x)]
    }
}

/// Fraction of the pixel with the corner (`column`, `row`) that the disc covers, from 8 × 8
/// samples.
fn disc_share(centre: Point, radius: f64, column: f64, row: f64) -> f32 {
    const SAMPLES: usize = 8;
    let inside = (0..SAMPLES * SAMPLES)
        .filter(|i| {
            let sample = Point::new(
                column + ((i % SAMPLES) as f64 + 0.5) / SAMPLES as f64,
                row + ((i / SAMPLES) as f64 + 0.5) / SAMPLES as f64,
            );
            sample.distance(centre) <= radius
        })
        .count();
    inside as f32 / (SAMPLES * SAMPLES) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(points: Vec<Point>, colour: Colour) -> Cloud {
        Cloud {
            points,
            radius: 0.5,
            colour,
            clip: Rect {
                left: 0.0,
                top: 0.0,
                right: 100.0,
                bottom: 100.0,
            },
        }
    }

    fn ink(raster: &Raster) -> f64 {
        raster.pixels.iter().map(|c| c.opacity()).sum()
    }

    #[test]
    fn a_dot_covers_its_area() {
        let raster = cloud(vec![Point::new(10.03, 20.01)], Colour::BLACK)
            .raster(600.0)
            .unwrap();
        let radius = 0.5 * 600.0 / 25.4;
        let area = std::f64::consts::PI * radius * radius;
        assert!((ink(&raster) / area - 1.0).abs() < 0.01);
        assert!(raster.rect.contains(Point::new(10.03, 20.01)));
    }

    #[test]
    fn opaque_dots_merge_and_translucent_dots_add() {
        let twice = vec![Point::new(10.0, 10.0); 2];
        let one = vec![Point::new(10.0, 10.0)];
        let opaque = |p| ink(&cloud(p, Colour::BLACK).raster(300.0).unwrap());
        assert_eq!(opaque(one.clone()), opaque(twice.clone()));
        let faint = |p| ink(&cloud(p, Colour::BLACK.alpha(0.4)).raster(300.0).unwrap());
        assert!(faint(twice) > 1.4 * faint(one));
    }

    #[test]
    fn few_dots_stay_vectors_and_none_draw_nothing() {
        let some = cloud(vec![Point::new(1.0, 1.0); 7], Colour::BLACK);
        let moves = some
            .path()
            .unwrap()
            .segments
            .iter()
            .filter(|s| matches!(s, Segment::Move(_)))
            .count();
        assert_eq!(moves, 7);
        assert!(
            cloud(vec![Point::new(1.0, 1.0); VECTOR_LIMIT + 1], Colour::BLACK)
                .path()
                .is_none()
        );
        assert!(cloud(Vec::new(), Colour::BLACK).raster(300.0).is_none());
    }
}
