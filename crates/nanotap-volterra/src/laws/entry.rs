//! The description of a law, for case files, help, schema and figures.

use nanotap_quantity::Kind;

/// Declares parameters, one a paragraph.
macro_rules! parameters {
    ($($(#[$doc:meta])* $visible:vis const $name:ident = $value:expr;)*) => {
        $($(#[$doc])* $visible const $name: ParameterEntry = $value;)*
    };
}
pub(crate) use parameters;

/// A parameter of a law, with its unit, default and range, and the keys of a case that state it.
#[derive(Clone, Copy, Debug)]
pub struct ParameterEntry {
    /// Name in messages and data.
    pub name: &'static str,
    /// Description in a few words, without a unit.
    pub words: &'static str,
    /// Kind of quantity, with its SI unit.
    pub kind: Kind,
    /// Default value in SI units; `None` if a value is required.
    pub default: Option<f64>,
    /// Range of the values that are accepted.
    pub range: Range,
    /// Key of a case that states the parameter.
    pub key: CaseKey,
    /// Other keys from which the parameter can be computed instead.
    pub alternatives: Alternatives,
    /// Whether the default is an assumption about the sample that a case reports.
    pub assumed: bool,
}

/// The key of a case that states a parameter.
#[derive(Clone, Copy, Debug)]
pub enum CaseKey {
    /// A quantity of tip or sample that a case has without the law, by its path: `tip.radius`.
    Body(&'static str),
    /// A key that cases have because of the law.
    Own(KeyEntry),
}

/// Description of a key of a case.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyEntry {
    /// Whether the key is one of the tip; else of the sample.
    pub of_tip: bool,
    /// Name of the key in its table.
    pub name: &'static str,
    /// Alternative name of the key, if it has one.
    pub alias: Option<&'static str>,
    /// Kind of the values.
    pub kind: Kind,
    /// Range of the values.
    pub range: Range,
    /// SI value of 1, if values are multiples of it without a unit.
    pub multiple_of: Option<f64>,
    /// Default value, listed with the key.
    pub default: Option<f64>,
    /// Value for examples in messages and forms.
    pub example: f64,
    /// Description of the key in one line.
    pub meaning: &'static str,
    /// Words and symbol on the axis of a figure; if empty, the path of the key in words.
    pub label: &'static str,
}

/// Keys from which a parameter can be computed where its own key is not given.
#[derive(Clone, Copy, Debug)]
pub struct Alternatives {
    /// Why only one of the keys may be stated.
    pub reason: &'static str,
    /// The other keys.
    pub ways: &'static [Alternative],
}

/// Another key that states a parameter, and the conversion.
#[derive(Clone, Copy, Debug)]
pub struct Alternative {
    /// The other key.
    pub key: KeyEntry,
    /// Names of further parameters of the law that the conversion needs.
    pub needs: &'static [&'static str],
    /// Converts the value of the key, with those of the further parameters, all in SI.
    pub convert: fn(f64, &[f64]) -> f64,
}

impl ParameterEntry {
    /// Sets the alternatives.
    #[must_use]
    pub const fn or_by(self, alternatives: Alternatives) -> Self {
        Self {
            alternatives,
            ..self
        }
    }

    /// Marks the default as an assumption about the sample.
    #[must_use]
    pub const fn assumed(self) -> Self {
        Self {
            assumed: true,
            ..self
        }
    }
}

impl KeyEntry {
    /// Creates a key of the sample from its name, kind and range, with description and example.
    pub const fn new(
        name: &'static str,
        kind: Kind,
        range: Range,
        meaning: &'static str,
        example: f64,
    ) -> Self {
        Self {
            of_tip: false,
            name,
            alias: None,
            kind,
            range,
            multiple_of: None,
            default: None,
            example,
            meaning,
            label: "",
        }
    }

    /// Sets words and symbol on the axis of a figure.
    #[must_use]
    pub const fn label(self, label: &'static str) -> Self {
        Self { label, ..self }
    }

    /// Makes the values multiples of an SI value, without a unit.
    #[must_use]
    pub const fn multiple_of(self, unit: f64) -> Self {
        Self {
            kind: Kind::Number,
            multiple_of: Some(unit),
            ..self
        }
    }
}

/// The values that a parameter accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Above zero and finite.
    Positive,
    /// Above zero, infinity included (a rigid body).
    PositiveOrInfinite,
    /// Zero or above, finite.
    NotNegative,
    /// From −1 to ½ (Poisson's ratio).
    Poisson,
    /// Above 0 and below π/2 rad (90 degrees).
    Angle,
    /// Any finite number.
    Finite,
}

impl Range {
    /// Reports whether the range contains a value.
    pub fn holds(self, value: f64) -> bool {
        match self {
            Self::Positive => value > 0.0 && value.is_finite(),
            Self::PositiveOrInfinite => value > 0.0,
            Self::NotNegative => value >= 0.0 && value.is_finite(),
            Self::Poisson => (-1.0..=0.5).contains(&value),
            Self::Angle => value > 0.0 && value < std::f64::consts::FRAC_PI_2,
            Self::Finite => value.is_finite(),
        }
    }

    /// Returns a description of the range for messages.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Positive => "positive and finite",
            Self::PositiveOrInfinite => "positive (infinite: rigid)",
            Self::NotNegative => "zero or positive, and finite",
            Self::Poisson => "between −1 and ½",
            Self::Angle => "between 0 and 90 degrees",
            Self::Finite => "finite",
        }
    }
}

/// The part of the interaction that a law describes; two laws with the same part cannot be added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The elastic repulsion of the bodies in contact.
    Elasticity,
    /// The attraction of the bodies, in contact or across the gap.
    Adhesion,
}

/// The description of a law in the table of laws.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Name in case files.
    pub name: &'static str,
    /// Description of the law in one line.
    pub words: &'static str,
    /// Formula of the force as text, in the symbols of the law's source.
    pub formula: &'static str,
    /// Publication from which the formula is taken.
    pub source: &'static str,
    /// Parameters, in the order of the formula.
    pub parameters: &'static [ParameterEntry],
    /// Parts of the interaction that must not be counted twice in a sum of laws.
    pub parts: &'static [Part],
    /// Whether the law attracts across a gap down to the contact distance, which then is not 0.
    pub attracts: bool,
    /// Whether the force depends on the gap alone, without a memory.
    pub conservative: bool,
}

impl Entry {
    /// Returns the names of the law's parameters.
    pub fn parameter_names(&self) -> Vec<&'static str> {
        self.parameters.iter().map(|p| p.name).collect()
    }

    /// Returns the keys that cases have because of the law.
    pub fn keys(&self) -> impl Iterator<Item = KeyEntry> {
        self.parameters.iter().flat_map(|parameter| {
            let own = match parameter.key {
                CaseKey::Own(key) => Some(key),
                CaseKey::Body(_) => None,
            };
            let others = parameter.alternatives.ways.iter().map(|way| way.key);
            own.into_iter().chain(others)
        })
    }
}

/// Creates a parameter that a case states by a key of this name, with the key's description and
/// an example of its value.
pub const fn own(
    name: &'static str,
    words: &'static str,
    kind: Kind,
    default: Option<f64>,
    range: Range,
    meaning: &'static str,
    example: f64,
) -> ParameterEntry {
    let key = KeyEntry::new(name, kind, range, meaning, example);
    stated_by(name, words, kind, default, range, CaseKey::Own(key))
}

/// Creates a parameter that a case states by this key.
pub const fn stated_by(
    name: &'static str,
    words: &'static str,
    kind: Kind,
    default: Option<f64>,
    range: Range,
    key: CaseKey,
) -> ParameterEntry {
    ParameterEntry {
        name,
        words,
        kind,
        default,
        range,
        key,
        alternatives: Alternatives {
            reason: "",
            ways: &[],
        },
        assumed: false,
    }
}

/// Creates a factor of rows or arms whose unit is 1 of `kind` in SI.
pub const fn factor(
    name: &'static str,
    words: &'static str,
    kind: Kind,
    range: Range,
    meaning: &'static str,
) -> ParameterEntry {
    let key = KeyEntry {
        default: Some(1.0),
        ..KeyEntry::new(name, kind, range, meaning, 1.0).multiple_of(1.0)
    };
    stated_by(name, words, kind, Some(1.0), range, CaseKey::Own(key))
}

parameters! {
    /// Young's modulus of the sample, Pa.
    pub const MODULUS = stated_by("modulus", "Young's modulus of the sample", Kind::Pressure, None,
        Range::Positive, CaseKey::Body("sample.modulus"));
    /// Poisson's ratio of the sample, dimensionless.
    pub const POISSON = stated_by("poisson", "Poisson's ratio of the sample", Kind::Number, Some(0.3),
        Range::Poisson, CaseKey::Body("sample.poisson")).assumed();
    /// Young's modulus of the tip, Pa; infinite for a rigid tip.
    pub const TIP_MODULUS = stated_by("tip_modulus", "Young's modulus of the tip", Kind::Pressure,
        Some(f64::INFINITY), Range::PositiveOrInfinite, CaseKey::Body("tip.modulus"));
    /// Poisson's ratio of the tip, dimensionless.
    pub const TIP_POISSON = stated_by("tip_poisson", "Poisson's ratio of the tip", Kind::Number, Some(0.3),
        Range::Poisson, CaseKey::Body("tip.poisson"));
    /// Radius of a spherical tip or of a flat punch, m.
    pub const RADIUS = stated_by("radius", "radius of the tip", Kind::Length, None, Range::Positive,
        CaseKey::Body("tip.radius"));
    /// Half angle of a conical tip, rad.
    pub const HALF_ANGLE = stated_by("half_angle", "half angle of the conical tip", Kind::Angle, None,
        Range::Angle, CaseKey::Body("tip.half_angle"));
}

/// Gap at which contact begins, m.
pub const CONTACT_DISTANCE: ParameterEntry = stated_by(
    "contact_distance",
    "intermolecular distance a0, the gap at which contact begins",
    Kind::Length,
    Some(0.165e-9),
    Range::Finite,
    CaseKey::Own(KeyEntry {
        alias: Some("contact_distance"),
        label: "intermolecular distance $a_0$",
        ..KeyEntry::new(
            "intermolecular_distance",
            Kind::Length,
            Range::Positive,
            "intermolecular distance a0, the gap at which contact begins",
            1.65e-10,
        )
    }),
)
.assumed();

/// Dynamic viscosity of the sample, Pa s.
pub const VISCOSITY: ParameterEntry = stated_by("viscosity", "viscosity of the sample", Kind::Viscosity, None, Range::NotNegative, CaseKey::Own(KeyEntry::new("viscosity", Kind::Viscosity, Range::NotNegative, "viscosity of the sample: elongational of a Kelvin–Voigt solid, García's η of viscous-contact", 1.0).label("sample viscosity $η$")));

parameters! {
    /// Thickness of the sample, m.
    pub const THICKNESS = own("thickness", "thickness of the sample on its rigid support", Kind::Length,
        None, Range::Positive, "thickness of a thin sample on its support", 2e-8);
}
