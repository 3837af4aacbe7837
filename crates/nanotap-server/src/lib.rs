//! The explorer on this machine: the server that `nanotap explore` starts for the page.
//!
//! It listens on the loopback interface only, accepts only requests with the token that it was
//! started with, reads no file except the given case, and stops computations whose client has
//! disconnected. The answers are those of [`nanotap_explorer`].

mod assets;
mod guard;
mod listen;
mod scratch;
mod work;

use std::io::Write as _;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, State};
use axum::http::Uri;
use axum::response::Response;
use axum::routing::get;
use nanotap::Error;
use nanotap::case::file;
use nanotap::control::Control;
use nanotap_explorer::{Explorer, Work};
use serde_json::Value;
use tokio::net::TcpListener;
use tokio::sync::Notify;

use crate::scratch::Scratch;
use crate::work::Workers;

/// Largest request, in bytes: a case with the files that it names, escaped.
const LONGEST_REQUEST: usize = 4 << 20;
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

/// What all requests share.
pub(crate) struct Server {
    token: String,
    port: u16,
    explorer: Arc<Explorer>,
    workers: Workers,
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
    let given = match &options.case {
        Some(path) => Some((file::read(path)?, file::with_tables(&options.set)?)),
        None => None,
    };
    let explorer = Arc::new(Explorer::new(given)?);
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
        let server = Arc::new(Server {
            token,
            port,
            explorer,
            workers: Workers::default(),
        });
        tokio::select! {
            () = listen::listen(&listener, router(server)) => Ok(()),
            () = stopped.notified() => Ok(()),
        }
    });
    // Running computations are not waited for.
    runtime.shutdown_background();
    served
}

fn router(server: Arc<Server>) -> Router {
    Router::new()
        .route("/", get(assets::index))
        .route("/{name}", get(assets::part))
        .route("/api/{name}", get(answer).post(answer))
        .layer(DefaultBodyLimit::max(LONGEST_DATA))
        .layer(axum::middleware::from_fn(listen::whole))
        .layer(axum::middleware::from_fn_with_state(
            Arc::clone(&server),
            guard::guard,
        ))
        .with_state(server)
}

/// Answers a request of the page.
async fn answer(State(server): State<Arc<Server>>, uri: Uri, body: Bytes) -> Response {
    let (explorer, path) = (Arc::clone(&server.explorer), uri.path().to_owned());
    let work = Explorer::work(&path);
    let answer = move |control: &Control<'_>, line: &(dyn Fn(Value) + Sync)| {
        explorer.answer(&path, &body, control, line)
    };
    match work {
        Some(Work::Lines) => server.workers.lines(answer),
        Some(Work::Long) => server.workers.long(move |c| answer(c, &|_| {})).await,
        // A request that does not exist is answered as well.
        Some(Work::Short) | None => server.workers.short(move |c| answer(c, &|_| {})).await,
    }
}
