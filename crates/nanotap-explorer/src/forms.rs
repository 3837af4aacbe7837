//! The forms of the studies: their fields and initial values.

use nanotap::case::quantity::Kind;
use nanotap::case::{Case, Key};
use nanotap::model::Model;
use nanotap::observe::time_series::state_names;
use nanotap::study::start_box::default_box;
use serde_json::{Value, json};

use crate::knobs;
use crate::maps::Shows;

/// The choice of a field that sets no condition.
pub(crate) const ANY: &str = "any";
/// The choice of a field that excludes a second motion.
pub(crate) const ONE_STATE: &str = "no second one";
/// Peak force that an ordinary polymer survives.
const GENTLE: &str = "1 nN";

/// The fields of the forms with their initial values.
pub(crate) fn forms(case: &Case, base: &Case, model: &Model) -> Value {
    let keys: Vec<Key> = knobs::keys(case)
        .filter(|key| key.cannot_vary().is_none() && case.get(*key).is_finite())
        .filter(|key| !case.is_physical() || key.is_physical())
        .collect();
    let choices: Vec<Value> = keys.iter().map(|key| json!(key.path())).collect();
    let named = |names: &[Key]| {
        let of_names = names.iter().copied().find(|key| keys.contains(key));
        of_names.or_else(|| keys.first().copied())
    };
    let frequency = named(&[
        Key::Omega,
        Key::OscillatorOmega,
        Key::DriveFrequency,
        Key::DriveFrequencyRatio,
    ]);
    let second = named(&[
        Key::Alpha4,
        Key::GapTip,
        Key::DriveFreeAmplitude,
        Key::Restitution,
        Key::StopStiffness,
    ]);
    let parameter = |which: &str, key: Option<Key>, reach: f64| {
        let [from, to] = key.map_or_else(Default::default, |key| ends(base, key, reach));
        vec![
            json!({ "name": format!("key{which}"), "words": "parameter", "choices": choices, "value": key.map_or("", Key::path) }),
            json!({ "name": format!("from{which}"), "words": "from", "value": from }),
            json!({ "name": format!("to{which}"), "words": "to", "value": to }),
        ]
    };
    let names = state_names(model);
    let sides = default_box(model).ok();
    let units = case.units();
    let entry = |which: &str, k: usize| {
        let side = sides
            .as_ref()
            .and_then(|sides| Some((*sides.lower().get(k)?, *sides.upper().get(k)?)))
            .unwrap_or((-1.0, 1.0));
        let name = names.get(k).map_or("", String::as_str);
        let short = |v: f64| units.shown_entry(name, v, 3);
        vec![
            json!({ "name": format!("entry{which}"), "words": "coordinate", "choices": names, "value": names.get(k) }),
            json!({ "name": format!("from{which}"), "words": "from", "value": short(side.0) }),
            json!({ "name": format!("to{which}"), "words": "to", "value": short(side.1) }),
        ]
    };
    let velocity = (names.len() - model.memory) / 2;
    // A lever with high Q responds in a narrow band.
    let band = case.physical().map_or(0.25, |view| {
        (4.0 / view.lever.quality_factor).clamp(1e-3, 0.25)
    });
    let shows: Vec<&str> = Shows::ALL.iter().map(|shows| shows.words()).collect();
    let shown = json!({ "name": "show", "words": "show", "choices": shows, "value": shows[0] });
    let plane = [
        parameter("1", second, 0.5),
        parameter("2", frequency, band),
        vec![shown],
    ]
    .concat();
    // A lever is planned over its free amplitude and setpoint, an equation over its numbers.
    let (across, up) = if case.is_physical() {
        let mut up = parameter("2", Some(Key::DriveSetpoint), 0.0);
        up[0]["choices"] = json!([Key::DriveSetpoint.path()]);
        for (field, value) in [(1, "0.5"), (2, "0.95")] {
            up[field]["value"] = json!(value);
        }
        let mut across = parameter("1", named(&[Key::DriveFreeAmplitude]), 0.5);
        across[0]["choices"] = json!([Key::DriveFreeAmplitude.path()]);
        (across, up)
    } else {
        (parameter("1", second, 0.5), parameter("2", frequency, band))
    };
    let force = if case.is_physical() { GENTLE } else { "" };
    let conditions = vec![
        json!({ "name": "force", "words": "peak force below", "value": force, "hint": ANY }),
        json!({ "name": "regime", "words": "regime", "value": ANY,
            "choices": [ANY, "attractive", "repulsive"] }),
        json!({ "name": "states", "words": "motions", "value": ONE_STATE,
            "choices": [ONE_STATE, ANY] }),
    ];
    let plan = [across, up, conditions].concat();
    let image = image(case, base);
    let slice = [entry("x", 0), entry("y", velocity)].concat();
    json!({
        "diagram": parameter("", frequency, band),
        "branches": parameter("", frequency, band),
        "resonance": parameter("", frequency, band),
        "approach": [
            json!({ "name": "from", "words": "from", "value": "", "hint": "clear of the sample" }),
            json!({ "name": "to", "words": "to", "value": "", "hint": "0" }),
        ],
        "map": plane,
        "plan": plan,
        "image": image,
        "basin": slice,
    })
}

/// Surfaces that the form of an image offers; that of the case's `[scan]` comes first, if it has one.
pub(crate) const SURFACES: [&str; 4] = [OWN_SURFACE, "step", "grating", "particle"];
const OWN_SURFACE: &str = "of the case";
/// Drive periods of a line in one direction.
const LINE_PERIODS: f64 = 5000.0;

/// The fields of an image: what the case's `[scan]` does not say has usual values.
fn image(case: &Case, base: &Case) -> Vec<Value> {
    let Some(view) = base.physical() else {
        return Vec::new();
    };
    let own = case.scan().is_some();
    let frequency = base.get(Key::DriveFrequency);
    // Half the rate at which the lever's amplitude follows.
    let gain = std::f64::consts::PI * frequency / (2.0 * view.lever.quality_factor);
    let surfaces = &SURFACES[usize::from(!own)..];
    let field = |name: &str, words: &str, value: String| {
        let value = if own { String::new() } else { value };
        json!({ "name": name, "words": words, "value": value, "hint": OWN_SURFACE })
    };
    let rate = Kind::Frequency.format_digits(frequency / (2.0 * LINE_PERIODS), 3);
    vec![
        json!({ "name": "surface", "words": "surface", "value": surfaces[0], "choices": surfaces }),
        json!({ "name": "height", "words": "height", "value": "10 nm" }),
        field("size", "line", "500 nm".to_owned()),
        field("rate", "lines a second", rate),
        field("setpoint", "setpoint", "0.8".to_owned()),
        field(
            "gain",
            "integral gain (1/s)",
            format!("{gain:.3e}")
                .parse()
                .map_or_else(|_| String::new(), |gain: f64| gain.to_string()),
        ),
    ]
}

/// A range around the value of a key, as text.
fn ends(base: &Case, key: Key, reach: f64) -> [String; 2] {
    let value = base.get(key);
    let value = if value.is_finite() {
        value
    } else {
        key.entry().example
    };
    let reach = match (key.kind(), base.physical()) {
        _ if value != 0.0 => reach * value.abs(),
        (Kind::Length, Some(view)) => view.free_amplitude,
        (_, Some(_)) => key.entry().example.abs(),
        (_, None) => 1.0,
    };
    [value - reach, value + reach].map(|value| key.kind().format_digits(value, 5))
}
