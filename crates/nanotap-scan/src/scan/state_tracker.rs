//! In which of the states at the setpoint the lever is, and where it changes permanently.
//!
//! A state is a stable steady motion with the setpoint amplitude above one material. It is named by the
//! force that governs it, attractive or repulsive. The lever is in a state where that force governs
//! it while the amplitude is at the setpoint, and where Newton's method finds the steady motion from
//! its present state. A lever that flies behind an edge is governed by attraction, too, but off the
//! setpoint.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

use super::instrument::{Instrument, Interaction, Period};
use super::loop_response::SetpointState;
use super::options::Mode;
use super::plan::Plan;
use super::report::{BranchChange, Direction};

/// Fraction of the error beyond which the amplitude is off the setpoint, up to which the amplitude
/// has returned to it.
const AT_SETPOINT: f64 = 0.2;
/// Fewest periods for which the lever stays at the setpoint until its state counts.
const SHORTEST_STAY: f64 = 10.0;
/// Most periods of this stay.
const LONGEST_STAY: f64 = 1e5;
/// Largest number of changes that are recorded.
const MAX_CHANGES: usize = 10_000;

/// A material and whether attraction governs the motion above it.
type StateKey = (usize, bool);

const fn key(material: usize, interaction: Interaction) -> StateKey {
    (material, matches!(interaction, Interaction::Attractive))
}

/// Periods in sequence at the setpoint, under one governing force and above one material.
#[derive(Clone, Copy, Debug)]
struct Stay {
    interaction: Interaction,
    material: usize,
    periods: usize,
    /// Whether the amplitude has returned to the setpoint.
    returned: bool,
    /// Number of periods after which the state is searched for.
    due: usize,
}

/// Follows in which state the lever is.
#[derive(Clone, Debug)]
pub(super) struct StateTracker<'a> {
    plan: &'a Plan,
    /// Number of periods for which the lever stays at the setpoint until its state counts.
    stay: usize,
    known: BTreeMap<StateKey, SetpointState>,
    /// States that a lever from another material did not come to.
    absent: BTreeSet<StateKey>,
    /// The state that was confirmed last, and the material above which the lever was in it last.
    established: Option<(Interaction, usize)>,
    /// The first period in which another force governs than that of the state.
    departure: Option<BranchChange>,
    current: Option<Stay>,
    pub(super) changes: Vec<BranchChange>,
}

impl<'a> StateTracker<'a> {
    /// Creates the tracker for a lever whose disturbances fall by the factor e in so many periods.
    pub(super) fn new(plan: &'a Plan, lever_memory: f64) -> Self {
        let (time_constant, order) = plan.lock_in;
        let memory = lever_memory + time_constant * order as f64 / plan.period;
        Self {
            plan,
            stay: memory.ceil().clamp(SHORTEST_STAY, LONGEST_STAY) as usize,
            known: BTreeMap::new(),
            absent: BTreeSet::new(),
            established: None,
            departure: None,
            current: None,
            changes: Vec::new(),
        }
    }

    /// Returns the number of periods for which the lever stays at the setpoint until its state counts.
    pub(super) const fn stay(&self) -> usize {
        self.stay
    }

    /// Returns the distance in m of the lever's state at the setpoint above a material, that above
    /// another material where it was not above this one.
    pub(super) fn distance(&self, material: usize) -> Option<f64> {
        let (interaction, home) = self.established?;
        let state = self.known.get(&key(material, interaction));
        let state = state.or_else(|| self.known.get(&key(home, interaction)));
        state.map(|state| state.gap * self.plan.length_unit)
    }

    /// Takes in a period after which the instrument is in this state.
    pub(super) fn add(
        &mut self,
        k: usize,
        line: usize,
        direction: Direction,
        period: &Period,
        instrument: &Instrument<'_>,
    ) {
        if self.plan.mode == Mode::ConstantHeight {
            return;
        }
        let to = period.interaction;
        if !matches!(to, Interaction::Attractive | Interaction::Repulsive) {
            self.current = None;
            return;
        }
        match self.established {
            Some((from, _)) if from == to => self.departure = None,
            Some((from, _)) if self.departure.is_none() => {
                self.departure = Some(BranchChange {
                    k,
                    line,
                    direction,
                    x: period.x,
                    from,
                    to,
                    // Known once the change is confirmed.
                    height_change: f64::NAN,
                    distance_from: f64::NAN,
                    distance_to: f64::NAN,
                    material: None,
                    until_k: None,
                    until_x: None,
                });
            }
            _ => {}
        }
        let off = self.plan.off_setpoint();
        if period.error.abs() > off {
            self.current = None;
            return;
        }
        let same = |stay: &Stay| stay.interaction == to && stay.material == period.material;
        let mut stay = self.current.filter(same).unwrap_or(Stay {
            interaction: to,
            material: period.material,
            periods: 0,
            returned: false,
            due: self.stay,
        });
        stay.periods += 1;
        stay.returned |= period.error.abs() <= AT_SETPOINT * off;
        let is_due = stay.returned && stay.periods >= stay.due;
        if is_due {
            // Where no state is found, the search is repeated when the stay is twice as long.
            stay.due = 2 * stay.periods;
        }
        self.current = Some(stay);
        if is_due {
            self.confirm(period, instrument);
        }
    }

    /// Takes the state of a lever that stays at the setpoint, if there is a steady motion near it.
    fn confirm(&mut self, period: &Period, instrument: &Instrument<'_>) {
        let (to, here) = (period.interaction, period.material);
        let plan = self.plan;
        if let Entry::Vacant(unknown) = self.known.entry(key(here, to)) {
            let mut lever = instrument.lever_above(here);
            let gap = (period.z - period.surface) / plan.length_unit;
            let found = SetpointState::near(plan, &mut lever, instrument.lever_state(), gap);
            let Some(found) = found.filter(|found| found.interaction == to) else {
                return;
            };
            unknown.insert(found);
        }
        if let (Some((from, home)), Some(change)) = (self.established, self.departure.take()) {
            if let Some(last) = self.changes.last_mut() {
                (last.until_k, last.until_x) = (Some(change.k), Some(change.x));
            }
            let compared = self.compared([from, to], [here, home], instrument);
            if let Some((material, [before, after])) =
                compared.filter(|_| self.changes.len() < MAX_CHANGES)
            {
                let [before, after] = [before, after].map(|gap| gap * plan.length_unit);
                self.changes.push(BranchChange {
                    height_change: after - before,
                    distance_from: before,
                    distance_to: after,
                    material,
                    ..change
                });
            }
        }
        self.established = Some((to, here));
    }

    /// Returns the distances of two states at the setpoint, in the model's units, with the material
    /// above which both exist: that where the lever is now, or that where it was. Without such a
    /// material the distances are those above the two materials.
    fn compared(
        &mut self,
        [from, to]: [Interaction; 2],
        [here, home]: [usize; 2],
        instrument: &Instrument<'_>,
    ) -> Option<(Option<usize>, [f64; 2])> {
        for material in [here, home] {
            let before = self.gap_above(material, from, instrument);
            let after = self.gap_above(material, to, instrument);
            if let (Some(before), Some(after)) = (before, after) {
                return Some((Some(material), [before, after]));
            }
        }
        let before = self.known.get(&key(home, from))?.gap;
        let after = self.known.get(&key(here, to))?.gap;
        Some((None, [before, after]))
    }

    /// Returns the distance of a state above a material, from the same state above another material
    /// where the lever was not in it here.
    fn gap_above(
        &mut self,
        material: usize,
        interaction: Interaction,
        instrument: &Instrument<'_>,
    ) -> Option<f64> {
        let wanted = key(material, interaction);
        if let Some(known) = self.known.get(&wanted) {
            return Some(known.gap);
        }
        if self.absent.contains(&wanted) {
            return None;
        }
        let other = self
            .known
            .iter()
            .find(|((_, attracts), _)| *attracts == wanted.1);
        let found = other.and_then(|(_, other)| {
            let mut lever = instrument.lever_above(material);
            let mut state = other.state.clone();
            lever.take_over(&mut state);
            SetpointState::near(self.plan, &mut lever, &state, other.gap)
        });
        let Some(found) = found.filter(|found| found.interaction == interaction) else {
            self.absent.insert(wanted);
            return None;
        };
        let gap = found.gap;
        self.known.insert(wanted, found);
        Some(gap)
    }
}
