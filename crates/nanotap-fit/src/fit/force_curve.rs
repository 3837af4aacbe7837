//! Force curves: what is free unless it is stated, and what a fit says of each curve in the words of
//! the measurement.

use super::FitOptions;
use super::data::{Data, Row};
use super::instrument::Channels;
use super::parameters::{Parameter, Target};
use super::problem::Problem;
use super::quantity::{Quantity, RestQuantity};
use super::report::{Estimate, FitReport, FittedForceCurve};
use super::search::{Search, SearchedFit};
use super::selection::{self, Contact};
use super::solve::{LeastSquares as _, Solution};
use nanotap_case::physical::Kind;
use nanotap_case::under_law::LawName;
use nanotap_case::{Case, Key, Value};
use nanotap_error::Error;

use nanotap_motions::approach::Way;

/// Keys of the adhesion, of which the first that the case states is free.
const ADHESION: [Key; 3] = [
    Key::SampleWorkOfAdhesion,
    Key::SampleAdhesionForce,
    Key::SampleHamaker,
];
/// A stiffness of the header that differs from the case's by more than this part is another one.
const SAME_STIFFNESS: f64 = 1e-6;
/// Indentations beyond this part of the tip's radius leave the range of a parabola: the contact radius
/// is then the tip's.
const DEEP: f64 = 1.0;
/// A force below the baseline of more than this part of the largest is an adhesion that the law lacks.
const ADHERES: f64 = 0.05;
/// Stiffness of a rigid lever, relative to that of the own one.
const RIGID: f64 = 1e6;
/// Fewest rows in contact, and before it, that determine a modulus and a baseline.
const MIN_ROWS: usize = 5;

/// Frees what a force curve determines: the modulus, the contact point, the baseline and the adhesion;
/// the contact point and the baseline of each curve if there are several. Says so.
///
/// # Errors
/// If the data have fewer values.
pub(super) fn free_by_default(
    case: &Case,
    data: &Data,
    free: &mut Vec<String>,
    per_curve: &mut Vec<String>,
) -> Result<String, Error> {
    let is_stated = |key: &Key| case.stated(*key).is_some();
    let stiffness = [Key::SampleModulus, Key::SampleStiffness];
    let mut keys: Vec<Key> = stiffness.into_iter().filter(is_stated).take(1).collect();
    if keys.is_empty() {
        // A material states the modulus.
        let known = stiffness
            .into_iter()
            .filter(|key| case.get(*key).is_finite());
        keys.extend(known.take(1));
    }
    keys.extend(ADHESION.into_iter().filter(is_stated).take(1));
    free.extend(keys.iter().map(|key| key.path().to_owned()));
    let column = data
        .columns
        .first()
        .map_or("deflection", |c| c.quantity.name());
    let offsets = ["gap.offset".to_owned(), format!("{column}.offset")];
    if data.curves.len() > 1 {
        per_curve.extend(offsets);
    } else {
        free.extend(offsets);
    }
    let unknown = free.len() + data.curves.len() * per_curve.len();
    if data.count() <= unknown {
        let names: Vec<&str> = data.curves.iter().map(|of| of.name.as_str()).collect();
        return Err(Error::input(
            format!(
                "{}: {} rows are too few for a fit of {unknown} values: modulus, contact point, baseline",
                names.join(", "),
                data.count()
            ),
            "fit a curve that was recorded to its end",
        ));
    }
    let all: Vec<&str> = free.iter().chain(&*per_curve).map(String::as_str).collect();
    Ok(format!(
        "free, because the option `free` names nothing of the sample: {}",
        all.join(", ")
    ))
}

/// Fits again by forces at the same position of the tip, as most programs do, if the law is elastic and
/// does not describe the curve: then the result depends on what is compared.
///
/// Rows whose residuals are noise are compared by deflections at the same distance, of which each has the
/// same error. Standard errors are those of these deflections, with the weight 1 + S/k of a contact of
/// stiffness S, by which the two comparisons differ to first order.
pub(super) fn compared_by_force(search: &Search<'_>, report: FitReport) -> FitReport {
    let law = search.problem.case.stated(Key::SampleLaw);
    let is_elastic = law.is_some_and(|law| selection::is_elastic(&law.text()));
    if !is_elastic || !report.misfit || search.problem.data.columns.len() > 1 {
        return report;
    }
    let x: Vec<f64> = report.parameters.iter().map(|p| p.value).collect();
    let Some(x) = best_by_force(search, &x) else {
        return report;
    };
    let mut data = search.problem.data.clone();
    for (index, curve) in data.curves.iter_mut().enumerate() {
        let factors = search.problem.stiffness_factors(&x, index);
        for (row, factor) in curve.rows.iter_mut().zip(factors) {
            row.relative[0] = counting_alike(row) / factor;
            row.errors[0] = row.errors[0].map(|error| error / factor);
        }
    }
    let noise = search.rough_noise();
    let problem = Problem {
        data: &data,
        ..search.weighted(noise, None)
    };
    // Other values than these are the best of this problem.
    let request = FitOptions {
        data: Vec::new(),
        profile: false,
        ..search.request.clone()
    };
    let weighted = Search {
        problem,
        request: &request,
        ..*search
    };
    let Some(found) = weighted.at(&x) else {
        return report;
    };
    let again = weighted.report(found, &[], report.starts);
    let mut preparation = again.preparation;
    preparation.push(
        "the law does not describe the curve to its noise: forces at the same position of the tip are \
         compared, not deflections at the same distance"
            .to_owned(),
    );
    FitReport {
        preparation,
        // The remarks state the size of the residuals in terms of the noise.
        remarks: report.remarks,
        misfit: true,
        ..again
    }
}

/// The standard error of a row relative to others if each row that it is the average of counts alike.
fn counting_alike(row: &Row) -> f64 {
    1.0 / (row.count.max(1) as f64).sqrt()
}

/// The best values by forces at the same position of the tip: those of a rigid lever that moves as the
/// tip does. `None` where a parameter changes what the position or the force is.
fn best_by_force(search: &Search<'_>, x: &[f64]) -> Option<Vec<f64>> {
    let problem = &search.problem;
    let k = problem.case.get(Key::LeverK);
    let parameters = problem.parameters;
    let is_free = |target: Target| parameters.iter().any(|p| p.target == target);
    let is_shared = |target: Target| {
        let mut of = parameters.iter().filter(|p| p.target == target);
        of.next().is_none_or(|p| p.curve.is_none())
    };
    let [place, offset] = [Target::Place(0), Target::Offset(0)];
    let changes = [Target::Scale(0), Target::Key(Key::LeverK)];
    let follows = is_free(place) && is_shared(place) == is_shared(offset);
    if changes.into_iter().any(is_free) || (is_free(offset) && !follows) {
        return None;
    }
    let to_deflection = match problem.data.columns.first()?.quantity.rest()? {
        RestQuantity::Deflection => 1.0,
        RestQuantity::Force => 1.0 / k,
    };
    let to_force = k * to_deflection;
    let mut data = problem.data.clone();
    let column = &mut data.columns[0];
    column.quantity = Quantity::Rest(RestQuantity::Force);
    column.spread *= to_force;
    column.scatter = None;
    for row in data.curves.iter_mut().flat_map(|curve| &mut curve.rows) {
        let Some(value) = row.values[0] else { continue };
        row.at[0] += to_deflection * value;
        row.values[0] = Some(to_force * value);
        row.errors[0] = row.errors[0].map(|error| to_force * error);
        row.relative[0] = counting_alike(row);
    }
    // The position of the tip contains the baseline, which the distance does not.
    let baseline = |x: &[f64], curve: Option<usize>, unit: f64| {
        let mut both = parameters.iter().zip(x);
        let found = both.find(|(p, _)| p.target == offset && p.curve == curve);
        found.map_or(0.0, |(_, value)| unit * value)
    };
    let of_tip = parameters.iter().zip(x).map(|(parameter, value)| {
        let mut own = parameter.clone();
        own.is_given = true;
        own.start = *value;
        if own.target == offset {
            own.start *= to_force;
            own.size *= to_force;
            own.bounds = (to_force * own.bounds.0, to_force * own.bounds.1);
        } else if own.target == place {
            own.start -= baseline(x, own.curve, to_deflection);
        }
        own
    });
    let of_tip: Vec<Parameter> = of_tip.collect();
    let case = problem.case.with(Key::LeverK, RIGID * k);
    let rigid = Search {
        problem: Problem {
            case: &case,
            data: &data,
            parameters: &of_tip,
            ..search.weighted(Vec::new(), None)
        },
        ..*search
    };
    let found = rigid.fine(of_tip.iter().map(|p| p.start).collect())?;
    let best = parameters.iter().zip(&found.solution.x).map(|(p, value)| {
        if p.target == offset {
            value / to_force
        } else if p.target == place {
            value + baseline(&found.solution.x, p.curve, 1.0 / k)
        } else {
            *value
        }
    });
    Some(best.collect())
}

impl Search<'_> {
    /// The fit at these values.
    fn at(&self, x: &[f64]) -> Option<SearchedFit> {
        let (mut point, candidates) = self.problem.discover(x, None);
        let rows = self.problem.data.rows().count();
        let residuals = self.problem.residuals(x, &point);
        let freedom = rows.saturating_sub(x.len()).max(1) as f64;
        // Standard errors for which chi2 is the degrees of freedom.
        let factor = (residuals.norm_squared() / freedom).sqrt();
        let noise = self.problem.noise.iter().map(|of| factor * of).collect();
        let problem = Problem {
            data: self.problem.data,
            ..self.weighted(noise, None)
        };
        let residuals = problem.residuals(x, &point);
        let jacobian = problem.jacobian(x, &mut point)?;
        Some(SearchedFit {
            solution: Solution {
                x: x.to_vec(),
                point,
                cost: residuals.norm_squared(),
                residuals,
                jacobian,
                iterations: 0,
            },
            noise: problem.noise,
            jumps: Vec::new(),
            candidates,
            steps: 0,
        })
    }
}

/// What the fit of each force curve says; nothing for other data.
pub(super) fn summaries(
    search: &Search<'_>,
    report: &FitReport,
    contacts: &[Contact],
    channels: &[Channels],
) -> Vec<FittedForceCurve> {
    let curves = search.problem.data.curves.iter().enumerate();
    curves
        .zip(contacts)
        .map(|((curve, of), contact)| {
            let named = |channels: &&Channels| channels.table == of.name;
            let channels = channels.iter().find(named).or_else(|| channels.first());
            summary(search, report, (curve, contact), channels)
        })
        .collect()
}

fn summary(
    search: &Search<'_>,
    report: &FitReport,
    (curve, contact): (usize, &Contact),
    channels: Option<&Channels>,
) -> FittedForceCurve {
    let problem = &search.problem;
    let data = problem.data;
    let of = &data.curves[curve];
    let x: Vec<f64> = report.parameters.iter().map(|p| p.value).collect();
    let case = problem.cases(&x).swap_remove(curve);
    let channels = channels.cloned().unwrap_or_default();
    let estimate = |is: &dyn Fn(Target) -> bool| {
        let mut both = problem.parameters.iter().zip(&report.parameters);
        let (_, found) = both.find(|(p, _)| is(p.target) && p.is_of(curve))?;
        Some(Estimate {
            value: found.value,
            standard_error: found.standard_error,
            interval: found.interval,
        })
    };
    let of_key = |key: Key| estimate(&|target| target == Target::Key(key));
    let contact_point = estimate(&|target| target == Target::Place(0)).map(|found| {
        // The gap is distance + offset, and the distance may be counted the other way.
        if channels.is_reversed {
            found
        } else {
            found.negated()
        }
    });
    let rows: Vec<[f64; 2]> = of
        .rows
        .iter()
        .filter_map(|row| contact.of_row(row))
        .collect();
    let most = |k: usize| {
        let values = rows
            .iter()
            .map(|row| row[k])
            .filter(|value| value.is_finite());
        values.fold(f64::NEG_INFINITY, f64::max)
    };
    let [largest_force, largest_indentation] = [most(0), most(1)];
    let column = &report.columns[0];
    let to_force = match data.columns[0].quantity.rest() {
        Some(RestQuantity::Force) => 1.0,
        _ => contact.stiffness,
    };
    let known = |key: Key| Some(case.get(key)).filter(|value| value.is_finite());
    let law = case.stated(Key::SampleLaw).map(Value::text);
    let quantity = data.columns[0].quantity.rest();
    let attracts = case
        .cantilever()
        .and_then(|lever| lever.law.as_ref())
        .is_some_and(|law| law.entries().any(|entry| entry.attracts));
    let pull_off = quantity
        .filter(|_| attracts)
        .and_then(|quantity| problem.rested(&x, curve)?.pull_off(quantity))
        .map(|value| value * to_force);
    let from_header = channels
        .spring_constant
        .is_some_and(|k| (k / contact.stiffness - 1.0).abs() < SAME_STIFFNESS);
    let directions: Vec<Way> = of.rows.iter().filter_map(|row| row.way).collect();
    let has = |way: Way| directions.contains(&way);
    let segment = match (has(Way::Approach), has(Way::Retract)) {
        (true, true) => Some("approach and retract"),
        (true, false) => Some("approach"),
        (false, true) => Some("retract"),
        (false, false) => None,
    };
    let law_name = law.as_deref().and_then(|law| LawName::read(law).ok());
    let uses = |key: Key| law_name.as_ref().is_none_or(|law| law.takes(key));
    let mut found = FittedForceCurve {
        curve: of.name.clone(),
        modulus: of_key(Key::SampleModulus),
        contact_point,
        baseline: estimate(&|target| target == Target::Offset(0)),
        baseline_unit: column.unit.clone(),
        adhesion_force: pull_off,
        law,
        tip_radius: known(Key::TipRadius).filter(|_| uses(Key::TipRadius)),
        half_angle: known(Key::TipHalfAngle).filter(|_| uses(Key::TipHalfAngle)),
        poisson: known(Key::SamplePoisson),
        segment: segment.map(str::to_owned),
        rows: channels.rows,
        distance: channels.distance,
        deflection: channels.deflection,
        spring_constant: contact.stiffness,
        spring_constant_from: if from_header { "header" } else { "case" }.to_owned(),
        spring_constant_in_header: channels.spring_constant,
        sensitivity_in_header: channels.sensitivity,
        largest_force,
        largest_indentation,
        residual_force: column.residual * to_force,
        cautions: Vec::new(),
    };
    found.cautions = cautions(&found, &rows, attracts);
    found
}

/// What to be careful of in a result.
fn cautions(found: &FittedForceCurve, rows: &[[f64; 2]], attracts: bool) -> Vec<String> {
    let mut cautions = Vec::new();
    let length = |value: f64| Kind::Length.format_digits(value, 3);
    let force = |value: f64| Kind::Force.format_digits(value, 3);
    let depth = found.largest_indentation;
    let is_punch = found
        .law
        .as_deref()
        .is_some_and(|law| law.contains("punch"));
    if let Some(radius) = found.tip_radius
        && depth > DEEP * radius
        && !is_punch
    {
        cautions.push(format!(
            "the indentation reaches {}, {:.2} times the tip's radius, where a sphere or parabola of {} \
             does not describe a tip: fit a shallow part (the option `range`, as in \
             indentation=\"-1 um:{}\"), or a cone",
            length(depth),
            depth / radius,
            length(radius),
            length(0.5 * radius)
        ));
    }
    let lowest = rows.iter().map(|row| row[0]).fold(f64::INFINITY, f64::min);
    if !attracts && -lowest > ADHERES * found.largest_force && -lowest > 4.0 * found.residual_force
    {
        cautions.push(format!(
            "the sample pulls the tip with up to {}, which this law does not describe: fit a law with \
             adhesion, such as jkr or dmt",
            force(-lowest)
        ));
    }
    let in_contact = rows.iter().filter(|row| row[1] > 0.0).count();
    for (count, words) in [
        (in_contact, "in contact: the modulus rests on few values"),
        (
            rows.len() - in_contact,
            "before contact: the baseline rests on few values",
        ),
    ] {
        if count < MIN_ROWS {
            cautions.push(format!("only {count} rows are {words}"));
        }
    }
    if let Some(header) = found.spring_constant_in_header
        && found.spring_constant_from != "header"
    {
        cautions.push(format!(
            "the header of the file has another stiffness of the lever, {}: the modulus is proportional \
             to it",
            Kind::Stiffness.format_digits(header, 4)
        ));
    }
    cautions
}
