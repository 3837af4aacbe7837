//! The instrument: lever, lock-in amplifier, controller and scanner, one drive period at a time.

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::Complex;
use serde::{Deserialize, Serialize};

use super::feedback::{Controller, LockIn, Scanner};
use super::options::{Method, Mode};
use super::plan::Plan;
use super::quasi_static::SteadyLever;
use super::tapping_period::{Lever, PeriodSignals};
use nanotap_error::Error;

/// Force that governs the motion of a drive period.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Interaction {
    /// The force hardly changes the motion
    Free,
    /// The component of the force in phase with the deflection attracts
    Attractive,
    /// The component of the force in phase with the deflection repels
    Repulsive,
    /// The motion differs from period to period
    Irregular,
}

impl Interaction {
    /// The force that governs a period: whether its component in phase with the deflection attracts.
    pub(super) fn governing(signals: &PeriodSignals) -> Self {
        if (signals.force * signals.deflection.conj()).re > 0.0 {
            Self::Attractive
        } else {
            Self::Repulsive
        }
    }
}

/// One drive period of a scan, in SI.
#[derive(Clone, Copy, Debug)]
pub(super) struct Period {
    pub(super) x: f64,
    pub(super) material: usize,
    pub(super) surface: f64,
    pub(super) z: f64,
    pub(super) deflection: Complex,
    pub(super) lock_in: Complex,
    pub(super) error: f64,
    pub(super) peak_force: f64,
    pub(super) mean_deflection: f64,
    pub(super) contact: f64,
    pub(super) dissipation: f64,
    pub(super) interaction: Interaction,
}

/// Part of the force that stops the lever below which a force does not count.
const FREE: f64 = 0.02;

/// The lever above every material, by a method.
#[derive(Clone, Debug)]
enum Levers {
    Moving(Vec<Lever>),
    Steady(Vec<SteadyLever>),
}

/// An instrument with its state.
#[derive(Clone, Debug)]
pub(super) struct Instrument<'a> {
    plan: &'a Plan,
    levers: Levers,
    material: usize,
    state: Vec<f64>,
    lock_in: LockIn,
    controller: Controller,
    scanner: Scanner,
    /// Amplitude of a force at the drive's frequency that alone moves the lever by the free
    /// amplitude.
    free_force: f64,
}

impl<'a> Instrument<'a> {
    /// The instrument at the start of a scan, the lever in its free motion.
    ///
    /// # Errors
    /// When a case has no model.
    pub(super) fn new(plan: &'a Plan) -> Result<Self, Error> {
        let levers: Result<Vec<Lever>, Error> = plan.materials.iter().map(Lever::new).collect();
        let mut levers = levers?;
        let first = &mut levers[0];
        let (state, free, free_force) = (
            first.free_start(),
            first.free_deflection(),
            first.free_force(),
        );
        let signal = free * plan.length_unit;
        let gap = plan.z0 / plan.length_unit;
        let levers = if plan.method == Method::QuasiStatic {
            let steady = levers
                .into_iter()
                .map(|lever| SteadyLever::new(lever, gap, free.modulus()));
            Levers::Steady(steady.collect())
        } else {
            Levers::Moving(levers)
        };
        Ok(Self {
            plan,
            levers,
            material: 0,
            state,
            lock_in: LockIn::new(plan.lock_in_part(), plan.lock_in.1, signal),
            controller: Controller::new(plan.gains, plan.z0),
            scanner: Scanner::new(plan.z_scanner, plan.period, plan.z0),
            free_force,
        })
    }

    /// A copy of the lever above a material.
    pub(super) fn lever_above(&self, material: usize) -> Lever {
        match &self.levers {
            Levers::Moving(levers) => levers[material].clone(),
            Levers::Steady(levers) => levers[material].lever(),
        }
    }

    /// The lever's state after the last period, in the model's units.
    pub(super) fn lever_state(&self) -> &[f64] {
        match &self.levers {
            Levers::Moving(_) => &self.state,
            Levers::Steady(levers) => levers[self.material].state(),
        }
    }

    /// Index of the material of the last period.
    pub(super) const fn material(&self) -> usize {
        self.material
    }

    /// Height that the feedback asks for in the next period, m.
    pub(super) fn height(&self) -> f64 {
        match self.plan.mode {
            Mode::ConstantAmplitude => self.controller.command(),
            Mode::ConstantHeight => self.plan.z0,
        }
    }

    /// Periods whose command was limited by the range of z.
    pub(super) const fn at_range(&self) -> usize {
        self.controller.at_range
    }

    /// Runs one period above a surface of this height and material.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn run_period(
        &mut self,
        x: f64,
        surface: f64,
        material: usize,
    ) -> Result<Period, Error> {
        let plan = self.plan;
        let feeds_back = plan.mode == Mode::ConstantAmplitude;
        let z = if feeds_back {
            self.scanner.follow(self.controller.command())
        } else {
            plan.z0
        };
        let gap = (z - surface) / plan.length_unit;
        let signals = match &mut self.levers {
            Levers::Moving(levers) => {
                let lever = &mut levers[material];
                if material != self.material {
                    lever.take_over(&mut self.state);
                }
                lever.advance(&mut self.state, gap)?
            }
            Levers::Steady(levers) => levers[material].at(gap)?,
        };
        self.material = material;
        let deflection = signals.deflection * plan.length_unit;
        let lock_in = self.lock_in.update(deflection);
        let amplitude = lock_in.modulus();
        let error = amplitude - plan.setpoint * plan.free_amplitude;
        if feeds_back {
            self.controller.update(plan.amplified(amplitude, error));
        }
        let interaction = if signals.force.modulus() < FREE * self.free_force {
            Interaction::Free
        } else {
            Interaction::governing(&signals)
        };
        Ok(Period {
            x,
            material,
            surface,
            z,
            deflection,
            lock_in,
            error,
            peak_force: signals.peak_force * plan.force_unit,
            mean_deflection: signals.mean_deflection * plan.length_unit,
            contact: signals.contact,
            dissipation: signals.dissipation * plan.energy_unit,
            interaction,
        })
    }
}

/// Phase lag in degrees, in (−180, 180], of a deflection behind the drive's sine.
pub(super) fn lag(deflection: Complex) -> f64 {
    let turned = deflection * Complex::new(0.0, 1.0);
    -nanotap_arithmetic::atan2(turned.im, turned.re).to_degrees()
}
