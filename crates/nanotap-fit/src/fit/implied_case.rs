//! The case of a force curve that comes without one, or with a part of one: what the options and the
//! header of the file state, and what does not matter for a lever at rest.

use super::instrument::{
    SPRING_CONSTANT, THERMAL_FREQUENCY, THERMAL_QUALITY, is_plain_force_curve, noted,
};
use super::{FitOptions, names};
use nanotap_case::file::CaseFileError;
use nanotap_case::{Case, Key};
use nanotap_error::Error;
use nanotap_quantity::number::shortest;
use nanotap_study::value::Amount;

/// Law of a force curve without a case.
const LAW: &str = "hertz";
/// Poisson's ratio of a sample without one: that of an incompressible, soft one.
const POISSON: &str = "0.5";
/// Values that a fit starts from where none are stated, and those that do not count for a lever at rest.
const VALUES: [(Key, &str); 9] = [
    (Key::LeverF0, "cantilever.f0=10 kHz"),
    (Key::LeverQ, "cantilever.Q=100"),
    (Key::DriveFrequency, "drive.frequency_ratio=1"),
    (Key::DriveAmplitude, "drive.free_amplitude=0 nm"),
    (Key::GapTip, "gap.tip=0 nm"),
    (Key::SampleModulus, "sample.modulus=1 MPa"),
    (
        Key::SampleWorkOfAdhesion,
        "sample.work_of_adhesion=1 mJ/m^2",
    ),
    (Key::SampleAdhesionForce, "sample.adhesion_force=1 nN"),
    (Key::SampleHamaker, "sample.hamaker=100 zJ"),
];
/// The adhesion from which a fit starts where a law needs one and none is stated, in SI.
pub(super) const ADHESION: [(Key, f64); 1] = [(Key::SampleWorkOfAdhesion, 1e-3)];
/// Most words that are added to a case.
const MAX_WORDS: usize = 16;

/// What a case lacks, as `key=value` words.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ImpliedWords {
    /// The words.
    pub words: Vec<String>,
    /// Sentences on what is assumed and where a value comes from.
    pub notes: Vec<String>,
}

/// The options that state a key of the case.
fn stated(request: &FitOptions) -> [(&'static str, Key, Option<&Amount>); 4] {
    [
        ("tip_radius", Key::TipRadius, request.tip_radius.as_ref()),
        ("half_angle", Key::TipHalfAngle, request.half_angle.as_ref()),
        (
            "spring_constant",
            Key::LeverK,
            request.spring_constant.as_ref(),
        ),
        ("poisson", Key::SamplePoisson, request.poisson.as_ref()),
    ]
}

/// The case with what the options state of it.
///
/// # Errors
/// If a value is not valid.
pub(super) fn with_options(case: &Case, request: &FitOptions) -> Result<Case, Error> {
    let mut case = case.clone();
    for (option, key, amount) in stated(request) {
        let Some(amount) = amount else { continue };
        if !case.is_physical() {
            return Err(Error::option(
                option,
                "the case is dimensionless",
                "give a case in physical quantities",
            ));
        }
        let value = case.implied_value(key, amount.text());
        let value = value.map_err(|error| Error::from(error).at(option))?;
        if value != case.get(key) {
            case = case.with(key, value);
        }
    }
    Ok(case)
}

/// What a case lacks for the data of a request: the lever of the file's header, the tip of the options,
/// Hertz's law, and for the rest values that do not count. `load` reads the case with further words,
/// and `words` are those that it has anyway.
///
/// A request without force curves, and a case that is complete, lack nothing.
///
/// # Errors
/// If something is missing that neither the file nor the options state, or the case is not valid.
pub fn implied_words(
    request: &FitOptions,
    words: &[String],
    load: impl Fn(&[String]) -> Result<Case, CaseFileError>,
) -> Result<ImpliedWords, Error> {
    let mut implied = ImpliedWords::default();
    let Err(error) = load(&[]) else {
        return Ok(implied);
    };
    let columns = names(&request.columns);
    let other = request
        .data
        .iter()
        .find(|table| !is_plain_force_curve(table, &columns, &request.convert));
    if let Some(table) = other {
        let states_tip = request.tip_radius.is_some() || request.half_angle.is_some();
        if states_tip && error.source.is_none() && words.is_empty() {
            return Err(Error::input(
                format!(
                    "{}: its columns are not those of a force curve alone, and other curves need a case",
                    table.name
                ),
                "select distance and deflection with {columns}, or give a case with lever and drive",
            ));
        }
        return Ok(implied);
    }
    let begins = |starts: &[&str]| {
        let mut words = words.iter();
        words.any(|word| {
            starts
                .iter()
                .any(|start| word.trim_start().starts_with(start))
        })
    };
    // The first error is of a case file that lacks a key, or of no case at all.
    let has_case = error.source.is_some();
    if !has_case && !begins(&["sample.law=", "law=", "sample.stiffness="]) {
        let chosen = names(&request.laws);
        let law = chosen.first().map_or(LAW, String::as_str);
        implied.words.push(format!("sample.law={law}"));
        if chosen.is_empty() {
            implied.notes.push(
                "no case: the sample is elastic and the tip a sphere (Hertz); other laws are those of \
                 the option `laws`, such as cone, jkr or dmt"
                    .to_owned(),
            );
        }
    }
    // The laws have a default for hard samples.
    if !has_case && !begins(&["sample.poisson=", "poisson=", "sample.material="]) {
        let poisson = word_of(Key::SamplePoisson, request, &mut implied.notes)?;
        implied.words.extend(poisson);
    }
    let mut last = error;
    while implied.words.len() < MAX_WORDS {
        match load(&implied.words) {
            Ok(_) => return Ok(implied),
            Err(error) => last = error,
        }
        let key = last.missing().and_then(Key::find);
        let known = |word: &String, key: Key| word.starts_with(&format!("{}=", key.path()));
        let Some(key) = key.filter(|key| !implied.words.iter().any(|w| known(w, *key))) else {
            break;
        };
        let Some(word) = word_of(key, request, &mut implied.notes)? else {
            break;
        };
        implied.words.push(word);
    }
    Err(last.into())
}

/// The word that states a key; `None` if nothing is known of it.
fn word_of(
    key: Key,
    request: &FitOptions,
    notes: &mut Vec<String>,
) -> Result<Option<String>, Error> {
    let path = key.path();
    let mut options = stated(request).into_iter();
    if let Some((_, _, Some(amount))) = options.find(|(_, of, _)| *of == key) {
        return Ok(Some(format!("{path}={}", amount.text())));
    }
    let file = request.data.first().map_or("data", |table| &table.name);
    let header = |name: &str| request.data.iter().find_map(|table| noted(table, name));
    let number = |unit: &str, value: f64| format!("{path}={}{unit}", shortest(value));
    Ok(match key {
        Key::LeverK => {
            let Some(k) = header(SPRING_CONSTANT) else {
                return Err(Error::option(
                    "spring_constant",
                    format!("{file} has no spring constant of the lever, and no case states one"),
                    "give the lever's stiffness, as in {spring_constant} \"0.05 N/m\"",
                ));
            };
            Some(number(" N/m", k))
        }
        Key::LeverF0 if let Some(f0) = header(THERMAL_FREQUENCY) => Some(number(" Hz", f0)),
        Key::LeverQ if let Some(q) = header(THERMAL_QUALITY) => Some(number("", q)),
        Key::TipRadius => {
            return Err(Error::option(
                "tip_radius",
                format!("{file}: the radius of the tip is needed, and no file has it"),
                "give it, as in {tip_radius} \"40 nm\", or a case",
            ));
        }
        Key::TipHalfAngle => {
            return Err(Error::option(
                "half_angle",
                format!("{file}: the half angle of the tip is needed, and no file has it"),
                "give it, as in {half_angle} \"20 deg\", or a case",
            ));
        }
        Key::SamplePoisson => {
            notes.push(format!(
                "no case: Poisson's ratio of the sample is {POISSON}, that of an incompressible one; \
                 the option `poisson` states another one"
            ));
            Some(format!("{path}={POISSON}"))
        }
        key => {
            let known = VALUES.iter().find(|(of, _)| *of == key);
            known.map(|(_, word)| (*word).to_owned())
        }
    })
}
