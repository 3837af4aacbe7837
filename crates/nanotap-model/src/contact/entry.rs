//! What the file of a contact law declares: the entry of the law in the table.

use super::dual::Dual;
use super::law::Law;
use crate::parameter::ParameterEntry;

/// An entry of the table of piecewise-linear contact laws.
#[derive(Debug)]
pub struct Entry {
    /// Name of the law in case files, such as `kelvin-voigt`.
    pub name: &'static str,
    /// Description of the law in a few words.
    pub meaning: &'static str,
    /// The force on the tip, as text.
    pub formula: &'static str,
    /// The law's damper: α6, or one in series with a spring.
    pub damper: Damper,
    /// Parameters that only this law has.
    pub numbers: &'static [ParameterEntry],
    /// Example of the physical quantities behind these numbers, for messages that one is missing.
    pub needs: &'static str,
    /// Whether it has a list of relaxing arms.
    pub arms: bool,
    /// Whether the surface pulls a touching tip with a constant force, so that the force jumps
    /// where contact begins and the lever may rest in several places.
    pub attracts: bool,
    /// Returns why parameter `k` of those that only this law has is not allowed, for all their
    /// values `numbers`; `None` if it is.
    pub objection: fn(numbers: &[f64], k: usize) -> Option<&'static str>,
    /// Returns the law's own parameters that correspond to a relaxing arm with the stiffness `arm`
    /// and the damping `damper`, for comparisons of laws; `None` for a law without such a
    /// correspondence.
    pub like: Option<fn(arm: f64, damper: f64) -> Vec<f64>>,
    /// Builds the equations of the law from its numbers.
    pub(crate) law: fn(Numbers<'_>) -> Law,
}

/// Computes stiffness and damping of a relaxing arm, in model units, from the law's own parameters.
pub type ArmOf = fn(&[f64]) -> [f64; 2];

/// The damper of a sample.
#[derive(Clone, Copy, Debug)]
pub enum Damper {
    /// The damper α6 between tip and sample.
    Contact {
        /// Note for a case that gives no damper.
        none: &'static str,
    },
    /// A damper in series with a spring. The law has numbers of this arm in place of α6.
    InArm {
        /// Why α6 must be 0.
        not_alpha6: &'static str,
        /// Why a physical case must not give a damper.
        not_damping: &'static str,
        /// Stiffness of the arm and its damper, of a law with a single one.
        arm: Option<ArmOf>,
    },
}

/// The numbers of a law, with a derivative.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Numbers<'a> {
    /// Contact stiffness α4, dimensionless.
    pub(crate) stiffness: Dual,
    /// Contact damping α6, dimensionless.
    pub(crate) damping: Dual,
    /// Parameters that only this law has, in the order of its entry.
    pub(crate) own: &'a [Dual],
    /// Relaxing arms, each a time and a stiffness.
    pub(crate) arms: &'a [[f64; 2]],
}

/// No objection to any number.
pub(crate) const fn any(_: &[f64], _: usize) -> Option<&'static str> {
    None
}
