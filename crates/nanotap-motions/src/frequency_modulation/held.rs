//! The orbit with a given amplitude and phase.
//!
//! Unknowns are the state x at drive phase 0, the drive's frequency ω and its strength s; the
//! equations
//!
//! $$P(x; ω, s) − x = 0, \qquad |c(x; ω, s)| = A, \qquad −\arg c(x; ω, s) = φ$$
//!
//! with the stroboscopic map P and the first harmonic c of the tip's deflection over one period.
//! Newton needs ∂P, which the engines give exactly, and ∂c, which
//! `first_harmonic_changes` does. The system stays regular where the map's own, 1 − ∂P, does
//! not: at a lever's resonance without damping, and at folds of the resonance curve.

use nalgebra::{DMatrix, DVector};
use nanotap_dynamics::{Multipliers, PeriodicOrbit, StroboscopicMap as _};

use nanotap_case::{Case, Key};
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_model::model_map::ModelMap;
use nanotap_observe::{ObservableSet, first_harmonic_changes, measure};

/// Setpoint of the loop: amplitude and phase of the tip's oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// Amplitude of the tip's deflection at the drive's frequency, in the model's unit of length.
    pub amplitude: f64,
    /// Phase lag behind the drive, degrees.
    pub phase: f64,
}

/// A drive and a state at its phase 0; in the model's units.
#[derive(Clone, Debug, PartialEq)]
pub struct Driven {
    /// Angular frequency of the drive, model units.
    pub frequency: f64,
    /// Strength of the drive, model units: its force, or a driven base's amplitude.
    pub strength: f64,
    /// State vector of the equations at drive phase 0, model units.
    pub state: Vec<f64>,
}

impl Driven {
    /// Adds `by` times the change of frequency, strength and state.
    pub fn add(&mut self, by: f64, change: &[f64]) {
        let [frequency, strength, state @ ..] = change else {
            return;
        };
        self.frequency += by * frequency;
        self.strength += by * strength;
        for (x, change) in self.state.iter_mut().zip(state) {
            *x += by * change;
        }
    }
}

/// An orbit at the setpoint of the loop, with its drive.
#[derive(Clone, Debug)]
pub struct HeldOrbit {
    /// Angular frequency of the drive, model units.
    pub frequency: f64,
    /// Strength of the drive, model units: its force, or a driven base's amplitude.
    pub strength: f64,
    /// The orbit; its multipliers are those at constant frequency and strength.
    pub orbit: PeriodicOrbit,
    /// The case with this drive, as parameters of the equations (model units).
    pub case: Case,
    /// Model of `case`, for which the orbit is closed.
    pub model: Model,
}

impl HeldOrbit {
    /// Returns drive and state of the orbit.
    pub fn driven(&self) -> Driven {
        Driven {
            frequency: self.frequency,
            strength: self.strength,
            state: self.orbit.states.first().cloned().unwrap_or_default(),
        }
    }
}

/// Returns the case as parameters of the equations, in which frequency and strength of the drive
/// are independent.
pub(crate) fn equations_of(case: &Case) -> Case {
    if case.is_physical()
        && let Some(cantilever) = case.cantilever()
    {
        return Case::from(cantilever.clone()).called(case.title());
    }
    case.clone()
}

/// Largest number of Newton steps.
const STEPS: usize = 40;
/// Shortest part of a Newton step that is tried, as a fraction of the step.
const SHORTEST: f64 = 1.0 / 64.0;
/// Largest relative residual of an orbit; Newton's method fails above it.
const CLOSED: f64 = 1e-9;
/// Largest number of times that whole-number entries of a state, such as whether a neck exists, are
/// taken from the map at one place. If they still change then, the residual is large.
const MAX_SETTINGS: usize = 3;
/// Largest change of frequency and strength in a step, relative to themselves.
const FARTHEST: [f64; 2] = [0.1, 0.9];

impl Held {
    /// Checks that the loop can hold the setpoint.
    ///
    /// # Errors
    /// When amplitude or phase are out of range.
    pub fn check(self) -> Result<Self, Error> {
        let Self { amplitude, phase } = self;
        if !(amplitude > 0.0 && amplitude.is_finite()) {
            return Err(Error::input(
                format!(
                    "an amplitude of {amplitude} cannot be held: it must be finite and above zero"
                ),
                "give drive.free_amplitude, or alpha2",
            ));
        }
        if !(phase.abs() > 0.0 && phase.abs() < 180.0) {
            return Err(Error::input(
                format!(
                    "a phase of {phase}° cannot be held: it must lie between 0° and 180°, or -180° and \
                     0° for a mode that answers the drive with the other sign"
                ),
                "give a {phase} of 90",
            ));
        }
        Ok(self)
    }

    /// Finds the orbit of `case` near `guess`. The drive of the case does not matter.
    ///
    /// # Errors
    /// When no orbit is found near it, with the reason.
    pub fn close(self, case: &Case, guess: &Driven) -> Result<HeldOrbit, Error> {
        self.check()?;
        let case = equations_of(case);
        let mut at = self.at(&case, guess.clone(), &[])?;
        let mut rows = None;
        for iteration in 0..STEPS {
            let residual = at.residual.amax();
            if residual == 0.0 {
                return at.finish();
            }
            let small = residual <= CLOSED;
            // The rows of amplitude and phase hardly change near the end.
            let known = match rows.take() {
                Some(known) if residual < 1e-3 => known,
                _ => at.first_harmonic_rows(self)?,
            };
            let step = at
                .newton_matrix(&known)
                .lu()
                .solve(&-at.residual.clone())
                .filter(|step| step.iter().all(|v| v.is_finite()));
            rows = Some(known);
            let Some(step) = step else {
                return if small { at.finish() } else { Err(singular()) };
            };
            let n = at.driven.state.len();
            let mut damping = 1_f64;
            for (k, most) in FARTHEST.into_iter().enumerate() {
                damping = damping.min(most / step[n + k].abs());
            }
            loop {
                let trial = self.at(&case, at.moved(&step, damping), &[]);
                if let Ok(trial) = trial
                    && trial.residual.amax() < (1.0 - 0.5 * damping) * residual
                {
                    if trial.residual.amax() > 0.1 * residual {
                        rows = None;
                    }
                    at = trial;
                    break;
                }
                if small {
                    // At rounding level: a full step no longer halves the residual.
                    return at.finish();
                }
                damping *= 0.5;
                if damping < SHORTEST {
                    return Err(diverged(iteration, residual));
                }
            }
        }
        Err(diverged(STEPS, at.residual.amax()))
    }

    /// How drive and state of an orbit change with keys of the case while amplitude and phase are
    /// held: du/dθ = −(∂G/∂u)⁻¹ ∂G/∂θ of the equations G and the unknowns u. Each key stands with
    /// what the amplitude that is held changes by. Numbers of the equations that follow from
    /// the case's own drive keep their dependence on it, as in [`close`](Self::close).
    ///
    /// # Errors
    /// When the case is not valid next to the value of a key, or where the orbit turns back.
    pub fn changes(
        self,
        case: &Case,
        orbit: Driven,
        keys: &[(Key, f64)],
    ) -> Result<Vec<Driven>, Error> {
        let of: Vec<Key> = keys.iter().map(|(key, _)| *key).collect();
        let at = self.at(case, orbit, &of)?;
        let rows = at.first_harmonic_rows(self)?;
        let n = at.sizes.len();
        let columns = at.column_sizes();
        let factors = at.newton_matrix(&rows).lu();
        let change = |(k, (_, amplitude)): (usize, &(Key, f64))| {
            let right = DVector::from_fn(n + 2, |i, _| match i {
                i if i < n => -at.by[(i, 2 + k)] / at.sizes[i],
                i if i == n => {
                    let reached = 1.0 + at.residual[n];
                    amplitude / self.amplitude * reached - rows[(0, n + 2 + k)]
                }
                _ => -rows[(1, n + 2 + k)],
            });
            let solved = factors
                .solve(&right)
                .filter(|step| step.iter().all(|v| v.is_finite()))
                .ok_or_else(singular)?;
            Ok(Driven {
                frequency: solved[n] * columns[n],
                strength: solved[n + 1] * columns[n + 1],
                state: (0..n).map(|i| solved[i] * columns[i]).collect(),
            })
        };
        keys.iter().enumerate().map(change).collect()
    }

    /// The equations and what the map gives of their derivatives by state, frequency, strength
    /// and the values of `more` keys.
    fn at(self, case: &Case, driven: Driven, more: &[Key]) -> Result<At, Error> {
        let case = case.with_drive(driven.frequency, driven.strength);
        let model = case.model()?;
        let keys: Vec<Key> = case.drive_keys().iter().chain(more).copied().collect();
        let tangents = keys
            .iter()
            .map(|key| case.tangent(&model, *key))
            .collect::<Result<Vec<_>, _>>()?;
        let n = model.dimension();
        let mut map = ModelMap::with_tangents(&model, tangents);
        let mut driven = driven;
        let mut end = driven.state.clone();
        let (mut jacobian, mut by) = (DMatrix::zeros(n, n), DMatrix::zeros(n, keys.len()));
        map.advance_with_derivatives(&mut end, &mut jacobian, &mut by)?;
        let whole = n - map.discrete_entries();
        for _ in 0..MAX_SETTINGS {
            if end[whole..] == driven.state[whole..] {
                break;
            }
            driven.state[whole..].copy_from_slice(&end[whole..]);
            end.copy_from_slice(&driven.state);
            map.advance_with_derivatives(&mut end, &mut jacobian, &mut by)?;
        }
        let seen = measure(&model, &driven.state, 1, ObservableSet::FIRST_HARMONIC)?;
        let sizes = self.sizes(&model, driven.frequency);
        let mut residual = DVector::zeros(n + 2);
        for k in 0..n {
            residual[k] = (end[k] - driven.state[k]) / sizes[k];
        }
        residual[n] = seen.first_harmonic / self.amplitude - 1.0;
        residual[n + 1] = turn(seen.phase - self.phase).to_radians();
        Ok(At {
            driven,
            case,
            keys,
            model,
            jacobian,
            by,
            residual,
            sizes,
        })
    }

    /// Returns the scale of each entry of the state: the amplitude, for speeds times the frequency.
    fn sizes(self, model: &Model, frequency: f64) -> Vec<f64> {
        let n = model.dimension() - model.memory;
        let half = n / 2;
        let size = |k: usize| match k {
            k if k < half => self.amplitude,
            k if k < n => self.amplitude * frequency,
            _ if model.nonlinear.is_some() => 1.0,
            _ => self.amplitude,
        };
        (0..model.dimension()).map(size).collect()
    }
}

/// The error of a Newton step whose linear system has no solution.
fn singular() -> Error {
    Error::numerics(
        "the equations for orbit, frequency and strength are singular: the orbit turns back here",
    )
}

/// The error of Newton steps that do not close an orbit, with their largest relative residual.
fn diverged(steps: usize, residual: f64) -> Error {
    Error::numerics(format!(
        "Newton finds no orbit with this amplitude and phase: after {steps} steps the equations are \
         off by {residual:.1e} of the amplitude"
    ))
}

/// An angle in degrees, in (−180, 180].
fn turn(degrees: f64) -> f64 {
    let rest = degrees.rem_euclid(360.0);
    if rest > 180.0 { rest - 360.0 } else { rest }
}

/// The equations at a drive and a state.
struct At {
    driven: Driven,
    case: Case,
    /// Keys of frequency and strength, and others by which derivatives are taken.
    keys: Vec<Key>,
    model: Model,
    jacobian: DMatrix<f64>,
    by: DMatrix<f64>,
    /// Residuals of the equations, relative to the sizes of the unknowns.
    residual: DVector<f64>,
    sizes: Vec<f64>,
}

impl At {
    /// ∂(|c|/A, −arg c) by state, frequency and strength, relative to their sizes, and by the
    /// values of further keys.
    fn first_harmonic_rows(&self, held: Held) -> Result<DMatrix<f64>, Error> {
        let mut rows = first_harmonic_changes(
            &self.case,
            &self.model,
            &self.keys,
            &self.driven.state,
            &self.sizes,
            &self.by,
        )?;
        let more = std::iter::repeat_n(1.0, self.keys.len() - 2);
        for (k, size) in self.column_sizes().into_iter().chain(more).enumerate() {
            rows[(0, k)] *= size / held.amplitude;
            rows[(1, k)] *= size.to_radians();
        }
        Ok(rows)
    }

    /// Sizes of the unknowns: those of the state, frequency and strength themselves.
    fn column_sizes(&self) -> Vec<f64> {
        let drive = [self.driven.frequency, self.driven.strength];
        self.sizes.iter().copied().chain(drive).collect()
    }

    fn newton_matrix(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let n = self.sizes.len();
        let columns = self.column_sizes();
        let mut matrix = DMatrix::zeros(n + 2, n + 2);
        for i in 0..n {
            for j in 0..n + 2 {
                let change = if j < n {
                    self.jacobian[(i, j)] - f64::from(u8::from(i == j))
                } else {
                    self.by[(i, j - n)]
                };
                matrix[(i, j)] = change * columns[j] / self.sizes[i];
            }
        }
        let of_unknowns = rows.columns(0, n + 2);
        matrix.view_mut((n, 0), (2, n + 2)).copy_from(&of_unknowns);
        matrix
    }

    fn moved(&self, step: &DVector<f64>, damping: f64) -> Driven {
        let n = self.sizes.len();
        let state = self.driven.state.iter().zip(&self.sizes).enumerate();
        Driven {
            frequency: self.driven.frequency * (1.0 + damping * step[n]),
            strength: self.driven.strength * (1.0 + damping * step[n + 1]),
            state: state
                .map(|(k, (x, size))| x + damping * step[k] * size)
                .collect(),
        }
    }

    fn finish(self) -> Result<HeldOrbit, Error> {
        let multipliers = Multipliers::of_product(std::slice::from_ref(&self.jacobian))?;
        let n = self.sizes.len();
        let residual = (0..n).fold(0.0, |m: f64, k| {
            m.max((self.residual[k] * self.sizes[k]).abs())
        });
        let orbit = PeriodicOrbit {
            period: 1,
            residual,
            // The bordered system is well conditioned: what the residual leaves is of its size.
            error: residual,
            stability: multipliers.stability(),
            margin: multipliers.margin,
            multipliers: multipliers.values,
            log_determinant: multipliers.log_determinant,
            discrete: ModelMap::new(&self.model).discrete_entries(),
            states: vec![self.driven.state],
        };
        Ok(HeldOrbit {
            frequency: self.driven.frequency,
            strength: self.driven.strength,
            orbit,
            case: self.case,
            model: self.model,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frequency_modulation::FreeOscillation;

    /// Newton's matrix against central differences of the equations, near an orbit that is not
    /// closed, in the exact engine and under a nonlinear force, driven at the base.
    #[test]
    fn newtons_matrix_is_the_derivative_of_the_equations() {
        let lever = [
            "modes=2",
            "cantilever.k=2 N/m",
            "cantilever.f0=70 kHz",
            "cantilever.Q=50",
            "tip.radius=10 nm",
            "drive.frequency=70 kHz",
            "drive.free_amplitude=20 nm",
            "gap.tip=18 nm",
        ];
        let samples: [&[&str]; 2] = [
            &["sample.stiffness=5 N/m", "sample.damping=1e-7 N s/m"],
            &[
                "sample.law=dmt",
                "sample.modulus=1 GPa",
                "sample.hamaker=1e-19 J",
            ],
        ];
        for sample in samples {
            let words: Vec<String> = lever
                .iter()
                .chain(sample)
                .map(|w| (*w).to_owned())
                .collect();
            let case = equations_of(&Case::parse(None, &words).unwrap());
            let amplitude = nanotap_study::FreeMotion::of(&case.model().unwrap()).amplitude;
            let held = Held {
                amplitude,
                phase: 90.0,
            };
            let free = FreeOscillation::of(&case, held).unwrap().driven();
            let at = held.at(&case, free, &[]).unwrap();
            let rows = at.first_harmonic_rows(held).unwrap();
            let matrix = at.newton_matrix(&rows);
            let n = matrix.nrows();
            for column in 0..n {
                let step = 1e-5;
                let at_side = |side: f64| {
                    let mut change = DVector::zeros(n);
                    change[column] = side * step;
                    let there = held.at(&case, at.moved(&change, 1.0), &[]).unwrap();
                    let mut residual = there.residual;
                    for (k, size) in there.sizes.iter().enumerate() {
                        residual[k] *= size / at.sizes[k];
                    }
                    residual
                };
                let difference = (at_side(1.0) - at_side(-1.0)) / (2.0 * step);
                let error = (difference - matrix.column(column)).amax();
                let size = matrix.column(column).amax();
                assert!(
                    error < 1e-5 * size,
                    "{sample:?} {column}: {error} of {size}"
                );
            }
        }
    }
}
