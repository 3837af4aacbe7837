//! Output of a command: results on standard output, remarks on standard error.

use std::io::{BufWriter, ErrorKind, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};

use nanotap::case::physical::{Remark, Severity};
use nanotap::error::ErrorDocument;
use nanotap::study::registry::Document;
use schemars::JsonSchema;
use serde::Serialize;

use crate::failure::{Failure, flag};
use crate::{page, progress, style};

/// Size of the buffer in which JSON is written, bytes.
const JSON_AT_ONCE: usize = 1 << 16;

/// Whether something was printed on standard output.
static HAS_PRINTED: AtomicBool = AtomicBool::new(false);

/// Document of a command that failed.
#[derive(Serialize, JsonSchema)]
pub(crate) struct FailureDocument {
    /// Why there is no result.
    error: ErrorDocument,
    /// The version of the program.
    version: &'static str,
}

/// How results are printed.
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

    /// Whether notes and progress are left out.
    pub(crate) fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Prints a result: with --json as the one JSON document, else the
    /// text that `text` makes.
    pub(crate) fn result<R: Serialize>(
        &self,
        result: &R,
        text: impl FnOnce(&R) -> String,
    ) -> Result<(), Failure> {
        if self.json {
            print_json(result)
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

    /// Prints the error of a computation that failed as the JSON document, if JSON is requested and no
    /// document was printed.
    pub(crate) fn failed(&self, error: &Failure) {
        let is_printed = HAS_PRINTED.load(Ordering::Relaxed);
        if self.json && !is_printed && error.kind == nanotap::ErrorKind::Numerics {
            let document = FailureDocument {
                error: error.clone().written(flag).document(),
                version: env!("CARGO_PKG_VERSION"),
            };
            // The error itself is printed on standard error.
            let _ = print_json(&document);
        }
    }

    /// Prints a note on standard error, unless `--quiet` was given.
    pub(crate) fn note(&self, text: &str) {
        if !self.quiet {
            progress::clear();
            anstream::eprintln!("{}", style::safe(&style::note(&page::remark(text))));
        }
    }

    /// Prints a warning or a note.
    pub(crate) fn remark(&self, remark: &Remark) {
        match remark.severity {
            Severity::Warning => self.warning(&remark.text),
            Severity::Note => self.note(&remark.text),
        }
    }

    /// Prints the remarks on a report; with `--json` its warnings only, since the document has the notes.
    pub(crate) fn remarks(&self, remarks: &[Remark]) {
        let is_told = |remark: &&Remark| !self.json || remark.severity == Severity::Warning;
        remarks
            .iter()
            .filter(is_told)
            .for_each(|remark| self.remark(remark));
    }

    /// Warns that a report holds what was finished before it was stopped.
    pub(crate) fn stopped(&self, cancelled: bool) {
        if cancelled {
            self.warning("stopped before it was done");
        }
    }

    /// Prints a warning on standard error, which `--quiet` does not suppress: the result is
    /// doubtful.
    #[expect(
        clippy::unused_self,
        reason = "remarks go through the output, shown or not"
    )]
    pub(crate) fn warning(&self, text: &str) {
        progress::clear();
        anstream::eprintln!("{}", style::safe(&style::warning(&page::remark(text))));
    }
}

/// Prints `text` on standard output, without colours if it is not a terminal.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    progress::end();
    HAS_PRINTED.store(true, Ordering::Relaxed);
    let mut stream = anstream::stdout().lock();
    let written = stream.write_all(style::safe(text).as_bytes());
    printed(written.and_then(|()| stream.flush()))
}

/// Prints a result as JSON, which has no colours, on standard output.
fn print_json<R: Serialize>(result: &R) -> Result<(), Failure> {
    progress::end();
    HAS_PRINTED.store(true, Ordering::Relaxed);
    let mut stream = BufWriter::with_capacity(JSON_AT_ONCE, std::io::stdout().lock());
    let written = serde_json::to_writer_pretty(&mut stream, result).map_err(std::io::Error::from);
    let written = written.and_then(|()| writeln!(stream));
    printed(written.and_then(|()| stream.flush()))
}

/// Converts the result of writing to standard output; a closed pipe is not an error.
fn printed(written: std::io::Result<()>) -> Result<(), Failure> {
    match written {
        // The reader has closed the pipe (`| head`).
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        Err(error) => Err(Failure::numerics(format!(
            "cannot write to standard output: {error}"
        ))),
        Ok(()) => Ok(()),
    }
}
