//! An image whose lines are independent as a dataset, a chunk a line, so that a scan that was stopped
//! goes on and several machines share it.
//!
//! A line of the dataset holds its pixels, its statistics, its longest flights and its first jumps
//! onto another branch; with what is known before the lines (in the attribute `scan`) they are the
//! whole report again.

use std::collections::HashMap;
use std::sync::{LazyLock, OnceLock};

use nanotap_case::physical::Remark;
use nanotap_dynamics::Control;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::frames::centres;
use super::instrument::Interaction;
use super::options::ScanOptions;
use super::plan::Plan;
use super::recorder::{KEPT, LineRecord};
use super::report::{
    BranchChange, CHANNELS, Channels, Direction, LineStatistics, OffSetpoint, Parachuting,
    PixelRow, ScanReport,
};
use super::run::{Recorded, Settled};
use super::{ScanStudy, header, lever_memory, with_lines};
use crate::figure::scan::scan_figure;
use nanotap_case::Case;
use nanotap_dataset::schema::Kind;
use nanotap_dataset::{
    Axis, Block, Coordinate, Grid, Schema, Store, StoreError, Values, Variable, Work, WorkError,
    attributes, chunk_files, work,
};
use nanotap_error::Error;
use nanotap_figures::Figure;
use nanotap_observe::frame::Row;
use nanotap_study::Computation;
use nanotap_study::DatasetPlan;
use nanotap_study::DatasetStudy;
use nanotap_study::Study as _;

/// Attribute with the report before its lines, as JSON.
const HEADER: &str = "scan";

const STATES: [Interaction; 4] = [
    Interaction::Free,
    Interaction::Attractive,
    Interaction::Repulsive,
    Interaction::Irregular,
];

/// Names and units of the numbers that are stored of a line, of a flight, of a stretch off the
/// setpoint and of a change of the state.
static STATISTICS: LazyLock<Stored> = LazyLock::new(stored::<LineStatistics>);
static FLIGHT: LazyLock<Stored> = LazyLock::new(stored::<Parachuting>);
static OFF: LazyLock<Stored> = LazyLock::new(stored::<OffSetpoint>);
static JUMP: LazyLock<Stored> = LazyLock::new(stored::<BranchChange>);

type Stored = Vec<(&'static str, &'static str)>;

/// Names and units of the columns of rows, except those that are coordinates of the dataset.
fn stored<R: Row>() -> Stored {
    let columns = R::COLUMNS
        .iter()
        .filter(|c| !["line", "y"].contains(&c.name));
    columns
        .map(|column| (column.name, column.dimension.si_unit()))
        .collect()
}

const PERIODS: &str = "drive periods";

/// Number of periods at an end of the range of z.
const SUMS: [(&str, &str); 1] = [("at_range", PERIODS)];

/// The unit of a governing force, stored as its code, and of a number of a list.
const STATE: &str = "1";
const NUMBER: &str = "count";
/// The unit of what holds (1) or does not (0).
const FLAG: &str = "flag";

/// The scan of an image whose lines settle by themselves, as a dataset. Listed periods
/// ([`ScanOptions::list`]) are not in it.
#[derive(Clone, Copy, Debug)]
pub struct ScanLines;

impl DatasetStudy for ScanLines {
    const NAME: &'static str = ScanStudy::NAME;
    const ABOUT: &'static str = ScanStudy::ABOUT;
    const COUNTED: &'static str = "lines";
    const PLANNED: &'static str = "drive periods";
    type Options = ScanOptions;
    type Report = ScanReport;

    fn any_distance(_: &ScanOptions) -> bool {
        true
    }

    fn remarks(report: &ScanReport) -> Vec<Remark> {
        Remark::warnings(&report.warnings)
    }

    fn prepare(
        case: &Case,
        options: &ScanOptions,
        control: &Control<'_>,
    ) -> Result<DatasetPlan, Error> {
        Ok(Box::new(Image::new(case, options, control)?))
    }

    fn report(store: &Store) -> Result<ScanReport, StoreError> {
        store.require_all()?;
        let schema = store.schema();
        let not_a_scan = || StoreError::NotAStore {
            path: store.path().into(),
            what: "it holds no scan, or one of another version of nanotap".into(),
        };
        let text = schema.attributes.get(HEADER).and_then(Value::as_str);
        let header: ScanReport = text
            .and_then(|text| serde_json::from_str(text).ok())
            .ok_or_else(not_a_scan)?;
        let mut recorded = Recorded::default();
        let lines = schema.axis_values(0);
        let directions = 1 + usize::from(header.retrace.is_some());
        // A finished dataset has several lines in a chunk.
        for chunk in 0..store.chunks() {
            let block = schema.grid.block(chunk);
            let of_chunk: Result<Vec<Vec<f64>>, StoreError> = (0..schema.variables.len())
                .map(|k| Ok(store.read_chunk(&block, k)?.numbers()))
                .collect();
            let of_chunk = of_chunk?;
            for line in block.ranges[0].clone() {
                let at = line - block.ranges[0].start;
                let own = |values: &Vec<f64>| {
                    let length = values.len() / block.ranges[0].len();
                    values[at * length..(at + 1) * length].to_vec()
                };
                let names = schema
                    .variables
                    .iter()
                    .map(|variable| variable.name.clone());
                let numbers = names.zip(of_chunk.iter().map(own)).collect();
                let read = line_of(&numbers, line, lines[line], directions);
                recorded.join(read.ok_or_else(not_a_scan)?);
            }
        }
        let pixels = schema.coordinate("x").map_or(0, |x| x.values.len());
        Ok(with_lines(header, recorded, [lines.len(), pixels]))
    }

    fn figure(store: &Store) -> Result<Figure, StoreError> {
        Ok(scan_figure(&Self::report(store)?))
    }
}

/// A scan that is prepared, ready to be computed line by line.
#[derive(Debug)]
struct Image {
    case: Case,
    plan: Plan,
    schema: Schema,
}

impl Image {
    fn new(case: &Case, options: &ScanOptions, control: &Control<'_>) -> Result<Self, Error> {
        let plan = Plan::new(case, options, control)?;
        if plan.line_settle.is_none() {
            return Err(Error::option(
                "line_settle",
                "the lines of a dataset are computed by themselves",
                "give the drive periods that the lever settles before each line, as in \
                 {line_settle} 2000",
            ));
        }
        if !plan.list.is_empty() {
            return Err(Error::option(
                "list",
                "a dataset has no listed periods",
                "leave {list} out, or write no dataset",
            ));
        }
        let settled = Settled::new(&plan, lever_memory(case), control)?;
        let header = header(&plan, case, &settled);
        drop(settled);
        let schema = schema(case, options, &plan, &header)?;
        Ok(Self {
            case: case.clone(),
            plan,
            schema,
        })
    }

    fn settled(&self, control: &Control<'_>) -> Result<Settled<'_>, Error> {
        Settled::new(&self.plan, lever_memory(&self.case), control)
    }
}

impl Computation for Image {
    fn schema(&self) -> &Schema {
        &self.schema
    }

    fn compute(&self, store: &Store, how: &Work<'_>) -> Result<(), WorkError> {
        // Progress counts lines, not the periods within them.
        let quiet = Control {
            progress: None,
            ..how.control
        };
        let failed: OnceLock<Error> = OnceLock::new();
        let result = match self.settled(&quiet) {
            Ok(settled) => work(
                store,
                how,
                |_| 1,
                |block, _| {
                    let line = settled.independent_line(block.chunk, &quiet);
                    line.map_err(|error| failed.set(error)).ok()
                },
                |_, lines| {
                    lines
                        .into_iter()
                        .next()
                        .map_or_else(Vec::new, |line| self.columns(line))
                },
            ),
            Err(error) => return Err(WorkError::Failed(Box::new(error))),
        };
        match (result, failed.into_inner()) {
            (Err(WorkError::Cancelled { .. }), Some(error)) if !quiet.is_cancelled() => {
                Err(WorkError::Failed(Box::new(error)))
            }
            (result, _) => result,
        }
    }

    fn chunk_files(&self, chunk: usize, control: &Control<'_>) -> Option<Vec<Vec<u8>>> {
        let grid = &self.schema.grid;
        let block: Block = (chunk < grid.chunks()).then(|| grid.block(chunk))?;
        let line = self.settled(control).ok()?.independent_line(chunk, control);
        Some(chunk_files(&self.schema, &block, &self.columns(line.ok()?)))
    }
}

/// Numbers by the name of their variable, first of the trace, then of the retrace.
type Numbers = HashMap<String, Vec<f64>>;

impl Image {
    /// The values of a line, in the order of the variables.
    fn columns(&self, line: Recorded) -> Vec<Values> {
        let directions = 1 + usize::from(self.plan.retrace);
        let numbers = numbers_of(line, directions, self.plan.pixels);
        let variables = self.schema.variables.iter();
        variables
            .map(|variable| {
                let values = numbers.get(&variable.name).cloned().unwrap_or_default();
                match variable.kind {
                    Kind::Code => Values::Code(values.iter().map(|v| *v as u8).collect()),
                    Kind::Whole => Values::Whole(values.iter().map(|v| *v as i32).collect()),
                    _ => Values::Real(values),
                }
            })
            .collect()
    }
}

/// The name of a number of a table.
fn named(table: &str, name: &str) -> String {
    format!("{table}_{name}")
}

/// Numbers of an entry of a table by their names in JSON.
fn fields(entry: &impl Serialize, table: &[(&str, &str)]) -> Vec<f64> {
    let entry = serde_json::to_value(entry).unwrap_or_default();
    let number = |(name, _): &(&str, &str)| {
        let value = &entry[*name];
        let state = || serde_json::from_value(value.clone()).ok().map(code);
        let flag = || value.as_bool().map(f64::from);
        let number = value.as_f64().or_else(flag).or_else(state);
        number.unwrap_or(f64::NAN)
    };
    table.iter().map(number).collect()
}

/// An entry of a table from its numbers.
fn entry<T: DeserializeOwned>(
    table: &[(&str, &str)],
    numbers: impl Iterator<Item = f64>,
    more: Value,
) -> Option<T> {
    let mut entry = more;
    for ((name, unit), number) in table.iter().zip(numbers) {
        entry[*name] = match *unit {
            _ if number.is_nan() => Value::Null,
            PERIODS | NUMBER => json!(number as u64),
            STATE => json!(state(number)?),
            FLAG => json!(number != 0.0),
            _ => json!(number),
        };
    }
    serde_json::from_value(entry).ok()
}

fn code(state: Interaction) -> f64 {
    let index = STATES.iter().position(|s| *s == state);
    index.map_or(0.0, |index| index as f64 + 1.0)
}

fn state(code: f64) -> Option<Interaction> {
    STATES.get((code as usize).checked_sub(1)?).copied()
}

fn numbers_of(line: Recorded, directions: usize, pixels: usize) -> Numbers {
    let mut numbers = Numbers::new();
    let mut image = Channels::missing(directions, pixels);
    let mut put = |table: &str, names: &[(&str, &str)], rows: Vec<Vec<f64>>| {
        for (k, (name, _)) in names.iter().enumerate() {
            let column = rows
                .iter()
                .map(|row| row.get(k).copied().unwrap_or(f64::NAN));
            let all = numbers.entry(named(table, name)).or_default();
            all.extend(column);
        }
    };
    for record in line.lines {
        let LineRecord {
            statistics,
            pixels,
            at_range,
        } = record;
        put("sums", &SUMS, vec![vec![at_range as f64]]);
        put("line", &STATISTICS, vec![fields(&statistics, &STATISTICS)]);
        let mut flights: Vec<&Parachuting> = statistics.parachuting.iter().collect();
        flights.sort_by(|a, b| b.length.total_cmp(&a.length));
        flights.truncate(KEPT);
        flights.sort_by_key(|flight| flight.first_period);
        let mut rows: Vec<Vec<f64>> = flights.iter().map(|f| fields(f, &FLIGHT)).collect();
        rows.resize(KEPT, Vec::new());
        put("flight", &FLIGHT, rows);
        let stretches = statistics.off_setpoint.iter();
        let mut rows: Vec<Vec<f64>> = stretches.map(|off| fields(off, &OFF)).collect();
        rows.resize(KEPT, Vec::new());
        put("off", &OFF, rows);
        let own = line
            .changes
            .iter()
            .filter(|c| c.direction == statistics.direction);
        let mut rows: Vec<Vec<f64>> = own.take(KEPT).map(|c| fields(c, &JUMP)).collect();
        rows.resize(KEPT, Vec::new());
        put("jump", &JUMP, rows);
        image.set_line(statistics.direction as usize, pixels);
    }
    for channel in CHANNELS {
        numbers.insert(channel.name.into(), (channel.values)(&image).concat());
    }
    let states = image.state.iter().flatten();
    let codes = states.map(|state| state.map_or(0.0, code));
    numbers.insert("state".into(), codes.collect());
    numbers
}

/// Returns the record of a line from its numbers.
fn line_of(numbers: &Numbers, line: usize, y: f64, directions: usize) -> Option<Recorded> {
    // The part of a variable that belongs to a direction.
    let part = |name: &str, direction: usize| {
        let all = numbers.get(name)?;
        let length = all.len() / directions;
        all.get(direction * length..(direction + 1) * length)
    };
    let rows = |table: &str, names: &[(&str, &str)], direction: usize| -> Option<Vec<Vec<f64>>> {
        let columns: Option<Vec<&[f64]>> = names
            .iter()
            .map(|(name, _)| part(&named(table, name), direction))
            .collect();
        let columns = columns?;
        let count = columns.first().map_or(0, |column| column.len());
        let row = |k: usize| columns.iter().filter_map(|c| c.get(k).copied()).collect();
        let all: Vec<Vec<f64>> = (0..count).map(row).collect();
        let there = |row: &Vec<f64>| row.first().is_some_and(|first| first.is_finite());
        Some(all.into_iter().filter(there).collect())
    };
    let mut recorded = Recorded::default();
    for direction in [Direction::Trace, Direction::Retrace]
        .into_iter()
        .take(directions)
    {
        let at = direction as usize;
        let flights: Option<Vec<Parachuting>> = rows("flight", &FLIGHT, at)?
            .into_iter()
            .map(|row| entry(&FLIGHT, row.into_iter(), json!({})))
            .collect();
        let stretches: Option<Vec<OffSetpoint>> = rows("off", &OFF, at)?
            .into_iter()
            .map(|row| entry(&OFF, row.into_iter(), json!({})))
            .collect();
        let more = json!({
            "line": line, "direction": direction, "y": y, "parachuting": flights?,
            "off_setpoint": stretches?,
        });
        let statistics = rows("line", &STATISTICS, at)?.into_iter().next()?;
        let statistics: LineStatistics = entry(&STATISTICS, statistics.into_iter(), more)?;
        for row in rows("jump", &JUMP, at)? {
            let more = json!({"line": line, "direction": direction});
            recorded.changes.push(entry(&JUMP, row.into_iter(), more)?);
        }
        let channel = |name: &str| part(name, at).map(<[f64]>::to_vec).unwrap_or_default();
        let states = part("state", at)?.iter().map(|code| state(*code)).collect();
        let pixels = PixelRow::read(channel, states);
        let sums = rows("sums", &SUMS, at)?.into_iter().next()?;
        let [at_range] = sums[..] else {
            return None;
        };
        recorded.lines.push(LineRecord {
            statistics,
            pixels,
            at_range: at_range as usize,
        });
    }
    Some(recorded)
}

fn schema(
    case: &Case,
    options: &ScanOptions,
    plan: &Plan,
    header: &ScanReport,
) -> Result<Schema, Error> {
    let ways: Vec<String> = ["trace", "retrace"]
        .into_iter()
        .take(1 + usize::from(plan.retrace))
        .map(Into::into)
        .collect();
    let mut variables: Vec<Variable> = CHANNELS
        .iter()
        .map(|channel| {
            let unit = match channel.unit() {
                "" => "1",
                unit => unit,
            };
            Variable::new(channel.name, Kind::Real, channel.title, unit).along("x", plan.pixels)
        })
        .collect();
    let words: Vec<Value> = STATES.iter().map(|state| json!(state)).collect();
    let words: Vec<&str> = words.iter().filter_map(Value::as_str).collect();
    let codes: Vec<usize> = (0..=STATES.len()).collect();
    let of_states = |variable: Variable| {
        variable
            .attribute("flag_values", json!(codes))
            .attribute("flag_meanings", format!("missing {}", words.join(" ")))
    };
    variables.push(of_states(
        Variable::new("state", Kind::Code, "which force governs the motion", "1")
            .along("x", plan.pixels),
    ));
    for (table, names, about) in [
        ("line", &STATISTICS[..], "of the line"),
        ("sums", &SUMS[..], "of the line"),
        ("flight", &FLIGHT[..], "of a flight above the surface"),
        ("off", &OFF[..], "of a stretch off the setpoint"),
        ("jump", &JUMP[..], "of a permanent change of the state"),
    ] {
        for (name, unit) in names {
            let about = format!("{} {about}", name.replace('_', " "));
            let variable = Variable::new(&named(table, name), Kind::Real, &about, unit);
            variables.push(match table {
                "line" | "sums" => variable,
                _ if *unit == STATE => of_states(variable.along(table, KEPT)),
                _ => variable.along(table, KEPT),
            });
        }
    }
    let mut all = attributes::of_case("scan of an image", ScanStudy::NAME, case);
    all.insert("options".into(), attributes::text(&options.over(case)?));
    all.insert(HEADER.into(), attributes::text(header));
    let y = (0..plan.lines)
        .map(|line| plan.line_position(line))
        .collect();
    Ok(Schema {
        grid: Grid {
            axes: vec![
                Axis::new("y", plan.lines, 1),
                Axis::new("direction", ways.len(), ways.len()),
            ],
        },
        variables,
        coordinates: vec![
            Coordinate::of("y", Values::Real(y), "position across the lines", "m"),
            Coordinate::of("direction", Values::Text(ways), "direction of the tip", "1"),
            Coordinate::of(
                "x",
                Values::Real(centres(plan.pixels, plan.size[0])),
                "position along the line",
                "m",
            ),
        ],
        attributes: all,
    })
}
