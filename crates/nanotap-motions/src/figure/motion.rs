//! Figures of one motion: time series with contact shaded, phase portrait, harmonics,
//! multipliers.

use nanotap_figures::{Axis, Colour, DOUBLE_COLUMN, Figure, Legend, Line, Panel, Points};
use nanotap_flow::Output;

use crate::figure::panels::{MotionAxes, MotionCurves, OrbitCurves, time_axis};
use crate::orbit::OrbitReport;
use crate::simulate::fixed_step::FixedStepRun;
use crate::simulate::one_shot::OneShot;
use crate::simulate::{Classification, Simulation};
use nanotap_case::physical::Kind;
use nanotap_case::units::Units;
use nanotap_model::Model;
use nanotap_model::recording::{Curve, CurvePiece, Recording};

/// Points per oscillation of the fastest mode.
const POINTS_PER_TURN: f64 = 16.0;
/// Smallest number of points per drive period.
const FEWEST_POINTS: f64 = 240.0;
/// Largest number of points per drive period; faster modes are not visible.
const POINTS_PER_PERIOD: f64 = 3000.0;
/// Drive periods of a motion that never repeats shown against time.
const SHOWN_PERIODS: f64 = 16.0;
/// Drive periods of such a motion shown in the phase portrait.
const PORTRAIT_PERIODS: f64 = 64.0;

/// Curves of a motion in the units of the figure.
struct View<'a> {
    model: &'a Model,
    recording: &'a Recording,
    length: (f64, String),
    velocity: (f64, String),
    tip: Curve,
    rate: Curve,
}

impl<'a> View<'a> {
    fn new(model: &'a Model, recording: &'a Recording, units: &Units) -> Self {
        let tip = recording.curve(&model.tip);
        let rate = recording.curve(&model.tip_rate());
        Self {
            length: units.axis(Kind::Length, largest(&tip)),
            velocity: units.axis(Kind::Velocity, largest(&rate)),
            model,
            recording,
            tip,
            rate,
        }
    }

    /// Instants that resolve every oscillation of every mode and every switch, up to `periods`.
    fn instants(&self, periods: f64) -> Vec<f64> {
        instants(&self.tip, self.model.period(), periods)
    }

    fn over_time(&self, output: &Output, periods: f64) -> Vec<(f64, f64)> {
        let signal = self.recording.curve(output);
        self.instants(periods)
            .into_iter()
            .filter_map(|t| Some((t / self.model.period(), self.length.0 * signal.at(t)?)))
            .collect()
    }

    /// Each piece with both ends: an impact reverses the velocity at one instant.
    fn portrait(&self, periods: f64) -> Vec<(f64, f64)> {
        let end = periods * self.model.period();
        let mut points = Vec::new();
        for piece in self.tip.pieces() {
            if piece.start >= end {
                break;
            }
            let count = points_on(&self.tip, &piece, self.model.period());
            points.extend((0..=count).map(|k| {
                let s = piece.length * k as f64 / count as f64;
                (
                    self.length.0 * self.tip.on(&piece, s),
                    self.velocity.0 * self.rate.on(&piece, s),
                )
            }));
        }
        points
    }

    fn state(&self, t: f64) -> Option<(f64, f64)> {
        Some((
            self.length.0 * self.tip.at(t)?,
            self.velocity.0 * self.rate.at(t)?,
        ))
    }

    /// States at drive phase 0.
    fn strobe(&self, periods: usize) -> Vec<(f64, f64)> {
        (0..periods)
            .filter_map(|k| self.state(k as f64 * self.model.period()))
            .collect()
    }

    fn axes(&self) -> MotionAxes {
        MotionAxes {
            beam: self.model.beam.is_some(),
            length: self.length.1.clone(),
            velocity: self.velocity.1.clone(),
        }
    }

    /// Drive periods shown against time, drive periods of the phase portrait, and number of strobe
    /// states.
    fn curves(&self, title: String, shown: f64, portrait: f64, strobes: usize) -> MotionCurves {
        MotionCurves {
            axes: self.axes(),
            title,
            contacts: contact_intervals(self.model, self.recording, shown),
            surface: self.over_time(&self.model.surface(), shown),
            tip: self.over_time(&self.model.tip, shown),
            portrait: self.portrait(portrait),
            strobe: self.strobe(strobes),
            endless: portrait > SHOWN_PERIODS,
            portrait_label: if portrait < strobes as f64 {
                format!("first {portrait} drive periods")
            } else {
                String::new()
            },
        }
    }
}

/// Largest absolute value of a curve.
pub fn largest(curve: &Curve) -> f64 {
    let range = curve.range();
    range.map_or(0.0, |(low, high)| low.value.abs().max(high.value.abs()))
}

/// Number of points that resolve every oscillation of every mode on a piece.
pub(crate) fn points_on(curve: &Curve, piece: &CurvePiece, period: f64) -> usize {
    let turns = piece.length * curve.fastest(piece) / std::f64::consts::TAU;
    let share = piece.length / period;
    let wanted = (POINTS_PER_TURN * turns).max(FEWEST_POINTS * share);
    wanted.min(POINTS_PER_PERIOD * share).max(6.0).ceil() as usize
}

/// Instants that resolve every oscillation and every switch of a curve, for so many periods.
pub fn instants(curve: &Curve, period: f64, periods: f64) -> Vec<f64> {
    let end = periods * period;
    let pieces = curve.pieces();
    let mut times = Vec::new();
    for piece in pieces.iter().take_while(|p| p.start < end) {
        let count = points_on(curve, piece, period);
        times.extend((0..count).map(|k| piece.start + piece.length * k as f64 / count as f64));
    }
    let last = pieces.last().map_or(0.0, |p| p.start + p.length);
    times.retain(|t| *t < end);
    times.push(end.min(last));
    times
}

/// When the tip is in contact, in drive periods.
pub(crate) fn contact_intervals(
    model: &Model,
    recording: &Recording,
    periods: f64,
) -> Vec<(f64, f64)> {
    let period = model.period();
    let mut intervals: Vec<(f64, f64)> = Vec::new();
    for s in recording
        .pieces()
        .iter()
        .filter(|s| model.touches(s.regime) && s.start < periods * period)
    {
        let (from, to) = (
            s.start / period,
            ((s.start + s.length) / period).min(periods),
        );
        match intervals.last_mut() {
            // A drive period ended during the contact.
            Some(last) if from - last.1 < 1e-9 => last.1 = to,
            _ => intervals.push((from, to)),
        }
    }
    intervals
}

/// A motion in the plane of tip displacement and rate, in the model's own units.
pub fn portrait(model: &Model, recording: &Recording) -> Vec<(f64, f64)> {
    View::new(model, recording, &Units::Model).portrait(recording.end() / model.period())
}

/// The class of a motion: "period 4", "chaotic".
fn words(classification: Classification, period: Option<usize>) -> String {
    period.map_or_else(
        || classification.name().to_owned(),
        |n| format!("period {n}"),
    )
}

/// A run: time series and phase portrait.
pub fn simulation_figure(model: &Model, run: &Simulation, units: &Units) -> Figure {
    let view = View::new(model, &run.trajectory, units);
    let recorded = (run.trajectory.end() / model.period()).round();
    let arrived = run
        .orbit
        .as_ref()
        .filter(|_| run.transient > 0)
        .map(|o| o.period as f64);
    let shown = arrived
        .map_or(SHOWN_PERIODS, |n| (2.0 * n).clamp(4.0, SHOWN_PERIODS))
        .min(recorded);
    let portrait = arrived.unwrap_or(PORTRAIT_PERIODS).min(recorded);
    let strobes = arrived.unwrap_or(recorded).min(recorded) as usize;
    let title = words(run.classification, run.period);
    view.curves(title, shown, portrait, strobes).figure()
}

/// An orbit: time series, phase portrait, harmonics, multipliers.
pub fn orbit_figure(model: &Model, orbit: &OrbitReport, units: &Units) -> Figure {
    let view = View::new(model, &orbit.trajectory, units);
    let title = format!("period {}, {}", orbit.period, orbit.stability);
    let periods = orbit.period as f64;
    let harmonics = &orbit.spectrum.harmonics;
    let size = harmonics.iter().map(|h| h.tip).fold(0.0, f64::max);
    let (factor, unit) = units.axis(Kind::Length, size);
    let mut motion = view.curves(title, periods, periods, orbit.period);
    motion.endless = false;
    OrbitCurves {
        motion,
        harmonics: harmonics
            .iter()
            .map(|h| (h.order, factor * h.tip))
            .collect(),
        harmonics_unit: unit,
        multipliers: orbit.multipliers.clone(),
    }
    .figure()
}

/// A run under a signal of one shot: the signal, and the tip with the contacts.
pub fn one_shot_figure(run: &OneShot, units: &Units) -> Figure {
    let curves = &run.curves;
    let size = curves.tip.iter().fold(0.0, |m: f64, p| m.max(p.1.abs()));
    let (length, unit) = units.axis(Kind::Length, size);
    let scaled = |curve: &[(f64, f64)]| curve.iter().map(|p| (p.0, length * p.1)).collect();
    let motion = MotionCurves {
        axes: MotionAxes {
            beam: true,
            length: unit,
            velocity: String::new(),
        },
        contacts: curves.contacts.clone(),
        surface: scaled(&curves.surface),
        tip: scaled(&curves.tip),
        ..MotionCurves::default()
    };
    let signal = Line::new(curves.signal.clone()).colour(Colour::GREY);
    Figure::new(2, 1)
        .width(DOUBLE_COLUMN)
        .height(100.0)
        .with(
            Panel::new(time_axis(), Axis::linear("drive / its amplitude"))
                .title(&run.drive_signal)
                .with(signal),
        )
        .with(motion.time_panel())
}

/// A fixed-step run: time series and phase portrait.
pub fn fixed_step_figure(model: &Model, run: &FixedStepRun, units: &Units) -> Figure {
    let size = run.tip_max.abs().max(run.tip_min.abs());
    let (length, length_unit) = units.axis(Kind::Length, size);
    let speed = run.curve.iter().fold(0.0, |m: f64, c| m.max(c[2].abs()));
    let (velocity, velocity_unit) = units.axis(Kind::Velocity, speed);
    let shown = run
        .apparent_period
        .map_or(SHOWN_PERIODS, |n| (2.0 * n as f64).max(4.0))
        .min(run.periods as f64);
    let series = run
        .curve
        .iter()
        .map(|c| (c[0] / model.period(), length * c[1]))
        .filter(|p| p.0 <= shown);
    let portrait = run.curve.iter().map(|c| (length * c[1], velocity * c[2]));
    let strobe = run
        .strobe_curve
        .iter()
        .map(|c| (length * c[0], velocity * c[1]));
    let apparent = run.apparent_period.map_or_else(
        || "no apparent period".to_owned(),
        |n| format!("apparent period {n}"),
    );
    let axes = MotionAxes {
        beam: model.beam.is_some(),
        length: length_unit,
        velocity: velocity_unit,
    };
    let steps = match run.steps {
        [flight, contact] if flight == contact => format!("{flight} steps per period"),
        [flight, contact] => format!("{flight} steps per period, {contact} in contact"),
    };
    let title = format!("RK4, {steps}: {apparent}");
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .height(66.0)
        .column_widths([1.7, 1.0])
        .with(
            Panel::new(time_axis(), axes.tip())
                .title(title)
                .with(Line::new(series).colour(Colour::PURPLE)),
        )
        .with(
            Panel::new(axes.tip(), axes.rate())
                .legend(Legend::Above)
                .with(Line::new(portrait).colour(Colour::PURPLE).width(0.4))
                .with(
                    Points::new(strobe)
                        .diameter(0.9)
                        .colour(Colour::VERMILLION)
                        .label("at drive phase 0"),
                ),
        )
}
