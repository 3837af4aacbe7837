//! The same instrument over a sample that answers by another contact law.

use super::key::Key;
use super::physical::force::{keys_of_contacts, linear_takes, takes};
use super::stated::Value;
use super::{Case, CaseKind};
use crate::Error;
use crate::model::contact::ContactLaw;
use crate::model::sample_law::SampleLaw;

/// A contact law by its name: a linear contact, or nonlinear forces joined by `+`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LawName(Value);

impl LawName {
    /// The law that a text names.
    pub(crate) fn read(text: &str) -> Result<Self, Error> {
        let read = Key::SampleLaw.read(text);
        let law = read.map_err(|error| Error::input(error.to_string(), "name one of them"))?;
        Ok(Self(law))
    }

    /// The law's name.
    pub(crate) fn text(&self) -> String {
        self.0.text()
    }

    /// True if a key can be stated with this law.
    pub(crate) fn takes(&self, key: Key) -> bool {
        if !keys_of_contacts().any(|of_some| of_some == key) {
            return true;
        }
        let name = self.0.text();
        if let Ok(law) = name.parse::<ContactLaw>() {
            return linear_takes(law, key);
        }
        SampleLaw::terms(&name).is_ok_and(|terms| takes(&terms, key))
    }
}

impl Case {
    /// The same under another contact law: what that law does not take is left away, and what it
    /// needs and was not stated is taken from `more`.
    ///
    /// # Errors
    /// When the case is not a physical one, or does not say all that the law needs.
    pub(crate) fn under_law(&self, law: &LawName, more: &[(Key, f64)]) -> Result<Self, Error> {
        let CaseKind::Quantities(quantities) = &self.what else {
            return Err(Error::input(
                "contact laws are compared on cases in physical quantities",
                "state lever and sample by their quantities",
            ));
        };
        let mut quantities = quantities.clone();
        let stated = &mut quantities.stated;
        for key in keys_of_contacts().filter(|key| !law.takes(*key)) {
            stated.remove(key);
        }
        stated.put(Key::SampleLaw, law.0.clone());
        for (key, value) in more {
            let said = stated.has(*key) || key.alternatives().any(|(other, _)| stated.has(other));
            if law.takes(*key) && !said {
                stated.set(*key, *value);
            }
        }
        Ok(Self {
            what: CaseKind::Quantities(Box::new(quantities.mapped(true).validated()?)),
            ..self.clone()
        })
    }
}
