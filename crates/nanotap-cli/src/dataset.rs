//! Datasets at the terminal: destination, computation, report.

use std::path::{Path, PathBuf};

use std::time::Instant;

use clap::Args;
use nanotap::case::Case;
use nanotap::dataset::{Share, Store, StoreError, Work, WorkError, finish, table};
use nanotap::study::{Computation, DatasetStudy};
use nanotap_figures::Figure;
use serde::Serialize;

use crate::arguments::PlotArgument;
use crate::failure::Failure;
use crate::file;
use crate::output::Output;
use crate::threads::ThreadsArgument;
use crate::{number, progress, style};

/// Where a dataset goes, and which part of it is computed here.
#[derive(Args, Clone, Debug)]
pub(crate) struct DatasetArguments {
    /// The dataset: a folder with extension .zarr, which xarray.open_zarr opens; with .csv, also a
    /// table with a row per start, next to the folder. Default: a name derived from the case. An
    /// unfinished dataset is continued
    #[arg(long, value_name = "PATH")]
    pub(crate) out: Option<PathBuf>,

    /// Compute only one of n shares, as in 2/8; `nanotap merge` merges the shares
    #[arg(long, value_name = "I/N", default_value_t = Share::WHOLE, hide_default_value = true)]
    pub(crate) chunk: Share,

    #[command(flatten)]
    pub(crate) threads: ThreadsArgument,
}

/// Paths of a dataset and of its table.
pub(crate) struct Destination {
    /// Folder of the dataset, with extension .zarr.
    pub(crate) store: PathBuf,
    /// Path of the CSV table; `None` if none was requested.
    pub(crate) table: Option<PathBuf>,
}

impl DatasetArguments {
    /// Resolves the destination: as given, or `derived`.zarr. Pictures and tables need every chunk,
    /// which a share does not have.
    pub(crate) fn destination(
        &self,
        derived: &str,
        plot: Option<&Path>,
    ) -> Result<Destination, Failure> {
        let destination = match &self.out {
            None => Destination {
                store: PathBuf::from(format!("{derived}.zarr")),
                table: None,
            },
            Some(path) if file::ending(path, &["zarr", "csv"])? == "zarr" => Destination {
                store: path.clone(),
                table: None,
            },
            Some(path) => Destination {
                store: {
                    file::claim(path, &["csv"])?;
                    path.with_extension("zarr")
                },
                table: Some(path.clone()),
            },
        };
        if !self.chunk.is_whole() && (plot.is_some() || destination.table.is_some()) {
            return Err(Failure::input(
                format!(
                    "--chunk {} computes a share; a picture or a table needs all",
                    self.chunk
                ),
                "merge the shares, then give the same command without --chunk and with --out MERGED.zarr",
            ));
        }
        Ok(destination)
    }

    /// Plans the dataset of a study, computes it into a new or an unfinished store, and summarises
    /// it. `derived` names the store unless the arguments do, `noun` is the name of the items in
    /// the progress.
    #[expect(clippy::too_many_arguments, reason = "what three commands share")]
    pub(crate) fn run<S: DatasetStudy>(
        &self,
        case: &Case,
        options: &S::Options,
        derived: &str,
        noun: &'static str,
        seed: u64,
        plot: &PlotArgument,
        figure: impl FnOnce(&Store) -> Result<Figure, StoreError>,
        output: &Output,
    ) -> Result<DatasetReport<S::Report>, Failure>
    where
        S::Options: Sync,
    {
        let begun = Instant::now();
        let destination = self.destination(derived, plot.plot.as_deref())?;
        plot.check()?;
        let plan = progress::watched(S::NAME, S::PLANNED, false, |control| {
            self.threads.install(|| S::plan(case, options, control))
        })??;
        let store = self.compute(&destination.store, &*plan, [S::NAME, noun], output)?;
        let missing = store.missing();
        let summary = (missing == 0).then(|| S::report(&store)).transpose()?;
        if let Some(path) = &destination.table {
            write_table(&store, path)?;
        }
        if let Some(path) = &plot.plot {
            file::draw(path, &figure(&store)?)?;
        }
        Ok(DatasetReport {
            path: destination.store,
            chunks: plan.schema().grid.chunks(),
            finished: plan.schema().grid.chunks() - missing,
            summary,
            seed,
            seconds: begun.elapsed().as_secs_f64(),
        })
    }

    fn compute(
        &self,
        path: &Path,
        plan: &dyn Computation,
        [what, noun]: [&'static str; 2],
        output: &Output,
    ) -> Result<Store, Failure> {
        let threads = self.threads.number()?;
        let store = Store::create_or_resume(path, plan.schema().clone())?;
        let finished = store.chunks() - store.missing();
        if finished > 0 {
            output.note(&format!(
                "{}: {finished} of {} chunks are there already",
                path.display(),
                store.chunks()
            ));
        }
        let done = progress::watched(what, noun, true, |control| {
            let work = Work {
                share: self.chunk,
                threads,
                control: *control,
            };
            plan.compute(&store, &work)
        });
        match done {
            Ok(()) => Ok(finish(store)?),
            Err(stopped @ (WorkError::Cancelled { .. } | WorkError::Neighbours)) => {
                let words = format!(
                    "{stopped} in {}; run the same command again to go on",
                    path.display()
                );
                Err(Failure::new(nanotap::ErrorKind::Stopped, words))
            }
            Err(error) => Err(error.into()),
        }
    }
}

/// Report on the computation of a dataset: the JSON of every command that writes one.
#[derive(Serialize)]
pub(crate) struct DatasetReport<S> {
    /// Path of the dataset, a folder.
    pub(crate) path: PathBuf,
    /// Number of chunks, and the number of those that are finished.
    pub(crate) chunks: usize,
    pub(crate) finished: usize,
    /// Summary of the dataset, once all chunks are finished.
    #[serde(flatten)]
    pub(crate) summary: Option<S>,
    /// Computing time of this command, s.
    pub(crate) seconds: f64,
    /// Seed of the initial states.
    pub(crate) seed: u64,
}

impl<S> DatasetReport<S> {
    /// The report as text: `summed` of the summary, or the number of finished chunks, and the path
    /// of the dataset.
    pub(crate) fn text(&self, heading: &str, summed: impl FnOnce(&S) -> String) -> String {
        let body = self.summary.as_ref().map_or_else(
            || {
                format!(
                    "  {} of {} chunks are finished\n",
                    self.finished, self.chunks
                )
            },
            summed,
        );
        format!(
            "{}\n\n{body}\n  {} in {} s\n",
            style::bold(heading),
            self.path.display(),
            number::significant(self.seconds, 3)
        )
    }
}

/// The default name of a dataset without its ending: of the case file and what is varied.
pub(crate) fn derived_name(case: Option<&Path>, what: &[&str]) -> String {
    let stem = case
        .and_then(Path::file_stem)
        .map(|stem| stem.to_string_lossy().into_owned());
    stem.iter()
        .map(String::as_str)
        .chain(what.iter().copied())
        .collect::<Vec<_>>()
        .join("-")
}

/// Writes the table of a finished dataset, piece by piece.
pub(crate) fn write_table(store: &Store, path: &Path) -> Result<(), Failure> {
    file::write_rows(path, |rows| table::csv(store, |piece| rows.push(piece)))
}

#[cfg(test)]
mod tests {
    use super::derived_name;
    use std::path::Path;

    #[test]
    fn names_are_of_the_case_and_what_varies() {
        let case = Path::new("folder/paper.toml");
        assert_eq!(
            derived_name(Some(case), &["sweep", "omega"]),
            "paper-sweep-omega"
        );
        assert_eq!(derived_name(None, &["basin", "a1", "v1"]), "basin-a1-v1");
    }
}
