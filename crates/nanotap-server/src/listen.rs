//! Connections: as many as a browser needs, each with a limit of the time in which a request must
//! arrive.

use std::future::poll_fn;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, HttpBody as _};
use axum::extract::Request;
use axum::http::StatusCode;
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;

/// Largest number of connections that are open at the same time.
const CONNECTIONS: usize = 256;
/// Time in which the head of a request must arrive, and its body after that.
const LONGEST_ARRIVAL: Duration = Duration::from_secs(5);
/// Pause after a connection could not be accepted.
const PAUSE: Duration = Duration::from_millis(50);

/// Serves connections without an end.
pub(crate) async fn listen(listener: &TcpListener, router: Router) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        let Ok(place) = Arc::clone(&places).acquire_owned().await else {
            return;
        };
        let Ok((socket, _)) = listener.accept().await else {
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        let service = TowerToHyperService::new(router.clone());
        tokio::spawn(async move {
            let _place = place;
            // An error is the client's, which is gone.
            let _ = http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(LONGEST_ARRIVAL)
                .serve_connection(TokioIo::new(socket), service)
                .await;
        });
    }
}

/// Reads the body of a request, within the limits of size and time.
pub(crate) async fn whole(request: Request, next: Next) -> Response {
    let (head, body) = request.into_parts();
    let longest = match head.uri.path() {
        "/api/open" | "/api/study" | "/api/figure" => crate::LONGEST_DATA,
        _ => crate::LONGEST_REQUEST,
    };
    match tokio::time::timeout(LONGEST_ARRIVAL, read(body, longest)).await {
        Ok(Ok(Some(bytes))) => next.run(Request::from_parts(head, Body::from(bytes))).await,
        Ok(Ok(None)) => {
            let words = format!("expected at most {longest} bytes in a request");
            (StatusCode::PAYLOAD_TOO_LARGE, words).into_response()
        }
        Ok(Err(error)) => (StatusCode::BAD_REQUEST, error.to_string()).into_response(),
        Err(_) => {
            let words = format!(
                "the request did not arrive in {} s",
                LONGEST_ARRIVAL.as_secs()
            );
            (StatusCode::REQUEST_TIMEOUT, words).into_response()
        }
    }
}

/// The bytes of a body; nothing if there are more than `longest`. The rest of such a body is read, too, and
/// dropped: a client that still sends reads no answer.
async fn read(mut body: Body, longest: usize) -> Result<Option<Vec<u8>>, axum::Error> {
    let mut bytes = Some(Vec::new());
    while let Some(frame) = poll_fn(|context| Pin::new(&mut body).poll_frame(context)).await {
        let Ok(data) = frame?.into_data() else {
            continue;
        };
        bytes = bytes.filter(|bytes| bytes.len() + data.len() <= longest);
        if let Some(bytes) = &mut bytes {
            bytes.extend_from_slice(&data);
        }
    }
    Ok(bytes)
}
