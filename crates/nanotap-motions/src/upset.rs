//! The smallest knock found on the tip after which the lever goes to another motion.
//!
//! A knock is an impulse that changes the speeds of the modes at an instant, away from the sample or
//! towards it. Under weak damping the other motion's basin reaches the orbit as arms that are thinner
//! than a percent of their distance. So the sizes are scanned upwards in small steps, at instants all
//! over the orbit and with other sizes at each of them: an arm that passes between the sizes of one
//! instant meets those of its neighbours. From the first knock that is followed by another motion,
//! instant and size are varied in ever smaller steps as long as a smaller one is found, and at last
//! smaller knocks at other instants are tried. These follow the approximate flow, as in a census.
//! The knock that is reported leads to the other motion by the exact flow, which also narrows its
//! size.
//!
//! Fails: it is the smallest knock found. An arm thinner than the steps at every instant is missed. A
//! motion that stays undecided after a knock counts as none.

use nanotap_dynamics::{
    Attractor, AttractorKind, Census, CensusOptions, ClassifyOptions, Control, MotionKind,
    PeriodicOrbit, SameMotion, StartOutcome, StartSet, census_of, classify_exactly, close_orbit,
};
use schemars::JsonSchema;
use serde::Serialize;

use crate::simulate::{Classification, NamedMotion};
use nanotap_case::Case;
use nanotap_case::physical::quantity::JOULES_PER_ELECTRONVOLT;
use nanotap_error::Error;
use nanotap_model::galerkin::Galerkin;
use nanotap_model::model_map::ModelMap;
use nanotap_model::{Model, MotionError};
use nanotap_observe::{ObservableSet, measure};

/// Instants of an orbit at which it is knocked, in both directions, in the scan of sizes.
pub const INSTANTS: usize = 48;
/// Ratio of successive sizes at an instant in this scan.
pub const SIZE_RATIO: f64 = 1.03;
/// Successive sizes that are scanned together.
const SIZES_TOGETHER: usize = 12;
/// First change of the tip's speed that is tried, over its amplitude in the orbit.
const FIRST_SIZE: f64 = 1.0 / 1024.0;
/// Least such change, still far above rounding.
const LEAST_SIZE: f64 = 1e-9;
/// Largest such change.
const LARGEST_SIZE: f64 = 4.0;
/// The scan begins at this part of the largest size that upsets at no instant.
const FIRST_SCANNED: f64 = 0.25;
/// Knocks around one that upsets: instants within one of [`INSTANTS`] on either side, and smaller
/// sizes within one step of the scan.
const AROUND: [usize; 2] = [9, 8];
/// Width of the sizes around a knock, as a part of it, from which they are not narrowed further.
const NARROW: f64 = 1e-3;
/// Largest number of such rounds.
const MAX_ROUNDS: usize = 32;
/// Smaller knocks that are tried at last, within a factor of two, at instants of their own.
const SMALLER: usize = 1024;
/// Largest number of times that one of them is followed by another motion.
const MAX_SMALLER: usize = 8;
/// Rounds of a search that goes up to the largest size, for its progress.
const ROUNDS: usize = 40;
/// Largest number of knocks of a round from which a smaller one is looked for, where the exact flow
/// confirms none.
const MAX_TRIED: usize = 8;
/// First and last step in which the exact flow looks for the end of a basin, as a part of a size.
const EXACT_STEP: [f64; 2] = [1e-3, 1e-4];
/// Largest number of these steps.
const EXACT_STEPS: usize = 12;
/// Parts that fill an interval evenly, however many are drawn, alone and in pairs: 1/g and 1/p, 1/p²
/// of the golden and the plastic ratio (Roberts 2018).
const GOLDEN: f64 = 0.618_033_988_749_894_8;
const PLASTIC: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// The smallest knock found on the tip that makes the lever leave its orbit.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Upset {
    /// Change of the tip's speed, in the model's unit of length per unit of time, positive away
    /// from the sample.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Velocity.model_unit()))]
    pub tip_speed: f64,
    /// Impulse on the tip, in the model's unit of force times time, positive away from the sample.
    pub impulse: f64,
    /// Energy that the impulse would give the lever at rest, in the model's unit of energy.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Energy.model_unit()))]
    pub energy: f64,
    /// Phase of the drive at the knock, in degrees.
    #[schemars(extend("x-unit" = "degree"))]
    pub drive_phase: f64,
    /// Class of the motion that follows the knock.
    pub leads_to: Classification,
    /// Period in drive periods of the motion that follows, if it is periodic.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period: Option<usize>,
    /// Amplitude at the drive frequency of the motion that follows, in the model's unit of length,
    /// if it is periodic.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
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
    #[schemars(extend("x-unit" = "m/s"))]
    pub tip_speed: f64,
    /// Impulse on the tip in N s.
    #[schemars(extend("x-unit" = "N s"))]
    pub impulse: f64,
    /// Energy in J that the impulse would give the lever at rest.
    #[schemars(extend("x-unit" = "J"))]
    pub energy: f64,
    /// Energy in eV that the impulse would give the lever at rest.
    #[serde(rename = "energy_eV")]
    #[schemars(extend("x-unit" = "eV"))]
    pub energy_ev: f64,
    /// Amplitude in m at the drive frequency of the motion that follows.
    #[serde(rename = "A", skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m"))]
    pub amplitude: Option<f64>,
}

/// Result of the knocks on an orbit.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Knocks {
    /// Smallest knock found that makes the lever leave its orbit; `None` if none of those tried
    /// does. A smaller one may do where another motion's basin is thinner than the steps of the
    /// search.
    pub smallest: Option<Upset>,
    /// Number of smaller knocks that were tried without upsetting the orbit; of all knocks tried,
    /// if none does.
    pub smaller_tried: usize,
    /// Ratio of successive sizes at an instant in the scan of sizes, dimensionless.
    pub size_ratio: f64,
    /// Number of instants of the orbit at which sizes were scanned, in both directions.
    pub instants: usize,
    /// Largest change of the tip's speed that was tried, in the model's unit of length per unit of
    /// time.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Velocity.model_unit()))]
    pub largest_tried: f64,
    /// Largest change of the tip's speed that was tried in a physical case, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m/s"))]
    pub largest_tried_in_si: Option<f64>,
}

/// A knock: an instant of the orbit as a part of its repetition, 0 to 1, and a change of the tip's
/// speed.
#[derive(Clone, Copy, Debug)]
struct Knock {
    instant: f64,
    tip_speed: f64,
}

impl Knock {
    fn size(&self) -> f64 {
        self.tip_speed.abs()
    }

    /// Whether another knock has the same direction and an instant within two of [`INSTANTS`].
    fn is_beside(&self, other: &Self) -> bool {
        let apart = (self.instant - other.instant).rem_euclid(1.0);
        let near = apart.min(1.0 - apart) * INSTANTS as f64 <= 2.0;
        near && self.tip_speed * other.tip_speed > 0.0
    }

    /// The same at another instant, larger by a factor.
    fn moved(&self, by: f64, larger: f64) -> Self {
        Self {
            instant: (self.instant + by).rem_euclid(1.0),
            tip_speed: larger * self.tip_speed,
        }
    }
}

/// An orbit that is knocked.
struct Knocked<'a> {
    model: &'a Model,
    orbit: PeriodicOrbit,
    map: ModelMap,
    /// Changes of the modes' speeds by a change of the tip's speed of 1 away from the sample.
    speeds: Vec<f64>,
    /// Change of the tip's speed by an impulse of 1.
    mobility: f64,
    /// Rounds of knocks so far.
    rounds: usize,
    /// Sizes of the knocks that were harmless.
    harmless: Vec<f64>,
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
        speeds,
        mobility,
        rounds: 0,
        harmless: Vec::new(),
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
    let size = found
        .as_ref()
        .map_or(f64::INFINITY, |found| found.tip_speed.abs());
    let harmless = knocked.harmless.iter();
    Ok(Knocks {
        smaller_tried: harmless.filter(|smaller| **smaller < size).count(),
        size_ratio: SIZE_RATIO,
        instants: INSTANTS,
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
        let mut first = FIRST_SIZE * unit;
        while first > LEAST_SIZE * unit && !self.upsetting(&scan(first, 0), control)?.is_empty() {
            first *= 0.5;
        }
        first *= FIRST_SCANNED;
        let largest = LARGEST_SIZE * unit;
        let mut step = 0;
        while first * nanotap_arithmetic::powf(SIZE_RATIO, step as f64) < largest {
            let sizes: Vec<Knock> = (step..step + SIZES_TOGETHER)
                .flat_map(|step| scan(first, step))
                .filter(|knock| knock.size() <= largest)
                .collect();
            step += SIZES_TOGETHER;
            let mut upsetting = self.upsetting(&sizes, control)?;
            upsetting.sort_by(|a, b| a.size().total_cmp(&b.size()));
            // Several arms may come about as near: the smallest knocks are followed down each.
            let mut found: Option<Knock> = None;
            for knock in upsetting.into_iter().take(MAX_TRIED) {
                if found.is_some_and(|found| found.is_beside(&knock)) {
                    continue;
                }
                let near = self.smallest_near(knock, control)?;
                found = match (found, near) {
                    (Some(found), Some(near)) if near.size() >= found.size() => Some(found),
                    (found, near) => near.or(found),
                };
            }
            if let Some(found) = found {
                return self.finished(found, control).map(Some);
            }
        }
        Ok(None)
    }

    /// The smallest knock that is found from one that upsets by the approximate flow, confirmed by
    /// the exact one.
    fn smallest_near(
        &mut self,
        mut knock: Knock,
        control: &Control<'_>,
    ) -> Result<Option<Knock>, Error> {
        let [instants, sizes] = AROUND;
        let mut widths = [1.0 / INSTANTS as f64, SIZE_RATIO - 1.0];
        for _ in 0..MAX_ROUNDS {
            if widths[1] < NARROW {
                break;
            }
            let around: Vec<Knock> = (0..instants * sizes)
                .map(|k| {
                    let aside = (k / sizes) as f64 / (instants - 1) as f64;
                    let part = (k % sizes + 1) as f64 / sizes as f64;
                    knock.moved(widths[0] * (2.0 * aside - 1.0), 1.0 - widths[1] * part)
                })
                .collect();
            let smaller = self.upsetting(&around, control)?.into_iter();
            match smaller.min_by(|a, b| a.size().total_cmp(&b.size())) {
                Some(smaller) => knock = smaller,
                None => widths = widths.map(|width| 0.5 * width),
            }
        }
        self.narrowed(knock)
    }

    /// The knock at the same instant at which, by the exact flow, the other motion's basin begins.
    fn narrowed(&mut self, knock: Knock) -> Result<Option<Knock>, Error> {
        let mut upsetting = None;
        for step in 0..EXACT_STEPS {
            let larger = knock.moved(0.0, 1.0 + EXACT_STEP[0] * step as f64);
            if self.leads_away(larger)? {
                upsetting = Some(larger);
                break;
            }
        }
        let Some(mut upsetting) = upsetting else {
            return Ok(None);
        };
        let [mut step, last] = EXACT_STEP;
        for _ in 0..EXACT_STEPS {
            if step < last {
                break;
            }
            let smaller = upsetting.moved(0.0, 1.0 - step);
            if self.leads_away(smaller)? {
                upsetting = smaller;
            } else {
                step *= 0.5;
            }
        }
        Ok(Some(upsetting))
    }

    /// Tries smaller knocks at other instants, and describes the smallest knock found.
    fn finished(&mut self, mut found: Knock, control: &Control<'_>) -> Result<Upset, Error> {
        for _ in 0..MAX_SMALLER {
            let smaller: Vec<Knock> = (1..=SMALLER)
                .map(|k| {
                    let [instant, size] = PLASTIC.map(|part| (part * k as f64).fract());
                    let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
                    Knock {
                        instant,
                        tip_speed: sign * found.size() * nanotap_arithmetic::exp2(-size),
                    }
                })
                .collect();
            let mut smaller = self.upsetting(&smaller, control)?;
            smaller.sort_by(|a, b| a.size().total_cmp(&b.size()));
            let mut next = None;
            for knock in smaller.into_iter().take(MAX_TRIED) {
                let near = self.smallest_near(knock, control)?;
                next = near.filter(|near| near.size() < found.size());
                if next.is_some() {
                    break;
                }
            }
            match next {
                Some(next) => found = next,
                None => break,
            }
        }
        self.described(found)
    }

    /// Returns those of some knocks that are followed by another motion.
    fn upsetting(&mut self, knocks: &[Knock], control: &Control<'_>) -> Result<Vec<Knock>, Error> {
        let found = self.followed(knocks, control)?;
        let leaves = |outcome: &StartOutcome| match outcome {
            StartOutcome::Attractor { index, .. } => !self.is_own(&found.attractors[*index]),
            StartOutcome::Unbounded => true,
            StartOutcome::TransientChaos { .. } | StartOutcome::Undecided => false,
        };
        let outcomes = knocks.iter().zip(&found.outcomes_by_start);
        let (upsetting, harmless): (Vec<_>, Vec<_>) =
            outcomes.partition(|(_, outcome)| leaves(outcome));
        let sizes = harmless.into_iter().map(|(knock, _)| knock.size());
        self.harmless.extend(sizes);
        Ok(upsetting.into_iter().map(|(knock, _)| *knock).collect())
    }

    /// Whether an attractor is the orbit that is knocked.
    fn is_own(&self, attractor: &Attractor) -> bool {
        match &attractor.kind {
            AttractorKind::Periodic(orbit) => SameMotion::orbits(orbit, &self.orbit),
            _ => false,
        }
    }

    /// Follows the motions after some knocks, on the approximate map if there is one.
    fn followed(&mut self, knocks: &[Knock], control: &Control<'_>) -> Result<Census, Error> {
        let starts = knocks.iter().map(|knock| self.after(*knock));
        let starts = starts.collect::<Result<Vec<_>, _>>()?;
        let own = (self.orbit.period, self.orbit.states[0].clone());
        let starts = StartSet::given(starts).with_seeds([own]);
        let quiet = Control {
            progress: None,
            ..*control
        };
        let budgets = CensusOptions {
            max_steps: u64::MAX,
            ..CensusOptions::default()
        };
        let found = census_of(&self.map, &starts, &budgets, &quiet);
        self.rounds += 1;
        if let Some(progress) = control.progress {
            progress(self.rounds, self.rounds.max(ROUNDS));
        }
        if found.cancelled || control.is_cancelled() {
            return Err(Error::stopped());
        }
        Ok(found)
    }

    /// The state at the end of the period in which the orbit is knocked.
    fn after(&mut self, knock: Knock) -> Result<Vec<f64>, MotionError> {
        let (pass, time) = self.moment(knock.instant);
        let period = self.model.period();
        let modes = self.speeds.len();
        let mut state = self.orbit.states[pass].clone();
        self.map.advance_between(&mut state, [0.0, time])?;
        for (speed, part) in state[modes..].iter_mut().zip(&self.speeds) {
            *speed += knock.tip_speed * part;
        }
        self.map.advance_between(&mut state, [time, period])?;
        Ok(state)
    }

    /// The pass through the drive period in which an instant of the orbit lies, and its time there.
    fn moment(&self, instant: f64) -> (usize, f64) {
        let periods = self.orbit.period as f64 * instant;
        let pass = (periods as usize).min(self.orbit.period - 1);
        (pass, (periods - pass as f64) * self.model.period())
    }

    /// The motion after a knock by the exact flow, and its state at drive phase 0; `None` if the
    /// lever returns to its orbit or stays undecided.
    fn destination(&mut self, knock: Knock) -> Result<Option<(NamedMotion, Vec<f64>)>, Error> {
        let state = self.after(knock)?;
        let end = classify_exactly(&mut self.map, &state, &ClassifyOptions::default());
        if self.model.system.cancel().is_cancelled() {
            return Err(Error::stopped());
        }
        let named = NamedMotion::of(&end.kind);
        let own = |orbit: &PeriodicOrbit| SameMotion::orbits(orbit, &self.orbit);
        let stays = named.orbit.as_ref().is_some_and(own);
        let undecided = matches!(end.kind, MotionKind::Undecided { .. });
        Ok((!stays && !undecided).then_some((named, end.state)))
    }

    /// Whether a knock is followed by another motion by the exact flow.
    fn leads_away(&mut self, knock: Knock) -> Result<bool, Error> {
        Ok(self.destination(knock)?.is_some())
    }

    /// Everything about a knock that the exact flow confirms.
    fn described(&mut self, knock: Knock) -> Result<Upset, Error> {
        let Some((named, state)) = self.destination(knock)? else {
            return Err(Error::numerics("a knock led to another motion only once"));
        };
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
        Ok(Upset {
            tip_speed: knock.tip_speed,
            impulse,
            energy: 0.5 * impulse * knock.tip_speed,
            drive_phase: 360.0 * turns.fract(),
            leads_to: named.classification,
            period: named.orbit.as_ref().map(|orbit| orbit.period),
            first_harmonic: first_harmonic.transpose()?.map(|seen| seen.first_harmonic),
            state: named.orbit.map_or(state, |orbit| orbit.states[0].clone()),
            physical: None,
        })
    }
}

/// Knocks at all instants, in both directions, of the sizes at one step above `first` of the scan:
/// each instant and direction has separate sizes, [`SIZE_RATIO`] apart.
fn scan(first: f64, step: usize) -> Vec<Knock> {
    let knock = |k: usize| {
        let within = (GOLDEN * k as f64).fract();
        let larger = nanotap_arithmetic::powf(SIZE_RATIO, step as f64 + within);
        Knock {
            instant: (k / 2) as f64 / INSTANTS as f64,
            tip_speed: if k.is_multiple_of(2) { first } else { -first } * larger,
        }
    };
    (0..2 * INSTANTS).map(knock).collect()
}
