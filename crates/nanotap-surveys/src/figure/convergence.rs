//! The same motion with different numbers of modes.

use nanotap_case::physical::Kind;
use nanotap_case::units::Units;
use nanotap_figures::{
    Axis, Colour, DOUBLE_COLUMN, Dash, Figure, Legend, Line, Markers, Note, Panel, Place, Rule,
};
use nanotap_model::Model;
use nanotap_model::recording::{Curve, Recording};
use nanotap_motions::figure::motion::{instants, largest};
use nanotap_motions::figure::panels::time_axis;

use crate::convergence::Convergence;

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
    let drawn: Vec<(usize, &Model, &Recording, Curve)> = chosen
        .into_iter()
        .filter_map(|i| {
            let model = convergence.models.get(i)?;
            let motion = &convergence.orbits.get(i)?.as_ref()?.trajectory;
            Some((i, model, motion, motion.curve(&model.tip)))
        })
        .collect();
    let unit = drawn.last().map_or((1.0, String::new()), |(_, _, _, tip)| {
        units.axis(Kind::Length, largest(tip))
    });
    let mut overlay = Panel::new(time_axis(), Axis::linear("tip deflection $W$").unit(unit.1))
        .legend(Legend::Above);
    for (i, model, motion, tip) in &drawn {
        let period = model.period();
        let curve = instants(tip, period, motion.end() / period)
            .into_iter()
            .filter_map(|t| Some((t / period, unit.0 * tip.at(t)?)));
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
