//! The figure of thermal noise: the free lever's spectrum, and what the lock-in amplifier reads.

use nanotap_case::physical::Kind;
use nanotap_figures::{Axis, Colour, DOUBLE_COLUMN, Figure, Legend, Line, Panel, Scale};
use nanotap_motions::figure::panels::{largest_of, si_axis};

use crate::noise::NoiseReport;

/// Root of a density in SI against the frequency, on logarithmic axes.
fn panel(frequency: &str, of: &[f64], label: &str, kind: Kind, density: &[f64]) -> Panel {
    let roots: Vec<f64> = density.iter().map(|density| density.sqrt()).collect();
    // The middle of a logarithmic axis.
    let middle = match of {
        [low, .., high] => (low * high).sqrt(),
        _ => largest_of(of.iter().copied()),
    };
    let (x, along) = si_axis(frequency, Kind::Frequency, middle);
    let (y, factor) = si_axis(label, kind, largest_of(roots.iter().copied()));
    let [x, y] = [x, y].map(|axis| Axis {
        scale: Scale::Log,
        ..axis
    });
    let unit = format!("{}/√Hz", y.unit);
    let points = of.iter().zip(&roots).filter(|(_, root)| **root > 0.0);
    let points = points.map(|(f, root)| (along * f, factor * root));
    Panel::new(x.tight(), y.unit(unit))
        .legend(Legend::Hidden)
        .with(Line::new(points).colour(Colour::BLUE))
}

/// Thermal spectrum of the free lever; noise of amplitude and phase at the working point.
pub fn noise_figure(report: &NoiseReport) -> Figure {
    let free = &report.spectrum;
    let reading = &report.reading_spectrum;
    let around = "distance from the drive's frequency";
    let lengths = [
        ("frequency", &free.frequency, "free lever", &free.density),
        (
            around,
            &reading.frequency,
            "amplitude noise",
            &reading.amplitude,
        ),
    ];
    let lengths = lengths
        .map(|(frequency, of, label, density)| panel(frequency, of, label, Kind::Length, density));
    let phase = panel(
        around,
        &reading.frequency,
        "phase noise",
        Kind::Degrees,
        &reading.phase,
    );
    let figure = Figure::new(1, 3).width(DOUBLE_COLUMN).height(58.0);
    lengths
        .into_iter()
        .chain([phase])
        .fold(figure, Figure::with)
}
