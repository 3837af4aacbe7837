//! Signals of one shot against the periodic drive and against time steps of equations written here.

use std::f64::consts::TAU;

use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::drive_form::Actuation;
use nanotap::model::drive_signal::Pieces;
use nanotap::model::galerkin::Galerkin;
use nanotap::model::model_map::ModelMap;
use nanotap::model::parameter::Parameter;
use nanotap::study::drive_signal::{ReadSignal, StatedSignal};
use nanotap::study::one_shot::{OneShot, one_shot};
use nanotap::study::simulate::SimulateOptions;
use nanotap_dynamics::StroboscopicMap as _;

use crate::contact_laws::on;
use crate::stated;

fn run(case: &Case, signal: &str, periods: usize) -> OneShot {
    let options = SimulateOptions {
        drive_signal: Some(StatedSignal::Text(signal.to_owned())),
        periods,
        ..SimulateOptions::default()
    };
    let read = options.signal(case).unwrap().unwrap();
    one_shot(case, &read, &options, &Control::default()).unwrap()
}

/// A signal over so many drive periods, cut into pieces of one length.
fn signal(of: &dyn Fn(f64) -> f64, length: f64, count: u32) -> ReadSignal {
    let knot = |k| length * f64::from(k) / f64::from(count);
    let knots: Vec<f64> = (0..=count).map(knot).collect();
    ReadSignal {
        words: "signal".into(),
        length,
        pieces: Pieces::new().of(of, &knots, 1.0).unwrap(),
    }
}

/// Three modes over DMT.
const LEVER: &str = "
    [model]
    modes = 3
    [cantilever]
    k = '40 N/m'
    f0 = '300 kHz'
    Q = 50
    [tip]
    radius = '10 nm'
    [sample]
    law = 'dmt'
    modulus = '2 GPa'
    hamaker = '1e-19 J'
    [drive]
    frequency = '298 kHz'
    free_amplitude = '20 nm'
    [gap]
    tip = '4 nm'
";

/// A signal that is the sine of the drive is the periodic drive: the states after eight periods agree.
#[test]
fn a_sine_is_the_periodic_drive() {
    let forced = |actuation| Cantilever {
        actuation,
        ..Cantilever::paper()
    };
    let cases = [
        Case::from(Cantilever::paper()),
        Case::from(forced(Actuation::Tip)),
        Case::from(forced(Actuation::Distributed)),
        stated(LEVER),
    ];
    for case in cases {
        let read = signal(&|t: f64| (TAU * t).sin(), 8.0, 16);
        let found = one_shot(
            &case,
            &read,
            &SimulateOptions::default(),
            &Control::default(),
        )
        .unwrap();
        let model = case.model().unwrap();
        let mut state = model.rest();
        ModelMap::new(&model).advance_by(&mut state, 8).unwrap();
        assert!(found.contacts > 0);
        let size = state.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        for (a, b) in found.strobe[0].iter().zip(&state) {
            assert!((a - b).abs() < 1e-8 * size, "{:?} {state:?}", found.strobe);
        }
    }
}

/// One mode over a spring, driven through its base by a Gaussian: Runge–Kutta steps of
/// M ä = −α3 ȧ − β⁴ a − ÿ (α1 p + I) − α3 ẏ I − p α4 V in contact, V = p a + y + α5.
#[test]
fn a_pulse_moves_the_lever_as_time_steps_do() {
    let case = Cantilever {
        modes: 1,
        alpha2: 0.8,
        alpha5: 0.4,
        alpha6: 0.0,
        ..Cantilever::paper()
    };
    let equations = Galerkin::new(&case).unwrap();
    let [tip, integral] = [equations.modes.tip[0], equations.modes.integral[0]];
    let (mass, stiffness) = (equations.mass[(0, 0)], equations.modes.stiffness[0]);
    let period = TAU / case.omega;
    // Half a drive period at half of the maximum; it begins 8.5 standard deviations before its peak.
    let sigma = 0.5 * period / (2.0 * (2.0 * 2.0_f64.ln()).sqrt());
    let drive = |t: f64| {
        let x = (t - 8.5 * sigma) / sigma;
        let y = case.alpha2 * (-0.5 * x * x).exp();
        [y, -y * x / sigma, y * (x * x - 1.0) / (sigma * sigma)]
    };
    let field = |t: f64, [a, v]: [f64; 2]| {
        let [y, rate, acceleration] = drive(t);
        let height = tip * a + y + case.alpha5;
        let contact = if height < 0.0 {
            tip * case.alpha4 * height
        } else {
            0.0
        };
        let force = -case.alpha3 * v
            - stiffness * a
            - acceleration * (case.alpha1 * tip + integral)
            - case.alpha3 * rate * integral
            - contact;
        ([v, force / mass], height)
    };
    let found = run(&case.clone().into(), "pulse 0.5", 3);
    let end = found.periods * period;
    let steps = 200_000;
    let h = end / f64::from(steps);
    let (mut state, mut lowest) = ([0.0; 2], f64::INFINITY);
    for k in 0..steps {
        let t = h * f64::from(k);
        let along = |by: f64, [da, dv]: [f64; 2]| [state[0] + by * da, state[1] + by * dv];
        let (k1, height) = field(t, state);
        let (k2, _) = field(t + 0.5 * h, along(0.5 * h, k1));
        let (k3, _) = field(t + 0.5 * h, along(0.5 * h, k2));
        let (k4, _) = field(t + h, along(h, k3));
        lowest = lowest.min(height);
        let sum = |i: usize| (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0;
        state = along(h, [sum(0), sum(1)]);
    }
    assert!(found.contacts > 1, "{}", found.contacts);
    for (a, b) in found.strobe[0].iter().zip(state) {
        assert!((a - b).abs() < 1e-7, "{:?} {state:?}", found.strobe);
    }
    let indentation = found.observables.indentation;
    assert!(
        (indentation + lowest).abs() < 1e-7,
        "{indentation} {lowest}"
    );
}

/// In flight a lever is linear: twice the drive, twice the deflection; and the deflection of a tip force's
/// pulse is the convolution of the pulse with the response of each mode.
#[test]
fn a_pulse_in_flight_is_a_convolution() {
    let case = Cantilever {
        actuation: Actuation::Tip,
        alpha1: 0.0,
        alpha5: 50.0,
        ..Cantilever::paper()
    };
    let equations = Galerkin::new(&case).unwrap();
    let found = run(&case.clone().into(), "pulse 0.3", 2);
    let period = TAU / case.omega;
    let end = found.periods * period;
    let sigma = 0.3 * period / (2.0 * (2.0 * 2.0_f64.ln()).sqrt());
    for mode in 0..case.modes {
        let stiffness = equations.modes.stiffness[mode];
        let decay = 0.5 * case.alpha3;
        let omega = (stiffness - decay * decay).sqrt();
        let steps = 40_000;
        let h = end / f64::from(steps);
        // The trapezoidal rule is exact to rounding for a Gaussian.
        let sum: f64 = (0..=steps)
            .map(|k| {
                let t = h * f64::from(k);
                let x = (t - 8.5 * sigma) / sigma;
                let force = case.alpha2 * equations.modes.tip[mode] * (-0.5 * x * x).exp();
                let s = end - t;
                force * (-decay * s).exp() * (omega * s).sin() / omega
            })
            .sum();
        let off = (found.strobe[0][mode] - h * sum).abs();
        assert!(off < 1e-12, "{mode}: {off}");
    }
    let twice = run(&case.with(Parameter::Alpha2, 0.2).into(), "pulse 0.3", 2);
    let ratio = twice.observables.tip_max / found.observables.tip_max;
    assert!((ratio - 2.0).abs() < 1e-12);
}

/// A table of a pulse, in finer and finer steps, is the pulse.
#[test]
fn a_table_of_a_pulse_is_the_pulse() {
    let case = stated(LEVER);
    let pulse = run(&case, "pulse 1 us", 5);
    let frequency = 298e3;
    let sigma = 1e-6 / (2.0 * (2.0 * 2.0_f64.ln()).sqrt());
    let end = 17.0 * sigma;
    let mut last = f64::INFINITY;
    for rows in [100, 400] {
        let time = |k: usize| end * k as f64 / rows as f64;
        let times: Vec<f64> = (0..=rows).map(|k| 1e6 * time(k)).collect();
        let gauss = |k: usize| (-0.5 * ((time(k) - 8.5 * sigma) / sigma).powi(2)).exp();
        let drive: Vec<f64> = (0..=rows).map(gauss).collect();
        let stated: StatedSignal =
            serde_json::from_value(serde_json::json!({"time (us)": times, "drive": drive}))
                .unwrap();
        let options = SimulateOptions {
            drive_signal: Some(stated),
            periods: 5,
            ..SimulateOptions::default()
        };
        let read = options.signal(&case).unwrap().unwrap();
        assert!((read.length - end * frequency).abs() < 1e-9);
        let found = one_shot(&case, &read, &options, &Control::default()).unwrap();
        let off = (found.observables.tip_max / pulse.observables.tip_max - 1.0).abs();
        assert!(off < 0.1 * last, "{rows}: {off} after {last}");
        last = off;
    }
    assert!(last < 1e-5, "{last}");
}

/// A slow chirp in flight passes the resonance: its largest deflection is nearly that of the steady
/// state there, and is not reached without passing it.
#[test]
fn a_chirp_finds_the_resonance() {
    let case = Cantilever {
        modes: 1,
        alpha1: 0.0,
        alpha5: 50.0,
        omega: 3.5,
        ..Cantilever::paper()
    };
    let model = Model::cantilever(&case).unwrap();
    let free = model.system.regimes()[0].response().tones[0].clone();
    let steady = 2.0 * (free[0].re.powi(2) + free[0].im.powi(2)).sqrt();
    let found = run(&case.clone().into(), "chirp 0.7 1.3 600", 0);
    let above = run(&case.into(), "chirp 1.3 1.6 600", 0);
    let ratio = found.observables.tip_max / steady;
    assert!((0.97..1.03).contains(&ratio), "{ratio}");
    assert!(above.observables.tip_max < 0.3 * steady);
}

/// Every law goes on over the pieces; what is found agrees under another cut.
#[test]
fn laws_do_not_notice_the_cut() {
    use nanotap::model::contact::ContactLaw;
    for law in ContactLaw::ALL {
        let case = Case::from(Cantilever {
            alpha2: 0.4,
            alpha5: 0.3,
            ..on(law, 2.6)
        });
        let pulse = |t: f64| -1.5 * (-0.5 * ((t - 2.0) / 0.3_f64).powi(2)).exp();
        let state = |count: u32| {
            let read = signal(&pulse, 6.0, count);
            let found = one_shot(
                &case,
                &read,
                &SimulateOptions::default(),
                &Control::default(),
            )
            .unwrap();
            let balance = found.observables.energy_balance;
            assert!(balance.residual.abs() < 1e-9, "{law:?}: {balance:?}");
            (
                found.strobe[0].clone(),
                found.contacts,
                balance.sample_damping,
            )
        };
        let ((a, first, lost), (b, second, same)) = (state(7), state(31));
        assert!(
            (lost - same).abs() < 1e-8 * lost.abs().max(1e-3),
            "{law:?}: {lost} {same}"
        );
        assert!(first > 0 && first == second, "{law:?}: {first} {second}");
        for (a, b) in a.iter().zip(&b) {
            assert!((a - b).abs() < 1e-8, "{law:?}: {a} {b}");
        }
    }
}

/// The energies of a run: of the work of the drive, lever and sample lose a part, and the rest is stored. A
/// force that depends on the gap alone loses nothing; a damper in contact loses the integral of its power
/// over the time series.
#[test]
fn energies_of_a_shot_balance() {
    let found = run(&stated(LEVER), "pulse 1us times 40", 30);
    let balance = found.observables.energy_balance;
    assert!(found.contacts > 0 && balance.drive_work > 0.0);
    assert!(balance.residual.abs() < 1e-9, "{balance:?}");
    assert_eq!(balance.resolved(balance.sample_damping), 0.0, "{balance:?}");
    let damped = Case::from(Cantilever {
        alpha4: 0.0,
        alpha6: 1.5,
        alpha5: 0.05,
        ..Cantilever::paper()
    });
    let found = run(&damped, "pulse 0.5 times 10", 6);
    let read = StatedSignal::Text("pulse 0.5 times 10".to_owned())
        .read(&damped, 6)
        .unwrap();
    let model = damped.model().unwrap();
    let names = nanotap::observe::time_series::columns(&model);
    let [gap, force] =
        ["gap", "force"].map(|of| names.iter().position(|name| *name == of).unwrap());
    let (mut rows, resolution) = (Vec::new(), 4000);
    nanotap::study::one_shot::sample(&damped, &read, &found.start, resolution, &mut |row| {
        rows.push([row[gap], row[force]]);
    })
    .unwrap();
    // −∫F dV by the trapezoidal rule.
    let lost: f64 = rows
        .windows(2)
        .map(|pair| -0.5 * (pair[0][1] + pair[1][1]) * (pair[1][0] - pair[0][0]))
        .sum();
    let own = found.observables.energy_balance.sample_damping;
    assert!(own > 0.0 && (lost / own - 1.0).abs() < 1e-3, "{lost} {own}");
}
