//! The motion under two tones whose frequencies have no common period.
//!
//! The second tone's phase θ at the beginning of a period of the first turns by 2πρ from period to
//! period, with ρ = ω₂/ω₁. In the long run the state at the beginning of a period is a function u of
//! this phase, a closed curve, with
//!
//! $$P_θ(u(θ)) = u(θ + 2πρ)$$
//!
//! where P_θ is the exact map of one period of the first tone. u is known at K equidistant phases and
//! interpolated by trigonometric polynomials, which converge beyond all orders as long as the motion
//! depends smoothly on the phase: Newton solves for all K states at once. Where contacts come and go
//! with the phase, they converge slowly; the size of the last harmonics tells the error.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Dyn, LU};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::StroboscopicMap as _;
use nanotap_flow::Complex;

use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::drive_form::FrequencyRatio;
use nanotap_model::model_map::ModelMap;
use nanotap_model::parameter::Parameter;
use nanotap_model::recording::{Curve, Recording};

/// Largest number of Newton steps.
const STEPS: usize = 10;
/// Shortest part of a Newton step that is tried, as a fraction of the step.
const SHORTEST: f64 = 0.2;
/// Relative residual at which Newton's method stops.
const CLOSED: f64 = 1e-13;
/// Relative residual that Newton's method must reach; above it the torus is rejected.
const ACCEPTED: f64 = 1e-10;
/// Size of the last harmonics over that of the motion, above which there are too few phases.
const RESOLVED: f64 = 1e-6;
/// Initial number of phases, which is also the smallest, and largest number.
const PHASES: [usize; 2] = [9, 129];
/// Number of phases at which the torus is fitted to a computed motion.
const SETTLED_PHASES: usize = 33;
/// Least number of phases at which extrema are looked for.
const SCANNED: usize = 33;
/// Part of the range of a quantity over the phases by which a local extremum may fall short of the
/// extreme and still be refined.
const CONTENDING: f64 = 0.1;
/// Golden sections of the phases around an extremum: an error of the phase enters squared.
const SECTIONS: usize = 18;
/// Size of the last harmonics over that of the motion, below which half as many phases suffice.
pub(super) const OVER_RESOLVED: f64 = 1e-9;

/// The drive of both tones and the distance, in the model's units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drives {
    pub(super) frequency: [f64; 2],
    pub(super) strength: [f64; 2],
    pub(super) gap: f64,
}

impl Drives {
    /// The lever under this drive, with the second tone at a phase in radians.
    fn on(&self, lever: &Cantilever, phase: f64) -> Cantilever {
        let mut lever = lever.clone();
        lever.omega = self.frequency[0];
        lever.alpha2 = self.strength[0];
        lever.alpha5 = self.gap;
        let ratio = self.frequency[1] / self.frequency[0];
        lever.further_tones = vec![FrequencyRatio::unlocked(ratio)];
        lever
            .with(Parameter::Tone2Amplitude, self.strength[1])
            .with(Parameter::Tone2Phase, phase.to_degrees())
    }

    /// Returns the turns of the second tone in a period of the first.
    fn rotation(&self) -> f64 {
        self.frequency[1] / self.frequency[0]
    }
}

/// States at the beginning of a period of the first tone, at equidistant phases of the second.
#[derive(Clone, Debug)]
pub(super) struct Torus {
    states: Vec<Vec<f64>>,
}

impl Torus {
    /// Returns the torus of the lever at rest: zero states at the smallest number of phases.
    pub(super) fn at_rest(dimension: usize) -> Self {
        Self {
            states: vec![vec![0.0; dimension]; PHASES[0]],
        }
    }

    /// Interpolates the torus to `count` phases.
    fn with_phases(&self, count: usize) -> Self {
        let states = (0..count).map(|k| {
            let weights = weights(self.states.len(), k as f64 / count as f64);
            combined(&weights, &self.states)
        });
        Self {
            states: states.collect(),
        }
    }

    /// Computes the motion that a state goes to at constant drives: integrates many periods and
    /// fits trigonometric polynomials in the phase to the last of them.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn settled(
        lever: &Cantilever,
        drives: &Drives,
        start: &Self,
        periods: usize,
        control: &Control<'_>,
    ) -> Result<Self, Error> {
        let count = SETTLED_PHASES;
        let rows = 6 * count;
        let mut state = start.states[0].clone();
        let mut matrix = DMatrix::zeros(rows, count);
        let mut values = DMatrix::zeros(rows, state.len());
        for period in 0..periods + rows {
            if control.is_cancelled() {
                return Err(Error::stopped());
            }
            let turns = (period as f64 * drives.rotation()).rem_euclid(1.0);
            if let Some(row) = period.checked_sub(periods) {
                let weights = weights(count, turns);
                matrix.row_mut(row).copy_from_slice(&weights);
                values.row_mut(row).copy_from_slice(&state);
            }
            let model = Model::cantilever(&drives.on(lever, TAU * turns))?;
            ModelMap::new(&model).advance(&mut state)?;
        }
        let fitted = (matrix.tr_mul(&matrix)).lu().solve(&matrix.tr_mul(&values));
        let fitted = fitted.ok_or_else(|| {
            Error::numerics("the two tones have nearly a common period: their phases repeat")
        })?;
        let states = fitted.row_iter().map(|row| row.iter().copied().collect());
        Ok(Self {
            states: states.collect(),
        })
    }

    /// Returns the torus after part of a step relative to the sizes of the state's continuous
    /// entries.
    fn moved(&self, step: &DVector<f64>, part: f64, sizes: &[f64]) -> Self {
        let mut moved = self.clone();
        for (k, state) in moved.states.iter_mut().enumerate() {
            for (i, size) in sizes.iter().enumerate() {
                state[i] += part * step[k * sizes.len() + i] * size;
            }
        }
        moved
    }

    /// Rounds the last entries from `first` on to whole numbers, which interpolation leaves with
    /// rounding errors; None if they differ from phase to phase.
    fn on_one_branch(mut self, first: usize) -> Option<Self> {
        for state in &mut self.states {
            state[first..]
                .iter_mut()
                .for_each(|entry| *entry = entry.round());
        }
        let branch = |state: &Vec<f64>| state[first..].to_vec();
        let own = branch(&self.states[0]);
        self.states
            .iter()
            .all(|state| branch(state) == own)
            .then_some(self)
    }

    /// Returns the torus with half as many phases, or the smallest number.
    pub(super) fn coarser(&self) -> Self {
        self.with_phases(((self.states.len() / 2) | 1).max(PHASES[0]))
    }

    /// Extrapolates the torus: adds `share` of the change from `before` to this one.
    pub(super) fn extrapolated(&self, before: &Self, share: f64) -> Self {
        let before = before.with_phases(self.states.len());
        let states = self.states.iter().zip(&before.states);
        let moved = states.map(|(now, before)| {
            let entries = now.iter().zip(before);
            entries
                .map(|(now, before)| now + share * (now - before))
                .collect()
        });
        Self {
            states: moved.collect(),
        }
    }

    /// Returns the largest of the last two harmonics of the phase, over the sizes of the state's
    /// entries.
    fn tail(&self, sizes: &[f64]) -> f64 {
        let count = self.states.len();
        let last = count / 2;
        let harmonic = |order: usize, entry: usize| {
            let terms = self.states.iter().enumerate().map(|(k, state)| {
                let (sin, cos) =
                    nanotap_arithmetic::sin_cos(TAU * ((order * k) % count) as f64 / count as f64);
                Complex::new(cos, -sin) * state[entry]
            });
            terms.sum::<Complex>().modulus() * 2.0 / count as f64
        };
        let entries = sizes.iter().enumerate();
        entries.fold(0.0, |largest: f64, (entry, size)| {
            largest.max(harmonic(last, entry).max(harmonic(last - 1, entry)) / size)
        })
    }
}

/// Weights of an odd number of equidistant samples of a trigonometric polynomial at `turns` of a turn.
fn weights(count: usize, turns: f64) -> Vec<f64> {
    let weight = |k: usize| {
        let away = (turns - k as f64 / count as f64).rem_euclid(1.0);
        let angle = 0.5 * TAU * if away > 0.5 { away - 1.0 } else { away };
        let below = count as f64 * nanotap_arithmetic::sin(angle);
        if below == 0.0 {
            1.0
        } else {
            nanotap_arithmetic::sin(count as f64 * angle) / below
        }
    };
    (0..count).map(weight).collect()
}

fn combined(weights: &[f64], states: &[Vec<f64>]) -> Vec<f64> {
    let mut sum = vec![0.0; states[0].len()];
    for (weight, state) in weights.iter().zip(states) {
        for (sum, entry) in sum.iter_mut().zip(state) {
            *sum += weight * entry;
        }
    }
    sum
}

/// A torus that Newton's method has closed, with its drives.
#[derive(Clone, Debug)]
pub(super) struct Closed {
    pub(super) torus: Torus,
    pub(super) drives: Drives,
    /// The largest of the last harmonics of the phase, relative to the motion.
    pub(super) tail: f64,
    models: Vec<Model>,
    /// LU factors of Newton's matrix, of this torus or a nearby one.
    factors: Arc<LU<f64, Dyn, Dyn>>,
}

/// Force on the tip and height over the sample, over the phases of the second tone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Forces {
    /// Components at each tone: c of Re(c e^{iωt}).
    pub(super) tones: [Complex; 2],
    pub(super) mean: f64,
    pub(super) largest: f64,
    pub(super) lowest: f64,
    /// Least height of the tip over the undeformed surface, model units.
    pub(super) closest: f64,
}

/// Closes the torus of `lever` near `start`; `amplitude` is the size of the motion, `near` a torus whose
/// Newton matrix may serve.
///
/// # Errors
/// When Newton does not close it, or the law is on different branches at different phases.
pub(super) fn close(
    lever: &Cantilever,
    drives: Drives,
    start: &Torus,
    amplitude: f64,
    near: Option<&Closed>,
    control: &Control<'_>,
) -> Result<Closed, Error> {
    let mut closed = newton(lever, drives, start.clone(), amplitude, near, control)?;
    while closed.tail > RESOLVED && closed.torus.states.len() < PHASES[1] {
        let more = 2 * closed.torus.states.len() - 1;
        let finer = closed.torus.with_phases(more.min(PHASES[1]));
        closed = newton(lever, drives, finer, amplitude, None, control)?;
    }
    Ok(closed)
}

fn newton(
    lever: &Cantilever,
    drives: Drives,
    mut torus: Torus,
    amplitude: f64,
    near: Option<&Closed>,
    control: &Control<'_>,
) -> Result<Closed, Error> {
    let count = torus.states.len();
    let models = (0..count)
        .map(|k| Model::cantilever(&drives.on(lever, TAU * k as f64 / count as f64)))
        .collect::<Result<Vec<_>, _>>()
        .map_err(|error| Error::numerics(error.to_string()))?;
    let mut maps: Vec<ModelMap> = models.iter().map(ModelMap::new).collect();
    // Which of its branches a law is on must be the same at every phase, as off the surface.
    let whole = models[0].dimension();
    let dimension = whole - maps[0].discrete_entries();
    let several = || {
        Error::numerics(
            "the contact law is on one of its branches at some phases of the second tone at the beginning \
             of a period, and on another one at others: this is not solved for",
        )
        .remedy("give drive.second_ratio as in 25/4, and use `orbit`")
    };
    torus = torus.on_one_branch(dimension).ok_or_else(several)?;
    let sizes = sizes(&models[0], amplitude, drives.frequency[0]);
    let sizes = &sizes[..dimension];
    let shift: Vec<Vec<f64>> = (0..count)
        .map(|k| {
            weights(
                count,
                k as f64 / count as f64 + drives.rotation().rem_euclid(1.0),
            )
        })
        .collect();
    let mut off = |torus: &Torus, jacobians: Option<&mut Vec<DMatrix<f64>>>| {
        let mut residual = DVector::zeros(count * dimension);
        let mut of_periods = jacobians;
        if let Some(jacobians) = &mut of_periods {
            jacobians.clear();
        }
        for (k, map) in maps.iter_mut().enumerate() {
            if control.is_cancelled() {
                return Err(Error::stopped());
            }
            let mut end = torus.states[k].clone();
            match &mut of_periods {
                Some(jacobians) => {
                    let mut jacobian = DMatrix::zeros(whole, whole);
                    map.advance_with_jacobian(&mut end, &mut jacobian)?;
                    jacobians.push(jacobian);
                }
                None => map.advance(&mut end)?,
            }
            if end[dimension..] != torus.states[k][dimension..] {
                return Err(several());
            }
            let there = combined(&shift[k], &torus.states);
            for i in 0..dimension {
                residual[k * dimension + i] = (end[i] - there[i]) / sizes[i];
            }
        }
        Ok(residual)
    };
    // The factors of a torus near do as long as steps gain much.
    let mut factors = near
        .filter(|near| near.torus.states.len() == count)
        .map(|near| Arc::clone(&near.factors));
    let mut jacobians = Vec::new();
    let mut residual = off(&torus, None)?;
    for _ in 0..STEPS {
        let size = residual.amax();
        if size <= CLOSED {
            break;
        }
        let borrowed = factors.is_some();
        let used = if let Some(factors) = factors.take() {
            factors
        } else {
            off(&torus, Some(&mut jacobians))?;
            Arc::new(newton_matrix(&shift, &jacobians, sizes).lu())
        };
        let step = used
            .solve(&residual)
            .filter(|step| step.iter().all(|entry| entry.is_finite()))
            .ok_or_else(|| Error::numerics("the motion under two tones turns back here"))?;
        let mut part = 1.0;
        let next = loop {
            let next = torus.moved(&step, part, sizes);
            let left = off(&next, None)?;
            if left.amax() < size {
                break Some((next, left));
            }
            part *= 0.5;
            if part < SHORTEST || borrowed {
                break None;
            }
        };
        match next {
            Some((next, left)) => {
                if left.amax() < 0.2 * size {
                    factors = Some(used);
                }
                (torus, residual) = (next, left);
            }
            // Fresh factors improve the torus only at the level of rounding errors.
            None if borrowed && size > ACCEPTED => {}
            None => break,
        }
    }
    let left = residual.amax();
    if left > ACCEPTED {
        return Err(Error::numerics(format!(
            "Newton finds no motion under the two tones: the equations are off by {left:.1e} of the \
             amplitude"
        )));
    }
    let factors = match factors.or_else(|| near.map(|near| Arc::clone(&near.factors))) {
        Some(factors) if factors.u().nrows() == count * dimension => factors,
        _ => {
            off(&torus, Some(&mut jacobians))?;
            Arc::new(newton_matrix(&shift, &jacobians, sizes).lu())
        }
    };
    let tail = torus.tail(sizes);
    Ok(Closed {
        torus,
        drives,
        tail,
        models,
        factors,
    })
}

/// Returns Newton's matrix in sizes of the state's entries: the turned torus minus the Jacobians of
/// the periods.
fn newton_matrix(shift: &[Vec<f64>], jacobians: &[DMatrix<f64>], sizes: &[f64]) -> DMatrix<f64> {
    let (count, dimension) = (shift.len(), sizes.len());
    DMatrix::from_fn(count * dimension, count * dimension, |row, column| {
        let (k, i) = (row / dimension, row % dimension);
        let (j, l) = (column / dimension, column % dimension);
        let carried = if k == j {
            jacobians[k][(i, l)] * sizes[l] / sizes[i]
        } else {
            0.0
        };
        let turned = if i == l { shift[k][j] } else { 0.0 };
        turned - carried
    })
}

/// Returns the scale of each entry of the state.
fn sizes(model: &Model, amplitude: f64, frequency: f64) -> Vec<f64> {
    let moving = model.dimension() - model.memory;
    let size = |k: usize| match k {
        k if k < moving / 2 => amplitude,
        k if k < moving => amplitude * frequency,
        _ if model.nonlinear.is_some() => 1.0,
        _ => amplitude,
    };
    (0..model.dimension()).map(size).collect()
}

impl Closed {
    /// Returns the readings of a lock-in amplifier on each tone: c of the component Re(c e^{iωt})
    /// of the tip deflection, model units.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn readings(&self) -> Result<[Complex; 2], Error> {
        let mut sum = [Complex::new(0.0, 0.0); 2];
        for (k, (model, state)) in self.models.iter().zip(&self.torus.states).enumerate() {
            let recording = Recording::of(model, state, 1)?;
            self.add_tones(&mut sum, k, &recording.curve(&model.tip));
        }
        Ok(sum)
    }

    /// Computes force on the tip and height along the motion of `lever`, the one of the torus. The
    /// extrema are those over all phases, not only those of the torus.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn forces(&self, lever: &Cantilever) -> Result<Forces, Error> {
        let mut found = Forces {
            tones: [Complex::new(0.0, 0.0); 2],
            mean: 0.0,
            largest: f64::NEG_INFINITY,
            lowest: f64::INFINITY,
            closest: f64::INFINITY,
        };
        for (k, (model, state)) in self.models.iter().zip(&self.torus.states).enumerate() {
            let recording = Recording::of(model, state, 1)?;
            let force = recording.force(model);
            self.add_tones(&mut found.tones, k, &force);
            found.mean += force.mean() / self.models.len() as f64;
        }
        let count = self.models.len();
        let scanned = count * SCANNED.div_ceil(count);
        let phases = (0..scanned).map(|k| k as f64 / scanned as f64);
        let seen = phases
            .map(|turns| self.extremes(lever, turns))
            .collect::<Result<Vec<_>, _>>()?;
        let of = |quantity: usize| {
            let values: Vec<f64> = seen.iter().map(|extremes| extremes[quantity]).collect();
            refined(&values, |turns| Ok(self.extremes(lever, turns)?[quantity]))
        };
        (found.largest, found.lowest, found.closest) = (of(0)?, -of(1)?, -of(2)?);
        Ok(found)
    }

    /// Returns largest force, minus the lowest force and minus the least height in the period that
    /// begins at a phase of the second tone, in turns.
    fn extremes(&self, lever: &Cantilever, turns: f64) -> Result<[f64; 3], Error> {
        let count = self.models.len();
        let model = Model::cantilever(&self.drives.on(lever, TAU * turns))
            .map_err(|error| Error::numerics(error.to_string()))?;
        let mut state = combined(&weights(count, turns), &self.torus.states);
        let first = state.len() - ModelMap::new(&model).discrete_entries();
        state[first..]
            .iter_mut()
            .for_each(|entry| *entry = entry.round());
        let recording = Recording::of(&model, &state, 1)?;
        let none = || Error::numerics("the motion under two tones is empty");
        let (least, most) = recording.force(&model).range().ok_or_else(none)?;
        let height = recording.curve(&model.height).range().ok_or_else(none)?;
        Ok([most.value, -least.value, -height.0.value])
    }

    /// Adds the share of the phase with this index in the components of a curve at both tones. The
    /// mean over the phases keeps the component that turns with each tone.
    fn add_tones(&self, sum: &mut [Complex; 2], phase: usize, curve: &Curve) {
        let count = self.models.len() as f64;
        let (sin, cos) = nanotap_arithmetic::sin_cos(TAU * phase as f64 / count);
        let back = [Complex::new(1.0, 0.0), Complex::new(cos, -sin)];
        let own = curve.fourier_at(&self.drives.frequency);
        for tone in 0..2 {
            sum[tone] += own[tone] * back[tone] / count;
        }
    }

    /// Returns the factor by which a small disturbance grows in a period of the first tone at
    /// constant drives, as the mean over many periods.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn growth(&self) -> Result<f64, Error> {
        /// Periods before the mean, and of the mean.
        const PERIODS: [usize; 2] = [500, 2000];
        let count = self.models.len();
        let whole = self.models[0].dimension();
        let dimension = whole - ModelMap::new(&self.models[0]).discrete_entries();
        let mut jacobians = Vec::with_capacity(count);
        for (model, state) in self.models.iter().zip(&self.torus.states) {
            let mut jacobian = DMatrix::zeros(whole, whole);
            ModelMap::new(model).advance_with_jacobian(&mut state.clone(), &mut jacobian)?;
            jacobians.push(jacobian.view((0, 0), (dimension, dimension)).into_owned());
        }
        let mut disturbance = DVector::from_element(dimension, 1.0);
        // The weights of a smooth bump make the mean of what turns quasi-periodically converge beyond
        // all orders (Das, Saiki, Sander and Yorke, Nonlinearity 30, 4111, 2017).
        let weight = |period: usize| {
            let part = (period as f64 - PERIODS[0] as f64 + 0.5) / PERIODS[1] as f64;
            if part > 0.0 {
                nanotap_arithmetic::exp(-1.0 / (part * (1.0 - part)))
            } else {
                0.0
            }
        };
        let (mut sum, mut total) = (0.0, 0.0);
        for period in 0..PERIODS[0] + PERIODS[1] {
            let turns = (period as f64 * self.drives.rotation()).rem_euclid(1.0);
            let weights = weights(count, turns);
            let mut next = DVector::zeros(dimension);
            for (weight, jacobian) in weights.iter().zip(&jacobians) {
                next += *weight * (jacobian * &disturbance);
            }
            let factor = next.norm() / disturbance.norm();
            disturbance = next / factor.max(f64::MIN_POSITIVE);
            sum += weight(period) * nanotap_arithmetic::ln(factor.max(f64::MIN_POSITIVE));
            total += weight(period);
        }
        Ok(nanotap_arithmetic::exp(sum / total))
    }
}

/// Returns the maximum of a function of the phase in turns with these values at equidistant phases
/// from 0 on: golden sections around every local maximum that may be the largest.
fn refined(values: &[f64], of: impl Fn(f64) -> Result<f64, Error>) -> Result<f64, Error> {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let count = values.len();
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let floor = largest - CONTENDING * (largest - least);
    let mut found = largest;
    for (k, value) in values.iter().enumerate() {
        let (before, after) = (values[(k + count - 1) % count], values[(k + 1) % count]);
        if *value < floor || !(*value >= before && *value > after) {
            continue;
        }
        let [mut low, mut high] = [k as f64 - 1.0, k as f64 + 1.0].map(|k| k / count as f64);
        let mut left = high - golden * (high - low);
        let mut right = low + golden * (high - low);
        let (mut at_left, mut at_right) = (of(left)?, of(right)?);
        for _ in 0..SECTIONS {
            if at_left > at_right {
                (high, right, at_right) = (right, left, at_left);
                left = high - golden * (high - low);
                at_left = of(left)?;
            } else {
                (low, left, at_left) = (left, right, at_right);
                right = low + golden * (high - low);
                at_right = of(right)?;
            }
        }
        found = found.max(at_left).max(at_right);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_maximum_between_equidistant_phases_is_found() {
        // Two maxima, the higher one at 0.234 of a turn between the phases.
        let of = |turns: f64| {
            let angle = TAU * (turns - 0.234);
            (2.0 * angle).cos() + 0.02 * angle.cos()
        };
        let values: Vec<f64> = (0..33).map(|k| of(f64::from(k) / 33.0)).collect();
        let found = refined(&values, |turns| Ok(of(turns))).unwrap();
        assert!((found - 1.02).abs() < 1e-8, "{found}");
        assert_eq!(refined(&[0.5; 9], |_| Ok(0.5)).unwrap(), 0.5);
    }

    /// The extrema of a motion in contact, against those at 2000 phases: so many miss the maximum
    /// of a cosine by 1.2e-6 of its amplitude at most.
    #[test]
    fn extrema_over_the_phases_are_those_of_a_dense_scan() {
        let words = [
            "modes=2",
            "cantilever.k=2 N/m",
            "cantilever.f0=70 kHz",
            "cantilever.Q=20",
            "tip.radius=10 nm",
            "sample.law=dmt",
            "sample.modulus=1 GPa",
            "sample.hamaker=3e-20 J",
            "drive.actuation=tip",
            "drive.frequency_ratio=1",
            "drive.free_amplitude=20 nm",
            "drive.second_ratio=6.27",
            "drive.second_free_amplitude=1 nm",
            "gap.tip=15 nm",
        ];
        let case = nanotap_case::Case::parse(None, &words.map(str::to_owned)).unwrap();
        let lever = case.cantilever().unwrap();
        let drives = Drives {
            frequency: [lever.omega, 6.27 * lever.omega],
            strength: [lever.alpha2, lever.get(Parameter::Tone2Amplitude)],
            gap: lever.alpha5,
        };
        let control = Control::default();
        let model = Model::cantilever(&drives.on(lever, 0.0)).unwrap();
        let amplitude = 20e-9 / case.physical().unwrap().scales.length;
        let start = Torus::at_rest(model.dimension());
        let settled = Torus::settled(lever, &drives, &start, 150, &control).unwrap();
        let closed = close(lever, drives, &settled, amplitude, None, &control).unwrap();
        let found = closed.forces(lever).unwrap();
        let mut dense = [f64::NEG_INFINITY; 3];
        for k in 0..2000 {
            let seen = closed.extremes(lever, f64::from(k) / 2000.0).unwrap();
            for (largest, value) in dense.iter_mut().zip(seen) {
                *largest = largest.max(value);
            }
        }
        for (found, dense) in [found.largest, -found.lowest, -found.closest]
            .into_iter()
            .zip(dense)
        {
            let off = (found - dense) / dense.abs();
            assert!((-1e-9..1e-6).contains(&off), "{found} {dense}");
        }
    }

    #[test]
    fn trigonometric_polynomials_are_interpolated_exactly() {
        let curve = |turns: f64| 0.3 + (TAU * 3.0 * turns).sin() - 0.2 * (TAU * 4.0 * turns).cos();
        let states: Vec<Vec<f64>> = (0..9).map(|k| vec![curve(k as f64 / 9.0)]).collect();
        for turns in [0.0, 0.123, 1.0 / 9.0, 0.999] {
            let value = combined(&weights(9, turns), &states)[0];
            assert!((value - curve(turns)).abs() < 1e-13, "{turns}");
        }
        let torus = Torus { states };
        // The coefficients of the fourth and third harmonics.
        assert!((torus.tail(&[1.0]) - 1.0).abs() < 1e-13);
    }
}
