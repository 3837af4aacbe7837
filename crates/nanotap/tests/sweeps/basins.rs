//! Basins on slices.

use std::path::Path;

use nanotap::ErrorKind;
use nanotap::case::Case;
use nanotap::case::physical::Catalogue;
use nanotap::case::units::Units;
use nanotap::dataset::{Share, Store, Values, Work};
use nanotap::figure::basin::figure;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::model_map::ModelMap;
use nanotap::study::Computation as _;
use nanotap::study::basin::{Basin, BasinOptions, SliceRange, shares};
use nanotap_dynamics::{CancelFlag, ClassifyOptions, Control, MotionKind, classify};

use crate::folder::{Folder, assert_same};

fn bistable() -> Case {
    Case::from(Cantilever {
        omega: 20.0,
        alpha1: 0.0,
        ..Cantilever::paper()
    })
}

fn slice(nx: usize, ny: usize) -> BasinOptions {
    BasinOptions {
        starts: 24,
        ..BasinOptions::over(&format!("a1=-1:1:{nx}"), &format!("v1=-4:4:{ny}"))
    }
}

fn computed(
    subject: &Case,
    options: &BasinOptions,
    path: &std::path::Path,
    threads: usize,
) -> Store {
    let basin = Basin::new(subject, options, &Control::default()).unwrap();
    let store = Store::create_or_resume(path, basin.schema().clone()).unwrap();
    let control = Control::default();
    basin
        .compute(
            &store,
            &Work {
                share: Share::WHOLE,
                threads,
                control,
            },
        )
        .unwrap();
    store
}

/// Ω = 20, α1 = 0: a period-1 and a period-4 motion coexist. The label of every point must be the
/// motion to which a plain run from its state converges.
#[test]
fn chunks_computed_elsewhere_are_the_same_bytes() {
    let folder = Folder::new();
    let (here, there) = (folder.join("here"), folder.join("there"));
    let (subject, options) = (bistable(), slice(9, 7));
    computed(&subject, &options, &here, 2);
    let basin = Basin::new(&subject, &options, &Control::default()).unwrap();
    let store = Store::create_or_resume(&there, basin.schema().clone()).unwrap();
    for chunk in 0..store.chunks() {
        let files = basin.chunk_files(chunk, &Control::default()).unwrap();
        store.take_files(chunk, &files).unwrap();
    }
    assert_same(&here, &there);
}

#[test]
fn labels_agree_with_plain_runs() {
    let folder = Folder::new();
    let store = computed(&bistable(), &slice(14, 12), &folder.join("a"), 2);
    let found = shares(&store).unwrap();
    let mut periods: Vec<_> = found.attractors.iter().map(|a| a.period.unwrap()).collect();
    periods.sort_unstable();
    assert_eq!(periods, [1, 4]);
    let sum: f64 = found.attractors.iter().map(|a| a.fraction).sum();
    assert!(
        (sum + found.unsettled - 1.0).abs() < 1e-12 && found.unsettled < 0.02,
        "{found:?}"
    );
    assert!(
        found.attractors.iter().all(|a| a.fraction > 0.02),
        "{found:?}"
    );

    let mut map = ModelMap::new(&bistable().model().unwrap());
    let (mut checked, mut wrong) = (0, 0);
    for chunk in 0..store.chunks() {
        let block = store.schema().grid.block(chunk);
        let Values::Whole(labels) = store.read_chunk(&block, 0).unwrap() else {
            panic!()
        };
        for (entry, label) in block.entries().zip(labels) {
            let (v1, a1) = (
                -4.0 + 8.0 * entry[0] as f64 / 11.0,
                -1.0 + 2.0 * entry[1] as f64 / 13.0,
            );
            let classified = classify(
                &mut map,
                &[a1, 0.0, 0.0, v1, 0.0, 0.0],
                &ClassifyOptions::default(),
            );
            let MotionKind::Periodic(orbit) = classified.kind else {
                continue;
            };
            let Ok(index) = usize::try_from(label) else {
                continue;
            };
            checked += 1;
            wrong += usize::from(found.attractors[index].period != Some(orbit.period));
        }
    }
    assert!(checked > 150 && wrong == 0, "{wrong} of {checked}");
    let svg = figure(&store).unwrap().to_svg().unwrap();
    assert!(svg.contains("period 1") && svg.contains("period 4"));
}

#[test]
fn bytes_do_not_depend_on_threads_or_interruptions() {
    let folder = Folder::new();
    let (subject, options) = (bistable(), slice(9, 40));
    let whole = folder.join("whole");
    computed(&subject, &options, &whole, 1);
    let path = folder.join("stopped");
    let basin = Basin::new(&subject, &options, &Control::default()).unwrap();
    let store = Store::create_or_resume(&path, basin.schema().clone()).unwrap();
    let cancel = CancelFlag::new();
    let progress = |done: usize, _: usize| {
        if done > 4 {
            cancel.cancel();
        }
    };
    let control = Control {
        cancel: Some(&cancel),
        progress: Some(&progress),
    };
    assert!(
        basin
            .compute(
                &store,
                &Work {
                    share: Share::WHOLE,
                    threads: 2,
                    control
                }
            )
            .is_err()
    );
    assert!(store.missing() > 0 && store.missing() < store.chunks());
    computed(&subject, &options, &path, 2);
    assert_same(&whole, &path);
}

/// Given states replace the census, and are checked like any start.
#[test]
fn attractors_can_be_given() {
    let folder = Folder::new();
    let first = computed(&bistable(), &slice(8, 8), &folder.join("a"), 2);
    let states: Vec<Vec<f64>> = shares(&first)
        .unwrap()
        .attractors
        .into_iter()
        .map(|a| a.state)
        .collect();
    let options = BasinOptions {
        attractors: Some(states),
        ..slice(8, 8)
    };
    let second = computed(&bistable(), &options, &folder.join("b"), 2);
    let fractions = |store| -> Vec<(Option<usize>, f64)> {
        let mut all: Vec<_> = shares(store)
            .unwrap()
            .attractors
            .iter()
            .map(|a| (a.period, a.fraction))
            .collect();
        all.sort_by_key(|(period, _)| *period);
        all
    };
    assert_eq!(fractions(&first), fractions(&second));
}

#[test]
fn invalid_slices_are_refused() {
    for given in [
        "",
        "a1",
        "a1=",
        "a1=0:1",
        "a1=0:1:2:3",
        "a1=x:1:5",
        "a1=0:inf:5",
        "a1=0:1:1",
        "a1=0:1:-4",
        "a1=0:1:2.5",
        "a1=1:0:5",
        "a1=1:1:5",
        "a1=0:1:99999999",
    ] {
        let error = SliceRange::parse(given, &Units::Model).unwrap_err();
        assert!(error.to_string().contains(&format!("`{given}`")), "{error}");
    }
    let refused = |x, y, change: &dyn Fn(&mut BasinOptions)| {
        let mut options = BasinOptions::over(x, y);
        change(&mut options);
        Basin::new(&bistable(), &options, &Control::default())
            .unwrap_err()
            .to_string()
    };
    let keep = |_: &mut BasinOptions| {};
    for (message, word) in [
        (
            refused("a4=0:1:5", "v1=0:1:5", &keep),
            "a1, a2, a3, v1, v2, v3",
        ),
        (refused("a1=0:1:5", "a1=0:1:5", &keep), "both axes"),
        (
            refused("a1=0:1:5", "v1=0:1:5", &|o| o.starts = 0),
            "0 starts",
        ),
        (
            refused("a1=0:1:5", "v1=0:1:5", &|o| o.periods = Some(0)),
            "0 periods",
        ),
        (
            refused("a1=0:1:5", "v1=0:1:5", &|o| {
                o.state = Some(vec![0.0; 3].into());
            }),
            "3 numbers where 6",
        ),
        (
            refused("a1=0:1:5", "v1=0:1:5", &|o| {
                o.attractors = Some(vec![vec![0.0]]);
            }),
            "1 numbers where 6",
        ),
    ] {
        assert!(message.contains(word), "{word}: {message}");
    }
    let cancel = CancelFlag::new();
    cancel.cancel();
    let control = Control {
        cancel: Some(&cancel),
        progress: None,
    };
    let stopped = Basin::new(&bistable(), &slice(5, 5), &control).unwrap_err();
    assert_eq!(stopped.kind, ErrorKind::Stopped);
}

/// Under Lennard-Jones the tip starts behind the surface where the gap at drive phase 0 is not
/// positive; those points are labelled so, and all others go to the one motion.
#[test]
fn points_behind_the_surface_are_labelled_so() {
    let words = [
        "modes=1",
        "cantilever.k1=1 N/m",
        "cantilever.f0=10 kHz",
        "cantilever.Q=25",
        "tip.radius=100 nm",
        "sample.law=lennard-jones",
        "sample.hamaker=8.888888888888889e-18 J",
        "sample.repulsion=6.48e-69 J m^6",
        "drive.actuation=tip",
        "drive.frequency_ratio=1",
        "drive.force=10 nN",
        "gap.tip=8 nm",
    ];
    let case = Case::parse(None, &words.map(str::to_owned)).unwrap();
    let model = case.model().unwrap();
    let wall = model.wall().unwrap();
    let at_wall = wall.least / wall.row[0];
    let speed = at_wall.abs() * model.frequency();
    let folder = Folder::new();
    let options = BasinOptions {
        starts: 8,
        ..BasinOptions::default()
    };
    // The surface is between the second and the third of eight columns.
    let scales = case.physical().unwrap().scales;
    let (length, velocity) = (scales.length, scales.velocity);
    let options = BasinOptions {
        x: format!(
            "a1={}:{}:8",
            1.6 * at_wall * length,
            -1.9 * at_wall * length
        ),
        y: format!("v1={}:{}:3", -speed * velocity, speed * velocity),
        ..options
    };
    let store = computed(&case, &options, &folder.join("basin"), 2);
    let found = shares(&store).unwrap();
    assert_eq!(found.points, 24);
    assert_eq!(found.behind, 6.0 / 24.0);
    assert_eq!(
        (found.unsettled, found.unbounded, found.failed),
        (0.0, 0.0, 0.0)
    );
    assert!(figure(&store).is_ok());
}

/// Disturbances of a lever with Q = 400 die in thousands of periods: after 1000 most points are open.
#[test]
fn a_slow_lever_is_followed_until_it_settles() {
    let file = Path::new("../../docs/cases/bistable-lever.toml");
    let words = ["modes=1", "cantilever.Q=400"].map(str::to_owned);
    let lever = Case::load(Some(file), &words, &Catalogue::shared()).unwrap();
    let unsettled = |periods: Option<usize>| {
        let options = BasinOptions {
            periods,
            ..BasinOptions::over("a1=-15nm:15nm:6", "v1=-0.03:0.03:6")
        };
        let folder = Folder::new();
        let store = computed(&lever, &options, &folder.join("slow"), 2);
        let found = shares(&store).unwrap();
        assert_eq!(found.attractors.len(), 2);
        found.unsettled
    };
    assert!(unsettled(Some(1000)) > 0.5);
    assert_eq!(unsettled(None), 0.0);
}
