//! Samples that relax under a sphere, a cone and a punch.
//!
//! The reference orbits are from an independent program in extended precision (its orbits closed to
//! 4e-15, and another program with other equations agreed to 1e-11). Units: nm, nN, GPa, and 1/ω₀.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod common;
#[path = "common/random.rs"]
mod random;

use common::Strobe;
use nalgebra::{DVector, RowDVector};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::{PeriodicOrbit, ShootingOptions, StroboscopicMap, close_orbit};
use nanotap_volterra::laws::prony::Arms;
use nanotap_volterra::{
    Complex, Drive, Flow, ForceLaw, Kernel, Modes, Options, Output, System, Tone, VolterraError,
    laws,
};
use random::Random;
use std::f64::consts::TAU;
use std::sync::Arc;

/// `(βL)` of the free modes of a beam.
const ROOTS: [f64; 3] = [
    1.875_104_068_711_961,
    4.694_091_132_974_175,
    7.854_757_438_237_613,
];

/// Three arms of polyisobutylene with times in μs.
const PIB: [(f64, f64); 3] = [(0.3832, 0.46), (1.671, 0.1357), (7.196, 0.0669)];
const PIB_REST: f64 = 0.03338;

/// An epoxy by half decades, times in μs (Simon, McKenna, Sindt, J. Appl. Polym. Sci. 76, 495 (2000)),
/// up to 1 s.
const EPOXY: [f64; 15] = [
    0.05715345, 0.05715345, 0.05715345, 0.05715345, 0.07097661, 0.07097661, 0.09968625, 0.10766115,
    0.1674729, 0.1674729, 0.28018482, 0.3083628, 0.3083628, 0.43941699, 0.14913063,
];
/// The lever of a reference: modes of a beam of static stiffness `k`, all damped alike, under a force
/// at the tip.
#[derive(Clone, Copy)]
struct Lever {
    modes: usize,
    k: f64,
    q: f64,
    /// In MHz.
    frequency: f64,
    /// Amplitude of the force.
    drive: f64,
    gap: f64,
}

const PIB_LEVER: Lever = Lever {
    modes: 1,
    k: 2.0,
    q: 150.0,
    frequency: 0.075,
    drive: 0.412_078_778_944_206,
    gap: 24.0,
};

impl Lever {
    /// Of the first mode.
    fn stiffness(&self) -> f64 {
        self.k * ROOTS[0].powi(4) / 12.0
    }

    /// Time units in a μs.
    fn rate(&self) -> f64 {
        TAU * self.frequency
    }

    fn system(&self, law: Arc<dyn ForceLaw>) -> System {
        let n = self.modes;
        let oscillators: Vec<(f64, f64)> = (0..n)
            .map(|k| ((ROOTS[k] / ROOTS[0]).powi(4), 1.0 / self.q))
            .collect();
        let (mut row, mut column) = (RowDVector::zeros(2 * n), DVector::zeros(2 * n));
        let mut forcing = DVector::from_element(2 * n, Complex::new(0.0, 0.0));
        for k in 0..n {
            row[k] = 1.0;
            column[n + k] = 1.0 / self.stiffness();
            // sin t = Re(−i e^{it}).
            forcing[n + k] = Complex::new(0.0, -self.drive / self.stiffness());
        }
        let modes = Modes::from_oscillators(&oscillators).unwrap();
        let kernel = Kernel::new(modes, row, column, TAU / 4.0, 20).unwrap();
        let drive = Drive {
            constant: DVector::zeros(2 * n),
            offset: self.gap,
            tones: vec![Tone {
                frequency: 1.0,
                forcing,
                gap: Complex::new(0.0, 0.0),
            }],
        };
        System::new(kernel, law, drive, Options::new(1e-13)).unwrap()
    }
}

/// The parameters of a law whose times are measured in `time` units.
fn parameters(rest: f64, poisson: f64, size: f64, contact: f64, time: f64) -> [f64; 7] {
    [rest, poisson, size, contact, 1.0, time, f64::INFINITY]
}

fn prony(name: &str, arms: &[(f64, f64)], parameters: &[f64; 7]) -> Arc<dyn ForceLaw> {
    let arms = Arms::new(arms, false).unwrap();
    laws::law(name)
        .unwrap()
        .with_arms(&arms, parameters)
        .unwrap()
}

fn with_attraction(law: &Arc<dyn ForceLaw>, name: &str, values: &[f64]) -> Arc<dyn ForceLaw> {
    with_attractions(law, &[(name, values)])
}

/// The sum of an elastic or relaxing law with others.
fn with_attractions(law: &Arc<dyn ForceLaw>, others: &[(&str, &[f64])]) -> Arc<dyn ForceLaw> {
    let first = laws::law("prony-sphere").unwrap();
    let mut terms = vec![(first.entry, Arc::clone(law))];
    for (name, values) in others {
        let own = laws::law(name).unwrap();
        terms.push((own.entry, own.with(values).unwrap()));
    }
    laws::build_sum(&terms).unwrap()
}

/// Parameters of a capillary bridge that forms at 1.2 nm and ruptures at about 4 nm.
const CAPILLARY: [f64; 9] = [0.7, 0.5, f64::INFINITY, 0.3, 10.0, 0.2, 0.03, 0.6, 0.02];

struct MeasuredOrbit {
    orbit: PeriodicOrbit,
    amplitude: f64,
    /// In degrees.
    phase: f64,
    dissipated: f64,
    peak: f64,
    /// In μs.
    contact: f64,
    mean_force: f64,
    virial: f64,
    /// Work of the drive, and the loss in the lever's damping.
    drive: f64,
    damping: f64,
}

/// The orbit that Newton's method reaches from rest after some periods.
fn orbit(lever: &Lever, law: Arc<dyn ForceLaw>, guess: &[f64], periods: usize) -> MeasuredOrbit {
    let system = lever.system(law);
    let (dimension, n) = (system.dimension(), lever.modes);
    let mut map = Strobe::new(system, TAU);
    let mut state = guess.to_vec();
    state.resize(dimension, 0.0);
    for _ in 0..periods {
        map.advance(&mut state).unwrap();
    }
    let orbit = close_orbit(&mut map, &state, 1, &ShootingOptions::default()).unwrap();
    map.flow.start(&orbit.states[0], 0.0).unwrap();
    let motion = map.flow.record_until(TAU).unwrap();
    let mut tip = Output::component(dimension, 0);
    tip.row.columns_mut(0, n).fill(1.0);
    let c = motion.fourier(&tip, 1.0);
    let k1 = lever.stiffness();
    let sums = motion.integrate(4, |s, out| {
        let speeds = &s.state.as_slice()[n..2 * n];
        out[0] = s.force;
        out[1] = s.force * (s.gap - lever.gap);
        out[2] = lever.drive * s.time.sin() * speeds.iter().sum::<f64>();
        out[3] = k1 / lever.q * speeds.iter().map(|v| v * v).sum::<f64>();
    });
    let force = Output {
        row: RowDVector::zeros(dimension),
        offset: 0.0,
        tones: Vec::new(),
        force: 1.0,
    };
    MeasuredOrbit {
        amplitude: c.modulus(),
        phase: (-c.im.atan2(c.re)).to_degrees() - 90.0,
        dissipated: -motion.work(),
        peak: motion.range(&force).1,
        contact: motion.time_on(|branch| branch == 1) / lever.rate(),
        mean_force: sums[0] / TAU,
        virial: sums[1] / TAU,
        drive: sums[2],
        damping: sums[3],
        orbit,
    }
}

/// Amplitude, phase, E_dis, F_max, contact time, mean force and virial.
fn compare(found: &MeasuredOrbit, expected: [f64; 7], tolerance: f64) {
    let values = [
        found.amplitude,
        found.phase,
        found.dissipated,
        found.peak,
        found.contact,
        found.mean_force,
        found.virial,
    ];
    for (k, (value, expected)) in values.iter().zip(expected).enumerate() {
        let error = (value / expected - 1.0).abs();
        assert!(error < tolerance, "number {k}: {value} against {expected}");
    }
    // Nothing is gained or lost over a period.
    let rest = found.drive - found.damping - found.dissipated;
    assert!(rest.abs() < 1e-9 * found.drive, "{rest}");
}

fn pib(lever: &Lever) -> Arc<dyn ForceLaw> {
    let parameters = parameters(PIB_REST, 0.5, 10.0, 0.0, lever.rate());
    prony("prony-sphere", &PIB, &parameters)
}

#[test]
fn sphere_on_polyisobutylene() {
    let lever = PIB_LEVER;
    let found = orbit(&lever, pib(&lever), &[-21.0, 12.0], 300);
    let expected = [
        25.230_138_664_145_2,
        59.810_046_860_867,
        0.762_621_446_181_943,
        2.590_691_999_030_17,
        0.826_692_007_536_457,
        0.104_104_282_288_125,
        -2.615_179_463_778_56,
    ];
    compare(&found, expected, 1e-9);
    // The three arms add three multipliers inside the unit circle.
    assert!(found.orbit.multipliers.iter().all(|m| m.modulus() < 1.0));
    assert_eq!(found.orbit.multipliers.len(), 5);
}

#[test]
fn cone_on_polyisobutylene() {
    let lever = PIB_LEVER;
    let parameters = parameters(PIB_REST, 0.5, 20_f64.to_radians(), 0.0, lever.rate());
    let law = prony("prony-cone", &PIB, &parameters);
    let expected = [
        27.715_271_809_870_1,
        71.526_697_696_242_3,
        0.883_563_739_675_351,
        1.180_930_603_043_52,
        1.153_708_006_255_55,
        0.065_951_618_415_381_3,
        -1.809_623_374_284_11,
    ];
    compare(&orbit(&lever, law, &[-21.0, 12.0], 300), expected, 1e-9);
}

/// A punch on one arm is the standard linear solid.
#[test]
fn punch_on_a_standard_linear_solid() {
    let lever = PIB_LEVER;
    // 2R/(1 − ν²) = 1.
    let parameters = parameters(5.0, 0.0, 0.5, 0.0, lever.rate());
    let law = prony("prony-punch", &[(2.0, 4.0)], &parameters);
    let expected = [
        24.371_528_606_334,
        54.630_162_776_928_6,
        0.095_743_477_971_092_4,
        3.319_953_173_441_52,
        0.722_407_290_000_295,
        0.119_613_167_574_688,
        -2.908_333_914_425_62,
    ];
    compare(&orbit(&lever, law, &[-21.0, 12.0], 300), expected, 1e-9);
}

#[test]
fn three_modes_on_polyisobutylene() {
    let lever = Lever {
        modes: 3,
        drive: 0.412_078_758_339_944,
        ..PIB_LEVER
    };
    let expected = [
        25.258_243_949_673,
        59.891_360_748_698_9,
        0.754_691_980_043_519,
        2.570_150_046_358_03,
        0.831_548_231_697_048,
        0.103_818_781_931_081,
        -2.607_599_517_066,
    ];
    let guess = [-21.0, 0.0, 0.0, 12.0];
    compare(&orbit(&lever, pib(&lever), &guess, 300), expected, 1e-9);
}

/// Fifteen arms over seven decades with adhesion: the start has the surface at its mean depth.
#[test]
fn sphere_with_adhesion_on_epoxy() {
    let lever = Lever {
        modes: 1,
        k: 6.5,
        q: 150.0,
        frequency: 0.046,
        drive: 2.678_512_063_137_34,
        gap: 45.0,
    };
    let time = |k: usize| 10_f64.powf(k as f64 / 2.0 - 1.0);
    let arms: Vec<(f64, f64)> = EPOXY
        .iter()
        .enumerate()
        .map(|(k, e)| (time(k), *e))
        .collect();
    let parameters = parameters(0.27468174, 0.5, 10.0, 0.2, lever.rate());
    let law = prony("prony-sphere", &arms, &parameters);
    // H 2e-19 J.
    let law = with_attraction(&law, "van-der-waals", &[0.2, 10.0, 0.2]);
    let depths = [
        0.861_096_786_966_543,
        0.871_800_378_730_483,
        1.097_617_101_978_93,
        1.196_229_853_831_03,
        1.047_616_116_262_27,
        0.978_266_984_544_263,
        0.957_701_549_934_268,
        0.951_497_562_734_749,
        0.949_570_085_002_091,
        0.948_964_131_178_51,
        0.948_772_872_499_597,
        0.948_712_427_392_182,
        0.948_693_316_594_503,
        0.948_687_273_592_129,
        0.948_685_362_663_24,
    ];
    let mut guess = vec![-36.617_309_112_912_4, 8.470_767_446_685_93 / lever.rate()];
    guess.extend(retardation(&arms, 0.27468174, &depths));
    let found = orbit(&lever, law, &guess, 0);
    let expected = [
        46.888_601_977_409,
        51.627_473_715_823_7,
        0.985_302_681_556_698,
        24.137_817_338_541_5,
        1.538_090_707_073_4,
        0.831_777_417_541_023,
        -39.013_723_754_908_1,
    ];
    compare(&found, expected, 1e-8);
}

/// The retardation modes of a surface whose arms have these `ξ_i`: another way, by the symmetric
/// matrix `diag(1/τ) − S Sᵀ/E₀`, `S_i = √(E_i/τ_i)`.
fn retardation(arms: &[(f64, f64)], rest: f64, depths: &[f64]) -> Vec<f64> {
    let n = arms.len();
    let all = rest + arms.iter().map(|(_, e)| e).sum::<f64>();
    let s: Vec<f64> = arms.iter().map(|(t, e)| (e / t).sqrt()).collect();
    let matrix = nalgebra::DMatrix::from_fn(n, n, |i, j| {
        let diagonal = if i == j { 1.0 / arms[i].0 } else { 0.0 };
        diagonal - s[i] * s[j] / all
    });
    let eigen = matrix.symmetric_eigen();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    order
        .iter()
        .map(|k| {
            let v = eigen.eigenvectors.column(*k);
            let c: Vec<f64> = arms.iter().map(|(t, e)| (e * t).sqrt()).collect();
            let read: f64 = (0..n).map(|i| arms[i].1 / all / c[i] * v[i]).sum();
            let size: f64 = (0..n).map(|i| v[i] * c[i] * depths[i]).sum();
            read * size
        })
        .collect()
}

/// The sphere in the limits of an arm that is much faster or much slower than a contact.
#[test]
fn fast_and_slow_arms_are_hertz() {
    let lever = PIB_LEVER;
    let after_three_periods = |law: Arc<dyn ForceLaw>| {
        let system = lever.system(law);
        let mut state = vec![0.0; system.dimension()];
        state[0] = -21.0;
        state[1] = 12.0;
        let mut flow = Flow::new(Arc::new(system));
        flow.start(&state, 0.0).unwrap();
        flow.run_until(3.0 * TAU).unwrap();
        flow.state(&mut state);
        state
    };
    let hertz = |modulus: f64| {
        let law = laws::law("hertz").unwrap();
        let values = [modulus, 0.4, f64::INFINITY, 0.3, 10.0, 0.1];
        after_three_periods(law.with(&values).unwrap())
    };
    let relaxing = |time: f64| {
        let parameters = parameters(0.2, 0.4, 10.0, 0.1, 1.0);
        after_three_periods(prony("prony-sphere", &[(time, 0.3)], &parameters))
    };
    let same = |found: &[f64], expected: &[f64]| {
        for k in 0..2 {
            let error = (found[k] - expected[k]).abs();
            assert!(error < 1e-9 * lever.gap, "{found:?} {expected:?}");
        }
    };
    same(&relaxing(1e13), &hertz(0.5));
    // A fast arm differs by its viscosity, in proportion to its time.
    let [whole, half] = [2e-7, 1e-7].map(relaxing);
    let limit: Vec<f64> = half.iter().zip(&whole).map(|(a, b)| 2.0 * a - b).collect();
    same(&limit, &hertz(0.2));
}

/// A capillary bridge over an arm that is much slower than a contact is one over Hertz's solid.
#[test]
fn a_bridge_over_a_slow_arm_is_one_over_an_elastic_sample() {
    let lever = PIB_LEVER;
    let van_der_waals: &[f64] = &[0.1, 10.0, 0.2];
    let others: [(&str, &[f64]); 2] = [("capillary", &CAPILLARY), ("van-der-waals", van_der_waals)];
    let hertz = laws::law("hertz").unwrap();
    let elastic = hertz.with(&[0.5, 0.4, f64::INFINITY, 0.3, 10.0, 0.2]);
    let slow = parameters(0.2, 0.4, 10.0, 0.2, 1.0);
    let slow = prony("prony-sphere", &[(1e13, 0.3)], &slow);
    let [(a, lost_a), (b, lost_b)] = [elastic.unwrap(), slow].map(|law| {
        let system = lever.system(with_attractions(&law, &others));
        let mut state = vec![0.0; system.dimension()];
        (state[0], state[1]) = (-21.0, 12.0);
        let mut flow = Flow::new(Arc::new(system));
        flow.start(&state, 0.0).unwrap();
        let motion = flow.record_until(3.0 * TAU).unwrap();
        flow.state(&mut state);
        (state, -motion.work())
    });
    for k in 0..2 {
        assert!((a[k] - b[k]).abs() < 1e-9 * lever.gap, "{a:?} {b:?}");
    }
    assert!(
        lost_a > 0.1 && (lost_a / lost_b - 1.0).abs() < 1e-9,
        "{lost_a} {lost_b}"
    );
}

/// Random samples, levers and starts against fixed steps of Runge and Kutta's method for the arms'
/// own coordinates `ξ_i`.
#[test]
fn random_cases_agree_with_an_independent_integrator() {
    let mut random = Random(3);
    let mut touched = 0;
    for case in 0..60 {
        let mut within = |low: f64, high: f64| low + (high - low) * 0.5 * (1.0 + random.next());
        let count = 1 + case % 4;
        let arms: Vec<(f64, f64)> = (0..count)
            .map(|_| (10_f64.powf(within(-1.5, 2.0)), within(0.02, 0.5)))
            .collect();
        let rest = within(0.02, 0.3);
        let (contact, attraction) = (0.2, case % 2 == 1);
        let shape = case % 3;
        let (name, attracts, size) = [
            ("prony-sphere", "van-der-waals", 8.0),
            ("prony-cone", "van-der-waals-cone", 0.4),
            ("prony-punch", "van-der-waals-punch", 1.0),
        ][shape];
        let mut law = prony(name, &arms, &parameters(rest, 0.4, size, contact, 1.0));
        let hamaker = within(0.01, 0.1);
        let electric = attraction && shape == 0;
        let permittivity = 0.002;
        if electric {
            let van_der_waals: &[f64] = &[hamaker, size, contact];
            let biased: &[f64] = &[1.3, size, contact, permittivity];
            let others = [("electrostatic", biased), (attracts, van_der_waals)];
            law = with_attractions(&law, &others);
        } else if attraction {
            law = with_attraction(&law, attracts, &[hamaker, size, contact]);
        }
        let lever = Lever {
            gap: within(12.0, 24.0),
            drive: within(0.3, 0.6),
            ..PIB_LEVER
        };
        let system = lever.system(law);
        let mut state = vec![0.0; system.dimension()];
        let amplitude = within(1.02, 1.15) * lever.gap;
        let angle = within(0.0, TAU);
        state[0] = amplitude * angle.cos();
        state[1] = amplitude * angle.sin();
        let start = [state[0], state[1]];
        let mut flow = Flow::new(Arc::new(system));
        flow.start(&state, 0.0).unwrap();
        let motion = flow.record_until(2.0 * TAU).unwrap();
        flow.state(&mut state);
        let system = flow.system();
        touched += usize::from(motion.fraction(|branch| system.law().touches(branch)) > 0.0);
        let power = [1.5, 2.0, 1.0][shape];
        let stiffness = match shape {
            0 => 4.0 / 3.0 * size.sqrt(),
            1 => 2.0 / std::f64::consts::PI * size.tan(),
            _ => 2.0 * size,
        } / (1.0 - 0.4 * 0.4);
        let pull = |g: f64| match shape {
            _ if !attraction => 0.0,
            0 => {
                let bias = TAU / 2.0 * permittivity * (1.3 * size).powi(2);
                -hamaker * size / (6.0 * g * g) - bias / (g * (g + size))
            }
            1 => -hamaker * size.tan().powi(2) / (6.0 * g),
            _ => -hamaker * size * size / (6.0 * g.powi(3)),
        };
        let all = rest + arms.iter().map(|(_, e)| e).sum::<f64>();
        let field = |time: f64, x: &[f64], out: &mut [f64]| {
            let gap = lever.gap + x[0];
            let phi = (contact - gap).max(0.0).powf(power);
            let surface = arms
                .iter()
                .zip(&x[2..])
                .map(|((_, e), xi)| e * xi)
                .sum::<f64>()
                / all;
            let force = if phi > surface {
                stiffness * all * (phi - surface) + pull(contact)
            } else {
                pull((gap + surface.max(0.0).powf(1.0 / power)).max(contact))
            };
            let depth = phi.max(surface);
            out[0] = x[1];
            out[1] =
                -x[0] - x[1] / lever.q + (lever.drive * time.sin() + force) / lever.stiffness();
            for (k, (time, _)) in arms.iter().enumerate() {
                out[2 + k] = (depth - x[2 + k]) / time;
            }
        };
        let mut x = vec![0.0; 2 + count];
        x[..2].copy_from_slice(&start);
        runge_kutta(&mut x, 2.0 * TAU, 100_000, field);
        let surface = arms
            .iter()
            .zip(&x[2..])
            .map(|((_, e), xi)| e * xi)
            .sum::<f64>()
            / all;
        let own: f64 = state[2..].iter().sum();
        for (name, found, expected, size) in [
            ("deflection", state[0], x[0], lever.gap),
            ("velocity", state[1], x[1], lever.gap),
            ("surface", own, surface, surface.max(1e-3)),
        ] {
            let error = (found - expected).abs() / size;
            assert!(
                error < 2e-7,
                "case {case}, {name}: {found} {expected} {error:e}"
            );
        }
    }
    assert!(touched >= 50, "{touched}");
}

/// Fixed steps of the classical method of fourth order.
fn runge_kutta(x: &mut [f64], end: f64, steps: usize, field: impl Fn(f64, &[f64], &mut [f64])) {
    let n = x.len();
    let h = end / steps as f64;
    let mut slopes = vec![vec![0.0; n]; 4];
    let mut at = vec![0.0; n];
    for step in 0..steps {
        let time = h * step as f64;
        for stage in 0..4 {
            let part = [0.0, 0.5, 0.5, 1.0][stage];
            for k in 0..n {
                let before = if stage == 0 {
                    0.0
                } else {
                    slopes[stage - 1][k]
                };
                at[k] = x[k] + h * part * before;
            }
            field(time + h * part, &at, &mut slopes[stage]);
        }
        for k in 0..n {
            x[k] +=
                h / 6.0 * (slopes[0][k] + 2.0 * slopes[1][k] + 2.0 * slopes[2][k] + slopes[3][k]);
        }
    }
}

/// The Jacobian over a period with two contacts' worth of memory against differences.
#[test]
fn derivatives_are_those_of_the_map() {
    let lever = PIB_LEVER;
    let parameters = parameters(PIB_REST, 0.5, 10.0, 0.2, lever.rate());
    let law = prony("prony-sphere", &PIB, &parameters);
    let van_der_waals: (&str, &[f64]) = ("van-der-waals", &[0.1, 10.0, 0.2]);
    check_jacobian(&lever, with_attractions(&law, &[van_der_waals]));
    let bridge: (&str, &[f64]) = ("capillary", &CAPILLARY);
    check_jacobian(&lever, with_attractions(&law, &[van_der_waals, bridge]));
}

fn check_jacobian(lever: &Lever, law: Arc<dyn ForceLaw>) {
    let mut map = Strobe::new(lever.system(law), TAU);
    let mut state = vec![-21.0, 12.0, 0.0, 0.0, 0.0];
    for _ in 0..5 {
        map.advance(&mut state).unwrap();
    }
    let n = state.len();
    let mut jacobian = nalgebra::DMatrix::zeros(n, n);
    map.advance_with_jacobian(&mut state.clone(), &mut jacobian)
        .unwrap();
    for k in 0..n {
        let h = 1e-4;
        let side = |sign: f64| {
            let mut x = state.clone();
            x[k] += sign * h;
            map.clone().advance(&mut x).unwrap();
            x
        };
        let ends = [-2.0, -1.0, 1.0, 2.0].map(side);
        for i in 0..n {
            let [a, b, c, d] = [0, 1, 2, 3].map(|j| ends[j][i]);
            let slope = (8.0 * (c - b) - (d - a)) / (12.0 * h);
            let error = (jacobian[(i, k)] - slope).abs();
            assert!(
                error < 1e-7 * (1.0 + slope.abs()),
                "{i}, {k}: {slope} {}",
                jacobian[(i, k)]
            );
        }
    }
}

#[test]
fn sums_that_make_no_sense_are_refused() {
    let lever = PIB_LEVER;
    let entry = laws::law("prony-sphere").unwrap().entry;
    for other in ["hertz", "jkr", "exponential-damping", "capillary"] {
        let other = laws::law(other).unwrap();
        let values: Vec<f64> = other
            .entry
            .parameters
            .iter()
            .map(|p| common::value(p.name))
            .collect();
        let terms = [
            (entry, pib(&lever)),
            (other.entry, other.with(&values).unwrap()),
        ];
        assert!(matches!(
            laws::build_sum(&terms),
            Err(VolterraError::Sum { .. })
        ));
    }
    // Contact begins at another gap.
    let other = laws::law("van-der-waals").unwrap();
    let terms = [
        (entry, pib(&lever)),
        (other.entry, other.with(&[0.1, 10.0, 0.2]).unwrap()),
    ];
    assert!(laws::build_sum(&terms).is_err());
}
