//! Branches, their points, bifurcations, events and curves as tables.

use crate::attractors::tip_range;
use crate::branch::{AttractorShare, BifurcationReport, BranchReport, BranchSummary, CurveReport};
use crate::orbit::spectral_radius;
use nanotap_case::ParameterUnit;
use nanotap_case::physical::Kind;
use nanotap_case::units::Units;
use nanotap_observe::frame::{Form, Frame, Rows, frame};
use nanotap_observe::{Dimension, Observables};
use nanotap_quantity::number::significant;

/// An orbit of a branch, or a bifurcation on it.
#[derive(Clone, Copy)]
struct Orbit<'a> {
    branch: usize,
    kind: &'static str,
    period: usize,
    parameter: f64,
    is_stable: bool,
    multipliers: &'a [[f64; 2]],
    observables: &'a Observables,
    amplitude_ratio: Option<f64>,
    state: &'a [f64],
}

/// Values of a parameter that are shown with so many digits, and their factor.
fn parameter(unit: Option<ParameterUnit>, digits: usize) -> ((Dimension, Form), f64) {
    match unit {
        Some(unit) => ((Dimension::Si(unit.kind), Form::Prefixed(digits)), unit.si),
        None => ((Dimension::Number, Form::Digits(digits)), 1.0),
    }
}

/// A range of a parameter in words.
fn range(unit: Option<ParameterUnit>, units: Units, [low, high]: [f64; 2]) -> String {
    let ((dimension, form), si) = parameter(unit, 6);
    let [low, high] = [low, high].map(|value| form.shown(dimension, units, si * value));
    format!("{low} … {high}")
}

impl BranchReport {
    /// The points, branch by branch; the bifurcations of a branch follow its points.
    pub fn point_table(&self, names: Vec<String>, units: Units) -> Frame<'_> {
        let orbits = (0..self.branches.len()).flat_map(|branch| {
            let points = self.points.iter().filter(move |p| p.branch == branch);
            let points = points.map(move |p| Orbit {
                branch,
                kind: "",
                period: p.period,
                parameter: p.parameter,
                is_stable: p.stable,
                multipliers: &p.multipliers,
                observables: &p.observables,
                amplitude_ratio: p.physical.as_ref().map(|motion| motion.amplitude_ratio),
                state: &p.state,
            });
            let bifurcations = self.bifurcations.iter().filter(move |b| b.branch == branch);
            points.chain(bifurcations.map(move |b| Orbit {
                branch,
                kind: b.kind,
                period: b.period,
                parameter: b.parameter,
                is_stable: false,
                multipliers: &b.multipliers,
                observables: &b.observables,
                amplitude_ratio: b.physical.as_ref().map(|motion| motion.amplitude_ratio),
                state: &b.state,
            }))
        });
        let value = match self.key.kind() {
            kind if self.key.is_physical() && kind != Kind::Number => Dimension::Si(kind),
            _ => Dimension::Number,
        };
        let is_si = matches!(units, Units::Si(_));
        frame! { Rows::new("points", orbits, Some(units));
            "branch", "", Plain => |o| o.branch;
            "kind", "", Plain => |o| o.kind;
            "period", "", Plain => |o| o.period;
            self.key.path(), "", (value, Digits(5)) => |o| o.parameter;
            "stable", "", Plain => |o| o.is_stable.to_string();
            "spectral_radius", "", Digits(5) => |o| spectral_radius(o.multipliers);
            .observed(self.observed, |o| Some(o.observables));
            "A_ratio", "", Digits(5) => |o| o.amplitude_ratio;
            .states(names, |o| o.state);
            .without(if is_si { &[] } else { &["A_ratio"] });
        }
    }

    /// The branches.
    pub fn branch_table(&self, units: Units) -> Frame<'_> {
        let stable = |k| {
            self.points
                .iter()
                .filter(|p| p.branch == k && p.stable)
                .count()
        };
        let reaches = move |b: &'_ BranchSummary| range(self.parameter_unit, units, b.range);
        frame! { Rows::new("branches", self.branches.iter().enumerate(), Some(units));
            "branch", "branch", Plain => |(k, _)| k + 1;
            "period", "period", Plain => |(_, b)| b.period;
            "parent", "from", Plain => |(_, b)| b.parent.map(|p| format!("branch {}", p + 1));
            .align(Right);
            "points", "points", Plain => |(_, b)| b.points;
            "stable", "stable", Plain => move |(k, _)| stable(k);
            "range", "reaches", Plain => move |(_, b)| reaches(b);
            "end", "ends at", Plain => |(_, b)| &b.end;
        }
    }

    /// The bifurcations.
    pub fn bifurcation_table(&self, units: Units) -> Frame<'_> {
        let (shown, si) = parameter(self.parameter_unit, 10);
        let remarks = |b: &'_ BifurcationReport| {
            let pair = b.angle.map(|angle| format!("pair at {angle:.2}°"));
            let words = b.criticality.map(str::to_owned).into_iter().chain(pair);
            words.collect::<Vec<_>>().join(", ")
        };
        frame! { Rows::new("bifurcations", &self.bifurcations, Some(units));
            "branch", "branch", Plain => |b| b.branch + 1;
            "kind", "", Plain => |b| b.kind;
            "parameter", self.parameter, shown => move |b| si * b.parameter;
            .align(Left);
            "period", "period", Plain => |b| b.period;
            "tip", "tip", Plain => move |b| tip_range(&b.observables, units, 5);
            "contact_fraction", "contact", Percent(4) => |b| b.observables.contact_fraction;
            "remarks", "", Plain => remarks;
        }
    }

    /// The orbits at which the requested events happen.
    pub fn event_table(&self, units: Units) -> Frame<'_> {
        let (shown, si) = parameter(self.parameter_unit, 10);
        frame! { Rows::new("events", &self.events, Some(units));
            "branch", "branch", Plain => |e| e.point.branch + 1;
            "event", "", Plain => |e| &e.event;
            "parameter", self.parameter, shown => move |e| si * e.point.parameter;
            .align(Left);
            "period", "period", Plain => |e| e.point.period;
            "stable", "", Plain => |e| if e.point.stable { "stable" } else { "unstable" };
        }
    }

    /// The curves in two parameters; `second` is the unit of the second one.
    pub fn curve_table(&self, second: Option<ParameterUnit>, units: Units) -> Frame<'_> {
        let ends = |values: &[f64]| {
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            [low, high]
        };
        let name = self.loci.as_ref().map_or("", |loci| loci.second);
        let curves = self.loci.iter().flat_map(|loci| &loci.curves);
        let first = move |c: &'_ CurveReport| range(self.parameter_unit, units, ends(&c.first));
        frame! { Rows::new("curves", curves, Some(units));
            "kind", "", Plain => |c| c.event.as_deref().unwrap_or(c.kind);
            "period", "period", Plain => |c| c.period;
            "points", "points", Plain => |c| c.first.len();
            "first", self.parameter, Plain => first;
            "second", name, Plain => move |c| range(second, units, ends(&c.second));
            "ends", "ends at", Plain => |c| c.ends.join("; ");
        }
    }

    /// The attractors of the census: where each exists, with its least and greatest share. Motions
    /// that are not joined from value to value count together.
    pub fn attractor_table(&self, units: Units) -> Frame<'_> {
        let ((dimension, form), si) = parameter(self.parameter_unit, 6);
        let at = move |value| form.shown(dimension, units, si * value);
        let joined = |low: String, high: String, are_two| {
            if are_two {
                format!("{low} … {high}")
            } else {
                low
            }
        };
        let is_orbit = |one: &AttractorShare| one.period > 0;
        let mut groups: Vec<(Option<usize>, Vec<&AttractorShare>)> = Vec::new();
        for one in &self.attractors {
            let number = is_orbit(one).then_some(one.attractor);
            let same = |(of, all): &&mut (Option<usize>, Vec<&AttractorShare>)| {
                *of == number && (number.is_some() || all[0].classification == one.classification)
            };
            match groups.iter_mut().find(same) {
                Some((_, all)) => all.push(one),
                None => groups.push((number, vec![one])),
            }
        }
        let rows = groups.iter().map(|(number, all)| {
            let (first, last) = (all[0], all[all.len() - 1]);
            let low = all.iter().map(|one| one.share).fold(1.0, f64::min);
            let high = all.iter().map(|one| one.share).fold(0.0, f64::max);
            (*number, first, last.parameter, [low, high], all.len() > 1)
        });
        let percent = |share: f64| significant(100.0 * share, 3);
        let motion = move |one: &AttractorShare| {
            if is_orbit(one) {
                format!("period {}", one.period)
            } else {
                one.classification.to_owned()
            }
        };
        frame! { Rows::new("attractors", rows, Some(units));
            "attractor", "", Plain => |(number, ..)| number.map(|number| number + 1);
            "motion", "motion", Plain => move |(_, first, ..)| motion(first);
            "parameter", self.parameter, Plain =>
                move |(_, first, last, _, are_two)| joined(at(first.parameter), at(last), are_two);
            "share", "share (%)", Plain =>
                move |(.., [low, high], _)| joined(percent(low), percent(high), low < high);
        }
    }
}
