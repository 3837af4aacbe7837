//! The page that needs no server: its files for any web server, with the module for machines that fuse
//! multiply-adds and the one for those that do not, and `nanotap.html`, the same in one file.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use nanotap::control::Control;
use nanotap_explorer::Explorer;
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};

use crate::exact::{self, MultiplyAdd};
use crate::{WriteError, of, read, single, split};

/// The version of the page in its service worker, until the page is written.
const VERSION: &str = "\"development\"";
/// Its list of files until then.
const FILES: &str = "[\"./\"]";
const WORKER: &str = "service-worker.js";
/// The first example of the page and what it holds, as in main.js.
const FIRST: (&str, &str, &str) = ("dmt", "drive.setpoint", "0.8");

/// Writes the page of the repository, with the compiled `module`, into `folder`.
///
/// # Errors
/// If a file cannot be read or written, or the module or a page is not as expected.
pub(crate) fn write(repository: &Path, module: &Path, folder: &Path) -> Result<(), WriteError> {
    let source = repository.join("crates/nanotap-page/page");
    let compiled = read(module)?;
    let [fused, exact] = [MultiplyAdd::Kept, MultiplyAdd::Called]
        .map(|multiply_add| exact::rewritten(&compiled, multiply_add));
    let (fused, exact) = (fused?, exact?);
    let [fused, exact] = [
        split::split(&fused, is_late)?,
        split::split(&exact, is_late)?,
    ];
    let mut texts = BTreeMap::new();
    let listing = fs::read_dir(&source).map_err(of(&source))?;
    for path in listing.flatten().map(|entry| entry.path()) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let text = fs::read_to_string(&path).map_err(of(&path))?;
        texts.insert(name.into_owned(), text);
    }
    let index = texts.entry(single::INDEX.into()).or_default();
    let closed = format!("{}{}", first_states(), single::END);
    *index = replaced(single::INDEX, index, single::END, &closed)?;
    let whole = single::page(&texts, &fused.whole, &exact.whole)?;
    // Another version of any file is another version of the page, which browsers then load anew.
    let mut hash = Sha256::new();
    for text in texts.values() {
        hash.update(text);
    }
    hash.update(&fused.whole);
    let version = format!("\"{}\"", STANDARD.encode(hash.finalize()));
    let names = texts.keys().map(String::as_str);
    let names = names.filter(|name| ![single::INDEX, WORKER].contains(name));
    let files = json!(["./"].into_iter().chain(names).collect::<Vec<_>>()).to_string();
    let worker = texts.entry(WORKER.into()).or_default();
    *worker = replaced(WORKER, worker, VERSION, &version)?;
    *worker = replaced(WORKER, worker, FILES, &files)?;
    fs::create_dir_all(folder).map_err(of(folder))?;
    let modules = [
        ("nanotap.wasm", &fused.first),
        ("nanotap-second.wasm", &fused.second),
        ("nanotap-exact.wasm", &exact.first),
        ("nanotap-exact-second.wasm", &exact.second),
    ];
    let texts = texts
        .iter()
        .map(|(name, text)| (name.as_str(), text.as_bytes()));
    let modules = modules
        .iter()
        .map(|(name, bytes)| (*name, bytes.as_slice()));
    for (name, bytes) in texts
        .chain(modules)
        .chain([("nanotap.html", whole.as_bytes())])
    {
        let path = folder.join(name);
        fs::write(&path, bytes).map_err(of(&path))?;
        println!("{:>9} bytes  {}", bytes.len(), path.display());
    }
    Ok(())
}

/// Crates of which the first view needs nothing but the forms of their studies.
const LATE: [&str; 8] = [
    "afm_files",
    "afm_thermal",
    "nanotap_fit",
    "nanotap_images",
    "nanotap_proof",
    "nanotap_reconstruct",
    "nanotap_scan",
    "nanotap_surveys",
];
/// What makes the forms of studies, by parts of names: schemas, and defaults as JSON.
const FORMS: [&str; 3] = ["8schemars", "7request6schema", "3ser9Serialize"];
/// Crates whose functions for one type may be the same instructions as those for another, and then are one.
const SHARED: [&str; 3] = ["alloc", "core", "std"];

/// Whether the page loads a function on demand, by its mangled name, in which each crate has its length before it.
fn is_late(name: &str) -> bool {
    let (name, _) = name.split_once('.').unwrap_or((name, ""));
    let place = |one: &str| {
        let part = format!("{}{one}", one.len());
        // At the end stands where a function of other types was compiled, which others may call as well.
        name.strip_suffix(&part).unwrap_or(name).find(&part)
    };
    let first = |crates: &[&str]| crates.iter().filter_map(|one| place(one)).min();
    let Some(late) = first(&LATE) else {
        return false;
    };
    // The function's own crate comes first, those of its types after it.
    !FORMS.iter().any(|part| name.contains(part))
        && first(&SHARED).is_none_or(|shared| late < shared)
}

/// What the page shows before its module is there: the states of its first example, with the case that they
/// are of as `caseText` in state.js writes it.
fn first_states() -> String {
    let (preset, key, value) = FIRST;
    let case = json!({ "preset": preset, "set": [format!("{key}={value}")] });
    let answer = Explorer::new(None).ok().and_then(|explorer| {
        let request = json!({ "case": case }).to_string();
        let control = Control::default();
        let answer = explorer.answer("/api/states", request.as_bytes(), &control, &|_| {});
        serde_json::from_slice::<Value>(&answer.bytes).ok()
    });
    let first = json!({ "of": json!([preset, [[key, value]]]).to_string(), "answer": answer });
    format!("<script type=\"application/json\" id=\"first\">{first}</script>\n")
}

/// The text of a file with the first occurrence of a part replaced.
pub(crate) fn replaced(
    name: &'static str,
    text: &str,
    part: &str,
    by: &str,
) -> Result<String, WriteError> {
    if text.contains(part) {
        Ok(text.replacen(part, by, 1))
    } else {
        Err(WriteError::Without(name, part.to_owned()))
    }
}
