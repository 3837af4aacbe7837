//! `nanotap merge`: partial datasets merged into one.

use std::path::PathBuf;

use clap::Args;
use nanotap::dataset::merge;

use crate::failure::Failure;
use crate::output::Output;
use crate::{file, number, style};

/// Merge partial datasets, computed with --chunk.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// The partial datasets, computed by the same command with different --chunk
    #[arg(value_name = "DATASET", required = true)]
    sources: Vec<PathBuf>,

    /// The merged dataset, byte for byte equal to one computed without --chunk
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    file::ending(&arguments.out, &["zarr"])?;
    let merged = merge(&arguments.sources, &arguments.out)?;
    output.result(&merged, |merged| {
        format!(
            "{}\n",
            style::bold(&format!(
                "{}: {} of {} chunks, {} copied now",
                merged.path.display(),
                merged.chunks - merged.missing_count,
                merged.chunks,
                merged.copied
            ))
        )
    })?;
    if merged.missing_count == 0 {
        return Ok(());
    }
    Err(Failure::numerics(format!(
        "{} missing; merge the other shares too, or give the sweep's or basin's command with --out {}",
        number::counted(merged.missing_count, "chunk is", "chunks are"),
        arguments.out.display()
    )))
}
