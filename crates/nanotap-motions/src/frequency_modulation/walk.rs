//! A curve of orbits with one amplitude and phase against the distance.

use nanotap_dynamics::Control;

use super::held::{Driven, Held, HeldOrbit};
use nanotap_case::Case;
use nanotap_error::Error;

/// Continuation from distance to distance.
pub struct HeldWalk<'a> {
    case: &'a Case,
    held: Held,
    /// Least distance that is kept, and the excursion of the tip towards the sample at amplitude 1,
    /// model units.
    closest: Option<(f64, f64)>,
    /// Number of entries at the end of the state that belong to the sample.
    memory: usize,
    /// Distance and orbit at the beginning of the walk.
    first: (f64, Driven),
    /// The last two orbits, each with its distance.
    last: Option<(f64, Driven)>,
    before: Option<(f64, Driven)>,
}

/// Result of a step.
pub struct Stepped {
    /// Orbit at the end of the step.
    pub orbit: HeldOrbit,
    /// Ranges of distances in the step over which the curve broke off, each from its last distance
    /// to the first at which another orbit continues.
    pub breaks: Vec<[f64; 2]>,
}

/// Largest number of halvings of a step; then the curve is given up.
const HALVINGS: i32 = 14;
/// Largest number of breaks of the curve that are passed in one step.
const BREAKS: usize = 4;
/// A step that changes the state by more than this part of the amplitude, or frequency and
/// strength by more than this part of themselves, beyond what was foreseen is made shorter.
const UNFORESEEN: f64 = 0.2;

impl<'a> HeldWalk<'a> {
    /// Starts the walk from a driven motion without contact at the distance `far`.
    pub fn new(case: &'a Case, held: Held, start: Driven, far: f64) -> Self {
        Self {
            case,
            held,
            closest: None,
            memory: 0,
            first: (far, start.clone()),
            last: Some((far, start)),
            before: None,
        }
    }

    /// Keeps the least distance `closest` from here on, where the tip swings by `reach` at the
    /// amplitude 1.
    pub(crate) fn keep(&mut self, closest: Option<f64>, reach: f64) {
        let kept = closest.map(|closest| (closest, reach));
        if kept != self.closest {
            self.closest = kept;
            // What had another amplitude foresees nothing.
            self.before = None;
        }
    }

    /// Returns the setpoint at a distance.
    pub(crate) fn held(&self, gap: f64) -> Held {
        let amplitude = self
            .closest
            .map_or(self.held.amplitude, |(closest, reach)| {
                (gap - closest) / reach
            });
        Held {
            amplitude,
            ..self.held
        }
    }

    /// Returns the distance that the curve has reached.
    pub(crate) fn gap(&self) -> f64 {
        self.last.as_ref().map_or(f64::NAN, |(gap, _)| *gap)
    }

    /// Turns round at the orbit `driven` of the distance `gap`: what lies behind foresees nothing,
    /// and past a distance that was given up the curve may have turned back on another orbit.
    pub(crate) fn turn(&mut self, gap: f64, driven: Driven) {
        self.last = Some((gap, driven));
        self.before = None;
    }

    /// Finds the orbit at `target`.
    ///
    /// # Errors
    /// The reason why there is none.
    pub fn step(&mut self, target: f64, control: &Control<'_>) -> Result<Stepped, Error> {
        let start = self.last.as_ref().map_or(target, |(gap, _)| *gap);
        let whole = target - start;
        let shortest = whole.abs() * 0.5_f64.powi(HALVINGS);
        let (mut at, mut step) = (start, whole);
        let mut breaks = Vec::new();
        loop {
            let next = if (target - at).abs() <= step.abs() {
                target
            } else {
                at + step
            };
            let guess = self.foreseen(next);
            let found = self
                .held(next)
                .close(&self.case.with(self.case.gap_key(), next), &guess)
                .map(|orbit| {
                    let near = self.unforeseen(next, &guess, &orbit) < UNFORESEEN;
                    (orbit, near)
                });
            match found {
                Ok((orbit, true)) => {
                    self.memory = orbit.model.memory;
                    self.before = self.last.replace((next, orbit.driven()));
                    if next.to_bits() == target.to_bits() {
                        return Ok(Stepped { orbit, breaks });
                    }
                    at = next;
                    step *= 2.0;
                }
                _ if step.abs() > shortest && !control.is_cancelled() => step *= 0.5,
                found => {
                    if breaks.len() == BREAKS || control.is_cancelled() {
                        return Err(found.err().unwrap_or_else(broken));
                    }
                    let (next, orbit) = self.beyond(target, at, shortest, found.err())?;
                    breaks.push([at, next]);
                    if next.to_bits() == target.to_bits() {
                        return Ok(Stepped { orbit, breaks });
                    }
                    (at, step) = (next, next - at);
                }
            }
        }
    }

    /// Another orbit beyond `at`, where the curve breaks off: at `target`, or else as far before it
    /// as Newton finds one from the last orbit or from the first.
    fn beyond(
        &mut self,
        target: f64,
        at: f64,
        shortest: f64,
        failed: Option<Error>,
    ) -> Result<(f64, HeldOrbit), Error> {
        let mut failed = failed;
        let mut next = target;
        loop {
            let case = self.case.with(self.case.gap_key(), next);
            let known = self.last.iter().chain([&self.first]);
            let guesses: Vec<Driven> = known.map(|known| self.resized(known, next)).collect();
            for guess in guesses {
                match self.held(next).close(&case, &guess) {
                    Ok(orbit) => {
                        self.memory = orbit.model.memory;
                        self.before = None;
                        self.last = Some((next, orbit.driven()));
                        return Ok((next, orbit));
                    }
                    Err(error) => failed = failed.or(Some(error)),
                }
            }
            if (next - at).abs() <= shortest {
                return Err(failed.unwrap_or_else(broken));
            }
            next = at + 0.5 * (next - at);
        }
    }

    /// Where the last two orbits point to.
    fn foreseen(&self, gap: f64) -> Driven {
        let Some(known) = &self.last else {
            return Driven::empty();
        };
        let (at, last) = (known.0, self.resized(known, gap));
        let Some(known) = &self.before else {
            return last;
        };
        let (behind, before) = (known.0, self.resized(known, gap));
        let share = (gap - at) / (at - behind);
        if !share.is_finite() || share.abs() > 4.0 {
            return last;
        }
        let on = |a: f64, b: f64| b + share * (b - a);
        Driven {
            frequency: on(before.frequency, last.frequency),
            strength: on(before.strength, last.strength).max(0.5 * last.strength),
            state: before
                .state
                .iter()
                .zip(&last.state)
                .map(|(a, b)| on(*a, *b))
                .collect(),
        }
    }

    /// Scales the orbit of another distance to the amplitude at this one.
    fn resized(&self, (there, found): &(f64, Driven), gap: f64) -> Driven {
        let share = self.held(gap).amplitude / self.held(*there).amplitude;
        let mut driven = found.clone();
        let moving = driven.state.len().saturating_sub(self.memory);
        driven.strength *= share;
        for x in driven.state.iter_mut().take(moving) {
            *x *= share;
        }
        driven
    }

    fn unforeseen(&self, gap: f64, guess: &Driven, orbit: &HeldOrbit) -> f64 {
        let found = orbit.driven();
        let kept = found.state.len() - orbit.model.memory;
        let half = kept / 2;
        let amplitude = self.held(gap).amplitude;
        let of_state = guess.state.iter().zip(&found.state).take(kept).enumerate();
        let state = of_state.map(|(k, (a, b))| {
            let size = if k < half {
                amplitude
            } else {
                amplitude * found.frequency
            };
            (a - b).abs() / size
        });
        let drive = (guess.frequency / found.frequency - 1.0).abs();
        state.fold(drive, f64::max)
    }
}

/// The error of a curve that breaks off too often.
fn broken() -> Error {
    Error::numerics("the orbits with this amplitude and phase break off again and again on the way")
}

impl Driven {
    fn empty() -> Self {
        Self {
            frequency: 1.0,
            strength: 1.0,
            state: Vec::new(),
        }
    }
}
