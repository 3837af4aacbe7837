//! Finished datasets in few files: the same values, resumed, merged and recovered as before.

use std::path::Path;

use nanotap::case::Case;
use nanotap::dataset::{Store, Values, Work, finish, merge};
use nanotap::model::cantilever::Cantilever;
use nanotap::study::Computation as _;
use nanotap::study::sweep::{Summary, Sweep, SweepOptions};
use nanotap_dynamics::Control;

use crate::folder::{Folder, assert_same, bytes};

/// 40 × 6 values × 2 starts: hundreds of chunk files, as of a large sweep.
fn sweep() -> Sweep {
    let options = SweepOptions {
        starts: Some(2),
        seed: 7,
        periods: 3,
        ..SweepOptions::over(["omega=2.8:3.2:40", "alpha4=18:22:6"])
    };
    Sweep::new(&Case::from(Cantilever::paper().with_modes(1)), options).unwrap()
}

fn share(of: &str) -> Work<'static> {
    Work {
        share: of.parse().unwrap(),
        threads: 2,
        control: Control::default(),
    }
}

fn computed(sweep: &Sweep, path: &Path, of: &str) -> Store {
    let store = Store::create_or_resume(path, sweep.schema().clone()).unwrap();
    sweep.compute(&store, &share(of)).unwrap();
    store
}

/// All values of every variable, by entry of the grid.
fn values(store: &Store) -> Vec<Vec<(Vec<usize>, Values)>> {
    let schema = store.schema();
    let of = |variable: usize| {
        let stride = schema.variables[variable].stride();
        let mut all = Vec::new();
        for chunk in 0..store.chunks() {
            let block = schema.grid.block(chunk);
            let read = store.read_chunk(&block, variable).unwrap().numbers();
            for (entry, row) in block.entries().zip(read.chunks(stride)) {
                all.push((entry, Values::Real(row.to_vec())));
            }
        }
        all.sort_by(|a, b| a.0.cmp(&b.0));
        all
    };
    (0..schema.variables.len()).map(of).collect()
}

#[test]
fn a_finished_dataset_has_few_files_and_the_same_values() {
    let folder = Folder::new();
    let path = folder.join("s.zarr");
    let sweep = sweep();
    let store = computed(&sweep, &path, "1/1");
    let (before, files) = (values(&store), bytes(&path).len());
    let packed = finish(store).unwrap();
    assert!(files > 500 && bytes(&path).len() < 120, "{files}");
    assert_eq!(packed.missing(), 0);
    // NaN is not equal to itself.
    assert_eq!(format!("{:?}", values(&packed)), format!("{before:?}"));
    assert_eq!(
        Summary::of(&packed).unwrap(),
        Summary::of(&Store::open(&path).unwrap()).unwrap()
    );
    // The same command again finds everything done, and leaves every byte.
    let there = bytes(&path);
    let again = finish(computed(&sweep, &path, "1/1")).unwrap();
    assert_eq!((again.missing(), bytes(&path)), (0, there));
}

#[test]
fn shares_that_are_merged_come_to_the_same_bytes() {
    let folder = Folder::new();
    let sweep = sweep();
    let whole = folder.join("whole.zarr");
    finish(computed(&sweep, &whole, "1/1")).unwrap();
    let parts = ["1/2", "2/2"].map(|of| {
        let path = folder.join(&format!("{}.zarr", &of[..1]));
        let store = computed(&sweep, &path, of);
        // A share stays in the chunks of work.
        assert!(finish(store).unwrap().missing() > 0);
        path
    });
    let merged = folder.join("merged.zarr");
    assert!(merge(&parts, &merged).unwrap().missing.is_empty());
    finish(computed(&sweep, &merged, "1/1")).unwrap();
    assert_same(&whole, &merged);
    // A whole dataset and a share of it are the whole.
    let both = folder.join("both.zarr");
    merge(&[parts[0].clone(), whole.clone()], &both).unwrap();
    finish(computed(&sweep, &both, "1/1")).unwrap();
    assert_same(&whole, &both);
}

/// Whatever is killed while chunks are joined, the consolidated metadata say which division counts.
#[test]
fn what_a_kill_leaves_is_a_whole_dataset() {
    let folder = Folder::new();
    let (path, other) = (folder.join("s.zarr"), folder.join("o.zarr"));
    let sweep = sweep();
    let store = computed(&sweep, &path, "1/1");
    let before = format!("{:?}", values(&store));
    let old = bytes(&path);
    finish(computed(&sweep, &other, "1/1")).unwrap();
    // Joined chunks are written, the metadata of one array too, and nothing was removed.
    for (name, content) in bytes(&other) {
        let joined = name.components().count() > 2 || name.starts_with(".joined");
        if joined || name == Path::new("phase").join(".zarray") {
            let file = path.join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, content).unwrap();
        }
    }
    let again = Store::create_or_resume(&path, sweep.schema().clone()).unwrap();
    assert_eq!(again.missing(), 0);
    assert_eq!(format!("{:?}", values(&again)), before);
    finish(again).unwrap();
    assert_same(&path, &other);
    // Everything is joined, and the old chunks are still there.
    for (name, content) in old {
        let file = path.join(&name);
        let chunk = name
            .file_name()
            .is_some_and(|n| n.to_string_lossy().contains("0.0"));
        if chunk && !file.exists() {
            std::fs::write(file, content).unwrap();
        }
    }
    assert_eq!(
        format!("{:?}", values(&Store::open(&path).unwrap())),
        before
    );
}

/// A process that still reads the chunks of work finds their values in the joined ones.
#[test]
fn another_process_reads_on() {
    let folder = Folder::new();
    let path = folder.join("s.zarr");
    let sweep = sweep();
    let (one, other) = (
        computed(&sweep, &path, "1/1"),
        computed(&sweep, &path, "1/1"),
    );
    let before = format!("{:?}", values(&one));
    finish(one).unwrap();
    assert_eq!(format!("{:?}", values(&other)), before);
    let there = bytes(&path);
    assert_eq!(finish(other).unwrap().missing(), 0);
    assert_eq!(bytes(&path), there);
}

/// A damaged chunk of a finished dataset is computed again.
#[test]
fn a_damaged_chunk_is_computed_again() {
    let folder = Folder::new();
    let path = folder.join("s.zarr");
    let sweep = sweep();
    finish(computed(&sweep, &path, "1/1")).unwrap();
    let before = bytes(&path);
    let file = path.join("tip_max").join("0/0/0");
    assert!(file.exists());
    std::fs::write(&file, b"damaged").unwrap();
    let store = Store::create_or_resume(&path, sweep.schema().clone()).unwrap();
    // The joined chunk held every chunk of work.
    assert_eq!(store.missing(), store.chunks());
    sweep.compute(&store, &share("1/1")).unwrap();
    finish(store).unwrap();
    assert_eq!(bytes(&path), before);
}
