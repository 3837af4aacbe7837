//! The files of nanotap's page: what is seen and how it is used. The page asks what it shows from
//! `nanotap-explorer`, by a server (`nanotap-server`) or in the browser alone (`nanotap-web`).

/// A file of the page.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Its name.
    pub name: &'static str,
    /// Its media type.
    pub kind: &'static str,
    /// Its content.
    pub text: &'static str,
}

const STYLE: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const PICTURE: &str = "image/svg+xml";
const MANIFEST: &str = "application/manifest+json";

macro_rules! parts {
    ($($kind:ident $name:literal),+ $(,)?) => {
        [$(Part { name: $name, kind: $kind, text: include_str!(concat!("../page/", $name)) }),+]
    };
}

/// The page itself.
pub const INDEX: &str = include_str!("../page/index.html");

/// What the page loads.
pub const PARTS: [Part; 37] = parts![
    STYLE "style.css",
    PICTURE "icon.svg",
    MANIFEST "manifest.webmanifest",
    SCRIPT "main.js",
    SCRIPT "state.js",
    SCRIPT "words.js",
    SCRIPT "words-de.js",
    SCRIPT "notice.js",
    SCRIPT "set.js",
    SCRIPT "laws.js",
    SCRIPT "formula.js",
    SCRIPT "entry.js",
    SCRIPT "states.js",
    SCRIPT "plan.js",
    SCRIPT "scan.js",
    SCRIPT "hand.js",
    SCRIPT "curve.js",
    SCRIPT "axis.js",
    SCRIPT "element.js",
    SCRIPT "film.js",
    SCRIPT "pictures.js",
    SCRIPT "api.js",
    SCRIPT "server.js",
    SCRIPT "workers.js",
    SCRIPT "worker.js",
    SCRIPT "lecture.js",
    SCRIPT "lessons.js",
    SCRIPT "knobs.js",
    SCRIPT "lever.js",
    SCRIPT "study.js",
    SCRIPT "image.js",
    SCRIPT "figure.js",
    SCRIPT "plot.js",
    SCRIPT "link.js",
    SCRIPT "qr.js",
    SCRIPT "offline.js",
    SCRIPT "service-worker.js",
];
