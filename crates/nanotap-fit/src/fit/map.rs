//! Fits of a map of curves: a force volume, one fit a pixel, into a dataset.
//!
//! The rows of the data name their pixel in further columns, or the map is an instrument's file, whose
//! curves are read when they are fitted. Pixels of a chunk are fitted in sequence, each from the result of
//! the one before first; where that does not describe the data, from the initial values of a single curve,
//! too. The result does not depend on threads.

use std::collections::BTreeMap;
use std::sync::Arc;

use afm_files::Document;
use nanotap_dynamics::Control;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::json;

use super::report::quantity;
use super::{FitOptions, FitReport, FitStudy, fit, names};
use crate::figure::fit::FitMaps;
use nanotap_case::Case;
use nanotap_case::table::{Entry, Header, Table};
use nanotap_dataset::schema::Kind;
use nanotap_dataset::{
    Axis, Block, Coordinate, Grid, Schema, Store, StoreError, Values, Variable, Work, WorkError,
    attributes, chunk_files, work,
};
use nanotap_error::Error;
use nanotap_figures::Figure;
use nanotap_observe::frame::{Frame, Rows, frame};
use nanotap_study::{Computation, DatasetPlan, DatasetStudy, Study as _};

/// Largest number of pixels of a map.
const MAX_PIXELS: usize = 1 << 18;
/// Number of first pixels in which a fit is searched for that determines the parameters and their
/// units.
const FIRST: usize = 8;
/// Chunks of a map with one axis.
const CHUNKS: usize = 64;

/// Results of a pixel, by code: the curve is described; the residuals are not noise, or nothing
/// describes the curve; there is no result.
const RESULTS: [&str; 3] = ["fits", "misfit", "failed"];

/// Name of the variable with the code of the result.
const RESULT: &str = "result";

/// Fits of a map of curves ([`FitOptions::pixels`]).
#[derive(Clone, Copy, Debug)]
pub struct FitMap;

impl DatasetStudy for FitMap {
    const NAME: &'static str = FitStudy::NAME;
    const ABOUT: &'static str = FitStudy::ABOUT;
    const COUNTED: &'static str = "rows of pixels";
    const PLANNED: &'static str = "starts";
    type Options = FitOptions;
    type Report = FitMapReport;

    fn any_distance(_: &FitOptions) -> bool {
        true
    }

    fn prepare(
        case: &Case,
        options: &FitOptions,
        control: &Control<'_>,
    ) -> Result<DatasetPlan, Error> {
        Ok(Box::new(Map::new(case, options, control)?))
    }

    fn report(store: &Store) -> Result<FitMapReport, StoreError> {
        FitMapReport::of(store)
    }

    fn frames(report: &FitMapReport) -> Vec<Frame<'_>> {
        vec![report.parameter_table()]
    }

    fn figure(store: &Store) -> Result<Figure, StoreError> {
        Ok(FitMaps::of(store)?.figure())
    }
}

/// Summary of a map of fits.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FitMapReport {
    /// Number of pixels with data.
    pub pixels: usize,
    /// Number of pixels whose curve is described.
    pub fits: usize,
    /// Number of pixels whose curve is not described: the residuals of the best values are not
    /// noise.
    pub misfits: usize,
    /// Number of pixels for which the fit has no result.
    pub failed: usize,
    /// Whether the parameters are over the pixels whose curve is not described, too: where these are the
    /// most, as on cells, a law is an approximation everywhere.
    pub over_misfits: bool,
    /// The free parameters, each over the pixels whose curve is described; see `over_misfits`.
    pub parameters: Vec<MappedParameter>,
}

/// Median and range of a parameter over a map.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MappedParameter {
    /// Name of the parameter, as in the report of a fit.
    pub key: String,
    /// Unit of the values in SI, `1` if there is none.
    pub unit: String,
    /// Median over these pixels, in `unit`; None if there are none.
    pub median: Option<f64>,
    /// Quantiles of 5 % and 95 % over these pixels, in `unit`.
    pub range: [Option<f64>; 2],
    /// Median of the standard errors over these pixels, in `unit`; None if no pixel has one.
    pub standard_error: Option<f64>,
}

impl FitMapReport {
    /// The free parameters, as readers are shown them.
    pub fn parameter_table(&self) -> Frame<'_> {
        let text = |of: &MappedParameter, value: Option<f64>| {
            value.map_or_else(|| "-".to_owned(), |v| quantity(&of.key, &of.unit, v))
        };
        frame! { Rows::new("parameters", &self.parameters, None);
            "", "parameter", Plain => |of| &of.key;
            "", "median", Plain => move |of| text(of, of.median);
            "", "5 % … 95 % of the pixels", Plain =>
                move |of| of.range.map(|end| text(of, end)).join(" … ");
            "", "standard error", Plain => move |of| text(of, of.standard_error);
        }
    }

    fn of(store: &Store) -> Result<Self, StoreError> {
        store.require_all()?;
        let schema = store.schema();
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); schema.variables.len()];
        for chunk in 0..store.chunks() {
            let block = schema.grid.block(chunk);
            for (k, column) in columns.iter_mut().enumerate() {
                column.extend(store.read_chunk(&block, k)?.numbers());
            }
        }
        let column = |name: &str| schema.index_of(name).map(|k| &columns[k][..]);
        let results = column(RESULT).unwrap_or_default();
        let count = |code: f64| results.iter().filter(|result| **result == code).count();
        let over_misfits = count(1.0) < count(2.0);
        let counts = |result: f64| result == 1.0 || over_misfits && result == 2.0;
        let parameters = schema.variables.iter().filter_map(|variable| {
            let errors = column(&error_of(&variable.name))?;
            let fitted = |values: &[f64]| -> Vec<f64> {
                let both = values.iter().zip(results);
                let kept = both.filter(|(value, result)| value.is_finite() && counts(**result));
                let mut kept: Vec<f64> = kept.map(|(value, _)| *value).collect();
                kept.sort_by(f64::total_cmp);
                kept
            };
            let values = fitted(column(&variable.name)?);
            let unit = variable.attributes.get("units");
            Some(MappedParameter {
                key: variable.name.clone(),
                unit: unit
                    .and_then(|unit| unit.as_str())
                    .unwrap_or("1")
                    .to_owned(),
                median: quantile(&values, 0.5),
                range: [0.05, 0.95].map(|part| quantile(&values, part)),
                standard_error: quantile(&fitted(errors), 0.5),
            })
        });
        Ok(Self {
            pixels: results.iter().filter(|result| **result != 0.0).count(),
            fits: count(1.0),
            misfits: count(2.0),
            failed: count(3.0),
            over_misfits,
            parameters: parameters.collect(),
        })
    }
}

fn quantile(sorted: &[f64], part: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    sorted.get((part * last as f64).round() as usize).copied()
}

fn error_of(key: &str) -> String {
    format!("{key}_error")
}

/// What a map of force curves has in addition to the parameters, with its unit in SI.
pub(crate) const OF_FORCES: [(&str, &str, &str); 3] = [
    (
        "contact_point",
        "distance at which the undeflected tip meets the surface",
        "m",
    ),
    (
        "adhesion_force",
        "adhesion: minus the lowest force of the model",
        "N",
    ),
    ("residual_force", "root mean square of the residuals", "N"),
];

/// A map in an instrument's file, whose curves are read one by one.
#[derive(Clone, Debug, Default)]
pub struct MapFile(pub Option<Arc<Document>>);

impl FitOptions {
    /// The same options for the map of an instrument's file, which is open under this name.
    ///
    /// # Errors
    /// If its first curve cannot be read.
    pub fn of_map(self, name: &str, document: Document) -> Result<Self, Error> {
        Ok(Self {
            data: vec![Table::of_document(name, &document, 0)?],
            map: MapFile(Some(Arc::new(document))),
            ..self
        })
    }
}

impl PartialEq for MapFile {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            (None, None) => true,
            _ => false,
        }
    }
}

/// Where the curve of each pixel comes from. Pixels are numbered as the entries of the grid.
#[derive(Debug)]
enum Source {
    /// The rows of a table that name the pixel.
    Rows {
        table: Table,
        rows: BTreeMap<usize, Vec<usize>>,
    },
    /// The numbers of the curves of a file.
    File {
        document: Arc<Document>,
        name: String,
        curves: BTreeMap<usize, usize>,
    },
}

impl Source {
    /// The pixels of a table by these columns, of which the last changes slowest.
    fn of_table(mut table: Table, pixels: &[String]) -> Result<(Self, Vec<Pixels>), Error> {
        let axes = pixels.iter().rev().map(|name| taken(&mut table, name));
        let (axes, columns): (Vec<Pixels>, Vec<Vec<usize>>) =
            axes.collect::<Result<Vec<_>, Error>>()?.into_iter().unzip();
        let mut rows: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for row in 0..table.rows() {
            let entry = axes.iter().zip(&columns);
            let entry = entry.fold(0, |flat, (axis, at)| flat * axis.values.len() + at[row]);
            rows.entry(entry).or_default().push(row);
        }
        Ok((Self::Rows { table, rows }, axes))
    }

    /// The pixels of a file by its grid, or by the numbers of its curves.
    fn of_file(document: &Arc<Document>, name: String) -> (Self, Vec<Pixels>) {
        let (curves, axes) = if let Some(grid) = document.grid {
            let [columns, lines] = grid.shape;
            let axis = |name: &str, k: usize| Pixels {
                name: name.to_owned(),
                unit: "m".to_owned(),
                values: (0..grid.shape[k])
                    .map(|at| (at as f64 + 0.5) * grid.size[k] / grid.shape[k] as f64)
                    .collect(),
            };
            let cells = (0..lines).flat_map(|line| (0..columns).map(move |at| [at, line]));
            let numbered = cells.enumerate();
            let curves =
                numbered.filter_map(|(entry, cell)| Some((entry, document.number_at(cell)?)));
            (curves.collect(), vec![axis("y", 1), axis("x", 0)])
        } else {
            let all = 0..document.curve_count();
            let axis = Pixels {
                name: "curve".to_owned(),
                unit: "1".to_owned(),
                values: all.clone().map(|number| number as f64).collect(),
            };
            (all.map(|number| (number, number)).collect(), vec![axis])
        };
        let document = Arc::clone(document);
        let source = Self::File {
            document,
            name,
            curves,
        };
        (source, axes)
    }

    /// The first pixels with a curve; of a file, pixels all over it.
    fn first_entries(&self) -> Vec<usize> {
        match self {
            Self::Rows { rows, .. } => rows.keys().copied().take(FIRST).collect(),
            Self::File { curves, .. } => {
                let step = curves.len().div_ceil(FIRST).max(1);
                curves.keys().copied().step_by(step).collect()
            }
        }
    }

    /// Whether a pixel has a curve.
    fn has(&self, entry: usize) -> bool {
        match self {
            Self::Rows { rows, .. } => rows.contains_key(&entry),
            Self::File { curves, .. } => curves.contains_key(&entry),
        }
    }

    /// The curve of a pixel.
    fn curve(&self, entry: usize) -> Result<Table, Error> {
        let none = || Error::option("data", format!("pixel {entry} has no curve"), "give one");
        match self {
            Self::Rows { table, rows } => {
                let rows = rows.get(&entry).ok_or_else(none)?;
                let columns = table.columns.iter().map(|(header, column)| {
                    let own = rows.iter().filter_map(|row| column.get(*row).cloned());
                    (header.clone(), own.collect())
                });
                let lines = rows.iter().filter_map(|row| table.lines.get(*row));
                Ok(Table {
                    name: table.name.clone(),
                    columns: columns.collect(),
                    lines: lines.copied().collect(),
                    notes: table.notes.clone(),
                    remarks: Vec::new(),
                })
            }
            Self::File {
                document,
                name,
                curves,
            } => {
                let number = *curves.get(&entry).ok_or_else(none)?;
                Table::of_document(name, document, number)
            }
        }
    }

    /// What distinguishes the data from others when a dataset is continued.
    fn fingerprint(&self) -> serde_json::Value {
        match self {
            Self::Rows { table, .. } => attributes::text(&fingerprint(table)),
            Self::File { curves, .. } => {
                let first = curves
                    .keys()
                    .next()
                    .and_then(|entry| self.curve(*entry).ok());
                let first = first.map(|table| fingerprint(&table));
                attributes::text(&(curves.len(), first))
            }
        }
    }
}

/// An axis of pixels: the numbers in a column of the data.
#[derive(Debug)]
struct Pixels {
    name: String,
    unit: String,
    values: Vec<f64>,
}

/// A map that is prepared, ready to be fitted chunk by chunk.
#[derive(Debug)]
struct Map {
    case: Case,
    /// Options of the fit of one pixel; data and pixels are empty.
    options: FitOptions,
    source: Source,
    parameters: Vec<String>,
    /// Whether the rows of the first pixel are in the other order.
    turned: bool,
    /// Whether the curves are force curves, with a contact point and an adhesion.
    has_forces: bool,
    schema: Schema,
}

impl Map {
    fn new(case: &Case, options: &FitOptions, control: &Control<'_>) -> Result<Self, Error> {
        let pixels = names(&options.pixels);
        if options.map.0.is_none() && !(1..=2).contains(&pixels.len()) {
            return Err(Error::option(
                "pixels",
                format!("expected one or two columns, got {}", pixels.len()),
                "name the columns that tell the pixel, as in x,y",
            ));
        }
        if !options.per_curve.is_empty() || !options.laws.is_empty() {
            return Err(Error::option(
                "pixels",
                "every pixel is a fit of one curve under one law",
                "leave {per_curve} and {laws} out",
            ));
        }
        let [table] = &options.data[..] else {
            return Err(Error::option(
                "data",
                format!("a map is one table, got {}", options.data.len()),
                "put all pixels into one table",
            ));
        };
        let (source, axes) = match &options.map.0 {
            Some(file) => Source::of_file(file, table.name.clone()),
            None => Source::of_table(table.clone(), &pixels)?,
        };
        let count: usize = axes.iter().map(|axis| axis.values.len()).product();
        if count > MAX_PIXELS {
            return Err(Error::option(
                "pixels",
                format!("{count} pixels are too many; {MAX_PIXELS} at most"),
                "fit a part of the map",
            ));
        }
        let options = FitOptions {
            data: Vec::new(),
            pixels: Vec::new(),
            map: MapFile::default(),
            profile: false,
            rivals: false,
            ..options.clone()
        };
        let mut map = Self {
            case: case.clone(),
            options,
            source,
            parameters: Vec::new(),
            has_forces: false,
            turned: false,
            schema: Schema {
                grid: Grid { axes: Vec::new() },
                variables: Vec::new(),
                coordinates: Vec::new(),
                attributes: attributes::of_case("map of fits", FitStudy::NAME, case),
            },
        };
        let first = map.first(control)?;
        map.turned = first.turned;
        map.parameters = first.parameters.iter().map(|p| p.key.clone()).collect();
        map.has_forces = !first.force_curves.is_empty();
        map.describe(&first, axes);
        Ok(map)
    }

    /// A fit of one of the first pixels.
    fn first(&self, control: &Control<'_>) -> Result<FitReport, Error> {
        let quiet = Control {
            progress: None,
            ..*control
        };
        let mut refused = None;
        for entry in self.source.first_entries() {
            match self.fitted(entry, None, &quiet) {
                Ok(report) => return Ok(report),
                Err(error) if control.is_cancelled() => return Err(error),
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        Err(refused.unwrap_or_else(|| Error::option("data", "the table has no rows", "give rows")))
    }

    /// The fit of a pixel, from the result of another if one is given.
    fn fitted(
        &self,
        entry: usize,
        before: Option<&FitReport>,
        control: &Control<'_>,
    ) -> Result<FitReport, Error> {
        let table = self.source.curve(entry)?;
        let turned = before.map_or(self.turned, |before| before.turned);
        let mut options = FitOptions {
            data: vec![if turned { table.reversed() } else { table }],
            ..self.options.clone()
        };
        if let Some(before) = before {
            let near = before.parameters.iter().map(|p| (p.key.clone(), p.value));
            options.near = near.collect();
        }
        let mut found = fit(&self.case, &options, control)?;
        found.turned ^= turned;
        Ok(found)
    }

    /// Grid, variables and coordinates, once the parameters are known.
    fn describe(&mut self, first: &FitReport, axes: Vec<Pixels>) {
        let real =
            |name: &str, about: &str, unit: &str| Variable::new(name, Kind::Real, about, unit);
        let variables = &mut self.schema.variables;
        for parameter in &first.parameters {
            let (key, unit) = (&parameter.key, &parameter.unit);
            variables.push(real(key, &format!("best value of {key}"), unit));
            variables.push(real(
                &error_of(key),
                &format!("standard error of {key}"),
                unit,
            ));
        }
        if self.has_forces {
            for (name, about, unit) in OF_FORCES {
                variables.push(real(name, about, unit));
            }
        }
        variables.push(real(
            "chi2_reduced",
            "chi2 over the degrees of freedom",
            "1",
        ));
        let codes: Vec<usize> = (0..=RESULTS.len()).collect();
        variables.push(
            Variable::new(RESULT, Kind::Code, "whether the curve is described", "1")
                .attribute("flag_values", json!(codes))
                .attribute("flag_meanings", format!("missing {}", RESULTS.join(" "))),
        );
        let attributes = &mut self.schema.attributes;
        attributes.insert("options".into(), attributes::text(&self.options));
        attributes.insert("data".into(), self.source.fingerprint());
        let last = axes.len() - 1;
        for (k, axis) in axes.into_iter().enumerate() {
            let length = axis.values.len();
            let chunk = match (k, last) {
                (0, 0) => length.div_ceil(CHUNKS),
                (0, _) => 1,
                _ => length,
            };
            self.schema
                .grid
                .axes
                .push(Axis::new(&axis.name, length, chunk));
            let about = "pixel";
            let values = Values::Real(axis.values);
            let coordinate = Coordinate::of(&axis.name, values, about, &axis.unit);
            self.schema.coordinates.push(coordinate);
        }
    }

    /// The values of a pixel in the order of the variables, of the fit of its curve if there is a result.
    fn values(&self, report: Option<&FitReport>) -> Vec<f64> {
        let mut values = Vec::new();
        let mut push = |of: Option<f64>| values.push(of.unwrap_or(f64::NAN));
        for key in &self.parameters {
            let mut all = report.iter().flat_map(|report| &report.parameters);
            let found = all.find(|p| p.key == *key);
            push(found.map(|p| p.value));
            push(found.and_then(|p| p.standard_error));
        }
        if self.has_forces {
            let curve = report.and_then(|report| report.force_curves.first());
            push(curve.and_then(|curve| Some(curve.contact_point.as_ref()?.value)));
            push(curve.and_then(|curve| curve.adhesion_force.map(|force| -force)));
            push(curve.map(|curve| curve.residual_force));
        }
        push(report.map(|of| of.chi2 / of.degrees_of_freedom.max(1) as f64));
        let result = report.map_or(3.0, |of| if of.fits && !of.misfit { 1.0 } else { 2.0 });
        push(Some(result));
        values
    }

    /// The values of the pixels of a chunk, by variable; none if the work was cancelled.
    fn chunk(&self, block: &Block, control: &Control<'_>) -> Option<Vec<Values>> {
        let quiet = Control {
            progress: None,
            ..*control
        };
        let count = self.schema.variables.len();
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); count];
        let mut before: Option<FitReport> = None;
        let axes = &self.schema.grid.axes;
        for entry in block.entries() {
            let entry = entry.iter().zip(axes);
            let entry = entry.fold(0, |flat, (at, axis)| flat * axis.length + at);
            let values = if self.source.has(entry) {
                let report = self.fitted(entry, before.as_ref(), &quiet);
                if quiet.is_cancelled() {
                    return None;
                }
                let values = self.values(report.as_ref().ok());
                // An elastic law that describes no curve to its noise still begins near the next one.
                let describes = |report: &FitReport| report.fits && !report.misfit;
                let begins = |report: &FitReport| describes(report) || self.has_forces;
                before = report.ok().filter(begins).or(before);
                values
            } else {
                let mut values = vec![f64::NAN; count];
                values[count - 1] = 0.0;
                values
            };
            for (column, value) in columns.iter_mut().zip(values) {
                column.push(value);
            }
        }
        let last = columns.pop()?;
        let mut values: Vec<Values> = columns.into_iter().map(Values::Real).collect();
        values.push(Values::Code(last.iter().map(|code| *code as u8).collect()));
        Some(values)
    }
}

impl Computation for Map {
    fn schema(&self) -> &Schema {
        &self.schema
    }

    fn compute(&self, store: &Store, how: &Work<'_>) -> Result<(), WorkError> {
        work(
            store,
            how,
            |_| 1,
            |block, _| self.chunk(block, &how.control),
            |_, columns| columns.into_iter().next().unwrap_or_default(),
        )
    }

    fn chunk_files(&self, chunk: usize, control: &Control<'_>) -> Option<Vec<Vec<u8>>> {
        let grid = &self.schema.grid;
        let block = (chunk < grid.chunks()).then(|| grid.block(chunk))?;
        let columns = self.chunk(&block, control)?;
        Some(chunk_files(&self.schema, &block, &columns))
    }
}

/// Takes the column of a pixel axis out of a table: its different values, and the number of that of
/// each row.
fn taken(table: &mut Table, name: &str) -> Result<(Pixels, Vec<usize>), Error> {
    let named = |(header, _): &(String, Vec<Entry>)| Header::of(header).name == name;
    let index = table.columns.iter().position(named).ok_or_else(|| {
        let all = table
            .columns
            .iter()
            .map(|(header, _)| Header::of(header).name);
        Error::option(
            "pixels",
            format!("{} has no column `{name}`", table.name),
            format!(
                "name one of its columns: {}",
                all.collect::<Vec<_>>().join(", ")
            ),
        )
    })?;
    let (header, column) = table.columns.remove(index);
    let number = |(row, entry): (usize, &Entry)| match entry {
        Entry::Number(value) if value.is_finite() => Ok(*value),
        _ => Err(Error::option(
            "pixels",
            format!(
                "{}, `{header}`, row {}: expected a number",
                table.name,
                row + 1
            ),
            "give every row the numbers of its pixel",
        )),
    };
    let numbers: Result<Vec<f64>, Error> = column.iter().enumerate().map(number).collect();
    let numbers = numbers?;
    let mut values = numbers.clone();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let place = |value: &f64| values.partition_point(|other| other < value);
    let places = numbers.iter().map(place).collect();
    let Header { name, unit } = Header::of(&header);
    let unit = if unit.is_empty() {
        "1".to_owned()
    } else {
        unit
    };
    let pixels = Pixels { name, unit, values };
    Ok((pixels, places))
}

/// Returns numbers that distinguish a table from others: its columns, and the sum of the numbers of
/// each.
fn fingerprint(table: &Table) -> BTreeMap<String, f64> {
    let number = |entry: &Entry| match entry {
        Entry::Number(value) => *value,
        _ => 0.0,
    };
    let columns = table.columns.iter();
    columns
        .map(|(header, column)| (header.clone(), column.iter().map(number).sum()))
        .collect()
}
