//! Figures of one motion: time series with contact shaded, phase portrait, harmonics,
//! multipliers; and of the same motion with different numbers of modes.

use nanotap_figures::{
    Axis, Band, Colour, DOUBLE_COLUMN, Dash, Figure, Legend, Line, Markers, Note, Panel, Place,
    Points, Rule, Shape, Stems,
};
use nanotap_flow::trajectory::{Piece, PiecewiseSignal};
use nanotap_flow::{Output, Trajectory};

use crate::case::physical::Kind;
use crate::case::units::Units;
use crate::model::Model;
use crate::study::convergence::Convergence;
use crate::study::fixed_step::FixedStepRun;
use crate::study::orbit::OrbitReport;
use crate::study::simulate::{Classification, Simulation};

/// Points on a turn of the fastest mode.
const POINTS_PER_TURN: f64 = 16.0;
/// Fewest points drawn of a drive period.
const FEWEST_POINTS: f64 = 240.0;
/// Most points drawn of a drive period; the modes beyond them leave no visible trace.
const POINTS_PER_PERIOD: f64 = 3000.0;
/// Drive periods of a motion that never repeats shown against time.
const SHOWN_PERIODS: f64 = 16.0;
/// Drive periods of such a motion shown in the phase portrait.
const PORTRAIT_PERIODS: f64 = 64.0;

/// A curve of a motion ready to draw, in shown units.
struct View<'a> {
    model: &'a Model,
    trajectory: &'a Trajectory,
    length: (f64, String),
    velocity: (f64, String),
    tip: PiecewiseSignal,
    rate: PiecewiseSignal,
}

impl<'a> View<'a> {
    fn new(model: &'a Model, trajectory: &'a Trajectory, units: &Units) -> Self {
        let tip = trajectory.signal(&model.tip);
        let rate = trajectory.signal(&model.tip_rate());
        let size = |s: &PiecewiseSignal| {
            s.range()
                .map_or(0.0, |(low, high)| low.value.abs().max(high.value.abs()))
        };
        Self {
            length: units.axis(Kind::Length, size(&tip)),
            velocity: units.axis(Kind::Velocity, size(&rate)),
            model,
            trajectory,
            tip,
            rate,
        }
    }

    /// Instants that show every turn of every mode and every switch, up to `periods`.
    fn instants(&self, periods: f64) -> Vec<f64> {
        instants(&self.tip, self.model.period(), periods)
    }

    fn over_time(&self, output: &Output, periods: f64) -> Vec<(f64, f64)> {
        let signal = self.trajectory.signal(output);
        self.instants(periods)
            .into_iter()
            .filter_map(|t| Some((t / self.model.period(), self.length.0 * signal.at(t)?)))
            .collect()
    }

    /// Piece by piece up to its very end: an impact turns the velocity round at one instant.
    fn portrait(&self, periods: f64) -> Vec<(f64, f64)> {
        let end = periods * self.model.period();
        let mut points = Vec::new();
        for (tip, rate) in self.tip.pieces.iter().zip(&self.rate.pieces) {
            if tip.start >= end {
                break;
            }
            let count = points_on(tip, self.model.period());
            points.extend((0..=count).map(|k| {
                let s = tip.length * k as f64 / count as f64;
                (
                    self.length.0 * tip.signal.at(s),
                    self.velocity.0 * rate.signal.at(s),
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

    fn tip_axis(&self) -> Axis {
        Axis::linear(format!("{}{}", tip_label(self.model), self.length.1))
    }

    fn rate_axis(&self) -> Axis {
        let label = if self.model.beam.is_some() {
            "tip velocity $dW/dτ$"
        } else {
            "velocity $dx/dt$"
        };
        Axis::linear(format!("{label}{}", self.velocity.1))
    }

    /// Time series with the contacts shaded and what the tip touches.
    fn time_panel(&self, periods: f64) -> Panel {
        let contacts = contact_intervals(self.model, self.trajectory, periods);
        let surface = if self.model.beam.is_some() {
            "sample, as the base sees it"
        } else {
            "stop"
        };
        let mut panel = Panel::new(time_axis(), self.tip_axis()).legend(Legend::Above);
        if !contacts.is_empty() {
            panel = panel.with(Band::x(contacts).label("contact"));
        }
        panel
            .with(
                Line::new(self.over_time(&self.model.surface(), periods))
                    .colour(Colour::GREY)
                    .dash(Dash::Dashed)
                    .width(0.6)
                    .label(surface),
            )
            .with(
                Line::new(self.over_time(&self.model.tip, periods))
                    .colour(Colour::BLUE)
                    .label(if self.model.beam.is_some() {
                        "tip"
                    } else {
                        "mass"
                    }),
            )
    }

    fn portrait_panel(&self, periods: f64, strobes: usize) -> Panel {
        let endless = periods > SHOWN_PERIODS;
        let line = Line::new(self.portrait(periods))
            .colour(Colour::BLUE)
            .width(if endless { 0.3 } else { 0.9 });
        let panel = Panel::new(self.tip_axis(), self.rate_axis())
            .legend(Legend::Above)
            .with(line);
        let points = self.strobe(strobes);
        if endless {
            let size = if strobes > 200 { 0.5 } else { 0.9 };
            panel.with(
                Points::new(points)
                    .diameter(size)
                    .colour(Colour::VERMILLION)
                    .label("at drive phase 0"),
            )
        } else {
            panel.with(
                Markers::new(points)
                    .size(1.4)
                    .colour(Colour::VERMILLION)
                    .label("at drive phase 0"),
            )
        }
    }
}

fn tip_label(model: &Model) -> &'static str {
    if model.beam.is_some() {
        "tip deflection $W$"
    } else {
        "displacement $x$"
    }
}

fn time_axis() -> Axis {
    Axis::linear("time $τ / T$ (drive periods)").tight()
}

/// Points that show every turn of every mode on a piece.
fn points_on(piece: &Piece, period: f64) -> usize {
    let turns = piece.length * piece.signal.fastest() / std::f64::consts::TAU;
    let share = piece.length / period;
    let wanted = (POINTS_PER_TURN * turns).max(FEWEST_POINTS * share);
    wanted.min(POINTS_PER_PERIOD * share).max(6.0).ceil() as usize
}

fn instants(signal: &PiecewiseSignal, period: f64, periods: f64) -> Vec<f64> {
    let end = periods * period;
    let mut times = Vec::new();
    for piece in signal.pieces.iter().take_while(|p| p.start < end) {
        let count = points_on(piece, period);
        times.extend((0..count).map(|k| piece.start + piece.length * k as f64 / count as f64));
    }
    let last = signal.pieces.last().map_or(0.0, |p| p.start + p.length);
    times.retain(|t| *t < end);
    times.push(end.min(last));
    times
}

/// When the tip is in contact, in drive periods.
fn contact_intervals(model: &Model, trajectory: &Trajectory, periods: f64) -> Vec<(f64, f64)> {
    let period = model.period();
    let mut intervals: Vec<(f64, f64)> = Vec::new();
    for s in trajectory
        .segments()
        .iter()
        .filter(|s| model.contact[s.regime] && s.start < periods * period)
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
pub fn portrait(model: &Model, trajectory: &Trajectory) -> Vec<(f64, f64)> {
    View::new(model, trajectory, &Units::Model).portrait(trajectory.end() / model.period())
}

/// What a motion is, in few words: "period 4", "chaotic".
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
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .height(66.0)
        .column_widths([1.7, 1.0])
        .with(
            view.time_panel(shown)
                .title(words(run.classification, run.period)),
        )
        .with(view.portrait_panel(portrait, strobes))
}

/// An orbit: time series, phase portrait, harmonics, multipliers.
pub fn orbit_figure(model: &Model, orbit: &OrbitReport, units: &Units) -> Figure {
    let view = View::new(model, &orbit.trajectory, units);
    let title = format!("period {}, {}", orbit.period, orbit.stability);
    Figure::new(2, 2)
        .width(DOUBLE_COLUMN)
        .height(136.0)
        .column_widths([1.7, 1.0])
        .with(view.time_panel(orbit.period as f64).title(title))
        .with(view.portrait_panel(orbit.period as f64, orbit.period))
        .with(harmonics_panel(model, orbit, units))
        .with(multipliers_panel(&orbit.multipliers))
}

/// Harmonics of the tip deflection and, where there is contact, of the force.
fn harmonics_panel(model: &Model, orbit: &OrbitReport, units: &Units) -> Panel {
    let tip: Vec<(f64, f64)> = orbit
        .spectrum
        .harmonics
        .iter()
        .map(|h| (h.order, h.tip))
        .collect();
    let size = tip.iter().map(|p| p.1).fold(0.0, f64::max);
    let (factor, unit) = units.axis(Kind::Length, size);
    let frequency = if model.beam.is_some() { "Ω" } else { "ω" };
    // What is smaller is rounding of what is largest.
    let floor = 1e-8 * size;
    let stems = tip
        .into_iter()
        .filter(|p| p.1 > floor)
        .map(|(x, y)| (x, factor * y));
    let symbol = if model.beam.is_some() {
        "$|Ŵ_n|$"
    } else {
        "$|x̂_n|$"
    };
    let highest = orbit
        .spectrum
        .harmonics
        .last()
        .map_or(1.0, |h| h.order)
        .round();
    let every = (highest / 10.0).ceil().max(1.0);
    let marks: Vec<(f64, String)> = (0..=10)
        .map(|k| f64::from(k) * every)
        .filter(|m| *m <= highest)
        .map(|m| (m, m.to_string()))
        .collect();
    let axis = Axis::linear(format!("frequency / ${frequency}$"))
        .range(0.0, highest + 0.5)
        .marks(marks);
    Panel::new(axis, Axis::log(format!("amplitude {symbol}{unit}")))
        .with(Stems::new(stems).colour(Colour::BLUE))
}

/// The multipliers and the unit circle that they must lie in.
fn multipliers_panel(multipliers: &[[f64; 2]]) -> Panel {
    let largest = multipliers
        .iter()
        .map(|[re, im]| re.abs().max(im.abs()))
        .fold(1.0, f64::max);
    let reach = 1.15 * largest;
    let circle = (0..=360)
        .map(|d| f64::from(d).to_radians())
        .map(|a| (a.cos(), a.sin()));
    let (inside, outside): (Vec<_>, Vec<_>) = multipliers
        .iter()
        .map(|m| (m[0], m[1]))
        .partition(|(re, im)| re.hypot(*im) <= 1.0);
    let mut panel = Panel::new(
        Axis::linear("Re $μ$").range(-reach, reach),
        Axis::linear("Im $μ$").range(-reach, reach),
    )
    .with(Rule::horizontal(0.0).dash(Dash::Solid).width(0.3))
    .with(Rule::vertical(0.0).dash(Dash::Solid).width(0.3))
    .with(Line::new(circle).colour(Colour::GREY).width(0.6))
    .with(Markers::new(inside).colour(Colour::BLUE));
    if !outside.is_empty() {
        panel = panel.with(
            Markers::new(outside)
                .colour(Colour::VERMILLION)
                .shape(Shape::Diamond)
                .size(1.8),
        );
    }
    panel
}

/// The same motion with every number of modes, and how far each is from the best.
pub fn convergence_figure(convergence: &Convergence, units: &Units) -> Figure {
    /// Lines beyond these cannot be told apart; the first and the last matter.
    const MOST_LINES: usize = 5;
    let count = convergence.modes.len();
    let chosen: Vec<usize> = if count <= MOST_LINES {
        (0..count).collect()
    } else {
        (0..MOST_LINES - 1).chain([count - 1]).collect()
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
        let periods = view.trajectory.end() / view.model.period();
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
    let differences: Vec<(f64, f64)> = convergence
        .modes
        .iter()
        .zip(&convergence.difference)
        .filter_map(|(n, d)| Some((*n as f64, d.filter(|d| *d > 0.0)?)))
        .collect();
    let marks = (1..=count)
        .filter(|n| count <= 12 || n % 5 == 0 || *n == 1)
        .map(|n| (n as f64, n.to_string()));
    let mut difference = Panel::new(
        Axis::linear("modes $N$")
            .range(0.5, count as f64 + 0.5)
            .marks(marks),
        Axis::log("difference of $W$ / amplitude"),
    )
    .with(Rule::horizontal(convergence.tolerance))
    .with(
        Line::new(differences.clone())
            .colour(Colour::BLUE)
            .width(0.6),
    )
    .with(Markers::new(differences).colour(Colour::BLUE));
    if let Some(n) = convergence.enough {
        difference = difference.with(Note::new(
            Place::Panel(0.5, 0.92),
            format!("$N$ = {n} is enough"),
        ));
    }
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .height(66.0)
        .column_widths([1.7, 1.0])
        .with(overlay)
        .with(difference)
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
    let title = format!(
        "RK4, {} and {} steps a period: {apparent}",
        run.steps[0], run.steps[1]
    );
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .height(66.0)
        .column_widths([1.7, 1.0])
        .with(
            Panel::new(
                time_axis(),
                Axis::linear(format!("{}{length_unit}", tip_label(model))),
            )
            .title(title)
            .with(Line::new(series).colour(Colour::PURPLE)),
        )
        .with(
            Panel::new(
                Axis::linear(format!("{}{length_unit}", tip_label(model))),
                Axis::linear(format!("tip velocity{velocity_unit}")),
            )
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
