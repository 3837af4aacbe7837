//! A force that depends on time: a sphere under dc and ac voltage, whose frequency is that of the second tone.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod common;

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use common::Strobe;
use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::{ShootingOptions, close_orbit};
use nanotap_volterra::{
    Complex, Drive, Flow, ForceLaw, Kernel, Modes, Options, Output, Parameter, System, Tone,
    ToneChange, laws,
};

const DC: f64 = 0.9;
const AC: f64 = 0.6;
const POTENTIAL: f64 = 0.2;
const RADIUS: f64 = 20.0;
const PERMITTIVITY: f64 = 8.854e-3;
const Q: f64 = 60.0;
const K: f64 = 2.0;

fn electrostatic(radius: f64) -> Arc<dyn ForceLaw> {
    let values = [
        ("voltage", DC),
        ("ac_voltage", AC),
        ("contact_potential", POTENTIAL),
        ("radius", radius),
        ("contact_distance", 0.3),
        ("permittivity", PERMITTIVITY),
    ];
    laws::build("electrostatic-ac", &values).unwrap()
}

fn with_dmt() -> Arc<dyn ForceLaw> {
    let contact = [
        ("modulus", 1.0),
        ("tip_modulus", 160.0),
        ("radius", RADIUS),
        ("contact_distance", 0.3),
        ("hamaker", 0.03),
    ];
    let entry = |name: &str| laws::law(name).unwrap().entry;
    laws::build_sum(&[
        (entry("dmt"), laws::build("dmt", &contact).unwrap()),
        (entry("electrostatic-ac"), electrostatic(RADIUS)),
    ])
    .unwrap()
}

/// One mode of unit frequency under a tone at 1 of this amplitude, with a voltage at `bias`.
fn lever(law: Arc<dyn ForceLaw>, drive: f64, bias: f64, gap: f64) -> System {
    let modes = Modes::from_oscillators(&[(1.0, 1.0 / Q)]).unwrap();
    let row = RowDVector::from_row_slice(&[1.0, 0.0]);
    let column = DVector::from_row_slice(&[0.0, 1.0 / K]);
    let kernel = Kernel::new(modes, row, column, TAU / 4.0, 20).unwrap();
    let zero = Complex::new(0.0, 0.0);
    let tone = |frequency, size| Tone {
        frequency,
        forcing: DVector::from_row_slice(&[zero, Complex::new(size, 0.0)]),
        gap: zero,
    };
    let drive = Drive {
        constant: DVector::zeros(2),
        offset: gap,
        tones: vec![tone(1.0, drive / Q), tone(bias, 0.0)],
    };
    System::new(kernel, law, drive, Options::new(1e-13)).unwrap()
}

/// Far away, where the force does not change with the motion, the lever answers like a linear one: at the
/// frequency of the voltage with 2(U − U_c)V, at twice that with V²/2.
#[test]
fn far_away_the_lever_has_two_components() {
    let (gap, bias) = (1e6, 0.3);
    let system = lever(electrostatic(1e5), 0.0, bias, gap);
    let period = TAU / bias;
    let mut strobe = Strobe::new(system, period);
    let found = close_orbit(&mut strobe, &[0.0, 0.0], 1, &ShootingOptions::default()).unwrap();
    let mut flow = strobe.flow;
    flow.start(&found.states[0], 0.0).unwrap();
    let motion = flow.record_until(period).unwrap();
    let strength = -PI * PERMITTIVITY * 1e10 / (gap * (gap + 1e5)) / K;
    let u = DC - POTENTIAL;
    for (harmonic, voltage) in [(1.0, 2.0 * u * AC), (2.0, 0.5 * AC * AC)] {
        let omega = harmonic * bias;
        let expected = strength * voltage / Complex::new(1.0 - omega * omega, omega / Q);
        let found = motion.fourier(&Output::component(2, 0), omega);
        let error = (found - expected).modulus() / expected.modulus();
        assert!(error < 1e-5, "{harmonic}: {found} {expected}");
    }
}

/// The classical Runge–Kutta method with a step of 1/40,000 of the drive's period, in the attractive range.
#[test]
fn a_transient_agrees_with_runge_and_kutta() {
    let law = electrostatic(RADIUS);
    let bias = 0.75;
    let gap = 12.0;
    let mut flow = Flow::new(Arc::new(lever(Arc::clone(&law), 8.0, bias, gap)));
    let start = [3.0, -2.0];
    flow.start(&start, 0.0).unwrap();
    flow.run_until(4.0 * TAU).unwrap();
    let mut end = [0.0; 2];
    flow.state(&mut end);
    let field = |t: f64, [z, v]: [f64; 2]| {
        let u = DC - POTENTIAL + AC * (bias * t).cos();
        let d = gap + z;
        let force = -PI * PERMITTIVITY * RADIUS * RADIUS * u * u / (d * (d + RADIUS));
        [v, -z - v / Q + 8.0 / Q * t.cos() + force / K]
    };
    let (steps, mut x) = (160_000, start);
    let h = 4.0 * TAU / f64::from(steps);
    for n in 0..steps {
        let t = h * f64::from(n);
        let at = |s: f64, k: [f64; 2]| [x[0] + s * k[0], x[1] + s * k[1]];
        let a = field(t, x);
        let b = field(t + 0.5 * h, at(0.5 * h, a));
        let c = field(t + 0.5 * h, at(0.5 * h, b));
        let d = field(t + h, at(h, c));
        for i in 0..2 {
            x[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
        }
    }
    for (found, expected) in end.iter().zip(x) {
        assert!((found - expected).abs() < 1e-9, "{end:?} {x:?}");
    }
}

/// A tapping orbit that repeats after four drive periods: the determinant of its Jacobian is e^{−4·2π/Q},
/// whatever the force does, and the Jacobian is that of differences.
#[test]
fn a_tapping_orbit_has_multipliers() {
    let mut strobe = Strobe::new(lever(with_dmt(), 25.0, 0.75, 18.0), 4.0 * TAU);
    let mut state = vec![5.0, 20.0];
    for _ in 0..60 {
        nanotap_dynamics::StroboscopicMap::advance(&mut strobe, &mut state).unwrap();
    }
    let orbit = close_orbit(&mut strobe, &state, 1, &ShootingOptions::default()).unwrap();
    let mut jacobian = DMatrix::zeros(2, 2);
    let mut end = orbit.states[0].clone();
    nanotap_dynamics::StroboscopicMap::advance_with_jacobian(&mut strobe, &mut end, &mut jacobian)
        .unwrap();
    for (end, start) in end.iter().zip(&orbit.states[0]) {
        assert!((end - start).abs() < 1e-9);
    }
    let determinant = jacobian.determinant();
    assert!(
        (determinant / (-4.0 * TAU / Q).exp() - 1.0).abs() < 1e-8,
        "{determinant}"
    );
    for column in 0..2 {
        let moved = |h: f64| {
            let mut x = orbit.states[0].clone();
            x[column] += h;
            let mut strobe = strobe.clone();
            nanotap_dynamics::StroboscopicMap::advance(&mut strobe, &mut x).unwrap();
            x
        };
        let (plus, minus) = (moved(1e-6), moved(-1e-6));
        for row in 0..2 {
            let difference = (plus[row] - minus[row]) / 2e-6;
            assert!((jacobian[(row, column)] - difference).abs() < 1e-5 * jacobian.amax());
        }
    }
}

/// The derivative by the frequency of the voltage.
#[test]
fn the_frequency_of_the_voltage_has_a_derivative() {
    let start = [2.0, 1.0];
    let end = |bias: f64| {
        let mut flow = Flow::new(Arc::new(lever(with_dmt(), 25.0, bias, 18.0)));
        flow.start(&start, 0.0).unwrap();
        flow.run_until(TAU).unwrap();
        let mut out = [0.0; 2];
        flow.state(&mut out);
        out
    };
    let mut flow = Flow::new(Arc::new(lever(with_dmt(), 25.0, 0.75, 18.0)));
    let change = ToneChange {
        frequency: 1.0,
        ..ToneChange::default()
    };
    let parameter = Parameter {
        tones: vec![ToneChange::default(), change],
        ..Parameter::default()
    };
    flow.start(&start, 0.0).unwrap();
    let (mut jacobian, mut derivative) = (DMatrix::zeros(2, 2), DMatrix::zeros(2, 1));
    flow.run_with_derivatives(TAU, &[parameter], &mut jacobian, &mut derivative)
        .unwrap();
    let (plus, minus) = (end(0.75 + 1e-5), end(0.75 - 1e-5));
    for i in 0..2 {
        let difference = (plus[i] - minus[i]) / 2e-5;
        assert!(
            (derivative[i] - difference).abs() < 1e-6 * derivative.amax(),
            "{derivative} {difference}"
        );
    }
}

/// Laws that need the gap's rate or its past cannot share the second argument.
#[test]
fn what_cannot_be_added_is_refused_by_name() {
    let entry = |name: &str| laws::law(name).unwrap().entry;
    let voigt = laws::build(
        "voigt-sphere",
        &[("modulus", 1.0), ("viscosity", 1.0), ("radius", RADIUS)],
    )
    .unwrap();
    let terms = [
        (entry("voigt-sphere"), voigt),
        (entry("electrostatic-ac"), electrostatic(RADIUS)),
    ];
    let error = laws::build_sum(&terms).unwrap_err().to_string();
    assert!(
        error.contains("electrostatic-ac") && error.contains("voigt-sphere"),
        "{error}"
    );
}
