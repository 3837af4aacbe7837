//! Documents as Python dictionaries, lists, numbers and strings.

use nanotap::Error;
use pyo3::IntoPyObjectExt as _;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyString};
use serde::Serialize;
use serde_json::Value;

use crate::failure::Failure;

/// A report as JSON values, built without the interpreter. Non-finite numbers are null.
///
/// # Errors
/// When it cannot be written as JSON.
pub(crate) fn document(report: &impl Serialize) -> Result<Value, Failure> {
    Ok(serde_json::to_value(report).map_err(Error::from)?)
}

/// The same objects as `json.loads` of the document, built directly: writing and parsing numbers
/// takes several times as long.
///
/// # Errors
/// When Python is out of memory.
pub(crate) fn python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    match value {
        Value::Null => Ok(py.None().into_bound(py)),
        Value::Bool(flag) => flag.into_bound_py_any(py),
        Value::Number(number) => match (number.as_u64(), number.as_i64()) {
            (Some(count), _) => count.into_bound_py_any(py),
            (None, Some(whole)) => whole.into_bound_py_any(py),
            (None, None) => number.as_f64().into_bound_py_any(py),
        },
        Value::String(words) => words.into_bound_py_any(py),
        Value::Array(values) => {
            let values = values.iter().map(|value| python(py, value));
            Ok(PyList::new(py, values.collect::<PyResult<Vec<_>>>()?)?.into_any())
        }
        Value::Object(entries) => {
            let dict = PyDict::new(py);
            for (name, value) in entries {
                // The names recur in every document.
                dict.set_item(PyString::intern(py, name), python(py, value)?)?;
            }
            Ok(dict.into_any())
        }
    }
}
