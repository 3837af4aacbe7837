//! Datasets at the terminal: where they go, work on them, what is said of failures.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use clap::Args;
use nanotap::dataset::{Schema, Share, Store, StoreError, Work, WorkError, table};

use crate::failure::Failure;
use crate::file;
use crate::output::Output;
use crate::progress;
use crate::threads::ThreadsArgument;

/// Where a dataset goes, and which part of it is computed here.
#[derive(Args, Clone, Debug)]
pub(crate) struct DatasetArguments {
    /// The dataset: a folder ending in .zarr, which xarray.open_zarr opens; with an ending of
    /// .csv, a table with a line a start, beside the folder of that name. Without it, a name
    /// is derived. Where it is there already, the work goes on where it stopped
    #[arg(long, value_name = "PATH")]
    pub(crate) out: Option<PathBuf>,

    /// Compute one of n shares only, as in 2/8; `nanotap merge` puts the shares together
    #[arg(long, value_name = "I/N", default_value_t = Share::WHOLE, hide_default_value = true)]
    pub(crate) chunk: Share,

    #[command(flatten)]
    pub(crate) threads: ThreadsArgument,
}

/// Where the pieces of a dataset go.
pub(crate) struct Destination {
    /// The store.
    pub(crate) store: PathBuf,
    /// The table, if one is wanted.
    pub(crate) table: Option<PathBuf>,
}

impl DatasetArguments {
    /// Where the dataset goes: where it was asked to, or to `derived`.zarr. Pictures and
    /// tables need every chunk, which a share does not have.
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
                store: path.with_extension("zarr"),
                table: Some(path.clone()),
            },
        };
        if !self.chunk.is_whole() && (plot.is_some() || destination.table.is_some()) {
            return Err(Failure::request(
                format!(
                    "--chunk {} computes a share; a picture or a table needs all",
                    self.chunk
                ),
                "merge the shares, then give the same command without --chunk and with --out MERGED.zarr",
            ));
        }
        Ok(destination)
    }

    /// Makes the store, or opens it to go on, and does `compute` on it.
    pub(crate) fn compute(
        &self,
        path: &Path,
        schema: &Schema,
        noun: &'static str,
        output: &Output,
        compute: impl FnOnce(&Store, &Work<'_>) -> Result<(), WorkError>,
    ) -> Result<Store, Failure> {
        let threads = self.threads.number()?;
        let store = Store::create_or_resume(path, schema.clone())?;
        let finished = store.chunks() - store.missing();
        if finished > 0 {
            output.note(&format!(
                "{}: {finished} of {} chunks are there already",
                path.display(),
                store.chunks()
            ));
        }
        let done = progress::watched(output, noun, |control| {
            let work = Work {
                share: self.chunk,
                threads,
                control: *control,
            };
            compute(&store, &work)
        })?;
        match done {
            Ok(()) => Ok(store),
            Err(WorkError::Store(error)) => Err(error.into()),
            Err(stopped @ WorkError::Cancelled { .. }) => Err(Failure::Failed(format!(
                "{stopped} in {}; run the same command again to go on",
                path.display()
            ))),
        }
    }
}

/// The name of a dataset without its ending, when nobody says one: of the case file and
/// what is varied.
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

/// Writes the table of a finished dataset, piece by piece; the file appears whole or not
/// at all.
pub(crate) fn write_table(store: &Store, path: &Path) -> Result<(), Failure> {
    let refuse = |error: std::io::Error| {
        Failure::Failed(format!("cannot write {}: {error}", path.display()))
    };
    let hidden = format!(".{}.csv.tmp", std::process::id());
    let temporary = path.with_file_name(hidden);
    let written = File::create(&temporary).map_err(refuse).and_then(|file| {
        let mut file = BufWriter::new(file);
        table::csv::<Failure>(store, |piece| {
            file.write_all(piece.as_bytes()).map_err(refuse)
        })?;
        file.flush().map_err(refuse)?;
        std::fs::rename(&temporary, path).map_err(refuse)
    });
    if written.is_err() {
        let _ = std::fs::remove_file(&temporary);
    }
    written
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        let help = match &error {
            StoreError::Occupied { .. } => "give another name with --out",
            StoreError::Mismatch { .. } => {
                "give another name with --out, or remove that dataset to begin anew"
            }
            StoreError::NotAStore { .. } => "name a folder that `nanotap sweep` or `basin` made",
            _ => return Self::Failed(error.to_string()),
        };
        Self::request(error.to_string(), help)
    }
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
