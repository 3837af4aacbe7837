//! A physical case of which some quantities vary: every value is mapped to the dimensionless
//! model anew, so that whatever hangs together changes together (the damper of a loss tangent
//! with the frequency, α4 with k, the tip's mass with f0).
//!
//! What an experimenter holds still is held still: the drive's own amplitude where only the
//! free amplitude was said and the frequency or the lever varies (a piezo keeps its voltage,
//! not the lever's answer), and the unit of length g₀, so that all values are told in one.
//! A quantity that varies takes the place of those that say the same (`drive.frequency` that
//! of `drive.frequency_ratio`).

use std::sync::{Arc, OnceLock};

use serde::{Serialize, Serializer};

use crate::case::file::{CaseFileError, PHYSICAL_KEYS, PhysicalTables};
use crate::case::near_name::near_name;
use crate::case::physical::{Catalogue, Kind, Quantity, QuantityError, Resolved};
use crate::model::cantilever::Cantilever;
use crate::model::parameter::Parameter;

/// A quantity of a physical case, `section.key`, and what it measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PhysicalKey {
    section: &'static str,
    key: &'static str,
    path: &'static str,
    /// What its values measure; numbers without a unit unless a value said otherwise.
    kind: Kind,
}

/// Every key of a physical case by its path.
fn table() -> &'static [PhysicalKey] {
    static TABLE: OnceLock<Vec<PhysicalKey>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let keys = |(section, keys): &(&'static str, &'static [&'static str])| {
            let section = *section;
            keys.iter()
                .map(move |key| PhysicalKey {
                    section,
                    key,
                    path: String::leak(format!("{section}.{key}")),
                    kind: Kind::Number,
                })
                .collect::<Vec<_>>()
        };
        PHYSICAL_KEYS.iter().flat_map(keys).collect()
    })
}

/// Names that are no quantities.
const WORDS: [&str; 8] = [
    "cantilever.lever",
    "tip.material",
    "tip.shape",
    "sample.material",
    "sample.law",
    "drive.actuation",
    "drive.second_ratio",
    "drive.setpoint",
];

impl PhysicalKey {
    /// The key that is written `section.key`; `None` if there is none.
    pub fn find(path: &str) -> Option<Self> {
        table().iter().find(|key| key.path == path).copied()
    }

    /// Every key that can vary.
    pub fn all() -> impl Iterator<Item = Self> {
        table()
            .iter()
            .filter(|key| !WORDS.contains(&key.path))
            .copied()
    }

    /// Its path, `section.key`.
    pub const fn path(self) -> &'static str {
        self.path
    }

    /// What its values measure.
    pub const fn kind(self) -> Kind {
        self.kind
    }

    /// The same key and the SI value that `text` says, its dimension taken as that of the key.
    ///
    /// # Errors
    /// When the text is no quantity.
    pub fn read(self, text: &str) -> Result<(Self, f64), QuantityError> {
        let quantity: Quantity = text.parse()?;
        let kind = quantity.dimension.kind().unwrap_or(Kind::Number);
        let value = kind.parse(text)?;
        Ok((Self { kind, ..self }, value))
    }
}

/// Free amplitudes of the drive's tones, what moves the lever instead (a motion of its base or
/// a force on it), and the parameter that this becomes.
const DRIVES: [(&str, [&str; 2], &str); 2] = [
    (
        "drive.free_amplitude",
        ["drive.amplitude", "drive.force"],
        "alpha2",
    ),
    (
        "drive.second_free_amplitude",
        ["drive.second_amplitude", "drive.second_force"],
        "tone2_amplitude",
    ),
];

/// Keys that say the same thing as another, which steps back when that one varies.
const ALTERNATIVES: [(&str, &[&str]); 13] = [
    ("drive.frequency", &["drive.frequency_ratio"]),
    ("drive.frequency_ratio", &["drive.frequency"]),
    ("drive.amplitude", &["drive.free_amplitude"]),
    ("drive.force", &["drive.free_amplitude"]),
    ("drive.free_amplitude", &["drive.amplitude", "drive.force"]),
    ("drive.second_frequency", &["drive.second_ratio"]),
    ("drive.second_ratio", &["drive.second_frequency"]),
    ("drive.second_amplitude", &["drive.second_free_amplitude"]),
    ("drive.second_force", &["drive.second_free_amplitude"]),
    (
        "drive.second_free_amplitude",
        &["drive.second_amplitude", "drive.second_force"],
    ),
    ("sample.damping", &["sample.loss_tangent"]),
    ("sample.loss_tangent", &["sample.damping"]),
    (
        "sample.stiffness",
        &[
            "sample.material",
            "sample.modulus",
            "sample.poisson",
            "sample.indentation",
        ],
    ),
];

/// A physical case as it was written, with the catalogue that its names are from.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalSource {
    /// The case.
    pub tables: PhysicalTables,
    /// The catalogue.
    pub catalogue: Arc<Catalogue>,
}

impl PhysicalSource {
    /// The model's parameters and units.
    ///
    /// # Errors
    /// What is wrong with the quantities.
    pub fn resolve(&self) -> Result<Resolved, CaseFileError> {
        self.tables.resolve(&self.catalogue)
    }

    /// The same with a quantity set, and without those that say the same.
    #[must_use]
    pub fn with(&self, key: PhysicalKey, value: f64) -> Self {
        let mut tables = self.tables.clone();
        tables.set(key.section, key.key, &key.kind.format_exact(value));
        for (path, others) in ALTERNATIVES {
            if path == key.path {
                for other in others.iter().filter_map(|path| PhysicalKey::find(path)) {
                    tables.remove(other.section, other.key);
                }
            }
        }
        Self {
            tables,
            catalogue: Arc::clone(&self.catalogue),
        }
    }

    fn has(&self, path: &str) -> bool {
        PhysicalKey::find(path).is_some_and(|key| self.tables.get(key.section, key.key).is_some())
    }

    /// The value of a key in SI, as it was written.
    fn get(&self, key: PhysicalKey) -> Option<f64> {
        let entry = self.tables.get(key.section, key.key)?;
        key.read(entry.text()?.as_str())
            .ok()
            .map(|(_, value)| value)
    }
}

/// A quantity that cannot vary.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum VaryError {
    /// An unknown name.
    #[error("`{given}` is no quantity of a physical case{hint}")]
    Unknown {
        /// What was given.
        given: String,
        /// The nearest name, or all of them.
        hint: String,
    },
    /// A name that says no quantity.
    #[error("`{given}` cannot vary: {reason}")]
    Fixed {
        /// What was given.
        given: String,
        /// Why not, and what can.
        reason: &'static str,
    },
}

/// Finds a quantity that can vary.
///
/// # Errors
/// [`VaryError`] with the nearest name.
pub fn varying_key(path: &str) -> Result<PhysicalKey, VaryError> {
    if path == "drive.setpoint" {
        return Err(VaryError::Fixed {
            given: path.to_owned(),
            reason: "each setpoint has its own distance; vary gap.tip, or see A/A0 in the curve \
                     of `nanotap approach`",
        });
    }
    if WORDS.contains(&path) {
        return Err(VaryError::Fixed {
            given: path.to_owned(),
            reason: "it is a name, not a quantity",
        });
    }
    PhysicalKey::find(path).ok_or_else(|| {
        let all: Vec<&str> = PhysicalKey::all().map(PhysicalKey::path).collect();
        let hint = near_name(path, all.iter().copied()).map_or_else(
            || format!("; there are {}", all.join(", ")),
            |name| format!(" (did you mean `{name}`?)"),
        );
        VaryError::Unknown {
            given: path.to_owned(),
            hint,
        }
    })
}

/// A physical case with quantities that vary.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalSubject {
    source: PhysicalSource,
    /// The quantities that were set.
    set: Vec<(PhysicalKey, f64)>,
    resolved: Result<Box<Resolved>, Box<CaseFileError>>,
}

impl PhysicalSubject {
    /// The case `source`, resolved as `base`, of which the quantities called `paths` are to
    /// vary.
    ///
    /// # Errors
    /// [`VaryError`] if one of them is none that can.
    pub fn new(
        source: &PhysicalSource,
        base: &Resolved,
        paths: &[&str],
    ) -> Result<Self, VaryError> {
        let keys = paths
            .iter()
            .map(|path| varying_key(path))
            .collect::<Result<Vec<_>, _>>()?;
        let varies = |path: &str| keys.iter().any(|key| key.path == path);
        let lever_varies = keys.iter().any(|key| {
            matches!(key.section, "cantilever" | "tip") || key.path.starts_with("drive.frequency")
        });
        let mut held = source.clone();
        let mut hold = |path: &str, kind: Kind, value: f64| {
            if let Some(key) = PhysicalKey::find(path)
                && !varies(path)
            {
                held = held.with(PhysicalKey { kind, ..key }, value);
            }
        };
        hold("gap.beam", Kind::Length, base.scales.length);
        hold("gap.tip", Kind::Length, base.parameters.tip_gap);
        for (free, own, parameter) in DRIVES {
            let rows = base.mapping();
            let row = rows.iter().find(|row| row.parameter.name() == parameter);
            let Some(row) = row.filter(|_| lever_varies && source.has(free) && !varies(free))
            else {
                continue;
            };
            let path = own[usize::from(row.kind == Kind::Force)];
            hold(path, row.kind, row.si);
        }
        if let Some(ratio) = base.case.tone2_ratio
            && source.has("drive.second_frequency")
            && !varies("drive.second_frequency")
        {
            // The second tone keeps its place among the harmonics of the first.
            held.tables.remove("drive", "second_frequency");
            held.tables.set("drive", "second_ratio", &ratio.to_string());
        }
        // The distance stands for it.
        held.tables.remove("drive", "setpoint");
        Ok(Self {
            resolved: held.resolve().map(Box::new).map_err(Box::new),
            source: held,
            set: Vec::new(),
        })
    }

    /// The case with the values that were set last.
    ///
    /// # Errors
    /// What is wrong with these values.
    pub fn resolved(&self) -> Result<&Resolved, CaseFileError> {
        self.resolved.as_deref().map_err(|error| (**error).clone())
    }

    /// The value of a quantity in SI; NaN if it is not known.
    pub fn get(&self, key: PhysicalKey) -> f64 {
        let set = self.set.iter().find(|(k, _)| k.path == key.path);
        set.map(|(_, value)| *value)
            .or_else(|| self.source.get(key))
            .or_else(|| self.inferred(key))
            .unwrap_or(f64::NAN)
    }

    /// The value of a quantity that was not written but follows from what was.
    fn inferred(&self, key: PhysicalKey) -> Option<f64> {
        let resolved = self.resolved().ok()?;
        let parameters = &resolved.parameters;
        Some(match key.path {
            "cantilever.k" => resolved.lever.k,
            "cantilever.f0" => resolved.lever.f0,
            "tip.mass" => parameters.tip_mass,
            "tip.mass_ratio" => resolved.lever.tip_mass_ratio,
            "sample.stiffness" => parameters.contact_stiffness,
            "sample.damping" => parameters.contact_damping,
            "drive.frequency" => parameters.drive_frequency,
            "drive.frequency_ratio" => parameters.drive_frequency / resolved.lever.f0,
            "drive.amplitude" | "drive.force" => parameters.drive_amplitude,
            "drive.free_amplitude" => resolved.free_amplitude,
            _ => return None,
        })
    }

    /// The same with one quantity changed.
    #[must_use]
    pub fn with(&self, key: PhysicalKey, value: f64) -> Self {
        let source = self.source.with(key, value);
        let mut set = self.set.clone();
        set.retain(|(k, _)| k.path != key.path);
        set.push((key, value));
        Self {
            resolved: source.resolve().map(Box::new).map_err(Box::new),
            source,
            set,
        }
    }

    /// The same with another number of modes.
    #[must_use]
    pub fn with_modes(&self, modes: usize) -> Self {
        let mut source = self.source.clone();
        source.tables.modes = modes;
        Self {
            resolved: source.resolve().map(Box::new).map_err(Box::new),
            source,
            set: self.set.clone(),
        }
    }

    /// How the parameters of the dimensionless model change with a quantity: those that do,
    /// each with its derivative, by central differences.
    ///
    /// # Errors
    /// What is wrong with the values.
    pub fn derivatives(&self, key: PhysicalKey) -> Result<Vec<(Parameter, f64)>, CaseFileError> {
        let here = self.resolved()?;
        let value = self.get(key);
        // Where the mapping is smooth its third derivative is of order 1/value³, so that
        // this step balances truncation and rounding.
        let size = if value == 0.0 {
            self.scale_of(key)
        } else {
            value.abs()
        };
        let step = 1e-5 * size;
        let at = |value: f64| -> Result<Cantilever, CaseFileError> {
            Ok(self.with(key, value).resolved()?.case.clone())
        };
        let (low, high, width) = match (at(value - step), at(value + step)) {
            (Ok(low), Ok(high)) => (low, high, 2.0 * step),
            // At the edge of what makes sense, on one side.
            (Err(_), Ok(high)) => (here.case.clone(), high, step),
            (Ok(low), Err(_)) => (low, here.case.clone(), step),
            (Err(error), Err(_)) => return Err(error),
        };
        Ok(Parameter::every()
            .map(|p| (p, (high.get(p) - low.get(p)) / width))
            .filter(|(_, slope)| *slope != 0.0)
            .collect())
    }

    /// A size of a quantity that is zero.
    fn scale_of(&self, key: PhysicalKey) -> f64 {
        let Ok(resolved) = self.resolved() else {
            return 1.0;
        };
        let scales = &resolved.scales;
        match key.kind {
            Kind::Length => resolved.free_amplitude.max(1e-3 * scales.length),
            Kind::Mass => scales.mass,
            Kind::Stiffness => scales.stiffness,
            Kind::Damping => scales.damping,
            Kind::Frequency => scales.frequency,
            _ => 1.0,
        }
    }
}

impl Serialize for PhysicalSubject {
    /// The quantities as they were written or set, by `section.key`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeMap as _;
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("modes", &self.source.tables.modes)?;
        for ((section, key), entry) in &self.source.tables.entries {
            map.serialize_entry(&format!("{section}.{key}"), &entry.text())?;
        }
        map.end()
    }
}

impl From<VaryError> for crate::Error {
    fn from(error: VaryError) -> Self {
        Self::input(
            error.to_string(),
            "name a quantity of the case file as section.key, as in drive.frequency",
        )
    }
}
