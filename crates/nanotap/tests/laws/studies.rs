//! Setpoints, windows and derivatives of observables under nonlinear laws.

use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::dataset::{Share, Store, Work};
use nanotap::observe::{Derivative, ObservableSet, Observables, Value, measure};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap::study::setpoint::solve_setpoint;
use nanotap::study::value::Axes;
use nanotap::study::window::{Condition, Window, WindowOptions};
use nanotap::study::{Computation as _, FreeMotion};

use crate::common::{DMT, EV, HERTZ, lever};

/// A voltage acts far beyond the reach of the tip: an approach that began at twice the reach found the
/// lever below the setpoint already.
#[test]
fn a_setpoint_is_found_where_a_voltage_acts_from_far() {
    let words = [
        "modes=1",
        "cantilever.k=2.8 N/m",
        "cantilever.f0=75 kHz",
        "cantilever.Q=240",
        "tip.radius=20 nm",
        "sample.law=dmt + electrostatic",
        "sample.modulus=2.2 GPa",
        "sample.hamaker=6.5e-20 J",
        "sample.voltage=8 V",
        "drive.frequency=75 kHz",
        "drive.free_amplitude=15 nm",
    ];
    let with = |word: &str| {
        let words = words.iter().map(|word| (*word).to_owned());
        Case::parse(None, &words.chain([word.to_owned()]).collect::<Vec<_>>())
    };
    let report = solve_setpoint(&with("drive.setpoint=0.7").unwrap(), &Control::default()).unwrap();
    assert!((report.zc() - 41.5e-9).abs() < 2e-9, "{}", report.zc());
    let there = with(&format!("gap.tip={:e} m", report.zc())).unwrap();
    let found = crate::common::found(&there).observables;
    let free = FreeMotion::of(&there.model().unwrap()).amplitude;
    assert!((found.first_harmonic / free - 0.7).abs() < 1e-6);
    // So is a shift of the frequency, which goes with the gradient of 1/(d (d + R)).
    let shifts = ["drive.setpoint=-30 Hz", "drive.setpoint=-20 Hz"];
    let [near, far] = shifts.map(|word| {
        let found = solve_setpoint(&with(word).unwrap(), &Control::default()).unwrap();
        found.zc()
    });
    assert!((1.12..1.25).contains(&(far / near)), "{near} {far}");
}

/// The force in contact leaves out the attraction in flight: against a sum over the time series.
#[test]
fn the_mean_force_in_contact_is_that_of_the_contact() {
    let model = quick(20.0, 15.0, &DMT).model().unwrap();
    let start = vec![0.0; model.dimension()];
    let seen = measure(&model, &start, 30, ObservableSet::ALL).unwrap();
    let (mut sum, mut count) = (0.0, 0.0);
    nanotap::observe::time_series::sample(&model, &start, 30, 20_000, |row| {
        let [force, contact] = [row[4], row[5]];
        sum += force * contact;
        count += contact;
    })
    .unwrap();
    let found = seen.contact_force.unwrap();
    assert!(count > 1000.0 && (sum / count / found - 1.0).abs() < 1e-3);
    assert!(found > 1.02 * seen.mean_force / seen.contact_fraction);
}

/// A lever whose transient lasts a few tens of periods.
fn quick(amplitude: f64, gap: f64, sample: &[&str]) -> Case {
    lever((0.9, 30.0, "100 kHz"), (amplitude, gap), sample)
}

/// The peak force and the phase at the distance of an amplitude are reached at that distance: over a
/// sample that only repels, the lever passes each of them once on its approach.
#[test]
fn a_setpoint_is_an_amplitude_a_peak_force_or_a_phase() {
    let lever = quick(20.0, 18.0, &HERTZ);
    let lines = lever.to_toml();
    let lines = lines
        .lines()
        .filter(|l| *l != "[gap]" && !l.starts_with("tip = "));
    let text = lines.collect::<Vec<_>>().join(
        "
",
    );
    let parsed = |setpoint: &str| {
        let source = nanotap::case::file::Source {
            name: "case.toml".into(),
            text: text.clone(),
        };
        Case::parse(Some(source), &[format!("drive.setpoint={setpoint}")])
    };
    let held = |setpoint: &str| solve_setpoint(&parsed(setpoint).unwrap(), &Control::default());
    let amplitude = held("0.8").unwrap();
    assert_eq!(amplitude.held, "amplitude");
    let at = &amplitude.solutions[amplitude.chosen];
    let seen = at.physical.observables;
    for (name, setpoint) in [
        ("peak_force", format!("{:e} N", seen.peak_force)),
        ("phase", format!("{} deg", seen.phase)),
    ] {
        let report = held(&setpoint).unwrap();
        assert_eq!(report.held, name);
        let found = &report.solutions[report.chosen];
        assert!(found.reached && found.stable);
        assert_eq!(found.branch, at.branch);
        assert!(
            (found.zc / at.zc - 1.0).abs() < 1e-8,
            "{name}: {} {}",
            found.zc,
            at.zc
        );
        assert!((report.ratio - 0.8).abs() < 1e-8);
        let text = report.remark().text;
        assert!(text.contains(at.branch), "{text}");
    }
    // A force that no tapping reaches is refused with the largest on the way.
    let refused = held("1 mN").unwrap_err().to_string();
    assert!(refused.contains("the peak force is"), "{refused}");
    let refused = parsed("0 Hz").unwrap_err().to_string();
    assert!(refused.contains("a frequency shift such as"), "{refused}");
}

/// An orbit at a solution of the setpoint is run again and has the setpoint's amplitude.
#[test]
fn a_setpoint_is_reached_at_its_distances() {
    let mut text = Vec::new();
    let given = quick(20.0, 18.0, &DMT);
    for line in given.to_toml().lines() {
        if line != "[gap]" && !line.starts_with("tip = ") {
            text.push(line.to_owned());
        }
    }
    let source = nanotap::case::file::Source {
        name: "case.toml".into(),
        text: text.join("\n"),
    };
    let held = Case::parse(Some(source), &["drive.setpoint=0.91".to_owned()]).unwrap();
    assert!(held.leaves_distance_to_setpoint());
    let report = solve_setpoint(&held, &Control::default()).unwrap();
    assert!((report.amplitude / 18.2e-9 - 1.0).abs() < 1e-12);
    let mut phases = Vec::new();
    for solution in report.solutions.iter().filter(|solution| solution.stable) {
        let here = held.with(held.gap_key(), solution.gap);
        let options = OrbitOptions {
            period: Some(solution.period),
            state: Some(solution.state.clone().into()),
            ..OrbitOptions::default()
        };
        let found = orbit(&here.model().unwrap(), &options).unwrap();
        let seen = found.observables.in_si(&here.physical().unwrap().scales);
        assert!((seen.first_harmonic / 18.2e-9 - 1.0).abs() < 1e-9);
        phases.push(seen.phase);
    }
    // The tapping state lags by less than at resonance.
    assert!(phases.iter().any(|phase| *phase < 85.0), "{phases:?}");
}

/// Where the free oscillation does not reach the attraction there is one motion without contact,
/// near the sample one that taps; each condition agrees with the orbits.
#[test]
fn a_window_over_an_attractive_sample() {
    let case = quick(10.0, 9.0, &DMT);
    let options = WindowOptions {
        over: Axes(vec![
            "drive.frequency=99kHz:101kHz:2".to_owned(),
            "gap.tip=5nm:14nm:4".to_owned(),
        ]),
        starts: 4,
        ..WindowOptions::default()
    };
    let sweep = options.sweep(&case, &Control::default()).unwrap();
    let folder = std::env::temp_dir().join(format!("nanotap-window-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let store = Store::create_or_resume(&folder.join("window"), sweep.schema().clone()).unwrap();
    let how = Work {
        share: Share::WHOLE,
        threads: 2,
        control: Control::default(),
    };
    sweep.compute(&store, &how).unwrap();
    let window = Window::of(&store).unwrap();
    let [frequency, gap] = [0, 1].map(|k| sweep.over()[k].key);
    let mut seen = Vec::new();
    for (row, &y) in window.conditions.iter().zip(&window.y) {
        for (condition, &x) in row.iter().zip(&window.x) {
            let here = case.with(frequency, x).with(gap, y);
            let free = FreeMotion::of(&here.model().unwrap()).reach;
            let distance = y / here.physical().unwrap().scales.length;
            match condition {
                Condition::NoContact => assert!(free < distance, "{x} Hz, {y} m"),
                Condition::OnePeriod1 => assert!(free > 0.9 * distance, "{x} Hz, {y} m"),
                _ => {}
            }
            seen.push(*condition);
        }
    }
    let _ = std::fs::remove_dir_all(&folder);
    assert!(seen.contains(&Condition::NoContact), "{seen:?}");
    assert!(seen.contains(&Condition::OnePeriod1), "{seen:?}");
    assert!(!seen.contains(&Condition::Undecided), "{seen:?}");
}

fn observed(case: &Case, start: &[f64]) -> (Vec<f64>, Observables) {
    let model = case.model().unwrap();
    let options = OrbitOptions {
        period: Some(1),
        state: Some(start.to_vec().into()),
        ..OrbitOptions::default()
    };
    let found = orbit(&model, &options).unwrap();
    let seen = measure(&model, &found.state, 1, ObservableSet::ALL).unwrap();
    (found.state, seen)
}

/// A neck of adhesion that begins to exist at drive phase 0: the orbit is the previous one, with
/// another memory.
#[test]
fn an_orbit_is_followed_where_its_neck_appears_at_the_strobe() {
    let at = |gap: f64| {
        let jkr = [
            "tip.radius=10 nm",
            "sample.law=jkr",
            "sample.modulus=99.7 MPa",
            "sample.poisson=0.49",
            "sample.work_of_adhesion=19.96 mJ/m^2",
        ];
        let case = lever((2.8 * 1.030_196_947, 200.0, "75 kHz"), (30.0, gap), &jkr);
        case.model().unwrap()
    };
    let here = orbit(&at(22.0), &OrbitOptions::default()).unwrap();
    let options = OrbitOptions {
        period: Some(1),
        state: Some(here.state.clone().into()),
        ..OrbitOptions::default()
    };
    let there = orbit(&at(22.1), &options).unwrap();
    assert_eq!([here.state[2], there.state[2]], [0.0, 1.0]);
    let grown = there.observables.first_harmonic / here.observables.first_harmonic;
    assert!((grown - 1.004).abs() < 1e-3, "{grown}");
}

/// Compared with differences of fourth order, to 1e-6 of each value.
#[test]
fn derivatives_of_observables() {
    let dmt = quick(20.0, 15.0, &DMT);
    let voigt = [
        "sample.law=voigt-sphere",
        "sample.modulus=100 MPa",
        "sample.poisson=0.5",
        "sample.viscosity=2 Pa s",
    ];
    let voigt = lever((0.3, 2.0, "350 kHz"), (10.0, 5.0), &voigt);
    let jkr = [
        "sample.law=jkr",
        "sample.modulus=0.5 GPa",
        "sample.work_of_adhesion=20 mJ/m^2",
    ];
    let jkr = quick(20.0, 15.0, &jkr);
    let cases = [
        (
            dmt,
            vec![
                Key::GapTip,
                Key::SampleModulus,
                Key::SampleHamaker,
                Key::DriveForce,
                Key::DriveFrequency,
            ],
        ),
        (
            voigt,
            vec![Key::GapTip, Key::SampleViscosity, Key::DriveFrequency],
        ),
        (jkr, vec![Key::GapTip, Key::SampleWorkOfAdhesion]),
    ];
    let mut compared = 0;
    for (case, keys) in cases {
        let start = orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap();
        let (state, seen) = observed(&case, &start.state);
        for key in keys {
            let model = case.model().unwrap();
            let at = (state.as_slice(), 1);
            let exact = Derivative::of(&case, &model, key, at, &seen, ObservableSet::ALL).unwrap();
            let value = case.get(key);
            // A resonance is narrow.
            let part = if key == Key::DriveFrequency {
                1e-6
            } else {
                1e-4
            };
            let h = part * value;
            let moved =
                [-2.0, -1.0, 1.0, 2.0].map(|k| observed(&case.with(key, value + k * h), &state).1);
            for (observable, change) in &exact.observables {
                let number = |of: &Observables| match (observable.of)(of) {
                    Value::Number(number) => Some(number),
                    _ => None,
                };
                let (Some(here), Some(change)) = (number(&seen), change.number()) else {
                    continue;
                };
                let [a, b, c, d] = moved.map(|of| number(&of).unwrap());
                let slope = (a - 8.0 * b + 8.0 * c - d) / (12.0 * h);
                let scale = change.abs().max(here.abs() / value.abs());
                // Higher harmonics are thousands of times smaller than the motion; their
                // differences show the error of the motion.
                let faint =
                    observable.name.contains("_harmonic") && observable.name != "first_harmonic";
                let bound = if faint { 1e-4 } else { 1e-6 };
                assert!(
                    (change - slope).abs() <= bound * scale,
                    "d {} / d {key}: {change:e}, by differences {slope:e}",
                    observable.name
                );
                compared += 1;
            }
        }
    }
    assert!(compared > 100, "{compared}");
}

/// Over one repetition or three: means, harmonics, extrema and times have the same derivatives.
#[test]
fn derivatives_over_several_repetitions() {
    let case = quick(20.0, 15.0, &DMT);
    let start = orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap();
    let (state, seen) = observed(&case, &start.state);
    let model = case.model().unwrap();
    for key in [Key::SampleModulus, Key::DriveFrequency] {
        let of = |periods| {
            let at = (state.as_slice(), periods);
            Derivative::of(&case, &model, key, at, &seen, ObservableSet::COMMON).unwrap()
        };
        let (one, three) = (of(1), of(3));
        let mut compared = 0;
        for (observable, change) in &one.observables {
            let (Some(a), Some(b)) = (change.number(), three.number(observable)) else {
                continue;
            };
            let here = (observable.of)(&seen).number().unwrap_or(0.0).abs() / case.get(key);
            assert!(
                (a - b).abs() <= 1e-8 * a.abs().max(here),
                "{key}, {}: {a:e} {b:e}",
                observable.name
            );
            compared += 1;
        }
        assert!(compared > 10, "{compared}");
    }
}

/// A bridge that forms at 2h and ruptures at d_r dissipates 4πγRh ln((1 + d_r/h)/3): its force acts
/// on retract only.
#[test]
fn dissipation_of_a_capillary_bridge() {
    let words = [
        "sample.law=hertz + capillary",
        "sample.modulus=3 GPa",
        "sample.poisson=0.34",
        "sample.film_thickness=0.3 nm",
        "sample.surface_energy=70 mJ/m^2",
        "sample.surface_tension=72 mJ/m^2",
    ];
    let case = quick(20.0, 12.0, &words);
    let found = orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap();
    let taken = found.observables.dissipation * case.physical().unwrap().scales.energy;
    let (r, h, tension, solid, reduced) =
        (5.0_f64, 0.3_f64, 0.072, 0.07, 3.0 / (1.0 - 0.34 * 0.34));
    let base = (3.0 * std::f64::consts::PI * solid * r * r / reduced).cbrt();
    let four_pi = 4.0 * std::f64::consts::PI;
    let volume = four_pi * r * h * h + four_pi / 3.0 * h.powi(3) + 0.5 * four_pi * base * base * h;
    let rupture = volume.cbrt() - volume.cbrt().powi(2) / (5.0 * r);
    let expected = 1e-18 * four_pi * tension * r * h * ((1.0 + rupture / h) / 3.0).ln();
    assert!(
        (taken / expected - 1.0).abs() < 1e-9,
        "{} {}",
        taken / EV,
        expected / EV
    );
}

/// An electrostatic attraction ends at the contact distance, which is 0.165 nm where it is not stated:
/// at 0 the force would have no bound, and no motion would touch.
#[test]
fn an_ac_voltage_attracts_down_to_a_contact_distance() {
    let words = [
        "modes=1",
        "cantilever.k=2 N/m",
        "cantilever.f0=75 kHz",
        "cantilever.Q=100",
        "tip.radius=20 nm",
        "sample.law=hertz + electrostatic-ac",
        "sample.modulus=2 GPa",
        "sample.poisson=0.3",
        "sample.voltage=1 V",
        "sample.ac_voltage=1 V",
        "drive.actuation=tip",
        "drive.frequency=75 kHz",
        "drive.free_amplitude=20 nm",
        "drive.second_ratio=2",
        "drive.second_free_amplitude=0 nm",
        "gap.tip=15 nm",
    ];
    let words: Vec<String> = words.iter().map(|&word| word.to_owned()).collect();
    let case = Case::parse(None, &words).unwrap();
    let found = orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap();
    assert!(found.observables.contact_fraction > 0.0);
    assert!(found.observables.least_force.is_finite() && found.observables.peak_force > 0.0);
}
