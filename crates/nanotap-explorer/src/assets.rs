//! The page and its parts, from `page/`.

use axum::extract::Path;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

const PAGE: &str = include_str!("../page/index.html");
const STYLE: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const PARTS: [(&str, &str, &str); 9] = [
    ("style.css", STYLE, include_str!("../page/style.css")),
    ("main.js", SCRIPT, include_str!("../page/main.js")),
    ("state.js", SCRIPT, include_str!("../page/state.js")),
    ("api.js", SCRIPT, include_str!("../page/api.js")),
    ("knobs.js", SCRIPT, include_str!("../page/knobs.js")),
    ("lever.js", SCRIPT, include_str!("../page/lever.js")),
    ("study.js", SCRIPT, include_str!("../page/study.js")),
    ("figure.js", SCRIPT, include_str!("../page/figure.js")),
    ("plot.js", SCRIPT, include_str!("../page/plot.js")),
];

pub(crate) async fn page() -> impl IntoResponse {
    ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], PAGE)
}

pub(crate) async fn part(Path(name): Path<String>) -> Response {
    match PARTS.iter().find(|(known, _, _)| *known == name) {
        Some((_, kind, text)) => ([(header::CONTENT_TYPE, *kind)], *text).into_response(),
        None => (StatusCode::NOT_FOUND, "the explorer has no such page").into_response(),
    }
}
