//! How the distance changes with time: the checked options, in the model's units.

use std::cmp::Ordering;
use std::f64::consts::{PI, TAU};

use super::statics::StaticCurve;
use super::{ForceCurveOptions, Way};
use nanotap_case::Case;
use nanotap_case::physical::{Kind, Physical};
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_motions::approach::speed_of;
use nanotap_study::value::{Amount, implied};
use nanotap_study::without_signal;

/// Largest number of stretches of flow of a curve; more are refused.
const MAX_STRETCHES: f64 = 50e6;
/// Phase that the slow sine of a ramp passes in a stretch.
const RAMP_PHASE: f64 = 1e-5;
/// Two times nearer than this part of a stretch are one.
const SAME: f64 = 1e-9;
/// Settling periods where none are given: this many time constants of the lever.
const SETTLE_CONSTANTS: f64 = 20.0;
/// Speed of a ramp where none is given, m/s.
const SPEED: f64 = 1e-6;

/// A force curve, checked; in the model's units.
#[derive(Clone, Debug)]
pub(super) struct Plan<'a> {
    pub(super) case: &'a Case,
    pub(super) view: &'a Physical,
    /// Model of the case at the first distance.
    pub(super) model: Model,
    /// The lever at rest with all of its compliance.
    pub(super) statics: StaticCurve,
    /// The lever at rest as it moves, with the compliance of its modes alone.
    pub(super) moving_statics: StaticCurve,
    pub(super) path: Path,
    /// Length of a stretch of flow, model units: a drive period of a driven lever, else a part of
    /// one that is near the lever's own period.
    pub(super) stretch: f64,
    /// Number of stretches in a drive period.
    pub(super) parts: u64,
    /// Number of points in each direction; the start is not one of them.
    pub(super) points: usize,
    /// Number of drive periods at the first distance before the curve.
    pub(super) settle: usize,
    /// Whether the lever is driven.
    pub(super) driven: bool,
    /// Lowest and highest force of the fits, as fractions of the span from the lowest force of the
    /// retract (0) to the peak force (1).
    pub(super) fit: [f64; 2],
}

/// Distance of the sample against time, in model units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Path {
    /// Largest distance, at the beginning, and least distance, at the turn.
    pub(super) from: f64,
    pub(super) to: f64,
    /// Angular frequency of the added tone.
    pub(super) omega: f64,
    /// Speed of a ramp; `None`: one period of a cosine.
    pub(super) speed: Option<f64>,
    /// Time at which the motion turns.
    pub(super) turn: f64,
}

impl Path {
    /// Returns the direction of the motion at a time.
    pub(super) fn way(&self, time: f64) -> Way {
        // A point at the turn may be off by rounding.
        if time < self.turn * (1.0 - 1e-12) {
            Way::Approach
        } else {
            Way::Retract
        }
    }

    /// The distance as `c + Re((s − i u) e^{iωt})`, with `t` counted from `time`: `[c, s, u]`. At the
    /// turn of a ramp, that of the retract.
    pub(super) fn at(&self, time: f64) -> [f64; 3] {
        if let Some(speed) = self.speed {
            let (rest, sign) = match self.way(time) {
                Way::Approach => (self.from - speed * time, -1.0),
                _ => (self.to + speed * (time - self.turn), 1.0),
            };
            return [rest, 0.0, sign * speed / self.omega];
        }
        let (sin, cos) = nanotap_arithmetic::sin_cos(self.omega * time);
        let amplitude = 0.5 * (self.from - self.to);
        let middle = 0.5 * (self.from + self.to);
        [middle, amplitude * cos, -amplitude * sin]
    }

    /// Returns the distance at a time.
    pub(super) fn distance(&self, time: f64) -> f64 {
        let [c, s, _] = self.at(time);
        c + s
    }
}

/// A stretch of flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    /// Times of its start and end from the start of the curve, model units.
    pub(super) start: f64,
    pub(super) end: f64,
    /// Time of its start within the drive period, model units.
    pub(super) phase: f64,
    /// Length in time, to the bit that of the flow.
    pub(super) length: f64,
    /// Whether the next one begins a drive period.
    pub(super) ends_period: bool,
}

impl Plan<'_> {
    /// Returns the duration of the curve.
    pub(super) fn duration(&self) -> f64 {
        2.0 * self.path.turn
    }

    /// Returns the stretches from a time to the end: they end with the parts of drive periods, at
    /// the turn and at the end, whatever the points.
    pub(super) fn stretches(&self, from: f64) -> impl Iterator<Item = Stretch> {
        let (length, parts) = (self.stretch, self.parts);
        let corners = [self.path.turn, self.duration()];
        let mut time = from;
        let mut index = (from / length + SAME).floor().max(0.0) as u64;
        std::iter::from_fn(move || {
            let corner = corners.into_iter().find(|corner| time < *corner)?;
            let own = index as f64 * length;
            let after = if time - own <= SAME * length {
                0.0
            } else {
                time - own
            };
            let next = (index + 1) as f64 * length;
            // An end that rounding alone keeps from a corner is the corner.
            let near = (next - corner).abs() <= SAME * length;
            let whole = near || next < corner;
            let end = if near { corner } else { next.min(corner) };
            let stretch = Stretch {
                start: time,
                end,
                phase: (index % parts) as f64 * length + after,
                length: if whole { length - after } else { end - time },
                ends_period: whole && (index + 1).is_multiple_of(parts),
            };
            time = end;
            index += u64::from(whole);
            Some(stretch)
        })
    }

    /// Returns the times of the points, in order: of a driven lever ends of drive periods.
    pub(super) fn times(&self) -> impl Iterator<Item = f64> {
        let count = 2 * self.points;
        let (turn, end, period) = (self.path.turn, self.duration(), self.stretch);
        let periods = (end / period + SAME).floor();
        let driven = self.driven;
        (1..=count).map(move |point| {
            let part = point as f64 / count as f64;
            if !driven {
                return if point == self.points {
                    turn
                } else {
                    part * end
                };
            }
            (part * periods).round() * period
        })
    }
}

fn kind(
    given: Option<&Amount>,
    name: &str,
    kind: Kind,
    example: &str,
) -> Result<Option<f64>, Error> {
    let Some(amount) = given else {
        return Ok(None);
    };
    let refused = |reason: String| Error::option(name, reason, format!("write it as in {example}"));
    let value = kind
        .parse(amount.text())
        .map_err(|error| refused(error.to_string()))?;
    if value > 0.0 && value.is_finite() {
        return Ok(Some(value));
    }
    Err(refused(format!(
        "expected a positive value, got {}",
        amount.text()
    )))
}

/// Returns the physical quantities of a case, which a force curve needs.
///
/// # Errors
/// When the case is dimensionless.
pub fn physical(case: &Case) -> Result<&Physical, Error> {
    case.physical().ok_or_else(|| {
        Error::input(
            format!(
                "{}: a force curve needs a cantilever in physical quantities",
                case.title()
            ),
            "state the lever in [cantilever], [drive] and [sample], with units",
        )
    })
}

impl<'a> Plan<'a> {
    /// Checks these options for a case.
    ///
    /// # Errors
    /// When an option or the case is not valid.
    pub(super) fn new(case: &'a Case, options: &ForceCurveOptions) -> Result<Self, Error> {
        let view = physical(case)?;
        let key = case.gap_key();
        let distance = |option, given: &Option<_>| implied(case, key, option, given.as_ref());
        let from = match distance("from", &options.from)? {
            Some(from) => from,
            None if !case.leaves_distance_to_setpoint() => case.get(key),
            None => {
                return Err(Error::option(
                    "from",
                    "a case with a setpoint has no distance to begin at",
                    "give the first distance, as in \"30 nm\"",
                ));
            }
        };
        let there = case.with(key, from);
        let model = there.model()?;
        without_signal(case, "a force curve")?;
        if model.system.drive().frequencies().len() != 1 {
            return Err(Error::input(
                "a force curve needs a drive of one tone",
                "leave out the second tone of the drive",
            ));
        }
        let force = kind(
            options.peak_force.as_ref(),
            "peak_force",
            Kind::Force,
            "\"5 nN\"",
        )?;
        let near = distance("to", &options.to)?;
        if near.is_some() && force.is_some() {
            return Err(Error::option(
                "to",
                "{to} and {peak_force} say the same",
                "give one of them",
            ));
        }
        let [statics, moving_statics] =
            [true, false].map(|whole| StaticCurve::new(&there, &model, whole));
        let (statics, moving_statics) = (statics?, moving_statics?);
        let to = match (near, force) {
            (Some(to), _) => to,
            (None, Some(force)) => moving_statics
                .distance_of_force(from, force / view.scales.force)
                .ok_or_else(|| {
                    Error::option(
                        "peak_force",
                        "the lever at rest does not reach this force",
                        "lower {peak_force}, or give {to}",
                    )
                })?,
            (None, None) => from.min(0.0) - 0.1 * from.abs(),
        };
        if !(from.is_finite() && to.is_finite() && from > to) {
            let nm = |z: f64| Kind::Length.format(z * view.scales.length);
            return Err(Error::option(
                "from",
                format!(
                    "an approach goes from far to near: it cannot go from {} to {}",
                    nm(from),
                    nm(to)
                ),
                "change {from} or {to}",
            ));
        }
        if options.fit_from.partial_cmp(&options.fit_to) != Some(Ordering::Less) {
            return Err(Error::option(
                "fit_from",
                "the fits have an empty range of forces",
                "give a {fit_from} below {fit_to}",
            ));
        }
        let frequency = kind(
            options.frequency.as_ref(),
            "frequency",
            Kind::Frequency,
            "\"2 kHz\"",
        )?;
        let speed = match (&options.speed, frequency) {
            (Some(_), Some(_)) => {
                return Err(Error::option(
                    "speed",
                    "a curve is a ramp of a {speed} or a cosine of a {frequency}",
                    "give one of them",
                ));
            }
            (Some(speed), None) => Some(speed_of(case, speed)?),
            (None, None) => Some(SPEED / view.scales.velocity),
            (None, Some(_)) => None,
        };
        let period = model.period();
        let driven = model.system.regimes()[0].forcing().tones[0]
            .iter()
            .chain(&model.height.tones)
            .any(|z| z.re != 0.0 || z.im != 0.0);
        let points = options.points;
        if !(2..=super::MAX_DISTANCES).contains(&points) {
            return Err(Error::option(
                "points",
                format!(
                    "expected 2 to {} points, got {points}",
                    super::MAX_DISTANCES
                ),
                "change {points}",
            ));
        }
        let parts = if driven {
            1
        } else {
            (period * view.lever.f0 * view.scales.time).round().max(1.0) as u64
        };
        let stretch = period / parts as f64;
        let omega = frequency.map_or(RAMP_PHASE / stretch, |f| TAU * f * view.scales.time);
        let mut path = Path {
            from,
            to,
            omega,
            speed,
            turn: speed.map_or(PI / omega, |speed| (from - to) / speed),
        };
        if let (true, Some(speed)) = (driven, speed) {
            // It turns at the end of a drive period.
            let periods = ((from - to) / (speed * period) - SAME).ceil().max(1.0);
            path.from = to + periods * speed * period;
            path.turn = periods * period;
        }
        let stretches = 2.0 * path.turn / stretch;
        if stretches.is_nan() || stretches > MAX_STRETCHES {
            return Err(Error::input(
                format!(
                    "the curve takes {stretches:.3e} drive periods; {MAX_STRETCHES:.0e} are \
                     followed at most"
                ),
                "raise {speed} or {frequency}, or shorten the range of distances",
            ));
        }
        let settle = options.settle.unwrap_or_else(|| {
            let constant = view.lever.quality_factor / PI;
            (SETTLE_CONSTANTS * constant).ceil().min(1e6) as usize
        });
        let points = if driven {
            // No more of them than drive periods.
            points.min((path.turn / period + SAME).floor().max(1.0) as usize)
        } else {
            points
        };
        Ok(Self {
            model: case.with(key, path.from).model()?,
            case,
            view,
            statics,
            moving_statics,
            path,
            stretch,
            parts,
            points,
            settle: if driven { settle } else { 0 },
            driven,
            fit: [options.fit_from, options.fit_to],
        })
    }
}
