//! The density of an oscillator over a white floor, as a spectrum of finite resolution shows it.

use std::f64::consts::PI;

use crate::spectrum::{Bin, Window};

/// Most nodes of the mean over a bin.
const MAX_NODES: usize = 400;
/// Bins narrower than this fraction of the peak's width f0/Q show the density at their centre, to
/// 0.04 %.
const NARROW_BIN: f64 = 1.0 / 64.0;

/// One-sided power density at frequency `f` of an oscillator with mean square `m`, resonance `f0` and
/// quality factor `q` over a white floor `w`: m in unit², w and the density in unit²/Hz, f and f0 in
/// Hz.
pub fn density(f: f64, f0: f64, q: f64, m: f64, w: f64) -> f64 {
    w + m * shape(f, f0, q)[0]
}

/// The density for m = 1, and its derivatives with respect to ln f0 and ln Q.
fn shape(f: f64, f0: f64, q: f64) -> [f64; 3] {
    let r = f / f0;
    let detuning = 1.0 - r * r;
    let damping = (r / q) * (r / q);
    let denominator = detuning * detuning + damping;
    let value = 2.0 / (PI * f0 * q * denominator);
    let by_f0 = -1.0 - (4.0 * r * r * detuning - 2.0 * damping) / denominator;
    let by_q = -1.0 + 2.0 * damping / denominator;
    [value, value * by_f0, value * by_q]
}

/// f0 in Hz, Q, m in unit² and the floor W in unit²/Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Oscillator {
    pub(crate) f0: f64,
    pub(crate) q: f64,
    pub(crate) m: f64,
    pub(crate) w: f64,
}

impl Oscillator {
    /// Width of the peak at half of its height, Hz.
    pub(crate) fn width(&self) -> f64 {
        self.f0 / self.q
    }

    /// Density that a bin shows, and its derivatives with respect to ln f0, ln Q, ln m and ln W.
    pub(crate) fn in_bin(&self, bin: &Bin, kernel: &Kernel) -> (f64, [f64; 4]) {
        let mut sum = [0.0; 3];
        for (offset, weight) in &kernel.nodes {
            // A density is an even function of frequency.
            let f = (bin.frequency + offset * bin.width).abs();
            for (sum, value) in sum.iter_mut().zip(shape(f, self.f0, self.q)) {
                *sum += weight * value;
            }
        }
        let [r, by_f0, by_q] = sum.map(|value| self.m * value);
        (r + self.w, [by_f0, by_q, r, self.w])
    }
}

/// Weights of the frequencies around its centre that a bin shows; offsets in bin widths.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Kernel {
    nodes: Vec<(f64, f64)>,
}

impl Kernel {
    /// The density at the centre.
    pub(crate) fn point() -> Self {
        Self {
            nodes: vec![(0.0, 1.0)],
        }
    }

    /// The mean over bins that are at most `width` wide (Hz) near a peak of width `peak` (Hz); several
    /// ordinates in a bin, or one of a periodogram with this window.
    pub(crate) fn new(width: f64, peak: f64, window: Option<Window>, is_mean: bool) -> Self {
        let ratio = width / peak;
        if ratio.is_nan() || ratio < NARROW_BIN {
            return Self::point();
        }
        let step = (0.2 / ratio).min(0.25);
        match window {
            Some(window) if !is_mean => Self::sampled(step, 4.0, |x| window.leakage(x)),
            _ if is_mean => {
                let panels = ((1.0 / step).ceil() as usize).min(MAX_NODES);
                let node = |k| ((k as f64 + 0.5) / panels as f64 - 0.5, 1.0 / panels as f64);
                Self {
                    nodes: (0..panels).map(node).collect(),
                }
            }
            _ => Self::point(),
        }
    }

    /// A weight at equal steps within ± `reach`; the sum is 1.
    fn sampled(step: f64, reach: f64, weight: impl Fn(f64) -> f64) -> Self {
        let half = ((reach / step).ceil() as i32).min(MAX_NODES as i32 / 2);
        let offset = |k| reach * f64::from(k) / f64::from(half);
        let nodes = (-half..=half).map(|k| (offset(k), weight(offset(k))));
        let nodes: Vec<_> = nodes.filter(|node| node.1 > 1e-9).collect();
        let sum: f64 = nodes.iter().map(|node| node.1).sum();
        Self {
            nodes: nodes.into_iter().map(|(x, w)| (x, w / sum)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OSCILLATOR: Oscillator = Oscillator {
        f0: 70e3,
        q: 30.0,
        m: 2.0,
        w: 1e-6,
    };

    fn bin(frequency: f64, width: f64) -> Bin {
        Bin {
            frequency,
            power: 1.0,
            width,
            ordinates: 1.0,
        }
    }

    /// ∫₀^∞ dr/((1 − r²)² + (r/Q)²) = πQ/2, so that the integral of the density is m.
    #[test]
    fn the_integral_is_the_mean_square() {
        for q in [0.6, 2.0, 50.0] {
            // f = f0 tan(πt/2) maps 0 … 1 onto all frequencies.
            let n = 100_000;
            let sum: f64 = (0..n)
                .map(|k| {
                    let t = 0.5 * PI * (f64::from(k) + 0.5) / f64::from(n);
                    let tangent = nanotap_arithmetic::tan(t);
                    0.5 * PI
                        * (1.0 + tangent * tangent)
                        * density(5.0 * tangent, 5.0, q, 3.0, 0.0)
                        * 5.0
                })
                .sum();
            assert!((sum / f64::from(n) - 3.0).abs() < 1e-6, "{q}: {sum}");
        }
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let kernel = Kernel::new(500.0, OSCILLATOR.width(), Some(Window::Hann), false);
        for f in [30e3, 69e3, 70e3, 73e3, 150e3] {
            let bin = bin(f, 500.0);
            let (_, gradient) = OSCILLATOR.in_bin(&bin, &kernel);
            let step = 1e-6;
            let moved = |k: usize, sign: f64| {
                let mut all = [OSCILLATOR.f0, OSCILLATOR.q, OSCILLATOR.m, OSCILLATOR.w];
                all[k] *= 1.0 + sign * step;
                let [f0, q, m, w] = all;
                Oscillator { f0, q, m, w }.in_bin(&bin, &kernel).0
            };
            for (k, exact) in gradient.into_iter().enumerate() {
                let found = (moved(k, 1.0) - moved(k, -1.0)) / (2.0 * step);
                let scale = OSCILLATOR.in_bin(&bin, &kernel).0;
                assert!(
                    (found - exact).abs() < 1e-7 * scale,
                    "{f} {k}: {found} {exact}"
                );
            }
        }
    }

    /// The mean over a wide bin against a sum of 10,000 densities.
    #[test]
    fn a_wide_bin_shows_the_mean() {
        let width = 3e3;
        let kernel = Kernel::new(width, OSCILLATOR.width(), None, true);
        for f in [66e3, 70e3, 75e3] {
            let mean: f64 = (0..10_000)
                .map(|k| {
                    let at = f + width * ((f64::from(k) + 0.5) / 1e4 - 0.5);
                    1e-4 * density(at, 70e3, 30.0, 2.0, 1e-6)
                })
                .sum();
            let (found, _) = OSCILLATOR.in_bin(&bin(f, width), &kernel);
            assert!((found / mean - 1.0).abs() < 5e-3, "{f}: {found} {mean}");
        }
    }
}
