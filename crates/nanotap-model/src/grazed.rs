//! What the extrema of the gap graze: the switches of a nonlinear law.
//!
//! Most laws change where contact begins and ends, at one gap. One that remembers has switches
//! without a way back (a neck forms, a bridge ruptures): an extremum before such a switch grazes it
//! from one side, the first after it from the other.

use nanotap_volterra::{Exit, Extremum, Guard, Switch, System, Trajectory};

/// The extrema of the gap over a period, as times and values over what they can graze: `contact`,
/// unless a switch for good is nearer. The first one after such a switch stands twice.
pub(crate) fn grazed(
    system: &System,
    period: &Trajectory,
    contact: Option<f64>,
) -> Vec<(f64, f64)> {
    let mut found = Vec::new();
    let mut before = f64::NEG_INFINITY;
    for extremum in period.extrema(&period.gap_output()) {
        let ahead = switch_ahead(system, &extremum).or(contact);
        let mut switches = period.switches().iter();
        let last = switches.rfind(|s| s.time <= extremum.time && s.time > before);
        let passed = last.and_then(|switch| switch_passed(system, switch, &extremum));
        let levels = ahead.into_iter().chain(passed.filter(|_| passed != ahead));
        found.extend(levels.map(|level| (extremum.time, extremum.value - level)));
        before = extremum.time;
    }
    found
}

/// The gap at which the motion would leave its branch for good, were the extremum farther out.
fn switch_ahead(system: &System, extremum: &Extremum) -> Option<f64> {
    let exits = system.exits(extremum.branch).iter();
    let levels = exits
        .filter(|exit| is_for_good(system, extremum.branch, exit))
        .filter_map(|exit| match exit.guard {
            Guard::Falls(level) if !extremum.largest => Some(level),
            Guard::Rises(level) if extremum.largest => Some(level),
            _ => None,
        });
    // The one that is met first.
    if extremum.largest {
        levels.reduce(f64::min)
    } else {
        levels.reduce(f64::max)
    }
}

/// The gap of a switch, if it was one for good and the extremum after it lies on its way.
fn switch_passed(system: &System, switch: &Switch, extremum: &Extremum) -> Option<f64> {
    let exit = system.exits(switch.from).get(switch.exit)?;
    let level = match exit.guard {
        Guard::Falls(level) if !extremum.largest => level,
        Guard::Rises(level) if extremum.largest => level,
        _ => return None,
    };
    is_for_good(system, switch.from, exit).then_some(level)
}

/// Whether the branch that an exit leads to has no way back at the same gap.
fn is_for_good(system: &System, from: usize, exit: &Exit) -> bool {
    let back = match exit.guard {
        Guard::Falls(level) => Guard::Rises(level),
        Guard::Rises(level) => Guard::Falls(level),
        Guard::Turns | Guard::Own(_) => return false,
    };
    let mut ways = system.exits(exit.target).iter();
    !ways.any(|way| way.guard == back && way.target == from)
}
