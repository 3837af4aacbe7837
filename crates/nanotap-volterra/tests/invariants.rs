//! Invariants of closed orbits under every law.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod common;

use common::{Strobe, beam, beam_modes, table_law};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::{ShootingOptions, StroboscopicMap, close_orbit};
use nanotap_volterra::laws::{self, TABLE};
use nanotap_volterra::{Flow, VolterraError};
use std::f64::consts::TAU;
use std::sync::Arc;

const Q: f64 = 8.0;
const K: f64 = 1.0;
const AMPLITUDE: f64 = 10.0;

#[test]
fn energy_balance_determinant_and_mean_force() {
    let mut closed = 0;
    for index in 0..TABLE.len() {
        let name = TABLE[index].entry.name;
        for (modes, zc) in [(1, 8.0), (2, 7.0)] {
            let law = table_law(index, None);
            let conservative = law.conservative();
            let mut map = Strobe::new(beam(law, modes, K, Q, AMPLITUDE, zc, 20), TAU);
            let mut state = vec![0.0; 2 * modes];
            for _ in 0..60 {
                map.advance(&mut state).unwrap();
            }
            // A law with memory need not be out of contact at drive phase zero, and the motion need
            // not have period one: then there is nothing to balance.
            let Ok(orbit) = close_orbit(&mut map, &state, 1, &ShootingOptions::default()) else {
                continue;
            };
            closed += 1;
            map.flow.start(&orbit.states[0], 0.0).unwrap();
            let motion = map.flow.record_until(TAU).unwrap();
            let linear = beam_modes(modes, Q);
            // Work of the drive, loss of the modes, work of the law; mean force and static
            // deflection of the modes.
            let sums = motion.integrate(4, |s, out| {
                out.fill(0.0);
                for (n, (stiffness, damping, sign)) in linear.iter().enumerate() {
                    let (z, v) = (s.state[n], s.state[modes + n]);
                    out[0] += K * sign * AMPLITUDE / Q * s.time.cos() * v;
                    out[1] += K * damping * v * v;
                    if n == 0 {
                        out[3] = K * stiffness * sign * z;
                    }
                }
                out[2] = s.force;
            });
            let work = motion.work();
            let scale = sums[1];
            let residual = (sums[0] - sums[1] + work).abs() / scale;
            assert!(
                residual < 1e-9,
                "{name}, {modes} modes: energy {residual:e}"
            );
            let force_scale = motion.integrate(1, |s, out| out[0] = s.force.abs())[0].max(1e-3);
            let force = (sums[2] - sums[3]).abs() / force_scale;
            assert!(force < 1e-9, "{name}, {modes} modes: mean force {force:e}");
            if conservative {
                assert!(
                    work.abs() < 1e-9 * scale,
                    "{name} dissipates {work:e} of {scale:e}"
                );
                let trace: f64 = linear.iter().map(|m| m.1).sum();
                let error = (orbit.log_determinant + TAU * trace).abs();
                assert!(error < 1e-9, "{name}, {modes} modes: determinant {error:e}");
            } else if motion.fraction(|b| b == 0) < 1.0 {
                assert!(work < 1e-9 * scale, "{name} creates {work:e}");
            }
        }
    }
    assert!(closed > 40, "only {closed} of 50 motions closed");
}

#[test]
fn small_oscillations_in_steady_contact_are_those_of_a_spring() {
    // δ0 = 0.6 nm; E* = 0.4/(1 − 0.09), a rigid tip.
    let (radius, delta, a0) = (6.0_f64, 0.6_f64, 0.2);
    let modulus = 0.4 / (1.0 - 0.09);
    let spring = 2.0 * modulus * (radius * delta).sqrt();
    let force = 4.0 / 3.0 * modulus * radius.sqrt() * delta.powf(1.5);
    let law = laws::build(
        "hertz",
        &[
            ("modulus", 0.4),
            ("radius", radius),
            ("contact_distance", a0),
        ],
    )
    .unwrap();
    let drive = 1e-4;
    let zc = a0 - delta - force / K;
    let mut map = Strobe::new(beam(law, 1, K, Q, drive, zc, 20), TAU);
    let orbit = close_orbit(&mut map, &[force / K, 0.0], 1, &ShootingOptions::default()).unwrap();
    map.flow.start(&orbit.states[0], 0.0).unwrap();
    let motion = map.flow.record_until(TAU).unwrap();
    let found = motion.fourier(&nanotap_volterra::Output::component(2, 0), 1.0);
    let expected = nanotap_volterra::Complex::new(drive / Q, 0.0)
        / nanotap_volterra::Complex::new(spring / K, 1.0 / Q);
    assert!((found - expected).modulus() < 1e-8 * expected.modulus());
}

#[test]
fn a_stored_energy_is_the_force_s_potential() {
    for law in TABLE {
        let parameters: Vec<f64> = law
            .entry
            .parameters
            .iter()
            .map(|p| common::value(p.name))
            .collect();
        let law_of = law.with(&parameters).unwrap();
        for gap in [-1.5, -0.3, 0.1, 0.31, 0.9, 4.0] {
            let branch = law_of.branch_at(gap, 0.0);
            let h = 1e-5;
            let (Some(a), Some(b)) = (
                law_of.energy(branch, gap + h),
                law_of.energy(branch, gap - h),
            ) else {
                assert!(!law.entry.conservative, "{}", law.entry.name);
                continue;
            };
            if law.entry.name == "lennard-jones" && gap < 0.3 {
                continue;
            }
            let force = law_of.force(branch, gap, 0.0).value;
            assert!(
                ((b - a) / (2.0 * h) - force).abs() < 1e-6 * force.abs().max(1e-3),
                "{} at {gap}",
                law.entry.name
            );
        }
    }
}

#[test]
fn laws_that_cannot_be_added_are_refused() {
    let pair = |first: &str, second: &str| {
        let terms = [first, second].map(|name| {
            let law = laws::law(name).unwrap();
            let p: Vec<f64> = law
                .entry
                .parameters
                .iter()
                .map(|p| common::value(p.name))
                .collect();
            (law.entry, law.with(&p).unwrap())
        });
        laws::build_sum(&terms)
    };
    for (first, second) in [
        ("dmt", "van-der-waals"),
        ("jkr", "hertz"),
        ("hertz", "cone"),
        ("dlvo", "van-der-waals"),
        ("adhesion-hysteresis", "dmt"),
    ] {
        assert!(
            matches!(pair(first, second), Err(VolterraError::Sum { .. })),
            "{first} and {second}"
        );
    }
    assert!(pair("hertz", "van-der-waals").is_ok());
    assert!(pair("dmt", "viscous-contact").is_ok());
    assert!(matches!(
        laws::build("herz", &[]),
        Err(VolterraError::UnknownLaw { .. })
    ));
    for bad in [-1.0, 0.0, f64::NAN, f64::INFINITY] {
        let values = [("modulus", bad), ("radius", 5.0)];
        assert!(matches!(
            laws::build("hertz", &values),
            Err(VolterraError::Value { .. })
        ));
    }
}

#[test]
fn a_fall_into_a_singular_force_ends_with_a_reason() {
    let law = laws::build(
        "lennard-jones",
        &[("repulsion", 0.0), ("attraction", 0.3), ("radius", 10.0)],
    )
    .unwrap();
    let mut flow = Flow::new(Arc::new(beam(law, 2, K, Q, AMPLITUDE, 3.0, 20)));
    flow.start(&[-1.0, 0.0, -3.0, 0.0], 0.0).unwrap();
    let end = flow.run_until(TAU);
    assert!(
        matches!(
            end,
            Err(VolterraError::Uncertified { .. } | VolterraError::Diverged { .. })
        ),
        "{end:?}"
    );
}
