//! The knobs of a case, from the table of its keys.

use nanotap::case::key::{ModelKind, Section, Takes};
use nanotap::case::physical::Catalogue;
use nanotap::case::units::prefixed;
use nanotap::case::{Case, Key, quantity::Kind};
use nanotap::model::contact::ContactLaw;
use nanotap_volterra::laws::TABLE;
use serde::Serialize;

/// A key of the case as the page shows it.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Knob {
    name: &'static str,
    section: &'static str,
    title: &'static str,
    symbol: &'static str,
    meaning: &'static str,
    /// The value as it is typed; empty where the case does not state it.
    value: String,
    /// The same as a number in `unit`.
    number: Option<f64>,
    unit: String,
    /// What it may be, where it takes one of some words.
    #[serde(skip_serializing_if = "Option::is_none")]
    choices: Option<Vec<Choice>>,
    /// Whether it may be a sum of such words.
    sums: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    slider: Option<Slider>,
}

/// One of some words.
#[derive(Clone, Debug, Serialize)]
struct Choice {
    word: String,
    meaning: String,
}

/// The range of a slider, in the knob's unit.
#[derive(Clone, Copy, Debug, Serialize)]
struct Slider {
    from: f64,
    to: f64,
    log: bool,
}

/// A slider's ends are the value over this and times this.
const REACH: f64 = 8.0;
/// Most modes that a slider offers.
const MODES: usize = 10;

/// The knobs of `case`: every key that its kind takes. Sliders stay where the values of `base`
/// put them, so that a dragged one does not move under the hand.
pub(crate) fn of(case: &Case, base: &Case) -> Vec<Knob> {
    keys(case).map(|key| knob(case, base, key)).collect()
}

/// The keys that the kind of `case` takes.
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
        // Another kind of model is another case.
        let takes = key.entry().models.contains(&kind) && *key != Key::Kind;
        // A curve is no knob.
        let curve = key.entry().takes == Takes::Table;
        let beside = [Key::Modes, Key::CosineTerm].contains(key);
        if physical {
            key.is_physical() && !curve || beside
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

/// Without the last digits, which changes of unit spoil.
fn rounded(number: f64) -> f64 {
    format!("{number:.7e}").parse().unwrap_or(number)
}

/// The word that a key has.
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

/// What a key may be, where that is one of some words.
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
        meaning: format!("{}: F = {}", law.meaning(), formula(*law)),
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

/// The force of a linear contact on the tip.
const fn formula(law: ContactLaw) -> &'static str {
    match law {
        ContactLaw::SpringDamper => "−(K1 h + C1 dh/dt) at heights h < 0, none above",
        ContactLaw::KelvinVoigt => "−(K1 h + C1 dh/dt) while this pushes, then none",
        ContactLaw::StandardLinearSolid => {
            "−K1 h + Fm, Fm + τm dFm/dt = −km τm dh/dt, while this pushes, then none"
        }
        ContactLaw::MovingSurface => {
            "−Fad − K1 (h − s) − C1 d(h − s)/dt at heights h < s, none above; ηs ds/dt + ks s = −F"
        }
    }
}

/// Around a value above zero its eighth to its eightfold; else both signs, or up from zero.
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
