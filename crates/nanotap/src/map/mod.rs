//! The stroboscopic map of a case, for users' own algorithms.
//!
//! A [`Map`] takes the state at drive phase 0 to the state one drive period later, exactly, and
//! knows its derivatives with respect to the state and to every key of the case. It does not
//! change, so that threads may share one; each call has a separate work space.
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
//! A loop that advances one state for long goes faster with a separate work space:
//! [`Map::strobe`], which also is what `nanotap_dynamics` analyses.

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

use crate::case::{Case, CaseError, Key};
use crate::model::model_map::{ModelMap, together};
use crate::model::{Model, MotionError, Tangent};

/// Maximum number of values that [`Map::iterate`] returns.
pub const MAX_NUMBERS: usize = 200_000_000;

/// Drive periods between two looks at whether the work is to stop.
pub(crate) const UNINTERRUPTED: usize = 1024;

/// Why the map could not be made or applied.
#[derive(Clone, Debug, thiserror::Error)]
pub enum MapError {
    /// The case makes no sense.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The distance follows from a setpoint, and was not solved for.
    #[error("the case leaves its distance to the setpoint, and a map needs one")]
    NoDistance,
    /// The numbers are no states.
    #[error("{numbers} numbers are no rows of states of {dimension} numbers each")]
    Shape {
        /// How many numbers there are.
        numbers: usize,
        /// How many each state has.
        dimension: usize,
    },
    /// More than fits.
    #[error("{states} states are too many; {most} at most")]
    TooMany {
        /// Number requested.
        states: usize,
        /// How many there may be.
        most: usize,
    },
    /// A time span that makes no sense.
    #[error("a motion from τ = {from} over {length} cannot be followed: {reason}")]
    Span {
        /// Where it was to begin.
        from: f64,
        /// How long it was to last.
        length: f64,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A motion could not be followed.
    #[error("state {index}: {error}")]
    Motion {
        /// Which of the states, from 0.
        index: usize,
        /// Why.
        error: MotionError,
    },
    /// Newton found no orbit.
    #[error(transparent)]
    Orbit(#[from] ShootingError),
    /// The work was stopped.
    #[error("stopped before the end")]
    Stopped,
}

/// The map of one case from the state at drive phase 0 to the state one drive period later.
///
/// A state is (a₁ … a_N, ȧ₁ … ȧ_N) of a cantilever, after which comes the memory of a sample
/// that recovers, and (x, ẋ) of an oscillator, in the model's units.
#[derive(Clone, Debug)]
pub struct Map {
    case: Arc<Case>,
    model: Arc<Model>,
    /// A work space, to be copied.
    strobe: ModelMap,
}

/// The map at a state, to first order.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearised {
    /// P(z), of length n.
    pub state: Vec<f64>,
    /// ∂P/∂z, `n × n`.
    pub jacobian: DMatrix<f64>,
    /// ∂P/∂key at constant z, a column a key, `n × keys`; per SI unit of a physical quantity.
    pub derivatives: DMatrix<f64>,
}

impl Map {
    /// The map of `case`.
    ///
    /// # Errors
    /// When the case makes no sense, or leaves its distance to a setpoint
    /// ([`at_setpoint`](crate::study::setpoint::at_setpoint) solves for that).
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

    /// The case.
    pub fn case(&self) -> &Case {
        &self.case
    }

    /// Its equations.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// How many numbers a state has.
    pub fn dimension(&self) -> usize {
        self.model.dimension()
    }

    /// The drive period, 2π/Ω of one tone.
    pub fn period(&self) -> f64 {
        self.model.period()
    }

    /// The map with a separate work space, to advance one state again and again, and for
    /// the algorithms of `nanotap_dynamics`.
    pub fn strobe(&self) -> ModelMap {
        self.strobe.clone()
    }

    /// `Pᵏ(state)` for `k = periods`; the state itself for 0.
    ///
    /// # Errors
    /// When the state does not fit or its motion cannot be followed.
    pub fn apply(&self, state: &[f64], periods: usize) -> Result<Vec<f64>, MapError> {
        let mut states = state.to_vec();
        self.fits(state, 1)?;
        self.apply_all(&mut states, periods, &Control::default())?;
        Ok(states)
    }

    /// Replaces every one of `states` (row by row, `rows × n`) by `Pᵏ` of it, `k = periods`,
    /// on the threads of the present pool; the same bits whatever their number. Many states are
    /// advanced side by side, and come out as one alone to rounding.
    ///
    /// # Errors
    /// When the rows are no states, a motion cannot be followed, or the work was stopped.
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

    /// The states `z, Pᵉ(z), P²ᵉ(z), …` for `e = every`, `count` of them, row by row
    /// (`count × n`).
    ///
    /// # Errors
    /// When the state does not fit, its motion cannot be followed, there would be more than
    /// [`MAX_NUMBERS`] numbers, or the work was stopped.
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

    /// `Pᵏ` at a state with its derivatives with respect to the state and to `keys`,
    /// `k = periods`.
    ///
    /// # Errors
    /// When the state does not fit, its motion cannot be followed, or the case is not valid
    /// near the value of a key.
    pub fn linearised(
        &self,
        state: &[f64],
        periods: usize,
        keys: &[Key],
    ) -> Result<Linearised, MapError> {
        self.linearise(&self.tangents(keys)?, state, periods)
    }

    /// The same of every one of `states` (row by row), on the threads of the present pool.
    ///
    /// # Errors
    /// As [`Map::linearised`], and when the work was stopped.
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

    /// The periodic orbit that Newton finds near the motion that begins at `guess`, stable or
    /// not, with its multipliers. Its minimal period may be a part of `period`.
    ///
    /// # Errors
    /// When there is none, or none that is isolated to rounding.
    pub fn orbit(&self, guess: &[f64], period: usize) -> Result<PeriodicOrbit, MapError> {
        self.fits(guess, 1)?;
        let options = ShootingOptions::default();
        Ok(close_orbit(&mut self.strobe(), guess, period, &options)?)
    }

    /// The motion over a time `length` from a state at τ = `from` within the drive period
    /// (0 is drive phase 0), known in closed form at every instant between.
    ///
    /// # Errors
    /// When the state does not fit, the motion cannot be followed, or the span makes no sense
    /// or is longer than [`motion::MAX_PERIODS`].
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

/// Replaces `state` by its image after `periods` drive periods; polls at intervals whether the work is
/// to stop.
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

/// The same for many states.
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

/// Goes over `periods` in parts, between which it is looked whether the work is to stop.
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
    /// The same, its state counted behind `states` others.
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

impl From<MapError> for crate::Error {
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
                Self::new(crate::ErrorKind::BadInput, error.to_string())
            }
            MapError::TooMany { .. } => Self::input(error.to_string(), "ask for fewer {periods}"),
            MapError::Span { .. } => Self::input(error.to_string(), "change {tau} or {start}"),
            MapError::Stopped => Self::new(crate::ErrorKind::Stopped, error.to_string()),
            other => Self::numerics(other.to_string()),
        }
    }
}
