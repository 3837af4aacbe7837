//! A folder that is removed when it is no longer needed.

use std::path::{Path, PathBuf};

use nanotap::Error;

use crate::guard;

/// A temporary folder with a name that cannot be predicted, which only its owner may enter.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    /// Creates one in the system's folder of temporary files.
    #[expect(
        clippy::disallowed_methods,
        reason = "the folder that is made in it is this user's alone"
    )]
    pub(crate) fn new() -> Result<Self, Error> {
        let folder = std::env::temp_dir();
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
        // A folder that cannot be removed is left to the system, which cleans up its temporary files.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
