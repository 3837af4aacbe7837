//! Physical quantities ↔ α1 … α6 and Ω, Eqs. (5) and (7) of the paper.
//!
//! Every parameter is a physical quantity divided by a unit that lever and beam gap fix:
//! length g₀, time T = √(mL⁴/EI) = √(3mL/k), mass mL. The others follow, since
//! EI/L³ = k/3 = mL/T²: force g₀k/3, energy g₀²k/3, stiffness k/3, damping mL/T.

use serde::Serialize;

use super::lever::Lever;
use crate::key::kind_of;
use crate::quantity::Kind;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::drive_form::Actuation;
use nanotap_model::parameter::{Numbers, Parameter, Unit};

/// SI values of the model's units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Scales {
    /// Deflections and gaps: g₀ in m.
    pub length: f64,
    /// Time τ: T in s.
    pub time: f64,
    /// Tip mass: mL in kg.
    pub mass: f64,
    /// Contact stiffness: EI/L³ = k/3 in N/m.
    pub stiffness: f64,
    /// Contact damping, and the beam's in all: mL/T in N s/m.
    pub damping: f64,
    /// Velocity: g₀/T in m/s.
    pub velocity: f64,
    /// Force at the tip: g₀k/3 in N.
    pub force: f64,
    /// Energy: g₀²k/3 in J.
    pub energy: f64,
    /// Power: energy over time in W.
    pub power: f64,
    /// Frequency in Hz of Ω = 1: 1/(2πT).
    pub frequency: f64,
    /// Slope dw/dx of dW/dξ = 1: g₀/L, if the length is known.
    pub slope: Option<f64>,
}

impl Scales {
    /// Computes the units for a lever whose beam is `beam_gap` (g₀, in m) above the sample.
    pub fn new(lever: &Lever, beam_gap: f64) -> Self {
        let time = lever.time_unit();
        let stiffness = lever.k / 3.0;
        let force = stiffness * beam_gap;
        let energy = force * beam_gap;
        Self {
            length: beam_gap,
            time,
            mass: lever.beam_mass,
            stiffness,
            damping: lever.beam_mass / time,
            velocity: beam_gap / time,
            force,
            energy,
            power: energy / time,
            frequency: (std::f64::consts::TAU * time).recip(),
            slope: lever.length.map(|length| beam_gap / length),
        }
    }

    /// SI value of the model's unit of a kind of result: powers of force, length and time, and 1 for
    /// a kind without a dimension. A frequency counts the cycles of Ω. `None` for a slope if the
    /// lever's length is unknown.
    pub fn si(&self, kind: Kind) -> Option<f64> {
        if kind == Kind::Slope {
            return self.slope;
        }
        let time = match kind {
            Kind::Frequency => std::f64::consts::TAU * self.time,
            _ => self.time,
        };
        let [forces, lengths, times] = kind.dimension().of_force();
        let unit = self.force.powi(forces) * self.length.powi(lengths);
        Some(match times {
            0.. => unit * time.powi(times),
            _ => unit / time.powi(-times),
        })
    }

    /// SI value of 1 of a dimensionless parameter: of α5 in m, of α2 and a second tone in m
    /// or N as the drive acts, of Ω in Hz, of the relaxation time in s, of an angle in rad.
    pub fn of(&self, parameter: Parameter, actuation: Actuation) -> f64 {
        match parameter.entry().unit {
            Unit::Number => 1.0,
            Unit::Mass => self.mass,
            Unit::Length => self.length,
            Unit::Time => self.time,
            Unit::Frequency => self.frequency,
            Unit::Stiffness => self.stiffness,
            Unit::Damping => self.damping,
            Unit::Force => self.force,
            Unit::Drive => match actuation {
                Actuation::Base => self.length,
                Actuation::Tip | Actuation::Distributed => self.force,
            },
            Unit::Degrees => 1_f64.to_radians(),
        }
    }

    /// The physical quantities behind a dimensionless case, in SI, by parameter.
    pub fn quantities(&self, case: &Cantilever) -> Numbers {
        Parameter::every().fold(Numbers::ZERO, |quantities, parameter| {
            let unit = self.of(parameter, case.actuation);
            quantities.with(parameter, case.get(parameter) * unit)
        })
    }

    /// Returns the dimensionless case of these quantities in SI, not validated. Modes, contact law,
    /// actuation and ratios of the tones are those of `like`.
    pub fn case(&self, quantities: &Numbers, like: &Cantilever) -> Cantilever {
        Parameter::every().fold(like.clone(), |case, parameter| {
            let unit = self.of(parameter, like.actuation);
            case.with(parameter, quantities.get(parameter) / unit)
        })
    }
}

/// One line of the mapping between physics and model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MappingRow {
    /// Dimensionless parameter of the model.
    pub parameter: Parameter,
    /// Value of the parameter, dimensionless.
    pub value: f64,
    /// Formula, such as "K1 L^3/(EI) = 3 K1/k".
    pub formula: &'static str,
    /// Name of the physical quantity in words.
    pub quantity: &'static str,
    /// Kind of the physical quantity, which determines its SI unit.
    pub kind: Kind,
    /// Value of the physical quantity in SI; a frequency in Hz.
    pub si: f64,
}

/// All parameters that the case has with their physical quantities, α1 first.
pub fn mapping_table(case: &Cantilever, scales: &Scales) -> Vec<MappingRow> {
    let physical = scales.quantities(case);
    let row = |parameter: Parameter| {
        let entry = parameter.entry();
        let by_force = entry.by_force.filter(|_| case.actuation != Actuation::Base);
        let (formula, quantity) = by_force.unwrap_or((entry.formula, entry.quantity));
        MappingRow {
            parameter,
            value: case.get(parameter),
            formula,
            quantity,
            kind: kind_of(entry.unit, case.actuation),
            si: physical.get(parameter),
        }
    };
    case.parameters().into_iter().map(row).collect()
}
