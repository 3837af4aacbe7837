//! What any linear output is inside a regime: a constant plus a finite sum of
//! decaying complex exponentials, with bounds on its derivatives.

use crate::regime::ModalOutput;
use crate::{Complex, Drive, Regime};

/// `g(s) = c + Re Σ_k a_k e^{λ_k s} + Re Σ_j b_j s^{p_j} e^{λ_j s}`, `s ≥ 0`.
///
/// The drive's tones are exponentials with imaginary rates like any other. The
/// last sum is empty unless eigenvalues coincide (critical damping).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Signal {
    /// `c`.
    pub constant: f64,
    /// `λ_k`.
    pub rates: Vec<Complex>,
    /// `a_k`.
    pub amplitudes: Vec<Complex>,
    /// The terms with a power of `s`.
    pub powers: Vec<PowerTerm>,
    lanes: Lanes,
}

/// `Re(amplitude · s^power · e^{rate s})` with `power ≥ 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerTerm {
    /// `λ`.
    pub rate: Complex,
    /// `p`.
    pub power: u32,
    /// `b`.
    pub amplitude: Complex,
}

/// Value and first two derivatives at a point, with a bound on the third from
/// there on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// `g`.
    pub value: f64,
    /// `g'`.
    pub rate: f64,
    /// `g''`.
    pub curvature: f64,
    /// An upper bound of `|g'''|` from here to the end of the segment.
    pub third: f64,
}

/// The amplitudes of `g`, `g'`, `g''` and the bound on `g'''`, term by term, in
/// separate arrays so that the compiler can run them side by side.
#[derive(Clone, Debug, Default, PartialEq)]
struct Lanes {
    decay: Vec<f64>,
    frequency: Vec<f64>,
    value: [Vec<f64>; 2],
    rate: [Vec<f64>; 2],
    curvature: [Vec<f64>; 2],
    third: Vec<f64>,
    /// Bound on `g'''` from growing terms and power terms, over the whole segment.
    third_constant: f64,
    /// `|c| + Σ|a_k| + …`, the size against which rounding is measured.
    size: f64,
}

impl Signal {
    /// A signal from its terms; `length` is how far it will be looked at.
    pub fn from_terms(constant: f64, rates: Vec<Complex>, amplitudes: Vec<Complex>, length: f64) -> Self {
        let mut signal = Self { constant, rates, amplitudes, ..Self::default() };
        signal.prepare(length);
        signal
    }

    /// The signal of `output` over a segment of `regime` that starts at time `t`
    /// with modal coordinates `q`.
    pub fn of(regime: &Regime, drive: &Drive, output: &ModalOutput, q: &[Complex], t: f64, length: f64) -> Self {
        let mut signal = Self::default();
        let phasors: Vec<Complex> = (0..drive.frequencies().len()).map(|k| drive.phasor(k, t)).collect();
        signal.refill(regime, drive, output, q, &phasors, length);
        signal
    }

    /// The same, reusing this signal's memory. `phasors` are the tones' `e^{iω_k t}`.
    pub(crate) fn refill(
        &mut self,
        regime: &Regime,
        drive: &Drive,
        output: &ModalOutput,
        q: &[Complex],
        phasors: &[Complex],
        length: f64,
    ) {
        self.constant = output.constant;
        self.rates.clear();
        self.amplitudes.clear();
        self.powers.clear();
        let basis = regime.basis();
        self.rates.extend_from_slice(&basis.eigenvalues);
        self.amplitudes.extend(output.modal.iter().zip(q).map(|(w, q)| w * q));
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
                self.powers.push(PowerTerm { rate, power: p as u32 + 1, amplitude });
            }
        }
        for ((z, &omega), phasor) in output.tones.iter().zip(drive.frequencies()).zip(phasors) {
            if z.re != 0.0 || z.im != 0.0 {
                self.rates.push(Complex::new(0.0, omega));
                self.amplitudes.push(z * phasor);
            }
        }
        self.prepare(length);
    }

    fn prepare(&mut self, length: f64) {
        let lanes = &mut self.lanes;
        let n = self.rates.len();
        for lane in [&mut lanes.decay, &mut lanes.frequency, &mut lanes.third]
            .into_iter()
            .chain(&mut lanes.value)
            .chain(&mut lanes.rate)
            .chain(&mut lanes.curvature)
        {
            lane.clear();
            lane.reserve(n);
        }
        lanes.third_constant = 0.0;
        lanes.size = self.constant.abs();
        for (rate, a) in self.rates.iter().zip(&self.amplitudes) {
            let (b, norm) = (a * rate, rate.norm());
            let c = b * rate;
            lanes.decay.push(rate.re);
            lanes.frequency.push(rate.im);
            lanes.value[0].push(a.re);
            lanes.value[1].push(a.im);
            lanes.rate[0].push(b.re);
            lanes.rate[1].push(b.im);
            lanes.curvature[0].push(c.re);
            lanes.curvature[1].push(c.im);
            let third = c.norm() * norm;
            if rate.re > 0.0 {
                lanes.third.push(0.0);
                lanes.third_constant += third * (rate.re * length).exp();
            } else {
                lanes.third.push(third);
            }
            lanes.size += a.norm();
        }
        for term in &self.powers {
            lanes.third_constant += term.bound(3, length);
            lanes.size += term.bound(0, length);
        }
    }

    /// Value, rate, curvature and third-derivative bound at `s`.
    pub fn jet(&self, s: f64) -> Jet {
        let lanes = &self.lanes;
        let mut jet =
            Jet { value: self.constant, rate: 0.0, curvature: 0.0, third: lanes.third_constant };
        for k in 0..self.rates.len() {
            let grown = (lanes.decay[k] * s).exp();
            let (sin, cos) = (lanes.frequency[k] * s).sin_cos();
            let (re, im) = (grown * cos, grown * sin);
            jet.value += lanes.value[0][k] * re - lanes.value[1][k] * im;
            jet.rate += lanes.rate[0][k] * re - lanes.rate[1][k] * im;
            jet.curvature += lanes.curvature[0][k] * re - lanes.curvature[1][k] * im;
            jet.third += lanes.third[k] * grown;
        }
        for term in &self.powers {
            jet.value += term.derivative(0, s);
            jet.rate += term.derivative(1, s);
            jet.curvature += term.derivative(2, s);
        }
        jet
    }

    /// The jet at `s = 0`, which needs no exponential.
    pub fn first_jet(&self) -> Jet {
        let lanes = &self.lanes;
        let mut jet = Jet {
            value: self.constant + lanes.value[0].iter().sum::<f64>(),
            rate: lanes.rate[0].iter().sum(),
            curvature: lanes.curvature[0].iter().sum(),
            third: lanes.third_constant + lanes.third.iter().sum::<f64>(),
        };
        for term in &self.powers {
            jet.value += term.derivative(0, 0.0);
            jet.rate += term.derivative(1, 0.0);
            jet.curvature += term.derivative(2, 0.0);
        }
        jet
    }

    /// The value at `s`.
    pub fn at(&self, s: f64) -> f64 {
        let mut value = self.constant;
        for (rate, a) in self.rates.iter().zip(&self.amplitudes) {
            value += (a * (rate * s).exp()).re;
        }
        value + self.powers.iter().map(|term| term.derivative(0, s)).sum::<f64>()
    }

    /// The value at `s` with an error far below double precision's (about 1e-28 of
    /// the terms' size before it is rounded): which side of zero a tangency lies on.
    pub fn accurate_at(&self, s: f64) -> f64 {
        crate::double_double::signal_value(self, s)
    }

    /// The `order`-th derivative at `s = 0`.
    pub fn derivative_at_start(&self, order: u32) -> f64 {
        let mut value = if order == 0 { self.constant } else { 0.0 };
        for (rate, a) in self.rates.iter().zip(&self.amplitudes) {
            value += (a * rate.powu(order)).re;
        }
        value + self.powers.iter().map(|term| term.derivative(order, 0.0)).sum::<f64>()
    }

    /// An upper bound of the `order`-th derivative's size over `[0, length]`.
    pub fn derivative_bound(&self, order: u32, length: f64) -> f64 {
        let mut bound = if order == 0 { self.constant.abs() } else { 0.0 };
        for (rate, a) in self.rates.iter().zip(&self.amplitudes) {
            bound += a.norm() * rate.norm().powi(order as i32) * (rate.re.max(0.0) * length).exp();
        }
        bound + self.powers.iter().map(|term| term.bound(order, length)).sum::<f64>()
    }

    /// The largest `|λ_k|`: how fast the signal can turn.
    pub fn fastest(&self) -> f64 {
        let simple = self.rates.iter().map(|r| r.norm());
        let powers = self.powers.iter().map(|t| t.rate.norm());
        simple.chain(powers).fold(0.0, f64::max)
    }

    /// The size of rounding errors in its value.
    pub fn noise(&self) -> f64 {
        4.0 * f64::EPSILON * self.lanes.size
    }

    /// Whether every term is finite.
    pub fn is_finite(&self) -> bool {
        self.lanes.size.is_finite()
    }

    /// `g'` as a signal.
    #[must_use]
    pub fn differentiated(&self, length: f64) -> Self {
        let mut amplitudes: Vec<Complex> =
            self.rates.iter().zip(&self.amplitudes).map(|(r, a)| r * a).collect();
        let mut rates = self.rates.clone();
        let mut powers = Vec::new();
        for term in &self.powers {
            powers.push(PowerTerm { amplitude: term.amplitude * term.rate, ..*term });
            let amplitude = term.amplitude * f64::from(term.power);
            if term.power > 1 {
                powers.push(PowerTerm { amplitude, power: term.power - 1, rate: term.rate });
            } else {
                rates.push(term.rate);
                amplitudes.push(amplitude);
            }
        }
        let mut signal = Self { rates, amplitudes, powers, ..Self::default() };
        signal.prepare(length);
        signal
    }

    /// `factor · g(start + s)` as a signal in `s`, to be looked at over `length`.
    #[must_use]
    pub fn shifted(&self, start: f64, factor: f64, length: f64) -> Self {
        let mut amplitudes: Vec<Complex> = self
            .rates
            .iter()
            .zip(&self.amplitudes)
            .map(|(r, a)| a * (r * start).exp() * factor)
            .collect();
        let mut rates = self.rates.clone();
        let mut powers = Vec::new();
        for term in &self.powers {
            // (s + start)^p = Σ_i C(p, i) s^i start^{p−i}
            let grown = term.amplitude * (term.rate * start).exp() * factor;
            let mut binomial = 1.0;
            for i in (0..=term.power).rev() {
                let amplitude = grown * binomial * start.powi((term.power - i) as i32);
                if i == 0 {
                    rates.push(term.rate);
                    amplitudes.push(amplitude);
                } else {
                    powers.push(PowerTerm { amplitude, power: i, rate: term.rate });
                }
                binomial *= f64::from(i) / f64::from(term.power - i + 1);
            }
        }
        let mut signal = Self { constant: self.constant * factor, rates, amplitudes, powers, ..Self::default() };
        signal.prepare(length);
        signal
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
            sum += self.rate.powu(order - i) * self.weight(order, i) * s.powi((self.power - i) as i32);
        }
        (self.amplitude * sum * (self.rate * s).exp()).re
    }

    fn bound(self, order: u32, length: f64) -> f64 {
        let growth = (self.rate.re.max(0.0) * length).exp();
        let sum: f64 = (0..=order.min(self.power))
            .map(|i| {
                self.rate.norm().powi((order - i) as i32)
                    * self.weight(order, i)
                    * length.powi((self.power - i) as i32)
            })
            .sum();
        self.amplitude.norm() * growth * sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Signal {
        let mut signal = Signal::from_terms(
            0.3,
            vec![Complex::new(-0.2, 3.0), Complex::new(-0.5, 0.0), Complex::new(0.0, 2.6)],
            vec![Complex::new(0.4, -0.7), Complex::new(-1.1, 0.0), Complex::new(0.1, 0.2)],
            4.0,
        );
        signal.powers.push(PowerTerm {
            rate: Complex::new(-1.0, 0.0),
            power: 2,
            amplitude: Complex::new(0.8, 0.0),
        });
        signal.prepare(4.0);
        signal
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
            assert!((signal.shifted(0.4, -2.0, 4.0).at(s - 0.4 * s.min(0.0)) + 2.0 * signal.at(s + 0.4)).abs() < 1e-13);
        }
        let (first, zero) = (signal.first_jet(), signal.jet(0.0));
        assert!((first.value - zero.value).abs() < 1e-15 && (first.third - zero.third).abs() < 1e-13);
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
                let third = (signal.jet(t + 1e-4).curvature - signal.jet(t - 1e-4).curvature) / 2e-4;
                assert!(third.abs() <= bound + 1e-6);
            }
        }
    }
}
