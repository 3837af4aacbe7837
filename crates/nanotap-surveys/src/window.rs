//! The operating window: where, over two parameters, the lever taps with one motion and no
//! other, and where a second state, subharmonics or chaos threaten.
//!
//! Every point has a census: motions from rest, from the linear responses and from
//! seeded starts of every size, each named as in a [sweep](crate::sweep), whose datasets,
//! chunks and resumption serve here too. Then come the states of a lever that is moved slowly,
//! coming from far and from the nearest distance ([`approach`](nanotap_motions::approach)), and the
//! orbits of each point are tried at its neighbours, until none gains one. What is found is
//! certain, what is not found is only not found: more starts see more.
//!
//! Of a case that leaves its distance to a setpoint all states at the setpoint are solved at each point
//! instead ([`setpoint_map`]).

use std::borrow::Cow;
use std::collections::BTreeMap;

use nanotap_dynamics::{Control, SameMotion};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Serialize;

use crate::setpoint_map::{self, SetpointMap, SetpointMapPlan};
use crate::sweep::{
    DISTANCE, FromNeighbour, Over, Starts, Sweep, SweepOptions, Unreached, class_of,
    from_neighbours, held, points, target_report, unreached,
};
use nanotap_case::physical::Held;
use nanotap_case::{Case, Key};
use nanotap_dataset::{Store, StoreError};
use nanotap_error::Error;
use nanotap_figures::Figure;
use nanotap_motions::attractors::MAX_STARTS;
use nanotap_motions::setpoint::at_setpoint;
use nanotap_motions::simulate::Classification;
use nanotap_observe::frame::{Frame, Rows, frame};
use nanotap_study::DatasetPlan;
use nanotap_study::DatasetStudy;
use nanotap_study::limits::MAX_PERIOD;
use nanotap_study::request::options;
use nanotap_study::target::{TargetPoint, TargetReport, Targets};
use nanotap_study::value::Axes;

/// Condition of the lever at one point, from the safest to the least safe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Condition {
    /// Only one motion, that repeats each drive period and does not touch.
    NoContact,
    /// Only one motion, that taps and repeats each drive period.
    OnePeriod1,
    /// Two or more motions that repeat each drive period.
    SecondState,
    /// A motion that repeats only after two or more drive periods.
    Subharmonic,
    /// A motion that does not repeat: chaotic or quasi-periodic.
    Irregular,
    /// Nothing of these, but a start whose motion could not be named.
    Undecided,
    /// No distance: the setpoint is not reached on approach.
    Unreached,
}

impl Condition {
    /// All of them, the safest first.
    pub const ALL: [Self; 7] = [
        Self::NoContact,
        Self::OnePeriod1,
        Self::SecondState,
        Self::Subharmonic,
        Self::Irregular,
        Self::Undecided,
        Self::Unreached,
    ];

    /// Returns the name in data, such as `no-contact`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoContact => "no-contact",
            Self::OnePeriod1 => "one-period-1",
            Self::SecondState => "second-state",
            Self::Subharmonic => "subharmonic",
            Self::Irregular => "irregular",
            Self::Undecided => "undecided",
            Self::Unreached => "setpoint-unreached",
        }
    }

    /// Returns the words for a legend, such as `no contact`.
    pub const fn words(self) -> &'static str {
        match self {
            Self::NoContact => "no contact",
            Self::OnePeriod1 => "one period-1 motion",
            Self::SecondState => "a second state",
            Self::Subharmonic => "subharmonic",
            Self::Irregular => "chaos or torus",
            Self::Undecided => "undecided",
            Self::Unreached => "setpoint not reached",
        }
    }
}

impl Serialize for Condition {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl JsonSchema for Condition {
    fn schema_name() -> Cow<'static, str> {
        "Condition".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"enum": Self::ALL.map(Self::name)})
    }
}

/// File of a window's dataset that states the condition at each point.
const FILE: &str = "window.json";

/// The operating window over two parameters.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Window {
    /// The parameters' keys, the first varies along a row.
    pub parameters: [String; 2],
    /// Values of the first parameter, in the unit of its key.
    pub x: Vec<f64>,
    /// Values of the second parameter, in the unit of its key.
    pub y: Vec<f64>,
    /// Condition at each point, row by row, one row for each value of the second parameter.
    pub conditions: Vec<Vec<Condition>>,
    /// Fraction of all points, 0 to 1, by condition. Every condition is listed,
    /// `setpoint-unreached` only over setpoints.
    pub shares: BTreeMap<&'static str, f64>,
    /// Quantities that stay constant while the parameters vary although the case does not state
    /// them, in SI.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub held: BTreeMap<String, f64>,
    /// Distance in m at each point, solved for the setpoint, row by row.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub distances: Vec<Vec<Option<f64>>>,
    /// Values at which the setpoint is not reached, with the reason.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unreached: Vec<Unreached>,
    /// The states at the setpoint of the case, if it leaves its distance to one; the conditions are then
    /// those of these states.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub setpoint: Option<SetpointMap>,
    /// Where the conditions of `where` hold.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub targets: Option<TargetReport>,
}

impl Window {
    /// Which part of the points has each condition.
    pub fn share_table(&self) -> Frame<'_> {
        let share = |condition: Condition| Some((condition, *self.shares.get(condition.name())?));
        let shares = Condition::ALL.into_iter().filter_map(share);
        frame! { Rows::new("shares", shares, None);
            "condition", "there is", Plain => |(condition, _)| condition.words();
            "share", "points", Percent(3) => |(_, share)| share;
        }
    }
}

/// One motion found from one start.
struct ReachedMotion {
    class: Option<Classification>,
    period: i32,
    amplitude: f64,
    maximum: f64,
    contact: f64,
}

impl From<&FromNeighbour> for ReachedMotion {
    fn from(motion: &FromNeighbour) -> Self {
        let repeats = motion.period > 0;
        Self {
            // What does not repeat is chaos or a torus: one condition.
            class: Some(if repeats {
                Classification::Periodic
            } else {
                Classification::Chaotic
            }),
            period: i32::try_from(motion.period).unwrap_or(i32::MAX),
            amplitude: motion.first_harmonic,
            maximum: motion.tip_max,
            contact: motion.contact_fraction,
        }
    }
}

impl Window {
    /// Evaluates the finished dataset of a sweep over two parameters.
    ///
    /// # Errors
    /// When a chunk is missing or damaged, or the dataset is no such sweep.
    pub fn of(store: &Store) -> Result<Self, StoreError> {
        store.require_all()?;
        let schema = store.schema();
        if setpoint_map::is_map(store) {
            let map = SetpointMap::of(store)?;
            let conditions = map.conditions(store)?;
            return Self::with(store, conditions, Vec::new(), Some(map));
        }
        if schema.grid.axes.len() != 3 {
            return Err(StoreError::NotAStore {
                path: store.path().into(),
                what: "not a sweep over two parameters".into(),
            });
        }
        let [rows, columns] = [0, 1].map(|axis| schema.grid.axes[axis].length);
        let mut seen: Vec<Vec<ReachedMotion>> = (0..rows * columns).map(|_| Vec::new()).collect();
        let variables = [
            "classification",
            "period",
            "first_harmonic",
            "tip_max",
            "contact_fraction",
        ];
        store.each(variables, |entry, row| {
            let [class, period, amplitude, maximum, contact] = row;
            seen[entry[0] * columns + entry[1]].push(ReachedMotion {
                class: class_of(class as u8),
                period: period as i32,
                amplitude,
                maximum,
                contact,
            });
        })?;
        for motion in from_neighbours(store)? {
            let point = motion.at[1] * columns + motion.at[0];
            if let Some(seen) = seen.get_mut(point) {
                seen.push(ReachedMotion::from(&motion));
            }
        }
        let mut distances = Vec::new();
        if schema.index_of(DISTANCE).is_some() {
            distances = vec![vec![None; columns]; rows];
            store.each([DISTANCE], |entry, [distance]| {
                distances[entry[0]][entry[1]] = distance.is_finite().then_some(distance);
            })?;
        }
        let reached = |k: usize| {
            let row = distances.get(k / columns);
            row.is_none_or(|row| row[k % columns].is_some())
        };
        let conditions: Vec<Condition> = seen
            .iter()
            .enumerate()
            .map(|(k, motions)| {
                if reached(k) {
                    condition(motions)
                } else {
                    Condition::Unreached
                }
            })
            .collect();
        let conditions: Vec<Vec<Condition>> = conditions
            .chunks(columns.max(1))
            .map(<[Condition]>::to_vec)
            .collect();
        Self::with(store, conditions, distances, None)
    }

    fn with(
        store: &Store,
        conditions: Vec<Vec<Condition>>,
        distances: Vec<Vec<Option<f64>>>,
        setpoint: Option<SetpointMap>,
    ) -> Result<Self, StoreError> {
        let schema = store.schema();
        let solves = setpoint.is_some() || !distances.is_empty();
        let all = || conditions.iter().flatten();
        let total = all().count();
        let shares = Condition::ALL
            .into_iter()
            .filter(|wanted| *wanted != Condition::Unreached || solves)
            .map(|wanted| {
                let count = all().filter(|c| **c == wanted).count();
                (wanted.name(), count as f64 / total as f64)
            })
            .collect();
        Ok(Self {
            parameters: [1, 0].map(|axis| schema.grid.axes[axis].name.clone()),
            x: schema.axis_values(1),
            y: schema.axis_values(0),
            shares,
            conditions,
            held: held(store),
            distances,
            unreached: unreached(store),
            setpoint,
            targets: target_report(store)?,
        })
    }

    /// Returns the motions found at each point of a finished dataset, row by row, as the conditions of
    /// `where` are evaluated on them.
    ///
    /// # Errors
    /// As [`Window::of`].
    pub fn motions(store: &Store) -> Result<Vec<TargetPoint>, StoreError> {
        store.require_all()?;
        if setpoint_map::is_map(store) {
            return setpoint_map::motions(store);
        }
        points(store)
    }

    /// Evaluates the dataset and stores the window with it in `window.json`.
    ///
    /// # Errors
    /// As [`Window::of`], and when the file system refuses.
    pub fn kept(store: &Store) -> Result<Self, StoreError> {
        let window = Self::of(store)?;
        let text = serde_json::to_string(&window).unwrap_or_default();
        store.write_beside(FILE, text.as_bytes())?;
        Ok(window)
    }
}

/// Returns the condition of a point by its motions. Motions that were found count before those that
/// could not be classified.
fn condition(motions: &[ReachedMotion]) -> Condition {
    let any = |wanted: &[Classification]| {
        motions
            .iter()
            .any(|m| m.class.is_some_and(|class| wanted.contains(&class)))
    };
    if any(&[Classification::Chaotic, Classification::QuasiPeriodic]) {
        return Condition::Irregular;
    }
    if motions.iter().any(|m| m.period > 1) {
        return Condition::Subharmonic;
    }
    let orbits: Vec<&ReachedMotion> = motions.iter().filter(|m| m.period == 1).collect();
    let differ = |a: &ReachedMotion, b: &ReachedMotion| {
        let same = SameMotion::numbers;
        !same(a.amplitude, b.amplitude) || !same(a.maximum, b.maximum)
    };
    if orbits
        .first()
        .is_some_and(|first| orbits.iter().any(|other| differ(first, other)))
    {
        return Condition::SecondState;
    }
    match orbits.first() {
        Some(_) if orbits.len() < motions.len() => Condition::Undecided,
        None => Condition::Undecided,
        Some(orbit) if orbit.contact > 0.0 => Condition::OnePeriod1,
        Some(_) => Condition::NoContact,
    }
}

options! {
    /// Options of an operating window.
    pub struct WindowOptions {
        /// Parameter and its values, as in gap.tip=5nm:25nm:41, drive.free_amplitude=10nm:60nm:26,
        /// omega=2:4:81, or ascending values omega=2,2.5,4; twice, first the horizontal axis. For
        /// drive.setpoint=0.5:0.9:9 the distance is solved at each point
        #[schemars(extend("x-value" = "KEY=VALUES", "x-required" = true))]
        pub over: Axes = Axes::default(),
        /// Initial states at each point: rest, the linear responses, and samples at all amplitudes
        #[schemars(range(min = 1, max = MAX_STARTS), extend("x-value" = "S"))]
        pub starts: usize = 16,
        /// Seed of the initial states
        #[schemars(extend("x-value" = "K"))]
        pub seed: u64 = 1,
        /// Longest period of orbits, in drive periods
        #[schemars(range(min = 1, max = MAX_PERIOD), extend("x-value" = "N"))]
        pub max_period: usize = 32,
        /// Condition that every motion found at a point must meet, as in "F_max < 1 nN",
        /// "regime = attractive", "states = 1"; several: all must hold
        #[serde(rename = "where")]
        #[schemars(extend("x-value" = "CONDITION"))]
        pub targets: Targets = Targets::default(),
    }
}

impl WindowOptions {
    /// The two parameters.
    fn parameters(&self, case: &Case) -> Result<[Over; 2], Error> {
        let over = self.over.parse(case)?;
        <[Over; 2]>::try_from(over).map_err(|over| {
            Error::input(
                format!("a window has two parameters, got {}", over.len()),
                "give {over} twice, as in {over} gap.tip=5nm:25nm:41 {over} drive.frequency=320kHz:340kHz:41",
            )
        })
    }

    /// The census at each point as a sweep.
    ///
    /// # Errors
    /// When there are not two parameters, and as for a sweep.
    pub fn sweep(&self, case: &Case, control: &Control<'_>) -> Result<Sweep, Error> {
        self.parameters(case)?;
        let options = SweepOptions {
            over: self.over.clone(),
            // What a motion is counts, not its course.
            periods: 1,
            max_period: self.max_period,
            targets: self.targets.clone(),
            ..SweepOptions::default()
        };
        let (count, seed) = (self.starts, self.seed);
        Sweep::from(case, options, Starts::Spread { count, seed }, control)
    }
}

/// The operating window.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::control::Control;
/// use nanotap::dataset::{Share, Store, Work};
/// use nanotap::model::cantilever::Cantilever;
/// use nanotap::study::DatasetStudy as _;
/// use nanotap::study::window::{WindowOptions, WindowStudy};
///
/// let case = Case::from(Cantilever::paper());
/// let over = serde_json::json!({"over": ["omega=2.95:3.05:2", "alpha4=19:20:2"], "starts": 4});
/// let options: WindowOptions = serde_json::from_value(over)?;
/// let plan = WindowStudy::plan(&case, &options, &Control::default())?;
/// let folder = std::env::temp_dir().join(format!("nanotap-window-{}", std::process::id()));
/// let store = Store::create_or_resume(&folder, plan.schema().clone())?;
/// let work = Work { share: Share::WHOLE, threads: 0, control: Control::default() };
/// plan.compute(&store, &work)?;
/// let window = WindowStudy::report(&store)?;
/// // One motion of period 1 is found at each of the four points.
/// assert_eq!(window.shares["one-period-1"], 1.0);
/// # std::fs::remove_dir_all(&folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct WindowStudy;

impl DatasetStudy for WindowStudy {
    const NAME: &'static str = "window";
    const ABOUT: &'static str = "The operating window over two parameters: where there is only \
                                 one motion, and where a second state, subharmonics or chaos \
                                 threaten";
    const COUNTED: &'static str = "values";
    // At a distance it leaves those of a sweep.
    const KIND: &'static str = setpoint_map::KIND;
    type Options = WindowOptions;
    type Report = Window;

    fn any_distance(_: &WindowOptions) -> bool {
        true
    }

    fn prepare(
        case: &Case,
        options: &WindowOptions,
        control: &Control<'_>,
    ) -> Result<DatasetPlan, Error> {
        let over = options.parameters(case)?;
        if !case.leaves_distance_to_setpoint() || options.over.solves_distance() {
            return Ok(Box::new(options.sweep(case, control)?));
        }
        let distance = |over: &Over| [Key::GapTip, case.gap_key()].contains(&over.key);
        let held = case.physical().and_then(|view| view.held);
        if over.iter().any(distance) || matches!(held, Some(Held::Shift(_))) {
            let (case, _) = at_setpoint(case.clone(), control)?;
            return Ok(Box::new(options.sweep(&case, control)?));
        }
        Ok(Box::new(SetpointMapPlan::new(case, options, over)?))
    }

    fn report(store: &Store) -> Result<Window, StoreError> {
        Window::kept(store)
    }

    fn figure(store: &Store) -> Result<Figure, StoreError> {
        crate::figure::window::figure(store)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reached(class: Classification, period: i32, amplitude: f64, contact: f64) -> ReachedMotion {
        ReachedMotion {
            class: Some(class),
            period,
            amplitude,
            maximum: amplitude,
            contact,
        }
    }

    #[test]
    fn what_threatens_most_is_named() {
        use Classification::{Chaotic, Periodic, QuasiPeriodic, Undecided};
        let free = || reached(Periodic, 1, 1.0, 0.0);
        let taps = || reached(Periodic, 1, 0.8, 0.1);
        for (motions, expected) in [
            (vec![free(), free()], Condition::NoContact),
            (vec![taps(), taps()], Condition::OnePeriod1),
            (vec![taps(), free()], Condition::SecondState),
            (
                vec![taps(), reached(Periodic, 2, 0.8, 0.1)],
                Condition::Subharmonic,
            ),
            (
                vec![free(), reached(Chaotic, 0, 0.8, 0.1)],
                Condition::Irregular,
            ),
            (
                vec![free(), reached(QuasiPeriodic, 0, 0.8, 0.1)],
                Condition::Irregular,
            ),
            (
                vec![taps(), reached(Undecided, 0, 0.0, 0.0)],
                Condition::Undecided,
            ),
            (
                vec![taps(), free(), reached(Undecided, 0, 0.0, 0.0)],
                Condition::SecondState,
            ),
            (vec![], Condition::Undecided),
        ] {
            assert_eq!(condition(&motions), expected);
        }
    }
}
