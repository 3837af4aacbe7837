//! Curves of AFM Workshop: `Key:` lines, then a table with extend and retract next to each other.

use crate::distance::{Names, finish};
use crate::document::{Channel, Curve, Document, Segment, Style};
use crate::limits::{Budget, MAX_CHANNELS, MAX_HEADER, at_most};
use crate::table::{Layout, rows};
use crate::text::{any, number};
use crate::{Error, Format, Limits};

const NAMES: Names = Names {
    measured: &["Z-Sense"],
    commanded: &[],
    ramp: &[],
    deflection: &["T-B", "Force"],
    grows_toward_surface: true,
};

pub(crate) fn read(bytes: &[u8], limits: Limits) -> Result<Document, Error> {
    let text = any(bytes);
    let mut document = Document::new(Format::Workshop, limits);
    let mut lines = text.lines().enumerate();
    let mut length = 0;
    let names = loop {
        let Some((number, line)) = lines.next() else {
            return Err(Format::Workshop.at_key("Extend …", "no such line", "the head of a table"));
        };
        if line.starts_with("Extend ") || line.starts_with("Retract ") {
            break (number, line);
        }
        length += line.len();
        at_most(length, MAX_HEADER, "bytes in a header")?;
        if let Some((key, value)) = line.split_once(':') {
            let pair = (key.trim().to_owned(), value.trim().to_owned());
            document.settings.push(pair);
        }
    };
    let (number_of_names, names) = names;
    let names: Vec<&str> = names.split(',').map(str::trim).collect();
    at_most(names.len(), MAX_CHANNELS, "columns")?;
    let layout = Layout {
        format: Format::Workshop,
        separator: Some(','),
        decimal_comma: false,
        columns: names.len(),
    };
    let lines = lines.map(|(_, line)| line);
    let table = rows(
        lines,
        number_of_names + 2,
        &layout,
        &mut Budget::new(limits),
    )?;
    document.notes = table.notes;
    let setting = |key: &str| {
        let found = document.settings.iter().find(|(name, _)| name == key);
        found.and_then(|(_, value)| number(value))
    };
    let mut curve = Curve::empty(setting("Point").map_or(1, |of| of as usize));
    let [x, y] = ["X, um", "Y, um"].map(setting);
    curve.position = x.zip(y).map(|(x, y)| [1e-6 * x, 1e-6 * y]);
    // The value 1 stands for "not set".
    let is_set = |of: &f64| *of != 1.0 && *of > 0.0;
    let gain = setting("Light Lever Gain, mV/nm").filter(is_set);
    curve.sensitivity = gain.map(|of| 1e-6 / of);
    curve.spring_constant = setting("Force Constant, nN/nm").filter(is_set);
    for (word, style) in [("Extend ", Style::Approach), ("Retract ", Style::Retract)] {
        let of_word = names
            .iter()
            .zip(&table.columns)
            .filter_map(|(name, values)| {
                let (name, unit) = name
                    .strip_prefix(word)?
                    .strip_suffix(')')?
                    .rsplit_once('(')?;
                Some(Channel::new(name, unit, values.clone()))
            });
        let mut channels: Vec<Channel> = of_word.collect();
        let points = channels.iter().map(|of| of.values.len()).min().unwrap_or(0);
        for channel in &mut channels {
            channel.values.truncate(points);
        }
        if !channels.is_empty() {
            curve.segments.push(Segment {
                style,
                label: String::new(),
                duration: None,
                channels,
            });
        }
    }
    finish(&mut curve, &NAMES);
    document.curves = Box::new(vec![curve]);
    Ok(document)
}
