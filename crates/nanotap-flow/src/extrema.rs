//! Extrema of outputs: zeros of the derivative, found with the same certificate as
//! switches, never from samples.

use crate::search::sign_changes;
use crate::trajectory::PiecewiseSignal;

/// A local or global extremum of a signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extremum {
    /// Time of the extremum, from the start of the recording's first period, in the system's unit
    /// of time.
    pub time: f64,
    /// Value of the signal there, in the units of the output.
    pub value: f64,
}

impl PiecewiseSignal {
    /// Returns every local extremum inside the pieces (zeros of the derivative), in order of time.
    /// Kinks at switches are not included; see [`PiecewiseSignal::range`].
    pub fn local_extrema(&self) -> Vec<Extremum> {
        let mut out = Vec::new();
        for piece in &self.pieces {
            let rate = piece.signal.differentiated(piece.length);
            for s in sign_changes(&rate, piece.length) {
                out.push(Extremum {
                    time: piece.start + s,
                    value: piece.signal.at(s),
                });
            }
        }
        out
    }

    /// Returns the least and the greatest value, ends and switches included; `None` if empty.
    pub fn range(&self) -> Option<(Extremum, Extremum)> {
        let ends = self.pieces.iter().flat_map(|p| {
            [0.0, p.length].map(|s| Extremum {
                time: p.start + s,
                value: p.signal.at(s),
            })
        });
        let mut all: Vec<Extremum> = ends.collect();
        all.extend(self.local_extrema());
        let least = all
            .iter()
            .copied()
            .min_by(|a, b| a.value.total_cmp(&b.value))?;
        let greatest = all
            .iter()
            .copied()
            .max_by(|a, b| a.value.total_cmp(&b.value))?;
        Some((least, greatest))
    }
}
