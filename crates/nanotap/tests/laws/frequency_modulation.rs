//! Frequency modulation: orbits of a given amplitude and phase.

use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::study::approach::{ApproachOptions, ApproachPoint, ApproachReport, Way, approach};
use nanotap::study::frequency_modulation::{
    Averages, Driven, FreeOscillation, FrequencyModulationOptions, Held, Modulated,
    frequency_modulation,
};
use nanotap::study::orbit::{OrbitOptions, OrbitReport, orbit};
use nanotap::study::request::read;

use crate::common::{DMT, HERTZ, MODAL, air, lever};

/// The lever of the reference: 40 N/m, a tip of 10 nm under van der Waals attraction.
fn reference(q: f64, amplitude: f64, gap: f64) -> Case {
    let sample = [
        "sample.law=van-der-waals",
        "sample.hamaker=2e-19 J",
        "tip.radius=10 nm",
    ];
    lever((40.0, q, "100 kHz"), (amplitude, gap), &sample)
}

/// A curve between distances in nm.
fn modulated(case: &Case, (from, to): (f64, f64), points: usize) -> ApproachReport {
    let unit = 1e-9;
    let options = FrequencyModulationOptions {
        from: Some((from * unit).into()),
        to: Some((to * unit).into()),
        points,
        phase: 90.0,
        ..FrequencyModulationOptions::default()
    };
    frequency_modulation(case, &options, &Control::default()).unwrap()
}

fn nearest(report: &ApproachReport) -> (&ApproachPoint, Modulated) {
    let point = report.table.iter().rfind(|p| p.way == Way::Approach);
    let point = point.unwrap();
    (point, point.modulation.unwrap())
}

/// The orbit study with the drive that was found, from the orbit's state.
fn again(case: &Case, point: &ApproachPoint) -> OrbitReport {
    let found = point.modulation.unwrap();
    let case = case
        .with(case.gap_key(), point.gap)
        .with(Key::Omega, found.drive_frequency)
        .with(Key::Alpha2, found.drive_strength);
    let options = OrbitOptions {
        period: Some(1),
        state: Some(point.orbit.as_ref().unwrap().states[0].clone().into()),
        harmonics: 200,
        ..OrbitOptions::default()
    };
    orbit(&case.model().unwrap(), &options).unwrap()
}

/// The lever of mass, spring and van der Waals attraction alone: released 10 nm towards the sample
/// from a distance of 11 nm, its frequency shift follows from the energy integral, −8.661882e-5 of
/// the frequency (quadrature with 30 digits; its amplitude is 9.99960316 nm). The two formulas are
/// for an amplitude of 10 nm.
#[test]
fn shifts_under_van_der_waals_are_those_of_the_reference() {
    let near = |value: f64, reference: f64| (value / reference - 1.0).abs();
    let at = |q: f64, amplitude: f64| {
        let report = modulated(&reference(q, amplitude, 11.0), (12.0, 11.0), 2);
        let (point, found) = nearest(&report);
        let swing = point.physical.as_ref().unwrap().observables.tip_min * 1e9;
        (found, swing)
    };
    for q in [1e6, 1e9] {
        let (found, swing) = at(q, 10.0);
        assert!(near(found.first_order_shift.unwrap(), -8.659440e-5) < 1e-6);
        assert!(near(found.giessibl_shift.unwrap(), -9.316950e-5) < 1e-6);
        // The amplitude with the same closest distance.
        let (_, other) = at(q, 9.9996);
        let amplitude = 10.0 + (-10.0 - swing) * (9.9996 - 10.0) / (other - swing);
        let (found, swing) = at(q, amplitude);
        assert!((swing + 10.0).abs() < 1e-8, "{swing}");
        assert!(
            near(found.relative_shift, -8.661_882_202_775_e-5) < 1e-7,
            "Q = {q}: {}",
            found.relative_shift
        );
    }
}

/// First order and large amplitudes where the force has kinks, at an amplitude of 10 nm, a distance
/// of 9.9 nm and 0.9 N/m: under DMT's law by mpmath with 30 digits, split at the contact (its force
/// is 4/3 E* √R (a₀ − d)^{3/2} − HR/(6a₀²) there, −HR/(6d²) beyond); over a spring κ in closed form,
/// κ (φ − sin φ cos φ)/(2πk) with cos φ = z/A.
#[test]
fn averages_are_exact_where_the_tip_touches() {
    let case = air(10.0, 9.9, &DMT);
    let scales = case.physical().unwrap().scales;
    let model = case.model().unwrap();
    let [swing, gap] = [10e-9, 9.9e-9].map(|z| z / scales.length);
    let stiffness = 0.9 * scales.length / scales.force;
    let found = Averages::new(&model, 0.0, swing, stiffness).at(gap);
    let near = |value: f64, reference: f64| (value / reference - 1.0).abs();
    let references = [
        (found.first_order, -6.504_043_615_655_633e-3),
        (found.giessibl, -6.623_809_096_864_456e-3),
    ];
    for (found, reference) in references {
        assert!(near(found, reference) < 1e-11, "{found} {reference}");
    }
    let linear = lever(
        (0.9, 200.0, "100 kHz"),
        (10.0, 9.9),
        &["sample.stiffness=8 N/m"],
    );
    let model = linear.model().unwrap();
    let half = (9.9_f64 / 10.0).acos();
    let expected = 8.0 * (half - half.sin() * half.cos()) / (std::f64::consts::TAU * 0.9);
    let found = Averages::new(&model, 8.0, 10.0, 0.9).at(9.9).first_order;
    assert!(near(found, expected) < 1e-11, "{found} {expected}");
}

/// A conservative force dissipates nothing, and the drive compensates only the lever's own damping:
/// in proportion to the frequency without harmonics, and in total as in the energy balance of the
/// same orbit, found again from its drive.
#[test]
fn a_conservative_law_needs_no_additional_drive() {
    let case = air(10.0, 11.0, &DMT);
    let report = modulated(&case, (12.0, 9.5), 6);
    let free = report.modulation.as_ref().unwrap();
    assert!(free.ended.is_empty() && free.jumps.is_empty());
    assert!(report.returned && report.hysteresis.is_empty());
    let mut signs = [false; 2];
    for point in &report.table {
        let found = point.modulation.unwrap();
        assert_eq!(point.observables.unwrap().dissipation, 0.0);
        let balance = again(&case, point).observables.energy_balance;
        let reported = free.free_loss * found.drive_ratio;
        assert!((balance.drive_work / reported - 1.0).abs() < 1e-9);
        assert!((balance.beam_damping / reported - 1.0).abs() < 1e-9);
        if point.observables.unwrap().contact_fraction == 0.0 {
            let harmonics = found.drive_ratio - 1.0 - found.relative_shift;
            assert!(
                harmonics.abs() < 0.01 * found.relative_shift.abs(),
                "{found:?}"
            );
        }
        signs[usize::from(found.relative_shift > 0.0)] = true;
    }
    // Attraction lowers the frequency, repulsion raises it.
    assert_eq!(signs, [true, true]);
}

/// Σ n² A_n²/A₁² over n ≥ 2: the contribution of harmonics to the damping of one mode.
fn harmonics(orbit: &OrbitReport) -> f64 {
    let harmonics = orbit.spectrum.harmonics.iter();
    let first = orbit.observables.first_harmonic;
    let parts = harmonics.filter(|h| h.order > 1.0);
    parts.map(|h| (h.order * h.tip / first).powi(2)).sum()
}

/// With one mode, driven at its tip, the energy dissipated in the sample is the energy of the
/// drive, E₀ F/F₀, less the damping of all harmonics, E₀ (f/f₀) (1 + Σ n² A_n²/A₁²): compared with
/// the orbit found again from its frequency and drive.
#[test]
fn the_drive_gives_the_dissipation_of_a_viscous_sample() {
    let mut sample = HERTZ.to_vec();
    sample[0] = "sample.law=voigt-sphere-pulling";
    sample.push("sample.viscosity=2 Pa s");
    let case = air(10.0, 10.0, &sample);
    let report = modulated(&case, (11.0, 5.0), 5);
    let free = report.modulation.as_ref().unwrap();
    assert!(free.ended.is_empty(), "{:?}", free.ended);
    let mut most = 0_f64;
    for point in &report.table {
        let found = point.modulation.unwrap();
        let orbit = again(&case, point);
        assert!((orbit.observables.phase - 90.0).abs() < 1e-8);
        let amplitude = orbit.observables.first_harmonic / free.amplitude;
        assert!((amplitude - 1.0).abs() < 1e-9, "{amplitude}");
        let taken = orbit.observables.dissipation;
        let balance = orbit.observables.energy_balance;
        let reported = free.free_loss * found.drive_ratio - balance.beam_damping;
        assert!(
            (reported - taken).abs() < 1e-9 * free.free_loss,
            "{reported} {taken}"
        );
        let damping = (1.0 + found.relative_shift) * (1.0 + harmonics(&orbit));
        let reported = free.free_loss * (found.drive_ratio - damping);
        assert!(
            (reported - taken).abs() < 1e-7 * free.free_loss,
            "{reported} {taken}"
        );
        most = most.max(taken / free.free_loss);
    }
    assert!(most > 0.3, "{most}");
}

/// Linear contact in the exact engine, driven at the base and at the tip, several modes: the orbit
/// has the requested amplitude and phase.
#[test]
fn orbits_have_the_requested_amplitude_and_phase() {
    for actuation in ["base", "tip", "distributed"] {
        let words = [
            "cantilever.k=2 N/m",
            "cantilever.f0=70 kHz",
            "cantilever.Q=150",
            "tip.mass_ratio=0.05",
            "sample.stiffness=5 N/m",
            "sample.damping=1e-7 N s/m",
            "drive.frequency=70 kHz",
            "drive.free_amplitude=20 nm",
            "gap.tip=15 nm",
        ];
        let mut words = words.map(str::to_owned).to_vec();
        words.push(format!("drive.actuation={actuation}"));
        let case = Case::parse(None, &words).unwrap();
        for phase in [60.0, 90.0, 110.0] {
            let options = FrequencyModulationOptions {
                points: 6,
                to: Some((10e-9).into()),
                phase,
                ..FrequencyModulationOptions::default()
            };
            let report = frequency_modulation(&case, &options, &Control::default()).unwrap();
            let free = report.modulation.as_ref().unwrap();
            assert!(
                free.ended.is_empty(),
                "{actuation} {phase}: {:?}",
                free.ended
            );
            // No contact at the beginning.
            let first = report.table[0].modulation.unwrap();
            assert!(first.relative_shift.abs() < 1e-12);
            assert!((first.drive_ratio - 1.0).abs() < 1e-9);
            let (point, found) = nearest(&report);
            assert!(found.relative_shift > 1e-3);
            let orbit = again(&case, point);
            assert!((orbit.observables.phase - phase).abs() < 1e-8);
            let amplitude = orbit.observables.first_harmonic / free.amplitude;
            assert!((amplitude - 1.0).abs() < 1e-9, "{amplitude}");
            let radius = orbit.multipliers[0];
            let radius = radius[0].hypot(radius[1]);
            assert!((radius / point.spectral_radius.unwrap() - 1.0).abs() < 1e-7);
        }
    }
}

/// Laws with hysteresis: the dissipation per period is the area of the loop of the static force, by
/// a sum over the distance, for any amplitude. The drive gives the same value, and the shift is
/// that of the force averaged over both directions.
#[test]
fn a_hysteretic_law_dissipates_the_area_of_its_loop() {
    let [_, modulus, poisson, ..] = DMT;
    let jkr = [
        "sample.law=jkr",
        modulus,
        poisson,
        "sample.work_of_adhesion=30 mJ/m^2",
    ];
    let bridge = [
        "sample.law=hertz + capillary",
        modulus,
        poisson,
        "sample.film_thickness=0.3 nm",
        "sample.surface_energy=70 mJ/m^2",
    ];
    let stiff = |sample: &[&str]| lever((40.0, 5e3, "100 kHz"), (10.0, 11.0), sample);
    for (case, range) in [(stiff(&jkr), (10.4, 9.4)), (stiff(&bridge), (11.5, 9.8))] {
        let model = case.model().unwrap();
        let law = model.nonlinear.as_ref().unwrap();
        let unit = 1e-9 / case.physical().unwrap().scales.length;
        let (near, far, count) = (-0.5 * unit, 9.5 * unit, 400_000);
        let step = (far - near) / f64::from(count);
        let place = |k: i32| near + step * (f64::from(k) + 0.5);
        let curve = law.force_curve((0..count).rev().chain(0..count).map(place));
        let (inwards, outwards) = curve.split_at(curve.len() / 2);
        let sum = |way: &[[f64; 2]]| way.iter().map(|[_, force]| force * step).sum::<f64>();
        let area = sum(inwards) - sum(outwards);
        let report = modulated(&case, range, 4);
        let free = report.modulation.as_ref().unwrap();
        assert!(free.ended.is_empty() && free.jumps.is_empty(), "{free:?}");
        let mut met = 0;
        for point in report.table.iter().filter(|p| p.way == Way::Approach) {
            let (found, seen) = (point.modulation.unwrap(), point.observables.unwrap());
            if seen.dissipation == 0.0 {
                continue;
            }
            met += 1;
            assert!(
                (seen.dissipation / area - 1.0).abs() < 1e-4,
                "{seen:?} {area}"
            );
            assert!(
                (found.drive_dissipation / area - 1.0).abs() < 0.02,
                "{found:?}"
            );
            let first = found.first_order_shift.unwrap();
            let off = (found.relative_shift - first).abs();
            assert!(off < 0.03 * first.abs() + 3e-6, "{found:?}");
        }
        assert!(met >= 2, "{met}");
    }
}

/// At one least distance D, under van der Waals' force F = −HR/(6d²): the average over a sinusoid
/// about z = D + A is in closed form Δf/f₀ = −HR/(6k (z² − A²)^{3/2}). At small amplitudes that is
/// −k_ts/2k with the force's slope at z, at large ones the power law A^{−3/2} of Giessibl.
#[test]
fn the_shift_against_the_amplitude_at_a_fixed_closest_distance() {
    let case = reference(1e6, 10.0, 11.0);
    let scales = case.physical().unwrap().scales;
    let unit = 1e-9;
    let (stiffness, strength, closest) = (40.0, 2e-19 * 10e-9 / 6.0, 1e-9);
    let options = FrequencyModulationOptions {
        from: Some((401.0 * unit).into()),
        to: Some((1.02 * unit).into()),
        closest: Some(unit.into()),
        points: 30,
        phase: 90.0,
        ..FrequencyModulationOptions::default()
    };
    let report = frequency_modulation(&case, &options, &Control::default()).unwrap();
    let kept = report.modulation.as_ref().unwrap();
    assert!(kept.ended.is_empty() && kept.jumps.is_empty(), "{kept:?}");
    assert!(report.returned && report.hysteresis.is_empty());
    for point in &report.table {
        let found = point.modulation.unwrap();
        let amplitude = point.physical.as_ref().unwrap().observables.first_harmonic;
        let least = found.closest * scales.length;
        assert!((least / closest - 1.0).abs() < 1e-9, "{least}");
        assert!((point.gap * scales.length - amplitude - closest).abs() < 1e-17);
        let free = std::f64::consts::PI * stiffness * amplitude * amplitude / 1e6;
        let loss = kept.free_loss * scales.energy * (amplitude / 400e-9).powi(2);
        assert!((loss / free - 1.0).abs() < 1e-6, "{loss} {free}");
        let root = closest * (closest + 2.0 * amplitude);
        let average = -strength / stiffness / (root * root.sqrt());
        let first = found.first_order_shift.unwrap();
        assert!((first / average - 1.0).abs() < 1e-6, "{first} {average}");
        // The mean force bends the lever towards the sample, by 0.8 % of D at the smallest
        // amplitude.
        let bent = point.physical.as_ref().unwrap().observables.mean_deflection;
        let root = (closest + bent) * (closest + bent + 2.0 * amplitude);
        // f², not f, is linear in the stiffness; harmonics are neglected.
        let shift = found.relative_shift * (1.0 + 0.5 * found.relative_shift);
        let share = -shift * stiffness / strength * root * root.sqrt();
        assert!((share - 1.0).abs() < 1e-3, "{amplitude}: {share}");
    }
    let at = |k: usize| {
        let point = &report.table[k];
        let amplitude = point.physical.as_ref().unwrap().observables.first_harmonic;
        (amplitude, point.modulation.unwrap().relative_shift)
    };
    let (amplitude, shift) = at(0);
    let large = -strength / (stiffness * (2.0 * closest * amplitude).powf(1.5));
    assert!((shift / large - 1.0).abs() < 0.003, "{shift} {large}");
    // The slope of the force at the rest position of the bent lever, 2HR/(6z³), over twice the
    // stiffness.
    let (amplitude, shift) = at(29);
    let place = closest + amplitude;
    let bent = strength / (stiffness * place * place);
    let slope = -2.0 * strength / (place - bent).powi(3);
    let small = (1.0 + slope / stiffness).sqrt() - 1.0;
    assert!((shift / small - 1.0).abs() < 0.002, "{shift} {small}");
    let refused = serde_json::json!({"closest": "1 nm"});
    let refused: ApproachOptions = read(refused).unwrap();
    let refused = approach(&case, &refused, &Control::default())
        .unwrap_err()
        .to_string();
    assert!(refused.contains("add fm"), "{refused}");
    let none = FrequencyModulationOptions {
        to: Some((0.5 * unit).into()),
        ..options
    };
    let refused = frequency_modulation(&case, &none, &Control::default()).unwrap_err();
    assert!(refused.to_string().contains("no amplitude"), "{refused}");
}

/// A shift due to attraction occurs twice on approach, outside and inside of the minimum, and twice
/// on retract at the same distances; a lower shift does not occur.
#[test]
fn a_shift_has_its_distances() {
    let case = air(10.0, 11.0, &DMT);
    let unit = 1e-9;
    let at = |shift: f64| {
        let options = FrequencyModulationOptions {
            from: Some((12.0 * unit).into()),
            to: Some((9.5 * unit).into()),
            points: 12,
            phase: 90.0,
            shift: Some(shift.into()),
            ..FrequencyModulationOptions::default()
        };
        let report = frequency_modulation(&case, &options, &Control::default()).unwrap();
        report.modulation.unwrap().setpoints.unwrap()
    };
    let found = at(-50.0);
    assert_eq!(found.len(), 4, "{found:?}");
    for (k, one) in found.iter().enumerate() {
        let shift = one.modulation_si.unwrap().frequency_shift;
        assert!((shift / -50.0 - 1.0).abs() < 1e-8, "{shift}");
        assert!((one.gap / found[3 - k].gap - 1.0).abs() < 1e-9);
        assert_eq!(one.way, [Way::Approach, Way::Retract][k / 2]);
    }
    assert!(found[0].gap > found[1].gap);
    assert!(at(-5e4).is_empty());
    // The motion there is that of the orbit study with the reported drive.
    let (one, drive) = (&found[1], found[1].modulation_si.unwrap());
    let (seen, reported) = (again(&case, one).observables, one.observables.unwrap());
    assert!(reported.peak_force > 0.0);
    assert!((seen.peak_force / reported.peak_force - 1.0).abs() < 1e-6);
    assert!((seen.first_harmonic / reported.first_harmonic - 1.0).abs() < 1e-8);
    let force = drive.drive_strength / case.physical().unwrap().scales.force;
    assert!((force / one.modulation.unwrap().drive_strength - 1.0).abs() < 1e-14);
}

/// The distances of a shift do not depend on the points of the curve. Few points have none near the lowest
/// shift; the two distances beside it are found all the same.
#[test]
fn the_distances_of_a_shift_do_not_depend_on_the_points() {
    let case = air(10.0, 11.0, &DMT);
    let curve = |points: usize, shift: Option<f64>| {
        let options = FrequencyModulationOptions {
            from: Some(30e-9.into()),
            to: Some(8e-9.into()),
            points,
            phase: 90.0,
            shift: shift.map(Into::into),
            ..FrequencyModulationOptions::default()
        };
        frequency_modulation(&case, &options, &Control::default()).unwrap()
    };
    let fine = curve(1000, None);
    let shifts = fine.table.iter().filter_map(|p| p.modulation_si);
    let least = shifts.fold(0.0, |low: f64, m| low.min(m.frequency_shift));
    for shift in [-50.0, 0.9999 * least] {
        let found = [3, 24].map(|points| {
            let report = curve(points, Some(shift));
            let setpoints = report.modulation.unwrap().setpoints.unwrap();
            setpoints.iter().map(|p| p.gap).collect::<Vec<f64>>()
        });
        assert_eq!(found[0].len(), 4, "{shift}: {found:?}");
        for other in &found[1..] {
            for (one, other) in found[0].iter().zip(other) {
                assert!((one / other - 1.0).abs() < 1e-6, "{shift}: {found:?}");
            }
        }
    }
}

/// The base of a lever of low quality moves by a tenth of the deflection or more: the tip comes
/// nearer than its deflection, and the ratio of base motion to deflection depends on the force.
/// With a hundredth of the attraction, second-order terms are a hundredth.
#[test]
fn the_first_order_takes_a_driven_base_into_account() {
    for phase in [70.0, 90.0] {
        let off = |hamaker: &str| {
            let sample = [
                "sample.law=van-der-waals",
                hamaker,
                "tip.radius=10 nm",
                "drive.actuation=base",
            ];
            let case = lever((40.0, 5.0, "100 kHz"), (10.0, 11.5), &sample);
            let unit = 1e-9;
            let options = FrequencyModulationOptions {
                from: Some((12.0 * unit).into()),
                to: Some((11.5 * unit).into()),
                points: 2,
                phase,
                ..FrequencyModulationOptions::default()
            };
            let report = frequency_modulation(&case, &options, &Control::default()).unwrap();
            let (_, found) = nearest(&report);
            found.relative_shift / found.first_order_shift.unwrap() - 1.0
        };
        let (strong, weak) = (off("sample.hamaker=2e-19 J"), off("sample.hamaker=2e-21 J"));
        assert!(strong.abs() < 0.02, "{phase}: {strong}");
        assert!((weak / strong).abs() < 0.02, "{phase}: {weak} {strong}");
    }
}

/// Whether a neck exists at drive phase 0 changes discontinuously along the curve; no orbit is lost
/// there.
#[test]
fn a_neck_at_drive_phase_0_loses_no_orbit() {
    let neck = [
        "modes=2",
        "drive.actuation=base",
        "tip.radius=10 nm",
        "sample.law=jkr",
        "sample.modulus=46.6371 MPa",
        "sample.poisson=0.49",
        "sample.work_of_adhesion=168.764 mJ/m^2",
    ];
    let case = lever((2.8 * MODAL, 10.6016, "75 kHz"), (30.0, 20.0), &neck);
    let options = FrequencyModulationOptions {
        to: Some((-10e-9).into()),
        points: 20,
        phase: 68.7,
        ..FrequencyModulationOptions::default()
    };
    let report = frequency_modulation(&case, &options, &Control::default()).unwrap();
    let reported = report.modulation.as_ref().unwrap();
    assert!(
        reported.ended.is_empty() && reported.jumps.is_empty(),
        "{reported:?}"
    );
    assert!(report.returned && report.hysteresis.is_empty());
    let necks = |p: &&ApproachPoint| p.orbit.as_ref().unwrap().states[0].last() == Some(&1.0);
    let count = report.table.iter().filter(necks).count();
    assert!(count > 0 && count < report.table.len(), "{count}");
}

/// The force of Sader and Jarvis from the shifts agrees with the law to 5 %, the accuracy of their
/// kernel.
#[test]
fn the_force_is_recovered_from_the_shifts() {
    let case = reference(1e6, 10.0, 11.0);
    let report = modulated(&case, (20.0, 10.6), 120);
    let mut compared = 0;
    for point in report.table.iter().filter(|p| p.way == Way::Approach) {
        let found = point.modulation.unwrap();
        if found.closest * 1e9 * case.physical().unwrap().scales.length > 3.0 {
            continue;
        }
        let share = found.sader_jarvis_force.unwrap() / found.static_force.unwrap();
        assert!((share - 1.0).abs() < 0.05, "{found:?}");
        compared += 1;
    }
    assert!(compared > 20, "{compared}");
}

/// Forces that other rows would change are warned of: by as much as they differ from those of every second row.
#[test]
fn forces_that_depend_on_the_rows_are_warned_of() {
    let case = reference(1e6, 10.0, 11.0);
    let [half, few, many] = [7, 13, 121].map(|points| modulated(&case, (20.0, 10.6), points));
    let forces = |report: &ApproachReport, way: Way| -> Vec<f64> {
        let rows = report.table.iter().filter(|p| p.way == way);
        rows.map(|p| p.modulation.unwrap().sader_jarvis_force.unwrap())
            .collect()
    };
    let size = |forces: &[f64]| forces.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
    let apart = [Way::Approach, Way::Retract].map(|way| {
        let (half, few) = (forces(&half, way), forces(&few, way));
        assert_eq!(few.len(), 2 * half.len() - 1);
        let apart: Vec<f64> = (0..half.len()).map(|k| half[k] - few[2 * k]).collect();
        size(&apart) / size(&few)
    });
    let percent = 100.0 * apart[0].max(apart[1]);
    let said = few.limits.concat();
    let stated = said.split("up to ").nth(1).unwrap();
    let stated: f64 = stated.split(' ').next().unwrap().parse().unwrap();
    assert!((stated / percent - 1.0).abs() < 0.5, "{said} {percent}");
    assert!(many.limits.is_empty(), "{:?}", many.limits);
    let three = modulated(&case, (20.0, 10.6), 3).limits.concat();
    assert!(three.contains("fewer than five rows"), "{three}");
}

/// The free lever has no orbit with amplitude zero, and none with an impossible phase.
#[test]
fn impossible_amplitudes_and_phases_are_refused() {
    let case = air(10.0, 11.0, &DMT);
    for (amplitude, phase) in [(0.0, 90.0), (f64::NAN, 90.0), (1e-3, 0.0), (1e-3, 200.0)] {
        let held = Held { amplitude, phase };
        let guess = Driven {
            frequency: case.omega(),
            strength: 1e-6,
            state: vec![0.0; 2],
        };
        assert!(held.close(&case, &guess).is_err());
    }
    let held = Held {
        amplitude: 1e-3,
        phase: 90.0,
    };
    let request = serde_json::json!({"shift": "-50 Hz"});
    let request: ApproachOptions = read(request).unwrap();
    let refused = approach(&case, &request, &Control::default())
        .unwrap_err()
        .to_string();
    assert!(refused.contains("add fm"), "{refused}");
    let free = FreeOscillation::of(&case, held).unwrap();
    // One mode driven at its tip lags by 90° at its own frequency, and the modal stiffness is the
    // spring.
    assert!((free.frequency / case.omega() - 1.0).abs() < 1e-12);
    let stiffness = free.stiffness * case.physical().unwrap().scales.stiffness;
    assert!((stiffness / 0.9 - 1.0).abs() < 1e-9, "{stiffness}");
    // A viscous force dissipates π c ω A² = πkA²/Q per period.
    let loss = std::f64::consts::PI * free.stiffness * 1e-6 / 200.0;
    assert!((free.loss / loss - 1.0).abs() < 1e-9);
}

/// The second mode of a lever answers a base that moves with the other sign than a force at its tip: the same
/// motions have the opposite phase, and the same frequency shift.
#[test]
fn a_higher_mode_of_a_driven_base_is_held_at_the_opposite_phase() {
    let shifts = [
        ("drive.actuation=tip", 90.0),
        ("drive.actuation=base", -90.0),
    ]
    .map(|(actuation, phase)| {
        let words = [
            "modes=2",
            "drive.frequency=627 kHz",
            "sample.law=van-der-waals",
            "sample.hamaker=2e-19 J",
            "tip.radius=10 nm",
            actuation,
        ];
        let case = lever((40.0, 400.0, "100 kHz"), (1.0, 3.0), &words);
        let held = |phase: f64| {
            let options = FrequencyModulationOptions {
                from: Some(3e-9.into()),
                to: Some(1.5e-9.into()),
                points: 5,
                phase,
                ..FrequencyModulationOptions::default()
            };
            frequency_modulation(&case, &options, &Control::default())
        };
        let refused = held(-phase).unwrap_err().to_string();
        assert!(
            refused.contains(&format!("give phase {phase}")),
            "{refused}"
        );
        let report = held(phase).unwrap();
        let (point, found) = nearest(&report);
        let closed = &point.observables.as_ref().unwrap();
        assert!((closed.phase - phase).abs() < 1e-6, "{}", closed.phase);
        found.frequency_shift
    });
    assert!(
        shifts[0] < 0.0 && (shifts[1] / shifts[0] - 1.0).abs() < 1e-3,
        "{shifts:?}"
    );
}
