//! The search on a table against certified steps.

use super::on_table;
use super::side_by_side::{self, Signals};
use super::tabulated::{Followed, Table};
use super::{Crossing, Start, Statistics, first_crossing};
use crate::regime::{Kernel, KernelFrame};
use crate::signal::Signal;
use crate::simd::{ComplexOctet, ComplexVector, LANES, Plain, Twice, WIDTH, Wide, layout};
use crate::{Complex, Drive, HarmonicVector, Output, Regime};
use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_arithmetic::ComplexFunctions as _;
use proptest::prelude::*;

/// Oscillators side by side, seen through one output; each is (frequency, damping,
/// displacement, velocity, weight).
type Oscillators = Vec<(f64, f64, f64, f64, f64)>;

/// The table of the output, taken positive at the start, its signal from there and how
/// far to look; and the output's sign.
fn example(oscillators: &Oscillators, tone: f64, constant: f64) -> (Table, Signal, f64, f64) {
    let (kernel, table, packed, side) = guard(oscillators, tone, constant);
    let length = table.reach().min(PERIOD);
    let mut signal = Signal::default();
    signal.refill::<Plain>(&kernel, &packed, length);
    (table, signal, length, side)
}

/// Drive period of the examples.
const PERIOD: f64 = std::f64::consts::TAU / 1.7;

/// The same output as a guard, with its table, coordinates at the start, and its sign.
fn guard(
    oscillators: &Oscillators,
    tone: f64,
    constant: f64,
) -> (Kernel, Table, Vec<ComplexVector>, f64) {
    let n = oscillators.len();
    let drive = Drive::single(1.7).unwrap();
    let mut matrix = DMatrix::zeros(2 * n, 2 * n);
    let mut row = RowDVector::zeros(2 * n);
    let mut state = DVector::zeros(2 * n);
    for (j, &(frequency, damping, x, v, weight)) in oscillators.iter().enumerate() {
        matrix[(2 * j, 2 * j + 1)] = 1.0;
        matrix[(2 * j + 1, 2 * j)] = -frequency * frequency;
        matrix[(2 * j + 1, 2 * j + 1)] = -2.0 * damping * frequency;
        row[2 * j] = weight;
        state[2 * j] = x;
        state[2 * j + 1] = v * frequency;
    }
    let output = Output::linear(row, 1)
        .with_tone(0, tone, 0.0)
        .with_constant(constant);
    let side = if output.at(&drive, state.as_slice(), 0.0) < 0.0 {
        -1.0
    } else {
        1.0
    };
    let regime = Regime::new(0, matrix, HarmonicVector::zeros(2 * n, 1), &drive).unwrap();
    let kernel = KernelFrame::new(&regime, &drive).kernel(&regime.project(&output.scaled(side)));
    let mut modal = vec![Complex::new(0.0, 0.0); n];
    let mut rest = vec![0.0; 2 * n];
    regime.to_modal(&drive, state.as_slice(), 0.0, &mut rest, &mut modal);
    modal.push(Complex::new(1.0, 0.0));
    let table = Table::new(&kernel, drive.period()).unwrap();
    (kernel, table, layout::list(&modal), side)
}

fn oscillators(most: usize) -> impl Strategy<Value = Oscillators> {
    let one = (
        (-0.7..5.0_f64).prop_map(f64::exp),
        0.001..0.3,
        -1.0..1.0_f64,
        -1.0..1.0_f64,
        -1.0..1.0_f64,
    );
    proptest::collection::vec(one, 1..most)
}

/// Two searches of one signal found the same, to what rounding leaves.
fn same_crossing(
    found: Option<&Crossing>,
    expected: Option<&Crossing>,
    signal: &Signal,
    length: f64,
) -> Result<(), TestCaseError> {
    match (found, expected) {
        (None, None) => {}
        (Some(a), Some(b)) => {
            // A crossing at speed r is known to the value's rounding over r.
            let known = 1e-14 + signal.noise() / b.rate.abs();
            prop_assert!((a.at - b.at).abs() <= 4.0 * known, "{a:?} {b:?}");
            let slack = 1e-9 * (1.0 + signal.fastest() * signal.size());
            prop_assert!((a.rate - b.rate).abs() <= slack, "{a:?} {b:?}");
        }
        // At the very end, rounding decides.
        (Some(one), None) | (None, Some(one)) => {
            prop_assert!(
                length - one.at < 1e-12,
                "{found:?} {expected:?} of {length}"
            );
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// The table finds the crossing that certified steps find, and no other: with few
    /// terms and one grid, and with more than are followed.
    #[test]
    fn table_and_certified_steps_agree(
        oscillators in oscillators(12),
        tone in -1.0..1.0_f64,
        constant in -1.0..1.0_f64,
    ) {
        let (table, mut signal, length, _) = example(&oscillators, tone, constant);
        let mut statistics = Statistics::default();
        let start = Start::Inside;
        let found = on_table::first_crossing::<Plain>(
            &table, &mut signal, &mut Followed::default(), length, start, &mut statistics,
        );
        let expected = first_crossing(&signal, length, start, &mut statistics);
        same_crossing(found.as_ref(), expected.as_ref(), &signal, length)?;
    }

    /// From the surface, with the rate known.
    #[test]
    fn leaving_the_surface_agrees(
        oscillators in oscillators(7),
        tone in -1.0..1.0_f64,
    ) {
        // The constant puts the start on the surface.
        let (_, signal, _, side) = example(&oscillators, tone, 0.0);
        let at_start = side * signal.first_jet().value;
        let (table, mut signal, length, _) = example(&oscillators, tone, -at_start);
        let start = Start::Surface { rate: None };
        let mut statistics = Statistics::default();
        let found = on_table::first_crossing::<Plain>(
            &table, &mut signal, &mut Followed::default(), length, start, &mut statistics,
        );
        let expected = first_crossing(&signal, length, start, &mut statistics);
        same_crossing(found.as_ref(), expected.as_ref(), &signal, length)?;
    }
}

/// Eight signals of one guard: their amplitudes are those of `packed`, each lane's multiplied by
/// different factors.
fn eight(
    kernel: &Kernel,
    packed: &[ComplexVector],
    factors: &[[f64; 2]; LANES],
) -> Vec<ComplexOctet> {
    let amplitude = |k: usize| {
        let (vector, lane) = layout::place(k);
        let [re, im] = &kernel.vectors[vector].weight;
        layout::get(packed, k) * Complex::new(re[lane], im[lane])
    };
    (0..kernel.count)
        .map(|k| {
            let mut all = ComplexOctet::default();
            for (lane, [re, im]) in factors.iter().enumerate() {
                // Another factor for each term, so that no two lanes are alike.
                let turn = Complex::new(*re, *im) * (1.0 + 0.3 * (k * lane) as f64 / 8.0);
                let a = amplitude(k) * turn;
                (all[0][lane], all[1][lane]) = (a.re, a.im);
            }
            all
        })
        .collect()
}

/// The signal in a lane.
fn lane_of(kernel: &Kernel, amplitudes: &[ComplexOctet], lane: usize, length: f64) -> Signal {
    let terms: Vec<(Complex, Complex)> = amplitudes
        .iter()
        .enumerate()
        .map(|(k, [re, im])| (kernel.rate(k), Complex::new(re[lane], im[lane])))
        .collect();
    Signal::from_terms(kernel.constant, &terms, Vec::new(), length)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Eight signals side by side: none crosses zero before the interval that is first found open,
    /// and where none is found none crosses at all. From inside, and from the surface.
    #[test]
    fn no_crossing_is_passed_over_side_by_side(
        oscillators in oscillators(9),
        tone in -1.0..1.0_f64,
        constant in -0.5..2.0_f64,
        factors in proptest::array::uniform8(proptest::array::uniform2(-1.0..1.0_f64)),
        part in 0.1..1.0_f64,
        on_surface in any::<bool>(),
    ) {
        let (kernel, table, packed, _) = guard(&oscillators, tone, constant);
        prop_assume!(side_by_side::fits(&table));
        let reach = part * side_by_side::reach(&table).min(PERIOD);
        let mut amplitudes = eight(&kernel, &packed, &factors);
        if on_surface {
            // The first term puts the start on the surface.
            for lane in 0..LANES {
                let value = lane_of(&kernel, &amplitudes, lane, reach).first_jet().value;
                amplitudes[0][0][lane] -= value;
            }
        }
        let mut signals = Signals {
            kernel: &kernel,
            table: &table,
            amplitudes: &amplitudes,
            sums: [[0.0; LANES]; 4],
            size: [kernel.constant.abs(); LANES],
            reach: [reach; LANES],
            on_surface: 0,
            rate: [0.0; LANES],
            idle: 0,
        };
        let mut starts = [None; LANES];
        for (lane, start) in starts.iter_mut().enumerate() {
            for (k, [re, im]) in amplitudes.iter().enumerate() {
                let (vector, place) = layout::place(k);
                let size = re[lane].hypot(im[lane]);
                signals.size[lane] += size;
                for (sum, weight) in signals.sums.iter_mut().zip(&table.fine.weights[vector]) {
                    sum[lane] += size * weight[place];
                }
            }
            let first = lane_of(&kernel, &amplitudes, lane, reach).first_jet();
            *start = if on_surface && first.rate > 1e-3 {
                signals.on_surface |= 1 << lane;
                signals.rate[lane] = first.rate;
                Some(Start::Surface { rate: None })
            } else if !on_surface && first.value > 0.0 {
                Some(Start::Inside)
            } else {
                // Lanes that do not rise from the surface need no certificate. What is below zero is looked
                // at, and not certified.
                signals.idle |= u32::from(on_surface) << lane;
                None
            };
        }
        let (found, _) = signals.first_open::<Twice<Plain>>();
        prop_assert_eq!(found.found & signals.idle, 0);
        let begins = <Twice<Plain> as Wide>::store(found.start);
        for (lane, start) in starts.iter().enumerate() {
            let Some(start) = start else {
                let open = found.found & (1 << lane) != 0;
                prop_assert!(on_surface || (open && begins[lane] == 0.0), "{lane}");
                continue;
            };
            let signal = lane_of(&kernel, &amplitudes, lane, reach);
            let mut statistics = Statistics::default();
            let crossing = first_crossing(&signal, reach, *start, &mut statistics);
            let open = found.found & (1 << lane) != 0;
            if let Some(crossing) = crossing {
                prop_assert!(open || reach - crossing.at < 1e-12, "{crossing:?} of {reach}");
                prop_assert!(!open || crossing.at >= begins[lane], "{crossing:?} {}", begins[lane]);
            }
        }
    }
}

/// The table's exponentials against the library's.
#[test]
fn tabulated_exponentials_are_accurate() {
    let (table, _, _, _) = example(&vec![(3.0, 0.01, 1.0, 0.0, 1.0)], 0.3, 1.0);
    let grid = &table.fine;
    // Its two terms: the drive's, and the oscillator's.
    let rates = [
        Complex::new(0.0, 1.7),
        Complex::new(-0.03, 3.0 * (1.0_f64 - 1e-4).sqrt()),
    ];
    for (i, entries) in grid.table.chunks(grid.terms).enumerate() {
        for (entry, rate) in entries.iter().zip(rates) {
            for lane in 0..WIDTH {
                let s = (i * WIDTH + lane) as f64 * grid.step;
                let exact = (rate * s).exponential();
                let imaginary = entry[1][lane].abs();
                assert!((entry[0][lane] - exact.re).abs() < 4e-15, "{i} {lane}");
                assert!((imaginary - exact.im.abs()).abs() < 4e-15, "{i} {lane}");
            }
        }
    }
}
