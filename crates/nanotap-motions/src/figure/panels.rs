//! Motions in the units of the figure, from a trajectory or from a dataset, and their panels.

use std::collections::BTreeSet;

use nanotap_figures::{
    Axis, Band, Colour, DOUBLE_COLUMN, Dash, Figure, Legend, Line, Markers, Motion, Panel, Points,
    Rule, Shape, Stems,
};
use serde::Deserialize;

use crate::simulate::Classification;
use nanotap_case::physical::Kind;
use nanotap_case::units::prefixed;

/// Number of strobe states beyond which they are drawn as small dots.
const FEW_STROBES: usize = 200;

/// Names and units of the axes of motions.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct MotionAxes {
    /// Whether the motion is that of a cantilever's tip.
    pub beam: bool,
    /// Unit of lengths, as `nm`; empty in model units.
    pub length: String,
    /// Unit of velocities, as `µm/s`; empty in model units.
    pub velocity: String,
}

impl MotionAxes {
    pub(crate) fn tip(&self) -> Axis {
        let label = if self.beam {
            "tip deflection $W$"
        } else {
            "displacement $x$"
        };
        Axis::linear(label).unit(&self.length)
    }

    pub(crate) fn rate(&self) -> Axis {
        let label = if self.beam {
            "tip velocity $dW/dτ$"
        } else {
            "velocity $dx/dt$"
        };
        Axis::linear(label).unit(&self.velocity)
    }
}

/// The axis of values up to `size` in SI, in the unit with the prefix that fits, and the factor of the
/// values.
pub fn si_axis(label: impl Into<String>, kind: Kind, size: f64) -> (Axis, f64) {
    let axis = Axis::linear(label);
    match (kind, kind.dimensional()) {
        (Kind::Degrees, _) => (axis.unit("°"), 1.0),
        (_, None) => (axis, 1.0),
        (_, Some(kind)) => {
            let (factor, unit) = prefixed(kind, 1.0, size);
            (axis.unit(unit), factor)
        }
    }
}

/// Largest absolute value among finite ones, 0 without any.
pub fn largest_of(values: impl IntoIterator<Item = f64>) -> f64 {
    let finite = values.into_iter().filter(|value| value.is_finite());
    finite.fold(0.0, |size: f64, value| size.max(value.abs()))
}

/// Axis of the time in drive periods.
pub fn time_axis() -> Axis {
    Axis::linear("time $τ / T$").unit("drive periods").tight()
}

/// One motion: points of time (in drive periods) and deflection, and of deflection and velocity.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct MotionCurves {
    /// Kind of motion and units of the axes.
    pub axes: MotionAxes,
    /// Title of the panels: the class of the motion.
    pub title: String,
    /// Beginning and end of each contact, in drive periods.
    pub contacts: Vec<(f64, f64)>,
    /// Surface of the sample, or stop: time in drive periods and position in the unit of lengths.
    pub surface: Vec<(f64, f64)>,
    /// Tip or mass: time in drive periods and deflection in the unit of lengths.
    pub tip: Vec<(f64, f64)>,
    /// Motion in the phase plane: deflection and velocity, in the units of the axes.
    pub portrait: Vec<(f64, f64)>,
    /// States at drive phase 0: deflection and velocity, in the units of the axes.
    pub strobe: Vec<(f64, f64)>,
    /// Whether the drawn motion does not repeat: thin lines and small dots then.
    pub endless: bool,
    /// Label of the line in the phase plane, if it shows fewer periods than the strobe states.
    pub portrait_label: String,
}

impl MotionCurves {
    /// Time series and phase portrait.
    pub fn figure(&self) -> Figure {
        Figure::new(1, 2)
            .width(DOUBLE_COLUMN)
            .height(66.0)
            .column_widths([1.7, 1.0])
            .with(self.time_panel())
            .with(self.portrait_panel())
    }

    /// Time series with the contacts shaded, and the surface.
    pub(crate) fn time_panel(&self) -> Panel {
        let [surface, tip] = if self.axes.beam {
            ["sample, relative to the base", "tip"]
        } else {
            ["stop", "mass"]
        };
        let mut panel = Panel::new(time_axis(), self.axes.tip())
            .title(&self.title)
            .legend(Legend::Above);
        if !self.contacts.is_empty() {
            panel = panel.with(Band::x(self.contacts.clone()).label("contact"));
        }
        if !self.surface.is_empty() {
            panel = panel.with(
                Line::new(self.surface.clone())
                    .colour(Colour::GREY)
                    .dash(Dash::Dashed)
                    .width(0.6)
                    .label(surface),
            );
        }
        panel.with(Line::new(self.tip.clone()).colour(Colour::BLUE).label(tip))
    }

    pub(crate) fn portrait_panel(&self) -> Panel {
        let line = Line::new(self.portrait.clone())
            .colour(Colour::BLUE)
            .width(if self.endless { 0.3 } else { 0.9 });
        let line = if self.portrait_label.is_empty() {
            line
        } else {
            line.label(&self.portrait_label)
        };
        let panel = Panel::new(self.axes.tip(), self.axes.rate())
            .legend(Legend::Above)
            .with(line);
        let (points, colour) = (self.strobe.clone(), Colour::VERMILLION);
        if self.endless {
            let size = if points.len() > FEW_STROBES { 0.5 } else { 0.9 };
            let points = Points::new(points).diameter(size).colour(colour);
            panel.with(points.label("at drive phase 0"))
        } else {
            let markers = Markers::new(points).size(1.4).colour(colour);
            panel.with(markers.label("at drive phase 0"))
        }
    }
}

/// A periodic orbit: its motion, its harmonics and its multipliers.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct OrbitCurves {
    /// Motion over one repetition of the orbit.
    pub motion: MotionCurves,
    /// Harmonics of the tip deflection: order and amplitude in `harmonics_unit`.
    pub harmonics: Vec<(f64, f64)>,
    /// Unit of the amplitudes, as `nm`; empty in model units.
    pub harmonics_unit: String,
    /// Floquet multipliers as [Re, Im], dimensionless.
    pub multipliers: Vec<[f64; 2]>,
}

impl OrbitCurves {
    /// Time series, phase portrait, harmonics, multipliers.
    pub fn figure(&self) -> Figure {
        Figure::new(2, 2)
            .width(DOUBLE_COLUMN)
            .height(136.0)
            .column_widths([1.7, 1.0])
            .with(self.motion.time_panel())
            .with(self.motion.portrait_panel())
            .with(self.harmonics_panel())
            .with(self.multipliers_panel())
    }

    fn harmonics_panel(&self) -> Panel {
        let size = self.harmonics.iter().map(|p| p.1).fold(0.0, f64::max);
        // Smaller values are rounding of the largest one.
        let floor = 1e-8 * size;
        let stems = self.harmonics.iter().copied().filter(|p| p.1 > floor);
        let [frequency, symbol] = if self.motion.axes.beam {
            ["Ω", "$|Ŵ_n|$"]
        } else {
            ["ω", "$|x̂_n|$"]
        };
        let highest = self.harmonics.last().map_or(1.0, |h| h.0).round();
        let every = (highest / 10.0).ceil().max(1.0);
        let marks: Vec<(f64, String)> = (0..=10)
            .map(|k| f64::from(k) * every)
            .filter(|m| *m <= highest)
            .map(|m| (m, m.to_string()))
            .collect();
        let axis = Axis::linear(format!("frequency / ${frequency}$"))
            .range(0.0, highest + 0.5)
            .marks(marks);
        let amplitude = Axis::log(format!("amplitude {symbol}")).unit(&self.harmonics_unit);
        Panel::new(axis, amplitude).with(Stems::new(stems).colour(Colour::BLUE))
    }

    /// The multipliers and the unit circle.
    fn multipliers_panel(&self) -> Panel {
        let largest = self
            .multipliers
            .iter()
            .map(|[re, im]| re.abs().max(im.abs()))
            .fold(1.0, f64::max);
        let reach = 1.15 * largest;
        let circle = (0..=360)
            .map(|d| f64::from(d).to_radians())
            .map(|a| (nanotap_arithmetic::cos(a), nanotap_arithmetic::sin(a)));
        let (inside, outside): (Vec<_>, Vec<_>) = self
            .multipliers
            .iter()
            .map(|m| (m[0], m[1]))
            .partition(|(re, im)| nanotap_arithmetic::hypot(*re, *im) <= 1.0);
        let mut panel = Panel::new(
            Axis::linear("Re $μ$").range(-reach, reach),
            Axis::linear("Im $μ$").range(-reach, reach),
        )
        .with(Rule::horizontal(0.0).dash(Dash::Solid).width(0.3))
        .with(Rule::vertical(0.0).dash(Dash::Solid).width(0.3))
        .with(Line::new(circle).colour(Colour::GREY).width(0.6))
        .with(Markers::new(inside).colour(Colour::BLUE));
        if !outside.is_empty() {
            let markers = Markers::new(outside).colour(Colour::VERMILLION);
            panel = panel.with(markers.shape(Shape::Diamond).size(1.8));
        }
        panel
    }
}

/// Curves of one attractor in the phase plane.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct AttractorCurve {
    /// Name for the legend, with the share of the initial states.
    pub name: String,
    /// Name of its class of motions.
    pub classification: String,
    /// Period in drive periods; `None` if the attractor is not an orbit.
    pub period: Option<usize>,
    /// Motion in the phase plane: deflection and velocity, in the units of the axes.
    pub portrait: Vec<(f64, f64)>,
    /// States at drive phase 0: deflection and velocity, in the units of the axes.
    pub strobe: Vec<(f64, f64)>,
}

impl AttractorCurve {
    fn motion(&self) -> Motion {
        match self.period {
            Some(period) => Motion::Periodic(period),
            None => motion_of(&self.classification),
        }
    }

    fn extent(&self) -> f64 {
        self.portrait.iter().fold(0.0, |m: f64, p| m.max(p.0.abs()))
    }
}

/// The motion of a class without a period, by its name.
pub fn motion_of(classification: &str) -> Motion {
    [
        (Classification::QuasiPeriodic, Motion::QuasiPeriodic),
        (Classification::Chaotic, Motion::Chaotic),
        (Classification::Unbounded, Motion::Unbounded),
    ]
    .into_iter()
    .find(|(class, _)| class.name() == classification)
    .map_or(Motion::Undecided, |found| found.1)
}

/// Coexisting attractors in the phase plane.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct AttractorCurves {
    /// Kind of motion and units of the axes.
    pub axes: MotionAxes,
    /// Attractors, the largest share first.
    pub attractors: Vec<AttractorCurve>,
    /// States of unstable orbits at drive phase 0: deflection and velocity.
    pub unstable: Vec<(f64, f64)>,
}

impl AttractorCurves {
    /// Phase portraits and strobe points of every attractor, each in its own colour, and the
    /// unstable orbits as open markers.
    pub fn figure(&self) -> Figure {
        let axes = &self.axes;
        let mut portraits = Panel::new(axes.tip(), axes.rate()).legend(Legend::Above);
        let mut strobes = Panel::new(axes.tip(), axes.rate())
            .legend(Legend::Above)
            .title("at drive phase 0");
        let colours = Motion::colours(self.attractors.iter().map(AttractorCurve::motion));
        // The largest first, so that it hides no other.
        let mut order: Vec<usize> = (0..self.attractors.len()).collect();
        order.sort_by(|&a, &b| {
            let extent = |k: usize| self.attractors[k].extent();
            extent(b).total_cmp(&extent(a))
        });
        for k in order {
            let (one, colour) = (&self.attractors[k], colours[k]);
            let line = Line::new(one.portrait.clone())
                .colour(colour)
                .label(&one.name);
            let strobe = one.strobe.clone();
            if one.period.is_some() {
                portraits = portraits.with(line);
                strobes = strobes.with(Markers::new(strobe).colour(colour).size(1.6));
            } else {
                portraits = portraits.with(line.width(0.25));
                strobes = strobes.with(Points::new(strobe).colour(colour).diameter(0.35));
            }
        }
        if !self.unstable.is_empty() {
            strobes = strobes.with(
                Markers::new(self.unstable.clone())
                    .open()
                    .shape(Shape::Diamond)
                    .size(1.4)
                    .colour(Colour::GREY)
                    .label("unstable orbits"),
            );
        }
        Figure::new(1, 2)
            .width(DOUBLE_COLUMN)
            .height(84.0)
            .with(portraits)
            .with(strobes)
    }
}

/// A Poincaré section and Lyapunov exponents.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct SectionCurves {
    /// Kind of motion and units of the axes.
    pub axes: MotionAxes,
    /// Drive phase of the section, in periods; `None` for a section at the beginnings of contacts.
    pub phase: Option<f64>,
    /// Points of the section: tip deflection and velocity or, at contacts, drive phase in degrees
    /// and impact speed.
    pub points: Vec<(f64, f64)>,
    /// Lyapunov exponents per drive period, natural logarithm, largest first.
    pub exponents: Vec<f64>,
    /// Standard errors of the exponents, per drive period, in the same order.
    pub errors: Vec<f64>,
}

impl SectionCurves {
    /// Number of points that differ: a periodic motion has as many as its period.
    fn distinct_points(&self) -> usize {
        let size = |of: fn(&(f64, f64)) -> f64| {
            let sizes = self.points.iter().map(|p| of(p).abs());
            1e-5 * sizes.fold(f64::MIN_POSITIVE, f64::max)
        };
        let (x, y) = (size(|p| p.0), size(|p| p.1));
        let cell = |p: &(f64, f64)| ((p.0 / x).round() as i64, (p.1 / y).round() as i64);
        self.points.iter().map(cell).collect::<BTreeSet<_>>().len()
    }

    /// The section, and the exponents with their errors.
    pub fn figure(&self) -> Figure {
        let diameter = match self.distinct_points() {
            0..=64 => 1.6,
            65..=500 => 0.8,
            501..=20_000 => 0.3,
            _ => 0.15,
        };
        let points = Points::new(self.points.clone())
            .diameter(diameter)
            .colour(Colour::BLUE);
        let section = match self.phase {
            Some(phase) => Panel::new(self.axes.tip(), self.axes.rate())
                .title(format!("at drive phase {:.0}°", 360.0 * phase)),
            None => Panel::new(
                Axis::linear("drive phase at contact")
                    .unit("°")
                    .range(0.0, 360.0)
                    .marks([0.0, 90.0, 180.0, 270.0, 360.0].map(|d| (d, format!("{d:.0}")))),
                Axis::linear("impact speed").unit(&self.axes.velocity),
            )
            .title("at the beginning of contacts"),
        };
        let place = |k: usize| (k + 1) as f64;
        let bars = self.exponents.iter().zip(&self.errors).enumerate();
        let bars = bars.map(|(k, (e, s))| {
            Line::new([(place(k), e - s), (place(k), e + s)])
                .colour(Colour::VERMILLION)
                .width(1.2)
        });
        let exponents = self
            .exponents
            .iter()
            .enumerate()
            .map(|(k, e)| (place(k), *e));
        let count = self.exponents.len();
        let every = count.div_ceil(12).max(1);
        let marks = (1..=count)
            .filter(|k| (k - 1) % every == 0)
            .map(|k| (k as f64, k.to_string()));
        Figure::new(1, 2)
            .width(DOUBLE_COLUMN)
            .height(78.0)
            .column_widths([1.5, 1.0])
            .with(section.with(points))
            .with(
                Panel::new(
                    Axis::linear("number $i$")
                        .range(0.4, count as f64 + 0.6)
                        .marks(marks),
                    Axis::linear("exponent $λ_i$ per drive period"),
                )
                .with(Rule::horizontal(0.0))
                .with_all(bars)
                .with(Markers::new(exponents).colour(Colour::VERMILLION)),
            )
    }
}
