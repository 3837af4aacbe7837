//! The nonlinear force law of a sample, from stated quantities.

use std::f64::consts::PI;
use std::sync::Arc;

use nanotap_formula::FormulaError;
use nanotap_volterra::VolterraError;
use nanotap_volterra::laws::curve::Interpolation;
use nanotap_volterra::laws::entry::{CONTACT_DISTANCE, CaseKey, ParameterEntry};
use nanotap_volterra::laws::prony::Arms;
use nanotap_volterra::laws::table::Rows;
use nanotap_volterra::laws::{self, TableLaw, adhesion, written};

use super::elastic::Elastic;
use super::error::PhysicalError;
use super::mapping::Scales;
use super::reader::Reader;
use super::remark::Remark;
use super::sample::reduced_modulus;
use super::tip::Tip;
use crate::force_table::{ArmTable, ForceTable};
use crate::key::{Key, Laws};
use crate::quantity::Kind;
use crate::stated::{Stated, Value};
use nanotap_model::contact::ContactLaw;
use nanotap_model::parameter::Applies;
use nanotap_model::sample_law::SampleLaw;

/// A law, or a sum of laws, with its parameters in SI.
#[derive(Debug, Clone)]
pub struct SampleForce {
    /// Laws whose forces add up.
    pub terms: Vec<&'static TableLaw>,
    /// Values of the laws' parameters in SI, law by law in the order of their tables.
    pub values: Vec<f64>,
    /// The rows of a table, in m and N.
    pub table: Option<ForceTable>,
    /// The arms of a sample that relaxes, in s and Pa.
    pub arms: Option<ArmTable>,
}

impl PartialEq for SampleForce {
    fn eq(&self, other: &Self) -> bool {
        self.values == other.values
            && self.table == other.table
            && self.arms == other.arms
            && self.terms.len() == other.terms.len()
            && (self.terms.iter().zip(&other.terms)).all(|(a, b)| std::ptr::eq(a.entry, b.entry))
    }
}

/// The keys that belong to nonlinear laws only, or to some laws.
fn keys_of(laws: Laws) -> impl Iterator<Item = Key> {
    Key::all().filter(move |key| key.entry().laws == laws)
}

/// The keys that belong to some contact laws only.
pub(crate) fn keys_of_contacts() -> impl Iterator<Item = Key> {
    keys_of(Laws::Nonlinear).chain(keys_of(Laws::Some))
}

/// The keys of [`keys_of_contacts`], and those of a formula's parameters that are stated.
pub(crate) fn keys_of_contact(stated: &Stated) -> impl Iterator<Item = Key> {
    let parameters = stated.iter().map(|(key, _)| key);
    keys_of_contacts().chain(parameters.filter(|key| key.is_of_formula()))
}

/// True if these nonlinear laws have a key of [`keys_of_contact`]. Before the text of a formula is
/// known, any parameter may belong to it.
pub(crate) fn takes(terms: &[&'static TableLaw], key: Key) -> bool {
    if key.is_of_formula() && terms.iter().any(|term| term.needs_formula()) {
        return true;
    }
    let mut parameters = terms.iter().flat_map(|term| term.entry.parameters);
    let mut keys = terms.iter().flat_map(|term| term.entry.keys());
    parameters.clone().any(|p| key_of(p) == key)
        || keys.any(|own| Key::of_law(&own) == Some(key))
        || [Key::SampleTable, Key::SampleInterpolation].contains(&key)
            && terms.iter().any(|term| term.has_rows())
        || key == Key::SampleArms && terms.iter().any(|term| term.has_arms())
        || key == Key::SampleForce
            && terms
                .iter()
                .any(|term| term.needs_formula() || term.text().is_some())
        || key == Key::SampleMaterial && parameters.any(|p| p.name == "modulus")
}

/// True if a linear contact has a key of [`keys_of_contacts`].
pub(crate) fn linear_takes(law: ContactLaw, key: Key) -> bool {
    if let Some(number) = key.law_number() {
        return number.entry().applies == Applies::Law(law);
    }
    match key {
        Key::SampleDamping | Key::SampleLossTangent => law.has_damper(),
        Key::SampleRelaxationArms => law.entry().arms,
        _ => key.entry().laws == Laws::Some,
    }
}

/// The nonlinear laws with a key.
fn laws_with(key: Key) -> Vec<&'static str> {
    let with = |law: &&'static TableLaw| takes(std::slice::from_ref(law), key);
    laws::all().filter(with).map(|law| law.entry.name).collect()
}

/// Why a key has no effect under a linear law.
fn belongs_to(key: Key) -> String {
    match &laws_with(key)[..] {
        [] => "it belongs to a nonlinear force law".to_owned(),
        [law] => format!("it belongs to sample.law = \"{law}\""),
        laws => format!(
            "it belongs to a nonlinear force law (laws with it: {})",
            laws.join(", ")
        ),
    }
}

/// The key that states a parameter of a law.
fn key_of(parameter: &ParameterEntry) -> Key {
    // A test sees that every parameter has its key.
    Key::of_law_parameter(parameter).unwrap_or(Key::SampleLaw)
}

/// The factor from the key's own unit to SI.
fn unit(parameter: &ParameterEntry) -> f64 {
    match parameter.key {
        CaseKey::Own(key) => key.multiple_of.unwrap_or(1.0),
        CaseKey::Body(_) => 1.0,
    }
}

/// True if these laws have a formula, which need not use each quantity that could be in it: while one is
/// being written some are left over.
fn may_be_unused(terms: &[&'static TableLaw], key: Key) -> bool {
    let known = || written::KNOWN.iter().any(|(_, p)| key_of(p) == key);
    terms.iter().any(|term| term.text().is_some()) && (key.is_of_formula() || known())
}

/// The law of a formula with the stated parameters.
fn formula_with(stated: &Stated, text: &str) -> Result<&'static TableLaw, FormulaError> {
    let keys = keys_of_contact(stated).filter(|key| key.is_of_formula());
    let parameters: Vec<_> = keys
        .filter_map(|key| {
            let parameter = key.name().strip_prefix(written::PARAMETERS)?;
            Some((parameter, key.kind().dimension()))
        })
        .collect();
    written::law(text, &parameters)
}

/// The laws that a text names, with the stated formula if it is one and can be read.
pub(crate) fn terms_with(stated: &Stated, name: &str) -> Option<Vec<&'static TableLaw>> {
    let mut terms = SampleLaw::terms(name).ok()?;
    if let (Some(term), Some(Value::Name(text))) = (
        terms.iter_mut().find(|term| term.needs_formula()),
        stated.get(Key::SampleForce),
    ) && let Ok(formula) = formula_with(stated, text)
    {
        *term = formula;
    }
    Some(terms)
}

/// The laws with the stated formula in place of the entry that stands for any.
fn with_formula(
    reader: Reader<'_>,
    name: &str,
    mut terms: Vec<&'static TableLaw>,
) -> Result<Vec<&'static TableLaw>, PhysicalError> {
    let mut unknown = terms.iter_mut().filter(|term| term.needs_formula());
    let Some(term) = unknown.next() else {
        return Ok(terms);
    };
    if unknown.next().is_some() {
        let reason = "write the sum of two formulas as one";
        return Err(PhysicalError::impossible(Key::SampleLaw, name, reason));
    }
    let text = reader.name(Key::SampleForce).ok_or_else(|| {
        let reason = format!(
            "sample.law = \"{name}\" needs its formula, as in force = \"k*max(-d, 0) - c*v\" with the \
             parameters under [sample.parameters]"
        );
        PhysicalError::missing(Key::SampleForce, reason)
    })?;
    *term = formula_with(reader.stated, text)
        .map_err(|error| reader.impossible(Key::SampleForce, error.to_string()))?;
    Ok(terms)
}

impl SampleForce {
    /// Reads `[sample]` if its law is nonlinear.
    pub(crate) fn read(reader: Reader<'_>, tip: &Tip) -> Result<Option<Self>, PhysicalError> {
        let Some(name) = reader.name(Key::SampleLaw) else {
            let law = crate::file::word(reader.stated, Key::SampleLaw).unwrap_or_default();
            let strange = |key: &Key| reader.has(*key) && !linear_takes(law, *key);
            let parameters = keys_of_contact(reader.stated).filter(|key| key.is_of_formula());
            return keys_of(Laws::Nonlinear).chain(parameters).find(strange).map_or(Ok(None), |key| {
                let reason = if let Some(number) = key.law_number() {
                    let others = ContactLaw::ALL.map(|law| (law, Applies::Law(law)));
                    let other = others.iter().find(|(_, of)| number.entry().applies == *of);
                    let other = other.map_or("", |(law, _)| law.name());
                    format!("it belongs to a law with adhesion, as sample.law = \"dmt\" or \"{other}\"")
                } else if key == Key::SampleRelaxationArms {
                    let law = ContactLaw::GeneralisedMaxwell;
                    format!("it belongs to sample.law = \"{law}\"")
                } else {
                    belongs_to(key)
                };
                Err(reader.impossible(key, reason))
            });
        };
        let refused = |reason: String| PhysicalError::impossible(Key::SampleLaw, name, reason);
        let terms = SampleLaw::terms(name).map_err(|error| refused(error.to_string()))?;
        let terms = with_formula(reader, name, terms)?;
        let parameters = || terms.iter().flat_map(|term| term.entry.parameters);
        let strange = |key: &Key| reader.has(*key) && !takes(&terms, *key);
        let mut strange = keys_of_contact(reader.stated).filter(strange);
        let strange = strange.find(|key| !may_be_unused(&terms, *key));
        if let Some(key) = strange {
            let mut keys: Vec<&str> = Vec::new();
            let tables = [Key::SampleTable, Key::SampleArms].into_iter();
            let tables = tables.filter(|key| takes(&terms, *key)).map(Key::path);
            for key in tables.chain(parameters().map(|p| key_of(p).path())) {
                if !keys.contains(&key) {
                    keys.push(key);
                }
            }
            let others = match &laws_with(key)[..] {
                [] => String::new(),
                laws => format!(" (laws with it: {})", laws.join(", ")),
            };
            let reason = format!(
                "it is not a parameter of sample.law = \"{name}\", which takes {}{others}",
                keys.join(", ")
            );
            return Err(reader.impossible(key, reason));
        }
        let mut force = Self {
            values: Vec::new(),
            terms: terms.clone(),
            table: reader.table(Key::SampleTable).map(|table| {
                let named =
                    |by: &Interpolation| Some(by.name()) == reader.word(Key::SampleInterpolation);
                let by = Interpolation::ALL.into_iter().find(named);
                by.map_or_else(|| table.clone(), |by| table.by(by))
            }),
            arms: reader.arms(Key::SampleArms).cloned(),
        };
        if force.arms.is_none() && terms.iter().any(|term| term.has_arms()) {
            return Err(PhysicalError::missing(
                Key::SampleArms,
                format!(
                    "sample.law = \"{name}\" needs its relaxing arms, as in arms = \
                     [[\"time (us)\", \"modulus (MPa)\"], [0.38, 460], [1.7, 136]] or arms = \
                     \"arms.csv\""
                ),
            ));
        }
        if force.table.is_none() && terms.iter().any(|term| term.has_rows()) {
            return Err(PhysicalError::missing(
                Key::SampleTable,
                format!(
                    "sample.law = \"{name}\" needs a force curve, as in table = \"curve.csv\" with \
                     the columns `gap (nm)` and `force (nN)`"
                ),
            ));
        }
        let damped = force
            .table
            .as_ref()
            .is_some_and(|table| !table.rows().damping().is_empty());
        if reader.has(Key::SampleDampingFactor) && !damped {
            let reason = "the table has no column of damping, as in `damping (N s/m)`";
            return Err(reader.impossible(Key::SampleDampingFactor, reason));
        }
        for parameter in parameters() {
            let value = force.value(reader, tip, parameter)?;
            if !parameter.range.holds(value) {
                let reason = format!("it must be {}", parameter.range.words());
                return Err(reader.impossible(key_of(parameter), reason));
            }
            force.values.push(value);
        }
        SampleLaw::new(terms, force.values.clone(), force.rows(), force.maxwell()).map_err(
            |error| match error {
                VolterraError::Flows if !reader.has(Key::SampleModulus) => {
                    PhysicalError::missing(Key::SampleModulus, error.to_string())
                }
                VolterraError::Formula(error) => {
                    reader.impossible(Key::SampleForce, error.to_string())
                }
                _ => refused(error.to_string()),
            },
        )?;
        Ok(Some(force))
    }

    /// The value of a parameter: stated, derived, or the default of the law.
    fn value(
        &self,
        reader: Reader<'_>,
        tip: &Tip,
        parameter: &ParameterEntry,
    ) -> Result<f64, PhysicalError> {
        let key = key_of(parameter);
        if let Some(stated) = reader.number(key)? {
            return Ok(stated * unit(parameter));
        }
        let material = || reader.material(Key::SampleMaterial);
        let known = match key {
            Key::SampleModulus => material()?.map(|m| m.elastic.modulus),
            Key::SamplePoisson => material()?.map(|m| m.elastic.poisson),
            Key::TipModulus => tip.elastic.map(|e| e.modulus),
            Key::TipPoisson => tip.elastic.map(|e| e.poisson),
            Key::TipRadius => tip.radius,
            _ => self.converted(reader, tip, parameter)?,
        };
        // Without an attraction contact begins where the surfaces meet.
        let touching = key == Key::SampleIntermolecularDistance && !self.attracts();
        let default = if touching {
            Some(0.0)
        } else {
            parameter.default
        };
        known.or(default).ok_or_else(|| {
            let ways = match key {
                Key::SampleModulus => " (or sample.material)".to_owned(),
                _ => other_ways(parameter, key),
            };
            let reason = format!(
                "sample.law = \"{}\" needs the {}{ways}",
                self.names().join(" + "),
                parameter.words
            );
            PhysicalError::missing(key, reason)
        })
    }

    /// The value of a parameter from the stated one of its alternatives.
    fn converted(
        &self,
        reader: Reader<'_>,
        tip: &Tip,
        parameter: &ParameterEntry,
    ) -> Result<Option<f64>, PhysicalError> {
        for way in parameter.alternatives.ways {
            let Some(stated) = Key::of_law(&way.key).map_or(Ok(None), |key| reader.number(key))?
            else {
                continue;
            };
            let others = way.needs.iter().filter_map(|name| {
                let mut entries = self.terms.iter().flat_map(|term| term.entry.parameters);
                entries.find(|other| other.name == *name)
            });
            let others: Vec<f64> = others
                .map(|other| self.value(reader, tip, other))
                .collect::<Result<_, _>>()?;
            return Ok(Some((way.convert)(stated, &others)));
        }
        Ok(None)
    }

    /// Whether one of the laws attracts across the gap.
    fn attracts(&self) -> bool {
        self.terms.iter().any(|term| term.entry.attracts)
    }

    /// The same contact under other laws whose parameters are known; the present laws come first.
    pub fn others(&self) -> Vec<Self> {
        let distance = self
            .get(Key::SampleIntermolecularDistance)
            .or(CONTACT_DISTANCE.default)
            .unwrap_or_default();
        let work = self.work_of_adhesion();
        let value = |parameter: &ParameterEntry| {
            let key = key_of(parameter);
            let known = self.get(key).map(|value| value * unit(parameter));
            let adhesion = match key {
                Key::SampleHamaker => work.map(|work| adhesion::hamaker(work, distance)),
                Key::SampleWorkOfAdhesion => work,
                _ => None,
            };
            known.or(adhesion).or(parameter.default)
        };
        let mut all = vec![self.clone()];
        for name in COMPARED {
            let Ok(terms) = SampleLaw::terms(name) else {
                continue;
            };
            let parameters = terms.iter().flat_map(|term| term.entry.parameters);
            let Some(values) = parameters.map(value).collect::<Option<Vec<f64>>>() else {
                continue;
            };
            let other = Self {
                terms,
                values,
                table: None,
                arms: None,
            };
            if other.names() != self.names() {
                all.push(other);
            }
        }
        all
    }

    /// Work of adhesion w in J/m², stated or H/(12π a0²), if the laws have an adhesion.
    fn work_of_adhesion(&self) -> Option<f64> {
        self.get(Key::SampleWorkOfAdhesion).or_else(|| {
            let distance = self.get(Key::SampleIntermolecularDistance)?;
            let hamaker = self.get(Key::SampleHamaker)?;
            Some(adhesion::work_of_adhesion(hamaker, distance))
        })
    }

    /// E* of sample and tip in Pa, if the laws have the modulus of a sample.
    pub fn reduced_modulus(&self) -> Option<f64> {
        let solid = |modulus: Key, poisson: Key| {
            Some(Elastic {
                modulus: self.get(modulus).filter(|modulus| modulus.is_finite())?,
                poisson: self.get(poisson)?,
            })
        };
        let sample = solid(Key::SampleModulus, Key::SamplePoisson)?;
        let tip = solid(Key::TipModulus, Key::TipPoisson);
        Some(reduced_modulus(sample, tip))
    }

    /// Tabor's parameter μ = (R w²/(E*² a0³))^(1/3) of an elastic sphere with adhesion: how far the
    /// adhesion deforms the contact beyond its range (Tabor, J. Colloid Interface Sci. 58, 2
    /// (1977)).
    pub fn tabor_parameter(&self) -> Option<f64> {
        // Of a sample that relaxes it depends on the rate.
        if self.arms.is_some() {
            return None;
        }
        let (radius, distance) = (
            self.get(Key::TipRadius)?,
            self.get(Key::SampleIntermolecularDistance)?,
        );
        let strain = self.work_of_adhesion()? / (self.reduced_modulus()? * distance);
        Some(nanotap_arithmetic::cbrt(
            radius / distance * strain * strain,
        ))
    }

    /// Returns the names of the laws, joined by `+`.
    pub fn name(&self) -> String {
        self.names().join(" + ")
    }

    /// Returns a hint if the adhesion of the laws does not suit the Tabor parameter: the theory of
    /// Derjaguin, Muller and Toporov is valid for stiff contacts, that of Johnson, Kendall and
    /// Roberts for soft ones.
    fn better_adhesion(&self, tabor: f64) -> Option<&'static str> {
        let has = |name: &str| self.names().contains(&name);
        if has("jkr") {
            return (tabor < TABOR_LIMIT)
                .then_some("holds above about 1, where the contact is soft; \"dmt\" holds below");
        }
        let rigid = has("dmt") || has("van-der-waals");
        (rigid && tabor > TABOR_LIMIT)
            .then_some("holds below about 1, where the contact is stiff; \"jkr\" holds above")
    }

    fn rows(&self) -> Option<Arc<Rows>> {
        self.table.as_ref().map(|table| Arc::clone(table.rows()))
    }

    fn maxwell(&self) -> Option<Arc<Arms>> {
        self.arms.as_ref().map(|arms| Arc::clone(arms.arms()))
    }

    /// Storage and loss modulus, in Pa, of a sample that relaxes, at a frequency in Hz.
    pub fn dynamic_modulus(&self, frequency: f64) -> Option<[f64; 2]> {
        let first = self.terms.iter().position(|term| term.has_arms())?;
        let before = self.terms[..first].iter();
        let skipped: usize = before.map(|term| term.entry.parameters.len()).sum();
        let values = self.values.get(skipped..)?.first_chunk()?;
        let series = self.arms.as_ref()?.arms().series(values);
        Some(series.dynamic(2.0 * PI * frequency))
    }

    fn names(&self) -> Vec<&'static str> {
        self.terms.iter().map(|term| term.entry.name).collect()
    }

    /// The parameters with their keys and values in the keys' own units, term by term.
    pub fn parameters(&self) -> impl Iterator<Item = (&'static ParameterEntry, Key, f64)> {
        let entries = self.terms.iter().flat_map(|term| term.entry.parameters);
        entries.zip(&self.values).map(|(parameter, value)| {
            let key = key_of(parameter);
            (parameter, key, value / unit(parameter))
        })
    }

    /// The value of a key, if the law has it.
    pub fn get(&self, key: Key) -> Option<f64> {
        let found = self.parameters().find(|(_, other, _)| *other == key);
        found.map(|(_, _, value)| value)
    }

    /// The law in the model's units.
    ///
    /// # Errors
    /// When the values are not those of such a law.
    pub fn in_model(&self, scales: &Scales) -> Result<SampleLaw, PhysicalError> {
        let entries = self.terms.iter().flat_map(|term| term.entry.parameters);
        let values = entries.zip(&self.values);
        let values = values.map(|(p, value)| value / size(p.kind, scales));
        SampleLaw::new(
            self.terms.clone(),
            values.collect(),
            self.rows(),
            self.maxwell(),
        )
        .map_err(|error| {
            PhysicalError::impossible(Key::SampleLaw, self.names().join(" + "), error.to_string())
        })
    }

    /// Assumptions and warnings about the law.
    pub(crate) fn remarks(&self, reader: Reader<'_>, tip: &Tip) -> Vec<Remark> {
        let mut remarks = Vec::new();
        let has = |name: &str| self.parameters().any(|(p, _, _)| p.name == name);
        if has("modulus")
            && let Ok(Some(material)) = reader.material(Key::SampleMaterial)
        {
            remarks.push(Remark::note(format!(
                "sample \"{}\" from the catalogue: {}",
                material.name, material.source
            )));
        }
        let unused = keys_of_contact(reader.stated)
            .filter(|key| reader.has(*key) && !takes(&self.terms, *key))
            .filter(|key| may_be_unused(&self.terms, *key));
        remarks.extend(
            unused.map(|key| {
                Remark::note(format!("{key} is stated, and the formula does not use it"))
            }),
        );
        let mut assumed: Vec<(Key, f64)> = self
            .parameters()
            .filter(|(parameter, key, _)| parameter.assumed && !reader.has(*key))
            .map(|(_, key, value)| (key, value))
            .collect();
        assumed.sort_by_key(|(key, _)| *key);
        assumed.dedup_by_key(|(key, _)| *key);
        for (key, value) in assumed {
            if key == Key::SamplePoisson && reader.has(Key::SampleMaterial) {
                continue;
            }
            remarks.push(Remark::note(format!(
                "{key} is not given: taken as {}",
                key.kind().format(value)
            )));
        }
        if let Some((gap, force)) = self.table.as_ref().and_then(|t| t.rows().points().last())
            && *force != 0.0
        {
            remarks.push(Remark::note(format!(
                "the force of the table's last row, {} at {}, stays the same farther away",
                Kind::Force.format(*force),
                Kind::Length.format(*gap)
            )));
        }
        if has("tip_modulus") && tip.elastic.is_none() {
            remarks.push(Remark::note(
                "the tip counts as rigid: give tip.material, or tip.modulus and tip.poisson, \
                 to include its own compliance",
            ));
        }
        if let Some(tabor) = self.tabor_parameter()
            && let Some(better) = self.better_adhesion(tabor)
        {
            remarks.push(Remark::warning(format!(
                "Tabor's parameter is {}: sample.law = \"{}\" {better} (Tabor 1977; Greenwood, \
                 Proc. R. Soc. A 453, 1277 (1997))",
                Kind::Number.format_digits(tabor, 3),
                self.names().join(" + "),
            )));
        }
        if let (Some(radius), Some(distance)) = (
            self.get(Key::TipRadius),
            self.get(Key::SampleIntermolecularDistance),
        ) && radius <= distance
        {
            remarks.push(Remark::warning(format!(
                "the tip's radius of {} is not above the intermolecular distance of {}: no law \
                 of continuous bodies holds",
                Kind::Length.format(radius),
                Kind::Length.format(distance)
            )));
        }
        remarks
    }
}

/// The laws of a sphere that are compared with each other.
const COMPARED: [&str; 6] = [
    "hertz",
    "dmt",
    "jkr",
    "voigt-sphere",
    "voigt-sphere-pulling",
    "thin-sphere",
];
/// Tabor's parameter between the limits of stiff and of soft contacts.
const TABOR_LIMIT: f64 = 1.0;
/// The keys that state a parameter, in brackets; empty if there is only its own.
fn other_ways(parameter: &ParameterEntry, key: Key) -> String {
    let others = parameter.alternatives.ways.iter();
    let others = others.filter_map(|way| Key::of_law(&way.key));
    let mut keys: Vec<Key> = std::iter::once(key).chain(others).collect();
    keys.sort_unstable();
    let paths: Vec<&str> = keys.into_iter().map(Key::path).collect();
    match paths.as_slice() {
        [before @ .., last] if !before.is_empty() => {
            format!(" (or another of {} and {last})", before.join(", "))
        }
        _ => String::new(),
    }
}

/// The model's unit of a kind, in SI; that of charge is 1 C.
fn size(kind: Kind, scales: &Scales) -> f64 {
    let dimension = kind.dimension();
    scales.mass.powi(dimension.mass)
        * scales.length.powi(dimension.length)
        * scales.time.powi(dimension.time)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap_volterra::laws::all;

    #[test]
    fn every_parameter_of_every_law_has_its_keys() {
        for law in all() {
            let parameters = law.entry.parameters;
            for p in parameters {
                assert!(Key::of_law_parameter(p).is_some(), "{}", p.name);
                for way in p.alternatives.ways {
                    assert!(Key::of_law(&way.key).is_some(), "{}", way.key.name);
                    for name in way.needs {
                        assert!(parameters.iter().any(|p| p.name == *name), "{name}");
                    }
                }
            }
        }
    }
}
