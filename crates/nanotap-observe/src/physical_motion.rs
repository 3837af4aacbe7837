//! A motion in SI units, with the names that experimenters use.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use serde_json::{Map, Value as Json, json};

use super::table::{OBSERVABLES, Observables};
use super::value::Value;
use super::{Dimension, Harmonic, Spectrum};
use nanotap_case::physical::quantity::JOULES_PER_ELECTRONVOLT;
use nanotap_case::physical::sample::{Hertz, HertzMismatch};
use nanotap_case::physical::{Physical, Scales};
use nanotap_model::parameter::Parameter;

/// Observables of a motion in SI units, angles in degrees. They are serialised under their SI
/// names, with energies in electronvolts too.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalMotion {
    /// Observables of the motion, in SI units.
    pub observables: Observables,
    /// Amplitude over the free amplitude A₀, dimensionless: the setpoint ratio of this motion.
    pub amplitude_ratio: f64,
    /// Further entries if the motion is reported alone.
    pub setting: Option<Setting>,
    /// State at drive phase 0, if it is reported: a_1 … a_N in m, their rates in m/s, then any memory of
    /// the sample in the model's units.
    pub state: Vec<f64>,
    /// States at the ends of the last periods, if they are reported, in the units of `state`.
    pub strobe: Vec<Vec<f64>>,
}

/// Entries that belong to the case, and the harmonics of the motion.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Setting {
    /// Quantity to which phases refer, in words: a displacement or a force.
    pub phase_reference: &'static str,
    /// Drive frequency, Hz; of several tones, that of the first.
    #[schemars(extend("x-unit" = "Hz"))]
    pub frequency: f64,
    /// If Hertz's stiffness was linearised at an indentation that this motion does not have.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hertz_mismatch: Option<HertzMismatch>,
    /// Harmonics of the drive frequency, for a periodic motion.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub harmonics: Vec<PhysicalHarmonic>,
}

/// One component of a periodic motion; SI units, angles in degrees.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PhysicalHarmonic {
    /// Frequency as a multiple of the drive frequency, dimensionless.
    pub order: f64,
    /// Frequency of the component, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub frequency: f64,
    /// With several tones, the numbers a, b, … of the lowest product a f₁ + b f₂ + … at this
    /// frequency.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub product: Option<Vec<i32>>,
    /// Amplitude of the tip deflection, m.
    #[schemars(extend("x-unit" = "m"))]
    pub tip: f64,
    /// Phase lag behind sin(order · ωt), degrees in (−180, 180].
    #[schemars(extend("x-unit" = "degree"))]
    pub tip_phase: f64,
    /// Amplitude of the force, N.
    #[schemars(extend("x-unit" = "N"))]
    pub force: f64,
    /// Phase lag of the force, degrees in (−180, 180].
    #[schemars(extend("x-unit" = "degree"))]
    pub force_phase: f64,
    /// Amplitude of the slope dw/dx at the tip, dimensionless, if the lever's length is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope: Option<f64>,
}

impl PhysicalMotion {
    /// Converts `observables` of a motion of the case `view` to SI.
    pub fn of(observables: &Observables, view: &Physical) -> Self {
        let observables = observables.in_si(&view.scales);
        Self {
            amplitude_ratio: observables.first_harmonic / view.free_amplitude,
            observables,
            setting: None,
            state: Vec::new(),
            strobe: Vec::new(),
        }
    }

    /// The same motion with its state at drive phase 0, which is given in the model's units.
    #[must_use]
    pub fn with_state(mut self, state: &[f64], view: &Physical) -> Self {
        self.state = state_in_si(state, view);
        self
    }

    /// The same motion with its states at the ends of the last periods, which are given in the model's
    /// units.
    #[must_use]
    pub fn with_strobe(mut self, strobe: &[Vec<f64>], view: &Physical) -> Self {
        self.strobe = strobe
            .iter()
            .map(|state| state_in_si(state, view))
            .collect();
        self
    }

    /// Converts a single motion, with its setting and, with `spectrum`, its harmonics.
    pub fn alone(observables: &Observables, spectrum: Option<&Spectrum>, view: &Physical) -> Self {
        let scales = &view.scales;
        let omega = view.cantilever.omega;
        let harmonics = spectrum.map_or(&[][..], |spectrum| &spectrum.harmonics);
        // A stiffness that was set as a number is not Hertz's.
        let own = |h: &Hertz| h.stiffness() == view.parameters.get(Parameter::Alpha4);
        let hertz = view.sample.hertz.filter(own);
        Self {
            setting: Some(Setting {
                hertz_mismatch: hertz
                    .and_then(|h| h.mismatch(observables.indentation * scales.length)),
                phase_reference: view.phase_reference(),
                frequency: omega * scales.frequency,
                harmonics: harmonics
                    .iter()
                    .map(|h| PhysicalHarmonic::of(h, omega, scales))
                    .collect(),
            }),
            ..Self::of(observables, view)
        }
    }
}

/// A state in SI, as a case and `state` options take it.
fn state_in_si(state: &[f64], view: &Physical) -> Vec<f64> {
    let modes = view.cantilever.modes.max(1);
    let unit = |k: usize| match k / modes {
        0 => view.scales.length,
        1 => view.scales.velocity,
        _ => 1.0,
    };
    let entries = state.iter().enumerate();
    entries.map(|(k, value)| unit(k) * value).collect()
}

impl Serialize for PhysicalMotion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for observable in OBSERVABLES {
            let value = (observable.of)(&self.observables);
            if value == Value::Absent {
                continue;
            }
            map.serialize_entry(observable.si_name, &value)?;
            if observable.name == "first_harmonic" {
                map.serialize_entry("A_ratio", &self.amplitude_ratio)?;
            }
            if let (Dimension::Energy, Value::Number(joules)) = (observable.dimension, value) {
                let name = format!("{}_eV", observable.si_name);
                map.serialize_entry(&name, &(joules / JOULES_PER_ELECTRONVOLT))?;
            }
        }
        if let Some(setting) = &self.setting {
            map.serialize_entry("phase_reference", setting.phase_reference)?;
            map.serialize_entry("frequency", &setting.frequency)?;
            if let Some(mismatch) = &setting.hertz_mismatch {
                map.serialize_entry("hertz_mismatch", mismatch)?;
            }
            if !setting.harmonics.is_empty() {
                map.serialize_entry("harmonics", &setting.harmonics)?;
            }
        }
        if !self.state.is_empty() {
            map.serialize_entry("state", &self.state)?;
        }
        if !self.strobe.is_empty() {
            map.serialize_entry("strobe", &self.strobe)?;
        }
        map.end()
    }
}

/// Units of the entries of a state in SI, for the schema.
const STATE_UNITS: &str = "a_1 … a_N in m, their rates in m/s, then any memory of the sample in the \
                           model's units";

impl JsonSchema for PhysicalMotion {
    fn schema_name() -> Cow<'static, str> {
        "PhysicalMotion".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut properties = Map::new();
        for observable in OBSERVABLES {
            let schema = observable.described(generator, observable.dimension.si_unit());
            properties.insert(observable.si_name.to_owned(), schema.to_value());
            if observable.is_number && observable.dimension == Dimension::Energy {
                let schema = observable.described(generator, "eV");
                let name = format!("{}_eV", observable.si_name);
                properties.insert(name, schema.to_value());
            }
        }
        let ratio = json!({"type": "number", "description": "A over the free amplitude"});
        properties.insert("A_ratio".to_owned(), ratio);
        let numbers = Vec::<f64>::json_schema(generator).to_value();
        let rows = Vec::<Vec<f64>>::json_schema(generator).to_value();
        for (name, mut schema, what) in [
            ("state", numbers, "State at drive phase 0"),
            (
                "strobe",
                rows,
                "States at the ends of the last requested periods",
            ),
        ] {
            schema["description"] = format!("{what}: {STATE_UNITS}").into();
            properties.insert(name.to_owned(), schema);
        }
        let setting = Setting::json_schema(generator).to_value();
        if let Some(Json::Object(entries)) = setting.get("properties") {
            properties.extend(entries.clone());
        }
        json_schema!({
            "type": "object",
            "description": "What an experimenter would measure of the motion, in SI",
            "properties": properties,
        })
    }
}

impl PhysicalHarmonic {
    fn of(h: &Harmonic, omega: f64, scales: &Scales) -> Self {
        Self {
            order: h.order,
            frequency: h.order * omega * scales.frequency,
            tip: h.tip * scales.length,
            product: h.product.clone(),
            tip_phase: h.tip_phase,
            force: h.force * scales.force,
            force_phase: h.force_phase,
            slope: h.slope.zip(scales.slope).map(|(s, unit)| s * unit),
        }
    }
}
