//! A census of coexisting motions.

use divan::Bencher;
use nanotap::control::Control;
use nanotap::study::attractors::{AttractorsOptions, attractors};

use crate::cases;

/// The default census of the paper's case, which is chaotic.
#[divan::bench(sample_count = 3, sample_size = 1)]
fn of_the_paper(bencher: Bencher<'_, '_>) {
    let model = cases::model(&cases::paper(3));
    let options = AttractorsOptions::default();
    bencher.bench_local(|| {
        attractors(&model, &options, &Control::default()).expect("options that make sense")
    });
}

/// 64 starts at Ω = 20 without a tip mass.
#[divan::bench(args = [2, 3, 5], sample_count = 5, sample_size = 1)]
fn starts_64(bencher: Bencher<'_, '_>, modes: usize) {
    let model = cases::model(&cases::coexisting(modes));
    let options = AttractorsOptions {
        starts: Some(64),
        ..AttractorsOptions::default()
    };
    bencher.bench_local(|| {
        attractors(&model, &options, &Control::default()).expect("options that make sense")
    });
}
