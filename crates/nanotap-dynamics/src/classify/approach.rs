//! Decides whether a run really approaches an orbit that Newton's method closed near it.

use nalgebra::{DMatrix, DVector};

use crate::failure::{MapFailure, advance};
use crate::map::StroboscopicMap;
use crate::neighbourhood::{AdaptedNorm, ReturnMap};
use crate::orbit::PeriodicOrbit;
use crate::vector::distance;

/// Longest of the four stretches over which the approach to a weakly stable orbit is watched, in
/// returns.
const LONGEST_STRETCH: f64 = 512.0;
/// Fraction of the first distance, and of the orbit's size, at which a run has arrived at the
/// orbit.
const ARRIVED: f64 = 0.01;
/// Fraction of the orbit's size at which the rest of the way is examined.
const NEARBY: f64 = 0.1;
/// Largest ratio of a decay time to four such stretches for which the run is watched for the whole
/// time.
const SLOWEST: f64 = 10.0;
/// Number of decay times for which the run is watched.
const LONGEST_WATCH: f64 = 5.0;
/// Largest initial distance, in sizes of the orbit, that prolongs this time.
const FARTHEST: f64 = 1e9;
/// Number of points of the remaining way at which the map is tried.
const PLACES: usize = 16;
/// Returns after which the slowest turns near a flip or a strong resonance (of three or four
/// returns) have come round: on one side of such an orbit a single return may lead away.
const DOZEN: usize = 12;
/// Number of phases of the slowest turns at which the map is tried, at every halving of the
/// distance.
const PHASES: usize = 8;

/// True if the run from `state` approaches the stable `orbit` as its multipliers say: nearer by a
/// factor 100 in the adapted norm, and to a hundredth of the orbit's size; or near it, a tenth of
/// its size away, for one decay time with the peaks of four stretches falling in sequence, at
/// half the linear rate at least, and with a free way ahead. Peaks, because near a flip or a
/// Neimark–Sacker point the distance falls only on average over the turns. The way ahead is the
/// linear decay from there and all phases of its slowest turns, where the map must contract, over one
/// return or a dozen. Where it is not free, as where a beat will bring the tip to a sample that it does
/// not touch yet, or the distance falls by less, the run is watched for decay times more. One that has
/// not arrived by then is not seen to approach.
///
/// Four stretches are one decay time long, or 2048 returns; a torus around the orbit that beats
/// more slowly than that, and happens to shrink meanwhile with a free way ahead, would be mistaken.
/// Where the map comes to its `largest_cost` the run is not seen to approach.
pub(crate) fn approaches<M: StroboscopicMap>(
    map: &mut M,
    state: &[f64],
    orbit: &PeriodicOrbit,
    largest_cost: u64,
) -> Result<bool, MapFailure> {
    let Some(mut approach) = Approach::new(map, state, orbit)? else {
        return Ok(false);
    };
    for _ in 0..approach.longest_watch {
        if map.cost() > largest_cost {
            break;
        }
        match approach.one_decay_time(map)? {
            Progress::Arrived => return Ok(true),
            Progress::Gone => return Ok(false),
            Progress::Falls if approach.has_free_way(map) => return Ok(true),
            Progress::Falls | Progress::Nearer => {}
        }
    }
    Ok(false)
}

/// Change of the distance to the orbit over one decay time.
enum Progress {
    /// It is small enough: the run has arrived.
    Arrived,
    /// It falls at the rate of the multipliers, near the orbit.
    Falls,
    /// It falls more slowly, or far from the orbit.
    Nearer,
    /// It does not fall, or has grown to four times the first distance.
    Gone,
}

/// A run that is checked for an approach to an orbit. Distances are in the adapted norm.
struct Approach<'a> {
    center: &'a [f64],
    period: usize,
    /// Natural logarithm of the largest multiplier's modulus, per return; negative.
    rate: f64,
    monodromy: DMatrix<f64>,
    adapted: AdaptedNorm,
    /// Distance within the rounding of one return; smaller ones are not resolved.
    floor: f64,
    x: Vec<f64>,
    /// Distance from the orbit when the check began.
    first: f64,
    /// Distance at which the run has arrived.
    near: f64,
    /// Distance below which the map near the orbit determines the rest of the way.
    nearby: f64,
    now: f64,
    /// Largest number of times that the run is watched for four stretches.
    longest_watch: usize,
}

impl<'a> Approach<'a> {
    /// Prepares the check; `None` if no norm is adapted to the orbit.
    fn new<M: StroboscopicMap>(
        map: &mut M,
        state: &[f64],
        orbit: &'a PeriodicOrbit,
    ) -> Result<Option<Self>, MapFailure> {
        let (d, n) = (state.len(), orbit.period);
        let center = &orbit.states[0];
        let mut work = ReturnMap::new(d);
        let monodromy = work.jacobian(map, center, n)?.clone();
        let Some(adapted) = AdaptedNorm::new(&monodromy, orbit.spectral_radius()) else {
            return Ok(None);
        };
        let nearest = (0..n)
            .min_by(|&a, &b| {
                distance(&orbit.states[a], state).total_cmp(&distance(&orbit.states[b], state))
            })
            .unwrap_or(0);
        let mut x = state.to_vec();
        for _ in 0..(n - nearest) % n {
            advance(map, &mut x)?;
        }
        let first = adapted.distance(&x, center);
        let floor = adapted.floor(center, &work.state);
        let size = adapted.radius(orbit.scale());
        // A motion at rest has no size.
        let far = if size > floor { first / size } else { 1.0 }.clamp(1.0, FARTHEST);
        let rate = nanotap_arithmetic::ln(orbit.spectral_radius());
        let shortened = (0.25 / -rate / LONGEST_STRETCH).clamp(1.0, SLOWEST);
        Ok(Some(Self {
            center,
            period: n,
            rate,
            floor,
            monodromy,
            adapted,
            x,
            first,
            near: floor.max(ARRIVED * first / far),
            nearby: if size > floor { NEARBY * size } else { first },
            now: first,
            longest_watch: (shortened * (LONGEST_WATCH + nanotap_arithmetic::ln(far))).ceil()
                as usize,
        }))
    }

    fn has_arrived(&self) -> bool {
        self.now <= self.near
    }

    /// Number of returns in one of the four stretches.
    fn stretch(&self) -> usize {
        (0.25 / -self.rate).ceil().clamp(16.0, LONGEST_STRETCH) as usize
    }

    /// Watches the run for four stretches.
    fn one_decay_time<M: StroboscopicMap>(&mut self, map: &mut M) -> Result<Progress, MapFailure> {
        if self.has_arrived() {
            return Ok(Progress::Arrived);
        }
        let mut highest = [0.0f64; 4];
        for peak in &mut highest {
            for _ in 0..self.stretch() {
                for _ in 0..self.period {
                    advance(map, &mut self.x)?;
                }
                self.now = self.adapted.distance(&self.x, self.center);
                if self.has_arrived() {
                    return Ok(Progress::Arrived);
                }
                if self.now > 4.0 * self.first {
                    return Ok(Progress::Gone);
                }
                *peak = peak.max(self.now);
            }
        }
        let wanted = 1.5 * self.stretch() as f64 * self.rate;
        let falls = highest.windows(2).all(|w| w[1] < w[0])
            && nanotap_arithmetic::ln(highest[3] / highest[0]) <= wanted;
        Ok(if falls && self.now <= self.nearby {
            Progress::Falls
        } else if falls || highest[3] < highest[0] {
            Progress::Nearer
        } else {
            Progress::Gone
        })
    }

    /// Whether the map contracts all along the linear decay from where the run is to where it has
    /// arrived, and at all phases of the slowest turns that it makes on the way.
    fn has_free_way<M: StroboscopicMap>(&self, map: &mut M) -> bool {
        let returns = nanotap_arithmetic::ln(self.near / self.now) / self.rate;
        let between = (returns / PLACES as f64).ceil().max(1.0) as u32;
        let decay = self.monodromy.pow(between);
        let mut away = DVector::from_iterator(
            self.x.len(),
            self.x.iter().zip(self.center).map(|(x, c)| x - c),
        );
        for _ in 0..PLACES {
            away = &decay * away;
            if !self.contracts(map, &away) {
                return false;
            }
        }
        let slowest = self.slowest_turns(&away);
        let halvings = std::iter::successors(Some(self.now), |radius| Some(0.5 * radius));
        halvings
            .take_while(|radius| *radius > self.near)
            .all(|radius| {
                slowest
                    .iter()
                    .all(|unit| self.contracts(map, &(unit * radius)))
            })
    }

    /// Returns whether one return from the displacement `away` comes nearer, or else a dozen
    /// returns together; false where the map fails.
    fn contracts<M: StroboscopicMap>(&self, map: &mut M, away: &DVector<f64>) -> bool {
        let mut place: Vec<f64> = self.center.iter().zip(away).map(|(c, a)| c + a).collect();
        let before = self.adapted.distance(&place, self.center);
        let mut wanted = before;
        for returns in 1..=DOZEN {
            if (0..self.period).any(|_| advance(map, &mut place).is_err()) {
                return false;
            }
            wanted *= self.adapted.rate_of_return();
            let after = self.adapted.distance(&place, self.center);
            if (returns == 1 || returns == DOZEN) && after <= wanted + self.floor {
                return true;
            }
        }
        false
    }

    /// Unit vectors of the adapted norm at all phases in the plane in which the remaining
    /// displacement `left` turns; both directions along a line if it does not turn.
    fn slowest_turns(&self, left: &DVector<f64>) -> Vec<DVector<f64>> {
        let later = self.adapted.coordinates(&(&self.monodromy * left));
        let first = self.adapted.coordinates(left).normalize();
        let mut across = &later - &first * first.dot(&later);
        let phases = if across.norm() > 1e-6 * later.norm() {
            across.normalize_mut();
            PHASES
        } else {
            across.fill(0.0);
            2
        };
        (0..phases)
            .map(|k| {
                let turn = 2.0 * k as f64 / phases as f64;
                let (sin, cos) = nanotap_arithmetic::sin_cos(std::f64::consts::PI * turn);
                let direction = &first * cos + &across * sin;
                let mut out = vec![0.0; direction.len()];
                self.adapted.unit_vector(direction.as_slice(), &mut out);
                DVector::from_vec(out)
            })
            // Where nothing is left of the decay there is no turn.
            .filter(|unit| unit.iter().all(|v| v.is_finite()))
            .collect()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::convert::Infallible;

    use super::*;
    use crate::orbit::{ShootingOptions, close_orbit};

    /// x → f(|x|) x on a line, with f'(0) f(0) = 0.999 for the orbit at rest.
    #[derive(Clone)]
    pub(in crate::classify) struct Line(pub(in crate::classify) fn(f64) -> f64);

    impl crate::Scheduling for Line {}

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

    /// Rest at 0 attracts, but nothing comes in from beyond 0.2.
    pub(in crate::classify) fn barred(x: f64) -> f64 {
        if (0.1..0.2).contains(&x) { 1.1 } else { 0.98 }
    }

    fn from_one(factor: fn(f64) -> f64) -> bool {
        let mut map = Line(factor);
        let rest = close_orbit(&mut map, &[0.0], 1, &ShootingOptions::default()).unwrap();
        assert_eq!(rest.spectral_radius(), factor(0.0));
        approaches(&mut map, &[1.0], &rest, u64::MAX).unwrap()
    }

    /// Beyond 1/2 the distance falls by another factor than at rest: at three fifths of the rate
    /// that is an approach, at a tenth and less it may be one to something else.
    #[test]
    fn an_approach_falls_at_half_the_linear_rate_at_least() {
        assert!(from_one(|_| 0.999));
        assert!(from_one(|x| if x > 0.5 { 0.9994 } else { 0.999 }));
        assert!(!from_one(|x| if x > 0.5 { 0.9999 } else { 0.999 }));
        assert!(!from_one(|x| if x > 0.5 { 1.0 } else { 0.999 }));
        assert!(!from_one(|x| if x > 0.5 { 1.5 } else { 0.999 }));
        assert!(from_one(|_| 0.5));
    }

    /// At 0.98 a decay time ends at 0.27, beyond a place from which the run comes back.
    #[test]
    fn no_run_approaches_an_orbit_that_something_bars() {
        assert!(!from_one(barred));
        // Within five decay times it comes twenty times nearer, and then no further.
        assert!(!from_one(|x| match x {
            0.05.. => 0.9994,
            0.02.. => 1.0001,
            _ => 0.999,
        }));
        assert!(from_one(|x| if x < 0.2 { 0.985 } else { 0.98 }));
    }
}
