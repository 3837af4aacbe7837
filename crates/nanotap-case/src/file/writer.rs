//! A case as the text of a case file.

use std::borrow::Cow;
use std::fmt::Write as _;

use serde_json::{Map, Value as Json};
use toml::de::DeTable;

use super::json;
use crate::key::{Key, Section};
use crate::lever_modes::LeverModes;
use crate::physical::Catalogue;
use crate::quantity::Kind;
use crate::stated::{Stated, Value};
use crate::{Case, CaseKind};
use nanotap_model::cantilever::{Cantilever, CosineTerm};
use nanotap_model::contact::ContactLaw;
use nanotap_model::drive_form::Actuation;

/// Options of `[scan]` that name a file.
pub(super) const FILES: [&str; 2] = ["profile", "image"];

/// A dimensionless cantilever as a case file, every key written out.
pub fn to_toml(case: &Cantilever) -> String {
    let mut text = format!("[model]\nmodes = {}\n", case.modes);
    for parameter in case.parameters() {
        let (key, value) = (Key::of(parameter), case.get(parameter));
        let _ = writeln!(text, "{key} = {value:?}  # {}", key.meaning());
    }
    if case.cosine_term == CosineTerm::Printed {
        text.push_str("cosine_term = \"printed\"\n");
    }
    if case.actuation != Actuation::default() {
        let (name, meaning) = (case.actuation.name(), case.actuation.meaning());
        let _ = writeln!(text, "actuation = \"{name}\"  # {meaning}");
    }
    for (ratio, key) in case.further_tones.iter().zip(Key::TONE_RATIOS) {
        let meaning = key.meaning();
        let _ = writeln!(text, "{key} = \"{ratio}\"  # {meaning}");
    }
    if case.contact != ContactLaw::default() {
        let _ = writeln!(
            text,
            "contact = \"{}\"  # {}",
            case.contact,
            case.contact.meaning()
        );
    }
    if let Some(modes) = LeverModes::of_model(&case.lever_modes) {
        let key = Key::ModelLeverModes;
        let _ = writeln!(text, "{key} = {}", modes.text());
    }
    if !case.arms.is_empty() {
        let arms = case.arms.iter();
        let arms = arms.map(|[time, stiffness]| format!(", [{time:?}, {stiffness:?}]"));
        let arms: String = arms.collect();
        let key = Key::RelaxationArms;
        let _ = writeln!(text, "{key} = [[\"time\", \"stiffness\"]{arms}]");
    }
    text
}

impl Case {
    /// The case as a file that is read back as the same case, with the same bits of every number: all
    /// numbers of the equations of a dimensionless case, or the stated physical quantities, and
    /// `[scan]`. The distance is part of it once a setpoint was solved for it, with the motion there
    /// (`drive.start`). A lever or material of another catalogue than the built-in one is written with
    /// its quantities. The files that `[scan]` names have absolute paths where the folder of the case
    /// is known.
    pub fn to_toml(&self) -> String {
        let mut text = match &self.what {
            CaseKind::Cantilever(cantilever) => to_toml(cantilever),
            CaseKind::Oscillator(oscillator) => {
                let mut text = format!("[model]\nkind = \"{}\"\n", self.model_kind().name());
                for (key, value) in self
                    .keys()
                    .into_iter()
                    .filter_map(|key| Some((key, oscillator.get(key.oscillator_parameter()?)?)))
                {
                    let _ = writeln!(text, "{} = {value:?}  # {}", key.name(), key.meaning());
                }
                text
            }
            CaseKind::Quantities(quantities) => {
                let reader = quantities.reader();
                quantities_text(&without_catalogue(reader.stated, reader.catalogue))
            }
        };
        if let Some(scan) = self.scan() {
            let _ = write!(text, "\n{}", scan_table(&self.with_absolute_files(scan)));
        }
        text
    }

    /// What [`to_toml`](Self::to_toml) writes, as JSON: the tables by name, the keys of `[model]` at the
    /// top.
    pub fn inputs(&self) -> Map<String, Json> {
        let text = self.to_toml();
        let (table, _) = DeTable::parse_recoverable(&text);
        let mut tables = json::table(table.get_ref());
        if let Some(Json::Object(model)) = tables.remove(Section::Model.name()) {
            tables.extend(model);
        }
        tables
    }

    fn with_absolute_files(&self, scan: &Map<String, Json>) -> Map<String, Json> {
        let mut scan = scan.clone();
        for name in FILES {
            if let Some(Json::String(file)) = scan.get_mut(name)
                && let Some(path) = self.relative_file(file)
                && let Ok(path) = std::path::absolute(path)
            {
                *file = path.display().to_string();
            }
        }
        scan
    }
}

/// The tables of stated quantities.
fn quantities_text(stated: &Stated) -> String {
    let mut text = String::new();
    let mut section = None;
    // Keys are sorted as in their table, section by section.
    for (key, value) in stated.iter() {
        if section != Some(key.section()) {
            section = Some(key.section());
            let gap = if text.is_empty() { "" } else { "\n" };
            let _ = writeln!(text, "{gap}[{}]", key.section().name());
        }
        let plain = matches!(
            value,
            Value::Number(_, Kind::Number)
                | Value::Table(_)
                | Value::Arms(_)
                | Value::LeverModes(_)
        );
        let value = value.text();
        let value = if plain { value } else { quoted(&value) };
        let _ = writeln!(text, "{} = {value}", key.name());
    }
    text
}

/// The stated values with the quantities of levers and materials in place of their names, where the
/// built-in catalogue does not have them.
fn without_catalogue<'a>(stated: &'a Stated, catalogue: &Catalogue) -> Cow<'a, Stated> {
    let builtin = Catalogue::shared();
    let mut own = Cow::Borrowed(stated);
    let name = |key: Key| match stated.get(key) {
        Some(Value::Name(name)) => Some(&**name),
        _ => None,
    };
    // What is stated takes precedence over the catalogue.
    let put = |own: &mut Cow<'a, Stated>, key: Key, value: Option<f64>| {
        if let Some(value) = value.filter(|_| !stated.has(key)) {
            own.to_mut().put(key, Value::Number(value, key.kind()));
        }
    };
    let key = Key::LeverName;
    if let Some(name) = name(key)
        && let Ok(lever) = catalogue.lever(key, name)
        && builtin.lever(key, name) != Ok(lever)
    {
        own.to_mut().remove(key);
        put(
            &mut own,
            Key::LeverK,
            Some(lever.k).filter(|_| !stated.has(Key::LeverK1)),
        );
        put(&mut own, Key::LeverF0, Some(lever.f0));
        put(&mut own, Key::TipRadius, lever.tip_radius);
        put(&mut own, Key::TipHeight, lever.tip_height);
        let sides = [Key::LeverLength, Key::LeverWidth, Key::LeverThickness];
        if let Some(beam) = lever
            .geometry
            .filter(|_| !sides.iter().any(|key| stated.has(*key)))
        {
            for (key, value) in sides
                .into_iter()
                .zip([beam.length, beam.width, beam.thickness])
            {
                put(&mut own, key, Some(value));
            }
        }
    }
    for (key, [modulus, poisson], density) in [
        (
            Key::SampleMaterial,
            [Key::SampleModulus, Key::SamplePoisson],
            None,
        ),
        (
            Key::TipMaterial,
            [Key::TipModulus, Key::TipPoisson],
            Some(Key::TipDensity),
        ),
    ] {
        if let Some(name) = name(key)
            && let Ok(material) = catalogue.material(key, name)
            && builtin.material(key, name) != Ok(material)
        {
            own.to_mut().remove(key);
            put(&mut own, modulus, Some(material.elastic.modulus));
            put(&mut own, poisson, Some(material.elastic.poisson));
            if let Some(density) = density {
                put(&mut own, density, material.density);
            }
        }
    }
    own
}

/// The table `[scan]` of a case file.
pub fn scan_table(scan: &Map<String, Json>) -> String {
    let lines = scan
        .iter()
        .map(|(name, value)| format!("{} = {}\n", name_text(name), inline(value)));
    format!("[scan]\n{}", lines.collect::<String>())
}

/// A value of JSON on one line of TOML.
fn inline(value: &Json) -> String {
    match value {
        Json::Object(map) => {
            let entries = map
                .iter()
                .map(|(name, value)| format!("{} = {}", name_text(name), inline(value)));
            format!("{{ {} }}", entries.collect::<Vec<_>>().join(", "))
        }
        Json::Array(values) => {
            let values: Vec<String> = values.iter().map(inline).collect();
            format!("[{}]", values.join(", "))
        }
        Json::String(text) => quoted(text),
        other => other.to_string(),
    }
}

/// A name in front of `=`, in quotes where TOML needs them.
fn name_text(name: &str) -> Cow<'_, str> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(plain) {
        name.into()
    } else {
        quoted(name).into()
    }
}

/// A text in quotes. The escapes of JSON are some of TOML's, which escapes one character more.
fn quoted(text: &str) -> String {
    Json::from(text).to_string().replace('\u{7f}', "\\u007f")
}
