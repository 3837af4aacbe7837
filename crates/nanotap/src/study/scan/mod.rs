//! A scan: the lever taps while the sample moves under it, with the z feedback of an instrument.
//!
//! Each drive period is computed exactly at the distance that the feedback has set, and lock-in
//! amplifier, controller and scanner are updated once a period. Periods run from drive phase 180°
//! to 540°, so that the tip is far from the sample where the distance changes. The order of
//! operations in period `k`, with the z command `u`, surface `h`, setpoint `r A₀`:
//!
//! 1. `z_k` is the position of the scanner after a period under `u_k`;
//! 2. the lever runs a period at distance `z_k − h(x_k)`; `W_k` is the component of its deflection
//!    at the drive's frequency;
//! 3. the lock-in amplifier follows `W_k`; the error is `e_k = |y_k| − r A₀`;
//! 4. the controller sets `u_{k+1} = z₀ − (Kp e + s)` with `s` the sum of `Ki T e`, `d` periods
//!    late, within slew rate and range; `s` stays where the command is limited.

mod feedback;
mod image;
mod instrument;
mod lever;
mod loop_response;
pub mod options;
mod plan;
mod profile;
mod quasi_static;
mod recorder;
pub mod report;
mod run;
mod table;

use nanotap_dynamics::Control;

pub use instrument::Interaction;
pub use options::{Method, Mode, ScanOptions};
pub use report::{Channels, Direction, LineStatistics, ListedPeriod, ScanReport};
pub use table::{CHANNELS, Channel, pixels_csv};

use crate::Error;
use crate::case::Case;
use crate::study::Study;
use plan::Plan;
use recorder::LineRecord;
use run::{Recorded, run};

/// A scan under feedback.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::case::physical::Catalogue;
/// use nanotap::control::Control;
/// use nanotap::study::Study as _;
/// use nanotap::study::scan::{ScanOptions, ScanStudy};
/// use std::path::Path;
///
/// let file = Path::new("../../docs/cases/scan-step.toml");
/// let case = Case::load(Some(file), &[], &Catalogue::shared())?;
/// let report = ScanStudy::run(&case, &ScanOptions::default(), &Control::default())?;
/// // Behind the plateau the tip flies for 367 drive periods (docs/cases/scan.md).
/// assert_eq!(report.lines[0].parachuting[0].periods, 367);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ScanStudy;

impl Study for ScanStudy {
    const NAME: &'static str = "scan";
    const ABOUT: &'static str = "Scan of a line or an image under feedback, drive period by period";
    type Options = ScanOptions;
    type Report = ScanReport;

    const COUNTED: &'static str = "drive periods";
    const ANY_DISTANCE: bool = true;

    fn compute(
        case: &Case,
        options: &ScanOptions,
        control: &Control<'_>,
    ) -> Result<ScanReport, Error> {
        let plan = Plan::new(case, options, control)?;
        let quality_factor = case
            .physical()
            .map_or(1.0, |view| view.lever.quality_factor);
        let memory = quality_factor / std::f64::consts::PI;
        let (recorded, settled) = run(&plan, memory, control)?;
        let gap = plan.z0 / plan.length_unit;
        let gap = recorded.lines.first().map_or(gap, |line| {
            let first = line.pixels.height.first().copied().unwrap_or(plan.z0);
            let surface = plan
                .surface
                .height(plan.position(0, false), line.statistics.y);
            (first - surface) / plan.length_unit
        });
        let feedback = loop_response::loop_report(&plan, &settled, gap, quality_factor)?;
        Ok(report(&plan, recorded, feedback, quality_factor))
    }
}

fn report(
    plan: &Plan,
    recorded: Recorded,
    feedback: Option<report::LoopReport>,
    quality_factor: f64,
) -> ScanReport {
    let directions = 1 + usize::from(plan.retrace);
    let per_line = plan.periods * directions + plan.line_settle.unwrap_or(0);
    let total_periods = plan.settle + plan.lines * per_line;
    let comparison = recorded.comparison.report();
    let exact_share = match (plan.method, comparison) {
        (Method::QuasiStatic, _) => 0.0,
        (Method::Fast, Some(error)) => error.periods as f64 / total_periods as f64,
        // A piecewise-linear sample is exact by either method.
        _ => 1.0,
    };
    let mut warnings = warnings(plan, &recorded, feedback.as_ref(), quality_factor);
    let (mut trace, mut retrace) = (Channels::default(), Channels::default());
    let mut lines = Vec::new();
    for LineRecord { statistics, pixels } in recorded.lines {
        let image = match statistics.direction {
            Direction::Trace => &mut trace,
            Direction::Retrace => &mut retrace,
        };
        image.surface.push(pixels.surface);
        image.height.push(pixels.height);
        image.amplitude_error.push(pixels.amplitude_error);
        image.phase.push(pixels.phase);
        image.peak_force.push(pixels.peak_force);
        image.peak_force_max.push(pixels.peak_force_max);
        image.dissipation.push(pixels.dissipation);
        image.contact_fraction.push(pixels.contact_fraction);
        image.mean_deflection.push(pixels.mean_deflection);
        image.state.push(pixels.state);
        lines.push(statistics);
    }
    let retrace = plan.retrace.then_some(retrace);
    let trace_retrace_rms = retrace.as_ref().map(|retrace| {
        let both = trace.height.iter().flatten();
        let both = both.zip(retrace.height.iter().flatten());
        let squares: Vec<f64> = both
            .map(|(a, b)| (a - b) * (a - b))
            .filter(|square| square.is_finite())
            .collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    });
    let verdict = verdict(plan, &lines, &recorded.changes);
    if !recorded.changes.is_empty() {
        warnings.push(
            "the motion jumps onto another branch: a change of the height there is not one of \
             the surface"
                .into(),
        );
    }
    ScanReport {
        method: plan.method,
        mode: plan.mode,
        exact_share,
        error: comparison,
        size: plan.size,
        periods_per_line: plan.periods,
        total_periods,
        line_rate: plan.line_rate(),
        speed: plan.speed(),
        free_amplitude: plan.free_amplitude,
        setpoint_amplitude: plan.setpoint * plan.free_amplitude,
        z0: plan.z0,
        integral_gain: plan.integral_gain,
        independent_lines: plan.line_settle.is_some(),
        peak_force_max: lines.iter().map(|l| l.peak_force_max).fold(0.0, f64::max),
        periods: recorded.listed,
        lines,
        trace_retrace_rms,
        trace,
        retrace,
        branch_changes: recorded.changes,
        feedback,
        warnings,
        verdict,
    }
}

/// Largest part of the largest stable gain at which a loop does not hunt after large errors.
const HUNTING: f64 = 0.7;

fn warnings(
    plan: &Plan,
    recorded: &Recorded,
    feedback: Option<&report::LoopReport>,
    quality_factor: f64,
) -> Vec<String> {
    let mut warnings = Vec::new();
    let stable = |feedback: &report::LoopReport| match feedback.largest_stable_gain {
        Some(gain) if gain > 0.0 => format!("; the largest stable integral gain is {gain:.4} 1/s"),
        Some(_) => "; no integral gain makes it stable".to_owned(),
        None => String::new(),
    };
    if let Some(feedback) = feedback {
        if feedback.spectral_radius >= 1.0 {
            warnings.push(format!(
                "the feedback loop oscillates at the setpoint{}",
                stable(feedback)
            ));
        } else if feedback
            .largest_stable_gain
            .is_some_and(|largest| plan.integral_gain > HUNTING * largest)
        {
            warnings.push(format!(
                "the feedback loop may hunt after large errors: its gain is near the limit{}",
                stable(feedback)
            ));
        }
    }
    if feedback.is_none() && plan.mode == Mode::ConstantAmplitude {
        warnings.push(
            "no steady motion with the setpoint amplitude was found: the stability of the feedback \
             loop is not known"
                .into(),
        );
    }
    if recorded.at_range > 0 {
        let remedy = feedback.map_or_else(String::new, stable);
        warnings.push(format!(
            "the z command is at an end of its range in {} drive periods{remedy}",
            recorded.at_range
        ));
    }
    if plan.periods < plan.pixels {
        warnings.push("a line has fewer drive periods than pixels".into());
    } else if (plan.periods as f64) < quality_factor / std::f64::consts::PI * plan.pixels as f64 {
        warnings.push(
            "the lever's memory is longer than a pixel: neighbouring pixels are not independent"
                .into(),
        );
    }
    if plan.method == Method::QuasiStatic {
        warnings.push("a preview: the lever is steady in every drive period".into());
    }
    if plan.line_settle.is_some() {
        warnings.push(
            "each line settled anew at its start: the state of the line before is not carried on"
                .into(),
        );
    }
    warnings
}

/// What the image shows, in a sentence.
fn verdict(plan: &Plan, lines: &[LineStatistics], changes: &[report::BranchChange]) -> String {
    let nm = |length: f64| format!("{:.3} nm", 1e9 * length);
    let largest = changes
        .iter()
        .max_by(|a, b| a.height_change.abs().total_cmp(&b.height_change.abs()));
    if let Some(change) = largest {
        let word = |interaction| match interaction {
            Interaction::Attractive => "attractive",
            _ => "repulsive",
        };
        return format!(
            "At x = {} the lever jumps from the {} to the {} state, and the height changes by {} \
             that are not the surface's.",
            nm(change.x),
            word(change.from),
            word(change.to),
            nm(change.height_change)
        );
    }
    let flights = lines.iter().flat_map(|line| &line.parachuting);
    let longest = flights.max_by(|a, b| a.length.total_cmp(&b.length));
    if let Some(flight) = longest {
        return format!(
            "The tip flies above the surface over up to {} of a line: there the height is that of \
             the flight.",
            nm(flight.length)
        );
    }
    let worst = lines.iter().map(|l| l.tracking_rms).fold(0.0, f64::max);
    match plan.mode {
        Mode::ConstantAmplitude => format!(
            "The height follows the surface to {} (root mean square of a line).",
            nm(worst)
        ),
        Mode::ConstantHeight => format!(
            "The height is constant; the amplitude error shows the surface, to {} at most.",
            nm(lines
                .iter()
                .map(|l| l.error_max.abs().max(l.error_min.abs()))
                .fold(0.0, f64::max))
        ),
    }
}
