//! Transients under every law, compared with an independent integrator of order 16 with events.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod common;
#[path = "common/extrapolation.rs"]
mod extrapolation;
#[path = "common/random.rs"]
mod random;

use common::{beam, beam_modes, dmt, table_law, value};
use extrapolation::Plain;
use nanotap_volterra::laws::curve::Interpolation;
use nanotap_volterra::laws::table::{ForceTable, Rows};
use nanotap_volterra::laws::{self, TABLE};
use nanotap_volterra::{Flow, ForceLaw};
use random::Random;
use std::f64::consts::TAU;
use std::sync::Arc;

/// The error after `periods` periods, and the numbers of switches of both.
fn compare(
    law: &Arc<dyn ForceLaw>,
    modes: usize,
    x: &[f64],
    zc: f64,
    periods: f64,
) -> (f64, [usize; 2]) {
    let (k, q, amplitude) = (1.0, 20.0, 10.0);
    let system = beam(law.clone(), modes, k, q, amplitude, zc, 20);
    let mut flow = Flow::new(Arc::new(system));
    flow.start(x, 0.0).unwrap();
    flow.run_until(periods * TAU).unwrap();
    let mut ours = vec![0.0; x.len()];
    flow.state(&mut ours);
    let plain = Plain {
        law: law.as_ref(),
        modes: beam_modes(modes, q),
        k,
        drive: amplitude / q,
        zc,
    };
    let mut theirs = x.to_vec();
    let switches = plain.run(&mut theirs, periods * TAU);
    // Velocities of high modes are large: each is scaled by its mode's frequency.
    let error = (0..modes)
        .map(|n| {
            let rate = plain.modes[n].0.sqrt();
            let z = (ours[n] - theirs[n]).abs();
            z.max((ours[modes + n] - theirs[modes + n]).abs() / rate)
        })
        .fold(0.0, f64::max);
    (error, [flow.statistics().switches as usize, switches])
}

fn start(random: &mut Random, modes: usize) -> Vec<f64> {
    let mut x = vec![0.0; 2 * modes];
    x[0] = 8.0 * random.next();
    x[modes] = 8.0 * random.next();
    for n in 1..modes {
        x[n] = 0.2 * random.next() / (n * n) as f64;
        x[modes + n] = random.next() / n as f64;
    }
    x
}

#[test]
fn of_random_starts_under_every_law() {
    let mut random = Random(20_260_101);
    let mut worst: f64 = 0.0;
    let mut cases = 0;
    for index in 0..TABLE.len() {
        let law = table_law(index, None);
        for modes in [1, 2, 3] {
            for _ in 0..3 {
                let x = start(&mut random, modes);
                // From well outside: a start inside a hard contact would be ejected too fast to be
                // meaningful.
                let zc = 6.0 + 2.0 * random.next() + (-x[0]).max(0.0);
                let (error, switches) = compare(&law, modes, &x, zc, 1.0);
                let name = TABLE[index].entry.name;
                assert_eq!(
                    switches[0], switches[1],
                    "{name}, {modes} modes, {x:?}, {zc}"
                );
                assert!(
                    error < 1e-10,
                    "{name}, {modes} modes: {error:e}, {x:?}, {zc}"
                );
                worst = worst.max(error);
                cases += 1;
            }
        }
    }
    println!("{cases} cases, worst error {worst:e}");
}

#[test]
fn of_ten_and_twenty_modes() {
    let mut random = Random(7);
    for name in ["dmt", "hertz", "voigt-sphere", "jkr"] {
        let index = TABLE.iter().position(|l| l.entry.name == name).unwrap();
        let law = table_law(index, None);
        for modes in [10, 20] {
            let mut x = start(&mut random, modes);
            // Into contact and out of it.
            (x[0], x[modes]) = (7.0, 2.0);
            let (error, switches) = compare(&law, modes, &x, 5.0, 0.9);
            assert_eq!(switches[0], switches[1], "{name}, {modes} modes");
            assert!(switches[0] >= 2, "{name}, {modes} modes: no contact");
            assert!(error < 2e-10, "{name}, {modes} modes: {error:e}");
        }
    }
}

/// A thousand rows of DMT contact: the spline through them takes about the evaluations of the law
/// itself, the polyline fifty times as many.
#[test]
fn a_spline_costs_about_as_much_as_its_law() {
    let law = dmt();
    let point = |k: i32| {
        let s = f64::from(k) / 999.0;
        let gap = -1.0 + 41.0 * s * s;
        (gap, law.value(law.branch_at(gap, 0.0), gap, 0.0))
    };
    let rows = Rows::new(&(0..1000).map(point).collect::<Vec<_>>()).unwrap();
    let end = |law: Arc<dyn ForceLaw>| {
        let mut flow = Flow::new(Arc::new(beam(law, 3, 0.9, 200.0, 20.0, 18.0, 20)));
        flow.start(&[7.0048, 0.0, 0.0, 17.1408, 0.0, 0.0], 0.0)
            .unwrap();
        flow.run_until(20.0 * TAU).unwrap();
        let mut x = [0.0; 6];
        flow.state(&mut x);
        (x[0], flow.statistics().evaluations as f64)
    };
    let (expected, cost) = end(law.clone());
    for (by, most, off) in [
        (Interpolation::Natural, 2.0, 1e-3),
        (Interpolation::Monotone, 2.0, 1e-3),
        (Interpolation::Linear, 80.0, 1e-2),
    ] {
        let (found, evaluations) = end(Arc::new(ForceTable::new(&rows.by(by))));
        println!(
            "{}: {} {:e}",
            by.name(),
            evaluations / cost,
            found - expected
        );
        assert!(
            evaluations < most * cost,
            "{}: {}",
            by.name(),
            evaluations / cost
        );
        assert!(
            (found - expected).abs() < off,
            "{}: {found} {expected}",
            by.name()
        );
    }
}

#[test]
fn a_polyline_converges_to_its_law_with_the_square_of_the_spacing() {
    let parameters: Vec<f64> = laws::law("dmt")
        .unwrap()
        .entry
        .parameters
        .iter()
        .map(|p| value(p.name))
        .collect();
    let smooth = laws::law("dmt").unwrap().with(&parameters).unwrap();
    let x = [6.0, 0.05, 3.0, 0.2];
    let end = |law: Arc<dyn ForceLaw>| {
        let system = beam(law, 2, 1.0, 20.0, 10.0, 6.5, 20);
        let mut flow = Flow::new(Arc::new(system));
        flow.start(&x, 0.0).unwrap();
        flow.run_until(TAU).unwrap();
        let mut out = [0.0; 4];
        flow.state(&mut out);
        out
    };
    let exact = end(smooth.clone());
    let mut errors = Vec::new();
    for count in [100, 200, 400, 800] {
        // Evenly spaced in the root of the distance from a0 on either side, where the law is
        // curved.
        let (a0, inner, outer) = (0.2, 4.0, 40.0);
        let mut points = Vec::new();
        for k in -count..=count {
            let s = f64::from(k) / f64::from(count);
            let gap = a0 + if k < 0 { -inner * s * s } else { outer * s * s };
            let branch = smooth.branch_at(gap, 0.0);
            points.push((gap, smooth.force(branch, gap, 0.0).value));
        }
        let rows = Rows::new(&points).unwrap();
        let found = end(Arc::new(ForceTable::new(&rows)));
        let error = found
            .iter()
            .zip(&exact)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        errors.push(error);
    }
    println!("{errors:?}");
    for pair in errors.windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((3.3..4.7).contains(&ratio), "{errors:?}");
    }
}
