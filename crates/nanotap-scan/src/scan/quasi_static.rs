//! The lever's steady motion at each distance: a preview in which the lever has no memory but the
//! branch on which it is.

use nanotap_arithmetic::ComplexFunctions as _;
use std::collections::BTreeMap;

use super::tapping_period::{Lever, PeriodSignals};
use nanotap_model::MotionError;

/// Number of distances per free amplitude at which motions are stored.
const DENSITY: f64 = 500.0;
/// Largest number of periods until a motion is taken as steady.
const MAX_SETTLING: usize = 4000;
/// Change of the deflection in a period below which a motion is steady, as a fraction of the free
/// amplitude.
const STEADY: f64 = 2e-6;
/// Largest number of distances at which motions are stored.
const MAX_KEPT: usize = 100_000;

/// A lever that is steady at every distance, followed from the last.
#[derive(Clone, Debug)]
pub(super) struct SteadyLever {
    lever: Lever,
    state: Vec<f64>,
    free_amplitude: f64,
    /// Signals on the branch of the lever, by the number of the distance.
    known: BTreeMap<i64, PeriodSignals>,
    at: i64,
}

impl SteadyLever {
    /// In the motion with a state of the beam at drive phase 180°, or else the free one, at distance `gap`.
    pub(super) fn new(lever: Lever, beam: Option<&[f64]>, gap: f64, free_amplitude: f64) -> Self {
        let state = lever.start(beam);
        let at = number(gap, free_amplitude);
        Self {
            lever,
            state,
            free_amplitude,
            known: BTreeMap::new(),
            at,
        }
    }

    /// A copy of the lever.
    pub(super) fn lever(&self) -> Lever {
        self.lever.clone()
    }

    /// State of the steady motion that was computed last, model units.
    pub(super) fn state(&self) -> &[f64] {
        &self.state
    }

    /// The signals at a distance, linear between the numbered ones.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn at(&mut self, gap: f64) -> Result<PeriodSignals, MotionError> {
        let low = number(gap, self.free_amplitude);
        let part = gap / self.free_amplitude * DENSITY - low as f64;
        // The far one first when the tip comes nearer, so that the motion is followed.
        let (a, b) = if low < self.at {
            let b = self.known_at(low.saturating_add(1))?;
            (self.known_at(low)?, b)
        } else {
            let a = self.known_at(low)?;
            (a, self.known_at(low.saturating_add(1))?)
        };
        let mix = |a: f64, b: f64| a * (1.0 - part) + b * part;
        Ok(PeriodSignals {
            deflection: a.deflection * (1.0 - part) + b.deflection * part,
            force: a.force * (1.0 - part) + b.force * part,
            mean_force: mix(a.mean_force, b.mean_force),
            mean_deflection: mix(a.mean_deflection, b.mean_deflection),
            peak_force: mix(a.peak_force, b.peak_force),
            contact: mix(a.contact, b.contact),
            dissipation: mix(a.dissipation, b.dissipation),
        })
    }

    fn known_at(&mut self, at: i64) -> Result<PeriodSignals, MotionError> {
        if let Some(known) = self.known.get(&at) {
            self.at = at;
            return Ok(*known);
        }
        let gap = at as f64 / DENSITY * self.free_amplitude;
        let mut last = self.lever.advance(&mut self.state, gap)?;
        for _ in 0..MAX_SETTLING {
            let here = self.lever.advance(&mut self.state, gap)?;
            let change = (here.deflection - last.deflection).modulus();
            last = here;
            if change <= STEADY * self.free_amplitude {
                break;
            }
        }
        self.at = at;
        if self.known.len() < MAX_KEPT {
            self.known.insert(at, last);
        }
        Ok(last)
    }
}

fn number(gap: f64, free_amplitude: f64) -> i64 {
    (gap / free_amplitude * DENSITY).floor() as i64
}
