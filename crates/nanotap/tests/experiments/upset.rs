//! The smallest knock found that upsets an orbit: its law next to a fold, thin basins, and knocks
//! followed by hand.

use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::model::galerkin::Galerkin;
use nanotap::model::model_map::ModelMap;
use nanotap::study::Study as _;
use nanotap::study::attractors::{AttractorsOptions, AttractorsStudy};
use nanotap::study::orbit::{OrbitOptions, OrbitReport, OrbitStudy};
use nanotap_dynamics::{ClassifyOptions, MotionKind, classify_exactly};
use nanotap_flow::Flow;

/// The lever whose tapping state ends at 14.073965664877789 nm (fold of `nanotap approach`).
fn lever(gap: f64, further: &[String]) -> Case {
    let mut words = [
        "cantilever.k=2 N/m",
        "cantilever.f0=70 kHz",
        "cantilever.Q=100",
        "modes=1",
        "sample.stiffness=8 N/m",
        "sample.damping=0 N s/m",
        "drive.actuation=tip",
        "drive.frequency_ratio=1.01",
        "drive.free_amplitude=6.6 nm",
        &format!("gap.tip={gap} nm"),
    ]
    .map(str::to_owned)
    .to_vec();
    words.extend_from_slice(further);
    Case::parse(None, &words).unwrap()
}

/// Its tapping state, the largest motion.
fn tapping(case: &Case) -> Vec<f64> {
    let census = AttractorsOptions::default();
    let found = AttractorsStudy::run(case, &census, &Control::default()).unwrap();
    let orbits = found.attractors.iter().filter_map(|a| a.orbit.as_ref());
    let largest = orbits.max_by(|a, b| {
        let [a, b] = [a, b].map(|orbit| orbit.observables.first_harmonic);
        a.total_cmp(&b)
    });
    largest.unwrap().state.clone()
}

fn knocked(case: &Case, state: Option<&[f64]>) -> Result<OrbitReport, nanotap::Error> {
    let options = OrbitOptions {
        state: state.map(|state| state.to_vec().into()),
        upset: true,
        ..OrbitOptions::default()
    };
    let found = OrbitStudy::run(case, &options, &Control::default());
    found.map(|found| found.motion)
}

/// Whether the motion returns to the orbit through `state` after a knock of `tip_speed` at a part of
/// the drive period.
fn returns(case: &Case, state: &[f64], part: f64, tip_speed: f64) -> bool {
    let model = case.model().unwrap();
    let equations = Galerkin::new(case.cantilever().unwrap()).unwrap();
    let moved = equations
        .mass
        .clone()
        .lu()
        .solve(&equations.modes.tip)
        .unwrap();
    let of_tip = moved.dot(&equations.modes.tip);
    let time = part * model.period();
    let knock = |at: &mut [f64]| {
        let modes = moved.len();
        for (speed, part) in at[modes..].iter_mut().zip(&moved) {
            *speed += tip_speed * part / of_tip;
        }
    };
    let mut at = state.to_vec();
    if let Some(nonlinear) = &model.nonlinear {
        let mut flow = nanotap_volterra::Flow::new(nonlinear.system.clone());
        flow.start(state, 0.0).unwrap();
        flow.run_until(time).unwrap();
        flow.state(&mut at);
        knock(&mut at);
        flow.start(&at, time).unwrap();
        flow.run_until(model.period()).unwrap();
        flow.state(&mut at);
    } else {
        let mut flow = Flow::new(model.system.clone());
        flow.start(state, 0.0).unwrap();
        flow.run_until(time, &mut ()).unwrap();
        flow.state(&mut at);
        knock(&mut at);
        flow.start(&at, time).unwrap();
        flow.run_period(&mut ()).unwrap();
        flow.state(&mut at);
    }
    let options = ClassifyOptions::default();
    let end = classify_exactly(&mut ModelMap::new(&model), &at, &options);
    match end.kind {
        MotionKind::Periodic(orbit) => {
            let size = state.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let near = orbit.states[0].iter().zip(state);
            near.fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) < 1e-6 * size
        }
        _ => false,
    }
}

/// A saddle lies √d away at a distance d from a fold, and the basin with it.
#[test]
fn next_to_a_fold_the_knock_goes_as_the_root_of_the_distance() {
    let fold = 14.073_965_664_877_79;
    let of = |distance: f64| {
        let case = lever(fold - distance, &[]);
        let state = tapping(&case);
        let found = knocked(&case, Some(&state))
            .unwrap()
            .upset
            .unwrap()
            .smallest
            .unwrap();
        let part = found.drive_phase / 360.0;
        let speed = found.tip_speed;
        assert!(returns(&case, &state, part, 0.97 * speed), "{found:?}");
        assert!(!returns(&case, &state, part, 1.03 * speed), "{found:?}");
        // What follows is the free motion, in A0.
        let physical = found.physical.unwrap();
        assert!((physical.amplitude.unwrap() / 6.6e-9 - 1.0).abs() < 1e-9);
        // J v/2 of a mass k₁/ω₁², where k₁ = 1.0302 k.
        let mass = 2.0 * 1.030_197 / (std::f64::consts::TAU * 70e3).powi(2);
        assert!((physical.impulse / (mass * physical.tip_speed) - 1.0).abs() < 1e-3);
        let energy = 0.5 * mass * physical.tip_speed.powi(2);
        assert!((physical.energy / energy - 1.0).abs() < 1e-3);
        physical.tip_speed.abs()
    };
    let [near, far] = [1e-4, 4e-4].map(of);
    assert!((far / near - 2.0).abs() < 0.06, "{near} {far}");
}

/// The repulsive state of a lever over a DMT sample, of amplitude 15 nm at 14.438 nm, and the smallest
/// knock found that upsets it.
fn on_dmt() -> (Case, OrbitReport) {
    let words = [
        "modes=1",
        "cantilever.k=0.8736193621040327 N/m",
        "cantilever.f0=100 kHz",
        "cantilever.Q=200",
        "tip.radius=5 nm",
        "tip.modulus=160 GPa",
        "tip.poisson=0.3",
        "sample.law=dmt",
        "sample.modulus=1 GPa",
        "sample.poisson=0.3",
        "sample.hamaker=3e-20 J",
        "sample.intermolecular_distance=0.169 nm",
        "drive.actuation=tip",
        "drive.frequency=100 kHz",
        "drive.free_amplitude=20 nm",
        "gap.tip=14.438126105449122 nm",
    ]
    .map(str::to_owned);
    let case = Case::parse(None, &words).unwrap();
    let options = OrbitOptions {
        // At 14.438 nm, by a census.
        state: Some(vec![-0.000_559_601_374_754_950_3, 0.001_750_078_017_744_779_6].into()),
        period: Some(1),
        upset: true,
        ..OrbitOptions::default()
    };
    let found = OrbitStudy::run(&case, &options, &Control::default()).unwrap();
    (case, found.motion)
}

/// The attractive state's basin reaches the repulsive one in arms whose width is 0.7 % of their
/// distance. A scan of every instant in steps of 0.1 mm/s upsets it at 3.1 mm/s and above.
#[test]
fn a_thin_basin_is_not_passed_over() {
    let (case, orbit) = on_dmt();
    let knocks = orbit.upset.unwrap();
    let found = knocks.smallest.unwrap();
    let physical = found.physical.unwrap();
    let speed = physical.tip_speed.abs();
    assert!(speed <= 3.1e-3 && speed > 2.9e-3, "{speed}");
    // What follows is the attractive state, of 14.267 nm by a census.
    assert!((physical.amplitude.unwrap() / 14.267e-9 - 1.0).abs() < 1e-4);
    let part = found.drive_phase / 360.0;
    let upsets = |part: f64, size: f64| !returns(&case, &orbit.state, part, size);
    assert!(upsets(part, found.tip_speed));
    assert!(!upsets(part, 0.998 * found.tip_speed));
    // Smaller knocks, all over the period, by the exact flow.
    for k in 1..=60 {
        let [part, size] = [0.754_877_666_246_693, 0.569_840_290_998_053]
            .map(|step: f64| (step * f64::from(k)).fract());
        let size = if k % 2 == 0 { size } else { -size };
        assert!(
            !upsets(part, 0.998 * size * found.tip_speed),
            "{part} {size}"
        );
    }
    assert!(knocks.smaller_tried > 1000 && knocks.size_ratio < 1.05);
}

/// A linear lever comes back from any knock, and so does a tapping one without another state.
#[test]
fn where_one_motion_exists_no_knock_upsets_it() {
    for (gap, damping) in [(1000.0, 0.0), (5.0, 1e-7)] {
        let words = [format!("sample.damping={damping} N s/m")];
        let case = lever(gap, &words);
        let found = knocked(&case, None).unwrap().upset.unwrap();
        assert!(
            found.smallest.is_none() && found.largest_tried > 0.0,
            "{found:?}"
        );
    }
}

#[test]
fn a_tip_at_rest_is_refused() {
    let words = ["drive.free_amplitude=0 nm".to_owned()];
    let refused = knocked(&lever(5.0, &words), None).unwrap_err();
    assert!(refused.to_string().contains("does not move"), "{refused}");
}

#[test]
fn an_unstable_orbit_is_refused() {
    let words = [
        "kind=impact",
        "stiffness=1",
        "damping=0.1",
        "forcing=1",
        "omega=3.7",
        "gap=-0.2",
        "restitution=0.8",
    ];
    let case = Case::parse(None, &words.map(str::to_owned)).unwrap();
    let options = OrbitOptions {
        period: Some(1),
        upset: true,
        ..OrbitOptions::default()
    };
    let refused = OrbitStudy::run(&case, &options, &Control::default()).unwrap_err();
    assert!(refused.to_string().contains("not stable"), "{refused}");
}
