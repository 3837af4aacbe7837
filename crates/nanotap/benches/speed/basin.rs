//! Basins of attraction into a dataset.

use divan::Bencher;
use divan::counter::ItemsCount;
use nanotap::control::Control;
use nanotap::dataset::{Share, Store, Work};
use nanotap::study::Computation as _;
use nanotap::study::basin::{Basin, BasinOptions};

use crate::cases;
use crate::folder::Folder;

/// 48 × 48 starts at Ω = 20 without a tip mass, on one thread and on two; the preceding census is
/// not timed. Items are points.
#[divan::bench(args = [1, 2], sample_count = 5, sample_size = 1)]
fn points_2304(bencher: Bencher<'_, '_>, threads: usize) {
    let subject = cases::subject(&cases::coexisting(3));
    let options = BasinOptions::over("a1=-1:1:48", "v1=-20:20:48");
    let basin = Basin::new(&subject, &options, &Control::default()).expect("two attractors");
    let how = Work {
        share: Share::default(),
        threads,
        control: Control::default(),
    };
    bencher
        .counter(ItemsCount::new(basin.points()))
        .with_inputs(Folder::new)
        .bench_local_refs(|folder| {
            let store = Store::create_or_resume(folder.path(), basin.schema().clone())
                .expect("an empty folder");
            basin.compute(&store, &how).expect("room on the disk");
        });
}
