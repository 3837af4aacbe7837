//! Integrals of outputs over segments in closed form: means, Fourier
//! coefficients, and the work of one output on another.

use crate::Complex;
use crate::rate::Rate;
use crate::signal::Signal;
use crate::trajectory::PiecewiseSignal;
use nanotap_arithmetic::ComplexFunctions as _;

/// A term `amplitude · s^power · e^{rate s}` over a length of time; a signal is the real part of a
/// sum of such terms.
#[derive(Clone, Copy)]
struct Term {
    rate: Complex,
    power: u32,
    amplitude: Complex,
    /// Value of `e^{rate · length}`.
    end: Complex,
}

fn terms(signal: &Signal, length: f64) -> Vec<Term> {
    let constant = (
        Complex::new(0.0, 0.0),
        0,
        Complex::new(signal.constant, 0.0),
    );
    let simple = signal.terms().map(|(rate, amplitude)| (rate, 0, amplitude));
    let powers = signal.powers.iter().map(|t| (t.rate, t.power, t.amplitude));
    std::iter::once(constant)
        .chain(simple)
        .chain(powers)
        .filter(|(_, _, amplitude)| *amplitude != Complex::new(0.0, 0.0))
        .map(|(rate, power, amplitude)| Term {
            rate,
            power,
            amplitude,
            end: (rate * length).exponential(),
        })
        .collect()
}

/// Computes `∫₀^length s^power e^{rate s} ds`, given `end = e^{rate · length}`.
fn moment(rate: Complex, power: u32, length: f64, end: Complex) -> Complex {
    let z = rate * length;
    if power == 0 || z.modulus() > f64::from(power) + 1.0 {
        // Integration by parts, stable upwards while |z| exceeds the power.
        let mut integral = Rate::new(rate, length).integral(length, end);
        for p in 1..=power {
            integral = (end * length.powi(p as i32) - integral * f64::from(p)) / rate;
        }
        return integral;
    }
    let mut term = Complex::new(1.0, 0.0);
    let mut sum = Complex::new(0.0, 0.0);
    for k in 0..60_u32 {
        sum += term / f64::from(power + k + 1);
        term *= z / f64::from(k + 1);
    }
    sum * length.powi(power as i32 + 1)
}

/// Returns `∫₀^length g ds`.
pub fn integral(signal: &Signal, length: f64) -> f64 {
    terms(signal, length)
        .iter()
        .map(|t| (t.amplitude * moment(t.rate, t.power, length, t.end)).re)
        .sum()
}

/// Returns `∫₀^length g(s) e^{−iω(start + s)} ds`.
pub fn fourier_integral(signal: &Signal, start: f64, length: f64, omega: f64) -> Complex {
    Turn::new(start, length, omega).integral(&terms(signal, length))
}

/// The factor `e^{−iωt}` over a piece, and the moments of the terms that it has been multiplied by.
struct Turn {
    /// Rate `−iω` of the factor.
    rate: Complex,
    length: f64,
    /// Value `e^{−iω · start}` of the factor at the start of the piece.
    start: Complex,
    /// Ratio `e^{−iω · length}` of the factor's values at the end and at the start.
    over: Complex,
    /// Moments of a rate and of its conjugate, each minus `iω`, by rate and power.
    known: Vec<(Complex, u32, [Complex; 2])>,
}

impl Turn {
    fn new(start: f64, length: f64, omega: f64) -> Self {
        let rate = Complex::new(0.0, -omega);
        Self {
            rate,
            length,
            start: (rate * start).exponential(),
            over: (rate * length).exponential(),
            known: Vec::new(),
        }
    }

    /// Returns the integral of the factor times a sum of terms.
    fn integral(&mut self, terms: &[Term]) -> Complex {
        let sum: Complex = terms
            .iter()
            .map(|t| {
                let [direct, mirrored] = self.moments(t);
                (t.amplitude * direct + t.amplitude.conj() * mirrored) * 0.5
            })
            .sum();
        sum * self.start
    }

    fn moments(&mut self, t: &Term) -> [Complex; 2] {
        let mut known = self.known.iter();
        let known = known.find(|(rate, power, _)| *rate == t.rate && *power == t.power);
        if let Some((_, _, moments)) = known {
            return *moments;
        }
        let moments = [(t.rate, t.end), (t.rate.conj(), t.end.conj())]
            .map(|(rate, end)| moment(rate + self.rate, t.power, self.length, end * self.over));
        self.known.push((t.rate, t.power, moments));
        moments
    }
}

/// Computes the Fourier coefficients ([`PiecewiseSignal::fourier`]) of several outputs of one
/// trajectory (the same pieces), one row per frequency. Quantities that depend on the rates alone
/// are computed once.
pub fn fouriers(signals: &[&PiecewiseSignal], frequencies: &[f64]) -> Vec<Vec<Complex>> {
    let pieces = signals.first().map_or(0, |signal| signal.pieces.len());
    let terms: Vec<Vec<Vec<Term>>> = (0..pieces)
        .map(|k| {
            let of_piece = signals.iter().map(|signal| {
                let piece = &signal.pieces[k];
                terms(&piece.signal, piece.length)
            });
            of_piece.collect()
        })
        .collect();
    let duration = signals.first().map_or(0.0, |signal| signal.duration());
    frequencies
        .iter()
        .map(|&omega| {
            let mut sums = vec![Complex::new(0.0, 0.0); signals.len()];
            for (k, terms) in terms.iter().enumerate() {
                let piece = &signals[0].pieces[k];
                let mut turn = Turn::new(piece.start, piece.length, omega);
                for (sum, terms) in sums.iter_mut().zip(terms) {
                    *sum += turn.integral(terms);
                }
            }
            if duration > 0.0 {
                for sum in &mut sums {
                    *sum = *sum * 2.0 / duration;
                }
            }
            sums
        })
        .collect()
}

/// Returns `∫₀^length g h ds`.
pub fn product_integral(g: &Signal, h: &Signal, length: f64) -> f64 {
    let (g, h) = (terms(g, length), terms(h, length));
    let mut sum = 0.0;
    for a in &g {
        for b in &h {
            let product = |rate: Complex, amplitude: Complex, end: Complex| {
                let moment = moment(a.rate + rate, a.power + b.power, length, a.end * end);
                (a.amplitude * amplitude * moment).re
            };
            let direct = product(b.rate, b.amplitude, b.end);
            let crossed = product(b.rate.conj(), b.amplitude.conj(), b.end.conj());
            sum += 0.5 * (direct + crossed);
        }
    }
    sum
}

impl PiecewiseSignal {
    /// Returns the integral over the whole time covered.
    pub fn integral(&self) -> f64 {
        self.pieces
            .iter()
            .map(|p| integral(&p.signal, p.length))
            .sum()
    }

    /// Returns the time mean (0 for an empty signal).
    pub fn mean(&self) -> f64 {
        let duration = self.duration();
        if duration > 0.0 {
            self.integral() / duration
        } else {
            0.0
        }
    }

    /// Returns the Fourier coefficient `c = (2/D) ∫ g e^{−iωt} dt` over the duration `D`, so that
    /// the component at `ω` is `Re(c e^{iωt})`.
    pub fn fourier(&self, omega: f64) -> Complex {
        let sum: Complex = self
            .pieces
            .iter()
            .map(|p| fourier_integral(&p.signal, p.start, p.length, omega))
            .sum();
        let duration = self.duration();
        if duration > 0.0 {
            sum * 2.0 / duration
        } else {
            Complex::new(0.0, 0.0)
        }
    }

    /// Returns `∫ g h dt` with another output of the same trajectory (the same pieces).
    pub fn product_integral(&self, other: &Self) -> f64 {
        self.pieces
            .iter()
            .zip(&other.pieces)
            .map(|(a, b)| product_integral(&a.signal, &b.signal, a.length))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn simpson(f: impl Fn(f64) -> f64, length: f64) -> f64 {
        let n = 20_000;
        let h = length / f64::from(n);
        let inner: f64 = (1..n)
            .map(|i| f(f64::from(i) * h) * if i % 2 == 1 { 4.0 } else { 2.0 })
            .sum();
        (f(0.0) + f(length) + inner) * h / 3.0
    }

    #[test]
    fn integrals_agree_with_simpsons_rule() {
        let g = Signal::from_terms(
            0.4,
            &[
                (Complex::new(-0.3, 5.0), Complex::new(0.7, 0.2)),
                (Complex::new(0.0, 2.6), Complex::new(-0.1, 0.3)),
                (Complex::new(-1e-9, 0.0), Complex::new(0.2, 0.0)),
            ],
            Vec::new(),
            2.4,
        );
        let powers =
            [(1, 0.0), (2, -0.7), (3, -40.0)].map(|(power, rate)| crate::signal::PowerTerm {
                rate: Complex::new(rate, 0.0),
                power,
                amplitude: Complex::new(0.6, 0.0),
            });
        let h = Signal::from_terms(
            -0.1,
            &[
                (Complex::new(-2.0, 0.0), Complex::new(0.9, 0.0)),
                (Complex::new(0.0, 2.6), Complex::new(0.5, 0.1)),
            ],
            powers.to_vec(),
            2.4,
        );
        let l = 2.4;
        assert!((integral(&g, l) - simpson(|s| g.at(s), l)).abs() < 1e-12);
        assert!((integral(&h, l) - simpson(|s| h.at(s), l)).abs() < 1e-11);
        assert!((product_integral(&g, &h, l) - simpson(|s| g.at(s) * h.at(s), l)).abs() < 1e-11);
        let c = fourier_integral(&h, 0.3, l, 1.7);
        assert!((c.re - simpson(|s| h.at(s) * (1.7 * (0.3 + s)).cos(), l)).abs() < 1e-11);
        assert!((c.im + simpson(|s| h.at(s) * (1.7 * (0.3 + s)).sin(), l)).abs() < 1e-11);
    }
}
