//! Curves of AFM Workshop: `Key:` lines, then a table with extend and retract next to each other.

use crate::distance::{Names, finish};
use crate::document::{Channel, Curve, Document, Segment, Style};
use crate::text::{any, number_with_comma};
use crate::text_table::{Heading, headed};
use crate::{Error, Format, Limits};

const NAMES: Names = Names {
    measured: &["Z-Sense"],
    commanded: &[],
    ramp: &[],
    deflection: &["T-B", "Force"],
    grows_toward_surface: true,
};

const HEADING: Heading = Heading {
    setting: ":",
    begins: &["Extend ", "Retract "],
    shown: "Extend …",
    separator: ',',
};

pub(crate) fn read(bytes: &[u8], limits: Limits) -> Result<Document, Error> {
    let text = any(bytes);
    let mut document = Document::new(Format::Workshop, limits);
    let (names, columns) = headed(&text, &HEADING, &mut document)?;
    let setting = |key: &str| document.setting(key).and_then(number_with_comma);
    let mut curve = Curve::empty(setting("Point").map_or(1, |of| of as usize));
    let [x, y] = ["X, um", "Y, um"].map(setting);
    curve.position = x.zip(y).map(|(x, y)| [1e-6 * x, 1e-6 * y]);
    // The value 1 stands for "not set".
    let is_set = |of: &f64| *of != 1.0 && *of > 0.0;
    let gain = setting("Light Lever Gain, mV/nm").filter(is_set);
    curve.sensitivity = gain.map(|of| 1e-6 / of);
    curve.spring_constant = setting("Force Constant, nN/nm").filter(is_set);
    for (word, style) in [("Extend ", Style::Approach), ("Retract ", Style::Retract)] {
        let of_word = names.iter().zip(&columns).filter_map(|(name, values)| {
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
