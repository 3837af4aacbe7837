//! The same instrument with a sample under another contact law.

use super::key::{Key, Takes};
use super::physical::drive::{FURTHER, ToneKeys};
use super::physical::force::{keys_of_contact, keys_of_contacts, linear_takes, takes, terms_with};
use super::quantity::Kind;
use super::stated::{Stated, Value};
use super::{Case, CaseKind};
use nanotap_error::Error;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::contact::ContactLaw;
use nanotap_model::parameter::{Applies, Parameter};
use nanotap_volterra::laws::TableLaw;

/// A contact law by its name: a linear contact, or nonlinear forces joined by `+`.
#[derive(Clone, Debug)]
pub struct LawName {
    name: Value,
    /// The nonlinear laws; none for a linear contact.
    terms: Vec<&'static TableLaw>,
}

impl PartialEq for LawName {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl LawName {
    /// The law that a text names.
    ///
    /// # Errors
    /// When no law has this name.
    pub fn read(text: &str) -> Result<Self, Error> {
        let read = Key::SampleLaw.read(text);
        let law = read.map_err(|error| Error::input(error.to_string(), "name one of them"))?;
        Ok(Self::with(law, &Stated::default()))
    }

    /// The law of this name, with the formula that is stated if it is one.
    fn with(name: Value, stated: &Stated) -> Self {
        let terms = match &name {
            Value::Name(names) => terms_with(stated, names).unwrap_or_default(),
            _ => Vec::new(),
        };
        Self { name, terms }
    }

    /// The law of a case; the first linear one if it names none.
    fn of(stated: &Stated) -> Self {
        let linear = || Value::Word(ContactLaw::ALL[0].name());
        let name = stated.get(Key::SampleLaw).cloned();
        Self::with(name.unwrap_or_else(linear), stated)
    }

    /// The name of the law, as in a case file.
    pub fn text(&self) -> String {
        self.name.text()
    }

    /// True if a key can be stated with this law.
    pub fn takes(&self, key: Key) -> bool {
        if !key.is_of_formula() && !keys_of_contacts().any(|of_some| of_some == key) {
            return true;
        }
        match &self.name {
            Value::Word(word) => word.parse().is_ok_and(|law| linear_takes(law, key)),
            _ => takes(&self.terms, key),
        }
    }
}

/// Changes of a case that takes another contact law.
#[derive(Clone, Debug, PartialEq)]
pub struct LawChange {
    /// Name of the new contact law.
    pub law: String,
    /// Stated keys that the new law does not take.
    pub dropped: Vec<Key>,
    /// Keys that the new law needs and that were not stated, with usual values.
    pub added: Vec<(Key, Value)>,
}

/// Usual force curve of a stiff sample with attraction: gap in nm, force in nN.
const CURVE: &str = "[[\"gap (nm)\", \"force (nN)\"], [-1, 20], [-0.5, 5], [0, -1.5], \
     [0.5, -0.6], [1, -0.3], [2, -0.1], [5, -0.02], [10, 0]]";

/// Usual formula: Hertz's, with the quantities that tip and sample have.
const FORMULA: &str = "4/3*E/(1 - nu^2)*sqrt(R)*max(-d, 0)^1.5";

/// Usual arms of a polymer: three, with times comparable to the period of tapping.
const ARMS: &str = "[[\"time (us)\", \"modulus (MPa)\"], [0.38, 460], [1.7, 136], [7.2, 67]]";

/// Usual arms with a stiffness in place of the modulus.
const SPRINGS: &str = "[[\"time (us)\", \"stiffness (N/m)\"], [0.5, 10], [4, 3]]";

/// Usual arms of a dimensionless case.
const MODEL_ARMS: &str = "[[\"time\", \"stiffness\"], [0.1, 20], [1, 5]]";

impl Case {
    /// Returns the keys to remove and the values to add for this case to take another contact law.
    /// An added value is that of `like` if it states one, otherwise a usual one.
    ///
    /// # Errors
    /// When the case is an oscillator, the law is unknown, or a sum of laws counts a part twice.
    pub fn law_change(&self, law: &str, like: &Self) -> Result<LawChange, Error> {
        let quantities = match &self.what {
            CaseKind::Quantities(quantities) => quantities,
            CaseKind::Cantilever(cantilever) => return contact_change(cantilever, law, like),
            CaseKind::Oscillator(_) => {
                return Err(Error::input(
                    "expected a cantilever, got an oscillator",
                    "an oscillator has a stop in place of a contact law",
                ));
            }
        };
        let name = LawName::read(law)?;
        let mut quantities = quantities.clone();
        // A formula tells what it takes: the stated one, that of `like`, or the usual one.
        let mut written = quantities.stated.clone();
        if name.takes(Key::SampleForce) && !written.has(Key::SampleForce) {
            let usual = usual(Key::SampleForce, like);
            let values = like.formula_keys().into_iter();
            let values = values.filter_map(|key| Some((key, like.stated(key)?.clone())));
            for (key, value) in usual
                .map(|text| (Key::SampleForce, text))
                .into_iter()
                .chain(values)
            {
                written.put(key, value);
            }
        }
        let name = LawName::with(name.name, &written);
        let stated = &mut quantities.stated;
        // What `like` states returns as soon as a law takes it again.
        let present = LawName::of(stated);
        let returns = |key: &Key| name.takes(*key) && !present.takes(*key);
        let of_like = keys_of_contacts().chain(like.formula_keys());
        let mut added: Vec<(Key, Value)> = of_like
            .filter(returns)
            .filter_map(|key| Some((key, like.stated(key)?.clone())))
            .collect();
        let replaced = |key: Key| {
            key.alternatives()
                .any(|(other, _)| added.iter().any(|(k, _)| *k == other))
        };
        let foreign = |key: &Key| stated.has(*key) && (!name.takes(*key) || replaced(*key));
        let dropped: Vec<Key> = keys_of_contact(stated).filter(foreign).collect();
        for key in &dropped {
            stated.remove(*key);
        }
        stated.put(Key::SampleLaw, name.name.clone());
        for (key, value) in &added {
            stated.put(*key, value.clone());
        }
        let mut mapped = quantities.mapped(true);
        // Each key that is missing is added once.
        while let Err(error) = &mapped.view {
            let named = error.problems.first().and_then(|problem| problem.key);
            let missing = named
                .and_then(Key::find)
                .filter(|key| !mapped.stated.has(*key));
            let Some((key, value)) = missing.and_then(|key| Some((key, usual(key, like)?))) else {
                return Err((**error).clone().into());
            };
            mapped.stated.put(key, value.clone());
            added.push((key, value));
            mapped = mapped.mapped(true);
        }
        Ok(LawChange {
            law: name.text(),
            dropped,
            added,
        })
    }

    /// Returns true if the contact law or the drive of the case does not have the key.
    pub fn is_foreign(&self, key: Key) -> bool {
        if let (CaseKind::Cantilever(cantilever), Some(parameter)) = (&self.what, key.parameter()) {
            // Numbers of measured modes and of Q control can always be stated.
            let free = parameter.entry().applies == Applies::NotZero;
            return !free && !cantilever.has(parameter);
        }
        let CaseKind::Quantities(quantities) = &self.what else {
            return false;
        };
        let stated = &quantities.stated;
        // Strength and phase of a further tone are nothing without its frequency.
        let of_tone = |keys: &&ToneKeys| keys.strength.contains(&key) || keys.phase == key;
        if let Some(keys) = FURTHER.iter().find(of_tone) {
            return !(stated.has(keys.frequency) || stated.has(keys.ratio));
        }
        !LawName::of(stated).takes(key)
    }

    /// The same case under another contact law. Keys that the law does not take are removed, and
    /// values that it needs and that were not stated are taken from `more`.
    ///
    /// # Errors
    /// When the case is not a physical one, or lacks a quantity that the law needs.
    pub fn under_law(&self, law: &LawName, more: &[(Key, f64)]) -> Result<Self, Error> {
        let CaseKind::Quantities(quantities) = &self.what else {
            return Err(Error::input(
                "contact laws are compared on cases in physical quantities",
                "state lever and sample by their quantities",
            ));
        };
        let mut quantities = quantities.clone();
        let stated = &mut quantities.stated;
        let foreign: Vec<Key> = keys_of_contact(stated)
            .filter(|key| !law.takes(*key))
            .collect();
        for key in foreign {
            stated.remove(key);
        }
        stated.put(Key::SampleLaw, law.name.clone());
        for (key, value) in more {
            let said = stated.has(*key) || key.alternatives().any(|(other, _)| stated.has(other));
            if law.takes(*key) && !said {
                stated.set(*key, *value);
            }
        }
        Ok(self.with_quantities(quantities.mapped(true).validated()?))
    }
}

/// The change of a dimensionless case to another linear contact.
fn contact_change(before: &Cantilever, law: &str, like: &Case) -> Result<LawChange, Error> {
    let unknown = |error: String| Error::input(error, "name one of them");
    let read = Key::Contact.read(law).map_err(|e| unknown(e.to_string()))?;
    let contact: ContactLaw = (read.text().parse()).map_err(|_| unknown(law.to_owned()))?;
    let after = Cantilever {
        contact,
        ..before.clone()
    };
    let like = like.cantilever();
    let (mut dropped, mut added) = (Vec::new(), Vec::new());
    for of in Parameter::every().filter(|of| before.has(*of) != after.has(*of)) {
        let (key, example) = (Key::of(of), of.entry().example);
        let stated = like.filter(|like| like.has(of)).map(|like| like.get(of));
        if before.has(of) {
            // A value that is the default may be stated, too.
            dropped.push(key);
        } else if stated.is_some() || key.default_under(contact).is_none() {
            added.push((key, Value::Number(stated.unwrap_or(example), Kind::Number)));
        }
    }
    let key = Key::RelaxationArms;
    match (before.contact.entry().arms, contact.entry().arms) {
        (true, false) => dropped.push(key),
        (false, true) => {
            let arms = like.map_or(&[][..], |like| &like.arms);
            let text = match arms {
                [] => MODEL_ARMS.to_owned(),
                arms => format!("[[\"time\", \"stiffness\"], {}", &format!("{arms:?}")[1..]),
            };
            let rows = key.entry().takes.parse_table(&text);
            added.push((key, rows.map_err(|error| unknown(error.to_string()))?));
        }
        _ => {}
    }
    Ok(LawChange {
        law: contact.name().to_owned(),
        dropped,
        added,
    })
}

/// A value of a key that a law needs: that of `like` if it states one, otherwise a usual one.
fn usual(key: Key, like: &Case) -> Option<Value> {
    if let Some(value) = like.stated(key) {
        return Some(value.clone());
    }
    match key.entry().takes {
        Takes::Quantity(kind) => Some(Value::Number(key.entry().example, kind)),
        Takes::Formula => Some(Value::Name(FORMULA.into())),
        takes @ Takes::Table => takes.parse_table(CURVE).ok(),
        takes @ Takes::Arms => takes.parse_table(ARMS).ok(),
        takes @ Takes::Springs => takes.parse_table(SPRINGS).ok(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stated::laws;

    /// A lever over a sample with a spring and a damper.
    fn lever() -> Case {
        let words = [
            "cantilever.k=2.8 N/m",
            "cantilever.f0=75 kHz",
            "cantilever.Q=200",
            "sample.stiffness=20 N/m",
            "sample.damping=1e-7 N s/m",
            "drive.frequency=75 kHz",
            "drive.free_amplitude=20 nm",
            "gap.tip=15 nm",
        ];
        Case::parse(None, &words.map(str::to_owned)).unwrap()
    }

    /// The case with the change made by `--set` words, as the explorer makes it.
    fn changed(case: &Case, change: &LawChange) -> Case {
        let dropped = change.dropped.iter().map(|key| format!("{key}="));
        let added = change
            .added
            .iter()
            .map(|(key, value)| format!("{key}={}", value.text()));
        let law = std::iter::once(format!("sample.law={}", change.law));
        let words: Vec<String> = dropped.chain(law).chain(added).collect();
        case.restated(&words).unwrap()
    }

    #[test]
    fn every_law_leads_to_every_law() {
        let first = lever();
        for law in laws() {
            let there = changed(&first, &first.law_change(law, &first).unwrap());
            let name = LawName::read(law).unwrap();
            assert!(there.model().is_ok(), "{law}");
            for key in keys_of_contacts().filter(|key| there.stated(*key).is_some()) {
                // Its text says what a formula takes.
                assert!(name.takes(key) || law == "formula", "{law}: {key}");
                assert!(!there.is_foreign(key), "{law}: {key}");
            }
            for next in laws() {
                let change = there.law_change(next, &first).unwrap();
                assert!(changed(&there, &change).model().is_ok(), "{law} to {next}");
            }
            // Back: what the first case stated returns.
            let back = changed(&there, &there.law_change("spring-damper", &first).unwrap());
            assert_eq!(back.get(Key::SampleStiffness), 20.0, "{law}");
        }
        let sum = first.law_change("hertz + capillary", &first).unwrap();
        assert_eq!(sum.dropped, [Key::SampleStiffness, Key::SampleDamping]);
        assert!(first.law_change("hertz + dmt", &first).is_err());
        assert!(first.law_change("plastic", &first).is_err());
    }

    #[test]
    fn every_contact_of_the_model_leads_to_every_contact() {
        let words = [
            "alpha1=0.1",
            "alpha2=0.1",
            "alpha3=0.1",
            "alpha4=20",
            "alpha6=0.2",
            "omega=3",
        ];
        let first = Case::parse(None, &words.map(str::to_owned)).unwrap();
        let changed = |case: &Case, contact: ContactLaw| {
            let change = case.law_change(contact.name(), &first).unwrap();
            let dropped = change.dropped.iter().map(|key| format!("{key}="));
            let added = (change.added.iter()).map(|(key, value)| format!("{key}={}", value.text()));
            let law = std::iter::once(format!("contact={}", change.law));
            let words: Vec<String> = dropped.chain(law).chain(added).collect();
            let there = case.restated(&words).unwrap();
            assert_eq!(there.cantilever().unwrap().contact, contact);
            assert!(there.model().is_ok(), "{contact:?}");
            there
        };
        for contact in ContactLaw::ALL {
            let there = changed(&first, contact);
            for next in ContactLaw::ALL {
                changed(&there, next);
            }
            // Back: what the first case stated returns.
            let back = changed(&there, first.cantilever().unwrap().contact);
            assert_eq!(back.cantilever(), first.cantilever(), "{contact:?}");
        }
        assert!(first.law_change("hertz", &first).is_err());
    }
}
