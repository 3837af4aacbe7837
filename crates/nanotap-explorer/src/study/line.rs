//! A line under feedback as numbers: by averaging for a knob that moves, exactly for one that rests.

use nanotap::case::quantity::Kind;
use nanotap::study::request::read;
use nanotap::study::scan::{
    AveragedLine, Cause, Channels, Direction, LineStatistics, ScanOptions, ScanReport, ScanStudy,
    averaged_line,
};
use serde_json::{Value, json};

use super::image::verdict;
use super::{Stage, Studied};
use crate::api_error::ApiError;
use crate::forms;

impl Studied<'_> {
    /// The channels of a line over the surface of the form: by averaging if the request is a quick one,
    /// else exactly. A case that is no lever has no line.
    pub(super) fn line(&self) -> Result<(), ApiError> {
        let case = self.request.case.any_distance(self.app)?;
        let form = forms::line(&case);
        if form.is_empty() {
            (self.hand_over)(json!({ "form": form }));
            return Ok(());
        }
        let mut request = self.request.clone();
        for field in &form {
            let name = field["name"].as_str().unwrap_or_default();
            if self.field(name).is_err() && field["value"] != "" {
                request
                    .options
                    .insert(name.to_owned(), field["value"].clone());
            }
        }
        let filled = Studied {
            request: &request,
            ..*self
        };
        let options = filled.scan_options();
        let surface = filled.surface()?;
        let mut computed = options.clone();
        computed.extend(surface.clone().unwrap_or_default());
        if request.quick {
            let options: ScanOptions = read(Value::Object(computed))?;
            let line = averaged_line(&case, &options, self.control)?;
            let line = line.as_ref().map(averaged);
            (self.hand_over)(json!({ "form": form, "line": line }));
            return Ok(());
        }
        let scanned = self.counting("drive periods", |control| {
            Studied { control, ..filled }.report::<ScanStudy>(&case, &computed)
        })?;
        let mut line = exact(&scanned);
        line["form"] = json!(form);
        filled.hand(Stage {
            line: Some(line),
            words: verdict(&scanned),
            studies: &[("scan", &options)],
            scan: Self::scan_table(&case, surface),
            ..Stage::default()
        })
    }
}

fn length(value: f64) -> Value {
    json!({ "value": value, "shown": Kind::Length.format_digits(value, 3) })
}

/// What both methods know of a line.
struct LineNumbers<'a> {
    size: f64,
    line_rate: f64,
    periods: usize,
    free: f64,
    setpoint: f64,
    gain: f64,
    lines: &'a [LineStatistics],
    trace: &'a Channels,
    retrace: Option<&'a Channels>,
}

fn averaged(line: &AveragedLine) -> Value {
    numbers(&LineNumbers {
        size: line.size,
        line_rate: line.line_rate,
        periods: line.periods_per_line,
        free: line.free_amplitude,
        setpoint: line.setpoint_amplitude,
        gain: line.integral_gain,
        lines: &line.lines,
        trace: &line.trace,
        retrace: line.retrace.as_ref(),
    })
}

fn exact(report: &ScanReport) -> Value {
    let mut line = numbers(&LineNumbers {
        size: report.size[0],
        line_rate: report.line_rate,
        periods: report.periods_per_line,
        free: report.free_amplitude,
        setpoint: report.setpoint_amplitude,
        gain: report.integral_gain,
        lines: &report.lines,
        trace: &report.trace,
        retrace: report.retrace.as_ref(),
    });
    line["exact"] = json!(true);
    line["changes"] = report
        .branch_changes
        .iter()
        .map(|change| {
            json!({
                "direction": change.direction, "from": change.from, "to": change.to,
                "x": length(change.x), "height": length(change.height_change.abs()),
                "change": change.height_change,
            })
        })
        .collect();
    line["loop"] = json!(report.feedback.as_ref().map(|feedback| json!({
        "largest_gain": feedback.largest_stable_gain,
        "shown": feedback.largest_stable_gain.map(|gain| Kind::Number.format_digits(gain, 3)),
        "multiplier": feedback.spectral_radius,
    })));
    let rings = report.causes.iter().find(|c| c.cause == Cause::LoopRings);
    line["rings"] = json!(rings.map(|cause| json!({
        "multiplier": cause.multiplier, "sentence": cause.sentence,
    })));
    let lags = report.causes.iter();
    let mut lags = lags.filter(|cause| cause.cause == Cause::FeedbackLags);
    line["lagging"] = json!(lags.clone().any(|cause| cause.x.is_some()));
    let slow = lags.find(|cause| cause.x.is_none());
    line["slow"] = json!(slow.map(|cause| cause.sentence.as_str()));
    line["warnings"] = json!(report.warnings);
    line
}

fn numbers(line: &LineNumbers<'_>) -> Value {
    let count = line.trace.height.first().map_or(0, Vec::len);
    let step = line.size / count.max(1) as f64;
    let x: Vec<f64> = (0..count).map(|k| (k as f64 + 0.5) * step).collect();
    let largest = |of: fn(&LineStatistics) -> f64| line.lines.iter().map(of).fold(0.0, f64::max);
    let force = largest(|line| line.peak_force_max);
    json!({
        "x": x,
        "size": length(line.size),
        "line_rate": { "value": line.line_rate, "shown": Kind::Frequency.format_digits(line.line_rate, 3) },
        "free": length(line.free),
        "setpoint": length(line.setpoint),
        "gain": { "value": line.gain, "shown": Kind::Number.format_digits(line.gain, 3) },
        "time": Kind::Time.format_digits(0.5 / line.line_rate, 3),
        "trace": direction(line, line.trace),
        "retrace": line.retrace.map(|retrace| direction(line, retrace)),
        "force": { "value": force, "shown": Kind::Force.format_digits(force, 3) },
        "tracking": length(largest(|line| line.tracking_rms)),
        "lags": line.lines.iter().map(|one| lag(line, one)).collect::<Vec<Value>>(),
    })
}

/// The channels of a direction, in SI: the band is what the deflection fills.
fn direction(line: &LineNumbers<'_>, of: &Channels) -> Value {
    let amplitude: Vec<f64> = of.amplitude_error[0]
        .iter()
        .map(|error| error + line.setpoint)
        .collect();
    let band = |sign: f64| -> Vec<f64> {
        let both = of.mean_deflection[0].iter().zip(&amplitude);
        both.map(|(mean, amplitude)| mean + sign * amplitude)
            .collect()
    };
    json!({
        "surface": of.surface[0],
        "height": of.height[0],
        "phase": of.phase[0],
        "force": of.peak_force_max[0],
        "state": of.state[0],
        "low": band(-1.0),
        "high": band(1.0),
        "amplitude": amplitude,
    })
}

/// Where the amplitude is off the setpoint in a direction, and whether it stays so to the end of the
/// line, far above the surface.
fn lag(line: &LineNumbers<'_>, of: &LineStatistics) -> Value {
    let periods: usize = of.off_setpoint.iter().map(|off| off.periods).sum();
    let end = of.first_period + line.periods;
    let lost = of
        .off_setpoint
        .iter()
        .find(|off| off.error > 0.0 && off.first_period + off.periods == end);
    let largest = of
        .off_setpoint
        .iter()
        .max_by(|a, b| a.error.abs().total_cmp(&b.error.abs()));
    json!({
        "direction": of.direction,
        "retrace": of.direction == Direction::Retrace,
        "share": periods as f64 / line.periods.max(1) as f64,
        "lost": lost.map(|off| length(off.x)),
        "largest": largest.map(|off| json!({
            "x": length(off.x),
            "until": length(off.until_x),
            "error": length(off.error.abs()),
            "flies": off.error > 0.0,
            "height": off.height.map(|height| length(height.abs())),
        })),
    })
}
