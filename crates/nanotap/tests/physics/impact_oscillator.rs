//! The one-degree-of-freedom impact oscillator: closed forms, known orbits, chatter and
//! sticking, and the soft stop in the limit of infinite stiffness.

use nalgebra::Complex;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::model::oscillator::{Oscillator, Stop};
use nanotap::observe::{ObservableSet, measure};
use nanotap::study::approach::{ApproachOptions, ApproachPoint, approach};
use nanotap::study::branch::{BranchOptions, BranchReport, branch};
use nanotap::study::orbit::{OrbitOptions, OrbitReport, orbit};
use nanotap::study::value::Interval;
use nanotap_flow::Trajectory;

/// ẍ + x = cos ωt with a stop at 0.
pub(crate) fn rigid(omega: f64, restitution: f64) -> Oscillator {
    Oscillator {
        mass: 1.0,
        stiffness: 1.0,
        damping: 0.0,
        forcing: 1.0,
        omega,
        gap: 0.0,
        stop: Stop::Rigid { restitution },
    }
}

/// ẍ + x = cos ωt, gap 0, restitution 0.8, ω = 2.5: one impact per period at speed 0.6453521784
/// (reference value).
#[test]
fn the_one_impact_orbit_has_the_known_impact_speed() {
    let model = rigid(2.5, 0.8).model().unwrap();
    let report = orbit(
        &model,
        &OrbitOptions {
            period: Some(1),
            ..OrbitOptions::default()
        },
    )
    .unwrap();
    assert_eq!(report.observables.contacts_per_period, 1.0);
    assert!(
        (report.observables.impact_speed - 0.6453521784).abs() < 1e-9,
        "{}",
        report.observables.impact_speed
    );
    assert!(report.observables.energy_balance.residual.abs() < 1e-11);
}

/// COCO's hard-impact example: k = 1, c = 0.1, ω = 1, distance 1, restitution 0.8 grazes
/// at forcing amplitude 0.1 exactly, at ω = 0.8 at 0.368782: the linear response's
/// amplitude reaches the wall.
#[test]
fn the_linear_response_grazes_as_in_coco() {
    for (omega, amplitude, tolerance) in [(1.0, 0.1, 1e-12), (0.8, 0.368782, 1e-6)] {
        let mut oscillator = Oscillator {
            damping: 0.1,
            gap: 1.0,
            omega,
            ..rigid(omega, 0.8)
        };
        let touches = |forcing: f64, oscillator: &mut Oscillator| {
            oscillator.forcing = forcing;
            // The amplitude of the free response in the flow.
            let model = Oscillator {
                gap: 1e3,
                ..*oscillator
            }
            .model()
            .unwrap();
            let start = OrbitOptions {
                period: Some(1),
                state: Some(vec![0.0, 0.0].into()),
                ..OrbitOptions::default()
            };
            orbit(&model, &start).unwrap().observables.tip_max
        };
        // The response is linear in the forcing.
        let per_unit = touches(1.0, &mut oscillator);
        let grazing = 1.0 / per_unit;
        assert!((grazing - amplitude).abs() < tolerance, "{grazing}");
        for (factor, contacts) in [(1.0 - 1e-9, false), (1.0 + 1e-9, true)] {
            oscillator.forcing = grazing * factor;
            let model = oscillator.model().unwrap();
            let far = Oscillator {
                gap: 1e3,
                ..oscillator
            }
            .model()
            .unwrap();
            let start = OrbitOptions {
                period: Some(1),
                state: Some(vec![0.0, 0.0].into()),
                ..OrbitOptions::default()
            };
            let free = orbit(&far, &start).unwrap();
            let run = Trajectory::record(&model.system, &free.state, 1).unwrap();
            assert_eq!(!run.events().is_empty(), contacts, "{factor}");
        }
    }
}

/// A ball on a floor (a weak spring with a large extension presses with an almost constant force
/// g): each flight is shorter by the factor r, and the chatter ends after 2v₀/g/(1 − r), less the
/// share of the first flight, in sticking.
#[test]
fn chatter_ends_in_closed_form() {
    let (g, v0, r) = (0.7, 0.4, 0.8);
    let stiffness = 1e-6;
    let ball = Oscillator {
        stiffness,
        forcing: 0.0,
        omega: 0.3,
        gap: -g / stiffness,
        ..rigid(1.0, r)
    };
    let model = ball.model().unwrap();
    let mut flow = nanotap_flow::Flow::new(model.system.clone());
    flow.start(&[ball.gap, -v0], 0.0).unwrap();
    let mut recorder = nanotap_flow::trajectory::Recorder::default();
    let end = 2.0 * v0 / g / (1.0 - r);
    flow.run_until(2.0 * end, &mut recorder).unwrap();
    assert_eq!(flow.regime(), 1, "it sticks");
    let mut x = [1.0, 1.0];
    flow.state(&mut x);
    // At 7e5 a unit in the last place is 1e-10, and every bounce adds to it.
    assert!((x[0] - ball.gap).abs() < 1e-7 && x[1] == 0.0, "{x:?}");
    let run = recorder.finish(model.system.clone());
    let stuck = run.events().iter().find(|e| e.to == 1).unwrap();
    assert!(
        (stuck.time - end).abs() < 1e-6 * end,
        "{} {end}",
        stuck.time
    );
    let impacts = run.events().len();
    // ln(1e-8)/ln(0.8) is about 83 flights.
    assert!((40..140).contains(&impacts), "{impacts}");
}

/// Sticking ends when the drive pulls the mass off the wall: ẍ + x = F cos ωt pressed on
/// x = 0 leaves where cos ωt changes sign.
#[test]
fn sticking_ends_when_the_force_changes_sign() {
    let model = rigid(0.3, 0.2).model().unwrap();
    let run = Trajectory::record(&model.system, &[0.0, 0.0], 3).unwrap();
    let releases: Vec<f64> = run
        .events()
        .iter()
        .filter(|e| e.from == 1)
        .map(|e| e.time)
        .collect();
    assert!(!releases.is_empty());
    let quarter = std::f64::consts::FRAC_PI_2 / 0.3;
    assert!(
        (releases[0] - quarter).abs() < 1e-10,
        "{releases:?} {quarter}"
    );
    let seen = measure(&model, &[0.0, 0.0], 3, ObservableSet::ALL).unwrap();
    assert!(seen.tip_max <= 1e-12);
    assert!(
        seen.energy_balance.residual.abs() < 1e-9,
        "{:?}",
        seen.energy_balance
    );
}

/// The soft stop with κ → ∞ and the damper of the same restitution converges to the rigid one: r =
/// exp(−ζπ/√(1 − ζ²)) for a contact of half a damped cycle.
#[test]
fn stiff_soft_stop_tends_to_the_rigid_one() {
    let r: f64 = 0.8;
    let zeta = {
        let l = -r.ln() / std::f64::consts::PI;
        l / (1.0 + l * l).sqrt()
    };
    let speed = |stop: Stop| {
        let model = Oscillator {
            stop,
            ..rigid(2.5, r)
        }
        .model()
        .unwrap();
        let report = orbit(
            &model,
            &OrbitOptions {
                period: Some(1),
                ..OrbitOptions::default()
            },
        )
        .unwrap();
        report.observables.impact_speed
    };
    let exact = speed(Stop::Rigid { restitution: r });
    let mut previous = f64::INFINITY;
    for stiffness in [1e4_f64, 1e6, 1e8] {
        let error = (speed(Stop::Soft {
            stiffness,
            damping: 2.0 * zeta * stiffness.sqrt(),
        }) - exact)
            .abs();
        assert!(error < 0.2 * previous, "{stiffness}: {error}");
        previous = error;
    }
    assert!(previous < 1e-3);
}

/// For any position of the impacts in the drive period, a run can be divided at any of its periods
/// and continued: an impact within rounding of the division gives a state on the wall, or behind it
/// by rounding, which counts as on the wall. At ω = 1.26 the doubled motion of gap 0 and r = 0.8
/// impacts at drive phase 0.
#[test]
fn runs_that_impact_at_phase_zero_continue() {
    use nanotap::model::model_map::ModelMap;
    use nanotap_dynamics::StroboscopicMap;
    let model = rigid(1.26, 0.8).model().unwrap();
    let mut map = ModelMap::new(&model);
    for state in [
        [0.0, -0.5],
        [0.0, 0.5],
        [2e-17, -0.5],
        [2e-17, 0.5],
        [-2e-17, 0.7],
        [1e-17, 0.0],
    ] {
        let mut x = state;
        map.advance(&mut x)
            .unwrap_or_else(|error| panic!("{state:?}: {error}"));
        assert!(x[0] <= 1e-15 && x[1].is_finite());
    }
    // A state behind the wall by more than rounding is invalid.
    assert!(map.advance(&mut [1e-9, 0.5]).is_err());
}

/// The oscillator of a wall at 1 with damping 0.1 and restitution 0.8.
fn walled(forcing: f64, omega: f64) -> Oscillator {
    Oscillator {
        damping: 0.1,
        forcing,
        gap: 1.0,
        ..rigid(omega, 0.8)
    }
}

/// The period-1 orbit of an oscillator.
fn settled(oscillator: Oscillator) -> OrbitReport {
    let options = OrbitOptions {
        period: Some(1),
        ..OrbitOptions::default()
    };
    orbit(&oscillator.model().unwrap(), &options).unwrap()
}

/// The impulses of a rigid stop are part of the force. The Fourier coefficients of m ẍ + c ẋ + k x
/// = F cos ωt − N are (k − m j²ω² + i c j ω) x_j = F δ_j1 − N_j for every harmonic j, so that ⟨N⟩ =
/// −k ⟨x⟩ (0.4858 for the first orbit), for bouncing, chatter or sticking. The virial of impacts is
/// their impulse times the position of the stop; the stop dissipates the difference between the
/// energies of drive and damper.
#[test]
fn impulses_count_in_every_observable_of_the_force() {
    let sticks = Oscillator {
        gap: -0.2,
        stop: Stop::Rigid { restitution: 0.2 },
        ..walled(1.0, 0.3)
    };
    let rests = Oscillator {
        stiffness: 37.6001,
        damping: 0.0115648,
        forcing: 1.76317,
        omega: 6.7038,
        gap: -0.537534,
        ..rigid(1.0, 0.293947)
    };
    for (oscillator, contact) in [(walled(1.0, 1.0), false), (sticks, true), (rests, true)] {
        let report = settled(oscillator);
        let seen = &report.observables;
        let Oscillator {
            mass,
            stiffness,
            damping,
            forcing,
            omega,
            gap,
            ..
        } = oscillator;
        let mean = -stiffness * seen.mean_deflection;
        assert!(
            (seen.mean_force - mean).abs() < 1e-10,
            "{} {mean}",
            seen.mean_force
        );
        assert!((seen.virial + mean * gap).abs() < 1e-10, "{}", seen.virial);
        assert_eq!(seen.contact_fraction > 0.0, contact);
        let energy = seen.energy_balance;
        let taken = energy.drive_work - energy.beam_damping;
        assert!((energy.sample_damping - taken).abs() < 1e-10, "{energy:?}");
        assert!((seen.dissipation - taken).abs() < 1e-10, "{energy:?}");
        // Re(c e^{iωt}) = A sin(ωt − φ).
        let phasor = |amplitude: f64, lag: f64| {
            let (sin, cos) = lag.to_radians().sin_cos();
            Complex::new(-amplitude * sin, -amplitude * cos)
        };
        for harmonic in &report.spectrum.harmonics {
            let order = harmonic.order;
            let rate = order * omega;
            let along = Complex::new(stiffness - mass * rate * rate, damping * rate);
            let drive = if order == 1.0 { forcing } else { 0.0 };
            let expected = -along * phasor(harmonic.tip, harmonic.tip_phase) + drive;
            let found = phasor(harmonic.force, harmonic.force_phase);
            assert!(
                (found - expected).norm_sqr() < 1e-20,
                "{order}: {found} {expected}"
            );
        }
    }
    let bounces = settled(walled(1.0, 1.0)).observables;
    assert!((bounces.mean_force - 0.4858).abs() < 5e-5);
    let impulse = 1.8 * bounces.impact_speed / std::f64::consts::TAU;
    assert!((bounces.mean_force - impulse).abs() < 1e-12);
}

/// Pressed against the stop by a spring, the mass starts and rests on the stop, and every
/// neighbouring motion returns to it: both multipliers are 0.
#[test]
fn a_mass_rests_on_a_stop_before_its_rest_position() {
    let oscillator = Oscillator {
        gap: -0.5,
        ..walled(0.3, 1.3)
    };
    let model = oscillator.model().unwrap();
    assert_eq!(model.rest(), [-0.5, 0.0]);
    let report = settled(oscillator);
    assert_eq!(report.state, [-0.5, 0.0]);
    assert!(report.stable && report.multipliers.iter().all(|m| *m == [0.0, 0.0]));
    assert_eq!(report.determinant_defect, 0.0);
    assert_eq!(report.observables.contact_fraction, 1.0);
    // The drive takes the mass off the stop when it exceeds k · 0.5.
    let lifted = settled(Oscillator {
        forcing: 0.6,
        ..oscillator
    });
    assert!(lifted.observables.contact_fraction < 1.0 && lifted.observables.amplitude > 0.0);
}

/// A first parameter and its range, and a second.
type Window = (Key, (f64, f64), Key, (f64, f64));

fn followed(oscillator: Oscillator, options: &BranchOptions) -> BranchReport {
    branch(&Case::from(oscillator), options, &Control::default()).unwrap()
}

/// The linear response touches the wall where F = √((k − mω²)² + c²ω²) · gap. The free orbit ends
/// there from below, the impacting one from above, whatever their relative position (a fold is near
/// the grazing at resonance), and the curve of grazings covers the whole window.
#[test]
fn grazing_is_found_from_both_sides_and_followed_in_two_parameters() {
    for (from, to) in [(0.05, 1.0), (1.0, 0.01)] {
        let report = followed(
            walled(from, 1.0),
            &BranchOptions::over(Key::Forcing, from, to),
        );
        let end = report.bifurcations.last().unwrap();
        assert_eq!((end.kind, report.branches[0].complete), ("grazing", true));
        assert!((end.parameter - 0.1).abs() < 1e-12, "{}", end.parameter);
        let words = &report.branches[0].end;
        assert!(
            words.contains("grazes at 0.1") && words.contains("without bound"),
            "{words}"
        );
        assert!(report.failures.is_empty());
    }
    let windows: [Window; 4] = [
        (Key::Forcing, (0.05, 1.0), Key::OscillatorOmega, (0.2, 1.4)),
        (Key::Forcing, (1.0, 0.01), Key::OscillatorOmega, (0.5, 1.4)),
        (Key::OscillatorGap, (1.0, 0.2), Key::Damping, (0.01, 0.5)),
        (Key::OscillatorGap, (1.0, 0.2), Key::Restitution, (0.1, 0.9)),
    ];
    for (first, (from, to), second, (low, high)) in windows {
        let base = Case::from(walled(
            if first == Key::OscillatorGap {
                0.05
            } else {
                from
            },
            1.0,
        ));
        let options = BranchOptions {
            second: Some(Interval::of_key(second, low, high)),
            ..BranchOptions::over(first, from, to)
        };
        let report = branch(&base, &options, &Control::default()).unwrap();
        let loci = report.loci.unwrap();
        let curve = loci.curves.iter().find(|c| c.kind == "grazing").unwrap();
        assert_eq!(curve.meets, [None, None], "{:?}", curve.ends);
        let edges = |values: &[f64], ends: [f64; 2]| {
            let last = values[values.len() - 1];
            ends.iter()
                .filter(|end| (values[0] - **end).abs().min((last - **end).abs()) < 1e-12)
                .count()
        };
        assert_eq!(
            edges(&curve.first, [from, to]) + edges(&curve.second, [low, high]),
            2
        );
        for (x, y) in curve.first.iter().zip(&curve.second) {
            let case = base.with(first, *x).with(second, *y);
            let [k, m, c] = [Key::Stiffness, Key::Mass, Key::Damping].map(|key| case.get(key));
            let omega = case.get(Key::OscillatorOmega);
            let response = case.get(Key::Forcing) / (k - m * omega * omega).hypot(c * omega);
            assert!(
                (response / case.get(Key::OscillatorGap) - 1.0).abs() < 1e-12,
                "{x} {y}"
            );
        }
    }
}

/// A cascade of doublings at gap 0: over the narrow range Ω = 2.72 … 2.74 the flip of period 16 is
/// found at 2.731834122, and runs at 2.7316 and 2.7319 converge to periods 16 and 32. Over a range
/// 37 times as wide every doubled branch still begins at its flip and has its own flip; the ratio
/// of the distances tends to Feigenbaum's 4.669.
#[test]
fn a_cascade_is_followed_to_its_end() {
    let cascade = Oscillator {
        omega: 2.0,
        ..rigid(2.0, 0.8)
    };
    let options = BranchOptions {
        switch: Some(6),
        max_step: 0.01,
        ..BranchOptions::over(Key::OscillatorOmega, 2.0, 2.74)
    };
    let report = followed(cascade, &options);
    let flips: Vec<f64> = (report.bifurcations.iter())
        .filter(|b| b.kind == "flip")
        .map(|b| b.parameter)
        .collect();
    let periods: Vec<usize> = report.branches.iter().map(|b| b.period).collect();
    assert_eq!(periods, [1, 2, 4, 8, 16, 32, 64]);
    assert!((flips[4] - 2.731834122).abs() < 1e-9, "{flips:?}");
    let ratio = (flips[4] - flips[3]) / (flips[5] - flips[4]);
    assert!((ratio - 4.669).abs() < 0.05, "{ratio}");
    for (k, flip) in flips.iter().take(6).enumerate() {
        let first = report.points.iter().find(|p| p.branch == k + 1).unwrap();
        assert_eq!(first.parameter.to_bits(), flip.to_bits());
    }
    for (omega, period, branch) in [(2.7316, 16, 4), (2.7319, 32, 5)] {
        let stable = (report.points.iter()).filter(|p| p.branch == branch && p.stable);
        let near = stable.min_by(|a, b| {
            let [a, b] = [a, b].map(|p| (p.parameter - omega).abs());
            a.total_cmp(&b)
        });
        let options = OrbitOptions {
            period: Some(period),
            state: near.map(|p| p.state.clone().into()),
            ..OrbitOptions::default()
        };
        let here = orbit(&Oscillator { omega, ..cascade }.model().unwrap(), &options).unwrap();
        assert_eq!((here.period, here.stable), (period, true));
    }
}

/// The phase of the section does not matter: the doubled branch that begins at the flip Ω = 1.26067660
/// and impacts at drive phase 0 at Ω = 1.2598998 goes on to its grazing, and runs from states near
/// its orbits come to them. The same of an approach on which an impact passes phase 0.
#[test]
fn a_branch_goes_on_where_an_impact_passes_phase_zero() {
    let cascade = |omega| rigid(omega, 0.8);
    let options = BranchOptions {
        switch: Some(1),
        ..BranchOptions::over(Key::OscillatorOmega, 2.0, 1.2)
    };
    let report = followed(cascade(2.0), &options);
    assert!(report.failures.is_empty(), "{:?}", report.failures);
    let doubled = report.branches.iter().find(|b| b.period == 2).unwrap();
    assert!(
        doubled.complete && doubled.end.contains("grazes"),
        "{}",
        doubled.end
    );
    let points = report.points.iter().filter(|p| p.period == 2 && p.stable);
    let (before, beyond): (Vec<_>, Vec<_>) = points.partition(|p| p.parameter > 1.2598997798);
    assert!(before.len() > 2 && beyond.len() > 2);
    for point in [before[before.len() / 2], beyond[beyond.len() / 2]] {
        let model = cascade(point.parameter).model().unwrap();
        let near = vec![point.state[0] - 1e-4, 0.999 * point.state[1]];
        let options = OrbitOptions {
            state: Some(near.into()),
            ..OrbitOptions::default()
        };
        let settled = orbit(&model, &options).unwrap();
        assert_eq!(settled.period, 2);
        // The settled orbit may begin half a repetition later.
        let apart = settled.states.iter().map(|state| {
            let apart = state.iter().zip(&point.state).map(|(a, b)| (a - b).abs());
            apart.fold(0.0, f64::max)
        });
        let nearest = apart.fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-9, "{nearest} at {}", point.parameter);
    }
    let approach = approach(
        &Case::from(walled(1.0, 1.0)),
        &ApproachOptions::default(),
        &Control::default(),
    );
    let approach = approach.unwrap();
    let reasons: Vec<_> = approach.jumps.iter().map(|j| j.reason.as_str()).collect();
    assert_eq!(reasons, ["grazing", "grazing", "fold"]);
    assert!(approach.table.iter().all(|row| row.period == Some(1)));
    let branches = approach.branches.unwrap();
    assert!(branches.branches.iter().all(|b| b.complete));
}

/// An undamped oscillator behind a rigid stop is chaotic up to the distance 0, where the state of a
/// greater distance is behind the stop: the approach puts it on the stop and ends.
#[test]
fn an_approach_of_an_undamped_oscillator_ends_at_its_stop() {
    let options = ApproachOptions {
        points: 10,
        branches: false,
        ..ApproachOptions::default()
    };
    let report = approach(&Case::from(rigid(2.7, 0.8)), &options, &Control::default()).unwrap();
    assert_eq!(report.table.len(), 20);
    let failed = |row: &&ApproachPoint| row.reason.as_ref().is_some_and(|r| r.contains("failed"));
    assert_eq!(report.table.iter().find(failed).map(|row| row.gap), None);
}

/// A mass that chatters to rest on the stop in every period is one motion whatever the rounding of
/// its impacts, with multipliers 0, and its branch over the gap has no grazings of flights that end
/// in rounding.
#[test]
fn chatter_to_rest_is_one_motion() {
    let chatter = Oscillator {
        gap: -0.4,
        ..walled(1.0, 0.3)
    };
    let model = chatter.model().unwrap();
    let end = |start: [f64; 2]| {
        let options = OrbitOptions {
            state: Some(start.to_vec().into()),
            ..OrbitOptions::default()
        };
        orbit(&model, &options).unwrap()
    };
    let (a, b) = (end([-0.4, 0.0]), end([-1.0, 0.3]));
    assert_eq!(a.state, b.state);
    assert!(a.multipliers.iter().all(|m| *m == [0.0, 0.0]));
    // Flights become shorter by the factor 0.8 each, down to 1e-8 of a second.
    let impacts = a.observables.contacts_per_period;
    assert!((50.0..150.0).contains(&impacts), "{impacts}");
    let report = followed(
        chatter,
        &BranchOptions::over(Key::OscillatorGap, -0.4, -0.3),
    );
    assert!(report.failures.is_empty() && report.branches[0].complete);
    let kinds: Vec<_> = report.bifurcations.iter().map(|b| b.kind).collect();
    assert!(kinds.is_empty(), "{kinds:?}");
}
