//! Base and direct actuation, with one tone, two and three.

use std::sync::Arc;

use nanotap::case::Case;
use nanotap::case::physical::free_response::response_at;
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap::model::drive_form::{Actuation, FrequencyRatio};
use nanotap::model::galerkin::Galerkin;
use nanotap::model::model_map::ModelMap;
use nanotap::model::parameter::Parameter;
use nanotap::observe::{ObservableSet, Spectrum, measure};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::StroboscopicMap as _;
use nanotap_flow::{Complex, Flow};

use crate::contact_laws::{on, own_numbers};
use crate::derivatives::{advance, worst};

/// Two tones, the second at 25/4 of the first, with this actuation.
fn two_tones(actuation: Actuation) -> Cantilever {
    let case = Cantilever {
        actuation,
        alpha2: if actuation == Actuation::Base {
            0.1
        } else {
            0.6
        },
        further_tones: vec!["25/4".parse().unwrap()],
        omega: 3.1,
        ..Cantilever::paper()
    };
    let amplitude = if actuation == Actuation::Base {
        0.01
    } else {
        0.4
    };
    case.with(Parameter::Tone2Amplitude, amplitude)
        .with(Parameter::Tone2Phase, 35.0)
}

/// The same and a third at 9/2 of the first.
fn three_tones(actuation: Actuation) -> Cantilever {
    let mut case = two_tones(actuation);
    case.further_tones.push("9/2".parse().unwrap());
    let amplitude = 0.7 * case.get(Parameter::Tone2Amplitude);
    case.with(Parameter::Tone3Amplitude, amplitude)
        .with(Parameter::Tone3Phase, -70.0)
}

/// Far from the sample the motion is the sum of the responses to all tones, each with the
/// amplitude and phase of its closed form.
#[test]
fn tones_superpose_in_free_flight() {
    for actuation in Actuation::ALL {
        let case = Cantilever {
            alpha5: 50.0,
            ..three_tones(actuation)
        };
        let model = Model::cantilever(&case).unwrap();
        let found = orbit(&model, &OrbitOptions::default()).unwrap();
        assert!(found.events.is_empty() && found.period == 1);
        let o = &found.observables;
        let tones = [
            (case.alpha2, case.omega, o.first_harmonic, o.phase),
            (
                case.get(Parameter::Tone2Amplitude),
                6.25 * case.omega,
                o.tone2_response.unwrap(),
                o.tone2_lag.unwrap(),
            ),
            (
                case.get(Parameter::Tone3Amplitude),
                4.5 * case.omega,
                o.tone3_response.unwrap(),
                o.tone3_lag.unwrap(),
            ),
        ];
        for (drive, frequency, amplitude, phase) in tones {
            let z = response_at(&case, frequency).unwrap();
            assert!(
                (amplitude / (drive * z.modulus()) - 1.0).abs() < 1e-10,
                "{actuation}"
            );
            let off = (phase + z.argument().to_degrees()).rem_euclid(360.0);
            assert!(off.min(360.0 - off) < 1e-8, "{actuation}: {off}");
        }
        // There is no other motion.
        let further = [o.tone2_response, o.tone3_response].map(|of| of.unwrap().powi(2));
        let power = 0.5 * (o.first_harmonic.powi(2) + further[0] + further[1]);
        assert!((o.rms_deflection.powi(2) / power - 1.0).abs() < 1e-10);
        let spectrum = Spectrum::of(&model, &found.trajectory, 1, 8);
        let at = |order: f64| {
            let found = spectrum
                .harmonics
                .iter()
                .find(|h| (h.order - order).abs() < 1e-12);
            found.unwrap().tip
        };
        assert!((at(1.0) - o.first_harmonic).abs() < 1e-12);
        assert!((at(6.25) - o.tone2_response.unwrap()).abs() < 1e-12);
        assert!(at(2.0) < 1e-12 && at(0.25) < 1e-12);
    }
}

/// Under a slow force a beam deflects by L³/3EI per unit force at its tip and L³/8EI per unit of
/// evenly distributed force; under slow motion it follows its base.
#[test]
fn slow_drives_are_static() {
    let slow = |actuation| Cantilever {
        actuation,
        ..Cantilever::paper().with_modes(50)
    };
    let response = |actuation| response_at(&slow(actuation), 1e-3).unwrap();
    for (actuation, expected) in [
        (Actuation::Tip, 1.0 / 3.0),
        (Actuation::Distributed, 1.0 / 8.0),
        (Actuation::Base, 0.0),
    ] {
        let found = response(actuation);
        assert!(
            (found - Complex::new(expected, 0.0)).modulus() < 1e-4,
            "{actuation}: {found}"
        );
    }
}

/// With contacts, every actuation and three tones: derivatives with respect to all parameters,
/// including those of the tones, and a closed energy balance.
#[test]
fn every_drive_has_its_derivatives_and_balances_its_energy() {
    for actuation in Actuation::ALL {
        for law in ContactLaw::ALL {
            let sample = on(law, 3.1);
            let case = Cantilever {
                modes: 2,
                alpha5: 0.03,
                alpha6: sample.alpha6,
                arms: sample.arms.clone(),
                ..three_tones(actuation).on(law, &own_numbers(&sample))
            };
            let subject = Case::from(case);
            let model = subject.model().unwrap();
            let mut state = vec![0.0; model.dimension()];
            state[0] = 0.1;
            let seen = measure(&model, &state, 3, ObservableSet::ALL).unwrap();
            assert!(
                seen.energy_balance.residual.abs() < 1e-11,
                "{actuation} {law}"
            );
            assert!(seen.contacts_per_period > 0.5);
            if law != ContactLaw::SpringDamper {
                continue;
            }
            state = advance(&subject, &state);
            // Differences over four drive periods of a stiff spring have their own rounding.
            let error = worst(&subject, &state).unwrap();
            assert!(error < 1e-4, "{actuation}: {error:e}");
        }
    }
}

/// After one period of the first tone a second tone at 3/2 of its frequency has advanced by an
/// additional half turn: the same motion as with its phase shifted by half a turn.
#[test]
fn phases_and_times_agree() {
    let case = Cantilever {
        further_tones: vec!["3/2".parse().unwrap()],
        ..two_tones(Actuation::Base)
    };
    let first = std::f64::consts::TAU / case.omega;
    let run = |case: &Cantilever, state: &[f64], from: f64| {
        let model = Model::cantilever(case).unwrap();
        let mut flow = Flow::new(model.system.clone());
        flow.start(state, from).unwrap();
        flow.run_until(from + first, &mut ()).unwrap();
        let mut end = vec![0.0; state.len()];
        flow.state(&mut end);
        (end, flow.switches())
    };
    let start = [0.05, 0.01, 0.0, -0.2, 0.1, 0.0];
    let turned = case.clone().with(
        Parameter::Tone2Phase,
        case.get(Parameter::Tone2Phase) + 180.0,
    );
    let (later, switches) = run(&case, &start, first);
    let (now, _) = run(&turned, &start, 0.0);
    assert!(switches > 0);
    for (a, b) in later.iter().zip(&now) {
        assert!((a - b).abs() < 1e-12, "{later:?} {now:?}");
    }
    // A second tone of amplitude zero has no effect, except on the length of the period.
    let silent = case.clone().with(Parameter::Tone2Amplitude, 0.0);
    let single = Cantilever {
        further_tones: Vec::new(),
        ..silent.clone().with(Parameter::Tone2Phase, 0.0)
    };
    let (a, b) = (run(&silent, &start, 0.0).0, run(&single, &start, 0.0).0);
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-13));
}

/// A tip of one mode on spring and damper under two tones, by the classical Runge–Kutta method with
/// steps that end where contact begins and ends.
struct Tapping {
    /// Acceleration by deflection, speed and force at the tip.
    own: [f64; 3],
    contact: [f64; 3],
    tones: Vec<[f64; 2]>,
}

impl Tapping {
    fn rate(&self, t: f64, [w, v]: [f64; 2], touches: bool) -> [f64; 2] {
        let [stiffness, gap, damping] = self.contact;
        let mut force = if touches {
            -stiffness * (w + gap) - damping * v
        } else {
            0.0
        };
        for [strength, omega] in &self.tones {
            force += strength * (omega * t).sin();
        }
        [v, self.own[0] * w + self.own[1] * v + self.own[2] * force]
    }

    fn step(&self, t: f64, at: [f64; 2], h: f64, touches: bool) -> [f64; 2] {
        let moved = |by: [f64; 2], h: f64| [at[0] + h * by[0], at[1] + h * by[1]];
        let a = self.rate(t, at, touches);
        let b = self.rate(t + 0.5 * h, moved(a, 0.5 * h), touches);
        let c = self.rate(t + 0.5 * h, moved(b, 0.5 * h), touches);
        let d = self.rate(t + h, moved(c, h), touches);
        [0, 1].map(|k| at[k] + h / 6.0 * (a[k] + 2.0 * (b[k] + c[k]) + d[k]))
    }

    /// Follows `at` over a time, adding ∫ W e^(−iωt) dt at some frequencies.
    fn follow(
        &self,
        at: &mut [f64; 2],
        until: f64,
        steps: usize,
        lines: &[f64],
        sums: &mut [Complex],
    ) {
        let h = until / steps as f64;
        let gap = self.contact[1];
        for k in 0..steps {
            let (mut t, end) = (k as f64 * h, (k + 1) as f64 * h);
            while t < end {
                let touches = at[0] + gap < 0.0 || at[0] + gap == 0.0 && at[1] < 0.0;
                let crossed = |next: [f64; 2]| (next[0] + gap < 0.0) != touches;
                let mut length = end - t;
                let mut next = self.step(t, *at, length, touches);
                if crossed(next) {
                    let (mut low, mut high) = (0.0, length);
                    for _ in 0..60 {
                        length = 0.5 * (low + high);
                        let there = self.step(t, *at, length, touches);
                        if crossed(there) {
                            high = length;
                        } else {
                            low = length;
                        }
                    }
                    next = self.step(t, *at, high, touches);
                    next[0] = -gap;
                    length = high;
                }
                // Simpson's rule, with the middle of the cubic through both ends.
                let middle = 0.5 * (at[0] + next[0]) + length / 8.0 * (at[1] - next[1]);
                for (sum, omega) in sums.iter_mut().zip(lines) {
                    let turned = |t: f64| Complex::new((omega * t).cos(), -(omega * t).sin());
                    *sum += (turned(t) * at[0]
                        + turned(t + 0.5 * length) * (4.0 * middle)
                        + turned(t + length) * next[0])
                        * (length / 6.0);
                }
                *at = next;
                t = if length == end - t { end } else { t + length };
            }
        }
    }
}

/// Intermodulation of two and of three tones that repeat after 599 periods.
#[test]
fn intermodulation_agrees_with_another_integration() {
    for third in [None, Some(606)] {
        intermodulate(third);
    }
}

/// With a third tone at `third`/599 of the first.
fn intermodulate(third: Option<u32>) {
    let ratio = 601.0 / 599.0;
    let third_ratio = third.map(|third| f64::from(third) / 599.0);
    let mut case = Cantilever {
        actuation: Actuation::Tip,
        omega: 3.51,
        alpha2: 0.01,
        alpha3: 0.05,
        alpha4: 40.0,
        alpha1: 0.0,
        alpha5: 0.3,
        alpha6: 0.2,
        further_tones: vec!["601/599".parse().unwrap()],
        ..Cantilever::paper().with_modes(1)
    }
    .with(Parameter::Tone2Amplitude, 0.01);
    if let Some(third) = third {
        case.further_tones
            .push(format!("{third}/599").parse().unwrap());
        case = case.with(Parameter::Tone3Amplitude, 0.01);
    }
    let model = Model::cantilever(&case).unwrap();
    let found = orbit(&model, &OrbitOptions::default()).unwrap();
    assert_eq!(found.period, 1);
    assert!(
        found.observables.contacts_per_period > 10.0,
        "{} {}",
        found.observables.contacts_per_period,
        found.observables.tip_min
    );
    let equations = Galerkin::new(&case).unwrap();
    let of = |matrix: &nalgebra::DMatrix<f64>| matrix[(0, 0)] / equations.mass[(0, 0)];
    let tip = equations.modes.tip[0];
    let tapping = Tapping {
        own: [
            -of(&equations.stiffness[0]),
            -of(&equations.damping[0]),
            tip * tip / equations.mass[(0, 0)],
        ],
        contact: [case.alpha4, case.alpha5, case.alpha6],
        tones: [Some(1.0), Some(ratio), third_ratio]
            .into_iter()
            .flatten()
            .map(|ratio| [0.01, ratio * case.omega])
            .collect(),
    };
    let whole = 599.0 * std::f64::consts::TAU / case.omega;
    let mut at = [tip * found.state[0], tip * found.state[1]];
    // From another state the lever comes to the same motion.
    at[0] += 0.02;
    let mut factors = vec![1.0, ratio, 2.0 - ratio, 2.0 * ratio - 1.0];
    if let Some(third) = third_ratio {
        factors.extend([third, 1.0 + ratio - third]);
    }
    let lines: Vec<f64> = factors.iter().map(|factor| factor * case.omega).collect();
    let mut sums = vec![Complex::new(0.0, 0.0); lines.len()];
    tapping.follow(&mut at, whole, 599 * 1000, &[], &mut []);
    tapping.follow(&mut at, whole, 599 * 1000, &lines, &mut sums);
    let o = &found.observables;
    // The spectrum lists them as products of the tones.
    let spectrum = Spectrum::of(&model, &found.trajectory, 1, 2);
    let line = |product: &[i32]| {
        let mut harmonics = spectrum.harmonics.iter();
        let found = harmonics.find(|h| h.product.as_deref() == Some(product));
        found.map(|h| (h.tip, h.tip_phase)).unwrap()
    };
    let mut seen = vec![
        (o.first_harmonic, o.phase),
        (o.tone2_response.unwrap(), o.tone2_lag.unwrap()),
        (o.first_sideband.unwrap(), o.first_sideband_phase.unwrap()),
        (o.second_sideband.unwrap(), o.second_sideband_phase.unwrap()),
    ];
    if third.is_some() {
        let tone = (o.tone3_response.unwrap(), o.tone3_lag.unwrap());
        seen.extend([tone, line(&[1, 1, -1])]);
    }
    for (sum, (amplitude, lag)) in sums.into_iter().zip(&seen) {
        // Of A sin(ωt − lag): ∫ e^(−iωt) = A e^(−i lag) T/(2i).
        let read = sum * Complex::new(0.0, 2.0 / whole);
        let (sin, cos) = lag.to_radians().sin_cos();
        let off = read - Complex::new(cos, -sin) * *amplitude;
        assert!(
            off.modulus() < 1e-9 * o.first_harmonic,
            "{read} {amplitude} {lag}"
        );
    }
    let products = [[1, 0, 0], [0, 1, 0], [2, -1, 0], [-1, 2, 0], [0, 0, 1]];
    for (product, (amplitude, _)) in products.iter().zip(&seen) {
        let product = &product[..2 + usize::from(third.is_some())];
        assert!((line(product).0 - amplitude).abs() < 1e-12, "{product:?}");
    }
}

/// Tones that never repeat together: after one period of the first the state is that of the same tones
/// as multiples of a common frequency, on a sample with spring and damper too.
#[test]
fn tones_that_do_not_repeat_move_the_lever_as_those_that_do() {
    for actuation in Actuation::ALL {
        let locked = Cantilever {
            further_tones: vec!["13/10".parse().unwrap()],
            ..two_tones(actuation)
        };
        let unlocked = Cantilever {
            further_tones: vec![FrequencyRatio::unlocked(1.3)],
            ..locked.clone()
        };
        let [locked, unlocked] = [locked, unlocked].map(|case| Model::cantilever(&case).unwrap());
        let start = vec![0.02, -0.01, 0.003, 0.1, 0.0, -0.2];
        let mut flow = Flow::new(Arc::clone(&locked.system));
        flow.start(&start, 0.0).unwrap();
        flow.run_until(unlocked.period(), &mut ()).unwrap();
        let mut expected = start.clone();
        flow.state(&mut expected);
        let mut found = start;
        ModelMap::new(&unlocked).advance(&mut found).unwrap();
        for (a, b) in found.iter().zip(&expected) {
            assert!((a - b).abs() < 1e-12, "{actuation}: {found:?} {expected:?}");
        }
        assert!(ModelMap::new(&unlocked).advance_by(&mut found, 2).is_err());
    }
}
