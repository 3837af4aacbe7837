//! Why an image shows something that is not the surface's, from computed states.
//!
//! Three causes are kept apart. The loop rings where its multipliers reach 1, or near the gain at
//! which they do. The state changes where the lever stays at the setpoint in another state. The
//! feedback lags where the amplitude is off the setpoint while the surface moves.

use super::instrument::Interaction;
use super::loop_response::LoopStability;
use super::options::Mode;
use super::plan::Plan;
use super::report::{
    BranchChange, Cause, Direction, ImageCause, LineStatistics, OffSetpoint, ScanReport,
};
use nanotap_case::physical::Kind;

/// Largest part of the largest stable gain at which a loop does not hunt after large errors.
const HUNTING: f64 = 0.7;
/// Part of the variation of a surface that a line does not follow where the feedback lags.
const LAGGING: f64 = 0.5;

/// A length with three significant digits.
/// Height in m below which a difference is rounding.
const ROUNDING: f64 = 1e-15;

fn length(value: f64) -> String {
    Kind::Length.format_digits(value, 3)
}

fn number(value: f64) -> String {
    Kind::Number.format_digits(value, 3)
}

/// The loops that ring: those that oscillate, or that which is nearest to it.
pub(super) fn ringing(plan: &Plan, loops: &[LoopStability]) -> Vec<ImageCause> {
    let oscillating: Vec<ImageCause> = loops
        .iter()
        .filter(|found| found.spectral_radius >= 1.0)
        .map(|found| {
            let what = format!(
                "the feedback loop oscillates at the setpoint (largest multiplier {})",
                Kind::Number.format(found.spectral_radius)
            );
            ringing_loop(plan, found, &what)
        })
        .collect();
    if !oscillating.is_empty() {
        return oscillating;
    }
    let hunts = |of: &&LoopStability| is_near_limit(plan.integral_gain, of.largest_stable_gain);
    let worst = loops
        .iter()
        .filter(hunts)
        .max_by(|a, b| a.spectral_radius.total_cmp(&b.spectral_radius));
    let what = "the feedback loop is near its limit of stability and may ring after large errors";
    worst
        .map(|found| ringing_loop(plan, found, what))
        .into_iter()
        .collect()
}

/// Whether a stable loop with this integral gain may hunt after large errors.
pub(super) fn is_near_limit(gain: f64, largest_stable_gain: Option<f64>) -> bool {
    largest_stable_gain.is_some_and(|largest| gain > HUNTING * largest)
}

fn ringing_loop(plan: &Plan, found: &LoopStability, what: &str) -> ImageCause {
    let segment = plan
        .segments
        .iter()
        .find(|segment| segment.2 == found.material);
    let place = segment.map(|(from, to, _)| [*from, *to]);
    let subject = match place {
        Some([from, to]) => format!(
            "Above the sample from x = {} to {} {what}",
            length(from),
            length(to)
        ),
        None => capitalised(what),
    };
    let limit = match found.largest_stable_gain {
        Some(most) if most > 0.0 => {
            format!("the largest stable integral gain is {} 1/s", number(most))
        }
        _ => "no integral gain makes it stable".to_owned(),
    };
    ImageCause {
        cause: Cause::LoopRings,
        line: None,
        direction: None,
        k: None,
        x: place.map(|[from, _]| from),
        until_k: None,
        until_x: place.map(|[_, to]| to),
        height: None,
        material: Some(found.material),
        multiplier: Some(found.spectral_radius),
        sentence: format!(
            "{subject}, and the height with it: its integral gain is {} 1/s, and {limit}.",
            number(plan.integral_gain)
        ),
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters
        .next()
        .map(|letter| letter.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

/// Returns all causes, that of the loop known before the lines first.
pub(super) fn causes(report: &ScanReport, changes: &[BranchChange]) -> Vec<ImageCause> {
    let mut causes = report.causes.clone();
    // Above a material where the loop oscillates the errors are those of the oscillation; where it
    // hunts, those that no motion of the surface explains.
    let rings: Vec<(usize, bool)> = causes
        .iter()
        .filter_map(|cause| Some((cause.material?, cause.multiplier? >= 1.0)))
        .collect();
    let of_the_loop = |off: &OffSetpoint| {
        let ring = rings.iter().find(|(material, _)| *material == off.material);
        ring.is_some_and(|(_, oscillates)| *oscillates || !off.moved)
    };
    let stretches = || {
        let all = report.lines.iter();
        all.flat_map(|line| line.off_setpoint.iter().map(move |off| (line, off)))
    };
    for cause in &mut causes {
        let own = stretches().map(|(_, off)| off);
        let own = own.filter(|off| of_the_loop(off) && cause.material == Some(off.material));
        cause.height = own
            .filter_map(|off| off.height)
            .max_by(|a, b| a.abs().total_cmp(&b.abs()));
    }
    // Of equal ones the first.
    let largest = changes
        .iter()
        .rev()
        .max_by(|a, b| a.height_change.abs().total_cmp(&b.height_change.abs()));
    causes.extend(largest.map(|change| state_change(report, change, changes.len())));
    for flies in [true, false] {
        let largest = stretches()
            .filter(|(_, off)| !of_the_loop(off) && (off.error > 0.0) == flies)
            .rev()
            .max_by(|(_, a), (_, b)| a.size().total_cmp(&b.size()));
        causes.extend(largest.map(|(line, off)| lag(report, line, off)));
    }
    if causes.is_empty() {
        causes.extend(slow(report));
    }
    causes
}

/// Where something happens: the position, with line and direction.
fn place(report: &ScanReport, line: usize, direction: Direction) -> String {
    let direction = match direction {
        Direction::Trace => "trace",
        Direction::Retrace => "retrace",
    };
    if report.trace.height.len() > 1 {
        format!("of the {direction} of line {line}")
    } else {
        format!("of the {direction}")
    }
}

fn state_change(report: &ScanReport, change: &BranchChange, count: usize) -> ImageCause {
    let word = |interaction| match interaction {
        Interaction::Attractive => "attractive",
        _ => "repulsive",
    };
    let (from, to) = (word(change.from), word(change.to));
    let stays = match change.until_x {
        Some(x) => format!("stays in it until x = {}", length(x)),
        None if report.independent_lines => "stays in it to the end of the line".to_owned(),
        None => "stays in it to the end of the scan".to_owned(),
    };
    let side = if change.height_change < 0.0 {
        "lower"
    } else {
        "higher"
    };
    let sample = match change.material {
        Some(_) => "",
        None => ", each above its own sample",
    };
    let more = match count {
        1 => String::new(),
        _ => format!(" It is the largest of {count} such changes."),
    };
    let sentence = format!(
        "At x = {} {} the lever changes from the {from} to the {to} state and {stays}. At the setpoint \
         its distance is {} in the {to} state and {} in the {from} state{sample}: the height is {} \
         {side}, and this is not the surface's.{more}",
        length(change.x),
        place(report, change.line, change.direction),
        length(change.distance_to),
        length(change.distance_from),
        length(change.height_change.abs()),
    );
    ImageCause {
        cause: Cause::StateChange,
        line: Some(change.line),
        direction: Some(change.direction),
        k: Some(change.k),
        x: Some(change.x),
        until_k: change.until_k,
        until_x: change.until_x,
        height: Some(change.height_change),
        material: change.material,
        multiplier: None,
        sentence,
    }
}

fn lag(report: &ScanReport, line: &LineStatistics, off: &OffSetpoint) -> ImageCause {
    let (what, side) = if off.error > 0.0 {
        ("above the setpoint, the tip flies (parachuting)", "above")
    } else {
        ("below the setpoint, the tip presses on the sample", "below")
    };
    let height = match off.height {
        Some(height) if (height > 0.0) == (off.error > 0.0) => format!(
            ", and the height is up to {} {side} that of the surface",
            length(height.abs())
        ),
        _ => String::new(),
    };
    let sentence = format!(
        "From x = {} to {} {} the feedback lags: the amplitude is up to {} {what}{height}.",
        length(off.x),
        length(off.until_x),
        place(report, line.line, line.direction),
        length(off.error.abs()),
    );
    ImageCause {
        cause: Cause::FeedbackLags,
        line: Some(line.line),
        direction: Some(line.direction),
        k: Some(off.first_period),
        x: Some(off.x),
        until_k: Some(off.first_period + off.periods - 1),
        until_x: Some(off.until_x),
        height: off.height,
        material: Some(off.material),
        multiplier: None,
        sentence,
    }
}

/// The line on which the feedback lags behind a surface of little height: the amplitude stays near the
/// setpoint, but its error varies as much as the surface does.
fn slow(report: &ScanReport) -> Option<ImageCause> {
    let slope = report.feedback.as_ref()?.slope.abs();
    let part = |line: &LineStatistics| line.error_rms / (slope * line.surface_rms);
    let lagging = |line: &&LineStatistics| line.surface_rms > 0.0 && part(line) > LAGGING;
    let worst = report
        .lines
        .iter()
        .filter(lagging)
        .max_by(|a, b| part(a).total_cmp(&part(b)))?;
    let sentence = format!(
        "The feedback lags {}: the height follows the surface to {}, and the surface itself varies by {} \
         (root mean squares of a line).",
        place(report, worst.line, worst.direction).replacen("of", "on", 1),
        length(worst.tracking_rms),
        length(worst.surface_rms),
    );
    Some(ImageCause {
        cause: Cause::FeedbackLags,
        line: Some(worst.line),
        direction: Some(worst.direction),
        k: Some(worst.first_period),
        x: None,
        until_k: None,
        until_x: None,
        height: Some(worst.tracking_rms),
        material: None,
        multiplier: None,
        sentence,
    })
}

/// Returns what the image shows, in sentences: those of the causes.
pub(super) fn verdict(report: &ScanReport) -> String {
    if !report.causes.is_empty() {
        let sentences: Vec<&str> = report
            .causes
            .iter()
            .map(|cause| cause.sentence.as_str())
            .collect();
        return sentences.join(" ");
    }
    let largest = |of: fn(&LineStatistics) -> f64| report.lines.iter().map(of).fold(0.0, f64::max);
    match report.mode {
        Mode::ConstantAmplitude => {
            let off = largest(|line| line.tracking_rms);
            let within = if off < ROUNDING {
                format!("less than {}", length(ROUNDING))
            } else {
                length(off)
            };
            format!("The height follows the surface to {within} (root mean square of a line).")
        }
        Mode::ConstantHeight => format!(
            "The height is constant; the amplitude error shows the surface, to {} at most.",
            length(largest(|line| line
                .error_max
                .abs()
                .max(line.error_min.abs())))
        ),
    }
}
