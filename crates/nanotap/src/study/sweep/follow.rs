//! Following a motion along a parameter.

use std::str::FromStr;

use serde::Serialize;

/// Which way a motion is followed along the first parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
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

impl FromStr for Follow {
    type Err = String;

    fn from_str(given: &str) -> Result<Self, String> {
        match given {
            "up" => Ok(Self::Up),
            "down" => Ok(Self::Down),
            "both" => Ok(Self::Both),
            _ => Err(format!(
                "`{given}` is no way to follow; there are up, down and both"
            )),
        }
    }
}
