//! Fig. 2e (mode shapes) and Fig. 3 (frequencies in contact against α1 and α4).

use nanotap_figures::{Axis, Figure, Line, Panel, Rule};

use super::check::digits;
use super::runs::Runs;
use super::section::{Picture, Section};
use super::{PaperError, rerun};
use nanotap::model::beam::Modes;
use nanotap::model::cantilever::{Cantilever, CantileverError};
use nanotap::model::exact_beam;
use nanotap::model::parameter::Parameter;
use nanotap::study::modes::ModeTable;

/// Computes the section on Fig. 2e: the first three mode shapes.
pub(super) fn mode_shapes(_: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    /// Number of points of a mode shape.
    const POINTS: usize = 401;
    let beam =
        Modes::new(3).map_err(|e| nanotap::model::ModelError::from(CantileverError::from(e)))?;
    let mut panel = Panel::new(
        Axis::linear("position along the beam $ξ = x/L$").range(0.0, 1.0),
        Axis::linear("mode shape $φ_j(ξ)$"),
    )
    .with(Rule::horizontal(0.0));
    for mode in beam.iter() {
        let shape = (0..POINTS)
            .map(|k| k as f64 / (POINTS - 1) as f64)
            .map(|xi| (xi, mode.shape(xi)));
        panel = panel.with(Line::new(shape).label(format!("mode {}", mode.number)));
    }
    // A clamped-free mode j has j − 1 nodes between its ends.
    let nodes: Vec<f64> = beam
        .iter()
        .map(|mode| {
            let value = |k: usize| mode.shape(k as f64 / 1000.0);
            (20..1000)
                .filter(|&k| (value(k) > 0.0) != (value(k + 1) > 0.0))
                .count() as f64
        })
        .collect();
    Ok(section
        .picture(Picture::new(
            "fig02e",
            "The first three modes of the bare cantilever (Fig. 2e)",
            "Clamped at ξ = 0, free at ξ = 1, no tip mass; normalised so that the mean square of each is 1, \
             hence ±2 at the tip.",
            Figure::single(panel),
            80.0,
        ))
        .check(
            "fig2e",
            nodes.clone(),
            format!("drawn from their closed form; nodes: {}, {}, {}", nodes[0], nodes[1], nodes[2]),
            "mode j of a clamped-free beam has j − 1 nodes, and ∫φ_iφ_j = δ_ij",
            rerun::on_case("modes", &Cantilever::paper(), "--plot modes.svg"),
        ))
}

/// Tip masses that are drawn.
const MASSES: [f64; 5] = [0.0, 0.1, 0.2, 0.5, 1.0];
/// Range of α4 that is drawn: beyond the samples of section 4 (4.7e-3 to 233.5) on both sides.
const STIFFNESSES: (f64, f64) = (1e-2, 1e3);
/// Number of points of a curve.
const POINTS: usize = 241;

/// Computes the section on Fig. 3: frequencies against tip mass and contact stiffness.
pub(super) fn maps(_: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let failed = |error: CantileverError| PaperError::from(nanotap::model::ModelError::from(error));
    let bare = exact_beam::frequencies(0.0, 0.0, 2).map_err(failed)?;
    let at = |alpha1: f64, alpha4: f64| exact_beam::frequencies(alpha1, alpha4, 2).map_err(failed);
    let mut panels = [1, 2].map(|j| {
        Panel::new(
            Axis::log("contact stiffness $α_4$").range(STIFFNESSES.0, STIFFNESSES.1),
            Axis::linear(format!("$ω_{j}$ / $ω_{{0{j}}}$")),
        )
        .title(if j == 1 {
            "first frequency"
        } else {
            "second frequency"
        })
        .with(Rule::horizontal(1.0))
    });
    let mut ranges = [(f64::INFINITY, f64::NEG_INFINITY); 2];
    for alpha1 in MASSES {
        let mut lines: [Vec<(f64, f64)>; 2] = Default::default();
        for k in 0..POINTS {
            let share = k as f64 / (POINTS - 1) as f64;
            let alpha4 =
                STIFFNESSES.0 * nanotap_arithmetic::powf(STIFFNESSES.1 / STIFFNESSES.0, share);
            for (j, omega) in at(alpha1, alpha4)?.into_iter().enumerate() {
                let ratio = omega / bare[j];
                lines[j].push((alpha4, ratio));
                ranges[j] = (ranges[j].0.min(ratio), ranges[j].1.max(ratio));
            }
        }
        for (panel, line) in panels.iter_mut().zip(lines) {
            *panel = panel
                .clone()
                .with(Line::new(line).label(format!("$α_1$ = {alpha1}")));
        }
    }
    let spread = ranges.map(|(low, high)| high / low);
    let three = ModeTable::new(&Cantilever::paper())
        .map_err(PaperError::failed("the frequencies in contact"))?;
    let paper = at(0.1, 20.0)?;
    let [first, second] = panels;
    Ok(section
        .text(
            "The paper's axes cannot be read from its text. Here α₄ runs from 0.01 to 1000, beyond the ten samples \
             of section 4 on both sides, and α₁ from no tip mass to a tip as heavy as the beam. The frequencies are \
             those of the beam itself, not of a truncated set of modes.",
        )
        .picture(Picture::new(
            "fig03",
            "Natural frequencies in contact against contact stiffness and tip mass (Fig. 3)",
            format!(
                "Each is divided by that of the bare beam, ω₀₁ = {} and ω₀₂ = {}. Exact beam, no damping. The ranges \
                 are chosen here: the paper's axes cannot be read from its text.",
                digits(bare[0], 5),
                digits(bare[1], 5)
            ),
            Figure::new(1, 2).with(first).with(second),
            72.0,
        ))
        .check(
            "fig3-influence",
            spread[0] / spread[1],
            format!(
                "over the ranges drawn, ω₁/ω₀₁ varies by a factor {}, ω₂/ω₀₂ by {}",
                digits(spread[0], 3),
                digits(spread[1], 3)
            ),
            format!(
                "at α₁ = 0.1, α₄ = 20: ω₁/ω₀₁ = {}, ω₂/ω₀₂ = {} (three modes: {}, {})",
                digits(paper[0] / bare[0], 5),
                digits(paper[1] / bare[1], 5),
                digits(three.contact[0] / bare[0], 5),
                digits(three.contact[1] / bare[1], 5)
            ),
            rerun::on_case("modes", &Cantilever::paper().with(Parameter::Alpha4, 20.0), ""),
        ))
}
