//! Computations for requests: on separate threads, few at a time, and cancelled when the client
//! disconnects.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::Json;
use axum::body::Body;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use nanotap::control::{CancelFlag, Control};
use nanotap_explorer::{Answer, Outcome};
use serde_json::{Value, json};
use tokio::sync::{Semaphore, mpsc};
use tokio_stream::wrappers::ReceiverStream;

/// Number of motions computed at once: a newer one stops the oldest.
const MOTIONS: usize = 6;
/// Number of threads for them: those that were stopped need a moment.
const MOTION_THREADS: usize = 4 * MOTIONS;
/// Number of studies computed at once; each uses all cores.
const STUDIES: usize = 2;
/// Longest time of a computation.
const LONGEST: Duration = Duration::from_secs(300);
/// Number of messages that may wait for a slow client; a study has fewer stages.
const WAITING: usize = 64;

/// Limits of the computations: a long study does not delay motions, nor does a slow motion.
pub(crate) struct Workers {
    motions: Arc<Semaphore>,
    /// The flags of the running motions, the oldest first.
    running: Arc<Mutex<VecDeque<Arc<CancelFlag>>>>,
    studies: Arc<Semaphore>,
}

impl Default for Workers {
    fn default() -> Self {
        Self {
            motions: Arc::new(Semaphore::new(MOTION_THREADS)),
            running: Arc::default(),
            studies: Arc::new(Semaphore::new(STUDIES)),
        }
    }
}

/// Stops the computation when dropped, which happens when the client disconnects.
struct StopOnDrop(CancelFlag);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.cancel();
    }
}

/// Takes a motion off the list of those that run, when dropped.
struct Done(Arc<Mutex<VecDeque<Arc<CancelFlag>>>>, Arc<CancelFlag>);

impl Drop for Done {
    fn drop(&mut self) {
        let mut running = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        running.retain(|other| !Arc::ptr_eq(other, &self.1));
    }
}

fn control(stop: &CancelFlag) -> Control<'_> {
    Control {
        cancel: Some(stop),
        progress: None,
    }
}

impl Workers {
    /// Answers a request that follows a slider.
    pub(crate) async fn short(
        &self,
        work: impl FnOnce(&Control<'_>) -> Answer + Send + 'static,
    ) -> Response {
        let own = Arc::new(CancelFlag::new());
        {
            let mut running = self.running.lock().unwrap_or_else(PoisonError::into_inner);
            running.push_back(Arc::clone(&own));
            if running.len() > MOTIONS
                && let Some(oldest) = running.pop_front()
            {
                oldest.cancel();
            }
        }
        let _done = Done(Arc::clone(&self.running), Arc::clone(&own));
        match Self::run_in(&self.motions, (*own).clone(), work).await {
            Ok(answer) if answer.outcome == Outcome::Stopped => failed(&format!(
                "stopped: {MOTIONS} newer motions were requested, from other pages perhaps"
            )),
            answer => response(answer),
        }
    }

    /// Answers a request that may take long, within the limit of the studies.
    pub(crate) async fn long(
        &self,
        work: impl FnOnce(&Control<'_>) -> Answer + Send + 'static,
    ) -> Response {
        response(Self::run_in(&self.studies, CancelFlag::new(), work).await)
    }

    async fn run_in(
        places: &Arc<Semaphore>,
        stop: CancelFlag,
        work: impl FnOnce(&Control<'_>) -> Answer + Send + 'static,
    ) -> Result<Answer, String> {
        let place = Arc::clone(places).acquire_owned().await;
        let _guard = StopOnDrop(stop.clone());
        let task = tokio::task::spawn_blocking(move || {
            let _place = place;
            work(&control(&stop))
        });
        match tokio::time::timeout(LONGEST, task).await {
            Ok(Ok(answer)) => Ok(answer),
            Ok(Err(_)) => Err("internal error; please report".to_owned()),
            Err(_) => Err(too_long()),
        }
    }

    /// Sends the lines of an answer as they come.
    pub(crate) fn lines(
        &self,
        work: impl FnOnce(&Control<'_>, &(dyn Fn(Value) + Sync)) -> Answer + Send + 'static,
    ) -> Response {
        let places = Arc::clone(&self.studies);
        let (sender, receiver) = mpsc::channel::<Result<String, std::convert::Infallible>>(WAITING);
        tokio::spawn(async move {
            let gone = sender.clone();
            let place = tokio::select! {
                place = places.acquire_owned() => place,
                () = gone.closed() => return,
            };
            let stop = CancelFlag::new();
            let guard = StopOnDrop(stop.clone());
            let task = tokio::task::spawn_blocking(move || {
                let _place = place;
                let line = |value: Value| {
                    // A client that disconnects, or does not read, stops the computation.
                    if sender.try_send(Ok(format!("{value}\n"))).is_err() {
                        stop.cancel();
                    }
                };
                work(&control(&stop), &line);
            });
            tokio::select! {
                _ = task => {}
                () = gone.closed() => {}
                () = tokio::time::sleep(LONGEST) => {
                    let _ = gone.try_send(Ok(format!("{}\n", refusal(&too_long()))));
                }
            }
            drop(guard);
        });
        (
            [(header::CONTENT_TYPE, "application/x-ndjson")],
            Body::from_stream(ReceiverStream::new(receiver)),
        )
            .into_response()
    }
}

/// The response of an answer.
fn response(answer: Result<Answer, String>) -> Response {
    let answer = match answer {
        Ok(answer) => answer,
        Err(words) => return failed(&words),
    };
    let status = match answer.outcome {
        Outcome::Answered => StatusCode::OK,
        Outcome::Refused => StatusCode::UNPROCESSABLE_ENTITY,
        Outcome::Unknown => StatusCode::NOT_FOUND,
        Outcome::Stopped | Outcome::Failed => StatusCode::INTERNAL_SERVER_ERROR,
    };
    (status, [(header::CONTENT_TYPE, answer.kind)], answer.bytes).into_response()
}

/// The response to a request that was right, but was not answered.
fn failed(words: &str) -> Response {
    (StatusCode::UNPROCESSABLE_ENTITY, Json(refusal(words))).into_response()
}

fn refusal(words: &str) -> Value {
    json!({ "error": words, "keys": [] })
}

fn too_long() -> String {
    format!("stopped after {} s", LONGEST.as_secs())
}
