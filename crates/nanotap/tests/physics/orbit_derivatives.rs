//! Derivatives of orbits and their observables, by the implicit function theorem, compared with
//! central differences of fourth order.

use nanotap::case::{Case, Key};
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap::model::drive_form::Actuation;
use nanotap::model::model_map::ModelMap;
use nanotap::model::oscillator::{Oscillator, Stop};
use nanotap::observe::{Derivative, Observable, ObservableSet, Observables, Value, measure};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap_dynamics::{ShootingOptions, close_orbit};

use crate::stated;

/// The numbers of an observable.
fn numbers(value: Value) -> Vec<f64> {
    match value {
        Value::Number(number) => vec![number],
        Value::Range(ends) => ends.to_vec(),
        Value::Energies(e) => vec![e.drive_work, e.beam_damping, e.sample_damping],
        Value::Count(_) | Value::Absent => Vec::new(),
    }
}

/// The orbit near `start`: its state and its observables.
fn observed(case: &Case, start: &[f64], period: usize) -> (Vec<f64>, Observables) {
    let model = case.model().unwrap();
    let mut map = ModelMap::new(&model);
    let found = close_orbit(&mut map, start, period, &ShootingOptions::default()).unwrap();
    assert_eq!(found.period, period);
    let seen = measure(&model, &found.states[0], period, ObservableSet::ALL).unwrap();
    (found.states[0].clone(), seen)
}

/// Compares the derivatives with respect to `key`, in the model's units and in SI, with
/// differences of `step` times its value.
fn compare(case: &Case, start: &[f64], period: usize, key: Key, step: f64) {
    let (state, seen) = observed(case, start, period);
    let model = case.model().unwrap();
    let at = (state.as_slice(), period);
    let exact = Derivative::of(case, &model, key, at, &seen, ObservableSet::ALL).unwrap();
    let value = case.get(key);
    let size = if value == 0.0 { 0.02 } else { value.abs() };
    let h = step * size;
    let moved: Vec<(Case, Vec<f64>, Observables)> = [-2.0, -1.0, 1.0, 2.0]
        .into_iter()
        .map(|k| {
            let case = case.with(key, value + k * h);
            let (state, seen) = observed(&case, &state, period);
            (case, state, seen)
        })
        .collect();
    let slope = |of: &dyn Fn(usize) -> f64| {
        let [a, b, c, d] = [of(0), of(1), of(2), of(3)];
        (a - 8.0 * b + 8.0 * c - d) / (12.0 * h)
    };
    // The numbers of one observable have a common scale.
    let check = |name: &str, exact: &[f64], slopes: &[f64], values: &[f64]| {
        let largest = |of: &[f64]| of.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        // An angle near zero has the same absolute error as others.
        let angle = if name.ends_with("phase") {
            1f64.to_degrees()
        } else {
            0.0
        };
        let scale = largest(exact).max(largest(values).max(angle) / size);
        for (exact, slope) in exact.iter().zip(slopes) {
            assert!(
                // The indentation of a rigid stop is rounding.
                (exact - slope).abs() <= 1e-6 * scale + 1e-13,
                "d {name} / d {}: {exact:e}, by differences {slope:e}",
                key.path()
            );
        }
    };
    let slopes: Vec<f64> = (0..state.len())
        .map(|i| slope(&|k| moved[k].1[i]))
        .collect();
    check("state", &exact.state, &slopes, &state);
    let each = |changes: &[(&'static Observable, Value)],
                of: &dyn Fn(&Case, &Observables) -> Observables| {
        let here = of(case, &seen);
        for (observable, change) in changes {
            let (exact, values) = (numbers(*change), numbers((observable.of)(&here)));
            let at = |i: usize, k: usize| {
                let (case, _, seen) = &moved[k];
                numbers((observable.of)(&of(case, seen)))[i]
            };
            let slopes: Vec<f64> = (0..exact.len()).map(|i| slope(&|k| at(i, k))).collect();
            check(observable.name, &exact, &slopes, &values);
        }
    };
    // Discontinuous values have no derivative; all others have.
    let absent = [
        "contacts_per_period",
        "beam_clearance_xi",
        "beam_clearance_period",
    ];
    for observable in nanotap::observe::OBSERVABLES {
        let known = exact.observables.iter().any(|(o, _)| *o == observable);
        let expected =
            !absent.contains(&observable.name) && !numbers((observable.of)(&seen)).is_empty();
        assert_eq!(known, expected, "{}", observable.name);
    }
    each(&exact.observables, &|_, seen| *seen);
    if let Some(physical) = &exact.physical {
        each(physical, &|case, seen| {
            seen.in_si(&case.physical().unwrap().scales)
        });
    }
}

fn compare_all(case: &Case, keys: &[Key], step: f64) {
    let found = orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap();
    for key in keys {
        compare(case, &found.state, found.period, *key, step);
    }
}

#[test]
fn of_the_papers_cantilever_by_every_number() {
    let case = Cantilever {
        omega: 3.0,
        alpha5: 0.03,
        ..Cantilever::paper()
    };
    let case = Case::from(case);
    compare_all(&case, &case.keys(), 2e-4);
}

#[test]
fn of_an_orbit_of_two_periods() {
    // Within the rounding of Ω = 2.6 a period 2 attracts (2.608 … 2.613).
    let case = Cantilever {
        omega: 2.61,
        ..Cantilever::paper()
    };
    let case = Case::from(case);
    let found = orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap();
    assert_eq!(found.period, 2);
    for key in [Key::Alpha4, Key::Omega] {
        // The window is narrow.
        compare(&case, &found.state, 2, key, 5e-6);
    }
}

#[test]
fn of_surfaces_with_memory() {
    let kelvin_voigt = Cantilever {
        omega: 3.0,
        contact: ContactLaw::KelvinVoigt,
        ..Cantilever::paper()
    };
    let solid = Cantilever {
        alpha6: 0.0,
        ..kelvin_voigt
            .clone()
            .on(ContactLaw::StandardLinearSolid, &[8.0, 0.05])
    };
    let moving = kelvin_voigt
        .clone()
        .on(ContactLaw::MovingSurface, &[60.0, 8.0, 0.4]);
    for (case, step) in [(kelvin_voigt, 5e-4), (solid, 1e-4), (moving, 2e-4)] {
        let case = Case::from(case);
        let mut keys = case.keys();
        // A standard linear solid has no additional damper.
        keys.retain(|key| case.get(*key) != 0.0 || *key != Key::Alpha6);
        compare_all(&case, &keys, step);
    }
}

#[test]
fn of_a_lever_that_is_driven_at_its_tip() {
    let case = Cantilever {
        omega: 3.0,
        alpha2: 0.3,
        alpha5: 0.1,
        actuation: Actuation::Tip,
        ..Cantilever::paper()
    };
    let case = Case::from(case);
    compare_all(
        &case,
        &[Key::Alpha2, Key::Alpha3, Key::Alpha5, Key::Omega],
        2e-4,
    );
}

#[test]
fn of_oscillators_with_soft_and_rigid_stops() {
    let soft = Stop::Soft {
        stiffness: 30.0,
        damping: 0.4,
    };
    for stop in [soft, Stop::Rigid { restitution: 0.8 }] {
        let case = Case::from(Oscillator {
            mass: 1.3,
            stiffness: 1.1,
            damping: 0.3,
            forcing: 0.9,
            omega: 1.9,
            gap: 0.1,
            stop,
        });
        compare_all(&case, &case.keys(), 2e-4);
    }
}

#[test]
fn by_physical_quantities_in_si() {
    let text = "[cantilever]\nk = \"2.8 N/m\"\nf0 = \"75 kHz\"\nQ = 200\n\
                [sample]\nstiffness = \"20 N/m\"\ndamping = \"1e-7 N s/m\"\n\
                [drive]\nfrequency = \"75 kHz\"\nfree_amplitude = \"20 nm\"\n\
                [gap]\ntip = \"15 nm\"\n";
    let case = stated(text);
    let keys = [
        "sample.stiffness",
        "sample.damping",
        "gap.tip",
        "drive.frequency",
        "cantilever.k",
        "cantilever.Q",
    ];
    let keys: Vec<Key> = keys.iter().map(|key| case.key(key).unwrap()).collect();
    compare_all(&case, &keys, 5e-5);
}
