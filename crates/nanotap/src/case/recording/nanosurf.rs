//! Spectroscopies of Nanosurf (`.nid`): sections of `KEY=VALUE` lines, then the numbers of all
//! channels in the order of the header.
//!
//! A number n of b bits stands for `Dim2Min + Dim2Range (n + 2ᵇ⁻¹)/2ᵇ`. (No specification is public;
//! this is what Nanosurf's own reader NSFopen does.)

use std::collections::BTreeMap;

use super::limits::{Budget, MAX_CHANNELS, MAX_SEGMENTS, MAX_TEXT};
use super::{Number, Recording, SENSITIVITY, SPRING_CONSTANT, in_usual_unit, latin};

type Section = BTreeMap<String, String>;

/// A channel's place and scale.
struct Channel<'a> {
    section: &'a Section,
    points: usize,
    lines: usize,
    bytes: usize,
}

impl Channel<'_> {
    fn text(&self, key: &str) -> &str {
        self.section.get(key).map_or("", String::as_str)
    }

    fn number(&self, key: &str) -> Option<f64> {
        self.text(key)
            .parse()
            .ok()
            .filter(|of: &f64| of.is_finite())
    }
}

pub(super) fn parse(bytes: &[u8], budget: &mut Budget) -> Option<Recording> {
    // The header ends before the first mark of the numbers.
    let mark = bytes.windows(2).position(|two| two == b"#!")?;
    budget.at_most(mark, MAX_TEXT, "bytes in its header")?;
    let sections = sections(&latin(&bytes[..mark]), budget)?;
    let all = sections.get("DataSet")?;
    let count = |key: &str| -> Option<usize> { all.get(key)?.parse().ok() };
    let mut channels = Vec::new();
    for group in 0..count("GroupCount")?.min(MAX_SEGMENTS) {
        let size = count(&format!("Gr{group}-Count")).unwrap_or(0);
        for channel in 0..size.min(MAX_CHANNELS) {
            let Some(name) = all.get(&format!("Gr{group}-Ch{channel}")) else {
                continue;
            };
            budget.at_most(channels.len() + 1, MAX_CHANNELS, "channels")?;
            let section = sections.get(name)?;
            let whole = |key: &str| -> Option<usize> { section.get(key)?.parse().ok() };
            channels.push(Channel {
                section,
                points: whole("Points")?,
                lines: whole("Lines")?,
                bytes: match whole("SaveBits")? {
                    16 => 2,
                    32 => 4,
                    _ => return None,
                },
            });
        }
    }
    let mut at = bytes.len();
    let mut starts = Vec::new();
    for channel in channels.iter().rev() {
        let size = channel
            .points
            .checked_mul(channel.lines)?
            .checked_mul(channel.bytes)?;
        at = at.checked_sub(size).filter(|at| *at >= mark)?;
        starts.push(at);
    }
    starts.reverse();
    let mut recording = Recording::default();
    // Without a channel of the distance its axis tells it; that of the way back is not described.
    let has_z = channels
        .iter()
        .any(|c| c.text("Dim2Name").starts_with("Z-Axis"));
    let frames = [("Spec forward", "approach"), ("Spec backward", "retract")];
    for (frame, direction) in frames.into_iter().take(if has_z { 2 } else { 1 }) {
        let of_frame = channels
            .iter()
            .zip(&starts)
            .filter(|(c, _)| c.text("Frame") == frame);
        let mut columns: Vec<(String, Vec<f64>)> = Vec::new();
        for (channel, start) in of_frame {
            // A map has one curve a line: the first is read.
            let points = channel
                .number("LineDim0Points")
                .map_or(channel.points, |n| n as usize);
            let points = points.min(channel.points);
            let numbers = Number::Signed(channel.bytes);
            let raw = bytes.get(*start..start.checked_add(points.checked_mul(channel.bytes)?)?)?;
            let name = match channel.text("Dim2Name") {
                "" => "channel",
                name => name,
            };
            let (header, size) = in_usual_unit(name, channel.text("Dim2Unit"));
            let (low, range) = (channel.number("Dim2Min")?, channel.number("Dim2Range")?);
            let levels = 2f64.powi(8 * channel.bytes as i32);
            let value = |n: f64| size * (low + range * (n + 0.5 * levels) / levels);
            if columns.iter().any(|(known, _)| *known == header) {
                continue;
            }
            budget.column(points)?;
            if columns.is_empty() && !has_z && channel.text("Dim0Unit") == "m" {
                let (low, range) = (channel.number("Dim0Min")?, channel.number("Dim0Range")?);
                let step = range / (channel.points.max(2) - 1) as f64;
                let places = (0..points).map(|k| 1e9 * (low + step * k as f64));
                columns.push(("Z (nm)".to_owned(), places.collect()));
            }
            let values = numbers.all(raw, false).into_iter().map(value);
            columns.push((header, values.collect()));
        }
        if !columns.is_empty() {
            recording.extend(&columns, direction, budget)?;
        }
    }
    recording.notes = notes(&sections);
    Some(recording)
}

/// Sections of lines `KEY=VALUE`, by their names.
fn sections(text: &str, budget: &mut Budget) -> Option<BTreeMap<String, Section>> {
    let mut sections: BTreeMap<String, Section> = BTreeMap::new();
    let mut name = String::new();
    for line in text.lines().map(str::trim) {
        if let Some(of) = line
            .strip_prefix('[')
            .and_then(|rest| rest.strip_suffix(']'))
        {
            of.clone_into(&mut name);
        } else if let Some((key, value)) = line.split_once('=') {
            budget.property(name.len() + key.len(), value.len())?;
            let section = sections.entry(name.clone()).or_default();
            section.insert(key.trim().to_owned(), value.trim().to_owned());
        }
    }
    Some(sections)
}

/// Stiffness of the lever and sensitivity of the detector.
fn notes(sections: &BTreeMap<String, Section>) -> Vec<(String, String)> {
    let mut notes = Vec::new();
    if let Some(lever) = sections.get(r"DataSet\Calibration\Cantilever") {
        // Written as `D[0.2]*[N/m]`.
        let stiffness = lever.values().find_map(|value| {
            let (number, unit) = value.strip_prefix("D[")?.split_once("]*[")?;
            (unit.trim_end_matches(']') == "N/m").then(|| number.to_owned())
        });
        notes.extend(stiffness.map(|value| (SPRING_CONSTANT.to_owned(), value)));
    }
    if let Some(head) = sections.get(r"DataSet\Calibration\Scanhead") {
        // The deflection at ten volts.
        let at_ten = head
            .get("In5")
            .and_then(|of| of.split(',').nth(4)?.trim().parse::<f64>().ok());
        notes.extend(at_ten.map(|of| (SENSITIVITY.to_owned(), (of / 10.0).to_string())));
    }
    notes
}
