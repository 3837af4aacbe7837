//! Jacobians and parameter derivatives against central differences, for every law.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod common;

use common::{beam, table_law as law, value};
use nalgebra::DMatrix;
use nanotap_volterra::laws::TABLE;
use nanotap_volterra::{Flow, ForceLaw, Parameter, System};
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
        // The first parameters are those of the law itself, a sum's second law comes after.
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
            // In a sum the two contacts would part.
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
