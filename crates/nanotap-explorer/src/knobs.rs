//! The controls of a case, from the table of its keys.

use nanotap::case::key::{ModelKind, Section, Takes};
use nanotap::case::physical::Catalogue;
use nanotap::case::units::prefixed;
use nanotap::case::{Case, Key, quantity::Kind};
use nanotap::model::contact::ContactLaw;
use nanotap_volterra::laws::TABLE;
use serde::Serialize;

/// A key of the case as shown by the page.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Knob {
    name: &'static str,
    section: &'static str,
    title: &'static str,
    symbol: &'static str,
    meaning: &'static str,
    /// The value as text; empty if the case does not state it.
    value: String,
    /// The value as a number in `unit`.
    number: Option<f64>,
    unit: String,
    /// The options, if the key is a choice.
    #[serde(skip_serializing_if = "Option::is_none")]
    choices: Option<Vec<Choice>>,
    /// Whether a sum of options is allowed.
    sums: bool,
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
/// Largest number of modes of a slider.
const MODES: usize = 10;

/// The controls of `case`: every key of its kind. The ranges of sliders follow from the values of
/// `base`, so that a slider does not jump while it is dragged.
pub(crate) fn of(case: &Case, base: &Case) -> Vec<Knob> {
    keys(case).map(|key| knob(case, base, key)).collect()
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
    Key::all().filter(move |key| {
        // Another kind of model is a separate case.
        let takes = key.entry().models.contains(&kind) && *key != Key::Kind;
        // A table has no control.
        let curve = matches!(key.entry().takes, Takes::Table | Takes::Arms);
        let in_addition = [Key::Modes, Key::CosineTerm].contains(key);
        if physical {
            key.is_physical() && !curve || in_addition
        } else {
            takes
        }
    })
}

fn knob(case: &Case, base: &Case, key: Key) -> Knob {
    let kind = key.kind();
    let value = case.get(key);
    let first = base.get(key);
    let size = if first.is_finite() && first != 0.0 {
        first.abs()
    } else if value.is_finite() && value != 0.0 {
        value.abs()
    } else {
        key.entry().example.abs()
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
        Takes::Quantity(_) if number.is_some() => Some(range(key, size * factor)),
        _ => None,
    };
    Knob {
        name: key.path(),
        section: match key.section() {
            Section::Model => "model",
            section => section.name(),
        },
        title: key.name(),
        symbol: key.symbol(),
        meaning: key.meaning(),
        value: match number {
            Some(number) => format!("{} {unit}", rounded(number)).trim_end().to_owned(),
            None => word(case, key),
        },
        number,
        unit,
        choices,
        sums: matches!(key.entry().takes, Takes::Law),
        slider,
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
        Key::Contact | Key::SampleLaw => cantilever.contact.name().to_owned(),
        Key::Actuation | Key::DriveActuation => cantilever.actuation.name().to_owned(),
        Key::CosineTerm => cantilever.cosine_term.name().to_owned(),
        Key::Tone2Ratio => cantilever
            .tone2_ratio
            .map_or_else(String::new, |ratio| ratio.to_string()),
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
    Some(match key.entry().takes {
        Takes::Word(_) if key == Key::Contact => linear.collect(),
        Takes::Word(words) => plain(words.iter().map(|word| (*word).to_owned()).collect()),
        Takes::Law => linear
            .chain(TABLE.iter().map(|law| Choice {
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

/// From an eighth of a positive value to eight times the value; otherwise both signs, or from zero.
fn range(key: Key, size: f64) -> Slider {
    let allowed = key.range();
    let size = if size > 0.0 { size } else { 1.0 };
    let signed = allowed.low < 0.0;
    let zero = allowed.contains(0.0);
    Slider {
        from: match (signed, zero) {
            (true, _) => -2.0 * size,
            (false, true) => 0.0,
            (false, false) => size / REACH,
        },
        to: if zero || signed {
            2.0 * size
        } else {
            REACH * size
        },
        log: !zero && !signed,
    }
}
