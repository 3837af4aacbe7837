//! The one-degree-of-freedom impact oscillator: closed forms, known orbits, chatter and
//! sticking, and the soft stop in the limit of infinite stiffness.

use nanotap::model::oscillator::{Oscillator, Stop};
use nanotap::observe::{Set, measure};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap_flow::Trajectory;

fn rigid(omega: f64, restitution: f64) -> Oscillator {
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

/// ẍ + x = cos ωt, gap 0, restitution 0.8, ω = 2.5: one impact a period at speed
/// 0.6453521784 (project's model notes).
#[test]
fn one_impact_orbit_hits_at_the_known_speed() {
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
fn linear_response_grazes_where_coco_says() {
    for (omega, amplitude, tolerance) in [(1.0, 0.1, 1e-12), (0.8, 0.368782, 1e-6)] {
        let mut oscillator = Oscillator {
            damping: 0.1,
            gap: 1.0,
            omega,
            ..rigid(omega, 0.8)
        };
        let touches = |forcing: f64, oscillator: &mut Oscillator| {
            oscillator.forcing = forcing;
            // The free response's own amplitude, as the flow sees it.
            let model = Oscillator {
                gap: 1e3,
                ..*oscillator
            }
            .model()
            .unwrap();
            let start = OrbitOptions {
                period: Some(1),
                state: Some(vec![0.0, 0.0]),
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
                state: Some(vec![0.0, 0.0]),
                ..OrbitOptions::default()
            };
            let free = orbit(&far, &start).unwrap();
            let run = Trajectory::record(&model.system, &free.state, 1).unwrap();
            assert_eq!(!run.events().is_empty(), contacts, "{factor}");
        }
    }
}

/// A ball on a floor (a weak spring stretched far presses with an almost constant force
/// g): flights shrink by r each and the chatter ends after 2v₀/g/(1 − r) less the first
/// flight's share, in sticking.
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
    // At 7e5 a unit in the last place is 1e-10, and a bounce adds some.
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
    let seen = measure(&model, &[0.0, 0.0], 3, Set::ALL).unwrap();
    assert!(seen.tip_max <= 1e-12);
    assert!(
        seen.energy_balance.residual.abs() < 1e-9,
        "{:?}",
        seen.energy_balance
    );
}

/// The soft stop with κ → ∞ and the damper that gives the same restitution tends to the
/// rigid one: r = exp(−ζπ/√(1 − ζ²)) for a contact of half a damped cycle.
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

/// However the drive period falls on the impacts, a run can be cut at any of its periods
/// and go on: an impact a rounding error before or after the cut leaves a state on the
/// wall, or behind it by rounding, and that is where it is. At ω = 1.26, where the
/// doubled motion of gap 0 and r = 0.8 comes to impact at the drive's own phase 0.
#[test]
fn runs_that_impact_at_phase_zero_go_on() {
    use nanotap::model::strobe::Strobe;
    use nanotap_dynamics::StroboscopicMap;
    let model = rigid(1.26, 0.8).model().unwrap();
    let mut map = Strobe::new(&model);
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
    // Behind the wall by more than rounding is no state at all.
    assert!(map.advance(&mut [1e-9, 0.5]).is_err());
}
