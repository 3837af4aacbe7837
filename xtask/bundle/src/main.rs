//! Writes the page that needs no server, and the answers that it is compared with:
//! `nanotap-bundle page REPOSITORY MODULE FOLDER`, `nanotap-bundle answers REQUESTS FOLDER`.

#![expect(
    clippy::disallowed_methods,
    reason = "it reads files of this repository"
)]

mod answers;
mod bundle;
mod exact;
mod page;
mod single;
mod split;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Why something was not written.
#[derive(Debug, thiserror::Error)]
enum WriteError {
    #[error("{}: {error}", path.display())]
    File {
        path: PathBuf,
        error: std::io::Error,
    },
    #[error("{}: {error}", path.display())]
    Requests {
        path: PathBuf,
        error: serde_json::Error,
    },
    #[error(transparent)]
    Module(#[from] exact::ModuleError),
    #[error(transparent)]
    Bundle(#[from] bundle::BundleError),
    #[error("{0} has no `{1}`")]
    Without(&'static str, String),
    #[error(transparent)]
    Explorer(#[from] nanotap::Error),
}

fn main() -> ExitCode {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let arguments: Vec<&Path> = arguments.iter().map(PathBuf::as_path).collect();
    let written = match arguments.as_slice() {
        [what, repository, module, folder] if what.as_os_str() == "page" => {
            page::write(repository, module, folder)
        }
        [what, requests, folder] if what.as_os_str() == "answers" => {
            answers::write(requests, folder)
        }
        _ => {
            eprintln!(
                "usage: nanotap-bundle page REPOSITORY MODULE FOLDER\n       nanotap-bundle answers REQUESTS FOLDER"
            );
            return ExitCode::from(2);
        }
    };
    match written {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn read(path: &Path) -> Result<Vec<u8>, WriteError> {
    fs::read(path).map_err(of(path))
}

fn of(path: &Path) -> impl FnOnce(std::io::Error) -> WriteError {
    let path = path.to_owned();
    move |error| WriteError::File { path, error }
}
