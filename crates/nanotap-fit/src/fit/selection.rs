//! Rows of a curve that are fitted: a segment, and ranges of rows, forces and indentations.
//!
//! Forces are counted from the baseline and indentations from the contact point: first from where the
//! rows leave the baseline, then from those of a fit, until it selects the same rows again.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::baseline::baseline_rows;
use super::data::{Curve, Data, Row};
use super::instrument::median;
use super::quantity::RestQuantity;
use super::report::FitReport;
use super::search::Search;
use super::{FitOptions, names};
use nanotap_case::physical::Kind;
use nanotap_case::{Case, Key, Value};
use nanotap_error::Error;
use nanotap_model::sample_law::SampleLaw;
use nanotap_motions::approach::Way;
use nanotap_study::value::Interval;

/// Two contacts and baselines that differ by less are the same, in m.
const SAME_CONTACT: f64 = 1e-10;

/// Part of a curve that is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Segment {
    /// The tip moves towards the sample
    Approach,
    /// The tip moves away from the sample
    Retract,
    /// Approach and retract together
    Both,
}

impl Segment {
    /// The word of the segment in messages.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Approach => "approach",
            Self::Retract => "retract",
            Self::Both => "approach and retract",
        }
    }

    /// Whether rows of this direction belong to it; rows whose direction is not known always do.
    fn has(self, way: Option<Way>) -> bool {
        match (self, way) {
            (Self::Both, _) | (_, None) => true,
            (Self::Approach, Some(way)) => way == Way::Approach,
            (Self::Retract, Some(way)) => way == Way::Retract,
        }
    }
}

/// Whether a law, by its name, has neither adhesion nor losses.
pub(super) fn is_elastic(law: &str) -> bool {
    SampleLaw::terms(law).is_ok_and(|terms| {
        let mut entries = terms.iter().map(|term| term.entry);
        entries.all(|entry| !entry.attracts && entry.conservative)
    })
}

/// The segment of a force curve that is fitted where the request does not state one: the approach of an
/// elastic law, both where a law has adhesion or losses.
pub(super) fn default_segment(case: &Case, request: &FitOptions) -> Segment {
    let own = case.stated(Key::SampleLaw).map(Value::text);
    let mut laws = names(&request.laws);
    if laws.is_empty() {
        laws.extend(own);
    }
    if !laws.is_empty() && laws.iter().all(|law| is_elastic(law)) {
        Segment::Approach
    } else {
        Segment::Both
    }
}

/// Where contact begins in a curve, by a fit: what forces and indentations are counted from.
#[derive(Clone, Debug)]
pub(super) struct Contact {
    /// Name of the curve.
    curve: String,
    /// Offset of the distance, m.
    pub(super) offset: f64,
    /// Offset and factor of the measured quantity.
    pub(super) baseline: f64,
    scale: f64,
    /// Stiffness of the lever, N/m.
    pub(super) stiffness: f64,
    quantity: RestQuantity,
}

impl Contact {
    /// The contact of each curve of a force curve's fit; nothing of another one.
    pub(super) fn of(search: &Search<'_>, report: &FitReport) -> Vec<Self> {
        let problem = &search.problem;
        let Some(quantity) = problem.data.columns.first().and_then(|c| c.quantity.rest()) else {
            return Vec::new();
        };
        let x: Vec<f64> = report.parameters.iter().map(|p| p.value).collect();
        let cases = problem.cases(&x);
        let curves = problem.data.curves.iter().zip(&cases).enumerate();
        curves
            .map(|(curve, (of, case))| Self {
                curve: of.name.clone(),
                offset: of
                    .rows
                    .first()
                    .map_or(0.0, |row| problem.place(&x, curve, row)[0] - row.at[0]),
                // The terms of the instrument are measured from the farthest row.
                baseline: of
                    .rows
                    .first()
                    .map_or(0.0, |row| problem.read(&x, curve, row, 0, 0.0)),
                scale: problem.scale(&x, curve, 0),
                stiffness: case.get(Key::LeverK),
                quantity,
            })
            .collect()
    }

    /// The contact where the rows leave the baseline, before any fit.
    fn rough(curve: &Curve, quantity: RestQuantity, stiffness: f64) -> Option<Self> {
        let known = curve.rows.iter();
        let known = known.filter_map(|row| Some((row.at[0], (*row.values.first()?)?)));
        let (distance, values): (Vec<f64>, Vec<f64>) = known.unzip();
        let [free, doubtful] = baseline_rows(&distance, &values);
        let last = *doubtful.last().or(free.last())?;
        Some(Self {
            curve: curve.name.clone(),
            offset: -distance[last],
            baseline: median(free.iter().map(|row| values[*row]).collect()),
            scale: 1.0,
            stiffness,
            quantity,
        })
    }

    /// Force in N and indentation in m of a row; the indentation is negative before contact.
    pub(super) fn of_row(&self, row: &Row) -> Option<[f64; 2]> {
        let value = ((*row.values.first()?)? - self.baseline) / self.scale;
        let deflection = match self.quantity {
            RestQuantity::Deflection => value,
            RestQuantity::Force => value / self.stiffness,
        };
        Some([
            deflection * self.stiffness,
            -(row.at[0] + self.offset + deflection),
        ])
    }

    /// Whether two fits found the same contact.
    fn is_near(&self, other: &Self) -> bool {
        let lifted = (self.baseline - other.baseline) / self.scale;
        let lifted = match self.quantity {
            RestQuantity::Deflection => lifted,
            RestQuantity::Force => lifted / self.stiffness,
        };
        (self.offset - other.offset).abs() <= SAME_CONTACT && lifted.abs() <= SAME_CONTACT
    }
}

/// A range of the request, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Range {
    of: Ranged,
    low: f64,
    high: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ranged {
    Rows,
    Force,
    Indentation,
}

impl Range {
    fn parse(given: &Interval) -> Result<Self, Error> {
        let (of, kind) = match given.name.as_str() {
            "rows" => (Ranged::Rows, Kind::Number),
            "force" => (Ranged::Force, Kind::Force),
            "indentation" => (Ranged::Indentation, Kind::Length),
            other => {
                return Err(Error::option(
                    "range",
                    format!("`{other}` has no range"),
                    "write rows=100:2000, force=\"0.1 nN:2 nN\" or indentation=\"-1 um:300 nm\"",
                ));
            }
        };
        let read = |end: &str| {
            let is_bare = end.trim().parse().is_ok_and(|value: f64| value != 0.0);
            if kind != Kind::Number && is_bare {
                return Err(Error::option(
                    "range",
                    format!("{}: `{end}` has no unit", given.name),
                    format!("write both ends as in \"{}\"", kind.example()),
                ));
            }
            let read = kind.parse(end);
            read.map_err(|error| {
                let what = format!("{}: {error}", given.name);
                Error::option("range", what, "give both ends, each with its unit")
            })
        };
        let (low, high) = (read(given.low.text())?, read(given.high.text())?);
        if low < high {
            return Ok(Self { of, low, high });
        }
        Err(Error::option(
            "range",
            format!("{}: the ends are not in ascending order", given.name),
            "give the lower end first",
        ))
    }

    fn has(&self, row: &Row, contact: Option<&Contact>) -> bool {
        let value = match (self.of, contact) {
            (Ranged::Rows, _) => Some(row.line as f64),
            // Without a baseline.
            (_, None) => return true,
            (Ranged::Force, Some(contact)) => contact.of_row(row).map(|[force, _]| force),
            (Ranged::Indentation, Some(contact)) => contact.of_row(row).map(|[_, depth]| depth),
        };
        value.is_some_and(|value| (self.low..=self.high).contains(&value))
    }
}

/// Largest number of fits until a range of forces or indentations selects the same rows again.
pub(super) const MAX_SELECTIONS: usize = 4;

/// What is selected, with the contact of each curve once a fit has found it.
#[derive(Clone, Debug, Default)]
pub(super) struct Selection {
    segment: Option<Segment>,
    is_stated: bool,
    ranges: Vec<Range>,
    contacts: Vec<Contact>,
}

impl Selection {
    /// # Errors
    /// If a range is not one.
    pub(super) fn of(case: &Case, request: &FitOptions) -> Result<Self, Error> {
        let ranges = request.range.0.iter().map(Range::parse);
        Ok(Self {
            segment: Some(
                request
                    .segment
                    .unwrap_or_else(|| default_segment(case, request)),
            ),
            is_stated: request.segment.is_some(),
            ranges: ranges.collect::<Result<_, _>>()?,
            contacts: Vec::new(),
        })
    }

    /// Whether a range refers to the contact.
    pub(super) fn needs_contact(&self) -> bool {
        self.ranges.iter().any(|range| range.of != Ranged::Rows)
    }

    /// Takes the contacts of a fit; false if the fit before found the same.
    pub(super) fn refine(&mut self, contacts: Vec<Contact>) -> bool {
        let same = self.contacts.len() == contacts.len()
            && self
                .contacts
                .iter()
                .zip(&contacts)
                .all(|(a, b)| a.is_near(b));
        self.contacts = contacts;
        !same
    }

    /// Keeps the selected rows of the data, and says which.
    ///
    /// # Errors
    /// If no row is left, or a segment is selected and the rows do not say to which they belong.
    pub(super) fn apply(&self, case: &Case, data: &mut Data) -> Result<Vec<String>, Error> {
        let is_force_curve = data.is_force_curve();
        if !is_force_curve && self.needs_contact() {
            return Err(Error::option(
                "range",
                "forces and indentations are those of a force curve, and these rows oscillate",
                "select rows, as in rows=100:2000",
            ));
        }
        let mut notes = Vec::new();
        let before = data.rows().count();
        if let Some(segment) = self.segment.filter(|_| is_force_curve || self.is_stated) {
            let knows_way = data.rows().any(|row| row.way.is_some());
            let has_any = data.rows().any(|row| segment.has(row.way));
            if self.is_stated && segment != Segment::Both && !(knows_way && has_any) {
                let word = segment.word();
                return Err(Error::option(
                    "segment",
                    if knows_way {
                        format!("the data have no {word}")
                    } else {
                        format!("the rows do not say which of them are the {word}")
                    },
                    "give a column `direction` with approach or retract, or fit {segment} both",
                ));
            }
            if knows_way && has_any {
                data.retain(|_, row| segment.has(row.way));
                let after = data.rows().count();
                if after < before {
                    notes.push(format!(
                        "fitted: the {}, {after} of {before} rows; the option `segment` selects others",
                        segment.word()
                    ));
                }
            }
        }
        if self.ranges.is_empty() {
            return Ok(notes);
        }
        let before = data.rows().count();
        let mut contacts = self.contacts.clone();
        let quantity = data.columns.first().and_then(|c| c.quantity.rest());
        if let (true, Some(quantity)) = (contacts.is_empty() && self.needs_contact(), quantity) {
            let k = case.get(Key::LeverK);
            let curves = data.curves.iter();
            contacts.extend(curves.filter_map(|curve| Contact::rough(curve, quantity, k)));
        }
        data.retain(|curve, row| {
            let contact = contacts.iter().find(|contact| contact.curve == curve);
            self.ranges.iter().all(|range| range.has(row, contact))
        });
        let after = data.rows().count();
        if after == 0 {
            return Err(Error::option(
                "range",
                format!("none of {before} rows is in the range"),
                "give a wider one",
            ));
        }
        notes.push(format!("rows in the range: {after} of {before}"));
        Ok(notes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap_study::value::Intervals;

    fn ranges(text: &str) -> Result<Vec<Range>, String> {
        let intervals: Intervals = serde_json::from_str(text).map_err(|e| e.to_string())?;
        let all = intervals.0.iter().map(Range::parse);
        all.collect::<Result<_, _>>().map_err(|e| e.message())
    }

    #[test]
    fn ranges_have_units_and_ascend() {
        let found = ranges(r#"["force=0.5 nN:2 nN", "indentation=-1 um:300 nm", "rows=5:10"]"#);
        let found: Vec<[f64; 2]> = found.unwrap().iter().map(|r| [r.low, r.high]).collect();
        for (found, known) in found
            .iter()
            .zip([[5e-10, 2e-9], [-1e-6, 3e-7], [5.0, 10.0]])
        {
            assert!(
                (found[0] - known[0]).abs() <= 1e-12 * known[0].abs(),
                "{found:?}"
            );
            assert!(
                (found[1] - known[1]).abs() <= 1e-12 * known[1].abs(),
                "{found:?}"
            );
        }
        for wrong in [
            r#"["force=2 nN:1 nN"]"#,
            r#"["depth=1 nm:2 nm"]"#,
            r#"["force=1:2"]"#,
            r#"["indentation=1 nN:2 nN"]"#,
        ] {
            assert!(ranges(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn force_and_indentation_are_counted_from_baseline_and_contact() {
        let contact = Contact {
            curve: "a".to_owned(),
            offset: 10e-9,
            baseline: 1e-9,
            scale: 1.0,
            stiffness: 2.0,
            quantity: RestQuantity::Deflection,
        };
        let row = Row {
            at: vec![-20e-9],
            values: vec![Some(4e-9)],
            errors: vec![None],
            relative: vec![1.0],
            way: Some(Way::Approach),
            line: 7,
            count: 1,
            is_free: false,
            ramp: crate::fit::terms::Ramp::default(),
        };
        // Deflected by 3 nm while the base is 10 nm below the contact point.
        let [force, depth] = contact.of_row(&row).unwrap();
        assert!((force - 6e-9).abs() < 1e-18 && (depth - 7e-9).abs() < 1e-18);
    }
}
