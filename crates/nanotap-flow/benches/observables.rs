//! Cost of exact observables in addition to the motion: `cargo bench -p nanotap-flow --bench
//! observables`. Items are drive periods.
//!
//! The system is a cantilever of N modes that taps a springy sample: α1 = α2 = α3 = 0.1,
//! α4 = 20, α5 = 0, α6 = 0.2, Ω = 2.6.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use std::f64::consts::PI;
use std::sync::Arc;

use divan::Bencher;
use divan::counter::ItemsCount;
use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_flow::accumulate::{Accumulator, Functional, Request};
use nanotap_flow::{Drive, Flow, HarmonicVector, Output, Regime, System, Transition};

const MODES: [usize; 6] = [1, 2, 3, 5, 10, 20];
/// Drive periods in a run.
const PERIODS: usize = 200;
const OMEGA: f64 = 2.6;
const STIFFNESS: f64 = 20.0;
const DAMPING: f64 = 0.2;

fn main() {
    divan::main();
}

struct Cantilever {
    system: Arc<System>,
    tip: Output,
    gap: Output,
    rate: Output,
}

/// Roots of cos β cosh β = −1, the modes' integrals 2σ/β, and their limits for high modes.
fn mode(j: usize) -> (f64, f64) {
    let known = [
        (1.875_104, 0.782_992),
        (4.694_091, 0.433_936),
        (7.854_757, 0.254_425),
    ];
    known.get(j).copied().unwrap_or_else(|| {
        let beta = (j as f64 + 0.5) * PI;
        (beta, 2.0 / beta)
    })
}

fn cantilever(n: usize) -> Cantilever {
    let drive = Drive::single(OMEGA).expect("a frequency");
    let p = DVector::from_fn(n, |j, _| if j % 2 == 0 { 2.0 } else { -2.0 });
    let integrals = DVector::from_fn(n, |j, _| mode(j).1);
    let mass: DMatrix<f64> = DMatrix::identity(n, n) + 0.1 * &p * p.transpose();
    let inverse = mass.try_inverse().expect("a mass matrix");
    let stiffness = DMatrix::from_fn(n, n, |i, j| if i == j { mode(i).0.powi(4) } else { 0.0 });
    let regime = |index: usize, k: f64, c: f64| {
        let pushed = &p * p.transpose();
        let stiffness = &inverse * (&stiffness + k * &pushed);
        let damping = &inverse * (0.1 * DMatrix::<f64>::identity(n, n) + c * &pushed);
        let mut matrix: DMatrix<f64> = DMatrix::zeros(2 * n, 2 * n);
        matrix.view_mut((0, n), (n, n)).fill_with_identity();
        matrix.view_mut((n, 0), (n, n)).copy_from(&-stiffness);
        matrix.view_mut((n, n), (n, n)).copy_from(&-damping);
        let lower = |v: DVector<f64>| {
            let mut all: DVector<f64> = DVector::zeros(2 * n);
            all.rows_mut(n, n).copy_from(&(&inverse * v));
            all
        };
        let sine = 0.1 * OMEGA * OMEGA * (0.1 * &p + &integrals) - 0.1 * k * &p;
        let cosine = -0.01 * OMEGA * &integrals - 0.1 * c * OMEGA * &p;
        let forcing = HarmonicVector::zeros(2 * n, 1).with_tone(0, &lower(sine), &lower(cosine));
        Regime::new(index, matrix, forcing, &drive).expect("a regime")
    };
    let row = |first: usize| {
        let value = |i: usize| {
            if (first..first + n).contains(&i) {
                p[i - first]
            } else {
                0.0
            }
        };
        Output::linear(RowDVector::from_fn(2 * n, |_, i| value(i)), 1)
    };
    let tip = row(0);
    let gap = tip.clone().with_tone(0, 0.1, 0.0);
    let transitions = vec![
        vec![Transition::new(gap.clone(), 1)],
        vec![Transition::new(gap.scaled(-1.0), 0)],
    ];
    let regimes = vec![regime(0, 0.0, 0.0), regime(1, STIFFNESS, DAMPING)];
    Cantilever {
        system: Arc::new(System::new(drive.clone(), regimes, transitions).expect("a system")),
        rate: row(n).with_tone(0, 0.0, 0.1 * OMEGA),
        tip,
        gap,
    }
}

/// On the attractor.
fn flow(cantilever: &Cantilever) -> Flow {
    let mut flow = Flow::new(Arc::clone(&cantilever.system));
    let mut start = vec![0.0; cantilever.system.dimension()];
    start[0] = 0.1;
    flow.start(&start, 0.0).expect("a start");
    flow.run_periods(500).expect("a bounded motion");
    flow
}

#[divan::bench(args = MODES)]
fn bare(bencher: Bencher<'_, '_>, modes: usize) {
    let flow = flow(&cantilever(modes));
    bencher
        .counter(ItemsCount::new(PERIODS))
        .with_inputs(|| flow.clone())
        .bench_local_refs(|flow| {
            for _ in 0..PERIODS {
                flow.run_period(&mut ()).expect("a bounded motion");
            }
        });
}

/// Selection of observables.
#[derive(Clone, Copy, Debug)]
enum Set {
    Times,
    TipExtrema,
    GapLeast,
    ForceExtrema,
    MeanAndHarmonic,
    Dissipation,
    MeanSquare,
    Typical,
}

fn request(cantilever: &Cantilever, set: Set) -> Request {
    let mut request = Request::new();
    let tip = request.output(&cantilever.tip);
    let gap = request.output(&cantilever.gap);
    let force = cantilever
        .gap
        .scaled(-STIFFNESS)
        .plus(-DAMPING, &cantilever.rate);
    let force = request.output_by_regime(&[force.scaled(0.0), force]);
    let rate = request.output(&cantilever.rate);
    let asked = |one: fn(Set) -> bool| one(set) || matches!(set, Set::Typical);
    if asked(|s| matches!(s, Set::TipExtrema)) {
        request.add(Functional::Least(tip));
        request.add(Functional::Greatest(tip));
    }
    if asked(|s| matches!(s, Set::GapLeast)) {
        request.add(Functional::Least(gap));
    }
    if asked(|s| matches!(s, Set::ForceExtrema)) {
        request.add(Functional::Least(force));
        request.add(Functional::Greatest(force));
    }
    if asked(|s| matches!(s, Set::MeanAndHarmonic)) {
        request.add(Functional::Integral(tip));
        request.add(Functional::Integral(force));
        request.add(Functional::Fourier(tip, OMEGA));
    }
    if asked(|s| matches!(s, Set::Dissipation)) {
        request.add(Functional::Product(force, rate));
    }
    if matches!(set, Set::MeanSquare) {
        request.add(Functional::Product(tip, tip));
    }
    request
}

/// N = 3, with one kind of observable at a time, and with the typical set: extrema of tip and
/// force, least gap, means, first harmonic, dissipation, contacts.
#[divan::bench(args = [
    Set::Times, Set::TipExtrema, Set::GapLeast, Set::ForceExtrema, Set::MeanAndHarmonic,
    Set::Dissipation, Set::MeanSquare, Set::Typical,
])]
fn with(bencher: Bencher<'_, '_>, set: Set) {
    accumulated(bencher, 3, set);
}

/// The typical set, with the extrema of each period.
#[divan::bench(args = MODES)]
fn typical(bencher: Bencher<'_, '_>, modes: usize) {
    accumulated(bencher, modes, Set::Typical);
}

fn accumulated(bencher: Bencher<'_, '_>, modes: usize, set: Set) {
    let cantilever = cantilever(modes);
    let flow = flow(&cantilever);
    let plan = request(&cantilever, set)
        .plan(&cantilever.system)
        .expect("a plan");
    let mut accumulator = Accumulator::new(&plan);
    bencher
        .counter(ItemsCount::new(PERIODS))
        .with_inputs(|| flow.clone())
        .bench_local_refs(|flow| {
            for _ in 0..PERIODS {
                accumulator.clear();
                flow.run_period(&mut accumulator).expect("a bounded motion");
            }
        });
}
