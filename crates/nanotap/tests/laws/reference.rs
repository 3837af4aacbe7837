//! The reference numbers of two prototypes of the method (scalar Volterra collocation, orbits
//! closed to 1e-14 nm), from the case file: A, φ, contact fraction, virial, multipliers.

use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::study::attractors::{AttractorsOptions, attractors};
use nanotap::study::branch::{BranchOptions, branch};
use nanotap::study::orbit::{OrbitOptions, OrbitReport, orbit};

use crate::common::{DMT, EV, HERTZ, air, lever};

/// The orbit of `case` near amplitude `a` (nm) and phase `phase` (degrees): with one mode the drive
/// at the tip is α sin ωt, so that z = A sin(ωt − φ).
fn near(case: &Case, a: f64, phase: f64) -> OrbitReport {
    let view = case.physical().unwrap();
    let model = case.model().unwrap();
    // a_1 of the tip deflection W = φ_1(1) a_1.
    let scale = a * 1e-9 / view.scales.length / model.tip.row[0];
    let (sin, cos) = phase.to_radians().sin_cos();
    let omega = model.frequency();
    let options = OrbitOptions {
        period: Some(1),
        state: Some(vec![-scale * sin, scale * omega * cos].into()),
        ..OrbitOptions::default()
    };
    orbit(&model, &options).unwrap()
}

fn close(found: f64, reference: f64, what: &str) {
    let error = (found - reference).abs() / reference.abs();
    assert!(error < 1e-7, "{what}: {found} instead of {reference}");
}

/// Agreement to half a unit of the last digit given.
fn digits(found: f64, reference: f64, unit: f64, what: &str) {
    assert!(
        (found - reference).abs() <= 0.51 * unit,
        "{what}: {found} instead of {reference}"
    );
}

#[test]
fn hertz_contact() {
    let rows = [
        (
            11.25,
            11.9866582,
            53.0459180,
            0.022828175,
            0.123652083,
            -1.51789464,
        ),
        (
            7.5,
            8.3105217,
            33.6454686,
            0.031830273,
            0.154164520,
            -1.45658069,
        ),
    ];
    for (zc, a, phase, mean, contact, virial) in rows {
        let case = air(15.0, zc, &HERTZ);
        let found = near(&case, a, phase);
        let seen = found.observables.in_si(&case.physical().unwrap().scales);
        digits(seen.first_harmonic * 1e9, a, 1e-7, "amplitude");
        close(seen.phase, phase, "phase");
        digits(seen.mean_deflection * 1e9, mean, 1e-9, "mean deflection");
        close(seen.contact_fraction, contact, "contact fraction");
        close(seen.virial / EV, virial, "virial");
        assert_eq!(seen.dissipation, 0.0);
        assert!(found.determinant_defect < 1e-9);
        assert!(seen.energy_balance.residual.abs() < 1e-10);
        if zc == 11.25 {
            digits(found.multipliers[0][0], 0.9826992, 1e-7, "multiplier");
            digits(found.multipliers[0][1].abs(), 0.0580922, 1e-7, "multiplier");
        }
    }
}

#[test]
fn dmt_with_van_der_waals() {
    type Row = (f64, f64, f64, f64, [f64; 2], f64);
    // A, φ, contact fraction, virial, first multiplier, real part of the second.
    let rows: [Row; 3] = [
        (
            17.78633469,
            117.2119929,
            0.0,
            2.284209116,
            [0.980283, 0.090101],
            0.980283,
        ),
        (
            18.35635354,
            113.3905558,
            0.0766419184,
            2.047162915,
            [1.072375, 0.0],
            0.903669,
        ),
        (
            18.52532864,
            67.86119340,
            0.0870649270,
            -1.965687225,
            [0.97975, 0.095723],
            0.97975,
        ),
    ];
    let case = air(20.0, 18.0, &DMT);
    for (a, phase, contact, virial, [re, im], second) in rows {
        let found = near(&case, a, phase);
        let seen = found.observables.in_si(&case.physical().unwrap().scales);
        digits(seen.first_harmonic * 1e9, a, 1e-8, "amplitude");
        close(seen.phase, phase, "phase");
        if contact == 0.0 {
            assert_eq!(seen.contact_fraction, 0.0);
            assert_eq!(seen.contacts_per_period, 0.0);
        } else {
            close(seen.contact_fraction, contact, "contact fraction");
            assert_eq!(seen.contacts_per_period, 1.0);
        }
        close(seen.virial / EV, virial, "virial");
        digits(found.multipliers[0][0], re, 1e-5, "multiplier");
        digits(found.multipliers[0][1].abs(), im, 1e-5, "multiplier");
        digits(found.multipliers[1][0], second, 1e-5, "multiplier");
        assert_eq!(found.stable, re < 1.0);
        assert_eq!(seen.dissipation, 0.0);
        assert!(found.determinant_defect < 1e-9);
        assert!(seen.energy_balance.residual.abs() < 1e-10);
        // The adhesion of the contact is the minimum of the force in contact.
        if contact > 0.0 {
            assert!(seen.least_force * 1e9 < -0.8753194916 + 1e-9);
        }
    }
}

#[test]
fn the_repulsive_branch_ends_in_a_fold() {
    let case = air(20.0, 18.0, &DMT);
    let model = case.model().unwrap();
    let repulsive = near(&case, 18.52532864, 67.86119340);
    let metres = |nm: f64| nm * 1e-9;
    let options = BranchOptions {
        period: Some(1),
        state: Some(repulsive.state.into()),
        ..BranchOptions::over(Key::GapTip, metres(18.0), metres(20.0))
    };
    assert_eq!(model.dimension(), 2);
    let found = branch(&case, &options, &Control::default()).unwrap();
    let fold = found
        .bifurcations
        .iter()
        .find(|b| b.kind == "fold")
        .unwrap();
    digits(fold.parameter * 1e9, 19.549515, 1e-6, "fold");
    let seen = &fold.physical.as_ref().unwrap().observables;
    digits(
        seen.first_harmonic * 1e9,
        19.99872,
        1e-5,
        "amplitude at the fold",
    );
    // At a fold the phase depends on the distance like a square root: the fourth digit of φ depends
    // on the last digit of zc in the reference.
    digits(seen.phase, 90.6398, 1e-3, "phase at the fold");
}

/// Starts of the size of the free oscillation; a start that cannot be followed is undecided.
#[test]
fn a_census_finds_the_two_stable_orbits() {
    let case = air(20.0, 18.0, &DMT);
    let model = case.model().unwrap();
    let scales = &case.physical().unwrap().scales;
    let size = 22e-9 / scales.length / model.tip.row[0].abs();
    let speed = size * model.frequency();
    let options = AttractorsOptions {
        starts: Some(16),
        sides: [("a1", -size, size), ("v1", -speed, speed)]
            .into_iter()
            .collect(),
        ..AttractorsOptions::default()
    };
    let found = attractors(&model, &options, &Control::default()).unwrap();
    let amplitude = |o: &OrbitReport| o.observables.first_harmonic * scales.length * 1e9;
    let mut stable: Vec<f64> = found
        .attractors
        .iter()
        .map(|a| amplitude(a.orbit.as_ref().unwrap()))
        .collect();
    stable.sort_by(f64::total_cmp);
    assert_eq!(stable.len(), 2, "{stable:?}");
    digits(stable[0], 17.78633469, 1e-8, "attractive");
    digits(stable[1], 18.52532864, 1e-8, "repulsive");
}

#[test]
fn kelvin_voigt_in_liquid() {
    let rows = [
        (8.0, 9.795093323, 81.70639278, 2.16384182),
        (5.0, 8.555349436, 64.59792967, 6.762395033),
    ];
    let sample = [
        "sample.law=voigt-sphere-pulling",
        "sample.modulus=100 MPa",
        "sample.poisson=0.5",
        "sample.viscosity=2 Pa s",
        "sample.intermolecular_distance=0.169 nm",
    ];
    for (zc, a, phase, dissipated) in rows {
        let case = lever((0.3, 2.0, "350 kHz"), (10.0, zc), &sample);
        let found = near(&case, a, phase);
        let seen = found.observables.in_si(&case.physical().unwrap().scales);
        digits(seen.first_harmonic * 1e9, a, 1e-8, "amplitude");
        close(seen.phase, phase, "phase");
        close(seen.dissipation / EV, dissipated, "dissipated energy");
        assert!(
            found.determinant_defect < 1e-9,
            "{}",
            found.determinant_defect
        );
        assert!(seen.energy_balance.residual.abs() < 1e-10);
    }
}

/// Damping that stops the tip and lets it creep through a contact. The iteration error of the
/// forces is no reason for short steps: some of these periods once took 20,240 steps, and an orbit
/// eight minutes.
#[test]
fn strong_damping_near_the_sample_needs_few_steps() {
    let case = air(
        15.0,
        11.25,
        &[
            "sample.law=hertz + exponential-damping",
            "sample.modulus=100 MPa",
            "sample.poisson=0.3",
            "tip.modulus=160 GPa",
            "tip.poisson=0.3",
            "sample.intermolecular_distance=0.169 nm",
            "sample.damping=1e-6 N s/m",
            "sample.decay_length=0.3 nm",
        ],
    );
    let model = case.model().unwrap();
    let nonlinear = model.nonlinear.as_ref().unwrap();
    let mut flow = nanotap_volterra::Flow::new(nonlinear.system.clone());
    for period in 1..=250 {
        let before = flow.statistics().steps;
        flow.run_until(f64::from(period) * model.period()).unwrap();
        let steps = flow.statistics().steps - before;
        assert!(steps < 500, "{steps} steps in period {period}");
    }
}
