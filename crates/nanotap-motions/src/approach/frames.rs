//! The motions of a curve, its jumps and its bifurcations as tables.

use super::{ApproachPoint, ApproachReport, StateJump};
use nanotap_case::units::Units;
use nanotap_observe::frame::{AsCell as _, Cell, Form, Frame, Rows, columns, frame};
use nanotap_observe::{Dimension, ObservableSet};

/// Columns of the motions that are shown.
const MOTIONS: &str =
    "way,distance,motion,first_harmonic,A/A0,phase,dissipation,peak_force,contact_fraction";

/// Smallest relative uncertainty of a distance that is shown.
const SHOWN_UNCERTAINTY: f64 = 1e-9;

impl ApproachReport {
    /// All tables.
    pub(crate) fn tables(&self, units: Units) -> Vec<Frame<'_>> {
        vec![
            self.motion_table(units),
            self.jump_table(units),
            self.bifurcation_table(units),
        ]
    }

    /// The motions of both directions, then the coexisting ones.
    pub fn motion_table(&self, units: Units) -> Frame<'_> {
        let is_si = matches!(units, Units::Si(_));
        let distance = move |p: &ApproachPoint| p.zc.filter(|_| is_si).unwrap_or(p.gap);
        let rows = self.table.iter().chain(&self.coexisting);
        let rows = columns! { Rows::new("table", rows, Some(units));
            "way", "way", Plain => |p| p.way.name();
            self.parameter, "distance", (Length, Quantity([5, 4])) => distance;
            .si_name("zc");
            .in_si();
            "classification", "", Plain => |p| p.classification.name();
            "period", "", Plain => |p| p.period;
            "spectral_radius", "", Digits(4) => |p| p.spectral_radius;
            .observed(ObservableSet::COMMON, |p| p.observables.as_ref());
            if is_si { "A_ratio" } else { "" }, "A/A0", Digits(4) => |p| self.amplitude_ratio(p);
            "", "motion", Plain => ApproachPoint::motion;
            "", "open loop", Plain => |p| p.orbit.as_ref().map(|orbit| orbit.stability.name());
        };
        let Some(modulation) = &self.modulation else {
            return rows.shown(MOTIONS).frame();
        };
        let place = modulation.closest.map_or("distance", |_| "first_harmonic");
        let shown = format!(
            "way,{place},frequency_shift,relative_shift,first_order_shift,drive_ratio,dissipation,\
             peak_force,contact_fraction,open loop"
        );
        let rows = rows.fields(|p| p.modulation.as_ref()).shown(shown);
        rows.right(&["relative_shift", "first_order_shift"]).frame()
    }

    /// The jumps of the lever from one motion to another.
    pub fn jump_table(&self, units: Units) -> Frame<'_> {
        let before = |j: &'_ StateJump| Some(j.before.observables.as_ref()?.phase);
        let after = |j: &'_ StateJump| Some(j.after.observables.as_ref()?.phase);
        frame! { Rows::new("jumps", &self.jumps, Some(units));
            "way", "jump on", Plain => |j| j.way.name();
            "gap", "distance", (Length, Quantity([5, 4])) => |j| j.gap;
            "reason", "at", Plain => move |j| j.shown_reason(units);
            "before", "from", Plain => |j| j.before.motion();
            "ratio_before", "A/A0", Digits(4) => |j| self.amplitude_ratio(&j.before);
            "phase_before", "phase", (Angle, Digits(4)) => before;
            "after", "to", Plain => |j| j.after.motion();
            "ratio_after", "A/A0", Digits(4) => |j| self.amplitude_ratio(&j.after);
            "phase_after", "phase", (Angle, Digits(4)) => after;
        }
    }

    /// The bifurcations of the branches.
    pub fn bifurcation_table(&self, units: Units) -> Frame<'_> {
        let branches = self.branches.iter();
        let all = branches.flat_map(|branches| &branches.bifurcations);
        frame! { Rows::new("bifurcations", all, Some(units));
            "kind", "", Plain => |b| b.kind;
            "parameter", "distance", (Length, Quantity([5, 4])) => |b| b.parameter;
            "period", "period", Plain => |b| b.period;
            .observed(ObservableSet::FIRST_HARMONIC, |b| Some(&b.observables));
        }
    }

    /// Amplitude of a motion over the free amplitude.
    fn amplitude_ratio(&self, p: &ApproachPoint) -> Option<f64> {
        let in_si = p.physical.as_ref().map(|motion| motion.amplitude_ratio);
        in_si.or_else(|| Some(p.observables.as_ref()?.first_harmonic / self.free_amplitude))
    }
}

impl StateJump {
    /// The reason, with the uncertainty of the distance if it is large.
    fn shown_reason(&self, units: Units) -> String {
        if self.uncertainty <= SHOWN_UNCERTAINTY * self.gap.abs() {
            return self.reason.clone();
        }
        let within = Form::Quantity([5, 4]).shown(Dimension::Length, units, self.uncertainty);
        format!("{} (within {within})", self.reason)
    }
}

impl ApproachPoint {
    /// Name of the motion: its period, or its classification.
    fn motion(&self) -> Cell {
        match self.period {
            Some(period) if self.reason.is_none() => format!("period {period}").cell(),
            _ => self.classification.name().cell(),
        }
    }
}
