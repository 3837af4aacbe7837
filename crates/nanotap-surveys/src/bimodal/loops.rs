//! The loops of an instrument on two tones, as equations.
//!
//! A loop holds the phase of its tone by the frequency of the drive, or its amplitude by the strength,
//! or both. Each is an equation for one unknown, and all of them hold exactly in the steady
//! state of an instrument whose controllers integrate.

use nalgebra::{DMatrix, DVector};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::Complex;

use super::torus::{Closed, Drives, Torus, close};
use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_model::cantilever::Cantilever;
use nanotap_motions::frequency_modulation::FreeOscillation;
use nanotap_observe::lag;

/// Largest number of Newton steps.
const STEPS: usize = 30;
/// Relative residual of the conditions at which Newton's method stops.
const HELD: f64 = 1e-11;
/// Relative residual that Newton's method must reach; above it the motion is rejected.
const ACCEPTED: f64 = 1e-9;

/// Shortest part of a Newton step that is tried, as a fraction of the step.
const SHORTEST: f64 = 0.1;

/// Unknown of the equations of the loops: a quantity of the drive that a loop adjusts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unknown {
    /// The frequency of a tone, by which its phase is held.
    Frequency(usize),
    /// The strength of a tone, by which its amplitude is held.
    Strength(usize),
}

impl Unknown {
    /// Relative change of the unknown for the differences of the Jacobian.
    const fn difference(self) -> f64 {
        match self {
            Self::Frequency(_) => 1e-7,
            Self::Strength(_) => 1e-5,
        }
    }

    /// Largest relative change of the unknown in a Newton step.
    const fn farthest(self) -> f64 {
        match self {
            Self::Frequency(_) => 0.02,
            Self::Strength(_) => 0.5,
        }
    }
}

/// A tone with the targets of its loop, in model units.
#[derive(Clone, Debug)]
pub(super) struct Tone {
    /// Whether the phase is held.
    pub(super) holds_phase: bool,
    /// Whether the amplitude is held.
    pub(super) holds_amplitude: bool,
    /// The free lever at the amplitude and phase of the tone.
    pub(super) free: FreeOscillation,
    /// The drive of the tone where nothing changes it: frequency and strength.
    pub(super) drive: [f64; 2],
    /// Amplitude of the free lever under that drive, model units.
    pub(super) free_amplitude: f64,
    /// Phase lag of the free lever behind that drive, degrees.
    pub(super) free_phase: f64,
}

impl Tone {
    /// Returns the larger of the two free amplitudes, model units.
    pub(super) fn size(&self) -> f64 {
        self.free_amplitude.max(self.free.amplitude)
    }
}

/// The lever with its loops.
#[derive(Clone, Debug)]
pub(super) struct Loops {
    pub(super) lever: Cantilever,
    pub(super) tones: [Tone; 2],
    /// The size of the motion: the sum of both amplitudes.
    pub(super) length: f64,
}

/// A motion that the loops hold.
#[derive(Clone, Debug)]
pub(super) struct Held {
    pub(super) closed: Closed,
    /// Components of the tip deflection at both tones.
    pub(super) tip: [Complex; 2],
    /// Factor by which a small disturbance grows in a period of the first tone at constant drives.
    pub(super) growth: f64,
    /// Jacobian of the conditions, reused for the next motion.
    slopes: Option<DMatrix<f64>>,
}

impl Held {
    pub(super) fn drives(&self) -> &Drives {
        &self.closed.drives
    }

    pub(super) fn amplitude(&self, tone: usize) -> f64 {
        self.tip[tone].modulus()
    }

    /// Returns the phase lag of a tone behind its drive, degrees.
    pub(super) fn phase(&self, tone: usize) -> f64 {
        lag(self.tip[tone])
    }
}

impl Loops {
    /// Returns the drives under which the free lever fulfils the conditions, at a distance `gap`.
    pub(super) fn free_drives(&self, gap: f64) -> Drives {
        let of = |tone: &Tone| {
            [
                if tone.holds_phase {
                    tone.free.frequency
                } else {
                    tone.drive[0]
                },
                if tone.holds_amplitude {
                    tone.free.strength
                } else {
                    tone.drive[1]
                },
            ]
        };
        let [first, second] = [&self.tones[0], &self.tones[1]].map(of);
        Drives {
            frequency: [first[0], second[0]],
            strength: [first[1], second[1]],
            gap,
        }
    }

    fn unknowns(&self) -> Vec<Unknown> {
        let mut unknowns = Vec::new();
        for (k, tone) in self.tones.iter().enumerate() {
            unknowns.extend(tone.holds_phase.then_some(Unknown::Frequency(k)));
            unknowns.extend(tone.holds_amplitude.then_some(Unknown::Strength(k)));
        }
        unknowns
    }

    /// Returns the deviations from the conditions: relative for amplitudes, rad for phases.
    fn residual(&self, unknowns: &[Unknown], held: &Held) -> DVector<f64> {
        let of = |unknown: &Unknown| match *unknown {
            Unknown::Frequency(tone) => {
                let away = held.phase(tone) - self.tones[tone].free.phase;
                (away - 360.0 * (away / 360.0).round()).to_radians()
            }
            Unknown::Strength(tone) => held.amplitude(tone) / self.tones[tone].free.amplitude - 1.0,
        };
        DVector::from_iterator(unknowns.len(), unknowns.iter().map(of))
    }

    fn at(
        &self,
        drives: Drives,
        start: &Torus,
        near: Option<&Held>,
        control: &Control<'_>,
    ) -> Result<Held, Error> {
        let near = near.map(|near| &near.closed);
        let closed = close(&self.lever, drives, start, self.length, near, control)?;
        let tip = closed.readings()?;
        Ok(Held {
            closed,
            tip,
            growth: f64::NAN,
            slopes: None,
        })
    }

    /// Finds the motion that the loops hold near a drive and a torus. `before` is a nearby motion,
    /// if one is known.
    ///
    /// # Errors
    /// When no motion near them is found.
    pub(super) fn hold(
        &self,
        start: (Drives, &Torus),
        before: Option<&Held>,
        control: &Control<'_>,
    ) -> Result<Held, Error> {
        let mut held = self.solve(start, before, control)?;
        held.growth = held.closed.growth()?;
        Ok(held)
    }

    fn solve(
        &self,
        (start, torus): (Drives, &Torus),
        before: Option<&Held>,
        control: &Control<'_>,
    ) -> Result<Held, Error> {
        let unknowns = self.unknowns();
        let mut here = self.at(start, torus, before, control)?;
        let mut residual = self.residual(&unknowns, &here);
        let mut slopes = before.and_then(|before| before.slopes.clone());
        slopes = slopes.filter(|slopes| slopes.nrows() == unknowns.len());
        for _ in 0..STEPS {
            let size = residual.amax();
            if unknowns.is_empty() || size <= HELD {
                here.slopes = slopes;
                return Ok(here);
            }
            let fresh = slopes.is_none();
            let matrix = match slopes.take() {
                Some(matrix) => matrix,
                None => self.differences(&unknowns, &here, &residual, control)?,
            };
            let step = matrix
                .clone()
                .lu()
                .solve(&-&residual)
                .ok_or_else(singular)?;
            let longest = unknowns
                .iter()
                .zip(step.iter())
                .fold(1.0, |longest: f64, (u, step)| {
                    longest.max(step.abs() / u.farthest())
                });
            let mut part = 1.0 / longest;
            let (next, left) = loop {
                let drives = Self::moved(&unknowns, here.drives(), &(&step * part));
                let next = self.at(drives, &here.closed.torus, Some(&here), control);
                let shorter = fresh && part >= SHORTEST;
                match next {
                    Ok(next) => {
                        let left = self.residual(&unknowns, &next);
                        if left.amax() < size || !shorter {
                            break (next, left);
                        }
                    }
                    Err(error) if control.is_cancelled() || !shorter => return Err(error),
                    Err(_) => {}
                }
                part *= 0.5;
            };
            if left.amax() >= size {
                if size <= ACCEPTED {
                    return Ok(here);
                }
                if fresh {
                    return Err(no_motion_near());
                }
                continue;
            }
            // Broyden's update keeps the differences good enough as long as steps gain much.
            if left.amax() <= 0.3 * size {
                let step = step * part;
                let change = &left - &residual - &matrix * &step;
                slopes = Some(&matrix + change * step.transpose() / step.norm_squared());
            }
            (here, residual) = (next, left);
        }
        if residual.amax() <= ACCEPTED {
            return Ok(here);
        }
        Err(no_motion_near())
    }

    /// Computes the Jacobian of the residual by finite differences.
    fn differences(
        &self,
        unknowns: &[Unknown],
        here: &Held,
        residual: &DVector<f64>,
        control: &Control<'_>,
    ) -> Result<DMatrix<f64>, Error> {
        let mut matrix = DMatrix::zeros(unknowns.len(), unknowns.len());
        for (column, unknown) in unknowns.iter().enumerate() {
            let mut step = DVector::zeros(unknowns.len());
            step[column] = unknown.difference();
            let drives = Self::moved(unknowns, here.drives(), &step);
            let there = self.at(drives, &here.closed.torus, Some(here), control)?;
            let change = self.residual(unknowns, &there) - residual;
            matrix.set_column(column, &(change / step[column]));
        }
        Ok(matrix)
    }

    /// Returns the drives after relative changes of the unknowns.
    fn moved(unknowns: &[Unknown], drives: &Drives, step: &DVector<f64>) -> Drives {
        let mut moved = *drives;
        for (unknown, step) in unknowns.iter().zip(step.iter()) {
            match *unknown {
                Unknown::Frequency(tone) => moved.frequency[tone] *= 1.0 + step,
                Unknown::Strength(tone) => moved.strength[tone] *= 1.0 + step,
            }
        }
        moved
    }
}

fn no_motion_near() -> Error {
    Error::numerics("no motion near has the amplitudes and phases that the loops hold")
}

fn singular() -> Error {
    Error::numerics("the equations of the loops are singular: the motion turns back here")
}
