//! Why a curve of bifurcations ends.

use crate::continuation::{BifurcationKind, OrbitTangency};
use crate::orbit::PeriodicOrbit;
use nanotap_arithmetic::ComplexFunctions as _;

/// Distance of a second multiplier from ±1, or of an angle from 0 and π, within which
/// two events are taken to meet.
const TOGETHER: f64 = 0.03;
/// An extremum of a switching function this small, as a part of the largest, counts as
/// a touch.
const TOUCH: f64 = 1e-3;

/// Why a curve of bifurcations ends.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CurveEnd {
    /// It leaves the window of the two parameters.
    #[error("leaves the window")]
    Window,
    /// It came back to its beginning.
    #[error("closed")]
    Closed,
    /// The orbit grazes there: the map is not twice differentiable, and another curve
    /// begins or none does.
    #[error("meets a grazing at ({first}, {second})")]
    Grazing {
        /// First parameter.
        first: f64,
        /// Second parameter.
        second: f64,
    },
    /// A second condition is met there.
    #[error("meets a {what} (codimension two) at ({first}, {second})")]
    CodimensionTwo {
        /// Which one.
        what: &'static str,
        /// First parameter.
        first: f64,
        /// Second parameter.
        second: f64,
    },
    /// A state outgrew the bound.
    #[error("a state left the domain")]
    LeftDomain,
    /// No point was found at the shortest step, and nothing special is near.
    #[error("no further point beyond ({first}, {second}) at the shortest step: {reason}")]
    StepTooSmall {
        /// First parameter.
        first: f64,
        /// Second parameter.
        second: f64,
        /// What failed there.
        reason: String,
    },
    /// The allowed number of points was used up.
    #[error("cut after the allowed number of points")]
    PointLimit,
    /// The caller stopped it.
    #[error("stopped by the caller")]
    Cancelled,
}

impl CurveEnd {
    /// What is met there, in a word: nothing at the edge of the window, or of a closed curve.
    pub fn meets(&self) -> Option<&'static str> {
        match self {
            Self::Window | Self::Closed => None,
            Self::Grazing { .. } => Some("grazing"),
            Self::CodimensionTwo { .. } => Some("codimension two"),
            _ => Some("cut"),
        }
    }

    /// True if the curve was cut rather than came to an end.
    pub fn is_failure(&self) -> bool {
        match self {
            Self::Window | Self::Closed | Self::Grazing { .. } | Self::CodimensionTwo { .. } => {
                false
            }
            Self::LeftDomain | Self::StepTooSmall { .. } | Self::PointLimit | Self::Cancelled => {
                true
            }
        }
    }

    /// What a curve of this kind ran into where no further point was found: its last
    /// orbit, the extrema along it, and what failed.
    pub(crate) fn at_last_point(
        kind: BifurcationKind,
        (first, second): (f64, f64),
        orbit: &PeriodicOrbit,
        tangencies: &[OrbitTangency],
        reason: String,
    ) -> Self {
        let largest = tangencies.iter().fold(0.0f64, |m, t| m.max(t.value.abs()));
        let touches = tangencies
            .iter()
            .filter(|t| t.value.abs() <= TOUCH * largest)
            .count();
        let on_a_grazing = matches!(kind, BifurcationKind::Grazing { .. });
        if touches > usize::from(on_a_grazing) {
            return Self::Grazing { first, second };
        }
        match second_condition(kind, orbit) {
            Some(what) => Self::CodimensionTwo {
                what,
                first,
                second,
            },
            None => Self::StepTooSmall {
                first,
                second,
                reason,
            },
        }
    }
}

/// The condition that an orbit on a curve of this kind meets besides the curve's own.
fn second_condition(kind: BifurcationKind, orbit: &PeriodicOrbit) -> Option<&'static str> {
    let near = |value: f64| {
        orbit
            .multipliers
            .iter()
            .filter(|m| (*m - value).modulus() <= TOGETHER)
            .count()
    };
    let pair = orbit
        .multipliers
        .iter()
        .any(|m| m.im > TOGETHER && (m.modulus() - 1.0).abs() <= TOGETHER);
    let (plus, minus) = (near(1.0), near(-1.0));
    match kind {
        BifurcationKind::NeimarkSacker { .. } if plus > 1 => Some("1:1 resonance"),
        BifurcationKind::NeimarkSacker { .. } if minus > 1 => Some("1:2 resonance"),
        BifurcationKind::NeimarkSacker { .. } => None,
        BifurcationKind::Fold | BifurcationKind::Crossing if plus > 1 => Some("double fold"),
        BifurcationKind::Flip if minus > 1 => Some("double flip"),
        BifurcationKind::Fold | BifurcationKind::Crossing | BifurcationKind::Grazing { .. }
            if minus > 0 =>
        {
            Some("flip")
        }
        BifurcationKind::Flip | BifurcationKind::Grazing { .. } if plus > 0 => Some("fold"),
        _ if pair => Some("Neimark–Sacker point"),
        _ => None,
    }
}
