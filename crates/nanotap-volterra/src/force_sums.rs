//! Integrals of the law's force over a run, without a recording.

use crate::flow::{Flow, Observer, Switch};
use crate::law::Exit;
use crate::linear::add_product;
use crate::quadrature::{derivative, gauss_legendre, series};
use crate::step::{Solver, Step};
use crate::system::System;
use crate::{Complex, VolterraError};

/// Number of nodes of the Gauss–Legendre rule of one step: exact for the polynomial of a step's
/// force times the drive's phasor over a quarter of its period.
const NODES: usize = 16;
/// Number of Newton steps from the largest force at the nodes to the peak.
const REFINEMENTS: usize = 4;

/// Integrals of the force `F` over a run, its extrema, and the time in contact, in the system's
/// units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceSums {
    /// Integral `∫ F dt`, in units of force times time.
    pub impulse: f64,
    /// Integral `∫ F e^{−iωt} dt` with the angular frequency of the harmonic, in units of force
    /// times time.
    pub harmonic: Complex,
    /// Work `∫ F ḋ dt` on the gap, in units of force times length; negative over a closed motion if
    /// the force dissipates. 0 for a conservative law.
    pub work: f64,
    /// Largest force, at least 0, in the unit of force; repulsion is positive.
    pub peak: f64,
    /// Lowest force, at most 0, in the unit of force; attraction is negative.
    pub lowest: f64,
    /// Time on branches on which tip and sample touch, in the system's unit of time.
    pub contact: f64,
}

/// Observer that integrates forces along a run.
#[derive(Debug)]
struct Summation {
    sums: ForceSums,
    /// Angular frequency of the harmonic.
    omega: f64,
    touches: Vec<bool>,
    conservative: bool,
    /// Work space: the gap's series, its derivative, that of the force.
    gap: Vec<f64>,
    gap_slope: Vec<f64>,
    slope: Vec<f64>,
    curvature: Vec<f64>,
}

impl Summation {
    fn new(system: &System, omega: f64) -> Self {
        let law = system.law();
        let zeros = vec![0.0; system.kernel().nodes];
        Self {
            sums: ForceSums::default(),
            omega,
            touches: (0..law.branches()).map(|b| law.touches(b)).collect(),
            conservative: law.conservative(),
            gap: zeros.clone(),
            gap_slope: zeros.clone(),
            slope: zeros.clone(),
            curvature: zeros,
        }
    }

    /// Includes the extremum of the force near `u` on a step.
    fn include_extremum(&mut self, step: &Step, mut u: f64) {
        derivative(&step.coefficients, &mut self.slope);
        derivative(&self.slope, &mut self.curvature);
        for _ in 0..REFINEMENTS {
            let next = u - series(&self.slope, u) / series(&self.curvature, u);
            if !(next >= 0.0 && next <= step.end) {
                break;
            }
            u = next;
        }
        self.sums.include(series(&step.coefficients, u));
    }
}

impl Observer for Summation {
    fn step(&mut self, system: &System, _: &mut Solver, step: &Step, _: &[f64]) {
        if self.touches[step.branch] {
            self.sums.contact += step.end_time() - step.start;
        }
        if system.vanishes(step.branch) {
            return;
        }
        if !self.conservative {
            self.gap.fill(0.0);
            let values = &step.gap[..self.gap.len()];
            add_product(&system.kernel().coefficients, values, &mut self.gap);
            derivative(&self.gap, &mut self.gap_slope);
        }
        let (places, weights) = gauss_legendre(NODES);
        let (mut largest, mut largest_at) = (f64::NEG_INFINITY, 0.0);
        let (mut lowest, mut lowest_at) = (f64::INFINITY, 0.0);
        for (place, weight) in places.iter().zip(weights) {
            let u = place * step.end;
            let force = step.force_at(u);
            if force > largest {
                (largest, largest_at) = (force, u);
            }
            if force < lowest {
                (lowest, lowest_at) = (force, u);
            }
            let weight = weight * step.end;
            let by_time = weight * step.map.rate(step.length, u) * force;
            let (sin, cos) = nanotap_arithmetic::sin_cos(self.omega * step.time(u));
            self.sums.impulse += by_time;
            self.sums.harmonic += Complex::new(cos, -sin) * by_time;
            if !self.conservative {
                self.sums.work += weight * force * series(&self.gap_slope, u);
            }
        }
        for end in [0.0, step.end] {
            self.sums.include(step.force_at(end));
        }
        // Between nodes the force exceeds the largest of them by a few per cent at most.
        if largest > 0.0 && 1.2 * largest > self.sums.peak {
            self.include_extremum(step, largest_at);
            self.sums.include(largest);
        }
        if lowest < 0.0 && 1.2 * lowest < self.sums.lowest {
            self.include_extremum(step, lowest_at);
            self.sums.include(lowest);
        }
    }

    fn switch(&mut self, _: &System, _: &Switch, _: &Exit, _: &[f64]) {}
}

impl Flow {
    /// Runs to time `end` and integrates the force, with its component at the angular frequency
    /// `omega`.
    ///
    /// # Errors
    /// As [`Flow::run_until`].
    pub fn run_with_force_sums(
        &mut self,
        end: f64,
        omega: f64,
    ) -> Result<ForceSums, VolterraError> {
        let mut summation = Summation::new(self.system(), omega);
        self.run(end, &mut summation)?;
        Ok(summation.sums)
    }
}

impl ForceSums {
    /// Extends the range from the lowest to the largest force to include `force`.
    pub const fn include(&mut self, force: f64) {
        self.peak = self.peak.max(force);
        self.lowest = self.lowest.min(force);
    }
}
