//! The readout of a motion: a few numbers, and a sentence on its regime.

use nanotap::case::Case;
use nanotap::case::quantity::Kind;
use nanotap::observe::table::shown_phase;
use nanotap::observe::{Observable, Observables};
use serde_json::{Value, json};

use crate::motion::shown;

/// The observables in the readout, with their names there.
const READ: [(&str, &str); 6] = [
    ("first_harmonic", "amplitude A"),
    ("phase", "phase lag"),
    ("peak_force", "peak force"),
    ("indentation", "indentation"),
    ("contact_time", "contact time per period"),
    ("dissipation", "energy lost per period"),
];
/// Smallest difference of phases, in degrees, that is reported.
const SAME_PHASE: f64 = 0.5;

/// Computes the readout as JSON: the values of the observables, the regime and the sentence.
pub(crate) fn readout(case: &Case, observables: &Observables) -> Value {
    let line = |(name, words): &(&str, &str)| {
        let observable = Observable::named(name)?;
        Some(
            json!({ "name": name, "words": words, "shown": shown(case, observable, observables)? }),
        )
    };
    let mut lines: Vec<Value> = READ.iter().filter_map(line).collect();
    let ratio = ratio(case, observables);
    if let Some(ratio) = ratio {
        let text = Kind::Number.format_digits(ratio, 4);
        lines.insert(
            1,
            json!({ "name": "ratio", "words": "setpoint A/A₀", "shown": text }),
        );
    }
    json!({
        "lines": lines,
        "ratio": ratio.map(|ratio| Kind::Number.format_digits(ratio, 4)),
        "regime": regime(observables),
        "words": words(case, observables),
    })
}

/// Amplitude as a fraction of the free amplitude; `None` for a case without physical units, or
/// without a free amplitude.
fn ratio(case: &Case, observables: &Observables) -> Option<f64> {
    let free = case.physical()?.free_amplitude;
    let length = case.physical()?.scales.length;
    (free > 0.0).then(|| observables.first_harmonic * length / free)
}

/// The regime, in a word.
pub(crate) fn regime(observables: &Observables) -> &'static str {
    match observables.mean_force {
        0.0 => "free",
        force if force < 0.0 => "attractive",
        _ => "repulsive",
    }
}

/// The regime, and what the phase says.
fn words(case: &Case, observables: &Observables) -> String {
    let mean = match regime(observables) {
        "free" => return "The tip does not feel the sample.".to_owned(),
        "attractive" => "On average the sample attracts the tip.",
        _ => "On average the sample repels the tip.",
    };
    let Some(view) = case.physical() else {
        return mean.to_owned();
    };
    let more = shown_phase(observables.phase) - view.free_phase;
    let degrees = Kind::Number.format_digits(more.abs(), 3);
    let phase = if more.abs() < SAME_PHASE {
        "The phase is that of the free lever.".to_owned()
    } else if more > 0.0 {
        format!(
            "The phase lags {degrees}° more than far away, as if the sample lowered the resonance."
        )
    } else {
        format!(
            "The phase lags {degrees}° less than far away, as if the sample raised the resonance."
        )
    };
    format!("{mean} {phase}")
}
