//! Damaged headers and chunks: a dataset opens, is refused with a reason, or reads as far as it is
//! intact.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use nanotap::case::Case;
use nanotap::dataset::merge::MAX_LISTED;
use nanotap::dataset::{Share, Store, Work, merge, table};
use nanotap::model::cantilever::Cantilever;
use nanotap::study::Computation as _;
use nanotap::study::sweep::{Summary, Sweep, SweepOptions};
use nanotap_dynamics::Control;
use proptest::prelude::*;
use serde_json::{Value, json};

use crate::folder::{Folder, bytes};

/// Two frequencies with one run each.
fn small(path: &Path) {
    let subject = Case::from(Cantilever {
        modes: 1,
        ..Cantilever::paper()
    });
    let sweep = Sweep::new(&subject, SweepOptions::over(["omega=18:20:2"])).unwrap();
    let store = Store::create_or_resume(path, sweep.schema().clone()).unwrap();
    let work = Work {
        share: Share::WHOLE,
        threads: 1,
        control: Control::default(),
    };
    sweep.compute(&store, &work).unwrap();
}

/// Everything that reads a dataset; merging opens it in the same way.
fn read(path: &Path) {
    let Ok(store) = Store::open(path) else {
        return;
    };
    let variables = store.schema().variables.len();
    for chunk in 0..store.chunks().min(64) {
        let block = store.schema().grid.block(chunk);
        for variable in 0..variables {
            let _ = store.read_chunk(&block, variable);
        }
    }
    let _ = Summary::of(&store);
    let _ = table::csv(&store, |_| Ok::<(), nanotap::dataset::StoreError>(()));
}

/// A store is not written through a symbolic link in it: the link's target stays as it was.
#[cfg(unix)]
#[test]
fn links_inside_a_store_are_refused() {
    let folder = Folder::new();
    let store = folder.join("links.zarr");
    small(&store);
    let target = folder.join("elsewhere");
    std::fs::write(&target, "untouched").unwrap();
    let chunk = store.join("period").join("0.0");
    let chunk = if chunk.exists() {
        chunk
    } else {
        store.join("period").join("0")
    };
    std::fs::remove_file(&chunk).unwrap();
    std::os::unix::fs::symlink(&target, &chunk).unwrap();
    let schema = Store::open(&store).unwrap().schema().clone();
    let refused = Store::create_or_resume(&store, schema).unwrap_err();
    assert!(refused.to_string().contains("symbolic link"), "{refused}");
    assert_eq!(std::fs::read_to_string(&target).unwrap(), "untouched");
}

/// A chunk that is only declared costs nothing: ten million of them took minutes when each was looked
/// for.
#[test]
fn declared_chunks_cost_nothing() {
    let folder = Folder::new();
    let (source, target) = (folder.join("declared.zarr"), folder.join("merged.zarr"));
    small(&source);
    let document = source.join(".zmetadata");
    let text = std::fs::read_to_string(&document).unwrap();
    let mut header: Value = serde_json::from_str(&text).unwrap();
    let layout = &mut header["metadata"][".zattrs"]["chunk_layout"];
    let mut axes: Value = serde_json::from_str(layout.as_str().unwrap()).unwrap();
    assert_eq!(axes["axes"][0], json!(["omega", 2, 1]));
    axes["axes"][0][1] = json!(10_000_000);
    *layout = axes.to_string().into();
    std::fs::write(&document, header.to_string()).unwrap();
    let merged = merge(&[source], &target).unwrap();
    assert_eq!((merged.chunks, merged.copied), (10_000_000, 2));
    assert_eq!(merged.missing_count, 9_999_998);
    assert_eq!((merged.missing.len(), merged.missing[0]), (MAX_LISTED, 2));
}

/// Values that may replace a value of a header.
fn hostile() -> impl Strategy<Value = Value> {
    prop::sample::select(vec![
        json!(null),
        json!(true),
        json!(0),
        json!(-1),
        json!(3),
        json!(1e18),
        json!(u64::MAX),
        json!(-1e308),
        json!(0.5),
        json!(""),
        json!("../../elsewhere"),
        json!("<f4"),
        json!("nan"),
        json!([]),
        json!([0]),
        json!([u64::MAX, u64::MAX]),
        json!({}),
        json!({"": []}),
    ])
}

/// Replaces the value at position `at` by `put`; `None` removes the entry.
fn change(value: &mut Value, at: &mut usize, put: Option<&Value>) -> bool {
    if *at == 0 {
        *value = put.cloned().unwrap_or_default();
        return true;
    }
    *at -= 1;
    match value {
        Value::Array(entries) => entries.iter_mut().any(|entry| change(entry, at, put)),
        Value::Object(entries) => {
            if put.is_none() && *at < entries.len() {
                let name = entries.keys().nth(*at).cloned();
                name.is_some_and(|name| entries.remove(&name).is_some())
            } else {
                entries.values_mut().any(|entry| change(entry, at, put))
            }
        }
        _ => false,
    }
}

/// An intact dataset, created once per process.
fn whole() -> &'static (Folder, BTreeMap<PathBuf, Vec<u8>>) {
    static WHOLE: OnceLock<(Folder, BTreeMap<PathBuf, Vec<u8>>)> = OnceLock::new();
    WHOLE.get_or_init(|| {
        let folder = Folder::new();
        small(&folder.join("data"));
        let files = bytes(&folder.join("data"));
        (folder, files)
    })
}

/// Tests of one process that share a folder run in sequence.
fn folder_lock() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Reads the dataset with one file changed by `damage`, and restores the file.
fn damaged(file: &Path, damage: impl FnOnce(Vec<u8>) -> Vec<u8>) {
    let (folder, files) = whole();
    let _turn = folder_lock();
    let path = folder.join("data");
    let content = &files[file];
    std::fs::write(path.join(file), damage(content.clone())).unwrap();
    read(&path);
    std::fs::write(path.join(file), content).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn headers_with_hostile_values(
        mut at in 0..400_usize, put in prop::option::weighted(0.8, hostile()),
    ) {
        damaged(Path::new(".zmetadata"), |content| {
            let mut header: Value = serde_json::from_slice(&content).unwrap();
            change(&mut header, &mut at, put.as_ref());
            header.to_string().into_bytes()
        });
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn files_with_bytes_changed(
        file in prop::sample::select(whole().1.keys().cloned().collect::<Vec<_>>()),
        at in 0.0..1.0_f64,
        bytes in prop::collection::vec(any::<u8>(), 0..6),
        cut in 0..8_usize,
    ) {
        damaged(&file, |mut content| {
            let at = (at * content.len() as f64) as usize;
            let end = (at + cut).min(content.len());
            content.splice(at..end, bytes);
            content
        });
    }
}

/// An intact dataset is read: failures of the others are due to their damage.
#[test]
fn an_intact_dataset_is_read() {
    let (folder, files) = whole();
    let _turn = folder_lock();
    let path = folder.join("data");
    let store = Store::open(&path).unwrap();
    store.require_all().unwrap();
    assert_eq!(Summary::of(&store).unwrap().runs % 2, 0);
    assert!(files.contains_key(Path::new(".zmetadata")));
}
