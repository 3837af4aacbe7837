//! The program under limits of memory and processor time.

use std::fs::File;
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::util::Folder;

/// Address space in KiB: 2 GiB.
const MEMORY: &str = "2097152";
/// Processor time of a process in seconds. Ctrl-C comes long before.
const PROCESSOR: &str = "60";
/// Time on a loaded machine after which a process that was sent Ctrl-C hangs.
const HANGS: Duration = Duration::from_secs(120);
/// Number of the signal of Ctrl-C.
const SIGINT: i32 = 2;
/// Pause between two looks at a process.
const PAUSE: Duration = Duration::from_millis(2);

/// The program with these arguments, under the limits; its standard error goes to a file.
pub(crate) fn start(folder: &Folder, arguments: &[String]) -> Child {
    let limited = format!("ulimit -v {MEMORY}; ulimit -t {PROCESSOR}; exec \"$@\"");
    Command::new("sh")
        .args(["-c", &limited, "sh", env!("CARGO_BIN_EXE_nanotap")])
        .args(arguments)
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(File::create(folder.path().join("stderr")).unwrap())
        .spawn()
        .unwrap()
}

/// Runs the program for so long, then sends it Ctrl-C, and returns what is wrong with its end.
pub(crate) fn run(folder: &Folder, arguments: &[String], patience: Duration) -> Option<String> {
    let mut child = start(folder, arguments);
    let begun = Instant::now();
    let mut is_interrupted = false;
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if !is_interrupted && begun.elapsed() > patience {
            is_interrupted = true;
            interrupt(&child);
        }
        if begun.elapsed() > HANGS {
            let _ = child.kill();
            let _ = child.wait();
            return Some(format!("{arguments:?}: it does not end\n{}", input(folder)));
        }
        std::thread::sleep(PAUSE);
    };
    wrong(folder, &format!("{arguments:?}"), status, is_interrupted)
}

/// Sends Ctrl-C.
pub(crate) fn interrupt(child: &Child) {
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .stderr(Stdio::null())
        .status();
    // It may have ended.
    let _ = sent.unwrap();
}

/// What is wrong with the end of a run, unless it has exit code 0, 1 or 2 (130 after Ctrl-C), a reason
/// for a failure, and no panic.
pub(crate) fn wrong(
    folder: &Folder,
    what: &str,
    status: ExitStatus,
    is_interrupted: bool,
) -> Option<String> {
    let words = std::fs::read(folder.path().join("stderr")).unwrap();
    let words = String::from_utf8_lossy(&words);
    let code = status.code();
    // Ctrl-C may come before the program listens for it.
    let ended = code == Some(130) || status.signal() == Some(SIGINT);
    let is_known = matches!(code, Some(0..=2)) || (is_interrupted && ended);
    let says = !matches!(code, Some(1 | 2)) || words.contains("error");
    let is_panic = words.contains("panicked") || words.contains("please report");
    (!is_known || !says || is_panic)
        .then(|| format!("{what}: {status:?}\n{words}\n{}", input(folder)))
}

/// The input of a run, to look at it.
fn input(folder: &Folder) -> String {
    let names = ["case.toml", "table.csv"].iter();
    let texts = names.filter_map(|name| std::fs::read(folder.path().join(name)).ok());
    let texts = texts.map(|text| String::from_utf8_lossy(&text).into_owned());
    texts.collect::<Vec<_>>().join("\n---\n")
}

/// Fails if something was wrong with any run, and shows all of them.
#[track_caller]
pub(crate) fn none_wrong(found: &[String]) {
    assert!(
        found.is_empty(),
        "{} runs ended wrongly:\n{}",
        found.len(),
        found.join("\n\n")
    );
}
