//! Random levers, laws, sums of laws and starts with one to ten modes: the flow compared with an
//! independent integrator of order 16 with events, its Jacobian with central differences.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod common;
#[path = "common/extrapolation.rs"]
mod extrapolation;
#[path = "common/random.rs"]
mod random;

use common::{beam, beam_modes, value};
use extrapolation::Plain;
use nalgebra::DMatrix;
use nanotap_volterra::laws::curve::Interpolation;
use nanotap_volterra::laws::entry::{Entry, Part};
use nanotap_volterra::laws::table::{self, Rows};
use nanotap_volterra::laws::{self, TableLaw, build_sum};
use nanotap_volterra::{Flow, ForceLaw};
use random::Random;
use std::f64::consts::TAU;
use std::sync::Arc;

/// A law of the table with every parameter between two thirds and three halves of its usual value.
fn law(random: &mut Random, of: &'static TableLaw) -> (&'static Entry, Arc<dyn ForceLaw>) {
    let mut parameters: Vec<f64> = Vec::new();
    for parameter in of.entry.parameters {
        let near = value(parameter.name) * 1.5_f64.powf(random.next());
        // Separation takes more work than the attraction gave.
        let near = match parameter.name {
            "work_of_retraction" => near + 0.01,
            "gap_factor" | "force_factor" | "damping_factor" => 1.0 + 0.3 * random.next(),
            _ => near,
        };
        assert!(parameter.range.holds(near), "{} = {near}", parameter.name);
        parameters.push(near);
    }
    let built = if of.has_rows() {
        // A potential well with steps of random width.
        let mut gap = -3.0;
        let points: Vec<(f64, f64)> = (0..12)
            .map(|_| {
                gap += 0.5 + 0.4 * random.next();
                let wall: f64 = if gap < 0.2 { 4.0 * (0.2 - gap) } else { 0.0 };
                (gap, wall - 0.6 * (-(gap - 0.2).powi(2)).exp())
            })
            .collect();
        let damping: Vec<f64> = points.iter().map(|(gap, _)| 0.02 / (4.0 + gap)).collect();
        let [plain, damped] = [&[][..], &damping].map(|all| Rows::damped(&points, all).unwrap());
        let rows = if random.next() > 0.0 { damped } else { plain };
        let by = Interpolation::ALL[((1.0 + random.next()) * 1.5) as usize % 3];
        of.through(&rows.by(by), &parameters)
    } else {
        of.with(&parameters)
    };
    (of.entry, built.unwrap())
}

/// A law, with an elastic contact if it has none, and sometimes with dissipation.
fn sum(random: &mut Random, of: &'static TableLaw) -> (String, Arc<dyn ForceLaw>) {
    let mut terms = vec![law(random, of)];
    if !of.entry.parts.contains(&Part::Elasticity) {
        terms.push(law(random, laws::law("hertz").unwrap()));
    }
    if random.next() > 0.5 && of.entry.name != "exponential-damping" {
        terms.push(law(random, laws::law("exponential-damping").unwrap()));
    }
    let names: Vec<&str> = terms.iter().map(|(entry, _)| entry.name).collect();
    (names.join(" + "), build_sum(&terms).unwrap())
}

struct Case {
    name: String,
    law: Arc<dyn ForceLaw>,
    modes: usize,
    k: f64,
    q: f64,
    amplitude: f64,
    zc: f64,
    x: Vec<f64>,
}

impl Case {
    fn new(random: &mut Random, of: &'static TableLaw, modes: usize) -> Self {
        let (name, law) = sum(random, of);
        let mut x = vec![0.0; 2 * modes];
        // The tip enters from outside and swings through the surface: a start inside a hard contact
        // would be ejected too fast.
        let swing = 7.0 + 2.0 * random.next();
        let part = 0.3 + 0.6 * random.next();
        x[0] = swing * part;
        x[modes] = swing * (1.0 - part * part).sqrt() * random.next().signum();
        for n in 1..modes {
            x[n] = 0.2 * random.next() / (n * n) as f64;
            x[modes + n] = random.next() / n as f64;
        }
        Self {
            name,
            law,
            modes,
            k: 1.0 + 0.5 * random.next(),
            q: 50.0 + 45.0 * random.next(),
            amplitude: 10.0 + 3.0 * random.next(),
            zc: swing * (0.8 + 0.12 * random.next()),
            x,
        }
    }

    fn flow(&self) -> Flow {
        let Self {
            law,
            modes,
            k,
            q,
            amplitude,
            zc,
            ..
        } = self;
        Flow::new(Arc::new(beam(
            law.clone(),
            *modes,
            *k,
            *q,
            *amplitude,
            *zc,
            20,
        )))
    }

    /// The state after a period, and the number of switches.
    fn end(&self, x: &[f64]) -> (Vec<f64>, u64) {
        let mut flow = self.flow();
        flow.start(x, 0.0).unwrap();
        flow.run_until(TAU).unwrap();
        let mut out = vec![0.0; x.len()];
        flow.state(&mut out);
        (out, flow.statistics().switches)
    }

    /// Velocities of high modes are large: each is scaled by its mode's frequency.
    fn scaled(&self, x: &[f64]) -> Vec<f64> {
        let rates = beam_modes(self.modes, self.q);
        let rate = |k: usize| match k.checked_sub(self.modes) {
            Some(n) => rates[n].0.sqrt(),
            None => 1.0,
        };
        x.iter().enumerate().map(|(k, x)| x / rate(k)).collect()
    }

    /// The error against the independent integrator.
    fn error(&self) -> f64 {
        let plain = Plain {
            law: self.law.as_ref(),
            modes: beam_modes(self.modes, self.q),
            k: self.k,
            drive: self.amplitude / self.q,
            zc: self.zc,
        };
        let mut theirs = self.x.clone();
        let switches = plain.run(&mut theirs, TAU);
        let (ours, own) = self.end(&self.x);
        assert_eq!(own, switches as u64, "{}, {} modes", self.name, self.modes);
        let pairs = self.scaled(&ours).into_iter().zip(self.scaled(&theirs));
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// The largest error of the Jacobian over its largest entry, both scaled by the modes'
    /// frequencies; `None` if a contact begins or ends within the differences.
    fn jacobian_error(&self) -> Option<f64> {
        let n = self.x.len();
        let (mut jacobian, mut none) = (DMatrix::zeros(n, n), DMatrix::zeros(n, 0));
        let mut flow = self.flow();
        flow.start(&self.x, 0.0).unwrap();
        flow.run_with_derivatives(TAU, &[], &mut jacobian, &mut none)
            .unwrap();
        let count = flow.statistics().switches;
        let unit = self.scaled(&vec![1.0; n]);
        let mut columns = Vec::new();
        for c in 0..n {
            // The displacement in this direction that moves the gap by a nanometre.
            let h = 2e-6 / unit[c];
            let moved = |h: f64| {
                let mut x = self.x.clone();
                x[c] += h;
                self.end(&x)
            };
            let [a, b, d, e] = [-2.0, -1.0, 1.0, 2.0].map(|k| moved(k * h));
            if [a.1, b.1, d.1, e.1]
                .iter()
                .any(|switches| *switches != count)
            {
                return None;
            }
            let exact: Vec<f64> = jacobian.column(c).iter().copied().collect();
            let estimate: Vec<f64> = (0..n)
                .map(|i| (a.0[i] - 8.0 * b.0[i] + 8.0 * d.0[i] - e.0[i]) / (12.0 * h))
                .collect();
            let by_size =
                |v: Vec<f64>| -> Vec<f64> { self.scaled(&v).iter().map(|v| v / unit[c]).collect() };
            columns.push((by_size(exact), by_size(estimate)));
        }
        let pairs = || {
            columns
                .iter()
                .flat_map(|(exact, found)| exact.iter().zip(found))
        };
        let size = pairs().map(|(a, _)| a.abs()).fold(0.0, f64::max);
        let worst = pairs().map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        Some(worst / size)
    }
}

fn check(count: usize, mut random: Random) {
    let plain = laws::all().filter(|law| !law.has_arms() && !law.needs_formula());
    let all: Vec<&'static TableLaw> = plain.collect();
    assert_eq!(all.last().unwrap().entry.name, table::TABLE.entry.name);
    let (mut worst, mut worst_jacobian, mut touched, mut jacobians) = (0.0_f64, 0.0_f64, 0, 0);
    for k in 0..count {
        // 11 and 3 have no common factor with the numbers of laws and modes: all pairs occur.
        let case = Case::new(&mut random, all[11 * k % all.len()], 1 + 3 * k % 10);
        let what = format!("case {k}: {}, {} modes", case.name, case.modes);
        let error = case.error();
        assert!(error < 1e-9, "{what}: {error:e}");
        worst = worst.max(error);
        touched += u32::from(case.end(&case.x).1 > 0);
        if let Some(error) = case.jacobian_error() {
            assert!(error < 1e-6, "{what}: the Jacobian is off by {error:e}");
            worst_jacobian = worst_jacobian.max(error);
            jacobians += 1;
        }
    }
    println!(
        "{count} cases, {touched} of them with switches: worst error {worst:e}; {jacobians} \
         Jacobians, worst {worst_jacobian:e}"
    );
    assert!(3 * touched as usize > 2 * count && 2 * jacobians > count);
}

#[test]
fn a_dozen_cases_agree_with_an_independent_integrator() {
    check(12, Random(20_260_201));
}

/// Over every law and every number of modes.
#[test]
#[ignore = "minutes; run it with --run-ignored only"]
fn two_hundred_cases_agree_with_an_independent_integrator() {
    check(200, Random::of_a_long_run(20_260_202));
}
