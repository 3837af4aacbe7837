//! Access control: only the browser of the user who started the explorer is served.
//!
//! A page of another site can make a browser send requests to this machine. It cannot read the
//! token, cannot set the header that carries it, and is named in `Origin`; a host name that was
//! rebound to this machine shows in `Host`.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};

use nanotap::Error;

use crate::Server;

/// The header that carries the token.
pub(crate) const TOKEN_HEADER: &str = "x-nanotap-token";
/// Everything is loaded from this server; the page has no inline code or style. A notebook on this
/// machine may frame it: that needs the token.
const CONTENT_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
    img-src 'self' data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; \
    frame-ancestors http://localhost:* http://127.0.0.1:*";

/// 128 random bits in hexadecimal.
///
/// # Errors
/// If the system has no random numbers.
pub(crate) fn new_token() -> Result<String, Error> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes)
        .map_err(|error| Error::files(format!("no random numbers: {error}")))?;
    Ok(format!("{:032x}", u128::from_be_bytes(bytes)))
}

/// Accepts a request or refuses it with a reason; adds the security headers.
pub(crate) async fn guard(
    State(app): State<Arc<Server>>,
    request: Request,
    next: Next,
) -> Response {
    let mut response = match refusal(&app, &request) {
        Some((status, words)) => (status, words).into_response(),
        None => next.run(request).await,
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, CONTENT_POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

fn refusal(app: &Server, request: &Request) -> Option<(StatusCode, &'static str)> {
    let headers = request.headers();
    let own = [
        format!("127.0.0.1:{}", app.port),
        format!("localhost:{}", app.port),
    ];
    // Of two values a server and a proxy may each believe another one.
    let names = [header::HOST.as_str(), header::ORIGIN.as_str(), TOKEN_HEADER];
    if names
        .iter()
        .any(|name| headers.get_all(*name).iter().count() > 1)
    {
        return Some((
            StatusCode::BAD_REQUEST,
            "expected one Host header, and at most one Origin and one token",
        ));
    }
    let host = text(headers, header::HOST.as_str()).unwrap_or_default();
    // The target of a request to a proxy names a host, too.
    let named = request.uri().authority();
    if !own.iter().any(|own| own == host) || named.is_some_and(|named| named.as_str() != host) {
        return Some((
            StatusCode::MISDIRECTED_REQUEST,
            "the explorer has another address",
        ));
    }
    if let Some(origin) = text(headers, header::ORIGIN.as_str())
        && origin.strip_prefix("http://") != Some(host)
    {
        return Some((
            StatusCode::FORBIDDEN,
            "pages of other sites cannot use this explorer",
        ));
    }
    let path = request.uri().path();
    let given = if path.starts_with("/api/") {
        text(headers, TOKEN_HEADER)
    } else if path == "/" {
        token_of(request.uri().query())
    } else {
        // The page's own scripts and styles are not secret.
        return None;
    };
    if given.is_some_and(|given| same(given, &app.token)) {
        return None;
    }
    Some((
        StatusCode::FORBIDDEN,
        "open the address that `nanotap explore` printed: it contains the token",
    ))
}

fn text<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    headers.get(name).map(|v| v.to_str().unwrap_or_default())
}

fn token_of(query: Option<&str>) -> Option<&str> {
    query?
        .split('&')
        .find_map(|part| part.strip_prefix("token="))
}

/// Compares in a time that does not depend on the length of the common prefix.
fn same(given: &str, expected: &str) -> bool {
    given.len() == expected.len()
        && given
            .bytes()
            .zip(expected.bytes())
            .fold(0, |difference, (a, b)| difference | (a ^ b))
            == 0
}
