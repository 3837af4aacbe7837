//! One drive period.

use divan::Bencher;
use divan::counter::ItemsCount;
use nanotap::model::cantilever::Cantilever;
use nanotap::observe::{ObservableSet, measure};
use nanotap_flow::{Ensemble, Flow, FlowError};
use std::sync::Arc;

use crate::cases::{self, DAMPINGS, MODES};

/// Periods per run: chaotic motion differs from period to period.
const PERIODS: usize = 100;
/// Number of simultaneous motions.
const MOTIONS: usize = 64;

/// Times [`PERIODS`] periods from the present state of `flow`.
fn periods(bencher: Bencher<'_, '_>, flow: &Flow) {
    bencher
        .counter(ItemsCount::new(PERIODS))
        .with_inputs(|| flow.clone())
        .bench_local_refs(|flow| cases::run(flow, PERIODS));
}

/// The paper's case at Ω = 2.6, α3 = 0.1. Items are periods.
#[divan::bench(args = MODES)]
fn medium_damping(bencher: Bencher<'_, '_>, modes: usize) {
    periods(bencher, &damped(modes, DAMPINGS[1]));
}

/// The same with α3 = 0.01: fast modes ring on.
#[divan::bench(args = MODES)]
fn low_damping(bencher: Bencher<'_, '_>, modes: usize) {
    periods(bencher, &damped(modes, DAMPINGS[0]));
}

/// The same with α3 = 1.
#[divan::bench(args = MODES)]
fn high_damping(bencher: Bencher<'_, '_>, modes: usize) {
    periods(bencher, &damped(modes, DAMPINGS[2]));
}

/// The paper's case without stopping at the ends of periods.
#[divan::bench(args = MODES)]
fn in_one_go(bencher: Bencher<'_, '_>, modes: usize) {
    let flow = damped(modes, DAMPINGS[1]);
    bencher
        .counter(ItemsCount::new(PERIODS))
        .with_inputs(|| flow.clone())
        .bench_local_refs(|flow| flow.run_periods(PERIODS).expect("a bounded motion"));
}

/// 64 simultaneous motions, each over as many periods. Items are periods.
#[divan::bench(args = MODES)]
fn side_by_side(bencher: Bencher<'_, '_>, modes: usize) {
    together(bencher, modes, |ensemble, states, periods, _| {
        ensemble.advance(states, periods)
    });
}

/// The same, with the states at the ends of all periods.
#[divan::bench(args = MODES)]
fn side_by_side_strobed(bencher: Bencher<'_, '_>, modes: usize) {
    together(bencher, modes, Ensemble::advance_through);
}

/// Times `advance` of [`MOTIONS`] motions on the attractor.
fn together(
    bencher: Bencher<'_, '_>,
    modes: usize,
    advance: impl Fn(&mut Ensemble, &mut [f64], &[usize], &mut [Vec<f64>]) -> Vec<Result<(), FlowError>>,
) {
    let case = cases::paper(modes);
    let model = cases::model(&case);
    let mut ensemble = Ensemble::new(Arc::clone(&model.system));
    let mut states = vec![0.0; MOTIONS * model.dimension()];
    for (k, state) in states.chunks_mut(model.dimension()).enumerate() {
        state[0] = 0.01 * k as f64;
    }
    let mut passed = vec![Vec::new(); MOTIONS];
    let mut run = |states: &mut [f64], periods| {
        let results = advance(&mut ensemble, states, &[periods; MOTIONS], &mut passed);
        assert!(results.iter().all(Result::is_ok), "bounded motions");
    };
    run(&mut states, 400);
    bencher
        .counter(ItemsCount::new(MOTIONS * PERIODS))
        .with_inputs(|| states.clone())
        .bench_local_refs(|states| run(states, PERIODS));
}

/// The same, with the observables that sweeps record.
#[divan::bench(args = MODES)]
fn measured(bencher: Bencher<'_, '_>, modes: usize) {
    recorded(bencher, modes, ObservableSet::COMMON);
}

/// The same, with all observables, including the beam's clearance.
#[divan::bench(args = MODES)]
fn measured_all(bencher: Bencher<'_, '_>, modes: usize) {
    recorded(bencher, modes, ObservableSet::ALL);
}

fn recorded(bencher: Bencher<'_, '_>, modes: usize, set: ObservableSet) {
    let model = cases::model(&cases::paper(modes));
    let mut state = vec![0.0; 2 * modes];
    damped(modes, DAMPINGS[1]).state(&mut state);
    bencher
        .counter(ItemsCount::new(PERIODS))
        .bench_local(|| measure(&model, &state, PERIODS, set).expect("a bounded motion"));
}

/// A fast drive: Ω = 20.
#[divan::bench(args = MODES)]
fn fast_drive(bencher: Bencher<'_, '_>, modes: usize) {
    periods(bencher, &cases::settled(&cases::coexisting(modes)));
}

/// The period-1 orbit that touches without indenting (N = 3), just misses, or indents slightly.
#[divan::bench(args = [0.0, 1e-6, -1e-6])]
fn grazing(bencher: Bencher<'_, '_>, gap: f64) {
    let (case, state) = cases::grazing(gap);
    let mut flow = cases::at_rest(&cases::model(&case));
    flow.start(&state, 0.0).expect("a free motion");
    periods(bencher, &flow);
}

fn damped(modes: usize, alpha3: f64) -> Flow {
    cases::settled(&Cantilever {
        alpha3,
        ..cases::paper(modes)
    })
}
