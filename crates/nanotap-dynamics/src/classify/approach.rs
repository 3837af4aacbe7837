//! Whether a run really goes to an orbit that Newton closed beside it.

use nalgebra::DMatrix;

use crate::failure::{MapFailure, advance, advance_with_jacobian};
use crate::map::StroboscopicMap;
use crate::neighbourhood::AdaptedNorm;
use crate::orbit::PeriodicOrbit;
use crate::vector::distance;

/// Longest of the four stretches of returns over which the approach to a weakly
/// stable orbit is watched.
const LONGEST_WINDOW: f64 = 512.0;

/// True if the run from `state` approaches the stable `orbit` as its multipliers
/// say: nearer by a factor 100 in the adapted norm or, for weak stability, with the
/// peaks of four stretches falling one after the other, at half the linear rate at
/// least. Peaks, because beside a flip or a Neimark–Sacker point the distance falls
/// only on average over the turns. Four stretches together are one decay time long,
/// or 2048 returns; a torus around the orbit that beats more slowly than that, and
/// happens to shrink meanwhile, would be mistaken.
pub(crate) fn approaches<M: StroboscopicMap>(
    map: &mut M,
    state: &[f64],
    orbit: &PeriodicOrbit,
) -> Result<bool, MapFailure> {
    let (d, n) = (state.len(), orbit.period);
    let mut monodromy = DMatrix::identity(d, d);
    let mut factor = DMatrix::zeros(d, d);
    let mut point = orbit.states[0].clone();
    for _ in 0..n {
        advance_with_jacobian(map, &mut point, &mut factor)?;
        monodromy = &factor * monodromy;
    }
    let Some(adapted) = AdaptedNorm::new(&monodromy, orbit.spectral_radius()) else {
        return Ok(false);
    };
    let center = &orbit.states[0];
    let nearest = (0..n)
        .min_by(|&a, &b| {
            distance(&orbit.states[a], state).total_cmp(&distance(&orbit.states[b], state))
        })
        .unwrap_or(0);
    let mut x = state.to_vec();
    for _ in 0..(n - nearest) % n {
        advance(map, &mut x)?;
    }
    let floor = adapted.floor(center, &point);
    let first = adapted.distance(&x, center);
    if first <= floor {
        return Ok(true);
    }
    let radius = orbit.spectral_radius();
    let window = (0.25 / -nanotap_arithmetic::ln(radius))
        .ceil()
        .clamp(16.0, LONGEST_WINDOW) as usize;
    let mut highest = [0.0f64; 4];
    for peak in &mut highest {
        for _ in 0..window {
            for _ in 0..n {
                advance(map, &mut x)?;
            }
            let now = adapted.distance(&x, center);
            if now <= floor || now <= 0.01 * first {
                return Ok(true);
            }
            if now > 4.0 * first {
                return Ok(false);
            }
            *peak = peak.max(now);
        }
    }
    let wanted = 1.5 * window as f64 * nanotap_arithmetic::ln(radius);
    Ok(highest.windows(2).all(|w| w[1] < w[0])
        && nanotap_arithmetic::ln(highest[3] / highest[0]) <= wanted)
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;
    use crate::orbit::{ShootingOptions, close_orbit};

    /// x → f(|x|) x on a line, with f'(0) f(0) = 0.999 for the orbit at rest.
    #[derive(Clone)]
    struct Line(fn(f64) -> f64);

    impl StroboscopicMap for Line {
        type Error = Infallible;

        fn dimension(&self) -> usize {
            1
        }

        fn period(&self) -> f64 {
            1.0
        }

        fn advance(&mut self, state: &mut [f64]) -> Result<(), Infallible> {
            state[0] *= (self.0)(state[0].abs());
            Ok(())
        }

        fn advance_with_jacobian(
            &mut self,
            state: &mut [f64],
            jacobian: &mut DMatrix<f64>,
        ) -> Result<(), Infallible> {
            jacobian[(0, 0)] = (self.0)(state[0].abs());
            self.advance(state)
        }
    }

    fn from_one(factor: fn(f64) -> f64) -> bool {
        let mut map = Line(factor);
        let rest = close_orbit(&mut map, &[0.0], 1, &ShootingOptions::default()).unwrap();
        assert_eq!(rest.spectral_radius(), factor(0.0));
        approaches(&mut map, &[1.0], &rest).unwrap()
    }

    /// Beyond 1/2 the distance falls by another factor than at rest: at three fifths of the rate
    /// that is an approach, at two fifths and less it may be one to something else.
    #[test]
    fn an_approach_falls_at_half_the_linear_rate_at_least() {
        assert!(from_one(|_| 0.999));
        assert!(from_one(|x| if x > 0.5 { 0.9994 } else { 0.999 }));
        assert!(!from_one(|x| if x > 0.5 { 0.9996 } else { 0.999 }));
        assert!(!from_one(|x| if x > 0.5 { 1.0 } else { 0.999 }));
        assert!(!from_one(|x| if x > 0.5 { 1.5 } else { 0.999 }));
        assert!(from_one(|_| 0.5));
    }
}
