//! Failures of the stroboscopic map.

use std::error::Error;
use std::sync::Arc;

use nalgebra::DMatrix;

use crate::map::{StroboscopicMap, Tangency};

/// Why one period could not be advanced.
#[derive(Clone, Debug, thiserror::Error)]
pub enum MapFailure {
    /// The map returned an error.
    #[error("the map failed: {0}")]
    Refused(Arc<dyn Error + Send + Sync>),
    /// The map returned an infinity or a NaN.
    #[error("the map returned a state or Jacobian that is not finite")]
    NotFinite,
}

impl MapFailure {
    pub(crate) fn refused(error: impl Error + Send + Sync + 'static) -> Self {
        Self::Refused(Arc::new(error))
    }
}

/// Advances one period; fails if the result is not finite.
#[inline]
pub(crate) fn advance<M: StroboscopicMap>(
    map: &mut M,
    state: &mut [f64],
) -> Result<(), MapFailure> {
    map.advance(state).map_err(MapFailure::refused)?;
    finite(state)
}

/// As [`advance`], over many periods.
pub(crate) fn advance_by<M: StroboscopicMap>(
    map: &mut M,
    state: &mut [f64],
    periods: usize,
) -> Result<(), MapFailure> {
    map.advance_by(state, periods)
        .map_err(MapFailure::refused)?;
    finite(state)
}

/// As [`advance`], for many states with different numbers of periods.
pub(crate) fn advance_each<M: StroboscopicMap>(
    map: &mut M,
    states: &mut [f64],
    periods: &[usize],
) -> Vec<Result<(), MapFailure>> {
    let advanced = map.advance_each(states, periods).into_iter();
    let states = states.chunks_exact(map.dimension());
    advanced
        .zip(states)
        .map(|(result, state)| {
            result.map_err(MapFailure::refused)?;
            finite(state)
        })
        .collect()
}

/// As [`advance_each`], and whether each was reset on the way ([`StroboscopicMap::resets`]).
pub(crate) fn advance_each_until_reset<M: StroboscopicMap>(
    map: &mut M,
    states: &mut [f64],
    periods: &[usize],
) -> Vec<(Result<(), MapFailure>, bool)> {
    if map.batch_size() > 1 {
        let advanced = advance_each(map, states, periods).into_iter();
        return advanced.map(|result| (result, false)).collect();
    }
    let each = states.chunks_exact_mut(map.dimension()).zip(periods);
    each.map(|(state, &periods)| {
        let before = map.resets();
        let result = advance_by(map, state, periods);
        (result, map.resets() > before)
    })
    .collect()
}

/// As [`advance`], with the Jacobian.
#[inline]
pub(crate) fn advance_with_jacobian<M: StroboscopicMap>(
    map: &mut M,
    state: &mut [f64],
    jacobian: &mut DMatrix<f64>,
) -> Result<(), MapFailure> {
    map.advance_with_jacobian(state, jacobian)
        .map_err(MapFailure::refused)?;
    finite(state)?;
    finite(jacobian.as_slice())
}

/// As [`advance_with_jacobian`], and log|det DP| if the system computes it independently.
#[inline]
pub(crate) fn advance_with_jacobian_and_determinant<M: StroboscopicMap>(
    map: &mut M,
    state: &mut [f64],
    jacobian: &mut DMatrix<f64>,
) -> Result<Option<f64>, MapFailure> {
    let determinant = map
        .advance_with_jacobian_and_determinant(state, jacobian)
        .map_err(MapFailure::refused)?;
    finite(state)?;
    finite(jacobian.as_slice())?;
    Ok(determinant)
}

/// As [`advance`], with the extrema of the switching functions.
pub(crate) fn advance_with_tangencies<M: StroboscopicMap>(
    map: &mut M,
    state: &mut [f64],
    tangencies: &mut Vec<Tangency>,
) -> Result<(), MapFailure> {
    map.advance_with_tangencies(state, tangencies)
        .map_err(MapFailure::refused)?;
    finite(state)
}

#[inline]
pub(crate) fn finite(values: &[f64]) -> Result<(), MapFailure> {
    if values.iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(MapFailure::NotFinite)
    }
}
