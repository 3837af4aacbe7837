//! Fits of the same data under several contact laws.

use std::collections::BTreeSet;

use super::report::{ComparedLaw, FitReport};
use super::{FitOptions, fit_one, implied_case, names};
use nanotap_case::under_law::LawName;
use nanotap_case::{Case, Key};
use nanotap_dynamics::control::Control;
use nanotap_error::Error;

/// Difference of Akaike's criterion above which the worse of two laws has essentially no support
/// (Burnham & Anderson, Model Selection and Multimodel Inference, 2nd ed. 2002, Sect. 2.6).
const DECIDED: f64 = 10.0;

/// Fits each law of the request. The report is that of the best law, with all laws in `laws`.
pub(super) fn compare(
    case: &Case,
    request: &FitOptions,
    control: &Control<'_>,
) -> Result<FitReport, Error> {
    let laws = names(&request.laws)
        .iter()
        .map(|name| LawName::read(name))
        .collect::<Result<Vec<_>, _>>()
        .map_err(|error| error.at("laws"))?;
    if let Some(twice) = (1..laws.len()).find(|k| laws[..*k].contains(&laws[*k])) {
        return Err(Error::option(
            "laws",
            format!("{} is listed twice", laws[twice].text()),
            "name each law once",
        ));
    }
    for (option, given) in [("free", &request.free), ("per_curve", &request.per_curve)] {
        for name in names(given) {
            if !laws.iter().any(|law| takes(law, &name)) {
                return Err(Error::option(
                    option,
                    format!("none of these laws has the parameter {name}"),
                    "free parameters of at least one of them",
                ));
            }
        }
    }
    let mut begins = middles(request);
    if request.free.is_empty() && request.per_curve.is_empty() {
        begins.extend(implied_case::ADHESION);
    }
    let mut found: Vec<(String, Result<FitReport, Error>)> = Vec::new();
    for law in &laws {
        if control.is_cancelled() {
            break;
        }
        let fitted = case.under_law(law, &begins).and_then(|case| {
            let of_law = |given: &[String]| -> Vec<String> {
                let all = names(given).into_iter();
                all.filter(|name| takes(law, name)).collect()
            };
            let mut request = FitOptions {
                laws: Vec::new(),
                free: of_law(&request.free),
                per_curve: of_law(&request.per_curve),
                ..request.clone()
            };
            request.bounds.0.retain(|bound| takes(law, &bound.name));
            let name = |start: &String| {
                start
                    .split('=')
                    .next()
                    .unwrap_or_default()
                    .trim()
                    .to_owned()
            };
            request.start.retain(|start| takes(law, &name(start)));
            fit_one(&case, &request, control)
        });
        // A law whose fit was cancelled without a result is not judged.
        if fitted.is_ok() || !control.is_cancelled() {
            found.push((law.text(), fitted));
        }
    }
    // The criteria of different rows cannot be compared.
    let rows = common_rows(&found);
    for report in found
        .iter_mut()
        .filter_map(|(_, fitted)| fitted.as_mut().ok())
    {
        if is_judged(report) {
            [report.aic, report.bic] = report.likelihood.criteria(&rows);
        }
    }
    let rank = |fitted: &Result<FitReport, Error>| match fitted {
        Ok(report) if is_judged(report) => (!report.fits, report.aic),
        _ => (true, f64::INFINITY),
    };
    let order = |a: &(bool, f64), b: &(bool, f64)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
    let best = (0..found.len()).min_by(|a, b| order(&rank(&found[*a].1), &rank(&found[*b].1)));
    let Some(best) = best else {
        return Err(Error::new(
            nanotap_error::ErrorKind::Stopped,
            "stopped before the first fit was finished",
        ));
    };
    let compared = table(&found);
    let (law, report) = found.swap_remove(best);
    let mut report = report?;
    report.remarks.extend(cautions(&law, &compared));
    let count = report.likelihood.rows.len();
    report
        .remarks
        .extend(lost_rows(&compared, rows.len(), count));
    report.law = Some(law);
    report.laws = compared;
    report.cancelled |= control.is_cancelled();
    Ok(report)
}

/// True if a parameter can be free under a law; keys outside the sample always can.
fn takes(law: &LawName, name: &str) -> bool {
    Key::find(name).is_none_or(|key| law.takes(key))
}

/// Initial values of keys that the case does not state: the middle of their bounds.
fn middles(request: &FitOptions) -> Vec<(Key, f64)> {
    let middle = |bound: &nanotap_study::value::Interval| {
        let key = Key::find(&bound.name)?;
        let read = |text: &str| key.kind().parse(text).ok();
        Some((
            key,
            between(read(bound.low.text())?, read(bound.high.text())?),
        ))
    };
    request.bounds.0.iter().filter_map(middle).collect()
}

/// The middle of two bounds; of positive ones, the geometric mean.
pub(super) fn between(low: f64, high: f64) -> f64 {
    if low > 0.0 {
        (low * high).sqrt()
    } else {
        0.5 * (low + high)
    }
}

/// Whether a law has orbits for at least half of the rows, so that the others may be left out.
fn is_judged(report: &FitReport) -> bool {
    2 * report.rows_without_orbit <= report.likelihood.rows.len()
}

/// The rows that have an orbit under every law that is judged.
fn common_rows(found: &[(String, Result<FitReport, Error>)]) -> BTreeSet<(String, u64)> {
    let reports = found.iter().filter_map(|(_, fitted)| fitted.as_ref().ok());
    let rows = reports
        .filter(|report| is_judged(report))
        .map(|report| report.likelihood.with_orbit());
    rows.reduce(|a, b| &a & &b).unwrap_or_default()
}

/// Says over which rows the criteria are, where a law has no orbit at some.
fn lost_rows(laws: &[ComparedLaw], common: usize, all: usize) -> Option<String> {
    let of = laws.iter().filter_map(|law| {
        let lost = law.rows_without_orbit.filter(|lost| *lost > 0)?;
        Some(format!("{lost} under {}", law.law))
    });
    let of: Vec<String> = of.collect();
    (!of.is_empty()).then(|| {
        format!(
            "rows without an orbit: {}; the criteria are over the {common} of {all} rows that have one \
             under every law with orbits for at least half of them",
            of.join(", ")
        )
    })
}

fn table(found: &[(String, Result<FitReport, Error>)]) -> Vec<ComparedLaw> {
    let judged = || {
        let reports = found.iter().filter_map(|(_, fitted)| fitted.as_ref().ok());
        reports
            .filter(|report| is_judged(report))
            .map(|report| report.aic)
    };
    let least = judged().fold(f64::INFINITY, f64::min);
    let likelihood = |aic: f64| nanotap_arithmetic::exp(0.5 * (least - aic));
    let all: f64 = judged().map(likelihood).sum();
    let if_judged = |report: &FitReport, value: f64| is_judged(report).then_some(value);
    let row = |(law, fitted): &(String, Result<FitReport, Error>)| match fitted {
        Ok(report) => ComparedLaw {
            law: law.clone(),
            fits: report.fits,
            reason: report.reason.clone(),
            aic: if_judged(report, report.aic),
            bic: if_judged(report, report.bic),
            above_best: if_judged(report, report.aic - least),
            weight: if_judged(report, likelihood(report.aic) / all),
            rows_without_orbit: Some(report.rows_without_orbit),
            chi2: Some(report.chi2),
            degrees_of_freedom: Some(report.degrees_of_freedom),
            parameters: report.parameters.clone(),
            remarks: report.remarks.clone(),
            case_file: Some(report.case_file.clone()),
        },
        Err(error) => ComparedLaw {
            law: law.clone(),
            fits: false,
            reason: Some(error.to_string()),
            aic: None,
            bic: None,
            above_best: None,
            weight: None,
            rows_without_orbit: None,
            chi2: None,
            degrees_of_freedom: None,
            parameters: Vec::new(),
            remarks: Vec::new(),
            case_file: None,
        },
    };
    found.iter().map(row).collect()
}

/// Cautions about the choice of a law.
fn cautions(best: &str, laws: &[ComparedLaw]) -> Vec<String> {
    let mut cautions = Vec::new();
    let near: Vec<&str> = laws
        .iter()
        .filter(|law| law.law != best && law.above_best.is_some_and(|above| above < DECIDED))
        .map(|law| law.law.as_str())
        .collect();
    if !near.is_empty() {
        cautions.push(format!(
            "the data hardly distinguish {best} from {}: Akaike's criterion differs by less than {DECIDED}",
            near.join(" and ")
        ));
    }
    let known = laws.iter().filter(|law| law.fits && law.bic.is_some());
    let by_bic = known.min_by(|a, b| a.bic.unwrap_or(0.0).total_cmp(&b.bic.unwrap_or(0.0)));
    if let Some(other) = by_bic.filter(|law| law.law != best) {
        cautions.push(format!(
            "Schwarz's criterion, with a larger penalty for parameters, prefers {}",
            other.law
        ));
    }
    cautions
}
