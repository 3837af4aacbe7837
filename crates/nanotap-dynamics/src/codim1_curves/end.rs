//! The reason why a curve of bifurcations ends.

use crate::continuation::{BifurcationKind, OrbitTangency};
use crate::orbit::PeriodicOrbit;
use nanotap_arithmetic::ComplexFunctions as _;

/// Distance of a second multiplier from ±1, or of an angle from 0 and π, within which two
/// bifurcations coincide.
const COINCIDENCE: f64 = 0.03;
/// Largest extremum of a switching function, as a fraction of the largest one, that counts as a
/// grazing.
const GRAZING_VALUE: f64 = 1e-3;
/// The same as a fraction of the orbit's size: at a rigid stop the impact may be the only extremum.
const GRAZING_OF_ORBIT: f64 = 1e-6;

/// Why a curve of bifurcations ends.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CurveEnd {
    /// It leaves the box of the two parameters.
    #[error("leaves the window")]
    Window,
    /// It returned to its first point.
    #[error("closed")]
    Closed,
    /// The orbit grazes: the map is not twice differentiable there, and the curve does not continue
    /// smoothly.
    #[error("meets a grazing at ({first}, {second})")]
    Grazing {
        /// Value of the first parameter.
        first: f64,
        /// Value of the second parameter.
        second: f64,
    },
    /// A second bifurcation condition holds there.
    #[error("meets a {what} (codimension two) at ({first}, {second})")]
    CodimensionTwo {
        /// Name of the second condition.
        what: &'static str,
        /// Value of the first parameter.
        first: f64,
        /// Value of the second parameter.
        second: f64,
    },
    /// A state exceeded the bound.
    #[error("a state left the domain")]
    LeftDomain,
    /// The corrector failed at the shortest step, for no known reason.
    #[error("no further point beyond ({first}, {second}) at the shortest step: {reason}")]
    StepTooSmall {
        /// Value of the first parameter.
        first: f64,
        /// Value of the second parameter.
        second: f64,
        /// Reason why the corrector failed, in words.
        reason: String,
    },
    /// The largest number of points was reached.
    #[error("cut after the allowed number of points")]
    PointLimit,
    /// The caller cancelled the computation.
    #[error("stopped by the caller")]
    Cancelled,
}

impl CurveEnd {
    /// Short name of the event at the end; `None` at the edge of the box and on a closed curve.
    pub fn meets(&self) -> Option<&'static str> {
        match self {
            Self::Window | Self::Closed => None,
            Self::Grazing { .. } => Some("grazing"),
            Self::CodimensionTwo { .. } => Some("codimension two"),
            _ => Some("cut"),
        }
    }

    /// True if the curve was cut: what lies beyond its last point is unknown.
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

    /// The event where the corrector failed, from the last orbit, the extrema along it, and the
    /// reason of the failure.
    pub(crate) fn at_last_point(
        kind: BifurcationKind,
        (first, second): (f64, f64),
        orbit: &PeriodicOrbit,
        tangencies: &[OrbitTangency],
        reason: String,
    ) -> Self {
        let largest = tangencies.iter().fold(0.0f64, |m, t| m.max(t.value.abs()));
        let touch = (GRAZING_VALUE * largest).max(GRAZING_OF_ORBIT * orbit.scale());
        let touches = tangencies.iter().filter(|t| t.value.abs() <= touch);
        let touches = touches.count();
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

/// The second condition that an orbit satisfies on a curve of this kind.
fn second_condition(kind: BifurcationKind, orbit: &PeriodicOrbit) -> Option<&'static str> {
    let near = |value: f64| {
        orbit
            .multipliers
            .iter()
            .filter(|m| (*m - value).modulus() <= COINCIDENCE)
            .count()
    };
    let pair = orbit
        .multipliers
        .iter()
        .any(|m| m.im > COINCIDENCE && (m.modulus() - 1.0).abs() <= COINCIDENCE);
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

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::*;
    use crate::orbit::Stability;

    fn orbit(multipliers: &[(f64, f64)]) -> PeriodicOrbit {
        PeriodicOrbit {
            period: 1,
            states: vec![vec![0.0; multipliers.len()]],
            residual: 0.0,
            error: 0.0,
            multipliers: multipliers
                .iter()
                .map(|(re, im)| Complex::new(*re, *im))
                .collect(),
            log_determinant: 0.0,
            stability: Stability::Marginal,
            margin: 0.0,
            discrete: 0,
        }
    }

    /// Kuznetsov, "Elements of Applied Bifurcation Theory", tables of codimension-two bifurcations
    /// of maps: the multipliers on the unit circle.
    #[test]
    fn two_conditions_at_once_have_a_name() {
        use BifurcationKind::{Crossing, Flip, Fold};
        let torus = BifurcationKind::NeimarkSacker { angle: 1.0 };
        let grazing = BifurcationKind::Grazing { time: 0.5 };
        let one = (1.01, 0.0);
        let minus = (-1.01, 0.0);
        let pair = [(0.6, 0.8), (0.6, -0.8)];
        let inside = [(0.3, 0.4), (0.3, -0.4)];
        let with = |first: &[(f64, f64)], rest: &[(f64, f64)]| orbit(&[first, rest].concat());
        for (kind, orbit, what) in [
            (
                torus,
                orbit(&[(0.999, 0.01), (0.999, -0.01)]),
                Some("1:1 resonance"),
            ),
            (
                torus,
                orbit(&[(-0.999, 0.01), (-0.999, -0.01)]),
                Some("1:2 resonance"),
            ),
            (torus, orbit(&pair), None),
            (torus, with(&[one], &pair), None),
            (torus, with(&[minus], &pair), None),
            (Fold, orbit(&[one, one]), Some("double fold")),
            (Crossing, orbit(&[one, one]), Some("double fold")),
            (Fold, orbit(&[one, minus]), Some("flip")),
            (Fold, with(&[one], &pair), Some("Neimark–Sacker point")),
            (Fold, with(&[one], &inside), None),
            (Fold, orbit(&[one, (0.5, 0.0)]), None),
            (Fold, with(&[one], &[(1.2, 0.8), (1.2, -0.8)]), None),
            (Flip, orbit(&[minus, minus]), Some("double flip")),
            (Flip, orbit(&[minus, one]), Some("fold")),
            (Flip, with(&[minus], &pair), Some("Neimark–Sacker point")),
            (Flip, with(&[minus], &inside), None),
            (grazing, orbit(&[minus]), Some("flip")),
            (grazing, orbit(&[one]), Some("fold")),
            (grazing, orbit(&pair), Some("Neimark–Sacker point")),
            (grazing, orbit(&[(0.9, 0.0), (-0.9, 0.0)]), None),
        ] {
            assert_eq!(
                second_condition(kind, &orbit),
                what,
                "{kind:?} {:?}",
                orbit.multipliers
            );
        }
    }

    /// One grazing extremum ends a curve of folds; a curve of grazings ends at a second one.
    #[test]
    fn a_touch_ends_a_curve() {
        let end = |kind, values: &[f64]| {
            let tangencies: Vec<_> = values
                .iter()
                .map(|value| OrbitTangency {
                    time: 0.5,
                    value: *value,
                })
                .collect();
            let quiet = orbit(&[(0.5, 0.0)]);
            CurveEnd::at_last_point(kind, (1.0, 2.0), &quiet, &tangencies, "why".into())
        };
        let grazes = CurveEnd::Grazing {
            first: 1.0,
            second: 2.0,
        };
        let lost = CurveEnd::StepTooSmall {
            first: 1.0,
            second: 2.0,
            reason: "why".into(),
        };
        let on_a_grazing = BifurcationKind::Grazing { time: 0.5 };
        assert_eq!(end(BifurcationKind::Fold, &[-4.0, 3e-3]), grazes);
        assert_eq!(end(BifurcationKind::Fold, &[-4.0, 5e-3]), lost);
        assert_eq!(end(BifurcationKind::Fold, &[]), lost);
        assert_eq!(end(on_a_grazing, &[-4.0, 3e-3]), lost);
        assert_eq!(end(on_a_grazing, &[-4.0, 3e-3, -3e-3]), grazes);
        assert_eq!(
            [&grazes, &lost, &CurveEnd::Window].map(CurveEnd::meets),
            [Some("grazing"), Some("cut"), None]
        );
        assert!(!grazes.is_failure() && lost.is_failure());
        let codimension = CurveEnd::CodimensionTwo {
            what: "fold",
            first: 1.0,
            second: 2.0,
        };
        assert_eq!(codimension.meets(), Some("codimension two"));
        assert!(!codimension.is_failure());
    }
}
