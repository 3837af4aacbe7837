//! The figure of an operating window: the condition at each point.

use nanotap_figures::{Colour, Figure, Legend, Line, ONE_AND_A_HALF_COLUMNS, Panel};

use crate::figure::setpoint_map;
use crate::figure::sweep::{GridAxis, GridScale};
use crate::window::{Condition, Window};
use nanotap_dataset::{Store, StoreError};
use nanotap_study::target::TargetReport;

const fn colour(condition: Condition) -> Colour {
    match condition {
        Condition::NoContact => Colour::rgb(222, 222, 222),
        Condition::OnePeriod1 => Colour::GREEN,
        Condition::SecondState => Colour::ORANGE,
        Condition::Subharmonic => Colour::BLUE,
        Condition::Irregular => Colour::VERMILLION,
        Condition::Undecided => Colour::GREY,
        Condition::Unreached => Colour::WHITE,
    }
}

/// The map of a finished dataset, with the share of each condition in its legend.
///
/// # Errors
/// When a chunk is missing or damaged, or the dataset is not a sweep over two parameters.
pub fn figure(store: &Store) -> Result<Figure, StoreError> {
    let window = Window::of(store)?;
    if let Some(map) = &window.setpoint {
        return Ok(setpoint_map::figure(store, &window, map));
    }
    let (y, x) = (
        GridAxis::of(store, 0).shown(),
        GridAxis::of(store, 1).shown(),
    );
    let share = |condition: Condition| {
        let share = window.shares.get(condition.name());
        share.copied().unwrap_or(0.0)
    };
    let present: Vec<Condition> = Condition::ALL
        .into_iter()
        .filter(|condition| share(*condition) > 0.0)
        .collect();
    let cells: Vec<Option<usize>> = window
        .conditions
        .iter()
        .flatten()
        .map(|c| present.iter().position(|p| p == c))
        .collect();
    let mut layer = GridScale::map(&x, &y, &cells);
    for condition in present {
        let percent = 100.0 * share(condition);
        let part = if percent < 0.5 {
            "below 1".to_owned()
        } else {
            format!("{percent:.0}")
        };
        let name = format!("{} ({part} %)", condition.words());
        layer = layer.category_in(name, colour(condition));
    }
    let mut panel = Panel::new(x.axis(), y.axis()).with(layer);
    if let Some(outline) = window
        .targets
        .as_ref()
        .and_then(|found| outline(found, &x, &y))
    {
        panel = panel.with(outline);
    }
    let panel = panel.legend(Legend::Right);
    Ok(Figure::single(panel).width(ONE_AND_A_HALF_COLUMNS))
}

/// The outline of the points where conditions hold, if they hold anywhere.
pub(crate) fn outline(targets: &TargetReport, x: &GridScale, y: &GridScale) -> Option<Line> {
    let [left, low] = [x, y].map(GridScale::borders);
    let holds = |row: isize, column: isize| {
        let row = usize::try_from(row)
            .ok()
            .and_then(|row| targets.holds.get(row));
        let column = usize::try_from(column).ok();
        row.zip(column)
            .is_some_and(|(row, column)| row.get(column).copied().unwrap_or(false))
    };
    // A gap separates the sides.
    let gap = (f64::NAN, f64::NAN);
    let mut sides = Vec::new();
    for row in 0..=y.values.len() {
        for column in 0..=x.values.len() {
            let [r, c] = [row, column].map(|index| index as isize);
            if holds(r, c) != holds(r - 1, c) && column < x.values.len() {
                sides.extend([(left[column], low[row]), (left[column + 1], low[row]), gap]);
            }
            if holds(r, c) != holds(r, c - 1) && row < y.values.len() {
                sides.extend([(left[column], low[row]), (left[column], low[row + 1]), gap]);
            }
        }
    }
    let percent = 100.0 * targets.share;
    let label = format!("{} ({percent:.0} %)", targets.conditions.join(", "));
    let line = Line::new(sides).width(1.6).colour(Colour::BLACK);
    (targets.share > 0.0).then(|| line.label(label))
}
