//! Approach and retract curves with coexisting branches, on one thread and on two.

use divan::Bencher;
use nanotap::case::Case;
use nanotap::case::file::Source;
use nanotap::control::Control;
use nanotap::study::approach::{ApproachOptions, ApproachStudy};
use nanotap::study::registry::Study as _;
use nanotap::study::threads::install;

/// A stiff lever over a spring and a damper, two modes; 100 distances in each direction.
#[divan::bench(args = [1, 2], sample_count = 5, sample_size = 1)]
fn spring_damper_100(bencher: Bencher<'_, '_>, threads: usize) {
    approach(bencher, "stiff-lever.toml", 100, threads);
}

/// A lever over a DMT sample with van der Waals attraction; 10 distances in each direction.
#[divan::bench(args = [1, 2], sample_count = 3, sample_size = 1)]
fn dmt_10(bencher: Bencher<'_, '_>, threads: usize) {
    approach(bencher, "dforce-dmt.toml", 10, threads);
}

fn approach(bencher: Bencher<'_, '_>, name: &str, points: usize, threads: usize) {
    let path = format!("{}/../../docs/cases/{name}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).expect("a worked case");
    let source = Source {
        name: name.to_owned(),
        text,
    };
    let case = Case::parse(Some(source), &[]).expect("a valid case");
    let options = ApproachOptions {
        points,
        ..ApproachOptions::default()
    };
    bencher.bench_local(|| {
        install(Some(threads), || {
            ApproachStudy::run(&case, &options, &Control::default()).expect("a curve")
        })
        .expect("threads")
    });
}
