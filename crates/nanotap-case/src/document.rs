//! A case as a document: every parameter, with its physical quantity in SI.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use schemars::JsonSchema;
use serde::{Serialize, Serializer};
use serde_json::{Map, Value};

use crate::Case;
use crate::physical::Physical;
use crate::physical::force::SampleForce;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::nonlinear::Equilibrium;
use nanotap_model::oscillator::{Oscillator, OscillatorParameter, Stop};
use nanotap_model::parameter::Parameter;

/// A checked case as a document.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum CaseDocument {
    /// A cantilever: `kind`, the case's keys, `period` and, of a physical case, `physical`.
    Cantilever(Box<CantileverDocument>),
    /// An oscillator: `kind`, the keys of its case file, `period`.
    Oscillator(OscillatorDocument),
    /// A cantilever whose distance is left to a setpoint that was not solved for: `kind`, `modes` and
    /// `physical` without what depends on the distance.
    WithoutDistance(Box<WithoutDistanceDocument>),
}

/// The case of a cantilever whose distance is left to a setpoint that was not solved for.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct WithoutDistanceDocument {
    /// The word `cantilever`.
    pub kind: &'static str,
    /// Number of modes.
    pub modes: usize,
    /// Quantities in SI, without those that depend on the distance.
    pub physical: Option<PhysicalSummary>,
}

impl WithoutDistanceDocument {
    /// The document of a cantilever without its distance.
    pub fn of(case: &Case) -> Self {
        Self {
            kind: "cantilever",
            modes: case.cantilever().map_or(0, |cantilever| cantilever.modes),
            physical: case.physical().map(PhysicalSummary::without_distance),
        }
    }
}

/// The case of a cantilever as a document.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct CantileverDocument {
    /// The word `cantilever`.
    pub kind: &'static str,
    /// Number of modes, dimensionless parameters and contact law, as keys of the document.
    #[serde(flatten)]
    #[schemars(with = "Map<String, Value>")]
    pub case: Cantilever,
    /// Period of the drive in model units: 2π/Ω, or with several tones the time after which all
    /// repeat.
    pub period: f64,
    /// Rest positions of the undriven lever over an attractive sample.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub equilibria: Vec<Equilibrium>,
    /// Quantities in SI, for a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<PhysicalSummary>,
}

/// The physical quantities of a case in SI, frequencies in Hz.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct PhysicalSummary {
    /// Spring constant at the tip, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub k: f64,
    /// First resonance, with the tip, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub f0: f64,
    /// Quality factor of the first free resonance, dimensionless.
    #[serde(rename = "Q")]
    pub quality_factor: f64,
    /// Mass of the beam, kg: of a lever whose modes were measured that of the uniform beam with its k
    /// and f0.
    #[schemars(extend("x-unit" = "kg"))]
    pub beam_mass: f64,
    /// Measured modes of the lever, if it is not a beam.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mode: Vec<LeverModeDocument>,
    /// Mass of the tip, kg.
    #[schemars(extend("x-unit" = "kg"))]
    pub tip_mass: f64,
    /// Amplitude of the base, m, or of the force on the lever, N.
    pub drive_amplitude: f64,
    /// Frequency of the first tone of the drive, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub drive_frequency: f64,
    /// Free amplitude of the tip, m.
    #[schemars(extend("x-unit" = "m"))]
    pub free_amplitude: f64,
    /// Phase lag of the free deflection, degrees.
    #[schemars(extend("x-unit" = "degree"))]
    pub free_phase_degrees: f64,
    /// Quantity to which phases refer, such as "displacement of the clamped end".
    pub phase_reference: &'static str,
    /// Free amplitude of the second tone, m, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m"))]
    pub second_free_amplitude: Option<f64>,
    /// Frequency of the second tone, Hz, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "Hz"))]
    pub second_frequency: Option<f64>,
    /// Amplitude of the second tone, m or N, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_amplitude: Option<f64>,
    /// Free amplitude of the third tone, m, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m"))]
    pub third_free_amplitude: Option<f64>,
    /// Frequency of the third tone, Hz, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "Hz"))]
    pub third_frequency: Option<f64>,
    /// Amplitude of the third tone, m or N, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub third_amplitude: Option<f64>,
    /// Setpoint amplitude as a fraction of the free amplitude; `None` without such a setpoint.
    pub setpoint: Option<f64>,
    /// Contact stiffness K₁ of the sample, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub contact_stiffness: f64,
    /// Contact damping C₁ of the sample, N s/m.
    #[schemars(extend("x-unit" = "N s/m"))]
    pub contact_damping: f64,
    /// Further quantities of the contact law by parameter, in SI.
    #[serde(flatten, serialize_with = "as_map")]
    #[schemars(with = "BTreeMap<String, f64>")]
    pub contact_law: Vec<(Parameter, f64)>,
    /// Parameters of a nonlinear force law, in place of contact stiffness and damping.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub force_law: Vec<LawParameterDocument>,
    /// Tabor's parameter of an elastic sphere with adhesion, dimensionless.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tabor_parameter: Option<f64>,
    /// Dynamic moduli of a sample that relaxes, at the drive frequency.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dynamic_modulus: Option<DynamicModulus>,
    /// Times and moduli of a relaxing sample's arms, s and Pa.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub arms: Vec<(f64, f64)>,
    /// Gaps and forces of a tabulated law, m and N.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub force_table: Vec<(f64, f64)>,
    /// Gap of the tip, m; `None` while the distance is left to a setpoint.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m"))]
    pub tip_gap: Option<f64>,
    /// Gap of the beam, m; `None` while the distance is left to a setpoint.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m"))]
    pub beam_gap: Option<f64>,
    /// The model's unit of length, m; `None` while the distance is left to a setpoint.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m"))]
    pub length_unit: Option<f64>,
    /// The model's unit of time, s.
    #[schemars(extend("x-unit" = "s"))]
    pub time_unit: f64,
    /// The model's unit of force, N; `None` while the distance is left to a setpoint.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "N"))]
    pub force_unit: Option<f64>,
    /// The model's unit of energy, J; `None` while the distance is left to a setpoint.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "J"))]
    pub energy_unit: Option<f64>,
}

/// A measured mode of a lever, as the case states it.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct LeverModeDocument {
    /// Undamped frequency of the free mode, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub f: f64,
    /// Stiffness at the tip, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub k: f64,
    /// Quality factor of the free mode, dimensionless.
    #[serde(rename = "Q")]
    pub quality_factor: f64,
    /// Participation in the motion of the base, stated or that of the uniform beam, dimensionless.
    pub participation: f64,
}

impl LeverModeDocument {
    /// The measured modes of a physical case; none for a beam.
    fn all(view: &Physical) -> Vec<Self> {
        let modes = view.lever_modes().iter().enumerate();
        modes
            .map(|(j, mode)| Self {
                f: mode.frequency,
                k: mode.stiffness,
                quality_factor: mode.quality,
                participation: mode.participation_of(j + 1).unwrap_or(f64::NAN),
            })
            .collect()
    }
}

/// Young's modulus of a sample that relaxes under a small oscillation at the drive frequency.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct DynamicModulus {
    /// Storage modulus E' at the drive frequency, Pa.
    #[schemars(extend("x-unit" = "Pa"))]
    pub storage_modulus: f64,
    /// Loss modulus E'' at the drive frequency, Pa.
    #[schemars(extend("x-unit" = "Pa"))]
    pub loss_modulus: f64,
    /// Loss tangent tan δ = E''/E', dimensionless.
    pub loss_tangent: f64,
}

/// A parameter of a nonlinear force law.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct LawParameterDocument {
    /// Path of the key that states the parameter.
    pub key: &'static str,
    /// Description of the parameter in words.
    pub what: &'static str,
    /// Value of the parameter in the unit `unit`; `None` for the infinite modulus of a rigid tip.
    pub value: Option<f64>,
    /// SI unit of `value`.
    pub unit: &'static str,
}

impl PhysicalSummary {
    /// The quantities of a physical case.
    pub fn of(view: &Physical) -> Self {
        let Physical {
            lever,
            parameters,
            scales,
            cantilever,
            ..
        } = view;
        let quantity = |parameter| parameters.get(parameter);
        let [second, third] = [0, 1].map(|k| {
            let ratio = cantilever.further_tones.get(k)?;
            let strength = quantity(Parameter::TONES[k][0]);
            let frequency = ratio.value() * quantity(Parameter::Omega);
            Some((frequency, strength, *view.further_free_amplitudes.get(k)?))
        });
        Self {
            k: lever.k,
            f0: lever.f0,
            quality_factor: lever.quality_factor,
            beam_mass: lever.beam_mass,
            mode: LeverModeDocument::all(view),
            tip_mass: quantity(Parameter::Alpha1),
            drive_amplitude: quantity(Parameter::Alpha2),
            drive_frequency: quantity(Parameter::Omega),
            free_amplitude: view.free_amplitude,
            free_phase_degrees: view.free_phase,
            phase_reference: view.phase_reference(),
            second_free_amplitude: second.map(|(_, _, free)| free),
            second_frequency: second.map(|(frequency, _, _)| frequency),
            second_amplitude: second.map(|(_, strength, _)| strength),
            third_free_amplitude: third.map(|(_, _, free)| free),
            third_frequency: third.map(|(frequency, _, _)| frequency),
            third_amplitude: third.map(|(_, strength, _)| strength),
            setpoint: view.setpoint,
            contact_stiffness: quantity(Parameter::Alpha4),
            contact_damping: quantity(Parameter::Alpha6),
            contact_law: cantilever
                .written_law_numbers()
                .map(|parameter| (parameter, quantity(parameter)))
                .collect(),
            force_law: view.sample.force.as_ref().map_or_else(Vec::new, |force| {
                let rows = force.parameters();
                rows.map(|(parameter, key, value)| LawParameterDocument {
                    key: key.path(),
                    what: parameter.words,
                    value: value.is_finite().then_some(value),
                    unit: key.kind().si_unit(),
                })
                .collect()
            }),
            tabor_parameter: view
                .sample
                .force
                .as_ref()
                .and_then(SampleForce::tabor_parameter),
            dynamic_modulus: view
                .sample
                .force
                .as_ref()
                .and_then(|force| force.dynamic_modulus(quantity(Parameter::Omega)))
                .map(|[storage, loss]| DynamicModulus {
                    storage_modulus: storage,
                    loss_modulus: loss,
                    loss_tangent: loss / storage,
                }),
            arms: view
                .sample
                .force
                .as_ref()
                .and_then(|force| force.arms.as_ref())
                .map_or_else(Vec::new, |arms| arms.arms().points().to_vec()),
            force_table: view
                .sample
                .force
                .as_ref()
                .and_then(|force| force.table.as_ref())
                .map_or_else(Vec::new, |table| table.rows().points().to_vec()),
            tip_gap: Some(quantity(Parameter::Alpha5)),
            beam_gap: Some(scales.length),
            length_unit: Some(scales.length),
            time_unit: scales.time,
            force_unit: Some(scales.force),
            energy_unit: Some(scales.energy),
        }
    }

    /// The quantities of a physical case that do not depend on a distance that is left to a setpoint.
    pub fn without_distance(view: &Physical) -> Self {
        Self {
            tip_gap: None,
            beam_gap: None,
            length_unit: None,
            force_unit: None,
            energy_unit: None,
            ..Self::of(view)
        }
    }
}

/// An oscillator, its keys those of the case file.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct OscillatorDocument {
    /// Kind of the stop: `vibro_impact` for a soft one, `impact` for a rigid one.
    pub kind: &'static str,
    /// Parameters of the oscillator by their names in the case file, in model units.
    #[serde(flatten)]
    pub values: BTreeMap<&'static str, f64>,
    /// Period of the drive, 2π/ω, in model units.
    pub period: f64,
}

impl OscillatorDocument {
    fn of(given: &Oscillator) -> Self {
        Self {
            kind: match given.stop {
                Stop::Soft { .. } => "vibro_impact",
                Stop::Rigid { .. } => "impact",
            },
            values: OscillatorParameter::ALL
                .into_iter()
                .filter_map(|parameter| Some((parameter.name(), given.get(parameter)?)))
                .collect(),
            period: TAU / given.omega,
        }
    }
}

impl CaseDocument {
    /// The document of a case.
    pub fn of(case: &Case) -> Self {
        match case.oscillator() {
            Some(oscillator) => Self::Oscillator(OscillatorDocument::of(oscillator)),
            None => Self::Cantilever(Box::new(CantileverDocument::of(case))),
        }
    }

    /// The document of a case for a result that does not depend on the distance: without it while it is
    /// left to a setpoint.
    pub fn at_any_distance(case: &Case) -> Self {
        if case.leaves_distance_to_setpoint() {
            Self::WithoutDistance(Box::new(WithoutDistanceDocument::of(case)))
        } else {
            Self::of(case)
        }
    }
}

impl CantileverDocument {
    fn of(case: &Case) -> Self {
        // Physical quantities made sense when the case was read.
        let cantilever = case.cantilever().cloned();
        let cantilever = cantilever.unwrap_or_else(Cantilever::paper);
        Self {
            kind: "cantilever",
            period: cantilever.period(),
            equilibria: equilibria(case),
            case: cantilever,
            physical: case.physical().map(PhysicalSummary::of),
        }
    }
}

/// Numbers as a map from their parameters' names.
fn as_map<S: Serializer>(numbers: &[(Parameter, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(numbers.iter().copied())
}

/// The equilibria of a case whose sample attracts: one with a nonlinear force law, or with an
/// attractive surface.
pub fn equilibria(case: &Case) -> Vec<Equilibrium> {
    let attracts = |case: &Cantilever| case.law.is_some() || case.has_attractive_surface();
    if !case.cantilever().is_some_and(attracts) {
        return Vec::new();
    }
    let model = case.model();
    model.map_or_else(|_| Vec::new(), |model| model.equilibria())
}
