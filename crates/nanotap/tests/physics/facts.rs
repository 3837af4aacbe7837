//! Known orbits and invariants. Numbers without a stated source are reference values of an
//! independent program.

use nanotap::model::Model;
use nanotap::model::cantilever::{Cantilever, CosineTerm};
use nanotap::observe::{ObservableSet, measure};
use nanotap::study::orbit::{OrbitOptions, OrbitReport, orbit};
use nanotap_flow::Trajectory;
use proptest::prelude::*;

fn at(omega: f64) -> Cantilever {
    Cantilever {
        omega,
        ..Cantilever::paper()
    }
}

fn settled(case: &Cantilever) -> OrbitReport {
    orbit(&Model::cantilever(case).unwrap(), &OrbitOptions::default()).unwrap()
}

fn modulus([re, im]: [f64; 2]) -> f64 {
    re.hypot(im)
}

/// N = 3, Eq. (26), α1 = 0.1, Ω = 3: state, multipliers, switches.
#[test]
fn period_one_at_omega_3() {
    let report = settled(&at(3.0));
    assert_eq!((report.period, report.stable), (1, true));
    let expected = [
        0.04867449626,
        -4.170932009e-4,
        3.895611e-5,
        -0.02693553697,
        3.208938387e-3,
        3.311213241e-3,
    ];
    for (got, expected) in report.state.iter().zip(expected) {
        assert!((got - expected).abs() < 6e-12, "{got} {expected}");
    }
    for (pair, expected) in [0.868606, 0.831596, 0.826539].iter().enumerate() {
        for k in [2 * pair, 2 * pair + 1] {
            assert!((modulus(report.multipliers[k]) - expected).abs() < 1e-6);
        }
    }
    let times: Vec<f64> = report.events.iter().map(|e| e.tau).collect();
    assert_eq!(times.len(), 2);
    for (got, expected) in times.iter().zip([1.3556791576, 1.8300415203]) {
        assert!((got - expected).abs() < 1e-10, "{got} {expected}");
    }
    assert!(report.observables.energy_balance.residual.abs() < 1e-11);
    assert!(
        report.determinant_defect < 1e-10,
        "{}",
        report.determinant_defect
    );
}

/// N = 3, Eq. (26), α1 = 0.1, Ω = 4.1: range of the gap, largest multiplier.
#[test]
fn period_one_at_omega_4_1() {
    let report = settled(&at(4.1));
    let [low, high] = report.observables.gap_range;
    assert!(
        (low + 0.40724).abs() < 1e-5 && (high - 1.18168).abs() < 1e-5,
        "{low} {high}"
    );
    assert!((modulus(report.multipliers[0]) - 0.895782).abs() < 1e-6);
}

/// N = 3, Ω = 20, α1 = 0.1: one period-1 orbit, W in [−0.41706, 1.75832] by sampling of a period
/// (the true maximum is 2e-5 higher, between two of those samples).
#[test]
fn period_one_at_omega_20() {
    let report = settled(&at(20.0));
    assert_eq!(report.period, 1);
    assert!((report.observables.tip_min + 0.41706).abs() < 1e-5);
    assert!(
        (report.observables.tip_max - 1.75832).abs() < 3e-5,
        "{}",
        report.observables.tip_max
    );
    // Extrema are roots of the rate: no dense sample exceeds them, and the densest is as close as
    // its spacing allows.
    let model = Model::cantilever(&at(20.0)).unwrap();
    let tip = report.trajectory.curve(&model.tip);
    let samples = 20_000;
    let highest = (0..samples)
        .map(|i| {
            tip.at(model.period() * f64::from(i) / f64::from(samples))
                .unwrap()
        })
        .fold(f64::NEG_INFINITY, f64::max);
    assert!((0.0..1e-7).contains(&(report.observables.tip_max - highest + 1e-15)));
}

/// N = 1, Ω = 20: half of peak to peak is 0.1447.
#[test]
fn single_mode_at_omega_20() {
    let report = settled(&at(20.0).with_modes(1));
    assert!((report.observables.amplitude - 0.1447).abs() < 1e-4);
}

/// At Ω = 2.6 the period-1 orbit exists and is unstable, μ = −1.392.
#[test]
fn unstable_period_one_at_omega_2_6() {
    let model = Model::cantilever(&at(2.6)).unwrap();
    let report = orbit(
        &model,
        &OrbitOptions {
            period: Some(1),
            ..OrbitOptions::default()
        },
    )
    .unwrap();
    assert!(!report.stable);
    assert!((report.multipliers[0][0] + 1.392).abs() < 1e-3 && report.multipliers[0][1] == 0.0);
}

/// Undamped bilinear frequency at α5 = 0: 2ω₁ω₂/(ω₁ + ω₂) = 4.351246 for N = 1, α1 = 0.1, α4 = 20.
/// With a drive of amplitude 1e-9 it is a free oscillation.
#[test]
fn bilinear_frequency_of_one_mode() {
    let case = Cantilever {
        modes: 1,
        alpha2: 1e-9,
        omega: 0.05,
        ..Cantilever::paper_eq24()
    };
    let model = Model::cantilever(&case).unwrap();
    let trajectory = Trajectory::record(&model.system, &[0.0, 1.0], 1).unwrap();
    let starts: Vec<f64> = trajectory
        .events()
        .iter()
        .filter(|e| e.to == 1)
        .map(|e| e.time)
        .collect();
    let cycles = (starts.len() - 1) as f64;
    let frequency = std::f64::consts::TAU * cycles / (starts[starts.len() - 1] - starts[0]);
    assert!((frequency - 4.351246).abs() < 1e-6, "{frequency}");
}

/// A lever without contact moves like the base-excited free beam: tip over base amplitude 2.878087
/// at Ω = 2.6 without tip mass, up to the neglected modes.
#[test]
fn free_lever_moves_as_the_exact_beam() {
    let case = Cantilever {
        modes: 20,
        alpha1: 0.0,
        alpha3: 1e-9,
        alpha5: 5.0,
        ..Cantilever::paper()
    };
    let model = Model::cantilever(&case).unwrap();
    let report = orbit(
        &model,
        &OrbitOptions {
            period: Some(1),
            state: Some(vec![0.0; 40].into()),
            ..OrbitOptions::default()
        },
    );
    let report = report.unwrap();
    assert_eq!(report.events.len(), 0);
    // W is relative to the base: the absolute motion of the tip includes the base's motion.
    let gain = report.observables.amplitude / case.alpha2 + 1.0;
    assert!((gain - 2.878087).abs() < 1e-5, "{gain}");
}

/// The printed Eq. (14) is a different drive: the motion differs, but its energy balances.
#[test]
fn printed_cosine_term_balances_its_energy_too() {
    let case = Cantilever {
        cosine_term: CosineTerm::Printed,
        ..at(3.0)
    };
    let (printed, corrected) = (settled(&case), settled(&at(3.0)));
    assert!((printed.state[0] - corrected.state[0]).abs() > 1e-5);
    assert!(printed.observables.energy_balance.residual.abs() < 1e-11);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// For random parameters: energy balances over any run, the determinant of the map follows
    /// Liouville's formula, and with α5 = 0 doubling α2 and the state doubles everything.
    #[test]
    fn invariants_hold_for_random_cases(
        modes in 1usize..8,
        alpha1 in 0.0..0.5_f64,
        alpha3 in 0.01..0.5_f64,
        alpha4 in 0.1..100.0_f64,
        alpha6 in 0.0..3.0_f64,
        omega in 0.5..25.0_f64,
    ) {
        let case = Cantilever { modes, alpha1, alpha3, alpha4, alpha6, omega, ..Cantilever::paper() };
        let model = Model::cantilever(&case).unwrap();
        let start = vec![0.0; 2 * modes];
        let run = Trajectory::record(&model.system, &start, 12).unwrap();
        let seen = measure(&model, &start, 12, ObservableSet::ALL).unwrap();
        prop_assert!(seen.energy_balance.residual.abs() < 1e-11, "{:?}", seen.energy_balance);

        let doubled = Model::cantilever(&Cantilever { alpha2: 2.0 * case.alpha2, ..case.clone() }).unwrap();
        let twice = Trajectory::record(&doubled.system, &start, 4).unwrap();
        for (a, b) in run.events().iter().zip(twice.events()) {
            prop_assert!((a.time - b.time).abs() < 1e-9);
        }

        let mut flow = nanotap_flow::Flow::new(model.system.clone());
        let state = run.state_at(run.end()).unwrap();
        flow.start(&state, 0.0).unwrap();
        let mut jacobian = nalgebra::DMatrix::zeros(2 * modes, 2 * modes);
        flow.run_period_with_jacobian(&mut jacobian).unwrap();
        let period = Trajectory::record(&model.system, &state, 1).unwrap();
        let trace: f64 = (0..2)
            .map(|r| model.system.regimes()[r].matrix().trace() * period.time_in(r))
            .sum();
        // log|det| by LU of the scaled matrix loses about the digits of its condition.
        let determinant = jacobian.determinant().abs();
        if determinant > 1e-12 {
            prop_assert!((determinant.ln() - trace).abs() < 1e-7 * (1.0 + trace.abs()));
        }
    }
}

/// The clearance of a long run examines only the lowest few of its segments closely. It must be the
/// least of the clearances of its single periods, where every segment is examined closely.
#[test]
fn clearance_of_a_long_run_is_the_least_of_its_periods() {
    for (omega, modes) in [(2.6, 3), (20.0, 5)] {
        let case = Cantilever {
            omega,
            ..Cantilever::paper()
        }
        .with_modes(modes);
        let model = Model::cantilever(&case).unwrap();
        let seen = |state: &[f64], periods: usize| {
            let run = Trajectory::record(&model.system, state, periods).unwrap();
            let seen = measure(&model, state, periods, ObservableSet::ALL).unwrap();
            (
                seen.beam_clearance.unwrap(),
                run.state_at(run.end()).unwrap(),
            )
        };
        let mut state = vec![0.0; 2 * modes];
        let (whole, _) = seen(&state, 40);
        let mut least = f64::INFINITY;
        for _ in 0..40 {
            let (height, next) = seen(&state, 1);
            least = least.min(height);
            state = next;
        }
        assert!((whole - least).abs() < 1e-9, "{whole} {least}");
    }
}

/// The clearance of one period from `state`, and the least height of `places` places over the whole
/// period.
fn clearance_and_least_height(model: &Model, state: &[f64], places: usize) -> (f64, f64) {
    let seen = measure(model, state, 1, ObservableSet::ALL).unwrap();
    let run = Trajectory::record(&model.system, state, 1).unwrap();
    let beam = model.beam.as_ref().unwrap();
    let least = (0..=places)
        .map(|i| {
            let height = beam.height(i as f64 / places as f64);
            run.signal(&height).range().unwrap().0.value
        })
        .fold(f64::INFINITY, f64::min);
    (seen.beam_clearance.unwrap(), least)
}

/// Two places compete here; the lower one, at ξ = 0.328, has the higher neighbours on the coarse
/// grid of places. Heights at 20,000 places.
#[test]
fn clearance_is_that_of_the_lower_of_two_valleys() {
    let case = Cantilever {
        alpha1: 0.657,
        alpha2: 0.01,
        alpha3: 0.0576,
        alpha4: 18.08,
        omega: 10.435,
        ..Cantilever::paper()
    };
    let model = Model::cantilever(&case).unwrap();
    let mut state = vec![0.0; 6];
    for _ in 0..8 {
        let (found, least) = clearance_and_least_height(&model, &state, 20_000);
        assert!((-1e-11..2e-8).contains(&(least - found)), "{found} {least}");
        let run = Trajectory::record(&model.system, &state, 1).unwrap();
        state = run.state_at(run.end()).unwrap();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// No place of the beam is ever lower than the clearance, and one is equal to it.
    #[test]
    fn the_clearance_is_the_least_of_many_heights(
        modes in 1usize..6,
        alpha1 in 0.0..1.0_f64,
        alpha2 in 0.01..1.0_f64,
        alpha3 in 0.01..0.5_f64,
        alpha4 in 0.1..100.0_f64,
        omega in 0.5..25.0_f64,
        before in 0usize..40,
    ) {
        let case = Cantilever { alpha1, alpha2, alpha3, alpha4, omega, ..Cantilever::paper() }
            .with_modes(modes);
        let model = Model::cantilever(&case).unwrap();
        let mut state = vec![0.0; 2 * modes];
        if before > 0 {
            let run = Trajectory::record(&model.system, &state, before).unwrap();
            state = run.state_at(run.end()).unwrap();
        }
        let (found, least) = clearance_and_least_height(&model, &state, 400 * modes);
        prop_assert!((-1e-10..1e-4).contains(&(least - found)), "{} {}", found, least);
    }
}
