//! One run as in the command, compared with propagation alone.

use divan::Bencher;
use divan::counter::ItemsCount;
use nanotap::observe::ObservableSet;
use nanotap::study::simulate::{SimulateOptions, simulate};

use crate::cases;

/// Recorded periods: so many that the classification of the motion is negligible.
const PERIODS: usize = 100_000;

/// The paper's case from rest, without observers. Items are periods.
#[divan::bench(args = [3], sample_count = 3, sample_size = 1)]
fn bare(bencher: Bencher<'_, '_>, modes: usize) {
    let flow = cases::at_rest(&cases::model(&cases::paper(modes)));
    bencher
        .counter(ItemsCount::new(PERIODS))
        .with_inputs(|| flow.clone())
        .bench_local_refs(|flow| cases::run(flow, PERIODS));
}

/// The same as a run that keeps its last state only.
#[divan::bench(args = [3], sample_count = 3, sample_size = 1)]
fn strobe_only(bencher: Bencher<'_, '_>, modes: usize) {
    run(bencher, modes, ObservableSet::NONE);
}

/// The same with all observables.
#[divan::bench(args = [3], sample_count = 3, sample_size = 1)]
fn everything(bencher: Bencher<'_, '_>, modes: usize) {
    run(bencher, modes, ObservableSet::ALL);
}

fn run(bencher: Bencher<'_, '_>, modes: usize, observables: ObservableSet) {
    let model = cases::model(&cases::paper(modes));
    let options = SimulateOptions {
        periods: PERIODS,
        transient: Some(0),
        observables: Some(observables),
        ..SimulateOptions::default()
    };
    bencher
        .counter(ItemsCount::new(PERIODS))
        .bench_local(|| simulate(&model, &options).expect("a bounded motion"));
}
