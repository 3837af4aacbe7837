//! The smallest knock on the tip after which the lever goes to another motion.
//!
//! A knock is an impulse that changes the speeds of the modes at an instant, away from the sample or
//! towards it. Knocks at instants all over the orbit are made larger step by step, until one is
//! followed by another motion; bisection narrows its size. Where each leads is found as in a census.
//! The knock that is reported leads there by the flow itself.
//!
//! Fails: it is the smallest knock of those tried. Where basins are interleaved a smaller one may do,
//! between two instants or two sizes. A motion that stays undecided after a knock counts as none.

use nanotap_dynamics::{
    CensusOptions, ClassifyOptions, Control, MotionKind, PeriodicOrbit, SameMotion, StartOutcome,
    StartSet, census_of, classify, close_orbit,
};
use schemars::JsonSchema;
use serde::Serialize;

use crate::Error;
use crate::case::Case;
use crate::case::physical::quantity::JOULES_PER_ELECTRONVOLT;
use crate::model::galerkin::Galerkin;
use crate::model::model_map::ModelMap;
use crate::model::stepper::Stepper;
use crate::model::{Model, MotionError};
use crate::observe::{ObservableSet, measure};
use crate::study::simulate::{Classification, Named};

/// Instants of an orbit at which it is knocked.
pub const INSTANTS: usize = 48;
/// Changes of the tip's speed over its amplitude in the orbit: the first that is tried, the least,
/// which is still far above rounding, and the largest.
const FIRST_SIZE: f64 = 1.0 / 1024.0;
const LEAST_SIZE: f64 = 1e-9;
const LARGEST_SIZE: f64 = 4.0;
/// Ratio of sizes before bisection.
const GROWTH: f64 = 2.0;
/// Bisections of that ratio: to 0.3 %.
const BISECTIONS: usize = 8;
/// Rounds of knocks, of those that grow: 13 sizes, and the bisections.
const ROUNDS: usize = 13 + BISECTIONS;
/// By how much a knock is made larger whose motion returns by the flow itself, and how often.
const ENLARGED: (f64, usize) = (1.01, 5);

/// The smallest knock on the tip, of those tried, that makes the lever leave its orbit.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Upset {
    /// Change of the tip's speed, in the model's unit of length per unit of time, positive away
    /// from the sample.
    pub tip_speed: f64,
    /// Impulse on the tip, in the model's unit of force times time, positive away from the sample.
    pub impulse: f64,
    /// Energy that the impulse would give the lever at rest, in the model's unit of energy.
    pub energy: f64,
    /// Phase of the drive at the knock, in degrees.
    pub drive_phase: f64,
    /// Class of the motion that follows the knock.
    pub leads_to: Classification,
    /// Period in drive periods of the motion that follows, if it is periodic.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period: Option<usize>,
    /// Amplitude at the drive frequency of the motion that follows, in the model's unit of length,
    /// if it is periodic.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_harmonic: Option<f64>,
    /// State at drive phase 0 of the motion that follows, in the model's units. Its entries are a_1
    /// … a_N (or x), their rates, then any memory of the sample.
    pub state: Vec<f64>,
    /// The same knock in SI, of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<UpsetInSi>,
}

/// A knock on the tip in SI units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct UpsetInSi {
    /// Change of the tip's speed in m/s, positive away from the sample.
    pub tip_speed: f64,
    /// Impulse on the tip in N s.
    pub impulse: f64,
    /// Energy in J that the impulse would give the lever at rest.
    pub energy: f64,
    /// Energy in eV that the impulse would give the lever at rest.
    #[serde(rename = "energy_eV")]
    pub energy_ev: f64,
    /// Amplitude in m at the drive frequency of the motion that follows.
    #[serde(rename = "A", skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<f64>,
}

/// Result of the knocks on an orbit.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Knocks {
    /// Smallest knock that makes the lever leave its orbit; `None` if none of those tried does.
    pub smallest: Option<Upset>,
    /// Largest change of the tip's speed that was tried, in the model's unit of length per unit of
    /// time.
    pub largest_tried: f64,
    /// Largest change of the tip's speed that was tried in a physical case, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest_tried_in_si: Option<f64>,
}

/// A knock: an instant of the orbit, and a change of the tip's speed.
#[derive(Clone, Copy)]
struct Knock {
    instant: usize,
    tip_speed: f64,
}

/// An orbit that is knocked.
struct Knocked<'a> {
    model: &'a Model,
    orbit: PeriodicOrbit,
    map: ModelMap,
    stepper: Stepper,
    /// Changes of the modes' speeds by a change of the tip's speed of 1 away from the sample.
    speeds: Vec<f64>,
    /// Change of the tip's speed by an impulse of 1.
    mobility: f64,
    /// Rounds of knocks so far.
    rounds: usize,
}

/// The smallest knock that upsets the stable orbit through `state`.
///
/// # Errors
/// When the orbit is not stable, the tip does not move, or the work was stopped.
pub fn upset(
    case: &Case,
    (state, period): (&[f64], usize),
    control: &Control<'_>,
) -> Result<Knocks, Error> {
    let model = &case.model()?;
    let mut map = ModelMap::new(model);
    let orbit = close_orbit(
        &mut map,
        state,
        period,
        &ClassifyOptions::default().shooting,
    )?;
    if !orbit.is_stable() {
        return Err(
            Error::numerics("the orbit is not stable: the smallest disturbance upsets it")
                .remedy("ask for {upset} of a stable orbit"),
        );
    }
    let (speeds, mobility) = response(case, model)?;
    let mut knocked = Knocked {
        model,
        orbit,
        map,
        stepper: Stepper::new(model),
        speeds,
        mobility,
        rounds: 0,
    };
    let seen = measure(model, state, period, ObservableSet::FIRST_HARMONIC)?;
    let unit = seen.first_harmonic * model.frequency();
    if !(unit > 0.0 && unit.is_finite()) {
        return Err(Error::input(
            "the drive does not move the tip, so that no speed says how large a knock should be",
            "ask for {upset} of a driven motion",
        ));
    }
    let largest_tried = LARGEST_SIZE * unit;
    let found = knocked.search(unit, control)?;
    Ok(Knocks {
        smallest: found.map(|mut found| {
            found.physical = case.physical().map(|view| {
                let scales = view.scales;
                let energy = scales.energy * found.energy;
                UpsetInSi {
                    tip_speed: scales.velocity * found.tip_speed,
                    impulse: scales.force * scales.time * found.impulse,
                    energy,
                    energy_ev: energy / JOULES_PER_ELECTRONVOLT,
                    amplitude: found.first_harmonic.map(|a| scales.length * a),
                }
            });
            found
        }),
        largest_tried,
        largest_tried_in_si: case
            .physical()
            .map(|view| view.scales.velocity * largest_tried),
    })
}

/// Changes of the modes' speeds over that of the tip's, away from the sample, and the change of the
/// tip's speed by a unit impulse on it.
fn response(case: &Case, model: &Model) -> Result<(Vec<f64>, f64), Error> {
    let moved = match (case.cantilever(), case.oscillator()) {
        (Some(lever), _) => {
            let equations = Galerkin::new(lever)
                .map_err(|error| Error::input(error.to_string(), "change it in the case"))?;
            let moved = equations.mass.clone().lu().solve(&equations.modes.tip);
            moved.map_or_else(Vec::new, |moved| moved.iter().copied().collect())
        }
        (None, Some(oscillator)) => vec![1.0 / oscillator.mass],
        (None, None) => Vec::new(),
    };
    let rows = model.gap.row.iter();
    let away: f64 = rows.zip(&moved).map(|(row, speed)| row * speed).sum();
    Ok((moved.iter().map(|speed| speed / away).collect(), away.abs()))
}

impl Knocked<'_> {
    fn search(&mut self, unit: f64, control: &Control<'_>) -> Result<Option<Upset>, Error> {
        let everywhere: Vec<Knock> = (0..INSTANTS)
            .flat_map(|instant| [1.0, -1.0].map(|tip_speed| Knock { instant, tip_speed }))
            .collect();
        let sized = |knocks: &[Knock], size: f64| -> Vec<Knock> {
            let resized = |knock: &Knock| Knock {
                tip_speed: size.copysign(knock.tip_speed),
                ..*knock
            };
            knocks.iter().map(resized).collect()
        };
        let mut size = FIRST_SIZE * unit;
        let mut upsetting = self.upsetting(&sized(&everywhere, size), control)?;
        if upsetting.is_empty() {
            while upsetting.is_empty() {
                size *= GROWTH;
                if size > LARGEST_SIZE * unit {
                    return Ok(None);
                }
                upsetting = self.upsetting(&sized(&everywhere, size), control)?;
            }
        } else {
            while size > LEAST_SIZE * unit {
                let smaller = self.upsetting(&sized(&upsetting, size / GROWTH), control)?;
                if smaller.is_empty() {
                    break;
                }
                (size, upsetting) = (size / GROWTH, smaller);
            }
        }
        let mut harmless = size / GROWTH;
        for _ in 0..BISECTIONS {
            let middle = (harmless * size).sqrt();
            let found = self.upsetting(&sized(&upsetting, middle), control)?;
            if found.is_empty() {
                harmless = middle;
            } else {
                (size, upsetting) = (middle, found);
            }
        }
        for enlarged in 0..ENLARGED.1 {
            let size = size * (0..enlarged).fold(1.0, |factor, _| factor * ENLARGED.0);
            for knock in sized(&upsetting, size) {
                if let Some(found) = self.confirmed(knock)? {
                    return Ok(Some(found));
                }
            }
        }
        Ok(None)
    }

    /// Returns those of some knocks that are followed by another motion.
    fn upsetting(&mut self, knocks: &[Knock], control: &Control<'_>) -> Result<Vec<Knock>, Error> {
        let starts = knocks.iter().map(|knock| self.after(*knock));
        let starts = starts.collect::<Result<Vec<_>, _>>()?;
        let own = (self.orbit.period, self.orbit.states[0].clone());
        let starts = StartSet::given(starts).with_seeds([own]);
        let quiet = Control {
            progress: None,
            ..*control
        };
        let found = census_of(&self.map, &starts, &CensusOptions::default(), &quiet);
        self.rounds += 1;
        if let Some(progress) = control.progress {
            progress(self.rounds, self.rounds.max(ROUNDS));
        }
        if found.cancelled || control.is_cancelled() {
            return Err(Error::stopped());
        }
        let leaves = |outcome: &StartOutcome| match outcome {
            StartOutcome::Attractor { index, .. } => match &found.attractors[*index].kind {
                nanotap_dynamics::AttractorKind::Periodic(orbit) => {
                    !SameMotion::orbits(orbit, &self.orbit)
                }
                _ => true,
            },
            StartOutcome::Unbounded => true,
            StartOutcome::TransientChaos { .. } | StartOutcome::Undecided => false,
        };
        let outcomes = knocks.iter().zip(&found.outcomes_by_start);
        Ok(outcomes
            .filter(|(_, outcome)| leaves(outcome))
            .map(|(knock, _)| *knock)
            .collect())
    }

    /// The state at the end of the period in which the orbit is knocked.
    fn after(&mut self, knock: Knock) -> Result<Vec<f64>, MotionError> {
        let (pass, time) = self.moment(knock.instant);
        let period = self.model.period();
        let modes = self.speeds.len();
        let (state, branch) = self.model.split(&self.orbit.states[pass]);
        let (mut state, branch) = self.stepper.step(&state, branch, [0.0, time, period])?;
        for (speed, part) in state[modes..].iter_mut().zip(&self.speeds) {
            *speed += knock.tip_speed * part;
        }
        let (state, branch) = self.stepper.step(&state, branch, [time, period, period])?;
        Ok(self.model.joined(state, branch))
    }

    /// The pass through the drive period in which an instant of the orbit lies, and its time there.
    fn moment(&self, instant: usize) -> (usize, f64) {
        let periods = self.orbit.period as f64 * instant as f64 / INSTANTS as f64;
        (periods as usize, periods.fract() * self.model.period())
    }

    /// Follows a knock by the flow itself; `None` if the lever returns to its orbit or stays
    /// undecided.
    fn confirmed(&mut self, knock: Knock) -> Result<Option<Upset>, Error> {
        let state = self.after(knock)?;
        let end = classify(&mut self.map, &state, &ClassifyOptions::default());
        let named = Named::of(&end.kind);
        let own = |orbit: &PeriodicOrbit| SameMotion::orbits(orbit, &self.orbit);
        if named.orbit.as_ref().is_some_and(own) || matches!(end.kind, MotionKind::Undecided { .. })
        {
            return Ok(None);
        }
        let (_, time) = self.moment(knock.instant);
        let turns = time * self.model.frequency() / std::f64::consts::TAU;
        let first_harmonic = named.orbit.as_ref().map(|orbit| {
            measure(
                self.model,
                &orbit.states[0],
                orbit.period,
                ObservableSet::FIRST_HARMONIC,
            )
        });
        let impulse = knock.tip_speed / self.mobility;
        Ok(Some(Upset {
            tip_speed: knock.tip_speed,
            impulse,
            energy: 0.5 * impulse * knock.tip_speed,
            drive_phase: 360.0 * turns.fract(),
            leads_to: named.classification,
            period: named.orbit.as_ref().map(|orbit| orbit.period),
            first_harmonic: first_harmonic.transpose()?.map(|seen| seen.first_harmonic),
            state: named
                .orbit
                .map_or(end.state, |orbit| orbit.states[0].clone()),
            physical: None,
        }))
    }
}
