//! Running a tool: its output is shown as it comes, and collected if needed.

use std::io::{BufRead, BufReader, IsTerminal, Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Mutex;

use crate::tally::Tally;

/// Runs `command` in `root` with its output going directly to the terminal.
///
/// # Errors
/// If the tool is missing or cannot be started.
pub(crate) fn succeeds(root: &Path, command: &mut Command) -> Result<bool, String> {
    echo(command);
    let status = command
        .current_dir(root)
        .status()
        .map_err(|error| cannot_start(command, &error))?;
    Ok(status.success())
}

/// Runs `command` in `root` as [`succeeds`] does, as one check.
///
/// # Errors
/// If the tool is missing or cannot be started.
pub(crate) fn check(root: &Path, command: &mut Command) -> Result<Tally, String> {
    Ok(Tally::check(succeeds(root, command)?))
}

/// Runs `command` in `root` as [`succeeds`] does; `failure` is the error if it fails.
///
/// # Errors
/// If the tool is missing, cannot be started, or fails.
pub(crate) fn must(root: &Path, command: &mut Command, failure: &str) -> Result<(), String> {
    if succeeds(root, command)? {
        Ok(())
    } else {
        Err(failure.to_owned())
    }
}

/// Runs a test runner in `root`, shows its output, and counts the tests.
///
/// # Errors
/// If the tool is missing or cannot be started.
pub(crate) fn tests(root: &Path, command: &mut Command) -> Result<Tally, String> {
    let (lines, succeeded) = shown_and_kept(root, command)?;
    Ok(Tally::of_tests(&lines, succeeded))
}

/// Runs `command` in `root`, shows its output line by line, and returns the lines and whether it
/// succeeded.
///
/// # Errors
/// If the tool is missing or cannot be started.
pub(crate) fn shown_and_kept(
    root: &Path,
    command: &mut Command,
) -> Result<(Vec<String>, bool), String> {
    echo(command);
    if std::io::stdout().is_terminal() {
        command.env("CARGO_TERM_COLOR", "always");
    }
    let mut child = command
        .current_dir(root)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| cannot_start(command, &error))?;
    let lines = Mutex::new(Vec::new());
    let (out, err) = (child.stdout.take(), child.stderr.take());
    std::thread::scope(|scope| {
        scope.spawn(|| pass_on(out, std::io::stdout(), &lines));
        scope.spawn(|| pass_on(err, std::io::stderr(), &lines));
    });
    let status = child
        .wait()
        .map_err(|error| cannot_start(command, &error))?;
    let lines = lines
        .into_inner()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    Ok((lines, status.success()))
}

/// The standard output of a short `command`; `None` if it fails.
pub(crate) fn output(root: &Path, command: &mut Command) -> Option<String> {
    let output = command
        .current_dir(root)
        .stderr(Stdio::null())
        .output()
        .ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

fn pass_on(from: Option<impl Read>, mut to: impl Write, lines: &Mutex<Vec<String>>) {
    let Some(from) = from else { return };
    let mut reader = BufReader::new(from);
    let mut bytes = Vec::new();
    loop {
        bytes.clear();
        // A tool may print invalid UTF-8; its lines are passed on unchanged.
        match reader.read_until(b'\n', &mut bytes) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        // A closed output does not stop the tool.
        let _ = to.write_all(&bytes);
        let _ = to.flush();
        let line = String::from_utf8_lossy(&bytes).trim_end().to_owned();
        lines
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .push(line);
    }
}

fn echo(command: &Command) {
    let name = Path::new(command.get_program())
        .file_name()
        .unwrap_or_default()
        .to_string_lossy();
    let arguments: Vec<_> = command
        .get_args()
        .map(|word| word.to_string_lossy())
        .collect();
    println!("$ {name} {}", arguments.join(" "));
}

fn cannot_start(command: &Command, error: &std::io::Error) -> String {
    format!(
        "cannot run {}: {error}",
        command.get_program().to_string_lossy()
    )
}
