//! The figure of an operating window: the condition at each point.

use nanotap_figures::{Colour, Figure, Legend, ONE_AND_A_HALF_COLUMNS, Panel};

use crate::dataset::{Store, StoreError};
use crate::figure::sweep::{GridAxis, GridScale};
use crate::study::window::{Condition, Window};

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
    let panel = Panel::new(x.axis(), y.axis())
        .with(layer)
        .legend(Legend::Right);
    Ok(Figure::single(panel).width(ONE_AND_A_HALF_COLUMNS))
}
