//! Periodic orbits of the stroboscopic map, by Newton's method.

pub(crate) mod block_cyclic;
pub mod multipliers;
pub(crate) mod parallel;
pub mod search;
pub mod shooting;

use nalgebra::Complex;
use nanotap_arithmetic::ComplexFunctions as _;

pub use multipliers::{MultiplierError, Multipliers, Stability};
pub use search::{OrbitSearch, find_orbits};
pub use shooting::{
    DivergenceReason, ShootingError, ShootingOptions, check_size, close_orbit,
    close_orbit_from_points,
};

use crate::same_motion::SameMotion;
use crate::vector::{distance, norm};

/// A periodic orbit with its accuracy and stability.
#[derive(Clone, Debug, PartialEq)]
pub struct PeriodicOrbit {
    /// Minimal period in drive periods.
    pub period: usize,
    /// All `period` strobe points `x_0 … x_{n−1}`, `P(x_k) = x_{k+1 mod n}`.
    pub states: Vec<Vec<f64>>,
    /// Largest entry of `P(x_k) − x_{k+1}` over the orbit, in units of the state, before a final
    /// Newton step within rounding.
    pub residual: f64,
    /// Estimated distance of `states` from the exact orbit (largest entry, in units of the state):
    /// the residual and the rounding of one period, multiplied by the inverse of the Newton system.
    /// Two orbits closer than a few of these are the same orbit.
    pub error: f64,
    /// Floquet multipliers in descending order of modulus; of a pair, the one with positive
    /// imaginary part comes first.
    pub multipliers: Vec<Complex<f64>>,
    /// Natural logarithm of |det DPⁿ|, summed over the factors: an independent check of the
    /// multipliers and of a trace formula.
    pub log_determinant: f64,
    /// Stability according to the multipliers, with the margin [`MARGIN`](multipliers::MARGIN).
    pub stability: Stability,
    /// Distance from the unit circle within which the side of a multiplier is not known.
    pub margin: f64,
    /// Number of trailing entries of a state that are whole numbers set by the map
    /// ([`StroboscopicMap::discrete_entries`](crate::StroboscopicMap::discrete_entries)). Sizes and
    /// distances do not include them.
    pub discrete: usize,
}

impl PeriodicOrbit {
    /// Returns the number of entries of a state; 0 if the orbit has no states.
    pub fn dimension(&self) -> usize {
        self.states.first().map_or(0, Vec::len)
    }

    /// The strobe state that is nearest to `state`, and its distance; an empty slice and NaN if the
    /// orbit has no states.
    pub fn nearest(&self, state: &[f64]) -> (&[f64], f64) {
        self.states
            .iter()
            .map(|own| (own.as_slice(), distance(own, state)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((&[], f64::NAN))
    }

    /// The orbit with these states at drive phase 0, on which neighbouring motions meet exactly within
    /// one repetition: all multipliers are zero. `residual` and `error` are those of the orbit.
    pub fn superstable(states: Vec<Vec<f64>>, residual: f64, error: f64) -> Self {
        let dimension = states.first().map_or(0, Vec::len);
        Self {
            period: states.len(),
            states,
            residual,
            error,
            multipliers: vec![Complex::new(0.0, 0.0); dimension],
            log_determinant: f64::NEG_INFINITY,
            stability: Stability::Stable,
            margin: 0.0,
            discrete: 0,
        }
    }

    /// Whether all multipliers are zero: neighbouring motions meet exactly.
    pub fn is_superstable(&self) -> bool {
        !self.multipliers.is_empty() && self.spectral_radius() == 0.0
    }

    /// Largest modulus of a multiplier.
    pub fn spectral_radius(&self) -> f64 {
        self.multipliers.first().map_or(0.0, |m| m.modulus())
    }

    /// True if every multiplier is inside the unit circle by more than
    /// [`MARGIN`](multipliers::MARGIN).
    pub fn is_stable(&self) -> bool {
        self.stability == Stability::Stable
    }

    /// Stability as far as the multipliers are known: of an orbit that slow relaxations approach, some
    /// are nearer to the unit circle than [`MARGIN`](multipliers::MARGIN), and inside all the same.
    pub fn known_stability(&self) -> Stability {
        multipliers::stability_of(&self.multipliers, self.margin)
    }

    /// Largest entry of any state, in units of the state.
    pub fn scale(&self) -> f64 {
        let states = self.states.iter();
        states.fold(0.0, |m, s| m.max(norm(self.continuous(s))))
    }

    /// A state without its discrete entries.
    fn continuous<'a>(&self, state: &'a [f64]) -> &'a [f64] {
        &state[..state.len().saturating_sub(self.discrete)]
    }

    /// Smallest distance (largest entry over all phases) to another orbit of the same period over
    /// all cyclic shifts, with the shift `s` at which it occurs (`states[k]` is compared with
    /// `other.states[(k + s) mod n]`). Infinite if periods or dimensions differ.
    pub fn distance_to(&self, other: &Self) -> (usize, f64) {
        if self.period != other.period || self.dimension() != other.dimension() {
            return (0, f64::INFINITY);
        }
        let n = self.period;
        let mut best = (0, f64::INFINITY);
        for shift in 0..n {
            let mut worst: f64 = 0.0;
            for k in 0..n {
                let [here, there] = [&self.states[k], &other.states[(k + shift) % n]];
                worst = worst.max(distance(self.continuous(here), self.continuous(there)));
                if worst >= best.1 {
                    break;
                }
            }
            if worst < best.1 {
                best = (shift, worst);
            }
        }
        best
    }

    /// Whether the two are one orbit: see [`SameMotion`].
    pub fn is_same_as(&self, other: &Self) -> bool {
        SameMotion::orbits(self, other)
    }

    /// Whether the other orbit differs by at most this part of the size of the larger one, as a
    /// continuation at a nearby parameter does.
    pub fn is_near(&self, other: &Self, part: f64) -> bool {
        self.distance_to(other).1 <= part * self.scale().max(other.scale())
    }

    /// The same orbit starting from its lexicographically smallest state, independent of the phase
    /// at which it was found.
    #[must_use]
    pub fn canonical(mut self) -> Self {
        if let Some(first) = (0..self.states.len()).min_by(|&a, &b| {
            self.states[a]
                .partial_cmp(&self.states[b])
                .unwrap_or(std::cmp::Ordering::Equal)
        }) {
            self.states.rotate_left(first);
        }
        self
    }

    /// The states as one row-major block, `period × dimension`.
    pub(crate) fn flat(&self) -> Vec<f64> {
        self.states.concat()
    }
}
