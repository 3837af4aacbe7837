//! A sweep into a dataset.

use divan::Bencher;
use divan::counter::ItemsCount;
use nanotap::control::Control;
use nanotap::dataset::{Share, Store, Work};
use nanotap::model::cantilever::Cantilever;
use nanotap::study::Computation as _;
use nanotap::study::sweep::{Sweep, SweepOptions};

use crate::cases;
use crate::folder::Folder;

/// The motions of [`runs_96`] without recording: a lower bound of its cost.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn bare(bencher: Bencher<'_, '_>) {
    const VALUES: usize = 24;
    const STARTS: usize = 4;
    let flows: Vec<_> = (0..VALUES)
        .map(|k| {
            let omega = 2.0 + 2.0 * k as f64 / (VALUES - 1) as f64;
            cases::at_rest(&cases::model(&Cantilever {
                omega,
                ..cases::paper(3)
            }))
        })
        .collect();
    bencher
        .counter(ItemsCount::new(VALUES * STARTS))
        .with_inputs(|| flows.clone())
        .bench_local_refs(|flows| {
            for flow in flows {
                for _ in 0..STARTS {
                    flow.run_periods(500).expect("a bounded motion");
                }
            }
        });
}

/// Ω from 2 to 4 in 24 values, 4 starts each, 400 periods discarded and 100 recorded, on one thread
/// and on two. Items are runs.
#[divan::bench(args = [1, 2], sample_count = 5, sample_size = 1)]
fn runs_96(bencher: Bencher<'_, '_>, threads: usize) {
    let subject = cases::subject(&cases::paper(3));
    let options = SweepOptions {
        transient: Some(400),
        starts: Some(4),
        ..SweepOptions::over(["omega=2:4:24"])
    };
    let sweep = Sweep::new(&subject, options).expect("options that make sense");
    let how = Work {
        share: Share::default(),
        threads,
        control: Control::default(),
    };
    bencher
        .counter(ItemsCount::new(sweep.runs()))
        .with_inputs(Folder::new)
        .bench_local_refs(|folder| {
            let store = Store::create_or_resume(folder.path(), sweep.schema().clone())
                .expect("an empty folder");
            sweep.compute(&store, &how).expect("room on the disk");
        });
}
