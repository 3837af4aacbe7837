//! A folder that is removed when it is no longer needed.

use std::path::{Path, PathBuf};
use std::time::Duration;

use nanotap::Error;

use crate::guard;

/// Number of attempts to remove a folder, and the pause between them.
const ATTEMPTS: usize = 20;
const PAUSE: Duration = Duration::from_millis(25);

/// A temporary folder with a name that cannot be predicted, which only its owner may enter.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    /// Creates one in the system's folder of temporary files.
    #[cfg_attr(
        not(test),
        expect(
            clippy::disallowed_methods,
            reason = "the folder that is made in it is this user's alone"
        )
    )]
    pub(crate) fn new() -> Result<Self, Error> {
        Self::within(&std::env::temp_dir())
    }

    /// Creates a temporary folder within `folder`.
    pub(crate) fn within(folder: &Path) -> Result<Self, Error> {
        let path = folder.join(format!("nanotap-explorer-{}", guard::new_token()?));
        let mut builder = std::fs::DirBuilder::new();
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        // Refused if something has the name.
        builder
            .create(&path)
            .map_err(|error| Error::files(format!("{}: {error}", path.display())))?;
        Ok(Self(path))
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // A cancelled computation may write one last file. A folder that cannot be removed is left
        // to the system, which cleans up its temporary files.
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
