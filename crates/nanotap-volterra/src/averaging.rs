//! Approximate periodic motions by averaging: guesses for Newton's method.
//!
//! The gap is taken as `d̄ + A cos θ`, `θ = Ωt + φ`, with the frequency of the strongest tone. Over
//! one oscillation the law gives a mean force `F̄` and the complex first harmonic `f`
//! (`F ≈ F̄ + Re f e^{iθ}`), its memory included. With the gap's static compliance `c`, its
//! receptance `H(Ω)`, and `G` the tone's part in the gap without the force, harmonic balance gives
//!
//! `d̄ = d₀ + c F̄`, `|A − H f| = |G|`, `e^{iφ} = G/(A − H f)`
//!
//! (Garcia and San Paulo, Phys. Rev. B 60, 4961, 1999, for one mode). The roots in `A` at a given
//! distance `d₀` are the motions.
//! Higher harmonics of the force enter the state by the modes' response to them. The result is
//! wrong if the gap has strong harmonics: it is only a guess.

use crate::gap_table::GapTable;
use crate::law::Guard;
use crate::system::System;
use crate::{Complex, VolterraError};
use nalgebra::DVector;
use nanotap_arithmetic::ComplexFunctions as _;
use std::f64::consts::{PI, TAU};

/// Number of amplitudes at which the equation is evaluated.
const AMPLITUDES: usize = 400;
/// Number of phases over one oscillation, denser towards the sample.
const PHASES: usize = 240;
/// Number of harmonics of the force in the state.
const HARMONICS: usize = 12;
/// Largest number of Newton steps for the mean gap.
const MAX_ITERATIONS: usize = 12;
/// Largest residual of a root, as a fraction of the drive's amplitude; beyond it the sign changes
/// only because the force jumps.
const MAX_RESIDUAL: f64 = 0.5;
/// Largest shift of the mean gap by the force, as a multiple of the size of gaps and amplitudes.
const MAX_SHIFT: f64 = 3.0;
/// Distance of the least gap from a pole at which the search for the mean gap begins at least, as a
/// fraction of the size of gaps and amplitudes.
const FROM_POLE: f64 = 1e-3;
/// Number of halvings of an interval that contains a root.
const BISECTIONS: usize = 30;

/// A guess of a periodic motion, to start Newton's method from.
#[derive(Clone, Debug, PartialEq)]
pub struct AveragedMotion {
    /// State at drive phase 0, of length `n`, in the system's units.
    pub state: Vec<f64>,
    /// Branch of the law at drive phase 0.
    pub branch: usize,
    /// Amplitude of the gap at the strongest tone, in the unit of the gap.
    pub amplitude: f64,
}

/// Averages of the force over one oscillation of the gap, `d̄ + A cos θ`, in the system's units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AveragedForce {
    /// Mean force.
    pub mean: f64,
    /// Complex first harmonic: `F ≈ F̄ + Re f e^{iθ}`.
    pub first: Complex,
    /// Largest force, at least 0.
    pub peak: f64,
    /// Time on branches on which tip and sample touch, as a fraction of the oscillation.
    pub contact: f64,
}

/// A system whose gap oscillates with the frequency of its strongest tone, with a slow amplitude.
#[derive(Clone, Debug)]
pub struct SlowGap<'a>(Averaging<'a>);

impl<'a> SlowGap<'a> {
    /// Returns `None` for a system without a drive that moves the gap, with a mode that has no
    /// response, with a surface that relaxes, or with a force that depends on time.
    pub fn new(system: &'a System) -> Option<Self> {
        Averaging::new(system).map(Self)
    }

    /// Returns the complex amplitude of the gap without the force.
    pub const fn drive(&self) -> Complex {
        self.0.drive
    }

    /// Returns the gap at rest without the force.
    pub const fn rest(&self) -> f64 {
        self.0.system.gap_constant
    }

    /// Returns the static change of the gap by a unit force.
    pub const fn compliance(&self) -> f64 {
        self.0.compliance
    }

    /// Returns the complex amplitude of the gap under a force of amplitude 1 at the frequency.
    pub const fn receptance(&self) -> Complex {
        self.0.receptance
    }

    /// Returns the gap at and behind which the law does not hold; −∞ if it has no pole.
    pub const fn pole(&self) -> f64 {
        self.0.pole
    }

    /// Averages the force over an oscillation that begins at the far turning point.
    pub fn force(&self, mean: f64, amplitude: f64) -> AveragedForce {
        let law = self.0.system.law();
        let mut out = AveragedForce::default();
        self.0.oscillate(mean, amplitude, |phase, force, branch| {
            let part = phase.weight * force;
            out.mean += part;
            out.first += Complex::new(2.0 * part * phase.cos, -2.0 * part * phase.sin);
            out.peak = out.peak.max(force);
            out.contact += if law.touches(branch) {
                phase.weight
            } else {
                0.0
            };
        });
        out
    }
}

/// The linear response of a system to the strongest tone and to a force, as averaging uses it.
#[derive(Clone, Debug)]
struct Averaging<'a> {
    system: &'a System,
    frequency: f64,
    /// Complex amplitude of the tone in the gap without the force.
    drive: Complex,
    compliance: f64,
    receptance: Complex,
    table: GapTable,
    /// Pole of the force, which no motion passes; −∞ if there is none.
    pole: f64,
    /// Phases and weights over one oscillation from the far turning point.
    phases: Vec<Phase>,
}

#[derive(Clone, Copy, Debug)]
struct Phase {
    angle: f64,
    cos: f64,
    sin: f64,
    weight: f64,
}

/// Averages of the force over one oscillation.
#[derive(Clone, Copy, Debug, Default)]
struct Average {
    mean: f64,
    /// Derivative of the mean force by the mean gap.
    slope: f64,
    first: Complex,
}

impl<'a> Averaging<'a> {
    /// Returns `None` for a system without a drive that moves the gap, with a mode that has no
    /// response, with a surface that relaxes, or with a force that depends on time.
    fn new(system: &'a System) -> Option<Self> {
        if system.law().surface().is_some() || system.law().takes_signal() {
            return None;
        }
        let tones = system.drive().tones.iter().zip(&system.gap_tones);
        let (tone, drive) = tones.max_by(|a, b| a.1.modulus().total_cmp(&b.1.modulus()))?;
        let unit = |frequency| {
            let modal = response(system, frequency).ok()?;
            Some(system.kernel().read(&modal))
        };
        // u from −1 to 1, θ = π + π u³: the force acts near π.
        let phases = (0..PHASES).map(|i| {
            let width = 2.0 / PHASES as f64;
            let u = (i as f64 + 0.5) * width - 1.0;
            let angle = PI + PI * u * u * u;
            let (sin, cos) = nanotap_arithmetic::sin_cos(angle);
            Phase {
                angle,
                cos,
                sin,
                weight: 1.5 * u * u * width,
            }
        });
        Some(Self {
            system,
            frequency: tone.frequency,
            drive: *drive,
            compliance: unit(0.0)?.re,
            receptance: unit(tone.frequency)?,
            table: GapTable::new(system),
            pole: system.law().pole().unwrap_or(f64::NEG_INFINITY),
            phases: phases.collect(),
        })
        .filter(|averaging| averaging.drive.modulus() > 0.0)
    }

    /// Calls `visit` with each phase, the force there and the branch, over one oscillation that
    /// begins at the far turning point.
    fn oscillate(&self, mean: f64, amplitude: f64, mut visit: impl FnMut(&Phase, f64, usize)) {
        let law = self.system.law();
        let mut branch = law.branch_at(mean + amplitude, 0.0);
        for phase in &self.phases {
            let gap = mean + amplitude * phase.cos;
            let rate = -amplitude * self.frequency * phase.sin;
            branch = if law.remembers() {
                self.next_branch(branch, gap, rate)
            } else {
                law.branch_at(gap, rate)
            };
            visit(
                phase,
                self.table.force(self.system, branch, gap, rate),
                branch,
            );
        }
    }

    /// Returns the branch at this gap and rate after the branch `branch`.
    fn next_branch(&self, mut branch: usize, gap: f64, rate: f64) -> usize {
        let law = self.system.law();
        for _ in 0..law.branches() {
            let left = self.system.exits(branch).iter().find(|exit| {
                let guard = match exit.guard {
                    Guard::Falls(level) => gap - level,
                    Guard::Rises(level) => level - gap,
                    Guard::Turns => -rate,
                    Guard::Own(index) => law.guard(index, gap, rate).value,
                };
                guard < 0.0
            });
            let Some(exit) = left else { break };
            branch = exit.target;
        }
        branch
    }

    fn average(&self, mean: f64, amplitude: f64) -> Average {
        let mut out = Average::default();
        self.oscillate(mean, amplitude, |phase, force, _| {
            let part = phase.weight * force;
            out.mean += part;
            out.first += Complex::new(2.0 * part * phase.cos, -2.0 * part * phase.sin);
        });
        out
    }

    /// Averages the force, with the derivative of its mean by the mean gap.
    fn average_with_slope(&self, mean: f64, amplitude: f64, step: f64) -> Average {
        let mut here = self.average(mean, amplitude);
        here.slope = (self.average(mean + step, amplitude).mean - here.mean) / step;
        here
    }

    /// Returns the mean gap at this amplitude, near a guess; NaN if it diverges.
    fn mean_gap(&self, amplitude: f64, guess: f64, size: f64) -> (f64, Average) {
        let rest = self.system.gap_constant;
        // The least gap stays in front of a pole.
        let least = self.pole + amplitude;
        let mut mean = guess.max(least + FROM_POLE * size);
        let mut average = Average::default();
        for _ in 0..MAX_ITERATIONS {
            average = self.average_with_slope(mean, amplitude, 1e-6 * size);
            let excess = mean - rest - self.compliance * average.mean;
            let slope = (1.0 - self.compliance * average.slope).max(0.05);
            let change = (-excess / slope).clamp(-0.02 * size, 0.02 * size);
            if !change.is_finite() {
                break;
            }
            mean = if mean + change > least {
                mean + change
            } else {
                0.5 * (mean + least)
            };
            if (mean - rest).abs() > MAX_SHIFT * size {
                mean = f64::NAN;
                break;
            }
            if change.abs() < 1e-7 * size {
                break;
            }
        }
        (mean, average)
    }

    /// Returns the amplitude that this motion requires of the drive minus that of the drive.
    fn residual(&self, amplitude: f64, average: &Average) -> f64 {
        (amplitude - self.receptance * average.first).modulus() - self.drive.modulus()
    }

    /// Returns the motion with this mean gap and amplitude, with its state at phase 0.
    fn motion(&self, mean: f64, amplitude: f64) -> Option<AveragedMotion> {
        if mean - amplitude <= self.pole {
            return None;
        }
        let average = self.average(mean, amplitude);
        // The residual may also change sign where the force jumps.
        if self.residual(amplitude, &average).abs() > MAX_RESIDUAL * self.drive.modulus() {
            return None;
        }
        let shift = self.drive / (amplitude - self.receptance * average.first);
        let shift = shift / shift.modulus();
        // Harmonics of the force in θ.
        let mut harmonics = [Complex::new(0.0, 0.0); HARMONICS + 1];
        let own = shift.argument();
        let angle = if own < 0.0 { own + TAU } else { own };
        let mut branch = None;
        self.oscillate(mean, amplitude, |phase, force, at| {
            let turn = Complex::new(phase.cos, -phase.sin);
            let mut power = Complex::new(1.0, 0.0);
            for (n, harmonic) in harmonics.iter_mut().enumerate() {
                let factor = if n == 0 { 1.0 } else { 2.0 };
                *harmonic += power * (factor * phase.weight * force);
                power *= turn;
            }
            if phase.angle <= angle || branch.is_none() {
                branch = Some(at);
            }
        });
        let mut modal = DVector::zeros(self.system.dimension());
        let mut power = Complex::new(1.0, 0.0);
        for (n, harmonic) in harmonics.iter().enumerate() {
            let Ok(unit) = response(self.system, n as f64 * self.frequency) else {
                continue;
            };
            modal += unit.map(|z| (z * harmonic * power).re);
            power *= shift;
        }
        self.finish(modal.as_slice(), branch?, amplitude)
    }

    fn finish(&self, modal: &[f64], branch: usize, amplitude: f64) -> Option<AveragedMotion> {
        let mut state = vec![0.0; modal.len()];
        self.system.to_state(0.0, modal, &mut state);
        let finite = state.iter().all(|x| x.is_finite());
        finite.then_some(AveragedMotion {
            state,
            branch,
            amplitude,
        })
    }

    /// Returns the size of gaps and amplitudes, in the unit of the gap.
    fn size(&self) -> f64 {
        self.drive.modulus().max(self.system.gap_constant.abs())
    }
}

/// Computes the modal response to a unit force at a frequency.
fn response(system: &System, frequency: f64) -> Result<DVector<Complex>, VolterraError> {
    let source = system.kernel().source.iter();
    let source = source.map(|b| Complex::new(*b, 0.0)).collect();
    system
        .kernel()
        .modes()
        .response(frequency, &DVector::from_vec(source))
}

/// Computes motions of `system` by averaging, in order of increasing amplitude: the roots in the
/// amplitude, with the mean gap followed from each of `rests`, gaps at which the lever can rest.
pub fn motions(system: &System, rests: &[f64]) -> Vec<AveragedMotion> {
    let Some(averaging) = Averaging::new(system) else {
        return Vec::new();
    };
    let size = averaging.size();
    let largest = 1.6 * averaging.drive.modulus() + 0.6 * system.gap_constant.abs();
    let mut found = Vec::new();
    for &rest in rests {
        let mut before: Option<(f64, f64, f64)> = None;
        for k in 1..=AMPLITUDES {
            let amplitude = largest * k as f64 / AMPLITUDES as f64;
            let guess = before.map_or(rest, |(_, mean, _)| mean);
            let (mean, average) = averaging.mean_gap(amplitude, guess, size);
            let residual = averaging.residual(amplitude, &average);
            if let Some((low, mean_low, at_low)) = before
                && residual * at_low < 0.0
            {
                let (mut low, mut high, mut near) = (low, amplitude, mean_low);
                for _ in 0..BISECTIONS {
                    let middle = 0.5 * (low + high);
                    let (mean, average) = averaging.mean_gap(middle, near, size);
                    near = mean;
                    if averaging.residual(middle, &average) * at_low > 0.0 {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                found.extend(averaging.motion(near, 0.5 * (low + high)));
            }
            let known = residual.is_finite() && mean.is_finite();
            before = known.then_some((amplitude, mean, residual));
        }
    }
    found.sort_by(|a, b| a.amplitude.total_cmp(&b.amplitude));
    found.dedup_by(|a, b| {
        let pairs = a.state.iter().zip(&b.state);
        let scale = b.state.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        a.branch == b.branch
            && pairs.fold(0.0, |m: f64, (x, y)| m.max((x - y).abs())) < 1e-6 * scale
    });
    found
}

/// Computes the linear response to the drive about a rest of the lever at `gap` on a branch of the
/// law.
pub fn about_rest(system: &System, branch: usize, gap: f64) -> Option<AveragedMotion> {
    let averaging = Averaging::new(system)?;
    let force = system.law().force(branch, gap, 0.0);
    let unit = response(system, 0.0).ok()?;
    let mut modal = unit.map(|z| z.re * force.value);
    for (tone, drive) in system.drive().tones.iter().zip(&system.gap_tones) {
        let unit = response(system, tone.frequency).ok()?;
        let slope = Complex::new(force.by_gap, tone.frequency * force.by_rate);
        let swing = drive / (1.0 - system.kernel().read(&unit) * slope);
        modal += unit.map(|z| (z * slope * swing).re);
    }
    averaging.finish(modal.as_slice(), branch, 0.0)
}
