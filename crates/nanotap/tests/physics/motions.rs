//! Motions and bifurcations of the model.

use nanotap::ErrorKind;
use nanotap::case::{Case, Key, PlaneFamily};
use nanotap::control::Control;
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap::model::model_map::ModelMap;
use nanotap::model::oscillator::{Oscillator, Stop};
use nanotap::model::parameter::Parameter;
use nanotap::study::attractors::{AttractorsOptions, attractors};
use nanotap::study::branch::{BranchOptions, branch};
use nanotap::study::lyapunov::{LyapunovOptions, Section, lyapunov, section};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap::study::simulate::{Classification, SimulateOptions, simulate};
use nanotap::study::start_box::default_box;
use nanotap_dynamics::{
    AttractorKind, CensusOptions, DMatrix, Scheduling as _, StartOutcome, StroboscopicMap as _,
    TwoParameterFamily as _, census,
};

use crate::stated;

fn at(omega: f64) -> Cantilever {
    Cantilever::paper().with(Parameter::Omega, omega)
}

fn over(key: Key, from: f64, to: f64) -> BranchOptions {
    BranchOptions {
        period: Some(1),
        max_step: 0.04,
        ..BranchOptions::over(key, from, to)
    }
}

fn flips(subject: &Case, options: &BranchOptions) -> Vec<f64> {
    branch(subject, options, &Control::default())
        .unwrap()
        .bifurcations
        .iter()
        .filter(|b| b.kind == "flip")
        .map(|b| b.parameter)
        .collect()
}

/// Reference: the period-1 orbit doubles at Ω = 2.9137224181 and 2.5050406984, from either side,
/// with the period given or found.
#[test]
fn the_period_1_orbit_doubles_at_the_same_points_from_either_side() {
    let subject = Case::from(at(3.0));
    let key = Key::Omega;
    let down = flips(&subject, &over(key, 3.0, 2.45));
    let mut up = flips(&subject, &over(key, 2.45, 3.0));
    up.reverse();
    for (found, expected) in down.iter().zip([2.913_722_418_1, 2.505_040_698_4]) {
        assert!((found - expected).abs() < 1e-9, "{down:?}");
    }
    assert_eq!((down.len(), up.len()), (2, 2));
    for (a, b) in down.iter().zip(&up) {
        assert!((a - b).abs() < 1e-10, "{a} {b}");
    }
}

/// Reference: the restitution model (gap 0, r = 0.8) flips at ω = 1.2606766 and 2.6533477. A soft
/// stop of increasing stiffness (with the same restitution) approaches the second value: the
/// contact of half a sine lasts π√(m/k), and the error of the flip decreases with it.
#[test]
fn the_rigid_stop_is_the_limit_of_stiff_ones() {
    let rigid = Oscillator {
        mass: 1.0,
        stiffness: 1.0,
        damping: 0.0,
        forcing: 1.0,
        omega: 2.0,
        gap: 0.0,
        stop: Stop::Rigid { restitution: 0.8 },
    };
    let key = Key::OscillatorOmega;
    let limit = flips(&Case::from(rigid), &over(key, 2.0, 2.9));
    assert!((limit[0] - 2.653_347_7).abs() < 1e-7, "{limit:?}");
    let low = flips(&Case::from(rigid), &over(key, 2.0, 1.1));
    assert!((low[0] - 1.260_676_6).abs() < 1e-7, "{low:?}");
    // r = e^{−πζ/√(1 − ζ²)} of half an oscillation in contact.
    let ratio = -0.8f64.ln() / std::f64::consts::PI;
    let zeta = ratio / (1.0 + ratio * ratio).sqrt();
    let errors: Vec<f64> = [1e4, 1.6e5]
        .into_iter()
        .map(|stiffness: f64| {
            let damping = 2.0 * zeta * stiffness.sqrt();
            let soft = Oscillator {
                stop: Stop::Soft { stiffness, damping },
                ..rigid
            };
            let found = flips(&Case::from(soft), &over(key, 2.0, 2.9));
            (found[0] - limit[0]).abs()
        })
        .collect();
    // Sixteen times the stiffness, a quarter of the contact time.
    assert!(errors[0] < 0.1 && errors[1] < errors[0] / 3.0, "{errors:?}");
}

/// At Ω = 20, α1 = 0 a period-1 and a period-4 coexist; α1 = 0.1 has only a
/// period-1 with W in [−0.41706, 1.75832].
#[test]
fn the_census_at_high_frequency_is_complete() {
    let count = |alpha1: f64| {
        let model = Model::cantilever(&at(20.0).with(Parameter::Alpha1, alpha1)).unwrap();
        let options = AttractorsOptions {
            starts: Some(64),
            ..AttractorsOptions::default()
        };
        attractors(&model, &options, &Control::default()).unwrap()
    };
    let two = count(0.0);
    let periods: Vec<usize> = two
        .attractors
        .iter()
        .map(|a| a.orbit.as_ref().unwrap().period)
        .collect();
    assert_eq!(periods, [4, 1]);
    let one = count(0.1);
    assert_eq!((one.attractors.len(), one.undecided.len()), (1, 0));
    let observables = &one.attractors[0].orbit.as_ref().unwrap().observables;
    assert!((observables.tip_min + 0.41706).abs() < 5e-6);
    // The exact maximum, which 50,000 samples per period give too, is 2.3e-5 above the reference's.
    assert!(
        (observables.tip_max - 1.75832).abs() < 3e-5,
        "{}",
        observables.tip_max
    );
    // The default box contains the motions.
    let sides = &two.sides;
    for state in &two.attractors[0].orbit.as_ref().unwrap().states {
        for (value, side) in state.iter().zip(sides) {
            assert!(
                (side.lower..=side.upper).contains(value),
                "{side:?} {value}"
            );
        }
    }
}

/// Every start of a census goes to the motion of a long run from it: with a period 1 and a period 4
/// at one frequency, and with the attractive and the repulsive state, where the tip reaches the
/// attractive one from afar before it touches. Under the nonlinear law of the latter, starts are
/// followed on the approximate map, and a long run on that map decides. The basins are finely
/// interwoven: the error of the approximate map leads single starts elsewhere, as any small
/// difference does, but without a preferred direction.
#[test]
fn every_start_goes_to_the_motion_of_a_long_run() {
    let bistable = stated(include_str!("../../../../docs/cases/bistable-lever.toml"));
    let paper = Model::cantilever(&at(20.0).with(Parameter::Alpha1, 0.0)).unwrap();
    let lever = bistable.model().unwrap();
    for (model, count, long) in [(paper, 128, 1500), (lever, 64, 3000)] {
        let starts = default_box(&model).unwrap().starts(1, count);
        let map = ModelMap::new(&model);
        let found = census(
            &map,
            &starts,
            &CensusOptions::default(),
            &Control::default(),
        );
        assert_eq!(found.attractors.len(), 2);
        let destination = |map: &ModelMap, start: &[f64], tolerance: f64| {
            let (mut map, mut state) = (map.clone(), start.to_vec());
            for _ in 0..long {
                map.advance(&mut state).unwrap();
            }
            found.attractors.iter().position(|a| match &a.kind {
                AttractorKind::Periodic(o) => o.nearest(&state).1 < tolerance * o.scale(),
                _ => false,
            })
        };
        let coarse = map.coarse();
        let (mut elsewhere, mut gained) = (0, 0i32);
        for (k, (start, outcome)) in starts.iter().zip(&found.outcomes_by_start).enumerate() {
            let StartOutcome::Attractor { index, .. } = outcome else {
                panic!("start {k}: {outcome:?}");
            };
            if let Some(coarse) = &coarse {
                // Within the error of the approximate map.
                assert_eq!(Some(*index), destination(coarse, start, 1e-3), "start {k}");
            }
            let exact = destination(&map, start, 1e-6);
            assert!(exact.is_some(), "start {k}");
            if Some(*index) != exact {
                elsewhere += 1;
                gained += if *index == 0 { 1 } else { -1 };
            }
        }
        assert!(coarse.is_some() || elsewhere == 0, "{elsewhere}");
        // Three standard deviations of a fair coin.
        assert!(gained * gained <= 9 * elsewhere, "{gained} of {elsewhere}");
    }
}

/// Near Ω = 6 the largest exponent is of order 1e-4 per period. The motion must be reported as a
/// torus or as undecided, never as periodic or chaotic.
#[test]
fn a_torus_is_not_reported_as_anything_else() {
    let model = Model::cantilever(&at(6.0)).unwrap();
    let run = simulate(
        &model,
        &SimulateOptions {
            periods: 10,
            ..SimulateOptions::default()
        },
    )
    .unwrap();
    assert!(
        matches!(
            run.classification,
            Classification::QuasiPeriodic | Classification::Undecided
        ),
        "{}",
        run.evidence
    );
    assert!(run.lyapunov.unwrap()[0].abs() < 5e-4, "{}", run.evidence);
}

/// The sum of all exponents is the mean rate at which volumes contract, known from the trace of the
/// equations and the contact time.
#[test]
fn exponents_sum_to_the_trace() {
    // On a periodic orbit, to rounding; both stops.
    let model = Model::cantilever(&at(3.0)).unwrap();
    let found = orbit(&model, &OrbitOptions::default()).unwrap();
    let options = LyapunovOptions {
        transient: 0,
        periods: 200,
        state: Some(found.state.clone().into()),
        points: 0,
        ..LyapunovOptions::default()
    };
    let report = lyapunov(&model, &options, &Control::default()).unwrap();
    assert!(
        (report.sum - report.sum_by_trace).abs() < 1e-10,
        "{} {}",
        report.sum,
        report.sum_by_trace
    );
    assert_eq!(report.classification, Classification::Periodic);
    let expected: f64 = found
        .multipliers
        .iter()
        .map(|[re, im]| re.hypot(*im).ln())
        .sum();
    assert!((report.sum - expected).abs() < 1e-10);
    let wall = Oscillator {
        mass: 1.0,
        stiffness: 1.0,
        damping: 0.05,
        forcing: 1.0,
        omega: 2.2,
        gap: 0.0,
        stop: Stop::Rigid { restitution: 0.8 },
    };
    let model = wall.model().unwrap();
    let report = lyapunov(
        &model,
        &LyapunovOptions {
            periods: 2000,
            points: 0,
            ..LyapunovOptions::default()
        },
        &Control::default(),
    )
    .unwrap();
    assert!(
        (report.sum - report.sum_by_trace).abs() < 1e-6,
        "{} {}",
        report.sum,
        report.sum_by_trace
    );
}

/// A computation that is cancelled before it starts ends with that error and no numbers, whichever
/// part remains: the transient, the average, the section.
#[test]
fn a_cancelled_spectrum_is_an_error() {
    let model = Model::cantilever(&at(3.0)).unwrap();
    let stop = nanotap::control::CancelFlag::new();
    stop.cancel();
    let control = Control {
        cancel: Some(&stop),
        ..Control::default()
    };
    for (transient, periods, points) in [(1 << 40, 1, 0), (0, 1 << 40, 0), (0, 1, 1 << 20)] {
        let options = LyapunovOptions {
            transient,
            periods,
            points,
            ..LyapunovOptions::default()
        };
        let stopped = lyapunov(&model, &options, &control);
        assert_eq!(stopped.unwrap_err().kind, ErrorKind::Stopped);
    }
}

/// The memory of a standard linear solid decays as e^{−t/τ} with τ far below a drive period: its
/// exponent is the remainder of the trace, however far below rounding the multiplier is.
#[test]
fn the_last_exponent_of_a_standard_linear_solid_follows_from_the_trace() {
    for time in [0.02, 0.005, 0.001] {
        let case = Cantilever {
            modes: 2,
            alpha6: 0.0,
            ..at(2.6).on(ContactLaw::StandardLinearSolid, &[20.0, time])
        };
        let options = LyapunovOptions {
            periods: 200,
            points: 0,
            ..LyapunovOptions::default()
        };
        let report = lyapunov(
            &Model::cantilever(&case).unwrap(),
            &options,
            &Control::default(),
        )
        .unwrap();
        assert!((report.sum / report.sum_by_trace - 1.0).abs() < 1e-9);
        // In contact it relaxes, in flight it recovers at half that rate (both springs alike).
        let last = report.exponents.last().unwrap();
        let fastest = -case.period() / time;
        assert!(
            *last > 1.001 * fastest && *last < 0.499 * fastest,
            "{time}: {last}"
        );
    }
}

/// One mode contracts areas, so there is no torus: this motion is an orbit of period 336, stable by
/// its multipliers.
#[test]
fn a_long_period_of_one_mode_is_not_a_torus() {
    let case = Cantilever {
        modes: 1,
        alpha1: 0.099,
        alpha3: 0.012,
        alpha4: 35.06,
        alpha5: 0.295,
        alpha6: 0.0196,
        ..at(8.9)
    };
    let model = Model::cantilever(&case).unwrap();
    // Near one of its points.
    let options = SimulateOptions {
        state: Some(vec![-0.19771, -0.124605].into()),
        ..SimulateOptions::default()
    };
    let found = simulate(&model, &options).unwrap();
    assert_eq!(
        (found.classification, found.period),
        (Classification::Periodic, Some(336)),
        "{}",
        found.evidence
    );
}

/// A section at any phase consists of points of the motion: the map between two phases takes one
/// section to the other.
#[test]
fn sections_are_of_the_motion() {
    let model = Model::cantilever(&at(2.6)).unwrap();
    let start = vec![0.02, 0.0, 0.0, -0.1, 0.0, 0.0];
    let zero = section(&model, &start, Section::Phase(0.0), 4).unwrap();
    let quarter = section(&model, &start, Section::Phase(0.25), 4).unwrap();
    let run = nanotap_flow::Trajectory::record(&model.system, &start, 4).unwrap();
    for (k, (a, b)) in zero.iter().zip(&quarter).enumerate() {
        let of = |phase: f64| run.state_at((k as f64 + phase) * model.period()).unwrap();
        for (x, y) in a
            .state
            .iter()
            .chain(&b.state)
            .zip(of(0.0).iter().chain(&of(0.25)))
        {
            assert!((x - y).abs() < 1e-12);
        }
        // W = 2 (a1 − a2 + a3).
        assert!((a.tip - 2.0 * (a.state[0] - a.state[1] + a.state[2])).abs() < 1e-14);
    }
    let sides = default_box(&model).unwrap();
    assert_eq!(sides.dimension(), 6);
}

/// Derivatives with respect to both parameters of a plane compared with central differences.
#[test]
fn a_plane_of_parameters_has_the_derivatives_of_its_map() {
    let keys = [Key::Omega, Key::Alpha4];
    let family = PlaneFamily {
        case: Case::from(at(3.0)),
        keys,
    };
    let values = [3.0, 20.0];
    let start = [0.05, 0.0, 0.0, -0.03, 0.0, 0.0];
    let (mut first, mut second) = ([0.0; 6], [0.0; 6]);
    let mut jacobian = DMatrix::zeros(6, 6);
    let mut state = start;
    let mut map = family.at(values[0], values[1]).unwrap();
    family
        .advance_with_derivatives(
            values,
            &mut map,
            &mut state,
            &mut jacobian,
            [&mut first, &mut second],
        )
        .unwrap();
    for (index, derivative) in [first, second].into_iter().enumerate() {
        let h = 1e-5 * values[index];
        let shifted = |sign: f64| {
            let mut moved = values;
            moved[index] += sign * h;
            let mut state = start;
            family
                .at(moved[0], moved[1])
                .unwrap()
                .advance(&mut state)
                .unwrap();
            state
        };
        let (plus, minus) = (shifted(1.0), shifted(-1.0));
        for i in 0..6 {
            let difference = (plus[i] - minus[i]) / (2.0 * h);
            assert!(
                (difference - derivative[i]).abs() < 1e-7 * (1.0 + difference.abs()),
                "{index} {i}"
            );
        }
    }
}

/// For a slowly decaying motion a run shows the orbit to which it converges, not the transient: at
/// Ω = 2000 contact begins only when the tip has reached the orbit (its largest multiplier is
/// 0.99977), for 31 % of the time.
#[test]
fn a_periodic_run_shows_its_orbit() {
    let model = Model::cantilever(&at(2000.0)).unwrap();
    let run = simulate(&model, &SimulateOptions::default()).unwrap();
    let closed = orbit(&model, &OrbitOptions::default()).unwrap();
    assert_eq!(run.classification, Classification::Periodic);
    let (shown, expected) = (&run.observables, &closed.observables);
    assert!(expected.contact_fraction > 0.3);
    assert!((shown.contact_fraction - expected.contact_fraction).abs() < 1e-6);
    assert!((shown.first_harmonic / expected.first_harmonic - 1.0).abs() < 1e-6);
    assert!(run.distance_to_orbit.unwrap() < 1e-6);
    // The transient would take this long: the multiplier to its power is near rounding.
    assert!(run.transient > 50_000, "{}", run.transient);
    // A requested transient is run, and the result is labelled accordingly.
    let options = SimulateOptions {
        transient: Some(3000),
        ..SimulateOptions::default()
    };
    let early = simulate(&model, &options).unwrap();
    assert!(early.distance_to_orbit.unwrap() > 0.01);
}

/// A census without options finds motions whose basins are within a hundredth of the resonant
/// response. The periods were found by an independent Taylor integrator of order 22 from starts in
/// a box 100 times smaller than the resonant one.
#[test]
fn a_census_finds_motions_in_a_hundredth_of_the_box() {
    let case = |numbers: [f64; 7]| {
        let [alpha1, alpha2, alpha3, alpha4, alpha5, alpha6, omega] = numbers;
        Cantilever {
            modes: 1,
            alpha1,
            alpha2,
            alpha3,
            alpha4,
            alpha5,
            alpha6,
            omega,
            ..Cantilever::paper()
        }
    };
    for (numbers, periods, least) in [
        (
            [0.018, 0.1, 0.0236, 53.55, 0.2, 0.0969, 6.03],
            &[1, 3, 4, 5, 8][..],
            5,
        ),
        ([0.115, 0.1, 0.0639, 19.68, 0.202, 0.0108, 8.89], &[][..], 3),
    ] {
        let model = Model::cantilever(&case(numbers)).unwrap();
        let found = attractors(&model, &AttractorsOptions::default(), &Control::default()).unwrap();
        let here: Vec<usize> = found
            .attractors
            .iter()
            .filter_map(|a| a.orbit.as_ref().map(|o| o.period))
            .collect();
        assert!(found.attractors.len() >= least, "{here:?}");
        assert!(periods.iter().all(|p| here.contains(p)), "{here:?}");
        let unseen = found.unseen.unwrap();
        assert!(
            unseen.fraction > 0.0 && unseen.fraction < 0.02,
            "{unseen:?}"
        );
        assert!(found.sizes.len() > 3);
    }
}
