//! Levers and materials by name, from `catalogue.toml` in this folder and from users' files in the
//! same format:
//!
//! ```toml
//! [lever."my lever"]
//! k = "2.4 N/m"
//! f0 = "71 kHz"
//! tip_radius = "12 nm"
//! source = "calibrated by thermal noise on 3 May"
//!
//! [material.gelatin]
//! modulus = "20 kPa"
//! poisson = 0.5
//! source = "own indentation"
//! ```

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::{Arc, LazyLock};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::beam_geometry::BeamGeometry;
use super::elastic::Elastic;
use super::error::PhysicalError;
use crate::input::{self, MAX_CASE_BYTES, Origin};
use crate::key::Key;
use crate::near_name::near_names;
use crate::quantity::Kind;

/// A lever as in its data sheet. The quality factor is not included, because it depends on the
/// medium.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Lever {
    /// Name of the lever in the catalogue.
    pub name: String,
    /// Alternative names of the lever.
    pub aliases: Vec<String>,
    /// Spring constant of the lever, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub k: f64,
    /// First free resonance with the tip, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub f0: f64,
    /// Dimensions of the beam, m; `None` if they are unknown.
    #[serde(flatten)]
    pub geometry: Option<BeamGeometry>,
    /// Radius of the tip's apex, m; `None` if it is unknown.
    pub tip_radius: Option<f64>,
    /// Height of the tip, m; `None` if it is unknown.
    pub tip_height: Option<f64>,
    /// Source of the numbers, such as a data sheet or a calibration.
    pub source: String,
}

/// A material of samples and tips.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Material {
    /// Name of the material in the catalogue.
    pub name: String,
    /// Alternative names of the material.
    pub aliases: Vec<String>,
    /// Young's modulus and Poisson's ratio.
    #[serde(flatten)]
    pub elastic: Elastic,
    /// Density, kg/m³, if tips are made of the material.
    pub density: Option<f64>,
    /// Source of the numbers, such as a publication or a measurement.
    pub source: String,
}

/// A catalogue that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("catalogue {origin}: {reason}")]
pub struct CatalogueError {
    /// The file, with the entry and key at fault, if any.
    pub origin: String,
    /// What is wrong in the file or entry.
    pub reason: String,
}

impl CatalogueError {
    fn new(origin: impl Into<String>, reason: impl fmt::Display) -> Self {
        Self {
            origin: origin.into(),
            reason: reason.to_string(),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    lever: BTreeMap<String, LeverText>,
    #[serde(default)]
    material: BTreeMap<String, MaterialText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LeverText {
    #[serde(default)]
    aliases: Vec<String>,
    k: String,
    f0: String,
    length: Option<String>,
    width: Option<String>,
    thickness: Option<String>,
    tip_radius: Option<String>,
    tip_height: Option<String>,
    source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialText {
    #[serde(default)]
    aliases: Vec<String>,
    modulus: String,
    poisson: f64,
    density: Option<String>,
    source: String,
}

/// Levers and materials by name. Names are compared without regard to case, spaces, hyphens
/// and underscores.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Catalogue {
    levers: BTreeMap<String, Lever>,
    materials: BTreeMap<String, Material>,
}

impl Catalogue {
    /// The built-in levers and materials.
    ///
    /// # Errors
    /// None as shipped, as a test verifies; [`CatalogueError`] if the file in the source tree is
    /// edited and invalid.
    pub fn builtin() -> Result<Self, CatalogueError> {
        let mut catalogue = Self::default();
        catalogue.extend(include_str!("catalogue.toml"), "built in")?;
        Ok(catalogue)
    }

    /// The built-in catalogue, parsed once.
    pub fn shared() -> Arc<Self> {
        static BUILTIN: LazyLock<Arc<Catalogue>> =
            LazyLock::new(|| Arc::new(Catalogue::builtin().unwrap_or_default()));
        Arc::clone(&BUILTIN)
    }

    /// Adds the entries of a TOML text; entries of the same name are replaced. `origin` names
    /// it in messages.
    ///
    /// # Errors
    /// [`CatalogueError`] names the entry and key at fault; nothing is added then.
    pub fn extend(&mut self, text: &str, origin: &str) -> Result<(), CatalogueError> {
        let file: File = toml::from_str(text)
            .map_err(|error| CatalogueError::new(origin, error.to_string().trim_end()))?;
        let mut added = Self::default();
        for (name, text) in file.lever {
            let lever = text.read(name, origin)?;
            added.levers.insert(folded(&lever.name), lever);
        }
        for (name, text) in file.material {
            let material = text.read(name, origin)?;
            added.materials.insert(folded(&material.name), material);
        }
        self.levers.extend(added.levers);
        self.materials.extend(added.materials);
        Ok(())
    }

    /// Adds the entries of a TOML file, as [`Catalogue::extend`].
    ///
    /// # Errors
    /// [`CatalogueError`] if the file cannot be opened or read.
    pub fn extend_from_file(&mut self, path: &Path) -> Result<(), CatalogueError> {
        let origin = path.display().to_string();
        let text = input::text(path, MAX_CASE_BYTES, Origin::User)
            .map_err(|error| CatalogueError::new(&*origin, error.fault))?;
        self.extend(&text, &origin)
    }

    /// Returns all levers, sorted by name.
    pub fn levers(&self) -> impl Iterator<Item = &Lever> {
        self.levers.values()
    }

    /// Returns all materials, sorted by name.
    pub fn materials(&self) -> impl Iterator<Item = &Material> {
        self.materials.values()
    }

    /// The lever called `name`; `key` is named in errors.
    ///
    /// # Errors
    /// [`PhysicalError::UnknownName`] with the nearest name.
    pub fn lever(&self, key: Key, name: &str) -> Result<&Lever, PhysicalError> {
        find(&self.levers, name, |lever| &lever.aliases).ok_or_else(|| {
            let all = self.levers().map(|lever| (&lever.name, &lever.aliases));
            unknown(key, name, "lever", all)
        })
    }

    /// The material called `name`; `key` is named in errors.
    ///
    /// # Errors
    /// [`PhysicalError::UnknownName`] with the nearest name.
    pub fn material(&self, key: Key, name: &str) -> Result<&Material, PhysicalError> {
        find(&self.materials, name, |material| &material.aliases).ok_or_else(|| {
            let all = self
                .materials()
                .map(|material| (&material.name, &material.aliases));
            unknown(key, name, "material", all)
        })
    }
}

/// The entry with a name or alias.
fn find<'a, T>(
    entries: &'a BTreeMap<String, T>,
    name: &str,
    aliases: impl Fn(&T) -> &Vec<String>,
) -> Option<&'a T> {
    let wanted = folded(name);
    let answers = |entry: &&T| aliases(entry).iter().any(|alias| folded(alias) == wanted);
    entries
        .get(&wanted)
        .or_else(|| entries.values().find(answers))
}

fn unknown<'a>(
    key: Key,
    name: &str,
    what: &'static str,
    known: impl Iterator<Item = (&'a String, &'a Vec<String>)>,
) -> PhysicalError {
    let (names, aliases): (Vec<&str>, Vec<&Vec<String>>) = known
        .map(|(name, aliases)| (name.as_str(), aliases))
        .unzip();
    let candidates = names
        .iter()
        .copied()
        .chain(aliases.into_iter().flatten().map(String::as_str));
    let suggestion = match near_names(name, candidates).first() {
        Some(near) => format!("did you mean \"{near}\"?"),
        None => format!("known are {}", names.join(", ")),
    };
    PhysicalError::UnknownName {
        key,
        name: name.to_owned(),
        what,
        suggestion,
    }
}

/// The form of a name for comparison: lower case, letters and digits only.
fn folded(name: &str) -> String {
    name.chars()
        .filter(|c| !matches!(c, ' ' | '-' | '_'))
        .flat_map(char::to_lowercase)
        .collect()
}

/// Reads the quantities of one entry.
struct EntryReader<'a> {
    origin: &'a str,
    entry: &'a str,
}

impl EntryReader<'_> {
    fn positive(&self, key: &str, text: &str, kind: Kind) -> Result<f64, CatalogueError> {
        match kind.parse(text) {
            Ok(value) if value > 0.0 => Ok(value),
            Ok(_) => Err(self.impossible(key, "it must be above zero")),
            Err(error) => Err(self.impossible(key, error)),
        }
    }

    fn optional(
        &self,
        key: &str,
        text: Option<&str>,
        kind: Kind,
    ) -> Result<Option<f64>, CatalogueError> {
        text.map(|text| self.positive(key, text, kind)).transpose()
    }

    fn impossible(&self, key: &str, reason: impl fmt::Display) -> CatalogueError {
        CatalogueError::new(format!("{}, {}.{key}", self.origin, self.entry), reason)
    }
}

impl LeverText {
    fn read(self, name: String, origin: &str) -> Result<Lever, CatalogueError> {
        let reader = EntryReader {
            origin,
            entry: &name,
        };
        let length = reader.optional("length", self.length.as_deref(), Kind::Length)?;
        let width = reader.optional("width", self.width.as_deref(), Kind::Length)?;
        let thickness = reader.optional("thickness", self.thickness.as_deref(), Kind::Length)?;
        let geometry = match (length, width, thickness) {
            (Some(length), Some(width), Some(thickness)) => Some(BeamGeometry {
                length,
                width,
                thickness,
            }),
            (None, None, None) => None,
            _ => {
                return Err(reader.impossible(
                    "length",
                    "length, width and thickness are given together or not at all",
                ));
            }
        };
        Ok(Lever {
            k: reader.positive("k", &self.k, Kind::Stiffness)?,
            f0: reader.positive("f0", &self.f0, Kind::Frequency)?,
            geometry,
            tip_radius: reader.optional("tip_radius", self.tip_radius.as_deref(), Kind::Length)?,
            tip_height: reader.optional("tip_height", self.tip_height.as_deref(), Kind::Length)?,
            aliases: self.aliases,
            source: self.source,
            name,
        })
    }
}

impl MaterialText {
    fn read(self, name: String, origin: &str) -> Result<Material, CatalogueError> {
        let reader = EntryReader {
            origin,
            entry: &name,
        };
        let modulus = reader.positive("modulus", &self.modulus, Kind::Pressure)?;
        if !(self.poisson > -1.0 && self.poisson <= 0.5) {
            return Err(reader.impossible(
                "poisson",
                "Poisson's ratio of a stable solid lies above -1 and not above 0.5",
            ));
        }
        Ok(Material {
            elastic: Elastic {
                modulus,
                poisson: self.poisson,
            },
            density: reader.optional("density", self.density.as_deref(), Kind::Density)?,
            aliases: self.aliases,
            source: self.source,
            name,
        })
    }
}

impl From<CatalogueError> for nanotap_error::Error {
    fn from(error: CatalogueError) -> Self {
        Self::input(error.to_string(), "mend it, or leave {catalogue} out")
    }
}
