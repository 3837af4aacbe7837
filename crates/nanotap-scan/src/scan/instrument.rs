//! The instrument: lever and electronics, one drive period at a time.

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::Complex;
use serde::{Deserialize, Serialize};

use super::electronics::{Electronics, Spot};
use super::options::Method;
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

    /// The force that governs a period of a lever which `free_force` alone moves by the free
    /// amplitude.
    pub(super) fn of(signals: &PeriodSignals, free_force: f64) -> Self {
        if signals.force.modulus() < FREE * free_force {
            Self::Free
        } else {
            Self::governing(signals)
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
    levers: Levers,
    material: usize,
    state: Vec<f64>,
    electronics: Electronics<'a>,
}

impl<'a> Instrument<'a> {
    /// The instrument at the start of a scan, the lever in the motion in which it comes from far, or in its
    /// free motion at a given height.
    ///
    /// # Errors
    /// When a case has no model, or the flow fails.
    pub(super) fn new(plan: &'a Plan) -> Result<Self, Error> {
        let levers: Result<Vec<Lever>, Error> = plan.materials.iter().map(Lever::new).collect();
        let mut levers = levers?;
        let first = &mut levers[0];
        let beam = plan.start.as_deref();
        let (state, free, free_force) = (
            first.start(beam),
            first.free_deflection(),
            first.free_force(),
        );
        let gap = plan.z0 / plan.length_unit;
        let reading = match beam {
            Some(_) => first.clone().advance(&mut state.clone(), gap)?.deflection,
            None => free,
        };
        let levers = if plan.method == Method::QuasiStatic {
            let steady = levers
                .into_iter()
                .map(|lever| SteadyLever::new(lever, beam, gap, free.modulus()));
            Levers::Steady(steady.collect())
        } else {
            Levers::Moving(levers)
        };
        Ok(Self {
            levers,
            material: 0,
            state,
            electronics: Electronics::new(plan, reading, free_force),
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
    pub(super) const fn height(&self) -> f64 {
        self.electronics.height()
    }

    /// Periods whose command was limited by the range of z.
    pub(super) const fn at_range(&self) -> usize {
        self.electronics.at_range()
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
        let spot = Spot {
            x,
            surface,
            material,
        };
        let signals = |gap| match &mut self.levers {
            Levers::Moving(levers) => {
                let lever = &mut levers[material];
                if material != self.material {
                    lever.take_over(&mut self.state);
                }
                lever.advance(&mut self.state, gap)
            }
            Levers::Steady(levers) => levers[material].at(gap),
        };
        let period = self.electronics.run_period(spot, signals)?;
        self.material = material;
        Ok(period)
    }
}

/// Phase lag in degrees, in (−180, 180], of a deflection behind the drive's sine.
pub(super) fn lag(deflection: Complex) -> f64 {
    let turned = deflection * Complex::new(0.0, 1.0);
    -nanotap_arithmetic::atan2(turned.im, turned.re).to_degrees()
}
