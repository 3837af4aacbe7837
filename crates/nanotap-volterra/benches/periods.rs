//! Periods of DMT contact with van der Waals attraction, by number of modes.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

#[path = "../tests/common/mod.rs"]
mod common;

use nanotap_volterra::{Coarse, Flow, ForceLaw, laws};
use std::f64::consts::TAU;
use std::sync::Arc;

fn main() {
    divan::main();
}

fn flow(modes: usize, nodes: usize) -> (Flow, Vec<f64>) {
    flow_under(common::dmt(), modes, nodes)
}

/// DMT contact as a formula of a case.
fn written() -> Arc<dyn ForceLaw> {
    let text = "4/3*E*sqrt(R)*max(a0 - d, 0)^1.5/(1 - nu^2) - H*R/(6*max(d, a0)^2)";
    let law = laws::written::law(text, &[]).unwrap();
    let value = |name: &str| match name {
        "modulus" => 1.0,
        "poisson" => 0.3,
        "radius" => 5.0,
        "hamaker" => 0.03,
        _ => 0.169,
    };
    let values: Vec<f64> = law.entry.parameters.iter().map(|p| value(p.name)).collect();
    law.with(&values).unwrap()
}

fn flow_under(law: Arc<dyn ForceLaw>, modes: usize, nodes: usize) -> (Flow, Vec<f64>) {
    let system = common::beam(law, modes, 0.9, 200.0, 20.0, 18.0, nodes);
    let mut flow = Flow::new(Arc::new(system));
    // Near the repulsive orbit, after a transient.
    let mut state = vec![0.0; 2 * modes];
    (state[0], state[modes]) = (7.0048, 17.1408);
    for _ in 0..50 {
        flow.start(&state, 0.0).unwrap();
        flow.run_until(TAU).unwrap();
        flow.state(&mut state);
    }
    (flow, state)
}

#[divan::bench(args = [1, 3, 5, 10, 20])]
fn dmt_period(bencher: divan::Bencher, modes: usize) {
    let (mut flow, mut state) = flow(modes, 20);
    let before = flow.statistics();
    let mut periods: u64 = 0;
    bencher.bench_local(|| {
        flow.start(&state, 0.0).unwrap();
        flow.run_until(TAU).unwrap();
        flow.state(&mut state);
        periods += 1;
    });
    let after = flow.statistics();
    let per = |a: u64, b: u64| (a - b) as f64 / periods as f64;
    println!(
        "N = {modes}: a period has {:.1} steps, {:.1} refused, {:.0} evaluations of the law, \
         {:.1} factorisations",
        per(after.steps, before.steps),
        per(after.refused, before.refused),
        per(after.evaluations, before.evaluations),
        per(after.factorisations, before.factorisations),
    );
}

#[divan::bench(args = [1, 3, 10])]
fn formula_period(bencher: divan::Bencher, modes: usize) {
    let (mut flow, mut state) = flow_under(written(), modes, 20);
    bencher.bench_local(|| {
        flow.start(&state, 0.0).unwrap();
        flow.run_until(TAU).unwrap();
        flow.state(&mut state);
    });
}

#[divan::bench(args = [1, 3, 10])]
fn coarse_formula_period(bencher: divan::Bencher, modes: usize) {
    let (flow, mut state) = flow_under(written(), modes, 20);
    let mut coarse = Coarse::new(flow.system(), TAU).unwrap();
    bencher.bench_local(|| coarse.run_periods(&mut state, None, 1).unwrap());
}

#[divan::bench(args = [1, 3, 5, 10, 20])]
fn coarse_dmt_period(bencher: divan::Bencher, modes: usize) {
    let (flow, mut state) = flow(modes, 20);
    let mut coarse = Coarse::new(flow.system(), TAU).unwrap();
    bencher.bench_local(|| coarse.run_periods(&mut state, None, 1).unwrap());
}

#[divan::bench(args = [12, 16, 20, 24, 28])]
fn dmt_period_of_three_modes_by_nodes(bencher: divan::Bencher, nodes: usize) {
    let (mut flow, mut state) = flow(3, nodes);
    bencher.bench_local(|| {
        flow.start(&state, 0.0).unwrap();
        flow.run_until(TAU).unwrap();
        flow.state(&mut state);
    });
}

#[divan::bench(args = [1, 3, 10])]
fn dmt_period_with_jacobian(bencher: divan::Bencher, modes: usize) {
    let (mut flow, state) = flow(modes, 20);
    let mut jacobian = nalgebra::DMatrix::zeros(2 * modes, 2 * modes);
    let mut none = nalgebra::DMatrix::zeros(2 * modes, 0);
    bencher.bench_local(|| {
        flow.start(&state, 0.0).unwrap();
        flow.run_with_derivatives(TAU, &[], &mut jacobian, &mut none)
            .unwrap();
    });
}
