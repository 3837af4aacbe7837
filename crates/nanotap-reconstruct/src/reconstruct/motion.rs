//! The tip's periodic motion in a known force and damping, and what a row measures of them.

use std::f64::consts::TAU;

use nanotap_arithmetic::sin_cos;
use nanotap_flow::Complex;

use super::nodes::Nodes;

/// Number of equidistant phases of a period at which the motion is known.
const PHASES: usize = 900;
/// Highest harmonic of the motion.
pub(super) const HARMONICS: usize = 24;
/// Bounds of the relaxation of the fixed-point iteration.
const RELAXATION: [f64; 2] = [0.08, 1.0];
/// Bounds of the number of steps of the fixed-point iteration.
const STEPS: [f64; 2] = [4.0, 24.0];

/// The harmonics at all phases.
#[derive(Clone, Debug)]
pub(super) struct Harmonics {
    /// cos θ and sin θ.
    first: Vec<(f64, f64)>,
    /// e^{inθ}, n = 2 …, phase by phase.
    higher: Vec<Complex>,
}

impl Harmonics {
    pub(super) fn new() -> Self {
        let at = |k: usize, n: usize| {
            // Whole turns are taken out first.
            let part = (2 * k + 1) * n % (2 * PHASES);
            sin_cos(TAU * part as f64 / (2 * PHASES) as f64)
        };
        let first = (0..PHASES).map(|k| at(k, 1)).map(|(sin, cos)| (cos, sin));
        let higher = (0..PHASES).flat_map(|k| {
            (2..=HARMONICS).map(move |n| {
                let (sin, cos) = at(k, n);
                Complex::new(cos, sin)
            })
        });
        Self {
            first: first.collect(),
            higher: higher.collect(),
        }
    }
}

/// Distance and its derivative by the phase θ, over a period in which the first harmonic is
/// a cos θ.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    pub(super) distance: Vec<f64>,
    slope: Vec<f64>,
}

/// Weights of the coefficients of force and damping in what a row measures: one vector each, an
/// entry per coefficient.
#[derive(Clone, Debug)]
pub(super) struct Weights {
    /// Weights of the force in C = (1/π) ∮ F cos θ dθ.
    pub(super) cosine: Vec<f64>,
    /// Weights of the damping in C.
    pub(super) cosine_damping: Vec<f64>,
    /// Weights of the force in the work of the first harmonic, a ∮ F sin θ dθ.
    pub(super) work: Vec<f64>,
    /// Weights of the damping in that work.
    pub(super) work_damping: Vec<f64>,
    /// Weights of the force in its mean over a period.
    pub(super) mean: Vec<f64>,
    /// Weights of the damping in the dissipated energy ∮ g d′² dθ.
    pub(super) dissipated: Vec<f64>,
}

/// Force and damping that are known, and how the lever's harmonics respond to a force at the tip.
#[derive(Clone, Copy, Debug)]
pub(super) struct KnownForces<'a> {
    pub(super) nodes: &'a Nodes,
    pub(super) force: &'a [f64],
    pub(super) damping: &'a [f64],
    /// Displacement a unit of force, of the harmonics 0, 1, ….
    pub(super) gains: &'a [Complex],
}

impl KnownForces<'_> {
    /// Relaxation of the fixed-point iteration, smaller for a steeper force.
    fn relaxation(self) -> f64 {
        let nodes = &self.nodes.0;
        let slopes = self.force.windows(2).zip(nodes.windows(2));
        let steepest = slopes
            .map(|(f, x)| ((f[1] - f[0]) / (x[1] - x[0])).abs())
            .fold(0.0, f64::max);
        let stiffness = 1.0 / self.gains[0].re.abs();
        (1.0 / (1.0 + steepest / (3.0 * stiffness))).clamp(RELAXATION[0], RELAXATION[1])
    }

    /// The motion about the mean distance `centre` with the first harmonic `amplitude` cos θ.
    pub(super) fn motion(self, harmonics: &Harmonics, centre: f64, amplitude: f64) -> Motion {
        let first = harmonics.first.iter();
        let (base, base_slope): (Vec<f64>, Vec<f64>) = first
            .map(|(cos, sin)| (centre + amplitude * cos, -amplitude * sin))
            .unzip();
        let relaxation = self.relaxation();
        let steps = (3.0 / relaxation).clamp(STEPS[0], STEPS[1]) as usize;
        let (mut distance, mut slope) = (base.clone(), base_slope.clone());
        let width = HARMONICS - 1;
        for step in 0..steps {
            let mut forces = [Complex::new(0.0, 0.0); HARMONICS - 1];
            for k in 0..PHASES {
                let at = self.nodes.place(distance[k]);
                let damping = Nodes::at(self.damping, at);
                let force = Nodes::at(self.force, at) - damping * slope[k];
                let higher = &harmonics.higher[k * width..(k + 1) * width];
                for (sum, harmonic) in forces.iter_mut().zip(higher) {
                    sum.re += force * harmonic.re;
                    sum.im -= force * harmonic.im;
                }
            }
            let mut displacements = forces;
            for (n, (sum, gain)) in displacements.iter_mut().zip(&self.gains[2..]).enumerate() {
                *sum = *sum * *gain * (2.0 / PHASES as f64);
                forces[n] = Complex::new(0.0, (n + 2) as f64) * *sum;
            }
            let weight = if step < 2 {
                relaxation.min(0.5)
            } else {
                relaxation
            };
            for k in 0..PHASES {
                let higher = &harmonics.higher[k * width..(k + 1) * width];
                let (mut shift, mut speed) = (0.0, 0.0);
                for (n, harmonic) in higher.iter().enumerate() {
                    let (d, s) = (displacements[n], forces[n]);
                    shift += d.re * harmonic.re - d.im * harmonic.im;
                    speed += s.re * harmonic.re - s.im * harmonic.im;
                }
                distance[k] += weight * (base[k] + shift - distance[k]);
                slope[k] += weight * (base_slope[k] + speed - slope[k]);
            }
        }
        Motion { distance, slope }
    }
}

impl Motion {
    /// Moves the motion half of the way to another motion of the same row.
    pub(super) fn half_way(&mut self, other: &Self) {
        let mix = |own: &mut [f64], other: &[f64]| {
            for (own, other) in own.iter_mut().zip(other) {
                *own = 0.5 * (*own + other);
            }
        };
        mix(&mut self.distance, &other.distance);
        mix(&mut self.slope, &other.slope);
    }

    /// Returns the closest approach of the tip to the sample, m or model units.
    pub(super) fn closest(&self) -> f64 {
        self.distance.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Computes the weights of force and damping in what the row measures, by quadrature over the
    /// phases.
    pub(super) fn weights(&self, harmonics: &Harmonics, nodes: &Nodes, amplitude: f64) -> Weights {
        let zeros = vec![0.0; nodes.0.len()];
        let mut weights = [const { Vec::new() }; 6].map(|_: Vec<f64>| zeros.clone());
        let part = 2.0 / PHASES as f64;
        for k in 0..PHASES {
            let (at, upper) = nodes.place(self.distance[k]);
            let ((cos, sin), slope) = (harmonics.first[k], self.slope[k]);
            let factors = [
                part * cos,
                -part * slope * cos,
                0.5 * TAU * part * amplitude * sin,
                -0.5 * TAU * part * amplitude * slope * sin,
                0.5 * part,
                0.5 * TAU * part * slope * slope,
            ];
            for (weights, factor) in weights.iter_mut().zip(factors) {
                weights[at] += (1.0 - upper) * factor;
                weights[at + 1] += upper * factor;
            }
        }
        let [cosine, cosine_damping, work, work_damping, mean, dissipated] =
            weights.map(|mut w| {
                w.truncate(nodes.unknowns());
                w
            });
        Weights {
            cosine,
            cosine_damping,
            work,
            work_damping,
            mean,
            dissipated,
        }
    }

    /// Derivative of C by a shift of the whole motion, in the force with these coefficients.
    pub(super) fn shift_slope(&self, harmonics: &Harmonics, nodes: &Nodes, force: &[f64]) -> f64 {
        let half = 0.5 * nodes.spacing();
        let phases = self.distance.iter().zip(&harmonics.first);
        let slopes = phases.map(|(d, (cos, _))| {
            let rise = nodes.value(force, d + half) - nodes.value(force, d - half);
            cos * rise / (2.0 * half)
        });
        slopes.sum::<f64>() * 2.0 / PHASES as f64
    }
}
