//! What a command says: results on standard output, remarks on standard error.

use std::io::{ErrorKind, Write as _};

use nanotap::study::registry::Document;
use serde::Serialize;

use crate::failure::Failure;
use crate::{page, progress, style};

/// How results are to be shown.
#[derive(Debug)]
pub(crate) struct Output {
    json: bool,
    quiet: bool,
}

impl Output {
    /// Results as JSON or as text, remarks or none.
    pub(crate) fn new(json: bool, quiet: bool) -> Self {
        Self { json, quiet }
    }

    /// Whether remarks and progress are left out.
    pub(crate) fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Prints a result: as the one JSON document where that was asked for, else the
    /// text that `text` makes.
    pub(crate) fn result<R: Serialize>(
        &self,
        result: &R,
        text: impl FnOnce(&R) -> String,
    ) -> Result<(), Failure> {
        if self.json {
            let mut json = serde_json::to_string_pretty(result)
                .map_err(|error| Failure::numerics(format!("no JSON of the result: {error}")))?;
            json.push('\n');
            print(&json)
        } else {
            print(&text(result))
        }
    }

    /// Prints the report of a study: as JSON with the case and the version, else the text that
    /// `text` makes.
    pub(crate) fn study<R: Serialize>(
        &self,
        case: &nanotap::case::Case,
        report: &R,
        text: impl FnOnce(&R) -> String,
    ) -> Result<(), Failure> {
        if self.json {
            self.result(&Document::new(report, case), |_| String::new())
        } else {
            print(&text(report))
        }
    }

    /// Whether the result is a JSON document.
    pub(crate) fn is_json(&self) -> bool {
        self.json
    }

    /// A remark worth knowing.
    pub(crate) fn note(&self, text: &str) {
        if !self.quiet {
            progress::clear();
            anstream::eprintln!("{}", style::note(&page::remark(text)));
        }
    }

    /// A remark that puts the result in doubt: it is shown in any case.
    #[expect(
        clippy::unused_self,
        reason = "remarks go through the output, shown or not"
    )]
    pub(crate) fn warning(&self, text: &str) {
        progress::clear();
        anstream::eprintln!("{}", style::warning(&page::remark(text)));
    }
}

/// Prints `text` on standard output.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    progress::end();
    let mut stream = anstream::stdout().lock();
    match stream
        .write_all(text.as_bytes())
        .and_then(|()| stream.flush())
    {
        // Whoever reads has seen enough (`| head`).
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        Err(error) => Err(Failure::numerics(format!(
            "cannot write to standard output: {error}"
        ))),
        Ok(()) => Ok(()),
    }
}
