//! The stroboscopic map, for algorithms written in Python.

use std::sync::Arc;

use nanotap::control::Control;
use nanotap::map::{Linearised, Map, MapError, Motion};
use nanotap::study::threads::install;
use numpy::{
    Complex64, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::case::CaseCore;
use crate::failure::Failure;
use crate::watch::watched;

type Rows<'py> = Bound<'py, PyArray2<f64>>;
type Matrices<'py> = Bound<'py, PyArray3<f64>>;

/// Most drive periods that run on the calling thread; longer work is watched, so that Ctrl-C stops
/// it.
const AT_ONCE: usize = 4096;
/// The same under a nonlinear force, whose periods take a thousand times longer.
const NONLINEAR_AT_ONCE: usize = 16;

/// The stroboscopic map of a case.
#[pyclass(frozen, module = "nanotap._nanotap")]
pub(crate) struct MapCore(Arc<Map>);

impl MapCore {
    /// Runs `work` of so many drive periods without the interpreter lock.
    fn done<R: Send + 'static>(
        &self,
        py: Python<'_>,
        periods: usize,
        threads: Option<usize>,
        work: impl FnOnce(&Control<'_>) -> Result<R, MapError> + Send + 'static,
    ) -> PyResult<R> {
        let is_nonlinear = self.0.model().nonlinear.is_some();
        let at_once = if is_nonlinear {
            NONLINEAR_AT_ONCE
        } else {
            AT_ONCE
        };
        if periods <= at_once && threads.is_none() {
            let result = py.detach(|| work(&Control::default()));
            return Ok(result.map_err(Failure::from)?);
        }
        let result = watched(py, None, move |control| {
            Ok(install(threads, || work(control))??)
        })?;
        Ok(result.result)
    }
}

#[pymethods]
impl MapCore {
    #[new]
    fn new(py: Python<'_>, case: &CaseCore) -> PyResult<Self> {
        let case = case.studied(py)?;
        Ok(Self(Arc::new(Map::new(&case).map_err(Failure::from)?)))
    }

    #[getter]
    fn dimension(&self) -> usize {
        self.0.dimension()
    }

    #[getter]
    fn period(&self) -> f64 {
        self.0.period()
    }

    /// Every row of `states` after so many drive periods.
    fn apply<'py>(
        &self,
        py: Python<'py>,
        states: PyReadonlyArray2<'py, f64>,
        periods: usize,
        threads: Option<usize>,
    ) -> PyResult<Rows<'py>> {
        let shape = [states.shape()[0], states.shape()[1]];
        let mut values = states.as_slice()?.to_vec();
        let map = Arc::clone(&self.0);
        let all = shape[0].saturating_mul(periods);
        let values = self.done(py, all, threads, move |control| {
            map.apply_all(&mut values, periods, control)?;
            Ok(values)
        })?;
        PyArray1::from_vec(py, values).reshape(shape)
    }

    /// A state and those that follow it, `count` rows, `every` so many drive periods.
    fn iterate<'py>(
        &self,
        py: Python<'py>,
        state: PyReadonlyArray1<'py, f64>,
        count: usize,
        every: usize,
    ) -> PyResult<Rows<'py>> {
        let (state, map) = (state.as_slice()?.to_vec(), Arc::clone(&self.0));
        let all = count.saturating_mul(every);
        let values = self.done(py, all, None, move |control| {
            map.iterate(&state, count, every, control)
        })?;
        let shape = [values.len() / self.0.dimension(), self.0.dimension()];
        PyArray1::from_vec(py, values).reshape(shape)
    }

    /// States, Jacobians (`rows × n × n`) and derivatives with respect to keys
    /// (`rows × n × keys`) after so many drive periods.
    fn linearised<'py>(
        &self,
        py: Python<'py>,
        states: PyReadonlyArray2<'py, f64>,
        periods: usize,
        keys: Vec<String>,
        threads: Option<usize>,
    ) -> PyResult<(Rows<'py>, Matrices<'py>, Matrices<'py>)> {
        let (rows, n) = (states.shape()[0], self.0.dimension());
        let known = keys
            .iter()
            .map(|key| self.0.case().key(key).map_err(Failure::from))
            .collect::<Result<Vec<_>, _>>()?;
        let (values, map) = (states.as_slice()?.to_vec(), Arc::clone(&self.0));
        // Of several rows only the pool of this process may take part.
        let all = if rows > 1 { usize::MAX } else { periods };
        let found = self.done(py, all, threads, move |control| {
            map.linearised_all(&values, periods, &known, control)
        })?;
        let (mut states, mut jacobians, mut derivatives) = (vec![], vec![], vec![]);
        for Linearised {
            state,
            jacobian,
            derivatives: by_keys,
        } in found
        {
            states.extend(state);
            // numpy counts along rows.
            jacobians.extend_from_slice(jacobian.transpose().as_slice());
            derivatives.extend_from_slice(by_keys.transpose().as_slice());
        }
        let shape = [rows, n, keys.len()];
        Ok((
            PyArray1::from_vec(py, states).reshape([rows, n])?,
            PyArray1::from_vec(py, jacobians).reshape([rows, n, n])?,
            PyArray1::from_vec(py, derivatives).reshape(shape)?,
        ))
    }

    /// The orbit near a guess: its states, multipliers, stability, residual and error.
    #[expect(clippy::type_complexity, reason = "what the orbit is made of")]
    fn orbit<'py>(
        &self,
        py: Python<'py>,
        guess: PyReadonlyArray1<'py, f64>,
        period: usize,
    ) -> PyResult<(
        Rows<'py>,
        Bound<'py, PyArray1<Complex64>>,
        &'static str,
        f64,
        f64,
    )> {
        let (guess, map) = (guess.as_slice()?.to_vec(), Arc::clone(&self.0));
        let orbit = self.done(py, period, None, move |_| map.orbit(&guess, period))?;
        let shape = [orbit.period, self.0.dimension()];
        Ok((
            PyArray1::from_vec(py, orbit.states.concat()).reshape(shape)?,
            PyArray1::from_vec(py, orbit.multipliers),
            orbit.stability.name(),
            orbit.residual,
            orbit.error,
        ))
    }

    /// The motion over a time `length` from τ = `start` within the drive period.
    fn flow(
        &self,
        py: Python<'_>,
        state: PyReadonlyArray1<'_, f64>,
        start: f64,
        length: f64,
    ) -> PyResult<MotionCore> {
        let (state, map) = (state.as_slice()?.to_vec(), Arc::clone(&self.0));
        // What makes no sense the library refuses.
        let periods = (length / self.0.period()) as usize;
        let motion = self.done(py, periods, None, move |_| map.flow(&state, start, length))?;
        Ok(MotionCore(motion))
    }
}

/// A motion between its strobes.
#[pyclass(frozen, module = "nanotap._nanotap")]
pub(crate) struct MotionCore(Motion);

#[pymethods]
impl MotionCore {
    /// Instants row by row: tip, tip rate, gap, force, guard, contact (1 or 0), the state.
    fn at<'py>(&self, py: Python<'py>, tau: PyReadonlyArray1<'py, f64>) -> PyResult<Rows<'py>> {
        let tau = tau.as_slice()?;
        let values: Vec<f64> = py.detach(|| {
            tau.iter()
                .flat_map(|&tau| {
                    let point = self.0.at(tau);
                    let contact = f64::from(u8::from(point.contact));
                    let row = [
                        point.tip,
                        point.tip_rate,
                        point.gap,
                        point.force,
                        point.guard,
                        contact,
                    ];
                    row.into_iter().chain(point.state)
                })
                .collect()
        });
        let shape = [tau.len(), values.len() / tau.len().max(1)];
        PyArray1::from_vec(py, values).reshape(shape)
    }

    /// Contacts begun and ended, JSON.
    #[getter]
    fn events(&self) -> PyResult<String> {
        Ok(serde_json::to_string(self.0.events()).map_err(Failure::from)?)
    }
}
