//! The browser explorer: a page on this machine where a person turns the knobs of a case and
//! sees at once what the tip does.
//!
//! The server is a front end like the terminal: it turns what the page sends into a case and a
//! study's options, and a report into words and drawn figures. It listens on the loopback
//! interface only, answers only who knows the token that it was started with, reads nothing
//! from disk but the case that was named, and ends work whose client has gone.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

mod answer;
mod asked;
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
mod maps;
mod motion;
mod preset;
mod scratch;
mod study;
mod work;

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::routing::{get, post};
use nanotap::Error;
use tokio::net::TcpListener;
use tokio::sync::Notify;

use crate::figures::Shelf;
use crate::preset::Preset;
use crate::scratch::Scratch;
use crate::work::Workers;

/// Longest request that is read, in bytes; a case file and its options are far shorter.
const LONGEST_REQUEST: usize = 256 << 10;

/// What the explorer shows first, and where it listens.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The case file shown first; without one, the paper's case.
    pub case: Option<PathBuf>,
    /// Changes to it, as in `omega=20`.
    pub set: Vec<String>,
    /// The port; 0: any that is free.
    pub port: u16,
}

/// What every request shares.
pub(crate) struct App {
    pub(crate) token: String,
    pub(crate) port: u16,
    pub(crate) presets: Vec<Preset>,
    pub(crate) workers: Workers,
    /// Figures of studies that may be asked for again.
    pub(crate) figures: Shelf,
    /// Where datasets of studies stand while their figures are drawn.
    pub(crate) scratch: PathBuf,
}

/// Serves the explorer until Ctrl-C or the system's wish that it ends; `ready` gets the address to open.
///
/// # Errors
/// When the case cannot be read or the port not be listened on.
pub fn serve(options: &Options, ready: impl FnOnce(&str)) -> Result<(), Error> {
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
        let token = guard::new_token()
            .map_err(|error| Error::files(format!("no random numbers for the token: {error}")))?;
        ready(&format!("http://127.0.0.1:{port}/?token={token}"));
        let app = Arc::new(App {
            token,
            port,
            presets,
            workers: Workers::default(),
            figures: Shelf::default(),
            scratch: scratch.path().to_owned(),
        });
        tokio::select! {
            served = axum::serve(listener, router(app)) => served.map_err(failed),
            () = stopped.notified() => Ok(()),
        }
    });
    // Work under way is waited for by nobody.
    runtime.shutdown_background();
    served
}

fn router(app: Arc<App>) -> Router {
    Router::new()
        .route("/", get(assets::page))
        .route("/{name}", get(assets::part))
        .route("/api/about", get(preset::about))
        .route("/api/motion", post(motion::motion))
        .route("/api/attractors", post(census::attractors))
        .route("/api/study", post(study::study))
        .route("/api/figure", post(figures::figure))
        .route("/api/export", post(export::export))
        .layer(DefaultBodyLimit::max(LONGEST_REQUEST))
        .layer(axum::middleware::from_fn_with_state(
            Arc::clone(&app),
            guard::guard,
        ))
        .with_state(app)
}
