//! Reading of the files that a user, a case or a dataset names.
//!
//! Every such file is read here, and nowhere else (`clippy.toml`): it has at most so many bytes, and
//! it is a regular file, through links too. A device such as `/dev/zero` has no end. A file that the
//! user names may also be a pipe, as in `nanotap fit <(zcat curve.csv.gz) lever.toml`; one that
//! another file names may not: a pipe without a writer would be waited for without end.

#![expect(
    clippy::disallowed_methods,
    reason = "the one place in which files are opened for reading"
)]

use std::fs::{self, File, FileType};
use std::io::{self, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

use nanotap_error::Error;
use nanotap_error::ErrorKind;

/// Most bytes of a case file or a catalogue. The largest cases, with their tables in them, have some
/// hundred kilobytes.
pub const MAX_CASE_BYTES: u64 = 1 << 20;
/// Most bytes of a table of measured data or of an instrument's file.
pub const MAX_TABLE_BYTES: u64 = 256 << 20;
/// Most bytes of a JSON document: a result that is read again, or the metadata of a dataset. A parsed
/// document takes up to 16 times as much memory.
pub const MAX_DOCUMENT_BYTES: u64 = 64 << 20;
/// Most bytes of an image: the largest number of pixels, uncompressed, 16 bits in four channels.
pub const MAX_IMAGE_BYTES: u64 = 128 << 20;

/// Which files may be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Named by the user: a regular file or a pipe.
    User,
    /// Named by another file, such as the table of a case: a regular file.
    File,
}

/// A file that was not read.
#[derive(Debug, thiserror::Error)]
#[error("{}: {fault}", path.display())]
pub struct InputError {
    /// Path of the file, as it was named.
    pub path: PathBuf,
    /// Why it was not read.
    pub fault: InputFault,
}

/// Why a file was not read.
#[derive(Debug, thiserror::Error)]
pub enum InputFault {
    /// It does not exist.
    #[error("no such file")]
    Missing,
    /// It is a folder.
    #[error("is a folder")]
    Folder,
    /// It is neither a regular file nor a permitted pipe.
    #[error("is not a regular file")]
    NotRegular,
    /// It has more bytes than its limit.
    #[error("longer than {}", size(*.0))]
    TooLong(u64),
    /// Its bytes are not text; the offset of the first such byte.
    #[error("not text: byte {0} is not UTF-8")]
    NotText(usize),
    /// The operating system's error.
    #[error("cannot be read: {0}")]
    System(io::Error),
}

impl From<io::Error> for InputFault {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::NotFound => Self::Missing,
            io::ErrorKind::IsADirectory => Self::Folder,
            _ => Self::System(error),
        }
    }
}

impl InputError {
    /// True if the file does not exist.
    pub const fn is_missing(&self) -> bool {
        matches!(self.fault, InputFault::Missing)
    }
}

impl From<InputError> for Error {
    fn from(error: InputError) -> Self {
        let message = error.to_string();
        match error.fault {
            InputFault::Missing | InputFault::Folder | InputFault::NotRegular => {
                Self::new(ErrorKind::BadInput, message)
            }
            InputFault::TooLong(_) => Self::input(message, "name a shorter file"),
            InputFault::NotText(_) => Self::input(message, "name a file of text in UTF-8"),
            InputFault::System(_) => Self::files(message),
        }
    }
}

/// Reads a file of at most `limit` bytes.
///
/// # Errors
/// If it does not exist, is longer, is of another kind, or the system refuses.
pub fn read(path: &Path, limit: u64, origin: Origin) -> Result<Vec<u8>, InputError> {
    let bytes = head(path, limit + 1, origin, Some(limit))?;
    if bytes.len() as u64 > limit {
        return Err(failed(path)(InputFault::TooLong(limit)));
    }
    Ok(bytes)
}

/// Reads a text in UTF-8 of at most `limit` bytes.
///
/// # Errors
/// As [`read`], or if it is not text.
pub fn text(path: &Path, limit: u64, origin: Origin) -> Result<String, InputError> {
    decoded(path, read(path, limit, origin)?)
}

/// The text of a file whose bytes were read.
///
/// # Errors
/// If it is not text in UTF-8.
pub fn decoded(path: &Path, bytes: Vec<u8>) -> Result<String, InputError> {
    String::from_utf8(bytes).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        failed(path)(InputFault::NotText(offset))
    })
}

/// Reads the first `count` bytes of a regular file, or all of a shorter one.
///
/// # Errors
/// As [`read`], but a longer file is not an error.
pub fn start(path: &Path, count: u64) -> Result<Vec<u8>, InputError> {
    head(path, count, Origin::File, None)
}

/// A file of any length that is read where it is needed.
pub trait Seekable: Read + Seek + Send {}

impl<T: Read + Seek + Send> Seekable for T {}

/// Opens a file of any length; of a pipe at most `limit` bytes are read at once.
///
/// # Errors
/// As [`read`], but only a pipe can be too long.
pub fn open(path: &Path, limit: u64, origin: Origin) -> Result<Box<dyn Seekable>, InputError> {
    let opened = checked(path, origin, None).and_then(|kind| {
        if kind.is_file() {
            return Ok(Some(File::open(path)?));
        }
        Ok(None)
    });
    match opened.map_err(failed(path))? {
        Some(file) => Ok(Box::new(file)),
        None => Ok(Box::new(Cursor::new(read(path, limit, origin)?))),
    }
}

/// Reads at most `count` bytes of a file that states no more than `limit`.
fn head(
    path: &Path,
    count: u64,
    origin: Origin,
    limit: Option<u64>,
) -> Result<Vec<u8>, InputError> {
    let read = || -> Result<Vec<u8>, InputFault> {
        checked(path, origin, limit)?;
        let mut bytes = Vec::new();
        File::open(path)?.take(count).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    read().map_err(failed(path))
}

/// The kind of a file that may be read. It is looked at before it is opened: opening a pipe waits for
/// its writer.
fn checked(path: &Path, origin: Origin, limit: Option<u64>) -> Result<FileType, InputFault> {
    let metadata = fs::metadata(path)?;
    if metadata.is_dir() {
        return Err(InputFault::Folder);
    }
    let is_pipe = origin == Origin::User && is_pipe(metadata.file_type());
    if !metadata.is_file() && !is_pipe {
        return Err(InputFault::NotRegular);
    }
    match limit.filter(|limit| metadata.len() > *limit) {
        Some(limit) => Err(InputFault::TooLong(limit)),
        None => Ok(metadata.file_type()),
    }
}

fn failed(path: &Path) -> impl FnOnce(InputFault) -> InputError {
    let path = path.to_owned();
    move |fault| InputError { path, fault }
}

#[cfg(unix)]
fn is_pipe(kind: FileType) -> bool {
    std::os::unix::fs::FileTypeExt::is_fifo(&kind)
}

#[cfg(not(unix))]
fn is_pipe(_: FileType) -> bool {
    false
}

/// A number of bytes in words.
fn size(bytes: u64) -> String {
    match bytes {
        _ if bytes >= 1 << 20 && bytes.is_multiple_of(1 << 20) => format!("{} MiB", bytes >> 20),
        _ => format!("{bytes} bytes"),
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let name = format!("nanotap-input-{}-{name}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    /// Devices have no end; links to them are devices; a file of a terabyte is not read first.
    #[test]
    fn endless_and_long_files_are_refused() {
        let folder = folder("endless");
        let link = folder.join("table.csv");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        for path in [Path::new("/dev/zero"), &link] {
            let refused = read(path, 1 << 40, Origin::User).unwrap_err().to_string();
            assert!(refused.ends_with(": is not a regular file"), "{refused}");
        }
        let sparse = folder.join("sparse");
        File::create(&sparse).unwrap().set_len(1 << 40).unwrap();
        let refused = read(&sparse, 1 << 20, Origin::File).unwrap_err();
        assert!(refused.to_string().ends_with(": longer than 1 MiB"));
        assert_eq!(start(&sparse, 3).unwrap(), [0; 3]);
        fs::write(folder.join("text"), "abc").unwrap();
        assert_eq!(text(&folder.join("text"), 3, Origin::File).unwrap(), "abc");
        let refused = read(&folder.join("text"), 2, Origin::File).unwrap_err();
        assert!(refused.to_string().ends_with(": longer than 2 bytes"));
        fs::remove_dir_all(&folder).unwrap();
    }

    /// A pipe is read to its limit where the user named it, and not opened where a file did.
    #[test]
    fn pipes_are_for_users() {
        let folder = folder("pipes");
        let pipe = folder.join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        let refused = read(&pipe, 10, Origin::File).unwrap_err();
        assert!(matches!(refused.fault, InputFault::NotRegular));
        for (content, is_read) in [("0123456789", true), ("0123456789a", false)] {
            let written = std::thread::scope(|scope| {
                scope.spawn(|| fs::write(&pipe, content));
                read(&pipe, 10, Origin::User)
            });
            assert_eq!(written.is_ok(), is_read, "{written:?}");
        }
        fs::remove_dir_all(&folder).unwrap();
    }
}
