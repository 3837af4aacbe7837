//! Bruker Nanoscope (`.spm`, `.000`, `.pfc`): a text header, then little-endian integers. Curves, force
//! volumes and images.
//!
//! A setting `V [Sens. S] (h u/LSB) v u` names its soft scale S, its hard scale h and its value v. The
//! numbers are the maker's as public readers and ten real files show them.

use std::collections::BTreeMap;

use crate::bytes::{Encoding, Number};
use crate::distance::{Names, finish};
use crate::document::{Channel, Curve, CurveSource, Document, Grid, Image, Lever, Segment, Style};
use crate::limits::{
    Budget, MAX_CHANNELS, MAX_CURVES, MAX_HEADER, MAX_LINE, MAX_PROPERTIES, at_most,
};
use crate::source::{ReadAt, Source};
use crate::text::{latin1, leading_number, number, si};
use crate::{Error, Format, Limits};

const RAMP: &str = "ramp";
const NAMES: Names = Names {
    measured: &["Height Sensor"],
    commanded: &[],
    ramp: &[RAMP],
    deflection: &["Deflection Error", "Deflection"],
    grows_toward_surface: true,
};
const END: &[u8] = b"\\*File list end";
/// Numbers of version 9.2 may have 8 more bits than the header says.
const MORE_BITS: f64 = 256.0;
/// Bytes that are looked through together.
const PART: usize = 1 << 20;

type Section = BTreeMap<String, String>;

fn damaged(key: &str, problem: impl Into<String>, expected: impl Into<String>) -> Error {
    Format::Nanoscope.at_key(key, problem, expected)
}

/// A header: sections in the order of the file.
struct Header {
    sections: Vec<(String, Section)>,
    /// Scales by their names, `Sens. …`.
    scales: BTreeMap<String, String>,
    /// Where it ends in the file.
    end: usize,
}

/// A setting `V [soft scale] (hard scale u/LSB) value unit`.
#[derive(Debug, Default, PartialEq)]
struct Setting<'a> {
    soft_scale: Option<&'a str>,
    hard_scale: Option<f64>,
    value: Option<f64>,
    unit: &'a str,
}

impl<'a> Setting<'a> {
    fn parse(text: &'a str) -> Self {
        let mut setting = Self::default();
        let Some(mut rest) = text.trim().strip_prefix('V').map(str::trim) else {
            return setting;
        };
        if let Some((name, after)) = rest.strip_prefix('[').and_then(|of| of.split_once(']')) {
            setting.soft_scale = Some(name);
            rest = after.trim();
        }
        if let Some((scale, after)) = rest.strip_prefix('(').and_then(|of| of.split_once("/LSB)")) {
            setting.hard_scale = scale.split_whitespace().next().and_then(number);
            rest = after.trim();
        }
        if let Some((value, unit)) = leading_number(rest) {
            setting.value = Some(value);
            setting.unit = unit;
        }
        setting
    }
}

impl Header {
    fn parse(head: &[u8]) -> Result<Self, Error> {
        let end = head
            .windows(END.len())
            .position(|of| of == END)
            .ok_or_else(|| {
                Format::Nanoscope.at_byte(
                    head.len(),
                    "the header does not end",
                    "a line \\*File list end",
                )
            })?;
        let mut header = Self {
            sections: Vec::new(),
            scales: BTreeMap::new(),
            end,
        };
        let mut count = 0;
        for line in head[..end].split(|of| *of == b'\n') {
            at_most(line.len(), MAX_LINE, "bytes in a line of a header")?;
            let line = latin1(line);
            let line = line.trim_matches(|of| matches!(of, '\r' | '\x1a' | ' '));
            if let Some(name) = line.strip_prefix("\\*").or_else(|| line.strip_prefix("?*")) {
                header.sections.push((name.to_lowercase(), Section::new()));
            } else if let (Some(line), Some((_, section))) =
                (line.strip_prefix('\\'), header.sections.last_mut())
            {
                // `@4:Name: value` has a colon in its key.
                let first = if line.starts_with('@') && line.as_bytes().get(2) == Some(&b':') {
                    3
                } else {
                    0
                };
                let after = line.get(first..).unwrap_or("");
                let Some(cut) = after.find(": ").or_else(|| after.find(':')) else {
                    continue;
                };
                let (key, value) = (line[..first + cut].trim(), after[cut + 1..].trim());
                count += 1;
                at_most(count, MAX_PROPERTIES, "settings in a header")?;
                if let Some(name) = key.strip_prefix('@').filter(|of| of.starts_with("Sens. ")) {
                    header
                        .scales
                        .entry(name.to_owned())
                        .or_insert_with(|| value.to_owned());
                }
                section
                    .entry(key.to_owned())
                    .or_insert_with(|| value.to_owned());
            }
        }
        Ok(header)
    }

    fn section(&self, name: &str) -> Option<&Section> {
        self.sections
            .iter()
            .find(|(of, _)| of == name)
            .map(|(_, section)| section)
    }

    fn text(&self, section: &str, key: &str) -> Option<&str> {
        self.section(section)?.get(key).map(String::as_str)
    }

    fn number(&self, section: &str, key: &str) -> Option<f64> {
        leading_number(self.text(section, key)?).map(|(value, _)| value)
    }

    /// A length (m) such as `-1523.3 nm`.
    fn length(&self, section: &str, key: &str) -> Option<f64> {
        let (value, unit) = leading_number(self.text(section, key)?)?;
        let (factor, unit) = si(unit);
        (unit == "m").then_some(value * factor)
    }

    /// A soft scale: factor to SI, and the unit.
    fn scale(&self, name: &str) -> (f64, String) {
        let setting = Setting::parse(self.scales.get(name).map_or("", String::as_str));
        let value = setting.value.unwrap_or(1.0);
        let unit = setting.unit.split('/').next().unwrap_or("").trim();
        // Some versions write nm/V without the unit; 1 is an uncalibrated detector.
        if name == "Sens. DeflSens" && unit.is_empty() && value != 1.0 {
            return (1e-9 * value, "m".to_owned());
        }
        let (factor, si_unit) = si(unit);
        let si_unit = if si_unit.is_empty() { "V" } else { si_unit };
        (value * factor, si_unit.to_owned())
    }

    /// Sections that describe data, such as `ciao image list`.
    fn lists(&self, name: &str) -> Vec<&Section> {
        let named = self
            .sections
            .iter()
            .filter(|(of, section)| of == name && section.contains_key("Data offset"));
        named.map(|(_, section)| section).collect()
    }
}

/// The first setting of a section whose key is `@n:NAME`.
fn setting<'a>(section: &'a Section, name: &str) -> Option<&'a str> {
    let found = section.iter().find(|(key, _)| {
        key.strip_prefix('@')
            .and_then(|of| of.get(2..))
            .is_some_and(|of| of.eq_ignore_ascii_case(name))
    });
    found.map(|(_, value)| value.as_str())
}

fn whole(section: &Section, key: &str) -> Result<usize, Error> {
    let text = section.get(key).map_or("", String::as_str);
    let found = text
        .split_whitespace()
        .next()
        .and_then(|of| of.parse().ok());
    found.ok_or_else(|| damaged(key, format!("the value `{text}`"), "a whole number"))
}

/// Numbers of a channel or an image in the file.
#[derive(Debug)]
struct Data {
    name: String,
    unit: String,
    first: usize,
    count: usize,
    width: usize,
    /// Unit for one step.
    factor: f64,
    has_more_bits: bool,
}

impl Data {
    /// Finds `count` numbers; `is_curve` tells how they are scaled.
    fn find(
        header: &Header,
        file: &Source,
        section: &Section,
        count: usize,
        is_curve: bool,
    ) -> Result<Self, Error> {
        let (first, length) = (
            whole(section, "Data offset")?,
            whole(section, "Data length")?,
        );
        let stated = section
            .get("Bytes/pixel")
            .map_or(Ok(2), |_| whole(section, "Bytes/pixel"))?;
        if !matches!(stated, 1 | 2 | 4) {
            return Err(damaged(
                "Bytes/pixel",
                format!("the value {stated}"),
                "2 or 4",
            ));
        }
        // From version 9.2 on every number has 4 bytes, whatever is stated.
        let width = match length.checked_div(count) {
            Some(4) => 4,
            Some(2) => 2,
            _ => {
                let problem = format!("{length} bytes for {count} numbers");
                return Err(damaged("Data length", problem, "2 or 4 bytes a number"));
            }
        };
        if first < header.end {
            return Err(damaged(
                "Data offset",
                format!("byte {first} in the header"),
                "a place after it",
            ));
        }
        let length = count.saturating_mul(width);
        file.check(first as u64, length as u64, Format::Nanoscope)?;
        let text = setting(section, "Z scale")
            .ok_or_else(|| damaged("@2:Z scale", "missing", "a scale"))?;
        let scale = Setting::parse(text);
        let (soft, unit) = match scale.soft_scale {
            Some(name) => header.scale(name),
            None => (1.0, scale.unit.to_owned()),
        };
        let step = if is_curve {
            scale.hard_scale
        } else {
            scale.value.map(|of| of / 2f64.powi(8 * stated as i32))
        };
        let step = step.filter(|of| *of != 0.0 && soft != 0.0);
        let mut factor =
            step.ok_or_else(|| damaged("@2:Z scale", text, "a scale that is not 0"))? * soft;
        let limit = 2f64.powi(8 * stated as i32 - 1);
        let mut has_more_bits = false;
        let mut at = 0;
        while width > stated && !has_more_bits && at < length {
            let part = (length - at).min(PART);
            let raw = file.read((first + at) as u64, part, Format::Nanoscope)?;
            has_more_bits = encoding(width).all(&raw).any(|of| of.abs() >= limit);
            at += part;
        }
        if has_more_bits {
            factor /= MORE_BITS;
        }
        // `S [Code] "Name"`
        let label = setting(section, "Image Data").unwrap_or("");
        let name = label.split('"').nth(1).unwrap_or(label).to_owned();
        Ok(Self {
            name,
            unit,
            first,
            count,
            width,
            factor,
            has_more_bits,
        })
    }

    fn values(&self, file: &Source, from: usize, count: usize) -> Result<Vec<f64>, Error> {
        let first = self.first + from * self.width;
        let raw = file.read(first as u64, count * self.width, Format::Nanoscope)?;
        let numbers = encoding(self.width).all(&raw);
        Ok(numbers.map(|of| of * self.factor).collect())
    }

    fn end(&self) -> usize {
        self.first + self.count * self.width
    }
}

fn encoding(width: usize) -> Encoding {
    Encoding::little(Number::Signed(width))
}

/// The curves of a file.
#[derive(Debug)]
struct Curves {
    file: Source,
    channels: Vec<Data>,
    /// Points of approach, hold and retract.
    points: [usize; 3],
    count: usize,
    /// Travel of the ramp (m).
    ramp: Option<f64>,
    /// Duration of half a period (s).
    duration: Option<f64>,
    hold_time: Option<f64>,
    lever: Lever,
    /// Of the only curve.
    position: Option<[f64; 2]>,
    grid: Option<Grid>,
}

pub(crate) fn read(file: Source, limits: Limits) -> Result<Document, Error> {
    let header = Header::parse(&file.beginning(MAX_HEADER, Format::Nanoscope)?)?;
    let mut document = Document::new(Format::Nanoscope, limits);
    let context = ["file list", "force file list"]
        .iter()
        .find_map(|of| header.text(of, "Start context"));
    context.unwrap_or("").clone_into(&mut document.kind);
    document.settings = settings(&header);
    let budget = &mut Budget::new(limits);
    let lists = header.lists("ciao image list");
    at_most(lists.len(), MAX_CHANNELS, "images in a file")?;
    let mut places = Vec::new();
    let mut shape = None;
    for section in lists {
        let sides = [
            whole(section, "Samps/line")?,
            whole(section, "Number of lines")?,
        ];
        let count = sides[0].saturating_mul(sides[1]);
        budget.numbers(count)?;
        let data = Data::find(&header, &file, section, count, false)?;
        places.push((data.first, data.end()));
        shape = shape.or(Some((sides, scan_size(&header, section))));
        if data.has_more_bits {
            document.notes.push(format!(
                "the image `{}` has numbers with more bits than stated; its scale is not certain",
                data.name
            ));
        }
        let values = data.values(&file, 0, count)?;
        // The first line in the file is the lowest.
        let image = Image::new(
            &*data.name,
            &data.unit,
            sides,
            scan_size(&header, section),
            values,
        );
        document.images.push(image.flipped());
    }
    let is_volume = header
        .text("ciao scan list", "Operating mode")
        .is_some_and(|of| of.starts_with("Force Volume"));
    let grid = shape.filter(|_| is_volume).map(|(shape, size)| Grid {
        shape,
        size: size.unwrap_or([0.0; 2]),
        centre: ["X Offset", "Y Offset"]
            .map(|key| header.length("ciao scan list", key).unwrap_or(0.0)),
        angle: 0.0,
        back_and_forth: false,
    });
    let lists = header.lists("ciao force image list");
    if !lists.is_empty() {
        at_most(lists.len(), MAX_CHANNELS, "channels in a curve")?;
        let curves = curves(
            &header,
            file,
            &lists,
            grid,
            &mut places,
            &mut document.notes,
        )?;
        document.grid = grid;
        document.curves = Box::new(curves);
    } else if document.images.is_empty() {
        let content = "a Bruker file without curves and images";
        return Err(Format::Nanoscope.unsupported(content, "only those are read"));
    }
    places.sort_unstable();
    places.dedup();
    if let Some(two) = places.windows(2).find(|two| two[1].0 < two[0].1) {
        let problem = format!(
            "the data at byte {} are in those at byte {}",
            two[1].0, two[0].0
        );
        return Err(damaged(
            "Data offset",
            problem,
            "separate or identical places",
        ));
    }
    Ok(document)
}

/// Settings of all sections, by `section\key`.
fn settings(header: &Header) -> Vec<(String, String)> {
    let named = header.sections.iter().flat_map(|(name, section)| {
        section
            .iter()
            .map(move |(key, value)| (format!(r"{name}\{key}"), value.clone()))
    });
    named.collect()
}

/// Width and height of an image (m), from `505.859 505.859 nm` or `2000 nm`.
fn scan_size(header: &Header, section: &Section) -> Option<[f64; 2]> {
    let own = section.get("Scan Size").map(String::as_str);
    let text = own.or_else(|| header.text("ciao scan list", "Scan Size"))?;
    let (width, rest) = leading_number(text)?;
    let (height, unit) = leading_number(rest).unwrap_or((width, rest));
    let (factor, unit) = si(unit);
    (unit == "m").then_some([width * factor, height * factor])
}

fn curves(
    header: &Header,
    file: Source,
    lists: &[&Section],
    grid: Option<Grid>,
    places: &mut Vec<(usize, usize)>,
    notes: &mut Vec<String>,
) -> Result<Curves, Error> {
    let force = "ciao force list";
    let samples = lists[0].get("Samps/line").map_or("", String::as_str);
    let mut sides = samples
        .split_whitespace()
        .map(|of| of.parse::<usize>().ok());
    let retract = sides.next().flatten().filter(|of| *of > 0);
    let retract = retract.ok_or_else(|| {
        damaged(
            "Samps/line",
            format!("the value `{samples}`"),
            "points of a curve",
        )
    })?;
    let approach = sides
        .next()
        .flatten()
        .filter(|of| *of > 0)
        .unwrap_or(retract);
    let hold = header.number(force, "Hold Samples").unwrap_or(0.0).max(0.0) as usize;
    let total = approach.saturating_add(hold).saturating_add(retract);
    let count = grid.map_or(1, |of| of.shape[0].saturating_mul(of.shape[1]));
    at_most(count, MAX_CURVES, "curves in a file")?;
    let mut channels: Vec<Data> = Vec::new();
    for section in lists {
        let data = Data::find(header, &file, section, total.saturating_mul(count), true)?;
        places.push((data.first, data.end()));
        if channels.iter().all(|of| of.name != data.name) {
            channels.push(data);
        } else {
            notes.push(format!("a second channel `{}` is left out", data.name));
        }
    }
    let ramp = setting(lists[0], "Ramp size").map(Setting::parse);
    let ramp = ramp.and_then(|of| Some(of.value? * header.scale(of.soft_scale?).0));
    let velocity = header.number(force, "Forward vel.");
    let velocity = velocity.map(|of| of * header.scale("Sens. Zsens").0);
    let rate = header.number(force, "Scan rate");
    let duration = ramp.zip(velocity).map(|(ramp, velocity)| ramp / velocity);
    let duration = duration
        .or(rate.map(|of| 0.5 / of))
        .filter(|of| of.is_finite() && *of > 0.0);
    let (sensitivity, unit) = header.scale("Sens. DeflSens");
    let spring_constant = lists.iter().find_map(|of| of.get("Spring Constant"));
    let offset = |key: &str| header.length("ciao scan list", key);
    if header.text("ciao scan list", "PeakForce Capture") == Some("Allow") {
        notes.push(
            "a PeakForce capture stores no height: a ramp stands for the sine of the real motion"
                .to_owned(),
        );
    }
    let curves = Curves {
        file,
        channels,
        points: [approach, hold, retract],
        count,
        ramp: ramp.filter(|of| *of > 0.0),
        duration,
        hold_time: header.number(force, "Hold Time"),
        lever: Lever {
            spring_constant: spring_constant
                .and_then(|of| number(of))
                .filter(|of| *of > 0.0),
            sensitivity: (unit == "m" && sensitivity > 0.0).then_some(sensitivity),
        },
        position: grid
            .is_none()
            .then(|| offset("X Offset").zip(offset("Y Offset")))
            .flatten()
            .map(|(x, y)| [x, y]),
        grid,
    };
    curves.check_trigger(header, notes)?;
    Ok(curves)
}

impl Curves {
    /// Where numbers have more bits than stated, the largest deflection must be near the trigger.
    fn check_trigger(&self, header: &Header, notes: &mut Vec<String>) -> Result<(), Error> {
        let Some(data) = self
            .channels
            .iter()
            .find(|of| of.has_more_bits && NAMES.deflection.contains(&of.name.as_str()))
        else {
            return Ok(());
        };
        notes.push(format!(
            "`{}` has numbers with 8 more bits than stated",
            data.name
        ));
        let key = "Trig Threshold Deflection";
        let threshold = header
            .section("ciao force list")
            .and_then(|of| setting(of, key))
            .map(Setting::parse);
        let threshold = threshold.and_then(|of| Some(of.value? * header.scale(of.soft_scale?).0));
        let Some(threshold) = threshold.filter(|of| *of > 0.0) else {
            return Ok(());
        };
        let approach = data.values(&self.file, 0, self.points[0])?;
        let highest = approach.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let ratio = (highest - approach.last().unwrap_or(&0.0)) / threshold;
        if (0.5..=2.0).contains(&ratio) {
            return Ok(());
        }
        let problem = format!("the first curve's deflection reaches {ratio:.3} times this trigger");
        Err(damaged(&format!("@4:{key}"), problem, "0.5 to 2 times"))
    }
}

impl CurveSource for Curves {
    fn count(&self) -> usize {
        self.count
    }

    fn curve(&self, number: usize, limits: Limits) -> Result<Curve, Error> {
        let mut curve = self.lever.curve(number, self.grid.as_ref());
        curve.position = curve.position.or(self.position);
        let budget = &mut Budget::new(limits);
        let total: usize = self.points.iter().sum();
        let mut from = number * total;
        let styles = [Style::Approach, Style::Pause, Style::Retract];
        for (style, points) in styles.into_iter().zip(self.points) {
            if points == 0 {
                continue;
            }
            budget.numbers(points.saturating_mul(self.channels.len() + 1))?;
            let mut channels = Vec::new();
            for data in &self.channels {
                let mut values = data.values(&self.file, from, points)?;
                // The approach is stored from the contact outwards.
                if style == Style::Approach {
                    values.reverse();
                }
                channels.push(Channel::new(&*data.name, &data.unit, values));
            }
            if let Some(ramp) = self.ramp {
                let height = (0..points).map(|k| {
                    let travelled = k as f64 * ramp / points as f64;
                    match style {
                        Style::Approach => travelled,
                        Style::Retract => ramp - travelled,
                        _ => ramp,
                    }
                });
                channels.push(Channel::new(RAMP, "m", height.collect()));
            }
            curve.segments.push(Segment {
                style,
                label: String::new(),
                duration: if style == Style::Pause {
                    self.hold_time
                } else {
                    self.duration
                },
                channels,
            });
            from += points;
        }
        finish(&mut curve, &NAMES);
        Ok(curve)
    }

    fn pixel(&self, number: usize, _: Limits) -> Option<usize> {
        self.grid.map(|_| number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_with_and_without_their_parts_are_read() {
        let whole = Setting::parse("V [Sens. Zsens] (0.006713867 V/LSB) 440.0000 V");
        assert_eq!(whole.soft_scale, Some("Sens. Zsens"));
        assert_eq!(whole.hard_scale, Some(0.006713867));
        assert_eq!((whole.value, whole.unit), (Some(440.0), "V"));
        let parentheses =
            Setting::parse("V [Sens. L] (0.0004882813 log(Arb)/LSB)       0 log(Arb)");
        assert_eq!(
            (parentheses.value, parentheses.unit),
            (Some(0.0), "log(Arb)")
        );
        assert_eq!(Setting::parse("V 27.39000").value, Some(27.39));
        assert_eq!(Setting::parse("S [Code] \"Name\""), Setting::default());
    }
}
