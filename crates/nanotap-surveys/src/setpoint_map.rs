//! The states at a held setpoint over two parameters: where an image can show a false step.
//!
//! At each point all states at the setpoint are solved ([`states_at_setpoint`]). Where several coexist,
//! a feedback loop holds the setpoint at several distances, and a lever that changes its state between
//! two pixels shows their difference as a step of the surface. A point is computed on its own: nothing
//! depends on its neighbours, on threads or on the order of the work.

use std::collections::BTreeMap;

use nanotap_dynamics::Control;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::json;

use crate::sweep::{HELD, Over, corners, parameter, write_targets};
use crate::window::{Condition, WindowOptions};
use nanotap_case::physical::Kind as QuantityKind;
use nanotap_case::{Case, Key};
use nanotap_dataset::schema::Kind;
use nanotap_dataset::{
    Axis, Block, Coordinate, Grid, Schema, Store, StoreError, Values, Variable, Work, WorkError,
    attributes, chunk_files, work,
};
use nanotap_error::Error;
use nanotap_motions::setpoint::{
    SetpointSolution, SetpointStates, StateSearch, Undecided, states_at_setpoint,
};
use nanotap_observe::frame::{Cell, Frame, Row as _, Rows, frame, rows};
use nanotap_observe::{ObservableSet, Observables};
use nanotap_study::Computation;
use nanotap_study::target::{Target, TargetMotion, TargetPoint};

/// Kind of the datasets.
pub const KIND: &str = "setpoint-map";

rows! {
    in si_unit
    /// The states at the setpoint at a point.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
    pub struct SetpointPoint {
        /// Number of states at the setpoint; at least so many where the point is undecided.
        pub states: usize = Count, "number of states at the setpoint", "states", Plain,
        /// Distance between tip and sample in the attractive state, the farthest of several, m.
        pub attractive_distance: Option<f64> = Length, "distance in the attractive state", "attractive zc", Prefixed(5),
        /// Phase lag in this state, degrees.
        pub attractive_phase: Option<f64> = Angle, "phase lag in the attractive state", "attractive phase", Digits(4),
        /// Distance between tip and sample in the repulsive state, the farthest of several, m.
        pub repulsive_distance: Option<f64> = Length, "distance in the repulsive state", "repulsive zc", Prefixed(5),
        /// Phase lag in this state, degrees.
        pub repulsive_phase: Option<f64> = Angle, "phase lag in the repulsive state", "repulsive phase", Digits(4),
        /// Largest difference in distance between two of the states, m: the height of a false step.
        pub step_height: Option<f64> = Length, "height of the false step", "false step", Prefixed(4),
        /// Why other states may be missing: `budget`, `not-periodic`, `not-followed`, `unclassified-start` or
        /// `no-model`; `null` where all are decided.
        pub undecided: Option<&'static str>,
    }
}

/// Regimes of the states, in the order of the columns.
const REGIMES: [&str; 2] = ["attractive", "repulsive"];
/// Dimension of the regimes.
const REGIME: &str = "regime";
/// Names of the columns that are no numbers of SI.
const STATES: &str = "states";
const UNDECIDED: &str = "undecided";
const PERIOD: &str = "period";

/// The states at one point, as they are stored.
#[derive(Clone, Debug)]
struct PointStates {
    point: SetpointPoint,
    /// Period and observables in SI of the states of both regimes.
    shown: [Option<(usize, Observables)>; 2],
}

impl PointStates {
    fn of(found: &SetpointStates) -> Self {
        // From far to near.
        let states = &found.states;
        let first = |regime: &str| states.iter().find(|state| state.branch == regime);
        let [attractive, repulsive] = REGIMES.map(first);
        let distance = |state: Option<&SetpointSolution>| state.map(|state| state.zc);
        let phase = |state: Option<&SetpointSolution>| state.map(|s| s.observables.phase);
        let ends = states.first().zip(states.last());
        Self {
            point: SetpointPoint {
                states: states.len(),
                attractive_distance: distance(attractive),
                attractive_phase: phase(attractive),
                repulsive_distance: distance(repulsive),
                repulsive_phase: phase(repulsive),
                step_height: ends
                    .filter(|_| states.len() > 1)
                    .map(|(far, near)| far.zc - near.zc),
                undecided: found.undecided.map(Undecided::name),
            },
            shown: [attractive, repulsive]
                .map(|state| state.map(|state| (state.period, state.physical.observables))),
        }
    }
}

/// The map, checked and ready to be computed chunk by chunk.
#[derive(Debug)]
pub(crate) struct SetpointMapPlan {
    case: Case,
    over: [Over; 2],
    search: StateSearch,
    schema: Schema,
    targets: Vec<Target>,
}

impl SetpointMapPlan {
    /// Checks that the options are valid for a case at a setpoint.
    pub(crate) fn new(
        case: &Case,
        options: &WindowOptions,
        over: [Over; 2],
    ) -> Result<Self, Error> {
        corners(case, &over)?;
        let count = over[0].count.saturating_mul(over[1].count);
        if count > MAX_POINTS {
            return Err(Error::input(
                format!("{count} points are too many; {MAX_POINTS} at most"),
                "change {over}",
            ));
        }
        let targets = options.targets.parse(true)?;
        let search = StateSearch {
            starts: options.starts,
            seed: options.seed,
            max_period: options.max_period,
        };
        // What the case says of a parameter that varies must not make two datasets differ.
        let first = over
            .iter()
            .fold(case.clone(), |case, over| over.apply(&case, 0));
        let case = first.leaving_distance_as(case);
        let schema = schema(&case, &over, &search);
        Ok(Self {
            case,
            over,
            search,
            schema,
            targets,
        })
    }

    /// The states at the point with the `item`-th entry of a block; `None` if it was cancelled.
    fn item(&self, block: &Block, item: usize, control: &Control<'_>) -> Option<PointStates> {
        let [y, x] = [0, 1].map(|axis| &block.ranges[axis]);
        let (row, column) = (y.start + item / x.len(), x.start + item % x.len());
        let case = self.over[1].apply(&self.over[0].apply(&self.case, column), row);
        let case = case.leaving_distance_as(&self.case);
        let quiet = Control {
            progress: None,
            ..*control
        };
        let case = case.cancelled_by(control);
        let found = states_at_setpoint(&case, &self.search, &quiet);
        if control.is_cancelled() {
            return None;
        }
        let none = |_| SetpointStates {
            states: Vec::new(),
            undecided: Some(Undecided::NoModel),
        };
        Some(PointStates::of(&found.unwrap_or_else(none)))
    }
}

impl Computation for SetpointMapPlan {
    fn schema(&self) -> &Schema {
        &self.schema
    }

    fn compute(&self, store: &Store, how: &Work<'_>) -> Result<(), WorkError> {
        work(
            store,
            how,
            points_of,
            |block, item| self.item(block, item, &how.control),
            |_, points| columns(&self.schema, &points),
        )?;
        if store.missing() == 0 {
            write_targets(store, &self.targets)?;
        }
        Ok(())
    }

    fn chunk_files(&self, chunk: usize, control: &Control<'_>) -> Option<Vec<Vec<u8>>> {
        let grid = &self.schema.grid;
        let block = (chunk < grid.chunks()).then(|| grid.block(chunk))?;
        let points = (0..points_of(&block))
            .map(|item| self.item(&block, item, control))
            .collect::<Option<Vec<_>>>()?;
        let columns = columns(&self.schema, &points);
        Some(chunk_files(&self.schema, &block, &columns))
    }
}

fn points_of(block: &Block) -> usize {
    block.ranges.iter().map(ExactSizeIterator::len).product()
}

/// Most points of a map.
const MAX_POINTS: usize = 1_000_000;
/// Most points of a chunk: what an interruption loses at most.
const CHUNK_POINTS: usize = 16;

fn schema(case: &Case, over: &[Over; 2], search: &StateSearch) -> Schema {
    let [x, y] = over;
    let grid = Grid {
        axes: vec![
            Axis::new(y.key.path(), y.count, 1),
            Axis::new(x.key.path(), x.count, x.count.min(CHUNK_POINTS)),
        ],
    };
    let mut variables: Vec<Variable> = SetpointPoint::COLUMNS
        .iter()
        .map(|column| match column.name {
            STATES => Variable::new(column.name, Kind::Whole, column.label, "1"),
            name => Variable::new(name, Kind::Real, column.label, column.dimension.si_unit()),
        })
        .collect();
    let reasons = Undecided::ALL.map(Undecided::name).join(" ");
    let flags: Vec<usize> = (0..=Undecided::ALL.len() + 1).collect();
    variables.push(
        Variable::new(UNDECIDED, Kind::Code, "why states may be missing", "1")
            .attribute("flag_values", json!(flags))
            .attribute("flag_meanings", format!("missing decided {reasons}")),
    );
    variables.push(
        Variable::new(
            PERIOD,
            Kind::Whole,
            "period, 0 without a state",
            "drive periods",
        )
        .along(REGIME, REGIMES.len()),
    );
    variables.extend(ObservableSet::COMMON.iter().map(|o| {
        Variable::new(o.name, Kind::Real, o.words, o.dimension.si_unit())
            .along(REGIME, REGIMES.len())
    }));
    let regimes = REGIMES.map(str::to_owned).to_vec();
    let mut coordinates: Vec<Coordinate> = over.iter().map(parameter).collect();
    coordinates.push(Coordinate::of(
        REGIME,
        Values::Text(regimes),
        "sign of the mean force",
        "1",
    ));
    let title = format!(
        "states at the setpoint over {} and {}",
        x.key.path(),
        y.key.path()
    );
    let mut all = attributes::of_case(&title, KIND, case);
    let recipe = json!({
        "over": over,
        "starts": search.starts,
        "max_period": search.max_period,
    });
    all.insert("window".into(), attributes::text(&recipe));
    all.insert("seed".into(), json!(search.seed));
    let [x_key, y_key] = over.each_ref().map(|over| over.key);
    let held = case.held(&[x_key, y_key, Key::DriveSetpoint]);
    if !held.is_empty() {
        all.insert(HELD.into(), attributes::text(&held));
    }
    Schema {
        grid,
        variables,
        coordinates,
        attributes: all,
    }
}

/// The columns of a chunk, in the order of the schema's variables.
fn columns(schema: &Schema, points: &[PointStates]) -> Vec<Values> {
    let whole = |value: usize| i32::try_from(value).unwrap_or(i32::MAX);
    let shown = || points.iter().flat_map(|point| &point.shown);
    let of_variable = |variable: &Variable| match variable.name.as_str() {
        STATES => Values::Whole(points.iter().map(|p| whole(p.point.states)).collect()),
        UNDECIDED => Values::Code(points.iter().map(|p| code(p.point.undecided)).collect()),
        PERIOD => Values::Whole(
            shown()
                .map(|state| state.as_ref().map_or(0, |(period, _)| whole(*period)))
                .collect(),
        ),
        name => {
            let column = SetpointPoint::COLUMNS.iter().find(|c| c.name == name);
            Values::Real(column.map_or_else(
                || {
                    shown()
                        .map(|state| observed(name, state.as_ref()))
                        .collect()
                },
                |column| {
                    let number = |p: &PointStates| column.number(&p.point).unwrap_or(f64::NAN);
                    points.iter().map(number).collect()
                },
            ))
        }
    };
    schema.variables.iter().map(of_variable).collect()
}

fn observed(name: &str, state: Option<&(usize, Observables)>) -> f64 {
    let observable = ObservableSet::COMMON.iter().find(|o| o.name == name);
    let value = observable
        .zip(state)
        .and_then(|(o, (_, seen))| (o.of)(seen).number());
    value.unwrap_or(f64::NAN)
}

/// The code of a reason; 1 where all is decided.
fn code(undecided: Option<&str>) -> u8 {
    let place = undecided.and_then(|name| Undecided::ALL.iter().position(|u| u.name() == name));
    place.map_or(1, |k| k as u8 + 2)
}

/// Whether a dataset is a map of states at a setpoint.
pub(crate) fn is_map(store: &Store) -> bool {
    let kind = store.schema().attributes.get("kind");
    kind.and_then(|kind| kind.as_str()) == Some(KIND)
}

/// The states at a setpoint over two parameters.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SetpointMap {
    /// The states at each point, row by row, one row for each value of the second parameter.
    pub points: Vec<Vec<SetpointPoint>>,
    /// Fraction of all points at which two or more states are at the setpoint, 0 to 1.
    pub false_steps: f64,
    /// Least and greatest height of a false step, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m"))]
    pub step_heights: Option<[f64; 2]>,
    /// Values of each parameter between which all false steps are, in the unit of its key.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub ranges: Vec<[f64; 2]>,
    /// Number of points at which states may be missing, and why.
    pub undecided: BTreeMap<&'static str, usize>,
    /// The result, in a sentence.
    pub verdict: String,
}

impl SetpointMap {
    /// Reads a finished dataset.
    ///
    /// # Errors
    /// When a chunk is missing or damaged.
    pub(crate) fn of(store: &Store) -> Result<Self, StoreError> {
        let schema = store.schema();
        let [rows, columns] = [0, 1].map(|axis| schema.grid.axes[axis].length);
        let mut points = vec![vec![SetpointPoint::default(); columns]; rows];
        let names = [
            STATES,
            "attractive_distance",
            "attractive_phase",
            "repulsive_distance",
            "repulsive_phase",
            "step_height",
            UNDECIDED,
        ];
        store.each(names, |entry, [states, az, ap, rz, rp, step, undecided]| {
            let some = |value: f64| value.is_finite().then_some(value);
            let reason = (undecided as usize).checked_sub(2);
            points[entry[0]][entry[1]] = SetpointPoint {
                states: states as usize,
                attractive_distance: some(az),
                attractive_phase: some(ap),
                repulsive_distance: some(rz),
                repulsive_phase: some(rp),
                step_height: some(step),
                undecided: reason.and_then(|k| Some(Undecided::ALL.get(k)?.name())),
            };
        })?;
        let all = || points.iter().flatten();
        let heights: Vec<f64> = all().filter_map(|point| point.step_height).collect();
        let range = |values: &[f64]| {
            let ends = [f64::min, f64::max].map(|f| values.iter().copied().reduce(f));
            Some([ends[0]?, ends[1]?])
        };
        let stepped = |row: usize, column: usize| points[row][column].step_height.is_some();
        let along_x = schema.axis_values(1).into_iter().enumerate();
        let along_x = along_x.filter(|(column, _)| (0..rows).any(|row| stepped(row, *column)));
        let along_y = schema.axis_values(0).into_iter().enumerate();
        let along_y = along_y.filter(|(row, _)| (0..columns).any(|column| stepped(*row, column)));
        let ranges = [
            along_x.map(|(_, value)| value).collect::<Vec<_>>(),
            along_y.map(|(_, value)| value).collect(),
        ];
        let mut undecided = BTreeMap::new();
        for reason in all().filter_map(|point| point.undecided) {
            *undecided.entry(reason).or_default() += 1;
        }
        let mut map = Self {
            false_steps: heights.len() as f64 / (rows * columns).max(1) as f64,
            step_heights: range(&heights),
            ranges: ranges.iter().filter_map(|values| range(values)).collect(),
            undecided,
            verdict: String::new(),
            points,
        };
        map.verdict = map.sentence(schema);
        Ok(map)
    }

    fn sentence(&self, schema: &Schema) -> String {
        let count = self.points.iter().map(Vec::len).sum::<usize>();
        let missing: usize = self.undecided.values().sum();
        let undecided = if missing == 0 {
            String::new()
        } else {
            let reasons = Undecided::ALL.iter().filter_map(|reason| {
                let count = self.undecided.get(reason.name())?;
                Some(format!("{count}: {}", reason.words()))
            });
            format!(
                "; of {count} points {missing} are undecided ({})",
                reasons.collect::<Vec<_>>().join("; ")
            )
        };
        let Some([low, high]) = self.step_heights else {
            return format!("no two states at the setpoint were found{undecided}");
        };
        let shown = |length: f64| QuantityKind::Length.format_digits(length, 3);
        let heights = if shown(low) == shown(high) {
            shown(low)
        } else {
            format!("{} to {}", shown(low), shown(high))
        };
        let sides = self
            .ranges
            .iter()
            .zip([1, 0])
            .filter_map(|([low, high], axis)| {
                let name = &schema.grid.axes[axis].name;
                let values = schema.axis_values(axis);
                let units = schema.coordinate(name)?.attributes.get("units")?.as_str()?;
                let kind = QuantityKind::of_si_unit(units).unwrap_or(QuantityKind::Number);
                let text = |value: f64| kind.format_digits(value, 4);
                let is_end = |value: f64, end: Option<&f64>| end.is_some_and(|end| *end == value);
                match (is_end(*low, values.first()), is_end(*high, values.last())) {
                    (true, true) => None,
                    (false, true) => Some(format!("{name} from {}", text(*low))),
                    (true, false) => Some(format!("{name} up to {}", text(*high))),
                    (false, false) => {
                        Some(format!("{name} from {} to {}", text(*low), text(*high)))
                    }
                }
            });
        let sides: Vec<String> = sides.collect();
        let sides = match &sides[..] {
            [] => String::new(),
            sides => format!(", all at {}", sides.join(" and ")),
        };
        format!(
            "a false step of {heights} is possible at {} % of the points{sides}{undecided}",
            nanotap_quantity::number::significant(100.0 * self.false_steps, 3)
        )
    }

    /// The states at each point.
    pub fn point_table(&self) -> Frame<'_> {
        let points = self.points.iter().enumerate();
        let points = points.flat_map(|(row, points)| {
            let points = points.iter().enumerate();
            points.map(move |(column, point)| (column, row, point))
        });
        let reason = |point: &SetpointPoint| {
            let reason = Undecided::ALL
                .iter()
                .find(|u| Some(u.name()) == point.undecided);
            reason.map_or("", |reason| reason.words())
        };
        frame! { Rows::new("points", points, None);
            "column", "column", Plain => |(column, _, _)| column;
            "row", "row", Plain => |(_, row, _)| row;
            .fields(|(_, _, point)| Some(point));
            "undecided", "undecided", Plain => move |(_, _, point)| Cell::Word(reason(point).to_owned());
        }
    }

    /// The condition of the lever at each point, by the states at the setpoint.
    pub(crate) fn conditions(&self, store: &Store) -> Result<Vec<Vec<Condition>>, StoreError> {
        let motions = motions(store)?;
        let width = self.points.first().map_or(1, Vec::len).max(1);
        let at = |row: usize, column: usize, point: &SetpointPoint| {
            let motions = &motions[row * width + column].motions;
            if motions.iter().any(|motion| motion.period > 1) {
                return Condition::Subharmonic;
            }
            match (point.states, point.undecided, motions.first()) {
                (2.., _, _) => Condition::SecondState,
                (_, Some(_), _) => Condition::Undecided,
                (_, None, Some(one)) if one.named("contact_fraction") > 0.0 => {
                    Condition::OnePeriod1
                }
                (_, None, Some(_)) => Condition::NoContact,
                (_, None, None) => Condition::Unreached,
            }
        };
        let rows = self.points.iter().enumerate();
        Ok(rows
            .map(|(row, points)| {
                let points = points.iter().enumerate();
                points.map(|(k, point)| at(row, k, point)).collect()
            })
            .collect())
    }
}

/// The states at the setpoint at each point, row by row, as conditions are evaluated on them.
pub(crate) fn motions(store: &Store) -> Result<Vec<TargetPoint>, StoreError> {
    let schema = store.schema();
    let columns = schema.grid.axes[1].length;
    let mut points = vec![TargetPoint::default(); schema.grid.axes[0].length * columns];
    let names: Vec<&str> = [PERIOD]
        .into_iter()
        .chain(ObservableSet::COMMON.iter().map(|o| o.name))
        .collect();
    for chunk in 0..store.chunks() {
        let block = schema.grid.block(chunk);
        let column = |name: &&str| match schema.index_of(name) {
            Some(index) => Ok(store.read_chunk(&block, index)?.numbers()),
            None => Ok(Vec::new()),
        };
        let values = names
            .iter()
            .map(column)
            .collect::<Result<Vec<_>, StoreError>>()?;
        for (flat, entry) in block.entries().enumerate() {
            for regime in 0..REGIMES.len() {
                let value = |k: usize| {
                    let value = values[k].get(flat * REGIMES.len() + regime);
                    value.copied().unwrap_or(f64::NAN)
                };
                if value(0) > 0.0 {
                    points[entry[0] * columns + entry[1]]
                        .motions
                        .push(TargetMotion {
                            period: value(0) as usize,
                            values: (1..names.len()).map(value).collect(),
                        });
                }
            }
        }
    }
    store.each([STATES, UNDECIDED], |entry, [states, undecided]| {
        let point = &mut points[entry[0] * columns + entry[1]];
        // A state of a regime that has two is not shown.
        point.unknown = undecided != 1.0 || states as usize > point.motions.len();
    })?;
    Ok(points)
}
