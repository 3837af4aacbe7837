//! A force as it is written: its curve, its mistake, and the keys to set once it is right.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use nanotap::case::quantity::{Kind, Quantity};
use nanotap::case::under_law::LawName;
use nanotap::case::{Case, Key};
use nanotap_formula::{Formula, FormulaError, Pieces};
use nanotap_volterra::laws::entry::ParameterEntry;
use nanotap_volterra::laws::written::{KNOWN, PARAMETERS};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::Explorer;
use crate::api_error::ApiError;
use crate::preset::CaseSpec;

/// A formula as requested by the page.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ForceRequest {
    case: CaseSpec,
    force: String,
    /// Values of parameters that were typed, by name; those of the case come second.
    #[serde(default)]
    parameters: BTreeMap<String, String>,
    /// Former values of parameters, for those that have none in the case.
    #[serde(default)]
    former: BTreeMap<String, String>,
    /// Whether the case takes the formula: the answer contains the keys to set.
    #[serde(default)]
    take: bool,
}

/// Largest number of parameters of a formula that is drawn.
const MAX_PARAMETERS: usize = 40;
/// Gaps of a curve between two ends of its branches: at least, and of the whole.
const MIN_POINTS: usize = 8;
const POINTS: usize = 240;
/// Distances, in m, from the contact within which ends of branches are shown.
const SHOWN: [f64; 2] = [-5e-9, 20e-9];
/// Distances, in m, that are shown below and above the ends of branches.
const AROUND: [f64; 2] = [0.7e-9, 5e-9];
/// Part of an interval by which a branch is left out at its ends.
const INSIDE: f64 = 1e-9;
/// Speed, in m/s, of a tip that is not driven.
const SLOW: f64 = 1e-3;

/// Where a value of a parameter comes from.
struct Parameter<'a> {
    name: &'a str,
    /// Key that states it in a case.
    key: String,
    value: Option<Quantity>,
    /// Text that was typed.
    typed: Option<&'a str>,
}

/// A mistake, with the parameter whose value is wrong, if it is one.
struct Mistake {
    error: FormulaError,
    parameter: String,
}

impl From<FormulaError> for Mistake {
    fn from(error: FormulaError) -> Self {
        Self {
            error,
            parameter: String::new(),
        }
    }
}

/// The force over the gap, or what is wrong with the formula and what it lacks.
pub(crate) fn force(app: &Explorer, request: &ForceRequest) -> Result<Value, ApiError> {
    let case = request.case.any_distance(app)?;
    if !case.is_physical() {
        return Err(ApiError::input(
            "this case has no units, and a formula is a force in N",
            "choose a case with units",
        ));
    }
    match drawn(app, request, &case) {
        Ok(answer) => Ok(answer),
        Err(Mistake { error, parameter }) => {
            // Places as a script of the page counts them.
            let place = |byte: usize| {
                let before = error.text.get(..byte).unwrap_or_default();
                before.encode_utf16().count()
            };
            let text = if parameter.is_empty() {
                error.to_string()
            } else {
                format!("{parameter}: {}", error.reason)
            };
            Ok(
                json!({ "points": [], "levels": [], "missing": [], "error": {
                    "text": text,
                    "from": place(error.place.start),
                    "to": place(error.place.end),
                    "parameter": parameter,
                }}),
            )
        }
    }
}

fn drawn(app: &Explorer, request: &ForceRequest, case: &Case) -> Result<Value, Mistake> {
    let formula = Formula::parse(&request.force)?;
    let names = formula.parameters();
    if let Some(name) = names.get(MAX_PARAMETERS) {
        let reason = format!("the page takes at most {MAX_PARAMETERS} parameters");
        return Err(formula.without_value(name, reason).into());
    }
    let parameters: Vec<Parameter<'_>> = names
        .iter()
        .map(|name| parameter(request, case, &formula, name))
        .collect::<Result<_, _>>()?;
    let missing: Vec<&str> = parameters
        .iter()
        .filter(|parameter| parameter.value.is_none())
        .map(|parameter| parameter.name)
        .collect();
    let keys: Vec<Value> = parameters
        .iter()
        .map(|parameter| json!({ "name": parameter.name, "key": parameter.key }))
        .collect();
    if !missing.is_empty() {
        return Ok(json!({ "points": [], "levels": [], "missing": missing, "keys": keys }));
    }
    let values: Vec<Quantity> = parameters.iter().filter_map(|p| p.value).collect();
    let dimensions: Vec<_> = values.iter().map(|value| value.dimension).collect();
    formula.check(&dimensions, Kind::Force.dimension())?;
    let contact = contact(request, case);
    let values: Vec<f64> = values.iter().map(|value| value.value).collect();
    let moves = formula.moves_surface(&dimensions)?;
    let pieces = formula.pieces(&values, contact, moves)?;
    let dynamic = formula.depends_on_rate() || formula.remembers();
    let speed = dynamic.then(|| speed(case));
    let [levels, points] = curve(&pieces, contact, speed);
    let mut answer = json!({
        "points": points, "levels": levels, "contact": contact, "speed": speed, "missing": [],
        "keys": keys, "memory": formula.has_memory(),
    });
    if request.take {
        let set = changes(request, case, &parameters);
        let mut taken = request.case.clone();
        for (key, text) in &set {
            taken.replace(key, text.as_str().unwrap_or_default());
        }
        if let Err(refused) = taken.any_distance(app) {
            let refused = refused.json();
            let text = refused["error"].clone();
            answer["error"] = json!({ "text": text, "from": 0, "to": 0, "parameter": "" });
        } else {
            answer["set"] = set.into();
        }
    }
    Ok(answer)
}

/// The key that states a quantity of tip and sample which a formula may name.
fn known(name: &str) -> Option<(Key, &'static ParameterEntry)> {
    let (_, entry) = KNOWN.iter().find(|(other, _)| *other == name)?;
    Some((Key::of_law_parameter(entry)?, entry))
}

/// A parameter with its value: as typed, as the case states it, or the usual one.
fn parameter<'a>(
    request: &'a ForceRequest,
    case: &Case,
    formula: &Formula,
    name: &'a str,
) -> Result<Parameter<'a>, Mistake> {
    let own = format!("sample.{PARAMETERS}{name}");
    let known = known(name);
    let of = |key: Key| {
        let value = Some(case.get(key)).filter(|value| value.is_finite());
        let dimension = key.kind().dimension();
        value.map(|value| Quantity { value, dimension })
    };
    let mut keys = case.formula_keys().into_iter();
    let key = keys.find(|key| key.path() == own);
    let key = key.or_else(|| Some(known?.0));
    let held = key.and_then(|key| Some((key, of(key)?)));
    let said = |texts: &'a BTreeMap<String, String>| {
        let text = texts.get(name).map(|text| text.trim());
        text.filter(|text| !text.is_empty())
    };
    let former = || said(&request.former).filter(|_| held.is_none());
    if let Some(text) = said(&request.parameters).or_else(former) {
        let read = text.parse::<Quantity>().map_err(|error| Mistake {
            error: formula.without_value(name, format!("{error}")),
            parameter: name.to_owned(),
        })?;
        let key = known.filter(|(_, entry)| entry.kind.dimension() == read.dimension);
        return Ok(Parameter {
            name,
            key: key.map_or(own, |(key, _)| key.path().to_owned()),
            value: Some(read),
            typed: Some(text),
        });
    }
    let (key, value) = match (held, known) {
        (Some((key, value)), _) => (key.path().to_owned(), Some(value)),
        (None, Some((key, entry))) => {
            let dimension = entry.kind.dimension();
            let value = entry.default.map(|value| Quantity { value, dimension });
            (key.path().to_owned(), value)
        }
        (None, None) => (own, None),
    };
    Ok(Parameter {
        name,
        key,
        value,
        typed: None,
    })
}

/// The gap at which contact begins.
fn contact(request: &ForceRequest, case: &Case) -> f64 {
    let typed = request.parameters.get("a0");
    let typed = typed.and_then(|text| Kind::Length.parse(text).ok());
    let stated =
        Key::find("sample.intermolecular_distance").filter(|key| case.stated(*key).is_some());
    typed
        .or_else(|| stated.map(|key| case.get(key)))
        .unwrap_or(0.0)
}

/// The largest speed of the free tip, in m/s.
fn speed(case: &Case) -> f64 {
    let amplitude = case.physical().map_or(f64::NAN, |view| view.free_amplitude);
    let speed = TAU * case.get(Key::DriveFrequency) * amplitude;
    if speed > 0.0 { speed } else { SLOW }
}

/// The ends of branches that are shown, and rows of the gap and the force; with a speed, the force on the
/// way to the sample and on the way back. A branch ends in the row before the next one begins.
fn curve(pieces: &Pieces, contact: f64, speed: Option<f64>) -> [Vec<Value>; 2] {
    let [low, high] = SHOWN.map(|distance| contact + distance);
    let levels: Vec<f64> = pieces
        .levels()
        .iter()
        .copied()
        .filter(|level| (low..=high).contains(level))
        .collect();
    let first = levels.iter().fold(contact, |a, b| a.min(*b)) - AROUND[0];
    let last = levels.iter().fold(contact, |a, b| a.max(*b)) + AROUND[1];
    let mut ends = vec![first];
    ends.extend(&levels);
    ends.push(last);
    let rates = speed.map_or_else(|| vec![-f64::MIN_POSITIVE], |speed| vec![-speed, speed]);
    let mut points = Vec::new();
    for end in ends.windows(2) {
        let length = end[1] - end[0];
        let count = MIN_POINTS.max((POINTS as f64 * length / (last - first)) as usize);
        for k in 0..=count {
            // Forces change most near the ends of branches.
            let part = 0.5 - 0.5 * nanotap_arithmetic::cos(PI * k as f64 / count as f64);
            let gap = end[0] + length * part.clamp(INSIDE, 1.0 - INSIDE);
            let at = |rate: &f64| pieces.value(pieces.at(gap, *rate), gap, *rate);
            let row: Vec<f64> = std::iter::once(gap).chain(rates.iter().map(at)).collect();
            points.push(json!(row));
        }
    }
    [levels.into_iter().map(Value::from).collect(), points]
}

/// The keys to set for the formula, empty where it does not take them.
fn changes(
    request: &ForceRequest,
    case: &Case,
    parameters: &[Parameter<'_>],
) -> Map<String, Value> {
    let mut set = Map::new();
    let uses = |path: &str| parameters.iter().any(|parameter| parameter.key == path);
    let material = |key: Key| key == Key::SampleMaterial && uses(Key::SampleModulus.path());
    // Without a look at the text it takes every parameter, and what the other forces of a sum take.
    let law = case.stated(Key::SampleLaw).map(nanotap::case::Value::text);
    let law = law.and_then(|law| LawName::read(&law).ok());
    let of_law = |key: Key| law.as_ref().is_none_or(|law| law.takes(key));
    let stated = Key::all().filter(|key| case.stated(*key).is_some() && !of_law(*key));
    for key in stated.chain(case.formula_keys()) {
        if !uses(key.path()) && !material(key) {
            set.insert(key.path().into(), "".into());
        }
    }
    for parameter in parameters {
        if let Some(text) = parameter.typed {
            set.insert(parameter.key.clone(), text.into());
        }
    }
    set.insert(Key::SampleForce.path().into(), request.force.clone().into());
    set
}
