//! Access to the stated quantities of a physical case.

use super::catalogue::{Catalogue, Lever, Material};
use super::elastic::Elastic;
use super::error::PhysicalError;
use crate::force_table::{ArmTable, ForceTable};
use crate::key::Key;
use crate::lever_modes::LeverModes;
use crate::stated::{Stated, Value};
use nanotap_model::drive_form::FrequencyRatio;

/// The stated values, and the catalogue for their names.
#[derive(Clone, Copy)]
pub(crate) struct Reader<'a> {
    pub(crate) stated: &'a Stated,
    pub(crate) catalogue: &'a Catalogue,
}

impl<'a> Reader<'a> {
    /// Whether a key is stated.
    pub(crate) fn has(self, key: Key) -> bool {
        self.stated.has(key)
    }

    /// A quantity in SI, within its range.
    pub(crate) fn number(self, key: Key) -> Result<Option<f64>, PhysicalError> {
        let Some(value) = self.stated.get(key) else {
            return Ok(None);
        };
        match key.objection(value) {
            None => Ok(self.stated.number(key)),
            Some(reason) => Err(self.impossible(key, reason)),
        }
    }

    /// The first of these keys that is stated, with its quantity in SI, within its range.
    pub(crate) fn first(self, keys: &[Key]) -> Result<Option<(Key, f64)>, PhysicalError> {
        let mut found = None;
        for &key in keys {
            found = found.or(self.number(key)?.map(|value| (key, value)));
        }
        Ok(found)
    }

    /// The word stated for a key; `None` if there is none.
    pub(crate) fn word(self, key: Key) -> Option<&'static str> {
        match self.stated.get(key)? {
            Value::Word(word) => Some(word),
            _ => None,
        }
    }

    /// The ratio of frequencies stated for a key; `None` if there is none.
    pub(crate) fn ratio(self, key: Key) -> Option<FrequencyRatio> {
        match self.stated.get(key)? {
            Value::Ratio(ratio) => Some(*ratio),
            _ => None,
        }
    }

    /// The rows of gap and force stated for a key; `None` if there are none.
    pub(crate) fn table(self, key: Key) -> Option<&'a ForceTable> {
        match self.stated.get(key)? {
            Value::Table(table) => Some(table),
            _ => None,
        }
    }

    /// The Maxwell arms stated for a key; `None` if there are none.
    pub(crate) fn arms(self, key: Key) -> Option<&'a ArmTable> {
        match self.stated.get(key)? {
            Value::Arms(arms) => Some(arms),
            _ => None,
        }
    }

    /// The measured modes of the lever; `None` if there are none.
    pub(crate) fn lever_modes(self) -> Option<&'a LeverModes> {
        match self.stated.get(Key::LeverModes)? {
            Value::LeverModes(modes) => Some(modes),
            _ => None,
        }
    }

    pub(crate) fn name(self, key: Key) -> Option<&'a str> {
        match self.stated.get(key)? {
            Value::Name(name) => Some(name),
            _ => None,
        }
    }

    /// The named lever of the catalogue.
    pub(crate) fn lever(self) -> Result<Option<&'a Lever>, PhysicalError> {
        let key = Key::LeverName;
        let find = |name| self.catalogue.lever(key, name);
        self.name(key).map(find).transpose()
    }

    /// The named material of the catalogue.
    pub(crate) fn material(self, key: Key) -> Result<Option<&'a Material>, PhysicalError> {
        let find = |name| self.catalogue.material(key, name);
        self.name(key).map(find).transpose()
    }

    /// The error for an impossible stated value.
    pub(crate) fn impossible(self, key: Key, reason: impl Into<String>) -> PhysicalError {
        PhysicalError::impossible(key, self.stated.written(key), reason)
    }

    /// The stated modulus and Poisson's ratio, completed from a material of the catalogue.
    pub(crate) fn elastic(
        self,
        [modulus_key, poisson_key]: [Key; 2],
        material: Option<&Material>,
    ) -> Result<Option<Elastic>, PhysicalError> {
        let modulus = self
            .number(modulus_key)?
            .or_else(|| material.map(|material| material.elastic.modulus));
        let poisson = self
            .number(poisson_key)?
            .or_else(|| material.map(|material| material.elastic.poisson));
        match (modulus, poisson) {
            (Some(modulus), Some(poisson)) => Ok(Some(Elastic { modulus, poisson })),
            (None, None) => Ok(None),
            (Some(_), None) => Err(PhysicalError::missing(
                poisson_key,
                "a contact needs Poisson's ratio in addition to the modulus (0.3 to 0.5 for polymers)",
            )),
            (None, Some(_)) => Err(PhysicalError::missing(
                modulus_key,
                "Poisson's ratio alone says nothing about the contact",
            )),
        }
    }
}
