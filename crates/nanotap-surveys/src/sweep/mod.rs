//! Sweeps: how the motion changes with one or two parameters, from any number of starts.
//!
//! Every value of the parameters is a separate case. From each start the motion is
//! [classified](nanotap_dynamics::classify()), named, and recorded: per-period extrema of the
//! tip deflection, stroboscopic states, observables, multipliers or exponents. Nothing
//! depends on the order of work or the number of threads.
//!
//! **Starts.** Rest, one given state, or seeded quasi-random states in a box: the user's,
//! or the one that fits the case at each value ([`nanotap_study::start_box`]). The k-th start is the same
//! point of the box at every value.
//!
//! **Transients.** Sized by what is measured: [`classify`](nanotap_dynamics::classify()) runs
//! until it can name the motion. If that is a stable orbit, closed by Newton and seen to
//! be approached, the recording is of the orbit itself, as if the rest of the decay had
//! been waited for. A number of periods may be given instead; then exactly that many
//! are discarded, and what follows is recorded.
//!
//! **Following.** With [`Follow`], the motion at one value starts from the last state at
//! the value before, up or down the first parameter: hysteresis shows. Then a whole line
//! of values is one piece of work, which is lost when it is interrupted; there are as many
//! pieces as directions × starts × values of the second parameter.
//!
//! Fails: budgets are those of one of very many runs ([`SweepOptions`]): chaos that
//! lasts for a couple of thousand periods is called chaotic, and a torus that needs more
//! to show itself undecided. A census decides more carefully.

mod check;
mod dataset;
mod distances;
mod follow;
mod neighbours;
mod options;
mod run;
mod summary;

pub(crate) use check::corners;
pub(crate) use dataset::{DISTANCE, HELD, class_of, parameter};
pub use follow::Follow;
pub use nanotap_study::over::{Over, Spacing};
pub use neighbours::{FromNeighbour, from_neighbours};
pub use options::{SweepOptions, SweepStudy};
pub use run::Starts;
pub use summary::Summary;
pub use summary::Unreached;
pub(crate) use summary::{held, points, target_report, unreached, write_targets};

use distances::Distances;
use nanotap_dynamics::Control;

use nanotap_case::physical::drive::FIRST;
use nanotap_case::units::Units;
use nanotap_case::{Case, Key};
use nanotap_dataset::{Block, Schema, Store, Work, WorkError, chunk_files, work};
use nanotap_error::Error;
use nanotap_study::Computation;
use nanotap_study::target::Target;
use nanotap_study::threads::install;

/// The runs of a sweep.
#[derive(Clone, Debug)]
pub(crate) struct Runs {
    case: Case,
    options: SweepOptions,
    over: Vec<Over>,
    starts: Starts,
    /// The distances of a sweep over setpoints.
    distances: Option<Distances>,
}

/// A sweep that was checked: ready to be computed, chunk by chunk.
#[derive(Clone, Debug)]
pub struct Sweep {
    runs: Runs,
    schema: Schema,
    /// Conditions that are evaluated once all is finished.
    targets: Vec<Target>,
}

impl Sweep {
    /// Checks that the options are valid for `case`.
    ///
    /// # Errors
    /// When a parameter or a start is not valid, or there is too much of something.
    pub fn new(case: &Case, options: SweepOptions) -> Result<Self, Error> {
        Self::with_control(case, options, &Control::default())
    }

    /// The same; `control` cancels the search for the distances of setpoints.
    ///
    /// # Errors
    /// As [`Sweep::new`], and when it was cancelled.
    pub fn with_control(
        case: &Case,
        options: SweepOptions,
        control: &Control<'_>,
    ) -> Result<Self, Error> {
        let starts = options.starts(case)?;
        Self::from(case, options, starts, control)
    }

    /// Makes the sweep with other initial states than those of the options.
    pub(crate) fn from(
        case: &Case,
        options: SweepOptions,
        starts: Starts,
        control: &Control<'_>,
    ) -> Result<Self, Error> {
        let over = options.over.parse(case)?;
        check::check(case, &options, &over, &starts)?;
        let targets = options
            .targets
            .parse(matches!(case.units(), Units::Si(_)))?;
        check::targets(&targets, &starts)?;
        let distances = distances::solved(case, &over, control)?;
        // What the case says of a parameter that varies does not matter, and must not
        // make two datasets differ.
        let apply = |case: Case, over: &Over| over.apply(&case, 0);
        let runs = Runs {
            case: over.iter().fold(case.clone(), apply),
            options,
            over,
            starts,
            distances,
        };
        let schema = dataset::schema(&runs)?;
        Ok(Self {
            runs,
            schema,
            targets,
        })
    }

    /// Returns the options with which the sweep was made.
    pub fn options(&self) -> &SweepOptions {
        &self.runs.options
    }

    /// Returns the parameters with their values; motions are followed along the first.
    pub fn over(&self) -> &[Over] {
        &self.runs.over
    }

    /// Returns the number of runs, one for each entry of the grid.
    pub fn runs(&self) -> usize {
        self.schema.grid.entries()
    }
}

impl Runs {
    /// Returns the runs with motions that end once `control` cancels the work.
    fn cancelled_by(&self, control: &Control<'_>) -> Self {
        Self {
            case: self.case.cancelled_by(control),
            ..self.clone()
        }
    }

    /// Pieces of work in a chunk: values, or the whole line that is followed.
    fn items(&self, block: &Block) -> usize {
        if self.options.follow == Follow::Off {
            block.ranges[self.axis()].len()
        } else {
            1
        }
    }

    fn item(
        &self,
        block: &Block,
        item: usize,
        cancelled: &impl Fn() -> bool,
    ) -> Option<Vec<run::Outcome>> {
        let outcomes = if self.options.follow == Follow::Off {
            run::at_value(self, block, item, cancelled)
        } else {
            run::along_line(self, block, cancelled)
        };
        // The map may have ended a run that was under way.
        outcomes.filter(|_| !cancelled())
    }

    /// The axis of the grid along which the first parameter varies.
    fn axis(&self) -> usize {
        self.over.len() - 1
    }

    /// Number of the values of an entry of the grid, the first parameter fastest.
    fn index(&self, entry: &[usize]) -> usize {
        let axis = self.axis();
        let second = if axis > 0 { entry[0] } else { 0 };
        entry[axis] + self.over[0].count * second
    }

    /// The case with the values of this number; `None` where its setpoint is not reached.
    fn case_of(&self, index: usize) -> Option<Case> {
        let columns = self.over[0].count;
        let steps = self.over.iter().zip([index % columns, index / columns]);
        let case = steps.fold(self.case.clone(), |case, (over, index)| {
            over.apply(&case, index)
        });
        let Some(distances) = &self.distances else {
            return Some(case);
        };
        let reached = distances.get(index)?.as_ref().ok()?;
        let mut case = case.with(Key::GapTip, reached.zc);
        if let (Some(drive), Some(view)) = (reached.drive, self.case.physical()) {
            let strength = view.strength_key(FIRST);
            case = case
                .with(Key::DriveFrequency, drive.frequency)
                .with(strength, drive.strength);
        }
        Some(case.starting_from(&reached.state))
    }

    /// The distance with the values of this number, solved for a setpoint, in m; otherwise NaN.
    fn distance(&self, index: usize) -> f64 {
        let reached = self.distances.as_ref().and_then(|all| all.get(index));
        reached.map_or(f64::NAN, |reached| {
            reached.as_ref().map_or(f64::NAN, |reached| reached.zc)
        })
    }
}

impl Computation for Sweep {
    fn schema(&self) -> &Schema {
        &self.schema
    }

    /// Computes the missing chunks; once all are there, the orbits found are tried at the
    /// neighbouring values ([`from_neighbours`]).
    fn compute(&self, store: &Store, how: &Work<'_>) -> Result<(), WorkError> {
        let runs = self.runs.cancelled_by(&how.control);
        let cancelled = || how.control.is_cancelled();
        work(
            store,
            how,
            |block| runs.items(block),
            |block, item| runs.item(block, item, &cancelled),
            |_, items| dataset::columns(&self.schema, &items.concat()),
        )?;
        if store.missing() > 0 {
            return Ok(());
        }
        summary::write_targets(store, &self.targets)?;
        let threads = Some(how.threads).filter(|threads| *threads > 0);
        install(threads, || runs.share(store, &how.control))
            .map_err(|error| WorkError::Failed(Box::new(error)))?
    }

    fn chunk_files(&self, chunk: usize, control: &Control<'_>) -> Option<Vec<Vec<u8>>> {
        let runs = self.runs.cancelled_by(control);
        let grid = &self.schema.grid;
        let block = (chunk < grid.chunks()).then(|| grid.block(chunk))?;
        let items = (0..runs.items(&block))
            .map(|item| runs.item(&block, item, &|| control.is_cancelled()))
            .collect::<Option<Vec<_>>>()?;
        let columns = dataset::columns(&self.schema, &items.concat());
        Some(chunk_files(&self.schema, &block, &columns))
    }
}
