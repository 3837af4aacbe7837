//! A neighbourhood of a stable orbit from which every motion goes to that orbit.
//!
//! It is a ball of the adapted norm (`adapted_norm.rs`) around one strobe
//! point x*. If the Jacobian of the return map Pⁿ has operator norm at most q < 1 at
//! *every* point of the ball, the mean value theorem (the ball is convex and Pⁿ is
//! C¹) gives ‖Pⁿ(x) − x*‖ ≤ q ‖x − x*‖: the ball maps into itself and everything in
//! it converges to the orbit.
//!
//! What is checked: the Jacobian norm and the contraction itself, at sample points
//! on the ball's axes and in pseudo-random directions, at its surface and at half
//! its radius; of the radius that passes, three quarters are used. That is a proof at the samples
//! and evidence between them; it can fail where the map changes on a scale below
//! the spacing of the samples, or for a map with square-root (hard impact) grazing
//! inside the ball, whose Jacobian is unbounded on a thin set. Hence
//! [`Neighbourhood::holds`] and its users ask, on entry, that the next return has
//! really contracted.

mod adapted_norm;

use nalgebra::DMatrix;

pub(crate) use adapted_norm::AdaptedNorm;

use crate::failure::{MapFailure, advance_by, advance_with_jacobian};
use crate::map::StroboscopicMap;
use crate::orbit::PeriodicOrbit;
use crate::vector::unit;

/// Factor between the radii tried, and between the radius that passes and the one used.
const SHRINK: f64 = 0.75;
/// Radii tried: down to 1e-10 of the orbit's scale.
const TRIALS: usize = 80;
/// Factor by which a block of returns contracts the distance at the samples.
const BLOCK_RATE: f64 = 0.75;
/// Decay time in drive periods above which a block is shorter than it.
const MAX_BLOCK: f64 = 2048.0;
/// Radius that is tried first of a block, as a part of the orbit's scale.
const FIRST_RADIUS: f64 = 1e-3;
/// Factors between radii tried as long as a block contracts: large ones first.
const GROWTH: [f64; 2] = [2.0, 1.4];
/// Pseudo-random directions in which a block is tried, in addition to the axes.
const DIRECTIONS: usize = 12;
/// Part of the distance to the nearest other orbit up to which a ball reaches.
const REACH: f64 = 0.7;

/// A contracting ball around the first state of a stable orbit.
#[derive(Clone, Debug)]
pub struct Neighbourhood {
    center: Vec<f64>,
    /// Drive periods over which it contracts: one return, or a block of them.
    period: usize,
    norm: AdaptedNorm,
    radius: f64,
    /// Factor by which it contracts in these.
    rate: f64,
    /// Periods after which a state in it that came no nearer is worth looking at again.
    retry: usize,
    /// −ln|μ| of the largest multiplier, per period.
    decay: f64,
    /// Half width of the box that holds the ball: a cheap first test.
    extents: Vec<f64>,
    /// Below this distance rounding hides any contraction.
    floor: f64,
}

impl Neighbourhood {
    /// The largest ball, of those that shrink by quarters from the orbit's scale, that
    /// passes the checks; `None` if the orbit is not stable or none passes.
    ///
    /// # Errors
    /// When the orbit itself cannot be followed.
    pub fn around<M: StroboscopicMap>(
        map: &mut M,
        orbit: &PeriodicOrbit,
    ) -> Result<Option<Self>, MapFailure> {
        let Some(mut ball) = Self::empty(map, orbit)? else {
            return Ok(None);
        };
        let mut work = Return::new(orbit.dimension());
        let mut radius = ball.norm.radius(orbit.scale().max(1e3 * orbit.error));
        for _ in 0..TRIALS {
            if radius < 8.0 * ball.floor {
                break;
            }
            if ball.contracts(map, radius, &mut work) {
                ball.set_radius(SHRINK * radius);
                return Ok(Some(ball));
            }
            radius *= SHRINK;
        }
        Ok(None)
    }

    /// The largest ball in which a block of returns, one decay time long, contracts by
    /// [`BLOCK_RATE`] at sample points, and that reaches over none of the `others`; `None` if the
    /// orbit is not stable or none passes. A block of many periods is a quarter as long and contracts
    /// by the fourth root. No larger ball is tried once the search has cost so many `steps`
    /// ([`StroboscopicMap::cost`]).
    ///
    /// # Errors
    /// When the orbit itself cannot be followed.
    pub(crate) fn over_block<'a, M: StroboscopicMap>(
        map: &mut M,
        orbit: &PeriodicOrbit,
        others: impl Iterator<Item = &'a PeriodicOrbit>,
        steps: u64,
    ) -> Result<Option<Self>, MapFailure> {
        let Some(mut ball) = Self::empty(map, orbit)? else {
            return Ok(None);
        };
        let decay_time = 1.0 / ball.decay;
        let (block, rate) = if decay_time > MAX_BLOCK {
            (0.25 * decay_time, BLOCK_RATE.sqrt().sqrt())
        } else {
            (decay_time, BLOCK_RATE)
        };
        let returns = (block / orbit.period as f64).ceil().max(1.0);
        ball.period = orbit.period.saturating_mul(returns as usize);
        ball.rate = rate;
        let largest_cost = map.cost().saturating_add(steps);
        ball.retry = ball.period;
        let size = orbit.scale().max(1e3 * orbit.error);
        let mut largest = ball.norm.radius(size);
        for other in others {
            largest = largest.min(REACH * ball.distance_to(other));
        }
        let mut radius = ball.norm.radius(FIRST_RADIUS * size).min(largest);
        while !ball.block_contracts(map, radius, largest_cost) {
            radius *= 0.25;
            if radius < 8.0 * ball.floor || map.cost() > largest_cost {
                return Ok(None);
            }
        }
        for growth in GROWTH {
            while growth * radius <= largest
                && ball.block_contracts(map, growth * radius, largest_cost)
            {
                radius *= growth;
            }
        }
        ball.set_radius(radius);
        Ok(Some(ball))
    }

    /// The ball of radius 0 around the first state of an orbit, with the rate of one return; `None`
    /// if the orbit is not stable.
    fn empty<M: StroboscopicMap>(
        map: &mut M,
        orbit: &PeriodicOrbit,
    ) -> Result<Option<Self>, MapFailure> {
        if !orbit.is_stable() {
            return Ok(None);
        }
        let center = orbit.states[0].clone();
        let mut work = Return::new(center.len());
        let monodromy = work.jacobian(map, &center, orbit.period)?.clone();
        let Some(norm) = AdaptedNorm::new(&monodromy, orbit.spectral_radius()) else {
            return Ok(None);
        };
        Ok(Some(Self {
            period: orbit.period,
            radius: 0.0,
            rate: norm.rate_of_return(),
            retry: 1,
            decay: -nanotap_arithmetic::ln(orbit.spectral_radius()) / orbit.period as f64,
            extents: vec![0.0; center.len()],
            floor: 10.0 * norm.floor(&center, &work.state),
            center,
            norm,
        }))
    }

    fn set_radius(&mut self, radius: f64) {
        self.radius = radius;
        self.extents = self.norm.extents();
        for extent in &mut self.extents {
            *extent *= radius;
        }
    }

    /// Distance of the centre from the nearest state of an orbit.
    fn distance_to(&self, orbit: &PeriodicOrbit) -> f64 {
        let distances = orbit.states.iter();
        let distances = distances.map(|state| self.norm.distance(state, &self.center));
        distances.fold(f64::INFINITY, f64::min)
    }

    /// Shrinks the ball if it reaches over an orbit that was found since.
    pub(crate) fn keep_clear_of(&mut self, orbit: &PeriodicOrbit) {
        let largest = REACH * self.distance_to(orbit);
        if self.radius > largest {
            self.set_radius(largest);
        }
    }

    /// True if `state` lies in the ball.
    #[inline]
    pub fn contains(&self, state: &[f64]) -> bool {
        for ((x, c), e) in state.iter().zip(&self.center).zip(&self.extents) {
            if (x - c).abs() > *e {
                return false;
            }
        }
        self.norm.distance(state, &self.center) <= self.radius
    }

    /// Radius in the adapted norm.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Factor by which one return contracts the distance at the samples, at least.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Half width of the ball along each coordinate.
    pub fn extents(&self) -> &[f64] {
        &self.extents
    }

    /// True if `state` lies in the ball and its next return really is nearer, by the
    /// ball's rate (or is at the orbit to rounding). `state` is left as it is.
    ///
    /// # Errors
    /// When the map cannot be followed from `state`.
    pub fn holds<M: StroboscopicMap>(
        &self,
        map: &mut M,
        state: &[f64],
        scratch: &mut [f64],
    ) -> Result<bool, MapFailure> {
        if !self.contains(state) {
            return Ok(false);
        }
        scratch.copy_from_slice(state);
        advance_by(map, scratch, self.period)?;
        let before = self.norm.distance(state, &self.center);
        let after = self.norm.distance(scratch, &self.center);
        Ok(after <= self.rate * before || after <= self.floor)
    }

    /// The checks of one return at one radius.
    fn contracts<M: StroboscopicMap>(&self, map: &mut M, radius: f64, work: &mut Return) -> bool {
        let d = self.center.len();
        let mut samples = (0..2 * d + 16 + 2 * d).flat_map(|k| [(k, 1.0), (k, 0.5)]);
        samples.all(|(sample, fraction)| {
            let point = self.point(sample, radius * fraction);
            let Ok(jacobian) = work.jacobian(map, &point, self.period) else {
                return false;
            };
            let before = self.norm.distance(&point, &self.center);
            self.norm.is_contracted_by(jacobian, self.rate)
                && self.norm.distance(&work.state, &self.center) <= self.rate * before + self.floor
        })
    }

    /// Whether a block of returns comes nearer from all samples at one radius; not where that takes the
    /// map to its largest cost.
    fn block_contracts<M: StroboscopicMap>(
        &self,
        map: &mut M,
        radius: f64,
        largest_cost: u64,
    ) -> bool {
        (0..2 * self.center.len() + DIRECTIONS).all(|sample| {
            let mut point = self.point(sample, radius);
            let before = self.norm.distance(&point, &self.center);
            map.cost() <= largest_cost
                && advance_by(map, &mut point, self.period).is_ok()
                && self.norm.distance(&point, &self.center) <= self.rate * before + self.floor
        })
    }

    /// A sample point so far from the centre.
    fn point(&self, sample: usize, radius: f64) -> Vec<f64> {
        let d = self.center.len();
        let (mut direction, mut offset) = (vec![0.0; d], vec![0.0; d]);
        sample_direction(sample, &mut direction);
        self.norm.unit_vector(&direction, &mut offset);
        let places = self.center.iter().zip(&offset);
        places.map(|(c, o)| c + radius * o).collect()
    }

    /// Drive periods after which it comes round again.
    pub(crate) fn period(&self) -> usize {
        self.period
    }

    /// Periods after which a state in it that came no nearer is worth looking at again.
    pub(crate) fn retry(&self) -> usize {
        self.retry
    }

    /// Periods after which `state` would have come to the ball if it came at the rate of the
    /// largest multiplier; 0 in the ball.
    pub(crate) fn periods_away(&self, state: &[f64]) -> f64 {
        let distance = self.norm.distance(state, &self.center);
        nanotap_arithmetic::ln(distance / self.radius).max(0.0) / self.decay
    }

    /// Periods after which a motion that comes from a box with these sides, and decays
    /// as the largest multiplier says, has entered the ball.
    pub(crate) fn expected_entry(&self, sides: &[f64]) -> f64 {
        nanotap_arithmetic::ln(self.widening(sides)) / self.decay
    }

    /// Periods that the slowest linear decay needs from a box with these sides to the
    /// ball: the natural length of a transient that is no chaos.
    pub fn relaxation(&self, sides: &[f64]) -> f64 {
        nanotap_arithmetic::ln(self.widening(sides)) * self.period as f64
            / -nanotap_arithmetic::ln(self.rate)
    }

    /// How many times wider than the ball a box with these sides is.
    fn widening(&self, sides: &[f64]) -> f64 {
        sides
            .iter()
            .zip(&self.extents)
            .map(|(s, e)| s / e.max(f64::MIN_POSITIVE))
            .fold(1.0, f64::max)
    }
}

/// Work space for the return map.
pub(crate) struct Return {
    /// Where the return ended.
    pub(crate) state: Vec<f64>,
    factor: DMatrix<f64>,
    product: DMatrix<f64>,
    next: DMatrix<f64>,
}

impl Return {
    pub(crate) fn new(d: usize) -> Self {
        Self {
            state: vec![0.0; d],
            factor: DMatrix::zeros(d, d),
            product: DMatrix::zeros(d, d),
            next: DMatrix::zeros(d, d),
        }
    }

    /// DPⁿ at `from`; `self.state` becomes Pⁿ(from).
    pub(crate) fn jacobian<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        from: &[f64],
        period: usize,
    ) -> Result<&DMatrix<f64>, MapFailure> {
        self.state.copy_from_slice(from);
        self.product.fill_with_identity();
        for _ in 0..period {
            advance_with_jacobian(map, &mut self.state, &mut self.factor)?;
            self.factor.mul_to(&self.product, &mut self.next);
            std::mem::swap(&mut self.product, &mut self.next);
        }
        Ok(&self.product)
    }
}

/// The axes both ways, then pseudo-random directions of length 1.
fn sample_direction(sample: usize, direction: &mut [f64]) {
    let d = direction.len();
    if sample < 2 * d {
        direction.fill(0.0);
        direction[sample / 2] = if sample.is_multiple_of(2) { 1.0 } else { -1.0 };
        return;
    }
    let mut counter = (sample as u64) << 24;
    let mut sum = 0.0;
    for v in direction.iter_mut() {
        // Sum of four uniforms: near enough to normal for an even spread.
        *v = -2.0;
        for _ in 0..4 {
            *v += unit(counter);
            counter += 1;
        }
        sum += *v * *v;
    }
    let length = sum.sqrt().max(f64::MIN_POSITIVE);
    for v in direction.iter_mut() {
        *v /= length;
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;
    use crate::orbit::{ShootingOptions, close_orbit};

    /// x → r x (1 − x), or every state where it is.
    #[derive(Clone)]
    enum Line {
        Logistic(f64),
        Still,
    }

    impl StroboscopicMap for Line {
        type Error = Infallible;

        fn dimension(&self) -> usize {
            1
        }

        fn period(&self) -> f64 {
            1.0
        }

        fn advance(&mut self, state: &mut [f64]) -> Result<(), Infallible> {
            if let Self::Logistic(r) = self {
                state[0] *= *r * (1.0 - state[0]);
            }
            Ok(())
        }

        fn advance_with_jacobian(
            &mut self,
            state: &mut [f64],
            jacobian: &mut DMatrix<f64>,
        ) -> Result<(), Infallible> {
            jacobian[(0, 0)] = match self {
                Self::Logistic(r) => *r * (1.0 - 2.0 * state[0]),
                Self::Still => 1.0,
            };
            self.advance(state)
        }
    }

    fn near(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    }

    /// The orbit of period 2 at r = 3.2 has the multiplier 4 + 2 r − r² = 0.16: 0.4 per period. The
    /// norm's rate is half way from there to 1, the ball's half way from the norm's.
    #[test]
    fn a_ball_tells_its_times_from_its_multiplier() {
        let mut map = Line::Logistic(3.2);
        let orbit = close_orbit(&mut map, &[0.5], 2, &ShootingOptions::default()).unwrap();
        let ball = Neighbourhood::around(&mut map, &orbit).unwrap().unwrap();
        assert_eq!(ball.period(), 2);
        near(ball.rate(), 0.79);
        let centre = orbit.states[0][0];
        let half = ball.extents()[0];
        assert!(ball.contains(&[centre + 0.999 * half]) && ball.contains(&[centre - 0.999 * half]));
        assert!(!ball.contains(&[centre + 1.001 * half]));
        // In one dimension the norm is the distance in some unit.
        near(
            ball.radius() / ball.norm.distance(&[centre + half], &[centre]),
            1.0,
        );
        let per_period = -0.4f64.ln();
        near(
            ball.periods_away(&[centre + 16.0 * half]),
            16f64.ln() / per_period,
        );
        assert_eq!(ball.periods_away(&[centre + 0.5 * half]), 0.0);
        near(ball.expected_entry(&[16.0 * half]), 16f64.ln() / per_period);
        assert_eq!(ball.expected_entry(&[0.5 * half]), 0.0);
        near(
            ball.relaxation(&[16.0 * half]),
            -2.0 * 16f64.ln() / 0.79f64.ln(),
        );
    }

    /// What stays where it is does not come nearer; at the orbit itself nothing can.
    #[test]
    fn a_ball_holds_what_comes_nearer() {
        let mut map = Line::Logistic(3.2);
        let orbit = close_orbit(&mut map, &[0.5], 2, &ShootingOptions::default()).unwrap();
        let ball = Neighbourhood::around(&mut map, &orbit).unwrap().unwrap();
        let (centre, half) = (orbit.states[0][0], ball.extents()[0]);
        let mut scratch = [0.0];
        let mut holds = |map: &mut Line, x: f64| ball.holds(map, &[x], &mut scratch).unwrap();
        assert!(holds(&mut map, centre + 0.9 * half));
        assert!(!holds(&mut map, centre + 1.1 * half));
        assert!(!holds(&mut Line::Still, centre + 0.9 * half));
        assert!(!holds(&mut Line::Still, centre + 1e-3 * half));
        assert!(holds(&mut Line::Still, centre));
    }

    /// The axes both ways, then unit vectors that favour no side.
    #[test]
    fn directions_are_spread_over_the_sphere() {
        let mut direction = [0.0; 3];
        for axis in 0..3 {
            for (k, sign) in [1.0, -1.0].into_iter().enumerate() {
                sample_direction(2 * axis + k, &mut direction);
                let mut expected = [0.0; 3];
                expected[axis] = sign;
                assert_eq!(direction, expected);
            }
        }
        let count = 2000;
        let (mut mean, mut square) = ([0.0; 3], [0.0; 3]);
        for sample in 6..6 + count {
            sample_direction(sample, &mut direction);
            let length: f64 = direction.iter().map(|x| x * x).sum();
            assert!((length - 1.0).abs() < 1e-14);
            for i in 0..3 {
                mean[i] += direction[i] / count as f64;
                square[i] += direction[i] * direction[i] / count as f64;
            }
        }
        // Means 0 ± 0.013, mean squares 1/3 ± 0.007 (one standard error).
        assert!(mean.iter().all(|m| m.abs() < 0.06), "{mean:?}");
        assert!(
            square.iter().all(|s| (s - 1.0 / 3.0).abs() < 0.03),
            "{square:?}"
        );
    }

    /// z → 0.98 e^{iθ} (1 + |z|²/40) z with θ = 1 + 40 |z|² turns faster farther out: near rest 0.98
    /// contracts, and beyond |z| = 0.9 the distance grows. The shear keeps a single return from
    /// contracting every vector where a block of them still contracts.
    #[derive(Clone)]
    struct Twist;

    impl StroboscopicMap for Twist {
        type Error = Infallible;

        fn dimension(&self) -> usize {
            2
        }

        fn period(&self) -> f64 {
            1.0
        }

        fn advance(&mut self, state: &mut [f64]) -> Result<(), Infallible> {
            let [x, y] = [state[0], state[1]];
            let square = x * x + y * y;
            let (sin, cos) = (1.0 + 40.0 * square).sin_cos();
            let factor = 0.98 * (1.0 + square / 40.0);
            state[0] = factor * (cos * x - sin * y);
            state[1] = factor * (sin * x + cos * y);
            Ok(())
        }

        fn advance_with_jacobian(
            &mut self,
            state: &mut [f64],
            jacobian: &mut DMatrix<f64>,
        ) -> Result<(), Infallible> {
            let step = 1e-7;
            for j in 0..2 {
                let [mut up, mut down] = [state.to_vec(), state.to_vec()];
                up[j] += step;
                down[j] -= step;
                self.advance(&mut up)?;
                self.advance(&mut down)?;
                for i in 0..2 {
                    jacobian[(i, j)] = (up[i] - down[i]) / (2.0 * step);
                }
            }
            self.advance(state)
        }
    }

    /// A block of ⌈1/−ln 0.98⌉ = 50 returns contracts by 0.98⁵⁰ = 0.36 at rest, and by 3/4 from
    /// |z| = 0.7, which iterating the factor gives.
    #[test]
    fn blocks_contract_farther_out_than_single_returns() {
        let mut map = Twist;
        let options = ShootingOptions {
            residual_tolerance: 1e-6,
            ..ShootingOptions::default()
        };
        let orbit = PeriodicOrbit {
            states: vec![vec![0.0, 0.0]],
            error: 1e-3,
            ..close_orbit(&mut map, &[1e-3, 0.0], 1, &options).unwrap()
        };
        let single = Neighbourhood::around(&mut map, &orbit).unwrap().unwrap();
        let none = || std::iter::empty::<&PeriodicOrbit>();
        let block = Neighbourhood::over_block(&mut map, &orbit, none(), u64::MAX)
            .unwrap()
            .unwrap();
        assert_eq!(block.period(), 50);
        assert!(
            block.extents()[0] > 10.0 * single.extents()[0],
            "{block:?} {single:?}"
        );
        let contraction = |from: f64| {
            let image = |r: f64, _| 0.98 * (1.0 + r * r / 40.0) * r;
            (0..50).fold(from, image) / from
        };
        assert!(contraction(block.extents()[0]) <= 0.75);
        assert!(
            block
                .holds(&mut map, &[0.9 * block.extents()[0], 0.0], &mut [0.0; 2])
                .unwrap()
        );
        // Another orbit in it ends it before that.
        let other = PeriodicOrbit {
            states: vec![vec![0.5 * block.extents()[0], 0.0]],
            ..orbit.clone()
        };
        let apart = other.states[0][0];
        let smaller =
            Neighbourhood::over_block(&mut map, &orbit, std::iter::once(&other), u64::MAX);
        let smaller = smaller.unwrap().unwrap();
        assert!(smaller.extents()[0] < 0.75 * apart && !smaller.contains(&other.states[0]));
        let mut cut = block;
        cut.keep_clear_of(&other);
        assert!(!cut.contains(&other.states[0]));
        near(cut.extents()[0], 0.7 * apart);
    }
}
