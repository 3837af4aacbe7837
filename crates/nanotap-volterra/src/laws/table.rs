//! A force given by rows of gap, force and, if there is one, damping: any measured or computed curve.
//!
//! Between the rows it is linear, or a cubic spline written as few polynomials ([`curve`]).
//! Below the first gap the force goes straight on; above the last gap it is constant. Every
//! polynomial is a branch; without damping the law's potential is their integral. Tip and sample
//! touch below the contact distance.

// Only what is inlined into a function for wide registers gets their instructions.
#![allow(clippy::inline_always)]

use crate::error::VolterraError;
use crate::law::{Exit, Force, ForceLaw, Guard, Remark};
use crate::laws::curve::{self, Interpolation, LANES, Piece};
use crate::laws::entry::{
    CONTACT_DISTANCE, Entry, ParameterEntry, Part, Range, factor, parameters,
};
use crate::laws::{Make, TableLaw};
use crate::linear::wide_registers;
use crate::system::MAX_BRANCHES;
use nanotap_quantity::Kind;
use std::sync::Arc;

/// Largest number of rows: each row is a branch, as is the range below the first, and contact may
/// begin between two of them.
pub const MAX_ROWS: usize = MAX_BRANCHES - 2;

parameters! {
    /// Factor of the table's gaps.
    pub const GAP_FACTOR = factor("gap_factor", "factor of the table's gaps", Kind::Length, Range::Positive,
        "factor by which a table's gaps are stretched");
    /// Factor of the table's forces.
    pub const FORCE_FACTOR = factor("force_factor", "factor of the table's forces", Kind::Force,
        Range::NotNegative, "factor of a table's forces");
    /// Factor of the table's damping.
    pub const DAMPING_FACTOR = factor("damping_factor", "factor of the table's damping", Kind::Damping,
        Range::NotNegative, "factor of a table's damping");
}

/// Table entry of a force given by rows, which are given in addition to the parameters.
pub static TABLE: TableLaw = TableLaw {
    entry: &Entry {
        name: "table",
        words: "force curve given by rows of gap and force, and of damping if there is one",
        formula: "P(d) − γ(d) ḋ, straight lines or a spline through the rows of the table",
        source: "the table",
        parameters: &[
            ParameterEntry {
                words: "gap at which tip and sample touch",
                default: Some(0.0),
                ..CONTACT_DISTANCE
            },
            GAP_FACTOR,
            FORCE_FACTOR,
            DAMPING_FACTOR,
        ],
        parts: &[Part::Elasticity, Part::Adhesion],
        attracts: true,
        conservative: true,
    },
    make: Make::Rows,
};

/// Rows of gap and force, and of damping if given, that define a function: each gap once, the
/// smallest first.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    points: Vec<(f64, f64)>,
    damping: Vec<f64>,
    interpolation: Interpolation,
    pieces: Arc<[Piece]>,
}

impl Rows {
    /// Creates the rows `(gap, force)`, with gaps that rise or fall throughout, and straight lines
    /// between them.
    ///
    /// # Errors
    /// [`VolterraError::Table`] for fewer than two rows, a value that is not finite, gaps that
    /// turn back, or a gap that stands twice, where the force would jump;
    /// [`VolterraError::TooLarge`] for more than [`MAX_ROWS`].
    pub fn new(points: &[(f64, f64)]) -> Result<Self, VolterraError> {
        Self::damped(points, &[])
    }

    /// Creates the rows with a damping `γ` for each, or none at all: the force is `P(d) − γ(d) ḋ`.
    ///
    /// # Errors
    /// As [`new`](Self::new), and for a damping that is negative.
    pub fn damped(points: &[(f64, f64)], damping: &[f64]) -> Result<Self, VolterraError> {
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
        if !damping.is_empty() && damping.len() != points.len() {
            return Err(VolterraError::Shape {
                what: "the damping of a force table",
                found: damping.len(),
                expected: points.len(),
            });
        }
        let falls = points[1].0 < points[0].0;
        for (row, (gap, force)) in points.iter().enumerate() {
            let damping = damping.get(row).copied().unwrap_or(0.0);
            if !(gap.is_finite() && force.is_finite() && damping.is_finite()) {
                return refuse(row, "a value is not finite");
            }
            if damping < 0.0 {
                return refuse(row, "the damping is negative");
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
        let (mut points, mut damping) = (points.to_vec(), damping.to_vec());
        if falls {
            points.reverse();
            damping.reverse();
        }
        Ok(Self::interpolated(points, damping, Interpolation::Linear))
    }

    /// Returns the same rows with another curve between them.
    #[must_use]
    pub fn by(&self, interpolation: Interpolation) -> Self {
        Self::interpolated(self.points.clone(), self.damping.clone(), interpolation)
    }

    fn interpolated(
        points: Vec<(f64, f64)>,
        damping: Vec<f64>,
        interpolation: Interpolation,
    ) -> Self {
        let (gaps, forces): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
        let mut columns = vec![(&forces[..], interpolation)];
        if !damping.is_empty() {
            // Between two rows a damping must not become negative.
            let limited = match interpolation {
                Interpolation::Linear => Interpolation::Linear,
                Interpolation::Monotone | Interpolation::Natural => Interpolation::Monotone,
            };
            columns.push((&damping[..], limited));
        }
        let pieces = curve::pieces(&gaps, &columns).into();
        Self {
            points,
            damping,
            interpolation,
            pieces,
        }
    }

    /// Returns the rows of gap and force, the smallest gap first.
    pub fn points(&self) -> &[(f64, f64)] {
        &self.points
    }

    /// Returns the damping of each row; empty without damping.
    pub fn damping(&self) -> &[f64] {
        &self.damping
    }

    /// Returns the curve between the rows.
    pub const fn interpolation(&self) -> Interpolation {
        self.interpolation
    }
}

/// A branch: a polynomial in the gap, in the unit of the rows.
#[derive(Clone, Debug)]
struct Branch {
    middle: f64,
    half: f64,
    force: Vec<f64>,
    damping: Vec<f64>,
    /// Integral `∫F` from the gap to the end of its polynomial.
    integral: Vec<f64>,
    /// Integral `∫F` from that end to far away.
    beyond: f64,
}

impl Branch {
    /// Creates the straight line `intercept + slope (gap − at)` of force and damping.
    fn line(at: f64, values: [[f64; 2]; 2], beyond: f64) -> Self {
        let [force, damping] = values.map(|[value, slope]| vec![value, slope]);
        Self {
            middle: at,
            half: 1.0,
            // Zero at u = 0, where the line begins, in place of u = 1.
            integral: {
                let mut sum = curve::integral(&force);
                sum[0] -= curve::series(&sum, 0.0)[0];
                sum
            },
            force,
            damping,
            beyond,
        }
    }

    fn place(&self, gap: f64) -> f64 {
        (gap - self.middle) / self.half
    }
}

/// Law of a force given by rows; see the module.
#[derive(Clone, Debug)]
pub struct ForceTable {
    branches: Vec<Branch>,
    /// Gaps at which the branches end, without the last.
    joints: Vec<f64>,
    contact_distance: f64,
    gap_factor: f64,
    force_factor: f64,
    damping_factor: f64,
    /// Joint at which contact begins, if no two polynomials meet there.
    contact: Option<usize>,
    /// Gaps of the first and of the last row.
    ends: [f64; 2],
    /// Branches at the lower ends of equal intervals, from the first joint to the last.
    lookup: Vec<usize>,
    /// Number of intervals per unit of the gap.
    density: f64,
    damped: bool,
    smooth: bool,
}

/// Number of intervals of the lookup per joint.
const INTERVALS_PER_JOINT: usize = 4;

impl ForceTable {
    /// Creates the law of the curve through rows, with contact below gap 0.
    pub fn new(rows: &Rows) -> Self {
        Self::through(rows, &[0.0, 1.0, 1.0, 1.0])
    }

    /// Creates the law of the curve through rows, with the parameters of its entry.
    pub(crate) fn through(rows: &Rows, parameters: &[f64; 4]) -> Self {
        let [contact_distance, gap_factor, force_factor, damping_factor] = *parameters;
        let gap = |row: usize| rows.points[row].0;
        let last = rows.points.len() - 1;
        let smooth = rows.interpolation != Interpolation::Linear;
        let mut branches: Vec<Branch> = Vec::with_capacity(rows.pieces.len() + 3);
        let mut joints = Vec::with_capacity(rows.pieces.len() + 2);
        let zero = || vec![0.0];
        for piece in &*rows.pieces {
            let [low, high] = piece.rows.map(gap);
            let force = piece.curves[0].clone();
            branches.push(Branch {
                middle: 0.5 * (low + high),
                half: 0.5 * (high - low),
                integral: curve::integral(&force),
                force,
                damping: piece.curves.get(1).cloned().unwrap_or_else(zero),
                beyond: 0.0,
            });
            joints.push(gap_factor * high);
        }
        // ∫F inwards; beyond the last row the force is constant, and its potential counts from there.
        let mut beyond = 0.0;
        for branch in branches.iter_mut().rev() {
            branch.beyond = beyond;
            beyond -= branch.half * curve::series(&branch.integral, -1.0)[0];
        }
        let damping = |row: usize| rows.damping.get(row).copied().unwrap_or(0.0);
        let ends = [[rows.points[last].1, 0.0], [damping(last), 0.0]];
        branches.push(Branch::line(gap(last), ends, 0.0));
        if smooth {
            // Straight on below the first row, with the damping of that row.
            let first = &branches[0];
            let slope = curve::series(&first.force, -1.0)[1] / first.half;
            let ends = [[rows.points[0].1, slope], [damping(0), 0.0]];
            branches.insert(0, Branch::line(gap(0), ends, beyond));
            joints.insert(0, gap_factor * gap(0));
        }
        // Contact begins between two branches, so that every branch is either.
        let place = joints.partition_point(|joint| *joint < contact_distance);
        let inside = joints
            .get(place)
            .is_none_or(|joint| *joint > contact_distance);
        let among = contact_distance > gap_factor * gap(0) && place < joints.len();
        let contact = (inside && among).then_some(place);
        if let Some(place) = contact {
            joints.insert(place, contact_distance);
            branches.insert(place, branches[place].clone());
        }
        let intervals = INTERVALS_PER_JOINT * joints.len();
        let (low, high) = (joints[0], joints[joints.len() - 1]);
        let density = if high > low {
            intervals as f64 / (high - low)
        } else {
            0.0
        };
        let lower = |k: usize| low + k as f64 / density;
        let branch = |k: usize| joints.partition_point(|joint| *joint <= lower(k));
        Self {
            lookup: (0..intervals).map(branch).collect(),
            density,
            smooth,
            branches,
            joints,
            contact_distance,
            gap_factor,
            force_factor,
            damping_factor,
            contact,
            ends: [gap(0), gap(last)].map(|gap| gap_factor * gap),
            damped: !rows.damping.is_empty() && damping_factor > 0.0,
        }
    }

    /// Returns force and damping of the rows' own curves, each with its slope by the rows' gap.
    #[inline]
    fn curves(&self, branch: usize, gap: f64) -> [[f64; 2]; 2] {
        let branch = &self.branches[branch];
        let u = branch.place(gap / self.gap_factor);
        let [force, slope] = curve::series(&branch.force, u);
        let [damping, rise] = if self.damped {
            curve::series(&branch.damping, u)
        } else {
            [0.0; 2]
        };
        [[force, slope / branch.half], [damping, rise / branch.half]]
    }
}

/// Evaluates [`ForceLaw::forces`] of a table, compiled also for wide registers.
#[inline(always)]
fn forces_at(
    law: &ForceTable,
    branch: usize,
    gaps: &[f64],
    rates: &[f64],
    [values, by_gap, by_rate]: [&mut [f64]; 3],
) {
    let branch = &law.branches[branch];
    let places = [
        1.0 / (law.gap_factor * branch.half),
        -branch.middle / branch.half,
    ];
    let slope = law.force_factor * places[0];
    let rise = law.damping_factor * places[0];
    for first in (0..gaps.len()).step_by(LANES) {
        let count = LANES.min(gaps.len() - first);
        let mut u = [0.0; LANES];
        for (u, gap) in u.iter_mut().zip(&gaps[first..]) {
            *u = gap * places[0] + places[1];
        }
        let [force, along] = curve::series_at(&branch.force, &u);
        for i in 0..count {
            values[first + i] = law.force_factor * force[i];
            by_gap[first + i] = slope * along[i];
            by_rate[first + i] = 0.0;
        }
        if law.damped {
            let [damping, along] = curve::series_at(&branch.damping, &u);
            for i in 0..count {
                let (rate, damping) = (rates[first + i], law.damping_factor * damping[i]);
                values[first + i] -= damping * rate;
                by_gap[first + i] -= rise * along[i] * rate;
                by_rate[first + i] = -damping;
            }
        }
    }
}

impl ForceLaw for ForceTable {
    fn parameters(&self) -> Vec<&'static str> {
        TABLE.entry.parameter_names()
    }

    fn branches(&self) -> usize {
        self.branches.len()
    }

    fn branch_at(&self, gap: f64, _rate: f64) -> usize {
        let last = self.joints.len() - 1;
        let interval = (gap - self.joints[0]) * self.density;
        // Also where the gap is not a number.
        if !(interval >= 0.0 && gap < self.joints[last]) {
            return if gap >= self.joints[last] {
                last + 1
            } else {
                usize::from(gap >= self.joints[0])
            };
        }
        let interval = (interval as usize).min(self.lookup.len() - 1);
        let mut branch = self.lookup[interval];
        while branch > 0 && self.joints[branch - 1] > gap {
            branch -= 1;
        }
        while branch <= last && self.joints[branch] <= gap {
            branch += 1;
        }
        branch
    }

    fn force(&self, branch: usize, gap: f64, rate: f64) -> Force {
        let [[force, slope], [damping, rise]] = self.curves(branch, gap);
        let damping = self.damping_factor * damping;
        let by_gap = self.force_factor * slope - self.damping_factor * rise * rate;
        Force {
            value: self.force_factor * force - damping * rate,
            by_gap: by_gap / self.gap_factor,
            by_rate: -damping,
        }
    }

    fn forces(&self, branch: usize, gaps: &[f64], rates: &[f64], out: [&mut [f64]; 3]) {
        wide_registers!([] forces_at(
            law: &ForceTable = self,
            branch: usize = branch,
            gaps: &[f64] = gaps,
            rates: &[f64] = rates,
            out: [&mut [f64]; 3] = out,
        ));
    }

    fn depends_on_rate(&self) -> bool {
        self.damped
    }

    fn exits(&self, branch: usize) -> Vec<Exit> {
        let below = branch.checked_sub(1);
        let down = below.map(|below| Exit::new(Guard::Falls(self.joints[below]), below));
        let above = self.joints.get(branch);
        let up = above.map(|level| Exit::new(Guard::Rises(*level), branch + 1));
        down.into_iter().chain(up).collect()
    }

    /// Returns the gap of the first row: below it the straight line is only an assumption.
    fn wall(&self) -> Option<f64> {
        Some(self.ends[0])
    }

    /// Differentiates `F = force_factor P(d / gap_factor) − damping_factor γ(d / gap_factor) ḋ`
    /// with the table's own curves `P` and `γ`.
    fn by_parameters(&self, branch: usize, gap: f64, rate: f64, out: &mut [f64]) {
        let [by_distance, by_gap, by_force, by_damping] = out else {
            return;
        };
        let [[force, _], [damping, _]] = self.curves(branch, gap);
        *by_distance = 0.0;
        *by_gap = -self.force(branch, gap, rate).by_gap * gap / self.gap_factor;
        *by_force = force;
        *by_damping = -damping * rate;
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
        let [by_distance, by_gap, ..] = out else {
            return;
        };
        // The first way out of every branch but the lowest is downwards.
        let (joint, sign) = if branch > 0 && exit == 0 {
            (branch - 1, -1.0)
        } else {
            (branch, 1.0)
        };
        if self.contact == Some(joint) {
            *by_distance = sign;
        } else {
            *by_gap = sign * self.joints[joint] / self.gap_factor;
        }
    }

    fn energy(&self, branch: usize, gap: f64) -> Option<f64> {
        let branch = self.branches.get(branch).filter(|_| !self.damped)?;
        let u = branch.place(gap / self.gap_factor);
        let inside = -branch.half * curve::series(&branch.integral, u)[0];
        Some((branch.beyond + inside) * self.force_factor * self.gap_factor)
    }

    /// Reports whether the whole branch lies below the contact distance.
    fn touches(&self, branch: usize) -> bool {
        let above = self.joints.get(branch);
        above.is_some_and(|joint| *joint <= self.contact_distance)
    }

    fn is_piecewise(&self) -> bool {
        self.smooth
    }

    fn vanishes(&self, branch: usize) -> bool {
        branch == self.joints.len() && {
            let zero = |curve: &[f64]| curve.iter().all(|c| *c == 0.0);
            let last = &self.branches[branch];
            zero(&last.force) && (!self.damped || zero(&last.damping))
        }
    }

    fn conservative(&self) -> bool {
        !self.damped
    }

    fn remarks(&self, least_gap: f64) -> Vec<Remark> {
        let [first, last] = self.ends;
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
            (Make::Rows, &[distance, gap, force, damping]) => Ok(Arc::new(ForceTable::through(
                rows,
                &[distance, gap, force, damping],
            ))),
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
        let law = TABLE.through(&rows, &[0.5, 1.0, 1.0, 1.0]).unwrap();
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
        assert!(TABLE.with(&[0.0, 1.0, 1.0, 1.0]).is_err());
    }
}
