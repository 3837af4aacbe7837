//! The one motion that leaves a rigid stop after sticking.
//!
//! An oscillator that has come to rest on its stop leaves it where the force on it changes sign:
//! at x = gap, v = 0 and the drive phase θ with F cos θ = k · gap, whatever happened before. So one
//! stick decides all that follows, and a second one makes the motion exactly periodic, with
//! multipliers that are zero. This module follows the motion from that state to its next stick. Between
//! two impacts it is known in closed form. Errors grow on the way as on a chaotic motion: by 10³⁹ over
//! the 170 drive periods of the orbit at ω = 2.9, k = F = m = 1, r = 0.8, without damping and gap. So it
//! is evaluated with 38 digits and, if those do not suffice, with 134. The errors are carried along as
//! a covariance. Where they reach a thousandth of the motion, or leave open whether a grazing touches
//! the stop, the motion is not resolved any further. Each number of the oscillator stands for the
//! shortest decimal that is read as it.
//!
//! In the phase θ = ωt and the distance ξ = x − gap, in units of |F|/(mω²), the equation is ξ″ + 2δ ξ′
//! + κ (ξ + gap) = ± cos θ, with δ = c/(2mω) and κ = k/(mω²).

use std::sync::{Arc, OnceLock};

use nanotap_dynamics::AfterReset;

use crate::fixed_point::Fixed;
use crate::oscillator::{Oscillator, Stop};

/// Number of drive periods for which the motion is followed at most.
pub const MAX_PERIODS: usize = 512;
/// Largest number of steps of the search.
const MAX_STEPS: usize = 1_000_000;
/// Largest number of impacts of the search.
const MAX_IMPACTS: usize = 20_000;
/// Largest standard error of the state, as a part of its size, at which it counts as known.
const KNOWN: f64 = 1e-3;
/// Rounding error of a step, in units of the last place times the size of the numbers.
const ROUNDING: f64 = 64.0;
/// Number of standard errors by which a gap must differ from zero.
const CLEAR: f64 = 10.0;
/// Smallest step of the search for an impact, in radians of the drive.
const SHORTEST_STEP: f64 = 1e-13;
/// Largest change of the pressing force, as a part of it, during the rest of a chatter at which the
/// rest is a geometric series.
const CHATTER_CHANGE: f64 = 1e-8;
/// Smallest velocity ξ′ of an impact whose instant is determined.
const SLOWEST_IMPACT: f64 = 1e-15;
/// Largest number of Newton steps to an impact.
const MAX_NEWTON_STEPS: usize = 60;
/// Largest order of a Taylor series.
const MAX_ORDER: u32 = 200;
/// Smallest difference of |k · gap / F| from 1: where the drive only just lifts the mass off the stop,
/// the phase of the release is not determined.
const WEAKEST_RELEASE: f64 = 1e-9;

/// The motion of an oscillator from the state in which it leaves its stop.
#[derive(Clone, Debug, PartialEq)]
pub enum ReleaseMotion {
    /// It never leaves: the force always presses it on the stop.
    Rests,
    /// It sticks again.
    Sticks {
        /// Drive periods from one release to the next.
        period: usize,
        /// Time from the release to the end of the next chatter, in drive periods.
        stuck_after: f64,
        /// States (x, v) at drive phase 0 of all periods, the first one after the release first, in the
        /// oscillator's units.
        states: Vec<[f64; 2]>,
    },
    /// It does not stick as far as it was followed.
    Open {
        /// Drive periods for which it was followed.
        periods: usize,
        /// Whether it is still known there to the precision of the calculation.
        is_resolved: bool,
        /// First state at drive phase 0 after the release, in the oscillator's units.
        state: [f64; 2],
    },
}

/// The release from the stop of one oscillator; its motion is computed when first needed.
#[derive(Debug)]
pub struct Release {
    oscillator: Oscillator,
    motion: OnceLock<ReleaseMotion>,
    outcome: OnceLock<Arc<AfterReset>>,
}

impl PartialEq for Release {
    fn eq(&self, other: &Self) -> bool {
        self.oscillator == other.oscillator
    }
}

impl Release {
    /// The release of an oscillator; `None` where there is none that is the same after every stick:
    /// without a rigid stop, without losses at impacts (no chatter ends), or where the drive is too
    /// weak or too nearly too weak to lift the mass off.
    pub fn new(oscillator: &Oscillator) -> Option<Arc<Self>> {
        let Stop::Rigid { restitution } = oscillator.stop else {
            return None;
        };
        let press = oscillator.stiffness * oscillator.gap;
        let margin = oscillator.forcing.abs() - press.abs();
        let never_leaves = press < 0.0 && margin < -WEAKEST_RELEASE * press.abs();
        let leaves = margin > WEAKEST_RELEASE * oscillator.forcing.abs();
        (restitution < 1.0 && (leaves || never_leaves)).then(|| {
            Arc::new(Self {
                oscillator: *oscillator,
                motion: OnceLock::new(),
                outcome: OnceLock::new(),
            })
        })
    }

    /// The release from a stop at `gap`.
    pub(crate) fn moved_to(&self, gap: f64) -> Option<Arc<Self>> {
        let oscillator = self.oscillator;
        Self::new(&Oscillator { gap, ..oscillator })
    }

    /// The motion from the release as the analysis of the map sees it, which `describe` gives when it
    /// is first needed.
    pub(crate) fn outcome(&self, describe: impl FnOnce() -> AfterReset) -> Arc<AfterReset> {
        Arc::clone(self.outcome.get_or_init(|| Arc::new(describe())))
    }

    /// The motion from the release.
    pub fn motion(&self) -> &ReleaseMotion {
        self.motion.get_or_init(|| {
            let Oscillator {
                stiffness,
                forcing,
                gap,
                ..
            } = self.oscillator;
            if -stiffness * gap > forcing.abs() {
                ReleaseMotion::Rests
            } else {
                match Follower::<3>::new(&self.oscillator).run(MAX_PERIODS) {
                    ReleaseMotion::Open {
                        is_resolved: false, ..
                    } => Follower::<8>::new(&self.oscillator).run(MAX_PERIODS),
                    motion => motion,
                }
            }
        })
    }
}

/// A 2 × 2 matrix.
type Matrix<T> = [[T; 2]; 2];

/// A decimal number: digits · 10^exponent with a sign.
#[derive(Clone, Copy)]
struct Decimal {
    digits: u64,
    exponent: i32,
    is_negative: bool,
}

impl Decimal {
    /// The shortest decimal that is read as `value`, which is finite.
    fn of(value: f64) -> Self {
        let written = format!("{:e}", value.abs());
        let (mantissa, exponent) = written.split_once('e').unwrap_or((&written, "0"));
        let fraction = mantissa.split_once('.').map_or(0, |(_, after)| after.len());
        Self {
            digits: mantissa.replace('.', "").parse().unwrap_or(0),
            exponent: exponent.parse::<i32>().unwrap_or(0) - fraction as i32,
            is_negative: value < 0.0,
        }
    }

    /// Its digits as a number from 0.1 to 1, and the power of ten that it lacks.
    fn normalised<const N: usize>(self) -> (Fixed<N>, i32) {
        let mut mantissa = Fixed::whole(self.digits as i64);
        let mut exponent = self.exponent;
        let mut size = self.digits;
        while size > 0 {
            mantissa = mantissa.over(10);
            size /= 10;
            exponent += 1;
        }
        (
            if self.is_negative {
                -mantissa
            } else {
                mantissa
            },
            exponent,
        )
    }
}

/// The quotient of two products of decimals; at most 10¹⁵, beyond which it is not needed exactly.
fn quotient<const N: usize>(numerator: &[f64], denominator: &[f64]) -> Fixed<N> {
    let product = |factors: &[f64]| {
        factors
            .iter()
            .fold((Fixed::whole(1), 0), |(product, exponent), &factor| {
                let (mantissa, more) = Decimal::of(factor).normalised();
                (product * mantissa, exponent + more)
            })
    };
    let ((above, up), (below, down)) = (product(numerator), product(denominator));
    let mut value: Fixed<N> = above.divided_by(below);
    let exponent = (up - down).clamp(-400, 12);
    for _ in 0..exponent.unsigned_abs() {
        value = if exponent < 0 {
            value.over(10)
        } else {
            value.times(10)
        };
    }
    value
}

/// Where a motion is.
#[derive(Clone, Copy)]
struct Position<const N: usize> {
    /// Phase within the drive period, rad.
    phase: Fixed<N>,
    /// cos θ and sin θ.
    phasor: [Fixed<N>; 2],
    /// Deviation from the forced response and its rate: y and y′.
    own: [Fixed<N>; 2],
    /// Covariance of the error of (ξ, ξ′).
    covariance: Matrix<f64>,
}

/// The motion is not followed any further.
struct Unresolved;

/// A motion that is followed, with the constants of its equation.
struct Follower<const N: usize> {
    /// Unit of length |F|/(mω²), and ω, in the oscillator's units.
    length: f64,
    omega: f64,
    /// The stop's place in the oscillator's units.
    stop: f64,
    /// δ, κ, the sign of F, and the gap.
    damping: Fixed<N>,
    stiffness: Fixed<N>,
    force: Fixed<N>,
    gap: Fixed<N>,
    restitution: Fixed<N>,
    /// The same in doubles.
    rough: Rough,
    /// The forced response is A cos θ + B sin θ.
    response: [Fixed<N>; 2],
    /// Longest step, rad, with its flow and its phasor.
    step: f64,
    step_flow: Matrix<Fixed<N>>,
    step_phasor: [Fixed<N>; 2],
    /// 2π.
    turn: Fixed<N>,
    steps: usize,
    /// Whole drive periods passed.
    periods: usize,
    states: Vec<[f64; 2]>,
}

/// Constants of the equation in doubles.
struct Rough {
    damping: f64,
    stiffness: f64,
    gap: f64,
    restitution: f64,
    /// Bound |A| + |B| on the forced response and its derivatives.
    amplitude: f64,
    /// Bound q on the rate of the free motion: |y⁽ⁿ⁾| ≤ qⁿ⁻¹ √(y′² + κ y²).
    fastest: f64,
}

impl<const N: usize> Follower<N> {
    fn new(oscillator: &Oscillator) -> Self {
        let Oscillator {
            mass,
            stiffness,
            damping,
            forcing,
            omega,
            gap,
            stop,
        } = *oscillator;
        let restitution = match stop {
            Stop::Rigid { restitution } => restitution,
            Stop::Soft { .. } => 0.0,
        };
        let force = Fixed::whole(if forcing < 0.0 { -1 } else { 1 });
        let damping: Fixed<N> = quotient(&[damping], &[2.0, mass, omega]);
        let stiffness: Fixed<N> = quotient(&[stiffness], &[mass, omega, omega]);
        let detuning = stiffness - Fixed::whole(1);
        let square = detuning * detuning + (damping * damping).times(4);
        let response = [
            (force * detuning).divided_by(square),
            (force * damping.times(2)).divided_by(square),
        ];
        let place: Fixed<N> = quotient(&[gap, mass, omega, omega], &[forcing.abs()]);
        let rough = Rough {
            damping: damping.to_f64(),
            stiffness: stiffness.to_f64(),
            gap: place.to_f64(),
            restitution,
            amplitude: response.iter().map(|part| part.to_f64().abs()).sum(),
            fastest: 2.0 * damping.to_f64() + stiffness.to_f64().sqrt(),
        };
        let step = (std::f64::consts::TAU / 64.0).min(0.25 / rough.fastest.max(1.0));
        let mut follower = Self {
            length: forcing.abs() / (mass * omega * omega),
            omega,
            stop: gap,
            damping,
            stiffness,
            force,
            gap: place,
            restitution: quotient(&[restitution], &[1.0]),
            rough,
            response,
            step,
            step_flow: identity(),
            step_phasor: turned(Fixed::new(step)),
            turn: Fixed::tau(),
            steps: 0,
            periods: 0,
            states: Vec::new(),
        };
        follower.step_flow = follower.flow(Fixed::new(step));
        follower
    }

    /// Follows the motion from the release to the next stick, or for `longest` drive periods.
    fn run(mut self, longest: usize) -> ReleaseMotion {
        let released = self.released_at();
        let still = [[0.0; 2]; 2];
        let mut position = self.at_stop(released, turned(released), Fixed::ZERO, still);
        for _ in 0..MAX_IMPACTS {
            if self.fly(&mut position, longest).is_err() {
                break;
            }
            if self.periods >= longest {
                return self.open(true, &position);
            }
            if let Some(rest) = self.impact(&mut position) {
                let since = (position.phase - released).to_f64() + rest;
                let stuck_after = self.periods as f64 + since / std::f64::consts::TAU;
                let period = stuck_after.ceil().max(1.0) as usize;
                // Phase 0 of the last period may come while it sticks.
                self.states.resize(period, [self.stop, 0.0]);
                return ReleaseMotion::Sticks {
                    period,
                    stuck_after,
                    states: self.states,
                };
            }
        }
        self.open(false, &position)
    }

    /// The end of a motion that did not stick so far.
    fn open(self, is_resolved: bool, position: &Position<N>) -> ReleaseMotion {
        let state = self.states.first().copied();
        ReleaseMotion::Open {
            periods: self.periods,
            is_resolved,
            state: state.unwrap_or_else(|| self.state(position)),
        }
    }

    /// Phase at which the force on the resting mass changes its sign and pulls it off the stop.
    fn released_at(&self) -> Fixed<N> {
        let ratio = self.stiffness * self.gap * self.force;
        let mut phase = Fixed::new(nanotap_arithmetic::acos(ratio.to_f64()));
        // Newton's method doubles the digits.
        for _ in 0..2 * N {
            let [cos, sin] = turned(phase);
            phase = phase + (cos - ratio).divided_by(sin);
        }
        if self.force == Fixed::whole(1) {
            phase
        } else {
            self.turn - phase
        }
    }

    /// Forced response and its derivative.
    fn forced(&self, [cos, sin]: [Fixed<N>; 2]) -> [Fixed<N>; 2] {
        let [a, b] = self.response;
        [a * cos + b * sin, b * cos - a * sin]
    }

    /// The position on the stop with velocity ξ′.
    fn at_stop(
        &self,
        phase: Fixed<N>,
        phasor: [Fixed<N>; 2],
        rate: Fixed<N>,
        covariance: Matrix<f64>,
    ) -> Position<N> {
        let [place, speed] = self.forced(phasor);
        Position {
            phase,
            phasor,
            own: [self.gap - place, rate - speed],
            covariance,
        }
    }

    /// ξ and ξ′.
    fn distance(&self, position: &Position<N>) -> [Fixed<N>; 2] {
        let [place, speed] = self.forced(position.phasor);
        [position.own[0] + place - self.gap, position.own[1] + speed]
    }

    /// The state (x, v) in the oscillator's units.
    fn state(&self, position: &Position<N>) -> [f64; 2] {
        let [distance, rate] = self.distance(position);
        [
            ((distance + self.gap).to_f64() * self.length).min(self.stop),
            rate.to_f64() * self.length * self.omega,
        ]
    }

    /// ξ″ at the stop with a rate ξ′.
    fn acceleration(&self, [cos, _]: [Fixed<N>; 2], rate: Fixed<N>) -> f64 {
        let force = self.force * cos - self.stiffness * self.gap;
        (force - self.damping.times(2) * rate).to_f64()
    }

    /// The flow of (y, y′) over a length of phase: the exponential of its matrix by a Taylor series,
    /// and repeated squaring of what exceeds the identity.
    fn flow(&self, length: Fixed<N>) -> Matrix<Fixed<N>> {
        let size = length.to_f64().abs() * (1.0 + self.rough.fastest).powi(2);
        let (part, halvings) = halved(length, size);
        let matrix = [
            [Fixed::ZERO, part],
            [-(self.stiffness * part), -(self.damping.times(2) * part)],
        ];
        let (mut term, mut sum, mut order) = (matrix, matrix, 2);
        while term != [[Fixed::ZERO; 2]; 2] && order < MAX_ORDER {
            term = product(&term, &matrix).map(|row| row.map(|entry| entry.over(order)));
            sum = plus(&sum, &term);
            order += 1;
        }
        for _ in 0..halvings {
            sum = plus(&plus(&sum, &sum), &product(&sum, &sum));
        }
        plus(&sum, &identity())
    }

    /// The position after a length of phase in flight.
    fn after(&self, position: &Position<N>, length: Fixed<N>) -> Position<N> {
        let (flow, turn) = if length == Fixed::new(self.step) {
            (self.step_flow, self.step_phasor)
        } else {
            (self.flow(length), turned(length))
        };
        let [y, rate] = position.own;
        let tangent = flow.map(|row| row.map(Fixed::to_f64));
        let own = flow.map(|[a, b]| a * y + b * rate);
        let mut covariance = carried(&tangent, &position.covariance);
        let sizes = own.iter().map(|part| part.to_f64().abs());
        let size = 1.0 + self.rough.amplitude + self.rough.gap.abs() + sizes.sum::<f64>();
        let rounding = ROUNDING * Fixed::<N>::unit() * size;
        for (k, row) in covariance.iter_mut().enumerate() {
            row[k] += rounding * rounding;
        }
        Position {
            phase: position.phase + length,
            phasor: complex_product(position.phasor, turn),
            own,
            covariance,
        }
    }

    /// Bounds on the derivatives of ξ of order 2, 3 and 4 for the rest of a flight.
    fn bounds(&self, position: &Position<N>) -> [f64; 3] {
        let [y, rate] = position.own.map(Fixed::to_f64);
        let energy = nanotap_arithmetic::hypot(rate, self.rough.stiffness.sqrt() * y);
        [1, 2, 3].map(|power| self.rough.amplitude + self.rough.fastest.powi(power) * energy)
    }

    /// Standard error of the distance, times [`CLEAR`].
    fn noise(position: &Position<N>) -> f64 {
        CLEAR * position.covariance[0][0].sqrt()
    }

    /// Whether the state is known to a thousandth of its size.
    fn is_known(&self, position: &Position<N>) -> bool {
        let [[a, _], [_, b]] = position.covariance;
        let [y, rate] = position.own.map(Fixed::to_f64);
        let size = self.rough.amplitude.max(y.abs()).max(rate.abs());
        (a + b).sqrt() <= KNOWN * size
    }

    /// Flies to the next impact, or until `longest` periods are over.
    fn fly(&mut self, position: &mut Position<N>, longest: usize) -> Result<(), Unresolved> {
        let bounds = self.bounds(position);
        let start = self.first_step(position, bounds);
        self.pass(position, start, longest)?;
        let mut step = start.max(SHORTEST_STEP);
        while self.periods < longest {
            self.steps += 1;
            if self.steps > MAX_STEPS || !self.is_known(position) {
                return Err(Unresolved);
            }
            let left = self.turn - position.phase;
            let length = if step.min(self.step) < left.to_f64() {
                Fixed::new(step.min(self.step))
            } else {
                left
            };
            let next = self.after(position, length);
            let [from, to] = [&*position, &next].map(|at| self.distance(at).map(Fixed::to_f64));
            let noise = Self::noise(&next).max(Self::noise(position));
            let s = length.to_f64();
            // The cubic through both ends in Bernstein form, and its error.
            let inner = [from[0] + s * from[1] / 3.0, to[0] - s * to[1] / 3.0];
            let highest = inner[0].max(inner[1]).max(from[0]).max(to[0]);
            let error = bounds[2] * s.powi(4) / 384.0;
            if highest + error + noise < 0.0 {
                self.end_step(position, next);
                step = 2.0 * s;
            } else if to[0] >= -noise && from[1] > bounds[0] * s {
                // The distance rises all the time: it is zero once.
                return self.to_impact(position, s);
            } else {
                step = 0.5 * s;
                if step < SHORTEST_STEP {
                    return Err(Unresolved);
                }
            }
        }
        Ok(())
    }

    /// Length of phase from a departure for which the distance is certainly negative.
    fn first_step(&self, position: &Position<N>, [_, third, fourth]: [f64; 3]) -> f64 {
        let [_, rate] = self.distance(position);
        let acceleration = self.acceleration(position.phasor, rate);
        let (rate, h) = (rate.to_f64(), self.step);
        let length = if rate < 0.0 {
            // −|v| s + a s²/2 + M s³/6 < 0
            0.9 * -rate / (0.5 * acceleration.max(0.0) + third * h / 6.0)
        } else if acceleration.abs() > 1e-20 * third {
            0.9 * 3.0 * acceleration.abs() / third
        } else {
            // Released: ξ‴ = ∓ sin θ.
            0.9 * 4.0 * position.phasor[1].to_f64().abs() / fourth
        };
        length.min(h)
    }

    /// Passes a stretch without impact, and any end of a drive period in it.
    fn pass(
        &mut self,
        position: &mut Position<N>,
        length: f64,
        longest: usize,
    ) -> Result<(), Unresolved> {
        let mut rest = Fixed::new(length);
        while rest.to_f64() > 0.0 && self.periods < longest {
            self.steps += 1;
            if self.steps > MAX_STEPS {
                return Err(Unresolved);
            }
            let left = self.turn - position.phase;
            let part = if rest.to_f64() < left.to_f64() {
                rest
            } else {
                left
            };
            let next = self.after(position, part);
            self.end_step(position, next);
            rest = rest - part;
        }
        Ok(())
    }

    /// Takes the position at the end of a step; at the end of a drive period its state is kept.
    fn end_step(&mut self, position: &mut Position<N>, next: Position<N>) {
        *position = next;
        if position.phase == self.turn {
            position.phase = Fixed::ZERO;
            position.phasor = [Fixed::whole(1), Fixed::ZERO];
            self.periods += 1;
            self.states.push(self.state(position));
        }
    }

    /// Goes to the only impact within `length`, by Newton's method.
    fn to_impact(&self, position: &mut Position<N>, length: f64) -> Result<(), Unresolved> {
        let step = |at: &Position<N>| {
            let [distance, rate] = self.distance(at);
            let is_fast = rate.to_f64() > SLOWEST_IMPACT;
            is_fast.then(|| distance.divided_by(rate)).ok_or(Unresolved)
        };
        let mut at = -step(position)?;
        for _ in 0..MAX_NEWTON_STEPS {
            if !(at.to_f64() >= 0.0 && at.to_f64() <= 1.1 * length) {
                at = Fixed::new(0.5 * length);
            }
            let found = self.after(position, at);
            let more = step(&found)?;
            at = at - more;
            let rate = self.distance(&found)[1].to_f64();
            // The next step would end in rounding.
            if more.to_f64().abs() <= Self::noise(&found) / rate {
                *position = self.after(position, at);
                return Ok(());
            }
        }
        Err(Unresolved)
    }

    /// Applies an impact. Returns the phase until the chatter that follows ends, if the mass then
    /// sticks.
    fn impact(&self, position: &mut Position<N>) -> Option<f64> {
        let [_, arrival] = self.distance(position);
        let departure = -(self.restitution * arrival);
        let before = self.acceleration(position.phasor, arrival);
        let after = self.acceleration(position.phasor, departure);
        let (r, w) = (self.rough.restitution, arrival.to_f64());
        let saltation = [[-r, 0.0], [(after + r * before) / w, -r]];
        let covariance = carried(&saltation, &position.covariance);
        *position = self.at_stop(position.phase, position.phasor, departure, covariance);
        if after <= 0.0 {
            return None;
        }
        // Flights of length 2u/a, each by the factor r shorter.
        let rest = 2.0 * r * w / (after * (1.0 - r));
        let change = 1.0 + 2.0 * self.rough.damping * after + self.rough.stiffness * r * w;
        (rest * change <= CHATTER_CHANGE * after).then_some(rest)
    }
}

/// Divides a number by a power of two such that its size is at most 0.02; also returns the power.
fn halved<const N: usize>(number: Fixed<N>, size: f64) -> (Fixed<N>, u32) {
    let (mut part, mut halvings, mut size) = (number, 0, size);
    while size > 0.02 && halvings < 60 {
        (part, halvings, size) = (part.over(2), halvings + 1, 0.5 * size);
    }
    (part, halvings)
}

/// cos θ and sin θ: a Taylor series, and repeated squaring of e^{iθ} − 1.
fn turned<const N: usize>(phase: Fixed<N>) -> [Fixed<N>; 2] {
    let (part, halvings) = halved(phase, phase.to_f64().abs());
    let (mut term, mut sum, mut order) = ([Fixed::ZERO, part], [Fixed::ZERO, part], 2);
    while term != [Fixed::ZERO; 2] && order < MAX_ORDER {
        // Times iθ/n.
        term = [-(term[1] * part), term[0] * part].map(|entry| entry.over(order));
        sum = [sum[0] + term[0], sum[1] + term[1]];
        order += 1;
    }
    for _ in 0..halvings {
        let square = complex_product(sum, sum);
        sum = [sum[0] + sum[0] + square[0], sum[1] + sum[1] + square[1]];
    }
    [sum[0] + Fixed::whole(1), sum[1]]
}

fn complex_product<const N: usize>([a, b]: [Fixed<N>; 2], [c, d]: [Fixed<N>; 2]) -> [Fixed<N>; 2] {
    [a * c - b * d, a * d + b * c]
}

fn identity<const N: usize>() -> Matrix<Fixed<N>> {
    [
        [Fixed::whole(1), Fixed::ZERO],
        [Fixed::ZERO, Fixed::whole(1)],
    ]
}

fn product<const N: usize>(a: &Matrix<Fixed<N>>, b: &Matrix<Fixed<N>>) -> Matrix<Fixed<N>> {
    let entry = |i: usize, j: usize| a[i][0] * b[0][j] + a[i][1] * b[1][j];
    [0, 1].map(|i| [0, 1].map(|j| entry(i, j)))
}

fn plus<const N: usize>(a: &Matrix<Fixed<N>>, b: &Matrix<Fixed<N>>) -> Matrix<Fixed<N>> {
    [0, 1].map(|i| [0, 1].map(|j| a[i][j] + b[i][j]))
}

/// J C Jᵀ.
fn carried(j: &Matrix<f64>, c: &Matrix<f64>) -> Matrix<f64> {
    let half = [0, 1].map(|i| [0, 1].map(|k| j[i][0] * c[0][k] + j[i][1] * c[1][k]));
    [0, 1].map(|i| [0, 1].map(|k| half[i][0] * j[k][0] + half[i][1] * j[k][1]))
}
