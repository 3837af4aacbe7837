//! The program's answers to the requests of a file, with the seconds that each took: what `compare.mjs`
//! compares with the answers of the WebAssembly module. A text `file:PATH` in a request stands for the content
//! of a file; the requests with these are written as well.

use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use nanotap::control::Control;
use nanotap_explorer::Explorer;
use serde_json::{Map, Value};

use crate::{WriteError, of, read};

/// A second try of a quick request says how long it takes once everything is in memory.
const QUICK: f64 = 1.5;

/// Writes the answers to the requests in the file `requests` into `folder`.
///
/// # Errors
/// If a file cannot be read or written, or `requests` is not a list of names, addresses and bodies.
pub(crate) fn write(requests: &Path, folder: &Path) -> Result<(), WriteError> {
    let bytes = read(requests)?;
    let requests: Vec<(String, String, Value)> =
        serde_json::from_slice(&bytes).map_err(|error| WriteError::Requests {
            path: requests.to_owned(),
            error,
        })?;
    let explorer = Explorer::new(None)?;
    let mut times = Map::new();
    let requests: Vec<(String, String, Value)> = requests
        .into_iter()
        .map(|(name, path, body)| Ok((name, path, with_files(body)?)))
        .collect::<Result<_, WriteError>>()?;
    let keep = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        fs::write(&path, bytes).map_err(of(&path))
    };
    keep(
        "requests.json",
        serde_json::json!(requests).to_string().as_bytes(),
    )?;
    for (name, path, body) in requests {
        let body = body.to_string();
        let lines = Mutex::new(String::new());
        let control = Control {
            cancel: None,
            progress: None,
        };
        let ask = || {
            let begun = Instant::now();
            lines
                .lock()
                .unwrap_or_else(std::sync::PoisonError::into_inner)
                .clear();
            let answer = explorer.answer(&path, body.as_bytes(), &control, &|line| {
                let mut lines = lines
                    .lock()
                    .unwrap_or_else(std::sync::PoisonError::into_inner);
                // How far a study is depends on the clock.
                if line.get("progress").is_none() {
                    lines.push_str(&line.to_string());
                    lines.push('\n');
                }
            });
            (answer, begun.elapsed().as_secs_f64())
        };
        let (mut answer, mut least) = ask();
        if least < QUICK {
            let (again, time) = ask();
            (answer, least) = (again, least.min(time));
        }
        let mut bytes = lines.into_inner().unwrap_or_default().into_bytes();
        bytes.append(&mut answer.bytes);
        keep(&name.replace(' ', "-"), &bytes)?;
        times.insert(name, least.into());
    }
    keep("times.json", Value::Object(times).to_string().as_bytes())
}

/// A request with the contents of its files.
fn with_files(value: Value) -> Result<Value, WriteError> {
    Ok(match value {
        Value::String(text) => match text.strip_prefix("file:") {
            Some(path) => fs::read_to_string(path)
                .map_err(of(Path::new(path)))?
                .into(),
            None => text.into(),
        },
        Value::Array(values) => values
            .into_iter()
            .map(with_files)
            .collect::<Result<_, _>>()?,
        Value::Object(map) => map
            .into_iter()
            .map(|(name, value)| Ok((name, with_files(value)?)))
            .collect::<Result<Map<_, _>, WriteError>>()?
            .into(),
        other => other,
    })
}
