//! Writes the site of the documents for mdBook: `nanotap-book ROOT FOLDER [--quick]`; or the pages of
//! the reference into the repository: `nanotap-book ROOT --reference`.
//!
//! With `--quick` the report on the paper uses fewer initial states.

use std::path::Path;
use std::process::ExitCode;

use nanotap::control::Control;
use nanotap_book::{Site, outdated_reference};
use nanotap_paper::{Options, report};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let outcome = match words.as_slice() {
        [root, "--reference"] => write_reference(Path::new(root)),
        [root, folder] => lay_out(Path::new(root), Path::new(folder), false),
        [root, folder, "--quick"] => lay_out(Path::new(root), Path::new(folder), true),
        _ => Err("usage: nanotap-book ROOT FOLDER [--quick], or ROOT --reference".into()),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("error: {reason}");
            ExitCode::FAILURE
        }
    }
}

fn write_reference(root: &Path) -> Result<(), String> {
    let written = outdated_reference(root, true).map_err(|trouble| trouble.to_string())?;
    println!("{} pages written", written.len());
    Ok(())
}

fn lay_out(root: &Path, folder: &Path, quick: bool) -> Result<(), String> {
    let options = Options {
        only: Vec::new(),
        quick,
    };
    let report = report(&options, &Control::default()).map_err(|error| error.to_string())?;
    let site = Site::read(root, &report).map_err(|trouble| trouble.to_string())?;
    let troubles = site.troubles();
    if !troubles.is_empty() {
        let lines: Vec<String> = troubles.iter().map(ToString::to_string).collect();
        return Err(lines.join("\n       "));
    }
    site.write(folder).map_err(|trouble| trouble.to_string())?;
    let written = report
        .write(&folder.join("docs/reference/paper"))
        .map_err(|error| error.to_string())?;
    println!(
        "{} pages, {} pictures of the paper",
        site.len(),
        written.pictures.len()
    );
    Ok(())
}
