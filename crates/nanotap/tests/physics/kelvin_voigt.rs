//! The viscoelastic surface of spring and damper.

use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap::model::model_map::ModelMap;
use nanotap::model::parameter::Parameter;
use nanotap::observe::begins_contact;
use nanotap_dynamics::StroboscopicMap as _;
use nanotap_flow::{Flow, Trajectory};

use crate::contact_laws::on;

fn run(case: &Cantilever, periods: usize) -> (Model, Trajectory) {
    let model = Model::cantilever(case).unwrap();
    let mut state = vec![0.0; model.dimension()];
    let mut flow = Flow::new(model.system.clone());
    flow.start(&state, 0.0).unwrap();
    for _ in 0..40 {
        flow.run_period(&mut ()).unwrap();
    }
    flow.state(&mut state);
    let run = Trajectory::record(&model.system, &state, periods).unwrap();
    (model, run)
}

/// Contact begins with the force −α6 ġ and ends with force, gap and rate of the gap zero; from then
/// on the surface recovers as e^{−α4 t/α6} until the next contact.
#[test]
fn contact_begins_with_the_damper_force_and_ends_at_zero_force() {
    let case = Cantilever {
        // Slow enough that the tip returns before the surface has recovered.
        alpha6: 8.0,
        ..on(ContactLaw::KelvinVoigt, 20.0)
    };
    let (model, run) = run(&case, 12);
    let force = run.signal_by_regime(&model.force);
    let gap = run.signal(&model.gap);
    let height = run.signal(&model.height);
    let recovery = case.alpha4 / case.alpha6;
    let (mut left, mut met_early) = (None, 0);
    for event in run.events() {
        let piece = |signal: &nanotap_flow::trajectory::PiecewiseSignal, at: f64| {
            let piece = signal.pieces.iter().rfind(|p| p.start <= at).unwrap();
            piece.signal.at((at - piece.start).min(piece.length))
        };
        let (before, after) = (event.time - 1e-13, event.time + 1e-13);
        if begins_contact(&model, event.from, event.to) {
            let expected = -case.alpha6 * event.rate;
            assert!((piece(&force, after) - expected).abs() < 1e-9 * expected.max(1.0));
            if let Some((time, at)) = left {
                let surface: f64 = at * f64::exp(-recovery * (event.time - time));
                assert!((piece(&height, before) - surface).abs() < 1e-11);
                met_early += usize::from(surface < -1e-3);
            }
        } else {
            assert!(piece(&force, before).abs() < 1e-9);
            assert!(piece(&gap, after).abs() < 1e-11);
            assert!(event.rate < 0.0, "the force falls");
            left = Some((event.time, piece(&height, event.time)));
        }
    }
    assert!(met_early > 3, "the surface is met before it has recovered");
}

/// The gap opens as ½ (−ḟ/α6) t²: no contact follows at once, for any damper.
#[test]
fn the_gap_opens_quadratically() {
    for damping in [1e-4, 1e-2, 0.2, 5.0, 300.0] {
        let case = on(ContactLaw::KelvinVoigt, 20.0).with(Parameter::Alpha6, damping);
        let (model, run) = run(&case, 6);
        let gap = run.signal(&model.gap);
        let mut flights = 0;
        for pair in run.events().windows(2) {
            if model.contact[pair[0].to] {
                continue;
            }
            flights += 1;
            let t = (1e-3 * damping / case.alpha4).min(1e-4);
            let expected = 0.5 * (-pair[0].rate / damping) * t * t;
            let opened = gap.at(pair[0].time + t).unwrap();
            assert!(
                (opened / expected - 1.0).abs() < 0.05 || expected < 1e-13,
                "{damping}: {opened:e} {expected:e}"
            );
            assert!(pair[1].time - pair[0].time > 1e-6);
        }
        assert!(flights > 0, "{damping}");
    }
}

/// As the damper vanishes the law tends to the paper's, whose damper vanishes too.
#[test]
fn a_vanishing_damper_leaves_the_spring() {
    let elastic = on(ContactLaw::SpringDamper, 20.0).with(Parameter::Alpha6, 0.0);
    let end = |case: &Cantilever| {
        let model = Model::cantilever(case).unwrap();
        let rest = vec![0.0; model.dimension()];
        let run = Trajectory::record(&model.system, &rest, 30).unwrap();
        run.state_at(run.end()).unwrap()
    };
    let expected = end(&elastic);
    let mut last = f64::INFINITY;
    for damping in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6] {
        let case = on(ContactLaw::KelvinVoigt, 20.0).with(Parameter::Alpha6, damping);
        let distance = end(&case)
            .iter()
            .zip(&expected)
            .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(distance < 0.2 * last, "{damping}: {distance}");
        last = distance;
    }
    assert!(last < 1e-5);
}

/// A surface with a damper and no spring keeps the indentation; one with neither has no effect.
#[test]
fn limits_of_the_surface() {
    let dent = on(ContactLaw::KelvinVoigt, 20.0).with(Parameter::Alpha4, 0.0);
    let (model, run) = run(&dent, 3);
    let ends: Vec<_> = run
        .events()
        .iter()
        .filter(|e| !model.contact[e.to])
        .collect();
    let begins = run.events().iter().filter(|e| model.contact[e.to]);
    for (end, begin) in ends.iter().zip(begins.filter(|b| b.time > ends[0].time)) {
        let at = |t: f64| run.signal(&model.height).at(t).unwrap();
        assert!((at(end.time) - at(begin.time)).abs() < 1e-10);
    }
    let nothing = dent.with(Parameter::Alpha6, 0.0);
    let free = Model::cantilever(&nothing).unwrap();
    let run = Trajectory::record(&free.system, &vec![0.0; free.dimension()], 2).unwrap();
    let (least, most) = run.signal_by_regime(&free.force).range().unwrap();
    assert_eq!((least.value, most.value), (0.0, 0.0));
}

/// Where tip and surface separate, gap and rate vanish together at every frequency; this is not a
/// grazing. The orbit with one contact per period that the paper's lever has here does not graze.
#[test]
fn separation_is_not_a_grazing() {
    for k in 0..40 {
        let omega = 19.5 + 0.02 * f64::from(k);
        let model = Model::cantilever(&on(ContactLaw::KelvinVoigt, omega)).unwrap();
        let mut map = ModelMap::new(&model);
        let mut state = vec![0.0; model.dimension()];
        for _ in 0..40 {
            map.advance(&mut state).unwrap();
        }
        let mut tangencies = Vec::new();
        map.advance_with_tangencies(&mut state, &mut tangencies)
            .unwrap();
        assert!(!tangencies.is_empty());
        for tangency in tangencies {
            assert!(tangency.value.abs() > 1e-3, "{omega}: {tangency:?}");
        }
    }
}
