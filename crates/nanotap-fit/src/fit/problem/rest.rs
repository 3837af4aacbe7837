//! Force curves: at every row the lever is at rest on one of its static branches.
//!
//! The rests of a curve form chains ([`RestLever::chains`]), and each row is assigned to one of them
//! as it is to a branch of orbits. Derivatives follow from the equation of the rest: at a fixed
//! separation, distance and force of the levers with a key a little higher and lower are closed
//! forms, so that their central differences are accurate to ten digits; the slope of the rest gives
//! the derivatives at a fixed distance.
//!
//! The dynamics of the lever is neglected: viscous forces, ringing after the jumps, inertia.

use rayon::prelude::*;

use super::{Effects, Point, Problem, RowPoint};
use crate::fit::branches::Rows;
use crate::fit::data::{Row, is_distance};
use crate::fit::parameters::{Parameter, Target};
use crate::fit::quantity::RestQuantity;
use crate::fit::statistics::span;
use nanotap_case::{Case, Key};
use nanotap_scan::force_curve::{Chain, RestLever, StableRest};

/// Margin of the range of distances, as a part of it.
const MARGIN: f64 = 0.05;
/// How far beyond the rows a rest is searched for first, m.
const REACH: f64 = 1e-9;
/// Number of these searches, each four times as far as the one before.
const TRIES: i32 = 8;
/// Rows after a jump that are this many standard deviations off their branch do not count.
const RINGING: f64 = 3.0;
/// Largest number of rows after a jump that do not count.
pub(in crate::fit) const MAX_RINGING: usize = 6;
/// Highest overshoot, in heights of the jump.
const HIGHEST: f64 = 1.2;
/// Factor by which the ringing decays from row to row.
const DECAY: f64 = 0.6;
/// Step of a distance for the slope of a deflection, m.
const SLOPE_STEP: f64 = 1e-10;
/// Change of a key for its central difference, relative.
const STEP: f64 = 1e-5;

/// The lever of a curve, with the least and the largest distance of its rows.
pub(in crate::fit) struct Rested {
    lever: RestLever,
    rows: [f64; 2],
}

impl Rested {
    /// Distances that go `beyond` those of the rows on either side.
    fn between(&self, beyond: f64) -> [f64; 2] {
        let [near, far] = self.rows;
        let margin = beyond + MARGIN * (far - near);
        [near - margin, far + margin]
    }

    /// Returns the first result of `find` over ranges that extend ever farther beyond the rows.
    fn farther<T>(&self, find: impl Fn([f64; 2]) -> Option<T>) -> Option<T> {
        let beyond = (0..TRIES).map(|k| REACH * 4f64.powi(k));
        let mut found = beyond.filter_map(|beyond| find(self.between(beyond)));
        found.next()
    }

    /// The distance at which a quantity has a value, nearest to the sample.
    pub(in crate::fit) fn distance_of(&self, quantity: RestQuantity, value: f64) -> Option<f64> {
        let of = |rest: &StableRest| reading(rest, Some(quantity));
        self.farther(|between| {
            let chains = self.lever.chains(between);
            let mut chains = chains.iter().rev();
            chains.find_map(|chain| self.lever.distance_of(chain, of, value))
        })
    }

    /// A quantity where the force is lowest, of a lever that goes to the sample and back. With a
    /// strong adhesion this is far beyond the rows.
    pub(in crate::fit) fn pull_off(&self, quantity: RestQuantity) -> Option<f64> {
        let rest = self.farther(|between| self.lever.pull_off(between))?;
        Some(reading(&rest, Some(quantity)))
    }

    /// A quantity at a distance that is this part of the range of the rows before the nearest one, of the
    /// lever that is pushed on from there.
    pub(in crate::fit) fn beyond(&self, quantity: RestQuantity, part: f64) -> Option<f64> {
        let [near, far] = self.rows;
        let at = near - part * (far - near);
        let chains = self.lever.chains(self.between(part * (far - near)));
        let rest = chains
            .iter()
            .rev()
            .find_map(|chain| self.lever.at(chain, at))?;
        Some(reading(&rest, Some(quantity)))
    }

    fn with_chains(self) -> (RestLever, Vec<Chain>) {
        let chains = self.lever.chains(self.between(0.0));
        (self.lever, chains)
    }
}

impl Problem<'_> {
    /// The distances of the rows of a curve.
    fn distances(&self, x: &[f64], curve: usize) -> Vec<f64> {
        let rows = self.data.curves[curve].rows.iter();
        rows.map(|row| self.place(x, curve, row)[0]).collect()
    }

    /// The case of a curve at the surface: rests are found at any distance from there, even at one
    /// that no case can have, as the absolute height of an instrument.
    fn case_of_rests(&self, base: &Case) -> Case {
        base.with(self.data.swept[0].key, 0.0)
    }

    /// The lever of a curve.
    pub(in crate::fit) fn rested(&self, x: &[f64], curve: usize) -> Option<Rested> {
        self.finished(())?;
        let case = self.case_of_rests(&self.cases(x)[curve]);
        Some(Rested {
            lever: RestLever::of(&case).ok()?,
            rows: span(self.distances(x, curve).into_iter()),
        })
    }

    /// How much more a difference of forces at the same position of the tip is, in deflections, than one of
    /// deflections at the same distance: 1 + S/k with the stiffness S of the contact, for each row of a
    /// curve; 1 where the lever does not rest.
    pub(in crate::fit) fn stiffness_factors(&self, x: &[f64], curve: usize) -> Vec<f64> {
        let rested = self.rested(x, curve).map(Rested::with_chains);
        let factor = |at: f64| {
            let (lever, chains) = rested.as_ref()?;
            let rest = |at: f64| chains.iter().find_map(|chain| lever.at(chain, at));
            let [low, high] = [at - SLOPE_STEP, at + SLOPE_STEP].map(rest);
            let slope = (high?.deflection - low?.deflection) / (2.0 * SLOPE_STEP);
            Some(1.0 / (1.0 + slope)).filter(|factor| factor.is_finite() && *factor > 0.0)
        };
        let distances = self.distances(x, curve).into_iter();
        distances.map(|at| factor(at).unwrap_or(1.0)).collect()
    }

    /// A size of a key that is 0.
    fn size_of(&self, key: Key) -> f64 {
        let mut parameters = self.parameters.iter();
        let Some(parameter) = parameters.find(|p| p.target == Target::Key(key)) else {
            return 1.0;
        };
        let largest = 1e-6 * parameter.bounds.1;
        if parameter.size > 0.0 {
            parameter.size
        } else if largest.is_finite() {
            largest
        } else {
            1.0
        }
    }

    fn at_rest(&self, branch: usize, rest: StableRest) -> RowPoint {
        let columns = self.data.columns.iter();
        RowPoint {
            lost: false,
            branch,
            values: columns.map(|c| reading(&rest, c.quantity.rest())).collect(),
            rest: Some(rest),
            ..RowPoint::empty(0)
        }
    }

    /// Finds the rests at all rows, and selects those of the data.
    pub(super) fn discover_rests(&self, x: &[f64]) -> (Point, Vec<Rows>) {
        let curves = self.data.curves.par_iter().enumerate();
        let points: Vec<Vec<RowPoint>> = curves
            .map(|(curve, of)| {
                let rested = self.rested(x, curve).map(Rested::with_chains);
                let seen: Vec<Vec<Option<RowPoint>>> = self
                    .distances(x, curve)
                    .into_iter()
                    .map(|at| {
                        let Some((lever, chains)) = &rested else {
                            return Vec::new();
                        };
                        let rests = chains.iter().enumerate().filter_map(|(branch, chain)| {
                            Some(Some(self.at_rest(branch, lever.at(chain, at)?)))
                        });
                        rests.collect()
                    })
                    .collect();
                let branches = |row: &Vec<Option<RowPoint>>| {
                    row.iter().flatten().map(|point| point.branch).collect()
                };
                let branches: Vec<Vec<usize>> = seen.iter().map(branches).collect();
                self.chosen(x, (curve, &of.rows), &branches, &seen).rows
            })
            .collect();
        let none = self.data.curves.iter();
        let none = none.map(|curve| vec![Vec::new(); curve.rows.len()]);
        let point = Point {
            rows: points.into_iter().flatten().collect(),
            folds: Vec::new(),
        };
        (point, none.collect())
    }

    /// Releases the last row before each jump, which is so near to the end of its branch that the lever
    /// lags and the value is not linear in the parameters; and the rows after a jump in which the lever
    /// rings, up to the last that is off its branch by more than its scatter explains.
    pub(super) fn release_ringing(
        &self,
        x: &[f64],
        (curve, measured): (usize, &[Row]),
        seen: &[Vec<Option<RowPoint>>],
        chosen: &mut [Option<usize>],
    ) {
        let points: Vec<Option<&RowPoint>> = seen
            .iter()
            .zip(&*chosen)
            .map(|(seen, of)| seen[(*of)?].as_ref())
            .collect();
        // How far a row is off its branch: in its errors, and in the heights of a jump beyond what
        // its errors explain; the most of all columns.
        let off = |row: usize, jump: &[f64]| {
            let point = points[row]?;
            let columns = self.data.columns.iter().enumerate();
            let off = columns.map(|(index, column)| {
                let value = point.values[index];
                let off = self.difference(x, curve, &measured[row], index, value);
                let error = column
                    .scatter
                    .map(|of| of.error * measured[row].relative[index]);
                let off = off.map_or(0.0, f64::abs);
                let error = error.unwrap_or(f64::INFINITY);
                [off / error, (off - RINGING * error) / jump[index]]
            });
            Some(off.fold([0.0, 0.0], |[a, b], [c, d]| {
                [f64::max(a, c), f64::max(b, d)]
            }))
        };
        let known: Vec<(usize, &RowPoint)> = (points.iter().enumerate())
            .filter_map(|(row, point)| Some((row, (*point)?)))
            .collect();
        for pair in known.windows(2) {
            let [(last, from), (first, to)] = [pair[0], pair[1]];
            if from.branch == to.branch {
                continue;
            }
            let jump = |index: usize| {
                let read = |row: usize, of: &RowPoint| {
                    self.read(x, curve, &measured[row], index, of.values[index])
                };
                (read(first, to) - read(last, from)).abs()
            };
            let jump: Vec<f64> = (0..self.data.columns.len()).map(jump).collect();
            let after = first..points.len().min(first + MAX_RINGING);
            // The lever may jump two rows late; from then on its ringing decays.
            let highest = (0..).map(|k: i32| HIGHEST * DECAY.powi((k - 2).max(0)));
            let off = after.zip(highest).map_while(|(row, highest)| {
                off(row, &jump).filter(|[_, heights]| *heights <= highest)
            });
            let off: Vec<[f64; 2]> = off.collect();
            let rings = off.iter().rposition(|[errors, _]| *errors > RINGING);
            let end = rings.map_or(first, |rings| first + rings + 1);
            chosen[last..end].fill(None);
        }
    }

    /// The rests at other parameters, each on the chain of the known one.
    pub(super) fn follow_rests(&self, x: &[f64], from: &Point) -> Point {
        let curves: Vec<usize> = (0..self.data.curves.len()).collect();
        let rested: Vec<Option<(RestLever, Vec<Chain>)>> = curves
            .par_iter()
            .map(|curve| self.rested(x, *curve).map(Rested::with_chains))
            .collect();
        let rows = self.rows();
        let one = |((curve, row), before): (&(usize, &_), &RowPoint)| {
            let follow = || {
                let (lever, chains) = rested[*curve].as_ref()?;
                // A jump that is no more has joined its branches.
                let branch = before.branch.min(chains.len().checked_sub(1)?);
                let at = self.place(x, *curve, row)[0];
                if let Some(rest) = lever.at(&chains[branch], at) {
                    return Some(self.at_rest(before.branch, rest));
                }
                // Where the chain has ended, a row costs by how far its end is from it: else a step
                // to where many have ended would be a gain.
                let end = lever.end(&chains[branch], at)?;
                Some(RowPoint {
                    lost: true,
                    ..self.at_rest(before.branch, end)
                })
            };
            let found = (before.branch != usize::MAX).then(follow).flatten();
            found.unwrap_or_else(|| before.without_orbit())
        };
        Point {
            rows: rows.par_iter().zip(from.par_iter()).map(one).collect(),
            folds: Vec::new(),
        }
    }
}

fn reading(rest: &StableRest, quantity: Option<RestQuantity>) -> f64 {
    match quantity {
        Some(RestQuantity::Deflection) => rest.deflection,
        Some(RestQuantity::Force) => rest.force,
        None => f64::NAN,
    }
}

/// The levers of every curve, and those with a key a little lower and higher.
pub(super) struct Nearby {
    curves: Vec<Option<LeverNearby>>,
}

struct LeverNearby {
    lever: RestLever,
    keys: Vec<(Key, [RestLever; 2], f64)>,
}

impl Nearby {
    pub(super) fn of(problem: &Problem<'_>, x: &[f64], effects: &[Vec<Effects>]) -> Self {
        let bases = problem.cases(x);
        let curves: Vec<usize> = (0..bases.len()).collect();
        let of = |curve: &usize| {
            let case = problem.case_of_rests(&bases[*curve]);
            let mut keys: Vec<Key> = effects[*curve].iter().flatten().map(|(k, _)| *k).collect();
            keys.sort_unstable();
            keys.dedup();
            let nearby = |key: Key| {
                let value = case.get(key);
                let range = key.range();
                let step = STEP
                    * if value == 0.0 {
                        problem.size_of(key)
                    } else {
                        value.abs()
                    };
                let step = step.max(f64::MIN_POSITIVE);
                // Of a value at the end of its range the difference is to one side.
                let low = if value - step < range.low {
                    value
                } else {
                    value - step
                };
                let high = if value + step > range.high {
                    value
                } else {
                    value + step
                };
                let lever = |value| RestLever::of(&case.with(key, value)).ok();
                Some((key, [lever(low)?, lever(high)?], high - low))
            };
            let keys = keys.into_iter().filter(|key| !is_distance(*key));
            Some(LeverNearby {
                lever: RestLever::of(&case).ok()?,
                keys: keys.map(nearby).collect::<Option<_>>()?,
            })
        };
        Self {
            curves: curves.par_iter().map(of).collect(),
        }
    }

    /// Derivatives of the measured values of a row at a distance by every parameter.
    pub(super) fn derivatives(
        &self,
        problem: &Problem<'_>,
        x: &[f64],
        (curve, point, at): (usize, &RowPoint, f64),
        effects: &[Effects],
    ) -> Option<Vec<(Vec<f64>, Vec<f64>)>> {
        let known = self.curves[curve].as_ref()?;
        let rest = point.rest.as_ref()?;
        let columns = &problem.data.columns;
        let between = |a: &StableRest, b: &StableRest, width: f64| -> Vec<f64> {
            let by = |quantity| (reading(b, quantity) - reading(a, quantity)) / width;
            columns.iter().map(|c| by(c.quantity.rest())).collect()
        };
        let by_key = |key: Key| -> Option<Vec<f64>> {
            if is_distance(key) {
                // A rest is linear in the distance to first order: the step does not matter.
                let step = STEP * at.abs().max(rest.deflection.abs()).max(1e-12);
                let ends = [at - step, at + step];
                let [a, b] = ends.map(|at| known.lever.near(rest, &known.lever, at));
                return Some(between(&a, &b, 2.0 * step));
            }
            let (_, levers, width) = known.keys.iter().find(|(of, ..)| *of == key)?;
            let [a, b] = [0, 1].map(|k| levers[k].near(rest, &known.lever, at));
            Some(between(&a, &b, *width))
        };
        let parameter = |(parameter, effects): (&Parameter, &Effects)| {
            let mut by = vec![0.0; columns.len()];
            if parameter.is_of(curve) {
                for (key, weight) in effects {
                    for (column, slope) in by_key(*key)?.into_iter().enumerate() {
                        by[column] += weight * problem.scale(x, curve, column) * slope;
                    }
                }
            }
            Some((Vec::new(), by))
        };
        problem
            .parameters
            .iter()
            .zip(effects)
            .map(parameter)
            .collect()
    }
}
