//! Channels of an image by name, and its pixels as a table.

use std::fmt::Write as _;

use super::report::{Channels, ScanReport};
use crate::dataset::gsf::Field;
use crate::number::shortest;

/// A channel of an image.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Name in tables, files and Python.
    pub name: &'static str,
    /// Title of the channel, without the unit.
    pub title: &'static str,
    /// SI unit; empty for a number without unit.
    pub unit: &'static str,
    /// Returns the values from the channels of an image: one vector per line, one entry per pixel.
    pub values: fn(&Channels) -> &Vec<Vec<f64>>,
}

/// All channels except the state.
pub const CHANNELS: [Channel; 9] = [
    Channel {
        name: "surface",
        title: "surface",
        unit: "m",
        values: |image| &image.surface,
    },
    Channel {
        name: "height",
        title: "height",
        unit: "m",
        values: |image| &image.height,
    },
    Channel {
        name: "amplitude_error",
        title: "amplitude error",
        unit: "m",
        values: |image| &image.amplitude_error,
    },
    Channel {
        name: "phase",
        title: "phase lag",
        unit: "deg",
        values: |image| &image.phase,
    },
    Channel {
        name: "peak_force",
        title: "mean peak force",
        unit: "N",
        values: |image| &image.peak_force,
    },
    Channel {
        name: "peak_force_max",
        title: "largest peak force",
        unit: "N",
        values: |image| &image.peak_force_max,
    },
    Channel {
        name: "dissipation",
        title: "dissipated energy",
        unit: "J",
        values: |image| &image.dissipation,
    },
    Channel {
        name: "contact_fraction",
        title: "contact time / period",
        unit: "",
        values: |image| &image.contact_fraction,
    },
    Channel {
        name: "mean_deflection",
        title: "mean deflection",
        unit: "m",
        values: |image| &image.mean_deflection,
    },
];

/// Returns the centres of `count` pixels over a length, along or across the lines.
pub(super) fn centres(count: usize, size: f64) -> Vec<f64> {
    let step = size / count.max(1) as f64;
    (0..count).map(|k| (k as f64 + 0.5) * step).collect()
}

impl ScanReport {
    /// Returns the positions of the pixels along a line, m.
    pub fn pixel_positions(&self) -> Vec<f64> {
        centres(self.trace.height.first().map_or(0, Vec::len), self.size[0])
    }

    /// Returns the image of each direction that was scanned, with its name.
    pub fn directions(&self) -> impl Iterator<Item = (&'static str, &Channels)> {
        let retrace = self.retrace.iter().map(|image| ("retrace", image));
        std::iter::once(("trace", &self.trace)).chain(retrace)
    }

    /// Returns a channel of the trace as a field for programs for AFM data.
    pub fn field(&self, channel: &Channel) -> Field {
        let rows = (channel.values)(&self.trace);
        Field {
            title: channel.title.into(),
            x: self.pixel_positions(),
            y: centres(rows.len(), self.size[1]),
            values: rows.iter().flatten().copied().collect(),
            axis_unit: "m".into(),
            value_unit: channel.unit.into(),
        }
    }
}

/// Formats the pixels as CSV, a row per pixel: line, direction, position and every channel, in SI.
pub fn pixels_csv(report: &ScanReport) -> String {
    let mut csv = String::from("line,direction,x (m)");
    for channel in CHANNELS {
        csv.push(',');
        csv.push_str(channel.name);
        if !channel.unit.is_empty() {
            // Writing to a string does not fail.
            let _ = write!(csv, " ({})", channel.unit);
        }
    }
    csv.push_str(",state\n");
    let positions = report.pixel_positions();
    for line in 0..report.trace.height.len() {
        for (direction, image) in report.directions() {
            for (pixel, x) in positions.iter().enumerate() {
                let _ = write!(csv, "{line},{direction},{}", shortest(*x));
                for channel in CHANNELS {
                    let value = (channel.values)(image)[line][pixel];
                    csv.push(',');
                    if value.is_finite() {
                        csv.push_str(&shortest(value));
                    }
                }
                let state = image.state[line][pixel];
                let state = state.map(|state| serde_json::to_value(state).unwrap_or_default());
                let _ = writeln!(
                    csv,
                    ",{}",
                    state.as_ref().and_then(|s| s.as_str()).unwrap_or("")
                );
            }
        }
    }
    csv
}
