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

mod averaged;
mod electronics;
mod feedback;
mod frames;
mod image;
mod instrument;
mod lines;
mod loop_response;
pub mod options;
mod plan;
mod profile;
mod quasi_static;
mod recorder;
pub mod report;
mod run;
mod state_tracker;
mod tapping_period;
mod verdict;

use nanotap_case::physical::Remark;
use nanotap_dynamics::Control;

pub use averaged::{AveragedLine, averaged_line};
pub use instrument::Interaction;
pub use lines::ScanLines;
pub use options::{Method, Mode, ScanOptions};
pub use report::{
    BranchChange, CHANNELS, Cause, Channel, Channels, Direction, ImageCause, LineStatistics,
    ListedPeriod, OffSetpoint, ScanReport,
};

use crate::figure::scan::scan_figure;
use nanotap_case::Case;
use nanotap_error::Error;
use nanotap_figures::Figure;
use nanotap_observe::frame::Frame;
use nanotap_study::Study;
use plan::Plan;
pub use plan::material_cases;
use recorder::LineRecord;
use run::{Recorded, Settled};

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
    const PARTIAL: bool = true;
    const ANY_DISTANCE: bool = true;

    fn frames<'a>(_: &Case, report: &'a ScanReport) -> Vec<Frame<'a>> {
        vec![report.pixel_table(), report.line_table()]
    }

    fn figure(_: &Case, report: &ScanReport) -> Option<Figure> {
        Some(scan_figure(report))
    }

    fn remarks(_: &Case, report: &ScanReport) -> Vec<Remark> {
        Remark::warnings(&report.warnings)
    }

    fn compute(
        case: &Case,
        options: &ScanOptions,
        control: &Control<'_>,
    ) -> Result<ScanReport, Error> {
        let plan = Plan::new(case, options, control)?;
        let settled = Settled::new(&plan, lever_memory(case), control)?;
        let recorded = settled.lines(control)?;
        let header = header(&plan, case, &settled);
        Ok(with_lines(header, recorded, [plan.lines, plan.pixels]))
    }
}

/// Periods in which a disturbance of the lever of a case decays.
fn lever_memory(case: &Case) -> f64 {
    quality_factor(case) / std::f64::consts::PI
}

fn quality_factor(case: &Case) -> f64 {
    let view = case.physical();
    view.map_or(1.0, |view| view.lever.quality_factor)
}

/// The report of a plan before its lines.
fn header(plan: &Plan, case: &Case, settled: &Settled<'_>) -> ScanReport {
    let quality_factor = quality_factor(case);
    let first = (plan.position(0, false), plan.line_position(0));
    let gap = settled.instrument.height() - plan.surface.height(first.0, first.1);
    let gap = gap / plan.length_unit;
    let found = loop_response::loop_report(plan, &settled.instrument, gap, quality_factor);
    let (feedback, loops) =
        found.map_or((None, Vec::new()), |(report, loops)| (Some(report), loops));
    ScanReport {
        method: plan.method,
        mode: plan.mode,
        exact_share: match plan.method {
            Method::Exact | Method::Fast => 1.0,
            Method::QuasiStatic => 0.0,
        },
        size: plan.size,
        periods_per_line: plan.periods,
        total_periods: plan.total_periods(),
        line_rate: plan.line_rate(),
        speed: plan.speed(),
        free_amplitude: plan.free_amplitude,
        setpoint_amplitude: plan.setpoint * plan.free_amplitude,
        z0: plan.z0,
        integral_gain: plan.integral_gain,
        independent_lines: plan.line_settle.is_some(),
        peak_force_max: 0.0,
        periods: Vec::new(),
        lines: Vec::new(),
        trace_retrace_rms: None,
        trace: Channels::default(),
        retrace: plan.retrace.then(Channels::default),
        branch_changes: Vec::new(),
        warnings: warnings(plan, feedback.as_ref(), quality_factor),
        feedback,
        causes: verdict::ringing(plan, &loops),
        verdict: String::new(),
    }
}

/// The report with its lines, of an image of so many lines and pixels.
fn with_lines(header: ScanReport, recorded: Recorded, [lines, pixels]: [usize; 2]) -> ScanReport {
    let mut report = header;
    let image = Channels::missing(lines, pixels);
    report.retrace = report.retrace.map(|_| image.clone());
    report.trace = image;
    let in_lines = recorded.lines.iter().map(|line| line.at_range);
    let at_range = recorded.at_range + in_lines.sum::<usize>();
    for line in recorded.lines {
        let LineRecord {
            statistics, pixels, ..
        } = line;
        let image = match statistics.direction {
            Direction::Trace => Some(&mut report.trace),
            Direction::Retrace => report.retrace.as_mut(),
        };
        if let Some(image) = image {
            image.set_line(statistics.line, pixels);
        }
        report.lines.push(statistics);
    }
    report.trace_retrace_rms = report.retrace.as_ref().map(|retrace| {
        let both = report.trace.height.iter().flatten();
        let both = both.zip(retrace.height.iter().flatten());
        let squares: Vec<f64> = both
            .map(|(a, b)| (a - b) * (a - b))
            .filter(|square| square.is_finite())
            .collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    });
    report.peak_force_max = report
        .lines
        .iter()
        .map(|line| line.peak_force_max)
        .fold(0.0, f64::max);
    report.causes = verdict::causes(&report, &recorded.changes);
    report.verdict = verdict::verdict(&report);
    let traces = report.lines.iter();
    let scanned = traces.filter(|l| l.direction == Direction::Trace).count();
    if scanned < lines {
        let missing = format!("{scanned} of {lines} lines are scanned");
        report.warnings.insert(0, missing);
    }
    if at_range > 0 {
        let remedy = report.feedback.as_ref().map_or_else(String::new, stable);
        report.warnings.push(format!(
            "the z command is at an end of its range in {at_range} drive periods{remedy}"
        ));
    }
    if !recorded.changes.is_empty() {
        report.warnings.push(
            "the lever changes its state permanently: the change of the height there is not one of \
             the surface"
                .into(),
        );
    }
    report.periods = recorded.listed;
    report.branch_changes = recorded.changes;
    report
}

/// The largest stable gain, in words that go on from a warning.
fn stable(feedback: &report::LoopReport) -> String {
    match feedback.largest_stable_gain {
        Some(gain) if gain > 0.0 => format!("; the largest stable integral gain is {gain:.4} 1/s"),
        Some(_) => "; no integral gain makes it stable".to_owned(),
        None => String::new(),
    }
}

/// Reasons to doubt the image that are known before it.
fn warnings(
    plan: &Plan,
    feedback: Option<&report::LoopReport>,
    quality_factor: f64,
) -> Vec<String> {
    let mut warnings = Vec::new();
    if let Some(feedback) = feedback {
        if feedback.spectral_radius >= 1.0 {
            warnings.push(format!(
                "the feedback loop oscillates at the setpoint{}",
                stable(feedback)
            ));
        } else if verdict::is_near_limit(plan.integral_gain, feedback.largest_stable_gain) {
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
    if plan.periods < plan.pixels {
        warnings.push("a line has fewer drive periods than pixels".into());
    } else if (plan.periods as f64) < quality_factor / std::f64::consts::PI * plan.pixels as f64 {
        warnings.push(
            "the lever's memory is longer than a pixel: neighbouring pixels are not independent"
                .into(),
        );
    }
    if plan.names_fast {
        warnings.push(
            "the method `fast` no longer exists: every drive period is computed exactly".into(),
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
