//! The table of observables: name, dimension, description, and how each follows from the
//! [measurements](super::measure). JSON, CSV, datasets, figures, the terminal and Python read this
//! table; a new observable is one entry.
//!
//! # Phase
//! Phases are lags of the tip deflection behind the drive sin Ωτ (for a driven base: behind the
//! displacement of the base), 90° at the free resonance of a lever with high Q. Data contain them
//! in (−180°, 180°]. In tapping mode phases are read from 0° to 180°, and a lever driven through
//! its base lags by slightly more than 180° far above resonance. Text and figures therefore show
//! them in (−90°, 270°], where the response of a tapping lever never jumps: see [`shown_phase`].

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Serialize, Serializer, ser::SerializeMap};
use serde_json::Map;

use super::functional::{Signal, Tone};
use super::measured::Measured;
use super::number::{Number as _, Phasor};
use super::value::{Measurable, Value, Varying};
use super::{Dimension, EnergyBalance};
use nanotap_case::physical::Scales;
use nanotap_model::contact::dual::Dual;

use Signal::{Height, Slope, Tip};

/// An observable: an entry of the table.
#[derive(Debug)]
pub struct Observable {
    /// Name in JSON, CSV headers, datasets, at the terminal and in Python.
    pub name: &'static str,
    /// Name among quantities in SI, if experimenters use another one.
    pub si_name: &'static str,
    /// Head of tables that are read, of a fraction in percent; None: the SI name.
    pub head: Option<&'static str>,
    /// Dimension of the value, from which its units follow.
    pub dimension: Dimension,
    /// Short description and symbol (between `$`): the label of an axis.
    pub label: &'static str,
    /// Description in a few words, without the symbol.
    pub words: &'static str,
    /// Returns its value among measured observables.
    pub of: fn(&Observables) -> Value,
    /// Whether it is a single number, as a curve needs.
    pub is_number: bool,
    /// JSON schema of the value.
    pub(super) schema: fn(&mut SchemaGenerator) -> Schema,
    row: usize,
}

impl PartialEq for Observable {
    fn eq(&self, other: &Self) -> bool {
        self.row == other.row
    }
}

impl Eq for Observable {}

impl Observable {
    /// The observable with this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        OBSERVABLES.iter().find(|o| o.name == name)
    }

    /// Label of an axis, without the unit, for a cantilever or an oscillator.
    pub fn axis_label(&self, beam: bool) -> String {
        if beam {
            return self.label.to_owned();
        }
        self.label
            .replace("tip deflection", "displacement")
            .replace("$W_", "$x_")
    }
}

/// A set of observables of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObservableSet(u64);

impl ObservableSet {
    /// The set without any observable.
    pub const NONE: Self = Self(0);

    /// The set of all observables.
    pub const ALL: Self = Self(u64::MAX >> (64 - OBSERVABLES.len()));

    /// Returns the set with the observable added.
    #[must_use]
    pub const fn with(self, observable: &Observable) -> Self {
        Self(self.0 | 1 << observable.row)
    }

    /// True if the set contains the observable.
    pub const fn contains(self, observable: &Observable) -> bool {
        self.0 >> observable.row & 1 == 1
    }

    /// The union of two sets.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The observables of the set, in the order of the table.
    pub fn iter(self) -> impl Iterator<Item = &'static Observable> {
        OBSERVABLES.iter().filter(move |o| self.contains(o))
    }
}

/// Converts a phase to the range of text and figures, (−90°, 270°].
pub fn shown_phase(degrees: f64) -> f64 {
    if degrees <= -90.0 {
        degrees + 360.0
    } else {
        degrees
    }
}

macro_rules! observables {
    ($(
        $name:ident $(as $si_name:literal)? $(headed $head:literal)?: $type:ty, $dimension:ident, $where:ident,
        $label:literal, $words:literal, $read:expr;
    )*) => {
        /// The table of all observables, in the order of output.
        pub static OBSERVABLES: &[Observable] = &[$(Observable {
            name: stringify!($name),
            si_name: observables!(@si $name $($si_name)?),
            head: observables!(@head $($head)?),
            dimension: Dimension::$dimension,
            label: $label,
            words: $words,
            of: |o| o.$name.value(),
            is_number: <$type as Measurable>::IS_NUMBER,
            schema: <$type as JsonSchema>::json_schema,
            row: Row::$name as usize,
        }),*];

        /// Row numbers of the observables in the table.
        #[allow(non_camel_case_types, reason = "the observables' own names")]
        #[derive(Clone, Copy)]
        enum Row { $($name),* }

        /// Observables of a motion, in the model's units or in SI. Unrequested fields are NaN.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Observables {
            /// Observed time in drive periods.
            pub periods: f64,
            $(#[doc = $words] pub $name: $type,)*
        }

        impl Observables {
            /// Observables of an unmeasured motion: NaN or `None`, and `periods` 0.
            pub const UNKNOWN: Self = Self {
                periods: 0.0,
                $($name: <$type as Measurable>::ABSENT,)*
            };

            /// Computes the observables of `set` from the measurements.
            pub(super) fn read(set: ObservableSet, measured: &mut Measured<'_>) -> Self {
                let mut all = Self { periods: measured.periods(), ..Self::UNKNOWN };
                $(if set.contains(&OBSERVABLES[Row::$name as usize]) {
                    #[allow(clippy::redundant_closure_call)] // the table writes closures
                    { all.$name = ($read as fn(&mut Measured<'_>) -> $type)(measured); }
                })*
                all
            }

            /// Derivatives of the observables of `set`, from `measured`; discontinuous ones are
            /// left out.
            pub(super) fn changes(
                set: ObservableSet,
                measured: &mut Measured<'_, Dual>,
            ) -> Vec<(&'static Observable, Value)> {
                let mut all = Vec::new();
                $(
                    let observable = &OBSERVABLES[Row::$name as usize];
                    if set.contains(observable) {
                        let read = $read as fn(&mut Measured<'_, Dual>) -> _;
                        let change = change_of(measured, read);
                        if change != Value::Absent {
                            all.push((observable, change));
                        }
                    }
                )*
                all
            }

            /// Converts to SI by the units `scales` of the model; NaN where a unit is not known.
            #[must_use]
            pub fn in_si(&self, scales: &Scales) -> Self {
                Self {
                    periods: self.periods,
                    $($name: self.$name.scaled(Dimension::$dimension.si(scales)),)*
                }
            }
        }

        impl ObservableSet {
            /// The observables that sweeps, branches and curves record for every motion.
            pub const COMMON: Self = Self($(observables!(@$where $name))|*);

            /// The readings of a lock-in amplifier: amplitude and phase at the drive frequency.
            pub const FIRST_HARMONIC: Self =
                Self(1 << Row::first_harmonic as usize | 1 << Row::phase as usize);

            /// Extremes and the time in contact: what a motion has that does not repeat.
            pub const EXTREMES: Self = Self(
                1 << Row::tip_max as usize
                    | 1 << Row::tip_min as usize
                    | 1 << Row::indentation as usize
                    | 1 << Row::contact_fraction as usize
                    | 1 << Row::peak_force as usize
                    | 1 << Row::least_force as usize
                    | 1 << Row::impact_speed as usize
                    | 1 << Row::gap_range as usize,
            );

            /// The balance of the energies of the whole motion.
            pub const ENERGY_BALANCE: Self = Self(1 << Row::energy_balance as usize);

            /// Minimum and maximum of the gap.
            pub(super) const GAP: Self = Self(1 << Row::gap_range as usize);

            /// Position and time of the lowest point of the beam.
            pub(super) const CLEARANCE: Self = Self(
                1 << Row::beam_clearance as usize
                    | 1 << Row::beam_clearance_xi as usize
                    | 1 << Row::beam_clearance_period as usize,
            );
        }
    };
    (@head) => { None };
    (@head $head:literal) => { Some($head) };
    (@si $name:ident) => { stringify!($name) };
    (@si $name:ident $si_name:literal) => { $si_name };
    (@common $name:ident) => { 1 << Row::$name as usize };
    (@rare $name:ident) => { 0 };
}

observables! {
    tip_max: f64, Length, common,
        "largest tip deflection $W_{max}$", "largest tip deflection W",
        |m| m.greatest(Tip);
    tip_min: f64, Length, common,
        "smallest tip deflection $W_{min}$", "smallest tip deflection W",
        |m| m.least(Tip);
    amplitude: f64, Length, common,
        "amplitude (half of peak to peak)", "half of peak to peak of the tip deflection",
        |m| 0.5 * (m.greatest(Tip) - m.least(Tip));
    mean_deflection: f64, Length, common,
        "mean tip deflection", "time mean of the tip deflection",
        |m| m.mean_deflection();
    first_harmonic as "A": f64, Length, common,
        "amplitude $A$",
        "amplitude of the tip deflection at the drive frequency: what a lock-in amplifier reads",
        |m| m.component(Tip, Tone::First).norm();
    phase: f64, Angle, common,
        "phase lag",
        "phase lag of the tip deflection behind the drive, at the drive frequency",
        |m| m.component(Tip, Tone::First).lag();
    indentation: f64, Length, common,
        "indentation", "largest depth of the tip below the surface at rest",
        |m| m.indentation();
    mean_force: f64, Force, common,
        "mean force", "time mean of the force of the sample on the tip",
        |m| m.mean_force();
    dissipation as "E_dis": f64, Energy, common,
        "dissipation $E_{dis}$", "energy dissipated in the sample in one drive period",
        |m| m.dissipation();
    virial: f64, Energy, common,
        "virial ⟨$F W$⟩", "time mean of force times tip deflection; sign: along the deflection",
        |m| m.virial();
    contact_fraction headed "contact": f64, Number, common,
        "contact time / period", "contact time / period",
        |m| m.contact_time() / m.duration();
    contacts_per_period: f64, PerPeriod, common,
        "contacts per drive period", "contacts begun per drive period",
        |m| m.contacts().count as f64 / m.periods();
    peak_force as "F_max": f64, Force, common,
        "peak force $F_{max}$", "largest force of the sample on the tip",
        |m| m.peak_force();
    impact_speed: f64, Velocity, common,
        "impact speed", "largest speed at which a contact begins",
        |m| m.contacts().greatest_speed;
    contact_time: f64, Time, common,
        "contact time", "time in contact in one drive period",
        |m| m.contact_time() / m.periods();
    tone2_response: Option<f64>, Length, rare,
        "amplitude at the second tone",
        "amplitude of the tip deflection at the frequency of the second tone",
        |m| m.further_tone(0).map(Phasor::norm);
    tone2_lag: Option<f64>, Angle, rare,
        "phase lag at the second tone",
        "phase lag of the tip deflection behind the second tone",
        |m| m.further_tone(0).map(Phasor::lag);
    tone3_response: Option<f64>, Length, rare,
        "amplitude at the third tone",
        "amplitude of the tip deflection at the frequency of the third tone",
        |m| m.further_tone(1).map(Phasor::norm);
    tone3_lag: Option<f64>, Angle, rare,
        "phase lag at the third tone",
        "phase lag of the tip deflection behind the third tone",
        |m| m.further_tone(1).map(Phasor::lag);
    first_sideband: Option<f64>, Length, rare,
        "amplitude at $2f_1 - f_2$",
        "amplitude of the tip deflection at twice the first tone's frequency less the second's",
        |m| m.first_sideband().map(Phasor::norm);
    first_sideband_phase: Option<f64>, Angle, rare,
        "phase lag at $2f_1 - f_2$",
        "phase lag of the tip deflection there behind the product of the tones",
        |m| m.first_sideband().map(Phasor::lag);
    second_sideband: Option<f64>, Length, rare,
        "amplitude at $2f_2 - f_1$",
        "amplitude of the tip deflection at twice the second tone's frequency less the first's",
        |m| m.second_sideband().map(Phasor::norm);
    second_sideband_phase: Option<f64>, Angle, rare,
        "phase lag at $2f_2 - f_1$",
        "phase lag of the tip deflection there behind the product of the tones",
        |m| m.second_sideband().map(Phasor::lag);
    second_harmonic: f64, Length, rare,
        "amplitude of the second harmonic",
        "amplitude of the tip deflection at twice the drive frequency",
        |m| m.component(Tip, Tone::Harmonic(2)).norm();
    second_harmonic_phase: f64, Angle, rare,
        "phase of the second harmonic",
        "lag of the tip deflection at twice the drive frequency behind sin 2Ωτ",
        |m| m.component(Tip, Tone::Harmonic(2)).lag();
    third_harmonic: f64, Length, rare,
        "amplitude of the third harmonic",
        "amplitude of the tip deflection at three times the drive frequency",
        |m| m.component(Tip, Tone::Harmonic(3)).norm();
    third_harmonic_phase: f64, Angle, rare,
        "phase of the third harmonic",
        "lag of the tip deflection at three times the drive frequency behind sin 3Ωτ",
        |m| m.component(Tip, Tone::Harmonic(3)).lag();
    fourth_harmonic: f64, Length, rare,
        "amplitude of the fourth harmonic",
        "amplitude of the tip deflection at four times the drive frequency",
        |m| m.component(Tip, Tone::Harmonic(4)).norm();
    fourth_harmonic_phase: f64, Angle, rare,
        "phase of the fourth harmonic",
        "lag of the tip deflection at four times the drive frequency behind sin 4Ωτ",
        |m| m.component(Tip, Tone::Harmonic(4)).lag();
    fifth_harmonic: f64, Length, rare,
        "amplitude of the fifth harmonic",
        "amplitude of the tip deflection at five times the drive frequency",
        |m| m.component(Tip, Tone::Harmonic(5)).norm();
    fifth_harmonic_phase: f64, Angle, rare,
        "phase of the fifth harmonic",
        "lag of the tip deflection at five times the drive frequency behind sin 5Ωτ",
        |m| m.component(Tip, Tone::Harmonic(5)).lag();
    sixth_harmonic: f64, Length, rare,
        "amplitude of the sixth harmonic",
        "amplitude of the tip deflection at six times the drive frequency",
        |m| m.component(Tip, Tone::Harmonic(6)).norm();
    sixth_harmonic_phase: f64, Angle, rare,
        "phase of the sixth harmonic",
        "lag of the tip deflection at six times the drive frequency behind sin 6Ωτ",
        |m| m.component(Tip, Tone::Harmonic(6)).lag();
    rms_deflection: f64, Length, rare,
        "root mean square of the tip deflection",
        "root mean square of the tip deflection about its mean",
        |m| {
            let mean = m.mean(Tip);
            (m.mean_product(Tip, Tip) - mean * mean).at_least(0.0).root()
        };
    gap_range: [f64; 2], Length, rare,
        "gap", "smallest and largest height of the tip above the undeformed surface",
        |m| m.range(Height);
    least_force: f64, Force, rare,
        "smallest force", "smallest force of the sample on the tip; negative where it attracts",
        |m| m.least_force();
    contact_force: Option<f64>, Force, rare,
        "mean force in contact", "time mean of the force of the sample on the tip during contact",
        |m| m.mean_contact_force();
    drive_power: f64, Power, rare,
        "power of the drive", "mean power of the drive",
        |m| m.energy_balance().drive_work / m.duration();
    sample_power: f64, Power, rare,
        "power dissipated in the sample", "mean power dissipated in the sample",
        |m| m.dissipation() * m.periods() / m.duration();
    slope_range: Option<[f64; 2]>, Slope, rare,
        "slope at the tip", "smallest and largest slope at the tip",
        |m| m.is_beam().then(|| m.range(Slope));
    optical_amplitude: Option<f64>, Length, rare,
        "amplitude read by an optical lever",
        "amplitude that an optical lever, calibrated by a static force, reads at the drive frequency",
        |m| m.optical_lever().map(Phasor::norm);
    optical_phase: Option<f64>, Angle, rare,
        "phase read by an optical lever", "lag that an optical lever reads behind the drive",
        |m| m.optical_lever().map(Phasor::lag);
    tip_motion: Option<f64>, Length, rare,
        "amplitude of the tip's own motion",
        "amplitude of the tip's height at the drive frequency, of a lever whose base moves: \
         deflection and motion of the base together",
        |m| m.tip_motion().map(Phasor::norm);
    tip_motion_phase: Option<f64>, Angle, rare,
        "phase of the tip's own motion", "lag of the tip's height behind the base that moves it",
        |m| m.tip_motion().map(Phasor::lag);
    energy_balance: EnergyBalance, Energy, rare,
        "energy", "energies over the recording; the residual relative to the energy exchanged",
        |m| m.energy_balance();
    beam_clearance: Option<f64>, Length, rare,
        "beam clearance", "smallest height of the beam above the sample",
        |m| m.clearance().map(|c| c.height);
    beam_clearance_xi: Option<f64>, Place, rare,
        "position of the beam clearance $ξ$", "where the beam is lowest: 0 at the clamp, 1 at the tip",
        |m| m.clearance().map(|c| c.xi);
    beam_clearance_period: Option<f64>, Periods, rare,
        "time of the beam clearance", "when the beam is lowest",
        |m| m.clearance().map(|c| c.period);
    grazing_contacts: Option<usize>, Count, rare,
        "grazing contacts", "contacts that only graze, within rounding",
        |m| Some(m.contacts().grazing as usize);
}

fn change_of<R: Varying>(
    measured: &mut Measured<'_, Dual>,
    read: impl FnOnce(&mut Measured<'_, Dual>) -> R,
) -> Value {
    read(measured).change()
}

impl Serialize for Observables {
    /// A map from names to values, without absent ones.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for observable in OBSERVABLES {
            let value = (observable.of)(self);
            if value != Value::Absent {
                map.serialize_entry(observable.name, &value)?;
            }
        }
        map.end()
    }
}

impl Observable {
    /// JSON schema of the value, with its description and `x-unit`.
    pub(super) fn described(&self, generator: &mut SchemaGenerator, unit: &str) -> Schema {
        let mut schema = (self.schema)(generator);
        schema.insert("description".into(), self.words.into());
        schema.insert("x-unit".into(), unit.into());
        schema
    }
}

impl JsonSchema for Observables {
    fn schema_name() -> Cow<'static, str> {
        "Observables".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let entries = OBSERVABLES.iter().map(|o| {
            let schema = o.described(generator, o.dimension.model_unit());
            (o.name.to_owned(), schema.to_value())
        });
        let properties: Map<_, _> = entries.collect();
        json_schema!({
            "type": "object",
            "description": "What is observed of the motion, in the model's own units",
            "properties": properties,
        })
    }
}
