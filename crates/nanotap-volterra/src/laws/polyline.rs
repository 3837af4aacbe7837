//! A conservative force given by points, linear between them: any measured or computed curve.
//!
//! Below the first point the first piece goes on, above the last point the force stays as it
//! is there. Every piece is a branch; the law's potential is the integral of the polyline.

use crate::error::VolterraError;
use crate::law::{Exit, Force, ForceLaw, Guard};
use crate::system::MAX_BRANCHES;

/// See the module.
#[derive(Clone, Debug)]
pub struct Polyline {
    gaps: Vec<f64>,
    forces: Vec<f64>,
    /// The potential at each point, zero at the last.
    potential: Vec<f64>,
}

impl Polyline {
    /// The polyline through `(gap, force)` points of increasing gap.
    ///
    /// # Errors
    /// [`VolterraError::Table`] for fewer than two points, gaps that do not increase, or a
    /// value that is not finite; [`VolterraError::TooLarge`] beyond the number of branches
    /// that a law may have.
    pub fn new(points: &[(f64, f64)]) -> Result<Self, VolterraError> {
        if points.len() < 2 {
            return Err(VolterraError::Table {
                row: points.len() + 1,
                reason: "a force curve needs at least two rows",
            });
        }
        if points.len() > MAX_BRANCHES {
            return Err(VolterraError::TooLarge {
                what: "the number of rows of the force table",
                found: points.len(),
                limit: MAX_BRANCHES,
            });
        }
        for (row, (gap, force)) in points.iter().enumerate() {
            if !(gap.is_finite() && force.is_finite()) {
                return Err(VolterraError::Table {
                    row: row + 1,
                    reason: "a value is not finite",
                });
            }
            if row > 0 && *gap <= points[row - 1].0 {
                return Err(VolterraError::Table {
                    row: row + 1,
                    reason: "the gap must increase from row to row",
                });
            }
        }
        let gaps: Vec<f64> = points.iter().map(|p| p.0).collect();
        let forces: Vec<f64> = points.iter().map(|p| p.1).collect();
        let mut potential = vec![0.0; points.len()];
        for k in (0..points.len() - 1).rev() {
            // U = −∫F dd, counted inwards.
            potential[k] =
                potential[k + 1] + 0.5 * (forces[k] + forces[k + 1]) * (gaps[k + 1] - gaps[k]);
        }
        Ok(Self {
            gaps,
            forces,
            potential,
        })
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
        Vec::new()
    }

    fn branches(&self) -> usize {
        self.gaps.len()
    }

    fn branch_at(&self, gap: f64, _rate: f64) -> usize {
        self.gaps.partition_point(|g| *g <= gap).saturating_sub(1)
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

    fn by_parameters(&self, _: usize, _: f64, _: f64, _: &mut [f64]) {}

    fn guard_by_parameters(&self, _: usize, _: usize, _: f64, _: f64, _: &mut [f64]) {}

    fn energy(&self, branch: usize, gap: f64) -> Option<f64> {
        let along = gap - self.gaps[branch];
        Some(
            self.potential[branch]
                - along * (self.forces[branch] + 0.5 * self.slope(branch) * along),
        )
    }

    /// Where the whole piece lies below the surface, `d ≤ 0`.
    fn touches(&self, branch: usize) -> bool {
        self.gaps.get(branch + 1).is_some_and(|gap| *gap <= 0.0)
    }

    fn vanishes(&self, branch: usize) -> bool {
        branch + 1 == self.gaps.len() && self.forces[branch] == 0.0
    }

    fn conservative(&self) -> bool {
        true
    }
}
