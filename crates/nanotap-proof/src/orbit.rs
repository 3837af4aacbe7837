//! Existence and uniqueness of a periodic orbit.
//!
//! An orbit of n drive periods with m switches is a zero of m(d + 1) equations in the states x_s
//! after its switches and their times t_s: each flight from a switch ends in the state with which
//! the next one begins, and there the guard of the transition is zero. With the Jacobian J of these
//! equations over a box X around an approximate zero z, and an approximate inverse C of J,
//! Krawczyk's operator
//!
//! K(X) = z − C F(z) + (1 − C J(X)) (X − z)
//!
//! maps X into its interior only if X contains exactly one zero, which then lies in K(X) (Krawczyk
//! 1969; Moore 1977; Rump, Acta Numerica 19, 2010, Sec. 13). Since the states at all switches are
//! unknowns, no enclosure is propagated through more than one flight, and none grows.

use nalgebra::DMatrix;

use crate::ProofError;
use crate::flight::{Ends, stays_positive};
use crate::interval::Interval;
use crate::matrix::{Matrix, dot};
use crate::multipliers::{self, Multipliers};
use crate::sticking::EnclosedRest;
use crate::system::{HarmonicVector, Reset, System, Transition};

/// An approximate periodic orbit, near which a proof is attempted.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Period n in drive periods.
    pub period: usize,
    /// Index of the regime in which the orbit stays if it has no switch.
    pub regime: usize,
    /// Switches in order of time.
    pub switches: Vec<Switch>,
}

/// A switch of an approximate orbit.
#[derive(Clone, Debug, PartialEq)]
pub struct Switch {
    /// Time from phase 0 of the first period, in the system's unit.
    pub time: f64,
    /// Index of the regime before the switch.
    pub from: usize,
    /// Index of the transition among those of the regime `from`.
    pub transition: usize,
    /// The state just after the switch, d entries in the system's units.
    pub state: Vec<f64>,
}

/// A proof that an orbit exists.
#[derive(Clone, Debug, PartialEq)]
pub struct Theorem {
    /// Minimal period in drive periods.
    pub period: usize,
    /// Enclosures of the states at drive phase 0 of each of its periods.
    pub states: Vec<Vec<Interval>>,
    /// Enclosures of all switches of the orbit, in order of time.
    pub switches: Vec<EnclosedSwitch>,
    /// The neighbourhood in which there is no other orbit; `None` without switches, where no other
    /// orbit stays in the regime.
    pub isolation: Option<Isolation>,
    /// Enclosures of the multipliers of the orbit.
    pub multipliers: Multipliers,
    /// How the orbit sticks to a rigid stop, if it does. Then `switches` has the impacts from the
    /// release up to the first one of the chatter.
    pub rest: Option<EnclosedRest>,
}

/// A switch of a proved orbit.
#[derive(Clone, Debug, PartialEq)]
pub struct EnclosedSwitch {
    /// Time from phase 0 of the first period, in the system's unit.
    pub time: Interval,
    /// Index of the regime before the switch.
    pub from: usize,
    /// Index of the regime after the switch.
    pub to: usize,
    /// The state just after the switch.
    pub state: Vec<Interval>,
}

/// Distances within which the orbit is unique: no other orbit with the same period and sequence of
/// regimes has all its switches within them.
#[derive(Clone, Debug, PartialEq)]
pub struct Isolation {
    /// Largest difference in the time of any switch, in the system's unit.
    pub time: f64,
    /// Largest difference in each entry of the state after any switch, in the units of the entries.
    pub state: Vec<f64>,
}

/// The flight from one switch to the next.
struct Leg {
    regime: usize,
    /// Index of the transition at its end.
    exit: usize,
    /// Drive periods between that of its first switch and that of its last.
    periods: f64,
}

/// A known state at a known time from which a motion begins that need not close.
pub(crate) struct Origin {
    pub(crate) state: Vec<Interval>,
    /// Time within its drive period.
    pub(crate) phase: Interval,
    /// Number of derivatives of the exit's guard, including the guard itself, that are zero there.
    pub(crate) zeros: usize,
}

/// The unknowns of the equations: each switch's state and its time within its drive period.
pub(crate) struct Equations<'a> {
    system: &'a System,
    legs: Vec<Leg>,
    /// The start of a motion that does not close, instead of the first switch; the flight after the
    /// last switch is left out.
    origin: Option<Origin>,
}

/// A box of the unknowns.
#[derive(Clone)]
pub(crate) struct Unknowns {
    pub(crate) states: Vec<Vec<Interval>>,
    pub(crate) phases: Vec<Interval>,
}

/// Largest number of equations; their matrix grows with the square.
pub const MAX_UNKNOWNS: usize = 3000;
/// Smallest weight of an entry of the state, as a fraction of its change over a radian of the
/// drive.
const MIN_CHANGE_WEIGHT: f64 = 0.1;
/// Smallest weight, as a fraction of the largest entry.
const MIN_WEIGHT: f64 = 1e-9;
/// Newton steps in floating-point numbers before the test.
const NEWTON_STEPS: usize = 4;
/// Relative size of the first box.
const FIRST_BOX: f64 = 1e-14;
/// Factor by which each following box is larger.
const BOX_GROWTH: f64 = 10.0;
/// Relative size beyond which no larger box is tried.
const MAX_BOX: f64 = 0.1;
/// Number of further applications of the operator to the enclosure.
const REFINEMENTS: usize = 3;

/// Proves that a periodic orbit exists near an approximate one, and that it is locally unique.
///
/// # Errors
/// [`ProofError`] with the property that could not be proved.
pub fn prove(system: &System, candidate: &Candidate) -> Result<Theorem, ProofError> {
    let proved = prove_candidate(system, candidate);
    // A cancelled proof fails with the error of the cancellation.
    proved.or_else(|error| system.check_cancel().and(Err(error)))
}

fn prove_candidate(system: &System, candidate: &Candidate) -> Result<Theorem, ProofError> {
    if candidate.period == 0 {
        return Err(ProofError::Candidate {
            what: "its period is 0",
        });
    }
    if candidate.switches.is_empty() {
        return prove_without_switches(system, candidate);
    }
    let d = system.dimension;
    let (equations, offsets) = Equations::of(system, candidate, None)?;
    let (isolation, enclosed, weights) = equations.solve(candidate, &offsets)?;
    let states = equations.states_at_phase_zero(&enclosed, &offsets, candidate.period)?;
    check_minimal_period(&states)?;
    let switches = equations.switches(candidate, &enclosed, &offsets);
    Ok(Theorem {
        period: candidate.period,
        states,
        switches,
        isolation: Some(Isolation {
            time: (Interval::point(isolation) * Interval::point(weights[d])).lo(),
            state: weights[..d]
                .iter()
                .map(|&w| (Interval::point(isolation) * Interval::point(w)).lo())
                .collect(),
        }),
        multipliers: multipliers::enclosed(&equations.monodromy(&enclosed)?, &weights[..d]),
        rest: None,
    })
}

impl<'a> Equations<'a> {
    /// The equations of an orbit with the switches of `candidate`, and the drive period of each
    /// switch. With an `origin` the first switch is that, and the motion need not close.
    pub(crate) fn of(
        system: &'a System,
        candidate: &Candidate,
        origin: Option<Origin>,
    ) -> Result<(Self, Vec<f64>), ProofError> {
        let unknowns = candidate.switches.len() * (system.dimension + 1);
        if unknowns > MAX_UNKNOWNS {
            return Err(ProofError::TooLarge {
                unknowns,
                limit: MAX_UNKNOWNS,
            });
        }
        let wrong = |what| Err(ProofError::Candidate { what });
        let period = system.period.middle();
        let (mut offsets, mut targets) = (Vec::new(), Vec::new());
        for switch in &candidate.switches {
            let Some(transition) = system
                .regimes
                .get(switch.from)
                .and_then(|regime| regime.parts.transitions.get(switch.transition))
            else {
                return wrong("a switch uses a transition that the system does not have");
            };
            if switch.state.len() != system.dimension {
                return wrong("a state does not have the dimension of the system");
            }
            if !(switch.time.is_finite() && switch.state.iter().all(|x| x.is_finite())) {
                return wrong("a number is not finite");
            }
            targets.push(transition.target);
            offsets.push((switch.time / period).floor());
        }
        let count = targets.len();
        let legs = (0..count)
            .map(|s| {
                let next = (s + 1) % count;
                let around = if next == 0 {
                    candidate.period as f64
                } else {
                    0.0
                };
                Leg {
                    regime: targets[s],
                    exit: candidate.switches[next].transition,
                    periods: offsets[next] - offsets[s] + around,
                }
            })
            .collect::<Vec<_>>();
        for (s, leg) in legs.iter().enumerate() {
            if candidate.switches[(s + 1) % count].from != leg.regime {
                return wrong(
                    "the regime after a switch differs from the regime before the next switch",
                );
            }
        }
        let equations = Self {
            system,
            legs,
            origin,
        };
        Ok((equations, offsets))
    }

    /// Encloses the only solution near `candidate` and proves that no flight has another switch.
    /// Returns the size of the largest box, relative to the weights, that contains no other
    /// solution, the enclosure, and the weights.
    pub(crate) fn solve(
        &self,
        candidate: &Candidate,
        offsets: &[f64],
    ) -> Result<(f64, Unknowns, Vec<f64>), ProofError> {
        let period = self.system.period.middle();
        let mut center: Vec<f64> = Vec::with_capacity(self.size());
        for (switch, offset) in candidate.switches.iter().zip(offsets) {
            center.extend(&switch.state);
            center.push(switch.time - offset * period);
        }
        let weights = self.weights(&center, period);
        let (isolation, enclosure) = self.enclose_zero(&center, &weights)?;
        let enclosed = self.unknowns(&enclosure);
        self.check_flights(&enclosed)?;
        Ok((isolation, enclosed, weights))
    }

    /// The enclosed switches of `candidate`.
    pub(crate) fn switches(
        &self,
        candidate: &Candidate,
        enclosed: &Unknowns,
        offsets: &[f64],
    ) -> Vec<EnclosedSwitch> {
        let enclosed = enclosed.states.iter().zip(&enclosed.phases);
        let switches = candidate.switches.iter().zip(enclosed).zip(offsets);
        switches
            .zip(&self.legs)
            .map(
                |(((switch, (state, &phase)), &offset), leg)| EnclosedSwitch {
                    time: phase + Interval::point(offset) * self.system.period,
                    from: switch.from,
                    to: leg.regime,
                    state: state.clone(),
                },
            )
            .collect()
    }

    /// Number of flights in the equations.
    fn flights(&self) -> usize {
        self.legs.len() - usize::from(self.origin.is_some())
    }

    fn size(&self) -> usize {
        self.legs.len() * (self.system.dimension + 1)
    }

    fn next(&self, leg: usize) -> usize {
        (leg + 1) % self.legs.len()
    }

    fn exit(&self, leg: usize) -> &Transition {
        let leg = &self.legs[leg];
        &self.system.regimes[leg.regime].parts.transitions[leg.exit]
    }

    fn unknowns(&self, flat: &[Interval]) -> Unknowns {
        let d = self.system.dimension;
        let blocks = flat.chunks(d + 1);
        Unknowns {
            states: blocks.clone().map(|b| b[..d].to_vec()).collect(),
            phases: blocks.map(|b| b[d]).collect(),
        }
    }

    fn duration(&self, leg: usize, phases: &[Interval]) -> Interval {
        let whole = Interval::point(self.legs[leg].periods) * self.system.period;
        whole + (phases[self.next(leg)] - phases[leg])
    }

    /// Weights of the unknowns: a radian of the drive, and the largest entry of each kind at any
    /// switch, or a fraction of its change over that time.
    fn weights(&self, center: &[f64], period: f64) -> Vec<f64> {
        let (d, radian) = (self.system.dimension, period / std::f64::consts::TAU);
        let mut weights = vec![f64::MIN_POSITIVE; d];
        for (block, leg) in center.chunks(d + 1).zip(&self.legs) {
            let state: Vec<Interval> = block[..d].iter().copied().map(Interval::point).collect();
            let phasors = self.system.phasors(Interval::point(block[d]));
            let field = self.system.regimes[leg.regime].field(&state, &phasors);
            for (i, w) in weights.iter_mut().enumerate() {
                let moved = MIN_CHANGE_WEIGHT * radian * field[i].middle().abs();
                *w = w.max(block[i].abs()).max(moved);
            }
        }
        let largest = weights.iter().copied().fold(0.0, f64::max);
        for w in &mut weights {
            *w = w.max(MIN_WEIGHT * largest);
        }
        weights.push(radian);
        weights
    }

    /// The residual F of the equations at `at`; zero for an orbit.
    fn residual(&self, at: &Unknowns) -> Vec<Interval> {
        let mut all = Vec::with_capacity(self.size());
        for s in 0..self.flights() {
            let e = self.next(s);
            let flown = self.fly(s, at);
            let exit = self.exit(s);
            let after = reset_state(exit, &flown.end, &flown.phasors);
            all.extend(at.states[e].iter().zip(after).map(|(&x, y)| x - y));
            let before = if exit.reset.is_some() {
                &flown.end
            } else {
                &at.states[e]
            };
            all.push(exit.guard.at(before, &flown.phasors));
        }
        if let Some(origin) = &self.origin {
            let known = origin.state.iter().chain([&origin.phase]);
            let first = at.states[0].iter().chain([&at.phases[0]]);
            all.extend(first.zip(known).map(|(&x, &origin)| x - origin));
        }
        all
    }

    /// One flight, for all unknowns in the box.
    fn fly(&self, leg: usize, at: &Unknowns) -> FlightResult {
        let regime = &self.system.regimes[self.legs[leg].regime];
        let start = self.system.phasors(at.phases[leg]);
        let phasors = self.system.phasors(at.phases[self.next(leg)]);
        let factors = regime.factors(self.duration(leg, &at.phases));
        let mut modal = regime.modal(&at.states[leg], &start);
        for (q, &factor) in modal.iter_mut().zip(&factors) {
            *q = *q * factor;
        }
        FlightResult {
            end: regime.state(&modal, &phasors),
            propagator: regime.propagator(&factors),
            departure: regime.field(&at.states[leg], &start),
            phasors,
        }
    }

    /// The columns of J, each as its nonzero rows.
    fn jacobian(&self, at: &Unknowns) -> Vec<Vec<(usize, Interval)>> {
        let d = self.system.dimension;
        let mut columns = vec![Vec::new(); self.size()];
        let mut add = |row: usize, column: usize, x: Interval| {
            let column: &mut Vec<(usize, Interval)> = &mut columns[column];
            match column.iter_mut().find(|(r, _)| *r == row) {
                Some((_, sum)) => *sum += x,
                None => column.push((row, x)),
            }
        };
        if self.origin.is_some() {
            for k in 0..=d {
                add(self.flights() * (d + 1) + k, k, Interval::ONE);
            }
        }
        for s in 0..self.flights() {
            let e = self.next(s);
            let (rows, here, there) = (s * (d + 1), s * (d + 1), e * (d + 1));
            let flown = self.fly(s, at);
            let regime = &self.system.regimes[self.legs[s].regime];
            let exit = self.exit(s);
            let jump = |m: Matrix<Interval>| match &exit.reset {
                None => m,
                Some(reset) => &reset.matrix * &m,
            };
            let propagator = jump(flown.propagator.clone());
            let started = propagator.apply(&flown.departure);
            let arrival = regime.field(&flown.end, &flown.phasors);
            let landed = reset_rate(self.system, exit, &arrival, &flown.phasors);
            for i in 0..d {
                for j in 0..d {
                    add(rows + i, here + j, -propagator[(i, j)]);
                }
                add(rows + i, here + d, started[i]);
                add(rows + i, there + i, Interval::ONE);
                add(rows + i, there + d, -landed[i]);
            }
            let guard = &exit.guard;
            let explicit = guard.explicit_rate(&self.system.frequencies, &flown.phasors);
            if exit.reset.is_some() {
                let started = flown.propagator.apply(&flown.departure);
                for j in 0..d {
                    add(
                        rows + d,
                        here + j,
                        dot(&guard.row, &flown.propagator.column(j)),
                    );
                }
                add(rows + d, here + d, -dot(&guard.row, &started));
                add(rows + d, there + d, dot(&guard.row, &arrival) + explicit);
            } else {
                for j in 0..d {
                    add(rows + d, there + j, guard.row[j]);
                }
                add(rows + d, there + d, explicit);
            }
        }
        columns
    }

    /// Newton steps in floating-point numbers, then boxes around the result. Returns the size of
    /// the largest box, relative to the weights, that contains no other zero, and the smallest
    /// enclosure found.
    fn enclose_zero(
        &self,
        start: &[f64],
        weights: &[f64],
    ) -> Result<(f64, Vec<Interval>), ProofError> {
        let size = self.size();
        let weight = |k: usize| weights[k % weights.len()];
        let points = |center: &[f64]| -> Vec<Interval> {
            center.iter().copied().map(Interval::point).collect()
        };
        let mut center = start.to_vec();
        let mut inverse = DMatrix::zeros(0, 0);
        let mut residual = Vec::new();
        for step in 0..=NEWTON_STEPS {
            self.system.check_cancel()?;
            let at = self.unknowns(&points(&center));
            // C in units of the weights, so that its rows are comparable.
            if step < 2 {
                let mut matrix = DMatrix::zeros(size, size);
                for (j, column) in self.jacobian(&at).iter().enumerate() {
                    for &(i, x) in column {
                        matrix[(i, j)] = x.middle() * weight(j);
                    }
                }
                inverse = matrix.try_inverse().ok_or(ProofError::NoIsolatedOrbit)?;
                // Transposed, because its rows are read as columns.
                inverse.transpose_mut();
            }
            residual = self.residual(&at);
            if step < NEWTON_STEPS {
                for (k, x) in center.iter_mut().enumerate() {
                    let step: f64 = inverse
                        .column(k)
                        .iter()
                        .zip(&residual)
                        .map(|(c, f)| c * f.middle())
                        .sum();
                    *x -= step * weight(k);
                }
                if center.iter().any(|x| !x.is_finite()) {
                    return Err(ProofError::NoIsolatedOrbit);
                }
            }
        }
        let times = |row: &[f64], sparse: &mut dyn Iterator<Item = (usize, Interval)>| {
            sparse.fold(Interval::ZERO, |sum, (i, x)| {
                sum + Interval::point(row[i]) * x
            })
        };
        let offsets: Vec<f64> = (0..size)
            .map(|k| {
                let row = inverse.column(k);
                times(row.as_slice(), &mut residual.iter().copied().enumerate()).magnitude()
            })
            .collect();
        let boxed = |radii: &dyn Fn(usize) -> f64| -> Vec<Interval> {
            let around = |(k, &x): (usize, &f64)| {
                let radius = Interval::point(radii(k)) * Interval::point(weight(k));
                Interval::around(x, radius.hi())
            };
            center.iter().enumerate().map(around).collect()
        };
        let least = offsets.iter().copied().fold(0.0, f64::max);
        let mut radius = FIRST_BOX.max(2.0 * least);
        let mut found: Option<(f64, Vec<f64>)> = None;
        while radius < MAX_BOX {
            let columns = self.jacobian(&self.unknowns(&boxed(&|_| radius)));
            // |1 − C J(X)| in units of the weights, row by row.
            let defects = |k: usize| -> Vec<f64> {
                let row = inverse.column(k);
                (0..size)
                    .map(|j| {
                        let product = times(row.as_slice(), &mut columns[j].iter().copied());
                        let product = product * Interval::point(weight(j));
                        let unit = if j == k {
                            Interval::ONE
                        } else {
                            Interval::ZERO
                        };
                        (unit - product).magnitude()
                    })
                    .collect()
            };
            let mapped = |defects: &[f64], radii: &dyn Fn(usize) -> f64, k: usize| {
                let moved: Interval = defects
                    .iter()
                    .enumerate()
                    .map(|(j, &x)| Interval::point(x) * Interval::point(radii(j)))
                    .sum();
                (moved + Interval::point(offsets[k])).hi()
            };
            let row = |k| self.system.check_cancel().map(|()| defects(k));
            let rows = (0..size).map(row).collect::<Result<Vec<_>, _>>()?;
            let radii: Vec<f64> = (0..size)
                .map(|k| mapped(&rows[k], &|_| radius, k))
                .collect();
            if !radii.iter().all(|&r| r < radius) {
                if found.is_some() {
                    break;
                }
                radius *= BOX_GROWTH;
                continue;
            }
            let mut radii = radii;
            if found.is_none() {
                for _ in 0..REFINEMENTS {
                    radii = (0..size)
                        .map(|k| mapped(&rows[k], &|j| radii[j], k).min(radii[k]))
                        .collect();
                }
            }
            found = Some(match found {
                None => (radius, radii),
                Some((_, tight)) => (radius, tight),
            });
            radius *= BOX_GROWTH;
        }
        let (isolation, radii) = found.ok_or(ProofError::NoIsolatedOrbit)?;
        // The theorem must be about the given orbit, not about another one to which Newton's method
        // converged.
        let near = |(k, &x): (usize, &f64)| (start[k] - x).abs() <= isolation * weight(k);
        if !center.iter().enumerate().all(near) {
            return Err(ProofError::NoIsolatedOrbit);
        }
        // From any point of the enclosure, not only from its centre.
        let widest = radii.iter().copied().fold(0.0, f64::max);
        let isolation = (Interval::point(isolation) - Interval::point(widest)).lo();
        Ok((isolation.max(0.0), boxed(&|k| radii[k])))
    }

    /// Proves that no flight has a switch before its end.
    fn check_flights(&self, at: &Unknowns) -> Result<(), ProofError> {
        for (s, leg) in self.legs[..self.flights()].iter().enumerate() {
            let regime = &self.system.regimes[leg.regime];
            let duration = self.duration(s, &at.phases);
            if !duration.is_positive() {
                return Err(ProofError::Grazing { flight: s, at: 0.0 });
            }
            let phasors = self.system.phasors(at.phases[s]);
            let modal = regime.modal(&at.states[s], &phasors);
            let before = (s + self.legs.len() - 1) % self.legs.len();
            let known = &self.exit(before).starts_at_zero;
            for guard in 0..regime.guards.len() {
                let known = known.iter().find(|(transition, _)| *transition == guard);
                let zeros_at_start = match &self.origin {
                    Some(origin) if s == 0 => origin.zeros,
                    _ => known.map_or(0, |&(_, zeros)| zeros),
                };
                let ends = Ends {
                    zeros_at_start,
                    zero_at_end: guard == leg.exit,
                };
                let start = at.phases[s];
                stays_positive(self.system, regime, guard, &modal, start, duration, ends).map_err(
                    |open| ProofError::Grazing {
                        flight: s,
                        at: open.at,
                    },
                )?;
            }
        }
        Ok(())
    }

    /// The states at phase 0 of each period. If a switch may be at phase 0, the hull of both
    /// flights.
    fn states_at_phase_zero(
        &self,
        at: &Unknowns,
        offsets: &[f64],
        periods: usize,
    ) -> Result<Vec<Vec<Interval>>, ProofError> {
        let phasors = self.system.phasors(Interval::ZERO);
        let mut all = Vec::with_capacity(periods);
        for period in 0..periods {
            let mut state: Option<Vec<Interval>> = None;
            for (s, leg) in self.legs.iter().enumerate() {
                // A flight occurs in its own period and, around the end of the orbit, one period
                // later.
                for around in [0.0, periods as f64] {
                    let whole = period as f64 + around - offsets[s];
                    let since = Interval::point(whole) * self.system.period - at.phases[s];
                    let left = self.duration(s, &at.phases) - since;
                    if since.hi() < 0.0 || left.hi() < 0.0 {
                        continue;
                    }
                    let regime = &self.system.regimes[leg.regime];
                    let start = self.system.phasors(at.phases[s]);
                    let here = regime.after((&at.states[s], &start), (since, &phasors));
                    state = Some(hull(state, here));
                }
            }
            all.push(state.ok_or(ProofError::Candidate {
                what: "its switches do not cover its periods",
            })?);
        }
        Ok(all)
    }

    /// The derivative of the flow from just after each switch to just after the next.
    fn monodromy(&self, at: &Unknowns) -> Result<Vec<Matrix<Interval>>, ProofError> {
        let d = self.system.dimension;
        (0..self.legs.len())
            .map(|s| {
                let e = self.next(s);
                let flown = self.fly(s, at);
                let regime = &self.system.regimes[self.legs[s].regime];
                let exit = self.exit(s);
                let before = if exit.reset.is_some() {
                    &flown.end
                } else {
                    &at.states[e]
                };
                let arrival = regime.field(before, &flown.phasors);
                let explicit = exit
                    .guard
                    .explicit_rate(&self.system.frequencies, &flown.phasors);
                let rate = dot(&exit.guard.row, &arrival) + explicit;
                if rate.contains(0.0) {
                    return Err(ProofError::Grazing {
                        flight: s,
                        at: self.duration(s, &at.phases).middle(),
                    });
                }
                let after = self.system.regimes[exit.target].field(&at.states[e], &flown.phasors);
                let landed = reset_rate(self.system, exit, &arrival, &flown.phasors);
                let saltation = Matrix::from_fn(d, d, |i, j| {
                    let jump = match &exit.reset {
                        Some(reset) => reset.matrix[(i, j)],
                        None if i == j => Interval::ONE,
                        None => Interval::ZERO,
                    };
                    jump + (after[i] - landed[i]) * exit.guard.row[j] / rate
                });
                Ok(&saltation * &flown.propagator)
            })
            .collect()
    }
}

/// The hull of a state and the others that are known already.
pub(crate) fn hull(known: Option<Vec<Interval>>, here: Vec<Interval>) -> Vec<Interval> {
    match known {
        None => here,
        Some(known) => here.iter().zip(known).map(|(a, b)| a.hull(b)).collect(),
    }
}

/// Result of the flight from one switch to the next.
struct FlightResult {
    /// The state at its end.
    end: Vec<Interval>,
    /// The derivative of the end by the state at its start, at fixed times.
    propagator: Matrix<Interval>,
    /// The time derivative ẋ at its start, d entries.
    departure: Vec<Interval>,
    /// The tones at its end.
    phasors: Vec<crate::Rectangle>,
}

/// The state after a switch.
fn reset_state(
    exit: &Transition,
    before: &[Interval],
    phasors: &[crate::Rectangle],
) -> Vec<Interval> {
    apply_reset(exit, before, |offset| offset.at(phasors))
}

/// How fast the state after a switch changes with its time: R f⁻ + ρ̇.
fn reset_rate(
    system: &System,
    exit: &Transition,
    arrival: &[Interval],
    phasors: &[crate::Rectangle],
) -> Vec<Interval> {
    apply_reset(exit, arrival, |offset| {
        offset.rate(&system.frequencies, phasors)
    })
}

/// R x + o, including the contribution of the reset's offset; x itself if there is no reset.
fn apply_reset(
    exit: &Transition,
    x: &[Interval],
    contributes: impl FnOnce(&HarmonicVector) -> Vec<Interval>,
) -> Vec<Interval> {
    match &exit.reset {
        None => x.to_vec(),
        Some(Reset { matrix, offset }) => matrix
            .apply(x)
            .iter()
            .zip(contributes(offset))
            .map(|(&x, o)| x + o)
            .collect(),
    }
}

/// Proves that the period is minimal: a shorter period would divide it.
fn check_minimal_period(states: &[Vec<Interval>]) -> Result<(), ProofError> {
    let count = states.len();
    for shorter in (1..count).filter(|k| count.is_multiple_of(*k)) {
        let apart = states[0]
            .iter()
            .zip(&states[shorter])
            .any(|(a, b)| a.is_disjoint(*b));
        if !apart {
            return Err(ProofError::ShorterPeriod { period: shorter });
        }
    }
    Ok(())
}

/// Proves that an orbit that stays in one regime is its forced response, if that is the only
/// periodic motion.
fn prove_without_switches(system: &System, candidate: &Candidate) -> Result<Theorem, ProofError> {
    let Some(regime) = system.regimes.get(candidate.regime) else {
        return Err(ProofError::Candidate {
            what: "its regime does not exist in the system",
        });
    };
    if candidate.period != 1 {
        return Err(ProofError::ShorterPeriod { period: 1 });
    }
    let multipliers = multipliers::of_flow(regime, system.period);
    if !multipliers
        .iter()
        .all(|m| (*m - crate::Rectangle::ONE).modulus().is_positive())
    {
        return Err(ProofError::NoIsolatedOrbit);
    }
    let modal = vec![crate::Rectangle::ZERO; regime.basis.values.len()];
    for guard in 0..regime.guards.len() {
        let ends = Ends::default();
        stays_positive(
            system,
            regime,
            guard,
            &modal,
            Interval::ZERO,
            system.period,
            ends,
        )
        .map_err(|open| ProofError::Grazing {
            flight: 0,
            at: open.at,
        })?;
    }
    let phasors = system.phasors(Interval::ZERO);
    Ok(Theorem {
        period: 1,
        states: vec![regime.response.at(&phasors)],
        switches: Vec::new(),
        isolation: None,
        multipliers: Multipliers::of_each(&multipliers),
        rest: None,
    })
}
