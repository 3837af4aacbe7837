//! Perturbations of every mode under a permanent force: the motion is smooth and takes long steps,
//! but a perturbation of a fast mode is not smooth.
//!
//! Where all modes have one damping γ and one modal mass, a conservative force makes the flow
//! conformally symplectic, `JᵀSJ = e^{−γt} S` (R. McLachlan and M. Perlmutter, J. Geom. Phys. 39,
//! 276, 2001), whatever the motion: an exact check of every entry of the Jacobian.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod common;

use common::{Strobe, beam_modes, dmt};
use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::{PeriodicOrbit, ShootingOptions, close_orbit};
use nanotap_volterra::{
    Complex, Drive, Flow, ForceLaw, Kernel, Modes, Options, Parameter, System, Tone, laws,
};
use std::f64::consts::TAU;
use std::sync::Arc;

const AMPLITUDE: f64 = 10.0;

/// As in `common`, with the damping γ = 1/q of every mode.
fn uniform(law: Arc<dyn ForceLaw>, count: usize, k: f64, q: f64, zc: f64) -> System {
    let own = beam_modes(count, q);
    let oscillators: Vec<_> = own.iter().map(|mode| (mode.0, 1.0 / q)).collect();
    let half = |first: bool, by: f64| {
        DVector::from_fn(2 * count, |i, _| {
            if (i < count) == first {
                own[i % count].2 * by
            } else {
                0.0
            }
        })
    };
    let modes = Modes::from_oscillators(&oscillators).unwrap();
    let row: RowDVector<f64> = half(true, 1.0).transpose();
    let kernel = Kernel::new(modes, row, half(false, 1.0 / k), TAU / 4.0, 20).unwrap();
    let drive = Drive {
        constant: DVector::zeros(2 * count),
        offset: zc,
        tones: vec![Tone {
            frequency: 1.0,
            forcing: half(false, AMPLITUDE / q).map(|x| Complex::new(x, 0.0)),
            gap: Complex::new(0.0, 0.0),
        }],
    };
    System::new(kernel, law, drive, Options::new(1e-13)).unwrap()
}

/// A sphere of 20 nm pressed by 60 nm with 0.3 N/m into a sample of 1 MPa … 1 GPa.
fn hertz(modulus: f64) -> Arc<dyn ForceLaw> {
    let values = [
        ("modulus", modulus),
        ("poisson", 0.5),
        ("radius", 20.0),
        ("contact_distance", 0.0),
    ];
    laws::build("hertz", &values).unwrap()
}

/// The largest entry of `JᵀSJ e^{γt} − S`, each mode scaled so that it moves on a circle.
fn symplectic_error(system: &Arc<System>, start: &[f64], q: f64) -> f64 {
    let n = system.dimension() / 2;
    let mut flow = Flow::new(Arc::clone(system));
    flow.start(start, 0.0).unwrap();
    let (mut jacobian, mut none) = (DMatrix::zeros(2 * n, 2 * n), DMatrix::zeros(2 * n, 0));
    flow.run_with_derivatives(TAU, &[], &mut jacobian, &mut none)
        .unwrap();
    let scale = DVector::from_fn(2 * n, |i, _| {
        let root = beam_modes(n, q)[i % n].0.powf(0.25);
        if i < n { root } else { 1.0 / root }
    });
    let scaled = DMatrix::from_fn(2 * n, 2 * n, |i, j| scale[i] * jacobian[(i, j)] / scale[j]);
    let form = DMatrix::from_fn(2 * n, 2 * n, |i, j| {
        f64::from(u8::from(j == i + n)) - f64::from(u8::from(i == j + n))
    });
    (scaled.transpose() * &form * &scaled * (TAU / q).exp() - form).amax()
}

/// The orbit of a lever in permanent contact: it is smooth, and no fast mode oscillates freely.
fn steady(modulus: f64, n: usize, q: f64) -> PeriodicOrbit {
    let mut map = Strobe::new(uniform(hertz(modulus), n, 0.3, q, -60.0), TAU);
    // Static equilibrium of lever and sample: a unit force bends every mode by ±1/(k κ).
    let own = beam_modes(n, q);
    let compliance: f64 = own.iter().map(|mode| 1.0 / (0.3 * mode.0)).sum();
    let law = hertz(modulus);
    let (mut low, mut high) = (0.0, 60.0 / compliance);
    for _ in 0..100 {
        let force = 0.5 * (low + high);
        if law.force(1, compliance * force - 60.0, 0.0).value > force {
            low = force;
        } else {
            high = force;
        }
    }
    let mut start = vec![0.0; 2 * n];
    for (z, mode) in start.iter_mut().zip(&own) {
        *z = mode.2 * low / (0.3 * mode.0);
    }
    close_orbit(&mut map, &start, 1, &ShootingOptions::default()).unwrap()
}

#[test]
fn a_permanent_conservative_force_is_conformally_symplectic() {
    for n in [1, 2, 3, 5, 10, 20] {
        for q in [2.0, 200.0, 1e5] {
            for modulus in [1e-3, 1.0] {
                let orbit = steady(modulus, n, q);
                let what = format!("N = {n}, Q = {q}, {modulus} GPa");
                let system = Arc::new(uniform(hertz(modulus), n, 0.3, q, -60.0));
                let error = symplectic_error(&system, &orbit.states[0], q);
                assert!(error < 1e-11, "{what}: {error:e}");
                // All multipliers have the same modulus.
                for multiplier in &orbit.multipliers {
                    let modulus = multiplier.modulus() * (0.5 * TAU / q).exp();
                    assert!(
                        (modulus - 1.0).abs() < 1e-9,
                        "{what}: {multiplier} {modulus}"
                    );
                }
            }
        }
    }
}

#[test]
fn tapping_is_conformally_symplectic() {
    for n in [1, 3, 10] {
        let system = Arc::new(uniform(dmt(), n, 0.9, 50.0, 8.0));
        let mut start = vec![0.0; 2 * n];
        start[0] = 10.0;
        let error = symplectic_error(&system, &start, 50.0);
        assert!(error < 1e-9, "N = {n}: {error:e}");
    }
}

/// Compared with central differences of the flow, in the fast modes and with respect to the
/// distance.
#[test]
fn derivatives_in_fast_modes_are_those_of_the_flow() {
    let (n, q) = (10, 200.0);
    let start = steady(1.0, n, q).states.remove(0);
    let system = |offset: f64| Arc::new(uniform(hertz(1.0), n, 0.3, q, -60.0 + offset));
    let end = |offset: f64, change: Option<(usize, f64)>| {
        let mut state = start.clone();
        if let Some((entry, by)) = change {
            state[entry] += by;
        }
        let mut flow = Flow::new(system(offset));
        flow.start(&state, 0.0).unwrap();
        flow.run_until(TAU).unwrap();
        flow.state(&mut state);
        state
    };
    let mut flow = Flow::new(system(0.0));
    flow.start(&start, 0.0).unwrap();
    let (mut jacobian, mut derivative) = (DMatrix::zeros(2 * n, 2 * n), DMatrix::zeros(2 * n, 1));
    flow.run_with_derivatives(TAU, &[Parameter::offset()], &mut jacobian, &mut derivative)
        .unwrap();
    let compare = |exact: Vec<f64>, plus: Vec<f64>, minus: Vec<f64>, h: f64, what: &str| {
        let size = exact.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        for ((exact, plus), minus) in exact.iter().zip(plus).zip(minus) {
            let difference = (plus - minus) / (2.0 * h);
            assert!(
                (exact - difference).abs() < 1e-6 * size,
                "{what}: {exact} {difference}"
            );
        }
    };
    for entry in [0, 4, 9, 13, 19] {
        let h = if entry < n { 1e-4 } else { 1e-2 };
        let exact = jacobian.column(entry).iter().copied().collect();
        let (plus, minus) = (end(0.0, Some((entry, h))), end(0.0, Some((entry, -h))));
        compare(exact, plus, minus, h, &format!("state {entry}"));
    }
    let exact = derivative.column(0).iter().copied().collect();
    compare(exact, end(1e-4, None), end(-1e-4, None), 1e-4, "distance");
}
