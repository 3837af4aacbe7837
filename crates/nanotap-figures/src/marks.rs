//! The ticks of an axis with their labels, as many as fit.

use crate::axis::{Axis, View};
use crate::style::Style;
use crate::text::Words;

#[derive(Debug, Clone, Default)]
pub(crate) struct Marks {
    /// Position along the axis (0 to 1) and label.
    pub(crate) major: Vec<(f64, Words)>,
    pub(crate) minor: Vec<f64>,
    pub(crate) note: Option<Words>,
}

impl Marks {
    /// Ticks for an axis of `length` mm; `upright` tells the direction in which their labels are
    /// stacked.
    pub(crate) fn new(axis: &Axis, view: View, length: f64, upright: bool, style: &Style) -> Marks {
        if let Some(given) = &axis.marks {
            return Marks {
                major: given
                    .iter()
                    .filter_map(|(value, words)| {
                        let share = view.share(*value)?;
                        (-1e-9..=1.0 + 1e-9)
                            .contains(&share)
                            .then(|| (share, Words::set(words, style.marks, false)))
                    })
                    .collect(),
                minor: Vec::new(),
                note: None,
            };
        }
        // These spacings give four to six ticks on a usual panel.
        let spacing = if upright { 8.0 } else { 11.0 };
        let max_count = ((length / spacing) as usize + 1).clamp(2, 8);
        let mut marks = Marks::default();
        for max_count in (2..=max_count).rev() {
            let ticks = view.ticks(max_count);
            marks = Marks {
                major: ticks
                    .positions
                    .iter()
                    .zip(&ticks.labels)
                    .filter_map(|(p, l)| Some((view.share(*p)?, Words::set(l, style.marks, false))))
                    .collect(),
                minor: ticks.minor.iter().filter_map(|p| view.share(*p)).collect(),
                note: ticks.note.map(|n| Words::set(&n, style.marks, false)),
            };
            if marks.fits(length, upright) {
                break;
            }
        }
        marks
    }

    fn fits(&self, length: f64, upright: bool) -> bool {
        self.major.windows(2).all(|pair| {
            let distance = (pair[1].0 - pair[0].0).abs() * length;
            let needed = if upright {
                1.7 * pair[0].1.cap_height()
            } else {
                f64::midpoint(pair[0].1.width, pair[1].1.width) + pair[0].1.cap_height()
            };
            distance >= needed
        })
    }

    pub(crate) fn widest(&self) -> f64 {
        self.major.iter().map(|(_, w)| w.width).fold(0.0, f64::max)
    }

    /// Length of the labels beyond the start and the end of a horizontal axis, mm.
    pub(crate) fn overhang(&self, length: f64) -> (f64, f64) {
        self.major
            .iter()
            .fold((0.0, 0.0), |(start, end), (share, words)| {
                let (a, b) = (share * length, words.width / 2.0);
                (f64::max(start, b - a), f64::max(end, a + b - length))
            })
    }
}
