//! Accumulated observables agree with those of the recorded trajectory, which are computed
//! independently: random systems of 1 to 12 oscillators with any damping, with a soft or a rigid
//! stop.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use nanotap_arithmetic::ComplexFunctions as _;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_flow::accumulate::{Accumulator, Functional, Request};
use nanotap_flow::trajectory::Recorder;
use nanotap_flow::{Drive, Flow, HarmonicVector, Output, Regime, Reset, System, Transition};
use proptest::prelude::*;

const OMEGA: f64 = 1.7;

/// An oscillator: its frequency, damping ratio, displacement, velocity, and weight in the gap.
type Oscillator = (f64, f64, f64, f64, f64);

/// Driven oscillators whose weighted sum `w` meets a stop with the gap `w + offset`: a spring `k`
/// and damper `c`, or a rigid stop with the coefficient of restitution `e`.
#[derive(Clone, Debug)]
struct Example {
    oscillators: Vec<Oscillator>,
    offset: f64,
    stop: Stop,
}

#[derive(Clone, Copy, Debug)]
enum Stop {
    Springy { k: f64, c: f64 },
    Rigid { e: f64 },
}

impl Example {
    fn dimension(&self) -> usize {
        2 * self.oscillators.len()
    }

    /// Displacements with the weights of the gap; `offset` of the rows as given.
    fn row(&self, first: usize) -> RowDVector<f64> {
        let mut row = RowDVector::zeros(self.dimension());
        for (j, oscillator) in self.oscillators.iter().enumerate() {
            row[2 * j + first] = oscillator.4;
        }
        row
    }

    fn gap(&self) -> Output {
        Output::linear(self.row(0), 1).with_constant(self.offset)
    }

    /// The force of the stop, in each regime.
    fn force(&self) -> Vec<Output> {
        let gap = self.gap();
        match self.stop {
            Stop::Springy { k, c } => {
                let rate = Output::linear(self.row(1), 1);
                vec![gap.scaled(0.0), gap.scaled(-k).plus(-c, &rate)]
            }
            Stop::Rigid { .. } => vec![gap],
        }
    }

    fn start(&self) -> Vec<f64> {
        let states = self.oscillators.iter().map(|o| [o.2, o.3 * o.0]);
        states.flatten().collect()
    }

    /// `None` if eigenvalues are too close to be separated in double precision.
    fn system(&self) -> Option<Arc<System>> {
        let n = self.dimension();
        let drive = Drive::single(OMEGA).unwrap();
        let mut free = DMatrix::zeros(n, n);
        let mut push = DVector::zeros(n);
        for (j, &(w, z, _, _, weight)) in self.oscillators.iter().enumerate() {
            free[(2 * j, 2 * j + 1)] = 1.0;
            free[(2 * j + 1, 2 * j)] = -w * w;
            free[(2 * j + 1, 2 * j + 1)] = -2.0 * z * w;
            push[2 * j + 1] = weight;
        }
        let forcing = HarmonicVector::zeros(n, 1).with_tone(0, &push, &(0.3 * &push));
        let regime = |index, matrix, forcing| Regime::new(index, matrix, forcing, &drive).ok();
        let gap = self.gap();
        // Accelerations along the gap's weights: those of a stop.
        let along = push.clone();
        match self.stop {
            Stop::Springy { k, c } => {
                let touching = &free - &along * (self.row(0) * k) - &along * (self.row(1) * c);
                let pressed = forcing.clone().with_constant(&(-k * self.offset * &along));
                let regimes = vec![regime(0, free, forcing)?, regime(1, touching, pressed)?];
                let transitions = vec![
                    vec![Transition::new(gap.clone(), 1)],
                    vec![Transition::new(gap.scaled(-1.0), 0)],
                ];
                Some(Arc::new(
                    System::new(drive.clone(), regimes, transitions).unwrap(),
                ))
            }
            Stop::Rigid { e } => {
                // v⁺ = v⁻ − (1 + e) (r v⁻) r/|r|² reverses the gap's rate.
                let row = self.row(1);
                let size = row.norm_squared();
                let matrix = DMatrix::identity(n, n) - row.transpose() * &row * ((1.0 + e) / size);
                let reset = Reset {
                    matrix,
                    offset: HarmonicVector::zeros(n, 1),
                };
                let transitions = vec![vec![Transition::new(gap, 0).with_reset(reset)]];
                Some(Arc::new(
                    System::new(drive.clone(), vec![regime(0, free, forcing)?], transitions)
                        .unwrap(),
                ))
            }
        }
    }
}

fn damping() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => 0.001..0.3_f64,
        1 => 0.9..1.1_f64,
        1 => Just(1.0),
        1 => 1.1..4.0_f64,
    ]
}

fn example() -> impl Strategy<Value = Example> {
    let oscillator = (
        (-1.0..4.0_f64).prop_map(f64::exp),
        damping(),
        -0.3..0.3_f64,
        -0.3..0.3_f64,
        prop_oneof![-1.0..-0.2_f64, 0.2..1.0_f64],
    );
    let stop = prop_oneof![
        3 => (1.0..60.0_f64, 0.0..1.0_f64).prop_map(|(k, c)| Stop::Springy { k, c }),
        1 => (0.3..0.95_f64).prop_map(|e| Stop::Rigid { e }),
    ];
    (
        proptest::collection::vec(oscillator, 1..=12),
        0.0..0.3_f64,
        stop,
    )
        .prop_map(|(oscillators, beyond, stop)| {
            let at_start: f64 = oscillators.iter().map(|o| o.2 * o.4).sum();
            Example {
                offset: beyond - at_start,
                oscillators,
                stop,
            }
        })
}

/// Number of periods compared.
const PERIODS: usize = 3;

fn compare(example: &Example) -> Result<(), TestCaseError> {
    let Some(system) = example.system() else {
        return Err(TestCaseError::reject("eigenvalues too close"));
    };
    let gap = example.gap();
    let other = Output::linear(example.row(1), 1)
        .plus(0.7, &Output::linear(example.row(0), 1))
        .with_tone(0, 0.4, -0.2)
        .with_constant(-0.1);
    let force = example.force();
    let frequencies = [OMEGA, 2.0 * OMEGA, OMEGA / 3.0, 1.234];

    let mut request = Request::new();
    let channels = [
        request.output(&gap),
        request.output(&other),
        request.output_by_regime(&force),
    ];
    let extrema = channels.map(|c| {
        (
            request.add(Functional::Least(c)),
            request.add(Functional::Greatest(c)),
        )
    });
    let integrals = channels.map(|c| request.add(Functional::Integral(c)));
    let fouriers =
        channels.map(|c| frequencies.map(|omega| request.add(Functional::Fourier(c, omega))));
    let pairs = [(0, 0), (0, 1), (1, 2), (2, 2)];
    let products = pairs.map(|(a, b)| request.add(Functional::Product(channels[a], channels[b])));
    let mut accumulator = Accumulator::new(&request.plan(&system).unwrap());

    let mut flow = Flow::new(Arc::clone(&system));
    flow.start(&example.start(), 0.0).unwrap();
    let mut recorder = Recorder::default();
    for _ in 0..PERIODS {
        // Rigid stops may chatter, which is an error in a system without sticking.
        if flow
            .run_period(&mut (&mut accumulator, &mut recorder))
            .is_err()
        {
            return Err(TestCaseError::reject("chatter"));
        }
    }
    let trajectory = recorder.finish(Arc::clone(&system));

    let signals = [
        trajectory.signal(&gap),
        trajectory.signal(&other),
        trajectory.signal_by_regime(&force),
    ];
    let duration = trajectory.end();
    prop_assert!((accumulator.duration() - duration).abs() < 1e-12 * duration);
    for regime in 0..system.regimes().len() {
        let (a, b) = (accumulator.time_in(regime), trajectory.time_in(regime));
        prop_assert!((a - b).abs() < 1e-12 * duration);
    }
    let sizes: Vec<f64> = signals
        .iter()
        .map(|s| {
            let (low, high) = s.range().unwrap();
            // Terms of a signal cancel; its rounding is that of the largest term.
            let terms = s.pieces.iter().map(|p| p.signal.noise() / f64::EPSILON);
            terms.fold(low.value.abs().max(high.value.abs()), f64::max)
        })
        .collect();
    for (i, signal) in signals.iter().enumerate() {
        let (low, high) = signal.range().unwrap();
        for (key, expected) in [(extrema[i].0, low.value), (extrema[i].1, high.value)] {
            let found = accumulator.values()[key].re;
            prop_assert!(
                (found - expected).abs() <= 1e-12 * sizes[i],
                "{i}: {found} {expected}"
            );
        }
        let (found, expected) = (accumulator.values()[integrals[i]].re, signal.integral());
        let known = 1e-12 * sizes[i] * duration;
        prop_assert!((found - expected).abs() <= known, "{i}: {found} {expected}");
        prop_assert!((signal.mean() - found / duration).abs() <= 1e-12 * sizes[i]);
        for (key, omega) in fouriers[i].iter().zip(frequencies) {
            let found = accumulator.values()[*key];
            let expected = signal.fourier(omega) * (0.5 * duration);
            prop_assert!(
                (found - expected).modulus() <= known,
                "{i} {omega}: {found} {expected}"
            );
        }
    }
    for (key, (a, b)) in products.iter().zip(pairs) {
        let found = accumulator.values()[*key].re;
        let expected = signals[a].product_integral(&signals[b]);
        let known = 1e-12 * sizes[a] * sizes[b] * duration;
        prop_assert!(
            (found - expected).abs() <= known,
            "{a} {b}: {found} {expected}"
        );
    }
    let events = trajectory.events();
    for (from, to) in [(0, 0), (0, 1), (1, 0)] {
        let switches = accumulator.switches(from, to);
        let here = events.iter().filter(|e| e.from == from && e.to == to);
        prop_assert_eq!(switches.count, here.clone().count() as u64);
        let speed = here.map(|e| -e.rate).fold(0.0, f64::max);
        prop_assert_eq!(switches.greatest_speed, speed);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, max_shrink_iters: 50, ..ProptestConfig::default() })]

    #[test]
    fn accumulated_observables_agree_with_the_trajectory(example in example()) {
        compare(&example)?;
    }
}

/// After it is cleared, an accumulator gives the later periods only, with the same phase of the
/// drive; extrema that are read per period are those of each period.
#[test]
fn clearing_restarts_the_accumulation() {
    let example = Example {
        oscillators: vec![(1.0, 0.05, 0.2, 0.0, 1.0), (6.3, 0.02, 0.0, 0.1, -0.5)],
        offset: 0.1,
        stop: Stop::Springy { k: 20.0, c: 0.2 },
    };
    let system = example.system().unwrap();
    let mut request = Request::new();
    let gap = request.output(&example.gap());
    assert_eq!(
        gap,
        request.output(&example.gap()),
        "one output, one channel"
    );
    let (least, first) = (
        request.add(Functional::Least(gap)),
        request.add(Functional::Fourier(gap, OMEGA)),
    );
    let plan = request.plan(&system).unwrap();
    let mut flow = Flow::new(Arc::clone(&system));
    flow.start(&example.start(), 0.0).unwrap();
    let mut whole = Accumulator::new(&plan);
    let mut each = Accumulator::new(&plan);
    let (mut lowest, mut sum) = (f64::INFINITY, nanotap_flow::Complex::new(0.0, 0.0));
    for _ in 0..5 {
        flow.run_period(&mut (&mut whole, &mut each)).unwrap();
        lowest = lowest.min(each.take(least));
        sum += each.values()[first];
        assert_eq!(each.values()[least].re, f64::INFINITY);
        each.clear();
        assert_eq!(each.duration(), 0.0);
    }
    assert_eq!(whole.values()[least].re, lowest);
    assert!((whole.values()[first] - sum).modulus() < 1e-13);
    assert_eq!(whole.periods(), 5);
}

/// A periodic motion that taps a stop has the same Fourier coefficients in each period, in the
/// hundred-thousandth as in the first: the phases of harmonics of the drive do not lose digits with
/// time.
#[test]
fn harmonics_stay_exact_over_many_periods() {
    let example = Example {
        oscillators: vec![(1.0, 0.3, 0.2, 0.0, 1.0)],
        offset: 0.1,
        stop: Stop::Springy { k: 5.0, c: 0.5 },
    };
    let system = example.system().unwrap();
    let mut request = Request::new();
    let force = request.output_by_regime(&example.force());
    let keys = [1, 2, 5].map(|n| request.add(Functional::Fourier(force, f64::from(n) * OMEGA)));
    let mut accumulator = Accumulator::new(&request.plan(&system).unwrap());
    let mut flow = Flow::new(Arc::clone(&system));
    flow.start(&example.start(), 0.0).unwrap();
    for _ in 0..100 {
        flow.run_period(&mut ()).unwrap();
    }
    flow.run_period(&mut accumulator).unwrap();
    let first = keys.map(|key| accumulator.values()[key]);
    let many = 100_000;
    for _ in 1..many {
        flow.run_period(&mut accumulator).unwrap();
    }
    for (key, first) in keys.into_iter().zip(first) {
        assert!(first.modulus() > 1e-6, "the motion taps");
        let mean = accumulator.values()[key] / f64::from(many);
        let error = (mean - first).modulus() / first.modulus();
        assert!(error < 1e-11, "{error:e}");
    }
}

/// Outputs of the wrong size are refused.
#[test]
fn outputs_that_do_not_fit_are_refused() {
    let example = Example {
        oscillators: vec![(1.0, 0.05, 0.2, 0.0, 1.0)],
        offset: 0.1,
        stop: Stop::Springy { k: 20.0, c: 0.2 },
    };
    let system = example.system().unwrap();
    let mut request = Request::new();
    request.output(&Output::linear(RowDVector::zeros(3), 1));
    assert!(request.plan(&system).is_err());
    let mut request = Request::new();
    request.output_by_regime(&[example.gap()]);
    assert!(request.plan(&system).is_err());
    let mut request = Request::new();
    let gap = request.output(&example.gap());
    request.add(Functional::Fourier(gap, f64::NAN));
    assert!(request.plan(&system).is_err());
}

/// A flight of a whole period whose least gap occurs just before its end: random cases found that
/// it was beyond the last tabulated point, as for a quarter of all ratios of period and step.
#[test]
fn extrema_at_the_end_of_a_flight_are_seen() {
    let example = Example {
        oscillators: vec![
            (12.5225, 1.52466, 0.0, 0.0, -0.2),
            (9.5646, 1.1, 0.140136, 0.0, -0.49592),
            (6.1372, 0.2821, 0.0, 0.0, -0.64619),
            (0.3937, 0.9, 0.09016, 0.216585, 0.66778),
            (8.1479, 0.140919, -0.1303, 0.2534, 0.83426),
            (2.1126, 0.175934, -0.05197, 0.024156, -0.46028),
        ],
        offset: 0.26942,
        stop: Stop::Rigid { e: 0.385 },
    };
    compare(&example).unwrap();
}

/// Terms so fast compared with the drive that a table ends before the flight, and a beat that grows
/// up to the end of the last period.
#[test]
fn extrema_beyond_the_table_are_seen() {
    let mut oscillators = vec![
        (400.0, 1e-5, 0.1, 0.0, 1.0),
        (400.28, 1e-5, -0.1, 0.0, 1.0),
        (4000.0, 0.001, 0.01, 0.0, 0.3),
    ];
    // More terms than a guard's table contains: extrema have a separate one with finer steps.
    oscillators.extend((0..8).map(|j| (500.0 + 20.0 * f64::from(j), 0.05, 1e-3, 0.0, 0.2)));
    let example = Example {
        oscillators,
        offset: 1.0,
        stop: Stop::Rigid { e: 0.4 },
    };
    compare(&example).unwrap();
}
