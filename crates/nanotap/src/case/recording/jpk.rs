//! Force curves of JPK: a zip archive of Java properties and big-endian numbers, one file for each
//! channel of each segment.
//!
//! A channel's numbers are scaled to volts by its encoder and then, step by step, to the units of its
//! conversions (`conversion-set`). Properties that segments share are in
//! `shared-data/header.properties`; `lcd-info.*=N` and `force-segment-header-info.*=N` refer to them.
//! (No specification is public; this is what the readers afmformats and jpkfile do.)

use std::collections::BTreeMap;

use super::limits::{Budget, MAX_CHANNELS, MAX_CONVERSIONS, MAX_SEGMENTS};
use super::zip::Archive;
use super::{Number, Recording, SENSITIVITY, SPRING_CONSTANT, in_usual_unit};

type Properties = BTreeMap<String, String>;

pub(super) fn parse(bytes: &[u8], budget: &mut Budget) -> Option<Recording> {
    let archive = Archive::open(bytes, budget)?;
    let of_file = |name: &str, budget: &mut Budget| -> Option<Option<Properties>> {
        if archive.size(name).is_none() {
            return Some(None);
        }
        let text = archive.text(name, budget)?;
        properties(&text, budget).map(Some)
    };
    let shared = of_file("shared-data/header.properties", budget)?.unwrap_or_default();
    let mut recording = Recording::default();
    for segment in 0..MAX_SEGMENTS {
        let folder = format!("segments/{segment}/");
        let name = format!("{folder}segment-header.properties");
        let Some(header) = of_file(&name, budget)? else {
            break;
        };
        let header = with_shared(header, &shared, budget)?;
        let style = [
            "force-segment-header.settings.segment-settings.style",
            "force-segment-header.settings.style",
        ];
        let style = style.iter().find_map(|key| header.get(*key));
        let direction = match style.map(String::as_str) {
            Some("extend") => "approach",
            Some("retract") => "retract",
            _ => continue,
        };
        let path = format!("{folder}channels/");
        let names = archive.names().filter_map(|name| {
            let file = name.strip_prefix(&path)?.strip_suffix(".dat")?;
            Some((file.to_owned(), name.to_owned()))
        });
        let mut channels = Vec::new();
        for (channel, file) in names {
            let Some(found) = Channel::of(&header, &channel) else {
                continue;
            };
            budget.at_most(channels.len() + 1, MAX_CHANNELS, "channels")?;
            budget.column(archive.size(&file)? / found.encoder.size())?;
            let numbers = found.encoder.all(&archive.file(&file)?, true);
            let values = numbers
                .iter()
                .map(|raw| found.factor * raw + found.offset)
                .collect();
            channels.push((found.header.clone(), values));
            found.add_notes(&mut recording.notes);
        }
        recording.extend(&channels, direction, budget)?;
    }
    Some(recording)
}

/// Scaling of the numbers of a channel to values.
struct Channel {
    /// Header of the column: name of the channel with its unit.
    header: String,
    encoder: Number,
    factor: f64,
    offset: f64,
    /// Factors of its conversions, by their names.
    steps: Vec<(String, f64)>,
}

impl Channel {
    fn of(properties: &Properties, name: &str) -> Option<Self> {
        let prefix = format!("channel.{name}.");
        let get = |key: &str| properties.get(&format!("{prefix}{key}"));
        let number = |key: &str| get(key)?.parse::<f64>().ok().filter(|of| of.is_finite());
        // Older files name the encoder of the data, newer ones that of the channel.
        let encoders = ["data.encoder", "encoder"];
        let encoder = *encoders
            .iter()
            .find(|of| get(&format!("{of}.type")).is_some())?;
        let kind = match get(&format!("{encoder}.type"))?.as_str() {
            "signedshort" => Number::Signed(2),
            "unsignedshort" => Number::Unsigned(2),
            "signedinteger" => Number::Signed(4),
            "unsignedinteger" => Number::Unsigned(4),
            "signedlong" => Number::Signed(8),
            _ => return None,
        };
        let mut factor = number(&format!("{encoder}.scaling.multiplier"))?;
        let mut offset = number(&format!("{encoder}.scaling.offset")).unwrap_or(0.0);
        let set = "conversion-set.conversions";
        // A deflection is a length, whatever the instrument shows.
        let is_deflection = name == "vDeflection";
        let default = get(&format!("{set}.default")).cloned().unwrap_or_default();
        let wanted = if is_deflection {
            "distance".to_owned()
        } else {
            default
        };
        let base = get(&format!("{set}.base")).cloned().unwrap_or_default();
        let of_step = |slot: &str, key: &str| format!("conversion-set.conversion.{slot}.{key}");
        let chain = |wanted: &str| {
            let mut chain: Vec<String> = Vec::new();
            let mut slot = wanted.to_owned();
            while slot != base {
                number(&of_step(&slot, "scaling.multiplier"))?;
                chain.push(slot.clone());
                (chain.len() <= MAX_CONVERSIONS).then_some(())?;
                slot.clone_from(get(&of_step(&slot, "base-calibration-slot"))?);
            }
            chain.reverse();
            Some(chain)
        };
        let unit_of = |keys: [String; 2]| keys.iter().find_map(|key| get(key)).cloned();
        let mut unit = unit_of([
            format!("{encoder}.scaling.unit.unit"),
            format!("{encoder}.scaling.unit"),
        ]);
        let mut steps = Vec::new();
        for slot in chain(&wanted).unwrap_or_default() {
            let multiplier = number(&of_step(&slot, "scaling.multiplier"))?;
            let added = number(&of_step(&slot, "scaling.offset")).unwrap_or(0.0);
            (factor, offset) = (factor * multiplier, offset * multiplier + added);
            unit = unit_of([
                of_step(&slot, "scaling.unit.unit"),
                of_step(&slot, "scaling.unit"),
            ]);
            steps.push((slot, multiplier));
        }
        if is_deflection && let Some(stiffness) = number(&of_step("force", "scaling.multiplier")) {
            steps.push(("force".to_owned(), stiffness));
        }
        let (header, size) = in_usual_unit(name, unit.as_deref().unwrap_or(""));
        Some(Self {
            header,
            encoder: kind,
            factor: factor * size,
            offset: offset * size,
            steps,
        })
    }

    /// Sensitivity and stiffness, from the conversions of the deflection.
    fn add_notes(&self, notes: &mut Vec<(String, String)>) {
        if !self.header.starts_with("vDeflection") {
            return;
        }
        for (slot, note) in [("distance", SENSITIVITY), ("force", SPRING_CONSTANT)] {
            let known = notes.iter().any(|(name, _)| name == note);
            let step = self.steps.iter().find(|(name, _)| name == slot);
            if let (false, Some((_, value))) = (known, step) {
                notes.push((note.to_owned(), value.to_string()));
            }
        }
    }
}

/// Java properties: lines `KEY=VALUE`; `#` begins a comment.
fn properties(text: &str, budget: &mut Budget) -> Option<Properties> {
    let lines = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.starts_with(['#', '!']));
    let pairs = lines.filter_map(|line| line.split_once('='));
    let counted = pairs.map(|(key, value)| {
        budget.property(key.len(), value.len())?;
        Some((key.trim().to_owned(), value.trim().to_owned()))
    });
    counted.collect()
}

/// The properties with those that they refer to: `channel.X.lcd-info.*=2` stands for
/// `channel.X.KEY=VALUE` of all shared `lcd-info.2.KEY=VALUE`.
fn with_shared(
    mut own: Properties,
    shared: &Properties,
    budget: &mut Budget,
) -> Option<Properties> {
    let references: Vec<(String, String)> = own
        .iter()
        .filter_map(|(key, number)| Some((key.strip_suffix(".*")?.to_owned(), number.clone())))
        .collect();
    for (key, number) in references {
        let (place, kind) = key.rsplit_once('.').unwrap_or(("", &key));
        let first = format!("{kind}.{number}.");
        let found = shared
            .range(first.clone()..)
            .take_while(|(name, _)| name.starts_with(&first));
        for (name, value) in found {
            // Many references to many properties would be their product.
            budget.property(place.len() + name.len(), value.len())?;
            let rest = &name[first.len()..];
            let key = if place.is_empty() {
                rest.to_owned()
            } else {
                format!("{place}.{rest}")
            };
            own.entry(key).or_insert_with(|| value.clone());
        }
    }
    Some(own)
}
