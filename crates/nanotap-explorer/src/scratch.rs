//! A folder that is removed when it is no longer needed.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use nanotap::Error;

/// How often and after which pause a folder is tried to be removed.
const ATTEMPTS: usize = 20;
const PAUSE: Duration = Duration::from_millis(25);

/// A folder of this process alone.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    /// One among the system's temporary files.
    pub(crate) fn new() -> Result<Self, Error> {
        Self::within(&std::env::temp_dir())
    }

    /// One in `folder`.
    pub(crate) fn within(folder: &Path) -> Result<Self, Error> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = folder.join(format!("nanotap-explorer-{}-{count}", std::process::id()));
        std::fs::create_dir(&path)
            .map_err(|error| Error::files(format!("{}: {error}", path.display())))?;
        Ok(Self(path))
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // Work that was stopped may write one last file. What cannot be removed is left to the
        // system, which empties that folder.
        for _ in 0..ATTEMPTS {
            match std::fs::remove_dir_all(&self.0) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    std::thread::sleep(PAUSE);
                }
                _ => return,
            }
        }
    }
}
