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

        let opacity = Some(self.colour.opacity()).filter(|opacity| *opacity < 1.0);
        // A dot smaller than a pixel is spread over the pixels around it.
        let strength = if radius < 0.5 {
            3.0 * radius * radius / (radius + 0.5).powi(3)
        } else {
            1.0
        };
        let mut coverage = vec![0f32; columns * rows];
        for p in &self.points {
            let (x, y) = (p.x * scale - left as f64, p.y * scale - top as f64);
            let (column, row) = (x.floor(), y.floor());
            // Equal dots compress better. Pixels of this size are too small to be seen.
            let centre = if dpi < EMBEDDED_DPI {
                Point::new(x - column, y - row)
            } else {
                Point::new(0.5, 0.5)
            };
            for (down, across) in square(reach) {
                let distance = centre.distance(Point::new(across as f64 + 0.5, down as f64 + 0.5));
                let weight = strength * (radius + 0.5 - distance).clamp(0.0, 1.0);
                let place = (row as isize + down) * columns as isize + column as isize + across;
                let cell = &mut coverage[place as usize];
                *cell = match opacity {
                    None => cell.max(weight as f32),
                    Some(opacity) => *cell + (1.0 - *cell) * (weight * opacity) as f32,
                };
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

/// Rows and columns of the pixels up to `reach` from the one in the middle.
fn square(reach: isize) -> impl Iterator<Item = (isize, isize)> {
    (-reach..=reach).flat_map(move |row| (-reach..=reach).map(move |column| (row, column)))
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
