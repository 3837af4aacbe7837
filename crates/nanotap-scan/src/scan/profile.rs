//! The surface under the tip: features, sampled heights, and which material is where.

use std::f64::consts::TAU;
use std::path::Path;

use super::frames::centres;
use super::image::HeightImage;
use super::options::{Feature, MAX_FEATURES, ProfileOptions};
use nanotap_case::Case;
use nanotap_case::input::{MAX_TABLE_BYTES, decoded};
use nanotap_case::physical::Kind;
use nanotap_error::Error;

/// Most samples of a profile.
const MAX_SAMPLES: usize = 1_000_000;
/// Steepest slope between two samples of a profile.
const STEEPEST: f64 = 1000.0;

/// Height of the surface in m over the line, position in m.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    features: Vec<Shape>,
    samples: Option<Samples>,
    image: Option<HeightImage>,
}

/// A feature of the surface with lengths in m.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Step {
        from: f64,
        to: f64,
        height: f64,
    },
    Ramp {
        from: f64,
        to: f64,
        height: f64,
    },
    Sine {
        height: f64,
        period: f64,
        phase: f64,
    },
    Grating {
        height: f64,
        period: f64,
        duty: f64,
    },
    Gauss {
        at: f64,
        at_y: Option<f64>,
        width: f64,
        height: f64,
    },
    /// The path of a tip of radius `reach − radius` over a sphere that rests on the surface.
    Particle {
        at: f64,
        at_y: Option<f64>,
        radius: f64,
        reach: f64,
    },
}

/// Heights at rising positions, in m.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    at: Vec<f64>,
    heights: Vec<f64>,
}

impl Shape {
    fn of(feature: &Feature, tip_radius: f64) -> Result<Self, Error> {
        let length = |value: &super::options::Quantity| value.si(Kind::Length, "surface");
        let positive = |value: f64, what: &str| {
            if value > 0.0 {
                Ok(value)
            } else {
                Err(Error::option(
                    "surface",
                    format!("the {what} of a feature is not positive"),
                    format!("give a positive {what}"),
                ))
            }
        };
        let ordered = |from: f64, to: f64| {
            if from < to {
                Ok(())
            } else {
                Err(Error::option(
                    "surface",
                    "a feature ends before it begins",
                    "give `to` greater than `from`",
                ))
            }
        };
        Ok(match feature {
            Feature::Step { from, to, height } => {
                let (from, to) = (length(from)?, length(to)?);
                ordered(from, to)?;
                let height = length(height)?;
                Self::Step { from, to, height }
            }
            Feature::Ramp { from, to, height } => {
                let (from, to) = (length(from)?, length(to)?);
                ordered(from, to)?;
                let height = length(height)?;
                Self::Ramp { from, to, height }
            }
            Feature::Sine {
                height,
                period,
                phase,
            } => Self::Sine {
                height: length(height)?,
                period: positive(length(period)?, "period")?,
                phase: *phase,
            },
            Feature::Grating {
                height,
                period,
                duty,
            } => {
                if !(0.0..=1.0).contains(duty) {
                    return Err(Error::option(
                        "surface",
                        "the duty of a grating is not between 0 and 1",
                        "give the part of a period that is high",
                    ));
                }
                Self::Grating {
                    height: length(height)?,
                    period: positive(length(period)?, "period")?,
                    duty: *duty,
                }
            }
            Feature::Gauss {
                at,
                at_y,
                width,
                height,
            } => Self::Gauss {
                at: length(at)?,
                at_y: at_y.as_ref().map(length).transpose()?,
                width: positive(length(width)?, "width")?,
                height: length(height)?,
            },
            Feature::Particle { at, at_y, radius } => {
                let radius = positive(length(radius)?, "radius")?;
                Self::Particle {
                    at: length(at)?,
                    at_y: at_y.as_ref().map(length).transpose()?,
                    radius,
                    reach: radius + tip_radius,
                }
            }
        })
    }

    fn height(self, x: f64, y: f64) -> f64 {
        let square = |at: f64, at_y: Option<f64>| {
            let across = at_y.map_or(0.0, |at| y - at);
            (x - at) * (x - at) + across * across
        };
        match self {
            Self::Step { from, to, height } if x >= from && x < to => height,
            Self::Ramp { from, to, height } if x >= from && x < to => {
                height * (x - from) / (to - from)
            }
            Self::Step { .. } | Self::Ramp { .. } => 0.0,
            Self::Sine {
                height,
                period,
                phase,
            } => height * nanotap_arithmetic::sin(TAU * x / period + phase),
            Self::Grating {
                height,
                period,
                duty,
            } => {
                let part = (x / period).rem_euclid(1.0);
                if part < duty { height } else { 0.0 }
            }
            Self::Gauss {
                at,
                at_y,
                width,
                height,
            } => height * nanotap_arithmetic::exp(-square(at, at_y) / (2.0 * width * width)),
            Self::Particle {
                at,
                at_y,
                radius,
                reach,
            } => {
                // The tip's lowest point, its centre at `reach` from the particle's.
                let above = reach * reach - square(at, at_y);
                let height = above.max(0.0).sqrt() + radius - (reach - radius);
                height.max(0.0)
            }
        }
    }
}

impl Surface {
    /// The surface of these features, `tip_radius` for particles.
    pub(super) fn new(features: &[Feature], tip_radius: f64) -> Result<Self, Error> {
        if features.len() > MAX_FEATURES {
            return Err(Error::option(
                "surface",
                format!("{} features are too many", features.len()),
                format!("give at most {MAX_FEATURES}"),
            ));
        }
        let each = features.iter();
        Ok(Self {
            features: each
                .map(|feature| Shape::of(feature, tip_radius))
                .collect::<Result<_, _>>()?,
            samples: None,
            image: None,
        })
    }

    /// Adds sampled heights to the surface.
    pub(super) fn with_samples(mut self, samples: Samples) -> Self {
        self.samples = Some(samples);
        self
    }

    /// Adds the heights of an image to the surface.
    pub(super) fn with_image(mut self, image: HeightImage) -> Self {
        self.image = Some(image);
        self
    }

    /// The height at a position in m.
    pub(super) fn height(&self, x: f64, y: f64) -> f64 {
        let features: f64 = self.features.iter().map(|shape| shape.height(x, y)).sum();
        features
            + self.samples.as_ref().map_or(0.0, |samples| samples.at(x))
            + self.image.as_ref().map_or(0.0, |image| image.at(x, y))
    }
}

impl Samples {
    /// Heights of a profile over a line of length `size`.
    pub(super) fn of(profile: &ProfileOptions, case: &Case, size: f64) -> Result<Self, Error> {
        match profile {
            ProfileOptions::Heights(heights) => Self::evenly(heights.clone(), size),
            ProfileOptions::File(name) => {
                let (name, bytes) = case.file(name, MAX_TABLE_BYTES)?;
                let text = decoded(Path::new(&name), bytes)?;
                Self::parse(&text, &name, size)
            }
        }
    }

    fn evenly(heights: Vec<f64>, size: f64) -> Result<Self, Error> {
        let at = centres(heights.len(), size);
        Self::checked(at, heights, "profile", 1)
    }

    /// Heights, or positions and heights, of a CSV text: numbers in m, or in the units in
    /// parentheses of a header.
    fn parse(text: &str, name: &str, size: f64) -> Result<Self, Error> {
        let mut factors = [1.0; 2];
        let mut columns: Option<usize> = None;
        let mut rows: [Vec<f64>; 2] = Default::default();
        let mut first = 0;
        let refuse = |row: usize, what: String| {
            Error::input(
                format!("{name}: row {row}: {what}"),
                "give one column of heights, or two of position and height",
            )
        };
        for (index, line) in text.lines().enumerate() {
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let cells: Vec<&str> = line.split([',', ';', '\t']).map(str::trim).collect();
            let numbers: Option<Vec<f64>> = cells.iter().map(|cell| cell.parse().ok()).collect();
            if columns.is_none() && numbers.is_none() {
                for (factor, cell) in factors.iter_mut().zip(&cells) {
                    let unit = cell
                        .rsplit_once('(')
                        .and_then(|(_, rest)| rest.split_once(')'));
                    if let Some((unit, _)) = unit {
                        *factor = Kind::Length
                            .parse(&format!("1 {unit}"))
                            .map_err(|error| refuse(index + 1, error.to_string()))?;
                    }
                }
                columns = Some(cells.len());
                continue;
            }
            let Some(numbers) = numbers else {
                return Err(refuse(
                    index + 1,
                    format!("`{line}` is not a row of numbers"),
                ));
            };
            let expected = *columns.get_or_insert(numbers.len());
            if numbers.len() != expected || !(1..=2).contains(&expected) {
                let what = format!("{} columns in place of {expected}", numbers.len());
                return Err(refuse(index + 1, what));
            }
            if rows[0].is_empty() {
                first = index + 1;
            }
            if rows[0].len() >= MAX_SAMPLES {
                return Err(refuse(
                    index + 1,
                    format!("more than {MAX_SAMPLES} samples"),
                ));
            }
            for ((row, number), factor) in rows.iter_mut().zip(numbers).zip(factors) {
                row.push(number * factor);
            }
        }
        let [one, two] = rows;
        if two.is_empty() {
            Self::checked(centres(one.len(), size), one, name, first)
        } else {
            Self::checked(one, two, name, first)
        }
    }

    /// Refuses samples that are not finite, not sorted, or too steep; `first` is the row of the
    /// first.
    fn checked(at: Vec<f64>, heights: Vec<f64>, name: &str, first: usize) -> Result<Self, Error> {
        if heights.is_empty() || heights.len() > MAX_SAMPLES {
            return Err(Error::input(
                format!("{name}: {} samples of the height", heights.len()),
                format!("give 1 to {MAX_SAMPLES} samples"),
            ));
        }
        let refuse = |k: usize, what: String, remedy: &str| {
            Err(Error::input(
                format!("{name}: row {}: {what}", first + k),
                remedy,
            ))
        };
        for (k, (x, h)) in at.iter().zip(&heights).enumerate() {
            if !(x.is_finite() && h.is_finite()) {
                return refuse(k, "a value is not finite".into(), "leave out the row");
            }
        }
        for (k, (x, h)) in at.windows(2).zip(heights.windows(2)).enumerate() {
            let slope = (h[1] - h[0]) / (x[1] - x[0]);
            if x[1] <= x[0] {
                let what = "the position does not rise".into();
                return refuse(k + 1, what, "sort the rows by position, each once");
            }
            if slope.abs() > STEEPEST {
                let what = format!("the height changes {slope:.0} times as much as the position");
                return refuse(
                    k + 1,
                    what,
                    "check the units, sample more finely, or use a step of [scan] surface",
                );
            }
        }
        Ok(Self { at, heights })
    }

    /// The height at `x`: linear between samples, constant beyond the ends.
    fn at(&self, x: f64) -> f64 {
        let next = self.at.partition_point(|at| *at <= x);
        if next == 0 {
            return self.heights[0];
        }
        if next == self.at.len() {
            return self.heights[next - 1];
        }
        let [a, b] = [next - 1, next];
        let part = (x - self.at[a]) / (self.at[b] - self.at[a]);
        self.heights[a] * (1.0 - part) + self.heights[b] * part
    }

    /// The path of a sphere's lowest point: `max [h_j − R + √(R² − (x_i − x_j)²)]` over the samples
    /// within its radius.
    pub(super) fn dilated(&self, radius: f64) -> Self {
        let path = |i: usize| {
            let x = self.at[i];
            let low = self.at.partition_point(|at| *at < x - radius);
            let high = self.at.partition_point(|at| *at <= x + radius);
            (low..high)
                .map(|j| {
                    let apart = x - self.at[j];
                    self.heights[j] - radius + (radius * radius - apart * apart).max(0.0).sqrt()
                })
                .fold(self.heights[i], f64::max)
        };
        Self {
            heights: (0..self.at.len()).map(path).collect(),
            at: self.at.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Samples, String> {
        Samples::parse(text, "line.csv", 1e-6).map_err(|error| error.to_string())
    }

    #[test]
    fn profiles_are_read_with_their_units() {
        let plain = parse("0\n1e-9\n2e-9\n3e-9\n").unwrap();
        assert_eq!(plain.at.len(), 4);
        for (at, expected) in plain.at.iter().zip([1.25e-7, 3.75e-7, 6.25e-7, 8.75e-7]) {
            assert!((at - expected).abs() < 1e-21, "{at}");
        }
        let named = parse("x (nm),height (nm)\n0,0\n100,5\n").unwrap();
        assert!((named.at(5e-8) - 2.5e-9).abs() < 1e-22);
        assert_eq!(named.at(1.0), named.heights[1]);
    }

    #[test]
    fn wrong_profiles_are_refused_with_the_row() {
        for (text, row, what) in [
            ("0,0\n1,NaN\n", 2, "not finite"),
            ("x (nm),h (nm)\n0,0\n2,1\n1,1\n", 4, "does not rise"),
            ("0,0\n1e-9,1e-3\n", 2, "times as much"),
            ("0,0\n1,2,3\n", 2, "columns"),
            ("0\nx\n", 2, "not a row"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(
                error.contains(&format!("row {row}: ")) && error.contains(what),
                "{error}"
            );
        }
        assert!(parse("").is_err());
    }

    /// Over a flat sample with one spike the path is the sphere itself.
    #[test]
    fn a_sphere_draws_itself_over_a_spike() {
        let at: Vec<f64> = (0..201).map(|k| f64::from(k) * 1e-9).collect();
        let mut heights = vec![0.0; 201];
        heights[100] = 5e-9;
        let radius = 20e-9;
        let path = Samples { at, heights }.dilated(radius);
        for k in 0..201 {
            let apart: f64 = (f64::from(k) - 100.0) * 1e-9;
            let sphere = 5e-9 - radius + (radius * radius - apart * apart).max(0.0).sqrt();
            assert!((path.heights[k as usize] - sphere.max(0.0)).abs() < 1e-18);
        }
    }
}
