//! The figure of thermal noise: the free lever's spectrum, and what the lock-in amplifier reads.

use nanotap_figures::{Axis, Colour, DOUBLE_COLUMN, Figure, Legend, Line, Panel};

use crate::noise::NoiseReport;

/// Root of a density against the frequency.
fn panel(frequency: Axis, label: &str, of: impl Iterator<Item = (f64, f64)>) -> Panel {
    Panel::new(frequency, Axis::log(label))
        .legend(Legend::Hidden)
        .with(Line::new(of.filter(|(_, density)| *density > 0.0)).colour(Colour::BLUE))
}

/// Thermal spectrum of the free lever; noise of amplitude and phase at the working point.
pub fn noise_figure(report: &NoiseReport) -> Figure {
    let roots = |frequency: &[f64], by: f64, density: &[f64], unit: f64| {
        let pairs = frequency.iter().zip(density);
        let pairs = pairs.map(|(f, density)| (by * f, unit * density.sqrt()));
        pairs.collect::<Vec<_>>().into_iter()
    };
    let free = &report.spectrum;
    let reading = &report.reading_spectrum;
    let around = || Axis::log("distance from the drive's frequency (Hz)").tight();
    let (picometres, kilohertz) = (1e12, 1e-3);
    Figure::new(1, 3)
        .width(DOUBLE_COLUMN)
        .height(58.0)
        .with(panel(
            Axis::log("frequency (kHz)").tight(),
            "free lever (pm/√Hz)",
            roots(&free.frequency, kilohertz, &free.density, picometres),
        ))
        .with(panel(
            around(),
            "amplitude noise (pm/√Hz)",
            roots(&reading.frequency, 1.0, &reading.amplitude, picometres),
        ))
        .with(panel(
            around(),
            "phase noise (°/√Hz)",
            roots(&reading.frequency, 1.0, &reading.phase, 1.0),
        ))
}
