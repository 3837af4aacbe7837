//! Forces tabulated over the gap, for laws that are costly to evaluate where a relative accuracy of
//! about 1e-7 suffices.

use crate::law::{Approach, Exit, Guard};
use crate::system::System;

/// Number of intervals of a table.
const INTERVALS: usize = 2048;
/// Largest number of branches of a law that is tabulated.
const MAX_BRANCHES: usize = 64;
/// Number of gaps at which a table is compared with the law.
const CHECKS: usize = 64;
/// Largest relative difference of a table from the law.
const ACCURACY: f64 = 1e-6;
/// Length of a table, as a multiple of the size of gaps and amplitudes.
const REACH: f64 = 2.0;

/// The force on one branch as a function of `√|level − gap|`, in which it is analytic up to the
/// level at which the branch ends. The force may be affine in the gap's rate.
#[derive(Clone, Debug)]
struct Curve {
    level: f64,
    /// 1 where the branch lies above the level, −1 where it lies below.
    side: f64,
    /// Number of intervals per unit of the root.
    density: f64,
    values: Values,
}

/// A sixth of the force at −1, 0, 1 … intervals.
#[derive(Clone, Debug)]
enum Values {
    OfGap(Vec<f64>),
    /// Values at rate zero, and their derivatives by the rate.
    OfRate(Vec<[f64; 2]>),
}

/// The force of a law, tabulated on the branches where the law solves an equation for it or has
/// several terms.
#[derive(Clone, Debug)]
pub(crate) struct GapTable {
    curves: Vec<Option<Curve>>,
}

impl GapTable {
    pub(crate) fn new(system: &System) -> Self {
        let law = system.law();
        let size = system.drive().offset.abs() + system.gap_sizes[0];
        let tabulated = law.branches() <= MAX_BRANCHES && size > 0.0;
        let curve = |branch| Curve::new(system, branch, REACH * size).filter(|_| tabulated);
        Self {
            curves: (0..law.branches()).map(curve).collect(),
        }
    }

    /// Returns the force on a branch.
    #[inline]
    pub(crate) fn force(&self, system: &System, branch: usize, gap: f64, rate: f64) -> f64 {
        let curve = self.curves.get(branch).and_then(Option::as_ref);
        let tabulated = curve.and_then(|curve| curve.at(gap, rate));
        tabulated.unwrap_or_else(|| system.law().value(branch, gap, rate))
    }

    /// Returns the force's derivatives by gap and rate.
    pub(crate) fn slopes(&self, system: &System, branch: usize, gap: f64, rate: f64) -> [f64; 2] {
        let curve = self.curves.get(branch).and_then(Option::as_ref);
        let tabulated = curve.and_then(|curve| curve.slopes_at(gap, rate));
        tabulated.unwrap_or_else(|| {
            let force = system.law().force(branch, gap, rate);
            [force.by_gap, force.by_rate]
        })
    }
}

impl Curve {
    /// Tabulates a branch that ends at an infinite slope, or at a gap under a law of several terms.
    fn new(system: &System, branch: usize, reach: f64) -> Option<Self> {
        let law = system.law();
        let end = |exit: &Exit| match exit.guard {
            Guard::Falls(level) => Some((level, 1.0)),
            Guard::Rises(level) => Some((level, -1.0)),
            Guard::Turns | Guard::Own(_) => None,
        };
        let exits = || system.exits(branch).iter();
        let mut steep = exits().filter(|exit| exit.before == Approach::Half);
        let (level, side) = steep
            .find_map(end)
            .or_else(|| exits().find_map(end).filter(|_| law.has_terms()))?;
        // No further than another end of the branch.
        let ends = system.exits(branch).iter();
        let reach = ends.fold(reach, |reach, exit| match exit.guard {
            Guard::Falls(other) | Guard::Rises(other) if other != level => {
                reach.min((other - level).abs())
            }
            _ => reach,
        });
        let density = INTERVALS as f64 / reach.sqrt();
        let at = |k: usize, rate: f64| {
            let root = k as f64 / density;
            law.value(branch, level + side * root * root, rate)
        };
        // A force in proportion to the rate and one without it; any other is not tabulated.
        let linear = |k: usize| {
            let [a, b, c] = [-1.0, 0.0, 2.0].map(|rate| at(k, rate * reach));
            (c - b - 2.0 * (b - a)).abs() <= 1e-9 * (a.abs() + b.abs() + c.abs())
        };
        let rates = law.depends_on_rate();
        if rates && ![1, INTERVALS / 3, INTERVALS].into_iter().all(linear) {
            return None;
        }
        // Beyond the end the cubic through the first four.
        let table = |value: &dyn Fn(usize) -> f64| {
            let [a, b, c, d] = [0, 1, 2, 3].map(value);
            let before = 4.0 * a - 6.0 * b + 4.0 * c - d;
            let values = std::iter::once(before).chain((0..=INTERVALS + 1).map(value));
            values.collect::<Vec<f64>>()
        };
        let forces = table(&|k| at(k, 0.0));
        let by_rate = if rates {
            table(&|k| (at(k, reach) - at(k, -reach)) / (2.0 * reach))
        } else {
            Vec::new()
        };
        if forces.iter().chain(&by_rate).any(|v| !v.is_finite()) {
            return None;
        }
        let size = |values: &[f64]| values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let sizes = [size(&forces), size(&by_rate)];
        let values = if rates {
            let pairs = forces.iter().zip(&by_rate);
            Values::OfRate(pairs.map(|(a, b)| [a / 6.0, b / 6.0]).collect())
        } else {
            Values::OfGap(forces.iter().map(|v| v / 6.0).collect())
        };
        let curve = Self {
            level,
            side,
            density,
            values,
        };
        let local =
            |k: usize, rate: f64| forces[k].abs() + rate * by_rate.get(k).map_or(0.0, |v| v.abs());
        let agrees = curve.agrees_with(sizes, local, |gap, rate| law.value(branch, gap, rate));
        agrees.then_some(curve)
    }

    /// Reports whether the table is accurate between its points, given the sizes of the force and
    /// of its derivative by the rate, and the size of the force near an interval at a rate.
    fn agrees_with(
        &self,
        sizes: [f64; 2],
        size_near: impl Fn(usize, f64) -> f64,
        force: impl Fn(f64, f64) -> f64,
    ) -> bool {
        (1..CHECKS).all(|check| {
            let k = check * INTERVALS / CHECKS;
            let root = (k as f64 + 0.5) / self.density;
            let gap = self.level + self.side * root * root;
            let rate = if sizes[1] > 0.0 {
                sizes[0] / sizes[1]
            } else {
                0.0
            };
            let [found, expected] = [self.at(gap, rate), Some(force(gap, rate))];
            let local = size_near(k, rate).max(size_near(k + 1, rate));
            found
                .zip(expected)
                .is_some_and(|(a, b)| (a - b).abs() <= ACCURACY * local.max(1e-6 * sizes[0]))
        })
    }

    /// Returns the cubic through the four nearest values; `None` outside the table.
    #[inline]
    fn at(&self, gap: f64, rate: f64) -> Option<f64> {
        let (k, t) = self.place(gap);
        self.read(k, weights(t), rate)
    }

    /// Returns the derivatives of this cubic by gap and rate; `None` also in the first interval,
    /// where the square root has no derivative.
    #[inline]
    fn slopes_at(&self, gap: f64, rate: f64) -> Option<[f64; 2]> {
        let (k, t) = self.place(gap);
        if k == 0 {
            return None;
        }
        let by_root = self.read(k, weights_of_slope(t), rate)?;
        let by_rate = match &self.values {
            Values::OfGap(_) => 0.0,
            Values::OfRate(pairs) => {
                let near = pairs.get(k..)?.get(..4)?.iter().zip(weights(t));
                near.map(|([_, by_rate], weight)| by_rate * weight).sum()
            }
        };
        let root = (k as f64 + t) / self.density;
        Some([by_root * self.side * self.density / (2.0 * root), by_rate])
    }

    /// Returns the interval of a gap, and the fraction within it; an interval beyond every table if
    /// the gap is infinite.
    #[inline]
    fn place(&self, gap: f64) -> (usize, f64) {
        let x = (self.side * (gap - self.level)).max(0.0).sqrt() * self.density;
        let k = x as usize;
        (k, x - k as f64)
    }

    /// Returns the force as a weighted sum of the four nearest values.
    #[inline]
    fn read(&self, k: usize, weights: [f64; 4], rate: f64) -> Option<f64> {
        match &self.values {
            Values::OfGap(values) => {
                let near = values.get(k..)?.get(..4)?.iter().zip(weights);
                Some(near.map(|(value, weight)| value * weight).sum())
            }
            Values::OfRate(pairs) => {
                let near = pairs.get(k..)?.get(..4)?.iter().zip(weights);
                Some(near.map(|([a, b], weight)| (a + rate * b) * weight).sum())
            }
        }
    }
}

/// Returns six times the weights of the values at −1, 0, 1 and 2 in their cubic at `t`.
#[inline]
fn weights(t: f64) -> [f64; 4] {
    let (s, u, v) = (1.0 - t, 1.0 + t, 2.0 - t);
    [-t * s * v, 3.0 * u * s * v, 3.0 * u * t * v, -u * t * s]
}

/// Returns the derivatives of these weights by `t`.
#[inline]
fn weights_of_slope(t: f64) -> [f64; 4] {
    let square = 3.0 * t * t;
    [
        -(2.0 - 6.0 * t + square),
        3.0 * (square - 4.0 * t - 1.0),
        3.0 * (2.0 + 2.0 * t - square),
        square - 1.0,
    ]
}
