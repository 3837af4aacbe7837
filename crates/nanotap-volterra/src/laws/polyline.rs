//! A conservative force given by rows, linear between them: any measured or computed curve.
//!
//! Below the first gap the first piece is continued; above the last gap the force is constant. Every piece is a branch; the law's potential is the integral of the polyline. Tip and
//! sample touch below the contact distance.

use crate::error::VolterraError;
use crate::law::{Exit, Force, ForceLaw, Guard, Remark};
use crate::laws::entry::{Dimension, Entry, Part, Range, own};
use crate::laws::{Make, TableLaw};
use crate::system::MAX_BRANCHES;
use std::sync::Arc;

/// Largest number of rows: each is a branch, and contact may begin between two of them.
pub const MAX_ROWS: usize = MAX_BRANCHES - 1;

/// The law; its rows are given in addition.
pub static TABLE: TableLaw = TableLaw {
    entry: &Entry {
        name: "table",
        words: "force curve given by rows of gap and force",
        formula: "P(d), straight between the rows of the table",
        source: "the table",
        parameters: &[
            own(
                "contact_distance",
                "gap at which tip and sample touch",
                Dimension::LENGTH,
                Some(0.0),
                Range::Finite,
            ),
            own(
                "gap_factor",
                "factor of the table's gaps",
                Dimension::LENGTH,
                Some(1.0),
                Range::Positive,
            ),
            own(
                "force_factor",
                "factor of the table's forces",
                Dimension::FORCE,
                Some(1.0),
                Range::NotNegative,
            ),
        ],
        parts: &[Part::Elasticity, Part::Adhesion],
        conservative: true,
    },
    make: Make::Rows,
};

/// Rows of gap and force that are a function: each gap once, the smallest first.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows(Vec<(f64, f64)>);

impl Rows {
    /// The rows `(gap, force)`, the gap rising or falling from each to the next.
    ///
    /// # Errors
    /// [`VolterraError::Table`] for fewer than two rows, a value that is not finite, gaps that
    /// turn back, or a gap that stands twice, where the force would jump;
    /// [`VolterraError::TooLarge`] for more than [`MAX_ROWS`].
    pub fn new(points: &[(f64, f64)]) -> Result<Self, VolterraError> {
        let refuse = |row: usize, reason| {
            Err(VolterraError::Table {
                row: row + 1,
                reason,
            })
        };
        if points.len() < 2 {
            return refuse(points.len(), "a force curve needs at least two rows");
        }
        if points.len() > MAX_ROWS {
            return Err(VolterraError::TooLarge {
                what: "the number of rows of the force table",
                found: points.len(),
                limit: MAX_ROWS,
            });
        }
        let falls = points[1].0 < points[0].0;
        for (row, (gap, force)) in points.iter().enumerate() {
            if !(gap.is_finite() && force.is_finite()) {
                return refuse(row, "a value is not finite");
            }
            let Some((before, last)) = row.checked_sub(1).map(|row| points[row]) else {
                continue;
            };
            if *gap == before {
                return refuse(
                    row,
                    "the gap of the row before stands here again: the force would jump, and a \
                     steep rise needs a width",
                );
            }
            if (*gap < before) != falls {
                return refuse(
                    row,
                    "the gap turns back: it must rise, or fall, from row to row",
                );
            }
            if !((force - last) / (gap - before)).is_finite() {
                return refuse(row, "the force jumps: its slope has no finite value");
            }
        }
        let mut rows = points.to_vec();
        if falls {
            rows.reverse();
        }
        Ok(Self(rows))
    }

    /// The rows, the smallest gap first.
    pub fn points(&self) -> &[(f64, f64)] {
        &self.0
    }
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Polyline {
    gaps: Vec<f64>,
    forces: Vec<f64>,
    /// The potential at each point, zero at the last.
    potential: Vec<f64>,
    contact_distance: f64,
    gap_factor: f64,
    force_factor: f64,
    /// The place of contact among the points, where no row is.
    between: Option<usize>,
    /// Pieces at the lower ends of equal intervals, from the first point to the last.
    pieces: Vec<usize>,
    /// Intervals per unit of the gap.
    density: f64,
}

/// Intervals of the gap for each point, in which pieces are looked up.
const INTERVALS_PER_POINT: usize = 4;

impl Polyline {
    /// The polyline through `(gap, force)` points, touching at gap 0.
    ///
    /// # Errors
    /// As [`Rows::new`].
    pub fn new(points: &[(f64, f64)]) -> Result<Self, VolterraError> {
        Ok(Self::through(&Rows::new(points)?, &[0.0, 1.0, 1.0]))
    }

    /// The polyline through rows, with the parameters of its entry.
    pub(crate) fn through(rows: &Rows, parameters: &[f64; 3]) -> Self {
        let [contact_distance, gap_factor, force_factor] = *parameters;
        let mut gaps: Vec<f64> = rows.0.iter().map(|p| gap_factor * p.0).collect();
        let mut forces: Vec<f64> = rows.0.iter().map(|p| force_factor * p.1).collect();
        // Contact begins between two pieces, so that every piece is either.
        let place = gaps.partition_point(|gap| *gap < contact_distance);
        let inside = place > 0 && place < gaps.len() && gaps[place] > contact_distance;
        if inside {
            let part = (contact_distance - gaps[place - 1]) / (gaps[place] - gaps[place - 1]);
            let force = forces[place - 1] + part * (forces[place] - forces[place - 1]);
            gaps.insert(place, contact_distance);
            forces.insert(place, force);
        }
        let mut potential = vec![0.0; gaps.len()];
        for k in (0..gaps.len() - 1).rev() {
            // U = −∫F dd, counted inwards.
            potential[k] =
                potential[k + 1] + 0.5 * (forces[k] + forces[k + 1]) * (gaps[k + 1] - gaps[k]);
        }
        let intervals = INTERVALS_PER_POINT * gaps.len();
        let (first, last) = (gaps[0], gaps[gaps.len() - 1]);
        let density = intervals as f64 / (last - first);
        let lower = |k: usize| first + k as f64 / density;
        let piece = |k: usize| gaps.partition_point(|g| *g <= lower(k)).saturating_sub(1);
        Self {
            pieces: (0..intervals).map(piece).collect(),
            density,
            gaps,
            forces,
            potential,
            contact_distance,
            gap_factor,
            force_factor,
            between: inside.then_some(place),
        }
    }

    /// The slope of piece `k`; the last, beyond all points, is flat.
    fn slope(&self, k: usize) -> f64 {
        if k + 1 < self.gaps.len() {
            (self.forces[k + 1] - self.forces[k]) / (self.gaps[k + 1] - self.gaps[k])
        } else {
            0.0
        }
    }
}

impl ForceLaw for Polyline {
    fn parameters(&self) -> Vec<&'static str> {
        TABLE.entry.parameters.iter().map(|p| p.name).collect()
    }

    fn branches(&self) -> usize {
        self.gaps.len()
    }

    fn branch_at(&self, gap: f64, _rate: f64) -> usize {
        let last = self.gaps.len() - 1;
        let interval = (gap - self.gaps[0]) * self.density;
        // Also where the gap is not a number.
        if !(interval >= 0.0 && gap < self.gaps[last]) {
            return if gap >= self.gaps[last] { last } else { 0 };
        }
        let interval = (interval as usize).min(self.pieces.len() - 1);
        let mut piece = self.pieces[interval];
        while piece > 0 && self.gaps[piece] > gap {
            piece -= 1;
        }
        while piece < last && self.gaps[piece + 1] <= gap {
            piece += 1;
        }
        piece
    }

    fn force(&self, branch: usize, gap: f64, _rate: f64) -> Force {
        let slope = self.slope(branch);
        Force {
            value: self.forces[branch] + slope * (gap - self.gaps[branch]),
            by_gap: slope,
            by_rate: 0.0,
        }
    }

    fn depends_on_rate(&self) -> bool {
        false
    }

    fn exits(&self, branch: usize) -> Vec<Exit> {
        let mut exits = Vec::new();
        if branch > 0 {
            exits.push(Exit::new(Guard::Falls(self.gaps[branch]), branch - 1));
        }
        if branch + 1 < self.gaps.len() {
            exits.push(Exit::new(Guard::Rises(self.gaps[branch + 1]), branch + 1));
        }
        exits
    }

    /// With the table's own curve P it is F = force_factor P(d / gap_factor).
    fn by_parameters(&self, branch: usize, gap: f64, rate: f64, out: &mut [f64]) {
        let [by_distance, by_gap, by_force] = out else {
            return;
        };
        let force = self.force(branch, gap, rate);
        *by_distance = 0.0;
        *by_gap = -force.by_gap * gap / self.gap_factor;
        *by_force = if self.force_factor > 0.0 {
            force.value / self.force_factor
        } else {
            0.0
        };
    }

    fn guard_by_parameters(
        &self,
        branch: usize,
        exit: usize,
        _gap: f64,
        _rate: f64,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        let [by_distance, by_gap, _] = out else {
            return;
        };
        // The first way out of every branch but the lowest is downwards.
        let (knot, sign) = if branch > 0 && exit == 0 {
            (branch, -1.0)
        } else {
            (branch + 1, 1.0)
        };
        if self.between == Some(knot) {
            *by_distance = sign;
        } else {
            *by_gap = sign * self.gaps[knot] / self.gap_factor;
        }
    }

    fn energy(&self, branch: usize, gap: f64) -> Option<f64> {
        let along = gap - self.gaps[branch];
        Some(
            self.potential[branch]
                - along * (self.forces[branch] + 0.5 * self.slope(branch) * along),
        )
    }

    /// Where the whole piece lies below the contact distance.
    fn touches(&self, branch: usize) -> bool {
        let above = self.gaps.get(branch + 1);
        above.is_some_and(|gap| *gap <= self.contact_distance)
    }

    fn vanishes(&self, branch: usize) -> bool {
        branch + 1 == self.gaps.len() && self.forces[branch] == 0.0
    }

    fn conservative(&self) -> bool {
        true
    }

    fn remarks(&self, least_gap: f64) -> Vec<Remark> {
        let (first, last) = (self.gaps[0], self.gaps[self.gaps.len() - 1]);
        let value = (first - least_gap) / (last - first);
        let ratio = "(d1 − d)/(dn − d1), how far the gap falls below the table's first row,";
        let limit = 0.0;
        let below = (value > limit).then_some(Remark {
            ratio,
            value,
            limit,
        });
        below.into_iter().collect()
    }
}

impl TableLaw {
    /// The law of `table` through these rows, with the parameters of its entry.
    ///
    /// # Errors
    /// As [`TableLaw::with`].
    pub fn through(
        &self,
        rows: &Rows,
        parameters: &[f64],
    ) -> Result<Arc<dyn ForceLaw>, VolterraError> {
        self.check(parameters)?;
        match (self.make, parameters) {
            (Make::Rows, &[distance, gap, force]) => {
                Ok(Arc::new(Polyline::through(rows, &[distance, gap, force])))
            }
            _ => self.with(parameters),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contact begins inside the second piece, which is parted there and no other way changed.
    #[test]
    fn contact_parts_a_piece() {
        let rows = Rows::new(&[(4.0, 0.0), (1.0, -0.3), (-1.0, 5.0)]).unwrap();
        let law = TABLE.through(&rows, &[0.5, 1.0, 1.0]).unwrap();
        assert_eq!(law.branches(), 4);
        assert_eq!(
            (0..4).map(|b| law.touches(b)).collect::<Vec<_>>(),
            [true, false, false, false]
        );
        for (gap, force) in [
            (-2.0, 7.65),
            (0.0, 2.35),
            (0.5, 1.025),
            (0.8, 0.23),
            (9.0, 0.0),
        ] {
            let found = law.force(law.branch_at(gap, 0.0), gap, 0.0).value;
            assert!((found - force).abs() < 1e-14, "{gap}: {found}");
        }
        // ∫F dd from 4 down to −1, piece by piece.
        let stored = law.energy(0, -1.0).unwrap();
        assert!((stored - (-0.5 * 0.3 * 3.0 + 0.5 * 4.7 * 2.0)).abs() < 1e-14);
        assert!(law.remarks(-0.9).is_empty());
        assert_eq!(law.remarks(-2.0)[0].value, 0.2);
    }

    #[test]
    fn rows_that_are_no_function_are_refused() {
        let of = |points: &[(f64, f64)]| Rows::new(points).unwrap_err().to_string();
        assert!(of(&[(0.0, 1.0)]).contains("row 2"));
        assert!(of(&[(0.0, 1.0), (1.0, 0.0), (1.0, 2.0)]).contains("would jump"));
        assert!(of(&[(1.0, 1.0), (0.0, 0.0), (0.5, 2.0)]).contains("turns back"));
        assert!(of(&[(1.0, f64::NAN), (0.0, 0.0)]).contains("not finite"));
        assert!(of(&[(0.0, 0.0), (f64::MIN_POSITIVE, 1e10)]).contains("jumps"));
        assert!(TABLE.with(&[0.0, 1.0, 1.0]).is_err());
    }
}
