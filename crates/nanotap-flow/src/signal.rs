//! The form of any linear output inside a regime: a constant plus a finite sum of decaying complex
//! exponentials, with bounds on its derivatives.

use crate::double_double::{ComplexDd, Dd};
use crate::regime::{Kernel, ModalOutput};
use crate::relaxation::{RELAXATIONS, relaxation_masks};
use crate::simd::{self, ComplexVector, Library, Plain, Simd, Vector, Work, layout};
use crate::{Complex, Drive, Regime};
use nanotap_arithmetic::ComplexFunctions as _;

/// `g(s) = c + Re Σ_k a_k e^{λ_k s} + Re Σ_j b_j s^{p_j} e^{λ_j s}`, `s ≥ 0`.
///
/// The drive's tones are exponentials with imaginary rates like any other. The
/// last sum is empty unless eigenvalues coincide (critical damping).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Signal {
    /// Constant part `c`, in the units of the output.
    pub constant: f64,
    /// Terms with a power of `s`; empty unless eigenvalues coincide.
    pub powers: Vec<PowerTerm>,
    /// Number of terms without a power of `s`.
    count: usize,
    vectors: Vec<TermVectors>,
    /// Bound on the third derivative of growing terms over the whole segment.
    third_constant: f64,
    /// Length in time over which it will be evaluated.
    length: f64,
    /// `|c| + Σ|a_k| + …`, the size against which rounding is measured.
    size: f64,
    /// Largest `|λ_k|` of all terms, per unit of time.
    fastest: f64,
    /// Whether no term grows, so that the amplitudes bound later values.
    relaxes: bool,
    /// `e^{λ_k s}` of the last evaluation that kept them, and its `s`.
    factors: Vec<ComplexVector>,
    factors_at: Option<f64>,
}

/// Rounding error of a value, as a fraction of the terms' size.
pub(crate) const NOISE: f64 = 4.0 * f64::EPSILON;

/// `Re(amplitude · s^power · e^{rate s})` with `power ≥ 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerTerm {
    /// Complex rate `λ`, per unit of time.
    pub rate: Complex,
    /// Power `p` of `s`, at least 1.
    pub power: u32,
    /// Complex amplitude `b`, in units of the output per time to the power `p`.
    pub amplitude: Complex,
}

/// Value and first two derivatives at a point, with a bound on the third from
/// there on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jet {
    /// Value of the signal, in the units of the output.
    pub value: f64,
    /// First derivative, in units of the output per unit of time.
    pub rate: f64,
    /// Second derivative, in units of the output per squared unit of time.
    pub curvature: f64,
    /// Upper bound of the third derivative's absolute value from here to the end of the segment.
    pub third: f64,
}

/// A term's amplitude in value, rate and curvature, `[Re, Im]` each, the same in every lane.
pub(crate) type Amplitude = [ComplexVector; 3];

/// A [`Jet`] and jets of lower bounds of the signal, in which only the slowest terms are
/// followed and every faster one is replaced by minus its amplitude. A fast term of
/// small amplitude bounds the third derivative badly and the value hardly at all: far
/// from zero these certify longer steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Enclosure {
    pub(crate) jet: Jet,
    pub(crate) relaxed: [Jet; RELAXATIONS],
}

/// Four terms side by side: rates, the complex amplitudes of value, rate and curvature,
/// and the size of the third derivative. Register that are not used are zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct TermVectors {
    decay: Vector,
    frequency: Vector,
    value: ComplexVector,
    rate: ComplexVector,
    curvature: ComplexVector,
    third: Vector,
    amplitude: Vector,
    /// Which terms each lower bound follows.
    masks: [Vector; RELAXATIONS],
}

impl Signal {
    /// Creates a signal from its terms (rate and amplitude); `length` is the time over which it
    /// will be evaluated.
    pub fn from_terms(
        constant: f64,
        terms: &[(Complex, Complex)],
        powers: Vec<PowerTerm>,
        length: f64,
    ) -> Self {
        let mut signal = Self {
            constant,
            powers,
            count: terms.len(),
            length,
            ..Self::default()
        };
        signal
            .vectors
            .resize(layout::vectors_for(terms.len()), TermVectors::default());
        signal.size = constant.abs();
        let sizes: Vec<f64> = terms.iter().map(|(rate, _)| rate.modulus()).collect();
        let masks = relaxation_masks(&sizes);
        signal.relaxes = signal.powers.is_empty() && terms.iter().all(|(r, _)| r.re <= 0.0);
        for (k, &(rate, a)) in terms.iter().enumerate() {
            let (vector, i) = layout::place(k);
            let vector = &mut signal.vectors[vector];
            let (b, norm) = (a * rate, sizes[k]);
            let c = b * rate;
            vector.decay[i] = rate.re;
            vector.frequency[i] = rate.im;
            vector.amplitude[i] = a.modulus();
            for (lanes, mask) in vector.masks.iter_mut().zip(masks[k]) {
                lanes[i] = mask;
            }
            for (lanes, z) in [
                (&mut vector.value, a),
                (&mut vector.rate, b),
                (&mut vector.curvature, c),
            ] {
                lanes[0][i] = z.re;
                lanes[1][i] = z.im;
            }
            if rate.re > 0.0 {
                signal.third_constant +=
                    c.modulus() * norm * nanotap_arithmetic::exp(rate.re * length);
            } else {
                vector.third[i] = c.modulus() * norm;
            }
            signal.size += a.modulus();
            signal.fastest = signal.fastest.max(norm);
        }
        for term in &signal.powers {
            signal.size += term.bound(0, length);
            signal.fastest = signal.fastest.max(term.rate.modulus());
        }
        signal
    }

    /// Creates the signal of `output` over a segment of `regime` that starts at time `t` with modal
    /// coordinates `q`.
    pub fn of(
        regime: &Regime,
        drive: &Drive,
        output: &ModalOutput,
        q: &[Complex],
        t: f64,
        length: f64,
    ) -> Self {
        let basis = regime.basis();
        let mut terms: Vec<(Complex, Complex)> = basis
            .eigenvalues
            .iter()
            .zip(output.modal.iter().zip(q))
            .map(|(r, (w, q))| (*r, w * q))
            .collect();
        let mut powers = Vec::new();
        for cluster in &basis.clusters {
            let range = cluster.start..cluster.start + cluster.size();
            for (p, matrix) in cluster.powers().iter().enumerate() {
                let mut amplitude = Complex::new(0.0, 0.0);
                for (i, w) in output.modal[range.clone()].iter().enumerate() {
                    for (j, q) in q[range.clone()].iter().enumerate() {
                        amplitude += w * matrix[(i, j)] * q;
                    }
                }
                let rate = basis.eigenvalues[cluster.start];
                powers.push(PowerTerm {
                    rate,
                    power: p as u32 + 1,
                    amplitude,
                });
            }
        }
        for (k, (z, &omega)) in output.tones.iter().zip(drive.frequencies()).enumerate() {
            if z.re != 0.0 || z.im != 0.0 {
                terms.push((Complex::new(0.0, omega), z * drive.phasor(k, t)));
            }
        }
        Self::from_terms(output.constant, &terms, powers, length)
    }

    /// Sets the signal of a regime without clusters, from packed modal coordinates and phasors, and
    /// reuses its memory.
    #[inline(always)]
    pub(crate) fn refill<S: Simd>(&mut self, kernel: &Kernel, q: &[ComplexVector], length: f64) {
        self.constant = kernel.constant;
        self.count = kernel.count;
        self.fastest = kernel.fastest;
        self.powers.clear();
        self.factors_at = None;
        self.vectors
            .resize(kernel.vectors.len(), TermVectors::default());
        self.factors
            .resize(kernel.vectors.len(), ComplexVector::default());
        let mut size = S::splat(0.0);
        for (vector, (kernel, [qr, qi])) in
            self.vectors.iter_mut().zip(kernel.vectors.iter().zip(q))
        {
            let both = |z: &ComplexVector| [S::load(&z[0]), S::load(&z[1])];
            let q = [S::load(qr), S::load(qi)];
            let rate = [S::load(&kernel.decay), S::load(&kernel.frequency)];
            let a = simd::complex_mul::<S>(both(&kernel.weight), q);
            let b = simd::complex_mul::<S>(a, rate);
            let c = simd::complex_mul::<S>(b, rate);
            let norm = S::sqrt(S::fma(a[0], a[0], S::mul(a[1], a[1])));
            size = S::add(size, norm);
            vector.decay = kernel.decay;
            vector.frequency = kernel.frequency;
            vector.value = a.map(S::store);
            vector.rate = b.map(S::store);
            vector.curvature = c.map(S::store);
            vector.third = S::store(S::mul(norm, S::load(&kernel.cube)));
            vector.amplitude = S::store(norm);
            vector.masks = kernel.masks;
        }
        self.size = simd::sum::<S>(size) + self.constant.abs();
        self.third_constant = 0.0;
        self.relaxes = !kernel.grows;
        if kernel.grows {
            for vector in &mut self.vectors {
                for (third, decay) in vector.third.iter_mut().zip(vector.decay) {
                    if decay > 0.0 {
                        self.third_constant += *third * nanotap_arithmetic::exp(decay * length);
                        *third = 0.0;
                    }
                }
            }
        }
    }

    /// Returns rate and amplitude of each term without a power of `s`.
    pub fn terms(&self) -> impl Iterator<Item = (Complex, Complex)> + '_ {
        (0..self.count).map(|k| {
            let (vector, i) = layout::place(k);
            let vector = &self.vectors[vector];
            let amplitude = Complex::new(vector.value[0][i], vector.value[1][i]);
            (
                Complex::new(vector.decay[i], vector.frequency[i]),
                amplitude,
            )
        })
    }

    /// Returns value, rate, curvature and third-derivative bound at `s`.
    pub fn jet(&self, s: f64) -> Jet {
        if self.fastest * s.abs() < simd::LARGEST_ANGLE {
            simd::dispatch(JetAt(self, s))
        } else {
            self.jet_with::<Library>(s)
        }
    }

    #[inline(always)]
    pub(crate) fn jet_with<S: Simd>(&self, s: f64) -> Jet {
        self.enclosure::<S>(s).jet
    }

    /// Returns the jet at `s` and the third derivative, and keeps the exponentials for
    /// [`Signal::kept_factors`].
    #[inline(always)]
    pub(crate) fn jet_keeping_factors<S: Simd>(&mut self, s: f64) -> (Jet, f64) {
        let zero = S::splat(0.0);
        let (mut sums, mut jerk) = ([zero; 4], zero);
        let at = S::splat(s);
        for (p, factor) in self.vectors.iter().zip(&mut self.factors) {
            let (decay, frequency) = (S::load(&p.decay), S::load(&p.frequency));
            let [re, im] = simd::exp_complex::<S>(decay, frequency, at);
            *factor = [S::store(re), S::store(im)];
            for (sum, z) in sums.iter_mut().zip([&p.value, &p.rate]) {
                *sum = S::fnma(S::load(&z[1]), im, S::fma(S::load(&z[0]), re, *sum));
            }
            let c = [S::load(&p.curvature[0]), S::load(&p.curvature[1])];
            let [cr, ci] = simd::complex_mul::<S>(c, [re, im]);
            sums[2] = S::add(sums[2], cr);
            jerk = S::fnma(ci, frequency, S::fma(cr, decay, jerk));
            // Bounds need no decay: it is slow.
            sums[3] = S::add(sums[3], S::load(&p.third));
        }
        self.factors_at = Some(s);
        let sums = simd::sums::<S>(sums);
        let jet = Jet {
            value: self.constant + sums[0],
            rate: sums[1],
            curvature: sums[2],
            third: self.third_constant + sums[3],
        };
        (jet, simd::sum::<S>(jerk))
    }

    /// Returns the last exponentials `e^{λ_k s}` that were kept, and their `s`.
    #[inline(always)]
    pub(crate) fn kept_factors(&self) -> Option<(f64, &[ComplexVector])> {
        self.factors_at.map(|s| (s, &self.factors[..]))
    }

    /// Writes the amplitudes of some terms, each the same in every lane, to `out`.
    #[inline(always)]
    pub(crate) fn amplitudes<S: Simd>(&self, terms: &[usize], out: &mut Vec<Amplitude>) {
        out.resize(terms.len(), Amplitude::default());
        for (amplitude, &k) in out.iter_mut().zip(terms) {
            let (vector, i) = layout::place(k);
            let vector = &self.vectors[vector];
            for (out, z) in
                amplitude
                    .iter_mut()
                    .zip([&vector.value, &vector.rate, &vector.curvature])
            {
                *out = [S::store(S::splat(z[0][i])), S::store(S::splat(z[1][i]))];
            }
        }
    }

    /// Returns the sums of the terms' amplitudes with four kinds of weights.
    #[inline(always)]
    pub(crate) fn weighted_amplitudes<S: Simd>(&self, weights: &[[Vector; 4]]) -> [f64; 4] {
        let mut sums = [S::splat(0.0); 4];
        for (p, weights) in self.vectors.iter().zip(weights) {
            for (sum, weight) in sums.iter_mut().zip(weights) {
                *sum = S::fma(S::load(&p.amplitude), S::load(weight), *sum);
            }
        }
        simd::sums::<S>(sums)
    }

    /// Returns the sum of the absolute values of all terms.
    #[inline(always)]
    pub(crate) fn size(&self) -> f64 {
        self.size
    }

    /// Returns the jet at `s` with the jets of the lower bounds.
    #[inline(always)]
    pub(crate) fn enclosure<S: Simd>(&self, s: f64) -> Enclosure {
        let zero = S::splat(0.0);
        let mut all = [zero; 4];
        let mut slow = [[zero; 4]; RELAXATIONS];
        let mut left_out = [zero; RELAXATIONS];
        let at = S::splat(s);
        for p in &self.vectors {
            let grown = simd::exp::<S>(S::mul(S::load(&p.decay), at));
            let (sin, cos) = simd::sin_cos::<S>(S::mul(S::load(&p.frequency), at));
            let (re, im) = (S::mul(grown, cos), S::mul(grown, sin));
            let real = |z: &ComplexVector| S::fnma(S::load(&z[1]), im, S::mul(S::load(&z[0]), re));
            let terms = [
                real(&p.value),
                real(&p.rate),
                real(&p.curvature),
                S::mul(S::load(&p.third), grown),
            ];
            let amplitude = S::mul(S::load(&p.amplitude), grown);
            for i in 0..4 {
                all[i] = S::add(all[i], terms[i]);
            }
            for r in 0..RELAXATIONS {
                let mask = S::load(&p.masks[r]);
                for i in 0..4 {
                    slow[r][i] = S::fma(terms[i], mask, slow[r][i]);
                }
                left_out[r] = S::add(left_out[r], S::fnma(amplitude, mask, amplitude));
            }
        }
        let jet = |sums: [f64; 4], constant: f64| Jet {
            value: constant + sums[0],
            rate: sums[1],
            curvature: sums[2],
            third: self.third_constant + sums[3],
        };
        let mut enclosure = Enclosure {
            jet: jet(simd::sums::<S>(all), self.constant),
            relaxed: [Jet::default(); RELAXATIONS],
        };
        if self.relaxes {
            let left_out = simd::sums::<S>([left_out[0], left_out[1], zero, zero]);
            for r in 0..RELAXATIONS {
                enclosure.relaxed[r] = jet(simd::sums::<S>(slow[r]), self.constant - left_out[r]);
            }
        }
        let jet = &mut enclosure.jet;
        for term in &self.powers {
            jet.value += term.derivative(0, s);
            jet.rate += term.derivative(1, s);
            jet.curvature += term.derivative(2, s);
            jet.third += term.bound_from(3, s, self.length);
        }
        enclosure
    }

    /// Returns the jet at `s = 0`, which needs no exponential.
    #[inline(always)]
    pub fn first_jet(&self) -> Jet {
        let mut jet = Jet {
            value: self.constant,
            rate: 0.0,
            curvature: 0.0,
            third: self.third_constant,
        };
        for p in &self.vectors {
            jet.value += simd::sum::<Plain>(p.value[0]);
            jet.rate += simd::sum::<Plain>(p.rate[0]);
            jet.curvature += simd::sum::<Plain>(p.curvature[0]);
            jet.third += simd::sum::<Plain>(p.third);
        }
        for term in &self.powers {
            jet.value += term.derivative(0, 0.0);
            jet.rate += term.derivative(1, 0.0);
            jet.curvature += term.derivative(2, 0.0);
            jet.third += term.bound_from(3, 0.0, self.length);
        }
        jet
    }

    /// Returns the value at time `s` from the start.
    pub fn at(&self, s: f64) -> f64 {
        self.jet(s).value
    }

    /// Returns the value at `s` with an error far below that of double precision (about 1e-28 of
    /// the terms' size before the final rounding), to decide on which side of zero a tangency lies.
    pub fn accurate_at(&self, s: f64) -> f64 {
        let exponential = |rate: Complex| {
            ComplexDd(Dd::two_product(rate.re, s), Dd::two_product(rate.im, s)).exp()
        };
        let mut sum = Dd::new(self.constant);
        for (rate, a) in self.terms() {
            sum = sum.add(ComplexDd::new(a).multiply(exponential(rate)).0);
        }
        for term in &self.powers {
            let mut power = Dd::new(1.0);
            for _ in 0..term.power {
                power = power.multiply(Dd::new(s));
            }
            let z = ComplexDd::new(term.amplitude).multiply(exponential(term.rate));
            sum = sum.add(z.0.multiply(power));
        }
        sum.0 + sum.1
    }

    /// Returns the `order`-th derivative at `s = 0`.
    pub fn derivative_at_start(&self, order: u32) -> f64 {
        let constant = if order == 0 { self.constant } else { 0.0 };
        let simple: f64 = self
            .terms()
            .map(|(rate, a)| (a * rate.powu(order)).re)
            .sum();
        constant
            + simple
            + self
                .powers
                .iter()
                .map(|term| term.derivative(order, 0.0))
                .sum::<f64>()
    }

    /// Returns an upper bound of the `order`-th derivative's absolute value over `[0, length]`.
    pub fn derivative_bound(&self, order: u32, length: f64) -> f64 {
        let constant = if order == 0 { self.constant.abs() } else { 0.0 };
        let simple: f64 = self
            .terms()
            .map(|(rate, a)| {
                a.modulus()
                    * rate.modulus().powi(order as i32)
                    * nanotap_arithmetic::exp(rate.re.max(0.0) * length)
            })
            .sum();
        constant
            + simple
            + self
                .powers
                .iter()
                .map(|term| term.bound(order, length))
                .sum::<f64>()
    }

    /// Returns the largest `|λ_k|`, per unit of time: the greatest rate at which the signal
    /// changes.
    pub fn fastest(&self) -> f64 {
        self.fastest
    }

    /// Returns the size of rounding errors in its value, in the units of the output.
    pub fn noise(&self) -> f64 {
        NOISE * self.size
    }

    /// Reports whether every term is finite.
    pub fn is_finite(&self) -> bool {
        self.size.is_finite()
    }

    /// Returns the derivative as a signal.
    #[must_use]
    pub fn differentiated(&self, length: f64) -> Self {
        let mut terms: Vec<(Complex, Complex)> = self.terms().map(|(r, a)| (r, r * a)).collect();
        let mut powers = Vec::new();
        for term in &self.powers {
            powers.push(PowerTerm {
                amplitude: term.amplitude * term.rate,
                ..*term
            });
            let amplitude = term.amplitude * f64::from(term.power);
            if term.power > 1 {
                powers.push(PowerTerm {
                    amplitude,
                    power: term.power - 1,
                    rate: term.rate,
                });
            } else {
                terms.push((term.rate, amplitude));
            }
        }
        Self::from_terms(0.0, &terms, powers, length)
    }

    /// Returns `factor · g(start + s)` as a signal in `s`, to be evaluated over `length`.
    #[must_use]
    pub fn shifted(&self, start: f64, factor: f64, length: f64) -> Self {
        let mut terms: Vec<(Complex, Complex)> = self
            .terms()
            .map(|(r, a)| (r, a * (r * start).exponential() * factor))
            .collect();
        let mut powers = Vec::new();
        for term in &self.powers {
            // (s + start)^p = Σ_i C(p, i) s^i start^{p−i}
            let grown = term.amplitude * (term.rate * start).exponential() * factor;
            let mut binomial = 1.0;
            for i in (0..=term.power).rev() {
                let amplitude = grown * binomial * start.powi((term.power - i) as i32);
                if i == 0 {
                    terms.push((term.rate, amplitude));
                } else {
                    powers.push(PowerTerm {
                        amplitude,
                        power: i,
                        rate: term.rate,
                    });
                }
                binomial *= f64::from(i) / f64::from(term.power - i + 1);
            }
        }
        Self::from_terms(self.constant * factor, &terms, powers, length)
    }
}

impl PowerTerm {
    /// `C(order, i) p!/(p − i)!`, Leibniz's weights.
    fn weight(self, order: u32, i: u32) -> f64 {
        let mut weight = 1.0;
        for k in 0..i {
            weight *= f64::from(order - k) / f64::from(k + 1) * f64::from(self.power - k);
        }
        weight
    }

    fn derivative(self, order: u32, s: f64) -> f64 {
        let mut sum = Complex::new(0.0, 0.0);
        for i in 0..=order.min(self.power) {
            sum +=
                self.rate.powu(order - i) * self.weight(order, i) * s.powi((self.power - i) as i32);
        }
        (self.amplitude * sum * (self.rate * s).exponential()).re
    }

    fn bound(self, order: u32, length: f64) -> f64 {
        self.bound_from(order, 0.0, length)
    }

    /// Returns a bound of the `order`-th derivative's absolute value between `start` and `end`.
    fn bound_from(self, order: u32, start: f64, end: f64) -> f64 {
        let decay = -self.rate.re;
        let sum: f64 = (0..=order.min(self.power))
            .map(|i| {
                // s^k e^{−a s} is largest at k/a.
                let k = self.power - i;
                let at = if decay > 0.0 {
                    (f64::from(k) / decay).min(end).max(start)
                } else {
                    end
                };
                self.rate.modulus().powi((order - i) as i32)
                    * self.weight(order, i)
                    * at.powi(k as i32)
                    * nanotap_arithmetic::exp(-decay * at)
            })
            .sum();
        self.amplitude.modulus() * sum
    }
}

/// The arguments of [`Signal::jet`], for the dispatch to vector instructions.
struct JetAt<'a>(&'a Signal, f64);

impl Work for JetAt<'_> {
    type Output = Jet;

    #[inline(always)]
    fn run<S: Simd>(self) -> Jet {
        self.0.jet_with::<S>(self.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Signal {
        let power = PowerTerm {
            rate: Complex::new(-1.0, 0.0),
            power: 2,
            amplitude: Complex::new(0.8, 0.0),
        };
        let terms = [
            (Complex::new(-0.2, 3.0), Complex::new(0.4, -0.7)),
            (Complex::new(-0.5, 0.0), Complex::new(-1.1, 0.0)),
            (Complex::new(0.0, 2.6), Complex::new(0.1, 0.2)),
        ];
        Signal::from_terms(0.3, &terms, vec![power], 4.0)
    }

    #[test]
    fn derivatives_agree_with_central_differences() {
        let signal = example();
        let h = 1e-5;
        for s in [0.1, 0.9, 2.3] {
            let jet = signal.jet(s);
            assert!((jet.value - signal.at(s)).abs() < 1e-14);
            assert!((jet.rate - (signal.at(s + h) - signal.at(s - h)) / (2.0 * h)).abs() < 1e-8);
            let curvature = (signal.jet(s + h).rate - signal.jet(s - h).rate) / (2.0 * h);
            assert!((jet.curvature - curvature).abs() < 1e-8);
            assert!((signal.differentiated(4.0).at(s) - jet.rate).abs() < 1e-13);
            assert!(
                (signal.shifted(0.4, -2.0, 4.0).at(s - 0.4 * s.min(0.0))
                    + 2.0 * signal.at(s + 0.4))
                .abs()
                    < 1e-13
            );
        }
        let (first, zero) = (signal.first_jet(), signal.jet(0.0));
        assert!(
            (first.value - zero.value).abs() < 1e-15 && (first.third - zero.third).abs() < 1e-13
        );
        for order in 0..6 {
            let direct = signal.derivative_at_start(order);
            assert!(direct.abs() <= signal.derivative_bound(order, 4.0));
        }
        assert!((signal.derivative_at_start(2) - zero.curvature).abs() < 1e-14);
    }

    #[test]
    fn third_derivative_bound_holds() {
        let signal = example();
        for i in 0..40 {
            let s = 0.1 * f64::from(i);
            let bound = signal.jet(s).third;
            for j in i..40 {
                let t = 0.1 * f64::from(j);
                let third =
                    (signal.jet(t + 1e-4).curvature - signal.jet(t - 1e-4).curvature) / 2e-4;
                assert!(third.abs() <= bound + 1e-6);
            }
        }
    }
}
