//! The figure of the beam's mode shapes.

use nanotap_figures::{Axis, Figure, Line, Panel, Rule};

use nanotap_model::beam::Modes;

/// The mode shapes φ_j(ξ) of the bare beam, the paper's Fig. 2e.
pub fn shapes_figure(beam: &Modes) -> Figure {
    const POINTS: usize = 401;
    // More lines cannot be distinguished.
    const MAX_NAMED: usize = 8;
    let mut panel = Panel::new(
        Axis::linear("position along the beam $ξ = x/L$").range(0.0, 1.0),
        Axis::linear("mode shape $φ_j(ξ)$"),
    )
    .with(Rule::horizontal(0.0));
    for mode in beam.iter() {
        let shape = (0..POINTS).map(|point| {
            let xi = point as f64 / (POINTS - 1) as f64;
            (xi, mode.shape(xi))
        });
        let line = Line::new(shape);
        panel = panel.with(if beam.count() <= MAX_NAMED {
            line.label(format!("mode {}", mode.number))
        } else {
            line
        });
    }
    Figure::single(panel)
}
