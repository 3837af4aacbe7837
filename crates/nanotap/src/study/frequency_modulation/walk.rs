//! A curve of orbits with one amplitude and phase against the distance.

use nanotap_dynamics::Control;

use super::held::{Driven, Held, HeldError, HeldOrbit};
use crate::case::Case;

/// Continuation from distance to distance.
pub(crate) struct HeldWalk<'a> {
    case: &'a Case,
    held: Held,
    /// The last two orbits, each with its distance.
    last: Option<(f64, Driven)>,
    before: Option<(f64, Driven)>,
}

/// How a step ended.
pub(crate) enum Stepped {
    /// On the same curve.
    On(HeldOrbit),
    /// On another one, past this distance.
    Jumped(HeldOrbit, f64),
}

/// Halvings of a step before the curve is given up.
const HALVINGS: i32 = 14;
/// A step that changes the state by more than this part of the amplitude, or frequency and
/// strength by more than this part of themselves, beyond what was foreseen is made shorter.
const UNFORESEEN: f64 = 0.2;

impl<'a> HeldWalk<'a> {
    pub(crate) fn new(case: &'a Case, held: Held, start: Driven, far: f64) -> Self {
        Self {
            case,
            held,
            last: Some((far, start)),
            before: None,
        }
    }

    /// Where the curve has come to.
    pub(crate) fn gap(&self) -> f64 {
        self.last.as_ref().map_or(f64::NAN, |(gap, _)| *gap)
    }

    /// Turns round at the orbit `driven` of the distance `gap`: what lies behind foresees nothing,
    /// and past a distance that was given up the curve may have turned back on another orbit.
    pub(crate) fn turn(&mut self, gap: f64, driven: Driven) {
        self.last = Some((gap, driven));
        self.before = None;
    }

    /// The orbit at `target`.
    ///
    /// # Errors
    /// Why there is none.
    pub(crate) fn step(
        &mut self,
        target: f64,
        control: &Control<'_>,
    ) -> Result<Stepped, HeldError> {
        let start = self.last.as_ref().map_or(target, |(gap, _)| *gap);
        let whole = target - start;
        let shortest = whole.abs() * 0.5_f64.powi(HALVINGS);
        let (mut at, mut step) = (start, whole);
        loop {
            let next = if (target - at).abs() <= step.abs() {
                target
            } else {
                at + step
            };
            let guess = self.foreseen(next);
            let found = self
                .held
                .close(&self.case.with(self.case.gap_key(), next), &guess)
                .map(|orbit| {
                    let near = self.unforeseen(&guess, &orbit) < UNFORESEEN;
                    (orbit, near)
                });
            match found {
                Ok((orbit, true)) => {
                    self.before = self.last.replace((next, orbit.driven()));
                    if next.to_bits() == target.to_bits() {
                        return Ok(Stepped::On(orbit));
                    }
                    at = next;
                    step *= 2.0;
                }
                _ if step.abs() > shortest && !control.is_cancelled() => step *= 0.5,
                Ok((_, false)) => return self.jump(target, at, None),
                Err(error) => return self.jump(target, at, Some(error)),
            }
        }
    }

    /// Another orbit at `target`, where the curve breaks off at `at`.
    fn jump(
        &mut self,
        target: f64,
        at: f64,
        failed: Option<HeldError>,
    ) -> Result<Stepped, HeldError> {
        let guess = self
            .last
            .clone()
            .map_or_else(Driven::nothing, |(_, driven)| driven);
        let case = self.case.with(self.case.gap_key(), target);
        match self.held.close(&case, &guess) {
            Ok(orbit) => {
                self.before = None;
                self.last = Some((target, orbit.driven()));
                Ok(Stepped::Jumped(orbit, at))
            }
            Err(error) => Err(failed.unwrap_or(error)),
        }
    }

    /// Where the last two orbits point to.
    fn foreseen(&self, gap: f64) -> Driven {
        let Some((at, last)) = &self.last else {
            return Driven::nothing();
        };
        let Some((behind, before)) = &self.before else {
            return last.clone();
        };
        let share = (gap - at) / (at - behind);
        if !share.is_finite() || share.abs() > 4.0 {
            return last.clone();
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

    fn unforeseen(&self, guess: &Driven, orbit: &HeldOrbit) -> f64 {
        let found = orbit.driven();
        let kept = found.state.len() - orbit.model.memory;
        let half = kept / 2;
        let amplitude = self.held.amplitude;
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

impl Driven {
    fn nothing() -> Self {
        Self {
            frequency: 1.0,
            strength: 1.0,
            state: Vec::new(),
        }
    }
}
