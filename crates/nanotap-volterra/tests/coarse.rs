//! The approximate flow compared with the exact one.

mod common;

use common::{Lever, beam, dmt, table_law};
use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_volterra::laws::table::Rows;
use nanotap_volterra::laws::{self, TABLE};
use nanotap_volterra::{
    Coarse, Complex, Drive, Flow, Kernel, Modes, Options, Refusal, System, Tone, VolterraError,
};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Amplitude in nm of the motions followed here.
const AMPLITUDE: f64 = 10.0;

/// Uniform numbers between −1 and 1 (Marsaglia's xorshift).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        2.0 * (self.0 >> 11) as f64 / (1_u64 << 53) as f64 - 1.0
    }

    /// A state in which every mode may bring the tip into contact.
    fn state(&mut self, modes: usize) -> Vec<f64> {
        let size = |i: usize| {
            let order = 1.0 + (i % modes) as f64;
            AMPLITUDE / order.powi(if i < modes { 4 } else { 2 })
        };
        (0..2 * modes).map(|i| size(i) * self.next()).collect()
    }
}

/// The state after one period of the exact flow and the branch there.
fn exact(flow: &mut Flow, x: &[f64], period: f64) -> Result<(Vec<f64>, usize), VolterraError> {
    let mut end = x.to_vec();
    flow.start(x, 0.0)?;
    flow.run_until(period)?;
    flow.state(&mut end);
    Ok((end, flow.branch()))
}

/// The largest difference of two states, velocities divided by the modes' frequencies `(2k+1)²` (a
/// bound of the beam's), relative to the amplitude.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    let modes = a.len() / 2;
    let weight = |i: usize| {
        let k = i.saturating_sub(modes) as f64;
        (2.0 * k + 1.0).powi(2) * AMPLITUDE
    };
    let parts = a.iter().zip(b).enumerate();
    parts
        .map(|(i, (a, b))| (a - b).abs() / weight(i))
        .fold(0.0, f64::max)
}

/// Compares over one period from many states. Returns the median and the largest difference.
fn compare(system: &Arc<System>, name: &str, period: f64, states: usize) -> [f64; 2] {
    let modes = system.dimension() / 2;
    let mut flow = Flow::new(Arc::clone(system));
    let mut coarse = Coarse::new(system, period).unwrap();
    let mut random = Random(88_172_645_463_325_252);
    let mut differences = Vec::new();
    for _ in 0..states {
        let mut x = random.state(modes);
        let gap = system.gap(0.0, &x).0;
        if system.law().wall().is_some_and(|wall| gap <= wall) {
            assert!(coarse.run_periods(&mut x, None, 1).is_err(), "{name}");
            continue;
        }
        // The exact flow refuses starts deep inside the repulsive wall of Lennard-Jones.
        let Ok((end, branch)) = exact(&mut flow, &x, period) else {
            assert_eq!(name, "lennard-jones");
            continue;
        };
        let reached = coarse.run_periods(&mut x, None, 1).unwrap();
        assert_eq!(reached, branch, "{name}");
        differences.push(difference(&x, &end));
    }
    differences.sort_by(f64::total_cmp);
    let count = differences.len();
    let cost = coarse.statistics().evaluations / states as u64;
    assert!(cost < 1000, "{name}: {cost} evaluations a period");
    [differences[count / 2], differences[count - 1]]
}

#[test]
fn every_law_is_followed() {
    for modes in [1, 3, 10] {
        for index in 0..TABLE.len() {
            let name = TABLE[index].entry.name;
            let law = table_law(index, None);
            if law.takes_signal() {
                continue;
            }
            let system = beam(law, modes, 1.0, 20.0, AMPLITUDE, 8.0, 20);
            let [median, largest] = compare(&Arc::new(system), name, TAU, 40);
            assert!(median < 5e-6, "{name}, {modes} modes: {median:.1e}");
            assert!(largest < 1e-4, "{name}, {modes} modes: {largest:.1e}");
        }
    }
}

/// A lever of 1 N/m and Q 100 with a free amplitude of 100 nm, 90 nm above a Lennard-Jones sample
/// (Basso, Giarré, Dahleh, Mezić, ACC 1998; S = 3 nm), from deflections at which a step of the
/// approximate flow once led through the pole: the force is even in the gap, and tiny a few
/// nanometres from it. Every motion stays in front, near the exact one.
#[test]
fn no_step_passes_a_pole() {
    let (attraction, radius) = (6.0 * 5.36, 1.0);
    let repulsion = 180.0 * 5.36 * 3.0_f64.powi(6) / 30.0;
    let law = laws::build(
        "lennard-jones",
        &[
            ("repulsion", repulsion),
            ("attraction", attraction),
            ("radius", radius),
        ],
    );
    let lever = Lever {
        k: 1.0,
        q: 100.0,
        amplitude: 100.0,
        zc: 90.0,
    };
    let system = Arc::new(lever.system(law.unwrap(), 20));
    let mut coarse = Coarse::new(&system, TAU).unwrap();
    let mut flow = Flow::new(Arc::clone(&system));
    for deflection in [
        -85.0, -60.0, -20.0, 20.0, 60.0, 100.0, 150.0, 200.0, 300.0, 400.0, 500.0,
    ] {
        let mut x = vec![deflection, 0.0];
        let (end, _) = exact(&mut flow, &x, TAU).unwrap();
        coarse.run_periods(&mut x, None, 1).unwrap();
        assert!(system.gap(TAU, &x).0 > 0.0, "{deflection}: {x:?}");
        let apart = (x[0] - end[0]).abs().max((x[1] - end[1]).abs());
        assert!(
            apart < 1e-3 * (100.0 + deflection.abs()),
            "{deflection}: {apart:e}"
        );
    }
    for deflection in [-90.0, -91.0, -300.0] {
        let refused = coarse.run_periods(&mut [deflection, 0.0], None, 1);
        let Err(VolterraError::Uncertified { reason, .. }) = refused else {
            panic!("{deflection} is behind the pole: {refused:?}")
        };
        assert_eq!(reason, Refusal::Wall);
    }
}

/// Laws whose force is infinite at a gap that a motion reaches: where a branch without contact goes
/// on to a pole, and the first row of a table.
#[test]
fn laws_declare_where_they_end() {
    for index in 0..TABLE.len() {
        let name = TABLE[index].entry.name;
        // All others touch before their pole.
        let expected = (name == "lennard-jones").then_some(0.0);
        assert_eq!(table_law(index, None).wall(), expected, "{name}");
    }
    let wall = |name: &str, contact_distance: f64| {
        let entry = laws::law(name).unwrap().entry;
        let values: Vec<(&str, f64)> = entry
            .parameters
            .iter()
            .map(|parameter| match parameter.name {
                "contact_distance" => ("contact_distance", contact_distance),
                "film_thickness" => ("film_thickness", 0.3),
                name => (name, common::value(name)),
            })
            .collect();
        laws::build(name, &values).unwrap().wall()
    };
    for name in [
        "dmt",
        "van-der-waals",
        "van-der-waals-cone",
        "van-der-waals-punch",
        "electrostatic",
        "electrostatic-ac",
        "dlvo",
    ] {
        assert_eq!(wall(name, 0.1), None, "{name}");
        assert_eq!(wall(name, 0.0), Some(0.0), "{name}");
        assert_eq!(wall(name, -0.1), Some(0.0), "{name}");
    }
    // −4πγR/(1 + d/h) with h = 0.3.
    assert_eq!(wall("capillary", -0.2), None);
    assert!((wall("capillary", -0.4).unwrap() + 0.3).abs() < 1e-15);
    for name in ["hertz", "jkr", "power-damping", "solvation", "voigt-sphere"] {
        assert_eq!(wall(name, -0.1), None, "{name}");
    }
    let rows = Rows::new(&[(0.4, 9.0), (0.6, -1.0), (1.5, 0.0)]).unwrap();
    let table = laws::law("table").unwrap();
    let law = table.through(&rows, &[0.0, 2.0, 1.0, 1.0]).unwrap();
    assert_eq!(
        (law.wall(), law.pole()),
        (Some(0.8), None),
        "gaps are doubled"
    );
    // A sum holds where all of its laws do.
    let jones = laws::law("lennard-jones").unwrap();
    let one = jones.with(&[1.0, 1.0, 1.0]).unwrap();
    let damping = laws::law("exponential-damping").unwrap();
    let other = damping.with(&[1.0, 1.0]).unwrap();
    let sum = laws::build_sum(&[(damping.entry, other), (jones.entry, one)]).unwrap();
    assert_eq!(sum.wall(), Some(0.0));
}

#[test]
fn twenty_modes_are_followed() {
    let system = beam(dmt(), 20, 1.0, 100.0, AMPLITUDE, 8.0, 20);
    let [median, largest] = compare(&Arc::new(system), "dmt", TAU, 12);
    assert!(
        median < 3e-6 && largest < 1e-4,
        "{median:.1e} {largest:.1e}"
    );
}

#[test]
fn two_tones_and_a_shaken_base_are_followed() {
    let zero = Complex::new(0.0, 0.0);
    let modes = Modes::from_oscillators(&[(1.0, 0.05), (39.3, 0.3)]).unwrap();
    let row = RowDVector::from_row_slice(&[1.0, -1.0, 0.0, 0.0]);
    let column = DVector::from_row_slice(&[0.0, 0.0, 1.0, -1.0]);
    let tone = |frequency: f64, size: f64| Tone {
        frequency,
        forcing: DVector::from_row_slice(&[
            zero,
            zero,
            Complex::new(size, 0.0),
            Complex::new(-size, 0.3 * size),
        ]),
        gap: Complex::new(0.2, -0.1),
    };
    let drive = Drive {
        constant: DVector::from_row_slice(&[0.0, 0.0, 0.1, 0.0]),
        offset: 8.0,
        tones: vec![tone(1.0, 0.5), tone(6.25, 4.0)],
    };
    let kernel = Kernel::new(modes, row, column, TAU / 4.0, 20).unwrap();
    let system = Arc::new(System::new(kernel, dmt(), drive, Options::new(1e-13)).unwrap());
    // Both tones have returned after four periods of the first.
    let mut flow = Flow::new(Arc::clone(&system));
    let mut coarse = Coarse::new(&system, 4.0 * TAU).unwrap();
    let mut random = Random(1);
    let mut differences: Vec<f64> = (0..12)
        .map(|_| {
            let mut x = random.state(2);
            let (end, _) = exact(&mut flow, &x, 4.0 * TAU).unwrap();
            coarse.run_periods(&mut x, None, 1).unwrap();
            difference(&x, &end)
        })
        .collect();
    differences.sort_by(f64::total_cmp);
    assert!(
        differences[6] < 3e-5 && differences[11] < 1e-3,
        "{differences:?}"
    );
}

/// From exact sensitivities, or from differences of the exact flow where those of many modes under
/// smooth forces are too coarse.
#[test]
fn the_jacobian_is_that_of_the_exact_flow() {
    let x = [-7.0, 0.02, -7.0, 0.1];
    for index in 0..TABLE.len() {
        let name = TABLE[index].entry.name;
        let law = table_law(index, None);
        if law.takes_signal() {
            continue;
        }
        let system = Arc::new(beam(law, 2, 1.0, 20.0, AMPLITUDE, 8.0, 20));
        let mut flow = Flow::new(Arc::clone(&system));
        let mut reference = DMatrix::zeros(4, 4);
        for c in 0..4 {
            let ends = [-1e-5, 1e-5].map(|shift| {
                let mut x = x;
                x[c] += shift;
                exact(&mut flow, &x, TAU).unwrap().0
            });
            for i in 0..4 {
                reference[(i, c)] = (ends[1][i] - ends[0][i]) / 2e-5;
            }
        }
        let mut jacobian = DMatrix::zeros(4, 4);
        let mut coarse = Coarse::new(&system, TAU).unwrap();
        let mut end = x;
        coarse
            .run_with_jacobian(&mut end, None, &mut jacobian)
            .unwrap();
        let error = (&jacobian - &reference).amax() / reference.amax();
        assert!(error < 2e-3, "{name}: {error:.1e}");
        let mut alone = x;
        coarse.run_periods(&mut alone, None, 1).unwrap();
        assert_eq!(end, alone, "{name}");
    }
}

/// The repulsive orbit of the crate's example, stable with a multiplier of 0.984.
#[test]
fn ten_thousand_periods_stay_on_a_stable_orbit() {
    let lever = Lever {
        k: 0.9,
        q: 200.0,
        amplitude: 20.0,
        zc: 18.0,
    };
    let system = Arc::new(lever.system(dmt(), 20));
    let mut flow = Flow::new(Arc::clone(&system));
    let mut orbit = vec![7.0, 17.1];
    for _ in 0..2000 {
        orbit = exact(&mut flow, &orbit, TAU).unwrap().0;
    }
    let mut coarse = Coarse::new(&system, TAU).unwrap();
    let mut x = orbit.clone();
    for _ in 0..10 {
        coarse.run_periods(&mut x, None, 1000).unwrap();
        // The error of one period over 1 − 0.984.
        let distance = (x[0] - orbit[0]).abs().max((x[1] - orbit[1]).abs());
        assert!(distance < 2e-4 * lever.amplitude, "{distance}");
    }
    assert!(coarse.statistics().evaluations < 10_000 * 300);
}

#[test]
fn invalid_starts_and_steps_are_refused() {
    let system = Arc::new(beam(dmt(), 1, 1.0, 20.0, AMPLITUDE, 8.0, 20));
    assert!(matches!(
        Coarse::new(&system, 0.0),
        Err(VolterraError::Value { .. })
    ));
    let mut coarse = Coarse::new(&system, TAU).unwrap();
    assert!(matches!(
        coarse.run_periods(&mut [0.0], None, 1),
        Err(VolterraError::Shape { .. })
    ));
    assert!(matches!(
        coarse.run_periods(&mut [0.0, f64::NAN], None, 1),
        Err(VolterraError::Value { .. })
    ));
    // A motion of any size ends with a state or a typed error.
    for size in [1e3, 1e9, 1e150, 1e300] {
        let mut x = [-size, size];
        if coarse.run_periods(&mut x, Some(7), 1).is_ok() {
            assert!(x.iter().all(|v| v.is_finite()));
        }
    }
}
