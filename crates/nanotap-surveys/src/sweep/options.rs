//! Options of a sweep.

use nanotap_case::physical::Remark;
use nanotap_dynamics::Control;

use super::{Follow, Over, Starts, Summary, Sweep};
use nanotap_case::Case;
use nanotap_case::state::WrittenState;
use nanotap_case::units::Units;
use nanotap_dataset::{Store, StoreError};
use nanotap_error::Error;
use nanotap_figures::Figure;
use nanotap_motions::attractors::MAX_STARTS;
use nanotap_study::DatasetPlan;
use nanotap_study::DatasetStudy;
use nanotap_study::limits::{MAX_PERIOD, MAX_PERIODS};
use nanotap_study::request::options;
use nanotap_study::target::Targets;
use nanotap_study::value::{Axes, Intervals};

options! {
    /// Options of a sweep.
    pub struct SweepOptions {
        /// Parameter and its values, as in omega=2:4:400 (first, last, count), alpha4=1:1000:50:log
        /// in equal ratios, or ascending values omega=2,2.5,4; modes too; for a physical case also
        /// drive.frequency=60kHz:80kHz:200, or drive.setpoint=0.5:0.9:9, for each of which the
        /// distance is solved; once or twice
        #[schemars(extend("x-value" = "KEY=VALUES", "x-required" = true))]
        pub over: Axes = Axes::default(),
        /// Quasi-random initial states at each value, spread over a box; default: rest alone
        #[schemars(range(min = 1, max = MAX_STARTS), extend("x-value" = "S"))]
        pub starts: Option<usize> = None,
        /// Seed of the initial states
        #[schemars(extend("x-value" = "K"))]
        pub seed: u64 = 1,
        /// Sides of the box, as in a1=-1:1 or v2=-4:4; other sides follow from the linear response
        /// to the drive
        #[serde(rename = "box")]
        #[schemars(extend("x-value" = "COORDINATE=LOW:HIGH"))]
        pub sides: Intervals = Intervals::default(),
        /// Start from this state at drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v), or some by name, as in
        /// tip=5nm; of a physical case in m and m/s, or with units
        #[schemars(extend("x-value" = "STATE"))]
        pub state: Option<WrittenState> = None,
        /// Start each value from the last state of the previous one, along the first parameter: up,
        /// down or both. An interrupted line is lost
        #[schemars(extend("x-value" = "WAY"))]
        pub follow: Follow = Follow::Off,
        /// Number of recorded drive periods
        #[schemars(range(min = 1, max = MAX_PERIODS), extend("x-value" = "P"))]
        pub periods: usize = 100,
        /// Number of last periods whose final states are kept; default: all recorded ones
        #[schemars(range(min = 0, max = MAX_PERIODS), extend("x-value" = "K"))]
        pub strobe: Option<usize> = None,
        /// Drive periods of the discarded transient; default: until the motion has settled
        #[schemars(range(min = 0, max = MAX_PERIODS), extend("x-value" = "T"))]
        pub transient: Option<usize> = None,
        /// Longest period of orbits, in drive periods
        #[schemars(range(min = 1, max = MAX_PERIOD), extend("x-value" = "N"))]
        pub max_period: usize = 64,
        /// Condition that every motion at a value must meet, as in "F_max < 1 nN",
        /// "regime = attractive", "states = 1"; several: all must hold
        #[serde(rename = "where")]
        #[schemars(extend("x-value" = "CONDITION"))]
        pub targets: Targets = Targets::default(),
    }
}

impl SweepOptions {
    /// Default options for parameters with their values, each as in `omega=2:4:400`.
    pub fn over<S: Into<String>>(axes: impl IntoIterator<Item = S>) -> Self {
        Self {
            over: Axes(axes.into_iter().map(Into::into).collect()),
            ..Self::default()
        }
    }

    /// Number of runs over these parameters.
    pub fn runs(&self, over: &[Over]) -> usize {
        let values = over.iter().map(|over| over.count).product::<usize>();
        values * self.starts.unwrap_or(1) * self.follow.directions().len().max(1)
    }

    /// Returns the initial states that the options request.
    pub(super) fn starts(&self, case: &Case) -> Result<Starts, Error> {
        match (self.starts, &self.state) {
            (Some(_), Some(_)) => Err(Error::input(
                "starts and state: the starts are drawn, or given",
                "leave {starts} or {state} out",
            )),
            (None, _) if self.sides != Intervals::default() => Err(Error::option(
                "box",
                "the sides are those of the starts",
                "say how many with {starts}",
            )),
            (Some(count), None) => Ok(Starts::Seeded {
                count,
                seed: self.seed,
                sides: self.sides.of_entries(&case.units())?,
            }),
            (None, Some(state)) => {
                let model = case.model()?;
                let state = state.of_case(case)?;
                Ok(Starts::Given(state.read(&model, &Units::Model)?))
            }
            (None, None) => Ok(Starts::Rest),
        }
    }

    /// States kept of each run.
    pub(super) fn strobe(&self) -> usize {
        self.strobe.unwrap_or(self.periods).min(self.periods)
    }
}

/// Runs over one or two parameters.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::control::Control;
/// use nanotap::dataset::{Share, Store, Work};
/// use nanotap::model::cantilever::Cantilever;
/// use nanotap::study::DatasetStudy as _;
/// use nanotap::study::sweep::{SweepOptions, SweepStudy};
///
/// let case = Case::from(Cantilever::paper());
/// let options = SweepOptions::over(["omega=2.5,3.0"]);
/// let plan = SweepStudy::plan(&case, &options, &Control::default())?;
/// let folder = std::env::temp_dir().join(format!("nanotap-sweep-{}", std::process::id()));
/// let store = Store::create_or_resume(&folder, plan.schema().clone())?;
/// let work = Work { share: Share::WHOLE, threads: 0, control: Control::default() };
/// plan.compute(&store, &work)?;
/// let summary = SweepStudy::report(&store)?;
/// // At Ω = 3 the motion repeats every drive period.
/// assert_eq!((summary.runs, summary.periods[&1] >= 1), (2, true));
/// # std::fs::remove_dir_all(&folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SweepStudy;

impl DatasetStudy for SweepStudy {
    const NAME: &'static str = "sweep";
    const ABOUT: &'static str = "Sweep one or two parameters, from any number of initial states";
    const COUNTED: &'static str = "values";
    type Options = SweepOptions;
    type Report = Summary;

    fn any_distance(options: &SweepOptions) -> bool {
        options.over.solves_distance()
    }

    fn remarks(report: &Summary) -> Vec<Remark> {
        Remark::notes(&report.notes)
    }

    fn prepare(
        case: &Case,
        options: &SweepOptions,
        control: &Control<'_>,
    ) -> Result<DatasetPlan, Error> {
        let sweep = Sweep::with_control(case, options.clone(), control)?;
        Ok(Box::new(sweep))
    }

    fn report(store: &Store) -> Result<Summary, StoreError> {
        Summary::of(store)
    }

    fn figure(store: &Store) -> Result<Figure, StoreError> {
        crate::figure::sweep::figure(store)
    }
}
