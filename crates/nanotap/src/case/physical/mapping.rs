//! Physical quantities ↔ α1 … α6 and Ω, Eqs. (5) and (7) of the paper.
//!
//! Every parameter is a physical quantity divided by a unit that lever and beam gap fix:
//! length g₀, time T = √(mL⁴/EI) = √(3mL/k), mass mL. The others follow, since
//! EI/L³ = k/3 = mL/T²: force g₀k/3, energy g₀²k/3, stiffness k/3, damping mL/T.

use serde::Serialize;

use super::lever::Lever;
use crate::case::quantity::Kind;
use crate::model::cantilever::Cantilever;
use crate::model::contact::moving_surface::MovingSurface;
use crate::model::drive_form::Actuation;
use crate::model::higher_modes::HigherModes;
use crate::model::parameter::Parameter;

/// The SI value of the model's unit of each kind.
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
    /// The units for a lever whose beam stands `beam_gap` (g₀, in m) above the sample.
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

    /// SI value of 1 of a dimensionless parameter: of α5 in m, of α2 and a second tone in m
    /// or N as the drive acts, of Ω in Hz, of the relaxation time in s, of an angle in rad.
    pub fn of(&self, parameter: Parameter, actuation: Actuation) -> f64 {
        match parameter {
            Parameter::Alpha1 => self.mass,
            Parameter::Alpha2 | Parameter::Tone2Amplitude => match actuation {
                Actuation::Base => self.length,
                Actuation::Tip | Actuation::Distributed => self.force,
            },
            Parameter::Alpha5 => self.length,
            Parameter::Tone2Phase => 1_f64.to_radians(),
            Parameter::Mode2Quality | Parameter::Mode3Quality => 1.0,
            Parameter::Alpha3 | Parameter::Alpha6 | Parameter::SurfaceDamping => self.damping,
            Parameter::Alpha4
            | Parameter::RelaxationStiffness
            | Parameter::SurfaceStiffness
            | Parameter::Mode2Stiffness
            | Parameter::Mode3Stiffness => self.stiffness,
            Parameter::AdhesionForce => self.force,
            Parameter::Omega | Parameter::Mode2Frequency | Parameter::Mode3Frequency => {
                self.frequency
            }
            Parameter::RelaxationTime => self.time,
        }
    }
}

/// The parameters as physical quantities; SI units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PhysicalParameters {
    /// Mass of the tip M, in kg: α1.
    pub tip_mass: f64,
    /// Amplitude of the base f, in m, or of the force on the lever, in N: α2.
    pub drive_amplitude: f64,
    /// Damping of the whole beam CL, in N s/m: α3.
    pub beam_damping: f64,
    /// Contact stiffness K₁, in N/m: α4.
    pub contact_stiffness: f64,
    /// Gap of the tip g₁, in m: α5.
    pub tip_gap: f64,
    /// Contact damping C₁, in N s/m: α6.
    pub contact_damping: f64,
    /// Frequency of the drive, in Hz: Ω.
    pub drive_frequency: f64,
    /// Stiffness of a standard linear solid's relaxing arm, in N/m; 0 of other samples.
    pub relaxation_stiffness: f64,
    /// Its relaxation time, in s.
    pub relaxation_time: f64,
    /// What a moving surface has of its own, in N/m, N s/m and N.
    #[serde(flatten)]
    pub surface: MovingSurface,
    /// Amplitude of the second tone, in m or N; 0 without one.
    pub tone2_amplitude: f64,
    /// Its phase in rad.
    pub tone2_phase: f64,
    /// What was measured of the second and third mode, in Hz and N/m; 0 where nothing was.
    #[serde(flatten)]
    pub higher_modes: HigherModes,
}

impl PhysicalParameters {
    /// What a dimensionless case means under these units.
    pub fn from_case(case: &Cantilever, scales: &Scales) -> Self {
        let value = |parameter| case.get(parameter) * scales.of(parameter, case.actuation);
        Self {
            tip_mass: value(Parameter::Alpha1),
            drive_amplitude: value(Parameter::Alpha2),
            beam_damping: value(Parameter::Alpha3),
            contact_stiffness: value(Parameter::Alpha4),
            tip_gap: value(Parameter::Alpha5),
            contact_damping: value(Parameter::Alpha6),
            drive_frequency: value(Parameter::Omega),
            relaxation_stiffness: value(Parameter::RelaxationStiffness),
            relaxation_time: value(Parameter::RelaxationTime),
            surface: MovingSurface {
                stiffness: value(Parameter::SurfaceStiffness),
                damping: value(Parameter::SurfaceDamping),
                adhesion: value(Parameter::AdhesionForce),
            },
            tone2_amplitude: value(Parameter::Tone2Amplitude),
            tone2_phase: value(Parameter::Tone2Phase),
            higher_modes: HigherModes {
                frequency: [Parameter::Mode2Frequency, Parameter::Mode3Frequency].map(value),
                quality: [Parameter::Mode2Quality, Parameter::Mode3Quality].map(value),
                stiffness: [Parameter::Mode2Stiffness, Parameter::Mode3Stiffness].map(value),
            },
        }
    }

    /// The dimensionless case, not validated: `like` says what is no quantity (modes, contact
    /// law, way of driving, ratio of the tones).
    pub fn to_case(&self, scales: &Scales, like: &Cantilever) -> Cantilever {
        Parameter::every().fold(like.clone(), |case, parameter| {
            let unit = scales.of(parameter, like.actuation);
            case.with(parameter, self.get(parameter) / unit)
        })
    }

    /// The quantity that becomes a dimensionless parameter.
    pub fn get(&self, parameter: Parameter) -> f64 {
        match parameter {
            Parameter::Alpha1 => self.tip_mass,
            Parameter::Alpha2 => self.drive_amplitude,
            Parameter::Alpha3 => self.beam_damping,
            Parameter::Alpha4 => self.contact_stiffness,
            Parameter::Alpha5 => self.tip_gap,
            Parameter::Alpha6 => self.contact_damping,
            Parameter::Omega => self.drive_frequency,
            Parameter::RelaxationStiffness => self.relaxation_stiffness,
            Parameter::RelaxationTime => self.relaxation_time,
            Parameter::SurfaceStiffness => self.surface.stiffness,
            Parameter::SurfaceDamping => self.surface.damping,
            Parameter::AdhesionForce => self.surface.adhesion,
            Parameter::Tone2Amplitude => self.tone2_amplitude,
            Parameter::Tone2Phase => self.tone2_phase,
            Parameter::Mode2Frequency => self.higher_modes.frequency[0],
            Parameter::Mode3Frequency => self.higher_modes.frequency[1],
            Parameter::Mode2Quality => self.higher_modes.quality[0],
            Parameter::Mode3Quality => self.higher_modes.quality[1],
            Parameter::Mode2Stiffness => self.higher_modes.stiffness[0],
            Parameter::Mode3Stiffness => self.higher_modes.stiffness[1],
        }
    }
}

/// One line of the mapping between physics and model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MappingRow {
    /// The dimensionless parameter.
    pub parameter: Parameter,
    /// Its value.
    pub value: f64,
    /// What it is made of, e.g. "K1 L^3/(EI) = 3 K1/k".
    pub formula: &'static str,
    /// The physical quantity's name.
    pub quantity: &'static str,
    /// What it measures.
    pub kind: Kind,
    /// Its value in SI (a frequency in Hz).
    pub si: f64,
}

/// All parameters that the case has with their physical quantities, α1 first.
pub fn mapping_table(case: &Cantilever, scales: &Scales) -> Vec<MappingRow> {
    let physical = PhysicalParameters::from_case(case, scales);
    case.parameters()
        .into_iter()
        .map(|parameter| {
            let (formula, quantity, kind) = description(parameter, case.actuation);
            MappingRow {
                parameter,
                value: case.get(parameter),
                formula,
                quantity,
                kind,
                si: physical.get(parameter),
            }
        })
        .collect()
}

const fn description(
    parameter: Parameter,
    actuation: Actuation,
) -> (&'static str, &'static str, Kind) {
    let by_force = !matches!(actuation, Actuation::Base);
    match parameter {
        Parameter::Alpha1 => ("M/(mL)", "tip mass M", Kind::Mass),
        Parameter::Alpha2 if by_force => (
            "F L^3/(EI g0) = 3 F/(k g0)",
            "amplitude of the drive's force F",
            Kind::Force,
        ),
        Parameter::Alpha2 => ("f/g0", "base amplitude f", Kind::Length),
        Parameter::Tone2Amplitude if by_force => (
            "F2 L^3/(EI g0) = 3 F2/(k g0)",
            "force of the second tone F2",
            Kind::Force,
        ),
        Parameter::Tone2Amplitude => ("f2/g0", "base amplitude of the second tone", Kind::Length),
        Parameter::Tone2Phase => ("degrees", "phase of the second tone", Kind::Angle),
        Parameter::Alpha3 => (
            "C sqrt(L^4/(m EI)) = (C L) T/(m L)",
            "damping of the whole beam C L",
            Kind::Damping,
        ),
        Parameter::Alpha4 => (
            "K1 L^3/(EI) = 3 K1/k",
            "contact stiffness K1",
            Kind::Stiffness,
        ),
        Parameter::Alpha5 => ("g1/g0", "tip gap g1", Kind::Length),
        Parameter::Alpha6 => (
            "(C1/L) sqrt(L^4/(m EI)) = C1 T/(m L)",
            "contact damping C1",
            Kind::Damping,
        ),
        Parameter::Omega => (
            "omega sqrt(m L^4/(EI)) = 2 pi f T",
            "drive frequency",
            Kind::Frequency,
        ),
        Parameter::RelaxationStiffness => (
            "km L^3/(EI) = 3 km/k",
            "stiffness of the relaxing arm km",
            Kind::Stiffness,
        ),
        Parameter::RelaxationTime => ("time/T", "relaxation time of the arm", Kind::Time),
        Parameter::SurfaceStiffness => (
            "ks L^3/(EI) = 3 ks/k",
            "the surface's own stiffness ks",
            Kind::Stiffness,
        ),
        Parameter::SurfaceDamping => (
            "(etas/L) sqrt(L^4/(m EI)) = etas T/(m L)",
            "the surface's own damping etas",
            Kind::Damping,
        ),
        Parameter::AdhesionForce => (
            "F L^3/(EI g0) = 3 F/(k g0)",
            "adhesion force F",
            Kind::Force,
        ),
        Parameter::Mode2Frequency => ("2 pi f2 T", "frequency of the second mode", Kind::Frequency),
        Parameter::Mode3Frequency => ("2 pi f3 T", "frequency of the third mode", Kind::Frequency),
        Parameter::Mode2Quality => ("Q2", "quality factor of the second mode", Kind::Number),
        Parameter::Mode3Quality => ("Q3", "quality factor of the third mode", Kind::Number),
        Parameter::Mode2Stiffness => (
            "k2 L^3/(EI) = 3 k2/k",
            "stiffness of the second mode",
            Kind::Stiffness,
        ),
        Parameter::Mode3Stiffness => (
            "k3 L^3/(EI) = 3 k3/k",
            "stiffness of the third mode",
            Kind::Stiffness,
        ),
    }
}
