//! Terms of the instrument in a curve over the distance, each a free parameter or a fixed correction.
//!
//! Where z is the distance of a row without offsets and z₀ that of the farthest row of the data:
//!
//! - `X.tilt` and `X.curvature` of a column X add s (z − z₀) and c (z − z₀)²/2 to its readings: a
//!   baseline that is not flat.
//! - `X.interference` adds A sin(2π (z − z₀)/Λ) + B cos(2π (z − z₀)/Λ): light that the sample
//!   reflects interferes with that of the lever. Its path changes by 2z, so that Λ is half a
//!   wavelength. It stands for `X.interference_sine`, `X.interference_cosine` and
//!   `X.interference_period`.
//! - `X.drag` of a force curve is the deflection, or force, by the drag of the medium on approach,
//!   where it pushes the lever off the sample. It is proportional to the speed: at the same speed it
//!   has the opposite sign on retract. The tip is that much farther from the sample, too.
//! - `gap.drift` is the change of the distance from the first to the last row of a curve, at a rate
//!   proportional to the travel of the piezo.
//! - `gap.backlash` is added to the distances of the retract.
//!
//! Each has a normal prior that is wide compared with what the data can show. Where the data do not
//! determine a term, the prior keeps it finite.

use nanotap_case::{Case, Key};
use nanotap_error::Error;
use nanotap_motions::approach::Way;

use super::baseline::baseline_rows;
use super::data::{Curve, Data, Row, is_distance};
use super::parameters::{Parameter, Target};
use super::problem::Problem;
use super::quantity::RestQuantity;
use super::statistics::span;

/// A term of the instrument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Term {
    Tilt,
    Curvature,
    Sine,
    Cosine,
    Period,
    Drag,
    Drift,
    Backlash,
}

/// Names of the terms behind the name of a column or of the distance.
const NAMES: [(&str, Term); 8] = [
    ("tilt", Term::Tilt),
    ("curvature", Term::Curvature),
    ("interference_sine", Term::Sine),
    ("interference_cosine", Term::Cosine),
    ("interference_period", Term::Period),
    ("drag", Term::Drag),
    ("drift", Term::Drift),
    ("backlash", Term::Backlash),
];
/// The name of sine, cosine and period together.
const INTERFERENCE: &str = ".interference";

/// Names without a column, and what follows the name of the only column, or of the distance.
const SHORT: [(&str, &str); 7] = [
    ("baseline_tilt", ".tilt"),
    ("baseline_curvature", ".curvature"),
    ("interference", INTERFERENCE),
    ("drag", ".drag"),
    ("sensitivity", ".scale"),
    ("drift", "gap.drift"),
    ("backlash", "gap.backlash"),
];

/// Periods of interference, m: half the wavelengths of lasers and diodes, from 500 to 1100 nm.
pub(super) const PERIODS: [f64; 2] = [250e-9, 550e-9];
/// First value of the period, m: most instruments have light of 635 to 860 nm.
const PERIOD: f64 = 375e-9;
/// Standard deviation of the prior of the period, m.
const PERIOD_PRIOR: f64 = 75e-9;
/// Standard deviation of the prior of drift and backlash, as a part of the range of distances.
const DISTANCE_PRIOR: f64 = 0.2;
/// Scale of initial values, in standard deviations of the prior.
const SIZE: f64 = 0.1;
/// Periods tried per period that fits into the range of distances.
const PERIODS_PER_RANGE: f64 = 16.0;

/// Where a row is on the ramp of its curve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Ramp {
    /// Distance from the farthest row of the data, without offsets; not above 0.
    depth: f64,
    /// Travel since the first row of the curve, as a part of the whole.
    elapsed: f64,
    /// 1 on approach, −1 on retract, 0 where neither is known.
    side: f64,
}

impl Ramp {
    /// The mean of some rows in one direction.
    pub(crate) fn mean(rows: &[Row]) -> Self {
        let mean = |of: fn(&Self) -> f64| {
            rows.iter().map(|row| of(&row.ramp)).sum::<f64>() / rows.len() as f64
        };
        Self {
            depth: mean(|ramp| ramp.depth),
            elapsed: mean(|ramp| ramp.elapsed),
            side: mean(|ramp| ramp.side),
        }
    }
}

impl Term {
    pub(super) fn named(name: &str) -> Option<Self> {
        let named = NAMES.iter().find(|(of, _)| *of == name);
        named.map(|(_, term)| *term)
    }

    /// Whether it changes the distance alone, not the readings of a column.
    pub(super) const fn is_of_distance(self) -> bool {
        matches!(self, Self::Drift | Self::Backlash)
    }

    /// Unit in SI, where readings have the unit `reading`.
    pub(super) fn unit(self, reading: &str, physical: bool) -> String {
        match (self, reading) {
            (Self::Drift | Self::Backlash | Self::Period, _) if physical => "m".to_owned(),
            (Self::Drift | Self::Backlash | Self::Period, _) | (Self::Tilt, "m") => "1".to_owned(),
            (Self::Curvature, "m") => "1/m".to_owned(),
            (Self::Tilt, of) if physical => format!("{of}/m"),
            (Self::Curvature, of) if physical => format!("{of}/m^2"),
            (_, of) => of.to_owned(),
        }
    }

    /// Mean and standard deviation of the prior, where the readings spread by `spread` and the
    /// distances range over `range`.
    fn prior(self, spread: f64, range: f64) -> [f64; 2] {
        match self {
            Self::Tilt => [0.0, spread / range],
            Self::Curvature => [0.0, 2.0 * spread / (range * range)],
            Self::Sine | Self::Cosine | Self::Drag => [0.0, spread],
            Self::Period => [PERIOD, PERIOD_PRIOR],
            Self::Drift | Self::Backlash => [0.0, DISTANCE_PRIOR * range],
        }
    }

    /// What the term adds to a reading, where those of the same column are `all`.
    fn reading(self, value: f64, period: f64, ramp: Ramp) -> f64 {
        let angle = std::f64::consts::TAU * ramp.depth / period;
        value
            * match self {
                Self::Tilt => ramp.depth,
                Self::Curvature => 0.5 * ramp.depth * ramp.depth,
                Self::Sine => nanotap_arithmetic::sin(angle),
                Self::Cosine => nanotap_arithmetic::cos(angle),
                Self::Drag => ramp.side,
                Self::Period | Self::Drift | Self::Backlash => 0.0,
            }
    }

    /// Change of the distance of a row with the value of the term; `compliance` is the deflection
    /// per reading.
    fn shift(self, ramp: Ramp, compliance: f64) -> f64 {
        match self {
            Self::Drift => ramp.elapsed,
            Self::Backlash if ramp.side < 0.0 => 1.0,
            Self::Drag => ramp.side * compliance,
            _ => 0.0,
        }
    }
}

/// Whether a name is that of a term, as in `deflection.tilt`, or of a sensitivity, as in `deflection.scale`.
pub(super) fn is_term(name: &str) -> bool {
    let (_, term) = name.rsplit_once('.').unwrap_or_default();
    term == "scale" || Term::named(term).is_some()
}

/// The names with the short ones and `X.interference` written out.
///
/// # Errors
/// If a short name fits several columns.
pub(super) fn expanded(names: Vec<String>, data: &Data) -> Result<Vec<String>, Error> {
    let mut all = Vec::new();
    for name in names {
        let name = match SHORT.iter().find(|(short, _)| *short == name) {
            Some((_, end)) if !end.starts_with('.') => (*end).to_owned(),
            Some((_, end)) => match &data.columns[..] {
                [only] => format!("{}{end}", only.name),
                columns => {
                    let full: Vec<String> =
                        columns.iter().map(|c| format!("{}{end}", c.name)).collect();
                    return Err(Error::option(
                        "free",
                        format!("{name} could be that of several columns"),
                        format!("name one: {}", full.join(" or ")),
                    ));
                }
            },
            None => name,
        };
        if name.ends_with(INTERFERENCE) {
            all.extend(["sine", "cosine", "period"].map(|part| format!("{name}_{part}")));
        } else {
            all.push(name);
        }
    }
    Ok(all)
}

/// The parameter of a term of a column, or of the distance.
///
/// # Errors
/// If the data cannot have this term.
pub(super) fn parameter(
    case: &Case,
    data: &Data,
    name: &str,
    (term, column): (Term, usize),
) -> Result<Parameter, Error> {
    let refuse = |what: &str, remedy: &str| Err(Error::input(format!("{name}: {what}"), remedy));
    if !data.swept.first().is_some_and(|s| is_distance(s.key)) {
        return refuse("the rows do not vary the distance", "leave it out");
    }
    let sides = |side: f64| data.rows().any(|row| row.ramp.side == side);
    if matches!(term, Term::Drag | Term::Backlash) && !(sides(1.0) && sides(-1.0)) {
        return refuse(
            "it shows only where approach and retract are compared",
            "give rows of both directions",
        );
    }
    let quantity = data.columns.get(column).map(|c| c.quantity);
    let is_rest = quantity.is_some_and(|quantity| quantity.rest().is_some());
    if term == Term::Drag && !is_rest {
        return refuse(
            "the drag on an oscillating lever is its damping",
            "free cantilever.Q instead",
        );
    }
    if term == Term::Drag && !compliance(case, data, column).is_finite() {
        return refuse("the case has no cantilever.k", "fit the deflection");
    }
    if matches!(term, Term::Sine | Term::Cosine | Term::Period) && !case.is_physical() {
        return refuse(
            "a dimensionless case has no wavelength",
            "give a case in physical quantities",
        );
    }
    let [low, high] = span(data.rows().map(|row| row.at[0]));
    let range = (high - low).max(f64::MIN_POSITIVE);
    let spread = data.columns.get(column).map_or(0.0, |c| c.spread);
    let [mean, deviation] = term.prior(spread.max(f64::MIN_POSITIVE), range);
    let bounds = if term == Term::Period {
        (PERIODS[0], PERIODS[1])
    } else {
        (f64::NEG_INFINITY, f64::INFINITY)
    };
    Ok(Parameter {
        name: name.to_owned(),
        target: Target::Term(term, column),
        curve: None,
        start: mean,
        bounds,
        size: SIZE * deviation,
        is_given: false,
        is_limited: false,
        prior: Some([mean, deviation]),
    })
}

/// Deflection per reading of a column of a force curve, in SI.
fn compliance(case: &Case, data: &Data, column: usize) -> f64 {
    match data.columns[column].quantity.rest() {
        Some(RestQuantity::Deflection) => 1.0,
        _ => 1.0 / case.get(Key::LeverK),
    }
}

impl Data {
    /// Determines where each row is on the ramp of its curve.
    pub(super) fn measure_ramp(&mut self) {
        let [_, far] = span(self.rows().map(|row| row.at[0]));
        for curve in &mut self.curves {
            let at: Vec<f64> = curve.rows.iter().map(|row| row.at[0]).collect();
            let steps = at.windows(2).map(|pair| (pair[1] - pair[0]).abs());
            let travel: Vec<f64> = std::iter::once(0.0)
                .chain(steps.scan(0.0, |sum, step| {
                    *sum += step;
                    Some(*sum)
                }))
                .collect();
            let whole = travel.last().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
            for (k, row) in curve.rows.iter_mut().enumerate() {
                let side = match row.way {
                    Some(Way::Approach) => 1.0,
                    Some(Way::Retract) => -1.0,
                    _ => {
                        let near = k.max(1).min(at.len().saturating_sub(1));
                        let change = at[near.saturating_sub(1)] - at[near];
                        if change == 0.0 { 0.0 } else { change.signum() }
                    }
                };
                row.ramp = Ramp {
                    depth: row.at[0] - far,
                    elapsed: travel[k] / whole,
                    side,
                };
            }
        }
    }

    /// Takes fixed terms off the readings and adds them to the distances.
    pub(super) fn correct_terms(&mut self, case: &Case, fixed: &[(Term, usize, f64)]) {
        let compliances: Vec<f64> = fixed
            .iter()
            .map(|(term, column, _)| match term {
                Term::Drag => compliance(case, self, *column),
                _ => 0.0,
            })
            .collect();
        for row in self.curves.iter_mut().flat_map(|curve| &mut curve.rows) {
            for ((term, column, value), compliance) in fixed.iter().zip(&compliances) {
                row.at[0] += value * term.shift(row.ramp, *compliance);
                let period = fixed
                    .iter()
                    .find(|(term, of, _)| *term == Term::Period && of == column);
                let period = period.map_or(PERIOD, |(.., value)| *value);
                if let Some(of) = row
                    .values
                    .get_mut(*column)
                    .filter(|_| !term.is_of_distance())
                {
                    *of = of.map(|of| of - term.reading(*value, period, row.ramp));
                }
            }
        }
    }
}

/// First values of the periods of interference, from the rows far from the sample: a harmonic
/// regression over periods.
pub(super) fn begin_interference(data: &Data, parameters: &mut [Parameter]) {
    for k in 0..parameters.len() {
        let Target::Term(Term::Period, column) = parameters[k].target else {
            continue;
        };
        if parameters[k].is_given {
            continue;
        }
        let curve = &data.curves[parameters[k].curve.unwrap_or(0)];
        let (low, high) = parameters[k].bounds;
        if let Some((period, _)) = best_period(&far_readings(curve, column), [low, high]) {
            parameters[k].start = period;
        }
    }
}

/// Distances and readings of a column far from the sample: the baseline, if it is longer than a
/// period, else the farther half of the rows.
fn far_readings(curve: &Curve, column: usize) -> Vec<[f64; 2]> {
    let known = curve.rows.iter();
    let known = known.filter_map(|row| Some((row.ramp.depth, row.values[column]?)));
    let (depth, values): (Vec<f64>, Vec<f64>) = known.unzip();
    let [baseline, _] = baseline_rows(&depth, &values);
    let [low, high] = span(baseline.iter().map(|row| depth[*row]));
    let of_rows = |rows: Vec<usize>| -> Vec<[f64; 2]> {
        rows.into_iter()
            .map(|row| [depth[row], values[row]])
            .collect()
    };
    if high - low > PERIODS[1] {
        return of_rows(baseline);
    }
    let [low, high] = span(depth.iter().copied());
    let middle = 0.5 * (low + high);
    of_rows(
        (0..depth.len())
            .filter(|row| depth[*row] > middle)
            .collect(),
    )
}

/// The period between two limits whose sinusoid, with a parabola, leaves the least residuals of
/// values over distances, and the part of the squares that it leaves.
fn best_period(rows: &[[f64; 2]], limits: [f64; 2]) -> Option<(f64, f64)> {
    let squares = |period: Option<f64>| -> Option<f64> {
        let [low, high] = span(rows.iter().map(|row| row[0]));
        let width = (high - low).max(f64::MIN_POSITIVE);
        let columns = if period.is_some() { 5 } else { 3 };
        let design = nalgebra::DMatrix::from_fn(rows.len(), columns, |i, j| {
            let depth = rows[i][0];
            let angle = period.map_or(0.0, |period| std::f64::consts::TAU * depth / period);
            match j {
                3 => nanotap_arithmetic::sin(angle),
                4 => nanotap_arithmetic::cos(angle),
                power => ((depth - low) / width).powi(power as i32),
            }
        });
        let values = nalgebra::DVector::from_fn(rows.len(), |i, _| rows[i][1]);
        let qr = design.qr();
        let explained = qr.q().tr_mul(&values);
        Some(values.norm_squared() - explained.norm_squared())
    };
    if rows.len() < 10 {
        return None;
    }
    let without = squares(None)?;
    let found = periods(span(rows.iter().map(|row| row[0])), limits);
    let found = found
        .into_iter()
        .filter_map(|p| Some((p, squares(Some(p))? / without)));
    found.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Periods to try over a range of distances, none if no period fits into it.
pub(super) fn periods([near, far]: [f64; 2], [low, high]: [f64; 2]) -> Vec<f64> {
    let range = far - near;
    if range.is_nan() || range < low {
        return Vec::new();
    }
    // Equal steps of the number of periods in the range.
    let high = high.min(range);
    let [most, fewest] = [low, high].map(|period| range / period);
    let count = (((most - fewest) * PERIODS_PER_RANGE).ceil() as usize).clamp(1, 2000);
    let at = |k: usize| fewest + (most - fewest) * k as f64 / count as f64;
    (0..=count).map(|k| range / at(k)).collect()
}

impl Row {
    /// Distance from the farthest row, without offsets; not above 0.
    pub(super) const fn depth(&self) -> f64 {
        self.ramp.depth
    }
}

impl Problem<'_> {
    /// The period of the interference in a column of a curve.
    fn period(&self, x: &[f64], curve: usize, column: usize) -> f64 {
        let target = Target::Term(Term::Period, column);
        let mut all = self.parameters.iter().zip(x);
        let own = all.find(|(p, _)| p.target == target && p.is_of(curve));
        own.map_or(PERIOD, |(_, value)| *value)
    }

    /// The terms of the instrument in a reading.
    pub(super) fn terms(&self, x: &[f64], curve: usize, row: &Row, column: usize) -> f64 {
        let of = |(parameter, value): (&Parameter, &f64)| match parameter.target {
            Target::Term(term, of)
                if of == column && !term.is_of_distance() && parameter.is_of(curve) =>
            {
                term.reading(*value, self.period(x, curve, column), row.ramp)
            }
            _ => 0.0,
        };
        self.parameters.iter().zip(x).map(of).sum()
    }

    /// Change of the distance of a row by a term of the instrument, per unit of its value.
    pub(super) fn shift_by(&self, parameter: &Parameter, curve: usize, row: &Row) -> f64 {
        match parameter.target {
            Target::Term(term, column) if parameter.is_of(curve) => {
                let compliance = match term {
                    Term::Drag => compliance(self.case, self.data, column),
                    _ => 0.0,
                };
                term.shift(row.ramp, compliance)
            }
            _ => 0.0,
        }
    }

    /// Derivative of a reading by an offset, a scale or a term of the instrument, at the model's
    /// `value`; zero for other parameters.
    pub(super) fn direct(
        &self,
        x: &[f64],
        (curve, row): (usize, &Row),
        k: usize,
        (column, value): (usize, f64),
    ) -> f64 {
        let parameter = &self.parameters[k];
        if !parameter.is_of(curve) {
            return 0.0;
        }
        match parameter.target {
            Target::Offset(of) if of == column => 1.0,
            Target::Scale(of) if of == column => value,
            Target::Term(Term::Period, of) if of == column => {
                let period = self.period(x, curve, column);
                let angle = std::f64::consts::TAU * row.ramp.depth / period;
                let (sine, cosine) = nanotap_arithmetic::sin_cos(angle);
                let size = |term: Term| -> f64 {
                    let target = Target::Term(term, column);
                    let own = self.parameters.iter().zip(x);
                    own.filter(|(p, _)| p.target == target && p.is_of(curve))
                        .map(|(_, value)| value)
                        .sum()
                };
                (size(Term::Cosine) * sine - size(Term::Sine) * cosine) * angle / period
            }
            Target::Term(term, of) if of == column && !term.is_of_distance() => {
                term.reading(1.0, self.period(x, curve, column), row.ramp)
            }
            _ => 0.0,
        }
    }

    /// Residuals of the priors, in standard deviations.
    pub(super) fn prior_residuals(&self, x: &[f64]) -> Vec<f64> {
        let all = self.parameters.iter().zip(x);
        let of = all.filter_map(|(parameter, value)| {
            let [mean, deviation] = parameter.prior?;
            Some((value - mean) / deviation)
        });
        of.collect()
    }
}
