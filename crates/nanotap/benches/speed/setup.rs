//! Setting up a model for one value of the parameters.

use divan::{Bencher, black_box};
use nanotap::case::{Key, MovingGap};
use nanotap::model::Model;

use crate::cases::{self, MODES};

/// From a case to a model that is ready to run, as in a sweep over the drive.
#[divan::bench(args = MODES)]
fn model(bencher: Bencher<'_, '_>, modes: usize) {
    let case = cases::paper(modes);
    bencher.bench_local(|| Model::cantilever(black_box(&case)).expect("a valid case"));
}

/// The same for a case whose eigenbases are not known from a previous one.
#[divan::bench(args = MODES)]
fn another_stiffness(bencher: Bencher<'_, '_>, modes: usize) {
    let mut case = cases::paper(modes);
    bencher.bench_local(|| {
        case.alpha4 += 1e-3;
        Model::cantilever(black_box(&case)).expect("a valid case")
    });
}

/// One drive period at a gap that changes before each, which needs no new model; compare with
/// `period`.
#[divan::bench(args = MODES)]
fn period_at_another_gap(bencher: Bencher<'_, '_>, modes: usize) {
    let mut moving = MovingGap::new(&cases::subject(&cases::paper(modes))).expect("a valid case");
    let mut state = moving.model().expect("a finite gap").rest();
    let mut gap = 0.0;
    bencher.bench_local(|| {
        gap += 1e-9;
        moving.set(gap).expect("a finite gap");
        moving.advance(&mut state)
    });
}

/// The derivative of the system with respect to Ω.
#[divan::bench(args = MODES)]
fn tangent(bencher: Bencher<'_, '_>, modes: usize) {
    let case = cases::paper(modes);
    let (subject, model) = (cases::subject(&case), cases::model(&case));
    let key = Key::Omega;
    bencher.bench_local(|| {
        black_box(&subject)
            .tangent(&model, key)
            .expect("a smooth family")
    });
}
