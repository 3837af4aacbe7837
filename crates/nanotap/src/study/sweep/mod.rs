//! Sweeps: how the motion changes with one or two parameters, from any number of starts.
//!
//! Every value of the parameters is a case of its own. From each start the motion is
//! [classified](nanotap_dynamics::classify()), named, and recorded: per-period extrema of the
//! tip deflection, stroboscopic states, observables, multipliers or exponents. Nothing
//! depends on the order of work or the number of threads.
//!
//! **Starts.** Rest, one given state, or seeded quasi-random states in a box: the user's,
//! or the one that fits the case at each value ([`crate::study::start_box`]). The k-th start is the same
//! point of the box at every value.
//!
//! **Transients.** Sized by what is measured: [`classify`](nanotap_dynamics::classify()) runs
//! until it can name the motion. If that is a stable orbit, closed by Newton and seen to
//! be approached, the recording is of the orbit itself, as if the rest of the decay had
//! been waited for. A number of periods may be asked for instead; then exactly that many
//! are thrown away, and what follows is recorded as it is.
//!
//! **Following.** With [`Follow`], the motion at one value starts from the last state at
//! the value before, up or down the first parameter: hysteresis shows. Then a whole line
//! of values is one piece of work, which is lost when it is interrupted; there are as many
//! pieces as directions × starts × values of the second parameter.
//!
//! Fails: budgets are those of one of very many runs ([`SweepOptions::classify`]): chaos that
//! lasts for a couple of thousand periods is called chaotic, and a torus that needs more
//! to show itself undecided. A census decides more carefully.

mod dataset;
mod error;
mod follow;
mod motions;
mod neighbours;
mod over;
mod request;
mod run;
mod summary;

pub use error::SweepError;
pub use follow::Follow;
pub(crate) use motions::{Motions, class_of};
pub use neighbours::{FromNeighbour, from_neighbours};
pub use over::{Over, OverError, Spacing};
pub use request::{SweepRequest, SweepStudy};
pub use run::Starts;
pub use summary::Summary;

use nanotap_dynamics::{ClassifyOptions, Control, LyapunovOptions};

use crate::case::Case;
use crate::dataset::{
    Block, Schema, Store, StoreError, Values, Work, WorkError, chunk_files, work,
};
use crate::study::recipe::Computation;
use crate::study::threads::install;

/// How to sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepOptions {
    /// One or two parameters; a line of the first is what is followed.
    pub over: Vec<Over>,
    /// Where motions start.
    pub starts: Starts,
    /// Whether each value starts from the last state of the one before.
    pub follow: Follow,
    /// Drive periods recorded.
    pub periods: usize,
    /// States at the end of how many of the last periods to keep.
    pub strobe: usize,
    /// Drive periods thrown away first; `None`: as many as the motion is measured to need.
    pub transient: Option<usize>,
    /// Longest period looked for.
    pub max_period: usize,
}

impl SweepOptions {
    /// Sweeps over `over` from rest, 100 periods recorded.
    pub fn new(over: Vec<Over>) -> Self {
        Self {
            over,
            starts: Starts::Rest,
            follow: Follow::Off,
            periods: 100,
            strobe: 100,
            transient: None,
            max_period: 64,
        }
    }

    /// The budgets of each run: a tenth of what one run alone would be given.
    pub fn classify(&self) -> ClassifyOptions {
        ClassifyOptions {
            max_period: self.max_period,
            max_transient: 512,
            lyapunov: LyapunovOptions {
                alignment: 50,
                min_periods: 250,
                max_periods: 2000,
                absolute_error: 5e-3,
                relative_error: 0.1,
            },
            birkhoff_periods: 2048,
            torus_digits: 6.0,
            ..ClassifyOptions::default()
        }
    }
}

/// A sweep that was checked: ready to be computed, chunk by chunk.
#[derive(Clone, Debug)]
pub struct Sweep {
    case: Case,
    options: SweepOptions,
    schema: Schema,
}

impl Sweep {
    /// Checks that the options make sense for `case`.
    ///
    /// # Errors
    /// [`SweepError`] with what was given and what would be right.
    pub fn new(case: Case, options: SweepOptions) -> Result<Self, SweepError> {
        error::check(&case, &options)?;
        // What the case says of a parameter that varies does not matter, and must not
        // make two datasets differ.
        let case = options
            .over
            .iter()
            .fold(case, |case, over| over.apply(&case, 0));
        let schema = dataset::schema(&case, &options)?;
        Ok(Self {
            case,
            options,
            schema,
        })
    }

    /// The same sweep from other starts.
    ///
    /// # Errors
    /// As [`Sweep::new`].
    pub fn from(self, starts: Starts) -> Result<Self, SweepError> {
        let options = SweepOptions {
            starts,
            ..self.options
        };
        Self::new(self.case, options)
    }

    /// What its dataset holds.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// The options.
    pub fn options(&self) -> &SweepOptions {
        &self.options
    }

    /// Number of runs.
    pub fn runs(&self) -> usize {
        self.schema.grid.entries()
    }

    /// Computes the chunks that `store`, made for [`schema`](Self::schema), still lacks; once
    /// all are there, the orbits found are tried at the neighbouring values
    /// ([`from_neighbours`]).
    ///
    /// # Errors
    /// When the work was stopped (what is finished stays), or the store refuses.
    pub fn compute(&self, store: &Store, how: &Work<'_>) -> Result<(), WorkError> {
        let sweep = self.cancelled_by(&how.control);
        let cancelled = || how.control.is_cancelled();
        work(
            store,
            how,
            |block| sweep.items(block),
            |block, item| sweep.item(block, item, &cancelled),
            |_, items| sweep.columns(&items),
        )?;
        if store.missing() > 0 {
            return Ok(());
        }
        let threads = Some(how.threads).filter(|threads| *threads > 0);
        install(threads, || sweep.share(store, &how.control))
            .map_err(|error| WorkError::Threads(Box::new(error)))?
    }

    /// The files of one chunk, computed on this thread: the same bytes wherever that is.
    /// `None` when it was stopped, and for a chunk that there is not.
    pub fn chunk_files(&self, chunk: usize, control: &Control<'_>) -> Option<Vec<Vec<u8>>> {
        let sweep = self.cancelled_by(control);
        let grid = &self.schema.grid;
        let block = (chunk < grid.chunks()).then(|| grid.block(chunk))?;
        let items = (0..self.items(&block))
            .map(|item| sweep.item(&block, item, &|| control.is_cancelled()))
            .collect::<Option<Vec<_>>>()?;
        Some(chunk_files(&self.schema, &block, &self.columns(&items)))
    }

    /// The same, whose motions end once `control` cancels the work.
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

    fn columns(&self, items: &[Vec<run::Outcome>]) -> Vec<Values> {
        dataset::columns(&self.schema, &items.concat())
    }

    /// The axis of the grid along which the first parameter varies.
    fn axis(&self) -> usize {
        self.options.over.len() - 1
    }

    /// The case at an entry of the grid.
    fn subject_at(&self, entry: &[usize]) -> Case {
        let axis = self.axis();
        self.options
            .over
            .iter()
            .enumerate()
            .fold(self.case.clone(), |case, (k, over)| {
                // The first parameter varies fastest.
                over.apply(&case, entry[axis - k])
            })
    }
}

impl Computation for Sweep {
    fn schema(&self) -> &Schema {
        self.schema()
    }

    fn compute(&self, store: &Store, how: &Work<'_>) -> Result<(), WorkError> {
        self.compute(store, how)
    }

    fn chunk_files(&self, chunk: usize, control: &Control<'_>) -> Option<Vec<Vec<u8>>> {
        self.chunk_files(chunk, control)
    }
}

/// How many runs of the finished dataset came to what.
///
/// # Errors
/// When a chunk is missing or damaged.
pub fn summary(store: &Store) -> Result<Summary, StoreError> {
    Summary::of(store)
}
