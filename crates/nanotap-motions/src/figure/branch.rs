//! Figures of branches, stable solid and unstable dashed, and of bifurcation curves in two
//! parameters.

use std::collections::{BTreeMap, BTreeSet};

use nanotap_figures::{
    Axis, Colour, DOUBLE_COLUMN, Dash, Figure, LINES, Legend, Line, Markers, Motion,
    ONE_AND_A_HALF_COLUMNS, Panel, ROUNDING, Shape,
};
use serde::Deserialize;

use crate::branch::{BifurcationReport, BranchReport, PointReport};
pub use crate::figure::plotted_quantity::PlottedQuantity;
use nanotap_case::physical::Kind;
use nanotap_case::units::{Units, prefixed};
use nanotap_case::{Case, Key};
use nanotap_observe::{Observables, PhysicalMotion};

/// Axis of a parameter: its label and the factor of its values.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterAxis {
    /// The axis, with its unit.
    pub axis: Axis,
    /// Factor from the parameter's value in a report to the unit of the axis.
    pub factor: f64,
}

impl ParameterAxis {
    /// The parameter in the model's own units.
    pub fn of(key: Key) -> Self {
        Self {
            axis: Axis::linear(key.label()),
            factor: 1.0,
        }
    }

    /// The parameter of a case with values up to `size`, in SI if the case is physical.
    pub fn of_case(case: &Case, key: Key, size: f64) -> Self {
        case.parameter_unit(key).map_or_else(
            || Self::of(key),
            |unit| {
                let (factor, name) = prefixed(unit.kind, unit.si, size);
                let label = if key.is_physical() {
                    key.label()
                } else {
                    unit.quantity.to_owned()
                };
                let name = match unit.kind {
                    Kind::Number => String::new(),
                    _ => name,
                };
                Self {
                    axis: Axis::linear(label).unit(name),
                    factor,
                }
            },
        )
    }
}

/// The figure of a case's branches against the parameter, in SI if the case is physical.
pub fn case_figure(case: &Case, report: &BranchReport, shown: Option<PlottedQuantity>) -> Figure {
    let size = report.from.abs().max(report.to.abs());
    let (second, reach) = report.loci.as_ref().map_or((report.key, size), |loci| {
        (loci.key, loci.range[0].abs().max(loci.range[1].abs()))
    });
    let axes = [(report.key, size), (second, reach)]
        .map(|(key, size)| ParameterAxis::of_case(case, key, size));
    let shown = shown.unwrap_or_else(|| PlottedQuantity::usual(case));
    let beam = case.oscillator().is_none();
    branch_figure(report, shown, beam, &axes, &case.units())
}

pub(crate) const MARKS: [(&str, Shape, Colour); 6] = [
    ("fold", Shape::Square, Colour::BLACK),
    ("flip", Shape::Diamond, Colour::VERMILLION),
    ("neimark-sacker", Shape::Triangle, Colour::PURPLE),
    ("grazing", Shape::Circle, Colour::GREEN),
    ("crossing", Shape::Cross, Colour::BLACK),
    ("event", Shape::Circle, Colour::BLUE),
];

/// Number of bifurcations beyond which marks are small.
const MANY: usize = 12;

/// The bifurcations of each kind as marks of the first size, or of the second if there are many;
/// marks of grazings are smaller by the factor `grazing`.
pub(crate) fn with_marks(
    mut panel: Panel,
    bifurcations: &[BranchMark],
    [few, many]: [f64; 2],
    grazing: f64,
) -> Panel {
    let size = if bifurcations.len() > MANY { many } else { few };
    for (kind, shape, colour) in MARKS {
        let of_kind = bifurcations.iter().filter(|b| b.kind == kind);
        let marks: Vec<(f64, f64)> = of_kind.map(|b| (b.x, b.y)).collect();
        if marks.is_empty() {
            continue;
        }
        let part = if kind == "grazing" { grazing } else { 1.0 };
        let markers = Markers::new(marks).shape(shape).colour(colour).open();
        panel = panel.with(markers.size(part * size).label(word(kind)));
    }
    panel
}

/// Branches against the parameter, one colour for each period, with their bifurcations; in a second
/// panel the bifurcation curves in two parameters, if they were traced.
pub fn branch_figure(
    report: &BranchReport,
    shown: PlottedQuantity,
    beam: bool,
    axes: &[ParameterAxis; 2],
    units: &Units,
) -> Figure {
    // Model units may vary with physical quantities: SI then.
    let si = report.points.iter().any(|p| p.physical.is_some());
    let of = |shown: PlottedQuantity,
              model: &Observables,
              physical: Option<&PhysicalMotion>,
              multipliers: &[[f64; 2]]| {
        shown.of(physical.map_or(model, |p| &p.observables), multipliers)
    };
    let value =
        |shown, p: &PointReport| of(shown, &p.observables, p.physical.as_ref(), &p.multipliers);
    let largest = |f: &dyn Fn(&PointReport) -> f64| {
        report.points.iter().map(|p| f(p).abs()).fold(0.0, f64::max)
    };
    let natural = natural_of(shown, |shown| largest(&|p| value(shown, p)));
    let size = scale_of(largest(&|p| value(shown, p)), natural);
    let (y, factor) = shown.axis(
        beam,
        |kind| if si { Some(1.0) } else { units.si(kind) },
        size,
    );
    let [first, second] = axes;
    let points = report.points.iter().map(|p| BranchPoint {
        branch: p.branch,
        period: p.period,
        stable: p.stable,
        x: first.factor * p.parameter,
        y: factor * value(shown, p),
    });
    let place = |b: &BifurcationReport| {
        let value = of(shown, &b.observables, b.physical.as_ref(), &b.multipliers);
        (first.factor * b.parameter, factor * value)
    };
    BranchCurves {
        x: first.axis.clone(),
        y: y.natural(natural.map(|size| factor * size)),
        points: with_corners(points.collect(), &report.bifurcations, place),
        bifurcations: report
            .bifurcations
            .iter()
            .map(|b| {
                let (x, y) = place(b);
                BranchMark {
                    kind: b.kind.to_owned(),
                    x,
                    y,
                }
            })
            .chain(report.events.iter().map(|found| BranchMark {
                kind: "event".to_owned(),
                x: first.factor * found.point.parameter,
                y: factor * value(shown, &found.point),
            }))
            .collect(),
        curves: report.loci.as_ref().map(|loci| BifurcationCurves {
            x: ranged(
                &first.axis,
                [report.from.min(report.to), report.from.max(report.to)].map(|v| first.factor * v),
            ),
            y: ranged(&second.axis, loci.range.map(|v| second.factor * v)),
            curves: loci
                .curves
                .iter()
                .map(|curve| BifurcationCurve {
                    kind: curve.kind.to_owned(),
                    event: curve.event.clone(),
                    period: curve.period,
                    meets: curve.meets.map(|what| what.unwrap_or_default().to_owned()),
                    x: curve.first.iter().map(|v| first.factor * v).collect(),
                    y: curve.second.iter().map(|v| second.factor * v).collect(),
                })
                .collect(),
        }),
    }
    .figure()
}

fn ranged(axis: &Axis, [from, to]: [f64; 2]) -> Axis {
    axis.clone().range(from, to)
}

/// Natural size of a quantity: for the dissipation the work of the peak force over the amplitude,
/// compared with which rounding is negligible; unknown for others, and of exact zeros.
pub fn natural_of(shown: PlottedQuantity, largest: impl Fn(PlottedQuantity) -> f64) -> Option<f64> {
    if shown != PlottedQuantity::named("dissipation")? || largest(shown) == 0.0 {
        return None;
    }
    Some(
        largest(PlottedQuantity::named("first_harmonic")?)
            * largest(PlottedQuantity::named("peak_force")?),
    )
}

/// The size that determines the unit: that of the data or, if these are rounding, the natural one.
pub fn scale_of(size: f64, natural: Option<f64>) -> f64 {
    match natural {
        Some(natural) if size <= ROUNDING * natural => natural,
        _ => size,
    }
}

/// Branches in the units of the figure.
#[derive(Clone, Debug, Deserialize)]
pub struct BranchCurves {
    /// Axis of the parameter.
    pub x: Axis,
    /// Axis of the observable.
    pub y: Axis,
    /// The orbits, in the order in which they were followed.
    pub points: Vec<BranchPoint>,
    /// Bifurcations of the branches.
    pub bifurcations: Vec<BranchMark>,
    /// Curves of bifurcations in two parameters, if they were traced.
    pub curves: Option<BifurcationCurves>,
}

/// An orbit of a branch.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct BranchPoint {
    /// Number of the branch, from 0.
    pub branch: usize,
    /// Period of the orbit, in drive periods.
    pub period: usize,
    /// Whether the orbit is stable.
    pub stable: bool,
    /// Parameter, in the unit of its axis.
    pub x: f64,
    /// Observable of the orbit, in the unit of its axis.
    pub y: f64,
}

/// A bifurcation of a branch.
#[derive(Clone, Debug, Deserialize)]
pub struct BranchMark {
    /// Kind of the bifurcation: `fold`, `flip`, `neimark-sacker`, `grazing`, `crossing` or `event`.
    pub kind: String,
    /// Parameter at the bifurcation, in the unit of its axis.
    pub x: f64,
    /// Observable of the orbit that bifurcates, in the unit of its axis.
    pub y: f64,
}

/// Curves of bifurcations in the plane of two parameters.
#[derive(Clone, Debug, Deserialize)]
pub struct BifurcationCurves {
    /// Axis of the first parameter, with its range.
    pub x: Axis,
    /// Axis of the second parameter, with its range.
    pub y: Axis,
    /// Curves in the plane of the two parameters.
    pub curves: Vec<BifurcationCurve>,
}

/// A curve of bifurcations, or of events, in the plane of two parameters.
#[derive(Clone, Debug, Deserialize)]
pub struct BifurcationCurve {
    /// Kind of the bifurcation, such as `fold` or `flip`.
    pub kind: String,
    /// Event of a curve of events, as the user wrote it; `None` for bifurcations.
    #[serde(default)]
    pub event: Option<String>,
    /// Period of the orbit that bifurcates, in drive periods.
    pub period: usize,
    /// First parameter along the curve, in the unit of its axis.
    pub x: Vec<f64>,
    /// Second parameter along the curve, in the unit of its axis; as many values as `x`.
    pub y: Vec<f64>,
    /// Events at the first and the last point; empty at the edge of the window.
    #[serde(default)]
    pub meets: [String; 2],
}

impl BranchCurves {
    /// Returns the figure, with the curves in two parameters as a second panel.
    pub fn figure(&self) -> Figure {
        let branches = self.panel();
        match &self.curves {
            None => Figure::single(branches)
                .width(ONE_AND_A_HALF_COLUMNS)
                .height(88.0),
            Some(curves) => Figure::new(1, 2)
                .width(DOUBLE_COLUMN)
                .height(88.0)
                .with(branches)
                .with(curves.panel()),
        }
    }

    fn panel(&self) -> Panel {
        let mut panel = Panel::new(self.x.clone().tight(), self.y.clone()).legend(Legend::Above);
        let mut parts: BTreeMap<(usize, usize), Vec<&BranchPoint>> = BTreeMap::new();
        for point in &self.points {
            parts
                .entry((point.period, point.branch))
                .or_default()
                .push(point);
        }
        let mut named = BTreeSet::new();
        for ((period, _), points) in &parts {
            for (stable, run) in runs(points, |p| p.stable) {
                let motion = Motion::Periodic(*period);
                let mut line = Line::new(run.iter().map(|p| (p.x, p.y))).colour(motion.colour());
                if !stable {
                    line = line.dash(Dash::Dashed).width(0.6);
                } else if named.insert(*period) {
                    line = line.label(motion.to_string());
                }
                panel = panel.with(line);
            }
        }
        // Only for the legend: periods that are nowhere stable, and the meaning of dashes.
        let nowhere = || Line::new([(f64::NAN, f64::NAN)]);
        for period in parts.keys().map(|part| part.0).collect::<BTreeSet<_>>() {
            if !named.contains(&period) {
                let motion = Motion::Periodic(period);
                panel = panel.with(nowhere().colour(motion.colour()).label(motion.to_string()));
            }
        }
        if self.points.iter().any(|p| !p.stable) {
            let dashed = nowhere().colour(Colour::GREY).dash(Dash::Dashed).width(0.6);
            panel = panel.with(dashed.label("unstable"));
        }
        with_marks(panel, &self.bifurcations, [1.6, 1.1], 0.7)
    }
}

impl BifurcationCurves {
    fn panel(&self) -> Panel {
        let mut panel = Panel::new(self.x.clone(), self.y.clone()).legend(Legend::Above);
        let mut named: BTreeSet<(&str, usize)> = BTreeSet::new();
        let mut events: Vec<&str> = Vec::new();
        for curve in &self.curves {
            let (_, _, colour) = MARKS
                .into_iter()
                .find(|m| m.0 == curve.kind)
                .unwrap_or(MARKS[0]);
            // Each event has a colour of the palette.
            let colour = curve.event.as_deref().map_or(colour, |event| {
                let known = events.iter().position(|other| *other == event);
                let index = known.unwrap_or_else(|| {
                    events.push(event);
                    events.len() - 1
                });
                LINES[index % LINES.len()]
            });
            let mut line = Line::new(curve.x.iter().copied().zip(curve.y.iter().copied()))
                .colour(colour)
                .dash(match curve.period {
                    0 | 1 => Dash::Solid,
                    2 => Dash::Dashed,
                    _ => Dash::Dotted,
                });
            let name = curve.event.as_deref().unwrap_or(word(&curve.kind));
            if named.insert((name, curve.period)) {
                line = line.label(format!("{name}, period {}", curve.period));
            }
            panel = panel.with(line);
        }
        for (what, shape) in ENDS {
            let mut marks: Vec<(f64, f64)> = Vec::new();
            for curve in &self.curves {
                let ends = [
                    curve.x.first().zip(curve.y.first()),
                    curve.x.last().zip(curve.y.last()),
                ];
                for (end, meets) in ends.into_iter().zip(&curve.meets) {
                    marks.extend(end.filter(|_| meets == what).map(|(x, y)| (*x, *y)));
                }
            }
            if !marks.is_empty() {
                let markers = Markers::new(marks)
                    .shape(shape)
                    .colour(Colour::PURPLE)
                    .size(1.6);
                panel = panel.with(markers.label(format!("ends: {what}")));
            }
        }
        panel
    }
}

/// The marks of the events at which curves end.
const ENDS: [(&str, Shape); 3] = [
    ("grazing", Shape::Circle),
    ("codimension two", Shape::Diamond),
    ("cut", Shape::Cross),
];

/// Makes each located grazing, where observables have a corner, a vertex of its branch. `place` gives
/// its coordinates.
pub(crate) fn with_corners(
    mut points: Vec<BranchPoint>,
    bifurcations: &[BifurcationReport],
    place: impl Fn(&BifurcationReport) -> (f64, f64),
) -> Vec<BranchPoint> {
    for grazing in bifurcations.iter().filter(|b| b.kind == "grazing") {
        let (x, y) = place(grazing);
        let is_around = |k: &usize| {
            let [a, b] = [points[*k], points[k + 1]];
            let on = a.branch == grazing.branch && b.branch == grazing.branch;
            on && (a.x - x) * (b.x - x) < 0.0
        };
        let detour = |k: usize| (points[k].y - y).abs() + (points[k + 1].y - y).abs();
        let around = (0..points.len().saturating_sub(1)).filter(is_around);
        if let Some(k) = around.min_by(|a, b| detour(*a).total_cmp(&detour(*b))) {
            points.insert(k + 1, BranchPoint { x, y, ..points[k] });
        }
    }
    points
}

/// Stretches of one stability, each beginning where the last one ended.
pub fn runs<'a, P>(points: &[&'a P], stable: impl Fn(&P) -> bool) -> Vec<(bool, Vec<&'a P>)> {
    let mut runs: Vec<(bool, Vec<&'a P>)> = Vec::new();
    for &p in points {
        match runs.last_mut() {
            Some((stability, run)) if *stability == stable(p) => run.push(p),
            other => {
                let joint = other.and_then(|(_, run)| run.last().copied());
                runs.push((stable(p), joint.into_iter().chain([p]).collect()));
            }
        }
    }
    runs
}

pub(crate) fn word(kind: &str) -> &'static str {
    match kind {
        "fold" => "fold",
        "flip" => "period doubling",
        "neimark-sacker" => "Neimark–Sacker",
        "grazing" => "grazing",
        "event" => "event",
        _ => "crossing",
    }
}
