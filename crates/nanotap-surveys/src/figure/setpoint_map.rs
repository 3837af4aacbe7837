//! The figure of the states at a held setpoint: which states there are, and the height of false steps.

use nanotap_figures::{Axis, Colour, DOUBLE_COLUMN, Figure, Legend, Panel, Points};

use crate::figure::sweep::{GridAxis, GridScale};
use crate::figure::window::outline;
use crate::setpoint_map::{SetpointMap, SetpointPoint};
use crate::window::Window;
use nanotap_case::physical::Kind;
use nanotap_dataset::Store;
use nanotap_motions::figure::panels::si_axis;

/// Categories of the points, with their words and colours.
const CATEGORIES: [(&str, Colour); 6] = [
    ("attractive only", Colour::rgb(170, 200, 230)),
    ("repulsive only", Colour::rgb(160, 215, 180)),
    ("both", Colour::ORANGE),
    ("several of one regime", Colour::VERMILLION),
    ("undecided", Colour::GREY),
    ("setpoint not reached", Colour::WHITE),
];

/// Number of the category of a point.
const fn category(point: &SetpointPoint) -> usize {
    let attractive = point.attractive_distance.is_some();
    let repulsive = point.repulsive_distance.is_some();
    match (attractive, repulsive) {
        (true, true) => 2,
        _ if point.states > 1 => 3,
        _ if point.undecided.is_some() => 4,
        (true, false) => 0,
        (false, true) => 1,
        (false, false) => 5,
    }
}

/// Diameter of the dot on a point at which states may be missing, mm.
const DOT: f64 = 0.7;

/// The map of the states, and where false steps are possible that of their heights.
pub(crate) fn figure(store: &Store, window: &Window, map: &SetpointMap) -> Figure {
    let [y, x] = [0, 1].map(|axis| GridAxis::of(store, axis).shown());
    let points: Vec<&SetpointPoint> = map.points.iter().flatten().collect();
    let count = |k: usize| points.iter().filter(|point| category(point) == k).count();
    let present: Vec<usize> = (0..CATEGORIES.len()).filter(|&k| count(k) > 0).collect();
    let cells: Vec<Option<usize>> = points
        .iter()
        .map(|point| present.iter().position(|&k| k == category(point)))
        .collect();
    let mut layer = GridScale::map(&x, &y, &cells);
    for k in present {
        let (words, colour) = CATEGORIES[k];
        let percent = 100.0 * count(k) as f64 / points.len().max(1) as f64;
        layer = layer.category_in(format!("{words} ({percent:.0} %)"), colour);
    }
    let mut states = Panel::new(x.axis(), y.axis())
        .with(layer)
        .title("states at the setpoint");
    // States may be missing at these points: what was found is drawn, and where no step is drawn
    // there may be one.
    let centres = y
        .values
        .iter()
        .flat_map(|&y| x.values.iter().map(move |&x| (x, y)));
    let open = centres
        .zip(&points)
        .filter(|(_, point)| point.undecided.is_some());
    let open: Vec<(f64, f64)> = open.map(|(centre, _)| centre).collect();
    let dots = || {
        Points::new(open.clone())
            .diameter(DOT)
            .colour(Colour::BLACK)
    };
    if !open.is_empty() {
        states = states.with(dots().label("more states possible"));
    }
    let targets = window.targets.as_ref();
    if let Some(outline) = targets.and_then(|found| outline(found, &x, &y)) {
        states = states.with(outline);
    }
    let states = states.legend(Legend::Above);
    let Some([_, highest]) = map.step_heights else {
        return Figure::single(states);
    };
    let (axis, factor) = si_axis("height of the false step", Kind::Length, highest);
    let heights = points.iter().map(|point| {
        let height = point.step_height.unwrap_or(f64::NAN);
        factor * height
    });
    let scale = Axis::linear("").unit(&axis.unit);
    let layer = GridScale::heatmap(&x, &y, heights, scale);
    let mut steps = Panel::new(x.axis(), y.axis()).with(layer);
    if !open.is_empty() {
        steps = steps.with(dots());
    }
    let steps = steps.title(axis.words());
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .with(states)
        .with(steps)
}
