//! Figures of one motion: time series with contact shaded, phase portrait, harmonics,
//! multipliers; and of the same motion with different numbers of modes.

use nanotap_figures::{
    Axis, Colour, DOUBLE_COLUMN, Dash, Figure, Legend, Line, Markers, Note, Panel, Place, Points,
    Rule,
};
use nanotap_flow::Output;

use crate::case::physical::Kind;
use crate::case::units::Units;
use crate::figure::panels::{MotionAxes, MotionCurves, OrbitCurves, time_axis};
use crate::model::Model;
use crate::model::recording::{Curve, CurvePiece, Recording};
use crate::study::convergence::Convergence;
use crate::study::fixed_step::FixedStepRun;
use crate::study::orbit::OrbitReport;
use crate::study::simulate::{Classification, Simulation};

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
        let size = |s: &Curve| {
            s.range()
                .map_or(0.0, |(low, high)| low.value.abs().max(high.value.abs()))
        };
        Self {
            length: units.axis(Kind::Length, size(&tip)),
            velocity: units.axis(Kind::Velocity, size(&rate)),
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

/// Number of points that resolve every oscillation of every mode on a piece.
pub(crate) fn points_on(curve: &Curve, piece: &CurvePiece, period: f64) -> usize {
    let turns = piece.length * curve.fastest(piece) / std::f64::consts::TAU;
    let share = piece.length / period;
    let wanted = (POINTS_PER_TURN * turns).max(FEWEST_POINTS * share);
    wanted.min(POINTS_PER_PERIOD * share).max(6.0).ceil() as usize
}

fn instants(curve: &Curve, period: f64, periods: f64) -> Vec<f64> {
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

/// The same motion with every number of modes, and the difference of each from the best.
pub fn convergence_figure(convergence: &Convergence, units: &Units) -> Figure {
    /// More lines cannot be distinguished; the first and the last matter.
    const MAX_LINES: usize = 5;
    let count = convergence.modes.len();
    let chosen: Vec<usize> = if count <= MAX_LINES {
        (0..count).collect()
    } else {
        (0..MAX_LINES - 1).chain([count - 1]).collect()
    };
    let drawn: Vec<(usize, View<'_>)> = chosen
        .into_iter()
        .filter_map(|i| {
            let orbit = convergence.orbits.get(i)?.as_ref()?;
            Some((
                i,
                View::new(convergence.models.get(i)?, &orbit.trajectory, units),
            ))
        })
        .collect();
    let unit = drawn
        .last()
        .map_or((1.0, String::new()), |(_, v)| v.length.clone());
    let mut overlay = Panel::new(
        time_axis(),
        Axis::linear(format!("tip deflection $W${}", unit.1)),
    )
    .legend(Legend::Above);
    for (i, view) in &drawn {
        let signal = &view.tip;
        let periods = view.recording.end() / view.model.period();
        let curve = view
            .instants(periods)
            .into_iter()
            .filter_map(|t| Some((t / view.model.period(), unit.0 * signal.at(t)?)));
        let line = Line::new(curve).label(format!("$N$ = {}", convergence.modes[*i]));
        let best = *i + 1 == count;
        overlay = overlay.with(if best {
            line.colour(Colour::BLACK)
        } else {
            line.dash(Dash::Dashed)
        });
    }
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .height(66.0)
        .column_widths([1.7, 1.0])
        .with(overlay)
        .with(difference_panel(
            &convergence.modes,
            &convergence.difference,
            convergence.tolerance,
            convergence.enough,
        ))
}

/// Difference of the tip deflection from that with the most modes against the number of modes;
/// unknown ones are left out.
pub fn difference_panel(
    modes: &[usize],
    differences: &[Option<f64>],
    tolerance: f64,
    enough: Option<usize>,
) -> Panel {
    let count = modes.len();
    let points: Vec<(f64, f64)> = modes
        .iter()
        .zip(differences)
        .filter_map(|(n, d)| Some((*n as f64, d.filter(|d| *d > 0.0)?)))
        .collect();
    let marks = (1..=count)
        .filter(|n| count <= 12 || n % 5 == 0 || *n == 1)
        .map(|n| (n as f64, n.to_string()));
    let panel = Panel::new(
        Axis::linear("modes $N$")
            .range(0.5, count as f64 + 0.5)
            .marks(marks),
        Axis::log("difference of $W$ / amplitude"),
    )
    .with(Rule::horizontal(tolerance).label("tolerance"))
    .with(Line::new(points.clone()).colour(Colour::BLUE).width(0.6))
    .with(Markers::new(points).colour(Colour::BLUE));
    match enough {
        Some(n) => panel.with(Note::new(
            Place::Panel(0.5, 0.92),
            format!("$N$ = {n} is enough"),
        )),
        None => panel,
    }
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
