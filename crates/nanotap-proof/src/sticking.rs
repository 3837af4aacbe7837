//! Orbits that come to rest on a rigid stop.
//!
//! A mass that rests on its stop leaves it when the force on it changes sign, whatever happened
//! before. So an orbit that sticks is proved from that one state: Krawczyk's operator encloses the
//! impacts up to one from which the rest of the chatter follows by comparison. Where the mass is
//! pressed towards the stop with an acceleration between a₁ and a₂, a flight that leaves with the
//! speed s lasts at most 2s/a₁, comes as far as s²/(2a₁) and ends with a speed of at most
//! s √(a₂/a₁). With the restitution r and q = r √(a₂/a₁) < 1 infinitely many impacts are over
//! after 2s/(a₁(1 − q)). Then the mass rests until the next release, and the motion repeats itself.
//! Neighbouring motions come to the same rest, so that all multipliers are exactly zero.

use crate::ProofError;
use crate::complex::Rectangle;
use crate::interval::Interval;
use crate::multipliers::Multipliers;
use crate::orbit::{Candidate, EnclosedSwitch, Equations, Origin, Switch, Theorem, Unknowns, hull};
use crate::system::{Output, System};

/// The rigid stop of a mass whose state is its position and velocity (x, v), in a system with one
/// regime, the flight before the stop, and one transition, the impact.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidStop {
    /// Position x of the stop.
    pub place: Interval,
    /// Coefficient of restitution, from 0 to 1.
    pub restitution: Interval,
    /// Acceleration of the mass towards the stop at (x, v), in the system's units.
    pub pressure: Output,
}

/// How a proved orbit rests on its stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnclosedRest {
    /// Time from phase 0 of the first period at which the mass is released, in the system's unit.
    pub release: Interval,
    /// Time at which the chatter is over and the mass rests.
    pub since: Interval,
}

/// The chatter after an impact.
struct Chatter {
    /// Bound of its duration.
    duration: f64,
    /// Bounds of the distance from the stop and of the speed.
    distance: f64,
    speed: f64,
}

/// Derivatives of the distance from the stop that vanish at a release: place, speed, acceleration.
const ZEROS_AT_RELEASE: usize = 3;
/// Largest number of attempts to find bounds for a chatter, each with wider ones.
const ATTEMPTS: usize = 12;
/// Factor of the bounds over those that the comparison gave, so that it gives smaller ones.
const WIDER: f64 = 1.05;
/// Largest number of pieces into which the rest is divided to show that it lasts.
const MAX_PIECES: usize = 10_000;

/// Proves that an orbit exists that leaves its stop near the time `release` and comes to rest again
/// after the `impacts`, the first ones of its chatter included.
///
/// # Errors
/// [`ProofError`] with the property that could not be proved.
///
/// # Panics
/// If the system does not have a state of two entries.
pub fn prove_sticking(
    system: &System,
    stop: &RigidStop,
    release: f64,
    impacts: &[Switch],
) -> Result<Theorem, ProofError> {
    let proved = Proof { system, stop }.theorem(release, impacts);
    // A cancelled proof fails with the error of the cancellation.
    proved.or_else(|error| system.check_cancel().and(Err(error)))
}

/// All times from the earliest start in `time` to a `duration` after the latest.
fn lasting(time: Interval, duration: f64) -> Interval {
    let end = Interval::point(time.hi()) + Interval::point(duration);
    Interval::new(time.lo(), end.hi())
}

struct Proof<'a> {
    system: &'a System,
    stop: &'a RigidStop,
}

impl Proof<'_> {
    fn theorem(&self, near: f64, impacts: &[Switch]) -> Result<Theorem, ProofError> {
        assert_eq!(self.system.dimension, 2, "the state is (x, v)");
        let release = self.release(near)?;
        let chatters = |impact: &&Switch| {
            let state: Vec<_> = impact.state.iter().map(|&x| Interval::point(x)).collect();
            self.chatter(&state, Interval::point(impact.time)).is_some()
        };
        let last = impacts.iter().position(|impact| chatters(&impact));
        let last = last.ok_or(ProofError::NoRest)?;
        let origin = Switch {
            time: release.middle(),
            from: 0,
            transition: 0,
            state: vec![self.stop.place.middle(), 0.0],
        };
        let candidate = Candidate {
            period: 1,
            regime: 0,
            switches: [origin].iter().chain(&impacts[..=last]).cloned().collect(),
        };
        let rest = self.rest_state();
        let origin = Origin {
            state: rest.clone(),
            phase: release,
            zeros: ZEROS_AT_RELEASE,
        };
        let (equations, offsets) = Equations::of(self.system, &candidate, Some(origin))?;
        let (_, enclosed, _) = equations.solve(&candidate, &offsets)?;
        let mut switches = equations.switches(&candidate, &enclosed, &offsets);
        let impact = &switches[switches.len() - 1];
        let chatter = self
            .chatter(&impact.state, impact.time)
            .ok_or(ProofError::NoRest)?;
        let since = lasting(impact.time, chatter.duration);
        let period = self.next_release(release, since)?;
        let states = (0..period)
            .map(|k| {
                // Phase 0 of the first period comes again at the end of the last.
                let time = if k == 0 { period } else { k };
                self.state_at(time as f64, &enclosed, &switches, (since, &chatter))
            })
            .collect();
        switches.remove(0);
        Ok(Theorem {
            period,
            states,
            switches,
            isolation: None,
            multipliers: Multipliers::of_each(&[Rectangle::ZERO; 2]),
            rest: Some(EnclosedRest { release, since }),
        })
    }

    /// The mass at rest on the stop.
    fn rest_state(&self) -> Vec<Interval> {
        vec![self.stop.place, Interval::ZERO]
    }

    /// Pressure on the resting mass and its rate, over an interval of time.
    fn pressure_at_rest(&self, time: Interval) -> (Interval, Interval) {
        let phasors = self.system.phasors(time);
        let pressure = &self.stop.pressure;
        (
            pressure.at(&self.rest_state(), &phasors),
            pressure.explicit_rate(&self.system.frequencies, &phasors),
        )
    }

    /// Encloses the time near `near` at which the pressure on the resting mass falls to zero.
    fn release(&self, near: f64) -> Result<Interval, ProofError> {
        let mut radius = 4.0 * f64::EPSILON * self.system.period.hi();
        while radius < 1e-6 * self.system.period.lo() {
            let around = Interval::around(near, radius);
            let pressure = |time: f64| self.pressure_at_rest(Interval::point(time)).0;
            let falls = (-self.pressure_at_rest(around).1).is_positive();
            if falls
                && pressure(around.lo()).is_positive()
                && (-pressure(around.hi())).is_positive()
            {
                return Ok(around);
            }
            radius *= 4.0;
        }
        Err(ProofError::Candidate {
            what: "the mass is not released where it leaves the stop",
        })
    }

    /// Bounds of the chatter that follows an impact, if it ends in sticking.
    fn chatter(&self, after: &[Interval], time: Interval) -> Option<Chatter> {
        let phasors = self.system.phasors(time);
        let pressure = self.stop.pressure.at(after, &phasors);
        let start = Interval::point((-after[1]).hi());
        let mut bounds = Chatter {
            duration: 0.0,
            distance: 0.0,
            speed: start.hi(),
        };
        if !start.is_positive() || !pressure.is_positive() {
            return None;
        }
        for _ in 0..ATTEMPTS {
            let during = lasting(time, bounds.duration);
            let near = [
                self.stop.place - Interval::new(0.0, bounds.distance),
                Interval::around_zero(bounds.speed),
            ];
            let pressure = self.stop.pressure.at(&near, &self.system.phasors(during));
            if !pressure.is_positive() {
                return None;
            }
            let least = Interval::point(pressure.lo());
            let growth = (Interval::point(pressure.hi()) / least).sqrt();
            let left = Interval::ONE - self.stop.restitution * growth;
            if !left.is_positive() {
                return None;
            }
            let two = Interval::point(2.0);
            let found = Chatter {
                duration: (two * start / least / left).hi(),
                distance: (start.square() / (two * least)).hi(),
                speed: (start * growth).hi(),
            };
            if found.duration < bounds.duration
                && found.distance < bounds.distance
                && found.speed < bounds.speed
            {
                return Some(bounds);
            }
            bounds = Chatter {
                duration: WIDER * found.duration,
                distance: WIDER * found.distance,
                speed: WIDER * found.speed,
            };
        }
        None
    }

    /// Proves that the mass, at rest at latest at the end of `since`, rests until a release, and
    /// returns the number of drive periods from `release` to that one.
    fn next_release(&self, release: Interval, since: Interval) -> Result<usize, ProofError> {
        let later = |periods: f64| release + Interval::point(periods) * self.system.period;
        let apart = (Interval::point(since.hi()) - release) / self.system.period;
        let periods = apart.hi().floor().max(0.0) + 1.0;
        let next = later(periods);
        // The pressure falls to zero at the release and is positive before, down to the time at
        // which its rate is known to be negative.
        let mut open = vec![(since.hi(), next.hi())];
        let mut pieces = 0;
        while let Some((from, to)) = open.pop() {
            let (pressure, rate) = self.pressure_at_rest(Interval::new(from, to));
            let falls_to_zero = to >= next.lo() && (-rate).is_positive();
            if pressure.is_positive() || falls_to_zero {
                continue;
            }
            pieces += 1;
            let middle = 0.5 * (from + to);
            if pieces > MAX_PIECES || !(from < middle && middle < to) {
                return Err(ProofError::NoRest);
            }
            open.extend([(middle, to), (from, middle)]);
        }
        Ok(periods as usize)
    }

    /// The state at phase 0 after so many whole periods: in flight, in the chatter or at rest.
    fn state_at(
        &self,
        periods: f64,
        enclosed: &Unknowns,
        switches: &[EnclosedSwitch],
        (since, chatter): (Interval, &Chatter),
    ) -> Vec<Interval> {
        let time = Interval::point(periods) * self.system.period;
        let phasors = self.system.phasors(Interval::ZERO);
        let mut state: Option<Vec<Interval>> = None;
        let mut add = |here| state = Some(hull(state.take(), here));
        for (s, pair) in switches.windows(2).enumerate() {
            if time.hi() >= pair[0].time.lo() && time.lo() <= pair[1].time.hi() {
                let start = self.system.phasors(enclosed.phases[s]);
                let passed = time - pair[0].time;
                let regime = &self.system.regimes[0];
                add(regime.after((&pair[0].state, &start), (passed, &phasors)));
            }
        }
        if time.hi() >= since.lo() && time.lo() <= since.hi() {
            add(vec![
                self.stop.place - Interval::new(0.0, chatter.distance),
                Interval::around_zero(chatter.speed),
            ]);
        }
        if time.hi() >= since.hi() {
            add(self.rest_state());
        }
        // The flights, the chatter and the rest cover all times from one release to the next.
        state.unwrap_or_else(|| vec![Interval::ENTIRE; 2])
    }
}
