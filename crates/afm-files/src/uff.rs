//! Universal force format: `HE key: value` lines, then rows of numbers with the code of their segment.

use std::collections::BTreeMap;

use crate::distance::{Names, finish};
use crate::document::{Channel, Curve, Document, Segment, Style};
use crate::limits::{Budget, MAX_CHANNELS, MAX_LINE, MAX_PROPERTIES, MAX_SEGMENTS, at_most};
use crate::text::{any, number};
use crate::{Error, Format, Limits};

const NAMES: Names = Names {
    measured: &[],
    commanded: &["Displacement", "Height"],
    ramp: &[],
    deflection: &["Deflection", "vDeflection"],
    grows_toward_surface: false,
};

pub(crate) fn read(bytes: &[u8], limits: Limits) -> Result<Document, Error> {
    let text = any(bytes);
    let mut header = BTreeMap::new();
    let mut lines: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for line in text.lines() {
        at_most(line.len(), MAX_LINE, "bytes in a line")?;
        let Some((code, rest)) = line.split_once(' ') else {
            continue;
        };
        if code != "HE" {
            lines.entry(code).or_default().push(rest);
        } else if let Some((key, value)) = rest.split_once(':') {
            header.insert(key.trim(), value.trim().trim_matches('"'));
            at_most(header.len(), MAX_PROPERTIES, "settings in a header")?;
        }
    }
    let setting = |key: &str| header.get(key).copied();
    let value = |key: &str| setting(key).and_then(number);
    let needed = |key: &str| {
        setting(key).ok_or_else(|| Format::Uff.at_key(key, "missing", "a setting of the segment"))
    };
    let mut document = Document::new(Format::Uff, limits);
    let mut curve = Curve::empty(value("Recording_curve_id").map_or(0, |of| of as usize));
    curve.spring_constant = value("Cantilever_springK_used(N/m)").filter(|of| *of > 0.0);
    curve.sensitivity = value("Recording_inv_optical_lever_sens_used(m/V)").filter(|of| *of > 0.0);
    let [x, y] = ["Recording_xposition(m)", "Recording_yposition(m)"].map(value);
    curve.position = x.zip(y).map(|(x, y)| [x, y]);
    let segments = value("Recording_number_segment").map_or(0, |of| of as usize);
    at_most(segments, MAX_SEGMENTS, "segments in a curve")?;
    let budget = &mut Budget::new(limits);
    for segment in 0..segments {
        let key = |name: &str| format!("Recording_segment_{segment}_{name}");
        let columns = number(needed(&key("nb_col"))?).map_or(0, |of| of as usize);
        at_most(columns, MAX_CHANNELS, "channels in a segment")?;
        let rows = lines
            .get(needed(&key("code"))?)
            .map_or(&[][..], Vec::as_slice);
        budget.numbers(rows.len().saturating_mul(columns))?;
        let mut values = vec![Vec::with_capacity(rows.len()); columns];
        for row in rows {
            // The first cell is the number of the row.
            let cells = row.split_whitespace().skip(1).take(columns);
            let cells: Option<Vec<f64>> = cells.map(number).collect();
            let cells = cells.filter(|of| of.len() == columns).ok_or_else(|| {
                let shown: String = row.chars().take(60).collect();
                Format::Uff.at_key(
                    key("code"),
                    format!("the row `{shown}`"),
                    format!("{columns} numbers"),
                )
            })?;
            values
                .iter_mut()
                .zip(cells)
                .for_each(|(column, cell)| column.push(cell));
        }
        let channels = values.into_iter().enumerate().map(|(column, values)| {
            // A later segment may leave the titles and units of the first one out.
            let described = |name: &str| {
                let of_segment =
                    |k: usize| setting(&format!("Recording_segment_{k}_col_{column}_{name}"));
                let is_known = |of: &&str| !of.is_empty() && *of != "?";
                of_segment(segment)
                    .filter(is_known)
                    .or_else(|| of_segment(0).filter(is_known))
            };
            let title = described("title");
            let name = title.map_or_else(|| format!("column {column}"), str::to_owned);
            let unit = described("unit").unwrap_or("");
            Channel::new(name, if unit == "volt" { "V" } else { unit }, values)
        });
        let mut channels: Vec<Channel> = channels.collect();
        let kind = needed(&key("type"))?;
        let style = match kind.to_lowercase().as_str() {
            "approach" => Style::Approach,
            "retract" => Style::Retract,
            "modulation" => Style::Modulation,
            _ => Style::Pause,
        };
        if style == Style::Approach && is_from_contact(&channels) {
            for channel in &mut channels {
                channel.values.reverse();
            }
            curve
                .notes
                .push("the approach is stored from the contact outwards: reversed".to_owned());
        }
        curve.segments.push(Segment {
            style,
            label: kind.to_owned(),
            duration: None,
            channels,
        });
    }
    finish(&mut curve, &NAMES);
    document.settings = header
        .iter()
        .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
        .collect();
    document.curves = Box::new(vec![curve]);
    Ok(document)
}

/// Whether an approach is stored from the contact outwards: the deflection is largest in its first half.
fn is_from_contact(channels: &[Channel]) -> bool {
    let deflection = channels
        .iter()
        .find(|of| NAMES.deflection.contains(&of.name.as_str()));
    deflection.is_some_and(|of| {
        let half = of.values.len() / 2;
        let highest = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        highest(&of.values[..half]) > highest(&of.values[half..])
    })
}
