//! Basins of attraction on a two-dimensional slice of initial states.
//!
//! First the attractors: a census of quasi-random starts in the slice itself, or of
//! states that were given. Then every point of the slice is followed until it is inside
//! a neighbourhood that contracts to one of them ([`nanotap_dynamics::basin`], which says
//! what that proves and what is evidence only).
//!
//! The census is of starts in the slice; then a grid of 64 × 64 points of it is followed, and
//! where one comes to no motion of the census, what it comes to is added, until no point of the
//! grid is left. Motions whose basin in the slice is smaller still show as "unsettled".

use nanotap_dynamics::{
    Attractor, AttractorKind, BasinOptions as Budget, Basins, CensusOptions, ClassifyOptions,
    Control, Label, LyapunovOptions, Slice, SliceAxis, StartBox, StartBoxError, StroboscopicMap,
    Wall, census,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

use nanotap_case::Case;
use nanotap_case::state::WrittenState;
use nanotap_case::units::Units;
use nanotap_dataset::schema::Kind;
use nanotap_dataset::{
    Axis, Block, Coordinate, Grid, Schema, Store, StoreError, Values, Variable, Work, WorkError,
    attributes, chunk_files, work,
};
use nanotap_error::Error;
use nanotap_figures::Figure;
use nanotap_model::Model;
use nanotap_model::model_map::{ModelMap, together};
use nanotap_motions::attractors::MAX_STARTS;
use nanotap_motions::simulate::{Classification, starting_state};
use nanotap_observe::frame::{Frame, Rows, frame};
use nanotap_observe::time_series::state_names;
use nanotap_study::Computation;
use nanotap_study::DatasetPlan;
use nanotap_study::DatasetStudy;
use nanotap_study::limits::{MAX_PERIOD, MAX_PERIODS};
use nanotap_study::request::options;
use nanotap_study::start_box::before_wall;

/// Most points along an axis.
const MOST: usize = 1_000_000;
/// Most points of a slice.
const MAX_POINTS: usize = 4_000_000_000;
/// Points that a chunk should not exceed.
const CHUNK_POINTS: usize = 1 << 20;
/// Chunks that a large slice is cut into.
const CHUNKS: usize = 64;
/// Points along each axis of the grid on which motions that the census missed are looked for.
const COARSE: usize = 64;
/// Unsettled points of this grid that are classified at a time.
const STRANGERS: usize = 64;
/// ModelMap points by which an attractor is shown.
const SHOWN: usize = 512;
/// Labels of points that go to no attractor.
pub(crate) const UNSETTLED: i32 = -1;
pub(crate) const UNBOUNDED: i32 = -2;
pub(crate) const FAILED: i32 = -3;
/// Label of points at or behind the wall of the contact law.
pub(crate) const BEHIND: i32 = -4;
/// The computed variable, and the attribute with the list of attractors.
const VARIABLE: &str = "attractor";
const ATTRACTORS: &str = "attractors";
/// The attribute with the names of the entries of a state.
const ENTRIES: &str = "state_entries";

/// One axis of a slice: `a1=-1:1:200`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SliceRange {
    /// The name of the entry of the state.
    pub name: String,
    /// First value of the axis, in the model's units.
    pub from: f64,
    /// Last value of the axis, in the model's units.
    pub to: f64,
    /// Number of values, ends included.
    pub count: usize,
    /// The SI value of the model's unit; 1 of a dimensionless case.
    pub si: f64,
}

impl SliceRange {
    /// Reads `name=from:to:count`; a value without a unit is in SI if `units` are.
    ///
    /// # Errors
    /// When the text has another form, or the range is empty or not finite.
    pub fn parse(given: &str, units: &Units) -> Result<Self, Error> {
        let refuse = |what: String| {
            Error::input(
                format!("`{given}`: {what}"),
                "write a1=-1:1:200: entry, first value, last value, how many",
            )
        };
        let form =
            || refuse("write it as in a1=-1:1:200: name, first value, last value, count".into());
        let (name, range) = given.split_once('=').ok_or_else(form)?;
        let parts: Vec<&str> = range.split(':').map(str::trim).collect();
        let [from, to, count] = parts.as_slice() else {
            return Err(form());
        };
        let name = name.trim();
        let number = |text: &str| {
            let read = units.read_entry(name, text);
            read.map_err(refuse)
        };
        let (from, to) = (number(from)?, number(to)?);
        let count = count
            .parse()
            .map_err(|_| refuse(format!("`{count}` is not a whole number")))?;
        if !(2..=MOST).contains(&count) {
            return Err(refuse(format!(
                "{count} points; from 2 to {MOST} can be had"
            )));
        }
        if from >= to {
            let [from, to] = [from, to].map(|value| units.shown_entry(name, value, 6));
            return Err(refuse(format!(
                "from {from} to {to}; the last value must be greater"
            )));
        }
        Ok(Self {
            name: name.into(),
            from,
            to,
            count,
            si: units.of_entry(name).map_or(1.0, |(_, si)| si),
        })
    }

    fn axis(&self, names: &[String]) -> Result<SliceAxis, Error> {
        let coordinate = names.iter().position(|n| *n == self.name).ok_or_else(|| {
            axes(format!(
                "the state has no entry `{}`; there are {}",
                self.name,
                names.join(", ")
            ))
        })?;
        Ok(SliceAxis {
            coordinate,
            from: self.from,
            to: self.to,
            count: self.count,
        })
    }
}

/// An attractor of a basin dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BasinAttractor {
    /// Class of the motion: `periodic`, `quasi-periodic` or `chaotic`.
    pub classification: String,
    /// Minimal period in drive periods; `None` unless the motion is periodic.
    pub period: Option<usize>,
    /// Largest modulus of the Floquet multipliers, dimensionless; `None` unless the motion is
    /// periodic.
    pub multiplier: Option<f64>,
    /// Largest Lyapunov exponent per drive period; `None` of a periodic orbit.
    pub lyapunov: Option<f64>,
    /// States at drive phase 0: a whole orbit, or a stretch of another motion.
    pub states: Vec<Vec<f64>>,
}

/// Basins on a slice: prepared, ready to be computed chunk by chunk.
#[derive(Debug)]
pub struct Basin {
    model: Model,
    slice: Slice,
    /// Wall of the contact law; points behind it are not followed.
    wall: Option<Wall>,
    basins: Basins,
    schema: Schema,
    known: Vec<BasinAttractor>,
}

impl Basin {
    /// Checks the options and finds the attractors.
    ///
    /// # Errors
    /// When the options are invalid, no attractor is found, or the work was cancelled.
    pub fn new(case: &Case, options: &BasinOptions, control: &Control<'_>) -> Result<Self, Error> {
        for (what, number) in [
            ("0 starts", options.starts),
            ("0 periods a point", options.periods.unwrap_or(1)),
            ("0 as the longest period", options.max_period),
        ] {
            if number == 0 {
                return Err(axes(format!("{what}; at least 1 is needed")));
            }
        }
        if options.starts > MAX_STARTS {
            return Err(Error::input(
                format!(
                    "{} starts are too many; {MAX_STARTS} at most",
                    options.starts
                ),
                "give fewer {starts}",
            ));
        }
        let [x, y] = &options.axes(&case.units())?;
        if x.count.saturating_mul(y.count) > MAX_POINTS {
            return Err(axes(format!(
                "`{}`: {} by {} points; {MAX_POINTS} at most",
                x.name, x.count, y.count
            )));
        }
        let model = case.model()?;
        let names = state_names(&model);
        let rest = || vec![0.0; model.dimension()].into();
        let given = case.state_of(options.state.as_ref())?;
        let origin = starting_state(&model, Some(&given.unwrap_or_else(rest)))?;
        if x.name == y.name {
            return Err(axes(format!("both axes are `{}`", x.name)));
        }
        let slice = Slice::new(origin, x.axis(&names)?, y.axis(&names)?)?;
        let starts = match &options.attractors {
            Some(states) => {
                for state in states {
                    starting_state(&model, Some(&state.clone().into()))?;
                }
                states.clone()
            }
            None => starts_in(&slice, &model, options, control)?,
        };
        let wall = model.wall();
        let map = ModelMap::new(&model);
        let how = CensusOptions {
            classify: options.classify(),
            ..CensusOptions::default()
        };
        let found = census(&map, &starts, &how, control);
        if found.cancelled {
            return Err(Error::stopped());
        }
        if found.attractors.is_empty() {
            return Err(Error::numerics(format!(
                "no attractor was found: of {} starts {} left every bound, {} remained undecided{}",
                starts.len(),
                found.unbounded.count,
                found.undecided.len(),
                found
                    .undecided
                    .first()
                    .map_or(String::new(), |(_, reason)| format!(" ({reason})")),
            )));
        }
        let budget = |attractors: &[Attractor]| Budget {
            max_periods: options
                .periods
                .unwrap_or_else(|| enough_periods(attractors)),
            ..Budget::default()
        };
        let given = options.attractors.is_some();
        let mut attractors = found.attractors;
        let mut basins = Basins::new(&map, slice.clone(), &attractors, budget(&attractors))?;
        // Given states are the only attractors that points are assigned to.
        while !given && !control.is_cancelled() {
            let strangers = strangers(&map, &slice, wall.as_ref(), &basins);
            let taken = census(&map, &strangers, &how, control).attractors;
            let before = attractors.len();
            for attractor in taken {
                if !attractors
                    .iter()
                    .any(|a| a.kind.is_same_as(&attractor.kind))
                {
                    attractors.push(attractor);
                }
            }
            if attractors.len() == before {
                break;
            }
            basins = Basins::new(&map, slice.clone(), &attractors, budget(&attractors))?;
        }
        if control.is_cancelled() {
            return Err(Error::stopped());
        }
        let known: Vec<BasinAttractor> = attractors
            .iter()
            .map(|a| BasinAttractor::of(a, &mut map.clone()))
            .collect();
        let periods = budget(&attractors).max_periods;
        let schema = schema(case, (options, periods), [x, y], &names, &basins, &known);
        Ok(Self {
            model,
            slice,
            wall,
            basins,
            schema,
            known,
        })
    }

    /// The attractors; a label is an index into them.
    pub fn attractors(&self) -> &[BasinAttractor] {
        &self.known
    }

    /// Returns the number of points of the slice, the product of the counts of both axes.
    pub fn points(&self) -> usize {
        self.basins.len()
    }

    /// The map, whose motions end once `control` cancels the work.
    fn map(&self, control: &Control<'_>) -> ModelMap {
        ModelMap::new(&self.model.clone().cancelled_by(&control.flag()))
    }

    /// The labels of one row of the slice, as they are stored; `None` when it was stopped.
    fn row(
        &self,
        map: &ModelMap,
        block: &Block,
        item: usize,
        control: &Control<'_>,
    ) -> Option<Vec<i32>> {
        let length = self.schema.grid.axes[1].length;
        let y = block.ranges[0].start + item;
        let end = (y + 1) * length;
        let mut map = map.clone();
        let mut labels = Vec::with_capacity(length);
        // A row may take minutes: cancelled work does not wait for its end.
        for start in (y * length..end).step_by(UNSTOPPED) {
            if control.is_cancelled() {
                return None;
            }
            let range = start..end.min(start + UNSTOPPED);
            labels.append(&mut self.labels(&mut map, range));
        }
        // The map may have ended the last of them.
        (!control.is_cancelled()).then_some(labels)
    }
}

impl Basin {
    /// The labels of a range of points, as they are stored.
    fn labels(&self, map: &mut ModelMap, range: std::ops::Range<usize>) -> Vec<i32> {
        let mut labels = vec![BEHIND; range.len()];
        let mut state = vec![0.0; map.dimension()];
        let points: Vec<usize> = range
            .clone()
            .filter(|&point| is_before(&self.slice, self.wall.as_ref(), point, &mut state))
            .collect();
        let followed = self.basins.labels(map, &points);
        for (point, label) in points.into_iter().zip(followed) {
            labels[point - range.start] = number(label);
        }
        labels
    }
}

/// Whether a point of a slice is in front of the wall of the law, if there is one; `state` is
/// overwritten.
fn is_before(slice: &Slice, wall: Option<&Wall>, point: usize, state: &mut [f64]) -> bool {
    let Some(wall) = wall else { return true };
    slice.state(point, state);
    wall.is_before(state)
}

impl Computation for Basin {
    fn schema(&self) -> &Schema {
        &self.schema
    }

    fn compute(&self, store: &Store, how: &Work<'_>) -> Result<(), WorkError> {
        let map = self.map(&how.control);
        work(
            store,
            how,
            rows,
            |block, item| self.row(&map, block, item, &how.control),
            |_, rows| columns(&rows),
        )
    }

    fn chunk_files(&self, chunk: usize, control: &Control<'_>) -> Option<Vec<Vec<u8>>> {
        let grid = &self.schema.grid;
        let block = (chunk < grid.chunks()).then(|| grid.block(chunk))?;
        let map = self.map(control);
        let labels = (0..rows(&block))
            .map(|item| self.row(&map, &block, item, control))
            .collect::<Option<Vec<_>>>()?;
        Some(chunk_files(&self.schema, &block, &columns(&labels)))
    }
}

/// Number of points of a row between two checks for cancellation.
const UNSTOPPED: usize = 64;

/// Rows of the slice in a chunk.
fn rows(block: &Block) -> usize {
    block.ranges[0].len()
}

fn columns(rows: &[Vec<i32>]) -> Vec<Values> {
    vec![Values::Whole(rows.concat())]
}

/// States among a coarse grid of the slice that come to none of the attractors.
fn strangers(map: &ModelMap, slice: &Slice, wall: Option<&Wall>, basins: &Basins) -> Vec<Vec<f64>> {
    let mut state = vec![0.0; map.dimension()];
    let (x, y) = slice.axes();
    let some = |count: usize| {
        let many = COARSE.min(count);
        (0..many).map(move |k| (2 * k + 1) * count / (2 * many))
    };
    let points: Vec<usize> = some(y.count)
        .flat_map(|row| some(x.count).map(move |column| row * x.count + column))
        .filter(|&point| is_before(slice, wall, point, &mut state))
        .collect();
    let labels: Vec<Vec<Label>> = points
        .par_chunks(together(map, points.len()))
        .map_init(|| map.clone(), |map, points| basins.labels(map, points))
        .collect();
    points
        .into_iter()
        .zip(labels.into_iter().flatten())
        .filter(|(_, label)| *label == Label::Unsettled)
        .take(STRANGERS)
        .map(|(index, _)| {
            let mut state = vec![0.0; map.dimension()];
            slice.state(index, &mut state);
            state
        })
        .collect()
}

/// Quasi-random starts in the slice, in front of the wall of the law.
fn starts_in(
    slice: &Slice,
    model: &Model,
    options: &BasinOptions,
    control: &Control<'_>,
) -> Result<Vec<Vec<f64>>, Error> {
    // The first point has the least values along both axes, the last the greatest.
    let mut lower = vec![0.0; model.dimension()];
    let mut upper = lower.clone();
    slice.state(0, &mut lower);
    slice.state(slice.len() - 1, &mut upper);
    let sides = StartBox::new(lower, upper).and_then(|sides| before_wall(model, sides));
    let sides = sides.map_err(|error| {
        axes(match error {
            StartBoxError::BehindWall => "the whole slice lies behind the surface".to_owned(),
            error => error.to_string(),
        })
    })?;
    Ok(sides.starts_until(options.seed, options.starts, control))
}

/// Drive periods a point is followed at least and at most, unless the options say how many.
const PERIODS: [usize; 2] = [1000, 100_000];
/// Factor by which disturbances of the slowest orbit die in this time: from the size of a slice to that of
/// the neighbourhood in which the orbit is certain to attract.
const DECAY: f64 = 1e-10;

/// The drive periods in which disturbances of these attractors' orbits die.
fn enough_periods(attractors: &[Attractor]) -> usize {
    let slowest = attractors
        .iter()
        .filter_map(|attractor| match &attractor.kind {
            AttractorKind::Periodic(orbit) => {
                let rate = -nanotap_arithmetic::ln(orbit.spectral_radius()) / orbit.period as f64;
                Some(-nanotap_arithmetic::ln(DECAY) / rate)
            }
            _ => None,
        });
    let longest = slowest.filter(|periods| *periods > 0.0).fold(0.0, f64::max);
    let [least, most] = PERIODS;
    (longest.min(most as f64) as usize).max(least)
}

impl BasinAttractor {
    fn of(attractor: &Attractor, map: &mut ModelMap) -> Self {
        let spectrum = |s: &nanotap_dynamics::LyapunovSpectrum| Some(s.largest().0);
        match &attractor.kind {
            AttractorKind::Periodic(orbit) => Self {
                classification: Classification::Periodic.name().into(),
                period: Some(orbit.period),
                multiplier: Some(orbit.spectral_radius()),
                lyapunov: None,
                states: orbit.states.clone(),
            },
            AttractorKind::QuasiPeriodic(torus) => Self {
                classification: Classification::QuasiPeriodic.name().into(),
                period: None,
                multiplier: None,
                lyapunov: spectrum(&torus.spectrum),
                states: stretch(map, &attractor.state),
            },
            AttractorKind::Chaotic { spectrum: s, .. } => Self {
                classification: Classification::Chaotic.name().into(),
                period: None,
                multiplier: None,
                lyapunov: spectrum(s),
                states: stretch(map, &attractor.state),
            },
        }
    }

    /// Name of the attractor: `period 4`, `chaotic`.
    pub fn name(&self) -> String {
        self.period
            .map_or_else(|| self.classification.clone(), |n| format!("period {n}"))
    }
}

/// Returns states at drive phase 0 along a motion, one for each period.
fn stretch(map: &mut ModelMap, start: &[f64]) -> Vec<Vec<f64>> {
    let mut state = start.to_vec();
    let mut states = Vec::new();
    while states.len() < SHOWN && map.advance(&mut state).is_ok() {
        states.push(state.clone());
    }
    states
}

fn number(label: Label) -> i32 {
    match label {
        Label::Attractor(index) => i32::try_from(index).unwrap_or(UNSETTLED),
        Label::Unsettled => UNSETTLED,
        Label::Unbounded => UNBOUNDED,
        Label::Failed => FAILED,
    }
}

fn schema(
    case: &Case,
    (options, periods): (&BasinOptions, usize),
    [x, y]: [&SliceRange; 2],
    names: &[String],
    basins: &Basins,
    known: &[BasinAttractor],
) -> Schema {
    let rows = (basins.len().div_ceil(CHUNKS)).min(CHUNK_POINTS) / x.count;
    let grid = Grid {
        axes: vec![
            Axis::new(&y.name, y.count, rows),
            Axis::new(&x.name, x.count, x.count),
        ],
    };
    let mut all = attributes::of_case(
        &format!("basins over {} and {}", x.name, y.name),
        "basin",
        case,
    );
    all.insert(ATTRACTORS.into(), attributes::text(&known));
    all.insert(ENTRIES.into(), names.join(" ").into());
    all.insert("seed".into(), json!(options.seed));
    let recipe = json!({
        "x": x,
        "y": y,
        "state": options.state,
        "given": options.attractors,
        "starts": options.starts,
        "seed": options.seed,
        "periods": periods,
        "max_period": options.max_period,
    });
    all.insert("basin".into(), attributes::text(&recipe));
    let units = case.units();
    let coordinate = |range: &SliceRange| {
        let axis = SliceAxis {
            coordinate: 0,
            from: range.from,
            to: range.to,
            count: range.count,
        };
        let values = (0..range.count).map(|k| range.si * axis.value(k));
        let unit = units.of_entry(&range.name);
        Coordinate::of(
            &range.name,
            Values::Real(values.collect()),
            "initial value of this entry of the state",
            unit.map_or("model units", |(kind, _)| kind.si_unit()),
        )
    };
    let comment = "index into the attribute `attractors` (JSON); -1: none within the periods, \
                   -2: left every bound, -3: could not be followed, -4: behind the surface, where the \
                   contact law does not hold";
    Schema {
        grid,
        variables: vec![
            Variable::new(
                VARIABLE,
                Kind::Whole,
                "attractor that the start goes to",
                "1",
            )
            .attribute("comment", comment),
        ],
        coordinates: vec![coordinate(y), coordinate(x)],
        attributes: all,
    }
}

/// Fractions of a slice by attractor.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Shares {
    /// Number of points of the slice.
    pub points: usize,
    /// The attractors, each with its fraction of the points.
    pub attractors: Vec<AttractorShare>,
    /// Fraction of the points that reached no attractor within the periods, 0 to 1.
    pub unsettled: f64,
    /// Fraction of the points whose motion is unbounded, 0 to 1.
    pub unbounded: f64,
    /// Fraction of the points that could not be computed, 0 to 1.
    pub failed: f64,
    /// Fraction of the points that lie behind the surface, at or behind a pole of the contact law or
    /// the first row of its table, 0 to 1; they are not followed.
    pub behind: f64,
}

impl Shares {
    /// Which part of the slice goes where.
    pub fn share_table(&self) -> Frame<'_> {
        let attractors = self.attractors.iter().enumerate();
        let attractors = attractors.map(|(k, one)| match one.period {
            Some(period) => (Some(k + 1), format!("period {period}"), one.fraction),
            None => (Some(k + 1), one.classification.clone(), one.fraction),
        });
        let others = [
            ("none within the periods", self.unsettled),
            ("left every bound", self.unbounded),
            ("could not be followed", self.failed),
            ("behind the surface", self.behind),
        ];
        let others = others.into_iter().filter(|(_, part)| *part > 0.0);
        let others = others.map(|(name, part)| (None, name.to_owned(), part));
        frame! { Rows::new("shares", attractors.chain(others), None);
            "number", "", Plain => |(number, ..)| number;
            "attractor", "attractor", Plain => |(_, name, _)| name;
            "fraction", "starts", Percent(4) => |(.., part)| part;
        }
    }
}

/// An attractor and its fraction of a slice.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AttractorShare {
    /// Class of the motion: `periodic`, `quasi-periodic` or `chaotic`.
    pub classification: String,
    /// Minimal period in drive periods; `None` unless the motion is periodic.
    pub period: Option<usize>,
    /// State on the attractor at drive phase 0, in the model's units. Its entries are a_1 … a_N (or
    /// x), their rates, then any memory of the sample.
    pub state: Vec<f64>,
    /// Fraction of the points of the slice that reaches the attractor, 0 to 1.
    pub fraction: f64,
}

/// The attractors that a dataset of basins holds.
pub(crate) fn known(store: &Store) -> Result<Vec<BasinAttractor>, StoreError> {
    let text = store
        .schema()
        .attributes
        .get(ATTRACTORS)
        .and_then(|v| v.as_str());
    text.and_then(|text| serde_json::from_str(text).ok())
        .ok_or_else(|| StoreError::NotAStore {
            path: store.path().into(),
            what: "it holds no basins".into(),
        })
}

/// Reads the labels of a block's points: the index of the attractor, or a negative code where none
/// is known.
pub(crate) fn labels(store: &Store, block: &Block) -> Result<Vec<i32>, StoreError> {
    match store.read_chunk(block, 0)? {
        Values::Whole(labels) => Ok(labels),
        _ => Err(StoreError::NotAStore {
            path: store.path().into(),
            what: "it holds no basins".into(),
        }),
    }
}

/// Computes the fractions of a finished dataset.
///
/// # Errors
/// When a chunk is missing or damaged.
pub fn shares(store: &Store) -> Result<Shares, StoreError> {
    store.require_all()?;
    let known = known(store)?;
    let mut counts = vec![0usize; known.len()];
    let [mut unsettled, mut unbounded, mut failed, mut behind] = [0usize; 4];
    for chunk in 0..store.chunks() {
        for label in labels(store, &store.schema().grid.block(chunk))? {
            match usize::try_from(label).ok().and_then(|k| counts.get_mut(k)) {
                Some(count) => *count += 1,
                None if label == UNBOUNDED => unbounded += 1,
                None if label == FAILED => failed += 1,
                None if label == BEHIND => behind += 1,
                None => unsettled += 1,
            }
        }
    }
    let points = store.schema().grid.entries();
    let part = |count: usize| count as f64 / points as f64;
    let attractors = known
        .into_iter()
        .zip(counts)
        .map(|(attractor, count)| AttractorShare {
            classification: attractor.classification,
            period: attractor.period,
            state: attractor.states.into_iter().next().unwrap_or_default(),
            fraction: part(count),
        })
        .collect();
    Ok(Shares {
        points,
        attractors,
        unsettled: part(unsettled),
        unbounded: part(unbounded),
        failed: part(failed),
        behind: part(behind),
    })
}

/// The names of a state's entries.
pub(crate) fn entries(store: &Store) -> Vec<String> {
    let text = store
        .schema()
        .attributes
        .get(ENTRIES)
        .and_then(|v| v.as_str())
        .unwrap_or_default();
    text.split(' ').map(Into::into).collect()
}

options! {
    /// Options of basins of attraction.
    pub struct BasinOptions {
        /// Horizontal axis, as in a1=-1:1:200: entry of the state (a1…aN, v1…vN; oscillator: x, v),
        /// first value, last value, count
        #[schemars(extend("x-value" = "ENTRY=FROM:TO:COUNT", "x-required" = true))]
        pub x: String = String::new(),
        /// Vertical axis, in the same form
        #[schemars(extend("x-value" = "ENTRY=FROM:TO:COUNT", "x-required" = true))]
        pub y: String = String::new(),
        /// State with the other entries: a1,…,aN,v1,…,vN, or some by name, as in
        /// tip=5nm; of a physical case in m and m/s, or with units; default: 0
        #[schemars(extend("x-value" = "STATE"))]
        pub state: Option<WrittenState> = None,
        /// States on the attractors, or the result of a census; default: a census in the slice
        #[schemars(extend("x-own" = true))]
        pub attractors: Option<Vec<Vec<f64>>> = None,
        /// Initial states of the census
        #[schemars(range(min = 1, max = MAX_STARTS), extend("x-value" = "S"))]
        pub starts: usize = 64,
        /// Seed of the census
        #[schemars(extend("x-value" = "K"))]
        pub seed: u64 = 1,
        /// Drive periods after which a point counts as unsettled; default: enough for the orbit whose
        /// disturbances die slowest, 1000 at least
        #[schemars(range(min = 1, max = MAX_PERIODS), extend("x-value" = "P"))]
        pub periods: Option<usize> = None,
        /// Longest period of orbits, in drive periods
        #[schemars(range(min = 1, max = MAX_PERIOD), extend("x-value" = "N"))]
        pub max_period: usize = 64,
    }
}

impl BasinOptions {
    /// Default options on the slice of two axes, each as in `a1=-1:1:200`.
    pub fn over(x: &str, y: &str) -> Self {
        Self {
            x: x.to_owned(),
            y: y.to_owned(),
            ..Self::default()
        }
    }

    /// The two axes of the slice.
    ///
    /// # Errors
    /// When one is not valid.
    pub fn axes(&self, units: &Units) -> Result<[SliceRange; 2], Error> {
        let axis =
            |option, given: &str| SliceRange::parse(given, units).map_err(|error| error.at(option));
        Ok([axis("x", &self.x)?, axis("y", &self.y)?])
    }

    fn classify(&self) -> ClassifyOptions {
        ClassifyOptions {
            max_period: self.max_period,
            lyapunov: LyapunovOptions {
                max_periods: 5000,
                ..LyapunovOptions::default()
            },
            ..ClassifyOptions::default()
        }
    }
}

/// An error that other axes would remove.
fn axes(message: String) -> Error {
    Error::input(message, "change {x} or {y}")
}

/// Basins of attraction.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::control::Control;
/// use nanotap::dataset::{Share, Store, Work};
/// use nanotap::model::cantilever::Cantilever;
/// use nanotap::study::DatasetStudy as _;
/// use nanotap::study::basin::{BasinOptions, BasinStudy};
///
/// let case = Case::from(Cantilever { alpha1: 0.0, omega: 20.0, ..Cantilever::paper() });
/// let options = BasinOptions::over("a1=-1:1:8", "v1=-20:20:8");
/// let plan = BasinStudy::plan(&case, &options, &Control::default())?;
/// let folder = std::env::temp_dir().join(format!("nanotap-basin-{}", std::process::id()));
/// let store = Store::create_or_resume(&folder, plan.schema().clone())?;
/// let work = Work { share: Share::WHOLE, threads: 0, control: Control::default() };
/// plan.compute(&store, &work)?;
/// let shares = BasinStudy::report(&store)?;
/// // Each of the two motions is reached from a part of the slice.
/// assert_eq!(shares.points, 64);
/// assert!(shares.attractors.iter().filter(|one| one.fraction > 0.1).count() == 2);
/// # std::fs::remove_dir_all(&folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct BasinStudy;

impl DatasetStudy for BasinStudy {
    const NAME: &'static str = "basin";
    const ABOUT: &'static str =
        "Compute basins of attraction on a two-dimensional slice of initial states";
    const COUNTED: &'static str = "rows";
    const PLANNED: &'static str = "starts of the census";
    type Options = BasinOptions;
    type Report = Shares;

    fn prepare(
        case: &Case,
        options: &BasinOptions,
        control: &Control<'_>,
    ) -> Result<DatasetPlan, Error> {
        Ok(Box::new(Basin::new(case, options, control)?))
    }

    fn report(store: &Store) -> Result<Shares, StoreError> {
        shares(store)
    }

    fn figure(store: &Store) -> Result<Figure, StoreError> {
        crate::figure::basin::figure(store)
    }
}
