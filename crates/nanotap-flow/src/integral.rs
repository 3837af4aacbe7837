//! Integrals of outputs over segments in closed form: means, Fourier
//! coefficients, and the work of one output on another.

use crate::Complex;
use crate::signal::Signal;
use crate::trajectory::PiecewiseSignal;
use nanotap_arithmetic::ComplexFunctions as _;

/// `amplitude · s^power · e^{rate s}`; a signal is the real part of a sum of these.
#[derive(Clone, Copy)]
struct Term {
    rate: Complex,
    power: u32,
    amplitude: Complex,
}

fn terms(signal: &Signal) -> Vec<Term> {
    let constant = Term {
        rate: Complex::new(0.0, 0.0),
        power: 0,
        amplitude: Complex::new(signal.constant, 0.0),
    };
    let simple = signal.terms().map(|(rate, amplitude)| Term {
        rate,
        power: 0,
        amplitude,
    });
    let powers = signal.powers.iter().map(|t| Term {
        rate: t.rate,
        power: t.power,
        amplitude: t.amplitude,
    });
    std::iter::once(constant)
        .chain(simple)
        .chain(powers)
        .filter(|t| t.amplitude.modulus() != 0.0)
        .collect()
}

/// `(e^z − 1)/z`, accurate for every `z`.
pub(crate) fn phi1(z: Complex) -> Complex {
    if z.modulus() < 1e-5 {
        return Complex::new(1.0, 0.0) + z * 0.5 + z * z / 6.0;
    }
    // e^{x+iy} − 1 = (e^x − 1) cos y − 2 sin²(y/2) + i e^x sin y
    let half = nanotap_arithmetic::sin(0.5 * z.im);
    let (sin, cos) = nanotap_arithmetic::sin_cos(z.im);
    Complex::new(
        nanotap_arithmetic::exp_m1(z.re) * cos - 2.0 * half * half,
        nanotap_arithmetic::exp(z.re) * sin,
    ) / z
}

/// `∫₀^length s^power e^{rate s} ds`.
fn moment(rate: Complex, power: u32, length: f64) -> Complex {
    let z = rate * length;
    if power == 0 {
        return phi1(z) * length;
    }
    if z.modulus() > f64::from(power) + 1.0 {
        // Integration by parts, stable upwards while |z| exceeds the power.
        let mut integral = phi1(z) * length;
        let end = z.exponential();
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

/// `∫₀^length g ds`.
pub fn integral(signal: &Signal, length: f64) -> f64 {
    terms(signal)
        .iter()
        .map(|t| (t.amplitude * moment(t.rate, t.power, length)).re)
        .sum()
}

/// `∫₀^length g(s) e^{−iω(start + s)} ds`.
pub fn fourier_integral(signal: &Signal, start: f64, length: f64, omega: f64) -> Complex {
    fourier_of_terms(&terms(signal), start, length, omega, &mut Moments::new())
}

/// Moments of a rate and its conjugate, by rate and power; of one piece at one frequency.
type Moments = Vec<(Complex, u32, [Complex; 2])>;

fn fourier_of_terms(
    terms: &[Term],
    start: f64,
    length: f64,
    omega: f64,
    known: &mut Moments,
) -> Complex {
    let turn = Complex::new(0.0, -omega);
    let sum: Complex = terms
        .iter()
        .map(|t| {
            let of_term = |(rate, power, _): &&(Complex, u32, [Complex; 2])| {
                *rate == t.rate && *power == t.power
            };
            let [direct, mirrored] = if let Some((_, _, moments)) = known.iter().find(of_term) {
                *moments
            } else {
                let moments =
                    [t.rate, t.rate.conj()].map(|rate| moment(rate + turn, t.power, length));
                known.push((t.rate, t.power, moments));
                moments
            };
            (t.amplitude * direct + t.amplitude.conj() * mirrored) * 0.5
        })
        .sum();
    sum * (turn * start).exponential()
}

/// The Fourier coefficients ([`PiecewiseSignal::fourier`]) of several outputs of one trajectory
/// (the same pieces), a row a frequency: what depends on the rates alone is computed once.
pub fn fouriers(signals: &[&PiecewiseSignal], frequencies: &[f64]) -> Vec<Vec<Complex>> {
    let pieces = signals.first().map_or(0, |signal| signal.pieces.len());
    let terms: Vec<Vec<Vec<Term>>> = (0..pieces)
        .map(|k| {
            let of_piece = signals.iter().map(|signal| terms(&signal.pieces[k].signal));
            of_piece.collect()
        })
        .collect();
    let duration = signals.first().map_or(0.0, |signal| signal.duration());
    let mut known = Moments::new();
    frequencies
        .iter()
        .map(|&omega| {
            let mut sums = vec![Complex::new(0.0, 0.0); signals.len()];
            for (k, terms) in terms.iter().enumerate() {
                known.clear();
                let piece = &signals[0].pieces[k];
                for (sum, terms) in sums.iter_mut().zip(terms) {
                    *sum += fourier_of_terms(terms, piece.start, piece.length, omega, &mut known);
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

/// `∫₀^length g h ds`.
pub fn product_integral(g: &Signal, h: &Signal, length: f64) -> f64 {
    let (g, h) = (terms(g), terms(h));
    let mut sum = 0.0;
    for a in &g {
        for b in &h {
            let power = a.power + b.power;
            let direct = a.amplitude * b.amplitude * moment(a.rate + b.rate, power, length);
            let crossed =
                a.amplitude * b.amplitude.conj() * moment(a.rate + b.rate.conj(), power, length);
            sum += 0.5 * (direct.re + crossed.re);
        }
    }
    sum
}

impl PiecewiseSignal {
    /// The integral over the whole time covered.
    pub fn integral(&self) -> f64 {
        self.pieces
            .iter()
            .map(|p| integral(&p.signal, p.length))
            .sum()
    }

    /// The time mean (0 of an empty signal).
    pub fn mean(&self) -> f64 {
        let duration = self.duration();
        if duration > 0.0 {
            self.integral() / duration
        } else {
            0.0
        }
    }

    /// The Fourier coefficient `c = (2/D) ∫ g e^{−iωt} dt` over the duration `D`, so
    /// that the component at `ω` is `Re(c e^{iωt})`.
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

    /// `∫ g h dt` with another output of the same trajectory (the same pieces).
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
