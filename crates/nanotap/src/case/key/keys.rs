//! The keys of a case, each declared here and nowhere else: its names, what it takes, which
//! values are allowed, its default, and what it is. Parsing, refusals, sweeps and branches,
//! units in messages, `nanotap case`, Python's keyword arguments and the JSON schema read
//! this table.
//!
//! A new dimensionless number is an entry here and a field of the equations; a new physical
//! quantity is an entry here and the line of the mapping that reads it.

use super::{Alternatives, Default, Entry, Means, ModelKind, Range, Section, Takes};
use crate::case::DEFAULT_MODES;
use crate::case::quantity::Kind;
use crate::model::beam::MAX_MODES;
use crate::model::cantilever::CosineTerm;
use crate::model::contact::ContactLaw;
use crate::model::drive_form::Actuation;
use crate::model::oscillator::OscillatorParameter as Of;
use crate::model::parameter::Parameter;

const CANTILEVER: &[ModelKind] = &[ModelKind::Cantilever];
const SOFT: &[ModelKind] = &[ModelKind::VibroImpact];
const RIGID: &[ModelKind] = &[ModelKind::Impact];
const OSCILLATORS: &[ModelKind] = &[ModelKind::VibroImpact, ModelKind::Impact];

const PLAIN: Entry = Entry {
    section: Section::Model,
    name: "",
    alias: None,
    symbol: "",
    takes: Takes::Quantity(Kind::Number),
    range: Range::ANY,
    default: Default::None,
    example: 1.0,
    models: &[],
    means: Means::Nothing,
    feeds: None,
    meaning: "",
};

/// A parameter of the cantilever.
const fn number(parameter: Parameter, symbol: &'static str, meaning: &'static str) -> Entry {
    Entry {
        name: parameter.name(),
        symbol,
        models: CANTILEVER,
        means: Means::Cantilever(parameter),
        meaning,
        ..PLAIN
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

/// A word of `[model]`.
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

/// A physical quantity.
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

/// Something of a physical case that is no quantity.
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
    const fn also(self, alias: &'static str) -> Self {
        Self {
            alias: Some(alias),
            ..self
        }
    }

    const fn or(self, value: f64) -> Self {
        Self {
            default: Default::Number(value),
            ..self
        }
    }

    const fn such_as(self, example: f64) -> Self {
        Self { example, ..self }
    }

    const fn feeds(self, parameter: Parameter) -> Self {
        Self {
            feeds: Some(parameter),
            ..self
        }
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
    ($($key:ident = $entry:expr;)*) => {
        /// A key of a case.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[expect(missing_docs, reason = "what each is stands in its entry")]
        pub enum Key { $($key),* }

        pub(super) static TABLE: &[Entry] = &[$($entry),*];

        impl Key {
            /// Every key, in the order of the table.
            pub fn all() -> impl Iterator<Item = Self> + Clone {
                const ALL: &[Key] = &[$(Key::$key),*];
                ALL.iter().copied()
            }
        }
    };
}

use Kind::{
    Angle, ChargeDensity, Damping, Density, Energy, Force, Frequency, Length, Mass, Number,
    Pressure, Repulsion, Stiffness, Time, Viscosity, Voltage,
};
use Range as R;
use Section::{Cantilever, Drive, Gap, Sample, Tip};

keys! {
    Alpha1 = number(Parameter::Alpha1, "α₁", "tip mass over beam mass, M/(mL)")
        .also("tip_mass_ratio").such_as(0.1);
    Alpha2 = number(Parameter::Alpha2, "α₂", "drive amplitude over beam gap, f/g0")
        .also("drive_amplitude").such_as(0.1);
    Alpha3 = number(Parameter::Alpha3, "α₃", "viscous damping of the beam, C·√(L⁴/(m·EI))")
        .also("beam_damping").such_as(0.1);
    Alpha4 = number(Parameter::Alpha4, "α₄", "contact stiffness over bending stiffness, K1·L³/(EI)")
        .also("contact_stiffness").such_as(20.0);
    Alpha5 = number(Parameter::Alpha5, "α₅", "tip gap over beam gap, g1/g0 (negative: pressed in at rest)")
        .also("gap").or(0.0);
    Alpha6 = number(Parameter::Alpha6, "α₆", "viscous damping of the contact, (C1/L)·√(L⁴/(m·EI))")
        .also("contact_damping").such_as(0.2);
    Omega = number(Parameter::Omega, "Ω", "drive frequency, ω·√(mL⁴/(EI))")
        .also("drive_frequency").such_as(2.6);
    RelaxationStiffness = number(
        Parameter::RelaxationStiffness, "kₘ",
        "stiffness of the relaxing arm over bending stiffness, km·L³/(EI)",
    ).such_as(20.0);
    RelaxationTime = number(
        Parameter::RelaxationTime, "τₘ", "time in which the arm's force decays, over √(mL⁴/(EI))",
    ).such_as(0.1);
    SurfaceStiffness = number(
        Parameter::SurfaceStiffness, "kₛ", "a moving surface's own stiffness over bending stiffness, ks·L³/(EI)",
    ).such_as(10.0);
    SurfaceDamping = number(
        Parameter::SurfaceDamping, "ηₛ", "a moving surface's own damping, (ηs/L)·√(L⁴/(m·EI))",
    ).such_as(1.0);
    AdhesionForce = number(
        Parameter::AdhesionForce, "F", "force that pulls a touching tip to a moving surface, F·L³/(EI·g0)",
    ).or(0.0);
    Tone2Amplitude = number(
        Parameter::Tone2Amplitude, "A₂", "amplitude of the second tone, measured as alpha2",
    ).also("second_tone_amplitude").or(0.0);
    Tone2Phase = number(Parameter::Tone2Phase, "θ₂", "phase of the second tone in degrees")
        .also("second_tone_phase").or(0.0);

    Mode2Frequency = number(
        Parameter::Mode2Frequency, "Ω₂", "measured frequency of the second free mode, as omega (0: the beam's own)",
    ).or(0.0);
    Mode3Frequency = number(
        Parameter::Mode3Frequency, "Ω₃", "measured frequency of the third free mode, as omega (0: the beam's own)",
    ).or(0.0);
    Mode2Quality = number(
        Parameter::Mode2Quality, "Q₂", "measured quality factor of the second free mode (0: as beam_damping has it)",
    ).or(0.0);
    Mode3Quality = number(
        Parameter::Mode3Quality, "Q₃", "measured quality factor of the third free mode (0: as beam_damping has it)",
    ).or(0.0);
    Mode2Stiffness = number(
        Parameter::Mode2Stiffness, "k₂", "measured stiffness of the second free mode at the tip, k2·L³/(EI) (0: the beam's own)",
    ).or(0.0);
    Mode3Stiffness = number(
        Parameter::Mode3Stiffness, "k₃", "measured stiffness of the third free mode at the tip, k3·L³/(EI) (0: the beam's own)",
    ).or(0.0);

    Mass = oscillator(Of::Mass, "m", OSCILLATORS, "mass").or(1.0);
    Stiffness = oscillator(Of::Stiffness, "k", OSCILLATORS, "spring");
    Damping = oscillator(Of::Damping, "c", OSCILLATORS, "damper").such_as(0.0);
    Forcing = oscillator(Of::Forcing, "F", OSCILLATORS, "amplitude of the force F cos ωt");
    OscillatorOmega = oscillator(Of::Omega, "ω", OSCILLATORS, "frequency of the force").such_as(2.5);
    OscillatorGap = oscillator(Of::Gap, "gap", OSCILLATORS, "where the stop stands; contact at x ≥ gap")
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

    LeverName = other(Cantilever, "lever", Takes::LeverName, "a lever of the catalogue, for what is not said");
    LeverK = quantity(Cantilever, "k", Stiffness, R::POSITIVE, "static spring constant at the tip, 3EI/L³");
    LeverF0 = quantity(Cantilever, "f0", Frequency, R::POSITIVE, "first free resonance, with the tip");
    LeverF2 = quantity(Cantilever, "f2", Frequency, R::POSITIVE, "second free resonance; without a tip's mass it tells that mass")
        .feeds(Parameter::Mode2Frequency);
    LeverF3 = quantity(Cantilever, "f3", Frequency, R::POSITIVE, "third free resonance")
        .feeds(Parameter::Mode3Frequency);
    LeverQ = quantity(Cantilever, "Q", Number, R::POSITIVE, "quality factor of the first free resonance")
        .feeds(Parameter::Alpha3);
    LeverQ2 = quantity(Cantilever, "Q2", Number, R::POSITIVE, "quality factor of the second free resonance")
        .feeds(Parameter::Mode2Quality);
    LeverQ3 = quantity(Cantilever, "Q3", Number, R::POSITIVE, "quality factor of the third free resonance")
        .feeds(Parameter::Mode3Quality);
    LeverK2 = quantity(Cantilever, "k2", Stiffness, R::POSITIVE, "stiffness of the second mode at the tip")
        .feeds(Parameter::Mode2Stiffness);
    LeverK3 = quantity(Cantilever, "k3", Stiffness, R::POSITIVE, "stiffness of the third mode at the tip")
        .feeds(Parameter::Mode3Stiffness);
    FluidDensity = quantity(Cantilever, "fluid_density", Density, R::POSITIVE, "density of the fluid around a rectangular lever, with fluid_viscosity in place of Q; a given f0 is then that in vacuum")
        .feeds(Parameter::Alpha3);
    FluidViscosity = quantity(Cantilever, "fluid_viscosity", Viscosity, R::POSITIVE, "viscosity of the fluid around the lever")
        .feeds(Parameter::Alpha3);
    LeverLength = quantity(Cantilever, "length", Length, R::POSITIVE, "length of the beam");
    LeverWidth = quantity(Cantilever, "width", Length, R::POSITIVE, "width of the beam");
    LeverThickness = quantity(Cantilever, "thickness", Length, R::POSITIVE, "thickness in the direction of bending");
    LeverModulus = quantity(Cantilever, "modulus", Pressure, R::POSITIVE, "Young's modulus along the beam");
    LeverDensity = quantity(Cantilever, "density", Density, R::POSITIVE, "density of the beam");

    TipMass = quantity(Tip, "mass", Mass, R::NOT_NEGATIVE, "mass of the tip").feeds(Parameter::Alpha1);
    TipMassRatio = quantity(Tip, "mass_ratio", Number, R::NOT_NEGATIVE, "mass of the tip over that of the beam")
        .feeds(Parameter::Alpha1);
    TipShape = other(Tip, "shape", Takes::Word(&["cone", "pyramid", "sphere"]), "a solid tip, whose mass follows from its density")
        .feeds(Parameter::Alpha1);
    TipHeight = quantity(Tip, "height", Length, R::POSITIVE, "height of the tip: what separates the beam from the sample when it touches");
    TipHalfAngle = quantity(Tip, "half_angle", Angle, FLANK, "angle between the tip's axis and its flank");
    TipDensity = quantity(Tip, "density", Density, R::POSITIVE, "density of the tip");
    TipRadius = quantity(Tip, "radius", Length, R::POSITIVE, "radius of curvature of the apex");
    TipMaterial = other(Tip, "material", Takes::MaterialName, "a material of the catalogue");
    TipModulus = quantity(Tip, "modulus", Pressure, R::POSITIVE, "Young's modulus of the tip");
    TipPoisson = quantity(Tip, "poisson", Number, POISSON, "Poisson's ratio of the tip");

    TipCharge = quantity(Tip, "charge", ChargeDensity, R::ANY, "surface charge density of the tip (dlvo)");

    SampleLaw = other(
        Sample, "law", Takes::Law,
        "how the sample answers the tip: a linear contact, or nonlinear force laws, one or a sum with +",
    );
    SampleTable = other(
        Sample, "table", Takes::Table,
        "force curve of sample.law = \"table\": rows of gap and force, or a CSV file of them",
    );
    SampleGapFactor = quantity(Sample, "gap_factor", Number, R::POSITIVE, "factor by which a table's gaps are stretched").or(1.0);
    SampleForceFactor = quantity(Sample, "force_factor", Number, R::NOT_NEGATIVE, "factor of a table's forces").or(1.0);
    SampleMaterial = other(Sample, "material", Takes::MaterialName, "a material of the catalogue");
    SampleStiffness = quantity(Sample, "stiffness", Stiffness, R::NOT_NEGATIVE, "contact stiffness K1")
        .feeds(Parameter::Alpha4);
    SampleDamping = quantity(Sample, "damping", Damping, R::NOT_NEGATIVE, "contact damping C1")
        .feeds(Parameter::Alpha6);
    SampleLossTangent = quantity(Sample, "loss_tangent", Number, R::NOT_NEGATIVE, "C1 ω/K1 at the drive frequency")
        .feeds(Parameter::Alpha6);
    SampleRelaxationStiffness = quantity(
        Sample, "relaxation_stiffness", Stiffness, R::NOT_NEGATIVE,
        "stiffness of a standard linear solid's relaxing arm",
    ).feeds(Parameter::RelaxationStiffness);
    SampleRelaxationTime = quantity(
        Sample, "relaxation_time", Time, R::NOT_NEGATIVE, "time in which the arm's force decays",
    ).feeds(Parameter::RelaxationTime);
    SampleSurfaceStiffness = quantity(
        Sample, "surface_stiffness", Stiffness, R::POSITIVE, "a moving surface's own stiffness",
    ).feeds(Parameter::SurfaceStiffness);
    SampleSurfaceDamping = quantity(
        Sample, "surface_damping", Damping, R::POSITIVE, "a moving surface's own damping",
    ).feeds(Parameter::SurfaceDamping);
    SampleModulus = quantity(Sample, "modulus", Pressure, R::POSITIVE, "Young's modulus of the sample")
        .feeds(Parameter::Alpha4);
    SamplePoisson = quantity(Sample, "poisson", Number, POISSON, "Poisson's ratio of the sample");
    SampleIndentation = quantity(
        Sample, "indentation", Length, R::POSITIVE, "indentation at which Hertz's stiffness is taken",
    ).feeds(Parameter::Alpha4);

    SampleHamaker = quantity(Sample, "hamaker", Energy, R::ANY, "Hamaker constant of tip, medium and sample");
    SampleWorkOfAdhesion = quantity(Sample, "work_of_adhesion", Stiffness, R::NOT_NEGATIVE, "work of adhesion, an energy an area");
    SampleWorkOfRetraction = quantity(
        Sample, "work_of_retraction", Stiffness, R::NOT_NEGATIVE, "work of adhesion on retraction (adhesion-hysteresis)",
    );
    SampleAdhesionForce = quantity(Sample, "adhesion_force", Force, R::NOT_NEGATIVE, "force that pulls the tip off")
        .feeds(Parameter::AdhesionForce);
    SampleIntermolecularDistance = quantity(
        Sample, "intermolecular_distance", Length, R::POSITIVE, "intermolecular distance a0, the gap at which contact begins",
    );
    SampleViscosity = quantity(Sample, "viscosity", Viscosity, R::NOT_NEGATIVE, "viscosity of the sample");
    SampleThickness = quantity(Sample, "thickness", Length, R::POSITIVE, "thickness of a thin sample on its support");
    SampleDecayLength = quantity(Sample, "decay_length", Length, R::POSITIVE, "distance in which exponential damping decays");
    SampleSurfaceTension = quantity(Sample, "surface_tension", Stiffness, R::POSITIVE, "surface tension of the liquid (capillary)");
    SampleFilmThickness = quantity(Sample, "film_thickness", Length, R::POSITIVE, "thickness of the adsorbed film (capillary)");
    SampleSurfaceEnergy = quantity(Sample, "surface_energy", Stiffness, R::POSITIVE, "surface energy of the solid (capillary)");
    SampleVoltage = quantity(Sample, "voltage", Voltage, R::ANY, "voltage between tip and sample (electrostatic)");
    SamplePermittivity = quantity(Sample, "permittivity", Number, R::POSITIVE, "permittivity of the medium over that of free space");
    SampleDebyeLength = quantity(Sample, "debye_length", Length, R::POSITIVE, "Debye length of the electrolyte (dlvo)");
    SampleCharge = quantity(Sample, "charge", ChargeDensity, R::ANY, "surface charge density of the sample (dlvo)");
    SampleRepulsion = quantity(Sample, "repulsion", Repulsion, R::NOT_NEGATIVE, "constant of the repulsion (lennard-jones)");

    DriveFrequency = quantity(Drive, "frequency", Frequency, R::POSITIVE, "frequency of the drive")
        .feeds(Parameter::Omega);
    DriveFrequencyRatio = quantity(Drive, "frequency_ratio", Number, R::POSITIVE, "frequency of the drive over f0")
        .feeds(Parameter::Omega);
    DriveAmplitude = quantity(Drive, "amplitude", Length, R::NOT_NEGATIVE, "amplitude of the clamped end's motion")
        .feeds(Parameter::Alpha2);
    DriveForce = quantity(Drive, "force", Force, R::NOT_NEGATIVE, "amplitude of the force on the lever")
        .feeds(Parameter::Alpha2);
    DriveFreeAmplitude = quantity(
        Drive, "free_amplitude", Length, R::NOT_NEGATIVE,
        "amplitude of the tip's deflection far from the sample, A0",
    ).feeds(Parameter::Alpha2);
    DriveSetpoint = other(
        Drive, "setpoint", Takes::FractionOrLength,
        "amplitude that the feedback holds: a fraction of A0, or a length; it tells the distance",
    ).feeds(Parameter::Alpha5);
    DriveActuation = other(Drive, "actuation", Takes::Word(words!(Actuation)), "where the drive acts");
    SecondFrequency = quantity(Drive, "second_frequency", Frequency, R::POSITIVE, "frequency of a second tone");
    SecondRatio = other(Drive, "second_ratio", Takes::FrequencyRatio, "frequency of a second tone over that of the first");
    SecondAmplitude = quantity(Drive, "second_amplitude", Length, R::NOT_NEGATIVE, "amplitude of the second tone's motion of the clamped end")
        .feeds(Parameter::Tone2Amplitude);
    SecondForce = quantity(Drive, "second_force", Force, R::NOT_NEGATIVE, "amplitude of the second tone's force on the lever")
        .feeds(Parameter::Tone2Amplitude);
    SecondFreeAmplitude = quantity(Drive, "second_free_amplitude", Length, R::NOT_NEGATIVE, "free amplitude of the tip at the second tone")
        .feeds(Parameter::Tone2Amplitude);
    SecondPhase = quantity(Drive, "second_phase", Angle, R::ANY, "phase of the second tone")
        .feeds(Parameter::Tone2Phase);

    GapTip = quantity(Gap, "tip", Length, R::ANY, "gap between tip and sample at rest, g1; negative: pressed in")
        .feeds(Parameter::Alpha5);
    GapBeam = quantity(Gap, "beam", Length, R::POSITIVE, "gap between beam and sample at rest, g0, the unit of length");
}

/// Quantities that say the same in different ways.
pub(super) static ALTERNATIVES: &[Alternatives] = &[
    Alternatives {
        ways: &[&[Key::LeverQ], &[Key::FluidDensity, Key::FluidViscosity]],
        reason: "the fluid tells the quality factor",
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
        ways: &[
            &[Key::SampleHamaker],
            &[Key::SampleWorkOfAdhesion],
            &[Key::SampleAdhesionForce],
        ],
        reason: "each gives the adhesion, which would be counted twice or contradict itself",
    },
    Alternatives {
        ways: &[&[Key::GapTip], &[Key::DriveSetpoint]],
        reason: "the setpoint is solved for the distance; keep the one that is held",
    },
];
