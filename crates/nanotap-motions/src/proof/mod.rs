//! Proofs of periodic orbits: a theorem about the orbit that Newton found, or the reason why there
//! is none.
//!
//! A proof is about the model's dimensionless numbers, each standing for every decimal number
//! that is read as it; see [`enclosed`](nanotap_model::enclosed) for the equations and nanotap-proof
//! for the method.

mod prover;

use schemars::JsonSchema;
use serde::Serialize;

pub use prover::{NotProved, Prover, candidate};

/// Result of a proof about a periodic orbit.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ProofReport {
    /// Whether the orbit was proved to exist.
    pub proved: bool,
    /// The theorem, or the reason why there is none.
    pub statement: String,
    /// Enclosures, if the orbit is proved to exist.
    #[serde(flatten)]
    pub theorem: Option<TheoremReport>,
}

/// The enclosures of a theorem, in model units. An interval is its lower and its upper bound, both
/// exact.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct TheoremReport {
    /// Minimal period in drive periods.
    pub period: usize,
    /// State at drive phase 0 in model units, an interval for each entry.
    pub state: Vec<[f64; 2]>,
    /// Switches between flight and contact in the period, in order of time.
    pub switches: Vec<SwitchReport>,
    /// Neighbourhood without another orbit of the same contacts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unique_within: Option<UniqueWithin>,
    /// Discs in the complex plane that contain the multipliers.
    pub multipliers: Vec<DiscReport>,
    /// Proved stability: stable, unstable or undecided.
    pub stability: &'static str,
}

/// A switch between flight and contact.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SwitchReport {
    /// Interval of the time of the switch, counted from drive phase 0, model units.
    pub time: [f64; 2],
    /// True if contact begins, false if it ends; an impact on a rigid stop begins one that lasts no
    /// time.
    pub begins: bool,
}

/// Neighbourhood of the orbit without another one: no other orbit of the same period and contacts
/// has all its switches within these differences.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct UniqueWithin {
    /// Largest difference of the time of every switch, model units.
    pub time: f64,
    /// Largest difference of each entry of the state at every switch, model units.
    pub state: Vec<f64>,
}

/// A disc of complex numbers that contains multipliers.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct DiscReport {
    /// Centre of the disc: real and imaginary part, dimensionless.
    pub center: [f64; 2],
    /// Radius of the disc, dimensionless.
    pub radius: f64,
    /// How many multipliers it holds.
    pub count: usize,
}
