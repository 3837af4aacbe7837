//! Following a motion along a parameter.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which way a motion is followed along the first parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Follow {
    /// Every value starts anew.
    #[default]
    Off,
    /// From the least value to the greatest.
    Up,
    /// From the greatest value to the least.
    Down,
    /// Both.
    Both,
}

impl Follow {
    /// The directions to go: true is up.
    pub fn directions(self) -> &'static [bool] {
        match self {
            Self::Off => &[],
            Self::Up => &[true],
            Self::Down => &[false],
            Self::Both => &[true, false],
        }
    }
}
