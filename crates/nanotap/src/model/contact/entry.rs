//! What a contact law's file declares, for whatever reads the table of laws.

use super::dual::Dual;
use super::law::Law;
use crate::model::parameter::ParameterEntry;

/// An entry of the table of piecewise-linear contact laws.
#[derive(Debug)]
pub struct Entry {
    /// Name in case files.
    pub name: &'static str,
    /// What it is, in a few words.
    pub meaning: &'static str,
    /// The force on the tip, as text.
    pub formula: &'static str,
    /// Whether it has the damper α6.
    pub damper: Damper,
    /// The numbers that only this law has.
    pub numbers: &'static [ParameterEntry],
    /// Example of the physical quantities behind these numbers, for messages that one is missing.
    pub needs: &'static str,
    /// Whether it has a list of relaxing arms.
    pub arms: bool,
    /// Whether the surface pulls a touching tip with a constant force, so that the force jumps
    /// where contact begins and the lever may rest in several places.
    pub attracts: bool,
    /// Why number `k` of the numbers that only this law has cannot be what it is.
    pub objection: fn(numbers: &[f64], k: usize) -> Option<&'static str>,
    /// These numbers for a relaxing arm of a stiffness and a damper, by which samples are
    /// compared; `None` if they do not follow.
    pub like: Option<fn(arm: f64, damper: f64) -> Vec<f64>>,
    /// The equations.
    pub(crate) law: fn(Numbers<'_>) -> Law,
}

/// Stiffness of a relaxing arm and its damper, from the numbers that only its law has.
pub type ArmOf = fn(&[f64]) -> [f64; 2];

/// The damper of a sample.
#[derive(Clone, Copy, Debug)]
pub enum Damper {
    /// The damper α6 between tip and sample.
    Contact {
        /// Note where none is given.
        none: &'static str,
    },
    /// A damper in series with a spring, the numbers of which the law has in place of α6.
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
    /// α4.
    pub(crate) stiffness: Dual,
    /// α6.
    pub(crate) damping: Dual,
    /// Those that only this law has, in the order of its entry.
    pub(crate) own: &'a [Dual],
    /// Relaxing arms, each a time and a stiffness.
    pub(crate) arms: &'a [[f64; 2]],
}

/// No objection to any number.
pub(crate) const fn any(_: &[f64], _: usize) -> Option<&'static str> {
    None
}
