//! Height of the tip and force against time, and force against height.

use nanotap_figures::{Axis, Band, Colour, DOUBLE_COLUMN, Figure, Legend, Line, Panel, Rule};

use crate::figure::motion::{contact_intervals, points_on};
use crate::figure::panels::time_axis;
use nanotap_case::physical::Kind;
use nanotap_case::units::Units;
use nanotap_model::Model;
use nanotap_model::recording::Recording;

/// One instant: time in drive periods, height over the undeformed sample, force on the tip.
type Instant = [f64; 3];

/// Height of the tip over the undeformed sample and force of the sample on it against time, and
/// one against the other, over the first `periods` drive periods.
pub fn contact_figure(
    model: &Model,
    recording: &Recording,
    periods: usize,
    units: &Units,
) -> Figure {
    let instants = instants(model, recording, periods as f64);
    let size = |k: usize| instants.iter().fold(0.0, |m: f64, i| m.max(i[k].abs()));
    let (length, length_unit) = units.axis(Kind::Length, size(1));
    let (force, force_unit) = units.axis(Kind::Force, size(2));
    let scale = [1.0, length, force];
    let curve = |x: usize, y: usize| {
        let points = instants
            .iter()
            .map(|i| (scale[x] * i[x], scale[y] * i[y]))
            .collect::<Vec<_>>();
        Line::new(points).colour(Colour::BLUE).width(0.8)
    };
    let height_axis = || Axis::linear("height over the sample").unit(&length_unit);
    let force_axis = || Axis::linear("force on the tip").unit(&force_unit);
    let contacts = contact_intervals(model, recording, periods as f64);
    let in_time = |y: Axis, line: Line| {
        let mut panel = Panel::new(time_axis(), y).legend(Legend::Above);
        if !contacts.is_empty() {
            panel = panel.with(Band::x(contacts.clone()).label("contact"));
        }
        panel.with(Rule::horizontal(0.0).width(0.3)).with(line)
    };
    Figure::new(1, 3)
        .width(DOUBLE_COLUMN)
        .height(58.0)
        .with(in_time(height_axis(), curve(0, 1)))
        .with(in_time(force_axis(), curve(0, 2)))
        .with(
            Panel::new(height_axis(), force_axis())
                .with(Rule::vertical(0.0).width(0.3))
                .with(curve(1, 2)),
        )
}

/// Instants that show every turn of every mode, and both ends of every contact.
fn instants(model: &Model, recording: &Recording, periods: f64) -> Vec<Instant> {
    let (end, period) = (periods * model.period(), model.period());
    let height = recording.curve(&model.height);
    let force = recording.force(model);
    let mut instants = Vec::new();
    for piece in height.pieces() {
        if piece.start >= end {
            break;
        }
        let count = points_on(&height, &piece, period);
        instants.extend((0..=count).map(|k| {
            let s = piece.length * k as f64 / count as f64;
            let time = (piece.start + s) / period;
            [time, height.on(&piece, s), force.on(&piece, s)]
        }));
    }
    instants
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::orbit::{OrbitOptions, orbit};
    use nanotap_model::cantilever::Cantilever;
    use nanotap_model::parameter::Parameter;

    #[test]
    fn the_force_is_zero_in_flight_and_spring_and_damper_in_contact() {
        let case = Cantilever::paper().with(Parameter::Omega, 3.0);
        let [alpha4, alpha6] = [Parameter::Alpha4, Parameter::Alpha6].map(|p| case.get(p));
        let model = nanotap_case::Case::from(case).model().unwrap();
        let found = orbit(&model, &OrbitOptions::default()).unwrap();
        let instants = instants(&model, &found.trajectory, found.period as f64);
        let touching = instants.iter().filter(|i| i[2] != 0.0).count();
        assert!(touching > 20 && touching < instants.len());
        for pair in instants.windows(2) {
            let [[t0, h0, f0], [t1, h1, f1]] = [pair[0], pair[1]];
            if f0 == 0.0 || f1 == 0.0 || t1 <= t0 {
                continue;
            }
            // F = −(α₄ h + α₆ dh/dτ), its mean over a short step by the trapezoidal rule.
            let rate = (h1 - h0) / ((t1 - t0) * model.period());
            let expected = -(alpha4 * 0.5 * (h0 + h1) + alpha6 * rate);
            let size = alpha4 * found.observables.gap_range[0].abs();
            assert!((0.5 * (f0 + f1) - expected).abs() < 1e-3 * size);
        }
    }
}
