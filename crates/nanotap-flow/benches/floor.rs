//! The floor of the exact flow: what its exponentials and rotations alone cost.
//!
//! One evaluation of a gap at a new time needs `e^{λ_k s}` of every term: N modes and the
//! tone, four to a pack. `chained` feeds each evaluation's time from the one before, as a
//! search for a crossing must; `unchained` evaluates at times known beforehand, which is
//! the most that several motions side by side could reach. `cargo bench -p nanotap-flow`.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};

// The engine's own arithmetic, which the crate keeps to itself.
#[allow(dead_code, unused_imports, clippy::inline_always)]
#[path = "../src/pack.rs"]
mod pack;

use pack::{Math, Pack, Plain, WIDTH};

/// Numbers of modes N.
const MODES: [usize; 6] = [1, 2, 3, 5, 10, 20];
/// Evaluations a run.
const EVALUATIONS: usize = 1000;

fn main() {
    divan::main();
}

/// Each evaluation waits for the one before. Items are evaluations.
#[divan::bench(args = MODES)]
fn chained(bencher: Bencher<'_, '_>, modes: usize) {
    time(bencher, modes, true);
}

/// Evaluations that need not wait for each other.
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
    decay: Pack,
    frequency: Pack,
    weight: [Pack; 2],
}

/// Terms of about the beam's frequencies, the tone last, weights of one.
fn terms(modes: usize) -> Vec<Terms> {
    let mut packs = Vec::new();
    for pack in 0..(modes + 1).div_ceil(WIDTH) {
        let of = |value: &dyn Fn(usize) -> f64| {
            std::array::from_fn(|lane| {
                let term = pack * WIDTH + lane;
                if term <= modes { value(term) } else { 0.0 }
            })
        };
        packs.push(Terms {
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
    packs
}

/// The sum of [`EVALUATIONS`] values of the signal.
fn evaluations(terms: &[Terms], chained: bool) -> f64 {
    #[cfg(target_arch = "x86_64")]
    if pack::fused_available() {
        // SAFETY: the machine has these instructions.
        return unsafe { evaluations_fused(terms, chained) };
    }
    evaluations_with::<Plain>(terms, chained)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn evaluations_fused(terms: &[Terms], chained: bool) -> f64 {
    evaluations_with::<pack::Fused>(terms, chained)
}

#[inline(always)]
#[allow(clippy::inline_always)]
fn evaluations_with<M: Math>(terms: &[Terms], chained: bool) -> f64 {
    let (mut total, mut time) = (0.0, 0.0);
    for k in 0..EVALUATIONS {
        let value = value::<M>(terms, time);
        total += value;
        let next = k as f64 * 1e-3;
        time = if chained {
            next + value.clamp(-1.0, 1.0) * 1e-6
        } else {
            next
        };
    }
    total
}

/// `Re Σ w_k e^{λ_k s}`.
#[inline(always)]
#[allow(clippy::inline_always)]
fn value<M: Math>(terms: &[Terms], s: f64) -> f64 {
    let s = M::splat(s);
    let mut sum = M::splat(0.0);
    for term in terms {
        let [re, im] = pack::exp_complex::<M>(M::load(&term.decay), M::load(&term.frequency), s);
        sum = M::fma(M::load(&term.weight[0]), re, sum);
        sum = M::fnma(M::load(&term.weight[1]), im, sum);
    }
    pack::sum::<M>(sum)
}
