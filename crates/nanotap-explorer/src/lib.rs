//! The browser explorer: a page on this machine on which a user changes the parameters of a case
//! and sees the motion of the tip at once.
//!
//! The server is a front end like the terminal: it translates the page's requests into a case and a
//! study's options, and a report into text and figures. It listens on the loopback interface only,
//! accepts only requests with the token that it was started with, reads no file except the given
//! case, and stops computations whose client has disconnected.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

mod api_error;
mod assets;
mod census;
mod clicks;
mod commands;
mod export;
mod figures;
mod film;
mod forms;
mod guard;
mod knobs;
mod law;
mod listen;
mod maps;
mod motion;
mod motion_request;
mod preset;
mod readout;
mod report;
mod scratch;
mod study;
mod work;

use std::io::Write as _;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::routing::{get, post};
use nanotap::Error;
use tokio::net::TcpListener;
use tokio::sync::Notify;

use crate::figures::Shelf;
use crate::preset::{CaseSpec, Preset};
use crate::scratch::Scratch;
use crate::work::Workers;

/// Largest request, in bytes; a case file and its options are far smaller.
const LONGEST_REQUEST: usize = 256 << 10;
/// Largest request with measured data: four thirds of the largest file that the page takes.
const LONGEST_DATA: usize = 34 << 20;

/// The initial case of the explorer, and its port.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Path of the initial case file; `None`: the paper's case.
    pub case: Option<PathBuf>,
    /// Changes to the case, such as `omega=20`.
    pub set: Vec<String>,
    /// Port; 0: any that is free.
    pub port: u16,
}

/// State shared by all requests.
pub(crate) struct App {
    pub(crate) token: String,
    pub(crate) port: u16,
    pub(crate) presets: Vec<Preset>,
    pub(crate) workers: Workers,
    /// The most recent figures of studies, which the page may request again.
    pub(crate) figures: Shelf,
    /// Folder of the datasets of studies while their figures are drawn.
    pub(crate) scratch: PathBuf,
    /// The case of the most recent motion: what the page shows.
    pub(crate) shown: Mutex<Option<CaseSpec>>,
}

/// The address of a running explorer.
#[derive(Debug)]
pub struct Address<'a> {
    /// The address, with its token. Other users can read the command lines of programs: it does not
    /// belong on one.
    pub url: String,
    folder: &'a Path,
}

impl Address<'_> {
    /// Writes a page that opens the address, for the command line of a browser. Only the user who
    /// started the explorer can read it; it is removed when the explorer ends.
    ///
    /// # Errors
    /// If the file system fails.
    pub fn page(&self) -> Result<PathBuf, Error> {
        let path = self.folder.join("open.html");
        let mut options = std::fs::OpenOptions::new();
        options.write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let url = &self.url;
        let page = format!(
            "<!doctype html>\n<meta charset=\"utf-8\">\n<title>nanotap</title>\n\
             <meta name=\"referrer\" content=\"no-referrer\">\n\
             <meta http-equiv=\"refresh\" content=\"0; url={url}\">\n\
             <p><a href=\"{url}\">Open the explorer</a></p>\n"
        );
        let written = options
            .open(&path)
            .and_then(|mut file| file.write_all(page.as_bytes()));
        written.map_err(|error| Error::files(format!("{}: {error}", path.display())))?;
        Ok(path)
    }
}

/// Serves the explorer until Ctrl-C or SIGTERM; `ready` receives the address to open.
///
/// # Errors
/// If the case cannot be read or the port cannot be opened.
pub fn serve(options: &Options, ready: impl FnOnce(&Address<'_>)) -> Result<(), Error> {
    let presets = preset::all(options.case.as_deref(), &options.set)?;
    let failed = |error: std::io::Error| Error::files(format!("the server stopped: {error}"));
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(failed)?;
    let stop = Arc::new(Notify::new());
    let stopped = Arc::clone(&stop);
    ctrlc::set_handler(move || stop.notify_one())
        .map_err(|error| Error::files(format!("cannot listen for Ctrl-C: {error}")))?;
    let scratch = Scratch::new()?;
    let served = runtime.block_on(async {
        let listener = TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, options.port)))
            .await
            .map_err(|error| {
                let message = format!("cannot listen on port {}: {error}", options.port);
                Error::option("port", message, "give another, or 0 for any that is free")
            })?;
        let port = listener.local_addr().map_err(failed)?.port();
        let token = guard::new_token()?;
        ready(&Address {
            url: format!("http://127.0.0.1:{port}/?token={token}"),
            folder: scratch.path(),
        });
        let app = Arc::new(App {
            token,
            port,
            presets,
            workers: Workers::default(),
            figures: Shelf::default(),
            scratch: scratch.path().to_owned(),
            shown: Mutex::default(),
        });
        tokio::select! {
            () = listen::listen(&listener, router(app)) => Ok(()),
            () = stopped.notified() => Ok(()),
        }
    });
    // Running computations are not waited for.
    runtime.shutdown_background();
    served
}

fn router(app: Arc<App>) -> Router {
    Router::new()
        .route("/", get(assets::page))
        .route("/{name}", get(assets::part))
        .route("/api/about", get(preset::about))
        .route("/api/case", get(export::shown))
        .route("/api/motion", post(motion::motion))
        .route("/api/law", post(law::law))
        .route("/api/attractors", post(census::attractors))
        .route("/api/study", post(study::study))
        .route("/api/figure", post(figures::figure))
        .route("/api/export", post(export::export))
        .layer(DefaultBodyLimit::max(LONGEST_DATA))
        .layer(axum::middleware::from_fn(listen::whole))
        .layer(axum::middleware::from_fn_with_state(
            Arc::clone(&app),
            guard::guard,
        ))
        .with_state(app)
}
