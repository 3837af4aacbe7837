//! Integrals of the law's force over a run, without a recording.

use crate::flow::{Flow, Observer, Switch};
use crate::law::Exit;
use crate::linear::add_product;
use crate::quadrature::{derivative, gauss_legendre, series};
use crate::step::{Solver, Step};
use crate::system::System;
use crate::trajectory::{Trajectory, bisect};
use crate::{Complex, VolterraError};

/// Number of nodes of the Gauss–Legendre rule of one step: exact for the polynomial of a step's
/// force times the drive's phasor over a quarter of its period.
const NODES: usize = 16;

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

/// Work, least gap and times of contact of a run over a surface that one of the drive's tones
/// moves, in the system's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSums {
    /// Work `∫ F ẏ dt` of the force on the tone's part `y` of the gap, in units of force times
    /// length.
    pub work: f64,
    /// Part of the work while the force attracts, `F < 0`.
    pub attracted_work: f64,
    /// Least gap, in the unit of the gap; infinite before a run.
    pub least_gap: f64,
    /// First and last time on branches on which tip and sample touch, in the system's unit of
    /// time; `None` if they do not.
    pub touch: Option<[f64; 2]>,
}

impl Default for SurfaceSums {
    fn default() -> Self {
        Self {
            work: 0.0,
            attracted_work: 0.0,
            least_gap: f64::INFINITY,
            touch: None,
        }
    }
}

impl SurfaceSums {
    /// Adds a stretch of contact between two times, after those added before.
    pub fn add_touch(&mut self, [start, end]: [f64; 2]) {
        let first = self.touch.map_or(start, |[first, _]| first);
        self.touch = Some([first, end]);
    }
}

/// Results of [`Flow::run_with_surface_sums`].
#[derive(Clone, Debug)]
pub struct SurfaceRun {
    /// Integrals and extrema of the force.
    pub force: ForceSums,
    /// Work, least gap and times of contact.
    pub surface: SurfaceSums,
    /// The recorded motion, if it was requested.
    pub trajectory: Option<Trajectory>,
}

/// Observer for [`SurfaceSums`].
#[derive(Debug)]
struct SurfaceSummation {
    sums: SurfaceSums,
    /// Angular frequency and complex amplitude of the tone that moves the surface.
    frequency: f64,
    amplitude: Complex,
    touches: Vec<bool>,
    /// Work space: the gap's series and a derivative.
    gap: Vec<f64>,
    slope: Vec<f64>,
}

impl SurfaceSummation {
    /// Returns the rate of the tone's part of the gap at a time.
    fn rate(&self, time: f64) -> f64 {
        let (sin, cos) = nanotap_arithmetic::sin_cos(self.frequency * time);
        -self.frequency * (self.amplitude.re * sin + self.amplitude.im * cos)
    }

    /// Lowers the least gap to that of a step.
    fn include_gap(&mut self, system: &System, step: &Step) {
        self.gap.fill(0.0);
        let values = &step.gap[..self.gap.len()];
        add_product(&system.kernel().coefficients, values, &mut self.gap);
        derivative(&self.gap, &mut self.slope);
        let mut least = series(&self.gap, 0.0).min(series(&self.gap, step.end));
        zeros(&self.slope, step.end, |u, rises| {
            if rises {
                least = least.min(series(&self.gap, u));
            }
        });
        self.sums.least_gap = self.sums.least_gap.min(least);
    }

    /// Adds the work on a step, split where the force changes its sign.
    fn add_work(&mut self, step: &Step) {
        let mut from = 0.0;
        let mut ends = Vec::new();
        zeros(&step.coefficients, step.end, |u, _| ends.push(u));
        ends.push(step.end);
        let (places, weights) = gauss_legendre(NODES);
        for end in ends {
            let width = end - from;
            let mut work = 0.0;
            for (place, weight) in places.iter().zip(weights) {
                let u = from + place * width;
                let by_time = weight * width * step.map.rate(step.length, u);
                work += by_time * step.force_at(u) * self.rate(step.time(u));
            }
            self.sums.work += work;
            if step.force_at(from + 0.5 * width) < 0.0 {
                self.sums.attracted_work += work;
            }
            from = end;
        }
    }
}

impl Observer for SurfaceSummation {
    fn step(&mut self, system: &System, _: &mut Solver, step: &Step, _: &[f64]) {
        if self.touches[step.branch] {
            self.sums.add_touch([step.start, step.end_time()]);
        }
        self.include_gap(system, step);
        if !system.vanishes(step.branch) {
            self.add_work(step);
        }
    }

    fn switch(&mut self, _: &System, _: &Switch, _: &Exit, _: &[f64]) {}
}

/// Calls `visit` with the zeros of a series between 0 and `end` at which it changes its sign, in
/// order, and whether it rises there.
fn zeros(coefficients: &[f64], end: f64, mut visit: impl FnMut(f64, bool)) {
    let (places, _) = gauss_legendre(2 * NODES);
    let value = |u: f64| series(coefficients, u);
    let mut last = (0.0, value(0.0));
    for place in places.iter().copied().chain([1.0]) {
        let here = (place * end, value(place * end));
        if last.1 * here.1 < 0.0 {
            visit(bisect(&value, last, here), here.1 > 0.0);
        }
        if here.1 != 0.0 {
            last = here;
        }
    }
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
            slope: zeros,
        }
    }

    /// Includes the extrema of the force inside a step.
    fn include_extrema(&mut self, step: &Step) {
        derivative(&step.coefficients, &mut self.slope);
        zeros(&self.slope, step.end, |u, _| {
            self.sums.include(series(&step.coefficients, u));
        });
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
        let (mut largest, mut lowest) = (f64::NEG_INFINITY, f64::INFINITY);
        for (place, weight) in places.iter().zip(weights) {
            let u = place * step.end;
            let force = step.force_at(u);
            largest = largest.max(force);
            lowest = lowest.min(force);
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
        let exceeds = largest > 0.0 && 1.2 * largest > self.sums.peak
            || lowest < 0.0 && 1.2 * lowest < self.sums.lowest;
        if exceeds {
            self.include_extrema(step);
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

    /// As [`Flow::run_with_force_sums`], over a surface that the drive's tone number `tone` moves;
    /// records the motion if `recorded`.
    ///
    /// # Errors
    /// As [`Flow::run_until`] and, if there is no such tone, [`VolterraError::TooLarge`];
    /// recording, as [`Flow::record_until`].
    pub fn run_with_surface_sums(
        &mut self,
        end: f64,
        omega: f64,
        tone: usize,
        recorded: bool,
    ) -> Result<SurfaceRun, VolterraError> {
        let system = self.system.clone();
        let tones = &system.drive().tones;
        let Some(moving) = tones.get(tone) else {
            return Err(VolterraError::TooLarge {
                what: "the number of the tone",
                found: tone,
                limit: tones.len().saturating_sub(1),
            });
        };
        let law = system.law();
        let zeros = vec![0.0; system.kernel().nodes];
        let mut summation = Summation::new(&system, omega);
        let mut surface = SurfaceSummation {
            sums: SurfaceSums::default(),
            frequency: moving.frequency,
            amplitude: moving.gap,
            touches: (0..law.branches()).map(|b| law.touches(b)).collect(),
            gap: zeros.clone(),
            slope: zeros,
        };
        let mut trajectory = recorded.then(|| Trajectory::empty(system.clone()));
        let mut observer = (&mut surface, &mut trajectory);
        self.run(end, &mut (&mut summation, &mut observer))?;
        Ok(SurfaceRun {
            force: summation.sums,
            surface: surface.sums,
            trajectory: trajectory.map(Trajectory::whole).transpose()?,
        })
    }
}

impl ForceSums {
    /// Extends the range from the lowest to the largest force to include `force`.
    pub const fn include(&mut self, force: f64) {
        self.peak = self.peak.max(force);
        self.lowest = self.lowest.min(force);
    }
}
