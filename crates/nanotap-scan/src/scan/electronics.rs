//! The instrument's electronics: lock-in amplifier, controller and scanner, one drive period at a time.

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::Complex;

use super::feedback::{Controller, LockIn, Scanner};
use super::instrument::{Interaction, Period};
use super::options::Mode;
use super::plan::Plan;
use super::tapping_period::PeriodSignals;

/// What reads the lever and moves the scanner, with its state.
#[derive(Clone, Debug)]
pub(super) struct Electronics<'a> {
    plan: &'a Plan,
    lock_in: LockIn,
    controller: Controller,
    scanner: Scanner,
    /// Amplitude of a force at the drive's frequency that alone moves the lever by the free
    /// amplitude.
    free_force: f64,
}

/// Place of a drive period above the surface, in m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub(super) x: f64,
    /// Height of the surface.
    pub(super) surface: f64,
    /// Index of the material.
    pub(super) material: usize,
}

impl<'a> Electronics<'a> {
    /// The electronics at the start of a scan, when the lock-in amplifier reads the complex amplitude
    /// `signal`, in the model's units.
    pub(super) fn new(plan: &'a Plan, signal: Complex, free_force: f64) -> Self {
        let signal = signal * plan.length_unit;
        Self {
            plan,
            lock_in: LockIn::new(plan.lock_in_part(), plan.lock_in.1, signal),
            controller: Controller::new(plan.gains, plan.z0),
            scanner: Scanner::new(plan.z_scanner, plan.period, plan.z0),
            free_force,
        }
    }

    /// Height that the feedback asks for in the next period, m.
    pub(super) const fn height(&self) -> f64 {
        match self.plan.mode {
            Mode::ConstantAmplitude => self.controller.command(),
            Mode::ConstantHeight => self.plan.z0,
        }
    }

    /// Periods whose command was limited by the range of z.
    pub(super) const fn at_range(&self) -> usize {
        self.controller.at_range
    }

    /// Runs one period: `lever` gives its signals at a distance, both in the model's units.
    ///
    /// # Errors
    /// Those of `lever`.
    pub(super) fn run_period<E>(
        &mut self,
        spot: Spot,
        lever: impl FnOnce(f64) -> Result<PeriodSignals, E>,
    ) -> Result<Period, E> {
        let plan = self.plan;
        let feeds_back = plan.mode == Mode::ConstantAmplitude;
        let z = if feeds_back {
            self.scanner.follow(self.controller.command())
        } else {
            plan.z0
        };
        let signals = lever((z - spot.surface) / plan.length_unit)?;
        let deflection = signals.deflection * plan.length_unit;
        let lock_in = self.lock_in.update(deflection);
        let amplitude = lock_in.modulus();
        let error = amplitude - plan.setpoint * plan.free_amplitude;
        if feeds_back {
            self.controller.update(plan.amplified(amplitude, error));
        }
        Ok(Period {
            x: spot.x,
            material: spot.material,
            surface: spot.surface,
            z,
            deflection,
            lock_in,
            error,
            peak_force: signals.peak_force * plan.force_unit,
            mean_deflection: signals.mean_deflection * plan.length_unit,
            contact: signals.contact,
            dissipation: signals.dissipation * plan.energy_unit,
            interaction: Interaction::of(&signals, self.free_force),
        })
    }
}
