//! Forces tabulated in the gap, where a law is costly to evaluate and some 1e-9 of the force will
//! do.

use crate::law::{Approach, Guard};
use crate::system::System;

/// Intervals of a table.
const INTERVALS: usize = 2048;
/// How far a table reaches, as a part of the size of gaps and amplitudes.
const REACH: f64 = 2.0;

/// The force on one branch over `√|level − gap|`, in which it is analytic up to the level at
/// which the branch ends.
#[derive(Clone, Debug)]
struct Curve {
    level: f64,
    /// 1 where the branch lies above the level, −1 where it lies below.
    side: f64,
    /// Intervals a unit of the root.
    density: f64,
    /// At −1, 0, 1 … intervals.
    values: Vec<f64>,
}

/// The force of a law, tabulated on the branches where the law solves an equation for it.
#[derive(Clone, Debug)]
pub(crate) struct GapTable {
    curves: Vec<Option<Curve>>,
}

impl GapTable {
    pub(crate) fn new(system: &System) -> Self {
        let law = system.law();
        let size = system.drive().offset.abs() + system.gap_sizes[0];
        let tabulated = law.branches() <= 64 && !law.depends_on_rate() && size > 0.0;
        let curve = |branch| Curve::new(system, branch, REACH * size).filter(|_| tabulated);
        Self {
            curves: (0..law.branches()).map(curve).collect(),
        }
    }

    /// The force on a branch.
    #[inline]
    pub(crate) fn force(&self, system: &System, branch: usize, gap: f64, rate: f64) -> f64 {
        let curve = self.curves.get(branch).and_then(Option::as_ref);
        let tabulated = curve.and_then(|curve| curve.at(gap));
        tabulated.unwrap_or_else(|| system.law().value(branch, gap, rate))
    }
}

impl Curve {
    /// Of a branch that ends where its slope is infinite.
    fn new(system: &System, branch: usize, reach: f64) -> Option<Self> {
        let mut exits = system.exits(branch).iter();
        let (level, side) = exits.find_map(|exit| match exit.guard {
            _ if exit.before != Approach::Half => None,
            Guard::Falls(level) => Some((level, 1.0)),
            Guard::Rises(level) => Some((level, -1.0)),
            Guard::Turns | Guard::Own(_) => None,
        })?;
        // No further than another end of the branch.
        let ends = system.exits(branch).iter();
        let reach = ends.fold(reach, |reach, exit| match exit.guard {
            Guard::Falls(other) | Guard::Rises(other) if other != level => {
                reach.min((other - level).abs())
            }
            _ => reach,
        });
        let density = INTERVALS as f64 / reach.sqrt();
        let force = |k: usize| {
            let root = k as f64 / density;
            system.law().value(branch, level + side * root * root, 0.0)
        };
        // Beyond the end the cubic through the first four.
        let [a, b, c, d] = [0, 1, 2, 3].map(force);
        let before = 4.0 * a - 6.0 * b + 4.0 * c - d;
        let values: Vec<f64> = std::iter::once(before)
            .chain((0..=INTERVALS + 1).map(force))
            .collect();
        let finite = values.iter().all(|v| v.is_finite());
        finite.then_some(Self {
            level,
            side,
            density,
            values,
        })
    }

    /// The cubic through the four nearest values; `None` outside the table.
    #[inline]
    fn at(&self, gap: f64) -> Option<f64> {
        let x = (self.side * (gap - self.level)).max(0.0).sqrt() * self.density;
        let k = x as usize;
        let [a, b, c, d] = *self.values.get(k..k + 4)? else {
            return None;
        };
        let t = x - k as f64;
        let (s, u, v) = (1.0 - t, 1.0 + t, 2.0 - t);
        Some((-t * s * v * a + 3.0 * u * s * v * b + 3.0 * u * t * v * c - u * t * s * d) / 6.0)
    }
}
