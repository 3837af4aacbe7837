//! Proofs of periodic orbits: theorems enclose the orbit to 60 digits, and false statements are not
//! proved.

#![allow(clippy::disallowed_methods, reason = "files and folders of a test")]

use nanotap::case::Case;
use nanotap::case::file::Source;
use nanotap::control::Control;
use nanotap::model::Model;
use nanotap::model::enclosed::{EnclosureError, enclosed};
use nanotap::model::oscillator::{Oscillator, Stop};
use nanotap::study::Study as _;
use nanotap::study::orbit::{OrbitOptions, OrbitReport, OrbitStudy, orbit};
use nanotap::study::proof::{ProofReport, Prover, candidate};
use nanotap_flow::Trajectory;
use nanotap_proof::{Interval, ProofError, Stability, prove};

/// A number to twice double precision: the nearest double and the remainder.
type Long = (f64, f64);

/// An orbit of the paper's parameters.
struct Reference {
    modes: usize,
    omega: &'static str,
    period: usize,
    /// At drive phase 0.
    state: &'static [Long],
    /// Of all switches.
    times: &'static [Long],
    multipliers: &'static [(f64, f64)],
}

/// mpmath 1.3, 60 digits: closed forms from eigenvectors, switches by Newton, the orbit by Newton
/// with difference quotients of 1e-28, residual below 1e-59.
const REFERENCES: [Reference; 4] = [
    Reference {
        modes: 1,
        omega: "20",
        period: 1,
        state: &[
            (0.012699628206380922, 4.449e-19),
            (-1.4461665173878513, -7.547e-17),
        ],
        times: &[
            (0.030084820159464336, 1.412e-18),
            (0.1263957913093704, 7.418e-18),
        ],
        multipliers: &[
            (-0.0889751000015021, -0.9578798400465032),
            (-0.0889751000015021, 0.9578798400465032),
        ],
    },
    Reference {
        modes: 1,
        omega: "2.6",
        period: 2,
        state: &[
            (0.08721881614833969, -5.255e-18),
            (-0.04784357239182006, -2.531e-18),
        ],
        times: &[
            (1.4778063933211254, 7.577e-17),
            (2.049363180076682, -1.216e-16),
            (2.3363080939861063, 1.167e-17),
            (2.6575850429201133, 2.300e-17),
            (4.026052848774831, -1.230e-16),
            (4.456416748558032, -3.672e-16),
        ],
        multipliers: &[(-0.1208908028109996, 0.0), (-2.7497904271426106, 0.0)],
    },
    Reference {
        modes: 3,
        omega: "2.6",
        period: 1,
        state: &[
            (0.045697058421563366, 2.099e-18),
            (-0.0004437012255650474, -1.038e-20),
            (1.1355159719234441e-05, 5.690e-22),
            (-0.08553992149970939, 3.221e-18),
            (0.003636622350463844, -8.941e-20),
            (0.0013456658973110508, -6.298e-20),
        ],
        times: &[
            (1.585591013853893, -3.657e-17),
            (2.0628497484961343, 1.158e-16),
        ],
        multipliers: &[
            (-1.3920927018094083, -1.8044719487251712e-61),
            (-0.8032399438770392, -0.29177019974891344),
            (-0.8006912767025602, -0.15038410358345436),
            (-0.4865268483332409, -7.366259222391761e-62),
            (-0.8006912767025602, 0.15038410358345436),
            (-0.8032399438770392, 0.29177019974891344),
        ],
    },
    Reference {
        modes: 5,
        omega: "20",
        period: 1,
        state: &[
            (0.2923692946930257, -6.749e-18),
            (-0.11548767583415921, 3.949e-18),
            (-0.00013685811310840633, 4.265e-21),
            (-0.000872556722911443, -4.490e-20),
            (0.00021154477545681482, -8.114e-21),
            (-5.969219193245158, 2.242e-16),
            (-15.455734934836308, -7.187e-16),
            (0.49625589993606567, 1.191e-18),
            (-0.12380396395157758, -1.130e-18),
            (0.05051173633485691, -1.035e-19),
        ],
        times: &[
            (0.1808204721808985, -3.750e-18),
            (0.2758765078323898, -2.582e-17),
        ],
        multipliers: &[
            (0.9661298542989053, -0.1534793461529961),
            (0.9661298542989053, 0.1534793461529961),
            (0.20570798866256287, -0.9540050480918116),
            (-0.05697645562798794, -0.954325417238129),
            (-0.6966259375161881, -0.6910678807975308),
            (-0.8999291517262997, -0.38553943395568213),
            (0.20570798866256287, 0.9540050480918116),
            (-0.05697645562798794, 0.954325417238129),
            (-0.8999291517262997, 0.38553943395568213),
            (-0.6966259375161881, 0.6910678807975308),
        ],
    },
];

/// The paper's parameters with additional or different ones.
fn case(more: &[&str]) -> Case {
    let paper = [
        "alpha1=0.1",
        "alpha2=0.1",
        "alpha3=0.1",
        "alpha4=20",
        "alpha6=0.2",
    ];
    let words = paper.iter().filter(|word| {
        let key = word.split('=').next();
        !more.iter().any(|other| other.split('=').next() == key)
    });
    let words: Vec<String> = words.chain(more).map(|s| (*s).to_owned()).collect();
    Case::parse(None, &words).unwrap()
}

fn found(case: &Case, options: &OrbitOptions) -> (OrbitReport, ProofReport) {
    let orbit = orbit(&case.model().unwrap(), options).unwrap();
    let proof = Prover::new(case).report(&orbit.trajectory, orbit.period);
    (orbit, proof)
}

/// At a drive frequency with a multiplier of modulus 1 − 6.7e-8, which is inside the unit circle by
/// its condition, and is proved to be.
#[test]
fn a_report_states_the_proved_stability() {
    let case = case(&["modes=1", "omega=2.9422193073652134"]);
    let report = |prove: bool| {
        let request = OrbitOptions {
            period: Some(1),
            prove,
            ..OrbitOptions::default()
        };
        let report = OrbitStudy::run(&case, &request, &Control::default());
        report.unwrap().motion
    };
    let seen = report(false);
    assert_eq!((seen.stable, seen.stability), (true, "stable"));
    let proved = report(true);
    assert_eq!((proved.stable, proved.stability), (true, "stable"));
    let theorem = proved.proof.unwrap().theorem.unwrap();
    assert_eq!(theorem.stability, "stable");
}

fn settled(more: &[&str]) -> ProofReport {
    found(&case(more), &OrbitOptions::default()).1
}

fn holds([low, high]: [f64; 2], (near, rest): Long) -> bool {
    (low < near || low == near && rest >= 0.0) && (near < high || high == near && rest <= 0.0)
}

#[test]
fn theorems_enclose_the_orbits_to_60_digits() {
    for reference in &REFERENCES {
        let modes = format!("modes={}", reference.modes);
        let case = case(&[&modes, &format!("omega={}", reference.omega)]);
        let options = OrbitOptions {
            period: Some(reference.period),
            state: Some(
                reference
                    .state
                    .iter()
                    .map(|x| x.0)
                    .collect::<Vec<f64>>()
                    .into(),
            ),
            ..OrbitOptions::default()
        };
        let (_, proof) = found(&case, &options);
        assert!(proof.proved, "{}", proof.statement);
        let theorem = proof.theorem.unwrap();
        assert_eq!(theorem.period, reference.period);
        for (bounds, exact) in theorem.state.iter().zip(reference.state) {
            assert!(holds(*bounds, *exact), "{bounds:?} {exact:?}");
            assert!(bounds[1] - bounds[0] < 1e-8);
        }
        assert_eq!(theorem.switches.len(), reference.times.len());
        for (switch, exact) in theorem.switches.iter().zip(reference.times) {
            assert!(holds(switch.time, *exact), "{switch:?} {exact:?}");
            assert!(switch.time[1] - switch.time[0] < 1e-10);
        }
        let mut all = 0;
        for disc in &theorem.multipliers {
            let [x, y] = disc.center;
            let inside =
                |(re, im): &&(f64, f64)| (re - x).powi(2) + (im - y).powi(2) <= disc.radius.powi(2);
            let count = reference.multipliers.iter().filter(inside).count();
            assert_eq!(count, disc.count, "{disc:?}");
            all += count;
        }
        assert_eq!(all, 2 * reference.modes);
        let stable = reference
            .multipliers
            .iter()
            .all(|(re, im)| re * re + im * im < 1.0);
        assert_eq!(
            theorem.stability,
            if stable { "stable" } else { "unstable" }
        );
    }
}

/// The orbit of a case that differs in the ninth digit of a damper is not the one of the reference,
/// and the theorems show it.
#[test]
fn a_theorem_depends_on_all_digits_of_the_case() {
    let reference = &REFERENCES[0];
    let other = case(&["modes=1", "omega=20", "alpha6=0.200000001"]);
    let theorem = found(&other, &OrbitOptions::default()).1.theorem.unwrap();
    let mut all = theorem.state.iter().zip(reference.state);
    assert!(!all.all(|(bounds, exact)| holds(*bounds, *exact)));
}

/// Every piecewise-linear law, drive and number of modes.
#[test]
fn every_piecewise_linear_lever_can_be_proved() {
    let levers: [&[&str]; 8] = [
        &["omega=20", "modes=2"],
        &["omega=20", "modes=12"],
        &["omega=20", "modes=2", "contact=kelvin-voigt"],
        &["omega=20", "modes=2", "actuation=tip"],
        &["omega=20", "modes=2", "actuation=distributed"],
        &["omega=20", "modes=2", "cosine_term=printed"],
        &[
            "omega=20",
            "modes=2",
            "tone2_ratio=3/2",
            "tone2_amplitude=0.02",
            "tone2_phase=30",
            "tone3_ratio=5/2",
            "tone3_amplitude=0.01",
            "tone3_phase=-50",
        ],
        &["omega=20", "modes=3", "alpha5=5"],
    ];
    for lever in levers {
        let proof = settled(lever);
        assert!(proof.proved, "{lever:?}: {}", proof.statement);
        assert_eq!(proof.theorem.unwrap().stability, "stable", "{lever:?}");
    }
    let solids: [&[&str]; 2] = [
        &[
            "contact=standard-linear-solid",
            "relaxation_stiffness=5",
            "relaxation_time=0.1",
        ],
        &[
            "contact=generalised-maxwell",
            "relaxation_arms=[[\"time\", \"stiffness\"], [0.1, 5], [0.5, 3], [0.02, 4]]",
        ],
    ];
    for solid in solids {
        let words = [
            "alpha1=0.1",
            "alpha2=0.1",
            "alpha3=0.1",
            "alpha4=20",
            "omega=20",
            "modes=2",
        ];
        let words: Vec<String> = [&words, solid].concat().iter().map(|&w| w.into()).collect();
        let solid = Case::parse(None, &words).unwrap();
        let proof = found(&solid, &OrbitOptions::default()).1;
        assert!(proof.proved, "{}", proof.statement);
    }
}

/// A discontinuous force is not covered by the proofs, which report this.
#[test]
fn a_moving_surface_is_not_proved() {
    let surface = [
        "omega=20",
        "alpha5=0.05",
        "contact=moving-surface",
        "surface_stiffness=60",
        "surface_damping=8",
        "adhesion_force=0.4",
    ];
    let proof = settled(&surface);
    assert!(!proof.proved);
    assert!(
        proof.statement.contains("moving-surface"),
        "{}",
        proof.statement
    );
}

/// An orbit of 30 drive periods in chaos, with some 70 switches.
#[test]
fn long_unstable_orbits_are_proved() {
    let case = case(&["omega=2.6", "modes=5"]);
    let options = OrbitOptions {
        period: Some(30),
        ..OrbitOptions::default()
    };
    let (orbit, proof) = found(&case, &options);
    assert!(proof.proved, "{}", proof.statement);
    let theorem = proof.theorem.unwrap();
    assert_eq!((theorem.period, theorem.stability), (30, "unstable"));
    for (bounds, x) in theorem.state.iter().zip(&orbit.state) {
        assert!(bounds[0] - 1e-9 < *x && *x < bounds[1] + 1e-9);
    }
}

/// The table of docs/proof.md: exact numbers of switches and widths within a factor of two; where
/// the page says "some", within a tenth and a factor of ten.
#[test]
fn enclosures_are_as_narrow_as_documented() {
    let page = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/proof.md");
    let page = std::fs::read_to_string(page).unwrap();
    let mut rows = 0;
    for row in page.lines().filter(|line| line.starts_with("| Ω = ")) {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let number = |text: &str| -> (f64, bool) {
            let some = text.strip_prefix("some ");
            (some.unwrap_or(text).parse().unwrap(), some.is_some())
        };
        let orbit: Vec<&str> = cells[0].split(", ").collect();
        let after = |part: &str, word: &str| part.strip_prefix(word).unwrap().to_owned();
        let case = case(&[
            &format!("omega={}", after(orbit[0], "Ω = ")),
            &format!("modes={}", after(orbit[1], "N = ")),
        ]);
        let options = OrbitOptions {
            period: Some(after(orbit[2], "period ").parse().unwrap()),
            ..OrbitOptions::default()
        };
        let theorem = found(&case, &options).1.theorem.unwrap();
        assert_eq!(theorem.stability, orbit[3], "{row}");
        let (switches, some) = number(cells[1]);
        let off = (theorem.switches.len() as f64 - switches).abs();
        assert!(
            off <= if some { 0.1 * switches } else { 0.0 },
            "{row}: {off}"
        );
        let half = |[low, high]: &[f64; 2]| 0.5 * (high - low);
        let state = theorem.state.iter().map(half).fold(0.0, f64::max);
        let multipliers = theorem.multipliers.iter().map(|d| d.radius);
        for (known, said) in [
            (state, cells[2]),
            (multipliers.fold(0.0, f64::max), cells[3]),
        ] {
            let (said, some) = number(said);
            let factor = if some { 10.0 } else { 2.0 };
            assert!(
                (said / factor..said * factor).contains(&known),
                "{row}: {known:e}"
            );
        }
        rows += 1;
    }
    assert_eq!(rows, 6);
}

/// The multipliers of undamped motion are on the unit circle: the orbit exists, and stability is
/// undecided.
#[test]
fn stability_on_the_unit_circle_is_undecided() {
    let case = case(&["alpha3=0", "alpha6=0", "omega=4.1", "modes=2"]);
    let options = OrbitOptions {
        period: Some(1),
        ..OrbitOptions::default()
    };
    let proof = found(&case, &options).1;
    assert!(proof.proved, "{}", proof.statement);
    assert_eq!(proof.theorem.unwrap().stability, "undecided");
}

/// A motion that does not repeat, given as an orbit.
#[test]
fn a_motion_that_does_not_repeat_is_not_proved() {
    let case = case(&["omega=2.6", "modes=2"]);
    let model = case.model().unwrap();
    let system = enclosed(case.cantilever().unwrap()).unwrap();
    for periods in [1, 2, 5] {
        let run = Trajectory::record(&model.system, &[0.02, -0.001, 0.3, 0.01], periods).unwrap();
        assert!(!run.events().is_empty());
        assert!(prove(&system, &candidate(&run, periods)).is_err());
    }
    // One switch of an orbit omitted, and one state of another orbit.
    let found = orbit(
        &model,
        &OrbitOptions {
            period: Some(1),
            ..OrbitOptions::default()
        },
    );
    let found = found.unwrap();
    let run = Trajectory::record(&model.system, &found.state, 1).unwrap();
    let mut torn = candidate(&run, 1);
    assert!(prove(&system, &torn).is_ok());
    torn.switches.pop();
    assert!(matches!(
        prove(&system, &torn),
        Err(ProofError::Candidate { .. })
    ));
    let mut moved = candidate(&run, 1);
    moved.switches[0].state[0] *= 1.01;
    assert_eq!(prove(&system, &moved), Err(ProofError::NoIsolatedOrbit));
}

/// Cases that the method does not cover are refused with the reason.
#[test]
fn cases_that_are_not_covered_are_refused_with_a_reason() {
    let read = |text: &str| {
        let source = Source {
            name: "case".to_owned(),
            text: text.to_owned(),
        };
        Case::parse(Some(source), &[]).unwrap()
    };
    // The Hertz example of docs/cases/dforce.md.
    let hertz = read(include_str!("../../../docs/cases/dforce-hertz.toml"));
    let refused = enclosed(hertz.cantilever().unwrap()).unwrap_err();
    assert!(matches!(&refused, EnclosureError::NonlinearLaw { law } if law == "hertz"));
}

/// The paper's Fig. 1: ẍ + cẋ + x = cos ωt with a stop. At restitution 0.8, c = 0 and ω = 2.5 the
/// one-impact orbit hits at 0.6453521784 (the closed form of `physics/impact_oscillator.rs`).
#[test]
fn oscillators_with_a_stop_are_proved() {
    let rigid = Oscillator {
        mass: 1.0,
        stiffness: 1.0,
        damping: 0.0,
        forcing: 1.0,
        omega: 2.5,
        gap: 0.0,
        stop: Stop::Rigid { restitution: 0.8 },
    };
    let options = OrbitOptions {
        period: Some(1),
        ..OrbitOptions::default()
    };
    let case = Case::from(rigid);
    let orbit = orbit(&case.model().unwrap(), &options).unwrap();
    let theorem = Prover::new(&case)
        .theorem(&orbit.trajectory, orbit.period)
        .unwrap();
    let speed = theorem.switches[0].state[1];
    assert!((speed.middle() / -0.8 - 0.645_352_178_4).abs() < 1e-9 && speed.radius() < 1e-12);
    assert_eq!(theorem.multipliers.stability(), Stability::Stable);
    // At ω = 2.86 it comes to rest after 6.92666651404872 drive periods, at gap 0.25, ω = 2.5, c = 0.05
    // and restitution 0.7 after 9.91806229791744 (`stick_reference.json`), from releases at the phases
    // π/2 and arccos 0.25. Negative forces are the same half a period later.
    let damped = Oscillator {
        damping: 0.05,
        gap: 0.25,
        stop: Stop::Rigid { restitution: 0.7 },
        ..rigid
    };
    let resting = [
        (
            Oscillator {
                omega: 2.86,
                ..rigid
            },
            7,
            0.25 + 6.92666651404872,
        ),
        (
            damped,
            10,
            0.25_f64.acos() / std::f64::consts::TAU + 9.91806229791744,
        ),
        (
            Oscillator {
                omega: 2.86,
                forcing: -1.0,
                ..rigid
            },
            7,
            0.75 + 6.92666651404872,
        ),
    ];
    for (oscillator, period, rests) in resting {
        let case = Case::from(oscillator);
        let (orbit, proof) = found(&case, &OrbitOptions::default());
        assert!(proof.proved, "{}", proof.statement);
        let theorem = Prover::new(&case)
            .theorem(&orbit.trajectory, orbit.period)
            .unwrap();
        assert_eq!((orbit.period, theorem.period), (period, period));
        // Up to whole periods, by which the recorded orbit may begin later.
        let rest = theorem.rest.unwrap().since.middle();
        let apart = rest * oscillator.omega / std::f64::consts::TAU - rests;
        assert!((apart - apart.round()).abs() < 0.05, "{apart}");
        for (state, seen) in theorem.states.iter().zip(&orbit.states) {
            for (entry, seen) in state.iter().zip(seen) {
                let reach = entry.radius() + 1e-9;
                assert!((entry.middle() - seen).abs() <= reach, "{entry:?} {seen}");
            }
        }
        assert!(orbit.stable && proof.theorem.unwrap().stability == "stable");
    }
    let soft = Oscillator {
        damping: 0.1,
        stop: Stop::Soft {
            stiffness: 10.0,
            damping: 0.5,
        },
        ..rigid
    };
    let (orbit, proof) = found(&Case::from(soft), &OrbitOptions::default());
    assert!(proof.proved, "{}", proof.statement);
    let switches = proof.theorem.unwrap().switches;
    assert_eq!(switches.len(), orbit.events.len());
    for (switch, event) in switches.iter().zip(&orbit.events) {
        let [low, high] = switch.time;
        assert!(low - 1e-9 < event.tau && event.tau < high + 1e-9);
    }
}

/// The numbers of the ordinary model are inside the enclosed ones, which are narrow.
#[test]
fn interval_equations_contain_the_ordinary_ones() {
    let near = |interval: Interval, x: f64, what: &str| {
        // The ordinary number has its own rounding error.
        let wider = interval + Interval::around_zero(4e-14 * x.abs());
        assert!(wider.contains(x), "{what}: {interval:?} {x:e}");
        let width = interval.hi() - interval.lo();
        assert!(
            width <= 1e-13 * interval.magnitude(),
            "{what}: {width:e} of {x:e}"
        );
    };
    for more in [
        &["omega=2.6", "modes=5", "alpha5=-0.1"] as &[&str],
        &["omega=20", "modes=3", "contact=kelvin-voigt"],
        &[
            "omega=20",
            "modes=2",
            "actuation=tip",
            "tone2_ratio=3/2",
            "tone2_amplitude=0.02",
            "tone2_phase=30",
            "tone3_ratio=5/2",
            "tone3_amplitude=0.01",
            "tone3_phase=-50",
        ],
    ] {
        let case = case(more);
        let plain: Model = case.model().unwrap();
        let system = enclosed(case.cantilever().unwrap()).unwrap();
        near(system.period(), plain.period(), "period");
        for (r, parts) in system.regimes().enumerate() {
            let regime = &plain.system.regimes()[r];
            let n = system.dimension();
            for i in 0..n {
                for j in 0..n {
                    near(parts.matrix[(i, j)], regime.matrix()[(i, j)], "matrix");
                }
                near(
                    parts.forcing.constant[i],
                    regime.forcing().constant[i],
                    "constant",
                );
                for (tone, z) in parts.forcing.tones.iter().zip(&regime.forcing().tones) {
                    near(tone[i].re, z[i].re, "cosine");
                    near(tone[i].im, z[i].im, "sine");
                }
            }
            for (transition, given) in parts.transitions.iter().zip(&plain.system.transitions()[r])
            {
                assert_eq!(transition.target, given.target);
                assert_eq!(transition.reset.is_some(), given.reset.is_some());
                near(transition.guard.constant, given.guard.constant, "guard");
                for (x, y) in transition.guard.row.iter().zip(given.guard.row.iter()) {
                    near(*x, *y, "guard's row");
                }
                for (x, y) in transition.guard.tones.iter().zip(&given.guard.tones) {
                    near(x.re, y.re, "guard's cosine");
                    near(x.im, y.im, "guard's sine");
                }
            }
        }
    }
}
