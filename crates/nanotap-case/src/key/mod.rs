//! Keys of a case: names, types and alternatives.
//!
//! The entries are in `keys`; parsing, checks, sweeps, help and documentation use them.

mod keys;
pub(crate) mod plausible;

use std::borrow::Cow;
use std::cmp::Ordering;
use std::fmt;
use std::sync::{LazyLock, PoisonError, RwLock};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Serialize, Serializer};

use nanotap_formula::Formula;
use nanotap_volterra::laws::entry::{CaseKey, KeyEntry, ParameterEntry};
use nanotap_volterra::laws::{self, written};

use super::near_name::near_name;
use super::quantity::Kind;
use keys::{ALTERNATIVES, TABLE};
use nanotap_model::contact::ContactLaw;
use nanotap_model::drive_form::{Actuation, MAX_TONES};
use nanotap_model::oscillator::OscillatorParameter;
use nanotap_model::parameter::{Applies, Parameter, Unit};
use nanotap_model::words::words;

/// A key of a case: an index into the table of keys, or behind its end that of a parameter of a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Key(u16);

/// The key of a parameter of a formula, with its path.
struct FormulaKey {
    entry: Entry,
    path: String,
}

/// The keys of parameters of formulas, one a name and dimension, for as long as the program runs.
static FORMULA_KEYS: RwLock<Vec<&'static FormulaKey>> = RwLock::new(Vec::new());

words! {
    /// A table of a case file.
    #[derive(PartialOrd, Ord)]
    Section {
        /// Table `[model]`: the numbers of a dimensionless case.
        Model = "model",
        /// Table `[cantilever]`: the lever and the fluid around it.
        Cantilever = "cantilever",
        /// Table `[tip]`: shape, mass and material of the tip.
        Tip = "tip",
        /// Table `[sample]`: contact law and material of the sample.
        Sample = "sample",
        /// Table `[drive]`: frequencies, strengths and setpoint of the drive.
        Drive = "drive",
        /// Table `[gap]`: gaps of tip and beam to the sample at rest.
        Gap = "gap",
    }
}

impl Section {
    /// The section with this name.
    pub fn find(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|section| section.name() == name)
    }

    /// Returns true if the keys of the table are physical quantities.
    pub const fn is_physical(self) -> bool {
        !matches!(self, Self::Model)
    }

    /// Returns the keys of this table.
    pub fn keys(self) -> impl Iterator<Item = Key> {
        Key::all().filter(move |key| key.section() == self)
    }

    /// The key of this name or second name.
    pub fn key(self, name: &str) -> Option<Key> {
        self.keys()
            .find(|key| key.name() == name || key.alias() == Some(name))
    }
}

words! {
    /// Kind of model, from the key `kind` of `[model]`.
    ModelKind {
        /// A cantilever with a tip over a sample.
        Cantilever = "cantilever",
        /// An oscillator with a soft stop.
        VibroImpact = "vibro_impact",
        /// An oscillator with a rigid stop.
        Impact = "impact",
    }
}

impl ModelKind {
    /// The keys of `[model]` for this kind, numbers first.
    pub fn keys(self) -> impl Iterator<Item = Key> + Clone {
        Key::all().filter(move |key| key.entry().models.contains(&self))
    }

    /// Returns the names of the keys of this kind, including aliases.
    pub fn names(self) -> impl Iterator<Item = &'static str> + Clone {
        let names = self.keys().map(Key::name);
        names.chain(self.keys().filter_map(Key::alias))
    }

    /// The key called `word`. For the numbers of a cantilever case is ignored, hyphens and spaces
    /// are accepted in place of underscores, and their symbols are names too.
    pub fn key(self, word: &str) -> Option<Key> {
        let exact = |key: &Key| key.name() == word || key.alias() == Some(word);
        if let Some(key) = self.keys().find(exact) {
            return Some(key);
        }
        let plain = word.trim().to_lowercase().replace(['-', ' '], "_");
        self.keys().find(|key| {
            let symbol = key.symbol().to_lowercase();
            key.parameter().is_some()
                && (key.name() == plain
                    || key.alias() == Some(&plain)
                    || symbol == plain
                    || without_subscripts(&symbol) == plain)
        })
    }

    /// The most similar name of a key, for suggestions.
    pub fn near(self, word: &str) -> Option<&'static str> {
        near_name(word, self.names())
    }
}

/// Replaces subscripts: α₄ becomes α4.
fn without_subscripts(symbol: &str) -> String {
    symbol
        .chars()
        .map(|c| match c {
            '₀'..='₉' => char::from(b'0' + (c as u32 - '₀' as u32) as u8),
            'ₘ' => 'm',
            other => other,
        })
        .collect()
}

/// Type of a key's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Takes {
    /// A quantity of this kind; in `[model]` a plain number.
    Quantity(Kind),
    /// Setpoint of a feedback: a fraction of the free amplitude, an amplitude, a peak force, a
    /// phase or a frequency shift.
    Setpoint,
    /// A whole number from 1 to this.
    Count(usize),
    /// One of these words of the case file.
    Word(&'static [&'static str]),
    /// A contact law, or nonlinear force laws joined by `+`.
    Law,
    /// The name of a lever of the catalogue.
    LeverName,
    /// The name of a material of the catalogue.
    MaterialName,
    /// A ratio of two frequencies: `25/4`, `6.25`.
    FrequencyRatio,
    /// A state at drive phase 0.
    State,
    /// A formula of a force.
    Formula,
    /// Rows of gap and force, or the name of a CSV file of them.
    Table,
    /// Rows of time and modulus, or the name of a CSV file of them.
    Arms,
    /// Rows of time and stiffness, or the name of a CSV file of them.
    Springs,
    /// Rows of time and stiffness as numbers of the model.
    ModelArms,
    /// Measured modes of a lever, or the name of a CSV file of them.
    LeverModes,
    /// Measured modes of a lever as numbers of the model.
    ModelLeverModes,
}

impl Takes {
    /// Whether the value is a table of rows.
    pub const fn is_table(self) -> bool {
        matches!(
            self,
            Self::Table
                | Self::Arms
                | Self::Springs
                | Self::ModelArms
                | Self::LeverModes
                | Self::ModelLeverModes
        )
    }
}

/// Range of the values of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Lower end of the range, in the unit of the value.
    pub low: f64,
    /// Upper end of the range, in the unit of the value.
    pub high: f64,
    /// Whether the lower end is excluded.
    pub above: bool,
    /// Whether the upper end is excluded.
    pub below: bool,
    /// Error message for a value outside the range.
    pub reason: &'static str,
}

impl Range {
    /// All finite numbers.
    pub const ANY: Self = Self {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
        above: true,
        below: true,
        reason: "it must be a finite number",
    };
    /// All finite numbers above zero.
    pub const POSITIVE: Self = Self {
        low: 0.0,
        reason: "it must be above zero",
        ..Self::ANY
    };
    /// Zero and all finite numbers above it.
    pub const NOT_NEGATIVE: Self = Self {
        low: 0.0,
        above: false,
        reason: "it must not be negative",
        ..Self::ANY
    };

    /// True if the range contains `value`.
    pub fn contains(&self, value: f64) -> bool {
        let high = if self.above {
            value > self.low
        } else {
            value >= self.low
        };
        let low = if self.below {
            value < self.high
        } else {
            value <= self.high
        };
        high && low
    }
}

/// Default value of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Default {
    /// It must be stated, or follows from other keys.
    None,
    /// This number, in SI or of the dimensionless model.
    Number(f64),
    /// This word of the case file.
    Word(&'static str),
}

/// The number of the equations that a key sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Means {
    /// None: the key is a physical quantity or a word.
    Nothing,
    /// A parameter of the cantilever.
    Cantilever(Parameter),
    /// A parameter of an oscillator.
    Oscillator(OscillatorParameter),
}

/// Entry of the table of keys.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Table of the case file that contains the key.
    pub section: Section,
    /// Name of the key in its table.
    pub name: &'static str,
    /// Alternative name of the key, if it has one.
    pub alias: Option<&'static str>,
    /// Symbol in formulas and on axes; if empty, the path of the key.
    pub symbol: &'static str,
    /// Words and symbol on the axis of a figure; if empty, the path of the key in words.
    pub label: &'static str,
    /// Type of the values.
    pub takes: Takes,
    /// Range of the values, in SI or of the dimensionless model.
    pub range: Range,
    /// Value of the key where it is not stated.
    pub default: Default,
    /// Example of a value for messages and forms, in SI or of the dimensionless model.
    pub example: f64,
    /// Kinds of `[model]` that have the key; empty for a physical quantity.
    pub models: &'static [ModelKind],
    /// Number of the equations that the key sets.
    pub means: Means,
    /// Dimensionless parameter that the key determines, named in error messages.
    pub feeds: Option<Parameter>,
    /// Contact laws that have the key, for a quantity of tip or sample.
    pub laws: Laws,
    /// Description of the key in one line.
    pub meaning: &'static str,
}

/// Contact laws to which a key belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Laws {
    /// Every law, and keys that do not describe the contact.
    All,
    /// Some laws, including linear ones.
    Some,
    /// Some nonlinear laws, but no linear one.
    Nonlinear,
}

/// The kind of quantity with this unit, for this actuation.
pub const fn kind_of(unit: Unit, actuation: Actuation) -> Kind {
    match unit {
        Unit::Number => Kind::Number,
        Unit::Mass => Kind::Mass,
        Unit::Time => Kind::Time,
        Unit::Frequency => Kind::Frequency,
        Unit::Stiffness => Kind::Stiffness,
        Unit::Damping => Kind::Damping,
        Unit::Force => Kind::Force,
        Unit::Drive if !matches!(actuation, Actuation::Base) => Kind::Force,
        Unit::Length | Unit::Drive => Kind::Length,
        Unit::Degrees => Kind::Angle,
    }
}

/// Alternatives, of which at most one may be stated.
#[derive(Debug)]
pub struct Alternatives {
    /// The alternatives, each with one or more keys that belong together.
    pub ways: &'static [&'static [Key]],
    /// Why two exclude each other.
    pub reason: &'static str,
}

/// Keys of nonlinear laws that exclude each other, each group in the order of the table, with the
/// reason.
static LAW_ALTERNATIVES: LazyLock<Vec<(Vec<Key>, &str)>> = LazyLock::new(|| {
    let mut groups: Vec<(Vec<Key>, &str)> = Vec::new();
    for parameter in laws::all().flat_map(|law| law.entry.parameters) {
        let ways = parameter.alternatives.ways.iter();
        let others = ways.filter_map(|way| Key::of_law(&way.key));
        let mut keys: Vec<Key> = Key::of_law_parameter(parameter)
            .into_iter()
            .chain(others)
            .collect();
        keys.sort_unstable();
        let group = (keys, parameter.alternatives.reason);
        if group.0.len() > 1 && !groups.contains(&group) {
            groups.push(group);
        }
    }
    groups
});

/// Paths of all keys, such as `cantilever.k`.
static PATHS: LazyLock<Vec<String>> = LazyLock::new(|| {
    let path = |entry: &Entry| match entry.section {
        Section::Model => entry.name.to_owned(),
        section => format!("{}.{}", section.name(), entry.name),
    };
    TABLE.iter().map(path).collect()
});

impl Key {
    /// All keys of the table, in its order; parameters of formulas are not in it.
    pub fn all() -> impl Iterator<Item = Self> + Clone {
        (0..TABLE.len() as u16).map(Self)
    }

    /// Returns the entry of the key in the table of keys, or of a parameter of a formula.
    pub fn entry(self) -> &'static Entry {
        match self.named() {
            Some(named) => &named.entry,
            None => &TABLE[usize::from(self.0)],
        }
    }

    fn named(self) -> Option<&'static FormulaKey> {
        let number = usize::from(self.0).checked_sub(TABLE.len())?;
        let named = FORMULA_KEYS.read().unwrap_or_else(PoisonError::into_inner);
        named.get(number).copied()
    }

    /// The key `sample.parameters.NAME` of a formula's parameter of this kind; `None` if the name is none.
    /// Equal names of different kinds are different keys.
    pub(crate) fn of_formula(name: &str, kind: Kind) -> Option<Self> {
        let parameter = name.strip_prefix(written::PARAMETERS)?;
        let key =
            Formula::is_name(parameter).then(|| written::key(parameter, kind.dimension()))??;
        let mut all = FORMULA_KEYS.write().unwrap_or_else(PoisonError::into_inner);
        let same = |named: &&FormulaKey| {
            named.entry.name == key.name && named.entry.takes == Takes::Quantity(key.kind)
        };
        let number = all.iter().position(same).unwrap_or(all.len());
        let index = u16::try_from(TABLE.len() + number).ok()?;
        if number == all.len() {
            all.push(Box::leak(Box::new(FormulaKey {
                entry: keys::of_laws(&key),
                path: format!("{}.{}", Section::Sample.name(), key.name),
            })));
        }
        Some(Self(index))
    }

    /// Whether a path is that of a parameter of a formula.
    pub fn is_parameter(path: &str) -> bool {
        let name = path.strip_prefix("sample.");
        let name = name.and_then(|name| name.strip_prefix(written::PARAMETERS));
        name.is_some_and(Formula::is_name)
    }

    /// Whether it is that of a parameter of a formula.
    pub(crate) fn is_of_formula(self) -> bool {
        usize::from(self.0) >= TABLE.len()
    }

    /// Returns the table of the case file that contains the key.
    pub fn section(self) -> Section {
        self.entry().section
    }

    /// Name in its table: `k`.
    pub fn name(self) -> &'static str {
        self.entry().name
    }

    /// Path in the case: `alpha1`, `cantilever.k`.
    pub fn path(self) -> &'static str {
        match self.named() {
            Some(named) => &named.path,
            None => &PATHS[usize::from(self.0)],
        }
    }

    /// Returns the alternative name of the key, if it has one.
    pub fn alias(self) -> Option<&'static str> {
        self.entry().alias
    }

    /// Symbol on the axis of a figure.
    pub fn symbol(self) -> &'static str {
        match self.entry().symbol {
            "" => self.path(),
            symbol => symbol,
        }
    }

    /// Title of the axis of a figure, without the unit.
    ///
    /// ```
    /// use nanotap::case::Key;
    /// assert_eq!(Key::find("gap.tip").unwrap().label(), "distance $z_c$");
    /// assert_eq!(Key::Alpha4.label(), "contact stiffness $α₄$");
    /// assert_eq!(Key::find("sample.film_thickness").unwrap().label(), "sample film thickness");
    /// ```
    pub fn label(self) -> String {
        let entry = self.entry();
        match (entry.label, entry.symbol) {
            ("", "") => self.path().replace(['.', '_'], " "),
            // A word is not a symbol.
            ("", word) if word.chars().count() > 2 => word.to_owned(),
            ("", symbol) => {
                let words = match self.alias().unwrap_or(entry.name) {
                    "omega" => "drive_frequency",
                    name => name,
                };
                format!("{} ${symbol}$", words.replace('_', " "))
            }
            (label, _) => label.to_owned(),
        }
    }

    /// Returns the description of the key in one line.
    pub fn meaning(self) -> &'static str {
        self.entry().meaning
    }

    /// Returns the kind of quantity of the values; a number if they are not quantities.
    pub fn kind(self) -> Kind {
        match self.entry().takes {
            Takes::Quantity(kind) => kind,
            _ => Kind::Number,
        }
    }

    /// Returns true if the key is a quantity of a physical case.
    pub fn is_physical(self) -> bool {
        self.section().is_physical()
    }

    /// Returns the parameter of the cantilever that the key sets, if any.
    pub fn parameter(self) -> Option<Parameter> {
        match self.entry().means {
            Means::Cantilever(parameter) => Some(parameter),
            _ => None,
        }
    }

    /// Returns the parameter of the oscillator that the key sets, if any.
    pub fn oscillator_parameter(self) -> Option<OscillatorParameter> {
        match self.entry().means {
            Means::Oscillator(parameter) => Some(parameter),
            _ => None,
        }
    }

    /// The key of a parameter of the cantilever.
    pub const fn of(parameter: Parameter) -> Self {
        // The table begins with the parameters.
        Self(parameter.index() as u16)
    }

    /// The key that states a parameter of nonlinear laws.
    pub fn of_law_parameter(parameter: &ParameterEntry) -> Option<Self> {
        match &parameter.key {
            CaseKey::Body(path) => Self::find(path),
            CaseKey::Own(key) => Self::of_law(key),
        }
    }

    /// The key with this description in the file of a nonlinear law.
    pub(crate) fn of_law(key: &KeyEntry) -> Option<Self> {
        let section = if key.of_tip {
            Section::Tip
        } else {
            Section::Sample
        };
        section
            .key(key.name)
            .or_else(|| Self::of_formula(key.name, key.kind))
    }

    /// The key of `[sample]` that states a number of a linear contact law.
    pub(crate) fn stating(number: Parameter) -> Option<Self> {
        Section::Sample
            .keys()
            .find(|key| key.name() == number.name())
    }

    /// The number of a linear contact law that the key states, if it is a key of `[sample]`.
    pub(crate) fn law_number(self) -> Option<Parameter> {
        let stated = |of: &Parameter| of.entry().stated_by.is_some() && of.name() == self.name();
        let number = Parameter::every().find(stated);
        number.filter(|_| self.section() == Section::Sample)
    }

    /// The key of a parameter of an oscillator.
    pub fn of_oscillator(parameter: OscillatorParameter) -> Self {
        let is = |key: &Self| key.entry().means == Means::Oscillator(parameter);
        Self::all().find(is).unwrap_or(Self::Mass)
    }

    /// Returns the range of the values, in SI or of the dimensionless model.
    pub fn range(self) -> Range {
        let (low, high) = match self.entry().means {
            Means::Nothing => return self.entry().range,
            Means::Cantilever(parameter) => parameter.entry().range,
            Means::Oscillator(parameter) => parameter.range(),
        };
        Range {
            low,
            high,
            above: false,
            below: false,
            reason: "it must be within the range of the model",
        }
    }

    /// The physical key with the path `section.name`.
    pub fn find(path: &str) -> Option<Self> {
        let (section, name) = path.split_once('.')?;
        let section = Section::find(section).filter(|section| section.is_physical())?;
        section.key(name)
    }

    /// The last key of the sample in the table.
    const LAST_OF_SAMPLE: Self = Self::SampleHorizon;

    /// The frequency of each further tone over that of the first, in a dimensionless case.
    pub const TONE_RATIOS: [Self; MAX_TONES - 1] = [Self::Tone2Ratio, Self::Tone3Ratio];

    /// Returns the reason why the key cannot vary; `None` if it can.
    pub fn cannot_vary(self) -> Option<&'static str> {
        match self.entry().takes {
            Takes::Quantity(_) => None,
            Takes::Setpoint => Some(
                "each setpoint has its own distance; vary gap.tip, or see A/A0 in the curve of \
                 an approach",
            ),
            Takes::State => Some("it is a state; vary one entry by a basin or a sweep's starts"),
            Takes::Count(_) => Some("it is a whole number"),
            Takes::FrequencyRatio => Some("it is a ratio of whole numbers"),
            Takes::Table => Some("it is a curve; vary sample.force_factor or sample.gap_factor"),
            Takes::Arms => {
                Some("it is a table; vary sample.arm_modulus_factor or sample.arm_time_factor")
            }
            Takes::Springs | Takes::ModelArms => {
                Some("it is a table; vary relaxation_stiffness_factor or relaxation_time_factor")
            }
            Takes::LeverModes | Takes::ModelLeverModes => Some("it is a table"),
            Takes::Formula => Some("it is a formula; vary one of its parameters"),
            Takes::Word(_) | Takes::Law | Takes::LeverName | Takes::MaterialName => {
                Some("it is a name, not a quantity")
            }
        }
    }

    /// Returns the keys that exclude this one, each with the reason.
    pub fn alternatives(self) -> impl Iterator<Item = (Self, &'static str)> {
        let own = ALTERNATIVES
            .iter()
            .filter(move |group| group.ways.iter().any(|way| way.contains(&self)))
            .flat_map(move |group| {
                let others = group.ways.iter().filter(move |way| !way.contains(&self));
                others.flat_map(|way| way.iter().map(|key| (*key, group.reason)))
            });
        let of_laws = LAW_ALTERNATIVES.iter();
        let of_laws = of_laws.filter(move |(keys, _)| keys.contains(&self));
        own.chain(of_laws.flat_map(move |(keys, reason)| {
            let others = keys.iter().filter(move |key| **key != self);
            others.map(|key| (*key, *reason))
        }))
    }

    /// The default value of the key for a sample with this law.
    pub(crate) fn default_under(self, law: ContactLaw) -> Option<f64> {
        match (
            self.parameter().map(|of| of.entry().applies),
            self.entry().default,
        ) {
            (Some(Applies::Damper), _) if !law.has_damper() => Some(0.0),
            (Some(Applies::Law(other)), _) if other != law => Some(0.0),
            (_, Default::Number(value)) => Some(value),
            _ => None,
        }
    }
}

impl Ord for Key {
    /// In the order of the table, with parameters of formulas behind the other keys of the sample.
    fn cmp(&self, other: &Self) -> Ordering {
        let place = |key: Self| {
            let last = Self::LAST_OF_SAMPLE.0;
            if key.is_of_formula() {
                (last, key.0)
            } else {
                (key.0, 0)
            }
        };
        place(*self).cmp(&place(*other))
    }
}

impl PartialOrd for Key {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl fmt::Display for Key {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.path())
    }
}

impl Serialize for Key {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.path())
    }
}

impl JsonSchema for Key {
    fn schema_name() -> Cow<'static, str> {
        "Key".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"type": "string", "description": "A key of the case"})
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_the_equations_has_its_key() {
        for parameter in Parameter::every() {
            assert_eq!(Key::of(parameter).parameter(), Some(parameter));
            assert_eq!(Key::of(parameter).name(), parameter.name());
        }
        for parameter in OscillatorParameter::ALL {
            let key = Key::of_oscillator(parameter);
            assert_eq!(key.entry().means, Means::Oscillator(parameter));
            assert_eq!(key.name(), parameter.name());
        }
    }

    #[test]
    fn every_name_leads_back_to_its_key() {
        for kind in ModelKind::ALL {
            for key in kind.keys() {
                assert_eq!(kind.key(key.name()), Some(key), "{key}");
                if let Some(alias) = key.alias() {
                    assert_eq!(kind.key(alias), Some(key), "{key}");
                }
            }
        }
        for key in ModelKind::Cantilever
            .keys()
            .filter(|key| key.parameter().is_some())
        {
            for word in [key.name(), key.alias().unwrap_or(key.name()), key.symbol()] {
                let find = |word: &str| ModelKind::Cantilever.key(word);
                assert_eq!(find(word), Some(key), "{word}");
                assert_eq!(find(&word.to_uppercase()), Some(key), "{word}");
                assert_eq!(find(&word.replace('_', "-")), Some(key), "{word}");
            }
        }
        let find = |word: &str| ModelKind::Cantilever.key(word);
        assert_eq!(find("α4"), Some(Key::Alpha4));
        assert_eq!(find(" Drive frequency "), Some(Key::Omega));
        for key in Key::all().filter(|key| key.is_physical()) {
            assert_eq!(Key::find(key.path()), Some(key));
        }
    }

    #[test]
    fn no_two_keys_of_a_table_have_one_name() {
        for kind in ModelKind::ALL {
            let mut names: Vec<_> = kind.names().collect();
            let count = names.len();
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), count, "{kind:?}");
        }
        let mut paths: Vec<_> = Key::all()
            .filter(|key| key.is_physical())
            .map(Key::path)
            .collect();
        let count = paths.len();
        paths.sort_unstable();
        paths.dedup();
        assert_eq!(paths.len(), count);
    }

    #[test]
    fn a_slip_gets_the_name_that_was_meant() {
        for (slip, meant) in [
            ("omgea", "omega"),
            ("alhpa3", "alpha3"),
            ("contact_stifness", "contact_stiffness"),
            ("drive_freqency", "drive_frequency"),
            ("tip_mass", "tip_mass_ratio"),
            ("relaxation_tme", "relaxation_time"),
        ] {
            assert_eq!(ModelKind::Cantilever.key(slip), None, "{slip}");
            assert_eq!(ModelKind::Cantilever.near(slip), Some(meant), "{slip}");
        }
        for strange in ["", "temperature", "\u{0}", "ααα"] {
            assert_eq!(ModelKind::Cantilever.key(strange), None, "{strange}");
            assert_eq!(ModelKind::Cantilever.near(strange), None, "{strange}");
        }
    }

    #[test]
    fn what_says_the_same_does_so_both_ways() {
        for key in Key::all() {
            for (other, _) in key.alternatives() {
                assert!(
                    other.alternatives().any(|(back, _)| back == key),
                    "{key} {other}"
                );
            }
        }
    }

    #[test]
    fn parameters_of_formulas_stand_with_the_sample() {
        let key = |name, kind| Key::of_formula(name, kind).unwrap();
        let [modulus, other] = [Kind::Pressure, Kind::Force].map(|kind| key("parameters.E", kind));
        assert_eq!(key("parameters.E", Kind::Pressure), modulus);
        assert_ne!(modulus, other);
        assert_eq!(modulus.path(), "sample.parameters.E");
        assert_eq!(Section::Sample.keys().last(), Some(Key::LAST_OF_SAMPLE));
        assert!(modulus > Key::LAST_OF_SAMPLE && modulus < Key::DriveFrequency);
        for name in [
            "parameters.d",
            "parameters.2x",
            "parameters.",
            "parameter.E",
        ] {
            assert_eq!(Key::of_formula(name, Kind::Force), None, "{name}");
        }
    }

    #[test]
    fn a_range_has_its_ends_or_not() {
        assert!(!Range::POSITIVE.contains(0.0) && Range::NOT_NEGATIVE.contains(0.0));
        assert!(!Range::ANY.contains(f64::NAN) && !Range::ANY.contains(f64::INFINITY));
    }

    /// The entry of a number of a contact law is all that files, messages, mapping, documents and
    /// schema need.
    #[test]
    fn a_number_of_a_contact_law_is_one_entry() {
        let schema = crate::schema::schema().to_value();
        for law in ContactLaw::ALL {
            let numbers: Vec<Parameter> = Parameter::of_law(law).collect();
            let mut words = vec![
                "cantilever.k=2 N/m".to_owned(),
                "cantilever.f0=70 kHz".to_owned(),
                "cantilever.Q=200".to_owned(),
                format!("sample.law={law}"),
                "sample.stiffness=5 N/m".to_owned(),
                "drive.frequency=70 kHz".to_owned(),
                "drive.free_amplitude=10 nm".to_owned(),
                "gap.tip=8 nm".to_owned(),
            ];
            for &number in &numbers {
                let key = Key::stating(number).unwrap();
                words.push(format!("{key}={}", key.kind().example()));
            }
            let arms = "sample.relaxation_arms=[[\"1 us\", \"5 N/m\"]]".to_owned();
            let all = [&words[..], &vec![arms; usize::from(law.entry().arms)]].concat();
            let case = crate::Case::parse(None, &all).unwrap();
            let view = case.physical().unwrap();
            let document = crate::document::CaseDocument::of(&case);
            let document = serde_json::to_value(document).unwrap();
            for &number in &numbers {
                let (name, key) = (number.name(), Key::stating(number).unwrap());
                let expected = key.kind().parse(key.kind().example()).unwrap();
                assert_eq!(case.get(key), expected, "{key}");
                assert!(
                    (document["physical"][name].as_f64().unwrap() / expected - 1.0).abs() < 1e-14
                );
                assert_eq!(document[name].as_f64().unwrap(), case.get(Key::of(number)));
                let row = view
                    .mapping()
                    .into_iter()
                    .find(|row| row.parameter == number);
                assert!(!row.unwrap().formula.is_empty(), "{key}");
                for (table, key) in [("model", Key::of(number)), ("sample", key)] {
                    let described = &schema["properties"][table]["properties"][name];
                    assert_eq!(described["description"], key.meaning(), "{key}");
                    assert_eq!(case.key(key.path()).ok(), Some(key), "{key}");
                }
                assert!(case.to_toml().contains(&format!("\n{name} = ")), "{key}");
                // Any other law refuses it by name.
                let other = words.iter().filter(|word| !word.starts_with("sample.law"));
                let other: Vec<String> = other.cloned().collect();
                let refused = crate::Case::parse(None, &other).unwrap_err().to_string();
                assert!(refused.contains(law.name()), "{refused}");
            }
        }
    }
}
