//! The page and its parts.

use axum::extract::Path;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

use nanotap_explorer::link::PAGE;

/// Where the page says to which address its links lead: a link to this server would be of no use.
const LINKS: &str = "<meta name=\"nanotap-page\" content=\"";

pub(crate) async fn index() -> impl IntoResponse {
    let page = nanotap_page::INDEX.replacen(LINKS, &format!("{LINKS}{PAGE}"), 1);
    ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], page)
}

pub(crate) async fn part(Path(name): Path<String>) -> Response {
    match nanotap_page::PARTS.iter().find(|part| part.name == name) {
        Some(part) => ([(header::CONTENT_TYPE, part.kind)], part.text).into_response(),
        None => (StatusCode::NOT_FOUND, "the explorer has no such page").into_response(),
    }
}
