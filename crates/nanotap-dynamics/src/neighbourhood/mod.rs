//! A neighbourhood of a stable orbit from which every motion converges to that orbit.
//!
//! The neighbourhood is a ball of the adapted norm (`adapted_norm.rs`) around one strobe point x*.
//! If the Jacobian of the return map Pⁿ has operator norm at most q < 1 at *every* point of the
//! ball, the mean value theorem (the ball is convex and Pⁿ is C¹) gives ‖Pⁿ(x) − x*‖ ≤ q ‖x − x*‖:
//! the ball maps into itself, and every motion in it converges to the orbit.
//!
//! The Jacobian norm and the contraction itself are checked at sample points on the axes of the
//! ball and in pseudo-random directions, at its surface and at half its radius. Three quarters of
//! the largest radius that passes are used. This is a proof at the samples and evidence between
//! them. It can fail where the map changes on a scale below the spacing of the samples, or for a
//! map with square-root (hard impact) grazing inside the ball, whose Jacobian is unbounded on a
//! thin set. [`Neighbourhood::holds`] therefore checks that the next return has contracted.
//! really contracted.

mod adapted_norm;

use nalgebra::DMatrix;

pub(crate) use adapted_norm::AdaptedNorm;

use crate::failure::{MapFailure, advance_by, advance_with_jacobian};
use crate::map::StroboscopicMap;
use crate::orbit::PeriodicOrbit;
use crate::random::unit;

/// Ratio of successive trial radii, and of the radius used to the radius that passes.
const SHRINK: f64 = 0.75;
/// Number of trial radii: down to 1e-10 of the orbit's scale.
const MAX_TRIALS: usize = 80;
/// Required contraction of the distance by a block of returns.
const BLOCK_RATE: f64 = 0.75;
/// Decay time in drive periods above which a block is shorter than it.
const MAX_BLOCK: f64 = 2048.0;
/// First trial radius of a block, as a fraction of the orbit's scale.
const FIRST_RADIUS: f64 = 1e-3;
/// Ratios of successive trial radii while a block contracts, largest first.
const GROWTH: [f64; 2] = [2.0, 1.4];
/// Number of pseudo-random directions in which a block is tested, in addition to the axes.
const DIRECTIONS: usize = 12;
/// Largest extent of a ball, as a fraction of the distance to the nearest other orbit.
const MAX_REACH: f64 = 0.7;

/// A contracting ball around the first state of a stable orbit.
#[derive(Clone, Debug)]
pub struct Neighbourhood {
    center: Vec<f64>,
    /// Drive periods of one contraction: one return, or a block of returns.
    period: usize,
    norm: AdaptedNorm,
    radius: f64,
    /// Contraction rate over these periods.
    rate: f64,
    /// Periods after which to check a state in the ball again that came no nearer.
    retry: usize,
    /// −ln|μ| of the largest multiplier, per period.
    decay: f64,
    /// Half widths of the ball's bounding box, in units of the state: a cheap first test.
    extents: Vec<f64>,
    /// Below this distance rounding hides any contraction.
    floor: f64,
}

impl Neighbourhood {
    /// The largest ball that passes the checks, for radii that decrease by a quarter from the
    /// orbit's scale; `None` if the orbit is not stable or no radius passes.
    ///
    /// # Errors
    /// If the map fails on the orbit.
    pub fn around<M: StroboscopicMap>(
        map: &mut M,
        orbit: &PeriodicOrbit,
    ) -> Result<Option<Self>, MapFailure> {
        let Some(mut ball) = Self::empty(map, orbit)? else {
            return Ok(None);
        };
        let mut work = ReturnMap::new(orbit.dimension());
        let mut radius = ball.norm.radius(orbit.scale().max(1e3 * orbit.error));
        for _ in 0..MAX_TRIALS {
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
    /// ([`Scheduling::cost`]).
    ///
    /// # Errors
    /// If the map fails on the orbit.
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
            largest = largest.min(MAX_REACH * ball.distance_to(other));
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
        let mut work = ReturnMap::new(center.len());
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

    /// Shrinks the ball if it comes too close to a newly found orbit.
    pub(crate) fn keep_clear_of(&mut self, orbit: &PeriodicOrbit) {
        let largest = MAX_REACH * self.distance_to(orbit);
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

    /// Radius in the adapted norm (dimensionless).
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Contraction rate of the distance over one return at the samples.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Half width of the ball along each coordinate, in units of the state.
    pub fn extents(&self) -> &[f64] {
        &self.extents
    }

    /// True if `state` lies in the ball and its next return is nearer by the ball's rate, or at the
    /// orbit to rounding. `state` is not changed.
    ///
    /// # Errors
    /// If the map fails.
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

    /// Checks one return at one radius.
    fn contracts<M: StroboscopicMap>(
        &self,
        map: &mut M,
        radius: f64,
        work: &mut ReturnMap,
    ) -> bool {
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

    /// A sample point at this distance from the centre.
    fn point(&self, sample: usize, radius: f64) -> Vec<f64> {
        let d = self.center.len();
        let (mut direction, mut offset) = (vec![0.0; d], vec![0.0; d]);
        sample_direction(sample, &mut direction);
        self.norm.unit_vector(&direction, &mut offset);
        let places = self.center.iter().zip(&offset);
        places.map(|(c, o)| c + radius * o).collect()
    }

    /// Drive periods of one contraction.
    pub(crate) fn period(&self) -> usize {
        self.period
    }

    /// Periods after which to check a state in the ball again that came no nearer.
    pub(crate) fn retry(&self) -> usize {
        self.retry
    }

    /// Periods until `state` reaches the ball at the rate of the largest multiplier; 0 in the ball.
    pub(crate) fn periods_away(&self, state: &[f64]) -> f64 {
        let distance = self.norm.distance(state, &self.center);
        nanotap_arithmetic::ln(distance / self.radius).max(0.0) / self.decay
    }

    /// Periods until a motion from a box with these sides enters the ball at the rate of the
    /// largest multiplier.
    pub(crate) fn expected_entry(&self, sides: &[f64]) -> f64 {
        nanotap_arithmetic::ln(self.widening(sides)) / self.decay
    }

    /// Periods of the slowest linear decay from a box with these sides to the ball: the length of a
    /// transient without chaos.
    pub fn relaxation(&self, sides: &[f64]) -> f64 {
        nanotap_arithmetic::ln(self.widening(sides)) * self.period as f64
            / -nanotap_arithmetic::ln(self.rate)
    }

    /// Ratio of a box with these sides to the ball.
    fn widening(&self, sides: &[f64]) -> f64 {
        sides
            .iter()
            .zip(&self.extents)
            .map(|(s, e)| s / e.max(f64::MIN_POSITIVE))
            .fold(1.0, f64::max)
    }
}

/// Work space for the return map.
pub(crate) struct ReturnMap {
    /// State at the end of the return.
    pub(crate) state: Vec<f64>,
    factor: DMatrix<f64>,
    product: DMatrix<f64>,
    next: DMatrix<f64>,
}

impl ReturnMap {
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

/// The axes in both directions, then pseudo-random unit vectors.
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
        // The sum of four uniforms is close enough to a normal distribution for an even spread.
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

    /// x → r x (1 − x), or the identity.
    #[derive(Clone)]
    enum Line {
        Logistic(f64),
        Still,
    }

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
    /// norm's rate is half way between 0.16 and 1, the ball's half way between the norm's and 1.
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
        // In one dimension the norm is the distance up to a factor.
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

    /// A state that does not move does not contract; at the orbit itself nothing can.
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

    /// The axes in both directions, then unit vectors without a preferred direction.
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

    /// z → 0.98 e^{iθ} (1 + |z|²/40) z with θ = 1 + 40 |z|² rotates faster at larger radius. Near 0
    /// the factor 0.98 contracts; beyond |z| = 0.9 the distance grows. Because of the shear a
    /// single return does not contract every vector, while a block of returns does.
    #[derive(Clone)]
    struct Twist;

    impl crate::Scheduling for Twist {}

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

    /// A block of ⌈1/−ln 0.98⌉ = 50 returns contracts by 0.98⁵⁰ = 0.36 at 0, and by 3/4 from |z| =
    /// 0.7, as iteration of the factor gives.
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
        // Another orbit inside the ball limits it.
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
