//! The lever far from the sample, oscillating with a given amplitude and phase.

use nalgebra::{DMatrix, DVector};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::Complex;

use super::held::{Driven, Held, equations_of};
use nanotap_case::{Case, Key};
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::contact::ContactLaw;
use nanotap_model::drive_form::Actuation;
use nanotap_model::model_map::ModelMap;
use nanotap_observe::{ObservableSet, measure};
use nanotap_study::FreeMotion;

/// The free lever at the amplitude and phase that are held; in the model's units.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeOscillation {
    /// Amplitude of the tip's deflection at the drive's frequency, model units.
    pub amplitude: f64,
    /// Phase lag behind the drive, degrees.
    pub phase: f64,
    /// Angular frequency at which the lever lags by that phase, model units.
    pub frequency: f64,
    /// Strength of the drive that gives the amplitude at this frequency, model units.
    pub strength: f64,
    /// Amplitude of the tip's own motion at the drive's frequency, a driven base's included, model
    /// units.
    pub swing: f64,
    /// Largest excursion of the tip towards the sample from its rest position, model units.
    pub reach: f64,
    /// Energy that the lever's own damping takes in a period, model units.
    pub loss: f64,
    /// Stiffness k by which the frequency responds to a force F₁ cos at the tip that is in phase
    /// with the tip's own motion of amplitude Z, model units: Δf/f₀ = −F₁/(2kZ) to first order. If
    /// the base is at rest and the phase 90°, it is −(ω/2) ∂Re(1/G)/∂ω with the response G to such
    /// a force, the stiffness of the mode.
    pub stiffness: f64,
    /// State vector of the equations at drive phase 0, model units.
    pub state: Vec<f64>,
}

/// Largest number of steps of the secant method.
const STEPS: usize = 60;

impl FreeOscillation {
    /// Finds the free oscillation of the lever of `case`, near the resonance nearest to the case's
    /// drive frequency.
    ///
    /// # Errors
    /// When the case is not valid, or the lever has no such phase there.
    pub fn of(case: &Case, held: Held) -> Result<Self, Error> {
        let alone = alone(&equations_of(case), held);
        let own = alone.omega();
        let start = nearest_resonance(&alone.model()?, own);
        // 1/G is nearly a parabola in the frequency, so that the secant method finds where its
        // part across the phase vanishes.
        let turned = |frequency: f64| -> Result<Complex, Error> {
            let inverse = inverse_response(&alone, frequency)?;
            let (sin, cos) = nanotap_arithmetic::sin_cos(held.phase.to_radians());
            Ok(inverse * Complex::new(cos, -sin))
        };
        let none = |remedy: String| {
            Error::input(
                format!(
                    "near the drive's frequency the free lever nowhere lags by {}°",
                    held.phase
                ),
                format!("{remedy}, or drive the lever at its tip"),
            )
        };
        let other = || none("give another {phase}".to_owned());
        let (mut a, mut b) = (start, start * (1.0 + 1e-6));
        let (mut fa, mut fb) = (turned(a)?.im, turned(b)?.im);
        for _ in 0..STEPS {
            if fb == 0.0 || fb == fa {
                break;
            }
            let next = b - fb * (b - a) / (fb - fa);
            if !(next > 0.3 * start && next < 3.0 * start) {
                return Err(other());
            }
            let moved = (next - b).abs();
            (a, fa) = (b, fb);
            b = next;
            fb = turned(b)?.im;
            if moved <= 2.0 * f64::EPSILON * b {
                break;
            }
        }
        let there = turned(b)?;
        let is_found = there.im.abs() <= 1e-6 * there.re.abs();
        if !is_found {
            return Err(other());
        }
        if there.re <= 0.0 {
            // The higher modes of a driven base answer with the other sign.
            let opposite = held.phase - 180.0_f64.copysign(held.phase);
            return Err(none(format!("give {{phase}} {opposite}, as it lags there")));
        }
        let strength = held.amplitude * there.re;
        let model = alone.with_drive(b, strength).model()?;
        let state = steady_state(&model)?;
        let closed = held.close(
            &alone,
            &Driven {
                frequency: b,
                strength,
                state,
            },
        )?;
        let seen = measure(
            &closed.model,
            &closed.orbit.states[0],
            1,
            ObservableSet::ALL,
        )?;
        let swing = seen.tip_motion.unwrap_or(held.amplitude);
        let lag = seen.tip_motion_phase.unwrap_or(held.phase);
        let mut state = closed.orbit.states[0].clone();
        // A sample's memory is at rest.
        state.resize(case.model()?.dimension(), 0.0);
        Ok(Self {
            amplitude: held.amplitude,
            phase: held.phase,
            frequency: b,
            strength,
            swing,
            reach: FreeMotion::of(&model).reach,
            loss: seen.energy_balance.drive_work,
            stiffness: stiffness(&alone, b, held, [strength, swing, lag])?,
            state,
        })
    }
}

impl FreeOscillation {
    /// Returns the oscillation with another amplitude: the free lever is linear.
    #[must_use]
    pub fn with_amplitude(&self, amplitude: f64) -> Self {
        let share = amplitude / self.amplitude;
        Self {
            amplitude,
            strength: share * self.strength,
            swing: share * self.swing,
            reach: share * self.reach,
            loss: share * share * self.loss,
            state: self.state.iter().map(|x| share * x).collect(),
            ..self.clone()
        }
    }

    /// Returns drive and state of the free oscillation.
    pub fn driven(&self) -> Driven {
        Driven {
            frequency: self.frequency,
            strength: self.strength,
            state: self.state.clone(),
        }
    }
}

impl FreeOscillation {
    /// Computes the derivatives of frequency and strength (model units) by keys of the case. Each
    /// key is given with the derivative of the controlled amplitude by it.
    ///
    /// # Errors
    /// As [`Held::changes`].
    pub fn changes(
        &self,
        case: &Case,
        held: Held,
        keys: &[(Key, f64)],
    ) -> Result<Vec<[f64; 2]>, Error> {
        let alone = alone(&equations_of(case), held);
        let mut driven = self.driven();
        driven.state.truncate(alone.model()?.dimension());
        // A lever that answers linearly: the strength is as the amplitude.
        let by_amplitude = self.strength / self.amplitude;
        let drive = case.drive_keys();
        let there = case.with_drive(self.frequency, self.strength);
        let change = |&(key, amplitude): &(Key, f64)| {
            let slopes = match case.cantilever() {
                Some(_) => there.numbers_by(key)?,
                None => vec![(key, 1.0)],
            };
            let slopes = slopes.into_iter().filter(|(key, _)| !drive.contains(key));
            let (numbers, slopes): (Vec<_>, Vec<_>) = slopes.map(|(k, by)| ((k, 0.0), by)).unzip();
            let by_number = if numbers.is_empty() {
                Vec::new()
            } else {
                held.changes(&alone, driven.clone(), &numbers)?
            };
            let sum = |of: fn(&Driven) -> f64| -> f64 {
                by_number
                    .iter()
                    .zip(&slopes)
                    .map(|(d, by)| of(d) * by)
                    .sum()
            };
            Ok([
                sum(|d| d.frequency),
                sum(|d| d.strength) + amplitude * by_amplitude,
            ])
        };
        keys.iter().map(change).collect()
    }
}

/// Returns the lever of `case` without a sample, in the exact engine.
fn alone(case: &Case, held: Held) -> Case {
    let far = 1e3 * held.amplitude;
    match case.cantilever() {
        Some(cantilever) => Case::from(Cantilever {
            law: None,
            alpha4: 0.0,
            alpha5: far,
            alpha6: 0.0,
            ..cantilever.clone().on(ContactLaw::SpringDamper, &[])
        }),
        None => case.with(Key::OscillatorGap, far),
    }
}

/// Returns the free resonance nearest to a frequency.
fn nearest_resonance(model: &Model, frequency: f64) -> f64 {
    let free = model.system.regimes().first();
    let rates = free.map_or(&[][..], |free| &free.basis().eigenvalues);
    let found = rates
        .iter()
        .map(|rate| rate.modulus())
        .filter(|w| *w > 0.0)
        .min_by(|a, b| {
            let off = |w: f64| nanotap_arithmetic::ln(w / frequency).abs();
            off(*a).total_cmp(&off(*b))
        });
    found.unwrap_or(frequency)
}

/// Returns the strength of the drive over the amplitude of the free tip, with its phase.
fn inverse_response(case: &Case, frequency: f64) -> Result<Complex, Error> {
    let free = FreeMotion::of(&case.with_drive(frequency, 1.0).model()?);
    let (sin, cos) = nanotap_arithmetic::sin_cos(free.phase.to_radians());
    Ok(Complex::new(cos, sin) / free.amplitude)
}

/// [`FreeOscillation::stiffness`] with the drive of this strength, of which the tip swings by
/// `swing` and lags by `lag` degrees.
///
/// Of the deflection y = G_d s + G F at a drive s and a force F at the tip, the phase φ is held:
/// Im(A e^(−iφ)/G_d) = Im(G F/G_d), of which the left hand is zero at the free frequency.
fn stiffness(
    case: &Case,
    frequency: f64,
    held: Held,
    [strength, swing, lag]: [f64; 3],
) -> Result<f64, Error> {
    let at_tip = match case.cantilever() {
        Some(cantilever) => Case::from(Cantilever {
            actuation: Actuation::Tip,
            ..cantilever.clone()
        }),
        None => case.clone(),
    };
    let turned = |degrees: f64| {
        let (sin, cos) = nanotap_arithmetic::sin_cos(degrees.to_radians());
        Complex::new(cos, -sin)
    };
    let across = |frequency: f64| -> Result<f64, Error> {
        Ok((inverse_response(case, frequency)? * turned(held.phase)).im)
    };
    let step = 1e-5;
    let slope =
        (across(frequency * (1.0 + step))? - across(frequency * (1.0 - step))?) / (2.0 * step);
    let answer = turned(lag - held.phase) / inverse_response(&at_tip, frequency)?;
    Ok(-0.5 * held.amplitude / strength * held.amplitude / swing * slope / answer.im)
}

/// Computes the steady motion of a linear system, at drive phase 0.
fn steady_state(model: &Model) -> Result<Vec<f64>, Error> {
    let n = model.dimension();
    let mut map = ModelMap::new(model);
    let mut at = vec![0.0; n];
    let mut jacobian = DMatrix::zeros(n, n);
    nanotap_dynamics::StroboscopicMap::advance_with_jacobian(&mut map, &mut at, &mut jacobian)?;
    let solved = (DMatrix::identity(n, n) - jacobian)
        .lu()
        .solve(&DVector::from_vec(at));
    Ok(solved.map_or_else(|| vec![0.0; n], |state| state.as_slice().to_vec()))
}
