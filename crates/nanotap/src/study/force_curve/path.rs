//! How the distance changes with time: the checked options, in the model's units.

use std::cmp::Ordering;
use std::f64::consts::{PI, TAU};

use super::statics::StaticCurve;
use super::{ForceCurveOptions, Way};
use crate::Error;
use crate::case::Case;
use crate::case::physical::{Kind, Physical};
use crate::model::Model;
use crate::study::approach::speed_of;
use crate::study::value::{Amount, implied};
use crate::study::without_signal;

/// Largest number of stretches of flow of a curve; more are refused.
const MAX_STRETCHES: f64 = 50e6;
/// Phase that the slow sine of a ramp passes in a drive period.
const RAMP_PHASE: f64 = 1e-5;
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
    pub(super) statics: StaticCurve,
    pub(super) path: Path,
    /// Time between two points, model units.
    pub(super) step: f64,
    /// Number of points of both directions; the start is not one of them.
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
pub(crate) fn physical(case: &Case) -> Result<&Physical, Error> {
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
        let statics = StaticCurve::new(&there, &model)?;
        let to = match (near, force) {
            (Some(to), _) => to,
            (None, Some(force)) => statics
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
        let omega = frequency.map_or(RAMP_PHASE / period, |f| TAU * f * view.scales.time);
        let mut path = Path {
            from,
            to,
            omega,
            speed,
            turn: speed.map_or(PI / omega, |speed| (from - to) / speed),
        };
        let mut step = path.turn / points as f64;
        let mut count = 2 * points;
        if driven {
            // Points at ends of drive periods.
            step = period * (step / period).round().max(1.0);
            match speed {
                Some(speed) => {
                    let each = ((from - to) / (speed * step)).ceil().max(1.0);
                    path.from = to + each * speed * step;
                    path.turn = each * step;
                    count = 2 * each as usize;
                }
                None => count = (2.0 * path.turn / step).ceil() as usize,
            }
        }
        let stretches = count as f64 * (1.0 + step / period);
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
        Ok(Self {
            model: case.with(key, path.from).model()?,
            case,
            view,
            statics,
            path,
            step,
            points: count,
            settle: if driven { settle } else { 0 },
            driven,
            fit: [options.fit_from, options.fit_to],
        })
    }
}
