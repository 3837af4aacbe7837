//! The explorer's requests and answers: what the page asks when a user changes the parameters of a
//! case, and what it shows.
//!
//! [`Explorer::answer`] is a front end like the terminal: it translates a request of the page into a
//! case and a study's options, and a report into text and figures. It knows no server and reads no
//! file, so that the same page has the same answers from a server on this machine (`nanotap-server`)
//! and in a browser alone (`nanotap-web`). Answers have no state: a figure that the page wants as a
//! file, or behind another one, comes back with the request.
//!
//! ```
//! use nanotap::control::Control;
//! use nanotap_explorer::{Explorer, Outcome};
//!
//! let explorer = Explorer::new(None)?;
//! let request = br#"{"case": {"preset": "dmt"}, "start": "", "steps": 0}"#;
//! let control = Control { cancel: None, progress: None };
//! let answer = explorer.answer("/api/motion", request, &control, &|_| {});
//! assert_eq!(answer.outcome, Outcome::Answered);
//! # Ok::<(), nanotap::Error>(())
//! ```

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

mod answers;
mod api_error;
mod census;
mod choice;
mod clicks;
mod commands;
mod content;
mod curve;
mod export;
mod figures;
mod film;
mod force;
mod forms;
mod knobs;
mod law;
pub mod link;
mod maps;
mod motion;
mod motion_request;
mod open;
mod preset;
mod readout;
mod report;
mod row;
mod states;
mod study;
mod upset;

use std::sync::{Arc, Mutex};

use nanotap::Error;
use nanotap::case::file::Source;

pub use answers::{Answer, Outcome, Work};

use crate::preset::{CaseSpec, Preset};

/// What the page can ask, and its answers.
#[derive(Debug)]
pub struct Explorer {
    presets: Vec<Arc<Preset>>,
    /// The most recent case that was given as a text.
    given: Mutex<Option<Arc<Preset>>>,
    /// The case of the most recent motion: what the page shows.
    shown: Mutex<Option<CaseSpec>>,
}

impl Explorer {
    /// With the built-in cases, after a given one with its changes, such as `omega=20`.
    ///
    /// # Errors
    /// If the given case is refused.
    pub fn new(given: Option<(Source, Vec<String>)>) -> Result<Self, Error> {
        Ok(Self {
            presets: preset::all(given)?,
            given: Mutex::default(),
            shown: Mutex::default(),
        })
    }
}
