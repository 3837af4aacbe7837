//! Files that are written completely or not at all.
//!
//! A file is written under a temporary name in the same folder, then renamed. If the path is a
//! link, its target is replaced. The new file takes over the permissions of the old one.

use std::fs::{self, File, OpenOptions};
use std::hash::{BuildHasher as _, RandomState};
use std::io::{self, BufWriter, ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Extension of files that are being written.
const TEMPORARY: &str = "tmp";
/// A temporary file older than this is abandoned: writing one takes seconds.
const ABANDONED: Duration = Duration::from_secs(3600);

/// Writes `bytes` to `path`, synchronised to disk before the rename.
///
/// # Errors
/// If the file system fails; an existing file is then unchanged.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_with(path, |file| file.write_all(bytes))
}

/// Writes the output of `fill` to `path`, synchronised to disk before the rename.
///
/// # Errors
/// The errors of `fill` and of the file system; an existing file is then unchanged.
pub fn write_with<E: From<io::Error>>(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    put(path, true, fill)
}

/// As [`write`], without synchronisation, which is many times faster: after a power failure `path`
/// may be empty.
///
/// # Errors
/// If the file system fails.
pub(crate) fn write_unsynced(path: &Path, bytes: &[u8]) -> io::Result<()> {
    put(path, false, |file| file.write_all(bytes))
}

fn put<E: From<io::Error>>(
    path: &Path,
    synced: bool,
    fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    let target = followed(path)?;
    let there = fs::metadata(&target).ok();
    if let Some(there) = &there
        && !there.is_file()
    {
        // A pipe or a device would be replaced by a file.
        let kind = if there.is_dir() {
            "a folder"
        } else {
            "not a regular file"
        };
        return Err(io::Error::other(format!("it is {kind}")).into());
    }
    let temporary = temporary(&target)?;
    let write = || -> Result<(), E> {
        let file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&temporary)?;
        if let Some(there) = there {
            file.set_permissions(there.permissions())?;
        }
        let mut file = BufWriter::new(file);
        fill(&mut file)?;
        let file = file.into_inner().map_err(io::IntoInnerError::into_error)?;
        if synced {
            file.sync_all()?;
        }
        Ok(fs::rename(&temporary, &target)?)
    };
    write().inspect_err(|_| {
        // An incomplete file is useless; it may not exist.
        let _ = fs::remove_file(&temporary);
    })
}

/// The target of a chain of links; for a dangling link, the missing target.
fn followed(path: &Path) -> io::Result<PathBuf> {
    /// Largest number of links in a chain; a longer one is taken for a cycle.
    const LINKS: usize = 40;
    let mut path = path.to_path_buf();
    for _ in 0..LINKS {
        let Ok(to) = fs::read_link(&path) else {
            return Ok(path);
        };
        path = match path.parent() {
            Some(folder) => folder.join(to),
            None => to,
        };
    }
    Err(io::Error::other("its symbolic links form a cycle"))
}

/// A unique name next to `path`: several runs, even on several machines, may write the same file at
/// the same time.
fn temporary(path: &Path) -> io::Result<PathBuf> {
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "it has no file name"))?;
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    // The standard library's hasher has a random start.
    let unique = RandomState::new().hash_one(std::process::id());
    hidden.push(format!(".{unique:016x}.{TEMPORARY}"));
    Ok(path.with_file_name(hidden))
}

/// Computes the CRC-32 checksum of `bytes`.
pub fn checksum(bytes: &[u8]) -> u32 {
    crc32fast::hash(bytes)
}

/// True if a file is being written, or was when its program ended.
pub(crate) fn is_temporary(path: &Path) -> bool {
    let hidden = path
        .file_name()
        .is_some_and(|name| name.to_string_lossy().starts_with('.'));
    hidden && path.extension().is_some_and(|ending| ending == TEMPORARY)
}

/// Removes a temporary file that no process can be writing any more.
pub(crate) fn remove_abandoned(path: &Path) {
    let age = fs::metadata(path)
        .and_then(|metadata| metadata.modified())
        .map(|changed| SystemTime::now().duration_since(changed));
    if is_temporary(path) && matches!(age, Ok(Ok(age)) if age > ABANDONED) {
        // Another process may have removed it.
        let _ = fs::remove_file(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let name = format!("nanotap-files-{}-{name}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[cfg(unix)]
    #[test]
    fn links_and_permissions_stay() {
        use std::os::unix::fs::{PermissionsExt as _, symlink};
        let folder = folder("links");
        let (file, link) = (folder.join("data.csv"), folder.join("link.csv"));
        fs::write(&file, "before").unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o640)).unwrap();
        symlink("data.csv", &link).unwrap();
        write(&link, b"after").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&file).unwrap(), "after");
        let mode = fs::metadata(&file).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o640);
        // A link to a file that does not exist yet, and a link to itself.
        symlink("new.csv", folder.join("early.csv")).unwrap();
        write(&folder.join("early.csv"), b"x").unwrap();
        assert_eq!(fs::read_to_string(folder.join("new.csv")).unwrap(), "x");
        symlink("circle", folder.join("circle")).unwrap();
        assert!(write(&folder.join("circle"), b"x").is_err());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn devices_are_not_replaced() {
        let refused = write(Path::new("/dev/null"), b"x").unwrap_err();
        assert_eq!(refused.to_string(), "it is not a regular file");
    }

    #[test]
    fn what_fails_leaves_what_was_there() {
        let folder = folder("fails");
        let file = folder.join("data.csv");
        write(&file, b"before").unwrap();
        let failed = write_with(&file, |out| {
            out.write_all(b"half")?;
            Err(io::Error::other("no more"))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read_to_string(&file).unwrap(), "before");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        assert!(write(&folder, b"x").is_err());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn only_what_is_old_is_abandoned() {
        let folder = folder("old");
        let (old, new) = (folder.join(".a.0.tmp"), folder.join(".b.0.tmp"));
        for path in [&old, &new] {
            fs::write(path, "half").unwrap();
        }
        let long_ago = SystemTime::now() - 2 * ABANDONED;
        let file = OpenOptions::new().write(true).open(&old).unwrap();
        file.set_modified(long_ago).unwrap();
        for path in [&old, &new] {
            remove_abandoned(path);
        }
        assert!(!old.exists() && new.exists());
        fs::remove_dir_all(&folder).unwrap();
    }
}
