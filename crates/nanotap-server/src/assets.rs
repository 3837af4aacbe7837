//! The page and its parts.

use axum::extract::Path;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

use nanotap_explorer::page;

pub(crate) async fn index() -> impl IntoResponse {
    (
        [(header::CONTENT_TYPE, "text/html; charset=utf-8")],
        page::INDEX,
    )
}

pub(crate) async fn part(Path(name): Path<String>) -> Response {
    match page::PARTS.iter().find(|part| part.name == name) {
        Some(part) => ([(header::CONTENT_TYPE, part.kind)], part.text).into_response(),
        None => (StatusCode::NOT_FOUND, "the explorer has no such page").into_response(),
    }
}
