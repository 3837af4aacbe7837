//! Formulas with a memory that has an equation of its own: against built-in laws, time steps of equations
//! written here, and differences.

use nalgebra::DVector;
use nanotap::case::document::equilibria;
use nanotap::case::{Case, Key};
use nanotap::model::galerkin::Galerkin;
use nanotap::model::model_map::ModelMap;
use nanotap_dynamics::StroboscopicMap as _;

use crate::common::found;
use crate::derivatives::worst;

fn case(words: &[&str]) -> Case {
    let all = [
        "modes=3",
        "cantilever.k=2 N/m",
        "cantilever.f0=75 kHz",
        "cantilever.Q=150",
        "tip.radius=10 nm",
        "drive.actuation=tip",
        "drive.frequency=75 kHz",
        "drive.free_amplitude=30 nm",
        "gap.tip=24 nm",
    ];
    let all = all.iter().chain(words).map(|&word| word.to_owned());
    Case::parse(None, &all.collect::<Vec<_>>()).unwrap()
}

/// A flat punch of 1 nm N/m per modulus on one arm: E∞ = 5, E₁ = 4 and so E₀ = 9 N/m, μ = E∞/(E₀ τ) and
/// g = E₁/(E₀ τ).
#[test]
fn a_relaxing_arm_is_a_memory() {
    let built_in = case(&[
        "sample.law=prony-punch",
        "tip.radius=0.5 nm",
        "sample.poisson=0",
        "sample.modulus=5 GPa",
        "sample.arms=[[\"4 GPa\", \"2 us\"]]",
    ]);
    let formula = case(&[
        "sample.law=formula",
        "sample.force=s' = (4/9*F/k - 5/9*s)/tau; max(-k*(d + s), 0)",
        "sample.parameters.k=9 N/m",
        "sample.parameters.tau=2 us",
    ]);
    let [a, b] = [&built_in, &formula].map(found);
    assert!(b.observables.contacts_per_period > 0.5);
    for (a, b) in a.state.iter().zip(&b.state) {
        assert!((a - b).abs() < 1e-12 * a.abs().max(1e-3), "{a} {b}");
    }
    for (a, b) in a.multipliers.iter().zip(&b.multipliers) {
        let off = (a[0] - b[0]).hypot(a[1].abs() - b[1].abs());
        assert!(off < 1e-9, "{a:?} {b:?}");
    }
    let (a, b) = (&a.observables, &b.observables);
    for (value, expected) in [
        (b.dissipation, a.dissipation),
        (b.peak_force, a.peak_force),
        (b.contact_fraction, a.contact_fraction),
        (b.indentation, a.indentation),
    ] {
        assert!((value / expected - 1.0).abs() < 1e-9, "{value} {expected}");
    }
    assert!(a.energy_balance.residual.abs() < 1e-9);
}

/// The force of a DMT contact on a surface that gives way, with 0.5 N/m and 3 µs.
const SURFACE: [&str; 9] = [
    "sample.law=formula",
    "sample.force=s' = (F/ks - s)/tau; 4/3*E*sqrt(R)*max(a0 - d - s, 0)^1.5 - H*R/(6*max(d + s, a0)^2)",
    "sample.modulus=100 MPa",
    "sample.hamaker=1e-19 J",
    "sample.intermolecular_distance=0.3 nm",
    "sample.parameters.ks=0.5 N/m",
    "sample.parameters.tau=3 us",
    "sample.parameters.E=100 MPa",
    "drive.frequency=74.9 kHz",
];

/// A spring that loses what the force has deposited in it.
const DEPOSIT: [&str; 6] = [
    "sample.law=formula",
    "sample.force=p' = (a*F - p)/tau; if d > 0 then -b*p else -k*d - b*p",
    "sample.parameters.k=5 N/m",
    "sample.parameters.a=0.5",
    "sample.parameters.b=0.3",
    "sample.parameters.tau=4 us",
];

/// Fourth-order Runge–Kutta steps in the model's units, but for the force, which is in N of m and of the
/// memory in its SI unit.
fn stepped(
    case: &Case,
    start: &[f64],
    scale: f64,
    law: &dyn Fn(f64, f64) -> [f64; 2],
    steps: usize,
) -> Vec<f64> {
    let lever = case.cantilever().unwrap();
    let scales = case.physical().unwrap().scales;
    let equations = Galerkin::new(lever).unwrap();
    let n = lever.modes;
    let inverse = equations.mass.clone().try_inverse().unwrap();
    let (free, tip) = (&equations.forcing[0], &equations.gap.tip);
    let field = |t: f64, x: &DVector<f64>| {
        let (a, v, s) = (x.rows(0, n), x.rows(n, n), x[2 * n] * scale);
        let gap = (tip.dot(&a) + lever.alpha5) * scales.length;
        let [force, rate] = law(gap, s);
        let (sine, cosine) = (lever.omega * t).sin_cos();
        let load = &free.sine * sine + &free.cosine * cosine + tip * (force / scales.force)
            - &equations.stiffness[0] * a
            - &equations.damping[0] * v;
        let mut out = DVector::zeros(2 * n + 1);
        out.rows_mut(0, n).copy_from(&v);
        out.rows_mut(n, n).copy_from(&(&inverse * load));
        out[2 * n] = rate * scales.time / scale;
        out
    };
    let mut x = DVector::from_column_slice(start);
    let h = lever.period() / steps as f64;
    for k in 0..steps {
        let t = k as f64 * h;
        let a = field(t, &x);
        let b = field(t + 0.5 * h, &(&x + &a * (0.5 * h)));
        let c = field(t + 0.5 * h, &(&x + &b * (0.5 * h)));
        let d = field(t + h, &(&x + &c * h));
        x += (a + (b + c) * 2.0 + d) * (h / 6.0);
    }
    x.as_slice().to_vec()
}

fn agrees(case: &Case, scale: f64, law: &dyn Fn(f64, f64) -> [f64; 2], within: f64) {
    let model = case.model().unwrap();
    let start = found(case).state;
    let mut own = start.clone();
    ModelMap::new(&model).advance(&mut own).unwrap();
    let other = stepped(case, &start, scale, law, 40_000);
    let size = own.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    for (a, b) in own.iter().zip(&other) {
        assert!((a - b).abs() < within * size, "{own:?} {other:?}");
    }
}

#[test]
fn a_moving_surface_moves_as_time_steps_do() {
    let case = case(&SURFACE);
    let law = |d: f64, s: f64| {
        let (x, a0, radius) = (d + s, 0.3e-9, 10e-9_f64);
        let force = 4.0 / 3.0 * 1e8 * radius.sqrt() * (a0 - x).max(0.0).powf(1.5)
            - 1e-19 * radius / (6.0 * x.max(a0).powi(2));
        [force, (force / 0.5 - s) / 3e-6]
    };
    assert!(found(&case).observables.contacts_per_period > 0.5);
    let length = case.physical().unwrap().scales.length;
    agrees(&case, length, &law, 1e-7);
}

#[test]
fn a_memory_that_is_a_force_moves_as_time_steps_do() {
    let case = case(&DEPOSIT);
    let law = |d: f64, p: f64| {
        let force = if d > 0.0 { 0.0 } else { -5.0 * d } - 0.3 * p;
        [force, (0.5 * force - p) / 4e-6]
    };
    assert!(found(&case).observables.contacts_per_period > 0.5);
    let force = case.physical().unwrap().scales.force;
    agrees(&case, force, &law, 1e-7);
}

/// Derivatives by the state's entries and by quantities of the case, those of the memory among them.
#[test]
fn derivatives_agree_with_differences() {
    for words in [&SURFACE[..], &DEPOSIT] {
        let case = case(words);
        let found = found(&case);
        let tau = case.key("sample.parameters.tau").unwrap();
        let keys = [Key::GapTip, Key::DriveFrequency, tau];
        let error = worst(&case, &keys, &found.state);
        assert!(error < 1e-6, "{error}");
    }
}

/// Without a drive tip and surface rest where each holds the other: F = f(d + F/k_s), and the lever
/// 2 N/m (d − 1 nm) = F, but for what three modes are too stiff.
#[test]
fn tip_and_surface_rest_in_balance() {
    let mut words = SURFACE.to_vec();
    words.push("gap.tip=1 nm");
    let case = case(&words);
    let rests = equilibria(&case);
    let scales = case.physical().unwrap().scales;
    assert!(!rests.is_empty());
    for rest in rests {
        let (gap, force) = (rest.gap * scales.length, rest.force * scales.force);
        let x = gap + force / 0.5;
        let radius = 10e-9_f64;
        let expected = 4.0 / 3.0 * 1e8 * radius.sqrt() * (0.3e-9 - x).max(0.0).powf(1.5)
            - 1e-19 * radius / (6.0 * x.max(0.3e-9).powi(2));
        assert!((force / expected - 1.0).abs() < 1e-8, "{force} {expected}");
        assert!(
            (2.0 * (gap - 1e-9) / force - 1.0).abs() < 2e-3,
            "{gap} {force}"
        );
    }
}

#[test]
fn equations_that_no_engine_carries_are_refused() {
    let refused = |force: &str| {
        let words = [
            "modes=1",
            "cantilever.k=2 N/m",
            "cantilever.f0=75 kHz",
            "cantilever.Q=150",
            "tip.radius=10 nm",
            "drive.frequency=75 kHz",
            "drive.free_amplitude=30 nm",
            "gap.tip=24 nm",
            "sample.law=formula",
            "sample.parameters.k=1 N/m",
            "sample.parameters.t=1 us",
            &format!("sample.force={force}"),
        ];
        let words = words.map(str::to_owned);
        Case::parse(None, &words).unwrap_err().to_string()
    };
    for (force, said) in [
        ("s' = (F/k - s)/t", "an equation ends with `;`"),
        ("s' = (k*d - s)/t; s*k", "driven by the force F and decays"),
        (
            "s' = (F*F/k - s)/t; s*k",
            "driven by the force F and decays",
        ),
        (
            "s' = (F/k - s)/t + 1; s*k",
            "driven by the force F and decays",
        ),
        (
            "s' = (F/k - s)/t; k*s - k*t*v",
            "the gap and the memory alone",
        ),
        ("s' = (F/k - s)/k; k*s", "one over a time is needed"),
        ("s' = (F/k - s)/t; s", "where a force is needed"),
        ("s' = (F/k + s)/t; -k*s", "must decay at a positive rate"),
        ("s' = (F/k - s)/t; r' = (F/k - r)/t; -k*s", "stands first"),
        ("s' = (F/k - s)/t; s = -d; k*s", "a name is defined once"),
        ("d' = (F/k - d)/t; -k*d", "a meaning of its own"),
    ] {
        let message = refused(force);
        assert!(message.contains(said), "{force}: {message}");
    }
}
