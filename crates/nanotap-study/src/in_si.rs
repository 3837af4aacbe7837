//! A motion in the model's units and, for a physical case, in SI.

use schemars::JsonSchema;
use serde::Serialize;

use nanotap_observe::PhysicalMotion;

/// A motion in the model's units and, of a physical case, in SI.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct InSi<M> {
    /// The motion, with numbers in the model's units.
    #[serde(flatten)]
    pub motion: M,
    /// The same motion in SI; `None` unless the case is physical.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<PhysicalMotion>,
}
