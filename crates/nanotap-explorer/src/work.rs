//! Computations for requests: on separate threads, few at a time, and cancelled when the client
//! disconnects.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::body::Body;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use nanotap::control::{CancelFlag, Control};
use serde_json::Value;
use tokio::sync::{Semaphore, mpsc};
use tokio_stream::wrappers::ReceiverStream;

use crate::api_error::ApiError;

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
    /// Runs `work` that follows a slider, and waits for its result.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Control<'_>) -> Result<T, ApiError> + Send + 'static,
    ) -> Result<T, ApiError> {
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
        let answer = Self::run_in(&self.motions, (*own).clone(), work).await;
        match answer {
            Err(error) if error.is_stopped() => Err(ApiError::failed(format!(
                "stopped: {MOTIONS} newer motions were requested, from other pages perhaps"
            ))),
            answer => answer,
        }
    }

    /// Runs `work` that may take long, within the limit of the studies.
    pub(crate) async fn run_long<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Control<'_>) -> Result<T, ApiError> + Send + 'static,
    ) -> Result<T, ApiError> {
        Self::run_in(&self.studies, CancelFlag::new(), work).await
    }

    async fn run_in<T: Send + 'static>(
        places: &Arc<Semaphore>,
        stop: CancelFlag,
        work: impl FnOnce(&Control<'_>) -> Result<T, ApiError> + Send + 'static,
    ) -> Result<T, ApiError> {
        let place = Arc::clone(places).acquire_owned().await;
        let _guard = StopOnDrop(stop.clone());
        let task = tokio::task::spawn_blocking(move || {
            let _place = place;
            work(&control(&stop))
        });
        match tokio::time::timeout(LONGEST, task).await {
            Ok(Ok(done)) => done,
            Ok(Err(_)) => Err(ApiError::failed("internal error; please report")),
            Err(_) => Err(too_long()),
        }
    }

    /// Runs `work` and sends its results as lines of JSON as they come.
    pub(crate) fn stream(
        &self,
        work: impl FnOnce(&Control<'_>, &(dyn Fn(Value) + Sync)) -> Result<(), ApiError>
        + Send
        + 'static,
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
                let hand_over = |value: Value| {
                    // A client that disconnects, or does not read, stops the computation.
                    if sender.try_send(Ok(format!("{value}\n"))).is_err() {
                        stop.cancel();
                    }
                };
                if let Err(refusal) = work(&control(&stop), &hand_over) {
                    hand_over(refusal.json());
                }
            });
            tokio::select! {
                _ = task => {}
                () = gone.closed() => {}
                () = tokio::time::sleep(LONGEST) => {
                    let _ = gone.try_send(Ok(format!("{}\n", too_long().json())));
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

fn too_long() -> ApiError {
    ApiError::failed(format!("stopped after {} s", LONGEST.as_secs()))
}
