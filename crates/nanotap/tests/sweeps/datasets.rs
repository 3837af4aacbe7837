//! Stores: resuming, threads, shares, merging, errors.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap::case::Case;
use nanotap::dataset::{
    Share, Store, StoreError, Values, Work, WorkError, column, finish, merge, table,
};
use nanotap::model::cantilever::Cantilever;
use nanotap::study::Computation as _;
use nanotap::study::sweep::{Follow, Summary, Sweep, SweepOptions};
use nanotap_dynamics::{CancelFlag, Control};

use crate::folder::{Folder, assert_same, bytes};

/// 24 values of Ω × 3 starts, in 24 chunks.
fn sweep(follow: Follow) -> Sweep {
    let subject = Case::from(Cantilever::paper());
    let options = SweepOptions {
        starts: Some(3),
        seed: 7,
        follow,
        periods: 8,
        strobe: Some(3),
        ..SweepOptions::over(["omega=2.8:3.2:24"])
    };
    Sweep::new(&subject, options).unwrap()
}

fn how(threads: usize) -> Work<'static> {
    Work {
        share: Share::WHOLE,
        threads,
        control: Control::default(),
    }
}

fn computed(sweep: &Sweep, path: &Path, threads: usize) -> Store {
    let store = Store::create_or_resume(path, sweep.schema().clone()).unwrap();
    sweep.compute(&store, &how(threads)).unwrap();
    store
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let folder = Folder::new();
    for follow in [Follow::Off, Follow::Both] {
        let sweep = sweep(follow);
        let (one, two) = (folder.join("one"), folder.join("two"));
        computed(&sweep, &one, 1);
        computed(&sweep, &two, 2);
        assert_same(&one, &two);
        std::fs::remove_dir_all(one).unwrap();
        std::fs::remove_dir_all(two).unwrap();
    }
}

#[test]
fn a_store_in_memory_has_the_values_of_one_on_disk() {
    let folder = Folder::new();
    let sweep = sweep(Follow::Both);
    let disk = computed(&sweep, &folder.join("disk"), 2);
    let memory = Store::in_memory(sweep.schema().clone());
    assert_eq!(memory.missing(), memory.chunks());
    let block = memory.schema().grid.block(0);
    assert!(memory.read_chunk(&block, 0).is_err());
    sweep.compute(&memory, &how(2)).unwrap();
    assert_eq!(memory.missing(), 0);
    assert_eq!(
        memory.metadata(),
        Store::in_memory(disk.schema().clone()).metadata()
    );
    for chunk in 0..memory.chunks() {
        let block = memory.schema().grid.block(chunk);
        for variable in 0..memory.schema().variables.len() {
            let values = memory.read_chunk(&block, variable).unwrap();
            // Not a number where a motion has no such value: compared as it is stored.
            let of = |values: &Values| format!("{values:?}");
            let expected = column(&disk, &block, variable).unwrap();
            assert_eq!(of(&values), of(&expected), "{chunk}, {variable}");
        }
    }
    memory.write_beside("notes.txt", b"here").unwrap();
    assert_eq!(memory.read_beside("notes.txt").unwrap().unwrap(), b"here");
    assert!(memory.read_beside("others.txt").unwrap().is_none());
    assert!(!Path::new("notes.txt").exists());
    // Joining its chunks would gain nothing.
    let schema = memory.schema().clone();
    assert_eq!(*finish(memory).unwrap().schema(), schema);
}

#[test]
fn chunks_computed_elsewhere_are_the_same_bytes() {
    let folder = Folder::new();
    let nowhere = Control::default();
    for follow in [Follow::Off, Follow::Both] {
        let sweep = sweep(follow);
        let (here, there) = (folder.join("here"), folder.join("there"));
        computed(&sweep, &here, 2);
        let store = Store::create_or_resume(&there, sweep.schema().clone()).unwrap();
        for chunk in (0..store.chunks()).rev() {
            let files = sweep.chunk_files(chunk, &nowhere).unwrap();
            // Incomplete chunks and chunks of other datasets are refused.
            let mut short = files.clone();
            short[3].truncate(5);
            for wrong in [&short[..], &files[1..]] {
                let refused = store.take_files(chunk, wrong);
                assert!(matches!(refused, Err(StoreError::Damaged { .. })));
            }
            assert!(store.take_files(store.chunks(), &files).is_err());
            store.take_files(chunk, &files).unwrap();
        }
        assert_eq!(store.missing(), 0);
        // Only the continuation to neighbouring values is left to compute.
        computed(&sweep, &there, 1);
        assert_same(&here, &there);
        assert!(sweep.chunk_files(store.chunks(), &nowhere).is_none());
        let cancel = CancelFlag::new();
        cancel.cancel();
        let stopped = Control {
            cancel: Some(&cancel),
            progress: None,
        };
        assert!(sweep.chunk_files(0, &stopped).is_none());
        std::fs::remove_dir_all(here).unwrap();
        std::fs::remove_dir_all(there).unwrap();
    }
}

#[test]
fn interrupted_damaged_and_killed_work_resumes_to_the_same_bytes() {
    let folder = Folder::new();
    let sweep = sweep(Follow::Off);
    let whole = folder.join("whole");
    computed(&sweep, &whole, 2);

    // Interrupted.
    let path = folder.join("resumed");
    let store = Store::create_or_resume(&path, sweep.schema().clone()).unwrap();
    let (cancel, last) = (CancelFlag::new(), AtomicUsize::new(0));
    let progress = |done: usize, total: usize| {
        assert!(done <= total);
        last.fetch_max(done, Ordering::Relaxed);
        if done >= 10 {
            cancel.cancel();
        }
    };
    let control = Control {
        cancel: Some(&cancel),
        progress: Some(&progress),
    };
    let stopped = sweep.compute(&store, &Work { control, ..how(2) });
    let Err(WorkError::Cancelled { finished, total }) = stopped else {
        panic!("{stopped:?}")
    };
    assert!(finished >= 8 && finished < total, "{finished} of {total}");
    assert!(matches!(
        Summary::of(&store),
        Err(StoreError::Unfinished { .. })
    ));

    // Killed between two files of a chunk: files without a marker, a marker with a file
    // missing, a file cut short, a page of zeros, a half-written temporary file.
    let store = Store::open(&path).unwrap();
    assert_eq!(total - store.missing(), finished);
    std::fs::remove_file(path.join(".chunks/0")).unwrap();
    std::fs::remove_file(path.join("strobe/1.0.0.0")).unwrap();
    std::fs::write(path.join("period_max/2.0.0"), b"x").unwrap();
    let zeros = vec![0; std::fs::read(path.join("tip_max/3.0")).unwrap().len()];
    std::fs::write(path.join("tip_max/3.0"), zeros).unwrap();
    // Half a day old; a younger one may belong to another process.
    let long_ago = std::time::SystemTime::now() - std::time::Duration::from_secs(43_200);
    for half in ["tip_max/.5.0.123.tmp", ".chunks/.9.123.tmp"] {
        let file = std::fs::File::create(path.join(half)).unwrap();
        file.set_modified(long_ago).unwrap();
    }
    let store = Store::create_or_resume(&path, sweep.schema().clone()).unwrap();
    assert_eq!(total - store.missing(), finished - 4);
    sweep.compute(&store, &how(2)).unwrap();
    assert_same(&whole, &path);

    // Killed while the store was being created.
    let bare = folder.join("bare");
    std::fs::create_dir_all(bare.join("period")).unwrap();
    std::fs::copy(whole.join(".zgroup"), bare.join(".zgroup")).unwrap();
    computed(&sweep, &bare, 2);
    assert_same(&whole, &bare);
    // Nothing is left to compute, and nothing changes.
    computed(&sweep, &bare, 2);
    assert_same(&whole, &bare);
}

#[test]
fn shares_of_several_machines_merge_to_the_bytes_of_one() {
    let folder = Folder::new();
    let sweep = sweep(Follow::Off);
    let whole = folder.join("whole");
    computed(&sweep, &whole, 2);
    let shared = |path: &Path, share: &str| {
        let store = Store::create_or_resume(path, sweep.schema().clone()).unwrap();
        sweep
            .compute(
                &store,
                &Work {
                    share: share.parse().unwrap(),
                    ..how(2)
                },
            )
            .unwrap();
    };
    let parts: Vec<_> = (1..=3).map(|i| folder.join(&format!("part{i}"))).collect();
    for (i, part) in parts.iter().enumerate() {
        shared(part, &format!("{}/3", i + 1));
    }
    let merged = folder.join("merged");
    let first = merge(&parts[..2], &merged).unwrap();
    assert_eq!(
        first.missing,
        (2..first.chunks).step_by(3).collect::<Vec<_>>()
    );
    let all = merge(&parts[2..], &merged).unwrap();
    assert_eq!((all.copied, all.missing.len()), (first.missing.len(), 0));
    computed(&sweep, &merged, 1);
    assert_same(&whole, &merged);

    // Or all in one store, on a shared disk.
    let common = folder.join("common");
    for share in ["2/3", "3/3", "1/3"] {
        shared(&common, share);
    }
    assert_same(&whole, &common);

    // A damaged chunk is not merged.
    std::fs::write(parts[0].join("period/0.0"), b"x").unwrap();
    let holed = merge(&parts, &folder.join("holed")).unwrap();
    assert_eq!(holed.missing, [0]);
}

#[test]
fn stores_of_other_cases_are_refused_with_what_differs() {
    let folder = Folder::new();
    let path = folder.join("store");
    let sweep = sweep(Follow::Off);
    Store::create_or_resume(&path, sweep.schema().clone()).unwrap();
    let other = |case: Cantilever, starts, seed| {
        let options = SweepOptions {
            starts: Some(starts),
            seed,
            ..sweep.options().clone()
        };
        let other = Sweep::new(&Case::from(case), options).unwrap();
        Store::create_or_resume(&path, other.schema().clone())
            .unwrap_err()
            .to_string()
    };
    let message = other(
        Cantilever {
            alpha4: 25.0,
            ..Cantilever::paper()
        },
        3,
        7,
    );
    assert!(
        message.contains("case.alpha4: 20.0 there, 25.0 here"),
        "{message}"
    );
    assert!(
        !message.contains("alpha6") && !message.contains("seed"),
        "{message}"
    );
    let message = other(Cantilever::paper(), 3, 8);
    assert!(message.contains("seed: 7 there, 8 here"), "{message}");
    let message = other(Cantilever::paper(), 4, 7);
    assert!(
        message.contains("sweep.starts.count: 3 there, 4 here"),
        "{message}"
    );

    // The case's own value of the varied parameter does not matter.
    let same = Sweep::new(
        &Case::from(Cantilever {
            omega: 9.0,
            ..Cantilever::paper()
        }),
        sweep.options().clone(),
    );
    Store::create_or_resume(&path, same.unwrap().schema().clone()).unwrap();

    // Merging datasets that do not belong together.
    let second = folder.join("second");
    let options = SweepOptions {
        periods: 9,
        ..sweep.options().clone()
    };
    let longer = Sweep::new(&Case::from(Cantilever::paper()), options).unwrap();
    Store::create_or_resume(&second, longer.schema().clone()).unwrap();
    let message = merge(&[path.clone(), second], &folder.join("m"))
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("sweep.periods: 9 there, 8 here"),
        "{message}"
    );
}

#[test]
fn other_folders_are_left_unchanged() {
    let folder = Folder::new();
    let sweep = sweep(Follow::Off);
    let file = folder.join("file");
    std::fs::write(&file, "mine").unwrap();
    let strange = folder.join("strange");
    std::fs::create_dir(&strange).unwrap();
    std::fs::write(strange.join("thesis.tex"), "mine").unwrap();
    for path in [&file, &strange] {
        let error = Store::create_or_resume(path, sweep.schema().clone()).unwrap_err();
        assert!(matches!(error, StoreError::Occupied { .. }), "{error}");
        assert!(Store::open(path).is_err());
    }
    assert!(
        Store::open(&folder.join("nowhere"))
            .unwrap_err()
            .to_string()
            .contains("does not exist")
    );
    assert_eq!(bytes(&strange).len(), 1);
}

#[test]
fn an_opened_store_equals_the_created_one() {
    let folder = Folder::new();
    let path = folder.join("store");
    let sweep = sweep(Follow::Both);
    computed(&sweep, &path, 2);
    let store = Store::open(&path).unwrap();
    assert_eq!(store.missing(), 0);
    assert_eq!(store.schema().grid, sweep.schema().grid);
    assert_eq!(store.schema().variables, sweep.schema().variables);
    assert_eq!(store.schema().attributes, sweep.schema().attributes);
    for coordinate in &sweep.schema().coordinates {
        assert_eq!(
            store.schema().coordinate(&coordinate.name),
            Some(coordinate)
        );
    }
    // 24 values × 3 starts × 2 directions, one line each in the table.
    let mut text = String::new();
    table::csv::<StoreError>(&store, |part| {
        text.push_str(part);
        Ok(())
    })
    .unwrap();
    assert_eq!(text.lines().count(), 1 + 24 * 3 * 2);
    let header = text.lines().next().unwrap();
    assert!(
        header.starts_with("omega,start,direction,classification,period,"),
        "{header}"
    );
    let row: Vec<&str> = text.lines().nth(1).unwrap().split(',').collect();
    assert_eq!(row.len(), header.split(',').count());
    assert_eq!(
        (row[0], row[2], row[3], row[4]),
        ("2.8", "up", "periodic", "2")
    );
    // The value in the table is the one in the store.
    let block = store.schema().grid.block(0);
    let place = store.schema().index_of("tip_max").unwrap();
    let Values::Real(tips) = store.read_chunk(&block, place).unwrap() else {
        panic!()
    };
    assert_eq!(row[6].parse::<f64>().unwrap(), tips[0]);
}
