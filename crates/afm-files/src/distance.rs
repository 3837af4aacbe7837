//! The last step of every curve: its distance and deflection, and the notes on both.

use std::fmt::Write;

use crate::document::{Curve, Distance, DistanceSource, Segment, Style};

/// Whether a channel is a force by its name.
fn is_force(name: &str) -> bool {
    name.eq_ignore_ascii_case("force")
}

/// Names of a format's channels, by preference.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Names {
    pub(crate) measured: &'static [&'static str],
    pub(crate) commanded: &'static [&'static str],
    pub(crate) ramp: &'static [&'static str],
    pub(crate) deflection: &'static [&'static str],
    /// Whether the distance of this format grows when the tip moves towards the sample.
    pub(crate) grows_toward_surface: bool,
}

impl Names {
    fn of(&self, source: DistanceSource) -> &'static [&'static str] {
        match source {
            DistanceSource::Measured => self.measured,
            DistanceSource::Commanded => self.commanded,
            DistanceSource::Ramp => self.ramp,
        }
    }
}

/// Sources from the best to the worst.
const SOURCES: [DistanceSource; 3] = [
    DistanceSource::Measured,
    DistanceSource::Commanded,
    DistanceSource::Ramp,
];

/// Chooses distance and deflection: the first channel that every segment has. Adds what should be
/// known of them to the notes.
pub(crate) fn finish(curve: &mut Curve, names: &Names) {
    deflection_to_length(curve, names);
    let recorded: Vec<&Segment> = curve.segments.iter().filter(|of| of.points() > 0).collect();
    let is_common =
        |name: &&str| !recorded.is_empty() && recorded.iter().all(|of| of.channel(name).is_some());
    let first = |source| names.of(source).iter().copied().find(is_common);
    let chosen = SOURCES
        .into_iter()
        .find_map(|source| Some((source, first(source)?)));
    let mut notes = Vec::new();
    if let Some((source, channel)) = chosen {
        let lower = SOURCES.into_iter().filter(|of| *of > source);
        let commanded = lower.into_iter().find_map(first);
        let grows = grows_toward_surface(&recorded, channel);
        if grows.is_some_and(|grows| grows != names.grows_toward_surface) {
            notes.push(format!(
                "the distance `{channel}` runs against the direction that is usual in this format"
            ));
        }
        notes.push(note_on_distance(&recorded, source, channel, commanded));
        curve.distance = Some(Distance {
            channel: channel.to_owned(),
            source,
            commanded: commanded.map(str::to_owned),
            grows_toward_surface: grows.unwrap_or(names.grows_toward_surface),
        });
    } else if !recorded.is_empty() {
        notes.push("no channel is a distance in every segment".to_owned());
    }
    curve.deflection = names
        .deflection
        .iter()
        .copied()
        .find(is_common)
        .map(str::to_owned);
    if let Some(name) = &curve.deflection
        && let Some(channel) = recorded.iter().find_map(|of| of.channel(name))
    {
        if channel.unit != "m" && !is_force(&channel.name) {
            let (unit, missing) = match channel.unit.as_str() {
                "N" => ("N", "spring constant"),
                "" => ("no unit", "sensitivity (InvOLS)"),
                unit => (unit, "sensitivity (InvOLS)"),
            };
            notes.push(format!(
                "the deflection `{name}` is in {unit}: the file has no {missing}"
            ));
        }
        if curve.spring_constant.is_none() {
            notes.push("the file has no spring constant".to_owned());
        }
    }
    for segment in &recorded {
        for channel in &segment.channels {
            let bad = channel.values.iter().filter(|of| !of.is_finite()).count();
            if bad > 0 {
                notes.push(format!(
                    "{bad} of {} values of `{}` ({}) are not finite",
                    channel.values.len(),
                    channel.name,
                    segment.style
                ));
            }
        }
    }
    curve.notes.append(&mut notes);
}

/// Converts a deflection in V by the sensitivity, one in N by the spring constant. What is called a
/// force stays one.
fn deflection_to_length(curve: &mut Curve, names: &Names) {
    let (sensitivity, spring_constant) = (curve.sensitivity, curve.spring_constant);
    let channels = curve.segments.iter_mut().flat_map(|of| &mut of.channels);
    for channel in channels.filter(|of| names.deflection.contains(&of.name.as_str())) {
        let factor = match channel.unit.as_str() {
            "V" => sensitivity,
            "N" if !is_force(&channel.name) => spring_constant.map(|of| 1.0 / of),
            _ => None,
        };
        if let Some(factor) = factor {
            for value in &mut channel.values {
                *value *= factor;
            }
            "m".clone_into(&mut channel.unit);
        }
    }
}

fn travel(segment: &Segment, name: &str) -> Option<f64> {
    let values = &segment.channel(name)?.values;
    let travel = values.last()? - values.first()?;
    (travel.is_finite() && travel != 0.0).then_some(travel)
}

/// The direction of the distance, by the way that it runs in the approach or in the retract.
fn grows_toward_surface(segments: &[&Segment], name: &str) -> Option<bool> {
    let of_style = |style: Style, sign: f64| {
        let found = segments.iter().filter(|of| of.style == style);
        let runs = found.filter_map(|of| travel(of, name));
        runs.max_by(|a, b| a.abs().total_cmp(&b.abs()))
            .map(|travel| sign * travel > 0.0)
    };
    of_style(Style::Approach, 1.0).or_else(|| of_style(Style::Retract, -1.0))
}

/// Says which distance was taken, and how far it differs from the commanded one.
fn note_on_distance(
    segments: &[&Segment],
    source: DistanceSource,
    channel: &str,
    commanded: Option<&str>,
) -> String {
    let mut note = match source {
        DistanceSource::Measured => format!("the distance is the measured height `{channel}`"),
        DistanceSource::Commanded => format!(
            "the distance is the commanded height `{channel}`, no sensor measured it: creep and \
             hysteresis of the scanner are in it"
        ),
        DistanceSource::Ramp => format!(
            "the distance is a ramp `{channel}` computed from the header, no sensor measured it: creep \
             and hysteresis of the scanner are in it"
        ),
    };
    let spans = |segment: &&Segment| {
        Some((
            segment.style,
            travel(segment, channel)?.abs(),
            travel(segment, commanded?)?.abs(),
        ))
    };
    let moves = segments
        .iter()
        .filter(|of| matches!(of.style, Style::Approach | Style::Retract));
    if let (Some(name), Some((style, measured, other))) =
        (commanded, moves.copied().find_map(|of| spans(&of)))
    {
        let _ = write!(
            note,
            "; in the {style} it spans {:.4} µm where `{name}` spans {:.4} µm ({:+.1} %)",
            1e6 * measured,
            1e6 * other,
            100.0 * (measured / other - 1.0)
        );
    }
    note
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::Channel;

    const NAMES: Names = Names {
        measured: &["sensor", "other sensor"],
        commanded: &["height"],
        ramp: &["ramp"],
        deflection: &["deflection"],
        grows_toward_surface: false,
    };

    fn segment(style: Style, channels: &[(&str, [f64; 2])]) -> Segment {
        let channels = channels
            .iter()
            .map(|(name, values)| Channel::new(*name, "m", values.to_vec()));
        Segment {
            style,
            label: String::new(),
            duration: None,
            channels: channels.collect(),
        }
    }

    fn curve(segments: Vec<Segment>) -> Curve {
        let mut curve = Curve {
            segments,
            ..Curve::empty(0)
        };
        finish(&mut curve, &NAMES);
        curve
    }

    #[test]
    fn the_distance_is_a_channel_that_every_segment_has() {
        let curve = curve(vec![
            segment(
                Style::Approach,
                &[
                    ("sensor", [2.0, 1.0]),
                    ("other sensor", [3e-6, 1e-6]),
                    ("height", [2e-6, 1e-6]),
                ],
            ),
            segment(
                Style::Pause,
                &[("other sensor", [1e-6, 1e-6]), ("height", [1e-6, 1e-6])],
            ),
        ]);
        let distance = curve.distance.expect("a distance");
        assert_eq!(distance.channel, "other sensor");
        assert_eq!(distance.commanded.as_deref(), Some("height"));
        assert!(!distance.grows_toward_surface);
        assert!(
            curve.notes[0].contains("2.0000 µm where `height` spans 1.0000 µm (+100.0 %)"),
            "{:?}",
            curve.notes
        );
    }

    #[test]
    fn a_direction_against_the_format_is_seen_and_said() {
        let curve = curve(vec![segment(
            Style::Retract,
            &[("height", [2.0, 1.0]), ("deflection", [0.0, f64::NAN])],
        )]);
        assert!(curve.distance.expect("a distance").grows_toward_surface);
        assert!(curve.notes[0].contains("runs against"), "{:?}", curve.notes);
        assert!(
            curve.notes[1].contains("creep and hysteresis"),
            "{:?}",
            curve.notes
        );
        assert!(
            curve
                .notes
                .iter()
                .any(|of| of.contains("no spring constant"))
        );
        assert!(
            curve
                .notes
                .iter()
                .any(|of| of.contains("1 of 2 values of `deflection`"))
        );
    }
}
