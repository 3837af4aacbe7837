//! The controls of a case, from the table of its keys.

use nanotap::case::key::{ModelKind, Section, Takes};
use nanotap::case::physical::Catalogue;
use nanotap::case::units::prefixed;
use nanotap::case::{Case, Key, Value, quantity::Kind};
use nanotap::model::contact::ContactLaw;
use nanotap_volterra::laws;
use serde::Serialize;

/// A key of the case as shown by the page.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Knob {
    name: &'static str,
    section: &'static str,
    title: String,
    symbol: &'static str,
    meaning: &'static str,
    /// The group of the page in which it stands.
    group: &'static str,
    /// Whether the case states it; others are derived or have a default.
    stated: bool,
    /// Keys that say the same, of which at most one is stated.
    alternatives: Vec<&'static str>,
    /// The value as text; empty if the case does not have it.
    value: String,
    /// The value as a number in `unit`.
    number: Option<f64>,
    unit: String,
    /// The value in SI, or of the equations.
    si: Option<f64>,
    /// The options, if the key is a choice.
    #[serde(skip_serializing_if = "Option::is_none")]
    choices: Option<Vec<Choice>>,
    /// Whether a sum of options is allowed.
    sums: bool,
    /// What follows from it, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    note: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    slider: Option<Slider>,
}

/// An option of a choice.
#[derive(Clone, Debug, Serialize)]
struct Choice {
    word: String,
    meaning: String,
}

/// The range of a slider, in the unit of the control.
#[derive(Clone, Copy, Debug, Serialize)]
struct Slider {
    from: f64,
    to: f64,
    log: bool,
}

/// The ends of a slider are the value divided by and multiplied by this factor.
const REACH: f64 = 8.0;
/// The same for the frequency of the drive: beyond lie other resonances.
const DETUNED: f64 = 1.25;
/// Largest number of modes of a slider.
const MODES: usize = 10;
/// Fractions of the free amplitude at the ends of the slider of a setpoint.
const SETPOINTS: [f64; 2] = [0.1, 0.98];
/// Distances over the free amplitude at the ends of the slider of the distance.
const DISTANCES: [f64; 2] = [-0.25, 1.5];
/// Number of bisections for the end of a slider.
const BISECTIONS: usize = 12;
/// Smallest part of a slider's range that is worth a slider.
const LEAST_RANGE: f64 = 0.02;

/// Whether the case has a model with a `key=value` word in addition.
pub(crate) type Accepts<'a> = &'a dyn Fn(String) -> bool;

/// The controls of `case`: every key of its kind, law and drive. The ranges of sliders follow from the
/// values of `base`, so that a slider does not jump while it is dragged; with `accepts` they end where
/// values are refused.
pub(crate) fn knobs_of(case: &Case, base: &Case, accepts: Option<Accepts<'_>>) -> Vec<Knob> {
    let has = |key: &Key| !case.is_foreign(*key);
    keys(case)
        .filter(has)
        .map(|key| knob(case, base, key, accepts))
        .collect()
}

/// The group of the page in which a key stands.
fn group(key: Key, physical: bool) -> &'static str {
    let of_tone = ["second_", "third_", "tone"];
    let rare = of_tone.iter().any(|tone| key.name().starts_with(tone)) || key == Key::DriveHold;
    match key.section() {
        _ if rare => "more",
        Section::Model if physical || key.entry().feeds.is_some() => "more",
        Section::Model => match key.entry().takes {
            Takes::Word(_) if key != Key::Contact => "more",
            Takes::Count(_) => "more",
            _ if key.name().starts_with("mode") => "more",
            _ => "model",
        },
        Section::Cantilever | Section::Tip => "lever",
        Section::Sample => "sample",
        Section::Drive if key == Key::DriveSetpoint => "distance",
        Section::Drive => "drive",
        Section::Gap if key == Key::GapTip => "distance",
        Section::Gap => "more",
    }
}

/// The keys of the kind of `case`.
pub(crate) fn keys(case: &Case) -> impl Iterator<Item = Key> {
    let kind = if case.oscillator().is_none() {
        ModelKind::Cantilever
    } else if case.has_rigid_stop() {
        ModelKind::Impact
    } else {
        ModelKind::VibroImpact
    };
    let physical = case.is_physical();
    let of_table = Key::all().filter(move |key| {
        // Another kind of model is a separate case.
        let takes = key.entry().models.contains(&kind) && *key != Key::Kind;
        // A table or a state has no control.
        let takes_rows = key.entry().takes.is_table();
        let curve = takes_rows || key.entry().takes == Takes::State;
        let in_addition = [Key::Modes, Key::CosineTerm].contains(key);
        if physical {
            key.is_physical() && !curve || in_addition
        } else {
            takes && !curve
        }
    });
    of_table.chain(case.formula_keys())
}

fn knob(case: &Case, base: &Case, key: Key, accepts: Option<Accepts<'_>>) -> Knob {
    let held = match case.stated(key) {
        Some(Value::Number(value, kind)) if key == Key::DriveSetpoint => Some((*value, *kind)),
        _ => None,
    };
    let kind = held.map_or(key.kind(), |(_, kind)| kind);
    let value = held.map_or_else(|| case.get(key), |(value, _)| value);
    let first = if held.is_some() { value } else { base.get(key) };
    let size = if first.is_finite() && first != 0.0 {
        first.abs()
    } else if value.is_finite() && value != 0.0 {
        value.abs()
    } else {
        match (key, case.physical()) {
            (Key::TipMass, Some(view)) => view.scales.mass,
            (Key::TipMassRatio, _) => 0.5,
            _ => key.entry().example.abs(),
        }
    };
    let (factor, unit) = if key.is_physical() && kind != Kind::Number {
        prefixed(kind, 1.0, size)
    } else {
        (1.0, String::new())
    };
    let number = Some(value * factor).filter(|number| number.is_finite());
    let choices = choices(key);
    let slider = match key.entry().takes {
        Takes::Count(_) => Some(Slider {
            from: 1.0,
            to: MODES as f64,
            log: false,
        }),
        Takes::Quantity(_) if number.is_some() => Some(range(case, key, size, factor)),
        Takes::Setpoint => held_range(case, kind, size, factor).filter(|_| number.is_some()),
        _ => None,
    };
    let slider = slider.zip(number).and_then(|(slider, number)| {
        let wide = slider.with(number);
        let word = |number: f64| format!("{}={} {unit}", key.path(), rounded(number));
        match accepts {
            Some(accepts) => wide.accepted(number, |number| accepts(word(number))),
            None => Some(wide),
        }
    });
    Knob {
        name: key.path(),
        section: match key.section() {
            Section::Model => "model",
            section => section.name(),
        },
        title: title(key),
        symbol: key.symbol(),
        meaning: key.meaning(),
        group: group(key, case.is_physical()),
        stated: !case.is_physical() || case.stated(key).is_some() || key == Key::SampleLaw,
        alternatives: key.alternatives().map(|(other, _)| other.path()).collect(),
        value: match number {
            Some(number) => format!("{} {unit}", rounded(number)).trim_end().to_owned(),
            None => word(case, key),
        },
        number,
        unit,
        si: Some(value).filter(|value| value.is_finite()),
        choices,
        sums: matches!(key.entry().takes, Takes::Law),
        note: tabor(case).filter(|_| key == Key::SampleLaw),
        slider,
    }
}

/// Tabor's parameter of the sample's law, in words.
fn tabor(case: &Case) -> Option<String> {
    let tabor = case.physical()?.sample.force.as_ref()?.tabor_parameter()?;
    let number = Kind::Number.format_digits(tabor, 3);
    Some(format!("Tabor's parameter: {number}"))
}

/// The words of a key next to its control.
fn title(key: Key) -> String {
    if [Key::SamplePoisson, Key::TipPoisson].contains(&key) {
        return "Poisson's ratio ν".to_owned();
    }
    match key.entry().label {
        "" => key.name().to_owned(),
        label => label.replace("_0", "₀").replace("_c", "").replace('$', ""),
    }
}

/// The number without its last digits, which conversions of units make inexact.
fn rounded(number: f64) -> f64 {
    format!("{number:.7e}").parse().unwrap_or(number)
}

/// The value of a key that is a choice.
fn word(case: &Case, key: Key) -> String {
    let stated = case.stated(key).map(nanotap::case::Value::text);
    let Some(cantilever) = case.cantilever() else {
        return stated.unwrap_or_default();
    };
    match key {
        Key::Contact => cantilever.contact.name().to_owned(),
        Key::SampleLaw => stated.unwrap_or_else(|| cantilever.contact.name().to_owned()),
        Key::Actuation | Key::DriveActuation => cantilever.actuation.name().to_owned(),
        Key::CosineTerm => cantilever.cosine_term.name().to_owned(),
        Key::Tone2Ratio | Key::Tone3Ratio => cantilever
            .further_tones
            .get(usize::from(key == Key::Tone3Ratio))
            .map_or_else(String::new, ToString::to_string),
        _ => stated.unwrap_or_default(),
    }
}

/// The options of a key, if it is a choice.
fn choices(key: Key) -> Option<Vec<Choice>> {
    let catalogue = Catalogue::shared();
    let plain = |words: Vec<String>| {
        let choice = |word| Choice {
            word,
            meaning: String::new(),
        };
        words.into_iter().map(choice).collect()
    };
    let linear = ContactLaw::ALL.iter().map(|law| Choice {
        word: law.name().to_owned(),
        meaning: format!("{}: F = {}", law.meaning(), law.entry().formula),
    });
    let is_other = |law: &&laws::TableLaw| {
        ContactLaw::ALL
            .iter()
            .all(|other| other.name() != law.entry.name)
    };
    Some(match key.entry().takes {
        Takes::Word(_) if key == Key::Contact => linear.collect(),
        Takes::Word(words) => plain(words.iter().map(|word| (*word).to_owned()).collect()),
        Takes::Law => linear
            .chain(laws::all().filter(is_other).map(|law| Choice {
                word: law.entry.name.to_owned(),
                meaning: format!("{}: F = {}", law.entry.words, law.entry.formula),
            }))
            .collect(),
        Takes::LeverName => catalogue
            .levers()
            .map(|lever| Choice {
                word: lever.name.clone(),
                meaning: format!(
                    "k = {}, f0 = {}",
                    Kind::Stiffness.format_digits(lever.k, 3),
                    Kind::Frequency.format_digits(lever.f0, 3)
                ),
            })
            .collect(),
        Takes::MaterialName => plain(catalogue.materials().map(|m| m.name.clone()).collect()),
        _ => return None,
    })
}

/// From an eighth of a positive value to eight times the value; otherwise both signs, or from zero. The
/// ends of a distance and of a frequency follow from the lever.
fn range(case: &Case, key: Key, size: f64, factor: f64) -> Slider {
    let allowed = key.range();
    let amplitude = case
        .physical()
        .map(|view| view.free_amplitude)
        .filter(|a| *a > 0.0);
    if let (Key::GapTip, Some(amplitude)) = (key, amplitude) {
        let [from, to] = DISTANCES.map(|part| part * amplitude * factor);
        return Slider {
            from,
            to,
            log: false,
        };
    }
    let size = if size > 0.0 { size } else { 1.0 };
    let reach = match key {
        Key::DriveFrequency | Key::DriveFrequencyRatio => DETUNED,
        _ => REACH,
    };
    // A positive parameter of a formula may be of any size, and is not expected to change its sign.
    let positive = case.get(key) > 0.0 && case.formula_keys().contains(&key);
    let signed = allowed.low < 0.0 && !positive;
    let zero = allowed.contains(0.0) && !positive;
    let log = !zero && !signed;
    let from = match (signed, zero) {
        (true, _) => -2.0 * size,
        (false, true) => 0.0,
        (false, false) => size / reach,
    };
    let to = if log { reach * size } else { 2.0 * size };
    Slider {
        from: from.max(allowed.low) * factor,
        to: to.min(allowed.high) * factor,
        log,
    }
}

/// The range of a setpoint of this kind.
fn held_range(case: &Case, kind: Kind, size: f64, factor: f64) -> Option<Slider> {
    let linear = |unit: f64| {
        let [from, to] = SETPOINTS.map(|part| part * unit * factor);
        Slider {
            from,
            to,
            log: false,
        }
    };
    match kind {
        Kind::Number => Some(linear(1.0)),
        Kind::Length => Some(linear(case.physical()?.free_amplitude)),
        Kind::Force => Some(Slider {
            from: size / REACH * factor,
            to: size * REACH * factor,
            log: true,
        }),
        _ => None,
    }
}

impl Slider {
    /// The range with a value in it.
    fn with(self, number: f64) -> Self {
        if self.log && number <= 0.0 {
            return self;
        }
        Self {
            from: self.from.min(number),
            to: self.to.max(number),
            ..self
        }
    }

    /// The value at a fraction of the range.
    fn at(&self, part: f64) -> f64 {
        if self.log {
            self.from * nanotap_arithmetic::exp(part * nanotap_arithmetic::ln(self.to / self.from))
        } else {
            self.from + part * (self.to - self.from)
        }
    }

    /// The part of the range around `number` in which values are accepted, if there is one.
    fn accepted(self, number: f64, accepts: impl Fn(f64) -> bool) -> Option<Self> {
        let here = if self.log {
            nanotap_arithmetic::ln(number / self.from) / nanotap_arithmetic::ln(self.to / self.from)
        } else {
            (number - self.from) / (self.to - self.from)
        };
        let end = |end: f64| {
            if accepts(self.at(end)) {
                return end;
            }
            let (mut good, mut bad) = (here, end);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (good + bad);
                if accepts(self.at(middle)) {
                    good = middle;
                } else {
                    bad = middle;
                }
            }
            good
        };
        let (low, high) = (end(0.0), end(1.0));
        (high - low > LEAST_RANGE).then(|| Self {
            from: self.at(low),
            to: self.at(high),
            ..self
        })
    }
}
