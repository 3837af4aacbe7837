//! Other minima that describe the data of an accepted fit about as well.
//!
//! The attraction and the stiffness of the contact are multiplied and divided by a factor, the
//! distance is aligned anew, and the fit is repeated from there: rough, and in full if the rough fit
//! is about as good as the accepted one and ends elsewhere. A minimum whose criterion of Akaike is
//! within [`REACH`] of the best one is a rival. What decides between two of them is the observable of
//! their orbits, not measured so far, that differs most for the noise of the data; of force curves the
//! retract if it was not measured, or rows deeper in the sample.
//!
//! Fails by omission: minima that none of these starts leads to.

use nalgebra::DVector;
use nanotap_case::Key;
use nanotap_case::physical::Kind;
use nanotap_motions::approach::Way;
use nanotap_observe::{OBSERVABLES, Observable, ObservableSet, measure};

use super::effort::Part;
use super::parameters::Target;
use super::problem::{Rested, RowPoint};
use super::quantity::RestQuantity;
use super::report::{Rival, RivalParameter};
use super::search::{Search, SearchedFit};

/// Difference of Akaike's criterion up to which a minimum is within the reach of the data (Burnham &
/// Anderson, Model Selection and Multimodel Inference, 2nd ed. 2002, Sect. 2.6).
const REACH: f64 = 10.0;
/// Factor of attraction and stiffness.
const FACTOR: f64 = 8.0;
/// Mean rough cost of a value, relative to that of the best fit and beyond it, up to which a start
/// is followed to its minimum.
const ROUGH_REACH: (f64, f64) = (1.5, 0.01);
/// Largest number of rows of a curve in the rough fits.
const ROUGH_ROWS: usize = 20;
/// Number of rounds of the rough fits.
const ROUNDS: usize = 3;
/// Two minima are the same if the residuals change by less than this between them, to first order,
/// in standard errors.
const SAME: f64 = 1.0;
/// Part of the rows that may have no orbit in a rival.
const MAX_LOST: f64 = 0.1;
/// Difference of an observable over all rows, in standard errors, that decides.
const DECISIVE: f64 = 6.0;
/// How much deeper rows are looked at that might decide, as a part of the range of distances.
const DEEPER: f64 = 0.25;
const NOTHING_DECIDES: &str =
    "No other column of these rows decides: rows nearer to the sample may";
/// Observables that might decide, as a lock-in amplifier or a recorder measures them.
const DECIDERS: [&str; 4] = [
    "phase",
    "first_harmonic",
    "mean_deflection",
    "second_harmonic",
];

const ATTRACTIONS: [Key; 3] = [
    Key::SampleHamaker,
    Key::SampleWorkOfAdhesion,
    Key::SampleAdhesionForce,
];
const STIFFNESSES: [Key; 3] = [Key::SampleModulus, Key::SampleStiffness, Key::Alpha4];

impl Search<'_> {
    /// Searches for the other minima of an accepted fit; returns the best one, and the others that
    /// are within reach. `others` were found before.
    pub(super) fn rivals(
        &self,
        best: SearchedFit,
        others: Vec<SearchedFit>,
    ) -> (SearchedFit, Vec<SearchedFit>) {
        let mut all = vec![best];
        all.extend(others);
        let rough = |x: Vec<f64>| self.rough_within(x, ROUGH_ROWS, ROUNDS);
        let (_, cost) = rough(all[0].solution.x.clone());
        let most = ROUGH_REACH.0 * cost + ROUGH_REACH.1;
        for start in self.starts_of_rivals(&all[0]) {
            if self.control.is_cancelled() || self.problem.effort.ends(Part::Rivals) {
                break;
            }
            let start = self.with_best_offset(&start).unwrap_or(start);
            let (x, cost) = rough(start);
            if cost > most || all.iter().any(|known| is_same(known, &x)) {
                continue;
            }
            all.extend(self.fine(x));
        }
        let least = (1..all.len()).fold(0, |least, k| {
            if self.is_better(&all[k], &all[least]) {
                k
            } else {
                least
            }
        });
        let best = all.swap_remove(least);
        let mut rivals: Vec<SearchedFit> = Vec::new();
        for other in all {
            let known = rivals.iter().chain([&best]);
            let is_new = known.into_iter().all(|known| {
                !(is_same(known, &other.solution.x) || is_same(&other, &known.solution.x))
            });
            let lost = other.solution.point.iter().filter(|row| row.lost).count() as f64;
            let few = lost <= MAX_LOST * other.solution.point.len() as f64;
            if is_new && few && self.above(&other, &best) < REACH {
                rivals.push(other);
            }
        }
        (best, rivals)
    }

    /// Initial values for the search: attraction and stiffness changed by a factor.
    fn starts_of_rivals(&self, best: &SearchedFit) -> Vec<Vec<f64>> {
        let mut starts = Vec::new();
        let has = |keys: &[Key]| {
            let mut all = self.problem.parameters.iter();
            all.any(|p| keys.iter().any(|key| p.target == Target::Key(*key)))
        };
        // An attraction decides which branch the data may be on; each start costs a fit.
        let keys = if has(&ATTRACTIONS) {
            &ATTRACTIONS
        } else {
            &STIFFNESSES
        };
        for factor in [FACTOR, FACTOR.recip()] {
            let mut start = best.solution.x.clone();
            for (k, parameter) in self.problem.parameters.iter().enumerate() {
                let Target::Key(key) = parameter.target else {
                    continue;
                };
                if keys.contains(&key) {
                    let (low, high) = parameter.bounds;
                    let of = if start[k] == 0.0 {
                        parameter.start
                    } else {
                        start[k]
                    };
                    start[k] = (factor * of).clamp(low, high);
                }
            }
            if start != best.solution.x {
                starts.push(start);
            }
        }
        starts
    }

    /// By how much Akaike's criterion of one fit is above that of another, over the rows where both
    /// have orbits.
    fn above(&self, this: &SearchedFit, other: &SearchedFit) -> f64 {
        let [a, b] = [this, other].map(|of| self.likelihood(of));
        let rows = &a.with_orbit() & &b.with_orbit();
        let [a, b] = [a, b].map(|of| of.criteria(&rows)[0]);
        a - b
    }

    /// Reports rivals, and what decides between each and the best fit, whose intervals are given. A
    /// rival within all of them is not another one.
    pub(super) fn report_rivals(
        &self,
        found: &SearchedFit,
        intervals: &[[Option<f64>; 2]],
        rivals: &[SearchedFit],
    ) -> Vec<Rival> {
        let is_beyond = |rival: &&SearchedFit| {
            let mut all = rival.solution.x.iter().zip(intervals);
            all.any(|(value, [low, high])| {
                low.is_some_and(|low| *value < low) || high.is_some_and(|high| *value > high)
            })
        };
        let rivals = rivals.iter().filter(is_beyond);
        let mut reported: Vec<Rival> = rivals
            .map(|rival| self.report_rival(found, rival))
            .collect();
        reported.sort_by(|a, b| a.above_best.total_cmp(&b.above_best));
        reported
    }

    fn report_rival(&self, found: &SearchedFit, rival: &SearchedFit) -> Rival {
        let data = self.problem.data;
        let information = self.information(rival);
        let parameters = self.problem.parameters.iter().enumerate();
        let parameters = parameters.map(|(k, parameter)| RivalParameter {
            key: parameter.name.clone(),
            curve: parameter.curve.map(|curve| data.curves[curve].name.clone()),
            value: rival.solution.x[k],
            standard_error: information.errors[k],
            unit: parameter.unit(data, self.problem.case),
        });
        let (decides, words) = if data.is_force_curve() {
            self.decider_of_rests(found, rival)
        } else {
            self.decider(found, rival)
        };
        Rival {
            parameters: parameters.collect(),
            above_best: self.above(rival, found),
            chi2: self.chi2(rival),
            decides,
            words,
        }
    }

    /// What decides between two fits of force curves, and a sentence about it: the retract where it was not
    /// measured, or rows deeper in the sample.
    fn decider_of_rests(
        &self,
        found: &SearchedFit,
        rival: &SearchedFit,
    ) -> (Option<String>, String) {
        let data = self.problem.data;
        let column = &data.columns[0];
        let name = column.quantity.name();
        let kind = match column.quantity.rest() {
            Some(RestQuantity::Force) => Kind::Force,
            _ => Kind::Length,
        };
        // The largest difference of a reading over all curves, if it is decisive.
        let differs = |of: &dyn Fn(Rested, RestQuantity) -> Option<f64>| {
            let quantity = column.quantity.rest()?;
            let reading = |x: &[f64], curve: usize| of(self.problem.rested(x, curve)?, quantity);
            let pairs = (0..data.curves.len()).filter_map(|curve| {
                let best = reading(&found.solution.x, curve)?;
                Some([best, reading(&rival.solution.x, curve)?])
            });
            let size = |pair: &[f64; 2]| (pair[1] - pair[0]).abs();
            let most = pairs.max_by(|a, b| size(a).total_cmp(&size(b)))?;
            (size(&most) > DECISIVE * found.noise[0]).then_some(most)
        };
        let written = |values: [f64; 2]| values.map(|value| kind.format_digits(value, 3));
        let has_retract = data.rows().any(|row| row.way == Some(Way::Retract));
        let pull_off = differs(&|rested, quantity| rested.pull_off(quantity));
        if let Some(pair) = pull_off.filter(|_| !has_retract) {
            let [best, other] = written(pair);
            return (
                Some("retract".to_owned()),
                format!("The retract decides: at pull-off the {name} is {best} or {other}"),
            );
        }
        if let Some(pair) = differs(&|rested, quantity| rested.beyond(quantity, DEEPER)) {
            let [best, other] = written(pair);
            let percent = 100.0 * DEEPER;
            return (
                Some(name.to_owned()),
                format!(
                    "Rows deeper in the sample decide: {percent:.0} % of the range of distances beyond the \
                     last row the {name} is {best} or {other}"
                ),
            );
        }
        (None, NOTHING_DECIDES.to_owned())
    }

    /// The observable that decides between two fits, and a sentence about it.
    fn decider(&self, found: &SearchedFit, rival: &SearchedFit) -> (Option<String>, String) {
        let data = self.problem.data;
        let names: Vec<&str> = data.columns.iter().map(|c| c.quantity.name()).collect();
        let amplitude = names.iter().position(|name| *name == "first_harmonic");
        let unit = self
            .problem
            .case
            .physical()
            .map_or(1.0, |view| view.scales.length);
        // Noise of a length, and of an angle at the amplitude of a row.
        let noise = amplitude.map_or(0.0, |column| {
            let rows = data.rows().map(|row| {
                row.errors[column].unwrap_or(row.relative[column] * found.noise[column])
            });
            super::instrument::median(rows.collect())
        });
        let deciders = DECIDERS.iter().filter(|name| !names.contains(name));
        let deciders: Vec<&'static Observable> = deciders
            .filter_map(|name| OBSERVABLES.iter().find(|o| o.name == *name))
            .collect();
        let nothing = || {
            let words = format!("{NOTHING_DECIDES}; so may another free amplitude");
            (None, words)
        };
        if noise.is_nan() || noise <= 0.0 {
            return nothing();
        }
        let set = deciders
            .iter()
            .fold(ObservableSet::FIRST_HARMONIC, |set, o| set.with(o));
        let of = |point: &RowPoint| {
            let (at, orbit) = (
                point.at.as_ref()?,
                point.orbit.as_ref().filter(|_| !point.lost)?,
            );
            measure(&at.1, orbit.states.first()?, orbit.period, set).ok()
        };
        let swept = &data.swept[0];
        let rows = self.problem.rows();
        let pairs = found.solution.point.iter().zip(rival.solution.point.iter());
        let pairs: Vec<_> = pairs
            .zip(&rows)
            .filter_map(|((a, b), (curve, row))| {
                let at = self.problem.place(&found.solution.x, *curve, row)[0];
                Some((at, of(a)?, of(b)?))
            })
            .collect();
        // Sum of the squared differences in standard errors, the largest difference, and its row.
        let difference = |observable: &'static Observable| -> Option<(f64, f64, f64)> {
            let is_angle = super::quantity::Quantity::Observed(observable).is_angle();
            let mut most = (0.0, 0.0);
            let mut squares = 0.0;
            for (at, a, b) in &pairs {
                let number = |of| (observable.of)(of).number();
                let mut change = number(b)? - number(a)?;
                let mut error = noise / unit;
                if is_angle {
                    change -= 360.0 * (change / 360.0).round();
                    let swing = a.first_harmonic.min(b.first_harmonic);
                    error = (error / swing).to_degrees();
                }
                squares += (change / error).powi(2);
                if change.abs() > most.0 {
                    most = (change.abs(), *at);
                }
            }
            Some((squares.sqrt(), most.0, most.1))
        };
        let all = deciders.iter().filter_map(|o| Some((*o, difference(o)?)));
        let best = all.max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let Some((observable, (sum, most, at))) = best.filter(|(_, (sum, ..))| *sum > DECISIVE)
        else {
            return nothing();
        };
        let is_angle = super::quantity::Quantity::Observed(observable).is_angle();
        let size = if is_angle {
            format!("{}°", shown(most))
        } else if self.problem.case.is_physical() {
            format!("{} nm", shown(1e9 * most * unit))
        } else {
            shown(most)
        };
        let place = if self.problem.case.is_physical() && super::data::is_distance(swept.key) {
            format!("{} nm", shown(1e9 * at))
        } else {
            shown(at)
        };
        let name = match observable.name {
            "first_harmonic" => "amplitude",
            name => name,
        };
        (
            Some(name.to_owned()),
            format!(
                "A column `{name}` decides: it differs by up to {size} (at {} = {place}), over all rows by \
                 {:.0} standard errors as those of the data",
                swept.key.path(),
                sum
            ),
        )
    }
}

/// Whether values lie at a minimum, to first order in its residuals.
fn is_same(found: &SearchedFit, x: &[f64]) -> bool {
    let change = DVector::from_fn(x.len(), |k, _| x[k] - found.solution.x[k]);
    (&found.solution.jacobian * change).norm() < SAME
}

/// Three significant digits.
fn shown(value: f64) -> String {
    let rounded = format!("{value:.2e}").parse().unwrap_or(value);
    nanotap_quantity::number::shortest(rounded)
}
