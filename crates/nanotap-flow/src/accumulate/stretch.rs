//! Closed forms over one stretch within a regime: every mode, tone and the constant is a term
//! `Re(w q e^{λs})` of an output, with `q` the same for all outputs, so that its integrals are
//! worked out once and weighted for each.

use crate::rate::Rate;
use crate::{Complex, Drive};

const ZERO: Complex = Complex::new(0.0, 0.0);

/// Rates of the terms of a regime: its modes, the drive's tones, and 0 of the constant.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Rates {
    period: f64,
    pub(super) single: Vec<Rate>,
    /// `λ_j + λ_k` and `λ_j + λ̄_k` for `j ≤ k`, row after row; empty where no product is
    /// requested.
    pairs: Vec<[Rate; 2]>,
}

impl Rates {
    /// Computes the rates from the modes' eigenvalues and the tones' frequencies.
    pub(super) fn new(eigenvalues: &[Complex], drive: &Drive, products: bool) -> Self {
        let period = drive.period();
        let tones = drive.frequencies().iter().map(|&w| Complex::new(0.0, w));
        let all: Vec<Complex> = eigenvalues
            .iter()
            .copied()
            .chain(tones)
            .chain([ZERO])
            .collect();
        let mut pairs = Vec::new();
        if products {
            for (j, a) in all.iter().enumerate() {
                pairs.extend(
                    all[j..]
                        .iter()
                        .map(|b| [Rate::new(a + b, period), Rate::new(a + b.conj(), period)]),
                );
            }
        }
        Self {
            period,
            single: all.into_iter().map(|r| Rate::new(r, period)).collect(),
            pairs,
        }
    }

    /// Returns the rates of the integrands of a Fourier coefficient at `omega`: `λ − iω` and
    /// `λ̄ − iω`.
    pub(super) fn turned(&self, omega: f64) -> Vec<[Rate; 2]> {
        let turn = Complex::new(0.0, omega);
        let turned = |r: &Rate| {
            [
                Rate::new(r.value - turn, self.period),
                Rate::new(r.value.conj() - turn, self.period),
            ]
        };
        self.single.iter().map(turned).collect()
    }
}

/// A stretch within a regime: the amplitude `q` of each term at the start, and `e^{λ · length}`.
#[derive(Clone, Debug, Default)]
pub(super) struct Stretch {
    pub(super) length: f64,
    pub(super) terms: Vec<[Complex; 2]>,
    /// Work space: integrals of terms, and of pairs of them.
    integrals: Vec<Complex>,
    turned: Vec<[Complex; 2]>,
    pairs: Vec<[Complex; 2]>,
}

impl Stretch {
    /// Computes the integrals of all terms, from which [`Stretch::integral`] takes its sums.
    pub(super) fn integrate(&mut self, rates: &Rates) {
        let length = self.length;
        let terms = rates.single.iter().zip(&self.terms);
        self.integrals.clear();
        self.integrals
            .extend(terms.map(|(rate, [q, end])| q * rate.integral(length, *end)));
    }

    /// Returns `∫ g ds` of the output with these weights.
    pub(super) fn integral(&self, weights: &[Complex]) -> f64 {
        real_sum(weights, &self.integrals)
    }

    /// Computes the integrals of [`Stretch::fourier`] at the frequency of these turned rates, with
    /// `e^{−iωt}` at the start and `e^{−iω · length}`.
    pub(super) fn turn(&mut self, rates: &[[Rate; 2]], start: Complex, over: Complex) {
        let length = self.length;
        let terms = rates.iter().zip(&self.terms);
        self.turned.clear();
        self.turned
            .extend(terms.map(|([direct, mirrored], [q, end])| {
                let half = start * 0.5;
                [
                    q * direct.integral(length, end * over) * half,
                    q.conj() * mirrored.integral(length, end.conj() * over) * half,
                ]
            }));
    }

    /// Returns `∫ g e^{−iωt} ds` of the output with these weights.
    pub(super) fn fourier(&self, weights: &[Complex]) -> Complex {
        let terms = weights.iter().zip(&self.turned);
        terms.fold(ZERO, |sum, (w, [direct, mirrored])| {
            sum + w * direct + w.conj() * mirrored
        })
    }

    /// Computes the integrals of all products of two terms, from which [`Stretch::product`] takes
    /// its sums.
    pub(super) fn pair(&mut self, rates: &Rates) {
        let length = self.length;
        self.pairs.clear();
        let mut pairs = rates.pairs.iter();
        for (j, [p, p_end]) in self.terms.iter().enumerate() {
            for ([q, q_end], [direct, crossed]) in self.terms[j..].iter().zip(&mut pairs) {
                let (conjugate, conjugate_end) = (q.conj(), q_end.conj());
                self.pairs.push([
                    p * q * direct.integral(length, p_end * q_end),
                    p * conjugate * crossed.integral(length, p_end * conjugate_end),
                ]);
            }
        }
    }

    /// Returns `∫ g h ds` of the outputs whose [`pair_weights`] these are.
    pub(super) fn product(&self, weights: &[[Complex; 2]]) -> f64 {
        let pairs = weights.iter().zip(&self.pairs);
        pairs
            .map(|([v, w], [direct, crossed])| {
                (v.re * direct.re - v.im * direct.im) + (w.re * crossed.re - w.im * crossed.im)
            })
            .sum()
    }

    /// Returns a bound of the output's absolute value, if no term grows.
    pub(super) fn size(&self, weights: &[Complex]) -> f64 {
        let terms = weights.iter().zip(&self.terms);
        terms
            .map(|(w, [q, _])| (w.norm_sqr() * q.norm_sqr()).sqrt())
            .sum()
    }

    /// Returns the output's values at the start and at the end.
    pub(super) fn ends(&self, weights: &[Complex]) -> [f64; 2] {
        let mut ends = [0.0; 2];
        for (w, [q, end]) in weights.iter().zip(&self.terms) {
            let a = w * q;
            ends[0] += a.re;
            ends[1] += a.re * end.re - a.im * end.im;
        }
        ends
    }
}

/// Computes the weights of the pairs of terms in the product of two outputs with these weights: for
/// `j ≤ k` half of `g_j h_k + g_k h_j` and of `g_j h̄_k + ḡ_k h_j`, once where `j = k`. The crossed
/// pairs in the other order are their conjugates and need no weights.
pub(super) fn pair_weights(g: &[Complex], h: &[Complex]) -> Vec<[Complex; 2]> {
    let mut weights = Vec::new();
    for (j, (gj, hj)) in g.iter().zip(h).enumerate() {
        for (k, (gk, hk)) in g.iter().zip(h).enumerate().skip(j) {
            let (mut direct, mut crossed) = (gj * hk, gj * hk.conj());
            if k > j {
                direct += gk * hj;
                crossed += gk.conj() * hj;
            }
            weights.push([direct * 0.5, crossed * 0.5]);
        }
    }
    weights
}

/// Computes the real part `Re Σ a b` of the sum of products.
fn real_sum(a: &[Complex], b: &[Complex]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| a.re * b.re - a.im * b.im)
        .sum()
}
