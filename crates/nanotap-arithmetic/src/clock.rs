//! A clock that also runs in a browser, where the standard library has none.

use std::time::Duration;

#[cfg(not(target_family = "wasm"))]
type Reading = std::time::Instant;
#[cfg(target_family = "wasm")]
type Reading = f64;

/// A time of a clock that never goes back.
#[derive(Clone, Copy, Debug)]
pub struct Instant(Reading);

#[cfg(target_family = "wasm")]
#[link(wasm_import_module = "nanotap")]
unsafe extern "C" {
    /// Milliseconds of the page's clock, from `performance.now()`.
    #[link_name = "now"]
    safe fn page_clock() -> f64;
}

impl Instant {
    /// The present time.
    pub fn now() -> Self {
        #[cfg(not(target_family = "wasm"))]
        let reading = Reading::now();
        #[cfg(target_family = "wasm")]
        let reading = page_clock();
        Self(reading)
    }

    /// The time since then.
    pub fn elapsed(&self) -> Duration {
        #[cfg(not(target_family = "wasm"))]
        let elapsed = self.0.elapsed();
        #[cfg(target_family = "wasm")]
        let elapsed = Duration::from_secs_f64((page_clock() - self.0).max(0.0) / 1e3);
        elapsed
    }
}
