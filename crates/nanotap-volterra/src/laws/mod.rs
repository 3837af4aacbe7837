//! The table of contact laws. A law is one file: its formula and source, its branches, its
//! stored energy and range of validity. Its parameters are declared once, here, for all
//! readers.
//!
//! All quantities may be in any consistent units; the defaults are SI.

pub mod adhesion;
pub mod capillary;
pub mod curve;
pub mod dmt;
pub mod elastic;
pub mod electric;
pub mod entry;
pub mod formula;
pub mod hysteresis;
pub mod jkr;
pub mod kelvin_voigt;
pub mod layer;
pub mod lennard_jones;
pub mod pair;
pub mod prony;
pub mod solvation;
pub mod spring_damper;
pub mod sum;
pub mod table;
pub mod thin;
pub mod van_der_waals;
pub mod viscous;
pub mod written;

use crate::error::VolterraError;
use crate::law::{Exit, ForceLaw, Guard};
use elastic::Shape;
use entry::{Entry, Part};
use formula::{Formula, Law};
use nanotap_formula::FormulaError;
use std::sync::{Arc, LazyLock};

/// Largest number of laws in a sum.
pub const MAX_TERMS: usize = 8;

/// A law of the table, from which force laws are built.
#[derive(Clone, Copy, Debug)]
pub struct TableLaw {
    /// Description of the law for case files, help and schema.
    pub entry: &'static Entry,
    make: Make,
}

/// The data from which a law is built.
#[derive(Clone, Copy, Debug)]
enum Make {
    /// Parameters alone.
    Formula(fn(Vec<f64>) -> Arc<dyn ForceLaw>),
    /// Parameters and rows of gap and force.
    Rows,
    /// Parameters and the arms of a Prony series.
    Arms(Shape),
    /// Parameters and a formula, which tells them.
    Text,
    /// Parameters of this formula, which a case states.
    Written(&'static written::Writing),
    /// Parameters of this formula, which the table states.
    Listed(&'static Listed),
}

/// The formula of a law of the table, read when it is first needed.
type Listed = LazyLock<Result<written::Writing, FormulaError>>;

impl TableLaw {
    /// Builds the law with these parameters, in the order of its entry.
    ///
    /// # Errors
    /// If the number of parameters is wrong, a value is out of range, or the law needs the rows of
    /// a table ([`TableLaw::through`]).
    pub fn with(&self, parameters: &[f64]) -> Result<Arc<dyn ForceLaw>, VolterraError> {
        self.check(parameters)?;
        match self.make {
            Make::Formula(make) => Ok(make(parameters.to_vec())),
            Make::Rows => Err(VolterraError::Table {
                row: 1,
                reason: "a force curve needs at least two rows",
            }),
            Make::Arms(_) => Err(VolterraError::Arms {
                arm: 1,
                reason: "a relaxing sample needs at least one arm",
            }),
            Make::Text => Err(FormulaError {
                text: String::new(),
                place: 0..0,
                reason: "the formula of the force is missing".into(),
            }
            .into()),
            Make::Written(writing) => writing.law(parameters),
            Make::Listed(listed) => match &**listed {
                Ok(writing) => writing.law(parameters),
                Err(error) => Err(error.clone().into()),
            },
        }
    }

    /// Reports whether it is a table of gap and force.
    pub const fn has_rows(&self) -> bool {
        matches!(self.make, Make::Rows)
    }

    /// Reports whether it needs a formula ([`written::law`]).
    pub const fn needs_formula(&self) -> bool {
        matches!(self.make, Make::Text)
    }

    /// Returns the formula, if it is one.
    pub const fn text(&self) -> Option<&'static str> {
        match self.make {
            Make::Written(writing) => Some(writing.text()),
            _ => None,
        }
    }

    fn check(&self, parameters: &[f64]) -> Result<(), VolterraError> {
        let expected = self.entry.parameters.len();
        if parameters.len() != expected {
            return Err(VolterraError::Shape {
                what: "the list of a law's parameters",
                found: parameters.len(),
                expected,
            });
        }
        for (entry, &found) in self.entry.parameters.iter().zip(parameters) {
            if !entry.range.holds(found) {
                return Err(VolterraError::Value {
                    what: format!("the {} of the law {:?}", entry.name, self.entry.name),
                    found,
                    needed: entry.range.words(),
                });
            }
        }
        Ok(())
    }
}

macro_rules! table {
    ($($entry:expr => $formula:expr),* $(,)?) => {
        &[$(TableLaw {
            entry: &$entry,
            make: Make::Formula(|p| make($formula, p)),
        }),*]
    };
}

fn make<F: Formula>(formula: F, parameters: Vec<f64>) -> Arc<dyn ForceLaw> {
    Arc::new(Law::new(formula, parameters))
}

const fn voigt(shape: Shape, pulls: bool) -> kelvin_voigt::KelvinVoigt {
    kelvin_voigt::KelvinVoigt { shape, pulls }
}

/// Every law in Rust that is given by parameters alone ([`pair::TABLE`] has formulas, [`table::TABLE`] rows
/// in addition, [`prony::TABLE`] arms).
pub static TABLE: &[TableLaw] = table! {
    elastic::HERTZ => elastic::Elastic(Shape::Sphere),
    elastic::CONE => elastic::Elastic(Shape::Cone),
    elastic::PUNCH => elastic::Elastic(Shape::Punch),
    thin::SPHERE => thin::Thin(Shape::Sphere),
    thin::CONE => thin::Thin(Shape::Cone),
    thin::PUNCH => thin::Thin(Shape::Punch),
    layer::SPHERE => layer::Layer(Shape::Sphere),
    layer::CONE => layer::Layer(Shape::Cone),
    layer::PUNCH => layer::Layer(Shape::Punch),
    dmt::DMT => dmt::Dmt,
    jkr::JKR => jkr::Jkr,
    van_der_waals::SPHERE => van_der_waals::VanDerWaals(Shape::Sphere),
    van_der_waals::CONE => van_der_waals::VanDerWaals(Shape::Cone),
    van_der_waals::PUNCH => van_der_waals::VanDerWaals(Shape::Punch),
    lennard_jones::LENNARD_JONES => lennard_jones::LennardJones,
    kelvin_voigt::SPHERE => voigt(Shape::Sphere, false),
    kelvin_voigt::SPHERE_PULLING => voigt(Shape::Sphere, true),
    kelvin_voigt::CONE => voigt(Shape::Cone, false),
    kelvin_voigt::CONE_PULLING => voigt(Shape::Cone, true),
    kelvin_voigt::PUNCH => voigt(Shape::Punch, false),
    kelvin_voigt::PUNCH_PULLING => voigt(Shape::Punch, true),
    viscous::ROOT_VISCOSITY => viscous::RootViscosity,
    viscous::EXPONENTIAL_DAMPING => viscous::ExponentialDamping,
    viscous::POWER_DAMPING => viscous::PowerDamping,
    solvation::SOLVATION => solvation::Solvation,
    hysteresis::ADHESION_HYSTERESIS => hysteresis::AdhesionHysteresis,
    capillary::CAPILLARY => capillary::Capillary,
    electric::ELECTROSTATIC => electric::Electrostatic,
    electric::ELECTROSTATIC_AC => electric::ElectrostaticAc { averaged: false },
    electric::DLVO => electric::Dlvo,
    spring_damper::SPRING_DAMPER => spring_damper::SpringDamper,
};

/// Returns every law: those of [`TABLE`], formulas of the table, those with Maxwell arms, the table of
/// rows, and the formula of a case.
pub fn all() -> impl Iterator<Item = &'static TableLaw> {
    let others = [&table::TABLE, &written::FORMULA];
    let listed = TABLE.iter().chain(&pair::TABLE).chain(&prony::TABLE);
    listed.chain(others)
}

/// Returns the law of a name.
///
/// # Errors
/// [`VolterraError::UnknownLaw`].
pub fn law(name: &str) -> Result<&'static TableLaw, VolterraError> {
    all()
        .find(|law| law.entry.name == name)
        .ok_or_else(|| VolterraError::UnknownLaw { name: name.into() })
}

/// Builds the law of a name with parameters by name, and defaults for the others.
///
/// # Errors
/// If there is no such law or parameter, a parameter is missing, or a value is out of range.
pub fn build(name: &str, values: &[(&str, f64)]) -> Result<Arc<dyn ForceLaw>, VolterraError> {
    let law = law(name)?;
    for (key, found) in values {
        if !law.entry.parameters.iter().any(|p| p.name == *key) {
            return Err(VolterraError::Value {
                what: format!("{key} of the law {name:?}"),
                found: *found,
                needed: "absent: the law has no such parameter",
            });
        }
    }
    let parameters = law
        .entry
        .parameters
        .iter()
        .map(|p| {
            values
                .iter()
                .find(|(key, _)| *key == p.name)
                .map(|(_, value)| *value)
                .or(p.default)
                .ok_or_else(|| VolterraError::Value {
                    what: format!("the {} of the law {name:?}", p.name),
                    found: f64::NAN,
                    needed: "given",
                })
        })
        .collect::<Result<Vec<_>, _>>()?;
    law.with(&parameters)
}

/// Builds the sum of laws of the table. It refuses contributions that would count twice: two
/// elastic repulsions, or two laws that each contain the adhesion.
///
/// # Errors
/// [`VolterraError::Sum`] for such a pair, [`VolterraError::TooLarge`] for more than
/// [`MAX_TERMS`] laws, [`VolterraError::Shape`] for none.
pub fn build_sum(
    terms: &[(&'static Entry, Arc<dyn ForceLaw>)],
) -> Result<Arc<dyn ForceLaw>, VolterraError> {
    if terms.is_empty() {
        return Err(VolterraError::Shape {
            what: "the sum of laws",
            found: 0,
            expected: 1,
        });
    }
    if terms.len() > MAX_TERMS {
        return Err(VolterraError::TooLarge {
            what: "the number of laws in a sum",
            found: terms.len(),
            limit: MAX_TERMS,
        });
    }
    for (k, (second, _)) in terms.iter().enumerate() {
        for (first, _) in &terms[..k] {
            if let Some(part) = first.parts.iter().find(|p| second.parts.contains(p)) {
                return Err(VolterraError::Sum {
                    first: first.name,
                    second: second.name,
                    reason: match part {
                        Part::Elasticity => "the elastic repulsion would be counted twice",
                        Part::Adhesion => "the adhesion would be counted twice",
                    },
                });
            }
        }
    }
    if let [(_, law)] = terms {
        return Ok(law.clone());
    }
    if let Some(k) = terms.iter().position(|(_, law)| law.takes_signal()) {
        let on_gap_alone = |law: &dyn ForceLaw| {
            let turns = |exit: Exit| matches!(exit.guard, Guard::Turns | Guard::Own(_));
            let switches = (0..law.branches())
                .flat_map(|branch| law.exits(branch))
                .any(turns);
            !law.depends_on_rate() && law.surface().is_none() && !switches
        };
        let mut others = terms.iter().enumerate().filter(|(other, _)| *other != k);
        if let Some((_, (other, _))) = others.find(|(_, (_, law))| !on_gap_alone(law.as_ref())) {
            return Err(VolterraError::Sum {
                first: terms[k].0.name,
                second: other.name,
                reason: "to a force that depends on time only forces of the gap alone can be added, \
                         without memory",
            });
        }
    }
    if let Some(k) = terms.iter().position(|(_, law)| law.surface().is_some()) {
        let (own, relaxing) = &terms[k];
        let mut others = terms[..k].iter().chain(&terms[k + 1..]);
        let laws: Vec<Arc<dyn ForceLaw>> = others.clone().map(|(_, law)| law.clone()).collect();
        let law = match &laws[..] {
            [law] => law.clone(),
            _ => Arc::new(sum::Sum::new(laws)),
        };
        return relaxing.with_attraction(&law).ok_or(VolterraError::Sum {
            first: own.name,
            second: others.next().map_or("", |(other, _)| other.name),
            reason: if relaxing.surface().is_some_and(|surface| surface.always) {
                "the formula has a memory of its own force: write the whole force in it"
            } else {
                "to a sample that relaxes only forces of the gap alone can be added that are \
                     constant in contact and have the same intermolecular distance"
            },
        });
    }
    Ok(Arc::new(sum::Sum::new(
        terms.iter().map(|(_, law)| law.clone()).collect(),
    )))
}
