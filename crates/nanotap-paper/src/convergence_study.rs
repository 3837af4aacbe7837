//! Fig. 4: the tip's motion at Ω = 4.1 without damping, with N = 1 … 4 modes, and the continuation
//! to N = 20.

use nanotap_figures::{Axis, Band, Colour, Dash, Figure, Legend, Line, Markers, Panel};
use rayon::prelude::*;

use super::check::digits;
use super::damped_limit::response;
use super::motion_view::View;
use super::runs::Runs;
use super::section::{Picture, Section, Table};
use super::{PaperError, rerun};
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::study::orbit::OrbitReport;

/// Largest number of modes of the study.
const MAX_MODES: usize = 20;
/// Modes in the paper's figure.
const PAPER_MODES: usize = 4;
/// Instants at which two motions are compared.
const INSTANTS: usize = 1000;
/// Drive periods of the run from rest.
const RUN_PERIODS: usize = 30;

struct Response {
    modes: usize,
    orbit: OrbitReport,
    series: Vec<f64>,
}

/// Computes the section on Fig. 4: the number of modes needed at Ω = 4.1.
pub(super) fn section(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let most = runs.either(MAX_MODES, 8);
    let responses: Vec<Response> = (1..=most)
        .into_par_iter()
        .map(|modes| {
            let (model, orbit) = response(&Cantilever::paper_eq24().with_modes(modes))?;
            Ok(Response {
                modes,
                series: tip_series(&model, &orbit),
                orbit,
            })
        })
        .collect::<Result<_, PaperError>>()?;
    let best = &responses[most - 1];
    let to = |r: &Response, other: &Response| {
        difference(&r.series, &other.series) / best.orbit.observables.amplitude
    };
    let mut table = Table::new(
        format!(
            "The periodic response with N modes; largest differences of W over the period, relative to the amplitude with N = {most}"
        ),
        [
            "N",
            "W max",
            "W min",
            "in contact",
            "to N − 1",
            format!("to N = {most}").as_str(),
            "largest ||μ| − 1|",
        ],
    );
    for (i, r) in responses.iter().enumerate() {
        let o = &r.orbit.observables;
        table.row([
            r.modes.to_string(),
            format!("{:.5}", o.tip_max),
            format!("{:.5}", o.tip_min),
            format!("{:.1} %", 100.0 * o.contact_fraction),
            if i == 0 {
                String::new()
            } else {
                format!("{:.2} %", 100.0 * to(r, &responses[i - 1]))
            },
            format!("{:.2} %", 100.0 * to(r, best)),
            digits(off_circle(&r.orbit), 1),
        ]);
    }
    let single = to(&responses[0], &responses[1]);
    let last = to(&responses[2], &responses[3]);
    let off = responses
        .iter()
        .map(|r| off_circle(&r.orbit))
        .fold(0.0, f64::max);
    let contact = responses[2].orbit.observables.contact_fraction;
    let rerun_orbit = |r: &Response| {
        rerun::on_case(
            "orbit",
            &Cantilever::paper_eq24().with_modes(r.modes),
            &format!("--period 1 {}", rerun::state(&r.orbit.state)),
        )
    };
    let enough = responses
        .iter()
        .position(|r| to(r, best) < 0.01)
        .map_or(most, |i| i + 1);
    Ok(section
        .text(
            "Eq. (24) has no damping, so transients do not decay: a run from rest keeps its free vibration, and \
             \"the steady-state motion\" has to be defined. Here it is the limit of the steady state of \
             the damped case (Eq. 26) for vanishing damping, computed by shooting. All its \
             multipliers lie on the unit circle: it is neither stable nor unstable.",
        )
        .picture(overlay(&responses, runs)?)
        .picture(convergence(&responses, &to, most))
        .table(table)
        .check(
            "fig4-steady-state",
            (),
            "without damping there is no attractor; the periodic response exists for every N",
            format!(
                "every multiplier is on the unit circle within {} (N = 1 … {most}), and the run from rest does not \
                 approach the periodic response (Fig. 4, lower panels)",
                digits(off, 1)
            ),
            rerun_orbit(&responses[2]),
        )
        .check(
            "fig4-one-mode",
            single,
            format!("N = 1 and N = 2 differ by {:.0} % of the amplitude", 100.0 * single),
            format!(
                "W reaches {} with N = 1, {} with N = 2, {} with N = 3",
                digits(responses[0].orbit.observables.tip_max, 5),
                digits(responses[1].orbit.observables.tip_max, 5),
                digits(responses[2].orbit.observables.tip_max, 5)
            ),
            rerun_orbit(&responses[0]),
        )
        .check(
            "fig4-convergence",
            last,
            format!("N = 3 and N = 4 differ by {:.1} % of the amplitude", 100.0 * last),
            format!(
                "N = {enough} is within 1 % of N = {most}; further convergence is slow, because a point mass and a \
                 point force excite every mode"
            ),
            rerun_orbit(&responses[3]),
        )
        .check(
            "fig4-contact-time",
            contact,
            format!("{:.1} % of the period (N = 3)", 100.0 * contact),
            "from the exact instants of contact of the periodic response",
            rerun_orbit(&responses[2]),
        ))
}

/// Largest distance of a multiplier from the unit circle.
fn off_circle(orbit: &OrbitReport) -> f64 {
    orbit
        .multipliers
        .iter()
        .map(|[re, im]| (nanotap_arithmetic::hypot(*re, *im) - 1.0).abs())
        .fold(0.0, f64::max)
}

fn tip_series(model: &Model, orbit: &OrbitReport) -> Vec<f64> {
    let tip = orbit.trajectory.curve(&model.tip);
    let end = orbit.trajectory.end();
    (0..INSTANTS)
        .filter_map(|k| tip.at(end * k as f64 / INSTANTS as f64))
        .collect()
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

fn overlay(responses: &[Response], runs: &Runs<'_>) -> Result<Picture, PaperError> {
    let time = || Axis::linear("time $τ / T$ (drive periods)").tight();
    let tip = || Axis::linear("tip deflection $W$");
    let mut periodic = Panel::new(time(), tip())
        .title("periodic response, by shooting")
        .legend(Legend::Above);
    let mut from_rest = Panel::new(time(), tip())
        .title("run from rest")
        .legend(Legend::Hidden);
    let dashes = [Dash::Dotted, Dash::DashDot, Dash::Dashed, Dash::Solid];
    let colours = [
        Colour::VERMILLION,
        Colour::GREEN,
        Colour::BLUE,
        Colour::BLACK,
    ];
    let shown = PAPER_MODES.min(responses.len());
    for (i, r) in responses.iter().take(shown).enumerate() {
        let model = Model::cantilever(&Cantilever::paper_eq24().with_modes(r.modes))?;
        let view = View::new(&model, &r.orbit.state, 2)?;
        if i + 1 == shown {
            periodic =
                periodic.with(Band::x(view.contacts()).label(format!("contact, N = {}", r.modes)));
        }
        let style = |line: Line| {
            line.dash(dashes[i])
                .colour(colours[i])
                .label(format!("N = {}", r.modes))
        };
        periodic = periodic.with(style(view.tip_line()));
        let rest = View::new(
            &model,
            &vec![0.0; model.dimension()],
            runs.either(RUN_PERIODS, 8),
        )?;
        from_rest = from_rest.with(style(rest.tip_line()));
    }
    Ok(Picture::new(
        "fig04",
        "Tip motion at Ω = 4.1 with one to four modes, without damping (Fig. 4)",
        "Eq. (24): α₁ = α₂ = 0.1, α₃ = α₅ = α₆ = 0, α₄ = 20. Without damping there is no attractor. (a) The periodic \
         response, two periods: the limit of the damped steady state as damping vanishes; multipliers on the unit \
         circle. (b) A run from rest, which keeps its free vibration; colours as in (a).",
        Figure::new(2, 1).with(periodic).with(from_rest),
        120.0,
    ))
}

fn convergence(
    responses: &[Response],
    to: &dyn Fn(&Response, &Response) -> f64,
    most: usize,
) -> Picture {
    let best = &responses[most - 1];
    let all: Vec<(f64, f64)> = responses[..most - 1]
        .iter()
        .map(|r| (r.modes as f64, to(r, best)))
        .filter(|p| p.1 > 0.0)
        .collect();
    let steps: Vec<(f64, f64)> = responses
        .windows(2)
        .map(|w| (w[1].modes as f64, to(&w[1], &w[0])))
        .filter(|p| p.1 > 0.0)
        .collect();
    let marks = (1..=most)
        .filter(|n| *n == 1 || n % 5 == 0 || *n < 5)
        .map(|n| (n as f64, n.to_string()));
    let panel = Panel::new(
        Axis::linear("modes $N$")
            .range(0.5, most as f64 + 0.5)
            .marks(marks),
        Axis::log("largest difference of $W$ / amplitude"),
    )
    .with(Line::new(all.clone()).colour(Colour::BLUE).width(0.6))
    .with(
        Markers::new(all)
            .colour(Colour::BLUE)
            .label(format!("to N = {most}")),
    )
    .with(
        Line::new(steps.clone())
            .colour(Colour::VERMILLION)
            .width(0.6),
    )
    .with(
        Markers::new(steps)
            .colour(Colour::VERMILLION)
            .open()
            .label("to N − 1"),
    );
    Picture::new(
        "fig04-convergence",
        "Fig. 4 continued: the periodic response with more modes",
        format!(
            "Largest difference of the tip deflection over the period between N modes and {most} (filled) or one mode \
             fewer (open), relative to the amplitude. Same case as Fig. 4."
        ),
        Figure::single(panel),
        70.0,
    )
}
