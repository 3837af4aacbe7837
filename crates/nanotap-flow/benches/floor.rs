//! Lower bound of the exact flow: the cost of its exponentials and rotations alone.
//!
//! One evaluation of a gap at a new time needs `e^{λ_k s}` of every term: N modes and the tone,
//! four to a vector. In `chained` the time of each evaluation depends on the previous value, as in
//! the search for a crossing. In `unchained` the times are known in advance, which is the limit for
//! several motions at once. `cargo bench -p nanotap-flow`.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};

// The crate's private arithmetic.
#[allow(dead_code, unused_imports, clippy::inline_always)]
#[path = "../src/simd/mod.rs"]
mod simd;

use simd::{ComplexVector, Simd, Vector, WIDTH, Work};

/// Numbers of modes N.
const MODES: [usize; 6] = [1, 2, 3, 5, 10, 20];
/// Number of evaluations in a run.
const EVALUATIONS: usize = 1000;

fn main() {
    divan::main();
}

/// Each evaluation waits for the previous one. Items are evaluations.
#[divan::bench(args = MODES)]
fn chained(bencher: Bencher<'_, '_>, modes: usize) {
    time(bencher, modes, true);
}

/// Independent evaluations.
#[divan::bench(args = MODES)]
fn unchained(bencher: Bencher<'_, '_>, modes: usize) {
    time(bencher, modes, false);
}

fn time(bencher: Bencher<'_, '_>, modes: usize, chained: bool) {
    let terms = terms(modes);
    bencher
        .counter(ItemsCount::new(EVALUATIONS))
        .bench_local(|| evaluations(black_box(&terms), chained));
}

/// Rates and weight of four terms of a signal.
struct Terms {
    decay: Vector,
    frequency: Vector,
    weight: ComplexVector,
}

/// Terms with frequencies like those of a beam, the tone last, and weights of one.
fn terms(modes: usize) -> Vec<Terms> {
    let mut vectors = Vec::new();
    for vector in 0..(modes + 1).div_ceil(WIDTH) {
        let of = |value: &dyn Fn(usize) -> f64| {
            std::array::from_fn(|lane| {
                let term = vector * WIDTH + lane;
                if term <= modes { value(term) } else { 0.0 }
            })
        };
        vectors.push(Terms {
            decay: of(&|k| if k < modes { -0.05 } else { 0.0 }),
            frequency: of(&|k| {
                if k < modes {
                    (std::f64::consts::PI * (k as f64 + 0.6)).powi(2)
                } else {
                    2.6
                }
            }),
            weight: [of(&|_| 1.0), of(&|_| 0.5)],
        });
    }
    vectors
}

/// The sum of [`EVALUATIONS`] values of the signal.
fn evaluations(terms: &[Terms], chained: bool) -> f64 {
    simd::dispatch(Evaluations { terms, chained })
}

struct Evaluations<'a> {
    terms: &'a [Terms],
    chained: bool,
}

impl Work for Evaluations<'_> {
    type Output = f64;

    #[inline(always)]
    #[allow(clippy::inline_always)]
    fn run<S: Simd>(self) -> f64 {
        let (mut total, mut time) = (0.0, 0.0);
        for k in 0..EVALUATIONS {
            let value = value::<S>(self.terms, time);
            total += value;
            let next = k as f64 * 1e-3;
            time = if self.chained {
                next + value.clamp(-1.0, 1.0) * 1e-6
            } else {
                next
            };
        }
        total
    }
}

/// `Re Σ w_k e^{λ_k s}`.
#[inline(always)]
#[allow(clippy::inline_always)]
fn value<S: Simd>(terms: &[Terms], s: f64) -> f64 {
    let s = S::splat(s);
    let mut sum = S::splat(0.0);
    for term in terms {
        let [re, im] = simd::exp_complex::<S>(S::load(&term.decay), S::load(&term.frequency), s);
        sum = S::fma(S::load(&term.weight[0]), re, sum);
        sum = S::fnma(S::load(&term.weight[1]), im, sum);
    }
    simd::sum::<S>(sum)
}
