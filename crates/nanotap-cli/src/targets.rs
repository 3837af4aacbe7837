//! The text of conditions on the motions of a sweep or a window, and of setpoints that are not reached.

use nanotap::case::Key;
use nanotap::case::physical::Kind;
use nanotap::study::sweep::{Over, Unreached};
use nanotap::study::target::TargetReport;

use crate::number;
use crate::page::paragraph;

/// A value of a parameter in words.
pub(crate) fn value(over: &Over, value: f64) -> String {
    match over.kind {
        // A fraction of a range has rounding errors in its last digits.
        Kind::Number if over.key == Key::DriveSetpoint => {
            number::chosen((1e9 * value).round() / 1e9)
        }
        Kind::Number => number::chosen(value),
        kind => kind.format(value),
    }
}

/// Where conditions hold, over these parameters.
pub(crate) fn text(found: &TargetReport, over: &[Over]) -> String {
    let count = found.holds.iter().flatten().count();
    let holding = found.holds.iter().flatten().filter(|holds| **holds).count();
    let conditions = found.conditions.join(" and ");
    let all = paragraph(&format!(
        "{conditions}: {} for every motion found at {holding} of {count} points ({} %)",
        if found.conditions.len() == 1 {
            "holds"
        } else {
            "hold"
        },
        number::significant(100.0 * found.share, 3),
    ));
    let Some(region) = &found.region else {
        return all;
    };
    let ranges = over.iter().zip(&region.ranges);
    let ranges = ranges.map(|(over, [low, high])| {
        let [low_text, high_text] = [low, high].map(|end| value(over, *end));
        if low == high {
            format!("{} = {low_text}", over.key.path())
        } else {
            format!("{} from {low_text} to {high_text}", over.key.path())
        }
    });
    // Of few points, each is at an edge.
    let mut sides = region.ranges.iter().zip(&region.centre);
    let is_inside = sides.all(|([low, high], at)| low == high || (at - low) * (at - high) < 0.0);
    let centre = over.iter().zip(&region.centre).filter(|_| is_inside);
    let centre = centre.map(|(over, at)| format!("{} = {}", over.key.path(), value(over, *at)));
    let [ranges, centre] = [ranges.collect::<Vec<_>>(), centre.collect()].map(|w| w.join(" and "));
    let farthest = if centre.is_empty() {
        String::new()
    } else {
        format!("; farthest from its edges is {centre}")
    };
    format!(
        "{all}{}",
        paragraph(&format!(
            "largest rectangle: {ranges}, {}{farthest}",
            number::counted(region.points, "point", "points"),
        ))
    )
}

/// Where the setpoint is not reached; empty if it is everywhere.
pub(crate) fn unreached(found: &[Unreached], over: &[Over]) -> String {
    let Some(first) = found.first() else {
        return String::new();
    };
    let at = over.iter().zip(&first.values);
    let at = at.map(|(over, at)| format!("{} = {}", over.key.path(), value(over, *at)));
    paragraph(&format!(
        "at {} there is no distance; at {}: {}",
        number::counted(found.len(), "point", "points"),
        at.collect::<Vec<_>>().join(" and "),
        first.reason
    ))
}
