//! Closed forms over one stretch within a regime: every mode, tone and the constant is a term
//! `Re(w q e^{λs})` of an output, with `q` the same for all outputs, so that its integrals are
//! worked out once and weighted for each.

use crate::{Complex, Drive};

const ZERO: Complex = Complex::new(0.0, 0.0);

/// Rates of the terms of a regime: its modes, the drive's tones, and 0 of the constant.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Rates {
    period: f64,
    pub(super) single: Vec<Rate>,
    /// `λ_j + λ_k` and `λ_j + λ̄_k` for `j ≤ k`, row after row; empty where no product is
    /// asked for.
    pairs: Vec<[Rate; 2]>,
}

/// A rate `λ`, and how `∫ e^{λs} ds` is worked out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rate {
    value: Complex,
    primitive: Primitive,
}

/// `(e^{λs} − 1)/λ` loses digits where `|λs|` is small, but what is lost is only `ε/|λ|`. Over
/// a period `T` this is nothing, unless `|λ|T` itself is small.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Primitive {
    /// `1/λ`.
    Quotient(Complex),
    /// The Taylor series.
    Series,
    /// `λ = 0`.
    Length,
}

/// `|λ|T` up to which the Taylor series is taken.
const SLOW: f64 = 0.02;

impl Rate {
    /// For stretches of up to `period`.
    pub(super) fn new(value: Complex, period: f64) -> Self {
        let square = value.re * value.re + value.im * value.im;
        let primitive = if square == 0.0 {
            Primitive::Length
        } else if square * (period * period) < SLOW * SLOW {
            Primitive::Series
        } else {
            Primitive::Quotient(value.conj() * (1.0 / square))
        };
        Self { value, primitive }
    }

    /// `∫₀^length e^{λs} ds` with `end = e^{λ · length}`.
    #[inline(always)]
    fn integral(&self, length: f64, end: Complex) -> Complex {
        match self.primitive {
            Primitive::Quotient(inverse) => (end - 1.0) * inverse,
            Primitive::Length => Complex::new(length, 0.0),
            Primitive::Series => {
                // Σ zⁿ/(n + 1)!
                let z = self.value * length;
                let mut sum = Complex::new(INVERSE_FACTORIALS[ORDER], 0.0);
                for coefficient in INVERSE_FACTORIALS[..ORDER].iter().rev() {
                    sum = sum * z + coefficient;
                }
                sum * length
            }
        }
    }
}

/// The series leaves out 0.02⁸/9! of one.
const ORDER: usize = 7;

/// `1/(n + 1)!`.
const INVERSE_FACTORIALS: [f64; ORDER + 1] = {
    let mut all = [1.0; ORDER + 1];
    let mut factorial = 1.0;
    let mut n = 1;
    while n <= ORDER {
        factorial *= (n + 1) as f64;
        all[n] = 1.0 / factorial;
        n += 1;
    }
    all
};

impl Rates {
    /// Of the modes' eigenvalues and the tones' frequencies.
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

    /// The rates as a Fourier coefficient at `omega` sees them: `λ − iω` and `λ̄ − iω`.
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

/// A stretch: of each term its amplitude `q` at the start and `e^{λ · length}`.
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
    /// Prepares [`Stretch::integral`].
    pub(super) fn integrate(&mut self, rates: &Rates) {
        let length = self.length;
        let terms = rates.single.iter().zip(&self.terms);
        self.integrals.clear();
        self.integrals
            .extend(terms.map(|(rate, [q, end])| q * rate.integral(length, *end)));
    }

    /// `∫ g ds` of the output with these weights.
    pub(super) fn integral(&self, weights: &[Complex]) -> f64 {
        real_sum(weights, &self.integrals)
    }

    /// Prepares [`Stretch::fourier`] at the frequency whose turned rates these are, with
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

    /// `∫ g e^{−iωt} ds`.
    pub(super) fn fourier(&self, weights: &[Complex]) -> Complex {
        let terms = weights.iter().zip(&self.turned);
        terms.fold(ZERO, |sum, (w, [direct, mirrored])| {
            sum + w * direct + w.conj() * mirrored
        })
    }

    /// Prepares [`Stretch::product`].
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

    /// `∫ g h ds` of the outputs whose [`pair_weights`] these are.
    pub(super) fn product(&self, weights: &[[Complex; 2]]) -> f64 {
        let pairs = weights.iter().zip(&self.pairs);
        pairs
            .map(|([v, w], [direct, crossed])| {
                (v.re * direct.re - v.im * direct.im) + (w.re * crossed.re - w.im * crossed.im)
            })
            .sum()
    }

    /// A bound of the output's size, where no term grows.
    pub(super) fn size(&self, weights: &[Complex]) -> f64 {
        let terms = weights.iter().zip(&self.terms);
        terms
            .map(|(w, [q, _])| (w.norm_sqr() * q.norm_sqr()).sqrt())
            .sum()
    }

    /// The output's values at the start and at the end.
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

/// The weights of the pairs of terms in the product of two outputs with these weights: for
/// `j ≤ k` half of `g_j h_k + g_k h_j` and of `g_j h̄_k + ḡ_k h_j`, once where `j = k`; the
/// crossed pairs of the other order are their conjugates.
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

/// `Re Σ a b`.
fn real_sum(a: &[Complex], b: &[Complex]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| a.re * b.re - a.im * b.im)
        .sum()
}
