//! Jacobians and parameter derivatives against central differences, for every law.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod common;

use common::{beam, table_law as law, value};
use nalgebra::DMatrix;
use nanotap_volterra::laws::TABLE;
use nanotap_volterra::{Flow, ForceLaw, Output, Parameter, System, Variation, VariedOutput};
use std::f64::consts::TAU;
use std::sync::Arc;

fn system(law: Arc<dyn ForceLaw>, zc: f64) -> System {
    beam(law, 2, 1.0, 20.0, 10.0, zc, 20)
}

fn end(system: System, x: &[f64]) -> Vec<f64> {
    let mut flow = Flow::new(Arc::new(system));
    flow.start(x, 0.0).unwrap();
    flow.run_until(TAU).unwrap();
    let mut out = vec![0.0; x.len()];
    flow.state(&mut out);
    out
}

#[test]
fn of_every_law() {
    let x = [6.5, 0.02, 3.0, 0.1];
    let zc = 5.0;
    let mut failed = Vec::new();
    for index in 0..TABLE.len() {
        let name = TABLE[index].entry.name;
        let base = Arc::new(system(law(index, None), zc));
        let mut flow = Flow::new(base.clone());
        flow.start(&x, 0.0).unwrap();
        // The first parameters are those of the law itself; those of a sum's second law follow.
        let count = TABLE[index].entry.parameters.len();
        let mut parameters = vec![Parameter::offset()];
        parameters.extend((0..count).map(|k| Parameter::of_law(&base, k)));
        let (mut jacobian, mut derivatives) = (DMatrix::zeros(4, 4), DMatrix::zeros(4, 1 + count));
        flow.run_with_derivatives(TAU, &parameters, &mut jacobian, &mut derivatives)
            .unwrap();
        if base.law().branches() > 1 {
            assert!(flow.statistics().switches >= 2, "{name} never switched");
        }
        let scale = jacobian.amax();
        let mut compare = |what: &str, exact: Vec<f64>, plus: Vec<f64>, minus: Vec<f64>, h: f64| {
            let size = exact.iter().fold(scale, |m: f64, v| m.max(v.abs()));
            for i in 0..4 {
                let difference = (plus[i] - minus[i]) / (2.0 * h);
                if (exact[i] - difference).abs() > 1e-6 * size {
                    failed.push(format!("{name}, {what}: {} {difference}", exact[i]));
                }
            }
        };
        for c in 0..4 {
            let h = 2e-6;
            let moved = |h: f64| {
                let mut x = x;
                x[c] += h;
                end(system(law(index, None), zc), &x)
            };
            let exact = jacobian.column(c).iter().copied().collect();
            compare(&format!("state {c}"), exact, moved(h), moved(-h), h);
        }
        let h = 2e-6;
        let moved = |h: f64| end(system(law(index, None), zc + h), &x);
        let exact = derivatives.column(0).iter().copied().collect();
        compare("offset", exact, moved(h), moved(-h), h);
        for k in 0..count {
            let parameter = TABLE[index].entry.parameters[k].name;
            // In a sum the two contacts would separate at different times.
            if parameter == "contact_distance" && base.law().parameters().len() > count {
                continue;
            }
            let h = 1e-5 * value(parameter).abs();
            let moved = |h: f64| end(system(law(index, Some((k, h))), zc), &x);
            let exact = derivatives.column(1 + k).iter().copied().collect();
            compare(parameter, exact, moved(h), moved(-h), h);
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// Values measured in a run, in a fixed order.
fn measured_values(system: System, x: &[f64]) -> Vec<f64> {
    let mut flow = Flow::new(Arc::new(system));
    flow.start(x, 0.0).unwrap();
    let motion = flow.record_until(TAU).unwrap();
    let gap = motion.gap_output();
    let c = motion.fourier(&gap, 2.0);
    let sums = motion.integrate(2, |s, out| {
        out[0] = s.force;
        out[1] = s.force * s.gap;
    });
    let [low, high] = [gap.clone(), force_output(4)].map(|output| motion.range(&output).0);
    let first = motion.fraction(|branch| branch == 0);
    let speeds: f64 = motion.switches().iter().map(|s| s.rate * s.rate).sum();
    vec![c.re, c.im, sums[0], sums[1], low, high, first, speeds]
}

fn force_output(dimension: usize) -> Output {
    Output {
        force: 1.0,
        row: nalgebra::RowDVector::zeros(dimension),
        offset: 0.0,
        tones: Vec::new(),
    }
}

/// The rate of the gap of the beam of [`system`], whose velocities follow its deflections.
fn rate_output(gap: &Output) -> Output {
    let half = gap.row.len() / 2;
    let mut rate = Output::component(2 * half, 0);
    rate.row.fill(0.0);
    for k in 0..half {
        rate.row[half + k] = gap.row[k];
    }
    rate
}

/// The same with derivatives, one column each.
fn varied(
    variation: &Variation,
    changes: &[VariedOutput; 3],
    count: usize,
) -> Vec<(f64, Vec<f64>)> {
    let mut sums = vec![(0.0, vec![0.0; count]); 4];
    variation.visit(changes, 2.0, |at| {
        let (sin, cos) = (2.0 * at.time).sin_cos();
        for (k, (value, by)) in sums.iter_mut().enumerate() {
            let [gap, force] = [at.values[0], at.values[1]];
            let scale = 1.0 / std::f64::consts::PI;
            let (number, by_gap, by_force, by_time) = match k {
                0 => (
                    scale * gap * cos,
                    scale * cos,
                    0.0,
                    -2.0 * scale * gap * sin,
                ),
                1 => (
                    -scale * gap * sin,
                    -scale * sin,
                    0.0,
                    -2.0 * scale * gap * cos,
                ),
                2 => (force, 0.0, 1.0, 0.0),
                _ => (force * gap, force, gap, 0.0),
            };
            *value += at.weight * number;
            for (c, by) in by.iter_mut().enumerate() {
                let change =
                    by_gap * at.change(0, c) + by_force * at.change(1, c) + by_time * at.shifts[c];
                *by += at.weight * change + number * at.widening[c];
            }
        }
    });
    let nodes = variation.motion().nodes();
    for output in &changes[..2] {
        let [low, _] = variation.range(&nodes, output);
        sums.push((low.value, low.changes));
    }
    let inside = |branch| branch == 0;
    let time = (0..count).map(|c| variation.time_on(c, inside) / TAU);
    sums.push((variation.motion().fraction(inside), time.collect()));
    let mut speeds = (0.0, vec![0.0; count]);
    for speed in variation.before_switches(&changes[2], |_, _| true) {
        speeds.0 += speed.value * speed.value;
        for (sum, by) in speeds.1.iter_mut().zip(&speed.changes) {
            *sum += 2.0 * speed.value * by;
        }
    }
    sums.push(speeds);
    sums
}

/// Integrals, Fourier coefficients, extrema, times and speeds at switches, compared with
/// differences of fourth order.
#[test]
fn of_measured_values_under_every_law() {
    let x = [6.5, 0.02, 3.0, 0.1];
    let zc = 5.0;
    let mut failed = Vec::new();
    for index in 0..TABLE.len() {
        let name = TABLE[index].entry.name;
        let base = Arc::new(system(law(index, None), zc));
        let mut flow = Flow::new(base.clone());
        flow.start(&x, 0.0).unwrap();
        let count = TABLE[index].entry.parameters.len();
        let own = base.law().parameters().len() == count;
        let mut parameters = vec![Parameter::offset()];
        parameters.extend((0..count).map(|k| Parameter::of_law(&base, k)));
        let columns = 4 + parameters.len();
        let mut starts = DMatrix::identity(4, columns);
        starts.columns_mut(4, parameters.len()).fill(0.0);
        let variation = flow
            .record_with_changes(TAU, &vec![0.0; columns], &starts, &parameters)
            .unwrap();
        let gap = variation.motion().gap_output();
        let mut changes = vec![
            Output {
                offset: 0.0,
                row: gap.row.scale(0.0),
                ..gap.clone()
            };
            columns
        ];
        for change in &mut changes {
            change.tones.clear();
        }
        changes[4].offset = 1.0;
        let outputs = [
            VariedOutput {
                value: gap.clone(),
                changes,
            },
            VariedOutput::fixed(force_output(4)),
            VariedOutput::fixed(rate_output(&gap)),
        ];
        let exact = varied(&variation, &outputs, columns);
        let values = measured_values(system(law(index, None), zc), &x);
        for (number, (value, _)) in exact.iter().enumerate() {
            if (value - values[number]).abs() > 1e-10 * values[number].abs().max(1.0) {
                failed.push(format!(
                    "{name}, value {number}: {value} {}",
                    values[number]
                ));
            }
        }
        for column in 0..columns {
            let moved = |h: f64| match column {
                0..4 => {
                    let mut x = x;
                    x[column] += h;
                    measured_values(system(law(index, None), zc), &x)
                }
                4 => measured_values(system(law(index, None), zc + h), &x),
                _ => measured_values(system(law(index, Some((column - 5, h))), zc), &x),
            };
            let h = if column < 5 {
                2e-4
            } else {
                let parameter = TABLE[index].entry.parameters[column - 5].name;
                // In a sum the two contacts would separate at different times.
                if parameter == "contact_distance" && !own {
                    continue;
                }
                2e-4 * value(parameter).abs()
            };
            let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(|side| moved(side * h));
            for (number, (_, by)) in exact.iter().enumerate() {
                let slope =
                    (a[number] - 8.0 * b[number] + 8.0 * c[number] - d[number]) / (12.0 * h);
                let size = by.iter().fold(1.0, |m: f64, v| m.max(v.abs()));
                if (by[column] - slope).abs() > 1e-6 * size {
                    failed.push(format!(
                        "{name}, number {number} by {column}: {} {slope}",
                        by[column]
                    ));
                }
            }
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
