//! A lever whose modes were measured, in place of those of the uniform beam.
//!
//! Mode j is an oscillator with frequency ω_j, stiffness k_j at the tip and quality factor Q_j. With the
//! modal mass 1 its deflection of the tip is p_j = ω_j/√k_j, and its equation is
//!
//! ```text
//! ä_j + (ω_j/Q_j) (ȧ_j + I_j ẏ) + ω_j² a_j + I_j ÿ = p_j F + L_j F_d,
//! ```
//!
//! with the force F at the tip, the motion y of the base, and the force F_d that is spread evenly over the
//! lever. Frequency, stiffness and quality factor do not tell how the lever bends along its length.
//! For a mode without a stated participation Γ_j = p_j I_j in the motion of the base that of the
//! uniform clamped-free beam is used, Γ_j = φ_j(1) ∫φ_j dξ/∫φ_j² dξ = 1.566, −0.868, 0.509, … The
//! load L_j = p_j ∫φ_j dξ/φ_j(1), the slope at the tip and the shape along the lever are always those of
//! the uniform beam, scaled to the deflection p_j of the tip.

use serde::Serialize;
use serde::ser::{SerializeMap as _, Serializer};

use crate::beam::{Mode, ModeCountError};

/// A measured mode of a lever: frequency, stiffness, quality factor and participation.
///
/// In the model the frequency is Ω and the stiffness in units of EI/L³; in a physical case they are in
/// Hz and N/m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeverMode {
    /// Undamped frequency of the free mode, Ω or Hz.
    pub frequency: f64,
    /// Stiffness at the tip, in units of EI/L³ or N/m.
    pub stiffness: f64,
    /// Quality factor of the free mode, dimensionless.
    pub quality: f64,
    /// Participation Γ of the tip's deflection q in the motion y of the base, of `q̈ + (ω/Q) q̇ + ω² q =
    /// −Γ (ÿ + (ω/Q) ẏ)`, dimensionless; `None` for that of the uniform beam.
    pub participation: Option<f64>,
}

impl LeverMode {
    /// Returns the participation Γ of this mode, the `number`-th (1 is the first), dimensionless.
    ///
    /// # Errors
    /// [`ModeCountError`] for a number that is not a mode of the beam.
    pub fn participation_of(&self, number: usize) -> Result<f64, ModeCountError> {
        let beam = Mode::new(number)?;
        Ok(self
            .participation
            .unwrap_or_else(|| beam.tip() * beam.integral()))
    }
}

impl Serialize for LeverMode {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("frequency", &self.frequency)?;
        map.serialize_entry("stiffness", &self.stiffness)?;
        map.serialize_entry("quality", &self.quality)?;
        if let Some(participation) = self.participation {
            map.serialize_entry("participation", &participation)?;
        }
        map.end()
    }
}
