//! The stroboscopic map of a case, for users' algorithms.
//!
//! A [`Map`] takes the state at drive phase 0 to the state one drive period later, exactly, with
//! its derivatives with respect to the state and to every key of the case. It is immutable, so that
//! threads may share it; each call has its own work space.
//!
//! ```
//! use nanotap::Map;
//! use nanotap::case::Case;
//!
//! let words = ["alpha1=0.1", "alpha2=0.1", "alpha3=0.1", "alpha4=20", "alpha6=0.2", "omega=3"];
//! let case = Case::parse(None, &words.map(str::to_owned))?;
//! let map = Map::new(&case)?;
//!
//! // Newton by hand: z − (DP − 1)⁻¹ (P(z) − z).
//! let mut z = map.apply(&vec![0.0; map.dimension()], 200)?;
//! for _ in 0..5 {
//!     let at = map.linearised(&z, 1, &[])?;
//!     let rest = nalgebra::DVector::from_fn(z.len(), |i, _| at.state[i] - z[i]);
//!     let n = z.len();
//!     let newton = (at.jacobian - nalgebra::DMatrix::identity(n, n)).lu();
//!     let step = newton.solve(&rest).ok_or("a multiplier is 1")?;
//!     z.iter_mut().zip(step.iter()).for_each(|(z, step)| *z -= step);
//! }
//! assert!((z[0] - map.orbit(&z, 1)?.states[0][0]).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! To advance one state many times, use a separate work space, [`Map::strobe`], which is also the
//! map that `nanotap_dynamics` analyses.

pub mod motion;

use std::sync::Arc;

use nalgebra::DMatrix;
use nanotap_dynamics::{
    Control, PeriodicOrbit, Scheduling as _, ShootingError, ShootingOptions, StroboscopicMap as _,
    close_orbit,
};
use nanotap_flow::FlowError;
use nanotap_volterra::VolterraError;
use rayon::prelude::*;

pub use motion::{Motion, Point};

use nanotap_case::{Case, CaseError, Key};
use nanotap_model::model_map::{ModelMap, together};
use nanotap_model::{Model, MotionError, Tangent};

/// Largest number of values that [`Map::iterate`] returns.
pub const MAX_NUMBERS: usize = 200_000_000;

/// Drive periods between two checks for cancellation.
pub const UNINTERRUPTED: usize = 1024;

/// Why the map could not be created or applied.
#[derive(Clone, Debug, thiserror::Error)]
pub enum MapError {
    /// The case is invalid or has no model.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The distance follows from a setpoint and has not been solved for.
    #[error("the case leaves its distance to the setpoint, and a map needs one")]
    NoDistance,
    /// The length of the input is not a multiple of the state dimension.
    #[error("{numbers} numbers are no rows of states of {dimension} numbers each")]
    Shape {
        /// Number of values in the input.
        numbers: usize,
        /// Number of values in a state.
        dimension: usize,
    },
    /// The number of states exceeds the limit.
    #[error("{states} states are too many; {most} at most")]
    TooMany {
        /// Number of states that were requested.
        states: usize,
        /// Largest number of states that one call returns.
        most: usize,
    },
    /// The time span is invalid.
    #[error("a motion from τ = {from} over {length} cannot be followed: {reason}")]
    Span {
        /// Beginning of the span, in model units of time.
        from: f64,
        /// Length of the span, in model units of time.
        length: f64,
        /// Reason why the span is invalid.
        reason: &'static str,
    },
    /// The flow of a state failed.
    #[error("state {index}: {error}")]
    Motion {
        /// Index of the state, from 0.
        index: usize,
        /// Error of the flow from this state.
        error: MotionError,
    },
    /// Newton's method found no periodic orbit.
    #[error(transparent)]
    Orbit(#[from] ShootingError),
    /// The computation was cancelled before its end.
    #[error("stopped before the end")]
    Stopped,
}

/// The map of one case from the state at drive phase 0 to the state one drive period later.
///
/// A state is (a₁ … a_N, ȧ₁ … ȧ_N) for a cantilever, followed by the internal variables of the
/// sample, and (x, ẋ) for an oscillator, in the model's units.
#[derive(Clone, Debug)]
pub struct Map {
    case: Arc<Case>,
    model: Arc<Model>,
    /// A work space to be cloned.
    strobe: ModelMap,
}

/// The linearised map at a state.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearised {
    /// Image P(z) of the state z, length n, in model units.
    pub state: Vec<f64>,
    /// Derivative ∂P/∂z, `n × n`, in model units.
    pub jacobian: DMatrix<f64>,
    /// Derivative ∂P/∂key at constant z, `n × keys`; for a physical quantity per SI unit.
    pub derivatives: DMatrix<f64>,
}

impl Map {
    /// Creates the map of `case`.
    ///
    /// # Errors
    /// If the case is invalid, or its distance follows from a setpoint
    /// ([`at_setpoint`](crate::setpoint::at_setpoint) solves for it).
    pub fn new(case: &Case) -> Result<Self, MapError> {
        if case.leaves_distance_to_setpoint() {
            return Err(MapError::NoDistance);
        }
        let model = case.model()?;
        Ok(Self {
            strobe: ModelMap::new(&model),
            model: Arc::new(model),
            case: Arc::new(case.clone()),
        })
    }

    /// The case of the map.
    pub fn case(&self) -> &Case {
        &self.case
    }

    /// The model of the map.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// Returns the number n of values in a state.
    pub fn dimension(&self) -> usize {
        self.model.dimension()
    }

    /// The drive period, 2π/Ω for one tone, in the model's time.
    pub fn period(&self) -> f64 {
        self.model.period()
    }

    /// The map with a separate work space, for repeated use and for the algorithms of
    /// `nanotap_dynamics`.
    pub fn strobe(&self) -> ModelMap {
        self.strobe.clone()
    }

    /// `Pᵏ(state)` for `k = periods`; the state itself for 0.
    ///
    /// # Errors
    /// If the state has the wrong length or the flow fails.
    pub fn apply(&self, state: &[f64], periods: usize) -> Result<Vec<f64>, MapError> {
        let mut states = state.to_vec();
        self.fits(state, 1)?;
        self.apply_all(&mut states, periods, &Control::default())?;
        Ok(states)
    }

    /// Replaces each of `states` (row by row, `rows × n`) by its image after `periods` drive
    /// periods, on the threads of the current pool. The result does not depend on the number of
    /// threads. Many states are advanced in batches; each agrees with a single state to rounding.
    ///
    /// # Errors
    /// If the length is not a multiple of n, a flow fails, or the computation is cancelled.
    pub fn apply_all(
        &self,
        states: &mut [f64],
        periods: usize,
        control: &Control<'_>,
    ) -> Result<(), MapError> {
        let n = self.dimension();
        let rows = self.rows(states)?;
        if rows == 1 {
            return advance(&mut self.strobe(), states, periods, control);
        }
        let together = together(&self.strobe, rows);
        let some = |strobe: &mut ModelMap, (number, states): (usize, &mut [f64])| {
            advance_all(strobe, states, periods, control)
                .map_err(|error| error.after(number * together))
        };
        if rows.saturating_mul(periods) <= UNINTERRUPTED {
            let mut strobe = self.strobe();
            let mut parts = states.chunks_mut(together * n).enumerate();
            return parts.try_for_each(|part| some(&mut strobe, part));
        }
        let parts = states.par_chunks_mut(together * n).enumerate();
        parts.try_for_each_init(|| self.strobe(), some)
    }

    /// The states `z, Pᵉ(z), P²ᵉ(z), …` for `e = every`: `count` states, row by row (`count × n`).
    ///
    /// # Errors
    /// If the state has the wrong length, the flow fails, there would be more than [`MAX_NUMBERS`]
    /// values, or the computation is cancelled.
    pub fn iterate(
        &self,
        state: &[f64],
        count: usize,
        every: usize,
        control: &Control<'_>,
    ) -> Result<Vec<f64>, MapError> {
        self.fits(state, 1)?;
        let most = MAX_NUMBERS / self.dimension();
        if count > most {
            return Err(MapError::TooMany {
                states: count,
                most,
            });
        }
        let mut strobe = self.strobe();
        let mut state = state.to_vec();
        let mut all = Vec::with_capacity(count * state.len());
        for k in 0..count {
            all.extend_from_slice(&state);
            if k + 1 == count {
                break;
            }
            advance(&mut strobe, &mut state, every, control)?;
        }
        Ok(all)
    }

    /// The map over `periods` drive periods at a state, with its derivatives with respect to the
    /// state and to `keys`.
    ///
    /// # Errors
    /// If the state has the wrong length, the flow fails, or the case is invalid near the value of
    /// a key.
    pub fn linearised(
        &self,
        state: &[f64],
        periods: usize,
        keys: &[Key],
    ) -> Result<Linearised, MapError> {
        self.linearise(&self.tangents(keys)?, state, periods)
    }

    /// As [`Map::linearised`], for each of `states` (row by row), on the threads of the current
    /// pool.
    ///
    /// # Errors
    /// As [`Map::linearised`], and if the computation is cancelled.
    pub fn linearised_all(
        &self,
        states: &[f64],
        periods: usize,
        keys: &[Key],
        control: &Control<'_>,
    ) -> Result<Vec<Linearised>, MapError> {
        self.rows(states)?;
        let (n, tangents) = (self.dimension(), self.tangents(keys)?);
        let one = |(index, state): (usize, &[f64])| {
            if control.is_cancelled() {
                return Err(MapError::Stopped);
            }
            self.linearise(&tangents, state, periods)
                .map_err(|error| error.after(index))
        };
        if states.len() / n == 1 {
            return states.chunks(n).enumerate().map(one).collect();
        }
        states.par_chunks(n).enumerate().map(one).collect()
    }

    fn tangents(&self, keys: &[Key]) -> Result<Vec<Tangent>, MapError> {
        let tangent = |key: &Key| Ok(self.case.tangent(&self.model, *key)?);
        keys.iter().map(tangent).collect()
    }

    fn linearise(
        &self,
        tangents: &[Tangent],
        state: &[f64],
        periods: usize,
    ) -> Result<Linearised, MapError> {
        self.fits(state, 1)?;
        let n = self.dimension();
        let mut strobe = ModelMap::with_tangents(&self.model, tangents.to_vec());
        let mut at = Linearised {
            state: state.to_vec(),
            jacobian: DMatrix::identity(n, n),
            derivatives: DMatrix::zeros(n, tangents.len()),
        };
        let mut jacobian = DMatrix::zeros(n, n);
        let mut derivatives = DMatrix::zeros(n, tangents.len());
        for _ in 0..periods {
            strobe
                .advance_with_derivatives(&mut at.state, &mut jacobian, &mut derivatives)
                .map_err(of_state(0))?;
            at.derivatives = &jacobian * at.derivatives + &derivatives;
            at.jacobian = &jacobian * at.jacobian;
        }
        Ok(at)
    }

    /// Finds the periodic orbit near the motion from `guess` by Newton's method, stable or
    /// unstable, with its multipliers. Its minimal period may divide `period`.
    ///
    /// # Errors
    /// If there is none, or none that is isolated to rounding.
    pub fn orbit(&self, guess: &[f64], period: usize) -> Result<PeriodicOrbit, MapError> {
        self.fits(guess, 1)?;
        let options = ShootingOptions::default();
        Ok(close_orbit(&mut self.strobe(), guess, period, &options)?)
    }

    /// The motion over the time `length` from a state at τ = `from` within the first drive period
    /// (0 is drive phase 0), in closed form at every instant.
    ///
    /// # Errors
    /// If the state has the wrong length, the flow fails, or the span is invalid or longer than
    /// [`motion::MAX_PERIODS`].
    pub fn flow(&self, state: &[f64], from: f64, length: f64) -> Result<Motion, MapError> {
        self.fits(state, 1)?;
        Motion::follow(&self.model, state, from, length)
    }

    fn rows(&self, states: &[f64]) -> Result<usize, MapError> {
        let rows = states.len() / self.dimension();
        self.fits(states, rows)?;
        Ok(rows)
    }

    fn fits(&self, states: &[f64], rows: usize) -> Result<(), MapError> {
        let dimension = self.dimension();
        if states.len() == rows * dimension {
            Ok(())
        } else {
            Err(MapError::Shape {
                numbers: states.len(),
                dimension,
            })
        }
    }
}

/// Advances `state` by `periods` drive periods, with regular checks for cancellation.
fn advance(
    strobe: &mut ModelMap,
    state: &mut [f64],
    periods: usize,
    control: &Control<'_>,
) -> Result<(), MapError> {
    in_parts(periods, control, |now| {
        strobe.advance_by(state, now).map_err(of_state(0))
    })
}

/// Advances many states in sequence.
fn advance_all(
    strobe: &mut ModelMap,
    states: &mut [f64],
    periods: usize,
    control: &Control<'_>,
) -> Result<(), MapError> {
    let rows = states.len() / strobe.dimension().max(1);
    in_parts(periods, control, |now| {
        let advanced = strobe.advance_each(states, &vec![now; rows]);
        let mut results = advanced.into_iter().enumerate();
        results.try_for_each(|(index, result)| result.map_err(of_state(index)))
    })
}

/// Advances by `periods` in parts, with a check for cancellation between them.
fn in_parts(
    periods: usize,
    control: &Control<'_>,
    mut part: impl FnMut(usize) -> Result<(), MapError>,
) -> Result<(), MapError> {
    for done in (0..periods).step_by(UNINTERRUPTED) {
        if control.is_cancelled() {
            return Err(MapError::Stopped);
        }
        part((periods - done).min(UNINTERRUPTED))?;
    }
    Ok(())
}

fn of_state(index: usize) -> impl Fn(MotionError) -> MapError {
    move |error| MapError::Motion { index, error }
}

impl MapError {
    /// The same error, with its state counted after `states` others.
    fn after(self, states: usize) -> Self {
        match self {
            Self::Motion { index, error } => Self::Motion {
                index: index + states,
                error,
            },
            other => other,
        }
    }
}

impl From<MapError> for nanotap_error::Error {
    fn from(error: MapError) -> Self {
        match error {
            MapError::Case(error) => error.into(),
            MapError::NoDistance => Self::input(
                error.to_string(),
                "solve for the distance first, or give gap.tip",
            ),
            MapError::Motion {
                error:
                    MotionError::Flow(FlowError::NotFinite { .. } | FlowError::Shape { .. })
                    | MotionError::Nonlinear(VolterraError::Value { .. } | VolterraError::Shape { .. }),
                ..
            }
            | MapError::Shape { .. }
            | MapError::Orbit(ShootingError::BadGuess(_)) => {
                Self::new(nanotap_error::ErrorKind::BadInput, error.to_string())
            }
            MapError::TooMany { .. } => Self::input(error.to_string(), "ask for fewer {periods}"),
            MapError::Span { .. } => Self::input(error.to_string(), "change {tau} or {start}"),
            MapError::Stopped => Self::new(nanotap_error::ErrorKind::Stopped, error.to_string()),
            other => Self::numerics(other.to_string()),
        }
    }
}
