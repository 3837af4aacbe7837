//! Indentations of Optics11's Chiaro: a header with tabs, then a table over time.

use crate::distance::{Names, finish};
use crate::document::{Channel, Curve, Document, Segment, Style};
use crate::text::{any, number_with_comma};
use crate::text_table::{Heading, headed};
use crate::{Error, Format, Limits};

const NAMES: Names = Names {
    measured: &["Piezo"],
    commanded: &[],
    ramp: &[],
    deflection: &["Cantilever"],
    grows_toward_surface: true,
};

const HEADING: Heading = Heading {
    setting: "\t",
    begins: &["Time (s)"],
    shown: "Time (s)",
    separator: '\t',
};

pub(crate) fn read(bytes: &[u8], limits: Limits) -> Result<Document, Error> {
    let text = any(bytes);
    let mut document = Document::new(Format::Chiaro, limits);
    let (names, columns) = headed(&text, &HEADING, &mut document)?;
    let named = names
        .iter()
        .zip(columns)
        .filter(|(_, values)| !values.is_empty());
    let channels: Vec<Channel> = named
        .map(|(name, values)| {
            let split = name.strip_suffix(')').and_then(|of| of.rsplit_once(" ("));
            let (name, unit) = split.unwrap_or((name, ""));
            Channel::new(name, unit, values)
        })
        .collect();
    let setting = |key: &str| document.setting(key).and_then(number_with_comma);
    let mut curve = Curve::empty(0);
    curve.spring_constant = setting("k (N/m)").filter(|of| *of > 0.0);
    let [x, y] = ["X-position (um)", "Y-position (um)"].map(setting);
    curve.position = x.zip(y).map(|(x, y)| [1e-6 * x, 1e-6 * y]);
    curve.segments = split_at_turn(channels);
    curve
        .notes
        .push("the file marks no segments: it is cut where the piezo turns back".to_owned());
    finish(&mut curve, &NAMES);
    document.curves = Box::new(vec![curve]);
    Ok(document)
}

/// Cuts a curve where the piezo is nearest to the sample for the first and the last time.
fn split_at_turn(mut channels: Vec<Channel>) -> Vec<Segment> {
    let points = channels.iter().map(|of| of.values.len()).min().unwrap_or(0);
    for channel in &mut channels {
        channel.values.truncate(points);
    }
    let segment = |style: Style, channels: Vec<Channel>| {
        let time = channels.iter().find(|of| of.name == "Time");
        let duration = time.and_then(|of| Some(of.values.last()? - of.values.first()?));
        Segment {
            style,
            label: String::new(),
            duration,
            channels,
        }
    };
    let piezo = channels.iter().find(|of| of.name == "Piezo");
    let highest = piezo.and_then(|of| {
        let numbered = of.values.iter().enumerate();
        numbered.max_by(|a, b| a.1.total_cmp(b.1)).map(|(k, _)| k)
    });
    let Some(turn) = highest.filter(|turn| *turn > 0 && turn + 1 < points) else {
        return vec![segment(Style::Unsplit, channels)];
    };
    let part = |range: std::ops::Range<usize>| {
        let cut = |of: &Channel| Channel {
            values: of.values[range.clone()].to_vec(),
            ..of.clone()
        };
        channels.iter().map(cut).collect::<Vec<_>>()
    };
    vec![
        segment(Style::Approach, part(0..turn + 1)),
        segment(Style::Retract, part(turn + 1..points)),
    ]
}
