//! Instruments' files: what they hold, and their numbers as arrays.

use std::path::PathBuf;

use nanotap::files::{Document, open};
use numpy::PyArray1;
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::failure::Failure;

/// Numbers of an array.
type Numbers<'py> = Bound<'py, PyArray1<f64>>;

/// A file of an instrument, whose curves are read one by one.
#[pyclass(frozen)]
pub(crate) struct FileCore(Document);

#[pymethods]
impl FileCore {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Ok(Self(py.detach(|| open(&path)).map_err(Failure::from)?))
    }

    /// Format, grid, notes and settings, JSON.
    #[getter]
    fn about(&self) -> String {
        let document = &self.0;
        json!({
            "format": document.format,
            "kind": document.kind,
            "curves": document.curve_count(),
            "grid": document.grid,
            "notes": document.notes,
            "settings": document.settings,
        })
        .to_string()
    }

    /// What a curve is, JSON, and the values of each channel of each segment.
    fn curve<'py>(
        &self,
        py: Python<'py>,
        number: usize,
    ) -> PyResult<(String, Vec<Vec<Numbers<'py>>>)> {
        let curve = py.detach(|| self.0.curve(number));
        let curve = curve.map_err(|error| Failure::input(error.to_string()))?;
        let segments: Vec<Value> = (curve.segments.iter())
            .map(|segment| {
                let channels = segment.channels.iter();
                let channels: Vec<_> = channels.map(|c| json!([c.name, c.unit])).collect();
                json!({
                    "style": segment.style,
                    "duration": segment.duration,
                    "points": segment.points(),
                    "channels": channels,
                })
            })
            .collect();
        let about = json!({
            "index": curve.index,
            "file": curve.file,
            "position": curve.position,
            "pixel": curve.pixel,
            "spring_constant": curve.spring_constant,
            "sensitivity": curve.sensitivity,
            "distance": curve.distance.as_ref().map(|of| &of.channel),
            "distance_source": curve.distance.as_ref().map(|of| &of.source),
            "deflection": curve.deflection,
            "notes": curve.notes,
            "segments": segments,
        });
        let arrays = curve.segments.into_iter().map(|segment| {
            let channels = segment.channels.into_iter();
            let channels = channels.map(|channel| PyArray1::from_vec(py, channel.values));
            channels.collect()
        });
        Ok((about.to_string(), arrays.collect()))
    }

    /// Name, unit and size of each image, JSON, and its values line by line from the top one.
    fn images<'py>(&self, py: Python<'py>) -> Vec<(String, Numbers<'py>)> {
        let images = self.0.images.iter().map(|image| {
            let about = json!({
                "name": image.name,
                "unit": image.unit,
                "shape": image.shape,
                "size": image.size,
            });
            let values = PyArray1::from_slice(py, &image.values);
            (about.to_string(), values)
        });
        images.collect()
    }

    /// Name and unit of each spectrum, JSON, its frequencies and its values.
    fn spectra<'py>(&self, py: Python<'py>) -> Vec<(String, Numbers<'py>, Numbers<'py>)> {
        let spectra = self.0.spectra.iter().map(|spectrum| {
            let about = json!({ "name": spectrum.name, "unit": spectrum.unit });
            let [frequency, values] = [&spectrum.frequency, &spectrum.values]
                .map(|numbers| PyArray1::from_slice(py, numbers));
            (about.to_string(), frequency, values)
        });
        spectra.collect()
    }
}
