//! The keys of a case, each declared once: names, type, allowed values, default, meaning. Parsing,
//! messages, sweeps and branches, units, `nanotap case`, Python's keyword arguments, the JSON
//! schema and the explorer's controls read this table.
//!
//! Keys of a cantilever's numbers come from the table of
//! [parameters](nanotap_model::parameter), keys of a contact law from the law's file; a line here
//! gives such a key its place among the others and its name in this crate, and without one it is
//! listed last. A new physical quantity is an entry here, and the line of the mapping that reads it.

use std::sync::LazyLock;

use nanotap_volterra::laws::entry::{self, CaseKey, KeyEntry, ParameterEntry};
use nanotap_volterra::laws::{
    self, adhesion, capillary, electric, hysteresis, lennard_jones, pair, prony, solvation, table,
    viscous,
};

use super::{
    Alternatives, Default, Entry, Key, Laws, Means, ModelKind, Range, Section, Takes, kind_of,
};
use crate::DEFAULT_MODES;
use crate::quantity::Kind;
use nanotap_model::beam::MAX_MODES;
use nanotap_model::cantilever::CosineTerm;
use nanotap_model::contact::{ContactLaw, OWN_KEYS};
use nanotap_model::drive_form::{Actuation, Hold};
use nanotap_model::oscillator::OscillatorParameter as Of;
use nanotap_model::parameter::{Parameter, SampleKey};

const CANTILEVER: &[ModelKind] = &[ModelKind::Cantilever];
const SOFT: &[ModelKind] = &[ModelKind::VibroImpact];
const RIGID: &[ModelKind] = &[ModelKind::Impact];
const OSCILLATORS: &[ModelKind] = &[ModelKind::VibroImpact, ModelKind::Impact];

const PLAIN: Entry = Entry {
    section: Section::Model,
    name: "",
    alias: None,
    symbol: "",
    label: "",
    takes: Takes::Quantity(Kind::Number),
    range: Range::ANY,
    default: Default::None,
    example: 1.0,
    models: &[],
    means: Means::Nothing,
    feeds: None,
    laws: Laws::All,
    meaning: "",
};

/// The key of a parameter of the cantilever.
fn number(parameter: Parameter) -> Entry {
    let entry = parameter.entry();
    Entry {
        name: entry.name,
        alias: entry.alias,
        symbol: entry.symbol,
        default: match entry.default {
            None => Default::None,
            Some(value) => Default::Number(value),
        },
        example: entry.example,
        models: CANTILEVER,
        means: Means::Cantilever(parameter),
        meaning: entry.meaning,
        ..PLAIN
    }
}

/// The key of `[sample]` for a number that belongs to one contact law.
fn of_law(parameter: Parameter) -> Option<Entry> {
    let entry = parameter.entry();
    let Some(SampleKey::Own {
        meaning,
        zero,
        example,
    }) = entry.stated_by
    else {
        return None;
    };
    let range = if zero { R::NOT_NEGATIVE } else { R::POSITIVE };
    let kind = kind_of(entry.unit, Actuation::Base);
    Some(
        quantity(Sample, entry.name, kind, range, meaning)
            .feeds(parameter)
            .under(Laws::Some)
            .such_as(example),
    )
}

/// The key of a contact law alone.
pub(super) const fn of_laws(key: &KeyEntry) -> Entry {
    Entry {
        alias: key.alias,
        label: key.label,
        range: match key.range {
            entry::Range::Positive | entry::Range::PositiveOrInfinite => R::POSITIVE,
            entry::Range::NotNegative => R::NOT_NEGATIVE,
            entry::Range::Poisson => POISSON,
            entry::Range::Angle => FLANK,
            entry::Range::Finite => R::ANY,
        },
        default: match key.default {
            None => Default::None,
            Some(value) => Default::Number(value),
        },
        example: key.example,
        laws: Laws::Nonlinear,
        ..quantity(
            if key.of_tip { Tip } else { Sample },
            key.name,
            key.kind,
            R::ANY,
            key.meaning,
        )
    }
}

/// The key that states a parameter of contact laws. It is evaluated while compiling, so that a
/// parameter that has no key does not compile.
const fn of_parameter(parameter: &ParameterEntry) -> Entry {
    match parameter.key {
        CaseKey::Own(key) => of_laws(&key),
        CaseKey::Body(_) => panic!("tip or sample have this key without the law"),
    }
}

/// A parameter of an oscillator.
const fn oscillator(
    parameter: Of,
    symbol: &'static str,
    models: &'static [ModelKind],
    meaning: &'static str,
) -> Entry {
    Entry {
        name: parameter.name(),
        symbol,
        models,
        means: Means::Oscillator(parameter),
        meaning,
        ..PLAIN
    }
}

/// A key of `[model]` whose value is one of `words`; the first one is the default.
const fn word(
    name: &'static str,
    words: &'static [&'static str],
    models: &'static [ModelKind],
    meaning: &'static str,
) -> Entry {
    Entry {
        name,
        takes: Takes::Word(words),
        default: Default::Word(words[0]),
        models,
        meaning,
        ..PLAIN
    }
}

/// A key of a physical case whose value is a quantity of this kind.
const fn quantity(
    section: Section,
    name: &'static str,
    kind: Kind,
    range: Range,
    meaning: &'static str,
) -> Entry {
    Entry {
        section,
        name,
        takes: Takes::Quantity(kind),
        range,
        meaning,
        ..PLAIN
    }
}

/// An entry of a physical case that is not a quantity.
const fn other(section: Section, name: &'static str, takes: Takes, meaning: &'static str) -> Entry {
    Entry {
        section,
        name,
        takes,
        meaning,
        ..PLAIN
    }
}

impl Entry {
    const fn or(self, value: f64) -> Self {
        Self {
            default: Default::Number(value),
            ..self
        }
    }

    const fn such_as(self, example: f64) -> Self {
        Self { example, ..self }
    }

    const fn alias(self, alias: &'static str) -> Self {
        Self {
            alias: Some(alias),
            ..self
        }
    }

    const fn label(self, label: &'static str) -> Self {
        Self { label, ..self }
    }

    const fn feeds(self, parameter: Parameter) -> Self {
        Self {
            feeds: Some(parameter),
            ..self
        }
    }

    const fn under(self, laws: Laws) -> Self {
        Self { laws, ..self }
    }
}

const POISSON: Range = Range {
    low: -1.0,
    high: 0.5,
    above: true,
    below: false,
    reason: "Poisson's ratio of a stable solid lies above -1 and not above 0.5",
};

const FLANK: Range = Range {
    low: 0.0,
    high: std::f64::consts::FRAC_PI_2,
    reason: "it must lie between 0 and 90 deg",
    ..Range::ANY
};

const HALF_TURN: Range = Range {
    low: -std::f64::consts::PI,
    high: std::f64::consts::PI,
    above: false,
    below: false,
    reason: "it must lie between -180 and 180 deg; a number without a unit is in radians",
};

const RELATIVE_ERROR: Range = Range {
    low: 0.0,
    high: 1.0,
    above: false,
    below: true,
    reason: "a relative standard error lies from 0 to below 1",
};

/// The words of a list of variants, in order.
macro_rules! words {
    ($kind:ty) => {{
        const WORDS: [&str; <$kind>::ALL.len()] = {
            let mut words = [""; <$kind>::ALL.len()];
            let mut k = 0;
            while k < words.len() {
                words[k] = <$kind>::ALL[k].name();
                k += 1;
            }
            words
        };
        &WORDS
    }};
}

macro_rules! keys {
    ($($group:ident from $first:expr => { $($key:ident = $entry:expr;)* })*) => {
        #[expect(non_upper_case_globals, reason = "named as the variants of an enum")]
        #[expect(missing_docs, reason = "each entry has a meaning")]
        impl Key {
            $($(pub const $key: Self = Self(($first + $group::$key as usize) as u16);)*)*
        }
        $(
            enum $group { $($key),* }
            impl $group {
                const ENTRIES: &[Entry] = &[$($entry),*];
            }
        )*
    };
}

#[expect(non_upper_case_globals, reason = "named as the variants of an enum")]
#[expect(missing_docs, reason = "each parameter has a meaning")]
impl Key {
    pub const Alpha1: Self = Self::of(Parameter::Alpha1);
    pub const Alpha2: Self = Self::of(Parameter::Alpha2);
    pub const Alpha3: Self = Self::of(Parameter::Alpha3);
    pub const Alpha4: Self = Self::of(Parameter::Alpha4);
    pub const Alpha5: Self = Self::of(Parameter::Alpha5);
    pub const Alpha6: Self = Self::of(Parameter::Alpha6);
    pub const Omega: Self = Self::of(Parameter::Omega);
}

/// Index of the first key after those of contact laws.
const AFTER_LAWS: usize = Parameter::COUNT + Before::ENTRIES.len() + OWN_KEYS;

pub(super) static TABLE: LazyLock<Vec<Entry>> = LazyLock::new(|| {
    let numbers = Parameter::every().map(number);
    let before = numbers.chain(Before::ENTRIES.iter().copied());
    let linear = before.chain(Parameter::every().filter_map(of_law));
    let mut table: Vec<Entry> = linear.chain(After::ENTRIES.iter().copied()).collect();
    // The other keys of contact laws, which are not named in this file.
    for key in laws::all().flat_map(|law| law.entry.keys()) {
        let entry = of_laws(&key);
        let is_new = |old: &Entry| (old.section, old.name) != (entry.section, entry.name);
        if table.iter().all(is_new) {
            table.push(entry);
        }
    }
    table
});

use Range as R;
use Section::{Cantilever, Drive, Gap, Sample, Tip};

keys! {
Before from Parameter::COUNT => {
    Mass = oscillator(Of::Mass, "m", OSCILLATORS, "mass").or(1.0);
    Stiffness = oscillator(Of::Stiffness, "k", OSCILLATORS, "spring");
    Damping = oscillator(Of::Damping, "c", OSCILLATORS, "damper").such_as(0.0);
    Forcing = oscillator(Of::Forcing, "F", OSCILLATORS, "amplitude of the force F cos ωt");
    OscillatorOmega = oscillator(Of::Omega, "ω", OSCILLATORS, "frequency of the force").such_as(2.5);
    OscillatorGap = oscillator(Of::Gap, "gap", OSCILLATORS, "position of the stop; contact at x ≥ gap")
        .such_as(0.0);
    StopStiffness = oscillator(Of::ContactStiffness, "k₁", SOFT, "spring of the stop").such_as(20.0);
    StopDamping = oscillator(Of::ContactDamping, "c₁", SOFT, "damper of the stop").such_as(0.2);
    Restitution = oscillator(Of::Restitution, "r", RIGID, "speed after an impact over speed before")
        .such_as(0.8);

    Kind = word("kind", words!(ModelKind), &ModelKind::ALL, "what is modelled");
    Modes = Entry {
        name: "modes",
        symbol: "N",
        takes: Takes::Count(MAX_MODES),
        default: Default::Number(DEFAULT_MODES as f64),
        example: DEFAULT_MODES as f64,
        models: CANTILEVER,
        meaning: "number of beam modes",
        ..PLAIN
    };
    CosineTerm = word("cosine_term", words!(CosineTerm), CANTILEVER, "which form of Eq. (14) drives the beam");
    Contact = word("contact", words!(ContactLaw), CANTILEVER, "how the sample answers the tip");
    Actuation = word("actuation", words!(Actuation), CANTILEVER, "where the drive acts");
    Tone2Ratio = Entry {
        name: "tone2_ratio",
        takes: Takes::FrequencyRatio,
        models: CANTILEVER,
        meaning: "frequency of the second tone over omega",
        ..PLAIN
    };
    Tone3Ratio = Entry {
        name: "tone3_ratio",
        takes: Takes::FrequencyRatio,
        models: CANTILEVER,
        meaning: "frequency of the third tone over omega",
        ..PLAIN
    };

    RelaxationArms = Entry {
        name: "relaxation_arms",
        takes: Takes::ModelArms,
        models: CANTILEVER,
        meaning: "relaxing arms of contact = \"generalised-maxwell\": rows of time and stiffness, measured as relaxation_time and relaxation_stiffness",
        ..PLAIN
    };

    ModelLeverModes = Entry {
        name: "lever_modes",
        takes: Takes::ModelLeverModes,
        models: CANTILEVER,
        meaning: "measured modes of the lever in place of the uniform beam's: frequency, as omega, stiffness at the tip k·L³/(EI), and quality factor (0: as beam_damping has it) of each, and its participation in the motion of the base",
        ..PLAIN
    };

    LeverModes = other(Cantilever, "mode", Takes::LeverModes, "measured modes of the lever in place of a beam: a table with f, k at the tip, Q and, if it is known, participation in the motion of the base for each");
    LeverName = other(Cantilever, "lever", Takes::LeverName, "a lever of the catalogue, whose values hold where none are given");
    LeverK = quantity(Cantilever, "k", Kind::Stiffness, R::POSITIVE, "static spring constant at the tip, 3EI/L³")
        .label("spring constant $k$");
    LeverK1 = quantity(Cantilever, "k1", Kind::Stiffness, R::POSITIVE, "stiffness of the first mode at the tip, as thermal tunes and point-mass models give it: 1.0302 k without a tip's mass");
    LeverF0 = quantity(Cantilever, "f0", Kind::Frequency, R::POSITIVE, "first free resonance, with the tip")
        .label("resonance frequency $f_0$");
    LeverF2 = quantity(Cantilever, "f2", Kind::Frequency, R::POSITIVE, "second free resonance: the frequency of the second mode, from which the tip's mass follows where neither that nor k2 is given")
        .feeds(Parameter::Mode2Frequency);
    LeverF3 = quantity(Cantilever, "f3", Kind::Frequency, R::POSITIVE, "third free resonance")
        .feeds(Parameter::Mode3Frequency);
    LeverQ = quantity(Cantilever, "Q", Kind::Number, R::POSITIVE, "quality factor of the first free resonance")
        .feeds(Parameter::Alpha3)
        .label("quality factor $Q$");
    LeverQ2 = quantity(Cantilever, "Q2", Kind::Number, R::POSITIVE, "quality factor of the second free resonance")
        .feeds(Parameter::Mode2Quality);
    LeverQ3 = quantity(Cantilever, "Q3", Kind::Number, R::POSITIVE, "quality factor of the third free resonance")
        .feeds(Parameter::Mode3Quality);
    LeverK2 = quantity(Cantilever, "k2", Kind::Stiffness, R::POSITIVE, "stiffness of the second mode at the tip")
        .feeds(Parameter::Mode2Stiffness);
    LeverK3 = quantity(Cantilever, "k3", Kind::Stiffness, R::POSITIVE, "stiffness of the third mode at the tip")
        .feeds(Parameter::Mode3Stiffness);
    FluidDensity = quantity(Cantilever, "fluid_density", Kind::Density, R::POSITIVE, "density of the fluid around a rectangular lever, with fluid_viscosity in place of Q; a given f0 is then that in vacuum")
        .feeds(Parameter::Alpha3);
    FluidViscosity = quantity(Cantilever, "fluid_viscosity", Kind::Viscosity, R::POSITIVE, "viscosity of the fluid around the lever")
        .feeds(Parameter::Alpha3);
    LeverHeight = quantity(Cantilever, "height", Kind::Length, R::POSITIVE, "height of the lever over the surface, which adds mass and damping by the fluid between, with fluid_density and fluid_viscosity; at least 0.025 of the width")
        .feeds(Parameter::Alpha3);
    LeverLength = quantity(Cantilever, "length", Kind::Length, R::POSITIVE, "length of the beam");
    LeverWidth = quantity(Cantilever, "width", Kind::Length, R::POSITIVE, "width of the beam");
    LeverThickness = quantity(Cantilever, "thickness", Kind::Length, R::POSITIVE, "thickness in the direction of bending");
    LeverModulus = quantity(Cantilever, "modulus", Kind::Pressure, R::POSITIVE, "Young's modulus along the beam");
    LeverDensity = quantity(Cantilever, "density", Kind::Density, R::POSITIVE, "density of the beam");
    LeverKError = quantity(Cantilever, "k_error", Kind::Number, RELATIVE_ERROR, "relative standard error of k, as in \"4 %\": fits carry it into standard errors and intervals")
        .such_as(0.04);

    TipMass = quantity(Tip, "mass", Kind::Mass, R::NOT_NEGATIVE, "mass of the tip").feeds(Parameter::Alpha1);
    TipMassRatio = quantity(Tip, "mass_ratio", Kind::Number, R::NOT_NEGATIVE, "mass of the tip over that of the beam")
        .feeds(Parameter::Alpha1);
    TipShape = other(Tip, "shape", Takes::Word(&["cone", "pyramid", "sphere"]), "a solid tip, whose mass follows from its density")
        .feeds(Parameter::Alpha1);
    TipHeight = quantity(Tip, "height", Kind::Length, R::POSITIVE, "height of the tip, which separates beam and sample when the tip touches");
    TipHalfAngle = quantity(Tip, "half_angle", Kind::Angle, FLANK, "angle between the tip's axis and its flank")
        .such_as(0.35);
    TipDensity = quantity(Tip, "density", Kind::Density, R::POSITIVE, "density of the tip");
    TipRadius = quantity(Tip, "radius", Kind::Length, R::POSITIVE, "radius of curvature of the apex")
        .label("tip radius $R$")
        .such_as(1e-8);
    TipMaterial = other(Tip, "material", Takes::MaterialName, "a material of the catalogue");
    TipModulus = quantity(Tip, "modulus", Kind::Pressure, R::POSITIVE, "Young's modulus of the tip")
        .such_as(1.7e11);
    TipPoisson = quantity(Tip, "poisson", Kind::Number, POISSON, "Poisson's ratio of the tip")
        .such_as(0.28);

    TipCharge = of_parameter(&electric::TIP_CHARGE);

    SampleLaw = other(
        Sample, "law", Takes::Law,
        "how the sample answers the tip: a linear contact, or nonlinear force laws, one or a sum with +",
    );
    SampleTable = other(
        Sample, "table", Takes::Table,
        "force curve of sample.law = \"table\": rows of gap, force and, if there is one, damping, or a CSV file of them",
    ).under(Laws::Nonlinear);
    SampleGapFactor = of_parameter(&table::GAP_FACTOR);
    SampleForceFactor = of_parameter(&table::FORCE_FACTOR);
    SampleDampingFactor = of_parameter(&table::DAMPING_FACTOR);
    SampleInterpolation = other(
        Sample, "interpolation", Takes::Word(&["linear", "monotone", "natural"]),
        "curve between a table's rows: straight lines (default), a cubic spline that stays between them, or a natural cubic spline",
    ).under(Laws::Nonlinear);
    SampleMaterial = other(Sample, "material", Takes::MaterialName, "a material of the catalogue").under(Laws::Some);
    SampleStiffness = quantity(Sample, "stiffness", Kind::Stiffness, R::NOT_NEGATIVE, "contact stiffness K1")
        .feeds(Parameter::Alpha4).under(Laws::Some)
        .label("sample stiffness")
        .such_as(10.0);
    SampleDamping = quantity(Sample, "damping", Kind::Damping, R::NOT_NEGATIVE, "contact damping C1")
        .feeds(Parameter::Alpha6).under(Laws::Some)
        .such_as(1e-7);
    SampleLossTangent = quantity(Sample, "loss_tangent", Kind::Number, R::NOT_NEGATIVE, "C1 ω/K1 at the drive frequency")
        .feeds(Parameter::Alpha6).under(Laws::Some);
}
After from AFTER_LAWS => {
    SampleModulus = quantity(Sample, "modulus", Kind::Pressure, R::POSITIVE, "Young's modulus of the sample")
        .feeds(Parameter::Alpha4).under(Laws::Some)
        .label("sample modulus $E$")
        .such_as(1e9);
    SamplePoisson = quantity(Sample, "poisson", Kind::Number, POISSON, "Poisson's ratio of the sample").under(Laws::Some)
        .such_as(0.3);
    SampleIndentation = quantity(
        Sample, "indentation", Kind::Length, R::POSITIVE, "indentation at which Hertz's stiffness is taken",
    ).feeds(Parameter::Alpha4).under(Laws::Some)
        .such_as(1e-9);

    SampleHamaker = of_parameter(&adhesion::HAMAKER);
    SampleWorkOfAdhesion = of_parameter(&adhesion::WORK_OF_ADHESION);
    SampleWorkOfRetraction = of_parameter(&hysteresis::WORK_OF_RETRACTION);
    SampleAdhesionForce = of_laws(&adhesion::PULL_OFF_FORCE);
    SampleIntermolecularDistance = of_parameter(&entry::CONTACT_DISTANCE);
    SampleViscosity = of_parameter(&entry::VISCOSITY);
    SampleThickness = of_parameter(&entry::THICKNESS);
    SampleDecayLength = of_parameter(&viscous::DECAY_LENGTH);
    SampleSurfaceTension = of_parameter(&capillary::SURFACE_TENSION);
    SampleFilmThickness = of_parameter(&capillary::FILM_THICKNESS);
    SampleSurfaceEnergy = of_parameter(&capillary::SURFACE_ENERGY);
    SampleVoltage = of_parameter(&electric::VOLTAGE);
    SampleAcVoltage = of_parameter(&electric::AC_VOLTAGE);
    SampleContactPotential = of_parameter(&electric::CONTACT_POTENTIAL);
    SamplePermittivity = of_parameter(&electric::PERMITTIVITY);
    SampleDebyeLength = of_parameter(&electric::DEBYE_LENGTH);
    SampleCharge = of_parameter(&electric::SAMPLE_CHARGE);
    SampleRepulsion = of_parameter(&lennard_jones::REPULSION);

    SampleDampingDistance = of_parameter(&viscous::DAMPING_DISTANCE);
    SampleDampingExponent = of_parameter(&viscous::DAMPING_EXPONENT);
    SampleSolvationForce = of_parameter(&solvation::SOLVATION_FORCE);
    SampleSolvationPeriod = of_parameter(&solvation::SOLVATION_PERIOD);
    SampleSolvationDecay = of_parameter(&solvation::SOLVATION_DECAY);
    SampleBondEnergy = of_parameter(&pair::BOND_ENERGY);
    SampleBondLength = of_parameter(&pair::BOND_LENGTH);
    SampleBondDecay = of_parameter(&pair::BOND_DECAY);
    SamplePowerForce = of_parameter(&pair::POWER_FORCE);
    SamplePowerDistance = of_parameter(&pair::POWER_DISTANCE);
    SamplePower = of_parameter(&pair::POWER);
    SamplePointCharge = of_parameter(&pair::POINT_CHARGE);
    SamplePointChargeOfTip = of_parameter(&pair::TIP_POINT_CHARGE);
    SampleForce = other(
        Sample, "force", Takes::Formula,
        "force as a formula of gap d and rate v (formula), with parameters under [sample.parameters]",
    ).under(Laws::Nonlinear);
    SampleArms = other(
        Sample, "arms", Takes::Arms,
        "relaxing arms of a Prony series (prony-sphere, prony-cone, prony-punch): rows of time and modulus, or a CSV file of them",
    ).alias("prony").under(Laws::Nonlinear);
    SampleRelaxationArms = other(
        Sample, "relaxation_arms", Takes::Springs,
        "relaxing arms of a generalised Maxwell sample (generalised-maxwell): rows of time and stiffness, or a CSV file of them",
    ).under(Laws::Nonlinear);
    SampleArmModulusFactor = of_parameter(&prony::ARM_MODULUS_FACTOR);
    SampleArmTimeFactor = of_parameter(&prony::ARM_TIME_FACTOR);
    SampleHorizon = of_parameter(&prony::HORIZON);

    DriveFrequency = quantity(Drive, "frequency", Kind::Frequency, R::POSITIVE, "frequency of the drive")
        .feeds(Parameter::Omega)
        .label("drive frequency $f$");
    DriveFrequencyRatio = quantity(Drive, "frequency_ratio", Kind::Number, R::POSITIVE, "frequency of the drive over f0")
        .feeds(Parameter::Omega)
        .label("drive frequency $f/f_0$");
    DriveAmplitude = quantity(Drive, "amplitude", Kind::Length, R::NOT_NEGATIVE, "amplitude of the clamped end's motion")
        .feeds(Parameter::Alpha2)
        .label("base amplitude");
    DriveForce = quantity(Drive, "force", Kind::Force, R::NOT_NEGATIVE, "amplitude of the force on the lever")
        .feeds(Parameter::Alpha2)
        .label("drive force");
    DriveFreeAmplitude = quantity(
        Drive, "free_amplitude", Kind::Length, R::NOT_NEGATIVE,
        "amplitude of the tip's deflection far from the sample, A0",
    ).feeds(Parameter::Alpha2)
        .label("free amplitude $A_0$");
    DriveSetpoint = other(
        Drive, "setpoint", Takes::Setpoint,
        "what the feedback holds: a fraction of A0, an amplitude, a peak force, a phase, or under \
         frequency modulation a frequency shift; it tells the distance",
    ).feeds(Parameter::Alpha5)
        .label("setpoint $A/A_0$");
    DriveStart = other(
        Drive, "start", Takes::State,
        "state at drive phase 0 from which motions start: a1,…,aN,v1,…,vN with units, or by name as in tip=5nm; \
         together with gap.tip and setpoint it is the motion at that setpoint",
    );
    DriveActuation = other(Drive, "actuation", Takes::Word(words!(Actuation)), "where the drive acts");
    DriveHold = other(
        Drive, "hold", Takes::Word(words!(Hold)),
        "what stays while another key varies: the drive's own amplitude or force (default), or the free amplitude",
    );
    DriveQControlGain = quantity(Drive, "q_control_gain", Kind::Stiffness, R::NOT_NEGATIVE, "Q control: force at the tip per deflection of the tip, whose phase q_control_phase tells")
        .feeds(Parameter::QControlGain)
        .label("gain of Q control");
    DriveQControlPhase = quantity(Drive, "q_control_phase", Kind::Angle, HALF_TURN, "phase by which the force of Q control leads the deflection at the first resonance: 90° raises Q, -90° lowers it")
        .feeds(Parameter::QControlPhase)
        .label("phase of Q control");
    SecondFrequency = quantity(Drive, "second_frequency", Kind::Frequency, R::POSITIVE, "frequency of a second tone");
    SecondRatio = other(Drive, "second_ratio", Takes::FrequencyRatio, "frequency of a second tone over that of the first");
    SecondAmplitude = quantity(Drive, "second_amplitude", Kind::Length, R::NOT_NEGATIVE, "amplitude of the second tone's motion of the clamped end")
        .feeds(Parameter::Tone2Amplitude);
    SecondForce = quantity(Drive, "second_force", Kind::Force, R::NOT_NEGATIVE, "amplitude of the second tone's force on the lever")
        .feeds(Parameter::Tone2Amplitude);
    SecondFreeAmplitude = quantity(Drive, "second_free_amplitude", Kind::Length, R::NOT_NEGATIVE, "free amplitude of the tip at the second tone")
        .feeds(Parameter::Tone2Amplitude)
        .label("free amplitude at the second tone");
    SecondPhase = quantity(Drive, "second_phase", Kind::Angle, R::ANY, "phase of the second tone")
        .feeds(Parameter::Tone2Phase);
    ThirdFrequency = quantity(Drive, "third_frequency", Kind::Frequency, R::POSITIVE, "frequency of a third tone");
    ThirdRatio = other(Drive, "third_ratio", Takes::FrequencyRatio, "frequency of a third tone over that of the first");
    ThirdAmplitude = quantity(Drive, "third_amplitude", Kind::Length, R::NOT_NEGATIVE, "amplitude of the third tone's motion of the clamped end")
        .feeds(Parameter::Tone3Amplitude);
    ThirdForce = quantity(Drive, "third_force", Kind::Force, R::NOT_NEGATIVE, "amplitude of the third tone's force on the lever")
        .feeds(Parameter::Tone3Amplitude);
    ThirdFreeAmplitude = quantity(Drive, "third_free_amplitude", Kind::Length, R::NOT_NEGATIVE, "free amplitude of the tip at the third tone")
        .feeds(Parameter::Tone3Amplitude)
        .label("free amplitude at the third tone");
    ThirdPhase = quantity(Drive, "third_phase", Kind::Angle, R::ANY, "phase of the third tone")
        .feeds(Parameter::Tone3Phase);

    GapTip = quantity(Gap, "tip", Kind::Length, R::ANY, "gap between tip and sample at rest, g1; negative: pressed in")
        .feeds(Parameter::Alpha5)
        .label("distance $z_c$");
    GapBeam = quantity(Gap, "beam", Kind::Length, R::POSITIVE, "gap between beam and sample at rest, g0, the unit of length")
        .label("beam gap $g_0$");
}
}

/// Groups of keys that exclude each other, because each determines the same quantity.
pub(super) static ALTERNATIVES: &[Alternatives] = &[
    Alternatives {
        ways: &[
            &[Key::LeverModes],
            &[
                Key::LeverName,
                Key::LeverK,
                Key::LeverK1,
                Key::LeverF0,
                Key::LeverF2,
                Key::LeverF3,
                Key::LeverQ,
                Key::LeverQ2,
                Key::LeverQ3,
                Key::LeverK2,
                Key::LeverK3,
                Key::FluidDensity,
                Key::FluidViscosity,
                Key::LeverHeight,
                Key::LeverWidth,
                Key::LeverThickness,
                Key::LeverModulus,
                Key::LeverDensity,
                Key::LeverKError,
                Key::TipMass,
                Key::TipMassRatio,
                Key::TipShape,
            ],
        ],
        reason: "a lever is either a beam with its tip or the modes that were measured with the tip on it",
    },
    Alternatives {
        ways: &[&[Key::LeverQ], &[Key::FluidDensity, Key::FluidViscosity]],
        reason: "the fluid tells the quality factor",
    },
    Alternatives {
        ways: &[&[Key::LeverK], &[Key::LeverK1]],
        reason: "one follows from the other through the shape of the first mode",
    },
    Alternatives {
        ways: &[&[Key::DriveFrequency], &[Key::DriveFrequencyRatio]],
        reason: "each gives the frequency",
    },
    Alternatives {
        ways: &[
            &[Key::DriveAmplitude, Key::DriveForce],
            &[Key::DriveFreeAmplitude],
        ],
        reason: "one follows from the other through the lever's free response",
    },
    Alternatives {
        ways: &[&[Key::SecondFrequency], &[Key::SecondRatio]],
        reason: "each gives the frequency",
    },
    Alternatives {
        ways: &[
            &[Key::SecondAmplitude, Key::SecondForce],
            &[Key::SecondFreeAmplitude],
        ],
        reason: "one follows from the other through the lever's free response",
    },
    Alternatives {
        ways: &[&[Key::ThirdFrequency], &[Key::ThirdRatio]],
        reason: "each gives the frequency",
    },
    Alternatives {
        ways: &[
            &[Key::ThirdAmplitude, Key::ThirdForce],
            &[Key::ThirdFreeAmplitude],
        ],
        reason: "one follows from the other through the lever's free response",
    },
    Alternatives {
        ways: &[&[Key::SampleDamping], &[Key::SampleLossTangent]],
        reason: "each gives the damper C1",
    },
    Alternatives {
        ways: &[&[Key::TipMass], &[Key::TipMassRatio], &[Key::TipShape]],
        reason: "each gives the tip's mass; keep the one that is known best",
    },
    Alternatives {
        ways: &[
            &[Key::SampleStiffness],
            &[
                Key::SampleMaterial,
                Key::SampleModulus,
                Key::SamplePoisson,
                Key::SampleIndentation,
            ],
        ],
        reason: "the stiffness is either given or Hertz's",
    },
    Alternatives {
        ways: &[&[Key::GapTip], &[Key::DriveSetpoint]],
        reason: "the setpoint is solved for the distance; keep the one that is held",
    },
];
